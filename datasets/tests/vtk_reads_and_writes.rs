//! Files written by VTK are read as VTK reads them, and VTK reads the files written here.

mod peer;
mod sample_files;

use datasets::model::{DataArray, Dataset, ScalarType, SharedFaces};
use datasets::read::vtk_xml::CellPieces;
use datasets::read::{Content, LoadedFile, ReadError, open};
use datasets::write::{Encoding, VtkOptions, write_ply, write_vtk};
use rt_core::mesh::PerElement;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Writes files with VTK and reads them with it.
const SCRIPT: &str = include_str!("vtk_files/write_all.py");

/// A weighted sum that changes with any misplaced value, computed as in the script.
fn weighted(values: impl Iterator<Item = f64>) -> f64 {
    values.enumerate().map(|(i, v)| v * ((i + 1) as f64 % 97.0)).sum()
}

/// Asserts equality up to the rounding of a sum in another order.
fn assert_close(found: f64, expected: f64, scale: f64, what: &str) {
    assert!(
        (found - expected).abs() <= 1e-9 * scale.max(1.0),
        "{what}: found {found}, VTK has {expected}"
    );
}

fn same_type(kind: ScalarType, vtk: &str) -> bool {
    let names: &[&str] = match kind {
        ScalarType::I8 => &["char", "signed char"],
        ScalarType::U8 => &["unsigned char"],
        ScalarType::I16 => &["short"],
        ScalarType::U16 => &["unsigned short"],
        ScalarType::I32 => &["int"],
        ScalarType::U32 => &["unsigned int"],
        ScalarType::I64 => &["long", "long long", "vtkIdType"],
        ScalarType::U64 => &["unsigned long", "unsigned long long"],
        ScalarType::F32 => &["float"],
        ScalarType::F64 => &["double"],
    };
    names.contains(&vtk)
}

/// Compares a data set with VTK's description of it. `ascii` legacy files round to few digits.
fn compare(file: &str, opened: &LoadedFile, expected: &Value) {
    let Content::Data(data) = &opened.content else { panic!("{file}: not a data set") };
    assert_eq!(data.kind(), expected["kind"], "{file}");
    let (points, cells) = data.counts();
    if expected.get("points").is_some() {
        assert_eq!(
            (points, cells),
            (expected["points"].as_u64().unwrap(), expected["cells"].as_u64().unwrap()),
            "{file}"
        );
    }
    let a = data.attributes().expect("a single data set");
    let mut ours: BTreeMap<String, &DataArray> = BTreeMap::new();
    for (of, list) in [("point", &a.point), ("cell", &a.cell), ("field", &a.field)] {
        ours.extend(list.iter().map(|x| (format!("{of}:{}", x.name), x)));
    }
    let theirs = expected["arrays"].as_object().unwrap();
    for (key, e) in theirs {
        if let Some(text) = e.get("text") {
            let name = key.split_once(':').unwrap().1;
            let found = a
                .text
                .iter()
                .find(|(n, _)| n == name)
                .unwrap_or_else(|| panic!("{file}: text {key} is missing"));
            assert_eq!(serde_json::json!(found.1), *text, "{file} {key}");
            continue;
        }
        let x = ours.get(key).unwrap_or_else(|| {
            panic!("{file}: array {key} is missing; there are {:?}", ours.keys())
        });
        assert_eq!(x.components as u64, e["components"].as_u64().unwrap(), "{file} {key}");
        assert_eq!(x.values.len() as u64, e["values"].as_u64().unwrap(), "{file} {key}");
        assert!(
            same_type(x.values.kind(), e["type"].as_str().unwrap()),
            "{file} {key}: {:?} for {}",
            x.values.kind(),
            e["type"]
        );
        let values = || (0..x.values.len()).map(|i| x.values.get_f64(i));
        let scale = values().map(f64::abs).sum::<f64>() * 97.0;
        assert_close(
            values().sum(),
            e["sum"].as_f64().unwrap(),
            scale,
            &format!("{file} {key} sum"),
        );
        assert_close(
            weighted(values()),
            e["weighted"].as_f64().unwrap(),
            scale,
            &format!("{file} {key} weighted sum"),
        );
    }
    if let Some(c) = expected.get("coordinates") {
        for axis in 0..3 {
            let expected = c[axis].as_f64().unwrap();
            let list = coordinates(data);
            let scale = list.iter().map(|p| p[axis].abs()).sum::<f64>() * 97.0;
            assert_close(
                weighted(list.iter().map(|p| p[axis])),
                expected,
                scale,
                &format!("{file} coordinate {axis}"),
            );
        }
    }
    if let Some(triangles) = expected.get("surface_triangles") {
        let (mesh, report) = data.to_trimesh(None).unwrap();
        assert_eq!(
            mesh.num_triangles() as u64,
            triangles.as_u64().unwrap(),
            "{file}: triangles of the surface, {report:?}"
        );
        assert_eq!(report.dropped(), 0, "{file}: {report:?}");
        let area: f64 = (0..mesh.num_triangles())
            .map(|i| mesh.triangle(i).map(|p| p.as_dvec3()))
            .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
            .sum();
        let expected = expected["surface_area"].as_f64().unwrap();
        // f32 positions.
        assert!(
            (area - expected).abs() < 2e-5 * expected,
            "{file}: area {area}, VTK has {expected}"
        );
    }
}

