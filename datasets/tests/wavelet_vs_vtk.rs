//! Compares the wavelet generator with `vtkRTAnalyticSource`, bit for bit.

mod peer;

use datasets::generate::wavelet::Wavelet;
use glam::{DVec3, IVec3};

/// Writes RTData of a source with the given extent, centre, maximum, deviation, frequencies and
/// magnitudes.
const SCRIPT: &str = r#"
import sys
from vtkmodules.vtkImagingCore import vtkRTAnalyticSource
from vtkmodules.util.numpy_support import vtk_to_numpy
out, a = sys.argv[1], [float(v) for v in sys.argv[2:]]
s = vtkRTAnalyticSource()
s.SetWholeExtent(*[int(v) for v in a[0:6]])
s.SetCenter(*a[6:9])
s.SetMaximum(a[9])
s.SetStandardDeviation(a[10])
s.SetXFreq(a[11]); s.SetYFreq(a[12]); s.SetZFreq(a[13])
s.SetXMag(a[14]); s.SetYMag(a[15]); s.SetZMag(a[16])
s.Update()
vtk_to_numpy(s.GetOutput().GetPointData().GetScalars()).tofile(out)
"#;

#[test]
fn every_sample_has_vtks_bits() {
    let Some(python) = peer::python_with_vtk("wavelet_vs_vtk") else { return };
    let dir = tempfile::tempdir().unwrap();
    let cases = [
        Wavelet::default(),
        Wavelet::with_points(101),
        Wavelet::with_points(1),
        Wavelet { first: IVec3::new(-3, 0, 5), last: IVec3::new(15, 26, 32), ..Default::default() },
        Wavelet {
            first: IVec3::new(-7, -20, 4),
            last: IVec3::new(12, 20, 4),
            center: DVec3::new(1.5, -2.25, 0.1),
            maximum: 100.0,
            standard_deviation: 0.3,
            frequency: DVec3::new(61.0, 7.5, 3.3),
            magnitude: DVec3::new(1.0, 30.0, 0.7),
        },
    ];
    for (i, w) in cases.iter().enumerate() {
        let path = dir.path().join(format!("{i}.f32"));
        let mut args = vec![path.display().to_string()];
        for a in 0..3 {
            args.extend([w.first[a].to_string(), w.last[a].to_string()]);
        }
        args.extend(w.center.to_array().map(|v| v.to_string()));
        args.extend([w.maximum.to_string(), w.standard_deviation.to_string()]);
        args.extend(w.frequency.to_array().map(|v| v.to_string()));
        args.extend(w.magnitude.to_array().map(|v| v.to_string()));
        peer::run(&python, SCRIPT, &args.iter().map(String::as_str).collect::<Vec<_>>());

        let theirs = std::fs::read(&path).unwrap();
        let ours: Vec<u8> =
            w.grid().unwrap().values().iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(ours.len(), theirs.len(), "{w:?}");
        let different = ours.chunks(4).zip(theirs.chunks(4)).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{w:?}: samples that differ");
    }
}
