//! Worlds: converts all instances to a scene and caches expensive results between frames.
//!
//! Each cached result has a fingerprint of the values it was made from; for arrays, the fingerprint
//! holds a change count. A new colour therefore rebuilds only colours, and a new matrix only moves
//! an instance. The acceleration structure is rebuilt only when the arrays of a geometry's shape
//! change.

use super::Diagnostics;
use super::attribute::{SLOTS, Topology};
use super::geometry::{CompiledGeometry, Part, compile_geometry, is_appearance_parameter, union};
use super::light::{CompiledLight, light_of};
use super::material::{material_inputs_of, model_of, surface_color_of, uses_world_space};
use super::surface::{CompiledSurface, compile_surface};
use super::volume::volume_of;
use crate::anari::data_type::DataType;
use crate::anari::object::{Object, Value};
use rt_core::bvh::{Geometry, Instance, World};
use rt_core::environment::Environment;
use rt_core::glam::{DAffine3, DMat4, DVec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::scene::{Appearance, VolumeInstance};
use rt_core::volume::Volume;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

type FrameCache<T> = HashMap<Vec<u64>, Arc<T>>;

/// The cached state of a world object.
#[derive(Default)]
pub struct WorldCache {
    geometries: FrameCache<CompiledGeometry>,
    surfaces: FrameCache<Vec<CompiledSurface>>,
    volumes: FrameCache<Option<Arc<Volume>>>,
    /// The acceleration structures of the last frame.
    pub(crate) built: Arc<Mutex<Option<Arc<World>>>>,
}

/// The converted world, in the renderer's types.
#[derive(Default)]
pub(crate) struct CompiledWorld {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) instances: Vec<Instance>,
    pub(crate) appearances: Vec<Appearance>,
    pub(crate) materials: Vec<Material>,
    pub(crate) lights: Vec<Light>,
    pub(crate) environment: Option<Environment>,
    pub(crate) volumes: Vec<VolumeInstance>,
    pub(crate) ids: Vec<Ids>,
    pub(crate) bounds: Option<[DVec3; 2]>,
    pub(crate) built: Arc<Mutex<Option<Arc<World>>>>,
}

/// The values that the id channels report for an instance of the renderer.
pub(crate) struct Ids {
    pub(crate) object: u32,
    pub(crate) instance: u32,
    pub(crate) topology: Arc<Topology>,
}

/// Fingerprint of the values that determine an object's result; `keep` selects its own parameters.
pub(crate) fn fingerprint(object: &Object, keep: &dyn Fn(&str) -> bool, out: &mut Vec<u64>) {
    out.push(object.handle.0);
    if object.kind.is_array() {
        out.push(object.version());
        return;
    }
    for (name, value) in object.parameters().iter().filter(|(name, _)| keep(name)) {
        out.extend(name.bytes().map(u64::from));
        match value {
            Value::Object(o) => fingerprint(o, &|_| true, out),
            other => other.fingerprint(out),
        }
    }
}

/// Finds the result or makes it, and caches it for the next frame.
fn cached<T>(
    old: &FrameCache<T>,
    new: &mut FrameCache<T>,
    key: Vec<u64>,
    make: impl FnOnce() -> T,
) -> Arc<T> {
    if let Some(found) = new.get(&key) {
        return found.clone();
    }
    let value = old.get(&key).cloned().unwrap_or_else(|| Arc::new(make()));
    new.insert(key, value.clone());
    value
}

/// A transform in the world, with the instance's overrides for its content.
#[derive(Clone, Copy)]
struct Placement<'a> {
    world_from_object: DAffine3,
    instance: Option<&'a Object>,
    id: u32,
}

impl CompiledWorld {
    /// Converts everything in `world` (or a group or instance, for bounds). Faults become
    /// diagnostics.
    pub(crate) fn of(world: &Object, diagnostics: &mut Diagnostics) -> CompiledWorld {
        // Dropped after the world's state is unlocked: it may have the last reference to an array.
        let mut old = WorldCache::default();
        let compiled = world.with_state(|cache: &mut WorldCache| {
            old = std::mem::take(cache);
            CompiledWorld::compile(world, &old, cache, diagnostics)
        });
        compiled.unwrap_or_else(|| {
            let mut new = WorldCache::default();
            CompiledWorld::compile(world, &old, &mut new, diagnostics)
        })
    }

