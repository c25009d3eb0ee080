//! Why pending draws are presented.

use crate::calls::{self, at};

/// What comes next, so that the pending draws must be in the framebuffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FlushReason {
    /// This call of the program.
    Call(usize),
    /// A draw of the driver's in a state in which the order of draws matters.
    DriverDraw,
    /// A display list of the driver's.
    DriverList,
    /// A traced draw in a state in which the order of draws matters.
    OrderedDraw,
    /// A draw with another number of samples a pixel.
    OtherSamples,
    /// A clear of less than all that the pending draws cover.
    PartialClear,
    /// Another context.
    ContextSwitch,
    /// The end of the tracing, after a fault of ours.
    Fault,
}

impl FlushReason {
    /// The reason in the words of a report.
    pub(crate) fn text(self) -> &'static str {
        match self {
            FlushReason::Call(index) => calls::name(index),
            FlushReason::DriverDraw => "a draw of the driver's whose order matters",
            FlushReason::DriverList => "a display list of the driver's",
            FlushReason::OrderedDraw => "a draw whose order matters",
            FlushReason::OtherSamples => "a draw with more or fewer samples",
            FlushReason::PartialClear => "glClear of a part",
            FlushReason::ContextSwitch => "context switch",
            FlushReason::Fault => "a fault of ours",
        }
    }

    /// True when the program or the driver may read the drawn pixels next.
    pub(crate) fn reads_pixels(self) -> bool {
        matches!(self, FlushReason::Call(index) if calls::reads_pixels(index))
    }

    /// True when VTK may be about to gather the layers that it has peeled: it draws them, or begins
    /// the query that counts their pixels.
    pub(crate) fn may_gather_layers(self) -> bool {
        matches!(self, FlushReason::Call(at::glBeginQuery) | FlushReason::DriverDraw)
    }
}
