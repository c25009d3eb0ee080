//! The samples of a window (`vtkRenderWindow::SetMultiSamples`), where they change the picture.
//!
//! OpenGL covers each sample of a pixel by itself but lights a pixel once per triangle. So the
//! samples of a pixel differ only where something ends inside it: one ray through the centre of
//! each pixel finds these pixels, and only they get a ray for every sample. Which pixels these are
//! follows from the image alone, so the result does not depend on threads.

use rayon::prelude::*;
use rt_core::frame::Frame;
use std::sync::Arc;

/// Positions of a pixel's samples, in sixteenths of a pixel from its centre, y upwards: the
/// patterns of Direct3D 11, which Mesa's drivers have too.
const PATTERNS: [&[[i8; 2]]; 4] = [
    &[[4, 4], [-4, -4]],
    &[[-2, -6], [6, -2], [-6, 2], [2, 6]],
    &[[1, -3], [-1, 3], [5, 1], [-3, -5], [-5, 5], [-7, -1], [3, 7], [7, -7]],
    &[
        [1, 1],
        [-1, -3],
        [-3, 2],
        [4, -1],
        [-5, -2],
        [2, 5],
        [5, 3],
        [3, -5],
        [-2, 6],
        [0, -7],
        [-4, -6],
        [-6, 4],
        [-8, 0],
        [7, -4],
        [6, 7],
        [-7, -8],
    ],
];

/// Neighbours on one object whose colour bends by less than this are smooth: there the samples
/// would change the picture by about one level of 255. With 10 of 255, 0.07 % of an isosurface's
/// pixels are off by more than 8 levels, with 3 of 255, 0.05 %.
const BEND: f32 = 3.0 / 255.0;
/// Side of the squares of pixels whose samples are traced one after the other.
const SQUARE: usize = 8;
/// Pixels per row of the image that is made of samples: one tile of the renderer.
const ROW: usize = 32;

/// The pattern with at most `count` samples; `None` for fewer than two.
pub(crate) fn pattern(count: u32) -> Option<&'static [[i8; 2]]> {
    PATTERNS.into_iter().rev().find(|p| p.len() <= count as usize)
}

/// A pixel in which something ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DividedPixel {
    /// Its number in the window.
    pub(crate) pixel: u32,
    /// Bits of the sides on which something else begins: [`LEFT`] and following.
    pub(crate) sides: u8,
}

/// Bits of sides.
const LEFT: u8 = 1;
const RIGHT: u8 = 2;
const ABOVE: u8 = 4;
const BELOW: u8 = 8;

/// The sides that a sample lies towards. If the neighbours there show what the pixel's centre
/// shows, a straight border cannot lie between the centre and the sample, which is between the
/// three.
fn sides_of([dx, dy]: [i8; 2]) -> u8 {
    let across = [LEFT, 0, RIGHT][(dx.signum() + 1) as usize];
    across | [BELOW, 0, ABOVE][(dy.signum() + 1) as usize]
}

