//! The state that requests and the rendering thread share: the scene, the newest frame and the
//! pending work.
//!
//! Requests only change values under a lock that is never held for long. [`super::worker`] does
//! everything that takes time.

use super::filter_plane::{as_painting, half_side_m, traced};
use super::flow::ArrayInfo;
use super::frame::{DeflectionMap, Frame};
use super::merge_patch::merge;
use crate::cutoff::Rgb;
use crate::cutoff::painted::Stroke;
use crate::input::Step;
use crate::optics::PlaneVector;
use crate::scene::{
    BeamsSpec, CutoffSpec, FilmSpec, FlowSpec, LensSpec, LightSpec, SamplingSpec, Scene,
    TechniqueSpec,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Longest side of an image on the page; larger ones need `schlieren render`.
pub const MAX_SIDE: u32 = 2048;
/// Largest number of photons per pixel on the page.
pub const MAX_SAMPLES: u32 = 4096;
/// Largest number of strokes of a painting.
pub const MAX_STROKES: usize = 5000;
/// Largest number of points of one request to paint.
pub const MAX_POINTS: usize = 4096;
/// Sections of the scene that a page may change. Of the flow, these are only the transfer functions
/// (and the time, by `step`).
const PAGE_SECTIONS: [&str; 8] =
    ["view", "light", "lenses", "technique", "film", "sampling", "march", "flow"];

/// The reason why a request was refused, which the page shows.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct RefusedChange(pub String);

fn refused(text: impl Into<String>) -> RefusedChange {
    RefusedChange(text.into())
}

/// A request for a file.
pub(super) struct Save {
    pub(super) scene: Scene,
    pub(super) kind: SaveKind,
    /// Set when the request has ended.
    pub(super) cancel: Arc<AtomicBool>,
    pub(super) reply: tokio::sync::oneshot::Sender<Result<Vec<u8>, String>>,
}

/// The kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SaveKind {
    /// The image for viewing.
    Png,
    /// The image with all layers.
    Exr,
}

/// Settings that belong to a technique, kept until it is selected again.
#[derive(Clone)]
struct TechniqueSettings {
    technique: TechniqueSpec,
    light: LightSpec,
    lenses: LensSpec,
    film: FilmSpec,
    sampling: Option<SamplingSpec>,
}

pub(super) struct Shared {
    pub(super) scene: Scene,
    /// Number of changes of the scene.
    pub(super) generation: u64,
    pub(super) saves: VecDeque<Save>,
    pub(super) frame: Option<Arc<Frame>>,
    pub(super) stop: bool,
    settings: BTreeMap<&'static str, TechniqueSettings>,
    /// The scene's flow, and the n0 - 1 of the series that was found for it.
    pub(super) reference: Option<(FlowSpec, f64)>,
}

/// The state that requests and the rendering thread share.
pub struct Session {
    shared: Mutex<Shared>,
    pub(super) wake: Condvar,
    /// Set to stop the current rendering.
    pub(super) cancel: AtomicBool,
    pub(super) frames: tokio::sync::watch::Sender<u64>,
    /// Steps of a time series, at least two; empty for a single flow.
    pub(super) steps: Vec<Step>,
    /// Arrays of the first step, for transfer functions.
    arrays: Vec<ArrayInfo>,
    /// The flow as the program started with it. A page may change neither files nor the meaning of
    /// arrays, only curves.
    flow: FlowSpec,
    image: Option<CutoffSpec>,
}

/// A request to paint.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paint {
    /// What the points refer to.
    pub on: Canvas,
    /// Points along the stroke: on the filter in metres from the axis, on the image 0..=1 from its
    /// upper left corner.
    pub points: Vec<[f64; 2]>,
    /// Radius of the brush on the filter.
    pub radius_m: f64,
    /// Linear transmission of the paint.
    pub rgb: Rgb,
}

/// The surface that is painted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Canvas {
    /// The filter itself.
    Filter,
    /// The image; each point is traced to the filter.
    #[serde(rename = "picture")]
    Image,
}

/// The result of painting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaintOutcome {
    /// The scene's new generation.
    pub generation: u64,
    /// Number of strokes added.
    pub added: usize,
    /// Number of points without light, which have no position on the filter.
    pub dark: usize,
    /// A note for the user.
    pub note: Option<String>,
}

