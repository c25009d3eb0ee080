//! Direct volume rendering: emission and absorption along a ray through a uniform grid (Max 1995,
//! "Optical Models for Direct Volume Rendering", eq. 7), front to back.
//!
//! Along a ray the trilinear interpolant of a cell is a cubic. It is cut where it meets the knots
//! of the transfer function, and each part is integrated in closed form, eight at a time
//! (`cell_batch`, `linear_segment`), so thin shells are not skipped. Where knots are too dense for
//! that, and where extinction depends on the gradient, an interval is split until it and its two
//! parts differ by less than its share of the tolerance (`adaptive`).
//!
//! Empty space is skipped by blocks of cells ([`MACROCELL`]) whose range of values has no
//! extinction, then by cells.
//!
//! With [`VolumeOptions::sample_distance`] a ray takes samples instead, as VTK's GPU mapper does:
//! `samples` (where they lie), `sample_packet` (sixteen rays at a time), `sample_medium`,
//! `sample_table`, `sample_gradient`, `sample_light`, `empty_space`.
//!
//! Values may stay in a file ([`Volume::stored`]).

mod adaptive;
mod brick;
mod cell_batch;
mod empty_space;
mod lanes;
mod layer;
mod linear_parts;
mod linear_segment;
mod options;
mod projection;
mod ray_segments;
mod reference;
mod region;
mod sample_gradient;
mod sample_light;
mod sample_medium;
mod sample_packet;
mod sample_table;
mod samples;
mod shading;
mod shading_in_lanes;
mod stored;

pub use brick::{Brick, GridExtent, PartialIntegral};
pub use options::{
    Blend, GradientOpacity, Interpolation, VolumeError, VolumeHighlight, VolumeLight,
    VolumeOptions, VolumeShading,
};
pub use ray_segments::{RaySegments, composite_projections, integrate_overlapping};
pub use reference::integrate_reference;
pub use region::{ClipPlane, Cropping};

use crate::grid::Grid;
use crate::grid_walk::{Crossing, IndexRay};
use crate::math::Aabb;
use crate::ray::Ray;
use crate::ray_cubic;
use crate::shapes::outward_box;
use crate::simd::{SimdLevel, UnavailableLevel};
use crate::transfer_function::TransferFunction;
use cell_batch::CellBatch;
use fearless_simd::Level;
use glam::{DVec3, UVec3};
use layer::{Layer, MarchState};
use linear_segment::RayInLanes;
use rayon::prelude::*;
use region::in_box;
use samples::Samples;
use std::sync::Arc;
use stored::StoredBlocks;

/// Cells along an edge of the blocks used to skip empty space.
pub const MACROCELL: u32 = 8;

/// Accuracy of the integration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum VolumeQuality {
    /// Adaptive: estimated error of the colour and opacity of a ray, in levels of 1/255 (linear)
    /// for colours up to 1. Half of it is for the integration, half for ending the ray when almost
    /// no light passes.
    Tolerance {
        /// Levels, at least 10⁻⁶.
        levels: f32,
    },
    /// Classical: one sample in the middle of each step, opacity corrected for the step. It can
    /// miss thin shells; for comparison.
    Step {
        /// Step in units of the smallest grid spacing.
        voxels: f32,
    },
}

impl Default for VolumeQuality {
    /// Half a level: less than an 8-bit image can show.
    fn default() -> Self {
        VolumeQuality::Tolerance { levels: 0.5 }
    }
}

/// What a ray collected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeSample {
    /// Linear colour, premultiplied by its opacity, and opacity: composite it over what is behind
    /// `t1`.
    pub rgba: [f32; 4],
    /// Ray parameter at which the opacity reaches 50 %; infinite when it does not.
    pub depth: f32,
    /// Intervals of the ray whose transfer function was integrated (or samples taken, with fixed
    /// steps).
    pub samples: u32,
}

