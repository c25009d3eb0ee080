//! Finds the nearest fragment of every pixel, tile by tile: rays, fragments of their hits, colours.

use super::fragment_batch::FragmentBatch;
use super::fragments::{FragmentBlock, LaneState};
use super::tile_mask::TileMask;
use super::tile_rays::{BLOCKS, TileRays, slot};
use super::{DEPTH_STEPS, Fragment, Layer, Prepared, Rect, TILE, UNCOVERED, to_bytes};
use crate::cluster::row_share::RowShare;
use crate::enums::*;
use crate::host::config::{Mode, Settings};
use crate::trace::occlusion::RayScene;
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use rt_core::ray::{HitBlock, LANES, NO_HIT};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The number of pixels in a tile.
const PIXELS: usize = (TILE * TILE) as usize;

/// What is visible at a pixel.
#[derive(Clone, Copy)]
pub(super) struct PixelHit {
    depth_bits: u32,
    draw: u32,
    pub(super) prim: u32,
    pub(super) fragment: Fragment,
}

const NOTHING: PixelHit = PixelHit {
    depth_bits: u32::MAX,
    draw: u32::MAX,
    prim: 0,
    fragment: Fragment { weights: [0.0; 3], depth: 0.0, plain_depth: 0.0, front: true },
};

/// A thread's buffers for one tile.
struct TileScratch {
    rays: TileRays,
    fragments: [FragmentBlock; BLOCKS],
    moved: [f64; PIXELS],
    seen: [PixelHit; PIXELS],
}

impl TileScratch {
    fn new() -> Box<TileScratch> {
        Box::new(TileScratch {
            rays: TileRays::new(),
            fragments: [const { FragmentBlock::EMPTY }; BLOCKS],
            moved: [f64::NAN; PIXELS],
            seen: [NOTHING; PIXELS],
        })
    }
}

