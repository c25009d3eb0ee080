//! What is drawn: geometry in a [`World`], how each instance looks, lights and surroundings.
//!
//! ```
//! use rt_core::{camera::Camera, glam::{DVec3, Vec3}, light::Light, material::Material, mesh::TriMesh};
//! use rt_core::{render::{RenderOptions, render}, scene::SceneBuilder};
//!
//! let floor = TriMesh::new(vec![Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::new(0.0, 9.0, 0.0)], vec![[0, 1, 2]]);
//! let mut builder = SceneBuilder::new();
//! builder.mesh(floor, Material::matte([0.5, 0.25, 1.0]));
//! builder.light(Light::directional(DVec3::Z));
//! let scene = builder.build().unwrap();
//! let camera = Camera::perspective(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y, 0.5, 1.0, [0.1, 100.0]).unwrap();
//! let output = render(&scene, &camera, &RenderOptions::new(32, 32)).unwrap();
//! assert_eq!(output.frame.color_at(16, 16), [0.5, 0.25, 1.0, 1.0]);
//! assert_eq!(output.report.rays.reflection, 0);
//! ```

mod part;

pub(crate) use part::attribute_part;

use crate::accel::{BuildError, BuildOptions, Geometry, Instance, World};
use crate::effects::Effects;
use crate::environment::{Background, Environment};
use crate::light::Light;
use crate::material::{ColorSource, Material, SurfaceModel};
use crate::mesh::{Attribute, PerElement, TriMesh};
use crate::shade::reflection_of;
use crate::shapes::Shape;
use crate::volume::Volume;
use glam::DAffine3;
use std::sync::Arc;

/// How one instance looks.
#[derive(Debug, Clone, Default)]
pub struct Appearance {
    /// Index into [`Scene::materials`].
    pub material: usize,
    colors: Option<Arc<Attribute<[f32; 4]>>>,
    colors_have_alpha: bool,
    scalars: Option<Arc<Attribute<f32>>>,
}

impl Appearance {
    /// A material and the geometry's own attributes.
    pub fn new(material: usize) -> Appearance {
        Appearance { material, ..Appearance::default() }
    }

    /// Colours in place of the mesh's own (linear RGBA): recolouring needs no new acceleration structure.
    #[must_use]
    pub fn with_colors(mut self, colors: impl Into<Arc<Attribute<[f32; 4]>>>) -> Appearance {
        let colors = colors.into();
        self.colors_have_alpha = has_alpha(&colors);
        self.colors = Some(colors);
        self
    }

    /// Scalars in place of the mesh's own.
    #[must_use]
    pub fn with_scalars(mut self, scalars: impl Into<Arc<Attribute<f32>>>) -> Appearance {
        self.scalars = Some(scalars.into());
        self
    }

    /// Colours in place of the mesh's own.
    pub fn colors(&self) -> Option<&Attribute<[f32; 4]>> {
        self.colors.as_deref()
    }

    /// Scalars in place of the mesh's own.
    pub fn scalars(&self) -> Option<&Attribute<f32>> {
        self.scalars.as_deref()
    }
}

/// Dimming of ambient and environment light by near surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AmbientOcclusion {
    /// How far a surface can be and still dim, world units; infinity for no limit.
    pub distance: f64,
    /// Rays per shaded point and sample.
    pub rays: u32,
}

/// A volume placed in the world. Where volumes overlap, their media mix.
#[derive(Clone)]
pub struct PlacedVolume {
    /// The medium.
    pub volume: Arc<Volume>,
    /// Object to world. Extinction is per object-space length: a volume scaled up is thicker, not denser.
    pub world_from_object: DAffine3,
}

/// Everything that is drawn. Materials, lights and appearances may change between frames; the world is built once.
#[derive(Clone)]
pub struct Scene {
    /// Geometry.
    pub world: Arc<World>,
    /// One per instance of the world.
    pub appearances: Vec<Appearance>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Light from infinitely far.
    pub environment: Option<Environment>,
    /// What fills uncovered pixels.
    pub background: Background,
    /// Ambient occlusion; `None` for none.
    pub ambient_occlusion: Option<AmbientOcclusion>,
    /// Direct volume rendering, in front of, between and behind surfaces. Volumes cast no shadows and have no depth.
    pub volumes: Vec<PlacedVolume>,
    geometry_has_alpha: Vec<bool>,
}

