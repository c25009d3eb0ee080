//! The state that requests and the rendering thread share: the scene, the newest frame and the
//! pending work.
//!
//! Requests only change values under a lock that is never held for long. [`super::worker`] does
//! everything that takes time.

mod edit;
mod flow_change;
mod paint;
mod profile;
#[cfg(test)]
mod tests;

pub use paint::{Canvas, Paint, PaintOutcome};

use super::flow::ArrayInfo;
use super::frame::Frame;
use crate::drawing::Overlay;
use crate::input::Step;
use crate::scene::{CutoffSpec, FlowSpec, Scene, TechniqueSpec};
use edit::{TechniqueSettings, check_limits};
use glam::DVec3;
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
/// Largest number of nodes along the longest axis to which a page can resample.
const MAX_NODES: usize = 320;
/// Largest number of points of one request to paint.
pub const MAX_POINTS: usize = 4096;

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
    /// What is drawn on the image for viewing.
    pub(super) overlay: Option<Overlay>,
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
    /// The flow by all techniques.
    Sheet,
}

pub(super) struct Shared {
    pub(super) scene: Scene,
    /// Number of changes of the scene.
    pub(super) generation: u64,
    pub(super) saves: VecDeque<Save>,
    pub(super) frame: Option<Arc<Frame>>,
    pub(super) stop: bool,
    /// What is drawn on the image.
    pub(super) overlay: Option<Overlay>,
    /// Whether the frame follows the flow's shape.
    fitted: bool,
    /// Size of the gas, once it is read.
    size_m: Option<DVec3>,
    /// The last scene that was shown, and what was drawn on it.
    shown: Option<(Scene, Option<Overlay>)>,
    /// The last flow whose index came from arrays, not from transfer functions.
    medium: FlowSpec,
    settings: BTreeMap<&'static str, TechniqueSettings>,
    /// The scene's flow, and the n0 - 1 of the series that was found for it.
    pub(super) reference: Option<(FlowSpec, f64)>,
    /// The step that was read last while another one was shown.
    pub(super) read_ahead: Option<usize>,
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
    /// What the flow's quantities were called when the program started: arrays that are constant,
    /// which `arrays` leaves out, among them.
    given: Vec<String>,
    image: Option<CutoffSpec>,
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
            overlay: None,
            fitted: false,
            size_m: None,
            shown: None,
            medium: scene.flow.clone(),
            settings: BTreeMap::new(),
            reference: None,
            read_ahead: None,
        };
        let f = scene.flow;
        let given = [f.density, f.temperature, f.pressure, f.n_minus_1];
        Ok(Session {
            shared: Mutex::new(shared),
            wake: Condvar::new(),
            cancel: AtomicBool::new(false),
            frames: tokio::sync::watch::channel(0).0,
            steps,
            arrays,
            given: given.into_iter().flatten().collect(),
            image,
        })
    }

    /// Lets the frame follow the flow's shape.
    #[must_use]
    pub(super) fn fitted(self, fit: bool) -> Session {
        self.lock().fitted = fit;
        self
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
            "read_ahead": shared.read_ahead,
            "arrays": self.arrays,
            "overlay": shared.overlay.map(|o| o.style),
            "fit": shared.fitted,
            "techniques": TechniqueSpec::NAMES,
            "image_filter": self.image,
            "limits": {
                "side": MAX_SIDE,
                "samples": MAX_SAMPLES,
                "strokes": MAX_STROKES,
                "nodes": MAX_NODES,
            },
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

    /// Whether a scene shows a later step, which uses the surroundings of the first one.
    pub(super) fn is_later(&self, scene: &Scene) -> bool {
        scene.flow.reference_n_minus_1.is_none()
            && self.steps.first().is_some_and(|s| s.path != scene.flow.file)
    }

    /// Why the present scene has no sheet.
    pub(super) fn sheet_refusal(&self) -> Option<RefusedChange> {
        let cure = "choose one on the page, or use `schlieren render`";
        crate::sheet::refusal(&self.lock().scene, cure).map(RefusedChange)
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
        let (scene, overlay) = (shared.scene.clone(), shared.overlay);
        shared.saves.push_back(Save { scene, kind, overlay, cancel, reply });
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
        let mut shared = self.lock();
        if frame.info.error.is_none() && frame.info.generation == shared.generation {
            shared.shown = Some((shared.scene.clone(), shared.overlay));
        }
        shared.frame = Some(Arc::new(frame));
        drop(shared);
        self.frames.send_replace(serial);
    }

    fn changed(&self, shared: &mut Shared) {
        shared.generation += 1;
        self.cancel.store(true, Ordering::Relaxed);
        self.wake.notify_all();
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
