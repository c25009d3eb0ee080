//! CGNS: files that h5py wrote as the library lays them out (`tests/files/make.py`), and what VTK
//! finds in them.

mod peer;

use datasets::model::{Dataset, StructuredGrid, UnstructuredGrid, Values, WALL_POINTS};
use datasets::read::{LoadedFile, OpenOptions, open, open_with};
use datasets::resample::Mesh;
use glam::DVec3;
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files").join(name)
}

fn read(name: &str) -> LoadedFile {
    open(file(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// The zones by name.
fn blocks(file: &LoadedFile) -> Vec<(&str, &Dataset)> {
    match file.dataset().unwrap() {
        Dataset::MultiBlock(blocks) => blocks.iter().map(|b| (b.name.as_str(), &b.data)).collect(),
        other => panic!("{}", other.kind()),
    }
}

fn structured(data: &Dataset) -> &StructuredGrid {
    match data {
        Dataset::StructuredGrid(grid) => grid,
        other => panic!("{}", other.kind()),
    }
}

fn unstructured(data: &Dataset) -> &UnstructuredGrid {
    match data {
        Dataset::UnstructuredGrid(grid) => grid,
        other => panic!("{}", other.kind()),
    }
}

#[test]
fn lattices_without_their_rind_planes_in_units_of_si() {
    let opened = read("zones.cgns");
    let zones = blocks(&opened);
    assert_eq!(zones.iter().map(|z| z.0).collect::<Vec<_>>(), ["left", "right"]);
    let right = structured(zones[1].1);
    assert_eq!((right.extent, right.points.len()), ([0, 3, 0, 2, 0, 1], 24));
    // Centimetres.
    assert!((right.points.get(23) - DVec3::new(0.06, 0.02, 0.01)).length() < 1e-8);
    let pressure = right.attributes.cell_array("Pressure").unwrap();
    // Dyn/cm2 are 0.1 Pa.
    let expected = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
    assert!((0..6).all(|i| (pressure.get(i, 0) - expected[i]).abs() < 1e-13), "{pressure:?}");
    let t = right.attributes.point_array("Temperature").unwrap();
    assert!(matches!(t.values, Values::F32(_)) && (t.get(23, 0) - 296.15).abs() < 1e-4);
    let warned = opened.warnings.join("\n");
    for words in [
        "a series of 2 times",
        "`CoordinateX` in Centimeter is converted",
        "Gram",
        "`Temperature` in Celsius",
        "planes beyond the zones (Rind) left out, 2 times",
    ] {
        assert!(warned.contains(words), "`{words}` is not in: {warned}");
    }
}

#[test]
fn a_time_of_cgns_has_a_path_of_its_own() {
    let opened = read("zones.cgns");
    let times: Vec<f64> = opened.time_steps.iter().map(|s| s.time).collect();
    assert_eq!(times, [0.25, 0.5]);
    let second = open(&opened.time_steps[1].path).unwrap_or_else(|e| panic!("{e}"));
    let zones = blocks(&second);
    let grid = structured(zones[0].1);
    assert!((grid.attributes.cell_array("Pressure").unwrap().get(5, 0) - 10.5).abs() < 1e-12);
    // A solution that no time names holds at all times.
    assert!(grid.attributes.point_array("Temperature").is_some());
    assert_eq!(grid.attributes.field_array("TimeValue").unwrap().get(0, 0), 0.5);
    let at = OpenOptions { time: Some(0.3), ..Default::default() };
    let error = open_with(file("zones.cgns"), &at).unwrap_err().to_string();
    assert!(error.contains("it is 0.3; choose one of 0.25, 0.5"), "{error}");
    let error = open_with(file("elements.cgns"), &at).unwrap_err().to_string();
    assert!(error.contains("the file has no list of times"), "{error}");
}

#[test]
fn elements_of_cgns_fill_the_space_that_they_should() {
    let opened = read("elements.cgns");
    let zones = blocks(&opened);
    let mixed = unstructured(zones[0].1);
    // Sections count by the numbers of their elements; the wall is no cell.
    assert_eq!(mixed.types, [12, 13, 14, 10]);
    assert_eq!(mixed.attributes.cell_array("Density").unwrap().tuples(), 4);
    // VTK has the first triangle of a wedge seen from outside.
    assert_eq!(mixed.cells.get(1), [1, 2, 8, 5, 6, 9]);
    let warned = opened.warnings.join("\n");
    assert!(warned.contains("boundary left out: Wall (1 QUAD_4)"), "{warned}");
    assert!(warned.contains("1 elements HEXA_32 are used by their corners"), "{warned}");
    let curved = unstructured(zones[1].1);
    assert_eq!(curved.types, [25, 12]);
    // The middle of the edge between the points 4 and 5 of VTK, which CGNS has as the 17th.
    assert_eq!(curved.points.get(curved.cells.get(0)[12] as usize), DVec3::new(0.5, 0.0, 1.0));
    let volumes = [1.0 + 0.5 + 1.0 / 3.0 + 1.0 / 6.0, 2.0, 2.0];
    for (zone, expected) in zones.iter().zip(volumes) {
        let found = volume(zone.1);
        // Vertices of surfaces are in single precision.
        assert!((found - expected).abs() < 1e-6, "{}: {found}", zone.0);
        assert_eq!(Mesh::new(zone.1).unwrap().num_cells() as u64, zone.1.counts().1);
    }
}

/// The volume within the surface, by the divergence theorem: faces between cells that do not match
/// would stay on it.
fn volume(data: &Dataset) -> f64 {
    let (mesh, _) = data.to_trimesh(None).unwrap();
    let at = |i: u32| mesh.positions[i as usize].as_dvec3();
    mesh.indices.iter().map(|&[a, b, c]| at(a).dot(at(b).cross(at(c))) / 6.0).sum()
}

#[test]
fn polyhedra_of_faces_are_the_shapes_that_they_are() {
    let opened = read("elements.cgns");
    let zones = blocks(&opened);
    let grid = unstructured(zones[2].1);
    // The second cube has a face with five corners.
    assert_eq!(grid.types, [12, 42]);
    let faces = grid.faces_of_cell[1].clone();
    assert_eq!(faces.len(), 6);
    // Outward, also the face that is the first cube's.
    let centre = DVec3::new(1.5, 0.5, 0.5);
    for f in faces {
        let ids = grid.polyhedron_faces.get(f);
        let at = |k: usize| grid.points.get(ids[k] as usize) - centre;
        assert!(at(0).dot(at(1).cross(at(2))) > 0.0, "{ids:?}");
    }
    assert!(!opened.warnings.join("\n").contains("signs"), "{:?}", opened.warnings);
}

#[test]
fn boundary_conditions_of_cgns_say_which_points_are_those_of_walls() {
    let opened = read("walls.cgns");
    let walls = |data: &Dataset| {
        let ids = data.attributes().unwrap().field_array(WALL_POINTS)?;
        Some((0..ids.tuples()).map(|i| ids.get(i, 0) as usize).collect::<Vec<_>>())
    };
    let zones = blocks(&opened);
    let of = |name: &str| walls(zones.iter().find(|z| z.0 == name).unwrap().1);
    // The floor, and the side up to its last face: points (3, 0..=2, 0..=1).
    assert_eq!(of("lattice").unwrap(), [0, 1, 2, 3, 7, 11, 12, 13, 14, 15, 19, 23]);
    assert_eq!(of("elements").unwrap(), [0, 1, 2, 3]);
    assert_eq!(of("points").unwrap(), [4, 6, 7]);
    assert_eq!(of("unknown"), None);
    let warned = opened.warnings.join("\n");
    for words in
        ["points`: walls name points beyond its own, 2 times", "ZoneBC/gone` has no points"]
    {
        assert!(warned.contains(words), "`{words}` is not in: {warned}");
    }
    // Files without conditions say nothing of walls.
    let none = read("elements.cgns");
    assert!(blocks(&none).iter().all(|z| walls(z.1).is_none()));
}

#[test]
fn links_lead_to_files_of_the_folder_and_nowhere_else() {
    let opened = read("links.cgns");
    let original = read("elements.cgns");
    for (name, data) in blocks(&opened) {
        assert_eq!(data, blocks(&original)[0].1, "{name}");
    }
    assert_eq!(blocks(&opened).iter().map(|z| z.0).collect::<Vec<_>>(), ["linked", "again"]);
    // The other file is gone, or the link leads out of the folder.
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("links.cgns");
    let bytes = std::fs::read(file("links.cgns")).unwrap();
    std::fs::write(&path, &bytes).unwrap();
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("elements.cgns") && error.contains("put the file"), "{error}");
    // One of the places that name the file is the link of HDF5, whose checksum would be wrong; the
    // other is the text that CGNS reads.
    let name = b"elements.cgns";
    let mut errors = String::new();
    for at in (0..bytes.len() - name.len()).filter(|&at| bytes[at..].starts_with(name)) {
        let mut outside = bytes.clone();
        outside[at..at + name.len()].copy_from_slice(b"../ments.cgns");
        std::fs::write(&path, &outside).unwrap();
        errors += &open(&path).unwrap_err().to_string();
    }
    assert!(errors.contains("the file ../ments.cgns, in another folder"), "{errors}");
}

#[test]
fn files_in_adf_are_named_with_the_tool_that_converts_them() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("old.cgns");
    let of_version_b = b"\xc0\xa8\xa3\xa9ADF Database Version B02012>\0\0\0";
    std::fs::write(&path, of_version_b).unwrap();
    let error = open(&path).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("in ADF") && error.contains("cgnsconvert -h"), "{error}");
    std::fs::write(&path, b"@(#)ADF Database Version A02011>\0\0\0").unwrap();
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("in ADF") && error.contains("cgnsconvert -h"), "{error}");
    std::fs::write(&path, b"no such file").unwrap();
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("old.cgns") && error.contains("HDF5"), "{error}");
}

