//! Connects ranks on one machine: the communicator of `composite` over Unix sockets, between a
//! first rank and its helpers. Helpers do not talk to each other.

use composite::comm::{Arrival, CommError, Communicator, Receive};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

/// The size in bytes of the header before each message: its tag and its length.
const HEADER: usize = 16;
/// The time after which a peer that accepts no data counts as stalled.
const STALLED: Duration = Duration::from_secs(20);
/// The number of bytes reserved at once, about the capacity of a socket. A peer that announces a
/// longer message has to send it first.
const ROOM: usize = 1 << 18;

/// The header of a message of `length` bytes.
pub(super) fn header_of(tag: u32, length: usize) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[..4].copy_from_slice(&tag.to_ne_bytes());
    header[8..].copy_from_slice(&(length as u64).to_ne_bytes());
    header
}

/// The other end of a socket.
pub(super) struct Peer {
    pub(super) stream: UnixStream,
    /// The received part of the next message.
    part: Vec<u8>,
    /// Complete messages, with their tags.
    pub(super) mail: VecDeque<(u32, Vec<u8>)>,
    pub(super) lost: bool,
}

impl Peer {
    pub(super) fn new(stream: UnixStream) -> std::io::Result<Peer> {
        stream.set_nonblocking(true)?;
        Ok(Peer { stream, part: Vec::new(), mail: VecDeque::new(), lost: false })
    }

    /// The length of the incoming message, once its header has arrived.
    fn announced(&self) -> Option<u64> {
        let length = self.part.get(8..HEADER)?;
        Some(u64::from_ne_bytes(length.try_into().expect("eight bytes")))
    }

    /// Reads the available data, in messages of up to `capacity` bytes. Returns false for a longer
    /// message.
    pub(super) fn read(&mut self, capacity: usize) -> bool {
        while !self.lost {
            let want = match self.announced() {
                None => HEADER - self.part.len(),
                Some(n) if n > capacity as u64 => return false,
                Some(n) => HEADER + n as usize - self.part.len(),
            };
            if want == 0 {
                let tag = u32::from_ne_bytes(self.part[..4].try_into().expect("four bytes"));
                let mut message = std::mem::take(&mut self.part);
                message.drain(..HEADER);
                self.mail.push_back((tag, message));
                return true;
            }
            let at = self.part.len();
            self.part.resize(at + want.min(ROOM), 0);
            match self.stream.read(&mut self.part[at..]) {
                Ok(0) => self.lost = true,
                Ok(n) => self.part.truncate(at + n),
                Err(e) => {
                    self.part.truncate(at);
                    match e.kind() {
                        ErrorKind::WouldBlock => return true,
                        ErrorKind::Interrupted => {}
                        _ => self.lost = true,
                    }
                }
            }
        }
        true
    }

    /// Waits until the socket can be read or written.
    fn wait(&self, what: PollFlags, timeout: Duration) {
        let time = Timespec::try_from(timeout).ok();
        // The result does not matter, even when interrupted: the caller checks again.
        let _ = poll(&mut [PollFd::new(&self.stream, what)], time.as_ref());
    }
}

/// One rank of a socket group.
pub(crate) struct SocketComm {
    rank: usize,
    /// Peers by rank. `None` for this rank, and for ranks without a socket to this one.
    peers: Vec<Option<Peer>>,
    begin: Instant,
    next_id: u64,
    aborted: Option<(usize, String)>,
}

impl SocketComm {
    /// The first rank, with one socket per helper.
    pub(crate) fn first(helpers: Vec<UnixStream>) -> std::io::Result<SocketComm> {
        let mut peers = vec![None];
        for stream in helpers {
            peers.push(Some(Peer::new(stream)?));
        }
        Ok(SocketComm::with(0, peers))
    }

    /// A helper, which is connected only to the first rank.
    pub(crate) fn helper(first: UnixStream) -> std::io::Result<SocketComm> {
        Ok(SocketComm::with(1, vec![Some(Peer::new(first)?), None]))
    }

    fn with(rank: usize, peers: Vec<Option<Peer>>) -> SocketComm {
        SocketComm { rank, peers, begin: Instant::now(), next_id: 0, aborted: None }
    }

    fn check(&self, peer: usize) -> Result<(), CommError> {
        match &self.aborted {
            Some((by, reason)) => Err(CommError::Aborted { by: *by, reason: reason.clone() }),
            None if peer >= self.peers.len() => {
                Err(CommError::NoSuchRank { peer, size: self.peers.len() })
            }
            None => Ok(()),
        }
    }
}

