//! Chooses the numbers of the bench of each panel from the rays, so that each panel shows the flow.

use crate::film::Framing;
use crate::path::Exit;

/// Change of brightness that the strong deflections make behind a knife: half of the light is the
/// undisturbed level, and nearly all of the rest is used.
const KNIFE_CONTRAST: f64 = 0.45;
/// Change of a shadowgraph's brightness at its strong places.
const SHADOW_CONTRAST: f64 = 0.5;
/// Displacement of BOS dots by the strong deflections, in pixels.
const BOS_PX: f64 = 3.0;
/// The strong deflections: this part of all is below them.
const STRONG: f64 = 0.995;
/// Slits and spots between which a bench can be built, m.
const SLITS_M: [f64; 2] = [2e-6, 5e-3];
/// The longest distance of a film or background, m.
const LONGEST_M: f64 = 20.0;

/// The numbers of the benches of a sheet.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct PanelBench {
    /// The deflection that 99.5 % of the rays stay below; the others are chosen from it.
    pub strong_rad: f64,
    /// Width of the slit before a knife.
    pub slit_m: f64,
    /// Radius of the colour filter, where colours are saturated.
    pub color_radius_m: f64,
    /// Radius of the spot of the dark field, and of the image of its source.
    pub spot_radius_m: f64,
    /// Distance of the shadowgraph's film behind the middle of the flow.
    pub film_m: f64,
    /// Distance of the background of BOS.
    pub background_m: f64,
    /// Distance of the interferogram's straight fringes.
    pub fringes_m: f64,
}

impl PanelBench {
    /// The benches for rays through the corners of the pixels of `frame`, whose outer `margin`
    /// pixels are not in the image. `depth_m` is that of the flow along the light.
    pub fn chosen(frame: &Framing, margin: u32, exits: &[Exit], depth_m: f64) -> PanelBench {
        let columns = frame.width as usize + 1;
        let margin_px = margin as usize;
        let rows = frame.height as usize + 1;
        let inside = |k: &usize| {
            let (x, y) = (k % columns, k / columns);
            (margin_px..columns - margin_px).contains(&x)
                && (margin_px..rows - margin_px).contains(&y)
        };
        let free =
            |e: &Exit| e.transmission > 0.0 && e.deflection_rad.iter().all(|d| d.is_finite());
        let size = |v: [f32; 2]| f64::from(v[0]).hypot(f64::from(v[1]));
        let mut sizes = Vec::new();
        let mut slopes = Vec::new();
        for k in (0..exits.len()).filter(inside) {
            let (e, right, below) = (exits[k], k + 1, k + columns);
            if !free(&e) {
                continue;
            }
            sizes.push(size(e.deflection_rad));
            if inside(&right) && inside(&below) && free(&exits[right]) && free(&exits[below]) {
                // Rows count downwards. Light is dimmed where rays spread.
                let dx = exits[right].deflection_rad[0] - e.deflection_rad[0];
                let dy = e.deflection_rad[1] - exits[below].deflection_rad[1];
                slopes.push(f64::from(dx + dy).abs() / frame.pixel_m);
            }
        }
        let strong_rad = quantile(&mut sizes, STRONG);
        let strong_slope = quantile(&mut slopes, STRONG);
        let bounded = |x: f64, [low, high]: [f64; 2], otherwise: f64| {
            if strong_rad > 0.0 && x.is_finite() {
                two_digits(x.clamp(low, high))
            } else {
                otherwise
            }
        };
        let f_m = crate::optics::Optics::DEFAULT.schlieren_focal_length_m;
        let behind_m = 0.5 * depth_m;
        // Light must not come from beyond the margin.
        let reach_m = f64::from(margin) * frame.pixel_m / quantile(&mut sizes, 1.0);
        let film_m = (SHADOW_CONTRAST / strong_slope).min(0.8 * reach_m);
        let shortest_m = 1.02 * behind_m;
        let far = [shortest_m, LONGEST_M.max(2.0 * shortest_m)];
        let background_m = behind_m + BOS_PX * frame.pixel_m / strong_rad;
        PanelBench {
            strong_rad,
            slit_m: bounded(f_m * strong_rad / KNIFE_CONTRAST, SLITS_M, 1e-3),
            color_radius_m: bounded(f_m * strong_rad, SLITS_M, 0.5e-3),
            spot_radius_m: bounded(0.5 * f_m * strong_rad, SLITS_M, 0.25e-3),
            film_m: bounded(film_m, [1e-6, LONGEST_M], 0.5),
            background_m: bounded(background_m, far, (2.0 * shortest_m).max(0.5)),
            fringes_m: two_digits(
                f64::from(frame.width.saturating_sub(2 * margin)) * frame.pixel_m / 16.0,
            ),
        }
    }
}

/// The value that a part of all is not above; 0 for none.
fn quantile(values: &mut [f64], part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let last = values.len() - 1;
    let at = ((last as f64) * part).round() as usize;
    *values.select_nth_unstable_by(at.min(last), f64::total_cmp).1
}

/// A number with two digits, as somebody builds it.
fn two_digits(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prism_gets_a_slit_that_shows_it_and_a_background_at_its_distance() {
        let frame = Framing::fitted(40, 30, [0.04, 0.03]);
        let exits = vec![Exit { deflection_rad: [3e-5, -4e-5], ..Exit::UNDISTURBED }; 41 * 31];
        let b = PanelBench::chosen(&frame, 2, &exits, 0.1);
        assert!((b.strong_rad - 5e-5).abs() < 1e-9);
        // 1.5 m times 5e-5 rad shifts the slit's image by 75 µm.
        assert!((b.slit_m / (75e-6 / 0.45) - 1.0).abs() < 0.05, "{b:?}");
        // 60 m would show three pixels, and nobody has them.
        assert_eq!(b.background_m, 20.0);
        let still = vec![Exit::UNDISTURBED; 41 * 31];
        let b = PanelBench::chosen(&frame, 2, &still, 0.1);
        assert_eq!((b.slit_m, b.film_m, b.background_m), (1e-3, 0.5, 0.5));
    }
}
