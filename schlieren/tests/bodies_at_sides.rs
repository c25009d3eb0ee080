//! Borders that reach the sides of the mesh's box: which are bodies, which are open, and what says
//! that nothing tells.

mod outlines;

use datasets::model::{Dataset, Points};
use glam::DVec3;
use outlines::{Plane, Velocity, in_lattice, options, statuses};
use schlieren::input::{Depth, Options, Outside, OutsideReport, cells_from_dataset, from_dataset};
use schlieren::path::Start;
use schlieren::path::Status::{self, Blocked, Free};
use schlieren::view::{Axis, View};

fn auto(data: &Dataset) -> Options {
    options(data, Outside::Auto)
}

/// The same flow in a plane with a span, one cell thick, and five cells thick.
fn all_kinds(plane: &Plane, velocity: Option<&Velocity<'_>>) -> [(&'static str, Dataset); 3] {
    let thick = |layers| Dataset::UnstructuredGrid(plane.thick(layers, velocity));
    [("plane", plane.flat(velocity)), ("one cell", thick(1)), ("five cells", thick(5))]
}

/// Light along the span meets `expected` at places, on cells and in a lattice.
fn check(name: &str, data: &Dataset, expected: &[([f64; 2], Status)]) {
    let places: Vec<[f64; 2]> = expected.iter().map(|e| e.0).collect();
    let expected: Vec<Status> = expected.iter().map(|e| e.1).collect();
    let found = statuses(data, &auto(data), DVec3::Z, &places);
    assert_eq!(found, [expected.clone(), expected], "{name}: on cells, in a lattice");
}

/// What the reports of cells and lattice say; both say the same.
fn reported(data: &Dataset) -> (OutsideReport, String) {
    let (_, of_cells) = cells_from_dataset(data, &auto(data)).unwrap();
    let of_lattice = from_dataset(data, &auto(data)).unwrap().report;
    let [a, b] = [&of_cells, &of_lattice].map(|r| r.outside.clone().expect("places outside"));
    assert_eq!((&a.walls_by, a.undecided_percent), (&b.walls_by, b.undecided_percent));
    (a, of_cells.warnings.join("\n"))
}

#[test]
fn half_a_cylinder_on_a_symmetry_plane_is_a_body() {
    for square in [true, false] {
        let plane = Plane::default().around_cylinder([0.0, 0.5], square);
        let expected = |body| {
            [
                ([0.0, 0.2], body),
                ([-0.3, 0.3], body),
                ([0.42, 0.03], body),
                ([0.0, 1.0], Free),
                ([-1.8, 0.1], Free),
                ([1.7, 1.75], Free),
            ]
        };
        for (name, data) in all_kinds(&plane, None) {
            check(name, &data, &expected(Blocked));
        }
        // Gas that comes out of it: a border that is open, however it looks.
        let out = |[x, y]: [f64; 2]| [x + 3.0, y];
        for (name, data) in all_kinds(&plane, Some(&out)) {
            check(name, &data, &expected(Free));
        }
    }
    let plane = Plane::default().around_cylinder([0.0, 0.5], true);
    let (report, _) = reported(&plane.flat(None));
    assert_eq!(report.walls_by, ["hollows of the mesh in one side of its box"]);
    assert_eq!(report.undecided_percent, 0.0);
}

