//! Leaves of the top level: each instance's own tree is traced in turn.

use super::blas::leaf_primitive_ids;
use super::layout::wide::{ChildRef, Unit};
use super::world::{InstanceFilter, World};
use crate::bvh::traverse::single::{LeafTest, inflate_t};
use crate::ray::{Hit, Ray};
use fearless_simd::Simd;

pub(super) struct InstanceClosest<'w, const EXACT: bool> {
    pub(super) world: &'w World,
    pub(super) ray: Ray,
    pub(super) filter: InstanceFilter<'w>,
    pub(super) best: Option<Hit>,
}

impl<const EXACT: bool> InstanceClosest<'_, EXACT> {
    pub(super) fn try_instance<S: Simd>(&mut self, simd: S, instance: u32, skip_t: &mut f32) {
        let p = &self.world.placements[instance as usize];
        // One ulp past the best so far: a tie may go to this instance.
        let limit = self.best.map_or(self.ray.t_max, |b| b.t.next_up());
        let (local, moved) = p.enter(&Ray { t_max: limit, ..self.ray });
        if local.t_max <= local.t_min {
            return;
        }
        let c = self.world.blas[p.geometry].closest::<S, EXACT>(simd, &local);
        if !c.found {
            return;
        }
        let t = if moved == 0.0 { c.t } else { (c.t as f64 + moved) as f32 };
        let better = self.best.is_none_or(|b| t < b.t || (t == b.t && instance < b.instance));
        if better {
            self.best = Some(Hit { t, u: c.u, v: c.v, prim: c.prim, instance });
            *skip_t = inflate_t(t);
        }
    }
}

impl<S: Simd, const EXACT: bool> LeafTest<S> for InstanceClosest<'_, EXACT> {
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        let filter = self.filter;
        for &i in leaf_primitive_ids(units, leaf).iter().filter(|&&i| filter.has(i as usize)) {
            self.try_instance(simd, i, skip_t);
        }
        false
    }
}

pub(super) struct InstanceAny<'w, const EXACT: bool> {
    pub(super) world: &'w World,
    pub(super) ray: Ray,
    pub(super) filter: InstanceFilter<'w>,
    pub(super) found: bool,
}

impl<S: Simd, const EXACT: bool> LeafTest<S> for InstanceAny<'_, EXACT> {
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        let (world, ray, filter) = (self.world, self.ray, self.filter);
        self.found = leaf_primitive_ids(units, leaf)
            .iter()
            .filter(|&&i| filter.has(i as usize))
            .any(|&i| world.instance_occluded::<S, EXACT>(simd, i as usize, &ray));
        self.found
    }
}
