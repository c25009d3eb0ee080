//! Reads the settings file: settings for all programs, and for individual programs by name.
//!
//! ```toml
//! mode = "rich"
//! [effects]
//! ambient_occlusion_samples = 16
//!
//! [program.gmsh]
//! mode = "match"
//! [program.gmsh.objects.3f2a]
//! color = [0.9, 0.6, 0.2]
//! ```

use super::assign::Assignment;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Why a file is not taken.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be read.
    #[error("{}: cannot be read; check the name given by GLURAY_CONFIG or \
             --config", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no TOML.
    #[error("{}: {text}; see https://toml.io for the syntax", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where and what.
        text: String,
    },
}

/// A file that was read; whether its settings make sense is seen when they are assigned.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ConfigFile {
    path: PathBuf,
    tree: toml::Table,
}

impl ConfigFile {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<ConfigFile, FileError> {
        let text = crate::host::folders::read_plain(path)
            .map_err(|source| FileError::Read { path: path.into(), source })?;
        ConfigFile::parse(path, &text)
    }

    /// Takes the text of a file.
    pub fn parse(path: &Path, text: &str) -> Result<ConfigFile, FileError> {
        let tree = text.parse::<toml::Table>().map_err(|e| {
            // Line and column in words: the error's own picture of the line is for terminals.
            let at = e.span().map_or_else(String::new, |s| {
                let before = &text[..s.start.min(text.len())];
                let line = before.matches('\n').count() + 1;
                format!(
                    "line {line}, column {}: ",
                    before.len() - before.rfind('\n').map_or(0, |n| n + 1) + 1
                )
            });
            FileError::Syntax {
                path: path.into(),
                text: format!("{at}{}", e.message().replace('\n', ", ")),
            }
        })?;
        Ok(ConfigFile { path: path.into(), tree })
    }

    /// The file that is read when none is named: `gluray/gluray.toml` in `XDG_CONFIG_HOME` or
    /// `~/.config`.
    pub fn usual_path(variable: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
        crate::host::folders::config(variable).map(|f| f.join("gluray.toml"))
    }

    /// Names of programs that have settings of their own.
    pub fn programs(&self) -> Vec<&str> {
        let tables = self.tree.get("program").and_then(toml::Value::as_table);
        tables.into_iter().flat_map(|t| t.keys().map(String::as_str)).collect()
    }

    /// The assignments for a program that is known by any of `names`: those for all, then those for
    /// each name in turn.
    pub fn assignments(&self, names: &[String]) -> Vec<Assignment> {
        let mut out = Vec::new();
        let origin = self.path.display().to_string();
        let programs = self.tree.get("program");
        for (key, value) in self.tree.iter().filter(|(k, _)| *k != "program") {
            flatten(&origin, key, value, &mut out);
        }
        match programs {
            None => {}
            Some(toml::Value::Table(programs)) => {
                for name in names {
                    match programs.get(name) {
                        Some(toml::Value::Table(own)) => {
                            let origin = format!("{origin} [program.{name}]");
                            own.iter().for_each(|(k, v)| flatten(&origin, k, v, &mut out));
                        }
                        Some(other) => out.push(Assignment::new(
                            &origin,
                            format!("program.{name}"),
                            json(other),
                        )),
                        None => {}
                    }
                }
            }
            Some(other) => out.push(Assignment::new(&origin, "program", json(other))),
        }
        out
    }

    /// The assignments for all programs and for every program by name: what a check of the whole
    /// file looks at.
    pub fn all_assignments(&self) -> Vec<Assignment> {
        let names: Vec<String> = self.programs().into_iter().map(str::to_owned).collect();
        self.assignments(&names)
    }
}

/// Tables become longer paths. A table where a value belongs stays whole, so that it is named as
/// the wrong value it is.
fn flatten(origin: &str, path: &str, value: &toml::Value, out: &mut Vec<Assignment>) {
    match value {
        toml::Value::Table(table)
            if super::fields::find(path).is_none()
                && !table.is_empty()
                && path.matches('.').count() < 3 =>
        {
            table.iter().for_each(|(k, v)| flatten(origin, &format!("{path}.{k}"), v, out));
        }
        toml::Value::Table(table) if table.is_empty() => {}
        value => out.push(Assignment::new(origin, path, json(value))),
    }
}

