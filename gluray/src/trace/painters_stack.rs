//! Stacks the triangles of a draw whose order matters. Each triangle lies parallel to the window's
//! plane, at a height equal to its index in drawing order.
//!
//! Layers of such draws often lie in one plane (user interfaces, images), where a ray from the eye
//! cannot tell their order. In the stack the last triangle is the highest. A ray from above hits
//! the triangles in reverse order, one at a time. Where the last triangle replaces all others, the
//! search stops there. Corners are rounded to 1/256 pixel as in the rasterizer, so rays hit slivers
//! where the rasterizer draws them.

use super::{Prepared, Rect, slot};
use crate::trace::raster::snapped;
use rt_core::bvh::{BuildOptions, BuildQuality, World};
use rt_core::glam::{DVec3, Vec3};
use rt_core::mesh::TriMesh;
use rt_core::ray::{HitBlock, RayBlock};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// The number of heights that are distinct in f32, with halves between them.
const MOST: usize = 1 << 22;
/// The largest coordinate, in units of 1/256 pixel, that is exact in f32.
const EXACT: i64 = 1 << 24;

/// The stack.
pub(super) struct PaintersStack {
    world: World,
    triangles: usize,
}

impl PaintersStack {
    /// Returns `None` when corners are behind the eye, too many or too far away to be stacked.
    pub(super) fn new(p: &Prepared<'_>) -> Option<PaintersStack> {
        let n = p.draw.geometry.mesh.num_triangles();
        if n > MOST {
            return None;
        }
        let mut positions = Vec::with_capacity(3 * n);
        for prim in 0..n {
            for c in p.corners(prim) {
                if c[3].partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) || !c[3].is_finite()
                {
                    return None;
                }
                let at = snapped(&c, p.draw.state.viewport);
                if at.iter().any(|v| v.abs() > EXACT) {
                    return None;
                }
                positions.push(Vec3::new(at[0] as f32 / 256.0, at[1] as f32 / 256.0, prim as f32));
            }
        }
        let indices = (0..n as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Arc::new(TriMesh::new(positions, indices));
        let options = BuildOptions { quality: BuildQuality::Fast, ..BuildOptions::default() };
        Some(PaintersStack { world: World::from_mesh(mesh, &options).ok()?, triangles: n })
    }

    /// For each pixel of a tile, passes the triangles over its centre to `take`, the last first,
    /// until `take` needs no more.
    pub(super) fn each(
        &self,
        p: &Prepared<'_>,
        tile: Rect,
        mut take: impl FnMut(usize, usize) -> bool,
    ) {
        let mut blocks = vec![RayBlock::INACTIVE; 16];
        let mut hits = vec![HitBlock::MISS; 16];
        let mut active = Vec::new();
        for i in 0..(tile.w * tile.h) as usize {
            let (x, y) = (i as i32 % tile.w, i as i32 / tile.w);
            let above = DVec3::new(
                f64::from(tile.x + x) + 0.5,
                f64::from(tile.y + y) + 0.5,
                self.triangles as f64,
            );
            let (ray, _) = self.world.ray_from_world(above, DVec3::NEG_Z);
            let (b, l) = slot(x, y);
            blocks[b].set(l, &ray);
            active.push((i, b, l));
        }
        while !active.is_empty() {
            p.rays.fetch_add(active.len() as u64, Relaxed);
            hits.fill(HitBlock::MISS);
            self.world
                .closest_coherent(&blocks, &mut hits)
                .expect("one block of hits for each of rays");
            active.retain(|&(i, b, l)| {
                let mut ray = blocks[b].get(l);
                let more = hits[b].get(l).filter(|hit| take(i, hit.prim as usize));
                match more {
                    // Continues halfway to the next triangle.
                    Some(hit) => ray.t_min = (hit.t + 0.5).max(hit.t.next_up()),
                    None => ray.t_max = f32::NEG_INFINITY,
                }
                blocks[b].set(l, &ray);
                more.is_some()
            });
        }
    }
}
