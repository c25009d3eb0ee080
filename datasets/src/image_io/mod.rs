//! Reads and writes images: PNG for viewing, multi-layer OpenEXR for data.
//!
//! A [`LayeredImage`] is a set of named f32 planes of equal size. Names follow the `layer.channel`
//! convention by which tev, Nuke, Blender and OpenRV group channels: `R`, `G`, `B`, `A` for the
//! colour, then `depth.Z`, `normal.X`, `deflection.X`… OpenEXR keeps every plane bit for bit with
//! its unit and the image's metadata; PNG keeps the colour only.
//!
//! ```
//! use datasets::image_io::{LayeredImage, read_exr, write_exr};
//! let mut image = LayeredImage::new(2, 1);
//! image.add("depth.Z", "m", vec![1.0, f32::INFINITY])?;
//! image.metadata.insert("samples".into(), 16.0.into());
//! let file = std::env::temp_dir().join(format!("doc-{}.exr", std::process::id()));
//! write_exr(&file, &image)?;
//! assert_eq!(read_exr(&file)?, image);
//! # std::fs::remove_file(file).unwrap();
//! # Ok::<(), datasets::image_io::ImageError>(())
//! ```

mod attribute_order;
mod openexr;
mod png;

pub use openexr::{read_exr, write_exr};
pub use png::{PngDepth, PngReport, encode_png, read_png, write_png};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Named planes of equal size.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LayeredImage {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The planes, in the order in which they were added. Colour planes are linear with
    /// premultiplied alpha, as OpenEXR requires.
    pub planes: Vec<Plane>,
    /// How the image was made: see [`Metadata`].
    pub metadata: Metadata,
}

/// One value per pixel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plane {
    /// "R" or "layer.channel".
    pub name: String,
    /// Unit of the values ("m", "rad", "1"); empty when unknown.
    pub unit: String,
    /// `width * height` values, top row first.
    pub samples: Vec<f32>,
}

/// Metadata stored with an image. Customary keys: [`keys`].
pub type Metadata = BTreeMap<String, MetadataValue>;

/// Customary metadata keys, shared by all programs of the workspace.
pub mod keys {
    /// The program's name and version (text).
    pub const SOFTWARE: &str = "software";
    /// The command line (text).
    pub const COMMAND_LINE: &str = "command_line";
    /// Wall-clock time to make the image, in seconds (number).
    pub const ELAPSED_SECS: &str = "elapsed_secs";
    /// Samples per pixel (number).
    pub const SAMPLES_PER_PIXEL: &str = "samples_per_pixel";
    /// Seed of the random numbers (text, because 64-bit integers do not fit into a number).
    pub const SEED: &str = "seed";
    /// Hash of the scene (text).
    pub const SCENE_HASH: &str = "scene_hash";
}

/// A metadata entry.
#[derive(Debug, Clone, PartialEq)]
pub enum MetadataValue {
    /// Any UTF-8 text.
    Text(String),
    /// A number.
    Number(f64),
}

impl From<&str> for MetadataValue {
    fn from(v: &str) -> Self {
        MetadataValue::Text(v.into())
    }
}
impl From<String> for MetadataValue {
    fn from(v: String) -> Self {
        MetadataValue::Text(v)
    }
}
impl From<f64> for MetadataValue {
    fn from(v: f64) -> Self {
        MetadataValue::Number(v)
    }
}

