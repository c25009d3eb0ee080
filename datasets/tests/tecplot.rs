//! Tecplot's files: every packing, kind of zone, version and byte order.

mod peer;
mod sample_files;

use datasets::model::{Block, DataArray, Dataset, StructuredGrid, UnstructuredGrid, Values};
use datasets::read::{LoadedFile, OpenOptions, open, open_with};
use sample_files::tecplot::{TEXT, layouts, plt};

fn read(name: &str, bytes: &[u8], time: Option<f64>) -> Result<LoadedFile, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    open_with(&path, &OpenOptions { time, ..Default::default() }).map_err(|e| e.to_string())
}

fn blocks(file: &LoadedFile) -> &[Block] {
    match file.dataset().unwrap() {
        Dataset::MultiBlock(blocks) => blocks,
        other => panic!("{}", other.kind()),
    }
}

fn structured(block: &Block) -> &StructuredGrid {
    match &block.data {
        Dataset::StructuredGrid(g) => g,
        other => panic!("{}", other.kind()),
    }
}

fn unstructured(block: &Block) -> &UnstructuredGrid {
    match &block.data {
        Dataset::UnstructuredGrid(g) => g,
        other => panic!("{}", other.kind()),
    }
}

fn numbers(array: &DataArray) -> Vec<f64> {
    (0..array.values.len()).map(|i| array.values.get_f64(i)).collect()
}

#[test]
fn the_path_of_a_time_is_that_of_its_zones() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("flow.dat");
    std::fs::write(&path, TEXT).unwrap();
    let steps = open(&path).unwrap().time_steps;
    assert_eq!(steps.len(), 2);
    for step in &steps {
        let by_path = open(&step.path).unwrap();
        let by_time =
            open_with(&path, &OpenOptions { time: Some(step.time), ..Default::default() }).unwrap();
        assert_eq!(by_path.dataset().unwrap(), by_time.dataset().unwrap(), "{}", step.time);
    }
    assert_ne!(
        open(&steps[0].path).unwrap().dataset().unwrap(),
        open(&steps[1].path).unwrap().dataset().unwrap()
    );
}

#[test]
fn text_with_every_kind_of_zone() {
    let file = read("flow.dat", TEXT.as_bytes(), None).unwrap();
    let names: Vec<&str> = blocks(&file).iter().map(|b| b.name.as_str()).collect();
    assert_eq!((file.format, names), ("Tecplot", vec!["lattice", "bricks"]));
    let times: Vec<f64> = file.time_steps.iter().map(|t| t.time).collect();
    assert_eq!(times, [1.0, 2.0]);
    let warned = file.warnings.join("\n");
    for word in ["2 times; this is t = 1", "DATASETAUXDATA, TEXT", "`T` is passive in 1 of 2"] {
        assert!(warned.contains(word), "`{word}` is not in {warned}");
    }

    let lattice = structured(&blocks(&file)[0]);
    assert_eq!(datasets::model::extent_dims(lattice.extent), [3, 2, 2]);
    assert_eq!(lattice.points.get(10).to_array(), [1.0, 1.0, 1.0]);
    assert_eq!(numbers(lattice.attributes.point_array("rho").unwrap())[11], 12.0);
    assert_eq!(numbers(lattice.attributes.cell_array("T").unwrap()), [300.5, 300.5]);

    // The second brick has two pairs of corners at the same point: it is a wedge.
    let bricks = unstructured(&blocks(&file)[1]);
    assert_eq!(bricks.types, [12, 13]);
    assert_eq!(bricks.cells.get(0), [0, 1, 4, 3, 6, 7, 10, 9]);
    assert_eq!(bricks.points.get(10).to_array(), [1.0, 1.0, 1.0]);
    assert_eq!(numbers(bricks.attributes.point_array("rho").unwrap())[0], 11.0);
    assert!(bricks.attributes.point_array("T").is_none());

    let later = read("flow.dat", TEXT.as_bytes(), Some(2.0)).unwrap();
    let again = unstructured(&blocks(&later)[0]);
    assert_eq!((&again.types, &again.cells), (&bricks.types, &bricks.cells));
    assert!(again.attributes.point_array("rho").is_none());
    let quads = unstructured(&blocks(&later)[1]);
    assert_eq!((quads.types.as_slice(), quads.cells.get(0)), (&[5][..], &[0, 1, 2][..]));
    assert_eq!(numbers(quads.attributes.point_array("T").unwrap()), [5.0, 6.0, 7.0, 8.0]);
    let error = read("flow.dat", TEXT.as_bytes(), Some(3.0)).unwrap_err();
    assert!(error.contains("choose one of 1, 2"), "{error}");
}