#[test]
fn a_hole_through_the_span_is_a_body_whatever_names_it() {
    let plane = Plane::default().around_cylinder([0.0, 1.0], false);
    let expected = |body| [([0.0, 0.1], body), ([1.0, 0.2], Free), ([1.75, -1.7], Free)];
    let along = |[x, y]: [f64; 2]| {
        // Around a cylinder of radius 0.5.
        let r2 = x * x + y * y;
        [1.0 - 0.25 * (x * x - y * y) / (r2 * r2), -0.5 * x * y / (r2 * r2)]
    };
    let velocities: [Option<&Velocity<'_>>; 2] = [None, Some(&along)];
    for velocity in velocities {
        for (name, data) in all_kinds(&plane, velocity) {
            check(name, &data, &expected(Blocked));
        }
    }
    let across = |_: [f64; 2]| [1.0, 0.0];
    let data = Dataset::UnstructuredGrid(plane.thick(5, Some(&across)));
    check("gas crosses it", &data, &expected(Free));
    // A case whose patches are of no wall says so of holes through many cells, not of planes.
    check("no wall in the list", &plane.with_list(5, |_| false), &expected(Free));
    check("a plane's list", &plane.with_list(1, |_| false), &expected(Blocked));
}

/// A duct that a ramp narrows from the inlet on, below a border that slants down.
fn ramp() -> Plane {
    Plane::default().with_block([24, 20], |u, v| {
        let (below, above) = (0.4 * u, 1.5 - 0.2 * u);
        [u, below + (above - below) * v]
    })
}

#[test]
fn a_ramp_from_the_inlet_on_is_a_body_where_the_gas_follows_it() {
    let plane = ramp();
    let expected = |below| [([0.8, 0.1], below), ([0.5, 0.7], Free), ([0.9, 1.45], Free)];
    // Turned by the ramp, less and less above it.
    let turned = |[x, y]: [f64; 2]| [2.0, 0.8 * (1.0 - (y - 0.4 * x)).max(0.0)];
    for (name, data) in all_kinds(&plane, Some(&turned)) {
        check(name, &data, &expected(Blocked));
        let (report, _) = reported(&data);
        assert_eq!(report.walls_by, ["`U` following the border, as at a wall with slip"]);
    }
    // As it crosses the border above, it crosses that below.
    let straight = |_: [f64; 2]| [2.0, 0.0];
    for (name, data) in all_kinds(&plane, Some(&straight)) {
        check(name, &data, &expected(Free));
    }
}

#[test]
fn a_border_of_which_nothing_tells_is_named_with_the_options_that_settle_it() {
    let (report, warning) = reported(&ramp().flat(None));
    assert!(report.walls_by.is_empty() && report.undecided_percent == 100.0, "{report:?}");
    assert!(warning.contains("no wall is found"), "{warning}");
    // A half cylinder behind the ramp is known, and the ramp is not.
    let plane = ramp().with_block([4, 4], |u, v| [1.0 + 0.5 * u, 0.4 + 0.9 * v]).with_block(
        [16, 4],
        |u, v| {
            let (sin, cos) = (std::f64::consts::PI * u).sin_cos();
            let r = 0.25 + 0.35 * v;
            [3.0 - r * cos, r * sin]
        },
    );
    let (report, warning) = reported(&plane.flat(None));
    assert_eq!(report.walls_by, ["hollows of the mesh in one side of its box"]);
    assert!(report.undecided_percent > 20.0, "{report:?}");
    for word in ["Nothing tells", "--outside solid", "--solid"] {
        assert!(warning.contains(word), "{warning}");
    }
}

#[test]
fn a_step_in_a_tunnel_is_a_body_where_the_gas_goes_round_it() {
    let at = |x: f64, y: f64| [x, (20.0 * y).round() / 20.0];
    let plane = Plane::default()
        .with_block([10, 20], at)
        .with_block([16, 14], |u, v| at(1.0 + 2.0 * u, 0.3 + 0.7 * v));
    let velocity = |[x, y]: [f64; 2]| match (x <= 1.0, y < 0.3) {
        (true, true) => [1.0 - x, 0.5 * x],
        (true, false) => [1.0, 0.2 * x * (1.0 - y)],
        _ => [1.4, 0.0],
    };
    let expected = |below| [([2.0, 0.1], below), ([1.2, 0.25], below), ([0.5, 0.1], Free)];
    for (name, data) in all_kinds(&plane, Some(&velocity)) {
        check(name, &data, &expected(Blocked));
    }
    for (name, data) in all_kinds(&plane, None) {
        check(name, &data, &expected(Free));
    }
}

#[test]
fn straight_walls_in_the_sides_of_the_box_are_windows() {
    let plane = Plane::default().with_block([20, 12], |u, v| [2.0 * u, v]);
    let places = [[0.3, 0.4], [1.01, 0.53], [1.7, 0.02]];
    // All of the border is a wall, in line with the box or off it by rounding.
    for jitter in [0.0, 3e-6] {
        for layers in [1, 5] {
            let mut data = plane.with_list(layers, |_| true);
            let Dataset::UnstructuredGrid(grid) = &mut data else { unreachable!() };
            let Points::F64(points) = &mut grid.points else { unreachable!() };
            for (i, p) in points.iter_mut().enumerate() {
                let number = |k: usize| ((i * 7919 + k * 104_729) % 1000) as f64 / 1000.0 - 0.5;
                *p = [0, 1, 2].map(|a| p[a] + jitter * number(a));
            }
            for direction in [DVec3::Z, DVec3::Y, DVec3::X] {
                let found = statuses(&data, &auto(&data), direction, &places);
                assert_eq!(found, [[Free; 3]; 2], "{jitter} {layers} {direction}");
            }
        }
    }
    let tunnel = |_: [f64; 2]| [1.0, 0.0];
    for (name, data) in all_kinds(&plane, Some(&tunnel)) {
        let (_, report) = cells_from_dataset(&data, &auto(&data)).unwrap();
        assert!(report.outside.is_none(), "{name}: {report:?}");
    }
}

#[test]
fn the_nose_of_a_revolved_body_is_a_body_up_to_the_side_where_it_ends() {
    let plane = Plane::default().around_cylinder([0.25, 0.25], false);
    let data = plane.flat(None);
    let options = Options { depth: Some(Depth::Revolve), ..auto(&data) };
    let centre = DVec3::new(-1.0, 0.0, 0.0);
    let view = View::along(Axis::Z, centre);
    let start = |[x, y]: [f64; 2]| {
        let at = DVec3::new(x, y, 0.0) - centre;
        let position_m = [view.right, view.up].map(|axis| axis.dot(at) as f32);
        Start { position_m, tilt_rad: [0.0; 2] }
    };
    let starts = [[-0.1, 0.1], [-0.3, -0.2], [-0.9, 0.2], [-1.9, 1.9]].map(start);
    let found = in_lattice(&data, &options, view, &starts);
    assert_eq!(found, [Blocked, Blocked, Free, Free]);
}

/// A square of cells around a place.
fn square(plane: Plane, n: usize, [x, y]: [f64; 2], half: f64) -> Plane {
    plane.with_block([n, n], |u, v| [x + half * (2.0 * u - 1.0), y + half * (2.0 * v - 1.0)])
}

#[test]
fn a_piece_of_the_mesh_within_the_box_is_not_taken_for_a_hole() {
    let mut plane = Plane::default();
    for place in [[-2.0, -2.0], [0.0, 0.0], [2.0, 2.0]] {
        plane = square(plane, 6, place, 0.5);
    }
    let expected =
        [([0.0, 0.1], Free), ([0.9, 0.0], Free), ([-0.7, 0.7], Free), ([1.9, 2.1], Free)];
    for (name, data) in all_kinds(&plane, None) {
        check(name, &data, &expected);
        assert!(reported(&data).0.walls_by.is_empty(), "{name}");
    }
}

#[test]
fn a_hole_that_a_block_with_other_faces_fills_is_no_body() {
    // A disc of 24 sides in a hole of 64: slivers are left between them.
    let plane = Plane::default().around_cylinder([0.0, 1.0], true);
    let (count, tau) = (24usize, std::f64::consts::TAU);
    let plane = plane.with_block([count, 4], |u, v| {
        let angle = tau * ((u * count as f64).round() as usize % count) as f64 / count as f64;
        let r = 0.5 * (0.01 + 0.99 * v);
        [r * (angle + 0.03).cos(), r * (angle + 0.03).sin()]
    });
    // In the middle is a small hole of its own, which is a body.
    let mut expected = vec![([0.0, 0.001], Blocked)];
    for k in 0..40 {
        let angle = tau * f64::from(k) / 40.0;
        for r in [0.497, 0.499] {
            expected.push(([r * angle.cos(), r * angle.sin()], Free));
        }
    }
    let places: Vec<[f64; 2]> = expected.iter().map(|e| e.0).collect();
    for (name, data) in all_kinds(&plane, None) {
        let [cells, _] = statuses(&data, &auto(&data), DVec3::Z, &places);
        let wanted: Vec<Status> = expected.iter().map(|e| e.1).collect();
        assert_eq!(cells, wanted, "{name}");
    }
}
