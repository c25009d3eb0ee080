//! Cameras, layers, depth, determinism, progress and the asynchronous renderer.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::camera::{Camera, CameraError};
use rt_core::environment::Environment;
use rt_core::frame::{Encoding, Layers, PlaneValues};
use rt_core::glam::{DMat4, DVec3, DVec4, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::TriMesh;
use rt_core::render::{
    AsyncRenderer, Crop, ProgressiveRenderer, RenderError, RenderOptions, StopReason, render,
};
use rt_core::scene::{AmbientOcclusion, Scene, SceneBuilder};
use scenes_common::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

fn all_layers(n: u32) -> RenderOptions {
    RenderOptions { layers: Layers::ALL, ..RenderOptions::new(n, n) }
}

/// Distance in ulps.
fn ulps(a: f32, b: f32) -> u32 {
    (a.to_bits() as i32).abs_diff(b.to_bits() as i32)
}

fn busy_scene() -> Scene {
    let mut s = scene(
        vec![
            (floor(-1.0, 4.0), Material::pbr([0.8, 0.7, 0.6], 0.0, 0.4)),
            (sphere(Vec3::new(0.0, 0.9, 0.0), 0.7, 16), Material::dielectric(1.5)),
            (sphere(Vec3::new(0.0, -0.9, 0.0), 0.7, 16), Material::metal([0.9, 0.6, 0.3], 0.3)),
            (
                sphere(Vec3::new(1.2, 0.0, 0.0), 0.5, 16),
                Material::matte([0.3, 0.5, 0.9]).with_opacity(0.6),
            ),
        ],
        vec![
            Light::point(DVec3::new(3.0, 2.0, 4.0)).with_size(0.4).unwrap(),
            Light::ambient([0.2; 3]),
        ],
    );
    s.environment =
        Some(Environment::Gradient { bottom: [0.1; 3], top: [0.5, 0.6, 0.8], up: Vec3::Z });
    s.ambient_occlusion = Some(AmbientOcclusion { distance: 2.0, rays: 4 });
    s
}

// ---- Cameras and depth

#[test]
fn window_depth_is_the_matrix_product_at_the_exact_intersection() {
    // A tilted plane whose intersection with every pixel ray is known in closed form, viewed with
    // difficult matrices.
    let n = DVec3::new(0.3, -0.2, 1.0);
    let corner = |x: f64, y: f64| Vec3::new(x as f32, y as f32, -(n.x * x + n.y * y) as f32);
    let p = [corner(-64.0, -64.0), corner(64.0, -64.0), corner(64.0, 64.0), corner(-64.0, 64.0)];
    let mesh = TriMesh::new(p.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    // The plane of the first triangle after rounding to f32.
    let exact = |i: usize| {
        let [a, b, c] = mesh.triangle(i).map(|q| q.as_dvec3());
        (a, (b - a).cross(c - a))
    };
    let s = scene(vec![(mesh.clone(), Material::matte([1.0; 3]))], vec![]);
    let eye = DVec3::new(2.0, 1.0, 7.0);
    let perspective =
        |near, far| Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.9, 1.0, [near, far]).unwrap();
    // Off-axis: shear of the window (glFrustum with unequal sides), here by composing with a
    // clip-space shift.
    let shift = DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::Z, DVec4::new(0.0, 0.0, 0.0, 1.0));
    let mut off_axis = shift;
    off_axis.z_axis = DVec4::new(0.3, -0.2, 1.0, 0.0);
    let cameras = [
        perspective(0.1, 100.0),
        perspective(1e-3, 1e6),
        perspective(3.0, f64::INFINITY),
        Camera::orthographic(eye, DVec3::ZERO, DVec3::Y, 6.0, 1.0, [0.0, 50.0]).unwrap(),
        Camera::from_matrix(off_axis * perspective(0.1, 100.0).clip_from_world()).unwrap(),
        perspective(0.1, 100.0).with_depth_range([0.0003, 0.9997]),
    ];
    for (k, c) in cameras.iter().enumerate() {
        let o = draw(&s, c, all_layers(32));
        let mut hits = 0;
        for y in 0..32 {
            for x in 0..32 {
                let i = o.frame.index(x, y);
                if o.frame.primitive[i] == u32::MAX {
                    continue;
                }
                hits += 1;
                let (origin, dir) =
                    c.world_ray(Camera::ndc_of_pixel(x as f64 + 0.5, y as f64 + 0.5, [32, 32]));
                let (a, m) = exact(o.frame.primitive[i] as usize);
                let world = origin + dir * (m.dot(a - origin) / m.dot(dir));
                let expected = c.window_depth(world) as f32;
                assert!(
                    ulps(o.frame.depth[i], expected) <= 4,
                    "camera {k}: {} {expected}",
                    o.frame.depth[i]
                );
                let distance = (world - origin).length() as f32;
                assert!(
                    ulps(o.frame.distance[i], distance) <= 4,
                    "camera {k}: {} {distance}",
                    o.frame.distance[i]
                );
            }
        }
        assert!(hits > 900, "camera {k}: {hits}");
    }
}

