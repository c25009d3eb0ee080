//! Worlds of many meshes against the world of one mesh with all of their triangles.

use crate::bvh::tests::all_options;
use crate::bvh::{
    BuildError, BuildOptions, BuildQuality, Coherence, Geometry, Instance, InstanceFilter, World,
};
use crate::mesh::TriMesh;
use crate::ray::{Hit, HitBlock, LANES, Ray, RayBlock};
use crate::test_shapes::{Random, noise_soup, sphere};
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// `mesh` made smaller and moved.
fn placed(mut mesh: TriMesh, scale: f32, at: Vec3) -> TriMesh {
    mesh.positions.iter_mut().for_each(|p| *p = *p * scale + at);
    mesh
}

/// Spheres and soups of many sizes that overlap; some share surfaces with others.
fn meshes(n: usize) -> Vec<TriMesh> {
    let mut r = Random::new(n as u64);
    let mut all: Vec<TriMesh> = (0..n)
        .map(|i| {
            let at = r.direction() * r.unit();
            let scale = 0.1 + 0.3 * r.unit() * r.unit();
            let mesh = if i % 3 == 0 {
                noise_soup(5 + i % 50, i as u64)
            } else {
                sphere(1 + i as u32 % 3)
            };
            placed(mesh, scale, at)
        })
        .collect();
    // A second copy in the same place: ties in t.
    all.push(all[0].clone());
    all
}

/// Rays from outside at triangles of all meshes in turn.
fn rays_at(meshes: &[TriMesh], n: usize) -> Vec<Ray> {
    let mut r = Random::new(n as u64);
    (0..n)
        .map(|i| {
            let mesh = &meshes[i % meshes.len()];
            let k = (r.unit() * mesh.num_triangles() as f32) as usize;
            let [a, b, c] = mesh.triangle(k.min(mesh.num_triangles() - 1));
            // Some pass by.
            let target = (a + b + c) / 3.0 + r.direction() * 0.02 * r.unit();
            let origin = 3.0 * r.direction();
            Ray::new(origin, target - origin)
        })
        .collect()
}

/// All triangles in one mesh, and the instance and triangle that each comes from.
fn merged(meshes: &[TriMesh]) -> (TriMesh, Vec<(u32, u32)>) {
    let (mut positions, mut indices, mut from) = (Vec::new(), Vec::new(), Vec::new());
    for (i, m) in meshes.iter().enumerate() {
        let base = positions.len() as u32;
        positions.extend_from_slice(&m.positions);
        indices.extend(m.indices.iter().map(|t| t.map(|k| k + base)));
        from.extend((0..m.indices.len() as u32).map(|k| (i as u32, k)));
    }
    (TriMesh::new(positions, indices), from)
}

fn geometries(meshes: &[TriMesh]) -> Vec<Geometry> {
    meshes.iter().map(|m| Geometry::Mesh(Arc::new(m.clone()))).collect()
}

/// Each geometry once, without a transform.
fn once(n: usize) -> Vec<Instance> {
    (0..n).map(|geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY }).collect()
}

fn world_of(meshes: &[TriMesh], options: &BuildOptions) -> World {
    let world = World::build(geometries(meshes), once(meshes.len()), options).expect("sound");
    world.validate().expect("a valid tree");
    world
}

fn num_members(world: &World) -> usize {
    world.group.as_ref().map_or(0, |g| g.members.len())
}

/// Hits of every kind of query, which must agree with one another.
fn hits(world: &World, rays: &[Ray]) -> Vec<Option<Hit>> {
    let single: Vec<_> = rays.iter().map(|r| world.closest(r)).collect();
    let blocks = RayBlock::from_rays(rays);
    let (mut packets, mut any) = (vec![HitBlock::MISS; blocks.len()], vec![0; blocks.len()]);
    for coherent in [true, false] {
        if coherent {
            world.closest_coherent(&blocks, &mut packets).expect("one each");
            world.occluded_coherent(&blocks, &mut any).expect("one each");
        } else {
            world.closest_incoherent(&blocks, &mut packets).expect("one each");
            world.occluded_incoherent(&blocks, &mut any).expect("one each");
        }
        for (i, hit) in single.iter().enumerate() {
            let (b, lane) = (i / LANES, i % LANES);
            assert_eq!(packets[b].get(lane), *hit, "ray {i}, coherent: {coherent}");
            assert_eq!(any[b] >> lane & 1 != 0, hit.is_some(), "ray {i}, coherent: {coherent}");
        }
    }
    for (ray, hit) in rays.iter().zip(&single) {
        assert_eq!(world.occluded(ray), hit.is_some());
    }
    single
}

