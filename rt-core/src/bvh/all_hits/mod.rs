//! All surfaces that a ray crosses, not the nearest alone: thickness, parity, lengths in bodies.

mod collect;
mod in_turns;
mod inside;

use super::streams::{StreamError, same_length};
use super::traverse::packet::GROUPS;
use super::world::{World, with_ordinary_length};
use crate::ray::{Hit, LANES, Ray, RayBlock};
use collect::Crossings;
use fearless_simd::dispatch;
use std::cell::{Cell, RefCell};

/// A list would have become longer than its caller allows.
///
/// ```
/// use rt_core::bvh::TooManyHits;
///
/// let error = TooManyHits { ray: 3, limit: 100 };
/// assert!(error.to_string().starts_with("ray 3 and those before it have more than 100 hits"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "ray {ray} and those before it have more than {limit} hits: allow more, trace fewer rays in \
     one call, or count the hits with World::count_hits"
)]
pub struct TooManyHits {
    /// The ray at which the limit was reached: its number in the call.
    pub ray: usize,
    /// Most hits that were allowed.
    pub limit: usize,
}

/// The hits of many rays, one list after the other.
///
/// ```
/// use rt_core::bvh::HitLists;
/// use rt_core::prelude::*;
/// use rt_core::ray::RayBlock;
///
/// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
/// let world =
///     World::from_mesh(TriMesh::new(corners, vec![[0, 1, 2]]), &BuildOptions::default())?;
/// let ray = |x: f32| Ray::new(Vec3::new(x, 0.25, 1.0), Vec3::NEG_Z);
/// let blocks = RayBlock::from_rays(&[ray(5.0), ray(0.25)]);
/// let lists: HitLists = world.all_hits_of_blocks(&blocks, 1000).unwrap();
/// assert!(lists.of_ray(0).is_empty());
/// assert_eq!(lists.of_ray(1)[0].t, 1.0);
/// assert_eq!(lists.starts()[..3], [0, 0, 1]);
/// # Ok::<(), rt_core::bvh::BuildError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HitLists {
    /// Where each ray's list starts, and the number of all hits.
    starts: Vec<usize>,
    hits: Vec<Hit>,
}

impl HitLists {
    /// Number of rays.
    pub fn num_rays(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The hits of a ray, nearest first; empty for rays that the call did not have.
    pub fn of_ray(&self, ray: usize) -> &[Hit] {
        match (self.starts.get(ray), self.starts.get(ray + 1)) {
            (Some(&from), Some(&to)) => &self.hits[from..to],
            _ => &[],
        }
    }

    /// Where each ray's list starts in [`HitLists::hits`], and one more entry: their number.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// The hits of all rays.
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }
}

impl World {
    /// All hits with `t_min <= t < t_max`, nearest first; of equal distances, the lowest instance,
    /// then the lowest primitive comes first.
    ///
    /// A surface counts once where the ray meets an edge or a vertex that triangles share, so a ray
    /// enters and leaves a closed mesh equally often. The test is the watertight one in either
    /// [`super::Robustness`]. Meshes count triangle by triangle, other shapes surface by surface.
    ///
    /// ```
    /// use rt_core::prelude::*;
    ///
    /// // Two layers that share nothing.
    /// let corners = [Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::Y * 9.0];
    /// let layer = |z: f32| corners.map(|c| c + Vec3::Z * z);
    /// let mesh = TriMesh::new([layer(0.0), layer(1.0)].concat(), vec![[0, 1, 2], [3, 4, 5]]);
    /// let world = World::from_mesh(mesh, &BuildOptions::default())?;
    /// let hits = world.all_hits(&Ray::new(Vec3::new(0.0, 0.0, 4.0), Vec3::NEG_Z), 100).unwrap();
    /// assert_eq!(hits.iter().map(|h| (h.prim, h.t)).collect::<Vec<_>>(), [(1, 3.0), (0, 4.0)]);
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// When there are more than `limit` hits.
    pub fn all_hits(&self, ray: &Ray, limit: usize) -> Result<Vec<Hit>, TooManyHits> {
        let mut hits = Vec::new();
        self.append_hits(ray, 0, limit, &mut hits)?;
        Ok(hits)
    }

    /// The hits of each ray of `rays`, as [`World::all_hits`] gives them. Ray `i` is lane `i % 16`
    /// of block `i / 16`; idle lanes have none. The calling thread does the work.
    ///
    /// # Errors
    /// When all rays together have more than `limit` hits. One hit takes 20 bytes.
    pub fn all_hits_of_blocks(
        &self,
        rays: &[RayBlock],
        limit: usize,
    ) -> Result<HitLists, TooManyHits> {
        let mut lists = HitLists { starts: vec![0], hits: Vec::new() };
        for (group, rays) in rays.chunks(GROUPS).enumerate() {
            self.append_group(rays, group * GROUPS * LANES, limit, &mut lists)?;
        }
        Ok(lists)
    }

