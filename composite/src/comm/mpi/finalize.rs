//! The end of a rank: its messages arrive, the others learn that it leaves, and MPI is finalized.

use super::{Abi, Communicator, DRAIN_TIMEOUT, MpiComm};
use std::time::{Duration, Instant};

impl Drop for MpiComm {
    fn drop(&mut self) {
        // The surrounding program has ended MPI first: nothing can be sent any more.
        if self.is_mpi_over() {
            return;
        }
        if std::thread::panicking() {
            self.abort("this rank panicked");
        }
        if self.mpi.abi == Abi::Smpi {
            if self.finalize {
                // SAFETY: called once, by the object that started MPI. SimGrid finds ranks that
                // wait here for ever.
                unsafe { (self.mpi.functions.finalize)() };
            }
            return;
        }

        // Messages must arrive before the notice that this rank has left.
        let begin = Instant::now();
        self.transfers.reclaim_buffers(&self.mpi);
        while self.transfers.outgoing() > 0
            && begin.elapsed() < DRAIN_TIMEOUT
            && self.aborted.is_none()
        {
            std::thread::yield_now();
            self.transfers.reclaim_buffers(&self.mpi);
        }
        if self.aborted.is_none() {
            let others = self.others();
            self.notices.send_left(&self.mpi, others);
        }
        while !self.notices.delivered(&self.mpi) && begin.elapsed() < DRAIN_TIMEOUT {
            std::thread::yield_now();
        }

        if !self.finalize && self.aborted.is_none() {
            self.free_duplicates();
            return;
        }
        // MPI_Finalize waits for all ranks, as at the end of every MPI program. After a fault not
        // all ranks reach it, and a rank that is still working may yet report one.
        if self.finalize && self.aborted.is_none() {
            while self.others().any(|other| !self.left[other]) {
                if self.process_notices().is_err() {
                    return;
                }
                self.transfers.reclaim_buffers(&self.mpi);
                std::thread::sleep(Duration::from_micros(100));
            }
            // SAFETY: called once, by the object that started MPI.
            unsafe { (self.mpi.functions.finalize)() };
        }
    }
}
