//! Finds and loads Embree.
//!
//! The search order is: the file or folder that `RTSV_EMBREE3` or `RTSV_EMBREE4` names;
//! `target/peers`, where the set-up program installs baselines; the `embreex` package of the active
//! Python environment and of `.venv`, which contains Embree 4; and finally the system's loader.

#![expect(
    unsafe_code,
    reason = "a C library cannot be loaded and its symbols cannot be typed without it"
)]

use super::abi::{self, Calls, Queries, Widths};
use crate::baselines::BaselineError;
use std::path::{Path, PathBuf};

/// Version of the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// Embree 3.
    V3,
    /// Embree 4.
    V4,
}

impl Version {
    fn number(self) -> u32 {
        match self {
            Version::V3 => 3,
            Version::V4 => 4,
        }
    }
    /// The environment variable that names a library to use instead of the first one found.
    pub fn variable(self) -> &'static str {
        match self {
            Version::V3 => "RTSV_EMBREE3",
            Version::V4 => "RTSV_EMBREE4",
        }
    }
    fn cure(self) -> String {
        let package = match self {
            Version::V3 => "install Debian's or Ubuntu's `libembree-dev`, version 3",
            Version::V4 => "`pip install embreex` in a Python environment",
        };
        format!("{package}, or set {} to the library's path", self.variable())
    }
}

/// A loaded library. It stays loaded until the program ends: its worker threads, and those of a
/// bundled TBB, outlive the devices, and unloading would remove the code that they run (observed as
/// a crash in about every second run).
#[derive(Clone)]
pub struct Embree {
    pub(super) calls: Calls,
    /// Version, such as `3.13.5`.
    version: String,
    /// The loaded file, or the name that the system's loader resolved.
    path: String,
}

impl Embree {
    /// Loads the first usable library.
    pub fn load(version: Version) -> Result<Embree, BaselineError> {
        let mut unusable = None;
        for candidate in candidates(version) {
            match Embree::open(version, &candidate) {
                Ok(e) => return Ok(e),
                // Report a file that exists but fails to load, but not a name that the loader
                // cannot resolve.
                Err(e) if candidate.is_absolute() => unusable = Some(e),
                Err(_) => {}
            }
        }
        Err(unusable.unwrap_or_else(|| BaselineError::NotFound {
            name: format!("Embree {}", version.number()),
            looked_in: format!(
                "{}, target/peers, the Python environment, the system's libraries",
                version.variable()
            ),
            cure: version.cure(),
        }))
    }

    /// Loads one file.
    pub fn open(version: Version, path: &Path) -> Result<Embree, BaselineError> {
        let shown = path.display().to_string();
        let unusable = |reason: String| BaselineError::Unusable { path: shown.clone(), reason };
        // The loader's own message (missing file, wrong format) is in the cause.
        let because = |e: libloading::Error| {
            let cause = std::error::Error::source(&e).map_or(String::new(), |c| format!(": {c}"));
            unusable(format!("{e}{cause}"))
        };
        // SAFETY: loading runs the library's initialisers. The candidates are Embree by name or by
        // the user's choice, whose initialisers only set up its own globals.
        let library = unsafe { libloading::Library::new(path) }.map_err(because)?;
        // SAFETY: `calls` types each symbol as the headers of this major version declare it; that
        // it is this version is checked below, before anything but device functions, which both
        // versions share, is called.
        let calls = unsafe { calls(&library, version) }.map_err(|e| unusable(e.to_string()))?;
        std::mem::forget(library);
        let mut embree = Embree { calls, version: String::new(), path: shown.clone() };
        let numbers = embree.version_numbers().map_err(unusable)?;
        if numbers[0] != i64::from(version.number()) {
            return Err(unusable(format!("it is Embree {}, not {}", numbers[0], version.number())));
        }
        embree.version = format!("{}.{}.{}", numbers[0], numbers[1], numbers[2]);
        Ok(embree)
    }

    fn version_numbers(&self) -> Result<[i64; 3], String> {
        let c = &self.calls;
        // SAFETY: device functions have the same signature in both versions; the configuration is a
        // C string; the device is used only when it is not null and is released once.
        unsafe {
            let device = (c.new_device)(c"threads=1".as_ptr());
            if device.is_null() {
                return Err(format!(
                    "no device: {}",
                    abi::error_name((c.get_device_error)(device))
                ));
            }
            let properties = [
                abi::PROPERTY_VERSION_MAJOR,
                abi::PROPERTY_VERSION_MINOR,
                abi::PROPERTY_VERSION_PATCH,
            ];
            let numbers = properties.map(|p| (c.get_device_property)(device, p) as i64);
            (c.release_device)(device);
            Ok(numbers)
        }
    }

    /// `Embree 4.4.0`.
    pub fn name(&self) -> String {
        format!("Embree {}", self.version)
    }

    /// `4.4.0`.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The loaded file.
    pub fn path(&self) -> &str {
        &self.path
    }
}

