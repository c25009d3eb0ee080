use super::*;
use crate::camera::Camera;
use crate::colormap::ColorMap;
use crate::environment::Environment;
use crate::frame::Layers;
use crate::light::{Light, LightKind};
use crate::material::{ColorSource, PhongForm, Sides, SurfaceModel};
use crate::mesh::{Attribute, TriMesh};
use crate::render::RenderOptions;
use crate::scene::{Appearance, Scene, SceneBuilder};
use crate::shade::TILE;
use crate::shapes::{Radii, Spheres};
use crate::simd::SimdLevel;
use crate::test_shapes::{Random, noise_soup};
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// Triangles with attributes of every kind; `face` for one value per triangle.
fn dressed(mesh: TriMesh, face: bool, r: &mut Random) -> TriMesh {
    fn attribute<T>(face: bool, values: Vec<T>) -> Option<Attribute<T>> {
        Some(if face { Attribute::per_face(values) } else { Attribute::per_vertex(values) })
    }
    let n = if face { mesh.indices.len() } else { mesh.positions.len() };
    let normals = (0..n).map(|_| r.direction() * 0.7).collect();
    let mut scalars: Vec<f32> = (0..n).map(|_| r.unit() * 3.0 - 0.5).collect();
    (scalars[n / 2], scalars[n / 3]) = (f32::NAN, f32::INFINITY);
    let colors = (0..n).map(|_| [r.unit(), r.unit(), r.unit(), 1.0]).collect();
    TriMesh {
        normals: attribute(face, normals),
        scalars: attribute(face, scalars),
        colors: attribute(face, colors),
        ..mesh
    }
}

fn tinted(mut m: Material) -> Material {
    if let SurfaceModel::Phong { tinted, .. } = &mut m.model {
        *tinted = true;
    }
    m
}

fn towards_light(mut m: Material) -> Material {
    if let SurfaceModel::Phong { highlight, .. } = &mut m.model {
        *highlight = PhongForm::TowardsLight;
    }
    m
}

/// Every path through look-up and lighting, in pieces small enough for blocks to see several of
/// them.
pub(in crate::shade) fn mixed_scene() -> Scene {
    let mut r = Random::new(11);
    let mut b = SceneBuilder::new();
    let map = |log| {
        let colors = vec![[0.1, 0.2, 0.9, 1.0], [1.0, 0.8, 0.3, 1.0], [0.9, 0.1, 0.0, 1.0]];
        Arc::new(ColorMap { log, ..ColorMap::new(colors, [0.25, 2.0]) })
    };
    let phong = |shininess| Material::phong([0.7, 0.5, 0.3], 0.6, shininess);
    let materials = [
        Material::matte([0.4, 0.6, 0.9]),
        Material { flat: true, sides: Sides::LitOutside, ..phong(30.0) },
        Material { color_source: ColorSource::Constant, sides: Sides::BothByNormal, ..phong(7.5) },
        phong(3.0).colored_by_scalars(map(false)),
        Material::matte([1.0; 3]).colored_by_scalars(map(true)).with_emission([0.1, 0.0, 0.2]),
        Material::unlit([0.2, 0.9, 0.4]),
        towards_light(tinted(phong(5.0))),
        Material::pbr([0.9, 0.7, 0.2], 0.5, 0.4),
        Material::dielectric(1.5),
    ];
    let linear = [
        DMat3::IDENTITY,
        DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
        DMat3::from_rotation_y(0.7) * DMat3::from_diagonal(DVec3::new(0.5, 2.0, 1.1)),
    ];
    for (k, material) in materials.into_iter().enumerate() {
        let mesh = dressed(noise_soup(60, k as u64), k % 2 == 1, &mut r);
        let (g, m) = (b.geometry(crate::bvh::Geometry::Mesh(Arc::new(mesh))), b.material(material));
        let place = DVec3::new(r.unit() as f64 - 0.5, r.unit() as f64 - 0.5, r.unit() as f64 - 0.5);
        b.instance(g, DAffine3 { matrix3: linear[k % 3], translation: place }, Appearance::new(m));
    }
    // Triangles whose normals f32 cannot square, and a shape.
    let mut tiny = noise_soup(40, 99);
    tiny.positions.iter_mut().for_each(|p| *p *= 1e-12);
    let (g, m) = (
        b.geometry(crate::bvh::Geometry::Mesh(Arc::new(tiny))),
        b.material(Material::matte([1.0; 3])),
    );
    let large = DAffine3::from_scale(DVec3::splat(0.6e12));
    b.instance(g, large, Appearance::new(m));
    let balls = Spheres::new((0..20).map(|_| r.direction()).collect(), Radii::Common(0.1)).unwrap();
    b.shape(Arc::new(balls), phong(12.0));
    for l in [
        Light::headlight(),
        Light::directional(DVec3::new(1.0, 2.0, 0.5)),
        Light { attenuation: [1.0, 0.1, 0.02], ..Light::point(DVec3::new(2.0, 1.0, 3.0)) },
        Light::ambient([0.1, 0.2, 0.1]),
    ] {
        b.light(Light { shadows: false, ..l });
    }
    for exponent in [0.0, 2.5] {
        let (position, direction) = (DVec3::new(0.0, 3.0, 2.0), DVec3::new(0.0, -1.0, -0.6));
        let kind = LightKind::Spot { position, direction, cutoff_rad: 0.4, exponent, radius: 0.0 };
        b.light(Light { kind, shadows: false, ..Light::headlight() });
    }
    for inner_rad in [0.1, 0.5] {
        let (position, direction) = (DVec3::new(-2.0, 1.0, 3.0), DVec3::new(2.0, -1.0, -3.0));
        let kind = LightKind::Cone { position, direction, inner_rad, outer_rad: 0.5 };
        b.light(Light { kind, shadows: false, ..Light::headlight() });
    }
    b.environment =
        Some(Environment::Gradient { bottom: [0.1; 3], top: [0.2, 0.3, 0.5], up: Vec3::Y });
    b.background = Background::Gradient { bottom: [0.0; 3], top: [0.3; 3] };
    b.build().unwrap()
}

