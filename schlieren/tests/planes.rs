//! Two-dimensional flows that are not in a plane of two axes, and cases of OpenFOAM between wedges.

mod foam_case;

use datasets::model::{Attributes, DataArray, Dataset, Points};
use datasets::model::{StructuredGrid, UnstructuredGrid, Values};
use foam_case::{Case, HEXAHEDRON};
use glam::{DQuat, DVec3};
use schlieren::input::{Depth, Medium, Options, cells_from_dataset, contents, from_dataset, load};

/// Points along x and y of the plane.
const N: [usize; 2] = [33, 21];
/// Values in `f32` of a field, by the largest of them.
const ROUNDING: f64 = 1e-5;

fn density(x: f64, y: f64) -> f64 {
    1.2 + 0.3 * (-((x - 0.7).powi(2) + (y - 0.4).powi(2)) / 0.04).exp()
}

/// A plane 1.6 wide and 1 high, or with `thickness` one layer of cells, with the density at the
/// points, turned by `turn`.
fn lattice(thickness: Option<f64>, turn: DQuat) -> StructuredGrid {
    let per_layer = N[0] * N[1];
    let layers = if thickness.is_some() { 2 } else { 1 };
    let flat = |i: usize| [0.05 * (i % N[0]) as f64, 0.05 * (i % per_layer / N[0]) as f64];
    let at = |i: usize| {
        let [x, y] = flat(i);
        let z = thickness.map_or(0.0, |t| t * ((i / per_layer) as f64 - 0.5));
        (turn * DVec3::new(x, y, z)).to_array()
    };
    let of = |i: usize| density(flat(i)[0], flat(i)[1]);
    let count = layers * per_layer;
    StructuredGrid {
        extent: [0, N[0] as i32 - 1, 0, N[1] as i32 - 1, 0, layers as i32 - 1],
        points: Points::F64((0..count).map(at).collect()),
        attributes: Attributes {
            point: vec![DataArray::new("rho", 1, Values::F64((0..count).map(of).collect()))],
            ..Attributes::default()
        },
    }
}

/// The same as cells with explicit lists: quadrilaterals or hexahedra.
fn cells(thickness: Option<f64>, turn: DQuat) -> Dataset {
    let StructuredGrid { points, attributes, .. } = lattice(thickness, turn);
    let mut grid = UnstructuredGrid { points, attributes, ..UnstructuredGrid::default() };
    for j in 0..N[1] - 1 {
        for i in 0..N[0] - 1 {
            let quad = [0, 1, N[0] + 1, N[0]].map(|o| (i + N[0] * j + o) as u32);
            let above = quad.map(|k| k + (N[0] * N[1]) as u32);
            match thickness {
                None => grid.cells.push(quad),
                Some(_) => grid.cells.push(quad.into_iter().chain(above)),
            }
            grid.types.push(if thickness.is_some() { 12 } else { 9 });
        }
    }
    Dataset::UnstructuredGrid(grid)
}

fn options(depth: Depth) -> Options {
    Options { depth: Some(depth), ..Options::new(Medium::density("rho")) }
}

#[test]
fn planes_that_slant_and_layers_of_cells_are_the_flow_in_the_plane_of_two_axes() {
    let options = options(Depth::Span(0.3));
    let flat = from_dataset(&Dataset::StructuredGrid(lattice(None, DQuat::IDENTITY)), &options);
    let flat = flat.unwrap();
    let expected = flat.field.eps();
    let largest = expected.iter().fold(0.0f32, |m, e| m.max(e.abs()));
    // By 25 degrees about an axis in the plane: back by the least angle is as it was.
    let turns =
        [DQuat::IDENTITY, DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 25f64.to_radians())];
    for turn in turns {
        for thickness in [None, Some(0.01), Some(0.4)] {
            let slants = turn != DQuat::IDENTITY;
            let of_lattice = Dataset::StructuredGrid(lattice(thickness, turn));
            for data in [of_lattice, cells(thickness, turn)] {
                let case = format!("{}, {thickness:?}, slants: {slants}", data.kind());
                let made = from_dataset(&data, &options).unwrap();
                assert_eq!(made.field.dims(), flat.field.dims(), "{case}");
                assert!((made.field.size_m() - flat.field.size_m()).length() < 1e-9, "{case}");
                assert!((made.field.origin_m() - flat.field.origin_m()).length() < 1e-9, "{case}");
                let far = made.field.eps().iter().zip(expected).map(|(a, b)| (a - b).abs());
                let far = f64::from(far.fold(0.0, f32::max)) / f64::from(largest);
                assert!(far < ROUNDING, "{case}: {far}");
                let said = made.report.warnings.join("\n");
                assert_eq!(said.contains("slants to the axes: it is turned by 25.000"), slants);

                let (_, report) = cells_from_dataset(&data, &options).unwrap();
                assert!(report.cells.unwrap().filled > 0.999_999, "{case}: {report:?}");
                let said = report.warnings.join("\n");
                assert_eq!(said.contains("slants to the axes"), slants, "{said}");
            }
        }
    }
}

