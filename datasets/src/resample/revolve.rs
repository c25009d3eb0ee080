//! Axisymmetric data: revolves a plane of axial position (x) and radius (y) about the x axis.
//!
//! The plane is first resampled to an image four times as fine as the lattice. Each node of the
//! lattice then reads the image at its radius, by cubic polynomials: linear ones would give the
//! gradient steps at the samples of the image.

use super::mesh::Mesh;
use super::reconstruct::Symmetry;
use super::report::{self, Report};
use super::{Lattice, Mark, Options, ResampleError, ResampledField, Samples, resample_with};
use glam::DVec3;
use rayon::prelude::*;

/// Image samples per node of the lattice, along each axis.
const IMAGE_REFINEMENT: f64 = 4.0;
/// An inner radius below this fraction of the outer one is not a body but the first row of cells
/// next to the axis. The values there are extended to the axis, where their slope is zero by
/// symmetry.
const AXIS_GAP: f64 = 0.1;

/// Box of the body of revolution of a mesh whose points lie in the plane z = 0, apart from a thin
/// extrusion.
pub fn revolved_bounds(mesh: &Mesh) -> Result<(DVec3, DVec3), ResampleError> {
    let (low, high) = mesh.bounds();
    if !(low.y >= -1e-6 * high.y && high.y > 0.0) {
        return Err(ResampleError::Option {
            option: "smallest radius (y)",
            value: low.y,
            cure: "data to revolve needs the axis along x and radii from 0 on along y",
        });
    }
    Ok((DVec3::new(low.x, -high.y, -high.y), DVec3::new(high.x, high.y, high.y)))
}

/// As [`super::resample()`], for a mesh made by [`Mesh::with_plane`] with a span that is
/// small compared with the lattice's spacing.
pub fn revolve(
    mesh: &Mesh,
    samples: Samples<'_>,
    lattice: &Lattice,
    options: &Options,
) -> Result<ResampledField, ResampleError> {
    revolved_bounds(mesh)?;
    let (low, high) = mesh.bounds();

    // The image: x and radius, slightly inside the plane's thickness.
    let h = lattice.spacing / IMAGE_REFINEMENT;
    let nodes = |a: usize| ((high[a] - low[a]) / h[a]).ceil().clamp(1.0, 1e5) as usize + 1;
    let dims = [nodes(0), nodes(1), 2];
    let steps = DVec3::new((dims[0] - 1) as f64, (dims[1] - 1) as f64, 1.0);
    let mut spacing = (high - low) / steps;
    spacing.z *= 0.5;
    let image =
        Lattice { dims, origin: DVec3::new(low.x, low.y, low.z + 0.5 * spacing.z), spacing };
    // Gas on the other side of a body is no neighbour.
    let reaches_axis = low.y <= AXIS_GAP * high.y;
    let symmetry = if reaches_axis { Symmetry::Axis } else { Symmetry::Rings };
    let flat = resample_with(mesh, samples, &image, options, symmetry)?;

    // Each node reads the image at its radius.
    let r_low = if reaches_axis { low.y } else { 0.0 };
    let per_layer = lattice.dims[0] * lattice.dims[1];
    let mut values = vec![f32::NAN; lattice.len()];
    let mut marks = vec![Mark::Outside; lattice.len()];
    let at = |n: usize| {
        let p =
            lattice.node(n % lattice.dims[0], n / lattice.dims[0] % lattice.dims[1], n / per_layer);
        (p.x, p.y.hypot(p.z).max(r_low))
    };
    values.par_iter_mut().zip(&mut marks).enumerate().for_each(|(n, (value, mark))| {
        let (x, r) = at(n);
        (*value, *mark) = sample_image(&flat, x, r);
    });
    let mut truncation = vec![];
    if !flat.truncation.is_empty() {
        truncation.resize(lattice.len(), 0.0);
        truncation.par_iter_mut().enumerate().for_each(|(n, t)| {
            let (x, r) = at(n);
            *t = truncation_at(&flat, x, r);
        });
    }
    let resampling_error = report::resampling_error(mesh, samples, lattice, &values);
    let of = |m: Mark| marks.iter().filter(|x| **x == m).count();
    let report = Report {
        inside: of(Mark::Inside),
        outside: of(Mark::Outside),
        hidden: of(Mark::Hidden),
        not_finite: of(Mark::NotFinite),
        resampling_error,
        ..flat.report
    };
    Ok(ResampledField { lattice: *lattice, values, truncation, marks, report })
}

