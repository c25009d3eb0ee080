//! Traces blocks of rays in any direction through a triangle hierarchy.

use super::leaf_kind::{LeafKind, OfTriangles};
use super::meshlets::InMeshlets;
use super::scattered::BlockSet;
use super::three;
use super::tree_view::TreeView;
use super::{hybrid, scattered};
use crate::bvh::Unit;
use crate::bvh::compact::{TrianglePlace, with_cache};
use crate::bvh::layout::wide::NODE_UNITS;
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::packet::GROUPS;
use crate::bvh::traverse::timed_choice::TimedChoice;
use crate::ray::{HitBlock, LANES, RayBlock};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8, f32x16, mask32x16};
use std::cell::Cell;

/// Rays of a block share the start of the traversal when their origins lie within this part of the
/// tree's box, along every axis.
const CLOSE: f32 = 0.125;

/// The ways to trace blocks whose rays start together.
const SHARED_START: usize = 0;
const FROM_THE_ROOT: usize = 1;

thread_local! {
    /// The faster way for closest hits and for occlusion. From the root in turns, ambient occlusion
    /// is up to 1.4 times slower on isosurfaces and 1.1 times faster among long thin triangles.
    /// Of compact trees, their own.
    static CHOICES: Cell<[[TimedChoice<2>; 2]; 2]> =
        const { Cell::new([[TimedChoice::new(SHARED_START); 2]; 2]) };
}

/// Traces blocks of rays and writes the results into `hits`, as long as `rays` (for occlusion,
/// `prim` is 0 where something blocks the ray).
#[inline(always)]
pub(crate) fn trace<S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    tree: &TreeView<'_>,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    instance: u32,
) {
    trace_keeping_places::<S, T, Q>(simd, tree, rays, hits, instance, &mut []);
}

/// As [`trace`]. `places` gets where the closest triangles of a compact tree lie, for as many
/// blocks as it has rows.
pub(crate) fn trace_keeping_places<S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    tree: &TreeView<'_>,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    instance: u32,
    places: &mut [[TrianglePlace; LANES]],
) {
    let key = tree.meshlets();
    if key == 0 {
        trace_kind::<S, T, Q, _>(simd, tree, OfTriangles, rays, hits, places, instance);
        return;
    }
    with_cache(|cache| {
        let kind = InMeshlets { cache, key, keeps_places: !places.is_empty() };
        trace_kind::<S, T, Q, _>(simd, tree, kind, rays, hits, places, instance);
    });
}

#[inline(never)]
fn trace_kind<S, T, Q, K>(
    simd: S,
    tree: &TreeView<'_>,
    kind: K,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    mut places: &mut [[TrianglePlace; LANES]],
    instance: u32,
) where
    S: Simd,
    T: TriangleTest,
    Q: HitQuery,
    K: for<'r> LeafKind<'r>,
{
    for (rays, hits) in rays.chunks(GROUPS).zip(hits.chunks_mut(GROUPS)) {
        let here;
        (here, places) = places.split_at_mut(rays.len().min(places.len()));
        let mut choices = CHOICES.get();
        let choice = &mut choices[usize::from(K::COMPACT)][usize::from(Q::ANY)];
        let (way, start) = choice.next(|_| true);
        let mut together = 0;
        simd.vectorize(
            #[inline(always)]
            || {
                let reach = close_reach(simd, tree);
                let mut apart = 0u16;
                for (b, (r, h)) in rays.iter().zip(&mut *hits).enumerate() {
                    let shares = start_together(simd, r, reach);
                    together += u32::from(shares);
                    if shares && way != FROM_THE_ROOT {
                        let place = here.get_mut(b);
                        hybrid::trace::<S, T, Q, K>(simd, tree, kind, r, h, place, instance);
                    } else {
                        apart |= 1 << b;
                    }
                }
                if apart != 0 {
                    let set = BlockSet { rays, chosen: apart };
                    scattered::trace::<S, T, Q, K>(simd, tree, kind, set, hits, here, instance);
                }
            },
        );
        // Blocks whose rays start apart have only one way.
        if together == rays.len() as u32 {
            choice.learn(start.map_or(0.0, |t| t.elapsed().as_secs_f32()) / rays.len() as f32);
            CHOICES.set(choices);
        }
    }
}

/// How far apart rays may start to be traced together, per axis.
#[inline(always)]
fn close_reach<S: Simd>(simd: S, tree: &TreeView<'_>) -> [f32; 3] {
    let root: &[Unit; NODE_UNITS] =
        tree.units[..NODE_UNITS].try_into().expect("a slice of that length");
    three!(|axis| {
        let lo = f32x8::from_slice(simd, &root[2 * axis].0).reduce_min();
        let hi = f32x8::from_slice(simd, &root[2 * axis + 1].0).reduce_max();
        CLOSE * (hi - lo)
    })
}

/// Whether the rays of a block start within `reach` of one another.
#[inline(always)]
fn start_together<S: Simd>(simd: S, rays: &RayBlock, reach: [f32; 3]) -> bool {
    let active = mask32x16::from_bitmask(simd, rays.active_lanes() as u64);
    let splat = |x: f32| f32x16::splat(simd, x);
    for (row, reach) in [&rays.ox, &rays.oy, &rays.oz].into_iter().zip(reach) {
        let row = f32x16::from_slice(simd, row);
        let lo = active.select(row, splat(f32::INFINITY)).reduce_min();
        let hi = active.select(row, splat(f32::NEG_INFINITY)).reduce_max();
        if hi - lo > reach {
            return false;
        }
    }
    true
}