fn coordinates(data: &Dataset) -> Vec<[f64; 3]> {
    match data {
        Dataset::PolyData(d) => (0..d.points.len()).map(|i| d.points.get(i).to_array()).collect(),
        Dataset::UnstructuredGrid(d) => {
            (0..d.points.len()).map(|i| d.points.get(i).to_array()).collect()
        }
        Dataset::StructuredGrid(d) => {
            (0..d.points.len()).map(|i| d.points.get(i).to_array()).collect()
        }
        Dataset::ImageData(d) => lattice(d.dims(), |i, j, k| d.point(i, j, k).to_array()),
        Dataset::RectilinearGrid(d) => {
            let [x, y, z] = &d.coordinates;
            lattice([x.len(), y.len(), z.len()], |i, j, k| [x[i], y[j], z[k]])
        }
        Dataset::MultiBlock(_) => Vec::new(),
    }
}

fn lattice(d: [usize; 3], at: impl Fn(usize, usize, usize) -> [f64; 3]) -> Vec<[f64; 3]> {
    let n = d[0] * d[1] * d[2];
    (0..n).map(|i| at(i % d[0], i / d[0] % d[1], i / d[0] / d[1])).collect()
}

#[test]
fn every_file_that_vtk_writes_is_read_as_vtk_reads_it() {
    let Some(python) = peer::python_with_vtk("vtk_reads_and_writes") else { return };
    let dir = tempfile::tempdir().unwrap();
    peer::run(&python, SCRIPT, &["write", dir.path().to_str().unwrap()]);
    let text = std::fs::read_to_string(dir.path().join("expected.json")).unwrap();
    let all: Value = serde_json::from_str(&text).unwrap();
    let files = all["files"].as_object().unwrap();
    let (mut read, mut refused, mut in_pieces) = (0, 0, 0);
    for (file, expected) in files {
        let path = dir.path().join(file);
        match open(&path) {
            Ok(opened) => {
                assert!(!file.contains("lzma"), "{file} cannot have been read");
                compare(file, &opened, expected);
                read += 1;
                if is_read_in_pieces(&path, &opened) {
                    in_pieces += 1;
                } else {
                    let is_text = file.contains("ascii");
                    assert!(is_text || !file.starts_with("plain_"), "{file} is not read in pieces");
                }
            }
            Err(e) => {
                // LZMA is rejected by name, with a cure.
                let text = e.to_string();
                assert!(
                    file.contains("lzma") && matches!(e, ReadError::Unsupported { .. }),
                    "{text}"
                );
                assert!(
                    text.contains("LZMA") && text.contains("ZLib") && text.contains(file.as_str()),
                    "{text}"
                );
                refused += 1;
            }
        }
    }
    println!(
        "VTK {}: {read} files read as VTK reads them, {refused} LZMA files refused",
        all["vtk"]
    );
    assert!(read > 150 && refused > 0, "{read} {refused}");
    assert_eq!(in_pieces, 2 * 3 * 3 * 4, "kinds, modes, compressors, headers and byte orders");
    check_series_and_blocks(dir.path());
}

/// Whether a file is read in pieces. These have the surface of the whole, bit for bit.
fn is_read_in_pieces(path: &Path, whole: &LoadedFile) -> bool {
    let is_meant = path.extension().is_some_and(|e| e == "vtp" || e == "vtu");
    let opened = if is_meant { CellPieces::open(path, 7).unwrap() } else { None };
    let Some(mut pieces) = opened else { return false };
    pieces.find_shared_faces(|_| Ok::<_, ReadError>(())).unwrap();
    let origin = pieces.origin().unwrap();
    let triangles = |data: &Dataset, color: &str, shared: Option<&SharedFaces>| {
        let (mesh, report) = data.to_trimesh_between(Some(color), Some(origin), shared).unwrap();
        assert_eq!(report.dropped(), 0);
        let scalars = mesh.scalars.as_ref().unwrap();
        let value = |t: usize, corner: u32| match scalars.per {
            PerElement::Vertex => scalars.values[corner as usize],
            PerElement::Face => scalars.values[t],
        };
        let corners = mesh.indices.iter().enumerate().map(|(t, ids)| {
            ids.map(|k| (mesh.positions[k as usize].to_array(), value(t, k)))
                .map(|([x, y, z], value)| [x, y, z, value].map(f32::to_bits))
        });
        corners.collect::<Vec<_>>()
    };
    let colors = ["p_f32", "c_f64"];
    let mut found = colors.map(|_| Vec::new());
    let mut count = 0;
    while let Some(piece) = pieces.next_piece() {
        let piece = piece.unwrap();
        count += 1;
        for (found, color) in found.iter_mut().zip(colors) {
            let data = piece.file.dataset().unwrap();
            found.extend(triangles(data, color, piece.shared_faces.as_ref()));
        }
    }
    assert!(count > 5, "{}: {count} pieces", path.display());
    for (found, color) in found.iter().zip(colors) {
        let expected = triangles(whole.dataset().unwrap(), color, None);
        assert!(*found == expected, "{}: {color}", path.display());
    }
    true
}

