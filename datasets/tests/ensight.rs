//! EnSight Gold: every encoding and kind of part, and what VTK reads from the same files.

mod peer;
mod sample_files;

use datasets::model::{DataArray, Dataset};
use datasets::read::{LoadedFile, OpenOptions, open_with};
use sample_files::ensight::{ENCODINGS, Encoding, case, write};
use std::fmt::Write as _;
use std::path::Path;

fn read(path: &Path, time: Option<f64>) -> Result<LoadedFile, String> {
    open_with(path, &OpenOptions { time, ..Default::default() }).map_err(|e| e.to_string())
}

fn numbers(array: &DataArray) -> Vec<f64> {
    (0..array.values.len()).map(|i| array.values.get_f64(i)).collect()
}

#[test]
fn every_encoding_gives_the_same_parts() {
    for encoding in ENCODINGS {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &case(encoding));
        let path = dir.path().join("a.case");
        let file = read(&path, None).unwrap_or_else(|e| panic!("{encoding:?}: {e}"));
        let times: Vec<f64> = file.time_steps.iter().map(|t| t.time).collect();
        assert_eq!((file.format, times), ("EnSight Gold", vec![0.5, 1.5]));
        let warned = file.warnings.join("\n");
        for word in ["this is t = 0.5", "`vel`: 3 of 4 parts", "`rho`: 1 undefined"] {
            assert!(warned.contains(word), "`{word}` is not in {warned}");
        }
        let Dataset::MultiBlock(blocks) = file.dataset().unwrap() else { panic!() };
        let names: Vec<&str> = blocks.iter().map(|b| b.name.as_str()).collect();
        assert_eq!(names, ["mixed", "curved", "rectilinear", "uniform"]);

        let Dataset::UnstructuredGrid(mixed) = &blocks[0].data else { panic!() };
        assert_eq!(mixed.types, [12, 13, 10, 7, 7, 42]);
        assert_eq!(mixed.cells.get(1), [1, 5, 2, 7, 11, 8]);
        assert_eq!(mixed.cells.get(4), [6, 7, 10, 9]);
        assert_eq!((mixed.cells.get(5), mixed.faces_of_cell[5].clone()), (&[1, 4, 5, 7][..], 0..4));
        let a = &mixed.attributes;
        assert_eq!(numbers(a.cell_array("T").unwrap()), [300., 301., 302., 303., 304., 305.]);
        assert_eq!(numbers(a.point_array("vel").unwrap())[3..6], [1.0, 1001.0, 2001.0]);
        assert_eq!(numbers(a.field_array("gamma").unwrap()), [1.4]);

        let Dataset::StructuredGrid(curved) = &blocks[1].data else { panic!() };
        let hidden = numbers(curved.attributes.point_array("vtkGhostType").unwrap());
        assert_eq!((hidden[10], hidden[11]), (0.0, 2.0));
        let Dataset::RectilinearGrid(rectilinear) = &blocks[2].data else { panic!() };
        assert_eq!(rectilinear.coordinates, [vec![0., 1., 4.], vec![0., 2.], vec![5.]]);
        let Dataset::ImageData(uniform) = &blocks[3].data else { panic!() };
        assert_eq!(uniform.point(1, 1, 1).to_array(), [1.5, 2.25, 3.125]);
        assert!(numbers(uniform.attributes.point_array("rho").unwrap())[3].is_nan());

        let later = read(&path, Some(1.5)).unwrap();
        let Dataset::MultiBlock(blocks) = later.dataset().unwrap() else { panic!() };
        let Dataset::UnstructuredGrid(mixed) = &blocks[0].data else { panic!() };
        assert_eq!(mixed.points.get(0).x, 0.25);
        assert_eq!(numbers(mixed.attributes.point_array("rho").unwrap())[0], 101.0);
    }
}

