use super::paint::strokes;
use super::*;
use serde_json::json;

fn session(rest: &str) -> Session {
    let scene =
        Scene::from_toml(&format!("[flow]\nfile = \"a\"\ndensity = \"r\"\n{rest}")).unwrap();
    let array = |name: &str| ArrayInfo { name: name.into(), range: [0.0, 1.0] };
    Session::new(scene, vec![array("r"), array("T")], Vec::new()).unwrap()
}

fn scene(s: &Session) -> Scene {
    s.lock().scene.clone()
}

#[test]
fn a_change_merges_and_null_is_the_custom() {
    let s = session("");
    assert_eq!(
        s.edit(
            &json!({"film": {"exposure": 2.0, "size": [64, 32]}, "view": {"direction": "30,15"}})
        ),
        Ok(2)
    );
    assert_eq!((scene(&s).film.exposure, scene(&s).film.size), (Some(2.0), [64, 32]));
    assert_eq!(s.edit(&json!({"film": {"exposure": null}})), Ok(3));
    assert_eq!((scene(&s).film.exposure, scene(&s).film.size), (None, [64, 32]));
    assert_eq!(s.edit(&json!({"film": {"size": [64, 32]}})), Ok(3), "nothing changed");
}

#[test]
fn what_is_chosen_by_kind_is_replaced_whole() {
    let s = session("");
    let cutoff =
        json!({"technique": {"kind": "schlieren", "cutoff": {"kind": "circle", "radius_m": 1e-3}}});
    s.edit(&cutoff).unwrap();
    let TechniqueSpec::Schlieren { cutoff } = scene(&s).technique else { panic!() };
    assert_eq!(cutoff, CutoffSpec::Circle { radius_m: 1e-3, center_m: [0.0; 2] });
}

#[test]
fn another_technique_leaves_nothing_behind_and_comes_back_as_it_was() {
    let s = session(
        "[light]\nsource = { kind = \"circle\", diameter_m = 2e-3 }\n[film]\nexposure = 0.7",
    );
    for name in TechniqueSpec::NAMES {
        s.edit(&json!({"technique": {"kind": name}})).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(scene(&s).technique.name(), name);
    }
    assert_eq!(scene(&s).light.source, None);
    s.edit(&json!({"technique": {"kind": "schlieren"}})).unwrap();
    let back = scene(&s);
    assert!(back.light.source.is_some() && back.film.exposure == Some(0.7));
}

#[test]
fn refusals_say_why_and_change_nothing() {
    let s = session("");
    let before = scene(&s);
    for (patch, word) in [
        (json!([]), "a change is an object"),
        (json!({"solids": {"files": ["/etc/passwd"]}}), "cannot be changed from the page"),
        (json!({"flow": {"file": "/etc/passwd"}}), "only `multifield`"),
        (json!({"flow": 3}), "no object"),
        (
            json!({"technique": {"kind": "schlieren", "cutoff": {"kind": "image", "file": "/etc/passwd", "width_m": 1.0}}}),
            "cannot open",
        ),
        (json!({"film": {"size": [100_000, 100_000]}}), "at most 2048"),
        (json!({"film": {"size": [1e300, 1]}}), "not a scene"),
        (json!({"film": {"size": [0, 1]}}), "film.size"),
        (json!({"film": {"siez": 3}}), "siez"),
        (json!({"sampling": {"method": "photons", "samples": 1_000_000}}), "at most 4096"),
        (json!({"technique": {"kind": "magic"}}), "there are: shadowgraph"),
        (
            json!({"flow": {"multifield": {"fields": {"u": {"knots": [[0, 0]]}}}}}),
            "there is no array `u`",
        ),
        (
            json!({"flow": {"multifield": {"fields": {"T": {"knots": [[1, 0], [0, 0]]}}}}}),
            "multifield `T`",
        ),
    ] {
        let RefusedChange(text) = s.edit(&patch).unwrap_err();
        assert!(text.contains(word), "{patch}: {text}");
    }
    assert_eq!(scene(&s), before);
    assert_eq!(s.lock().generation, 1);
}

#[test]
fn curves_replace_the_density_and_give_it_back() {
    let s = session("");
    s.edit(&json!({"flow": {"multifield": {"fields": {"T": {"knots": [[0, 0], [1, -1e-4]]}}}}}))
        .unwrap();
    assert!(scene(&s).flow.density.is_none() && scene(&s).flow.multifield.is_some());
    s.edit(&json!({"flow": {"multifield": null}})).unwrap();
    assert_eq!(scene(&s).flow.density.as_deref(), Some("r"));
}

#[test]
fn the_first_stroke_keeps_the_knife_and_its_source() {
    let s = session("");
    let source = scene(&s).effective().light.source;
    let stroke = |points, rgb| Paint { on: Canvas::Filter, points, radius_m: 1e-4, rgb };
    let painted =
        s.paint(&stroke(vec![[0.0, 0.0], [1e-4, 0.0], [1e-4, 0.0]], [1.0, 0.0, 0.0])).unwrap();
    // The second point is repeated.
    assert_eq!((painted.added, painted.generation), (2, 2));
    let TechniqueSpec::Schlieren { cutoff: CutoffSpec::Painted(p) } = scene(&s).technique else {
        panic!()
    };
    assert_eq!(p.strokes.len(), 3, "the knife is the first");
    assert_eq!(scene(&s).light.source, source);
    assert!(Scene::from_toml(&s.toml().unwrap()).is_ok());

    let on_image = Paint { on: Canvas::Image, ..stroke(vec![[0.5, 0.5]], [1.0; 3]) };
    assert!(s.paint(&on_image).unwrap_err().0.contains("not rendered yet"));
    for (wrong, word) in [
        (stroke(vec![[f64::NAN, 0.0]], [1.0; 3]), "finite"),
        (stroke(vec![[0.0, 0.0]], [2.0, 0.0, 0.0]), "0 to 1"),
        (stroke(vec![[0.0, 0.0]; MAX_POINTS + 1], [1.0; 3]), "split the stroke"),
        (Paint { radius_m: 0.0, ..stroke(vec![], [1.0; 3]) }, "brush"),
    ] {
        assert!(s.paint(&wrong).unwrap_err().0.contains(word), "{wrong:?}");
    }
    s.edit(&json!({"technique": {"kind": "bos"}})).unwrap();
    assert!(s.paint(&stroke(vec![[0.0, 0.0]], [1.0; 3])).unwrap_err().0.contains("schlieren"));
}

#[test]
fn strokes_on_the_image_do_not_cross_a_shock() {
    let paint = Paint { on: Canvas::Image, points: vec![], radius_m: 1e-4, rgb: [0.0; 3] };
    let made = strokes(&[[0.0, 0.0], [1e-4, 0.0], [5e-3, 0.0]], &paint);
    assert_eq!(made.len(), 3);
    assert_eq!((made[1].from_m, made[1].to_m), ([0.0, 0.0], [1e-4, 0.0]));
    assert_eq!(made[2].from_m, [5e-3, 0.0], "a dab of its own");
}
