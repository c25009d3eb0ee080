//! `bench render` as started by a user: reads files of several formats, writes an image and a
//! summary.

mod store;

use datasets::image_io::{read_exr, read_png};
use datasets::model::{
    Attributes, DataArray, Dataset, ImageData, Points, PolyData, StructuredGrid, Values,
};
use datasets::write::{VtkOptions, write_glb, write_obj, write_ply, write_vtk};
use glam::DVec3;
use rt_core::mesh::{Attribute, TriMesh};
use serde_json::Value;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn bench(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench")).args(args).output().expect("the program starts")
}

/// Asserts that the program refuses these arguments, with these words.
fn refused(args: &[&str], words: [&str; 2]) {
    let out = bench(args);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(matches!(out.status.code(), Some(1 | 2)), "{args:?}: {text}");
    assert!(words.iter().all(|word| text.contains(word)), "{args:?}: {text}");
}

fn ball() -> TriMesh {
    let mut mesh = datasets::generate::shapes::icosphere(3);
    mesh.scalars = Some(Attribute::per_vertex(mesh.positions.iter().map(|p| p.z).collect()));
    mesh
}

fn field() -> Dataset {
    let n = 17;
    let mut image =
        ImageData::new([n; 3], DVec3::splat(-1.0), DVec3::splat(2.0 / f64::from(n - 1)));
    let at = |i: u32| 2.0 * i as f32 / (n - 1) as f32 - 1.0;
    let value = |i: u32| {
        let (x, y, z) = (at(i % n), at(i / n % n), at(i / n / n));
        1.0 - (x * x + y * y + z * z).sqrt()
    };
    let values = Values::F32((0..n * n * n).map(value).collect());
    image.attributes.point.push(DataArray::new("distance", 1, values));
    image.attributes.point_scalars = Some("distance".into());
    Dataset::ImageData(image)
}

fn files(dir: &Path) -> Vec<PathBuf> {
    let path = |name: &str| dir.join(name);
    let (vtp, vti, obj, ply) =
        (path("ball.vtp"), path("field.vti"), path("ball.obj"), path("ball.ply"));
    let glb = path("ball.glb");
    let poly = Dataset::PolyData(PolyData::from_trimesh(&ball()));
    write_vtk(&vtp, &poly, VtkOptions::default()).unwrap();
    write_vtk(&vti, &field(), VtkOptions::default()).unwrap();
    // OBJ stores geometry only.
    let bare = TriMesh { scalars: None, colors: None, ..ball() };
    write_obj(&obj, &bare).unwrap();
    write_ply(&ply, &ball()).unwrap();
    let colors =
        bare.positions.iter().map(|p| [0.5 + 0.5 * p.z, 0.4, 0.3, 1.0].map(|c| c.clamp(0.0, 1.0)));
    let colored = TriMesh { colors: Some(Attribute::per_vertex(colors.collect())), ..bare.clone() };
    write_glb(&glb, &colored).unwrap();
    vec![vtp, vti, obj, ply, glb]
}

#[test]
fn files_of_several_formats_render_to_images_that_show_something() {
    let dir = tempfile::tempdir().unwrap();
    for file in files(dir.path()) {
        let (png, exr) = (file.with_extension("png"), file.with_extension("exr"));
        let args = ["--size", "64x48", "--effects", "shadows,ao", "--json", "--quiet"];
        let (f, p, e) = (file.to_str().unwrap(), png.to_str().unwrap(), exr.to_str().unwrap());
        let out = bench(&[&["render", f, "-o", p, "--exr", e], &args[..]].concat());
        assert_eq!(out.status.code(), Some(0), "{f}: {}", String::from_utf8_lossy(&out.stderr));
        let object: Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
        assert_eq!(object["file"], f);
        assert_eq!(object["size"], serde_json::json!([64, 48]));
        assert!(object["rays"]["shadow"].as_u64() > Some(0), "{object}");
        assert!(object["rays"]["ambient_occlusion"].as_u64() > Some(0), "{object}");
        assert!(object["seconds"]["render"].as_f64() > Some(0.0), "{object}");

        let image = read_png(&png).unwrap();
        let mut colors: Vec<[u32; 4]> =
            image.rgba().unwrap().iter().map(|c| c.map(f32::to_bits)).collect();
        colors.sort_unstable();
        colors.dedup();
        assert!(colors.len() > 100, "{f}: {} colours", colors.len());
        let layers = read_exr(&exr).unwrap();
        let instance = &layers.plane("id.instance").expect("ids").samples;
        let seen = instance.iter().filter(|&&i| i >= 0.0).count();
        assert!((300..2700).contains(&seen), "{f}: {seen} pixels show the ball");
        assert!(layers.metadata.contains_key("effects"));
        let software = format!("bench {}", env!("CARGO_PKG_VERSION"));
        assert_eq!(layers.metadata.get("software"), Some(&software.into()));
    }
}

