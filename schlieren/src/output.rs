//! Writes images to files: PNG for viewing, OpenEXR with every layer and parameter, and NumPy for
//! the deflection map.

use crate::cutoff::Rgb;
use crate::drawing::Canvas;
#[cfg(doc)]
use crate::render::Map;
use crate::render::{RenderOutput, Report};
use crate::scene::{Scene, SceneError};
use crate::sheet::Sheet;
use datasets::image_io::{self, ImageError, LayeredImage, Metadata, PngDepth, PngReport, keys};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Why an image cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The image format cannot hold it, or the image file cannot be written.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The scene cannot be converted to metadata.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The file cannot be written.
    #[error("{path}: cannot write")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The deflection map was not rendered.
    #[error("the deflection map was not rendered; request Layers::map")]
    NoMap,
}

/// Writes the image as sRGB with 8 bits per channel.
pub fn write_png(path: &Path, rendered: &RenderOutput) -> Result<PngReport, OutputError> {
    Ok(image_io::write_png(path, &picture(rendered)?, PngDepth::Eight)?)
}

/// The bytes of the file that [`write_png`] writes.
pub fn encode_png(rendered: &RenderOutput) -> Result<(Vec<u8>, PngReport), OutputError> {
    let name = Path::new("the image");
    Ok(image_io::encode_png(name, &picture(rendered)?, PngDepth::Eight)?)
}

fn picture(rendered: &RenderOutput) -> Result<LayeredImage, OutputError> {
    let mut image = LayeredImage::new(rendered.framing.width, rendered.framing.height);
    add_colors(&mut image, "", &rendered.pixels, rendered.colored)?;
    Ok(image)
}

/// Writes every layer that was rendered:
///
/// | plane | unit | |
/// |---|---|---|
/// | `R` `G` `B`, or `Y` | | the image, linear |
/// | `deflection.X` `.Y` | rad | along the image's right and up |
/// | `displacement.X` `.Y` | m | of the ray in the plane of focus, in the test section; for BOS, of the background's dots, at their undisturbed places: [`Map::apparent_m`] |
/// | `phase.Y` | waves | in the plane of focus |
/// | `transmission.Y` | | 1 free, 0 blocked |
/// | `samples.Y` | photons | landed on the pixel |
/// | `error.Y` | | noise of the image, from the finite number of photons |
/// | `error.deflection` | rad | error of the deflection, from march and interpolation |
/// | `optical_depth.Y` | | along the light's path, when the scene has `media.absorption` |
/// | `emission.Y` | | along the camera's path, 1 is undisturbed light without a cut-off, when the scene has `media.emission` |
/// | `rotation.Y` | rad | of the plane of polarisation, when the scene has `media.rotation` |
///
/// The metadata holds every value of the effective scene under its TOML path, the whole scene as
/// text, and a report of the run.
pub fn write_exr(
    path: &Path,
    rendered: &RenderOutput,
    scene: &Scene,
    elapsed_secs: f64,
) -> Result<(), OutputError> {
    let mut image = layers(rendered)?;
    image.metadata = metadata(rendered, scene, elapsed_secs)?;
    Ok(image_io::write_exr(path, &image)?)
}

/// Writes a drawn picture as sRGB with 8 bits per channel.
pub fn write_canvas(path: &Path, canvas: &Canvas) -> Result<PngReport, OutputError> {
    let mut image = LayeredImage::new(canvas.width as u32, canvas.height as u32);
    add_colors(&mut image, "", &canvas.pixels, true)?;
    Ok(image_io::write_png(path, &image, PngDepth::Eight)?)
}

