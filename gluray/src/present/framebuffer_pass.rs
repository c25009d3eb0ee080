//! Writes traced fragments into the program's framebuffer. The driver draws one triangle strip,
//! whose shader reads colour and depth from textures.
//!
//! The fragments pass the program's own depth test (and blending, stencil and logic operation for
//! draws whose order matters). The driver therefore composites them with everything that it drew
//! before and after, in any kind of framebuffer, without reading anything back.

use crate::driver::gl;
use crate::enums::*;
use crate::state::snapshot::DriverCapabilities;
use crate::trace::{Layer, Rect};

/// How fragments are composited with the framebuffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CompositeMode {
    /// Only the depth test, with this function: the nearest surfaces of a frame.
    Surface(u32),
    /// The same, with premultiplied colours composited over the framebuffer: several samples per
    /// pixel, or translucent surfaces.
    Over(u32),
    /// Multiplies the framebuffer by the colours, at fragments of this depth or behind it. No
    /// depths are written.
    Multiply,
    /// Like `Over`, but without writing depths: pixels whose centre shows no opaque surface.
    Fringe(u32),
    /// Premultiplied colours over the framebuffer, whatever the depths.
    OverIgnoringDepth,
    /// The program's complete state, for a draw whose order matters.
    AsDrawn,
}

/// The OpenGL objects of the pass.
#[derive(Default)]
pub(crate) struct Presenter {
    program: u32,
    /// The part of the textures that a layer uses.
    part: i32,
    textures: [u32; 2],
    size: [i32; 2],
    vertex_array: u32,
    support: PassSupport,
}

/// Internal format, format and type of the colour texture and the depth texture.
const FORMATS: [(u32, u32, u32); 2] = [(RGBA8, RGBA, UNSIGNED_BYTE), (R32F, RED, FLOAT)];

/// Whether the driver supports what the pass needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum PassSupport {
    #[default]
    NotYet,
    /// The shader is linked. No other object exists.
    Linked,
    /// All objects exist.
    Ready,
    Refused,
}

/// The reason for leaving draws to a driver that refuses this pass.
pub(crate) const REFUSED: &str = "the driver refuses our shader or its textures";

// A fragment's position in the layer comes from the corners, not from gl_FragCoord. For
// gl_FragCoord, Mesa keeps a constant that says whether rows are flipped. It does not update that
// constant when only a clear lies between a pass into a framebuffer object and one into the window.
const VERTEX_120: &str = "#version 120
uniform vec4 part;
varying vec2 at;
void main() {
    at = (0.5 * gl_Vertex.xy + 0.5) * part.xy;
    gl_Position = gl_Vertex;
}
";
const FRAGMENT_120: &str = "#version 120
uniform sampler2D colors, depths;
varying vec2 at;
void main() {
    float z = texture2D(depths, at).r;
    if (z > 1.5) discard;
    gl_FragDepth = z;
    gl_FragColor = texture2D(colors, at);
}
";
const VERTEX_150: &str = "#version 150
uniform vec4 part;
out vec2 at;
void main() {
    vec2 c = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    at = c * part.xy;
    gl_Position = vec4(2.0 * c - 1.0, 0.0, 1.0);
}
";
const FRAGMENT_150: &str = "#version 150
uniform sampler2D colors, depths;
in vec2 at;
out vec4 color;
void main() {
    float z = texelFetch(depths, ivec2(at), 0).r;
    if (z > 1.5) discard;
    gl_FragDepth = z;
    color = texelFetch(colors, ivec2(at), 0);
}
";

fn compile(kind: u32, text: &str) -> u32 {
    let shader = gl::create_shader(kind);
    gl::shader_source(shader, text);
    gl::compile_shader(shader);
    shader
}

impl Presenter {
    /// An empty vertex array of a core context; 0 elsewhere.
    pub(crate) fn vertex_array(&mut self) -> u32 {
        self.prepare(true);
        self.vertex_array
    }

