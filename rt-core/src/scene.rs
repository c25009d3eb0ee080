//! Describes a scene: geometry in a [`World`], the appearance of each instance, lights and
//! environment.

mod check;
mod part;
mod required_effects;

pub(crate) use required_effects::transmits_light;

use crate::bvh::{BuildError, BuildOptions, Geometry, Instance, World};
use crate::environment::{Background, Environment};
use crate::light::{Light, LightKind};
use crate::material::{ColorSource, Material};
use crate::mesh::{Attribute, TriMesh};
use crate::shapes::Shape;
use crate::volume::Volume;
use glam::DAffine3;
use rayon::prelude::*;
use std::sync::Arc;

/// The appearance of one instance.
#[derive(Debug, Clone, Default)]
pub struct Appearance {
    /// Index into [`Scene::materials`].
    pub material: usize,
    colors: Option<Arc<Attribute<[f32; 4]>>>,
    color_summary: ColorSummary,
    scalars: Option<Arc<Attribute<f32>>>,
}

impl Appearance {
    /// An appearance with a material and the geometry's own attributes.
    pub fn new(material: usize) -> Appearance {
        Appearance { material, ..Appearance::default() }
    }

    /// Colours that replace the mesh's own (linear RGBA). Recolouring needs no new acceleration
    /// structure.
    #[must_use]
    pub fn with_colors(mut self, colors: impl Into<Arc<Attribute<[f32; 4]>>>) -> Appearance {
        let colors = colors.into();
        self.color_summary = ColorSummary::of(&colors);
        self.colors = Some(colors);
        self
    }

    /// Scalars that replace the mesh's own.
    #[must_use]
    pub fn with_scalars(mut self, scalars: impl Into<Arc<Attribute<f32>>>) -> Appearance {
        self.scalars = Some(scalars.into());
        self
    }

    /// Colours that replace the mesh's own.
    pub fn colors(&self) -> Option<&Attribute<[f32; 4]>> {
        self.colors.as_deref()
    }

    /// Scalars that replace the mesh's own.
    pub fn scalars(&self) -> Option<&Attribute<f32>> {
        self.scalars.as_deref()
    }
}

/// Attenuation of ambient and environment light by near surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AmbientOcclusion {
    /// Largest distance of an occluder, world units; infinity for no limit.
    pub distance: f64,
    /// Rays per shaded point and sample.
    pub rays: u32,
}

/// A volume placed in the world. Where volumes overlap, their media are mixed.
#[derive(Clone)]
pub struct VolumeInstance {
    /// The medium.
    pub volume: Arc<Volume>,
    /// Object to world. Extinction is per object-space length: scaling a volume up makes it
    /// thicker, not denser.
    pub world_from_object: DAffine3,
}

/// Properties of an attribute's colours that every frame needs.
#[derive(Debug, Clone, Copy, Default)]
struct ColorSummary {
    /// Whether a colour is transparent.
    transparent: bool,
    /// The first colour with a NaN or infinite channel.
    unusable: Option<usize>,
}

impl ColorSummary {
    fn of(colors: &Attribute<[f32; 4]>) -> ColorSummary {
        let part = |(k, part): (usize, &[[f32; 4]])| {
            let unusable = part.iter().position(|c| !c.iter().all(|v| v.is_finite()));
            ColorSummary {
                transparent: part.iter().any(|c| c[3] < 1.0),
                unusable: unusable.map(|i| (k << 16) + i),
            }
        };
        let join = |a: ColorSummary, b: ColorSummary| ColorSummary {
            transparent: a.transparent || b.transparent,
            unusable: a.unusable.or(b.unusable),
        };
        colors.values.par_chunks(1 << 16).enumerate().map(part).reduce(ColorSummary::default, join)
    }
}

/// A scene to render. Materials, lights and appearances may change between frames; the world is
/// built once.
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
    /// Ambient occlusion; `None` disables it.
    pub ambient_occlusion: Option<AmbientOcclusion>,
    /// Volumes to render, in front of, between and behind surfaces. Volumes cast no shadows and
    /// have no depth.
    pub volumes: Vec<VolumeInstance>,
    geometry_colors: Vec<ColorSummary>,
}

