//! Evaluators: vertices that the driver makes of maps of control points (OpenGL 1.1, section 5.1), made by us.
//!
//! The driver keeps the maps. It is asked for those that are on when vertices come of them, and again after calls that may have changed them. What comes out
//! goes the way of other vertices of immediate mode, and leaves what is current alone.

mod bernstein;
mod casteljau;
mod maps;

use crate::capture::display_lists::Op;
use crate::classify::rules::Verdict;
use crate::interpose::context::{Context, Sink};
use crate::interpose::driver::gl;
use crate::interpose::symbols;
use crate::state::enums::*;
pub(crate) use maps::Kind;
use maps::{Evaluated, Maps};

/// Points in a row of a mesh; with more the driver is left alone.
const MOST_IN_ROW: i64 = 1 << 20;
const POINT: u32 = 0x1b00;
const LINE: u32 = 0x1b01;

/// The grid that `glEvalPoint` and `glEvalMesh` count in.
#[derive(Debug, Clone, Copy, Default)]
struct Grid {
    first: [f32; 2],
    step: [f32; 2],
}

impl Grid {
    fn query(kind: Kind) -> Grid {
        let (domain, segments) = match kind {
            Kind::Curve => (MAP1_GRID_DOMAIN, MAP1_GRID_SEGMENTS),
            Kind::Surface => (MAP2_GRID_DOMAIN, MAP2_GRID_SEGMENTS),
        };
        let (ends, n) = (gl::floats::<4>(domain), gl::ints::<2>(segments));
        Grid {
            first: [ends[0], ends[2]],
            step: std::array::from_fn(|k| (ends[2 * k + 1] - ends[2 * k]) / n[k].max(1) as f32),
        }
    }

    fn at(&self, places: [i32; 2]) -> [f32; 2] {
        std::array::from_fn(|k| places[k] as f32 * self.step[k] + self.first[k])
    }
}

/// What we know of the driver's maps and grids: curves, and surfaces.
#[derive(Default)]
pub(crate) struct Evaluators {
    maps: [Option<Maps>; 2],
    grids: [Option<Grid>; 2],
}

impl Evaluators {
    /// Maps may be others from now on.
    pub(crate) fn forget(&mut self) {
        *self = Evaluators::default();
    }

    fn maps(&mut self, kind: Kind) -> &Maps {
        self.maps[kind as usize].get_or_insert_with(|| Maps::query(kind))
    }

    fn grid(&mut self, kind: Kind) -> Grid {
        *self.grids[kind as usize].get_or_insert_with(|| Grid::query(kind))
    }
}

impl Context {
    /// `glMap` and `glMapGrid`.
    pub(crate) fn maps_change(&mut self) -> bool {
        match self.sink {
            // An error, which the driver is to report.
            Sink::Trace => self.unswallow("a map between Begin and End"),
            Sink::List => {
                if let Some(r) = &mut self.recording {
                    r.note_map();
                }
            }
            Sink::Pass | Sink::Outside => {}
        }
        self.evaluators.forget();
        false
    }

    /// The draw that comes goes into the driver's piece of the list that is compiled.
    fn put_into_driver_piece(&mut self) {
        if let Some(r) = &mut self.recording {
            r.note_driver_call(0, true, true);
        }
    }

    /// `glEvalCoord`.
    pub(crate) fn eval_coord(&mut self, kind: Kind, at: [f32; 2]) -> bool {
        match self.sink {
            Sink::Trace => self.eval_vertex(kind, at),
            Sink::List => self.list_op(Op::EvalCoord(kind, at)),
            Sink::Pass | Sink::Outside => false,
        }
    }

    /// `glEvalPoint`.
    pub(crate) fn eval_point(&mut self, kind: Kind, places: [i32; 2]) -> bool {
        match self.sink {
            Sink::Trace => {
                let at = self.evaluators.grid(kind).at(places);
                self.eval_vertex(kind, at)
            }
            Sink::List => self.list_op(Op::EvalPoint(kind, places)),
            Sink::Pass | Sink::Outside => false,
        }
    }

    /// A vertex of a primitive that is traced.
    fn eval_vertex(&mut self, kind: Kind, at: [f32; 2]) -> bool {
        let maps = self.evaluators.maps(kind);
        if let Some(why) = maps.unfollowed() {
            self.unswallow(why);
            return false;
        }
        let Some(e) = maps.at(at) else { return true };
        if !self.take_evaluated(&e) {
            return false;
        }
        // The next `glVertex` has what is current.
        let c = self.current;
        if e.normal.is_some() {
            self.recorder.set_normal(c.normal);
        }
        if e.color.is_some() {
            self.recorder.set_color(c.color);
        }
        if e.tex.is_some() {
            self.recorder.set_tex(c.tex);
        }
        true
    }

