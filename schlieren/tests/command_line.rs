//! Tests the program `schlieren` as users and their scripts run it.

mod program;

use datasets::image_io::{MetadataValue, read_exr, read_png};
use program::{flow, flow_of, schlieren, text};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Shape and values of a NumPy file.
fn npy(path: &Path) -> (String, Vec<f32>) {
    let bytes = std::fs::read(path).expect("the map was written");
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = text(&bytes[10..end]);
    let shape = header.split_once("'shape': ").expect("a shape").1;
    let shape = shape.split_once(')').expect("its end").0.to_string() + ")";
    (
        shape,
        bytes[end..]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect(),
    )
}

#[test]
fn the_contract_png_exr_npy_and_json() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let (file, png, exr, map) =
        (path("flow.vti"), path("out.png"), path("out.exr"), path("out.npy"));
    let out = schlieren(&[
        "render",
        &file,
        "--density",
        "rho",
        "--view",
        "z",
        "--technique",
        "schlieren",
        "--size",
        "80x40",
        "-o",
        &png,
        "--exr",
        &exr,
        "--npy",
        &map,
        "--tolerance",
        "1e-7rad",
        "--device",
        "cpu",
        "--json",
    ]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let object: Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
    assert_eq!(object["technique"], "schlieren");
    assert_eq!(object["size"], serde_json::json!([80, 40]));
    assert!(object["deflection_error_rad"].as_f64().is_some_and(|e| e < 1e-7), "{object}");

    // The map has the shape (height, width, 2) with row 0 at the top. It is centred, and the larger
    // side, 0.2 m, fills the 80 pixels.
    let (shape, values) = npy(Path::new(&map));
    assert_eq!(shape, "(40, 80, 2)");
    assert_eq!(values.len(), 40 * 80 * 2);
    let deflection = |x_m: f64, y_m: f64| {
        let (i, j) = ((x_m / 2.5e-3 + 40.0) as usize, (20.0 - y_m / 2.5e-3) as usize);
        [values[(j * 80 + i) * 2], values[(j * 80 + i) * 2 + 1]]
    };
    // Light is bent away from the light gas at (0.03, 0.01).
    assert!(deflection(0.045, 0.01)[0] > 2e-5 && deflection(0.015, 0.01)[0] < -2e-5);
    assert!(deflection(0.03, 0.025)[1] > 2e-5 && deflection(0.03, -0.005)[1] < -2e-5);

    let image = read_exr(Path::new(&exr)).unwrap();
    for (plane, unit) in [
        ("Y", ""),
        ("deflection.X", "rad"),
        ("deflection.Y", "rad"),
        ("phase.Y", "waves"),
        ("transmission.Y", "1"),
        ("samples.Y", "photons"),
        ("error.Y", "1"),
        ("error.deflection", "rad"),
    ] {
        let p = image.plane(plane).unwrap_or_else(|| panic!("{plane}"));
        assert_eq!(p.unit, unit, "{plane}");
    }
    let x: Vec<f32> = values.iter().copied().step_by(2).collect();
    assert_eq!(image.plane("deflection.X").unwrap().samples, x);
    for (key, value) in [
        ("technique.kind", "schlieren"),
        ("technique.cutoff.kind", "knife"),
        ("flow.density", "rho"),
        ("view.direction", "z"),
    ] {
        assert_eq!(image.metadata.get(key), Some(&MetadataValue::Text(value.into())), "{key}");
    }
    assert_eq!(image.metadata.get("lenses.schlieren_m"), Some(&MetadataValue::Number(1.5)));
    let png = read_png(Path::new(&png)).unwrap();
    assert_eq!((png.width, png.height), (80, 40));
}

