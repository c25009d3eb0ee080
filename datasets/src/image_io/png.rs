//! PNG through the `image` crate: sRGB-encoded colour with straight alpha, 8 or 16 bits.

use super::{ImageError, LayeredImage, format_error, io_error};
use crate::atomic_file::write_atomically;
use image::{DynamicImage, ImageBuffer, ImageEncoder};
use rt_core::colormap::{linear_to_srgb, srgb_to_linear};
use std::io::Cursor;
use std::path::Path;

/// Bits per channel of a PNG.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PngDepth {
    /// For viewing.
    #[default]
    Eight,
    /// For comparisons that need more than 8 bits.
    Sixteen,
}

/// Counts pixels that PNG cannot represent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PngReport {
    /// Pixels with NaN in colour or alpha, written as opaque magenta.
    pub nan: usize,
    /// Pixels with a colour outside 0..=1 (after division by alpha) that was clamped.
    pub clamped: usize,
}

/// Writes the colour planes (R, G, B and optionally A, or Y). Alpha is written when the image has
/// `A`.
pub fn write_png(
    path: &Path,
    image: &LayeredImage,
    depth: PngDepth,
) -> Result<PngReport, ImageError> {
    let (bytes, report) = encode_png(path, image, depth)?;
    write_atomically(path, |w| w.write_all(&bytes)).map_err(io_error(path, "write"))?;
    Ok(report)
}

/// The bytes of the file that [`write_png`] writes. `name` stands for it in errors.
pub fn encode_png(
    name: &Path,
    image: &LayeredImage,
    depth: PngDepth,
) -> Result<(Vec<u8>, PngReport), ImageError> {
    let pixels = image.rgba()?;
    if pixels.is_empty() {
        return Err(format_error(name, "PNG cannot hold an image without pixels"));
    }
    let mut report = PngReport::default();
    let encoded: Vec<[f32; 4]> = pixels.iter().map(|&p| encode(p, &mut report)).collect();
    let channels = if image.plane("A").is_some() { 4 } else { 3 };
    let quantized = |max: f32| {
        encoded.iter().flat_map(move |p| p[..channels].iter().map(move |v| (v * max).round()))
    };
    let (bytes, color) = match (depth, channels) {
        (PngDepth::Eight, 4) => (
            quantized(255.0).map(|v| v as u8).collect::<Vec<u8>>(),
            image::ExtendedColorType::Rgba8,
        ),
        (PngDepth::Eight, _) => {
            (quantized(255.0).map(|v| v as u8).collect(), image::ExtendedColorType::Rgb8)
        }
        // `image` takes 16-bit samples in native byte order.
        (PngDepth::Sixteen, 4) => (
            quantized(65535.0).flat_map(|v| (v as u16).to_ne_bytes()).collect(),
            image::ExtendedColorType::Rgba16,
        ),
        (PngDepth::Sixteen, _) => (
            quantized(65535.0).flat_map(|v| (v as u16).to_ne_bytes()).collect(),
            image::ExtendedColorType::Rgb16,
        ),
    };
    let mut file = Cursor::new(Vec::new());
    image::codecs::png::PngEncoder::new(&mut file)
        .write_image(&bytes, image.width, image.height, color)
        .map_err(|e| format_error(name, e))?;
    Ok((file.into_inner(), report))
}

/// Reads a PNG of any kind as linear premultiplied R, G, B (and A when the file has alpha).
pub fn read_png(path: &Path) -> Result<LayeredImage, ImageError> {
    let bytes = std::fs::read(path).map_err(io_error(path, "read"))?;
    let decoded = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png)
        .map_err(|e| format_error(path, format!("not a readable PNG file: {e}")))?;
    let has_alpha = decoded.color().has_alpha();
    let encoded = unit_range(decoded);
    let mut image = LayeredImage::new(encoded.width(), encoded.height());
    let decode = |p: [f32; 4]| [0, 1, 2].map(|c| srgb_to_linear(p[c]) * p[3]);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        image.add(name, "", encoded.pixels().map(|p| decode(p.0)[c]).collect())?;
    }
    if has_alpha {
        image.add("A", "", encoded.pixels().map(|p| p.0[3]).collect())?;
    }
    Ok(image)
}

/// Normalises samples to 0..=1. (The crate's own conversion to f32 does the same but may interpret
/// the values in a colour space of its choice.)
fn unit_range(decoded: DynamicImage) -> ImageBuffer<image::Rgba<f32>, Vec<f32>> {
    let pixels = decoded.to_rgba16();
    ImageBuffer::from_fn(pixels.width(), pixels.height(), |x, y| {
        image::Rgba(pixels.get_pixel(x, y).0.map(|v| v as f32 / 65535.0))
    })
}

