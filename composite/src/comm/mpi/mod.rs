//! Ranks as processes of an MPI job: Open MPI, MPICH or SimGrid's SMPI, whichever started them.
//!
//! The library is loaded at run time (`dlopen`), so one binary works with all of them and building
//! needs none. The launcher determines which one is loaded ([`launcher`]); a library with an
//! unknown name is refused ([`Abi`]).
//!
//! Faults: waits poll, so they end at their timeout, and a rank that gives up tells the others with
//! a notice. MPI itself cannot continue after that, so a program ends with [`MpiComm::end_job`].
//! The launcher notices a killed rank and ends the job (Open MPI and MPICH both do). Under SMPI
//! time is simulated and waits block: SimGrid itself finds ranks that wait forever.
#![allow(unsafe_code, reason = "calls into an MPI library found at run time")]

mod abi;
mod clock;
mod error;
mod finalize;
mod heartbeat;
mod host_program;
pub mod launcher;
mod library;
mod notice;
#[cfg(target_os = "linux")]
mod shared_collectives;
#[cfg(target_os = "linux")]
mod shared_memory;
mod topology;
mod transfer;

pub use abi::Abi;
pub use error::MpiError;
pub use library::inspect;
pub(crate) use library::{Handle, Mpi};

#[cfg(target_os = "linux")]
use super::SharedSegments;
use super::{Arrival, CommError, Communicator, Receive, collective};
use clock::Clock;
use heartbeat::{HeartbeatTimeout, Heartbeats};
use notice::{Notice, Notices};
use std::ffi::c_int;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use transfer::Transfers;

/// Bytes of a full chunk: MPI counts in `int`, and some transports have trouble near 2 GiB. Memory
/// is allocated chunk by chunk as they arrive, because the length that a sender has announced may
/// be false.
const CHUNK_BYTES: usize = 1 << 26;
/// `MPI_THREAD_FUNNELED` in all three ABIs: other threads may exist, but only this one calls MPI.
const FUNNELED: c_int = 1;
/// How long a message of a rank that has left may still be in flight.
const LATE_MESSAGE_TIMEOUT: Duration = Duration::from_millis(200);
/// How long a rank that leaves waits for its messages to be received.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(2);
/// Number of messages in flight from which on a sender checks which of them are complete, if it has
/// not needed their buffers before.
const REAP_AT: usize = 512;
/// Polls before a rank yields its processor, where every rank has its own.
const SPINS: u32 = 2000;
/// Yields before a rank sleeps, where ranks share processors.
const YIELDS: u32 = 100;
/// Duration of that sleep.
const POLL_SLEEP: Duration = Duration::from_micros(20);
/// Longest wait for the other ranks when the group is made.
const STARTUP_TIMEOUT: Duration = Duration::from_secs(300);
/// How often a waiting rank polls for notices.
const NOTICE_INTERVAL: Duration = Duration::from_millis(1);

/// The ranks of an MPI communicator: of the job that this process belongs to
/// ([`MpiComm::world`]), or of a communicator that the surrounding program has made
/// ([`MpiComm::from_handle`]). Only the thread that made it may use it.
///
/// Dropping it leaves the group and ends MPI (`MPI_Finalize`) if this object started it, unless the
/// group was aborted.
pub struct MpiComm {
    mpi: Rc<Mpi>,
    rank: usize,
    size: usize,
    clock: Clock,
    transfers: Transfers,
    notices: Notices,
    heartbeats: Heartbeats,
    /// When notices were last polled between computations.
    looked: Instant,
    left: Vec<bool>,
    aborted: Option<(usize, String)>,
    /// Whether there are more ranks here than processors.
    oversubscribed: bool,
    /// The machine of every rank, numbered in the order of their first ranks; the same on all
    /// ranks.
    nodes: Vec<usize>,
    finalize: bool,
    /// See [`delay_after_collectives`](Self::delay_after_collectives).
    #[cfg(target_os = "linux")]
    delay_after_collectives: Duration,
    /// What the ranks of this machine share, if all ranks of all machines could open theirs.
    #[cfg(target_os = "linux")]
    shared: Option<shared_memory::SharedMemory>,
}

static STARTED: AtomicBool = AtomicBool::new(false);

