//! Walls without thickness within a flow stop light that is traced through the cells.

mod foam_case;

use datasets::model::{DataArray, Dataset, Points, UnstructuredGrid, Values};
use foam_case::{Case, HEXAHEDRON};
use glam::DVec3;
use schlieren::gas_on_cells::GasOnCells;
use schlieren::input::{Medium, Options, cells_from_dataset, load, load_cells};
use schlieren::march::OnCells;
use schlieren::path::Status::{self, Blocked, Free};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start};
use schlieren::view::View;

/// Cells along each axis.
const N: [usize; 3] = [6, 4, 4];

/// A block of cubes of 0.1 m with a baffle in its middle, over the lower half of y. With `split`,
/// its two sides have points of their own.
fn block(split: bool, kind: &'static str) -> Case {
    let per_layer = (N[0] + 1) * (N[1] + 1);
    let count = per_layer * (N[2] + 1);
    let id = |[i, j, k]: [usize; 3]| i + (N[0] + 1) * j + per_layer * k;
    let at = |i: usize| {
        [i % (N[0] + 1), i / (N[0] + 1) % (N[1] + 1), i / per_layer].map(|x| 0.1 * x as f64)
    };
    // The points of the left side of the split baffle, but for its edge, come after all others.
    let on_left = |p: [usize; 3]| if split && p[0] == 3 && p[1] < 2 { count } else { 0 };
    let mut case = Case {
        points: (0..2 * count).map(|i| at(i % count)).collect(),
        patches: vec![("outer", "patch"), ("baffle_a", kind), ("baffle_b", kind)],
        ..Case::default()
    };
    for c in 0..N[0] * N[1] * N[2] {
        let cell = [c % N[0], c / N[0] % N[1], c / N[0] / N[1]];
        for (number, corners) in HEXAHEDRON.iter().enumerate() {
            let place = |o: &[usize; 3]| [0, 1, 2].map(|a| cell[a] + o[a]);
            let ids =
                corners.iter().map(place).map(|p| id(p) + if cell[0] < 3 { on_left(p) } else { 0 });
            let patch = match (number, cell) {
                (1, [2, 0 | 1, _]) => "baffle_a",
                (0, [3, 0 | 1, _]) => "baffle_b",
                _ => "outer",
            };
            case.faces.push((ids.collect(), c, patch));
        }
        case.rho.push(1.2 + 0.01 * cell[0] as f64);
    }
    case
}

/// What becomes of light through the upper and the lower half, along x, against it, and along z.
fn fates(gas: &GasOnCells) -> Vec<Status> {
    let mut found = Vec::new();
    for (direction, up) in [(DVec3::X, DVec3::Y), (-DVec3::X, DVec3::Y), (DVec3::Z, DVec3::Y)] {
        let view = View::new(direction, up, gas.centre_m()).unwrap();
        let starts = [0.08, -0.08].map(|y| Start { position_m: [0.03, y], tilt_rad: [0.0; 2] });
        let mut exits = vec![Exit::UNDISTURBED; starts.len()];
        OnCells::new(gas, view, PathQuantities::default(), 1).trace_parallel(&starts, &mut exits);
        found.extend(exits.iter().map(|e| e.status));
    }
    found
}

fn options() -> Options {
    Options::new(Medium::density("rho"))
}

/// The block as hexahedra with the density and the velocity at their points: at rest at the baffle.
fn hexahedra(case: &Case) -> Dataset {
    let mut grid = UnstructuredGrid::default();
    for faces in case.faces.chunks(6) {
        let (low, high) = (&faces[4].0, &faces[5].0);
        let low = [low[0], low[3], low[2], low[1]];
        grid.cells.push(low.iter().chain(high).map(|&i| i as u32));
        grid.types.push(12);
    }
    let rest = |p: &[f64; 3]| (p[0] - 0.3).abs() < 1e-9 && p[1] < 0.2 + 1e-9;
    let rho = case.points.iter().map(|p| 1.2 + 0.1 * p[0]).collect();
    let speed = |p: &[f64; 3]| [if rest(p) { 0.0 } else { 5.0 }, 0.0, 0.0];
    let velocity = case.points.iter().flat_map(speed).collect();
    grid.attributes.point.push(DataArray::new("rho", 1, Values::F64(rho)));
    grid.attributes.point.push(DataArray::new("U", 3, Values::F64(velocity)));
    grid.points = Points::F64(case.points.clone());
    Dataset::UnstructuredGrid(grid)
}

#[test]
fn a_wall_whose_points_are_twice_stops_light_where_gas_is_at_rest_on_both_its_sides() {
    let (gas, report) = cells_from_dataset(&hexahedra(&block(true, "wall")), &options()).unwrap();
    assert_eq!(fates(&gas), [Free, Blocked, Free, Blocked, Free, Free]);
    let said = report.warnings.join("\n");
    assert!(said.contains("8 faces between cells are walls without thickness"), "{said}");
    // Cells that share their points are neighbours, as where a channel is one cell wide.
    let (gas, report) = cells_from_dataset(&hexahedra(&block(false, "wall")), &options()).unwrap();
    assert_eq!(fates(&gas), [Free; 6], "{:?}", report.warnings);
}

#[test]
fn a_baffle_stops_light_that_crosses_it_on_cells_and_is_counted() {
    let on_cells =
        |folder: &tempfile::TempDir| fates(&load_cells(folder.path(), &options()).unwrap().0);
    for split in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        block(split, "wall").write(folder.path());
        let expected = [Free, Blocked, Free, Blocked, Free, Free];
        assert_eq!(on_cells(&folder), expected, "split: {split}");
        // A lattice has none: the warning says how many, and of which patches.
        let loaded = load(folder.path(), &options()).unwrap();
        let said = loaded.report.warnings.join("\n");
        assert!(said.contains("8 faces of the patches `baffle_a`, `baffle_b`"), "{said}");

        // What gas passes, as a fan, is none.
        let folder = tempfile::tempdir().unwrap();
        block(split, "cyclic").write(folder.path());
        assert_eq!(on_cells(&folder), [Free; 6], "split: {split}");
    }
}
