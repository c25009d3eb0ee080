//! Scenes to render, and their pictures.

use crate::work::{Length, Stop, run};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rt_core::camera::Camera;
use rt_core::colormap::ColorMap;
use rt_core::frame::{Encoding, Frame, Layers};
use rt_core::glam::{DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::light::Light;
use rt_core::material::{ColorSource, Material};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::{RenderOptions, StopReason, render};
use rt_core::scene::{AmbientOcclusion, Scene, SceneBuilder};
use rt_core::shapes::{Isosurface, IsosurfaceNormals, IsosurfaceOptions, Radii, Spheres, Tubes};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions};
use std::fmt::Display;
use std::sync::Arc;

type Floats<'py> = PyReadonlyArray1<'py, f32>;

/// Numbers of several types, of which the caller knows the meaning.
struct Thing<'a, 'py>(&'a Bound<'py, PyDict>);

impl<'py> Thing<'_, 'py> {
    fn maybe(&self, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(self.0.get_item(name)?.filter(|v| !v.is_none()))
    }

    fn item(&self, name: &str) -> PyResult<Bound<'py, PyAny>> {
        self.maybe(name)?.ok_or_else(|| PyKeyError::new_err(name.to_owned()))
    }

    fn floats(&self, name: &str) -> PyResult<Option<Vec<f32>>> {
        let array: Option<PyResult<Floats<'py>>> = self.maybe(name)?.map(|v| v.extract());
        Ok(match array.transpose()? {
            Some(a) => Some(a.as_slice()?.to_vec()),
            None => None,
        })
    }

    fn needed(&self, name: &str) -> PyResult<Vec<f32>> {
        self.floats(name)?.ok_or_else(|| PyKeyError::new_err(name.to_owned()))
    }

    fn vectors(&self, name: &str) -> PyResult<Vec<Vec3>> {
        Ok(self.needed(name)?.as_chunks().0.iter().copied().map(Vec3::from).collect())
    }

    fn ids(&self, name: &str) -> PyResult<Vec<u32>> {
        let array: PyReadonlyArray1<'py, u32> = self.item(name)?.extract()?;
        Ok(array.as_slice()?.to_vec())
    }

    fn vector(&self, name: &str) -> PyResult<DVec3> {
        Ok(DVec3::from(self.item(name)?.extract::<[f64; 3]>()?))
    }

    fn colors(&self) -> PyResult<Option<Vec<[f32; 4]>>> {
        Ok(self.floats("colors")?.map(|c| c.as_chunks().0.to_vec()))
    }

    fn radii(&self) -> PyResult<Radii> {
        let all = self.needed("radii")?;
        Ok(match all[..] {
            [one] => Radii::Common(one),
            _ => Radii::Each(all),
        })
    }

    fn color_map(&self) -> PyResult<Option<ColorMap>> {
        let Some(colors) = self.floats("color_map")? else { return Ok(None) };
        Ok(Some(ColorMap::new(colors.as_chunks().0.to_vec(), self.item("range")?.extract()?)))
    }

    fn material(&self) -> PyResult<Material> {
        let color = self.item("color")?.extract()?;
        let shine: f32 = self.item("shine")?.extract()?;
        let plain =
            if shine > 0.0 { Material::phong(color, shine, 40.0) } else { Material::matte(color) };
        let plain = plain.with_opacity(self.item("opacity")?.extract()?);
        if self.maybe("colors")?.is_some() {
            return Ok(Material { color_source: ColorSource::Attribute, ..plain });
        }
        let map = match self.maybe("scalars")?.is_some() || self.maybe("values")?.is_some() {
            true => self.color_map()?,
            false => None,
        };
        Ok(match map {
            Some(map) => plain.colored_by_scalars(map),
            None => plain,
        })
    }

    fn grid(&self) -> PyResult<Arc<Grid>> {
        let dims = UVec3::from(self.item("dims")?.extract::<[u32; 3]>()?);
        let (origin, spacing) = (self.vector("origin")?, self.vector("spacing")?);
        Ok(Arc::new(Grid::new(dims, origin, spacing, self.needed("values")?).map_err(refused)?))
    }

    fn add_to(&self, scene: &mut SceneBuilder) -> PyResult<()> {
        let kind: String = self.item("kind")?.extract()?;
        let origin = || self.vector("origin");
        match kind.as_str() {
            "mesh" => {
                let indices = self.ids("triangles")?.as_chunks().0.to_vec();
                let positions = self.vectors("points")?;
                let count = positions.len();
                let per_vertex = |n: usize| n == count;
                let scalars =
                    self.floats("scalars")?.map(|values| match per_vertex(values.len()) {
                        true => Attribute::per_vertex(values),
                        false => Attribute::per_face(values),
                    });
                let colors = self.colors()?.map(|values| match per_vertex(values.len()) {
                    true => Attribute::per_vertex(values),
                    false => Attribute::per_face(values),
                });
                let normals = match self.maybe("normals")? {
                    Some(_) => Some(Attribute::per_vertex(self.vectors("normals")?)),
                    None => None,
                };
                let mesh = TriMesh {
                    origin: origin()?,
                    normals,
                    colors,
                    scalars,
                    ..TriMesh::new(positions, indices)
                };
                scene.mesh(mesh, self.material()?);
            }
            "spheres" => {
                let made = Spheres::new(self.vectors("points")?, self.radii()?);
                let mut made = made.map_err(refused)?.with_origin(origin()?);
                if let Some(scalars) = self.floats("scalars")? {
                    made = made.with_scalars(scalars).map_err(refused)?;
                }
                if let Some(colors) = self.colors()? {
                    made = made.with_colors(colors).map_err(refused)?;
                }
                scene.shape(Arc::new(made), self.material()?);
            }
            "tubes" => {
                let points = self.vectors("points")?;
                let made = Tubes::new(points, &self.ids("offsets")?, self.radii()?);
                let mut made = made.map_err(refused)?.with_origin(origin()?);
                if let Some(scalars) = self.floats("scalars")? {
                    made = made.with_scalars(scalars).map_err(refused)?;
                }
                if let Some(colors) = self.colors()? {
                    made = made.with_colors(colors).map_err(refused)?;
                }
                scene.shape(Arc::new(made), self.material()?);
            }
            "isosurface" => {
                let normals = IsosurfaceNormals::Smooth;
                let options = IsosurfaceOptions { normals, ..IsosurfaceOptions::default() };
                let made = Isosurface::new(self.grid()?, &self.needed("isovalues")?, &options);
                scene.shape(Arc::new(made.map_err(refused)?), self.material()?);
            }
            "volume" => {
                let map = self.color_map()?.ok_or_else(|| PyKeyError::new_err("color_map"))?;
                let opacity = self.needed("opacity_points")?;
                let unit = self.item("unit_distance")?.extract()?;
                let transfer = TransferFunction::from_opacity(map, opacity.as_chunks().0, unit);
                let transfer = transfer.map_err(refused)?;
                let made = Volume::new(self.grid()?, transfer, VolumeOptions::default());
                scene.volume(made.map_err(refused)?);
            }
            other => return Err(PyValueError::new_err(format!("there is no kind `{other}`"))),
        }
        Ok(())
    }
}

