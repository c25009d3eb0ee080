//! VTK's dual depth peeling (Bavoil and Myers 2008), which draws translucent surfaces six times or
//! more, as one draw of ours.
//!
//! The driver draws the first pass, which finds how far surfaces reach; the texture it makes is
//! also the depth of what is opaque. In the pass that would peel the first layers nothing is drawn:
//! all surfaces are traced, blended by depth, and put where VTK gathers the layers that are
//! nearest. It asks how many pixels that pass changed farther back, hears that there were none, and
//! is done. So all of VTK's own steps after that are right as they are.
//!
//! Only when every draw of the first pass was a surface that we know is anything taken out of the
//! second. Text, lines or volumes among them leave the whole to the driver.

use super::signature::TranslucencyPass;
use crate::capture::geometry_cache::BuildCounts;
use crate::classify::rules::{self, Classification};
use crate::host::config::Mode;
use crate::interpose::context::Context;
use crate::interpose::driver::gl;
use crate::present::frame::Pending;
use crate::present::framebuffer_pass::CompositeMode;
use crate::state::enums::*;
use crate::state::snapshot::Snapshot;
use crate::trace::thread_pool;
use crate::trace::{DepthLimits, Prepared, depth_sorted};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

/// Where VTK is with it.
#[derive(Default)]
pub(crate) struct DepthPeeling {
    /// Draws of the driver's when something was cleared last.
    at_clear: u64,
    /// Draws of the first pass so far that we know.
    depths: u64,
    /// Nothing else was in the first pass.
    whole: bool,
    /// What was taken out of the second pass, and the framebuffer it was drawn into.
    taken: Vec<Pending>,
    limit: Option<DepthLimits>,
    framebuffer: u32,
}

impl DepthPeeling {
    /// Something is cleared; the driver drew so many draws until now.
    pub(crate) fn cleared(&mut self, passed: u64) {
        if self.depths > 0 {
            // One draw copies the depths of what is opaque before surfaces come.
            self.whole = passed == self.at_clear + 1 + self.depths;
            self.depths = 0;
        }
        self.at_clear = passed;
    }

    pub(crate) fn has_draws(&self) -> bool {
        !self.taken.is_empty()
    }
}

