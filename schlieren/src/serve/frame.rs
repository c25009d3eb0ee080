//! Packs a rendered image for the page: numbers as JSON, then pixels.

use super::deflection_map::DeflectionMap;
use super::filter_plane::{FilterPlane, PIXELS};
use super::legend::{Legend, Scale};
use super::srgb_byte::srgb_byte;
use crate::render::RenderOutput;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// The numbers of a frame.
#[derive(Debug, Clone, Default, Serialize)]
pub struct FrameInfo {
    /// Number of the frame.
    pub serial: u64,
    /// Generation of the scene that it shows.
    pub generation: u64,
    /// Whether this is the final frame of the scene.
    pub finished: bool,
    /// Why rendering failed; the frame then has no pixels.
    pub error: Option<String>,
    /// Number of pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Side of a pixel in the test section.
    pub pixel_m: f64,
    /// Photons per pixel; absent for images without noise.
    pub samples: Option<u32>,
    /// Photons per pixel of the final image.
    pub samples_wanted: Option<u32>,
    /// Number of rays traced for the image.
    pub rays: u64,
    /// Time to render the image.
    pub elapsed_secs: f64,
    /// Root mean square of the estimated noise, relative to white.
    pub noise_rms: Option<f64>,
    /// Largest estimated noise, relative to white.
    pub noise_max: Option<f64>,
    /// Measured error of deflections due to march and interpolation.
    pub deflection_error_rad: Option<f64>,
    /// Estimated error of deflections due to the flow's own lattice.
    pub resolution_error_rad: Option<f64>,
    /// Estimated error of deflections due to the mesh that the flow comes from.
    pub mesh_error_rad: Option<f64>,
    /// Largest deflection through a pixel's centre.
    pub largest_deflection_rad: Option<f64>,
    /// Description of the march.
    pub march: String,
    /// Whether it was rendered with a coarse tolerance, and possibly through a coarse field.
    pub draft: bool,
    /// Lowest and highest channel value.
    pub levels: [f32; 2],
    /// Warnings about the image.
    pub warnings: Vec<String>,
    /// Half the side of the shown filter plane.
    pub filter_half_m: f64,
    /// Pixels along the side of the shown filter plane.
    pub filter_pixels: usize,
    /// f2: the factor from radians to metres in the filter plane.
    pub focal_length_m: f64,
    /// Fraction of the light outside the shown filter plane.
    pub light_outside: f32,
    /// Middle of the image, from the middle of the gas along right and up.
    pub center_m: [f64; 2],
    /// Pixels per row and rows of the final image.
    pub film_size: [u32; 2],
    /// Width of the image that shows all of the flow.
    pub whole_width_m: f64,
    /// Right, up and the direction of the light, in the flow's coordinates.
    pub axes: [[f64; 3]; 3],
    /// Middle of the gas in the flow's coordinates.
    pub flow_center_m: [f64; 3],
    /// Columns and rows of the legend; 0 without one.
    pub legend_size: [usize; 2],
    /// Deflection at the middle of each side of a legend of deflections.
    pub legend_half_rad: Option<f64>,
    /// Optical path at the right end of a legend of paths, which begins at 0.
    pub legend_path_m: Option<f64>,
}

/// A frame as it is stored and sent.
pub struct Frame {
    /// Numbers of the frame.
    pub info: FrameInfo,
    /// Head and pixels as sent, little-endian: length of the JSON as u32, the JSON, the image's
    /// sRGB bytes, the filter's sRGB bytes, the light on the filter as f32, the legend's sRGB
    /// bytes.
    pub bytes: Vec<u8>,
    pub(super) traced: Option<Arc<DeflectionMap>>,
}

impl Frame {
    /// Packs a frame, with `None` for what could not be rendered.
    pub(super) fn new(
        mut info: FrameInfo,
        rendered: Option<&RenderOutput>,
        filter: Option<&FilterPlane>,
        legend: Option<&Legend>,
        traced: Option<Arc<DeflectionMap>>,
    ) -> Frame {
        let mut pixels = Vec::new();
        if let Some(r) = rendered {
            (info.width, info.height, info.pixel_m) =
                (r.framing.width, r.framing.height, r.framing.pixel_m);
            info.center_m = r.framing.center_m;
            pixels.resize(3 * r.pixels.len(), 0);
            // The report has a warning about pixels that are not numbers.
            pixels
                .par_chunks_exact_mut(3)
                .zip(&r.pixels)
                .for_each(|(to, from)| to.copy_from_slice(&from.map(srgb_byte)));
        }
        if let Some(f) = filter {
            (info.filter_half_m, info.filter_pixels, info.light_outside) =
                (f.half_m, PIXELS, f.outside);
        }
        if let Some(l) = legend {
            info.legend_size = l.size;
            match l.scale {
                Scale::Deflection { half_rad } => info.legend_half_rad = Some(half_rad),
                Scale::Path { longest_m } => info.legend_path_m = Some(longest_m),
            }
        }
        let head = serde_json::to_vec(&info).unwrap_or_default();
        let mut bytes = (head.len() as u32).to_le_bytes().to_vec();
        bytes.extend(head);
        bytes.extend(pixels);
        if let Some(f) = filter {
            bytes.extend(&f.rgb);
            bytes.extend(f.light.iter().flat_map(|v| v.to_le_bytes()));
        }
        bytes.extend(legend.iter().flat_map(|l| &l.rgb));
        Frame { info, bytes, traced }
    }
}
