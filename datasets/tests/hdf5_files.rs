//! VTKHDF, NetCDF, XDMF and Exodus II: files that h5py and netCDF4 wrote (`tests/files/make.py`),
//! and what VTK itself writes.

mod peer;

use datasets::model::{Dataset, Values};
use datasets::read::{OpenOptions, open, open_with};
use datasets::write::{VtkOptions, write_vtk};
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
    end = writer.GetDefaultFileExtension()
    writer.SetInputDataObject(data); writer.SetFileName(f'{folder}/{name}.{end}')
    writer.Write()
wave = vtk.vtkRTAnalyticSource(); wave.SetWholeExtent(-2, 2, 0, 3, 0, 4); wave.Update()
grid = vtk.vtkAppendFilter(); grid.AddInputData(wave.GetOutput()); grid.Update()
tetra = vtk.vtkDataSetTriangleFilter(); tetra.SetInputConnection(grid.GetOutputPort())
tetra.Update()
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
h = vtk.vtkHDFWriter(); h.SetInputDataObject(whole)
h.SetFileName(folder + '/all.vtkhdf'); h.Write()
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

const WRITE_OTHERS: &str = r"
import sys, vtk
folder = sys.argv[1]
wave = vtk.vtkRTAnalyticSource(); wave.SetWholeExtent(0, 3, 0, 3, 0, 4); wave.Update()
grid = vtk.vtkAppendFilter(); grid.AddInputData(wave.GetOutput()); grid.Update()
rect = vtk.vtkRectilinearGrid(); rect.SetDimensions(3, 2, 2)
for name, values in (('X', [0, 1, 4]), ('Y', [0, 2]), ('Z', [1, 3])):
    a = vtk.vtkDoubleArray()
    for v in values: a.InsertNextValue(v)
    getattr(rect, f'Set{name}Coordinates')(a)
c = vtk.vtkDoubleArray(); c.SetName('p')
for i in range(12): c.InsertNextValue(i)
rect.GetPointData().AddArray(c)
curved = vtk.vtkStructuredGrid(); curved.SetDimensions(3, 2, 2)
points = vtk.vtkPoints(); points.SetDataTypeToDouble()
for i in range(12): points.InsertNextPoint(rect.GetPoint(i))
curved.SetPoints(points); curved.GetPointData().AddArray(c)
for name, data, writer in (('image', wave.GetOutput(), vtk.vtkXMLImageDataWriter()),
                           ('grid', grid.GetOutput(), vtk.vtkXMLUnstructuredGridWriter()),
                           ('rect', rect, vtk.vtkXMLRectilinearGridWriter()),
                           ('curved', curved, vtk.vtkXMLStructuredGridWriter())):
    x = vtk.vtkXdmfWriter(); x.SetInputDataObject(data); x.SetFileName(f'{folder}/{name}.xmf')
    x.SetLightDataLimit(0 if name == 'grid' else 100000); x.Write()
    writer.SetInputDataObject(data); writer.SetFileName(f'{folder}/{name}.ref'); writer.Write()
r = vtk.vtkExodusIIReader(); r.SetFileName(sys.argv[2]); r.UpdateInformation()
r.ApplyDisplacementsOff(); r.SetTimeStep(0)
for kind in (r.NODAL, r.ELEM_BLOCK):
    for i in range(r.GetNumberOfObjectArrays(kind)):
        r.SetObjectArrayStatus(kind, r.GetObjectArrayName(kind, i), 1)
r.Update()
for i in range(2):
    w = vtk.vtkXMLUnstructuredGridWriter()
    w.SetInputDataObject(r.GetOutput().GetBlock(0).GetBlock(i))
    w.SetFileName(f'{folder}/block{i}.ref')
    w.Write()
";