#[test]
fn temperature_pressure_and_species_are_the_same_air() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let map = |name: &str, args: &[&str]| {
        let (file, out) = (path("flow.vti"), path(name));
        let all = [&["render", &file, "--size", "40x20", "--npy", &out, "--quiet"], args].concat();
        let o = schlieren(&all);
        assert_eq!(o.status.code(), Some(0), "{args:?}: {}", text(&o.stderr));
        npy(Path::new(&out)).1
    };
    let density = map("a.npy", &["--density", "rho"]);
    let state = map("b.npy", &["--temperature", "T", "--pressure", "p"]);
    let species = map("c.npy", &["--density", "rho", "--species", "Y=He"]);
    let largest = density.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    let differ = |a: &[f32], b: &[f32]| {
        a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs())) / largest
    };
    // They differ because the density at 293.15 K and 101325 Pa is 1.204, not the 1.2 that T was
    // computed from, and because Ciddor's air is not ideal.
    assert!(differ(&density, &state) < 0.01, "{}", differ(&density, &state));
    assert!(differ(&density, &species) < 1e-5, "no helium changes nothing");
}

#[test]
fn wrong_usage_exits_with_2_and_names_the_option() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("flow.vti");
    flow(&file);
    let file = file.to_str().unwrap();
    let png = dir.path().join("x.png").to_str().unwrap().to_string();
    for (args, word) in [
        (&["--density", "rho"][..], "no output"),
        (&["--density", "rho", "-o", "x.jpg"], ".png"),
        (&["-o", &png], "density"),
        (
            &["--density", "rho", "--temperature", "T", "--pressure", "p", "-o", &png],
            "alternatives",
        ),
        (&["--density", "rho", "--device", "abacus", "-o", &png], "auto"),
        (&["--density", "rho", "--technique", "magic", "-o", &png], "shadowgraph"),
        (&["--density", "rho", "--fringe-spacing", "1mm", "-o", &png], "--fringe-spacing"),
        (
            &["--density", "rho", "--technique", "bos", "--cutoff-angle", "3", "-o", &png],
            "--cutoff-angle",
        ),
        (&["--density", "rho", "--technique", "slice", "--samples", "3", "-o", &png], "sampling"),
        (
            &["--density", "rho", "--cutoff", "circle", "--cutoff-open", "0.5", "-o", &png],
            "--cutoff-open",
        ),
        (&["--density", "rho", "--focal-length", "3m", "-o", &png], "--focal-length has"),
        (&["--density", "rho", "--noise-free", "--samples", "3", "-o", &png], "--samples"),
        (&["--density", "rho", "--view", "30,95", "-o", &png], "AZIMUTH"),
        (&["--density", "rho", "--tolerance", "1 foot", "-o", &png], "1e-7rad"),
        (&["--density", "rho", "--skip", "1e-9rad", "--march", "euler", "-o", &png], "only verlet"),
        (&["--density", "rho", "--skip=-1", "-o", &png], "--skip is -1"),
        (&["--density", "rho", "--curve", "T=300:0,900:-1e-4", "-o", &png], "alternatives"),
        (&["--density", "rho", "--curve-weight", "T=2", "-o", &png], "--curve-weight"),
        (&["--density", "rho", "--curve-rule", "sum", "-o", &png], "--curve-rule"),
        (&["--curve", "T=300", "-o", &png], "T=300:0,2000:-2e-4"),
        (&["--curve", "T=300:0", "--curve", "T=400:0", "-o", &png], "twice"),
        (&["--curve", "T=300:0,900:-1e-4", "--curve-weight", "Y=2", "-o", &png], "Y"),
    ] {
        let o = schlieren(&[&["render", file][..], args].concat());
        let stderr = text(&o.stderr);
        assert_eq!(o.status.code(), Some(2), "{args:?}: {stderr}");
        assert!(stderr.contains(word), "{args:?}: {stderr}");
        assert!(o.stdout.is_empty() && !Path::new(&png).exists());
    }
    let o = schlieren(&["render", file, "--density", "nothing", "-o", &png]);
    assert_eq!(o.status.code(), Some(1));
    assert!(
        text(&o.stderr).contains("nothing") && text(&o.stderr).contains("rho"),
        "{}",
        text(&o.stderr)
    );
}

