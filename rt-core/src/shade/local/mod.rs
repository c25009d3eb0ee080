//! Frames that need nothing but camera rays: trace, look up, light, done. No waves, no ray states, no points kept.
//!
//! The same lights and lobes as the general loop, sixteen pixels at a time. Half of the time beyond tracing was waiting for vertices (measured on a million triangles, one after
//! the other: 30 of 60 ns per pixel), so a tile first asks for its triangles, then for their vertices, and only then looks at them.

mod light;

use super::direct::incident_from;
use super::layers::record_block;
use super::lobes::{ambient_albedo, response};
use super::stage::Stage;
use super::tile::{PIXELS, TileArea, TileLayers};
use super::{OPAQUE, Workspace, camera_blocks, prefetch_surfaces};
use crate::accel::{Among, Coherence};
use crate::detail::Varied;
use crate::effects::Effects;
use crate::environment::Background;
use crate::light::PlacedKind;
use crate::material::{Material, SurfaceModel};
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use crate::ray_stats::RayStats;
use crate::simd::vectors::{Row, Rows3};
use crate::surface::{Look, Looks};
use fearless_simd::{Simd, dispatch};
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
    work.hits.resize(PIXELS / LANES, HitBlock::MISS);
    let world = &stage.scene.world;
    world.closest_stream(&work.current.blocks, &mut work.hits, Coherence::Alike, Among::All);
    let first = sample.is_none_or(|s| s == 0);
    let mut pixels = std::mem::take(if first { &mut out.color } else { &mut work.pixels });
    pixels.resize(PIXELS, [0.0; 4]);
    prefetch_surfaces(stage, &work.hits);
    light(stage, area, out, work, &mut pixels, record, stats);
    if first {
        out.start_samples(pixels);
    } else {
        out.add_sample(&pixels);
        work.pixels = pixels;
    }
}

/// Colours of the tile whose camera rays and hits `work` has.
pub(super) fn light(
    stage: &Stage<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &Workspace,
    pixels: &mut [[f32; 4]],
    record: bool,
    stats: &mut RayStats,
) {
    let has_place = |l: &crate::light::PlacedLight| !matches!(l.kind, PlacedKind::Directional { .. });
    let points = stage.lights.iter().any(has_place);
    dispatch!(stage.level, simd => {
        if points {
            light_hits::<_, true>(simd, stage, area, out, work, pixels, record, stats);
        } else {
            light_hits::<_, false>(simd, stage, area, out, work, pixels, record, stats);
        }
    });
}

/// As [`light`]. `POINT`: some light needs to know where the surface is.
fn light_hits<S: Simd, const POINT: bool>(
    simd: S,
    stage: &Stage<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &Workspace,
    pixels: &mut [[f32; 4]],
    record: bool,
    stats: &mut RayStats,
) {
    let (mut looks, mut radiance) = (Looks::new(), Rows3::ZERO);
    for (b, pixels) in pixels.chunks_exact_mut(LANES).enumerate() {
        let (rays, hits) = (&work.current.blocks[b], &work.hits[b]);
        let mut rows: [Row; 4] = [[0.0; LANES]; 4];
        let hit = (0..LANES).fold(0u16, |m, l| m | ((hits.prim[l] != NO_HIT) as u16) << l);
        if hit != u16::MAX && stage.scene.background != Background::Transparent {
            fill_background(stage, area, b, rays, &mut rows);
        }
        // ---- One instance at a time; nearly always there is only one.
        let mut left = hit;
        while left != 0 {
            let instance = hits.instance[left.trailing_zeros() as usize];
            let same = (0..LANES).fold(0u16, |m, l| m | ((hits.instance[l] == instance) as u16) << l);
            let lanes = left & same;
            left &= !lanes;
            let placed = &stage.instances[instance as usize];
            placed.look_block::<S, POINT>(simd, lanes, rays, hits, &mut looks);
            for lane in 0..LANES {
                let pale = looks.opacity[lane] < OPAQUE;
                stats.opacity_ignored += (pale && lanes >> lane & 1 != 0) as u64;
            }
            let material = placed.material;
            if material.detail.is_some() {
                for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                    let Some(hit) = hits.get(lane) else { continue };
                    let (ray, mut look) = (rays.get(lane), looks.get(lane));
                    let varied = placed.varied(&ray, &hit, &mut look.normal);
                    looks.normal.set(lane, look.normal);
                    radiance.set(lane, self::radiance(stage, material, varied.as_ref(), &look, ray.dir));
                }
            } else if light::knows(&material.model) {
                light::radiance_block(simd, stage, material, &looks, rays, &mut radiance);
            } else {
                for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                    let (look, dir) = (looks.get(lane), rays.get(lane).dir);
                    radiance.set(lane, self::radiance(stage, material, None, &look, dir));
                }
            }
            light::merge(simd, lanes, &radiance, &mut rows);
            if record {
                out.record_normals(b, lanes, |lane| looks.normal.get(lane));
            }
        }
        if record {
            record_block(simd, stage, area, b, rays, hits, out);
        }
        light::store_pixels(simd, &rows, pixels);
    }
}

/// Background under every pixel of block `b`; hits are put on top.
fn fill_background(stage: &Stage<'_>, area: &TileArea, b: usize, rays: &RayBlock, rows: &mut [Row; 4]) {
    for lane in 0..LANES {
        if let Some([_, y]) = area.pixel((b * LANES + lane) as u16) {
            let [r, g, b, a] = stage.background(y, rays.get(lane).dir);
            (rows[0][lane], rows[1][lane], rows[2][lane], rows[3][lane]) = (r * a, g * a, b * a, a);
        }
    }
}

/// Radiance of one surface towards the origin of a ray with direction `dir`: what [`light::radiance_block`] does for sixteen.
fn radiance(stage: &Stage<'_>, material: &Material, varied: Option<&Varied>, look: &Look, dir: Vec3) -> Vec3 {
    let (model, arriving, ambient) =
        varied.map_or((&material.model, 1.0, 1.0), |v| (&v.model, v.direct, v.ambient));
    let mut radiance = varied.map_or(material.emission.into(), |v| v.emission);
    if *model == SurfaceModel::Unlit {
        return radiance + look.color;
    }
    let view = -dir.normalize_or_zero();
    let Look { normal, color, .. } = *look;
    for light in &stage.lights {
        let incident = incident_from(light, look.point, None);
        let answer = response(model, normal, color, view, incident.dir, light.color, light.highlight);
        radiance += answer * (arriving * incident.strength);
    }
    if let Some(mean) = &stage.mean_radiance {
        radiance += ambient_albedo(model, color, stage.effects) * mean.for_normal(normal) * ambient;
    }
    radiance
}

#[cfg(test)]
mod tests;