/// # Safety
/// `library` is Embree of the major version `version`.
unsafe fn calls(
    library: &libloading::Library,
    version: Version,
) -> Result<Calls, libloading::Error> {
    macro_rules! symbol {
        ($name:expr) => {
            // SAFETY: the caller says which library this is; `abi` repeats its declarations.
            *unsafe { library.get(concat!($name, "\0").as_bytes()) }?
        };
    }
    macro_rules! widths {
        ($name:literal) => {
            Widths {
                one: symbol!(concat!($name, "1")),
                four: symbol!(concat!($name, "4")),
                eight: symbol!(concat!($name, "8")),
                sixteen: symbol!(concat!($name, "16")),
            }
        };
    }
    Ok(Calls {
        new_device: symbol!("rtcNewDevice"),
        release_device: symbol!("rtcReleaseDevice"),
        get_device_property: symbol!("rtcGetDeviceProperty"),
        get_device_error: symbol!("rtcGetDeviceError"),
        set_memory_monitor: symbol!("rtcSetDeviceMemoryMonitorFunction"),
        new_scene: symbol!("rtcNewScene"),
        release_scene: symbol!("rtcReleaseScene"),
        set_scene_flags: symbol!("rtcSetSceneFlags"),
        set_scene_build_quality: symbol!("rtcSetSceneBuildQuality"),
        commit_scene: symbol!("rtcCommitScene"),
        new_geometry: symbol!("rtcNewGeometry"),
        release_geometry: symbol!("rtcReleaseGeometry"),
        set_geometry_build_quality: symbol!("rtcSetGeometryBuildQuality"),
        commit_geometry: symbol!("rtcCommitGeometry"),
        attach_geometry: symbol!("rtcAttachGeometry"),
        set_geometry_instanced_scene: symbol!("rtcSetGeometryInstancedScene"),
        set_geometry_transform: symbol!("rtcSetGeometryTransform"),
        set_shared_geometry_buffer: symbol!("rtcSetSharedGeometryBuffer"),
        queries: match version {
            Version::V3 => {
                Queries::V3 { intersect: widths!("rtcIntersect"), occluded: widths!("rtcOccluded") }
            }
            Version::V4 => {
                Queries::V4 { intersect: widths!("rtcIntersect"), occluded: widths!("rtcOccluded") }
            }
        },
    })
}

/// Files and loader names to try, in order of preference.
fn candidates(version: Version) -> Vec<PathBuf> {
    let stem = format!("libembree{}", version.number());
    let mut found = vec![];
    if let Some(named) = std::env::var_os(version.variable()) {
        // If a library is named explicitly, nothing else is tried, so that the measured library is
        // always the requested one.
        let named = PathBuf::from(named);
        if named.is_dir() {
            collect(&named, &stem, 6, &mut found);
        }
        if found.is_empty() {
            found.push(std::path::absolute(&named).unwrap_or(named));
        }
        return found;
    }
    for dir in peer_dirs() {
        collect(&dir, &stem, 8, &mut found);
    }
    found.extend(
        [format!("{stem}.so.{}", version.number()), format!("{stem}.so")].map(PathBuf::from),
    );
    found
}

/// Directories that may contain baselines.
fn peer_dirs() -> Vec<PathBuf> {
    let mut dirs = vec![PathBuf::from("target/peers")];
    // The program may be started from any directory, so the build folder of the executable is also
    // searched for `peers`.
    if let Ok(exe) = std::env::current_exe() {
        dirs.extend(exe.ancestors().skip(1).take(3).map(|a| a.join("peers")));
    }
    let environments =
        [std::env::var_os("VIRTUAL_ENV").map(PathBuf::from), Some(PathBuf::from(".venv"))];
    dirs.extend(environments.into_iter().flatten().map(|e| e.join("lib")));
    dirs.into_iter().filter_map(|d| std::path::absolute(d).ok()).filter(|d| d.is_dir()).collect()
}

/// Files below `dir` whose names begin with `stem` and contain `.so`, sorted by name.
fn collect(dir: &Path, stem: &str, depth: u32, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(dir) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    paths.sort();
    for p in paths {
        let name = p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if p.is_dir() && !p.is_symlink() && depth > 0 {
            collect(&p, stem, depth - 1, found);
        } else if name.starts_with(stem) && name.contains(".so") {
            found.push(p);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_that_is_not_embree_is_named_with_the_missing_symbol() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("libembree4.so");
        std::fs::write(&path, "not a library").unwrap();
        let e = Embree::open(Version::V4, &path).err().unwrap().to_string();
        assert!(e.contains("libembree4.so cannot be used"), "{e}");
        assert!(
            e.contains("ELF") || e.contains("too short"),
            "the loader's reason is missing: {e}"
        );
    }

    #[test]
    fn libraries_deep_in_a_folder_are_found() {
        let dir = tempfile::tempdir().unwrap();
        let deep = dir.path().join("lib/python3.11/site-packages/embreex.libs");
        std::fs::create_dir_all(&deep).unwrap();
        for name in ["libembree4-1a2b.so.4", "libembree3.so.3", "libtbb.so.12", "embree4.h"] {
            std::fs::write(deep.join(name), "").unwrap();
        }
        let mut found = vec![];
        collect(dir.path(), "libembree4", 6, &mut found);
        assert_eq!(found, [deep.join("libembree4-1a2b.so.4")]);
    }

    #[test]
    fn not_found_says_where_and_how_to_get_it() {
        let e = BaselineError::NotFound {
            name: "Embree 4".into(),
            looked_in: "x".into(),
            cure: Version::V4.cure(),
        };
        let text = e.to_string();
        assert!(text.contains("pip install embreex") && text.contains("RTSV_EMBREE4"), "{text}");
    }
}