#[test]
fn a_printed_scene_renders_the_same_image() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let options = [
        "--density",
        "rho",
        "--size",
        "40x20",
        "--technique",
        "interferogram",
        "--fringe-spacing",
        "10mm",
    ];
    let (file, a, b, toml) = (path("flow.vti"), path("a.png"), path("b.png"), path("scene.toml"));
    let o = schlieren(
        &[&["render", &file, "-o", &a, "--print-scene", "--quiet"], &options[..]].concat(),
    );
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    assert!(text(&o.stdout).contains("fringe_spacing_m = 0.01"), "{}", text(&o.stdout));
    std::fs::write(&toml, &o.stdout).unwrap();
    let o = schlieren(&["render", "--scene", &toml, "-o", &b, "--quiet"]);
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());

    std::fs::write(&toml, "[flow]\nfile = \"flow.vti\"\ndensty = \"rho\"\n").unwrap();
    let o = schlieren(&["render", "--scene", &toml, "-o", &b]);
    assert_eq!(o.status.code(), Some(1));
    assert!(text(&o.stderr).contains("densty"), "{}", text(&o.stderr));
}

#[test]
fn sweeps_number_their_images_and_probes_print_numbers() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let (file, png) = (path("flow.vti"), path("turn.png"));
    let base = ["--density", "rho", "--size", "40x20", "--quiet"];
    let o = schlieren(
        &[
            &["sweep", &file, "--set", "technique.cutoff.angle_deg=0.0,90.0", "-o", &png, "--json"],
            &base[..],
        ]
        .concat(),
    );
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    let lines: Vec<Value> =
        text(&o.stdout).lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[1]["swept"]["technique.cutoff.angle_deg"], 90.0);
    let bytes = ["turn-0000.png", "turn-0001.png"].map(|n| std::fs::read(path(n)).unwrap());
    assert_ne!(bytes[0], bytes[1], "the knife was turned");

    let o = schlieren(&[&["probe", &file, "--pixel", "29,8", "--json"], &base[..]].concat());
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    let p: Value = serde_json::from_slice(&o.stdout).unwrap();
    assert_eq!(p["status"], "free");
    assert!(p["deflection_rad"][0].as_f64().unwrap() > 1e-5, "{p}");
}

/// The option works on the command line and in a scene, in every command that renders or traces.
#[test]
fn gas_is_left_out_within_a_bound_that_is_reported() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    // The lattice is so fine that some bricks of 8 voxels are far from the blob.
    flow_of(&dir.path().join("flow.vti"), [129, 65]);
    let (file, png, scene) = (path("flow.vti"), path("a.png"), path("scene.toml"));
    std::fs::write(
        &scene,
        "[flow]\nfile = \"flow.vti\"\ndensity = \"rho\"\n[film]\nsize = [40, 20]\n[march]\nmethod \
         = \"verlet\"\nskip_rad = 1e-5\n",
    )
    .unwrap();
    let base = ["--density", "rho", "--size", "40x20", "--march", "verlet", "--json", "--quiet"];
    let json = |args: &[&str]| -> Vec<Value> {
        let o = schlieren(args);
        assert_eq!(o.status.code(), Some(0), "{args:?}: {}", text(&o.stderr));
        text(&o.stdout).lines().map(|l| serde_json::from_str(l).unwrap()).collect()
    };
    let plain = json(&[&["render", &file, "-o", &png], &base[..]].concat());
    assert!(plain[0]["left_out"].is_null());
    let by_option =
        json(&[&["render", &file, "-o", &png, "--skip", "1e-5rad"], &base[..]].concat());
    let by_scene = json(&["render", "--scene", &scene, "-o", &png, "--json", "--quiet"]);
    let probed = json(&["probe", "--scene", &scene, "--pixel", "2,18", "--json", "--quiet"]);
    let swept = json(&[
        "sweep",
        &file,
        "--scene",
        &scene,
        "--set",
        "march.skip_rad=0.0,1e-5",
        "-o",
        &png,
        "--json",
        "--quiet",
    ]);
    assert!(swept[0]["left_out"].is_null());
    for object in [&by_option[0], &by_scene[0], &probed[0], &swept[1]] {
        let left = &object["left_out"];
        assert!(left["steps_part"].as_f64().is_some_and(|p| p > 0.0 && p <= 1.0), "{object}");
        assert!(
            left["bound_rad"].as_f64().is_some_and(|b| (0.0..=1e-5 * 1.001).contains(&b)),
            "{object}"
        );
        assert!(object["march"].as_str().is_some_and(|m| m.contains("skipping")), "{object}");
    }
    // At the probe's pixel the gas is uniform to the last digit, but over the image it is not.
    assert!(by_option[0]["left_out"]["bound_rad"].as_f64().unwrap() > 0.0);
    // The change of the deflections is within the bound.
    let change = by_option[0]["largest_deflection_rad"].as_f64().unwrap()
        - plain[0]["largest_deflection_rad"].as_f64().unwrap();
    assert!(change.abs() <= 1e-5, "{change}");

    // Straight rays take no steps that could be skipped.
    let o = schlieren(&[
        "render",
        &file,
        "--density",
        "rho",
        "--size",
        "40x20",
        "--tolerance",
        "1e-2rad",
        "--skip",
        "1e-7rad",
        "-o",
        &png,
    ]);
    assert!(text(&o.stderr).contains("--skip has no effect"), "{}", text(&o.stderr));
    let o = schlieren(&[
        "render",
        &file,
        "--density",
        "rho",
        "--size",
        "40x20",
        "--technique",
        "slice",
        "--skip",
        "1e-7rad",
        "-o",
        &png,
    ]);
    assert!(text(&o.stderr).contains("--skip has no effect"), "{}", text(&o.stderr));
}

