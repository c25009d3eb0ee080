//! Small files of every format for the tests of the readers, built byte by byte or by the writers.
#![allow(dead_code, reason = "each test uses some of them")]

pub(crate) mod amrex;
pub(crate) mod ensight;
pub(crate) mod openfoam;
pub(crate) mod several;
pub(crate) mod tables;
pub(crate) mod tecplot;

use datasets::model::*;
use datasets::write::{Encoding, VtkOptions, write_vtk};
use glam::DVec3;

/// A file name and its content.
pub(crate) type Sample = (&'static str, Vec<u8>);

pub(crate) fn image() -> ImageData {
    let mut d = ImageData::new([4, 3, 2], DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.5, 1.0, 2.0));
    d.attributes.point.push(DataArray::new(
        "p",
        1,
        Values::F32((0..24).map(|i| i as f32 * 0.5 - 3.0).collect()),
    ));
    d.attributes.point.push(DataArray::new(
        "v",
        3,
        Values::F64((0..72).map(|i| f64::from(i).sin()).collect()),
    ));
    d.attributes.cell.push(DataArray::new("c", 1, Values::U8((0..6).collect())));
    d.attributes.field.push(DataArray::new("TimeValue", 1, Values::F64(vec![0.25])));
    d.attributes.text.push(("title".into(), vec!["two words".into(), "ümlaut".into()]));
    d.attributes.point_scalars = Some("p".into());
    d
}

pub(crate) fn poly() -> PolyData {
    let mut d = PolyData {
        points: Points::F64(vec![
            [0., 0., 0.],
            [1., 0., 0.],
            [1., 1., 0.],
            [0., 1., 0.],
            [0.5, 0.5, 1.],
        ]),
        ..Default::default()
    };
    d.verts.push([4]);
    d.lines.push([0, 4, 2]);
    d.polys.push([0, 1, 2, 3]);
    d.polys.push([0, 1, 4]);
    d.strips.push([1, 2, 4, 3]);
    d.attributes.point.push(DataArray::new("t", 1, Values::I32(vec![1, -2, 3, -4, 5])));
    d.attributes.cell.push(DataArray::new("id <&\">", 1, Values::U16(vec![7, 8, 9, 10, 11])));
    d
}

/// A tetrahedron, a hexahedron and a cube stored as a polyhedron.
pub(crate) fn unstructured() -> UnstructuredGrid {
    let mut points = vec![[5., 0., 0.], [6., 0., 0.], [5., 1., 0.], [5., 0., 1.]];
    for shift in [0., 2.] {
        for [x, y, z] in [
            [0., 0., 0.],
            [1., 0., 0.],
            [1., 1., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [1., 0., 1.],
            [1., 1., 1.],
            [0., 1., 1.],
        ] {
            points.push([x + shift, y, z]);
        }
    }
    let mut d = UnstructuredGrid {
        points: Points::F32(points),
        types: vec![10, 12, 42],
        ..Default::default()
    };
    d.cells.push(0..4);
    d.cells.push(4..12);
    d.cells.push(12..20);
    for f in [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]] {
        d.polyhedron_faces.push(f.map(|k| k + 12));
    }
    d.faces_of_cell = vec![0..0, 0..0, 0..6];
    d.attributes.cell.push(DataArray::new("c", 1, Values::F32(vec![1.0, 2.0, 3.0])));
    d
}

pub(crate) fn rectilinear() -> RectilinearGrid {
    let mut d = RectilinearGrid {
        extent: [0, 2, 0, 1, 0, 2],
        coordinates: [vec![0.0, 1.0, 4.0], vec![0.0, 1.0], vec![-1.0, 0.0, 1.0]],
        attributes: Attributes::default(),
    };
    d.attributes.point.push(DataArray::new("p", 1, Values::I64((0..18).collect())));
    d
}

pub(crate) fn structured() -> StructuredGrid {
    let points = (0..12)
        .map(|i| [f64::from(i % 3), f64::from(i / 3 % 2), f64::from(i / 6) + 0.1 * f64::from(i)])
        .collect();
    let mut d = StructuredGrid {
        extent: [0, 2, 0, 1, 0, 1],
        points: Points::F64(points),
        attributes: Attributes::default(),
    };
    d.attributes.point.push(DataArray::new(
        "p",
        1,
        Values::F32((0..12).map(|i| i as f32).collect()),
    ));
    d
}

