//! Computes what the page shows of the filter: its transmission, the distribution of light on it,
//! and the point where a pixel's light crosses it.

use super::deflection_map::DeflectionMap;
use super::srgb_byte::srgb_byte;
use crate::cutoff::painted::{Painting, Stroke};
use crate::cutoff::{Cutoff, CutoffPlane, Rgb};
use crate::optics::{PlaneVector, SourceImage};
use crate::render::Map;
use crate::scene::{CutoffSpec, Scene, SceneError, TechniqueSpec};
use rt_core::sampler::{Sampler, Sampling};

/// Pixels along each side of the shown filter plane.
pub(super) const PIXELS: usize = 160;
/// Deflections below this are those of rounding: no bench shows a millionth of a microradian.
const LEAST_RAD: f64 = 1e-12;
/// Number of points of the source's image over which the light of one pixel is distributed.
const SOURCE_POINTS: u32 = 8;

/// The cut-off plane around the axis, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FilterPlane {
    /// Half the side of the shown square.
    pub(super) half_m: f64,
    /// Transmission, 8-bit sRGB.
    pub(super) rgb: Vec<u8>,
    /// Fraction of the light that crosses each pixel. The sum is at most 1.
    pub(super) light: Vec<f32>,
    /// Fraction of the light that crosses the plane outside the shown square.
    pub(super) outside: f32,
}

/// Half the side of the square to show. It contains the light and the cut-off, and is rounded up to
/// one digit so that it does not flicker. A painting keeps its size.
pub(super) fn half_side_m(scene: &Scene, traced: Option<&DeflectionMap>) -> f64 {
    let optics = scene.optics();
    let image = optics.source_image();
    let source_m = image.half_extent_m([1.0, 0.0]).max(image.half_extent_m([0.0, 1.0]));
    let deflection_rad = traced.map_or(0.0, |t| t.strong_rad);
    let light_m = source_m + optics.schlieren_focal_length_m * deflection_rad;
    let cutoff_m = match &scene.technique {
        TechniqueSpec::Schlieren { cutoff } => match cutoff {
            CutoffSpec::Painted(p) => return 0.5 * p.size_m[0].max(p.size_m[1]),
            CutoffSpec::Circle { radius_m, center_m }
            | CutoffSpec::ComplementedCircle { radius_m, center_m } => {
                radius_m + center_m[0].hypot(center_m[1])
            }
            CutoffSpec::Color { radius_m, .. } => *radius_m,
            CutoffSpec::Image { width_m, .. } => 0.5 * width_m,
            CutoffSpec::Knife { .. } => 0.0,
        },
        _ => 0.0,
    };
    rounded_up(1.15 * light_m.max(cutoff_m).max(1e-6))
}

/// A positive number rounded up to one digit.
fn rounded_up(value: f64) -> f64 {
    let digit = 10f64.powf(value.log10().floor());
    (value / digit).ceil() * digit
}

/// The deflection up to which a legend shows colours: what the flow bends, and without a flow, what
/// the filter plane shows.
pub(super) fn legend_half_rad(scene: &Scene, traced: &DeflectionMap) -> f64 {
    if traced.strong_rad > LEAST_RAD {
        rounded_up(1.15 * traced.strong_rad)
    } else {
        half_side_m(scene, None) / scene.optics().schlieren_focal_length_m
    }
}

/// The cut-off plane with the scene's source; open for techniques without a cut-off.
fn plane(scene: &Scene) -> Result<CutoffPlane, SceneError> {
    let cutoff = match &scene.technique {
        TechniqueSpec::Schlieren { cutoff } => cutoff.cutoff()?,
        _ => Cutoff::Open,
    };
    Ok(CutoffPlane::new(&cutoff, scene.optics().source_image()))
}

impl FilterPlane {
    /// Renders the plane. Without a map the distribution of light is unknown and left dark.
    pub(super) fn new(
        scene: &Scene,
        traced: Option<&DeflectionMap>,
    ) -> Result<FilterPlane, SceneError> {
        let half_m = half_side_m(scene, traced);
        let plane = plane(scene)?;
        let center = |i: usize| 2.0 * half_m * ((i as f64 + 0.5) / PIXELS as f64 - 0.5);
        let mut rgb = Vec::with_capacity(3 * PIXELS * PIXELS);
        for j in 0..PIXELS {
            for i in 0..PIXELS {
                let t = plane.transmission([center(i) as f32, -center(j) as f32]);
                rgb.extend(t.map(srgb_byte));
            }
        }
        let (light, outside) =
            traced.map_or((vec![0.0; PIXELS * PIXELS], 0.0), |t| histogram(scene, &t.map, half_m));
        Ok(FilterPlane { half_m, rgb, light, outside })
    }
}

