//! Tables of points in no order, from the file to deflections: a bell of Gaussian, and the body in
//! a plane.

mod bells;
mod common;

use bells::{BLOB, options, tetrahedra};
use common::grid;
use datasets::model::{Dataset, UnstructuredGrid};
use glam::{DQuat, DVec3};
use rt_core::math::SplitMix64;
use schlieren::input::{Depth, Medium, Options, Reference, contents, load, load_cells};
use schlieren::march::{Medium as _, OnCells};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start};
use schlieren::plan::{Plan, Request};
use schlieren::view::{Axis, View};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A table of these points with the bell's values, in an order by chance.
fn table(folder: &tempfile::TempDir, mut points: Vec<DVec3>) -> PathBuf {
    let mut random = SplitMix64::new(9);
    for i in (1..points.len()).rev() {
        points.swap(i, random.between(0.0, i as f64) as usize);
    }
    let mut text = String::from("X (m),Y (m),Z (m),eps\n");
    for p in points {
        writeln!(text, "{:?},{:?},{:?},{:?}", p.x, p.y, p.z, BLOB.sample(p).0).unwrap();
    }
    let path = folder.path().join("bell.csv");
    std::fs::write(&path, text).unwrap();
    path
}

/// The points of a lattice of 31 a side, moved by up to a third of their distance, the faces of the
/// cube apart.
fn moved() -> Vec<DVec3> {
    let Dataset::UnstructuredGrid(UnstructuredGrid { points, .. }) = tetrahedra(31) else {
        panic!("tetrahedra are an unstructured grid");
    };
    (0..points.len()).map(|i| points.get(i)).collect()
}

/// As many points by chance, and those on the faces.
fn by_chance() -> Vec<DVec3> {
    let mut random = SplitMix64::new(3);
    let on_face = |p: &DVec3| p.abs().max_element() > 0.499;
    let mut points: Vec<DVec3> = moved().into_iter().filter(on_face).collect();
    while points.len() < 30_000 {
        points.push(DVec3::from([(); 3].map(|()| random.between(-0.5, 0.5))));
    }
    points
}

/// Largest error by the largest deflection.
fn error(starts: &[Start], exits: &[Exit], view: View) -> f64 {
    let (mut worst, mut largest) = (0.0f64, 0.0f64);
    for (start, exit) in starts.iter().zip(exits) {
        let [x, y] = start.position_m.map(f64::from);
        let at = view.right * x + view.up * y;
        let truth = BLOB.deflection_rad(at.x, at.y, 0.5);
        let truth = DVec3::new(truth[0], truth[1], 0.0);
        let truth = [truth.dot(view.right), truth.dot(view.up)];
        let error: [f64; 2] = [0, 1].map(|c| f64::from(exit.deflection_rad[c]) - truth[c]);
        worst = worst.max(error[0].hypot(error[1]));
        largest = largest.max(truth[0].hypot(truth[1]));
    }
    worst / largest
}

#[test]
fn a_bell_at_scattered_points_gives_its_deflections() {
    let folder = tempfile::tempdir().unwrap();
    for (name, points, bounds) in
        [("moved lattice", moved(), [5e-4, 1e-3]), ("by chance", by_chance(), [1e-3, 2e-3])]
    {
        let path = table(&folder, points);
        let starts = grid(160, 0.96);
        let mut exits = vec![Exit::UNDISTURBED; starts.len()];

        let view = View::new(DVec3::Z, DVec3::Y, DVec3::ZERO).unwrap();
        let field = load(&path, &options()).unwrap().field;
        let request = Request { direction: Some(DVec3::Z), ..Request::default() };
        Plan::new(&field, request).paths(&field, view).trace_parallel(&starts, &mut exits);
        let on_lattice = error(&starts, &exits, view);

        let view = View::along(Axis::Z, DVec3::ZERO);
        let options = Options { reference: Reference::Given { n_minus_1: 0.0 }, ..options() };
        let gas = load_cells(&path, &options).unwrap().0;
        let quantities = PathQuantities { opd: true };
        OnCells::new(&gas, view, quantities, 1).trace_parallel(&starts, &mut exits);
        let on_cells = error(&starts, &exits, view);

        println!("{name}: lattice {on_lattice:.2e}, cells {on_cells:.2e}");
        assert!(on_lattice <= bounds[0] && on_cells <= bounds[1], "{name}");
    }
}

