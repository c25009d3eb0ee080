//! All hits of many rays.

use crate::parts::{for_each, length_of, map, part_size};
use crate::queries::{Chunk, RayArrays};
use crate::rays::{FirstFault, Rays, Real};
use crate::work::{Stop, run};
use crate::world::World;
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rt_core::bvh::HitLists;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Starts of the lists, t, primitive, and u, v in turns.
pub(crate) type Lists<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyAny>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f32>>,
);

/// The lists of a chunk's rays, and how far the rays' origins were moved along them.
struct Part {
    lists: HitLists,
    moved: Vec<f64>,
}

/// Hits so far, of the most that are allowed.
struct Allowance {
    found: AtomicUsize,
    limit: usize,
}

impl Allowance {
    fn is_spent(&self) -> bool {
        self.found.load(Ordering::Relaxed) > self.limit
    }

    /// What is left: no part holds more, so that all together hold at most this for each thread.
    fn rest(&self) -> usize {
        self.limit.saturating_sub(self.found.load(Ordering::Relaxed))
    }

    fn spend(&self, hits: usize) {
        let most = usize::MAX - hits;
        let sum = |found: usize| Some(found.min(most) + hits);
        let _ = self.found.fetch_update(Ordering::Relaxed, Ordering::Relaxed, sum);
    }
}

impl World {
    pub(crate) fn list_rays<'py, T: Real>(
        &self,
        py: Python<'py>,
        arrays: &RayArrays<'_, T>,
        limit: usize,
        threads: usize,
    ) -> PyResult<Lists<'py>> {
        let rays = arrays.rays()?;
        let rows = rays.len();
        let fault = FirstFault::none();
        let allowance = Allowance { found: AtomicUsize::new(0), limit };
        let work = |stop: &Stop| {
            let parts = self.trace_lists(&rays, &fault, &allowance, stop);
            if stop.is_asked() || fault.get().is_some() || allowance.is_spent() {
                return Default::default();
            }
            self.flatten(&parts, rows)
        };
        let (starts, t, primitive, uv): (Vec<i64>, Vec<T>, Vec<u32>, Vec<f32>) =
            run(py, threads, length_of(rows), work)?;
        if let Some(i) = fault.get() {
            return Err(rays.error(i));
        }
        if allowance.is_spent() {
            return Err(PyValueError::new_err(format!(
                "{rows} rays have more hits than max_hits = {limit}; raise max_hits, cast fewer \
                 rays in one call, or use count()"
            )));
        }
        Ok((
            PyArray1::from_vec(py, starts),
            PyArray1::from_vec(py, t).into_any(),
            PyArray1::from_vec(py, primitive),
            PyArray1::from_vec(py, uv),
        ))
    }

    fn trace_lists<T: Real>(
        &self,
        rays: &Rays<'_, T>,
        fault: &FirstFault,
        allowance: &Allowance,
        stop: &Stop,
    ) -> Vec<Part> {
        let (rows, size) = (rays.len(), part_size(rays.len()));
        let list = |k: usize| {
            let (first, mut moved) = (k * size, Vec::new());
            let none = Part { lists: HitLists::default(), moved: Vec::new() };
            if stop.is_asked() || allowance.is_spent() {
                return none;
            }
            let chunk = Chunk::of(self, rays, first, size.min(rows - first), &mut moved, fault);
            match self.world.all_hits_of_blocks(&chunk.blocks, allowance.rest()) {
                Ok(lists) => {
                    allowance.spend(lists.hits().len());
                    Part { lists, moved }
                }
                Err(_) => {
                    allowance.spend(usize::MAX);
                    none
                }
            }
        };
        map(rows.div_ceil(size), list)
    }

    /// The arrays of the answer: starts, t, primitive, u and v.
    fn flatten<T: Real>(
        &self,
        parts: &[Part],
        rows: usize,
    ) -> (Vec<i64>, Vec<T>, Vec<u32>, Vec<f32>) {
        let all = parts.iter().map(|p| p.lists.hits().len()).sum();
        let mut starts = vec![0i64; rows + 1];
        let (mut t, mut primitive) = (vec![T::nearest(0.0); all], vec![0u32; all]);
        let mut uv = vec![0f32; 2 * all];
        // Each part with its own pieces of the arrays, so that threads fill them side by side.
        let mut pieces = Vec::with_capacity(parts.len());
        let (mut t_left, mut primitive_left) = (&mut t[..], &mut primitive[..]);
        let (mut uv_left, mut starts_left) = (uv.as_chunks_mut::<2>().0, &mut starts[1..]);
        let mut first = 0i64;
        for part in parts {
            let hits = part.lists.hits().len();
            let (t, primitive, uv, starts);
            (t, t_left) = t_left.split_at_mut(hits);
            (primitive, primitive_left) = primitive_left.split_at_mut(hits);
            (uv, uv_left) = uv_left.split_at_mut(hits);
            (starts, starts_left) = starts_left.split_at_mut(part.moved.len());
            pieces.push((part, first, starts, t, primitive, uv));
            first += hits as i64;
        }
        for_each(
            pieces,
            || (),
            |(), (part, first, starts, t, primitive, uv)| {
                let ends = &part.lists.starts()[1..];
                let mut i = 0;
                for ((start, end), moved) in starts.iter_mut().zip(ends).zip(&part.moved) {
                    *start = first + *end as i64;
                    for hit in &part.lists.hits()[i..*end] {
                        t[i] = T::nearest(f64::from(hit.t) + moved);
                        primitive[i] = self.number(hit);
                        uv[i] = [hit.u, hit.v];
                        i += 1;
                    }
                }
            },
        );
        (starts, t, primitive, uv)
    }
}
