//! Changes of the scene by the page, and what is refused of them.

use super::flow_change::check_keys;
use super::{MAX_SAMPLES, MAX_SIDE, RefusedChange, Session, chain, refused};
use crate::drawing::Overlay;
use crate::input::Step;
use crate::scene::{
    BeamsSpec, CutoffSpec, FilmSpec, LensSpec, LightSpec, SamplingSpec, Scene, TechniqueSpec,
};
use crate::serve::merge_patch::merge;
use glam::DVec3;
use serde_json::Value;

/// Sections of the scene that a page may change. Of the flow, these are only the keys of
/// [`check_keys`] (and the time, by `step`).
const PAGE_SECTIONS: [&str; 8] =
    ["view", "light", "lenses", "technique", "film", "sampling", "march", "flow"];
/// The keys of the frame.
const FRAME_KEYS: [&str; 3] = ["/film/size", "/film/field_of_view_m", "/film/center_m"];

/// Settings that belong to a technique, kept until it is selected again.
#[derive(Clone)]
pub(super) struct TechniqueSettings {
    technique: TechniqueSpec,
    light: LightSpec,
    lenses: LensSpec,
    film: FilmSpec,
    sampling: Option<SamplingSpec>,
    overlay: Option<Overlay>,
}

impl Session {
    /// Changes the scene by a JSON merge patch (RFC 7396). Objects with a `kind` or `method` are
    /// replaced as a whole, and `null` selects the technique's default. A technique of another kind
    /// restores its own bench. What is no part of a scene stands beside its sections: `step`,
    /// `overlay` and `fit`. Returns the new generation.
    ///
    /// # Errors
    /// The reason why the change is refused; the scene is then unchanged.
    pub fn edit(&self, patch: &Value) -> Result<u64, RefusedChange> {
        let mut shared = self.lock();
        let before = shared.scene.clone();
        let mut previous = None;
        let mut base = before.clone();
        let mut overlay = shared.overlay;

        // Another technique restores its last bench, or its defaults.
        let wanted = patch.pointer("/technique/kind").and_then(Value::as_str);
        if let Some(name) = wanted.filter(|n| *n != before.technique.name()) {
            let Some(custom) = TechniqueSpec::by_name(name) else {
                return Err(refused(format!(
                    "there is no technique `{name}`; there are: {}",
                    TechniqueSpec::NAMES.join(", ")
                )));
            };
            previous = Some(TechniqueSettings::of(&before, overlay));
            let saved = shared.settings.get(custom.name()).cloned();
            overlay = saved.as_ref().and_then(|s| s.overlay);
            TechniqueSettings::restore(saved, custom, &mut base);
        }
        let mut patch = patch.clone();
        let mut beside = |key: &str| patch.as_object_mut().and_then(|p| p.remove(key));
        let (step, drawn, fit) = (beside("step"), beside("overlay"), beside("fit"));
        if previous.is_some()
            && patch.pointer("/technique").and_then(Value::as_object).is_some_and(|t| t.len() == 1)
        {
            patch["technique"] =
                serde_json::to_value(&base.technique).map_err(|e| refused(e.to_string()))?;
        }
        check_patch(&patch)?;

        let change = patch.as_object_mut().and_then(|sections| sections.remove("flow"));
        if let Some(change) = change.as_ref().and_then(Value::as_object) {
            base.flow = self.flow_after(&before.flow, &shared.medium, change)?;
        }
        // The time must be a step of the series. Transfer functions start from the first file, so
        // the path of the current one is set again.
        base.flow.file = match step {
            Some(step) => self.step(&step)?.path.clone(),
            None => before.flow.file.clone(),
        };
        let framed = FRAME_KEYS.iter().any(|k| patch.pointer(k).is_some());
        let mut value = serde_json::to_value(&base).map_err(|e| refused(e.to_string()))?;
        merge(&mut value, patch);
        let mut scene: Scene =
            serde_json::from_value(value).map_err(|e| refused(format!("not a scene: {e}")))?;
        let fitted = match fit {
            // A frame that was chosen is not changed by turning the flow.
            None => shared.fitted && !framed,
            Some(Value::Bool(true)) if framed => {
                return Err(refused("`fit` chooses the frame; omit it or the frame"));
            }
            Some(Value::Bool(fit)) => {
                if let Some(size_m) = shared.size_m.filter(|_| fit) {
                    fit_frame(&mut scene, size_m);
                }
                fit
            }
            Some(other) => return Err(refused(format!("`fit` is {other}; give true or false"))),
        };
        if let Some(drawn) = drawn {
            overlay = overlay_of(&drawn, &scene)?;
        }
        self.check_scene(&scene)?;
        if let Some(k) = previous {
            shared.settings.insert(k.technique.name(), k);
        }
        shared.fitted = fitted;
        if scene.flow.multifield.is_none() {
            shared.medium = scene.flow.clone();
        }
        if scene != before || overlay != shared.overlay {
            (shared.scene, shared.overlay) = (scene, overlay);
            self.changed(&mut shared);
        }
        Ok(shared.generation)
    }

