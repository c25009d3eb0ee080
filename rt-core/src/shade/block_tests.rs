//! Surfaces, light and rays of sixteen points at a time have the bits of one point at a time, at
//! every level.

use super::ambient_occlusion::{OcclusionBuffers, add_ambient_light};
use super::direct::direct_lighting;
use super::hemisphere::Hemisphere;
use super::local::tests::mixed_scene;
use super::point::{Maps, Point, WithMaps, WithoutMaps};
use super::wavefront::{LightRayResult, LightRays, OcclusionSource, RecordedRay};
use super::*;
use crate::camera::Camera;
use crate::light::{Light, LightKind};
use crate::material::Sides;
use crate::render_options::RenderOptions;
use crate::sampler::cosine_hemisphere;
use crate::scene::{AmbientOcclusion, Scene};
use crate::simd::SimdLevel;
use glam::DVec3;

const TILES: u32 = 3;

/// Calls `check` with the points of each tile of `scene`, at every level.
fn on_each_tile(
    scene: &Scene,
    effects: Effects,
    check: impl Fn(&FrameContext<'_>, &TileArea, &mut Workspace),
) {
    let eye = DVec3::new(0.3, 0.5, 3.5);
    let camera = Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.6, 1.0, [0.1, 100.0]).unwrap();
    let options = RenderOptions::new(TILES * TILE, TILES * TILE);
    for level in SimdLevel::available().into_iter().map(Some).chain([None]) {
        let mut context = FrameContext::new(scene, &camera, &options, effects);
        context.level = SimdLevel::resolve(level).expect("a level of this machine");
        let mut work = Workspace::default();
        for tile in 0..TILES * TILES {
            let [x, y] = [tile % TILES * TILE, tile / TILES * TILE];
            let width = if tile % TILES == 2 { 13 } else { TILE };
            let area = TileArea { x, y, width, height: TILE, sample: 0 };
            let mut out = TileLayers::new(Layers::COLOR, 1.0, false);
            let mut stats = RayStats::default();
            let wave = &mut work.current;
            generate_camera_wavefront(&context, &area, wave, None, &mut stats, None);
            trace(&context, &mut work, true);
            work.pixels.resize(PIXELS, [0.0; 4]);
            process_hits(&context, &area, &mut out, &mut work, false, &mut stats);
            check(&context, &area, &mut work);
        }
    }
}

/// The mixed scene with lights that cast shadows, some of them far away or near, and an occluder
/// for each.
fn shadow_scene() -> Scene {
    let mut scene = mixed_scene();
    scene.lights.iter_mut().for_each(|l| l.shadows = true);
    scene.lights.push(Light::point(DVec3::new(-3e6, 2e6, 1e6)));
    scene.lights.push(Light::point(DVec3::new(0.1, 0.05, 0.0)));
    scene.lights.push(Light::disk(DVec3::new(0.0, 4.0, 1.0), DVec3::NEG_Y, 0.5));
    let (position, direction) = (DVec3::new(-0.0, 2.0, 2.0), DVec3::new(0.0, -1.0, -1.0));
    let kind = LightKind::Spot { position, direction, cutoff_rad: 0.7, exponent: 0.0, radius: 0.0 };
    scene.lights.push(Light { kind, ..Light::headlight() });
    scene
}

#[test]
fn surfaces_of_a_block_are_those_of_single_hits() {
    let mut scene = mixed_scene();
    scene.materials[0].sides = Sides::FrontOnly;
    scene.materials[1].sides = Sides::BackOnly;
    on_each_tile(&scene, Effects::TRANSPARENCY, |context, area, work| {
        let hits = work.hits.iter().flat_map(|h| (0..LANES).map(|l| h.get(l)));
        let hits: Vec<_> = hits.enumerate().filter_map(|(i, h)| Some((i, h?))).collect();
        assert_eq!(work.points.len(), hits.len());
        for (p, (i, hit)) in work.points.iter().zip(hits) {
            let ray = work.current.ray(i);
            let view = ray.dir * (-1.0 / crate::math::length(ray.dir));
            assert_eq!((p.lane, p.instance, p.t), (i as u32, hit.instance, hit.t));
            let expected = (context.instance_at(&hit).surface(&ray, &hit), view);
            // Text tells -0 from 0 and a NaN is like another.
            assert_eq!(
                format!("{:?}", (p.surface, p.view)),
                format!("{expected:?}"),
                "tile {area:?}, ray {i} at {:?}",
                context.level
            );
        }
    });
}