impl VolumeSample {
    /// Fully transparent.
    pub const CLEAR: VolumeSample =
        VolumeSample { rgba: [0.0; 4], depth: f32::INFINITY, samples: 0 };
}

/// Sizes of a volume, and the cells left out of it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct VolumeReport {
    /// Cells of the grid.
    pub cells: u64,
    /// Cells with a NaN or infinite corner: they are transparent.
    pub cells_non_finite: u64,
    /// Blocks of [`MACROCELL`]³ cells.
    pub macrocells: u64,
    /// Blocks without extinction, which are skipped entirely.
    pub macrocells_clear: u64,
}

/// A grid as a glowing, absorbing medium.
///
/// ```
/// use rt_core::glam::{DVec3, UVec3, Vec3};
/// use rt_core::{colormap::ColorMap, grid::Grid, ray::Ray, transfer_function::TransferFunction};
/// use rt_core::volume::{Volume, VolumeOptions, VolumeQuality};
/// let fog = Grid::new(UVec3::splat(2), DVec3::ZERO, DVec3::ONE, vec![0.5; 8]).unwrap();
/// let white = ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]);
/// // A slab one unit thick lets half of the light through, whatever the scalar.
/// let transfer = TransferFunction::from_opacity(white, &[[0.0, 0.5]], 1.0).unwrap();
/// let volume = Volume::new(fog.into(), transfer, VolumeOptions::default()).unwrap();
/// let ray = Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X);
/// let quality = VolumeQuality::Tolerance { levels: 0.5 };
/// let seen = volume.integrate(&ray, 0.0, f32::INFINITY, &quality);
/// assert!((seen.rgba[3] - 0.5).abs() < 1e-6);
/// ```
/// Object space is f32 relative to [`Volume::origin`]; lengths are world units.
#[derive(Debug, Clone)]
pub struct Volume {
    grid: Arc<Grid>,
    /// Shared with the parts of a stored volume.
    transfer: Arc<TransferFunction>,
    options: VolumeOptions,
    /// Points per axis of the whole volume; those of `grid` unless this is a part.
    dims: UVec3,
    /// The origin of the whole volume.
    origin: DVec3,
    /// Point of the whole volume where `grid` begins.
    first_point: UVec3,
    /// The blocks of `ranges` and `occupied`: all of them, unless this is a part.
    held: Brick,
    /// Smallest and largest finite value of each block, x fastest.
    ranges: Vec<[f32; 2]>,
    /// Whether a block has any extinction.
    occupied: Vec<bool>,
    /// Whether a block has extinction at all scalars of its range, so that none of its cells is
    /// clear.
    filled: Vec<bool>,
    /// Per axis of the whole volume.
    blocks: UVec3,
    report: VolumeReport,
    level: Level,
    /// `None` where rays are integrated.
    samples: Option<Samples>,
    /// The file that has the values; then no block is held here.
    stored: Option<Arc<StoredBlocks>>,
    /// Why the values of this part could not be read from a file.
    unread: Option<String>,
}

