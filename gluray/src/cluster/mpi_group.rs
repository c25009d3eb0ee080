//! Helpers that run as an MPI job. The job's first rank mediates between programs, which use only
//! sockets, and the other ranks, which may run on other machines.
//!
//! There is one socket per rank. A program therefore finds as many helpers as the job has ranks,
//! and loses one helper when one rank is lost. Requests and replies are forwarded unchanged. The
//! program itself is not a rank of the job.

use super::helper::Helper;
use super::requests::{MAX_REQUEST_BYTES, REPLY, REQUEST};
use super::socket_comm::Peer;
use composite::comm::{CommError, Communicator, Receive};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::HashMap;
use std::io::{ErrorKind, Write as _};
use std::os::unix::net::UnixListener;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// The tag of the header before every message: its kind, its program, and its length.
const HEADER: u32 = 10;
/// The tag of the message itself.
const BODY: u32 = 11;
const HEADER_BYTES: usize = 16;
/// How long somebody who waits for work rests, and somebody whose work is under way.
const IDLE_WAIT: Duration = Duration::from_millis(2);
const BUSY_WAIT: Duration = Duration::from_micros(50);
/// How long a rank keeps polling after work.
const AWAKE: Duration = Duration::from_millis(300);

/// The kind of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MessageKind {
    /// A request, or the reply to it.
    Work,
    /// The program is gone, or no longer served.
    Close,
    /// The job ends.
    End,
}

/// The header of a message of `length` bytes for or from a program.
fn header(kind: MessageKind, program: u32, length: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(HEADER_BYTES);
    out.extend((kind as u32).to_le_bytes());
    out.extend(program.to_le_bytes());
    out.extend((length as u64).to_le_bytes());
    out
}

/// The fields of a header. `None` when it is malformed.
fn read_header(bytes: &[u8]) -> Option<(MessageKind, u32, usize)> {
    let bytes: &[u8; HEADER_BYTES] = bytes.try_into().ok()?;
    let word =
        |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    let kind = [MessageKind::Work, MessageKind::Close, MessageKind::End]
        .into_iter()
        .find(|k| *k as u32 == word(0))?;
    let length = u64::from(word(8)) | u64::from(word(12)) << 32;
    Some((kind, word(4), usize::try_from(length).ok().filter(|n| *n <= MAX_REQUEST_BYTES)?))
}

// ---- The others ---------------------------------------------------------------------------------
/// Serves programs through the first rank, until that ends or `over` is set.
///
/// # Errors
/// What ended the job other than its first rank's wish.
pub(crate) fn serve_group(comm: &mut dyn Communicator, over: &AtomicBool) -> Result<(), CommError> {
    // One helper state per program.
    let mut programs: HashMap<u32, Helper> = HashMap::new();
    let mut posted = vec![comm.post_recv(0, HEADER, HEADER_BYTES)?];
    let mut coming = None;
    let mut worked = Instant::now();
    while !over.load(Relaxed) {
        let arrival = match comm.test_any(&mut posted) {
            Ok(Some(arrival)) => arrival,
            Ok(None) => {
                std::thread::sleep(if worked.elapsed() < AWAKE { BUSY_WAIT } else { IDLE_WAIT });
                continue;
            }
            Err(CommError::PeerLost { .. }) => return Ok(()),
            Err(e) => return Err(e),
        };
        worked = Instant::now();
        match (arrival.tag, coming.take()) {
            (HEADER, _) => match read_header(&arrival.message) {
                Some((MessageKind::Work, program, length)) => {
                    coming = Some(program);
                    posted.push(comm.post_recv(0, BODY, length)?);
                }
                Some((MessageKind::Close, program, _)) => {
                    programs.remove(&program);
                    posted.push(comm.post_recv(0, HEADER, HEADER_BYTES)?);
                }
                // The job ends, or the header is malformed. Nothing after it can be decoded.
                Some((MessageKind::End, ..)) | None => return Ok(()),
            },
            (_, Some(program)) => {
                let answer = programs.entry(program).or_default().answer(&arrival.message);
                comm.send(0, HEADER, header(MessageKind::Work, program, answer.len()))?;
                comm.send(0, BODY, answer)?;
                posted.push(comm.post_recv(0, HEADER, HEADER_BYTES)?);
                worked = Instant::now();
            }
            (_, None) => return Ok(()),
        }
        comm.recycle(arrival.message);
    }
    // Tells programs to continue without this rank.
    match comm.send(0, HEADER, header(MessageKind::End, 0, 0)) {
        Err(CommError::PeerLost { .. }) => Ok(()),
        other => other,
    }
}

