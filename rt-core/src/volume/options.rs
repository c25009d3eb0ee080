//! Appearance of a volume: shading, blending, and the checks of both.

use super::region::{ClipPlane, Cropping};
use crate::grid::GridError;
use glam::{DVec3, UVec3, Vec3};
use std::sync::Arc;

/// Why a volume cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// A grid without cells.
    #[error(
        "volume: the grid has {dims} points; it needs at least 2 along each axis to have cells"
    )]
    NoCells {
        /// Points per axis.
        dims: UVec3,
    },
    /// The values of a brick do not fill it, or the grid that it is cut from is no grid.
    #[error("volume brick: {0}")]
    Brick(#[from] GridError),
    /// An invalid parameter of the shading, the lights or the gradient opacity.
    #[error("volume shading: {field} is {value}; it must be {rule}")]
    Shading {
        /// The parameter.
        field: &'static str,
        /// Its value.
        value: f32,
        /// What is allowed.
        rule: &'static str,
    },
    /// An invalid distance of samples.
    #[error(
        "volume: the distance of samples is {distance}; it must be finite and at least {least}, \
         for fewer than four million of them across the grid"
    )]
    SampleDistance {
        /// The distance given, in world units.
        distance: f64,
        /// The smallest one for this grid.
        least: f64,
    },
    /// Samples of a stored volume.
    #[error(
        "volume: samples a distance apart are taken of volumes in memory alone, and this one \
         stays in its file; leave the distance out, and rays are integrated to the tolerance"
    )]
    StoredSamples,
    /// An invalid part of the volume to draw.
    #[error("volume: {field} must be {rule}")]
    Region {
        /// The option.
        field: &'static str,
        /// What is allowed.
        rule: &'static str,
    },
}

/// Samples along the diagonal of a grid: their numbers are whole in f32 up to four times as many.
const MOST_SAMPLES: f64 = (1 << 22) as f64;

/// How a highlight falls off around the mirrored light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum VolumeHighlight {
    /// By the angle between the normal and the direction halfway between light and viewer (Blinn
    /// 1977).
    #[default]
    Halfway,
    /// By the angle between the viewer and the mirrored light (Phong 1975).
    Mirrored,
}

/// Lambert shading by the gradient, two-sided, with a light at the viewer or in a fixed direction.
/// It multiplies the colour by `ambient + diffuse·|n·l|` where the gradient is steep, and by 1
/// where there is none, and adds a highlight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeShading {
    /// Part of the colour that needs no light, 0..=1.
    pub ambient: f32,
    /// Part that is lit, 0..=1.
    pub diffuse: f32,
    /// Direction towards the light, any length, in the volume's axes; `None` for a light at the
    /// viewer.
    pub light: Option<Vec3>,
    /// White highlight of that light; 0 for none.
    pub specular: f32,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// Its form.
    pub highlight: VolumeHighlight,
    /// Gradient, in value per world unit, at which the shading has half its effect. With 0 it has
    /// its full effect everywhere, and only `ambient` where there is no gradient (VTK).
    pub half_gradient: f32,
}

impl Default for VolumeShading {
    /// A light at the viewer that changes nothing.
    fn default() -> Self {
        VolumeShading {
            ambient: 1.0,
            diffuse: 0.0,
            light: None,
            specular: 0.0,
            shininess: 1.0,
            highlight: VolumeHighlight::Halfway,
            half_gradient: 0.0,
        }
    }
}

/// A parallel light on a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeLight {
    /// Towards the light, any length, in the volume's axes; `None` for a light at the viewer.
    pub direction: Option<Vec3>,
    /// Linear colour times intensity.
    pub color: [f32; 3],
}

/// Extinction that also depends on the gradient (Levoy 1988, "Display of Surfaces from Volume
/// Data"): the transfer function's extinction times this factor.
#[derive(Debug, Clone, PartialEq)]
pub struct GradientOpacity {
    /// Factors for gradients from zero to `steepest`, evenly spaced, linear between; the last also
    /// applies to steeper gradients.
    pub factors: Arc<[f32]>,
    /// Gradient of the last factor, in value per world unit.
    pub steepest: f32,
}

impl GradientOpacity {
    /// The factor at a gradient of this length; 1 without factors, which no volume takes.
    #[inline]
    pub fn at(&self, steepness: f64) -> f64 {
        let Some(last) = self.factors.len().checked_sub(1) else { return 1.0 };
        let x = (steepness / f64::from(self.steepest)).clamp(0.0, 1.0) * last as f64;
        // `clamp` keeps NaN, which `as` maps to the first entry.
        let i = (x as usize).min(last.saturating_sub(1));
        let [a, b] = [i, (i + 1).min(last)].map(|i| f64::from(self.factors[i]));
        a + (b - a) * (x - i as f64)
    }
}

/// How the scalars along a ray are combined. All modes but [`Blend::Composite`] interpret the
/// transfer function's extinction as an opacity (of at most 1), or a weight: they do not depend on
/// thickness.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub enum Blend {
    /// Emission and absorption.
    #[default]
    Composite,
    /// Colour and opacity of the largest scalar along the ray (maximum intensity projection).
    Maximum,
    /// Colour and opacity of the smallest one.
    Minimum,
    /// The mean along the ray of colour times weight; opaque.
    Average,
    /// The integral along the ray of colour times weight per world unit, at most 1; opaque.
    Additive,
    /// The surfaces on which the scalar has one of these values, each with the value's colour and
    /// opacity.
    Isosurfaces(Arc<[f32]>),
}

