//! Finds what an unknown vertex shader does to positions, in mode `enhance`.
//!
//! The program is linked so that `gl_Position` can be captured. At a draw, some of its vertices go
//! through its own vertex shader with rasterization off. The attribute of which the clip
//! coordinates are an affine function is the position, and that function is the matrix. So
//! positions stay in object space, hierarchies are reused, and no shader is parsed. The driver
//! draws the colours, and rays compute by how much corners and shadows darken them.

use crate::capture::draw::{Attributes, Draw, Shading};
use crate::capture::geometry_cache::{Geometry, hash};
use crate::capture::vertex_arrays::positions;
use crate::classify::rules::{self, Classification};
use crate::classify::vtk::DrawCall;
use crate::driver::{feedback, gl};
use crate::enums::*;
use crate::host::config::{Mode, Settings};
use crate::interpose::client_memory::{ArraySource, Elements};
use crate::interpose::context::Context;
use crate::state::current_attributes::CurrentAttributes;
use crate::state::material::Material;
use crate::state::snapshot::{DriverCapabilities, GlLight, Snapshot};
use crate::trace::overrides::RayMaterial;
use rt_core::glam::{DMat4, DVec3, DVec4};
use std::collections::HashMap;
use std::sync::Arc;

/// The number of vertices that are captured.
const ASKED: usize = 48;
/// The largest residual of an affine function, as a share of the largest clip coordinate: a few
/// roundings of f32.
const RESIDUAL: f64 = 3e-5;

/// The number of draws whose shapes are kept.
const MOST_KEPT: usize = 4096;

/// The programs that were probed, and their shapes.
#[derive(Default)]
pub(crate) struct AffineProbes {
    /// The programs, and whether their positions can be captured.
    ready: HashMap<u32, bool>,
    made: HashMap<u128, Arc<Geometry>>,
    /// The matrix and eye space of the first draw of the frame. The others are placed relative to
    /// it.
    reference: Option<(DMat4, DMat4)>,
    /// Draws of this frame.
    draws: Vec<Draw>,
}

impl AffineProbes {
    /// Links `program` once more so that its positions can be captured, unless it captures
    /// something itself.
    pub(super) fn prepare(
        &mut self,
        program: u32,
        settings: &Settings,
        capabilities: &DriverCapabilities,
    ) {
        let possible =
            settings.mode == Mode::Enhance && capabilities.version >= 30 && !capabilities.es;
        let free = possible
            && gl::program_i::<1>(program, LINK_STATUS)[0] != 0
            && gl::program_i::<1>(program, TRANSFORM_FEEDBACK_VARYINGS)[0] == 0;
        if free {
            feedback::feedback_varying(program, "gl_Position");
            gl::link_program(program);
            if gl::program_i::<1>(program, LINK_STATUS)[0] == 0 {
                feedback::no_feedback_varyings(program);
                gl::link_program(program);
                self.ready.insert(program, false);
                return;
            }
        }
        self.ready.insert(program, free);
    }

    /// True when draws of this frame wait to be darkened.
    pub(crate) fn has_draws(&self) -> bool {
        !self.draws.is_empty()
    }

    /// The draws of this frame that are to be darkened in the driver's image.
    pub(crate) fn take_draws(&mut self) -> Vec<Draw> {
        self.reference = None;
        std::mem::take(&mut self.draws)
    }

    /// Drops the draws, because they are cleared before anybody sees them.
    pub(crate) fn drop_draws(&mut self) {
        self.draws.clear();
    }
}