impl MpiComm {
    /// Starts MPI with all ranks of the job, unless it is started already.
    ///
    /// # Errors
    /// [`MpiError`]: no launcher, no library, one with an unknown binary interface, or a second
    /// call.
    pub fn world() -> Result<Self, MpiError> {
        Self::with_chunks(CHUNK_BYTES)
    }

    /// As [`world`](Self::world), with messages cut into chunks of this many bytes (64 MiB at
    /// most); for tests.
    ///
    /// # Errors
    /// As [`world`](Self::world).
    pub fn with_chunks(chunk_bytes: usize) -> Result<Self, MpiError> {
        let chunk_bytes = chunk_bytes.clamp(1, CHUNK_BYTES);
        let mut mpi = Mpi::load()?;
        // Under SMPI all ranks share this library's statics unless it is privatised, and each rank
        // has its own world.
        if mpi.abi != Abi::Smpi && STARTED.swap(true, Ordering::SeqCst) {
            return Err(MpiError::StartedTwice);
        }

        // Start MPI, unless the surrounding program has.
        let mut initialized: c_int = 0;
        // SAFETY: MPI_Initialized may be called at any time.
        mpi.checked("MPI_Initialized", unsafe {
            (mpi.functions.initialized)(&raw mut initialized)
        })?;
        if initialized == 0 {
            let mut provided: c_int = 0;
            // SAFETY: null arguments are allowed since MPI 2; called once a process (a rank, under
            // SMPI).
            let code = unsafe {
                if mpi.abi == Abi::Smpi {
                    (mpi.functions.init)(std::ptr::null_mut(), std::ptr::null_mut())
                } else {
                    (mpi.functions.init_thread)(
                        std::ptr::null_mut(),
                        std::ptr::null_mut(),
                        FUNNELED,
                        &raw mut provided,
                    )
                }
            };
            mpi.checked("MPI_Init", code)?;
        }
        mpi.started();

        let world = mpi.world;
        Self::duplicating(Rc::new(mpi), world, chunk_bytes, initialized == 0)
    }

    /// All ranks of the communicator `base`, which is duplicated and not used after that.
    fn duplicating(
        mpi: Rc<Mpi>,
        base: Handle,
        chunk_bytes: usize,
        finalize: bool,
    ) -> Result<Self, MpiError> {
        // Separate communicators, so that no message is mistaken for one of the surrounding
        // program.
        let duplicate = || {
            let mut comm: Handle = 0;
            // SAFETY: every rank of `base` makes the same calls in the same order.
            let code = unsafe { (mpi.functions.comm_dup)(base, &raw mut comm) };
            mpi.checked("MPI_Comm_dup", code)?;
            // SAFETY: a communicator that was just made, and a predefined error handler.
            let code = unsafe { (mpi.functions.set_error_handler)(comm, mpi.errors_return) };
            mpi.checked("MPI_Comm_set_errhandler", code)?;
            Ok(comm)
        };
        let (messages, notices) = (duplicate()?, duplicate()?);
        let (mut rank, mut size): (c_int, c_int) = (0, 0);
        // SAFETY: plain queries of a valid communicator.
        unsafe {
            mpi.checked("MPI_Comm_rank", (mpi.functions.comm_rank)(messages, &raw mut rank))?;
            mpi.checked("MPI_Comm_size", (mpi.functions.comm_size)(messages, &raw mut size))?;
        }
        let (rank, size) = (rank as usize, size as usize);

        let mut comm = Self {
            rank,
            size,
            clock: Clock::new(mpi.abi),
            transfers: Transfers::new(rank, messages, chunk_bytes),
            notices: Notices::new(notices),
            heartbeats: Heartbeats::new(rank, size),
            looked: Instant::now(),
            left: vec![false; size],
            aborted: None,
            oversubscribed: false,
            nodes: (0..size).collect(),
            finalize,
            mpi,
            #[cfg(target_os = "linux")]
            delay_after_collectives: Duration::ZERO,
            #[cfg(target_os = "linux")]
            shared: None,
        };
        let failed = |error: CommError| MpiError::Call {
            call: "the first all-gather".to_string(),
            reason: error.to_string(),
        };
        comm.find_nodes().map_err(failed)?;
        #[cfg(target_os = "linux")]
        comm.share_memory().map_err(failed)?;
        Ok(comm)
    }

