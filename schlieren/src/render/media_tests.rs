use super::*;
use crate::field::Field;
use crate::media::{Media, Property, Volume};
use crate::solids::Solids;
use glam::{DVec3, Vec3};
use rt_core::bvh::{BuildOptions, World};
use rt_core::mesh::TriMesh;

const HALF: f64 = 48e-3;

fn blob() -> Field {
    Field::from_fn([33; 3], [3e-3; 3], DVec3::splat(-HALF), 1.00027, |p| {
        -2e-5 * (-p.length_squared() / (2.0 * 12e-3f64.powi(2))).exp()
    })
    .unwrap()
}

fn scene(rest: &str) -> Scene {
    let film = "[film]\nsize = [24, 20]\n";
    Scene::from_toml(&format!("[flow]\nfile = \"-\"\ndensity = \"-\"\n{film}{rest}")).unwrap()
}

fn section(s: &Scene, values: &[(Property, f64)], solids: Option<Solids>) -> TestSection {
    let fields = s.lines().iter().map(|_| blob()).collect();
    let section = TestSection::of_fields(s, fields, solids).unwrap();
    let uniform =
        |m: Media, (p, v): &(Property, f64)| m.with(*p, Volume::uniform(*v, &blob()).unwrap());
    section.with_media(values.iter().fold(Media::default(), uniform))
}

/// An image through uniform media; the scene names an array for each given property.
fn rendered(rest: &str, media: &str, values: &[(Property, f64)], layers: Layers) -> RenderOutput {
    let media = if media.is_empty() { String::new() } else { format!("[media]\n{media}\n") };
    let s = scene(&format!("{media}{rest}"));
    render(&s, &section(&s, values, None), layers, &Control::default()).unwrap()
}

const SMOKE: (Property, f64) = (Property::Absorption, 8.0);
const GLOW: (Property, f64) = (Property::Emission, 3.0);
const TURN: (Property, f64) = (Property::Rotation, 5.0);
/// First pixel of the middle row. Pixels 2 to 21 of it are 2.4 mm or more inside the field, which
/// fills the image's height.
const ROW: usize = 10 * 24;

const TECHNIQUES: [&str; 6] = [
    "[technique]\nkind = \"schlieren\"\n",
    "[technique]\nkind = \"schlieren\"\ncutoff = { kind = \"color\", radius_m = 1e-4 }\n",
    "[technique]\nkind = \"shadowgraph\"\n",
    "[technique]\nkind = \"bos\"\n",
    "[technique]\nkind = \"schlieren\"\n[light]\nwavelengths_nm = [633, 532]\nbeams = \"tilted\"\n",
    "[technique]\nkind = \"schlieren\"\n[march]\nmethod = \"pefrl\"\n[sampling]\nmethod \
     = \"photons\"\nsamples = 1\n",
];

fn bits(r: &RenderOutput) -> Vec<u32> {
    r.pixels.iter().flatten().map(|v| v.to_bits()).collect()
}

#[test]
fn media_that_the_scene_does_not_call_for_change_no_bit_and_cost_no_ray() {
    for technique in TECHNIQUES {
        let s = scene(technique);
        let fields = s.lines().iter().map(|_| blob()).collect();
        let without = TestSection::of_fields(&s, fields, None).unwrap();
        let plain = render(&s, &without, Layers::ALL, &Control::default()).unwrap();
        let unused = rendered(technique, "", &[SMOKE, GLOW, TURN], Layers::ALL);
        assert_eq!(bits(&plain), bits(&unused), "{technique}");
        assert_eq!((&plain.map, unused.media), (&unused.map, None));
        assert_eq!(unused.report.counters.media_rays, 0);
        let effects = unused.report.effects;
        assert!(!effects.absorption && !effects.emission && !effects.polarisation);
        // A rotation without an analyser is visible in layers only.
        let hidden = rendered(technique, "rotation = \"r\"", &[TURN], Layers::NONE);
        assert_eq!(bits(&plain), bits(&hidden), "{technique}");
        assert_eq!(hidden.report.counters.media_rays, 0);
        assert!(
            hidden.report.warnings.iter().any(|w| w.contains("analyser")),
            "{:?}",
            hidden.report.warnings
        );
    }
}

