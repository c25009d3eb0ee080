//! Tests that a ray's exit is bit for bit the same alone, among any neighbours, in any order, and
//! on any number of threads.

mod common;

use common::{grid, lopsided, oblique, trace};
use glam::DVec3;
use schlieren::field::{Field, Node};
use schlieren::interpolate::{BSpline, Interpolant};
use schlieren::march::{
    BlankCells, Deviational, Full, FullOptions, LineOfSight, Options, Pefrl, Scheme, Verlet,
};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start, Status};
use schlieren::view::{Axis, View};

const INTERPOLANTS: [Interpolant; 3] =
    [Interpolant::BSpline, Interpolant::Trilinear, Interpolant::TrilinearGradient];

/// A body in the first corner (whose node unused lanes look up), another behind a layer without
/// data, and gas.
fn with_bodies() -> Field {
    let n = 24;
    let mut eps = vec![];
    let mut nodes = vec![];
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                let p = DVec3::new(i as f64, j as f64, k as f64) / (n - 1) as f64 - 0.5;
                eps.push((100.0 * lopsided(p)) as f32);
                let blank = k == 9 && (8..16).contains(&i) && (6..18).contains(&j);
                let solid =
                    i < 3 && j < 3 && k < 3 || (p - DVec3::new(0.02, 0.05, 0.2)).length() < 0.17;
                nodes.push(match (solid, blank) {
                    (true, _) => Node::Solid,
                    (_, true) => Node::Blank,
                    _ => Node::Gas,
                });
            }
        }
    }
    Field::new([n; 3], [1.0 / (n - 1) as f64; 3], DVec3::splat(-0.5), eps, 1.0, Some(nodes))
        .unwrap()
}

fn bits(e: &Exit) -> ([u32; 7], Status) {
    let [[a, b], [c, d]] = [e.deflection_rad, e.displacement_m];
    ([a, b, c, d, e.exit_depth_m, e.opd_m, e.transmission].map(f32::to_bits), e.status)
}

/// A permutation that separates neighbours, with a stride that is coprime to the length.
fn scattered(count: usize) -> Vec<usize> {
    let gcd = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let step = (count * 5 / 13..).find(|s| gcd(*s, count) == 1).unwrap();
    (0..count).map(|i| i * step % count).collect()
}

fn assert_independent(paths: &impl LightPaths, starts: &[Start], what: &str) {
    let alone: Vec<Exit> =
        starts.iter().map(|s| trace(paths, std::slice::from_ref(s))[0]).collect();
    let check = |order: &[usize], exits: &[Exit], how: &str| {
        for (i, e) in order.iter().zip(exits) {
            assert_eq!(
                bits(e),
                bits(&alone[*i]),
                "{what}, {how}: {:?}: {e:?}, alone {:?}",
                starts[*i],
                alone[*i]
            );
        }
    };
    let in_order: Vec<usize> = (0..starts.len()).collect();
    let reversed: Vec<usize> = in_order.iter().rev().copied().collect();
    let mixed = scattered(starts.len());
    for (order, how) in [(&in_order, "in order"), (&reversed, "reversed"), (&mixed, "scattered")] {
        let sent: Vec<Start> = order.iter().map(|i| starts[*i]).collect();
        check(order, &trace(paths, &sent), how);
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut exits = vec![Exit::UNDISTURBED; sent.len()];
            pool.install(|| paths.trace_parallel(&sent, &mut exits));
            check(order, &exits, &format!("{how}, {threads} threads"));
        }
    }
}

/// Rays through the field, through its edges, and far outside it; more than a thread takes at once.
fn rays() -> Vec<Start> {
    let mut starts = grid(33, 1.9);
    let odd = [f32::NAN, f32::INFINITY, 1e30];
    starts.extend(odd.map(|x| Start { position_m: [x, 0.0], tilt_rad: [0.0; 2] }));
    starts.extend(grid(5, 0.8).into_iter().map(|s| Start { tilt_rad: [0.02, -0.01], ..s }));
    starts
}

