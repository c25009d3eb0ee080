//! The table of settings: names, kinds, ranges, and the modes in which they have an effect.

use serde::Serialize;

/// What values a setting takes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Kind {
    /// `true` or `false`.
    Switch,
    /// A whole number from `low` to `high`.
    Whole {
        /// Least.
        low: u32,
        /// Most.
        high: u32,
    },
    /// A number from `low` to `high`.
    Real {
        /// Least.
        low: f64,
        /// Most.
        high: f64,
    },
    /// One of these words.
    Word {
        /// The words.
        words: &'static [&'static str],
    },
    /// Red, green, blue, each 0 to 1.
    Color,
    /// x, y, z, not all 0.
    Direction,
}

/// A setting.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Field {
    /// Its name with the table it is in: `effects.shadows`.
    pub path: &'static str,
    /// The values it takes.
    #[serde(flatten)]
    pub values: Kind,
    /// Unit, or empty.
    pub unit: &'static str,
    /// True when it can be left unset: as the program has it.
    pub optional: bool,
    /// The modes in which it changes a picture; empty for all.
    pub modes: &'static [&'static str],
    /// What it does.
    pub about: &'static str,
}

const RAYS: &[&str] = &["rich", "enhance"];
const LIT: &[&str] = &["phong", "rich", "path"];
const LONG: &[&str] = &["rich", "path"];

const fn field(path: &'static str, values: Kind, about: &'static str) -> Field {
    Field { path, values, unit: "", optional: false, modes: &[], about }
}

const fn real(low: f64, high: f64) -> Kind {
    Kind::Real { low, high }
}

impl Field {
    const fn unit(self, unit: &'static str) -> Field {
        Field { unit, ..self }
    }
    const fn only_in(self, modes: &'static [&'static str]) -> Field {
        Field { modes, ..self }
    }
    const fn optional(self) -> Field {
        Field { optional: true, modes: LIT, ..self }
    }

    /// True for changes to materials, which exist for all objects and for each.
    pub fn is_material(&self) -> bool {
        self.path.starts_with("material.")
    }

    /// True when it changes pictures in `mode`.
    pub fn matters_in(&self, mode: &str) -> bool {
        self.modes.is_empty() || self.modes.contains(&mode)
    }
}

/// Every setting.
pub const FIELDS: &[Field] = &[
    field("enabled", Kind::Switch, "off: the driver draws everything"),
    field(
        "mode",
        Kind::Word { words: &["match", "phong", "rich", "enhance", "path"] },
        "how pictures are made",
    ),
    field("trace", Kind::Word { words: &["scene", "all"] }, "which draws are traced"),
    field(
        "always_trace",
        Kind::Switch,
        "rays also where the driver draws the same picture for less, as all modes but match do",
    ),
    field(
        "samples",
        Kind::Whole { low: 1, high: 4096 },
        "rays through each pixel; mode path takes at least 16",
    )
    .only_in(&["rich", "enhance", "path"]),
    field(
        "quality",
        Kind::Word { words: &["auto", "fast", "best"] },
        "how acceleration structures are built",
    ),
    field("threads", Kind::Whole { low: 0, high: 1024 }, "threads that render; 0 for all cores"),
    field("asynchronous", Kind::Switch, "show each frame one frame late and trace it meanwhile")
        .only_in(&["match", "phong", "enhance"]),
    field("effects.shadows", Kind::Switch, "rays to the lights").only_in(RAYS),
    field(
        "effects.light_radius_deg",
        real(0.0, 45.0),
        "half the angle of lights; 0 for sharp shadows",
    )
    .unit("degrees")
    .only_in(&["rich", "enhance", "path"]),
    field(
        "effects.ambient_occlusion_samples",
        Kind::Whole { low: 0, high: 1024 },
        "rays of ambient occlusion; 0 for none",
    )
    .only_in(RAYS),
    field("effects.ambient_occlusion_radius", real(1e-6, 10.0), "their length")
        .unit("of the diagonal")
        .only_in(RAYS),
    field("effects.reflections", Kind::Switch, "mirrors").only_in(LONG),
    field("effects.refraction", Kind::Switch, "rays through glass").only_in(LONG),
    field("effects.transparency", Kind::Switch, "light through what is not opaque").only_in(LONG),
    field("effects.max_bounces", Kind::Whole { low: 1, high: 64 }, "longest chain of reflections")
        .only_in(LONG),
    field("effects.aperture_radius", real(0.0, 1.0), "radius of the lens; 0 for a pinhole")
        .unit("of the diagonal")
        .only_in(LONG),
    field("effects.focus", real(0.0, 1.0), "sharp at: 0 nearest to 1 farthest point").only_in(LONG),
    field("lights.program", real(0.0, 100.0), "times the program's lights").only_in(LIT),
    field("lights.ambient", real(0.0, 100.0), "times the program's ambient light").only_in(LIT),
    field("lights.sky", real(0.0, 100.0), "even light from all around").only_in(LONG),
    field("lights.added", real(0.0, 100.0), "strength of a light of our own").only_in(LIT),
    field(
        "lights.added_direction",
        Kind::Direction,
        "where it comes from: right, up, towards you; in enhance, where shaders' shadows come from",
    )
    .only_in(&["phong", "rich", "enhance", "path"]),
    field("lights.added_color", Kind::Color, "its colour").only_in(LIT),
    field(
        "material.surface",
        Kind::Word { words: &["program", "matte", "metal", "glass"] },
        "what surfaces are made of",
    )
    .optional()
    .only_in(LONG),
    field("material.color", Kind::Color, "colour, as glColor takes it").optional(),
    field("material.opacity", real(0.0, 1.0), "0 invisible to 1 opaque").optional().only_in(LONG),
    field("material.specular", real(0.0, 1.0), "strength of the highlight").optional(),
    field("material.shininess", real(0.0, 10_000.0), "exponent of the highlight").optional(),
    field("material.mirror", real(0.0, 1.0), "share of mirror reflection").optional().only_in(LONG),
    field("material.roughness", real(0.0, 1.0), "of a metal: 0 polished to 1 dull")
        .optional()
        .only_in(LONG),
    field("material.ior", real(1.0, 4.0), "refractive index of glass").optional().only_in(LONG),
    field("material.emission", real(0.0, 1000.0), "light given off, times the colour").optional(),
];

