//! Runs the program, and writes a flow for it.

#![allow(dead_code, reason = "each test program uses a part of it")]

use datasets::model::{DataArray, Dataset, ImageData, Values};
use datasets::write::{VtkOptions, write_vtk};
use glam::DVec3;
use std::path::Path;
use std::process::{Command, Output};

pub(crate) fn schlieren(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_schlieren")).args(args).output().expect("the program starts")
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Writes a flow: air of 1.2 kg/m³ with a light blob right of and above the middle, in a box of 0.2
/// x 0.1 x 0.1 m.
pub(crate) fn flow(path: &Path) {
    flow_of(path, [41, 21]);
}

/// [`flow`] with this number of nodes along x, and along y and z.
pub(crate) fn flow_of(path: &Path, [nx, n]: [u32; 2]) {
    let spacing_m = 0.1 / f64::from(n - 1);
    let mut image =
        ImageData::new([nx, n, n], DVec3::new(-0.1, -0.05, -0.05), DVec3::splat(spacing_m));
    let at = |i: u32, n: u32| (f64::from(i) - 0.5 * f64::from(n - 1)) * spacing_m;
    let blob = |i: u32| {
        let (x, y, z) = (at(i % nx, nx), at(i / nx % n, n), at(i / nx / n, n));
        1.2 - 0.3
            * (-((x - 0.03).powi(2) + (y - 0.01).powi(2) + z * z) / (2.0 * 0.015f64.powi(2))).exp()
    };
    let values: Vec<f32> = (0..nx * n * n).map(|i| blob(i) as f32).collect();
    let constant = |v: f32| Values::F32(vec![v; values.len()]);
    let temperature = values.iter().map(|r| 1.2 / r * 293.15).collect();
    image.attributes.point.push(DataArray::new("T", 1, Values::F32(temperature)));
    image.attributes.point.push(DataArray::new("p", 1, constant(101_325.0)));
    image.attributes.point.push(DataArray::new("Y", 1, constant(0.0)));
    // Smoke of 6 per metre, with a NaN and an invalid negative value.
    let mut soot = vec![6.0; values.len()];
    (soot[0], soot[1]) = (f32::NAN, -1.0);
    image.attributes.point.push(DataArray::new("soot", 1, Values::F32(soot)));
    image.attributes.point.push(DataArray::new("rho", 1, Values::F32(values)));
    write_vtk(path, &Dataset::ImageData(image), VtkOptions::default())
        .expect("the flow is written");
}
