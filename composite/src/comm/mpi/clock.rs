//! What time it is for a rank.
//!
//! Under SMPI every look at the simulated clock hands the processor to other simulated ranks, whose work empties the caches: a
//! program that measures itself would be slowed by that alone. There the clock is read where a call has just handed over anyway, and
//! from then on the processor time of this rank counts, which is what SMPI itself will add.
use super::abi::Abi;
use super::library::Mpi;
use rustix::time::{ClockId, clock_gettime};
use std::cell::Cell;

pub(super) struct Clock {
    /// Simulated seconds and the thread's processor seconds when both were read; unused outside SMPI.
    anchor: Cell<Option<(f64, f64)>>,
    simulated: bool,
}

fn processor_secs() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn library_secs(mpi: &Mpi) -> f64 {
    // SAFETY: no arguments.
    unsafe { (mpi.functions.wtime)() }
}

impl Clock {
    pub(super) fn new(abi: Abi) -> Self {
        Self { anchor: Cell::new(None), simulated: abi == Abi::Smpi }
    }

    /// Seconds since some moment in the past.
    pub(super) fn now(&self, mpi: &Mpi) -> f64 {
        match self.anchor.get() {
            Some((simulated, processor)) => simulated + (processor_secs() - processor),
            None => library_secs(mpi),
        }
    }

    /// To be called after every call of the library that may have handed over.
    pub(super) fn set(&self, mpi: &Mpi) {
        if self.simulated {
            let simulated = library_secs(mpi);
            self.anchor.set(Some((simulated, processor_secs())));
        }
    }
}
