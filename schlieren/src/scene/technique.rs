//! Techniques and cut-offs in scenes.

use super::SceneError;
use crate::cutoff::painted::Painting;
use crate::cutoff::{Aperture, ColorWheel, Cutoff, FilterImage, Knife, KnifePosition, Passes};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The technique that turns light into an image, with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum TechniqueSpec {
    /// A shadowgraph ([`crate::technique::shadowgraph`]).
    Shadowgraph {},
    /// Schlieren ([`crate::technique::schlieren`]).
    Schlieren {
        /// The cut-off in the cut-off plane.
        #[serde(default)]
        cutoff: CutoffSpec,
    },
    /// An interferogram ([`crate::technique::interferogram`]).
    Interferogram {
        /// Visibility V: the contrast of the fringes.
        #[serde(default = "one")]
        visibility: f64,
        /// Distance χ of the fringes; infinite fringe when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        fringe_spacing_m: Option<f64>,
        /// Direction across the fringes.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        fringe_angle_deg: Option<f64>,
    },
    /// Background-oriented schlieren ([`crate::technique::bos`]).
    Bos {
        /// Diameter of a dot; three pixels when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        dot_diameter_m: Option<f64>,
        /// Mean distance of dots; twice their diameter when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        dot_spacing_m: Option<f64>,
        /// Seed that selects the pattern of dots.
        #[serde(default)]
        seed: u32,
    },
    /// Volume rendering of the gradient, for comparison ([`crate::technique::volume`]).
    Volume {
        /// Strength of the smoke.
        #[serde(default = "ten")]
        strength: f64,
    },
    /// The gradient on a slice, for comparison ([`crate::technique::slice`]).
    Slice {
        /// Strength in the exponent.
        #[serde(default = "ten")]
        strength: f64,
        /// Depth of the slice, from the field's middle along the light.
        #[serde(default)]
        depth_m: f64,
    },
}

fn one() -> f64 {
    1.0
}

fn ten() -> f64 {
    10.0
}

fn half() -> f64 {
    0.5
}

impl Default for TechniqueSpec {
    fn default() -> Self {
        TechniqueSpec::Schlieren { cutoff: CutoffSpec::default() }
    }
}

impl TechniqueSpec {
    /// The names of all techniques.
    pub const NAMES: [&str; 6] =
        ["shadowgraph", "schlieren", "interferogram", "bos", "volume", "slice"];

    /// The technique of that name with default values.
    pub fn by_name(name: &str) -> Option<TechniqueSpec> {
        Some(match name {
            "shadowgraph" => TechniqueSpec::Shadowgraph {},
            "schlieren" => TechniqueSpec::Schlieren { cutoff: CutoffSpec::default() },
            "interferogram" => TechniqueSpec::Interferogram {
                visibility: one(),
                fringe_spacing_m: None,
                fringe_angle_deg: None,
            },
            "bos" => TechniqueSpec::Bos { dot_diameter_m: None, dot_spacing_m: None, seed: 0 },
            "volume" => TechniqueSpec::Volume { strength: ten() },
            "slice" => TechniqueSpec::Slice { strength: ten(), depth_m: 0.0 },
            _ => return None,
        })
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            TechniqueSpec::Shadowgraph {} => "shadowgraph",
            TechniqueSpec::Schlieren { .. } => "schlieren",
            TechniqueSpec::Interferogram { .. } => "interferogram",
            TechniqueSpec::Bos { .. } => "bos",
            TechniqueSpec::Volume { .. } => "volume",
            TechniqueSpec::Slice { .. } => "slice",
        }
    }

    /// Whether the technique traces light. False for the comparisons without optics.
    pub fn follows_light(&self) -> bool {
        !matches!(self, TechniqueSpec::Volume { .. } | TechniqueSpec::Slice { .. })
    }

    /// Whether the extent of the source can change the image.
    pub fn uses_source(&self) -> bool {
        matches!(self, TechniqueSpec::Schlieren { .. } | TechniqueSpec::Shadowgraph {})
    }
}

/// The cut-off in the cut-off plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CutoffSpec {
    /// A knife edge.
    Knife {
        /// Direction from the blade to the opening, counter-clockwise from the image's right.
        #[serde(default)]
        angle_deg: f64,
        /// Fraction of the source's image that the knife leaves open.
        #[serde(default = "half")]
        open: f64,
        /// Height that the knife leaves open in the cut-off plane, in place of `open`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        open_m: Option<f64>,
    },
    /// An iris.
    Circle {
        /// Radius of the iris.
        radius_m: f64,
        /// From the axis.
        #[serde(default)]
        center_m: [f64; 2],
    },
    /// An opaque spot.
    ComplementedCircle {
        /// Radius of the spot.
        radius_m: f64,
        /// From the axis.
        #[serde(default)]
        center_m: [f64; 2],
    },
    /// A colour wheel.
    Color {
        /// Radius at which colours are saturated.
        radius_m: f64,
        /// Direction of red.
        #[serde(default)]
        red_deg: f64,
    },
    /// An image as filter.
    Image {
        /// Path of a PNG file.
        file: PathBuf,
        /// Width of the image in the cut-off plane.
        width_m: f64,
    },
    /// A filter painted by hand.
    Painted(Painting),
}

impl Default for CutoffSpec {
    fn default() -> Self {
        CutoffSpec::Knife { angle_deg: 0.0, open: half(), open_m: None }
    }
}

impl CutoffSpec {
    /// The cut-off. Reads the image of a filter from its file.
    ///
    /// # Errors
    /// If the image of a filter cannot be read, or a painting is invalid.
    pub fn cutoff(&self) -> Result<Cutoff, SceneError> {
        Ok(match self {
            CutoffSpec::Knife { angle_deg, open, open_m } => {
                let position =
                    open_m.map_or(KnifePosition::OpenFraction(*open), KnifePosition::OpenM);
                Cutoff::Knife(Knife { angle_deg: *angle_deg, position })
            }
            CutoffSpec::Circle { radius_m, center_m } => Cutoff::Aperture(Aperture {
                radius_m: *radius_m,
                center_m: *center_m,
                passes: Passes::Inside,
            }),
            CutoffSpec::ComplementedCircle { radius_m, center_m } => Cutoff::Aperture(Aperture {
                radius_m: *radius_m,
                center_m: *center_m,
                passes: Passes::Outside,
            }),
            CutoffSpec::Color { radius_m, red_deg } => {
                Cutoff::Color(ColorWheel { radius_m: *radius_m, red_deg: *red_deg })
            }
            CutoffSpec::Image { file, width_m } => {
                Cutoff::Image(FilterImage::from_png(file, *width_m)?)
            }
            CutoffSpec::Painted(painting) => Cutoff::Image(painting.to_filter()?),
        })
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            CutoffSpec::Knife { .. } => "knife",
            CutoffSpec::Circle { .. } => "circle",
            CutoffSpec::ComplementedCircle { .. } => "complemented-circle",
            CutoffSpec::Color { .. } => "color",
            CutoffSpec::Image { .. } => "image",
            CutoffSpec::Painted(_) => "painted",
        }
    }
}