/// Converts linear premultiplied colour to sRGB with straight alpha, all in 0..=1.
fn encode(p: [f32; 4], report: &mut PngReport) -> [f32; 4] {
    if p.iter().any(|v| v.is_nan()) {
        report.nan += 1;
        return [1.0, 0.0, 1.0, 1.0];
    }
    let alpha = p[3].clamp(0.0, 1.0);
    let straight = [0, 1, 2].map(|c| if alpha > 0.0 { p[c] / alpha } else { 0.0 });
    // Division by alpha may leave the range by a rounding error, which is not reported.
    report.clamped += straight.iter().any(|v| !(-1e-6..=1.0 + 1e-6).contains(v)) as usize;
    let [r, g, b] = straight.map(|v| linear_to_srgb(v.clamp(0.0, 1.0)));
    [r, g, b, alpha]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(image: &LayeredImage, depth: PngDepth) -> (LayeredImage, PngReport) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.png");
        let report = write_png(&path, image, depth).unwrap();
        (read_png(&path).unwrap(), report)
    }

    #[test]
    fn all_256_codes_survive_a_round_trip() {
        let codes: Vec<f32> = (0..256).map(|i| srgb_to_linear(i as f32 / 255.0)).collect();
        let mut p = LayeredImage::new(16, 16);
        p.add("Y", "", codes.clone()).unwrap();
        let (back, report) = round_trip(&p, PngDepth::Eight);
        assert_eq!(report, PngReport::default());
        for (a, b) in codes.iter().zip(&back.plane("G").unwrap().samples) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        assert!(back.plane("A").is_none());
    }

    #[test]
    fn sixteen_bits_are_finer_than_eight() {
        let fine: Vec<f32> = (0..64).map(|i| 0.5 + i as f32 * 1e-4).collect();
        let mut p = LayeredImage::new(64, 1);
        p.add("Y", "", fine.clone()).unwrap();
        let error = |depth| {
            let back = round_trip(&p, depth).0;
            fine.iter()
                .zip(&back.planes[0].samples)
                .map(|(a, b)| (a - b).abs())
                .fold(0f32, f32::max)
        };
        assert!(error(PngDepth::Sixteen) < 2e-5 && error(PngDepth::Eight) > 1e-3);
    }

    #[test]
    fn premultiplied_alpha_becomes_straight_and_back() {
        let mut p = LayeredImage::new(3, 1);
        p.add_rgba(&[[0.5, 0.25, 0.0, 0.5], [0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0]]).unwrap();
        let (back, report) = round_trip(&p, PngDepth::Sixteen);
        assert_eq!(report.clamped, 0);
        for (a, b) in p.rgba().unwrap().iter().flatten().zip(back.rgba().unwrap().iter().flatten())
        {
            assert!((a - b).abs() < 3e-5, "{a} {b}");
        }
    }

    #[test]
    fn nan_is_magenta_and_overflow_is_counted() {
        let mut p = LayeredImage::new(4, 1);
        p.add("Y", "", vec![f32::NAN, 2.0, f32::INFINITY, -1.0]).unwrap();
        let (back, report) = round_trip(&p, PngDepth::Eight);
        assert_eq!(report, PngReport { nan: 1, clamped: 3 });
        let rgba = back.rgba().unwrap();
        assert_eq!(rgba, [[1.0, 0.0, 1.0, 1.0], [1.0; 4], [1.0; 4], [0.0, 0.0, 0.0, 1.0]]);
    }

    #[test]
    fn missing_colour_names_what_is_there() {
        let mut p = LayeredImage::new(1, 1);
        p.add("depth.Z", "m", vec![1.0]).unwrap();
        let message = write_png(Path::new("x.png"), &p, PngDepth::Eight).unwrap_err().to_string();
        assert!(message.contains("depth.Z") && message.contains("`R`"), "{message}");
        assert!(read_png(Path::new("absent.png")).unwrap_err().to_string().contains("absent.png"));
    }

    #[test]
    fn wrong_plane_length_is_refused() {
        let mut p = LayeredImage::new(2, 2);
        assert!(matches!(
            p.add("Y", "", vec![0.0; 3]),
            Err(ImageError::PlaneLength { expected: 4, found: 3, .. })
        ));
        assert!(p.planes.is_empty(), "a refused plane is not added");
        p.add("Y", "", vec![0.0; 4]).unwrap();
        assert!(matches!(p.add("Y", "", vec![0.0; 4]), Err(ImageError::DuplicatePlane { .. })));
    }
}