/// The field of a path; `objects.KEY.color` is of the field `material.color`.
pub fn find(path: &str) -> Option<&'static Field> {
    let material =
        path.strip_prefix("objects.").and_then(|rest| rest.split_once('.')).map(|(_, name)| name);
    FIELDS.iter().find(|f| match material {
        Some(name) => f.path.strip_prefix("material.") == Some(name),
        None => f.path == path,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::config::{Assignment, Settings, assign};
    use serde_json::{Value, json};

    fn leaves(prefix: &str, value: &Value, out: &mut Vec<String>) {
        match value {
            Value::Object(map) => {
                for (k, v) in map {
                    leaves(
                        &if prefix.is_empty() { k.clone() } else { format!("{prefix}.{k}") },
                        v,
                        out,
                    );
                }
            }
            _ => out.push(prefix.to_owned()),
        }
    }

    /// Values at both ends of a kind.
    fn extremes(kind: Kind) -> Vec<Value> {
        match kind {
            Kind::Switch => vec![json!(true), json!(false)],
            Kind::Whole { low, high } => vec![json!(low), json!(high)],
            Kind::Real { low, high } => vec![json!(low), json!(high)],
            Kind::Word { words } => words.iter().map(|w| json!(w)).collect(),
            Kind::Color => vec![json!([0, 0, 0]), json!([1.0, 1.0, 1.0])],
            Kind::Direction => vec![json!([0, 0, -1])],
        }
    }

    #[test]
    fn the_table_and_the_structs_have_the_same_settings() {
        // Set all, so that what is optional is written, too.
        let all: Vec<Assignment> = FIELDS
            .iter()
            .map(|f| Assignment::new("test", f.path, extremes(f.values)[0].clone()))
            .collect();
        let (settings, errors) = assign(&Settings::default(), &all);
        assert!(errors.is_empty(), "{errors:?}");
        let mut written = Vec::new();
        leaves("", &serde_json::to_value(&settings).unwrap(), &mut written);
        let mut known: Vec<String> = FIELDS.iter().map(|f| f.path.to_owned()).collect();
        written.sort();
        known.sort();
        assert_eq!(written, known);
    }

    #[test]
    fn both_ends_of_every_range_arrive_where_they_belong() {
        for f in FIELDS {
            for v in extremes(f.values) {
                let (settings, errors) =
                    assign(&Settings::default(), &[Assignment::new("test", f.path, v.clone())]);
                assert!(errors.is_empty(), "{} = {v}: {errors:?}", f.path);
                let tree = serde_json::to_value(&settings).unwrap();
                let found = tree.pointer(&format!("/{}", f.path.replace('.', "/"))).unwrap();
                let numbers = |v: &Value| -> Vec<Option<f64>> {
                    v.as_array().into_iter().flatten().map(Value::as_f64).collect()
                };
                assert!(
                    *found == v
                        || found.as_f64().is_some() && found.as_f64() == v.as_f64()
                        || numbers(found) == numbers(&v),
                    "{}: {v} became {found}",
                    f.path
                );
            }
        }
    }

    #[test]
    fn objects_have_the_fields_of_materials_only() {
        assert_eq!(find("objects.a1.color").unwrap().path, "material.color");
        assert!(find("objects.a1.samples").is_none() && find("objects.a1").is_none());
        assert!(
            find("material.color").unwrap().matters_in("rich")
                && !find("material.color").unwrap().matters_in("match")
        );
    }
}