fn json(value: &toml::Value) -> Value {
    match value {
        // JSON has no NaN and no infinity; as text they are refused with their names.
        toml::Value::Float(f) if !f.is_finite() => Value::String(f.to_string()),
        toml::Value::Array(list) => Value::Array(list.iter().map(json).collect()),
        other => serde_json::to_value(other).unwrap_or(Value::Null),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::config::{Mode, Settings, assign};

    fn settings(text: &str, names: &[&str]) -> (Settings, Vec<String>) {
        let file = ConfigFile::parse(Path::new("gluray.toml"), text).unwrap();
        let names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
        let (s, errors) = assign(&Settings::default(), &file.assignments(&names));
        (s, errors.iter().map(ToString::to_string).collect())
    }

    const TEXT: &str = "mode = \"rich\"\nsamples = 4\n[effects]\nshadows = \
                        false\n[program.gmsh]\nsamples = 9\n[program.gmsh.objects.3f2a]\ncolor = \
                        [1, 0.5, 0]\n[program.\"my prog\".effects]\nshadows = true\n";

    #[test]
    fn programs_have_their_own_over_what_is_for_all() {
        let (all, errors) = settings(TEXT, &["glxgears"]);
        assert_eq!(
            (all.mode, all.samples, all.effects.shadows, errors.len()),
            (Mode::Rich, 4, false, 0)
        );
        let (gmsh, errors) = settings(TEXT, &["gmsh"]);
        assert_eq!((gmsh.samples, gmsh.mode, errors.len()), (9, Mode::Rich, 0));
        assert_eq!(gmsh.material_of("3f2a").color, Some([1.0, 0.5, 0.0]));
        // A script run by an interpreter goes by both names.
        let (both, _) = settings(TEXT, &["gmsh", "my prog"]);
        assert!(both.samples == 9 && both.effects.shadows);
    }

    #[test]
    fn what_is_wrong_is_named_with_the_section() {
        for (text, expected) in [
            (
                "[effects]\nshadow = true",
                "gluray.toml: `effects.shadow` is no setting; did you mean `effects.shadows`?",
            ),
            ("samples = 1.5", "gluray.toml: `samples` is 1.5; give a whole number from 1 to 4096"),
            (
                "[program.gmsh]\nmode = 3",
                "gluray.toml [program.gmsh]: `mode` is 3; give one of match, phong, rich, enhance, \
                 path",
            ),
            (
                "[effects]\nfocus = nan",
                "gluray.toml: `effects.focus` is \"NaN\"; give a number from 0 to 1",
            ),
            ("[mode]\nname = 3", "gluray.toml: `mode` is {\"name\":3}; give one of"),
            ("effects = 3", "gluray.toml: `effects` is no setting"),
            ("program = 3", "gluray.toml: `program` is no setting"),
            ("[program]\ngmsh = 3", "gluray.toml: `program.gmsh` is no setting"),
        ] {
            let (s, errors) = settings(text, &["gmsh"]);
            assert!(errors.len() == 1 && errors[0].starts_with(expected), "{text}: {errors:?}");
            assert_eq!(s, Settings::default());
        }
    }

    #[test]
    fn a_fifo_in_the_place_of_the_file_holds_nobody_up() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("gluray.toml");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let (sender, receiver) = std::sync::mpsc::channel();
        std::thread::spawn(move || sender.send(ConfigFile::read(&path).map_err(|e| e.to_string())));
        // Whoever waits for a writer waits for ever; the time is for a busy machine.
        let answer = receiver
            .recv_timeout(std::time::Duration::from_secs(60))
            .expect("nobody is waited for");
        assert!(answer.is_err_and(|e| e.contains("gluray.toml")));
    }

    #[test]
    fn broken_files_say_where() {
        let e = ConfigFile::parse(Path::new("a.toml"), "mode = \"rich\"\nsamples = = 4")
            .unwrap_err()
            .to_string();
        assert!(e.starts_with("a.toml: line 2, column 11: "), "{e}");
        let e = ConfigFile::read(Path::new("/nowhere/a.toml")).unwrap_err().to_string();
        assert!(e.contains("/nowhere/a.toml") && e.contains("GLURAY_CONFIG"), "{e}");
    }
}
