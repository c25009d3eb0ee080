//! OpenEXR through the `exr` crate: all planes of an image become 32-bit channels of one part, with
//! lossless ZIP compression.
//!
//! Metadata entries are attributes of the same name. The unit of plane `depth.Z` is the text
//! attribute `unit.depth.Z`. Texts are written as UTF-8. Names that the format defines as text
//! (`software`, `comments`, `owner`…) or as numbers (`expTime`, `near`…) become those standard
//! attributes, which other programs show under their own headings. Standard numbers have 32 bits,
//! all others 64.

use super::attribute_order::sort_attributes;
use super::{ImageError, LayeredImage, Metadata, MetadataValue, Plane, format_error, io_error};
use crate::atomic_file::write_atomically;
use exr::meta::attribute::AttributeValue;
use exr::meta::header::standard_names;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels,
    ReadLayers, Text, WritableImage,
};
use std::io::Cursor;
use std::path::Path;

const UNIT_PREFIX: &str = "unit.";
/// Longest attribute or channel name that every OpenEXR reader accepts.
const MAX_NAME_BYTES: usize = 255;

/// Writes all planes and the metadata. The file is written atomically.
pub fn write_exr(path: &Path, image: &LayeredImage) -> Result<(), ImageError> {
    image.check()?;
    if image.planes.is_empty() || image.width == 0 || image.height == 0 {
        let size = format!("{}x{} with {} planes", image.width, image.height, image.planes.len());
        return Err(format_error(
            path,
            format!("OpenEXR cannot hold an image of {size}; add pixels and a plane"),
        ));
    }
    let mut attributes = LayerAttributes::default();
    let units = image.planes.iter().filter(|p| !p.unit.is_empty());
    let units =
        units.map(|p| (format!("{UNIT_PREFIX}{}", p.name), MetadataValue::Text(p.unit.clone())));
    for (key, value) in image.metadata.clone().into_iter().chain(units) {
        let attribute = name(path, &key)?;
        if !standard_names::ALL.contains(&attribute.as_slice()) {
            let value = match value {
                MetadataValue::Text(t) => AttributeValue::Text(text(&t)),
                MetadataValue::Number(n) => AttributeValue::F64(n),
            };
            attributes.other.insert(attribute, value);
        } else if !put_standard(&mut attributes, &key, &value) {
            let kind = match value {
                MetadataValue::Text(_) => "text",
                MetadataValue::Number(_) => "number",
            };
            let reason = format!(
                "OpenEXR gives `{key}` a meaning of its own, which is no {kind}; rename the entry"
            );
            return Err(format_error(path, reason));
        }
    }
    let mut channels = Vec::new();
    for p in &image.planes {
        channels.push(AnyChannel::new(name(path, &p.name)?, FlatSamples::F32(p.samples.clone())));
    }
    let size = (image.width as usize, image.height as usize);
    let layer =
        Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels.into()));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).map_err(|e| format_error(path, e))?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes);
    write_atomically(path, |w| w.write_all(&bytes)).map_err(io_error(path, "write"))
}

/// Reads the channels of the first part that has any; 16-bit and integer channels become f32.
/// Planes are sorted by name, as the format stores them. [`LayeredImage`]s that differ only in the
/// order of planes are equivalent.
pub fn read_exr(path: &Path) -> Result<LayeredImage, ImageError> {
    let bytes = std::fs::read(path).map_err(io_error(path, "read"))?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| format_error(path, format!("not a readable OpenEXR file: {e}")))?;
    let layer = image.layer_data;
    let size = |n: usize| {
        u32::try_from(n).map_err(|_| format_error(path, format!("{n} pixels along one side")))
    };
    let mut image = LayeredImage::new(size(layer.size.0)?, size(layer.size.1)?);
    let mut entries: Metadata = layer.attributes.other.iter().filter_map(metadata_entry).collect();
    entries.extend(standard_entries(layer.attributes));
    for channel in &layer.channel_data.list {
        let name = string(&channel.name);
        let unit = match entries.remove(&format!("{UNIT_PREFIX}{name}")) {
            Some(MetadataValue::Text(unit)) => unit,
            _ => String::new(),
        };
        if channel.sampling.0 != 1 || channel.sampling.1 != 1 {
            let reason = format!("channel `{name}` is subsampled; save it at full resolution");
            return Err(format_error(path, reason));
        }
        let samples = channel.sample_data.values_as_f32().collect();
        image.planes.push(Plane { name, unit, samples });
    }
    image.metadata = entries;
    image.check()?;
    Ok(image)
}

