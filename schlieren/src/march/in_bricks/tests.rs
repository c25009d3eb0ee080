use super::*;
use crate::field::Field;
use crate::march::{Deviational, Options};
use crate::path::{LightPaths, PathQuantities};
use crate::view::Axis;

const DIMS: [usize; 3] = [19, 14, 23];
const SPACING_M: [f64; 3] = [1e-3, 1.5e-3, 0.8e-3];
const N0: f64 = 1.000_27;

/// Two warm spots whose light crosses the cuts of all bricks obliquely.
fn gas(p: DVec3) -> f64 {
    let spot =
        |at: DVec3, sigma_m: f64| (-(p - at).length_squared() / (2.0 * sigma_m.powi(2))).exp();
    let spots = spot(DVec3::new(7e-3, 9e-3, 8e-3), 3e-3) - 0.7 * spot(DVec3::splat(11e-3), 4e-3);
    2e-4 * spots + 1e-5 * p.x / 1e-2
}

fn field() -> Field {
    Field::from_fn(DIMS, SPACING_M, DVec3::ZERO, N0, gas).expect("a field")
}

fn lattice() -> Lattice {
    Lattice { dims: DIMS, spacing_m: SPACING_M, origin_m: DVec3::ZERO, n0: N0 }
}

fn views() -> [View; 3] {
    let centre_m = field().centre_m();
    let oblique = View::new(DVec3::new(0.6, -0.8, 0.5), DVec3::Z, centre_m).expect("a view");
    [View::along(Axis::Z, centre_m), View::along(Axis::Y, centre_m), oblique]
}

fn starts() -> Vec<Start> {
    // Not on faces of cells, where trilinear gradients jump.
    let at = |i: i32| (i as f32 - 6.0) * 1.9e-3 + 0.37e-4;
    let start = |i, j| Start { position_m: [at(i), at(j)], tilt_rad: [0.0; 2] };
    (0..13).flat_map(|j| (0..13).map(move |i| start(i, j))).collect()
}

/// Nodes `first` to before `end` of the field; a read beside them panics.
struct Part<'a> {
    field: &'a Field,
    nodes: [[usize; 3]; 2],
    cells: [[usize; 3]; 2],
}

impl Brick for Part<'_> {
    fn cells(&self) -> [[usize; 3]; 2] {
        self.cells
    }

    fn eps(&self, node: [usize; 3]) -> f64 {
        let [first, end] = self.nodes;
        assert!((0..3).all(|c| (first[c]..end[c]).contains(&node[c])), "{node:?} is not here");
        f64::from(self.field.eps()[(node[2] * DIMS[1] + node[1]) * DIMS[0] + node[0]])
    }
}

fn part<'a>(march: &InBricks, field: &'a Field, nodes: [[usize; 3]; 2]) -> Part<'a> {
    Part { field, nodes, cells: march.cells_of_nodes(nodes[0], nodes[1]) }
}

/// Exits by bricks with cuts at `cuts` and as many layers of ghosts as the stencil has, and how
/// often rays changed bricks.
fn traced(march: &InBricks, field: &Field, cuts: &[usize]) -> (Vec<Exit>, usize) {
    let layers = march.stencil().layers();
    let along = |c: usize| -> Vec<[usize; 2]> {
        let last = DIMS[c] - 1;
        let mut ends: Vec<usize> = [0].into_iter().chain(cuts.iter().copied()).collect();
        ends.retain(|cut| *cut < last);
        ends.push(last);
        let range = |w: &[usize]| [w[0].saturating_sub(layers), (w[1] + layers).min(last) + 1];
        ends.windows(2).map(range).collect()
    };
    let mut parts = Vec::new();
    for z in along(2) {
        for y in along(1) {
            for x in along(0) {
                parts.push(part(march, field, [[x[0], y[0], z[0]], [x[1], y[1], z[1]]]));
            }
        }
    }
    let mut changes = 0;
    let exit = |start: &Start| {
        let mut state = RayState::default();
        let mut here = march.entry_cell(start).unwrap_or_default();
        loop {
            let has =
                |p: &&Part<'_>| (0..3).all(|c| (p.cells[0][c]..p.cells[1][c]).contains(&here[c]));
            let part = parts.iter().find(has).expect("every cell is in a brick");
            match march.advance(start, &mut state, part) {
                Progress::Left(exit) => return exit,
                Progress::NeedsCell(cell) => here = cell,
            }
            changes += 1;
        }
    };
    (starts().iter().map(exit).collect(), changes)
}

