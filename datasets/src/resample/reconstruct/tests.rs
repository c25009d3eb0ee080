use super::super::{Lattice, Mark, Mesh, Options, Reconstruction, Resolution, Samples, resample};
use super::{PointField, Symmetry};
use crate::model::{
    Attributes, Block, Cells, Dataset, ImageData, Points, RectilinearGrid, StructuredGrid,
    UnstructuredGrid,
};
use glam::DVec3;

/// The points of a grid of `n` points an axis over the unit cube, moved by a wave that leaves the
/// faces plane.
fn waved(n: usize, height: f64) -> Vec<[f64; 3]> {
    let step = 1.0 / (n - 1) as f64;
    let wave = |x: f64| height * (std::f64::consts::PI * x).sin();
    let mut points = vec![];
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                let [x, y, z] = [i, j, k].map(|i| i as f64 * step);
                let moved = wave(x) * wave(y) * wave(z) / (height * height).max(1e-300);
                points.push([x + moved, y - 0.7 * moved, z + 0.5 * moved]);
            }
        }
    }
    points
}

fn structured(n: usize, points: Vec<[f64; 3]>) -> Dataset {
    let last = n as i32 - 1;
    Dataset::StructuredGrid(StructuredGrid {
        extent: [0, last, 0, last, 0, last],
        points: Points::F64(points),
        attributes: Attributes::default(),
    })
}

/// Six tetrahedra in each cell of a grid.
fn tetrahedra(n: usize, points: Vec<[f64; 3]>) -> Dataset {
    let mut cells = Cells::new();
    let id = |i: usize, j: usize, k: usize| (i + n * (j + n * k)) as u32;
    for k in 0..n - 1 {
        for j in 0..n - 1 {
            for i in 0..n - 1 {
                // Paths along the axes from one corner to the opposite one.
                for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                    let mut at = [i, j, k];
                    let mut path = vec![id(i, j, k)];
                    for axis in order {
                        at[axis] += 1;
                        path.push(id(at[0], at[1], at[2]));
                    }
                    cells.push(path);
                }
            }
        }
    }
    let types = vec![10; cells.len()];
    let points = Points::F64(points);
    Dataset::UnstructuredGrid(UnstructuredGrid { points, cells, types, ..Default::default() })
}

fn at_points(mesh: &Mesh, f: impl Fn(DVec3) -> f64) -> Vec<f64> {
    (0..mesh.num_points()).map(|i| f(mesh.point(i))).collect()
}

fn cube_lattice(n: usize) -> Lattice {
    Lattice::fit(DVec3::ZERO, DVec3::ONE, 1.0, Resolution::Longest(n)).unwrap()
}

fn cubic(p: DVec3) -> f64 {
    let (x, y, z) = (p.x - 0.4, p.y - 0.5, p.z - 0.3);
    1.0 + x - 2.0 * y + z * z + x * y - 1.5 * y * z + x * x * y + z * z * z - x * y * z
}

fn quadratic(p: DVec3) -> f64 {
    let (x, y, z) = (p.x - 0.4, p.y - 0.5, p.z - 0.3);
    1.0 + x - 2.0 * y + z * z + x * y - 1.5 * y * z + 0.5 * x * x
}

/// The largest error of the lattice's values at least `margin` from the faces of the cube. All
/// nodes must be inside.
fn worst(on: &super::super::ResampledField, margin: f64, f: impl Fn(DVec3) -> f64) -> f64 {
    let [nx, ny, _] = on.lattice.dims;
    let mut worst = 0.0f64;
    for (n, (&v, &m)) in on.values.iter().zip(&on.marks).enumerate() {
        assert_eq!(m, Mark::Inside);
        let p = on.lattice.node(n % nx, n / nx % ny, n / nx / ny);
        if (p - 0.5).abs().max_element() <= 0.5 - margin + 1e-9 {
            worst = worst.max((f64::from(v) - f(p)).abs());
        }
    }
    worst
}

#[test]
fn quadratic_fields_are_exact_on_distorted_meshes_and_cubic_ones_inside() {
    for (name, data) in [
        ("hexahedra", structured(11, waved(11, 0.04))),
        ("tetrahedra", tetrahedra(11, waved(11, 0.04))),
    ] {
        let mesh = Mesh::new(&data).unwrap();
        let on = |f: fn(DVec3) -> f64, reconstruction| {
            let values = at_points(&mesh, f);
            let options = Options { reconstruction, ..Default::default() };
            resample(&mesh, Samples::Points(&values), &cube_lattice(21), &options).unwrap()
        };
        // What is left is the rounding of polynomials and values to f32.
        let of = on(quadratic, Reconstruction::Cubic);
        let error = worst(&of, 0.0, quadratic);
        assert!(error < 2e-6, "{name}: {error}, {:?}", of.report.fit);
        assert_eq!(of.report.fit.fitted, mesh.num_points(), "{name}");
        assert!(of.report.fit.max_difference < 1e-5, "{name}: {:?}", of.report.fit);
        let of = on(cubic, Reconstruction::Cubic);
        let inside = worst(&of, 0.31, cubic);
        assert!(inside < 2e-6, "{name}: {inside}, {:?}", of.report.fit);
        // At the faces, too few points along the normal determine a third power.
        let [all, linear] =
            [&of, &on(cubic, Reconstruction::Linear)].map(|on| worst(on, 0.0, cubic));
        assert!(all < 0.2 * linear, "{name}: {all} {linear}");
    }
}

