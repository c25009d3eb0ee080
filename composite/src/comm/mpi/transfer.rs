//! Messages in flight: buffers that MPI reads or writes stay here until it is done with them.
//!
//! MPI counts bytes in an `int`, so a message is sent as *chunks*: any number of full ones and one
//! that is not full, possibly empty. A message shorter than a chunk, as nearly all are, is one MPI
//! message.
use super::library::{Handle, Mpi, Status};
use crate::comm::{BufferPool, CommError};
use std::ffi::c_int;

/// Marks a request that has been completed; no library has such a handle.
const COMPLETE: Handle = Handle::MAX;

/// A message that MPI may still be reading.
struct Outgoing {
    tag: u32,
    requests: Vec<Handle>,
    buffer: Vec<u8>,
}

/// A receive that was posted and not yet waited for.
struct Incoming {
    id: u64,
    source: usize,
    tag: u32,
    capacity: usize,
    /// Its capacity is at least one byte more than the receive's, so that a message that is too
    /// long shows.
    buffer: Vec<u8>,
    /// Bytes of complete chunks.
    received: usize,
    /// Null when no chunk is being received.
    request: Handle,
    /// Capacity of the current chunk in bytes.
    posted: usize,
    done: bool,
}

/// All messages in flight from and to this rank.
pub(super) struct Transfers {
    rank: usize,
    comm: Handle,
    chunk_bytes: usize,
    outgoing: Vec<Outgoing>,
    /// In the order of posting.
    incoming: Vec<Incoming>,
    next_id: u64,
    pub(super) pool: BufferPool,
    /// Receives that are complete and not yet taken.
    finished: Vec<u64>,
    /// Reused by every poll.
    requests: Vec<Handle>,
    owners: Vec<usize>,
}

impl Transfers {
    pub(super) fn new(rank: usize, comm: Handle, chunk_bytes: usize) -> Self {
        Self {
            rank,
            comm,
            chunk_bytes,
            outgoing: Vec::new(),
            incoming: Vec::new(),
            next_id: 0,
            pool: BufferPool::default(),
            finished: Vec::new(),
            requests: Vec::new(),
            owners: Vec::new(),
        }
    }

    pub(super) fn comm(&self) -> Handle {
        self.comm
    }

    pub(super) fn send(
        &mut self,
        mpi: &Mpi,
        destination: usize,
        tag: u32,
        message: Vec<u8>,
    ) -> Result<(), CommError> {
        let mut requests = Vec::with_capacity(1);
        let mut begin = 0;
        let mut result = Ok(());
        loop {
            let chunk = (message.len() - begin).min(self.chunk_bytes);
            let mut request: Handle = 0;
            // SAFETY: the chunk lies within `message`, whose heap buffer neither moves nor changes
            // until the request is complete: `outgoing` owns it. chunk_bytes fits a c_int.
            let code = unsafe {
                (mpi.functions.isend)(
                    message.as_ptr().add(begin).cast(),
                    chunk as c_int,
                    mpi.byte,
                    destination as c_int,
                    tag as c_int,
                    self.comm,
                    &raw mut request,
                )
            };
            if code != 0 {
                result = Err(failed(mpi, self.rank, "MPI_Isend", code));
                break;
            }
            requests.push(request);
            begin += chunk;
            if chunk < self.chunk_bytes {
                break;
            }
        }
        self.outgoing.push(Outgoing { tag, requests, buffer: message });
        result
    }

    /// An empty buffer with the given `capacity`: a recycled one, that of a message that has been
    /// sent meanwhile, or a new one.
    pub(super) fn buffer(&mut self, mpi: &Mpi, capacity: usize) -> Vec<u8> {
        if let Some(buffer) = self.pool.fitting(capacity) {
            return buffer;
        }
        self.reclaim_buffers(mpi);
        self.pool.take(capacity)
    }

    /// Reclaims the buffers of messages that have been sent, in one call for all.
    pub(super) fn reclaim_buffers(&mut self, mpi: &Mpi) {
        let requests: Vec<Handle> =
            self.outgoing.iter().flat_map(|message| message.requests.iter().copied()).collect();
        if requests.is_empty() {
            return;
        }
        let count = requests.len() as c_int;
        let (mut wide, mut narrow) = (requests, Vec::<u32>::new());
        let array = if mpi.constants.request_bytes == 4 {
            narrow.extend(wide.iter().map(|&request| request as u32));
            narrow.as_mut_ptr().cast()
        } else {
            wide.as_mut_ptr().cast()
        };
        let mut done: c_int = 0;
        let mut indices = vec![0 as c_int; count as usize];
        // SAFETY: `count` requests of MPI_Isend that have not been completed, in an array of the
        // ABI's width, and room for as many indices; the value that ignores statuses is that of one
        // status in every ABI.
        let code = unsafe {
            (mpi.functions.test_some)(
                count,
                array,
                &raw mut done,
                indices.as_mut_ptr(),
                mpi.status_ignore(),
            )
        };
        // Undefined, which is negative, if there was no request.
        let done = usize::try_from(done).unwrap_or(0).min(indices.len());
        if code != 0 || done == 0 {
            return;
        }
        for &index in &indices[..done] {
            if let Some(request) = usize::try_from(index).ok().and_then(|index| wide.get_mut(index))
            {
                *request = COMPLETE;
            }
        }
        let mut at = 0;
        for mut message in std::mem::take(&mut self.outgoing) {
            let states = &wide[at..at + message.requests.len()];
            at += message.requests.len();
            let mut state = states.iter();
            message.requests.retain(|_| state.next() != Some(&COMPLETE));
            if message.requests.is_empty() {
                self.pool.put(message.buffer);
            } else {
                self.outgoing.push(message);
            }
        }
    }

