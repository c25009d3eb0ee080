//! Data sets in several files: levels of refinement, pieces within blocks, slices of volumes.

mod sample_files;

use datasets::model::{Dataset, Values};
use datasets::read::{LoadedFile, open};
use sample_files::several::{
    levels, metaimage_of_slices, nrrd_of_slices, write_box, write_boxes, write_slices,
};
use std::io::Write as _;
use std::path::Path;

fn blocks(file: LoadedFile) -> Vec<(String, Dataset)> {
    let Ok(Dataset::MultiBlock(blocks)) = file.dataset().cloned() else { panic!("blocks") };
    blocks.into_iter().map(|b| (b.name, b.data)).collect()
}

/// Numbers of the cells that are marked as refined.
fn refined(data: &Dataset) -> Vec<usize> {
    let Dataset::ImageData(image) = data else { panic!("{}", data.kind()) };
    let Some(marks) = image.attributes.cell_array("vtkGhostType") else { return vec![] };
    (0..marks.tuples()).filter(|&i| marks.get(i, 0) == 8.0).collect()
}

#[test]
fn cells_that_a_finer_level_covers_are_marked_in_every_version() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    write_boxes(dir.path());
    let flat = "<VTKFile type=\"vtkHierarchicalBoxDataSet\" version=\"0.1\">\
        <vtkHierarchicalBoxDataSet><RefinementRatio level=\"0\" refinement=\"2\"/>\
        <DataSet group=\"0\" dataset=\"0\" amr_box=\"0 3 0 1 0 1\" file=\"0.vti\"/>\
        <DataSet group=\"1\" dataset=\"0\" amr_box=\"2 5 0 1 0 1\" file=\"1.vti\"/>\
        <DataSet group=\"2\" dataset=\"0\" amr_box=\"12 15 0 3 0 3\" file=\"2.vti\"/>\
        </vtkHierarchicalBoxDataSet></VTKFile>";
    for text in [
        levels("vtkOverlappingAMR", "1.1", "spacing=\"1 1 1\""),
        levels("vtkHierarchicalBoxDataSet", "1.0", "refinement_ratio=\"2\""),
        flat.to_string(),
    ] {
        std::fs::write(at("a.vthb"), text).unwrap();
        let file = open(at("a.vthb")).unwrap_or_else(|e| panic!("{e}"));
        assert!(file.warnings.iter().any(|w| w.contains("3 levels")), "{:?}", file.warnings);
        let blocks = blocks(file);
        let names: Vec<&str> = blocks.iter().map(|b| b.0.as_str()).collect();
        assert_eq!(names, ["level 0 box 0", "level 1 box 0", "level 2 box 0"]);
        assert_eq!(refined(&blocks[0].1), [1, 2]);
        assert_eq!(refined(&blocks[1].1), [1]);
        assert!(refined(&blocks[2].1).is_empty());
    }
    for (from, to, word) in [
        ("0 3 0 1 0 1", "0 4 0 1 0 1", "amr_box"),
        ("0 3 0 1 0 1", "0 x 0 1 0 1", "6 numbers"),
        ("level=\"2\"", "level=\"99\"", "level"),
        ("12 15", "99999999999 15", "6 numbers"),
    ] {
        let text = levels("vtkOverlappingAMR", "1.1", "").replacen(from, to, 1);
        std::fs::write(at("a.vthb"), text).unwrap();
        let error = open(at("a.vthb")).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("a.vthb") && error.contains(word), "{error}");
    }
}

#[test]
fn boxes_without_numbers_are_told_and_nothing_is_marked() {
    let dir = tempfile::tempdir().unwrap();
    write_boxes(dir.path());
    let path = dir.path().join("a.vthb");
    let warnings = |kind: &str| {
        let text = levels(kind, "1.1", "").replace("amr_box", "of_another");
        std::fs::write(&path, text).unwrap();
        let file = open(&path).unwrap_or_else(|e| panic!("{e}"));
        let warnings = file.warnings.join("\n");
        assert!(blocks(file).iter().all(|b| refined(&b.1).is_empty()));
        warnings
    };
    let overlapping = warnings("vtkOverlappingAMR");
    assert!(overlapping.contains("3 of 3 boxes are without an amr_box"), "{overlapping}");
    assert!(!overlapping.contains("covers"), "{overlapping}");
    assert_eq!(warnings("vtkNonOverlappingAMR"), "");
    let kind = "vtkOverlappingAMR";
    std::fs::write(&path, format!("<VTKFile type=\"{kind}\"><{kind}/></VTKFile>")).unwrap();
    let error = open(&path).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("they name no files"), "{error}");
}

