//! Programs with shaders.

use crate::arrays::Elements;
use crate::capture::Attributes;
use crate::context::Context;
use crate::decide::Verdict;
use rt_core::mesh::TriMesh;

/// A program whose picture we can make, with its uniforms at one draw.
#[derive(Debug, Clone)]
pub(crate) struct Recognised {
    pub(crate) clip_from_object: [f32; 16],
}

impl Recognised {
    pub(crate) fn color(&self, _: &Attributes, _: &TriMesh, _: usize, _: [f32; 3], _: bool) -> [f32; 4] {
        [1.0; 4]
    }
}

/// The programs of a context.
#[derive(Default)]
pub(crate) struct Programs {}

impl Context {
    pub(crate) fn link_program(&mut self, _program: u32) -> bool {
        false
    }

    pub(crate) fn take_program_arrays(
        &mut self,
        _mode: u32,
        _elements: impl FnOnce() -> Result<Elements, &'static str>,
        _verdict: Verdict,
    ) -> Result<(), &'static str> {
        Err("a program that is not recognised")
    }
}