/// Reasons why a scene cannot be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The world could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A mesh of the world was built from slices, and has nothing to shade.
    #[error(
        "geometry {geometry} was built from borrowed slices, of which the world keeps nothing to \
         shade; build it from a TriMesh for images"
    )]
    WithoutArrays {
        /// Index of the geometry.
        geometry: usize,
    },
    /// The numbers of appearances and instances differ.
    #[error("scene has {appearances} appearances for {instances} instances; give one per instance")]
    Appearances {
        /// Number of appearances.
        appearances: usize,
        /// Number of instances.
        instances: usize,
    },
    /// The index of an appearance's material is out of range.
    #[error("appearance {appearance} uses material {material}, but there are only {count}")]
    NoSuchMaterial {
        /// Index of the appearance.
        appearance: usize,
        /// Index of the material.
        material: usize,
        /// Number of materials.
        count: usize,
    },
    /// [`Scene::world`] was replaced by one with other geometries.
    #[error(
        "the scene was made of a world with {expected} geometries and now has one with {found}; \
         make a new scene of \
         the new world with Scene::new"
    )]
    OtherWorld {
        /// Number of geometries in the world that the scene was made of.
        expected: usize,
        /// Number of geometries in the world it has now.
        found: usize,
    },
    /// A parameter of a material, a light, the environment, ... is out of range.
    #[error("{what} {index}: {field} is {value}; it must be {rule}")]
    OutOfRange {
        /// "material", "light", "environment", ...
        what: &'static str,
        /// Its index.
        index: usize,
        /// The parameter.
        field: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// An attribute override has the wrong length.
    #[error("appearance {appearance}: {field} has {found} values; its geometry needs {expected}")]
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
        let geometry_colors = world
            .geometries()
            .par_iter()
            .map(|g| match g {
                Geometry::Mesh(m) => {
                    m.colors.as_ref().map_or_else(ColorSummary::default, ColorSummary::of)
                }
                Geometry::Slices(_) => ColorSummary::default(),
                Geometry::Shape(s) => {
                    ColorSummary { transparent: s.has_transparency(), unusable: None }
                }
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
            geometry_colors,
        }
    }

    /// States that colours of `geometry` may be transparent although none that this scene holds is:
    /// for a part of a scene whose other parts have such colours. An index without a geometry is
    /// ignored.
    pub fn assume_transparent_colors(&mut self, geometry: usize) {
        if let Some(colors) = self.geometry_colors.get_mut(geometry) {
            colors.transparent = true;
        }
    }

    /// Whether `geometry` has transparent colours of its own.
    pub fn has_transparent_colors(&self, geometry: usize) -> bool {
        self.geometry_colors.get(geometry).is_some_and(|c| c.transparent)
    }

    /// Warnings about settings of the scene that cannot change a pixel: ambient occlusion without
    /// ambient light, colour maps without scalars, textures without coordinates, colours that a
    /// material does not use, attenuation of light from infinitely far. Every render report
    /// contains them.
    pub fn warnings(&self) -> Vec<String> {
        let mut out = Vec::new();
        if self.ambient_occlusion.is_some() && !self.has_ambient() {
            out.push(
                "ambient occlusion changes no pixel: the scene has no ambient light and no \
                      environment to dim"
                    .into(),
            );
        }
        for (i, l) in self.lights.iter().enumerate() {
            let kind = match l.kind {
                LightKind::Ambient => "ambient",
                LightKind::Directional { .. } => "directional",
                _ => continue,
            };
            if l.attenuation != [1.0, 0.0, 0.0] {
                out.push(format!(
                    "light {i} is {kind}, without a distance: its attenuation changes nothing"
                ));
            }
        }
        // For each material, the warnings already given.
        let mut told = vec![[false; 5]; self.materials.len()];
        for (i, (a, instance)) in self.appearances.iter().zip(self.world.instances()).enumerate() {
            let Some(material) = self.materials.get(a.material) else { continue };
            let geometry = &self.world.geometries()[instance.geometry];
            for (kind, warning) in unused(material, a, geometry).into_iter().enumerate() {
                if let Some((of_material, of_instance)) = warning
                    && !std::mem::replace(&mut told[a.material][kind], true)
                {
                    out.push(format!(
                        "material {} {of_material}, but instance {i} {of_instance}",
                        a.material
                    ));
                }
            }
        }
        if self.background == Background::Environment && self.environment.is_none() {
            out.push(
                "background is the environment, but the scene has none: it stays transparent"
                    .into(),
            );
        }
        out
    }
}