#[test]
fn a_bad_file_ends_with_1_and_names_itself_and_the_cure() {
    let dir = tempfile::tempdir().unwrap();
    let bad = dir.path().join("bad.vtp");
    std::fs::write(&bad, "<VTKFile type=\"PolyData\"").unwrap();
    let png = dir.path().join("bad.png");
    let out = bench(&["render", bad.to_str().unwrap(), "-o", png.to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&out.stderr).contains("bad.vtp"));
    assert!(!png.exists());

    let vti = dir.path().join("field.vti");
    write_vtk(&vti, &field(), VtkOptions::default()).unwrap();
    let args =
        ["render", vti.to_str().unwrap(), "-o", png.to_str().unwrap(), "--color-by", "pressure"];
    let out = bench(&args);
    let message = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(1));
    assert!(
        message.contains("pressure") && message.contains("distance") && message.contains("cure"),
        "{message}"
    );
}

#[test]
fn unknown_effects_sizes_and_endings_end_with_2_and_say_what_there_is() {
    for (args, says) in [
        (&["x.vtp", "-o", "x.png", "--effects", "caustics"][..], "path-tracing"),
        (&["x.vtp", "-o", "x.png", "--size", "0x3"], "960x540"),
        (&["x.vtp", "-o", "x.png", "--robustness", "loose"], "watertight"),
        (&["x.vtp", "-o", "x.jpg"], ".png"),
        (&["x.vtp"], "--out"),
    ] {
        let out = bench(&[&["render"], args].concat());
        let message = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(2), "{args:?}: {message}");
        assert!(message.contains(says), "{args:?}: {message}");
    }
}

