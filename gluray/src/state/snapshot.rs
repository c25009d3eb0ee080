//! A snapshot of the state that decides how filled primitives look, as the driver reports it.

use crate::calls::class;
use crate::driver::gl;
use crate::enums::*;
use crate::state::texture_sampling::unsupported_sampling;

/// A light source. Positions and directions are in eye space, as OpenGL stores them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct GlLight {
    pub(crate) ambient: [f32; 4],
    pub(crate) diffuse: [f32; 4],
    pub(crate) specular: [f32; 4],
    pub(crate) position: [f32; 4],
    pub(crate) spot_direction: [f32; 3],
    pub(crate) spot_exponent: f32,
    pub(crate) spot_cutoff_deg: f32,
    pub(crate) attenuation: [f32; 3],
}

/// Fog.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Fog {
    pub(crate) mode: u32,
    pub(crate) density: f32,
    pub(crate) start: f32,
    pub(crate) end: f32,
    pub(crate) color: [f32; 4],
}

/// Texture unit 0, when it is the only one in use.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct TextureUnit {
    pub(crate) target: u32,
    pub(crate) name: u32,
    pub(crate) env_mode: u32,
    pub(crate) env_color: [f32; 4],
    /// Coordinate generation of s, t, r, q: mode (0 for none) and plane.
    pub(crate) generate: [(u32, [f32; 4]); 4],
    pub(crate) matrix: [f32; 16],
    /// The number of calls so far that may have changed a texture.
    pub(crate) version: u64,
}

/// The state at one draw.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Snapshot {
    pub(crate) model_view: [f32; 16],
    pub(crate) projection: [f32; 16],
    pub(crate) viewport: [i32; 4],
    /// The rows of the window, as far as viewports show.
    pub(crate) window_height: i32,
    pub(crate) depth_range: [f64; 2],
    pub(crate) cull: Option<u32>,
    pub(crate) front_is_ccw: bool,
    pub(crate) flat: bool,
    pub(crate) lighting: bool,
    pub(crate) lights: Vec<GlLight>,
    pub(crate) model_ambient: [f32; 4],
    pub(crate) two_side: bool,
    pub(crate) local_viewer: bool,
    pub(crate) separate_specular: bool,
    pub(crate) color_material: Option<(u32, u32)>,
    pub(crate) normalize: bool,
    pub(crate) rescale_normal: bool,
    pub(crate) fog: Option<Fog>,
    /// Eye-space planes.
    pub(crate) clip_planes: Vec<[f64; 4]>,
    pub(crate) polygon_offset: Option<(f32, f32)>,
    /// The slope that the factor multiplies is the length of the gradient, as in VTK's shaders.
    /// Otherwise it is the greater component, as in OpenGL.
    pub(crate) offset_by_length: bool,
    /// Points or lines are smoothed, or lines stippled.
    pub(crate) smooth_or_stippled: bool,
    /// Polygons of any mode are offset.
    pub(crate) any_offset: bool,
    pub(crate) depth_test: bool,
    pub(crate) depth_func: u32,
    pub(crate) depth_mask: bool,
    pub(crate) depth_clamp: bool,
    pub(crate) blend: bool,
    /// Blending leaves a fragment with alpha 1 unchanged.
    pub(crate) blend_is_over: bool,
    pub(crate) alpha_test: bool,
    /// A fragment with alpha 1 passes the alpha test.
    pub(crate) alpha_test_passes_one: bool,
    /// The alpha test compares with the reference itself, which eight bits may miss.
    pub(crate) alpha_test_of_equality: bool,
    pub(crate) stencil_test: bool,
    /// `glClipControl` has set another origin or depth range than the default.
    pub(crate) clip_control: bool,
    /// The colour buffer stores values below 0 or above 1.
    pub(crate) unclamped_colors: bool,
    /// Colours are encoded when they are written (`GL_FRAMEBUFFER_SRGB`).
    pub(crate) encoded_colors: bool,
    /// Front and back faces have different stencil masks.
    pub(crate) two_sided_stencil: bool,
    pub(crate) logic_op: bool,
    pub(crate) color_mask: bool,
    pub(crate) polygon_mode: [u32; 2],
    pub(crate) stipple: bool,
    pub(crate) smooth_polygons: bool,
    pub(crate) scissor: Option<[i32; 4]>,
    pub(crate) render_mode: u32,
    pub(crate) program: u32,
    pub(crate) arb_program: bool,
    /// A program pipeline is bound and no program is in use.
    pub(crate) pipeline: bool,
    pub(crate) framebuffer: u32,
    pub(crate) draw_buffer: u32,
    pub(crate) more_draw_buffers: bool,
    pub(crate) samples: i32,
    /// The position of the traced sample, relative to the pixel centre.
    pub(crate) sample_place: [f32; 2],
    /// Masks, coverage or alpha decide which samples are written.
    pub(crate) masked_samples: bool,
    pub(crate) discard: bool,
    pub(crate) feedback_active: bool,
    pub(crate) first_vertex_provokes: bool,
    pub(crate) color_sum: bool,
    pub(crate) list_base: u32,
    pub(crate) texture: Option<TextureUnit>,
    /// The reason why texturing cannot be reproduced.
    pub(crate) foreign_texturing: Option<&'static str>,
}