/// The largest error of central differences on the lattice, by the largest gradient.
fn gradient_error(on: &super::super::ResampledField, gradient: impl Fn(DVec3) -> DVec3) -> f64 {
    let Lattice { dims, spacing, .. } = on.lattice;
    let stride = [1, dims[0], dims[0] * dims[1]];
    let (mut worst, mut largest) = (0.0f64, 0.0f64);
    for k in 1..dims[2] - 1 {
        for j in 1..dims[1] - 1 {
            for i in 1..dims[0] - 1 {
                let at = i + dims[0] * (j + dims[1] * k);
                let true_one = gradient(on.lattice.node(i, j, k));
                largest = largest.max(true_one.length());
                for axis in 0..3 {
                    let [a, b] =
                        [at + stride[axis], at - stride[axis]].map(|n| f64::from(on.values[n]));
                    let got = (a - b) / (2.0 * spacing[axis]);
                    worst = worst.max((got - true_one[axis]).abs());
                }
            }
        }
    }
    worst / largest
}

fn bell(p: DVec3) -> f64 {
    (-0.5 * (p - 0.5).length_squared() / (SIGMA * SIGMA)).exp()
}
const SIGMA: f64 = 0.15;

fn bell_gradient(p: DVec3) -> DVec3 {
    -(p - 0.5) / (SIGMA * SIGMA) * bell(p)
}

#[test]
fn gradients_have_no_steps_at_the_faces_of_cells() {
    // A lattice four times as fine as the mesh, which shows the faces of linear elements.
    let lattice = cube_lattice(125);
    let error = |data: &Dataset, reconstruction| {
        let mesh = Mesh::new(data).unwrap();
        let values = at_points(&mesh, bell);
        let options = Options { reconstruction, ..Default::default() };
        let on = resample(&mesh, Samples::Points(&values), &lattice, &options).unwrap();
        gradient_error(&on, bell_gradient)
    };
    for (name, data) in [
        ("hexahedra", structured(32, waved(32, 0.0))),
        ("waved hexahedra", structured(32, waved(32, 0.03))),
        ("tetrahedra", tetrahedra(32, waved(32, 0.03))),
    ] {
        let [linear, cubic] = Reconstruction::ALL.map(|r| error(&data, r));
        assert!(linear > 0.05, "{name}: {linear}");
        // Central differences of the lattice itself have an error of 2e-3 of the largest gradient.
        assert!(cubic < 1e-2 && cubic < 0.1 * linear, "{name}: {cubic}");
    }
}

#[test]
fn an_oblique_shock_that_a_mesh_does_not_resolve_shows_no_cells() {
    // Cells eight times as long as high. The front passes three of them in the height of each in
    // the length, as bow shocks do far from their body.
    let axis = |n: usize| (0..=n).map(|i| i as f64 / n as f64).collect();
    let grid = RectilinearGrid {
        extent: [0, 10, 0, 80, 0, 4],
        coordinates: [axis(10), axis(80), axis(4)],
        attributes: Attributes::default(),
    };
    let mesh = Mesh::new(&Dataset::RectilinearGrid(grid)).unwrap();
    let values = at_points(&mesh, |p| ((p.y - 0.25 - 0.4 * p.x) / 0.02).tanh());
    let lattice = cube_lattice(81);
    let on = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    // Steps of the slope along the cells at their faces, by the largest slope.
    let (mut step, mut largest) = (0.0f32, 0.0f32);
    for j in 0..81 {
        let row = 81 * (j + 81 * 40);
        let slope = |i: usize| on.values[row + i + 1] - on.values[row + i];
        for i in (8..80).step_by(8) {
            step = step.max((slope(i) - slope(i - 1)).abs());
        }
        largest = (8..72).map(slope).fold(largest, |m, s| m.max(s.abs()));
    }
    assert!(step < 0.2 * largest, "{step} of {largest}");
}

