//! Effects switched on by variables: each changes the picture in its direction, and the report says what it cost.

use crate::peers::{Program, Run, peers};

fn report(path: &std::path::Path) -> serde_json::Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str::<serde_json::Value>(&text).expect("JSON")["renderers"][0].clone()
}

#[test]
fn each_effect_changes_the_picture_and_is_in_the_report() {
    let Some(peers) = peers() else { return };
    let script = "vtk/shadow_scene";
    let (plain, _) = peers.shot(Program::Vtk, script, &Run::traced());
    let file = peers.out.join("effects.json");
    let cases: [(&str, &[(&str, &str)], &str, i32); 7] = [
        ("shadows darken", &[("RTV_SHADOWS", "1")], "shadows", -1),
        ("soft shadows darken", &[("RTV_SHADOWS", "1"), ("RTV_LIGHT_SIZE", "5")], "soft shadows", -1),
        ("occlusion darkens", &[("RTV_AO", "16")], "ambient occlusion", -1),
        ("a mirror adds light", &[("RTV_MIRROR", "0.4")], "reflection", 1),
        ("metal reflects", &[("RTV_MATERIAL", "metal")], "glossy reflection", 0),
        ("glass refracts", &[("RTV_MATERIAL", "glass")], "refraction", 0),
        ("a lens blurs", &[("RTV_APERTURE", "0.2"), ("RTV_SAMPLES", "4")], "depth of field", 0),
    ];
    for (what, variables, effect, direction) in cases {
        let _ = std::fs::remove_file(&file);
        let run = variables.iter().fold(Run::traced(), |r, (n, v)| r.with(n, v));
        let (shot, said) = peers.shot(Program::Vtk, script, &run.with("RTV_REPORT", file.display()));
        let change = shot.brightness() - plain.brightness();
        let d = plain.difference(&shot);
        assert!(d.color_mean > 0.3, "{what}: nothing changed: {d:?}\n{said}");
        assert!(change * f64::from(direction) >= 0.0 && (direction == 0 || change.abs() > 0.1), "{what}: {change}");
        let r = report(&file);
        let effects = r["effects"].as_array().expect("a list");
        assert!(effects.iter().any(|e| e == effect), "{what}: {effects:?}");
        let costs = r["ms_by_effect"].as_array().expect("a list");
        assert!(costs.iter().any(|c| c[0] == effect && c[1].as_f64().is_some()), "{what}: {costs:?}");
    }
}

#[test]
fn without_options_no_secondary_ray_is_sent() {
    let Some(peers) = peers() else { return };
    let file = peers.out.join("plain.json");
    let (_, said) = peers.shot(Program::Vtk, "vtk/shadow_scene", &Run::traced().with("RTV_REPORT", file.display()));
    let r = report(&file);
    assert_eq!(r["effects"], serde_json::json!([]), "{said}");
    let rays = r["rays"].as_array().expect("a list");
    assert!(rays.len() == 1 && rays[0][0] == "primary", "{rays:?}");
    assert!(r["traced"].as_array().is_some_and(|t| t.len() == 3), "{r}");
}

#[test]
fn options_that_make_no_sense_are_named_once() {
    let Some(peers) = peers() else { return };
    let run = Run::traced().with("RTV_AO", "many").with("RTV_SHADOW", "1");
    let (_, said) = peers.shot(Program::Vtk, "vtk/contours", &run);
    assert_eq!(said.matches("RTV_AO=many").count(), 1, "{said}");
    assert!(said.contains("did you mean RTV_SHADOWS"), "{said}");
}

#[test]
fn shadows_of_a_lonely_headlight_are_a_warning_with_the_cure() {
    let Some(peers) = peers() else { return };
    let (_, said) = peers.shot(Program::Vtk, "vtk/contours", &Run::traced().with("RTV_SHADOWS", 1));
    assert!(said.contains("shadows change no pixel") && said.contains("add a light"), "{said}");
}

#[test]
fn off_means_off() {
    let Some(peers) = peers() else { return };
    let (stock, _) = peers.shot(Program::Vtk, "vtk/contours", &Run::plain());
    let (off, _) = peers.shot(Program::Vtk, "vtk/contours", &Run::traced().with("RTV_OFF", 1));
    assert_eq!((off.rgba, off.depth), (stock.rgba, stock.depth));
}