    /// Messages that MPI may still be reading.
    pub(super) fn outgoing(&self) -> usize {
        self.outgoing.len()
    }

    /// The number of those with this tag.
    pub(super) fn outgoing_of(&self, tag: u32) -> usize {
        self.outgoing.iter().filter(|message| message.tag == tag).count()
    }

    /// Waits until one more request of the messages with this tag is complete; false if there is
    /// none.
    pub(super) fn wait_sent(&mut self, mpi: &Mpi, tag: u32) -> bool {
        let of_tag = |message: &Outgoing| message.tag == tag;
        let requests: Vec<Handle> = self
            .outgoing
            .iter()
            .filter(|m| of_tag(m))
            .flat_map(|m| m.requests.iter().copied())
            .collect();
        let Some(done) = mpi.wait_any_of(&requests).map(|index| requests[index]) else {
            return false;
        };
        for message in self.outgoing.iter_mut().filter(|m| of_tag(m)) {
            message.requests.retain(|request| *request != done);
        }
        if let Some(at) = self.outgoing.iter().position(|message| message.requests.is_empty()) {
            let message = self.outgoing.remove(at);
            self.pool.put(message.buffer);
        }
        true
    }

    pub(super) fn post(
        &mut self,
        mpi: &Mpi,
        source: usize,
        tag: u32,
        capacity: usize,
    ) -> Result<u64, CommError> {
        let buffer = self.buffer(mpi, capacity.saturating_add(1).min(self.chunk_bytes));
        let id = self.next_id;
        self.next_id += 1;
        self.incoming.push(Incoming {
            id,
            source,
            tag,
            capacity,
            buffer,
            received: 0,
            request: mpi.request_null,
            posted: 0,
            done: false,
        });
        let last = self.incoming.len() - 1;
        if self.may_start(last) { self.start_chunk(mpi, last).map(|()| id) } else { Ok(id) }
    }

    /// Whether the next chunk of its source and tag belongs to this receive: those before it must
    /// not need another chunk.
    fn may_start(&self, index: usize) -> bool {
        let this = &self.incoming[index];
        let ahead = self.incoming[..index]
            .iter()
            .filter(|other| (other.source, other.tag) == (this.source, this.tag));
        ahead.into_iter().all(|other| other.done || other.capacity < self.chunk_bytes)
    }

    fn start_chunk(&mut self, mpi: &Mpi, index: usize) -> Result<(), CommError> {
        let this = &mut self.incoming[index];
        let room = (this.capacity - this.received).saturating_add(1).min(self.chunk_bytes);
        if this.buffer.capacity() < this.received + room {
            this.buffer.try_reserve(this.received + room - this.buffer.len()).map_err(|error| {
                CommError::Transport {
                    rank: self.rank,
                    call: format!("allocating {} bytes", this.received + room),
                    reason: error.to_string(),
                }
            })?;
        }
        this.posted = room;
        // SAFETY: the `room` bytes behind `received` are within the buffer's capacity; `incoming`
        // owns the buffer, which does not move or grow until the request is complete.
        let code = unsafe {
            (mpi.functions.irecv)(
                this.buffer.as_mut_ptr().add(this.received).cast(),
                room as c_int,
                mpi.byte,
                this.source as c_int,
                this.tag as c_int,
                self.comm,
                &raw mut this.request,
            )
        };
        if code == 0 { Ok(()) } else { Err(failed(mpi, self.rank, "MPI_Irecv", code)) }
    }