/// Every kind of data set with its file extension.
pub(crate) fn data_sets() -> Vec<(&'static str, Dataset)> {
    vec![
        ("vti", Dataset::ImageData(image())),
        ("vtp", Dataset::PolyData(poly())),
        ("vtu", Dataset::UnstructuredGrid(unstructured())),
        ("vtr", Dataset::RectilinearGrid(rectilinear())),
        ("vts", Dataset::StructuredGrid(structured())),
    ]
}

fn written(name: &str, data: &Dataset, options: VtkOptions) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    write_vtk(&path, data, options).unwrap();
    std::fs::read(path).unwrap()
}

/// A VTI with raw appended data, compressed in two blocks by `compressor`.
pub(crate) fn raw_appended(compressor: &str, pack: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let values: Vec<u8> = (0..8).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let blocks = [pack(&values[..20]), pack(&values[20..])];
    let mut data = Vec::new();
    for n in [2, 20, 12, blocks[0].len(), blocks[1].len()] {
        data.extend((n as u32).to_le_bytes());
    }
    blocks.iter().for_each(|b| data.extend(b));
    let mut file = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"0.1\" \
         byte_order=\"LittleEndian\" header_type=\"UInt32\" \
         compressor=\"{compressor}\">\n<ImageData WholeExtent=\"0 1 0 1 0 1\" Origin=\"0 0 0\" \
         Spacing=\"1 1 1\">\n\
         <Piece Extent=\"0 1 0 1 0 1\"><PointData Scalars=\"p\"><DataArray type=\"Float32\" \
         Name=\"p\" format=\"appended\" offset=\"0\"/>\
         </PointData></Piece></ImageData>\n<AppendedData encoding=\"raw\">\n_"
    )
    .into_bytes();
    file.extend(data);
    file.extend(b"\n</AppendedData></VTKFile>\n");
    file
}

pub(crate) fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut z, bytes).unwrap();
    z.finish().unwrap()
}

