//! Keeps what marches compute from a field, for the next image of the same field.

use super::{BlankCells, LineOfSight};
use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant};
use crate::path::PathQuantities;
use crate::plan::DerivativeBounds;
use crate::view::View;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Results for one field, each computed at first use. The owner must pass the same field to every
/// call.
///
/// All threads take part in computing a result, so no lock is held meanwhile: a worker that waits
/// inside rayon may take another job that needs the same result. Two callers at the same time may
/// therefore compute it twice; both then get the first one.
#[derive(Default)]
pub struct FieldCache {
    derivative_bounds: OnceLock<DerivativeBounds>,
    spline: OnceLock<Arc<BSpline>>,
    /// Ordered by age, the newest last.
    projections: Mutex<Vec<(Projection, Arc<LineOfSight>)>>,
}

/// The parameters of a projection, besides the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// The light's direction and frame.
    pub view: View,
    /// Used only for oblique views.
    pub interpolant: Interpolant,
    /// The quantities that exits contain.
    pub quantities: PathQuantities,
    /// How light is treated in cells without data.
    pub blank: BlankCells,
}

/// Number of projections kept. An image and its map can differ in the quantities they want and in
/// the direction of the rays.
const PROJECTIONS: usize = 2;

impl FieldCache {
    /// The field's largest derivatives.
    pub fn derivative_bounds(&self, field: &Field) -> DerivativeBounds {
        get_or_make(&self.derivative_bounds, || DerivativeBounds::new(field))
    }

    /// The spline through the field.
    pub fn spline(&self, field: &Field) -> Arc<BSpline> {
        get_or_make(&self.spline, || Arc::new(BSpline::new(field)))
    }

    /// The field projected along a view.
    pub fn line_of_sight(&self, field: &Field, of: Projection) -> Arc<LineOfSight> {
        let lock = || self.projections.lock().unwrap_or_else(PoisonError::into_inner);
        let found = |all: &[(Projection, Arc<LineOfSight>)]| {
            all.iter().find(|p| p.0 == of).map(|(_, made)| made.clone())
        };
        if let Some(made) = found(&lock()) {
            return made;
        }
        let made =
            Arc::new(LineOfSight::new(field, of.view, of.interpolant, of.quantities, of.blank));
        let mut all = lock();
        if let Some(first) = found(&all) {
            return first;
        }
        if all.len() == PROJECTIONS {
            all.remove(0);
        }
        all.push((of, made.clone()));
        made
    }
}

/// Returns the content of the cell. When it is empty, `make` runs outside of the cell's lock.
fn get_or_make<T: Clone>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> T {
    if let Some(made) = cell.get() {
        return made.clone();
    }
    let made = make();
    cell.get_or_init(|| made).clone()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{with_concurrent_jobs, with_timeout};
    use crate::view::Axis;
    use glam::DVec3;
    use std::time::Duration;

    /// Several images of one field can be rayon jobs of one pool. A worker that waits inside rayon
    /// for a part of its result may take another of these jobs, which needs the same result.
    #[test]
    fn jobs_of_one_pool_that_ask_for_the_same_do_not_wait_for_themselves() {
        let eps = |p: DVec3| 1e-4 * (-p.length_squared() / 0.02).exp();
        let field =
            Arc::new(Field::from_fn([96; 3], [0.01; 3], DVec3::splat(-0.5), 1.0, eps).unwrap());
        let view = View::new(DVec3::new(0.3, 0.1, 1.0), DVec3::Y, DVec3::ZERO).unwrap();
        let view = [view, View::along(Axis::X, DVec3::ZERO)];
        for what in 0..4 {
            for threads in [1, 2, 8] {
                let field = field.clone();
                let name = format!("preparation {what} on {threads} threads");
                with_timeout(Duration::from_secs(120), &name, move || {
                    with_concurrent_jobs(threads, || {
                        let (field, cache) = (field.clone(), FieldCache::default());
                        move |_| match what {
                            0 => drop(cache.spline(&field)),
                            1 => assert!(cache.derivative_bounds(&field).gradient > 0.0),
                            _ => drop(cache.line_of_sight(
                                &field,
                                Projection {
                                    view: view[what - 2],
                                    interpolant: Interpolant::Trilinear,
                                    quantities: PathQuantities::default(),
                                    blank: BlankCells::Opaque,
                                },
                            )),
                        }
                    });
                });
            }
        }
    }

    #[test]
    fn what_is_kept_is_made_once_and_projections_are_few() {
        let field =
            Field::from_fn([8; 3], [0.1; 3], DVec3::ZERO, 1.0, |p| 1e-4 * p.x * p.y).unwrap();
        let cache = FieldCache::default();
        let of = |axis| Projection {
            view: View::along(axis, field.centre_m()),
            interpolant: Interpolant::BSpline,
            quantities: PathQuantities::default(),
            blank: BlankCells::Opaque,
        };
        assert!(Arc::ptr_eq(&cache.spline(&field), &cache.spline(&field)));
        let x = cache.line_of_sight(&field, of(Axis::X));
        for axis in [Axis::Y, Axis::X] {
            cache.line_of_sight(&field, of(axis));
        }
        assert!(Arc::ptr_eq(&x, &cache.line_of_sight(&field, of(Axis::X))));
        cache.line_of_sight(&field, of(Axis::Z));
        assert_eq!(cache.projections.lock().unwrap().len(), PROJECTIONS);
        assert!(
            !Arc::ptr_eq(&x, &cache.line_of_sight(&field, of(Axis::X))),
            "the oldest goes first"
        );
    }
}