#[test]
fn averages_over_stretched_cells_give_quadratic_fields_exactly_and_cubic_ones_inside() {
    // Cells from 0.02 to 0.2 wide.
    let axis =
        |power: f64| -> Vec<f64> { (0..12).map(|i| (f64::from(i) / 11.0).powf(power)).collect() };
    let coordinates = [axis(1.7), axis(1.0), axis(0.8)];
    let grid = RectilinearGrid {
        extent: [0, 11, 0, 11, 0, 11],
        coordinates: coordinates.clone(),
        attributes: Attributes::default(),
    };
    let mesh = Mesh::new(&Dataset::RectilinearGrid(grid)).unwrap();
    let average = |cell: usize, f: fn(DVec3) -> f64| {
        let at = [cell % 11, cell / 11 % 11, cell / 121];
        let side = |axis: usize, corner: usize| {
            let (a, b) = (coordinates[axis][at[axis]], coordinates[axis][at[axis] + 1]);
            let sign = if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            // Two Gauss points integrate cubics.
            0.5 * (a + b) + sign * 0.5 * (b - a) / 3f64.sqrt()
        };
        let gauss = |c: usize| f(DVec3::new(side(0, c), side(1, c), side(2, c)));
        (0..8).map(gauss).sum::<f64>() / 8.0
    };
    for (f, margin) in [(quadratic as fn(DVec3) -> f64, 0.0), (cubic, 0.36)] {
        let cells: Vec<f64> = (0..mesh.num_cells()).map(|cell| average(cell, f)).collect();
        let samples = Samples::Cells(&cells);
        let on = resample(&mesh, samples, &cube_lattice(31), &Options::default()).unwrap();
        let error = worst(&on, margin, f);
        assert!(error < 5e-6, "{error} {:?}", on.report.fit);
    }
}

#[test]
fn a_shock_stays_within_the_values_on_both_sides() {
    let shock = |p: DVec3| if p.x + 0.3 * p.y > 0.63 { 2.0 } else { 1.0 };
    for data in [structured(20, waved(20, 0.03)), tetrahedra(14, waved(14, 0.03))] {
        let mesh = Mesh::new(&data).unwrap();
        let values = at_points(&mesh, shock);
        let samples = Samples::Points(&values);
        let on = resample(&mesh, samples, &cube_lattice(61), &Options::default()).unwrap();
        let (low, high) = on
            .values
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(low > 0.97 && high < 2.03, "{low} {high}");
        assert!(on.report.fit.limited > 100, "{:?}", on.report.fit);
    }
}

#[test]
fn blocks_that_touch_are_one_mesh() {
    let grid = |from: f64, to: f64| {
        let axis = |a: f64, b: f64| (0..9).map(|i| a + (b - a) * f64::from(i) / 8.0).collect();
        Dataset::RectilinearGrid(RectilinearGrid {
            extent: [0, 8, 0, 8, 0, 8],
            coordinates: [axis(from, to), axis(0.0, 1.0), axis(0.0, 1.0)],
            attributes: Attributes::default(),
        })
    };
    let blocks = [grid(0.0, 0.5), grid(0.5, 1.0)].map(|data| Block { name: String::new(), data });
    let mesh = Mesh::new(&Dataset::MultiBlock(blocks.into())).unwrap();
    let wave = |p: DVec3| (5.0 * p.x).sin() + p.y * p.z;
    let values = at_points(&mesh, wave);
    let lattice = cube_lattice(65);
    let on = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    let slope = |i: usize| {
        let at = i + 65 * (32 + 65 * 32);
        f64::from(on.values[at + 1] - on.values[at]) * 64.0
    };
    // On both sides of the face between the blocks.
    let step = (slope(32) - slope(31)).abs();
    let curvature = 25.0 * (2.5f64).sin().abs() / 64.0;
    assert!(step < 1.2 * curvature, "{step}, by curvature {curvature}");
}

#[test]
fn few_points_and_flat_meshes_give_the_values_of_the_elements() {
    // A single tetrahedron: three neighbours determine a gradient, and nothing more.
    let mut cells = Cells::new();
    cells.push([0, 1, 2, 3]);
    let points = vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
    let data = Dataset::UnstructuredGrid(UnstructuredGrid {
        points: Points::F64(points),
        cells,
        types: vec![10],
        ..Default::default()
    });
    let mesh = Mesh::new(&data).unwrap();
    let linear = |p: DVec3| 1.0 + 2.0 * p.x - p.y + 0.5 * p.z;
    let values = at_points(&mesh, linear);
    let lattice = cube_lattice(9);
    let on = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    assert_eq!(on.report.fit.few_neighbours, 4);
    for (n, v) in on.values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let p = lattice.node(n % 9, n / 9 % 9, n / 81);
        assert!((f64::from(*v) - linear(p)).abs() < 1e-6, "{p}: {v}");
    }
}

