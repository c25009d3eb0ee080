//! Questions about many rays or points at once.

use crate::rays::{FirstFault, Rays, Real, row};
use crate::work::{Length, Stop, run};
use crate::world::{Corners, World};
use numpy::{
    Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadwriteArray1, PyReadwriteArray2,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;
use rt_core::glam::Vec3;
use rt_core::ray::{Hit, HitBlock, LANES, NO_HIT, Ray, RayBlock};

/// Rays that a thread takes at a time. Answers do not depend on it.
const CHUNK: usize = 1024;
/// Calls with fewer rays or points are short.
const MANY: usize = 1 << 14;

pub(crate) type Any<'py> = Bound<'py, PyAny>;

fn length_of(rows: usize) -> Length {
    if rows < MANY { Length::Short } else { Length::Long }
}

/// The arrays of a call's rays.
pub(crate) struct RayArrays<'py, T: Element> {
    origins: PyReadonlyArray2<'py, T>,
    directions: PyReadonlyArray2<'py, T>,
    t_max: Option<PyReadonlyArray1<'py, T>>,
    t_min: f64,
}

impl<'py, T: Real> RayArrays<'py, T> {
    pub(crate) fn new(
        origins: &Any<'py>,
        directions: &Any<'py>,
        t_min: f64,
        t_max: Option<&Any<'py>>,
    ) -> PyResult<Self> {
        let rows = |a: &Any<'py>| PyResult::Ok(a.cast::<PyArray2<T>>()?.try_readonly()?);
        let numbers = |a: &Any<'py>| PyResult::Ok(a.cast::<PyArray1<T>>()?.try_readonly()?);
        Ok(RayArrays {
            origins: rows(origins)?,
            directions: rows(directions)?,
            t_max: t_max.map(numbers).transpose()?,
            t_min,
        })
    }

    fn rays(&self) -> PyResult<Rays<'_, T>> {
        let (origins, directions) = (self.origins.as_slice()?, self.directions.as_slice()?);
        let t_max = self.t_max.as_ref().map_or(Ok(&[][..]), |t| t.as_slice())?;
        let rays = origins.len() / 3;
        let sound = origins.len() == 3 * rays
            && directions.len() == origins.len()
            && (self.t_max.is_none() || t_max.len() == rays);
        if !sound {
            return Err(PyValueError::new_err("arrays of rays differ in their numbers of rows"));
        }
        Ok(Rays { origins, directions, t_min: self.t_min, t_max })
    }
}

/// Whether neighbouring rays go nearly the same way, so that packets pay. Answers do not depend on
/// it.
fn are_coherent(rays: &[Ray]) -> bool {
    let similar = |pair: &[Ray]| {
        let (a, b) = (pair[0].dir, pair[1].dir);
        a.dot(b) > 0.99 * (a.length_squared() * b.length_squared()).sqrt()
    };
    let all = rays.windows(2);
    let count = all.len();
    8 * all.filter(|pair| similar(pair)).count() >= 7 * count
}

/// A thread's part of the rays.
struct Chunk {
    blocks: Vec<RayBlock>,
    coherent: bool,
}

impl Chunk {
    /// The rays from number `first` on; their origins' ways along them go to `moved`.
    fn of<T: Real>(
        world: &World,
        rays: &Rays<'_, T>,
        first: usize,
        count: usize,
        moved: &mut Vec<f64>,
        fault: &FirstFault,
    ) -> Chunk {
        let mut list = Vec::with_capacity(count);
        moved.clear();
        for i in first..first + count {
            let Some((ray, way)) = rays.get(&world.world, i) else {
                fault.note(i);
                // It meets nothing, and its call ends with an error.
                list.push(Ray::new(Vec3::ZERO, Vec3::X).with_t_max(-1.0));
                moved.push(0.0);
                continue;
            };
            list.push(ray);
            moved.push(way);
        }
        Chunk { coherent: are_coherent(&list), blocks: RayBlock::from_rays(&list) }
    }

    fn closest(&self, world: &World, hits: &mut [HitBlock]) {
        let world = &world.world;
        let traced = match self.coherent {
            true => world.closest_coherent(&self.blocks, hits),
            false => world.closest_incoherent(&self.blocks, hits),
        };
        debug_assert!(traced.is_ok(), "as many blocks of hits as of rays");
    }

    fn occluded(&self, world: &World, masks: &mut [u16]) {
        let world = &world.world;
        let traced = match self.coherent {
            true => world.occluded_coherent(&self.blocks, masks),
            false => world.occluded_incoherent(&self.blocks, masks),
        };
        debug_assert!(traced.is_ok(), "as many masks as blocks of rays");
    }
}

/// An array that answers are written to, or a refusal.
fn answers<'a, T: Element>(
    array: &'a mut PyReadwriteArray1<'_, T>,
    rows: usize,
) -> PyResult<&'a mut [T]> {
    let slice = array.as_slice_mut()?;
    if slice.len() == rows {
        return Ok(slice);
    }
    Err(PyValueError::new_err(format!("{} answers for {rows} questions", slice.len())))
}