#[test]
fn many_meshes_have_the_hits_of_one_mesh_with_all_their_triangles() {
    for n in [2, 7, 60] {
        let meshes = meshes(n);
        let (one, from) = merged(&meshes);
        let rays = rays_at(&meshes, 1200);
        for options in all_options() {
            let together = World::from_mesh(one.clone(), &options).expect("sound");
            let expected: Vec<_> = rays
                .iter()
                .map(|r| {
                    together.closest(r).map(|h| {
                        let (instance, prim) = from[h.prim as usize];
                        Hit { instance, prim, ..h }
                    })
                })
                .collect();
            assert!(
                expected.iter().flatten().count() > 20 * n.min(5),
                "the rays must hit something"
            );
            let world = world_of(&meshes, &options);
            assert_eq!(num_members(&world), meshes.len());
            assert_eq!(hits(&world, &rays), expected, "{n} meshes, {options:?}");
        }
    }
}

#[test]
fn meshes_far_from_zero_share_a_tree_around_their_centre() {
    let far = DVec3::new(4.2e6, -3.1e5, 870.0);
    let mut meshes = meshes(9);
    meshes.iter_mut().for_each(|m| m.origin = far);
    let world = world_of(&meshes, &BuildOptions::default());
    assert_eq!(num_members(&world), meshes.len());
    assert!((world.origin() - far).length() < 4.0, "render space lies around the meshes");
    let found = (0..2000)
        .filter(|&i| {
            let mut r = Random::new(i);
            let (o, target) = (far + 3.0 * r.direction().as_dvec3(), far);
            let (ray, _) = world.ray_from_world(o, target - o);
            world.closest(&ray).is_some()
        })
        .count();
    assert!(found > 1000, "{found} of 2000 rays through the middle hit");
}

#[test]
fn a_mesh_much_smaller_than_the_others_keeps_its_own_space() {
    let mut meshes = meshes(4);
    meshes.push(placed(sphere(2), 1e-5, Vec3::new(0.0, 3.0, 0.0)));
    let world = world_of(&meshes, &BuildOptions::default());
    assert_eq!(num_members(&world), meshes.len() - 1);
    let ray = Ray::new(Vec3::new(0.0, 3.0, 9.0), -Vec3::Z);
    let hit = world.closest(&ray).expect("the small one is in the way");
    assert_eq!(hit.instance as usize, meshes.len() - 1);
}

#[test]
fn instanced_and_moved_meshes_and_shapes_stay_outside_the_group() {
    let meshes = meshes(6);
    let (mut geometries, mut instances) = (geometries(&meshes), once(7));
    instances[3].world_from_object = DAffine3::from_translation(DVec3::X);
    instances.push(Instance { geometry: 4, world_from_object: DAffine3::IDENTITY });
    let balls = crate::shapes::Spheres::new(vec![Vec3::Y], crate::shapes::Radii::Common(0.3));
    geometries.push(Geometry::Shape(Arc::new(balls.expect("a ball"))));
    instances.push(Instance { geometry: 7, world_from_object: DAffine3::IDENTITY });
    let world = World::build(geometries, instances, &BuildOptions::default()).expect("sound");
    world.validate().expect("valid");
    let members: Vec<u32> =
        world.group.iter().flat_map(|g| &g.members).map(|m| m.instance).collect();
    assert_eq!(members, [0, 1, 2, 5, 6]);
    let mut rays = rays_at(&meshes, 1500);
    rays.extend((0..50).map(|i| Ray::new(Vec3::new(0.0, 1.0, 9.0 + i as f32), -Vec3::Z)));
    rays.extend(
        rays_at(&meshes[3..4], 50).iter().map(|r| Ray { origin: r.origin + Vec3::X, ..*r }),
    );
    let found = hits(&world, &rays);
    let mut seen: Vec<u32> = found.iter().flatten().map(|h| h.instance).collect();
    seen.sort_unstable();
    seen.dedup();
    // Number 6 is a copy of number 0 and number 7 one of number 4: ties go to the lower.
    assert_eq!(seen, [0, 1, 2, 3, 4, 5, 8]);
}