    /// Compiles the shader and asks for the kinds of its textures, without changing what is
    /// current, bound or compiled into a list. The driver's words when it refuses.
    pub(crate) fn check_support(&mut self, core: bool) -> Result<(), String> {
        self.support = PassSupport::Refused;
        let (vertex, mut fragment) =
            if core { (VERTEX_150, FRAGMENT_150) } else { (VERTEX_120, FRAGMENT_120) };
        if crate::faults::is_asked_for("shader") {
            fragment = "#error refused, as GLURAY_INJECT_FAULT asks";
        }
        let program = gl::create_program();
        let shaders = [compile(VERTEX_SHADER, vertex), compile(FRAGMENT_SHADER, fragment)];
        for s in shaders {
            gl::attach_shader(program, s);
        }
        gl::link_program(program);
        let linked = gl::program_i::<1>(program, LINK_STATUS)[0] != 0;
        let words = if linked { String::new() } else { shaders.map(gl::shader_log).concat() };
        shaders.into_iter().for_each(gl::delete_shader);
        if !linked {
            gl::delete_program(program);
            return Err(words.split_whitespace().collect::<Vec<_>>().join(" "));
        }
        for (inner, format, kind) in FORMATS {
            if !gl::has_texture_format(inner.cast_signed(), format, kind) {
                gl::delete_program(program);
                return Err(format!("no textures of the internal format {inner:#06x}"));
            }
        }
        self.program = program;
        self.support = PassSupport::Linked;
        Ok(())
    }

    /// True until the driver has been asked for what the pass needs.
    pub(crate) fn is_unchecked(&self) -> bool {
        self.support == PassSupport::NotYet
    }

    /// True when the driver has refused the pass.
    pub(crate) fn is_refused(&self) -> bool {
        self.support == PassSupport::Refused
    }

    /// Makes the rest of the objects; false when the driver has refused the shader.
    fn prepare(&mut self, core: bool) -> bool {
        if self.support == PassSupport::NotYet {
            self.check_support(core).ok();
        }
        if self.support != PassSupport::Linked {
            return self.support == PassSupport::Ready;
        }
        self.part = gl::uniform_location(self.program, "part");
        gl::use_program(self.program);
        gl::uniform1i(gl::uniform_location(self.program, "colors"), 0);
        gl::uniform1i(gl::uniform_location(self.program, "depths"), 1);
        self.textures = [gl::gen_texture(core), gl::gen_texture(core)];
        if core {
            self.vertex_array = gl::gen_vertex_array();
        }
        self.support = PassSupport::Ready;
        true
    }

    /// Puts a layer into the textures, bound to units 0 and 1.
    fn upload(&mut self, layer: &Layer) {
        let grow = layer.rect.w > self.size[0] || layer.rect.h > self.size[1];
        if grow {
            self.size = [layer.rect.w.max(self.size[0]), layer.rect.h.max(self.size[1])];
        }
        let data: [&[u8]; 2] = [layer.color.as_flattened(), bytemuck::cast_slice(&layer.depth)];
        for (unit, (inner, format, kind)) in FORMATS.into_iter().enumerate() {
            gl::active_texture(TEXTURE0 + unit as u32);
            gl::bind_texture(TEXTURE_2D, self.textures[unit]);
            if grow {
                gl::tex_image(inner.cast_signed(), self.size[0], self.size[1], format, kind);
                for (what, value) in [
                    (TEXTURE_MIN_FILTER, NEAREST),
                    (TEXTURE_MAG_FILTER, NEAREST),
                    (TEXTURE_WRAP_S, CLAMP_TO_EDGE),
                    (TEXTURE_WRAP_T, CLAMP_TO_EDGE),
                ] {
                    gl::tex_parameteri(TEXTURE_2D, what, value.cast_signed());
                }
            }
            gl::tex_sub_image(layer.rect.w, layer.rect.h, format, kind, data[unit]);
        }
    }
}

/// The part of core state that the pass changes; in compatibility contexts the attribute stacks
/// keep the rest.
struct SavedState {
    program: i32,
    vertex_array: i32,
    unpack_buffer: i32,
    active: i32,
    textures: [i32; 2],
    samplers: [i32; 2],
    unpack: [i32; 6],
    caps: Vec<(u32, bool)>,
    depth_func: i32,
    depth_mask: i32,
    color_mask: [i32; 4],
    polygon_mode: i32,
    /// Sources and destinations of colour and alpha, and their equations.
    blend: [i32; 6],
    viewport: [i32; 4],
    depth_range: [f64; 2],
    core: bool,
    samplers_exist: bool,
}

