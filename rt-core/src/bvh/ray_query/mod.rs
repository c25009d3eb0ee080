//! Queries for some instances only, and for hits that the caller accepts.

mod search;

use super::instance_filter::InstanceFilter;
use super::streams::{Coherence, StreamError};
use super::world::{World, with_ordinary_length};
use crate::bvh::options::Robustness;
use crate::bvh::query::{FastTest, WatertightTest};
use crate::ray::{Hit, HitBlock, LANES, Ray, RayBlock};
use fearless_simd::dispatch;
use search::AcceptedHits;

/// Masks were not given for every instance.
///
/// ```
/// use rt_core::bvh::MaskError;
///
/// let error = MaskError { instances: 3, masks: 2 };
/// assert_eq!(error.to_string(), "2 masks for 3 instances; give one for each");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{masks} masks for {instances} instances; give one for each")]
pub struct MaskError {
    /// Instances of the world.
    pub instances: usize,
    /// Masks given.
    pub masks: usize,
}

/// Whether a hit counts.
pub(super) type Accept<'a> = &'a (dyn Fn(&Hit) -> bool + Sync);

/// A ray query with conditions, from [`World::query`]: instance masks, and a filter for hits.
/// Without conditions, all answers are those of [`World`]'s own methods, bit for bit.
///
/// ```
/// use rt_core::prelude::*;
///
/// // Two quadrangles, one behind the other; the nearer one is a fence with holes.
/// let corners = [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)];
/// let quad = |z| corners.map(|(x, y)| Vec3::new(x, y, z));
/// let mesh = |z| TriMesh::new(quad(z).to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
/// let geometries = [mesh(2.0), mesh(0.0)].map(|m| Geometry::Mesh(m.into())).to_vec();
/// let placed = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
/// let world = World::build(geometries, vec![placed(0), placed(1)], &BuildOptions::default())?;
/// let down = Ray::new(Vec3::new(0.5, 0.25, 5.0), Vec3::NEG_Z);
/// assert_eq!(world.closest(&down).unwrap().instance, 0);
///
/// // Rays with the mask 2 meet the second instance only.
/// let masks = [0b01, 0b11];
/// let second = world.query().with_masks(&masks, 0b10).unwrap();
/// assert_eq!(second.closest(&down).unwrap().t, 5.0);
///
/// // A hit with the fence counts where u is below a half.
/// let wood = |hit: &Hit| hit.instance != 0 || hit.u < 0.5;
/// let through = world.query().accepting(&wood).closest(&down).unwrap();
/// assert_eq!(through.instance, if world.closest(&down).unwrap().u < 0.5 { 0 } else { 1 });
/// # Ok::<(), rt_core::bvh::BuildError>(())
/// ```
#[derive(Clone, Copy)]
pub struct RayQuery<'a> {
    world: &'a World,
    filter: InstanceFilter<'a>,
    accept: Option<Accept<'a>>,
}

impl World {
    /// A ray query to which conditions can be added.
    pub fn query(&self) -> RayQuery<'_> {
        RayQuery { world: self, filter: InstanceFilter::All, accept: None }
    }
}

impl<'a> RayQuery<'a> {
    /// Rays meet an instance only where its mask and `ray_mask` have a bit in common. So an
    /// instance with the mask 0 is never met, and rays with the mask 0 meet nothing. Other
    /// instances cost nothing: their subtrees are left out, also those of meshes that share a tree.
    ///
    /// # Errors
    /// When there is not one mask for each instance.
    pub fn with_masks(self, instance_masks: &'a [u32], ray_mask: u32) -> Result<Self, MaskError> {
        let (instances, masks) = (self.world.instances().len(), instance_masks.len());
        if instances != masks {
            return Err(MaskError { instances, masks });
        }
        Ok(RayQuery { filter: InstanceFilter::Masked { instance_masks, ray_mask }, ..self })
    }

    /// Only hits for which `accept` returns true count: [`RayQuery::closest`] is the closest of
    /// these, with the same rule for ties as [`World::closest`].
    ///
    /// A ray asks about hits within `[t_min, t_max)`, in no promised order, perhaps about some more
    /// than once, and not about those behind one that it has accepted already. So the answer must
    /// depend on the hit alone. A shape whose nearest hit is refused is asked for the next one. The
    /// filter runs on the threads that trace.
    ///
    /// Blocks are traced ray by ray, because packets do not keep the hits that a filter may refuse.
    pub fn accepting(self, accept: &'a (dyn Fn(&Hit) -> bool + Sync)) -> Self {
        RayQuery { accept: Some(accept), ..self }
    }

