//! What a medium does to light beside bending it: it absorbs, glows, and turns the plane of
//! polarisation.
//!
//! Along the path of a ray, s its length in metres ([`MediaIntegrals`]):
//!
//! | property | given | collected | reference |
//! |---|---|---|---|
//! | [`Property::Absorption`] | α(x), 1/m | optical depth τ = ∫ α ds; exp(-τ) of the light is left | Beer and Lambert |
//! | [`Property::Emission`] | j(x), 1/m, see below | L = ∫ j exp(-τ') ds, τ' the optical depth between x and the eye | Chandrasekhar, *Radiative Transfer* (1950), chapter I, without scattering |
//! | [`Property::Rotation`] | ρ(x), rad/m | φ = ∫ ρ ds; an analyser at the angle θ to the polariser passes cos²(θ - φ) | Faraday, Malus |
//!
//! Nothing of it bends light, so it is collected in a walk of its own beside the march
//! ([`MediaIntegrator`]), and a scene without such properties runs none of this code. The walk
//! bends as the march does ([`Bend`]): straight for line of sight, in `f32` by the trilinear
//! gradient of eps for gases (a displacement within some per cent, and the displacement itself is
//! below a voxel there), in `f64` by the spline for strong index.
//!
//! Properties are sampled trilinearly: they are not differentiated, and trilinear never rings below
//! zero. A smooth property of width σ on a lattice of spacing h is then off by about h²/(8σ²) of
//! its largest value. A walk's steps are those of the march, but no longer than a voxel of any
//! property's lattice; each takes the middle's value. A property without variation is integrated to
//! rounding.
//!
//! **Emission** is relative: 1 is the radiance that makes the film as bright as undisturbed light
//! without a cut-off does. A flame of emission 0.2/m that is half a metre thick is a tenth as
//! bright as the lamp. From W/(m³ sr) it is j / (B a/A): B the lamp's radiance, a and A the areas
//! of its image and of the stop in the cut-off plane, because a flame fills the stop and the lamp's
//! image does not.
//!
//! **Rotation** is positive counter-clockwise in the picture, for the light of this view. Faraday's
//! rotation depends on the field's component along the light: another view needs another array
//! (`B:x` takes a component of a vector).
//!
//! ```
//! use glam::DVec3;
//! use schlieren::field::Field;
//! use schlieren::media::{Bend, MediaIntegrals, Media, Property, Volume, MediaIntegrator};
//! use schlieren::path::Start;
//! use schlieren::view::{Axis, View};
//!
//! // A slab of smoke, 10 cm deep, that absorbs 3 per metre and glows.
//! let air = Field::from_fn([5; 3], [0.025; 3], DVec3::ZERO, 1.0003, |_| 0.0)?;
//! let media = Media::default()
//!     .with(Property::Absorption, Volume::uniform(3.0, &air)?)
//!     .with(Property::Emission, Volume::uniform(0.5, &air)?);
//! let view = View::along(Axis::Z, air.centre_m());
//! let (bend, rest) = (Bend::Straight, Default::default());
//! let integrator = MediaIntegrator::new(&air, view, &media, &Property::ALL, bend, 1.0, rest);
//! let mut along = [MediaIntegrals::default()];
//! integrator.collect(&[Start::default()], None, &mut along);
//! assert!((along[0].optical_depth - 0.3).abs() < 1e-6);
//! assert!((along[0].emission - 0.5 / 3.0 * (1.0 - (-0.3f32).exp())).abs() < 1e-6);
//! # Ok::<(), schlieren::field::FieldError>(())
//! ```

mod collect;
mod full;
mod integrator;
mod paraxial;
mod paths;
mod volume;

pub use integrator::{Bend, MediaIntegrator};
pub use paths::AttenuatedPaths;
pub use volume::{Repairs, Volume};

/// Something that a medium has at every point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Property {
    /// Part of the light that is lost per metre.
    Absorption,
    /// Light that is added per metre.
    Emission,
    /// Angle by which the plane of polarisation turns per metre.
    Rotation,
}

impl Property {
    /// All of them.
    pub const ALL: [Property; 3] = [Property::Absorption, Property::Emission, Property::Rotation];

    /// As in scenes and reports.
    pub fn name(self) -> &'static str {
        match self {
            Property::Absorption => "absorption",
            Property::Emission => "emission",
            Property::Rotation => "rotation",
        }
    }

    /// Of its values.
    pub fn unit(self) -> &'static str {
        match self {
            Property::Absorption | Property::Emission => "1/m",
            Property::Rotation => "rad/m",
        }
    }

    /// Whether values below zero mean something.
    pub fn is_signed(self) -> bool {
        self == Property::Rotation
    }
}

/// What a medium does to light beside bending it, as far as it is known.
#[derive(Debug, Default)]
pub struct Media {
    volumes: [Option<Volume>; 3],
}

impl Media {
    /// The same with a property. Values below zero that mean nothing are taken as zero and counted
    /// in its [`Volume::repairs`].
    #[must_use]
    pub fn with(mut self, property: Property, volume: Volume) -> Media {
        let volume = if property.is_signed() { volume } else { volume.without_negatives() };
        self.volumes[property as usize] = Some(volume);
        self
    }

    /// A property, when it is known.
    pub fn get(&self, property: Property) -> Option<&Volume> {
        self.volumes[property as usize].as_ref()
    }

    /// Whether no property is known.
    pub fn is_empty(&self) -> bool {
        self.volumes.iter().all(Option::is_none)
    }

    /// What was repaired, a sentence for each property with repairs.
    pub fn warnings(&self) -> Vec<String> {
        let mut out = Vec::new();
        for property in Property::ALL {
            let (name, Some(volume)) = (property.name(), self.get(property)) else { continue };
            let Repairs { not_finite, negative } = volume.repairs();
            let nodes: usize = volume.dims().iter().product();
            if not_finite > 0 {
                out.push(format!(
                    "media.{name}: {not_finite} of {nodes} values are not finite; they are \
                     continued from their neighbours"
                ));
            }
            if negative > 0 {
                out.push(format!(
                    "media.{name}: {negative} of {nodes} values are below 0; they are taken as 0"
                ));
            }
        }
        out
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.volumes.iter().flatten().map(Volume::memory_bytes).sum()
    }
}

/// What was collected along a ray. A property that is not known or was not wanted leaves its zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MediaIntegrals {
    /// τ.
    pub optical_depth: f32,
    /// L, as seen by an eye where the walk begins, looking along it.
    pub emission: f32,
    /// φ in rad.
    pub rotation_rad: f32,
}

impl MediaIntegrals {
    /// The part of polarised light that is left, behind an analyser at an angle to the polariser
    /// when there is one.
    pub fn transmission(&self, analyser_rad: Option<f64>) -> f64 {
        let left = (-f64::from(self.optical_depth)).exp();
        left * analyser_rad.map_or(1.0, |a| (a - f64::from(self.rotation_rad)).cos().powi(2))
    }
}
