//! Many rays through a stored mesh: a packet, or a block of sixteen, goes down the tree of pages
//! together, and the rays that meet a page enter it together. So a page is looked up once for all
//! of them, and what is expanded of it serves all of them.

use super::StoredMesh;
use super::page::Page;
use crate::bvh::blas::{ShapeAny, ShapeClosest};
use crate::bvh::layout::id_leaf::leaf_primitive_ids;
use crate::bvh::layout::wide::{ChildRef, Unit, WideBvh};
use crate::bvh::query::{HitQuery, WatertightTest};
use crate::bvh::traverse::block_entries::{BlockEntries, traverse_block};
use crate::bvh::traverse::block_hits::{limits_of, set_bits};
use crate::bvh::traverse::meshlets;
use crate::bvh::traverse::packet::{GROUPS, Packet, PacketEntries, PacketLimits, RaysLeft};
use crate::bvh::traverse::single::{RaySetup, traverse_from};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::ClosestTri;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use fearless_simd::Simd;
use std::cell::Cell;
use std::marker::PhantomData;

/// With fewer groups of sixteen rays, each goes through a page by itself.
const FEWEST_GROUPS: usize = 3;

/// Per-thread buffers.
struct Room {
    /// Rays on their way to pages, and in one.
    outer: Box<Packet>,
    inner: PageRays,
}

/// The rays that enter a page, and what they hit there.
struct PageRays {
    packet: Box<Packet>,
    rays: [RayBlock; GROUPS],
    hits: [HitBlock; GROUPS],
}

thread_local! {
    static ROOM: Cell<Option<Box<Room>>> = const { Cell::new(None) };
}

impl Room {
    fn new() -> Box<Room> {
        let (rays, hits) = ([RayBlock::INACTIVE; GROUPS], [HitBlock::MISS; GROUPS]);
        let inner = PageRays { packet: Packet::new(), rays, hits };
        Box::new(Room { outer: Packet::new(), inner })
    }
}

/// Traces blocks in the local space of a stored mesh, of which `pages` is the tree. The hits are
/// those of single rays, bit for bit; `hits` has none yet.
pub(crate) fn trace<S: Simd, Q: HitQuery>(
    simd: S,
    pages: &WideBvh,
    mesh: &StoredMesh,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    instance: u32,
) {
    // Should a page be read by a caller's function that traces rays itself, it makes room of its
    // own.
    let mut room = ROOM.take().unwrap_or_else(Room::new);
    let Room { outer, inner } = &mut *room;
    for (rays, hits) in rays.chunks(GROUPS).zip(hits.chunks_mut(GROUPS)) {
        if outer.load(simd, rays, &PacketLimits::NONE) {
            let mut packet = Rays::<Q> { mesh, rays, hits, instance, inner, query: PhantomData };
            outer.visit_entries(simd, &TreeView::all(pages), &mut packet);
            continue;
        }
        for (rays, hits) in rays.chunks(1).zip(hits.chunks_mut(1)) {
            let active = rays[0].active_lanes();
            let mut block = Rays::<Q> { mesh, rays, hits, instance, inner, query: PhantomData };
            traverse_block(simd, pages, &rays[0], active, &mut block);
        }
    }
    ROOM.set(Some(room));
}

/// A packet, or a block, on its way through the tree of pages.
struct Rays<'a, Q> {
    mesh: &'a StoredMesh,
    rays: &'a [RayBlock],
    hits: &'a mut [HitBlock],
    instance: u32,
    inner: &'a mut PageRays,
    query: PhantomData<Q>,
}

impl<Q: HitQuery> Rays<'_, Q> {
    /// The rays `lanes` of the groups `reached` through a page. Returns the groups with nearer
    /// hits.
    #[inline(always)]
    fn enter<S: Simd>(
        &mut self,
        simd: S,
        number: u32,
        reached: u16,
        lanes: impl Fn(usize) -> u16,
    ) -> u16 {
        simd.vectorize(
            #[inline(always)]
            || self.enter_body(simd, number, reached, lanes),
        )
    }

    #[inline(always)]
    fn enter_body<S: Simd>(
        &mut self,
        simd: S,
        number: u32,
        reached: u16,
        lanes: impl Fn(usize) -> u16,
    ) -> u16 {
        let PageRays { packet, rays: local, hits: found } = &mut *self.inner;
        let (mut n, mut entered) = (0, [0; GROUPS]);
        for g in set_bits(reached) {
            let limits = limits_of::<Q>(&self.rays[g], &self.hits[g]);
            let (rays, lanes, mut some) = (&mut local[n & 15], lanes(g), false);
            *rays = self.rays[g];
            for lane in 0..LANES {
                let on = lanes >> lane & 1 == 1 && limits[lane] > rays.t_min[lane];
                rays.t_max[lane] = if on { limits[lane] } else { -1.0 };
                rays.t_min[lane] = if on { rays.t_min[lane] } else { 0.0 };
                some |= on;
            }
            if some {
                entered[n & 15] = g;
                n += 1;
            }
        }
        if n == 0 {
            return 0;
        }
        let (local, found) = (&local[..n], &mut found[..n]);
        found.fill(HitBlock::MISS);
        self.mesh.with_page(number, |page| page.trace::<S, Q>(simd, local, found, packet));
        let mut changed = 0;
        for (found, &g) in found.iter().zip(&entered) {
            let nearer = merge::<Q>(&mut self.hits[g], found, number, self.instance);
            changed |= u16::from(nearer) << g;
        }
        changed
    }
}

