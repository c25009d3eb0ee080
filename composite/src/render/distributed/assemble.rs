//! Makes this rank's part of the sum of what all ranks give.
use super::objects::{MergedObject, exchange_places, merge, nothing_of, num_instances};
use super::rank_scene::{Object, RankScene};
use super::tables::{Table, check, check_scene};
use super::{agree_on, brick_points};
use crate::render::FrameError;
use crate::render::partition::{Part, PrimitiveIds};
use crate::render::request_reply::RankChannel;
use crate::render::volume_bricks::VolumeBricks;
use rt_core::bvh::{Geometry, GlobalLayout, Instance, World};
use rt_core::effects::Effects;
use rt_core::glam::{UVec3, Vec3};
use rt_core::math::Aabb;
use rt_core::scene::{Appearance, Scene, VolumeInstance};
use std::collections::HashMap;
use std::fmt::Debug;
use std::sync::Arc;

/// Words of a box.
const BOX_WORDS: usize = 6;

/// The part of this rank. Trees of `previous`, its part of an earlier time step, are used again for
/// geometries that are the same.
///
/// # Errors
/// [`FrameError::Contradiction`] and [`FrameError::RankScene`] on every rank, or errors of messages
/// and of the transport.
pub(in crate::render) fn assemble(
    channel: &mut RankChannel<'_>,
    scene: RankScene,
    previous: Option<&World>,
) -> Result<Part, FrameError> {
    let (rank, parts) = (channel.rank(), channel.size());
    channel.agree_on_success(check(&scene))?;
    let about = |v: &super::DistributedVolume| {
        let shown = (v.name.clone(), v.whole, v.transfer.clone(), v.options.clone());
        (shown, v.world_from_object)
    };
    let volumes: Vec<_> = scene.volumes.iter().map(about).collect();
    let settings: [(&str, &dyn Debug); 7] = [
        ("materials", &scene.materials),
        ("lights", &scene.lights),
        ("environment", &scene.environment),
        ("background", &scene.background),
        ("ambient occlusion", &scene.ambient_occlusion),
        ("build options", &scene.build_options),
        ("volumes", &volumes),
    ];
    agree_on(channel, &settings)?;
    drop(volumes);

    // ---- One list of objects.
    let tables = exchange_tables(channel, &scene)?;
    let mut objects = merge(&tables, rank)?;
    let RankScene { objects: pieces, .. } = &scene;
    let pieces: HashMap<&str, &Object> = pieces
        .iter()
        .filter(|o| o.geometry.num_primitives() > 0)
        .map(|o| (o.name.as_str(), o))
        .collect();
    let own: Vec<Option<&Object>> =
        objects.iter().map(|o| pieces.get(o.row.name.as_str()).copied()).collect();
    let own_places: Vec<_> = own.iter().map(|o| o.map(|o| o.places.as_slice())).collect();
    exchange_places(channel, &mut objects, &own_places)?;

    // ---- The world, in the spaces of the sum.
    let piece = |(object, own): (&MergedObject, &Option<&Object>)| match own {
        Some(own) => Ok(own.geometry.clone()),
        None => nothing_of(&object.row),
    };
    let geometries: Result<Vec<Geometry>, String> = objects.iter().zip(&own).map(piece).collect();
    let count = num_instances(&objects).ok_or_else(|| "too many instances in all".to_owned());
    channel.agree_on_success(
        geometries.as_ref().map(|_| ()).map_err(String::clone).and(count.map(|_| ())),
    )?;
    let geometries = geometries.unwrap_or_default();
    let place = |(geometry, object): (usize, &MergedObject)| {
        let place = move |&world_from_object| Instance { geometry, world_from_object };
        object.places.iter().map(place).collect::<Vec<_>>()
    };
    let instances: Vec<Instance> = objects.iter().enumerate().flat_map(place).collect();
    let primitives: Vec<u64> = objects.iter().map(|o| o.row.primitives).collect();
    let join = |boxes: &mut [Aabb]| join_boxes(channel, boxes);
    let layout = GlobalLayout::of_parts(&geometries, &instances, &primitives, join)?;
    let options = &scene.build_options;
    let world = World::build_part_sharing(geometries, instances, &layout, options, previous);
    let built =
        world.map_err(|e| e.to_string()).and_then(|world| scene_of(world, &scene, &objects));
    channel.agree_on_success(built.as_ref().map(|_| ()).map_err(String::clone))?;
    let Ok(built) = built else { unreachable!("this rank's error was returned on every rank") };

    // ---- Volumes.
    let (volume_bricks, brick_data) = if scene.volumes.is_empty() {
        (VolumeBricks::default(), Vec::new())
    } else {
        brick_points::exchange(channel, &scene.volumes, &tables, &built)?
    };
    let ranges = objects.iter().zip(&own).map(|(object, own)| {
        (object.first_primitive, own.map_or(0, |own| own.geometry.num_primitives() as u32))
    });
    Ok(Part {
        needed: Effects::required_by(&built),
        scene: built,
        rank,
        parts,
        primitive_ids: PrimitiveIds::Ranges(ranges.collect()),
        volume_bricks: Arc::new(volume_bricks),
        brick_data,
        ghost_layer: None,
    })
}

