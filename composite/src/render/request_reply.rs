//! Requests to other ranks and their replies, all at once: the pattern of every exchange of a
//! frame.
use super::wire_format::{decode_message, encode_message, message_bytes};
use super::{Activity, FrameError, RankReport};
use crate::comm::{Communicator, Receive};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// How often a rank that works on other threads checks their progress.
const LOOK: Duration = Duration::from_millis(20);

/// Most words that a rank may give to all ranks: 16 MiB.
const MOST_GATHERED: usize = 1 << 22;
/// Words of one message of a long request: 4 MiB. A rank that announces more than it sends makes
/// the others ask for no more memory than this at a time.
const PIECE: usize = 1 << 20;
/// Longest description of a problem, bytes.
const LONGEST_PROBLEM: usize = 2000;

/// Calls a function when it is dropped.
struct CallOnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for CallOnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Which messages belong together.
#[derive(Clone, Copy)]
pub(super) enum Tag {
    Hits = 100,
    Winners = 101,
    Request = 102,
    Reply = 103,
    Tiles = 104,
}

/// Receives for messages that arrive while this rank works on something else.
#[derive(Default)]
pub(super) struct Inbox {
    posted: Vec<Receive>,
}

/// A received message: its sender, its tag, and its words.
pub(super) struct Incoming {
    pub(super) from: usize,
    pub(super) tag: u32,
    pub(super) words: Vec<u32>,
}

/// One rank's messages of one frame, with their costs counted.
pub(super) struct RankChannel<'a> {
    comm: &'a mut dyn Communicator,
    timeout: Duration,
    pub(super) report: RankReport,
}

