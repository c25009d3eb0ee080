//! Reads the next time of a series while the present one is shown.

use super::{Section, Worker};
use crate::render::{FileStamp, RenderError, has_room_beside};
use crate::scene::Scene;
use crate::serve::flow::Flow;
use std::sync::Arc;
use std::thread::JoinHandle;

/// A step that is being read.
pub(super) struct NextStep {
    /// Its scene, relative to the surroundings of the first step.
    scene: Scene,
    stamp: FileStamp,
    thread: JoinHandle<Result<(Flow, Section), RenderError>>,
}

impl NextStep {
    /// Begins to read a step. `number` is announced when it is ready.
    fn begin(worker: &Worker, scene: Scene, number: usize) -> NextStep {
        let session = Arc::clone(&worker.session);
        let (stamp, of_thread) = (FileStamp::of(&scene.flow.file), scene.clone());
        let thread = std::thread::spawn(move || {
            let scene = of_thread;
            let flow = Flow::open(&scene.flow.file, &scene.flow.open_options())?;
            let section = Section::of(&flow, &scene)?;
            section.full.prepare(&scene);
            session.lock().read_ahead = Some(number);
            Ok((flow, section))
        });
        NextStep { scene, stamp, thread }
    }

    fn is_of(&self, scene: &Scene) -> bool {
        self.scene.flow == scene.flow
            && self.scene.light.wavelengths_nm == scene.light.wavelengths_nm
    }

    /// The step, if it is that of a scene whose reference is set. `None` if it is another, if it
    /// could not be read, or if its file has changed since: then it must be read again.
    pub(super) fn take(self, scene: &Scene) -> Option<(Flow, Section)> {
        if !self.is_of(scene) || self.stamp != FileStamp::of(&scene.flow.file) {
            return None;
        }
        // A panic would be the same again, where it is reported.
        self.thread.join().ok()?.ok()
    }
}

impl Worker {
    /// Begins to read the step after that of a scene, in the direction in which steps were chosen
    /// last, unless one is being read or the memory that is free might not hold both.
    pub(super) fn read_ahead(&mut self, scene: &Scene) {
        let session = Arc::clone(&self.session);
        let Some(shown) = session.steps.iter().position(|s| s.path == scene.flow.file) else {
            return;
        };
        let backwards = self.step.is_some_and(|before| before > shown)
            || self.step == Some(shown) && self.backwards;
        (self.step, self.backwards) = (Some(shown), backwards);
        let next = if backwards { shown.checked_sub(1) } else { Some(shown + 1) };
        let Some((number, step)) = next.and_then(|n| Some((n, session.steps.get(n)?))) else {
            return;
        };
        let Some(section) = &self.section else { return };
        let mut wanted = scene.clone();
        wanted.flow.file.clone_from(&step.path);
        if session.is_later(&wanted) {
            let input = section.full.input.as_ref();
            let of_first = input.filter(|_| shown == 0).map(|i| i.reference_n_minus_1);
            let known = of_first.or(self.reference.as_ref().map(|r| r.2));
            // Without it, the first step must be read before.
            let Some(n_minus_1) = known else { return };
            wanted.flow.reference_n_minus_1 = Some(n_minus_1);
        }
        let is_busy =
            self.next.as_ref().is_some_and(|n| n.is_of(&wanted) || !n.thread.is_finished());
        if !is_busy && has_room_beside(&section.full, FileStamp::of(&step.path)) {
            self.next = Some(NextStep::begin(self, wanted, number));
        }
    }
}
