//! Integrates absorption, emission and rotation of the plane of polarisation along light paths.
//!
//! Integrals along the path of a ray, with s the path length in metres ([`MediaIntegrals`]):
//!
//! | property | input | integral | reference |
//! |---|---|---|---|
//! | [`Property::Absorption`] | α(x), 1/m | optical depth τ = ∫ α ds; exp(-τ) of the light remains | Beer and Lambert |
//! | [`Property::Emission`] | j(x), 1/m, see below | L = ∫ j exp(-τ') ds, τ' the optical depth between x and the eye | Chandrasekhar, *Radiative Transfer* (1950), chapter I, without scattering |
//! | [`Property::Rotation`] | ρ(x), rad/m | φ = ∫ ρ ds; an analyser at the angle θ to the polariser passes cos²(θ - φ) | Faraday, Malus |
//!
//! None of these bends light, so [`MediaIntegrator`] integrates them in a pass separate from the
//! march, and a scene without such properties runs none of this code. Its rays bend as those of the
//! march ([`Bend`]): straight for line of sight; in `f32` by the trilinear gradient of eps for
//! gases, where the displacement is below a voxel and right within a few per cent; in `f64` by the
//! spline for strong index.
//!
//! Properties are sampled trilinearly, because they are not differentiated and trilinear
//! interpolation never overshoots below zero. The error for a smooth property of width σ on a
//! lattice of spacing h is about h²/(8σ²) of its largest value. Steps are those of the march, but
//! no longer than a voxel of any property's lattice, and use the value at their middle. A uniform
//! property is integrated to rounding.
//!
//! **Emission** is relative: 1 is the radiance that makes the film as bright as undisturbed light
//! without a cut-off does. A flame of emission 0.2/m that is half a metre thick is a tenth as
//! bright as the lamp. An emission in W/(m³ sr) is converted by j / (B a/A), with B the lamp's
//! radiance and a and A the areas of its image and of the stop in the cut-off plane: a flame fills
//! the stop and the lamp's image does not.
//!
//! **Rotation** is positive counter-clockwise in the image, for the light of this view. Faraday
//! rotation depends on the component of the magnetic field along the light, so another view needs
//! another array (`B:x` selects a component of a vector).
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
//! integrator.integrate(&[Start::default()], None, &mut along);
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

/// A property that a medium has at every point, besides its index of refraction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Property {
    /// Fraction of the light that is lost per metre.
    Absorption,
    /// Light that is added per metre, relative to undisturbed light (see the [module](self)).
    Emission,
    /// Angle by which the plane of polarisation is rotated per metre.
    Rotation,
}

impl Property {
    /// All properties.
    pub const ALL: [Property; 3] = [Property::Absorption, Property::Emission, Property::Rotation];

    /// The name in scenes and reports.
    pub fn name(self) -> &'static str {
        match self {
            Property::Absorption => "absorption",
            Property::Emission => "emission",
            Property::Rotation => "rotation",
        }
    }

    /// The unit of the values.
    pub fn unit(self) -> &'static str {
        match self {
            Property::Absorption | Property::Emission => "1/m",
            Property::Rotation => "rad/m",
        }
    }

    /// Whether values below zero are valid.
    pub fn is_signed(self) -> bool {
        self == Property::Rotation
    }
}

/// The known properties of a medium.
#[derive(Debug, Default)]
pub struct Media {
    volumes: [Option<Volume>; 3],
}

impl Media {
    /// Sets a property. Invalid values below zero are set to zero and counted in
    /// [`Volume::repairs`].
    #[must_use]
    pub fn with(mut self, property: Property, volume: Volume) -> Media {
        let volume = if property.is_signed() { volume } else { volume.without_negatives() };
        self.volumes[property as usize] = Some(volume);
        self
    }

    /// The values of a property, or `None` when it is not known.
    pub fn get(&self, property: Property) -> Option<&Volume> {
        self.volumes[property as usize].as_ref()
    }

    /// Whether no property is known.
    pub fn is_empty(&self) -> bool {
        self.volumes.iter().all(Option::is_none)
    }

    /// A sentence about repaired values for each property that has any.
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
                    "media.{name}: {negative} of {nodes} values are below 0; they are treated as 0"
                ));
            }
        }
        out
    }

    /// Memory in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.volumes.iter().flatten().map(Volume::memory_bytes).sum()
    }
}

/// The integrals along one ray. They are zero for properties that are not known or not wanted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MediaIntegrals {
    /// Optical depth τ.
    pub optical_depth: f32,
    /// Emission L, as seen by an eye at the start of the ray that looks along it.
    pub emission: f32,
    /// Rotation φ in rad.
    pub rotation_rad: f32,
}

impl MediaIntegrals {
    /// The fraction of polarised light that remains, behind an analyser at this angle to the
    /// polariser if there is one.
    pub fn transmission(&self, analyser_rad: Option<f64>) -> f64 {
        let left = (-f64::from(self.optical_depth)).exp();
        left * analyser_rad.map_or(1.0, |a| (a - f64::from(self.rotation_rad)).cos().powi(2))
    }
}