#[test]
fn pixel_centres_are_opengl_s_and_row_zero_is_the_top() {
    // A square that covers exactly the upper left quarter of the image.
    let s = scene(
        vec![(quad(Vec3::new(-1.0, 1.0, 0.0), Vec3::X, Vec3::Y), Material::unlit([1.0; 3]))],
        vec![],
    );
    let o = draw(&s, &top_camera(5.0, 4.0), RenderOptions::new(8, 8));
    for y in 0..8 {
        for x in 0..8 {
            assert_eq!(o.frame.color_at(x, y)[3] == 1.0, x < 4 && y < 4, "{x} {y}");
        }
    }
}

#[test]
fn near_and_far_planes_clip_as_opengl_does() {
    let s = scene(vec![(floor(0.0, 10.0), Material::unlit([1.0; 3]))], vec![]);
    let c = |near, far| {
        Camera::perspective(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.5, 1.0, [near, far])
            .unwrap()
    };
    let hit = |c: Camera| draw(&s, &c, RenderOptions::new(4, 4)).frame.color_at(2, 2)[3] == 1.0;
    assert!(hit(c(4.9, 5.1)));
    assert!(!hit(c(5.1, 9.0)) && !hit(c(1.0, 4.9)));
    assert!(
        hit(c(5.1, 9.0).with_near_far_clipping(false))
            && hit(c(1.0, 4.9).with_near_far_clipping(false))
    );
}

#[test]
fn far_away_cameras_and_huge_offsets_see_the_same_image() {
    // The same body near the origin, and 10^7 away with a mesh origin: ids must agree pixel by
    // pixel.
    let offset = DVec3::new(1e7, -2e7, 3e6);
    let near = draw(
        &scene(
            vec![(sphere(Vec3::ZERO, 1.0, 24), Material::matte([1.0; 3]))],
            vec![Light::headlight()],
        ),
        &Camera::perspective(
            DVec3::new(4.0, 1.0, 2.0),
            DVec3::ZERO,
            DVec3::Z,
            0.6,
            1.0,
            [0.1, 10.0],
        )
        .unwrap(),
        all_layers(64),
    );
    let mut mesh = sphere(Vec3::ZERO, 1.0, 24);
    mesh.origin = offset;
    let far = draw(
        &scene(vec![(mesh.clone(), Material::matte([1.0; 3]))], vec![Light::headlight()]),
        &Camera::perspective(
            offset + DVec3::new(4.0, 1.0, 2.0),
            offset,
            DVec3::Z,
            0.6,
            1.0,
            [0.1, 10.0],
        )
        .unwrap(),
        all_layers(64),
    );
    let differ =
        near.frame.primitive.iter().zip(&far.frame.primitive).filter(|(a, b)| a != b).count();
    assert!(differ <= 4, "{differ} pixels see another triangle");
    // From 10^6 radii through a telescope.
    let telescope = |c: DVec3| {
        Camera::perspective(c + DVec3::new(1e6, 0.0, 0.0), c, DVec3::Z, 4e-6, 1.0, [1e5, 1e7])
            .unwrap()
    };
    let o = draw(
        &scene(vec![(mesh, Material::matte([1.0; 3]))], vec![Light::headlight()]),
        &telescope(offset),
        all_layers(64),
    );
    let covered = o.frame.primitive.iter().filter(|p| **p != u32::MAX).count() as f64 / 4096.0;
    // A disk of radius 1 in a window of half width 2e6 * 4e-6 / 4 = 2.
    assert!((covered - std::f64::consts::PI / 16.0).abs() < 0.01, "{covered}");
}

