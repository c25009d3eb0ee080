//! The image of many ranks equals the image of one node, bit for bit.
mod distributed;
mod lying_ranks;
#[path = "../meddling/mod.rs"]
mod meddling;
mod mutated_messages;
#[path = "../meddling/mutation.rs"]
mod mutation;
mod scenes;
mod stored_blocks;
mod unreadable_shapes;
mod volumes;
#[path = "../meddling/words.rs"]
mod words;

use composite::comm::sim;
use composite::render::{
    Activity, DataParallel, FrameError, FrameOptions, FrameOutput, Partition, SecondaryRayPolicy,
    Split, ray_parallel,
};
use composite::{Communicator, threads};
use rt_core::bvh::BuildOptions;
use rt_core::frame::{Frame, Layers};
use rt_core::glam::DVec3;
use rt_core::render::render;
use scenes::Case;
use std::time::Duration;

fn one_node(case: &Case) -> Frame {
    render(&case.scene, &case.camera, &case.options).unwrap().frame
}

fn frame_options(light: SecondaryRayPolicy) -> FrameOptions {
    FrameOptions {
        secondary_rays: light,
        timeout: Duration::from_secs(120),
        ..FrameOptions::default()
    }
}

/// The outputs of all ranks; the image is that of the last rank.
fn many(case: &Case, ranks: usize, split: &Split, light: SecondaryRayPolicy) -> Vec<FrameOutput> {
    dealt(case, &Partition::new(&case.scene, ranks, split), light)
}

fn dealt(case: &Case, partition: &Partition, light: SecondaryRayPolicy) -> Vec<FrameOutput> {
    let ranks = partition.parts();
    let outputs = threads::run(ranks, |mut comm| {
        let part = partition.part(&case.scene, comm.rank(), &BuildOptions::default())?;
        let options = FrameOptions { root: Some(ranks - 1), ..frame_options(light) };
        let mut renderer = DataParallel::new(&mut comm, part, options)?;
        renderer.frame(&mut comm, &case.camera, &case.options)
    });
    outputs.into_iter().map(|o: Result<Result<_, FrameError>, _>| o.unwrap().unwrap()).collect()
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

fn assert_same(expected: &Frame, outputs: &[FrameOutput], what: &str) {
    let found = outputs.last().and_then(|o| o.frame.as_ref()).expect("the root has the image");
    for ((layer, a), (_, b)) in bits(expected).into_iter().zip(bits(found)) {
        let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
        assert_eq!((a.len(), differ), (b.len(), 0), "{what}: {layer}");
    }
}

fn differing_pixels(a: &Frame, b: &Frame) -> usize {
    a.color.iter().zip(&b.color).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits)).count()
}

#[test]
fn shadows_area_lights_and_occlusion_of_1_to_128_ranks_have_the_bits_of_one_node() {
    let case = scenes::shadows_and_occlusion(DVec3::ZERO);
    let expected = one_node(&case);
    for ranks in [1, 2, 3, 5, 8, 64, 128] {
        let outputs = many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::Forward);
        assert_same(&expected, &outputs, &format!("{ranks} ranks"));
        if ranks > 1 {
            assert!(
                outputs.iter().map(|o| o.report.points_sent).sum::<u64>() > 1000,
                "light crossed borders"
            );
        }
    }
}

#[test]
fn random_and_view_dependent_partitions_have_the_bits_of_one_node() {
    let case = scenes::shadows_and_occlusion(DVec3::new(4e6, -3e6, 1e6));
    let expected = one_node(&case);
    let view = Split::View { camera: Box::new(case.camera), size_px: [150, 121] };
    for (ranks, split) in [
        (3, Split::Random { seed: 1 }),
        (8, Split::Random { seed: 2 }),
        (64, Split::Random { seed: 3 }),
        (7, view),
    ] {
        let outputs = many(&case, ranks, &split, SecondaryRayPolicy::Forward);
        assert_same(&expected, &outputs, &format!("{ranks} ranks, {split:?}"));
    }
}

#[test]
fn local_geometry_alone_gives_another_image() {
    let case = scenes::shadows_and_occlusion(DVec3::ZERO);
    let expected = one_node(&case);
    for ranks in [8, 64] {
        let outputs = many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::LocalOnly);
        let differ = differing_pixels(&expected, outputs.last().unwrap().frame.as_ref().unwrap());
        assert!(
            differ > 500,
            "{ranks} ranks: only {differ} pixels differ: the scene does not test the exchange"
        );
    }
}

#[test]
fn frames_without_secondary_rays_send_none_and_have_the_bits_of_one_node() {
    for samples in [1, 4] {
        let case = scenes::headlight(samples);
        let expected = one_node(&case);
        for ranks in [2, 5, 32] {
            let outputs =
                many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::Auto { frames: 1 });
            assert_same(&expected, &outputs, &format!("{samples} samples, {ranks} ranks"));
            for o in &outputs {
                // There are no secondary rays of the geometry pass to answer.
                assert_eq!(
                    (o.report.points_sent, o.report.rays_sent, o.report.answered_rays),
                    (0, 0, 0)
                );
                assert_eq!(o.report.secondary_rays, "no light crosses borders");
            }
        }
    }
}