#[test]
fn a_lattice_in_bricks_has_the_bits_of_the_lattice_in_one_piece() {
    let field = field();
    for interpolant in [Interpolant::Trilinear, Interpolant::TrilinearGradient] {
        for view in views() {
            let march = InBricks::new(&lattice(), view, interpolant, 0.7).expect("a march");
            let (whole, changes) = traced(&march, &field, &[]);
            assert_eq!(changes, 0);
            for cuts in [&[9][..], &[4, 8, 12, 16], &[1, 2, 3, 7, 11]] {
                let (exits, changes) = traced(&march, &field, cuts);
                assert!(changes > 50, "{changes}");
                assert!(exits == whole, "{interpolant:?}, cut at {cuts:?}");
            }
        }
    }
}

#[test]
fn a_ray_has_the_same_bits_beside_any_others_and_at_every_level() {
    let field = field();
    for interpolant in [Interpolant::Trilinear, Interpolant::TrilinearGradient] {
        for view in views() {
            let march = InBricks::new(&lattice(), view, interpolant, 0.7).expect("a march");
            let (alone, _) = traced(&march, &field, &[]);
            let whole = part(&march, &field, [[0; 3], DIMS]);
            let mut levels = vec![fearless_simd::Level::new()];
            #[cfg(target_arch = "x86_64")]
            levels
                .extend([fearless_simd::Level::Sse2(levels[0].as_sse2().expect("part of x86-64"))]);
            #[cfg(target_arch = "x86_64")]
            levels.extend(levels[0].as_avx2().map(fearless_simd::Level::Avx2));
            for level in levels {
                let march = march.clone().at_simd_level(level);
                let mut rays: Vec<_> =
                    starts().into_iter().map(|start| (start, RayState::default())).collect();
                let mut exits = vec![None; rays.len()];
                march.advance_all(&mut rays, &whole, |i, progress| {
                    let Progress::Left(exit) = progress else { panic!("it has all cells") };
                    assert!(exits[i].replace(exit).is_none(), "ray {i} ends twice");
                });
                let exits: Vec<_> = exits.into_iter().flatten().collect();
                assert!(exits == alone, "{interpolant:?}, {level:?}");
            }
        }
    }
}

