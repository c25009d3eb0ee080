//! Communicators inside a program that has started MPI itself: a simulation, ParaView, mpi4py.
//!
//! Nothing here needs `MPI_COMM_WORLD`. The program's communicator is duplicated, so its messages
//! and ours never meet; several groups may exist at once, over any of its communicators. MPI is
//! neither started nor ended.
use super::library::Handle;
use super::{Abi, CHUNK_BYTES, DRAIN_TIMEOUT, Mpi, MpiComm, MpiError};
use std::ffi::{c_int, c_void};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// The state of MPI before `MPI_Init`.
const NOT_STARTED: &str = "not started";
/// `MPI_THREAD_SERIALIZED` in all three ABIs.
const SERIALIZED: c_int = 2;
/// The names of the levels below it.
const MAIN_THREAD_LEVELS: [&str; 2] = ["MPI_THREAD_SINGLE", "MPI_THREAD_FUNNELED"];

impl MpiComm {
    /// The ranks of `comm`, a communicator (`MPI_Comm`) of the program that this library is part
    /// of, as the integer or pointer that the handle is. All ranks of `comm` call this together,
    /// and drop the result together; the program may go on to use its communicator, or free it.
    ///
    /// With the thread levels `MPI_THREAD_SINGLE` and `MPI_THREAD_FUNNELED` only the main thread
    /// may call this. With `MPI_THREAD_SERIALIZED` any thread may, but the program must see to it
    /// that no two threads are in MPI at once.
    ///
    /// # Safety
    /// `comm` is a communicator of the MPI library that this process has started, and all its ranks
    /// make this call.
    ///
    /// # Errors
    /// [`MpiError::NotRunning`], [`MpiError::OtherThread`], [`MpiError::UnusableCommunicator`], and
    /// those of finding the library.
    pub unsafe fn from_handle(comm: usize) -> Result<Self, MpiError> {
        // SAFETY: the caller's promise.
        unsafe { Self::over(running()?, comm) }
    }

    /// As [`from_handle`](Self::from_handle), for a handle in memory, as C has it:
    /// `from_object(&comm, sizeof comm)` for an `MPI_Comm comm`. The size tells whether the program
    /// was compiled with the headers of the MPI that runs.
    ///
    /// # Safety
    /// As [`from_handle`](Self::from_handle); `comm` is null or points to `bytes` readable bytes.
    ///
    /// # Errors
    /// As [`from_handle`](Self::from_handle), and [`MpiError::OtherHeaders`].
    pub unsafe fn from_object(comm: *const c_void, bytes: usize) -> Result<Self, MpiError> {
        let mpi = running()?;
        let expected = mpi.abi.handle_bytes();
        if comm.is_null() {
            return Err(MpiError::UnusableCommunicator { what: "a null pointer" });
        }
        if bytes != expected {
            let library = mpi.version.lines().next().unwrap_or_default().to_owned();
            return Err(MpiError::OtherHeaders { bytes, expected, library });
        }
        let mut handle = [0_u8; size_of::<Handle>()];
        // SAFETY: the caller's promise, and a handle has at most the size of `handle`.
        unsafe { std::ptr::copy_nonoverlapping(comm.cast(), handle.as_mut_ptr(), bytes) };
        // SAFETY: the caller's promise. All ABIs here are little-endian.
        unsafe { Self::over(mpi, Handle::from_le_bytes(handle)) }
    }

    /// As [`from_handle`](Self::from_handle), for a handle of Fortran: the integer that a
    /// communicator is in the modules `mpi` and `mpif.h`, or `comm%MPI_VAL` in `mpi_f08`.
    ///
    /// # Safety
    /// As [`from_handle`](Self::from_handle).
    ///
    /// # Errors
    /// As [`from_handle`](Self::from_handle), and [`MpiError::MissingSymbol`] for a library without
    /// `MPI_Comm_f2c`.
    pub unsafe fn from_fortran(comm: i32) -> Result<Self, MpiError> {
        let mpi = running()?;
        let handle = match (mpi.abi, mpi.comm_from_fortran) {
            // The handles of C and Fortran are the same integers.
            (Abi::Mpich, _) => comm as u32 as Handle,
            // SAFETY: the function returns null or the null communicator for unknown integers.
            (_, Some(from_fortran)) => unsafe { from_fortran(comm) },
            (_, None) => {
                return Err(MpiError::MissingSymbol {
                    library: mpi.version.lines().next().unwrap_or_default().to_owned(),
                    symbol: "MPI_Comm_f2c".to_owned(),
                });
            }
        };
        // SAFETY: the caller's promise.
        unsafe { Self::over(mpi, handle) }
    }

    /// All ranks of the program that this library is part of (`MPI_COMM_WORLD`); `None` where it
    /// has not started MPI. All of them call this together.
    ///
    /// # Errors
    /// As [`from_handle`](Self::from_handle).
    pub fn of_program() -> Result<Option<Self>, MpiError> {
        let mpi = match running() {
            Ok(mpi) => mpi,
            Err(
                MpiError::NotLaunched
                | MpiError::NoLibrary { .. }
                | MpiError::NotRunning { state: NOT_STARTED, .. },
            ) => return Ok(None),
            Err(error) => return Err(error),
        };
        let world = mpi.world;
        // SAFETY: the world of the MPI that runs; that all ranks call is the contract above, and
        // without it they wait until their time is up.
        unsafe { Self::over(mpi, world) }.map(Some)
    }

