//! Finds every fragment of one draw, for states in which the order of triangles matters.
//!
//! Where the whole draw is in front of the eye, its triangles are stacked in drawing order
//! ([`PaintersStack`]), and one ray per layer finds them. Otherwise rays go through each pixel's
//! centre from surface to surface, 256 at a time. Where an edge comes near a centre, four more rays
//! next to it find the triangles that the fill rule may give the pixel to. Where several layers lie
//! in one plane, those rays find only the first.

use super::painters_stack::PaintersStack;
use super::{Layer, MOST_STEPS, Prepared, Rect, TILE, UNCOVERED, slot, to_bytes};
use crate::enums::ALWAYS;
use crate::trace::occlusion::Visibility;
use rayon::prelude::*;
use rt_core::ray::{HitBlock, RayBlock};
use std::sync::atomic::Ordering::Relaxed;

/// The distance of the extra rays from the pixel centre, in pixels.
const OFF: f64 = 1.0 / 200.0;
/// An edge that is nearer to a pixel centre than this counts as passing through it.
const NEAR: f64 = 1.0 / 32.0;

/// The colour and depth of a fragment.
type OrderedFragment = ([u8; 4], f32);

/// The layers of the draw. The n-th layer has the n-th fragment of each pixel, in the order of the
/// triangles.
pub(crate) fn ordered_layers(p: &Prepared<'_>) -> Vec<Layer> {
    let rect = p.rect;
    let (w, h) = (rect.w.max(0) as usize, rect.h.max(0) as usize);
    if w * h == 0 {
        return Vec::new();
    }
    let lifted = PaintersStack::new(p);
    let near = if lifted.is_none() { near_edges(p) } else { EdgePixels { rect, marks: None } };
    let step = TILE as usize;
    let tiles: Vec<Rect> = (0..h)
        .step_by(step)
        .flat_map(|y| (0..w).step_by(step).map(move |x| (x, y)))
        .map(|(x, y)| Rect {
            x: rect.x + x as i32,
            y: rect.y + y as i32,
            w: step.min(w - x) as i32,
            h: step.min(h - y) as i32,
        })
        .collect();
    let made: Vec<Vec<Vec<OrderedFragment>>> = tiles
        .par_iter()
        .map(|tile| match &lifted {
            Some(lifted) => of_stack(p, *tile, lifted),
            None => of_tile(p, *tile, &near),
        })
        .collect();
    let layers = made.iter().flatten().map(Vec::len).max().unwrap_or(0);
    (0..layers)
        .map(|n| {
            let mut layer = Layer {
                rect,
                color: vec![[0; 4]; w * h],
                depth: vec![UNCOVERED; w * h],
                covered: 0,
            };
            for (tile, pixels) in tiles.iter().zip(&made) {
                for (i, found) in pixels.iter().enumerate() {
                    let Some((color, depth)) = found.get(n) else { continue };
                    let (x, y) =
                        (tile.x + i as i32 % tile.w - rect.x, tile.y + i as i32 / tile.w - rect.y);
                    let k = y as usize * w + x as usize;
                    (layer.color[k], layer.depth[k]) = (*color, *depth);
                    layer.covered += 1;
                }
            }
            layer
        })
        .collect()
}

/// True when a fragment replaces the previous content, so that only the last one of a pixel is
/// visible.
fn last_is_all(p: &Prepared<'_>) -> bool {
    let s = &*p.draw.state;
    let untested = !s.depth_test || (s.depth_func == ALWAYS && s.depth_mask);
    untested && s.color_mask && !(s.blend || s.stencil_test || s.logic_op || s.alpha_test)
}

/// The fragment of a triangle, as it is drawn.
fn fragment(p: &Prepared<'_>, prim: usize, x: i32, y: i32) -> Option<OrderedFragment> {
    let f = p.fragment(prim, x, y)?;
    let f = p.centred(prim, f, x, y);
    Some((to_bytes(p.color(prim, &f, false, &Visibility::FULL, Some((x, y)))), f.depth as f32))
}

fn of_stack(p: &Prepared<'_>, tile: Rect, stack: &PaintersStack) -> Vec<Vec<OrderedFragment>> {
    let last = last_is_all(p);
    let mut made: Vec<Vec<OrderedFragment>> = vec![Vec::new(); (tile.w * tile.h) as usize];
    stack.each(p, tile, |i, prim| {
        let (x, y) = (tile.x + i as i32 % tile.w, tile.y + i as i32 / tile.w);
        let found = fragment(p, prim, x, y);
        let enough = last && found.is_some();
        made[i].extend(found);
        !enough
    });
    made.iter_mut().for_each(|found| found.reverse());
    made
}

