//! Traces multisampled framebuffers. Each sample has its own rays and is written separately through
//! the sample mask. The driver resolves the samples as usual.
//!
//! Sample positions are the driver's (`glGetMultisamplefv`). The scene is shifted so that the
//! sample lies at the centre of its pixel. Rays, coverage by the fill rule and depths then work as
//! usual. Colours are those of the pixel's centre, because the driver shades once for all samples
//! of a triangle.

use crate::capture::draw::{Draw, Shading};
use crate::host::config::Settings;
use crate::interpose::context::Context;
use crate::interpose::driver::gl;
use crate::present::frame::Pending;
use crate::present::framebuffer_pass::CompositeMode;
use crate::present::pipelined;
use crate::trace::thread_pool;
use std::sync::Arc;

/// More samples than any driver supports.
const MOST_SAMPLES: i32 = 32;

/// The draw, shifted by part of a pixel to the left and down.
fn moved(draw: &Draw, [x, y]: [f32; 2]) -> Draw {
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

impl Context {
    /// The sample positions of the framebuffer of `draws`, relative to the pixel centre. `None` for
    /// a single sample, and where samples cannot be written separately: before OpenGL 3.2 there is
    /// no sample mask.
    pub(crate) fn sample_places<'a>(
        &mut self,
        draws: impl IntoIterator<Item = &'a Draw>,
    ) -> Option<Vec<[f32; 2]>> {
        let mut all = draws.into_iter().map(|d| d.state.samples);
        let n = all.next()?;
        if !(2..=MOST_SAMPLES).contains(&n)
            || all.any(|m| m != n)
            || self.capabilities.version < 32
            || self.capabilities.es
        {
            return None;
        }
        self.keep_errors();
        let places = (0..n as u32).map(|i| gl::sample_place(i).map(|v| v - 0.5)).collect();
        self.drop_errors();
        Some(places)
    }

    /// Traces the pending draws for each sample separately.
    pub(crate) fn flush_samples(&mut self, pending: &[Pending], func: u32, places: &[[f32; 2]]) {
        // The samples already provide the requested number of rays.
        let settings = &Settings { samples: 1, ..self.config.settings.clone() };
        for (i, place) in places.iter().enumerate() {
            let draws: Vec<Pending> =
                pending.iter().map(|(d, image)| (moved(d, *place), image.clone())).collect();
            if crate::present::effect_image::is_needed(settings) {
                self.draw_effect_image(&draws, func, settings, Some(i as u32));
                continue;
            }
            let traced = thread_pool::on_pool(|| pipelined::trace(draws, settings));
            self.present_traced(traced, CompositeMode::Surface(func), Some(i as u32));
        }
    }

    /// The same for a draw whose order matters.
    pub(crate) fn each_sample(draw: &Draw, places: &[[f32; 2]]) -> Vec<(Draw, Option<u32>)> {
        places.iter().enumerate().map(|(i, p)| (moved(draw, *p), Some(i as u32))).collect()
    }
}