fn check_series_and_blocks(dir: &Path) {
    let series = open(dir.join("series.pvd")).unwrap();
    let times: Vec<f64> = series.time_steps.iter().map(|s| s.time).collect();
    assert_eq!(times, [0.5, 2.0], "sorted by time");
    assert!(series.warnings.iter().any(|w| w.contains("2 times")), "{:?}", series.warnings);
    let blocks = open(dir.join("blocks.vtm")).unwrap();
    let Content::Data(Dataset::MultiBlock(list)) = &blocks.content else { panic!("not blocks") };
    assert_eq!(
        list.iter().map(|b| (b.name.as_str(), b.data.kind())).collect::<Vec<_>>(),
        [("0", "ImageData"), ("ball", "PolyData")]
    );
    let (mesh, report) = blocks.dataset().unwrap().to_trimesh(Some("p_f32")).unwrap();
    assert_eq!(report.blocks_without_array, 0);
    assert!(mesh.num_triangles() > 296 && mesh.scalars.is_some());
}

/// The description that VTK must give of a file with this data.
fn description(data: &Dataset) -> serde_json::Map<String, Value> {
    let (points, cells) = data.counts();
    let a = data.attributes().unwrap();
    let mut arrays = serde_json::Map::new();
    for (of, list) in [("point", &a.point), ("cell", &a.cell), ("field", &a.field)] {
        for x in list {
            let values = || (0..x.values.len()).map(|i| x.values.get_f64(i));
            let e = serde_json::json!({
                "components": x.components, "values": x.values.len(), "sum": values().sum::<f64>(), "weighted": weighted(values()),
            });
            arrays.insert(format!("{of}:{}", x.name), e);
        }
    }
    for (name, texts) in &a.text {
        arrays.insert(format!("field:{name}"), serde_json::json!({ "text": texts }));
    }
    let mut out = serde_json::Map::new();
    out.insert("kind".into(), data.kind().into());
    out.insert("points".into(), points.into());
    out.insert("cells".into(), cells.into());
    out.insert("arrays".into(), arrays.into());
    out
}

#[test]
fn vtk_reads_every_file_that_is_written_here() {
    let Some(python) = peer::python_with_vtk("vtk_reads_and_writes") else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut written: Vec<(std::path::PathBuf, Dataset)> = Vec::new();
    for (extension, data) in sample_files::data_sets() {
        for (i, options) in options().into_iter().enumerate() {
            let path = dir.path().join(format!("ours_{i}.{extension}"));
            write_vtk(&path, &data, options).unwrap();
            written.push((path, data.clone()));
        }
    }
    let (mesh, _) = sample_files::data_sets()[2].1.to_trimesh(None).unwrap();
    let ply = dir.path().join("ours.ply");
    write_ply(&ply, &mesh).unwrap();

    let mut args: Vec<&str> = vec!["check", ply.to_str().unwrap()];
    args.extend(written.iter().map(|(p, _)| p.to_str().unwrap()));
    let report: Value = serde_json::from_str(&peer::run(&python, SCRIPT, &args)).unwrap();
    for (path, data) in &written {
        let file = path.file_name().unwrap().to_str().unwrap();
        let theirs = &report["files"][file];
        assert_eq!(theirs["errors"], 0, "{file}: VTK reports errors");
        for (key, ours) in description(data) {
            if key != "arrays" {
                assert_eq!(theirs[&key], ours, "{file} {key}");
                continue;
            }
            for (name, e) in ours.as_object().unwrap() {
                let t = &theirs["arrays"][name];
                assert_eq!(t.get("text"), e.get("text"), "{file} {name}");
                assert_eq!(
                    (&t["components"], &t["values"]),
                    (&e["components"], &e["values"]),
                    "{file} {name}"
                );
                for sum in ["sum", "weighted"] {
                    if let (Some(found), Some(expected)) = (t[sum].as_f64(), e[sum].as_f64()) {
                        assert_close(
                            found,
                            expected,
                            expected.abs().max(1.0),
                            &format!("{file} {name} {sum}"),
                        );
                    }
                }
            }
        }
        // Reading and writing our own files preserves every bit.
        let Content::Data(again) = open(path).unwrap().content else { panic!() };
        assert_eq!(&again, data, "{file}");
        let (mesh, _) = data.to_trimesh(None).unwrap();
        assert_eq!(theirs["surface_triangles"], mesh.num_triangles(), "{file}");
    }
    assert_eq!(report["files"]["ours.ply"]["surface_triangles"], mesh.num_triangles());
    println!("VTK {} read {} files written here", report["vtk"], written.len() + 1);
}

fn options() -> [VtkOptions; 3] {
    [
        VtkOptions { encoding: Encoding::Ascii, compress: false },
        VtkOptions { encoding: Encoding::Base64, compress: false },
        VtkOptions { encoding: Encoding::Base64, compress: true },
    ]
}
