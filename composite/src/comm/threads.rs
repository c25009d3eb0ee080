//! Ranks as threads of one process: every rank has a mailbox for each other rank, and messages are
//! moved, not copied.
//!
//! The whole group shares one lock. It is held while one pointer moves, never while pixels are
//! processed.
use super::{Arrival, BufferPool, CommError, Communicator, Receive};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Messages from one rank to another: tag and content, oldest first.
type Mailbox = VecDeque<(u32, Vec<u8>)>;

struct State {
    /// `mail[receiver][sender]`.
    mail: Vec<Vec<Mailbox>>,
    lost: Vec<bool>,
    aborted: Option<(usize, String)>,
    at_barrier: Vec<bool>,
    barriers_done: u64,
    /// When each rank last sent anything or called `alive`.
    heartbeats: Vec<Instant>,
    /// The ranks that each rank waits for: the sources of its receives. At a barrier these are all
    /// ranks that have not arrived.
    waits_for: Vec<Vec<usize>>,
}

impl State {
    /// The last sign of life of the ranks that `rank` waits for, and of those they wait for in
    /// turn, but not of `rank` itself.
    fn last_heartbeat(&self, rank: usize) -> Option<Instant> {
        let ranks = 0..self.heartbeats.len();
        let mut seen = vec![false; ranks.len()];
        seen[rank] = true;
        let (mut last, mut to_do) = (None, vec![rank]);
        while let Some(waiting) = to_do.pop() {
            let absent =
                ranks.clone().filter(|&other| self.at_barrier[waiting] && !self.at_barrier[other]);
            for next in self.waits_for[waiting].iter().copied().chain(absent) {
                if !std::mem::replace(&mut seen[next], true) {
                    last = last.max(Some(self.heartbeats[next]));
                    to_do.push(next);
                }
            }
        }
        last
    }
}

struct Group {
    /// When the group was made; all ranks measure time from here.
    begin: Instant,
    state: Mutex<State>,
    /// One per rank, so that a message wakes only its receiver.
    wake: Vec<Condvar>,
    /// Shared by all ranks: buffers move with their messages, and a rank that only receives would
    /// accumulate them.
    pool: Mutex<BufferPool>,
}

impl Group {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Nothing panics while the lock is held, so a poisoned state is still consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wake_all(&self) {
        for condvar in &self.wake {
            condvar.notify_all();
        }
    }
}

/// One rank of a group of threads. Dropping it leaves the group: ranks that still wait for this
/// rank get [`CommError::PeerLost`], but messages already sent still arrive.
pub struct ThreadComm {
    rank: usize,
    group: Arc<Group>,
    /// Receives not yet served, oldest first, by source and tag.
    posted: BTreeMap<(usize, u32), VecDeque<(u64, usize)>>,
    /// Messages for receives that nobody has waited for yet.
    early: Vec<(u64, Vec<u8>)>,
    next_id: u64,
}

/// A group of `size` ranks; pass each element to its own thread.
pub fn group(size: usize) -> Vec<ThreadComm> {
    let state = State {
        mail: (0..size).map(|_| vec![Mailbox::new(); size]).collect(),
        lost: vec![false; size],
        aborted: None,
        at_barrier: vec![false; size],
        barriers_done: 0,
        heartbeats: vec![Instant::now(); size],
        waits_for: vec![Vec::new(); size],
    };
    let wake = (0..size).map(|_| Condvar::new()).collect();
    let group = Arc::new(Group {
        begin: Instant::now(),
        state: Mutex::new(state),
        wake,
        pool: Mutex::default(),
    });
    (0..size)
        .map(|rank| ThreadComm {
            rank,
            group: Arc::clone(&group),
            posted: BTreeMap::new(),
            early: Vec::new(),
            next_id: 0,
        })
        .collect()
}

/// Runs `work` on `size` ranks, each on a thread of its own, and returns their results in rank
/// order.
///
/// A panic of one rank is that rank's [`CommError::Panicked`]; the others see it as
/// [`CommError::PeerLost`].
pub fn run<T: Send>(
    size: usize,
    work: impl Fn(ThreadComm) -> T + Sync,
) -> Vec<Result<T, CommError>> {
    run_group(group(size), work)
}

