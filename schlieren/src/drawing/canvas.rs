//! A picture to draw on.

use super::font;
use crate::cutoff::Rgb;

/// Pixels with rectangles, lines, text and other pictures drawn on them. What lies outside is left
/// out.
#[derive(Debug, Clone, PartialEq)]
pub struct Canvas {
    /// Pixels per row.
    pub width: usize,
    /// Rows; row 0 is the top.
    pub height: usize,
    /// Linear colours, row by row from the top; 1 is white.
    pub pixels: Vec<Rgb>,
}

impl Canvas {
    /// A canvas of one colour.
    ///
    /// ```
    /// use schlieren::drawing::Canvas;
    /// let mut canvas = Canvas::new(60, 12, [0.0; 3]);
    /// canvas.text("5 mm", [2.0, 2.0], 1, [1.0; 3]);
    /// assert!(canvas.pixels.iter().any(|p| *p == [1.0; 3]));
    /// assert_eq!(Canvas::text_size("5 mm", 1), [23, 7]);
    /// ```
    pub fn new(width: usize, height: usize, color: Rgb) -> Canvas {
        Canvas { width, height, pixels: vec![color; width * height] }
    }

    fn set(&mut self, x: i64, y: i64, color: Rgb, cover: f32) {
        if (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y) {
            let pixel = &mut self.pixels[y as usize * self.width + x as usize];
            for (p, c) in pixel.iter_mut().zip(color) {
                *p += cover * (c - *p);
            }
        }
    }

    /// Fills a rectangle, `cover` from 0 (not at all) to 1.
    pub fn fill(&mut self, [x, y]: [i64; 2], [width, height]: [i64; 2], color: Rgb, cover: f32) {
        for j in y.max(0)..(y + height).min(self.height as i64) {
            for i in x.max(0)..(x + width).min(self.width as i64) {
                self.set(i, j, color, cover);
            }
        }
    }

    /// Copies another picture to this place.
    pub fn paste(&mut self, pixels: &[Rgb], width: usize, [x, y]: [i64; 2]) {
        for (n, color) in pixels.iter().enumerate() {
            self.set(x + (n % width) as i64, y + (n / width) as i64, *color, 1.0);
        }
    }

    /// Width and height of a line of text, in pixels.
    pub fn text_size(text: &str, scale: usize) -> [usize; 2] {
        let letters = text.chars().count();
        [(letters * (font::WIDTH + 1)).saturating_sub(1) * scale, font::HEIGHT * scale]
    }

    /// Writes a line of text with its upper left corner at a place; each pixel of the font is
    /// `scale` pixels wide.
    pub fn text(&mut self, text: &str, at: [f64; 2], scale: usize, color: Rgb) {
        let size = scale as i64;
        let [x0, y0] = at.map(|c| c.round() as i64);
        for (n, letter) in text.chars().enumerate() {
            let x = x0 + (n * (font::WIDTH + 1)) as i64 * size;
            for (row, bits) in font::rows(letter).into_iter().enumerate() {
                for column in (0..font::WIDTH).filter(|c| bits >> (font::WIDTH - 1 - c) & 1 == 1) {
                    let at = [x + column as i64 * size, y0 + row as i64 * size];
                    self.fill(at, [size, size], color, 1.0);
                }
            }
        }
    }

    /// Draws a straight line of this width with soft edges.
    pub fn line(&mut self, a: [f64; 2], b: [f64; 2], width: f64, color: Rgb) {
        let along = [b[0] - a[0], b[1] - a[1]];
        let length2 = along[0] * along[0] + along[1] * along[1];
        if !length2.is_finite() {
            return;
        }
        let reach = 0.5 * width + 1.0;
        let range = |c: usize, most: usize| {
            let low = (a[c].min(b[c]) - reach).floor().max(0.0) as i64;
            low..(a[c].max(b[c]) + reach).ceil().min(most as f64) as i64
        };
        for y in range(1, self.height) {
            for x in range(0, self.width) {
                let p = [x as f64 + 0.5 - a[0], y as f64 + 0.5 - a[1]];
                let t = if length2 > 0.0 {
                    ((p[0] * along[0] + p[1] * along[1]) / length2).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let distance = (p[0] - t * along[0]).hypot(p[1] - t * along[1]);
                let cover = (0.5 * width + 0.5 - distance).clamp(0.0, 1.0);
                if cover > 0.0 {
                    self.set(x, y, color, cover as f32);
                }
            }
        }
    }

    /// Draws an arrow with its head at `b`.
    pub fn arrow(&mut self, a: [f64; 2], b: [f64; 2], width: f64, color: Rgb) {
        let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
        let length = dx.hypot(dy);
        self.line(a, b, width, color);
        if length > 2.0 {
            let head = (0.35 * length).clamp(2.5, 8.0 * width);
            let [ux, uy] = [dx / length, dy / length];
            for side in [-0.5, 0.5] {
                let back = [b[0] - head * (ux + side * uy), b[1] - head * (uy - side * ux)];
                self.line(b, back, width, color);
            }
        }
    }
}
