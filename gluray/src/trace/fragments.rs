//! Computes the fragments of a tile's hits, a block of 16 at a time. [`Prepared::fragment`] does
//! the same for a single hit.
//!
//! Every step matches the scalar code and keeps its order. Rare cases go to the scalar code: clip
//! planes, corners behind the viewer, triangles that cover no pixel centre.

use super::{DEPTH_STEPS, Fragment, Prepared, SLACK};
use crate::enums::*;
use crate::state::snapshot::Snapshot;
use crate::trace::raster::{corner_depth, polygon_offset};
use rt_core::ray::{HitBlock, LANES, NO_HIT};

/// The result of a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LaneState {
    /// The ray hit nothing.
    Empty,
    /// The lane has a fragment.
    Found,
    /// The scalar code must decide.
    Ask,
}

/// The fragments of a block.
pub(super) struct FragmentBlock {
    pub(super) lane: [LaneState; LANES],
    weights: [[f64; LANES]; 3],
    depth: [f64; LANES],
    plain: [f64; LANES],
    front: [bool; LANES],
}

/// The positions and matrices of a block's triangles.
struct Corners {
    p: [[[f32; LANES]; 3]; 3],
}

/// The distance in pixels up to which edge functions of snapped coordinates are exact in f64.
const EXACT: f32 = 33_554_432.0;

impl FragmentBlock {
    pub(super) const EMPTY: FragmentBlock = FragmentBlock {
        lane: [LaneState::Empty; LANES],
        weights: [[0.0; LANES]; 3],
        depth: [0.0; LANES],
        plain: [0.0; LANES],
        front: [true; LANES],
    };

    /// The fragment of a lane. The lane must have one.
    #[inline]
    pub(super) fn get(&self, l: usize) -> Fragment {
        Fragment {
            weights: [self.weights[0][l], self.weights[1][l], self.weights[2][l]],
            depth: self.depth[l],
            plain_depth: self.plain[l],
            front: self.front[l],
        }
    }

    /// z/w at the depth with polygon offset, where the offset moves the fragment back. Otherwise
    /// NaN.
    #[inline(always)]
    pub(super) fn moved_back(&self, [n, f]: [f64; 2], out: &mut [f64]) {
        for l in 0..LANES {
            let moved = self.lane[l] == LaneState::Found && self.depth[l] > self.plain[l];
            out[l] = if moved { ((self.depth[l] - n) / (f - n) - 0.5) * 2.0 } else { f64::NAN };
        }
    }