/// Draws the field as a volume; returns the image's colours and the summary.
fn volume(vti: &Path, args: &[&str]) -> (Vec<[f32; 4]>, Value) {
    let png = vti.with_extension("png");
    let always =
        ["render", vti.to_str().unwrap(), "-o", png.to_str().unwrap(), "--size", "48x48", "--json"];
    let out = bench(&[&always, args].concat());
    assert_eq!(out.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    let pixels = read_png(&png).unwrap().rgba().unwrap();
    (pixels, serde_json::from_slice(&out.stdout).expect("one JSON object"))
}

#[test]
fn image_data_becomes_a_volume_that_opacity_and_isovalue_change() {
    let dir = tempfile::tempdir().unwrap();
    let vti = dir.path().join("field.vti");
    write_vtk(&vti, &field(), VtkOptions::default()).unwrap();
    let black = ["--background", "black"];
    let with = |more: &[&str]| volume(&vti, &[&black, more].concat());

    let (ramp, object) = with(&["--effects", "volumes"]);
    assert!(object["effects"].as_array().unwrap().contains(&"volumes".into()), "{object}");
    assert!(object["contents"][0].as_str().unwrap().contains("`distance` as a volume"), "{object}");
    assert_eq!((&object["triangles"], &object["warnings"]), (&0.into(), &serde_json::json!([])));
    // The distance is largest in the middle, so the middle glows most; the corners of the image are
    // empty.
    let light = |p: [f32; 4]| p[0] + p[1] + p[2];
    let (middle, side) = (light(ramp[24 * 48 + 24]), light(ramp[24 * 48 + 8]));
    assert!(middle > 1.2 * side && side > 0.0 && light(ramp[0]) == 0.0, "{middle} {side}");

    let (named, _) = with(&["--volume", "distance"]);
    assert_eq!(named, ramp, "the marked array, named");
    let (clear, _) = with(&["--volume", "distance", "--opacity", "0:0,1:0"]);
    assert!(clear.iter().all(|&p| light(p) == 0.0), "no opacity, no light");
    let (shell, _) = with(&["--volume", "distance", "--opacity", "0.4:0,0.5:0.9,0.6:0"]);
    assert_ne!(shell, ramp);
    let (both, object) = with(&["--effects", "volumes,shadows", "--isovalue", "0.5"]);
    assert_ne!(both, ramp);
    assert_eq!(object["contents"].as_array().unwrap().len(), 2, "{object}");

    // Light effects do not change a volume alone, which the program must report.
    let (_, object) = with(&["--effects", "volumes,shadows"]);
    assert!(
        object["warnings"][0].as_str().unwrap().contains("shadows changes no pixel"),
        "{object}"
    );
}

#[test]
fn an_isovalue_is_not_ignored_for_cells_that_are_no_lattice() {
    let dir = tempfile::tempdir().unwrap();
    let [vts, png] = ["grid.vts", "iso.png"].map(|name| dir.path().join(name));
    let at = |k: usize| [k % 9, k / 9 % 9, k / 81].map(|c| c as f64 / 8.0 - 0.5);
    let points: Vec<[f64; 3]> = (0..729).map(at).map(|[x, y, z]| [x + 0.1 * y, y, z]).collect();
    let radius = points.iter().map(|p| DVec3::from(*p).length()).collect();
    let height = points.iter().map(|p| p[2]).collect();
    let mut grid = StructuredGrid {
        extent: [0, 8, 0, 8, 0, 8],
        points: Points::F64(points),
        attributes: Attributes::default(),
    };
    grid.attributes.point.push(DataArray::new("radius", 1, Values::F64(radius)));
    grid.attributes.point.push(DataArray::new("height", 1, Values::F64(height)));
    write_vtk(&vts, &Dataset::StructuredGrid(grid), VtkOptions::default()).unwrap();
    let [vts, png] = [&vts, &png].map(|path| path.to_str().unwrap());
    let render = ["render", vts, "-o", png, "--size", "40x40", "--json"];
    let drawn = |more: &[&str]| {
        let out = bench(&[&render[..], more].concat());
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let said: Value = serde_json::from_slice(&out.stdout).unwrap();
        (read_png(Path::new(png)).unwrap().rgba().unwrap(), said)
    };
    let (box_of_cells, _) = drawn(&[]);
    let (ball, said) = drawn(&["--isovalue", "0.4"]);
    assert!(said["contents"][0].as_str().unwrap().contains("`radius` = 0.4 in 512"), "{said}");
    assert_ne!(ball, box_of_cells);
    let (colored, _) = drawn(&["--isovalue", "0.4", "--color-by", "height"]);
    assert_ne!(ball, colored);
    refused(&[&render[..], &["--isovalue", "7"]].concat(), ["`radius` ranges from 0", "choose"]);
}

#[test]
fn volumes_without_a_uniform_grid_are_refused_with_the_cure() {
    let dir = tempfile::tempdir().unwrap();
    let files = files(dir.path());
    let png = dir.path().join("refused.png");
    let refused = |file: &Path, args: &[&str]| {
        let always = ["render", file.to_str().unwrap(), "-o", png.to_str().unwrap()];
        let out = bench(&[&always, args].concat());
        assert!(!png.exists());
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    for file in files.iter().filter(|f| !f.ends_with("field.vti")) {
        let (code, message) = refused(file, &["--effects", "volumes"]);
        assert_eq!(code, Some(1), "{message}");
        let name = file.file_name().unwrap().to_str().unwrap();
        assert!(message.contains(name) && message.contains("Resample To Image"), "{message}");
    }
    let vti = &files[1];
    let (code, message) = refused(vti, &["--volume", "pressure"]);
    assert!(
        code == Some(1) && message.contains("pressure") && message.contains("distance"),
        "{message}"
    );
    let (code, message) = refused(vti, &["--opacity", "0:0,1:1"]);
    assert!(code == Some(2) && message.contains("--effects volumes"), "{message}");
    for bad in ["1:0,0:1", "0:2", "0.5"] {
        let (code, message) = refused(vti, &["--effects", "volumes", "--opacity", bad]);
        assert!(code == Some(2) && message.contains("SCALAR:OPACITY"), "{bad}: {message}");
    }
}

#[test]
#[cfg(unix)]
fn ctrl_c_within_an_image_keeps_its_samples_and_ends_with_130() {
    let dir = tempfile::tempdir().unwrap();
    let (vti, png) = (dir.path().join("field.vti"), dir.path().join("field.png"));
    write_vtk(&vti, &field(), VtkOptions::default()).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_bench"))
        .args(["render", vti.to_str().unwrap(), "-o", png.to_str().unwrap(), "-v"])
        .args(["--size", "64x48", "--samples", "65536", "--effects", "soft-shadows,ao"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    lines
        .by_ref()
        .find(|l| l.as_ref().unwrap().starts_with("drawing"))
        .expect("notes with -v")
        .unwrap();
    // One sample takes milliseconds, all of them minutes.
    std::thread::sleep(Duration::from_secs(3));
    let pressed = Instant::now();
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let rest: String = lines.map(|l| l.unwrap() + "\n").collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest}");
    assert!(pressed.elapsed() < Duration::from_secs(10), "stopped after {:?}", pressed.elapsed());
    assert!(
        rest.contains("of 65536 samples") && rest.contains("finished results are kept"),
        "{rest}"
    );
    assert_eq!(read_png(&png).unwrap().width, 64);
}

#[test]
fn a_stored_mesh_is_drawn_and_refuses_what_it_cannot_honour() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name).display().to_string();
    let (stored, png) = (of("ball.rtmesh"), of("ball.png"));
    files(dir.path());
    let (glb, ply) = (of("ball.glb"), of("ball.ply"));
    let made = bench(&["store", &glb, "-o", &stored, "--json"]);
    let said: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!(said["triangles"], ball().num_triangles());
    let warned = String::from_utf8_lossy(&made.stderr).into_owned();
    assert!(warned.contains("materials are not stored"), "{warned}");
    assert!(said["attribute_bytes"].as_u64().unwrap() > 0, "{said}");

    let drawn = bench(&["render", &stored, "-o", &png, "--size", "64x64", "--json"]);
    assert!(drawn.status.success(), "{}", String::from_utf8_lossy(&drawn.stderr));
    let said: Value = serde_json::from_slice(&drawn.stdout).unwrap();
    assert!(said["stored"]["page_reads"].as_u64().unwrap() >= 1, "{said}");
    assert_eq!(said["triangles"], ball().num_triangles());
    let pixels = read_png(Path::new(&png)).unwrap().rgba().unwrap();
    assert!(pixels.iter().filter(|c| **c != pixels[0]).count() > 500);

    let refused = |args: &[&str], word: &str| {
        let out = bench(&[&["render"], args, &["-o", png.as_str()]].concat());
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(2), "{args:?}: {text}");
        assert!(text.contains(word) && text.contains("leave it out"), "{args:?}: {text}");
    };
    refused(&[&stored, "--storage", "compact"], "--storage");
    refused(&[&stored, "--robustness", "fast"], "--robustness");
    refused(&[&stored, "--color-by", "z"], "--color-by");
    refused(&[&stored, "--range", "0,1"], "--range");
    refused(&[&ply, "--memory", "5"], "--memory");
}