impl<'a> RankChannel<'a> {
    pub(super) fn new(comm: &'a mut dyn Communicator, timeout: Duration) -> RankChannel<'a> {
        let report = RankReport { begin_at_secs: comm.now(), ..RankReport::default() };
        RankChannel { comm, timeout, report }
    }

    pub(super) fn rank(&self) -> usize {
        self.comm.rank()
    }

    pub(super) fn size(&self) -> usize {
        self.comm.size()
    }

    /// Signals that this rank is at work. If others have given up, the next message reports it.
    pub(super) fn alive(&mut self) {
        let _ = self.comm.alive();
    }

    /// Does `work` on other threads and meanwhile signals that this rank is at work, as long as the
    /// number of steps grows.
    pub(super) fn in_background<T: Send>(
        &mut self,
        work: impl FnOnce(&AtomicUsize) -> T + Send,
    ) -> T {
        let steps = AtomicUsize::new(0);
        // A thread of the pool does the work itself: if it waited, there might be no other thread.
        if rayon::current_thread_index().is_some() {
            let out = work(&steps);
            self.alive();
            return out;
        }
        let (waiting, done) = (std::thread::current(), AtomicBool::new(false));
        let mut out = None;
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| {
                // End the scope when its work returns or panics.
                let _end = CallOnDrop(|| {
                    done.store(true, Ordering::Release);
                    waiting.unpark();
                });
                out = Some(work(&steps));
            });
            let mut seen = 0;
            while !done.load(Ordering::Acquire) {
                std::thread::park_timeout(LOOK);
                let now = steps.load(Ordering::Relaxed);
                if now != seen {
                    seen = now;
                    self.alive();
                }
            }
        });
        match out {
            Some(out) => out,
            // A panic in the scope is propagated to this thread.
            None => unreachable!("work that did not panic has ended"),
        }
    }

    /// Records the time since the last span.
    pub(super) fn record_span(&mut self, activity: Activity) {
        self.report.record_span(activity, self.comm.now());
    }

    pub(super) fn message_error(
        &self,
        from: usize,
        what: &'static str,
        words: usize,
    ) -> FrameError {
        FrameError::Message { rank: self.rank(), from, what, words }
    }

    pub(super) fn announced_error(&self, from: usize, reason: String) -> FrameError {
        FrameError::Announced { rank: self.rank(), from, reason }
    }

    pub(super) fn send(&mut self, to: usize, tag: Tag, words: &[u32]) -> Result<(), FrameError> {
        let buffer = self.comm.buffer(message_bytes(words.len()));
        let message = encode_message(words, buffer);
        self.report.messages_sent += 1;
        self.report.bytes_sent += message.len() as u64;
        self.comm.send(to, tag as u32, message)?;
        Ok(())
    }

    /// Receives one message from each of `sources` (rank and most words), in any order, and passes
    /// them to `take`.
    pub(super) fn receive(
        &mut self,
        tag: Tag,
        what: &'static str,
        sources: impl IntoIterator<Item = (usize, usize)>,
        mut take: impl FnMut(&mut Self, usize, Vec<u32>) -> Result<(), FrameError>,
    ) -> Result<(), FrameError> {
        let mut posted = Vec::new();
        for (source, words) in sources {
            posted.push(self.comm.post_recv(source, tag as u32, message_bytes(words))?);
        }
        while !posted.is_empty() {
            let arrival = self.comm.wait_any(&mut posted, self.timeout)?;
            self.report.bytes_received += arrival.message.len() as u64;
            self.record_span(Activity::Exchange);
            let words = decode_message(&arrival.message);
            let words = words.ok_or_else(|| {
                self.message_error(arrival.source, what, arrival.message.len() / 4)
            })?;
            self.comm.recycle(arrival.message);
            take(self, arrival.source, words)?;
        }
        Ok(())
    }

    /// Sends a request of any length, in pieces.
    pub(super) fn send_request(&mut self, to: usize, words: &[u32]) -> Result<(), FrameError> {
        words.chunks(PIECE).try_for_each(|piece| self.send(to, Tag::Request, piece))
    }

    /// Receives one request from each of `sources` (rank and announced words), in any order, and
    /// passes them to `take`. Memory for a long one is taken as its pieces arrive.
    pub(super) fn receive_requests(
        &mut self,
        what: &'static str,
        sources: impl IntoIterator<Item = (usize, usize)>,
        mut take: impl FnMut(&mut Self, usize, Vec<u32>) -> Result<(), FrameError>,
    ) -> Result<(), FrameError> {
        const TAG: u32 = Tag::Request as u32;
        let mut posted = Vec::new();
        let mut arriving: BTreeMap<usize, (usize, Vec<u32>)> = BTreeMap::new();
        for (source, words) in sources {
            posted.push(self.comm.post_recv(source, TAG, message_bytes(words.min(PIECE)))?);
            arriving.insert(source, (words, Vec::new()));
        }
        while !posted.is_empty() {
            let arrival = self.comm.wait_any(&mut posted, self.timeout)?;
            self.report.bytes_received += arrival.message.len() as u64;
            self.record_span(Activity::Exchange);
            let (from, bytes) = (arrival.source, arrival.message.len());
            let piece = decode_message(&arrival.message);
            self.comm.recycle(arrival.message);
            let known = piece.zip(arriving.remove(&from));
            let (piece, (announced, mut words)) =
                known.ok_or_else(|| self.message_error(from, what, bytes / 4))?;
            let is_whole = piece.len() == (announced - words.len()).min(PIECE);
            words.extend(piece);
            if !is_whole {
                let reason = format!(
                    "{what}: a question of {announced} words was announced, and one of {} came",
                    words.len()
                );
                return Err(self.announced_error(from, reason));
            }
            let left = announced - words.len();
            if left == 0 {
                take(self, from, words)?;
                continue;
            }
            posted.push(self.comm.post_recv(from, TAG, message_bytes(left.min(PIECE)))?);
            arriving.insert(from, (announced, words));
        }
        Ok(())
    }

    /// Posts a receive for a message of at most `words` words. Those of one rank and tag arrive in
    /// the order in which they were posted.
    pub(super) fn expect(
        &mut self,
        inbox: &mut Inbox,
        from: usize,
        tag: Tag,
        words: usize,
    ) -> Result<(), FrameError> {
        inbox.posted.push(self.comm.post_recv(from, tag as u32, message_bytes(words))?);
        Ok(())
    }

    /// The next message; with `wait`, waits for it, otherwise returns it only if it has arrived.
    pub(super) fn next(
        &mut self,
        inbox: &mut Inbox,
        wait: bool,
    ) -> Result<Option<Incoming>, FrameError> {
        if inbox.posted.is_empty() {
            return Ok(None);
        }
        let arrival = if wait {
            Some(self.comm.wait_any(&mut inbox.posted, self.timeout)?)
        } else {
            self.comm.test_any(&mut inbox.posted)?
        };
        self.record_span(Activity::Exchange);
        let Some(arrival) = arrival else { return Ok(None) };
        self.report.bytes_received += arrival.message.len() as u64;
        let words = decode_message(&arrival.message);
        let words = words.ok_or_else(|| {
            self.message_error(arrival.source, "hits or tiles", arrival.message.len() / 4)
        })?;
        self.comm.recycle(arrival.message);
        Ok(Some(Incoming { from: arrival.source, tag: arrival.tag, words }))
    }

    /// Gathers the numbers of every rank at every rank.
    pub(super) fn all_gather(&mut self, mine: &[u32]) -> Result<Vec<Vec<u32>>, FrameError> {
        let message = encode_message(mine, Vec::new());
        self.report.bytes_sent += (message.len() * self.size().saturating_sub(1)) as u64;
        let all = self.comm.all_gather(&message, message.len(), self.timeout)?;
        let mut out = Vec::with_capacity(all.len());
        for (from, message) in all.iter().enumerate() {
            let words = decode_message(message).filter(|w| w.len() == mine.len());
            out.push(
                words.ok_or_else(|| {
                    self.message_error(from, "numbers for all", message.len() / 4)
                })?,
            );
        }
        Ok(out)
    }

    /// Gathers numbers of which ranks may have different counts.
    ///
    /// # Errors
    /// [`FrameError::Announced`] for a count above [`MOST_GATHERED`].
    pub(super) fn all_gather_varying(&mut self, mine: &[u32]) -> Result<Vec<Vec<u32>>, FrameError> {
        let counts = self.all_gather(&[u32::try_from(mine.len()).unwrap_or(u32::MAX)])?;
        let longest = counts.iter().map(|count| count[0] as usize).max().unwrap_or(0);
        if let Some(from) = counts.iter().position(|count| count[0] as usize > MOST_GATHERED) {
            let reason =
                format!("{} numbers for all ranks; {MOST_GATHERED} are the most", counts[from][0]);
            return Err(self.announced_error(from, reason));
        }
        let message = encode_message(mine, Vec::new());
        self.report.bytes_sent += (message.len() * self.size().saturating_sub(1)) as u64;
        let all = self.comm.all_gather(&message, message_bytes(longest), self.timeout)?;
        let mut out = Vec::with_capacity(all.len());
        for (from, (message, count)) in all.iter().zip(&counts).enumerate() {
            let words = decode_message(message).filter(|w| w.len() == count[0] as usize);
            out.push(
                words.ok_or_else(|| {
                    self.message_error(from, "numbers for all", message.len() / 4)
                })?,
            );
        }
        Ok(out)
    }

    /// Returns the first rank's problem on all ranks.
    ///
    /// # Errors
    /// [`FrameError::RankScene`], or those of the transport.
    pub(super) fn agree_on_success(&mut self, own: Result<(), String>) -> Result<(), FrameError> {
        let own = own.err().unwrap_or_default();
        if self.size() == 1 {
            let rank = 0;
            return if own.is_empty() {
                Ok(())
            } else {
                Err(FrameError::RankScene { rank, reason: own })
            };
        }
        let bytes: Vec<u32> = own.bytes().take(LONGEST_PROBLEM).map(u32::from).collect();
        let all = self.all_gather_varying(&bytes)?;
        let Some(rank) = all.iter().position(|problem| !problem.is_empty()) else {
            return Ok(());
        };
        let bytes: Vec<u8> = all[rank].iter().map(|b| *b as u8).collect();
        let reason = String::from_utf8_lossy(&bytes).into_owned();
        Err(FrameError::RankScene { rank, reason })
    }

    /// Sends `requests[r]` to each rank r (nothing where it is empty) and answers the requests of
    /// others. `answer` computes the reply to a request, `longest` bounds its number of words, and
    /// `take` gets the replies in any order. Returns false when no rank had a request.
    pub(super) fn request_reply(
        &mut self,
        what: &'static str,
        requests: &[Vec<u32>],
        longest: impl Fn(&[u32]) -> usize,
        mut answer: impl FnMut(&mut RankReport, &[u32]) -> Option<Vec<u32>>,
        mut take: impl FnMut(usize, Vec<u32>) -> Result<(), FrameError>,
    ) -> Result<bool, FrameError> {
        let (rank, size) = (self.rank(), self.size());
        // ---- Lengths of all requests.
        let lengths: Vec<u32> = requests.iter().map(|q| q.len() as u32).collect();
        let lengths = if size > 1 { self.all_gather(&lengths)? } else { vec![lengths] };
        self.record_span(Activity::Exchange);
        if lengths.iter().flatten().all(|&l| l == 0) {
            return Ok(false);
        }
        self.report.rounds += 1;
        // ---- Requests, to the next rank first, so that no rank gets all at once.
        for step in 1..size {
            let to = (rank + step) % size;
            if !requests[to].is_empty() {
                self.send_request(to, &requests[to])?;
            }
        }
        self.record_span(Activity::Exchange);
        // ---- The own request first, while those of others are in flight.
        if !requests[rank].is_empty() {
            let own = answer(&mut self.report, &requests[rank]);
            self.record_span(Activity::Answer);
            let own = own.ok_or_else(|| self.message_error(rank, what, requests[rank].len()))?;
            take(rank, own)?;
            self.record_span(Activity::Shade);
        }
        let asked_by = (0..size).filter(|&from| from != rank && lengths[from][rank] > 0);
        let sources: Vec<(usize, usize)> =
            asked_by.map(|from| (from, lengths[from][rank] as usize)).collect();
        self.receive_requests(what, sources, |channel, from, request| {
            let reply = answer(&mut channel.report, &request);
            channel.record_span(Activity::Answer);
            let reply = reply.ok_or_else(|| channel.message_error(from, what, request.len()))?;
            channel.send(from, Tag::Reply, &reply)?;
            channel.record_span(Activity::Exchange);
            Ok(())
        })?;
        let asked = (0..size).filter(|&to| to != rank && !requests[to].is_empty());
        let sources: Vec<(usize, usize)> = asked.map(|to| (to, longest(&requests[to]))).collect();
        self.receive(Tag::Reply, what, sources, |channel, from, reply| {
            take(from, reply)?;
            channel.record_span(Activity::Shade);
            Ok(())
        })?;
        Ok(true)
    }

    /// Aborts the group.
    pub(super) fn abort(&mut self, reason: &str) {
        self.comm.abort(reason);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::threads;

    #[test]
    fn requests_of_any_length_arrive_whole_and_in_order() {
        let lengths = [1, PIECE - 1, PIECE, PIECE + 1, 2 * PIECE + 5];
        let results = threads::run(2, |mut comm| {
            let mut channel = RankChannel::new(&mut comm, Duration::from_secs(20));
            for length in lengths {
                let mut requests = vec![Vec::new(); 2];
                requests[1 - channel.rank()] = (0..length as u32).collect();
                let mut came = false;
                let sum = |words: &[u32]| words.iter().fold(0_u32, |s, w| s.rotate_left(1) ^ w);
                let answer = |_: &mut RankReport, words: &[u32]| Some(vec![sum(words)]);
                let expected = sum(&requests[1 - channel.rank()]);
                let any = channel.request_reply(
                    "sums",
                    &requests,
                    |_| 1,
                    answer,
                    |_, reply| {
                        came = reply == [expected];
                        Ok(())
                    },
                );
                assert!(any.expect("no error") && came, "{length}");
            }
        });
        results.into_iter().for_each(|result| result.expect("no rank panics"));
    }
}
