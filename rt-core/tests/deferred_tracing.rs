//! Frames whose rays are traced in several parts of the scene have the same bits as frames of the
//! whole scene.
#![cfg(feature = "render")]

use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::{Camera, ThinLens};
use rt_core::deferred::{
    CameraHits, DeferredFrame, LightHit, OcclusionScratch, Pass, ShadingHit, TileState,
};
use rt_core::effects::Effects;
use rt_core::environment::{Background, Environment};
use rt_core::frame::{Frame, Layers};
use rt_core::glam::{DAffine3, DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::{Crop, RenderOptions, render};
use rt_core::scene::{AmbientOcclusion, Scene, SceneBuilder};
use rt_core::shapes::{Radii, Spheres};
use std::sync::Arc;

/// A bumpy plate with colours and smooth normals, `shift` away from the origin.
fn plate(shift: DVec3, cells: u32) -> TriMesh {
    let n = cells + 1;
    let at = |i: u32, j: u32| {
        let (x, y) = (i as f32 / cells as f32 * 4.0 - 2.0, j as f32 / cells as f32 * 4.0 - 2.0);
        Vec3::new(x, y, 0.4 * (3.0 * x).sin() * (2.5 * y).cos())
    };
    let grid = |f: &dyn Fn(u32, u32) -> Vec3| -> Vec<Vec3> {
        (0..n * n).map(|k| f(k % n, k / n)).collect()
    };
    let mut mesh = TriMesh::new(grid(&at), vec![]);
    mesh.origin = shift;
    for j in 0..cells {
        for i in 0..cells {
            let k = j * n + i;
            mesh.indices.extend([[k, k + 1, k + n], [k + 1, k + n + 1, k + n]]);
        }
    }
    let up = |i: u32, j: u32| (at(i, j) * Vec3::new(0.3, 0.3, 0.0) + Vec3::Z).normalize();
    mesh.normals = Some(Attribute::per_vertex(grid(&up)));
    let colors = (0..mesh.indices.len())
        .map(|k| [0.3 + 0.7 * (k % 7) as f32 / 7.0, 0.8, 0.5, 1.0])
        .collect();
    mesh.colors = Some(Attribute::per_face(colors));
    mesh
}

fn spheres() -> Spheres {
    let centers: Vec<DVec3> = (0..24)
        .map(|k| {
            let a = k as f64 * 0.7;
            DVec3::new(1.5 * a.cos(), 1.5 * (1.3 * a).sin(), 0.7 + 0.05 * k as f64)
        })
        .collect();
    Spheres::from_f64_centers(&centers, Radii::Common(0.28)).unwrap()
}

struct Case {
    name: &'static str,
    scene: Scene,
    camera: Camera,
    options: RenderOptions,
}

fn camera(shift: DVec3) -> Camera {
    let eye = shift + DVec3::new(2.5, -4.0, 3.0);
    Camera::perspective(eye, shift + DVec3::new(0.0, 0.0, 0.3), DVec3::Z, 0.8, 1.25, [0.1, 100.0])
        .unwrap()
}

fn scene(
    shift: DVec3,
    plate_is: Material,
    balls_are: Material,
    lights: &[Light],
    ao: Option<f64>,
) -> Scene {
    let mut b = SceneBuilder::new();
    b.mesh(plate(shift, 40), plate_is);
    let m = b.material(balls_are);
    let g = b.geometry(rt_core::bvh::Geometry::Shape(Arc::new(spheres())));
    for k in 0..2 {
        let turned = DAffine3::from_rotation_z(1.0 + 2.0 * k as f64);
        b.instance(
            g,
            DAffine3::from_translation(shift) * turned,
            rt_core::scene::Appearance::new(m),
        );
    }
    for l in lights {
        b.light(*l);
    }
    let mut scene = b.build().unwrap();
    scene.ambient_occlusion = ao.map(|distance| AmbientOcclusion { distance, rays: 9 });
    scene.background = Background::Gradient { bottom: [0.1, 0.1, 0.2], top: [0.6, 0.7, 0.9] };
    scene
}

fn cases() -> Vec<Case> {
    let matte = || Material::matte([0.7, 0.6, 0.5]);
    let lamp = Light::point(DVec3::new(1.0, 1.0, 4.0));
    let sun = Light::directional(DVec3::new(0.4, -0.3, 1.0)).with_color([0.7; 3]);
    let ambient = Light::ambient([0.3; 3]);
    let options = || RenderOptions { layers: Layers::ALL, ..RenderOptions::new(75, 60) };
    let zero = DVec3::ZERO;
    let far = DVec3::new(4e6, -3e6, 1e6);
    let near_lamp = |shift: DVec3| Light::point(shift + DVec3::new(1.0, 1.0, 4.0));
    let glass = Material::dielectric(1.5);
    let mut out = vec![
        Case {
            name: "headlight only",
            scene: scene(zero, matte(), matte(), &[Light::headlight()], None),
            camera: camera(zero),
            options: options(),
        },
        Case {
            name: "headlight, nine samples",
            scene: scene(
                zero,
                matte(),
                matte(),
                &[Light::headlight(), lamp.without_shadows()],
                None,
            ),
            camera: camera(zero),
            options: RenderOptions { samples: 9, ..options() },
        },
        Case {
            name: "hard and soft shadows, ambient occlusion",
            scene: scene(
                zero,
                matte(),
                matte(),
                &[lamp, sun.with_size(0.05).unwrap(), ambient],
                Some(0.6),
            ),
            camera: camera(zero),
            options: options(),
        },
        Case {
            name: "far from the origin, unlimited ambient occlusion, three samples",
            scene: scene(far, matte(), matte(), &[near_lamp(far), ambient], Some(f64::INFINITY)),
            camera: camera(far),
            options: RenderOptions { samples: 3, ..options() },
        },
        Case {
            name: "mirror, gloss and glass",
            scene: scene(
                zero,
                Material::metal([0.9, 0.8, 0.7], 0.15),
                glass.clone(),
                &[sun, ambient],
                Some(1.0),
            ),
            camera: camera(zero),
            options: RenderOptions { samples: 2, ..options() },
        },
        Case {
            name: "transparent layers with coloured shadows, depth of the opaque ones",
            scene: scene(zero, matte(), matte().with_opacity(0.4), &[lamp, ambient], Some(0.5)),
            camera: camera(zero),
            options: RenderOptions { depth_min_opacity: 0.7, ..options() },
        },
        Case {
            name: "transparent layers, several samples through a lens",
            scene: scene(zero, matte().with_opacity(0.6), matte(), &[lamp, ambient], None),
            camera: camera(zero)
                .with_lens(ThinLens { aperture_radius: 0.05, focus_distance: 5.0 })
                .unwrap(),
            options: RenderOptions { samples: 3, ..options() },
        },
        Case {
            name: "path tracing",
            scene: scene(zero, matte(), Material::metal([0.9; 3], 0.0), &[sun], None),
            camera: camera(zero),
            options: RenderOptions {
                path_tracing: true,
                samples: 3,
                max_bounces: Some(5),
                ..options()
            },
        },
    ];
    let path = out.last_mut().unwrap();
    path.scene.environment = Some(Environment::Constant([0.4, 0.5, 0.6]));
    out
}

/// Distributes primitives to `parts` at random. With more parts than primitives, some are empty.
fn deal(scene: &Scene, parts: usize, seed: u32) -> Vec<Vec<Vec<u32>>> {
    let mut out = vec![vec![vec![]; scene.world.geometries().len()]; parts];
    for (g, geometry) in scene.world.geometries().iter().enumerate() {
        let count = geometry.num_primitives();
        for k in 0..count as u32 {
            let mut x = k.wrapping_mul(0x9e37_79b9) ^ seed;
            x ^= x >> 15;
            x = x.wrapping_mul(0x85eb_ca6b);
            out[(x >> 16) as usize % parts][g].push(k);
        }
    }
    out
}

struct Holder<'a> {
    frame: DeferredFrame<'a>,
    kept: &'a [Vec<u32>],
}

