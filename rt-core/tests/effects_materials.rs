//! Materials, lights and colour sources against the formulas of OpenGL, VTK and glTF.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::bvh::Geometry;
use rt_core::colormap::ColorMap;
use rt_core::environment::{Background, Environment};
use rt_core::frame::Layers;
use rt_core::glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use rt_core::light::Light;
use rt_core::material::{ColorSource, Material, PbrForm, PhongForm, Sides, SurfaceModel};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::RenderOptions;
use rt_core::scene::{Appearance, SceneBuilder};
use rt_core::texture::{Filter, Texture};
use scenes_common::*;

/// Colour of the middle pixel of the floor z = 0 viewed from straight above (parallel), where x = y
/// = 0.
fn middle(mesh: TriMesh, material: Material, lights: Vec<Light>) -> [f32; 4] {
    draw(&scene(vec![(mesh, material)], lights), &top_camera(5.0, 0.001), RenderOptions::new(1, 1))
        .frame
        .color_at(0, 0)
}

fn close(a: f32, b: f32, what: &str) {
    assert!((a - b).abs() < 1e-5, "{what}: {a} instead of {b}");
}

#[test]
fn phong_highlights_are_opengl_s_and_vtk_s() {
    let to_light = DVec3::new(1.0, 0.0, 2.0).normalize();
    let light = Light {
        highlight_color: Some([0.5; 3]),
        ..Light::directional(to_light).with_color([0.8; 3])
    };
    let cos = to_light.z as f32;
    // View is +z. Half vector of view and light, and angle between mirrored light and view.
    let half = (to_light + DVec3::Z).normalize().z as f32;
    let mirrored = cos;
    for (highlight, base) in [(PhongForm::HalfVector, half), (PhongForm::Mirrored, mirrored)] {
        for shininess in [0.0, 1.0, 7.0, 12.5, 128.0] {
            let model = SurfaceModel::Phong {
                ambient: 0.3,
                diffuse: 0.6,
                specular: [0.9; 3],
                tinted: false,
                shininess,
                highlight,
                mirror: 0.0,
            };
            let m = Material { model, ..Material::matte([0.5; 3]) };
            let found = middle(floor(0.0, 1.0), m, vec![light, Light::ambient([0.25; 3])])[0];
            let expected =
                0.3 * 0.5 * 0.25 + 0.6 * 0.5 * 0.8 * cos + 0.9 * 0.5 * base.powf(shininess);
            close(found, expected, &format!("{highlight:?} {shininess}"));
        }
    }
}

#[test]
fn tinted_highlights_have_the_surfaces_colour() {
    let light = Light::directional(DVec3::Z).with_color([0.8; 3]);
    let of = |tinted: bool| {
        let model = SurfaceModel::Phong {
            ambient: 0.0,
            diffuse: 0.5,
            specular: [0.6; 3],
            tinted,
            shininess: 3.0,
            highlight: PhongForm::Mirrored,
            mirror: 0.0,
        };
        middle(
            floor(0.0, 1.0),
            Material { model, ..Material::matte([0.25, 0.5, 0.0]) },
            vec![light],
        )
    };
    let (plain, tinted) = (of(false), of(true));
    for (k, color) in [0.25, 0.5, 0.0].into_iter().enumerate() {
        close(plain[k], 0.8 * (0.5 * color + 0.6), "plain");
        close(tinted[k], 0.8 * (0.5 * color + 0.6 * color), "tinted");
    }
}

#[test]
fn vtks_headlight_lights_physically_based_surfaces_along_the_ray() {
    // The light comes from the side; VTK's shader puts it at the eye.
    let aside = Light::directional(DVec3::new(1.0, 0.0, 1.0));
    let of = |headlight: bool, light: Light| {
        let form = PbrForm::Vtk { min_divisor: 0.0, headlight };
        let model = SurfaceModel::Pbr { metallic: 0.3, roughness: 0.5, specular: 0.04, form };
        middle(floor(0.0, 1.0), Material { model, ..Material::matte([0.5; 3]) }, vec![light])[0]
    };
    let along = of(false, Light::directional(DVec3::Z));
    close(of(true, aside), along, "along the ray");
    assert!((of(false, aside) - along).abs() > 0.01);
}