#[test]
fn xdmf_and_exodus_files_of_vtk() {
    let Some(python) = peer::python_with_vtk("xdmf_and_exodus_files_of_vtk") else { return };
    let dir = tempfile::tempdir().unwrap();
    let exodus = file("offset.exo");
    let args = [dir.path().to_str().unwrap(), exodus.to_str().unwrap()];
    peer::run(&python, WRITE_OTHERS, &args);
    let read = |name: &str| {
        let opened = open(dir.path().join(name)).unwrap_or_else(|e| panic!("{e}"));
        (opened.format, opened.dataset().unwrap().clone())
    };
    for name in ["image", "grid", "rect", "curved"] {
        let ((format, ours), (_, theirs)) =
            (read(&format!("{name}.xmf")), read(&format!("{name}.ref")));
        assert_eq!((format, ours.kind(), ours.counts()), ("XDMF", theirs.kind(), theirs.counts()));
        let (a, b) = (&ours.attributes().unwrap().point[0], &theirs.attributes().unwrap().point[0]);
        assert_eq!(a.name, b.name);
        // The XML has six digits.
        for i in 0..a.tuples() {
            assert!((a.get(i, 0) - b.get(i, 0)).abs() <= 1e-5 * b.get(i, 0).abs(), "{name} {i}");
        }
        match (&ours, &theirs) {
            (Dataset::ImageData(a), Dataset::ImageData(b)) => {
                assert_eq!(a.point(1, 2, 3), b.point(1, 2, 3));
            }
            (Dataset::UnstructuredGrid(a), Dataset::UnstructuredGrid(b)) => {
                assert_eq!(a.points, b.points);
                // XDMF has no voxels (type 11): they become hexahedra.
                for (i, voxel) in b.cells.iter().enumerate() {
                    let corners = [0, 1, 3, 2, 4, 5, 7, 6].map(|k| voxel[k]);
                    assert_eq!((a.types[i], a.cells.get(i)), (12, &corners[..]));
                }
            }
            (Dataset::RectilinearGrid(a), Dataset::RectilinearGrid(b)) => {
                assert_eq!(a.coordinates, b.coordinates);
            }
            (Dataset::StructuredGrid(a), Dataset::StructuredGrid(b)) => {
                assert_eq!(a.points, b.points);
            }
            _ => panic!("{name}"),
        }
    }
    // VTK makes a data set of each block, with the points that it uses.
    let ours = at("offset.exo", None);
    let Dataset::UnstructuredGrid(ours) = ours.dataset().unwrap() else { panic!() };
    let mut cell = 0;
    for i in 0..2 {
        let (_, Dataset::UnstructuredGrid(block)) = read(&format!("block{i}.ref")) else {
            panic!()
        };
        let (a, b) = (&ours.attributes, &block.attributes);
        for k in 0..block.cells.len() {
            assert_eq!(ours.types[cell], block.types[k]);
            for (&x, &y) in ours.cells.get(cell).iter().zip(block.cells.get(k)) {
                let (x, y) = (x as usize, y as usize);
                assert_eq!(ours.points.get(x), block.points.get(y));
                for name in ["T", "p"] {
                    let (a, b) = (a.point_array(name).unwrap(), b.point_array(name).unwrap());
                    assert_eq!(a.get(x, 0), b.get(y, 0), "{name}");
                }
            }
            if let Some(c) = b.cell_array("c").filter(|_| i == 0) {
                assert_eq!(a.cell_array("c").unwrap().get(cell, 0), c.get(k, 0));
            }
            cell += 1;
        }
    }
    assert_eq!(cell, ours.cells.len());
}

#[test]
fn exodus_blocks_and_times_in_both_forms_of_netcdf() {
    for name in ["offset.exo", "netcdf4.exo"] {
        for (time, shift) in [(None, 0.0), (Some(0.5), 100.0)] {
            let opened = at(name, time);
            assert_eq!((opened.format, opened.time_steps.len()), ("Exodus II", 2));
            let Dataset::UnstructuredGrid(grid) = opened.dataset().unwrap() else { panic!() };
            assert_eq!(grid.types, [12, 10, 10]);
            assert_eq!(grid.cells.get(2), [1, 5, 6, 8]);
            assert_eq!(grid.points.get(8).to_array(), [2.0, 0.0, 0.5]);
            let a = &grid.attributes;
            assert_eq!(a.cell_array("ObjectId").unwrap().values, Values::I32(vec![10, 20, 20]));
            for (variable, first) in [("T", 0.0), ("p", 10.0)] {
                let v = a.point_array(variable).unwrap();
                assert!((0..9).all(|i| v.get(i, 0) == i as f64 + first + shift), "{variable}");
            }
            let c = a.cell_array("c").unwrap();
            assert_eq!(c.get(0, 0), if shift > 0.0 { 8.0 } else { 7.0 });
            assert!(c.get(1, 0).is_nan() && c.get(2, 0).is_nan());
            let text = opened.warnings.join("\n");
            assert!(text.contains("`c` is NaN in blocks without it: 2"), "{text}");
            assert_eq!(a.text[0].1, ["cube", "side"]);
        }
    }
}