#[test]
fn binary_files_of_all_versions_and_byte_orders() {
    for how in layouts() {
        let file = read("flow.plt", &plt(how), None).unwrap_or_else(|e| panic!("{how:?}: {e}"));
        let [lattice, bricks] = blocks(&file) else { panic!("{how:?}") };
        assert_eq!((lattice.name.as_str(), bricks.name.as_str()), ("lattice", "bricks"));
        let (lattice, bricks) = (structured(lattice), unstructured(bricks));
        assert_eq!(bricks.types, [12, 12], "{how:?}");
        assert_eq!(bricks.cells.get(1), [1, 2, 5, 4, 7, 8, 11, 10], "{how:?}");
        for (points, a) in
            [(&lattice.points, &lattice.attributes), (&bricks.points, &bricks.attributes)]
        {
            assert_eq!(points.get(10).to_array(), [1.0, 1.0, 1.0], "{how:?}");
            let rho = a.point_array("rho").unwrap();
            assert!(matches!(rho.values, Values::F64(_)), "{how:?}");
            assert_eq!(rho.get(11, 0), 11.0 + 1.0 / 3.0, "{how:?}");
            match a.cell_array("T") {
                Some(t) => assert_eq!(numbers(t), [300.0, 301.0], "{how:?}"),
                None => assert_eq!(a.point_array("T").unwrap().get(11, 0), 311.0, "{how:?}"),
            }
            let time = a.field_array("TimeValue").map(|t| t.get(0, 0));
            assert_eq!(time, (how.version >= 103).then_some(0.5), "{how:?}");
        }
        assert!(file.time_steps.is_empty());
        if how.version >= 107 {
            assert_eq!(file.warnings, ["left out: auxiliary data"]);
        }
    }
}

#[test]
fn a_wrong_file_names_the_place_the_value_and_a_cure() {
    let variables = "VARIABLES = X, Y, Z, p\n";
    for (text, words) in [
        ("ZONE I=2\n0 0", ["VARIABLES", "add VARIABLES"]),
        ("VARIABLES = a, b\nZONE I=1\n0 0", ["not among a, b", "name those of the points X"]),
        ("VARIABLES = X, Y\nZONE T=\"z\"\n0 0", ["zone `z` has no I", "in line 3"]),
        ("VARIABLES = X, Y\nZONE I=0\n0 0", ["I is `0`", "whole number from 1"]),
        ("VARIABLES = X, Y\nZONE I=3\n0 0 1 0 2", ["the file ends", "truncated"]),
        ("VARIABLES = X, Y\nZONE I=2\n0 0 1 0 2", ["`2`: there are more numbers", "check its I"]),
        ("VARIABLES = X, Y\nZONE I=2\n0 0 1 x", ["`x` among the values", "line 3"]),
        ("VARIABLES = X, Y\nZONE I=999999999\n0 0", ["1999999998 values", "bytes follow"]),
        ("VARIABLES = X, Y\nZONE I=9 F=POINT\n99*0", ["99 times 0", "which are 18"]),
        (
            "VARIABLES = X, Y\nZONE N=3 E=1 ET=TRIANGLE F=FEPOINT\n0 0 1 0 0 1\n1 2 4",
            ["element 3 of zone `1` has point 4, of 3", "line 4"],
        ),
        ("VARIABLES = X, Y\nZONE N=3 E=1 ZONETYPE=FEPOLYHEDRON\n", ["FEPOLYHEDRON", ".vtu"]),
        ("VARIABLES = X, Y\nZONE I=2 COLOUR=3\n", ["unknown key `COLOUR`", "spelling"]),
        ("VARIABLES = X, Y\nZONE I=1 VARSHARELIST=([1]=4)\n", ["names zone `4`", "before"]),
        ("VARIABLES = X, Y\nZONE I=1 PASSIVEVARLIST=[3]\n", ["`3` in a list of the 2", "again"]),
        ("FILETYPE = SOLUTION\nVARIABLES = p\n", ["solution file", "full file"]),
    ] {
        let text = text.replace("VARIABLES = X, Y, Z, p\n", variables);
        let error = read("flow.tec", text.as_bytes(), None).unwrap_err();
        words.iter().for_each(|w| assert!(error.contains(w), "`{w}` is not in: {error}"));
        assert!(error.contains("flow.tec"), "{error}");
    }
    let error = read("a.plt", b"#!TDV191\x01\0\0\0", None).unwrap_err();
    assert!(error.contains("version `#!TDV191`") && error.contains("101 to 112"), "{error}");
}

