//! Cubes of six cells a side without some of them.

use super::Walls;
use crate::model::{DataArray, Dataset, Points, UnstructuredGrid, Values};
use crate::resample::mesh::Mesh;

const N: usize = 6;

/// The cells for which `is_cell` is true; those for which `is_apart` is true have points of their
/// own, so that they share no face with others.
fn cells(is_cell: impl Fn([usize; 3]) -> bool, is_apart: impl Fn([usize; 3]) -> bool) -> Dataset {
    let count = (N + 1).pow(3);
    let place = |i: usize, apart: f64| {
        let at = [i % (N + 1), i / (N + 1) % (N + 1), i / (N + 1).pow(2)];
        at.map(|x| apart + x as f64 * (1.0 - apart / 3.0))
    };
    let points = (0..2 * count).map(|i| place(i % count, if i < count { 0.0 } else { 1e-4 }));
    let mut grid = UnstructuredGrid { points: Points::F64(points.collect()), ..Default::default() };
    for c in 0..N.pow(3) {
        let at = [c % N, c / N % N, c / N / N];
        if is_cell(at) {
            let first = at[0] + (N + 1) * (at[1] + (N + 1) * at[2]);
            let first = first + if is_apart(at) { count } else { 0 };
            grid.types.push(12);
            grid.cells.push([0, 1, 8, 7, 49, 50, 57, 56].map(|o| (first + o) as u32));
        }
    }
    Dataset::UnstructuredGrid(grid)
}

fn found(data: &Dataset) -> (Vec<String>, f64) {
    let walls = Walls::find(&Mesh::new(data).unwrap(), data, false);
    (walls.evidence().to_vec(), walls.undecided())
}

fn middle(i: usize) -> bool {
    (2..4).contains(&i)
}

#[test]
fn shapes_that_only_a_body_has_are_walls_along_any_axis() {
    let (hole, hollow) =
        ("holes that the mesh encloses", "hollows of the mesh in one side of its box");
    type Removed = fn([usize; 3]) -> bool;
    let shapes: [(&str, Removed, &[&str], f64); 7] = [
        ("a hole", |[i, j, k]| middle(i) && middle(j) && middle(k), &[hole], 0.0),
        ("a hole through the cube", |[i, j, _]| middle(i) && middle(j), &[hole], 0.0),
        ("a hollow", |[i, j, k]| middle(i) && j < 2 && middle(k), &[hollow], 0.0),
        ("a hollow above", |[i, j, k]| middle(i) && j > 3 && middle(k), &[hollow], 0.0),
        ("a groove", |[i, j, _]| middle(i) && j < 2, &[hollow], 0.0),
        ("a step", |[i, j, _]| i > 2 && j < 2, &[], 1.0),
        ("two pieces", |[i, _, _]| middle(i), &[], 1.0),
    ];
    for (name, removed, evidence, undecided) in shapes {
        for turn in 0..3 {
            let turned = |[i, j, k]: [usize; 3]| [[i, j, k], [k, i, j], [j, k, i]][turn];
            let data = cells(|at| !removed(turned(at)), |_| false);
            let (by, share) = found(&data);
            assert!(by == evidence && share == undecided, "{name} {turn}: {by:?} {share}");
        }
    }
}

#[test]
fn a_block_with_points_of_its_own_in_a_hole_is_no_body() {
    let inner = |[i, j, k]: [usize; 3]| middle(i) && middle(j) && middle(k);
    assert_eq!(found(&cells(|_| true, inner)), (vec![], 0.0));
    let at_side = |[i, j, k]: [usize; 3]| middle(i) && j < 2 && middle(k);
    assert_eq!(found(&cells(|_| true, at_side)), (vec![], 0.0));
    // A smaller one is within a body.
    let small = |at: [usize; 3]| at == [2, 2, 2];
    let shell = cells(|at| !inner(at) || small(at), small);
    assert_eq!(found(&shell).0, ["holes that the mesh encloses"]);
}

#[test]
fn the_velocity_in_cells_or_at_points_tells_a_wall_with_slip() {
    // Down a step of the lower side, and along it.
    let step = |[i, j, _]: [usize; 3]| i > 2 || j > 1;
    for (of_cells, apart) in [(false, false), (true, false), (false, true), (true, true)] {
        let with = |velocity: &dyn Fn(f64, f64) -> [f64; 3]| {
            let mut data = cells(step, |_| false);
            let Dataset::UnstructuredGrid(grid) = &mut data else { unreachable!() };
            let at = |i: u32| grid.points.get(i as usize);
            let values: Vec<f64> = if of_cells {
                let middle = |ids: &[u32]| {
                    ids.iter().fold([0.0; 2], |s, &i| [s[0] + at(i).x / 8.0, s[1] + at(i).y / 8.0])
                };
                let middles = grid.cells.iter().map(middle);
                middles.flat_map(|[x, y]| velocity(x, y)).collect()
            } else {
                (0..grid.points.len() as u32).flat_map(|i| velocity(at(i).x, at(i).y)).collect()
            };
            let attributes = &mut grid.attributes;
            let arrays = if of_cells { &mut attributes.cell } else { &mut attributes.point };
            if apart {
                // As files have them whose arrays are numbers.
                arrays.extend([(0, "VelocityX"), (1, "VelocityY"), (2, "VelocityZ")].map(
                    |(axis, name)| {
                        let of_axis = values.iter().skip(axis).step_by(3).copied().collect();
                        DataArray::new(name, 1, Values::F64(of_axis))
                    },
                ));
            } else {
                arrays.push(DataArray::new("Velocity (m/s)", 3, Values::F64(values)));
            }
            found(&data)
        };
        // Behind the step it turns, slowly, and is nowhere at rest.
        let round = |x: f64, y: f64| match x >= 3.0 && y <= 2.0 {
            true => [x - 3.0, 2.1 - y, 0.0],
            false => [5.0, 0.0, 0.0],
        };
        let (by, undecided) = with(&round);
        let name = match apart {
            true => "`VelocityX, VelocityY, VelocityZ` following",
            false => "`Velocity (m/s)` following",
        };
        assert!(by.len() == 1 && by[0].starts_with(name), "{by:?}");
        assert_eq!(undecided, 0.0);
        // Through the step's face, or hardly at all: an inlet, or gas at rest.
        assert_eq!(with(&|_, _| [3.0, 0.2, 0.0]), (vec![], 0.0));
        let jet = |_: f64, y: f64| if y > 4.0 { [9.0, 0.0, 0.0] } else { [1e-3, 0.0, 0.0] };
        assert_eq!(with(&jet), (vec![], 1.0));
    }
}