#[test]
fn two_layers_of_cells_have_depth_of_their_own() {
    let mut two = lattice(Some(0.1), DQuat::IDENTITY);
    let Points::F64(points) = &mut two.points else { unreachable!("they are f64") };
    let above: Vec<[f64; 3]> =
        points[N[0] * N[1]..].iter().map(|p| [p[0], p[1], p[2] + 0.1]).collect();
    points.extend(above);
    two.extent[5] = 2;
    let Values::F64(rho) = &mut two.attributes.point[0].values else { unreachable!("f64") };
    rho.extend_from_within(..N[0] * N[1]);
    let error = from_dataset(&Dataset::StructuredGrid(two), &options(Depth::Span(0.3)));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("the data has depth of its own: the farthest point is"), "{error}");
    assert!(error.contains("up to 1e-4 is none; leave the depth out"), "{error}");
}

/// A case of cells along x and the radius, from the axis on, between two patches of type `wedge`
/// 5 degrees apart.
fn between_wedges(n: [usize; 2], step: f64, density: impl Fn(f64, f64) -> f64) -> Case {
    let half = 2.5f64.to_radians();
    // Points on the axis are one.
    let id = |[i, j, k]: [usize; 3]| i + (n[0] + 1) * if j == 0 { 0 } else { 2 * j - k };
    let mut case = Case {
        points: vec![[0.0; 3]; (n[0] + 1) * (2 * n[1] + 1)],
        patches: vec![("open", "patch"), ("back", "wedge"), ("front", "wedge")],
        ..Case::default()
    };
    for (i, j) in (0..=n[0]).flat_map(|i| (0..=n[1]).map(move |j| (i, j))) {
        for k in [0, 1] {
            let (sin, cos) = (if k == 0 { -half } else { half }).sin_cos();
            let (x, r) = (step * i as f64, step * j as f64);
            case.points[id([i, j, k])] = [x, r * cos, r * sin];
        }
    }
    for (j, i) in (0..n[1]).flat_map(|j| (0..n[0]).map(move |i| (j, i))) {
        let patches = ["open", "open", "open", "open", "back", "front"];
        for (corners, patch) in HEXAHEDRON.iter().zip(patches) {
            let ids = corners.map(|o| id([i + o[0], j + o[1], o[2]])).to_vec();
            case.faces.push((ids, i + n[0] * j, patch));
        }
        case.rho.push(density(step * (i as f64 + 0.5), step * (j as f64 + 0.5)));
    }
    case
}

#[test]
fn a_case_between_wedges_is_revolved() {
    let folder = tempfile::tempdir().unwrap();
    let (n, step) = ([32, 20], 0.05);
    // Without curvature along x, and with little along the radius: averages are the values.
    let density = |x: f64, r: f64| 1.2 + 0.3 * x + 0.2 * r * r;
    between_wedges(n, step, density).write(folder.path());
    let found = contents(folder.path(), &Default::default()).unwrap();
    let guess = found.guess.unwrap();
    assert!(guess.options.contains(&("--revolve", String::new())), "{guess:?}");
    let made = load(folder.path(), &options(Depth::Revolve)).unwrap();
    let (size, origin) = (made.field.size_m(), made.field.origin_m());
    // To the outer points, which are at their radius and not at its cosine.
    let expected = DVec3::new(step * n[0] as f64, 2.0 * step * n[1] as f64, size.y);
    assert!((size - expected).length() < 0.05 * size.length(), "{size} {expected}");
    let [nx, ny, nz] = made.field.dims();
    let of = |at: [usize; 3]| {
        let p = origin + DVec3::from(made.field.spacing_m()) * DVec3::from(at.map(|i| i as f64));
        let eps = made.field.eps()[at[0] + nx * (at[1] + ny * at[2])];
        (f64::from(eps), density(p.x, p.y.hypot(p.z)))
    };
    // The same index at the same radius, above and beside the axis, with air's constant.
    let near = of([nx / 8, ny / 2, nz / 2]);
    for at in [
        [7 * nx / 8, ny / 2, nz / 2],
        [3 * nx / 7, 8 * ny / 10, nz / 2],
        [3 * nx / 7, ny / 2, 2 * nz / 10],
    ] {
        let (eps, rho) = of(at);
        let slope = (eps - near.0) / (rho - near.1);
        assert!((2.2e-4..2.32e-4).contains(&slope), "{at:?}: {slope}");
    }
}
