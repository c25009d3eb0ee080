//! IceT's communicator: a table of functions that it calls for every message
//! (`IceTCommunicatorStruct` of IceT.h).
//!
//! A [`Transport`] carries the messages; the functions here only convert IceT's counts and types
//! into bytes. IceT cannot be told of an error, so a failing transport ends the process with a
//! message.
use std::ffi::{c_int, c_void};

/// Moves bytes for IceT. Pointers are valid for the given bytes as long as MPI would need them.
pub(super) trait Transport {
    fn rank(&self) -> usize;
    fn size(&self) -> usize;
    fn barrier(&mut self);
    fn send(&mut self, bytes: *const u8, count: usize, destination: c_int, tag: c_int);
    fn recv(&mut self, bytes: *mut u8, count: usize, source: c_int, tag: c_int);
    #[allow(clippy::too_many_arguments, reason = "as in MPI")]
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
    );
    /// `send` is null if the rank's part is already in its final position (here and below).
    fn gather(&mut self, send: *const u8, count: usize, recv: *mut u8, root: c_int);
    /// `counts` and `offsets` in bytes; empty except on the root.
    fn gatherv(
        &mut self,
        send: *const u8,
        count: usize,
        recv: *mut u8,
        counts: &[c_int],
        offsets: &[c_int],
        root: c_int,
    );
    fn allgather(&mut self, send: *const u8, count: usize, recv: *mut u8);
    fn alltoall(&mut self, send: *const u8, count: usize, recv: *mut u8);
    /// A number for the request, not 0.
    fn isend(&mut self, bytes: *const u8, count: usize, destination: c_int, tag: c_int) -> usize;
    /// A number for the request, not 0.
    fn irecv(&mut self, bytes: *mut u8, count: usize, source: c_int, tag: c_int) -> usize;
    fn wait(&mut self, request: usize);
    /// Position of a complete request; zeros are no requests.
    fn wait_any(&mut self, requests: &[usize]) -> usize;
}

/// `ICET_IN_PLACE_COLLECT`.
const IN_PLACE: usize = usize::MAX;

type Comm = *mut Table;

/// `struct IceTCommunicatorStruct`. Requests are pointers that IceT only compares with null.
#[repr(C)]
pub(super) struct Table {
    duplicate: unsafe extern "C" fn(Comm) -> Comm,
    destroy: unsafe extern "C" fn(Comm),
    subset: unsafe extern "C" fn(Comm, c_int, *const i32) -> Comm,
    barrier: unsafe extern "C" fn(Comm),
    send: unsafe extern "C" fn(Comm, *const u8, c_int, u32, c_int, c_int),
    recv: unsafe extern "C" fn(Comm, *mut u8, c_int, u32, c_int, c_int),
    sendrecv: unsafe extern "C" fn(
        Comm,
        *const u8,
        c_int,
        u32,
        c_int,
        c_int,
        *mut u8,
        c_int,
        u32,
        c_int,
        c_int,
    ),
    gather: unsafe extern "C" fn(Comm, *const u8, c_int, u32, *mut u8, c_int),
    gatherv: unsafe extern "C" fn(
        Comm,
        *const u8,
        c_int,
        u32,
        *mut u8,
        *const c_int,
        *const c_int,
        c_int,
    ),
    allgather: unsafe extern "C" fn(Comm, *const u8, c_int, u32, *mut u8),
    alltoall: unsafe extern "C" fn(Comm, *const u8, c_int, u32, *mut u8),
    isend: unsafe extern "C" fn(Comm, *const u8, c_int, u32, c_int, c_int) -> usize,
    irecv: unsafe extern "C" fn(Comm, *mut u8, c_int, u32, c_int, c_int) -> usize,
    wait: unsafe extern "C" fn(Comm, *mut usize),
    wait_any: unsafe extern "C" fn(Comm, c_int, *mut usize) -> c_int,
    size: unsafe extern "C" fn(Comm) -> c_int,
    rank: unsafe extern "C" fn(Comm) -> c_int,
    data: *mut c_void,
}

/// The table for a transport at `data`, which must not move and must be a `T`.
pub(super) fn of<T: Transport>(data: *mut c_void) -> Table {
    Table {
        duplicate,
        destroy,
        subset,
        barrier: barrier::<T>,
        send: send::<T>,
        recv: recv::<T>,
        sendrecv: sendrecv::<T>,
        gather: gather::<T>,
        gatherv: gatherv::<T>,
        allgather: allgather::<T>,
        alltoall: alltoall::<T>,
        isend: isend::<T>,
        irecv: irecv::<T>,
        wait: wait::<T>,
        wait_any: wait_any::<T>,
        size: size::<T>,
        rank: rank::<T>,
        data,
    }
}

/// # Safety
/// `comm` must come from [`of`] with the same `T`, and nobody else may use the transport during the
/// call.
unsafe fn transport<'a, T>(comm: Comm) -> &'a mut T {
    // SAFETY: as promised by the caller.
    unsafe { &mut *(*comm).data.cast::<T>() }
}

