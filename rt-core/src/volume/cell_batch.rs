//! Cells along a ray, eight at a time.
//!
//! The scalar along the ray in a cell is a cubic. It is cut where it turns and where the transfer
//! function bends, so within each piece extinction and colour are linear in the scalar, and the
//! piece is integrated in closed form ([`super::linear_segment`]). Nothing has to be halved until
//! halves agree.
//!
//! The lanes hold cells of one ray, not the same cell of several rays: no lane waits for rays that
//! have diverged or ended, and a ray has the same bits alone, among others and in bricks.

use super::Volume;
use super::lanes::{LANES, Row, max, min};
use super::layer::MarchState;
use super::linear_parts::{MAX_KNOTS, for_each_linear};
use super::linear_segment::{LinearSegments, RayInLanes};
use super::shading_in_lanes::LitCells;
use crate::grid_walk::Crossing;
use crate::transfer_function::Pieces;
use fearless_simd::{Select, Simd, SimdBase, dispatch, f64x8};
use glam::UVec3;

/// Up to eight cells that a ray crosses one after another, and segments of earlier ones.
pub(super) struct CellBatch {
    len: usize,
    stored: [UVec3; LANES],
    /// Values at the corners, x fastest.
    corners: [Row; 8],
    t0: Row,
    t1: Row,
    cell: [Row; 3],
    /// Axis of the face through which the ray enters and leaves; -1 for none.
    entry: Row,
    exit: Row,
    segments: LinearSegments,
}

impl CellBatch {
    pub(super) fn new() -> Self {
        CellBatch {
            len: 0,
            stored: [UVec3::ZERO; LANES],
            corners: [[0.0; LANES]; 8],
            t0: [0.0; LANES],
            t1: [0.0; LANES],
            cell: [[0.0; LANES]; 3],
            entry: [-1.0; LANES],
            exit: [-1.0; LANES],
            segments: LinearSegments::new(),
        }
    }

    #[inline]
    fn push(&mut self, c: &Crossing, stored: UVec3, corners: &[f32; 8]) {
        let lane = self.len & (LANES - 1);
        self.stored[lane] = stored;
        for (row, v) in self.corners.iter_mut().zip(corners) {
            row[lane] = f64::from(*v);
        }
        (self.t0[lane], self.t1[lane]) = (c.t0, c.t1);
        for a in 0..3 {
            self.cell[a][lane] = c.cell[a] as f64;
        }
        let axis = |face: Option<usize>| face.map_or(-1.0, |a| a as f64);
        (self.entry[lane], self.exit[lane]) = (axis(c.entry), axis(c.exit));
        self.len += 1;
    }
}

/// What the lanes compute from a batch.
struct Cubics {
    /// Bernstein coefficients of the scalar along each cell.
    b: [Row; 4],
    /// Smallest and largest coefficient.
    lo: Row,
    hi: Row,
    /// Positions in the cell at which the ray enters and leaves.
    p: [Row; 3],
    q: [Row; 3],
}

impl Volume {
    /// Adds the cell `c` to the batch, unless it is clear, and integrates the batch when it is
    /// full. `pieces` are those of the transfer function, or `None` where no cell is clear.
    #[inline]
    pub(super) fn collect_cell(
        &self,
        ray: &RayInLanes<'_>,
        pieces: Option<&Pieces>,
        c: &Crossing,
        batch: &mut CellBatch,
        m: &mut MarchState,
    ) {
        if c.t1 <= c.t0 {
            return;
        }
        let stored = UVec3::from_array(c.cell.map(|i| i as u32)) - self.first_point;
        let dims = self.grid.dims;
        let (row, slab) = (dims.x as usize, dims.x as usize * dims.y as usize);
        let at = self.grid.index(stored.x, stored.y, stored.z);
        let [v0, v1] = self.grid.pair(at);
        let [v2, v3] = self.grid.pair(at + row);
        let [v4, v5] = self.grid.pair(at + slab);
        let [v6, v7] = self.grid.pair(at + slab + row);
        let corners = [v0, v1, v2, v3, v4, v5, v6, v7];
        // Infinity and NaN times zero are NaN.
        if corners.iter().map(|v| v * 0.0).sum::<f32>() != 0.0 {
            return;
        }
        if let Some(pieces) = pieces {
            let (mut lo, mut hi) = (v0, v0);
            for v in corners {
                lo = if v < lo { v } else { lo };
                hi = if v > hi { v } else { hi };
            }
            if pieces.is_clear(lo.into(), hi.into()) {
                return;
            }
        }
        batch.push(c, stored, &corners);
        if batch.len == LANES {
            self.integrate_batch(ray, batch, m);
        }
    }

    /// Integrates all that the batch holds.
    pub(super) fn finish_batch(
        &self,
        ray: &RayInLanes<'_>,
        batch: &mut CellBatch,
        m: &mut MarchState,
    ) {
        self.integrate_batch(ray, batch, m);
        dispatch!(self.level, simd => batch.segments.integrate(simd, ray, m));
    }