#[test]
fn crop_is_part_of_the_whole_bit_for_bit() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let whole = draw(&s, &c, RenderOptions { samples: 2, ..all_layers(70) });
    let crop = Crop { x: 17, y: 33, width: 40, height: 21 };
    let part = draw(&s, &c, RenderOptions { crop: Some(crop), samples: 2, ..all_layers(70) });
    assert_eq!((part.frame.width, part.frame.height), (40, 21));
    for y in 0..21 {
        for x in 0..40 {
            let (i, k) = (part.frame.index(x, y), whole.frame.index(x + 17, y + 33));
            assert_eq!(part.frame.color[i], whole.frame.color[k], "{x} {y}");
            assert_eq!(part.frame.depth[i], whole.frame.depth[k]);
            assert_eq!(part.frame.cost[i], whole.frame.cost[k]);
        }
    }
}

#[test]
fn unusable_cameras_are_refused_by_name() {
    let bad = |m: DMat4| Camera::from_matrix(m).unwrap_err();
    assert!(matches!(bad(DMat4::NAN), CameraError::NotFinite { field: "matrix", .. }));
    assert!(matches!(bad(DMat4::ZERO), CameraError::Singular { .. }));
    let mut flat = DMat4::IDENTITY;
    flat.x_axis = DVec4::ZERO;
    assert!(matches!(bad(flat), CameraError::Singular { third: "z", .. }));
    let p = |eye: DVec3, up: DVec3, fov, near| {
        Camera::perspective(eye, DVec3::ZERO, up, fov, 1.0, [near, 10.0]).unwrap_err()
    };
    assert!(matches!(
        p(DVec3::NAN, DVec3::Y, 0.5, 1.0),
        CameraError::NotFinite { field: "eye", .. }
    ));
    assert!(matches!(p(DVec3::ZERO, DVec3::Y, 0.5, 1.0), CameraError::OutOfRange { .. }));
    assert!(matches!(p(DVec3::Z, DVec3::Z, 0.5, 1.0), CameraError::OutOfRange { .. }));
    assert!(matches!(
        p(DVec3::Z, DVec3::Y, 4.0, 1.0),
        CameraError::OutOfRange { field: "fov_y_rad", .. }
    ));
    let text = p(DVec3::Z, DVec3::Y, 0.5, -1.0).to_string();
    assert!(text.contains("near") && text.contains("-1") && text.contains("positive"), "{text}");
    let lens = rt_core::camera::ThinLens { aperture_radius: 1.0, focus_distance: 1.0 };
    assert_eq!(top_camera(1.0, 1.0).with_lens(lens).unwrap_err(), CameraError::LensOnParallel);
}

// ---- Degenerate scenes and options

#[test]
fn empty_scene_is_background_only() {
    let s = SceneBuilder::new().build().unwrap();
    let o = draw(&s, &camera(DVec3::X * 3.0, 0.5), all_layers(20));
    assert!(o.frame.color.iter().all(|c| *c == [0.0; 4]));
    assert!(o.frame.depth.iter().all(|d| *d == 1.0));
    assert!(o.frame.distance.iter().all(|d| *d == f32::INFINITY));
    assert_eq!(o.report.rays.total(), 400);
}

#[test]
fn camera_inside_a_closed_body_sees_its_inside_everywhere() {
    let s = scene(
        vec![(sphere(Vec3::ZERO, 1.0, 16), Material::matte([1.0; 3]))],
        vec![Light::headlight()],
    );
    let c =
        Camera::perspective(DVec3::new(0.1, 0.2, 0.3), DVec3::X, DVec3::Z, 2.5, 1.0, [1e-4, 10.0])
            .unwrap();
    let o = draw(&s, &c, RenderOptions::new(64, 64));
    assert!(o.frame.color.iter().all(|p| p[3] == 1.0 && p[0] > 0.0));
}

