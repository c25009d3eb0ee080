//! Caches geometry by positions and connectivity alone. A moved camera, other colours or flipped
//! normals (geomview turns them to the viewer in each frame) cause no rebuild.

mod refit;

use crate::capture::primitives::PrimitiveRun;
use crate::capture::primitives::{QuadSplit, triangulate};
use rayon::prelude::*;
use rt_core::bvh::{BuildOptions, BuildQuality, World};
use rt_core::glam::Vec3;
use rt_core::math::Aabb;
use rt_core::mesh::TriMesh;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

/// A mesh with its acceleration structure, which is built for the first ray.
pub(crate) struct Geometry {
    /// Triangles; the provoking vertex of each comes last.
    pub(crate) mesh: Arc<TriMesh>,
    /// The hash of the content.
    pub(crate) key: u128,
    world: Mutex<Option<Arc<World>>>,
    best: OnceLock<Arc<World>>,
    bounds: OnceLock<Aabb>,
    clusters: OnceLock<Vec<Aabb>>,
    /// The same triangles in an earlier frame, at their former positions.
    before: Weak<Geometry>,
}

/// The numbers of structures that were built and refitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct BuildCounts {
    /// Built.
    pub(crate) built: u64,
    /// Refitted from the triangles' former positions.
    pub(crate) refitted: u64,
    /// The triangles of those built; of those refitted a sixth, which is what they cost.
    pub(crate) triangles: u64,
}

/// Positions as bytes, and back as vectors.
fn vectors(p: &[[f32; 3]]) -> Vec<Vec3> {
    p.iter().map(|v| Vec3::from_array(*v)).collect()
}

impl Geometry {
    fn new(key: u128, mesh: TriMesh, before: Weak<Geometry>) -> Geometry {
        Geometry {
            mesh: Arc::new(mesh),
            key,
            world: Mutex::new(None),
            best: OnceLock::new(),
            bounds: OnceLock::new(),
            clusters: OnceLock::new(),
            before,
        }
    }

    /// Bounds of the finite positions.
    pub(crate) fn bounds(&self) -> Aabb {
        *self.bounds.get_or_init(|| self.mesh.bounds())
    }

    /// Boxes of runs of triangles, which enclose all of them.
    pub(crate) fn clusters(&self) -> &[Aabb] {
        /// With more boxes, projecting them would cost what the rays do that they save.
        const MOST: usize = 512;
        const LEAST_IN_ONE: usize = 16;
        let make = || -> Vec<Aabb> {
            let mesh = &*self.mesh;
            let each = mesh.num_triangles().div_ceil(MOST).max(LEAST_IN_ONE);
            let of = |run: &[[u32; 3]]| {
                let corners = run.iter().flatten().filter_map(|i| mesh.positions.get(*i as usize));
                Aabb::from_points(corners.filter(|p| p.is_finite()))
            };
            mesh.indices.par_chunks(each).map(of).filter(|b| !b.is_empty()).collect()
        };
        // Nothing is locked while the pool works, for the reason that `world` gives.
        match self.clusters.get() {
            Some(known) => known,
            None => {
                let made = make();
                self.clusters.get_or_init(|| made)
            }
        }
    }

    /// The structure, built now if necessary. `None` when the mesh cannot be built.
    pub(crate) fn world(&self, made: &mut BuildCounts) -> Option<Arc<World>> {
        if let Some(best) = self.best.get() {
            return Some(best.clone());
        }
        if crate::host::config::current().settings.quality == crate::host::config::Quality::Best {
            made.built += 1;
            made.triangles += self.mesh.num_triangles() as u64;
            self.improve();
            return self.best.get().cloned();
        }
        if let Some(world) = self.kept().clone() {
            return Some(world);
        }
        // Nothing is locked meanwhile. The pool that builds also has jobs of several frames. A
        // thread that waits for a part of the build takes another job, which may need the same
        // structure.
        let moved = self.before.upgrade().and_then(|before| refit::structure(&before, &self.mesh));
        let refitted = moved.is_some();
        let world = moved.or_else(|| build(&self.mesh, BuildQuality::Fast));
        let mut kept = self.kept();
        // Another thread may have been first: all take its structure. A mesh that cannot be built
        // is tried again.
        if kept.is_none() {
            made.refitted += u64::from(refitted);
            made.built += u64::from(!refitted);
            let triangles = self.mesh.num_triangles() as u64;
            made.triangles += if refitted { triangles / 6 } else { triangles };
            *kept = world;
        }
        kept.clone()
    }

