//! What rays through centres miss: outlines that the driver moved over a centre.
//!
//! A rasterizer takes corners to the nearest 1/256 of a pixel before it asks which centres a triangle covers. Inside a surface that moves a centre from one
//! triangle to its neighbour, which the ray's own hit tells. At an outline the ray misses what the driver draws, and nothing tells: so where a pixel lies behind
//! its neighbours as only outlines do, four more rays beside its centre look for triangles that cover it by the driver's rule. Of an ordinary surface that is
//! one pixel in hundreds of thousands; of thousands of glyphs a pixel wide (arrows, tubes) one in a hundred.

use super::nearest::Seen;
use super::rays::TileRays;
use super::{DEPTH_STEPS, Prepared, Rect, TILE, UNCOVERED};
use crate::enums::LEQUAL;
use rt_core::ray::LANES;
use std::sync::atomic::Ordering::Relaxed;

const SIDE: usize = TILE as usize;
/// Where the rays go, in pixels from the centre: corners move by 1/512 in x and in y at most, so one of the four is inside of any outline that was moved over the
/// centre.
const BESIDE: [[f64; 2]; RAYS] = [[-OFF, -OFF], [OFF, -OFF], [-OFF, OFF], [OFF, OFF]];
const OFF: f64 = 1.0 / 200.0;
/// Rays a pixel.
const RAYS: usize = 4;
/// How far behind the mean of its neighbours a pixel lies at an outline, by how far those are from one another (1 where one is before it and one beside it;
/// less than the ratio of curvature to slope on a surface).
const STEP: f32 = 0.5;
/// Depths that far apart are one: surfaces that face the viewer have slope 0.
const FLAT: f32 = 1e-6;

/// Depths of a tile with a row and a column more on each side.
struct Depths([[f32; SIDE + 2]; SIDE + 2]);

impl Depths {
    /// What is not in the tile goes on as the two pixels inside of it say.
    fn new(seen: &[Seen; SIDE * SIDE]) -> Depths {
        let mut d = [[UNCOVERED; SIDE + 2]; SIDE + 2];
        for (row, seen) in d[1..].iter_mut().zip(seen.chunks_exact(SIDE)) {
            for (d, s) in row[1..].iter_mut().zip(seen) {
                *d = s.depth();
            }
        }
        let beyond = |a: f32, b: f32, c: f32| a + b - c;
        for row in &mut d[1..=SIDE] {
            row[0] = beyond(row[1], row[2], row[3]);
            row[SIDE + 1] = beyond(row[SIDE], row[SIDE - 1], row[SIDE - 2]);
        }
        for x in 1..=SIDE {
            d[0][x] = beyond(d[1][x], d[2][x], d[3][x]);
            d[SIDE + 1][x] = beyond(d[SIDE][x], d[SIDE - 1][x], d[SIDE - 2][x]);
        }
        Depths(d)
    }

    /// A bit for each pixel of a row that lies behind its neighbours as at an outline.
    fn outline(&self, y: usize) -> u32 {
        let [below, row, above] = [&self.0[y], &self.0[y + 1], &self.0[y + 2]];
        let mut marks = [false; SIDE];
        for (x, mark) in marks.iter_mut().enumerate() {
            let d = row[x + 1];
            let behind = |a: f32, b: f32| d + d - a - b > STEP * (a - b).abs() + FLAT;
            *mark = behind(row[x], row[x + 2]) | behind(below[x + 1], above[x + 1]);
        }
        marks.iter().enumerate().fold(0, |bits, (x, m)| bits | u32::from(*m) << x)
    }
}

