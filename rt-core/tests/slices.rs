//! Worlds from borrowed arrays: the hits of worlds from meshes, and no copy of the arrays.
#![forbid(unsafe_code)]

use rt_core::bvh::{BuildError, BuildQuality, GlobalLayout, RefitError, Robustness};
use rt_core::glam::DMat3;
use rt_core::mesh::{MeshError, MeshSlices};
use rt_core::prelude::*;
use std::sync::Arc;

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

/// Small triangles in a cube, some of them unusable.
fn soup(triangles: usize, seed: u64) -> TriMesh {
    let mut next = numbers(seed);
    let mut point = |size: f32| Vec3::new(next(), next(), next()) * size;
    let mut positions = Vec::with_capacity(3 * triangles);
    for i in 0..triangles {
        let at = point(1.0);
        positions.extend([at, at + point(0.1), at + point(0.1)]);
        if i % 50 == 7 {
            positions[3 * i].y = f32::NAN;
        }
    }
    let index =
        |i: u32| if i % 60 == 9 { [3 * i, u32::MAX, 0] } else { [3 * i, 3 * i + 1, 3 * i + 2] };
    let origin = DVec3::new(seed as f64 * 0.7, 0.0, 0.0);
    TriMesh { origin, ..TriMesh::new(positions, (0..triangles as u32).map(index).collect()) }
}

/// The arrays of `mesh` with `gap` numbers between the vertices and `before` the first.
fn interleaved(mesh: &TriMesh, gap: usize, before: usize) -> Vec<f32> {
    let mut out = vec![f32::NAN; before];
    for p in &mesh.positions {
        out.extend(p.to_array());
        out.extend(std::iter::repeat_n(f32::NAN, gap));
    }
    out
}

fn rays(n: usize) -> Vec<Ray> {
    let mut next = numbers(99);
    let mut point = move || Vec3::new(3.0 * next() - 0.5, 2.0 * next() - 0.5, 2.0 * next() - 0.5);
    (0..n)
        .map(|_| {
            let origin = point();
            Ray::new(origin, point() - origin)
        })
        .collect()
}

fn once(geometry: usize) -> Instance {
    Instance { geometry, world_from_object: DAffine3::IDENTITY }
}

/// Instances that share a tree, and one that is turned and has a tree of its own.
fn placed() -> Vec<Instance> {
    let turned = DAffine3::from_mat3_translation(DMat3::from_rotation_z(0.5), DVec3::Y * 0.5);
    vec![once(0), once(1), Instance { geometry: 2, world_from_object: turned }]
}

fn bits(hit: Option<Hit>) -> Option<[u32; 5]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim, h.instance])
}

#[track_caller]
fn assert_same_hits(a: &World, b: &World, at_least: usize) {
    assert_eq!(a.origin(), b.origin());
    assert_eq!(a.report().primitives, b.report().primitives);
    assert_eq!(a.report().skipped, b.report().skipped);
    let mut hits = 0;
    for ray in rays(600) {
        assert_eq!(bits(a.closest(&ray)), bits(b.closest(&ray)), "{ray:?}");
        assert_eq!(a.occluded(&ray), b.occluded(&ray), "{ray:?}");
        assert_eq!(a.count_hits(&ray), b.count_hits(&ray), "{ray:?}");
        assert_eq!(
            a.closest_point(ray.origin, f32::INFINITY).ok(),
            b.closest_point(ray.origin, f32::INFINITY).ok()
        );
        hits += usize::from(a.closest(&ray).is_some());
    }
    assert!(hits >= at_least, "{hits} hits");
    b.validate().expect("a sound tree");
}

#[test]
fn worlds_from_slices_have_the_bits_of_worlds_from_meshes() {
    let meshes = [soup(900, 1), soup(700, 2), soup(300, 3)];
    let arrays = [interleaved(&meshes[0], 0, 0), interleaved(&meshes[1], 5, 2)];
    let third = interleaved(&meshes[2], 1, 9);
    let slices = |k: usize, positions, offset, stride| {
        let indices = meshes[k].indices.as_flattened();
        MeshSlices {
            origin: meshes[k].origin,
            offset,
            stride,
            ..MeshSlices::new(positions, indices)
        }
    };
    let slices =
        [slices(0, &arrays[0], 0, 3), slices(1, &arrays[1], 2, 8), slices(2, &third, 9, 4)];
    let geometries: Vec<_> = meshes.iter().map(|m| Geometry::Mesh(Arc::new(m.clone()))).collect();
    for quality in BuildQuality::ALL {
        for robustness in Robustness::ALL {
            let options = BuildOptions { quality, robustness, ..Default::default() };
            let from_meshes = World::build(geometries.clone(), placed(), &options).unwrap();
            let from_slices = World::from_slices(&slices, placed(), &options).unwrap();
            assert!(from_slices.report().skipped > 50);
            assert_same_hits(&from_meshes, &from_slices, 200);
        }
    }
}

