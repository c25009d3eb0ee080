//! The names by which programs know objects.

use std::sync::atomic::{AtomicU64, Ordering};

/// The program's name for an object; 0 means no object. It is never a memory address and is never
/// reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Handle(pub u64);

impl Handle {
    /// No object.
    pub const NULL: Handle = Handle(0);

    /// A handle that no device of this process has used before.
    pub(crate) fn fresh() -> Handle {
        // Steps of 16 from a number that is not a small integer, so that programs that treat
        // handles as pointers see aligned ones.
        static NEXT: AtomicU64 = AtomicU64::new(0x1000);
        Handle(NEXT.fetch_add(16, Ordering::Relaxed))
    }
}
