//! What the colours of a schlieren image mean: the colour of each deflection.

use super::srgb_byte::srgb_byte;
use crate::path::{Exit, Start};
use crate::render::{RenderError, technique};
use crate::scene::{Scene, TechniqueSpec};
use crate::technique::Photon;
use rt_core::sampler::{Sampler, Sampling};

/// Colours along each side of the legend.
pub(super) const SIDE: usize = 48;
/// Number of points of the source's image over which light is averaged where there is no closed
/// form.
const SOURCE_POINTS: u32 = 32;

/// The colours of deflections to the right and up.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Legend {
    /// Deflection at the middle of each side.
    pub(super) half_rad: f64,
    /// 8-bit sRGB, row by row from the top, as the image would show undimmed light.
    pub(super) rgb: Vec<u8>,
}

impl Legend {
    /// The legend of a scene up to a deflection; `None` for techniques whose brightness is not that
    /// of a deflection, and for several wavelengths, which bend differently.
    ///
    /// # Errors
    /// If the image of a filter cannot be read.
    pub(super) fn new(scene: &Scene, half_rad: f64) -> Result<Option<Legend>, RenderError> {
        let one = scene.light.wavelengths_nm.len() == 1;
        if !matches!(scene.technique, TechniqueSpec::Schlieren { .. }) || !one {
            return Ok(None);
        }
        let frame = crate::film::Framing { width: 1, height: 1, pixel_m: 1.0, center_m: [0.0; 2] };
        let technique = technique(scene, 0, &frame, 1.0, false)?;
        let image = scene.optics().source_image();
        let points = if technique.needs_source_points() { SOURCE_POINTS } else { 1 };
        let start = Start::default();
        let at = |i: usize| half_rad * (2.0 * (i as f64 + 0.5) / SIDE as f64 - 1.0);
        let mut rgb = Vec::with_capacity(3 * SIDE * SIDE);
        for row in 0..SIDE {
            for column in 0..SIDE {
                let deflection_rad = [at(column) as f32, -at(row) as f32];
                let exit = Exit { deflection_rad, ..Exit::UNDISTURBED };
                let mut sum = [0.0f64; 3];
                for s in 0..points {
                    let place = Sampler::new(Sampling::Sobol, 0, 0, 0, s).square(0);
                    let image_point_m = if points > 1 { image.point_m(place) } else { [0.0; 2] };
                    let photon =
                        Photon { start: &start, exit: &exit, image_point_m, shift_m: [0.0; 2] };
                    let energy = technique.energy(&photon);
                    (0..3).for_each(|c| sum[c] += f64::from(energy[c]));
                }
                let bright = sum.map(|e| (scene.exposure() * e / f64::from(points)) as f32);
                rgb.extend(bright.map(srgb_byte));
            }
        }
        Ok(Some(Legend { half_rad, rgb }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legend(rest: &str) -> Option<Legend> {
        let text = format!("[flow]\nfile = \"a\"\ndensity = \"r\"\n{rest}");
        Legend::new(&Scene::from_toml(&text).unwrap(), 2e-4).unwrap()
    }

    #[test]
    fn a_knife_brightens_towards_its_opening_by_the_known_slope() {
        let l = legend("").unwrap();
        let grey = |column: usize, row: usize| {
            let v = f64::from(l.rgb[3 * (row * SIDE + column)]) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        // f2 = 1.5 m, half of a 1 mm slit open: I = 1/2 + 1.5 eps / 1 mm.
        for column in [3, 24, 40] {
            let eps = 2e-4 * (2.0 * (column as f64 + 0.5) / SIDE as f64 - 1.0);
            let wanted = 0.5 + 1.5 * eps / 1e-3;
            // An 8-bit step is up to 0.009 in linear light.
            assert!((grey(column, 24) - wanted).abs() < 0.01, "{column}");
            assert_eq!(grey(column, 2), grey(column, 45), "the knife is vertical");
        }
    }

    #[test]
    fn colours_have_a_legend_and_fringes_have_none() {
        let knife = "[technique]\nkind = \"schlieren\"\ncutoff = ";
        let l = legend(&format!("{knife}{{ kind = \"color\", radius_m = 3e-4 }}")).unwrap();
        let right = &l.rgb[3 * (24 * SIDE + 46)..][..3];
        // The source's disc mixes in some of the other colours.
        let others = right[1].max(right[2]);
        assert!(right[0] > others + 60, "{right:?}: red is to the right");
        assert!(legend("[technique]\nkind = \"interferogram\"").is_none());
        assert!(legend("[light]\nwavelengths_nm = [500.0, 600.0]").is_none());
    }
}
