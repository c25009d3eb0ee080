//! [`Full`] marches that own their interpolant.

use super::field_interpolant::FieldInterpolant;
use super::full::{Full, FullOptions};
use super::integrator::Integrator;
use crate::field::Field;
use crate::interpolate::Interpolate;
use crate::path::{Exit, LightPaths, PathQuantities, Start};
use crate::view::View;
use glam::DVec3;

/// A march through strong index with an interpolant of its own.
pub(crate) struct FullOfField<'a, G> {
    field: &'a Field,
    interpolant: FieldInterpolant<'a>,
    integrator: G,
    view: View,
    options: FullOptions,
}

impl<'a, G: Integrator + Copy> FullOfField<'a, G> {
    pub(crate) fn new(
        field: &'a Field,
        interpolant: FieldInterpolant<'a>,
        integrator: G,
        view: View,
        options: FullOptions,
    ) -> Self {
        FullOfField { field, interpolant, integrator, view, options }
    }

    fn trace_with<I: Interpolate>(&self, interpolate: &I, starts: &[Start], exits: &mut [Exit]) {
        Full::new(self.field, interpolate, self.integrator, self.view, self.options)
            .trace(starts, exits);
    }
}

impl<G: Integrator + Copy> LightPaths for FullOfField<'_, G> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        match &self.interpolant {
            FieldInterpolant::BSpline(i) => self.trace_with(&**i, starts, exits),
            FieldInterpolant::Trilinear(i) => self.trace_with(i, starts, exits),
            FieldInterpolant::TrilinearGradient(i) => self.trace_with(i, starts, exits),
        }
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn quantities(&self) -> PathQuantities {
        self.options.quantities
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * DVec3::from(self.field.spacing_m()).min_element()
    }
}