// ---- The first ----------------------------------------------------------------------------------
/// A program's socket to one rank.
struct ProgramConnection {
    program: u32,
    rank: usize,
    peer: Peer,
    /// Data still to be written, from `written` on.
    out: Vec<u8>,
    written: usize,
}

impl ProgramConnection {
    /// Writes as much as possible without blocking. Returns true when anything was written.
    fn write(&mut self) -> bool {
        let before = self.written;
        while self.written < self.out.len() && !self.peer.lost {
            match self.peer.stream.write(&self.out[self.written..]) {
                Ok(n) => self.written += n,
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) if e.kind() == ErrorKind::WouldBlock => break,
                Err(_) => self.peer.lost = true,
            }
        }
        let moved = self.written > before;
        if self.written == self.out.len() {
            self.out.clear();
            self.written = 0;
        }
        moved
    }

    fn answer(&mut self, answer: &[u8]) {
        self.out.extend(super::socket_comm::header_of(REPLY, answer.len()));
        self.out.extend_from_slice(answer);
    }
}

/// The first rank of the job.
struct JobCoordinator<'a> {
    comm: &'a mut dyn Communicator,
    /// The socket at which programs find rank i + 1. `None` once that rank is lost.
    listeners: Vec<Option<UnixListener>>,
    connections: Vec<ProgramConnection>,
    posted: Vec<Receive>,
    /// Of each rank whose answer is coming.
    coming: Vec<Option<u32>>,
    programs: u32,
}

/// Hands programs' orders on to the other ranks, and their answers back, until `over` is set.
/// `listeners[i]` is where programs find rank i + 1.
///
/// # Errors
/// What ended the job.
pub(crate) fn coordinate_group(
    comm: &mut dyn Communicator,
    listeners: Vec<UnixListener>,
    over: &AtomicBool,
) -> Result<(), CommError> {
    let size = comm.size();
    let mut coordinator = JobCoordinator {
        comm,
        listeners: listeners.into_iter().map(Some).collect(),
        connections: Vec::new(),
        posted: Vec::new(),
        coming: vec![None; size],
        programs: 0,
    };
    for rank in 1..size {
        coordinator.expect(rank, HEADER, HEADER_BYTES)?;
    }
    let mut awake = Instant::now();
    while !over.load(Relaxed) {
        let moved = coordinator.accept_programs()
            | coordinator.forward_requests()?
            | coordinator.forward_replies()?
            | coordinator.write();
        coordinator.remove_closed()?;
        if moved {
            awake = Instant::now();
        } else {
            rest(
                &coordinator.connections,
                &coordinator.listeners,
                if awake.elapsed() < AWAKE { BUSY_WAIT } else { IDLE_WAIT },
            );
        }
    }
    for rank in 1..size {
        coordinator.tell(rank, MessageKind::End, 0, None)?;
    }
    Ok(())
}