#[test]
fn streamed_frames_have_the_bits_of_one_node_and_send_tiles_while_rays_are_traced() {
    let mut case = scenes::headlight(1);
    // Only colours: no work is left after the primary rays.
    case.options.layers = Layers::COLOR;
    (case.options.width, case.options.height) = (384, 320);
    for samples in [1, 3] {
        case.options.samples = samples;
        let expected = one_node(&case);
        for (ranks, split) in [
            (1, Split::Triangles),
            (2, Split::Triangles),
            (5, Split::Random { seed: 3 }),
            (27, Split::Triangles),
            (128, Split::Triangles),
        ] {
            let partition = Partition::new(&case.scene, ranks, &split);
            for stream in [true, false] {
                let outputs =
                    sim::run(ranks, sim::Network::FREE, sim::Compute::Measured(1.0), |mut comm| {
                        let part =
                            partition.part(&case.scene, comm.rank(), &BuildOptions::default())?;
                        let options = FrameOptions {
                            root: Some(ranks - 1),
                            stream,
                            ..frame_options(SecondaryRayPolicy::Forward)
                        };
                        let mut renderer = DataParallel::new(&mut comm, part, options)?;
                        renderer.frame(&mut comm, &case.camera, &case.options)
                    });
                let outputs: Vec<FrameOutput> = outputs
                    .into_iter()
                    .map(|o: Result<Result<_, FrameError>, _>| o.unwrap().unwrap())
                    .collect();
                assert_same(
                    &expected,
                    &outputs,
                    &format!("{samples} samples, {ranks} ranks, stream {stream}"),
                );
                // Some rank finishes tiles before it traces its last ray, or no rank does. (With
                // few tiles per rank, streaming does not pay off.)
                let overlaps = |o: &FrameOutput| {
                    let mut spans = o.report.spans.iter().map(|s| s.activity);
                    let last = spans.clone().rposition(|a| a == Activity::Render);
                    let shaded = spans.position(|a| a == Activity::Shade);
                    shaded.zip(last).is_some_and(|(shaded, last)| shaded < last)
                };
                if samples == 1 && (2..=5).contains(&ranks) {
                    assert_eq!(outputs.iter().any(overlaps), stream, "{ranks} ranks");
                }
            }
        }
    }
}

#[test]
fn mirrors_glass_layers_and_paths_have_the_bits_of_one_node() {
    for case in scenes::several_bounces() {
        let expected = one_node(&case);
        for (ranks, split) in
            [(3, Split::Triangles), (8, Split::Random { seed: 9 }), (16, Split::Triangles)]
        {
            let outputs = many(&case, ranks, &split, SecondaryRayPolicy::Forward);
            assert_same(&expected, &outputs, &format!("{}, {ranks} ranks", case.name));
            assert!(outputs.iter().any(|o| o.report.rounds > 2), "{}", case.name);
        }
    }
}

#[test]
fn a_volume_in_bricks_has_the_bits_of_one_node() {
    for case in scenes::volumes() {
        let expected = one_node(&case);
        for (ranks, split) in
            [(2, Split::Triangles), (7, Split::Random { seed: 5 }), (64, Split::Triangles)]
        {
            let outputs = many(&case, ranks, &split, SecondaryRayPolicy::Forward);
            assert_same(&expected, &outputs, &format!("{}, {ranks} ranks", case.name));
            assert!(outputs[0].report.warnings.iter().all(|w| !w.contains("whole")));
        }
        // Every rank holds its brick with two layers of points around it, and not the whole.
        let whole = case.scene.volumes[0].volume.grid().values().len();
        let held = values_held(&case, &Partition::new(&case.scene, 8, &Split::Triangles));
        assert!(
            held.iter().all(|&n| n < whole / 2) && held.iter().sum::<usize>() >= whole,
            "{held:?}"
        );
    }
}

/// Number of grid values of volumes on each rank.
fn values_held(case: &Case, partition: &Partition) -> Vec<usize> {
    let part = |rank| partition.part(&case.scene, rank, &BuildOptions::default()).unwrap();
    (0..partition.parts()).map(|rank| part(rank).volume_values()).collect()
}

#[test]
fn parts_of_tubes_cylinders_and_spheres_hold_their_own_and_have_the_bits_of_one_node() {
    let case = scenes::arrays_of_shapes();
    let expected = one_node(&case);
    for (ranks, split) in
        [(2, Split::Triangles), (7, Split::Random { seed: 5 }), (32, Split::Triangles)]
    {
        let outputs = many(&case, ranks, &split, SecondaryRayPolicy::Forward);
        assert_same(&expected, &outputs, &format!("{}, {ranks} ranks", case.name));
    }
}