#[test]
fn a_piece_that_holds_files_is_not_empty() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    write_box(&at("0.vti"), [1, 1, 1], [0.0; 3], 1.0, 1.0);
    write_box(&at("1.vti"), [2, 1, 1], [1.0, 0.0, 0.0], 1.0, 2.0);
    let text = "<VTKFile type=\"vtkMultiBlockDataSet\"><vtkMultiBlockDataSet>\
        <Block index=\"0\" name=\"Element Blocks\"><Piece index=\"0\">\
        <DataSet index=\"0\" file=\"0.vti\"/></Piece><Piece index=\"1\"/>\
        <Piece index=\"2\"><DataSet index=\"0\" file=\"1.vti\"/></Piece></Block>\
        </vtkMultiBlockDataSet></VTKFile>";
    std::fs::write(at("a.vtm"), text).unwrap();
    let data = open(at("a.vtm")).unwrap().dataset().cloned().unwrap();
    let cells: Vec<usize> = data.leaves().iter().map(|d| d.counts().1 as usize).collect();
    assert_eq!(cells, [1, 2]);
}

/// The values 0 to 23 of a volume of 2 x 3 x 4 points, slice by slice.
fn slices(encode: impl Fn(&[i16]) -> Vec<u8>) -> Vec<Vec<u8>> {
    let all: Vec<i16> = (0..24).collect();
    all.chunks(6).map(encode).collect()
}

fn values_of(path: &Path) -> Values {
    let file = open(path).unwrap_or_else(|e| panic!("{e}"));
    let Ok(Dataset::ImageData(image)) = file.dataset() else { panic!("image data") };
    assert_eq!(image.extent, [0, 1, 0, 2, 0, 3]);
    image.attributes.point[0].values.clone()
}

#[test]
fn slices_in_files_of_their_own_are_one_volume() {
    let raw = |s: &[i16]| s.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let gzip = |s: &[i16]| {
        let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        out.write_all(&raw(s)).unwrap();
        out.finish().unwrap()
    };
    let text = |s: &[i16]| s.iter().map(|x| format!("{x} ")).collect::<String>().into_bytes();
    let expected = Values::I16((0..24).collect());
    let (nrrd, mhd) = (nrrd_of_slices, metaimage_of_slices);
    let list = "LIST\ns.007\ns.008\ns.009\ns.010\n";
    let dir = tempfile::tempdir().unwrap();
    for (name, header, slices, before) in [
        ("a.nhdr", nrrd("raw", "data file: s.%03d 7 10 1\n"), slices(raw), &b""[..]),
        ("a.nhdr", nrrd("gzip", "data file: s.%03d 7 10 1 2\n"), slices(gzip), b""),
        ("a.nhdr", nrrd("ascii", &format!("data file: {list}")), slices(text), b""),
        ("a.nhdr", nrrd("raw", &format!("byte skip: -1\ndata file: {list}")), slices(raw), b"xy"),
        ("a.mhd", mhd("s.%03d 7 10 1\n"), slices(raw), b""),
        ("a.mhd", mhd(list), slices(raw), b""),
    ] {
        write_slices(dir.path(), &slices, before);
        std::fs::write(dir.path().join(name), header).unwrap();
        assert_eq!(values_of(&dir.path().join(name)), expected, "{name}");
    }
    // What is missing is named.
    for (header, words) in [
        (mhd("s.%03d 7 11 1\n"), ["5 files for 24 values", "as many files"]),
        (mhd("s.%03d 7 14 1\n"), ["s.011", "check the name"]),
        (mhd("s.%03d 7 9 1\n"), ["s.007", "values"]),
        (mhd("s.%03d 9 7 1\n"), ["9 to 7", "LAST"]),
    ] {
        std::fs::write(dir.path().join("a.mhd"), header).unwrap();
        let error = open(dir.path().join("a.mhd")).map(|_| ()).unwrap_err().to_string();
        words.iter().for_each(|w| assert!(error.contains(w), "`{w}` is not in: {error}"));
    }
}