/// The capabilities of a context.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct DriverCapabilities {
    /// The version times ten.
    pub(crate) version: u32,
    /// There is no fixed function.
    pub(crate) core: bool,
    pub(crate) es: bool,
    pub(crate) texture_units: i32,
    pub(crate) clip_planes: u32,
    pub(crate) rectangle: bool,
    pub(crate) depth_clamp: bool,
    pub(crate) arb_programs: bool,
    pub(crate) ati_shaders: bool,
    pub(crate) clip_control: bool,
    pub(crate) stencil_two_side: bool,
    pub(crate) fog_distance: bool,
    pub(crate) pipelines: bool,
    pub(crate) double_buffered: bool,
}

impl DriverCapabilities {
    /// Asks the driver.
    pub(crate) fn query() -> DriverCapabilities {
        let text = gl::string(VERSION);
        let es = text.starts_with("OpenGL ES");
        let digits = text.trim_start_matches(|c: char| !c.is_ascii_digit());
        let mut parts = digits.split(|c: char| !c.is_ascii_digit());
        let mut next = || parts.next().and_then(|p| p.parse::<u32>().ok()).unwrap_or(0);
        let version = next() * 10 + next().min(9);
        let core = !es && version >= 32 && gl::int(CONTEXT_PROFILE_MASK) & 1 != 0;
        let legacy = !core && !es;
        let extensions = if legacy { gl::string(EXTENSIONS) } else { String::new() };
        let has = |e: &str| extensions.split(' ').any(|x| x == e);
        DriverCapabilities {
            version,
            core,
            es,
            texture_units: if legacy { gl::int(MAX_TEXTURE_UNITS).clamp(1, 8) } else { 0 },
            clip_planes: if legacy { gl::word(MAX_CLIP_PLANES).clamp(6, 32) } else { 0 },
            rectangle: has("GL_ARB_texture_rectangle"),
            depth_clamp: core || has("GL_ARB_depth_clamp"),
            arb_programs: has("GL_ARB_vertex_program") && has("GL_ARB_fragment_program"),
            ati_shaders: has("GL_ATI_fragment_shader"),
            clip_control: version >= 45 || has("GL_ARB_clip_control"),
            stencil_two_side: has("GL_EXT_stencil_two_side"),
            fog_distance: has("GL_NV_fog_distance"),
            pipelines: !es && (version >= 41 || has("GL_ARB_separate_shader_objects")),
            double_buffered: !es && gl::int(DOUBLEBUFFER) != 0,
        }
    }
}

impl Snapshot {
    /// Asks the driver again about the classes in `dirty`.
    pub(crate) fn refresh(&mut self, dirty: u8, capabilities: &DriverCapabilities) {
        if dirty & class::RASTER != 0 {
            self.raster(capabilities);
        }
        if capabilities.core {
            return;
        }
        if dirty & (class::MATRIX | class::RASTER) != 0 {
            self.model_view = gl::floats(MODELVIEW_MATRIX);
            self.projection = gl::floats(PROJECTION_MATRIX);
        }
        if dirty & (class::LIGHT | class::RASTER) != 0 {
            self.lighting();
        }
        if dirty & (class::TEXTURE | class::RASTER | class::MATRIX | class::LIGHT) != 0 {
            self.texturing(capabilities);
        }
    }

