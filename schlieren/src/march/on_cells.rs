//! Traces light through the cells of a mesh, one ray at a time in `f64`.
//!
//! A ray crosses one cell after the other. The piece in a cell is one step or some equal ones of
//! position Verlet: half of the way, the kick of the gradient there, the other half. Steps end at
//! the faces, where the gradient of the cells may jump, so that none has samples of one side for a
//! way on the other.
//!
//! Where a cell ends at the border of the mesh, the ray goes on straight to the cell that it enters
//! next. A stretch between is that of a hole, a body, or a gap between blocks. Gaps are shorter
//! than a thousandth of a cell and change nothing; others are as [`GasOnCells`] says. A ray along
//! the span of a flow may pass a body without meeting a cell; the nearest walls tell.

use super::frame::{BlankCells, clip};
use super::integrator::Ray;
use crate::field::Node;
use crate::gas_on_cells::GasOnCells;
use crate::path::{Exit, LightPaths, PathQuantities, Start, Status};
use crate::view::View;
use datasets::resample::{Beyond, CellWalker};
use glam::DVec3;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Longest gap between blocks, in sizes of the cell before it, as in resampling.
const GAP: f64 = 1e-3;
/// How far a bent ray may be beside the face that its straight piece left through, in sizes of the
/// cell.
const SLACK: f64 = 1e-6;
/// A ray that gets farther by less than this, in sizes of the cell, makes no progress.
const NO_PROGRESS: f64 = 1e-9;
/// After so many pieces without progress, rounding leads a ray round an edge.
const STUCK: u32 = 256;
/// How far a ray without a way out is moved on, in sizes of the cell.
const MOVED_ON: f64 = 1e-5;
/// Cells that a ray crosses, at most, and the length of its path in diagonals of the box.
const MOST_PIECES: u32 = 4_000_000;
const MOST_DIAGONALS: f64 = 8.0;

/// Counts of the work of tracing on cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct CellCounters {
    /// Rays traced.
    pub rays: u64,
    /// Cells that they crossed.
    pub cells_crossed: u64,
    /// Samples taken.
    pub samples: u64,
    /// Gaps between blocks that were crossed.
    pub gaps: u64,
    /// Rays at an edge without a way out by rounding, which were moved on by a hundred-thousandth
    /// of a cell.
    pub moved_on: u64,
}

/// The work of all tracing so far, counted from all threads.
#[derive(Debug, Default)]
pub(crate) struct CellWork {
    rays: AtomicU64,
    cells_crossed: AtomicU64,
    samples: AtomicU64,
    gaps: AtomicU64,
    moved_on: AtomicU64,
}

impl CellWork {
    fn add(&self, c: &CellCounters) {
        for (sum, n) in [
            (&self.rays, c.rays),
            (&self.cells_crossed, c.cells_crossed),
            (&self.samples, c.samples),
            (&self.gaps, c.gaps),
            (&self.moved_on, c.moved_on),
        ] {
            sum.fetch_add(n, Ordering::Relaxed);
        }
    }

    pub(crate) fn counters(&self) -> CellCounters {
        let read = |n: &AtomicU64| n.load(Ordering::Relaxed);
        CellCounters {
            rays: read(&self.rays),
            cells_crossed: read(&self.cells_crossed),
            samples: read(&self.samples),
            gaps: read(&self.gaps),
            moved_on: read(&self.moved_on),
        }
    }
}

/// Light paths through the cells of a mesh.
pub struct OnCells<'a> {
    gas: &'a GasOnCells,
    view: View,
    quantities: PathQuantities,
    steps_per_cell: u32,
    low_m: DVec3,
    size_m: DVec3,
    typical_cell_m: f64,
    /// Whether the values are those of polynomials of second degree.
    to_second_degree: bool,
    /// Walkers that no thread uses now.
    walkers: Mutex<Vec<CellWalker<'a>>>,
    work: Arc<CellWork>,
}