#[test]
fn attenuation_and_spots_follow_opengl() {
    let at = DVec3::new(0.0, 0.0, 2.0);
    let attenuated = Light { attenuation: [1.0, 0.5, 0.25], ..Light::point(at) };
    close(
        middle(floor(0.0, 1.0), Material::matte([1.0; 3]), vec![attenuated])[0],
        1.0 / 3.0,
        "1 + 0.5 d + 0.25 d²",
    );
    // Axis 30° off the surface point.
    let axis = DVec3::new(0.5, 0.0, -(0.75f64.sqrt()));
    let spot = |cutoff: f64, exponent: f64| {
        let mut l = Light::spot(at, axis, cutoff);
        if let rt_core::light::LightKind::Spot { exponent: e, .. } = &mut l.kind {
            *e = exponent;
        }
        middle(floor(0.0, 1.0), Material::matte([1.0; 3]), vec![l])[0]
    };
    close(spot(0.6, 0.0), 1.0, "inside the cone");
    close(spot(0.5, 0.0), 0.0, "outside the cone");
    close(spot(0.6, 4.0), 0.75f32.powi(2), "cos 30° to the 4th");
    // A disk emits with the cosine to its normal.
    let disk = Light::disk(at, axis, 1e-6);
    close(
        middle(floor(0.0, 1.0), Material::matte([1.0; 3]), vec![disk])[0],
        0.75f32.sqrt(),
        "disk",
    );
}

#[test]
fn lights_in_the_camera_frame_move_with_it() {
    let side = Light::directional(DVec3::new(1.0, 0.0, 1.0)).in_camera_frame().without_shadows();
    let s = scene(vec![(sphere(Vec3::ZERO, 1.0, 32), Material::matte([1.0; 3]))], vec![side]);
    let eyes = [DVec3::new(5.0, 0.0, 0.0), DVec3::new(0.0, 5.0, 0.0), DVec3::new(-3.0, 4.0, 0.0)];
    let pictures: Vec<_> =
        eyes.iter().map(|e| draw(&s, &camera(*e, 0.5), RenderOptions::new(33, 33))).collect();
    for p in &pictures[1..] {
        // The sphere is facetted: silhouettes differ slightly, the interior must not.
        let inner = |o: &rt_core::render::RenderOutput, x| o.frame.color_at(x, 16)[0];
        for x in 8..26 {
            assert!((inner(&pictures[0], x) - inner(p, x)).abs() < 0.02, "{x}");
        }
    }
    assert!(
        pictures[0].frame.color_at(22, 16)[0] > pictures[0].frame.color_at(10, 16)[0] + 0.2,
        "lit from the right"
    );
}

#[test]
fn environment_lights_by_its_cosine_weighted_mean() {
    // Up is +z, like the normal: bottom + (top - bottom)(1/2 + 1/3).
    let mut s = scene(vec![(floor(0.0, 1.0), Material::matte([0.5; 3]))], vec![]);
    s.environment = Some(Environment::Gradient { bottom: [0.2; 3], top: [0.8; 3], up: Vec3::Z });
    let found = draw(&s, &top_camera(5.0, 1.0), RenderOptions::new(2, 2)).frame.color_at(0, 0)[0];
    close(found, 0.5 * (0.2 + 0.6 * (0.5 + 1.0 / 3.0)), "gradient");
}

#[test]
fn scalars_are_interpolated_first_and_mapped_then() {
    // A map that is black except for a narrow white band in the middle. Colours mapped at the
    // vertices would be black everywhere.
    let mut colors = vec![[0.0, 0.0, 0.0, 1.0]; 101];
    colors[50] = [1.0; 4];
    let mut mesh = floor(0.0, 1.0);
    mesh.scalars = Some(Attribute::per_vertex(mesh.positions.iter().map(|p| p.x).collect()));
    let m = Material::unlit([1.0, 0.0, 0.0]).colored_by_scalars(ColorMap::new(colors, [-1.0, 1.0]));
    let p = middle(mesh.clone(), m.clone(), vec![]);
    assert!(p[0] > 0.95 && p[1] > 0.95, "{p:?}");
    // Without scalars the constant colour is used, with a warning.
    mesh.scalars = None;
    let o = draw(&scene(vec![(mesh, m)], vec![]), &top_camera(5.0, 1.0), RenderOptions::new(2, 2));
    assert_eq!(o.frame.color_at(0, 0), [1.0, 0.0, 0.0, 1.0]);
    assert!(
        o.report.warnings.iter().any(|w| w.contains("material 0") && w.contains("scalars")),
        "{:?}",
        o.report.warnings
    );
}

