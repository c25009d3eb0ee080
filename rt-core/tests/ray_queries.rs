//! Rays with conditions: masks of instances, and filters for hits.
#![forbid(unsafe_code)]

use rt_core::bvh::{BuildQuality, MaskError, RayQuery, Robustness};
use rt_core::glam::{DMat3, DQuat};
use rt_core::prelude::*;
use rt_core::ray::LANES;
use rt_core::shapes::{Radii, Spheres};
use rt_core::simd::SimdLevel;
use std::sync::{Arc, Mutex};

/// Numbers from 0 to 1, the same in every run.
fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Triangles in a cube, with pairs at the same place, so that hits tie.
fn soup(triangles: u32, seed: u64) -> TriMesh {
    let mut next = numbers(seed);
    let mut point = |size: f32| Vec3::new(next(), next(), next()) * size;
    let mut positions = Vec::new();
    for i in 0..triangles {
        let at = point(1.0);
        let corners = [at, at + point(0.6), at + point(0.6)];
        let n = positions.len();
        if i % 5 == 4 { positions.extend_from_within(n - 3..) } else { positions.extend(corners) }
    }
    TriMesh::new(positions, (0..triangles).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

const SIZES: [u32; 3] = [60, 45, 30];

/// Two meshes that share a tree, and one with two turned and scaled instances.
fn scene() -> (Vec<TriMesh>, Vec<Instance>) {
    let meshes = SIZES.iter().zip(1..).map(|(&n, seed)| soup(n, seed)).collect();
    let turned = |angle: f64, size: f64, x: f64| {
        let linear = DMat3::from_quat(DQuat::from_rotation_y(angle)) * size;
        DAffine3::from_mat3_translation(linear, DVec3::X * x)
    };
    let places =
        [DAffine3::IDENTITY, DAffine3::IDENTITY, turned(0.3, 1.5, 0.2), turned(2., 0.7, 0.8)];
    let instance = |(geometry, world_from_object)| Instance { geometry, world_from_object };
    (meshes, [0, 1, 2, 2].into_iter().zip(places).map(instance).collect())
}

fn world_of(meshes: &[TriMesh], instances: &[Instance], options: &BuildOptions) -> World {
    let geometries = meshes.iter().map(|m| Geometry::Mesh(Arc::new(m.clone()))).collect();
    World::build(geometries, instances.to_vec(), options).unwrap()
}

/// For each triangle of each mesh, a world that holds nothing else and has the whole's coordinates.
fn lone_triangles(whole: &World, meshes: &[TriMesh], options: &BuildOptions) -> Vec<World> {
    let layout = whole.global_layout();
    let mut worlds = Vec::new();
    for (of, mesh) in meshes.iter().enumerate() {
        for kept in 0..mesh.indices.len() {
            let part = |(m, mesh): (usize, &TriMesh)| {
                let mut mesh = mesh.clone();
                for (i, t) in mesh.indices.iter_mut().enumerate() {
                    if (m, i) != (of, kept) {
                        *t = [u32::MAX; 3];
                    }
                }
                Geometry::Mesh(Arc::new(mesh))
            };
            let geometries = meshes.iter().enumerate().map(part).collect();
            let instances = whole.instances().to_vec();
            worlds.push(World::build_part(geometries, instances, &layout, options).unwrap());
        }
    }
    worlds
}

/// All hits that single triangles have on their own, found for each instance by masking the others.
fn brute_force(lone: &[World], ray: &Ray) -> Vec<Hit> {
    let instances = lone[0].instances().len();
    let mut hits = Vec::new();
    for world in lone {
        for i in 0..instances {
            let mut masks = vec![0; instances];
            masks[i] = 1;
            hits.extend(world.query().with_masks(&masks, 1).unwrap().closest(ray));
        }
    }
    hits
}

fn rays(n: usize) -> Vec<Ray> {
    let mut next = numbers(77);
    let mut point = move || Vec3::new(3.5 * next() - 1.0, 2.0 * next() - 0.5, 2.5 * next() - 1.0);
    (0..n)
        .map(|i| {
            let (origin, to) = (point(), point());
            // Some rays are limited, some have directions of odd lengths, some start far away.
            let ray = Ray::new(origin, to - origin);
            match i % 5 {
                0 => ray.with_t_max(0.8),
                1 => Ray { dir: ray.dir * 1e-30, ..ray },
                2 => Ray { origin: origin - 500.0 * ray.dir, ..ray },
                _ => ray,
            }
        })
        .collect()
}

fn first(hits: impl Iterator<Item = Hit>) -> Option<Hit> {
    hits.min_by(|a, b| a.t.total_cmp(&b.t).then((a.instance, a.prim).cmp(&(b.instance, b.prim))))
}

fn bits(hit: Option<Hit>) -> Option<[u32; 5]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim, h.instance])
}