/// Histogram of where light crosses the plane, with each pixel's ray distributed over the image of
/// the source, and the fraction outside.
fn histogram(scene: &Scene, map: &Map, half_m: f64) -> (Vec<f32>, f32) {
    let optics = scene.optics();
    let (f2, image) = (optics.schlieren_focal_length_m as f32, optics.source_image());
    let points = if image == SourceImage::Point { 1 } else { SOURCE_POINTS };
    let (mut sums, mut outside, mut all) = (vec![0.0f64; PIXELS * PIXELS], 0.0f64, 0.0f64);
    let to_pixels = (0.5 * PIXELS as f64 / half_m) as f32;
    let middle = 0.5 * PIXELS as f32;
    for (k, (d, t)) in
        map.deflection_rad.iter().zip(&map.transmission).enumerate().filter(|(_, p)| *p.1 > 0.0)
    {
        for s in 0..points {
            let point = image.point_m(Sampler::new(Sampling::Sobol, 0, k as u32, 0, s).square(0));
            let x = middle + (point[0] + f2 * d[0]) * to_pixels;
            let y = middle - (point[1] + f2 * d[1]) * to_pixels;
            let side = PIXELS as f32;
            let energy = f64::from(*t);
            all += energy;
            if x >= 0.0 && y >= 0.0 && x < side && y < side {
                sums[y as usize * PIXELS + x as usize] += energy;
            } else {
                outside += energy;
            }
        }
    }
    let all = all.max(f64::MIN_POSITIVE);
    (sums.into_iter().map(|s| (s / all) as f32).collect(), (outside / all) as f32)
}

/// Deflection, and point on the filter, of the light that lands at a point of the image, for the
/// middle of the source. `at` is 0..=1 from the image's upper left corner. `None` where no light
/// lands.
pub(super) fn traced(
    traced: &DeflectionMap,
    f2_m: f64,
    at: [f64; 2],
) -> Option<(PlaneVector, PlaneVector)> {
    let d = traced.light_at(at)?.mean_vector(&traced.map.deflection_rad)?;
    Some((d, d.map(|c| (f2_m * f64::from(c)) as f32)))
}