impl<'a> OnCells<'a> {
    /// Paths with this many steps in each cell.
    pub fn new(
        gas: &'a GasOnCells,
        view: View,
        quantities: PathQuantities,
        steps_per_cell: u32,
    ) -> OnCells<'a> {
        let (low_m, high_m) = gas.cells().bounds();
        OnCells {
            gas,
            view,
            quantities,
            steps_per_cell: steps_per_cell.max(1),
            low_m,
            size_m: high_m - low_m,
            typical_cell_m: gas.cells().typical_cell(),
            to_second_degree: false,
            walkers: Mutex::default(),
            work: Arc::default(),
        }
    }

    /// The same paths through less accurate values, which tell how accurate the mesh is
    /// ([`datasets::resample::CellField::walker_for_error_estimate`]).
    #[must_use]
    pub(crate) fn with_second_degree(self) -> OnCells<'a> {
        OnCells { to_second_degree: true, ..self }
    }

    /// The work of all tracing so far.
    pub fn counters(&self) -> CellCounters {
        self.work.counters()
    }

    pub(crate) fn work(&self) -> Arc<CellWork> {
        Arc::clone(&self.work)
    }

    fn trace_one(
        &self,
        start: &Start,
        [right, up, direction]: [DVec3; 3],
        walker: &mut CellWalker<'a>,
        counters: &mut CellCounters,
    ) -> Exit {
        let [x, y] = start.position_m.map(f64::from);
        let at_m = self.view.centre_m + self.view.right * x + self.view.up * y;
        let [near_m, far_m] = clip(at_m - self.low_m, direction, self.size_m);
        counters.rays += 1;
        if near_m >= far_m {
            let opd_m = if self.quantities.opd { 0.0 } else { f32::NAN };
            return Exit { opd_m, ..Exit::UNDISTURBED };
        }
        let length_m = far_m - near_m;
        let ray = Ray::new(at_m + direction * near_m, direction);
        let mut piecewise = Piecewise { paths: self, walker, counters, ray };
        let end = piecewise.run();
        let mut r = piecewise.ray;
        let (node, mut status) = match end {
            End::Left => (Node::Gas, Status::Free),
            End::Stopped(node) => (node, Status::Free),
            End::Trapped => (Node::Gas, Status::Turned),
        };
        let mut transmission = 1.0;
        if node != Node::Gas {
            (transmission, status) = BlankCells::Opaque.outcome(node as u8);
        }
        let mut depth_m = length_m;
        if status == Status::Free {
            // Straight to the plane through the undisturbed ray's exit.
            let towards = 1.0 + r.u.dot(direction);
            if towards > 0.0 && r.position_m().is_finite() {
                r.drift((length_m - r.depth_m()) / towards);
            } else {
                (status, depth_m) = (Status::Turned, r.depth_m());
            }
        }
        if status != Status::Free {
            return Exit {
                exit_depth_m: (near_m + depth_m) as f32,
                opd_m: f32::NAN,
                transmission: if status == Status::Free { transmission } else { 0.0 },
                status,
                ..Exit::UNDISTURBED
            };
        }
        let opd =
            if self.quantities.opd { self.gas.n0() * r.path_difference_m() } else { f64::NAN };
        Exit {
            deflection_rad: [r.u.dot(right) as f32, r.u.dot(up) as f32],
            displacement_m: [r.xi_m.dot(right) as f32, r.xi_m.dot(up) as f32],
            exit_depth_m: far_m as f32,
            opd_m: opd as f32,
            transmission,
            status,
        }
    }

    fn beam_of(&self, start: &Start, known: &mut Option<([f32; 2], [DVec3; 3])>) -> [DVec3; 3] {
        match known {
            Some((tilt, beam)) if *tilt == start.tilt_rad => *beam,
            _ => known.insert((start.tilt_rad, self.view.beam(start.tilt_rad))).1,
        }
    }

    /// Calls `trace` with a walker and counters.
    fn with_walker(&self, trace: impl FnOnce(&mut CellWalker<'a>, &mut CellCounters)) {
        let lock = || self.walkers.lock().unwrap_or_else(PoisonError::into_inner);
        let free = lock().pop();
        let cells = self.gas.cells();
        let mut walker = free.unwrap_or_else(|| match self.to_second_degree {
            true => cells.walker_for_error_estimate(),
            false => cells.walker(),
        });
        let mut counters = CellCounters::default();
        trace(&mut walker, &mut counters);
        self.work.add(&counters);
        lock().push(walker);
    }
}

/// How a ray's way through the cells ends.
enum End {
    /// It left the last cell.
    Left,
    /// In a solid or blank place.
    Stopped(Node),
    /// It goes round in the mesh.
    Trapped,
}

/// One ray on its way.
struct Piecewise<'p, 'a> {
    paths: &'p OnCells<'a>,
    walker: &'p mut CellWalker<'a>,
    counters: &'p mut CellCounters,
    ray: Ray,
}