/// Looks beside the centres of outline pixels of a tile, of which something was seen.
pub(super) fn look_beside(
    draws: &[Prepared<'_>],
    area: Rect,
    rays: &mut TileRays,
    seen: &mut [Seen; SIDE * SIDE],
) {
    let depths = Depths::new(seen);
    let mut pixels = [[0_i32; 2]; SIDE * SIDE];
    let mut n = 0;
    let inside = (1_u32 << area.w) - 1;
    for y in 0..area.h {
        let mut bits = depths.outline(y as usize) & inside;
        while bits != 0 {
            pixels[n] = [area.x + bits.trailing_zeros() as i32, area.y + y];
            (n, bits) = (n + 1, bits & (bits - 1));
        }
    }
    if n == 0 {
        return;
    }
    for (index, p) in draws.iter().enumerate() {
        for some in pixels[..n].chunks(rays.room() / RAYS) {
            let at = some.iter().flat_map(|[x, y]| {
                BESIDE.map(|[dx, dy]| [f64::from(*x) + 0.5 + dx, f64::from(*y) + 0.5 + dy])
            });
            if !p.rect.and(area).is_empty() && rays.send_points(p, at) {
                p.rays.fetch_add((some.len() * RAYS) as u64, Relaxed);
                take(p, index as u32, area, some, rays, seen);
            }
        }
    }
}

/// Takes what the rays beside `pixels` found, where it covers the pixels.
fn take(
    p: &Prepared<'_>,
    index: u32,
    area: Rect,
    pixels: &[[i32; 2]],
    rays: &TileRays,
    seen: &mut [Seen; SIDE * SIDE],
) {
    let later_wins_ties = p.draw.state.depth_func == LEQUAL;
    for (i, [x, y]) in pixels.iter().enumerate() {
        let at = &mut seen[((y - area.y) * TILE + x - area.x) as usize];
        let mut tried = [u32::MAX; RAYS];
        for k in 0..RAYS {
            let lane = i * RAYS + k;
            let Some(hit) = rays.beside[lane / LANES].get(lane % LANES) else { continue };
            if tried.contains(&hit.prim) || at.is(index, hit.prim) {
                continue;
            }
            tried[k] = hit.prim;
            if let Some(f) = p.fragment(hit.prim as usize, *x, *y) {
                let bits = (f.depth * DEPTH_STEPS + 0.5) as u32;
                at.take(Seen::new(bits, index, hit.prim, f), later_wins_ties);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::{Cache, Structures};
    use crate::capture::{Attributes, Draw, Shading};
    use crate::config::Settings;
    use crate::overrides::Look;
    use crate::ranks::rows::Share;
    use crate::state::current::Current;
    use crate::state::snapshot::Snapshot;
    use crate::trace::{Fragment, nearest};
    use std::sync::Arc;

    fn seen(depth: impl Fn(usize, usize) -> Option<f64>) -> Box<[Seen; SIDE * SIDE]> {
        let mut all = Box::new([Seen::NOTHING; SIDE * SIDE]);
        for (i, s) in all.iter_mut().enumerate() {
            if let Some(depth) = depth(i % SIDE, i / SIDE) {
                let f = Fragment { weights: [0.0; 3], depth, plain_depth: depth, front: true };
                *s = Seen::new((depth * DEPTH_STEPS) as u32, 0, 0, f);
            }
        }
        all
    }

    fn marked(depth: impl Fn(usize, usize) -> Option<f64>) -> Vec<(usize, usize)> {
        let d = Depths::new(&seen(depth));
        let all = (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE));
        all.filter(|(x, y)| d.outline(*y) >> x & 1 == 1).collect()
    }

    #[test]
    fn slopes_and_spheres_have_no_outline_inside() {
        assert_eq!(marked(|x, y| Some(0.3 + 0.01 * x as f64 + 0.02 * y as f64)), []);
        let sphere = |x: usize, y: usize| {
            let (x, y) = (x as f64 - 8.0, y as f64 - 8.0);
            Some(0.5 - 0.001 * (400.0 - x * x - y * y).sqrt())
        };
        assert_eq!(marked(sphere), []);
    }

    #[test]
    fn pixels_behind_an_edge_are_marked_and_those_before_it_are_not() {
        let edge = |x: usize, _: usize| Some(if x < 6 { 0.2 } else { 0.7 });
        let column: Vec<_> = (0..SIDE).map(|y| (6, y)).collect();
        assert_eq!(marked(edge), column);
        // At the border of the tile as well, and before nothing.
        let border = |x: usize, _: usize| (x > 0).then_some(0.2);
        assert_eq!(marked(border), (0..SIDE).map(|y| (0, y)).collect::<Vec<_>>());
    }

    #[test]
    fn both_sides_of_a_line_of_one_pixel_are_marked() {
        let line = |x: usize, y: usize| (x == 8 && y == 8).then_some(0.4);
        assert_eq!(marked(line), [(8, 7), (7, 8), (9, 8), (8, 9)]);
    }

    const IDENTITY: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    const WINDOW: i32 = 256;

    /// Splinters, ten pixels long and up to one wide, in all directions and depths.
    fn splinters(count: usize) -> Draw {
        let mut state = 7_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1_u64 << 24) as f32
        };
        let pixel = 2.0 / WINDOW as f32;
        let mut positions = Vec::new();
        for _ in 0..count {
            let (x, y, z) = (random() * 1.9 - 0.95, random() * 1.9 - 0.95, random() * 1.8 - 0.9);
            let (sin, cos) = (random() * 6.283).sin_cos();
            let half = 0.5 * pixel * random();
            let (along, across) = ([cos * 10.0 * pixel, sin * 10.0 * pixel], [-sin * half, cos * half]);
            positions.push([x - across[0], y - across[1], z]);
            positions.push([x + across[0], y + across[1], z]);
            positions.push([x + along[0], y + along[1], z + 0.1 * random()]);
        }
        let triangles: Vec<[u32; 3]> = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Draw {
            geometry: Cache::default().of_indices(&positions, &triangles),
            attributes: Arc::new(Attributes::constant(&Current::default())),
            state: Arc::new(Snapshot {
                model_view: IDENTITY,
                projection: IDENTITY,
                viewport: [0, 0, WINDOW, WINDOW],
                depth_range: [0.0, 1.0],
                front_is_ccw: true,
                depth_test: true,
                depth_mask: true,
                depth_func: crate::enums::LESS,
                color_mask: true,
                ..Snapshot::default()
            }),
            shading: Shading::Fixed,
            clip_from_object: IDENTITY,
            calls: 1,
            look: Look::default(),
        }
    }

    #[test]
    fn splinters_cover_what_the_rasterizers_rule_gives_them() {
        let draw = splinters(3000);
        let p = Prepared::new(&draw, None, &mut Structures::default()).expect("seen");
        // The rule, for every pixel near a triangle.
        let mut depth = vec![UNCOVERED; (WINDOW * WINDOW) as usize];
        for prim in 0..draw.geometry.mesh.num_triangles() {
            let corners = p.corners(prim).map(|c| [c[0], c[1]].map(|v| (v + 1.0) * 0.5 * WINDOW as f32));
            let range = |k: usize| {
                let all = corners.map(|c| c[k]);
                let (lo, hi) = (all.into_iter().fold(9e9, f32::min), all.into_iter().fold(-9e9, f32::max));
                (lo as i32 - 1).max(0)..=(hi as i32 + 1).min(WINDOW - 1)
            };
            for y in range(1) {
                for x in range(0) {
                    if let Some(f) = p.fragment(prim, x, y) {
                        let at = &mut depth[(y * WINDOW + x) as usize];
                        *at = at.min(f.depth as f32);
                    }
                }
            }
        }
        let (layer, _) = nearest(std::slice::from_ref(&p), &Settings::default(), Share::WHOLE);
        let mut ours = vec![UNCOVERED; depth.len()];
        for y in 0..layer.rect.h {
            for x in 0..layer.rect.w {
                let at = ((y + layer.rect.y) * WINDOW + x + layer.rect.x) as usize;
                ours[at] = layer.depth[(y * layer.rect.w + x) as usize];
            }
        }
        let covered = depth.iter().filter(|d| **d < UNCOVERED).count();
        let off = depth.iter().zip(&ours).filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
        assert!(covered > 8000, "the test is about nothing: {covered} pixels");
        assert!(off * 2000 <= covered, "{off} of {covered} pixels");
    }
}