    /// The first of `wanted` that is complete, and its message. Those of one source and tag come in
    /// the order in which they were posted: MPI matches them so, but it may complete a short
    /// message before a long one that was sent earlier. Checks complete ones only: with a hundred
    /// receives posted, a scan of all of them after each message takes longer than the messages.
    pub(super) fn take(
        &mut self,
        wanted: impl Fn(u64) -> Option<usize>,
    ) -> Option<(usize, Vec<u8>)> {
        let next = |&id: &u64| {
            wanted(id)?;
            let last = self.incoming.iter().position(|other| other.id == id)?;
            let key = |of: &Incoming| (of.source, of.tag);
            for (index, ahead) in self.incoming[..=last].iter().enumerate() {
                if key(ahead) != key(&self.incoming[last]) {
                    continue;
                }
                match (ahead.done, wanted(ahead.id)) {
                    (false, _) => return None,
                    (true, Some(position)) => return Some((index, position)),
                    // Nobody waits for it any more.
                    (true, None) => {}
                }
            }
            None
        };
        let (index, position) = self.finished.iter().find_map(next)?;
        let taken = self.incoming.remove(index);
        self.finished.retain(|&id| id != taken.id);
        Some((position, taken.buffer))
    }

    /// Lets MPI work and receives at most one chunk; with `wait` it blocks until one has arrived,
    /// otherwise it polls once. Returns whether a chunk arrived.
    pub(super) fn progress(&mut self, mpi: &Mpi, wait: bool) -> Result<bool, CommError> {
        self.requests.clear();
        self.owners.clear();
        for (index, incoming) in self.incoming.iter().enumerate() {
            if incoming.request != mpi.request_null {
                self.requests.push(incoming.request);
                self.owners.push(index);
            }
        }
        if self.requests.is_empty() {
            return Ok(false);
        }
        let count = self.requests.len() as c_int;
        let mut narrow: Vec<u32> = Vec::new();
        let array = if mpi.constants.request_bytes == 4 {
            narrow.extend(self.requests.iter().map(|&request| request as u32));
            narrow.as_mut_ptr().cast()
        } else {
            self.requests.as_mut_ptr().cast()
        };
        let mut index: c_int = -1;
        let mut flag: c_int = 1;
        let mut status: Status = [0; 8];
        // SAFETY: `count` active requests in an array of the ABI's width; a status is at most as
        // large as `Status`.
        let code = unsafe {
            if wait {
                (mpi.functions.wait_any)(count, array, &raw mut index, &raw mut status)
            } else {
                (mpi.functions.test_any)(
                    count,
                    array,
                    &raw mut index,
                    &raw mut flag,
                    &raw mut status,
                )
            }
        };
        if code == 0 && flag == 0 {
            return Ok(false);
        }
        let owner = usize::try_from(index).ok().and_then(|index| self.owners.get(index).copied());
        let call = if wait { "MPI_Waitany" } else { "MPI_Testany" };
        let Some(owner) = owner else {
            return if code == 0 { Ok(false) } else { Err(failed(mpi, self.rank, call, code)) };
        };
        let (rank, chunk_bytes) = (self.rank, self.chunk_bytes);
        let this = &mut self.incoming[owner];
        this.request = mpi.request_null;
        let too_long =
            CommError::TooLong { rank, peer: this.source, tag: this.tag, capacity: this.capacity };
        if code != 0 {
            let words = mpi.error_text(code);
            // The class's number differs between libraries, its name does not.
            return Err(if words.to_lowercase().contains("truncat") {
                too_long
            } else {
                failed(mpi, rank, call, code)
            });
        }
        let mut bytes: c_int = 0;
        // SAFETY: the status of a completed receive of bytes.
        unsafe { (mpi.functions.get_count)(&raw const status, mpi.byte, &raw mut bytes) };
        let bytes = usize::try_from(bytes).unwrap_or(0).min(this.posted);
        this.received += bytes;
        if this.received > this.capacity {
            return Err(too_long);
        }
        // SAFETY: MPI has written the first `received` bytes of the buffer.
        unsafe { this.buffer.set_len(this.received) };
        if bytes == chunk_bytes {
            self.start_chunk(mpi, owner)?;
            return Ok(true);
        }
        this.done = true;
        self.finished.push(this.id);
        // Start the receives that had to wait for this one.
        let (source, tag) = (this.source, this.tag);
        for index in owner + 1..self.incoming.len() {
            let other = &self.incoming[index];
            let idle = other.request == mpi.request_null && !other.done;
            if (other.source, other.tag) == (source, tag) && idle && self.may_start(index) {
                self.start_chunk(mpi, index)?;
            }
        }
        Ok(true)
    }
}

pub(super) fn failed(mpi: &Mpi, rank: usize, call: &str, code: c_int) -> CommError {
    CommError::Transport { rank, call: call.to_string(), reason: mpi.error_text(code) }
}

impl Drop for Transfers {
    fn drop(&mut self) {
        // MPI may still read or write these; a leak is better than memory that changes under its
        // next owner.
        for outgoing in self.outgoing.drain(..) {
            std::mem::forget(outgoing.buffer);
        }
        for incoming in self.incoming.drain(..).filter(|incoming| !incoming.done) {
            std::mem::forget(incoming.buffer);
        }
    }
}