#[test]
fn even_smoke_dims_every_technique_by_beer_and_lambert() {
    let left = (-SMOKE.1 * 2.0 * HALF).exp() as f32;
    for technique in TECHNIQUES {
        let plain = rendered(technique, "", &[], Layers::NONE);
        let smoky = rendered(technique, "absorption = \"a\"", &[SMOKE], Layers::ALL);
        for i in [ROW + 8, ROW + 12, ROW + 15] {
            for c in 0..3 {
                let (p, s) = (plain.pixels[i][c], smoky.pixels[i][c]);
                assert!((s - p * left).abs() < 2e-6, "{technique} {i} {c}: {s} of {p}");
            }
        }
        assert!(
            smoky.report.counters.media_rays > smoky.report.counters.rays,
            "photons and the map"
        );
        assert!(smoky.report.effects.absorption && !smoky.report.effects.emission);
        let (map, media) = (smoky.map.unwrap(), smoky.media.unwrap());
        assert!((map.transmission[ROW + 12] - left).abs() < 1e-6);
        assert!((media.optical_depth[ROW + 12] - (SMOKE.1 * 2.0 * HALF) as f32).abs() < 1e-6);
        assert!(media.emission.is_empty() && media.rotation_rad.is_empty());
    }
}

#[test]
fn an_interferogram_loses_contrast_before_light() {
    let fringes = "[technique]\nkind = \"interferogram\"\nfringe_spacing_m = \
                   0.02\n[sampling]\nmethod = \"photons\"\nsamples = 64\n";
    let of = |r: RenderOutput| {
        let row: Vec<f32> = r.pixels[ROW + 2..ROW + 22].iter().map(|p| p[0]).collect();
        let [low, high] =
            row.iter().fold([f32::MAX, 0.0], |[l, h]: [f32; 2], v| [l.min(*v), h.max(*v)]);
        [low, high]
    };
    let [low, high] = of(rendered(fringes, "", &[], Layers::NONE));
    let [dim_low, dim_high] = of(rendered(fringes, "absorption = \"a\"", &[SMOKE], Layers::NONE));
    let left = (-SMOKE.1 * 2.0 * HALF).exp() as f32;
    // The mean is (1 + T)/4 and the amplitude is scaled by √T.
    let middle = 0.25 * (1.0 + left) + left.sqrt() * (0.5 * (low + high) - 0.5);
    assert!((0.5 * (dim_low + dim_high) - middle).abs() < 1e-5, "{dim_low} {dim_high}");
    assert!(((dim_high - dim_low) - (high - low) * left.sqrt()).abs() < 1e-5);
}

#[test]
fn glow_adds_what_the_cut_offs_mean_over_the_stop_lets_through() {
    let depth = 2.0 * HALF;
    let glow = GLOW.1 / SMOKE.1 * (1.0 - (-SMOKE.1 * depth).exp());
    let circle =
        "[technique]\nkind = \"schlieren\"\ncutoff = { kind = \"KIND\", radius_m = 1e-3 }\n";
    let small = 1e-3f64 / 12.5e-3;
    for (technique, gain) in [
        (TECHNIQUES[0].to_string(), 0.5),
        (circle.replace("KIND", "circle"), small * small),
        (circle.replace("KIND", "complemented-circle"), 1.0 - small * small),
        // The exposure is 1/2.
        (TECHNIQUES[2].to_string(), 0.5),
        (TECHNIQUES[3].to_string(), 1.0),
        ("[technique]\nkind = \"interferogram\"\nvisibility = 0.0\n".to_string(), 0.25),
    ] {
        // Smoke that only absorbs, and smoke that also glows.
        let dark = rendered(&technique, "absorption = \"a\"", &[SMOKE], Layers::NONE);
        let lit = rendered(
            &technique,
            "absorption = \"a\"\nemission = \"j\"",
            &[SMOKE, GLOW],
            Layers::ALL,
        );
        let i = ROW + 12;
        let added = f64::from(lit.pixels[i][0] - dark.pixels[i][0]);
        // A circle with a radius of 41 of the million squares has its area within 1 %.
        let tolerance = if gain < 0.1 { 0.01 * gain } else { 2e-5 };
        assert!((added / glow - gain).abs() < tolerance, "{technique} {added} {gain}");
        assert!((f64::from(lit.media.unwrap().emission[i]) - glow).abs() < 1e-6);
        assert!(lit.report.effects.emission);
    }
    // The image is wider than the field, and nothing is added outside the field.
    let glowing = rendered(TECHNIQUES[0], "emission = \"j\"", &[GLOW], Layers::NONE);
    let plain = rendered(TECHNIQUES[0], "", &[], Layers::NONE);
    assert_eq!(glowing.pixels[ROW].map(f32::to_bits), plain.pixels[ROW].map(f32::to_bits));
    // Emission takes one ray per pixel and adds none for photons.
    assert_eq!(glowing.report.counters.media_rays, 24 * 20);
    // Emission has the light's own colour: with red and green lines blue stays dark.
    let white = rendered(TECHNIQUES[4], "emission = \"j\"", &[GLOW], Layers::NONE);
    let several = rendered(TECHNIQUES[4], "", &[], Layers::NONE);
    for (c, part) in [(0, 1.0), (1, 1.0), (2, 0.0)] {
        let added = f64::from(white.pixels[ROW + 12][c] - several.pixels[ROW + 12][c]);
        assert!((added - 0.5 * part * GLOW.1 * depth).abs() < 2e-5, "{added}");
    }
}