/// Pixels in which something ends, in squares, so that neighbours in the list are neighbours in the
/// image. The frame has colours and ids. The ids are those of the first opaque surfaces: VTK draws
/// translucent ones with one sample.
pub(crate) fn divided_pixels(frame: &Frame) -> Vec<DividedPixel> {
    let (width, height) = (frame.width as usize, frame.height as usize);
    if frame.instance.len() != width * height || frame.color.len() != width * height {
        return Vec::new();
    }
    let sides = |x: usize, y: usize| {
        let at = y * width + x;
        let along = |step: usize, before: bool, after: bool, bits: [u8; 2]| {
            let ends = [if before { at - step } else { at }, if after { at + step } else { at }];
            let other = |n: usize| frame.instance[n] != frame.instance[at];
            let face = |n: usize| frame.primitive[n] != frame.primitive[at];
            let (others, faces) = (ends.map(other), ends.map(face));
            let bends = || {
                let [a, b, c] = [ends[0], at, ends[1]].map(|i| &frame.color[i]);
                (0..4).any(|k| (a[k] - 2.0 * b[k] + c[k]).abs() > BEND)
            };
            let bent = (faces[0] || faces[1]) && bends();
            let bit = |k: usize| if others[k] || bent && faces[k] { bits[k] } else { 0 };
            bit(0) | bit(1)
        };
        along(1, x > 0, x + 1 < width, [LEFT, RIGHT])
            | along(width, y > 0, y + 1 < height, [ABOVE, BELOW])
    };
    let bands: Vec<Vec<DividedPixel>> = (0..height.div_ceil(SQUARE))
        .into_par_iter()
        .map(|band| {
            let rows = band * SQUARE..(band * SQUARE + SQUARE).min(height);
            let mut found = Vec::new();
            for left in (0..width).step_by(SQUARE) {
                for y in rows.clone() {
                    for x in left..(left + SQUARE).min(width) {
                        let sides = sides(x, y);
                        if sides != 0 {
                            found.push(DividedPixel { pixel: (y * width + x) as u32, sides });
                        }
                    }
                }
            }
            found
        })
        .collect();
    bands.concat()
}

/// An image that is made of samples, and what its pixels look at.
pub(crate) struct SampleImage {
    /// Pixels of the window that are divided.
    pixels: Vec<DividedPixel>,
    pattern: &'static [[i8; 2]],
    /// Pixel of the window for each sample in the image.
    owners: Vec<u32>,
    /// Rows of the image; it is [`SampleImage::WIDTH`] wide.
    pub(crate) height: u32,
    /// For each pixel of the image the point of the window that it looks at, in normalized device
    /// coordinates.
    pub(crate) points: Arc<Vec<[f64; 2]>>,
    /// For each the centre of the pixel that the sample belongs to: there OpenGL lights it.
    pub(crate) centres: Arc<Vec<[f64; 2]>>,
}

impl SampleImage {
    /// Pixels per row.
    pub(crate) const WIDTH: u32 = ROW as u32;

    /// The samples of `pixels` of a window of `width` by `height`.
    pub(crate) fn new(
        pixels: Vec<DividedPixel>,
        pattern: &'static [[i8; 2]],
        [width, height]: [u32; 2],
    ) -> SampleImage {
        let sides: Vec<u8> = pattern.iter().map(|offset| sides_of(*offset)).collect();
        let taken = |d: &DividedPixel| sides.iter().filter(|s| *s & d.sides != 0).count();
        let count: usize = pixels.iter().map(taken).sum();
        let rows = count.div_ceil(ROW * ROW) * ROW;
        let (mut points, mut centres) = (vec![[0.0; 2]; ROW * rows], vec![[0.0; 2]; ROW * rows]);
        let mut owners = vec![0; ROW * rows];
        let mut number = 0;
        let [across, down] = [2.0 / f64::from(width), 2.0 / f64::from(height)];
        for d in &pixels {
            let [x, y] = [d.pixel % width, d.pixel / width].map(|v| f64::from(v) + 0.5);
            let centre = [x * across - 1.0, 1.0 - y * down];
            for (offset, _) in pattern.iter().zip(&sides).filter(|(_, s)| *s & d.sides != 0) {
                let [dx, dy] = offset.map(|v| f64::from(v) / 16.0);
                let at = place(number);
                points[at] = [centre[0] + dx * across, centre[1] + dy * down];
                (centres[at], owners[at]) = (centre, d.pixel);
                number += 1;
            }
        }
        // The rest looks at the last sample, which is in the cache.
        if let Some(last) = number.checked_sub(1).map(place) {
            for at in (number..points.len()).map(place) {
                (points[at], centres[at], owners[at]) = (points[last], centres[last], owners[last]);
            }
        }
        let (points, centres) = (Arc::new(points), Arc::new(centres));
        SampleImage { pixels, pattern, owners, height: rows as u32, points, centres }
    }