#[test]
fn transfer_functions_from_options_and_from_a_scene_are_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let (file, png, scene) = (path("flow.vti"), path("a.png"), path("scene.toml"));
    std::fs::write(
        &scene,
        "[flow]\nfile = \"flow.vti\"\n[flow.multifield]\nrule \
         = \"largest\"\n[flow.multifield.fields]\nT = { knots = [[293.15, 0.0], [400.0, -1e-4]], \
         weight = 2.0 }\nrho = { knots = [[0.9, 2e-5], [1.2, 0.0]] }\n[film]\nsize = [40, 20]\n",
    )
    .unwrap();
    let curves = [
        "--curve",
        "T=293.15:0,400:-1e-4",
        "--curve",
        "rho=0.9:2e-5,1.2:0",
        "--curve-weight",
        "T=2",
        "--curve-rule",
        "largest",
        "--size",
        "40x20",
    ];
    let run = |args: &[&str]| {
        let o = schlieren(&[args, &["--quiet"]].concat());
        assert_eq!(o.status.code(), Some(0), "{args:?}: {}", text(&o.stderr));
        text(&o.stdout)
    };
    let map = |name: &str, args: &[&str]| {
        let out = path(name);
        run(&[&["render", "--npy", &out], args].concat());
        npy(Path::new(&out)).1
    };
    let by_scene = map("scene.npy", &["--scene", &scene]);
    assert!(by_scene.iter().any(|v| v.abs() > 1e-6), "the curves bend light");
    assert_eq!(map("options.npy", &[&[file.as_str()], &curves[..]].concat()), by_scene);
    // A curve on the command line replaces that of the scene; the others are kept.
    let without = map("without.npy", &["--scene", &scene, "--curve-weight", "T=0"]);
    assert_ne!(without, by_scene);
    assert_eq!(map("again.npy", &["--scene", &scene, "--curve", "rho=0.9:2e-5,1.2:0"]), by_scene);

    let probe = |args: &[&str]| run(&[&["probe", "--pixel", "29,8", "--json"], args].concat());
    assert_eq!(probe(&[&[file.as_str()], &curves[..]].concat()), probe(&["--scene", &scene]));
    let swept = run(&[
        &["sweep", &file, "--set", "flow.multifield.rule=sum,largest", "-o", &png, "--json"],
        &curves[..],
    ]
    .concat());
    assert_eq!(swept.lines().count(), 2);
    let bytes = ["a-0000.png", "a-0001.png"].map(|n| std::fs::read(path(n)).unwrap());
    assert_ne!(bytes[0], bytes[1], "the rule was changed");
}

