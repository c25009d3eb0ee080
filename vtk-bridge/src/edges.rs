//! Draws the edges of polygons on a surface as VTK 9's shaders do. A pixel's colour depends on its
//! distance from the projected edges of its polygon. Edges also extend slightly past the outline,
//! because the geometry shader moves the corners of each triangle outwards.

use crate::geometry::PolygonMesh;
use crate::input::{Property, View};
use crate::materials::Encoding;
use rayon::prelude::*;
use rt_core::frame::Frame;
use rt_core::glam::{DAffine3, DVec2, DVec4};
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Number of pixels or triangles per task.
const CHUNK: usize = 1 << 14;
/// Cut-off in pixels: nothing is drawn further than this beyond a side that is not an edge.
const DIAGONAL_CUTOFF_PX: f64 = -0.5;

/// The edges of one instance.
pub(crate) struct Edges {
    mesh: Arc<TriMesh>,
    /// As in [`PolygonMesh::edges`].
    sides: Option<Arc<Vec<u8>>>,
    world_from_object: DAffine3,
    color: [f32; 3],
    /// Colour outside the surface.
    outline: [f32; 3],
    /// Whether the colour on the surface is that of the image of lit lines.
    pub(crate) lit: bool,
    width_px: f64,
    /// Whether triangles of each winding in the window are culled: index 0 for winding −1, index 1
    /// for winding 1 (rows counted from the top).
    culled: [bool; 2],
    /// How far a corner moves, in line widths. VTK 9.1's shader intends half a width, but it treats
    /// the window as one unit wide although its coordinates run from −1 to 1, so corners move by a
    /// quarter.
    reach: f64,
}

/// A triangle in the window; x and y in pixels from the top left.
struct ProjectedTriangle {
    corners: [DVec2; 3],
    /// Corners after the geometry shader has moved them.
    moved: [DVec2; 3],
    depths: [f64; 3],
    /// Unit normal of each side, pointing inwards.
    inward: [DVec2; 3],
    /// As in [`PolygonMesh::edges`].
    sides: u8,
    /// Orientation in the window: 1 or −1.
    winding: f64,
}

/// A pixel of an edge outside the surface.
struct Fragment {
    pixel: u32,
    depth: f32,
}

impl Edges {
    pub(crate) fn new(
        mesh: &PolygonMesh,
        world_from_object: DAffine3,
        property: &Property,
        encoding: Encoding,
        reach: f64,
    ) -> Edges {
        Edges {
            mesh: Arc::clone(&mesh.mesh),
            sides: mesh.edges.clone(),
            world_from_object,
            color: property.edge_color,
            outline: match encoding {
                // Neither lit nor given an ambient part.
                Encoding::Pbr => [0.0; 3],
                other => property.edge_color.map(|c| other.encoded(c)),
            },
            lit: false,
            width_px: f64::from(property.edge_width),
            culled: [property.cull_front, property.cull_back],
            reach,
        }
    }

    /// The colour of the lines.
    pub(crate) fn color(&self) -> [f32; 3] {
        self.color
    }

    /// Returns `None` for triangles with a corner behind the eye, which has no window position, and
    /// for triangles without an area.
    fn project(&self, primitive: usize, view: &View) -> Option<ProjectedTriangle> {
        let indices = self.mesh.indices.get(primitive)?;
        let sides = self.sides.as_ref().map_or(7, |s| s.get(primitive).copied().unwrap_or(7));
        let size = DVec2::new(view.width.into(), view.height.into());
        let (mut corners, mut depths) = ([DVec2::ZERO; 3], [0.0; 3]);
        for (k, &i) in indices.iter().enumerate() {
            let object = self.mesh.origin + self.mesh.positions[i as usize].as_dvec3();
            let world = self.world_from_object.transform_point3(object);
            let clip: DVec4 = view.clip_from_world * world.extend(1.0);
            if clip.w <= 0.0 {
                return None;
            }
            corners[k] = 0.5 * (DVec2::new(clip.x, -clip.y) / clip.w + 1.0) * size;
            depths[k] = 0.5 * clip.z / clip.w + 0.5;
        }
        let [a, b, c] = corners;
        let winding = (b - a).perp_dot(c - a);
        let inward =
            [b - a, c - b, a - c].map(|side| winding.signum() * side.perp().normalize_or_zero());
        if winding == 0.0 || !winding.is_finite() || inward.contains(&DVec2::ZERO) {
            return None;
        }
        let [p, q, r] = inward;
        let push = |n: DVec2| -self.reach * self.width_px * n.normalize_or_zero();
        let moved = [a + push(r + p), b + push(p + q), c + push(q + r)];
        Some(ProjectedTriangle { corners, moved, depths, inward, sides, winding: winding.signum() })
    }

