//! Saves images: PNG for viewing, and OpenEXR with every layer, its unit and how the image was
//! made.

use super::{RenderRequest, RenderedImage};
use datasets::image_io::{self, LayeredImage, Metadata, PngDepth, keys};
use rt_core::frame::{Frame, PlaneValues};
use std::path::Path;

/// Every layer of a frame as named planes. Pixels without a hit have id -1.
pub fn layered_image(frame: &Frame) -> anyhow::Result<LayeredImage> {
    let mut p = LayeredImage::new(frame.width, frame.height);
    for plane in frame.planes() {
        let (unit, samples) = match plane.values {
            PlaneValues::F32(v) => (plane.unit, v.into_owned()),
            PlaneValues::U32(v) => {
                let id = |&i: &u32| if i == u32::MAX { -1.0 } else { i as f32 };
                ("index, -1 for none", v.iter().map(id).collect())
            }
        };
        p.add(plane.name, unit, samples)?;
    }
    Ok(p)
}

/// Ids above this are not exact as 32-bit floating point numbers.
const LARGEST_EXACT_ID: u32 = 1 << 24;

/// True when an id of the frame would be rounded in a file.
pub fn rounds_ids(frame: &Frame) -> bool {
    let ids = frame.instance.iter().chain(&frame.primitive);
    ids.filter(|&&i| i != u32::MAX).any(|&i| i > LARGEST_EXACT_ID)
}

/// Metadata about how the image was made.
pub fn metadata(rendered: &RenderedImage, request: &RenderRequest) -> Metadata {
    let mut m = image_io::metadata_of_this_run("bench", env!("CARGO_PKG_VERSION"));
    let names = |n: &mut dyn Iterator<Item = &'static str>| n.collect::<Vec<_>>().join(", ");
    m.insert(keys::ELAPSED_SECS.into(), rendered.render_secs.into());
    m.insert(keys::SAMPLES_PER_PIXEL.into(), f64::from(rendered.report.samples).into());
    m.insert(keys::SEED.into(), "0".into());
    m.insert("effects".into(), names(&mut rendered.report.effects.names()).into());
    m.insert("robustness".into(), request.build.robustness.name().into());
    m.insert("build_quality".into(), request.build.quality.name().into());
    m.insert("rays".into(), (rendered.report.rays.total() as f64).into());
    m
}

/// Writes the colour as PNG, 8 bits.
pub fn write_png(path: &Path, frame: &Frame) -> anyhow::Result<image_io::PngReport> {
    let mut p = LayeredImage::new(frame.width, frame.height);
    let opaque = frame.color.iter().all(|c| c[3] == 1.0);
    for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate().filter(|(c, _)| *c < 3 || !opaque)
    {
        p.add(name, "", frame.color.iter().map(|v| v[c]).collect())?;
    }
    Ok(image_io::write_png(path, &p, PngDepth::Eight)?)
}

/// Writes every layer as OpenEXR.
pub fn write_exr(
    path: &Path,
    rendered: &RenderedImage,
    request: &RenderRequest,
) -> anyhow::Result<()> {
    let mut p = layered_image(&rendered.frame)?;
    p.metadata = metadata(rendered, request);
    Ok(image_io::write_exr(path, &p)?)
}

/// The bytes of the PNG file.
pub fn png_bytes(frame: &Frame) -> anyhow::Result<Vec<u8>> {
    let dir = tempfile::tempdir()?;
    let path = dir.path().join("image.png");
    write_png(&path, frame)?;
    Ok(std::fs::read(&path)?)
}