    /// The fragments of `hits` at the block of pixels that starts at (`x`, `y`).
    #[inline(always)]
    pub(super) fn fill(&mut self, p: &Prepared<'_>, hits: &HitBlock, x: i32, y: i32) {
        let s = &*p.draw.state;
        let mesh = &p.draw.geometry.mesh;
        let mut corners = Corners { p: [[[0.0; LANES]; 3]; 3] };
        // All loads come first. They miss the caches, and this way the misses overlap.
        let mut indices = [[0_u32; 3]; LANES];
        for l in 0..LANES {
            if hits.prim[l] != NO_HIT {
                indices[l] = mesh.indices[hits.prim[l] as usize];
            }
        }
        for l in 0..LANES {
            self.lane[l] = LaneState::Empty;
            if hits.prim[l] != NO_HIT {
                self.lane[l] = LaneState::Ask;
                for (corner, i) in corners.p.iter_mut().zip(indices[l]) {
                    let v = mesh.positions[i as usize];
                    (corner[0][l], corner[1][l], corner[2][l]) = (v.x, v.y, v.z);
                }
            }
        }
        // The scalar code decides near a clip plane. It also decides where a shader clips at pixel
        // centres while the rays go through samples.
        if p.discards && s.sample_place != [0.0; 2] {
            return;
        }
        let m = &p.draw.clip_from_object;
        let mut c = [[[0.0_f32; LANES]; 4]; 3];
        for (c, p) in c.iter_mut().zip(&corners.p) {
            for (r, c) in c.iter_mut().enumerate() {
                for l in 0..LANES {
                    c[l] = m[r] * p[0][l] + m[4 + r] * p[1][l] + m[8 + r] * p[2][l] + m[12 + r];
                }
            }
        }
        let covered = covered(&c, s.viewport, x, y);
        let [steep, shift] = match s.polygon_offset {
            Some(_) => slopes(&c, s),
            None => [[0.0; LANES]; 2],
        };
        let [vx, vy, vw, vh] = s.viewport.map(f64::from);
        let [n, f] = s.depth_range;
        let (factor, units) = s.polygon_offset.unwrap_or((0.0, 0.0));
        let constant = 2.0 * f64::from(units) / DEPTH_STEPS;
        let (lo, hi) = if n < f { (n, f) } else { (f, n) };
        let (lo, hi) = if s.depth_clamp { (lo, hi) } else { (0.0, 1.0) };
        let (cull_front, cull_back) = match s.cull {
            None => (false, false),
            Some(FRONT) => (true, false),
            Some(BACK) => (false, true),
            Some(_) => (true, true),
        };
        let mut good = [false; LANES];
        for l in 0..LANES {
            let (px, py) = (f64::from(x + l as i32 % 4) + 0.5, f64::from(y + l as i32 / 4) + 0.5);
            let (ax, ay) = (2.0 * (px - vx) / vw - 1.0, 2.0 * (py - vy) / vh - 1.0);
            let h = |i: usize, k: usize| f64::from(c[i][k][l]);
            let cross = |a: usize, b: usize| {
                [
                    h(a, 1) * h(b, 3) - h(a, 3) * h(b, 1),
                    h(a, 3) * h(b, 0) - h(a, 0) * h(b, 3),
                    h(a, 0) * h(b, 1) - h(a, 1) * h(b, 0),
                ]
            };
            let (e0, e1, e2) = (cross(1, 2), cross(2, 0), cross(0, 1));
            let at = |e: [f64; 3]| e[0] * ax + e[1] * ay + e[2];
            let (l0, l1, l2) = (at(e0), at(e1), at(e2));
            let area = h(0, 0) * e0[0] + h(0, 1) * e0[1] + h(0, 3) * e0[2];
            let front = (area > 0.0) == s.front_is_ccw;
            let culled = (front & cull_front) | (!front & cull_back);
            let sum = l0 + l1 + l2;
            let z = l0 * h(0, 2) + l1 * h(1, 2) + l2 * h(2, 2);
            let w = l0 * h(0, 3) + l1 * h(1, 3) + l2 * h(2, 3);
            let corners = [0, 1, 2].map(|i| corner_depth(c[i][2][l], c[i][3][l], s.depth_range));
            let level = (corners[0] == corners[1]) & (corners[1] == corners[2]);
            let sloped = n + (f - n) * (z / w * 0.5 + 0.5);
            let plain = if level { f64::from(corners[0]) } else { sloped };
            let depth = plain + (f64::from(factor) * steep[l] + constant + shift[l]);
            let inside = s.depth_clamp | (z.abs() <= w.abs() * (1.0 + SLACK));
            let before = (c[0][3][l] > 0.0) & (c[1][3][l] > 0.0) & (c[2][3][l] > 0.0);
            let sound = (area != 0.0) & (area.abs() < f64::INFINITY) & (sum != 0.0);
            self.weights[0][l] = l0 / sum;
            self.weights[1][l] = l1 / sum;
            self.weights[2][l] = l2 / sum;
            self.plain[l] = plain;
            self.depth[l] = depth.max(lo).min(hi);
            self.front[l] = front;
            good[l] = before & sound & inside & !culled & covered[l];
        }
        for plane in &p.clip_planes {
            for l in 0..LANES {
                let (mut height, mut size) = (0.0, 0.0);
                for (i, corner) in corners.p.iter().enumerate() {
                    let at = |k: usize| f64::from(corner[k][l]);
                    let term = self.weights[i][l]
                        * (plane[0] * at(0) + plane[1] * at(1) + plane[2] * at(2) + plane[3]);
                    (height, size) = (height + term, size + term.abs());
                }
                good[l] &= height > 1e-6 * size;
            }
        }
        for l in 0..LANES {
            if good[l] && self.lane[l] == LaneState::Ask {
                self.lane[l] = LaneState::Found;
            }
        }
    }
}

/// `f32::round` without a function call. Halves round away from zero.
#[inline(always)]
fn rounded(v: f32) -> f32 {
    let t = v as i32 as f32;
    let d = v - t;
    t + f32::from(u8::from(d >= 0.5)) - f32::from(u8::from(d <= -0.5))
}

/// Same as [`crate::trace::raster::covers`] where the result is exact in f64. False elsewhere.
#[inline(always)]
fn covered(c: &[[[f32; LANES]; 4]; 3], viewport: [i32; 4], x: i32, y: i32) -> [bool; LANES] {
    let [vx, vy, vw, vh] = viewport.map(|v| v as f32);
    let mut s = [[[0.0_f64; LANES]; 2]; 3];
    let mut exact = [true; LANES];
    for (s, c) in s.iter_mut().zip(c) {
        for l in 0..LANES {
            let inverse = 1.0 / c[3][l];
            let sx = (c[0][l] * inverse * (0.5 * vw) + (0.5 * vw + vx)) * 256.0;
            let sy = (c[1][l] * inverse * (0.5 * vh) + (0.5 * vh + vy)) * 256.0;
            exact[l] &= (sx.abs() < EXACT) & (sy.abs() < EXACT);
            s[0][l] = f64::from(rounded(sx));
            s[1][l] = f64::from(rounded(sy));
        }
    }
    let mut out = [false; LANES];
    for l in 0..LANES {
        let (cx, cy) = (
            f64::from(x + l as i32 % 4) * 256.0 + 128.0,
            f64::from(y + l as i32 / 4) * 256.0 + 128.0,
        );
        let edge = |a: usize, b: usize, x: f64, y: f64| {
            (s[b][0][l] - s[a][0][l]) * (y - s[a][1][l])
                - (s[b][1][l] - s[a][1][l]) * (x - s[a][0][l])
        };
        let area = edge(0, 1, s[2][0][l], s[2][1][l]);
        // Clockwise triangles use the same edges in reverse.
        let sign = if area > 0.0 { 1.0 } else { -1.0 };
        let mut inside = exact[l] & (area != 0.0);
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let e = edge(a, b, cx, cy) * sign;
            let (dx, dy) = ((s[b][0][l] - s[a][0][l]) * sign, (s[b][1][l] - s[a][1][l]) * sign);
            let inclusive = (dy < 0.0) | ((dy == 0.0) & (dx > 0.0));
            inside &= (e > 0.0) | ((e == 0.0) & inclusive);
        }
        out[l] = inside;
    }
    out
}