/// Why a scene cannot be drawn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// The world could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// Appearances and instances do not match.
    #[error("scene has {appearances} appearances for {instances} instances; give one per instance")]
    Appearances {
        /// How many there are.
        appearances: usize,
        /// How many are needed.
        instances: usize,
    },
    /// An appearance names a material that does not exist.
    #[error("appearance {appearance} uses material {material}, but there are only {count}")]
    NoSuchMaterial {
        /// Index of the appearance.
        appearance: usize,
        /// The material it names.
        material: usize,
        /// How many there are.
        count: usize,
    },
    /// A number of a material or light is out of range.
    #[error("{what} {index}: {field} is {value}; it must be {rule}")]
    OutOfRange {
        /// "material", "light", ...
        what: &'static str,
        /// Its index.
        index: usize,
        /// Which number.
        field: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// An attribute override has the wrong length.
    #[error("appearance {appearance}: {field} has {found} values; its mesh needs {expected}")]
    AttributeLength {
        /// Index of the appearance.
        appearance: usize,
        /// "colors" or "scalars".
        field: &'static str,
        /// Number of values needed.
        expected: usize,
        /// Number of values found.
        found: usize,
    },
}

impl Scene {
    /// A scene of `world` with one white matte material and a headlight.
    pub fn new(world: impl Into<Arc<World>>) -> Scene {
        let world = world.into();
        let geometry_has_alpha = world
            .geometries()
            .iter()
            .map(|g| match g {
                Geometry::Mesh(m) => m.colors.as_ref().is_some_and(has_alpha),
                Geometry::Shape(s) => s.has_transparency(),
            })
            .collect();
        Scene {
            appearances: vec![Appearance::default(); world.instances().len()],
            world,
            materials: vec![Material::matte([1.0; 3])],
            lights: vec![Light::headlight()],
            environment: None,
            background: Background::Transparent,
            ambient_occlusion: None,
            volumes: Vec::new(),
            geometry_has_alpha,
        }
    }

    /// Checks indices and numbers.
    pub fn check(&self) -> Result<(), SceneError> {
        let (appearances, instances) = (self.appearances.len(), self.world.instances().len());
        if appearances != instances {
            return Err(SceneError::Appearances { appearances, instances });
        }
        for (index, m) in self.materials.iter().enumerate() {
            m.check().map_err(|(field, value, rule)| SceneError::OutOfRange {
                what: "material",
                index,
                field,
                value,
                rule,
            })?;
        }
        for (index, l) in self.lights.iter().enumerate() {
            check_light(l).map_err(|(field, value, rule)| SceneError::OutOfRange {
                what: "light",
                index,
                field,
                value,
                rule,
            })?;
        }
        if let Some(ao) = self.ambient_occlusion {
            let error = |field, value, rule| SceneError::OutOfRange {
                what: "ambient occlusion",
                index: 0,
                field,
                value,
                rule,
            };
            if ao.distance.is_nan() || ao.distance <= 0.0 {
                return Err(error("distance", ao.distance.to_string(), "positive (infinity for no limit)"));
            }
            if ao.rays == 0 {
                return Err(error(
                    "rays",
                    "0".into(),
                    "at least 1; leave ambient occlusion out to have none",
                ));
            }
        }
        for (index, v) in self.volumes.iter().enumerate() {
            let determinant = v.world_from_object.matrix3.determinant();
            if !(v.world_from_object.is_finite() && determinant != 0.0 && determinant.is_finite()) {
                let (field, value, rule) =
                    ("world_from_object", format!("{:?}", v.world_from_object), "finite and invertible");
                return Err(SceneError::OutOfRange { what: "volume", index, field, value, rule });
            }
        }
        for (appearance, a) in self.appearances.iter().enumerate() {
            let (material, count) = (a.material, self.materials.len());
            if material >= count {
                return Err(SceneError::NoSuchMaterial { appearance, material, count });
            }
            let Geometry::Mesh(mesh) = &self.world.geometries()[self.world.instances()[appearance].geometry]
            else {
                continue;
            };
            let expected = |per| match per {
                PerElement::Vertex => mesh.positions.len(),
                PerElement::Face => mesh.indices.len(),
            };
            let colors = a.colors.as_ref().map(|c| ("colors", expected(c.per), c.values.len()));
            let scalars = a.scalars.as_ref().map(|s| ("scalars", expected(s.per), s.values.len()));
            for (field, expected, found) in colors.into_iter().chain(scalars) {
                if expected != found {
                    return Err(SceneError::AttributeLength { appearance, field, expected, found });
                }
            }
        }
        Ok(())
    }

