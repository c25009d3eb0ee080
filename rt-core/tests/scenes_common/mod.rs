//! Small scenes shared by the tests that render images.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its own part")]

use rt_core::camera::Camera;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::{RenderOptions, RenderOutput, render};
use rt_core::scene::{Scene, SceneBuilder};

/// A rectangle of two triangles, from its centre and its half edges.
pub fn quad(center: Vec3, a: Vec3, b: Vec3) -> TriMesh {
    let p = [center - a - b, center + a - b, center + a + b, center - a + b];
    TriMesh::new(p.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

/// A horizontal square of half edge `half` at height `z` whose front faces up.
pub fn floor(z: f32, half: f32) -> TriMesh {
    quad(Vec3::new(0.0, 0.0, z), Vec3::X * half, Vec3::Y * half)
}

/// A sphere of `n` x `2n` quads with exact normals.
pub fn sphere(center: Vec3, radius: f32, n: usize) -> TriMesh {
    let m = 2 * n;
    let mut normals = Vec::new();
    for i in 0..=n {
        for j in 0..m {
            let (st, ct) = (std::f64::consts::PI * i as f64 / n as f64).sin_cos();
            let (sp, cp) = (std::f64::consts::TAU * j as f64 / m as f64).sin_cos();
            normals.push(DVec3::new(st * cp, st * sp, ct).as_vec3());
        }
    }
    let mut indices = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let at = |i: usize, j: usize| (i * m + j % m) as u32;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if i > 0 {
                indices.push([a, b, d]);
            }
            if i + 1 < n {
                indices.push([b, c, d]);
            }
        }
    }
    let positions = normals.iter().map(|n| center + *n * radius).collect();
    TriMesh { normals: Some(Attribute::per_vertex(normals)), ..TriMesh::new(positions, indices) }
}

/// Looks straight down from height `h` with a parallel projection of world height `height`; x to
/// the right, y up.
pub fn top_camera(h: f64, height: f64) -> Camera {
    Camera::orthographic(
        DVec3::new(0.0, 0.0, h),
        DVec3::ZERO,
        DVec3::Y,
        height,
        1.0,
        [0.0, 2.0 * h],
    )
    .unwrap()
}

/// A perspective camera at `eye` that looks at the origin.
pub fn camera(eye: DVec3, fov_rad: f64) -> Camera {
    let up = if eye.x == 0.0 && eye.y == 0.0 { DVec3::Y } else { DVec3::Z };
    Camera::perspective(eye, DVec3::ZERO, up, fov_rad, 1.0, [0.01, 1000.0]).unwrap()
}

/// A scene of meshes with materials.
pub fn scene(parts: Vec<(TriMesh, Material)>, lights: Vec<Light>) -> Scene {
    let mut b = SceneBuilder::new();
    for (mesh, material) in parts {
        b.mesh(mesh, material);
    }
    for l in lights {
        b.light(l);
    }
    b.build().unwrap()
}

/// Renders and returns all outputs.
pub fn draw(scene: &Scene, camera: &Camera, options: RenderOptions) -> RenderOutput {
    render(scene, camera, &options).unwrap()
}

/// Mean of the red channel.
pub fn mean_red(o: &RenderOutput) -> f64 {
    o.frame.color.iter().map(|c| c[0] as f64).sum::<f64>() / o.frame.color.len() as f64
}

/// Largest difference of any channel of any pixel.
pub fn difference(a: &RenderOutput, b: &RenderOutput) -> f32 {
    let channels = a.frame.color.iter().flatten().zip(b.frame.color.iter().flatten());
    channels.fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}