impl Volume {
    /// A volume of `grid` with the transfer function `transfer`.
    pub fn new(
        grid: Arc<Grid>,
        transfer: TransferFunction,
        options: VolumeOptions,
    ) -> Result<Self, VolumeError> {
        if grid.dims.min_element() < 2 {
            return Err(VolumeError::NoCells { dims: grid.dims });
        }
        options.check((grid.max_corner() - grid.origin).length())?;
        let nearest = options.interpolation == Interpolation::Nearest;
        let cells = if nearest { grid.dims } else { grid.dims - UVec3::ONE };
        let blocks = (cells + MACROCELL - UVec3::ONE) / MACROCELL;
        let scans: Vec<([f32; 2], u64)> = (0..blocks.as_usizevec3().element_product())
            .into_par_iter()
            .map(|n| {
                let (x, y) = (blocks.x as usize, blocks.y as usize);
                let lo =
                    UVec3::new((n % x) as u32, (n / x % y) as u32, (n / x / y) as u32) * MACROCELL;
                scan(&grid, lo, (lo + MACROCELL).min(cells), nearest)
            })
            .collect();
        let report = VolumeReport {
            cells: cells.as_u64vec3().element_product(),
            cells_non_finite: scans.iter().map(|s| s.1).sum(),
            macrocells: scans.len() as u64,
            macrocells_clear: 0,
        };
        let ranges = scans.into_iter().map(|s| s.0).collect();
        let (dims, origin) = (grid.dims, grid.origin);
        let mut v = Volume {
            grid,
            transfer: Arc::new(transfer),
            options,
            dims,
            origin,
            first_point: UVec3::ZERO,
            held: Brick { first: UVec3::ZERO, end: blocks },
            ranges,
            occupied: Vec::new(),
            filled: Vec::new(),
            blocks,
            report,
            level: Level::new(),
            samples: None,
            stored: None,
            unread: None,
        };
        v.find_occupied();
        Ok(v)
    }

    /// Sets another transfer function; only the list of empty blocks is recomputed.
    pub fn set_transfer_function(&mut self, transfer: TransferFunction) {
        self.transfer = Arc::new(transfer);
        self.find_occupied();
        self.forget_parts();
    }

    /// Parts of a stored volume have its properties: they are made again after a change.
    fn forget_parts(&mut self) {
        if let Some(stored) = &self.stored {
            let stored = stored.anew(&self.transfer);
            self.report = stored.report(self.blocks, self.cells());
            self.stored = Some(Arc::new(stored));
        }
    }

    /// Sets [`VolumeOptions::viewer`], which costs no look at the grid. A stored volume is read
    /// again.
    pub fn set_viewer(&mut self, viewer: Option<DVec3>) -> Result<(), VolumeError> {
        self.set_options(VolumeOptions { viewer, ..self.options.clone() })
    }

    /// Sets [`VolumeOptions::clip_planes`] and [`VolumeOptions::cropping`], which costs no look at
    /// the grid. A stored volume is read again.
    pub fn set_clipping(
        &mut self,
        clip_planes: Vec<ClipPlane>,
        cropping: Option<Cropping>,
    ) -> Result<(), VolumeError> {
        self.set_options(VolumeOptions { clip_planes, cropping, ..self.options.clone() })
    }

    /// Takes options that find the same blocks empty.
    fn set_options(&mut self, options: VolumeOptions) -> Result<(), VolumeError> {
        options.check(self.size().length())?;
        self.options = options;
        self.forget_parts();
        Ok(())
    }

    /// The same volume, integrated with no more than the instruction set `level`; `None` for the
    /// machine's best. Results have the same bits with all of them.
    pub fn with_simd_level(mut self, level: Option<SimdLevel>) -> Result<Self, UnavailableLevel> {
        self.level = SimdLevel::resolve(level)?;
        self.forget_parts();
        Ok(self)
    }

    fn find_occupied(&mut self) {
        let clear = |r: &[f32; 2]| r[0] > r[1] || self.transfer.is_clear(r[0].into(), r[1].into());
        self.occupied = self.ranges.iter().map(|r| !clear(r)).collect();
        let filled = |r: &[f32; 2]| self.transfer.is_nowhere_clear(r[0].into(), r[1].into());
        self.filled = self.ranges.iter().map(filled).collect();
        self.report.macrocells_clear = self.occupied.iter().filter(|o| !**o).count() as u64;
        self.samples = Samples::new(self);
    }

    /// World position of object space's origin: that of the grid; for a part, that of the whole
    /// grid.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The whole lattice, of which a part or a stored volume holds few points or none.
    pub fn extent(&self) -> GridExtent {
        GridExtent { dims: self.dims, origin: self.origin, spacing: self.grid.spacing }
    }

