//! Scenes with light across borders of parts.
use rt_core::bvh::Geometry;
use rt_core::camera::Camera;
use rt_core::colormap::ColorMap;
use rt_core::environment::Background;
use rt_core::frame::Layers;
use rt_core::glam::{DAffine3, DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::light::Light;
use rt_core::material::{ColorSource, Material};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::RenderOptions;
use rt_core::scene::{AmbientOcclusion, Appearance, Scene, SceneBuilder, VolumeInstance};
use rt_core::shapes::{Cylinders, Radii, Spheres, Tubes};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Interpolation, Volume, VolumeOptions, VolumeShading};
use std::sync::Arc;

/// A scene with a view of it.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) scene: Scene,
    pub(crate) camera: Camera,
    pub(crate) options: RenderOptions,
}

/// Bumps over a square of 4 x 4 that are vertical in places, with smooth normals and a colour per
/// triangle.
pub(crate) fn bumps(shift: DVec3, cells: u32) -> TriMesh {
    let n = cells + 1;
    let at = |k: u32| {
        let (x, y) =
            ((k % n) as f32 / cells as f32 * 4.0 - 2.0, (k / n) as f32 / cells as f32 * 4.0 - 2.0);
        Vec3::new(x, y, 0.5 * (4.0 * x).sin() * (3.5 * y).cos())
    };
    let mut mesh = TriMesh::new((0..n * n).map(at).collect(), vec![]);
    mesh.origin = shift;
    for j in 0..cells {
        for i in 0..cells {
            let k = j * n + i;
            mesh.indices.extend([[k, k + 1, k + n], [k + 1, k + n + 1, k + n]]);
        }
    }
    let up = |k: u32| (at(k) * Vec3::new(0.3, 0.3, 0.0) + Vec3::Z).normalize();
    mesh.normals = Some(Attribute::per_vertex((0..n * n).map(up).collect()));
    let color = |k: usize| [0.3 + 0.7 * (k % 7) as f32 / 7.0, 0.8, 0.5, 1.0];
    mesh.colors = Some(Attribute::per_face((0..mesh.indices.len()).map(color).collect()));
    mesh
}

pub(crate) fn camera(shift: DVec3) -> Camera {
    let eye = shift + DVec3::new(2.5, -4.0, 3.0);
    Camera::perspective(eye, shift + DVec3::new(0.0, 0.0, 0.3), DVec3::Z, 0.8, 1.25, [0.1, 100.0])
        .unwrap()
}

pub(crate) fn scene(
    shift: DVec3,
    ground: Material,
    balls: Option<Material>,
    lights: &[Light],
    ao: Option<f64>,
) -> Scene {
    let mut b = SceneBuilder::new();
    b.mesh(bumps(shift, 48), ground);
    if let Some(balls) = balls {
        let m = b.material(balls);
        let center = |k: i32| {
            let a = f64::from(k) * 0.7;
            DVec3::new(1.5 * a.cos(), 1.5 * (1.3 * a).sin(), 0.7 + 0.05 * f64::from(k))
        };
        let centers: Vec<DVec3> = (0..24).map(center).collect();
        let spheres = Spheres::from_f64_centers(&centers, Radii::Common(0.28)).unwrap();
        let g = b.geometry(Geometry::Shape(Arc::new(spheres)));
        for k in 0..2 {
            let turned = DAffine3::from_rotation_z(1.0 + 2.0 * f64::from(k));
            b.instance(g, DAffine3::from_translation(shift) * turned, Appearance::new(m));
        }
    }
    for l in lights {
        b.light(*l);
    }
    let mut scene = b.build().unwrap();
    scene.ambient_occlusion = ao.map(|distance| AmbientOcclusion { distance, rays: 12 });
    scene.background = Background::Gradient { bottom: [0.1, 0.1, 0.2], top: [0.6, 0.7, 0.9] };
    scene
}

pub(crate) fn matte() -> Material {
    Material::matte([0.7, 0.6, 0.5])
}

pub(crate) fn options() -> RenderOptions {
    RenderOptions { layers: Layers::ALL, ..RenderOptions::new(150, 121) }
}

pub(crate) const AMBIENT: [f32; 3] = [0.3; 3];

