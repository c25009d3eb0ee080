//! The batch of immediate mode: primitives that were recorded in one state become one draw.

use crate::capture::Capture;
use crate::capture::draw::{Draw, Shading, TexturedDraw, Values};
use crate::capture::primitives::QuadSplit;
use crate::enums::*;
use crate::state::matrix::{product, transform};
use crate::state::snapshot::Snapshot;
use crate::trace::lighting::LightingSetup;
use crate::trace::overrides::RayMaterial;
use std::sync::Arc;

impl Capture {
    /// The recorded primitives as a draw in `state`. `None` without any.
    pub(crate) fn take_batch(&mut self, state: &Arc<Snapshot>) -> Option<Draw> {
        self.recorder.flush_ring();
        if self.recorder.runs.is_empty() {
            return None;
        }
        let kind = &self.split_of_batch(state);
        let geometry = match self.recorder.take_followed_geometry(kind) {
            Some(geometry) => {
                self.geometry_cache.hits += 1;
                self.geometry_cache.touch(&geometry);
                geometry
            }
            None => {
                self.recorder.copy_followed_vertices();
                let geometry = self.geometry_cache.of_runs(
                    &self.recorder.positions,
                    &self.recorder.runs,
                    kind,
                );
                self.recorder.remember_batch(&geometry, kind);
                geometry
            }
        };
        let attributes = Arc::new(self.recorder.take_attributes(&geometry));
        let calls = self.recorder.runs.iter().map(|r| u64::from(r.times)).sum();
        self.recorder.positions.clear();
        self.recorder.runs.clear();
        Some(Draw {
            geometry,
            attributes,
            state: state.clone(),
            shading: Shading::Fixed,
            clip_from_object: product(&state.projection, &state.model_view),
            calls,
            ray_material: RayMaterial::default(),
        })
    }

    /// How the driver would split the batch's quads into triangles.
    fn split_of_batch(&mut self, s: &Snapshot) -> QuadSplit {
        // Lists end batches with quads before and after them.
        let all_turned = s.turns_quads() || self.depth_of_lists > 0;
        let mut split =
            QuadSplit { first_provokes: s.first_vertex_provokes, all_turned, turned: Vec::new() };
        if std::mem::take(&mut self.recorder.quads) && !all_turned {
            let clipped = s.clips();
            let outside = |from, to| self.recorder.any_position(from, to, &clipped);
            // Begin and End after Begin and End of quads is one draw for the driver.
            let (mut at, mut first) = (0, 0);
            for (i, r) in self.recorder.runs.iter().enumerate() {
                let next = self.recorder.runs.get(i + 1).map(|r| r.mode);
                let end = at + r.count * r.times;
                if r.mode == QUADS && next != Some(QUADS) {
                    split.find_clipped_quads(first, end, outside);
                }
                at = end;
                first = if r.mode == QUADS && next == Some(QUADS) { first } else { at };
            }
        }
        split
    }

    /// Applies a singular model-view to the draw's positions, with the colours that its lights give
    /// before.
    pub(crate) fn flatten(&mut self, draw: &mut Draw) {
        let m = draw.state.model_view;
        let eye = |p: &rt_core::glam::Vec3| {
            let v = transform(&m, p.to_array());
            [v[0], v[1], v[2]]
        };
        let positions: Vec<[f32; 3]> = draw.geometry.mesh.positions.iter().map(eye).collect();
        let indices = draw.geometry.mesh.indices.clone();
        // Lit where the program lit it: normals cannot be found again from a singular matrix.
        let setup = LightingSetup::new(&draw.state);
        let object = &draw.geometry.mesh.positions;
        let colors = (0..object.len())
            .map(|i| setup.vertex(&draw.attributes, i, object[i].to_array()).primary[0]);
        let colors = Values::PerVertex(colors.collect());
        Arc::make_mut(&mut draw.attributes).colors = colors;
        let mut state = (*draw.state).clone();
        state.lighting = false;
        state.model_view = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
        draw.clip_from_object = state.projection;
        draw.state = Arc::new(state);
        draw.geometry = self.geometry_cache.of_indices(&positions, &indices);
    }

    /// The recorder uses the memory of these draws again.
    pub(crate) fn recycle(&mut self, draws: Vec<TexturedDraw>) {
        for (draw, _) in draws {
            if let Some(attributes) = Arc::into_inner(draw.attributes) {
                self.recorder.recycle(attributes, &draw.geometry);
            }
        }
    }
}
