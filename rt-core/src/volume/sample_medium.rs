//! A volume as packets of rays see it: scalars of sixteen places, and their entries in the table.

use super::sample_light::{GradientFactors, PacketLights};
use super::sample_table::{ENTRIES, SampleTable};
use crate::grid::Grid;
use crate::simd::gather::GatherSlice;
use crate::simd::vectors::Vec3x16;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x16, i32x16};
use glam::{UVec3, Vec3};

/// A volume as a packet sees it.
pub(super) struct Medium<'a> {
    pub(super) values: GatherSlice<'a>,
    pub(super) dims: UVec3,
    pub(super) opacity: GatherSlice<'a>,
    pub(super) color: [GatherSlice<'a>; 3],
    pub(super) low: f32,
    pub(super) entries_per_scalar: f32,
    /// Values of the nearest point.
    pub(super) nearest: bool,
    /// Distances to the nearest block with an opacity, and blocks per axis; `None` where there is
    /// no empty block.
    pub(super) empty: Option<(GatherSlice<'a>, UVec3)>,
    pub(super) gradients: Option<Gradients<'a>>,
}

/// What is done with gradients, and how they are computed.
pub(super) struct Gradients<'a> {
    /// One over twice the spacing, in units in which gradients are near one.
    pub(super) scale: Vec3,
    /// Differences across the bounds are not doubled.
    pub(super) clamped: bool,
    pub(super) lights: Option<&'a PacketLights>,
    pub(super) factors: Option<GradientFactors<'a>>,
}

impl<'a> Medium<'a> {
    /// `None` for more points than an index of 32 bits counts.
    pub(super) fn new(grid: &'a Grid, table: &'a SampleTable, nearest: bool) -> Option<Self> {
        let [r, g, b] = &table.color;
        Some(Medium {
            values: GatherSlice::new(grid.values())?,
            dims: grid.dims(),
            opacity: GatherSlice::new(&table.opacity)?,
            color: [GatherSlice::new(r)?, GatherSlice::new(g)?, GatherSlice::new(b)?],
            low: table.low,
            entries_per_scalar: table.entries_per_scalar,
            nearest,
            empty: None,
            gradients: None,
        })
    }
}

/// The cells in which sixteen samples lie.
pub(super) struct Cells<S: Simd> {
    /// Index of the lowest point.
    pub(super) index: i32x16<S>,
    /// Lowest point, whole numbers.
    pub(super) low: [f32x16<S>; 3],
    /// Position inside, 0 to 1.
    pub(super) inside: [f32x16<S>; 3],
}

/// Linear interpolation.
#[inline(always)]
pub(super) fn mix<S: Simd>(a: f32x16<S>, b: f32x16<S>, at: f32x16<S>) -> f32x16<S> {
    a + (b - a) * at
}

impl Medium<'_> {
    /// The cells that contain these places, which are clamped to the grid. With nearest values a
    /// place is that of the nearest point, in a corner of its cell.
    #[inline(always)]
    pub(super) fn cells<S: Simd>(&self, simd: S, place: Vec3x16<S>) -> Cells<S> {
        let (x, fx) = self.along_axis(simd, place.x, self.dims.x);
        let (y, fy) = self.along_axis(simd, place.y, self.dims.y);
        let (z, fz) = self.along_axis(simd, place.z, self.dims.z);
        let index = self.index(simd, [x, y, z]);
        Cells { index, low: [x, y, z], inside: [fx, fy, fz] }
    }

    /// The lower of two neighbouring points, and the way to the other one.
    #[inline(always)]
    fn along_axis<S: Simd>(
        &self,
        simd: S,
        place: f32x16<S>,
        points: u32,
    ) -> (f32x16<S>, f32x16<S>) {
        let s = |x: f32| f32x16::splat(simd, x);
        let last = s((points - 1) as f32);
        let place = place.max(s(0.0)).min(last);
        let place = if self.nearest { (place + s(0.5)).floor().min(last) } else { place };
        let low = place.floor().min(s((points - 2) as f32));
        (low, place - low)
    }

    /// Indices of the points at these whole numbers.
    #[inline(always)]
    fn index<S: Simd>(&self, simd: S, [x, y, z]: [f32x16<S>; 3]) -> i32x16<S> {
        let whole = |v: f32x16<S>| v.to_int::<i32x16<S>>();
        let (nx, ny) = (self.dims.x as i32, self.dims.y as i32);
        let row = whole(z) * i32x16::splat(simd, ny) + whole(y);
        row * i32x16::splat(simd, nx) + whole(x)
    }

    #[inline(always)]
    pub(super) fn scalar<S: Simd>(&self, simd: S, cells: &Cells<S>) -> f32x16<S> {
        let [fx, fy, fz] = cells.inside;
        if self.nearest {
            // Not interpolated, which keeps the neighbours' NaN out.
            let [x, y, z] = cells.low;
            return self.point(simd, [x + fx, y + fy, z + fz]);
        }
        let row = i32x16::splat(simd, self.dims.x as i32);
        let slab = i32x16::splat(simd, (self.dims.x * self.dims.y) as i32);
        let (near, far) = (cells.index, cells.index + slab);
        let (a, b) = (self.along_x(simd, near, fx), self.along_x(simd, near + row, fx));
        let (c, d) = (self.along_x(simd, far, fx), self.along_x(simd, far + row, fx));
        mix(mix(a, b, fy), mix(c, d, fy), fz)
    }

    /// Values between the points of these indices and their neighbours along x.
    #[inline(always)]
    pub(super) fn along_x<S: Simd>(&self, simd: S, index: i32x16<S>, at: f32x16<S>) -> f32x16<S> {
        let [a, b] = self.values.pairs(simd, index);
        mix(a, b, at)
    }

    /// Values of the points at these whole numbers.
    #[inline(always)]
    pub(super) fn point<S: Simd>(&self, simd: S, [x, y, z]: [f32x16<S>; 3]) -> f32x16<S> {
        // The last point is the second of the last pair.
        let low = x.min(f32x16::splat(simd, (self.dims.x - 2) as f32));
        let [a, b] = self.values.pairs(simd, self.index(simd, [low, y, z]));
        x.simd_gt(low).select(b, a)
    }

    /// Entries of the table before these scalars, and the way to the next one. The first and the
    /// last entry count beyond the range.
    #[inline(always)]
    pub(super) fn entries<S: Simd>(&self, simd: S, scalar: f32x16<S>) -> (i32x16<S>, f32x16<S>) {
        let s = |x: f32| f32x16::splat(simd, x);
        let place = (scalar - s(self.low)) * s(self.entries_per_scalar) - s(0.5);
        let place = place.max(s(0.0)).min(s((ENTRIES - 1) as f32));
        let entry = place.floor().min(s((ENTRIES - 2) as f32));
        (entry.to_int(), place - entry)
    }
}