/// Keeps what was found in a page where it is nearer; of two hits at the same distance, that in the
/// page with the lower number. Returns whether there is any.
#[inline(always)]
fn merge<Q: HitQuery>(hits: &mut HitBlock, found: &HitBlock, page: u32, instance: u32) -> bool {
    let mut any = false;
    for lane in 0..LANES {
        let t = found.t[lane];
        let tie = (t == hits.t[lane]) & (page < hits.prim[lane]);
        let better = (found.prim[lane] != NO_HIT) & (Q::ANY | (t < hits.t[lane]) | tie);
        any |= better;
        hits.t[lane] = if better { t } else { hits.t[lane] };
        hits.u[lane] = if better { found.u[lane] } else { hits.u[lane] };
        hits.v[lane] = if better { found.v[lane] } else { hits.v[lane] };
        hits.prim[lane] = if better { page } else { hits.prim[lane] };
        hits.instance[lane] = if better { instance } else { hits.instance[lane] };
    }
    any
}

impl<S: Simd, Q: HitQuery> PacketEntries<S> for Rays<'_, Q> {
    type Query = Q;

    #[inline(never)]
    fn leaf(
        &mut self,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
        mut left: RaysLeft<'_>,
    ) -> u16 {
        let mut changed = 0;
        for &page in leaf_primitive_ids(units, leaf) {
            changed |= self.enter(simd, page, reached, |g| lanes[g & 15]);
        }
        for g in set_bits(changed) {
            left.lower::<Q>(g, &self.hits[g]);
        }
        changed
    }
}

impl<S: Simd, Q: HitQuery> BlockEntries<S> for Rays<'_, Q> {
    type Query = Q;

    #[inline(never)]
    fn leaf(
        &mut self,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        lanes: u16,
        t: &mut [f32; LANES],
        active: &mut u16,
    ) {
        for &page in leaf_primitive_ids(units, leaf) {
            if self.enter(simd, page, 1, |_| lanes & *active) == 0 {
                continue;
            }
            let hits = &self.hits[0];
            for lane in 0..LANES {
                let found = hits.prim[lane] != NO_HIT;
                t[lane] = if found & !Q::ANY { hits.t[lane] } else { t[lane] };
                *active &= !(u16::from(found & Q::ANY) << lane);
            }
        }
    }

    #[inline(never)]
    fn subtree(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        start: ChildRef,
        setups: &[RaySetup; LANES],
        lanes: u16,
        t: &mut [f32; LANES],
        active: &mut u16,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                for lane in set_bits(lanes) {
                    let (shape, ray) = (self.mesh, self.rays[0].get(lane));
                    let (setup, hits) = (&setups[lane], &mut self.hits[0]);
                    if Q::ANY {
                        let mut leaves = ShapeAny { shape, ray, found: false };
                        traverse_from(simd, tree, setup, t[lane], start, &mut leaves);
                        if leaves.found {
                            hits.prim[lane] = 0;
                            *active &= !(1 << lane);
                        }
                        continue;
                    }
                    let found = hits.prim[lane] != NO_HIT;
                    let prim = if found { hits.prim[lane] } else { 0 };
                    let best =
                        ClosestTri { t: t[lane], u: hits.u[lane], v: hits.v[lane], prim, found };
                    let mut leaves = ShapeClosest { shape, ray, best };
                    traverse_from(simd, tree, setup, t[lane], start, &mut leaves);
                    let best = leaves.best;
                    if best.found {
                        t[lane] = best.t;
                        (hits.t[lane], hits.u[lane], hits.v[lane]) = (best.t, best.u, best.v);
                        (hits.prim[lane], hits.instance[lane]) = (best.prim, self.instance);
                    }
                }
            },
        );
    }
}

impl Page {
    /// At most sixteen blocks through the page; the primitives of hits are its triangles.
    fn trace<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        packet: &mut Packet,
    ) {
        let tree = self.view();
        if rays.len() >= FEWEST_GROUPS && packet.load(simd, rays, &PacketLimits::NONE) {
            packet.trace::<S, WatertightTest, Q>(simd, &tree);
            packet.store::<Q>(hits, 0);
        } else {
            meshlets::trace_blocks::<S, WatertightTest, Q>(simd, &tree, rays, hits, 0);
        }
    }
}
