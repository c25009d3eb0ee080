//! Loads all layers of settings, when the library's first context is made current.

use super::assign::{Assignment, SettingError, assign};
use super::environment;
use super::file::{ConfigFile, FileError};
use super::settings::Settings;
use std::path::{Path, PathBuf};

/// Where settings come from. Plain data, so that tests need no environment.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sources {
    /// The file, when there is one.
    pub file: Option<PathBuf>,
    /// True when somebody named the file: then it has to be there.
    pub file_is_required: bool,
    /// Names the program goes by: its executable's, then the script's.
    pub program: Vec<String>,
    /// Environment variables.
    pub variables: Vec<(String, String)>,
    /// The process that started this one.
    pub parent: Option<u32>,
    /// What is wrong with variables that would have counted.
    pub refused: Vec<SettingError>,
}

/// The settings of a program, and what was wrong on the way.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loaded {
    /// Defaults, with everything that made sense over them.
    pub settings: Settings,
    /// What did not; each names its origin, field, value and cure.
    pub problems: Vec<String>,
    /// The file that was read.
    pub file: Option<PathBuf>,
}

impl Sources {
    /// Of this process.
    pub fn of_this_process() -> Sources {
        let (variables, refused) = environment::texts(std::env::vars_os());
        let arguments: Vec<String> =
            std::env::args_os().take(8).map(|a| a.to_string_lossy().into_owned()).collect();
        let executable = std::fs::read_link("/proc/self/exe").ok();
        Sources {
            refused,
            parent: Some(std::os::unix::process::parent_id()),
            ..Sources::new(variables, program_names(executable.as_deref(), &arguments))
        }
    }

    /// Of a program with these variables.
    pub fn new(variables: Vec<(String, String)>, program: Vec<String>) -> Sources {
        let get = |name: &str| {
            variables.iter().find(|(n, v)| n == name && !v.is_empty()).map(|(_, v)| v.clone())
        };
        let named = get("GLURAY_CONFIG").map(PathBuf::from);
        let file = named.clone().or_else(|| ConfigFile::usual_path(get));
        let file_is_required = named.is_some();
        Sources { file, file_is_required, program, variables, ..Sources::default() }
    }

    /// True in programs that the program of `gluray run --no-children` started.
    fn is_left_alone(&self) -> bool {
        let wanted = self.variables.iter().find(|(n, _)| n == environment::ONLY_CHILD_OF);
        let wanted = wanted.and_then(|(_, v)| v.parse().ok());
        wanted.is_some_and(|wanted: u32| self.parent.is_some_and(|parent| parent != wanted))
    }

    /// Reads and puts together all layers below the panel's.
    pub fn load(&self) -> Loaded {
        let mut loaded = Loaded::default();
        let mut assignments: Vec<Assignment> = Vec::new();
        if let Some(path) = &self.file {
            match ConfigFile::read(path) {
                Ok(file) => {
                    assignments = file.assignments(&self.program);
                    loaded.file = Some(path.clone());
                }
                Err(FileError::Read { source, .. })
                    if source.kind() == std::io::ErrorKind::NotFound && !self.file_is_required => {}
                Err(FileError::Read { path, source }) => {
                    loaded.problems.push(format!(
                        "{}: {source}",
                        FileError::Read { path, source: std::io::Error::from(source.kind()) }
                    ));
                }
                Err(e) => loaded.problems.push(e.to_string()),
            }
        }
        let (variables, unknown) = environment::assignments(&self.variables);
        assignments.extend(variables);
        let (settings, errors) = assign(&Settings::default(), &assignments);
        loaded.settings = settings;
        loaded.settings.enabled &= !self.is_left_alone();
        let errors = errors.iter().chain(&unknown).chain(&self.refused);
        loaded.problems.extend(errors.map(SettingError::to_string));
        loaded
    }
}