/// The tables of all ranks.
fn exchange_tables(
    channel: &mut RankChannel<'_>,
    scene: &RankScene,
) -> Result<Vec<Table>, FrameError> {
    let all = channel.all_gather_varying(&Table::of(scene).encode())?;
    let dims: Vec<UVec3> = scene.volumes.iter().map(|v| v.whole.dims).collect();
    let table = |(from, words): (usize, &Vec<u32>)| {
        Table::decode(words, scene.materials.len(), &dims)
            .map_err(|reason| channel.announced_error(from, reason))
    };
    all.iter().enumerate().map(table).collect()
}

/// The scene of a world, with what all ranks have said of it.
fn scene_of(world: World, given: &RankScene, objects: &[MergedObject]) -> Result<Scene, String> {
    let mut scene = Scene::new(world);
    let look = |o: &MergedObject| vec![Appearance::new(o.row.material as usize); o.places.len()];
    scene.appearances = objects.iter().flat_map(look).collect();
    scene.materials = given.materials.clone();
    scene.lights = given.lights.clone();
    scene.environment = given.environment.clone();
    scene.background = given.background;
    scene.ambient_occlusion = given.ambient_occlusion;
    for (geometry, object) in objects.iter().enumerate() {
        if object.row.transparent {
            scene.assume_transparent_colors(geometry);
        }
    }
    for volume in &given.volumes {
        let world_from_object = volume.world_from_object;
        let none = Arc::new(brick_points::placeholder(volume)?);
        scene.volumes.push(VolumeInstance { volume: none, world_from_object });
    }
    check_scene(&scene)?;
    Ok(scene)
}

/// Replaces each box by the union of all ranks' boxes at its place.
fn join_boxes(channel: &mut RankChannel<'_>, boxes: &mut [Aabb]) -> Result<(), FrameError> {
    let words = |b: &Aabb| [b.min, b.max].map(|v| v.to_array().map(f32::to_bits));
    let mine: Vec<u32> = boxes.iter().flat_map(|b| words(b).into_iter().flatten()).collect();
    let all = channel.all_gather(&mine)?;
    boxes.fill(Aabb::EMPTY);
    for (from, words) in all.iter().enumerate() {
        for (k, (joined, words)) in
            boxes.iter_mut().zip(words.as_chunks::<BOX_WORDS>().0).enumerate()
        {
            let n = words.map(f32::from_bits);
            let b = Aabb::new(Vec3::new(n[0], n[1], n[2]), Vec3::new(n[3], n[4], n[5]));
            // Finite and in order, or the empty box.
            let usable = b.min.is_finite() && b.max.is_finite() && !b.is_empty();
            if !usable && b != Aabb::EMPTY {
                let reason = format!("the bounds of object {k} are {} to {}", b.min, b.max);
                return Err(channel.announced_error(from, reason));
            }
            *joined = joined.union(b);
        }
    }
    Ok(())
}