#[test]
fn sixteen_at_a_time_have_the_bits_of_one_at_every_level() {
    let scene = mixed_scene();
    let eye = DVec3::new(0.3, 0.5, 3.5);
    let camera = Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.6, 1.0, [0.1, 100.0]).unwrap();
    let options = RenderOptions::new(3 * TILE, 3 * TILE);
    let (mut met, mut levels) = (vec![0; scene.appearances.len()], 0);
    for level in SimdLevel::available().into_iter().map(Some).chain([None]) {
        let mut context = FrameContext::new(&scene, &camera, &options, Effects::NONE);
        context.level = SimdLevel::resolve(level).expect("a level of this machine");
        levels += 1;
        for tile in 0..9 {
            let (x, y) = (tile % 3 * TILE, tile / 3 * TILE);
            // The last tiles are cut off by the image's edge.
            let width = if tile % 3 == 2 { 13 } else { TILE };
            let area = TileArea { x, y, width, height: TILE, sample: 0 };
            let mut out = TileLayers::new(Layers::ALL, 1.0, false);
            let mut one = TileLayers::new(Layers::ALL, 1.0, false);
            let (mut work, mut stats) = (Workspace::default(), RayStats::default());
            render_tile(&context, &area, &mut out, &mut work, None, true, &mut stats);
            for slot in 0..PIXELS {
                let Some([px, py]) = area.pixel(slot as u16) else { continue };
                let [nx, ny] = context.ndc(px, py, [0.5; 2]);
                let ray = context.camera_rays.ray(nx, ny, [0.0; 2]);
                let expected = match scene.world.closest(&ray) {
                    Some(hit) => {
                        met[hit.instance as usize] += 1;
                        let resolved = context.instance_at(&hit);
                        let shading_point = resolved.shading_point::<WithPoint>(&ray, &hit);
                        one.record(&context, &area, slot as u16, &ray, &hit, || {
                            shading_point.normal
                        });
                        radiance(&context, resolved.material, None, &shading_point, ray.dir)
                            .extend(1.0)
                            .to_array()
                    }
                    None => {
                        let [r, g, b, a] = context.background(py, ray.dir);
                        [r * a, g * a, b * a, a]
                    }
                };
                assert_eq!(
                    out.color[slot].map(f32::to_bits),
                    expected.map(f32::to_bits),
                    "pixel {px}, {py} at {level:?}: {:?} instead of {expected:?}",
                    out.color[slot]
                );
            }
            assert!(out.depth == one.depth && out.distance == one.distance, "depth at {level:?}");
            assert!(
                out.instance == one.instance && out.primitive == one.primitive,
                "ids at {level:?}"
            );
            assert!(out.normal == one.normal, "normals at {level:?}");
        }
    }
    assert!(
        levels > 1 && met.iter().all(|n| *n > 5 * levels),
        "{levels} levels, hits of each instance {met:?}"
    );
}
