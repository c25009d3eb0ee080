//! What Python sees of the class `World`.

use crate::lists::Lists;
use crate::queries::{Any, Closest, RayArrays};
use crate::world::{MeshArrays, World};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use rt_core::glam::Vec3;
use rt_core::ray::NO_HIT;

/// Calls a generic function for the type of an array's numbers.
macro_rules! for_type_of {
    ($array:expr, $T:ident => $call:expr) => {
        if $array.is_instance_of::<PyArray2<f32>>() {
            type $T = f32;
            $call
        } else if $array.is_instance_of::<PyArray2<f64>>() {
            type $T = f64;
            $call
        } else {
            Err(PyTypeError::new_err("rows of float32 or float64 are needed"))
        }
    };
}

#[pymethods]
impl World {
    #[new]
    fn new(
        py: Python<'_>,
        meshes: Vec<MeshArrays<'_>>,
        quality: &str,
        robustness: &str,
        storage: &str,
        threads: usize,
    ) -> PyResult<World> {
        World::build(py, meshes, quality, robustness, storage, threads)
    }

    /// Number of triangles.
    #[getter]
    fn triangles(&self) -> u32 {
        self.firsts[self.firsts.len() - 1]
    }

    /// Bytes of the tree.
    #[getter]
    fn bytes(&self) -> usize {
        self.world.report().bytes
    }

    /// Triangles of all meshes before each mesh, and of all.
    #[getter]
    fn firsts(&self) -> Vec<u32> {
        self.firsts.clone()
    }

    /// The smallest and the largest corner, in world coordinates.
    #[getter]
    fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let bounds = self.world.bounds();
        let at = |p: Vec3| (self.world.origin() + p.as_dvec3()).to_array();
        (!bounds.is_empty()).then(|| (at(bounds.min), at(bounds.max)))
    }

    /// Seconds that the build took.
    #[getter]
    fn build_seconds(&self) -> f64 {
        self.world.report().total.as_secs_f64()
    }

    fn cast(
        &self,
        py: Python<'_>,
        origins: &Any<'_>,
        directions: &Any<'_>,
        t_min: f64,
        t_max: Option<&Any<'_>>,
        out: (Any<'_>, Any<'_>, Any<'_>, Any<'_>),
        threads: usize,
    ) -> PyResult<()> {
        for_type_of!(origins, T => {
            let arrays = RayArrays::<T>::new(origins, directions, t_min, t_max)?;
            self.cast_rays(py, &arrays, (&out.0, &out.1, &out.2, &out.3), threads)
        })
    }

    fn occluded(
        &self,
        py: Python<'_>,
        origins: &Any<'_>,
        directions: &Any<'_>,
        t_min: f64,
        t_max: Option<&Any<'_>>,
        out: &Any<'_>,
        threads: usize,
    ) -> PyResult<()> {
        for_type_of!(origins, T => {
            let arrays = RayArrays::<T>::new(origins, directions, t_min, t_max)?;
            self.occluded_rays(py, &arrays, out, threads)
        })
    }

    fn count(
        &self,
        py: Python<'_>,
        origins: &Any<'_>,
        directions: &Any<'_>,
        t_min: f64,
        t_max: Option<&Any<'_>>,
        out: &Any<'_>,
        threads: usize,
    ) -> PyResult<()> {
        for_type_of!(origins, T => {
            let arrays = RayArrays::<T>::new(origins, directions, t_min, t_max)?;
            self.count_rays(py, &arrays, out, threads)
        })
    }

    fn all_hits<'py>(
        &self,
        py: Python<'py>,
        origins: &Any<'_>,
        directions: &Any<'_>,
        t_min: f64,
        t_max: Option<&Any<'_>>,
        max_hits: usize,
        threads: usize,
    ) -> PyResult<Lists<'py>> {
        for_type_of!(origins, T => {
            let arrays = RayArrays::<T>::new(origins, directions, t_min, t_max)?;
            self.list_rays(py, &arrays, max_hits, threads)
        })
    }

    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Any<'_>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let inside = for_type_of!(points, T => self.enclosed_points::<T>(py, points, threads))?;
        Ok(PyArray1::from_vec(py, inside))
    }

    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        points: &Any<'_>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let distance = |p: Vec3| self.world.signed_distance(p).ok().flatten().unwrap_or(f32::NAN);
        let found = for_type_of!(points, T => self.points::<T, _>(py, points, threads, distance))?;
        Ok(PyArray1::from_iter(py, found.into_iter().map(|d| d.unwrap_or(f32::NAN))))
    }

    fn closest_point<'py>(
        &self,
        py: Python<'py>,
        points: &Any<'_>,
        max_distance: f32,
        threads: usize,
    ) -> PyResult<Closest<'py>> {
        let closest = |p: Vec3| self.world.closest_point(p, max_distance).ok().flatten();
        let found = for_type_of!(points, T => self.points::<T, _>(py, points, threads, closest))?;
        let (mut at, mut uv) = (Vec::new(), Vec::new());
        let (mut distances, mut primitives) = (Vec::new(), Vec::new());
        for c in found.into_iter().map(Option::flatten) {
            let point = c.map(|c| (self.world.origin() + c.point.as_dvec3()).to_array());
            at.extend(point.unwrap_or([f64::NAN; 3]));
            distances.push(c.map_or(f32::INFINITY, |c| c.distance));
            primitives.push(c.map_or(NO_HIT, |c| self.firsts[c.instance as usize] + c.prim));
            uv.extend(c.map_or([0.0; 2], |c| [c.u, c.v]));
        }
        Ok((
            PyArray1::from_vec(py, at),
            PyArray1::from_vec(py, distances),
            PyArray1::from_vec(py, primitives),
            PyArray1::from_vec(py, uv),
        ))
    }
}
