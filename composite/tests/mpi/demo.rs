//! `composite demo`: its images over threads, simulated ranks and MPI, and the input it rejects.

use super::program::{peer, run};
use std::path::Path;

#[test]
fn demo_rejects_impossible_input_and_renders_unusual_input() {
    let folder = std::env::temp_dir().join(format!("composite-strange-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        path.to_str().expect("a path in UTF-8").to_owned()
    };
    let out = folder.to_str().expect("a path in UTF-8");
    let demo = |more: &[&str]| {
        let ran =
            run(&[&["demo", "--size", "40", "--frames", "1", "--out", out], more].concat(), &[]);
        (ran.code, ran.text)
    };
    let triangle = |a: &str| format!("v {a}\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 2 3 4\n");
    // ---- Unusual but rendered: more ranks than triangles, a corner with NaN, far from everything,
    // without any size.
    let (code, text) = demo(&["-n", "64", "--data", &file("few.obj", &triangle("0 0 0"))]);
    assert_eq!(code, Some(0), "{text}");
    assert!(!text.contains("-0.00"), "no time is less than nothing: {text}");
    let (code, text) = demo(&["-n", "3", "--data", &file("nan.obj", &triangle("nan 0 0"))]);
    assert!(code == Some(0) && text.contains("left out: 1 primitives"), "{text}");
    let huge = "v 1e30 0 0\nv -1e30 0 0\nv 0 1e30 0\nf 1 2 3\n";
    assert_eq!(demo(&["-n", "2", "--data", &file("huge.obj", huge)]).0, Some(0));
    let point = "v 5 5 5\nv 5 5 5\nv 5 5 5\nf 1 2 3\n";
    let (code, text) = demo(&["-n", "3", "--data", &file("point.obj", point)]);
    assert_eq!(code, Some(0), "{text}");
    // ---- Rejected, with the reason.
    let known = file("known.obj", &triangle("0 0 0"));
    let missing = folder.join("missing.vtp").to_str().expect("a path in UTF-8").to_owned();
    for (arguments, words) in [
        (vec!["-n", "3", "--data", &file("empty.obj", "")], "holds no triangle"),
        (vec!["--data", &missing], "there is no file"),
        (vec!["--data", "wavelett"], "there are: wavelet"),
        (vec!["--data", &known, "--view", "inside"], "has no view `inside`"),
        (vec!["--data", &known, "--data-size", "1M"], "has no size `1M`"),
        (vec!["--scene", "discs", "--data", &known], "cannot be used with"),
        (vec!["--scene", "cubes"], "cubes"),
        (vec!["-n", "0"], "at least 1"),
        (vec!["-n", "5000"], "at most 4096"),
        (vec!["-n", "2,4"], "one number of ranks"),
    ] {
        let (code, text) = demo(&arguments);
        assert!(
            code == Some(2) && text.contains(words) && !text.contains("error: rank"),
            "{arguments:?}: {code:?} {text}"
        );
    }
    let nowhere = format!("{known}/below");
    let ran = run(&["demo", "--data", &known, "--size", "40", "--out", &nowhere], &[]);
    assert!(ran.code == Some(1) && ran.text.contains("cannot make the folder"), "{}", ran.text);
    std::fs::remove_dir_all(&folder).expect("the folder");
}

#[test]
fn demo_draws_a_bar_for_every_rank() {
    let folder = std::env::temp_dir().join(format!("composite-demo-{}", std::process::id()));
    let out = folder.to_str().expect("a path in UTF-8");
    let ran =
        run(&["demo", "-n", "5", "--size", "120", "--frames", "1", "--json", "--out", out], &[]);
    assert_eq!(ran.code, Some(0), "{}", ran.text);
    let shown: serde_json::Value =
        serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
    assert_eq!(shown["ranks"].as_array().map(Vec::len), Some(5));
    let plot = std::fs::read_to_string(folder.join("composite_demo.svg")).expect("the plot");
    let png = std::fs::read(folder.join("composite_demo.png")).expect("the image");
    std::fs::remove_dir_all(&folder).expect("the folder");
    for rank in 0..5 {
        assert!(plot.contains(&format!(">rank {rank}<")));
    }
    assert!(png.starts_with(b"\x89PNG"));
}

/// `composite demo` of this data set: its image and its output.
fn demo_of(data: &str, more: &[&str], variables: &[(&str, &Path)]) -> (Vec<u8>, serde_json::Value) {
    let name = format!("composite-demo-{}-{}", std::process::id(), more.join("").replace('-', "_"));
    let folder = std::env::temp_dir().join(name);
    let out = folder.to_str().expect("a path in UTF-8");
    let common = [
        "demo", "--data", data, "--grey", "--size", "160", "--frames", "2", "--json", "--out", out,
    ];
    let ran = run(&[&common, more].concat(), variables);
    assert_eq!(ran.code, Some(0), "{}", ran.text);
    let png = std::fs::read(folder.join("composite_demo.png")).expect("the image");
    std::fs::remove_dir_all(&folder).expect("the folder");
    (png, serde_json::from_str(ran.stdout.trim()).expect("one line of JSON"))
}

#[test]
fn a_file_rendered_in_parts_by_threads_models_and_mpi_ranks_is_the_image_of_one_rank() {
    let Some(mpirun) = peer("RTSV_MPIRUN") else { return };
    let file = std::env::temp_dir().join(format!("composite-part-{}.obj", std::process::id()));
    let mut obj = String::new();
    for k in 0..400 {
        let (x, y) = (f64::from(k % 20), f64::from(k / 20));
        let z = 3.0 * (0.9 * x).sin() * (0.7 * y).cos();
        obj += &format!("v {x} {y} {z}\nv {} {y} {z}\nv {x} {} {}\n", x + 1.4, y + 1.4, z + 0.6);
        obj += &format!("f {} {} {}\n", 3 * k + 1, 3 * k + 2, 3 * k + 3);
    }
    std::fs::write(&file, obj).expect("a file");
    let data = file.to_str().expect("a path in UTF-8");
    let (alone, one) = demo_of(data, &["--threads", "-n", "1"], &[]);
    let (parts, four) = demo_of(data, &["--mpi", "-n", "4"], &[("COMPOSITE_MPIRUN", &mpirun)]);
    let (headlight, _) = demo_of(data, &["--threads", "-n", "3", "--headlight"], &[]);
    for more in [&["--threads", "-n", "64"][..], &["--model", "-n", "8", "--cut-by-view"]] {
        let (others, _) = demo_of(data, more, &[]);
        assert!(alone == others, "{more:?}: the images differ");
    }
    if let Some(mpich) = peer("RTSV_MPIRUN_MPICH") {
        let (three, shown) = demo_of(data, &["--mpi", "-n", "3"], &[("COMPOSITE_MPIRUN", &mpich)]);
        assert!(
            alone == three && shown["transport"].as_str().is_some_and(|t| t.contains("MPICH")),
            "{shown}"
        );
    }
    std::fs::remove_file(&file).expect("the file");
    assert!(alone == parts, "the images differ");
    assert!(four["transport"].as_str().is_some_and(|t| t.contains("Open MPI")), "{four}");
    let triangles = |shown: &serde_json::Value| -> Vec<u64> {
        shown["ranks"]
            .as_array()
            .expect("ranks")
            .iter()
            .filter_map(|r| r["triangles"].as_u64())
            .collect()
    };
    assert_eq!(triangles(&one), [400]);
    assert_eq!(triangles(&four), [100; 4]);
    assert!(headlight != alone, "shadows are there");
}