/// An archive of NumPy's: a density over three coordinates, or a spacing with a vector.
pub(crate) fn npz(packed: bool) -> Vec<u8> {
    use std::io::Write as _;
    let array = |shape: &str, values: &[f64]| {
        let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes
    };
    let numbers: Vec<f64> = (0..24).map(f64::from).collect();
    let arrays = if packed {
        vec![
            ("x.npy", array("(3,)", &numbers[..3])),
            ("y.npy", array("(2,)", &numbers[..2])),
            ("z.npy", array("(2,)", &numbers[..2])),
            ("rho.npy", array("(3, 2, 2)", &numbers[..12])),
        ]
    } else {
        vec![
            ("spacing.npy", array("(3,)", &numbers[1..4])),
            ("v.npy", array("(2, 2, 2, 3)", &numbers)),
        ]
    };
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let method =
        if packed { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
    let options = zip::write::SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in arrays {
        archive.start_file(name, options).unwrap();
        archive.write_all(&bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut z = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut z, bytes).unwrap();
    z.finish().unwrap()
}

pub(crate) fn vtk_xml() -> Vec<Sample> {
    let mut list: Vec<Sample> = Vec::new();
    let base64 = VtkOptions::default();
    let names = ["a.vti", "a.vtp", "a.vtu", "a.vtr", "a.vts"];
    for (name, (_, data)) in names.into_iter().zip(data_sets()) {
        list.push((
            name,
            written(name, &data, VtkOptions { encoding: Encoding::Ascii, compress: false }),
        ));
        list.push((name, written(name, &data, base64)));
        list.push((name, written(name, &data, VtkOptions { compress: true, ..base64 })));
    }
    list.push(("a.vti", raw_appended("vtkZLibDataCompressor", zlib)));
    list.push(("a.vti", raw_appended("vtkLZ4DataCompressor", lz4_flex::block::compress)));
    list
}

pub(crate) const LEGACY_GRID: &str = "# vtk DataFile Version 3.0\ntwo cells\nASCII\nDATASET \
                                      UNSTRUCTURED_GRID\nPOINTS 5 float\n\
    0 0 0 1 0 0 0 1 0 0 0 1 1 1 1\nCELLS 2 9\n4 0 1 2 3\n3 1 2 4\nCELL_TYPES 2\n10 5\nPOINT_DATA \
    5\nSCALARS s float 1\n\
    LOOKUP_TABLE default\n1 2 3 4 5\nVECTORS v double\n0 0 1 0 0 1 0 0 1 0 0 1 0 0 1\nCELL_DATA \
    2\nFIELD f 1\nid 1 2 int\n7 8\n";

pub(crate) fn legacy_binary() -> Vec<u8> {
    let mut b =
        b"# vtk DataFile Version 5.1\nbinary\nBINARY\nDATASET POLYDATA\nPOINTS 4 float\n".to_vec();
    [0f32, 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]
        .iter()
        .for_each(|x| b.extend(x.to_be_bytes()));
    b.extend(b"\nPOLYGONS 3 6\nOFFSETS vtktypeint64\n");
    [0i64, 3, 6].iter().for_each(|x| b.extend(x.to_be_bytes()));
    b.extend(b"\nCONNECTIVITY vtktypeint64\n");
    [0i64, 1, 2, 0, 2, 3].iter().for_each(|x| b.extend(x.to_be_bytes()));
    b.extend(b"\nPOINT_DATA 4\nSCALARS temp short 1\nLOOKUP_TABLE default\n");
    [1i16, -2, 300, 4].iter().for_each(|x| b.extend(x.to_be_bytes()));
    b.extend(b"\nMETADATA\nINFORMATION 0\n\n");
    b
}

pub(crate) const LEGACY_IMAGE: &str = "# vtk DataFile Version 2.0\nv\nASCII\nDATASET \
                                       STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\n\
    SPACING 1 1 1\nPOINT_DATA 8\nSCALARS d int\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7\n";

/// A PLOT3D grid and solution of `dims` points in the given layout.
pub(crate) fn plot3d(
    blocks: &[[u32; 3]],
    multi: bool,
    records: bool,
    big: bool,
    iblank: bool,
) -> (Vec<u8>, Vec<u8>) {
    let int = |x: u32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
    let real = |x: f32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
    let record = |out: &mut Vec<u8>, data: Vec<u8>| {
        let mark = int(data.len() as u32);
        if records {
            out.extend(mark);
        }
        out.extend(data);
        if records {
            out.extend(mark);
        }
    };
    let (mut grid, mut q) = (Vec::new(), Vec::new());
    for out in [&mut grid, &mut q] {
        if multi {
            record(out, int(blocks.len() as u32).to_vec());
        }
        record(out, blocks.iter().flatten().flat_map(|&d| int(d)).collect());
    }
    for (b, d) in blocks.iter().enumerate() {
        let n = d[0] * d[1] * d[2];
        let mut data: Vec<u8> = Vec::new();
        for axis in 0..3 {
            for i in 0..n {
                let index = [i % d[0], i / d[0] % d[1], i / d[0] / d[1]];
                data.extend(real(index[axis] as f32 + 10.0 * b as f32));
            }
        }
        if iblank {
            (0..n).for_each(|i| data.extend(int(u32::from(i != 0))));
        }
        record(&mut grid, data);
        record(&mut q, [2.95f32, 0.0, 2.1e6, 1.391].iter().flat_map(|&x| real(x)).collect());
        record(&mut q, (0..5 * n).flat_map(|i| real(i as f32)).collect());
    }
    (grid, q)
}

pub(crate) fn nrrd(encoding: &str, data: Vec<u8>) -> Vec<u8> {
    let mut b = format!(
        "NRRD0004\n# made here\ntype: short\ndimension: 3\nsizes: 3 2 2\nspace directions: \
         (0.5,0,0) (0,2,0) (0,0,1)\n\
         space origin: (1,2,3)\nendian: big\nencoding: {encoding}\ncontent: ct\n\n"
    )
    .into_bytes();
    b.extend(data);
    b
}

pub(crate) fn shorts() -> Vec<u8> {
    (0..12i16).flat_map(|i| (i * 100 - 300).to_be_bytes()).collect()
}

pub(crate) fn mha() -> Vec<u8> {
    let mut b = b"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = \
                  True\nCompressedData = False\n\
                  TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 0.5 2 \
                  1\nDimSize = 3 2 2\n\
                  ElementType = MET_SHORT\nElementDataFile = LOCAL\n"
        .to_vec();
    b.extend(shorts());
    b
}

pub(crate) const STL_TEXT: &str = "solid a\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   \
                                   vertex 1 0 0\n   vertex 0 1 0\n  endloop\n \
    endfacet\n facet normal 0 0 1\n  outer loop\n   vertex 1 0 0\n   vertex 1 1 0\n   vertex 0 1 \
    0\n  endloop\n endfacet\nendsolid a\n";

pub(crate) fn stl_binary() -> Vec<u8> {
    let mut b = b"solid that is binary all the same".to_vec();
    b.resize(80, b' ');
    b.extend(2u32.to_le_bytes());
    for t in
        [[[0f32, 0., 0.], [1., 0., 0.], [-0.0, 1., 0.]], [[1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]]
    {
        b.extend([0u8; 12]);
        t.iter().flatten().for_each(|x| b.extend(x.to_le_bytes()));
        b.extend([0, 0]);
    }
    b
}

pub(crate) const PLY_TEXT: &str = "ply\nformat ascii 1.0\ncomment made here\nelement vertex \
                                   4\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float quality\nelement \
    face 2\nproperty list uchar int vertex_indices\n\
    property int part\nelement edge 1\nproperty int a\nend_header\n0 0 0 255 0 0 0.5\n1 0 0 0 255 \
    0 0.25\n1 1 0 0 0 255 1\n0 1 0 255 255 255 2\n\
    3 0 1 2 7\n4 0 1 2 3 8\n5\n";

pub(crate) fn ply_binary(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut b = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 3\nproperty double x\nproperty \
         double y\nproperty double z\n\
         element face 1\nproperty list uchar uint vertex_index\nend_header\n"
    )
    .into_bytes();
    for x in [0f64, 0., 0., 1., 0., 0., 0., 1., 1e-3] {
        b.extend(if big { x.to_be_bytes() } else { x.to_le_bytes() });
    }
    b.push(3);
    for k in 0..3u32 {
        b.extend(if big { k.to_be_bytes() } else { k.to_le_bytes() });
    }
    b
}

pub(crate) const OBJ: &str = "mtllib none.mtl\no a\nv 0 0 0 1 0 0\nv 2 0 0 0 1 0\nv 2 2 0 0 0 1\nv \
                              1 0.5 0 1 1 1\nv 0 2 0 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
    vn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 3/3/1 4/4/1 5/4/1\nl 1 2\n";

/// A triangle whose node is scaled by two and mirrored, as `.gltf` with an embedded buffer.
pub(crate) fn gltf() -> Vec<u8> {
    let mut data: Vec<u8> =
        [0f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|x| x.to_le_bytes()).collect();
    data.extend([0u16, 1, 2].iter().flat_map(|x| x.to_le_bytes()));
    data.extend([0, 0]); // colours start at a multiple of four
    data.extend([255u8, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255]);
    let text = base64::encode(&data);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
"nodes":[{{"children":[1],"translation":[10,0,0],"mesh":0}},{{"scale":[-2,2,2],"mesh":0,"name":"mirrored"}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":2}},"indices":1,"material":0}}]}}],
"materials":[{{"name":"m","pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.25,1,1],"metallicFactor":0.75,"roughnessFactor":0.5}},"doubleSided":true}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
{{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}},
{{"bufferView":2,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}}],
"bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":6}},{{"buffer":0,"byteOffset":44,"byteLength":12}}],
"buffers":[{{"byteLength":56,"uri":"data:application/octet-stream;base64,{text}"}}]}}"#
    )
    .into_bytes()
}

