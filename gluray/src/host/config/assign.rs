//! Checks an assignment `path = value` and stores the value in the settings.

use super::fields::{FIELDS, Field, Kind, find};
use super::settings::Settings;
use serde_json::{Map, Value, json};

/// Longest key of an object.
pub const MAX_OBJECT_KEY: usize = 64;
/// Most objects with materials of their own.
pub const MAX_OBJECTS: usize = 10_000;

/// A setting and its value, with the place it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Where it is written: a file, a variable, an option, the panel.
    pub origin: String,
    /// `effects.shadows`, `objects.KEY.color`.
    pub path: String,
    /// The value; `null` unsets what is optional.
    pub value: Value,
}

impl Assignment {
    /// Of its parts.
    pub fn new(origin: impl Into<String>, path: impl Into<String>, value: Value) -> Self {
        Assignment { origin: origin.into(), path: path.into(), value }
    }
}

/// Why a setting is not taken.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{origin}: `{path}` {what}; {cure}")]
pub struct SettingError {
    /// Where it is written.
    pub origin: String,
    /// Its name.
    pub path: String,
    /// What is wrong, with the value.
    pub what: String,
    /// What to write instead.
    pub cure: String,
}

/// The settings with all assignments that make sense, later ones over earlier ones, and what is
/// wrong with the others.
pub fn assign(base: &Settings, assignments: &[Assignment]) -> (Settings, Vec<SettingError>) {
    let mut errors = Vec::new();
    // A tree of plain values: settings always make one.
    let Ok(Value::Object(mut tree)) = serde_json::to_value(base) else {
        return (base.clone(), errors);
    };
    for a in assignments {
        match checked(a) {
            Ok(value) => put(&mut tree, &a.path, value),
            Err(e) => errors.push(e),
        }
    }
    if tree.get("objects").and_then(Value::as_object).is_some_and(|o| o.len() > MAX_OBJECTS) {
        errors.push(SettingError {
            origin: assignments.last().map_or_else(String::new, |a| a.origin.clone()),
            path: "objects".into(),
            what: format!("names more than {MAX_OBJECTS} objects"),
            cure: "change `material` for all of them".into(),
        });
        tree.remove("objects");
    }
    match serde_json::from_value(Value::Object(tree)) {
        Ok(settings) => (settings, errors),
        // `checked` lets nothing through that does not fit (a test tries both ends of every range).
        Err(e) => {
            let cure = "please report it".to_owned();
            errors.push(SettingError {
                origin: "gluray".into(),
                path: "settings".into(),
                what: format!("do not fit: {e}"),
                cure,
            });
            (base.clone(), errors)
        }
    }
}

fn put(tree: &mut Map<String, Value>, path: &str, value: Value) {
    let (folder, name) = match path.rsplit_once('.') {
        Some((folder, name)) => (folder.split('.').collect(), name),
        None => (Vec::new(), path),
    };
    let mut at = tree;
    for part in folder {
        let next = at.entry(part).or_insert_with(|| json!({}));
        let Value::Object(next) = next else { return };
        at = next;
    }
    if value.is_null() {
        at.remove(name);
    } else {
        at.insert(name.to_owned(), value);
    }
}

/// The value if it may be assigned there.
fn checked(a: &Assignment) -> Result<Value, SettingError> {
    let wrong = |what: String, cure: String| {
        Err(SettingError { origin: a.origin.clone(), path: shorten(&a.path), what, cure })
    };
    let Some(field) = find(&a.path) else {
        return wrong("is no setting".into(), unknown(&a.path));
    };
    if let Some(key) = object_of(&a.path) {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_:#".contains(c);
        if key.is_empty() || key.len() > MAX_OBJECT_KEY || !key.chars().all(plain) {
            return wrong(
                "has a key that no object has".into(),
                format!(
                    "keys have 1 to {MAX_OBJECT_KEY} letters, digits, `-`, `_`, `:` or `#`; \
                     `gluray explain` lists them"
                ),
            );
        }
    }
    if a.value.is_null() && field.optional {
        return Ok(Value::Null);
    }
    if fits(field.values, &a.value) {
        Ok(a.value.clone())
    } else {
        wrong(format!("is {}", shorten(&a.value.to_string())), give(field))
    }
}

/// `KEY` of `objects.KEY.color`.
fn object_of(path: &str) -> Option<&str> {
    path.strip_prefix("objects.").and_then(|rest| rest.split_once('.')).map(|(key, _)| key)
}

fn fits(kind: Kind, value: &Value) -> bool {
    let three = || -> Option<[f64; 3]> {
        let list = value.as_array().filter(|l| l.len() == 3)?;
        let numbers: Vec<f64> =
            list.iter().filter_map(Value::as_f64).filter(|v| v.is_finite()).collect();
        numbers.try_into().ok()
    };
    match kind {
        Kind::Switch => value.is_boolean(),
        Kind::Whole { low, high } => {
            value.as_u64().is_some_and(|v| (u64::from(low)..=u64::from(high)).contains(&v))
        }
        Kind::Real { low, high } => value.as_f64().is_some_and(|v| (low..=high).contains(&v)),
        Kind::Word { words } => value.as_str().is_some_and(|v| words.contains(&v)),
        Kind::Color => three().is_some_and(|v| v.iter().all(|c| (0.0..=1.0).contains(c))),
        Kind::Direction => three()
            .is_some_and(|v| v.iter().any(|c| c.abs() > 1e-6) && v.iter().all(|c| c.abs() < 1e6)),
    }
}

