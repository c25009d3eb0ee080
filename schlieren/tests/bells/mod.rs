//! A bell of Gaussian in a cube, on meshes of several kinds.
#![allow(dead_code, reason = "each test binary uses its part")]

use datasets::model::{
    Attributes, Cells, DataArray, Dataset, Points, RectilinearGrid, StructuredGrid,
    UnstructuredGrid, Values,
};
use glam::DVec3;
use rt_core::math::SplitMix64;
use schlieren::analytic::Gaussian;
use schlieren::input::{Medium, Options, Quantity};
use schlieren::march::Medium as _;

pub(crate) const BLOB: Gaussian = Gaussian { amplitude: 1e-5, sigma_m: 0.2 };

/// Positions of `n` points an axis over a cube of 1 m around the origin.
fn positions(n: usize, at: impl Fn(usize, f64) -> f64) -> Vec<[f64; 3]> {
    let step = 1.0 / (n - 1) as f64;
    let line = |i: usize, axis: usize| at(axis, i as f64 * step) - 0.5;
    (0..n * n * n).map(|i| [line(i % n, 0), line(i / n % n, 1), line(i / (n * n), 2)]).collect()
}

fn at_points(points: &[[f64; 3]]) -> Attributes {
    let eps = points.iter().map(|p| BLOB.sample(DVec3::from(*p)).0).collect();
    let array = DataArray { name: "eps".into(), components: 1, values: Values::F64(eps) };
    Attributes { point: vec![array], ..Attributes::default() }
}

pub(crate) fn hexahedra(n: usize) -> Dataset {
    let points = positions(n, |_, t| t);
    let mut cells = Cells::new();
    let id = |i: usize, j: usize, k: usize| (i + n * (j + n * k)) as u32;
    for k in 0..n - 1 {
        for j in 0..n - 1 {
            for i in 0..n - 1 {
                let layer =
                    |k| [id(i, j, k), id(i + 1, j, k), id(i + 1, j + 1, k), id(i, j + 1, k)];
                cells.push(layer(k).into_iter().chain(layer(k + 1)));
            }
        }
    }
    let (types, attributes) = (vec![12; cells.len()], at_points(&points));
    let points = Points::F64(points);
    let grid = UnstructuredGrid { points, cells, types, attributes, ..Default::default() };
    Dataset::UnstructuredGrid(grid)
}

/// A structured grid whose points crowd in the middle and, along y, at one side.
pub(crate) fn stretched(n: usize) -> Dataset {
    let points = positions(n, |axis, t| match axis {
        1 => t.powf(1.4),
        _ => t - 0.6 * (2.0 * std::f64::consts::PI * t).sin() / (2.0 * std::f64::consts::PI),
    });
    let last = n as i32 - 1;
    let (extent, attributes) = ([0, last, 0, last, 0, last], at_points(&points));
    Dataset::StructuredGrid(StructuredGrid { extent, points: Points::F64(points), attributes })
}

/// Tetrahedra around points that are moved at random by up to a third of their distance.
pub(crate) fn tetrahedra(n: usize) -> Dataset {
    let mut random = SplitMix64::new(5);
    let mut points = positions(n, |_, t| t);
    for p in &mut points {
        for x in p {
            // The faces stay plane.
            if x.abs() < 0.5 - 1e-9 {
                *x += random.between(-0.33, 0.33) / (n - 1) as f64;
            }
        }
    }
    let mut cells = Cells::new();
    let id = |at: [usize; 3]| (at[0] + n * (at[1] + n * at[2])) as u32;
    for cell in 0..(n - 1).pow(3) {
        let first = [cell % (n - 1), cell / (n - 1) % (n - 1), cell / (n - 1).pow(2)];
        // Paths along the axes from one corner to the opposite one.
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut at = first;
            let mut path = vec![id(at)];
            for axis in order {
                at[axis] += 1;
                path.push(id(at));
            }
            cells.push(path);
        }
    }
    let (types, attributes) = (vec![10; cells.len()], at_points(&points));
    let points = Points::F64(points);
    let grid = UnstructuredGrid { points, cells, types, attributes, ..Default::default() };
    Dataset::UnstructuredGrid(grid)
}

/// Averages over the cells of a grid that is slightly uneven, so that it is resampled.
pub(crate) fn cell_averages(n: usize) -> Dataset {
    averages(n, |t| t - 0.5 + 0.05 * (std::f64::consts::TAU * t).sin() / std::f64::consts::TAU)
}

/// Averages over cells of equal size, which are a lattice.
pub(crate) fn even_cell_averages(n: usize) -> Dataset {
    averages(n, |t| t - 0.5)
}

fn averages(n: usize, axis: impl Fn(f64) -> f64) -> Dataset {
    let line: Vec<f64> = (0..=n).map(|i| axis(i as f64 / n as f64)).collect();
    // The average of a bell is a product of differences of error functions.
    let mean = |i: usize| {
        let s = BLOB.sigma_m * std::f64::consts::SQRT_2;
        let [a, b] = [line[i] / s, line[i + 1] / s].map(schlieren::analytic::erf);
        (b - a) * s * std::f64::consts::PI.sqrt() / 2.0 / (line[i + 1] - line[i])
    };
    let means: Vec<f64> = (0..n).map(mean).collect();
    let of_cell = |c: usize| BLOB.amplitude * means[c % n] * means[c / n % n] * means[c / (n * n)];
    let eps = (0..n * n * n).map(of_cell).collect();
    let array = DataArray { name: "eps".into(), components: 1, values: Values::F64(eps) };
    let last = n as i32;
    Dataset::RectilinearGrid(RectilinearGrid {
        extent: [0, last, 0, last, 0, last],
        coordinates: [line.clone(), line.clone(), line],
        attributes: Attributes { cell: vec![array], ..Attributes::default() },
    })
}

pub(crate) fn options() -> Options {
    let eps = Quantity::array("eps");
    Options::new(Medium::NMinus1(eps))
}