    /// How much of the edge's colour is visible at distances `d` from the sides of a triangle.
    fn coverage(&self, t: &ProjectedTriangle, d: &[f64; 3]) -> f32 {
        let of_edges = (0..3).filter(|&i| t.is_edge(i)).map(|i| d[i]).fold(f64::INFINITY, f64::min);
        (0.5 + 0.5 * self.width_px - of_edges).clamp(0.0, 1.0) as f32
    }

    /// Finds the pixels of triangle `primitive`'s edges that lie outside it and in front of
    /// `depth`.
    fn outline_fragments(
        &self,
        primitive: usize,
        view: &View,
        depth: &[f32],
        out: &mut Vec<Fragment>,
    ) {
        let Some(t) = self.project(primitive, view) else { return };
        // OpenGL's front faces wind counter-clockwise with rows from the bottom, so they wind
        // clockwise with rows from the top.
        if self.culled[usize::from(t.winding > 0.0)] {
            return;
        }
        let low = t.moved.iter().fold(DVec2::INFINITY, |m, p| m.min(*p)).max(DVec2::ZERO);
        let high = t.moved.iter().fold(DVec2::NEG_INFINITY, |m, p| m.max(*p));
        // `as` saturates and maps NaN to 0.
        let end = [(high.x + 0.5) as usize, (high.y + 0.5) as usize];
        let (width, height) = (view.width as usize, view.height as usize);
        for y in (low.y - 0.5).ceil().max(0.0) as usize..end[1].min(height) {
            for x in (low.x - 0.5).ceil().max(0.0) as usize..end[0].min(width) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let d = t.distances(p);
                let outside = (0..3).any(|i| t.is_edge(i) && d[i] < 0.0);
                let cut = (0..3).any(|i| !t.is_edge(i) && d[i] < DIAGONAL_CUTOFF_PX);
                if outside && !cut && t.covers(p) {
                    let (pixel, z) = (y * width + x, t.depth(p) as f32);
                    if z >= 0.0 && z <= depth[pixel] && z < 1.0 {
                        out.push(Fragment { pixel: pixel as u32, depth: z });
                    }
                }
            }
        }
    }
}

impl ProjectedTriangle {
    fn is_edge(&self, side: usize) -> bool {
        self.sides >> side & 1 != 0
    }

    /// Distances from the sides, positive inside.
    fn distances(&self, p: DVec2) -> [f64; 3] {
        std::array::from_fn(|i| self.inward[i].dot(p - self.corners[i]))
    }

    /// Barycentric coordinates in the moved triangle.
    fn weights(&self, p: DVec2) -> [f64; 3] {
        let [a, b, c] = self.moved;
        let area = (b - a).perp_dot(c - a);
        let [v, w] = [(p - a).perp_dot(c - a) / area, (b - a).perp_dot(p - a) / area];
        [1.0 - v - w, v, w]
    }

    fn covers(&self, p: DVec2) -> bool {
        self.weights(p).iter().all(|w| *w >= 0.0)
    }

    /// Window depth in the plane of the moved triangle.
    fn depth(&self, p: DVec2) -> f64 {
        self.weights(p).iter().zip(self.depths).map(|(w, z)| w * z).sum()
    }
}

/// Draws the edges of all instances into `frame`, which has its identity layers. `edges` has one
/// entry per instance, or is empty. `first_depth` is the depth of the first surface in front of the
/// opaque ones, or empty. `lit_lines` has the colours of pixels as lines would cover them, for the
/// edges that are [`Edges::lit`], or is empty.
pub(crate) fn draw(
    frame: &mut Frame,
    lit_lines: &[[f32; 4]],
    first_depth: &[f32],
    edges: &[Option<Edges>],
    view: &View,
) {
    if edges.is_empty() {
        return;
    }
    // A translucent surface in front of the opaque ones hides the part of an edge that has no
    // surface behind it.
    let veiled: Vec<bool> =
        first_depth.par_iter().zip(&frame.depth).map(|(first, own)| first < own).collect();

    draw_inside(frame, lit_lines, edges, view, |at| at);

    // ---- Outside the surface.
    for e in edges.iter().flatten().filter(|e| e.reach > 0.0) {
        let triangles = (0..e.mesh.indices.len()).into_par_iter().with_min_len(CHUNK);
        let depth = &frame.depth;
        let found = triangles.fold(Vec::new, |mut out, primitive| {
            e.outline_fragments(primitive, view, depth, &mut out);
            out
        });
        let found: Vec<Vec<Fragment>> = found.collect();
        for f in found.iter().flatten() {
            let at = f.pixel as usize;
            let hidden = veiled.get(at) == Some(&true) && first_depth[at] < f.depth;
            if f.depth <= frame.depth[at] && !hidden {
                let [r, g, b] = e.outline;
                (frame.depth[at], frame.color[at]) = (f.depth, [r, g, b, 1.0]);
            }
        }
    }
}