#[test]
fn wrong_options_and_scenes_are_refused_by_name() {
    let s = busy_scene();
    let c = camera(DVec3::X * 5.0, 0.5);
    let field = |o: RenderOptions| match render(&s, &c, &o) {
        Err(RenderError::Option { field, .. }) => field,
        other => panic!("{:?}", other.map(|o| o.report)),
    };
    assert_eq!(field(RenderOptions::new(0, 5)), "width");
    assert_eq!(field(RenderOptions::new(5, 1 << 20)), "height");
    assert_eq!(field(RenderOptions { samples: 0, ..RenderOptions::new(5, 5) }), "samples");
    let outside = Crop { x: 3, y: 0, width: 3, height: 1 };
    assert_eq!(field(RenderOptions { crop: Some(outside), ..RenderOptions::new(5, 5) }), "crop");
    assert_eq!(
        field(RenderOptions { min_contribution: f32::NAN, ..RenderOptions::new(5, 5) }),
        "min_contribution"
    );
    assert_eq!(
        field(RenderOptions { max_error_levels: Some(0.0), ..RenderOptions::new(5, 5) }),
        "max_error_levels"
    );
    let mut b = SceneBuilder::new();
    b.mesh(floor(0.0, 1.0), Material::dielectric(f32::NAN));
    let text = b.build().err().unwrap().to_string();
    assert!(text.contains("material 0") && text.contains("ior") && text.contains("NaN"), "{text}");
    let mut s = busy_scene();
    s.appearances[1].material = 99;
    assert!(
        render(&s, &c, &RenderOptions::new(5, 5)).unwrap_err().to_string().contains("material 99")
    );
}

// ---- Layers

#[test]
fn only_the_layers_asked_for_are_computed() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let o = draw(
        &s,
        &c,
        RenderOptions { layers: Layers::DEPTH | Layers::IDS, ..RenderOptions::new(40, 40) },
    );
    assert!(
        o.frame.color.is_empty()
            && o.frame.normal.is_empty()
            && o.frame.cost.is_empty()
            && o.frame.distance.is_empty()
    );
    assert_eq!((o.frame.depth.len(), o.frame.instance.len()), (1600, 1600));
    // Nothing is shaded, so only primary rays are traced.
    assert_eq!(o.report.rays.total(), o.report.rays.primary + o.report.rays.transparency);
    let names: Vec<_> = o.frame.planes().iter().map(|p| p.name).collect();
    assert_eq!(names, ["depth.Z", "id.instance", "id.primitive"]);
}

#[test]
fn layers_do_not_depend_on_samples_or_colour() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let one = draw(&s, &c, all_layers(40));
    let many = draw(&s, &c, RenderOptions { samples: 4, ..all_layers(40) });
    let bare = draw(
        &s,
        &c,
        RenderOptions { layers: Layers::ALL.without(Layers::COLOR), ..all_layers(40) },
    );
    for other in [&many, &bare] {
        assert_eq!(one.frame.depth, other.frame.depth);
        assert_eq!(one.frame.instance, other.frame.instance);
        assert_eq!(one.frame.normal, other.frame.normal);
    }
    assert_ne!(one.frame.color, many.frame.color);
}

#[test]
fn depth_can_belong_to_opaque_surfaces_only() {
    let s = scene(
        vec![
            (floor(1.0, 3.0), Material::unlit([1.0; 3]).with_opacity(0.5)),
            (floor(0.0, 3.0), Material::unlit([1.0; 3])),
        ],
        vec![],
    );
    let at = |opacity, samples| {
        let o = draw(
            &s,
            &top_camera(5.0, 4.0),
            RenderOptions { depth_min_opacity: opacity, samples, ..all_layers(8) },
        );
        o.frame.distance[20]
    };
    assert_eq!((at(0.0, 1), at(1.0, 1), at(0.0, 2), at(1.0, 2)), (4.0, 5.0, 4.0, 5.0));
}

#[test]
fn cost_layer_adds_up_to_the_rays_counted() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let o = draw(&s, &c, all_layers(32));
    let sum: f64 = o.frame.cost.iter().map(|c| *c as f64).sum();
    // Further layers behind transparent blockers of shadow rays are counted as rays, but not per
    // pixel.
    let total = o.report.rays.total() as f64;
    assert!(sum <= total && sum > 0.8 * total, "{sum} of {total}");
}

#[test]
fn eight_bit_conversion_is_not_premultiplied_and_encodes() {
    let s =
        scene(vec![(floor(0.0, 3.0), Material::unlit([0.5, 1.0, 2.0]).with_opacity(0.5))], vec![]);
    let o = draw(&s, &top_camera(5.0, 4.0), RenderOptions::new(4, 4));
    assert_eq!(o.frame.to_rgba8(Encoding::Direct, 1.0)[..4], [128, 255, 255, 128]);
    assert_eq!(o.frame.to_rgba8(Encoding::Srgb, 1.0)[0], 188);
    assert_eq!(o.frame.to_rgba8(Encoding::Direct, 0.5)[..3], [64, 128, 255]);
    let planes = o.frame.planes();
    assert!(matches!(&planes[0].values, PlaneValues::F32(v) if v[0] == 0.25));
}