/// Interpolation between the points of the grid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Interpolation {
    /// Trilinear.
    #[default]
    Linear,
    /// The value of the nearest point: boxes of one value around each point, clipped at the grid's
    /// bounds.
    Nearest,
}

/// Options of a [`super::Volume`].
#[derive(Debug, Clone, Default)]
pub struct VolumeOptions {
    /// Shading by the gradient; `None` for pure emission and absorption. Not for the projections
    /// (maximum, minimum, average, additive).
    pub shading: Option<VolumeShading>,
    /// The scalar between points.
    pub interpolation: Interpolation,
    /// How the scalars along a ray are combined.
    pub blend: Blend,
    /// Lights that replace the shading's own light and cast no highlight; empty for that light, in
    /// white.
    pub lights: Vec<VolumeLight>,
    /// With [`Blend::Composite`] only.
    pub gradient_opacity: Option<GradientOpacity>,
    /// Extends the scalar past the bounds by its value there, so that gradients across them are
    /// half of those inside, as with OpenGL's clamped textures. Otherwise they are one-sided.
    pub clamped_gradients: bool,
    /// Distance of samples along a ray, world units: the result of [`Blend::Composite`] is that of
    /// VTK's GPU mapper. The first sample lies this far behind the point where the ray enters the
    /// grid. Each stands for a slab of this thickness, by a table of 1,024 entries over the range
    /// of the transfer function. Lit colours and the gradient opacity's product are at most 1, and
    /// a ray ends when less than 1/255 of the light passes, so what is left out is less than one
    /// level. Thin shells between two samples are missed. `None` integrates to the tolerance that
    /// the caller asks for ([`super::VolumeQuality`]).
    ///
    /// Media that share space ([`super::integrate_overlapping`]), bricks
    /// ([`super::Volume::part`], [`super::RaySegments`]) and grids of 2³¹ points or more are
    /// integrated in any case.
    pub sample_distance: Option<f64>,
    /// Where the viewer is, world units from the grid's origin in the volume's axes: lights at the
    /// viewer and highlights go by the line from there to the point where a ray enters the grid.
    /// VTK's GPU mapper does so in parallel projections too, where that is not the ray. `None` goes
    /// by the ray.
    pub viewer: Option<DVec3>,
    /// Lower and upper corner of the box that is drawn, world units from the grid's origin in the
    /// volume's axes; `None` for the whole grid. Rays enter the volume at this box.
    pub bounds: Option<[DVec3; 2]>,
    /// What is drawn lies in all of these half-spaces. Rays enter the volume at the planes.
    pub clip_planes: Vec<ClipPlane>,
    /// Samples are left out, or the integral skips, where this does not draw. Rays enter the volume
    /// where they would without it. Regions other than one box need [`Blend::Composite`].
    pub cropping: Option<Cropping>,
}

impl VolumeOptions {
    /// Returns the first error. The options are for a grid with this diagonal, world units.
    pub(super) fn check(&self, diagonal: f64) -> Result<(), VolumeError> {
        if let Some(distance) = self.sample_distance {
            let least = diagonal / MOST_SAMPLES;
            if !(distance >= least && distance.is_finite()) {
                return Err(VolumeError::SampleDistance { distance, least });
            }
        }
        self.check_region()?;
        let fault = |field, value, rule| Err(VolumeError::Shading { field, value, rule });
        if let Some(viewer) = self.viewer.filter(|v| !v.is_finite()) {
            return fault("viewer", viewer.element_sum() as f32, "a finite position");
        }
        const DIRECTION: &str = "a direction: finite and not zero";
        if let Some(s) = &self.shading {
            let fields = [("ambient", s.ambient), ("diffuse", s.diffuse)];
            if let Some(&(field, value)) = fields.iter().find(|f| !(0.0..=1.0).contains(&f.1)) {
                return fault(field, value, "0 to 1");
            }
            let fields = [
                ("half_gradient", s.half_gradient),
                ("specular", s.specular),
                ("shininess", s.shininess),
            ];
            if let Some(&(field, value)) = fields.iter().find(|f| !(f.1 >= 0.0 && f.1.is_finite()))
            {
                return fault(field, value, "finite and not negative");
            }
            if let Some(l) = s.light.filter(|l| l.try_normalize().is_none()) {
                return fault("light", l.length(), DIRECTION);
            }
        }
        for light in &self.lights {
            if let Some(l) = light.direction.filter(|l| l.try_normalize().is_none()) {
                return fault("lights", l.length(), DIRECTION);
            }
            if let Some(&c) = light.color.iter().find(|c| !(**c >= 0.0 && c.is_finite())) {
                return fault("lights' colour", c, "finite and not negative");
            }
        }
        if let Some(g) = &self.gradient_opacity {
            if !(g.steepest > 0.0 && g.steepest.is_finite()) || g.factors.is_empty() {
                return fault(
                    "gradient opacity's steepest",
                    g.steepest,
                    "finite and positive, with one factor or more",
                );
            }
            if let Some(&f) = g.factors.iter().find(|f| !(0.0..=1.0).contains(*f)) {
                return fault("a factor of the gradient opacity", f, "0 to 1");
            }
        }
        if let Blend::Isosurfaces(values) = &self.blend
            && let Some(&v) = values.iter().find(|v| !v.is_finite())
        {
            return fault("an isosurface's value", v, "finite");
        }
        Ok(())
    }
}
