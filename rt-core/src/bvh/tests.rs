//! The traversal against the brute-force reference, on every preset, instruction set and robustness
//! mode.

use super::query::{AnyHit, ClosestHit, FastTest, HitQuery, TriangleTest, WatertightTest};
use super::streams::TraversalScratch;
use super::*;
use crate::mesh::TriMesh;
use crate::ray::{HitBlock, LANES, NO_HIT, Ray, RayBlock};
use crate::simd::SimdLevel;
use crate::test_shapes::{Random, noise_soup, sphere};
use glam::Vec3;
use std::sync::Arc;

/// Every combination of options.
pub(crate) fn all_options() -> Vec<BuildOptions> {
    let mut all = Vec::new();
    for quality in BuildQuality::ALL {
        for robustness in Robustness::ALL {
            for simd in SimdLevel::available() {
                all.push(BuildOptions {
                    quality,
                    robustness,
                    simd: Some(simd),
                    ..Default::default()
                });
            }
        }
    }
    all
}

fn random_rays(n: usize, seed: u64, spread: f32) -> Vec<Ray> {
    let mut r = Random::new(seed);
    (0..n)
        .map(|_| {
            let o = r.direction() * 3.0;
            let target = r.direction() * spread * r.unit();
            Ray::new(o, target - o)
        })
        .collect()
}

#[test]
fn closest_hits_equal_brute_force() {
    let mesh = noise_soup(600, 7);
    let rays = random_rays(1500, 3, 1.0);
    let expected: Vec<_> = rays.iter().map(|r| brute_force::closest(&mesh, r)).collect();
    assert!(expected.iter().filter(|e| e.is_some()).count() > 200, "the rays must hit something");
    for options in all_options() {
        let world = World::from_mesh(mesh.clone(), &options).expect("a valid mesh");
        for (ray, e) in rays.iter().zip(&expected) {
            match (world.closest(ray), e) {
                (None, None) => {}
                (Some(h), Some((t, prim))) => {
                    assert!(
                        (h.t as f64 - t).abs() <= 4e-6 * t,
                        "{options:?} {ray:?}: t {} is not {t}",
                        h.t
                    );
                    assert_eq!(h.prim, *prim, "{options:?} {ray:?}");
                    // The hit point from the barycentrics is the point on the ray.
                    let [a, b, c] = mesh.triangle(h.prim as usize);
                    let p = a + (b - a) * h.u + (c - a) * h.v;
                    assert!(
                        (p - ray.at(h.t)).length() < 1e-4,
                        "{options:?}: {p} is not {}",
                        ray.at(h.t)
                    );
                }
                (found, _) => panic!("{options:?} {ray:?}: found {found:?}, expected {e:?}"),
            }
            assert_eq!(world.occluded(ray), e.is_some(), "{options:?} {ray:?}");
        }
    }
}

/// Tiles of a camera (one origin), the same rays reversed (many origins), and rays in all
/// directions.
fn ray_sets() -> Vec<(&'static str, Vec<Ray>)> {
    let eye = Vec3::new(0.3, -2.0, 2.9);
    let mut camera = Vec::new();
    for tile in 0..16 {
        for i in 0..256 {
            let (x, y) = ((tile % 4) * 16 + i % 16, (tile / 4) * 16 + i / 16);
            let target = Vec3::new(x as f32 / 32.0 - 1.0, y as f32 / 32.0 - 1.0, 0.1);
            camera.push(Ray::new(eye, target - eye));
        }
    }
    let reversed = camera
        .iter()
        .map(|r| Ray { origin: r.at(1.9), dir: -r.dir, t_min: 0.01, t_max: 1.9 })
        .collect();
    vec![("camera", camera), ("reversed", reversed), ("all directions", random_rays(2000, 11, 1.2))]
}