/// Runs `work` on every rank of a group, in rank order, each on a thread of its own.
pub(super) fn run_group<C: Communicator + Send, T: Send>(
    group: Vec<C>,
    work: impl Fn(C) -> T + Sync,
) -> Vec<Result<T, CommError>> {
    let work = &work;
    std::thread::scope(|scope| {
        let threads: Vec<_> = group
            .into_iter()
            .enumerate()
            .map(|(rank, comm)| {
                let name = format!("rank {rank}");
                (
                    rank,
                    std::thread::Builder::new().name(name).spawn_scoped(scope, move || work(comm)),
                )
            })
            .collect();
        threads
            .into_iter()
            .map(|(rank, thread)| match thread {
                Ok(thread) => thread
                    .join()
                    .map_err(|panic| CommError::Panicked { rank, message: panic_text(&*panic) }),
                Err(error) => Err(CommError::NoThread { rank, reason: error.to_string() }),
            })
            .collect()
    })
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_string())
}

impl ThreadComm {
    fn check_rank(&self, peer: usize) -> Result<(), CommError> {
        let size = self.group.wake.len();
        if peer < size { Ok(()) } else { Err(CommError::NoSuchRank { peer, size }) }
    }
}

impl Group {
    /// Waits until `ready` returns something, the group is aborted, or `timeout` has passed since
    /// the last sign of life of the `sources` (then `None`).
    fn wait<T>(
        &self,
        rank: usize,
        timeout: Duration,
        sources: impl Fn(&mut Vec<usize>),
        mut ready: impl FnMut(&mut State) -> Option<Result<T, CommError>>,
    ) -> Result<Option<T>, CommError> {
        let mut since = Instant::now();
        let mut state = self.lock();
        let mut waits = false;
        let result = loop {
            if let Some((by, reason)) = &state.aborted {
                break Err(CommError::Aborted { by: *by, reason: reason.clone() });
            }
            if let Some(result) = ready(&mut state) {
                break result.map(Some);
            }
            if timeout.is_zero() {
                break Ok(None);
            }
            if !waits {
                waits = true;
                sources(&mut state.waits_for[rank]);
            }
            if since.elapsed() >= timeout {
                since = state.last_heartbeat(rank).map_or(since, |sign| since.max(sign));
            }
            let Some(left) = timeout.checked_sub(since.elapsed()).filter(|left| !left.is_zero())
            else {
                break Ok(None);
            };
            let woken = self.wake[rank].wait_timeout(state, left);
            state = woken.unwrap_or_else(PoisonError::into_inner).0;
        };
        if waits {
            state.waits_for[rank].clear();
        }
        result
    }
}

