//! NumPy arrays: order, byte order and placement of the values, and what numpy itself writes.

mod peer;

use datasets::model::{Dataset, Values};
use datasets::read::{OpenOptions, open, open_with};
use std::path::Path;

fn npy(descr: &str, fortran: bool, shape: &str, values: &[u8]) -> Vec<u8> {
    let fortran = if fortran { "True" } else { "False" };
    let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.bytes());
    bytes.extend(values);
    bytes
}

fn spaced(path: &Path) -> Dataset {
    let options = OpenOptions { spacing: Some([0.5; 3]), ..Default::default() };
    open_with(path, &options).unwrap_or_else(|e| panic!("{e}")).dataset().unwrap().clone()
}

#[test]
fn the_first_index_is_x_in_both_orders_and_byte_orders() {
    let dir = tempfile::tempdir().unwrap();
    // a[i, j, k] = 100 i + 10 j + k
    let value = |i: u16, j: u16, k: u16| 100 * i + 10 * j + k;
    let mut of_c = Vec::new();
    let mut of_fortran = Vec::new();
    for i in 0..2 {
        for j in 0..3 {
            (0..4).for_each(|k| of_c.extend(value(i, j, k).to_be_bytes()));
        }
    }
    for k in 0..4 {
        for j in 0..3 {
            (0..2).for_each(|i| of_fortran.extend(value(i, j, k).to_le_bytes()));
        }
    }
    for bytes in [npy(">u2", false, "(2, 3, 4)", &of_c), npy("<u2", true, "(2, 3, 4)", &of_fortran)]
    {
        let path = dir.path().join("rho.npy");
        std::fs::write(&path, bytes).unwrap();
        let Dataset::ImageData(image) = spaced(&path) else { panic!() };
        assert_eq!(image.dims(), [2, 3, 4]);
        let rho = image.attributes.point_array("rho").unwrap();
        assert!(matches!(rho.values, Values::U16(_)));
        assert_eq!(rho.get(1 + 2 * (2 + 3 * 3), 0), 123.0);
        assert_eq!(image.point(1, 2, 3).to_array(), [0.5, 1.0, 1.5]);
    }
}

#[test]
fn an_array_without_spacing_says_how_to_give_it_and_takes_it_from_the_description() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("t.npy");
    std::fs::write(&path, npy("|i1", false, "(3, 2)", &[1, 2, 3, 4, 5, 6])).unwrap();
    let error = open(&path).unwrap_err().to_string();
    for word in ["t.npy", "[3, 2]", "t.npy.toml", "`spacing = [dx, dy, dz]`", "numpy.savez"] {
        assert!(error.contains(word), "{error}");
    }
    let description = dir.path().join("t.npy.toml");
    std::fs::write(&description, "spacing = [2.0, 3.0, 1.0]\norigin = [1.0, 0.0, 0.0]\n").unwrap();
    let opened = open(&path).unwrap();
    let Dataset::ImageData(image) = opened.dataset().unwrap() else { panic!() };
    assert_eq!((image.dims(), image.point(2, 1, 0).to_array()), ([3, 2, 1], [5.0, 3.0, 0.0]));
    assert_eq!(image.attributes.point[0].values, Values::I8(vec![1, 3, 5, 2, 4, 6]));
    std::fs::write(&description, "\nspaceing = [1.0, 1.0, 1.0]\n").unwrap();
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("in line 2") && error.contains("spaceing"), "{error}");
    std::fs::write(&description, "spacing = [0.0, 1.0, 1.0]\n").unwrap();
    let error = open(&path).unwrap_err().to_string();
    assert!(error.contains("a spacing above 0"), "{error}");
}

#[test]
fn declared_sizes_beyond_the_file_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    for (shape, word) in [
        ("(1000000, 1000000)", "1000000000000 values of 8 bytes"),
        ("(4294967296, 4294967296)", "more than 2^64"),
        ("(3,)", "3 values of 8 bytes"),
    ] {
        let path = dir.path().join("a.npy");
        std::fs::write(&path, npy("<f8", false, shape, &[0; 16])).unwrap();
        let error = open(&path).unwrap_err().to_string();
        assert!(error.contains(word), "{shape}: {error}");
    }
}

const WRITE: &str = r"
import sys, numpy as np
folder = sys.argv[1]
x, y, z = np.array([0., 1., 4.]), np.array([0., 2.]), np.array([1., 2., 3., 5.])
X, Y, Z = np.meshgrid(x, y, z, indexing='ij')
rho = (100 * X + 10 * Y + Z).astype('>f4')
u = np.stack([X, Y, Z], axis=-1)
cells = np.arange(2 * 1 * 3).reshape(2, 1, 3)
extra = dict(gamma=1.4, name=np.array('air'), other=np.zeros(7), cells=cells)
np.savez(folder + '/axes.npz', x=x, y=y, z=z, rho=np.asfortranarray(rho), u=u, **extra)
np.savez_compressed(folder + '/axes_packed.npz', x=x, y=y, z=z, rho=rho, u=u, **extra)
np.savez(folder + '/points.npz', x=X, y=Y, z=Z, rho=rho, u=u, cells=cells)
np.savez(folder + '/uniform.npz', spacing=[0.5, 1, 2], origin=[1, 0, 0], rho=rho, u=u)
np.savez(folder + '/transposed.npz', x=x, y=y, z=z, rho=rho.T)
";

#[test]
fn archives_that_numpy_writes() {
    let Some(python) = peer::python_with_vtk("archives_that_numpy_writes") else { return };
    let dir = tempfile::tempdir().unwrap();
    peer::run(&python, WRITE, &[dir.path().to_str().unwrap()]);
    for (name, kind) in [
        ("axes", "RectilinearGrid"),
        ("axes_packed", "RectilinearGrid"),
        ("points", "StructuredGrid"),
        ("uniform", "ImageData"),
    ] {
        let opened = open(dir.path().join(format!("{name}.npz"))).unwrap_or_else(|e| panic!("{e}"));
        let data = opened.dataset().unwrap();
        assert_eq!((data.kind(), data.counts().0), (kind, 24), "{name}");
        let a = data.attributes().unwrap();
        // The point with the indices (2, 1, 3) is at (4, 2, 5).
        let at = 2 + 3 * (1 + 2 * 3);
        assert_eq!(a.point_array("rho").unwrap().get(at, 0), 425.0, "{name}");
        assert_eq!([0, 1, 2].map(|c| a.point_array("u").unwrap().get(at, c)), [4.0, 2.0, 5.0]);
        if name != "uniform" {
            // Cell (1, 0, 2) of (2, 1, 3).
            assert_eq!(a.cell_array("cells").unwrap().get(1 + 2 * 2, 0), 5.0, "{name}");
        }
        if name.starts_with("axes") {
            assert_eq!(a.field[0].values, Values::F64(vec![1.4]));
            let warned = opened.warnings.join("\n");
            assert!(warned.contains("`other` [7]") && warned.contains("array `name`"), "{warned}");
        }
    }
    let error = open(dir.path().join("transposed.npz")).unwrap_err().to_string();
    assert!(error.contains("[4, 2, 3]") && error.contains("transpose"), "{error}");
}
