//! `bench render` as its users start it: files of several formats in, a picture and an account out.

use datasets::image_io::{read_exr, read_png};
use datasets::model::{DataArray, Dataset, ImageData, PolyData, Values};
use datasets::write::{VtkOptions, write_obj, write_ply, write_vtk};
use glam::DVec3;
use rt_core::mesh::{Attribute, TriMesh};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn bench(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench")).args(args).output().expect("the program starts")
}

fn ball() -> TriMesh {
    let mut mesh = datasets::generate::shapes::icosphere(3);
    mesh.scalars = Some(Attribute::per_vertex(mesh.positions.iter().map(|p| p.z).collect()));
    mesh
}

fn field() -> Dataset {
    let n = 17;
    let mut image = ImageData::new([n; 3], DVec3::splat(-1.0), DVec3::splat(2.0 / f64::from(n - 1)));
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
    let (vtp, vti, obj, ply) = (path("ball.vtp"), path("field.vti"), path("ball.obj"), path("ball.ply"));
    let poly = Dataset::PolyData(PolyData::from_trimesh(&ball()));
    write_vtk(&vtp, &poly, VtkOptions::default()).unwrap();
    write_vtk(&vti, &field(), VtkOptions::default()).unwrap();
    // OBJ holds shape alone.
    let bare = TriMesh { scalars: None, colors: None, ..ball() };
    write_obj(&obj, &bare).unwrap();
    write_ply(&ply, &ball()).unwrap();
    vec![vtp, vti, obj, ply]
}

#[test]
fn files_of_several_formats_become_pictures_that_show_something() {
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

        let picture = read_png(&png).unwrap();
        let mut colors: Vec<[u32; 4]> = picture.rgba().unwrap().iter().map(|c| c.map(f32::to_bits)).collect();
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
    let args = ["render", vti.to_str().unwrap(), "-o", png.to_str().unwrap(), "--color-by", "pressure"];
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