#[test]
fn a_wrong_case_names_the_file_the_place_and_a_cure() {
    for (name, from, to, words) in [
        ("a.case", "ensight gold", "ensight", ["a.case", "save it as EnSight Gold"]),
        ("a.case", "model: 1 a.geo***", "measured: 1 m", ["GEOMETRY", "add `model: NAME`"]),
        ("a.case", "0.5\n", "", ["1 times for 2 steps", "a time for each step"]),
        ("a.case", "a.vel", "b.vel", ["b.vel", "check the name"]),
        ("a.case", "time set: 1", "file set: 1", ["without a time set", "add `time set: 1`"]),
        ("a.geo003", "hexa8", "hexa9", ["a.geo003", "elements of type `hexa9`"]),
        (
            "a.geo003",
            "         1         2         5",
            "         1        99         5",
            ["point 99, of 12", "in line"],
        ),
        ("a.rho003", "coordinates", "coordinates partial", ["a.rho003", "partial"]),
        ("a.rho003", "part\n         4", "part\n         9", ["part 9 is not one", "in line"]),
        ("a.T", "3.00000e2\n", "", ["a.T", "in line"]),
    ] {
        let mut files = case(Encoding::Text);
        let file = files.iter_mut().find(|f| f.0 == name).unwrap();
        let text = String::from_utf8(file.1.clone()).unwrap();
        assert!(text.contains(from), "{name}: {from}");
        file.1 = text.replacen(from, to, 1).into_bytes();
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &files);
        let error = read(&dir.path().join("a.case"), None).map(|_| ()).unwrap_err();
        words.iter().for_each(|w| assert!(error.contains(w), "`{w}` is not in: {error}"));
    }
}

/// The bytes of a text record, or a line.
fn line(text: &str, encoding: Encoding) -> Vec<u8> {
    match encoding {
        Encoding::Text => format!("{text}\n").into_bytes(),
        Encoding::C { .. } => format!("{text:80}").into_bytes(),
        Encoding::Fortran { big } => {
            let mark = if big { 80u32.to_be_bytes() } else { 80u32.to_le_bytes() };
            [&mark[..], format!("{text:80}").as_bytes(), &mark[..]].concat()
        }
    }
}

#[test]
fn a_file_with_all_steps_gives_that_of_the_time() {
    for encoding in ENCODINGS {
        let mut files = case(encoding);
        let take = |files: &mut Vec<(String, Vec<u8>)>, name: &str| {
            let at = files.iter().position(|f| f.0 == name).unwrap();
            files.remove(at).1
        };
        for name in ["a.geo", "a.rho"] {
            let steps = ["003", "005"].map(|n| take(&mut files, &format!("{name}{n}")));
            let mut all = Vec::new();
            for step in steps {
                // The kind of a binary geometry comes once, before its steps.
                let kind = line("", encoding).len();
                let has_kind = name == "a.geo" && encoding != Encoding::Text;
                let (kind, step) = step.split_at(if has_kind { kind } else { 0 });
                if all.is_empty() {
                    all.extend_from_slice(kind);
                }
                all.extend(line("BEGIN TIME STEP", encoding));
                all.extend_from_slice(step);
                all.extend(line("END TIME STEP", encoding));
            }
            files.push((name.to_string(), all));
        }
        let case_file = files.iter_mut().find(|f| f.0 == "a.case").unwrap();
        let text = String::from_utf8(case_file.1.clone()).unwrap();
        let text =
            text.replace("1 a.geo***", "1 1 a.geo").replace("1 rho a.rho***", "1 1 rho a.rho");
        case_file.1 = format!("{text}FILE\nfile set: 1\nnumber of steps: 2\n").into_bytes();
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &files);
        let separate = tempfile::tempdir().unwrap();
        write(separate.path(), &case(encoding));
        for time in [0.5, 1.5] {
            let [one, other] = [&dir, &separate].map(|d| {
                read(&d.path().join("a.case"), Some(time)).unwrap_or_else(|e| panic!("{e}"))
            });
            assert_eq!(format!("{:?}", one.dataset()), format!("{:?}", other.dataset()));
        }
    }
}

