//! Edges of polygons on a surface, as VTK 9's fragment shader draws them: by the distance of a pixel from the projected edges of its polygon.

use crate::geometry::BuiltMesh;
use crate::input::{Property, View};
use rayon::prelude::*;
use rt_core::frame::Frame;
use rt_core::glam::{DAffine3, DVec2, DVec4};
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Pixels a task works on.
const CHUNK: usize = 1 << 14;

/// The edges of one instance.
pub(crate) struct Edges {
    mesh: Arc<TriMesh>,
    /// As in [`BuiltMesh::edges`].
    sides: Option<Arc<Vec<u8>>>,
    world_from_object: DAffine3,
    color: [f32; 3],
    width_px: f64,
}

impl Edges {
    pub(crate) fn new(mesh: &BuiltMesh, world_from_object: DAffine3, property: &Property) -> Edges {
        Edges {
            mesh: Arc::clone(&mesh.mesh),
            sides: mesh.edges.clone(),
            world_from_object,
            color: property.edge_color,
            width_px: f64::from(property.edge_width),
        }
    }

    /// How much of the edge's colour shows at pixel `p` (from the top left) of triangle `primitive`.
    fn share(&self, primitive: usize, p: DVec2, view: &View) -> f32 {
        let Some(corners) = self.mesh.indices.get(primitive) else { return 0.0 };
        let sides = self.sides.as_ref().map_or(7, |s| s.get(primitive).copied().unwrap_or(7));
        let size = DVec2::new(view.width.into(), view.height.into());
        let mut window = [DVec2::ZERO; 3];
        for (w, &i) in window.iter_mut().zip(corners) {
            let object = self.mesh.origin + self.mesh.positions[i as usize].as_dvec3();
            let clip: DVec4 =
                view.clip_from_world * self.world_from_object.transform_point3(object).extend(1.0);
            if clip.w <= 0.0 {
                // A corner behind the eye has no place in the window.
                return 0.0;
            }
            *w = 0.5 * (DVec2::new(clip.x, -clip.y) / clip.w + 1.0) * size;
        }
        let [a, b, c] = window;
        let turn = (b - a).perp_dot(c - a).signum();
        let mut nearest = f64::INFINITY;
        for (i, (from, to)) in [(a, b), (b, c), (c, a)].into_iter().enumerate() {
            let along = to - from;
            if sides >> i & 1 != 0 && along != DVec2::ZERO {
                nearest = nearest.min(turn * along.perp_dot(p - from) / along.length());
            }
        }
        (0.5 + 0.5 * self.width_px - nearest).clamp(0.0, 1.0) as f32
    }
}

/// Draws the edges of all instances into `frame`, which has its identity layers. `edges` is one per instance, or empty.
pub(crate) fn draw(frame: &mut Frame, edges: &[Option<Edges>], view: &View) {
    if edges.is_empty() {
        return;
    }
    let width = view.width as usize;
    let ids = frame.instance.par_iter().zip(&frame.primitive).with_min_len(CHUNK);
    frame.color.par_iter_mut().zip(ids).enumerate().for_each(|(at, (color, (&instance, &primitive)))| {
        let Some(Some(e)) = edges.get(instance as usize) else { return };
        let p = DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
        let share = e.share(primitive as usize, p, view);
        let alpha = color[3];
        for (c, edge) in color.iter_mut().zip(e.color) {
            *c += (edge * alpha - *c) * share;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::glam::{DMat4, Vec3};

    #[test]
    fn edges_are_as_wide_as_asked_and_diagonals_do_not_show() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        let edges = Edges {
            mesh: Arc::new(mesh),
            sides: Some(Arc::new(vec![3, 6])),
            world_from_object: DAffine3::IDENTITY,
            color: [1.0, 0.0, 0.0],
            width_px: 2.0,
        };
        let view = View {
            clip_from_world: DMat4::from_cols_array(&[
                2.0, 0.0, 0.0, -1.0, 0.0, 2.0, 0.0, -1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
            ])
            .transpose(),
            width: 100,
            height: 100,
            background: [[0.0; 3]; 2],
            interactive: false,
            shadows: false,
            samples: 0,
            lens: None,
        };
        let at = |x, y| edges.share(0, DVec2::new(x, y), &view);
        // Rows come from the top: the bottom edge is at y = 100.
        assert_eq!([at(50.0, 99.5), at(60.0, 98.0), at(50.0, 50.5)], [1.0, 0.0, 0.0]);
        assert!((at(60.0, 99.0) - 0.5).abs() < 1e-6, "the rim fades");
    }
}