impl Piecewise<'_, '_> {
    fn run(&mut self) -> End {
        let mut slack_m = SLACK * self.paths.typical_cell_m;
        let mut gap_m = GAP * self.paths.typical_cell_m;
        let most_m = MOST_DIAGONALS * self.paths.size_m.length();
        let (mut stuck, mut farthest_m) = (0, f64::NEG_INFINITY);
        let (mut from, mut inside) = (Beyond::Outside, Beyond::Outside);
        for _ in 0..MOST_PIECES {
            let w = self.ray.w();
            let speed = w.length();
            let direction = w / speed;
            let at_m = self.ray.position_m();
            if !(self.ray.tau_m <= most_m && at_m.is_finite()) {
                break;
            }
            let Beyond::Cell(cell) = inside else {
                match self.next_cell(direction, speed, [from, inside], slack_m, gap_m) {
                    Ok(cell) => (from, inside) = (inside, Beyond::Cell(cell)),
                    Err(end) => return end,
                }
                continue;
            };
            let size_m = self.walker.size(cell);
            (slack_m, gap_m) = (SLACK * size_m, GAP * size_m);
            let way = self.walker.leave(cell, at_m, direction, from).filter(|_| stuck < STUCK);
            let Some((length_m, beyond)) = way else {
                self.counters.moved_on += 1;
                self.ray.drift(MOVED_ON * size_m / speed);
                let near = self.walker.near(cell, self.ray.position_m());
                (stuck, from) = (0, Beyond::Outside);
                inside = near.map_or(Beyond::Outside, Beyond::Cell);
                continue;
            };
            if length_m != 0.0 && !self.cross(cell, length_m / speed) {
                return End::Stopped(Node::Blank);
            }
            // Where cells are inside out, a ray goes back and forth.
            let progress = self.ray.tau_m > farthest_m + NO_PROGRESS * size_m;
            (stuck, farthest_m) =
                if progress { (0, self.ray.tau_m) } else { (stuck + 1, farthest_m) };
            (from, inside) = (inside, beyond);
        }
        End::Trapped
    }

    /// Crosses a cell. False when it has no values.
    fn cross(&mut self, cell: u32, dtau_m: f64) -> bool {
        self.counters.cells_crossed += 1;
        let steps = self.paths.steps_per_cell;
        let half_m = 0.5 * dtau_m / f64::from(steps);
        for _ in 0..steps {
            self.ray.drift(half_m);
            self.counters.samples += 1;
            let sample = self.walker.sample(cell, self.ray.position_m());
            let (eps, gradient) = self.paths.gas.eps(sample);
            if !(eps.is_finite() && gradient.is_finite()) {
                return false;
            }
            self.ray.u += gradient * ((1.0 + eps) * 2.0 * half_m);
            self.ray.excess_m += eps * (2.0 + eps) * 2.0 * half_m;
            self.ray.drift(half_m);
        }
        true
    }

    /// Goes on straight to the next cell. `last` is the cell that the ray left, if it did, and
    /// `before` what was beyond.
    fn next_cell(
        &mut self,
        direction: DVec3,
        speed: f64,
        [last, before]: [Beyond; 2],
        slack_m: f64,
        gap_m: f64,
    ) -> Result<u32, End> {
        let gas = self.paths.gas;
        let at_m = self.ray.position_m();
        let entry = self.walker.enter(at_m, direction, f64::INFINITY, slack_m);
        if let (Beyond::Cell(last), Beyond::Wall, Some(entry)) = (last, before, entry)
            && gas.walls != Node::Gas
            && self.walker.has_baffle(last, entry.cell)
        {
            return Err(End::Stopped(gas.walls));
        }
        // Beyond the box is the reference medium.
        let left_m = clip(at_m - self.paths.low_m, direction, self.paths.size_m)[1].max(0.0);
        let stretch_m = entry.map_or(left_m, |e| e.distance);
        if stretch_m > gap_m {
            let ends = [before, entry.map_or(Beyond::Outside, |e| e.from)];
            let met = self.on_stretch(at_m, direction, [stretch_m, slack_m, gap_m], ends);
            if met != Node::Gas {
                return Err(End::Stopped(met));
            }
        } else if entry.is_some_and(|e| e.distance > 0.0) {
            self.counters.gaps += u64::from(self.ray.tau_m > 0.0);
        }
        let (mut entry, mut speed) = (entry, speed);
        if stretch_m > gap_m && entry.is_some() {
            // The way is through the reference medium.
            self.set_index(0.0);
            let w = self.ray.w();
            speed = w.length();
            entry = self.walker.enter(at_m, w / speed, f64::INFINITY, slack_m);
        }
        let Some(entry) = entry else {
            self.set_index(0.0);
            return Err(End::Left);
        };
        self.ray.drift(entry.distance / speed);
        let sample = self.walker.sample(entry.cell, self.ray.position_m());
        let (eps, _) = gas.eps(sample);
        if !eps.is_finite() {
            return Err(End::Stopped(Node::Blank));
        }
        self.counters.samples += 1;
        self.set_index(eps);
        Ok(entry.cell)
    }

