//! Lattices that break careless code, one test for each kind: sizes, spacings, views, borders,
//! masks, shocks thinner than a voxel. (Rays: hard_cases.rs.)

mod common;

use common::{blob, cube, difference, grid, largest, lopsided, oblique, trace};
use datasets::model::{DataArray, Dataset, ImageData, Values};
use glam::{DMat3, DVec3};
use schlieren::analytic::Gaussian;
use schlieren::field::{Field, Node};
use schlieren::input::{self, from_dataset};
use schlieren::interpolate::{BSpline, Interpolant, Interpolate, Trilinear, TrilinearGradient};
use schlieren::march::{
    BlankCells, CellExact, Deviational, Full, FullOptions, Integrator, InterpolatedMedium,
    LineOfSight, Medium, Options, Pefrl, Ray, RungeKutta4, Scheme, Verlet,
};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start, Status};
use schlieren::skip::Bricks;
use schlieren::view::{Axis, View};

const INTERPOLANTS: [Interpolant; 3] =
    [Interpolant::BSpline, Interpolant::Trilinear, Interpolant::TrilinearGradient];

fn start(x: f64, y: f64) -> Start {
    Start { position_m: [x as f32, y as f32], tilt_rad: [0.0; 2] }
}

fn weak(field: &Field, view: View, interpolant: Interpolant) -> Deviational<'_> {
    Deviational::new(field, view, interpolant, Options::default())
}

/// Rows of 256 nodes are stored with padding, because otherwise a column of the lattice would map
/// to a few cache sets. An index that ignores the padding is wrong from the second row on.
#[test]
fn sizes_255_256_and_260_along_every_axis_agree() {
    let view = oblique();
    let starts = grid(9, 0.7);
    let wanted = trace(&weak(&cube(97, lopsided), view, Interpolant::BSpline), &starts);
    for n in [255, 256, 260] {
        for axis in 0..3 {
            let mut dims = [48; 3];
            dims[axis] = n;
            let spacing = dims.map(|n| 1.0 / (n - 1) as f64);
            let field = Field::from_fn(dims, spacing, DVec3::splat(-0.5), 1.0, lopsided).unwrap();
            for (interpolant, tolerance) in
                // With 48 nodes, sigma is 4 voxels.
                [
                    (Interpolant::BSpline, 3e-3),
                    (Interpolant::TrilinearGradient, 0.04),
                    (Interpolant::Trilinear, 0.1),
                ]
            {
                let (_, max) =
                    difference(&trace(&weak(&field, view, interpolant), &starts), &wanted);
                assert!(max < tolerance, "{dims:?} {interpolant:?}: {max:.1e}");
            }
        }
    }
}

/// A lattice of unequal spacing must give the same result as one of equal spacing, and the same
/// result again when everything is rotated so that the axes are exchanged.
#[test]
fn anisotropic_spacing_is_the_rotated_isotropic_answer() {
    let starts = grid(12, 0.7);
    let [coarse, fine] = [[49, 65, 97], [97, 97, 97]].map(|dims: [usize; 3]| {
        Field::from_fn(dims, dims.map(|n| 1.0 / (n - 1) as f64), DVec3::splat(-0.5), 1.0, lopsided)
            .unwrap()
    });
    // x' = y, y' = z, z' = x.
    let dims = [65, 97, 49];
    let turned = Field::from_fn(
        dims,
        dims.map(|n: usize| 1.0 / (n - 1) as f64),
        DVec3::splat(-0.5),
        1.0,
        |p| lopsided(DVec3::new(p.z, p.x, p.y)),
    )
    .unwrap();
    let turn = |v: DVec3| DVec3::new(v.y, v.z, v.x);
    let view = oblique();
    let other =
        View { right: turn(view.right), up: turn(view.up), forward: turn(view.forward), ..view };
    for interpolant in INTERPOLANTS {
        let [a, b] = [
            trace(&weak(&coarse, view, interpolant), &starts),
            trace(&weak(&turned, other, interpolant), &starts),
        ];
        // The same numbers in another order differ by rounding. With trilinear interpolation,
        // samples may also fall on the other side of a face, where the gradient jumps.
        let tolerance = if interpolant == Interpolant::Trilinear { 2e-4 } else { 1e-6 };
        let (_, max) = difference(&b, &a);
        assert!(max < tolerance, "{interpolant:?}: {max:.1e}");
    }
    let [a, b] = [&coarse, &fine].map(|f| trace(&weak(f, view, Interpolant::BSpline), &starts));
    assert!(difference(&a, &b).1 < 2e-3);
}

