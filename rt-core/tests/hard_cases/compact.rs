//! Compact storage gives the bits of plain storage, for every kind of query. (The other files try
//! it on their cases, too: it is among their options.)

use crate::agreement::{meshes, views};
use crate::common::*;
use rt_core::bvh::{BuildOptions, Geometry, Instance, RefitError, Robustness, Storage, World};
use rt_core::glam::{DAffine3, DQuat, DVec3, Vec3};
use rt_core::mesh::{MeshSlices, TriMesh};
use rt_core::simd::SimdLevel;
use std::sync::Arc;

/// The same world in plain and in compact storage.
fn both(options: BuildOptions, build: impl Fn(&BuildOptions) -> World) -> [World; 2] {
    Storage::ALL.map(|storage| build(&BuildOptions { storage, ..options }))
}

#[test]
fn compact_trees_have_the_hits_of_plain_ones_bit_for_bit_at_every_level() {
    for (mesh_name, mesh) in meshes() {
        for (k, simd) in SimdLevel::available().into_iter().enumerate() {
            let robustness = Robustness::ALL[k % 2];
            let options = BuildOptions { robustness, simd: Some(simd), ..Default::default() };
            let [plain, compact] = both(options, |options| world(&mesh, options));
            let checked = compact.validate().expect("a sound tree");
            assert_eq!(checked.primitives, mesh.indices.len(), "{mesh_name}");
            for (name, rays) in views() {
                let what = format!("{mesh_name}, {name}, {options:?}");
                let of =
                    |w| hits_all_ways(w, &rays, &what).into_iter().map(bits).collect::<Vec<_>>();
                assert!(of(&plain) == of(&compact), "{what}: compact hits differ");
            }
        }
    }
}

#[test]
fn all_hits_and_closest_points_of_compact_trees_are_those_of_plain_ones() {
    for (name, mesh) in meshes() {
        let [plain, compact] = both(BuildOptions::default(), |options| world(&mesh, options));
        for ray in inward_rays(300, 5) {
            let of = |w: &World| {
                let hits = w.all_hits(&ray, 10_000).expect("fewer");
                hits.into_iter().map(|h| bits(Some(h))).collect::<Vec<_>>()
            };
            assert_eq!(of(&plain), of(&compact), "{name}: {ray:?}");
            let even = |w: &World| {
                let accept = |h: &rt_core::ray::Hit| h.prim.is_multiple_of(2);
                bits(w.query().accepting(&accept).closest(&ray))
            };
            assert_eq!(even(&plain), even(&compact), "{name}: {ray:?}");
            let near = |w: &World| w.closest_point(ray.origin, f32::INFINITY).expect("a mesh");
            assert_eq!(near(&plain), near(&compact), "{name}: {:?}", ray.origin);
        }
    }
}

/// Rays of occlusion expand leaves without the numbers of their triangles, and threads keep them.
#[test]
fn triangles_that_a_ray_of_occlusion_met_first_keep_their_numbers() {
    for (name, mesh) in meshes() {
        let [plain, compact] = both(BuildOptions::default(), |options| world(&mesh, options));
        for ray in inward_rays(300, 7) {
            assert_eq!(plain.occluded(&ray), compact.occluded(&ray), "{name}: {ray:?}");
            assert_eq!(bits(plain.closest(&ray)), bits(compact.closest(&ray)), "{name}: {ray:?}");
        }
    }
}

