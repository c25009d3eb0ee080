//! What the user set: by environment from `gluray run`, and by program name in a TOML file.

use crate::decide::Trace;
use serde::Deserialize;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// How traced surfaces look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// OpenGL's lighting at the vertices: the driver's picture.
    #[default]
    Match,
    /// OpenGL's lighting at every pixel.
    Phong,
    /// Shadows, ambient occlusion, reflections.
    Rich,
    /// The driver's colours, dimmed by traced ambient occlusion and shadows.
    Enhance,
    /// Light over many bounces.
    Path,
    /// Nothing is traced.
    Off,
}

impl Mode {
    /// The name on command lines.
    pub fn name(self) -> &'static str {
        match self {
            Mode::Match => "match",
            Mode::Phong => "phong",
            Mode::Rich => "rich",
            Mode::Enhance => "enhance",
            Mode::Path => "path",
            Mode::Off => "off",
        }
    }

    /// From the name on command lines.
    pub fn from_name(name: &str) -> Option<Mode> {
        [Mode::Match, Mode::Phong, Mode::Rich, Mode::Enhance, Mode::Path, Mode::Off].into_iter().find(|m| m.name() == name)
    }
}

/// Settings of one process.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Config {
    /// Look of traced surfaces.
    pub mode: Mode,
    /// `--trace all`.
    pub trace_all: bool,
    /// Where reports are written; `None` writes none.
    pub run_dir: Option<PathBuf>,
    /// Numbers of the modes beyond `match`.
    pub look: Look,
}

/// Numbers of the modes beyond `match`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Look {
    /// Ambient occlusion rays per pixel; 0 for none.
    pub ao_rays: u32,
    /// How far ambient occlusion looks, as a fraction of the scene's diagonal.
    pub ao_distance: f64,
    /// Whether lights that are not at the eye cast shadows.
    pub shadows: bool,
    /// Radius of lights as a fraction of the scene's diagonal (directional: radians); 0 for sharp shadows.
    pub light_size: f64,
    /// Share of mirror reflection on shiny surfaces.
    pub mirror: f32,
    /// Samples per pixel.
    pub samples: u32,
}

impl Default for Look {
    fn default() -> Look {
        Look { ao_rays: 4, ao_distance: 0.1, shadows: true, light_size: 0.0, mirror: 0.0, samples: 1 }
    }
}

/// The configuration file: settings for all programs, and for programs by name.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConfigFile {
    /// For every program.
    pub default: Section,
    /// By the name of the executable.
    pub program: std::collections::BTreeMap<String, Section>,
}

/// One section of the file; what is absent stays as it was.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Section {
    /// Look of traced surfaces.
    pub mode: Option<Mode>,
    /// Trace every filled primitive.
    pub trace_all: Option<bool>,
    /// Numbers.
    pub look: Option<Look>,
}

impl Config {
    /// What filled primitives are looked at for.
    pub(crate) fn trace(&self) -> Trace {
        match (self.mode, self.trace_all) {
            (Mode::Off, _) => Trace::Nothing,
            (_, true) => Trace::All,
            _ => Trace::Surfaces,
        }
    }

    /// Applies the sections of `file` for `program`.
    pub fn apply(&mut self, file: &ConfigFile, program: &str) {
        for section in [Some(&file.default), file.program.get(program)].into_iter().flatten() {
            self.mode = section.mode.unwrap_or(self.mode);
            self.trace_all = section.trace_all.unwrap_or(self.trace_all);
            if let Some(look) = &section.look {
                self.look = look.clone();
            }
        }
    }

    /// From the environment that `gluray run` makes; the environment goes before the file.
    fn from_environment() -> Config {
        let text = |name: &str| std::env::var(name).ok().filter(|v| !v.is_empty());
        let mut config = Config { run_dir: text("GLURAY_RUN_DIR").map(PathBuf::from), ..Config::default() };
        let file = text("GLURAY_CONFIG").and_then(|p| std::fs::read_to_string(p).ok());
        if let Some(file) = file.and_then(|t| toml::from_str::<ConfigFile>(&t).ok()) {
            config.apply(&file, &program_name());
        }
        if let Some(mode) = text("GLURAY_MODE").and_then(|m| Mode::from_name(&m)) {
            config.mode = mode;
        }
        if let Some(t) = text("GLURAY_TRACE") {
            config.trace_all = t == "all";
        }
        config
    }
}

/// Name of the executable of this process.
pub(crate) fn program_name() -> String {
    let path = std::env::current_exe().unwrap_or_default();
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Settings of this process, read once.
pub(crate) fn current() -> Arc<Config> {
    static CONFIG: OnceLock<Arc<Config>> = OnceLock::new();
    CONFIG.get_or_init(|| Arc::new(Config::from_environment())).clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_of_a_program_go_over_those_of_all() {
        let file: ConfigFile = toml::from_str(
            "[default]\nmode = \"phong\"\n[program.gmsh]\nmode = \"rich\"\nlook = { ao_rays = 16 }\n",
        )
        .expect("a valid file");
        let mut config = Config::default();
        config.apply(&file, "gmsh");
        assert_eq!((config.mode, config.look.ao_rays), (Mode::Rich, 16));
        let mut config = Config::default();
        config.apply(&file, "geomview");
        assert_eq!(config.mode, Mode::Phong);
        assert!(toml::from_str::<ConfigFile>("[default]\nmodes = 1\n").is_err());
    }
}