    /// The binary interface of the library.
    pub fn abi(&self) -> Abi {
        self.mpi.abi
    }

    /// The first line of the library's version text.
    pub fn library_version(&self) -> &str {
        self.mpi.version.lines().next().unwrap_or_default()
    }

    /// Ends all processes of the job, this one included, with exit code `code` (`MPI_Abort`). For
    /// programs after an error: report the error before. Gives the other ranks a moment to report
    /// it too.
    pub fn end_job(mut self, code: i32) {
        let begin = Instant::now();
        while begin.elapsed() < LATE_MESSAGE_TIMEOUT && self.mpi.abi != Abi::Smpi {
            self.notices.delivered(&self.mpi);
            std::thread::sleep(Duration::from_millis(10));
        }
        // SAFETY: the world's handle; the call does not return where the library can end the job.
        unsafe { (self.mpi.functions.abort)(self.mpi.world, code) };
    }

    /// The library, for IceT, which has to use the same one.
    pub(crate) fn library(&self) -> Rc<Mpi> {
        Rc::clone(&self.mpi)
    }

    fn check_peer(&self, peer: usize) -> Result<(), CommError> {
        if let Some((by, reason)) = &self.aborted {
            return Err(CommError::Aborted { by: *by, reason: reason.clone() });
        }
        if peer < self.size { Ok(()) } else { Err(CommError::NoSuchRank { peer, size: self.size }) }
    }

    fn others(&self) -> impl Iterator<Item = usize> + use<> {
        let rank = self.rank;
        (0..self.size).filter(move |&other| other != rank)
    }

    fn process_notices(&mut self) -> Result<(), CommError> {
        while let Some(notice) = self.notices.receive(&self.mpi) {
            match notice {
                Notice::Left { rank } if rank < self.size => self.left[rank] = true,
                Notice::Left { .. } => {}
                Notice::HeartbeatRequest { rank } => self.heartbeats.requested_by(rank),
                Notice::Heartbeat { rank, heartbeat } => self.heartbeats.record(rank, heartbeat),
                Notice::Aborted { by, reason } => {
                    self.aborted.get_or_insert((by, reason));
                }
            }
        }
        match &self.aborted {
            Some((by, reason)) => Err(CommError::Aborted { by: *by, reason: reason.clone() }),
            None => Ok(()),
        }
    }

    /// Answers ranks that have asked for a sign of life, if this rank has made steps since its last
    /// answer.
    fn answer_heartbeat_requests(&mut self) {
        let heartbeats = self.heartbeats.take_replies();
        self.notices.send_heartbeats(&self.mpi, heartbeats);
    }

    /// Call this while waiting, after [`process_notices`](Self::process_notices): sends and
    /// receives signs of life.
    fn update_timeout(&mut self, patience: &mut HeartbeatTimeout, sources: &[usize], now: Instant) {
        if self.mpi.abi == Abi::Smpi {
            return;
        }
        self.answer_heartbeat_requests();
        let (any, to_hand_on) = self.heartbeats.take_new(|from| sources.contains(&from));
        if any {
            patience.renew(now);
            self.notices.send_heartbeats(&self.mpi, to_hand_on);
        }
        if patience.is_request_due(now) {
            let mut asked = sources.to_vec();
            asked.sort_unstable();
            asked.dedup();
            let left = &self.left;
            asked.retain(|&source| source != self.rank && !left[source]);
            self.notices.request_heartbeats(&self.mpi, asked.into_iter());
        }
    }

    /// A complete receive of `posted`.
    fn complete(&mut self, posted: &mut Vec<Receive>) -> Option<Arrival> {
        let position_of = |id| posted.iter().position(|receive| receive.id == id);
        let (position, message) = self.transfers.take(position_of)?;
        let Receive { source, tag, .. } = posted.remove(position);
        self.heartbeats.step();
        Some(Arrival { source, tag, message })
    }
}

impl Communicator for MpiComm {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn now(&self) -> f64 {
        self.clock.now(&self.mpi)
    }

    fn working_secs(&self) -> f64 {
        self.clock.working_secs(&self.mpi)
    }