// ---- Determinism

#[test]
fn same_image_for_any_number_of_threads() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    for path_tracing in [false, true] {
        let options = RenderOptions { samples: 3, path_tracing, seed: 5, ..all_layers(100) };
        let mut first = None;
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let o = pool.install(|| draw(&s, &c, options.clone()));
            let (frame, rays) = first.get_or_insert((o.frame.clone(), o.report.rays));
            assert!(
                *frame == o.frame && *rays == o.report.rays,
                "{threads} threads, path tracing {path_tracing}"
            );
        }
        let other = draw(&s, &c, RenderOptions { seed: 6, ..options.clone() });
        assert_ne!(first.unwrap().0.color, other.frame.color, "another seed, other noise");
    }
}

// ---- Progress

#[test]
fn progressive_steps_equal_one_render_and_the_error_falls() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let options = RenderOptions { samples: 16, ..RenderOptions::new(40, 40) };
    let mut p = ProgressiveRenderer::new(&s, &c, &options).unwrap();
    let (mut steps, mut errors) = (1, Vec::new());
    while p.step().unwrap() {
        steps += 1;
        errors.push(p.error_levels());
    }
    assert_eq!((steps, p.report().samples, p.report().stopped), (16, 16, StopReason::Samples));
    assert_eq!(p.frame(), render(&s, &c, &options).unwrap().frame);
    assert_eq!(errors[0], None);
    assert!(errors[14].unwrap() < 0.7 * errors[3].unwrap(), "{errors:?}");
    assert!(!p.step().unwrap(), "done is done");
}

#[test]
fn stops_by_error_time_and_cancel() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let base = RenderOptions { samples: 1 << 20, ..RenderOptions::new(33, 33) };
    let o = render(&s, &c, &RenderOptions { max_error_levels: Some(4.0), ..base.clone() }).unwrap();
    assert_eq!(o.report.stopped, StopReason::Error);
    assert!(o.report.error_levels.unwrap() <= 4.0 && o.report.samples >= 4);
    let o = render(&s, &c, &RenderOptions { time_limit: Some(Duration::ZERO), ..base.clone() })
        .unwrap();
    assert_eq!((o.report.stopped, o.report.samples), (StopReason::Time, 1));
    assert!(o.frame.color.iter().any(|p| p[3] > 0.0), "the first sample is always finished");
    let o =
        render(&s, &c, &RenderOptions { cancel: Some(Arc::new(AtomicBool::new(true))), ..base })
            .unwrap();
    assert_eq!((o.report.stopped, o.report.samples), (StopReason::Cancelled, 0));
}

#[test]
fn error_estimate_is_about_the_true_error() {
    // Independent samples: the estimate must be within a factor of 1.5 of the difference to an
    // image of many samples.
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let base = RenderOptions {
        sampling: rt_core::sampler::Sampling::Random,
        ..RenderOptions::new(32, 32)
    };
    let truth = draw(&s, &c, RenderOptions { samples: 128, seed: 77, ..base.clone() });
    let o = draw(&s, &c, RenderOptions { samples: 16, ..base });
    let luminance = |p: &[f32; 4]| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
    let sum: f32 = truth
        .frame
        .color
        .iter()
        .zip(&o.frame.color)
        .map(|(a, b)| (luminance(a) - luminance(b)).powi(2))
        .sum();
    let found = 255.0 * (sum / 1024.0).sqrt();
    let estimate = o.report.error_levels.unwrap();
    assert!(found / estimate < 1.5 && estimate / found < 1.5, "{found} {estimate}");
}

#[test]
fn renderer_draws_the_same_in_used_memory() {
    let s = busy_scene();
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let other = camera(DVec3::new(-5.0, 3.0, 1.0), 0.8);
    let mut renderer = rt_core::render::Renderer::new();
    for options in [
        all_layers(50),
        RenderOptions { samples: 2, ..all_layers(50) },
        RenderOptions::new(50, 50),
        RenderOptions {
            effects: Some(rt_core::effects::Effects::NONE),
            ..RenderOptions::new(50, 50)
        },
        all_layers(70),
    ] {
        let first = renderer.render(&s, &other, &options).unwrap();
        renderer.recycle(first.frame);
        let second = renderer.render(&s, &c, &options).unwrap();
        assert_eq!(second.frame, render(&s, &c, &options).unwrap().frame);
    }
}

