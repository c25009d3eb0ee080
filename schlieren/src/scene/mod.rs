//! Reads and writes scenes: TOML files that describe an image by flow, view, light, bench,
//! technique, film and march.
//!
//! Unknown keys are refused, and so are keys that belong to another technique. [`Scene::effective`]
//! makes every default explicit, so an image can be reproduced from the TOML that
//! [`Scene::to_toml`] then writes. Lengths are in metres. Angles of the set-up are in degrees, and
//! deflections of light in radians.
//!
//! ```
//! use schlieren::scene::Scene;
//! let scene = Scene::from_toml(
//!     r#"
//!     [flow]
//!     file = "jet.vti"
//!     density = "rho"
//!     [technique]
//!     kind = "schlieren"
//!     cutoff = { kind = "knife", angle_deg = 90.0, open = 0.3 }
//!     "#,
//! )?;
//! assert_eq!(scene.film.size, [512, 512]);
//! assert_eq!(Scene::from_toml(&scene.to_toml()?)?, scene);
//! let error = Scene::from_toml("[flow]\nfile = \"jet.vti\"\nviscosity = \"mu\"").unwrap_err();
//! assert!(std::error::Error::source(&error).unwrap().to_string().contains("viscosity"));
//! # Ok::<(), schlieren::scene::SceneError>(())
//! ```

mod check;
mod direction;
mod effects;
mod flow;
mod media;
mod on_cells;
mod technique;

pub use direction::Direction;
pub use effects::{Counters, Effects};
pub use flow::{CurveSpec, FlowSpec, MultifieldSpec};
pub use media::MediaSpec;
pub use technique::{CutoffSpec, TechniqueSpec};

use crate::filter::Filter;
use crate::optics::{Optics, SourceShape};
use crate::spectrum::Line;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Everything that determines an image.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// The gas.
    pub flow: FlowSpec,
    /// The direction of view.
    #[serde(default)]
    pub view: ViewSpec,
    /// Colour and extent of the light.
    #[serde(default)]
    pub light: LightSpec,
    /// Lenses.
    #[serde(default)]
    pub lenses: LensSpec,
    /// The technique that turns light into an image.
    #[serde(default)]
    pub technique: TechniqueSpec,
    /// Size and focus of the image.
    #[serde(default)]
    pub film: FilmSpec,
    /// How the film is exposed. The default depends on the technique.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling: Option<SamplingSpec>,
    /// How light is traced through the flow.
    #[serde(default)]
    pub march: MarchSpec,
    /// Bodies in the test section.
    #[serde(default)]
    pub solids: SolidsSpec,
    /// Absorption, emission and rotation by the medium.
    #[serde(default, skip_serializing_if = "MediaSpec::is_empty")]
    pub media: MediaSpec,
}

/// The direction of light.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewSpec {
    /// `"x"`, `"y"`, `"z"`, or `"AZIMUTH,ELEVATION"` of the light in degrees.
    #[serde(default)]
    pub direction: Direction,
}

/// The light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSpec {
    /// Vacuum wavelengths. Each is traced separately with its own index, and several are added up
    /// in their colours.
    #[serde(default = "helium_neon")]
    pub wavelengths_nm: Vec<f64>,
    /// Fractions of the light per wavelength; equal when absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub weights: Vec<f64>,
    /// Shape of the source. The default depends on the technique.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceSpec>,
    /// Whether the beams of different points of the source are traced separately.
    #[serde(default)]
    pub beams: BeamsSpec,
}

fn helium_neon() -> Vec<f64> {
    vec![633.0]
}

impl Default for LightSpec {
    fn default() -> Self {
        LightSpec {
            wavelengths_nm: helium_neon(),
            weights: Vec::new(),
            source: None,
            beams: BeamsSpec::Auto,
        }
    }
}

/// The shape of the source.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SourceSpec {
    /// A point without extent.
    Point {},
    /// A rectangle.
    Slit {
        /// Size along `angle_deg`.
        width_m: f64,
        /// Size across `angle_deg`.
        length_m: f64,
        /// Direction of the width; that of the knife when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        angle_deg: Option<f64>,
    },
    /// A disc.
    Circle {
        /// Diameter of the disc.
        diameter_m: f64,
    },
}