    /// Bounds of what is drawn of the whole volume, relative to [`Volume::origin`]. Clip planes and
    /// cropping do not make them smaller.
    pub fn bounds(&self) -> Aabb {
        let [low, high] = self.drawn_box();
        outward_box(low, high)
    }

    /// The box at which rays enter the volume.
    fn drawn_box(&self) -> [DVec3; 2] {
        let size = self.size();
        let corners = self.options.bounds.unwrap_or([DVec3::ZERO, size]);
        corners.map(|c| c.clamp(DVec3::ZERO, size))
    }

    /// From the first to the last point of the whole volume.
    fn size(&self) -> DVec3 {
        self.grid.spacing * (self.dims - UVec3::ONE).as_dvec3()
    }

    /// The grid; for a part, the points that it holds; for a stored volume, one.
    pub fn grid(&self) -> &Arc<Grid> {
        &self.grid
    }

    /// The transfer function.
    pub fn transfer_function(&self) -> &TransferFunction {
        &self.transfer
    }

    /// Interpolation, shading and blending.
    pub fn options(&self) -> &VolumeOptions {
        &self.options
    }

    /// Sizes, and cells left out.
    pub fn report(&self) -> VolumeReport {
        self.report
    }

    /// Colour and opacity between `t0` and `t1` of a ray in object space (and within the ray's own
    /// range). To place surfaces inside, integrate up to the surface, then from the surface on; the
    /// results composite to the whole within the tolerance.
    pub fn integrate(&self, ray: &Ray, t0: f32, t1: f32, quality: &VolumeQuality) -> VolumeSample {
        let (t0, t1) = (f64::from(t0.max(ray.t_min)), f64::from(t1.min(ray.t_max)));
        if !(ray.is_valid() && t0 < t1) {
            return VolumeSample::CLEAR;
        }
        if !self.is_medium() {
            return self.project(ray, t0, t1, quality);
        }
        if self.takes_samples() {
            return self.sample_ray(ray, t0 as f32, t1 as f32);
        }
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let nothing = PartialIntegral::default();
        match self.options.cropped(o, d, [t0, t1]).as_slice() {
            [] => VolumeSample::CLEAR,
            [[t0, t1]] => {
                PartialIntegral::from(self.march(ray, *t0, *t1, quality, &nothing)).sample()
            }
            // With the tolerance shared as among the holders of parts.
            _ => RaySegments::new(vec![(self, *ray)], t0 as f32, t1 as f32)
                .integrate_spans(0..usize::MAX, quality, nothing)
                .sample(),
        }
    }

    /// Whether cells are boxes around the points of the grid instead of between them.
    pub fn has_cells_around_points(&self) -> bool {
        self.is_nearest()
    }

    fn is_nearest(&self) -> bool {
        self.options.interpolation == Interpolation::Nearest
    }

    /// Cells per axis of the whole volume: between points, or boxes around them.
    fn cells(&self) -> UVec3 {
        if self.is_nearest() { self.dims } else { self.dims - UVec3::ONE }
    }

    /// The ray in cell indices, the number of cells, and the part of `t0..t1` inside the bounds and
    /// the clip planes.
    fn index_ray(&self, ray: &Ray, t0: f64, t1: f64) -> (IndexRay, UVec3, f64, f64) {
        let (o, d, spacing) = (ray.origin.as_dvec3(), ray.dir.as_dvec3(), self.grid.spacing);
        let [t0, t1] = self.options.clipped(o, d, t0, t1);
        if !self.is_nearest() {
            return (IndexRay::new(o, d, spacing), self.cells(), t0, t1);
        }
        // Cells are boxes around points: they extend half a spacing past the bounds, where they are
        // clipped.
        let [t0, t1] = in_box(o, d, [DVec3::ZERO, self.size()], t0, t1);
        (IndexRay::new(o + 0.5 * spacing, d, spacing), self.cells(), t0, t1)
    }

