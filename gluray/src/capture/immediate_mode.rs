//! Immediate mode: Begin and End, vertices, and the attributes that vertices take.

use crate::calls::class;
use crate::capture::ImmediateModeTarget;
use crate::classify::rules::Classification;
use crate::enums::*;
use crate::interpose::context::Context;
use crate::interpose::flush_reason::FlushReason;
use crate::state::current_attributes::stale;
use crate::state::material::set_material;
use crate::state::material_properties::MaterialProperties;
use crate::watched_calls;

/// The result of the fast path of a call. The fast path takes values and calls nothing, so that
/// they stay in registers: a value that is stored in parts and loaded as a whole costs more than
/// the rest of the call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FastPathResult {
    /// The call is handled.
    Done,
    /// The driver draws the primitive between Begin and End.
    Driver,
    /// The slow path must be taken. Nothing was done that may not be repeated.
    Slow,
}

impl Context {
    /// The fast path of `glBegin`.
    #[inline(always)]
    pub(crate) fn begin_fast(&mut self, mode: u32) -> FastPathResult {
        if self.routing.is_drivers
            && self.capture.immediate_target == ImmediateModeTarget::Outside
            && self.attributes.stale == 0
        {
            self.routing.begin(mode);
            self.capture.immediate_target = ImmediateModeTarget::Pass;
            return FastPathResult::Driver;
        }
        let ready = self.capture.immediate_target == ImmediateModeTarget::Outside
            && self.state.dirty & class::DRAWS == 0;
        if ready
            && self.classifier.classification == Classification::Trace
            && self.state.snapshot.program == 0
            && (TRIANGLES..=POLYGON).contains(&mode)
        {
            self.capture.recorder.begin(mode, &self.attributes.current);
            self.capture.immediate_target = ImmediateModeTarget::Trace;
            (self.attributes.set_since_draw, self.capture.element_arrays) =
                (MaterialProperties::default(), None);
            return FastPathResult::Done;
        }
        FastPathResult::Slow
    }

    pub(crate) fn begin(&mut self, mode: u32) -> bool {
        match self.begin_fast(mode) {
            FastPathResult::Slow => self.begin_slow(mode),
            step => step == FastPathResult::Done,
        }
    }

    /// Passes a primitive to the driver that is traced only while alpha is 1.
    #[inline]
    fn watch_alpha(&mut self) {
        if self.capture.immediate_target == ImmediateModeTarget::Trace
            && let Classification::TraceIfOpaque(why) = self.classifier.classification
            && !self.attributes.is_opaque(&self.state.snapshot)
        {
            self.replay_to_driver(why);
        }
    }

    #[cold]
    fn begin_slow(&mut self, mode: u32) -> bool {
        match self.capture.immediate_target {
            ImmediateModeTarget::List => return self.capture.list_begin(mode),
            // An error, which the driver reports.
            ImmediateModeTarget::Trace => {
                self.replay_to_driver("Begin between Begin and End");
                return false;
            }
            ImmediateModeTarget::Pass => return false,
            ImmediateModeTarget::Outside => {}
        }
        if self.routing.is_drivers {
            self.attributes.sync();
            self.routing.begin(mode);
            self.capture.immediate_target = ImmediateModeTarget::Pass;
            return false;
        }
        let classification = self.classify_draw();
        let filled = crate::capture::primitives::is_filled(mode);
        let fixed = self.state.snapshot.program == 0;
        let classification = match classification {
            Classification::TraceIfOpaque(why)
                if !self.attributes.is_opaque(&self.state.snapshot) =>
            {
                Classification::Pass(why)
            }
            v => v,
        };
        match classification {
            Classification::Trace
            | Classification::TraceInOrder
            | Classification::TraceIfOpaque(_)
                if filled && fixed =>
            {
                if classification == Classification::TraceInOrder {
                    self.flush(FlushReason::OrderedDraw);
                }
                self.capture.recorder.begin(mode, &self.attributes.current);
                self.capture.immediate_target = ImmediateModeTarget::Trace;
                self.capture.element_arrays = None;
                watched_calls::arm();
                true
            }
            _ => {
                let why = match classification {
                    _ if !filled => "lines and points",
                    Classification::Pass(why) => why,
                    _ => "immediate mode with a program",
                };
                self.before_driver_draw(why, filled);
                self.capture.immediate_target = ImmediateModeTarget::Pass;
                false
            }
        }
    }