    /// As [`World::closest`].
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        if !ray.is_valid() {
            return None;
        }
        if let Some(accept) = self.accept {
            return self.first_accepted(ray, accept, false);
        }
        let mut room = Ray::UNSET;
        let (ray, unit) = with_ordinary_length(ray, &mut room);
        let (world, filter) = (self.world, self.filter);
        let hit = dispatch!(world.level, simd => match world.robustness {
            Robustness::Fast => world.closest_in::<_, FastTest>(simd, ray, filter),
            Robustness::Watertight => world.closest_in::<_, WatertightTest>(simd, ray, filter),
        });
        hit.map(|h| Hit { t: h.t * unit, ..h })
    }

    /// As [`World::occluded`].
    pub fn occluded(&self, ray: &Ray) -> bool {
        if !ray.is_valid() {
            return false;
        }
        if let Some(accept) = self.accept {
            return self.first_accepted(ray, accept, true).is_some();
        }
        let mut room = Ray::UNSET;
        let (ray, _) = with_ordinary_length(ray, &mut room);
        let (world, filter) = (self.world, self.filter);
        dispatch!(world.level, simd => match world.robustness {
            Robustness::Fast => world.occluded_in::<_, FastTest>(simd, ray, filter),
            Robustness::Watertight => world.occluded_in::<_, WatertightTest>(simd, ray, filter),
        })
    }

    /// As [`World::closest_coherent`].
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn closest_coherent(
        &self,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
    ) -> Result<(), StreamError> {
        self.closest_blocks(rays, hits, Coherence::Coherent)
    }

    /// As [`World::closest_incoherent`].
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn closest_incoherent(
        &self,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
    ) -> Result<(), StreamError> {
        self.closest_blocks(rays, hits, Coherence::Incoherent)
    }

    /// As [`World::occluded_coherent`].
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn occluded_coherent(&self, rays: &[RayBlock], out: &mut [u16]) -> Result<(), StreamError> {
        self.occluded_blocks(rays, out, Coherence::Coherent)
    }

    /// As [`World::occluded_incoherent`].
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn occluded_incoherent(
        &self,
        rays: &[RayBlock],
        out: &mut [u16],
    ) -> Result<(), StreamError> {
        self.occluded_blocks(rays, out, Coherence::Incoherent)
    }

    fn closest_blocks(
        &self,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        coherence: Coherence,
    ) -> Result<(), StreamError> {
        super::streams::same_length(rays.len(), hits.len())?;
        if self.accept.is_none() {
            self.world.closest_stream(rays, hits, coherence, self.filter);
            return Ok(());
        }
        for (block, hits) in rays.iter().zip(hits) {
            for lane in 0..LANES {
                hits.set(lane, self.closest(&block.get(lane)));
            }
        }
        Ok(())
    }

    fn occluded_blocks(
        &self,
        rays: &[RayBlock],
        out: &mut [u16],
        coherence: Coherence,
    ) -> Result<(), StreamError> {
        super::streams::same_length(rays.len(), out.len())?;
        if self.accept.is_none() {
            self.world.occluded_stream(rays, out, coherence, self.filter);
            return Ok(());
        }
        for (block, out) in rays.iter().zip(out) {
            let blocked = |lane| self.occluded(&block.get(lane));
            *out = (0..LANES).fold(0, |mask, lane| mask | u16::from(blocked(lane)) << lane);
        }
        Ok(())
    }

    /// The closest hit that counts of a valid ray, or with `any` some hit that counts.
    fn first_accepted(&self, ray: &Ray, accept: Accept<'_>, any: bool) -> Option<Hit> {
        let mut room = Ray::UNSET;
        let (ray, unit) = with_ordinary_length(ray, &mut room);
        let (world, filter) = (self.world, self.filter);
        let hit = dispatch!(world.level, simd => match world.robustness {
            Robustness::Fast => {
                AcceptedHits::<FastTest>::new(world, *ray, unit, filter, accept, any).find(simd)
            }
            Robustness::Watertight => {
                AcceptedHits::<WatertightTest>::new(world, *ray, unit, filter, accept, any)
                    .find(simd)
            }
        });
        hit.map(|h| Hit { t: h.t * unit, ..h })
    }
}
