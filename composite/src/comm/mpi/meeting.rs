//! Ranks of one machine in the memory that they share: how it is made, and their meetings in it.

use super::signs::Patience;
use super::{CommError, Communicator, MpiComm, NAP, NOTICE_INTERVAL, SPINS, START, collective, node};
use std::time::{Duration, Instant};

impl MpiComm {
    /// For tests: has this rank wait so long behind each meeting in shared memory, as one does to whom the system gives no processor.
    pub fn linger(&mut self, behind_meetings: Duration) {
        self.linger = behind_meetings;
    }

    /// Makes what the ranks of one machine share, if they are all of one machine and all of them can.
    pub(super) fn share_memory(&mut self) -> Result<(), CommError> {
        if self.size < 2 || !self.is_one_node() {
            return Ok(());
        }
        let made = if self.rank == 0 { node::Node::make(self.size).ok() } else { None };
        let address = made.as_ref().map_or([0; 3], |made| made.1);
        let mine: &[u8] = bytemuck::cast_slice(&address);
        let said = collective::all_gather(self, mine, mine.len(), START)?;
        let address: node::Address = match said[0].as_slice().try_into() {
            Ok(bytes) => bytemuck::cast::<[u8; 12], _>(bytes),
            Err(_) => [0; 3],
        };
        let node = match made {
            Some((node, _)) => Some(node),
            None if address != [0; 3] => node::Node::join(self.rank, self.size, address).ok(),
            None => None,
        };
        let said = collective::all_gather(self, &[u8::from(node.is_some())], 1, START)?;
        self.node = node.filter(|_| said.iter().all(|one| one == &[1]));
        Ok(())
    }

    /// A barrier of ranks that share memory, or an all-gather of strings, which it gives.
    pub(super) fn meet_in_memory(
        &mut self,
        string: Option<&[u8]>,
        timeout: Duration,
    ) -> Option<Result<Vec<Vec<u8>>, CommError>> {
        let node = self.node.take()?;
        let met = self.wait_in_memory(&node, string, timeout);
        if !self.linger.is_zero() {
            std::thread::sleep(self.linger);
        }
        let said = met.and_then(|()| node.said());
        self.node = Some(node);
        Some(said)
    }

    fn wait_in_memory(
        &mut self,
        node: &node::Node,
        string: Option<&[u8]>,
        timeout: Duration,
    ) -> Result<(), CommError> {
        let rank = self.rank;
        if let Some((by, reason)) = &self.aborted {
            return Err(CommError::Aborted { by: *by, reason: reason.clone() });
        }
        node.arrive(string);
        for _ in 0..if self.oversubscribed { 1 } else { SPINS } {
            if node.passed() {
                return Ok(());
            }
            std::hint::spin_loop();
        }
        let begin = Instant::now();
        let mut patience = Patience::new(timeout, begin);
        let mut heard = begin;
        loop {
            // What was sent before may need this rank's help to arrive.
            let helps = self.transfers.outgoing() > 0;
            node.sleep(if helps { NAP } else { NOTICE_INTERVAL });
            if node.passed() {
                return Ok(());
            }
            let now = Instant::now();
            if helps {
                self.transfers.reap(&self.mpi);
            }
            if now.duration_since(heard) >= NOTICE_INTERVAL {
                heard = now;
                self.hear()?;
                let missing: Vec<usize> = node.missing().collect();
                if let Some(&peer) = missing.iter().find(|&&peer| self.left[peer]) {
                    return Err(CommError::PeerLost { rank, peer });
                }
                self.keep_patience(&mut patience, &missing, now);
            }
            if patience.is_over(now) {
                self.hear()?;
                // A sign may have come while this rank had no processor.
                let missing: Vec<usize> = node.missing().collect();
                self.keep_patience(&mut patience, &missing, now);
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