    /// The fast path of `glEnd`.
    #[inline(always)]
    pub(crate) fn end_fast(&mut self) -> FastPathResult {
        if self.routing.is_drivers && self.capture.immediate_target == ImmediateModeTarget::Pass {
            self.routing.end();
            self.capture.immediate_target = ImmediateModeTarget::Outside;
            return FastPathResult::Driver;
        }
        if self.capture.immediate_target == ImmediateModeTarget::Trace
            && self.classifier.classification != Classification::TraceInOrder
        {
            self.capture.recorder.end();
            self.capture.immediate_target = ImmediateModeTarget::Outside;
            return FastPathResult::Done;
        }
        FastPathResult::Slow
    }

    pub(crate) fn end(&mut self) -> bool {
        match self.end_fast() {
            FastPathResult::Slow => self.end_slow(),
            step => step == FastPathResult::Done,
        }
    }

    #[cold]
    fn end_slow(&mut self) -> bool {
        match self.capture.immediate_target {
            ImmediateModeTarget::List => self.capture.list_end(),
            ImmediateModeTarget::Pass => {
                self.capture.immediate_target = ImmediateModeTarget::Outside;
                false
            }
            ImmediateModeTarget::Trace => {
                self.capture.recorder.end();
                self.capture.immediate_target = ImmediateModeTarget::Outside;
                self.end_batch();
                true
            }
            ImmediateModeTarget::Outside => false,
        }
    }