impl Context {
    /// What becomes of a draw of a pass for translucency; the reason when the driver draws it.
    /// `Ok`: it is to be taken.
    pub(super) fn check_peeling_pass(
        &mut self,
        pass: TranslucencyPass,
    ) -> Result<(), &'static str> {
        const PEELED: &str = "translucent surfaces that VTK peels";
        if pass == TranslucencyPass::Weighted {
            return self.check_weighted_pass();
        }
        let peeling = &mut self.classifier.programs.peeling;
        let settings = &self.config.settings;
        let traced =
            settings.enabled && matches!(settings.mode, Mode::Match | Mode::Phong | Mode::Rich);
        match pass {
            TranslucencyPass::No | TranslucencyPass::Weighted => Ok(()),
            TranslucencyPass::Depths => {
                if peeling.depths == 0 {
                    peeling.whole = false;
                }
                peeling.depths += 1;
                Err("depths of translucent surfaces that VTK peels")
            }
            TranslucencyPass::Layers => {
                let first = peeling.taken.is_empty();
                let here = self.state.snapshot.framebuffer;
                let untouched = self.counters.report.passed_draws == peeling.at_clear;
                let same = first || peeling.framebuffer == here;
                if !(traced && peeling.whole && untouched && same && here != 0) {
                    return Err(PEELED);
                }
                if first {
                    peeling.framebuffer = here;
                    peeling.limit = limit(self.state.snapshot.program);
                }
                if self.classifier.programs.peeling.limit.is_some() { Ok(()) } else { Err(PEELED) }
            }
        }
    }

    /// Whether a peeled surface can be traced: but for what peeling itself sets, its state is that
    /// of any surface.
    pub(super) fn check_peeled_surface(&self, state: &mut Snapshot) -> Result<(), &'static str> {
        (state.more_draw_buffers, state.blend, state.depth_test) = (false, false, true);
        (state.depth_mask, state.depth_func) = (true, LEQUAL);
        match rules::classify(state, self.config.trace()) {
            Classification::Trace => Ok(()),
            Classification::Pass(why) | Classification::TraceIfOpaque(why) => Err(why),
            Classification::TraceInOrder => Err("a peeled surface whose order matters"),
        }
    }

    /// Takes a draw out of the pass.
    pub(super) fn take_peeled(&mut self, mut draw: crate::capture::draw::Draw) {
        crate::trace::overrides::apply(&mut draw, &self.config.settings);
        self.counters.report.traced_draws += draw.calls;
        self.counters.report.triangles += draw.geometry.mesh.num_triangles() as u64;
        self.classifier.programs.peeling.taken.push((draw, None));
    }

    /// VTK is about to gather what the pass has peeled.
    pub(crate) fn composite_peeled(&mut self) {
        let mut taken = std::mem::take(&mut self.classifier.programs.peeling.taken);
        let limit = self.classifier.programs.peeling.limit.take();
        self.classifier.programs.peeling.whole = false;
        self.refresh();
        let Some(limit) = limit else { return };
        self.presentation.frame.record_peeled(self.counters.report.frames + 1, &taken);
        self.counters.count_flush("depth peeling");
        let buffers = [0, 1, 2, 3].map(|i| gl::word(DRAW_BUFFER0 + i));
        let there = match buffers {
            // What is farthest back: gathered there from layer to layer, blended over.
            [back, 0, ..] => Some((vec![back], vec![back])),
            // Nothing was gathered yet, and what is nearest is the second of three.
            [a, front, c, 0] => Some((vec![front], vec![a, front, c])),
            _ => None,
        };
        let same = self.state.snapshot.framebuffer == self.classifier.programs.peeling.framebuffer;
        let Some((target, before)) = there.filter(|_| same) else {
            self.counters.warn(
                "depth peeling did not go as VTK's does: translucent surfaces are lost".into(),
            );
            return;
        };
        let start = Instant::now();
        if self.config.settings.mode != Mode::Match {
            crate::trace::view::assign_eye_spaces(&mut taken);
        }
        let settings = &self.config.settings;
        let (layer, rays, structures) = thread_pool::on_pool(|| {
            let mut structures = BuildCounts::default();
            let ready: Vec<Prepared<'_>> =
                taken.iter().filter_map(|(d, _)| Prepared::new(d, None, &mut structures)).collect();
            let (layer, extra) = depth_sorted(&ready, &limit, settings);
            let primary = ready.iter().map(|p| p.rays.load(Relaxed)).sum::<u64>();
            (layer, [primary, extra[0], extra[1]], structures)
        });
        self.counters.add_time("trace", start.elapsed());
        for (kind, n) in ["primary", "shadow", "ambient occlusion"].into_iter().zip(rays) {
            self.counters.add_rays(kind, n);
        }
        self.counters.count_builds(structures);
        self.counters.report.pixels += layer.covered as u64;
        let start = Instant::now();
        if layer.covered > 0 {
            gl::draw_buffers(&target);
            self.present(&[layer], CompositeMode::OverIgnoringDepth);
            gl::draw_buffers(&before);
        }
        self.counters.add_time("present", start.elapsed());
    }
}

/// How deep surfaces count: the second component of the texture that the first pass made.
fn limit(program: u32) -> Option<DepthLimits> {
    let at = gl::uniform_location(program, "lastDepthPeel");
    if at < 0 {
        return None;
    }
    let unit = gl::uniform_i::<1>(program, at)[0].max(0).cast_unsigned();
    let active = gl::word(ACTIVE_TEXTURE);
    gl::active_texture(TEXTURE0 + unit);
    let size = |what| gl::tex_level_i::<1>(TEXTURE_2D, 0, what)[0].max(0) as usize;
    let (width, height) = (size(TEXTURE_WIDTH), size(TEXTURE_HEIGHT));
    let fits = width * height > 0 && width * height <= 1 << 26;
    let depth = fits.then(|| {
        // However the program wants its own pixels packed.
        let texels = gl::with_raw_pixel_reads(|plainly| gl::tex_image_rgba(plainly, TEXTURE_2D, 0));
        texels.into_iter().map(|t| t[1]).collect::<Vec<f32>>()
    });
    let depth = depth.filter(|d| d.len() == width * height);
    gl::active_texture(active);
    Some(DepthLimits { width, height, depth: depth?, exact: false })
}
