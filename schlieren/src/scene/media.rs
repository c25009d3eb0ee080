//! Absorption, emission and rotation by the medium in scenes.

use super::{Scene, SceneError, TechniqueSpec};
use crate::input::{Quantity, Source};
use crate::media::Property;
use serde::{Deserialize, Serialize};

/// Default diameter of the stop in the cut-off plane: that of a camera lens.
const STOP_M: f64 = 0.025;

/// Arrays of the flow's file for the properties of the medium ([`crate::media`]). A number in place
/// of a name gives a uniform value. Properties are the same for all wavelengths.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MediaSpec {
    /// Absorption in 1/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absorption: Option<String>,
    /// Emission in 1/m: radiance per metre, relative to the radiance that exposes the film as
    /// undisturbed light without a cut-off does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission: Option<String>,
    /// Rotation of the plane of polarisation in rad/m, counter-clockwise in the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<String>,
    /// Angle from the polariser before the flow to an analyser behind it, counter-clockwise in the
    /// image. No analyser when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub analyser_deg: Option<f64>,
    /// Diameter of the stop in the cut-off plane, 25 mm when absent. Light that the medium emits
    /// fills the stop uniformly, and the cut-off passes its mean over the stop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop_m: Option<f64>,
}

impl MediaSpec {
    /// Whether no key is given.
    pub fn is_empty(&self) -> bool {
        *self == MediaSpec::default()
    }

    /// The array's name, or the number, that is given for a property.
    pub fn get(&self, property: Property) -> Option<&str> {
        let text = match property {
            Property::Absorption => &self.absorption,
            Property::Emission => &self.emission,
            Property::Rotation => &self.rotation,
        };
        text.as_deref()
    }

    /// The given properties with their sources.
    pub fn quantities(&self) -> Vec<(Property, Quantity)> {
        let quantity = |text: &str| {
            let Ok(q) = text.parse::<Quantity>();
            q
        };
        let given = |p: Property| self.get(p).map(|text| (p, quantity(text)));
        Property::ALL.into_iter().filter_map(given).collect()
    }

    /// Properties that change the transmitted light: absorption, and rotation with an analyser.
    pub fn attenuating(&self) -> Vec<Property> {
        let counts = |p: &Property| match p {
            Property::Absorption => self.absorption.is_some(),
            Property::Emission => false,
            Property::Rotation => self.analyser_deg.is_some(),
        };
        Property::ALL.into_iter().filter(counts).collect()
    }

    /// The analyser's angle in rad.
    pub fn analyser_rad(&self) -> Option<f64> {
        self.analyser_deg.map(f64::to_radians)
    }

    /// Diameter of the stop in the cut-off plane.
    pub fn stop_m(&self) -> f64 {
        self.stop_m.unwrap_or(STOP_M)
    }
}

impl Scene {
    /// Refuses invalid values and keys that have no effect.
    pub(super) fn check_media(&self) -> Result<(), SceneError> {
        let m = &self.media;
        if m.is_empty() {
            return Ok(());
        }
        let technique = self.technique.name();
        let no_effect = |key, hint| Err(SceneError::NoEffect { key, technique, hint });
        if !self.technique.follows_light() {
            return no_effect("media", "; it traces no light");
        }
        for (property, quantity) in m.quantities() {
            let key = match property {
                Property::Absorption => "media.absorption",
                Property::Emission => "media.emission",
                Property::Rotation => "media.rotation",
            };
            if let Source::Constant(v) = quantity.source
                && !(v.is_finite() && (v >= 0.0 || property.is_signed()))
            {
                let cure = if property.is_signed() {
                    "give a finite number"
                } else {
                    "give a number of at least 0"
                };
                return Err(SceneError::Value { key, value: v.to_string(), cure: cure.into() });
            }
        }
        if m.rotation.is_some() && matches!(self.technique, TechniqueSpec::Interferogram { .. }) {
            return no_effect(
                "media.rotation",
                ", whose reference beam is not polarised; use another technique",
            );
        }
        if let Some(angle) = m.analyser_deg {
            if m.rotation.is_none() {
                return no_effect(
                    "media.analyser_deg",
                    ", or give media.rotation: only a rotation makes the flow visible through it",
                );
            }
            super::check::finite("media.analyser_deg", &[angle])?;
        }
        if let Some(stop_m) = m.stop_m {
            if m.emission.is_none() || !matches!(self.technique, TechniqueSpec::Schlieren { .. }) {
                return no_effect("media.stop_m", "; it belongs to media.emission with schlieren");
            }
            super::check::positive("media.stop_m", stop_m)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(rest: &str) -> Result<Scene, SceneError> {
        Scene::from_toml(&format!("[flow]\nfile = \"a.vti\"\ndensity = \"rho\"\n{rest}"))
    }

    #[test]
    fn what_cannot_be_honoured_is_refused_by_name() {
        for (text, words) in [
            ("absorption = \"-1\"", ["media.absorption is -1", "at least 0"]),
            ("emission = \"nan\"", ["media.emission is NaN", "at least 0"]),
            ("analyser_deg = 45.0", ["media.analyser_deg", "media.rotation"]),
            ("absorption = \"a\"\nstop_m = 0.01", ["media.stop_m", "media.emission"]),
            ("emission = \"j\"\nstop_m = 0.0", ["media.stop_m", "above 0"]),
            (
                "rotation = \"r\"\n[technique]\nkind = \"interferogram\"",
                ["media.rotation", "reference beam"],
            ),
            ("absorption = \"a\"\n[technique]\nkind = \"slice\"", ["media", "no light"]),
        ] {
            let message = scene(&format!("[media]\n{text}")).unwrap_err().to_string();
            assert!(words.iter().all(|w| message.contains(w)), "{text}: {message}");
        }
        let unknown = scene("[media]\nabsorbtion = \"a\"").unwrap_err();
        assert!(std::error::Error::source(&unknown).unwrap().to_string().contains("absorbtion"));
    }

    #[test]
    fn scenes_without_media_do_not_mention_them() {
        let plain = scene("").unwrap();
        assert!(!plain.effective().to_toml().unwrap().contains("media"));
        let glowing = scene("[media]\nemission = \"j\"").unwrap();
        let effective = glowing.effective();
        assert_eq!(effective.media.stop_m, Some(STOP_M));
        assert_eq!(Scene::from_toml(&effective.to_toml().unwrap()).unwrap(), effective);
        assert!(glowing.media.attenuating().is_empty());
    }
}
