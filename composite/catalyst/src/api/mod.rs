//! Catalyst's functions: `libcatalyst` loads this library and calls them through
//! [`catalyst_api_impl`]. No panic leaves the library.
//!
//! They return 0, or what [`Status`] names. Reasons go to the standard error, because Catalyst has
//! no other way to the user: a simulation sees a number and mostly ignores it.
#![allow(unsafe_code, reason = "libcatalyst calls this library, and has Conduit's nodes")]

mod conduit;

use crate::node::Node;
use crate::session::{Session, SessionError, communicator};
use composite::comm::mpi::MpiComm;
use composite::{Communicator, threads};
use conduit::Conduit;
use std::cell::RefCell;
use std::ffi::{c_int, c_void};
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What a call returns: `catalyst_status_ok`, or a number above those of Catalyst.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Status {
    Ok = 0,
    /// What the simulation gives cannot be read.
    Params = 100,
    /// The file of settings.
    Settings = 101,
    /// MPI, or another rank has failed.
    Ranks = 102,
    /// Some of the step's pictures could not be made.
    Pictures = 103,
    /// `catalyst_initialize` was not called, or by another thread.
    NotInitialized = 104,
    /// `catalyst_initialize` was called twice.
    AlreadyInitialized = 105,
    /// An error of this library.
    Panic = 106,
}

/// A call of Catalyst with what the simulation gives.
type ReadCall = unsafe extern "C" fn(*const c_void) -> c_int;
/// A call of Catalyst that fills what the simulation gives.
type WriteCall = unsafe extern "C" fn(*mut c_void) -> c_int;

/// `struct catalyst_impl` of Catalyst 2 (`catalyst_impl.h`).
#[repr(C)]
#[derive(Debug)]
pub struct CatalystImpl {
    version: c_int,
    initialize: ReadCall,
    execute: ReadCall,
    finalize: ReadCall,
    about: WriteCall,
    results: WriteCall,
}

/// The symbol that `libcatalyst` looks for.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals, reason = "the name is Catalyst's")]
pub static catalyst_api_impl: CatalystImpl =
    CatalystImpl { version: 1, initialize, execute, finalize, about, results };

thread_local! {
    static SESSION: RefCell<Option<Session>> = const { RefCell::new(None) };
}

/// Why a call has failed.
struct Failure {
    status: Status,
    reason: String,
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Failure {
        let status = match error {
            SessionError::Settings(_) | SessionError::OtherSettings { .. } => Status::Settings,
            SessionError::Pictures { .. } => Status::Pictures,
            SessionError::Communicator => Status::Params,
            _ => Status::Ranks,
        };
        Failure { status, reason: error.to_string() }
    }
}

/// Runs a call; its failure is said, and becomes a number.
fn guarded(name: &str, call: impl FnOnce() -> Result<(), Failure>) -> c_int {
    let result = catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no text");
        let reason = format!("an error of this library, please report it: {text}");
        Err(Failure { status: Status::Panic, reason })
    });
    let Err(Failure { status, reason }) = result else { return Status::Ok as c_int };
    say(&format!("{name}: {reason}"));
    status as c_int
}

fn say(text: &str) {
    let mut out = std::io::stderr().lock();
    for line in text.lines() {
        let _ = writeln!(out, "catalyst-rtsv: {line}");
    }
}

fn conduit() -> Result<Conduit, Failure> {
    Conduit::of_process().map_err(|reason| Failure { status: Status::Params, reason })
}