impl Communicator for ThreadComm {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.group.wake.len()
    }

    fn now(&self) -> f64 {
        self.group.begin.elapsed().as_secs_f64()
    }

    fn is_one_node(&self) -> bool {
        true
    }

    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError> {
        self.check_rank(destination)?;
        let mut state = self.group.lock();
        if let Some((by, reason)) = &state.aborted {
            return Err(CommError::Aborted { by: *by, reason: reason.clone() });
        }
        if state.lost[destination] {
            return Err(CommError::PeerLost { rank: self.rank, peer: destination });
        }
        state.mail[destination][self.rank].push_back((tag, message));
        state.heartbeats[self.rank] = Instant::now();
        self.group.wake[destination].notify_all();
        Ok(())
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
        self.posted.entry((source, tag)).or_default().push_back((id, capacity));
        Ok(Receive { id, source, tag, capacity })
    }

    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError> {
        let rank = self.rank;
        let first = posted.first().ok_or(CommError::NothingPosted { rank })?;
        let silent = CommError::Timeout {
            rank,
            peer: first.source,
            tag: first.tag,
            waited_ms: timeout.as_millis() as u64,
        };
        // Every message goes to the oldest receive of its source and tag, whether that one is
        // waited for now or later.
        let (queues, early) = (&mut self.posted, &mut self.early);
        let sources = |to: &mut Vec<usize>| to.extend(posted.iter().map(|receive| receive.source));
        let came = self.group.wait(rank, timeout, sources, |state| {
            for (position, receive) in posted.iter().enumerate() {
                if let Some(at) = early.iter().position(|(id, _)| *id == receive.id) {
                    return Some(Ok((position, early.swap_remove(at).1)));
                }
                let queue = queues.get_mut(&(receive.source, receive.tag))?;
                let mail = &mut state.mail[rank][receive.source];
                while let Some(at) = mail.iter().position(|(tag, _)| *tag == receive.tag) {
                    let Some((id, capacity)) = queue.pop_front() else { break };
                    let message = mail.remove(at).map(|(_, message)| message).unwrap_or_default();
                    if message.len() > capacity {
                        let (peer, tag) = (receive.source, receive.tag);
                        return Some(Err(CommError::TooLong { rank, peer, tag, capacity }));
                    }
                    if id == receive.id {
                        return Some(Ok((position, message)));
                    }
                    early.push((id, message));
                }
            }
            let lost = posted.iter().find(|receive| state.lost[receive.source])?;
            Some(Err(CommError::PeerLost { rank, peer: lost.source }))
        })?;
        let (position, message) = came.ok_or(silent)?;
        let Receive { source, tag, .. } = posted.remove(position);
        Ok(Arrival { source, tag, message })
    }

    fn barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        let rank = self.rank;
        let before = {
            let mut state = self.group.lock();
            state.at_barrier[rank] = true;
            state.heartbeats[rank] = Instant::now();
            let before = state.barriers_done;
            if state.at_barrier.iter().all(|&here| here) {
                state.at_barrier.fill(false);
                state.barriers_done += 1;
                self.group.wake_all();
            }
            before
        };
        let passed = self.group.wait(
            rank,
            timeout,
            |_| {},
            |state| {
                if state.barriers_done > before {
                    return Some(Ok(()));
                }
                let peer = (0..state.lost.len())
                    .find(|&peer| state.lost[peer] && !state.at_barrier[peer])?;
                Some(Err(CommError::PeerLost { rank, peer }))
            },
        )?;
        if passed.is_some() {
            return Ok(());
        }
        let mut state = self.group.lock();
        if state.barriers_done > before {
            // The last rank arrived between the end of the wait and the lock.
            return Ok(());
        }
        let missing = state.at_barrier.iter().position(|&here| !here).unwrap_or(rank);
        // This rank no longer waits: otherwise a rank that arrives later would pass a barrier that
        // has failed here.
        state.at_barrier[rank] = false;
        Err(CommError::BarrierTimeout { rank, missing, waited_ms: timeout.as_millis() as u64 })
    }

    fn alive(&mut self) -> Result<(), CommError> {
        let mut state = self.group.lock();
        state.heartbeats[self.rank] = Instant::now();
        match &state.aborted {
            Some((by, reason)) => Err(CommError::Aborted { by: *by, reason: reason.clone() }),
            None => Ok(()),
        }
    }

    fn abort(&mut self, reason: &str) {
        let mut state = self.group.lock();
        if state.aborted.is_none() {
            state.aborted = Some((self.rank, reason.to_string()));
        }
        self.group.wake_all();
    }

    fn buffer(&mut self, capacity: usize) -> Vec<u8> {
        self.group.pool.lock().unwrap_or_else(PoisonError::into_inner).take(capacity)
    }

    fn recycle(&mut self, buffer: Vec<u8>) {
        self.group.pool.lock().unwrap_or_else(PoisonError::into_inner).put(buffer);
    }
}