/// A triangle of sparse positions, a corner of which a morph target moves.
fn gltf_sparse_and_morphed() -> Vec<u8> {
    let floats = [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 5., 6., 7.];
    let mut data: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    data.extend([2, 0]);
    let text = base64::encode(&data);
    let sparse = r#""componentType":5126,"count":3,"type":"VEC3","sparse":{"count":1,
"indices":{"bufferView":2,"componentType":5121},"values":{"bufferView":1}}"#;
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{{"POSITION":1}}]}}],
"weights":[0.5]}}],
"accessors":[{{"bufferView":0,"min":[0,0,0],"max":[5,6,7],{sparse}}},{{{sparse}}}],
"bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":12}},
{{"buffer":0,"byteOffset":48,"byteLength":2}}],
"buffers":[{{"byteLength":50,"uri":"data:application/octet-stream;base64,{text}"}}]}}"#
    )
    .into_bytes()
}

/// [`gltf`] as a `.glb` file.
pub(crate) fn glb() -> Vec<u8> {
    let text = String::from_utf8(gltf()).unwrap();
    let (head, rest) = text.split_once(",\"uri\":\"data:application/octet-stream;base64,").unwrap();
    let (data, tail) = rest.split_once('"').unwrap();
    let mut json = format!("{head}{tail}").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let buffer = base64::decode(data).unwrap();
    let mut out = b"glTF".to_vec();
    out.extend(2u32.to_le_bytes());
    out.extend((12 + 8 + json.len() as u32 + 8 + buffer.len() as u32).to_le_bytes());
    for (tag, chunk) in [(b"JSON", json), (b"BIN\0", buffer)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(tag);
        out.extend(chunk);
    }
    out
}