    /// The lists of at most sixteen blocks, whose first ray is number `first` of the call.
    fn append_group(
        &self,
        rays: &[RayBlock],
        first: usize,
        limit: usize,
        lists: &mut HitLists,
    ) -> Result<(), TooManyHits> {
        let num_rays = rays.len() * LANES;
        let HitLists { starts, hits } = lists;
        let room = limit.saturating_sub(hits.len());
        let found = RefCell::new(Vec::new());
        let full = Cell::new(false);
        self.visit_hits_of_group(rays, &|ray, hit| {
            let mut found = found.borrow_mut();
            full.set(full.get() || found.len() >= room);
            if !full.get() {
                found.push((ray, hit));
            }
            full.get()
        });
        if full.get() {
            // Rays in turns do not tell which of them is the first for which there is no room.
            for ray in 0..num_rays {
                let number = first + ray;
                self.append_hits(&rays[ray / LANES].get(ray % LANES), number, limit, hits)?;
                starts.push(hits.len());
            }
            return Ok(());
        }
        // The rays' lists in one another's place: counted, then filled.
        let found = found.into_inner();
        let mut next = [0; GROUPS * LANES + 1];
        for (ray, _) in &found {
            next[ray + 1] += 1;
        }
        next[0] = hits.len();
        for ray in 0..num_rays {
            next[ray + 1] += next[ray];
        }
        starts.extend_from_slice(&next[1..=num_rays]);
        hits.resize(hits.len() + found.len(), UNSET);
        for (ray, hit) in found {
            hits[next[ray]] = hit;
            next[ray] += 1;
        }
        let mut from = starts[first];
        for to in &starts[first + 1..] {
            sort(&mut hits[from..*to]);
            from = *to;
        }
        Ok(())
    }

    /// The number of hits of each ray of `rays`, as [`World::count_hits`] gives it: that of the ray
    /// in lane `l` of block `b` is `counts[b][l]`, 0 for idle lanes. The calling thread does the
    /// work.
    ///
    /// ```
    /// use rt_core::prelude::*;
    /// use rt_core::ray::RayBlock;
    ///
    /// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let world =
    ///     World::from_mesh(TriMesh::new(corners, vec![[0, 1, 2]]), &BuildOptions::default())?;
    /// let ray = |x: f32| Ray::new(Vec3::new(x, 0.25, 1.0), Vec3::NEG_Z);
    /// let (blocks, mut counts) = (RayBlock::from_rays(&[ray(5.0), ray(0.25)]), [[0; 16]]);
    /// world.count_hits_of_blocks(&blocks, &mut counts).unwrap();
    /// assert_eq!(counts[0][..2], [0, 1]);
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn count_hits_of_blocks(
        &self,
        rays: &[RayBlock],
        counts: &mut [[u32; LANES]],
    ) -> Result<(), StreamError> {
        same_length(rays.len(), counts.len())?;
        for (rays, counts) in rays.chunks(GROUPS).zip(counts.chunks_mut(GROUPS)) {
            let found = [const { Cell::new(0) }; GROUPS * LANES];
            self.visit_hits_of_group(rays, &|ray, _| {
                found[ray].update(|count| count + 1);
                false
            });
            for (counts, found) in counts.iter_mut().zip(found.chunks(LANES)) {
                for (count, found) in counts.iter_mut().zip(found) {
                    *count = found.get();
                }
            }
        }
        Ok(())
    }

    /// Number of hits that [`World::all_hits`] would find. Needs no memory for them.
    pub fn count_hits(&self, ray: &Ray) -> usize {
        let mut count = 0;
        self.visit_hits(ray, |_| {
            count += 1;
            false
        });
        count
    }

    fn append_hits(
        &self,
        ray: &Ray,
        number: usize,
        limit: usize,
        hits: &mut Vec<Hit>,
    ) -> Result<(), TooManyHits> {
        let first = hits.len();
        let mut full = false;
        self.visit_hits(ray, |hit| {
            full = hits.len() >= limit;
            if !full {
                hits.push(hit);
            }
            full
        });
        if full {
            return Err(TooManyHits { ray: number, limit });
        }
        sort(&mut hits[first..]);
        Ok(())
    }

    /// Passes each hit of at most sixteen blocks to `found`, in no order, with the number of its
    /// ray. Where `found` returns true, that ray ends.
    fn visit_hits_of_group(&self, rays: &[RayBlock], found: &dyn Fn(usize, Hit) -> bool) {
        if self.visit_hits_in_turns(rays, found) {
            return;
        }
        for (b, block) in rays.iter().enumerate() {
            for lane in 0..LANES {
                self.visit_hits(&block.get(lane), |hit| found(b * LANES + lane, hit));
            }
        }
    }

    /// Passes each hit to `found`, in no order, until it returns true.
    fn visit_hits(&self, ray: &Ray, mut found: impl FnMut(Hit) -> bool) {
        if !ray.is_valid() {
            return;
        }
        let mut room = Ray::UNSET;
        let (ray, unit) = with_ordinary_length(ray, &mut room);
        let found = |hit: Hit| found(Hit { t: hit.t * unit, ..hit });
        dispatch!(self.level, simd => Crossings::new(self, *ray, found).find(simd));
    }
}

/// Where a hit will stand.
const UNSET: Hit = Hit { t: 0.0, u: 0.0, v: 0.0, prim: 0, instance: 0 };

/// The order of a list: by distance; of equal distances, by instance and primitive.
fn sort(hits: &mut [Hit]) {
    hits.sort_unstable_by(|a, b| {
        a.t.total_cmp(&b.t).then((a.instance, a.prim).cmp(&(b.instance, b.prim)))
    });
}
