//! Cases of OpenFOAM: all forms of the files give the same data, and VTK's reader agrees.

mod peer;
mod sample_files;

use datasets::model::{Dataset, UnstructuredGrid, WALL_POINTS};
use datasets::read::openfoam::BOUNDARY_PATCHES;
use datasets::read::{LoadedFile, OpenOptions, open, open_with};
use datasets::resample::{Mesh, Plane};
use sample_files::openfoam::{CaseFile, Form, case, collated, decomposed, write};

fn grid(file: &LoadedFile) -> &UnstructuredGrid {
    match file.dataset().unwrap() {
        Dataset::UnstructuredGrid(grid) => grid,
        other => panic!("{}", other.kind()),
    }
}

fn read(files: &[CaseFile]) -> LoadedFile {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), files);
    open(dir.path()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn text_binary_and_zipped_cases_are_the_same_data() {
    let text = read(&case(Form::Text, "patch"));
    let g = grid(&text);
    assert_eq!((g.points.len(), g.types.as_slice()), (16, [12; 3].as_slice()));
    let array = |name: &str| g.attributes.cell_array(name).unwrap();
    // The last time is read.
    assert_eq!([0, 1, 2].map(|c| array("T").get(c, 0)), [310.0, 311.0, 312.0]);
    assert_eq!([0, 1, 2].map(|c| array("U").get(2, c)), [12.0, 0.5, -1.0]);
    assert_eq!((array("p").tuples(), array("p").get(1, 0)), (3, 1e5));
    let patches = g.attributes.text.iter().find(|t| t.0 == BOUNDARY_PATCHES).unwrap();
    assert_eq!(patches.1, ["inlet patch 1", "outlet patch 1", "walls wall 6", "sides patch 6"]);
    // All points of the mesh belong to a face of `walls`.
    assert_eq!(g.attributes.field_array(WALL_POINTS).unwrap().tuples(), 16);
    let warned = text.warnings.join("\n");
    assert!(warned.contains("t = 0.25") && warned.contains("phi (surfaceScalarField)"), "{warned}");
    for form in [Form::Binary, Form::Zipped] {
        assert_eq!(grid(&read(&case(form, "patch"))), g, "{form:?}");
    }
}

#[test]
fn a_time_is_chosen_by_option_or_folder_and_a_wrong_one_lists_the_others() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &case(Form::Text, "patch"));
    std::fs::write(dir.path().join("flow.foam"), "").unwrap();
    let first = open(dir.path().join("0")).unwrap();
    assert_eq!(grid(&first).attributes.cell_array("T").unwrap().get(0, 0), 300.0);
    let at = |time| open_with(dir.path(), &OpenOptions { time: Some(time), ..Default::default() });
    assert_eq!(grid(&at(0.0).unwrap()), grid(&first));
    let whole = open(dir.path().join("flow.foam")).unwrap();
    assert_eq!(grid(&whole), grid(&at(0.25).unwrap()));
    let times: Vec<f64> = whole.time_steps.iter().map(|s| s.time).collect();
    assert_eq!(times, [0.0, 0.25]);
    assert_eq!(grid(&open(&whole.time_steps[0].path).unwrap()), grid(&first));
    let error = at(0.1).unwrap_err().to_string();
    assert!(error.contains("it is 0.1; choose one of 0, 0.25"), "{error}");
    let lattice = OpenOptions { spacing: Some([1.0; 3]), ..Default::default() };
    let error = open_with(dir.path(), &lattice).unwrap_err().to_string();
    assert!(error.contains("option `spacing`"), "{error}");
}

#[test]
fn a_decomposed_case_is_one_mesh_without_a_seam() {
    let whole = read(&case(Form::Text, "patch"));
    for form in [Form::Text, Form::Binary] {
        let joined = read(&decomposed(form));
        let (a, b) = (grid(&whole), grid(&joined));
        assert_eq!((b.points.len(), &b.types), (16, &a.types));
        assert_eq!(b.attributes.cell, a.attributes.cell);
        // The faces between the parts are not part of the surface: 14 squares remain.
        let (surface, _) = joined.dataset().unwrap().to_trimesh(None).unwrap();
        assert_eq!(surface.num_triangles(), 28);
    }
}

#[test]
fn a_collated_case_is_the_decomposed_one() {
    for form in [Form::Text, Form::Binary, Form::Zipped] {
        let inner = if form == Form::Zipped { Form::Text } else { form };
        let parts = read(&decomposed(inner));
        for group in [1, 2] {
            let joined = read(&collated(form, group));
            assert_eq!(grid(&joined), grid(&parts), "{form:?}, {group} parts in a folder");
            assert_eq!(joined.warnings, parts.warnings);
            let times: Vec<f64> = joined.time_steps.iter().map(|s| s.time).collect();
            assert_eq!(times, [0.0, 0.25]);
        }
    }
}