#[test]
fn colour_sources_of_meshes() {
    let mut mesh = floor(0.0, 1.0);
    // The camera looks at x = 0: the middle of the square lies on the diagonal of both triangles.
    mesh.colors = Some(Attribute::per_vertex(
        mesh.positions.iter().map(|p| [p.x + 0.5, 0.5 * p.y, 0.25, 1.0]).collect(),
    ));
    let p = middle(mesh.clone(), Material::unlit([0.0; 3]), vec![]);
    assert!((p[0] - 0.5).abs() < 1e-3 && p[1].abs() < 1e-3 && p[2] == 0.25, "{p:?}");
    let constant = Material { color_source: ColorSource::Constant, ..Material::unlit([0.7; 3]) };
    assert_eq!(middle(mesh.clone(), constant, vec![])[0], 0.7);
    // Per triangle.
    mesh.colors = Some(Attribute::per_face(vec![[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]]));
    let o = draw(
        &scene(vec![(mesh.clone(), Material::unlit([0.0; 3]))], vec![]),
        &top_camera(5.0, 2.0),
        RenderOptions::new(2, 2),
    );
    assert_eq!(o.frame.color_at(1, 1), [1.0, 0.0, 0.0, 1.0], "first triangle: lower right");
    assert_eq!(o.frame.color_at(0, 0), [0.0, 1.0, 0.0, 1.0], "second triangle: upper left");
    // The alpha of vertex colours alone makes the mesh transparent.
    mesh.colors = Some(Attribute::per_face(vec![[1.0, 1.0, 1.0, 0.5]; 2]));
    assert_eq!(middle(mesh, Material::unlit([0.0; 3]), vec![]), [0.5, 0.5, 0.5, 0.5]);
    // Texture, modulated by the colour.
    let mut mesh = floor(0.0, 1.0);
    mesh.texcoords =
        Some(mesh.positions.iter().map(|p| Vec2::new(0.5 + 0.5 * p.x, 0.5 + 0.5 * p.y)).collect());
    let mut t = Texture::from_linear(
        2,
        2,
        vec![[0.1, 0.1, 0.1, 1.0], [0.2; 4], [0.3, 0.3, 0.3, 1.0], [0.4, 0.4, 0.4, 1.0]],
    )
    .unwrap();
    t.filter = Filter::Nearest;
    let m = Material::unlit([1.0, 0.5, 0.0]).textured(t);
    let o = draw(&scene(vec![(mesh, m)], vec![]), &top_camera(5.0, 2.0), RenderOptions::new(2, 2));
    assert_eq!(
        o.frame.color_at(0, 1),
        [0.1, 0.05, 0.0, 1.0],
        "row 0 of the texture is at the bottom"
    );
    assert_eq!(o.frame.color_at(1, 0), [0.4, 0.2, 0.0, 1.0]);
    let p = o.frame.color_at(1, 1);
    assert!(
        (p[0] - 0.04).abs() < 1e-7 && p[3] == 0.2,
        "texture alpha is opacity, colour premultiplied: {p:?}"
    );
}

#[test]
fn recolouring_needs_no_new_world() {
    let mut b = SceneBuilder::new();
    let mesh = floor(0.0, 1.0);
    let (g, m) = (b.geometry(Geometry::Mesh(mesh.into())), b.material(Material::unlit([1.0; 3])));
    let colors = Attribute::per_face(vec![[0.0, 0.0, 1.0, 0.25]; 2]);
    b.instance(g, DAffine3::IDENTITY, Appearance::new(m).with_colors(colors));
    b.instance(g, DAffine3::from_translation(DVec3::new(0.0, 0.0, -1.0)), Appearance::new(m));
    let mut s = b.build().unwrap();
    let look = |s: &rt_core::scene::Scene| {
        draw(s, &top_camera(5.0, 1.0), RenderOptions::new(2, 2)).frame.color_at(0, 0)
    };
    assert_eq!(look(&s), [0.75, 0.75, 1.0, 1.0]);
    s.appearances[0] =
        Appearance::new(m).with_colors(Attribute::per_face(vec![[0.0, 1.0, 0.0, 1.0]; 2]));
    assert_eq!(look(&s), [0.0, 1.0, 0.0, 1.0]);
    s.appearances[0] = Appearance::new(m).with_colors(Attribute::per_face(vec![[0.0; 4]; 3]));
    let e = rt_core::render::render(&s, &top_camera(5.0, 1.0), &RenderOptions::new(2, 2))
        .unwrap_err()
        .to_string();
    assert!(
        e.contains("appearance 0") && e.contains("colors") && e.contains('3') && e.contains('2'),
        "{e}"
    );
}

