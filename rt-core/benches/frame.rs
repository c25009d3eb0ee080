//! Time of whole frames on one thread: the cost of a frame beyond its rays, and of each effect.
//! `cargo bench -p rt-core --bench frame`

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rt_core::bvh::{BuildOptions, Geometry, World};
use rt_core::colormap::ColorMap;
use rt_core::effects::Effects;
use rt_core::frame::Layers;
use rt_core::glam::{DAffine3, DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::TriMesh;
use rt_core::render::{RenderOptions, Renderer};
use rt_core::scene::{AmbientOcclusion, Appearance, Scene, SceneBuilder};
use rt_core::texture::Texture;

const SIZE: u32 = 512;

fn frame(c: &mut Criterion) {
    let world = World::from_mesh(common::shells(), &BuildOptions::default()).expect("a sound mesh");
    let mut plain = Scene::new(world);
    plain.materials[0] = Material::phong([0.6, 0.7, 0.8], 0.4, 30.0);
    let point = Light::point(DVec3::new(4.0, 5.0, 3.0));
    let color = RenderOptions::new(SIZE, SIZE);
    let scene = |change: fn(&mut Scene)| {
        let mut s = plain.clone();
        change(&mut s);
        s
    };
    let mapped =
        ColorMap::new(vec![[0.0, 0.0, 1.0, 1.0], [1.0; 4], [1.0, 0.0, 0.0, 1.0]], [0.2, 1.2]);
    let mut by_scalars = plain.clone();
    by_scalars.materials[0] = plain.materials[0].clone().colored_by_scalars(mapped);
    let mut lamp = plain.clone();
    lamp.lights = vec![point];
    let none = Some(Effects::NONE);
    let with_depth = Layers::COLOR | Layers::DEPTH;
    let occlusion = scene(|s| {
        s.lights = vec![Light::ambient([1.0; 3])];
        s.ambient_occlusion = Some(AmbientOcclusion { distance: f64::INFINITY, rays: 8 });
    });
    let half = scene(|s| s.materials[0].opacity = 0.5);
    let (opaque, one_pane) = (beside_a_pane(1.0), beside_a_pane(0.5));
    let many = many_with_a_texture();
    let few_pixels = RenderOptions::new(32, 32);
    let cases = [
        ("ids alone", &plain, RenderOptions { layers: Layers::IDS, ..color.clone() }),
        ("headlight, flat", &scene(|s| s.materials[0].flat = true), color.clone()),
        ("headlight", &plain, color.clone()),
        ("headlight, colour map", &by_scalars, color.clone()),
        ("headlight, depth", &plain, RenderOptions { layers: with_depth, ..color.clone() }),
        ("headlight, 4 samples", &plain, RenderOptions { samples: 4, ..color.clone() }),
        ("point light", &lamp, RenderOptions { effects: none, ..color.clone() }),
        ("point light, shadows", &lamp, color.clone()),
        ("ambient occlusion, 8 rays", &occlusion, color.clone()),
        ("half transparent", &half, color.clone()),
        // One transparent instance must not slow down light rays elsewhere.
        ("shadows, occlusion, opaque pane", &opaque, color.clone()),
        ("shadows, occlusion, clear pane", &one_pane, color.clone()),
        // The cost of a frame before its first ray.
        ("1000 instances, opaque texture", &many, few_pixels),
    ];
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut group = c.benchmark_group("frame");
    group.throughput(Throughput::Elements(u64::from(SIZE * SIZE)));
    for (name, scene, options) in cases {
        let mut renderer = Renderer::new();
        group.bench_function(name, |b| {
            one.install(|| {
                b.iter(|| {
                    let output =
                        renderer.render(scene, &common::camera(), &options).expect("a sound scene");
                    renderer.recycle(output.frame);
                });
            });
        });
    }
    group.finish();
}

/// Shells with a lamp and ambient occlusion, and a small pane in a corner of the image.
fn beside_a_pane(opacity: f32) -> Scene {
    let mut b = SceneBuilder::new();
    b.mesh(common::shells(), Material::matte([0.6, 0.7, 0.8]));
    let corners =
        vec![Vec3::new(1.2, 1.2, 0.0), Vec3::new(1.4, 1.2, 0.0), Vec3::new(1.2, 1.4, 0.0)];
    let pane = TriMesh::new(corners, vec![[0, 1, 2]]);
    b.mesh(pane, Material::matte([1.0; 3]).with_opacity(opacity));
    b.light(Light::point(DVec3::new(4.0, 5.0, 3.0)));
    b.light(Light::ambient([0.5; 3]));
    b.ambient_occlusion = Some(AmbientOcclusion { distance: f64::INFINITY, rays: 4 });
    b.build().expect("a sound scene")
}

/// A thousand plates with one opaque texture of a million texels.
fn many_with_a_texture() -> Scene {
    let texels = vec![[0.5, 0.6, 0.7, 1.0]; 1 << 20];
    let texture = Texture::from_linear(1 << 10, 1 << 10, texels).expect("a picture");
    let mut b = SceneBuilder::new();
    let m = b.material(Material::matte([1.0; 3]).textured(texture));
    for k in 0..1000 {
        let mut mesh = common::bumpy(k);
        mesh.texcoords = Some(mesh.positions.iter().map(|p| p.truncate()).collect());
        let g = b.geometry(Geometry::Mesh(mesh.into()));
        b.instance(g, DAffine3::IDENTITY, Appearance::new(m));
    }
    b.light(Light::headlight());
    b.build().expect("a sound scene")
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = frame
}
criterion_main!(benches);
