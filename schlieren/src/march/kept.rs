//! What marches prepare of a field, kept for the next picture of the same field.

use super::{BlankCells, LineOfSight};
use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant};
use crate::path::Wanted;
use crate::plan::Roughness;
use crate::view::View;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Made at first need, for one field: whoever keeps it must give the same field to every call.
#[derive(Default)]
pub struct Kept {
    roughness: OnceLock<Roughness>,
    spline: OnceLock<Arc<BSpline>>,
    /// The newest last.
    projections: Mutex<Vec<(Projection, Arc<LineOfSight>)>>,
}

/// What a projection depends on, beside the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// The light's direction and frame.
    pub view: View,
    /// For oblique views.
    pub interpolant: Interpolant,
    /// What exits hold.
    pub wanted: Wanted,
    /// What becomes of light in cells without data.
    pub blank: BlankCells,
}

/// A picture and its map can differ in what they want, and in the direction of the rays.
const PROJECTIONS: usize = 2;

impl Kept {
    /// The field's largest derivatives.
    pub fn roughness(&self, field: &Field) -> Roughness {
        *self.roughness.get_or_init(|| Roughness::of(field))
    }

    /// The spline through the field.
    pub fn spline(&self, field: &Field) -> Arc<BSpline> {
        self.spline.get_or_init(|| Arc::new(BSpline::new(field))).clone()
    }

    /// The field projected along a view.
    pub fn line_of_sight(&self, field: &Field, of: Projection) -> Arc<LineOfSight> {
        let mut kept = self.projections.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, made)) = kept.iter().find(|p| p.0 == of) {
            return made.clone();
        }
        let made = Arc::new(LineOfSight::new(field, of.view, of.interpolant, of.wanted, of.blank));
        if kept.len() == PROJECTIONS {
            kept.remove(0);
        }
        kept.push((of, made.clone()));
        made
    }
}