    fn raster(&mut self, capabilities: &DriverCapabilities) {
        self.viewport = gl::ints(VIEWPORT);
        self.depth_range = gl::doubles(DEPTH_RANGE);
        self.cull = gl::is_enabled(CULL_FACE).then(|| gl::word(CULL_FACE_MODE));
        self.front_is_ccw = gl::word(FRONT_FACE) == CCW;
        self.polygon_offset = gl::is_enabled(POLYGON_OFFSET_FILL).then(|| {
            (gl::floats::<1>(POLYGON_OFFSET_FACTOR)[0], gl::floats::<1>(POLYGON_OFFSET_UNITS)[0])
        });
        self.depth_test = gl::is_enabled(DEPTH_TEST);
        self.depth_func = gl::word(DEPTH_FUNC);
        self.depth_mask = gl::int(DEPTH_WRITEMASK) != 0;
        self.depth_clamp = capabilities.depth_clamp && gl::is_enabled(DEPTH_CLAMP);
        self.blend = gl::is_enabled(BLEND);
        self.blend_is_over = self.blend
            && gl::word(BLEND_SRC_RGB) == SRC_ALPHA
            && gl::word(BLEND_DST_RGB) == ONE_MINUS_SRC_ALPHA;
        if self.blend_is_over && capabilities.version >= 14 {
            self.blend_is_over = gl::word(BLEND_EQUATION) == FUNC_ADD;
        }
        self.stencil_test = gl::is_enabled(STENCIL_TEST);
        self.two_sided_stencil = self.stencil_test
            && (capabilities.stencil_two_side && gl::is_enabled(STENCIL_TEST_TWO_SIDE)
                || capabilities.version >= 20
                    && STENCIL_FRONT_AND_BACK
                        .iter()
                        .any(|(front, back)| gl::word(*front) != gl::word(*back)));
        self.logic_op = gl::is_enabled(COLOR_LOGIC_OP);
        self.color_mask = gl::ints::<4>(COLOR_WRITEMASK).iter().all(|v| *v != 0);
        self.polygon_mode = match capabilities.core {
            true => [gl::word(POLYGON_MODE); 2],
            false => gl::ints::<2>(POLYGON_MODE).map(i32::cast_unsigned),
        };
        self.scissor = gl::is_enabled(SCISSOR_TEST).then(|| gl::ints(SCISSOR_BOX));
        self.program = if capabilities.version >= 20 { gl::word(CURRENT_PROGRAM) } else { 0 };
        self.pipeline =
            capabilities.pipelines && self.program == 0 && gl::word(PROGRAM_PIPELINE_BINDING) != 0;
        self.framebuffer =
            if capabilities.version >= 30 { gl::word(FRAMEBUFFER_BINDING) } else { 0 };
        self.draw_buffer = gl::word(DRAW_BUFFER);
        self.clip_control = capabilities.clip_control
            && (gl::word(CLIP_ORIGIN) != LOWER_LEFT
                || gl::word(CLIP_DEPTH_MODE) != NEGATIVE_ONE_TO_ONE);
        self.unclamped_colors = self.framebuffer != 0
            && self.draw_buffer != 0
            && !matches!(gl::component_type(self.draw_buffer), UNSIGNED_NORMALIZED | 0);
        self.encoded_colors = capabilities.version >= 30 && gl::is_enabled(FRAMEBUFFER_SRGB);
        self.more_draw_buffers = capabilities.version >= 20 && gl::word(DRAW_BUFFER0 + 1) != 0;
        self.samples = match gl::int(SAMPLE_BUFFERS) != 0 && gl::is_enabled(MULTISAMPLE) {
            true => gl::int(SAMPLES),
            false => 0,
        };
        const MASKS: [u32; 4] =
            [SAMPLE_ALPHA_TO_COVERAGE, SAMPLE_ALPHA_TO_ONE, SAMPLE_COVERAGE, SAMPLE_MASK];
        self.masked_samples = self.samples > 1
            && MASKS
                .iter()
                .any(|c| (*c != SAMPLE_MASK || capabilities.version >= 32) && gl::is_enabled(*c));
        self.discard = capabilities.version >= 30 && gl::is_enabled(RASTERIZER_DISCARD);
        self.feedback_active =
            capabilities.version >= 40 && gl::int(TRANSFORM_FEEDBACK_ACTIVE) != 0;
        self.first_vertex_provokes =
            capabilities.version >= 32 && gl::word(PROVOKING_VERTEX) == FIRST_VERTEX_CONVENTION;
        self.smooth_polygons = gl::is_enabled(POLYGON_SMOOTH);
        if capabilities.core {
            return;
        }
        // A pattern without gaps is no stippling to Gallium.
        self.smooth_or_stippled = [POINT_SMOOTH, LINE_SMOOTH].into_iter().any(gl::is_enabled)
            || gl::is_enabled(LINE_STIPPLE) && gl::int(LINE_STIPPLE_PATTERN) & 0xffff != 0xffff;
        self.any_offset = [POLYGON_OFFSET_FILL, POLYGON_OFFSET_LINE, POLYGON_OFFSET_POINT]
            .into_iter()
            .any(gl::is_enabled);
        self.alpha_test = gl::is_enabled(ALPHA_TEST);
        self.alpha_test_passes_one = self.alpha_test && {
            let reference = gl::floats::<1>(ALPHA_TEST_REF)[0];
            match gl::word(ALPHA_TEST_FUNC) {
                GREATER | NOTEQUAL => reference < 1.0,
                GEQUAL | ALWAYS => true,
                EQUAL | LEQUAL => reference >= 1.0,
                _ => false,
            }
        };
        self.alpha_test_of_equality =
            self.alpha_test && matches!(gl::word(ALPHA_TEST_FUNC), EQUAL | NOTEQUAL);
        self.stipple = gl::is_enabled(POLYGON_STIPPLE);
        self.render_mode = gl::word(RENDER_MODE);
        self.arb_program = capabilities.arb_programs
            && (gl::is_enabled(VERTEX_PROGRAM_ARB) || gl::is_enabled(FRAGMENT_PROGRAM_ARB))
            || capabilities.ati_shaders && gl::is_enabled(FRAGMENT_SHADER_ATI);
        self.flat = gl::word(SHADE_MODEL) == FLAT;
        self.list_base = gl::word(LIST_BASE);
        self.normalize = gl::is_enabled(NORMALIZE);
        self.rescale_normal = capabilities.version >= 12 && gl::is_enabled(RESCALE_NORMAL);
        self.color_sum = capabilities.version >= 14 && gl::is_enabled(COLOR_SUM);
        self.clip_planes = (0..capabilities.clip_planes)
            .filter(|i| gl::is_enabled(CLIP_PLANE0 + i))
            .map(|i| gl::clip_plane(CLIP_PLANE0 + i))
            .collect();
        self.fog = gl::is_enabled(FOG).then(|| Fog {
            // Mode 0 stands for fog that the driver must draw: by coordinates, or by distances in
            // space (`GL_NV_fog_distance`, except its plain form).
            mode: match capabilities.version >= 14 && gl::word(FOG_COORD_SRC) == FOG_COORD
                || capabilities.fog_distance && gl::word(FOG_DISTANCE_MODE) != EYE_PLANE_ABSOLUTE
            {
                true => 0,
                false => gl::word(FOG_MODE),
            },
            density: gl::floats::<1>(FOG_DENSITY)[0],
            start: gl::floats::<1>(FOG_START)[0],
            end: gl::floats::<1>(FOG_END)[0],
            color: gl::floats(FOG_COLOR),
        });
    }