fn refused(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A scene that can be rendered.
#[pyclass(frozen, module = "rt_core._rt_core")]
pub(crate) struct Stage(Scene);

/// Name and numbers of a layer.
type Layer<'py> = (&'static str, Bound<'py, PyAny>);

fn layers_of<'py>(py: Python<'py>, frame: Frame, rgba8: Vec<u8>) -> Vec<Layer<'py>> {
    let mut layers = vec![("rgba8", PyArray1::from_vec(py, rgba8).into_any())];
    let color = frame.color.into_iter().flatten().collect();
    let normal = frame.normal.into_iter().flatten().collect();
    for (name, values) in
        [("color", color), ("depth", frame.depth), ("distance", frame.distance), ("normal", normal)]
    {
        layers.push((name, PyArray1::<f32>::from_vec(py, values).into_any()));
    }
    for (name, values) in [("object", frame.instance), ("primitive", frame.primitive)] {
        layers.push((name, PyArray1::<u32>::from_vec(py, values).into_any()));
    }
    layers
}

#[pymethods]
impl Stage {
    #[new]
    fn new(
        py: Python<'_>,
        things: Vec<Bound<'_, PyDict>>,
        lights: Vec<[f64; 3]>,
        ambient: f32,
        ambient_occlusion: Option<(f64, u32)>,
        threads: usize,
    ) -> PyResult<Stage> {
        let mut scene = SceneBuilder::new();
        for (number, thing) in things.iter().enumerate() {
            Thing(thing).add_to(&mut scene).map_err(|e| {
                if !e.is_instance_of::<PyValueError>(py) {
                    return e;
                }
                PyValueError::new_err(format!("object {number}: {}", e.value(py)))
            })?;
        }
        if lights.is_empty() {
            scene.light(Light::headlight().with_color([1.0 - ambient; 3]));
        }
        for light in lights {
            scene.light(Light::directional(DVec3::from(light)).with_color([1.0 - ambient; 3]));
        }
        if ambient > 0.0 {
            scene.light(Light::ambient([ambient; 3]));
        }
        scene.ambient_occlusion =
            ambient_occlusion.map(|(distance, rays)| AmbientOcclusion { distance, rays });
        let built = run(py, threads, Length::Long, |_: &Stop| scene.build())?;
        Ok(Stage(built.map_err(refused)?))
    }