/// A view rotated about the light by 0.6 rad only rotates the result. A round blob has the same
/// result 0.6 rad off an axis of the lattice.
#[test]
fn a_view_turned_by_0_6_rad_sees_the_same_within_a_millionth() {
    let field = cube(64, lopsided);
    let starts = grid(12, 0.6);
    let (sin, cos) = 0.6f64.sin_cos();
    for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
        let rolled = View {
            right: cos * view.right + sin * view.up,
            up: cos * view.up - sin * view.right,
            ..view
        };
        let turned = |[x, y]: [f32; 2], sin: f64| {
            let [x, y] = [x, y].map(f64::from);
            [(cos * x + sin * y) as f32, (cos * y - sin * x) as f32]
        };
        let moved: Vec<Start> =
            starts.iter().map(|s| Start { position_m: turned(s.position_m, sin), ..*s }).collect();
        let wanted = trace(&weak(&field, view, Interpolant::BSpline), &starts);
        let mut got = trace(&weak(&field, rolled, Interpolant::BSpline), &moved);
        got.iter_mut().for_each(|e| e.deflection_rad = turned(e.deflection_rad, -sin));
        let (_, max) = difference(&got, &wanted);
        assert!(max < 1e-6, "rolled: {max:.1e}");
    }
    // Sigma is 22 voxels: the spline's own error is 7.5e-6 at ten and falls at least with the third
    // power. The lattice ends at 5 sigma, where eps is 3.7e-6 of its largest value. The two views
    // cross its border differently, which causes the largest error.
    let g = Gaussian { amplitude: 1e-5, sigma_m: 0.1 };
    let field = blob(221, g.amplitude, g.sigma_m);
    let starts = grid(12, 0.4);
    let straight =
        trace(&weak(&field, View::along(Axis::Z, DVec3::ZERO), Interpolant::BSpline), &starts);
    let turned =
        View::new(DVec3::new(0.6f64.sin(), 0.0, 0.6f64.cos()), DVec3::Y, DVec3::ZERO).unwrap();
    let (rms, max) =
        difference(&trace(&weak(&field, turned, Interpolant::BSpline), &starts), &straight);
    assert!(rms < 1e-6 && max < 5e-6, "rms {rms:.1e}, max {max:.1e}");
}

/// The same march back through the same lattice returns to the start, in spite of kinks.
#[test]
fn trace_back_returns_to_the_start_through_a_lattice() {
    let field = cube(33, |p| 300.0 * lopsided(p));
    let (spline, trilinear) = (BSpline::new(&field), Trilinear::new(&field));
    fn home<I: Interpolate>(field: &Field, i: &I, march: &impl Integrator, steps: u32) -> f64 {
        let medium = InterpolatedMedium::new(field, i);
        let direction = oblique().forward;
        let begin =
            Ray::inside(&medium, DVec3::new(0.05, -0.08, 0.02) - 0.4 * direction, direction);
        let there = march.run(&medium, &begin, 0.8, steps);
        assert!((there.u - begin.u).length() > 1e-3);
        let turned = Ray { u: direction - there.w(), ..Ray::new(there.position_m(), -direction) };
        let back = march.run(&medium, &Ray { u: -there.w() + direction, ..turned }, 0.8, steps);
        (back.position_m() - begin.start_m).length()
    }
    // Symmetric schemes return within rounding, at any step.
    assert!(
        home(&field, &spline, &Verlet, 40) < 1e-12 && home(&field, &spline, &Pefrl, 40) < 1e-12
    );
    assert!(home(&field, &trilinear, &Verlet, 40) < 1e-12);
    // The cell-exact march takes the same steps in both directions, except at the ends, and each
    // step is symmetric.
    assert!(home(&field, &spline, &CellExact::new(&field), 1) < 1e-11);
    assert!(home(&field, &trilinear, &CellExact::new(&field), 1) < 1e-11);
    // Other schemes return only within their error.
    assert!(home(&field, &spline, &RungeKutta4, 40) > 1e-11);
}