    /// Integrates the cells of the batch, and empties it; the last segments stay in it.
    fn integrate_batch(&self, ray: &RayInLanes<'_>, batch: &mut CellBatch, m: &mut MarchState) {
        if batch.len > 0 && !m.is_opaque() {
            dispatch!(self.level, simd => self.integrate_batch_in(simd, ray, batch, m));
        }
        batch.len = 0;
    }

    #[inline(always)]
    fn integrate_batch_in<S: Simd>(
        &self,
        simd: S,
        ray: &RayInLanes<'_>,
        batch: &mut CellBatch,
        m: &mut MarchState,
    ) {
        let cubics = cubics(simd, ray, batch);
        let pieces = self.transfer.pieces(m.allows_simplified());
        // Not by `map`, which may be compiled on its own, without the instruction set.
        let mut lit = None;
        if let Some(lights) = &ray.lights {
            let stored = &batch.stored[..batch.len];
            lit = Some(LitCells::new(simd, self, lights, stored, &cubics.p, &cubics.q));
        }
        // ---- Cut into segments along which the transfer function is linear.
        let segments = &mut batch.segments;
        for lane in 0..batch.len {
            let (lo, hi) = (cubics.lo[lane], cubics.hi[lane]);
            let b = cubics.b.map(|row| row[lane]);
            let t = [batch.t0[lane], batch.t1[lane]];
            let (first, last) = (pieces.number_at(lo), pieces.number_at(hi));
            let lit = lit.as_ref().map(|l| l.cell(lane));
            if first == last {
                if pieces.all()[first].sigma == [0.0; 2] {
                    continue;
                }
                if segments.is_full() {
                    segments.integrate(simd, ray, m);
                }
                segments.push(&b, t, [0.0, 1.0], &pieces.all()[first], lit.as_ref());
            } else if last - first <= MAX_KNOTS {
                for_each_linear(
                    &b,
                    pieces,
                    [first, last],
                    #[inline(always)]
                    |b, u, piece| {
                        if segments.is_full() {
                            segments.integrate(simd, ray, m);
                        }
                        segments.push(b, t, u, &pieces.all()[piece], lit.as_ref());
                    },
                );
            } else {
                segments.integrate(simd, ray, m);
                let [p, q] = [&cubics.p, &cubics.q].map(|rows| rows.map(|row| row[lane]));
                let light = self.light_along(ray.index_ray, batch.stored[lane], t, &p, &q);
                self.march_adaptive(light.as_ref(), ray.per_t, t, &b, m);
            }
            if m.is_opaque() {
                return;
            }
        }
    }
}

