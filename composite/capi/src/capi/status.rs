//! How a call ends: a status, and a text for each thread. No panic crosses the interface.

use super::types::*;
use composite::comm::mpi::MpiError;
use composite::render::FrameError;
use composite::{CommError, CompositeError};
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a call failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Failure {
    pub(crate) status: RtsvCompositeStatus,
    pub(crate) text: String,
}

impl Failure {
    pub(crate) fn new(status: RtsvCompositeStatus, text: impl Into<String>) -> Failure {
        Failure { status, text: text.into() }
    }

    pub(crate) fn value(text: impl Into<String>) -> Failure {
        Failure::new(RTSV_COMPOSITE_VALUE, text)
    }

    fn panic(panic: &(dyn Any + Send)) -> Failure {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        let text = text.unwrap_or_else(|| "without a text".to_owned());
        Failure::new(
            RTSV_COMPOSITE_PANIC,
            format!("a fault of rtsv_composite itself (please report it): {text}"),
        )
    }
}

impl From<MpiError> for Failure {
    fn from(error: MpiError) -> Failure {
        Failure::new(RTSV_COMPOSITE_MPI, error.to_string())
    }
}

impl From<CommError> for Failure {
    fn from(error: CommError) -> Failure {
        Failure::new(RTSV_COMPOSITE_ENDED, error.to_string())
    }
}

impl From<CompositeError> for Failure {
    fn from(error: CompositeError) -> Failure {
        let status = match error {
            CompositeError::Comm(_) | CompositeError::Message { .. } => RTSV_COMPOSITE_ENDED,
            _ => RTSV_COMPOSITE_VALUE,
        };
        Failure::new(status, error.to_string())
    }
}

impl From<FrameError> for Failure {
    fn from(error: FrameError) -> Failure {
        let status = match error {
            FrameError::Contradiction { .. } | FrameError::RankScene { .. } => {
                RTSV_COMPOSITE_DISAGREE
            }
            FrameError::Render(_) | FrameError::Scene(_) => RTSV_COMPOSITE_VALUE,
            _ => RTSV_COMPOSITE_ENDED,
        };
        Failure::new(status, error.to_string())
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Text for C: a zero byte inside would end it early.
pub(crate) fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// Runs a call; its failure becomes a status, and its text that of this thread.
pub(crate) fn guarded(call: impl FnOnce() -> Result<(), Failure>) -> RtsvCompositeStatus {
    let result = caught(call);
    let Err(failure) = result else { return RTSV_COMPOSITE_OK };
    // At the end of a thread its text is gone, and the status alone remains.
    let _ = LAST_ERROR.try_with(|last| {
        if let Ok(mut last) = last.try_borrow_mut() {
            *last = c_text(&failure.text);
        }
    });
    failure.status
}

/// The result of `call`, with a panic as a failure.
pub(crate) fn caught<R>(call: impl FnOnce() -> Result<R, Failure>) -> Result<R, Failure> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| Err(Failure::panic(&*panic)))
}

/// Why the last call of this thread that failed did so; empty before. English, one line, UTF-8. It
/// belongs to the library until the next failure of this thread.
#[unsafe(no_mangle)]
pub extern "C" fn rtsv_composite_last_error() -> *const c_char {
    let text = |last: &RefCell<CString>| last.try_borrow().map(|last| last.as_ptr()).ok();
    LAST_ERROR.try_with(text).ok().flatten().unwrap_or(c"".as_ptr())
}

/// RTSV_COMPOSITE_VERSION of the library that runs.
#[unsafe(no_mangle)]
pub extern "C" fn rtsv_composite_library_version() -> u32 {
    RTSV_COMPOSITE_VERSION
}
