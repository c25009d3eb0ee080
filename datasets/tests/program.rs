//! The program `datasets` as started by a user: its output, its files, its exit codes.
#![cfg(feature = "program")]

use datasets::model::{Attributes, DataArray, Dataset, Points, StructuredGrid, Values};
use datasets::write::{VtkOptions, write_vtk};
use datasets::{stored_mesh, stored_volume};
use glam::{DVec3, UVec3};
use rt_core::mesh::MeshSlices;
use rt_core::stored_volume::{ValueType, VolumeLayout};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn datasets(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_datasets"))
        .current_dir(dir)
        .args(args)
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The JSON output of a successful run.
fn json(dir: &Path, args: &[&str]) -> Value {
    let out = datasets(dir, &[&["--json", "--quiet"], args].concat());
    assert_eq!(out.status.code(), Some(0), "{args:?}: {}", text(&out.stderr));
    serde_json::from_slice(&out.stdout)
        .unwrap_or_else(|e| panic!("{args:?}: {e}: {}", text(&out.stdout)))
}

fn arrays(info: &Value) -> Vec<&str> {
    let arrays = info["parts"][0]["arrays"].as_array().expect("arrays");
    arrays.iter().map(|a| a["name"].as_str().expect("a name")).collect()
}

#[test]
fn list_names_meshes_lines_and_flows_with_their_sizes() {
    let dir = tempfile::tempdir().unwrap();
    let list = json(dir.path(), &["list"]);
    let find = |name: &str| list.as_array().unwrap().iter().find(|e| e["name"] == name).cloned();
    for (name, kind) in [("wavelet", "mesh"), ("star-field-lines", "lines"), ("wedge", "flow")] {
        let entry = find(name).unwrap_or_else(|| panic!("{name} is missing from {list}"));
        assert_eq!(entry["kind"], kind, "{name}");
        assert!(entry["sizes"][0]["elements"].as_u64() > Some(0), "{name}");
    }
    let lines = text(&datasets(dir.path(), &["list"]).stdout);
    assert!(lines.lines().any(|l| l.starts_with("wavelet ") && l.contains("mesh")), "{lines}");
}

#[test]
fn a_mesh_is_made_described_and_converted_without_losing_a_triangle() {
    let dir = tempfile::tempdir().unwrap();
    let made = json(dir.path(), &["make", "icosphere", "--size", "small", "-o", "ball.vtp"]);
    assert_eq!((&made["kind"], made["cells"].as_u64()), (&"PolyData".into(), Some(1280)));
    let mut last = "ball.vtp";
    for next in ["ball.ply", "ball.obj", "ball.glb", "again.vtp"] {
        json(dir.path(), &["convert", last, next]);
        let info = json(dir.path(), &["info", next]);
        assert_eq!(info["cells"].as_u64(), Some(1280), "{last} to {next}: {info}");
        last = next;
    }
}

#[test]
fn a_flow_keeps_its_fields_and_has_an_isosurface() {
    let dir = tempfile::tempdir().unwrap();
    let made = json(dir.path(), &["make", "wedge", "-o", "wedge.vti", "--compress"]);
    assert_eq!((&made["size"], &made["kind"]), (&"tiny".into(), &"ImageData".into()));
    let info = json(dir.path(), &["info", "wedge.vti"]);
    assert!(arrays(&info).contains(&"density"), "{info}");
    let density = &info["parts"][0]["arrays"][0];
    let [low, high] = [0, 1].map(|i| density["range"][i].as_f64().unwrap());
    let middle = format!("{}", 0.5 * (low + high));
    let shock = json(
        dir.path(),
        &["convert", "wedge.vti", "shock.ply", "--isovalue", &middle, "--array", "density"],
    );
    assert!(shock["cells"].as_u64() > Some(0), "{shock}");
    let outside = format!("{}", high + 1.0);
    let out = datasets(dir.path(), &["convert", "wedge.vti", "none.ply", "--isovalue", &outside]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("cure: "), "{}", text(&out.stderr));
    assert!(!dir.path().join("none.ply").exists());
}

#[test]
fn cells_of_any_shape_have_isosurfaces_and_slices() {
    let dir = tempfile::tempdir().unwrap();
    let points: Vec<[f64; 3]> = (0..125)
        .map(|k| [k % 5, k / 5 % 5, k / 25].map(|c| f64::from(c) * 0.25))
        .map(|[x, y, z]| [x + 0.05 * z, y, z])
        .collect();
    let [x, y] = [0, 1].map(|a| points.iter().map(|p| p[a]).collect::<Vec<_>>());
    let mut grid = StructuredGrid {
        extent: [0, 4, 0, 4, 0, 4],
        points: Points::F64(points),
        attributes: Attributes::default(),
    };
    for (name, values) in [("x", x), ("y", y)] {
        grid.attributes.point.push(DataArray::new(name, 1, Values::F64(values)));
    }
    let file = dir.path().join("grid.vts");
    write_vtk(&file, &Dataset::StructuredGrid(grid), VtkOptions::default()).unwrap();

    let args = ["convert", "grid.vts", "iso.vtp", "--isovalue", "0.3", "--array", "x"];
    json(dir.path(), &[&args[..], &["--color-by", "y"]].concat());
    let iso = json(dir.path(), &["info", "iso.vtp"]);
    let range = &iso["parts"][0]["arrays"][0]["range"];
    assert_eq!((range[0].as_f64(), range[1].as_f64()), (Some(0.0), Some(1.0)), "{iso}");
    json(dir.path(), &["convert", "grid.vts", "cut.ply", "--slice", "0,0,0.6,0,0,1"]);
    let cut = json(dir.path(), &["info", "cut.ply"]);
    assert!(cut["cells"].as_u64() > Some(60), "{cut}");

    for (words, said) in [
        (["--isovalue", "7"], "contains the value 7"),
        (["--slice", "0,0,9,0,0,1"], "meets no cell"),
        (["--slice", "0,0,9,0,0,0"], "a normal that is not zero"),
    ] {
        let words = [&["convert", "grid.vts", "none.ply"][..], &words].concat();
        let out = datasets(dir.path(), &words);
        assert!(text(&out.stderr).contains(said), "{}", text(&out.stderr));
        assert!(matches!(out.status.code(), Some(1 | 2)) && !dir.path().join("none.ply").exists());
    }
}

#[test]
fn stored_files_are_described_without_reading_their_pages() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let layout = VolumeLayout {
        dims: UVec3::new(40, 5, 3),
        origin: DVec3::ZERO,
        spacing: DVec3::ONE,
        values: ValueType::I16,
    };
    let mut writer = stored_volume::create(&path("a.rtvolume"), layout).unwrap();
    for k in 0..3i16 {
        let plane: Vec<u8> = (0..200).flat_map(|i| (i - 100 * k).to_le_bytes()).collect();
        writer.add_plane(&plane).unwrap();
    }
    stored_volume::finish(writer).unwrap();
    let info = json(dir.path(), &["info", "a.rtvolume"]);
    assert_eq!((&info["format"], &info["points"]), (&"stored volume".into(), &600.into()));
    let values = &info["parts"][0]["arrays"][0];
    assert_eq!((&values["type"], &values["range"][0]), (&"i16".into(), &(-200.0).into()));
    assert_eq!(info["stored"]["pages"], 2);
    let said = text(&datasets(dir.path(), &["info", "a.rtvolume"]).stdout);
    assert!(said.contains("40 x 5 x 3") && said.contains("-200 to 199"), "{said}");

    let mut writer = stored_mesh::create(&path("a.rtmesh"), DVec3::ZERO).unwrap();
    writer.add(&MeshSlices::new(&[0., 0., 0., 4., 0., 0., 0., 4., 0.], &[0, 1, 2])).unwrap();
    stored_mesh::finish(writer).unwrap();
    let info = json(dir.path(), &["info", "a.rtmesh"]);
    assert_eq!((&info["cells"], &info["points"]), (&1.into(), &Value::Null));

    // Others cannot read it, and name what can.
    let out = datasets(dir.path(), &["convert", "a.rtvolume", "b.vti"]);
    let said = text(&out.stderr);
    assert!(out.status.code() == Some(1) && said.contains("bench render"), "{said}");
    let bytes = std::fs::read(path("a.rtvolume")).unwrap();
    std::fs::write(path("cut.rtvolume"), &bytes[..bytes.len() - 9]).unwrap();
    let out = datasets(dir.path(), &["info", "cut.rtvolume"]);
    let said = text(&out.stderr);
    assert!(out.status.code() == Some(1) && said.contains("cut.rtvolume"), "{said}");
}

