//! Evaluators: vertices from maps of control points (OpenGL 1.1, section 5.1), which the driver
//! would otherwise compute.
//!
//! The driver keeps the maps. The enabled ones are queried when vertices are evaluated, and again
//! after calls that may have changed them. The results are recorded like other vertices of
//! immediate mode and leave the current values alone.

mod bernstein;
mod casteljau;
mod maps;

use crate::capture::ImmediateModeTarget;
use crate::classify::rules::Classification;
use crate::driver::gl;
use crate::enums::*;
use crate::interpose::context::Context;
use crate::interpose::flush_reason::FlushReason;
use crate::watched_calls;
pub(crate) use maps::MapKind;
use maps::{EvaluatedVertex, EvaluatorMaps};

/// The most points in a row of a mesh. The driver draws longer rows.
const MOST_IN_ROW: i64 = 1 << 20;

/// The grid of `glEvalPoint` and `glEvalMesh`.
#[derive(Debug, Clone, Copy, Default)]
struct EvaluatorGrid {
    first: [f32; 2],
    step: [f32; 2],
}

impl EvaluatorGrid {
    fn query(kind: MapKind) -> EvaluatorGrid {
        let (domain, segments) = match kind {
            MapKind::Curve => (MAP1_GRID_DOMAIN, MAP1_GRID_SEGMENTS),
            MapKind::Surface => (MAP2_GRID_DOMAIN, MAP2_GRID_SEGMENTS),
        };
        let (ends, n) = (gl::floats::<4>(domain), gl::ints::<2>(segments));
        EvaluatorGrid {
            first: [ends[0], ends[2]],
            step: std::array::from_fn(|k| (ends[2 * k + 1] - ends[2 * k]) / n[k].max(1) as f32),
        }
    }

    fn at(&self, places: [i32; 2]) -> [f32; 2] {
        std::array::from_fn(|k| places[k] as f32 * self.step[k] + self.first[k])
    }
}

/// The driver's maps and grids as far as they are known: of curves, and of surfaces.
#[derive(Default)]
pub(crate) struct Evaluators {
    maps: [Option<EvaluatorMaps>; 2],
    grids: [Option<EvaluatorGrid>; 2],
}

impl Evaluators {
    /// The maps may have changed.
    pub(crate) fn forget(&mut self) {
        *self = Evaluators::default();
    }

    fn maps(&mut self, kind: MapKind) -> &EvaluatorMaps {
        self.maps[kind as usize].get_or_insert_with(|| EvaluatorMaps::query(kind))
    }

    fn grid(&mut self, kind: MapKind) -> EvaluatorGrid {
        *self.grids[kind as usize].get_or_insert_with(|| EvaluatorGrid::query(kind))
    }
}

impl Context {
    /// `glMap` and `glMapGrid`.
    pub(crate) fn invalidate_maps(&mut self) -> bool {
        match self.capture.immediate_target {
            // An error, which the driver reports.
            ImmediateModeTarget::Trace => self.replay_to_driver("a map between Begin and End"),
            ImmediateModeTarget::List => {
                if let Some(r) = &mut self.capture.recording {
                    r.note_map();
                }
            }
            ImmediateModeTarget::Pass | ImmediateModeTarget::Outside => {}
        }
        self.capture.evaluators.forget();
        false
    }

