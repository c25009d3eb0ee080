//! Changes of the scene by the page, and what is refused of them.

use super::{MAX_SAMPLES, MAX_SIDE, RefusedChange, Session, chain, refused};
use crate::input::Step;
use crate::scene::{
    BeamsSpec, CutoffSpec, FilmSpec, FlowSpec, LensSpec, LightSpec, SamplingSpec, Scene,
    TechniqueSpec,
};
use crate::serve::merge_patch::merge;
use serde_json::Value;

/// Sections of the scene that a page may change. Of the flow, these are only the transfer functions
/// (and the time, by `step`).
const PAGE_SECTIONS: [&str; 8] =
    ["view", "light", "lenses", "technique", "film", "sampling", "march", "flow"];

/// Settings that belong to a technique, kept until it is selected again.
#[derive(Clone)]
pub(super) struct TechniqueSettings {
    technique: TechniqueSpec,
    light: LightSpec,
    lenses: LensSpec,
    film: FilmSpec,
    sampling: Option<SamplingSpec>,
}

impl Session {
    /// Changes the scene by a JSON merge patch (RFC 7396). Objects with a `kind` or `method` are
    /// replaced as a whole, and `null` selects the technique's default. A technique of another kind
    /// restores its own bench. Returns the new generation.
    ///
    /// # Errors
    /// The reason why the change is refused; the scene is then unchanged.
    pub fn edit(&self, patch: &Value) -> Result<u64, RefusedChange> {
        let mut shared = self.lock();
        let before = shared.scene.clone();
        let mut previous = None;
        let mut base = before.clone();

        // Another technique restores its last bench, or its defaults.
        let wanted = patch.pointer("/technique/kind").and_then(Value::as_str);
        if let Some(name) = wanted.filter(|n| *n != before.technique.name()) {
            let Some(custom) = TechniqueSpec::by_name(name) else {
                return Err(refused(format!(
                    "there is no technique `{name}`; there are: {}",
                    TechniqueSpec::NAMES.join(", ")
                )));
            };
            previous = Some(TechniqueSettings::of(&before));
            let saved = shared.settings.get(custom.name()).cloned();
            TechniqueSettings::restore(saved, custom, &mut base);
        }
        let mut patch = patch.clone();
        let step = patch.as_object_mut().and_then(|p| p.remove("step"));
        if previous.is_some()
            && patch.pointer("/technique").and_then(Value::as_object).is_some_and(|t| t.len() == 1)
        {
            patch["technique"] =
                serde_json::to_value(&base.technique).map_err(|e| refused(e.to_string()))?;
        }
        self.check_patch(&patch)?;

        // Of the flow, only transfer functions can be changed.
        if let Some(curves) = patch.pointer("/flow/multifield").cloned() {
            base.flow = match curves {
                Value::Null => self.flow.clone(),
                curves => self.with_curves(curves)?,
            };
        }
        // The time must be a step of the series. Transfer functions start from the first file, so
        // the path of the current one is set again.
        base.flow.file = match step {
            Some(step) => self.step(&step)?.path.clone(),
            None => before.flow.file.clone(),
        };
        if let Some(sections) = patch.as_object_mut() {
            sections.remove("flow");
        }
        let mut value = serde_json::to_value(&base).map_err(|e| refused(e.to_string()))?;
        merge(&mut value, patch);
        let scene: Scene =
            serde_json::from_value(value).map_err(|e| refused(format!("not a scene: {e}")))?;
        self.check_scene(&scene)?;
        if let Some(k) = previous {
            shared.settings.insert(k.technique.name(), k);
        }
        if scene != before {
            shared.scene = scene;
            self.changed(&mut shared);
        }
        Ok(shared.generation)
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

    fn check_patch(&self, patch: &Value) -> Result<(), RefusedChange> {
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
        match sections.get("flow").and_then(Value::as_object) {
            Some(flow) if flow.keys().any(|k| k != "multifield") => Err(refused(
                "of the flow only `multifield` can be changed from the page; start the program \
                 with other options",
            )),
            None if sections.contains_key("flow") => Err(refused("`flow` is no object")),
            _ => Ok(()),
        }
    }

    fn with_curves(&self, curves: Value) -> Result<FlowSpec, RefusedChange> {
        if self.arrays.len() < 2 {
            return Err(refused(
                "the flow has fewer than two arrays; transfer functions are for several",
            ));
        }
        let multifield = serde_json::from_value(curves)
            .map_err(|e| refused(format!("not transfer functions: {e}")))?;
        let flow = FlowSpec { multifield: Some(multifield), ..self.flow.without_medium() };
        for name in flow.multifield.iter().flat_map(|m| m.fields.keys()) {
            if !self.arrays.iter().any(|a| a.name == *name) {
                let names: Vec<&str> = self.arrays.iter().map(|a| a.name.as_str()).collect();
                return Err(refused(format!(
                    "there is no array `{name}`; there are: {}",
                    names.join(", ")
                )));
            }
        }
        Ok(flow)
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

impl TechniqueSettings {
    fn of(scene: &Scene) -> TechniqueSettings {
        TechniqueSettings {
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