#[test]
fn ghost_zones_have_the_bits_of_one_node_and_the_cheaper_way_is_taken() {
    let case = scenes::occlusion_alone();
    let expected = one_node(&case);
    for ranks in [2, 8, 27] {
        let ghost = many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::GhostZones);
        assert_same(&expected, &ghost, &format!("ghost zones, {ranks} ranks"));
        assert!(
            ghost[0].report.secondary_rays.starts_with("ghost zones"),
            "{}",
            ghost[0].report.secondary_rays
        );
        let asked = many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::Forward);
        assert_same(&expected, &asked, &format!("asking, {ranks} ranks"));
        // With ghost zones, few points are sent to other ranks: those whose hit belongs to another
        // rank, once each.
        let traced = |o: &[FrameOutput]| o.iter().map(|o| o.report.answered_rays).sum::<u64>();
        assert!(traced(&ghost) < traced(&asked), "{} {}", traced(&ghost), traced(&asked));
        // Ghost zones are expensive for one frame and cheap for thousands: see the reported reason.
        let once = many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::Auto { frames: 1 });
        let often =
            many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::Auto { frames: 100_000 });
        assert_same(&expected, &often, "many frames");
        assert!(
            once[0].report.secondary_rays.contains("estimated"),
            "{}",
            once[0].report.secondary_rays
        );
        assert!(
            often[0].report.secondary_rays.starts_with("ghost zones"),
            "{}",
            often[0].report.secondary_rays
        );
        assert!(once.iter().chain(&often).all(|o| !o.report.secondary_rays.is_empty()));
        let local = many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::LocalOnly);
        let differ = differing_pixels(&expected, local.last().unwrap().frame.as_ref().unwrap());
        assert!(differ > 0, "{ranks} ranks: the scene does not test ghost zones");
    }
}

#[test]
fn replicated_data_have_the_bits_of_one_node() {
    for case in
        scenes::several_bounces().into_iter().chain([scenes::shadows_and_occlusion(DVec3::ZERO)])
    {
        let expected = one_node(&case);
        for ranks in [1, 3, 6] {
            let outputs = threads::run(ranks, |mut comm| {
                let options = FrameOptions {
                    root: Some(ranks - 1),
                    ..frame_options(SecondaryRayPolicy::Forward)
                };
                ray_parallel(&mut comm, &case.scene, &case.camera, &case.options, &options).unwrap()
            });
            let outputs: Vec<_> = outputs.into_iter().map(Result::unwrap).collect();
            assert_same(&expected, &outputs, &format!("{}, {ranks} ranks", case.name));
        }
    }
}

#[test]
fn spans_cover_a_frame_without_gaps_and_bytes_add_up() {
    let case = scenes::shadows_and_occlusion(DVec3::ZERO);
    let outputs = many(&case, 5, &Split::Triangles, SecondaryRayPolicy::Forward);
    for o in &outputs {
        let spans = &o.report.spans;
        assert!(
            spans.windows(2).all(|w| w[0].end_secs == w[1].begin_secs)
                && spans[0].begin_secs == 0.0
        );
        assert!(spans.iter().all(|s| s.end_secs > s.begin_secs));
    }
    let rays = render(&case.scene, &case.camera, &case.options).unwrap().report.rays;
    let mut all = rt_core::ray_stats::RayStats::default();
    outputs.iter().for_each(|o| all += o.report.rays);
    assert_eq!(all, rays, "owners count what one node counts");
}

#[test]
fn ranks_that_render_different_images_all_get_an_error() {
    let case = scenes::shadows_and_occlusion(DVec3::ZERO);
    let partition = Partition::new(&case.scene, 3, &Split::Triangles);
    let outcomes = threads::run(3, |mut comm| {
        let part = partition.part(&case.scene, comm.rank(), &BuildOptions::default()).unwrap();
        let mut options = case.options.clone();
        if comm.rank() == 1 {
            options.width = 96;
        }
        let frame_options =
            FrameOptions { timeout: Duration::from_secs(5), ..FrameOptions::default() };
        // A late rank may find that the group has already ended.
        let mut renderer = DataParallel::new(&mut comm, part, frame_options)?;
        renderer.frame(&mut comm, &case.camera, &options)
    });
    for outcome in outcomes {
        assert!(outcome.unwrap().is_err());
    }
}

#[test]
fn a_part_for_another_number_of_ranks_is_refused() {
    let case = scenes::headlight(1);
    let partition = Partition::new(&case.scene, 2, &Split::Triangles);
    let mut comm = threads::group(1).remove(0);
    let part = partition.part(&case.scene, 0, &BuildOptions::default()).unwrap();
    let error = DataParallel::new(&mut comm, part, FrameOptions::default()).err().unwrap();
    assert_eq!(error, FrameError::Ranks { parts: 2, ranks: 1 });
    assert!(partition.part(&case.scene, 2, &BuildOptions::default()).is_err());
}
