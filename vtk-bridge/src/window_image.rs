//! Converts rt-core's frame to the format of the window: 8-bit colour if every pixel is opaque,
//! premultiplied floating-point colour otherwise, and OpenGL's depth.

use crate::bridge::{BridgeError, RenderInputs, ms};
use crate::input::View;
use crate::materials::Encoding;
use crate::window_samples::{SampleImage, divided_pixels, pattern};
use rayon::prelude::*;
use rt_core::effects::Effects;
use rt_core::environment::Background;
use rt_core::frame::{Frame, Layers};
use rt_core::ray_stats::RayStats;
use rt_core::render::{RenderOptions, Renderer};
use std::sync::Arc;
use std::time::Instant;

/// An image; rows start at the top.
#[derive(Debug, Clone, Default)]
pub struct WindowImage {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// RGBA with alpha 255 where a ray hit something, else 0. Empty if [`WindowImage::blended`] is
    /// not.
    pub opaque: Vec<[u8; 4]>,
    /// Premultiplied RGBA if some pixels are translucent; else empty.
    pub blended: Vec<[f32; 4]>,
    /// Window depth of the first opaque surface, 1 where there is none.
    pub depth: Vec<f32>,
    /// Window depth of the first surface, opaque or not; only with [`WindowImage::blended`], and
    /// without [`WindowImage::straight`].
    pub first_depth: Vec<f32>,
    /// [`WindowImage::blended`] as one layer for [`View::one_layer`], else empty: RGBA, not
    /// premultiplied, 65535 for 1. Opaque, with the colour of everything in front of it, where
    /// [`WindowImage::depth`] is below 1. Blended over what OpenGL drew, with that depth, it gives
    /// the window. Also empty where a pixel is brighter than its opacity allows, as in highlights,
    /// because such a colour has no straight form below 1.
    pub straight: Vec<[u16; 4]>,
}

/// Result of drawing.
pub(crate) struct DrawResult {
    pub(crate) rays: RayStats,
    pub(crate) warnings: Vec<String>,
    pub(crate) trace_ms: f64,
    pub(crate) convert_ms: f64,
}

/// Pixels per task.
const CHUNK: usize = 1 << 14;

impl WindowImage {
    /// Background that reflected and refracted rays see.
    pub(crate) fn gradient_background(view: &View) -> Background {
        let [bottom, top] = view.background;
        Background::Gradient { bottom, top }
    }