    /// The quick structures so far. The lock is held only for an instant, never while rays are
    /// traced or trees are built.
    fn kept(&self) -> MutexGuard<'_, Option<Arc<World>>> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The structure, if it exists.
    fn structure_now(&self) -> Option<Arc<World>> {
        self.best.get().cloned().or_else(|| self.kept().clone())
    }

    /// Builds the best structure and keeps it. This runs in the background for geometry that rests.
    pub(crate) fn improve(&self) {
        if self.best.get().is_none()
            && let Some(world) = build(&self.mesh, BuildQuality::Best)
        {
            self.best.set(world).ok();
            *self.kept() = None;
        }
    }
}

fn build(mesh: &Arc<TriMesh>, quality: BuildQuality) -> Option<Arc<World>> {
    let start = std::time::Instant::now();
    let world =
        World::from_mesh(mesh.clone(), &BuildOptions { quality, ..BuildOptions::default() })
            .ok()
            .map(Arc::new);
    let phase = if matches!(quality, BuildQuality::Fast) { "fast build" } else { "best build" };
    crate::host::report::span("builds", phase, 0, start.elapsed());
    world
}

struct CacheEntry {
    geometry: Arc<Geometry>,
    /// The last frame that used it, and the number of frames that did.
    last_used: u64,
    frames: u32,
    improving: bool,
}

/// All geometry of a context.
#[derive(Default)]
pub(crate) struct GeometryCache {
    entries: HashMap<u128, CacheEntry>,
    frame: u64,
    /// The numbers of look-ups that succeeded and failed.
    pub(crate) hits: u64,
    pub(crate) misses: u64,
}

/// The number of frames after which unused geometry is dropped.
const KEPT_FRAMES: u64 = 3;
/// The number of frames after which geometry counts as resting.
const RESTING_FRAMES: u32 = 4;
/// The number of triangles from which a better structure is worth a thread.
const WORTH_IMPROVING: usize = 20_000;

impl GeometryCache {
    /// The geometry of consecutive primitives.
    pub(crate) fn of_runs(
        &mut self,
        positions: &[[f32; 3]],
        runs: &[PrimitiveRun],
        split: &QuadSplit,
    ) -> Arc<Geometry> {
        let mut key = hash(&[bytes_of(positions)]);
        for r in runs {
            key = mix(key, u64::from(r.mode) << 32 | u64::from(r.count));
            key = mix(
                key,
                u64::from(r.times) << 2
                    | u64::from(split.first_provokes) << 1
                    | u64::from(split.all_turned),
            );
        }
        for [from, to] in &split.turned {
            key = mix(key, u64::from(*from) << 32 | u64::from(*to));
        }
        self.find(key, || {
            let mut indices = Vec::new();
            let mut first = 0;
            for r in runs {
                for _ in 0..r.times {
                    triangulate(r.mode, first, r.count, split, &mut indices);
                    first += r.count;
                }
            }
            TriMesh::new(vectors(positions), indices)
        })
    }

    /// The geometry of an indexed draw.
    pub(crate) fn of_indices(
        &mut self,
        positions: &[[f32; 3]],
        indices: &[[u32; 3]],
    ) -> Arc<Geometry> {
        let key = hash(&[bytes_of(positions), bytes_of(indices)]);
        self.find(key, || TriMesh::new(vectors(positions), indices.to_vec()))
    }

    fn find(&mut self, key: u128, make: impl FnOnce() -> TriMesh) -> Arc<Geometry> {
        match self.known(key) {
            Some(geometry) => geometry,
            None => self.insert(key, make()),
        }
    }

    /// The geometry with this key, if it is known.
    pub(crate) fn known(&mut self, key: u128) -> Option<Arc<Geometry>> {
        let frame = self.frame;
        let e = self.entries.get_mut(&key)?;
        self.hits += 1;
        e.frames += u32::from(e.last_used != frame);
        e.last_used = frame;
        Some(e.geometry.clone())
    }

    /// New geometry with a key of the caller's.
    pub(crate) fn put(
        &mut self,
        key: u128,
        positions: &[[f32; 3]],
        triangles: Vec<[u32; 3]>,
    ) -> Arc<Geometry> {
        self.insert(key, TriMesh::new(vectors(positions), triangles))
    }