fn image(n: [u32; 3], values: Vec<f64>) -> Dataset {
    let spacing = DVec3::from(n.map(|n| 1.0 / f64::from(n - 1)));
    let mut image = ImageData::new(n, DVec3::splat(-0.5), spacing);
    image.attributes.point.push(DataArray::new("n_minus_1", 1, Values::F64(values)));
    Dataset::ImageData(image)
}

/// A shock much thinner than a voxel, 20 degrees off the lattice. Sampled at points it is a
/// staircase, and the light is deflected by its steps: every march is wrong by a quarter and more.
/// The cell-exact march is too, so the march is not the cause. With means over cells, or smoothed
/// on reading, the shock deflects like a prism: deps tan(phi).
#[test]
fn sub_voxel_shocks_are_staircases_unless_averaged_or_smoothed() {
    let (jump, n) = (8e-4, 65u32);
    // The shock's normal is 60 degrees off the light, in a plane 20 degrees off the lattice's.
    let (phi, twist) = (60f64.to_radians(), 20f64.to_radians());
    let normal = DMat3::from_rotation_z(twist) * DVec3::new(phi.sin(), 0.0, phi.cos());
    let h = 1.0 / f64::from(n - 1);
    let at = |i: usize| {
        let n = n as usize;
        DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) * h - 0.5
    };
    let sampled = |i: usize| if at(i).dot(normal) > 0.0 { jump } else { 0.0 };
    // Mean over 6³ points of the cell around each node.
    let averaged = |i: usize| {
        let one = |s: usize| {
            let o =
                DVec3::new((s % 6) as f64, (s / 6 % 6) as f64, (s / 36) as f64) / 6.0 - 5.0 / 12.0;
            f64::from(u8::from((at(i) + o * h).dot(normal) > 0.0))
        };
        jump * (0..216).map(one).sum::<f64>() / 216.0
    };
    let values = |f: &dyn Fn(usize) -> f64| (0..(n as usize).pow(3)).map(f).collect::<Vec<f64>>();
    let field = |values: Vec<f64>, smoothing_nodes: f64| {
        let medium = input::Medium::NMinus1(input::Quantity::array("n_minus_1"));
        let options = input::Options { smoothing_nodes, ..input::Options::new(medium) };
        from_dataset(&image([n; 3], values), &options).unwrap().field
    };
    let view = View::along(Axis::Z, DVec3::ZERO);
    let starts = grid(12, 0.2);
    // At a weak jump the change of direction across the shock is deps times the tangent of the
    // angle of incidence.
    let prism = jump * phi.tan();
    let across = [twist.cos(), twist.sin()];
    let error = |u: [f64; 2]| (u[0] - prism * across[0]).hypot(u[1] - prism * across[1]) / prism;
    let rms =
        |errors: Vec<f64>| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let of_paths = |paths: &dyn LightPaths| {
        let mut exits = vec![Exit::UNDISTURBED; starts.len()];
        paths.trace(&starts, &mut exits);
        rms(exits.iter().map(|e| error(e.deflection_rad.map(f64::from))).collect())
    };
    let marched = |f: &Field| {
        let options = Options { step_voxels: 0.25, ..Options::default() };
        of_paths(&Deviational::new(f, view, Interpolant::BSpline, options))
    };
    let staircase = field(values(&sampled), 0.0);
    let exact = |f: &Field| {
        let trilinear = Trilinear::new(f);
        of_paths(&Full::new(f, &trilinear, CellExact::new(f), view, FullOptions::default()))
    };
    let [by_points, by_points_exact] = [marched(&staircase), exact(&staircase)];
    let by_means = marched(&field(values(&averaged), 0.0));
    let smoothed = marched(&field(values(&sampled), 1.2));
    // Measured: 0.40 and 0.25 by points, 0.004 by means, 0.019 smoothed.
    assert!(by_points > 0.2 && by_points_exact > 0.15, "{by_points} {by_points_exact}");
    assert!(by_means < 0.01 && smoothed < 0.04, "{by_means} {smoothed}");
}