    /// [`Volume::integrate`] of a medium, in f64, behind what was collected `before`.
    fn march(
        &self,
        ray: &Ray,
        t0: f64,
        t1: f64,
        quality: &VolumeQuality,
        before: &PartialIntegral,
    ) -> MarchState {
        let per_t = ray.dir.as_dvec3().length();
        let (index_ray, cells, t0, t1) = self.index_ray(ray, t0, t1);
        let cells = cells.to_array().map(i64::from);
        if t0 >= t1 {
            return before.march(*quality, 0.0);
        }
        // The error budget is distributed by length of path through the grid.
        let mut inside = (0.0, 0.0);
        let whole = cells.iter().max().copied().unwrap_or(1);
        index_ray.walk([0; 3], cells, cells, whole, t0, t1, |c| {
            inside = if inside.1 > inside.0 { (inside.0, c.t1) } else { (c.t0, c.t1) };
            true
        });
        let mut m = before.march(*quality, (inside.1 - inside.0) * per_t);
        if inside.1 <= inside.0 {
            return m;
        }
        let ray = self.ray_in_lanes(&index_ray, per_t);
        if let Some(stored) = &self.stored {
            self.march_bricks(stored, &ray, inside.0, [t0, t1], &mut m);
            return m;
        }
        let mut batch = CellBatch::new();
        index_ray.walk([0; 3], cells, cells, i64::from(MACROCELL), t0, t1, |passed| {
            let block = UVec3::from_array(passed.cell.map(|c| c as u32 / MACROCELL));
            let span = [passed.t0, passed.t1];
            self.enter_block(&ray, inside.0, block, span, &mut batch, &mut m);
            !m.is_opaque()
        });
        self.finish_batch(&ray, &mut batch, &mut m);
        m
    }