#[test]
fn sides_choose_the_normal_and_what_is_dark() {
    // Viewed from the back, with the light at the viewer.
    let mut back = floor(0.0, 1.0);
    back.indices.iter_mut().for_each(|t| t.swap(0, 1));
    let lit = |mesh: &TriMesh, sides| {
        middle(mesh.clone(), Material::matte([1.0; 3]).with_sides(sides), vec![Light::headlight()])
            [0]
    };
    assert_eq!(
        (lit(&back, Sides::Both), lit(&back, Sides::BothByNormal), lit(&back, Sides::LitOutside)),
        (1.0, 1.0, 0.0)
    );
    // Shading normals that disagree with the winding: Both uses the geometry, BothByNormal the
    // normal itself.
    back.normals = Some(Attribute::per_vertex(vec![Vec3::Z; 4]));
    assert_eq!(
        (lit(&back, Sides::Both), lit(&back, Sides::BothByNormal), lit(&back, Sides::LitOutside)),
        (0.0, 1.0, 1.0)
    );
    let flat = Material { flat: true, ..Material::matte([1.0; 3]) };
    assert_eq!(middle(back, flat, vec![Light::headlight()])[0], 1.0);
}

#[test]
fn normals_of_squeezed_and_mirrored_instances() {
    // A unit sphere scaled to an ellipsoid: normals must be those of the ellipsoid, and outward
    // even when mirrored.
    for scale in [DVec3::new(2.0, 1.0, 0.5), DVec3::new(-2.0, 1.0, 0.5)] {
        let mut b = SceneBuilder::new();
        let g = b.geometry(Geometry::Mesh(sphere(Vec3::ZERO, 1.0, 64).into()));
        let m = b.material(Material::matte([1.0; 3]).with_sides(Sides::LitOutside));
        let turn = DMat3::from_rotation_y(0.7);
        let matrix = turn * DMat3::from_diagonal(scale);
        b.instance(
            g,
            DAffine3 { matrix3: matrix, translation: DVec3::new(10.0, 20.0, 30.0) },
            Appearance::new(m),
        );
        b.light(Light::headlight());
        let s = b.build().unwrap();
        let center = DVec3::new(10.0, 20.0, 30.0);
        let c = rt_core::camera::Camera::perspective(
            center + DVec3::new(1.0, -6.0, 2.0),
            center,
            DVec3::Z,
            0.6,
            1.0,
            [0.1, 20.0],
        )
        .unwrap();
        let o = draw(&s, &c, RenderOptions { layers: Layers::ALL, ..RenderOptions::new(32, 32) });
        let mut checked = 0;
        for y in 0..32 {
            for x in 0..32 {
                let i = o.frame.index(x, y);
                if o.frame.distance[i].is_infinite() {
                    continue;
                }
                let (origin, dir) = c.world_ray(rt_core::camera::Camera::ndc_of_pixel(
                    x as f64 + 0.5,
                    y as f64 + 0.5,
                    [32, 32],
                ));
                let p = origin + dir.normalize() * o.frame.distance[i] as f64 - center;
                let local = matrix.inverse() * p;
                let expected = (matrix.inverse().transpose() * local).normalize();
                let found = Vec3::from(o.frame.normal[i]).as_dvec3();
                assert!(found.dot(expected) > 0.999, "{x} {y}: {found} {expected}");
                assert!(o.frame.color[i][0] > 0.0 || expected.dot(-dir) < 0.05, "outside is lit");
                checked += 1;
            }
        }
        assert!(checked > 60, "{checked}");
    }
}

#[test]
fn backgrounds_fill_what_is_uncovered() {
    let mut s = scene(vec![], vec![]);
    let c = top_camera(5.0, 1.0);
    let look =
        |s: &rt_core::scene::Scene, y| draw(s, &c, RenderOptions::new(4, 4)).frame.color_at(1, y);
    s.background = Background::Constant([0.5, 1.0, 0.0, 0.5]);
    assert_eq!(look(&s, 0), [0.25, 0.5, 0.0, 0.5]);
    s.background = Background::Gradient { bottom: [0.0; 3], top: [1.0; 3] };
    assert_eq!((look(&s, 0)[0], look(&s, 3)[0]), (0.875, 0.125));
    s.background = Background::Environment;
    let o = draw(&s, &c, RenderOptions::new(4, 4));
    assert!(
        o.frame.color_at(0, 0)[3] == 0.0
            && o.report.warnings.iter().any(|w| w.contains("background"))
    );
    s.environment = Some(Environment::Constant([0.3; 3]));
    assert_eq!(look(&s, 2), [0.3, 0.3, 0.3, 1.0]);
}

#[test]
fn emission_needs_no_light() {
    let p =
        middle(floor(0.0, 1.0), Material::matte([1.0; 3]).with_emission([0.1, 0.2, 3.0]), vec![]);
    assert_eq!(p, [0.1, 0.2, 3.0, 1.0]);
}