/// Same as [`crate::trace::raster::steepness`] or [`polygon_offset`], as the state requires.
/// Returns the value that the factor of polygon offset multiplies, and the value that is added to
/// it.
#[inline(always)]
fn slopes(c: &[[[f32; LANES]; 4]; 3], s: &Snapshot) -> [[f64; LANES]; 2] {
    let depth_scale = s.depth_range[1] - s.depth_range[0];
    let half = [f64::from(s.viewport[2]) * 0.5, f64::from(s.viewport[3]) * 0.5];
    let mut out = [[0.0; LANES]; 2];
    for l in 0..LANES {
        let w = |i: usize| {
            let inverse = 1.0 / f64::from(c[i][3][l]);
            [
                f64::from(c[i][0][l]) * inverse * half[0],
                f64::from(c[i][1][l]) * inverse * half[1],
                f64::from(c[i][2][l]) * inverse * 0.5 * depth_scale,
            ]
        };
        let (w0, w1, w2) = (w(0), w(1), w(2));
        let (ax, ay, az) = (w1[0] - w0[0], w1[1] - w0[1], w1[2] - w0[2]);
        let (bx, by, bz) = (w2[0] - w0[0], w2[1] - w0[1], w2[2] - w0[2]);
        let det = ax * by - bx * ay;
        let (dx, dy) = ((az * by - bz * ay) / det, (bz * ax - az * bx) / det);
        let [slope, shift] = match s.offset_by_length {
            true => polygon_offset([dx, dy], s.sample_place),
            false => [dx.abs().max(dy.abs()), 0.0],
        };
        (out[0][l], out[1][l]) = if det == 0.0 { (0.0, 0.0) } else { (slope, shift) };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::raster;

    /// Corners all over the window, on pixel centres and between them, with w from 0.5 to 2.
    fn triangles() -> Vec<[[f32; 4]; 3]> {
        let mut state = 1_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1_u64 << 24) as f32
        };
        (0..4000)
            .map(|i| {
                std::array::from_fn(|_| {
                    let w = 0.5 + 1.5 * random();
                    let mut at = || {
                        let v = random() * 2.0 - 1.0;
                        if i % 2 == 0 { ((v * 4.0).round() + 0.5) / 4.0 } else { v }
                    };
                    [at() * w, at() * w, at() * w, w]
                })
            })
            .collect()
    }

    #[test]
    fn a_block_covers_the_pixels_that_the_rasterizers_rule_gives_it() {
        let viewport = [0, 0, 4, 4];
        let mut covered_pixels = 0;
        for t in triangles() {
            let c: [[[f32; LANES]; 4]; 3] =
                std::array::from_fn(|i| std::array::from_fn(|k| [t[i][k]; LANES]));
            let all = covered(&c, viewport, 0, 0);
            for l in 0..LANES {
                let one = raster::covers(&t, viewport, l as i32 % 4, l as i32 / 4);
                assert_eq!(all[l], one, "{t:?}, lane {l}");
                covered_pixels += u32::from(one);
            }
            let place = [0.125, -0.375];
            let state = |offset_by_length| Snapshot {
                viewport,
                depth_range: [0.0, 1.0],
                sample_place: place,
                offset_by_length,
                ..Snapshot::default()
            };
            let [greater, nothing] = slopes(&c, &state(false));
            assert_eq!(
                [greater[0], nothing[0]],
                [raster::steepness(&t, viewport, 1.0), 0.0],
                "{t:?}"
            );
            let [length, shift] = slopes(&c, &state(true));
            assert_eq!(
                [length[0], shift[0]],
                polygon_offset(raster::gradient(&t, viewport, 1.0), place),
                "{t:?}"
            );
        }
        assert!(covered_pixels > 1000, "the test is about nothing: {covered_pixels}");
    }
}
