//! Decides by the state which draws are traced and which the driver draws. The type of projection
//! does not matter: an orthographic main view is common in scientific programs.

use crate::enums::*;
use crate::host::config::{Settings, Trace};
use crate::state::snapshot::Snapshot;

/// The classification of a draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Classification {
    /// Traced with the other draws of the frame. The nearest fragment wins, as with any depth test.
    Trace,
    /// Traced as long as every vertex has alpha 1, because blending and alpha test then change
    /// nothing. Otherwise passed, for the reason.
    TraceIfOpaque(&'static str),
    /// Traced at once, every layer in the order of the primitives, for states in which order
    /// matters.
    TraceInOrder,
    /// The driver draws it, for the reason given.
    Pass(&'static str),
}

/// What the user wants traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum TraceFilter {
    /// Opaque surfaces with a depth test: see the rules below.
    #[default]
    Surfaces,
    /// The same, and translucent ones whose order is decided by a depth test and blending over.
    /// Rays sort them.
    Translucent,
    /// Every filled primitive that can be traced.
    All,
    /// None: everything is passed.
    Nothing,
}

impl TraceFilter {
    /// The filter that the settings ask for.
    pub(crate) fn of(settings: &Settings) -> TraceFilter {
        match (settings.enabled, settings.trace) {
            (false, _) => TraceFilter::Nothing,
            (true, Trace::All) => TraceFilter::All,
            (true, Trace::Scene) if settings.sees_through() => TraceFilter::Translucent,
            (true, Trace::Scene) => TraceFilter::Surfaces,
        }
    }
}

/// The number of pixels of a viewport from which images would take gigabytes.
pub(crate) const MOST_PIXELS: i32 = 1 << 26;

/// Classifies filled primitives in state `s`.
pub(crate) fn classify(s: &Snapshot, trace: TraceFilter) -> Classification {
    use Classification::Pass;
    if trace == TraceFilter::Nothing {
        return Pass("tracing is off");
    }
    // ---- What rays cannot replace ----
    if s.render_mode != RENDER && s.render_mode != 0 {
        return Pass("selection or feedback");
    }
    if s.polygon_mode.iter().any(|m| *m != FILL && *m != 0) {
        return Pass("polygons drawn as lines or points");
    }
    if s.discard || s.feedback_active {
        return Pass("transform feedback");
    }
    if s.arb_program {
        return Pass("an assembly program");
    }
    if s.pipeline {
        return Pass("a program pipeline");
    }
    if s.stipple || s.smooth_polygons {
        return Pass("stippled or smoothed polygons");
    }
    if s.masked_samples {
        return Pass("masks or coverage of samples");
    }
    if s.draw_buffer == 0 {
        return Pass("no colour buffer");
    }
    if s.more_draw_buffers {
        return Pass("several colour buffers");
    }
    if let Some(why) = s.foreign_texturing {
        return Pass(why);
    }
    if s.color_sum && !(s.lighting && s.separate_specular) {
        return Pass("secondary colours");
    }
    if s.fog.is_some_and(|f| f.mode == 0) {
        return Pass("fog coordinates or distances");
    }
    if s.clip_control {
        return Pass("clip control");
    }
    if s.unclamped_colors {
        return Pass("a colour buffer of floats, integers or signed numbers");
    }
    if s.encoded_colors {
        return Pass("a framebuffer in sRGB");
    }
    if s.two_sided_stencil {
        return Pass("a stencil of two sides");
    }
    if s.viewport[2] <= 0 || s.viewport[3] <= 0 {
        return Pass("an empty viewport");
    }
    if s.viewport[2] > MOST_PIXELS / s.viewport[3] {
        return Pass("a viewport too large to trace");
    }
    // ---- What must be drawn in order ----
    let why = if s.stencil_test {
        "stencil test"
    } else if s.logic_op {
        "logic operation"
    } else if !s.color_mask {
        "colour mask"
    } else if !s.depth_test {
        "no depth test"
    } else if trace == TraceFilter::Translucent
        && s.blend_is_over
        && matches!(s.depth_func, LESS | LEQUAL)
        && s.texture.is_none()
        && (!s.alpha_test || s.alpha_test_passes_one)
    {
        return Classification::Trace;
    } else if !s.depth_mask {
        "depth is not written"
    } else if !matches!(s.depth_func, LESS | LEQUAL) {
        "depth function"
    } else if s.blend || s.alpha_test {
        let harmless = (!s.blend || s.blend_is_over) && (!s.alpha_test || s.alpha_test_passes_one);
        let why = if s.blend { "blending" } else { "alpha test" };
        if harmless && s.texture.is_none() && trace != TraceFilter::All {
            return Classification::TraceIfOpaque(why);
        }
        why
    } else if s.texture.is_some() && !s.lighting {
        // Text and images. Surfaces with colour maps are lit.
        return if trace == TraceFilter::All {
            Classification::Trace
        } else {
            Pass("texture without lighting")
        };
    } else {
        return Classification::Trace;
    };
    match trace {
        // The driver's test compares alphas of eight bits.
        TraceFilter::All if s.alpha_test_of_equality => Pass("an alpha test for equality"),
        TraceFilter::All => Classification::TraceInOrder,
        _ => Pass(why),
    }
}