#[test]
fn the_body_in_a_plane_of_points_is_solid() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cylinder.csv");
    let mut text = String::from("x-coordinate y-coordinate density\n");
    for i in 0..120 * 30 {
        let (angle, r) = (TAU * f64::from(i % 120) / 120.0, 0.01 * 1.08f64.powi(i / 120));
        writeln!(text, "{} {} {}", r * angle.cos(), r * angle.sin(), 1.2 + r).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let found = contents(&path, &Default::default()).unwrap();
    assert!(found.planar && found.guess.is_some(), "{found:?}");
    assert!(found.notes[0].starts_with("3600 points in no order in a plane"), "{found:?}");
    let depth = Some(Depth::Span(0.1));
    let options = Options { depth, ..Options::new(Medium::density("density")) };
    let loaded = load(&path, &options).unwrap();
    let bodies = loaded.report.outside.unwrap().bodies_percent.unwrap();
    // The circle by the box around the outermost layer.
    let outer = 1.08f64.powi(29);
    let expected = 100.0 * TAU / 2.0 / (2.0 * outer).powi(2);
    assert!((bodies / expected - 1.0).abs() < 0.1, "{bodies} % of {expected} %");
}

#[test]
fn a_table_with_a_radius_is_revolved() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jet.csv");
    let truth = |x: f64, r: f64| 1.2 - 0.4 * x - 0.3 * (-r * r / 0.02).exp();
    let mut text = String::from("Radial Coordinate [ m ],X [ m ],density\n");
    let mut random = SplitMix64::new(5);
    for i in 0..6000 {
        // Some on the axis and on the other borders.
        let border = |x: f64, i: usize| {
            if i < 60 {
                0.0
            } else if i < 120 {
                1.0
            } else {
                x
            }
        };
        let x = border(random.between(0.0, 1.0), (i + 3000) % 6000);
        let r = 0.5 * border(random.between(0.0, 1.0), i);
        writeln!(text, "{r},{x},{}", truth(x, r)).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let found = contents(&path, &Default::default()).unwrap();
    let guess = found.guess.unwrap();
    assert!(guess.options.contains(&("--revolve", String::new())), "{guess:?}");
    let options =
        Options { depth: Some(Depth::Revolve), ..Options::new(Medium::density("density")) };
    let field = load(&path, &options).unwrap().field;
    // The flow is round about x, and `eps` its n - 1 apart from a constant and a factor.
    let (size, low) = (field.size_m(), field.origin_m());
    assert!((size.y - 1.0).abs() < 0.05 && (size.z / size.y - 1.0).abs() < 1e-9, "{size}");
    let [nx, ny, nz] = field.dims();
    let of = |at: [usize; 3]| {
        let step = DVec3::from(field.spacing_m());
        let p = low + step * DVec3::from(at.map(|i| i as f64));
        let eps = f64::from(field.eps()[at[0] + nx * (at[1] + ny * at[2])]);
        (eps, truth(p.x, p.y.hypot(p.z)))
    };
    // Gladstone and Dale's constant of air is 2.23e-4 to 2.3e-4 m3/kg in the visible.
    let middle = [nx / 2, ny / 2, nz / 2];
    let (eps, rho) = of(middle);
    for at in [[nx / 4, ny / 2, nz / 2], [nx / 2, 3 * ny / 4, nz / 2], [nx / 2, ny / 2, nz / 5]] {
        let (other_eps, other_rho) = of(at);
        let slope = (other_eps - eps) / (other_rho - rho);
        assert!((2.2e-4..2.32e-4).contains(&slope), "{at:?}: {slope}");
    }
}

