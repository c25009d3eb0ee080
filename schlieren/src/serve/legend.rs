//! What the colours of an image mean: the colour of each deflection, or of each optical path.

use super::srgb_byte::srgb_byte;
use crate::path::{Exit, Start};
use crate::render::{RenderError, technique};
use crate::scene::{Scene, TechniqueSpec};
use crate::spectrum::film_colors;
use crate::technique::{Photon, Technique};
use rt_core::sampler::{Sampler, Sampling};

/// Colours along each side of the legend of deflections.
const SIDE: usize = 48;
/// Colours of the legend of paths.
const STRIP: usize = 220;
/// Number of points of the source's image over which light is averaged where there is no closed
/// form.
const SOURCE_POINTS: u32 = 32;
/// Wavelengths of path that the legend of coloured fringes shows.
const ORDERS: f64 = 4.0;

/// What a legend shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scale {
    /// Deflections to the right and up, by this much at the middle of each side.
    Deflection { half_rad: f64 },
    /// Optical paths from 0 to this one, from left to right.
    Path { longest_m: f64 },
}

/// The colours of deflections or paths of the light of the first wavelength. The other wavelengths
/// are bent and delayed as the gas does it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Legend {
    pub(super) scale: Scale,
    /// Columns and rows.
    pub(super) size: [usize; 2],
    /// 8-bit sRGB, row by row from the top, as the image would show undimmed light.
    pub(super) rgb: Vec<u8>,
}

impl Legend {
    /// The legend of a scene up to a deflection. `dispersion` is that of the test section
    /// ([`crate::render::TestSection::dispersion`]). `None` for techniques whose brightness is not
    /// that of a deflection or path, and for fringes of one wavelength, which repeat.
    ///
    /// # Errors
    /// If the image of a filter cannot be read.
    pub(super) fn new(
        scene: &Scene,
        half_rad: f64,
        dispersion: &[f64],
    ) -> Result<Option<Legend>, RenderError> {
        let lines = scene.lines();
        let (scale, size) = match scene.technique {
            TechniqueSpec::Schlieren { .. } => (Scale::Deflection { half_rad }, [SIDE; 2]),
            TechniqueSpec::Interferogram { .. } if lines.len() > 1 => {
                let longest = lines.iter().map(|l| l.wavelength_nm).fold(0.0, f64::max);
                (Scale::Path { longest_m: ORDERS * longest * 1e-9 }, [STRIP, 1])
            }
            _ => return Ok(None),
        };
        let frame = crate::film::Framing { width: 1, height: 1, pixel_m: 1.0, center_m: [0.0; 2] };
        let colors = match lines.len() {
            1 => vec![[1.0; 3]],
            _ => film_colors(&lines),
        };
        let mut each = Vec::new();
        for (line, color) in colors.into_iter().enumerate() {
            let factor = dispersion.get(line).copied().unwrap_or(1.0);
            each.push((technique(scene, line, &frame, 1.0, false)?, color, factor));
        }
        let [columns, rows] = size;
        let mut rgb = Vec::with_capacity(3 * columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let mut sum = [0.0f64; 3];
                for (technique, color, factor) in &each {
                    let light = light(scene, technique, &exit(scale, [column, row], *factor));
                    (0..3).for_each(|c| sum[c] += light[c] * f64::from(color[c]));
                }
                rgb.extend(sum.map(|e| srgb_byte((scene.exposure() * e) as f32)));
            }
        }
        Ok(Some(Legend { scale, size, rgb }))
    }
}

/// What a place of the legend stands for, for light that is bent and delayed by `factor` times as
/// much as that of the first wavelength.
fn exit(scale: Scale, [column, row]: [usize; 2], factor: f64) -> Exit {
    match scale {
        Scale::Deflection { half_rad } => {
            let at = |i: usize| factor * half_rad * (2.0 * (i as f64 + 0.5) / SIDE as f64 - 1.0);
            Exit { deflection_rad: [at(column) as f32, -at(row) as f32], ..Exit::UNDISTURBED }
        }
        Scale::Path { longest_m } => {
            let path_m = factor * longest_m * (column as f64 + 0.5) / STRIP as f64;
            Exit { opd_m: path_m as f32, ..Exit::UNDISTURBED }
        }
    }
}

/// Energy of a photon, averaged over the source.
fn light(scene: &Scene, technique: &Technique, exit: &Exit) -> [f64; 3] {
    let points = if technique.needs_source_points() { SOURCE_POINTS } else { 1 };
    let image = scene.optics().source_image();
    let start = Start::default();
    let mut sum = [0.0f64; 3];
    for s in 0..points {
        let place = Sampler::new(Sampling::Sobol, 0, 0, 0, s).square(0);
        let image_point_m = if points > 1 { image.point_m(place) } else { [0.0; 2] };
        let photon = Photon { start: &start, exit, image_point_m, shift_m: [0.0; 2] };
        let energy = technique.energy(&photon);
        (0..3).for_each(|c| sum[c] += f64::from(energy[c]) / f64::from(points));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legend(rest: &str) -> Option<Legend> {
        let text = format!("[flow]\nfile = \"a\"\ndensity = \"r\"\n{rest}");
        Legend::new(&Scene::from_toml(&text).unwrap(), 2e-4, &[1.0, 1.02, 1.04]).unwrap()
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
        assert!(legend("[technique]\nkind = \"shadowgraph\"").is_none());
    }

    /// Behind a knife in white light, all lines brighten together; where the source's image ends,
    /// the line that is bent more arrives there first.
    #[test]
    fn several_wavelengths_have_the_colours_of_their_sum() {
        let white = "[light]\nwavelengths_nm = [450.0, 550.0, 650.0]\n";
        let l = legend(white).unwrap();
        let at = |column: usize| &l.rgb[3 * (24 * SIDE + column)..][..3];
        let spread = |c: &[u8]| c.iter().max().unwrap() - c.iter().min().unwrap();
        assert!(spread(at(24)) < 4, "{:?}: the middle is grey", at(24));
        assert!(at(44)[0] > at(24)[0] && at(24)[0] > at(4)[0]);
        // 600 nm is bent 4 % more, by the factors of the test, so red is ahead on the bright side.
        assert!(at(44)[0] > at(44)[2], "{:?}", at(44));

        let fringes = "[technique]\nkind = \"interferogram\"\n";
        let l = legend(&format!("{white}{fringes}")).unwrap();
        let Scale::Path { longest_m } = l.scale else { panic!("{:?}", l.scale) };
        assert!((longest_m - 4.0 * 650e-9).abs() < 1e-15 && l.size == [STRIP, 1]);
        // White where nothing is delayed; after half a wave of the middle line dark, then colours.
        let at = |path_m: f64| {
            let column = (path_m / longest_m * STRIP as f64) as usize;
            &l.rgb[3 * column..][..3]
        };
        assert!(at(0.0).iter().all(|v| *v > 250), "{:?}", at(0.0));
        assert!(at(270e-9)[1] < 40, "{:?}", at(270e-9));
        let most = (0..STRIP).map(|c| spread(&l.rgb[3 * c..][..3])).max().unwrap();
        assert!(most > 150, "{most}: fringes of other orders have colours");
    }
}
