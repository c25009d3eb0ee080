//! Helps tests: flows whose exits are known in closed form, and functions that expose a film to
//! them.

use crate::film::beams::expose_beams;
use crate::film::photons::{Exposure, expose};
use crate::film::{Film, Framing};
use crate::path::{Exit, LightPaths, PathQuantities, Start};
use crate::technique::Technique;
use crate::view::{Axis, View};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A thin flow.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClosedForm {
    kind: Kind,
    view: View,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Prism([f32; 2]),
    ConstantPath(f64),
    PathRamp(f64),
    Gaussian { amplitude_m: f64, sigma_m: f64, depth_m: f64 },
}

impl ClosedForm {
    fn of(kind: Kind) -> ClosedForm {
        ClosedForm { kind, view: View::along(Axis::Z, glam::DVec3::ZERO) }
    }

    /// The same deflection everywhere, at depth 0. In focus there, no ray is displaced.
    pub(crate) fn prism(deflection_rad: [f32; 2]) -> ClosedForm {
        ClosedForm::of(Kind::Prism(deflection_rad))
    }

    /// The same path difference everywhere.
    pub(crate) fn constant_path(opd_m: f64) -> ClosedForm {
        ClosedForm::of(Kind::ConstantPath(opd_m))
    }

    /// A path difference that increases to the right.
    pub(crate) fn path_ramp(per_m: f64) -> ClosedForm {
        ClosedForm::of(Kind::PathRamp(per_m))
    }

    /// A thin Gaussian lens at a depth: path `amplitude exp(-r²/2σ²)`, deflection its gradient.
    pub(crate) fn gaussian(amplitude_m: f64, sigma_m: f64, depth_m: f64) -> ClosedForm {
        ClosedForm::of(Kind::Gaussian { amplitude_m, sigma_m, depth_m })
    }

    pub(crate) fn exit(&self, s: &Start) -> Exit {
        let [x, y] = s.position_m.map(f64::from);
        match self.kind {
            Kind::Prism(deflection_rad) => Exit { deflection_rad, ..Exit::UNDISTURBED },
            Kind::ConstantPath(opd_m) => Exit { opd_m: opd_m as f32, ..Exit::UNDISTURBED },
            Kind::PathRamp(per_m) => Exit { opd_m: (per_m * x) as f32, ..Exit::UNDISTURBED },
            Kind::Gaussian { amplitude_m, sigma_m, depth_m } => {
                let s2 = sigma_m * sigma_m;
                let opd = amplitude_m * (-0.5 * (x * x + y * y) / s2).exp();
                Exit {
                    deflection_rad: [x, y].map(|c| (-c / s2 * opd) as f32),
                    opd_m: opd as f32,
                    exit_depth_m: depth_m as f32,
                    ..Exit::UNDISTURBED
                }
            }
        }
    }
}

impl LightPaths for ClosedForm {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        starts.iter().zip(exits).for_each(|(s, e)| *e = self.exit(s));
    }
    fn view(&self) -> &View {
        &self.view
    }
    fn quantities(&self) -> PathQuantities {
        PathQuantities { opd: true }
    }
    fn difference_step_m(&self) -> f64 {
        1e-4
    }
}

pub(crate) fn exposure<'a>(technique: &'a Technique, paths: &'a dyn LightPaths) -> Exposure<'a> {
    Exposure {
        paths,
        technique,
        solids: None,
        sampling: Default::default(),
        seed: 1,
        margin_px: 4,
        tilted_beams: false,
    }
}

fn photons<const C: usize>(
    t: &Technique,
    p: &ClosedForm,
    framing: Framing,
    samples: u32,
) -> Vec<[f32; C]> {
    let film = Film::<C>::new(framing, true);
    let cancel = AtomicBool::new(false);
    let films = [film];
    let done = expose(&exposure(t, p), &films, 0..samples, false, &cancel, &|_| {})
        .expect("not cancelled");
    assert_eq!(done.tally.not_a_number, 0);
    films[0].to_pixels(f64::from(samples))
}

/// Exposes a grey film by photons.
pub(crate) fn expose_grey(
    t: &Technique,
    p: &ClosedForm,
    framing: Framing,
    samples: u32,
) -> Vec<f32> {
    photons::<1>(t, p, framing, samples).into_iter().flatten().collect()
}

/// Exposes a colour film by photons.
pub(crate) fn expose_rgb(
    t: &Technique,
    p: &ClosedForm,
    framing: Framing,
    samples: u32,
) -> Vec<[f32; 3]> {
    photons::<3>(t, p, framing, samples)
}

/// Exposes a grey film by beams.
pub(crate) fn beams_grey(
    t: &Technique,
    p: &ClosedForm,
    framing: Framing,
    per_side: u32,
) -> Vec<f32> {
    let film = Film::<1>::new(framing, false);
    expose_beams(&exposure(t, p), &film, per_side, &AtomicBool::new(false), &|_| {})
        .expect("not cancelled");
    film.to_pixels(1.0).into_iter().flatten().collect()
}

/// Runs `work` on a thread of its own and returns its result. Fails the test instead of hanging
/// when it takes longer than `limit`.
pub(crate) fn with_timeout<T: Send + 'static>(
    limit: Duration,
    what: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> T {
    let (sender, receiver) = std::sync::mpsc::channel();
    let worker = std::thread::spawn(move || {
        // The receiver is gone when the limit has passed.
        let _ = sender.send(work());
    });
    match receiver.recv_timeout(limit) {
        Ok(done) => done,
        Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {
            panic!("{what}: not done within {limit:?}")
        }
        Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => {
            std::panic::resume_unwind(worker.join().err().unwrap_or_else(|| Box::new("no panic")))
        }
    }
}

/// Runs job 0 on a pool and spawns 48 more jobs from outside while it runs, as another image would.
/// This repeats with fresh `jobs` for each of several delays. A worker that waits inside rayon
/// takes these late jobs before it continues.
pub(crate) fn with_concurrent_jobs<J: Fn(usize) + Send + Sync + 'static>(
    threads: usize,
    jobs: impl Fn() -> J,
) {
    const JOBS: usize = 49;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    for delay_us in [100, 300, 1000, 2000, 3000, 5000, 8000, 12_000, 20_000, 30_000] {
        let job = std::sync::Arc::new(jobs());
        let (sender, receiver) = std::sync::mpsc::channel();
        for i in 0..JOBS {
            let (job, sender) = (job.clone(), sender.clone());
            pool.spawn(move || {
                job(i);
                // The receiver is gone when the test has failed.
                let _ = sender.send(());
            });
            if i == 0 {
                std::thread::sleep(Duration::from_micros(delay_us));
            }
        }
        drop(sender);
        assert_eq!(receiver.iter().count(), JOBS, "a job panicked");
    }
}
