//! Searching and loading IceT.
use super::IcetError;
use libloading::os::unix::{Library as Dynamic, RTLD_GLOBAL, RTLD_LOCAL, RTLD_NOW};
use std::ffi::{c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// The variable that names IceT's core library.
const VARIABLE: &str = "RTSV_ICET";
/// Names of the file: in ParaView, and standalone.
const NAMES: &[&str] = &["libvtkIceTCore-pv", "libvtkIceTCore", "libIceTCore.so"];

fn folders() -> Vec<PathBuf> {
    let multiarch = format!("/usr/lib/{}-linux-gnu", std::env::consts::ARCH);
    [multiarch.as_str(), "/usr/lib64", "/usr/lib64/paraview", "/usr/lib", "/usr/local/lib"]
        .map(PathBuf::from)
        .to_vec()
}

/// IceT's core library on this machine.
///
/// # Errors
/// [`IcetError::Missing`].
pub fn find() -> Result<PathBuf, IcetError> {
    if let Some(path) =
        std::env::var_os(VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from)
    {
        return if path.is_file() {
            Ok(path)
        } else {
            Err(IcetError::Missing { looked_for: format!("{VARIABLE}={}", path.display()) })
        };
    }
    for folder in folders() {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        let mut files: Vec<PathBuf> =
            entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        files.sort();
        for name in NAMES {
            let is_it = |path: &&PathBuf| {
                let file = path
                    .file_name()
                    .map(|file| file.to_string_lossy().into_owned())
                    .unwrap_or_default();
                file.starts_with(name) && file.contains(".so")
            };
            if let Some(path) = files.iter().find(is_it) {
                return Ok(path.clone());
            }
        }
    }
    Err(missing())
}

/// The error if no library is found.
pub fn missing() -> IcetError {
    let folders: Vec<String> =
        folders().iter().map(|folder| folder.display().to_string()).collect();
    IcetError::Missing { looked_for: format!("{} in {}", NAMES.join(", "), folders.join(", ")) }
}

macro_rules! functions {
    ($($field:ident: $symbol:literal, fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// IceT's functions. An image is a struct of one pointer, which the ABI passes as that
        /// pointer.
        pub(super) struct Functions {
            $(pub(super) $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            fn of(library: &Dynamic, path: &Path) -> Result<Self, IcetError> {
                Ok(Self {
                    $($field: {
                        // SAFETY: arguments as in IceT.h of version 2.2, which has not changed them
                        // since 2.0.
                        let symbol = unsafe {
                            library.get::<unsafe extern "C" fn($($argument),*) $(-> $result)?>($symbol.as_bytes())
                        };
                        *symbol.map_err(|_| IcetError::Unusable {
                            path: path.to_path_buf(),
                            reason: format!("it has no function {}", $symbol),
                        })?
                    },)*
                })
            }
        }
    };
}

functions! {
    create_context: "icetCreateContext", fn(*mut c_void) -> *mut c_void;
    diagnostics: "icetDiagnostics", fn(u32);
    composite_mode: "icetCompositeMode", fn(u32);
    set_color_format: "icetSetColorFormat", fn(u32);
    set_depth_format: "icetSetDepthFormat", fn(u32);
    reset_tiles: "icetResetTiles", fn();
    add_tile: "icetAddTile", fn(c_int, c_int, c_int, c_int, c_int) -> c_int;
    strategy: "icetStrategy", fn(u32);
    single_image_strategy: "icetSingleImageStrategy", fn(u32);
    bounding_vertices: "icetBoundingVertices", fn(c_int, u32, c_int, c_int, *const c_void);
    enable: "icetEnable", fn(u32);
    composite_order: "icetCompositeOrder", fn(*const c_int);
    composite_image: "icetCompositeImage", fn(*const c_void, *const c_void, *const c_int, *const f64, *const f64, *const f32) -> *mut c_void;
    image_colors_u8: "icetImageGetColorcub", fn(*mut c_void) -> *const [u8; 4];
    image_colors_f32: "icetImageGetColorcf", fn(*mut c_void) -> *const [f32; 4];
    get_error: "icetGetError", fn() -> u32;
}

/// A loaded IceT. Never unloaded: contexts and communicators inside refer to it.
pub(super) struct Library {
    pub(super) functions: Functions,
    _dynamic: ManuallyDrop<Dynamic>,
}

impl Library {
    /// Loads IceT. With `private`, loads a copy of the file, so that this rank has its own global
    /// variables.
    pub(super) fn open(path: &Path, private: bool) -> Result<Self, IcetError> {
        let unusable = |reason: String| IcetError::Unusable { path: path.to_path_buf(), reason };
        let dynamic = if private {
            static COPIES: AtomicU64 = AtomicU64::new(0);
            let number = COPIES.fetch_add(1, Ordering::Relaxed);
            // Ranks may have copies of this library too (SMPI), and so of the counter; the address
            // of a local variable differs between them.
            let salt = &raw const number as usize;
            let name = format!("composite-icet-{}-{salt:x}-{number}.so", std::process::id());
            let copy = std::env::temp_dir().join(name);
            std::fs::copy(path, &copy)
                .map_err(|e| unusable(format!("no copy at {}: {e}", copy.display())))?;
            // SAFETY: IceT's core has no initialisers.
            let dynamic = unsafe { Dynamic::open(Some(&copy), RTLD_NOW | RTLD_LOCAL) };
            // It stays mapped after its name is removed.
            let _ = std::fs::remove_file(&copy);
            dynamic
        } else {
            // SAFETY: as above. Global, because the MPI layer looks for its symbols.
            unsafe { Dynamic::open(Some(path), RTLD_NOW | RTLD_GLOBAL) }
        };
        let dynamic = dynamic.map_err(|error| unusable(error.to_string()))?;
        let functions = Functions::of(&dynamic, path)?;
        Ok(Self { functions, _dynamic: ManuallyDrop::new(dynamic) })
    }

    /// A communicator of IceT's own MPI layer, from the library in the same folder as the core.
    pub(super) fn own_mpi_layer(
        &self,
        core: &Path,
        world: usize,
    ) -> Result<*mut c_void, IcetError> {
        let name =
            core.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let path = core.with_file_name(name.replace("IceTCore", "IceTMPI"));
        let unusable = |reason: String| IcetError::Unusable { path: path.clone(), reason };
        // SAFETY: it needs IceT's core and the MPI that this process uses, and both are loaded.
        let layer = unsafe { Dynamic::open(Some(&path), RTLD_NOW | RTLD_GLOBAL) };
        let layer = ManuallyDrop::new(layer.map_err(|error| unusable(error.to_string()))?);
        // SAFETY: takes an MPI_Comm, a pointer in Open MPI, and gives IceT's communicator
        // (IceTMPI.h).
        unsafe {
            let create = layer
                .get::<unsafe extern "C" fn(usize) -> *mut c_void>(b"icetCreateMPICommunicator");
            let create = create.map_err(|error| unusable(error.to_string()))?;
            Ok(create(world))
        }
    }
}
