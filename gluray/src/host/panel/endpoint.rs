//! Publishes and finds the panel's endpoint: an address and a secret, from the environment or from
//! a file that only the user can read.
//!
//! The file is `panel.json` in `$XDG_RUNTIME_DIR/gluray`, with mode 0600. It is removed when the
//! panel ends. A file that belongs to another user, or that others may read, is rejected. An
//! address off loopback is rejected whatever its source.

use crate::host::folders;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::net::SocketAddr;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// The number of hexadecimal digits in each half of a secret: 128 bits.
const HALF: usize = 32;

/// The secret that both ends share. The library sends the first half, and the panel replies with
/// the second. Neither a program of another user nor one that took over the panel's port can pass.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Secret(String);

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret(…)")
    }
}

impl TryFrom<String> for Secret {
    type Error = &'static str;
    fn try_from(text: String) -> Result<Secret, &'static str> {
        match text.len() == 2 * HALF && text.bytes().all(|b| b.is_ascii_hexdigit()) {
            true => Ok(Secret(text)),
            false => Err("a secret has 64 hexadecimal digits"),
        }
    }
}

impl From<Secret> for String {
    fn from(s: Secret) -> String {
        s.0
    }
}

impl Secret {
    /// Creates a secret from random bytes.
    pub fn of(bytes: [u8; HALF]) -> Secret {
        Secret(bytes.iter().map(|b| format!("{b:02x}")).collect())
    }

    /// The half that the library sends.
    pub fn token(&self) -> &str {
        &self.0[..HALF]
    }

    /// The half that the panel replies with.
    pub fn answer(&self) -> &str {
        &self.0[HALF..]
    }
}

/// Compares in a time that does not reveal how much of the input matched.
pub fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |d, (x, y)| d | (x ^ y)) == 0
}

/// The panel's address and secret.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanelEndpoint {
    /// The address of the link, not of the page.
    pub address: SocketAddr,
    /// The shared secret.
    pub secret: Secret,
}

/// The reason why a file in the runtime folder is rejected or cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum PanelEndpointError {
    /// Nothing names a runtime folder.
    #[error("there is no folder for running programs; set XDG_RUNTIME_DIR")]
    NoFolder,
    /// The folder or file is open to others.
    #[error("{}: {what}; only its user may have it: remove it, or set XDG_RUNTIME_DIR to a folder \
             of your own", path.display())]
    NotPrivate {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The system refuses.
    #[error("{}: cannot be used", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl PanelEndpoint {
    /// Finds the endpoint by `GLURAY_PANEL` and `GLURAY_PANEL_SECRET` when both are set and valid,
    /// otherwise by the file.
    pub fn find(variable: impl Fn(&str) -> Option<String>) -> Option<PanelEndpoint> {
        let named = variable("GLURAY_PANEL").zip(variable("GLURAY_PANEL_SECRET"));
        let endpoint = match named {
            Some((address, secret)) => PanelEndpoint {
                address: address.parse().ok()?,
                secret: Secret::try_from(secret).ok()?,
            },
            None => PanelEndpoint::read(&file_in(&folders::runtime(variable)?))?,
        };
        endpoint.address.ip().is_loopback().then_some(endpoint)
    }

    /// Reads a file if it can be trusted.
    pub fn read(path: &Path) -> Option<PanelEndpoint> {
        use std::io::Read;
        let (file, about) = folders::open_own(path)?;
        if about.mode() & 0o077 != 0 || about.len() > 4096 {
            return None;
        }
        let mut text = String::new();
        file.take(4096).read_to_string(&mut text).ok()?;
        serde_json::from_str::<PanelEndpoint>(&text).ok().filter(|m| m.address.ip().is_loopback())
    }

    /// Writes the file into a folder, which is created if it is missing. The file is removed when
    /// the guard is dropped.
    pub fn publish(&self, folder: &Path) -> Result<EndpointFile, PanelEndpointError> {
        let io = |path: &Path| {
            let path = path.to_path_buf();
            move |source| PanelEndpointError::Io { path, source }
        };
        std::fs::DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(folder)
            .map_err(io(folder))?;
        let about = std::fs::symlink_metadata(folder).map_err(io(folder))?;
        if !about.is_dir() || Some(about.uid()) != folders::user_id() || about.mode() & 0o022 != 0 {
            let what = "is no folder of yours, or others may write to it".into();
            return Err(PanelEndpointError::NotPrivate { path: folder.into(), what });
        }
        let path = file_in(folder);
        let temporary = folder.join(format!("panel.{}.partial", std::process::id()));
        let write = || -> io::Result<()> {
            // Removes the leftover of an earlier process with the same id.
            let _ = std::fs::remove_file(&temporary);
            let mut file = std::fs::OpenOptions::new()
                .write(true)
                .create_new(true)
                .mode(0o600)
                .open(&temporary)?;
            file.write_all(&serde_json::to_vec(self).map_err(io::Error::other)?)?;
            std::fs::rename(&temporary, &path)
        };
        write().map_err(io(&path))?;
        Ok(EndpointFile { path, endpoint: self.clone() })
    }
}