    /// Takes what has not changed from the last frame's cache and puts everything into the new one.
    fn compile(
        world: &Object,
        old: &WorldCache,
        cache: &mut WorldCache,
        diagnostics: &mut Diagnostics,
    ) -> CompiledWorld {
        cache.built = old.built.clone();
        let mut compiler = WorldCompiler {
            old,
            cache,
            out: CompiledWorld::default(),
            known: HashMap::new(),
            materials: HashMap::new(),
            diagnostics,
        };
        compiler.out.built = old.built.clone();
        let here =
            Placement { world_from_object: DAffine3::IDENTITY, instance: None, id: u32::MAX };
        match world.kind {
            DataType::INSTANCE => compiler.instance(world),
            _ => {
                for instance in world.objects("instance") {
                    compiler.instance(&instance);
                }
                compiler.content(world, here);
            }
        }
        compiler.out
    }
}

struct WorldCompiler<'a> {
    old: &'a WorldCache,
    cache: &'a mut WorldCache,
    out: CompiledWorld,
    /// Index of each geometry by its address.
    known: HashMap<usize, usize>,
    /// Index of each surface appearance's material, by the appearance's address.
    materials: HashMap<usize, usize>,
    diagnostics: &'a mut Diagnostics,
}

impl WorldCompiler<'_> {
    fn instance(&mut self, instance: &Object) {
        if !instance.known {
            return;
        }
        let Some(group) = instance.object("group") else {
            self.diagnostics.error(instance, "`group` is not set, so there is nothing to place");
            return;
        };
        let parameters = instance.parameters();
        let matrices = match parameters.get("transform") {
            Some(Value::Object(a)) => a.with_array(|a| a.matrices()).unwrap_or_default(),
            _ => vec![instance.vector("transform", DMat4::IDENTITY.to_cols_array())],
        };
        let ids = match parameters.get("id") {
            Some(Value::Object(a)) => a.with_array(|a| a.indices::<1>()).unwrap_or_default(),
            _ => Vec::new(),
        };
        let common = instance.u32("id", u32::MAX);
        let mut singular = 0;
        for (i, m) in matrices.iter().enumerate() {
            let world_from_object = DAffine3::from_mat4(DMat4::from_cols_array(m));
            let determinant = world_from_object.matrix3.determinant();
            if !(world_from_object.is_finite() && determinant != 0.0 && determinant.is_finite()) {
                singular += 1;
                continue;
            }
            let id = ids.get(i).map_or(common, |[id]| *id);
            self.content(&group, Placement { world_from_object, instance: Some(instance), id });
        }
        if singular > 0 {
            self.diagnostics.warn(
                instance,
                format!(
                    "{singular} of {} matrices are singular or not finite; they place nothing",
                    matrices.len()
                ),
            );
        }
    }

    /// Adds the surfaces, volumes and lights of a group or world.
    fn content(&mut self, group: &Object, placement: Placement<'_>) {
        for surface in group.objects("surface") {
            self.surface(&surface, placement);
        }
        for volume in group.objects("volume") {
            let mut key = Vec::new();
            fingerprint(&volume, &|_| true, &mut key);
            let diagnostics = &mut *self.diagnostics;
            let made = cached(&self.old.volumes, &mut self.cache.volumes, key, || {
                volume_of(&volume, diagnostics)
            });
            let Some(medium) = made.as_ref() else { continue };
            let grid = medium.grid();
            self.grow(Some([grid.origin(), grid.max_corner()]), &placement.world_from_object);
            self.out.volumes.push(VolumeInstance {
                volume: medium.clone(),
                world_from_object: placement.world_from_object,
            });
        }
        for light in group.objects("light") {
            match light_of(&light, &placement.world_from_object, self.diagnostics) {
                Some(CompiledLight::Light(lamp)) => self.out.lights.push(lamp),
                Some(CompiledLight::Environment(_)) if self.out.environment.is_some() => {
                    self.diagnostics.warn(
                        &light,
                        "a world can have one picture around it; this one is left out",
                    );
                }
                Some(CompiledLight::Environment(environment)) => {
                    self.out.environment = Some(environment)
                }
                None => {}
            }
        }
    }

    fn surface(&mut self, surface: &Object, placement: Placement<'_>) {
        if !surface.bool("visible", true) {
            return;
        }
        let (Some(geometry), Some(material)) =
            (surface.object("geometry"), surface.object("material"))
        else {
            self.diagnostics
                .error(surface, "`geometry` or `material` is not set, so it is not drawn");
            return;
        };
        if !geometry.known || !material.known {
            let which = if geometry.known { &material } else { &geometry };
            self.diagnostics
                .error(surface, format!("it is not drawn: this device has no {}", which.title()));
            return;
        }
        let mut key = Vec::new();
        fingerprint(&geometry, &|name| !is_appearance_parameter(name), &mut key);
        let diagnostics = &mut *self.diagnostics;
        let compiled =
            cached(&self.old.geometries, &mut self.cache.geometries, key.clone(), || {
                compile_geometry(&geometry, diagnostics)
            });
        self.grow(compiled.bounds, &placement.world_from_object);
        let diagnostics = &mut *self.diagnostics;

        fingerprint(&geometry, &is_appearance_parameter, &mut key);
        fingerprint(&material, &|_| true, &mut key);
        if let Some(instance) = placement.instance {
            let replaced = instance.parameters().keys().any(|k| SLOTS.contains(&k.as_str()));
            if replaced {
                fingerprint(instance, &|name| SLOTS.contains(&name), &mut key);
            }
        }
        if uses_world_space(&material) {
            key.extend(placement.world_from_object.to_cols_array().map(f64::to_bits));
        }
        let surfaces = cached(&self.old.surfaces, &mut self.cache.surfaces, key, || {
            let model = model_of(&material, diagnostics);
            let surface_color =
                surface_color_of(&material, &geometry, placement.instance, diagnostics);
            let material_inputs =
                material_inputs_of(&material, &geometry, placement.instance, diagnostics);
            if material_inputs.as_ref().is_some_and(|g| g.normal.is_some())
                && !compiled.parts.iter().all(Part::is_mesh)
            {
                diagnostics.warn(
                    &material,
                    format!(
                        "`normal` is left out on {}: only triangles and quads have tangents",
                        geometry.title()
                    ),
                );
            }
            let place = &placement.world_from_object;
            compiled
                .parts
                .iter()
                .map(|part| {
                    compile_surface(part, &model, &surface_color, material_inputs.as_ref(), place)
                })
                .collect()
        });
        let object = surface.u32("id", u32::MAX);
        for d in surfaces.iter() {
            let address = match &d.geometry {
                Geometry::Mesh(m) => Arc::as_ptr(m) as usize,
                Geometry::Slices(s) => Arc::as_ptr(s) as usize,
                Geometry::Shape(s) => Arc::as_ptr(s) as *const () as usize,
            };
            let out = &mut self.out;
            let index = *self.known.entry(address).or_insert_with(|| {
                out.geometries.push(d.geometry.clone());
                out.geometries.len() - 1
            });
            out.instances
                .push(Instance { geometry: index, world_from_object: placement.world_from_object });
            let material =
                *self.materials.entry(std::ptr::from_ref(d) as usize).or_insert_with(|| {
                    out.materials.push(d.material.clone());
                    out.materials.len() - 1
                });
            let mut appearance = d.appearance.clone();
            appearance.material = material;
            out.appearances.push(appearance);
            out.ids.push(Ids { object, instance: placement.id, topology: d.topology.clone() });
        }
    }

    /// Bounds of a transformed box.
    fn grow(&mut self, bounds: Option<[DVec3; 2]>, place: &DAffine3) {
        let Some(b) = bounds else { return };
        for i in 0..8usize {
            let corner = DVec3::new(b[i & 1].x, b[i >> 1 & 1].y, b[i >> 2 & 1].z);
            let p = place.transform_point3(corner);
            self.out.bounds = union(self.out.bounds, Some([p, p]));
        }
    }
}
