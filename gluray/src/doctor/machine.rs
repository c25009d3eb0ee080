//! Inspects the machine. Nothing is loaded into this process. If `glxinfo` is installed, it queries
//! the driver in a process of its own.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The driver's answers.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct OpenGl {
    /// `GL_VENDOR`.
    pub vendor: String,
    /// `GL_RENDERER`.
    pub renderer: String,
    /// `GL_VERSION` of the compatibility profile; empty when there is none.
    pub version: String,
    /// `GL_VERSION` of the core profile.
    pub core_version: String,
    /// GLX rather than indirect rendering by the X server.
    pub direct: bool,
}

/// What was seen.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Machine {
    /// The library that goes into programs.
    pub library: Option<PathBuf>,
    /// `libGL.so.1`.
    pub lib_gl: Option<PathBuf>,
    /// GLVND's dispatch library: then vendor libraries are possible.
    pub glvnd: Option<PathBuf>,
    /// GLX vendor libraries, by the name between `libGLX_` and `.so`.
    pub glx_vendors: Vec<String>,
    /// EGL vendors' files.
    pub egl_vendors: Vec<String>,
    /// GLX and EGL vendors that we stand in front of, in the order in which they are tried.
    pub in_front_of: [Vec<crate::interpose::glvnd::Vendor>; 2],
    /// `DISPLAY` and `WAYLAND_DISPLAY`.
    pub display: [Option<String>; 2],
    /// An X server's socket for that display is there.
    pub display_answers: Option<bool>,
    /// What `glxinfo` said; `Err` when it could not be asked.
    pub opengl: Option<Result<OpenGl, String>>,
    /// Variables of the environment that matter.
    pub variables: Vec<(String, String)>,
    /// Hardware threads.
    pub threads: usize,
    /// The file with settings, and what is wrong in it.
    pub settings: Option<(PathBuf, Vec<String>)>,
    /// A panel runs.
    pub panel: Option<String>,
}

/// Variables that change what happens, beside our own.
const MATTER: [&str; 12] = [
    "LD_PRELOAD",
    "LD_LIBRARY_PATH",
    "LIBGL_ALWAYS_INDIRECT",
    "LIBGL_ALWAYS_SOFTWARE",
    "GALLIUM_DRIVER",
    "MESA_LOADER_DRIVER_OVERRIDE",
    "MESA_GL_VERSION_OVERRIDE",
    "__GLX_VENDOR_LIBRARY_NAME",
    "__EGL_VENDOR_LIBRARY_FILENAMES",
    "VGL_DISPLAY",
    "SNAP",
    "FLATPAK_ID",
];

/// Looks around. `library` is the one that goes into programs.
pub fn inspect(library: Option<PathBuf>) -> Machine {
    let get = crate::host::folders::variable;
    let folders = library_folders(get("LD_LIBRARY_PATH").as_deref());
    let find = |name: &str| folders.iter().map(|f| f.join(name)).find(|p| p.exists());
    let display = get("DISPLAY");
    let mut variables: Vec<(String, String)> =
        MATTER.iter().filter_map(|n| Some(((*n).to_owned(), get(n)?))).collect();
    variables.extend(
        texts()
            .filter(|(n, v)| n.starts_with("GLURAY_") && !n.ends_with("SECRET") && !v.is_empty()),
    );
    Machine {
        library,
        lib_gl: find("libGL.so.1"),
        glvnd: find("libGLdispatch.so.0"),
        glx_vendors: glx_vendors(&folders),
        egl_vendors: egl_vendors(),
        in_front_of: [
            crate::interpose::glvnd::glx_vendors(get),
            crate::interpose::glvnd::egl_vendors(get),
        ],
        display_answers: display
            .as_deref()
            .and_then(local_display)
            .map(|n| Path::new(&format!("/tmp/.X11-unix/X{n}")).exists()),
        opengl: display.is_some().then(ask_driver),
        display: [display, get("WAYLAND_DISPLAY")],
        variables,
        threads: std::thread::available_parallelism().map_or(1, usize::from),
        settings: settings(),
        panel: crate::host::panel::PanelEndpoint::find(get).map(|m| m.address.to_string()),
    }
}

/// GLVND's dispatch library.
pub fn find_glvnd() -> Option<PathBuf> {
    let folders = library_folders(crate::host::folders::variable("LD_LIBRARY_PATH").as_deref());
    folders.iter().map(|f| f.join("libGLdispatch.so.0")).find(|p| p.exists())
}

/// Folders in which the loader looks, the first first.
fn library_folders(path: Option<&str>) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = path.into_iter().flat_map(std::env::split_paths).collect();
    let triple = format!("{}-linux-gnu", std::env::consts::ARCH);
    folders.extend(
        [
            format!("/usr/lib/{triple}"),
            format!("/lib/{triple}"),
            "/usr/lib64".into(),
            "/lib64".into(),
            "/usr/lib".into(),
            "/lib".into(),
            "/usr/local/lib".into(),
        ]
        .map(PathBuf::from),
    );
    folders
}

fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect()
}

fn glx_vendors(folders: &[PathBuf]) -> Vec<String> {
    let names = folders.iter().flat_map(|f| names_in(f));
    let vendor = |n: String| Some(n.strip_prefix("libGLX_")?.split_once(".so")?.0.to_owned());
    let mut out: Vec<String> = names.filter_map(vendor).filter(|v| v != "indirect").collect();
    out.sort();
    out.dedup();
    out
}

fn egl_vendors() -> Vec<String> {
    let folders = ["/usr/share/glvnd/egl_vendor.d", "/etc/glvnd/egl_vendor.d"];
    let mut out: Vec<String> = folders
        .iter()
        .flat_map(|f| names_in(Path::new(f)))
        .filter(|n| n.ends_with(".json"))
        .collect();
    out.sort();
    out
}

/// `7` of `:7` and `:7.1`; other hosts' displays have no socket here.
fn local_display(text: &str) -> Option<u32> {
    text.strip_prefix("unix").unwrap_or(text).strip_prefix(':')?.split('.').next()?.parse().ok()
}

/// What `glxinfo -B` says, within some seconds: a display that does not answer must not hang the
/// doctor.
fn ask_driver() -> Result<OpenGl, String> {
    const PATIENCE: Duration = Duration::from_secs(15);
    let mut command = Command::new("glxinfo");
    // Not through us: the driver itself is asked.
    command
        .arg("-B")
        .env_remove("LD_PRELOAD")
        .env_remove("__GLX_VENDOR_LIBRARY_NAME")
        .env_remove("GLURAY_RUN_DIR");
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "glxinfo is not installed".to_owned(),
        _ => format!("glxinfo: {e}"),
    })?;
    let end = Instant::now() + PATIENCE;
    while child.try_wait().map_err(|e| e.to_string())?.is_none() {
        if Instant::now() > end {
            let _ = child.kill();
            let _ = child.wait();
            return Err("glxinfo did not answer".into());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = child.wait_with_output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        return Err(text.lines().next().unwrap_or("glxinfo failed without a word").to_owned());
    }
    Ok(parse_glxinfo(&String::from_utf8_lossy(&output.stdout)))
}

/// The lines of `glxinfo -B` (Mesa demos).
pub(super) fn parse_glxinfo(text: &str) -> OpenGl {
    let value = |name: &str| {
        let found = text
            .lines()
            .find_map(|l| l.trim().strip_prefix(name)?.strip_prefix(':').map(str::trim));
        found.unwrap_or_default().to_owned()
    };
    OpenGl {
        vendor: value("OpenGL vendor string"),
        renderer: value("OpenGL renderer string"),
        version: value("OpenGL version string"),
        core_version: value("OpenGL core profile version string"),
        direct: value("direct rendering") == "Yes",
    }
}

/// The environment; bytes that are not UTF-8 are shown as U+FFFD.
fn texts() -> impl Iterator<Item = (String, String)> {
    let text = |t: std::ffi::OsString| t.to_string_lossy().into_owned();
    std::env::vars_os().map(move |(name, value)| (text(name), text(value)))
}

fn settings() -> Option<(PathBuf, Vec<String>)> {
    use crate::host::config::{ConfigFile, Settings, Sources, assign};
    let sources = Sources::new(texts().collect(), Vec::new());
    let path = sources.file.clone().filter(|p| sources.file_is_required || p.exists())?;
    let problems = match ConfigFile::read(&path) {
        Ok(file) => assign(&Settings::default(), &file.all_assignments())
            .1
            .iter()
            .map(ToString::to_string)
            .collect(),
        Err(e) => vec![datasets::cli::report(&e.into())],
    };
    Some((path, problems))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displays_of_this_machine_have_numbers() {
        assert_eq!(
            [":7", ":7.1", "unix:3", "host:1", "", ":x"].map(local_display),
            [Some(7), Some(7), Some(3), None, None, None]
        );
    }

    #[test]
    fn the_lines_of_glxinfo_are_found() {
        let text = "name of display: :99\ndirect rendering: Yes\nExtended renderer info \
                    (GLX_MESA_query_renderer):\n    Vendor: Mesa (0xffffffff)\nOpenGL vendor \
                    string: Mesa/X.org\nOpenGL renderer string: llvmpipe (LLVM 15.0.6, 256 \
                    bits)\nOpenGL core profile version string: 4.5 (Core Profile) Mesa \
                    22.3.6\nOpenGL version string: 4.5 (Compatibility Profile) Mesa 22.3.6\n";
        let gl = parse_glxinfo(text);
        assert!(
            gl.direct
                && gl.renderer.starts_with("llvmpipe")
                && gl.core_version.contains("Core")
                && gl.version.contains("Compat")
        );
        assert_eq!(parse_glxinfo("nonsense"), OpenGl::default());
    }
}