/// Single rays, and blocks in both orders: all have the answers of `expected`.
#[track_caller]
fn assert_answers(query: &RayQuery<'_>, rays: &[Ray], expected: &[Option<Hit>], what: &str) {
    let blocks = RayBlock::from_rays(rays);
    let mut hits = [vec![HitBlock::MISS; blocks.len()], vec![HitBlock::MISS; blocks.len()]];
    let mut masks = [vec![0; blocks.len()], vec![0; blocks.len()]];
    query.closest_coherent(&blocks, &mut hits[0]).unwrap();
    query.closest_incoherent(&blocks, &mut hits[1]).unwrap();
    query.occluded_coherent(&blocks, &mut masks[0]).unwrap();
    query.occluded_incoherent(&blocks, &mut masks[1]).unwrap();
    for (i, (ray, expected)) in rays.iter().zip(expected).enumerate() {
        let (block, lane) = (i / LANES, i % LANES);
        assert_eq!(bits(query.closest(ray)), bits(*expected), "{what}: ray {i}");
        assert_eq!(query.occluded(ray), expected.is_some(), "{what}: ray {i}");
        for mode in 0..2 {
            let hit = hits[mode][block].get(lane);
            assert_eq!(bits(hit), bits(*expected), "{what}: ray {i} in mode {mode}");
            let blocked = masks[mode][block] >> lane & 1 == 1;
            assert_eq!(blocked, expected.is_some(), "{what}: ray {i} in mode {mode}");
        }
    }
    assert!(query.closest_coherent(&blocks, &mut hits[0][1..]).is_err(), "{what}: lengths");
}

