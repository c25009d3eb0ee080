//! Barriers and all-gathers of the ranks of one machine in their shared memory, and its set-up.

use super::heartbeat::HeartbeatTimeout;
use super::{
    CommError, MpiComm, NOTICE_INTERVAL, POLL_SLEEP, SPINS, STARTUP_TIMEOUT, collective,
    shared_memory,
};
use std::time::{Duration, Instant};

impl MpiComm {
    /// For tests: makes this rank wait this long after each collective call in shared memory, like
    /// a rank that the system gives no processor.
    pub fn delay_after_collectives(&mut self, behind_meetings: Duration) {
        self.delay_after_collectives = behind_meetings;
    }

    /// Sets up the shared memory of each machine, if one has several ranks and all ranks can map
    /// that of theirs.
    pub(super) fn share_memory(&mut self) -> Result<(), CommError> {
        let machines = self.nodes.iter().max().map_or(0, |last| last + 1);
        // Messages of simulated ranks take simulated time on one machine too.
        if machines == self.size || self.mpi.abi == super::Abi::Smpi {
            return Ok(());
        }
        let here = self.nodes[self.rank];
        let ranks = (0..self.size).filter(|&rank| self.nodes[rank] == here).collect::<Vec<_>>();
        let first = ranks[0];
        let made = match first == self.rank {
            true => shared_memory::SharedMemory::make(ranks.clone()).ok(),
            false => None,
        };
        let address = made.as_ref().map_or([0; 3], |made| made.1);
        let mine: &[u8] = bytemuck::cast_slice(&address);
        let gathered = collective::all_gather(self, mine, mine.len(), STARTUP_TIMEOUT)?;
        let address: shared_memory::Address = match gathered[first].as_slice().try_into() {
            Ok(bytes) => bytemuck::cast::<[u8; 12], _>(bytes),
            Err(_) => [0; 3],
        };
        let shared = match made {
            Some((shared, _)) => Some(shared),
            None if address != [0; 3] => {
                shared_memory::SharedMemory::map(self.rank, ranks, address).ok()
            }
            None => None,
        };
        let gathered =
            collective::all_gather(self, &[u8::from(shared.is_some())], 1, STARTUP_TIMEOUT)?;
        self.shared = shared.filter(|_| gathered.iter().all(|one| one == &[1]));
        Ok(())
    }

    /// A barrier of the ranks of this machine, or an all-gather of their strings, which it returns.
    /// `None` without shared memory.
    pub(super) fn collective_in_memory(
        &mut self,
        string: Option<&[u8]>,
        timeout: Duration,
    ) -> Option<Result<Vec<Vec<u8>>, CommError>> {
        let shared = self.shared.take()?;
        let met = self.wait_in_memory(&shared, string, timeout);
        if !self.delay_after_collectives.is_zero() {
            std::thread::sleep(self.delay_after_collectives);
        }
        let gathered = met.and_then(|()| shared.gathered());
        self.shared = Some(shared);
        Some(gathered)
    }

    fn wait_in_memory(
        &mut self,
        shared: &shared_memory::SharedMemory,
        string: Option<&[u8]>,
        timeout: Duration,
    ) -> Result<(), CommError> {
        let rank = self.rank;
        if let Some((by, reason)) = &self.aborted {
            return Err(CommError::Aborted { by: *by, reason: reason.clone() });
        }
        shared.arrive(string);
        for _ in 0..if self.oversubscribed { 1 } else { SPINS } {
            if shared.passed() {
                return Ok(());
            }
            std::hint::spin_loop();
        }
        let begin = Instant::now();
        let mut patience = HeartbeatTimeout::new(timeout, begin);
        let mut received = begin;
        loop {
            // Messages sent before may need this rank's help to arrive.
            let helps = self.transfers.outgoing() > 0;
            shared.sleep(if helps { POLL_SLEEP } else { NOTICE_INTERVAL });
            if shared.passed() {
                return Ok(());
            }
            let now = Instant::now();
            if helps {
                self.transfers.reclaim_buffers(&self.mpi);
            }
            if now.duration_since(received) >= NOTICE_INTERVAL {
                received = now;
                self.process_notices()?;
                let missing: Vec<usize> = shared.missing().collect();
                if let Some(&peer) = missing.iter().find(|&&peer| self.left[peer]) {
                    return Err(CommError::PeerLost { rank, peer });
                }
                self.update_timeout(&mut patience, &missing, now);
            }
            if patience.is_over(now) {
                self.process_notices()?;
                // A sign of life may have arrived while this rank had no processor.
                let missing: Vec<usize> = shared.missing().collect();
                self.update_timeout(&mut patience, &missing, now);
                if !patience.is_over(now) {
                    continue;
                }
                let missing = missing.first().copied().unwrap_or(rank);
                return Err(CommError::BarrierTimeout {
                    rank,
                    missing,
                    waited_ms: timeout.as_millis() as u64,
                });
            }
        }
    }
}