fn answers2<'a, T: Element>(
    array: &'a mut PyReadwriteArray2<'_, T>,
    rows: usize,
    columns: usize,
) -> PyResult<&'a mut [T]> {
    let slice = array.as_slice_mut()?;
    if slice.len() == rows * columns {
        return Ok(slice);
    }
    Err(PyValueError::new_err(format!("{} answers for {rows} questions", slice.len())))
}

impl World {
    /// The number of a hit's triangle among those of all meshes.
    fn number(&self, hit: &Hit) -> u32 {
        self.firsts[hit.instance as usize] + hit.prim
    }

    pub(crate) fn cast_rays<T: Real>(
        &self,
        py: Python<'_>,
        arrays: &RayArrays<'_, T>,
        out: (&Any<'_>, &Any<'_>, &Any<'_>, &Any<'_>),
        threads: usize,
    ) -> PyResult<()> {
        let rays = arrays.rays()?;
        let rows = rays.len();
        let mut t = out.0.cast::<PyArray1<T>>()?.try_readwrite()?;
        let mut primitive = out.1.cast::<PyArray1<u32>>()?.try_readwrite()?;
        let mut uv = out.2.cast::<PyArray2<f32>>()?.try_readwrite()?;
        let mut normal = out.3.cast::<PyArray2<f32>>()?.try_readwrite()?;
        let (t, primitive) = (answers(&mut t, rows)?, answers(&mut primitive, rows)?);
        let (uv, normal) = (answers2(&mut uv, rows, 2)?, answers2(&mut normal, rows, 3)?);
        let borrowed = self.borrow(py)?;
        let corners: Vec<Corners<'_>> =
            borrowed.iter().map(|b| b.corners()).collect::<PyResult<_>>()?;
        let fault = FirstFault::none();
        let work = |stop: &Stop| {
            let parts = t.par_chunks_mut(CHUNK).zip(primitive.par_chunks_mut(CHUNK));
            let parts = parts.zip(uv.as_chunks_mut::<2>().0.par_chunks_mut(CHUNK));
            let parts = parts.zip(normal.as_chunks_mut::<3>().0.par_chunks_mut(CHUNK));
            let scratch = || (Vec::new(), Vec::new());
            let trace = |(moved, hits): &mut (Vec<f64>, Vec<HitBlock>), (k, part)| {
                if stop.is_asked() {
                    return;
                }
                let (((t, primitive), uv), normal): (((&mut [T], &mut [u32]), _), _) = part;
                let (uv, normal): (&mut [[f32; 2]], &mut [[f32; 3]]) = (uv, normal);
                let chunk = Chunk::of(self, &rays, k * CHUNK, t.len(), moved, &fault);
                hits.resize(chunk.blocks.len(), HitBlock::MISS);
                chunk.closest(self, hits);
                for i in 0..t.len() {
                    let Some(hit) = hits[i / LANES].get(i % LANES) else {
                        t[i] = T::nearest(f64::INFINITY);
                        (primitive[i], uv[i], normal[i]) = (NO_HIT, [0.0; 2], [0.0; 3]);
                        continue;
                    };
                    t[i] = T::nearest(f64::from(hit.t) + moved[i]);
                    primitive[i] = self.number(&hit);
                    uv[i] = [hit.u, hit.v];
                    normal[i] = corners[hit.instance as usize].normal(hit.prim).to_array();
                }
            };
            parts.enumerate().for_each_init(scratch, trace);
        };
        run(py, threads, length_of(rows), work)?;
        fault.get().map_or(Ok(()), |i| Err(rays.error(i)))
    }

    pub(crate) fn occluded_rays<T: Real>(
        &self,
        py: Python<'_>,
        arrays: &RayArrays<'_, T>,
        out: &Any<'_>,
        threads: usize,
    ) -> PyResult<()> {
        let rays = arrays.rays()?;
        let mut out = out.cast::<PyArray1<bool>>()?.try_readwrite()?;
        let out = answers(&mut out, rays.len())?;
        let fault = FirstFault::none();
        let work = |stop: &Stop| {
            let trace = |(moved, masks): &mut (Vec<f64>, Vec<u16>),
                         (k, out): (usize, &mut [bool])| {
                if stop.is_asked() {
                    return;
                }
                let chunk = Chunk::of(self, &rays, k * CHUNK, out.len(), moved, &fault);
                masks.resize(chunk.blocks.len(), 0);
                chunk.occluded(self, masks);
                for (i, o) in out.iter_mut().enumerate() {
                    *o = masks[i / LANES] >> (i % LANES) & 1 == 1;
                }
            };
            let parts = out.par_chunks_mut(CHUNK).enumerate();
            parts.for_each_init(|| (Vec::new(), Vec::new()), trace);
        };
        run(py, threads, length_of(rays.len()), work)?;
        fault.get().map_or(Ok(()), |i| Err(rays.error(i)))
    }

