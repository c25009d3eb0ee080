//! Errors of OpenGL: those of our own calls must not be seen, the program's must not be lost.

use crate::driver::gl;

/// More errors than a driver keeps flags for.
const MOST: usize = 8;

/// The program's errors that were taken from the driver before calls of our own, and those that
/// only we know of.
#[derive(Default)]
pub(crate) struct KeptErrors(Vec<u32>);

impl KeptErrors {
    /// Takes the driver's pending errors.
    pub(crate) fn keep(&mut self) {
        for _ in 0..MOST {
            match gl::get_error() {
                0 => return,
                e if self.0.contains(&e) => {}
                e => self.0.push(e),
            }
        }
    }

    /// Clears the errors of our own calls from the driver.
    pub(crate) fn drop_ours() {
        for _ in 0..MOST {
            if gl::get_error() == 0 {
                return;
            }
        }
    }

    /// Runs `f`, whose calls of the driver leave no error behind.
    pub(crate) fn hiding<R>(&mut self, f: impl FnOnce() -> R) -> R {
        self.keep();
        let r = f();
        KeptErrors::drop_ours();
        r
    }

    /// Adds an error of a call that the driver does not get.
    pub(crate) fn push(&mut self, error: u32) {
        self.0.push(error);
    }

    /// The oldest error, for the program. `None` means that the driver is to be asked.
    pub(crate) fn take(&mut self) -> Option<u32> {
        if self.0.is_empty() { None } else { Some(self.0.remove(0)) }
    }
}