/// How the extent of the source is treated within the flow. (In the cut-off plane it is always
/// included.)
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BeamsSpec {
    /// Tilted when the tilts of the source's beams shift light by more than half a pixel, within
    /// the flow or in the plane of focus.
    #[default]
    Auto,
    /// All light travels along the axis.
    Axial,
    /// Each photon has the tilt of its own point of the source.
    Tilted,
}

/// The lenses (or mirrors).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensSpec {
    /// f1, from the source to the collimator.
    #[serde(default = "focal_length")]
    pub collimator_m: f64,
    /// f2, from the schlieren lens to the cut-off.
    #[serde(default = "focal_length")]
    pub schlieren_m: f64,
}

fn focal_length() -> f64 {
    Optics::DEFAULT.schlieren_focal_length_m
}

impl Default for LensSpec {
    fn default() -> Self {
        LensSpec { collimator_m: focal_length(), schlieren_m: focal_length() }
    }
}

/// The film.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilmSpec {
    /// Pixels per row, and rows.
    #[serde(default = "film_size")]
    pub size: [u32; 2],
    /// Width of the image in the test section; the whole field when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_of_view_m: Option<f64>,
    /// Middle of the image, from the middle of the field along right and up.
    #[serde(default)]
    pub center_m: [f64; 2],
    /// The plane in focus, from the middle of the field along the light. It is the distance of the
    /// film of a shadowgraph, or of the background of a BOS set-up (towards the light). The default
    /// depends on the technique.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus_m: Option<f64>,
    /// Factor from energy to the image's brightness (1 is white). The default depends on the
    /// technique.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<f64>,
}

fn film_size() -> [u32; 2] {
    [512, 512]
}

impl Default for FilmSpec {
    fn default() -> Self {
        FilmSpec {
            size: film_size(),
            field_of_view_m: None,
            center_m: [0.0; 2],
            focus_m: None,
            exposure: None,
        }
    }
}

/// How the film is exposed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SamplingSpec {
    /// Exposed by jittered photons ([`crate::film::photons`]).
    Photons {
        /// Photons per pixel.
        #[serde(default = "samples")]
        samples: u32,
        /// Distribution of the photons.
        #[serde(default)]
        jitter: Jitter,
        /// Seed of the jitter.
        #[serde(default)]
        seed: u64,
        /// Filter against noise.
        #[serde(default)]
        filter: FilterSpec,
    },
    /// Exposed by cells of a lattice of rays, without noise ([`crate::film::beams`]).
    Beams {
        /// Cells along a pixel's side.
        #[serde(default = "cells")]
        cells_per_side: u32,
    },
}

fn samples() -> u32 {
    16
}

fn cells() -> u32 {
    1
}

impl Default for SamplingSpec {
    fn default() -> Self {
        SamplingSpec::Photons {
            samples: samples(),
            jitter: Jitter::Sobol,
            seed: 0,
            filter: FilterSpec::default(),
        }
    }
}

/// Distribution of the photons over a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Jitter {
    /// A scrambled Sobol sequence.
    #[default]
    Sobol,
    /// Independent random positions as in the dissertation, for comparison.
    Random,
}

/// [`Filter`], with parameters for one photon per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum FilterSpec {
    /// No filter.
    None {},
    /// A Gaussian.
    Gaussian {
        /// Standard deviation.
        sigma_px: f64,
    },
    /// A mean over a square.
    Mean {
        /// Half the side of the square.
        radius_px: f64,
    },
    /// A cone over the nearest photons.
    Cone {
        /// Number of photons.
        nearest: u32,
    },
}

impl Default for FilterSpec {
    fn default() -> Self {
        // Half a pixel at the default of 16 photons.
        FilterSpec::Gaussian { sigma_px: 0.8 }
    }
}

impl FilterSpec {
    /// The filter.
    pub fn filter(self) -> Filter {
        match self {
            FilterSpec::None {} => Filter::None,
            FilterSpec::Gaussian { sigma_px } => Filter::Gaussian { sigma_px },
            FilterSpec::Mean { radius_px } => Filter::Mean { radius_px },
            FilterSpec::Cone { nearest } => Filter::Cone { nearest },
        }
    }
}

