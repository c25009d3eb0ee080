//! VTK's translucency without peeling (weighted sums after McGuire and Bavoil 2013): each layer is
//! added up, whatever its order, and a pass of the program's divides.
//!
//! All layers before the opaque surfaces are found by rays, as for depth peeling, and their sums go
//! through the program's own blending: what the driver draws into the same sums (lines, text, what
//! is not known) is added as it would be.

use crate::capture::draw::Draw;
use crate::capture::geometry_cache::BuildCounts;
use crate::host::config::Mode;
use crate::interpose::context::Context;
use crate::interpose::driver::gl;
use crate::present::frame::Pending;
use crate::state::enums::*;
use crate::state::snapshot::Snapshot;
use crate::trace::thread_pool;
use crate::trace::{DepthLimits, Prepared, WeightedSums, weighted_sums};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

/// What waits to be summed.
#[derive(Default)]
pub(crate) struct WeightedBlending {
    taken: Vec<Pending>,
    /// Program and textures of the pass that writes sums.
    program: u32,
    window: i32,
    textures: [u32; 2],
    size: [i32; 2],
    failed: bool,
}

impl WeightedBlending {
    pub(crate) fn has_draws(&self) -> bool {
        !self.taken.is_empty()
    }
}

const VERTEX: &str = "#version 150
void main() {
    gl_Position = vec4(2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0, 0.0, 1.0);
}
";
const FRAGMENT: &str = "#version 150
uniform sampler2D colors, weights;
uniform vec4 window;
out vec4 sums[2];
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy - window.xy);
    vec4 weight = texelFetch(weights, at, 0);
    if (weight.r == 0.0) discard;
    sums[0] = texelFetch(colors, at, 0);
    sums[1] = weight;
}
";

