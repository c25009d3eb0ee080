//! Contact sheets: the panels are the pictures that the techniques make alone, rays are shared, and
//! an interrupted sheet keeps what is finished.

mod program;

use glam::DVec3;
use program::{flow, schlieren, text};
use schlieren::field::Field;
use schlieren::render::{Control, RenderError, TestSection};
use schlieren::scene::Scene;
use schlieren::sheet::{Sheet, compose, render_sheet};
use serde_json::Value;
use std::sync::atomic::{AtomicBool, Ordering};

const SCENE: &str = "[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [60, 40]";

fn section(scene: &Scene) -> TestSection {
    let field = Field::from_fn([41, 29, 17], [3e-3; 3], DVec3::splat(-0.05), 1.00027, |p| {
        -4e-5 * (-(p - DVec3::splat(0.01)).length_squared() / (2.0 * 0.012f64.powi(2))).exp()
    });
    TestSection::of_fields(scene, vec![field.unwrap()], None).unwrap()
}

fn panel<'s>(sheet: &'s Sheet, name: &str) -> &'s [[f32; 3]] {
    let found = sheet.panels.iter().find(|p| p.name == name);
    found.and_then(|p| p.pixels.as_deref()).unwrap_or_else(|| panic!("{name}"))
}

#[test]
fn all_panels_share_two_sets_of_rays_and_show_something() {
    let scene = Scene::from_toml(SCENE).unwrap();
    let sheet = render_sheet(&scene, &section(&scene), &Control::default()).unwrap();
    assert_eq!(sheet.panels.len(), 12);
    // A margin of two pixels around the corners of 60 x 40 pixels, and the corners alone.
    assert_eq!(sheet.report.counters.rays, 65 * 45 + 61 * 41);
    for p in &sheet.panels {
        let pixels = p.pixels.as_ref().unwrap();
        assert_eq!(pixels.len(), 60 * 40, "{}", p.name);
        assert!(pixels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{}", p.name);
        let [low, high] = pixels
            .iter()
            .flatten()
            .fold([f32::INFINITY, 0.0], |[l, h]: [f32; 2], v| [l.min(*v), h.max(*v)]);
        // A film at 20 m, the farthest that is chosen, shows this weak flow least.
        assert!(high - low > 0.01, "{} from {low} to {high}", p.name);
    }
    let canvas = compose(&sheet, "a title", 4);
    assert!(canvas.width > 4 * 60 && canvas.height > 3 * 40);
}

#[test]
fn a_panel_is_the_picture_that_its_options_make() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let (file, png, exr) = (path("flow.vti"), path("sheet.png"), path("sheet.exr"));
    let base = ["--density", "rho", "--size", "64x32", "--quiet"];
    let o =
        schlieren(&[&["sheet", &file, "-o", &png, "--exr", &exr, "--json"], &base[..]].concat());
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    let json: Value = serde_json::from_slice(&o.stdout).unwrap();
    let layers = datasets::image_io::read_exr(exr.as_ref()).unwrap();
    assert!(datasets::image_io::read_png(png.as_ref()).unwrap().width > 4 * 64);
    let mut compared = 0;
    for p in json["panels"].as_array().unwrap() {
        let name = p["name"].as_str().unwrap();
        // Dots are sampled at other places.
        let skip = ["bos", "bos-undisturbed", "bos-arrows", "bos-lines", "deflection"];
        if skip.contains(&name) {
            continue;
        }
        let options: Vec<&str> =
            p["options"].as_array().unwrap().iter().map(|o| o.as_str().unwrap()).collect();
        let alone = path("alone.exr");
        let o = schlieren(
            &[&["render", &file, "--exr", &alone, "--noise-free"], &base[..], &options].concat(),
        );
        assert_eq!(o.status.code(), Some(0), "{options:?}: {}", text(&o.stderr));
        let image = datasets::image_io::read_exr(alone.as_ref()).unwrap();
        let channel = if name == "color" { "R" } else { "Y" };
        let alone = &image.plane(channel).unwrap().samples;
        let of_sheet = &layers.plane(&format!("{name}.{channel}")).unwrap().samples;
        let worst = alone.iter().zip(of_sheet).map(|(a, b)| (a - b).abs()).fold(0.0f32, f32::max);
        // Options have the digits of the labels, and a shadowgraph's margin is another.
        assert!(worst < 0.03, "{name}: {worst}");
        compared += 1;
    }
    assert_eq!(compared, 7);
}

#[test]
fn an_interrupted_sheet_keeps_its_finished_panels() {
    let scene = Scene::from_toml(SCENE).unwrap();
    let section = section(&scene);
    let cancel = AtomicBool::new(false);
    let progress = |part: f64| cancel.store(part > 0.55, Ordering::Relaxed);
    let control = Control { cancel: &cancel, progress: &progress };
    let sheet = render_sheet(&scene, &section, &control).unwrap();
    assert!(sheet.interrupted && sheet.background_map.is_none());
    let missing: Vec<&str> =
        sheet.panels.iter().filter(|p| p.pixels.is_none()).map(|p| p.name).collect();
    assert_eq!(missing, ["bos-undisturbed", "bos", "bos-arrows", "bos-lines"]);
    assert_eq!(panel(&sheet, "shadowgraph").len(), 60 * 40);
    let whole = render_sheet(&scene, &section, &Control::default()).unwrap();
    assert_eq!(panel(&whole, "shadowgraph"), panel(&sheet, "shadowgraph"));
    let drawn = compose(&sheet, "", 4);
    assert_eq!(drawn.width, compose(&whole, "", 4).width);

    // Before any panel there is nothing to keep.
    let cancel = AtomicBool::new(true);
    let control = Control { cancel: &cancel, progress: &|_| () };
    let nothing = render_sheet(&scene, &section, &control);
    assert!(matches!(nothing, Err(RenderError::Cancelled)));
}

#[test]
fn a_sheet_of_uniform_gas_is_made_and_what_it_cannot_have_is_refused() {
    let scene = Scene::from_toml(SCENE).unwrap();
    let still = Field::from_fn([9; 3], [3e-3; 3], DVec3::ZERO, 1.00027, |_| 0.0).unwrap();
    let section = TestSection::of_fields(&scene, vec![still], None).unwrap();
    let sheet = render_sheet(&scene, &section, &Control::default()).unwrap();
    assert_eq!(sheet.bench.strong_rad, 0.0);
    assert!(panel(&sheet, "knife-x").iter().all(|p| (p[0] - 0.5).abs() < 1e-5));

    let dir = tempfile::tempdir().unwrap();
    flow(&dir.path().join("flow.vti"));
    let file = dir.path().join("flow.vti");
    let file = file.to_str().unwrap();
    for (args, words) in [
        (&["--density", "rho"][..], "no output"),
        (&["--density", "rho", "-o", "a.exr"], ".png"),
        (&["--density", "rho", "-o", "a.png", "--wavelength", "500,600"], "one wavelength"),
        (&["--density", "rho", "-o", "a.png", "--technique", "bos"], "--technique"),
    ] {
        let o = schlieren(&[&["sheet", file], args].concat());
        assert_eq!(o.status.code(), Some(2), "{args:?}");
        assert!(text(&o.stderr).contains(words), "{args:?}: {}", text(&o.stderr));
    }
}
