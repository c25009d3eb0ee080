//! A simulated network: ranks as threads of one process whose messages take the time that a network
//! model computes.
//!
//! Every rank has a clock. Computation between two calls advances it by the processor time of its
//! thread (or by the argument of [`SimComm::compute`]), and messages advance it by the LogGP model
//! of [`Network`]. So one machine with few cores gives the times of many nodes, with nothing
//! installed. The model omits contention inside the network, noise of operating systems, and that a
//! node's caches and memory belong to it alone (here many ranks share them).
//!
//! ```
//! use composite::comm::sim::{Compute, Network, run};
//! use composite::Communicator;
//! use std::time::Duration;
//!
//! // 128 ranks send a megabyte each to their neighbour.
//! let ends = run(128, Network::QDR, Compute::Given, |mut comm| {
//!     let next = (comm.rank() + 1) % 128;
//!     comm.send(next, 1, vec![0; 1 << 20]).unwrap();
//!     comm.recv((comm.rank() + 127) % 128, 1, 1 << 20, Duration::from_secs(1)).unwrap();
//!     comm.now()
//! });
//! let secs = *ends[5].as_ref().unwrap();
//! assert!((secs - (2.0 * 0.4e-6 + 1e-6 + 1048576.0 / 3.2e9)).abs() < 1e-9, "{secs}");
//! ```
mod flows;
mod network;
mod schedule;

pub use network::Network;

use super::{Arrival, CommError, Communicator, Receive};
use schedule::{PostedReceive, Schedule, State};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Source of the time of computing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Compute {
    /// Processor time of the rank's thread, times this: 1 for nodes as fast as this machine.
    Measured(f64),
    /// Only the arguments of [`SimComm::compute`]: every run has the same times.
    Given,
}

struct Group {
    schedule: Mutex<Schedule>,
    /// One per rank.
    wake: Vec<Condvar>,
}

impl Group {
    fn lock(&self) -> MutexGuard<'_, Schedule> {
        // Nothing panics while the lock is held.
        self.schedule.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn dispatch(&self, schedule: &mut Schedule) {
        schedule.dispatch(|rank| self.wake[rank].notify_all());
    }
}

/// One rank of a simulated group. Dropping it leaves the group.
pub struct SimComm {
    rank: usize,
    group: Arc<Group>,
    compute: Compute,
    /// Processor time of this thread when the last call returned.
    since_secs: f64,
    /// Receives not yet served, oldest first, by source and tag.
    posted: BTreeMap<(usize, u32), VecDeque<u64>>,
    next_id: u64,
}

/// Runs `work` on `size` simulated ranks and returns their results in rank order. As many ranks
/// compute at once as this machine has cores.
///
/// A panic of one rank is that rank's [`CommError::Panicked`]; the others see it as
/// [`CommError::PeerLost`].
pub fn run<T: Send>(
    size: usize,
    network: Network,
    compute: Compute,
    work: impl Fn(SimComm) -> T + Sync,
) -> Vec<Result<T, CommError>> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    run_on(size, network, compute, cores, work)
}

/// As [`run`], with at most `cores` ranks computing at once. With one, ranks do not disturb each
/// other's caches while they compute.
pub fn run_on<T: Send>(
    size: usize,
    network: Network,
    compute: Compute,
    cores: usize,
    work: impl Fn(SimComm) -> T + Sync,
) -> Vec<Result<T, CommError>> {
    let group = Arc::new(Group {
        schedule: Mutex::new(Schedule::new(size, network, cores)),
        wake: (0..size).map(|_| Condvar::new()).collect(),
    });
    let comm = |rank| SimComm {
        rank,
        group: Arc::clone(&group),
        compute,
        since_secs: 0.0,
        posted: BTreeMap::new(),
        next_id: 0,
    };
    super::threads::run_group((0..size).map(comm).collect(), |comm: SimComm| work(comm.started()))
}

/// Processor time of this thread.
fn cpu_secs() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

impl SimComm {
    /// Waits for this rank's first turn to compute.
    fn started(mut self) -> SimComm {
        let group = Arc::clone(&self.group);
        let mut schedule = group.lock();
        group.dispatch(&mut schedule);
        self.until_computing(schedule);
        self
    }

    /// Adds `secs` of computing to this rank's clock, in addition to the measured time.
    pub fn compute(&mut self, secs: f64) {
        let group = Arc::clone(&self.group);
        let mut schedule = group.lock();
        self.charge_compute(&mut schedule);
        schedule.ranks[self.rank].clock_secs += secs.max(0.0);
        group.dispatch(&mut schedule);
        drop(schedule);
        self.since_secs = cpu_secs();
    }