impl Context {
    /// Whether a draw into such sums can be taken: the reason when not.
    pub(super) fn check_weighted_pass(&self) -> Result<(), &'static str> {
        let (s, settings) = (&self.state.snapshot, &self.config.settings);
        let traced =
            settings.enabled && matches!(settings.mode, Mode::Match | Mode::Phong | Mode::Rich);
        let adds = [BLEND_SRC_RGB, BLEND_DST_RGB, BLEND_SRC_ALPHA, BLEND_DST_ALPHA].map(gl::word)
            == [ONE, ONE, ZERO, ONE_MINUS_SRC_ALPHA]
            && [BLEND_EQUATION, BLEND_EQUATION_ALPHA].map(gl::word) == [FUNC_ADD; 2];
        let buffers = [0, 1, 2].map(|i| gl::word(DRAW_BUFFER0 + i));
        let two = buffers[0] != 0 && buffers[1] != 0 && buffers[2] == 0;
        let tested = s.depth_test && !s.depth_mask && matches!(s.depth_func, LESS | LEQUAL);
        let readable = s.framebuffer != 0
            && gl::word(READ_FRAMEBUFFER_BINDING) == s.framebuffer
            && s.samples <= 1
            && self.capabilities.core;
        if traced && s.blend && adds && two && tested && readable {
            Ok(())
        } else {
            Err("translucent surfaces that VTK sums up")
        }
    }

    /// Whether such a surface can be traced: but for what summing sets, its state is that of any.
    pub(super) fn check_weighted_surface(&self, state: &mut Snapshot) -> Result<(), &'static str> {
        state.unclamped_colors = false;
        self.check_peeled_surface(state)
    }

    /// Takes a draw.
    pub(super) fn take_weighted(&mut self, mut draw: Draw) {
        crate::trace::overrides::apply(&mut draw, &self.config.settings);
        self.counters.report.traced_draws += draw.calls;
        self.counters.report.triangles += draw.geometry.mesh.num_triangles() as u64;
        self.classifier.programs.weighted.taken.push((draw, None));
    }

    /// Adds what was taken to the framebuffer's sums.
    pub(crate) fn sum_weighted(&mut self) {
        let mut taken = std::mem::take(&mut self.classifier.programs.weighted.taken);
        self.presentation.frame.record_peeled(self.counters.report.frames + 1, &taken);
        self.counters.count_flush("translucent sums");
        if self.config.settings.mode != Mode::Match {
            crate::trace::view::assign_eye_spaces(&mut taken);
        }
        // As far as the viewport reaches, opaque surfaces hide what is behind them.
        let [x, y, w, h] = taken.first().map_or([0; 4], |(d, _)| d.state.viewport);
        let (width, height) = ((x + w).max(0) as usize, (y + h).max(0) as usize);
        if width * height == 0 || width * height > 1 << 26 {
            return;
        }
        self.keep_errors();
        let depth = gl::depths(width as i32, height as i32);
        self.drop_errors();
        let limit = DepthLimits { width, height, depth, exact: true };
        let start = Instant::now();
        let settings = &self.config.settings;
        let (sums, rays, structures) = thread_pool::on_pool(|| {
            let mut structures = BuildCounts::default();
            let ready: Vec<Prepared<'_>> =
                taken.iter().filter_map(|(d, _)| Prepared::new(d, None, &mut structures)).collect();
            let (sums, extra) = weighted_sums(&ready, &limit, settings);
            let primary = ready.iter().map(|p| p.rays.load(Relaxed)).sum::<u64>();
            (sums, [primary, extra[0], extra[1]], structures)
        });
        self.counters.add_time("trace", start.elapsed());
        for (kind, n) in ["primary", "shadow", "ambient occlusion"].into_iter().zip(rays) {
            self.counters.add_rays(kind, n);
        }
        self.counters.count_builds(structures);
        self.counters.report.pixels += sums.covered as u64;
        let start = Instant::now();
        if sums.covered > 0 {
            self.with_saved_state(|c| c.add_sums(&sums));
        }
        self.counters.add_time("present", start.elapsed());
    }

    fn add_sums(&mut self, sums: &WeightedSums) {
        if !self.classifier.programs.weighted.prepare(self.presentation.presenter.vertex_array()) {
            self.counters
                .count_driver_draws("the driver refuses our shader: what was traced is lost", 1);
            return;
        }
        let p = &mut self.classifier.programs.weighted;
        gl::use_program(p.program);
        let r = sums.rect;
        let grow = r.w > p.size[0] || r.h > p.size[1];
        if grow {
            p.size = [r.w.max(p.size[0]), r.h.max(p.size[1])];
        }
        let formats = [(RGBA32F, RGBA), (R32F, RED)];
        let data: [&[u8]; 2] =
            [bytemuck::cast_slice(&sums.colors), bytemuck::cast_slice(&sums.weights)];
        for (unit, (inner, format)) in formats.into_iter().enumerate() {
            gl::active_texture(TEXTURE0 + unit as u32);
            gl::bind_texture(TEXTURE_2D, p.textures[unit]);
            if grow {
                gl::tex_image(inner.cast_signed(), p.size[0], p.size[1], format, FLOAT);
                for what in [TEXTURE_MIN_FILTER, TEXTURE_MAG_FILTER] {
                    gl::tex_parameteri(TEXTURE_2D, what, NEAREST.cast_signed());
                }
            }
            gl::tex_sub_image(r.w, r.h, format, FLOAT, data[unit]);
        }
        // Depths were compared for each layer, and blending stays the program's.
        for off in [CULL_FACE, POLYGON_OFFSET_FILL, DEPTH_TEST, SCISSOR_TEST] {
            gl::disable(off);
        }
        gl::polygon_mode(FRONT_AND_BACK, FILL);
        gl::enable(BLEND);
        gl::blend_func_separate(ONE, ONE, ZERO, ONE_MINUS_SRC_ALPHA);
        gl::blend_equation(FUNC_ADD);
        gl::color_mask(1, 1, 1, 1);
        gl::bind_vertex_array(self.presentation.presenter.vertex_array());
        gl::viewport(r.x, r.y, r.w, r.h);
        gl::uniform4f(self.classifier.programs.weighted.window, r.x as f32, r.y as f32, 0.0, 0.0);
        gl::draw_arrays(TRIANGLE_STRIP, 0, 4);
    }
}

impl WeightedBlending {
    /// Makes the objects; false when the driver refuses them.
    fn prepare(&mut self, vertex_array: u32) -> bool {
        if self.program != 0 || self.failed || vertex_array == 0 {
            return self.program != 0 && vertex_array != 0;
        }
        let program = gl::create_program();
        for (kind, text) in [(VERTEX_SHADER, VERTEX), (FRAGMENT_SHADER, FRAGMENT)] {
            let shader = gl::create_shader(kind);
            gl::shader_source(shader, text);
            gl::compile_shader(shader);
            gl::attach_shader(program, shader);
            gl::delete_shader(shader);
        }
        gl::link_program(program);
        if gl::program_i::<1>(program, LINK_STATUS)[0] == 0 {
            self.failed = true;
            return false;
        }
        (self.program, self.window) = (program, gl::uniform_location(program, "window"));
        gl::use_program(program);
        gl::uniform1i(gl::uniform_location(program, "colors"), 0);
        gl::uniform1i(gl::uniform_location(program, "weights"), 1);
        self.textures = [gl::gen_texture(true), gl::gen_texture(true)];
        true
    }
}