/// Finds `clip = M (x, y, z, 1)` by least squares. The residual is relative to the largest clip
/// coordinate. `None` when the points lie in a plane.
fn fit(points: &[[f32; 3]], clip: &[[f32; 4]]) -> Option<(DMat4, f64)> {
    let vector = |p: &[f32; 3]| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
    let n = points.len() as f64;
    let center = points.iter().map(vector).sum::<DVec3>() / n;
    let size = points.iter().map(|p| (vector(p) - center).abs().max_element()).fold(0.0, f64::max);
    if size <= 0.0 || !size.is_finite() {
        return None;
    }
    // Centred and scaled, so that the normal equations are well conditioned in any unit.
    let local = |p: &[f32; 3]| ((vector(p) - center) / size).extend(1.0);
    let (mut normal, mut right) = (DMat4::ZERO, [DVec4::ZERO; 4]);
    for (p, c) in points.iter().zip(clip) {
        let x = local(p);
        normal += DMat4::from_cols(x * x.x, x * x.y, x * x.z, x * x.w);
        (0..4).for_each(|k| right[k] += x * f64::from(c[k]));
    }
    if (normal * n.recip()).determinant().abs() < 1e-12 {
        return None;
    }
    let inverse = normal.inverse();
    let rows = right.map(|r| inverse * r);
    let from_local = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
    let to_local = DMat4::from_scale(DVec3::splat(1.0 / size)) * DMat4::from_translation(-center);
    let m = from_local * to_local;
    Some((m, residual(&m, points, clip)))
}

/// The residual of `m`, relative to the largest clip coordinate.
fn residual(m: &DMat4, points: &[[f32; 3]], clip: &[[f32; 4]]) -> f64 {
    let (mut worst, mut scale) = (0.0_f64, 0.0_f64);
    for (p, c) in points.iter().zip(clip) {
        let is = *m * DVec4::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]), 1.0);
        let c = DVec4::from_array(c.map(f64::from));
        worst = worst.max((is - c).abs().max_element());
        scale = scale.max(c.abs().max_element());
    }
    if scale > 0.0 && worst.is_finite() { worst / scale } else { f64::INFINITY }
}

/// Finds the matrix among the program's uniforms, for points in a plane, which do not determine it.
fn by_uniforms(program: u32, points: &[[f32; 3]], clip: &[[f32; 4]]) -> Option<DMat4> {
    feedback::active_uniforms(program)
        .into_iter()
        .filter(|(_, kind)| *kind == FLOAT_MAT4)
        .filter_map(|(name, _)| {
            let at = gl::uniform_location(program, &name);
            (at >= 0)
                .then(|| DMat4::from_cols_array(&gl::uniform_f::<16>(program, at).map(f64::from)))
        })
        .find(|m| residual(m, points, clip) < RESIDUAL)
}

