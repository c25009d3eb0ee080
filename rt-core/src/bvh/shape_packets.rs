//! Many rays through a shape of large primitives, the pages of a stored mesh or the bricks of a
//! stored volume: a packet, or a block of sixteen, goes down the tree of primitives together, and
//! the rays that meet a primitive enter it together. So a page is looked up once for all of them,
//! and what is expanded of it serves all of them.

use crate::bvh::blas::{ShapeAny, ShapeClosest};
use crate::bvh::compact::TrianglePlace;
use crate::bvh::layout::id_leaf::leaf_primitive_ids;
use crate::bvh::layout::wide::{ChildRef, Unit, WideBvh};
use crate::bvh::query::HitQuery;
use crate::bvh::traverse::block_entries::{BlockEntries, traverse_block};
use crate::bvh::traverse::block_hits::{limits_of, set_bits};
use crate::bvh::traverse::packet::{GROUPS, Packet, PacketEntries, PacketLimits, PacketPart};
use crate::bvh::traverse::single::{RaySetup, traverse_from};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::ClosestTri;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use crate::shapes::Shape;
use crate::stored_volume::StoredIsosurface;
use fearless_simd::Simd;
use std::cell::Cell;
use std::marker::PhantomData;

/// A shape whose primitives take many rays at once.
pub(super) trait PacketShape: Shape {
    /// At most sixteen blocks through primitive `prim`; lanes whose ranges are empty hit nothing.
    /// The hits are those of [`Shape::closest`]. `hits` has none yet, and gets any number of a
    /// primitive where there is one. `places`, which has none yet, gets where hit triangles lie in
    /// the primitive.
    fn trace<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        prim: u32,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        places: &mut [[TrianglePlace; LANES]],
    );

    /// Some rays of a packet through primitive `prim`, with what the packet knows of them: calls
    /// `found` for each group with hits ([`Packet::trace_part`]). Returns false, and traces
    /// nothing, where they had better enter it by [`PacketShape::trace`].
    fn trace_part<S: Simd, Q: HitQuery>(
        &self,
        _simd: S,
        _prim: u32,
        _packet: &mut Packet,
        _part: PacketPart<'_>,
        _found: impl FnMut(&Packet, usize),
    ) -> bool {
        false
    }

    /// Gets the closest hits of the rays, with the places of triangles where they are known, for
    /// shading, which will ask for the surface at each.
    fn keep_places(
        &self,
        _rays: &[RayBlock],
        _hits: &[HitBlock],
        _places: &[[TrianglePlace; LANES]],
    ) {
    }
}

impl PacketShape for StoredIsosurface {
    fn trace<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        prim: u32,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        _: &mut [[TrianglePlace; LANES]],
    ) {
        self.closest_of_blocks(simd, prim, rays, hits);
    }
}

/// Per-thread buffers.
struct Room {
    /// Rays on their way to primitives.
    packet: Box<Packet>,
    places: [[TrianglePlace; LANES]; GROUPS],
    inner: PrimitiveRays,
}

/// The rays that enter a primitive, and what they hit there.
struct PrimitiveRays {
    rays: [RayBlock; GROUPS],
    hits: [HitBlock; GROUPS],
    places: [[TrianglePlace; LANES]; GROUPS],
}

thread_local! {
    static ROOM: Cell<Option<Box<Room>>> = const { Cell::new(None) };
}

impl Room {
    fn new() -> Box<Room> {
        let (rays, hits) = ([RayBlock::INACTIVE; GROUPS], [HitBlock::MISS; GROUPS]);
        let places = [[TrianglePlace::NONE; LANES]; GROUPS];
        let inner = PrimitiveRays { rays, hits, places };
        Box::new(Room { packet: Packet::new(), places, inner })
    }
}

/// Traces blocks in the local space of a shape, of whose primitives `tree` is the tree. The hits
/// are those of single rays, bit for bit; `hits` has none yet.
pub(super) fn trace<S: Simd, Q: HitQuery, P: PacketShape>(
    simd: S,
    tree: &WideBvh,
    shape: &P,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    instance: u32,
) {
    // Should a page be read by a caller's function that traces rays itself, it makes room of its
    // own.
    let mut room = ROOM.take().unwrap_or_else(Room::new);
    let Room { packet, places, inner } = &mut *room;
    for (rays, hits) in rays.chunks(GROUPS).zip(hits.chunks_mut(GROUPS)) {
        let places = &mut places[..rays.len()];
        places.fill([TrianglePlace::NONE; LANES]);
        let query = PhantomData::<Q>;
        if packet.load(simd, rays, &PacketLimits::NONE) {
            let (hits, places) = (&mut *hits, &mut *places);
            let mut entries = Rays { shape, rays, hits, places, instance, inner, query };
            packet.visit_entries(simd, &TreeView::all(tree), &mut entries);
        } else {
            let blocks = rays.chunks(1).zip(hits.chunks_mut(1)).zip(places.chunks_mut(1));
            for ((rays, hits), places) in blocks {
                let active = rays[0].active_lanes();
                let mut block = Rays { shape, rays, hits, places, instance, inner, query };
                traverse_block(simd, tree, &rays[0], active, &mut block);
            }
        }
        if !Q::ANY {
            shape.keep_places(rays, hits, places);
        }
    }
    ROOM.set(Some(room));
}