/// Writes the panels of a sheet as layers: `NAME.R`, `.G`, `.B` or `NAME.Y`; `deflection`,
/// `displacement` (of BOS dots), `phase.Y` and `transmission.Y` as in [`write_exr`].
pub fn write_sheet_exr(
    path: &Path,
    sheet: &Sheet,
    scene: &Scene,
    elapsed_secs: f64,
) -> Result<(), OutputError> {
    let mut image = LayeredImage::new(sheet.framing.width, sheet.framing.height);
    for panel in &sheet.panels {
        if let Some(pixels) = &panel.pixels {
            let colored = pixels.iter().any(|p| p[0] != p[1] || p[0] != p[2]);
            add_colors(&mut image, &format!("{}.", panel.name), pixels, colored)?;
        }
    }
    let dots = sheet.background_map.as_ref().map_or(&[][..], |m| &m.apparent_m);
    let m = &sheet.map;
    for (axis, name) in ["X", "Y"].into_iter().enumerate() {
        let of = |v: &[[f32; 2]]| v.iter().map(|d| d[axis]).collect::<Vec<f32>>();
        image.add(&format!("deflection.{name}"), "rad", of(&m.deflection_rad))?;
        if !dots.is_empty() {
            image.add(&format!("displacement.{name}"), "m", of(dots))?;
        }
    }
    image.add("phase.Y", "waves", m.waves.clone())?;
    image.add("transmission.Y", "1", m.transmission.clone())?;
    image.metadata = metadata_of(&sheet.report, scene, elapsed_secs)?;
    for panel in sheet.panels.iter().filter(|p| p.pixels.is_some()) {
        let text = format!("{}; {}", panel.labels.join(": "), panel.options.join(" "));
        image.metadata.insert(format!("panel {}", panel.name), text.into());
    }
    Ok(image_io::write_exr(path, &image)?)
}

fn add_colors(
    image: &mut LayeredImage,
    prefix: &str,
    pixels: &[Rgb],
    colored: bool,
) -> Result<(), OutputError> {
    let names: &[(usize, &str)] =
        if colored { &[(0, "R"), (1, "G"), (2, "B")] } else { &[(0, "Y")] };
    for (c, name) in names {
        let channel = pixels.iter().map(|v| v[*c]).collect();
        image.add(&format!("{prefix}{name}"), "", channel)?;
    }
    Ok(())
}

/// Collects all rendered layers as planes.
pub fn layers(rendered: &RenderOutput) -> Result<LayeredImage, OutputError> {
    let mut image = LayeredImage::new(rendered.framing.width, rendered.framing.height);
    add_colors(&mut image, "", &rendered.pixels, rendered.colored)?;
    if let Some(m) = &rendered.map {
        for (axis, name) in ["X", "Y"].into_iter().enumerate() {
            let of = |v: &[[f32; 2]]| v.iter().map(|d| d[axis]).collect();
            image.add(&format!("deflection.{name}"), "rad", of(&m.deflection_rad))?;
            let dots = !m.apparent_m.is_empty();
            let displacement = if dots { &m.apparent_m } else { &m.displacement_m };
            image.add(&format!("displacement.{name}"), "m", of(displacement))?;
        }
        if !m.waves.is_empty() {
            image.add("phase.Y", "waves", m.waves.clone())?;
        }
        image.add("transmission.Y", "1", m.transmission.clone())?;
    }
    if let Some(m) = &rendered.media {
        for (name, unit, layer) in [
            ("optical_depth.Y", "1", &m.optical_depth),
            ("emission.Y", "1", &m.emission),
            ("rotation.Y", "rad", &m.rotation_rad),
        ] {
            if !layer.is_empty() {
                image.add(name, unit, layer.clone())?;
            }
        }
    }
    if let Some(counts) = &rendered.counts {
        image.add("samples.Y", "photons", counts.iter().map(|n| *n as f32).collect())?;
    }
    if let Some(noise) = &rendered.noise {
        image.add("error.Y", "1", noise.clone())?;
    }
    if let Some(error) = rendered.report.deflection_error_rad {
        image.add("error.deflection", "rad", vec![error as f32; rendered.framing.pixels()])?;
    }
    Ok(image)
}

/// Collects every parameter and a report of the run.
pub fn metadata(
    rendered: &RenderOutput,
    scene: &Scene,
    elapsed_secs: f64,
) -> Result<Metadata, OutputError> {
    metadata_of(&rendered.report, scene, elapsed_secs)
}

fn metadata_of(r: &Report, scene: &Scene, elapsed_secs: f64) -> Result<Metadata, OutputError> {
    let mut m = image_io::metadata_of_this_run("schlieren", env!("CARGO_PKG_VERSION"));
    // OpenEXR reserves the attribute of that name.
    if let Some(program) = m.remove(keys::SOFTWARE) {
        m.insert("program".into(), program);
    }
    m.insert(keys::ELAPSED_SECS.into(), elapsed_secs.into());
    let text = scene.effective().to_toml()?;
    if let Ok(table) = text.parse::<toml::Table>() {
        flatten("", &toml::Value::Table(table), &mut m);
    }
    m.insert("scene".into(), text.into());
    m.insert("pixel_m".into(), r.pixel_m.into());
    m.insert("march_in_effect".into(), r.march.clone().into());
    m.insert("rays".into(), (r.counters.rays as f64).into());
    if let Some(e) = r.deflection_error_rad {
        m.insert("deflection_error_rad".into(), e.into());
    }
    if !r.warnings.is_empty() {
        m.insert("warnings".into(), r.warnings.join("\n").into());
    }
    Ok(m)
}

