//! Rectangles of an image: the layers of each, one after the other.
use rt_core::frame::{Frame, Layers};
use rt_core::render::Crop;

/// Words of a pixel with these layers.
pub(in crate::render) fn words_per_pixel(layers: Layers) -> usize {
    let sizes = [
        (Layers::COLOR, 4),
        (Layers::DEPTH, 1),
        (Layers::DISTANCE, 1),
        (Layers::NORMAL, 3),
        (Layers::IDS, 2),
        (Layers::COST, 1),
    ];
    sizes.iter().filter(|(layer, _)| layers.contains(*layer)).map(|(_, words)| words).sum()
}

/// Encodes all layers of a rectangle.
pub(in crate::render) fn write_image(image: &Frame, out: &mut Vec<u32>) {
    let float = |v: &f32| v.to_bits();
    out.extend(image.color.as_flattened().iter().map(float));
    out.extend(image.depth.iter().map(float));
    out.extend(image.distance.iter().map(float));
    out.extend(image.normal.as_flattened().iter().map(float));
    out.extend(&image.instance);
    out.extend(&image.primitive);
    out.extend(image.cost.iter().map(float));
}

/// Writes the output of [`write_image`] for each of `areas` into the image. `None` when the words
/// are too few or too many, or an area is not inside the image.
pub(in crate::render) fn read_images(
    image: &mut Frame,
    areas: impl Iterator<Item = Crop>,
    words: &[u32],
) -> Option<()> {
    let stride = image.width as usize;
    let mut rest = words;
    for area in areas {
        let mut reader = ImageReader { area, stride, rest };
        reader.floats(image.color.as_flattened_mut(), 4)?;
        reader.floats(&mut image.depth, 1)?;
        reader.floats(&mut image.distance, 1)?;
        reader.floats(image.normal.as_flattened_mut(), 3)?;
        reader.layer(&mut image.instance, 1, |w| w)?;
        reader.layer(&mut image.primitive, 1, |w| w)?;
        reader.floats(&mut image.cost, 1)?;
        rest = reader.rest;
    }
    rest.is_empty().then_some(())
}

/// A rectangle that is being read into the image.
struct ImageReader<'a> {
    area: Crop,
    /// Pixels of a row of the image.
    stride: usize,
    rest: &'a [u32],
}

impl ImageReader<'_> {
    fn floats(&mut self, layer: &mut [f32], channels: usize) -> Option<()> {
        self.layer(layer, channels, f32::from_bits)
    }

    /// Reads the next words into a layer of `channels` words per pixel; a layer that the image does
    /// not have takes none.
    fn layer<T>(
        &mut self,
        layer: &mut [T],
        channels: usize,
        value: impl Fn(u32) -> T,
    ) -> Option<()> {
        if layer.is_empty() {
            return Some(());
        }
        let Crop { x, y, width, height } = self.area;
        for row in y..y + height {
            let first = (row as usize * self.stride + x as usize) * channels;
            let out = layer.get_mut(first..first + width as usize * channels)?;
            let (words, rest) = self.rest.split_at_checked(out.len())?;
            self.rest = rest;
            out.iter_mut().zip(words).for_each(|(o, w)| *o = value(*w));
        }
        Some(())
    }
}
