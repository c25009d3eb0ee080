use super::*;
use crate::bvh::{BuildOptions, BuildQuality, Instance};
use crate::ray::Ray;
use crate::test_shapes::{Random, noise_soup, sphere};
use glam::{DAffine3, DVec3, Vec3};

fn rays(n: usize, seed: u64) -> Vec<Ray> {
    let mut r = Random::new(seed);
    (0..n)
        .map(|_| {
            let o = r.direction() * 4.0;
            Ray::new(o, r.direction() * r.unit() - o)
        })
        .collect()
}

/// Twisted around z, stretched and shaken.
fn moved(mesh: &TriMesh, amount: f32) -> TriMesh {
    let mut r = Random::new(17);
    let mut mesh = mesh.clone();
    for p in &mut mesh.positions {
        let turn = glam::Quat::from_rotation_z(amount * p.z);
        *p = turn * *p * Vec3::new(1.0, 1.0 + 0.3 * amount, 1.0) + r.direction() * 0.02 * amount;
    }
    mesh
}

fn assert_same_hits(a: &World, b: &World, what: &str) {
    let mut hits = 0;
    for ray in rays(3000, 23) {
        let (x, y) = (a.closest(&ray), b.closest(&ray));
        assert_eq!(x, y, "{what}: {ray:?}");
        assert_eq!(a.occluded(&ray), y.is_some(), "{what}: {ray:?}");
        hits += x.is_some() as usize;
    }
    assert!(hits > 300, "{what}: the rays must hit something, {hits}");
}

#[test]
fn refit_equals_rebuild_bit_for_bit_for_every_preset() {
    for mesh in [noise_soup(900, 3), sphere(4)] {
        for quality in BuildQuality::ALL {
            let options = BuildOptions { quality, ..Default::default() };
            let mut world = World::from_mesh(mesh.clone(), &options).expect("valid");
            for amount in [0.1, 1.0] {
                let new = Arc::new(moved(&mesh, amount));
                let report = world.refit(0, new.clone()).expect("the same triangles");
                assert_eq!((report.unusable, report.absent), (0, 0));
                world.validate().unwrap_or_else(|e| panic!("{quality:?}: {e}"));
                let rebuilt = World::from_mesh(new, &options).expect("valid");
                assert_same_hits(&world, &rebuilt, quality.name());
            }
        }
    }
}

#[test]
fn refit_without_a_change_costs_the_same_and_changes_nothing() {
    let mesh = sphere(5);
    let mut world = World::from_mesh(mesh.clone(), &BuildOptions::default()).expect("valid");
    // As bits: triangle numbers read as floats can be NaN.
    let bits = |w: &World| {
        bytemuck::cast_slice::<_, u32>(&w.blas[0].bvh().expect("of its own").units).to_vec()
    };
    let before = bits(&world);
    let report = world.refit(0, Arc::new(mesh)).expect("the same triangles");
    assert!((report.cost_growth - 1.0).abs() < 1e-9, "{report:?}");
    assert!(before == bits(&world));
}

#[test]
fn cost_growth_tells_when_vertices_have_been_shuffled_and_when_they_are_back() {
    let mesh = sphere(4);
    let mut world = World::from_mesh(mesh.clone(), &BuildOptions::default()).expect("valid");
    let mut shuffled = mesh.clone();
    let mut r = Random::new(1);
    for i in (1..shuffled.positions.len()).rev() {
        shuffled.positions.swap(i, (r.bits() % (i as u64 + 1)) as usize);
    }
    let far = world.refit(0, Arc::new(shuffled)).expect("the same triangles").cost_growth;
    assert!(far > 5.0, "triangles all over the sphere: {far}");
    let back = world.refit(0, Arc::new(mesh)).expect("the same triangles").cost_growth;
    assert!((back - 1.0).abs() < 1e-6, "{back}");
}