    /// Records a vertex. When that cannot be, the driver has what there is of the primitive, and false comes back.
    fn take_evaluated(&mut self, e: &Evaluated) -> bool {
        let [x, y, z, w] = e.position;
        let mut with = self.current;
        with.color = e.color.unwrap_or(with.color);
        with.normal = e.normal.unwrap_or(with.normal);
        with.tex = e.tex.unwrap_or(with.tex);
        if !(w > 0.0 && w.is_finite()) {
            self.unswallow("vertices with w not positive");
            return false;
        }
        if let Verdict::TraceIfOpaque(why) = self.verdict
            && !self.is_opaque_with(with.color)
        {
            self.unswallow(why);
            return false;
        }
        if e.normal.is_some() {
            self.recorder.set_normal(with.normal);
        }
        if e.color.is_some() {
            self.recorder.set_color(with.color);
        }
        if e.tex.is_some() {
            self.recorder.set_tex(with.tex);
        }
        self.recorder.vertex(if w == 1.0 { [x, y, z] } else { [x / w, y / w, z / w] }, &with);
        true
    }

    /// `glEvalMesh1`: points or lines, which are the driver's.
    pub(crate) fn eval_mesh_1(&mut self, mode: u32) -> bool {
        match self.sink {
            Sink::Trace => self.unswallow("a mesh between Begin and End"),
            Sink::List => self.put_into_driver_piece(),
            Sink::Outside => {
                if matches!(mode, POINT | LINE) && self.has_vertices(Kind::Curve) {
                    self.passing("lines and points", false);
                }
            }
            Sink::Pass => {}
        }
        false
    }

    /// Something comes out of `glEvalMesh`.
    fn has_vertices(&mut self, kind: Kind) -> bool {
        if self.can.core || self.can.es {
            return false;
        }
        self.refresh();
        self.evaluators.maps(kind).has_vertices()
    }

    /// `glEvalMesh2` from `i1` to `i2` and `j1` to `j2`.
    pub(crate) fn eval_mesh_2(&mut self, mode: u32, range: [i32; 4]) -> bool {
        let filled = mode == FILL;
        match self.sink {
            Sink::Trace => {
                // An error, which the driver is to report.
                self.unswallow("a mesh between Begin and End");
                return false;
            }
            Sink::Pass => return false,
            Sink::List if filled => return self.list_op(Op::EvalMesh(range)),
            Sink::List => {
                self.put_into_driver_piece();
                return false;
            }
            Sink::Outside => {}
        }
        let [i1, i2, j1, j2] = range.map(i64::from);
        if !matches!(mode, POINT | LINE | FILL) || i1 > i2 || j1 > j2 || !self.has_vertices(Kind::Surface) {
            return false;
        }
        let verdict = self.verdict();
        let opaque = self.is_opaque_now();
        let maps = self.evaluators.maps(Kind::Surface);
        let why = match verdict {
            _ if !filled => Some("lines and points"),
            Verdict::Pass(why) => Some(why),
            Verdict::TraceIfOpaque(why) if !maps.has_colors() && !opaque => Some(why),
            _ if self.state.program != 0 => Some("evaluators with a program"),
            _ if i2 - i1 > MOST_IN_ROW => Some("a mesh with too many points in a row"),
            _ => maps.unfollowed(),
        };
        if let Some(why) = why {
            self.passing(why, filled);
            return false;
        }
        if verdict == Verdict::TraceInOrder {
            self.flush("a draw whose order matters");
        }
        symbols::attend();
        self.trace_mesh(range);
        if verdict == Verdict::TraceInOrder {
            self.end_batch();
        }
        true
    }

    /// Rows of a mesh as Mesa draws them: parameters are summed up, and quads are split as strips of triangles are.
    fn trace_mesh(&mut self, [i1, i2, j1, j2]: [i32; 4]) {
        let Grid { first, step } = self.evaluators.grid(Kind::Surface);
        let mut along = Vec::new();
        let mut u = first[0] + i1 as f32 * step[0];
        for _ in i1..=i2 {
            along.push(u);
            u += step[0];
        }
        let mut v = first[1] + j1 as f32 * step[1];
        let mut lower = self.row(&along, v);
        for _ in j1..j2 {
            let upper = self.row(&along, v + step[1]);
            self.trace_strip(&along, [v, v + step[1]], [&lower, &upper]);
            lower = upper;
            v += step[1];
        }
        // The next Begin takes up what is current.
        self.recorder.behind = true;
    }

    fn row(&mut self, along: &[f32], v: f32) -> Vec<Evaluated> {
        let maps = self.evaluators.maps(Kind::Surface);
        along.iter().filter_map(|u| maps.at([*u, v])).collect()
    }

    fn trace_strip(&mut self, along: &[f32], across: [f32; 2], rows: [&[Evaluated]; 2]) {
        self.recorder.begin(TRIANGLE_STRIP, &self.current);
        self.sink = Sink::Trace;
        for ((u, lower), upper) in along.iter().zip(rows[0]).zip(rows[1]) {
            for (v, e) in across.iter().zip([lower, upper]) {
                if self.sink != Sink::Trace || !self.take_evaluated(e) {
                    gl::eval_coord2f(*u, *v);
                }
            }
        }
        match self.sink {
            Sink::Trace => self.recorder.end(),
            _ => gl::end(),
        }
        self.sink = Sink::Outside;
    }
}
