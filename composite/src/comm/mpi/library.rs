//! An MPI library loaded at run time: its functions, with one set of signatures for all ABIs.
use super::MpiError;
use super::abi::{Abi, Constants};
use super::launcher::{self, Choice};
use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_LOCAL, RTLD_NOW};
use std::ffi::{c_char, c_int, c_void};

/// `RTLD_NOLOAD` of Linux: only what is loaded already.
#[cfg(target_os = "linux")]
const RTLD_NOLOAD: c_int = 4;

/// A handle (communicator, data type, error handler, request) of any ABI.
pub(crate) type Handle = usize;

/// Memory for a status of any ABI: the largest has 24 bytes.
pub(crate) type Status = [u64; 8];

macro_rules! functions {
    ($($field:ident: $symbol:literal, fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions used, with handles as [`Handle`] and pointers to handles as `*mut Handle`.
        pub(crate) struct Functions {
            $(pub(crate) $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            fn of(library: &Library, name: &str) -> Result<Self, MpiError> {
                Ok(Self {
                    $($field: {
                        // SAFETY: the MPI standard fixes this function's arguments; handles fit
                        // `usize` in every ABI that `Abi::of_version` lets pass, and no function is
                        // called before that check but the version's.
                        let symbol = unsafe {
                            library.get::<unsafe extern "C" fn($($argument),*) $(-> $result)?>($symbol.as_bytes())
                        };
                        *symbol.map_err(|_| MpiError::MissingSymbol {
                            library: name.to_string(),
                            symbol: $symbol.to_string(),
                        })?
                    },)*
                })
            }
        }
    };
}

functions! {
    init: "MPI_Init", fn(*mut c_int, *mut c_void) -> c_int;
    init_thread: "MPI_Init_thread", fn(*mut c_int, *mut c_void, c_int, *mut c_int) -> c_int;
    initialized: "MPI_Initialized", fn(*mut c_int) -> c_int;
    finalize: "MPI_Finalize", fn() -> c_int;
    abort: "MPI_Abort", fn(Handle, c_int) -> c_int;
    library_version: "MPI_Get_library_version", fn(*mut c_char, *mut c_int) -> c_int;
    processor_name: "MPI_Get_processor_name", fn(*mut c_char, *mut c_int) -> c_int;
    error_string: "MPI_Error_string", fn(c_int, *mut c_char, *mut c_int) -> c_int;
    comm_rank: "MPI_Comm_rank", fn(Handle, *mut c_int) -> c_int;
    comm_size: "MPI_Comm_size", fn(Handle, *mut c_int) -> c_int;
    comm_dup: "MPI_Comm_dup", fn(Handle, *mut Handle) -> c_int;
    set_error_handler: "MPI_Comm_set_errhandler", fn(Handle, Handle) -> c_int;
    wtime: "MPI_Wtime", fn() -> f64;
    send: "MPI_Send", fn(*const c_void, c_int, Handle, c_int, c_int, Handle) -> c_int;
    recv: "MPI_Recv", fn(*mut c_void, c_int, Handle, c_int, c_int, Handle, *mut Status) -> c_int;
    isend: "MPI_Isend", fn(*const c_void, c_int, Handle, c_int, c_int, Handle, *mut Handle) -> c_int;
    irecv: "MPI_Irecv", fn(*mut c_void, c_int, Handle, c_int, c_int, Handle, *mut Handle) -> c_int;
    test: "MPI_Test", fn(*mut Handle, *mut c_int, *mut Status) -> c_int;
    wait: "MPI_Wait", fn(*mut Handle, *mut Status) -> c_int;
    test_any: "MPI_Testany", fn(c_int, *mut c_void, *mut c_int, *mut c_int, *mut Status) -> c_int;
    wait_any: "MPI_Waitany", fn(c_int, *mut c_void, *mut c_int, *mut Status) -> c_int;
    test_some: "MPI_Testsome", fn(c_int, *mut c_void, *mut c_int, *mut c_int, *mut Status) -> c_int;
    iprobe: "MPI_Iprobe", fn(c_int, c_int, Handle, *mut c_int, *mut Status) -> c_int;
    get_count: "MPI_Get_count", fn(*const Status, Handle, *mut c_int) -> c_int;
    sendrecv: "MPI_Sendrecv", fn(*const c_void, c_int, Handle, c_int, c_int, *mut c_void, c_int, Handle, c_int, c_int, Handle, *mut Status) -> c_int;
    barrier: "MPI_Barrier", fn(Handle) -> c_int;
    gather: "MPI_Gather", fn(*const c_void, c_int, Handle, *mut c_void, c_int, Handle, c_int, Handle) -> c_int;
    gatherv: "MPI_Gatherv", fn(*const c_void, c_int, Handle, *mut c_void, *const c_int, *const c_int, Handle, c_int, Handle) -> c_int;
    allgather: "MPI_Allgather", fn(*const c_void, c_int, Handle, *mut c_void, c_int, Handle, Handle) -> c_int;
    alltoall: "MPI_Alltoall", fn(*const c_void, c_int, Handle, *mut c_void, c_int, Handle, Handle) -> c_int;
}

/// `MPI_Comm_split_type`.
pub(super) type SplitType =
    unsafe extern "C" fn(Handle, c_int, c_int, Handle, *mut Handle) -> c_int;
/// `MPI_Comm_split`.
pub(super) type Split = unsafe extern "C" fn(Handle, c_int, c_int, *mut Handle) -> c_int;
/// `MPI_Query_thread`, `MPI_Is_thread_main` and `MPI_Finalized`.
pub(super) type Query = unsafe extern "C" fn(*mut c_int) -> c_int;
/// `MPI_Comm_test_inter`.
pub(super) type TestInter = unsafe extern "C" fn(Handle, *mut c_int) -> c_int;
/// `MPI_Comm_f2c`; the integers of Fortran have 32 bits in all three ABIs.
pub(super) type FromFortran = unsafe extern "C" fn(c_int) -> Handle;
/// `MPI_Comm_free`.
pub(super) type CommFree = unsafe extern "C" fn(*mut Handle) -> c_int;

/// A loaded library whose ABI is known.
pub(crate) struct Mpi {
    pub(crate) functions: Functions,
    pub(crate) abi: Abi,
    pub(super) constants: Constants,
    /// The library's version text.
    pub(crate) version: String,
    /// `MPI_COMM_WORLD`.
    pub(crate) world: Handle,
    /// `MPI_BYTE`.
    pub(crate) byte: Handle,
    pub(crate) request_null: Handle,
    pub(super) errors_return: Handle,
    /// `MPI_INFO_NULL`.
    pub(super) info_null: Handle,
    /// Functions of MPI 3, which old libraries lack.
    pub(super) split_type: Option<SplitType>,
    pub(super) comm_free: Option<CommFree>,
    // What a surrounding program's communicator needs besides.
    pub(super) comm_null: Handle,
    pub(super) split: Option<Split>,
    pub(super) query_thread: Option<Query>,
    pub(super) is_thread_main: Option<Query>,
    pub(super) finalized: Option<Query>,
    pub(super) test_inter: Option<TestInter>,
    pub(super) comm_from_fortran: Option<FromFortran>,
    // Last, so that nothing outlives it; never unloaded in practice, because MPI libraries leave
    // threads behind.
    _library: std::mem::ManuallyDrop<Library>,
}

impl Mpi {
    /// The MPI that is already in the process (linked, or SMPI around it), otherwise that of the
    /// launcher.
    pub(super) fn load() -> Result<Self, MpiError> {
        let this = Library::this();
        if has(&this, "MPI_Init") {
            return Self::of(this, "this program");
        }
        let choice = launcher::choose(launcher::variable)?;
        // Global, because Open MPI's plug-ins look for its symbols there.
        let (library, name) = open_first(&choice, RTLD_NOW | RTLD_GLOBAL)?;
        Self::of(library, &name)
    }

    /// The MPI that the surrounding program has started: that of the process, also where a plug-in
    /// of the program (a Python module) has loaded it for itself.
    pub(super) fn load_started() -> Result<Self, MpiError> {
        let this = Library::this();
        if has(&this, "MPI_Init") {
            return Self::of(this, "this program");
        }
        #[cfg(target_os = "linux")]
        for name in launcher::loaded_names() {
            // SAFETY: the library is there already, or nothing is loaded.
            if let Ok(library) = unsafe { Library::open(Some(name), RTLD_NOW | RTLD_NOLOAD) } {
                return Self::of(library, name);
            }
        }
        Self::load()
    }

    fn of(library: Library, name: &str) -> Result<Self, MpiError> {
        let functions = Functions::of(&library, name)?;
        let version = version_of(&functions);
        let abi = Abi::of_version(&version)?;
        let address = |symbol: &str| -> Result<usize, MpiError> {
            // SAFETY: only the symbol's address is taken.
            let found = unsafe { library.get::<*const c_void>(symbol.as_bytes()) };
            let found = found.map_err(|_| MpiError::MissingSymbol {
                library: name.to_string(),
                symbol: symbol.to_string(),
            })?;
            Ok(found.into_raw() as usize)
        };
        let (world, byte, request_null, errors_return, info_null) = match abi {
            Abi::OpenMpi => (
                address("ompi_mpi_comm_world")?,
                address("ompi_mpi_byte")?,
                address("ompi_request_null")?,
                address("ompi_mpi_errors_return")?,
                address("ompi_mpi_info_null")?,
            ),
            Abi::Mpich => (0x4400_0000, 0x4c00_010d, 0x2c00_0000, 0x5400_0001, 0x1c00_0000),
            // The variable's address for now; `started` reads the handle.
            Abi::Smpi => {
                let (byte, handler) =
                    (address("smpi_MPI_BYTE")?, address("smpi_MPI_ERRORS_RETURN")?);
                (address("MPI_COMM_WORLD")?, byte, 0, handler, 0)
            }
        };
        let constants = abi.constants();
        // SAFETY: the MPI standard fixes these functions' arguments, with handles as in
        // `Functions`.
        let (split_type, comm_free, split, test_inter, comm_from_fortran) = unsafe {
            (
                library.get::<SplitType>(b"MPI_Comm_split_type").ok().map(|symbol| *symbol),
                library.get::<CommFree>(b"MPI_Comm_free").ok().map(|symbol| *symbol),
                library.get::<Split>(b"MPI_Comm_split").ok().map(|symbol| *symbol),
                library.get::<TestInter>(b"MPI_Comm_test_inter").ok().map(|symbol| *symbol),
                library.get::<FromFortran>(b"MPI_Comm_f2c").ok().map(|symbol| *symbol),
            )
        };
        let query = |name: &[u8]| {
            // SAFETY: as above; all of them take a pointer to an int.
            unsafe { library.get::<Query>(name) }.ok().map(|symbol| *symbol)
        };
        let (query_thread, is_thread_main, finalized) =
            (query(b"MPI_Query_thread"), query(b"MPI_Is_thread_main"), query(b"MPI_Finalized"));
        let comm_null = match abi {
            Abi::OpenMpi => address("ompi_mpi_comm_null")?,
            Abi::Mpich => 0x0400_0000,
            Abi::Smpi => 0,
        };
        let library = std::mem::ManuallyDrop::new(library);
        Ok(Self {
            functions,
            abi,
            constants,
            version,
            world,
            byte,
            request_null,
            errors_return,
            info_null,
            split_type,
            comm_free,
            comm_null,
            split,
            query_thread,
            is_thread_main,
            finalized,
            test_inter,
            comm_from_fortran,
            _library: library,
        })
    }

    /// Call this once, after MPI was started: SMPI sets the variable of its world then.
    pub(super) fn started(&mut self) {
        if self.abi == Abi::Smpi {
            // SAFETY: the address of SMPI's variable of type MPI_Comm, a pointer, which lives as
            // long as the process.
            self.world = unsafe { (self.world as *const Handle).read() };
        }
    }

    /// The error of a call, if it has one.
    pub(super) fn checked(&self, call: &str, code: c_int) -> Result<(), MpiError> {
        match code {
            0 => Ok(()),
            _ => Err(MpiError::Call { call: call.to_string(), reason: self.error_text(code) }),
        }
    }

    /// The library's text for an error code.
    pub(crate) fn error_text(&self, code: c_int) -> String {
        let mut text = vec![0_u8; 8192];
        let mut length = 0;
        // SAFETY: the buffer is longer than MPI_MAX_ERROR_STRING of every ABI here (512 at most).
        unsafe { (self.functions.error_string)(code, text.as_mut_ptr().cast(), &raw mut length) };
        let length = usize::try_from(length).unwrap_or(0).min(text.len());
        let text =
            String::from_utf8_lossy(&text[..length]).trim_end_matches('\0').trim().to_string();
        if text.is_empty() { format!("error {code}") } else { text }
    }

    /// `MPI_IN_PLACE`.
    #[cfg(feature = "icet")]
    pub(crate) fn in_place(&self) -> *const c_void {
        self.constants.in_place as *const c_void
    }

    /// Waits for one of `requests` and returns its index; `None` if all are null.
    pub(crate) fn wait_any_of(&self, requests: &[Handle]) -> Option<usize> {
        let mut index: c_int = -1;
        let count = requests.len() as c_int;
        let (mut wide, mut narrow) = (Vec::new(), Vec::<u32>::new());
        let array: *mut c_void = if self.constants.request_bytes == 4 {
            narrow.extend(requests.iter().map(|&request| request as u32));
            narrow.as_mut_ptr().cast()
        } else {
            wide.extend_from_slice(requests);
            wide.as_mut_ptr().cast()
        };
        // SAFETY: `count` requests or nulls in an array of the ABI's width. Undefined is negative
        // in every ABI.
        unsafe { (self.functions.wait_any)(count, array, &raw mut index, self.status_ignore()) };
        usize::try_from(index).ok().filter(|&index| index < requests.len())
    }

    /// The status argument of calls whose status is not used.
    pub(crate) fn status_ignore(&self) -> *mut Status {
        self.constants.status_ignore as *mut Status
    }
}

fn has(library: &Library, symbol: &str) -> bool {
    // SAFETY: only the presence of the symbol is asked for.
    unsafe { library.get::<*const c_void>(symbol.as_bytes()) }.is_ok()
}

fn version_of(functions: &Functions) -> String {
    let mut text = vec![0_u8; 16384];
    let mut length = 0;
    // SAFETY: allowed before MPI_Init (MPI 3.1, section 8.1.1); the buffer is longer than
    // MPI_MAX_LIBRARY_VERSION_STRING (8192).
    unsafe { (functions.library_version)(text.as_mut_ptr().cast(), &raw mut length) };
    let length = text.iter().position(|&byte| byte == 0).unwrap_or(0);
    String::from_utf8_lossy(&text[..length]).into_owned()
}

fn open_first(choice: &Choice, flags: c_int) -> Result<(Library, String), MpiError> {
    let mut tried = Vec::new();
    for name in &choice.libraries {
        // SAFETY: loading an MPI library runs its initialisers, which expect no more than a
        // process.
        match unsafe { Library::open(Some(name), flags) } {
            Ok(library) => return Ok((library, name.clone())),
            Err(error) => tried.push(error.to_string()),
        }
    }
    Err(MpiError::NoLibrary { reason: choice.reason.clone(), tried: tried.join("; ") })
}

/// The name and version text of the first library of `names` that can be loaded, and its ABI if
/// known. For `composite doctor`: nothing is started.
///
/// # Errors
/// [`MpiError::NoLibrary`] or [`MpiError::MissingSymbol`].
pub fn inspect(names: &[&str]) -> Result<(String, String, Result<Abi, MpiError>), MpiError> {
    let choice = Choice {
        libraries: names.iter().map(ToString::to_string).collect(),
        reason: "looked for by name".to_string(),
    };
    let (library, name) = open_first(&choice, RTLD_NOW | RTLD_LOCAL)?;
    let functions = Functions::of(&library, &name)?;
    let version = version_of(&functions);
    std::mem::forget(library);
    let abi = Abi::of_version(&version);
    Ok((name, version, abi))
}
