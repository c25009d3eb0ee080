//! Renders in parallel with the calling program, one frame behind.
//!
//! The thesis (section 4.1.2) hides the time a program needs to prepare a frame behind the time the
//! ray tracer needs for the previous frame. At each buffer swap the program submits frame N and
//! receives frame N-1. The cost is one frame of latency; the frame time becomes the larger of the
//! two times instead of their sum.

use super::{RenderError, RenderOptions, RenderOutput, Renderer};
use crate::camera::Camera;
use crate::scene::Scene;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

struct Job {
    scene: Arc<Scene>,
    camera: Camera,
    options: RenderOptions,
}

/// Renders on its own thread. Dropping it cancels the current frame and waits for the thread.
pub struct AsyncRenderer {
    jobs: Option<Sender<Job>>,
    results: Receiver<Result<RenderOutput, RenderError>>,
    worker: Option<JoinHandle<()>>,
    in_flight: bool,
    stop: Arc<AtomicBool>,
}

impl AsyncRenderer {
    /// Starts the thread. `threads` gives it its own pool, so that the program keeps the other
    /// cores; `None` shares rayon's global pool.
    pub fn new(threads: Option<usize>) -> Result<AsyncRenderer, RenderError> {
        let no_worker = |e: &dyn std::fmt::Display| RenderError::NoWorker { reason: e.to_string() };
        let pool = threads
            .map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build())
            .transpose()
            .map_err(|e| no_worker(&e))?;
        let (jobs, incoming) = channel::<Job>();
        let (outgoing, results) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stop_worker = stop.clone();
        let worker = std::thread::Builder::new()
            .name("rt-core async".into())
            .spawn(move || {
                let mut renderer = Renderer::new();
                for job in incoming {
                    let mut run = || {
                        renderer.render_unless(
                            &job.scene,
                            &job.camera,
                            &job.options,
                            Some(&stop_worker),
                        )
                    };
                    let result = match &pool {
                        Some(pool) => pool.install(run),
                        None => run(),
                    };
                    // The receiver is gone: the renderer was dropped.
                    if outgoing.send(result).is_err() {
                        return;
                    }
                }
            })
            .map_err(|e| no_worker(&e))?;
        Ok(AsyncRenderer {
            jobs: Some(jobs),
            results,
            worker: Some(worker),
            in_flight: false,
            stop,
        })
    }

    /// Submits frame N. Waits for frame N-1, starts frame N and returns frame N-1; `None` for the
    /// first frame. An error belongs to frame N-1; frame N has been started nevertheless.
    pub fn submit(
        &mut self,
        scene: Arc<Scene>,
        camera: Camera,
        options: RenderOptions,
    ) -> Result<Option<RenderOutput>, RenderError> {
        let previous = self.wait();
        let gone = || RenderError::NoWorker { reason: "its thread has ended".into() };
        self.jobs
            .as_ref()
            .ok_or_else(gone)?
            .send(Job { scene, camera, options })
            .map_err(|_| gone())?;
        self.in_flight = true;
        previous
    }

    /// Waits for the last submitted frame; `None` when there is none (or it was already returned).
    pub fn wait(&mut self) -> Result<Option<RenderOutput>, RenderError> {
        if !std::mem::replace(&mut self.in_flight, false) {
            return Ok(None);
        }
        match self.results.recv() {
            Ok(result) => result.map(Some),
            Err(_) => Err(RenderError::NoWorker { reason: "its thread has ended".into() }),
        }
    }
}

impl Drop for AsyncRenderer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // Closing the channel ends the worker's loop.
        self.jobs = None;
        if let Some(worker) = self.worker.take() {
            // Panics in tiles are caught and reported, so the result of `join` adds nothing.
            worker.join().ok();
        }
    }
}