#[test]
fn refitting_slices_equals_refitting_the_mesh() {
    let options = BuildOptions::default();
    let mut meshes = [soup(900, 1), soup(700, 2), soup(300, 3)];
    let all = |meshes: &[TriMesh; 3]| -> Vec<Geometry> {
        meshes.iter().map(|m| Geometry::Mesh(Arc::new(m.clone()))).collect()
    };
    let mut a = World::build(all(&meshes), placed(), &options).unwrap();
    let mut b = World::from_slices(&meshes.each_ref().map(MeshSlices::of_mesh), placed(), &options)
        .unwrap();
    // A member of the shared tree, one that becomes invalid in places, one with a tree of its own,
    // and one that moves so far that the shared tree is built again.
    for (step, (geometry, by)) in
        [(0, 0.05), (1, f32::NAN), (2, 0.1), (1, 1e5)].into_iter().enumerate()
    {
        for p in meshes[geometry].positions.iter_mut().step_by(if by.is_nan() { 31 } else { 1 }) {
            p.x += by;
        }
        let old = a.refit(geometry, Arc::new(meshes[geometry].clone())).unwrap();
        let new = b.refit_slices(geometry, &meshes.each_ref().map(MeshSlices::of_mesh)).unwrap();
        assert_eq!((old.unusable, old.absent), (new.unusable, new.absent), "step {step}");
        assert_eq!(old.cost_growth, new.cost_growth, "step {step}");
        assert_same_hits(&a, &b, 100);
    }
}

#[test]
fn other_indices_in_a_refit_neither_panic_nor_lose_triangles() {
    let mesh = soup(500, 4);
    let mut indices = mesh.indices.as_flattened().to_vec();
    let positions = interleaved(&mesh, 0, 0);
    let options = BuildOptions::default();
    let mut world =
        World::from_slices(&[MeshSlices::new(&positions, &indices)], vec![once(0)], &options)
            .unwrap();
    indices.reverse();
    indices[4] = 1_000_000;
    let changed = [MeshSlices::new(&positions, &indices)];
    let report = world.refit_slices(0, &changed).unwrap();
    assert!(report.unusable > 0, "{report:?}");
    let fresh = World::from_slices(&changed, vec![once(0)], &options).unwrap();
    world.validate().expect("a sound tree");
    for ray in rays(300) {
        // Triangles that the first build left out are still missing.
        let (kept, all) = (world.count_hits(&ray), fresh.count_hits(&ray));
        assert!(kept <= all && (report.absent > 0 || kept == all), "{kept} of {all}");
    }
}

#[test]
fn what_slices_cannot_do_is_refused_by_name() {
    let (positions, ids) = ([0.5f32; 9], [0u32, 1, 2, 0]);
    let options = BuildOptions::default();
    let build = |mesh| World::from_slices(&[mesh], vec![once(0)], &options);
    let mesh = MeshSlices::new(&positions, &ids[..3]);
    let source = MeshError::IndicesLength { found: 4 };
    let wrong = MeshSlices { indices: &ids, ..mesh };
    assert_eq!(build(wrong).err(), Some(BuildError::Mesh { geometry: 0, source }));
    let source = MeshError::PositionsLength { found: 9, stride: 4, offset: 0 };
    let wrong = MeshSlices { stride: 4, offset: 0, ..mesh };
    assert_eq!(build(wrong).err(), Some(BuildError::Mesh { geometry: 0, source }));
    let nowhere = World::from_slices(&[mesh], vec![once(3)], &options).err();
    assert!(matches!(nowhere, Some(BuildError::NoSuchGeometry { geometry: 3, .. })), "{nowhere:?}");

    // Without the arrays there is nothing to build from.
    let mut world = build(mesh).unwrap();
    let again = World::build(world.geometries().to_vec(), vec![once(0)], &options).err();
    assert_eq!(again, Some(BuildError::WithoutArrays { geometry: 0 }));
    let layout: GlobalLayout = world.global_layout();
    let part = World::build_part(world.geometries().to_vec(), vec![once(0)], &layout, &options);
    assert_eq!(part.err(), Some(BuildError::WithoutArrays { geometry: 0 }));
    let refit = world.refit(0, Arc::new(TriMesh::default())).unwrap_err();
    assert_eq!(refit, RefitError::WithoutArrays { geometry: 0 });
    assert!(refit.to_string().contains("refit_slices"), "{refit}");
    let refit = world.refit_slices(0, &[]).unwrap_err();
    assert_eq!(refit, RefitError::Meshes { expected: 1, found: 0 });
    let other = MeshSlices::new(&positions[..6], &ids[..3]);
    let refit = world.refit_slices(0, &[other]).unwrap_err();
    assert!(matches!(refit, RefitError::Topology { what: "vertices", .. }), "{refit}");
    let mut meshes = World::from_mesh(soup(3, 1), &options).unwrap();
    let refit = meshes.refit_slices(0, &[mesh]).unwrap_err();
    assert_eq!(refit, RefitError::WithArrays { geometry: 0 });

    #[cfg(feature = "render")]
    {
        use rt_core::scene::{Scene, SceneError};
        let error = Scene::new(world).check().unwrap_err();
        assert_eq!(error, SceneError::WithoutArrays { geometry: 0 });
        assert!(error.to_string().contains("TriMesh"), "{error}");
    }
}