impl Holder<'_> {
    fn in_whole(&self, scene: &Scene, mut met: ShadingHit) -> ShadingHit {
        let geometry = scene.world.instances()[met.instance as usize].geometry;
        met.primitive = self.kept[geometry][met.primitive as usize];
        met
    }
}

/// Nearer, or at the same distance with a lower instance and primitive.
fn is_before(a: &ShadingHit, b: &ShadingHit) -> bool {
    let key = |m: &ShadingHit| (m.instance, m.primitive);
    a.t < b.t || (a.t == b.t && key(a) < key(b))
}

fn nearer(best: &mut Option<ShadingHit>, met: Option<ShadingHit>) {
    if let Some(m) = met
        && best.as_ref().is_none_or(|b| is_before(&m, b))
    {
        *best = Some(m);
    }
}

/// Merges the hits of light rays from all parts. A ray that one of them reports as blocked is
/// blocked.
fn light_hits(
    holders: &[Holder<'_>],
    scene: &Scene,
    rays: &[rt_core::ray::Ray],
) -> Vec<Option<LightHit>> {
    let mut best = vec![None; rays.len()];
    let mut blocked = vec![false; rays.len()];
    let mut met = Vec::new();
    for h in holders {
        h.frame.light_hits(rays, &mut met);
        for (i, m) in met.iter().enumerate() {
            match m {
                Some(LightHit::Blocked) => blocked[i] = true,
                Some(LightHit::Surface(m)) => nearer(&mut best[i], Some(h.in_whole(scene, *m))),
                None => {}
            }
        }
    }
    let one = |(hit, blocked): (Option<ShadingHit>, bool)| {
        if blocked { Some(LightHit::Blocked) } else { hit.map(LightHit::Surface) }
    };
    best.into_iter().zip(blocked).map(one).collect()
}

fn closest(
    holders: &[Holder<'_>],
    scene: &Scene,
    rays: &[rt_core::ray::Ray],
    pixels: Option<&[(u32, u16)]>,
) -> Vec<Option<ShadingHit>> {
    let mut best = vec![None; rays.len()];
    let mut met = Vec::new();
    for h in holders {
        h.frame.closest(rays, pixels, &mut met);
        for (b, m) in best.iter_mut().zip(&met) {
            nearer(b, m.map(|m| h.in_whole(scene, m)));
        }
    }
    best
}

fn in_parts(case: &Case, parts: usize, seed: u32) -> Frame {
    let kept = deal(&case.scene, parts, seed);
    let options = BuildOptions::default();
    let scenes: Vec<Scene> = kept.iter().map(|k| case.scene.part(k, &options).unwrap()).collect();
    let needed = Effects::required_by(&case.scene);
    let holders: Vec<Holder<'_>> = scenes
        .iter()
        .zip(&kept)
        .map(|(s, kept)| Holder {
            frame: DeferredFrame::new(s, needed, &case.camera, &case.options).unwrap(),
            kept,
        })
        .collect();
    let owner = &holders[0].frame;
    let area = case.options.area();
    let depth = case.camera.background_depth() as f32;
    let mut picture = Frame::blank(area.width, area.height, case.options.layers, depth);
    for t in 0..owner.num_tiles() {
        let mut tile = owner.tile(t);
        for pass in owner.passes() {
            one_pass(case, &holders, &mut tile, pass);
        }
        paste(&mut picture, &tile.image(owner), owner.tile_area(t));
    }
    picture
}

/// Copies all layers of a tile into the image.
fn paste(picture: &mut Frame, tile: &Frame, area: Crop) {
    for y in 0..area.height {
        for x in 0..area.width {
            let (to, from) = (picture.index(area.x + x, area.y + y), tile.index(x, y));
            picture.color[to] = tile.color[from];
            picture.depth[to] = tile.depth[from];
            picture.distance[to] = tile.distance[from];
            picture.normal[to] = tile.normal[from];
            picture.instance[to] = tile.instance[from];
            picture.primitive[to] = tile.primitive[from];
            picture.cost[to] = tile.cost[from];
        }
    }
}

fn one_pass(case: &Case, holders: &[Holder<'_>], tile: &mut TileState, pass: Pass) {
    let owner = &holders[0].frame;
    tile.begin(owner, pass);
    // ---- Primary rays.
    let mut best = vec![None; tile.num_rays()];
    let mut colors = vec![None; tile.num_rays()];
    let mut hits = CameraHits::default();
    let local = owner.needs_only_local_light() && pass != Pass::Geometry;
    for h in holders {
        h.frame.camera_hits(tile.number(), pass, &mut hits);
        let of_hits = if local { hits.colors(&h.frame).to_vec() } else { vec![[0.0; 4]; 1024] };
        for slot in 0..1024 {
            let met = hits.shading_hit(&h.frame, slot).map(|m| h.in_whole(&case.scene, m));
            if let Some(m) = met
                && best[slot].as_ref().is_none_or(|b: &ShadingHit| is_before(&m, b))
            {
                (best[slot], colors[slot]) = (Some(m), Some(of_hits[slot]));
            }
        }
    }
    if local {
        tile.select_colors(owner, &colors).unwrap();
        if owner.records_geometry(pass) {
            tile.record_geometry(&best);
        }
        return;
    }
    // ---- Wavefronts.
    tile.process_hits(owner, &best).unwrap();
    loop {
        if owner.light_passes_surfaces() {
            loop {
                let rays: Vec<_> = tile.light_rays().collect();
                if rays.is_empty() {
                    break;
                }
                tile.process_light_hits(owner, &light_hits(holders, &case.scene, &rays)).unwrap();
            }
        } else if !tile.light_points().is_empty() {
            let (mut all, mut bits, mut work) = (vec![], vec![], OcclusionScratch::default());
            for h in holders {
                h.frame.occlusion_bits(tile.light_points(), pass, &mut work, &mut bits);
                all.resize(bits.len(), 0u64);
                all.iter_mut().zip(&bits).for_each(|(a, b)| *a |= b);
            }
            tile.apply_occlusion(owner, &all).unwrap();
        }
        if !tile.advance(owner) {
            return;
        }
        let waiting: Vec<_> = tile.rays().collect();
        let rays: Vec<_> = waiting.iter().map(|(_, _, r)| *r).collect();
        let pixels: Vec<_> = waiting.iter().map(|(_, s, _)| (tile.number() as u32, *s)).collect();
        let recorded = owner.records_geometry(pass).then_some(&pixels[..]);
        let mut answers = vec![None; tile.num_rays()];
        for ((i, ..), met) in waiting.iter().zip(closest(holders, &case.scene, &rays, recorded)) {
            answers[*i] = met;
        }
        tile.process_hits(owner, &answers).unwrap();
    }
}

fn bits(frame: &Frame) -> Vec<(&'static str, Vec<u32>)> {
    let f = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect();
    vec![
        ("color", f(frame.color.as_flattened())),
        ("depth", f(&frame.depth)),
        ("distance", f(&frame.distance)),
        ("normal", f(frame.normal.as_flattened())),
        ("instance", frame.instance.clone()),
        ("primitive", frame.primitive.clone()),
        ("cost", f(&frame.cost)),
    ]
}

#[test]
fn frames_answered_by_parts_have_the_bits_of_frames_in_one_piece() {
    for case in cases() {
        let whole = render(&case.scene, &case.camera, &case.options).unwrap().frame;
        for (parts, seed) in [(1, 0), (3, 1), (7, 99)] {
            let joined = in_parts(&case, parts, seed);
            for ((layer, a), (_, b)) in bits(&whole).into_iter().zip(bits(&joined)) {
                let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
                assert_eq!(
                    (a.len(), differ),
                    (b.len(), 0),
                    "{}, {parts} parts: {layer}",
                    case.name
                );
            }
        }
    }
}

#[test]
fn a_part_alone_without_the_choices_of_the_whole_would_be_noticed() {
    // When a part far from the origin is built as its own world, it gets another local space, and
    // its hits differ in their last bits.
    let mesh = plate(DVec3::ZERO, 24);
    let moved = TriMesh {
        positions: mesh.positions.iter().map(|p| *p + Vec3::new(900.0, 10.0, -3.0)).collect(),
        ..mesh
    };
    let whole = World::from_mesh(moved.clone(), &BuildOptions::default()).unwrap();
    let kept: Vec<u32> = (0..moved.indices.len() as u32).filter(|k| k % 48 < 8).collect();
    let (some, _) = moved.part(&kept);
    let alone = World::from_mesh(some.clone(), &BuildOptions::default()).unwrap();
    let geometry = rt_core::bvh::Geometry::Mesh(Arc::new(some));
    let part = World::build_part(
        vec![geometry],
        whole.instances().to_vec(),
        &whole.global_layout(),
        &BuildOptions::default(),
    )
    .unwrap();
    let (mut differ, mut met) = (0, 0);
    for k in 0..400 {
        let target =
            DVec3::new(900.0 - 1.9 + 0.004 * k as f64, 10.0 - 1.99 + 0.0099 * k as f64, -3.0);
        let from = target + DVec3::new(0.3, 0.2, 5.0);
        let t = |w: &World| {
            let (ray, moved) = w.ray_from_world(from, target - from);
            w.closest(&ray).map(|h| (w.origin(), h.t.to_bits(), moved.to_bits()))
        };
        let of_whole = {
            let (ray, moved) = whole.ray_from_world(from, target - from);
            whole
                .closest(&ray)
                .filter(|h| kept.contains(&h.prim))
                .map(|h| (whole.origin(), h.t.to_bits(), moved.to_bits()))
        };
        let Some(expected) = of_whole else { continue };
        met += 1;
        assert_eq!(t(&part), Some(expected), "ray {k}");
        differ += (t(&alone) != Some(expected)) as u32;
    }
    assert!(met > 30 && differ > 0, "{differ} of {met} differ");
}