#[test]
fn lines_keep_their_radius() {
    let dir = tempfile::tempdir().unwrap();
    json(dir.path(), &["make", "star-field-lines", "--size", "small"]);
    let file = std::fs::read_dir(dir.path()).unwrap().next().expect("a file").unwrap().path();
    let info = json(dir.path(), &["info", file.to_str().unwrap()]);
    assert_eq!(arrays(&info), ["scalars", "radius"]);
}

#[test]
fn wrong_usage_ends_with_2_and_names_what_is_right() {
    let dir = tempfile::tempdir().unwrap();
    for (args, named) in [
        (&["make", "teapot"][..], "icosphere"),
        (&["make", "icosphere", "--size", "huge"], "small"),
        (&["make", "wedge", "--normals"], "flow"),
        (&["convert", "a.vtp", "a.png"], ".glb"),
        (&["dance"], "Usage"),
    ] {
        let out = datasets(dir.path(), args);
        let message = text(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{args:?}: {message}");
        assert!(message.contains(named), "{args:?}: {message}");
        assert!(out.stdout.is_empty(), "{args:?}");
    }
    assert!(std::fs::read_dir(dir.path()).unwrap().next().is_none(), "nothing was written");
}

#[test]
fn a_missing_file_ends_with_1_and_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let out = datasets(dir.path(), &["info", "nowhere.vti"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("nowhere.vti"), "{}", text(&out.stderr));
}

#[test]
fn help_has_examples_and_completions_are_printed() {
    let dir = tempfile::tempdir().unwrap();
    for args in [&["--help"][..], &["make", "--help"], &["info", "--help"], &["convert", "--help"]]
    {
        let out = datasets(dir.path(), args);
        assert_eq!(out.status.code(), Some(0), "{args:?}");
        assert!(text(&out.stdout).contains("Examples:"), "{args:?}");
    }
    let out = datasets(dir.path(), &["completions", "bash"]);
    assert!(
        out.status.success() && text(&out.stdout).contains("datasets"),
        "{}",
        text(&out.stdout)
    );
}