/// Shadows, area lights and ambient occlusion, with a light at a finite position: tests the
/// exchange of occlusion bits.
pub(crate) fn shadows_and_occlusion(shift: DVec3) -> Case {
    let lamp = Light::point(shift + DVec3::new(1.0, 1.0, 4.0));
    let sun = Light::directional(DVec3::new(0.6, -0.3, 0.7))
        .with_color([0.7; 3])
        .with_size(0.05)
        .unwrap();
    let lights = [lamp, sun, Light::ambient(AMBIENT)];
    Case {
        name: "shadows, area light, ambient occlusion",
        scene: scene(shift, matte(), Some(matte()), &lights, Some(0.6)),
        camera: camera(shift),
        options: options(),
    }
}

/// Ambient occlusion alone, on triangles alone: the case of ghost zones.
pub(crate) fn occlusion_alone() -> Case {
    let lights = [Light::ambient(AMBIENT)];
    Case {
        name: "ambient occlusion alone",
        scene: scene(DVec3::ZERO, matte(), None, &lights, Some(0.4)),
        camera: camera(DVec3::ZERO),
        options: options(),
    }
}

/// A shaded volume around the surfaces, also visible through glass and layers; and one alone.
pub(crate) fn volumes() -> Vec<Case> {
    let dims = UVec3::new(41, 37, 29);
    let value = |k: u32| {
        let (x, y, z) = (k % dims.x, k / dims.x % dims.y, k / dims.x / dims.y);
        let at = Vec3::new(x as f32, y as f32, z as f32) * 0.3;
        // Transparent in one corner, and one point is missing.
        let v =
            if x < 12 && y < 15 { 0.0 } else { 0.5 + 0.5 * at.x.sin() * at.y.cos() * at.z.sin() };
        if k == 20_000 { f32::NAN } else { v }
    };
    let grid = || {
        let values = (0..dims.element_product()).map(value).collect();
        Grid::new(dims, DVec3::new(-2.0, -1.8, -0.7), DVec3::new(0.1, 0.1, 0.06), values).unwrap()
    };
    let volume = |shading, interpolation| {
        let colors = ColorMap::new(vec![[0.1, 0.2, 0.9, 1.0], [1.0, 0.8, 0.1, 1.0]], [0.0, 1.0]);
        let transfer =
            TransferFunction::from_opacity(colors, &[[0.2, 0.0], [0.6, 0.3], [1.0, 0.9]], 0.4)
                .unwrap();
        Volume::new(
            grid().into(),
            transfer,
            VolumeOptions { shading, interpolation, ..VolumeOptions::default() },
        )
        .unwrap()
    };
    let shading = VolumeShading {
        ambient: 0.3,
        diffuse: 0.7,
        specular: 0.4,
        shininess: 9.0,
        light: None,
        half_gradient: 1.0,
        ..VolumeShading::default()
    };
    let sun = Light::directional(DVec3::new(0.4, -0.3, 1.0));
    let camera = camera(DVec3::ZERO);
    let mut out = Vec::new();
    for (name, balls, volume) in [
        (
            "volume around mirrors and glass",
            Some(Material::dielectric(1.5)),
            volume(Some(shading), Interpolation::Linear),
        ),
        (
            "volume around layers",
            Some(matte().with_opacity(0.4)),
            volume(None, Interpolation::Nearest),
        ),
    ] {
        let mut scene =
            scene(DVec3::ZERO, matte(), balls, &[sun, Light::ambient(AMBIENT)], Some(0.5));
        scene
            .volumes
            .push(VolumeInstance { volume: volume.into(), world_from_object: DAffine3::IDENTITY });
        out.push(Case { name, scene, camera, options: RenderOptions { samples: 2, ..options() } });
    }
    let mut b = SceneBuilder::new();
    b.volume(volume(Some(shading), Interpolation::Nearest));
    let options = RenderOptions { layers: Layers::COLOR, ..options() };
    out.push(Case { name: "volume alone", scene: b.build().unwrap(), camera, options });
    out
}