/// Radiance and rays of all lights.
fn direct<M: Maps>(
    context: &FrameContext<'_>,
    area: &TileArea,
    work: &mut Workspace,
    source: OcclusionSource,
) -> (Vec<Vec3>, Vec<RecordedRay>, [u64; 2]) {
    let mut points: Vec<Point> = work.points.clone();
    let mut rays = LightRays::default();
    rays.source = source;
    let mut stats = RayStats::default();
    let states = &work.current.states;
    direct_lighting::<M>(context, area, &mut points, &[], states, &mut rays, &mut stats, None);
    let list = if let OcclusionSource::Recording(list) = rays.source { list } else { Vec::new() };
    let radiance = points.iter().map(|p| p.radiance).collect();
    (radiance, list, [stats.shadow, stats.shadow_blocked])
}

#[test]
fn direct_light_of_a_block_is_that_of_single_points() {
    let scene = shadow_scene();
    for effects in [Effects::SHADOWS, Effects::SHADOWS | Effects::TRANSPARENCY] {
        on_each_tile(&scene, effects, |context, area, work| {
            let recording = || OcclusionSource::Recording(Vec::new());
            let one = direct::<WithMaps>(context, area, work, recording());
            let many = direct::<WithoutMaps>(context, area, work, recording());
            assert!(work.points.is_empty() || one.1.len() > work.points.len());
            assert_eq!(format!("{:?}", many.0), format!("{:?}", one.0), "radiance");
            assert_eq!(many.1.len(), one.1.len());
            for (a, b) in many.1.iter().zip(&one.1) {
                assert_eq!(format!("{a:?}"), format!("{b:?}"));
            }
            let one = direct::<WithMaps>(context, area, work, OcclusionSource::World);
            let many = direct::<WithoutMaps>(context, area, work, OcclusionSource::World);
            assert_eq!(format!("{:?}", (many.0, many.2)), format!("{:?}", (one.0, one.2)));
        });
    }
}

/// Radiance and rays of ambient light.
fn ambient(
    context: &FrameContext<'_>,
    area: &TileArea,
    work: &Workspace,
    source: OcclusionSource,
) -> (Vec<Vec3>, Vec<RecordedRay>, [u64; 2]) {
    let mut points: Vec<Point> = work.points.clone();
    let mut rays = LightRays::default();
    rays.source = source;
    let (mut buffers, mut stats) = (OcclusionBuffers::default(), RayStats::default());
    let states = &work.current.states;
    add_ambient_light(
        context,
        area,
        &mut points,
        &[],
        states,
        &mut rays,
        &mut buffers,
        &mut stats,
        None,
    );
    let list = if let OcclusionSource::Recording(list) = rays.source { list } else { Vec::new() };
    let radiance = points.iter().map(|p| p.radiance).collect();
    (radiance, list, [stats.ambient_occlusion, stats.ambient_occlusion_blocked])
}