/// The bounds of a brick also hold on its border, where the spline's 64 taps reach two nodes into
/// the next brick.
#[test]
fn brick_borders_have_their_halo() {
    // A slope on one side of a border between bricks (every 8 nodes), and none on the other side.
    for border in [8.0, 16.0] {
        let n = 33;
        let field = cube(n, |p| 1e-4 * ((p.x + 0.5) * 32.0 - border).max(0.0));
        let spline = BSpline::new(&field);
        let bricks = Bricks::new(&field, &spline);
        for i in 0..=3200 {
            let at = [f64::from(i) * 0.01, 12.3, 7.9];
            let s = spline.sample(at);
            let brick = bricks.around(at.map(|a| a as f32));
            let slope = s.gradient[0].hypot(s.gradient[1]).hypot(s.gradient[2]) * 32.0;
            assert!(
                slope <= f64::from(brick.max_gradient_per_m) * (1.0 + 1e-5) + 1e-12,
                "{at:?}: {slope} {brick:?}"
            );
            let off = (s.eps - f64::from(brick.mean_eps)).abs();
            assert!(
                off <= f64::from(brick.half_range_eps) * (1.0 + 1e-5) + 1e-9,
                "{at:?}: {s:?} {brick:?}"
            );
        }
    }
    // Rays along a border, with bricks skipped on its uniform side.
    let field = blob(65, 1e-4, 0.05);
    let view = View::along(Axis::Z, DVec3::ZERO);
    let starts: Vec<Start> = (-4..=4)
        .flat_map(|i| (-4..=4).map(move |j| (i, j)))
        .map(|(i, j)| start(f64::from(i) * 0.125, f64::from(j) * 0.125 + 1e-4))
        .collect();
    let plain = trace(&weak(&field, view, Interpolant::BSpline), &starts);
    let options = Options { skip_rad: 1e-8, ..Options::default() };
    let paths = Deviational::new(&field, view, Interpolant::BSpline, options);
    let got = trace(&paths, &starts);
    assert!(paths.counters().ray_steps_skipped > 0);
    assert!(difference(&got, &plain).1 * largest(&plain) <= 1e-8);
}

/// A ball in the stream, with every march: rays behind it are dark with the status
/// [`Status::Blocked`], rays that pass it are free, and the values in the ball's cells bend no ray.
#[test]
fn solid_bodies_stop_rays_in_every_march() {
    let n = 41;
    let at = |i: usize| {
        DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) / (n - 1) as f64 - 0.5
    };
    let ball = |p: DVec3| p.length() < 0.2;
    let nodes: Vec<Node> =
        (0..n * n * n).map(|i| if ball(at(i)) { Node::Solid } else { Node::Gas }).collect();
    let eps =
        (0..n * n * n).map(|i| if ball(at(i)) { 1e9 } else { (1e-5 * at(i).x) as f32 }).collect();
    let field =
        Field::new([n; 3], [1.0 / (n - 1) as f64; 3], DVec3::splat(-0.5), eps, 1.0, Some(nodes))
            .unwrap();
    assert_eq!(field.not_finite(), 0);
    let spline = BSpline::new(&field);
    let starts = [start(0.01, 0.0), start(0.0, 0.17), start(0.24, 0.0), start(-0.3, 0.3)];
    for view in [View::along(Axis::Z, DVec3::ZERO), View::along(Axis::X, DVec3::ZERO), oblique()] {
        let mut marches: Vec<(String, Box<dyn LightPaths + '_>)> = vec![
            (
                "line of sight".into(),
                Box::new(LineOfSight::new(
                    &field,
                    view,
                    Interpolant::BSpline,
                    PathQuantities::default(),
                    BlankCells::Opaque,
                )),
            ),
            (
                "PEFRL".into(),
                Box::new(Full::new(&field, &spline, Pefrl, view, FullOptions::default())),
            ),
            (
                "cell-exact".into(),
                Box::new(Full::new(
                    &field,
                    &spline,
                    CellExact::new(&field),
                    view,
                    FullOptions::default(),
                )),
            ),
        ];
        for interpolant in INTERPOLANTS {
            for scheme in [Scheme::Verlet, Scheme::Euler] {
                let options = Options { scheme, ..Options::default() };
                marches.push((
                    format!("{scheme:?} {interpolant:?}"),
                    Box::new(Deviational::new(&field, view, interpolant, options)),
                ));
            }
        }
        for (name, march) in &marches {
            let mut e = [Exit::UNDISTURBED; 4];
            march.trace(&starts, &mut e);
            assert_eq!(
                e.map(|e| e.status),
                [Status::Blocked, Status::Blocked, Status::Free, Status::Free],
                "{name}"
            );
            assert_eq!(e.map(|e| e.transmission), [0.0, 0.0, 1.0, 1.0], "{name}");
            assert!(largest(&e) < 2.5e-5, "{name}: {e:?}");
        }
    }
}