impl Drop for ThreadComm {
    fn drop(&mut self) {
        self.group.lock().lost[self.rank] = true;
        self.group.wake_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONG: Duration = Duration::from_secs(20);
    const SHORT: Duration = Duration::from_millis(30);

    fn results<T: Send>(size: usize, work: impl Fn(ThreadComm) -> T + Sync) -> Vec<T> {
        run(size, work).into_iter().map(|result| result.unwrap()).collect()
    }

    #[test]
    fn a_slow_rank_that_gives_signs_of_life_is_waited_for_far_beyond_the_timeout() {
        const PATIENCE: Duration = Duration::from_secs(2);
        let begin = Instant::now();
        let ends = results(4, |mut comm| {
            match comm.rank() {
                // At work for three timeouts.
                3 => {
                    while begin.elapsed() < 3 * PATIENCE {
                        std::thread::sleep(PATIENCE / 20);
                        comm.alive().unwrap();
                    }
                    comm.send(2, 1, vec![3]).unwrap();
                }
                // Each waits for the next, which waits itself.
                rank => {
                    let came = comm.recv(rank + 1, 1, 8, PATIENCE).unwrap();
                    if let Some(before) = rank.checked_sub(1) {
                        comm.send(before, 1, came).unwrap();
                    }
                }
            }
            comm.barrier(PATIENCE).unwrap();
            begin.elapsed()
        });
        assert!(ends.iter().all(|end| *end >= 3 * PATIENCE));
    }

    #[test]
    fn a_rank_that_falls_silent_is_missed_though_others_are_at_work() {
        const PATIENCE: Duration = Duration::from_millis(200);
        let begin = Instant::now();
        let errors = results(3, |mut comm| match comm.rank() {
            // Nobody waits for this one.
            2 => loop {
                std::thread::sleep(PATIENCE / 20);
                if let Err(error) = comm.alive() {
                    break error;
                }
            },
            // Each waits for the other.
            rank => {
                let error = comm.recv(1 - rank, 1, 8, PATIENCE).unwrap_err();
                comm.abort(&error.to_string());
                error
            }
        });
        assert!(begin.elapsed() < LONG);
        assert!(errors.iter().any(|e| matches!(e, CommError::Timeout { .. })), "{errors:?}");
        assert!(matches!(errors[2], CommError::Aborted { .. }), "who works hears of the end");
    }

    #[test]
    fn messages_keep_their_order_within_a_tag_and_tags_do_not_mix() {
        let received = results(2, |mut comm| {
            if comm.rank() == 0 {
                for (tag, byte) in [(7, 1), (8, 2), (7, 3)] {
                    comm.send(1, tag, vec![byte]).unwrap();
                }
                return Vec::new();
            }
            [8, 7, 7].map(|tag| comm.recv(0, tag, 8, LONG).unwrap()[0]).to_vec()
        });
        assert_eq!(received[1], [2, 1, 3]);
    }

    #[test]
    fn receives_posted_in_advance_complete_in_the_order_of_arrival() {
        let order = results(3, |mut comm| {
            if comm.rank() == 0 {
                let mut posted =
                    vec![comm.post_recv(1, 5, 8).unwrap(), comm.post_recv(2, 5, 8).unwrap()];
                assert_eq!(comm.test_any(&mut posted).unwrap(), None);
                assert_eq!(posted.len(), 2, "looking takes nothing out of the list");
                comm.barrier(LONG).unwrap();
                let first = comm.wait_any(&mut posted, LONG).unwrap();
                comm.send(1, 6, vec![]).unwrap();
                let second = comm.wait_any(&mut posted, LONG).unwrap();
                assert_eq!(
                    comm.wait_any(&mut posted, LONG),
                    Err(CommError::NothingPosted { rank: 0 })
                );
                return vec![first.source, second.source];
            }
            comm.barrier(LONG).unwrap();
            if comm.rank() == 1 {
                // Sends only after the message of rank 2 has been taken.
                comm.recv(0, 6, 8, LONG).unwrap();
            }
            comm.send(0, 5, vec![1]).unwrap();
            vec![]
        });
        assert_eq!(order[0], [2, 1]);
    }

    #[test]
    fn receives_of_one_source_are_served_as_posted_even_when_the_later_one_is_waited_for_first() {
        let mut comms = group(2);
        let (early, late) =
            (comms[1].post_recv(0, 3, 8).unwrap(), comms[1].post_recv(0, 3, 8).unwrap());
        comms[0].send(1, 3, vec![1]).unwrap();
        comms[0].send(1, 3, vec![2]).unwrap();
        assert_eq!(comms[1].wait_any(&mut vec![late], LONG).unwrap().message, [2]);
        assert_eq!(comms[1].wait_any(&mut vec![early], LONG).unwrap().message, [1]);
    }

    #[test]
    fn a_message_longer_than_posted_for_is_an_error_as_it_is_over_mpi() {
        let mut comms = group(2);
        comms[0].send(1, 3, vec![0; 9]).unwrap();
        let error = comms[1].recv(0, 3, 8, LONG).unwrap_err();
        assert_eq!(error, CommError::TooLong { rank: 1, peer: 0, tag: 3, capacity: 8 });
    }

    #[test]
    fn a_rank_may_send_to_itself_and_to_no_rank_outside() {
        let mut comm = group(1).remove(0);
        comm.send(0, 1, vec![5]).unwrap();
        assert_eq!(comm.recv(0, 1, 8, LONG).unwrap(), [5]);
        assert_eq!(comm.send(1, 1, vec![]), Err(CommError::NoSuchRank { peer: 1, size: 1 }));
        assert_eq!(comm.recv(9, 1, 8, LONG), Err(CommError::NoSuchRank { peer: 9, size: 1 }));
    }

    #[test]
    fn silence_is_a_timeout_that_names_both_ranks() {
        let mut comms = group(2);
        let error = comms[1].recv(0, 4, 8, SHORT).unwrap_err();
        assert_eq!(error, CommError::Timeout { rank: 1, peer: 0, tag: 4, waited_ms: 30 });
    }

    #[test]
    fn a_panicking_rank_is_lost_to_those_who_wait_for_it() {
        let outcome = run(3, |mut comm| {
            assert!(comm.rank() != 1, "on purpose");
            comm.recv(1, 0, 8, LONG)
        });
        assert_eq!(outcome[0], Ok(Err(CommError::PeerLost { rank: 0, peer: 1 })));
        assert_eq!(outcome[1], Err(CommError::Panicked { rank: 1, message: "on purpose".into() }));
        assert_eq!(outcome[2], Ok(Err(CommError::PeerLost { rank: 2, peer: 1 })));
    }

    #[test]
    fn what_a_rank_sent_before_it_left_still_arrives() {
        let mut comms = group(2);
        let mut first = comms.remove(0);
        first.send(1, 0, vec![1]).unwrap();
        drop(first);
        assert_eq!(comms[0].recv(0, 0, 8, LONG), Ok(vec![1]));
        assert_eq!(comms[0].recv(0, 0, 8, LONG), Err(CommError::PeerLost { rank: 1, peer: 0 }));
        assert_eq!(comms[0].send(0, 0, vec![]), Err(CommError::PeerLost { rank: 1, peer: 0 }));
    }

    #[test]
    fn an_abort_reaches_waiting_ranks_at_once_and_the_first_reason_stays() {
        let begin = Instant::now();
        let outcome = results(4, |mut comm| {
            if comm.rank() == 2 {
                std::thread::sleep(SHORT);
                comm.abort("out of memory");
                comm.abort("something later");
                return comm.barrier(LONG).unwrap_err();
            }
            comm.recv(2, 0, 8, LONG).unwrap_err()
        });
        for error in outcome {
            assert_eq!(error, CommError::Aborted { by: 2, reason: "out of memory".into() });
        }
        assert!(begin.elapsed() < LONG);
    }

    #[test]
    fn nobody_passes_a_barrier_before_all_have_come() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let arrived = AtomicUsize::new(0);
        let seen = results(5, |mut comm| {
            (1..=20)
                .map(|round| {
                    arrived.fetch_add(1, Ordering::SeqCst);
                    comm.barrier(LONG).unwrap();
                    arrived.load(Ordering::SeqCst) >= 5 * round
                })
                .collect::<Vec<_>>()
        });
        assert!(seen.iter().flatten().all(|&complete| complete));
    }

    #[test]
    fn a_barrier_without_one_rank_names_it() {
        let mut comms = group(3);
        let error = comms[0].barrier(SHORT).unwrap_err();
        assert_eq!(error, CommError::BarrierTimeout { rank: 0, missing: 1, waited_ms: 30 });
        let gone = comms.remove(2);
        drop(gone);
        assert_eq!(comms[1].barrier(LONG), Err(CommError::PeerLost { rank: 1, peer: 2 }));
    }
}
