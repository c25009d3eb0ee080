//! The settings of this process: read once when they are first asked for, replaced when the panel says so.

use super::load::Sources;
use super::settings::{Settings, Trace};
use crate::decide;
use std::path::PathBuf;
use std::sync::{Arc, PoisonError, RwLock};

/// What the library goes by.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Config {
    /// What can be set.
    pub(crate) settings: Settings,
    /// What was wrong with it.
    pub(crate) problems: Vec<String>,
    /// Where reports are written; `None` writes none.
    pub(crate) run_dir: Option<PathBuf>,
}

impl Config {
    /// What filled primitives are looked at for.
    pub(crate) fn trace(&self) -> decide::Trace {
        match (self.settings.enabled, self.settings.trace) {
            (false, _) => decide::Trace::Nothing,
            (true, Trace::All) => decide::Trace::All,
            (true, Trace::Scene) => decide::Trace::Surfaces,
        }
    }

    fn of_this_process() -> Config {
        let loaded = Sources::of_this_process().load();
        let run_dir = crate::folders::variable("GLURAY_RUN_DIR").map(PathBuf::from);
        Config { settings: loaded.settings, problems: loaded.problems, run_dir }
    }
}

static CURRENT: RwLock<Option<Arc<Config>>> = RwLock::new(None);

/// The settings now.
pub(crate) fn current() -> Arc<Config> {
    if let Some(config) = CURRENT.read().unwrap_or_else(PoisonError::into_inner).as_ref() {
        return config.clone();
    }
    let mut slot = CURRENT.write().unwrap_or_else(PoisonError::into_inner);
    slot.get_or_insert_with(|| Arc::new(Config::of_this_process())).clone()
}

/// Other settings from now on. Contexts take them up at the end of their frame.
pub(crate) fn replace(settings: Settings) {
    let config = Config { settings, ..Config::clone(&current()) };
    *CURRENT.write().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(config));
}

/// Name of the executable of this process.
pub(crate) fn program_name() -> String {
    let path = std::env::current_exe().unwrap_or_default();
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
