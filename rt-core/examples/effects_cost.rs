//! Measures the cost of each effect: renders one scene with one more effect each time.
//!
//! `cargo run --release -p rt-core --example effects_cost -- [pixels per side, default 512]
//! [rounds, default 3]`

use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::frame::Layers;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::{Material, SurfaceModel};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::ray::{HitBlock, Ray, RayBlock};
use rt_core::render::{RenderOptions, Renderer};
use rt_core::scene::{AmbientOcclusion, Scene};
use std::time::{Duration, Instant};

/// A sphere with bumps, about a million triangles.
fn bumpy_sphere() -> TriMesh {
    let (n, m) = (512usize, 1024usize);
    let mut positions = Vec::new();
    for i in 0..=n {
        for j in 0..m {
            let (st, ct) = (std::f32::consts::PI * i as f32 / n as f32).sin_cos();
            let (sp, cp) = (std::f32::consts::TAU * j as f32 / m as f32).sin_cos();
            let d = Vec3::new(st * cp, st * sp, ct);
            positions.push(
                d * (1.0 + 0.05 * (17.0 * d.x).sin() * (13.0 * d.y).sin() * (19.0 * d.z).sin()),
            );
        }
    }
    let at = |i: usize, j: usize| (i * m + j % m) as u32;
    let quads = (0..n).flat_map(|i| (0..m).map(move |j| (i, j)));
    let indices: Vec<[u32; 3]> = quads
        .flat_map(|(i, j)| {
            [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
        })
        .collect();
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in &indices {
        let [a, b, c] = t.map(|k| positions[k as usize]);
        for k in t {
            normals[*k as usize] += (b - a).cross(c - a);
        }
    }
    TriMesh { normals: Some(Attribute::per_vertex(normals)), ..TriMesh::new(positions, indices) }
}

/// The shortest of several runs.
fn best(rounds: u32, mut run: impl FnMut()) -> Duration {
    let time = |run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        start.elapsed()
    };
    (0..rounds).map(|_| time(&mut run)).min().unwrap_or_default()
}

fn main() {
    // `args` would panic on an argument that is not UTF-8, without a useful message.
    let number = |a: std::ffi::OsString| a.to_str().and_then(|a| a.parse::<u32>().ok());
    let mut arguments = std::env::args_os().skip(1).map(|a| number(a).expect("a whole number"));
    let (n, rounds) = (arguments.next().unwrap_or(512), arguments.next().unwrap_or(3));
    let world =
        World::from_mesh(bumpy_sphere(), &BuildOptions::default()).expect("the mesh is sound");
    let camera = Camera::perspective(
        DVec3::new(3.2, 0.5, 0.7),
        DVec3::ZERO,
        DVec3::Z,
        0.6,
        1.0,
        [0.1, 100.0],
    )
    .expect("the camera is sound");

    // Tracing alone: the same camera rays in blocks of 4 x 4 pixels, 32 x 32 pixels at a time, on
    // one thread.
    let (eye, corner) = camera.world_ray([-1.0, 1.0]);
    let (right, down) =
        (camera.world_ray([1.0, 1.0]).1 - corner, camera.world_ray([-1.0, -1.0]).1 - corner);
    let mut blocks = Vec::new();
    for tile in 0..(n / 32) * (n / 32) {
        for slot in 0..1024 {
            let bits = |k: u32| (0..5).fold(0, |v, b| v | (slot >> (2 * b + k) & 1) << b);
            let (x, y) = (tile % (n / 32) * 32 + bits(0), tile / (n / 32) * 32 + bits(1));
            let at = |v: u32| (v as f64 + 0.5) / n as f64;
            let dir = corner + right * at(x) + down * at(y);
            blocks.push(Ray::new((eye - world.origin()).as_vec3(), dir.as_vec3()));
        }
    }
    let blocks = RayBlock::from_rays(&blocks);
    let mut hits = vec![HitBlock::MISS; blocks.len()];
    let alone = best(rounds, || {
        for (r, h) in blocks.chunks(64).zip(hits.chunks_mut(64)) {
            world.closest_coherent(r, h).expect("as many hits as rays");
        }
    });
    println!(
        "{n} x {n}, {} triangles; milliseconds, best of {rounds}, {} threads",
        1 << 20,
        rayon::current_num_threads()
    );
    println!(
        "{:32} {:9.2}  (one thread)",
        "camera rays without a picture",
        alone.as_secs_f64() * 1e3
    );

    let mut scene = Scene::new(world);
    let shiny = |mirror| {
        let mut m = Material::phong([0.6, 0.7, 0.8], 0.4, 30.0);
        if let SurfaceModel::Phong { mirror: k, .. } = &mut m.model {
            *k = mirror;
        }
        m
    };
    let mut renderer = Renderer::new();
    let mut row = |name: &str, scene: &Scene, options: RenderOptions| {
        let mut rays = 0;
        let time = best(rounds, || {
            let o = renderer.render(scene, &camera, &options).expect("the scene is sound");
            rays = o.report.rays.total();
            renderer.recycle(o.frame);
        });
        let ms = time.as_secs_f64() * 1e3;
        println!("{name:32} {ms:9.2}  {rays:10} rays  {:6.2} Mrays/s", rays as f64 / ms / 1e3);
    };
    let options = RenderOptions::new(n, n);
    row(
        "depth and ids",
        &scene,
        RenderOptions { layers: Layers::DEPTH | Layers::IDS, ..options.clone() },
    );
    row("headlight, matte", &scene, options.clone());
    scene.materials[0] = shiny(0.0);
    row("+ highlight", &scene, options.clone());
    row(
        "+ depth and ids",
        &scene,
        RenderOptions { layers: Layers::COLOR | Layers::DEPTH | Layers::IDS, ..options.clone() },
    );
    scene.lights = vec![Light::point(DVec3::new(3.0, 2.0, 4.0)), Light::ambient([0.3; 3])];
    row(
        "point light, no shadows",
        &scene,
        RenderOptions { effects: Some(Effects::NONE), ..options.clone() },
    );
    row("+ shadows", &scene, options.clone());
    scene.lights[0] = scene.lights[0].with_size(0.5).expect("a light with a size");
    row("+ soft shadows, 4 rays", &scene, options.clone());
    scene.ambient_occlusion = Some(AmbientOcclusion { distance: 1.0, rays: 8 });
    row("+ ambient occlusion, 8 rays", &scene, options.clone());
    scene.materials[0] = shiny(0.3);
    row("+ mirror", &scene, options.clone());
    scene.materials[0] = shiny(0.0).with_opacity(0.5);
    row("half transparent instead", &scene, options.clone());
    scene.materials[0] = Material::dielectric(1.5);
    row("glass instead", &scene, options.clone());
    scene.materials[0] = Material::matte([0.7; 3]);
    row(
        "path tracing, 4 samples",
        &scene,
        RenderOptions { path_tracing: true, samples: 4, ..options },
    );
}