#[test]
fn samples_that_are_not_taken_would_have_changed_no_bit() {
    // A front with still gas before and behind it, and a bubble.
    let still = |p: DVec3| if (6e-3..9e-3).contains(&(p.y + 0.3 * p.x)) { gas(p) } else { 0.0 };
    let field = Field::from_fn(DIMS, SPACING_M, DVec3::ZERO, N0, still).expect("a field");
    struct Known<'a>(Part<'a>, Option<Undisturbed>, std::sync::atomic::AtomicUsize);
    impl Brick for Known<'_> {
        fn cells(&self) -> [[usize; 3]; 2] {
            self.0.cells()
        }
        fn eps(&self, node: [usize; 3]) -> f64 {
            self.0.eps(node)
        }
        fn is_undisturbed(&self, cell: [usize; 3]) -> bool {
            let is = self.1.as_ref().is_some_and(|cells| cells.contains(cell));
            self.2.fetch_add(usize::from(is), std::sync::atomic::Ordering::Relaxed);
            is
        }
    }
    for interpolant in [Interpolant::Trilinear, Interpolant::TrilinearGradient] {
        for view in views() {
            let march = InBricks::new(&lattice(), view, interpolant, 0.7).expect("a march");
            let (expected, _) = traced(&march, &field, &[]);
            let nodes = [[0; 3], DIMS];
            let mut known = Known(part(&march, &field, nodes), None, 0.into());
            for parallel in [false, true] {
                known.1 = Some(march.undisturbed(&known.0, parallel));
                let exit =
                    |start: &Start| match march.advance(start, &mut RayState::default(), &known) {
                        Progress::Left(exit) => exit,
                        Progress::NeedsCell(cell) => panic!("{cell:?} is there"),
                    };
                let exits: Vec<_> = starts().iter().map(exit).collect();
                assert!(exits == expected, "{interpolant:?}");
            }
            let skipped = known.2.into_inner();
            assert!(skipped > 1000, "{skipped} samples were not taken");
            // A brick may have fewer cells than a block, and begin anywhere.
            let thin = part(&march, &field, [[3, 2, 5], [9, 9, 9]]);
            let cells = march.undisturbed(&thin, false);
            let [low, end] = thin.cells;
            for x in low[0]..end[0] {
                for y in low[1]..end[1] {
                    for z in low[2]..end[2] {
                        let corner = DVec3::new(x as f64, y as f64, z as f64);
                        let at = |d: f64| still((corner + d) * DVec3::from(SPACING_M));
                        let is_still = at(0.0) == 0.0 && at(1.0) == 0.0;
                        assert!(is_still || !cells.contains([x, y, z]));
                    }
                }
            }
        }
    }
}

#[test]
fn a_corner_without_gas_beside_the_stencil_does_not_end_light() {
    // Samples read rows of four nodes, also where only the middle two have weights.
    let field = field();
    let view = views()[0];
    let march =
        InBricks::new(&lattice(), view, Interpolant::TrilinearGradient, 1.0).expect("a march");
    let hole = [4, 9, 11];
    struct Holed<'a>(&'a Field, [usize; 3]);
    impl Brick for Holed<'_> {
        fn cells(&self) -> [[usize; 3]; 2] {
            [[0; 3], DIMS.map(|n| n - 1)]
        }
        fn eps(&self, node: [usize; 3]) -> f64 {
            let [i, j, k] = node;
            let value = f64::from(self.0.eps()[(k * DIMS[1] + j) * DIMS[0] + i]);
            if node == self.1 { f64::NAN } else { value }
        }
    }
    let exit_at = |cell: [f64; 2], brick: &Holed<'_>| {
        let at_m = [cell[0] * SPACING_M[0], cell[1] * SPACING_M[1]];
        let centre_m = field.centre_m();
        let position_m = [(at_m[0] - centre_m.x) as f32, (at_m[1] - centre_m.y) as f32];
        let start = Start { position_m, tilt_rad: [0.0; 2] };
        match march.advance(&start, &mut RayState::default(), brick) {
            Progress::Left(exit) => exit,
            Progress::NeedsCell(cell) => panic!("{cell:?} is there"),
        }
    };
    let (whole, holed) = (Holed(&field, [usize::MAX; 3]), Holed(&field, hole));
    // The hole is a corner of the 4 x 4 nodes around these rays, with no weight.
    for cell in [[5.4, 10.4], [2.6, 10.4], [5.4, 7.6], [2.6, 7.6]] {
        assert_eq!(exit_at(cell, &holed), exit_at(cell, &whole), "{cell:?}");
        assert_eq!(exit_at(cell, &holed).status, Status::Free);
    }
    // Here it has one.
    for cell in [[4.4, 10.4], [5.4, 9.4], [3.6, 8.6]] {
        assert_eq!(exit_at(cell, &holed).status, Status::Masked, "{cell:?}");
    }
}