/// Bytes of `count` values of an IceT type (0x8000 boolean, 0x8001 byte, 0x8002 short, 0x8003 int,
/// 0x8004 float, 0x8005 double).
fn bytes(count: c_int, kind: u32) -> usize {
    let width = match kind {
        0x8000 | 0x8001 => 1,
        0x8002 => 2,
        0x8003 | 0x8004 => 4,
        0x8005 => 8,
        other => panic!("IceT sends values of the unknown type {other:#x}"),
    };
    count as usize * width
}

fn unless_in_place(send: *const u8) -> *const u8 {
    if send as usize == IN_PLACE { std::ptr::null() } else { send }
}

// IceT duplicates the communicator for its context and destroys its duplicate: one table serves
// both.
unsafe extern "C" fn duplicate(comm: Comm) -> Comm {
    comm
}

unsafe extern "C" fn destroy(_: Comm) {}

unsafe extern "C" fn subset(_: Comm, _: c_int, _: *const i32) -> Comm {
    panic!("IceT asks for a part of the ranks, which only its display walls do")
}

// SAFETY of all functions below: IceT passes the table it was given, with a transport of type `T`
// behind it, from the thread that called IceT and holds the transport exclusively.

unsafe extern "C" fn barrier<T: Transport>(c: Comm) {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.barrier();
}

unsafe extern "C" fn send<T: Transport>(
    c: Comm,
    b: *const u8,
    n: c_int,
    t: u32,
    to: c_int,
    tag: c_int,
) {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.send(b, bytes(n, t), to, tag);
}

unsafe extern "C" fn recv<T: Transport>(
    c: Comm,
    b: *mut u8,
    n: c_int,
    t: u32,
    from: c_int,
    tag: c_int,
) {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.recv(b, bytes(n, t), from, tag);
}

unsafe extern "C" fn sendrecv<T: Transport>(
    c: Comm,
    b: *const u8,
    n: c_int,
    t: u32,
    to: c_int,
    tag: c_int,
    rb: *mut u8,
    rn: c_int,
    rt: u32,
    from: c_int,
    rtag: c_int,
) {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.sendrecv(b, bytes(n, t), to, tag, rb, bytes(rn, rt), from, rtag);
}

unsafe extern "C" fn gather<T: Transport>(
    c: Comm,
    b: *const u8,
    n: c_int,
    t: u32,
    r: *mut u8,
    root: c_int,
) {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.gather(unless_in_place(b), bytes(n, t), r, root);
}

unsafe extern "C" fn gatherv<T: Transport>(
    c: Comm,
    b: *const u8,
    n: c_int,
    t: u32,
    r: *mut u8,
    counts: *const c_int,
    offsets: *const c_int,
    root: c_int,
) {
    // SAFETY: see above.
    let transport = unsafe { transport::<T>(c) };
    let width = bytes(1, t) as c_int;
    let in_bytes = |first: *const c_int| -> Vec<c_int> {
        if transport.rank() as c_int != root {
            return Vec::new();
        }
        // SAFETY: on the root IceT passes one number for each rank.
        let numbers = unsafe { std::slice::from_raw_parts(first, transport.size()) };
        numbers.iter().map(|number| number * width).collect()
    };
    let (counts, offsets) = (in_bytes(counts), in_bytes(offsets));
    transport.gatherv(unless_in_place(b), bytes(n, t), r, &counts, &offsets, root);
}

unsafe extern "C" fn allgather<T: Transport>(c: Comm, b: *const u8, n: c_int, t: u32, r: *mut u8) {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.allgather(unless_in_place(b), bytes(n, t), r);
}

unsafe extern "C" fn alltoall<T: Transport>(c: Comm, b: *const u8, n: c_int, t: u32, r: *mut u8) {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.alltoall(unless_in_place(b), bytes(n, t), r);
}

unsafe extern "C" fn isend<T: Transport>(
    c: Comm,
    b: *const u8,
    n: c_int,
    t: u32,
    to: c_int,
    tag: c_int,
) -> usize {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.isend(b, bytes(n, t), to, tag)
}

unsafe extern "C" fn irecv<T: Transport>(
    c: Comm,
    b: *mut u8,
    n: c_int,
    t: u32,
    from: c_int,
    tag: c_int,
) -> usize {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.irecv(b, bytes(n, t), from, tag)
}

unsafe extern "C" fn wait<T: Transport>(c: Comm, request: *mut usize) {
    // SAFETY: see above; IceT passes the place of one request, which becomes null.
    unsafe {
        if *request != 0 {
            transport::<T>(c).wait(*request);
            *request = 0;
        }
    }
}

unsafe extern "C" fn wait_any<T: Transport>(c: Comm, n: c_int, requests: *mut usize) -> c_int {
    // SAFETY: see above; IceT passes `n` requests, and the one that is complete becomes null.
    unsafe {
        let requests = std::slice::from_raw_parts_mut(requests, n as usize);
        let done = transport::<T>(c).wait_any(requests);
        requests[done] = 0;
        done as c_int
    }
}

unsafe extern "C" fn size<T: Transport>(c: Comm) -> c_int {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.size() as c_int
}

unsafe extern "C" fn rank<T: Transport>(c: Comm) -> c_int {
    // SAFETY: see above.
    unsafe { transport::<T>(c) }.rank() as c_int
}