/// The message about a case in one of whose files a text is replaced.
fn fault_of(mut files: Vec<CaseFile>, name: &str, from: &str, to: &str) -> String {
    let file = files.iter_mut().find(|f| f.0 == name).unwrap();
    let text = String::from_utf8(file.1.clone()).unwrap();
    assert!(text.contains(from), "{text}");
    file.1 = text.replace(from, to).into_bytes();
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &files);
    open(dir.path()).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn faults_of_a_collated_case_name_the_part() {
    let replaced = |name, from, to| fault_of(collated(Form::Text, 2), name, from, to);
    for (name, from, to, words) in [
        ("processors2/0.25/T", "\n312", "\nwar", ["`war", "in the block of part 1"]),
        (
            "processors2/0.25/T",
            "Processor1\n\n",
            "Processor1\n\n9",
            ["bytes of a block", "truncated"],
        ),
        (
            "processors2/constant/polyMesh/owner",
            "decomposedBlockData",
            "labelList",
            ["it is a labelList, in a folder", "-fileHandler collated"],
        ),
    ] {
        let error = replaced(name, from, to);
        words.iter().for_each(|w| assert!(error.contains(w), "`{w}` is not in: {error}"));
    }
    // A folder of half of the parts.
    let mut files = collated(Form::Text, 1);
    files.retain(|f| !f.0.starts_with("processors2_1-1"));
    files.push(("system/controlDict".into(), CONTROL.into()));
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &files);
    let error = open(dir.path()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("no folders processorsN that hold all parts"), "{error}");
}

#[test]
fn a_case_one_cell_thick_is_a_plane_and_gets_its_depth_back() {
    let flat = read(&case(Form::Binary, "empty"));
    let g = grid(&flat);
    assert_eq!((g.points.len(), g.types.as_slice()), (8, [9; 3].as_slice()));
    assert!((0..8).all(|i| g.points.get(i).z == 0.5));
    let plane = Plane::Extrude { span: 4.0 };
    let mesh = Mesh::with_plane(flat.dataset().unwrap(), plane).unwrap();
    let (low, high) = mesh.bounds();
    assert_eq!(
        (mesh.num_cells(), low.to_array(), high.to_array()),
        (3, [0., 0., -1.5], [3., 1., 2.5])
    );
    let of_cells =
        mesh.gather_cells(flat.dataset().unwrap(), |a, i| a.cell_array("T").unwrap().get(i, 0));
    assert_eq!(of_cells, [310.0, 311.0, 312.0]);
    let error = Mesh::new(flat.dataset().unwrap()).unwrap_err().to_string();
    assert!(error.contains("it is a plane"), "{error}");
}

#[test]
fn a_case_between_wedges_has_the_radius_as_y() {
    let flat = read(&case(Form::Binary, "wedge"));
    let g = grid(&flat);
    assert_eq!((g.points.len(), g.types.as_slice()), (8, [9; 3].as_slice()));
    for i in 0..8 {
        let p = g.points.get(i);
        let nearest = [p.x.round().clamp(0.0, 3.0), p.y.round().clamp(1.0, 2.0), 0.0];
        assert!((p - glam::DVec3::from(nearest)).abs().max_element() < 1e-14, "{p}");
    }
    assert!(flat.warnings.join("\n").contains("axisymmetric"));
    assert!(flat.dataset().unwrap().is_axisymmetric());
    let plane = read(&case(Form::Binary, "empty"));
    assert!(!plane.dataset().unwrap().is_axisymmetric());
}

#[test]
fn points_that_move_are_those_of_the_last_time_they_were_written() {
    let mut files = case(Form::Text, "patch");
    let points = files.iter().find(|f| f.0 == "constant/polyMesh/points").unwrap();
    let moved = String::from_utf8(points.1.clone()).unwrap().replace("\n(3 1 1)", "\n(3.5 1 1)");
    files.push(("0.125/polyMesh/points".into(), moved.into_bytes()));
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &files);
    let corner = |path: &std::path::Path| grid(&open(path).unwrap()).points.get(15).x;
    assert_eq!(corner(dir.path()), 3.5);
    assert_eq!(corner(&dir.path().join("0")), 3.0);
}

