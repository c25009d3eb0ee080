//! Immediate mode: Begin and End, and the attributes that vertices take with them.

use crate::classify::rules::{self, Verdict};
use crate::interpose::context::{Context, Sink};
use crate::interpose::symbols::{self, class};
use crate::state::current_attributes::{set_material, stale};
use crate::state::enums::*;
use crate::state::material_properties::Properties;

/// What the short way of a call came to. It takes values and calls nothing, so that they stay in registers: a value that has been put into
/// memory in parts and is read back whole costs more than all the rest of a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// That was all.
    Done,
    /// The driver draws what is between Begin and End.
    Driver,
    /// The long way has to be taken. Nothing has happened that it may not do again.
    Slow,
}

impl Context {
    /// The short way of `glBegin`.
    #[inline(always)]
    pub(crate) fn begin_step(&mut self, mode: u32) -> Step {
        const DRAWS: u8 = class::MATRIX | class::LIGHT | class::RASTER | class::TEXTURE | class::CURRENT;
        let ready = self.sink == Sink::Outside && self.dirty & DRAWS == 0;
        if ready
            && self.verdict == Verdict::Trace
            && self.state.program == 0
            && (TRIANGLES..=POLYGON).contains(&mode)
        {
            self.recorder.begin(mode, &self.current);
            self.sink = Sink::Trace;
            (self.set_since_draw, self.element_arrays) = (Properties::default(), None);
            return Step::Done;
        }
        Step::Slow
    }

    pub(crate) fn begin(&mut self, mode: u32) -> bool {
        match self.begin_step(mode) {
            Step::Slow => self.begin_slowly(mode),
            step => step == Step::Done,
        }
    }

    /// True when a vertex now would have alpha 1.
    #[inline]
    pub(crate) fn is_opaque_now(&self) -> bool {
        self.is_opaque_with(self.current.color)
    }

    /// The same with another colour than the current one.
    #[inline]
    pub(crate) fn is_opaque_with(&self, color: [f32; 4]) -> bool {
        let s = &*self.state;
        let tracked = s.color_material.is_some_and(|(_, what)| matches!(what, DIFFUSE | AMBIENT_AND_DIFFUSE));
        match s.lighting {
            true if !tracked => self.current.materials.iter().all(|m| m.diffuse[3] == 1.0),
            _ => color[3] == 1.0,
        }
    }

    /// Alpha left 1 while that was what a draw was traced for.
    #[inline]
    fn watch_alpha(&mut self) {
        if self.sink == Sink::Trace
            && let Verdict::TraceIfOpaque(why) = self.verdict
            && !self.is_opaque_now()
        {
            self.unswallow(why);
        }
    }

    #[cold]
    fn begin_slowly(&mut self, mode: u32) -> bool {
        match self.sink {
            Sink::List => return self.list_begin(mode),
            // An error, which the driver is to report.
            Sink::Trace => {
                self.unswallow("Begin between Begin and End");
                return false;
            }
            Sink::Pass => return false,
            Sink::Outside => {}
        }
        let verdict = self.verdict();
        let filled = crate::capture::primitives::is_filled(mode);
        let fixed = self.state.program == 0;
        let verdict = match verdict {
            Verdict::TraceIfOpaque(why) if !self.is_opaque_now() => Verdict::Pass(why),
            v => v,
        };
        match verdict {
            Verdict::Trace | Verdict::TraceInOrder | Verdict::TraceIfOpaque(_) if filled && fixed => {
                if verdict == Verdict::TraceInOrder {
                    self.flush("a draw whose order matters");
                }
                self.recorder.begin(mode, &self.current);
                self.sink = Sink::Trace;
                self.element_arrays = None;
                symbols::attend();
                true
            }
            _ => {
                let why = match verdict {
                    _ if !filled => "lines and points",
                    Verdict::Pass(why) => why,
                    _ => "immediate mode with a program",
                };
                self.passing(why, filled);
                self.sink = Sink::Pass;
                false
            }
        }
    }