    fn insert(&mut self, key: u128, mesh: TriMesh) -> Arc<Geometry> {
        self.misses += 1;
        let before = self.before(&mesh);
        let geometry = Arc::new(Geometry::new(key, mesh, before));
        let entry = CacheEntry {
            geometry: geometry.clone(),
            last_used: self.frame,
            frames: 1,
            improving: false,
        };
        self.entries.insert(key, entry);
        geometry
    }

    /// Finds what new geometry was in earlier frames: the same triangles, not drawn in this frame.
    fn before(&self, mesh: &TriMesh) -> Weak<Geometry> {
        const WORTH_REFITTING: usize = 1000;
        if mesh.num_triangles() < WORTH_REFITTING {
            return Weak::new();
        }
        let size = |m: &TriMesh| (m.positions.len(), m.indices.len());
        let was = self
            .entries
            .iter()
            .filter(|(_, e)| e.last_used < self.frame && size(&e.geometry.mesh) == size(mesh));
        // The indices are compared with those of one candidate alone, because a program may have a
        // thousand shapes of one size.
        match was.max_by_key(|(key, e)| (e.last_used, **key)) {
            Some((_, e)) if e.geometry.mesh.indices == mesh.indices => Arc::downgrade(&e.geometry),
            _ => Weak::new(),
        }
    }

    /// Marks geometry as used that was found without a look-up.
    pub(crate) fn touch(&mut self, geometry: &Arc<Geometry>) {
        let frame = self.frame;
        let fresh = || CacheEntry {
            geometry: geometry.clone(),
            last_used: frame,
            frames: 0,
            improving: false,
        };
        let e = self.entries.entry(geometry.key).or_insert_with(fresh);
        e.frames += u32::from(e.last_used != frame);
        e.last_used = frame;
    }

    /// Ends a frame: drops what was unused for long, and improves the structures of what rests.
    pub(crate) fn frame_done(&mut self, improve: impl Fn(Arc<Geometry>) -> bool) {
        self.frame += 1;
        let now = self.frame;
        self.entries.retain(|_, e| now - e.last_used <= KEPT_FRAMES);
        #[expect(clippy::iter_over_hash_type, reason = "each entry for itself")]
        for e in self.entries.values_mut() {
            let rests =
                e.frames >= RESTING_FRAMES && e.geometry.mesh.num_triangles() >= WORTH_IMPROVING;
            if rests && !e.improving {
                e.improving = improve(e.geometry.clone());
            }
        }
    }
}

// ---- Content hash -------------------------------------------------------------------------------
/// Arrays of 4-byte values as 12-byte records.
fn bytes_of<T: bytemuck::Pod>(v: &[T]) -> &[u8] {
    bytemuck::cast_slice(v)
}

fn mix(h: u128, v: u64) -> u128 {
    let (a, b) = (h as u64, (h >> 64) as u64);
    let fold = |x: u64, k: u64| {
        let p = u128::from(x) * u128::from(k);
        (p as u64) ^ ((p >> 64) as u64)
    };
    let a2 = fold(a ^ v, 0x9e37_79b9_7f4a_7c15);
    let b2 = fold(b ^ v.rotate_left(32), 0xd6e8_feb8_6659_fd93);
    u128::from(a2 ^ b.rotate_left(17)) | u128::from(b2 ^ a.rotate_left(31)) << 64
}

/// A 128-bit hash of the arrays' bytes, on all threads. It is not safe against malice: a collision
/// shows another frame's shape.
pub(crate) fn hash(arrays: &[&[u8]]) -> u128 {
    use rayon::prelude::*;
    const CHUNK: usize = 1 << 18;
    let mut h = 0x0123_4567_89ab_cdef_u128 << 64 | 0xfedc_ba98_7654_3210;
    for a in arrays {
        h = mix(h, a.len() as u64);
        if a.len() <= CHUNK {
            h = mix2(h, hash_chunk(a));
            continue;
        }
        let parts: Vec<u128> = match crate::host::config::current().settings.asynchronous {
            // The pool is busy with the previous frame.
            true => a.chunks(CHUNK).map(hash_chunk).collect(),
            false => {
                crate::trace::thread_pool::on_pool(|| a.par_chunks(CHUNK).map(hash_chunk).collect())
            }
        };
        h = parts.iter().fold(h, |h, p| mix2(h, *p));
    }
    h
}

fn mix2(h: u128, v: u128) -> u128 {
    mix(mix(h, v as u64), (v >> 64) as u64)
}