#[test]
fn xdmf_times_that_share_a_mesh_and_boxes_of_hdf5() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(file("old.h5"), dir.path().join("old.h5")).unwrap();
    let grid = |time: f64, row: u32| {
        format!(
            r#"<Grid><xi:include xpointer="xpointer(//Grid[@Name=&quot;mesh&quot;]/*[self::Topology
            or self::Geometry])"/><Time Value="{time}"/><Attribute Name="T" Center="Node">
            <DataItem ItemType="HyperSlab" Dimensions="1 7">
            <DataItem Dimensions="3 2" Format="XML" NumberType="Int">{row} 0 1 1 1 7</DataItem>
            <DataItem Dimensions="5 7" Format="HDF" Precision="8">old.h5:/contiguous</DataItem>
            </DataItem></Attribute></Grid>"#
        )
    };
    let text = format!(
        r#"<?xml version="1.0"?><Xdmf xmlns:xi="http://www.w3.org/2003/XInclude"><Domain>
        <Grid Name="s" GridType="Collection" CollectionType="Temporal">{}{}</Grid>
        <Grid Name="mesh"><Topology TopologyType="Mixed" NumberOfElements="2">
        <DataItem Dimensions="10" NumberType="Int" Format="XML">9 0 1 2 3 4 5 6 6 4</DataItem>
        </Topology></Grid></Domain></Xdmf>"#,
        grid(0.5, 1),
        grid(0.25, 3),
    );
    let path = dir.path().join("a.xdmf");
    let write = |text: &str| std::fs::write(&path, text).unwrap();
    write(&text);
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("no `Geometry`"), "{error}");
    let points = "<Geometry GeometryType='XY'><DataItem Dimensions='7 2' Format='XML'>\
                  0 0 1 0 1 1 0 1 2 0 2 1 3 1</DataItem></Geometry></Grid></Domain>";
    let text = text.replace("</Grid></Domain>", points);
    write(&text);
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("a cell of") || error.contains("cells of type"), "{error}");
    let text = text.replace(r#""10" NumberType"#, r#""9" NumberType"#);
    let text = text.replace("9 0 1 2 3 4 5 6 6 4", "5 0 1 2 3 4 1 4");
    write(&text);
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("8 values instead of the 9"), "{error}");
    write(&text.replace("5 0 1 2 3 4 1 4", "5 0 1 2 3 4 1 4 2"));
    let opened = open(&path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(opened.time_steps.iter().map(|s| s.time).collect::<Vec<_>>(), [0.25, 0.5]);
    let row = |opened: &datasets::read::LoadedFile| {
        let Dataset::UnstructuredGrid(grid) = opened.dataset().unwrap() else { panic!() };
        assert_eq!((grid.types.clone(), grid.cells.get(1)), (vec![9, 5], &[1, 4, 2][..]));
        let t = grid.attributes.point_array("T").unwrap();
        (0..7).map(|i| t.get(i, 0)).collect::<Vec<_>>()
    };
    assert_eq!(row(&opened), [21., 22., 23., 24., 25., 26., 27.]);
    let second = open(&opened.time_steps[1].path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(row(&second), [7., 8., 9., 10., 11., 12., 13.]);
}

/// A classic NetCDF file with these dimensions, and `coordx` over the first of them.
fn classic(dimensions: &[(&str, u32)]) -> Vec<u8> {
    let mut out = b"CDF\x01\0\0\0\0".to_vec();
    let name = |out: &mut Vec<u8>, name: &str| {
        out.extend((name.len() as u32).to_be_bytes());
        out.extend(name.bytes());
        out.resize(out.len().next_multiple_of(4), 0);
    };
    let words = |out: &mut Vec<u8>, words: &[u32]| {
        words.iter().for_each(|w| out.extend(w.to_be_bytes()));
    };
    words(&mut out, &[10, dimensions.len() as u32]);
    for (of, length) in dimensions {
        name(&mut out, of);
        words(&mut out, &[*length]);
    }
    // No attributes; one variable of doubles, whose values follow.
    words(&mut out, &[0, 0, 11, 1]);
    name(&mut out, "coordx");
    let size = 8 * dimensions[0].1;
    let begin = out.len() as u32 + 7 * 4;
    words(&mut out, &[1, 0, 0, 0, 6, size, begin]);
    (0..dimensions[0].1).for_each(|i| out.extend(f64::from(i).to_be_bytes()));
    out
}

#[test]
fn sets_of_exodus_are_not_left_out_in_silence() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("sets.exo");
    let dims = [("num_nodes", 2), ("num_dim", 1), ("num_elem", 1), ("num_side_sets", 3)];
    std::fs::write(&path, classic(&dims)).unwrap();
    let opened = datasets::read::open(&path).unwrap();
    assert_eq!(opened.format, "Exodus II");
    assert_eq!(opened.warnings, ["3 side sets (boundaries) left out"]);
}