/// The names a program goes by in `[program.NAME]`: its executable's, that of its first argument
/// when it is another, and, for an interpreter, its script's without folder.
pub fn program_names(executable: Option<&Path>, arguments: &[String]) -> Vec<String> {
    let base = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned());
    let mut names: Vec<String> = executable.and_then(base).into_iter().collect();
    names.extend(arguments.first().and_then(|a| base(Path::new(a))));
    const INTERPRETERS: [&str; 8] =
        ["python", "perl", "wish", "tclsh", "ruby", "sh", "bash", "java"];
    let interpreted = names.iter().any(|n| {
        INTERPRETERS.iter().any(|i| {
            n.strip_prefix(i).is_some_and(|v| v.chars().all(|c| c.is_ascii_digit() || c == '.'))
        })
    });
    if interpreted {
        let script = arguments.iter().skip(1).find(|a| !a.starts_with('-'));
        if let Some(name) = script.and_then(|s| base(Path::new(s))) {
            let stem = Path::new(&name).file_stem().map(|s| s.to_string_lossy().into_owned());
            names.extend(stem.filter(|s| *s != name));
            names.push(name);
        }
    }
    let mut seen = Vec::new();
    names.retain(|n| {
        !seen.contains(n) && {
            seen.push(n.clone());
            true
        }
    });
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::config::Mode;

    fn pairs(list: &[(&str, &str)]) -> Vec<(String, String)> {
        list.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())).collect()
    }

    #[test]
    fn defaults_then_file_then_program_then_environment() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("gluray.toml");
        std::fs::write(
            &path,
            "mode = \"phong\"\nsamples = 2\n[program.gmsh]\nsamples = 3\nquality \
                               = \"best\"\n[program.gmsh.effects]\nshadows = 7\n",
        )
        .unwrap();
        let config = path.to_str().unwrap();
        let load = |variables: &[(&str, &str)], program: &str| {
            Sources::new(pairs(variables), vec![program.into()]).load()
        };

        assert_eq!(
            load(&[("XDG_CONFIG_HOME", "/nowhere")], "gmsh"),
            Loaded::default(),
            "no file is no fault"
        );
        let other = load(&[("GLURAY_CONFIG", config)], "glxgears");
        assert_eq!(
            (other.settings.mode, other.settings.samples, other.problems.len()),
            (Mode::Phong, 2, 0)
        );
        let gmsh = load(&[("GLURAY_CONFIG", config), ("GLURAY_SAMPLES", "5")], "gmsh");
        assert_eq!((gmsh.settings.samples, gmsh.settings.mode), (5, Mode::Phong));
        assert_eq!(gmsh.settings.quality, crate::host::config::Quality::Best);
        assert!(gmsh.settings.effects.shadows, "the wrong value is left out, the rest is taken");
        assert_eq!(gmsh.problems.len(), 1);
        assert!(
            gmsh.problems[0].contains("[program.gmsh]: `effects.shadows` is 7"),
            "{:?}",
            gmsh.problems
        );
    }

    #[test]
    fn a_named_file_must_be_there_and_make_sense() {
        let missing =
            Sources::new(pairs(&[("GLURAY_CONFIG", "/nowhere/g.toml")]), Vec::new()).load();
        assert!(
            missing.problems.len() == 1 && missing.problems[0].contains("/nowhere/g.toml"),
            "{:?}",
            missing.problems
        );
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("gluray");
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join("gluray.toml"), "mode = ").unwrap();
        let broken =
            Sources::new(pairs(&[("XDG_CONFIG_HOME", dir.path().to_str().unwrap())]), Vec::new())
                .load();
        assert!(
            broken.problems.len() == 1 && broken.problems[0].contains("line 1"),
            "{:?}",
            broken.problems
        );
        assert_eq!(broken.settings, Settings::default());
    }

    #[test]
    fn scripts_go_by_their_own_name_too() {
        let names = |exe: &str, args: &[&str]| {
            program_names(
                Some(Path::new(exe)),
                &args.iter().map(|a| (*a).to_owned()).collect::<Vec<_>>(),
            )
        };
        assert_eq!(names("/usr/bin/gmsh", &["gmsh", "a.geo"]), ["gmsh"]);
        assert_eq!(
            names("/usr/bin/python3.11", &["/usr/bin/python3", "-u", "/opt/x/view.py", "--big"]),
            ["python3.11", "python3", "view", "view.py"]
        );
        assert_eq!(names("/usr/bin/octave-cli", &["octave", "x.m"]), ["octave-cli", "octave"]);
    }

    #[test]
    fn programs_that_the_program_starts_are_left_alone_when_asked_for() {
        let enabled = |variables: &[(&str, &str)], parent| {
            let sources = Sources { parent, ..Sources::new(pairs(variables), vec!["gmsh".into()]) };
            let loaded = sources.load();
            assert_eq!(loaded.problems, Vec::<String>::new());
            loaded.settings.enabled
        };
        let only = &[("GLURAY_ONLY_CHILD_OF", "7")];
        assert!(enabled(only, Some(7)), "the program itself");
        assert!(!enabled(only, Some(8)), "a program that it started");
        assert!(enabled(&[], Some(8)) && enabled(only, None));
        assert!(enabled(&[("GLURAY_ONLY_CHILD_OF", "")], Some(8)));
    }
}
