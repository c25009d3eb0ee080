//! The settings of this process. They are read once, on first use, and replaced when the panel
//! changes them.

use super::fields::{FIELDS, Field};
use super::load::Sources;
use super::settings::{Mode, Settings};
use std::path::PathBuf;
use std::sync::{Arc, PoisonError, RwLock};

/// The configuration of the library in this process.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Config {
    /// The settings.
    pub(crate) settings: Settings,
    /// The problems with the settings.
    pub(crate) problems: Vec<String>,
    /// The folder of reports. `None` writes none.
    pub(crate) run_dir: Option<PathBuf>,
    /// The name of the program, as users know it.
    pub(crate) program: String,
}

impl Config {
    fn of_this_process() -> Config {
        let sources = Sources::of_this_process();
        let loaded = sources.load();
        let run_dir = crate::host::folders::variable("GLURAY_RUN_DIR").map(PathBuf::from);
        // Users know the program by the last name: `view.py`, not `python3.11`.
        let program = sources.program.last().cloned().unwrap_or_default();
        let mut problems = loaded.problems;
        problems.extend(unsupported_settings(&loaded.settings));
        Config { settings: loaded.settings, problems, run_dir, program }
    }
}

/// Paths of the settings that this library supports. The panel disables the others, and the report
/// names those that were set.
pub(crate) const SUPPORTED_SETTINGS: &[&str] = &[
    "asynchronous",
    "enabled",
    "mode",
    "trace",
    "always_trace",
    "samples",
    "quality",
    "threads",
    "effects.shadows",
    "effects.light_radius_deg",
    "effects.ambient_occlusion_samples",
    "effects.ambient_occlusion_radius",
    "effects.reflections",
    "effects.refraction",
    "effects.transparency",
    "effects.max_bounces",
    "effects.aperture_radius",
    "effects.focus",
    "lights.program",
    "lights.ambient",
    "lights.sky",
    "lights.added",
    "lights.added_direction",
    "lights.added_color",
    "material.surface",
    "material.color",
    "material.opacity",
    "material.specular",
    "material.shininess",
    "material.mirror",
    "material.roughness",
    "material.ior",
    "material.emission",
];

/// The settings that have no effect.
fn unsupported_settings(settings: &Settings) -> Vec<String> {
    let tree = |s: &Settings| serde_json::to_value(s).unwrap_or_default();
    let (now, usual) = (tree(settings), tree(&Settings::default()));
    let value = |tree: &serde_json::Value, path: &str| {
        tree.pointer(&format!("/{}", path.replace('.', "/"))).cloned()
    };
    let in_vain = |f: &&Field| {
        !SUPPORTED_SETTINGS.contains(&f.path) && value(&now, f.path) != value(&usual, f.path)
    };
    let mut out: Vec<String> = FIELDS
        .iter()
        .filter(in_vain)
        .map(|f| {
            format!("`{}` is set, and this version of the library does not obey it yet", f.path)
        })
        .collect();
    // Settings without an effect in this mode are reported, too, with the modes in which they have
    // one.
    let elsewhere = |f: &&Field| {
        f.modes.len() < Mode::ALL.len()
            && !f.matters_in(settings.mode.name())
            && value(&now, f.path) != value(&usual, f.path)
    };
    out.extend(FIELDS.iter().filter(elsewhere).map(|f| {
        format!(
            "`{}` is set, but changes nothing in mode {}: it is for {}",
            f.path,
            settings.mode.name(),
            f.modes.join(", ")
        )
    }));
    if !settings.objects.is_empty()
        && !SUPPORTED_SETTINGS.iter().any(|p| p.starts_with("material."))
    {
        out.push(
            "`objects` are set, and this version of the library does not obey them yet".into(),
        );
    }
    out
}

static CURRENT: RwLock<Option<Arc<Config>>> = RwLock::new(None);

/// The current settings.
pub(crate) fn current() -> Arc<Config> {
    if let Some(config) = CURRENT.read().unwrap_or_else(PoisonError::into_inner).as_ref() {
        return config.clone();
    }
    let mut slot = CURRENT.write().unwrap_or_else(PoisonError::into_inner);
    slot.get_or_insert_with(|| Arc::new(Config::of_this_process())).clone()
}

/// Replaces the settings. Contexts apply them at the end of their frame.
pub(crate) fn replace(settings: Settings) {
    let config = Config { settings, ..Config::clone(&current()) };
    *CURRENT.write().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(config));
}

/// The name of this program, as users know it.
pub(crate) fn program_name() -> String {
    current().program.clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_obeyed_is_a_setting_and_the_rest_is_told() {
        for path in SUPPORTED_SETTINGS {
            assert!(FIELDS.iter().any(|f| f.path == *path), "{path}");
        }
        assert_eq!(unsupported_settings(&Settings::default()), Vec::<String>::new());
        let settings = Settings { enabled: false, asynchronous: true, ..Settings::default() };
        let told = unsupported_settings(&settings);
        let expected = usize::from(!SUPPORTED_SETTINGS.contains(&"asynchronous"));
        assert_eq!(
            told.iter().filter(|t| t.contains("`asynchronous`")).count(),
            expected,
            "{told:?}"
        );
        assert_eq!(told.len(), expected, "{told:?}");
    }
}