#[test]
fn faults_name_the_file_the_place_and_a_cure() {
    let replaced = |name, from, to| fault_of(case(Form::Text, "patch"), name, from, to);
    for (name, from, to, words) in [
        ("0.25/T", "\n3\n(", "\n4\n(", ["0.25/T", "4 values for 3 cells"]),
        ("0.25/T", "\n311", "\nwarm", ["in line 18", "`warm"]),
        ("0.25/T", "internalField", "value_of", ["T", "no internalField"]),
        ("constant/polyMesh/owner", "\n16\n", "\n999999999\n", ["owner", "truncated"]),
        ("constant/polyMesh/owner", "\n2)", "\n77)", ["cell 77", "write it again"]),
        ("constant/polyMesh/faces", "4(1 ", "4(16 ", ["face 0 has point 16", "in line"]),
        (
            "constant/polyMesh/boundary",
            "nFaces 6; startFace 10",
            "nFaces 7; startFace 10",
            ["sides", "7 faces from 10 on, of 16"],
        ),
        ("constant/polyMesh/points", "FoamFile", "Foam", ["points", "dictionary FoamFile"]),
    ] {
        let error = replaced(name, from, to);
        words.iter().for_each(|w| assert!(error.contains(w), "`{w}` is not in: {error}"));
    }
    let mut files = case(Form::Text, "patch");
    files.retain(|f| !f.0.ends_with("polyMesh/owner"));
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &files);
    let error = open(dir.path()).unwrap_err().to_string();
    assert!(error.contains("constant and system"), "{error}");
}

#[test]
fn macros_are_left_out_and_kinematic_pressures_warned_of() {
    let mut files = case(Form::Text, "patch");
    for (name, from, to) in [
        ("0.25/p", "uniform 1e5", "uniform $pInf"),
        ("0.25/T", "[0 0 0 1 0 0 0]", "[0 2 -2 0 0 0 0]"),
    ] {
        let file = files.iter_mut().find(|f| f.0 == name).unwrap();
        file.1 = String::from_utf8(file.1.clone()).unwrap().replace(from, to).into_bytes();
    }
    let renamed = files.iter_mut().find(|f| f.0 == "0.25/T").unwrap();
    renamed.0 = "0.25/p_rgh".into();
    let read = read(&files);
    assert!(grid(&read).attributes.cell_array("p").is_none());
    let warned = read.warnings.join("\n");
    assert!(warned.contains("field `p` left out: the value is a macro"), "{warned}");
    assert!(warned.contains("`p_rgh` is a pressure divided by the density"), "{warned}");
}

#[test]
fn vtk_reads_the_same_from_a_case() {
    let Some(python) = peer::python_with_vtk("vtk_reads_the_same_from_a_case") else { return };
    let script = r"
import sys, vtk
for path in sys.argv[1:]:
    reader = vtk.vtkOpenFOAMReader()
    reader.SetFileName(path)
    if 'processor' in path:
        reader = vtk.vtkPOpenFOAMReader()
        reader.SetFileName(path.replace('processor', ''))
        reader.SetCaseType(0)
    reader.UpdateInformation()
    reader.EnableAllCellArrays()
    reader.SetTimeValue(0.25)
    reader.Update()
    mesh = reader.GetOutput().GetBlock(0)
    t = mesh.GetCellData().GetArray('T')
    kinds = [mesh.GetCellType(i) for i in range(mesh.GetNumberOfCells())]
    print(mesh.GetNumberOfPoints(), kinds, [t.GetValue(i) for i in range(len(kinds))])
";
    let mut expected = String::new();
    let mut cases = Vec::new();
    for form in [Form::Text, Form::Binary, Form::Zipped] {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &case(form, "patch"));
        std::fs::create_dir(dir.path().join("system")).unwrap();
        std::fs::write(dir.path().join("system/controlDict"), CONTROL).unwrap();
        let path = dir.path().join("a.foam");
        std::fs::write(&path, "").unwrap();
        let file = open(&path).unwrap();
        let g = grid(&file);
        let t = g.attributes.cell_array("T").unwrap();
        let t: Vec<f64> = (0..3).map(|c| t.get(c, 0)).collect();
        expected += &format!("{} {:?} {t:?}\n", g.points.len(), g.types);
        cases.push((dir, path.display().to_string()));
    }
    let paths: Vec<&str> = cases.iter().map(|c| c.1.as_str()).collect();
    assert_eq!(peer::run(&python, script, &paths), expected);
}

const CONTROL: &str =
    "FoamFile { version 2.0; format ascii; class dictionary; object controlDict; }
startFrom latestTime; startTime 0; stopAt endTime; endTime 1; deltaT 1; writeControl timeStep;
writeInterval 1; writeFormat ascii; timeFormat general;
";
