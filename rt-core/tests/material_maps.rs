//! Normal, roughness, metalness, occlusion and emission textures against materials without them and
//! closed forms.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::frame::Layers;
use rt_core::glam::{DAffine3, DMat3, DVec3, Vec2, Vec3, Vec4};
use rt_core::light::Light;
use rt_core::material::{Material, Sides, SurfaceModel};
use rt_core::material_maps::{
    BsdfParameters, MapConvention, MaterialEvalContext, MaterialMaps, TextureMaps,
};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::RenderOptions;
use rt_core::scene::{Appearance, SceneBuilder};
use rt_core::texture::{Filter, Texture};
use scenes_common::*;
use std::sync::Arc;

/// A texture of one texel.
fn texel(rgb: [f32; 3]) -> Option<Arc<Texture>> {
    Some(Texture::from_linear(1, 1, vec![[rgb[0], rgb[1], rgb[2], 1.0]]).unwrap().into())
}

/// A texture of one texel with a tangent-space normal.
fn bend(n: Vec3) -> Option<Arc<Texture>> {
    texel((n * 0.5 + 0.5).to_array())
}

/// A square in z = 0, u along x and v along `v_axis`·y.
fn sheet(v_axis: f32) -> TriMesh {
    let mut mesh = floor(0.0, 1.0);
    let uv = |p: &Vec3| Vec2::new(p.x, p.y * v_axis) * 0.5 + 0.5;
    mesh.texcoords = Some(mesh.positions.iter().map(uv).collect());
    mesh
}

fn tangents(mesh: TriMesh, t: Vec4) -> TriMesh {
    TriMesh { tangents: Some(vec![t; mesh.positions.len()]), ..mesh }
}

/// The middle pixel, rendered once with local lighting alone and once with a shadow pass. Both must
/// agree.
fn middle(mesh: &TriMesh, material: &Material, lights: &[Light], from: f64) -> [f32; 4] {
    let camera = Camera::orthographic(
        DVec3::new(0.0, 0.0, from),
        DVec3::ZERO,
        DVec3::Y,
        0.001,
        1.0,
        [0.0, 20.0],
    )
    .unwrap();
    let with = |shadows: bool| {
        let lights = lights.iter().map(|l| Light { shadows, ..*l }).collect();
        let s = scene(vec![(mesh.clone(), material.clone())], lights);
        let out = draw(&s, &camera, RenderOptions { effects: None, ..RenderOptions::new(1, 1) });
        out.frame.color_at(0, 0)
    };
    let (local, general) = (with(false), with(true));
    for c in 0..4 {
        assert!(
            (local[c] - general[c]).abs() < 1e-6,
            "{local:?} by local light, {general:?} with shadows"
        );
    }
    local
}

fn close(a: f32, b: f32, what: &str) {
    assert!((a - b).abs() < 2e-5, "{what}: {a} instead of {b}");
}

