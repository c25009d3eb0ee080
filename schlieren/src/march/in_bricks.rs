//! A march that processes share, each with a brick of the lattice: a ray stops where its next
//! sample needs nodes of another brick, and goes on there from a state of 64 bytes.
//!
//! The march is that of [`super::Deviational`] in `f64`: a sample at the entry, position Verlet in
//! steps of one length, and one step back into the exit plane. Every step takes one sample, at a
//! place that follows from the state alone. So the cell of that sample says who takes the step,
//! and the exit has the same bits however the lattice is cut, if the nodes have.
//!
//! Four rays go in the lanes of vectors. What one lane computes does not depend on the others, and
//! no level fuses multiplications with additions: a ray's exit has the same bits whatever its
//! neighbours, and at every SIMD level.
//!
//! The interpolants are those whose samples need the nodes around a cell and no others
//! ([`Stencil`]). The prefilter of the cubic spline needs whole rows of the lattice, which no
//! process has.

mod four_rays;
mod four_samples;
mod undisturbed;

pub use undisturbed::Undisturbed;

use super::frame::{Frame, UndisturbedRay};
use super::kernel_ray::steps_of;
use crate::at_level;
use crate::interpolate::{Interpolant, cell};
use crate::path::{Exit, Start, Status};
use crate::view::View;
use fearless_simd::Level;
use glam::DVec3;

/// A lattice that is cut into bricks: its nodes, without their values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Nodes along x, y and z.
    pub dims: [usize; 3],
    /// Distance of neighbouring nodes.
    pub spacing_m: [f64; 3],
    /// Position of the first node.
    pub origin_m: DVec3,
    /// Index of refraction of the reference medium outside.
    pub n0: f64,
}

/// Why a march through bricks cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InBricksError {
    /// Too few or too many nodes along an axis.
    #[error("the lattice has {nodes} node(s) along {axis}: give 2 to 2147483647")]
    Dims {
        /// x, y or z.
        axis: char,
        /// Number of nodes given.
        nodes: usize,
    },
    /// A spacing that is not a length.
    #[error("spacing_m along {axis} is {spacing_m}: give a length above 0, in metres")]
    Spacing {
        /// x, y or z.
        axis: char,
        /// Spacing given.
        spacing_m: f64,
    },
    /// An origin or an index that is not a number.
    #[error("origin_m {origin_m} or n0 {n0} is no finite number, or n0 is not above 0")]
    NotFinite {
        /// Origin given.
        origin_m: DVec3,
        /// Index given.
        n0: f64,
    },
    /// A step that no ray can take.
    #[error("step_voxels is {0}: give 0.01 to 8")]
    Step(f64),
    /// The spline.
    #[error(
        "the cubic spline cannot be cut into bricks, because its prefilter needs whole rows of \
         the lattice: use trilinear gradients, or trilinear interpolation"
    )]
    Spline,
}

/// The nodes that a sample needs besides the eight of its cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stencil {
    /// None: trilinear interpolation and its exact gradient.
    Cell,
    /// One more layer on each side, where the lattice has one: trilinear interpolation of central
    /// differences.
    CellAndNeighbours,
}

impl Stencil {
    /// Layers of nodes around a cell.
    pub fn layers(self) -> usize {
        match self {
            Stencil::Cell => 0,
            Stencil::CellAndNeighbours => 1,
        }
    }
}

/// The values that one process has.
pub trait Brick: Sync {
    /// The first cell in which it has all nodes that samples need, and the cell behind the last.
    /// Cell i lies between the nodes i and i + 1.
    fn cells(&self) -> [[usize; 3]; 2];

    /// The value of eps at a node of the whole lattice, one that a sample in these cells needs.
    /// Not finite where there is no gas.
    fn eps(&self, node: [usize; 3]) -> f64;

    /// Whether every sample in a cell gives exactly 0, as far as the brick knows
    /// ([`InBricks::undisturbed`]): these are not taken then.
    #[inline(always)]
    fn is_undisturbed(&self, cell: [usize; 3]) -> bool {
        let _ = cell;
        false
    }

    /// The values at `N` nodes that follow each other along x, from `first`. Samples read whole
    /// rows; a brick whose values lie one behind the other along x reads them at once.
    #[inline(always)]
    fn row<const N: usize>(&self, first: [usize; 3]) -> [f64; N] {
        let [x, y, z] = first;
        let mut row = [0.0; N];
        for (n, value) in row.iter_mut().enumerate() {
            *value = self.eps([x + n, y, z]);
        }
        row
    }
}

