//! Frames of meshes in pages, which are those of the same meshes in memory.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::bvh::{BuildOptions, Geometry, Instance, StoredMesh, StoredMeshWriter, World};
use rt_core::colormap::ColorMap;
use rt_core::frame::Layers;
use rt_core::glam::{DAffine3, DQuat, DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::{ColorSource, Material, PhongForm, Sides, SurfaceModel};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::RenderOptions;
use rt_core::scene::{AmbientOcclusion, Appearance, Scene};
use scenes_common::*;
use std::sync::Arc;

/// A ball of 20,000 triangles with normals, colours of triangles and scalars of vertices.
fn painted() -> TriMesh {
    let mut mesh = sphere(Vec3::new(0.2, -0.1, 0.3), 1.0, 70);
    let wave = |i: usize| 0.5 + 0.5 * (i as f32 * 0.37).sin();
    let colors = (0..mesh.indices.len()).map(|i| [wave(i), 0.5, 0.25, 1.0]).collect();
    mesh.colors = Some(Attribute::per_face(colors));
    mesh.scalars = Some(Attribute::per_vertex((0..mesh.positions.len()).map(wave).collect()));
    mesh
}

fn stored(mesh: &TriMesh) -> Geometry {
    let mut writer = StoredMeshWriter::new(Vec::new(), mesh.origin).expect("memory");
    writer.add_mesh(mesh).expect("a sound mesh");
    let (bytes, report) = writer.finish().expect("a sound mesh");
    assert!(report.pages > 3, "{report:?}");
    Geometry::Shape(Arc::new(StoredMesh::open(bytes, 1 << 24).expect("sound bytes")))
}

fn scene_of(geometry: Geometry, world_from_object: DAffine3, material: Material) -> Scene {
    let placed = Instance { geometry: 0, world_from_object };
    let world = World::build(vec![geometry], vec![placed], &BuildOptions::default()).unwrap();
    let mut scene = Scene::new(world);
    scene.materials = vec![material];
    scene.appearances = vec![Appearance::new(0)];
    scene
}

fn materials() -> [Material; 4] {
    let grey = Material::matte([0.7; 3]);
    let shiny = SurfaceModel::Phong {
        ambient: 0.3,
        diffuse: 0.6,
        specular: [0.4; 3],
        tinted: false,
        shininess: 20.0,
        highlight: PhongForm::HalfVector,
        mirror: 0.0,
    };
    let map = ColorMap::new(vec![[0.1, 0.2, 0.9, 1.0], [0.9, 0.3, 0.1, 1.0]], [0.0, 1.0]);
    [
        Material { color_source: ColorSource::Constant, ..grey.clone() },
        Material { color_source: ColorSource::Attribute, flat: true, ..grey.clone() },
        Material {
            color_source: ColorSource::Scalars(Arc::new(map)),
            model: shiny,
            ..grey.clone()
        },
        Material { color_source: ColorSource::Attribute, sides: Sides::BackOnly, ..grey },
    ]
}

#[test]
fn pictures_of_stored_meshes_are_those_of_meshes_in_memory_bit_for_bit() {
    let mesh = painted();
    let turned = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 1.2, 0.8),
        DQuat::from_rotation_x(0.7),
        DVec3::new(0.1, 0.2, 0.05),
    );
    let camera = camera(DVec3::new(1.0, -2.5, 1.5), 0.7);
    for (place, material) in
        [DAffine3::IDENTITY, turned].into_iter().flat_map(|p| materials().map(|m| (p, m)))
    {
        let mut scenes = [Geometry::Mesh(Arc::new(mesh.clone())), stored(&mesh)]
            .map(|geometry| scene_of(geometry, place, material.clone()));
        for (shadows, occlusion) in [(false, false), (true, false), (true, true)] {
            let options = RenderOptions { layers: Layers::ALL, ..RenderOptions::new(90, 70) };
            let [a, b] = scenes.each_mut().map(|scene| {
                let lamp = Light { shadows, ..Light::point(DVec3::new(2.0, -3.0, 4.0)) };
                scene.lights = vec![lamp, Light::ambient([0.2; 3])];
                scene.ambient_occlusion =
                    occlusion.then_some(AmbientOcclusion { distance: 2.0, rays: 4 });
                draw(scene, &camera, options.clone()).frame
            });
            let what = format!("{:?}, {shadows}, {occlusion}", material.color_source);
            let covered = a.color.iter().filter(|c| c[3] > 0.0).count();
            assert!(covered > 1500, "{what}: {covered}");
            assert!(a.color == b.color, "{what}: colours");
            assert!(a.depth == b.depth && a.normal == b.normal, "{what}: depth and normals");
        }
    }
}