/// Four lanes, so that multiplications overlap.
fn hash_chunk(bytes: &[u8]) -> u128 {
    let mut lanes = [
        0x243f_6a88_85a3_08d3_u64,
        0x1319_8a2e_0370_7344,
        0xa409_3822_299f_31d0,
        0x082e_fa98_ec4e_6c89,
    ];
    let mut blocks = bytes.chunks_exact(32);
    for block in &mut blocks {
        for (lane, w) in lanes.iter_mut().zip(block.chunks_exact(8)) {
            let w = u64::from_ne_bytes(w.try_into().expect("eight bytes"));
            let p = u128::from(*lane ^ w) * 0x9e37_79b9_7f4a_7c15;
            *lane = (p as u64) ^ ((p >> 64) as u64).rotate_left(23) ^ w;
        }
    }
    let mut h = u128::from(bytes.len() as u64);
    for lane in lanes {
        h = mix(h, lane);
    }
    for tail in blocks.remainder().chunks(8) {
        let mut w = [0; 8];
        w[..tail.len()].copy_from_slice(tail);
        h = mix(h, u64::from_ne_bytes(w));
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::enums::TRIANGLES;

    fn grid(n: usize) -> Vec<[f32; 3]> {
        (0..n).map(|i| [i as f32, (i * i % 17) as f32, (i % 5) as f32]).collect()
    }

    #[test]
    fn the_key_is_positions_and_connectivity_alone() {
        let mut cache = GeometryCache::default();
        let p = grid(300_000);
        let runs = [PrimitiveRun { mode: TRIANGLES, count: 3, times: 100_000 }];
        let a = cache.of_runs(&p, &runs, &QuadSplit::default());
        let b = cache.of_runs(&p, &runs, &QuadSplit::default());
        assert!(Arc::ptr_eq(&a, &b));
        let mut moved = p.clone();
        moved[299_999][2] = f32::from_bits(moved[299_999][2].to_bits() ^ 1);
        assert!(!Arc::ptr_eq(&a, &cache.of_runs(&moved, &runs, &QuadSplit::default())));
        let c = cache.of_runs(
            &p,
            &[PrimitiveRun { mode: TRIANGLES, count: 300_000, times: 1 }],
            &QuadSplit::default(),
        );
        assert!(!Arc::ptr_eq(&a, &c));
        assert_eq!((cache.hits, cache.misses), (1, 3));
    }

    /// A thread that waits for a part of a build takes the next job of the pool, which wants the
    /// same.
    #[test]
    fn jobs_of_one_pool_that_want_the_same_structure_do_not_wait_for_each_other() {
        use std::sync::mpsc::channel;
        use std::time::Duration;
        const JOBS: usize = 20;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
        for round in 0..40 {
            let positions: Vec<Vec3> = (0..60_000_u32)
                .map(|i| Vec3::new(i as f32, (i * i % 173) as f32, (i % 5) as f32))
                .collect();
            let triangles = (0..20_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let geometry =
                Arc::new(Geometry::new(round, TriMesh::new(positions, triangles), Weak::new()));
            let (sender, receiver) = channel();
            for _ in 0..JOBS {
                let (geometry, sender) = (geometry.clone(), sender.clone());
                pool.spawn(move || {
                    let mut made = BuildCounts::default();
                    let world = geometry.world(&mut made);
                    sender.send((world.expect("a mesh that can be built"), made)).ok();
                });
                // So that a build is under way, in parts, when the next job comes.
                std::thread::sleep(Duration::from_micros(200));
            }
            let next =
                |_| receiver.recv_timeout(Duration::from_secs(60)).expect("no job waits for ever");
            let all: Vec<_> = (0..JOBS).map(next).collect();
            assert!(all.iter().all(|(w, _)| Arc::ptr_eq(w, &all[0].0)), "all have one structure");
            assert_eq!(all.iter().map(|(_, made)| made.built).sum::<u64>(), 1);
        }
    }

    #[test]
    fn geometry_made_anew_each_frame_does_not_pile_up() {
        let mut cache = GeometryCache::default();
        for i in 0..50 {
            let p = vec![[i as f32; 3]; 30_000];
            cache.of_runs(
                &p,
                &[PrimitiveRun { mode: TRIANGLES, count: 3, times: 10_000 }],
                &QuadSplit::default(),
            );
            cache.frame_done(|_| true);
        }
        assert!(cache.entries.len() <= KEPT_FRAMES as usize + 1, "{}", cache.entries.len());
    }
}