    /// Returns to the last scene that was shown, after one that could not be.
    ///
    /// # Errors
    /// If there is none, or it is the present one.
    pub fn back(&self) -> Result<u64, RefusedChange> {
        let mut shared = self.lock();
        let Some((scene, overlay)) = shared.shown.clone() else {
            return Err(refused("no image was shown yet to which the page could go back"));
        };
        if (&scene, overlay) == (&shared.scene, shared.overlay) {
            return Err(refused("the scene is the last one that was shown"));
        }
        if scene.flow.multifield.is_none() {
            shared.medium = scene.flow.clone();
        }
        (shared.scene, shared.overlay) = (scene, overlay);
        self.changed(&mut shared);
        Ok(shared.generation)
    }

    /// Tells how large the gas is. A frame that follows the flow is fitted to it.
    pub(in crate::serve) fn found_size(&self, size_m: DVec3) {
        let mut shared = self.lock();
        shared.size_m = Some(size_m);
        let mut scene = shared.scene.clone();
        fit_frame(&mut scene, size_m);
        if shared.fitted && scene != shared.scene {
            shared.scene = scene;
            self.changed(&mut shared);
        }
    }

    fn step(&self, number: &Value) -> Result<&Step, RefusedChange> {
        let step = number.as_u64().and_then(|n| self.steps.get(usize::try_from(n).ok()?));
        step.ok_or_else(|| match self.steps.len() {
            0 => refused(
                "`step`: the flow has one time; start the program with a time series \
                          (.pvd, or several files)",
            ),
            n => refused(format!("`step` is {number}; give 0 to {}", n - 1)),
        })
    }

    pub(super) fn check_scene(&self, scene: &Scene) -> Result<(), RefusedChange> {
        check_limits(scene)?;
        // A page must not make the program read an arbitrary file.
        if let TechniqueSpec::Schlieren { cutoff: cutoff @ CutoffSpec::Image { file, .. } } =
            &scene.technique
        {
            let known = self
                .image
                .as_ref()
                .is_some_and(|i| matches!(i, CutoffSpec::Image { file: f, .. } if f == file));
            if !known {
                return Err(refused(format!(
                    "the page cannot open `{}` as a filter; start the program with --cutoff PNG \
                     for a {}",
                    file.display(),
                    cutoff.name()
                )));
            }
        }
        scene.check().map_err(|e| refused(chain(&e)))
    }
}

fn check_patch(patch: &Value) -> Result<(), RefusedChange> {
    let Some(sections) = patch.as_object() else {
        return Err(refused(
            "a change is an object such as {\"view\": {\"direction\": \"30,15\"}}",
        ));
    };
    if let Some(other) = sections.keys().find(|k| !PAGE_SECTIONS.contains(&k.as_str())) {
        return Err(refused(format!(
            "`{other}` cannot be changed from the page; these can: {}",
            PAGE_SECTIONS.join(", ")
        )));
    }
    match sections.get("flow").map(Value::as_object) {
        Some(Some(flow)) => check_keys(flow),
        Some(None) => Err(refused("`flow` is no object")),
        None => Ok(()),
    }
}

