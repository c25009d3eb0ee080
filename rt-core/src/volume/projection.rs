//! Volumes that are not media: the largest or smallest scalar along a ray, means and sums,
//! isosurfaces.

use super::layer::{Layer, MarchState};
use super::{Blend, MACROCELL, Volume, VolumeQuality, VolumeSample};
use crate::grid_walk::{Crossing, IndexRay};
use crate::ray::Ray;
use crate::ray_cubic;
use crate::stored_volume::BRICK_CELLS;
use glam::UVec3;
use std::ops::ControlFlow;

/// The part of a ray in one cell, and the scalar along it as a Bézier cubic.
struct CellSegment<'a> {
    crossing: &'a Crossing,
    stored: UVec3,
    b: [f64; 4],
    /// The volume, or the part of a stored one, that has the cell.
    part: &'a Volume,
}

/// A ray through the cells of a volume, and what is done with them.
struct CellVisitor<'a, W, V> {
    ray: &'a IndexRay,
    t0: f64,
    t1: f64,
    /// Cells of the whole volume.
    cells: [i64; 3],
    wanted: W,
    visit: V,
}

impl Volume {
    /// Whether it is a medium, which mixes with others that share its space.
    pub fn is_medium(&self) -> bool {
        self.options.blend == Blend::Composite
    }

    /// The result of a ray between `t0` and `t1` through a volume that is not a medium.
    pub(super) fn project(
        &self,
        ray: &Ray,
        t0: f64,
        t1: f64,
        quality: &VolumeQuality,
    ) -> VolumeSample {
        match &self.options.blend {
            Blend::Composite => VolumeSample::CLEAR,
            Blend::Maximum => self.extreme(ray, t0, t1, 1.0),
            Blend::Minimum => self.extreme(ray, t0, t1, -1.0),
            Blend::Average => self.sum(ray, t0, t1, quality, true),
            Blend::Additive => self.sum(ray, t0, t1, quality, false),
            Blend::Isosurfaces(values) => self.surfaces(ray, t0, t1, values),
        }
    }