    /// True when the driver splits all quads from the second vertex to the fourth: with flat
    /// colours, and where llvmpipe hands primitives to Gallium's draw module. It does so as soon as
    /// points or lines would be smoothed or lines stippled, whatever is drawn, and the draw module
    /// takes polygons apart when it must offset them or choose a side's colour.
    pub(crate) fn turns_quads(&self) -> bool {
        let by_draw_module = self.any_offset || self.lighting && self.two_side;
        self.flat || self.smooth_or_stippled && by_draw_module
    }

    /// Returns whether points in object space are outside of the view volume, so that the driver
    /// must clip.
    pub(crate) fn clips(&self) -> impl Fn([f32; 3]) -> bool {
        let m = crate::state::matrix::product(&self.projection, &self.model_view);
        let (model_view, planes) = (self.model_view, self.clip_planes.clone());
        let depth_clamp = self.depth_clamp;
        move |p| {
            let [x, y, z, w] = crate::state::matrix::transform(&m, p);
            let beyond = |v: f32| v > w || v < -w;
            let cut = |plane: &[f64; 4]| {
                let eye = crate::state::matrix::transform(&model_view, p);
                eye.iter().zip(plane).map(|(a, b)| f64::from(*a) * b).sum::<f64>() < 0.0
            };
            beyond(x) || beyond(y) || (!depth_clamp && beyond(z)) || planes.iter().any(cut)
        }
    }

