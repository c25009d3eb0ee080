//! IceT's messages over a [`Communicator`]. Every message is copied into a buffer and out of it, as
//! MPI does within a machine.
use super::table::Transport;
use crate::comm::{CommError, Communicator, Receive};
use std::ffi::c_int;
use std::marker::PhantomData;
use std::time::Duration;

/// Timeout of each wait, because IceT has none of its own.
const TIMEOUT: Duration = Duration::from_secs(60);
/// Added to IceT's tags, to separate them from ours.
const FIRST_TAG: u32 = 8192;
/// The request number of every send: its bytes are copied, so it is complete at once.
const SENT: usize = usize::MAX;

/// A receive that IceT has posted, and the address for its bytes.
struct Pending {
    receive: Receive,
    to: *mut u8,
}

pub(super) struct OverComm {
    rank: usize,
    size: usize,
    comm: Option<*mut dyn Communicator>,
    /// Requests by number, from 1.
    pending: Vec<Option<Pending>>,
}

/// Ends the loan of the communicator when it is dropped.
pub(super) struct CommGuard<'a> {
    over: *mut OverComm,
    _comm: PhantomData<&'a mut dyn Communicator>,
}

impl Drop for CommGuard<'_> {
    fn drop(&mut self) {
        // SAFETY: made by `with_comm` from a box that outlives the call into IceT during which this
        // exists.
        unsafe { (*self.over).comm = None };
    }
}

impl OverComm {
    pub(super) fn new(rank: usize, size: usize) -> Self {
        Self { rank, size, comm: None, pending: Vec::new() }
    }

    /// Lets IceT use `comm` until the result is dropped.
    pub(super) fn with_comm<'a>(&mut self, comm: &'a mut dyn Communicator) -> CommGuard<'a> {
        // SAFETY: only the lifetime changes; `CommGuard` keeps the borrow and takes the pointer
        // back.
        let comm: &'static mut dyn Communicator = unsafe { std::mem::transmute(comm) };
        self.comm = Some(comm);
        CommGuard { over: self, _comm: PhantomData }
    }

    fn comm(&mut self) -> &mut dyn Communicator {
        let comm = self.comm.expect("IceT calls only while it has the communicator");
        // SAFETY: lent for the call that is going on.
        unsafe { &mut *comm }
    }

    fn post(&mut self, to: *mut u8, count: usize, source: c_int, tag: c_int) -> Pending {
        let receive = self.comm().post_recv(source as usize, FIRST_TAG + tag as u32, count);
        Pending { receive: or_abort(receive), to }
    }

    fn finish(&mut self, pending: Pending) {
        let comm = self.comm();
        let arrival = or_abort(comm.wait_any(&mut vec![pending.receive], TIMEOUT));
        // SAFETY: IceT's buffer holds the count it posted, and the communicator lets no longer
        // message through.
        unsafe {
            pending.to.copy_from_nonoverlapping(arrival.message.as_ptr(), arrival.message.len())
        };
        comm.recycle(arrival.message);
    }
}

/// Panics on an error, because IceT cannot be told of one.
fn or_abort<T>(result: Result<T, CommError>) -> T {
    result.unwrap_or_else(|error| panic!("IceT's messages cannot go on: {error}"))
}

impl Transport for OverComm {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn barrier(&mut self) {
        or_abort(self.comm().barrier(TIMEOUT));
    }

    fn send(&mut self, bytes: *const u8, count: usize, destination: c_int, tag: c_int) {
        let mut message = self.comm().buffer(count);
        if count > 0 {
            // SAFETY: IceT passes `count` bytes.
            message.extend_from_slice(unsafe { std::slice::from_raw_parts(bytes, count) });
        }
        or_abort(self.comm().send(destination as usize, FIRST_TAG + tag as u32, message));
    }

    fn recv(&mut self, bytes: *mut u8, count: usize, source: c_int, tag: c_int) {
        let pending = self.post(bytes, count, source, tag);
        self.finish(pending);
    }

    fn sendrecv(
        &mut self,
        send: *const u8,
        send_count: usize,
        destination: c_int,
        send_tag: c_int,
        recv: *mut u8,
        recv_count: usize,
        source: c_int,
        recv_tag: c_int,
    ) {
        let pending = self.post(recv, recv_count, source, recv_tag);
        self.send(send, send_count, destination, send_tag);
        self.finish(pending);
    }

