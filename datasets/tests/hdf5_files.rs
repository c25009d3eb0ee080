//! VTKHDF and NetCDF: files that h5py and netCDF4 wrote (`tests/files/make.py`), and what VTK
//! itself writes.

mod peer;

use datasets::model::{Dataset, Values};
use datasets::read::{OpenOptions, open, open_with};
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files").join(name)
}

fn at(name: &str, time: Option<f64>) -> datasets::read::LoadedFile {
    let options = OpenOptions { time, ..Default::default() };
    open_with(file(name), &options).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn image_data_of_vtkhdf_and_its_times() {
    for (name, time, shift) in [
        ("image.vtkhdf", None, 0.0),
        ("times.vtkhdf", None, 0.0),
        ("times.vtkhdf", Some(0.5), 100.0),
        ("times.vtkhdf", Some(2.0), 200.0),
    ] {
        let opened = at(name, time);
        assert_eq!(opened.format, "VTKHDF");
        let Dataset::ImageData(image) = opened.dataset().unwrap() else { panic!("{name}") };
        assert_eq!((image.dims(), image.extent), ([4, 3, 2], [0, 3, 1, 3, 0, 1]));
        assert_eq!(image.point(1, 0, 1).to_array(), [1.5, -1.0, 2.5]);
        let a = &image.attributes;
        assert_eq!(a.point_scalars.as_deref(), Some("rho"));
        let rho = a.point_array("rho").unwrap();
        assert!((0..24).all(|i| rho.get(i, 0) == i as f64 + shift), "{name} {time:?}");
        let c = a.cell_array("c").unwrap();
        assert_eq!((c.components, c.get(5, 1)), (2, 11.0));
        assert_eq!(a.field_array("gamma").unwrap().get(0, 0), 1.4);
    }
    let opened = at("times.vtkhdf", None);
    assert!(opened.warnings[0].contains("a series of 3 times"), "{:?}", opened.warnings);
    assert_eq!(opened.time_steps.iter().map(|s| s.time).collect::<Vec<_>>(), [0.0, 0.5, 2.0]);
    // The path of a step opens it.
    let last = open(&opened.time_steps[2].path).unwrap();
    assert_eq!(last.content_of_rho(), at("times.vtkhdf", Some(2.0)).content_of_rho());
    let error = open(file("times.vtkhdf/0.7")).unwrap_err().to_string();
    assert!(error.contains("choose one of 0, 0.5, 2"), "{error}");
    let none = OpenOptions { time: Some(0.0), ..Default::default() };
    let error = open_with(file("image.vtkhdf"), &none).unwrap_err().to_string();
    assert!(error.contains("no list of times"), "{error}");
}

trait Rho {
    fn content_of_rho(&self) -> Values;
}
impl Rho for datasets::read::LoadedFile {
    fn content_of_rho(&self) -> Values {
        self.dataset().unwrap().attributes().unwrap().point_array("rho").unwrap().values.clone()
    }
}

#[test]
fn netcdf_in_all_forms_is_one_lattice_with_units_fill_values_and_times() {
    for name in ["classic.nc", "offset.nc", "data.nc", "netcdf4.nc"] {
        for (time, shift) in [(None, 0.0), (Some(0.25), 0.0), (Some(0.5), 100.0)] {
            let opened = at(name, time);
            assert_eq!(opened.format, "NetCDF");
            assert_eq!(opened.time_steps.len(), 2);
            let Dataset::ImageData(image) = opened.dataset().unwrap() else { panic!("{name}") };
            assert_eq!(image.dims(), [4, 3, 2], "{name}");
            // Coordinates in mm become m.
            let corner = image.point(3, 2, 1).to_array();
            let expected = [0.004, 0.02, 0.005];
            assert!((0..3).all(|a| (corner[a] - expected[a]).abs() < 1e-9), "{corner:?}");
            let a = &image.attributes;
            let rho = a.point_array("rho").unwrap();
            assert!((0..24).all(|i| rho.get(i, 0) == i as f64 + shift), "{name} {time:?}");
            // Packed in 16 bits, in degrees C.
            let t = a.point_array("T").unwrap();
            for i in 0..24 {
                let value = (i as f64 + shift) * 0.5 + 20.0 + 273.15;
                match (i, shift) {
                    (2, 100.0) => assert!(t.get(i, 0).is_nan()),
                    _ => assert!((t.get(i, 0) - value).abs() < 1e-9, "{name} {i}"),
                }
            }
            // Its axes are x, y, z in this order: the first varies slowest in the file.
            let s = a.point_array("static").unwrap();
            for (i, j, k) in [(0, 0, 1), (1, 0, 0), (3, 2, 1), (2, 1, 0)] {
                assert_eq!(s.get(i + 4 * (j + 3 * k), 0), (i * 6 + j * 2 + k) as f64);
            }
            let text = opened.warnings.join("\n");
            assert_eq!(text.contains("`T`: 1 of 24 values are missing"), shift > 0.0, "{text}");
            for word in ["`line`", "from mm to m", "from degC to K"] {
                assert!(text.contains(word), "{word}: {text}");
            }
        }
    }
}

const WRITE: &str = r"
import sys, vtk
folder = sys.argv[1]
def both(data, name, writer):
    h = vtk.vtkHDFWriter()
    h.SetInputDataObject(data); h.SetFileName(f'{folder}/{name}.vtkhdf')
    h.SetCompressionLevel(4 if name == 'grid' else 0); h.Write()
    writer.SetInputDataObject(data); writer.SetFileName(f'{folder}/{name}.{writer.GetDefaultFileExtension()}')
    writer.Write()
wave = vtk.vtkRTAnalyticSource(); wave.SetWholeExtent(-2, 2, 0, 3, 0, 4); wave.Update()
grid = vtk.vtkAppendFilter(); grid.AddInputData(wave.GetOutput()); grid.Update()
tetra = vtk.vtkDataSetTriangleFilter(); tetra.SetInputConnection(grid.GetOutputPort()); tetra.Update()
both(grid.GetOutput(), 'grid', vtk.vtkXMLUnstructuredGridWriter())
both(tetra.GetOutput(), 'tetra', vtk.vtkXMLUnstructuredGridWriter())
ball = vtk.vtkSphereSource(); ball.SetThetaResolution(9); ball.Update()
both(ball.GetOutput(), 'ball', vtk.vtkXMLPolyDataWriter())
strips = vtk.vtkStripper(); strips.SetInputConnection(ball.GetOutputPort()); strips.Update()
both(strips.GetOutput(), 'strips', vtk.vtkXMLPolyDataWriter())
lines = vtk.vtkFeatureEdges(); lines.SetInputConnection(ball.GetOutputPort())
lines.SetFeatureAngle(5); lines.Update()
both(lines.GetOutput(), 'lines', vtk.vtkXMLPolyDataWriter())
whole = vtk.vtkPartitionedDataSetCollection()
whole.SetPartition(0, 0, ball.GetOutput()); whole.SetPartition(1, 0, tetra.GetOutput())
h = vtk.vtkHDFWriter(); h.SetInputDataObject(whole); h.SetFileName(folder + '/all.vtkhdf'); h.Write()
times = vtk.vtkSpatioTemporalHarmonicsSource(); times.SetWholeExtent(0, 3, 0, 2, 0, 2)
cells = vtk.vtkDataSetTriangleFilter(); cells.SetInputConnection(times.GetOutputPort())
h = vtk.vtkHDFWriter(); h.SetInputConnection(cells.GetOutputPort())
h.SetFileName(folder + '/times.vtkhdf'); h.SetWriteAllTimeSteps(True); h.Write()
cells.UpdateInformation()
steps = cells.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
for i in (0, len(steps) - 1):
    cells.UpdateTimeStep(steps[i])
    w = vtk.vtkXMLUnstructuredGridWriter(); w.SetInputDataObject(cells.GetOutput())
    w.SetFileName(f'{folder}/time{0 if i == 0 else 1}.vtu'); w.Write()
print(' '.join(repr(s) for s in steps))
";

/// Geometry and arrays, which must be equal bit by bit.
fn assert_same(ours: &Dataset, theirs: &Dataset, name: &str) {
    match (ours, theirs) {
        (Dataset::UnstructuredGrid(a), Dataset::UnstructuredGrid(b)) => {
            assert_eq!(a.points, b.points, "{name}");
            assert_eq!((&a.cells, &a.types), (&b.cells, &b.types), "{name}");
        }
        (Dataset::PolyData(a), Dataset::PolyData(b)) => {
            assert_eq!(a.points, b.points, "{name}");
            assert_eq!((&a.verts, &a.lines), (&b.verts, &b.lines), "{name}");
            assert_eq!((&a.polys, &a.strips), (&b.polys, &b.strips), "{name}");
        }
        _ => panic!("{name}: {} and {}", ours.kind(), theirs.kind()),
    }
    let (a, b) = (ours.attributes().unwrap(), theirs.attributes().unwrap());
    let sorted = |list: &[datasets::model::DataArray]| {
        let mut list = list.to_vec();
        list.sort_by(|a, b| a.name.cmp(&b.name));
        list
    };
    assert!(!a.point.is_empty() || name == "lines", "{name}");
    assert_eq!(sorted(&a.point), sorted(&b.point), "{name}");
    assert_eq!(sorted(&a.cell), sorted(&b.cell), "{name}");
    assert_eq!(a.point_normals, b.point_normals, "{name}");
}

#[test]
fn what_vtk_writes_as_vtkhdf_is_what_it_writes_as_xml() {
    let test = "what_vtk_writes_as_vtkhdf_is_what_it_writes_as_xml";
    let Some(python) = peer::python_with_vtk(test) else { return };
    let dir = tempfile::tempdir().unwrap();
    let steps = peer::run(&python, WRITE, &[dir.path().to_str().unwrap()]);
    let read = |name: &str| {
        let opened = open(dir.path().join(name)).unwrap_or_else(|e| panic!("{e}"));
        opened.dataset().unwrap().clone()
    };
    for (name, other) in
        [("grid", "vtu"), ("tetra", "vtu"), ("ball", "vtp"), ("strips", "vtp"), ("lines", "vtp")]
    {
        let (ours, theirs) = (read(&format!("{name}.vtkhdf")), read(&format!("{name}.{other}")));
        assert_same(&ours, &theirs, name);
    }
    let Dataset::MultiBlock(blocks) = read("all.vtkhdf") else { panic!() };
    assert_same(&blocks[0].data, &read("ball.vtp"), "block 0");
    assert_same(&blocks[1].data, &read("tetra.vtu"), "block 1");
    let opened = open(dir.path().join("times.vtkhdf")).unwrap_or_else(|e| panic!("{e}"));
    let steps: Vec<f64> = steps.split_whitespace().map(|s| s.parse().unwrap()).collect();
    let found: Vec<f64> = opened.time_steps.iter().map(|s| s.time).collect();
    // VTK's writer keeps them in single precision.
    assert_eq!(found, steps.iter().map(|&s| f64::from(s as f32)).collect::<Vec<_>>());
    assert_same(opened.dataset().unwrap(), &read("time0.vtu"), "the first time");
    let last = open(&opened.time_steps[steps.len() - 1].path).unwrap_or_else(|e| panic!("{e}"));
    assert_same(last.dataset().unwrap(), &read("time1.vtu"), "the last time");
}