#[test]
fn accepted_hits_are_those_of_brute_force() {
    let (meshes, instances) = scene();
    let rays = rays(150);
    type Filter = (&'static str, fn(&Hit) -> bool);
    let filters: [Filter; 5] = [
        ("all", |_| true),
        ("none", |_| false),
        ("half of the triangles", |h| (h.prim + h.instance) % 2 == 0),
        // Leaves of which a picture cuts away the corner and a stripe.
        ("cut", |h| h.u + h.v > 0.3 && (h.u * 10.0) as u32 % 3 != 1),
        ("beyond", |h| h.t > 0.4),
    ];
    for robustness in Robustness::ALL {
        let base = BuildOptions { robustness, ..Default::default() };
        let lone = lone_triangles(&world_of(&meshes, &instances, &base), &meshes, &base);
        let all: Vec<Vec<Hit>> = rays.iter().map(|r| brute_force(&lone, r)).collect();
        let met = all.iter().map(Vec::len).sum::<usize>();
        assert!(met > 150, "{met} hits of {} rays", rays.len());
        let levels = SimdLevel::available().into_iter().map(|l| (BuildQuality::Balanced, Some(l)));
        for (quality, simd) in BuildQuality::ALL.map(|q| (q, None)).into_iter().chain(levels) {
            let world = world_of(&meshes, &instances, &BuildOptions { quality, simd, ..base });
            for (name, accept) in filters {
                let expected: Vec<Option<Hit>> =
                    all.iter().map(|hits| first(hits.iter().copied().filter(accept))).collect();
                let what = format!("{name}, {robustness:?}, {quality:?}, {simd:?}");
                assert_answers(&world.query().accepting(&accept), &rays, &expected, &what);
            }
            let plain: Vec<_> = rays.iter().map(|r| world.closest(r)).collect();
            assert_answers(&world.query(), &rays, &plain, "without conditions");
            assert_answers(&world.query().accepting(&|_| true), &rays, &plain, "all accepted");
        }
    }
}

#[test]
fn masked_rays_meet_what_their_mask_allows_in_every_mode() {
    let (meshes, instances) = scene();
    let rays = rays(300);
    let world = world_of(&meshes, &instances, &BuildOptions::default());
    // Both members of the shared tree, one of them, an instance of the other mesh, nothing.
    for (masks, ray_mask) in [
        ([1, 1, 0, 0], 1),
        ([0b10, 0b01, 0b100, 0b1000], 0b01),
        ([0b10, 0b01, 0b100, 0b1000], 0b1010),
        ([u32::MAX; 4], 0),
        ([0; 4], u32::MAX),
        ([u32::MAX; 4], 1 << 31),
    ] {
        let seen = |h: &Hit| masks[h.instance as usize] & ray_mask != 0;
        let accepted = world.query().accepting(&seen);
        let expected: Vec<_> = rays.iter().map(|r| accepted.closest(r)).collect();
        let none = ray_mask == 0 || masks == [0; 4];
        assert_eq!(expected.iter().all(Option::is_none), none, "{masks:?} {ray_mask}");
        let masked = world.query().with_masks(&masks, ray_mask).unwrap();
        assert_answers(&masked, &rays, &expected, &format!("{masks:?} {ray_mask}"));
        assert_answers(&masked.accepting(&|_| true), &rays, &expected, "with a filter");
    }
    let error = world.query().with_masks(&[1; 3], 1).err();
    assert_eq!(error, Some(MaskError { instances: 4, masks: 3 }));

    // A world of one instance skips the upper level.
    let one = World::from_mesh(meshes[0].clone(), &BuildOptions::default()).unwrap();
    let expected: Vec<_> = rays.iter().map(|r| one.closest(r)).collect();
    assert_answers(&one.query().with_masks(&[4], 4).unwrap(), &rays, &expected, "one");
    let nothing = vec![None; rays.len()];
    assert_answers(&one.query().with_masks(&[4], 3).unwrap(), &rays, &nothing, "one, masked");
}

#[test]
fn a_filter_is_told_the_hit_that_is_returned() {
    let (meshes, instances) = scene();
    let world = world_of(&meshes, &instances, &BuildOptions::default());
    let mut hits = 0;
    for ray in rays(300) {
        let told = Mutex::new(Vec::new());
        let accept = |hit: &Hit| {
            told.lock().unwrap().push(bits(Some(*hit)));
            !hit.prim.is_multiple_of(3)
        };
        let hit = world.query().accepting(&accept).closest(&ray);
        let told = told.into_inner().unwrap();
        assert!(hit.is_none() || told.contains(&bits(hit)), "{ray:?}: {hit:?} of {told:?}");
        hits += usize::from(hit.is_some());
    }
    assert!(hits > 100, "{hits} hits");
}

#[test]
fn a_refused_hit_of_a_shape_gives_way_to_the_next() {
    let spheres = Spheres::new(vec![Vec3::ZERO, Vec3::Z * 5.0], Radii::Common(1.0)).unwrap();
    let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let geometries = vec![Geometry::Shape(Arc::new(spheres))];
    let world = World::build(geometries, vec![placed], &BuildOptions::default()).unwrap();
    let ray = Ray::new(Vec3::Z * -10.0, Vec3::Z);
    let beyond = |t: f32| {
        let far = move |hit: &Hit| hit.t > t;
        world.query().accepting(&far).closest(&ray).map(|h| (h.prim, h.t.round()))
    };
    assert_eq!(beyond(0.0), Some((0, 9.0)));
    assert_eq!(beyond(9.5), Some((0, 11.0)), "the far side of the first sphere");
    assert_eq!(beyond(11.5), Some((1, 14.0)));
    assert_eq!(beyond(14.5), Some((1, 16.0)));
    assert_eq!(beyond(16.5), None);
    let none = |_: &Hit| false;
    assert!(!world.query().accepting(&none).occluded(&ray) && world.occluded(&ray));
}