    /// A ray with what is the same all along it.
    fn ray_in_lanes<'a>(&self, index_ray: &'a IndexRay, per_t: f64) -> RayInLanes<'a> {
        RayInLanes { index_ray, per_t, lights: self.lights_on(index_ray) }
    }

    /// Continues from `ta` to `tb`, within one block. The ray enters the grid at `anchor`.
    fn march_block(
        &self,
        ray: &RayInLanes<'_>,
        anchor: f64,
        block: UVec3,
        span: [f64; 2],
        m: &mut MarchState,
    ) {
        if let Some(stored) = &self.stored {
            self.march_block_in(stored, ray, anchor, block, span, m);
            return;
        }
        let mut batch = CellBatch::new();
        self.enter_block(ray, anchor, block, span, &mut batch, m);
        self.finish_batch(ray, &mut batch, m);
    }

    /// [`Volume::march_block`], which may leave the last cells in `batch`.
    fn enter_block(
        &self,
        ray: &RayInLanes<'_>,
        anchor: f64,
        block: UVec3,
        [ta, tb]: [f64; 2],
        batch: &mut CellBatch,
        m: &mut MarchState,
    ) {
        if !(self.is_occupied(block) && tb > ta) {
            return;
        }
        let index = self.block_index(block);
        let cells = self.cells().to_array().map(i64::from);
        let size = i64::from(MACROCELL);
        let first = block.to_array().map(|b| i64::from(b) * size);
        let end = std::array::from_fn(|a| (first[a] + size).min(cells[a]));
        if self.marches_in_lanes(m.quality) {
            let pieces = self.transfer.pieces(m.allows_simplified());
            let pieces = (!self.filled[index]).then_some(pieces);
            ray.index_ray.walk(first, end, cells, 1, ta, tb, |cell| {
                self.collect_cell(ray, pieces, cell, batch, m);
                !m.is_opaque()
            });
        } else {
            ray.index_ray.walk(first, end, cells, 1, ta, tb, |cell| {
                self.march_cell(ray.index_ray, ray.per_t, anchor, cell, m);
                !m.is_opaque()
            });
        }
    }

    /// Whether cells are integrated in closed form. Fixed steps and nearest values are not
    /// integrated, and extinction that depends on the gradient is not linear in the scalar.
    fn marches_in_lanes(&self, quality: VolumeQuality) -> bool {
        matches!(quality, VolumeQuality::Tolerance { .. })
            && !self.is_nearest()
            && self.options.gradient_opacity.is_none()
    }

    #[inline]
    fn march_cell(
        &self,
        ray: &IndexRay,
        per_t: f64,
        anchor: f64,
        c: &Crossing,
        m: &mut MarchState,
    ) {
        if c.t1 <= c.t0 {
            return;
        }
        let cell = UVec3::from_array(c.cell.map(|i| i as u32));
        let stored = cell - self.first_point;
        if self.is_nearest() {
            let value = self.grid.at(stored.x, stored.y, stored.z);
            if value.is_finite() {
                let (mut sigma, mut color) = self.transfer.sample(value.into());
                if let Some(light) =
                    self.light_along(ray, stored, [c.t0, c.t1], &[0.0; 3], &[0.0; 3])
                {
                    (sigma, color) = light.on(c.t0, sigma, color);
                }
                m.samples += 1;
                m.add(c.t0, c.t1, &Layer { tau: sigma * (c.t1 - c.t0) * per_t, color });
            }
            return;
        }
        let corners = self.grid.corners(stored);
        if !corners.iter().all(|v| v.is_finite()) {
            return;
        }
        let (p, q) = ray.fractions(c, 1);
        let b = ray_cubic::along(&corners.map(f64::from), &p, &q);
        if self.is_clear(&b) {
            return;
        }
        let light = self.light_along(ray, stored, [c.t0, c.t1], &p, &q);
        match m.quality {
            VolumeQuality::Tolerance { .. } => {
                self.march_adaptive(light.as_ref(), per_t, [c.t0, c.t1], &b, m);
            }
            VolumeQuality::Step { voxels } => {
                // Samples lie at multiples of the step from where the ray enters the grid, clipped
                // at cell faces.
                let step = f64::from(voxels).max(1e-3) * self.grid.spacing.min_element() / per_t;
                let mut t = c.t0;
                let mut k = ((t - anchor) / step).floor();
                while t < c.t1 && !m.is_opaque() {
                    k += 1.0;
                    let end = (anchor + k * step).min(c.t1);
                    if end > t {
                        let mid = 0.5 * (t + end);
                        let (mut sigma, mut color) = self
                            .transfer
                            .sample(ray_cubic::evaluate(&b, (mid - c.t0) / (c.t1 - c.t0)));
                        if let Some(light) = &light {
                            (sigma, color) = light.on(mid, sigma, color);
                        }
                        m.samples += 1;
                        m.add(t, end, &Layer { tau: sigma * (end - t) * per_t, color });
                        t = end;
                    }
                }
            }
        }
    }

    /// Whether no scalar in the cubic's range has any extinction.
    #[inline]
    fn is_clear(&self, b: &[f64; 4]) -> bool {
        let (lo, hi) = ray_cubic::hull(b);
        self.transfer.is_clear(lo, hi)
    }
}

/// Range of the finite values of a block's cells, and how many cells have a value that is not
/// finite. `nearest`: a cell is around a point.
fn scan(grid: &Grid, lo: UVec3, hi: UVec3, nearest: bool) -> ([f32; 2], u64) {
    let (mut range, mut bad) = ([f32::INFINITY, f32::NEG_INFINITY], 0);
    for k in lo.z..hi.z {
        for j in lo.y..hi.y {
            for i in lo.x..hi.x {
                let v =
                    if nearest { [grid.at(i, j, k); 8] } else { grid.corners(UVec3::new(i, j, k)) };
                if v.iter().all(|x| x.is_finite()) {
                    for x in v {
                        range = [range[0].min(x), range[1].max(x)];
                    }
                } else {
                    bad += 1;
                }
            }
        }
    }
    (range, bad)
}