#[test]
fn a_stored_mesh_has_the_picture_of_the_mesh_in_memory() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name).display().to_string();
    files(dir.path());
    let (vtp, stored) = (of("ball.vtp"), of("ball.rtmesh"));
    let camera = of("camera.toml");
    std::fs::write(&camera, "eye = [2.0, 1.5, 1.0]\ntarget = [0.0, 0.0, 0.0]\n").unwrap();
    let pixels = |file: &str| {
        let png = of("picture.png");
        let size = ["--size", "96x96", "--samples", "1", "--camera", camera.as_str()];
        let drawn = bench(&[&["render", file, "-o", &png], &size[..]].concat());
        assert!(drawn.status.success(), "{}", String::from_utf8_lossy(&drawn.stderr));
        read_png(Path::new(&png)).unwrap().rgba().unwrap()
    };
    let expected = pixels(&vtp);
    for (options, most) in [(&[][..], 1.5), (&["--normal-tolerance", "0.05"][..], 2.5)] {
        let made = bench(&[&["store", &vtp, "-o", &stored], options].concat());
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let found = pixels(&stored);
        // Steps of 256.
        let off = |(a, b): (&[f32; 4], &[f32; 4])| {
            a.iter().zip(b).any(|(a, b)| 255.0 * (a - b).abs() > most)
        };
        let wrong = found.iter().zip(&expected).filter(|&pair| off(pair)).count();
        assert_eq!(wrong, 0, "{options:?}: {wrong} pixels of {}", found.len());
    }
    // Without attributes, it is flat and has one colour.
    let made = bench(&["store", &vtp, "-o", &stored, "--no-attributes", "--json"]);
    let said: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!(said["attribute_bytes"], 0);
    assert!(pixels(&stored) != expected);
}