#[test]
fn normal_maps_bend_along_the_texture_coordinates() {
    let n = Vec3::new(0.48, 0.36, 0.8);
    let to_light = Vec3::new(0.5, -0.3, 0.9).normalize();
    let light = [Light::directional(to_light.as_dvec3())];
    let maps = TextureMaps { normal: bend(n), ..TextureMaps::new(MapConvention::Gltf) };
    let m = Material::matte([1.0; 3])
        .with_sides(Sides::Both)
        .with_maps(Arc::new(maps) as Arc<dyn MaterialMaps>);
    let (right_handed, left_handed) = (sheet(1.0), sheet(-1.0));
    close(middle(&right_handed, &m, &light, 5.0)[0], n.dot(to_light), "u along x, v along y");
    let mirrored = Vec3::new(n.x, -n.y, n.z);
    close(middle(&left_handed, &m, &light, 5.0)[0], mirrored.dot(to_light), "v against y");
    // glTF files count v downwards, but their green channel still points to the upper edge of the
    // image.
    let from_top = TextureMaps {
        normal: bend(n),
        rows_from_top: true,
        ..TextureMaps::new(MapConvention::Gltf)
    };
    let down = Material::matte([1.0; 3]).with_maps(Arc::new(from_top) as Arc<dyn MaterialMaps>);
    close(
        middle(&left_handed, &down, &light, 5.0)[0],
        n.dot(to_light),
        "v against y, rows from the top",
    );
    let own = tangents(sheet(-1.0), Vec4::new(1.0, 0.0, 0.0, 1.0));
    close(middle(&own, &down, &light, 5.0)[0], n.dot(to_light), "tangents say it themselves");
    // From behind, the whole tangent frame is reversed.
    let below = Vec3::new(0.2, 0.1, -0.9).normalize();
    let found = middle(&right_handed, &m, &[Light::directional(below.as_dvec3())], -5.0)[0];
    close(found, -n.dot(below), "seen from behind");
    // The mesh's own tangents take precedence.
    let own = tangents(sheet(1.0), Vec4::new(0.0, 2.0, 0.0, 1.0));
    let turned = Vec3::new(-n.y, n.x, n.z);
    close(middle(&own, &m, &light, 5.0)[0], turned.dot(to_light), "tangent along y");
}

#[test]
fn vtk_turns_the_normal_before_it_bends_it_and_needs_tangents() {
    let n = Vec3::new(0.48, 0.36, 0.8);
    let maps = TextureMaps { normal: bend(n), ..TextureMaps::new(MapConvention::Vtk) };
    let m = Material::matte([1.0; 3]).with_maps(Arc::new(maps) as Arc<dyn MaterialMaps>);
    let below = Vec3::new(0.2, 0.1, -0.9).normalize();
    let light = [Light::directional(below.as_dvec3())];
    let mesh = tangents(sheet(1.0), Vec4::new(1.0, 0.0, 0.0, 1.0));
    // Normal -z, tangent x, partner -z × x = -y.
    let expected = Vec3::new(n.x, -n.y, -n.z);
    close(middle(&mesh, &m, &light, -5.0)[0], expected.dot(below), "seen from behind");
    close(middle(&sheet(1.0), &m, &light, -5.0)[0], 0.9 / 0.86f32.sqrt(), "without tangents");
    let s = scene(vec![(sheet(1.0), m)], vec![]);
    let warnings = s.warnings();
    assert!(warnings.iter().any(|w| w.contains("lacks tangents")), "{warnings:?}");
}

/// A mirror whose normal map is so steep that it would reflect directions below the surface. It
/// reflects along the surface instead and is not black.
#[test]
fn steep_normal_maps_leave_no_black_points() {
    let n = Vec3::new(0.8, 0.0, 0.6);
    let maps = TextureMaps { normal: bend(n), ..TextureMaps::new(MapConvention::Gltf) };
    for roughness in [0.0, 0.3] {
        let m = Material::pbr([1.0; 3], 1.0, roughness)
            .with_maps(Arc::new(maps.clone()) as Arc<dyn MaterialMaps>);
        let mut b = SceneBuilder::new();
        b.mesh(sheet(1.0), m);
        b.environment = Some(rt_core::environment::Environment::Constant([0.5; 3]));
        let s = b.build().unwrap();
        let mut options = RenderOptions::new(1, 1);
        (options.samples, options.path_tracing) = (256, true);
        let red = draw(&s, &top_camera(5.0, 0.001), options).frame.color_at(0, 0)[0];
        assert!(red > 0.15, "roughness {roughness}: {red}");
    }
}

#[test]
fn scale_flattens_or_steepens_a_normal_map() {
    let n = Vec3::new(0.6, 0.0, 0.8);
    // Steeper normals are corrected: see `steep_normal_maps_leave_no_black_points`.
    for normal_scale in [0.0, 0.5, 1.2] {
        let maps =
            TextureMaps { normal: bend(n), normal_scale, ..TextureMaps::new(MapConvention::Gltf) };
        let m = Material::matte([1.0; 3]).with_maps(Arc::new(maps) as Arc<dyn MaterialMaps>);
        let expected = Vec3::new(0.6 * normal_scale, 0.0, 0.8).normalize().z;
        close(middle(&sheet(1.0), &m, &[Light::directional(DVec3::Z)], 5.0)[0], expected, "scaled");
    }
}