    /// Renders. The result is averaged with `mean_of` earlier images of the same scene.
    pub(crate) fn draw(
        &mut self,
        renderer: &mut Renderer,
        inputs: &RenderInputs<'_>,
        view: &View,
        mean_of: u32,
    ) -> Result<DrawResult, BridgeError> {
        let start = Instant::now();
        let mixed = inputs.encodings.windows(2).any(|e| e[0] != e[1]);
        let effects = inputs.options.effects.unwrap_or(Effects::NONE);
        let soft_edges = inputs.options.samples > 1 || effects.contains(Effects::DEPTH_OF_FIELD);
        let see_through = Effects::TRANSPARENCY | Effects::VOLUMES;
        let blend = effects.intersects(see_through) || soft_edges || inputs.averaged;
        let pattern = pattern(view.window_samples).filter(|_| !soft_edges);
        let layers = Layers::COLOR | Layers::DEPTH;
        let with_ids = mixed || !inputs.edges.is_empty() || pattern.is_some();
        let options = RenderOptions {
            layers: if with_ids { layers | Layers::IDS } else { layers },
            // Interpolating an opacity of 1 gives slightly less than 1, so an alpha that rounds to
            // 255 of 255 is opaque.
            depth_min_opacity: if effects.contains(Effects::TRANSPARENCY) {
                1.0 - 1.0 / 512.0
            } else {
                0.0
            },
            ..inputs.options.clone()
        };
        let traced = Traced::new(renderer, inputs, &options, mixed)?;
        let Traced { mut frame, lit_lines, mut rays, warnings } = traced;
        let opaque_background = !matches!(inputs.scene.background, Background::Transparent);
        // One layer needs no depth of what is translucent, but to clear the background and to hide
        // lines.
        let one_layer = view.one_layer && !opaque_background && inputs.edges.is_empty();
        let mut first_depth = if one_layer {
            Vec::new()
        } else {
            first_depth(renderer, inputs, &options, view, &frame.depth)?
        };
        let mut trace_ms = ms(start);

        let start = Instant::now();
        if opaque_background {
            clear_background(&mut frame, &first_depth);
        }
        crate::edges::draw(&mut frame, &lit_lines, &first_depth, inputs.edges, view);
        let mut convert_ms = ms(start);
        if let Some(pattern) = pattern {
            let start = Instant::now();
            let pixels = divided_pixels(&frame);
            if !pixels.is_empty() {
                let image = SampleImage::new(pixels, pattern, [view.width, view.height]);
                let options = RenderOptions {
                    width: SampleImage::WIDTH,
                    height: image.height,
                    points: Some(Arc::clone(&image.points)),
                    shading_points: Some(Arc::clone(&image.centres)),
                    ..options.clone()
                };
                let mut samples = Traced::new(renderer, inputs, &options, mixed)?;
                if opaque_background {
                    let first_depth = first_surface_depth(renderer, inputs, &options)?;
                    clear_background(&mut samples.frame, &first_depth);
                }
                if !inputs.edges.is_empty() {
                    // As in OpenGL, a pixel's samples have the lines of its centre.
                    let owners = image.owners();
                    let lines = &samples.lit_lines;
                    crate::edges::draw_inside(
                        &mut samples.frame,
                        lines,
                        inputs.edges,
                        view,
                        |at| owners[at] as usize,
                    );
                }
                image.resolve(&samples.frame, &mut frame);
                rays += samples.rays;
            }
            trace_ms += ms(start);
        }

        let start = Instant::now();
        (self.width, self.height) = (view.width, view.height);
        self.straight.clear();
        std::mem::swap(&mut self.depth, &mut frame.depth);
        if blend {
            self.opaque.clear();
            if mean_of > 0 && self.blended.len() == frame.color.len() {
                let w = 1.0 / (mean_of as f32 + 1.0);
                let mix = |(old, new): (&mut [f32; 4], &[f32; 4])| {
                    *old = std::array::from_fn(|c| old[c] + (new[c] - old[c]) * w);
                };
                self.blended.par_iter_mut().with_min_len(CHUNK).zip(&frame.color).for_each(mix);
            } else {
                std::mem::swap(&mut self.blended, &mut frame.color);
            }
            let pixels = self.blended.par_iter().with_min_len(CHUNK).zip(&self.depth);
            if view.one_layer && pixels.clone().all(|(c, depth)| has_straight(*c, *depth)) {
                pixels.map(|(c, depth)| straight(*c, *depth)).collect_into_vec(&mut self.straight);
            } else if one_layer {
                first_depth = self::first_depth(renderer, inputs, &options, view, &self.depth)?;
            }
            if !inputs.edges.is_empty() {
                first_depth
                    .iter_mut()
                    .zip(&self.depth)
                    .for_each(|(first, own)| *first = first.min(*own));
            }
            self.first_depth = if first_depth.is_empty() && self.straight.is_empty() {
                self.depth.clone()
            } else {
                first_depth
            };
        } else {
            self.blended.clear();
            self.first_depth.clear();
            let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
            let pixels = frame.color.par_iter().with_min_len(CHUNK);
            // Where the window's samples are taken, alpha is the part of a pixel that is covered.
            let partly = |c: &[f32; 4]| pattern.is_some() && c[3] > 0.0 && c[3] < 1.0;
            pixels
                .map(|c| {
                    let [r, g, b, a] = *c;
                    if partly(c) { [r / a, g / a, b / a, a].map(byte) } else { c.map(byte) }
                })
                .collect_into_vec(&mut self.opaque);
        }
        renderer.recycle(frame);
        convert_ms += ms(start);
        Ok(DrawResult { rays, warnings, trace_ms, convert_ms })
    }
}

/// Whether no part of a colour is greater than its opacity by more than rounding.
fn has_straight([r, g, b, a]: [f32; 4], depth: f32) -> bool {
    depth < 1.0 || r.max(g).max(b) <= a + 1.0 / 512.0
}

