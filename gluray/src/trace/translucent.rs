//! Composites translucent surfaces in one pass. It finds all fragments of a pixel in front of the
//! opaque surface and blends them in depth order.
//!
//! Rays go from surface to surface, 256 at a time. A hit that yields no fragment under the
//! rasterizer's rules is near an edge. Then four rays next to the centre find the triangle that the
//! fill rule gives the pixel to.

use super::{
    DEPTH_STEPS, Fragment, Layer, MOST_STEPS, Prepared, Rect, TILE, TileRays, UNCOVERED, slot,
    to_bytes,
};
use crate::host::config::Settings;
use crate::trace::occlusion::RayScene;
use crate::trace::raster::steepness;
use rayon::prelude::*;
use rt_core::ray::{HitBlock, LANES, NO_HIT};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The largest depth that fragments may have, per pixel of the framebuffer.
pub(crate) struct DepthLimits {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) depth: Vec<f32>,
    /// True when the limits are depths of other surfaces, as stored in a depth buffer. Otherwise
    /// they are the depths of the farthest fragments that still count.
    pub(crate) exact: bool,
}

/// Sums over all counted fragments of each pixel.
#[derive(Default)]
pub(crate) struct WeightedSums {
    pub(crate) rect: Rect,
    /// The sum of colour times alpha, and the share of light that all layers together block.
    pub(crate) colors: Vec<[f32; 4]>,
    /// The sum of alphas.
    pub(crate) weights: Vec<f32>,
    pub(crate) covered: usize,
}

/// The distance behind its limit up to which a fragment still counts, as in VTK. The limit is a
/// depth that the driver computed for such a fragment.
const EPSILON: f64 = 1e-7;
/// The rounding error of a driver that interpolates in f32 from the corner of the window, per unit
/// of depth that a triangle gains from one pixel to the next.
const ROUNDINGS: f64 = 4096.0 / 16_777_216.0;
/// Below this transmittance, further layers change no pixel of eight bits.
const LEAST: f32 = 1.0 / 1024.0;
/// The distance of the extra rays from the pixel centre, in pixels.
const OFF: f64 = 1.0 / 200.0;

/// One fragment of a pixel.
struct LayerFragment {
    draw: usize,
    prim: usize,
    fragment: Fragment,
}

/// The scene for the mode's effects on translucent surfaces.
fn occlusion_scene<'a>(draws: &'a [Prepared<'a>], settings: &'a Settings) -> Option<RayScene<'a>> {
    RayScene::new(draws, settings).map(|mut ray_scene| {
        // Translucent surfaces cast no shadow.
        ray_scene.clear.fill(true);
        ray_scene
    })
}

