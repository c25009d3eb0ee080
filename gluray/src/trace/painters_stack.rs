//! A draw whose order matters, as a stack: each triangle lies in the window's plane, as high as its
//! place in the order.
//!
//! Layers of such draws often lie in one plane (user interfaces, pictures), where a ray from the
//! eye cannot tell which comes after which. Above the window the last triangle is the highest, and
//! a ray from above meets them in the reverse order, each by itself. Where the last one replaces
//! all others, it is the only one that is looked for. Corners are rounded to 1/256 pixel as the
//! rasterizer does, so slivers are met where it draws them.

use super::{Prepared, Rect, slot};
use crate::trace::raster::snapped;
use rt_core::bvh::{BuildOptions, BuildQuality, World};
use rt_core::glam::{DVec3, Vec3};
use rt_core::mesh::TriMesh;
use rt_core::ray::{HitBlock, RayBlock};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// Heights that are numbers of their own in f32, with halves between them.
const MOST: usize = 1 << 22;
/// Coordinates up to which 1/256 pixel is exact in f32, in that unit.
const EXACT: i64 = 1 << 24;

/// The stack.
pub(super) struct PaintersStack {
    world: World,
    triangles: usize,
}

impl PaintersStack {
    /// `None` when corners are behind the eye, or too many or too far off to be stacked.
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

    /// For each pixel of a tile the triangles over its centre, the last first, until `take` has
    /// enough of them.
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
                    // Half of the way to the next.
                    Some(hit) => ray.t_min = (hit.t + 0.5).max(hit.t.next_up()),
                    None => ray.t_max = f32::NEG_INFINITY,
                }
                blocks[b].set(l, &ray);
                more.is_some()
            });
        }
    }
}