impl Session {
    /// A session that starts with this scene.
    pub(super) fn new(
        scene: Scene,
        arrays: Vec<ArrayInfo>,
        steps: Vec<Step>,
    ) -> Result<Session, RefusedChange> {
        check_limits(&scene)?;
        let image = match &scene.technique {
            TechniqueSpec::Schlieren { cutoff: cutoff @ CutoffSpec::Image { .. } } => {
                Some(cutoff.clone())
            }
            _ => None,
        };
        let shared = Shared {
            scene: scene.clone(),
            generation: 1,
            saves: VecDeque::new(),
            frame: None,
            stop: false,
            settings: BTreeMap::new(),
            reference: None,
        };
        Ok(Session {
            shared: Mutex::new(shared),
            wake: Condvar::new(),
            cancel: AtomicBool::new(false),
            frames: tokio::sync::watch::channel(0).0,
            steps,
            arrays,
            flow: scene.flow,
            image,
        })
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Shared> {
        // Values are replaced as a whole, so they stay consistent even if another thread panics.
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The state of the scene as JSON for the page.
    pub fn state(&self) -> Value {
        let shared = self.lock();
        let scene = &shared.scene;
        serde_json::json!({
            "generation": shared.generation,
            "scene": scene,
            "effective": scene.effective(),
            "file": scene.flow.file.file_name().map(|n| n.to_string_lossy().into_owned()),
            "times": self.steps.iter().map(|s| s.time).collect::<Vec<_>>(),
            "step": self.steps.iter().position(|s| s.path == scene.flow.file),
            "arrays": self.arrays,
            "techniques": TechniqueSpec::NAMES,
            "image_filter": self.image,
            "limits": { "side": MAX_SIDE, "samples": MAX_SAMPLES, "strokes": MAX_STROKES },
        })
    }

    /// The effective scene as TOML. Refused while a later step is not yet read.
    pub fn toml(&self) -> Result<String, RefusedChange> {
        let shared = self.lock();
        let mut scene = shared.scene.effective();
        if self.is_later(&scene) {
            // Outside of the series, the file would be relative to its own surroundings.
            match &shared.reference {
                Some((flow, n_minus_1)) if *flow == shared.scene.flow => {
                    scene.flow.reference_n_minus_1 = Some(*n_minus_1);
                }
                _ => {
                    return Err(refused(
                        "this step is not read yet; save the scene when its image is shown",
                    ));
                }
            }
        }
        drop(shared);
        scene.to_toml().map_err(|e| refused(chain(&e)))
    }

    /// The newest frame.
    pub fn frame(&self) -> Option<Arc<Frame>> {
        self.lock().frame.clone()
    }

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

    /// Whether a scene shows a later step, which uses the surroundings of the first one.
    pub(super) fn is_later(&self, scene: &Scene) -> bool {
        scene.flow.reference_n_minus_1.is_none()
            && self.steps.first().is_some_and(|s| s.path != scene.flow.file)
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

    fn check_scene(&self, scene: &Scene) -> Result<(), RefusedChange> {
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

    /// Paints on the filter. The first stroke turns the cut-off into a painting.
    pub fn paint(&self, paint: &Paint) -> Result<PaintOutcome, RefusedChange> {
        let finite = paint.points.iter().flatten().all(|c| c.is_finite() && c.abs() < 1e3);
        let brush = paint.radius_m > 0.0 && paint.radius_m < 1e3;
        if !(finite && brush) {
            return Err(refused("a stroke needs finite points and a brush larger than 0 m"));
        }
        if !paint.rgb.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(refused("a filter's transmissions are 0 to 1"));
        }
        if paint.points.len() > MAX_POINTS {
            return Err(refused(format!(
                "{} points are more than {MAX_POINTS}; split the stroke",
                paint.points.len()
            )));
        }
        let mut shared = self.lock();
        let TechniqueSpec::Schlieren { cutoff } = shared.scene.technique.clone() else {
            return Err(refused(
                "only schlieren has a filter; select technique schlieren to paint",
            ));
        };

        // The points on the filter.
        let traced_view = shared.frame.as_ref().and_then(|f| f.traced.clone());
        let (points_m, dark) = match paint.on {
            Canvas::Filter => (paint.points.clone(), 0),
            Canvas::Image => {
                let Some(view) = &traced_view else {
                    return Err(refused("the image is not rendered yet; paint when it is shown"));
                };
                let f2 = shared.scene.optics().schlieren_focal_length_m;
                let on_filter = |p: &[f64; 2]| {
                    traced(&view.map, &view.framing, f2, *p).map(|t| t.1.map(f64::from))
                };
                let points_m: Vec<[f64; 2]> = paint.points.iter().filter_map(on_filter).collect();
                let dark = paint.points.len() - points_m.len();
                (points_m, dark)
            }
        };

        // Adds the strokes to a painting.
        let half_m = half_side_m(&shared.scene, traced_view.as_ref().map(|t| &t.map));
        let (mut painting, same) = as_painting(&shared.scene, &cutoff, half_m, [0.0; 3])
            .map_err(|e| refused(chain(&e)))?;
        let strokes = strokes(&points_m, paint);
        let added = strokes.len();
        painting.strokes.extend(strokes);
        if painting.strokes.len() > MAX_STROKES {
            return Err(refused(format!(
                "the painting would have more than {MAX_STROKES} strokes; start a new one"
            )));
        }
        let mut scene = shared.scene.clone();
        // Keeps the source: the default slit of a knife must not become a painting's default disc.
        scene.light.source = scene.effective().light.source;
        scene.technique = TechniqueSpec::Schlieren { cutoff: CutoffSpec::Painted(painting) };
        self.check_scene(&scene)?;
        if added > 0 {
            shared.scene = scene;
            self.changed(&mut shared);
        }
        let note = (!same && added > 0).then(|| {
            format!(
                "a {} filter cannot be painted over; the painting starts on black",
                cutoff.name()
            )
        });
        Ok(PaintOutcome { generation: shared.generation, added, dark, note })
    }

    /// Deflection, and point on the filter, of the light at a point of the image; `None` without
    /// light.
    pub fn trace(&self, at: [f64; 2]) -> Result<Option<(PlaneVector, PlaneVector)>, RefusedChange> {
        if !at.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(refused("points on the image are 0 to 1 from its upper left corner"));
        }
        let shared = self.lock();
        let view: Option<Arc<DeflectionMap>> = shared.frame.as_ref().and_then(|f| f.traced.clone());
        let view = view.ok_or_else(|| refused("the image is not rendered yet"))?;
        let f2 = shared.scene.optics().schlieren_focal_length_m;
        Ok(traced(&view.map, &view.framing, f2, at))
    }

    /// Requests a file. The receiver gets its bytes or the reason why there is none.
    pub(super) fn save(
        &self,
        kind: SaveKind,
        cancel: Arc<AtomicBool>,
    ) -> Result<tokio::sync::oneshot::Receiver<Result<Vec<u8>, String>>, RefusedChange> {
        const QUEUE: usize = 4;
        let mut shared = self.lock();
        if shared.saves.len() >= QUEUE {
            return Err(refused(format!(
                "{QUEUE} files are being written already; try again when they are done"
            )));
        }
        let (reply, receiver) = tokio::sync::oneshot::channel();
        let scene = shared.scene.clone();
        shared.saves.push_back(Save { scene, kind, cancel, reply });
        drop(shared);
        self.cancel.store(true, Ordering::Relaxed);
        self.wake.notify_all();
        Ok(receiver)
    }

    /// Ends the rendering thread.
    pub(super) fn stop(&self) {
        let mut shared = self.lock();
        shared.stop = true;
        // Dropping the senders notifies the waiting requests.
        for save in shared.saves.drain(..) {
            save.cancel.store(true, Ordering::Relaxed);
        }
        drop(shared);
        self.cancel.store(true, Ordering::Relaxed);
        self.wake.notify_all();
    }

    /// Makes a frame the newest one and notifies all waiting requests.
    pub(super) fn publish(&self, frame: Frame) {
        let serial = frame.info.serial;
        self.lock().frame = Some(Arc::new(frame));
        self.frames.send_replace(serial);
    }

    fn changed(&self, shared: &mut Shared) {
        shared.generation += 1;
        self.cancel.store(true, Ordering::Relaxed);
        self.wake.notify_all();
    }
}

/// Strokes through points on the filter. Points of a stroke on the image that are farther apart on
/// the filter than the brush is wide are not joined, because across a shock there is nothing
/// between them. Points that almost repeat the last one add nothing.
fn strokes(points_m: &[[f64; 2]], paint: &Paint) -> Vec<Stroke> {
    let distance = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut strokes: Vec<Stroke> = Vec::new();
    let mut last: Option<[f64; 2]> = None;
    for &to_m in points_m {
        let joined =
            |l: &[f64; 2]| paint.on == Canvas::Filter || distance(*l, to_m) <= 2.0 * paint.radius_m;
        if last.is_some_and(|l| distance(l, to_m) < 0.05 * paint.radius_m) {
            continue;
        }
        let from_m = last.filter(joined).unwrap_or(to_m);
        strokes.push(Stroke { from_m, to_m, radius_m: paint.radius_m, rgb: paint.rgb });
        last = Some(to_m);
    }
    strokes
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

fn check_limits(scene: &Scene) -> Result<(), RefusedChange> {
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

/// The message of an error with those of its causes.
pub(super) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(c) = cause {
        text += &format!(": {c}");
        cause = c.source();
    }
    text
}

#[cfg(test)]
mod tests;