#[test]
fn occlusion_rays_of_many_points_are_those_of_single_points() {
    let mut scene = mixed_scene();
    for count in [1, 5, 8, 19] {
        scene.ambient_occlusion = Some(AmbientOcclusion { distance: 0.7, rays: count });
        on_each_tile(&scene, Effects::AMBIENT_OCCLUSION, |context, area, work| {
            let (_, list, _) = ambient(context, area, work, OcclusionSource::Recording(Vec::new()));
            let mut recorded = list.iter().peekable();
            let mut answers = Vec::new();
            for (i, p) in work.points.iter().enumerate() {
                let first = recorded.peek().is_some_and(|r| r.point == i as u32);
                let over = Hemisphere::new(&p.surface);
                let sampler = area.sampler(context, work.current.states[p.lane as usize].slot);
                for k in (0..count).filter(|_| first) {
                    let dimension = SampleDimension::AMBIENT_OCCLUSION;
                    let d = cosine_hemisphere(sampler.square_of(dimension, k, count));
                    let [x, y, z] = over.axes;
                    let dir = x * d.x + y * d.y + z * d.z;
                    if dir.dot(p.surface.face_normal) <= 0.0 {
                        continue;
                    }
                    let expected = Ray::new(over.origin, dir).with_t_max(0.7);
                    let r = recorded.next().expect("a ray in this direction");
                    assert_eq!((r.point, r.number), (i as u32, context.sky_number + k));
                    assert_eq!(format!("{:?}", r.ray), format!("{expected:?}"));
                    let hit = context.scene.world.occluded(&expected);
                    let transmittance = if hit { Vec3::ZERO } else { Vec3::ONE };
                    answers.push(LightRayResult { transmittance, hit, continued: 1 });
                }
            }
            assert!(recorded.next().is_none());
            // What the frame traces itself, without a list of rays.
            let given = OcclusionSource::Given(answers.into_iter());
            let (one, _, [_, blocked]) = ambient(context, area, work, given);
            let (many, _, counts) = ambient(context, area, work, OcclusionSource::World);
            assert_eq!(format!("{many:?}"), format!("{one:?}"));
            assert_eq!(counts, [list.len() as u64, blocked]);
        });
    }
}

/// All layers of the tiles of a frame, and counts of rays.
fn tiles(
    context: &FrameContext<'_>,
    render: impl Fn(&TileArea, &mut TileLayers, &mut Workspace, &mut RayStats),
) -> (Vec<String>, RayStats) {
    let (mut work, mut stats, mut text) = (Workspace::default(), RayStats::default(), vec![]);
    for tile in 0..TILES * TILES {
        let [x, y] = [tile % TILES * TILE, tile / TILES * TILE];
        let width = if tile % TILES == 2 { 13 } else { TILE };
        let area = TileArea { x, y, width, height: TILE, sample: 0 };
        let mut out = TileLayers::new(context.options.layers, 1.0, false);
        render(&area, &mut out, &mut work, &mut stats);
        let TileLayers { color, depth, distance, normal, instance, primitive, cost, .. } = &out;
        for slot in (0..PIXELS).filter(|s| area.pixel(*s as u16).is_some()) {
            let geometry = (depth[slot], distance[slot], normal[slot]);
            let ids = (instance[slot], primitive[slot]);
            text.push(format!("{:?} {geometry:?} {ids:?} {}", color[slot], cost[slot]));
        }
    }
    (text, stats)
}

#[test]
fn hard_shadows_in_blocks_of_pixels_have_the_bits_of_the_general_loop() {
    let mut scene = shadow_scene();
    scene.lights.retain(|l| !matches!(l.kind, LightKind::Disk { .. }));
    scene.lights.push(Light { shadows: false, ..Light::point(DVec3::new(1.0, 2.0, 2.0)) });
    let eye = DVec3::new(0.3, 0.5, 3.5);
    let camera = Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.6, 1.0, [0.1, 100.0]).unwrap();
    let options =
        RenderOptions { layers: Layers::ALL, ..RenderOptions::new(TILES * TILE, TILES * TILE) };
    let (mut lit, mut unlit) = (0, 0);
    for level in SimdLevel::available().into_iter().map(Some).chain([None]) {
        let mut context = FrameContext::new(&scene, &camera, &options, Effects::SHADOWS);
        context.level = SimdLevel::resolve(level).expect("a level of this machine");
        assert!(local::is_sufficient(&context) && !local::has_no_effect(&context));
        let (blocks, stats) = tiles(&context, |area, out, work, stats| {
            local::render_tile(&context, area, out, work, None, true, stats);
        });
        let (general, expected) = tiles(&context, |area, out, work, stats| {
            render_wavefronts(&context, area, out, work, 0, true, true, stats);
        });
        for (pixel, (a, b)) in blocks.iter().zip(&general).enumerate() {
            assert_eq!(a, b, "pixel {pixel} at {level:?}");
        }
        assert_eq!(format!("{stats:?}"), format!("{expected:?}"), "at {level:?}");
        (lit, unlit) = (stats.shadow - stats.shadow_blocked, stats.shadow_blocked);
    }
    assert!(lit > 1000 && unlit > 1000, "{lit} rays arrive and {unlit} do not");
}