/// A packet, or a block, on its way through the tree of primitives.
struct Rays<'a, Q, P> {
    shape: &'a P,
    rays: &'a [RayBlock],
    hits: &'a mut [HitBlock],
    places: &'a mut [[TrianglePlace; LANES]],
    instance: u32,
    inner: &'a mut PrimitiveRays,
    query: PhantomData<Q>,
}

impl<Q: HitQuery, P: PacketShape> Rays<'_, Q, P> {
    /// The rays `lanes` of the groups `reached` through a primitive. Returns the groups with nearer
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
        let PrimitiveRays { rays: local, hits: found, places } = &mut *self.inner;
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
        let (local, found, places) = (&local[..n], &mut found[..n], &mut places[..n]);
        found.fill(HitBlock::MISS);
        places.fill([TrianglePlace::NONE; LANES]);
        self.shape.trace::<S, Q>(simd, number, local, found, places);
        let mut changed = 0;
        for ((found, places), &g) in found.iter().zip(&*places).zip(&entered) {
            let (hits, kept) = (&mut self.hits[g], &mut self.places[g]);
            let nearer = keep_nearer::<Q>(hits, kept, found, places, number, self.instance);
            changed |= u16::from(nearer) << g;
        }
        changed
    }

    /// As [`Rays::enter`], by rays that stay in the packet.
    #[inline(always)]
    fn enter_in_packet<S: Simd>(
        &mut self,
        packet: &mut Packet,
        simd: S,
        number: u32,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16 {
        let Rays { shape, rays, instance, .. } = *self;
        // The hits are changed after the part has begun with them.
        let before = &*self.hits;
        let (mut changed, mut results) = (0, [const { None }; GROUPS]);
        let part = PacketPart { rays, hits: before, reached, lanes };
        let traced = shape.trace_part::<S, Q>(simd, number, packet, part, |packet, g| {
            results[g & 15] = Some((packet.hits_of(g), packet.place[g & 15]));
        });
        if !traced {
            return self.enter(simd, number, reached, |g| lanes[g & 15]);
        }
        for (g, result) in results.iter().enumerate() {
            let Some((found, places)) = result else { continue };
            let (hits, kept) = (&mut self.hits[g], &mut self.places[g]);
            let nearer = keep_nearer::<Q>(hits, kept, found, places, number, instance);
            changed |= u16::from(nearer) << g;
        }
        changed
    }
}

/// Keeps what was found in primitive `prim` where it is nearer ([`merge`]), with its place. Returns
/// whether anything was.
#[inline(always)]
fn keep_nearer<Q: HitQuery>(
    hits: &mut HitBlock,
    places: &mut [TrianglePlace; LANES],
    found: &HitBlock,
    places_found: &[TrianglePlace; LANES],
    prim: u32,
    instance: u32,
) -> bool {
    let nearer = merge::<Q>(hits, found, prim, instance);
    for lane in 0..LANES {
        let is_nearer = nearer >> lane & 1 == 1;
        places[lane] = if is_nearer { places_found[lane] } else { places[lane] };
    }
    nearer != 0
}

/// Keeps what was found in primitive `prim` where it is nearer; of two hits at the same distance,
/// that of the primitive with the lower number. Returns the lanes where it is kept.
#[inline(always)]
fn merge<Q: HitQuery>(hits: &mut HitBlock, found: &HitBlock, prim: u32, instance: u32) -> u16 {
    let mut kept = 0;
    for lane in 0..LANES {
        let t = found.t[lane];
        let tie = (t == hits.t[lane]) & (prim < hits.prim[lane]);
        let better = (found.prim[lane] != NO_HIT) & (Q::ANY | (t < hits.t[lane]) | tie);
        kept |= u16::from(better) << lane;
        hits.t[lane] = if better { t } else { hits.t[lane] };
        hits.u[lane] = if better { found.u[lane] } else { hits.u[lane] };
        hits.v[lane] = if better { found.v[lane] } else { hits.v[lane] };
        hits.prim[lane] = if better { prim } else { hits.prim[lane] };
        hits.instance[lane] = if better { instance } else { hits.instance[lane] };
    }
    kept
}

impl<S: Simd, Q: HitQuery, P: PacketShape> PacketEntries<S> for Rays<'_, Q, P> {
    type Query = Q;

    #[inline(never)]
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16 {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut all = 0;
                for &prim in leaf_primitive_ids(units, leaf) {
                    let changed = self.enter_in_packet(packet, simd, prim, reached, lanes);
                    for g in set_bits(changed) {
                        packet.left().lower::<Q>(g, &self.hits[g]);
                    }
                    all |= changed;
                }
                all
            },
        )
    }
}

impl<S: Simd, Q: HitQuery, P: PacketShape> BlockEntries<S> for Rays<'_, Q, P> {
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
        for &prim in leaf_primitive_ids(units, leaf) {
            if self.enter(simd, prim, 1, |_| lanes & *active) == 0 {
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
                    let (shape, ray) = (self.shape, self.rays[0].get(lane));
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
                        // A ray that goes alone does not say where its triangle lies.
                        self.places[0][lane] = TrianglePlace::NONE;
                        (hits.t[lane], hits.u[lane], hits.v[lane]) = (best.t, best.u, best.v);
                        (hits.prim[lane], hits.instance[lane]) = (best.prim, self.instance);
                    }
                }
            },
        );
    }
}
