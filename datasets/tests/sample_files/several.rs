//! Small data sets in several files: levels of refinement, and slices of volumes.

use datasets::model::{DataArray, Dataset, ImageData, Values};
use datasets::write::{VtkOptions, write_vtk};
use glam::DVec3;
use std::path::Path;

/// Image data with this many cells, and a cell array `rho` of this value.
pub(crate) fn write_box(path: &Path, cells: [u32; 3], origin: [f64; 3], spacing: f64, rho: f32) {
    let points = cells.map(|n| n + 1);
    let mut image = ImageData::new(points, DVec3::from(origin), DVec3::splat(spacing));
    let values = Values::F32(vec![rho; cells.iter().product::<u32>() as usize]);
    image.attributes.cell.push(DataArray::new("rho", 1, values));
    write_vtk(path, &Dataset::ImageData(image), VtkOptions::default()).unwrap();
}

/// The boxes of [`levels`]: 4 x 2 x 2 cells, of which two have cells of half the width (cells 1 and
/// 2 of the first row), and four cells of a quarter of that in one of these.
pub(crate) fn write_boxes(dir: &Path) {
    write_box(&dir.join("0.vti"), [4, 2, 2], [-1.0, 0.0, 0.0], 1.0, 1.0);
    write_box(&dir.join("1.vti"), [4, 2, 2], [0.0, 0.0, 0.0], 0.5, 2.0);
    write_box(&dir.join("2.vti"), [4, 4, 4], [0.5, 0.0, 0.0], 0.125, 3.0);
}

/// Three levels in a file of this kind and version.
pub(crate) fn levels(kind: &str, version: &str, level: &str) -> String {
    format!(
        "<VTKFile type=\"{kind}\" version=\"{version}\"><{kind} origin=\"-1 0 0\"><Block \
         level=\"0\" {level}><DataSet index=\"0\" amr_box=\"0 3 0 1 0 1\" \
         file=\"0.vti\"/></Block><Block level=\"1\"><DataSet index=\"0\" amr_box=\"2 5 0 1 0 1\" \
         file=\"1.vti\"/></Block><Block level=\"2\"><DataSet index=\"0\" amr_box=\"12 15 0 3 0 3\" \
         file=\"2.vti\"/><DataSet index=\"1\"/></Block></{kind}></VTKFile>"
    )
}

/// The header of a volume of 2 x 3 x 4 whole numbers of 16 bits, in files that this names.
pub(crate) fn nrrd_of_slices(encoding: &str, data_file: &str) -> String {
    format!(
        "NRRD0004\ntype: short\ndimension: 3\nsizes: 2 3 4\nendian: little\nencoding: \
         {encoding}\n{data_file}"
    )
}

/// As [`nrrd_of_slices`].
pub(crate) fn metaimage_of_slices(data_file: &str) -> String {
    format!("NDims = 3\nDimSize = 2 3 4\nElementType = MET_SHORT\nElementDataFile = {data_file}")
}

/// A name for each of four slices, from 7 on.
pub(crate) fn write_slices(dir: &Path, slices: &[Vec<u8>], before: &[u8]) {
    for (i, slice) in slices.iter().enumerate() {
        let bytes = [before, slice].concat();
        std::fs::write(dir.join(format!("s.{:03}", i + 7)), bytes).unwrap();
    }
}
