//! Every effect, enabled by its variable, changes the image where and how geometry predicts.

use crate::capture::{Capture, bright};
use crate::peers::skip;
use crate::session::{Program, Run, With, output};
use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};

/// Images of the room and the ball, or why there are none.
type Pictures = Result<[Capture; 2], String>;

/// The images of `scripts/effects` with some variables set. Each combination is rendered once.
fn images(with: With, name: &'static str, settings: &[(&str, &str)]) -> Option<[Capture; 2]> {
    static MADE: OnceLock<Mutex<BTreeMap<&str, Pictures>>> = OnceLock::new();
    let made = MADE.get_or_init(Mutex::default);
    let mut made = made.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let result = made.entry(name).or_insert_with(|| {
        let scripts = crate::session::scripts_in("effects");
        let run =
            Run::new(Program::Vtk, with, &scripts, output(&format!("effects-{name}")), settings)?;
        for script in ["room", "ball"] {
            run.images(script)?;
        }
        Ok([run.capture("room", "room")?, run.capture("ball", "ball")?])
    });
    result.clone().map_err(|reason| skip(&reason)).ok()
}

fn plain() -> Option<[Capture; 2]> {
    images(With::Bridge, "plain", &[])
}

fn rays(image: &Capture, kind: &str) -> u64 {
    let lists = image.renderers().iter().filter_map(|r| r["rays"].as_array());
    lists.flatten().filter(|r| r[0] == kind).filter_map(|r| r[1].as_u64()).sum()
}

#[test]
fn without_options_no_effect_runs_and_the_image_is_stock() {
    let (Some([room, _]), Some([stock, _])) = (plain(), images(With::Stock, "stock", &[])) else {
        return;
    };
    let limits = crate::compare::Limits::STRICT;
    assert_eq!(crate::compare::faults(&stock, &room, &limits), Vec::<String>::new());
    for kind in ["shadow", "ambient occlusion", "reflection", "refraction"] {
        assert_eq!(rays(&room, kind), 0, "{kind}");
    }
}

#[test]
fn off_leaves_everything_to_opengl() {
    let (Some(off), Some(stock)) =
        (images(With::Bridge, "off", &[("RTV_OFF", "1")]), images(With::Stock, "stock", &[]))
    else {
        return;
    };
    for (off, stock) in off.iter().zip(&stock) {
        assert!(
            off.rgb == stock.rgb && off.depth == stock.depth,
            "RTV_OFF=1 is not stock VTK, bit for bit"
        );
        assert_eq!(off.traced_elements(), 0);
    }
}

#[test]
fn shadows_fall_where_the_light_does_not_reach() {
    let (Some([plain, _]), Some([shadows, _])) =
        (plain(), images(With::Bridge, "shadows", &[("RTV_SHADOWS", "1")]))
    else {
        return;
    };
    let ratio = |place: &str| bright(shadows.at(place)) / bright(plain.at(place));
    assert!(ratio("shadow") < 0.3, "behind the box: {}", ratio("shadow"));
    for place in ["lit", "far_from_shadow", "open", "convex"] {
        assert!((ratio(place) - 1.0).abs() < 0.01, "{place}: {}", ratio(place));
    }
    assert!(rays(&shadows, "shadow") > 0);
    // Effects do not move surfaces.
    assert_eq!(plain.depth, shadows.depth);
}

#[test]
fn large_lights_soften_the_shadow_s_edge() {
    let hard = images(With::Bridge, "shadows", &[("RTV_SHADOWS", "1")]);
    let settings = [("RTV_SHADOWS", "1"), ("RTV_LIGHT_SIZE", "6"), ("RTV_SAMPLES", "16")];
    let (Some([hard, _]), Some([soft, _])) = (hard, images(With::Bridge, "soft", &settings)) else {
        return;
    };
    // Floor pixels between light and shadow.
    let [x, y] = hard.pixel("shadow");
    let row = |c: &Capture| {
        (x..c.width - 1).map(|u| bright(c.rgb[y * c.width + u].map(f64::from))).collect::<Vec<_>>()
    };
    let between = |c: &Capture| {
        let row = row(c);
        let (dark, light) = (row[0], row.iter().copied().fold(0.0, f64::max));
        row.iter()
            .filter(|v| **v > dark + 0.15 * (light - dark) && **v < dark + 0.85 * (light - dark))
            .count()
    };
    assert!(
        between(&soft) >= between(&hard) + 4,
        "{} pixels of half-shadow, {} before",
        between(&soft),
        between(&hard)
    );
}

#[test]
fn ambient_occlusion_darkens_concave_corners_only() {
    let settings = [("RTV_AO", "64"), ("RTV_AO_RADIUS", "1")];
    let (Some([plain, _]), Some([occluded, _])) = (plain(), images(With::Bridge, "ao", &settings))
    else {
        return;
    };
    assert!(rays(&occluded, "ambient occlusion") > 0);
    let none = [("RTV_AO", "64"), ("RTV_AO_RADIUS", "0.001")];
    let Some([unoccluded, _]) = images(With::Bridge, "ao-short", &none) else { return };
    let ratio = |place: &str| bright(occluded.at(place)) / bright(unoccluded.at(place));
    let (concave, convex, open) = (ratio("concave"), ratio("convex"), ratio("open"));
    assert!(concave < 0.9, "where box and floor meet: {concave}");
    assert!((convex - 1.0).abs() < 0.02, "on top of the box: {convex}");
    assert!((open - 1.0).abs() < 0.02, "open floor: {open}");
    assert_eq!(plain.depth, occluded.depth);
}

