//! From `catalyst_initialize` to `catalyst_finalize`: the ranks, the settings, the calls so far.

use crate::node::Node;
use crate::pictures::{Group, PictureError, file_of, photograph, picture};
use crate::settings::{Settings, SettingsError};
use composite::comm::mpi::MpiError;
use composite::{CommError, Communicator};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The variable that names the file of settings.
pub const SETTINGS: &str = "CATALYST_RTSV_SETTINGS";

/// Longest wait for another rank, without `timeout_secs`.
const TIMEOUT: Duration = Duration::from_secs(60);
/// The number that ranks give whose settings are the same.
const HASH_BYTES: usize = 8;

/// Why there is no session, or a call of one has failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The settings.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// MPI.
    #[error(transparent)]
    Mpi(#[from] MpiError),
    /// The transport.
    #[error(transparent)]
    Comm(#[from] CommError),
    /// The communicator is no number.
    #[error(
        "catalyst/mpi_comm is no integer: give MPI_Comm_c2f of the communicator, or leave it out \
         for MPI_COMM_WORLD"
    )]
    Communicator,
    /// Ranks have read different settings.
    #[error("rank {rank} has other settings than rank 0: give all ranks the same file")]
    OtherSettings {
        /// The first that differs.
        rank: usize,
    },
    /// An earlier failure has ended the group of ranks.
    #[error("no more pictures are made, because a rank has failed: {reason}")]
    Ended {
        /// The failure.
        reason: String,
    },
    /// Some of the pictures of a step could not be made.
    #[error("{}", reasons.join("\n"))]
    Pictures {
        /// The file and the reason of each.
        reasons: Vec<String>,
    },
}

/// A simulation that has initialized Catalyst.
pub struct Session {
    comm: Box<dyn Communicator>,
    settings: Settings,
    timeout: Duration,
    /// Calls of `execute` so far.
    calls: u64,
    /// Files that were written in the last call.
    written: Vec<PathBuf>,
    /// Warnings so far, each once.
    warnings: BTreeSet<String>,
    /// Those that nobody was told yet.
    unsaid: Vec<String>,
    /// Why the group of ranks has ended, if it has.
    ended: Option<String>,
}

impl Session {
    /// Starts with what the simulation gives to `catalyst_initialize`, over the ranks of its
    /// [`communicator`]. All of them call it.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn new(params: &Node<'_>, comm: Box<dyn Communicator>) -> Result<Session, SessionError> {
        let (file, mut warnings) = settings_file(params, std::env::var_os(SETTINGS));
        let settings = file.as_deref().map_or(Ok(Settings::without_file()), Settings::read);
        let mut session = Session::over(comm, settings)?;
        if file.is_none() {
            warnings.push(format!(
                "{SETTINGS} names no file of settings, so the surface of the first channel is drawn"
            ));
        }
        session.warn(warnings);
        Ok(session)
    }

    /// Starts over ranks that are there.
    ///
    /// # Errors
    /// Settings that cannot be read, and those that differ between ranks.
    pub fn over(
        mut comm: Box<dyn Communicator>,
        settings: Result<Settings, SettingsError>,
    ) -> Result<Session, SessionError> {
        let hash = settings.as_ref().map_or([0xff; HASH_BYTES], |s| hash_of(s).to_le_bytes());
        let all = comm.all_gather(&hash, HASH_BYTES, TIMEOUT)?;
        let settings = settings?;
        if let Some(rank) = all.iter().position(|other| *other != all[0]) {
            return Err(SessionError::OtherSettings { rank });
        }
        let timeout = settings.timeout_secs.map_or(TIMEOUT, Duration::from_secs_f64);
        Ok(Session {
            comm,
            settings,
            timeout,
            calls: 0,
            written: Vec::new(),
            warnings: BTreeSet::new(),
            unsaid: Vec::new(),
            ended: None,
        })
    }

    /// Makes the pictures of one time step. All ranks call it.
    ///
    /// # Errors
    /// [`SessionError::Pictures`] names each picture that could not be made; the others are there.
    /// [`SessionError::Ended`] after a failure that ends the ranks' work together.
    pub fn execute(&mut self, params: &Node<'_>) -> Result<(), SessionError> {
        if let Some(reason) = &self.ended {
            return Err(SessionError::Ended { reason: reason.clone() });
        }
        let state = |names: [&str; 2]| names.iter().find_map(|n| params.get(n));
        let step = state(["catalyst/state/timestep", "catalyst/state/cycle"]).and_then(Node::i64);
        let step = step.unwrap_or(i64::try_from(self.calls).unwrap_or(i64::MAX));
        let time = params.get("catalyst/state/time").and_then(Node::f64).unwrap_or(0.0);
        let call = self.calls;
        self.calls += 1;
        self.written.clear();
        let mut reasons = Vec::new();
        // Cloned, because a picture needs the communicator of this object.
        for wanted in self.settings.picture.clone() {
            if call.is_multiple_of(wanted.every) {
                let file = file_of(&wanted.file, step, time);
                let made = picture(&mut self.group(), params, &wanted, &file);
                self.note(file, made, &mut reasons)?;
            }
        }
        for wanted in self.settings.photograph.clone() {
            if call.is_multiple_of(wanted.every) {
                let file = file_of(&wanted.file, step, time);
                let made = photograph(&mut self.group(), params, &wanted, &file);
                self.note(file, made, &mut reasons)?;
            }
        }
        if reasons.is_empty() { Ok(()) } else { Err(SessionError::Pictures { reasons }) }
    }

    fn group(&mut self) -> Group<'_> {
        // A rank of many is one processor of its machine; a simulation without ranks has all.
        let threads = self.settings.threads.unwrap_or(self.comm.size() == 1);
        Group { comm: &mut *self.comm, timeout: self.timeout, threads }
    }

    fn note(
        &mut self,
        file: PathBuf,
        made: Result<Vec<String>, PictureError>,
        reasons: &mut Vec<String>,
    ) -> Result<(), SessionError> {
        match made {
            Ok(warnings) => {
                self.written.push(file);
                self.warn(warnings);
                Ok(())
            }
            Err(error) if error.is_agreed() => {
                reasons.push(format!("{}: {error}", file.display()));
                Ok(())
            }
            Err(error) => {
                let reason = format!("{}: {error}", file.display());
                self.comm.abort(&reason);
                self.ended = Some(reason.clone());
                Err(SessionError::Ended { reason })
            }
        }
    }

    fn warn(&mut self, warnings: Vec<String>) {
        for warning in warnings {
            if self.warnings.insert(warning.clone()) {
                self.unsaid.push(warning);
            }
        }
    }

    /// This rank.
    pub fn rank(&self) -> usize {
        self.comm.rank()
    }

    /// Number of ranks.
    pub fn ranks(&self) -> usize {
        self.comm.size()
    }

    /// Whether nothing but errors is to be said.
    pub fn is_quiet(&self) -> bool {
        self.settings.quiet
    }

    /// The files of the last call, which rank 0 has written.
    pub fn written(&self) -> &[PathBuf] {
        &self.written
    }

    /// This rank's warnings since this was called last, each once in a session.
    pub fn take_new_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.unsaid)
    }

    /// This rank's warnings of all calls, each once.
    pub fn warnings(&self) -> impl Iterator<Item = &str> {
        self.warnings.iter().map(String::as_str)
    }
}