/// The overlay that a page asks for; `null` for none.
fn overlay_of(value: &Value, scene: &Scene) -> Result<Option<Overlay>, RefusedChange> {
    let Some(text) = value.as_str() else {
        return match value {
            Value::Null => Ok(None),
            other => {
                Err(refused(format!("`overlay` is {other}; give \"arrows\", \"lic\" or null")))
            }
        };
    };
    let overlay: Overlay = text.parse().map_err(|e| refused(chain(&e)))?;
    if scene.technique.follows_light() {
        return Ok(Some(overlay));
    }
    Err(refused(format!(
        "`overlay` draws how light is bent, and technique `{}` traces none; choose another",
        scene.technique.name()
    )))
}

/// The shorter side of a fitted frame is at least this part of the longer one.
const THINNEST: f64 = 1.0 / 16.0;

/// Gives the frame the shape of the flow as it is viewed, with the longer side that it has.
fn fit_frame(scene: &mut Scene, size_m: DVec3) {
    // The scene is checked later, and its view with it.
    let Ok(view) = scene.view.direction.view(DVec3::ZERO) else { return };
    let sides = [view.right, view.up].map(|axis| axis.abs().dot(size_m));
    let (longest_m, pixels) = (sides[0].max(sides[1]), scene.film.size[0].max(scene.film.size[1]));
    let side = |m: f64| ((m / longest_m).max(THINNEST) * f64::from(pixels)).round().max(1.0) as u32;
    if longest_m > 0.0 && longest_m.is_finite() {
        scene.film.size = sides.map(side);
        (scene.film.field_of_view_m, scene.film.center_m) = (None, [0.0; 2]);
    }
}

impl TechniqueSettings {
    fn of(scene: &Scene, overlay: Option<Overlay>) -> TechniqueSettings {
        TechniqueSettings {
            overlay,
            technique: scene.technique.clone(),
            light: scene.light.clone(),
            lenses: scene.lenses,
            film: scene.film,
            sampling: scene.sampling,
        }
    }

    /// Restores the settings of a technique, or its defaults. All techniques share framing and
    /// colours.
    fn restore(previous: Option<TechniqueSettings>, custom: TechniqueSpec, scene: &mut Scene) {
        let light = LightSpec {
            wavelengths_nm: scene.light.wavelengths_nm.clone(),
            weights: scene.light.weights.clone(),
            ..LightSpec::default()
        };
        let previous = previous.unwrap_or(TechniqueSettings {
            technique: custom,
            light,
            lenses: LensSpec::default(),
            film: FilmSpec::default(),
            sampling: None,
            overlay: None,
        });
        scene.light.source = previous.light.source;
        scene.light.beams =
            if previous.technique.uses_source() { previous.light.beams } else { BeamsSpec::Auto };
        scene.lenses = previous.lenses;
        scene.film.focus_m = previous.film.focus_m;
        scene.film.exposure = previous.film.exposure;
        scene.sampling = previous.sampling;
        if !previous.technique.follows_light() {
            // Techniques without light use one wavelength.
            scene.light.wavelengths_nm.truncate(1);
            scene.light.weights.clear();
        }
        scene.technique = previous.technique;
    }
}

pub(super) fn check_limits(scene: &Scene) -> Result<(), RefusedChange> {
    let [w, h] = scene.film.size;
    if w > MAX_SIDE || h > MAX_SIDE {
        return Err(refused(format!(
            "film.size is {w}x{h}; the page renders at most {MAX_SIDE} pixels along a side: save \
             the scene and render it with `schlieren render --scene`"
        )));
    }
    match scene.sampling() {
        SamplingSpec::Photons { samples, .. } if samples > MAX_SAMPLES => Err(refused(format!(
            "sampling.samples is {samples}; the page traces at most {MAX_SAMPLES}: save the scene \
             and render it with `schlieren render --scene`"
        ))),
        _ => Ok(()),
    }
}
