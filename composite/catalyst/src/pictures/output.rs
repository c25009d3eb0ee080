//! Files of pictures.

use datasets::image_io::{
    ImageError, LayeredImage, PngDepth, metadata_of_this_run, write_exr, write_png,
};
use rt_core::frame::{Frame, PlaneValues};
use std::path::{Path, PathBuf};

/// The file of a step: `{step}` and `{time}` of `pattern` replaced. Steps have six digits, so that
/// names sort.
pub fn file_of(pattern: &str, step: i64, time: f64) -> PathBuf {
    let (step, time) = (format!("{step:06}"), format!("{time}"));
    PathBuf::from(pattern.replace("{step}", &step).replace("{time}", &time))
}

pub(super) fn write_frame(frame: &Frame, file: &Path) -> Result<(), ImageError> {
    let mut image = LayeredImage::new(frame.width, frame.height);
    for plane in frame.planes() {
        let samples = match plane.values {
            PlaneValues::F32(v) => v.into_owned(),
            PlaneValues::U32(v) => v.iter().map(|&n| n as f32).collect(),
        };
        image.add(plane.name, plane.unit, samples)?;
    }
    write(image, file)
}

/// A photograph: 1 is all light of the source. PNG shows it as linear light.
pub(super) fn write_grey(
    grey: &[f32],
    [width, height]: [u32; 2],
    file: &Path,
) -> Result<(), ImageError> {
    let mut image = LayeredImage::new(width, height);
    image.add("Y", "1", grey.to_vec())?;
    write(image, file)
}

fn write(mut image: LayeredImage, file: &Path) -> Result<(), ImageError> {
    image.metadata = metadata_of_this_run("catalyst-rtsv", env!("CARGO_PKG_VERSION"));
    match file.extension().is_some_and(|e| e == "exr") {
        true => write_exr(file, &image),
        false => write_png(file, &image, PngDepth::Eight).map(drop),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_by_step() {
        assert_eq!(file_of("a-{step}.png", 12, 0.5), PathBuf::from("a-000012.png"));
        assert_eq!(file_of("t{time}-{step}.exr", 3, 0.25), PathBuf::from("t0.25-000003.exr"));
    }
}