/// Why an image cannot be read, written or assembled.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file system reports an error.
    #[error("{path}: cannot {action}")]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// The reason.
        source: std::io::Error,
    },
    /// The file does not contain a readable image, or the format cannot store the image.
    #[error("{path}: {reason}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A plane has the wrong number of values.
    #[error("plane `{name}` has {found} values; an image of {width}x{height} needs {expected}")]
    PlaneLength {
        /// Its name.
        name: String,
        /// How many it has.
        found: usize,
        /// Pixels per row.
        width: u32,
        /// Rows.
        height: u32,
        /// The required number, width times height.
        expected: u64,
    },
    /// Two planes have the same name.
    #[error("the image already has a plane `{name}`; give each plane its own name")]
    DuplicatePlane {
        /// The name.
        name: String,
    },
    /// A required plane is absent.
    #[error("the image has no plane `{name}` (it has: {present}); {cure}")]
    MissingPlane {
        /// The requested name.
        name: &'static str,
        /// The existing names.
        present: String,
        /// What to do.
        cure: &'static str,
    },
}

impl LayeredImage {
    /// An image without planes.
    pub fn new(width: u32, height: u32) -> Self {
        LayeredImage { width, height, ..Default::default() }
    }

    /// Adds a plane. `name` must be new, and there must be one value per pixel.
    pub fn add(&mut self, name: &str, unit: &str, samples: Vec<f32>) -> Result<(), ImageError> {
        if self.plane(name).is_some() {
            return Err(ImageError::DuplicatePlane { name: name.into() });
        }
        let plane = Plane { name: name.into(), unit: unit.into(), samples };
        self.check_plane(&plane)?;
        self.planes.push(plane);
        Ok(())
    }

    /// Adds the planes R, G, B, A from linear premultiplied pixels.
    pub fn add_rgba(&mut self, pixels: &[[f32; 4]]) -> Result<(), ImageError> {
        for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
            self.add(name, "", pixels.iter().map(|p| p[c]).collect())?;
        }
        Ok(())
    }

    /// The plane of that name.
    pub fn plane(&self, name: &str) -> Option<&Plane> {
        self.planes.iter().find(|p| p.name == name)
    }

    /// Linear premultiplied RGBA. A single plane `Y` is grey; without `A` pixels are opaque.
    pub fn rgba(&self) -> Result<Vec<[f32; 4]>, ImageError> {
        let need = |name: &'static str| {
            self.plane(name).ok_or_else(|| ImageError::MissingPlane {
                name,
                present: self.planes.iter().map(|p| p.name.as_str()).collect::<Vec<_>>().join(", "),
                cure: "colour needs R, G and B, or Y",
            })
        };
        let [r, g, b] = match self.plane("Y") {
            Some(y) if self.plane("R").is_none() => [y, y, y],
            _ => [need("R")?, need("G")?, need("B")?],
        };
        let alpha = self.plane("A");
        let pixel = |i: usize| {
            [r.samples[i], g.samples[i], b.samples[i], alpha.map_or(1.0, |a| a.samples[i])]
        };
        self.check()?;
        Ok((0..r.samples.len()).map(pixel).collect())
    }

    fn check(&self) -> Result<(), ImageError> {
        self.planes.iter().try_for_each(|p| self.check_plane(p))
    }

    fn check_plane(&self, p: &Plane) -> Result<(), ImageError> {
        let (found, expected) = (p.samples.len(), self.width as u64 * self.height as u64);
        if found as u64 == expected {
            return Ok(());
        }
        Err(ImageError::PlaneLength {
            name: p.name.clone(),
            found,
            width: self.width,
            height: self.height,
            expected,
        })
    }
}

/// Metadata that every program can provide: its name, its version and its command line.
pub fn metadata_of_this_run(software: &str, version: &str) -> Metadata {
    let arguments: Vec<String> =
        std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect();
    Metadata::from([
        (keys::SOFTWARE.to_string(), format!("{software} {version}").into()),
        (keys::COMMAND_LINE.to_string(), arguments.join(" ").into()),
    ])
}

fn io_error(path: &Path, action: &'static str) -> impl Fn(std::io::Error) -> ImageError {
    let path = path.to_path_buf();
    move |source| ImageError::Io { path: path.clone(), action, source }
}

fn format_error(path: &Path, reason: impl ToString) -> ImageError {
    ImageError::Format { path: path.to_path_buf(), reason: reason.to_string() }
}