/// A ray on its way: deviations from its undisturbed ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RayState {
    /// Samples taken so far.
    pub samples: u32,
    /// The value of eps at the entry.
    pub eps_at_entry: f64,
    /// Deviation of the position.
    pub xi_m: DVec3,
    /// Deviation of the rate dx/dtau.
    pub u: DVec3,
    /// Optical path difference, divided by n0.
    pub path_m: f64,
}

/// How far a brick brought a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// The next sample lies in this cell, which the brick does not have.
    NeedsCell([usize; 3]),
    /// The ray has left the lattice.
    Left(Exit),
}

/// The march, without any values.
#[derive(Debug, Clone)]
pub struct InBricks {
    frame: Frame,
    dims: [usize; 3],
    origin_m: DVec3,
    n0: f64,
    stencil: Stencil,
    step_voxels: f64,
    level: Level,
}

impl InBricks {
    /// A march with steps of at most `step_voxels` through a lattice seen from `view`.
    ///
    /// # Errors
    /// For a lattice, a step or an interpolant that cannot be.
    pub fn new(
        lattice: &Lattice,
        view: View,
        interpolant: Interpolant,
        step_voxels: f64,
    ) -> Result<InBricks, InBricksError> {
        for (c, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
            let (nodes, spacing_m) = (lattice.dims[c], lattice.spacing_m[c]);
            if !(2..=i32::MAX as usize).contains(&nodes) {
                return Err(InBricksError::Dims { axis, nodes });
            }
            if !(1e-12..=1e12).contains(&spacing_m) {
                return Err(InBricksError::Spacing { axis, spacing_m });
            }
        }
        let (origin_m, n0) = (lattice.origin_m, lattice.n0);
        if !origin_m.is_finite() || !n0.is_finite() || n0 <= 0.0 {
            return Err(InBricksError::NotFinite { origin_m, n0 });
        }
        if !(0.01..=8.0).contains(&step_voxels) {
            return Err(InBricksError::Step(step_voxels));
        }
        let stencil = match interpolant {
            Interpolant::BSpline => return Err(InBricksError::Spline),
            Interpolant::Trilinear => Stencil::Cell,
            Interpolant::TrilinearGradient => Stencil::CellAndNeighbours,
        };
        let frame = Frame::of_lattice(lattice.dims, lattice.spacing_m, origin_m, view);
        let (dims, level) = (lattice.dims, Level::new());
        Ok(InBricks { frame, dims, origin_m, n0, stencil, step_voxels, level })
    }

    /// The same march with the instructions of a SIMD level; exits have the same bits.
    pub fn at_simd_level(self, level: Level) -> InBricks {
        InBricks { level, ..self }
    }

    /// The nodes that samples need.
    pub fn stencil(&self) -> Stencil {
        self.stencil
    }

    /// The view in whose frame starts and exits are given.
    pub fn view(&self) -> &View {
        &self.frame.view
    }

    /// The position of a point in lattice coordinates.
    pub fn position_m(&self, at: DVec3) -> DVec3 {
        self.origin_m + at * self.frame.spacing_m
    }

    /// Cells of the whole lattice along each axis.
    pub fn cells(&self) -> [usize; 3] {
        self.dims.map(|nodes| nodes - 1)
    }

    /// The cells in which a box of nodes, from `first` to before `end`, has all that samples need:
    /// the first cell, and the cell behind the last.
    pub fn cells_of_nodes(&self, first: [usize; 3], end: [usize; 3]) -> [[usize; 3]; 2] {
        let (layers, whole) = (self.stencil.layers(), self.cells());
        let low = |c: usize| if first[c] == 0 { 0 } else { first[c].saturating_add(layers) };
        let high = |c: usize| {
            let missing = if end[c] >= self.dims[c] { 1 } else { 1 + layers };
            end[c].min(self.dims[c]).saturating_sub(missing).min(whole[c])
        };
        [[0, 1, 2].map(low), [0, 1, 2].map(high)]
    }

    /// The cell in which the ray takes its first sample; `None` for a ray beside the lattice.
    pub fn entry_cell(&self, start: &Start) -> Option<[usize; 3]> {
        let ray = self.frame.undisturbed(start, &mut None);
        (self.samples(&ray) > 0).then(|| self.cell_at(ray.at + ray.direction * ray.range_m[0]))
    }

    /// Distance along the undisturbed ray, from the centre plane, to where it leaves the lattice.
    pub fn exit_depth_m(&self, start: &Start) -> f64 {
        self.frame.undisturbed(start, &mut None).range_m[1]
    }