#[test]
fn exits_are_those_of_the_march_of_one_process() {
    let field = field();
    for interpolant in [Interpolant::Trilinear, Interpolant::TrilinearGradient] {
        for view in views() {
            let march = InBricks::new(&lattice(), view, interpolant, 1.0).expect("a march");
            let (exits, _) = traced(&march, &field, &[9]);
            let quantities = PathQuantities { opd: true };
            let options = Options { quantities, ..Options::default() };
            let paths = Deviational::new(&field, view, interpolant, options);
            let mut expected = vec![Exit::UNDISTURBED; exits.len()];
            paths.trace(&starts(), &mut expected);
            let mut largest = [0.0_f32; 3];
            for (a, b) in exits.iter().zip(&expected) {
                let all = |e: &Exit| [e.deflection_rad[0], e.deflection_rad[1], e.opd_m];
                for (k, (a, b)) in all(a).into_iter().zip(all(b)).enumerate() {
                    // Those sum in f32, with gradients of 24 bits: 1e-6 of the largest values here.
                    let tolerance = [4e-9, 4e-9, 4e-12][k];
                    assert!((a - b).abs() < tolerance, "{interpolant:?} {k}: {a} {b}");
                    largest[k] = largest[k].max(b.abs());
                }
                let moved = (a.displacement_m[0] - b.displacement_m[0]).abs();
                assert!(moved < 1e-10 && a.exit_depth_m == b.exit_depth_m, "{moved}");
            }
            assert!(largest[0] > 1e-4 && largest[2] > 2e-7, "there is light to bend: {largest:?}");
        }
    }
}

#[test]
fn light_ends_where_there_is_no_gas_and_goes_on_beside_it() {
    let mut eps = field().eps().to_vec();
    eps[(11 * DIMS[1] + 7) * DIMS[0] + 9] = f32::NAN;
    struct Holed(Vec<f32>);
    impl Brick for Holed {
        fn cells(&self) -> [[usize; 3]; 2] {
            [[0; 3], DIMS.map(|n| n - 1)]
        }
        fn eps(&self, [i, j, k]: [usize; 3]) -> f64 {
            f64::from(self.0[(k * DIMS[1] + j) * DIMS[0] + i])
        }
    }
    let view = views()[0];
    let march = InBricks::new(&lattice(), view, Interpolant::Trilinear, 1.0).expect("a march");
    let holed = Holed(eps);
    let outcome = |x: f32| {
        let start = Start { position_m: [x, 0.0], tilt_rad: [0.0; 2] };
        march.advance(&start, &mut RayState::default(), &holed)
    };
    let Progress::Left(exit) = outcome(2e-4) else { panic!("it has all cells") };
    assert_eq!((exit.status, exit.transmission), (Status::Masked, 0.0));
    let Progress::Left(exit) = outcome(5e-3) else { panic!("it has all cells") };
    assert_eq!((exit.status, exit.transmission), (Status::Free, 1.0));
}

#[test]
fn what_cannot_be_marched_through_is_refused_by_name() {
    let view = views()[0];
    let refused = |lattice: Lattice, interpolant, step| {
        InBricks::new(&lattice, view, interpolant, step).expect_err("refused").to_string()
    };
    let linear = Interpolant::Trilinear;
    let whole = lattice();
    assert!(refused(whole, Interpolant::BSpline, 1.0).contains("spline"));
    for step in [0.0, -1.0, f64::NAN, 9.0] {
        assert!(refused(whole, linear, step).contains("step_voxels"));
    }
    let thin = Lattice { dims: [4, 1, 4], ..whole };
    assert!(refused(thin, linear, 1.0).contains("1 node(s) along y"));
    let flat = Lattice { spacing_m: [1.0, 1.0, f64::NAN], ..whole };
    assert!(refused(flat, linear, 1.0).contains("along z"));
    assert!(refused(Lattice { n0: f64::INFINITY, ..whole }, linear, 1.0).contains("n0"));
    let march = InBricks::new(&whole, view, linear, 1.0).expect("a march");
    let state = RayState { samples: march.most_samples(), ..RayState::default() };
    assert!(!march.is_possible(&Start::default(), &state));
    assert!(march.is_possible(&Start::default(), &RayState::default()));
}