#[test]
fn mirrors_show_what_stands_on_them() {
    let (Some([plain, _]), Some([mirror, _])) = (
        plain(),
        images(With::Bridge, "mirror", &[("RTV_MIRROR", "0.5"), ("RTV_REFLECTIONS", "1")]),
    ) else {
        return;
    };
    assert!(rays(&mirror, "reflection") > 0);
    // The background is blue, the box red.
    let redder = |c: &Capture| {
        let [a, b] = [c.at("mirror_of_box"), c.at("mirror_of_background")];
        (a[0] - a[2]) - (b[0] - b[2])
    };
    assert!(
        redder(&mirror) > redder(&plain) + 20.0,
        "the floor before the box {:?}, before the background {:?}",
        mirror.at("mirror_of_box"),
        mirror.at("mirror_of_background")
    );
}

#[test]
fn glass_turns_the_background_upside_down() {
    let (Some([_, plain]), Some([_, glass])) =
        (plain(), images(With::Bridge, "glass", &[("RTV_MATERIAL", "glass")]))
    else {
        return;
    };
    assert!(rays(&glass, "refraction") > 0, "{:?}", glass.report);
    let blueness = |c: &Capture, from: f64, to: f64| {
        let (mut sum, mut n) = (0.0, 0.0);
        for y in (from * c.height as f64) as usize..(to * c.height as f64) as usize {
            for x in c.width * 9 / 20..c.width * 11 / 20 {
                let p = c.rgb[y * c.width + x];
                sum += f64::from(p[2]) - f64::from(p[0]);
                n += 1.0;
            }
        }
        sum / n
    };
    // Above the middle of the ball, the lower part of the background is visible, and vice versa.
    let (above, below) = (blueness(&glass, 0.6, 0.7), blueness(&glass, 0.3, 0.4));
    assert!(below > above + 20.0, "above the middle {above}, below {below}");
    let [above, below] = [(0.6, 0.7), (0.3, 0.4)].map(|(a, b)| blueness(&plain, a, b));
    assert!((above - below).abs() < 10.0, "without glass: {above}, {below}");
}

#[test]
fn depth_of_field_blurs_what_is_not_in_focus() {
    let settings = [("RTV_APERTURE", "0.15"), ("RTV_SAMPLES", "64")];
    let sharp = images(With::Bridge, "sharp", &[("RTV_SAMPLES", "64")]);
    let (Some([sharp, _]), Some([blurred, _])) = (sharp, images(With::Bridge, "lens", &settings))
    else {
        return;
    };
    // The steepest step along 25 pixels across an edge.
    let steepest = |c: &Capture, place: &str| {
        let [x, y] = c.pixel(place);
        let green = |u: usize| f64::from(c.rgb[y * c.width + u][1]);
        (x - 12..x + 12).map(|u| (green(u + 1) - green(u)).abs()).fold(0.0, f64::max)
    };
    let kept = |place: &str| steepest(&blurred, place) / steepest(&sharp, place);
    assert!(kept("near_edge") > 0.5, "the near box is in focus: {}", kept("near_edge"));
    assert!(kept("far_edge") < 0.35, "the far box is not: {}", kept("far_edge"));
}

#[test]
fn samples_smooth_silhouettes() {
    let (Some([plain, _]), Some([smooth, _])) =
        (plain(), images(With::Bridge, "sharp", &[("RTV_SAMPLES", "64")]))
    else {
        return;
    };
    let distinct = |c: &Capture| c.rgb.iter().collect::<std::collections::BTreeSet<_>>().len();
    assert!(
        distinct(&smooth) > distinct(&plain) + 50,
        "{} colours, {} before",
        distinct(&smooth),
        distinct(&plain)
    );
    // The interior of surfaces does not change.
    for place in ["lit", "open", "convex"] {
        assert!((bright(smooth.at(place)) - bright(plain.at(place))).abs() < 1.5, "{place}");
    }
}

#[test]
fn paths_carry_color_from_surface_to_surface() {
    let settings = [("RTV_MODE", "path"), ("RTV_SAMPLES", "256"), ("RTV_SHADOWS", "1")];
    let Some([room, _]) = images(With::Bridge, "paths", &settings) else { return };
    let red_part = |place: &str| room.at(place)[0] / bright(room.at(place));
    assert!(
        red_part("concave") > red_part("open") + 0.03,
        "the floor beside the red box {:?}, far away {:?}",
        room.at("concave"),
        room.at("open")
    );
}

#[test]
fn options_that_cannot_be_understood_are_named() {
    use crate::session::Launch;
    let line = format!(
        "exec /usr/bin/python3 '{}' \"$@\"",
        crate::peers::scripts().join("run_all.py").display()
    );
    let folder = output("effects-misspelt");
    std::fs::create_dir_all(&folder).unwrap();
    let launch = match Launch::new(Program::Vtk, With::Bridge, &line) {
        Ok(launch) => launch,
        Err(reason) => return skip(&reason),
    };
    let script = crate::peers::scripts().join("effects/ball.py");
    let out = launch.args([folder, script]).env("RTV_SHADOW", "1").env("RTV_AO", "many").output();
    let out = out.expect_success("a misspelt option");
    for word in ["RTV_SHADOWS", "RTV_AO=many"] {
        assert_eq!(
            out.stderr.matches(word).count(),
            1,
            "{word} must be named once:\n{}",
            out.stderr
        );
    }
}