/// Random points of 1.6 by 1 with a bell's density, placed by `place`. None are on lines, which
/// rounding would bend to either side.
fn cloud_in_plane(path: &Path, place: impl Fn(f64, f64) -> DVec3) {
    let mut random = SplitMix64::new(11);
    let density =
        |x: f64, y: f64| 1.2 + 0.3 * (-((x - 0.7).powi(2) + (y - 0.4).powi(2)) / 0.04).exp();
    let mut text = String::from("x,y,z,rho\n");
    for _ in 0..6000 {
        let [x, y] = [1.6, 1.0].map(|side| random.between(0.0, side));
        let p = place(x, y);
        writeln!(text, "{:?},{:?},{:?},{:?}", p.x, p.y, p.z, density(x, y)).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn points_of_a_plane_that_slants_give_the_flow_in_the_plane_of_two_axes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plane.csv");
    // Turned back by the least angle, it is as it was.
    let span = DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 25f64.to_radians());
    // About x, steeper than half of a right angle, and below the axis.
    let about_x = |degrees: f64| DQuat::from_axis_angle(DVec3::X, degrees.to_radians());
    let (steep, below) = (about_x(70.0), about_x(250.0));
    let upright = about_x(90.0);
    for (depth, turns) in
        [(Depth::Span(0.3), vec![span]), (Depth::Revolve, vec![steep, below, upright])]
    {
        let options = Options { depth: Some(depth), ..Options::new(Medium::density("rho")) };
        cloud_in_plane(&path, |x, y| DVec3::new(x, y, 0.0));
        let flat = load(&path, &options).unwrap().field;
        let largest = flat.eps().iter().fold(0.0f32, |m, e| m.max(e.abs()));
        for turn in turns {
            let case = format!("{depth:?} {turn}");
            cloud_in_plane(&path, |x, y| turn * DVec3::new(x, y, 0.0));
            let found = contents(&path, &Default::default()).unwrap();
            assert!(found.planar, "{case}: {found:?}");
            let made = load(&path, &options).unwrap();
            assert_eq!(made.field.dims(), flat.dims(), "{case}");
            assert!((made.field.origin_m() - flat.origin_m()).length() < 1e-9, "{case}");
            // At the axis, rounding chooses which reflected points a polynomial is fitted to.
            let [nx, ny, nz] = flat.dims();
            let counts = |i: usize| {
                let [j, k] = [(i / nx % ny, ny), (i / nx / ny, nz)]
                    .map(|(at, n)| at as f64 - 0.5 * (n - 1) as f64);
                depth != Depth::Revolve || j.hypot(k) > 3.0
            };
            let far = (0..nx * ny * nz)
                .filter(|i| counts(*i))
                .map(|i| (made.field.eps()[i] - flat.eps()[i]).abs());
            let far = far.fold(0.0, f32::max) / largest;
            assert!(far < 1e-4, "{case}: {far}");
            let said = made.report.warnings.join("\n");
            assert!(said.contains("it is turned by"), "{case}: {said}");
        }
    }
}

#[test]
fn a_depth_of_points_nearly_in_a_plane_is_refused_with_how_far_they_are_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bent.csv");
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 0.4);
    cloud_in_plane(&path, |x, y| turn * DVec3::new(x, y, 1e-3 * x * x));
    for depth in [Depth::Span(0.3), Depth::Revolve] {
        let options = Options { depth: Some(depth), ..Options::new(Medium::density("rho")) };
        let error = load(&path, &options).map(|_| ()).unwrap_err();
        let text = format!("{error}: {}", std::error::Error::source(&error).unwrap());
        assert!(text.contains("bent.csv") && text.contains("the farthest point is"), "{text}");
        assert!(text.contains("up to 1e-4 is none"), "{text}");
    }
}