/// The endpoint file in a folder.
pub fn file_in(folder: &Path) -> PathBuf {
    folder.join("panel.json")
}

/// A published endpoint.
#[derive(Debug)]
pub struct EndpointFile {
    path: PathBuf,
    endpoint: PanelEndpoint,
}

impl Drop for EndpointFile {
    fn drop(&mut self) {
        // A later panel's file stays.
        if PanelEndpoint::read(&self.path).is_some_and(|m| m == self.endpoint) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn endpoint(address: &str) -> PanelEndpoint {
        PanelEndpoint { address: address.parse().unwrap(), secret: Secret::of([7; HALF]) }
    }

    #[test]
    fn the_file_is_private_is_believed_and_goes_with_the_panel() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("gluray");
        let m = endpoint("127.0.0.1:9");
        let published = m.publish(&folder).unwrap();
        let path = file_in(&folder);
        assert_eq!(std::fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        assert_eq!(std::fs::metadata(&folder).unwrap().mode() & 0o777, 0o700);
        let runtime = dir.path().to_str().unwrap().to_owned();
        assert_eq!(
            PanelEndpoint::find(|n| (n == "XDG_RUNTIME_DIR").then(|| runtime.clone())),
            Some(m)
        );

        // Another panel takes over; the first one's end does not take its file away.
        let second = endpoint("127.0.0.1:10");
        let published_second = second.publish(&folder).unwrap();
        drop(published);
        assert_eq!(PanelEndpoint::read(&path), Some(second));
        drop(published_second);
        assert!(!path.exists());
    }

    #[test]
    fn files_of_others_open_files_and_other_hosts_are_not_believed() {
        let dir = tempfile::tempdir().unwrap();
        let path = file_in(dir.path());
        let _published = endpoint("127.0.0.1:9").publish(dir.path()).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
        assert_eq!(PanelEndpoint::read(&path), None, "others may read it");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        assert!(PanelEndpoint::read(&path).is_some());
        let _abroad = endpoint("192.0.2.1:9").publish(dir.path()).unwrap();
        assert_eq!(PanelEndpoint::read(&path), None, "not on loopback");
        let secret = String::from(Secret::of([1; HALF]));
        let by_variables = |address: &str, secret: &str| {
            let set =
                [("GLURAY_PANEL", address.to_owned()), ("GLURAY_PANEL_SECRET", secret.to_owned())];
            PanelEndpoint::find(move |n| set.iter().find(|(k, _)| *k == n).map(|(_, v)| v.clone()))
        };
        assert!(
            by_variables("127.0.0.1:80", &secret).is_some()
                && by_variables("[::1]:80", &secret).is_some()
        );
        for (address, secret) in
            [("10.0.0.1:80", secret.as_str()), ("localhost", &secret), ("127.0.0.1:80", "short")]
        {
            assert_eq!(by_variables(address, secret), None, "{address}");
        }
        // Names that lead elsewhere are not followed, not even to a file that would be believed.
        let _here = endpoint("127.0.0.1:9").publish(dir.path()).unwrap();
        let elsewhere = dir.path().join("elsewhere.json");
        std::fs::rename(&path, &elsewhere).unwrap();
        assert!(PanelEndpoint::read(&elsewhere).is_some());
        std::os::unix::fs::symlink(&elsewhere, &path).unwrap();
        assert_eq!(PanelEndpoint::read(&path), None, "a link");
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        assert_eq!(PanelEndpoint::read(&path), None, "a folder");
        std::fs::remove_dir(&path).unwrap();
        std::fs::set_permissions(dir.path(), std::fs::Permissions::from_mode(0o777)).unwrap();
        assert!(matches!(
            endpoint("127.0.0.1:9").publish(dir.path()),
            Err(PanelEndpointError::NotPrivate { .. })
        ));
    }

    #[test]
    fn a_fifo_in_the_place_of_the_file_holds_nobody_up() {
        let dir = tempfile::tempdir().unwrap();
        let path = file_in(dir.path());
        let made = std::process::Command::new("mkfifo").arg("-m600").arg(&path).status().unwrap();
        assert!(made.success());
        let (sender, receiver) = std::sync::mpsc::channel();
        let read = path.clone();
        std::thread::spawn(move || sender.send(PanelEndpoint::read(&read)));
        // Whoever waits for a writer waits for ever; the time is for a busy machine.
        let answer = receiver.recv_timeout(std::time::Duration::from_secs(60));
        assert_eq!(answer, Ok(None), "looked at before it is waited for");
    }

    #[test]
    fn secrets_are_not_printed_and_compared_whole() {
        let s = Secret::of([0xab; HALF]);
        assert_eq!((s.token().len(), s.answer().len()), (HALF, HALF));
        assert!(!format!("{s:?}").contains("ab"));
        assert!(same("abc", "abc") && !same("abc", "abd") && !same("abc", "ab"));
    }
}