#[test]
fn an_analyser_shows_the_rotation_by_malus() {
    let phi = TURN.1 * 2.0 * HALF;
    // Without a filter, which would spread light from within the field to pixels outside it.
    let technique = format!(
        "{}[sampling]\nmethod = \"photons\"\nsamples = 4\nfilter = {{ kind = \"none\" }}\n",
        TECHNIQUES[0]
    );
    let plain = rendered(&technique, "", &[], Layers::NONE);
    for deg in [0.0, 45.0, 90.0, -45.0f64] {
        let media = format!("rotation = \"r\"\nanalyser_deg = {deg:?}");
        let r = rendered(&technique, &media, &[TURN], Layers::ALL);
        let i = ROW + 12;
        let expected = f64::from(plain.pixels[i][0]) * (deg.to_radians() - phi).cos().powi(2);
        assert!((f64::from(r.pixels[i][0]) - expected).abs() < 2e-6, "{deg}: {expected}");
        // Outside the field nothing is rotated. A crossed analyser is dark there, but the map still
        // has the rays' deflections.
        let beside = f64::from(plain.pixels[ROW][0]) * deg.to_radians().cos().powi(2);
        assert!((f64::from(r.pixels[ROW][0]) - beside).abs() < 2e-6, "{deg}: {beside}");
        assert_eq!(r.map.as_ref().unwrap().dark, 0);
        assert!((f64::from(r.media.unwrap().rotation_rad[i]) - phi).abs() < 1e-6);
        // Emitted light is not polarised: half of it passes.
        let both = rendered(
            &technique,
            &format!("{media}\nemission = \"j\""),
            &[TURN, GLOW],
            Layers::NONE,
        );
        let added = f64::from(both.pixels[i][0] - r.pixels[i][0]);
        assert!((added - 0.25 * GLOW.1 * 2.0 * HALF).abs() < 2e-5, "{added}");
    }
}

#[test]
fn bodies_hide_the_glow_behind_them_and_not_that_before() {
    // A square of 40 mm in the plane z = 24 mm, at three quarters of the field's depth.
    let corners = [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)];
    let corners = corners.map(|(x, y): (f32, f32)| Vec3::new(x, y, 24.0) * 1e-3);
    let mesh = || TriMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    for technique in [TECHNIQUES[2], TECHNIQUES[3]] {
        let s = scene(&format!("[media]\nemission = \"j\"\n{technique}"));
        let world = World::from_mesh(mesh(), &BuildOptions::default()).unwrap();
        let solids = Some(Solids::from_world(world));
        let section = section(&s, &[GLOW], solids);
        let r = render(&s, &section, Layers { map: true, ..Layers::NONE }, &Control::default())
            .unwrap();
        let emission = r.media.unwrap().emission;
        assert!(
            (f64::from(emission[ROW + 12]) - GLOW.1 * 24e-3).abs() < 1e-6,
            "{}",
            emission[ROW + 12]
        );
        assert!((f64::from(emission[ROW + 5]) - GLOW.1 * 2.0 * HALF).abs() < 1e-6);
        // The medium in front of the body glows in its silhouette.
        assert!((f64::from(r.pixels[ROW + 12][0]) / s.exposure() - GLOW.1 * 24e-3).abs() < 2e-5);
    }
}

#[test]
fn media_that_the_section_lacks_are_an_error_by_name() {
    let s = scene("[media]\nabsorption = \"a\"\nemission = \"j\"");
    let section = section(&s, &[SMOKE], None);
    let error = render(&s, &section, Layers::NONE, &Control::default()).unwrap_err().to_string();
    assert!(error.contains("media.emission") && error.contains("with_media"), "{error}");
}
