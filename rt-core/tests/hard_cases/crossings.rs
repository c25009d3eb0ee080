//! All hits of a ray: each crossing of a surface once, in order, also through edges and vertices.

use crate::common::*;
use rt_core::bvh::{BuildOptions, Geometry, Instance, Robustness, TooManyHits, World};
use rt_core::glam::{DAffine3, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use rt_core::ray::{LANES, Ray, RayBlock};
use rt_core::shapes::{Radii, Spheres};
use std::sync::Arc;

fn integer(random: &mut SplitMix64, range: i32) -> f32 {
    ((random.unit() * f64::from(2 * range + 1)).floor() as i32 - range) as f32
}

/// The surface of the box from zero to `n`, with vertices at all integers: closed, and full of
/// edges and vertices that rays along the lattice meet.
fn lattice_box(n: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    for axis in 0..3 {
        for side in [0, n] {
            let first = mesh.positions.len() as u32;
            for j in 0..=n {
                for i in 0..=n {
                    let mut p = [0.0; 3];
                    p[axis] = side as f32;
                    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (i as f32, j as f32);
                    mesh.positions.push(Vec3::from_array(p));
                }
            }
            let at = |i: u32, j: u32| first + j * (n + 1) + i;
            for j in 0..n {
                for i in 0..n {
                    let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    // Both diagonals occur.
                    if (i + j) % 2 == 0 {
                        mesh.indices.extend([[a, b, c], [a, c, d]]);
                    } else {
                        mesh.indices.extend([[a, b, d], [b, c, d]]);
                    }
                }
            }
        }
    }
    mesh
}

/// Rays from lattice points outside, along axes and diagonals.
fn lattice_rays(count: usize, n: u32, random: &mut SplitMix64) -> Vec<Ray> {
    let mut rays = Vec::new();
    while rays.len() < count {
        let target = [0; 3].map(|_| (random.unit() * f64::from(n + 1)).floor() as f32);
        let dir = Vec3::from_array([0; 3].map(|_| integer(random, 1)));
        if dir != Vec3::ZERO {
            rays.push(Ray::new(Vec3::from_array(target) - dir * 16.0, dir));
        }
    }
    rays
}

/// The parameters between which the ray is strictly inside the box, from exact small integers.
fn inside_box(ray: &Ray, n: u32) -> Option<(f32, f32)> {
    let (mut from, mut to) = (0f32, f32::INFINITY);
    for axis in 0..3 {
        let (o, d) = (ray.origin[axis], ray.dir[axis]);
        if d == 0.0 {
            if o <= 0.0 || o >= n as f32 {
                return None;
            }
        } else {
            let (a, b) = (-o / d, (n as f32 - o) / d);
            (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
        }
    }
    (from < to).then_some((from, to))
}

#[test]
fn all_hits_are_in_order_and_each_crossing_counts_once() {
    const N: u32 = 4;
    let mesh = lattice_box(N);
    let mut random = SplitMix64::new(5);
    let rays = lattice_rays(4000, N, &mut random);
    let through = rays.iter().filter(|r| inside_box(r, N).is_some()).count();
    assert!(through > 1000, "{through} rays pass through the box");
    let mut reference: Option<Vec<Vec<_>>> = None;
    for options in all_options() {
        let world = world(&mesh, &options);
        let mut found = Vec::new();
        for ray in &rays {
            let hits = world.all_hits(ray, 100).unwrap();
            assert!(hits.is_sorted_by(|a, b| a.t <= b.t), "{options:?} {ray:?}: {hits:?}");
            assert_eq!(world.count_hits(ray), hits.len(), "{options:?} {ray:?}");
            match inside_box(ray, N) {
                Some((from, to)) => {
                    let near = |i: usize, t: f32| (hits[i].t - t).abs() <= 4e-6 * t;
                    let right = hits.len() == 2 && near(0, from) && near(1, to);
                    assert!(right, "{options:?} {ray:?}: {hits:?}, expected {from} and {to}");
                }
                // Along a face, an edge or through a corner: in and out, or not at all.
                None => assert!(hits.len().is_multiple_of(2), "{options:?} {ray:?}: {hits:?}"),
            }
            found.push(hits.into_iter().map(|h| bits(Some(h))).collect());
        }
        match &reference {
            None => reference = Some(found),
            Some(first) => assert!(*first == found, "{options:?} differs from the first options"),
        }
    }
}

/// The rule of `all_hits` for every triangle, in f64: exact for small integers and directions whose
/// largest component is a power of two. Triangles and distances, in order.
fn exact_crossings(mesh: &TriMesh, ray: &Ray) -> Vec<(f64, u32)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let m = d.abs();
    let z = if m.x >= m.y && m.x >= m.z { 0 } else { 1 + usize::from(m.z > m.y) };
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let side = |p: DVec3, q: DVec3| {
        let e = p.x * q.y - p.y * q.x;
        let terms = [e, p.y - q.y, q.x - p.x];
        terms.into_iter().find(|t| *t != 0.0).map(|t| t > 0.0)
    };
    let mut found = Vec::new();
    for i in 0..mesh.num_triangles() {
        let [a, b, c] = mesh.triangle(i).map(|p| {
            let p = p.as_dvec3() - o;
            DVec3::new(p[x] - d[x] / d[z] * p[z], p[y] - d[y] / d[z] * p[z], p[z] / d[z])
        });
        let sides = [side(c, b), side(a, c), side(b, a)];
        let inside = sides[0].is_some() && sides.iter().all(|s| *s == sides[0]);
        let e = |p: DVec3, q: DVec3| p.x * q.y - p.y * q.x;
        let (u, v, w) = (e(c, b), e(a, c), e(b, a));
        let t = (u * a.z + v * b.z + w * c.z) / (u + v + w);
        if inside && t >= 0.0 {
            found.push((t, i as u32));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    found
}

#[test]
fn all_hits_of_lattice_soups_are_those_of_exact_arithmetic() {
    let mut random = SplitMix64::new(77);
    for round in 0..12 {
        let point = |random: &mut SplitMix64| Vec3::from_array([0; 3].map(|_| integer(random, 4)));
        let mut mesh = TriMesh::default();
        mesh.positions.extend((0..40).map(|_| point(&mut random)));
        for _ in 0..80 {
            mesh.indices.push([0; 3].map(|_| (random.unit() * 40.0) as u32));
        }
        let rays: Vec<Ray> = (0..300)
            .map(|k| {
                let long = [1.0, 2.0, 4.0][k % 3];
                let mut dir = Vec3::from_array([0; 3].map(|_| integer(&mut random, long as i32)));
                dir[k / 3 % 3] = if k.is_multiple_of(2) { long } else { -long };
                Ray::new(point(&mut random) - dir * 16.0, dir)
            })
            .collect();
        let expected: Vec<_> = rays.iter().map(|r| exact_crossings(&mesh, r)).collect();
        assert!(expected.iter().filter(|e| e.len() > 1).count() > 50, "round {round}");
        for options in some_options() {
            let world = world(&mesh, &options);
            for (ray, e) in rays.iter().zip(&expected) {
                let mut hits = world.all_hits(ray, 1000).unwrap();
                // Distances that agree in exact arithmetic may differ by their rounding.
                let what = format!("round {round}, {options:?}, {ray:?}");
                assert_eq!(hits.len(), e.len(), "{what}: {hits:?}, expected {e:?}");
                for (h, (t, _)) in hits.iter().zip(e) {
                    assert!((f64::from(h.t) - t).abs() <= 4e-6 * t, "{what}: {h:?} is not {t}");
                }
                let mut prims: Vec<u32> = e.iter().map(|e| e.1).collect();
                hits.sort_by_key(|h| h.prim);
                prims.sort_unstable();
                assert!(hits.iter().map(|h| h.prim).eq(prims), "{what}");
            }
        }
    }
}

#[test]
fn the_first_of_all_hits_is_the_closest() {
    let (positions, indices) = icosphere(3);
    let mesh = TriMesh::new(positions.iter().map(|p| p.as_vec3()).collect(), indices);
    let mut random = SplitMix64::new(3);
    for options in all_options().into_iter().filter(|o| o.robustness == Robustness::Watertight) {
        let world = world(&mesh, &options);
        let mut hit = 0;
        for _ in 0..500 {
            let origin = (random.direction() * 3.0).as_vec3();
            let ray = Ray::new(origin, (random.direction() * 0.9).as_vec3() - origin);
            let all = world.all_hits(&ray, 10).unwrap();
            assert_eq!(
                bits(all.first().copied()),
                bits(world.closest(&ray)),
                "{options:?} {ray:?}"
            );
            hit += all.len();
        }
        assert!(hit > 600, "{hit} hits");
    }
}

#[test]
fn inside_is_parity_for_closed_meshes() {
    let (positions, indices) = icosphere(2);
    let ball = |center: Vec3, radius: f32| {
        let place = |p: &DVec3| p.as_vec3() * radius + center;
        TriMesh::new(positions.iter().map(place).collect(), indices.clone())
    };
    // Two that overlap and one inside the first share a tree; the box is instanced twice, turned.
    let centers = [(Vec3::ZERO, 1.0), (Vec3::X, 0.75), (Vec3::new(-0.2, 0.1, 0.0), 0.4)];
    let mut geometries: Vec<Geometry> =
        centers.iter().map(|&(c, r)| Geometry::Mesh(Arc::new(ball(c, r)))).collect();
    geometries.push(Geometry::Mesh(Arc::new(lattice_box(2))));
    let moved = [-4.0, 4.0].map(|x| {
        DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)) * DAffine3::from_rotation_z(0.3)
    });
    let place = |geometry, world_from_object| Instance { geometry, world_from_object };
    let mut instances: Vec<Instance> = (0..3).map(|g| place(g, DAffine3::IDENTITY)).collect();
    instances.extend(moved.map(|m| place(3, m)));
    for options in some_options() {
        let world = World::build(geometries.clone(), instances.clone(), &options).unwrap();
        let mut random = SplitMix64::new(8);
        let (mut inside, mut checked) = (0, 0);
        for _ in 0..4000 {
            let unit = [0; 3].map(|_| random.between(-1.0, 1.0));
            let p = DVec3::from_array(unit) * DVec3::new(6.5, 1.5, 1.5);
            let mut expected = Vec::new();
            let mut doubtful = false;
            for (i, &(c, r)) in centers.iter().enumerate() {
                let d = (p - c.as_dvec3()).length() / f64::from(r);
                // Between the sphere and the planes of its triangles.
                doubtful |= (0.95..1.001).contains(&d);
                expected.extend((d < 1.0).then_some(i as u32));
            }
            for (i, m) in moved.iter().enumerate() {
                let q = m.inverse().transform_point3(p);
                let depth = q.min_element().min(2.0 - q.max_element());
                doubtful |= depth.abs() < 1e-4;
                expected.extend((depth > 0.0).then_some(3 + i as u32));
            }
            if !doubtful {
                let found = world.instances_around(world.render_from_world(p));
                assert_eq!(found, expected, "{options:?}: {p}");
                inside += usize::from(!found.is_empty());
                checked += 1;
            }
        }
        assert!(inside > 300 && checked > 2000, "{inside} of {checked} points are inside");
    }
}

#[test]
fn lists_of_blocks_are_those_of_single_rays_and_respect_their_limit() {
    let world = world(&lattice_box(3), &BuildOptions::default());
    let rays = lattice_rays(100, 3, &mut SplitMix64::new(2));
    let mut blocks = RayBlock::from_rays(&rays);
    blocks[1].t_max[5] = -1.0;
    let lists = world.all_hits_of_blocks(&blocks, 10_000).unwrap();
    assert_eq!(lists.num_rays(), blocks.len() * LANES);
    let mut total = 0;
    for i in 0..lists.num_rays() {
        let ray = blocks[i / LANES].get(i % LANES);
        let expected = world.all_hits(&ray, 100).unwrap();
        assert_eq!(lists.of_ray(i), expected, "ray {i}");
        assert_eq!(lists.starts()[i], total);
        total += expected.len();
    }
    assert!(lists.of_ray(LANES + 5).is_empty(), "an idle lane");
    assert_eq!((lists.hits().len(), lists.of_ray(usize::MAX - 1)), (total, &[][..]));
    // The limit is the number that is allowed.
    assert!(world.all_hits_of_blocks(&blocks, total).is_ok());
    let error = world.all_hits_of_blocks(&blocks, total - 1).unwrap_err();
    assert_eq!(error.limit, total - 1);
    assert!(error.to_string().contains("count_hits"), "{error}");
    let through = rays.iter().find(|r| world.count_hits(r) == 2).unwrap();
    assert_eq!(world.all_hits(through, 1), Err(TooManyHits { ray: 0, limit: 1 }));
    assert_eq!(world.all_hits(through, 2).unwrap().len(), 2);
}

/// Worlds of one mesh, of several that share a tree, of instances, and of shapes.
fn worlds(options: &BuildOptions) -> Vec<(&'static str, World)> {
    let (positions, indices) = icosphere(2);
    let ball = |center: Vec3, radius: f32| {
        let place = |p: &DVec3| p.as_vec3() * radius + center;
        Geometry::Mesh(Arc::new(TriMesh::new(
            positions.iter().map(place).collect(),
            indices.clone(),
        )))
    };
    let balls = [ball(Vec3::splat(1.5), 1.4), ball(Vec3::ONE, 1.0), ball(Vec3::splat(2.0), 0.3)];
    let spheres = Spheres::new(vec![Vec3::ONE, Vec3::splat(2.0)], Radii::Common(1.0)).unwrap();
    let of = |geometries: &[Geometry], places: &[(usize, DAffine3)]| {
        let place = |&(geometry, world_from_object)| Instance { geometry, world_from_object };
        let instances = places.iter().map(place).collect();
        World::build(geometries.to_vec(), instances, options).unwrap()
    };
    let here = DAffine3::IDENTITY;
    let turned = DAffine3::from_translation(DVec3::X) * DAffine3::from_rotation_z(0.3);
    let shapes = [Geometry::Shape(Arc::new(spheres))];
    vec![
        ("one mesh", world(&lattice_box(3), options)),
        ("three meshes", of(&balls, &[(0, here), (1, here), (2, here)])),
        ("instances", of(&balls, &[(0, here), (1, turned), (1, here)])),
        ("one turned", of(&balls[..1], &[(0, turned)])),
        ("spheres", of(&shapes, &[(0, here)])),
    ]
}

#[test]
fn rays_in_turns_have_all_hits_of_single_rays_in_any_world() {
    let mut random = SplitMix64::new(31);
    let mut rays = lattice_rays(300, 3, &mut random);
    for _ in 0..300 {
        let origin = (random.direction() * 6.0).as_vec3();
        let target = Vec3::from_array([0; 3].map(|_| random.between(0.0, 3.0) as f32));
        rays.push(Ray::new(origin, target - origin));
    }
    // A block each of directions of unusual lengths, of rays from far away, and of short ranges.
    for ray in &rays.clone()[290..306] {
        rays.push(Ray { dir: ray.dir * 1e-30, ..*ray });
    }
    for ray in &rays.clone()[290..306] {
        rays.push(Ray { origin: ray.origin - ray.dir * 1e6, ..*ray });
    }
    for ray in &rays.clone()[290..306] {
        rays.push(Ray { t_min: 0.7, ..ray.with_t_max(1.1) });
    }
    let mut blocks = RayBlock::from_rays(&rays);
    (blocks[3].t_max[5], blocks[3].ox[6], blocks[3].dz[7]) = (-1.0, f32::NAN, f32::INFINITY);
    for options in all_options() {
        for (name, world) in worlds(&options) {
            let lists = world.all_hits_of_blocks(&blocks, 1_000_000).unwrap();
            let mut counts = vec![[9; LANES]; blocks.len()];
            world.count_hits_of_blocks(&blocks, &mut counts).unwrap();
            let mut ends = Vec::new();
            for i in 0..lists.num_rays() {
                let ray = blocks[i / LANES].get(i % LANES);
                let bits_of = |hits: &[_]| hits.iter().map(|h| bits(Some(*h))).collect::<Vec<_>>();
                let alone = bits_of(&world.all_hits(&ray, 1000).unwrap());
                assert_eq!(bits_of(lists.of_ray(i)), alone, "{name}, {options:?}: ray {i}");
                assert_eq!(counts[i / LANES][i % LANES] as usize, alone.len(), "{name}: ray {i}");
                ends.push(lists.starts()[i + 1]);
            }
            assert!(lists.hits().len() > 200, "{name}: {} hits", lists.hits().len());
            // The ray at which there is no more room is the first, in the order of the call.
            for limit in [0, 1, ends[300], lists.hits().len() - 1] {
                let ray = ends.iter().position(|end| *end > limit).unwrap();
                let error = world.all_hits_of_blocks(&blocks, limit);
                assert_eq!(error, Err(TooManyHits { ray, limit }), "{name}, {options:?}");
            }
        }
    }
    let world = world(&lattice_box(3), &BuildOptions::default());
    assert!(world.count_hits_of_blocks(&blocks, &mut [[0; LANES]]).is_err());
}

#[test]
fn many_points_are_enclosed_where_single_points_are() {
    let mut random = SplitMix64::new(12);
    let point = |_| Vec3::from_array([0; 3].map(|_| random.between(-0.5, 3.5) as f32));
    let mut points: Vec<Vec3> = (0..700).map(point).collect();
    points.extend([Vec3::NAN, Vec3::splat(1e30)]);
    for options in some_options() {
        for (name, world) in worlds(&options) {
            let mut inside = vec![true; points.len()];
            world.encloses(&points, &mut inside).unwrap();
            let alone = points.iter().map(|p| !world.instances_around(*p).is_empty());
            assert!(inside.iter().copied().eq(alone), "{name}, {options:?}");
            let count = inside.iter().filter(|i| **i).count();
            assert!((20..690).contains(&count), "{name}: {count} points are inside");
            assert!(world.encloses(&points, &mut [false]).is_err());
        }
    }
}

#[test]
fn spheres_are_entered_and_left() {
    let spheres = Spheres::new(vec![Vec3::ZERO, Vec3::X * 4.0], Radii::Common(1.0)).unwrap();
    let instance = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let geometries = vec![Geometry::Shape(Arc::new(spheres))];
    let world = World::build(geometries, vec![instance], &BuildOptions::default()).unwrap();
    let ray = Ray::new(Vec3::new(-5.0, 0.1, 0.2), Vec3::X);
    let hits = world.all_hits(&ray, 10).unwrap();
    assert_eq!(hits.iter().map(|h| h.prim).collect::<Vec<_>>(), [0, 0, 1, 1]);
    let half = (1.0f32 - 0.05).sqrt();
    for (h, t) in hits.iter().zip([5.0 - half, 5.0 + half, 9.0 - half, 9.0 + half]) {
        assert!((h.t - t).abs() < 1e-5, "{h:?} is not {t}");
    }
    assert_eq!(world.count_hits(&ray.with_t_max(6.5)), 2);
    assert_eq!(world.instances_around(Vec3::new(0.1, 0.0, 0.0)), [0]);
    assert!(world.instances_around(Vec3::new(2.0, 0.0, 0.0)).is_empty());
}