    /// The smallest and the largest corner of everything.
    #[getter]
    fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let world = &self.0.world;
        let bounds = world.bounds();
        let at = |p: Vec3| world.origin() + p.as_dvec3();
        let surfaces = (!bounds.is_empty()).then(|| (at(bounds.min), at(bounds.max)));
        let grids = self.0.volumes.iter().map(|v| v.volume.grid());
        let volumes = grids.map(|g| (g.origin(), g.max_corner()));
        let all = surfaces.into_iter().chain(volumes);
        let all = all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        all.map(|(low, high)| (low.to_array(), high.to_array()))
    }

    /// A picture as seen from `eye`.
    fn render<'py>(
        &self,
        py: Python<'py>,
        view: ([f64; 3], [f64; 3], [f64; 3]),
        lens: (f64, bool, [f64; 2]),
        size: (u32, u32),
        samples: u32,
        seed: u64,
        threads: usize,
    ) -> PyResult<(Vec<Layer<'py>>, Vec<String>)> {
        let (eye, target, up) = (view.0.into(), view.1.into(), view.2.into());
        let aspect = f64::from(size.0) / f64::from(size.1.max(1));
        let (extent, parallel, range) = lens;
        let camera = match parallel {
            true => Camera::orthographic(eye, target, up, extent, aspect, range),
            false => Camera::perspective(eye, target, up, extent, aspect, range),
        };
        let camera = camera.map_err(refused)?;
        let geometry = Layers::DEPTH | Layers::DISTANCE | Layers::NORMAL | Layers::IDS;
        let options = RenderOptions {
            samples,
            seed,
            layers: Layers::COLOR | geometry,
            ..RenderOptions::new(size.0, size.1)
        };
        let work = |stop: &Stop| {
            let options = RenderOptions { cancel: Some(stop.flag()), ..options };
            let rendered = render(&self.0, &camera, &options);
            if rendered.as_ref().is_ok_and(|o| o.report.stopped == StopReason::Cancelled) {
                stop.note();
            }
            rendered
        };
        let output = run(py, threads, Length::Long, work)?.map_err(refused)?;
        let rgba8 = output.frame.to_rgba8(Encoding::Srgb, 1.0);
        Ok((layers_of(py, output.frame, rgba8), output.report.warnings))
    }
}