    /// The fast path of `glVertex`.
    #[inline(always)]
    pub(crate) fn vertex_fast(&mut self, v: [f32; 4]) -> FastPathResult {
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace if v[3] == 1.0 => {
                self.capture.recorder.vertex([v[0], v[1], v[2]], &self.attributes.current);
                FastPathResult::Done
            }
            ImmediateModeTarget::Pass => {
                self.routing.vertices += 1;
                FastPathResult::Driver
            }
            _ => FastPathResult::Slow,
        }
    }

    pub(crate) fn vertex(&mut self, v: [f32; 4]) -> bool {
        match self.vertex_fast(v) {
            FastPathResult::Slow => self.vertex_slow(v),
            step => step == FastPathResult::Done,
        }
    }

    #[cold]
    fn vertex_slow(&mut self, v: [f32; 4]) -> bool {
        match self.capture.immediate_target {
            ImmediateModeTarget::List => self.capture.list_vertex(v),
            ImmediateModeTarget::Trace if v[3] > 0.0 && v[3].is_finite() => {
                self.capture
                    .recorder
                    .vertex([v[0] / v[3], v[1] / v[3], v[2] / v[3]], &self.attributes.current);
                true
            }
            ImmediateModeTarget::Trace => {
                self.replay_to_driver("vertices with w not positive");
                false
            }
            _ => false,
        }
    }

    /// The fast path of `glNormal`. Outside of Begin and End the value is only stored, because only
    /// the values at vertices count. The next Begin reads it.
    #[inline(always)]
    pub(crate) fn normal_fast(&mut self, v: [f32; 3]) -> FastPathResult {
        match self.capture.immediate_target {
            ImmediateModeTarget::Outside if !self.routing.is_drivers => {
                self.attributes.current.normal = v;
                self.capture.recorder.behind = true;
                self.attributes.mark_stale(stale::NORMAL);
                FastPathResult::Done
            }
            ImmediateModeTarget::Trace => {
                self.attributes.current.normal = v;
                self.capture.recorder.set_normal(v);
                self.attributes.mark_stale(stale::NORMAL);
                FastPathResult::Done
            }
            ImmediateModeTarget::Pass | ImmediateModeTarget::Outside => {
                self.attributes.current.normal = v;
                FastPathResult::Driver
            }
            ImmediateModeTarget::List => FastPathResult::Slow,
        }
    }

    pub(crate) fn normal(&mut self, v: [f32; 3]) -> bool {
        match self.normal_fast(v) {
            FastPathResult::Slow => self.capture.list_normal(v),
            step => step == FastPathResult::Done,
        }
    }

    /// The fast path of `glColor`.
    #[inline(always)]
    pub(crate) fn color_fast(&mut self, v: [f32; 4]) -> FastPathResult {
        match self.capture.immediate_target {
            ImmediateModeTarget::Outside if !self.routing.is_drivers => {
                self.attributes.current.color = v;
                self.capture.recorder.behind = true;
                self.attributes.mark_stale(stale::COLOR);
                FastPathResult::Done
            }
            ImmediateModeTarget::Trace
                if !matches!(self.classifier.classification, Classification::TraceIfOpaque(_)) =>
            {
                self.attributes.current.color = v;
                self.capture.recorder.set_color(v);
                self.attributes.mark_stale(stale::COLOR);
                FastPathResult::Done
            }
            ImmediateModeTarget::Pass | ImmediateModeTarget::Outside => {
                self.attributes.current.color = v;
                FastPathResult::Driver
            }
            _ => FastPathResult::Slow,
        }
    }

    pub(crate) fn color(&mut self, v: [f32; 4]) -> bool {
        match self.color_fast(v) {
            FastPathResult::Slow if self.capture.immediate_target == ImmediateModeTarget::List => {
                self.capture.list_color(v)
            }
            FastPathResult::Slow => {
                self.attributes.current.color = v;
                self.capture.recorder.set_color(v);
                self.attributes.mark_stale(stale::COLOR);
                self.watch_alpha();
                true
            }
            step => step == FastPathResult::Done,
        }
    }

    /// The fast path of `glTexCoord`.
    #[inline(always)]
    pub(crate) fn tex_coord_fast(&mut self, v: [f32; 4]) -> FastPathResult {
        match self.capture.immediate_target {
            ImmediateModeTarget::Outside if !self.routing.is_drivers => {
                self.attributes.current.tex = v;
                self.capture.recorder.behind = true;
                self.attributes.mark_stale(stale::TEX);
                FastPathResult::Done
            }
            ImmediateModeTarget::Trace => {
                self.attributes.current.tex = v;
                self.capture.recorder.set_tex(v);
                self.attributes.mark_stale(stale::TEX);
                FastPathResult::Done
            }
            ImmediateModeTarget::Pass | ImmediateModeTarget::Outside => {
                self.attributes.current.tex = v;
                FastPathResult::Driver
            }
            ImmediateModeTarget::List => FastPathResult::Slow,
        }
    }

    pub(crate) fn tex_coord(&mut self, v: [f32; 4]) -> bool {
        match self.tex_coord_fast(v) {
            FastPathResult::Slow => self.capture.list_tex(v),
            step => step == FastPathResult::Done,
        }
    }

    pub(crate) fn material(&mut self, face: u32, what: u32, v: [f32; 4]) -> bool {
        if self.capture.immediate_target == ImmediateModeTarget::List {
            return self.capture.list_material(face, what, v);
        }
        let mut materials = self.attributes.current.materials;
        if !set_material(&mut materials, face, what, v) {
            // An error, which the driver reports.
            if self.capture.immediate_target == ImmediateModeTarget::Trace {
                self.replay_to_driver("an invalid material");
            }
            return false;
        }
        let properties = MaterialProperties::of(face, what);
        if self.capture.immediate_target == ImmediateModeTarget::Outside {
            self.attributes.set_since_draw.add(properties);
        }
        // Our value may be older than the driver's (after PopAttrib, for example), so the driver
        // gets the call.
        if self.capture.immediate_target == ImmediateModeTarget::Pass
            || self.state.dirty & class::CURRENT != 0
        {
            self.attributes.current.materials = materials;
            return false;
        }
        if materials != self.attributes.current.materials {
            self.attributes.current.materials = materials;
            self.capture.recorder.set_materials(&materials);
            self.attributes.mark_stale(stale::MATERIAL);
            self.attributes.stale_properties.add(properties);
            self.watch_alpha();
        }
        true
    }

    pub(crate) fn rect(&mut self, [x, y, x2, y2]: [f32; 4]) -> bool {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            // An error, which the driver reports.
            self.replay_to_driver("a rectangle between Begin and End");
        }
        if self.capture.immediate_target == ImmediateModeTarget::Pass {
            return false;
        }
        if self.capture.immediate_target == ImmediateModeTarget::List {
            return self.capture.list_rect([x, y, x2, y2]);
        }
        {
            let traced = match self.classify_draw() {
                Classification::Trace | Classification::TraceInOrder => {
                    self.state.snapshot.program == 0
                }
                Classification::TraceIfOpaque(_) => {
                    self.state.snapshot.program == 0
                        && self.attributes.is_opaque(&self.state.snapshot)
                }
                Classification::Pass(_) => false,
            };
            if !traced {
                self.before_driver_draw("a rectangle in a state that is passed", true);
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