fn metadata_entry((key, value): (&Text, &AttributeValue)) -> Option<(String, MetadataValue)> {
    let value = match value {
        AttributeValue::Text(t) => MetadataValue::Text(string(t)),
        AttributeValue::F64(n) => MetadataValue::Number(*n),
        AttributeValue::F32(n) => MetadataValue::Number(*n as f64),
        AttributeValue::I32(n) => MetadataValue::Number(*n as f64),
        _ => return None,
    };
    Some((string(key), value))
}

// ---- attributes that the format defines ---------------------------------------------------------
/// The name of an attribute and its field in the crate's structure.
type Standard<T> = (&'static str, fn(&mut LayerAttributes) -> &mut Option<T>);

/// Standard texts.
const STANDARD_TEXTS: [Standard<Text>; 8] = [
    ("software", |a| &mut a.software_name),
    ("comments", |a| &mut a.comments),
    ("owner", |a| &mut a.owner),
    ("capDate", |a| &mut a.capture_date),
    ("view", |a| &mut a.view_name),
    ("wrapmodes", |a| &mut a.wrap_mode_name),
    ("renderingTransform", |a| &mut a.rendering_transform_name),
    ("lookModTransform", |a| &mut a.look_modification_transform_name),
];

/// Standard numeric attributes, all optional.
const STANDARD_NUMBERS: [Standard<f32>; 14] = [
    ("expTime", |a| &mut a.exposure),
    ("aperture", |a| &mut a.aperture),
    ("isoSpeed", |a| &mut a.iso_speed),
    ("focus", |a| &mut a.focus),
    ("near", |a| &mut a.near_clip_plane),
    ("far", |a| &mut a.far_clip_plane),
    ("fieldOfViewHorizontal", |a| &mut a.horizontal_field_of_view),
    ("fieldOfViewVertical", |a| &mut a.vertical_field_of_view),
    ("utcOffset", |a| &mut a.utc_offset),
    ("longitude", |a| &mut a.longitude),
    ("latitude", |a| &mut a.latitude),
    ("altitude", |a| &mut a.altitude),
    ("xDensity", |a| &mut a.horizontal_density),
    ("whiteLuminance", |a| &mut a.white_luminance),
];

/// Sets a standard attribute; returns false when there is none with this name and type.
fn put_standard(attributes: &mut LayerAttributes, key: &str, value: &MetadataValue) -> bool {
    match value {
        MetadataValue::Text(t) => {
            let Some((_, place)) = STANDARD_TEXTS.iter().find(|(k, _)| *k == key) else {
                return false;
            };
            *place(attributes) = Some(text(t));
        }
        MetadataValue::Number(n) => {
            let Some((_, place)) = STANDARD_NUMBERS.iter().find(|(k, _)| *k == key) else {
                return false;
            };
            *place(attributes) = Some(*n as f32);
        }
    }
    true
}

/// The standard attributes present in a file.
fn standard_entries(mut attributes: LayerAttributes) -> Metadata {
    let a = &mut attributes;
    let mut found = Metadata::new();
    for (key, place) in STANDARD_TEXTS {
        found.extend(place(a).take().map(|t| (key.to_string(), MetadataValue::Text(string(&t)))));
    }
    for (key, place) in STANDARD_NUMBERS {
        found.extend(
            place(a).take().map(|n| (key.to_string(), MetadataValue::Number(f64::from(n)))),
        );
    }
    found
}

// ---- texts --------------------------------------------------------------------------------------
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

/// The name of a channel or an attribute: not empty, without a zero byte, at most 255 bytes.
fn name(path: &Path, s: &str) -> Result<Text, ImageError> {
    if s.is_empty() || s.contains('\0') || s.len() > MAX_NAME_BYTES {
        let reason = format!(
            "`{}` cannot name a plane or a metadata entry: 1 to {MAX_NAME_BYTES} bytes, no zero",
            s.escape_debug()
        );
        return Err(format_error(path, reason));
    }
    Ok(text(s))
}

fn string(t: &Text) -> String {
    String::from_utf8_lossy(t.bytes()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> LayeredImage {
        let mut p = LayeredImage::new(5, 3);
        let ramp = |k: f32| (0..15).map(|i| i as f32 * k - 2.0).collect::<Vec<f32>>();
        p.add("R", "", ramp(0.1)).unwrap();
        p.add("deflection.X", "rad", ramp(1e-7)).unwrap();
        let odd = [f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE / 4.0, -0.0, 16_777_217.0];
        p.add("depth.Z", "m", odd.into_iter().cycle().take(15).collect()).unwrap();
        p.metadata.insert("command_line".into(), "render --größe 3 \"a b\"".into());
        p.metadata.insert("elapsed_secs".into(), 0.125.into());
        p
    }

    #[test]
    fn planes_units_and_metadata_come_back_bit_for_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.exr");
        write_exr(&path, &image()).unwrap();
        let back = read_exr(&path).unwrap();
        assert_eq!(back, image());
        for (a, b) in back.planes.iter().zip(&image().planes) {
            let bits = |p: &Plane| p.samples.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(a), bits(b), "{}", a.name);
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn two_files_of_an_image_have_the_same_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let mut image = image();
        for n in 0..12 {
            image.metadata.insert(format!("entry {n}"), f64::from(n).into());
        }
        let written = |n: usize| {
            let path = dir.path().join(format!("{n}.exr"));
            write_exr(&path, &image).unwrap();
            assert_eq!(read_exr(&path).unwrap(), image);
            std::fs::read(path).unwrap()
        };
        let first = written(0);
        for n in 1..5 {
            assert!(written(n) == first, "file {n} differs from the first");
        }
    }

    #[test]
    fn names_that_the_format_defines_become_its_own_attributes() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("standard.exr");
        let mut p = LayeredImage {
            metadata: super::super::metadata_of_this_run("bench", "1.2"),
            ..image()
        };
        for (key, _) in STANDARD_TEXTS {
            p.metadata.insert(key.into(), format!("a {key}").into());
        }
        for (n, (key, _)) in STANDARD_NUMBERS.into_iter().enumerate() {
            p.metadata.insert(key.into(), (n as f64 + 0.5).into());
        }
        p.metadata.insert(super::super::keys::SOFTWARE.into(), "bench 1.2".into());
        write_exr(&path, &p).unwrap();
        assert_eq!(read_exr(&path).unwrap(), p);
        let headers = exr::meta::MetaData::read_from_file(&path, true).unwrap().headers;
        let own = &headers[0].own_attributes;
        assert_eq!(own.software_name.as_ref().map(string).as_deref(), Some("bench 1.2"));
        assert!(own.other.keys().all(|k| !standard_names::ALL.contains(&k.as_slice())));
    }

    #[test]
    fn a_reserved_name_with_another_kind_of_value_is_refused_by_name() {
        for (key, value) in [
            ("software", 1.0.into()),
            ("expTime", "long".into()),
            ("channels", MetadataValue::from("R")),
        ] {
            let mut p = image();
            p.metadata.insert(key.into(), value);
            let message = write_exr(Path::new("never-written.exr"), &p).unwrap_err().to_string();
            assert!(message.contains(key) && message.contains("rename"), "{message}");
        }
    }

    #[test]
    fn nan_payloads_do_not_panic() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("nan.exr");
        let mut p = LayeredImage::new(1, 2);
        p.add("Y", "", vec![f32::NAN, 1.0]).unwrap();
        write_exr(&path, &p).unwrap();
        let back = read_exr(&path).unwrap();
        assert!(back.planes[0].samples[0].is_nan());
    }

    #[test]
    fn broken_files_are_errors_that_name_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.exr");
        write_exr(&path, &image()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in [0, 3, 20, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let message = read_exr(&path).unwrap_err().to_string();
            assert!(message.contains("p.exr"), "{cut}: {message}");
        }
        assert!(
            read_exr(&dir.path().join("absent.exr"))
                .unwrap_err()
                .to_string()
                .contains("absent.exr")
        );
    }

    #[test]
    fn images_that_a_file_cannot_hold_are_rejected() {
        let path = Path::new("never-written.exr");
        assert!(write_exr(path, &LayeredImage::new(4, 4)).is_err(), "no planes");
        let mut empty = LayeredImage::new(0, 4);
        empty.add("Y", "", vec![]).unwrap();
        assert!(write_exr(path, &empty).is_err(), "no pixels");
        let mut zero = LayeredImage::new(1, 1);
        zero.add("a\0b", "", vec![0.0]).unwrap();
        assert!(write_exr(path, &zero).unwrap_err().to_string().contains("a\\0b"));
        assert!(!path.exists());
    }
}
