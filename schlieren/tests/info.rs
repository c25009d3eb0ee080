//! Tests `schlieren info`, and the background without the flow.

mod program;

use datasets::image_io::read_png;
use datasets::model::{DataArray, Dataset, ImageData, Values};
use datasets::write::{VtkOptions, write_vtk};
use glam::DVec3;
use program::{flow_of, schlieren, text};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// The words of a command that has no quotes.
fn words(command: &str) -> Vec<&str> {
    command.split(' ').skip(1).collect()
}

#[test]
fn info_prints_a_command_that_renders_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let solid = folder.path().join("flow.vti");
    flow_of(&solid, [13, 9]);
    let flat = folder.path().join("flat.vti");
    // A plane of a test section in millimetres.
    let mut image = ImageData::new([21, 11, 1], DVec3::ZERO, DVec3::splat(20.0));
    let values = (0..231).map(|i| 1.2 + 0.01 * f32::from((i % 21) as u8)).collect();
    image.attributes.point.push(DataArray::new("Density", 1, Values::F32(values)));
    write_vtk(&flat, &Dataset::ImageData(image), VtkOptions::default()).unwrap();
    for (file, option) in [(&solid, "--density rho"), (&flat, "--length-unit 0.001 --span 200")] {
        let path = file.to_str().unwrap();
        let said = schlieren(&["info", path]);
        assert!(said.status.success(), "{}", text(&said.stderr));
        let said = schlieren(&["--json", "info", path]);
        let value: Value = serde_json::from_slice(&said.stdout).unwrap();
        let command = value["command"].as_str().unwrap();
        assert!(command.contains(option), "{command}");
        let run = Command::new(env!("CARGO_BIN_EXE_schlieren"))
            .args(words(command))
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(run.status.success(), "{command}: {}", text(&run.stderr));
        assert!(folder.path().join("flow.png").exists());
        std::fs::remove_file(folder.path().join("flow.png")).unwrap();
    }
}

#[test]
fn the_background_without_the_flow_is_written_beside_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("flow.vti");
    flow_of(&file, [13, 9]);
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (flow, png, reference) = (path("flow.vti"), path("dots.png"), path("reference.png"));
    let size = ["--size", "80x40", "--film-distance", "2m"];
    let common = ["render", &flow, "--density", "rho", "-o", &png, "--reference", &reference];
    let run = schlieren(&[&common[..], &["--technique", "bos"], &size].concat());
    assert!(run.status.success(), "{}", text(&run.stderr));
    let [moved, still] = [&png, &reference].map(|p| read_png(Path::new(p)).unwrap());
    assert!(moved != still);
    // Other techniques have no background.
    let run = schlieren(&common);
    assert_eq!(run.status.code(), Some(2), "{}", text(&run.stderr));
}