/// What a field takes, as an instruction.
pub(super) fn give(field: &Field) -> String {
    let unit = if field.unit.is_empty() { String::new() } else { format!(" ({})", field.unit) };
    match field.values {
        Kind::Switch => "give true or false".into(),
        Kind::Whole { low, high } => format!("give a whole number from {low} to {high}{unit}"),
        Kind::Real { low, high } => format!("give a number from {low} to {high}{unit}"),
        Kind::Word { words } => format!("give one of {}", words.join(", ")),
        Kind::Color => "give three numbers from 0 to 1: [red, green, blue]".into(),
        Kind::Direction => "give three numbers, not all 0: [right, up, towards the viewer]".into(),
    }
}

fn unknown(path: &str) -> String {
    let own = path.rsplit('.').next().unwrap_or(path);
    let near = FIELDS.iter().map(|f| {
        (
            distance(path, f.path)
                .min(distance(own, f.path.rsplit('.').next().unwrap_or(f.path)) + 1),
            f.path,
        )
    });
    match near.min() {
        Some((d, name)) if d <= 3 => format!("did you mean `{name}`?"),
        _ => format!("there are: {}", FIELDS.iter().map(|f| f.path).collect::<Vec<_>>().join(", ")),
    }
}

/// Levenshtein's distance, for names of ordinary length.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(64).collect(), b.chars().collect());
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = corner + usize::from(x != y);
            corner = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

/// What strangers send is not repeated at length.
fn shorten(text: &str) -> String {
    const MOST: usize = 80;
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::config::{Mode, Surface};

    fn one(path: &str, value: Value) -> Result<Settings, String> {
        let (settings, errors) =
            assign(&Settings::default(), &[Assignment::new("test.toml", path, value)]);
        match errors.first() {
            None => Ok(settings),
            Some(e) => {
                assert_eq!(settings, Settings::default(), "a refused value changes nothing");
                Err(e.to_string())
            }
        }
    }

    #[test]
    fn errors_name_origin_field_value_and_cure() {
        assert_eq!(
            one("samples", json!(0)).unwrap_err(),
            "test.toml: `samples` is 0; give a whole number from 1 to 4096"
        );
        assert_eq!(
            one("mode", json!("ricj")).unwrap_err(),
            "test.toml: `mode` is \"ricj\"; give one of match, phong, rich, enhance, path"
        );
        assert_eq!(
            one("effects.shadow", json!(true)).unwrap_err(),
            "test.toml: `effects.shadow` is no setting; did you mean `effects.shadows`?"
        );
        assert_eq!(
            one("shadows", json!(true)).unwrap_err(),
            "test.toml: `shadows` is no setting; did you mean `effects.shadows`?"
        );
        assert!(one("a.b.c.d.e", json!(1)).unwrap_err().contains("there are: enabled, mode"));
        assert!(
            one("effects.aperture_radius", json!(-1))
                .unwrap_err()
                .contains("from 0 to 1 (of the diagonal)")
        );
    }

    #[test]
    fn wrong_types_and_non_finite_numbers_are_refused() {
        for (path, value) in [
            ("samples", json!(1.5)),
            ("samples", json!("4")),
            ("samples", json!(-1)),
            ("samples", json!(1e30)),
            ("enabled", json!(1)),
            ("effects.focus", json!("near")),
            ("lights.added_direction", json!([0, 0, 0])),
            ("lights.added_direction", json!([1, 2])),
            ("material.color", json!([0, 0, 2])),
            ("material.color", json!([0, 0, "a"])),
            ("material.color", json!({"r": 1})),
            ("effects", json!({"shadows": true})),
            ("mode", Value::Null),
            ("objects.a b.color", json!([0, 0, 0])),
            ("objects..color", json!([0, 0, 0])),
        ] {
            assert!(one(path, value.clone()).is_err(), "{path} = {value}");
        }
    }

    #[test]
    fn null_unsets_what_is_optional_and_objects_are_over_all() {
        let all = [
            Assignment::new("t", "material.mirror", json!(0.25)),
            Assignment::new("t", "material.surface", json!("metal")),
            Assignment::new("t", "objects.k1.surface", json!("glass")),
            Assignment::new("t", "material.mirror", Value::Null),
            Assignment::new("t", "mode", json!("rich")),
        ];
        let (s, errors) = assign(&Settings::default(), &all);
        assert!(errors.is_empty(), "{errors:?}");
        assert_eq!(
            (s.mode, s.material.mirror, s.material.surface),
            (Mode::Rich, None, Some(Surface::Metal))
        );
        assert_eq!(s.material_of("k1").surface, Some(Surface::Glass));
        assert_eq!(s.material_of("k2").surface, Some(Surface::Metal));
    }

    #[test]
    fn distances_are_those_of_levenshtein() {
        for (a, b, d) in
            [("", "abc", 3), ("kitten", "sitting", 3), ("shadow", "shadows", 1), ("ab", "ba", 2)]
        {
            assert_eq!(distance(a, b), d, "{a} {b}");
        }
    }
}
