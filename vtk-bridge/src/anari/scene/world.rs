//! Worlds: everything placed, with what is expensive kept from frame to frame.
//!
//! What is kept has a fingerprint of the values it was made from, with a count of changes for arrays: a new colour makes new colours, a new matrix moves
//! an instance, and only new arrays of a geometry's shape make a new acceleration structure.

use super::Notes;
use super::attribute::{SLOTS, Topology};
use super::dress::{Dressed, dress};
use super::geometry::{Part, Prepared, is_look, prepare, union};
use super::light::{Made, light_of};
use super::material::{grain_of, model_of, names_the_world, paint_of};
use super::volume::volume_of;
use crate::anari::data_type::DataType;
use crate::anari::object::{Extra, Object, Value};
use crate::anari::status::lock;
use rt_core::accel::{Geometry, Instance, World};
use rt_core::environment::Environment;
use rt_core::glam::{DAffine3, DMat4, DVec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::scene::{Appearance, PlacedVolume};
use rt_core::volume::Volume;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

type Kept<T> = HashMap<Vec<u64>, Arc<T>>;

/// What a world object keeps.
#[derive(Default)]
pub struct WorldCache {
    prepared: Kept<Prepared>,
    dressed: Kept<Vec<Dressed>>,
    volumes: Kept<Option<Arc<Volume>>>,
    /// The acceleration structures of the last frame.
    pub(crate) built: Arc<Mutex<Option<Arc<World>>>>,
}

/// Everything of a world, in the renderer's terms.
#[derive(Default)]
pub(crate) struct Compiled {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) instances: Vec<Instance>,
    pub(crate) appearances: Vec<Appearance>,
    pub(crate) materials: Vec<Material>,
    pub(crate) lights: Vec<Light>,
    pub(crate) sky: Option<Environment>,
    pub(crate) volumes: Vec<PlacedVolume>,
    pub(crate) ids: Vec<Ids>,
    pub(crate) bounds: Option<[DVec3; 2]>,
    pub(crate) built: Arc<Mutex<Option<Arc<World>>>>,
}

/// What the id channels say of an instance of the renderer.
pub(crate) struct Ids {
    pub(crate) object: u32,
    pub(crate) instance: u32,
    pub(crate) topology: Arc<Topology>,
}

/// Values that decide what is made of an object; `keep` chooses its own parameters.
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

/// Finds or makes, and keeps for the next frame.
fn kept<T>(old: &Kept<T>, new: &mut Kept<T>, key: Vec<u64>, make: impl FnOnce() -> T) -> Arc<T> {
    if let Some(found) = new.get(&key) {
        return found.clone();
    }
    let value = old.get(&key).cloned().unwrap_or_else(|| Arc::new(make()));
    new.insert(key, value.clone());
    value
}

/// A place in the world, with what the instance says of its content.
#[derive(Clone, Copy)]
struct Spot<'a> {
    world_from_object: DAffine3,
    instance: Option<&'a Object>,
    id: u32,
}

impl Compiled {
    /// Everything in `world` (or a group or instance, for bounds). Faults become notes.
    pub(crate) fn of(world: &Object, notes: &mut Notes) -> Compiled {
        let mut guard = lock(&world.extra);
        let mut none = WorldCache::default();
        let cache = match &mut *guard {
            Extra::World(cache) => cache,
            _ => &mut none,
        };
        let old = std::mem::take(cache);
        cache.built = old.built.clone();
        let mut making = Making {
            old: &old,
            cache,
            out: Compiled::default(),
            known: HashMap::new(),
            materials: HashMap::new(),
            notes,
        };
        making.out.built = old.built.clone();
        let here = Spot { world_from_object: DAffine3::IDENTITY, instance: None, id: u32::MAX };
        match world.kind {
            DataType::INSTANCE => making.instance(world),
            _ => {
                for instance in world.objects("instance") {
                    making.instance(&instance);
                }
                making.content(world, here);
            }
        }
        let out = making.out;
        drop(guard);
        drop(old);
        out
    }
}

struct Making<'a> {
    old: &'a WorldCache,
    cache: &'a mut WorldCache,
    out: Compiled,
    /// Index of each geometry by its address.
    known: HashMap<usize, usize>,
    /// Index of each look's material by the look's address.
    materials: HashMap<usize, usize>,
    notes: &'a mut Notes,
}

