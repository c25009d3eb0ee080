//! The clock of a rank.
//!
//! Under SMPI every reading of the simulated clock yields the processor to other simulated ranks,
//! whose work evicts the caches: measuring alone would slow a program down. So the simulated clock
//! is read only after a call that has waited. From then on the time that passes here counts, which
//! is about what SMPI itself will add (it adds processor time, but reading that takes most of a
//! microsecond, which would be added too). Calls that do not wait take no simulated time but may
//! yield, so the time inside them is subtracted. Right after a wait or barrier the time is
//! therefore exact, and spans within a frame are as accurate as the machine is quiet.
use super::abi::Abi;
use super::library::Mpi;
use std::cell::Cell;
use std::time::Instant;

pub(super) struct Clock {
    begin: Instant,
    /// Simulated seconds and this rank's own seconds when both were read; unused outside SMPI.
    anchor: Cell<Option<(f64, f64)>>,
    /// Seconds that passed inside calls.
    inside: Cell<f64>,
    simulated: bool,
}

fn library_secs(mpi: &Mpi) -> f64 {
    // SAFETY: no arguments.
    unsafe { (mpi.functions.wtime)() }
}

impl Clock {
    pub(super) fn new(abi: Abi) -> Self {
        Self {
            begin: Instant::now(),
            anchor: Cell::new(None),
            inside: Cell::new(0.0),
            simulated: abi == Abi::Smpi,
        }
    }

    fn here_secs(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Seconds since some moment in the past.
    pub(super) fn now(&self, mpi: &Mpi) -> f64 {
        if !self.simulated {
            return library_secs(mpi);
        }
        let (simulated, own) = self.anchor.get().unwrap_or_else(|| {
            let anchor = (library_secs(mpi), self.own_secs());
            self.anchor.set(Some(anchor));
            anchor
        });
        simulated + (self.own_secs() - own)
    }

    /// Like [`now`](Self::now), for spans in which nothing is waited for.
    pub(super) fn working_secs(&self, mpi: &Mpi) -> f64 {
        if self.simulated { self.own_secs() } else { library_secs(mpi) }
    }

    fn own_secs(&self) -> f64 {
        self.here_secs() - self.inside.get()
    }

    /// Wraps a call of the library that does not wait.
    pub(super) fn around<T>(&self, call: impl FnOnce() -> T) -> T {
        if !self.simulated {
            return call();
        }
        let begin = self.here_secs();
        let result = call();
        self.inside.set(self.inside.get() + self.here_secs() - begin);
        result
    }

    /// Call this after every call of the library that may have waited.
    pub(super) fn waited(&self) {
        self.anchor.set(None);
    }
}
