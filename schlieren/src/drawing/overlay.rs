//! Draws a vector field over a picture, with a scale in its unit: arrows, or line integral
//! convolution.

use super::canvas::Canvas;
use super::lic::line_integral_convolution;
use super::scale::{in_unit, round_below};
use crate::render::Map;
use datasets::colormaps;
use serde::Serialize;
use std::str::FromStr;

/// Distance between arrows, in pixels.
const ARROW_PX: usize = 20;

/// How vectors are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// Arrows over the picture.
    Arrows,
    /// Noise along the vectors in the colours of their lengths, in place of the picture.
    Lic,
}

/// Which vectors are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Vectors {
    /// The deflection of rays, rad.
    Deflection,
    /// The displacement in the plane of focus, m; for BOS that of the background's dots.
    Displacement,
}

/// What is drawn over a picture: `arrows` or `lic`, of the `deflection` or the `displacement`.
///
/// ```
/// use schlieren::drawing::{Overlay, Style, Vectors};
/// let overlay: Overlay = "arrows:displacement".parse()?;
/// assert_eq!((overlay.style, overlay.vectors), (Style::Arrows, Some(Vectors::Displacement)));
/// assert!("dots".parse::<Overlay>().is_err());
/// # Ok::<(), schlieren::drawing::OverlayError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Overlay {
    /// How they are drawn.
    pub style: Style,
    /// Which they are; for `None` the displacement with BOS, else the deflection.
    pub vectors: Option<Vectors>,
}

/// A text that names no overlay.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not an overlay; there are: arrows, lic, each alone or with :deflection or \
     :displacement"
)]
pub struct OverlayError(String);

impl FromStr for Overlay {
    type Err = OverlayError;

    fn from_str(text: &str) -> Result<Overlay, OverlayError> {
        let wrong = || OverlayError(text.to_owned());
        let (style, vectors) = match text.split_once(':') {
            Some((style, of)) => (style, Some(of)),
            None => (text, None),
        };
        let style = match style {
            "arrows" => Style::Arrows,
            "lic" => Style::Lic,
            _ => return Err(wrong()),
        };
        let vectors = match vectors {
            None => None,
            Some("deflection") => Some(Vectors::Deflection),
            Some("displacement") => Some(Vectors::Displacement),
            Some(_) => return Err(wrong()),
        };
        Ok(Overlay { style, vectors })
    }
}

/// Draws an overlay on a picture of the map's size, with a scale in its unit. `pixel_m` is the side
/// of a pixel. Returns the value of the scale: the length of the longest arrow, or that of the
/// brightest colour.
///
/// ```
/// use schlieren::drawing::{Canvas, draw_overlay};
/// use schlieren::render::Map;
/// let map = Map { deflection_rad: vec![[3e-5, 0.0]; 64 * 64], ..Map::default() };
/// let mut canvas = Canvas::new(64, 64, [0.5; 3]);
/// let scale = draw_overlay(&mut canvas, &map, "arrows".parse()?);
/// assert_eq!(scale, 2e-5);
/// # Ok::<(), schlieren::drawing::OverlayError>(())
/// ```
///
/// Arrows point where light or dots go. Their common factor comes from the vectors: the 99th
/// percentile of their lengths is as long as the distance of two arrows.
pub fn draw_overlay(canvas: &mut Canvas, map: &Map, overlay: Overlay) -> f64 {
    let dots = !map.apparent_m.is_empty();
    let of = overlay.vectors.unwrap_or(match dots {
        true => Vectors::Displacement,
        false => Vectors::Deflection,
    });
    let (vectors, unit) = match of {
        Vectors::Deflection => (&map.deflection_rad, "rad"),
        Vectors::Displacement if dots => (&map.apparent_m, "m"),
        Vectors::Displacement => (&map.displacement_m, "m"),
    };
    let free = |i: usize| map.transmission.get(i).is_none_or(|t| *t > 0.0);
    let length = |v: &[f32; 2]| f64::from(v[0]).hypot(f64::from(v[1]));
    let mut lengths: Vec<f64> = vectors
        .iter()
        .enumerate()
        .filter(|(i, _)| free(*i))
        .map(|(_, v)| length(v))
        .filter(|l| l.is_finite())
        .collect();
    lengths.sort_unstable_by(f64::total_cmp);
    let largest = match lengths.len() {
        0 => 0.0,
        n => lengths[(n * 99 / 100).min(n - 1)],
    };
    let scale = match overlay.style {
        Style::Arrows => round_below(largest),
        // The colours end where the vectors do: a round number below left half of a jet in one.
        Style::Lic => largest,
    };
    match overlay.style {
        Style::Arrows => arrows(canvas, vectors, largest, &free),
        Style::Lic => lic(canvas, vectors, scale, &free),
    }
    legend(canvas, overlay.style, scale, largest, unit);
    scale
}