/// PLOT3D with iblank: points of value 0 do not belong to the gas and are counted.
#[test]
fn iblank_cells_are_masked_and_counted() {
    let n = 11usize;
    let blanked = |i: usize, j: usize, k: usize| {
        (4..7).contains(&i) && (4..7).contains(&j) && (4..7).contains(&k)
    };
    let (mut grid, mut q) = (Vec::new(), Vec::new());
    for out in [&mut grid, &mut q] {
        (0..3).for_each(|_| out.extend((n as i32).to_be_bytes()));
    }
    let places: Vec<[usize; 3]> = (0..n * n * n).map(|o| [o % n, o / n % n, o / n / n]).collect();
    for c in 0..3 {
        places.iter().for_each(|p| grid.extend((p[c] as f32 * 0.1).to_be_bytes()));
    }
    places.iter().for_each(|p| grid.extend(i32::from(!blanked(p[0], p[1], p[2])).to_be_bytes()));
    [2.0f32, 0.0, 1e6, 0.0].iter().for_each(|v| q.extend(v.to_be_bytes()));
    for c in 0..5 {
        // Invalid values at blanked points.
        let value = |p: &[usize; 3]| {
            if blanked(p[0], p[1], p[2]) {
                1e30
            } else if c == 0 {
                1.2
            } else {
                2.0
            }
        };
        places.iter().for_each(|p| q.extend((value(p) as f32).to_be_bytes()));
    }
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("holexyz.bin"), grid).unwrap();
    std::fs::write(dir.path().join("holeq.bin"), q).unwrap();
    let medium = input::Medium::density("Density");
    for (hidden, node, status) in [
        (input::Role::Solid, Node::Solid, Status::Blocked),
        (input::Role::Blank, Node::Blank, Status::Masked),
    ] {
        let options = input::Options { hidden, ..input::Options::new(medium.clone()) };
        let loaded = input::load(&dir.path().join("holexyz.bin"), &options).unwrap();
        let (field, report) = (loaded.field, loaded.report);
        let masked = report.resampling.unwrap().hidden;
        assert!(masked >= 27 && field.count(node) == masked, "{masked} {}", field.count(node));
        // No invalid values remain.
        assert!(field.eps().iter().all(|e| e.abs() < 1e-6));
        let view = View::along(Axis::Z, field.centre_m());
        let e = trace(
            &weak(&field, view, Interpolant::BSpline),
            &[start(0.01, 0.02), start(0.35, -0.35)],
        );
        assert_eq!([e[0].status, e[1].status], [status, Status::Free]);
    }
}

/// Gradients of all interpolated media are per metre, whatever the spacing.
#[test]
fn gradients_are_per_metre_at_any_spacing() {
    let field = Field::from_fn([9, 7, 5], [0.1, 0.02, 3.0], DVec3::new(1.0, 2.0, 3.0), 1.0, |p| {
        1e-6 * (p.x - 2.0 * p.y + 0.5 * p.z)
    })
    .unwrap();
    fn gradient<I: Interpolate>(field: &Field, i: &I) -> DVec3 {
        InterpolatedMedium::new(field, i).sample(DVec3::new(1.37, 2.051, 8.2)).1
    }
    let [a, b, c] = [
        gradient(&field, &BSpline::new(&field)),
        gradient(&field, &Trilinear::new(&field)),
        gradient(&field, &TrilinearGradient::new(&field)),
    ];
    for g in [a, b, c] {
        // eps is stored in f32, with an error of 5e-13 at 5e-6, over spacings of 2 cm.
        assert!((g - 1e-6 * DVec3::new(1.0, -2.0, 0.5)).length() < 1e-10, "{g}");
    }
}