    /// Visits the blocks and cells that the ray crosses, in order. `wanted` tells from the range of
    /// its values whether a block or a cell counts. Cells with a NaN value are left out.
    fn visit_cells(
        &self,
        ray: &Ray,
        t0: f64,
        t1: f64,
        wanted: impl FnMut(f64, f64) -> bool,
        visit: impl FnMut(&IndexRay, &CellSegment<'_>) -> ControlFlow<()>,
    ) {
        let (index_ray, cells, t0, t1) = self.index_ray(ray, t0, t1);
        if t0 >= t1 {
            return;
        }
        let cells = cells.to_array().map(i64::from);
        let mut cell_visitor = CellVisitor { ray: &index_ray, t0, t1, cells, wanted, visit };
        let Some(stored) = &self.stored else {
            self.visit_cells_of([0; 3], cells, &mut cell_visitor);
            return;
        };
        let size = i64::from(BRICK_CELLS);
        index_ray.walk([0; 3], cells, cells, size, t0, t1, |brick| {
            let [low, high] = stored.range_at(brick.cell);
            if low > high || !(cell_visitor.wanted)(low.into(), high.into()) {
                return true;
            }
            let end = std::array::from_fn(|a| (brick.cell[a] + size).min(cells[a]));
            let visit = |part: &Volume| part.visit_cells_of(brick.cell, end, &mut cell_visitor);
            self.with_part_at(stored, brick.cell, visit).unwrap_or(true)
        });
    }

    /// [`Volume::visit_cells`] of the cells from `lo` to before `hi`. False when there is no need
    /// to go on.
    fn visit_cells_of<W, V>(
        &self,
        lo: [i64; 3],
        hi: [i64; 3],
        cell_visitor: &mut CellVisitor<'_, W, V>,
    ) -> bool
    where
        W: FnMut(f64, f64) -> bool,
        V: FnMut(&IndexRay, &CellSegment<'_>) -> ControlFlow<()>,
    {
        let CellVisitor { ray, t0, t1, cells, wanted, visit } = cell_visitor;
        let (index_ray, cells) = (*ray, *cells);
        let size = i64::from(MACROCELL);
        let mut going = true;
        index_ray.walk(lo, hi, cells, size, *t0, *t1, |block| {
            let [low, high] = self.ranges
                [self.block_index(UVec3::from_array(block.cell.map(|c| (c / size) as u32)))];
            if low > high || block.t1 <= block.t0 || !wanted(low.into(), high.into()) {
                return true;
            }
            let end = std::array::from_fn(|a| (block.cell[a] + size).min(hi[a]));
            index_ray.walk(block.cell, end, cells, 1, block.t0, block.t1, |crossing| {
                let stored = UVec3::from_array(crossing.cell.map(|i| i as u32)) - self.first_point;
                let b = if self.is_nearest() {
                    [f64::from(self.grid.at(stored.x, stored.y, stored.z)); 4]
                } else {
                    let corners = self.grid.corners(stored).map(f64::from);
                    let low = corners.iter().copied().fold(f64::INFINITY, f64::min);
                    let high = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    if !wanted(low, high) {
                        return true;
                    }
                    let (p, q) = index_ray.fractions(crossing, 1);
                    ray_cubic::along(&corners, &p, &q)
                };
                if crossing.t1 > crossing.t0 && b.iter().all(|v| v.is_finite()) {
                    going = visit(index_ray, &CellSegment { crossing, stored, b, part: self })
                        .is_continue();
                }
                going
            });
            going
        });
        going
    }

    /// The largest scalar (`sign` 1) or the smallest (−1).
    fn extreme(&self, ray: &Ray, t0: f64, t1: f64, sign: f64) -> VolumeSample {
        let best = std::cell::Cell::new((f64::NEG_INFINITY, f64::INFINITY));
        let mut samples = 0;
        let more = |low: f64, high: f64| (sign * low).max(sign * high) > best.get().0;
        self.visit_cells(ray, t0, t1, more, |_, s| {
            samples += 1;
            let c = s.crossing;
            let (places, count) = turns(&s.b);
            for u in places[..count].iter().copied().chain([0.0, 1.0]) {
                let value = sign * ray_cubic::evaluate(&s.b, u);
                if value > best.get().0 {
                    best.set((value, c.t0 + (c.t1 - c.t0) * u));
                }
            }
            ControlFlow::Continue(())
        });
        let (value, t) = best.get();
        if value == f64::NEG_INFINITY {
            return VolumeSample::CLEAR;
        }
        let (opacity, color) = self.transfer.sample(sign * value);
        let a = opacity.clamp(0.0, 1.0);
        let [r, g, b] = color.map(|c| (c * a) as f32);
        let depth = if a >= 0.5 { t as f32 } else { f32::INFINITY };
        VolumeSample { rgba: [r, g, b, a as f32], depth, samples }
    }

    /// Colour times weight, integrated; divided by the length of the path for a mean.
    fn sum(
        &self,
        ray: &Ray,
        t0: f64,
        t1: f64,
        quality: &VolumeQuality,
        mean: bool,
    ) -> VolumeSample {
        let per_t = f64::from(ray.dir.length());
        let (mut length, mut samples, mut total) = (0.0, 0, [0.0; 3]);
        // The tolerance applies to the total of a sum, and to every point of a mean.
        let levels = match *quality {
            VolumeQuality::Tolerance { levels } => f64::from(levels.max(1e-6)),
            VolumeQuality::Step { .. } => 0.1,
        };
        let path = if mean { 1.0 } else { self.bounds().extent().as_dvec3().length() };
        let error_per_length = levels / 255.0 / path;
        self.visit_cells(
            ray,
            t0,
            t1,
            |_, _| true,
            |_, s| {
                let way = (s.crossing.t1 - s.crossing.t0) * per_t;
                length += way;
                let (sum, count) = self.weighted(&s.b, way, error_per_length, 0);
                samples += count;
                total.iter_mut().zip(sum).for_each(|(t, s)| *t += s);
                ControlFlow::Continue(())
            },
        );
        if length == 0.0 {
            return VolumeSample::CLEAR;
        }
        let scale = if mean { length.recip() } else { 1.0 };
        let [r, g, b] = total.map(|t| (t * scale).clamp(0.0, 1.0) as f32);
        VolumeSample { rgba: [r, g, b, 1.0], depth: t0 as f32, samples }
    }

    /// ∫ colour times weight over an interval of this length: exact along its chord, and split
    /// until the chord represents the curve.
    fn weighted(
        &self,
        b: &[f64; 4],
        length: f64,
        error_per_length: f64,
        depth: u32,
    ) -> ([f64; 3], u32) {
        const MAX_DEPTH: u32 = 10;
        let one = self.along_chord(b[0], b[3], length);
        // Not in the middle: an antisymmetric cubic passes through the middle of its chord.
        let split = 0.375;
        let (near, far) = ray_cubic::split(b, split);
        let [first, second] = [(&near, split), (&far, 1.0 - split)]
            .map(|(b, part)| self.along_chord(b[0], b[3], length * part));
        let two: [f64; 3] = std::array::from_fn(|c| first[c] + second[c]);
        let off = (0..3).map(|c| (one[c] - two[c]).abs()).fold(0.0, f64::max);
        if depth == MAX_DEPTH || off <= error_per_length * length {
            return (two, 3);
        }
        let (first, n) = self.weighted(&near, length * split, error_per_length, depth + 1);
        let (second, m) = self.weighted(&far, length * (1.0 - split), error_per_length, depth + 1);
        (std::array::from_fn(|c| first[c] + second[c]), n + m + 3)
    }

    fn along_chord(&self, s0: f64, s1: f64, length: f64) -> [f64; 3] {
        if (s1 - s0).abs() > self.transfer.resolution() {
            let (i0, i1) = (self.transfer.integral(s0), self.transfer.integral(s1));
            return std::array::from_fn(|c| (i1[c + 1] - i0[c + 1]) / (s1 - s0) * length);
        }
        let (weight, color) = self.transfer.sample(0.5 * (s0 + s1));
        color.map(|c| c * weight * length)
    }

    /// The surfaces on which the scalar has one of `values`, one behind the other.
    fn surfaces(&self, ray: &Ray, t0: f64, t1: f64, values: &[f32]) -> VolumeSample {
        let mut m = MarchState::new(VolumeQuality::default(), 1.0);
        let any =
            |low: f64, high: f64| values.iter().any(|v| (low..=high).contains(&f64::from(*v)));
        let mut found: Vec<(f64, f64)> = Vec::new();
        self.visit_cells(ray, t0, t1, any, |index_ray, s| {
            found.clear();
            for &value in values {
                crossings(&s.b, value.into(), |u| found.push((u, value.into())));
            }
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
            for &(u, value) in &found {
                m.samples += 1;
                let (opacity, color) = self.transfer.sample(value);
                let (p, q) = index_ray.fractions(s.crossing, 1);
                let at = std::array::from_fn(|a| p[a] + (q[a] - p[a]) * u);
                let color = s.part.shaded_at(index_ray, s.stored, at, color);
                // A layer without thickness: this opacity, for any path through it.
                let tau = -(-opacity.clamp(0.0, 0.999_999)).ln_1p();
                let t = s.crossing.t0 + (s.crossing.t1 - s.crossing.t0) * u;
                m.add(t, t, &Layer { tau, color: color.map(|c| c.min(1.0)) });
            }
            if m.is_opaque() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let [r, g, b] = m.color.map(|c| c as f32);
        let rgba = [r, g, b, (1.0 - m.transmittance) as f32];
        VolumeSample { rgba, depth: m.depth as f32, samples: m.samples }
    }
}

/// The turning points of a cubic between 0 and 1, in order, and their number.
pub(super) fn turns(b: &[f64; 4]) -> ([f64; 2], usize) {
    // Its derivative in Bernstein form, as a + 2 h u + c u².
    let [d0, d1, d2] = [b[1] - b[0], b[2] - b[1], b[3] - b[2]];
    let (a, h, c) = (d0, d1 - d0, d0 - 2.0 * d1 + d2);
    let mut places = ([0.0; 2], 0);
    let mut add = |u: f64| {
        if u > 0.0 && u < 1.0 {
            places.0[places.1] = u;
            places.1 += 1;
        }
    };
    let discriminant = h * h - a * c;
    if discriminant >= 0.0 {
        // The form without cancellation.
        let q = -(h + h.signum() * discriminant.sqrt());
        let (x, y) = (q / c, a / q);
        add(x.min(y));
        if x != y {
            add(x.max(y));
        }
    }
    places
}

/// Calls `found` with every parameter between 0 and 1, in order, where the cubic passes `value`.
fn crossings(b: &[f64; 4], value: f64, mut found: impl FnMut(f64)) {
    let (places, count) = turns(b);
    let (mut low, mut below) = (0.0, b[0] < value);
    for end in places[..count].iter().copied().chain([1.0]) {
        // Exactly at the end, where the next cell begins.
        let at_end = if end == 1.0 { b[3] } else { ray_cubic::evaluate(b, end) };
        if (at_end < value) != below {
            let (mut near, mut far) = (low, end);
            // To the last bit that matters for an image.
            for _ in 0..40 {
                let mid = 0.5 * (near + far);
                if (ray_cubic::evaluate(b, mid) < value) == below { near = mid } else { far = mid }
            }
            found(0.5 * (near + far));
        }
        (low, below) = (end, at_end < value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_crossings_of_a_wave_are_found_in_order() {
        // Through 0 at 0.1, 0.5 and 0.9, as Bernstein coefficients of 20 (u - 0.1) (u - 0.5) (u -
        // 0.9).
        let power = [-0.9, 11.8, -30.0, 20.0];
        let b = [
            power[0],
            power[0] + power[1] / 3.0,
            power[0] + 2.0 * power[1] / 3.0 + power[2] / 3.0,
            power.iter().sum(),
        ];
        let mut places = Vec::new();
        crossings(&b, 0.0, |u| places.push(u));
        assert_eq!(places.len(), 3, "{places:?}");
        for (u, exact) in places.iter().zip([0.1, 0.5, 0.9]) {
            assert!((u - exact).abs() < 1e-9, "{places:?}");
        }
        let (turn, count) = turns(&b);
        assert_eq!(count, 2);
        let top = ray_cubic::evaluate(&b, turn[0]);
        assert!((0..=1000).all(|i| ray_cubic::evaluate(&b, f64::from(i) * 5e-4) <= top + 1e-12));
        assert_eq!(turns(&[0.0, 1.0, 2.0, 3.0]).1, 0, "a straight line turns nowhere");
        assert_eq!(turns(&[1.0; 4]).1, 0, "nor does a constant");
    }
}