    fn lighting(&mut self) {
        self.lighting = gl::is_enabled(LIGHTING);
        self.color_material = gl::is_enabled(COLOR_MATERIAL)
            .then(|| (gl::word(COLOR_MATERIAL_FACE), gl::word(COLOR_MATERIAL_PARAMETER)));
        self.lights.clear();
        if !self.lighting {
            return;
        }
        self.model_ambient = gl::floats(LIGHT_MODEL_AMBIENT);
        self.two_side = gl::int(LIGHT_MODEL_TWO_SIDE) != 0;
        self.local_viewer = gl::int(LIGHT_MODEL_LOCAL_VIEWER) != 0;
        self.separate_specular = gl::word(LIGHT_MODEL_COLOR_CONTROL) == SEPARATE_SPECULAR_COLOR;
        self.lights.extend((0..8).map(|i| LIGHT0 + i).filter(|l| gl::is_enabled(*l)).map(|l| {
            GlLight {
                ambient: gl::light(l, AMBIENT),
                diffuse: gl::light(l, DIFFUSE),
                specular: gl::light(l, SPECULAR),
                position: gl::light(l, POSITION),
                spot_direction: gl::light(l, SPOT_DIRECTION),
                spot_exponent: gl::light::<1>(l, SPOT_EXPONENT)[0],
                spot_cutoff_deg: gl::light::<1>(l, SPOT_CUTOFF)[0],
                attenuation: [CONSTANT_ATTENUATION, LINEAR_ATTENUATION, QUADRATIC_ATTENUATION]
                    .map(|what| gl::light::<1>(l, what)[0]),
            }
        }));
    }

    fn texturing(&mut self, capabilities: &DriverCapabilities) {
        self.texture = None;
        self.foreign_texturing = None;
        let active = gl::word(ACTIVE_TEXTURE);
        let mut targets = vec![TEXTURE_1D, TEXTURE_2D, TEXTURE_3D, TEXTURE_CUBE_MAP];
        if capabilities.rectangle {
            targets.push(TEXTURE_RECTANGLE);
        }
        let units = capabilities.texture_units.max(1) as u32;
        for unit in 0..units {
            if units > 1 {
                gl::active_texture(TEXTURE0 + unit);
            }
            let enabled: Vec<u32> =
                targets.iter().copied().filter(|t| gl::is_enabled(*t)).collect();
            let Some(&target) = enabled.iter().max_by_key(|t| targets.iter().position(|x| x == *t))
            else {
                continue;
            };
            if unit > 0 {
                self.foreign_texturing = Some("several texture units");
            } else if target == TEXTURE_1D || target == TEXTURE_2D {
                self.texture = Some(unit_0(target));
                // The names say what is bound. The source of its image is queried when it is used.
                self.foreign_texturing =
                    self.foreign_texturing.or(unsupported_sampling(target, capabilities.version));
            } else {
                self.foreign_texturing = Some("a texture that is neither 1-D nor 2-D");
            }
        }
        if units > 1 {
            gl::active_texture(active);
        }
        if let Some(t) = &self.texture
            && ![MODULATE, REPLACE, DECAL, BLEND, ADD].contains(&t.env_mode)
        {
            self.foreign_texturing = Some("texture combiners");
        }
    }
}

/// Texture unit 0, which is active now.
fn unit_0(target: u32) -> TextureUnit {
    let generate = [TEXTURE_GEN_S, TEXTURE_GEN_T, TEXTURE_GEN_R, TEXTURE_GEN_Q];
    TextureUnit {
        target,
        name: gl::word(if target == TEXTURE_1D { TEXTURE_BINDING_1D } else { TEXTURE_BINDING_2D }),
        env_mode: gl::tex_env_i::<1>(TEXTURE_ENV, TEXTURE_ENV_MODE)[0].cast_unsigned(),
        env_color: gl::tex_env_f(TEXTURE_ENV, TEXTURE_ENV_COLOR),
        generate: std::array::from_fn(|i| {
            if !gl::is_enabled(generate[i]) {
                return (0, [0.0; 4]);
            }
            let coord = S + i as u32;
            let mode = gl::tex_gen_i::<1>(coord, TEXTURE_GEN_MODE)[0].cast_unsigned();
            let plane = if mode == EYE_LINEAR { EYE_PLANE } else { OBJECT_PLANE };
            (mode, gl::tex_gen_f(coord, plane))
        }),
        matrix: gl::floats(TEXTURE_MATRIX),
        version: 0,
    }
}