/// True when lines and points that are drawn now may come before or after traced surfaces, because
/// the depth test decides.
pub(crate) fn commutes(s: &Snapshot) -> bool {
    s.depth_test
        && s.depth_mask
        && matches!(s.depth_func, LESS | LEQUAL)
        && !s.blend
        && !s.logic_op
        && !s.stencil_test
        && (s.render_mode == RENDER || s.render_mode == 0)
}

/// True when a fragment is drawn only at exactly the depth that is there, or anywhere else.
pub(crate) fn compares_depths_exactly(s: &Snapshot) -> bool {
    s.depth_test && matches!(s.depth_func, EQUAL | NOTEQUAL)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface() -> Snapshot {
        Snapshot {
            render_mode: RENDER,
            polygon_mode: [FILL; 2],
            color_mask: true,
            depth_test: true,
            depth_mask: true,
            depth_func: LESS,
            draw_buffer: BACK,
            viewport: [0, 0, 10, 10],
            ..Snapshot::default()
        }
    }

    #[test]
    fn opaque_surfaces_with_a_depth_test_are_traced() {
        assert_eq!(classify(&surface(), TraceFilter::Surfaces), Classification::Trace);
        assert_eq!(
            classify(&surface(), TraceFilter::Nothing),
            Classification::Pass("tracing is off")
        );
    }

    #[test]
    fn each_state_that_depends_on_order_is_passed_and_traced_in_order_when_all_is_asked_for() {
        type Change = fn(&mut Snapshot);
        let cases: [(&str, Change); 8] = [
            ("stencil test", |s| s.stencil_test = true),
            ("logic operation", |s| s.logic_op = true),
            ("colour mask", |s| s.color_mask = false),
            ("blending", |s| s.blend = true),
            ("alpha test", |s| s.alpha_test = true),
            ("no depth test", |s| s.depth_test = false),
            ("depth is not written", |s| s.depth_mask = false),
            ("depth function", |s| s.depth_func = GREATER),
        ];
        for (why, change) in cases {
            let mut s = surface();
            change(&mut s);
            assert_eq!(classify(&s, TraceFilter::Surfaces), Classification::Pass(why));
            assert_eq!(classify(&s, TraceFilter::All), Classification::TraceInOrder, "{why}");
        }
    }

    #[test]
    fn blending_of_opaque_surfaces_is_no_reason_to_pass_them() {
        let s = Snapshot { blend: true, blend_is_over: true, ..surface() };
        assert_eq!(classify(&s, TraceFilter::Surfaces), Classification::TraceIfOpaque("blending"));
        let textured =
            Snapshot { texture: Some(crate::state::snapshot::TextureUnit::default()), ..s.clone() };
        assert_eq!(classify(&textured, TraceFilter::Surfaces), Classification::Pass("blending"));
        let tested = Snapshot { alpha_test: true, ..s };
        assert_eq!(
            classify(&tested, TraceFilter::Surfaces),
            Classification::Pass("blending"),
            "the test may discard alpha 1"
        );
    }

    #[test]
    fn a_stencil_that_tells_front_from_back_is_never_traced() {
        let s = Snapshot { stencil_test: true, two_sided_stencil: true, ..surface() };
        assert_eq!(classify(&s, TraceFilter::All), Classification::Pass("a stencil of two sides"));
    }

    #[test]
    fn selection_is_never_traced() {
        let s = Snapshot { render_mode: SELECT, ..surface() };
        assert_eq!(classify(&s, TraceFilter::All), Classification::Pass("selection or feedback"));
    }
}
