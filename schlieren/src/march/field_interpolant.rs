//! The interpolant of a field, chosen when the program runs.

use super::field_cache::FieldCache;
use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant, Interpolate, Trilinear, TrilinearGradient};
use std::sync::Arc;

/// An interpolant of a field.
pub(crate) enum FieldInterpolant<'a> {
    BSpline(Arc<BSpline>),
    Trilinear(Trilinear<'a>),
    TrilinearGradient(TrilinearGradient),
}

impl<'a> FieldInterpolant<'a> {
    pub(crate) fn new(field: &'a Field, interpolant: Interpolant) -> FieldInterpolant<'a> {
        FieldInterpolant::with_spline(field, interpolant, || Arc::new(BSpline::new(field)))
    }

    /// With the spline through this field from a cache.
    pub(super) fn with_cache(
        field: &'a Field,
        interpolant: Interpolant,
        cache: &FieldCache,
    ) -> FieldInterpolant<'a> {
        FieldInterpolant::with_spline(field, interpolant, || cache.spline(field))
    }

    fn with_spline(
        field: &'a Field,
        interpolant: Interpolant,
        spline: impl FnOnce() -> Arc<BSpline>,
    ) -> FieldInterpolant<'a> {
        match interpolant {
            Interpolant::BSpline => FieldInterpolant::BSpline(spline()),
            Interpolant::Trilinear => FieldInterpolant::Trilinear(Trilinear::new(field)),
            Interpolant::TrilinearGradient => {
                FieldInterpolant::TrilinearGradient(TrilinearGradient::new(field))
            }
        }
    }

    /// Computed by the calling thread alone, which waits for no other thread.
    #[cfg(feature = "gpu")]
    pub(crate) fn on_this_thread(
        field: &'a Field,
        interpolant: Interpolant,
    ) -> FieldInterpolant<'a> {
        match interpolant {
            Interpolant::BSpline => {
                FieldInterpolant::BSpline(Arc::new(BSpline::on_this_thread(field)))
            }
            Interpolant::Trilinear => FieldInterpolant::Trilinear(Trilinear::new(field)),
            Interpolant::TrilinearGradient => {
                FieldInterpolant::TrilinearGradient(TrilinearGradient::on_this_thread(field))
            }
        }
    }

    /// The interpolant in `f64`.
    pub(super) fn as_dyn(&self) -> &dyn Interpolate {
        match self {
            FieldInterpolant::BSpline(s) => &**s,
            FieldInterpolant::Trilinear(s) => s,
            FieldInterpolant::TrilinearGradient(s) => s,
        }
    }
}