    /// # Safety
    /// `comm` is a communicator of `mpi`, and all its ranks make this call.
    unsafe fn over(mpi: Mpi, comm: Handle) -> Result<Self, MpiError> {
        if comm == mpi.comm_null || comm == 0 {
            return Err(MpiError::UnusableCommunicator { what: "MPI_COMM_NULL" });
        }
        if let Some(test_inter) = mpi.test_inter {
            let mut inter: c_int = 0;
            // SAFETY: a communicator, as the caller promises.
            mpi.checked("MPI_Comm_test_inter", unsafe { test_inter(comm, &raw mut inter) })?;
            if inter != 0 {
                return Err(MpiError::UnusableCommunicator { what: "an inter-communicator" });
            }
        }
        Self::duplicating(Rc::new(mpi), comm, CHUNK_BYTES, false)
    }

    /// Groups of the ranks that give the same `color`, ordered by `key` and then by rank
    /// (`MPI_Comm_split`). All ranks call this together. The new group and this one are used side
    /// by side.
    ///
    /// # Errors
    /// [`MpiError::Call`], and [`MpiError::MissingSymbol`] for a library without that function.
    pub fn split(&self, color: u32, key: u32) -> Result<Self, MpiError> {
        let (Some(split), Some(free)) = (self.mpi.split, self.mpi.comm_free) else {
            return Err(MpiError::MissingSymbol {
                library: self.library_version().to_owned(),
                symbol: "MPI_Comm_split".to_owned(),
            });
        };
        // Colours are ints that are not negative.
        let int = |value: u32| (value & c_int::MAX as u32) as c_int;
        let mut part: Handle = 0;
        // SAFETY: a communicator of this object, whose ranks all call this.
        let code = unsafe { split(self.transfers.comm(), int(color), int(key), &raw mut part) };
        self.mpi.checked("MPI_Comm_split", code)?;
        // SAFETY: a communicator of the MPI that runs here, and all its ranks are in this call.
        let group = unsafe { Self::from_handle(part) };
        // SAFETY: the communicator that was just made, which nobody else has.
        unsafe { free(&raw mut part) };
        group
    }

    /// Frees the duplicates of the program's communicator once all ranks have left, so that a
    /// program may make groups again and again. After a fault, or where a rank keeps the others
    /// waiting, they are left to MPI.
    pub(super) fn free_duplicates(&mut self) {
        let Some(free) = self.mpi.comm_free else { return };
        let begin = Instant::now();
        while self.others().any(|other| !self.left[other]) {
            if begin.elapsed() > DRAIN_TIMEOUT || self.process_notices().is_err() {
                return;
            }
            self.transfers.reclaim_buffers(&self.mpi);
            std::thread::sleep(Duration::from_micros(100));
        }
        for mut comm in [self.transfers.comm(), self.notices.comm()] {
            // SAFETY: communicators that this object has made; all ranks have left and free theirs.
            unsafe { free(&raw mut comm) };
        }
    }

    /// Whether the surrounding program has ended MPI before this object.
    pub(super) fn is_mpi_over(&self) -> bool {
        is_finalized(&self.mpi)
    }
}

/// The MPI of the surrounding program, if this thread may call it.
fn running() -> Result<Mpi, MpiError> {
    let mut mpi = Mpi::load_started()?;
    mpi.started();
    check_running(&mpi)?;
    check_thread(&mpi)?;
    Ok(mpi)
}

fn is_finalized(mpi: &Mpi) -> bool {
    let Some(finalized) = mpi.finalized else { return false };
    let mut flag: c_int = 0;
    // SAFETY: MPI_Finalized may be called at any time.
    unsafe { finalized(&raw mut flag) };
    flag != 0
}

fn check_running(mpi: &Mpi) -> Result<(), MpiError> {
    let mut initialized: c_int = 0;
    // SAFETY: MPI_Initialized may be called at any time.
    let code = unsafe { (mpi.functions.initialized)(&raw mut initialized) };
    mpi.checked("MPI_Initialized", code)?;
    let library = mpi.version.lines().next().unwrap_or_default().to_owned();
    if initialized == 0 {
        return Err(MpiError::NotRunning { state: NOT_STARTED, library });
    }
    if is_finalized(mpi) {
        return Err(MpiError::NotRunning { state: "ended", library });
    }
    Ok(())
}

/// Whether this thread may call MPI at the level that it was started with.
fn check_thread(mpi: &Mpi) -> Result<(), MpiError> {
    let (Some(level_of), Some(is_main)) = (mpi.query_thread, mpi.is_thread_main) else {
        return Ok(());
    };
    // Simulated ranks are threads or contexts of one process, each with one of its own.
    if mpi.abi == Abi::Smpi {
        return Ok(());
    }
    let (mut level, mut main): (c_int, c_int) = (0, 0);
    // SAFETY: MPI is running; both only write an int.
    mpi.checked("MPI_Query_thread", unsafe { level_of(&raw mut level) })?;
    // SAFETY: as above.
    mpi.checked("MPI_Is_thread_main", unsafe { is_main(&raw mut main) })?;
    if level >= SERIALIZED || main != 0 {
        return Ok(());
    }
    let level = MAIN_THREAD_LEVELS[usize::from(level == 1)];
    Err(MpiError::OtherThread { level })
}