/// As [`draw`], on the surfaces only. `pixel_of` gives for each pixel of `frame` the one of the
/// window at whose centre the distance from the edges counts.
pub(crate) fn draw_inside(
    frame: &mut Frame,
    lit_lines: &[[f32; 4]],
    edges: &[Option<Edges>],
    view: &View,
    pixel_of: impl Fn(usize) -> usize + Sync,
) {
    let width = view.width as usize;
    let ids = frame.instance.par_iter().zip(&frame.primitive).with_min_len(CHUNK);
    let seen = frame.color.par_iter_mut().zip(&mut frame.depth).zip(ids).enumerate();
    seen.for_each(|(at, ((color, depth), (&instance, &primitive)))| {
        let Some(Some(e)) = edges.get(instance as usize) else { return };
        let Some(t) = e.project(primitive as usize, view) else { return };
        let pixel = pixel_of(at);
        let p = DVec2::new((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
        let coverage = e.coverage(&t, &t.distances(p));
        let alpha = color[3];
        let line = match lit_lines.get(at) {
            Some([r, g, b, _]) if e.lit => [*r, *g, *b],
            _ => e.color.map(|c| c * alpha),
        };
        for (c, line) in color.iter_mut().zip(line) {
            *c += (line - *c) * coverage;
        }
        if e.reach > 0.0 && *depth < 1.0 {
            *depth = (t.depth(p) as f32).clamp(0.0, 1.0f32.next_down());
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::glam::{DMat4, Vec3};

    /// A square from pixel (50, 50) to (100, 0), in the middle of the depth range, whose diagonal
    /// is not an edge.
    fn square() -> (Edges, View) {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        let edges = Edges {
            mesh: Arc::new(mesh),
            sides: Some(Arc::new(vec![3, 6])),
            world_from_object: DAffine3::IDENTITY,
            color: [1.0, 0.0, 0.0],
            outline: [1.0, 0.0, 0.0],
            lit: false,
            width_px: 4.0,
            culled: [false; 2],
            reach: 0.25,
        };
        let view = View {
            clip_from_world: DMat4::from_cols_array(&[
                1.0, 0.0, 0.0, -0.5, 0.0, 1.0, 0.0, -0.5, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
            ])
            .transpose(),
            viewer: None,
            width: 100,
            height: 100,
            background: [[0.0; 3]; 2],
            interactive: false,
            shadows: false,
            samples: 0,
            window_samples: 0,
            one_layer: false,
            lens: None,
        };
        (edges, view)
    }

    #[test]
    fn edges_are_as_wide_as_asked_and_diagonals_do_not_show() {
        let (edges, view) = square();
        let t = edges.project(0, &view).expect("a triangle");
        let at = |x, y| edges.coverage(&t, &t.distances(DVec2::new(x, y)));
        // Rows count from the top, so the bottom edge is at y = 75.
        assert_eq!([at(50.0, 74.5), at(60.0, 72.0), at(50.0, 50.5)], [1.0, 0.0, 0.0]);
        assert!((at(60.0, 73.0) - 0.5).abs() < 1e-6, "the rim fades");
    }

    #[test]
    fn the_outline_is_wider_than_the_surface_by_what_the_corners_move() {
        let (mut edges, view) = square();
        let draw = |edges: Edges, depth: f32| {
            let mut frame = Frame {
                width: 100,
                height: 100,
                color: vec![[0.0; 4]; 10_000],
                depth: vec![depth; 10_000],
                instance: vec![u32::MAX; 10_000],
                primitive: vec![u32::MAX; 10_000],
                ..Frame::default()
            };
            super::draw(&mut frame, &[], &[], &[Some(edges)], &view);
            frame
        };
        let shown = |f: &Frame, x: usize, y: usize| f.depth[y * 100 + x] < 1.0;
        // A corner moves by one pixel along the diagonal, which is 0.7 pixels in x and in y. That
        // covers the pixels whose centre is half a pixel outside.
        let (again, _) = square();
        let frame = draw(again, 1.0);
        assert!(
            shown(&frame, 50, 75)
                && shown(&frame, 75, 50)
                && shown(&frame, 24, 50)
                && shown(&frame, 50, 24)
        );
        assert!(
            !shown(&frame, 50, 76) && !shown(&frame, 50, 74),
            "nor further out, nor inside: rays see that"
        );
        assert_eq!(frame.color[75 * 100 + 50], [1.0, 0.0, 0.0, 1.0]);
        assert!((frame.depth[75 * 100 + 50] - 0.5).abs() < 1e-6);
        let (again, _) = square();
        assert!(draw(again, 0.4).depth.iter().all(|d| *d == 0.4), "something in front");
        edges.culled = [true, false];
        assert!(!shown(&draw(edges, 1.0), 50, 75), "fronts are culled");
    }
}