/// An Exodus II file of one element of this type with these nodes, which count from 1.
fn exodus_element(kind: &str, points: &[[f64; 3]], nodes: &[u32]) -> Vec<u8> {
    let mut out = b"CDF\x01\0\0\0\0".to_vec();
    let words = |out: &mut Vec<u8>, words: &[u32]| {
        words.iter().for_each(|w| out.extend(w.to_be_bytes()));
    };
    let text = |out: &mut Vec<u8>, text: &str| {
        out.extend((text.len() as u32).to_be_bytes());
        out.extend(text.bytes());
        out.resize(out.len().next_multiple_of(4), 0);
    };
    let [count, size] = [points.len() as u32, nodes.len() as u32];
    let dimensions = [
        ("num_dim", 3),
        ("num_nodes", count),
        ("num_elem", 1),
        ("num_el_blk", 1),
        ("num_el_in_blk1", 1),
        ("num_nod_per_el1", size),
    ];
    words(&mut out, &[10, dimensions.len() as u32]);
    for (name, length) in dimensions {
        text(&mut out, name);
        words(&mut out, &[length]);
    }
    // No attributes, and two variables, each with a place for where its values begin.
    words(&mut out, &[0, 0, 11, 2]);
    text(&mut out, "coord");
    words(&mut out, &[2, 0, 1, 0, 0, 6, 24 * count]);
    let of_points = out.len();
    words(&mut out, &[0]);
    text(&mut out, "connect1");
    words(&mut out, &[2, 4, 5, 12, 1]);
    text(&mut out, "elem_type");
    words(&mut out, &[2]);
    text(&mut out, kind);
    words(&mut out, &[4, 4 * size]);
    let of_nodes = out.len();
    words(&mut out, &[0]);
    for (at, begin) in [(of_points, out.len()), (of_nodes, out.len() + 24 * points.len())] {
        out[at..at + 4].copy_from_slice(&(begin as u32).to_be_bytes());
    }
    for axis in 0..3 {
        points.iter().for_each(|p| out.extend(p[axis].to_be_bytes()));
    }
    words(&mut out, nodes);
    out
}

