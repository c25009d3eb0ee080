//! Which tiles of a frame a draw may cover: no rays go where no box of its triangles projects.
//!
//! The rectangle of a draw is that of its box, of which a surface often covers a third. The boxes
//! of runs of triangles ([`Geometry::clusters`]) are projected one by one, and tiles that none of
//! them touches are left out. Programs order triangles along their surfaces, so the boxes are
//! small; where they are not, tiles are kept in vain, and nothing else is lost.
//!
//! [`Geometry::clusters`]: crate::capture::geometry_cache::Geometry::clusters

use super::screen_bounds::box_on_screen;
use super::{Prepared, Rect, TILE, matrix};

/// The tiles of a frame's rectangle that a draw may cover.
pub(super) struct TileMask {
    /// Tiles in a row.
    width: usize,
    /// `None` for all.
    marks: Option<Vec<bool>>,
}

/// A draw on so few tiles has its rays sent everywhere.
const FEW_TILES: usize = 16;

impl TileMask {
    /// The tiles of `frame`, numbered from its lower left corner, that `p` may cover.
    pub(super) fn new(p: &Prepared<'_>, frame: Rect) -> TileMask {
        let tiles = |n: i32| ((n.max(0) + TILE - 1) / TILE) as usize;
        let (width, height) = (tiles(frame.w), tiles(frame.h));
        let mut mask = TileMask { width, marks: None };
        let clusters = p.draw.geometry.clusters();
        if clusters.len() < 2 || tiles(p.rect.w) * tiles(p.rect.h) <= FEW_TILES {
            return mask;
        }
        let clip = matrix(&p.draw.clip_from_object);
        let mut marks = vec![false; width * height];
        for b in clusters {
            let r = box_on_screen(*b, clip, &p.draw.state).and(p.rect).and(frame);
            if r.is_empty() {
                continue;
            }
            let [x0, y0] = [r.x - frame.x, r.y - frame.y].map(|v| (v / TILE) as usize);
            let x1 = ((r.x + r.w - 1 - frame.x) / TILE) as usize;
            let y1 = ((r.y + r.h - 1 - frame.y) / TILE) as usize;
            for row in marks.chunks_exact_mut(width).take(y1 + 1).skip(y0) {
                row[x0..=x1].fill(true);
            }
        }
        mask.marks = Some(marks);
        mask
    }

    /// True when the draw may cover tile (`x`, `y`).
    #[inline]
    pub(super) fn has(&self, x: usize, y: usize) -> bool {
        self.marks.as_ref().is_none_or(|m| m[y * self.width + x])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::draw::{Attributes, Draw, Shading};
    use crate::capture::geometry_cache::{BuildCounts, GeometryCache};
    use crate::capture::primitives::{PrimitiveRun, QuadSplit};
    use crate::enums::TRIANGLES;
    use crate::state::current_attributes::CurrentAttributes;
    use crate::state::snapshot::Snapshot;
    use crate::trace::overrides::RayMaterial;
    use std::sync::Arc;

    const ONE: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

    #[test]
    fn tiles_between_two_far_parts_of_a_mesh_are_left_out() {
        // Half of the triangles are in the lower left corner, the others in the upper right one.
        let corner = |i: usize| {
            let at = if i < 96 { -0.9 } else { 0.9 };
            let [x, y] = [1, 2].map(|k| if i % 3 == k { 0.05 } else { 0.0 });
            [at + x, at + y, 0.0]
        };
        let positions: Vec<[f32; 3]> = (0..192).map(corner).collect();
        let run = PrimitiveRun { mode: TRIANGLES, count: 192, times: 1 };
        let geometry = GeometryCache::default().of_runs(&positions, &[run], &QuadSplit::default());
        assert_eq!(geometry.clusters().len(), 4);
        let viewport = [0, 0, 160, 160];
        let state = Snapshot { viewport, model_view: ONE, projection: ONE, ..Snapshot::default() };
        let draw = Draw {
            geometry,
            attributes: Arc::new(Attributes::constant(&CurrentAttributes::default())),
            state: Arc::new(state),
            shading: Shading::Fixed,
            clip_from_object: ONE,
            calls: 1,
            ray_material: RayMaterial::default(),
        };
        let p = Prepared::new(&draw, None, &mut BuildCounts::default()).expect("it is visible");
        let mask = TileMask::new(&p, Rect { x: 0, y: 0, w: 160, h: 160 });
        let kept: Vec<(usize, usize)> =
            (0..100).map(|i| (i % 10, i / 10)).filter(|(x, y)| mask.has(*x, *y)).collect();
        assert_eq!(kept, [(0, 0), (9, 9)]);
    }
}
