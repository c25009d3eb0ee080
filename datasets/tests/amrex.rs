//! Plotfiles of AMReX: boxes, ghost cells, and levels that cover each other.

mod sample_files;

use datasets::model::{DataArray, Dataset, ImageData};
use datasets::read::open;
use sample_files::amrex::{plotfile, write};

fn numbers(array: &DataArray) -> Vec<f64> {
    (0..array.values.len()).map(|i| array.values.get_f64(i)).collect()
}

#[test]
fn each_place_has_the_values_of_its_finest_cells() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &plotfile());
    let file = open(dir.path()).unwrap();
    assert_eq!(file.format, "AMReX plotfile");
    assert!(file.warnings[0].contains("2 levels"), "{:?}", file.warnings);
    let Dataset::MultiBlock(blocks) = file.dataset().unwrap() else { panic!() };
    let images: Vec<&ImageData> = blocks
        .iter()
        .map(|b| match &b.data {
            Dataset::ImageData(d) => d,
            other => panic!("{}", other.kind()),
        })
        .collect();
    let [first, second, fine] = images[..] else { panic!() };
    assert_eq!([first.dims(), second.dims(), fine.dims()], [[3, 3, 3], [3, 3, 3], [5, 3, 3]]);
    assert_eq!(second.point(0, 0, 0).to_array(), [2.0, 0.0, 0.0]);
    assert_eq!(fine.point(4, 2, 2).to_array(), [2.0, 0.5, 0.5]);
    for d in [first, second, fine] {
        // The values are x of the centres; the ghost cells of the second box are left out.
        let rho = numbers(d.attributes.cell_array("rho").unwrap());
        let dims = d.dims();
        for (cell, value) in rho.iter().enumerate() {
            let low = d.point(cell % (dims[0] - 1), 0, 0).x;
            assert_eq!(*value, low + d.spacing.x / 2.0);
        }
    }
    let ghosts = numbers(first.attributes.cell_array("vtkGhostType").unwrap());
    assert_eq!(ghosts, [8.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(second.attributes.cell_array("vtkGhostType").is_none());

    // Volume of the visible cells: that of the domain, 2 x 1 x 1.
    let visible = |d: &ImageData| {
        let cells = d.attributes.cell[0].tuples();
        let hidden = d
            .attributes
            .cell_array("vtkGhostType")
            .map_or(0, |g| numbers(g).iter().filter(|x| **x != 0.0).count());
        (cells - hidden) as f64 * d.spacing.x * d.spacing.y * d.spacing.z
    };
    assert_eq!(images.iter().map(|d| visible(d)).sum::<f64>(), 2.0);
    let (_, report) = file.dataset().unwrap().to_trimesh(Some("rho")).unwrap();
    assert_eq!(report.ghost_cells, 2);
}

#[test]
fn boxes_keep_their_places_whatever_files_they_are_in() {
    let [one, two] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let mut files = plotfile();
    write(one.path(), &files);
    let list = files.iter_mut().find(|f| f.0 == "Level_0/Cell_H").unwrap();
    let text = String::from_utf8(list.1.clone()).unwrap();
    let first = "FabOnDisk: Cell_D_00000 0\n";
    assert!(text.contains(first), "{text}");
    list.1 = text.replacen(first, "FabOnDisk: Cell_D_00001 0\n", 1).into_bytes();
    let data = files.iter().find(|f| f.0 == "Level_0/Cell_D_00000").unwrap().1.clone();
    files.push(("Level_0/Cell_D_00001".into(), data));
    write(two.path(), &files);
    let [one, two] = [one, two].map(|dir| open(dir.path()).unwrap());
    assert_eq!(one.dataset().unwrap(), two.dataset().unwrap());
}

#[test]
fn a_wrong_plotfile_names_the_file_the_place_and_a_cure() {
    for (name, from, to, words) in [
        ("Header", "HyperCLaw", "Other", ["Header", "in line 1"]),
        ("Header", "\n3\n0.125", "\n4\n0.125", ["axes", "`4`"]),
        ("Header", "0.25 0.25 0.25", "0 0.25 0.25", ["sizes of cells", "write it again"]),
        ("Level_0/Cell_H", "(2,0,0) (3,1,1)", "(2,0,0) (9,1,1)", ["Cell_D_00000", "does not fit"]),
        (
            "Level_0/Cell_H",
            "(2,0,0) (3,1,1) (0,0,0)",
            "(2,0,0) (3,1,1) (1,0,0)",
            ["Cell_H", "in line 7"],
        ),
        ("Level_0/Cell_H", "Cell_D_00000 0", "Cell_D_00000 99999", ["at byte 99999", "truncated"]),
        ("Level_1/Cell_H", "Cell_D_00000", "Cell_D_00007", ["Cell_D_00007", "check the name"]),
    ] {
        let mut files = plotfile();
        let file = files.iter_mut().find(|f| f.0 == name).unwrap();
        let text = String::from_utf8(file.1.clone()).unwrap();
        assert!(text.contains(from), "{name}: {from}");
        file.1 = text.replacen(from, to, 1).into_bytes();
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &files);
        let error = open(dir.path()).map(|_| ()).unwrap_err().to_string();
        words.iter().for_each(|w| assert!(error.contains(w), "`{w}` is not in: {error}"));
    }
}