/// One small valid file of every format that does not need a second file.
/// A collection of two times, with every kind of lattice and a mixed topology.
const XDMF: &str = r#"<?xml version="1.0" ?><!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>
<Xdmf><Domain><Grid GridType="Collection" CollectionType="Temporal"><Time TimeType="List">
<DataItem Dimensions="2" Format="XML">0.5 1</DataItem></Time>
<Grid GridType="Collection" Name="all"><Grid Name="uniform">
<Topology TopologyType="3DCoRectMesh" Dimensions="2 2 3"/><Geometry GeometryType="ORIGIN_DXDYDZ">
<DataItem Dimensions="3">0 0 1</DataItem><DataItem Dimensions="3">1 2 3</DataItem></Geometry>
<Attribute Name="p"><DataItem Dimensions="2 2 3">0 1 2 3 4 5 6 7 8 9 10 11</DataItem></Attribute>
<Attribute Name="c" Center="Cell"><DataItem Dimensions="2" NumberType="Int">7 8</DataItem>
</Attribute></Grid><Grid Name="rectilinear"><Topology TopologyType="2DRectMesh" Dimensions="2 3"/>
<Geometry GeometryType="VXVY"><DataItem Dimensions="3">0 1 4</DataItem><DataItem Dimensions="2">0 1
</DataItem></Geometry></Grid><Grid Name="mixed"><Topology TopologyType="Mixed"><DataItem
Dimensions="10" NumberType="Int" Precision="8">6 0 1 2 3 3 3 1 2 3</DataItem></Topology>
<Geometry GeometryType="XYZ"><DataItem Dimensions="4 3" Precision="8">0 0 0 1 0 0 0 1 0 0 0 1
</DataItem></Geometry></Grid></Grid><Grid/></Grid></Domain></Xdmf>"#;

pub(crate) fn all() -> Vec<Sample> {
    let mut list = vtk_xml();
    list.extend([
        ("a.vtk", LEGACY_GRID.into()),
        ("b.vtk", legacy_binary()),
        ("c.vtk", LEGACY_IMAGE.into()),
        ("a.nrrd", nrrd("raw", shorts())),
        ("b.nrrd", nrrd("gzip", gzip(&shorts()))),
        ("c.nrrd", nrrd("ascii", b"1 2 3 4 5 6 7 8 9 10 11 12".to_vec())),
        ("a.mha", mha()),
        ("a_3x2x2_int16.raw", shorts()),
        ("a.stl", STL_TEXT.into()),
        ("b.stl", stl_binary()),
        ("a.ply", PLY_TEXT.into()),
        ("b.ply", ply_binary(false)),
        ("c.ply", ply_binary(true)),
        ("a.obj", OBJ.into()),
        ("a.gltf", gltf()),
        ("a.glb", glb()),
        ("b.gltf", gltf_sparse_and_morphed()),
        ("a.vtkhdf", include_bytes!("../files/image.vtkhdf").to_vec()),
        ("b.vtkhdf", include_bytes!("../files/times.vtkhdf").to_vec()),
        ("a.cgns", include_bytes!("../files/zones.cgns").to_vec()),
        ("b.cgns", include_bytes!("../files/elements.cgns").to_vec()),
        ("a.nc", include_bytes!("../files/classic.nc").to_vec()),
        ("b.nc", include_bytes!("../files/data.nc").to_vec()),
        ("a.exo", include_bytes!("../files/offset.exo").to_vec()),
        ("b.exo", include_bytes!("../files/netcdf4.exo").to_vec()),
        ("a.xmf", XDMF.into()),
        ("c.nc", include_bytes!("../files/netcdf4.nc").to_vec()),
    ]);
    for (name, records, big) in [("a.xyz", false, true), ("b.xyz", true, false)] {
        list.push((name, plot3d(&[[3, 2, 2], [2, 2, 2]], true, records, big, true).0));
    }
    list.extend([("a.npz", npz(true)), ("b.npz", npz(false))]);
    list.push(("a.tec", tecplot::TEXT.into()));
    let plt = |version, by_point| tecplot::plt(tecplot::Plt { version, big: by_point, by_point });
    list.extend([("a.plt", plt(112, false)), ("b.plt", plt(107, true)), ("c.plt", plt(75, true))]);
    list.extend(tables::all());
    list.push(("c.xyz", b"2 2 1\n0 1 0 1\n0 0 1 1\n0 0 0 0\n".to_vec()));
    list
}
