//! Reads settings from environment variables: `GLURAY_EFFECTS_SHADOWS=off` is `effects.shadows =
//! false`.
//!
//! The command line of `gluray run` sets the same variables to pass settings to the library inside
//! the program.

use super::assign::{Assignment, SettingError};
use super::fields::{FIELDS, Field, Kind};
use serde_json::{Value, json};
use std::ffi::OsString;

/// Variables that are no settings: (name, what for).
pub const OTHER_VARIABLES: &[(&str, &str)] = &[
    ("GLURAY_CONFIG", "file with settings"),
    ("GLURAY_INJECT_FAULT", "for tests: the place at which our own code breaks; `flush`"),
    ("GLURAY_DUMP", "file that the scene is written to, see `gluray export`"),
    ("GLURAY_PANEL", "address of the control panel"),
    ("GLURAY_PANEL_SECRET", "its secret"),
    ("GLURAY_RUN_DIR", "folder that reports are written to"),
    (
        ONLY_CHILD_OF,
        "process whose children are traced, and no others (`gluray run --no-children`)",
    ),
    ("GLURAY_RANKS", "sockets of helpers that trace as well, with `:` between them"),
    ("GLURAY_LIBRARY", "the library that `gluray run` puts into programs"),
    (
        "GLURAY_GLX_VENDOR",
        "GLX vendor that we stand in front of; without it the one that GLVND would take",
    ),
    ("GLURAY_EGL_VENDOR", "the same for EGL: names or libraries, with `:` between them"),
];

/// The process whose children alone are traced. It is `gluray run`, whose child is the program;
/// programs that the program starts have another parent.
pub const ONLY_CHILD_OF: &str = "GLURAY_ONLY_CHILD_OF";

/// Variables of others that say where things are.
const PLACES: [&str; 6] =
    ["HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME", "XDG_RUNTIME_DIR", "DISPLAY"];

/// The variables that are text, and an error for each that is not and would have counted: it is not
/// obeyed, and nobody would know.
pub fn texts(
    all: impl IntoIterator<Item = (OsString, OsString)>,
) -> (Vec<(String, String)>, Vec<SettingError>) {
    let (mut out, mut errors) = (Vec::new(), Vec::new());
    for (name, value) in all {
        let shown = name.to_string_lossy().into_owned();
        match (name.into_string(), value.into_string()) {
            (Ok(name), Ok(value)) => out.push((name, value)),
            (_, Ok(_)) if !shown.starts_with("GLURAY_") => {}
            (_, value) if shown.starts_with("GLURAY_") || PLACES.contains(&shown.as_str()) => {
                let value = value.unwrap_or_else(|v| v.to_string_lossy().into_owned());
                errors.push(SettingError {
                    origin: "environment".into(),
                    path: shown.chars().take(80).collect(),
                    what: format!("is not UTF-8: {:?}", value.chars().take(80).collect::<String>()),
                    cure: "set it to text; it counts as not set".into(),
                });
            }
            _ => {}
        }
    }
    (out, errors)
}

/// The variable of a setting.
pub fn variable_of(path: &str) -> String {
    format!("GLURAY_{}", path.replace('.', "_").to_ascii_uppercase())
}

/// The value of a field from text, as in a variable or after `--set NAME=`.
pub fn parse(field: &Field, text: &str) -> Value {
    let text = text.trim();
    let numbers = |text: &str| -> Option<Vec<f64>> {
        text.trim_matches(['[', ']'])
            .split(',')
            .map(|n| n.trim().parse().ok().filter(|v: &f64| v.is_finite()))
            .collect()
    };
    let as_it_is = || json!(text);
    if text == "program" && field.optional && field.path != "material.surface" {
        return Value::Null;
    }
    match field.values {
        Kind::Switch => match text.to_ascii_lowercase().as_str() {
            "true" | "on" | "yes" | "1" => json!(true),
            "false" | "off" | "no" | "0" => json!(false),
            _ => as_it_is(),
        },
        Kind::Whole { .. } => text.parse::<u64>().map_or_else(|_| as_it_is(), |v| json!(v)),
        Kind::Real { .. } => match text.parse::<f64>() {
            Ok(v) if v.is_finite() => json!(v),
            _ => as_it_is(),
        },
        Kind::Word { .. } => as_it_is(),
        Kind::Color => {
            hex_color(text).or_else(|| numbers(text)).map_or_else(as_it_is, |v| json!(v))
        }
        Kind::Direction => numbers(text).map_or_else(as_it_is, |v| json!(v)),
    }
}

/// `#ff8000`.
fn hex_color(text: &str) -> Option<Vec<f64>> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii())?;
    (0..3)
        .map(|i| {
            u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok().map(|v| f64::from(v) / 255.0)
        })
        .collect()
}

/// `NAME=VALUE` of a command line as an assignment.
pub fn parse_pair(origin: &str, text: &str) -> Result<Assignment, SettingError> {
    let error = |what: String, cure: String| SettingError {
        origin: origin.into(),
        path: text.chars().take(80).collect(),
        what,
        cure,
    };
    let Some((path, value)) = text.split_once('=') else {
        return Err(error(
            "has no value".into(),
            "write NAME=VALUE, for example effects.shadows=on".into(),
        ));
    };
    let path = path.trim();
    let value = super::fields::find(path).map_or_else(|| json!(value), |f| parse(f, value));
    Ok(Assignment::new(origin, path, value))
}