/// See [`WindowImage::straight`].
fn straight([r, g, b, a]: [f32; 4], depth: f32) -> [u16; 4] {
    // Two bytes, since a product of two roundings to one byte is off by more than one level.
    let number = |v: f32| (v.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16;
    if depth < 1.0 {
        [r, g, b, 1.0].map(number)
    } else if a > 0.0 {
        [r / a, g / a, b / a, a].map(number)
    } else {
        [0; 4]
    }
}

/// What one image of rays gives, encoded for the window.
struct Traced {
    frame: Frame,
    /// See [`RenderInputs::lines`]; empty without.
    lit_lines: Vec<[f32; 4]>,
    rays: RayStats,
    warnings: Vec<String>,
}

impl Traced {
    fn new(
        renderer: &mut Renderer,
        inputs: &RenderInputs<'_>,
        options: &RenderOptions,
        mixed: bool,
    ) -> Result<Traced, BridgeError> {
        let output = renderer.render(inputs.scene, inputs.camera, options)?;
        let mut frame = output.frame;
        let mut lit_lines = match inputs.lines {
            Some(lines) => {
                let wanted = if mixed { Layers::COLOR | Layers::IDS } else { Layers::COLOR };
                let options = RenderOptions { layers: wanted, ..options.clone() };
                renderer.render(lines, inputs.camera, &options)?.frame
            }
            None => Frame::default(),
        };
        encode(&mut frame, inputs.encodings, mixed);
        encode(&mut lit_lines, inputs.encodings, mixed);
        Ok(Traced {
            frame,
            lit_lines: lit_lines.color,
            rays: output.report.rays,
            warnings: output.report.warnings,
        })
    }
}

/// Depth of the first thing in each pixel, opaque or not, where that may not be the frame's
/// `depth`; else empty. Volumes are at their middle.
fn first_depth(
    renderer: &mut Renderer,
    inputs: &RenderInputs<'_>,
    options: &RenderOptions,
    view: &View,
    depth: &[f32],
) -> Result<Vec<f32>, BridgeError> {
    let effects = inputs.options.effects.unwrap_or(Effects::NONE);
    let opaque_background = !matches!(inputs.scene.background, Background::Transparent);
    let mut first = if effects.contains(Effects::TRANSPARENCY) || opaque_background {
        first_surface_depth(renderer, inputs, options)?
    } else {
        Vec::new()
    };
    if effects.contains(Effects::VOLUMES) {
        if first.is_empty() {
            first.extend_from_slice(depth);
        }
        crate::volumes::place_in_depth(&inputs.scene.volumes, view, &mut first);
    }
    Ok(first)
}

/// Depth of the first surface in each pixel, opaque or not, 1 where there is none.
fn first_surface_depth(
    renderer: &mut Renderer,
    inputs: &RenderInputs<'_>,
    options: &RenderOptions,
) -> Result<Vec<f32>, BridgeError> {
    let depth_only = RenderOptions {
        layers: Layers::DEPTH,
        samples: 1,
        depth_min_opacity: inputs.options.depth_min_opacity,
        ..options.clone()
    };
    Ok(renderer.render(inputs.scene, inputs.camera, &depth_only)?.frame.depth)
}

/// Removes the background that reflections and refractions needed: pixels without a hit belong to
/// the window.
fn clear_background(frame: &mut Frame, first_depth: &[f32]) {
    let clear = |(c, d): (&mut [f32; 4], &f32)| {
        if *d >= 1.0 {
            *c = [0.0; 4];
        }
    };
    frame.color.par_iter_mut().with_min_len(CHUNK).zip(first_depth).for_each(clear);
}

/// See [`Encoding`].
fn encode(frame: &mut Frame, encodings: &[Encoding], mixed: bool) {
    let encoded = |c: &mut [f32; 4], encoding: Encoding| {
        let a = c[3];
        if a > 0.0 && encoding != Encoding::Direct {
            for v in &mut c[..3] {
                *v = a * encoding.encoded(*v / a);
            }
        }
    };
    let colors = frame.color.par_iter_mut().with_min_len(CHUNK);
    if mixed {
        colors.zip(&frame.instance).for_each(|(c, i)| {
            if let Some(encoding) = encodings.get(*i as usize) {
                encoded(c, *encoding);
            }
        });
    } else if let Some(encoding) = encodings.first().filter(|e| **e != Encoding::Direct) {
        colors.for_each(|c| encoded(c, *encoding));
    }
}

#[cfg(test)]
mod tests {
    use super::{has_straight, straight};

    #[test]
    fn one_layer_is_opaque_where_a_surface_is_and_straight_elsewhere() {
        assert_eq!(straight([0.5, 0.25, 0.0, 0.9], 0.3), [32768, 16384, 0, 65535]);
        assert_eq!(straight([0.25, 0.125, 0.0, 0.5], 1.0), [32768, 16384, 0, 32768]);
        assert_eq!(straight([0.0; 4], 1.0), [0; 4]);
        // A highlight in front of nothing has more colour than opacity.
        assert!(!has_straight([0.5, 0.0, 0.0, 0.25], 1.0));
        assert!(has_straight([0.5, 0.0, 0.0, 0.25], 0.3) && has_straight([0.0; 4], 1.0));
        assert_eq!(straight([f32::NAN, 0.0, 0.0, 1.0], 0.0)[0], 0);
    }
}
