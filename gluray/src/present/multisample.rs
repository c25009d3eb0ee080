//! Traces multisampled framebuffers. Each sample has its own rays and is written separately through
//! the sample mask. The driver resolves the samples as usual.
//!
//! Sample positions are the driver's (`glGetMultisamplefv`). The scene is shifted so that the
//! sample lies at the centre of its pixel. Rays, coverage by the fill rule and depths then work as
//! usual. Colours are those of the pixel's centre, because the driver shades once for all samples
//! of a triangle.

use crate::capture::draw::{Draw, Shading};
use crate::driver::gl;
use crate::state::snapshot::DriverCapabilities;
use std::sync::Arc;

/// More samples than any driver supports.
const MOST_SAMPLES: i32 = 32;

/// The draw, shifted by part of a pixel to the left and down.
pub(crate) fn moved(draw: &Draw, [x, y]: [f32; 2]) -> Draw {
    let mut draw = draw.clone();
    let [_, _, w, h] = draw.state.viewport.map(|v| v as f32);
    let (dx, dy) = (-2.0 * x / w, -2.0 * y / h);
    let shift = |m: &mut [f32; 16]| {
        for column in m.chunks_exact_mut(4) {
            column[0] += dx * column[3];
            column[1] += dy * column[3];
        }
    };
    shift(&mut draw.clip_from_object);
    let mut state = (*draw.state).clone();
    shift(&mut state.projection);
    state.sample_place = [x, y];
    draw.state = Arc::new(state);
    if let Shading::Program(p) = &mut draw.shading {
        shift(&mut Arc::make_mut(p).clip_from_object);
    }
    draw
}

/// The number of samples of the framebuffer of `draws`. `None` for a single sample, and where
/// samples cannot be written separately: before OpenGL 3.2 there is no sample mask.
pub(crate) fn separate_samples<'a>(
    draws: impl IntoIterator<Item = &'a Draw>,
    capabilities: &DriverCapabilities,
) -> Option<u32> {
    let mut all = draws.into_iter().map(|d| d.state.samples);
    let n = all.next()?;
    let separate = (2..=MOST_SAMPLES).contains(&n)
        && all.all(|m| m == n)
        && capabilities.version >= 32
        && !capabilities.es;
    separate.then_some(n.cast_unsigned())
}

/// The positions of the framebuffer's samples, relative to the pixel centre.
pub(crate) fn places(samples: u32) -> Vec<[f32; 2]> {
    (0..samples).map(|i| gl::sample_place(i).map(|v| v - 0.5)).collect()
}

/// The draw for each sample, with the number of the sample.
pub(crate) fn each_sample(draw: &Draw, places: &[[f32; 2]]) -> Vec<(Draw, Option<u32>)> {
    places.iter().enumerate().map(|(i, p)| (moved(draw, *p), Some(i as u32))).collect()
}
