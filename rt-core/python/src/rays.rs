//! Rays as numpy has them: rows of f32 or f64 in world coordinates.

use numpy::Element;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rt_core::bvh::RenderSpace;
use rt_core::glam::DVec3;
use rt_core::prelude::Ray;
use std::sync::atomic::{AtomicUsize, Ordering};

/// `numpy.float32` or `numpy.float64`.
pub(crate) trait Real: Element + Copy {
    fn widened(self) -> f64;
    fn nearest(value: f64) -> Self;
}

impl Real for f32 {
    fn widened(self) -> f64 {
        f64::from(self)
    }
    fn nearest(value: f64) -> f32 {
        value as f32
    }
}

impl Real for f64 {
    fn widened(self) -> f64 {
        self
    }
    fn nearest(value: f64) -> f64 {
        value
    }
}

/// Row `i` of an array of x, y, z.
#[inline]
pub(crate) fn row<T: Real>(rows: &[T], i: usize) -> DVec3 {
    let [x, y, z] = [0, 1, 2].map(|k| rows[3 * i + k].widened());
    DVec3::new(x, y, z)
}

/// Rays, one row each.
#[derive(Clone, Copy)]
pub(crate) struct Rays<'a, T> {
    pub(crate) origins: &'a [T],
    pub(crate) directions: &'a [T],
    pub(crate) t_min: f64,
    /// Empty for no limit.
    pub(crate) t_max: &'a [T],
}

impl<T: Real> Rays<'_, T> {
    pub(crate) fn len(&self) -> usize {
        self.origins.len() / 3
    }

    /// Ray `i` as a world wants it, and how far its origin was moved; `None` when a number of it
    /// cannot be used.
    #[inline]
    pub(crate) fn get(&self, space: &RenderSpace, i: usize) -> Option<(Ray, f64)> {
        let (origin, dir) = (row(self.origins, i), row(self.directions, i));
        let t_max = self.t_max.get(i).map_or(f64::INFINITY, |t| t.widened());
        let (ray, moved) = space.ray(origin, dir);
        let usable = origin.is_finite() && ray.dir.is_finite() && dir != DVec3::ZERO;
        if !usable || t_max.is_nan() {
            return None;
        }
        let limit = |t: f64| if t.is_finite() { (t - moved) as f32 } else { t as f32 };
        let ray = Ray { t_min: limit(self.t_min).max(0.0), ..ray };
        Some((ray.with_t_max(limit(t_max)), moved))
    }

    /// The error that names ray `i`.
    pub(crate) fn error(&self, i: usize) -> PyErr {
        let (origin, dir) = (row(self.origins, i), row(self.directions, i));
        let numbers = |v: DVec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        PyValueError::new_err(if !origin.is_finite() {
            format!("origins[{i}] is {}; give finite numbers", numbers(origin))
        } else if dir == DVec3::ZERO {
            format!("directions[{i}] is zero; give a direction, of any length but zero")
        } else if !dir.as_vec3().is_finite() {
            format!("directions[{i}] is {}; give finite numbers below 3e38", numbers(dir))
        } else {
            format!("t_max[{i}] is NaN; give a number, or infinity for no limit")
        })
    }
}

/// The first of the rows that some thread could not use.
pub(crate) struct FirstFault(AtomicUsize);

impl FirstFault {
    pub(crate) fn none() -> Self {
        FirstFault(AtomicUsize::new(usize::MAX))
    }

    pub(crate) fn note(&self, row: usize) {
        self.0.fetch_min(row, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> Option<usize> {
        Some(self.0.load(Ordering::Relaxed)).filter(|row| *row != usize::MAX)
    }
}
