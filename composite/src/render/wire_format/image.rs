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

#[cfg(test)]
mod tests {
    use super::*;

    /// A different number for each word.
    fn image(width: u32, height: u32, layers: Layers, first: u32) -> Frame {
        let mut image = Frame::blank(width, height, layers, 1.0);
        let words: Vec<u32> =
            (first..).take((width * height) as usize * words_per_pixel(layers)).collect();
        let whole = Crop { x: 0, y: 0, width, height };
        read_images(&mut image, std::iter::once(whole), &words).unwrap();
        image
    }

    #[test]
    fn rectangles_come_back_at_their_places_with_the_layers_that_there_are() {
        for layers in [Layers::ALL, Layers::COLOR, Layers::DEPTH | Layers::IDS] {
            let (left, right) = (image(3, 2, layers, 1), image(2, 2, layers, 1000));
            let mut words = Vec::new();
            write_image(&left, &mut words);
            write_image(&right, &mut words);
            assert_eq!(words.len(), 10 * words_per_pixel(layers));
            let areas = [(0, 3), (3, 2)].map(|(x, width)| Crop { x, y: 1, width, height: 2 });
            let blank = Frame::blank(5, 4, layers, 1.0);
            let mut joined = blank.clone();
            read_images(&mut joined, areas.into_iter(), &words).unwrap();
            for (part, x) in [(&left, 0), (&right, 3)] {
                for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let (at, there) = (part.index(i, j), joined.index(x + i, 1 + j));
                    assert_eq!(part.color.get(at), joined.color.get(there));
                    assert_eq!(part.depth.get(at), joined.depth.get(there));
                    assert_eq!(part.normal.get(at), joined.normal.get(there));
                    assert_eq!(part.primitive.get(at), joined.primitive.get(there));
                    assert_eq!(part.cost.get(at), joined.cost.get(there));
                }
            }
            assert_eq!(joined.depth.first(), blank.depth.first(), "outside of both");

            // ---- Too few words, too many, and a place that is not in the image.
            let mut image = blank.clone();
            let short = &words[..words.len() - 1];
            assert_eq!(read_images(&mut image, areas.into_iter(), short), None);
            let long = [&words[..], &[0]].concat();
            assert_eq!(read_images(&mut image, areas.into_iter(), &long), None);
            let below = areas.map(|area| Crop { y: 3, ..area });
            assert_eq!(read_images(&mut image, below.into_iter(), &words), None);
        }
    }
}
