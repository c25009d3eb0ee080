//! Rays through given points of the image plane.

use rt_core::glam::{DVec3, Vec3};
use rt_core::prelude::*;
use std::sync::Arc;

const SIZE: u32 = 32;

fn scene() -> Scene {
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let corners = vec![
        corner(-1.0, -0.8, 0.0),
        corner(0.9, -0.6, 0.3),
        corner(0.1, 0.9, -0.4),
        corner(-0.2, -0.9, 0.5),
        corner(0.8, 0.1, 0.5),
        corner(0.2, 0.6, 0.6),
    ];
    let mut builder = SceneBuilder::new();
    let mesh = TriMesh::new(corners, vec![[0, 1, 2], [3, 4, 5]]);
    builder.mesh(mesh, Material::matte([0.5, 0.25, 1.0]));
    // Frames with effects, such as shadows, are lit where surfaces are hit.
    builder.light(Light::directional(DVec3::new(0.3, 0.2, 1.0)).without_shadows());
    builder.build().expect("a scene")
}

fn camera() -> Camera {
    let eye = DVec3::new(0.0, 0.0, 4.0);
    Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.5, 1.0, [0.1, 100.0]).expect("a camera")
}

/// The points (`dx`, `dy`) of all pixels, from the top left of each.
fn points(dx: f64, dy: f64) -> Arc<Vec<[f64; 2]>> {
    let pixel = |i: u32| {
        let [x, y] = [f64::from(i % SIZE) + dx, f64::from(i / SIZE) + dy];
        [2.0 * x / f64::from(SIZE) - 1.0, 1.0 - 2.0 * y / f64::from(SIZE)]
    };
    Arc::new((0..SIZE * SIZE).map(pixel).collect())
}

fn options() -> RenderOptions {
    RenderOptions {
        layers: Layers::COLOR | Layers::DEPTH | Layers::IDS,
        ..RenderOptions::new(SIZE, SIZE)
    }
}

#[test]
fn points_at_the_centres_give_the_image_itself() {
    let (scene, camera) = (scene(), camera());
    let plain = render(&scene, &camera, &options()).expect("an image").frame;
    let listed = RenderOptions { points: Some(points(0.5, 0.5)), ..options() };
    assert_eq!(render(&scene, &camera, &listed).expect("an image").frame, plain);
}

/// A rasterizer with several samples: what covers a sample is found there, its light and colour at
/// the centre of the pixel, also beyond the sides of the triangle.
#[test]
fn triangles_are_lit_at_the_shading_points() {
    let (scene, camera) = (scene(), camera());
    let at = |points, shading_points| {
        let options = RenderOptions { points, shading_points, ..options() };
        render(&scene, &camera, &options).expect("an image").frame
    };
    let (centre, corner) = (points(0.5, 0.5), points(0.9, 0.2));
    let plain = at(None, None);
    let hit = at(Some(Arc::clone(&corner)), None);
    let both = at(Some(corner), Some(centre));
    assert_eq!((&both.depth, &both.primitive), (&hit.depth, &hit.primitive));
    let mut other = 0;
    for i in 0..plain.color.len() {
        if both.primitive[i] == plain.primitive[i] {
            for c in 0..4 {
                let (got, want) = (both.color[i][c], plain.color[i][c]);
                assert!(
                    (got - want).abs() < 1e-5,
                    "pixel {i}: {got} {want} {:?} {:?}",
                    both.color[i],
                    plain.color[i]
                );
            }
        } else {
            other += 1;
        }
    }
    assert!(other > 10, "{other} pixels have another triangle at the point than at the centre");
}

#[test]
fn lists_of_the_wrong_length_are_refused() {
    let wrong = RenderOptions { points: Some(Arc::new(vec![[0.0; 2]; 3])), ..options() };
    let error = render(&scene(), &camera(), &wrong).expect_err("three points").to_string();
    assert!(error.contains("points") && error.contains('3'), "{error}");
    let several = RenderOptions { points: Some(points(0.5, 0.5)), samples: 4, ..options() };
    assert!(render(&scene(), &camera(), &several).is_err());
}