/// How light is traced through the flow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarchSpec {
    /// Largest error of a deflection. It determines what is absent below.
    #[serde(default = "tolerance")]
    pub tolerance_rad: f64,
    /// Name of the march; chosen from the tolerance when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<String>,
    /// Name of the interpolant; chosen from the tolerance when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolant: Option<String>,
    /// Step in voxels; chosen from the tolerance when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step_voxels: Option<f64>,
    /// Uniform gas is skipped as long as this changes no ray's deflection by more than this angle
    /// in all; 0 skips nothing. Where the phase is computed, its error is kept below 1e-5 waves per
    /// eight skipped steps.
    #[serde(default)]
    pub skip_rad: f64,
    /// The device that computes the paths.
    #[serde(default)]
    pub device: Device,
}

fn tolerance() -> f64 {
    1e-7
}

impl Default for MarchSpec {
    fn default() -> Self {
        MarchSpec {
            tolerance_rad: tolerance(),
            method: None,
            interpolant: None,
            step_voxels: None,
            skip_rad: 0.0,
            device: Device::Cpu,
        }
    }
}

/// Where paths are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Device {
    /// Trace on all cores of the CPU.
    #[default]
    Cpu,
    /// Trace on a GPU by compute shaders; it is an error if that is impossible.
    Gpu,
    /// Trace on a GPU if there is one and it has a kernel for the march; else on the CPU, with a
    /// warning that says why.
    Auto,
}

/// Bodies in the test section.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidsSpec {
    /// Files (OBJ, STL, PLY, glTF, VTP…) in metres, in the flow's coordinates.
    #[serde(default)]
    pub files: Vec<PathBuf>,
}