    /// Adds the computing time since the last call to the clock.
    fn charge_compute(&mut self, schedule: &mut Schedule) {
        if let Compute::Measured(scale) = self.compute {
            schedule.ranks[self.rank].clock_secs += (cpu_secs() - self.since_secs).max(0.0) * scale;
        }
    }

    /// Waits until this rank's call may take effect.
    fn until_granted<'a>(
        &self,
        group: &'a Group,
        mut schedule: MutexGuard<'a, Schedule>,
    ) -> Result<MutexGuard<'a, Schedule>, CommError> {
        group.dispatch(&mut schedule);
        loop {
            if let Some((by, reason)) = &schedule.aborted {
                return Err(CommError::Aborted { by: *by, reason: reason.clone() });
            }
            if matches!(schedule.ranks[self.rank].state, State::Granted) {
                return Ok(schedule);
            }
            schedule = group.wake[self.rank].wait(schedule).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Ends a call: waits for a core to continue computing.
    fn until_computing(&mut self, mut schedule: MutexGuard<'_, Schedule>) {
        let group = Arc::clone(&self.group);
        schedule.ranks[self.rank].state = State::Ready;
        group.dispatch(&mut schedule);
        // After an abort the clocks no longer matter.
        while schedule.aborted.is_none()
            && !matches!(schedule.ranks[self.rank].state, State::Computing)
        {
            schedule = group.wake[self.rank].wait(schedule).unwrap_or_else(PoisonError::into_inner);
        }
        drop(schedule);
        self.since_secs = cpu_secs();
    }

    fn check_rank(&self, peer: usize) -> Result<(), CommError> {
        let size = self.group.wake.len();
        if peer < size { Ok(()) } else { Err(CommError::NoSuchRank { peer, size }) }
    }
}