/// Blocks of every kind that the entry points for rays in any direction distinguish: rays that
/// start together, rays that start far apart, blocks of one ray and blocks without rays; some lanes
/// are idle, some rays are short.
fn mixed_blocks() -> Vec<RayBlock> {
    let mut r = Random::new(23);
    let block = |k: usize| {
        let together = r.direction() * 0.6;
        let mut block = RayBlock::INACTIVE;
        for lane in 0..LANES {
            let origin = if k.is_multiple_of(2) { together } else { r.direction() * 1.5 };
            let dir =
                if k.is_multiple_of(6) { r.direction() } else { r.direction() * 0.5 - origin };
            let t_max = if r.unit() < 0.3 { r.unit() } else { f32::INFINITY };
            let ray = Ray { origin, dir, t_min: 0.1 * r.unit(), t_max };
            let idle = match k % 5 {
                0 => lane % 3 == 1,
                1 => lane != 7,
                2 => k % 10 == 2,
                _ => false,
            };
            if !idle {
                block.set(lane, &ray);
            }
        }
        block
    };
    (0..150).map(block).collect()
}

#[test]
fn blocks_of_rays_that_start_together_and_apart_get_the_answers_of_single_rays() {
    let blocks = mixed_blocks();
    // A tree of one leaf, one of a single node, and deep ones.
    for (triangles, seed) in [(2, 1), (20, 2), (600, 3), (20_000, 4)] {
        let mesh = noise_soup(triangles, seed);
        for options in all_options() {
            let world = World::from_mesh(mesh.clone(), &options).expect("a valid mesh");
            // Calls of every number of blocks up to more than two groups.
            for n in [1, 2, 16, 17, 40, 150] {
                let mut hits = vec![HitBlock::MISS; n];
                let mut blocked = vec![0u16; n];
                world.closest_incoherent(&blocks[..n], &mut hits).expect("one each");
                world.occluded_incoherent(&blocks[..n], &mut blocked).expect("one each");
                for (b, (rays, found)) in blocks.iter().zip(&hits).enumerate() {
                    for lane in 0..LANES {
                        let ray = rays.get(lane);
                        let expected = ray.is_valid().then(|| world.closest(&ray)).flatten();
                        let what = format!("{options:?}: {triangles} triangles, block {b} of {n}");
                        assert_eq!(found.get(lane), expected, "{what}, lane {lane}: {ray:?}");
                        let any = blocked[b] >> lane & 1 == 1;
                        assert_eq!(any, expected.is_some(), "{what}, lane {lane}: occlusion");
                    }
                }
            }
        }
    }
}

#[test]
fn packets_equal_single_rays_bit_for_bit_at_every_level() {
    let mesh = sphere(4);
    for (name, rays) in ray_sets() {
        let blocks = RayBlock::from_rays(&rays);
        let mut reference: Option<Vec<HitBlock>> = None;
        for simd in SimdLevel::available() {
            let options = BuildOptions { simd: Some(simd), ..Default::default() };
            let world = World::from_mesh(mesh.clone(), &options).expect("a valid mesh");
            let mut coherent = vec![HitBlock::MISS; blocks.len()];
            let mut sorted = coherent.clone();
            let mut single = coherent.clone();
            world.closest_coherent(&blocks, &mut coherent).expect("one each");
            world.closest_incoherent(&blocks, &mut sorted).expect("one each");
            for (i, r) in rays.iter().enumerate() {
                single[i / LANES].set(i % LANES, world.closest(r));
            }
            for (what, found) in [("packet", &coherent), ("sorted", &sorted)] {
                for (i, r) in rays.iter().enumerate() {
                    let (a, b) =
                        (single[i / LANES].get(i % LANES), found[i / LANES].get(i % LANES));
                    assert_eq!(
                        a, b,
                        "{name} {simd:?}: single ray (left) and {what} (right) differ for ray {i}, \
                         {r:?}"
                    );
                }
            }
            match &reference {
                None => reference = Some(single.clone()),
                Some(r) => assert!(*r == single, "{name}: {simd:?} differs from the first level"),
            }
            let (mut a, mut b) = (vec![0u16; blocks.len()], vec![0u16; blocks.len()]);
            world.occluded_coherent(&blocks, &mut a).expect("one each");
            world.occluded_incoherent(&blocks, &mut b).expect("one each");
            for (i, h) in single.iter().enumerate() {
                let expected = (0..LANES).fold(0, |m, l| m | ((h.prim[l] != NO_HIT) as u16) << l);
                assert_eq!(
                    (a[i], b[i]),
                    (expected, expected),
                    "{name} {simd:?}: occlusion of block {i}"
                );
            }
        }
    }
}