// ---- Asynchronous

#[test]
fn asynchronous_renderer_is_one_frame_behind() {
    let s = Arc::new(busy_scene());
    let eye = |k: u32| camera(DVec3::new(6.0, 1.0 + k as f64, 2.0), 0.6);
    let options = RenderOptions::new(48, 48);
    for threads in [None, Some(2)] {
        let mut a = AsyncRenderer::new(threads).unwrap();
        for k in 0..4 {
            let got = a.submit(s.clone(), eye(k), options.clone()).unwrap();
            match k {
                0 => assert!(got.is_none()),
                _ => {
                    assert_eq!(
                        got.unwrap().frame,
                        draw(&s, &eye(k - 1), options.clone()).frame,
                        "frame {k}"
                    )
                }
            }
        }
        assert_eq!(a.wait().unwrap().unwrap().frame, draw(&s, &eye(3), options.clone()).frame);
        assert!(a.wait().unwrap().is_none());
    }
}

#[test]
fn asynchronous_errors_arrive_one_frame_later_and_dropping_cancels() {
    let s = Arc::new(busy_scene());
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let mut a = AsyncRenderer::new(None).unwrap();
    assert!(a.submit(s.clone(), c, RenderOptions::new(0, 0)).unwrap().is_none());
    assert!(matches!(
        a.submit(s.clone(), c, RenderOptions::new(8, 8)),
        Err(RenderError::Option { field: "width", .. })
    ));
    assert_eq!(a.wait().unwrap().unwrap().frame.width, 8);
    // The work would take hours, so dropping must not wait for it.
    a.submit(s, c, RenderOptions { samples: 1 << 24, ..RenderOptions::new(64, 64) }).unwrap();
    let start = std::time::Instant::now();
    drop(a);
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

/// A shape with a bug.
struct Explosive;
impl rt_core::shapes::Shape for Explosive {
    fn num_primitives(&self) -> usize {
        1
    }
    fn bounds(&self, _: u32) -> rt_core::math::Aabb {
        rt_core::math::Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0))
    }
    fn closest(&self, _: u32, ray: &rt_core::ray::Ray) -> Option<rt_core::shapes::ShapeHit> {
        let t = -ray.origin.z / ray.dir.z;
        Some(rt_core::shapes::ShapeHit { t, u: 0.0, v: 0.0 })
    }
    fn surface(
        &self,
        _: u32,
        hit: &rt_core::shapes::ShapeHit,
        ray: &rt_core::ray::Ray,
    ) -> rt_core::shapes::ShapeSurface {
        let point = ray.at(hit.t);
        assert!(point.x < 0.4 || point.y < 0.4, "the bug at {point}");
        rt_core::shapes::ShapeSurface {
            point,
            point_error: 1e-6,
            normal: Vec3::Z,
            shading_normal: None,
            scalar: None,
            color: None,
        }
    }
}

#[test]
fn panic_in_a_tile_names_the_pixel_that_repeats_it() {
    let mut b = SceneBuilder::new();
    b.shape(Arc::new(Explosive), Material::matte([1.0; 3]));
    b.light(Light::headlight());
    let s = b.build().unwrap();
    let c = top_camera(4.0, 2.0);
    let e = render(&s, &c, &RenderOptions::new(100, 100)).unwrap_err();
    let RenderError::Panicked { x, y, ref message, .. } = e else { panic!("{e}") };
    assert!(message.contains("the bug at"), "{message}");
    // x >= 0.4 from column 70, y >= 0.4 up to row 29.
    assert!(x >= 70 && y <= 29, "{x} {y}");
    let crop = Some(Crop { x, y, width: 1, height: 1 });
    assert!(matches!(
        render(&s, &c, &RenderOptions { crop, ..RenderOptions::new(100, 100) }),
        Err(RenderError::Panicked { .. })
    ));
    let crop = Some(Crop { x: 5, y: 5, width: 1, height: 1 });
    assert!(render(&s, &c, &RenderOptions { crop, ..RenderOptions::new(100, 100) }).is_ok());
}
