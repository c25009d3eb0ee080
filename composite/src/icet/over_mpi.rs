//! IceT's messages by MPI's own functions, without a copy, as in IceT's own MPI layer: for MPICH
//! and SMPI, for which distributions build no such layer.
use super::table::Transport;
use crate::comm::mpi::{Handle, Mpi};
use std::ffi::{c_int, c_void};
use std::rc::Rc;

pub(super) struct OverMpi {
    mpi: Rc<Mpi>,
    rank: usize,
    size: usize,
    /// Requests by number, from 1; null where free.
    requests: Vec<Handle>,
}

impl OverMpi {
    pub(super) fn new(mpi: Rc<Mpi>, rank: usize, size: usize) -> Self {
        Self { mpi, rank, size, requests: Vec::new() }
    }

    fn keep(&mut self, request: Handle) -> usize {
        let null = self.mpi.request_null;
        let free = self.requests.iter().position(|&other| other == null);
        let index = free.unwrap_or_else(|| {
            self.requests.push(null);
            self.requests.len() - 1
        });
        self.requests[index] = request;
        // A send may be complete at once and have no request; its number must still differ from 0,
        // which means none.
        index + 1
    }

    fn or_in_place(&self, send: *const u8) -> *const c_void {
        if send.is_null() { self.mpi.in_place() } else { send.cast() }
    }
}

// SAFETY of all calls below: bytes and counts are IceT's, which promises to MPI what it promises to
// its own layer; the communicator is the world, whose errors end the job.
impl Transport for OverMpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn barrier(&mut self) {
        // SAFETY: see above.
        unsafe { (self.mpi.functions.barrier)(self.mpi.world) };
    }

    fn send(&mut self, bytes: *const u8, count: usize, destination: c_int, tag: c_int) {
        let m = &self.mpi;
        // SAFETY: see above.
        unsafe {
            (m.functions.send)(bytes.cast(), count as c_int, m.byte, destination, tag, m.world)
        };
    }

    fn recv(&mut self, bytes: *mut u8, count: usize, source: c_int, tag: c_int) {
        let m = &self.mpi;
        // SAFETY: see above.
        unsafe {
            (m.functions.recv)(
                bytes.cast(),
                count as c_int,
                m.byte,
                source,
                tag,
                m.world,
                m.status_ignore(),
            )
        };
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
        let m = &self.mpi;
        // SAFETY: see above.
        unsafe {
            (m.functions.sendrecv)(
                send.cast(),
                send_count as c_int,
                m.byte,
                destination,
                send_tag,
                recv.cast(),
                recv_count as c_int,
                m.byte,
                source,
                recv_tag,
                m.world,
                m.status_ignore(),
            )
        };
    }

    fn gather(&mut self, send: *const u8, count: usize, recv: *mut u8, root: c_int) {
        let (m, n) = (&self.mpi, count as c_int);
        // SAFETY: see above.
        unsafe {
            (m.functions.gather)(
                self.or_in_place(send),
                n,
                m.byte,
                recv.cast(),
                n,
                m.byte,
                root,
                m.world,
            )
        };
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
        let m = &self.mpi;
        // SAFETY: see above; the lists are read on the root only.
        unsafe {
            (m.functions.gatherv)(
                self.or_in_place(send),
                count as c_int,
                m.byte,
                recv.cast(),
                counts.as_ptr(),
                offsets.as_ptr(),
                m.byte,
                root,
                m.world,
            )
        };
    }

    fn allgather(&mut self, send: *const u8, count: usize, recv: *mut u8) {
        let (m, n) = (&self.mpi, count as c_int);
        // SAFETY: see above.
        unsafe {
            (m.functions.allgather)(
                self.or_in_place(send),
                n,
                m.byte,
                recv.cast(),
                n,
                m.byte,
                m.world,
            )
        };
    }

    fn alltoall(&mut self, send: *const u8, count: usize, recv: *mut u8) {
        let (m, n) = (&self.mpi, count as c_int);
        // SAFETY: see above.
        unsafe { (m.functions.alltoall)(send.cast(), n, m.byte, recv.cast(), n, m.byte, m.world) };
    }

    fn isend(&mut self, bytes: *const u8, count: usize, destination: c_int, tag: c_int) -> usize {
        let mut request: Handle = 0;
        let m = &self.mpi;
        // SAFETY: see above.
        unsafe {
            (m.functions.isend)(
                bytes.cast(),
                count as c_int,
                m.byte,
                destination,
                tag,
                m.world,
                &raw mut request,
            )
        };
        self.keep(request)
    }

    fn irecv(&mut self, bytes: *mut u8, count: usize, source: c_int, tag: c_int) -> usize {
        let mut request: Handle = 0;
        let m = &self.mpi;
        // SAFETY: see above.
        unsafe {
            (m.functions.irecv)(
                bytes.cast(),
                count as c_int,
                m.byte,
                source,
                tag,
                m.world,
                &raw mut request,
            )
        };
        self.keep(request)
    }

    fn wait(&mut self, request: usize) {
        if let Some(handle) = self.requests.get_mut(request - 1) {
            // SAFETY: see above; a request, or null, for which the call does nothing.
            unsafe { (self.mpi.functions.wait)(&raw mut *handle, self.mpi.status_ignore()) };
            *handle = self.mpi.request_null;
        }
    }

    fn wait_any(&mut self, requests: &[usize]) -> usize {
        let null = self.mpi.request_null;
        let handles = requests.iter().map(|&request| match request {
            0 => null,
            number => self.requests[number - 1],
        });
        let done = self.mpi.wait_any_of(&handles.collect::<Vec<_>>());
        // If none is active, all remaining ones are complete.
        let done = done.or_else(|| requests.iter().position(|&request| request != 0)).unwrap_or(0);
        if requests[done] != 0 {
            self.requests[requests[done] - 1] = null;
        }
        done
    }
}