/// The file of settings, and warnings: the variable's, or else the script of the simulation that
/// ends with `.toml`.
fn settings_file(
    params: &Node<'_>,
    variable: Option<std::ffi::OsString>,
) -> (Option<PathBuf>, Vec<String>) {
    let mut file = variable.filter(|v| !v.is_empty()).map(PathBuf::from);
    let mut warnings = Vec::new();
    for (name, script) in params.get("catalyst/scripts").map_or(&[][..], Node::children) {
        let Some(path) = script.text().or(script.text_at("filename")) else { continue };
        if Path::new(path).extension().is_some_and(|e| e == "toml") {
            file.get_or_insert_with(|| path.into());
        } else {
            warnings.push(format!(
                "catalyst/scripts/{name}: {path} is not run: it is no file of settings (.toml)"
            ));
        }
    }
    for (name, _) in params.get("catalyst/pipelines").map_or(&[][..], Node::children) {
        warnings.push(format!("catalyst/pipelines/{name} is not run: pipelines are ParaView's"));
    }
    (file, warnings)
}

/// The communicator of the simulation, `catalyst/mpi_comm`, as Fortran's integer; `None` for that
/// of all ranks.
///
/// # Errors
/// What is no such integer.
pub fn communicator(params: &Node<'_>) -> Result<Option<i32>, SessionError> {
    let Some(node) = params.get("catalyst/mpi_comm") else { return Ok(None) };
    let handle = node.i64().and_then(|n| i32::try_from(n).ok());
    handle.map(Some).ok_or(SessionError::Communicator)
}

/// A number that tells settings apart (FNV-1a over their text).
fn hash_of(settings: &Settings) -> u64 {
    let text = format!("{settings:?}");
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use composite::threads;

    #[test]
    fn settings_come_from_the_variable_or_the_scripts() {
        let mut params = Node::default();
        params.set("catalyst/scripts/a/filename", "pipeline.py".into());
        params.set("catalyst/scripts/b", "pictures.toml".into());
        params.set("catalyst/pipelines/0/type", "io".into());
        let (file, warnings) = settings_file(&params, None);
        assert!(warnings[1].contains("pipelines/0 is not run"), "{warnings:?}");
        assert_eq!(file, Some("pictures.toml".into()));
        assert!(warnings[0].contains("scripts/a: pipeline.py is not run"), "{warnings:?}");
        let (file, _) = settings_file(&params, Some("mine.toml".into()));
        assert_eq!(file, Some("mine.toml".into()));
        assert_eq!(settings_file(&Node::default(), Some("".into())).0, None);
    }

    #[test]
    fn a_communicator_that_is_no_number_is_refused_by_name() {
        let mut params = Node::default();
        params.set("catalyst/mpi_comm", "world".into());
        let error = communicator(&params).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains("catalyst/mpi_comm"), "{error}");
    }

    #[test]
    fn ranks_with_other_settings_are_named() {
        let outputs = threads::run(3, |comm| {
            let mut settings = Settings::without_file();
            settings.quiet = comm.rank() == 2;
            Session::over(Box::new(comm), Ok(settings)).err().map(|e| e.to_string())
        });
        for said in outputs.into_iter().flatten() {
            let said = said.unwrap_or_default();
            assert!(said.contains("rank 2 has other settings"), "{said}");
        }
    }
}
