//! Recovers from device failures: lost batches are traced again on the reopened device, and the
//! same march on the CPU traces what that does not finish. The image takes longer but is as
//! accurate.

use super::GpuError;
use super::method::{GpuOptions, Method};
use crate::field::Field;
use crate::interpolate::Interpolant;
use crate::march::{
    Deviational, FieldInterpolant, FullOfField, FullOptions, Integrator, LineOfSight, Options,
    Pefrl, RungeKutta4, Scheme, Sharma,
};
use crate::path::{Exit, LightPaths, Start};
use crate::view::View;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Failure of a batch.
pub(super) struct Failure {
    /// Number of the device that had the batch: how many devices preceded it.
    pub(super) device: u32,
    /// Why.
    pub(super) error: GpuError,
}

/// Traces batches of rays asynchronously: the caller prepares the next batch meanwhile. May fail.
pub(super) trait BatchTracer {
    /// A submitted batch.
    type Pending;

    /// Submits a batch.
    fn submit(&self, starts: &[Start], parallel: bool) -> Result<Self::Pending, Failure>;

    /// Waits for a batch and reads its exits.
    fn finish(
        &self,
        pending: Self::Pending,
        exits: &mut [Exit],
        parallel: bool,
    ) -> Result<(), Failure>;

    /// Replaces the failed device, unless another thread has done so. The number of replacements
    /// must be bounded. Rayon's workers may be waiting for this call, so it must not wait for
    /// rayon.
    ///
    /// # Errors
    /// If there is no other device, or the batch failed but not the device.
    fn replace(&self, failed: &Failure) -> Result<(), GpuError>;
}

/// The march on the CPU that replaces a failed device, and the cause of the failure.
pub(super) struct CpuFallback<'a> {
    make: Box<dyn Fn() -> Box<dyn LightPaths + Send + 'a> + Send + Sync + 'a>,
    made: OnceLock<Box<dyn LightPaths + Send + 'a>>,
    /// The first failure.
    cause: OnceLock<GpuError>,
    /// Why no other device replaced it.
    reopen_error: OnceLock<GpuError>,
    repeated: AtomicU64,
    rays: AtomicU64,
}

impl<'a> CpuFallback<'a> {
    /// `make` is called at most once. Rayon's workers may be waiting for it, so it must not wait
    /// for rayon: a waiting worker takes other jobs, whose batches fail as well.
    fn new(
        make: impl Fn() -> Box<dyn LightPaths + Send + 'a> + Send + Sync + 'a,
    ) -> CpuFallback<'a> {
        CpuFallback {
            make: Box::new(make),
            made: OnceLock::new(),
            cause: OnceLock::new(),
            reopen_error: OnceLock::new(),
            repeated: AtomicU64::new(0),
            rays: AtomicU64::new(0),
        }
    }

    /// The same march on the CPU through the same field.
    pub(super) fn of_march(
        field: &'a Field,
        view: View,
        interpolant: Interpolant,
        options: GpuOptions,
    ) -> CpuFallback<'a> {
        CpuFallback::new(move || march_on_this_thread(field, view, interpolant, options))
    }

    /// Number of rays that the CPU traced.
    pub(super) fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Number of rays that a replacement device traced again.
    pub(super) fn repeated(&self) -> u64 {
        self.repeated.load(Ordering::Relaxed)
    }

    /// Notes the cause of a failure; the first one is the cause of all.
    pub(super) fn set_cause(&self, error: &GpuError) {
        let _ = self.cause.set(error.clone());
    }

    /// Notes rays that a replacement device traced again.
    pub(super) fn add_repeated(&self, rays: u64) {
        self.repeated.fetch_add(rays, Ordering::Relaxed);
    }

    /// A warning with the first failure and the remedy.
    pub(super) fn device_warning(&self) -> Option<String> {
        let cause = self.cause.get()?;
        let was_reopened = self.repeated() > 0;
        let reopen_error = self.reopen_error.get().filter(|e| *e != cause);
        Some(match (was_reopened, self.rays() > 0) {
            (false, _) => match reopen_error {
                None => super::fallback_message(cause),
                Some(e) => format!("{} ({e})", super::fallback_message(cause)),
            },
            (true, false) => {
                format!(
                    "{}; it was reopened and the lost rays were traced again",
                    super::failure_message(cause)
                )
            }
            (true, true) => format!(
                "{}; it was reopened and the lost rays were traced again, until {}; the CPU traced \
                 the rest",
                super::failure_message(cause),
                reopen_error.unwrap_or(cause)
            ),
        })
    }

    /// Traces all rays in batches. Each batch is prepared while the device works on the previous
    /// one.
    pub(super) fn trace(
        &self,
        device: &impl BatchTracer,
        batch: usize,
        starts: &[Start],
        exits: &mut [Exit],
        parallel: bool,
    ) {
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        let mut before = None;
        for (starts, exits) in starts.chunks(batch).zip(exits.chunks_mut(batch)) {
            let next = device.submit(starts, parallel);
            if let Some((pending, starts, exits)) = before.take() {
                self.finish(device, pending, starts, exits, parallel);
            }
            match next {
                Ok(pending) => before = Some((pending, starts, exits)),
                Err(failure) => self.repeat(device, failure, starts, exits, parallel),
            }
        }
        if let Some((pending, starts, exits)) = before {
            self.finish(device, pending, starts, exits, parallel);
        }
    }

    fn finish<D: BatchTracer>(
        &self,
        device: &D,
        pending: D::Pending,
        starts: &[Start],
        exits: &mut [Exit],
        parallel: bool,
    ) {
        if let Err(failure) = device.finish(pending, exits, parallel) {
            self.repeat(device, failure, starts, exits, parallel);
        }
    }

    /// Traces a failed batch on replacement devices while there are any, then on the CPU.
    fn repeat(
        &self,
        device: &impl BatchTracer,
        mut failure: Failure,
        starts: &[Start],
        exits: &mut [Exit],
        parallel: bool,
    ) {
        // The first failure is the cause; later ones are consequences.
        let _ = self.cause.set(failure.error.clone());
        loop {
            if let Err(why) = device.replace(&failure) {
                let _ = self.reopen_error.set(why);
                return self.cpu_fallback(starts, exits, parallel);
            }
            let pending = device.submit(starts, parallel);
            match pending.and_then(|pending| device.finish(pending, exits, parallel)) {
                Ok(()) => {
                    self.repeated.fetch_add(starts.len() as u64, Ordering::Relaxed);
                    return;
                }
                Err(next) => failure = next,
            }
        }
    }

    fn cpu_fallback(&self, starts: &[Start], exits: &mut [Exit], parallel: bool) {
        self.rays.fetch_add(starts.len() as u64, Ordering::Relaxed);
        let cpu = self.made.get_or_init(|| (self.make)());
        if parallel {
            cpu.trace_parallel(starts, exits);
        } else {
            cpu.trace(starts, exits);
        }
    }
}

