//! Replaces VTK's translucency without peeling, weighted blended order-independent transparency
//! (McGuire and Bavoil 2013): all layers are summed in any order, and a pass of the program
//! divides.
//!
//! Rays find all layers in front of the opaque surfaces, as for depth peeling. Their sums go
//! through the program's own blending. So whatever the driver draws into the same sums (lines,
//! text, unknown surfaces) is added as usual.

use super::depth_peeling;
use crate::capture::draw::{Draw, TexturedDraw};
use crate::classify::rules::TraceFilter;
use crate::driver::gl;
use crate::enums::*;
use crate::host::config::{Mode, Settings};
use crate::state::snapshot::Snapshot;
use crate::trace::WeightedSums;

/// The draws that wait to be summed.
#[derive(Default)]
pub(crate) struct WeightedBlending {
    taken: Vec<TexturedDraw>,
    /// The program and textures of the pass that writes sums.
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

    /// Takes a draw.
    pub(super) fn take(&mut self, draw: Draw) {
        self.taken.push((draw, None));
    }

    /// The draws that wait to be summed.
    pub(crate) fn take_draws(&mut self) -> Vec<TexturedDraw> {
        std::mem::take(&mut self.taken)
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

/// Whether a draw into such sums can be taken; the reason when not.
pub(super) fn check_pass(
    s: &Snapshot,
    settings: &Settings,
    core: bool,
) -> Result<(), &'static str> {
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
        && core;
    if traced && s.blend && adds && two && tested && readable {
        Ok(())
    } else {
        Err("translucent surfaces that VTK sums up")
    }
}

/// Whether such a surface can be traced. Apart from what summing sets, its state must be that of
/// any traced surface.
pub(super) fn check_surface(state: &mut Snapshot, filter: TraceFilter) -> Result<(), &'static str> {
    state.unclamped_colors = false;
    depth_peeling::check_surface(state, filter)
}

impl WeightedBlending {
    /// Creates the objects. False when the driver refuses them.
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

    /// Adds sums to those in the framebuffer. False when the driver refuses the shader.
    pub(crate) fn add_sums(&mut self, sums: &WeightedSums, vertex_array: u32) -> bool {
        if !self.prepare(vertex_array) {
            return false;
        }
        gl::use_program(self.program);
        let r = sums.rect;
        let grow = r.w > self.size[0] || r.h > self.size[1];
        if grow {
            self.size = [r.w.max(self.size[0]), r.h.max(self.size[1])];
        }
        let formats = [(RGBA32F, RGBA), (R32F, RED)];
        let data: [&[u8]; 2] =
            [bytemuck::cast_slice(&sums.colors), bytemuck::cast_slice(&sums.weights)];
        for (unit, (inner, format)) in formats.into_iter().enumerate() {
            gl::active_texture(TEXTURE0 + unit as u32);
            gl::bind_texture(TEXTURE_2D, self.textures[unit]);
            if grow {
                gl::tex_image(inner.cast_signed(), self.size[0], self.size[1], format, FLOAT);
                for what in [TEXTURE_MIN_FILTER, TEXTURE_MAG_FILTER] {
                    gl::tex_parameteri(TEXTURE_2D, what, NEAREST.cast_signed());
                }
            }
            gl::tex_sub_image(r.w, r.h, format, FLOAT, data[unit]);
        }
        // The depths of all layers were compared already, and the program's blending stays.
        for off in [CULL_FACE, POLYGON_OFFSET_FILL, DEPTH_TEST, SCISSOR_TEST] {
            gl::disable(off);
        }
        gl::polygon_mode(FRONT_AND_BACK, FILL);
        gl::enable(BLEND);
        gl::blend_func_separate(ONE, ONE, ZERO, ONE_MINUS_SRC_ALPHA);
        gl::blend_equation(FUNC_ADD);
        gl::color_mask(1, 1, 1, 1);
        gl::bind_vertex_array(vertex_array);
        gl::viewport(r.x, r.y, r.w, r.h);
        gl::uniform4f(self.window, r.x as f32, r.y as f32, 0.0, 0.0);
        gl::draw_arrays(TRIANGLE_STRIP, 0, 4);
        true
    }
}