#[test]
fn gas_alone_is_independent_of_neighbours_and_threads() {
    let field = common::cube(24, |p| 100.0 * lopsided(p));
    let starts = rays();
    for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
        for interpolant in INTERPOLANTS {
            for (scheme, opd) in
                [(Scheme::Verlet, false), (Scheme::Verlet, true), (Scheme::Euler, true)]
            {
                let options =
                    Options { scheme, quantities: PathQuantities { opd }, ..Options::default() };
                let paths = Deviational::new(&field, view, interpolant, options);
                assert_independent(&paths, &starts, &format!("{interpolant:?} {scheme:?} {opd}"));
            }
        }
    }
}

#[test]
fn masked_and_blocked_are_independent_of_neighbours_and_threads() {
    let field = with_bodies();
    let starts = rays();
    for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
        for blank in [BlankCells::Opaque, BlankCells::Continued] {
            for interpolant in INTERPOLANTS {
                for scheme in [Scheme::Verlet, Scheme::Euler] {
                    let options = Options {
                        scheme,
                        blank,
                        quantities: PathQuantities { opd: true },
                        ..Options::default()
                    };
                    let paths = Deviational::new(&field, view, interpolant, options);
                    assert_independent(
                        &paths,
                        &starts,
                        &format!("{interpolant:?} {scheme:?} {blank:?}"),
                    );
                }
            }
        }
    }
}

#[test]
fn straight_and_full_marches_are_independent_of_neighbours_and_threads() {
    let field = with_bodies();
    let spline = BSpline::new(&field);
    let starts: Vec<Start> = rays().into_iter().step_by(3).collect();
    for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
        for blank in [BlankCells::Opaque, BlankCells::Continued] {
            let quantities = PathQuantities { opd: true };
            let sight = LineOfSight::new(&field, view, Interpolant::BSpline, quantities, blank);
            assert_independent(&sight, &starts, "line of sight");
            let options = FullOptions { blank, quantities, ..FullOptions::default() };
            assert_independent(&Full::new(&field, &spline, Pefrl, view, options), &starts, "full");
        }
    }
}

/// The layer without data is before the body, so the layer stops the ray, however long its
/// neighbours continue.
#[test]
fn a_ray_keeps_the_name_of_what_stopped_it() {
    let field = with_bodies();
    let spline = BSpline::new(&field);
    let view = View::along(Axis::Z, DVec3::ZERO);
    let starts = grid(40, 0.95);
    let fast = Deviational::new(&field, view, Interpolant::BSpline, Options::default());
    let full = Full::new(&field, &spline, Verlet, view, FullOptions::default());
    let (fast, full) = (trace(&fast, &starts), trace(&full, &starts));
    let count = |exits: &[Exit], s: Status| exits.iter().filter(|e| e.status == s).count();
    // Each status occurs, and the two marches agree except for rays along the edge of a node's
    // cell.
    for status in [Status::Free, Status::Masked, Status::Blocked] {
        let [a, b] = [count(&fast, status), count(&full, status)];
        assert!(a > 15 && 10 * a.abs_diff(b) <= a, "{status:?}: {a} {b}");
    }
    // A ray through the layer and the body behind it.
    let behind = Start { position_m: [0.01, 0.03], tilt_rad: [0.0; 2] };
    let paths = Deviational::new(&field, view, Interpolant::BSpline, Options::default());
    assert_eq!(trace(&paths, &[behind])[0].status, Status::Masked);
    assert_eq!(trace(&paths, &[behind; 40])[39].status, Status::Masked);
}

/// The lattice's first node is in a body. Rays outside the field are not stopped by it.
#[test]
fn rays_beside_the_field_do_not_meet_its_first_node() {
    let field = with_bodies();
    let starts = [0.0, 0.7, 0.3, 5.0].map(|x| Start { position_m: [x, 0.3], tilt_rad: [0.0; 2] });
    for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
        for scheme in [Scheme::Verlet, Scheme::Euler] {
            let options = Options { scheme, ..Options::default() };
            let e = trace(&Deviational::new(&field, view, Interpolant::BSpline, options), &starts);
            assert_eq!(
                (e[3].status, e[3].transmission, e[3].deflection_rad),
                (Status::Free, 1.0, [0.0; 2])
            );
        }
    }
}
