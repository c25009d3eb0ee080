//! Integrates absorption, emission and rotation along rays: [`MediaIntegrator`].

use super::{Media, MediaIntegrals, Property, Volume};
use crate::field::{Field, Node};
use crate::interpolate::{BSpline, Trilinear};
use crate::march::{BlankCells, Frame};
use crate::plan::Mode;
use crate::view::View;
use fearless_simd::Level;

/// How the integrator's rays bend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Bend {
    /// Straight rays, as in line of sight.
    Straight,
    /// Rays in gases: bent by the trilinear gradient of eps, in `f32`, sixteen at a time.
    Paraxial,
    /// Rays in lenses and liquids: bent by the gradient of the spline, in `f64` with PEFRL.
    Full,
}

impl From<Mode> for Bend {
    fn from(mode: Mode) -> Bend {
        match mode {
            Mode::LineOfSight => Bend::Straight,
            Mode::Paraxial => Bend::Paraxial,
            Mode::Full => Bend::Full,
        }
    }
}

pub(super) enum BendField<'a> {
    Straight,
    Paraxial(Trilinear<'a>),
    Full(BSpline),
}

/// Computes [`MediaIntegrals`] along the rays of a view.
pub struct MediaIntegrator<'a> {
    pub(super) field: &'a Field,
    pub(super) frame: Frame,
    pub(super) wanted: [Option<&'a Volume>; 3],
    pub(super) blank: BlankCells,
    pub(super) step_voxels: f64,
    pub(super) bend_field: BendField<'a>,
    pub(super) level: Level,
}

impl<'a> MediaIntegrator<'a> {
    /// Integrates through `field` those properties of `media` that are `wanted`. `step_voxels` is
    /// the march's step; it is shortened where a property's lattice is finer than the field's.
    pub fn new(
        field: &'a Field,
        view: View,
        media: &'a Media,
        wanted: &[Property],
        bend: Bend,
        step_voxels: f64,
        blank: BlankCells,
    ) -> MediaIntegrator<'a> {
        let frame = Frame::new(field, view);
        let wanted = Property::ALL.map(|p| media.get(p).filter(|_| wanted.contains(&p)));
        let finest = wanted.iter().flatten().map(|v| (v.spacing_m / frame.spacing_m).min_element());
        let step_voxels = step_voxels * finest.fold(1.0, f64::min);
        let bend_field = match bend {
            Bend::Straight => BendField::Straight,
            Bend::Paraxial => BendField::Paraxial(Trilinear::new(field)),
            Bend::Full => BendField::Full(BSpline::new(field)),
        };
        let step_voxels = if bend == Bend::Full { step_voxels } else { step_voxels.min(1.0) };
        MediaIntegrator {
            field,
            frame,
            wanted,
            blank,
            step_voxels,
            bend_field,
            level: Level::new(),
        }
    }

    /// The view in whose frame starts are given.
    pub fn view(&self) -> &View {
        &self.frame.view
    }

    /// The properties that are integrated, in the order of [`Property::ALL`].
    pub fn properties(&self) -> [Option<&'a Volume>; 3] {
        self.wanted
    }

    /// How rays bend.
    pub fn bend(&self) -> Bend {
        match self.bend_field {
            BendField::Straight => Bend::Straight,
            BendField::Paraxial(_) => Bend::Paraxial,
            BendField::Full(_) => Bend::Full,
        }
    }

    /// Longest step, in lattice steps of the field.
    pub fn step_voxels(&self) -> f64 {
        self.step_voxels
    }

    /// Whether a node of this kind ends a ray.
    pub(super) fn stops(&self, kind: u8) -> bool {
        kind == Node::Solid as u8 || (kind != Node::Gas as u8 && self.blank == BlankCells::Opaque)
    }
}

/// Sums along one ray, in `f64` because hundreds of small terms are added.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    optical_depth: f64,
    emission: f64,
    rotation_rad: f64,
}

impl Sums {
    /// Adds a path segment of `length_m` with constant values of the properties, in the order of
    /// [`Property::ALL`].
    #[inline(always)]
    pub(super) fn add(&mut self, values: [f32; 3], length_m: f64) {
        let [absorption, emission, rotation] = values.map(f64::from);
        let depth = absorption * length_m;
        if emission != 0.0 {
            // With a the segment's optical depth, (1 - exp(-a))/a of the light that it emits leaves
            // it, and exp(-τ) of that reaches the eye.
            let leaves = if depth == 0.0 { 1.0 } else { -(-depth).exp_m1() / depth };
            self.emission += emission * length_m * leaves * (-self.optical_depth).exp();
        }
        self.optical_depth += depth;
        self.rotation_rad += rotation * length_m;
    }

    pub(super) fn rounded(self) -> MediaIntegrals {
        MediaIntegrals {
            optical_depth: self.optical_depth as f32,
            emission: self.emission as f32,
            rotation_rad: self.rotation_rad as f32,
        }
    }
}