/// Instances that overlap, and meshes that would share one plain tree, far from zero and near it.
#[test]
fn instances_and_several_compact_meshes_have_the_hits_of_plain_ones() {
    for far in [0.0, 1e5] {
        let shift = DVec3::new(far, -far, 0.5 * far);
        let parts: Vec<Geometry> = [(3, 0.7, 0.0), (2, 0.9, 0.3), (2, 0.5, -0.4)]
            .map(|(level, radius, x)| sphere(level, radius, shift + DVec3::X * x))
            .map(|mesh| Geometry::Mesh(Arc::new(mesh)))
            .to_vec();
        let turned = DAffine3::from_translation(shift)
            * DAffine3::from_scale_rotation_translation(
                DVec3::new(0.5, 1.2, 0.8),
                DQuat::from_rotation_y(0.4),
                DVec3::new(0.2, 0.1, -0.3),
            )
            * DAffine3::from_translation(-shift);
        let here = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
        let placed = Instance { geometry: 2, world_from_object: turned };
        for instances in [vec![here(0), here(1), here(2)], vec![here(0), here(1), here(2), placed]]
        {
            let [plain, compact] = both(BuildOptions::default(), |options| {
                World::build(parts.clone(), instances.clone(), options).expect("sound meshes")
            });
            compact.validate().expect("a sound tree");
            for rays in
                [inward_rays(2000, 3), camera(Vec3::new(0.3, -2.0, 2.9), Vec3::ZERO, 1.2, 2)]
            {
                let of = |w: &World| -> Vec<_> {
                    hits_all_ways(w, &rays, "spheres").into_iter().map(bits).collect()
                };
                assert!(of(&plain) == of(&compact), "{} instances at {far}", instances.len());
            }
        }
    }
}

#[test]
fn compact_trees_do_not_depend_on_the_number_of_threads() {
    let mesh = soup(4000, 3);
    let options = BuildOptions { storage: Storage::Compact, ..Default::default() };
    let bytes = [1, 3].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
        let world = pool.install(|| world(&mesh, &options));
        (world.report().bytes, world.validate().expect("a sound tree"))
    });
    assert_eq!(bytes[0], bytes[1]);
}

#[test]
fn a_refit_of_a_compact_tree_is_refused_by_name() {
    let options = BuildOptions { storage: Storage::Compact, ..Default::default() };
    let mesh = torus(30, 5);
    let mut world = world(&mesh, &options);
    let error = world.refit(0, Arc::new(mesh.clone())).unwrap_err();
    assert_eq!(error, RefitError::Compact { geometry: 0 });
    assert!(error.to_string().contains("Storage::Plain"), "{error}");

    let slices = [MeshSlices::of_mesh(&mesh)];
    let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let mut world = World::from_slices(&slices, vec![placed], &options).expect("a sound mesh");
    let error = world.refit_slices(0, &slices).unwrap_err();
    assert_eq!(error, RefitError::Compact { geometry: 0 });
}

/// More triangles than one piece of a build has, and equal ones that no split can part.
#[test]
fn pieces_of_a_build_lose_no_triangle() {
    let mut mesh = torus(640, 256);
    let all = mesh.indices.len();
    mesh.indices.extend(vec![[0, 1, 2]; 1000]);
    assert!(all > 1 << 18, "{all} triangles are one piece");
    let options = BuildOptions { storage: Storage::Compact, ..Default::default() };
    let [plain, compact] = both(options, |options| world(&mesh, options));
    assert_eq!(compact.validate().expect("a sound tree").primitives, all + 1000);
    for ray in inward_rays(3000, 1) {
        assert_eq!(bits(plain.closest(&ray)), bits(compact.closest(&ray)), "{ray:?}");
    }
}

/// A filter may ask the same world, or another, from inside a query.
#[test]
fn queries_inside_a_filter_do_not_disturb_the_one_around_them() {
    let mesh: TriMesh = soup(500, 2);
    let options = BuildOptions { storage: Storage::Compact, ..Default::default() };
    let [plain, compact] = both(options, |options| world(&mesh, options));
    for ray in inward_rays(200, 9) {
        let accepted = |w: &World| {
            let accept = |h: &rt_core::ray::Hit| {
                let back = rt_core::ray::Ray::new(ray.at(h.t), -ray.dir);
                w.closest(&back).is_none_or(|other| other.prim % 3 != 0)
            };
            bits(w.query().accepting(&accept).closest(&ray))
        };
        assert_eq!(accepted(&plain), accepted(&compact), "{ray:?}");
    }
}