#[test]
fn vtk_reads_the_same_from_cgns() {
    let Some(python) = peer::python_with_vtk("vtk_reads_the_same_from_cgns") else { return };
    let script = r"
import sys, vtk
for path in sys.argv[1:]:
    reader = vtk.vtkCGNSReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    reader.EnableAllBases()
    reader.EnableAllPointArrays()
    reader.EnableAllCellArrays()
    reader.Update()
    base = reader.GetOutput().GetBlock(0)
    for i in range(base.GetNumberOfBlocks()):
        zone = base.GetBlock(i)
        n = zone.GetNumberOfCells()
        sums = [round(sum(zone.GetPoint(p)[a] for p in range(zone.GetNumberOfPoints())), 3)
                for a in range(3)]
        print(zone.GetNumberOfPoints(), n, *sums)
        for name in ('Pressure', 'Density'):
            array = zone.GetCellData().GetArray(name)
            if array:
                print(name, *[round(array.GetValue(c), 3) for c in range(n)])
";
    let files = ["zones.cgns", "elements.cgns"].map(file);
    let paths: Vec<&str> = files.iter().map(|p| p.to_str().unwrap()).collect();
    let found = peer::run(&python, script, &paths);
    let mut expected = String::new();
    for name in ["zones.cgns", "elements.cgns"] {
        // VTK leaves units as they are.
        let (length, pressure) = if name == "zones.cgns" { (100.0, 10.0) } else { (1.0, 1.0) };
        let opened = read(name);
        for (_, data) in blocks(&opened) {
            let points = match data {
                Dataset::StructuredGrid(g) => &g.points,
                other => &unstructured(other).points,
            };
            let sum: DVec3 = (0..points.len()).map(|i| points.get(i)).sum();
            let (n, cells) = data.counts();
            let round = |x: f64| format!("{:?}", (x * 1000.0).round() / 1000.0);
            let [x, y, z] = (sum * length).to_array().map(round);
            expected += &format!("{n} {cells} {x} {y} {z}\n");
            for name in ["Pressure", "Density"] {
                if let Some(a) = data.attributes().unwrap().cell_array(name) {
                    let values = (0..a.tuples()).map(|i| round(a.get(i, 0) * pressure));
                    expected += &format!("{name} {}\n", values.collect::<Vec<_>>().join(" "));
                }
            }
        }
    }
    assert_eq!(found, expected);
}