    /// `glEvalCoord`.
    pub(crate) fn eval_coord(&mut self, kind: MapKind, at: [f32; 2]) -> bool {
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace => self.eval_vertex(kind, at),
            ImmediateModeTarget::List => self.capture.list_eval_coord(kind, at),
            ImmediateModeTarget::Pass | ImmediateModeTarget::Outside => false,
        }
    }

    /// `glEvalPoint`.
    pub(crate) fn eval_point(&mut self, kind: MapKind, places: [i32; 2]) -> bool {
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace => {
                let at = self.capture.evaluators.grid(kind).at(places);
                self.eval_vertex(kind, at)
            }
            ImmediateModeTarget::List => self.capture.list_eval_point(kind, places),
            ImmediateModeTarget::Pass | ImmediateModeTarget::Outside => false,
        }
    }

    /// A vertex of a primitive that is traced.
    fn eval_vertex(&mut self, kind: MapKind, at: [f32; 2]) -> bool {
        let maps = self.capture.evaluators.maps(kind);
        if let Some(why) = maps.unsupported() {
            self.replay_to_driver(why);
            return false;
        }
        let Some(e) = maps.at(at) else { return true };
        if !self.take_evaluated(&e) {
            return false;
        }
        // The next `glVertex` has the current values.
        let c = self.attributes.current;
        if e.normal.is_some() {
            self.capture.recorder.set_normal(c.normal);
        }
        if e.color.is_some() {
            self.capture.recorder.set_color(c.color);
        }
        if e.tex.is_some() {
            self.capture.recorder.set_tex(c.tex);
        }
        true
    }

    /// Records a vertex. When that is not possible, the driver gets the primitive so far, and the
    /// result is false.
    fn take_evaluated(&mut self, e: &EvaluatedVertex) -> bool {
        let [x, y, z, w] = e.position;
        let mut with = self.attributes.current;
        with.color = e.color.unwrap_or(with.color);
        with.normal = e.normal.unwrap_or(with.normal);
        with.tex = e.tex.unwrap_or(with.tex);
        if !(w > 0.0 && w.is_finite()) {
            self.replay_to_driver("vertices with w not positive");
            return false;
        }
        if let Classification::TraceIfOpaque(why) = self.classifier.classification
            && !self.attributes.is_opaque_with(&self.state.snapshot, with.color)
        {
            self.replay_to_driver(why);
            return false;
        }
        if e.normal.is_some() {
            self.capture.recorder.set_normal(with.normal);
        }
        if e.color.is_some() {
            self.capture.recorder.set_color(with.color);
        }
        if e.tex.is_some() {
            self.capture.recorder.set_tex(with.tex);
        }
        self.capture
            .recorder
            .vertex(if w == 1.0 { [x, y, z] } else { [x / w, y / w, z / w] }, &with);
        true
    }

    /// `glEvalMesh1`: points or lines, which the driver draws.
    pub(crate) fn eval_mesh_1(&mut self, mode: u32) -> bool {
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace => self.replay_to_driver("a mesh between Begin and End"),
            ImmediateModeTarget::List => self.capture.list_driver_call(true, true),
            ImmediateModeTarget::Outside => {
                if matches!(mode, POINT | LINE) && self.has_vertices(MapKind::Curve) {
                    self.before_driver_draw("lines and points", false);
                }
            }
            ImmediateModeTarget::Pass => {}
        }
        false
    }

    /// True when `glEvalMesh` gives vertices.
    fn has_vertices(&mut self, kind: MapKind) -> bool {
        if self.capabilities.core || self.capabilities.es {
            return false;
        }
        self.refresh();
        self.capture.evaluators.maps(kind).has_vertices()
    }

    /// `glEvalMesh2` from `i1` to `i2` and `j1` to `j2`.
    pub(crate) fn eval_mesh_2(&mut self, mode: u32, range: [i32; 4]) -> bool {
        let filled = mode == FILL;
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace => {
                // An error, which the driver reports.
                self.replay_to_driver("a mesh between Begin and End");
                return false;
            }
            ImmediateModeTarget::Pass => return false,
            ImmediateModeTarget::List if filled => {
                return self.capture.list_eval_mesh(range);
            }
            ImmediateModeTarget::List => {
                self.capture.list_driver_call(true, true);
                return false;
            }
            ImmediateModeTarget::Outside => {}
        }
        if self.passes_draw(mode, 0) {
            return false;
        }
        let [i1, i2, j1, j2] = range.map(i64::from);
        if !matches!(mode, POINT | LINE | FILL)
            || i1 > i2
            || j1 > j2
            || !self.has_vertices(MapKind::Surface)
        {
            return false;
        }
        let classification = self.classify_draw();
        let opaque = self.attributes.is_opaque(&self.state.snapshot);
        let maps = self.capture.evaluators.maps(MapKind::Surface);
        let why = match classification {
            _ if !filled => Some("lines and points"),
            Classification::Pass(why) => Some(why),
            Classification::TraceIfOpaque(why) if !maps.has_colors() && !opaque => Some(why),
            _ if self.state.snapshot.program != 0 => Some("evaluators with a program"),
            _ if i2 - i1 > MOST_IN_ROW => Some("a mesh with too many points in a row"),
            _ => maps.unsupported(),
        };
        if let Some(why) = why {
            self.before_driver_draw(why, filled);
            return false;
        }
        if classification == Classification::TraceInOrder {
            self.flush(FlushReason::OrderedDraw);
        }
        watched_calls::arm();
        self.trace_mesh(range);
        if classification == Classification::TraceInOrder {
            self.end_batch();
        }
        true
    }

    /// Traces the rows of a mesh as Mesa draws them: parameters are accumulated, and quads are
    /// split like triangle strips.
    fn trace_mesh(&mut self, [i1, i2, j1, j2]: [i32; 4]) {
        let EvaluatorGrid { first, step } = self.capture.evaluators.grid(MapKind::Surface);
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
        // The next Begin takes the current values.
        self.capture.recorder.behind = true;
    }

    fn row(&mut self, along: &[f32], v: f32) -> Vec<EvaluatedVertex> {
        let maps = self.capture.evaluators.maps(MapKind::Surface);
        along.iter().filter_map(|u| maps.at([*u, v])).collect()
    }

    fn trace_strip(&mut self, along: &[f32], across: [f32; 2], rows: [&[EvaluatedVertex]; 2]) {
        self.capture.recorder.begin(TRIANGLE_STRIP, &self.attributes.current);
        self.capture.immediate_target = ImmediateModeTarget::Trace;
        for ((u, lower), upper) in along.iter().zip(rows[0]).zip(rows[1]) {
            for (v, e) in across.iter().zip([lower, upper]) {
                if self.capture.immediate_target != ImmediateModeTarget::Trace
                    || !self.take_evaluated(e)
                {
                    gl::eval_coord2f(*u, *v);
                }
            }
        }
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace => self.capture.recorder.end(),
            _ => gl::end(),
        }
        self.capture.immediate_target = ImmediateModeTarget::Outside;
    }
}