const BLENDING: [u32; 6] = [
    BLEND_SRC_RGB,
    BLEND_DST_RGB,
    BLEND_SRC_ALPHA,
    BLEND_DST_ALPHA,
    BLEND_EQUATION,
    BLEND_EQUATION_ALPHA,
];
const UNPACK: [u32; 6] = [
    UNPACK_ALIGNMENT,
    UNPACK_ROW_LENGTH,
    UNPACK_SKIP_ROWS,
    UNPACK_SKIP_PIXELS,
    UNPACK_SWAP_BYTES,
    UNPACK_LSB_FIRST,
];
/// What must be off for our two triangles in every composite mode.
const OFF: [u32; 4] = [CULL_FACE, POLYGON_OFFSET_FILL, POLYGON_SMOOTH, RASTERIZER_DISCARD];
/// Per-fragment operations that only fragments in order meet.
const OPERATIONS: [u32; 3] = [BLEND, STENCIL_TEST, COLOR_LOGIC_OP];
/// The same of fixed function.
const LEGACY: [u32; 2] = [POLYGON_STIPPLE, VERTEX_PROGRAM_ARB];

impl SavedState {
    fn keep(core: bool, version: u32) -> SavedState {
        let samplers_exist = version >= 33;
        let mut textures = [0; 2];
        let mut samplers = [0; 2];
        let active = gl::int(ACTIVE_TEXTURE);
        for unit in 0..2 {
            gl::active_texture(TEXTURE0 + unit as u32);
            textures[unit] = gl::int(TEXTURE_BINDING_2D);
            samplers[unit] = if samplers_exist { gl::int(SAMPLER_BINDING) } else { 0 };
        }
        let caps = match core {
            true => [&OFF[..], &OPERATIONS, &[DEPTH_TEST, DEPTH_CLAMP, SCISSOR_TEST]].concat(),
            false => Vec::new(),
        };
        SavedState {
            program: gl::int(CURRENT_PROGRAM),
            vertex_array: if core { gl::int(VERTEX_ARRAY_BINDING) } else { 0 },
            unpack_buffer: if version >= 21 { gl::int(PIXEL_UNPACK_BUFFER_BINDING) } else { 0 },
            active,
            textures,
            samplers,
            unpack: UNPACK.map(gl::int),
            caps: caps.into_iter().map(|c| (c, gl::is_enabled(c))).collect(),
            depth_func: gl::int(DEPTH_FUNC),
            depth_mask: gl::int(DEPTH_WRITEMASK),
            color_mask: gl::ints(COLOR_WRITEMASK),
            polygon_mode: gl::int(POLYGON_MODE),
            blend: if core { BLENDING.map(gl::int) } else { [0; 6] },
            viewport: gl::ints(VIEWPORT),
            depth_range: gl::doubles(DEPTH_RANGE),
            core,
            samplers_exist,
        }
    }

    fn restore(&self) {
        for unit in 0..2 {
            gl::active_texture(TEXTURE0 + unit as u32);
            gl::bind_texture(TEXTURE_2D, self.textures[unit].cast_unsigned());
            if self.samplers_exist {
                gl::bind_sampler(unit as u32, self.samplers[unit].cast_unsigned());
            }
        }
        gl::active_texture(self.active.cast_unsigned());
        UNPACK.into_iter().zip(self.unpack).for_each(|(what, v)| gl::pixel_storei(what, v));
        if self.unpack_buffer != 0 {
            gl::bind_buffer(PIXEL_UNPACK_BUFFER, self.unpack_buffer.cast_unsigned());
        }
        gl::use_program(self.program.cast_unsigned());
        if self.core {
            gl::bind_vertex_array(self.vertex_array.cast_unsigned());
            self.caps
                .iter()
                .for_each(|(cap, on)| if *on { gl::enable(*cap) } else { gl::disable(*cap) });
            gl::depth_func(self.depth_func.cast_unsigned());
            gl::depth_mask(self.depth_mask as u8);
            let [r, g, b, a] = self.color_mask.map(|v| v as u8);
            gl::color_mask(r, g, b, a);
            gl::polygon_mode(FRONT_AND_BACK, self.polygon_mode.cast_unsigned());
            let [src, dst, src_alpha, dst_alpha, equation, equation_alpha] =
                self.blend.map(i32::cast_unsigned);
            gl::blend_func_separate(src, dst, src_alpha, dst_alpha);
            gl::blend_equation_separate(equation, equation_alpha);
            let [x, y, w, h] = self.viewport;
            gl::viewport(x, y, w, h);
            gl::depth_range(self.depth_range[0], self.depth_range[1]);
        }
    }
}

impl Presenter {
    /// Draws the layers over one another. False when the driver refuses the pass.
    pub(crate) fn present(
        &mut self,
        layers: &[Layer],
        composite_mode: CompositeMode,
        capabilities: &DriverCapabilities,
    ) -> bool {
        let prepared = self.prepare(capabilities.core);
        if prepared {
            self.draw_pass(layers, composite_mode, capabilities);
        }
        prepared
    }