/// Streamtubes, cylinders and spheres, of which each part holds only its own.
pub(crate) fn arrays_of_shapes() -> Case {
    let mut b = SceneBuilder::new();
    let (mut points, mut offsets, mut radii) = (Vec::new(), vec![0], Vec::new());
    for line in 0..40 {
        // Segments much shorter than the radius, too: their neighbours hide what is inside.
        let (n, turns) = if line % 3 == 0 { (200, 2.0) } else { (12 + line % 7, 6.0) };
        for k in 0..n {
            let s = k as f32 / n as f32;
            let a = turns * s + 0.4 * line as f32;
            points.push(Vec3::new(
                1.8 * a.cos() * s,
                1.8 * a.sin() * s,
                0.4 + 0.03 * line as f32 + 0.4 * s,
            ));
            radii.push(0.03 + 0.02 * (9.0 * s).sin());
        }
        offsets.push(points.len() as u32);
    }
    let scalars = (0..points.len()).map(|k| (k % 19) as f32 / 19.0).collect();
    let tubes =
        Tubes::new(points, &offsets, Radii::Each(radii)).unwrap().with_scalars(scalars).unwrap();
    let colors = ColorMap::new(vec![[0.1, 0.2, 0.9, 1.0], [1.0, 0.8, 0.1, 1.0]], [0.0, 1.0]);
    b.shape(
        Arc::new(tubes),
        Material { color_source: ColorSource::Scalars(colors.into()), ..matte() },
    );
    let ends: Vec<Vec3> =
        (0..60).map(|k| Vec3::new(-2.0 + 0.06 * k as f32, -1.5, 0.3 * (k % 4) as f32)).collect();
    b.shape(Arc::new(Cylinders::new(ends, Radii::Common(0.05), true).unwrap()), matte());
    let centers: Vec<Vec3> =
        (0..90).map(|k| Vec3::new(1.5, -1.5 + 0.033 * k as f32, 0.9)).collect();
    let shades = (0..90).map(|k| [k as f32 / 90.0, 0.5, 0.3, 1.0]).collect();
    let spheres = Spheres::new(centers, Radii::Common(0.07)).unwrap().with_colors(shades).unwrap();
    b.shape(Arc::new(spheres), matte());
    b.light(Light::directional(DVec3::new(0.4, -0.3, 1.0)));
    b.light(Light::ambient(AMBIENT));
    let mut scene = b.build().unwrap();
    scene.ambient_occlusion = Some(AmbientOcclusion { distance: 0.6, rays: 6 });
    Case { name: "arrays of shapes", scene, camera: camera(DVec3::ZERO), options: options() }
}

/// No secondary ray leaves a hit.
pub(crate) fn headlight(samples: u32) -> Case {
    Case {
        name: "headlight",
        scene: scene(DVec3::ZERO, matte(), Some(matte()), &[Light::headlight()], None),
        camera: camera(DVec3::ZERO),
        options: RenderOptions { samples, ..options() },
    }
}

/// Several bounces: mirror, gloss and glass, transparent layers, paths.
pub(crate) fn several_bounces() -> Vec<Case> {
    let sun = Light::directional(DVec3::new(0.4, -0.3, 1.0));
    let ambient = Light::ambient(AMBIENT);
    let small =
        || RenderOptions { samples: 2, ..RenderOptions { width: 75, height: 61, ..options() } };
    let metal = Material::metal([0.9, 0.8, 0.7], 0.15);
    let case = |name, scene, options| Case { name, scene, camera: camera(DVec3::ZERO), options };
    vec![
        case(
            "gloss and glass",
            scene(DVec3::ZERO, metal, Some(Material::dielectric(1.5)), &[sun, ambient], Some(1.0)),
            small(),
        ),
        case(
            "transparent layers",
            scene(
                DVec3::ZERO,
                matte(),
                Some(matte().with_opacity(0.4)),
                &[sun, ambient],
                Some(0.5),
            ),
            RenderOptions { depth_min_opacity: 0.7, ..small() },
        ),
        case(
            "paths",
            scene(
                DVec3::ZERO,
                matte(),
                Some(Material::metal([0.9; 3], 0.0)),
                &[sun, ambient],
                None,
            ),
            RenderOptions { path_tracing: true, max_bounces: Some(4), ..small() },
        ),
    ]
}
