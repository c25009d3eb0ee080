//! Puts the panels of a sheet side by side, with their labels.

use super::Sheet;
use crate::cutoff::Rgb;
use crate::drawing::{Canvas, in_unit, round_below};

const GROUND: Rgb = [0.012; 3];
const WORDS: Rgb = [1.0; 3];
const NUMBERS: Rgb = [0.5; 3];

/// The picture of a sheet: `columns` panels in a row, each with its labels below it, a title, and a
/// scale of lengths.
pub fn compose(sheet: &Sheet, title: &str, columns: usize) -> Canvas {
    let columns = columns.clamp(1, sheet.panels.len().max(1));
    let rows = sheet.panels.len().div_ceil(columns);
    let [width, height] = [sheet.framing.width, sheet.framing.height].map(|n| n as usize);
    let scale = (width / 400).clamp(1, 4);
    let line = Canvas::text_size("", scale)[1] + 3 * scale;
    let gap = 6 * scale;
    let (cell_width, cell_height) = (width + gap, height + 2 * line + gap);
    let head = 2 * line + gap;
    let mut canvas =
        Canvas::new(columns * cell_width + gap, rows * cell_height + head + gap, GROUND);

    let whole = canvas.width - 2 * gap;
    let at = |x: usize, y: usize| [x as f64, y as f64];
    canvas.text(&fitting(title, whole, 2 * scale), at(gap, gap), 2 * scale, WORDS);
    for (n, panel) in sheet.panels.iter().enumerate() {
        let (x, y) = (gap + n % columns * cell_width, head + gap + n / columns * cell_height);
        let corner = [x as i64, y as i64];
        match &panel.pixels {
            Some(pixels) => canvas.paste(pixels, width, corner),
            None => {
                canvas.fill(corner, [width as i64, height as i64], [0.0; 3], 1.0);
                let text = "interrupted";
                let [w, h] = Canvas::text_size(text, scale);
                let middle = at(x + width.saturating_sub(w) / 2, y + height.saturating_sub(h) / 2);
                canvas.text(text, middle, scale, NUMBERS);
            }
        }
        let below = y + height + 2 * scale;
        let [words, numbers] = &panel.labels;
        canvas.text(&fitting(words, width, scale), at(x, below), scale, WORDS);
        canvas.text(&fitting(numbers, width, scale), at(x, below + line), scale, NUMBERS);
    }
    scale_bar(&mut canvas, sheet, [gap, head + gap], scale);
    canvas
}

/// The text, cut to a width in pixels.
fn fitting(text: &str, width: usize, scale: usize) -> String {
    let most = width
        / Canvas::text_size("00", scale)[0].saturating_sub(Canvas::text_size("0", scale)[0]).max(1);
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let kept: String = text.chars().take(most.saturating_sub(1)).collect();
    format!("{kept}…")
}

/// A length in the test section, in the lower right corner of the first panel.
fn scale_bar(canvas: &mut Canvas, sheet: &Sheet, [x, y]: [usize; 2], scale: usize) {
    let (width, height) = (f64::from(sheet.framing.width), f64::from(sheet.framing.height));
    let length_m = round_below(0.3 * width * sheet.framing.pixel_m);
    let bar = length_m / sheet.framing.pixel_m;
    let text = in_unit(length_m, "m");
    let [text_width, text_height] = Canvas::text_size(&text, scale).map(|n| n as f64);
    let pad = 3.0 * scale as f64;
    let size = [bar.max(text_width) + 2.0 * pad, text_height + 4.0 * pad];
    let corner = [x as f64 + width - size[0], y as f64 + height - size[1]];
    canvas.fill(corner.map(|c| c as i64), size.map(|s| s.ceil() as i64), [0.0; 3], 0.75);
    let under = corner[1] + size[1] - pad;
    canvas.line(
        [corner[0] + pad, under],
        [corner[0] + pad + bar, under],
        1.5 * scale as f64,
        WORDS,
    );
    canvas.text(&text, [corner[0] + pad, corner[1] + pad], scale, WORDS);
}