impl JobCoordinator<'_> {
    fn expect(&mut self, rank: usize, tag: u32, capacity: usize) -> Result<(), CommError> {
        self.posted.push(self.comm.post_recv(rank, tag, capacity)?);
        Ok(())
    }

    /// Says something to a rank; nothing to one that is lost.
    fn tell(
        &mut self,
        rank: usize,
        kind: MessageKind,
        program: u32,
        body: Option<Vec<u8>>,
    ) -> Result<(), CommError> {
        if self.listeners[rank - 1].is_none() {
            return Ok(());
        }
        let announced = header(kind, program, body.as_ref().map_or(0, Vec::len));
        let told = self.comm.send(rank, HEADER, announced);
        match told.and_then(|()| body.map_or(Ok(()), |body| self.comm.send(rank, BODY, body))) {
            Err(CommError::PeerLost { .. }) => self.lose(rank),
            other => other?,
        }
        Ok(())
    }

    /// Disconnects programs from this rank and stops accepting new ones for it.
    fn lose(&mut self, rank: usize) {
        self.listeners[rank - 1] = None;
        self.posted.retain(|r| r.source != rank);
        self.connections.iter_mut().filter(|l| l.rank == rank).for_each(|l| l.peer.lost = true);
    }

    /// Programs that come; true when one did, as below.
    fn accept_programs(&mut self) -> bool {
        let before = self.programs;
        for (i, listener) in self.listeners.iter().enumerate() {
            while let Some(Ok((stream, _))) = listener.as_ref().map(UnixListener::accept) {
                if let Ok(peer) = Peer::new(stream) {
                    self.programs += 1;
                    let program = self.programs;
                    self.connections.push(ProgramConnection {
                        program,
                        rank: i + 1,
                        peer,
                        out: Vec::new(),
                        written: 0,
                    });
                }
            }
        }
        self.programs > before
    }

    fn forward_requests(&mut self) -> Result<bool, CommError> {
        let mut requests = Vec::new();
        for line in &mut self.connections {
            // A malformed message ends the connection.
            line.peer.lost |= !line.peer.read(MAX_REQUEST_BYTES);
            while let Some((tag, order)) = line.peer.mail.pop_front() {
                if tag == REQUEST {
                    requests.push((line.rank, line.program, order));
                } else {
                    line.peer.lost = true;
                }
            }
        }
        let moved = !requests.is_empty();
        for (rank, program, order) in requests {
            self.tell(rank, MessageKind::Work, program, Some(order))?;
        }
        Ok(moved)
    }

    fn forward_replies(&mut self) -> Result<bool, CommError> {
        let mut moved = false;
        while !self.posted.is_empty() {
            let arrival = match self.comm.test_any(&mut self.posted) {
                Ok(Some(arrival)) => arrival,
                Ok(None) => break,
                Err(CommError::PeerLost { peer, .. }) => {
                    self.lose(peer);
                    continue;
                }
                Err(e) => return Err(e),
            };
            moved = true;
            let rank = arrival.source;
            if arrival.tag == BODY {
                let program = self.coming[rank].take();
                // Nobody, when the program has gone meanwhile.
                if let Some(line) = self.connections.iter_mut().find(|l| Some(l.program) == program)
                {
                    line.answer(&arrival.message);
                }
                self.comm.recycle(arrival.message);
                self.expect(rank, HEADER, HEADER_BYTES)?;
            } else if let Some((MessageKind::Work, program, length)) = read_header(&arrival.message)
            {
                self.coming[rank] = Some(program);
                self.expect(rank, BODY, length)?;
            } else {
                self.lose(rank);
            }
        }
        Ok(moved)
    }

    fn write(&mut self) -> bool {
        let mut moved = false;
        for line in &mut self.connections {
            moved |= line.write();
        }
        moved
    }

    /// Removes closed connections and tells their ranks.
    fn remove_closed(&mut self) -> Result<(), CommError> {
        let gone: Vec<(usize, u32)> =
            self.connections.iter().filter(|l| l.peer.lost).map(|l| (l.rank, l.program)).collect();
        self.connections.retain(|l| !l.peer.lost);
        for (rank, program) in gone {
            self.tell(rank, MessageKind::Close, program, None)?;
        }
        Ok(())
    }
}

/// Waits for a message of a program, at most `time`. MPI and sockets cannot be waited for together.
fn rest(connections: &[ProgramConnection], listeners: &[Option<UnixListener>], time: Duration) {
    let said = connections.iter().map(|l| {
        let more = if l.out.is_empty() { PollFlags::IN } else { PollFlags::IN | PollFlags::OUT };
        PollFd::new(&l.peer.stream, more)
    });
    let come = listeners.iter().flatten().map(|l| PollFd::new(l, PollFlags::IN));
    let mut all: Vec<PollFd<'_>> = said.chain(come).collect();
    let time = Timespec::try_from(time).ok();
    // Interrupted or not: what is there is looked at again.
    let _ = poll(&mut all, time.as_ref());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_come_back_as_they_were_and_what_is_none_is_refused() {
        for (kind, program, length) in [
            (MessageKind::Work, 7, 5 << 30),
            (MessageKind::Close, 0, 0),
            (MessageKind::End, u32::MAX, 1),
        ] {
            assert_eq!(read_header(&header(kind, program, length)), Some((kind, program, length)));
        }
        let mut unknown = header(MessageKind::End, 1, 1);
        unknown[0] = 9;
        assert_eq!(read_header(&unknown), None);
        assert_eq!(read_header(&unknown[..15]), None);
        assert_eq!(read_header(&header(MessageKind::Work, 1, usize::MAX)), None);
    }
}