#[test]
fn empty_worlds_and_missing_rays() {
    for options in all_options() {
        let empty = World::build(Vec::new(), Vec::new(), &options).expect("nothing is allowed");
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        assert_eq!(empty.closest(&ray), None);
        let no_triangles =
            World::from_mesh(TriMesh::default(), &options).expect("no triangles are allowed");
        assert_eq!(no_triangles.closest(&ray), None);
        let mut hits = [HitBlock::MISS; 3];
        no_triangles
            .closest_coherent(&RayBlock::from_rays(&[ray; 40]), &mut hits)
            .expect("one each");
        assert!(hits.iter().all(|h| h.prim == [NO_HIT; LANES]));
    }
}

#[test]
fn worlds_share_the_trees_of_geometries_they_have_in_common() {
    let mesh = |seed| Geometry::Mesh(Arc::new(noise_soup(300, seed)));
    let (kept, changed, new) = (mesh(1), mesh(2), mesh(3));
    let at = |geometry, x: f64| Instance {
        geometry,
        world_from_object: glam::DAffine3::from_translation(glam::DVec3::X * x),
    };
    let options = BuildOptions::default();
    let build =
        |g: Vec<Geometry>, i, p| World::build_sharing(g, i, &options, p).expect("valid meshes");
    let mut first = build(vec![changed, kept.clone()], vec![at(0, 0.0), at(1, 1.0)], None);
    let geometries = vec![kept, new];
    let instances = vec![at(1, 0.25), at(0, -0.5)];
    let second = build(geometries.clone(), instances.clone(), Some(&first));
    assert!(
        Arc::ptr_eq(&first.blas[1], &second.blas[0]),
        "the kept geometry has another index, but the same tree"
    );
    let fresh = build(geometries.clone(), instances.clone(), None);
    let hits =
        |w: &World| random_rays(800, 5, 1.0).iter().map(|r| w.closest(r)).collect::<Vec<_>>();
    let expected = hits(&fresh);
    assert!(expected.iter().flatten().count() > 100, "the rays must hit something");
    assert_eq!(hits(&second), expected);

    // A refit of one world is none of the other's business.
    first.refit(1, Arc::new(noise_soup(300, 1))).expect("the same triangles");
    assert!(!Arc::ptr_eq(&first.blas[1], &second.blas[0]));
    assert_eq!(hits(&second), expected);

    // Other options: nothing of the old tree fits.
    let other = BuildOptions { quality: BuildQuality::Fast, ..options };
    let third =
        World::build_sharing(geometries, instances, &other, Some(&second)).expect("valid meshes");
    assert!(!Arc::ptr_eq(&third.blas[0], &second.blas[0]));
}

// ---- Some of the instances

/// Few instances are traced in packets, many one by one; all sides of a mesh, a mirrored one, and a
/// shape.
fn many_places(n: usize) -> (Vec<Geometry>, Vec<Instance>) {
    use crate::shapes::{Radii, Spheres};
    use glam::{DAffine3, DVec3};
    let balls = Spheres::new(vec![Vec3::ZERO, Vec3::X * 0.3], Radii::Common(0.2)).expect("balls");
    let geometries = vec![
        Geometry::Mesh(Arc::new(noise_soup(60, 5))),
        Geometry::Mesh(Arc::new(sphere(2))),
        Geometry::Shape(Arc::new(balls)),
    ];
    let mut r = Random::new(n as u64);
    let instances = (0..n)
        .map(|i| {
            let place = (r.direction() * r.unit()).as_dvec3();
            let scale = DVec3::new(if i % 4 == 0 { -0.4 } else { 0.4 }, 0.3, 0.5);
            let world_from_object = DAffine3::from_scale_rotation_translation(
                scale,
                glam::DQuat::from_rotation_y(i as f64),
                place,
            );
            Instance { geometry: i % 3, world_from_object }
        })
        .collect();
    (geometries, instances)
}