    /// The pixel of the window that each pixel of the image belongs to.
    pub(crate) fn owners(&self) -> &[u32] {
        &self.owners
    }

    /// Puts the mean colours of the samples, and the depth of the first, into the window's image.
    /// Samples that no border can reach have the colour of the pixel's centre. A sample is no
    /// brighter than a window can store.
    pub(crate) fn resolve(&self, samples: &Frame, frame: &mut Frame) {
        let sides: Vec<u8> = self.pattern.iter().map(|offset| sides_of(*offset)).collect();
        let weight = 1.0 / self.pattern.len() as f32;
        let mut number = 0;
        for d in &self.pixels {
            let centre = frame.color[d.pixel as usize];
            let mut mean = [0.0; 4];
            for (s, side) in sides.iter().enumerate() {
                let mut color = centre;
                if side & d.sides != 0 {
                    let at = place(number);
                    color = samples.color[at];
                    if s == 0 {
                        frame.depth[d.pixel as usize] = samples.depth[at];
                    }
                    number += 1;
                }
                for (m, c) in mean.iter_mut().zip(color) {
                    *m += weight * c.clamp(0.0, 1.0);
                }
            }
            frame.color[d.pixel as usize] = mean;
        }
    }
}

/// Pixel of the image for a sample: the renderer goes through a tile along a Morton curve, and so
/// does the list.
fn place(number: usize) -> usize {
    let (tile, slot) = (number / (ROW * ROW), number % (ROW * ROW));
    let every_second = |v: usize| (0..5).fold(0, |sum, bit| sum | (v >> (2 * bit) & 1) << bit);
    (tile * ROW + every_second(slot >> 1)) * ROW + every_second(slot)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::Bridge;
    use crate::input::{Cells, Color, Ids, Points, Property, Shape, Surface, View};
    use crate::options::Options;
    use rt_core::glam::DMat4;

    fn frame(width: u32, height: u32, object: impl Fn(u32, u32) -> u32) -> Frame {
        let at = |i: u32| object(i % width, i / width);
        let all = 0..width * height;
        Frame {
            width,
            height,
            color: all.clone().map(|i| [at(i) as f32; 4]).collect(),
            depth: vec![1.0; (width * height) as usize],
            instance: all.clone().map(at).collect(),
            primitive: all.map(|_| 0).collect(),
            ..Frame::default()
        }
    }

    #[test]
    fn every_sample_lies_in_its_pixel_and_only_those_towards_a_border_are_taken() {
        let all = LEFT | RIGHT | ABOVE | BELOW;
        for samples in [2u32, 4, 8, 16] {
            let pixels = [(3, all), (4, RIGHT), (17, ABOVE), (90, LEFT | BELOW)]
                .map(|(pixel, sides)| DividedPixel { pixel, sides })
                .to_vec();
            let image = SampleImage::new(pixels, pattern(samples).unwrap(), [10, 10]);
            assert_eq!(image.points.len(), (SampleImage::WIDTH * image.height) as usize);
            for (point, &owner) in image.points.iter().zip(image.owners()) {
                let [x, y] = [5.0 * (point[0] + 1.0), 5.0 * (1.0 - point[1])];
                let centre = [owner % 10, owner / 10].map(|v| f64::from(v) + 0.5);
                let near = |a: f64, b: f64| (a - b).abs() < 0.5 + 1e-9;
                assert!(near(x, centre[0]) && near(y, centre[1]), "{samples}: {point:?}, {owner}");
                assert!(owner != 4 || x > centre[0], "only to the right");
                assert!(owner != 17 || y < centre[1], "only above");
            }
            assert_eq!(image.owners().iter().filter(|o| **o == 3).count(), samples as usize);
        }
    }

    #[test]
    fn a_window_has_the_largest_pattern_that_it_holds() {
        let len = |count| pattern(count).map(<[_]>::len);
        assert_eq!([0, 1].map(len), [None; 2]);
        assert_eq!([2, 4, 6, 8, 32].map(len), [2, 4, 4, 8, 16].map(Some));
    }

    #[test]
    fn only_pixels_beside_another_object_are_divided() {
        // A border between columns 9 and 10.
        let image = frame(40, 20, |x, _| u32::from(x > 9));
        let mut found: Vec<(u32, u8)> =
            divided_pixels(&image).iter().map(|d| (d.pixel, d.sides)).collect();
        found.sort_unstable();
        let expected: Vec<(u32, u8)> =
            (0..20).flat_map(|y| [(y * 40 + 9, RIGHT), (y * 40 + 10, LEFT)]).collect();
        assert_eq!(found, expected);
        assert!(divided_pixels(&frame(40, 20, |_, _| 0)).is_empty());
    }

    #[test]
    fn a_crease_divides_a_surface_and_a_ramp_does_not() {
        let ids = |x: u32| x;
        let with = |color: fn(u32) -> f32| {
            let mut image = frame(40, 3, |_, _| 0);
            for (i, c) in image.color.iter_mut().enumerate() {
                *c = [color(i as u32 % 40); 4];
            }
            image.primitive = (0..120).map(|i| ids(i % 40)).collect();
            divided_pixels(&image).len()
        };
        assert_eq!(with(|x| x as f32 * 0.02), 6, "the two borders of the image only");
        assert_eq!(with(|x| if x < 20 { 0.2 } else { 0.5 }), 6);
    }

    fn picture(threads: usize, window_samples: u32) -> (Vec<[u8; 4]>, Vec<f32>) {
        let points: Vec<[f32; 3]> = (0..60)
            .flat_map(|i| {
                let (a, r) = (i as f32 * 0.7, 0.1 + 0.013 * i as f32);
                let (x, y, z) = (r * a.cos(), r * a.sin(), 0.01 * i as f32 - 0.3);
                [[x, y, z], [x + 0.13, y + 0.02, z], [x - 0.03, y + 0.17, z + 0.02]]
            })
            .collect();
        let (offsets, ids): (Vec<i64>, Vec<i64>) =
            ((0..=60).map(|i| 3 * i).collect(), (0..180).collect());
        let polys = Cells { offsets: Ids::I64(&offsets), connectivity: Ids::I64(&ids) };
        let mut bridge = Bridge::new();
        bridge.begin(&Options { threads: Some(threads), ..Options::default() });
        bridge.add_surface(&Surface {
            name: "chips",
            shape: Shape::polygons(1, Points::F32(&points), polys),
            world_from_data: DMat4::IDENTITY,
            color: Color::Material,
            texture: None,
            maps: None,
            property: Property { lighting: false, ..Property::default() },
            back: None,
            glyphs: None,
        });
        let view = View {
            clip_from_world: DMat4::IDENTITY,
            viewer: None,
            width: 150,
            height: 130,
            background: [[0.0; 3]; 2],
            interactive: false,
            shadows: false,
            samples: 0,
            window_samples,
            one_layer: false,
            lens: None,
        };
        let image = bridge.render(&view).expect("an image");
        (image.opaque.clone(), image.depth.clone())
    }

    #[test]
    fn samples_do_not_depend_on_threads_and_change_only_borders() {
        let [one, four] = [1, 3].map(|threads| picture(threads, 4));
        assert_eq!(one, four);
        let (plain, _) = picture(2, 0);
        let partly = one.0.iter().filter(|c| c[3] % 255 != 0).count();
        assert!(partly > 500, "{partly} pixels are covered in part");
        assert!(plain.iter().all(|c| c[3] % 255 == 0));
        let changed = one.0.iter().zip(&plain).filter(|(a, b)| a != b).count();
        // A gap may pass between all samples, through the centre of its pixel.
        assert!((partly..partly + 4).contains(&changed), "{changed} changed, {partly} in part");
        // Coverage is in quarters.
        assert!(one.0.iter().all(|c| [0, 64, 128, 191, 255].contains(&c[3])), "{:?}", one.0);
    }
}