#[test]
fn extents_tell_nothing_of_the_byte_order() {
    for encoding in [Encoding::C { big: true }, Encoding::C { big: false }] {
        let mut files = case(encoding);
        let geometry = files.iter_mut().find(|f| f.0 == "a.geo003").unwrap();
        let mut extents = line("extents", encoding);
        // Of these bytes, the other order makes the smaller number.
        for x in [-105.09, 13.28, -73.9, 73.9, 0.0, 0.0f32] {
            extents.extend(match encoding {
                Encoding::C { big: true } => x.to_be_bytes(),
                _ => x.to_le_bytes(),
            });
        }
        let first_part = 5 * 80;
        geometry.1.splice(first_part..first_part, extents);
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &files);
        let file = read(&dir.path().join("a.case"), None).unwrap_or_else(|e| panic!("{e}"));
        let Dataset::MultiBlock(blocks) = file.dataset().unwrap() else { panic!() };
        assert_eq!(blocks.len(), 4, "{encoding:?}");
    }
}

#[test]
fn vtk_reads_the_same_from_a_case() {
    let Some(python) = peer::python_with_vtk("vtk_reads_the_same_from_a_case") else { return };
    let script = r"
import sys, vtk
for path in sys.argv[1:]:
    reader = vtk.vtkGenericEnSightReader()
    reader.SetCaseFileName(path)
    reader.UpdateInformation()
    reader.SetTimeValue(1.5)
    reader.Update()
    out = reader.GetOutput()
    for i in range(2):
        b = out.GetBlock(i)
        cells = [b.GetCell(k) for k in range(b.GetNumberOfCells())]
        print(b.GetNumberOfPoints(), list(b.GetPoint(5)),
              [b.GetCellType(k) for k in range(len(cells))])
        for k in range(3):
            ids = b.GetCell(k).GetPointIds() if i == 0 else None
            print(sorted(ids.GetId(p) for p in range(ids.GetNumberOfIds())) if ids else '')
        rho = b.GetPointData().GetArray('rho')
        t = b.GetCellData().GetArray('T')
        print([rho.GetValue(k) for k in range(rho.GetNumberOfValues())],
              [t.GetValue(k) for k in range(t.GetNumberOfValues())])
";
    let mut expected = String::new();
    let mut cases = Vec::new();
    // VTK 9.7 ends with a segmentation fault on the text.
    for encoding in ENCODINGS.into_iter().filter(|e| *e != Encoding::Text) {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &case(encoding));
        let path = dir.path().join("a.case");
        let file = read(&path, Some(1.5)).unwrap();
        let Dataset::MultiBlock(blocks) = file.dataset().unwrap() else { panic!() };
        for block in blocks.iter().take(2) {
            let (p, types, cells) = match &block.data {
                Dataset::UnstructuredGrid(g) => (g.points.get(5), g.types.clone(), Some(&g.cells)),
                // In VTK a cell with a hidden point has the type 0.
                Dataset::StructuredGrid(g) => (g.points.get(5), vec![12, 0], None),
                other => panic!("{}", other.kind()),
            };
            writeln!(expected, "{} {:?} {types:?}", block.data.counts().0, p.to_array()).unwrap();
            for k in 0..3 {
                // VTK keeps the order of a wedge's corners as the file has it.
                let mut ids = cells.map_or_else(Vec::new, |c| c.get(k).to_vec());
                ids.sort_unstable();
                match cells {
                    Some(_) => writeln!(expected, "{ids:?}").unwrap(),
                    None => writeln!(expected).unwrap(),
                }
            }
            let a = block.data.attributes().unwrap();
            let rho = numbers(a.point_array("rho").unwrap());
            let t = numbers(a.cell_array("T").unwrap());
            writeln!(expected, "{rho:?} {t:?}").unwrap();
        }
        cases.push((dir, path.display().to_string()));
    }
    let paths: Vec<&str> = cases.iter().map(|c| c.1.as_str()).collect();
    assert_eq!(peer::run(&python, script, &paths), expected);
}