fn arrows(canvas: &mut Canvas, vectors: &[[f32; 2]], largest: f64, free: &impl Fn(usize) -> bool) {
    if largest <= 0.0 {
        return;
    }
    let (width, height) = (canvas.width, canvas.height);
    let first = |n: usize| (n % ARROW_PX) / 2 + ARROW_PX / 2;
    for y in (first(height).min(height / 2)..height).step_by(ARROW_PX) {
        for x in (first(width).min(width / 2)..width).step_by(ARROW_PX) {
            let i = y * width + x;
            let v = vectors[i].map(f64::from);
            let factor = ARROW_PX as f64 / largest;
            let [dx, dy] = v.map(|c| factor * c);
            let length = dx.hypot(dy);
            if !free(i) || length.is_nan() || length < 1.0 {
                continue;
            }
            let at = [x as f64 + 0.5, y as f64 + 0.5];
            let head = [at[0] + dx, at[1] - dy];
            // Dark around bright is seen on any ground.
            canvas.arrow(at, head, 2.6, [0.0; 3]);
            canvas.arrow(at, head, 1.2, [1.0, 0.6, 0.05]);
        }
    }
}

fn lic(canvas: &mut Canvas, vectors: &[[f32; 2]], scale: f64, free: &impl Fn(usize) -> bool) {
    let colors = colormaps::viridis([0.0, 1.0]);
    let grey = line_integral_convolution(vectors, canvas.width);
    for (i, pixel) in canvas.pixels.iter_mut().enumerate() {
        let length = f64::from(vectors[i][0]).hypot(f64::from(vectors[i][1]));
        let part = (length / scale.max(f64::MIN_POSITIVE)).min(1.0) as f32;
        if !free(i) || !length.is_finite() {
            *pixel = [0.0; 3];
            continue;
        }
        let [r, g, b, _] = colors.lookup(part);
        // Without a direction, as in undisturbed gas, the noise fades.
        let light = 1.0 + 1.2 * (grey[i] - 0.5) * (8.0 * part).min(1.0);
        *pixel = [r, g, b].map(|c| c * light);
    }
}

/// A scale in the lower left corner: an arrow, or the colours, with a length and its unit.
fn legend(canvas: &mut Canvas, style: Style, scale: f64, largest: f64, unit: &str) {
    let size = (canvas.width / 320).clamp(1, 4);
    let text = in_unit(scale, unit);
    let [text_width, text_height] = Canvas::text_size(&text, size).map(|n| n as i64);
    let bar = match style {
        Style::Arrows if largest > 0.0 => ARROW_PX as f64 * scale / largest,
        Style::Arrows => 0.0,
        Style::Lic => 48.0,
    };
    let pad = 3 * size as i64;
    let box_height = text_height + 2 * pad;
    let y = canvas.height as i64 - box_height;
    let bar_width = bar.ceil() as i64;
    canvas.fill([0, y], [text_width + bar_width + 3 * pad, box_height], [0.0; 3], 0.75);
    let middle = (y + box_height / 2) as f64;
    match style {
        Style::Arrows => {
            let from = [pad as f64, middle];
            canvas.arrow(from, [from[0] + bar, middle], 1.2, [1.0, 0.6, 0.05]);
        }
        Style::Lic => {
            let colors = colormaps::viridis([0.0, 1.0]);
            for x in 0..bar_width {
                let [r, g, b, _] = colors.lookup(x as f32 / (bar_width - 1) as f32);
                canvas.fill([pad + x, y + pad], [1, text_height], [r, g, b], 1.0);
            }
        }
    }
    let at = [(bar_width + 2 * pad) as f64, (y + pad) as f64];
    canvas.text(&text, at, size, [1.0; 3]);
}