impl Making<'_> {
    fn instance(&mut self, instance: &Object) {
        if !instance.known {
            return;
        }
        let Some(group) = instance.object("group") else {
            self.notes.error(instance, "`group` is not set, so there is nothing to place");
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
            self.content(&group, Spot { world_from_object, instance: Some(instance), id });
        }
        if singular > 0 {
            self.notes.warn(
                instance,
                format!(
                    "{singular} of {} matrices are singular or not finite; they place nothing",
                    matrices.len()
                ),
            );
        }
    }

    /// Surfaces, volumes and lights of a group or world.
    fn content(&mut self, group: &Object, spot: Spot<'_>) {
        for surface in group.objects("surface") {
            self.surface(&surface, spot);
        }
        for volume in group.objects("volume") {
            let mut key = Vec::new();
            fingerprint(&volume, &|_| true, &mut key);
            let notes = &mut *self.notes;
            let made = kept(&self.old.volumes, &mut self.cache.volumes, key, || volume_of(&volume, notes));
            let Some(medium) = made.as_ref() else { continue };
            let grid = medium.grid();
            self.grow(Some([grid.origin, grid.max_corner()]), &spot.world_from_object);
            self.out
                .volumes
                .push(PlacedVolume { volume: medium.clone(), world_from_object: spot.world_from_object });
        }
        for light in group.objects("light") {
            match light_of(&light, &spot.world_from_object, self.notes) {
                Some(Made::Lamp(lamp)) => self.out.lights.push(lamp),
                Some(Made::Sky(_)) if self.out.sky.is_some() => {
                    self.notes.warn(&light, "a world can have one picture around it; this one is left out");
                }
                Some(Made::Sky(sky)) => self.out.sky = Some(sky),
                None => {}
            }
        }
    }

    fn surface(&mut self, surface: &Object, spot: Spot<'_>) {
        if !surface.bool("visible", true) {
            return;
        }
        let (Some(geometry), Some(material)) = (surface.object("geometry"), surface.object("material"))
        else {
            self.notes.error(surface, "`geometry` or `material` is not set, so it is not drawn");
            return;
        };
        if !geometry.known || !material.known {
            let which = if geometry.known { &material } else { &geometry };
            self.notes.error(surface, format!("it is not drawn: this device has no {}", which.title()));
            return;
        }
        let mut key = Vec::new();
        fingerprint(&geometry, &|name| !is_look(name), &mut key);
        let notes = &mut *self.notes;
        let prepared =
            kept(&self.old.prepared, &mut self.cache.prepared, key.clone(), || prepare(&geometry, notes));
        self.grow(prepared.bounds, &spot.world_from_object);
        let notes = &mut *self.notes;

        fingerprint(&geometry, &is_look, &mut key);
        fingerprint(&material, &|_| true, &mut key);
        if let Some(instance) = spot.instance {
            let replaced = instance.parameters().keys().any(|k| SLOTS.contains(&k.as_str()));
            if replaced {
                fingerprint(instance, &|name| SLOTS.contains(&name), &mut key);
            }
        }
        if names_the_world(&material) {
            key.extend(spot.world_from_object.to_cols_array().map(f64::to_bits));
        }
        let dressed = kept(&self.old.dressed, &mut self.cache.dressed, key, || {
            let model = model_of(&material, notes);
            let paint = paint_of(&material, &geometry, spot.instance, notes);
            let grain = grain_of(&material, &geometry, spot.instance, notes);
            if grain.as_ref().is_some_and(|g| g.normal.is_some()) && !prepared.parts.iter().all(Part::is_mesh)
            {
                notes.warn(
                    &material,
                    format!(
                        "`normal` is left out on {}: only triangles and quads have tangents",
                        geometry.title()
                    ),
                );
            }
            let place = &spot.world_from_object;
            prepared.parts.iter().map(|part| dress(part, &model, &paint, grain.as_ref(), place)).collect()
        });
        let object = surface.u32("id", u32::MAX);
        for d in dressed.iter() {
            let address = match &d.geometry {
                Geometry::Mesh(m) => Arc::as_ptr(m) as usize,
                Geometry::Shape(s) => Arc::as_ptr(s) as *const () as usize,
            };
            let out = &mut self.out;
            let index = *self.known.entry(address).or_insert_with(|| {
                out.geometries.push(d.geometry.clone());
                out.geometries.len() - 1
            });
            out.instances.push(Instance { geometry: index, world_from_object: spot.world_from_object });
            let material = *self.materials.entry(std::ptr::from_ref(d) as usize).or_insert_with(|| {
                out.materials.push(d.material.clone());
                out.materials.len() - 1
            });
            let mut appearance = d.appearance.clone();
            appearance.material = material;
            out.appearances.push(appearance);
            out.ids.push(Ids { object, instance: spot.id, topology: d.topology.clone() });
        }
    }

    /// Bounds of a placed box.
    fn grow(&mut self, bounds: Option<[DVec3; 2]>, place: &DAffine3) {
        let Some(b) = bounds else { return };
        for i in 0..8usize {
            let corner = DVec3::new(b[i & 1].x, b[i >> 1 & 1].y, b[i >> 2 & 1].z);
            let p = place.transform_point3(corner);
            self.out.bounds = union(self.out.bounds, Some([p, p]));
        }
    }
}
