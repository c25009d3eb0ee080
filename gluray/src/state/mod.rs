//! OpenGL's state at a draw.
//!
//! The driver keeps all state. When a draw comes, it is asked for what may have changed since it
//! was asked last ([`StateCache`], `snapshot`). Only the attributes that change from vertex to
//! vertex are kept here (`current_attributes`).

pub(crate) mod current_attributes;
pub(crate) mod material;
pub(crate) mod material_properties;
pub(crate) mod matrix;
pub(crate) mod snapshot;
pub(crate) mod texture_sampling;

use crate::calls::class;
use crate::enums::{BACK, BACK_LEFT};
use snapshot::{DriverCapabilities, Snapshot};
use std::sync::Arc;

/// What is known of the driver's state.
pub(crate) struct StateCache {
    /// The classes of state to ask the driver about again.
    pub(crate) dirty: u8,
    /// The driver's last answers.
    pub(crate) snapshot: Arc<Snapshot>,
}

impl Default for StateCache {
    fn default() -> StateCache {
        StateCache { dirty: class::ALL, snapshot: Arc::default() }
    }
}

impl StateCache {
    /// True when the program draws to the window's front buffer.
    pub(crate) fn draws_to_front(&self) -> bool {
        self.snapshot.draw_buffer != BACK
            && self.snapshot.draw_buffer != BACK_LEFT
            && self.snapshot.framebuffer == 0
    }

    /// The driver's current attributes are undefined after its draws of arrays.
    pub(crate) fn mark_current(&mut self, capabilities: &DriverCapabilities) {
        if !capabilities.core {
            self.dirty |= class::CURRENT;
        }
    }
}