    /// Requests in the scene that cannot change a pixel, in words: ambient occlusion without ambient light, colour maps without
    /// scalars, textures without coordinates. They are part of every render report.
    pub fn warnings(&self) -> Vec<String> {
        let mut out = Vec::new();
        if self.ambient_occlusion.is_some() && !self.has_ambient() {
            out.push("ambient occlusion changes no pixel: the scene has no ambient light and no environment to dim".into());
        }
        let mut reported = vec![[false; 3]; self.materials.len()];
        let mut first =
            |material: usize, kind: usize| !std::mem::replace(&mut reported[material][kind], true);
        for (i, a) in self.appearances.iter().enumerate() {
            let Some(material) = self.materials.get(a.material) else { continue };
            let Geometry::Mesh(mesh) = &self.world.geometries()[self.world.instances()[i].geometry] else {
                continue;
            };
            if let Some(what) = material.detail.as_ref().and_then(|d| d.lacks(mesh))
                && first(a.material, 2)
            {
                out.push(format!("material {} has maps, but instance {i} lacks {what}", a.material));
            }
            match &material.color_source {
                ColorSource::Scalars(_)
                    if mesh.scalars.is_none() && a.scalars.is_none() && first(a.material, 0) =>
                {
                    out.push(format!(
                            "material {} maps scalars to colours, but instance {i} has none: its constant colour is used",
                            a.material
                        ));
                }
                ColorSource::Texture(_) if mesh.texcoords.is_none() && first(a.material, 1) => {
                    out.push(format!(
                            "material {} has a texture, but instance {i} has no texture coordinates: its constant colour is used",
                            a.material
                        ));
                }
                _ => {}
            }
        }
        if self.background == Background::Environment && self.environment.is_none() {
            out.push("background is the environment, but the scene has none: it stays transparent".into());
        }
        out
    }

    /// True when there is ambient light or an environment that is not black.
    pub(crate) fn has_ambient(&self) -> bool {
        self.lights.iter().any(|l| matches!(l.kind, crate::light::LightKind::Ambient) && l.color != [0.0; 3])
            || self.environment.as_ref().is_some_and(|e| !e.is_black())
    }

    /// Whether instance `i` can let light through.
    fn may_be_transparent(&self, i: usize) -> bool {
        let a = &self.appearances[i];
        let Some(m) = self.materials.get(a.material) else { return false };
        m.opacity < 1.0
            || m.culls()
            || match &m.color_source {
                ColorSource::Attribute if a.colors.is_some() => a.colors_have_alpha,
                ColorSource::Attribute => self.geometry_has_alpha[self.world.instances()[i].geometry],
                ColorSource::Constant => false,
                ColorSource::Scalars(map) => map.colors.iter().any(|c| c[3] < 1.0) || map.nan_color[3] < 1.0,
                ColorSource::Texture(t) => t.has_transparency(),
            }
    }
}

fn has_alpha(colors: &Attribute<[f32; 4]>) -> bool {
    colors.values.iter().any(|c| c[3] < 1.0)
}