/// Errors of reading, checking and writing scenes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file cannot be read.
    #[error("{path}: cannot read the scene")]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The text is not valid TOML, or a key is unknown or has the wrong type. The message shows the
    /// line.
    #[error("{name}: not a scene")]
    Toml {
        /// The file, or "scene".
        name: String,
        /// The position and the cause.
        source: toml::de::Error,
    },
    /// The scene cannot be written.
    #[error("the scene cannot be written as TOML")]
    Write(#[from] toml::ser::Error),
    /// An invalid value.
    #[error("{key} is {value}; {cure}")]
    Value {
        /// Path of the key in the TOML file.
        key: &'static str,
        /// The value.
        value: String,
        /// What the value can be.
        cure: String,
    },
    /// A value that changes no pixel.
    #[error("{key} has no effect with technique `{technique}`; omit it{hint}")]
    NoEffect {
        /// Path of the key.
        key: &'static str,
        /// The technique.
        technique: &'static str,
        /// Continuation of the message: where the key would have an effect.
        hint: &'static str,
    },
    /// The arrays of the flow do not define a medium.
    #[error("[flow]: {reason}")]
    Flow {
        /// What is missing or superfluous, with the cure.
        reason: String,
    },
    /// The image of the filter is invalid.
    #[error("technique.cutoff")]
    Filter(#[from] crate::cutoff::FilterError),
}

impl Scene {
    /// Reads a scene from TOML and checks it.
    ///
    /// # Errors
    /// If the text is not TOML, or a key or value is refused ([`Scene::check`]).
    pub fn from_toml(text: &str) -> Result<Scene, SceneError> {
        Scene::parse(text, "scene")
    }

    /// Reads a scene from a file and checks it. Paths in the scene are relative to the file.
    ///
    /// # Errors
    /// If the file cannot be read; otherwise as [`Scene::from_toml`].
    pub fn open(path: &Path) -> Result<Scene, SceneError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| SceneError::Read { path: path.into(), source })?;
        let mut scene = Scene::parse(&text, &path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut files = vec![&mut scene.flow.file];
        files.extend(scene.solids.files.iter_mut());
        if let TechniqueSpec::Schlieren { cutoff: CutoffSpec::Image { file, .. } } =
            &mut scene.technique
        {
            files.push(file);
        }
        for file in files {
            // Joining keeps absolute paths.
            *file = folder.join(&*file);
        }
        Ok(scene)
    }

    fn parse(text: &str, name: &str) -> Result<Scene, SceneError> {
        let scene: Scene = toml::from_str(text)
            .map_err(|source| SceneError::Toml { name: name.into(), source })?;
        scene.check()?;
        Ok(scene)
    }

    /// The scene as TOML.
    ///
    /// # Errors
    /// If a value cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String, SceneError> {
        Ok(toml::to_string(self)?)
    }

    /// The scene with all defaults that depend on the technique made explicit (`--print-scene`).
    #[must_use]
    pub fn effective(&self) -> Scene {
        let mut s = self.clone();
        let t = &self.technique;
        if t.uses_source() {
            let optics = self.optics();
            s.light.source = Some(match optics.source {
                SourceShape::Point => SourceSpec::Point {},
                SourceShape::Slit { width_m, length_m, angle_deg } => {
                    SourceSpec::Slit { width_m, length_m, angle_deg: Some(angle_deg) }
                }
                SourceShape::Circle { diameter_m } => SourceSpec::Circle { diameter_m },
            });
        }
        if t.follows_light() {
            s.film.focus_m = Some(self.focus_m());
        }
        if t.follows_light() {
            s.sampling = Some(self.sampling());
        }
        if self.media.emission.is_some() && matches!(t, TechniqueSpec::Schlieren { .. }) {
            s.media.stop_m = Some(self.media.stop_m());
        }
        s.film.exposure = Some(self.exposure());
        s
    }

    /// How the film is exposed: the given sampling or the technique's default. A shadowgraph shows
    /// the density of light itself, which photons sample with much noise (25 % with 16 of them), so
    /// its default is beams. The default of the others is photons.
    pub fn sampling(&self) -> SamplingSpec {
        let beams = matches!(self.technique, TechniqueSpec::Shadowgraph {});
        let default_sampling = if beams {
            SamplingSpec::Beams { cells_per_side: cells() }
        } else {
            SamplingSpec::default()
        };
        self.sampling.unwrap_or(default_sampling)
    }

    /// The plane in focus: the given one or the technique's default.
    pub fn focus_m(&self) -> f64 {
        self.film.focus_m.unwrap_or(match self.technique {
            TechniqueSpec::Shadowgraph {} | TechniqueSpec::Bos { .. } => 0.5,
            _ => 0.0,
        })
    }

    /// Factor from energy to brightness: the given one or the technique's default. The undisturbed
    /// light of a shadowgraph has half brightness, so that brighter light is not clipped.
    pub fn exposure(&self) -> f64 {
        self.film.exposure.unwrap_or(if matches!(self.technique, TechniqueSpec::Shadowgraph {}) {
            0.5
        } else {
            1.0
        })
    }

    /// The optical bench.
    pub fn optics(&self) -> Optics {
        let along_knife = match &self.technique {
            TechniqueSpec::Schlieren { cutoff: CutoffSpec::Knife { angle_deg, .. } } => *angle_deg,
            _ => 0.0,
        };
        let default_source = match &self.technique {
            TechniqueSpec::Schlieren { cutoff: CutoffSpec::Knife { .. } } => {
                SourceSpec::Slit { width_m: 1e-3, length_m: 5e-3, angle_deg: None }
            }
            TechniqueSpec::Schlieren { .. } => SourceSpec::Circle { diameter_m: 0.5e-3 },
            _ => SourceSpec::Point {},
        };
        let source = match self.light.source.unwrap_or(default_source) {
            SourceSpec::Point {} => SourceShape::Point,
            SourceSpec::Slit { width_m, length_m, angle_deg } => {
                SourceShape::Slit { width_m, length_m, angle_deg: angle_deg.unwrap_or(along_knife) }
            }
            SourceSpec::Circle { diameter_m } => SourceShape::Circle { diameter_m },
        };
        Optics {
            source,
            collimator_focal_length_m: self.lenses.collimator_m,
            schlieren_focal_length_m: self.lenses.schlieren_m,
            focus_m: self.focus_m(),
        }
    }

    /// The lines of the spectrum, with weights that add up to 1.
    pub fn lines(&self) -> Vec<Line> {
        let light = &self.light;
        let weight = |i: usize| light.weights.get(i).copied().unwrap_or(1.0);
        let total: f64 = (0..light.wavelengths_nm.len()).map(weight).sum();
        let line =
            |(i, &wavelength_nm): (usize, &f64)| Line { wavelength_nm, weight: weight(i) / total };
        light.wavelengths_nm.iter().enumerate().map(line).collect()
    }
}