/// Inserts the values of a TOML tree under their paths, such as `film.focus_m`. Lists become text.
fn flatten(path: &str, value: &toml::Value, out: &mut Metadata) {
    match value {
        toml::Value::Table(table) => {
            for (key, v) in table {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                flatten(&path, v, out);
            }
        }
        toml::Value::Float(v) => {
            out.insert(path.into(), (*v).into());
        }
        toml::Value::Integer(v) => {
            out.insert(path.into(), (*v as f64).into());
        }
        toml::Value::String(v) => {
            out.insert(path.into(), v.clone().into());
        }
        other => {
            out.insert(path.into(), other.to_string().into());
        }
    }
}

/// Writes the deflection map as a NumPy array of shape (height, width, 2), little-endian f32, in
/// rad along the image's right and up. Row 0 is the top.
pub fn write_npy(path: &Path, rendered: &RenderOutput) -> Result<(), OutputError> {
    let map = rendered.map.as_ref().ok_or(OutputError::NoMap)?;
    write_vectors(path, rendered, &map.deflection_rad)
}

/// Writes the displacement as a NumPy array of shape (height, width, 2), little-endian f32, in m
/// along the image's right and up: for BOS that of the dots ([`Map::apparent_m`]), otherwise that
/// of the rays.
pub fn write_displacement(path: &Path, rendered: &RenderOutput) -> Result<(), OutputError> {
    let map = rendered.map.as_ref().ok_or(OutputError::NoMap)?;
    let dots = !map.apparent_m.is_empty();
    write_vectors(path, rendered, if dots { &map.apparent_m } else { &map.displacement_m })
}

fn write_vectors(
    path: &Path,
    rendered: &RenderOutput,
    vectors: &[[f32; 2]],
) -> Result<(), OutputError> {
    let shape = format!("({}, {}, 2)", rendered.framing.height, rendered.framing.width);
    let bytes = npy(&shape, vectors.as_flattened());
    write_whole(path, &bytes).map_err(|source| OutputError::Io { path: path.into(), source })
}

/// Encodes NumPy's format, version 1.0: magic number, header length, a Python dictionary padded so
/// that the data begin at a multiple of 64 bytes, then the data.
fn npy(shape: &str, values: &[f32]) -> Vec<u8> {
    const PREAMBLE: usize = 10;
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
    let end = (PREAMBLE + header.len() + 1).next_multiple_of(64);
    header.extend(std::iter::repeat_n(' ', end - PREAMBLE - header.len() - 1));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

/// Writes a file atomically: it appears complete or not at all.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.partial", std::process::id()));
    let temporary = path.with_file_name(name);
    let result = std::fs::File::create(&temporary)
        .and_then(|mut f| f.write_all(bytes))
        .and_then(|()| std::fs::rename(&temporary, path));
    if result.is_err() {
        // The first error is the one to report.
        let _ = std::fs::remove_file(&temporary);
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn npy_is_numpys_format() {
        let bytes = npy("(1, 2, 2)", &[1.0, -2.0, 0.5, 1e-7]);
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + length) % 64, 0);
        let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
        assert!(
            header.starts_with("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 2), }")
        );
        assert!(header.ends_with('\n'));
        assert_eq!(bytes.len(), 10 + length + 16);
        assert_eq!(bytes[10 + length + 4..][..4], (-2.0f32).to_le_bytes());
    }

    #[test]
    fn every_parameter_has_its_path() {
        let table: toml::Table =
            "[film]\nsize = [3, 4]\nfocus_m = 0.5\n[technique]\nkind = \"bos\"".parse().unwrap();
        let mut m = Metadata::new();
        flatten("", &toml::Value::Table(table), &mut m);
        assert_eq!(m["film.focus_m"], 0.5.into());
        assert_eq!(m["technique.kind"], "bos".into());
        assert!(m.contains_key("film.size"));
    }
}