fn of_tile(p: &Prepared<'_>, tile: Rect, near: &EdgePixels) -> Vec<Vec<OrderedFragment>> {
    let n = (tile.w * tile.h) as usize;
    let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); n];
    let mut blocks = vec![RayBlock::INACTIVE; 16];
    let mut hits = vec![HitBlock::MISS; 16];
    for (dx, dy) in [(0.0, 0.0), (-OFF, -OFF), (OFF, OFF), (OFF, -OFF), (-OFF, OFF)] {
        blocks.fill(RayBlock::INACTIVE);
        let mut active: Vec<(usize, usize, usize)> = Vec::new();
        for i in 0..n {
            let (x, y) = (i as i32 % tile.w, i as i32 / tile.w);
            if dx != 0.0 && !near.at(tile.x + x, tile.y + y) {
                continue;
            }
            let at = |a: i32, d: f64| f64::from(a) + 0.5 + d;
            if let Some((ray, _)) = p.ray(at(tile.x + x, dx), at(tile.y + y, dy)) {
                let (b, l) = slot(x, y);
                blocks[b].set(l, &ray);
                active.push((i, b, l));
            }
        }
        for _ in 0..MOST_STEPS {
            if active.is_empty() {
                break;
            }
            p.rays.fetch_add(active.len() as u64, Relaxed);
            hits.fill(HitBlock::MISS);
            p.world
                .closest_coherent(&blocks, &mut hits)
                .expect("one block of hits for each of rays");
            active.retain(|&(i, b, l)| {
                let Some(hit) = hits[b].get(l) else {
                    let mut done = blocks[b].get(l);
                    done.t_max = f32::NEG_INFINITY;
                    blocks[b].set(l, &done);
                    return false;
                };
                triangles[i].push(hit.prim);
                let mut ray = blocks[b].get(l);
                ray.t_min = hit.t.next_up();
                blocks[b].set(l, &ray);
                true
            });
        }
    }
    let last = last_is_all(p);
    triangles
        .into_iter()
        .enumerate()
        .map(|(i, mut found)| {
            found.sort_unstable();
            found.dedup();
            let (x, y) = (tile.x + i as i32 % tile.w, tile.y + i as i32 / tile.w);
            let fragment = |prim: &u32| fragment(p, *prim as usize, x, y);
            match last {
                true => found.iter().rev().find_map(fragment).into_iter().collect(),
                false => found.iter().filter_map(fragment).collect(),
            }
        })
        .collect()
}

/// The pixels whose centres are near an edge.
struct EdgePixels {
    rect: Rect,
    /// `None` means all pixels.
    marks: Option<Vec<bool>>,
}

impl EdgePixels {
    fn at(&self, x: i32, y: i32) -> bool {
        let (x, y) = (x - self.rect.x, y - self.rect.y);
        self.marks.as_ref().is_none_or(|m| m[(y * self.rect.w + x) as usize])
    }
}

fn near_edges(p: &Prepared<'_>) -> EdgePixels {
    let rect = p.rect;
    let [vx, vy, vw, vh] = p.draw.state.viewport.map(f64::from);
    let mut marks = vec![false; (rect.w * rect.h) as usize];
    for prim in 0..p.draw.geometry.mesh.num_triangles() {
        let c = p.corners(prim);
        if c.iter().any(|v| v[3] <= 0.0 || !v[3].is_finite()) {
            // An edge crosses the plane of the eye. Locating it would not pay, so all pixels count.
            return EdgePixels { rect, marks: None };
        }
        let at = c.map(|v| {
            let w = f64::from(v[3]);
            [
                vx + (f64::from(v[0]) / w + 1.0) * 0.5 * vw - f64::from(rect.x),
                vy + (f64::from(v[1]) / w + 1.0) * 0.5 * vh - f64::from(rect.y),
            ]
        });
        for k in 0..3 {
            mark(&mut marks, [rect.w, rect.h], at[k], at[(k + 1) % 3]);
        }
    }
    EdgePixels { rect, marks: Some(marks) }
}

/// Marks the pixels whose centres are near the line from `a` to `b`. The test uses the points where
/// the line crosses the rows and columns of centres.
fn mark(marks: &mut [bool], size: [i32; 2], a: [f64; 2], b: [f64; 2]) {
    for (along, across) in [(1, 0), (0, 1)] {
        let (lo, hi) = (a[along].min(b[along]) - NEAR - 0.5, a[along].max(b[along]) + NEAR - 0.5);
        let first = lo.ceil().max(0.0) as i32;
        let last = hi.floor().min(f64::from(size[along] - 1)) as i32;
        let length = b[along] - a[along];
        for i in first..=last {
            let t = if length == 0.0 { 0.0 } else { (f64::from(i) + 0.5 - a[along]) / length };
            let place = a[across] + (b[across] - a[across]) * t.clamp(0.0, 1.0) - 0.5;
            let nearest = place.round();
            if (place - nearest).abs() > NEAR || nearest < 0.0 || nearest >= f64::from(size[across])
            {
                continue;
            }
            let (x, y) = if along == 1 { (nearest as i32, i) } else { (i, nearest as i32) };
            marks[(y * size[0] + x) as usize] = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_on_an_edge_are_marked_and_others_are_not() {
        let mut marks = vec![false; 16];
        // A diagonal through centres, and a horizontal line between rows.
        mark(&mut marks, [4, 4], [0.5, 0.5], [3.5, 3.5]);
        let marked: Vec<usize> = (0..16).filter(|i| marks[*i]).collect();
        assert_eq!(marked, [0, 5, 10, 15]);
        let mut marks = vec![false; 16];
        mark(&mut marks, [4, 4], [0.0, 2.0], [4.0, 2.0]);
        assert!(!marks.contains(&true));
        mark(&mut marks, [4, 4], [-9.0, 2.5], [99.0, 2.5]);
        assert_eq!((0..16).filter(|i| marks[*i]).collect::<Vec<_>>(), [8, 9, 10, 11]);
    }
}
