//! What a flow cannot be is refused or warned about by name, in the words of the command line.

mod program;

use datasets::model::{DataArray, Dataset, ImageData, Values};
use datasets::write::{VtkOptions, write_vtk};
use glam::DVec3;
use program::{schlieren, text};
use std::path::Path;

/// Air with a light node, and a velocity, with nodes at this distance.
fn air(path: &Path, spacing: f64) {
    let mut image = ImageData::new([9; 3], DVec3::ZERO, DVec3::splat(spacing));
    let mut rho = vec![1.2f64; 729];
    rho[364] = 0.9;
    let celsius = rho.iter().map(|r| 20.0 * r).collect();
    let velocity = (0..729 * 3).map(|i| f64::from(i % 5)).collect();
    image.attributes.point.push(DataArray::new("rho", 1, Values::F64(rho)));
    image.attributes.point.push(DataArray::new("T", 1, Values::F64(celsius)));
    image.attributes.point.push(DataArray::new("U", 3, Values::F64(velocity)));
    write_vtk(path, &Dataset::ImageData(image), VtkOptions::default()).unwrap();
}

/// A NumPy array of these numbers, version 1.0.
fn npy(path: &Path, shape: [usize; 3]) {
    let mut header = format!(
        "{{'descr': '<f4', 'fortran_order': True, 'shape': ({}, {}, {}), }}",
        shape[0], shape[1], shape[2]
    );
    header.push_str(&" ".repeat(117 - header.len()));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    let count: usize = shape.iter().product();
    bytes.extend((0..count).flat_map(|i| (1.2 + 1e-3 * (i % 7) as f32).to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn vectors_names_and_sizes_are_named_with_cures_that_exist_here() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    air(&dir.path().join("flow.vti"), 0.01);
    air(&dir.path().join("mm.vti"), 25.0);
    let png = path("a.png");
    let render = |file: &str, args: &[&str]| {
        let base = ["render", file, "--size", "16x16", "--tolerance", "1e-3rad", "-o", &png];
        schlieren(&[&base[..], args].concat())
    };
    for (file, args, code, words) in [
        ("flow.vti", &["--density", "U"][..], 1, "`U` has 3 numbers for each point"),
        ("flow.vti", &["--density", "U"], 1, "`U:magnitude`"),
        ("flow.vti", &["--density", "rh"], 1, "did you mean `rho`"),
        (
            "flow.vti",
            &["--temperature", "T", "--pressure", "101325"],
            0,
            "set --temperature-zero to",
        ),
        ("flow.vti", &["--temperature", "295", "--pressure", "rho"], 0, "--pressure-unit"),
        ("flow.vti", &["--temperature", "295", "--pressure", "rho"], 0, "set --pressure-zero to"),
        ("flow.vti", &["--density", "rho", "--density-unit", "1000"], 0, "--density-unit"),
        ("mm.vti", &["--density", "rho"], 0, "set --length-unit to 0.001"),
        ("flow.vti", &["--density", "rho", "--spacing", "0.1"], 1, "leave it out"),
        ("flow.vti", &["--density", "rho", "--skip=-1"], 2, "--skip is -1"),
        ("flow.vti", &["--density", "rho", "--span", "0.1"], 1, "span"),
    ] {
        let o = render(&path(file), args);
        let said = text(&o.stderr);
        assert_eq!(o.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
        for key in ["flow.", "film.", "march.", "lenses.", "light."] {
            let named = said.replace("flow.vti", "");
            assert!(!named.contains(key), "{args:?} names a key of a scene: {said}");
        }
    }
    let o = render(&path("flow.vti"), &["--density", "U:x"]);
    assert_eq!(o.status.code(), Some(0), "a component is one number: {}", text(&o.stderr));
    let celsius = ["--temperature", "T", "--temperature-zero", "273.15", "--pressure", "101325"];
    let o = render(&path("flow.vti"), &celsius);
    assert!(!text(&o.stderr).contains("--temperature-zero"), "{}", text(&o.stderr));
    let gauge = ["--temperature", "295", "--pressure", "rho", "--pressure-zero", "101325"];
    let o = render(&path("flow.vti"), &gauge);
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    assert!(!text(&o.stderr).contains("--pressure"), "{}", text(&o.stderr));
}

#[test]
fn every_command_takes_the_place_of_an_array() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    npy(&dir.path().join("rho.npy"), [12, 10, 8]);
    let (file, png) = (path("rho.npy"), path("a.png"));
    let place = ["--spacing", "0.01,0.01,0.02", "--origin=-1,0,2"];
    let o = schlieren(&["info", &file]);
    assert!(text(&o.stderr).contains("--spacing DX,DY,DZ"), "{}", text(&o.stderr));
    let o = schlieren(&[&["info", &file], &place[..]].concat());
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    let said = text(&o.stdout);
    assert!(said.contains("0.1100 x 0.0900 x 0.1400") && said.contains("--spacing=0.01"), "{said}");
    let base = ["--density", "rho", "--size", "16x16", "--tolerance", "1e-3rad", "--quiet"];
    for command in [
        &["render", &file, "-o", &png][..],
        &["sheet", &file, "-o", &png],
        &["probe", &file, "--pixel", "8,8"],
        &["sweep", &file, "--set", "film.focus_m=0.0,0.1", "-o", &png],
    ] {
        // A probe and a sheet have no size of their own to keep small, and take the same options.
        let o = schlieren(&[command, &base[..], &place[..]].concat());
        assert_eq!(o.status.code(), Some(0), "{command:?}: {}", text(&o.stderr));
    }
}

#[test]
fn overlays_and_displacements_are_written_with_their_scale() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    program::flow(&dir.path().join("flow.vti"));
    let (file, png, npy) = (path("flow.vti"), path("a.png"), path("a.npy"));
    let base = ["render", &file, "--density", "rho", "--size", "80x40", "--json", "--quiet"];
    let bos = ["--technique", "bos", "--film-distance", "1m", "-o", &png];
    let mut pictures = Vec::new();
    for overlay in [&[][..], &["--overlay", "arrows"], &["--overlay", "lic:deflection"]] {
        let o = schlieren(&[&base[..], &bos, overlay, &["--displacement", &npy]].concat());
        assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
        let json: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
        let scale = json["overlay"]["scale"].as_f64();
        assert_eq!(scale.is_some_and(|s| s > 0.0), !overlay.is_empty(), "{json}");
        pictures.push(std::fs::read(&png).unwrap());
    }
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
    let bytes = std::fs::read(&npy).unwrap();
    assert!(String::from_utf8_lossy(&bytes[..128]).contains("(40, 80, 2)"));
    for (args, words) in [
        (&["--overlay", "dots", "-o", &png][..], "arrows, lic"),
        (&["--overlay", "lic", "--npy", &npy], "-o PNG"),
        (&["--displacement", &png], "does not end in .npy"),
    ] {
        let o = schlieren(&[&base[..], args].concat());
        assert_eq!(o.status.code(), Some(2), "{args:?}");
        assert!(text(&o.stderr).contains(words), "{args:?}: {}", text(&o.stderr));
    }
}
