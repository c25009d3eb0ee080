//! Rays among triangles in f64, against rational numbers.

use crate::common::{icosphere, some_options};
use crate::exact_oracle::check;
use rt_core::bvh::{
    BuildOptions, BuildQuality, HitF64, MeshF64, RayF64, Robustness, Storage, WorldF64,
};
use rt_core::glam::DVec3;
use rt_core::math::SplitMix64;
use rt_core::simd::SimdLevel;
use std::sync::Arc;

/// A point of a UTM zone, in metres.
const UTM: DVec3 = DVec3::new(500_123.456, 5_400_789.012, 312.345);

fn world(mesh: &MeshF64, options: &BuildOptions) -> WorldF64 {
    WorldF64::from_mesh(mesh.clone(), options).expect("a usable mesh")
}

/// Hits of single rays; checks that rays together have the same bits, and that occlusion agrees.
fn hits_all_ways(world: &WorldF64, rays: &[RayF64], what: &str) -> Vec<Option<HitF64>> {
    let single: Vec<Option<HitF64>> = rays.iter().map(|r| world.closest(r)).collect();
    let mut together = vec![None; rays.len()];
    world.closest_of_rays(rays, &mut together).expect("one each");
    let mut blocked = vec![false; rays.len()];
    world.occluded_of_rays(rays, &mut blocked).expect("one each");
    for (i, ray) in rays.iter().enumerate() {
        assert_eq!(bits(together[i]), bits(single[i]), "{what}: {ray:?}");
        assert_eq!(world.occluded(ray), single[i].is_some(), "{what}: {ray:?}: {:?}", single[i]);
        assert_eq!(blocked[i], single[i].is_some(), "{what}: {ray:?}");
    }
    single
}

fn bits(hit: Option<HitF64>) -> Option<[u64; 5]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim.into(), h.mesh.into()])
}

/// A height field of `n` by `n` squares, each `size` wide and split in two.
fn ground(n: u32, size: f64, corner: DVec3, seed: u64) -> MeshF64 {
    let mut r = SplitMix64::new(seed);
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let mut positions = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            let p = DVec3::new(f64::from(i), f64::from(j), 0.7 * r.unit());
            positions.push(corner + p * size);
        }
    }
    let quads = (0..n * n).flat_map(|q| {
        let (i, j) = (q / n, q % n);
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        [[a, b, c], [a, c, d]]
    });
    MeshF64::new(positions, quads.collect())
}