#[test]
fn a_nan_vertex_hides_its_triangles_until_it_is_finite_again() {
    let mesh = sphere(3);
    let mut world = World::from_mesh(mesh.clone(), &BuildOptions::default()).expect("valid");
    for bad in [f32::NAN, f32::INFINITY] {
        let mut broken = mesh.clone();
        broken.positions[7].y = bad;
        let around = broken.indices.iter().filter(|t| t.contains(&7)).count();
        let broken = Arc::new(broken);
        let report = world.refit(0, broken.clone()).expect("the same triangles");
        assert_eq!((report.unusable, report.absent), (around, 0));
        assert_eq!(world.report().skipped, around);
        world.validate().expect("sound");
        let rebuilt = World::from_mesh(broken, &BuildOptions::default()).expect("valid");
        assert_same_hits(&world, &rebuilt, "one vertex missing");
        assert_eq!(world.refit(0, Arc::new(mesh.clone())).expect("the same triangles").unusable, 0);
        let rebuilt = World::from_mesh(mesh.clone(), &BuildOptions::default()).expect("valid");
        assert_same_hits(&world, &rebuilt, "back again");
    }
    // All vertices gone: an empty world, not a panic.
    let mut none = mesh.clone();
    none.positions.fill(Vec3::NAN);
    let report = world.refit(0, Arc::new(none)).expect("the same triangles");
    assert_eq!(report.unusable, mesh.indices.len());
    assert!(rays(200, 1).iter().all(|r| world.closest(r).is_none()));
    world.refit(0, Arc::new(mesh.clone())).expect("the same triangles");
    let rebuilt = World::from_mesh(mesh, &BuildOptions::default()).expect("valid");
    assert_same_hits(&world, &rebuilt, "after nothing");
}

#[test]
fn triangles_left_out_by_the_build_are_reported_as_absent() {
    let mesh = sphere(2);
    let mut broken = mesh.clone();
    broken.positions[3].x = f32::NAN;
    let around = broken.indices.iter().filter(|t| t.contains(&3)).count();
    let mut world = World::from_mesh(broken, &BuildOptions::default()).expect("valid");
    let report = world.refit(0, Arc::new(mesh)).expect("the same triangles");
    assert_eq!((report.unusable, report.absent), (0, around));
    world.validate().expect("sound");
}

#[test]
fn instances_and_far_away_meshes_follow() {
    let mesh = Arc::new(sphere(3));
    let instances: Vec<Instance> = (0..5)
        .map(|i| Instance {
            geometry: 0,
            world_from_object: DAffine3::from_translation(DVec3::new(
                3.0 * i as f64 - 6.0,
                0.0,
                0.0,
            )),
        })
        .collect();
    let build = |m: &Arc<TriMesh>| {
        World::build(vec![Geometry::Mesh(m.clone())], instances.clone(), &BuildOptions::default())
            .expect("valid")
    };
    let mut world = build(&mesh);
    let mut far = moved(&mesh, 0.7);
    far.origin = DVec3::new(4e6, -1e6, 2.5e5);
    let far = Arc::new(far);
    world.refit(0, far.clone()).expect("the same triangles");
    world.validate().expect("sound");
    let rebuilt = build(&far);
    assert_eq!((world.origin(), world.bounds()), (rebuilt.origin(), rebuilt.bounds()));
    assert_same_hits(&world, &rebuilt, "instances");
}

#[test]
fn other_triangles_are_refused_and_the_world_stays() {
    let mesh = sphere(2);
    let mut world = World::from_mesh(mesh.clone(), &BuildOptions::default()).expect("valid");
    let mut fewer = mesh.clone();
    fewer.indices.pop();
    let mut more = mesh.clone();
    more.positions.push(Vec3::ZERO);
    let mut other = mesh.clone();
    other.indices[5].swap(0, 1);
    let (t, v) = (mesh.indices.len(), mesh.positions.len());
    for (new, geometry, expected) in [
        (
            fewer,
            0,
            RefitError::Topology { geometry: 0, what: "triangles", expected: t, found: t - 1 },
        ),
        (
            more,
            0,
            RefitError::Topology { geometry: 0, what: "vertices", expected: v, found: v + 1 },
        ),
        (other, 0, RefitError::Indices { geometry: 0, triangle: 5 }),
        (mesh.clone(), 1, RefitError::NoSuchGeometry { geometry: 1, count: 1 }),
    ] {
        assert_eq!(world.refit(geometry, Arc::new(new)), Err(expected));
    }
    let rebuilt = World::from_mesh(mesh, &BuildOptions::default()).expect("valid");
    assert_same_hits(&world, &rebuilt, "unchanged");
}