    /// The most samples that any ray takes.
    pub fn most_samples(&self) -> u32 {
        let diagonal = DVec3::from(self.cells().map(|n| n as f64)).length();
        steps_of(diagonal / self.step_voxels).saturating_add(4)
    }

    /// Whether a state can be that of a ray from `start`.
    pub fn is_possible(&self, start: &Start, state: &RayState) -> bool {
        state.samples < self.samples(&self.frame.undisturbed(start, &mut None))
    }

    /// Samples that a ray takes: at its entry, in each step, and in the step into the exit plane;
    /// none beside the lattice.
    fn samples(&self, ray: &UndisturbedRay) -> u32 {
        let length_m = ray.range_m[1] - ray.range_m[0];
        if length_m <= 0.0 {
            return 0;
        }
        let voxels = (ray.direction * length_m).length();
        steps_of(voxels / self.step_voxels).max(1).saturating_add(2)
    }

    #[inline(always)]
    fn cell_at(&self, at: DVec3) -> [usize; 3] {
        let [x, y, z] = self.dims;
        [cell(at.x, x).0, cell(at.y, y).0, cell(at.z, z).0]
    }

    /// Finds the cells of `brick` in which light is not bent at all, for its
    /// [`Brick::is_undisturbed`]: reads all of its nodes once or more, on rayon's threads if
    /// `parallel`.
    ///
    /// ```
    /// use glam::DVec3;
    /// use schlieren::interpolate::Interpolant;
    /// use schlieren::march::{Brick, InBricks, Lattice, Undisturbed};
    /// use schlieren::view::{Axis, View};
    ///
    /// /// Air with a warm layer at x >= 40, and what is known of it.
    /// struct Air(Option<Undisturbed>);
    /// impl Brick for Air {
    ///     fn cells(&self) -> [[usize; 3]; 2] {
    ///         [[0; 3], [63; 3]]
    ///     }
    ///     fn eps(&self, [x, ..]: [usize; 3]) -> f64 {
    ///         if x >= 40 { -1e-5 } else { 0.0 }
    ///     }
    ///     fn is_undisturbed(&self, cell: [usize; 3]) -> bool {
    ///         self.0.as_ref().is_some_and(|cells| cells.contains(cell))
    ///     }
    /// }
    ///
    /// let lattice = Lattice {
    ///     dims: [64; 3],
    ///     spacing_m: [1e-3; 3],
    ///     origin_m: DVec3::ZERO,
    ///     n0: 1.000_27,
    /// };
    /// let view = View::along(Axis::X, DVec3::splat(0.0315));
    /// let march = InBricks::new(&lattice, view, Interpolant::TrilinearGradient, 1.0)?;
    /// let mut air = Air(None);
    /// air.0 = Some(march.undisturbed(&air, false));
    /// assert!(air.is_undisturbed([10, 30, 30]) && !air.is_undisturbed([40, 30, 30]));
    /// # Ok::<(), schlieren::march::InBricksError>(())
    /// ```
    pub fn undisturbed(&self, brick: &impl Brick, parallel: bool) -> Undisturbed {
        Undisturbed::of(brick, self.dims, self.stencil.layers(), parallel)
    }

    /// Moves a ray as far as `brick` has the nodes.
    pub fn advance(&self, start: &Start, state: &mut RayState, brick: &impl Brick) -> Progress {
        let mut ray = [(*start, *state)];
        let mut progress = Progress::NeedsCell([0; 3]);
        self.advance_all(&mut ray, brick, |_, how_far| progress = how_far);
        *state = ray[0].1;
        progress
    }

    /// Moves rays as far as `brick` has the nodes, and tells of each, by its number, how far that
    /// was. Faster than [`InBricks::advance`] for each of them; with the same bits.
    pub fn advance_all(
        &self,
        rays: &mut [(Start, RayState)],
        brick: &impl Brick,
        told: impl FnMut(usize, Progress),
    ) {
        at_level!(self.level, simd => four_rays::advance_all(simd, self, rays, brick, told));
    }

    fn exit(&self, ray: &UndisturbedRay, state: &RayState, status: Status) -> Exit {
        let [right, up, _] = ray.beam;
        let across = |v: DVec3| [v.dot(right) as f32, v.dot(up) as f32];
        Exit {
            deflection_rad: across(state.u),
            displacement_m: across(state.xi_m),
            exit_depth_m: ray.range_m[1] as f32,
            opd_m: (state.path_m * self.n0) as f32,
            transmission: if status == Status::Masked { 0.0 } else { 1.0 },
            status,
        }
    }
}

#[cfg(test)]
mod tests;