/// Passes each pixel's fragments to `put`, row by row, with the pixel's entries in `out`. Returns
/// how many pixels have fragments.
fn each_pixel<T: Send>(
    draws: &[Prepared<'_>],
    limit: &DepthLimits,
    rect: Rect,
    out: &mut [T],
    put: impl Fn(&mut T, &mut [LayerFragment], (i32, i32)) + Sync,
) -> usize {
    let w = rect.w as usize;
    let covered = AtomicU64::new(0);
    out.par_chunks_mut(w * TILE as usize).enumerate().for_each_init(
        TileRays::new,
        |rays, (i, out)| {
            let y = rect.y + i as i32 * TILE;
            let rows = (out.len() / w) as i32;
            for x in (rect.x..rect.x + rect.w).step_by(TILE as usize) {
                let tile = Rect { x, y, w: TILE.min(rect.x + rect.w - x), h: rows };
                let mut found: [Vec<LayerFragment>; 256] = [const { Vec::new() }; 256];
                for (number, p) in draws.iter().enumerate() {
                    through(p, number, tile, limit, rays, &mut found);
                }
                for (k, found) in found.iter_mut().enumerate().filter(|(_, f)| !f.is_empty()) {
                    let at = (x + (k % 16) as i32, y + (k / 16) as i32);
                    put(&mut out[(at.1 - y) as usize * w + (at.0 - rect.x) as usize], found, at);
                    covered.fetch_add(1, Relaxed);
                }
            }
        },
    );
    covered.into_inner() as usize
}

/// The part of the window in which the draws may be visible.
fn bounds(draws: &[Prepared<'_>], limit: &DepthLimits) -> Rect {
    let all = Rect { x: 0, y: 0, w: limit.width as i32, h: limit.height as i32 };
    draws.iter().fold(Rect::default(), |r, d| r.or(d.rect)).and(all)
}

/// Premultiplied colours of all draws, and the cost of secondary rays.
pub(crate) fn depth_sorted(
    draws: &[Prepared<'_>],
    limit: &DepthLimits,
    settings: &Settings,
) -> (Layer, [u64; 2]) {
    let ray_scene = occlusion_scene(draws, settings);
    let rect = bounds(draws, limit);
    let n = (rect.w.max(0) * rect.h.max(0)) as usize;
    if n == 0 {
        return (Layer { rect, ..Layer::default() }, [0; 2]);
    }
    let mut pixels = vec![([0; 4], UNCOVERED); n];
    let covered = each_pixel(draws, limit, rect, &mut pixels, |pixel, found, at| {
        *pixel = (blended(draws, found, settings, ray_scene.as_ref(), at), 0.0);
    });
    let (color, depth) = pixels.into_iter().unzip();
    (Layer { rect, color, depth, covered }, cost(ray_scene))
}

/// Sums over the fragments of all draws in any order, and the cost of secondary rays.
pub(crate) fn weighted_sums(
    draws: &[Prepared<'_>],
    limit: &DepthLimits,
    settings: &Settings,
) -> (WeightedSums, [u64; 2]) {
    let ray_scene = occlusion_scene(draws, settings);
    let rect = bounds(draws, limit);
    let n = (rect.w.max(0) * rect.h.max(0)) as usize;
    if n == 0 {
        return (WeightedSums::default(), [0; 2]);
    }
    let mut pixels = vec![([0.0_f32; 4], 0.0_f32); n];
    let covered = each_pixel(draws, limit, rect, &mut pixels, |(sum, weight), found, at| {
        let mut through = 1.0;
        for f in found {
            let p = &draws[f.draw];
            let [r, g, b, a] = p.shaded(f.prim, &f.fragment, settings.mode, ray_scene.as_ref(), at);
            let a = (a * p.draw.ray_material.opacity).clamp(0.0, 1.0);
            for (sum, c) in sum.iter_mut().zip([r, g, b]) {
                *sum += a * c;
            }
            *weight += a;
            through *= 1.0 - a;
        }
        sum[3] = 1.0 - through;
    });
    let (colors, weights) = pixels.into_iter().unzip();
    (WeightedSums { rect, colors, weights, covered }, cost(ray_scene))
}

/// The numbers of shadow rays and ambient occlusion rays.
fn cost(ray_scene: Option<RayScene<'_>>) -> [u64; 2] {
    ray_scene.map_or([0; 2], |a| [a.shadow_rays.into_inner(), a.occlusion_rays.into_inner()])
}

/// Finds all fragments of a draw in a tile.
fn through(
    p: &Prepared<'_>,
    draw: usize,
    tile: Rect,
    limit: &DepthLimits,
    rays: &mut TileRays,
    found: &mut [Vec<LayerFragment>; 256],
) {
    if tile.and(p.rect).is_empty() || !rays.send(p, tile) {
        return;
    }
    let most = |x: i32, y: i32| {
        let depth = f64::from(limit.depth[y as usize * limit.width + x as usize]);
        DepthLimit {
            depth: depth + if limit.exact { 0.5 / DEPTH_STEPS } else { EPSILON },
            exact: limit.exact,
        }
    };
    let mut edges = [false; 256];
    for _ in 0..MOST_STEPS {
        let mut on = 0;
        for y in 0..tile.h {
            for x in 0..tile.w {
                let (b, l) = slot(x, y);
                if rays.hits[b].prim[l] == NO_HIT {
                    rays.blocks[b].t_max[l] = -1.0;
                    continue;
                }
                let (at, k) = ((tile.x + x, tile.y + y), (x + 16 * y) as usize);
                let (prim, t) = (rays.hits[b].prim[l] as usize, rays.hits[b].t[l]);
                match p.fragment(prim, at.0, at.1) {
                    None => edges[k] = true,
                    // All further hits are behind it.
                    Some(f) if is_behind(p, prim, &f, most(at.0, at.1)) => {
                        rays.blocks[b].t_max[l] = -1.0;
                        continue;
                    }
                    Some(fragment) => found[k].push(LayerFragment { draw, prim, fragment }),
                }
                rays.blocks[b].t_min[l] = t.next_up();
                on += 1;
            }
        }
        if on == 0 {
            break;
        }
        p.rays.fetch_add(on, Relaxed);
        rays.hits.fill(HitBlock::MISS);
        p.world
            .closest_coherent(&rays.blocks, &mut rays.hits)
            .expect("one block of hits for each of rays");
    }
    for b in &mut rays.blocks {
        b.t_max = [-1.0; LANES];
    }
    for (k, _) in edges.iter().enumerate().filter(|(_, edge)| **edge) {
        let at = (tile.x + (k % 16) as i32, tile.y + (k / 16) as i32);
        hit_beside_center(p, draw, at, most(at.0, at.1), &mut found[k]);
    }
}

/// The depth limit of a pixel's fragments.
#[derive(Clone, Copy)]
struct DepthLimit {
    depth: f64,
    exact: bool,
}

/// True when a fragment is behind its limit. For inexact limits, the distance must exceed the
/// rounding error.
fn is_behind(p: &Prepared<'_>, prim: usize, f: &Fragment, most: DepthLimit) -> bool {
    if most.exact {
        return f.depth > most.depth;
    }
    let s = &*p.draw.state;
    let scale = s.depth_range[1] - s.depth_range[0];
    f.plain_depth > most.depth
        && f.plain_depth - most.depth
            > EPSILON + ROUNDINGS * steepness(&p.corners(prim), s.viewport, scale)
}

/// Fragments of the triangles that rays next to the centre hit.
fn hit_beside_center(
    p: &Prepared<'_>,
    draw: usize,
    (x, y): (i32, i32),
    most: DepthLimit,
    found: &mut Vec<LayerFragment>,
) {
    for (dx, dy) in [(-OFF, -OFF), (OFF, -OFF), (-OFF, OFF), (OFF, OFF)] {
        let Some((mut ray, _)) = p.ray(f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy) else {
            continue;
        };
        for _ in 0..MOST_STEPS {
            p.rays.fetch_add(1, Relaxed);
            let Some(hit) = p.world.closest(&ray) else { break };
            let prim = hit.prim as usize;
            ray.t_min = hit.t.next_up();
            let Some(fragment) = p.fragment(prim, x, y) else { continue };
            if is_behind(p, prim, &fragment, most) {
                break;
            }
            if !found.iter().any(|f| f.draw == draw && f.prim == prim) {
                found.push(LayerFragment { draw, prim, fragment });
            }
        }
    }
}

/// Blends front to back, with premultiplied colours.
fn blended(
    draws: &[Prepared<'_>],
    found: &mut [LayerFragment],
    settings: &Settings,
    ray_scene: Option<&RayScene<'_>>,
    at: (i32, i32),
) -> [u8; 4] {
    found.sort_by(|a, b| {
        let by_depth = a.fragment.depth.total_cmp(&b.fragment.depth);
        by_depth.then(a.draw.cmp(&b.draw)).then(a.prim.cmp(&b.prim))
    });
    let (mut sum, mut left) = ([0.0_f32; 3], 1.0_f32);
    for f in found {
        let p = &draws[f.draw];
        let [r, g, b, a] = p.shaded(f.prim, &f.fragment, settings.mode, ray_scene, at);
        let a = (a * p.draw.ray_material.opacity).clamp(0.0, 1.0);
        for (sum, c) in sum.iter_mut().zip([r, g, b]) {
            // Clamps after each step, because each step writes to a buffer of colours from 0 to 1.
            *sum = (*sum + left * a * c.max(0.0)).min(1.0);
        }
        left *= 1.0 - a;
        if left < LEAST {
            left = 0.0;
            break;
        }
    }
    to_bytes([sum[0], sum[1], sum[2], 1.0 - left])
}
