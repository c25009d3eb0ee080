//! Translucent surfaces in one go: all fragments of a pixel before its opaque surface, blended in the order of their depths.
//!
//! Rays go from surface to surface, 256 at a time. Where a hit is none of the rasterizer's fragments, an edge is near, and four rays beside the centre
//! find the triangle that the fill rule gives the pixel to.

use super::{Fragment, Layer, MOST_STEPS, Prepared, Rect, TILE, TileRays, UNCOVERED, slot, to_bytes};
use crate::config::Settings;
use crate::effects::Surroundings;
use crate::raster::steepness;
use rayon::prelude::*;
use rt_core::ray::{HitBlock, LANES, NO_HIT};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Depths that fragments may have at most, by pixel of the framebuffer.
pub(crate) struct Limit {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) depth: Vec<f32>,
}

/// How far behind its limit a fragment still counts, as VTK has it: the limit is a depth that the driver computed for such a fragment.
const EPSILON: f64 = 1e-7;
/// Roundings of a driver that interpolates in f32 from the window's corner on, per depth that a triangle gains from one pixel to the next.
const ROUNDINGS: f64 = 4096.0 / 16_777_216.0;
/// What comes through behind this changes no pixel of eight bits.
const LEAST: f32 = 1.0 / 1024.0;
/// How far beside a centre, in pixels.
const OFF: f64 = 1.0 / 200.0;

/// A fragment of a pixel.
struct Found {
    draw: usize,
    prim: usize,
    fragment: Fragment,
}

/// Premultiplied colours of all draws; what it cost beside primary rays.
pub(crate) fn peeled(draws: &[Prepared<'_>], limit: &Limit, settings: &Settings) -> (Layer, [u64; 2]) {
    let around = Surroundings::new(draws, settings).map(|mut around| {
        // What lets light through casts no shadow.
        around.clear.fill(true);
        around
    });
    let all = Rect { x: 0, y: 0, w: limit.width as i32, h: limit.height as i32 };
    let rect = draws.iter().fold(Rect::default(), |r, d| r.or(d.rect)).and(all);
    let (w, h) = (rect.w.max(0) as usize, rect.h.max(0) as usize);
    let mut layer = Layer { rect, color: vec![[0; 4]; w * h], depth: vec![UNCOVERED; w * h], covered: 0 };
    if w * h == 0 {
        return (layer, [0; 2]);
    }
    let covered = AtomicU64::new(0);
    let band = w * TILE as usize;
    let bands = layer.color.par_chunks_mut(band).zip(layer.depth.par_chunks_mut(band)).enumerate();
    bands.for_each_init(TileRays::new, |rays, (i, (color, depth))| {
        let y = rect.y + i as i32 * TILE;
        let rows = (color.len() / w) as i32;
        for x in (rect.x..rect.x + rect.w).step_by(TILE as usize) {
            let tile = Rect { x, y, w: TILE.min(rect.x + rect.w - x), h: rows };
            let mut found: [Vec<Found>; 256] = [const { Vec::new() }; 256];
            for (number, p) in draws.iter().enumerate() {
                through(p, number, tile, limit, rays, &mut found);
            }
            for (k, found) in found.iter_mut().enumerate().filter(|(_, f)| !f.is_empty()) {
                let at = (x + (k % 16) as i32, y + (k / 16) as i32);
                let place = (at.1 - y) as usize * w + (at.0 - rect.x) as usize;
                color[place] = blended(draws, found, settings, around.as_ref(), at);
                depth[place] = 0.0;
                covered.fetch_add(1, Relaxed);
            }
        }
    });
    layer.covered = covered.into_inner() as usize;
    let extra = around.map_or([0; 2], |a| [a.shadow_rays.into_inner(), a.occlusion_rays.into_inner()]);
    (layer, extra)
}

/// All fragments of a draw in a tile.
fn through(
    p: &Prepared<'_>,
    draw: usize,
    tile: Rect,
    limit: &Limit,
    rays: &mut TileRays,
    found: &mut [Vec<Found>; 256],
) {
    if tile.and(p.rect).is_empty() || !rays.send(p, tile) {
        return;
    }
    let most = |x: i32, y: i32| f64::from(limit.depth[y as usize * limit.width + x as usize]) + EPSILON;
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
                    // Everything that follows is behind it.
                    Some(f) if is_behind(p, prim, &f, most(at.0, at.1)) => {
                        rays.blocks[b].t_max[l] = -1.0;
                        continue;
                    }
                    Some(fragment) => found[k].push(Found { draw, prim, fragment }),
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
        p.world.closest_coherent(&rays.blocks, &mut rays.hits);
    }
    for b in &mut rays.blocks {
        b.t_max = [-1.0; LANES];
    }
    for (k, _) in edges.iter().enumerate().filter(|(_, edge)| **edge) {
        let at = (tile.x + (k % 16) as i32, tile.y + (k / 16) as i32);
        beside(p, draw, at, most(at.0, at.1), &mut found[k]);
    }
}

/// Whether a fragment is behind its limit by more than roundings.
fn is_behind(p: &Prepared<'_>, prim: usize, f: &Fragment, most: f64) -> bool {
    let s = &*p.draw.state;
    let scale = s.depth_range[1] - s.depth_range[0];
    f.plain_depth > most
        && f.plain_depth - most > EPSILON + ROUNDINGS * steepness(&p.corners(prim), s.viewport, scale)
}

/// Fragments of triangles that rays beside the centre meet.
fn beside(p: &Prepared<'_>, draw: usize, (x, y): (i32, i32), most: f64, found: &mut Vec<Found>) {
    for (dx, dy) in [(-OFF, -OFF), (OFF, -OFF), (-OFF, OFF), (OFF, OFF)] {
        let Some((mut ray, _)) = p.ray(f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy) else { continue };
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
                found.push(Found { draw, prim, fragment });
            }
        }
    }
}

/// Front to back, premultiplied.
fn blended(
    draws: &[Prepared<'_>],
    found: &mut [Found],
    settings: &Settings,
    around: Option<&Surroundings<'_>>,
    at: (i32, i32),
) -> [u8; 4] {
    found.sort_by(|a, b| {
        let by_depth = a.fragment.depth.total_cmp(&b.fragment.depth);
        by_depth.then(a.draw.cmp(&b.draw)).then(a.prim.cmp(&b.prim))
    });
    let (mut sum, mut left) = ([0.0_f32; 3], 1.0_f32);
    for f in found {
        let p = &draws[f.draw];
        let [r, g, b, a] = p.shaded(f.prim, &f.fragment, settings.mode, around, at);
        let a = (a * p.draw.look.opacity).clamp(0.0, 1.0);
        for (sum, c) in sum.iter_mut().zip([r, g, b]) {
            // As each step is written to a buffer of colours from 0 to 1.
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