#[test]
fn smoke_glow_and_rotation_reach_images_layers_probes_and_sweeps() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let file = path("flow.vti");
    let media =
        ["--absorption", "soot", "--emission", "0.5", "--rotation", "-3", "--analyser", "-20"];
    let run = |command: &str, args: &[&str], media: &[&str]| {
        let mut all = vec![command, &file, "--density", "rho", "--size", "40x20", "--json"];
        all.extend(media);
        all.extend(args);
        let out = schlieren(&all);
        assert_eq!(out.status.code(), Some(0), "{all:?}: {}", text(&out.stderr));
        text(&out.stdout)
    };
    let exr = path("out.exr");
    let object: Value = serde_json::from_str(&run("render", &["--exr", &exr], &media)).unwrap();
    let warnings = object["warnings"].to_string();
    assert!(warnings.contains("media.absorption: 1 of 18081 values are not finite"), "{warnings}");
    assert!(warnings.contains("1 of 18081 values are below 0"), "{warnings}");
    assert!(object["counters"]["media_rays"].as_u64() > object["counters"]["rays"].as_u64());
    let image = read_exr(Path::new(&exr)).unwrap();
    let (tau, deep) = (6.0 * 0.1f32, 0.1f32);
    let glow = 0.5 / 6.0 * (1.0 - (-tau).exp());
    for (plane, unit, value) in [
        ("optical_depth.Y", "1", tau),
        ("emission.Y", "1", glow),
        ("rotation.Y", "rad", -3.0 * deep),
    ] {
        let p = image.plane(plane).unwrap_or_else(|| panic!("{plane}"));
        assert_eq!(p.unit, unit, "{plane}");
        let seen = p.samples[10 * 40 + 20];
        assert!((seen - value).abs() < 1e-5 * value.abs(), "{plane}: {seen} {value}");
    }
    let meta = |key: &str| image.metadata.get(key).cloned();
    assert_eq!(meta("media.absorption"), Some(MetadataValue::Text("soot".into())));
    assert_eq!(meta("media.analyser_deg"), Some(MetadataValue::Number(-20.0)));
    assert_eq!(meta("media.stop_m"), Some(MetadataValue::Number(0.025)));

    // Without media there are no such layers, and no rays are traced for them.
    let plain: Value = serde_json::from_str(&run("render", &["--exr", &exr], &[])).unwrap();
    assert_eq!(plain["counters"]["media_rays"], 0);
    let image = read_exr(Path::new(&exr)).unwrap();
    assert!(image.plane("optical_depth.Y").is_none() && meta("media.absorption").is_some());
    assert!(!image.metadata.keys().any(|k| k.starts_with("media.")));

    let probe: Value = serde_json::from_str(&run("probe", &["--pixel", "20,10"], &media)).unwrap();
    for (key, value) in [("optical_depth", tau), ("emission", glow), ("rotation_rad", -3.0 * deep)]
    {
        assert!(
            (probe[key].as_f64().unwrap() as f32 - value).abs() < 1e-5 * value.abs(),
            "{probe}"
        );
    }
    let malus = (-20f32.to_radians() + 0.3).cos().powi(2) * (-tau).exp();
    assert!((probe["transmission"].as_f64().unwrap() as f32 - malus).abs() < 1e-5, "{probe}");

    let png = path("out.png");
    let swept = run("sweep", &["--set", "media.analyser_deg=0.0,45.0", "-o", &png], &media[..6]);
    assert_eq!(swept.lines().count(), 2);
    assert!(dir.path().join("out-0001.png").exists());

    for (command, args, words) in [
        ("render", &["--absorption", "fog"][..], "fog"),
        ("render", &["--absorption", "-4"], "media.absorption"),
        ("render", &["--analyser", "45"], "media.rotation"),
        ("serve", &["--absorption", "soot"], "[media]"),
    ] {
        let mut all = vec![command, &file, "--density", "rho"];
        all.extend(args);
        if command == "render" {
            all.extend(["-o", &png]);
        }
        let out = schlieren(&all);
        let message = text(&out.stderr);
        assert!(out.status.code() != Some(0) && message.contains(words), "{all:?}: {message}");
    }
}