    fn draw_pass(
        &mut self,
        layers: &[Layer],
        composite_mode: CompositeMode,
        capabilities: &DriverCapabilities,
    ) {
        let core = capabilities.core;
        gl::use_program(self.program);
        OFF.into_iter()
            .filter(|c| *c != RASTERIZER_DISCARD || capabilities.version >= 30)
            .for_each(gl::disable);
        if !core {
            (0..capabilities.clip_planes).for_each(|i| gl::disable(CLIP_PLANE0 + i));
            let vp = capabilities.arb_programs;
            LEGACY.into_iter().filter(|c| *c != VERTEX_PROGRAM_ARB || vp).for_each(gl::disable);
            if vp {
                gl::disable(FRAGMENT_PROGRAM_ARB);
            }
        }
        gl::polygon_mode(FRONT_AND_BACK, FILL);
        gl::depth_range(0.0, 1.0);
        if composite_mode == CompositeMode::Multiply {
            OPERATIONS.into_iter().for_each(gl::disable);
            if !core {
                gl::disable(ALPHA_TEST);
            }
            gl::disable(SCISSOR_TEST);
            gl::enable(BLEND);
            gl::blend_equation(FUNC_ADD);
            gl::blend_func(ZERO, SRC_COLOR);
            gl::enable(DEPTH_TEST);
            gl::depth_func(LEQUAL);
            gl::depth_mask(0);
            gl::color_mask(1, 1, 1, 0);
        }
        if composite_mode == CompositeMode::OverIgnoringDepth {
            OPERATIONS.into_iter().for_each(gl::disable);
            gl::disable(SCISSOR_TEST);
            gl::disable(DEPTH_TEST);
            gl::enable(BLEND);
            gl::blend_equation(FUNC_ADD);
            gl::blend_func(ONE, ONE_MINUS_SRC_ALPHA);
            gl::color_mask(1, 1, 1, 1);
        }
        if let CompositeMode::Surface(func)
        | CompositeMode::Over(func)
        | CompositeMode::Fringe(func) = composite_mode
        {
            OPERATIONS.into_iter().for_each(gl::disable);
            if !matches!(composite_mode, CompositeMode::Surface(_)) {
                gl::enable(BLEND);
                gl::blend_equation(FUNC_ADD);
                gl::blend_func(ONE, ONE_MINUS_SRC_ALPHA);
            }
            if !core {
                gl::disable(ALPHA_TEST);
            }
            // Scissors were those of each draw; their pixels are cut already.
            gl::disable(SCISSOR_TEST);
            gl::enable(DEPTH_TEST);
            gl::depth_func(func);
            gl::depth_mask(u8::from(!matches!(composite_mode, CompositeMode::Fringe(_))));
            gl::color_mask(1, 1, 1, 1);
        }
        if core {
            gl::bind_vertex_array(self.vertex_array);
        }
        for layer in layers {
            let Rect { x, y, w, h } = layer.rect;
            self.upload(layer);
            // One pixel of the viewport is one texel: the viewport is the rectangle itself.
            gl::viewport(x, y, w, h);
            let [wide, high] = [w as f32, h as f32];
            if core {
                gl::uniform4f(self.part, wide, high, 0.0, 0.0);
                gl::draw_arrays(TRIANGLE_STRIP, 0, 4);
            } else {
                gl::uniform4f(
                    self.part,
                    wide / self.size[0] as f32,
                    high / self.size[1] as f32,
                    0.0,
                    0.0,
                );
                gl::begin(TRIANGLE_STRIP);
                for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
                    gl::vertex4f(x, y, 0.0, 1.0);
                }
                gl::end();
            }
        }
    }
}

/// Runs `f` with plain unpacking of pixels, and restores the driver's state.
pub(crate) fn with_saved_state(capabilities: &DriverCapabilities, f: impl FnOnce()) {
    let core = capabilities.core;
    let kept = SavedState::keep(core, capabilities.version);
    if !core {
        gl::push_attrib(ALL_ATTRIB_BITS);
        gl::reset_pixel_transfer();
    }
    UNPACK.into_iter().for_each(|what| gl::pixel_storei(what, i32::from(what == UNPACK_ALIGNMENT)));
    if kept.unpack_buffer != 0 {
        gl::bind_buffer(PIXEL_UNPACK_BUFFER, 0);
    }
    if kept.samplers_exist {
        (0..2).for_each(|unit| gl::bind_sampler(unit, 0));
    }
    f();
    if !core {
        gl::pop_attrib();
    }
    kept.restore();
}
