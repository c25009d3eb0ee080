//! Frames that need nothing but camera rays: trace, look up, light, done. No waves, no ray states, no points kept.
//!
//! The same lights and lobes as the general loop, fused into one pass over the hits of a tile.

use super::direct::incident_from;
use super::lobes::{ambient_albedo, response};
use super::stage::Stage;
use super::tile::{PIXELS, TileArea, TileLayers};
use super::{Workspace, camera_blocks};
use crate::effects::Effects;
use crate::environment::Background;
use crate::light::PlacedKind;
use crate::material::SurfaceModel;
use crate::ray::{HitBlock, LANES};
use crate::ray_stats::RayStats;
use glam::Vec3;

/// True when the frame has no effect beyond the lens.
pub(super) fn suffices(stage: &Stage<'_>) -> bool {
    stage.effects.without(Effects::DEPTH_OF_FIELD).is_empty()
}

pub(super) fn render_tile(
    stage: &Stage<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    sample: Option<u32>,
    record: bool,
    stats: &mut RayStats,
) {
    camera_blocks(stage, area, &mut work.current.blocks, sample, stats, out.cost_mut());
    work.hits.clear();
    work.hits.resize(PIXELS / LANES, HitBlock::MISS);
    stage.scene.world.closest_coherent(&work.current.blocks, &mut work.hits);
    work.pixels.clear();
    work.pixels.resize(PIXELS, [0.0; 4]);
    let has_place = |l: &crate::light::PlacedLight| !matches!(l.kind, PlacedKind::Directional { .. });
    if stage.lights.iter().any(has_place) {
        light_hits::<true>(stage, area, out, work, record, stats);
    } else {
        light_hits::<false>(stage, area, out, work, record, stats);
    }
    out.add_sample(&work.pixels, sample.is_none_or(|s| s == 0));
}

/// Colours of a tile. `POINT`: some light needs to know where the surface is.
fn light_hits<const POINT: bool>(
    stage: &Stage<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    record: bool,
    stats: &mut RayStats,
) {
    let empty = stage.scene.background == Background::Transparent;
    // Asking for the triangles of later blocks ahead of time was tried: no difference at a million triangles, where shading is bound
    // by arithmetic.
    for slot in 0..PIXELS {
        let hits = &work.hits[slot / LANES];
        let Some(hit) = hits.get(slot % LANES) else {
            if !empty && let Some([_, y]) = area.pixel(slot as u16) {
                let ray = work.current.blocks[slot / LANES].get(slot % LANES);
                let [r, g, b, a] = stage.background(y, ray.dir);
                work.pixels[slot] = [r * a, g * a, b * a, a];
            }
            continue;
        };
        let ray = work.current.blocks[slot / LANES].get(slot % LANES);
        let placed = stage.placed(&hit);
        let material = placed.material;
        let surface = placed.look::<POINT>(&ray, &hit);
        stats.opacity_ignored += (surface.opacity < 1.0) as u64;
        if record {
            out.record(stage, area, slot as u16, &ray, &hit, || surface.normal);
        }
        let mut radiance = Vec3::from(material.emission);
        if material.model == SurfaceModel::Unlit {
            radiance += surface.color;
        } else {
            // Matte surfaces look the same from everywhere.
            let view =
                if material.model == SurfaceModel::Matte { Vec3::ZERO } else { -ray.dir.normalize_or_zero() };
            for light in &stage.lights {
                let incident = incident_from(light, surface.point, None);
                let answer = response(material, &surface, view, incident.dir, light.color, light.highlight);
                radiance += answer * incident.strength;
            }
            if let Some(mean) = &stage.mean_radiance {
                radiance +=
                    ambient_albedo(material, &surface, stage.effects) * mean.for_normal(surface.normal);
            }
        }
        work.pixels[slot] = [radiance.x, radiance.y, radiance.z, 1.0];
    }
}