/// Warnings about settings of a material that this instance cannot use, and about attributes that
/// its material does not use.
fn unused(
    material: &Material,
    look: &Appearance,
    geometry: &Geometry,
) -> [Option<(&'static str, String)>; 5] {
    let constant = |lacks: &str| format!("{lacks}: its constant colour is used");
    let mesh = match geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        Geometry::Slices(_) | Geometry::Shape(_) => None,
    };
    let by_scalars = matches!(material.color_source, ColorSource::Scalars(_));
    let by_texture = matches!(material.color_source, ColorSource::Texture(_));
    // Whether a shape has scalars is known only at its hits.
    let no_scalars = mesh.is_some_and(|m| m.scalars.is_none() && look.scalars.is_none());
    let no_coordinates = mesh.is_none_or(|m| m.texcoords.is_none());
    let no_maps = material.maps.as_ref().and_then(|d| match mesh {
        Some(mesh) => d.missing_attribute(mesh),
        None => d.missing_attribute(&TriMesh::default()),
    });
    let of_its_own = |what: &str| format!("has {what} of its own: they are not looked at");
    let by_attribute = material.color_source == ColorSource::Attribute;
    [
        (by_scalars && no_scalars).then(|| ("maps scalars to colours", constant("has none"))),
        (by_texture && no_coordinates)
            .then(|| ("has a texture", constant("has no texture coordinates"))),
        no_maps.map(|what| ("has maps", format!("lacks {what}"))),
        (!by_attribute && look.colors.is_some())
            .then(|| ("takes its colour from elsewhere", of_its_own("colours"))),
        (!by_scalars && look.scalars.is_some()).then(|| ("maps no scalars", of_its_own("scalars"))),
    ]
}

/// Builds a scene from its elements.
#[derive(Default)]
pub struct SceneBuilder {
    geometries: Vec<Geometry>,
    instances: Vec<Instance>,
    appearances: Vec<Appearance>,
    materials: Vec<Material>,
    lights: Vec<Light>,
    volumes: Vec<VolumeInstance>,
    /// Light from infinitely far.
    pub environment: Option<Environment>,
    /// What fills uncovered pixels.
    pub background: Background,
    /// Ambient occlusion; `None` disables it.
    pub ambient_occlusion: Option<AmbientOcclusion>,
    /// Options of the acceleration structure.
    pub build_options: BuildOptions,
}

impl SceneBuilder {
    /// An empty scene without lights.
    pub fn new() -> SceneBuilder {
        SceneBuilder::default()
    }

    /// Adds a material. Pass the returned index to [`SceneBuilder::instance`].
    pub fn material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a geometry without an instance. Pass the returned index to [`SceneBuilder::instance`].
    pub fn geometry(&mut self, geometry: Geometry) -> usize {
        self.geometries.push(geometry);
        self.geometries.len() - 1
    }

    /// Adds an instance of a geometry. Returns the index of the instance.
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

    /// Adds a mesh and an instance of it, without a transform. Returns the index of the instance.
    pub fn mesh(&mut self, mesh: impl Into<Arc<TriMesh>>, material: Material) -> usize {
        let (g, m) = (self.geometry(Geometry::Mesh(mesh.into())), self.material(material));
        self.instance(g, DAffine3::IDENTITY, Appearance::new(m))
    }

    /// Adds a shape (spheres, tubes, isosurface, user-defined geometry) and an instance of it,
    /// without a transform. Returns the index of the instance.
    pub fn shape(&mut self, shape: Arc<dyn Shape>, material: Material) -> usize {
        let (g, m) = (self.geometry(Geometry::Shape(shape)), self.material(material));
        self.instance(g, DAffine3::IDENTITY, Appearance::new(m))
    }

    /// Adds a light.
    pub fn light(&mut self, light: Light) {
        self.lights.push(light);
    }

    /// Adds a volume without a transform.
    pub fn volume(&mut self, volume: impl Into<Arc<Volume>>) {
        self.volumes
            .push(VolumeInstance { volume: volume.into(), world_from_object: DAffine3::IDENTITY });
    }

    /// Builds the world and checks the scene.
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
