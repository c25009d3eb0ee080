//! Rays that continue from the points of a wavefront, as the effects need them.

use super::wavefront::RayState;
use super::{FrameContext, TileArea, TileLayers, Workspace, path, specular};
use crate::effects::Effects;
use crate::ray::Ray;
use crate::ray_stats::RayStats;

/// Rays that continue from the wavefront's points.
pub(super) fn spawn_rays(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    stats: &mut RayStats,
) {
    let e = context.effects;
    let (before_behind, before_scattered) = (work.behind.states.len(), work.scattered.states.len());
    if e.contains(Effects::PATH_TRACING) {
        path::continue_paths(context, area, work, stats);
    } else {
        if e.intersects(Effects::REFLECTION | Effects::GLOSSY_REFLECTION | Effects::REFRACTION) {
            specular::spawn_specular_rays(context, area, work, stats);
        }
        if e.contains(Effects::TRANSPARENCY) {
            spawn_transparent_rays(context, work, stats);
        }
    }
    if let Some(cost) = out.cost_mut() {
        for s in work.behind.states[before_behind..]
            .iter()
            .chain(&work.scattered.states[before_scattered..])
        {
            cost[s.slot as usize] += 1.0;
        }
    }
}

/// Continues rays behind transparent surfaces: the same ray with a later start, so that packets
/// stay coherent.
pub(super) fn spawn_transparent_rays(
    context: &FrameContext<'_>,
    work: &mut Workspace,
    stats: &mut RayStats,
) {
    for p in work.points.iter().filter(|p| p.surface.opacity < 1.0) {
        let state = work.current.states[p.lane as usize];
        let left = 1.0 - p.surface.opacity;
        let throughput = state.throughput * left;
        let ray = work.current.ray(p.lane as usize);
        let ray = Ray { t_min: p.surface.t_behind(&ray, p.t), ..ray };
        if !ray.is_valid() {
            continue;
        }
        if throughput.max_element() < context.options.min_contribution {
            stats.cut_at_min_contribution += 1;
            continue;
        }
        let stream = crate::sampler::hash(state.stream.wrapping_add(0x51ed_270b));
        let coverage = state.coverage * left;
        work.behind.push(&ray, RayState { throughput, coverage, stream, first: false, ..state });
        stats.transparency += 1;
    }
}