impl Context {
    /// Takes the shape of a draw that the driver is about to draw with an unknown program. The
    /// error is the reason why this is not possible.
    pub(crate) fn take_shape<'c>(
        &mut self,
        mode: u32,
        call: DrawCall,
        elements: impl FnOnce() -> Result<Elements<'c>, &'static str>,
    ) -> Result<(), &'static str> {
        let program = self.state.snapshot.program;
        if self.capabilities.es {
            return Err("OpenGL ES");
        }
        match self.classifier.probes.ready.get(&program) {
            Some(true) => {}
            Some(false) => return Err("a program whose positions cannot be captured"),
            None => return Err("a program linked before mode enhance"),
        }
        match rules::classify(&self.state.snapshot, rules::TraceFilter::Surfaces) {
            Classification::Trace => {}
            Classification::TraceIfOpaque(why) | Classification::Pass(why) => return Err(why),
            Classification::TraceInOrder => return Err("a draw whose order matters"),
        }
        let sources = candidates(program, self.capabilities.core);
        if sources.is_empty() {
            return Err("a program without arrays of positions");
        }
        let elements = elements()?;
        let numbers = elements.some(ASKED);
        let (first, count) = elements.span();
        let indices = gl::word(ELEMENT_ARRAY_BUFFER_BINDING);
        if numbers.len() < 4 {
            return Err("fewer vertices than a matrix needs");
        }
        let clip = ask(&numbers);
        if clip.iter().flatten().any(|v| !v.is_finite()) {
            return Err("positions that are not finite");
        }
        for source in sources {
            let written = {
                let writes = self.shared.writes();
                (writes.last_to(source.buffer), writes.last_to(indices))
            };
            let key = hash(&[
                format!("{source:?} {mode} {call:?} {first} {count} {written:?}").as_bytes()
            ]);
            let geometry = match self.classifier.probes.made.get(&key) {
                // Client memory may have changed.
                Some(made) if source.buffer != 0 => made.clone(),
                _ => {
                    let Ok(packed) = source.read(&elements) else { continue };
                    let Ok(positions) = positions(&packed) else { continue };
                    let split = elements.plain_split(self.state.snapshot.first_vertex_provokes);
                    let triangles = elements.triangles(mode, &split);
                    self.capture.geometry_cache.of_indices(&positions, &triangles)
                }
            };
            let of =
                |i: &u32| geometry.mesh.positions.get(*i as usize - first).map(|p| p.to_array());
            let Some(points) = numbers.iter().map(of).collect::<Option<Vec<_>>>() else { continue };
            let found = match fit(&points, &clip) {
                Some((m, residual)) => (residual < RESIDUAL).then_some(m),
                None => by_uniforms(program, &points, &clip),
            };
            let Some(m) = found else { continue };
            if self.classifier.probes.made.len() > MOST_KEPT {
                self.classifier.probes.made.clear();
            }
            self.classifier.probes.made.insert(key, geometry.clone());
            self.capture.geometry_cache.touch(&geometry);
            return self.add_shape(geometry, m);
        }
        Err("a vertex shader that is no matrix times a position")
    }

    fn add_shape(&mut self, geometry: Arc<Geometry>, m: DMat4) -> Result<(), &'static str> {
        let Some(view) = crate::trace::view::eye_from_clip(m, self.classifier.probes.reference)
        else {
            return Err("a matrix that rays cannot be made for");
        };
        let reference = *self.classifier.probes.reference.get_or_insert((m, view));
        // Equal to the last bit for all draws that the first one places.
        let own = m * view.inverse();
        let shared = reference.0 * reference.1.inverse();
        let same = (own - shared).to_cols_array().iter().all(|v| v.abs() < 1e-4);
        let projection = if same { shared } else { own };
        let f32s = |m: DMat4| m.to_cols_array().map(|v| v as f32);
        let light = &self.config.settings.lights;
        let [x, y, z] = light.added_direction.map(|v| v as f32);
        let state = Snapshot {
            model_view: f32s(view),
            projection: f32s(projection),
            lighting: true,
            // White itself, so that the result is what the rays contribute.
            lights: vec![GlLight {
                position: [x, y, z, 0.0],
                spot_cutoff_deg: 180.0,
                attenuation: [1.0, 0.0, 0.0],
                ..GlLight::default()
            }],
            texture: None,
            fog: None,
            clip_planes: Vec::new(),
            color_material: None,
            ..(*self.state.snapshot).clone()
        };
        let white =
            Material { emission: [1.0; 4], diffuse: [0.0, 0.0, 0.0, 1.0], ..Material::default() };
        let current = CurrentAttributes {
            color: [1.0; 4],
            materials: [white; 2],
            ..CurrentAttributes::default()
        };
        self.end_batch();
        self.classifier.probes.draws.push(Draw {
            geometry,
            attributes: Arc::new(Attributes::constant(&current)),
            state: Arc::new(state),
            shading: Shading::Fixed,
            clip_from_object: f32s(m),
            calls: 1,
            ray_material: RayMaterial::default(),
        });
        self.counters.report.traced_draws += 1;
        Ok(())
    }
}

/// Settings under which the result of a probed draw is the factor on its colours.
pub(crate) fn factor_settings(settings: &Settings) -> Settings {
    Settings { mode: Mode::Enhance, samples: 1, ..settings.clone() }
}

/// The arrays that may be positions: three or four floating-point components, or two.
fn candidates(program: u32, core: bool) -> Vec<ArraySource> {
    let mut out: Vec<ArraySource> = feedback::active_attributes(program)
        .into_iter()
        .filter_map(|name| crate::classify::vtk::attribute(program, &name))
        .filter(|s| matches!(s.kind, FLOAT | DOUBLE | SHORT | HALF_FLOAT) && s.size >= 2)
        .collect();
    // Positions usually come first and have more components than texture coordinates.
    out.sort_by_key(|s| s.size < 3);
    if !core && let Ok(arrays) = crate::capture::vertex_arrays::VertexArrays::query_position() {
        out.insert(0, arrays);
    }
    out
}

