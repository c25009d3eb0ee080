//! Bodies in meshes of flows: light is stopped by them in a lattice and on cells alike, also where
//! it meets none of their walls.

mod outlines;

use datasets::model::{Block, DataArray, Dataset, Points, PolyData, UnstructuredGrid, Values};
use glam::DVec3;
use outlines::{Plane, hide, options, statuses};
use schlieren::input::{Medium, Options, Outside, Role, cells_from_dataset, from_dataset};
use schlieren::path::Status::{Blocked, Free, Masked};

/// Places in the cylinder, in the gas, in a corner of the box, and beside the box.
const PLACES: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [0.2, -0.31],
    [0.44, 0.0],
    [0.6, 0.0],
    [-0.9, 1.1],
    [1.5, 0.7],
    [1.7, 1.75],
    [2.5, 0.0],
];

#[test]
fn a_body_through_the_whole_span_is_black_on_cells_as_in_a_lattice() {
    let is_wall = |[x, y]: [f64; 2]| x.hypot(y) < 0.6;
    // Straight along the span, and so that light runs past the walls of the cylinder's middle.
    for direction in [DVec3::Z, DVec3::new(0.05, -0.03, 1.0)] {
        for square in [true, false] {
            let plane = Plane::default().around_cylinder([0.0, 1.0], square);
            for (name, data) in [
                ("a plane with a span", plane.flat(None)),
                ("one cell thick, with a list of walls", plane.with_list(1, is_wall)),
                ("six cells thick, with a list of walls", plane.with_list(6, is_wall)),
            ] {
                let of = |outside| statuses(&data, &options(&data, outside), direction, &PLACES);
                let expected = [Blocked, Blocked, Blocked, Free, Free, Free, Free, Free];
                assert_eq!(of(Outside::Auto), [expected; 2], "{name}, {direction} {square}");
                // The option is above what the walls say.
                assert_eq!(of(Outside::Gas), [[Free; 8]; 2], "{name}, {direction} {square}");
            }
        }
    }
}

#[test]
fn hidden_cells_through_the_whole_span_are_black_on_cells_as_in_a_lattice() {
    let square = |u: f64, v: f64| [4.0 * u - 2.0, 4.0 * v - 2.0];
    let plane = Plane::default().with_block([40, 40], square);
    for layers in [1, 5] {
        let mut grid = plane.thick(layers, None);
        hide(&mut grid, |[x, y]| x.hypot(y) < 0.6);
        let data = Dataset::UnstructuredGrid(grid);
        let found = statuses(&data, &options(&data, Outside::Auto), DVec3::Z, &PLACES);
        let expected = [Blocked, Blocked, Blocked, Free, Free, Free, Free, Free];
        // In a lattice, nodes of the gas beside hidden ones are hidden as well.
        assert_eq!(found[0][..3], expected[..3], "{layers}");
        assert_eq!(found[0][4..], expected[4..], "{layers}");
        assert_eq!(found[1][..3], expected[..3], "{layers}");
        assert_eq!(found[1][4..], expected[4..], "{layers}");
    }
}

/// Hidden cells are gas and places without cells are blank, in whatever order light meets them.
#[test]
fn hidden_gas_and_blank_places_outside_are_told_apart_on_cells_as_in_a_lattice() {
    let square = |u: f64, v: f64| [4.0 * u - 2.0, 4.0 * v - 2.0];
    let whole = Plane::default().with_block([40, 40], square);
    let ring = Plane::default().around_cylinder([0.0, 1.0], true);
    let through = |plane: &Plane, hidden_to: f64, roles, direction, places: &[[f64; 2]]| {
        let mut grid = plane.thick(4, None);
        hide(&mut grid, |[x, y]| x.hypot(y) < hidden_to);
        let data = Dataset::UnstructuredGrid(grid);
        let (outside, hidden) = roles;
        let options = Options { hidden, ..options(&data, outside) };
        statuses(&data, &options, direction, places)
    };
    let gas = (Outside::Blank, Role::Gas);
    // No place is outside: the hidden cells reach the sides of the box.
    assert_eq!(through(&whole, 0.6, gas, DVec3::Z, &PLACES), [[Free; 8]; 2]);
    // Hidden cells lie around a hole. Light along the span meets no gas with values there.
    let along_span = [[0.0, 0.0], [0.3, 0.1], [0.65, 0.0], [0.0, -0.7], [1.2, 0.4]];
    let expected = [Masked, Masked, Free, Free, Free];
    assert_eq!(through(&ring, 0.8, gas, DVec3::Z, &along_span), [expected; 2]);
    // Light along x goes through hidden cells, the hole and hidden cells again, or beside the hole.
    let across = [[0.0, 0.05], [0.0, 0.3], [0.0, 0.65], [0.0, 1.5]];
    let expected = [Masked, Masked, Free, Free];
    assert_eq!(through(&ring, 0.8, gas, DVec3::X, &across), [expected; 2]);
    // A body is met before what is blank, on either side.
    let solid = (Outside::Solid, Role::Blank);
    let expected = [Blocked, Blocked, Masked, Free];
    assert_eq!(through(&ring, 0.8, solid, DVec3::X, &across)[0], expected);
}