impl Communicator for SimComm {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.group.wake.len()
    }

    fn now(&self) -> f64 {
        let clock = self.group.lock().ranks[self.rank].clock_secs;
        match self.compute {
            Compute::Measured(scale) => clock + (cpu_secs() - self.since_secs).max(0.0) * scale,
            Compute::Given => clock,
        }
    }

    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError> {
        self.check_rank(destination)?;
        let (rank, group) = (self.rank, Arc::clone(&self.group));
        let mut schedule = group.lock();
        self.charge_compute(&mut schedule);
        schedule.ranks[rank].state = State::Acting;
        let mut schedule = self.until_granted(&group, schedule)?;
        let result = if matches!(schedule.ranks[destination].state, State::Gone) {
            Err(CommError::PeerLost { rank, peer: destination })
        } else {
            let s = &mut *schedule;
            s.ranks[rank].clock_secs += s.network.overhead_secs;
            s.ranks[rank].heartbeat_secs = s.ranks[rank].clock_secs;
            s.send(rank, destination, tag, message);
            Ok(())
        };
        self.until_computing(schedule);
        result
    }

    fn post_recv(
        &mut self,
        source: usize,
        tag: u32,
        capacity: usize,
    ) -> Result<Receive, CommError> {
        self.check_rank(source)?;
        let id = self.next_id;
        self.next_id += 1;
        self.posted.entry((source, tag)).or_default().push_back(id);
        Ok(Receive { id, source, tag, capacity })
    }

    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError> {
        let rank = self.rank;
        let first = posted.first().ok_or(CommError::NothingPosted { rank })?;
        let (peer, tag) = (first.source, first.tag);
        let wanted: Vec<PostedReceive> = posted
            .iter()
            .map(|r| {
                let queue = self.posted.get(&(r.source, r.tag));
                let index = queue.and_then(|q| q.iter().position(|id| *id == r.id));
                PostedReceive { source: r.source, tag: r.tag, index: index.unwrap_or(usize::MAX) }
            })
            .collect();
        let group = Arc::clone(&self.group);
        let mut schedule = group.lock();
        self.charge_compute(&mut schedule);
        let mut deadline_secs = schedule.ranks[rank].clock_secs + timeout.as_secs_f64();
        let (found, mut schedule) = loop {
            schedule.wait(rank, wanted.clone(), deadline_secs);
            schedule = self.until_granted(&group, schedule)?;
            // ---- The message that arrived first, of the lowest rank among equals.
            let found = wanted.iter().enumerate().filter_map(|(i, w)| {
                schedule.find(rank, w).map(|(at, arrival)| (i, at, arrival, w.source))
            });
            let found = found.min_by(|a, b| a.2.total_cmp(&b.2).then(a.3.cmp(&b.3)));
            let now_secs = schedule.ranks[rank].clock_secs;
            let found = found.filter(|f| f.2 <= deadline_secs.max(now_secs));
            // A rank that is at work may still send, or the rank that it makes wait.
            let others = schedule.ranks.iter().enumerate().filter(|(other, _)| *other != rank);
            let heartbeat_secs = others.map(|(_, other)| other.heartbeat_secs).fold(0.0, f64::max);
            let later_secs = heartbeat_secs + timeout.as_secs_f64();
            let lost = wanted.iter().any(|w| schedule.is_lost(rank, w));
            if found.is_some() || lost || timeout.is_zero() || later_secs <= deadline_secs {
                break (found, schedule);
            }
            deadline_secs = later_secs;
        };
        let now_secs = schedule.ranks[rank].clock_secs;
        let result = match found {
            Some((i, at, arrival_secs, source)) => {
                let s = &mut *schedule;
                let receive = posted.remove(i);
                if let Some(queue) = self.posted.get_mut(&(receive.source, receive.tag)) {
                    queue.retain(|id| *id != receive.id);
                }
                let overhead_secs = if source == rank { 0.0 } else { s.network.overhead_secs };
                s.ranks[rank].clock_secs = now_secs.max(arrival_secs) + overhead_secs;
                let message = s.take(rank, source, at);
                if message.len() > receive.capacity {
                    let Receive { source: peer, tag, capacity, .. } = receive;
                    Err(CommError::TooLong { rank, peer, tag, capacity })
                } else {
                    Ok(Arrival { source, tag: receive.tag, message })
                }
            }
            None => match wanted.iter().find(|w| schedule.is_lost(rank, w)) {
                Some(lost) => Err(CommError::PeerLost { rank, peer: lost.source }),
                None => {
                    schedule.ranks[rank].clock_secs = deadline_secs;
                    Err(CommError::Timeout {
                        rank,
                        peer,
                        tag,
                        waited_ms: timeout.as_millis() as u64,
                    })
                }
            },
        };
        self.until_computing(schedule);
        result
    }

    fn alive(&mut self) -> Result<(), CommError> {
        let group = Arc::clone(&self.group);
        let mut schedule = group.lock();
        self.charge_compute(&mut schedule);
        let own = &mut schedule.ranks[self.rank];
        own.heartbeat_secs = own.clock_secs;
        self.since_secs = cpu_secs();
        match &schedule.aborted {
            Some((by, reason)) => Err(CommError::Aborted { by: *by, reason: reason.clone() }),
            None => Ok(()),
        }
    }

    fn throttle_sends(&mut self, tag: u32, most: usize, patience: Duration) {
        let group = Arc::clone(&self.group);
        let mut schedule = group.lock();
        self.charge_compute(&mut schedule);
        let end_secs = schedule.ranks[self.rank].clock_secs + patience.as_secs_f64();
        loop {
            let now_secs = schedule.ranks[self.rank].clock_secs;
            // First let others do everything that happens before now.
            schedule.wait(self.rank, Vec::new(), now_secs);
            let Ok(granted) = self.until_granted(&group, schedule) else { return };
            schedule = granted;
            let (count, first_secs) = schedule.flows.leaving(self.rank, tag);
            if count <= most || now_secs >= end_secs {
                break;
            }
            // Others may slow it down meanwhile: then this is checked again.
            let until_secs = first_secs.max(now_secs).min(end_secs);
            schedule.wait(self.rank, Vec::new(), until_secs);
            let Ok(granted) = self.until_granted(&group, schedule) else { return };
            schedule = granted;
            schedule.ranks[self.rank].clock_secs = until_secs;
        }
        self.until_computing(schedule);
    }

    fn abort(&mut self, reason: &str) {
        let mut schedule = self.group.lock();
        if schedule.aborted.is_none() {
            schedule.aborted = Some((self.rank, reason.to_string()));
        }
        for condvar in &self.group.wake {
            condvar.notify_all();
        }
    }
}

impl Drop for SimComm {
    fn drop(&mut self) {
        let group = Arc::clone(&self.group);
        let mut schedule = group.lock();
        schedule.ranks[self.rank].state = State::Gone;
        for rank in 0..schedule.ranks.len() {
            schedule.reevaluate(rank);
        }
        group.dispatch(&mut schedule);
    }
}

#[cfg(test)]
mod tests;