    /// Never for simulated ranks, whose messages take simulated time on one machine too.
    fn is_one_node(&self) -> bool {
        self.mpi.abi != Abi::Smpi && self.nodes.iter().all(|&shared| shared == 0)
    }

    fn root_cause(&mut self, error: CommError) -> CommError {
        self.process_notices().err().unwrap_or(error)
    }

    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError> {
        self.check_peer(destination)?;
        if self.left[destination] {
            return Err(CommError::PeerLost { rank: self.rank, peer: destination });
        }
        self.heartbeats.step();
        self.answer_heartbeat_requests();
        let Self { transfers, mpi, clock, .. } = self;
        clock.around(|| {
            transfers.send(mpi, destination, tag, message)?;
            // Checking costs as much as sending a small message, so not for every one.
            if transfers.outgoing() >= REAP_AT {
                transfers.reclaim_buffers(mpi);
            }
            Ok(())
        })
    }

    fn post_recv(
        &mut self,
        source: usize,
        tag: u32,
        capacity: usize,
    ) -> Result<Receive, CommError> {
        self.check_peer(source)?;
        let Self { transfers, mpi, clock, .. } = self;
        let id = clock.around(|| transfers.post(mpi, source, tag, capacity))?;
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
        self.check_peer(first.source)?;
        // Simulated time does not pass while polling, so SMPI has to block.
        let block = self.mpi.abi == Abi::Smpi && !timeout.is_zero();
        let begin = Instant::now();
        let mut patience = HeartbeatTimeout::new(timeout, begin);
        let mut received = begin;
        let mut lost_since: Option<Instant> = None;
        let mut polls = 0_u32;
        if let Some(arrival) = self.complete(posted) {
            return Ok(arrival);
        }
        loop {
            let came = self.transfers.progress(&self.mpi, block)?;
            self.clock.waited();
            if came {
                match self.complete(posted) {
                    Some(arrival) => return Ok(arrival),
                    None => continue,
                }
            }
            let now = Instant::now();
            if patience.is_over(now) {
                // The rank that gave up first knows better what is wrong.
                if self.mpi.abi != Abi::Smpi {
                    self.process_notices()?;
                }
                // A sign of life may have arrived while this rank had no processor.
                if !timeout.is_zero() {
                    let sources: Vec<usize> = posted.iter().map(|receive| receive.source).collect();
                    self.update_timeout(&mut patience, &sources, now);
                }
                if patience.is_over(now) {
                    return Err(silent);
                }
            }
            polls += 1;
            if self.oversubscribed && polls > YIELDS {
                // A rank that only yields uses up its share of the processor and is scheduled last
                // when its message arrives.
                std::thread::sleep(POLL_SLEEP);
            } else if self.oversubscribed || polls > SPINS {
                std::thread::yield_now();
            }
            if now.duration_since(received) >= NOTICE_INTERVAL {
                received = now;
                self.process_notices()?;
                self.transfers.reclaim_buffers(&self.mpi);
                let sources: Vec<usize> = posted.iter().map(|receive| receive.source).collect();
                self.update_timeout(&mut patience, &sources, now);
                if let Some(lost) = posted.iter().find(|receive| self.left[receive.source]) {
                    let since = *lost_since.get_or_insert(now);
                    if now.duration_since(since) >= LATE_MESSAGE_TIMEOUT {
                        return Err(CommError::PeerLost { rank, peer: lost.source });
                    }
                }
            }
        }
    }

    fn alive(&mut self) -> Result<(), CommError> {
        self.heartbeats.step();
        let now = Instant::now();
        // Simulated ranks wait without a timeout.
        if self.mpi.abi == Abi::Smpi || now.duration_since(self.looked) < NOTICE_INTERVAL {
            return Ok(());
        }
        self.looked = now;
        self.process_notices()?;
        self.answer_heartbeat_requests();
        Ok(())
    }

    fn throttle_sends(&mut self, tag: u32, most: usize, patience: Duration) {
        // Where no message travels in the background, waiting for it only delays the others.
        if self.is_one_node() {
            return;
        }
        let oversubscribed = self.oversubscribed;
        let Self { transfers, mpi, clock, .. } = self;
        if mpi.abi == Abi::Smpi {
            // Simulated time does not pass while polling.
            while transfers.outgoing_of(tag) > most && transfers.wait_sent(mpi, tag) {}
            clock.waited();
            return;
        }
        let begin = Instant::now();
        while transfers.outgoing_of(tag) > most && begin.elapsed() < patience {
            transfers.reclaim_buffers(mpi);
            if oversubscribed {
                std::thread::sleep(POLL_SLEEP);
            } else {
                std::hint::spin_loop();
            }
        }
    }