/// Calls `f` with what the simulation gives.
///
/// # Safety
/// `params` is null or a node of Conduit, whose arrays are as it says and stay so during the call.
unsafe fn with_params<R>(
    params: *const c_void,
    f: impl FnOnce(&Node<'_>) -> Result<R, Failure>,
) -> Result<R, Failure> {
    if params.is_null() {
        return f(&Node::Empty);
    }
    // SAFETY: the caller's promise.
    let tree = unsafe { conduit()?.tree(params) };
    f(&tree.map_err(|reason| Failure { status: Status::Params, reason })?)
}

fn with_session<R>(f: impl FnOnce(&mut Session) -> Result<R, Failure>) -> Result<R, Failure> {
    let missing =
        |reason: &str| Failure { status: Status::NotInitialized, reason: reason.to_owned() };
    SESSION.with(|session| {
        let mut session =
            session.try_borrow_mut().map_err(|_| missing("another call has not returned"))?;
        let text = "catalyst_initialize was not called before, or by another thread";
        f(session.as_mut().ok_or_else(|| missing(text))?)
    })
}

/// Says what is new of a rank's warnings.
fn say_new_warnings(session: &mut Session) {
    let warnings = session.take_new_warnings();
    if session.is_quiet() {
        return;
    }
    for warning in warnings {
        say(&match session.ranks() {
            1 => format!("warning: {warning}"),
            _ => format!("rank {}: warning: {warning}", session.rank()),
        });
    }
}

unsafe extern "C" fn initialize(params: *const c_void) -> c_int {
    guarded("catalyst_initialize", || {
        let busy = SESSION.with(|s| s.try_borrow().map_or(true, |s| s.is_some()));
        if busy {
            let reason = "it was called before; call catalyst_finalize between".to_owned();
            return Err(Failure { status: Status::AlreadyInitialized, reason });
        }
        // SAFETY: Catalyst hands over the node of the simulation.
        let mut session = unsafe { with_params(params, |p| Ok(Session::new(p, ranks_of(p)?)?)) }?;
        say_new_warnings(&mut session);
        SESSION.with(|s| *s.borrow_mut() = Some(session));
        Ok(())
    })
}

unsafe extern "C" fn execute(params: *const c_void) -> c_int {
    guarded("catalyst_execute", || {
        with_session(|session| {
            // SAFETY: as above; what is borrowed of the arrays ends with the call.
            let done = unsafe { with_params(params, |p| Ok(session.execute(p)?)) };
            say_new_warnings(session);
            done
        })
    })
}

unsafe extern "C" fn finalize(_params: *const c_void) -> c_int {
    guarded("catalyst_finalize", || {
        with_session(|_| Ok(()))?;
        SESSION.with(|s| s.borrow_mut().take());
        Ok(())
    })
}

unsafe extern "C" fn about(params: *mut c_void) -> c_int {
    guarded("catalyst_about", || {
        let conduit = conduit()?;
        for (path, text) in [
            ("catalyst/implementation", "rtsv"),
            ("catalyst/version", env!("CARGO_PKG_VERSION")),
            ("catalyst/abi_version", "1"),
        ] {
            // SAFETY: Catalyst hands over a node that may be changed.
            unsafe { conduit.set_text(params, path, text) };
        }
        // SAFETY: as above.
        unsafe { conduit.set_integer(params, "catalyst/use_mpi", 1) };
        Ok(())
    })
}

unsafe extern "C" fn results(params: *mut c_void) -> c_int {
    guarded("catalyst_results", || {
        let conduit = conduit()?;
        with_session(|session| {
            for (k, file) in session.written().iter().enumerate() {
                let path = format!("catalyst/rtsv/files/{k}");
                // SAFETY: Catalyst hands over a node that may be changed.
                unsafe { conduit.set_text(params, &path, &file.display().to_string()) };
            }
            for (k, warning) in session.warnings().enumerate() {
                // SAFETY: as above.
                unsafe {
                    conduit.set_text(params, &format!("catalyst/rtsv/warnings/{k}"), warning);
                }
            }
            Ok(())
        })
    })
}

/// The ranks of the simulation: those of its communicator, or all; one where MPI does not run.
fn ranks_of(params: &Node<'_>) -> Result<Box<dyn Communicator>, SessionError> {
    let comm = match communicator(params)? {
        // SAFETY: the simulation says that it is a communicator of its MPI, and all its ranks call
        // catalyst_initialize with it.
        Some(handle) => Some(unsafe { MpiComm::from_fortran(handle) }?),
        None => MpiComm::of_program()?,
    };
    if let Some(comm) = comm {
        return Ok(Box::new(comm));
    }
    let alone = threads::group(1).into_iter().next();
    Ok(Box::new(alone.ok_or(SessionError::Communicator)?))
}