/// What the factors add is nothing where it is not needed, and larger than the error where it is.
#[test]
fn truncation_is_nothing_for_quadratic_fields_and_above_the_error_of_a_bell() {
    let mesh = Mesh::new(&tetrahedra(13, waved(13, 0.02))).unwrap();
    let on = |f: fn(DVec3) -> f64, how| {
        let (values, lattice) = (at_points(&mesh, f), cube_lattice(25));
        let options = Options { reconstruction: how, ..Options::default() };
        resample(&mesh, Samples::Points(&values), &lattice, &options).unwrap()
    };
    let largest = |t: &[f32]| t.iter().fold(0.0f64, |m, t| m.max(f64::from(t.abs())));
    let smooth = on(quadratic, Reconstruction::Cubic);
    assert!(largest(&smooth.truncation) < 1e-5, "{}", largest(&smooth.truncation));
    let of_bell = on(bell, Reconstruction::Cubic);
    let error = worst(&of_bell, 0.0, bell);
    let truncation = largest(&of_bell.truncation);
    assert!(error < truncation && truncation < 20.0 * error, "{error} {truncation}");
    let step = |p: DVec3| f64::from(u8::from(p.x + 0.3 * p.y > 0.6));
    // Limited slopes add nothing to the elements at a sharp step, whose place is in doubt all the
    // same.
    let at_step = largest(&on(step, Reconstruction::Cubic).truncation);
    assert!(at_step > 0.05, "{at_step}");
    assert!(on(step, Reconstruction::Linear).truncation.is_empty());
}

/// A lattice of so many cells of size 1.
fn unit_cells(cells: [usize; 3]) -> Mesh {
    let dims = cells.map(|n| n as u32 + 1);
    Mesh::new(&Dataset::ImageData(ImageData::new(dims, DVec3::ZERO, DVec3::ONE))).unwrap()
}

/// Largest error of gradients along y of a Gaussian across a mesh of cells with its averages, by
/// the largest gradient.
fn error_of_a_bell(cells: [usize; 3], sigma: f64) -> f64 {
    let mesh = unit_cells(cells);
    let middle = 0.5 * cells[1] as f64 + 0.3;
    let bell = |y: f64| (-0.5 * ((y - middle) / sigma).powi(2)).exp();
    // Gauss's three points are exact to the fifth power.
    let average = |y: f64| {
        let d = 0.6f64.sqrt() / 2.0;
        (5.0 * bell(y - d) + 8.0 * bell(y) + 5.0 * bell(y + d)) / 18.0
    };
    let values: Vec<f64> = (0..mesh.num_cells()).map(|c| average(mesh.cell_centre(c).y)).collect();
    let points = mesh.cells_to_points(&values);
    let field = PointField::of_cells(&mesh, &values, &points, Symmetry::None);
    let [x, z] = [0.5 * cells[0] as f64 + 0.2, 0.5 * cells[2] as f64];
    let nx = cells[0] + 1;
    let mut worst = 0.0f64;
    let value = |y: f64| {
        // The trilinear shares of the cell around.
        let at = DVec3::new(x, y, z);
        let cell = at.floor().as_uvec3().to_array().map(|i| i as usize);
        let cell: [usize; 3] = std::array::from_fn(|a| cell[a].min(cells[a] - 1));
        let t = at - DVec3::from_array(cell.map(|i| i as f64));
        let (mut ids, mut weights) = (vec![], vec![]);
        for corner in 0..8usize {
            let o = [corner & 1, corner >> 1 & 1, corner >> 2];
            let of = |a: usize| if o[a] == 1 { t[a] } else { 1.0 - t[a] };
            let [i, j, k]: [usize; 3] = std::array::from_fn(|a| cell[a] + o[a]);
            ids.push((i + nx * (j + (cells[1] + 1) * k)) as u32);
            weights.push(of(0) * of(1) * of(2));
        }
        field.at(&mesh, &ids, &weights, at)[0]
    };
    let h = 1e-3;
    for n in 0..200 {
        let y = middle + (f64::from(n) / 100.0 - 1.0) * 3.0 * sigma;
        let exact = -(y - middle) / (sigma * sigma) * bell(y);
        worst = worst.max(((value(y + h) - value(y - h)) / (2.0 * h) - exact).abs());
    }
    worst / ((-0.5f64).exp() / sigma)
}

/// A polynomial over the forty nearest cells of one layer reaches over seven of them, and did not
/// fit a bell of six.
#[test]
fn one_layer_of_cells_resolves_what_many_layers_do() {
    for sigma in [2.5, 4.0] {
        let [layer, space] = [1, 12].map(|nz| error_of_a_bell([12, 40, nz], sigma));
        assert!(layer < 1.5 * space + 1e-3, "{sigma}: {layer:e}, in space {space:e}");
        assert!(space < 0.04, "{sigma}: {space:e}");
    }
    // One row of cells has one dimension.
    let row = error_of_a_bell([1, 40, 1], 2.5);
    assert!(row < 0.05, "{row:e}");
}