#[test]
fn rays_among_some_instances_meet_what_is_met_when_all_others_are_gone() {
    for n in [1, 2, 7, 60] {
        let (geometries, instances) = many_places(n);
        for simd in SimdLevel::available() {
            let options = BuildOptions { simd: Some(simd), ..BuildOptions::default() };
            let world =
                World::build(geometries.clone(), instances.clone(), &options).expect("sound");
            for marks in [0u64, u64::MAX, 0x5555_5555_5555_5555, 0x0f0f_3c3c_0f0f_3c3c] {
                let marked: Vec<bool> = (0..n).map(|i| marks >> i & 1 != 0).collect();
                for (name, rays) in ray_sets() {
                    check_among(
                        &world,
                        &marked,
                        &rays[..600],
                        &format!("{n} instances, {name}, {simd:?}"),
                    );
                }
            }
        }
    }
}

/// Tiles of pixels seen from `eye`, which is a point of every ray; with `apart`, the rays start at
/// points of their own.
fn tiles(eye: Vec3, apart: bool) -> Vec<RayBlock> {
    let mut r = Random::new(7);
    let towards = (-eye).normalize();
    let right = towards.any_orthonormal_vector();
    let up = right.cross(towards);
    let mut pixel = |x: usize, y: usize| {
        let at = |i: usize| i as f32 / 32.0 - 1.0 + 1.0 / 64.0;
        let dir = (1.5 * right * at(x) + 1.5 * up * at(y) - eye) / eye.length().max(1.0);
        let origin = if apart { eye + dir * 0.2 * r.unit() } else { eye };
        let t_max = if r.unit() < 0.2 { eye.length() } else { f32::INFINITY };
        Ray { origin, dir, t_min: if r.unit() < 0.2 { 0.3 } else { 0.0 }, t_max }
    };
    let order = (0..64 * 64).map(|i| (i / 1024, i / 256 % 4, i / 16 % 16, i % 16));
    let places = order.map(|(row, tile, block, ray)| {
        let of = |i: usize| (i % 4, i / 4);
        let ((bx, by), (rx, ry)) = (of(block), of(ray));
        (tile * 16 + bx * 4 + rx, row * 16 + by * 4 + ry)
    });
    let rays: Vec<Ray> = places.map(|(x, y)| pixel(x, y)).collect();
    RayBlock::from_rays(&rays)
}

