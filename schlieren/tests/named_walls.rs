//! Walls that a file names by blocks of their own, beside flows in a plane and in one layer of
//! cells, also where these slant to the axes.

mod outlines;

use datasets::model::{Attributes, Block, Cells, DataArray, Dataset, Points, PolyData, Values};
use glam::{DQuat, DVec3};
use outlines::{Plane, statuses};
use schlieren::input::{Depth, Medium, Options, cells_from_dataset, from_dataset};
use schlieren::path::Status::{Blocked, Free};

/// A box of 2 by 2 without its lower left quarter: nothing but a name tells whether that is a step
/// or an open border.
fn step() -> Plane {
    let above = Plane::default().with_block([16, 8], |u, v| [2.0 * u - 1.0, v]);
    above.with_block([8, 8], |u, v| [u, v - 1.0])
}

/// In the step, and in the gas beside and above it.
const PLACES: [[f64; 2]; 4] = [[-0.4, -0.4], [-0.7, -0.2], [0.4, -0.4], [-0.4, 0.4]];

fn turned(points: &Points, turn: DQuat) -> Points {
    let at = |i: usize| (turn * points.get(i)).to_array();
    Points::F64((0..points.len()).map(at).collect())
}

fn density(points: &Points) -> Attributes {
    let values = (0..points.len()).map(|i| 1.2 + 0.01 * points.get(i).x).collect();
    let point = vec![DataArray::new("rho", 1, Values::F64(values))];
    Attributes { point, ..Attributes::default() }
}

/// The parts of the step's surface: lines of a flow in a plane, or patches of one layer of cells
/// from z = -0.5 to 0.5, each in a plane of its own.
fn surfaces(is_layer: bool, turn: DQuat) -> Vec<Dataset> {
    let sides: [fn(f64) -> [f64; 2]; 2] = [|t| [t - 1.0, 0.0], |t| [0.0, t - 1.0]];
    let part = |side: fn(f64) -> [f64; 2]| {
        let layers: &[f64] = if is_layer { &[-0.5, 0.5] } else { &[0.0] };
        let at = |z: f64, i: usize| {
            let [x, y] = side(i as f64 / 8.0);
            [x, y, z]
        };
        let points = layers.iter().flat_map(|z| (0..9).map(move |i| at(*z, i))).collect();
        let points = Points::F64(points);
        let (mut lines, mut polys) = (Cells::new(), Cells::new());
        for i in 0..8 {
            match is_layer {
                true => polys.push([i, i + 1, i + 10, i + 9]),
                false => lines.push([i, i + 1]),
            }
        }
        let (attributes, points) = (density(&points), turned(&points, turn));
        Dataset::PolyData(PolyData { points, lines, polys, attributes, ..PolyData::default() })
    };
    sides.map(part).to_vec()
}

/// The flow, and the step's surface in blocks below one of this name.
fn blocks(is_layer: bool, turn: DQuat, name: &str) -> Dataset {
    let mut grid = match (is_layer, step().flat(None)) {
        (true, _) => step().thick(1, None),
        (false, Dataset::UnstructuredGrid(grid)) => grid,
        (false, other) => panic!("{}", other.kind()),
    };
    grid.points = turned(&grid.points, turn);
    let block = |name: &str, data| Block { name: name.into(), data };
    let parts = surfaces(is_layer, turn).into_iter().map(|part| block("part", part));
    Dataset::MultiBlock(vec![
        block("internal", Dataset::UnstructuredGrid(grid)),
        block(name, Dataset::MultiBlock(parts.collect())),
    ])
}

fn options(depth: f64) -> Options {
    Options { depth: Some(Depth::Span(depth)), ..Options::new(Medium::density("rho")) }
}

/// In the plane of x and y, and slanting: turned back by the least angle, the flow is where it was.
fn turns() -> [DQuat; 2] {
    let slanting = DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 25f64.to_radians());
    [DQuat::IDENTITY, slanting]
}

#[test]
fn named_walls_of_flows_in_a_plane_that_slants_are_bodies() {
    for turn in turns() {
        for is_layer in [false, true] {
            for (name, inside) in [("wall", Blocked), ("sheet", Free)] {
                let case = format!("`{name}`, layer: {is_layer}, turn {turn}");
                let data = blocks(is_layer, turn, name);
                let options = options(0.5);
                let (_, report) = cells_from_dataset(&data, &options).unwrap();
                let walls = report.outside.expect("a quarter is outside").walls_by;
                let named = "the surfaces `part`, `part`";
                let expected: &[&str] = if inside == Blocked { &[named] } else { &[] };
                assert_eq!(walls, expected, "{case}");
                let found = statuses(&data, &options, DVec3::Z, &PLACES);
                assert_eq!(found, [[inside, inside, Free, Free]; 2], "{case}");
            }
        }
    }
}

/// Patches of the border of a case one cell thick lie in planes, and are no flows in these.
#[test]
fn patches_of_a_layer_of_cells_get_no_depth_of_their_own() {
    for turn in turns() {
        let data = blocks(true, turn, "wall");
        let (_, report) = cells_from_dataset(&data, &options(0.5)).unwrap();
        let found = report.cells.unwrap();
        assert_eq!((found.cells, found.left_out), (16 * 8 + 8 * 8, 16), "{turn}");
        let field = from_dataset(&data, &options(0.5)).unwrap().field;
        assert!((field.size_m() - DVec3::new(2.0, 2.0, 0.5)).length() < 1e-9, "{turn}");
    }
    let two = Dataset::MultiBlock(vec![
        Block { name: "internal".into(), data: Dataset::UnstructuredGrid(step().thick(2, None)) },
        Block { name: "wall".into(), data: surfaces(true, DQuat::IDENTITY).swap_remove(0) },
    ]);
    let error = from_dataset(&two, &options(0.5)).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("the data has depth of its own"), "{error}");
}