/// The march on the CPU, made by the calling thread alone.
fn march_on_this_thread<'a>(
    field: &'a Field,
    view: View,
    interpolant: Interpolant,
    options: GpuOptions,
) -> Box<dyn LightPaths + Send + 'a> {
    // What the CPU traces in place of the device, it does not skip: bricks are made by all threads.
    let GpuOptions { method, step_voxels, quantities, blank, .. } = options;
    let deviational = |scheme| -> Box<dyn LightPaths + Send + 'a> {
        let options = Options { scheme, step_voxels, quantities, blank, ..Options::default() };
        Box::new(Deviational::on_this_thread(field, view, interpolant, options))
    };
    match method {
        Method::Verlet => deviational(Scheme::Verlet),
        Method::Euler => deviational(Scheme::Euler),
        Method::Pefrl => full(field, view, interpolant, options, Pefrl),
        Method::Sharma => full(field, view, interpolant, options, Sharma),
        Method::RungeKutta4 => full(field, view, interpolant, options, RungeKutta4),
        // Never called: single rays of line of sight are not sent to the device.
        Method::LineOfSight => {
            Box::new(LineOfSight::new(field, view, interpolant, quantities, blank))
        }
    }
}

fn full<'a, G: Integrator + Copy + Send + 'a>(
    field: &'a Field,
    view: View,
    interpolant: Interpolant,
    GpuOptions { step_voxels, quantities, blank, .. }: GpuOptions,
    integrator: G,
) -> Box<dyn LightPaths + Send + 'a> {
    let interpolant = FieldInterpolant::on_this_thread(field, interpolant);
    let options = FullOptions { step_voxels, quantities, blank, ..FullOptions::default() };
    Box::new(FullOfField::new(field, interpolant, integrator, view, options))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::PathQuantities;
    use crate::testing::{with_concurrent_jobs, with_timeout};
    use glam::DVec3;
    use std::sync::Arc;
    use std::sync::atomic::AtomicU32;
    use std::time::Duration;

    /// Deflects each ray in proportion to its position. The factor distinguishes the device (2)
    /// from the CPU (1).
    struct LinearDeflection(View, f32);

    impl LightPaths for LinearDeflection {
        fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
            for (s, e) in starts.iter().zip(exits) {
                *e = Exit { deflection_rad: s.position_m.map(|p| p * self.1), ..Exit::UNDISTURBED };
            }
        }
        fn view(&self) -> &View {
            &self.0
        }
        fn quantities(&self) -> PathQuantities {
            PathQuantities::default()
        }
        fn difference_step_m(&self) -> f64 {
            1e-3
        }
    }

    fn linear_deflection(by: f32) -> LinearDeflection {
        LinearDeflection(View::new(DVec3::Z, DVec3::Y, DVec3::ZERO).unwrap(), by)
    }

    fn failure(reason: String) -> GpuError {
        GpuError::Failed { adapter: "Lamp 9".into(), reason }
    }

    /// A device that fails from a certain call on. Its replacements fail after the same number of
    /// calls.
    struct FailingDevice {
        at: u64,
        calls: AtomicU64,
        in_submit: bool,
        /// Number of replacements.
        others: u32,
        /// Number of the present device.
        present: AtomicU32,
    }

    impl FailingDevice {
        fn new(in_submit: bool, at: u64, others: u32) -> FailingDevice {
            FailingDevice {
                at,
                calls: AtomicU64::new(0),
                in_submit,
                others,
                present: AtomicU32::new(0),
            }
        }

        fn call(&self, submit: bool) -> Result<(), Failure> {
            if submit != self.in_submit || self.calls.fetch_add(1, Ordering::Relaxed) < self.at {
                return Ok(());
            }
            let n = self.calls.load(Ordering::Relaxed);
            let device = self.present.load(Ordering::Relaxed);
            Err(Failure { device, error: failure(format!("out of memory, call {n}")) })
        }
    }

    impl BatchTracer for FailingDevice {
        type Pending = Vec<Start>;
        fn submit(&self, starts: &[Start], _: bool) -> Result<Vec<Start>, Failure> {
            self.call(true).map(|()| starts.to_vec())
        }
        fn finish(&self, pending: Vec<Start>, exits: &mut [Exit], _: bool) -> Result<(), Failure> {
            self.call(false)?;
            linear_deflection(2.0).trace(&pending, exits);
            Ok(())
        }
        fn replace(&self, failed: &Failure) -> Result<(), GpuError> {
            let present = self.present.load(Ordering::Relaxed);
            if failed.device < present {
                return Ok(());
            }
            if present == self.others {
                let (adapter, reason) = ("Lamp 9".into(), "out of memory".into());
                return Err(GpuError::GivenUp { adapter, times: present, reason });
            }
            self.present.store(present + 1, Ordering::Relaxed);
            self.calls.store(0, Ordering::Relaxed);
            Ok(())
        }
    }

    #[test]
    fn what_a_failing_device_leaves_is_traced_on_the_cpu_and_the_first_cause_is_reported() {
        let starts: Vec<Start> =
            (0..95).map(|i| Start { position_m: [i as f32, -1.0], ..Start::default() }).collect();
        // There are ten batches, the last of which is short.
        for (in_submit, at) in
            [(true, 0), (true, 4), (true, 9), (false, 0), (false, 4), (false, 9), (true, 99)]
        {
            for parallel in [false, true] {
                let device = FailingDevice::new(in_submit, at, 0);
                let cpu_fallback_paths = CpuFallback::new(|| Box::new(linear_deflection(1.0)));
                let mut exits =
                    vec![Exit { deflection_rad: [f32::NAN; 2], ..Exit::UNDISTURBED }; 95];
                cpu_fallback_paths.trace(&device, 10, &starts, &mut exits, parallel);
                let by_device = (10 * at as usize).min(95);
                for (i, (s, e)) in starts.iter().zip(&exits).enumerate() {
                    let by = if i < by_device { 2.0 } else { 1.0 };
                    assert_eq!(
                        e.deflection_rad,
                        s.position_m.map(|p| p * by),
                        "ray {i}, failing at {at}"
                    );
                }
                assert_eq!(cpu_fallback_paths.rays(), 95 - by_device as u64);
                match cpu_fallback_paths.device_warning() {
                    None => assert_eq!(by_device, 95),
                    Some(warning) => {
                        let cause = format!("out of memory, call {}", at + 1);
                        for word in ["Lamp 9", &cause, "on the CPU"] {
                            assert!(warning.contains(word), "{word}: {warning}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn what_a_device_lost_is_traced_once_more_by_the_one_that_takes_its_place() {
        let starts: Vec<Start> =
            (0..95).map(|i| Start { position_m: [i as f32, -1.0], ..Start::default() }).collect();
        for in_submit in [true, false] {
            for at in [1, 2, 5, 9] {
                let device = FailingDevice::new(in_submit, at, 100);
                let cpu_fallback_paths = CpuFallback::new(|| Box::new(linear_deflection(1.0)));
                let mut exits =
                    vec![Exit { deflection_rad: [f32::NAN; 2], ..Exit::UNDISTURBED }; 95];
                cpu_fallback_paths.trace(&device, 10, &starts, &mut exits, false);
                for (i, (s, e)) in starts.iter().zip(&exits).enumerate() {
                    assert_eq!(
                        e.deflection_rad,
                        s.position_m.map(|p| p * 2.0),
                        "ray {i}, failing at {at}"
                    );
                }
                assert!(
                    cpu_fallback_paths.rays() == 0 && cpu_fallback_paths.repeated() >= 5,
                    "{}",
                    cpu_fallback_paths.repeated()
                );
                let warning = cpu_fallback_paths.device_warning().unwrap();
                for word in ["Lamp 9", &format!("out of memory, call {}", at + 1), "reopened"] {
                    assert!(warning.contains(word), "{word}: {warning}");
                }
                assert!(!warning.contains("CPU"), "{warning}");
            }
        }
    }

    /// The number of attempts is bounded and reported.
    #[test]
    fn a_device_that_fails_again_and_again_is_left_to_the_cpu_by_name() {
        let starts: Vec<Start> =
            (0..95).map(|i| Start { position_m: [i as f32, -1.0], ..Start::default() }).collect();
        for (in_submit, at) in [(true, 0), (true, 1), (false, 0), (false, 2)] {
            let device = FailingDevice::new(in_submit, at, 3);
            let cpu_fallback_paths = CpuFallback::new(|| Box::new(linear_deflection(1.0)));
            let mut exits = vec![Exit { deflection_rad: [f32::NAN; 2], ..Exit::UNDISTURBED }; 95];
            cpu_fallback_paths.trace(&device, 10, &starts, &mut exits, false);
            let on_cpu =
                starts.iter().zip(&exits).filter(|(s, e)| e.deflection_rad == s.position_m).count()
                    as u64;
            assert!(exits.iter().all(|e| !e.deflection_rad[0].is_nan()));
            assert_eq!(cpu_fallback_paths.rays(), on_cpu);
            assert_eq!(device.present.load(Ordering::Relaxed), 3);
            assert!(on_cpu > 0 && (at > 0) == (cpu_fallback_paths.repeated() > 0), "{on_cpu}");
            let warning = cpu_fallback_paths.device_warning().unwrap();
            for word in ["Lamp 9", "after 3 attempts to reopen it", "on the CPU", "the rest"] {
                assert!(warning.contains(word), "{word}: {warning}");
            }
        }
    }

    /// A film's tiles are rayon jobs. The first job whose batch fails builds the spline of the CPU
    /// fallback. If its worker waited inside rayon for parts of the spline, it would take another
    /// tile. That tile's batch would fail as well and would wait for the spline that its own worker
    /// is building.
    #[test]
    fn a_device_that_fails_inside_rayon_jobs_hangs_no_image() {
        let starts: Vec<Start> = (0..49 * 64)
            .map(|i| Start {
                position_m: [i % 64, i / 64].map(|k| (k as f32 - 31.4) * 0.01),
                ..Start::default()
            })
            .collect();
        let blob = |p: DVec3| 1e-4 * (-p.length_squared() / 0.02).exp();
        let field: &Field = Box::leak(Box::new(
            Field::from_fn([96; 3], [0.01; 3], DVec3::splat(-0.5), 1.0, blob).unwrap(),
        ));
        let view = View::new(DVec3::Z, DVec3::Y, DVec3::ZERO).unwrap();
        let march = Deviational::new(field, view, Interpolant::BSpline, Options::default());
        let mut expected = vec![Exit::UNDISTURBED; starts.len()];
        march.trace_parallel(&starts, &mut expected);
        let shared = Arc::new((starts, expected));
        for threads in [1, 2, 8] {
            let shared = shared.clone();
            with_timeout(Duration::from_secs(120), &format!("{threads} threads"), move || {
                with_concurrent_jobs(threads, || {
                    let device = FailingDevice::new(true, 0, 0);
                    let cpu_fallback_paths = CpuFallback::of_march(
                        field,
                        view,
                        Interpolant::BSpline,
                        GpuOptions::default(),
                    );
                    let shared = shared.clone();
                    move |tile| {
                        let of_tile = 64 * tile..64 * (tile + 1);
                        let mut exits = vec![Exit::UNDISTURBED; 64];
                        cpu_fallback_paths.trace(
                            &device,
                            16,
                            &shared.0[of_tile.clone()],
                            &mut exits,
                            false,
                        );
                        // Compare as text, because optical paths that were not requested are NaN.
                        assert_eq!(format!("{exits:?}"), format!("{:?}", &shared.1[of_tile]));
                    }
                });
            });
        }
    }
}