    /// The driver is about to draw something.
    pub(crate) fn passing(&mut self, why: &'static str, filled: bool) {
        self.end_batch();
        if rules::commutes(&self.state) && !filled {
            self.frame.others_drew();
        } else {
            self.flush(crate::present::frame::ORDER_MATTERS);
        }
        self.sync();
        self.counters.pass(why, 1);
    }

    /// The short way of `glEnd`.
    #[inline(always)]
    pub(crate) fn end_step(&mut self) -> Step {
        if self.sink == Sink::Trace && self.verdict != Verdict::TraceInOrder {
            self.recorder.end();
            self.sink = Sink::Outside;
            return Step::Done;
        }
        Step::Slow
    }

    pub(crate) fn end(&mut self) -> bool {
        match self.end_step() {
            Step::Slow => self.end_slowly(),
            step => step == Step::Done,
        }
    }

    #[cold]
    fn end_slowly(&mut self) -> bool {
        match self.sink {
            Sink::List => self.list_end(),
            Sink::Pass => {
                self.sink = Sink::Outside;
                false
            }
            Sink::Trace => {
                self.recorder.end();
                self.sink = Sink::Outside;
                self.end_batch();
                true
            }
            Sink::Outside => false,
        }
    }

    /// The primitive that is being recorded goes to the driver after all.
    pub(crate) fn unswallow(&mut self, why: &'static str) {
        self.sink = Sink::Pass;
        let (mode, vertices) = self.recorder.withdraw();
        self.passing(why, true);
        self.begin_again_with(mode, vertices);
    }

    /// The short way of `glVertex`.
    #[inline(always)]
    pub(crate) fn vertex_step(&mut self, v: [f32; 4]) -> Step {
        match self.sink {
            Sink::Trace if v[3] == 1.0 => {
                self.recorder.vertex([v[0], v[1], v[2]], &self.current);
                Step::Done
            }
            Sink::Pass => Step::Driver,
            _ => Step::Slow,
        }
    }

    pub(crate) fn vertex(&mut self, v: [f32; 4]) -> bool {
        match self.vertex_step(v) {
            Step::Slow => self.vertex_slowly(v),
            step => step == Step::Done,
        }
    }

    #[cold]
    fn vertex_slowly(&mut self, v: [f32; 4]) -> bool {
        match self.sink {
            Sink::List => self.list_vertex(v),
            Sink::Trace if v[3] > 0.0 && v[3].is_finite() => {
                self.recorder.vertex([v[0] / v[3], v[1] / v[3], v[2] / v[3]], &self.current);
                true
            }
            Sink::Trace => {
                self.unswallow("vertices with w not positive");
                false
            }
            _ => false,
        }
    }

    /// The short way of `glNormal`. Outside of Begin and End it is only remembered: what vertices take counts, and the next Begin looks.
    #[inline(always)]
    pub(crate) fn normal_step(&mut self, v: [f32; 3]) -> Step {
        match self.sink {
            Sink::Outside => {
                self.current.normal = v;
                self.recorder.behind = true;
                self.now_stale(stale::NORMAL);
                Step::Done
            }
            Sink::Trace => {
                self.current.normal = v;
                self.recorder.set_normal(v);
                self.now_stale(stale::NORMAL);
                Step::Done
            }
            Sink::Pass => {
                self.current.normal = v;
                Step::Driver
            }
            Sink::List => Step::Slow,
        }
    }

    pub(crate) fn normal(&mut self, v: [f32; 3]) -> bool {
        match self.normal_step(v) {
            Step::Slow => self.list_normal(v),
            step => step == Step::Done,
        }
    }