/// Converts a cut-off to a painting that can be painted on. Knives and circles become dabs of the
/// same shape. A colour wheel or an image cannot be converted: `ground` replaces it, and the second
/// value is false.
pub(super) fn as_painting(
    scene: &Scene,
    cutoff: &CutoffSpec,
    half_m: f64,
    ground: Rgb,
) -> Result<(Painting, bool), SceneError> {
    let painting = |ground_rgb, strokes| Painting {
        size_m: [2.0 * half_m; 2],
        pixels: 512,
        ground_rgb,
        strokes,
    };
    let dab = |at: [f64; 2], radius_m, rgb| Stroke { from_m: at, to_m: at, radius_m, rgb };
    let (black, white) = ([0.0; 3], [1.0; 3]);
    Ok(match cutoff {
        CutoffSpec::Painted(p) => (p.clone(), true),
        CutoffSpec::Circle { radius_m, center_m } => {
            (painting(black, vec![dab(*center_m, *radius_m, white)]), true)
        }
        CutoffSpec::ComplementedCircle { radius_m, center_m } => {
            (painting(white, vec![dab(*center_m, *radius_m, black)]), true)
        }
        CutoffSpec::Knife { angle_deg, .. } => {
            // Finds the edge by bisection, where the transmission changes along its normal.
            let plane = plane(scene)?;
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            let open = |t: f64| plane.transmission([(t * cos) as f32, (t * sin) as f32])[0] >= 0.5;
            let (mut closed_m, mut open_m) = (-1.0, 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (closed_m + open_m);
                *if open(middle) { &mut open_m } else { &mut closed_m } = middle;
            }
            // A dab so large that its rim is almost straight: over the filter it deviates from a
            // line by less than a thousandth of the half side.
            let radius_m = 1000.0 * half_m;
            let at = [cos, sin].map(|c| c * (open_m + radius_m));
            (painting(black, vec![dab(at, radius_m, white)]), true)
        }
        CutoffSpec::Color { .. } | CutoffSpec::Image { .. } => {
            (painting(ground, Vec::new()), false)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Framing;

    fn scene(technique: &str) -> Scene {
        Scene::from_toml(&format!("[flow]\nfile = \"a\"\ndensity = \"r\"\n{technique}")).unwrap()
    }

    const FRAMING: Framing = Framing { width: 4, height: 4, pixel_m: 1e-3, center_m: [0.0; 2] };

    fn prism(deflection: PlaneVector) -> Map {
        Map {
            deflection_rad: vec![deflection; 16],
            displacement_m: vec![[0.0; 2]; 16],
            transmission: vec![1.0; 16],
            ..Map::default()
        }
    }

    #[test]
    fn light_is_where_the_deflection_brings_it() {
        let s = scene("[light]\nsource = { kind = \"point\" }");
        let traced = DeflectionMap::new(prism([2e-4, -1e-4]), FRAMING, false);
        let plane = FilterPlane::new(&s, Some(&traced)).unwrap();
        // f2 = 1.5 m: 0.3 mm to the right, 0.15 mm down.
        let brightest = (0..PIXELS * PIXELS)
            .max_by(|a, b| plane.light[*a].total_cmp(&plane.light[*b]))
            .unwrap();
        let at = |i: usize| 2.0 * plane.half_m * ((i as f64 + 0.5) / PIXELS as f64 - 0.5);
        let pixel_m = 2.0 * plane.half_m / PIXELS as f64;
        assert!((at(brightest % PIXELS) - 3e-4).abs() < pixel_m);
        assert!((at(brightest / PIXELS) - 1.5e-4).abs() < pixel_m);
        assert!((plane.light.iter().sum::<f32>() + plane.outside - 1.0).abs() < 1e-5);
    }

    #[test]
    fn knives_and_circles_become_paintings_of_the_same_shape() {
        for cutoff in [
            "{ kind = \"knife\", angle_deg = 30.0, open = 0.3 }",
            "{ kind = \"circle\", radius_m = 4e-4, center_m = [1e-4, 2e-4] }",
            "{ kind = \"complemented-circle\", radius_m = 5e-4 }",
        ] {
            let s = scene(&format!("[technique]\nkind = \"schlieren\"\ncutoff = {cutoff}"));
            let TechniqueSpec::Schlieren { cutoff } = &s.technique else { panic!() };
            let half_m = half_side_m(&s, None);
            let (painting, same) = as_painting(&s, cutoff, half_m, [0.0; 3]).unwrap();
            assert!(same);
            // The source must be the same, because the position of the knife's edge depends on it.
            let mut painted = s.clone();
            painted.light.source = s.effective().light.source;
            painted.technique = TechniqueSpec::Schlieren { cutoff: CutoffSpec::Painted(painting) };
            let [a, b] = [&s, &painted].map(|s| FilterPlane::new(s, None).unwrap());
            assert_eq!(a.half_m, b.half_m);
            let differ = a.rgb.iter().zip(&b.rgb).filter(|(a, b)| a.abs_diff(**b) > 128).count();
            // They differ only along the edge, by less than a pixel.
            assert!(differ < 3 * 2 * PIXELS, "{cutoff:?}: {differ}");
            assert!(a.rgb.contains(&255) && a.rgb.contains(&0));
        }
    }

    #[test]
    fn a_point_of_the_image_is_followed_back_to_where_its_light_started() {
        let of = |map: Map| DeflectionMap::new(map, FRAMING, false);
        let mut map = prism([1e-4, 0.0]);
        assert_eq!(traced(&of(map.clone()), 2.0, [0.5, 0.5]), Some(([1e-4, 0.0], [2e-4, 0.0])));
        // All light lands a pixel to the right of where it starts, so light in the middle of
        // column 2 starts in that of column 1.
        map.displacement_m = vec![[1e-3, 0.0]; 16];
        map.deflection_rad[2 * 4 + 1] = [0.0, 3e-4];
        let close = |a: PlaneVector, b: PlaneVector| (0..2).all(|c| (a[c] - b[c]).abs() < 1e-9);
        assert!(close(traced(&of(map.clone()), 2.0, [0.625, 0.625]).unwrap().1, [0.0, 6e-4]));
        // Rays from the film are known by where they end.
        let from_film = DeflectionMap::new(map.clone(), FRAMING, true);
        assert!(close(traced(&from_film, 2.0, [0.375, 0.625]).unwrap().1, [0.0, 6e-4]));
        // Half-way to the next column, half of both.
        let between = traced(&from_film, 2.0, [0.5, 0.625]).unwrap().0;
        assert!(close(between, [0.5e-4, 1.5e-4]), "{between:?}");
        // Beside a shadow, what the nearer side has.
        map.transmission[2 * 4 + 2] = 0.0;
        let shadow = DeflectionMap::new(map.clone(), FRAMING, true);
        assert!(close(traced(&shadow, 2.0, [0.45, 0.625]).unwrap().0, [0.0, 3e-4]));
        assert_eq!(traced(&shadow, 2.0, [0.55, 0.625]), None);
        map.transmission = vec![0.0; 16];
        assert_eq!(traced(&of(map), 2.0, [0.5, 0.5]), None);
    }
}