impl Communicator for SocketComm {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.peers.len()
    }

    fn now(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError> {
        self.check(destination)?;
        let lost = CommError::PeerLost { rank: self.rank, peer: destination };
        let Some(peer) = self.peers[destination].as_mut().filter(|p| !p.lost) else {
            return Err(lost);
        };
        let header = header_of(tag, message.len());
        for part in [&header[..], &message] {
            let (mut at, mut moved) = (0, Instant::now());
            while at < part.len() {
                match peer.stream.write(&part[at..]) {
                    Ok(n) => (at, moved) = (at + n, Instant::now()),
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    Err(e) if e.kind() == ErrorKind::WouldBlock && moved.elapsed() < STALLED => {
                        peer.wait(PollFlags::OUT, STALLED);
                    }
                    // No other message can follow a partly sent one.
                    Err(_) => {
                        peer.lost = true;
                        return Err(lost);
                    }
                }
            }
        }
        Ok(())
    }

    fn post_recv(
        &mut self,
        source: usize,
        tag: u32,
        capacity: usize,
    ) -> Result<Receive, CommError> {
        self.check(source)?;
        self.next_id += 1;
        Ok(Receive { id: self.next_id, source, tag, capacity })
    }

    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError> {
        let rank = self.rank;
        let Some(first) = posted.first() else { return Err(CommError::NothingPosted { rank }) };
        let (peer, tag) = (first.source, first.tag);
        let end = Instant::now() + timeout;
        loop {
            for i in 0..posted.len() {
                let (source, tag, capacity) = (posted[i].source, posted[i].tag, posted[i].capacity);
                self.check(source)?;
                let lost = CommError::PeerLost { rank, peer: source };
                let Some(peer) = self.peers[source].as_mut() else { return Err(lost) };
                let known = peer.mail.iter().position(|(t, _)| *t == tag);
                if known.is_none() && !peer.read(capacity) {
                    peer.lost = true;
                    return Err(CommError::TooLong { rank, peer: source, tag, capacity });
                }
                if let Some(at) = peer.mail.iter().position(|(t, _)| *t == tag) {
                    let (_, message) = peer.mail.remove(at).expect("it was found");
                    posted.remove(i);
                    return Ok(Arrival { source, tag, message });
                }
                if peer.lost {
                    return Err(lost);
                }
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                let waited_ms = timeout.as_millis() as u64;
                return Err(CommError::Timeout { rank, peer, tag, waited_ms });
            }
            let sources = posted.iter().filter_map(|p| self.peers[p.source].as_ref());
            let mut sockets: Vec<_> =
                sources.map(|p| PollFd::new(&p.stream, PollFlags::IN)).collect();
            let time = Timespec::try_from(left).ok();
            // The result does not matter, even when interrupted: all sockets are checked again.
            let _ = poll(&mut sockets, time.as_ref());
        }
    }

    fn abort(&mut self, reason: &str) {
        self.aborted.get_or_insert((self.rank, reason.to_owned()));
        self.peers.iter_mut().for_each(|p| *p = None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> (SocketComm, SocketComm, UnixStream) {
        let (a, b) = UnixStream::pair().expect("sockets");
        let raw = b.try_clone().expect("a socket");
        (SocketComm::first(vec![a]).expect("first"), SocketComm::helper(b).expect("helper"), raw)
    }

    #[test]
    fn messages_of_any_length_come_whole_and_in_order() {
        let (mut first, mut helper, _) = pair();
        let long: Vec<u8> = (0..3_000_000_u32).map(|i| i as u8).collect();
        let sent = long.clone();
        let thread = std::thread::spawn(move || {
            first.send(1, 7, sent).expect("sent");
            first.send(1, 7, Vec::new()).expect("sent");
            first.send(1, 8, vec![9]).expect("sent");
            first
        });
        let mut take =
            |tag| helper.recv(0, tag, 1 << 22, Duration::from_secs(20)).expect("a message");
        // Takes another tag first. Earlier messages stay queued.
        assert_eq!(take(8), [9]);
        assert_eq!(take(7), long);
        assert_eq!(take(7), [0_u8; 0]);
        drop(thread.join().expect("no panic"));
        let lost = helper.recv(0, 7, 10, Duration::from_secs(20));
        assert_eq!(lost, Err(CommError::PeerLost { rank: 1, peer: 0 }));
    }

    #[test]
    fn a_message_longer_than_allowed_ends_the_talk_without_being_read() {
        let (mut first, _helper, mut raw) = pair();
        let mut header = [0_u8; HEADER];
        header[8..].copy_from_slice(&u64::MAX.to_ne_bytes());
        raw.write_all(&header).expect("written");
        let got = first.recv(1, 0, 1000, Duration::from_secs(5));
        assert!(matches!(got, Err(CommError::TooLong { .. })), "{got:?}");
        assert!(matches!(first.send(1, 0, vec![1]), Err(CommError::PeerLost { .. })));
    }

    #[test]
    fn waits_end_with_their_timeout() {
        let (mut first, _helper, _) = pair();
        let got = first.recv(1, 3, 10, Duration::from_millis(20));
        assert!(matches!(got, Err(CommError::Timeout { waited_ms: 20, .. })), "{got:?}");
    }
}