/// The clip coordinates of vertices, computed by the program's own vertex shader.
fn ask(numbers: &[u32]) -> Vec<[f32; 4]> {
    let elements = gl::word(ELEMENT_ARRAY_BUFFER_BINDING);
    let generic = gl::word(TRANSFORM_FEEDBACK_BUFFER_BINDING);
    let indexed = feedback::indexed_word(TRANSFORM_FEEDBACK_BUFFER_BINDING, 0);
    let [ours, captured] = feedback::gen_two_buffers();
    gl::bind_buffer(ELEMENT_ARRAY_BUFFER, ours);
    feedback::buffer_data(ELEMENT_ARRAY_BUFFER, bytemuck::cast_slice(numbers));
    feedback::bind_buffer_base(TRANSFORM_FEEDBACK_BUFFER, 0, captured);
    feedback::buffer_data(TRANSFORM_FEEDBACK_BUFFER, &vec![0; 16 * numbers.len()]);
    gl::enable(RASTERIZER_DISCARD);
    feedback::begin_transform_feedback(POINTS);
    feedback::draw_elements(POINTS, numbers.len() as i32, UNSIGNED_INT, 0);
    feedback::end_transform_feedback();
    gl::disable(RASTERIZER_DISCARD);
    let bytes = gl::buffer_bytes(TRANSFORM_FEEDBACK_BUFFER, 0, 16 * numbers.len());
    feedback::bind_buffer_base(TRANSFORM_FEEDBACK_BUFFER, 0, indexed);
    gl::bind_buffer(TRANSFORM_FEEDBACK_BUFFER, generic);
    gl::bind_buffer(ELEMENT_ARRAY_BUFFER, elements);
    feedback::delete_two_buffers([ours, captured]);
    bytemuck::pod_collect_to_vec(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> Vec<[f32; 3]> {
        (0..48)
            .map(|i| i as f32)
            .map(|i| [100.0 + (i * 0.7).sin(), (i * 1.3).cos() * 3.0, i * 0.05])
            .collect()
    }

    fn through(m: &DMat4, points: &[[f32; 3]]) -> Vec<[f32; 4]> {
        points
            .iter()
            .map(|p| (m.as_mat4() * rt_core::glam::Vec3::from_array(*p).extend(1.0)).to_array())
            .collect()
    }

    #[test]
    fn matrices_are_found_from_what_a_shader_makes_of_points() {
        // glFrustum(-1, 1, -1, 1, 1, 300) after a translation.
        let (a, b) = (-301.0 / 299.0, -600.0 / 299.0);
        let frustum = DMat4::from_cols_array(&[
            1., 0., 0., 0., 0., 1., 0., 0., 0., 0., a, -1., 0., 0., b, 0.,
        ]);
        let m = frustum * DMat4::from_translation(DVec3::new(-100.0, 1.0, -9.0));
        let points = cloud();
        let (found, residual) = fit(&points, &through(&m, &points)).expect("points in space");
        assert!(residual < 1e-6, "{residual}");
        assert!((found - m).to_cols_array().iter().all(|v| v.abs() < 1e-3), "{found} {m}");
    }

    #[test]
    fn shaders_that_bend_things_are_told_from_matrices() {
        let points = cloud();
        let bent: Vec<[f32; 4]> =
            points.iter().map(|p| [p[0], p[1] + 0.05 * (3.0 * p[0]).sin(), p[2], 1.0]).collect();
        assert!(fit(&points, &bent).expect("points in space").1 > RESIDUAL);
        let flat: Vec<[f32; 3]> = points.iter().map(|p| [p[0], p[1], 2.0]).collect();
        assert!(fit(&flat, &through(&DMat4::IDENTITY, &flat)).is_none(), "a plane tells no matrix");
    }
}