#[test]
fn the_index_of_a_state_and_of_a_table() {
    let o = schlieren(&[
        "index",
        "--wavelength-nm",
        "633",
        "--temperature-c",
        "20",
        "--pressure-pa",
        "101325",
        "--humidity",
        "0.5",
        "--co2-ppm",
        "450",
        "--json",
    ]);
    let n: Value = serde_json::from_slice(&o.stdout).unwrap();
    assert!((n["n_minus_1"].as_f64().unwrap() - 2.71372744e-4).abs() < 1e-12, "{n}");
    let dir = tempfile::tempdir().unwrap();
    let csv = dir.path().join("t.csv");
    std::fs::write(&csv, "lambda_um,T_C,p_Pa,RH_frac,CO2_ppm\n0.633,20,101325,0,450\n").unwrap();
    let o = schlieren(&["index", "--csv", csv.to_str().unwrap()]);
    let expected =
        "lambda_um,T_C,p_Pa,RH_frac,CO2_ppm,n_minus_1\n0.633,20,101325,0,450,2.71799831635e-4\n";
    assert_eq!(text(&o.stdout), expected);
    let o = schlieren(&["index", "--csv", csv.to_str().unwrap(), "--humidity", "0.5"]);
    assert_eq!(o.status.code(), Some(2));
}

#[test]
fn completions_know_the_commands() {
    let o = schlieren(&["completions", "bash"]);
    assert_eq!(o.status.code(), Some(0));
    assert!(text(&o.stdout).contains("sweep"));
}

/// Without a Vulkan device, as on most machines without a display, --device gpu is an error with
/// the cure, and auto renders on the CPU and prints the reason.
#[test]
fn a_gpu_that_is_not_there() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow(&dir.path().join("flow.vti"));
    let run = |device: &str, png: &str| {
        Command::new(env!("CARGO_BIN_EXE_schlieren"))
            .args([
                "render",
                &path("flow.vti"),
                "--density",
                "rho",
                "--size",
                "16x8",
                "--march",
                "verlet",
            ])
            .args(["--device", device, "-o", png])
            .env("VK_DRIVER_FILES", "/nonexistent.json")
            .env("VK_ICD_FILENAMES", "/nonexistent.json")
            .output()
            .expect("the program starts")
    };
    let o = run("gpu", &path("gpu.png"));
    let stderr = text(&o.stderr);
    assert_eq!(o.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("--device gpu") && stderr.contains("--device cpu"), "{stderr}");
    assert!(!Path::new(&path("gpu.png")).exists());
    let o = run("auto", &path("auto.png"));
    let stderr = text(&o.stderr);
    assert_eq!(o.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("on the CPU"), "{stderr}");
    assert!(Path::new(&path("auto.png")).exists());
}

/// With a Vulkan device, the report tells what a frame moved.
#[test]
fn the_work_of_a_gpu_is_in_the_report() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    flow_of(&dir.path().join("flow.vti"), [33, 17]);
    let (file, png) = (path("flow.vti"), path("a.png"));
    let base = ["--density", "rho", "--size", "40x20", "-o", &png, "--json", "--quiet"];
    let run = |device| {
        let o = schlieren(&[&["render", &file, "--device", device], &base[..]].concat());
        (o.status.code(), text(&o.stdout), text(&o.stderr))
    };
    assert!(serde_json::from_str::<Value>(&run("cpu").1).unwrap()["device"].is_null());
    let (code, out, err) = run("gpu");
    if code != Some(0) && err.contains("no GPU") {
        assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"), "{err}");
        return;
    }
    let object: Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {out} {err}"));
    assert_eq!(object["device"]["photons"], object["photons"]["sent"], "{object}");
    // 800 pixels of 4 bytes, the outcomes, and the rays of the margin.
    assert_eq!(object["device"]["bytes_from_device"], 800 * 4 + 56 + 4096 * 32);
}