    /// What a stretch outside the cells meets: a body before blank places, and these before gas.
    /// `ends` is what the faces say between which it lies. Gaps between hidden cells are none, as
    /// those between blocks of gas.
    fn on_stretch(
        &self,
        at_m: DVec3,
        direction: DVec3,
        [length_m, slack_m, gap_m]: [f64; 3],
        ends: [Beyond; 2],
    ) -> Node {
        let gas = self.paths.gas;
        let at_end = |end: Beyond| match end {
            Beyond::Hidden => gas.hidden,
            Beyond::Wall => gas.walls,
            Beyond::Cell(_) | Beyond::Outside => gas.outside,
        };
        let hidden = ends.map(|end| end == Beyond::Hidden);
        let pieces = self.walker.beside_hidden(at_m, direction, length_m, slack_m, hidden);
        let beside_m: f64 = pieces.iter().map(|[from, to]| to - from).sum();
        let is_hidden = hidden.contains(&true) || length_m - beside_m > gap_m;
        let mut met = if is_hidden { gas.hidden } else { Node::Gas };
        for [from_m, to_m] in pieces {
            if met == Node::Solid {
                break;
            }
            if to_m - from_m <= gap_m {
                continue;
            }
            let [first, last] = [from_m <= 0.0, to_m >= length_m];
            let of_ends = [(first, ends[0]), (last, ends[1]), (!first && !last, Beyond::Outside)];
            for end in of_ends.into_iter().filter(|e| e.0) {
                met = worst(met, at_end(end.1));
            }
            // Where no face tells of a body, one may be between.
            if met != Node::Solid && gas.walls != gas.outside {
                let (from, long_m) = (at_m + direction * from_m, to_m - from_m);
                if self.walker.passes_body(from, direction, long_m) {
                    met = worst(met, gas.walls);
                }
            }
        }
        met
    }

    /// Makes the length of w that of the medium, 1 + eps, as a window across the undisturbed ray
    /// does: the parts of w along the window stay.
    fn set_index(&mut self, eps: f64) {
        let w = self.ray.w();
        let along = w.dot(self.ray.direction);
        let across = w - self.ray.direction * along;
        let square = (1.0 + eps).powi(2) - across.length_squared();
        if square > 0.0 {
            // u = along − 1 without the difference of large numbers.
            let new = square.sqrt() * along.signum();
            let change = (eps * (2.0 + eps) - across.length_squared()) / (1.0 + square.sqrt());
            let u_along = if along > 0.0 { change } else { new - 1.0 };
            self.ray.u = across + self.ray.direction * u_along;
        }
    }
}

impl LightPaths for OnCells<'_> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        self.with_walker(|walker, counters| {
            let mut known = None;
            for (start, exit) in starts.iter().zip(exits) {
                let beam = self.beam_of(start, &mut known);
                *exit = self.trace_one(start, beam, walker, counters);
            }
        });
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn quantities(&self) -> PathQuantities {
        self.quantities
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * self.typical_cell_m
    }

    /// In the order of small squares of the image, whose rays pass the same cells.
    fn trace_parallel(&self, starts: &[Start], exits: &mut [Exit]) {
        use rayon::prelude::*;
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        const CHUNK: usize = 1024;
        let size_m = self.size_m.length().max(f64::MIN_POSITIVE) as f32;
        let key = |s: &Start| {
            let [x, y] = s.position_m.map(|p| ((p / size_m + 1.0) * 32768.0) as u16);
            spread_bits(x) | spread_bits(y) << 1
        };
        let mut order: Vec<(u32, u32)> = starts.iter().zip(0..).map(|(s, i)| (key(s), i)).collect();
        order.par_sort_unstable();
        let traced: Vec<Vec<Exit>> = order
            .par_chunks(CHUNK)
            .map(|chunk| {
                let near: Vec<Start> = chunk.iter().map(|(_, i)| starts[*i as usize]).collect();
                let mut exits = vec![Exit::UNDISTURBED; near.len()];
                self.trace(&near, &mut exits);
                exits
            })
            .collect();
        for ((_, i), exit) in order.iter().zip(traced.iter().flatten()) {
            exits[*i as usize] = *exit;
        }
    }
}

/// A body before a blank place, and this before gas.
fn worst(one: Node, other: Node) -> Node {
    let met = [one, other];
    [Node::Solid, Node::Blank].into_iter().find(|n| met.contains(n)).unwrap_or(Node::Gas)
}

/// The bits of a number with a zero between every two: half of a Morton code.
fn spread_bits(x: u16) -> u32 {
    let mut x = u32::from(x);
    x = (x | x << 8) & 0x00ff_00ff;
    x = (x | x << 4) & 0x0f0f_0f0f;
    x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}
