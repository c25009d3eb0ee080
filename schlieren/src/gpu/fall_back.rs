//! When the device fails on the way: what it did not finish is traced by the same march on the CPU. Pictures take longer then, and are as right.

use super::GpuError;
use crate::path::{Exit, LightPaths, Start};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Something that traces batches of rays while its caller prepares the next, and may fail.
pub(super) trait Batches {
    /// A batch on its way.
    type Pending;

    /// Sends a batch on its way.
    fn submit(&self, starts: &[Start], parallel: bool) -> Result<Self::Pending, GpuError>;

    /// Waits for a batch and reads it out.
    fn finish(&self, pending: Self::Pending, exits: &mut [Exit], parallel: bool) -> Result<(), GpuError>;
}

/// The march that stands in, and why it had to.
pub(super) struct FallBack<'a> {
    make: Box<dyn Fn() -> Box<dyn LightPaths + Send + 'a> + Send + Sync + 'a>,
    made: OnceLock<Box<dyn LightPaths + Send + 'a>>,
    cause: OnceLock<GpuError>,
    rays: AtomicU64,
}

impl<'a> FallBack<'a> {
    /// `make` is called once, if ever.
    pub(super) fn new(make: impl Fn() -> Box<dyn LightPaths + Send + 'a> + Send + Sync + 'a) -> FallBack<'a> {
        FallBack {
            make: Box::new(make),
            made: OnceLock::new(),
            cause: OnceLock::new(),
            rays: AtomicU64::new(0),
        }
    }

    /// Rays that it traced.
    pub(super) fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// The first failure, for who looks at the result.
    pub(super) fn trouble(&self) -> Option<String> {
        self.cause.get().map(super::made_up_for)
    }

    /// Traces all rays in batches, one being prepared while the device works on the one before.
    pub(super) fn trace(
        &self,
        device: &impl Batches,
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
                Err(e) => self.stand_in(e, starts, exits, parallel),
            }
        }
        if let Some((pending, starts, exits)) = before {
            self.finish(device, pending, starts, exits, parallel);
        }
    }

    fn finish<D: Batches>(
        &self,
        device: &D,
        pending: D::Pending,
        starts: &[Start],
        exits: &mut [Exit],
        parallel: bool,
    ) {
        if let Err(e) = device.finish(pending, exits, parallel) {
            self.stand_in(e, starts, exits, parallel);
        }
    }

    fn stand_in(&self, cause: GpuError, starts: &[Start], exits: &mut [Exit], parallel: bool) {
        // The first is the cause; what follows are its consequences.
        let _ = self.cause.set(cause);
        self.rays.fetch_add(starts.len() as u64, Ordering::Relaxed);
        let cpu = self.made.get_or_init(|| (self.make)());
        if parallel {
            cpu.trace_parallel(starts, exits);
        } else {
            cpu.trace(starts, exits);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::Wanted;
    use crate::view::View;
    use glam::DVec3;

    /// Bends each ray by its own place. Traced twice as far where the device did it, so that it shows who did.
    struct Bends(View, f32);

    impl LightPaths for Bends {
        fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
            for (s, e) in starts.iter().zip(exits) {
                *e = Exit { deflection_rad: s.position_m.map(|p| p * self.1), ..Exit::UNDISTURBED };
            }
        }
        fn view(&self) -> &View {
            &self.0
        }
        fn wanted(&self) -> Wanted {
            Wanted::default()
        }
        fn difference_step_m(&self) -> f64 {
            1e-3
        }
    }

    fn bends(by: f32) -> Bends {
        Bends(View::new(DVec3::Z, DVec3::Y, DVec3::ZERO).unwrap(), by)
    }

    /// A device that fails at a call, and ever after.
    struct Fails {
        at: u64,
        calls: AtomicU64,
        in_submit: bool,
    }

    impl Fails {
        fn call(&self, submit: bool) -> Result<(), GpuError> {
            if submit != self.in_submit || self.calls.fetch_add(1, Ordering::Relaxed) < self.at {
                return Ok(());
            }
            let n = self.calls.load(Ordering::Relaxed);
            Err(GpuError::Failed { adapter: "Lamp 9".into(), reason: format!("out of memory, call {n}") })
        }
    }

    impl Batches for Fails {
        type Pending = Vec<Start>;
        fn submit(&self, starts: &[Start], _: bool) -> Result<Vec<Start>, GpuError> {
            self.call(true).map(|()| starts.to_vec())
        }
        fn finish(&self, pending: Vec<Start>, exits: &mut [Exit], _: bool) -> Result<(), GpuError> {
            self.call(false)?;
            bends(2.0).trace(&pending, exits);
            Ok(())
        }
    }

    #[test]
    fn what_a_failing_device_leaves_is_traced_on_the_cpu_and_the_first_cause_is_told() {
        let starts: Vec<Start> =
            (0..95).map(|i| Start { position_m: [i as f32, -1.0], ..Start::default() }).collect();
        // Ten batches, the last one short.
        for (in_submit, at) in
            [(true, 0), (true, 4), (true, 9), (false, 0), (false, 4), (false, 9), (true, 99)]
        {
            for parallel in [false, true] {
                let device = Fails { at, calls: AtomicU64::new(0), in_submit };
                let fall_back = FallBack::new(|| Box::new(bends(1.0)));
                let mut exits = vec![Exit { deflection_rad: [f32::NAN; 2], ..Exit::UNDISTURBED }; 95];
                fall_back.trace(&device, 10, &starts, &mut exits, parallel);
                let by_device = (10 * at as usize).min(95);
                for (i, (s, e)) in starts.iter().zip(&exits).enumerate() {
                    let by = if i < by_device { 2.0 } else { 1.0 };
                    assert_eq!(e.deflection_rad, s.position_m.map(|p| p * by), "ray {i}, failing at {at}");
                }
                assert_eq!(fall_back.rays(), 95 - by_device as u64);
                match fall_back.trouble() {
                    None => assert_eq!(by_device, 95),
                    Some(told) => {
                        let cause = format!("out of memory, call {}", at + 1);
                        for word in ["Lamp 9", &cause, "on the CPU"] {
                            assert!(told.contains(word), "{word}: {told}");
                        }
                    }
                }
            }
        }
    }
}