/// Triangles of many shapes around zero, slivers among them.
fn soup(n: u32, seed: u64) -> MeshF64 {
    let mut r = SplitMix64::new(seed);
    let mut mesh = MeshF64::default();
    for i in 0..n {
        let a = r.direction() * r.unit();
        let (b, c) = (a + r.direction() * r.unit(), a + r.direction() * r.unit());
        let c = match i % 4 {
            0 => c,
            // As thin as 10⁻¹ to 10⁻¹³.
            1 => a + (b - a) * r.unit() + r.direction() * 10f64.powf(-1.0 - 12.0 * r.unit()),
            2 => a + (c - a) * 0.05,
            _ => DVec3::new(c.x, c.y, a.z),
        };
        mesh.positions.extend([a, b, c]);
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

fn moved(mesh: &MeshF64, f: impl Fn(DVec3) -> DVec3) -> MeshF64 {
    MeshF64 { positions: mesh.positions.iter().map(|p| f(*p)).collect(), ..mesh.clone() }
}

/// A point of a random triangle, often on an edge or at a corner.
fn target(mesh: &MeshF64, r: &mut SplitMix64) -> DVec3 {
    let [a, b, c] = mesh
        .triangle((r.bits() % mesh.indices.len() as u64) as usize)
        .expect("all triangles are sound");
    match r.bits() % 4 {
        0 => a,
        1 => a + (b - a) * r.unit(),
        _ => {
            let (u, v) = (r.unit(), r.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            a + (b - a) * u + (c - a) * v
        }
    }
}

/// Rays at points of the mesh from `near` to `far` away, some of limited range.
fn rays_at(mesh: &MeshF64, n: usize, [near, far]: [f64; 2], seed: u64) -> Vec<RayF64> {
    let mut r = SplitMix64::new(seed);
    (0..n)
        .map(|i| {
            let at = target(mesh, &mut r);
            let away = near * (far / near).powf(r.unit());
            let origin = match i % 5 {
                0 => at + DVec3::Z * away,
                _ => at + r.direction() * away,
            };
            let ray = RayF64::new(origin, (at - origin) * (0.5 + r.unit()));
            match i % 7 {
                1 => RayF64 { t_min: r.unit(), ..ray },
                2 => ray.with_t_max(2.0 * r.unit()),
                3 => RayF64 { t_min: -2.0, ..ray },
                _ => ray,
            }
        })
        .collect()
}

/// Compares the world's hits with exact ones; returns how many there are and the largest error.
fn compare(mesh: &MeshF64, options: &BuildOptions, rays: &[RayF64], what: &str) -> (usize, f64) {
    let what = format!("{what}, {options:?}");
    let found = hits_all_ways(&world(mesh, options), rays, &what);
    let (mut hits, mut worst) = (0, 0f64);
    for (ray, found) in rays.iter().zip(found) {
        if let Some(ulps) = check(&[mesh], ray, found, &what) {
            (hits, worst) = (hits + 1, worst.max(ulps));
        }
    }
    (hits, worst)
}

/// Rays in groups of sixteen with origins close together, as those of ambient occlusion: half of
/// them at points of the mesh, half in any direction. `size` is about the mesh's.
fn rays_from_common_places(mesh: &MeshF64, groups: usize, size: f64, seed: u64) -> Vec<RayF64> {
    let mut r = SplitMix64::new(seed);
    let mut rays = Vec::with_capacity(16 * groups);
    for group in 0..groups {
        let away = size * 10f64.powf(-6.0 + 5.0 * r.unit());
        let place = target(mesh, &mut r) + r.direction() * away;
        for lane in 0..16 {
            // In every third group all rays start at the same point.
            let apart = if group % 3 == 0 { 0.0 } else { 0.01 * away };
            let origin = place + r.direction() * apart;
            let direction = match lane % 2 {
                0 => (target(mesh, &mut r) - origin) * (0.5 + r.unit()),
                _ => r.direction() * size,
            };
            let ray = RayF64::new(origin, direction);
            rays.push(match lane % 5 {
                1 => ray.with_t_max(r.unit()),
                2 => RayF64 { t_min: 0.1 * r.unit(), ..ray },
                _ => ray,
            });
        }
    }
    rays
}

#[test]
fn f64_rays_that_start_close_together_have_exact_hits() {
    let sphere = icosphere(2);
    let sphere = MeshF64::new(sphere.0, sphere.1);
    let cases = [
        ("soup", soup(150, 23), 1.0),
        ("terrain in a UTM zone", ground(9, 1e3, UTM, 29), 1e4),
        ("a closed sphere", moved(&sphere, |p| UTM * 1e-3 + p * 0.01), 0.01),
    ];
    for (i, (name, mesh, size)) in cases.iter().enumerate() {
        let rays = rays_from_common_places(mesh, 12, *size, i as u64);
        for options in some_options() {
            let (hits, _) = compare(mesh, &options, &rays, name);
            assert!(hits > 60, "{name}: only {hits} hits");
        }
    }
}

#[test]
fn f64_far_from_the_origin() {
    let micrometres = icosphere(1);
    let micrometres = MeshF64::new(micrometres.0, micrometres.1);
    let part = DVec3::new(1.234_567, -0.765_432, 0.1);
    let cases = [
        ("millimetres of terrain in a UTM zone", ground(8, 1e-3, UTM, 1), [1e-2, 1e6]),
        ("kilometres of terrain in a UTM zone", ground(8, 1e3, UTM, 2), [1.0, 1e7]),
        ("soup in a UTM zone", moved(&soup(120, 3), |p| UTM + p), [1e-3, 1e5]),
        ("micrometres in metres", moved(&micrometres, |p| part + p * 1e-6), [1e-9, 1e3]),
        // Triangles of a few hundred ulp.
        ("nanometres on the Earth's surface", ground(4, 1e-7, UTM, 4), [1e-6, 1e9]),
    ];
    let all = some_options();
    for (i, (name, mesh, away)) in cases.into_iter().enumerate() {
        let rays = rays_at(&mesh, 400, away, i as u64);
        let options = &all[i % all.len()];
        let (hits, worst) = compare(&mesh, options, &rays, name);
        println!("{name}: {hits} of {} rays hit, errors up to {worst} ulp", rays.len());
        assert!(hits > 150, "{name}: only {hits} hits");
    }
}

#[test]
fn hits_in_f64_are_exact_at_every_scale() {
    let one = soup(60, 7);
    let all = some_options();
    for (i, scale) in [1e-150, 1e-100, 1e-30, 1e-6, 1.0, 1e6, 1e30, 1e100, 1e150].iter().enumerate()
    {
        let mesh = moved(&one, |p| p * *scale);
        let rays = rays_at(&mesh, 150, [scale * 1e-3, scale * 1e3], i as u64);
        let (hits, _) = compare(&mesh, &all[i % all.len()], &rays, &format!("scale {scale:e}"));
        assert!(hits > 60, "scale {scale:e}: only {hits} hits");
    }
}

#[test]
fn rays_in_f64_start_anywhere() {
    let mesh = soup(40, 11);
    let mut rays = rays_at(&mesh, 100, [1e10, 1e25], 1);
    rays.extend(rays_at(&mesh, 60, [1e-18, 1e-12], 2));
    // The directions of f64 that f32 does not have.
    let tiny = rays_at(&mesh, 60, [0.1, 10.0], 3);
    for (i, ray) in tiny.into_iter().enumerate() {
        let k = [-1060.0, -600.0, -140.0, 130.0, 600.0, 1000.0][i % 6];
        rays.push(RayF64 { dir: ray.dir * f64::exp2(k), t_min: 0.0, t_max: f64::INFINITY, ..ray });
    }
    // Components that are no normal numbers.
    for (i, ray) in rays_at(&mesh, 40, [0.1, 10.0], 4).into_iter().enumerate() {
        let mut ray = RayF64 { t_min: 0.0, ..ray };
        ray.dir[i % 3] *= [1e-310, 1e-320, -0.0][i / 3 % 3];
        rays.push(ray);
    }
    let (hits, worst) = compare(&mesh, &BuildOptions::default(), &rays, "far and odd rays");
    println!("{hits} hits, errors up to {worst} ulp");
    assert!(hits > 40, "only {hits} hits");
}

#[test]
fn rays_in_f64_along_axes_meet_the_corners_of_grids() {
    // Heights are multiples of 1/64, so every vertical ray through a vertex is exactly on it.
    let mesh = moved(&ground(6, 1.0, DVec3::new(5e5, 5.4e6, 300.0), 5), |p| {
        DVec3::new(p.x, p.y, (p.z * 64.0).round() / 64.0)
    });
    let mut rays = Vec::new();
    for p in &mesh.positions {
        for (dx, dy) in [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5), (0.25, 0.5)] {
            rays.push(RayF64::new(*p + DVec3::new(dx, dy, 1000.0), DVec3::NEG_Z * 0.5));
            rays.push(RayF64::new(*p + DVec3::new(dx, -900.0, dy), DVec3::Y));
        }
    }
    let (hits, _) = compare(&mesh, &BuildOptions::default(), &rays, "grid");
    assert!(hits > 200, "only {hits} hits");
}

#[test]
fn closed_meshes_in_f64_never_leak() {
    let (positions, indices) = icosphere(4);
    let ball = MeshF64::new(positions, indices);
    let mut r = SplitMix64::new(13);
    let (mut rays, mut lost) = (0, 0);
    for (radius, n) in [(1e-4, 20_000), (10.0, 60_000), (1e5, 20_000)] {
        let mesh = moved(&ball, |p| UTM + p * radius);
        let world = world(&mesh, &BuildOptions::default());
        let inside: Vec<RayF64> = (0..n)
            .map(|i| {
                let origin = UTM + r.direction() * (0.7 * radius * r.unit());
                let corners = mesh.triangle((r.bits() % 5120) as usize).expect("sound");
                let [a, b, _] = corners;
                let at = if i % 3 == 0 { a } else { a + (b - a) * r.unit() };
                RayF64::new(origin, at - origin)
            })
            .collect();
        let mut hits = vec![None; inside.len()];
        let mut blocked = vec![false; inside.len()];
        world.closest_of_rays(&inside, &mut hits).expect("one each");
        world.occluded_of_rays(&inside, &mut blocked).expect("one each");
        rays += inside.len();
        lost += hits.iter().filter(|h| h.is_none()).count();
        lost += blocked.iter().filter(|b| !**b).count();
    }
    println!("{lost} of {rays} rays leaked");
    assert_eq!((rays, lost), (100_000, 0));
}

#[test]
fn presets_and_instruction_sets_have_the_same_bits_in_f64() {
    let mesh = moved(&soup(400, 17), |p| UTM + p * 3.0);
    let rays = rays_at(&mesh, 300, [1e-3, 1e4], 5);
    let mut first: Option<Vec<_>> = None;
    for quality in BuildQuality::ALL {
        for simd in SimdLevel::available() {
            let options = BuildOptions { quality, simd: Some(simd), ..Default::default() };
            let what = format!("{options:?}");
            let hits = hits_all_ways(&world(&mesh, &options), &rays, &what);
            let hits: Vec<_> = hits.into_iter().map(bits).collect();
            assert!(hits.iter().flatten().count() > 200, "{what}");
            assert_eq!(first.get_or_insert_with(|| hits.clone()), &hits, "{what}");
        }
    }
}

#[test]
fn coincident_layers_in_f64_give_the_lowest_mesh_and_triangle() {
    let one = ground(4, 1.0, UTM, 19);
    // The same triangles with their corners turned, twice in each mesh, and one cut differently.
    let mut twice = MeshF64::new(one.positions.clone(), Vec::new());
    for &[a, b, c] in &one.indices {
        twice.indices.extend([[b, c, a], [c, b, a]]);
    }
    let meshes = [Arc::new(MeshF64::default()), Arc::new(twice.clone()), Arc::new(twice)];
    let world = WorldF64::build(meshes.to_vec(), &BuildOptions::default()).expect("sound meshes");
    let rays = rays_at(&one, 200, [0.1, 1e3], 21);
    let found = hits_all_ways(&world, &rays, "layers");
    let borrowed: Vec<&MeshF64> = meshes.iter().map(|m| &**m).collect();
    for (ray, hit) in rays.iter().zip(found) {
        check(&borrowed, ray, hit, "layers");
        assert!(hit.is_none_or(|h| h.mesh == 1 && h.prim % 2 == 0), "{hit:?}");
    }
}

#[test]
fn ranges_in_f64_end_exactly() {
    let corners =
        vec![DVec3::new(-9.0, -9.0, 0.1), DVec3::new(9.0, -9.0, 0.1), DVec3::new(0.0, 9.0, 0.1)];
    let world = world(&MeshF64::new(corners, vec![[0, 1, 2]]), &BuildOptions::default());
    let mut r = SplitMix64::new(23);
    let mut between = 0;
    for _ in 0..300 {
        let origin = DVec3::new(r.unit(), r.unit(), 3.0 + r.unit());
        let ray = RayF64::new(origin, r.direction() * 0.3 + DVec3::NEG_Z);
        let Some(hit) = world.closest(&ray) else { continue };
        let (below, above) = (hit.t.next_down().next_down(), hit.t.next_up().next_up());
        assert!(world.occluded(&RayF64 { t_min: below, t_max: above, ..ray }), "{ray:?}");
        assert!(!world.occluded(&RayF64 { t_min: above.next_up(), ..ray }), "{ray:?}");
        assert!(!world.occluded(&ray.with_t_max(below)), "{ray:?}");
        // The exact parameter lies on one side of the rounded one, or is equal to it.
        let before = world.occluded(&ray.with_t_max(hit.t));
        let after = world.occluded(&RayF64 { t_min: hit.t, ..ray });
        assert!(before != after, "{ray:?}: {hit:?}");
        between += usize::from(before);
    }
    assert!(between > 50, "exact values lie on both sides of rounded ones: {between}");
    // Exactly at the start of the range: inside, and exactly at its end: outside.
    let down = RayF64::new(DVec3::new(0.0, 0.0, 0.1), DVec3::NEG_Z);
    assert_eq!(world.closest(&down).map(|h| h.t), Some(0.0));
    let up = RayF64 { t_min: -1.0, t_max: 0.0, ..down };
    assert_eq!(world.closest(&up), None);
}

#[test]
fn triangles_in_f64_that_cannot_be_hit_are_counted() {
    let good = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut positions = good.to_vec();
    positions.extend([DVec3::NAN, DVec3::splat(f64::INFINITY), DVec3::Z]);
    let indices = vec![[0, 1, 3], [0, 4, 1], [0, 1, 99], [0, 1, 2], [1, 1, 1], [0, 1, 0]];
    let mesh = MeshF64::new(positions, indices);
    for options in some_options() {
        let world = world(&mesh, &options);
        let report = world.report();
        assert_eq!((report.primitives, report.skipped), (3, 3), "{options:?}");
        assert_eq!(world.bounds(), Some((DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0))));
        let fast = options.robustness == Robustness::Fast;
        assert_eq!(report.notes.iter().any(|n| n.contains("robustness")), fast, "{report:?}");
        let compact = options.storage == Storage::Compact;
        assert_eq!(report.notes.iter().any(|n| n.contains("storage")), compact, "{report:?}");
        let mut rays = vec![
            RayF64::new(DVec3::new(0.25, 0.25, 3.0), DVec3::NEG_Z),
            RayF64::new(DVec3::new(-1.0, 0.0, 0.0), DVec3::X),
            RayF64::new(DVec3::new(0.25, 0.25, f64::NAN), DVec3::NEG_Z),
            RayF64::new(DVec3::new(0.25, 0.25, 3.0), DVec3::ZERO),
            RayF64::new(DVec3::new(0.25, 0.25, 3.0), DVec3::NEG_Z * f64::INFINITY),
        ];
        rays.push(rays[0].with_t_max(f64::NAN));
        rays.push(RayF64 { t_min: 5.0, t_max: 1.0, ..rays[0] });
        let hits = hits_all_ways(&world, &rays, "odd rays");
        assert_eq!(hits[0].map(|h| (h.prim, h.t)), Some((3, 3.0)), "{options:?}");
        assert!(hits[1..].iter().all(Option::is_none), "{options:?}: {hits:?}");
    }
    let empty = world(&MeshF64::default(), &BuildOptions::default());
    assert_eq!(empty.bounds(), None);
    assert_eq!(empty.closest(&RayF64::new(DVec3::ZERO, DVec3::X)), None);
    assert!(!empty.occluded(&RayF64::new(DVec3::ZERO, DVec3::X)));
}

#[test]
fn slices_of_rays_in_f64_have_one_answer_each() {
    let world = world(&soup(4, 1), &BuildOptions::default());
    let rays = [RayF64::new(DVec3::ZERO, DVec3::X); 3];
    let error = world.closest_of_rays(&rays, &mut [None; 2]).expect_err("too short");
    assert_eq!((error.rays, error.answers), (3, 2));
    let error = world.occluded_of_rays(&rays, &mut [false; 4]).expect_err("too long");
    assert_eq!((error.rays, error.answers), (3, 4));
}

#[test]
fn points_of_hits_in_f64_lie_on_the_surface() {
    let ball = icosphere(3);
    let mesh = moved(&MeshF64::new(ball.0, ball.1), |p| UTM + p * 0.01);
    let world = world(&mesh, &BuildOptions::default());
    let mut hits = 0;
    for ray in rays_at(&mesh, 300, [1.0, 1e6], 29) {
        let Some(hit) = world.closest(&ray) else { continue };
        let p = world.point_of_hit(&hit).expect("of this world");
        let [a, b, c] = mesh.triangle(hit.prim as usize).expect("sound");
        let normal = (b - a).cross(c - a).normalize();
        // The unit of least precision of five million metres.
        let ulp = 2f64.powi(-30);
        assert!((p - a).dot(normal).abs() < 2.0 * ulp, "{ray:?}: {hit:?}");
        let away = p - ray.origin;
        let off = away.cross(ray.dir.normalize()).length();
        assert!(off < 4.0 * ulp + away.length() * 1e-15, "{ray:?}: {hit:?}: {off}");
        hits += 1;
    }
    assert!(hits > 100, "only {hits} hits");
    assert_eq!(world.point_of_hit(&HitF64 { t: 0.0, u: 0.0, v: 0.0, prim: 0, mesh: 7 }), None);
}
