//! A picture on its way to the page: numbers as JSON, then pixels.

use super::filter_plane::{FilterPlane, PIXELS};
use crate::film::Framing;
use crate::render::{Map, RenderOutput};
use rayon::prelude::*;
use rt_core::colormap::linear_to_srgb;
use serde::Serialize;
use std::sync::Arc;

/// What a frame is, in numbers.
#[derive(Debug, Clone, Default, Serialize)]
pub struct FrameInfo {
    /// Counts frames.
    pub serial: u64,
    /// Of the scene that it shows.
    pub generation: u64,
    /// True when nothing finer will come.
    pub finished: bool,
    /// Why there is no picture; the pixels are then none.
    pub error: Option<String>,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Side of a pixel in the test section.
    pub pixel_m: f64,
    /// Photons per pixel; absent for pictures without noise.
    pub samples: Option<u32>,
    /// Photons per pixel that the finished picture will have.
    pub samples_wanted: Option<u32>,
    /// Rays that were traced for it.
    pub rays: u64,
    /// Time they took.
    pub elapsed_secs: f64,
    /// Root mean square of the estimated noise, of white.
    pub noise_rms: Option<f64>,
    /// Its largest.
    pub noise_max: Option<f64>,
    /// Measured error of a deflection by march and interpolation.
    pub deflection_error_rad: Option<f64>,
    /// Estimated error of a deflection by the flow's own lattice.
    pub resolution_error_rad: Option<f64>,
    /// Largest deflection through a pixel's centre.
    pub largest_deflection_rad: Option<f64>,
    /// The march, in words.
    pub march: String,
    /// Whether it was drawn with a coarse tolerance, and maybe through every so many nodes of the
    /// field.
    pub draft: bool,
    /// Darkest and brightest channel.
    pub levels: [f32; 2],
    /// What should be known.
    pub warnings: Vec<String>,
    /// Half the side of the filter plane that is shown.
    pub filter_half_m: f64,
    /// Pixels along its side.
    pub filter_pixels: usize,
    /// f2, from radians to metres in the plane.
    pub focal_length_m: f64,
    /// Part of the light beyond what is shown of the filter.
    pub light_outside: f32,
}

/// The deflections that belong to a view, for following pixels to the filter.
pub(super) struct DeflectionMap {
    pub(super) map: Map,
    pub(super) framing: Framing,
}

/// A frame as it is kept and sent.
pub struct Frame {
    /// In numbers.
    pub info: FrameInfo,
    /// Head and pixels, as sent: length of the JSON as u32, the JSON, the picture's sRGB bytes, the
    /// filter's, the light on the filter as f32; little-endian.
    pub bytes: Vec<u8>,
    pub(super) traced: Option<Arc<DeflectionMap>>,
}

impl Frame {
    /// Packs a frame; `None` for what could not be drawn.
    pub(super) fn new(
        mut info: FrameInfo,
        rendered: Option<&RenderOutput>,
        filter: Option<&FilterPlane>,
        traced: Option<Arc<DeflectionMap>>,
    ) -> Frame {
        let mut pixels = Vec::new();
        if let Some(r) = rendered {
            (info.width, info.height, info.pixel_m) =
                (r.framing.width, r.framing.height, r.framing.pixel_m);
            pixels.resize(3 * r.pixels.len(), 0);
            // NaN becomes 0 in the cast; there is a warning for it in the report.
            let byte = |v: f32| (255.0 * linear_to_srgb(v.clamp(0.0, 1.0))).round() as u8;
            pixels
                .par_chunks_exact_mut(3)
                .zip(&r.pixels)
                .for_each(|(to, from)| to.copy_from_slice(&from.map(byte)));
        }
        if let Some(f) = filter {
            (info.filter_half_m, info.filter_pixels, info.light_outside) =
                (f.half_m, PIXELS, f.outside);
        }
        let head = serde_json::to_vec(&info).unwrap_or_default();
        let mut bytes = (head.len() as u32).to_le_bytes().to_vec();
        bytes.extend(head);
        bytes.extend(pixels);
        if let Some(f) = filter {
            bytes.extend(&f.rgb);
            bytes.extend(f.light.iter().flat_map(|v| v.to_le_bytes()));
        }
        Frame { info, bytes, traced }
    }
}