/// The assignments in variables, in the order of the settings, and variables that begin as ours do
/// and are none.
pub fn assignments(variables: &[(String, String)]) -> (Vec<Assignment>, Vec<SettingError>) {
    let mut out = Vec::new();
    let mut known: Vec<String> = OTHER_VARIABLES.iter().map(|(n, _)| (*n).to_owned()).collect();
    for field in FIELDS {
        let name = variable_of(field.path);
        // An empty variable is one that a script left unset.
        if let Some((_, text)) = variables.iter().find(|(n, v)| *n == name && !v.is_empty()) {
            out.push(Assignment::new(
                format!("environment variable {name}"),
                field.path,
                parse(field, text),
            ));
        }
        known.push(name);
    }
    // Objects have keys with any case, which variables keep: GLURAY_OBJECTS takes
    // `KEY.color=#ff0000 KEY.mirror=0.3`.
    let mut errors = Vec::new();
    if let Some((_, text)) = variables.iter().find(|(n, _)| n == OBJECTS) {
        for pair in text.split_whitespace() {
            match parse_pair(&format!("environment variable {OBJECTS}"), &format!("objects.{pair}"))
            {
                Ok(a) => out.push(a),
                Err(e) => errors.push(e),
            }
        }
    }
    for (name, _) in variables
        .iter()
        .filter(|(n, _)| n.starts_with("GLURAY_") && !known.contains(n) && n != OBJECTS)
    {
        errors.push(SettingError {
            origin: "environment".into(),
            path: name.chars().take(80).collect(),
            what: "is no variable of gluray".into(),
            cure: "`gluray doctor --variables` lists them".into(),
        });
    }
    (out, errors)
}

/// The variable for materials of single objects.
pub const OBJECTS: &str = "GLURAY_OBJECTS";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::config::{Mode, Settings, assign};

    fn variables(list: &[(&str, &str)]) -> Vec<(String, String)> {
        list.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())).collect()
    }

    #[test]
    fn variables_become_settings() {
        let (list, errors) = assignments(&variables(&[
            ("GLURAY_MODE", "rich"),
            ("GLURAY_EFFECTS_SHADOWS", "off"),
            ("GLURAY_MATERIAL_COLOR", "#ff0000"),
            ("GLURAY_LIGHTS_ADDED_DIRECTION", "0, 1, 0"),
            ("GLURAY_SAMPLES", ""),
            ("GLURAY_OBJECTS", "Ab.mirror=0.5 Ab.surface=metal"),
            ("GLURAY_PANEL", "127.0.0.1:1"),
            ("PATH", "/bin"),
        ]));
        assert!(errors.is_empty(), "{errors:?}");
        let (s, errors) = assign(&Settings::default(), &list);
        assert!(errors.is_empty(), "{errors:?}");
        assert_eq!((s.mode, s.effects.shadows, s.samples), (Mode::Rich, false, 1));
        assert_eq!(
            (s.material.color, s.lights.added_direction),
            (Some([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0])
        );
        assert_eq!(s.material_of("Ab").mirror, Some(0.5));
    }

    #[test]
    fn variables_that_are_no_text_are_named_and_not_passed_over_in_silence() {
        use std::os::unix::ffi::OsStringExt;
        let no_text = |text: &str| OsString::from_vec([text.as_bytes(), b"\xff"].concat());
        let all = [
            ("GLURAY_MODE".into(), no_text("rich")),
            ("GLURAY_SAMPLES".into(), "4".into()),
            ("HOME".into(), no_text("/srv/a")),
            ("TITLE".into(), no_text("of somebody else's")),
            (no_text("GLURAY_"), "1".into()),
        ];
        let (texts, errors) = texts(all);
        assert_eq!(texts, variables(&[("GLURAY_SAMPLES", "4")]));
        let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
        assert_eq!(
            errors,
            [
                "environment: `GLURAY_MODE` is not UTF-8: \"rich\u{fffd}\"; set it to text; it \
                 counts as not set",
                "environment: `HOME` is not UTF-8: \"/srv/a\u{fffd}\"; set it to text; it counts \
                 as not set",
                "environment: `GLURAY_\u{fffd}` is not UTF-8: \"1\"; set it to text; it counts as \
                 not set",
            ]
        );
    }

    #[test]
    fn misspelt_variables_and_values_are_named() {
        let (list, errors) = assignments(&variables(&[
            ("GLURAY_MODUS", "rich"),
            ("GLURAY_SAMPLES", "many"),
            ("GLURAY_OBJECTS", "k"),
        ]));
        assert!(
            errors
                .iter()
                .any(|e| e.to_string().contains("`GLURAY_MODUS` is no variable of gluray")),
            "{errors:?}"
        );
        assert!(errors.iter().any(|e| e.to_string().contains("write NAME=VALUE")), "{errors:?}");
        let (_, errors) = assign(&Settings::default(), &list);
        assert_eq!(
            errors[0].to_string(),
            "environment variable GLURAY_SAMPLES: `samples` is \"many\"; give a whole number from \
             1 to 4096"
        );
    }

    #[test]
    fn no_two_settings_share_a_variable() {
        let mut names: Vec<String> = FIELDS.iter().map(|f| variable_of(f.path)).collect();
        names.extend(OTHER_VARIABLES.iter().map(|(n, _)| (*n).to_owned()));
        let all = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all);
    }
}