/// [`IndexRay::fractions`](crate::grid_walk::IndexRay::fractions) and [`ray_cubic::along`] in
/// lanes.
#[inline(always)]
fn cubics<S: Simd>(simd: S, ray: &RayInLanes<'_>, batch: &CellBatch) -> Cubics {
    let s = |x: f64| f64x8::splat(simd, x);
    let load = |row: &Row| f64x8::from_slice(simd, row);
    let (zero, one) = (s(0.0), s(1.0));
    // ---- Where the ray enters and leaves each cell.
    let (mut p, mut q) = ([zero; 3], [zero; 3]);
    let (t0, t1) = (load(&batch.t0), load(&batch.t1));
    let (entry, exit) = (load(&batch.entry), load(&batch.exit));
    for a in 0..3 {
        let (o, d) = (s(ray.index_ray.o[a]), ray.index_ray.d[a]);
        let (cell, axis) = (load(&batch.cell[a]), s(a as f64));
        let (near, far) = if d > 0.0 { (zero, one) } else { (one, zero) };
        let start = min(max((o + t0 * s(d)) - cell, zero), one);
        let end = min(max((o + t1 * s(d)) - cell, zero), one);
        p[a] = entry.simd_eq(axis).select(near, start);
        q[a] = exit.simd_eq(axis).select(far, end);
    }
    // ---- The values there, and between.
    let mut r = [zero; 8];
    for (r, row) in r.iter_mut().zip(&batch.corners) {
        *r = load(row);
    }
    for (axis, step) in [(0usize, 1usize), (1, 2), (2, 4)] {
        for i in 0..8 {
            if i & step == 0 {
                let (a, b) = (r[i], r[i | step]);
                r[i] = (one - p[axis]) * a + p[axis] * b;
                r[i | step] = (one - q[axis]) * a + q[axis] * b;
            }
        }
    }
    let third = s(1.0 / 3.0);
    let b = [r[0], (r[1] + r[2] + r[4]) * third, (r[3] + r[5] + r[6]) * third, r[7]];
    let mut cubics = Cubics {
        b: [[0.0; LANES]; 4],
        lo: [0.0; LANES],
        hi: [0.0; LANES],
        p: [[0.0; LANES]; 3],
        q: [[0.0; LANES]; 3],
    };
    for i in 0..4 {
        b[i].store_slice(&mut cubics.b[i]);
    }
    min(min(b[0], b[1]), min(b[2], b[3])).store_slice(&mut cubics.lo);
    max(max(b[0], b[1]), max(b[2], b[3])).store_slice(&mut cubics.hi);
    for a in 0..3 {
        p[a].store_slice(&mut cubics.p[a]);
        q[a].store_slice(&mut cubics.q[a]);
    }
    cubics
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colormap::ColorMap;
    use crate::grid::Grid;
    use crate::ray::Ray;
    use crate::test_shapes::Random;
    use crate::transfer_function::TransferFunction;
    use crate::volume::{
        PartialIntegral, VolumeLight, VolumeOptions, VolumeQuality, VolumeSample, VolumeShading,
    };
    use glam::{DVec3, Vec3};

    /// The same march, cell by cell, by halving until halves agree.
    fn by_halving(v: &Volume, ray: &Ray, quality: VolumeQuality) -> VolumeSample {
        let (index_ray, cells, t0, t1) = v.index_ray(ray, 0.0, f64::INFINITY);
        let cells = cells.to_array().map(i64::from);
        let per_t = ray.dir.as_dvec3().length();
        let mut ends = (f64::INFINITY, f64::NEG_INFINITY);
        index_ray.walk([0; 3], cells, cells, 1, t0, t1, |c| {
            ends = (ends.0.min(c.t0), c.t1);
            true
        });
        let path = (ends.1 - ends.0) * per_t;
        let mut m = PartialIntegral::default().march(quality, path);
        index_ray.walk([0; 3], cells, cells, 1, t0, t1, |c| {
            v.march_cell(&index_ray, per_t, ends.0, c, &mut m);
            true
        });
        PartialIntegral::from(m).sample()
    }

    fn shadings() -> Vec<VolumeOptions> {
        let lit = VolumeShading { ambient: 0.2, diffuse: 0.7, ..VolumeShading::default() };
        let glossy = VolumeShading { specular: 0.5, shininess: 12.0, ..lit };
        let fixed = VolumeShading {
            light: Some(Vec3::new(1.0, 2.0, -0.5)),
            shininess: 7.5,
            half_gradient: 0.3,
            highlight: super::super::VolumeHighlight::Mirrored,
            ..glossy
        };
        let light = |d: Vec3, color| VolumeLight { direction: Some(d), color };
        let lights = vec![light(Vec3::X, [0.9, 0.1, 0.2]), light(Vec3::Z, [0.1, 0.4, 0.9])];
        let of = |shading| VolumeOptions { shading, ..VolumeOptions::default() };
        vec![
            of(None),
            of(Some(lit)),
            of(Some(glossy)),
            VolumeOptions { clamped_gradients: true, ..of(Some(fixed)) },
            VolumeOptions { lights, ..of(Some(lit)) },
        ]
    }

    #[test]
    fn cells_in_lanes_agree_with_halving_for_all_kinds_of_light() {
        let n = 14;
        let mut rng = Random::new(3);
        let mut values: Vec<f32> = (0..n * n * n)
            .map(|i| {
                let p = Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
                (0.6 * p.x).sin() * (0.5 * p.y).cos() + 0.3 * (0.8 * p.z).sin()
            })
            .collect();
        values[5 * n * n + 7 * n + 4] = f32::NAN;
        let grid = Grid::new(UVec3::splat(n as u32), DVec3::ZERO, DVec3::ONE, values).unwrap();
        let colors = ColorMap::new(
            vec![[0.1, 0.2, 1.0, 1.0], [0.9, 1.0, 0.1, 1.0], [1.0, 0.1, 0.1, 1.0]],
            [-1.3, 1.3],
        );
        for extinction in [
            vec![[-1.3, 0.0], [1.3, 0.6]],
            vec![[-0.2, 0.0], [0.2, 4.0], [0.3, 0.1]],
            vec![[0.1, 0.0], [0.1, 1.5], [0.6, 1.5], [0.6, 0.2]],
        ] {
            let transfer = TransferFunction::new(colors.clone(), extinction).unwrap();
            for options in shadings() {
                let v =
                    Volume::new(grid.clone().into(), transfer.clone(), options.clone()).unwrap();
                for _ in 0..60 {
                    let target = Vec3::splat(6.5) + 6.0 * rng.direction() * rng.unit();
                    let from = target + 30.0 * rng.direction();
                    let ray = Ray::new(from, target - from);
                    for levels in [0.5, 0.02] {
                        let quality = VolumeQuality::Tolerance { levels };
                        let got = v.integrate(&ray, 0.0, f32::INFINITY, &quality);
                        let halved = by_halving(&v, &ray, quality);
                        for c in 0..4 {
                            // Each is within `levels` of the truth.
                            let off = 255.0 * (got.rgba[c] - halved.rgba[c]).abs();
                            assert!(off <= 2.0 * levels, "{off} of {levels}, {options:?}");
                        }
                        let apart = (got.depth - halved.depth).abs() * ray.dir.length();
                        // Both are infinite where half of the light passes.
                        assert!(apart.is_nan() || apart <= 0.2, "{got:?} {halved:?}");
                    }
                }
            }
        }
    }
}