    /// The short way of `glColor`.
    #[inline(always)]
    pub(crate) fn color_step(&mut self, v: [f32; 4]) -> Step {
        match self.sink {
            Sink::Outside => {
                self.current.color = v;
                self.recorder.behind = true;
                self.now_stale(stale::COLOR);
                Step::Done
            }
            Sink::Trace if !matches!(self.verdict, Verdict::TraceIfOpaque(_)) => {
                self.current.color = v;
                self.recorder.set_color(v);
                self.now_stale(stale::COLOR);
                Step::Done
            }
            Sink::Pass => {
                self.current.color = v;
                Step::Driver
            }
            _ => Step::Slow,
        }
    }

    pub(crate) fn color(&mut self, v: [f32; 4]) -> bool {
        match self.color_step(v) {
            Step::Slow if self.sink == Sink::List => self.list_color(v),
            Step::Slow => {
                self.current.color = v;
                self.recorder.set_color(v);
                self.now_stale(stale::COLOR);
                self.watch_alpha();
                true
            }
            step => step == Step::Done,
        }
    }

    /// The short way of `glTexCoord`.
    #[inline(always)]
    pub(crate) fn tex_coord_step(&mut self, v: [f32; 4]) -> Step {
        match self.sink {
            Sink::Outside => {
                self.current.tex = v;
                self.recorder.behind = true;
                self.now_stale(stale::TEX);
                Step::Done
            }
            Sink::Trace => {
                self.current.tex = v;
                self.recorder.set_tex(v);
                self.now_stale(stale::TEX);
                Step::Done
            }
            Sink::Pass => {
                self.current.tex = v;
                Step::Driver
            }
            Sink::List => Step::Slow,
        }
    }

    pub(crate) fn tex_coord(&mut self, v: [f32; 4]) -> bool {
        match self.tex_coord_step(v) {
            Step::Slow => self.list_tex(v),
            step => step == Step::Done,
        }
    }

    pub(crate) fn material(&mut self, face: u32, what: u32, v: [f32; 4]) -> bool {
        if self.sink == Sink::List {
            return self.list_material(face, what, v);
        }
        let mut materials = self.current.materials;
        if !set_material(&mut materials, face, what, v) {
            // An error, which the driver is to report.
            if self.sink == Sink::Trace {
                self.unswallow("an invalid material");
            }
            return false;
        }
        let properties = Properties::of(face, what);
        if self.sink == Sink::Outside {
            self.set_since_draw.add(properties);
        }
        // Ours may be behind the driver's (after PopAttrib, say): then the driver alone is told.
        if self.sink == Sink::Pass || self.dirty & class::CURRENT != 0 {
            self.current.materials = materials;
            return false;
        }
        if materials != self.current.materials {
            self.current.materials = materials;
            self.recorder.set_materials(&materials);
            self.now_stale(stale::MATERIAL);
            self.stale_properties.add(properties);
            self.watch_alpha();
        }
        true
    }

    #[inline(always)]
    fn now_stale(&mut self, bit: u8) {
        if self.stale == 0 {
            symbols::attend();
        }
        self.stale |= bit;
    }

    pub(crate) fn rect(&mut self, [x, y, x2, y2]: [f32; 4]) -> bool {
        if self.sink == Sink::Trace {
            // An error, which the driver is to report.
            self.unswallow("a rectangle between Begin and End");
        }
        if self.sink == Sink::Pass {
            return false;
        }
        if self.sink == Sink::List {
            return self.list_rect([x, y, x2, y2]);
        }
        {
            let traced = match self.verdict() {
                Verdict::Trace | Verdict::TraceInOrder => self.state.program == 0,
                Verdict::TraceIfOpaque(_) => self.state.program == 0 && self.is_opaque_now(),
                Verdict::Pass(_) => false,
            };
            if !traced {
                self.passing("a rectangle in a state that is passed", true);
                return false;
            }
        }
        self.begin(POLYGON);
        for [x, y] in [[x, y], [x2, y], [x2, y2], [x, y2]] {
            self.vertex([x, y, 0.0, 1.0]);
        }
        self.end()
    }
}