    fn gather(&mut self, send: *const u8, count: usize, recv: *mut u8, root: c_int) {
        let counts = vec![count as c_int; self.size];
        let offsets: Vec<c_int> = (0..self.size).map(|rank| (rank * count) as c_int).collect();
        self.gatherv(send, count, recv, &counts, &offsets, root);
    }

    fn gatherv(
        &mut self,
        send: *const u8,
        count: usize,
        recv: *mut u8,
        counts: &[c_int],
        offsets: &[c_int],
        root: c_int,
    ) {
        const TAG: c_int = 8000;
        if self.rank as c_int != root {
            if !send.is_null() {
                self.send(send, count, root, TAG);
            }
            return;
        }
        for rank in 0..self.size {
            // SAFETY: IceT's buffer has room for `counts[rank]` bytes at `offsets[rank]`.
            let to = unsafe { recv.add(offsets[rank] as usize) };
            if rank != self.rank {
                self.recv(to, counts[rank] as usize, rank as c_int, TAG);
            } else if !send.is_null() {
                // SAFETY: as above; the rank's own part is elsewhere.
                unsafe { to.copy_from(send, count) };
            }
        }
    }

    fn allgather(&mut self, send: *const u8, count: usize, recv: *mut u8) {
        let mine = if send.is_null() {
            // SAFETY: in place, the rank's part is where it belongs.
            unsafe { recv.add(self.rank * count).cast_const() }
        } else {
            send
        };
        // SAFETY: IceT passes `count` bytes.
        let mine = unsafe { std::slice::from_raw_parts(mine, count) }.to_vec();
        let all = or_abort(self.comm().all_gather(&mine, count, TIMEOUT));
        for (rank, part) in all.iter().enumerate() {
            // SAFETY: room for `count` bytes of each rank.
            unsafe {
                recv.add(rank * count)
                    .copy_from_nonoverlapping(part.as_ptr(), part.len().min(count))
            };
        }
    }

    fn alltoall(&mut self, send: *const u8, count: usize, recv: *mut u8) {
        const TAG: c_int = 8001;
        for rank in 0..self.size {
            // SAFETY: `count` bytes for each rank.
            let part = unsafe { send.add(rank * count) };
            self.send(part, count, rank as c_int, TAG);
        }
        for rank in 0..self.size {
            // SAFETY: room for `count` bytes of each rank.
            let to = unsafe { recv.add(rank * count) };
            self.recv(to, count, rank as c_int, TAG);
        }
    }

    fn isend(&mut self, bytes: *const u8, count: usize, destination: c_int, tag: c_int) -> usize {
        self.send(bytes, count, destination, tag);
        SENT
    }

    fn irecv(&mut self, bytes: *mut u8, count: usize, source: c_int, tag: c_int) -> usize {
        let pending = self.post(bytes, count, source, tag);
        let free = self.pending.iter().position(Option::is_none);
        let index = free.unwrap_or_else(|| {
            self.pending.push(None);
            self.pending.len() - 1
        });
        self.pending[index] = Some(pending);
        index + 1
    }

    fn wait(&mut self, request: usize) {
        if request == SENT {
            return;
        }
        if let Some(pending) = self.pending.get_mut(request - 1).and_then(Option::take) {
            self.finish(pending);
        }
    }

    fn wait_any(&mut self, requests: &[usize]) -> usize {
        if let Some(done) = requests.iter().position(|&request| request == SENT) {
            return done;
        }
        // All receives that are waited for, and the positions of their requests.
        let (mut posted, mut owners) = (Vec::new(), Vec::new());
        for (position, &request) in
            requests.iter().enumerate().filter(|(_, request)| **request != 0)
        {
            if let Some(pending) = self.pending.get_mut(request - 1).and_then(Option::take) {
                owners.push((pending.receive.id, position, request, pending.to));
                posted.push(pending.receive);
            }
        }
        let arrival = or_abort(self.comm().wait_any(&mut posted, TIMEOUT));
        let mut done = 0;
        let mut left = posted.into_iter().peekable();
        for (id, position, request, to) in owners {
            match left.next_if(|receive| receive.id == id) {
                Some(receive) => self.pending[request - 1] = Some(Pending { receive, to }),
                None => {
                    done = position;
                    // SAFETY: as in `finish`.
                    unsafe {
                        to.copy_from_nonoverlapping(arrival.message.as_ptr(), arrival.message.len())
                    };
                }
            }
        }
        self.comm().recycle(arrival.message);
        done
    }
}