/// Programs write the first triangle of a wedge either way round; a .vtu file has it outwards.
#[test]
fn wedges_of_exodus_are_not_inside_out_in_a_vtu() {
    let dir = tempfile::tempdir().unwrap();
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let at = |z: f64| corners.map(|[x, y]| [x, y, z]);
    let middle = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
    let mut points: Vec<[f64; 3]> = at(0.0).into_iter().chain(at(2.0)).collect();
    // The middles of the lower, the vertical and the upper edges, as the manual has them.
    for [a, b] in [[0, 1], [1, 2], [2, 0], [0, 3], [1, 4], [2, 5], [3, 4], [4, 5], [5, 3]] {
        points.push(middle(points[a], points[b]));
    }
    let manual: Vec<u32> = (1..=15).collect();
    let as_vtk = [1, 3, 2, 4, 6, 5, 9, 8, 7, 10, 12, 11, 15, 14, 13];
    for nodes in [6, 15] {
        for order in [&manual[..], &as_vtk] {
            let path = dir.path().join("wedge.exo");
            let bytes = exodus_element("WEDGE", &points[..nodes], &order[..nodes]);
            std::fs::write(&path, bytes).unwrap();
            let opened = open(&path).unwrap_or_else(|e| panic!("{e}"));
            let vtu = dir.path().join("wedge.vtu");
            write_vtk(&vtu, opened.dataset().unwrap(), VtkOptions::default()).unwrap();
            let opened = open(&vtu).unwrap_or_else(|e| panic!("{e}"));
            let Dataset::UnstructuredGrid(grid) = opened.dataset().unwrap() else { panic!() };
            let ids = grid.cells.get(0);
            assert_eq!(ids[..6], [0, 2, 1, 3, 5, 4], "{nodes} nodes as {order:?}");
            // Each middle is between the corners that VTK says.
            let edges = [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];
            for (id, [a, b]) in ids[6..].iter().zip(edges) {
                let place = |k: u32| grid.points.get(k as usize);
                assert_eq!(place(*id), 0.5 * (place(ids[a]) + place(ids[b])), "{order:?}");
            }
        }
    }
}

/// Kinds of quadratic cells with their numbers of nodes.
const QUADRATIC: [(&str, usize); 11] = [
    ("Edge_3", 3),
    ("Triangle_6", 6),
    ("Quadrilateral_8", 8),
    ("Quadrilateral_9", 9),
    ("Tetrahedron_10", 10),
    ("Pyramid_13", 13),
    ("Wedge_15", 15),
    ("Wedge_18", 18),
    ("Hexahedron_20", 20),
    ("Hexahedron_24", 24),
    ("Hexahedron_27", 27),
];

#[test]
fn nodes_of_quadratic_cells_of_xdmf_come_as_vtk_has_them() {
    let Some(python) =
        peer::python_with_vtk("nodes_of_quadratic_cells_of_xdmf_come_as_vtk_has_them")
    else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let mut paths = Vec::new();
    let mut expected = String::new();
    for (kind, nodes) in QUADRATIC {
        let points: Vec<String> =
            (0..nodes).map(|i| format!("{i} {} {}", i * i % 7, i * i * i % 11)).collect();
        // The nodes in another order than the points.
        let ids: Vec<String> = (0..nodes).map(|i| ((i + 2) % nodes).to_string()).collect();
        let text = format!(
            "<?xml version=\"1.0\"?><Xdmf><Domain><Grid><Topology TopologyType=\"{kind}\" \
             NumberOfElements=\"1\"><DataItem Format=\"XML\" NumberType=\"Int\" \
             Dimensions=\"1 {nodes}\">{}</DataItem></Topology><Geometry GeometryType=\"XYZ\">\
             <DataItem Format=\"XML\" Dimensions=\"{nodes} 3\">{}</DataItem></Geometry></Grid>\
             </Domain></Xdmf>",
            ids.join(" "),
            points.join(" ")
        );
        let path = dir.path().join(format!("{kind}.xmf"));
        std::fs::write(&path, text).unwrap();
        let opened = open(&path).unwrap_or_else(|e| panic!("{e}"));
        let Dataset::UnstructuredGrid(grid) = opened.dataset().unwrap() else { panic!("{kind}") };
        expected += &format!("{} {:?}\n", grid.types[0], grid.cells.get(0));
        paths.push(path.display().to_string());
    }
    let script = r"
import sys, vtk
for path in sys.argv[1:]:
    reader = vtk.vtkXdmfReader()
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutputDataObject(0)
    while data.IsA('vtkCompositeDataSet'):
        data = data.GetBlock(0)
    cell = data.GetCell(0)
    print(data.GetCellType(0), [cell.GetPointId(i) for i in range(cell.GetNumberOfPoints())])
";
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    assert_eq!(peer::run(&python, script, &paths), expected);
}