/// See [`Effects::required_by`].
pub(crate) fn requirements(scene: &Scene) -> Effects {
    let mut used = vec![false; scene.materials.len()];
    let mut transparent = false;
    // With as many instances as a glyph plot has, look at each material and attribute once: materials first, then attributes only
    // until one is found to be transparent.
    for i in 0..scene.appearances.len().min(scene.world.instances().len()) {
        if let Some(u) = used.get_mut(scene.appearances[i].material) {
            *u = true;
        }
        transparent = transparent || scene.may_be_transparent(i);
    }
    let used = || scene.materials.iter().zip(&used).filter(|(_, u)| **u).map(|(m, _)| m);
    let lit = used().any(|m| !matches!(m.model, SurfaceModel::Unlit | SurfaceModel::Dielectric { .. }));
    let lights = || scene.lights.iter().filter(|l| lit && l.casts_shadows());
    let dielectric = used().any(|m| matches!(m.model, SurfaceModel::Dielectric { .. }));
    // Where roughness varies, it may be anything somewhere.
    let reflects = |m: &Material, effect| {
        m.reflection_roughness().is_some_and(|r| m.detail.is_some() || reflection_of(r) == effect)
    };
    Effects::NONE
        .with_if(lights().next().is_some(), Effects::SHADOWS)
        .with_if(lights().any(|l| l.size() > 0.0), Effects::SOFT_SHADOWS)
        .with_if(lit && scene.ambient_occlusion.is_some() && scene.has_ambient(), Effects::AMBIENT_OCCLUSION)
        .with_if(dielectric || used().any(|m| reflects(m, Effects::REFLECTION)), Effects::REFLECTION)
        .with_if(used().any(|m| reflects(m, Effects::GLOSSY_REFLECTION)), Effects::GLOSSY_REFLECTION)
        .with_if(dielectric, Effects::REFRACTION)
        .with_if(transparent, Effects::TRANSPARENCY)
        .with_if(!scene.volumes.is_empty(), Effects::VOLUMES)
}

fn check_light(l: &Light) -> Result<(), (&'static str, String, &'static str)> {
    use crate::light::LightKind as K;
    let color = |field, c: [f32; 3]| {
        let ok = c.iter().all(|v| v.is_finite());
        if ok { Ok(()) } else { Err((field, format!("{c:?}"), "finite in every channel")) }
    };
    color("color", l.color)?;
    color("highlight_color", l.highlight_color.unwrap_or(l.color))?;
    color("attenuation", l.attenuation)?;
    let size = l.size();
    if !(size >= 0.0 && size.is_finite()) {
        return Err(("radius", size.to_string(), "0 or positive, finite"));
    }
    let vector = |field, v: glam::DVec3| {
        let ok = v.is_finite() && v != glam::DVec3::ZERO;
        if ok { Ok(()) } else { Err((field, v.to_string(), "finite and not zero")) }
    };
    // Beyond, distances to it are not finite in f32, and it would be dark.
    const FARTHEST: f64 = 1e38;
    let point = |v: glam::DVec3| {
        if v.abs().max_element() <= FARTHEST {
            Ok(())
        } else {
            let rule = "finite, at most 1e38 from zero; make light from so far directional";
            Err(("position", v.to_string(), rule))
        }
    };
    match l.kind {
        K::Ambient => Ok(()),
        K::Directional { to_light, angular_radius_rad } => {
            vector("to_light", to_light)?;
            let ok = angular_radius_rad < std::f64::consts::FRAC_PI_2;
            if ok {
                Ok(())
            } else {
                Err(("angular_radius_rad", angular_radius_rad.to_string(), "below pi/2"))
            }
        }
        K::Point { position, .. } => point(position),
        K::Spot { position, direction, cutoff_rad, exponent, .. } => {
            point(position)?;
            vector("direction", direction)?;
            if !(cutoff_rad > 0.0 && cutoff_rad <= std::f64::consts::PI) {
                return Err(("cutoff_rad", cutoff_rad.to_string(), "above 0 and at most pi"));
            }
            let ok = exponent >= 0.0 && exponent.is_finite();
            if ok { Ok(()) } else { Err(("exponent", exponent.to_string(), "0 or positive, finite")) }
        }
        K::Cone { position, direction, inner_rad, outer_rad } => {
            point(position)?;
            vector("direction", direction)?;
            if !(outer_rad > 0.0 && outer_rad <= std::f64::consts::PI) {
                return Err(("outer_rad", outer_rad.to_string(), "above 0 and at most pi"));
            }
            let ok = (0.0..=outer_rad).contains(&inner_rad);
            if ok { Ok(()) } else { Err(("inner_rad", inner_rad.to_string(), "0 to outer_rad")) }
        }
        K::Ring { position, direction, inner_radius, radius, inner_rad, outer_rad } => {
            point(position)?;
            vector("direction", direction)?;
            if radius <= 0.0 {
                return Err(("radius", radius.to_string(), "positive: a ring needs an area"));
            }
            if !(0.0..radius).contains(&inner_radius) {
                return Err(("inner_radius", inner_radius.to_string(), "0 or positive, below the radius"));
            }
            if !(outer_rad > 0.0 && outer_rad <= std::f64::consts::FRAC_PI_2) {
                return Err(("outer_rad", outer_rad.to_string(), "above 0 and at most pi/2"));
            }
            let ok = (0.0..=outer_rad).contains(&inner_rad);
            if ok { Ok(()) } else { Err(("inner_rad", inner_rad.to_string(), "0 to outer_rad")) }
        }
        K::Quad { corner, edges: [a, b], .. } => {
            point(corner)?;
            vector("edge 1", a)?;
            vector("edge 2", b)?;
            vector("edge 1 x edge 2", a.normalize().cross(b.normalize()))
        }
        K::Disk { position, direction, radius } => {
            point(position)?;
            vector("direction", direction)?;
            if radius > 0.0 {
                Ok(())
            } else {
                Err(("radius", radius.to_string(), "positive: a disk needs an area"))
            }
        }
    }
}