#[test]
fn short_files_do_not_ask_for_long_copies() {
    let shared = "ZONE I=100 J=100 F=BLOCK VARSHARELIST=([1-3]=1)\n".repeat(1000);
    let x: String = (0..10_000).map(|i| format!("{i} ")).collect();
    let first = format!("ZONE I=100, J=100, DATAPACKING=BLOCK\n{x}10000*0 10000*1\n");
    let text = format!("VARIABLES = X, Y, Z\n{first}{shared}");
    let error = read("flow.tec", text.as_bytes(), None).unwrap_err();
    assert!(error.contains("zones share 30000000 values"), "{error}");
    let text = "VARIABLES = X, Y\nZONE I=1000000 J=1000 F=BLOCK\n1000000000*0 1000000000*0\n";
    let error = read("flow.tec", text.as_bytes(), None).unwrap_err();
    assert!(error.contains("1000000000 values"), "{error}");
}

#[test]
fn vtk_reads_the_same_from_text() {
    let Some(python) = peer::python_with_vtk("vtk_reads_the_same_from_text") else { return };
    // VTK reads one time, no sharing, no repeat counts and no comments.
    let text = "TITLE = \"t\"\nVARIABLES = \"X\" \"Y\" \"Z\" \"rho\" \"T\"\n\
        ZONE T=\"lattice\" I=3 J=2 K=2 F=POINT\n\
        0 0 0 1 5\n1 0 0 2 6\n2.5 0 0 3 7\n0 1 0 4 8\n1 1 0 5 9\n2 1 0 6 1\n\
        0 0 1 7 5\n1 0 1 8 6\n2 0 1 9 7\n0 1 1 4 8\n1 1 1 5 9\n2 1 1 6 1\n\
        ZONE T=\"tets\" N=5 E=2 DATAPACKING=BLOCK ZONETYPE=FETETRAHEDRON \
        VARLOCATION=([5]=CELLCENTERED)\n\
        0 1 0 0 1\n0 0 1 0 1\n0 0 0 1 1\n1 2 3 4 5.25\n300 301\n1 2 3 4\n2 3 4 5\n";
    let script = r"
import sys, vtk
reader = vtk.vtkTecplotReader()
reader.SetFileName(sys.argv[1])
reader.Update()
out = reader.GetOutput()
for i in range(out.GetNumberOfBlocks()):
    b = out.GetBlock(i)
    data = lambda d, n: [d.GetArray(n).GetTuple1(k)
        for k in range(d.GetArray(n).GetNumberOfTuples())]
    t = data(b.GetCellData(), 'T') if b.GetCellData().GetArray('T') else data(b.GetPointData(), 'T')
    print(b.GetNumberOfPoints(), b.GetNumberOfCells(), list(b.GetPoint(2)),
          data(b.GetPointData(), 'rho'), t)
";
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("flow.dat");
    std::fs::write(&path, text).unwrap();
    let file = open(&path).unwrap();
    let mut ours = String::new();
    for block in blocks(&file) {
        let a = block.data.attributes().unwrap();
        let (points, cells) = block.data.counts();
        let p = match &block.data {
            Dataset::StructuredGrid(g) => g.points.get(2),
            Dataset::UnstructuredGrid(g) => g.points.get(2),
            other => panic!("{}", other.kind()),
        };
        let t = a.cell_array("T").or(a.point_array("T")).unwrap();
        let rho = numbers(a.point_array("rho").unwrap());
        ours += &format!("{points} {cells} {:?} {rho:?} {:?}\n", p.to_array(), numbers(t));
    }
    assert_eq!(peer::run(&python, script, &[path.to_str().unwrap()]), ours);
}