#[test]
fn every_way_through_the_upper_level_gives_the_bits_of_single_rays() {
    fn check<S: fearless_simd::Simd, T: TriangleTest, Q: HitQuery>(
        simd: S,
        world: &World,
        blocks: &[RayBlock],
        filter: InstanceFilter<'_>,
        what: &str,
    ) -> usize {
        let mut scratch = TraversalScratch::new();
        let mut met = 0;
        for tile in blocks.chunks(LANES) {
            let mut expected = vec![HitBlock::MISS; tile.len()];
            world.trace_single_rays::<S, T, Q>(simd, tile, &mut expected, filter);
            for way in 0..several_entries::WAYS {
                let mut hits = vec![HitBlock::MISS; tile.len()];
                world.trace_in_way::<S, T, Q>(way, simd, tile, &mut hits, filter, &mut scratch);
                for (b, (found, expected)) in hits.iter().zip(&expected).enumerate() {
                    for lane in 0..LANES {
                        let (found, expected) = (found.get(lane), expected.get(lane));
                        let ray = tile[b].get(lane);
                        assert_eq!(found.is_some(), expected.is_some(), "{what}, {way}: {ray:?}");
                        assert!(Q::ANY || found == expected, "{what}, {way}: {ray:?}");
                        met += usize::from(found.is_some());
                    }
                }
            }
        }
        met
    }
    // Instances, and meshes that share a tree.
    for (n, unmoved) in [(2, 0), (7, 3), (60, 20), (400, 0)] {
        let (geometries, mut instances) = many_places(n);
        let mut geometries = geometries;
        for k in 0..unmoved {
            geometries.push(Geometry::Mesh(Arc::new(noise_soup(30, 100 + k as u64))));
            let geometry = geometries.len() - 1;
            instances.push(Instance { geometry, world_from_object: glam::DAffine3::IDENTITY });
        }
        let even: Vec<bool> = (0..instances.len()).map(|i| i % 2 == 0).collect();
        for options in all_options() {
            if options.quality != BuildQuality::Balanced {
                continue;
            }
            let built = World::build(geometries.clone(), instances.clone(), &options);
            let world = built.expect("sound geometries");
            let mut met = 0;
            // Near, and so far away that origins are moved.
            for eye in [Vec3::new(0.4, 0.3, 2.0), Vec3::new(-3e3, 1e3, 2e3)] {
                for apart in [false, true] {
                    let blocks = tiles(eye, apart);
                    for filter in [InstanceFilter::All, InstanceFilter::Marked(&even)] {
                        let what = format!("{n} and {unmoved}, {options:?}, {eye}, {apart}");
                        met += fearless_simd::dispatch!(world.level, simd => {
                            let fast = options.robustness == Robustness::Fast;
                            let (w, b) = (&world, &blocks[..]);
                            if fast {
                                check::<_, FastTest, ClosestHit>(simd, w, b, filter, &what)
                                    + check::<_, FastTest, AnyHit>(simd, w, b, filter, &what)
                            } else {
                                check::<_, WatertightTest, ClosestHit>(simd, w, b, filter, &what)
                                    + check::<_, WatertightTest, AnyHit>(simd, w, b, filter, &what)
                            }
                        });
                    }
                }
            }
            assert!(met > 3_000, "{n} and {unmoved}: {met} rays met something");
        }
    }
}

/// Follows each ray through all instances, hit after hit, until it hits a marked one.
fn check_among(world: &World, marked: &[bool], rays: &[Ray], what: &str) {
    let blocks = RayBlock::from_rays(rays);
    let first_of = |ray: &Ray, wanted: bool| {
        let level = world.level;
        let found = (0..marked.len()).filter(|&i| marked[i] == wanted).filter_map(|i| {
            let only: Vec<bool> = (0..marked.len()).map(|k| k == i).collect();
            let filter = InstanceFilter::Marked(&only);
            fearless_simd::dispatch!(
                level,
                simd => world.closest_in::<_, WatertightTest>(simd, ray, filter)
            )
        });
        found.min_by(|a, b| a.t.total_cmp(&b.t).then(a.instance.cmp(&b.instance)))
    };
    for (wanted, filter) in
        [(true, InstanceFilter::Marked(marked)), (false, InstanceFilter::Unmarked(marked))]
    {
        let expected: Vec<_> = rays.iter().map(|r| first_of(r, wanted)).collect();
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let mut hits = vec![HitBlock::MISS; blocks.len()];
            let mut any = vec![0u16; blocks.len()];
            world.closest_stream(&blocks, &mut hits, coherence, filter);
            world.occluded_stream(&blocks, &mut any, coherence, filter);
            for (i, e) in expected.iter().enumerate() {
                let (b, lane) = (i / LANES, i % LANES);
                assert_eq!(hits[b].get(lane), *e, "{what}, {coherence:?}, ray {i}");
                assert_eq!(any[b] >> lane & 1 != 0, e.is_some(), "{what}, {coherence:?}, ray {i}");
            }
        }
    }
}