#[test]
fn a_query_for_some_members_sees_what_is_there_without_the_others() {
    let meshes = meshes(20);
    let rays = rays_at(&meshes, 1200);
    let blocks = RayBlock::from_rays(&rays);
    for options in all_options() {
        let world = world_of(&meshes, &options);
        for marks in [0u64, 1, 0x5_5555, 0xf_0f0f, u64::MAX] {
            let marked: Vec<bool> = (0..meshes.len()).map(|i| marks >> i & 1 != 0).collect();
            let kept: Vec<usize> = (0..meshes.len()).filter(|&i| marked[i]).collect();
            let of_kept: Vec<TriMesh> = kept.iter().map(|&i| meshes[i].clone()).collect();
            let (one, from) = merged(&of_kept);
            let alone = World::from_mesh(one, &options).expect("sound");
            for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                let (mut found, mut any) =
                    (vec![HitBlock::MISS; blocks.len()], vec![0; blocks.len()]);
                let filter = InstanceFilter::Marked(&marked);
                world.closest_stream(&blocks, &mut found, coherence, filter);
                world.occluded_stream(&blocks, &mut any, coherence, filter);
                for (i, ray) in rays.iter().enumerate() {
                    let expected = alone.closest(ray).map(|h| {
                        let (k, prim) = from[h.prim as usize];
                        Hit { instance: kept[k as usize] as u32, prim, ..h }
                    });
                    let (b, lane) = (i / LANES, i % LANES);
                    assert_eq!(found[b].get(lane), expected, "ray {i}, {marks:x}, {options:?}");
                    assert_eq!(any[b] >> lane & 1 != 0, expected.is_some());
                }
            }
        }
    }
}

#[test]
fn a_world_that_shares_trees_with_an_earlier_one_equals_a_new_one() {
    let options = BuildOptions::default();
    let meshes = meshes(12);
    let mut geometries = geometries(&meshes);
    let rays = rays_at(&meshes, 1000);
    let mut world = World::build(geometries.clone(), once(meshes.len()), &options).expect("sound");
    let mut r = Random::new(2);
    for step in 0..6 {
        match step {
            // One changes, one goes, one comes, the order changes, one gets a transform.
            0 => geometries[5] = Geometry::Mesh(Arc::new(placed(sphere(3), 0.4, r.direction()))),
            1 => drop(geometries.remove(0)),
            2 => geometries.insert(3, Geometry::Mesh(Arc::new(noise_soup(90, 77)))),
            3 => geometries.reverse(),
            _ => {}
        }
        let mut instances = once(geometries.len());
        if step == 4 {
            instances[2].world_from_object = DAffine3::from_translation(DVec3::Z * 0.2);
        }
        let next =
            World::build_sharing(geometries.clone(), instances.clone(), &options, Some(&world))
                .expect("sound");
        next.validate().expect("valid");
        let fresh = World::build(geometries.clone(), instances, &options).expect("sound");
        assert_eq!(hits(&next, &rays), hits(&fresh, &rays), "step {step}");
        assert_eq!(next.report().primitives, fresh.report().primitives);
        if step == 5 {
            let again = World::build_sharing(
                geometries.clone(),
                next.instances().to_vec(),
                &options,
                Some(&next),
            )
            .expect("sound");
            let tree = |w: &World| w.group.clone().expect("there is a group");
            assert!(Arc::ptr_eq(&tree(&again), &tree(&next)), "nothing changed, nothing is copied");
        }
        world = next;
    }
}

#[test]
fn refitting_one_member_equals_a_new_build() {
    for quality in BuildQuality::ALL {
        let options = BuildOptions { quality, ..BuildOptions::default() };
        let mut meshes = meshes(10);
        let mut world = world_of(&meshes, &options);
        let untouched = world_of(&meshes, &options);
        let rays = rays_at(&meshes, 1000);
        let before = hits(&untouched, &rays);
        for (k, by) in [(3, Vec3::X * 0.2), (7, Vec3::splat(-0.4)), (3, Vec3::ZERO)] {
            meshes[k] = placed(meshes[k].clone(), 0.9, by);
            let report = world.refit(k, Arc::new(meshes[k].clone())).expect("only moved");
            assert_eq!((report.unusable, report.absent), (0, 0));
            world.validate().expect("valid");
            let fresh = world_of(&meshes, &options);
            assert_eq!(hits(&world, &rays), hits(&fresh, &rays), "{quality:?}, mesh {k}");
            assert_eq!((world.origin(), world.bounds()), (fresh.origin(), fresh.bounds()));
        }
        assert_eq!(hits(&untouched, &rays), before, "a world has its own tree");
    }
}

#[test]
fn a_refit_that_moves_everything_far_away_chooses_render_space_again() {
    let mut meshes = meshes(3);
    let mut world = world_of(&meshes, &BuildOptions::default());
    for k in 0..meshes.len() {
        meshes[k].origin = DVec3::new(1e7, 0.0, -2e6);
        world.refit(k, Arc::new(meshes[k].clone())).expect("only moved");
        world.validate().expect("valid");
    }
    let fresh = world_of(&meshes, &BuildOptions::default());
    assert_eq!((world.origin(), world.bounds()), (fresh.origin(), fresh.bounds()));
    let rays: Vec<Ray> = rays_at(&meshes, 500)
        .iter()
        .map(|r| {
            let from = meshes[0].origin + r.origin.as_dvec3();
            world.ray_from_world(from, r.dir.as_dvec3()).0
        })
        .collect();
    assert_eq!(hits(&world, &rays), hits(&fresh, &rays));
}