/// Collects a scene piece by piece.
#[derive(Default)]
pub struct SceneBuilder {
    geometries: Vec<Geometry>,
    instances: Vec<Instance>,
    appearances: Vec<Appearance>,
    materials: Vec<Material>,
    lights: Vec<Light>,
    volumes: Vec<PlacedVolume>,
    /// Light from infinitely far.
    pub environment: Option<Environment>,
    /// What fills uncovered pixels.
    pub background: Background,
    /// Ambient occlusion; `None` for none.
    pub ambient_occlusion: Option<AmbientOcclusion>,
    /// Options of the acceleration structure.
    pub build_options: BuildOptions,
}

impl SceneBuilder {
    /// An empty scene without lights.
    pub fn new() -> SceneBuilder {
        SceneBuilder::default()
    }

    /// Adds a material; the result names it for [`SceneBuilder::instance`].
    pub fn material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a geometry without placing it; the result names it for [`SceneBuilder::instance`].
    pub fn geometry(&mut self, geometry: Geometry) -> usize {
        self.geometries.push(geometry);
        self.geometries.len() - 1
    }

    /// Places a geometry. Returns the index of the instance.
    pub fn instance(
        &mut self,
        geometry: usize,
        world_from_object: DAffine3,
        appearance: Appearance,
    ) -> usize {
        self.instances.push(Instance { geometry, world_from_object });
        self.appearances.push(appearance);
        self.instances.len() - 1
    }

    /// Adds a mesh at its place. Returns the index of the instance.
    pub fn mesh(&mut self, mesh: impl Into<Arc<TriMesh>>, material: Material) -> usize {
        let (g, m) = (self.geometry(Geometry::Mesh(mesh.into())), self.material(material));
        self.instance(g, DAffine3::IDENTITY, Appearance::new(m))
    }

    /// Adds a shape (spheres, tubes, isosurface, own geometry) at its place. Returns the index of the instance.
    pub fn shape(&mut self, shape: Arc<dyn Shape>, material: Material) -> usize {
        let (g, m) = (self.geometry(Geometry::Shape(shape)), self.material(material));
        self.instance(g, DAffine3::IDENTITY, Appearance::new(m))
    }

    /// Adds a light.
    pub fn light(&mut self, light: Light) {
        self.lights.push(light);
    }

    /// Adds a volume at its place.
    pub fn volume(&mut self, volume: impl Into<Arc<Volume>>) {
        self.volumes.push(PlacedVolume { volume: volume.into(), world_from_object: DAffine3::IDENTITY });
    }

    /// Builds the world and checks everything.
    pub fn build(self) -> Result<Scene, SceneError> {
        let world = World::build(self.geometries, self.instances, &self.build_options)?;
        let mut scene = Scene::new(world);
        scene.appearances = self.appearances;
        scene.materials = self.materials;
        scene.lights = self.lights;
        scene.environment = self.environment;
        scene.background = self.background;
        scene.ambient_occlusion = self.ambient_occlusion;
        scene.volumes = self.volumes;
        scene.check()?;
        Ok(scene)
    }
}