    pub(crate) fn count_rays<T: Real>(
        &self,
        py: Python<'_>,
        arrays: &RayArrays<'_, T>,
        out: &Any<'_>,
        threads: usize,
    ) -> PyResult<()> {
        let rays = arrays.rays()?;
        let mut out = out.cast::<PyArray1<u32>>()?.try_readwrite()?;
        let out = answers(&mut out, rays.len())?;
        let fault = FirstFault::none();
        let work = |stop: &Stop| {
            out.par_iter_mut().with_min_len(64).enumerate().for_each(|(i, out)| {
                if stop.is_asked() {
                    return;
                }
                match rays.get(&self.world, i) {
                    Some((ray, _)) => *out = self.world.count_hits(&ray) as u32,
                    None => fault.note(i),
                }
            });
        };
        run(py, threads, length_of(rays.len()), work)?;
        fault.get().map_or(Ok(()), |i| Err(rays.error(i)))
    }

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
        let full = FirstFault::none();
        let work = |stop: &Stop| {
            let list = |k: usize| {
                let mut part = Part::default();
                for i in k * CHUNK..rows.min((k + 1) * CHUNK) {
                    let unusable = stop.is_asked() || full.get().is_some();
                    let Some((ray, moved)) = rays.get(&self.world, i).filter(|_| !unusable) else {
                        if !unusable {
                            fault.note(i);
                        }
                        part.counts.push(0);
                        continue;
                    };
                    let Ok(hits) = self.world.all_hits(&ray, limit) else {
                        full.note(i);
                        part.counts.push(0);
                        continue;
                    };
                    part.counts.push(hits.len());
                    for hit in &hits {
                        part.t.push(T::nearest(f64::from(hit.t) + moved));
                        part.primitive.push(self.number(hit));
                        part.uv.extend([hit.u, hit.v]);
                    }
                }
                part
            };
            (0..rows.div_ceil(CHUNK)).into_par_iter().map(list).collect::<Vec<Part<T>>>()
        };
        let parts = run(py, threads, length_of(rows), work)?;
        if let Some(i) = fault.get() {
            return Err(rays.error(i));
        }
        let all: usize = parts.iter().map(|p| p.primitive.len()).sum();
        if let Some(what) = full
            .get()
            .map(|i| format!("ray {i} alone has"))
            .or_else(|| (all > limit).then(|| format!("{rows} rays have {all} hits,")))
        {
            return Err(PyValueError::new_err(format!(
                "{what} more than max_hits = {limit}; raise max_hits, cast fewer rays in one \
                 call, or use count()"
            )));
        }
        let mut starts = Vec::with_capacity(rows + 1);
        let mut sum = 0i64;
        starts.push(sum);
        for count in parts.iter().flat_map(|p| &p.counts) {
            sum += *count as i64;
            starts.push(sum);
        }
        let (mut t, mut primitive) = (Vec::with_capacity(all), Vec::with_capacity(all));
        let mut uv = Vec::with_capacity(2 * all);
        for part in parts {
            t.extend(part.t);
            primitive.extend(part.primitive);
            uv.extend(part.uv);
        }
        Ok((
            PyArray1::from_vec(py, starts),
            PyArray1::from_vec(py, t).into_any(),
            PyArray1::from_vec(py, primitive),
            PyArray1::from_vec(py, uv),
        ))
    }

    pub(crate) fn points<T: Real, A: Send>(
        &self,
        py: Python<'_>,
        points: &Any<'_>,
        threads: usize,
        answer: impl Fn(Vec3) -> A + Sync,
    ) -> PyResult<Vec<Option<A>>> {
        let points = points.cast::<PyArray2<T>>()?.try_readonly()?;
        let points = points.as_slice()?;
        let rows = points.len() / 3;
        let fault = FirstFault::none();
        let work = |stop: &Stop| {
            let one = |i: usize| {
                let point = row(points, i);
                if !point.is_finite() {
                    fault.note(i);
                }
                (!stop.is_asked()).then(|| answer(self.world.render_from_world(point)))
            };
            (0..rows).into_par_iter().with_min_len(32).map(one).collect()
        };
        let found = run(py, threads, length_of(rows), work)?;
        match fault.get() {
            None => Ok(found),
            Some(i) => {
                let p = row(points, i);
                Err(PyValueError::new_err(format!(
                    "points[{i}] is [{:?}, {:?}, {:?}]; give finite numbers",
                    p.x, p.y, p.z
                )))
            }
        }
    }
}

/// Starts of the lists, t, primitive, and u, v in turns.
pub(crate) type Lists<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyAny>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f32>>,
);
/// Points, distances, primitives, and u, v in turns.
pub(crate) type Closest<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f32>>,
);

/// The lists of a chunk's rays.
struct Part<T> {
    counts: Vec<usize>,
    t: Vec<T>,
    primitive: Vec<u32>,
    uv: Vec<f32>,
}

impl<T> Default for Part<T> {
    fn default() -> Self {
        Part { counts: Vec::new(), t: Vec::new(), primitive: Vec::new(), uv: Vec::new() }
    }
}