#[test]
fn a_choice_for_hidden_cells_of_a_mesh_without_any_is_named() {
    let square = |u: f64, v: f64| [4.0 * u - 2.0, 4.0 * v - 2.0];
    let mut grid = Plane::default().with_block([8, 8], square).thick(4, None);
    for with_hidden in [false, true] {
        if with_hidden {
            hide(&mut grid, |[x, y]| x.hypot(y) < 0.6);
        }
        let data = Dataset::UnstructuredGrid(grid.clone());
        let options = Options { hidden: Role::Gas, ..options(&data, Outside::Blank) };
        let [cells, lattice] = [
            cells_from_dataset(&data, &options).unwrap().1.warnings,
            from_dataset(&data, &options).unwrap().report.warnings,
        ];
        for warnings in [cells, lattice] {
            let named = warnings.iter().any(|w| w.contains("flow.hidden has no effect"));
            assert_eq!(named, !with_hidden, "{warnings:?}");
        }
    }
}

#[test]
fn pictures_of_a_body_through_the_span_agree_beyond_the_nodes_at_its_outline() {
    let is_wall = |[x, y]: [f64; 2]| x.hypot(y) < 0.6;
    let data = Plane::default().around_cylinder([0.0, 1.0], false).with_list(1, is_wall);
    let n = 60;
    let at = |i: usize| 4.2 * ((i as f64 + 0.43) / n as f64 - 0.5);
    let places: Vec<[f64; 2]> = (0..n * n).map(|i| [at(i % n), at(i / n)]).collect();
    let [cells, lattice] = statuses(&data, &options(&data, Outside::Auto), DVec3::Z, &places);
    let (mut black, mut seen) = (0, 0);
    for ((place, cells), lattice) in places.iter().zip(&cells).zip(&lattice) {
        let r = place[0].hypot(place[1]);
        // Two nodes of 0.05 each way.
        if (r - 0.5).abs() < 0.1 {
            continue;
        }
        let expected = if r < 0.5 { Blocked } else { Free };
        assert_eq!((cells, lattice), (&expected, &expected), "{place:?}");
        seen += 1;
        black += usize::from(r < 0.5);
    }
    assert!(black > 80 && seen > 3000, "{black} of {seen}");
}

#[test]
fn a_grid_whose_seam_is_open_by_rounding_has_its_body() {
    for single in [false, true] {
        // sin 2π is not 0, and in single precision the ends are farther apart.
        let plane = Plane::default().with_block([64, 12], |u, v| {
            let (sin, cos) = (std::f64::consts::TAU * u).sin_cos();
            let (sin32, cos32) = (std::f32::consts::TAU * u as f32).sin_cos();
            let r = 0.5 + 1.5 * v;
            if single { [r * f64::from(cos32), r * f64::from(sin32)] } else { [r * cos, r * sin] }
        });
        assert_eq!(plane.points.len(), 65 * 13, "the points of the seam are there twice");
        let data = plane.flat(None);
        let mut places = PLACES.to_vec();
        places.extend([[0.9, 0.0], [1.4, 1e-9], [0.7, -1e-9]]);
        let mut expected = vec![Free; places.len()];
        expected[..3].fill(Blocked);
        let of = |outside| statuses(&data, &options(&data, outside), DVec3::Z, &places);
        assert_eq!(of(Outside::Auto), [expected.clone(), expected], "single: {single}");
    }
}

/// Surfaces are found by their places, so the unit of length must not come between.
#[test]
fn surfaces_with_the_name_of_a_body_are_walls_in_any_unit_of_length() {
    // A cube of 6 x 6 x 6 cells without a step below, which nothing else tells from an open border.
    const N: usize = 6;
    let place = |i: usize| [i % (N + 1), i / (N + 1) % (N + 1), i / (N + 1).pow(2)];
    let points = (0..(N + 1).pow(3)).map(|i| place(i).map(|x| 0.1 + 0.3 * x as f64));
    let mut grid = UnstructuredGrid { points: Points::F64(points.collect()), ..Default::default() };
    for c in 0..N.pow(3) {
        let at = [c % N, c / N % N, c / N / N];
        if at[0] > 2 || at[1] > 1 {
            let first = at[0] + (N + 1) * (at[1] + (N + 1) * at[2]);
            grid.types.push(12);
            grid.cells.push([0, 1, 8, 7, 49, 50, 57, 56].map(|o| (first + o) as u32));
        }
    }
    let density = (0..(N + 1).pow(3)).map(|i| 1.2 + 0.01 * place(i)[0] as f64).collect();
    grid.attributes.point.push(DataArray::new("density", 1, Values::F64(density)));
    let of_step = (0..(N + 1).pow(3)).filter(|&i| {
        let [x, y, _] = place(i);
        (x == 3 && y <= 2) || (y == 2 && x <= 3)
    });
    let of_step = of_step.map(|i| grid.points.get(i).to_array()).collect();
    let wall = PolyData { points: Points::F64(of_step), ..Default::default() };
    let block = |name: &str, data| Block { name: name.into(), data };
    let data = Dataset::MultiBlock(vec![
        block("internal", Dataset::UnstructuredGrid(grid)),
        block("wall", Dataset::PolyData(wall)),
    ]);
    for length_unit_m in [1.0, 1e-3, 0.0254] {
        let options = Options { length_unit_m, ..Options::new(Medium::density("density")) };
        let (_, report) = cells_from_dataset(&data, &options).unwrap();
        let walls = report.outside.expect("the step is outside").walls_by;
        assert_eq!(walls, ["the surfaces `wall`"], "{length_unit_m}");
    }
}
