//! What one rank has of a scene.
use rt_core::bvh::{BuildOptions, Geometry};
use rt_core::environment::{Background, Environment};
use rt_core::glam::{DAffine3, UVec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::TriMesh;
use rt_core::scene::AmbientOcclusion;
use rt_core::shapes::Shape;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{GridExtent, VolumeOptions};
use std::sync::Arc;

/// The part of a scene that one rank has: the input of
/// [`DataParallel::distributed`](crate::render::DataParallel::distributed).
///
/// The scene is the sum of what all ranks give. An *object* has a name; what ranks give under one
/// name are pieces of one object, whose primitives count from those of rank 0 on. The objects are
/// the instances of the sum in the order of their names, so pictures do not depend on who has what.
/// A rank leaves out the objects of which it has nothing.
///
/// Materials, lights, environment, background, ambient occlusion, build options and the
/// descriptions of volumes are settings: every rank gives the same.
#[derive(Clone, Default)]
pub struct RankScene {
    pub(super) objects: Vec<Object>,
    pub(super) volumes: Vec<DistributedVolume>,
    /// Materials, to which objects refer by their numbers. The same on all ranks.
    pub materials: Vec<Material>,
    /// Lights. The same on all ranks.
    pub lights: Vec<Light>,
    /// Light from infinitely far. The same on all ranks.
    pub environment: Option<Environment>,
    /// What fills uncovered pixels. The same on all ranks.
    pub background: Background,
    /// Ambient occlusion; `None` disables it. The same on all ranks.
    pub ambient_occlusion: Option<AmbientOcclusion>,
    /// Options of the acceleration structure. The same on all ranks.
    pub build_options: BuildOptions,
}

/// One rank's piece of an object.
#[derive(Clone)]
pub(super) struct Object {
    pub(super) name: String,
    pub(super) geometry: Geometry,
    pub(super) material: usize,
    pub(super) places: Vec<DAffine3>,
}

/// A volume of which every rank has some bricks, or none.
#[derive(Clone)]
pub struct DistributedVolume {
    /// Its name, which tells it from others.
    pub name: String,
    /// The grid that the bricks of all ranks fill.
    pub whole: GridExtent,
    /// Colour and extinction by value.
    pub transfer: TransferFunction,
    /// Interpolation, shading, ... Only media can be distributed; projections see the whole volume.
    pub options: VolumeOptions,
    /// Object to world.
    pub world_from_object: DAffine3,
    /// This rank's values: bricks of the grid, any number of them.
    pub bricks: Vec<PointBrick>,
}

/// Values on a box of points of a grid.
///
/// Bricks overlap by the points that they share: cells lie between points, and each cell needs a
/// rank that has its eight corners. Extents of VTK do that. More layers of points around a brick
/// (ghost points) are used instead of asking other ranks for them; what is still missing for
/// gradients and for whole blocks of cells is fetched from the ranks that have it.
#[derive(Clone, Debug, PartialEq)]
pub struct PointBrick {
    /// The first point in the whole grid.
    pub first: UVec3,
    /// Points per axis.
    pub dims: UVec3,
    /// One value per point, x fastest.
    pub values: Arc<[f32]>,
}

impl RankScene {
    /// Nothing, without lights.
    pub fn new() -> RankScene {
        RankScene::default()
    }

    /// Adds a material and returns its number.
    pub fn material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a light.
    pub fn light(&mut self, light: Light) {
        self.lights.push(light);
    }

    /// Adds this rank's triangles of object `name`, with a material by its number. All pieces have
    /// the same [`TriMesh::origin`] and the same kinds of attributes. A piece without triangles is
    /// the same as none.
    pub fn mesh(
        &mut self,
        name: impl Into<String>,
        mesh: impl Into<Arc<TriMesh>>,
        material: usize,
    ) {
        self.add(name.into(), Geometry::Mesh(mesh.into()), material);
    }

    /// Adds this rank's primitives of object `name`: spheres, cylinders, tubes or other shapes, all
    /// with the same [`Shape::origin`].
    pub fn shape(&mut self, name: impl Into<String>, shape: Arc<dyn Shape>, material: usize) {
        self.add(name.into(), Geometry::Shape(shape), material);
    }

    fn add(&mut self, name: String, geometry: Geometry, material: usize) {
        self.objects.push(Object { name, geometry, material, places: vec![DAffine3::IDENTITY] });
    }

    /// Places the object that was added last in the world: once for each transform (object to
    /// world) instead of once without one. All ranks that have a piece of the object give the same
    /// list. Every rank holds these lists of all objects, so glyphs in great numbers are better
    /// given as shapes. Does nothing before the first object.
    pub fn place(&mut self, places: Vec<DAffine3>) {
        if let Some(object) = self.objects.last_mut() {
            object.places = places;
        }
    }

    /// The volumes, to change.
    pub fn volumes_mut(&mut self) -> &mut [DistributedVolume] {
        &mut self.volumes
    }

    /// Adds a volume. Every rank adds the same ones in the same order, also without bricks.
    pub fn volume(&mut self, volume: DistributedVolume) {
        self.volumes.push(volume);
    }
}