#[test]
fn a_stored_volume_has_the_picture_of_the_lattice_in_memory_and_refuses_the_rest() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name).display().to_string();
    files(dir.path());
    // 40 x 36 x 34 bytes, and the same in single precision in a file that is read as a whole.
    let (dims, raw, vti) = ([40, 36, 34], of("waves_40x36x34_uint8.raw"), of("waves.vti"));
    let at = |i: u32| [i % 40, i / 40 % 36, i / 40 / 36].map(|x| 0.2 * f64::from(x));
    let wave = |[x, y, z]: [f64; 3]| 128.0 + 40.0 * (x.sin() + y.cos() + (z + x).sin());
    let values: Vec<u8> = (0..dims.iter().product()).map(|i| wave(at(i)) as u8).collect();
    std::fs::write(&raw, &values).unwrap();
    let mut image = ImageData::new(dims, DVec3::ZERO, DVec3::ONE);
    let floats = values.iter().map(|v| f32::from(*v)).collect();
    image.attributes.point.push(DataArray::new("waves", 1, Values::F32(floats)));
    write_vtk(Path::new(&vti), &Dataset::ImageData(image), VtkOptions::default()).unwrap();

    let (stored, png) = (of("waves.rtvolume"), of("picture.png"));
    let camera = of("camera.toml");
    std::fs::write(&camera, "eye = [80.0, -40.0, 60.0]\ntarget = [20.0, 18.0, 17.0]\n").unwrap();
    let drawn = |file: &str, options: &[&str]| {
        let size = ["--size", "96x96", "--samples", "1", "--json", "--camera", camera.as_str()];
        let drawn = bench(&[&["render", file, "-o", &png], options, &size].concat());
        assert!(drawn.status.success(), "{}", String::from_utf8_lossy(&drawn.stderr));
        let said: Value = serde_json::from_slice(&drawn.stdout).unwrap();
        (read_png(Path::new(&png)).unwrap().rgba().unwrap(), said)
    };
    let pixels = |file: &str| drawn(file, &["--isovalue", "150.5", "--effects", "shadows"]);
    let (expected, _) = pixels(&raw);
    assert!(expected.iter().filter(|c| **c != expected[0]).count() > 1500);
    // As a medium, alone and with a surface in it; no memory: each brick is read again and again.
    let looks: [&[&str]; 2] = [
        &["--effects", "volumes", "--opacity", "120:0,200:0.8", "--range", "100,220"],
        &["--effects", "volumes", "--isovalue", "150.5"],
    ];
    let media = looks.map(|look| drawn(&raw, look).0);
    assert!(media[0] != expected && media[1] != media[0]);
    for (file, least, most) in [(&raw, 1.0, 1.4), (&vti, 4.0, 5.0)] {
        let made = bench(&["store", file, "-o", &stored, "--json"]);
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let said: Value = serde_json::from_slice(&made.stdout).unwrap();
        assert_eq!((said["points"].as_u64(), said["bricks"].as_u64()), (Some(48_960), Some(8)));
        let bytes_a_point = said["bytes"].as_f64().unwrap() / 48_960.0;
        assert!((least..most).contains(&bytes_a_point), "{bytes_a_point}");
        let (found, said) = pixels(&stored);
        assert!(found == expected, "{file}");
        assert_eq!(said["format"], "stored volume");
        assert!(said["stored"]["page_reads"].as_u64().unwrap() >= 1, "{said}");
        for (look, expected) in looks.iter().zip(&media) {
            let (found, said) = drawn(&stored, &[*look, &["--memory", "0"]].concat());
            assert!(found == *expected, "{file}: {look:?}");
            assert!(said["rays"]["volume"].as_u64().unwrap() > 1000, "{said}");
        }
    }

    let render = ["render", stored.as_str(), "-o", png.as_str()];
    refused(&[&render[..], &["--isovalue", "300"]].concat(), ["300", "choose --isovalue"]);
    refused(&[&render[..], &["--color-by", "waves"]].concat(), ["--color-by", "leave it out"]);
    refused(&[&render[..], &["--volume", "waves"]].concat(), ["--volume", "--effects volumes"]);
    refused(&[&render[..], &["--range", "0,9"]].concat(), ["--range", "leave it out"]);
    let store = ["store", raw.as_str(), "-o", stored.as_str()];
    refused(&[&store[..], &["--isovalue", "3"]].concat(), ["--isovalue", "belongs to meshes"]);
    refused(&[&store[..], &["--memory", "3"]].concat(), ["--memory", "belongs to meshes"]);
    refused(&[&store[..], &["--array", "other"]].concat(), ["`other`", "`waves`"]);
    refused(&["store", &of("ball.vtp"), "-o", &stored], ["cannot be stored as a volume", "mesh"]);
    let made = bench(&["store", "--mixing-layer", "48", "-o", &stored, "--json"]);
    let said: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!(said["dims"], serde_json::json!([48, 48, 45]));
}

