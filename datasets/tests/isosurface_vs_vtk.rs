//! Compares isosurfaces with `vtkFlyingEdges3D`: counts, vertex positions, normals and enclosed
//! volume.

mod peer;

use datasets::generate::wavelet::Wavelet;
use datasets::isosurface::{Options, count_triangles, extract};
use rt_core::mesh::TriMesh;

/// Contours a wavelet of `argv[1]` points at each further argument; prints triangles and points of
/// each. The last surface's points, then normals, go to the file `argv[2]`; its signed volume is
/// printed last.
const SCRIPT: &str = r#"
import sys, numpy
from vtkmodules.vtkImagingCore import vtkRTAnalyticSource
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D
from vtkmodules.util.numpy_support import vtk_to_numpy
h = int(sys.argv[1]) // 2
s = vtkRTAnalyticSource()
s.SetWholeExtent(-h, h, -h, h, -h, h)
c = vtkFlyingEdges3D()
c.SetInputConnection(s.GetOutputPort())
c.ComputeNormalsOn()
for iso in sys.argv[3:]:
    c.SetValue(0, float(iso))
    c.Update()
    o = c.GetOutput()
    print(o.GetNumberOfPolys(), o.GetNumberOfPoints())
p = vtk_to_numpy(o.GetPoints().GetData())
n = vtk_to_numpy(o.GetPointData().GetNormals())
with open(sys.argv[2], 'wb') as f:
    p.astype('<f4').tofile(f)
    n.astype('<f4').tofile(f)
q = vtk_to_numpy(o.GetPolys().GetConnectivityArray()).reshape(-1, 3)
a, b, c = (p[q[:, i]].astype(float) for i in range(3))
print(numpy.einsum('ij,ij->', a, numpy.cross(b, c)) / 6)
"#;

/// Positions with their normals, in an order that does not depend on the algorithm.
fn sorted(mut v: Vec<[f32; 6]>) -> Vec<[f32; 6]> {
    let key = |p: &[f32; 6]| [0, 1, 2].map(|a| (p[a] * 256.0).round() as i32);
    v.sort_by(|a, b| key(a).cmp(&key(b)).then(a.partial_cmp(b).unwrap()));
    v
}

fn volume(mesh: &TriMesh) -> f64 {
    let t = (0..mesh.num_triangles()).map(|i| mesh.triangle(i).map(|p| p.as_dvec3()));
    t.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

#[test]
fn counts_points_normals_and_orientation_are_vtks() {
    let Some(python) = peer::python_with_vtk("isosurface_vs_vtk") else { return };
    let file = tempfile::NamedTempFile::new().unwrap();
    let isos = [
        "60",
        "100",
        "115",
        "130",
        "150",
        "157.0909652709961",
        "170",
        "190",
        "200",
        "250",
        "133.37",
    ];
    let path = file.path().display().to_string();
    let args: Vec<&str> = ["67", &path].into_iter().chain(isos).collect();
    let printed = peer::run(&python, SCRIPT, &args);
    let mut lines = printed.lines();

    let grid = Wavelet::with_points(67).grid().unwrap();
    let values = isos.map(|v| v.parse::<f64>().unwrap());
    for (iso, n) in values.iter().zip(count_triangles(&grid, &values).unwrap()) {
        let points = extract(&grid, &[*iso], Options::default()).unwrap().mesh.positions.len();
        assert_eq!(format!("{n} {points}"), lines.next().unwrap(), "triangles and points at {iso}");
    }

    let mesh = extract(&grid, &values[10..], Options { normals: true, ..Default::default() })
        .unwrap()
        .mesh;
    let bytes = std::fs::read(file.path()).unwrap();
    let floats: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let (p, n) = floats.split_at(floats.len() / 2);
    let theirs =
        p.chunks(3).zip(n.chunks(3)).map(|(p, n)| [p[0], p[1], p[2], n[0], n[1], n[2]]).collect();
    let normals = mesh.normals.as_ref().unwrap();
    let ours = mesh
        .positions
        .iter()
        .zip(&normals.values)
        .map(|(p, n)| [p.x, p.y, p.z, n.x, n.y, n.z])
        .collect();
    let (mut worst_position, mut worst_normal) = (0f32, 0f32);
    for (a, b) in sorted(ours).iter().zip(&sorted(theirs)) {
        for c in 0..3 {
            worst_position = worst_position.max((a[c] - b[c]).abs());
            worst_normal = worst_normal.max((a[c + 3] - b[c + 3]).abs());
        }
    }
    // Coordinates are at most 33: allow a few ulps (2e-6 each). VTK's gradients are f32, too.
    assert!(worst_position < 1e-5, "positions differ by {worst_position}");
    assert!(worst_normal < 1e-4, "normals differ by {worst_normal}");

    // The diagonals differ, so the volumes differ slightly; the sign is the orientation of the
    // triangles.
    let theirs: f64 = lines.next().unwrap().parse().unwrap();
    let ours = volume(&mesh);
    assert!((ours / theirs - 1.0).abs() < 1e-3, "volume {ours} against VTK's {theirs}");
}