/// The nearest fragment of all draws at every pixel of a row share.
pub(crate) fn nearest(
    draws: &[Prepared<'_>],
    settings: &Settings,
    share: RowShare,
) -> (Layer, [u64; 2]) {
    let ray_scene = RayScene::new(draws, settings);
    let mode = settings.mode;
    let rect = draws.iter().fold(Rect::default(), |r, d| r.or(d.rect));
    let (w, h) = (rect.w.max(0) as usize, rect.h.max(0) as usize);
    let mut layer =
        Layer { rect, color: vec![[0; 4]; w * h], depth: vec![UNCOVERED; w * h], covered: 0 };
    if w * h == 0 {
        return (layer, [0; 2]);
    }
    let masks: Vec<TileMask> = draws.par_iter().map(|p| TileMask::new(p, rect)).collect();
    let band = w * TILE as usize;
    let covered = AtomicU64::new(0);
    let bands = layer.color.par_chunks_mut(band).zip(layer.depth.par_chunks_mut(band)).enumerate();
    bands.filter(|(i, _)| share.has(*i)).for_each_init(
        TileScratch::new,
        |scratch, (i, (color, depth))| {
            let y = rect.y + i as i32 * TILE;
            let tile_h = (color.len() / w) as i32;
            let mut n = 0;
            let mut batch = FragmentBatch::default();
            // A tile's hits stay in the L1 cache until they are shaded.
            for (column, x) in (rect.x..rect.x + rect.w).step_by(TILE as usize).enumerate() {
                let tile = Rect { x, y, w: TILE.min(rect.x + rect.w - x), h: tile_h };
                let mut any = false;
                for (d, p) in draws.iter().enumerate().filter(|(d, _)| masks[*d].has(column, i)) {
                    any |= trace_draw(p, d as u32, tile, scratch, any);
                }
                if !any {
                    continue;
                }
                for (j, s) in scratch.seen.iter().enumerate().filter(|(_, s)| s.draw != u32::MAX) {
                    let (tx, ty) = (j % TILE as usize, j / TILE as usize);
                    let k = ty * w + (x - rect.x) as usize + tx;
                    depth[k] = s.fragment.depth as f32;
                    n += 1;
                    let p = &draws[s.draw as usize];
                    let at = (x + tx as i32, y + ty as i32);
                    let s = &PixelHit {
                        fragment: p.centred(s.prim as usize, s.fragment, at.0, at.1),
                        ..*s
                    };
                    if p.blocks && mode == Mode::Match {
                        if batch.count > 0 && batch.draw != s.draw {
                            batch.shade(&draws[batch.draw as usize], color);
                        }
                        batch.add(p, s.draw, k, s, color);
                        continue;
                    }
                    color[k] = to_bytes(p.shaded(
                        s.prim as usize,
                        &s.fragment,
                        mode,
                        ray_scene.as_ref(),
                        at,
                    ));
                }
            }
            if batch.count > 0 {
                batch.shade(&draws[batch.draw as usize], color);
            }
            covered.fetch_add(n, Relaxed);
        },
    );
    layer.covered = covered.into_inner() as usize;
    let extra =
        ray_scene.map_or([0; 2], |a| [a.shadow_rays.into_inner(), a.occlusion_rays.into_inner()]);
    (layer, extra)
}

/// Traces one draw against the nearest fragments of a tile so far, row by row. Returns false when
/// the draw covers nothing there. While `begun` is false, the tile has no fragments yet.
fn trace_draw(
    p: &Prepared<'_>,
    index: u32,
    area: Rect,
    scratch: &mut TileScratch,
    begun: bool,
) -> bool {
    let TileScratch { rays, fragments, moved, seen } = scratch;
    let tile = area.and(p.rect);
    if tile.is_empty() || !rays.send(p, tile) {
        return false;
    }
    if !begun {
        seen.fill(NOTHING);
    }
    let later_wins_ties = p.draw.state.depth_func == LEQUAL;
    let (hits, range) = (&rays.hits, p.draw.state.depth_range);
    let (blocks, targets) = (&mut *fragments, &mut *moved);
    dispatch!(Level::new(), _simd => fill(p, hits, tile, blocks, targets, range));
    // Polygon offset moves steep triangles far back. At silhouettes they can end up behind other
    // triangles of the same draw.
    let has_candidates =
        p.draw.state.polygon_offset.is_some() && rays.trace_offset_candidates(p, tile, moved);
    for y in 0..tile.h {
        for x in 0..tile.w {
            let (b, l) = slot(x, y);
            let behind = has_candidates && rays.offset_candidates[b].prim[l] != NO_HIT;
            let (px, py) = (tile.x + x, tile.y + y);
            let (prim, f) = match fragments[b].lane[l] {
                LaneState::Empty => continue,
                LaneState::Found if !behind => (rays.hits[b].prim[l] as usize, fragments[b].get(l)),
                _ => match p.resolve(rays.ray(b, l), rays.hits[b].get(l), px, py) {
                    Some(found) => found,
                    None => continue,
                },
            };
            let at = &mut seen[((py - area.y) * TILE + px - area.x) as usize];
            let bits = (f.depth * DEPTH_STEPS + 0.5) as u32;
            if bits < at.depth_bits || (later_wins_ties && bits == at.depth_bits) {
                *at = PixelHit { depth_bits: bits, draw: index, prim: prim as u32, fragment: f };
            }
        }
    }
    true
}

/// The fragments of a tile's hits, and the depths to which polygon offset moved them.
#[inline(always)]
fn fill(
    p: &Prepared<'_>,
    hits: &[HitBlock],
    tile: Rect,
    out: &mut [FragmentBlock; BLOCKS],
    moved: &mut [f64; PIXELS],
    range: [f64; 2],
) {
    for (b, out) in out.iter_mut().enumerate() {
        let (x, y) = (4 * (b as i32 % 4), 4 * (b as i32 / 4));
        let moved = &mut moved[b * LANES..(b + 1) * LANES];
        if hits[b].prim.iter().all(|p| *p == NO_HIT) {
            out.lane = [LaneState::Empty; LANES];
            moved.fill(f64::NAN);
            continue;
        }
        out.fill(p, &hits[b], tile.x + x, tile.y + y);
        out.moved_back(range, moved);
    }
}