/// The polynomial through the four by four samples around sample position (u, v), within their
/// values; `None` when one of them has none.
fn cubic(flat: &ResampledField, u: f64, v: f64) -> Option<f64> {
    let dims = flat.lattice.dims;
    let [(i, x), (j, y)] = [(u, dims[0]), (v, dims[1])].map(|(u, n)| {
        // At a border, the first or last four samples.
        let first = (u.floor() - 1.0).clamp(0.0, n.saturating_sub(4) as f64);
        (first as usize, lagrange(u - first - 1.0))
    });
    if dims[0] < 4 || dims[1] < 4 {
        return None;
    }
    let (mut sum, mut low, mut high) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
    for (row, wy) in y.into_iter().enumerate() {
        for (column, wx) in x.into_iter().enumerate() {
            let at = i + column + dims[0] * (j + row);
            let value = f64::from(flat.values[at]);
            if flat.marks[at] != Mark::Inside {
                return None;
            }
            sum += wx * wy * value;
            (low, high) = (low.min(value), high.max(value));
        }
    }
    Some(sum.clamp(low, high))
}

/// Weights at `t` of values at -1, 0, 1 and 2.
fn lagrange(t: f64) -> [f64; 4] {
    let [a, b, c, d] = [t + 1.0, t, t - 1.0, t - 2.0];
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// The truncation at the nearest sample of the image; zero beside it.
fn truncation_at(flat: &ResampledField, x: f64, r: f64) -> f32 {
    let Lattice { dims, origin, spacing } = &flat.lattice;
    let (u, v) = ((x - origin.x) / spacing.x, (r - origin.y) / spacing.y);
    let nearest = |u: f64, n: usize| u.round().clamp(0.0, (n - 1) as f64) as usize;
    flat.truncation[nearest(u, dims[0]) + dims[0] * nearest(v, dims[1])]
}

/// Cubic interpolation in the image if the samples around have values, bilinear if only four have;
/// otherwise the mark of the nearest sample.
fn sample_image(flat: &ResampledField, x: f64, r: f64) -> (f32, Mark) {
    let Lattice { dims, origin, spacing } = &flat.lattice;
    let (u, v) = ((x - origin.x) / spacing.x, (r - origin.y) / spacing.y);
    let last = [dims[0] - 1, dims[1] - 1].map(|d| d as f64);
    if !(u >= -1e-6 && v >= -1e-6 && u <= last[0] + 1e-6 && v <= last[1] + 1e-6) {
        return (f32::NAN, Mark::Outside);
    }
    let (i, j) = (u.floor().clamp(0.0, last[0] - 1.0), v.floor().clamp(0.0, last[1] - 1.0));
    let (s, t) = ((u - i).clamp(0.0, 1.0), (v - j).clamp(0.0, 1.0));
    let first = i as usize + dims[0] * j as usize;
    let corners = [
        (first, (1.0 - s) * (1.0 - t)),
        (first + 1, s * (1.0 - t)),
        (first + dims[0], (1.0 - s) * t),
        (first + dims[0] + 1, s * t),
    ];
    let mut sum = 0.0;
    let mut heaviest = (0.0, Mark::Outside);
    let mut complete = true;
    for (at, weight) in corners {
        if weight > heaviest.0 {
            heaviest = (weight, flat.marks[at]);
        }
        if weight > 0.0 {
            complete &= flat.marks[at] == Mark::Inside;
            sum += weight * f64::from(flat.values[at]);
        }
    }
    if complete {
        let value = cubic(flat, u, v).unwrap_or(sum);
        return (value as f32, Mark::Inside);
    }
    // At a border, the nearest sample with a value represents a node within half a sample of it.
    match heaviest.1 {
        Mark::Inside => {
            let at =
                corners.iter().fold(corners[0], |best, c| if c.1 > best.1 { *c } else { best }).0;
            (flat.values[at], Mark::Inside)
        }
        other => (f32::NAN, other),
    }
}