#[test]
fn bent_normals_turn_with_their_instance() {
    let n = Vec3::new(0.6, 0.0, 0.8);
    let maps: Arc<dyn MaterialMaps> =
        Arc::new(TextureMaps { normal: bend(n), ..TextureMaps::new(MapConvention::Gltf) });
    let mut b = SceneBuilder::new();
    let g = b.geometry(rt_core::bvh::Geometry::Mesh(Arc::new(sheet(1.0))));
    let m = b.material(Material::matte([1.0; 3]).with_maps(maps));
    // A quarter turn about z: u now grows along y.
    let quarter = DAffine3::from_mat3(DMat3::from_rotation_z(std::f64::consts::FRAC_PI_2) * 3.0);
    b.instance(g, quarter, Appearance::new(m));
    let to_light = DVec3::new(0.1, 0.6, 0.7).normalize();
    b.light(Light { shadows: false, ..Light::directional(to_light) });
    let s = b.build().unwrap();
    let mut options = RenderOptions::new(1, 1);
    options.layers = Layers::COLOR | Layers::NORMAL;
    let out = draw(&s, &top_camera(5.0, 0.001), options);
    close(out.frame.color_at(0, 0)[0], Vec3::new(0.0, 0.6, 0.8).dot(to_light.as_vec3()), "turned");
    let normal = Vec3::from(out.frame.normal[0]);
    assert!((normal - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-5, "the layer has it too: {normal}");
}

#[test]
fn roughness_and_metalness_maps_are_the_material_with_those_numbers() {
    let lights = [Light::directional(DVec3::new(0.3, 0.2, 1.0)), Light::ambient([0.4; 3])];
    let maps = TextureMaps {
        metallic_roughness: texel([0.9, 0.5, 0.25]),
        ..TextureMaps::new(MapConvention::Gltf)
    };
    let base = Material::pbr([0.8, 0.4, 0.2], 0.8, 0.6);
    let mapped = base.clone().with_maps(Arc::new(maps) as Arc<dyn MaterialMaps>);
    let plain = Material::pbr([0.8, 0.4, 0.2], 0.8 * 0.25, 0.6 * 0.5);
    let mesh = sheet(1.0);
    let camera = camera(DVec3::new(1.0, 1.5, 2.0), 0.8);
    for path_tracing in [false, true] {
        let picture = |m: &Material| {
            let mut options = RenderOptions::new(40, 40);
            options.path_tracing = path_tracing;
            options.samples = 4;
            let sphere = (sphere(Vec3::new(0.0, 0.0, 0.4), 0.3, 16), Material::matte([0.9; 3]));
            draw(&scene(vec![(mesh.clone(), m.clone()), sphere], lights.to_vec()), &camera, options)
        };
        assert_eq!(
            difference(&picture(&mapped), &picture(&plain)),
            0.0,
            "path tracing {path_tracing}"
        );
        assert!(difference(&picture(&mapped), &picture(&base)) > 0.05, "they do something");
    }
}

#[test]
fn occlusion_dims_ambient_light_for_gltf_and_lamps_too_for_vtk() {
    let lights = [Light::directional(DVec3::Z).with_color([0.5; 3]), Light::ambient([0.25; 3])];
    for (convention, expected) in
        [(MapConvention::Gltf, 0.5 + 0.25 * 0.6), (MapConvention::Vtk, (0.5 + 0.25) * 0.6)]
    {
        let maps = TextureMaps {
            occlusion: texel([0.2, 1.0, 1.0]),
            occlusion_strength: 0.5,
            emission: texel([0.5, 1.0, 1.0]),
            ..TextureMaps::new(convention)
        };
        let m = Material::matte([1.0; 3])
            .with_emission([0.2; 3])
            .with_maps(Arc::new(maps) as Arc<dyn MaterialMaps>);
        close(middle(&sheet(1.0), &m, &lights, 5.0)[0], expected + 0.1, &format!("{convention:?}"));
    }
}

/// A roughness of 0 in one half: only that half is a mirror.
#[test]
fn a_map_that_makes_part_of_a_surface_a_mirror_sends_mirror_rays_there() {
    let mut texture = Texture::from_linear(2, 1, vec![[1.0, 0.0, 1.0, 1.0], [1.0; 4]]).unwrap();
    texture.filter = Filter::Nearest;
    let maps = TextureMaps {
        metallic_roughness: Some(texture.into()),
        ..TextureMaps::new(MapConvention::Gltf)
    };
    let m = Material::pbr([1.0; 3], 1.0, 0.8).with_maps(Arc::new(maps) as Arc<dyn MaterialMaps>);
    let s =
        scene(vec![(sheet(1.0), m), (floor(2.0, 3.0), Material::unlit([0.25, 0.5, 1.0]))], vec![]);
    assert!(
        Effects::required_by(&s).contains(Effects::REFLECTION.union(Effects::GLOSSY_REFLECTION))
    );
    let eye = Camera::orthographic(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0, 1.0, [0.0, 3.0]).unwrap();
    let mut options = RenderOptions::new(8, 8);
    options.samples = 16;
    let out = draw(&s, &eye, options);
    assert_eq!(out.frame.color_at(1, 4), [0.25, 0.5, 1.0, 1.0], "mirrored");
}

/// User-defined material maps are evaluated at meaningful points.
#[derive(Debug)]
struct Checked;

impl MaterialMaps for Checked {
    fn evaluate(&self, base: BsdfParameters, place: &MaterialEvalContext<'_>) -> BsdfParameters {
        let sphere = place.mesh.is_none();
        let expected = if sphere { place.point.as_vec3().normalize() } else { Vec3::Z };
        let right = (place.object_normal - expected).length() < 1e-5 && !place.flipped;
        let emission = if right { Vec3::new(0.25, f32::NAN, -1.0) } else { Vec3::splat(9.0) };
        BsdfParameters { emission, roughness: f32::NAN, normal: Vec3::ZERO, ..base }
    }
}

#[test]
fn custom_material_maps_cannot_put_nan_into_an_image() {
    let mut b = SceneBuilder::new();
    let m = b.material(Material {
        model: SurfaceModel::Metal { roughness: 0.5 },
        ..Material::matte([0.5; 3])
    });
    let detailed = b.material(
        Material::pbr([0.5; 3], 0.5, 0.5).with_maps(Arc::new(Checked) as Arc<dyn MaterialMaps>),
    );
    let spheres =
        rt_core::shapes::Spheres::new(vec![Vec3::ZERO], rt_core::shapes::Radii::Common(0.4))
            .unwrap();
    let g = b.geometry(rt_core::bvh::Geometry::Shape(Arc::new(spheres)));
    b.instance(g, DAffine3::IDENTITY, Appearance::new(detailed));
    let normals = Some(Attribute::per_face(vec![Vec3::Z; 2]));
    let plate =
        b.geometry(rt_core::bvh::Geometry::Mesh(Arc::new(TriMesh { normals, ..floor(-0.5, 2.0) })));
    b.instance(plate, DAffine3::IDENTITY, Appearance::new(detailed));
    b.instance(g, DAffine3::from_translation(DVec3::new(3.0, 0.0, 0.0)), Appearance::new(m));
    let s = b.build().unwrap();
    let out = draw(&s, &top_camera(5.0, 3.0), RenderOptions::new(24, 24));
    for c in &out.frame.color {
        assert!(c.iter().all(|v| v.is_finite()), "{c:?}");
        assert!((c[0] - 0.25).abs() < 0.2 && c[1] < 0.2, "{c:?}");
    }
}