#[test]
fn an_isosurface_of_image_data_is_stored_in_pieces_with_the_triangles_of_the_whole() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name).display().to_string();
    files(dir.path());
    let (raw, vti) = (of("waves_30x20x90_int16.raw"), of("field.vti"));
    let at = |i: u32| [i % 30, i / 30 % 20, i / 600].map(|x| 0.2 * f64::from(x));
    let wave = |[x, y, z]: [f64; 3]| 9000.0 * (x.sin() + y.cos() + (z + x).sin());
    let values = (0..54_000).flat_map(|i| (wave(at(i)) as i16).to_le_bytes());
    std::fs::write(&raw, values.collect::<Vec<u8>>()).unwrap();
    let stored = of("surface.rtmesh");
    for file in [&raw, &vti] {
        let opened = datasets::read::open(file).unwrap();
        let data = opened.dataset().unwrap();
        let name = data.attributes().unwrap().point[0].name.clone();
        let grid = data.to_grid(&name).unwrap();
        let (lo, hi) = grid.range().unwrap();
        for isovalue in [None, Some(0.3 * lo + 0.7 * hi)] {
            let level = isovalue.map(|v| v.to_string());
            let given: Vec<&str> = level.iter().flat_map(|v| ["--isovalue", v.as_str()]).collect();
            let store = ["store", file.as_str(), "-o", &stored, "--json", "--array", &name];
            let made = bench(&[&store[..], &given].concat());
            assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
            let said: Value = serde_json::from_slice(&made.stdout).unwrap();
            let isovalue = f64::from(isovalue.unwrap_or(0.5 * lo + 0.5 * hi));
            let whole = datasets::isosurface::extract(&grid, &[isovalue], Default::default());
            assert_eq!(said["triangles"], whole.unwrap().mesh.num_triangles(), "{file}");
            assert!(said["attribute_bytes"].as_u64().unwrap() > 0, "it has normals: {said}");
        }
    }
    let made = bench(&["store", "--mixing-layer", "48", "-o", &stored, "--json"]);
    let said: Value = serde_json::from_slice(&made.stdout).unwrap();
    let layer = datasets::generate::mixing_layer::MixingLayer::new(48, datasets::catalogue::SEED);
    let whole = layer.surface(Default::default(), |_| true).unwrap();
    assert_eq!(said["triangles"], whole.mesh.num_triangles());

    let store = ["store", raw.as_str(), "-o", stored.as_str()];
    refused(&[&store[..], &["--array", "other"]].concat(), ["`other`", "`waves`"]);
    refused(&[&store[..], &["--color-by", "waves"]].concat(), ["--color-by", "one value"]);
    refused(&[&store[..], &["--isovalue", "99999"]].concat(), ["99999", "choose --isovalue"]);
    // A flat image is the surface that it is.
    let flat = of("flat_30x20x1_uint8.raw");
    std::fs::write(&flat, [7; 600]).unwrap();
    let made = bench(&["store", &flat, "-o", &stored, "--json"]);
    let said: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!(said["triangles"], 2 * 29 * 19);
    let ball = of("ball.vtp");
    let store = ["store", ball.as_str(), "-o", stored.as_str()];
    refused(&[&store[..], &["--array", "z"]].concat(), ["--array", "of image data"]);
    refused(&[&store[..], &["--isovalue", "1"]].concat(), ["--isovalue", "of image data"]);
}
