//! Locates the user's files (XDG Base Directory Specification 0.8).

use std::fs::{File, Metadata};
use std::path::{Path, PathBuf};

fn base(
    variable: impl Fn(&str) -> Option<String>,
    name: &str,
    below_home: &str,
) -> Option<PathBuf> {
    // "All paths set in these environment variables must be absolute. If ... relative ... consider
    // the path invalid."
    let set = variable(name).map(PathBuf::from).filter(|p| p.is_absolute());
    set.or_else(|| Some(PathBuf::from(variable("HOME")?).join(below_home)))
        .map(|p| p.join("gluray"))
}

/// An environment variable of this process, when set and text.
pub fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|v| !v.is_empty())
}

/// Settings: `$XDG_CONFIG_HOME/gluray`.
pub fn config(variable: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    base(variable, "XDG_CONFIG_HOME", ".config")
}

/// What can be made again: `$XDG_CACHE_HOME/gluray`.
pub fn cache(variable: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    base(variable, "XDG_CACHE_HOME", ".cache")
}

/// Reports of runs: `$XDG_STATE_HOME/gluray`.
pub fn state(variable: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    base(variable, "XDG_STATE_HOME", ".local/state")
}

/// Where running processes meet: `$XDG_RUNTIME_DIR/gluray`. Without that variable `gluray-UID` in
/// the folder for temporary files, which only its owner may enter (whoever makes it checks that).
pub fn runtime(variable: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    let set = variable("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|p| p.is_absolute());
    set.map(|p| p.join("gluray"))
        .or_else(|| Some(std::env::temp_dir().join(format!("gluray-{}", user_id()?))))
}

/// Reads a plain text file that somebody named. It never waits: a FIFO or a device in its place is
/// an error.
pub(crate) fn read_plain(path: &Path) -> std::io::Result<String> {
    use std::os::unix::fs::OpenOptionsExt;
    let flags = libc::O_NONBLOCK | libc::O_CLOEXEC | libc::O_NOCTTY;
    let file = File::options().read(true).custom_flags(flags).open(path)?;
    match file.metadata()?.is_file() {
        true => std::io::read_to_string(file),
        false => Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, "is no plain file")),
    }
}

/// Opens a plain file of this user's for reading, with what is known of it; `None` for anything
/// else. It never waits, whatever lies there: a FIFO of somebody else's in a folder that is shared,
/// a device, a link to one.
pub(crate) fn open_own(path: &Path) -> Option<(File, Metadata)> {
    use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
    let flags = libc::O_NOFOLLOW | libc::O_NONBLOCK | libc::O_CLOEXEC | libc::O_NOCTTY;
    let file = File::options().read(true).custom_flags(flags).open(path).ok()?;
    // Of what was opened, not of what may lie there by now.
    let about = file.metadata().ok()?;
    (about.is_file() && Some(about.uid()) == user_id()).then_some((file, about))
}

/// The user this process runs as.
pub fn user_id() -> Option<u32> {
    use std::os::unix::fs::MetadataExt;
    // /proc/self belongs to the process's effective user.
    std::fs::metadata("/proc/self").ok().map(|m| m.uid())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_follow_the_variables_and_relative_ones_count_as_unset() {
        let with = |set: &'static [(&'static str, &'static str)]| {
            move |n: &str| set.iter().find(|(k, _)| *k == n).map(|(_, v)| (*v).to_owned())
        };
        assert_eq!(
            config(with(&[("XDG_CONFIG_HOME", "/c"), ("HOME", "/h")])),
            Some("/c/gluray".into())
        );
        assert_eq!(
            config(with(&[("XDG_CONFIG_HOME", "c"), ("HOME", "/h")])),
            Some("/h/.config/gluray".into())
        );
        assert_eq!(state(with(&[("HOME", "/h")])), Some("/h/.local/state/gluray".into()));
        assert_eq!(state(with(&[])), None);
        assert_eq!(runtime(with(&[("XDG_RUNTIME_DIR", "/r")])), Some("/r/gluray".into()));
        assert!(
            runtime(with(&[]))
                .unwrap()
                .file_name()
                .unwrap()
                .to_string_lossy()
                .starts_with("gluray-")
        );
    }
}