    fn abort(&mut self, reason: &str) {
        if self.aborted.is_none() {
            self.aborted = Some((self.rank, reason.to_string()));
            let others = self.others();
            self.notices.send_aborted(&self.mpi, others, reason);
        }
    }

    #[cfg(target_os = "linux")]
    fn machines_with_shared_memory(&self) -> Option<&[usize]> {
        self.shared.as_ref().map(|_| self.nodes.as_slice())
    }

    #[cfg(target_os = "linux")]
    fn machine_barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        match self.collective_in_memory(None, timeout) {
            Some(met) => met.map(|_| ()),
            None => self.barrier(timeout),
        }
    }

    #[cfg(target_os = "linux")]
    fn shared_segments(&mut self) -> Option<&mut dyn SharedSegments> {
        self.shared.as_mut().map(|shared| shared as &mut dyn SharedSegments)
    }

    fn barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        #[cfg(target_os = "linux")]
        if self.is_one_node()
            && let Some(met) = self.collective_in_memory(None, timeout)
        {
            return met.map(|_| ());
        }
        if self.mpi.abi != Abi::Smpi {
            return collective::barrier(self, timeout);
        }
        // SAFETY: a communicator of this object; every rank calls this.
        let code = unsafe { (self.mpi.functions.barrier)(self.transfers.comm()) };
        self.clock.waited();
        if code == 0 {
            Ok(())
        } else {
            Err(transfer::failed(&self.mpi, self.rank, "MPI_Barrier", code))
        }
    }

    /// Simulated ranks block anyway, so they use the library's own all-gather instead of the one
    /// here, which has timeouts.
    fn all_gather(
        &mut self,
        mine: &[u8],
        longest: usize,
        timeout: Duration,
    ) -> Result<Vec<Vec<u8>>, CommError> {
        #[cfg(target_os = "linux")]
        if self.is_one_node()
            && longest <= shared_memory::LONGEST
            && mine.len() <= longest
            && let Some(gathered) = self.collective_in_memory(Some(mine), timeout)
        {
            return gathered;
        }
        let block = 8 + longest;
        let bytes = c_int::try_from(block);
        let (Abi::Smpi, Ok(bytes)) = (self.mpi.abi, bytes) else {
            return collective::all_gather(self, mine, longest, timeout);
        };
        let too_long = |peer| CommError::TooLong {
            rank: self.rank,
            peer,
            tag: collective::GATHER_TAG,
            capacity: longest,
        };
        if mine.len() > longest {
            return Err(too_long(self.rank));
        }
        let mut own = Vec::with_capacity(block);
        own.extend_from_slice(&(mine.len() as u64).to_le_bytes());
        own.extend_from_slice(mine);
        own.resize(block, 0);
        let mut all = vec![0_u8; block * self.size];
        // SAFETY: every rank calls this with blocks of the same size, and `all` has room for one of
        // each.
        let code = unsafe {
            (self.mpi.functions.allgather)(
                own.as_ptr().cast(),
                bytes,
                self.mpi.byte,
                all.as_mut_ptr().cast(),
                bytes,
                self.mpi.byte,
                self.transfers.comm(),
            )
        };
        self.clock.waited();
        if code != 0 {
            return Err(transfer::failed(&self.mpi, self.rank, "MPI_Allgather", code));
        }
        let blocks = all.chunks_exact(block).enumerate();
        blocks
            .map(|(peer, block)| {
                collective::block_at(block, 0)
                    .map(|(start, end)| block[start..end].to_vec())
                    .ok_or_else(|| too_long(peer))
            })
            .collect()
    }

    fn buffer(&mut self, capacity: usize) -> Vec<u8> {
        let Self { transfers, mpi, clock, .. } = self;
        clock.around(|| transfers.buffer(mpi, capacity))
    }

    fn recycle(&mut self, buffer: Vec<u8>) {
        self.transfers.pool.put(buffer);
    }
}
