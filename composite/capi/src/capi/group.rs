//! Groups of ranks: communicators of the program's MPI.

use super::handles::{self, Handled};
use super::memory::{check_pointer, put, text};
use super::status::{Failure, caught, guarded};
use super::types::*;
use composite::comm::mpi::MpiComm;
use composite::{Communicator, threads};
use std::ffi::{c_char, c_void};

/// The object behind a [`RtsvCompositeComm`].
pub(crate) struct Group {
    comm: Box<dyn Communicator>,
    /// Why it has ended, if it has.
    ended: Option<String>,
}

impl Handled for Group {
    const NAME: &'static str = "group of ranks";
}

/// Runs a call that all ranks make together. A rank that fails ends the group, so that the others
/// learn the cause and do not wait; but where all ranks have the same failure, it goes on.
pub(crate) fn collective<R>(
    group: usize,
    call: impl FnOnce(&mut dyn Communicator) -> Result<R, Failure>,
) -> Result<R, Failure> {
    handles::with(group, |group: &mut Group| {
        if let Some(reason) = &group.ended {
            let text = format!("the group has ended, make a new one: {reason}");
            return Err(Failure::new(RTSV_COMPOSITE_ENDED, text));
        }
        let comm = &mut *group.comm;
        let result = caught(|| call(comm));
        if let Err(failure) = &result
            && failure.status != RTSV_COMPOSITE_DISAGREE
        {
            comm.abort(&failure.text);
            group.ended = Some(failure.text.clone());
        }
        result
    })
}

/// Makes a group with `make` and writes its handle.
///
/// # Safety
/// `out` is null or points to memory for a pointer.
unsafe fn group_into(
    out: *mut *mut RtsvCompositeComm,
    make: impl FnOnce() -> Result<Box<dyn Communicator>, Failure>,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_pointer(out, "out")?;
        let handle = handles::add(Group { comm: make()?, ended: None });
        // SAFETY: the caller's promise.
        unsafe { put(out, "out", std::ptr::without_provenance_mut(handle)) }
    })
}

/// Collective: a group of the ranks of an MPI communicator, which is duplicated. `comm` points to
/// the MPI_Comm and `comm_bytes` is its size: rtsv_composite_comm_from_mpi(&comm, sizeof comm,
/// &group). MPI is running, with a thread level that allows calls from this thread.
///
/// # Safety
/// `comm` is null or points to `comm_bytes` bytes, a communicator of the MPI that runs; `out` is
/// null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_comm_from_mpi(
    comm: *const c_void,
    comm_bytes: u64,
    out: *mut *mut RtsvCompositeComm,
) -> RtsvCompositeStatus {
    let make = || {
        if comm.is_null() {
            return Err(Failure::new(RTSV_COMPOSITE_POINTER, "the pointer `comm` is null"));
        }
        // SAFETY: the caller's promise.
        let comm = unsafe { MpiComm::from_object(comm, comm_bytes as usize) }?;
        Ok(Box::new(comm) as Box<dyn Communicator>)
    };
    // SAFETY: the caller's promise.
    unsafe { group_into(out, make) }
}

/// Collective: as rtsv_composite_comm_from_mpi, for a communicator of Fortran: an INTEGER, or
/// comm%MPI_VAL of a type(MPI_Comm).
///
/// # Safety
/// `comm` is a communicator of the MPI that runs; `out` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_comm_from_fortran(
    comm: i32,
    out: *mut *mut RtsvCompositeComm,
) -> RtsvCompositeStatus {
    let make = || {
        // SAFETY: the caller's promise.
        let comm = unsafe { MpiComm::from_fortran(comm) }?;
        Ok(Box::new(comm) as Box<dyn Communicator>)
    };
    // SAFETY: the caller's promise.
    unsafe { group_into(out, make) }
}

/// A group of this rank alone, without MPI: for programs that run on one process too.
///
/// # Safety
/// `out` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_comm_self(
    out: *mut *mut RtsvCompositeComm,
) -> RtsvCompositeStatus {
    let make = || {
        let alone = threads::group(1).into_iter().next();
        let alone = alone.ok_or_else(|| Failure::value("a group of one rank has no rank"))?;
        Ok(Box::new(alone) as Box<dyn Communicator>)
    };
    // SAFETY: the caller's promise.
    unsafe { group_into(out, make) }
}

/// This rank in the group, and the number of ranks; either may be null.
///
/// # Safety
/// Both are null or point to memory for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_comm_rank(
    comm: *const RtsvCompositeComm,
    rank: *mut u32,
    size: *mut u32,
) -> RtsvCompositeStatus {
    guarded(|| {
        let numbers =
            handles::with(comm.addr(), |g: &mut Group| Ok([g.comm.rank(), g.comm.size()]))?;
        for (out, what, number) in [(rank, "rank", numbers[0]), (size, "size", numbers[1])] {
            if !out.is_null() {
                // SAFETY: the caller's promise.
                unsafe { put(out, what, number as u32) }?;
            }
        }
        Ok(())
    })
}

/// Ends the group: all ranks that wait, or will, get RTSV_COMPOSITE_ENDED with this reason. For a
/// rank that cannot go on outside of a call.
///
/// # Safety
/// `reason` is null or ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_comm_abort(
    comm: *mut RtsvCompositeComm,
    reason: *const c_char,
) -> RtsvCompositeStatus {
    guarded(|| {
        // SAFETY: the caller's promise.
        let reason = unsafe { text(reason, "reason") }?;
        handles::with(comm.addr(), |group: &mut Group| {
            group.comm.abort(&reason);
            group.ended.get_or_insert(reason);
            Ok(())
        })
    })
}

/// Collective: frees a group, before MPI_Finalize; null is allowed. What was made with it must not
/// be used any more, but must still be freed.
#[unsafe(no_mangle)]
pub extern "C" fn rtsv_composite_comm_free(comm: *mut RtsvCompositeComm) -> RtsvCompositeStatus {
    free::<Group, _>(comm)
}

/// Frees the object of a handle; null is allowed.
pub(crate) fn free<T: Handled, H>(handle: *mut H) -> RtsvCompositeStatus {
    guarded(|| {
        if handle.is_null() {
            return Ok(());
        }
        handles::remove::<T>(handle.addr()).map(drop)
    })
}