#[test]
fn parts_of_many_meshes_together_have_the_hits_of_the_whole() {
    let meshes = meshes(15);
    let options = BuildOptions::default();
    let whole = world_of(&meshes, &options);
    let layout = whole.global_layout();
    let rays = rays_at(&meshes, 1500);
    let split = |odd: bool| {
        let keep = |(i, m): (usize, &TriMesh)| {
            // Some meshes are cut in two, some belong to one part.
            let kept =
                (0..m.indices.len()).filter(|t| if i % 2 == 0 { (t % 2 == 1) == odd } else { odd });
            let kept: Vec<u32> = kept.map(|t| t as u32).collect();
            let indices = kept.iter().map(|&t| m.indices[t as usize]).collect();
            (TriMesh { origin: m.origin, ..TriMesh::new(m.positions.clone(), indices) }, kept)
        };
        let (parts, numbers): (Vec<_>, Vec<_>) = meshes.iter().enumerate().map(keep).unzip();
        let world = World::build_part(geometries(&parts), once(parts.len()), &layout, &options)
            .expect("a part");
        world.validate().expect("valid");
        (world, numbers)
    };
    let parts = [split(false), split(true)];
    for ray in &rays {
        let of_part = |(world, numbers): &(World, Vec<Vec<u32>>)| {
            world
                .closest(ray)
                .map(|h| Hit { prim: numbers[h.instance as usize][h.prim as usize], ..h })
        };
        let order = |a: &Hit, b: &Hit| {
            a.t.total_cmp(&b.t).then((a.instance, a.prim).cmp(&(b.instance, b.prim)))
        };
        assert_eq!(parts.iter().filter_map(of_part).min_by(order), whole.closest(ray), "{ray:?}");
    }
    let mut moved = once(meshes.len());
    moved[4].world_from_object = DAffine3::from_translation(DVec3::X);
    let error = World::build_part(geometries(&meshes), moved, &layout, &options).err();
    assert_eq!(error, Some(BuildError::NotAMember { instance: 4 }));
}

#[test]
fn empty_meshes_and_meshes_of_nan_are_left_out() {
    let mut meshes = meshes(5);
    meshes.insert(2, TriMesh::default());
    let mut broken = sphere(2);
    broken.positions.iter_mut().for_each(|p| p.y = f32::NAN);
    meshes.insert(4, broken);
    let world = world_of(&meshes, &BuildOptions::default());
    assert_eq!(num_members(&world), meshes.len() - 2);
    assert_eq!(world.report().skipped, meshes[4].indices.len());
    let rays = rays_at(&[meshes[0].clone(), meshes[6].clone()], 400);
    assert!(hits(&world, &rays).iter().flatten().count() > 200);
    let nothing = world_of(&[TriMesh::default(), TriMesh::default()], &BuildOptions::default());
    assert_eq!(nothing.closest(&Ray::new(Vec3::ZERO, Vec3::X)), None);
}

#[test]
fn meshes_of_very_different_size_find_their_owners() {
    // One large mesh between many of one triangle: the table of owners has crowded ranges.
    let mut meshes: Vec<TriMesh> =
        (0..300).map(|i| placed(noise_soup(1, i), 0.3, Random::new(i).direction())).collect();
    meshes.insert(150, noise_soup(20_000, 9));
    let world = world_of(&meshes, &BuildOptions::default());
    let group = world.group.as_ref().expect("one tree");
    assert!(group.members.len() > 250, "a few triangles are too small for the group");
    let mut id = 0;
    for m in &group.members {
        for prim in 0..meshes[m.geometry].indices.len() as u32 {
            assert_eq!(group.owner(id), (m.instance, prim));
            id += 1;
        }
    }
}

#[test]
fn the_tree_of_many_meshes_does_not_depend_on_the_number_of_threads() {
    let meshes = meshes(150);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let world = pool.install(|| world_of(&meshes, &BuildOptions::default()));
        let group = world.group.as_ref().expect("one tree");
        bytemuck::cast_slice::<_, u32>(&group.bvh.units).to_vec()
    };
    let expected = build(1);
    for threads in [2, 5] {
        assert!(build(threads) == expected, "{threads} threads");
    }
}
