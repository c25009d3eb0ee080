//! Ranks that announce other numbers than they send are rejected by name, early enough.
use crate::meddling::{Meddling, Outgoing};
use crate::words::change_words;
use crate::{frame_options, scenes};
use composite::render::{
    DataParallel, FrameError, FrameOptions, Partition, RankScene, SecondaryRayPolicy, Split,
};
use composite::{Communicator, threads};
use rt_core::bvh::BuildOptions;
use rt_core::glam::DVec3;
use std::time::Duration;

const RANKS: usize = 3;
const LIAR: usize = 1;
/// Numbers of a rank about ghost zones: triangles for each rank, its own, other parts near them.
const GHOST_NUMBERS: usize = RANKS + 2;
/// Numbers of a rank about requests: words for each rank.
const LENGTHS: usize = RANKS;

/// A communicator whose rank [`LIAR`] falsifies the numbers that it gathers, with a valid checksum.
fn lying(
    inner: threads::ThreadComm,
    lie: impl Fn(&mut [u32]),
) -> Meddling<threads::ThreadComm, impl FnMut(Outgoing, &mut Vec<u8>) -> bool> {
    let is_liar = inner.rank() == LIAR;
    Meddling::new(inner, move |outgoing, message| {
        if is_liar && matches!(outgoing, Outgoing::Gathered(_)) {
            change_words(message, |words| lie(words));
        }
        true
    })
}

/// The error of each rank when rank [`LIAR`] falsifies its numbers.
fn frame(policy: SecondaryRayPolicy, lie: impl Fn(&mut [u32]) + Sync) -> Vec<Option<FrameError>> {
    let case = scenes::occlusion_alone();
    let partition = Partition::new(&case.scene, RANKS, &Split::Triangles);
    let results = threads::run(RANKS, |inner| {
        let mut comm = lying(inner, &lie);
        let options = FrameOptions { timeout: Duration::from_secs(5), ..frame_options(policy) };
        let part = partition.part(&case.scene, comm.rank(), &BuildOptions::default())?;
        let mut renderer = DataParallel::new(&mut comm, part, options)?;
        renderer.frame(&mut comm, &case.camera, &case.options).map(|_| ())
    });
    results.into_iter().map(|result| result.expect("no rank panics").err()).collect()
}

/// No rank gets an image. One finds the invalid numbers and reports them, and the others report the
/// same or that the group was aborted.
fn assert_refused(ends: &[Option<FrameError>], words: &str) {
    let found = |end: &Option<FrameError>| {
        matches!(end, Some(FrameError::Announced { from: LIAR, reason, .. })
            if reason.contains(words))
    };
    assert!(ends.iter().any(found), "{words}: {ends:?}");
    for end in ends {
        let text = end.as_ref().expect("nobody gets an image").to_string();
        assert!(text.contains("from rank 1") && text.contains(words), "{words}: {text}");
    }
}

#[test]
fn bounds_that_are_no_numbers_are_refused_by_the_name_of_their_rank() {
    // One object, so a rank gathers one box of six numbers at a time.
    const BOX: usize = 6;
    for lied in [f32::NAN, f32::INFINITY] {
        let results = threads::run(RANKS, |inner| {
            let lie = |words: &mut [u32]| {
                if words.len() == BOX {
                    words[1] = lied.to_bits();
                }
            };
            let mut comm = lying(inner, lie);
            let mut scene = RankScene::new();
            let matte = scene.material(scenes::matte());
            scene.mesh("ground", scenes::bumps(DVec3::ZERO, 6), matte);
            let options =
                FrameOptions { timeout: Duration::from_secs(5), ..FrameOptions::default() };
            DataParallel::distributed(&mut comm, scene, options).err()
        });
        for result in results {
            let error = result.expect("no rank panics").expect("bounds that cannot be");
            let text = error.to_string();
            assert!(
                text.contains("from rank 1") && text.contains("the bounds of object 0"),
                "{text}"
            );
        }
    }
}

#[test]
fn unchanged_numbers_give_an_image() {
    for policy in [SecondaryRayPolicy::GhostZones, SecondaryRayPolicy::Forward] {
        assert_eq!(frame(policy, |_| ()), vec![None; RANKS], "{policy:?}");
    }
}

#[test]
fn more_ghost_triangles_than_a_rank_has_are_refused_by_all_and_by_its_name() {
    for lied in [u32::MAX, 1 << 30] {
        let ends = frame(SecondaryRayPolicy::GhostZones, |words| {
            if words.len() == GHOST_NUMBERS {
                words[0] = lied;
            }
        });
        assert_refused(&ends, &format!("{lied} ghost triangles to rank 0"));
    }
}

#[test]
fn ghost_triangles_to_oneself_are_refused_by_all_and_by_the_name_of_their_rank() {
    let ends = frame(SecondaryRayPolicy::GhostZones, |words| {
        if words.len() == GHOST_NUMBERS {
            words[LIAR] = 1;
        }
    });
    assert_refused(&ends, "1 ghost triangles to itself");
}

#[test]
fn fewer_ghost_triangles_than_were_announced_are_refused() {
    // The announced number is at most what the rank has, so only the data that arrive show the lie.
    let ends = frame(SecondaryRayPolicy::GhostZones, |words| {
        if words.len() == GHOST_NUMBERS {
            assert!(words[0] > 0, "the liar has triangles near rank 0's part");
            words[0] += 1;
        }
    });
    assert_refused(&ends, "ghost triangles were announced, and");
}

#[test]
fn a_question_of_another_length_than_announced_is_refused() {
    let ends = frame(SecondaryRayPolicy::Forward, |words| {
        if words.len() == LENGTHS && words[0] > 0 {
            words[0] += 3;
        }
    });
    assert_refused(&ends, "words was announced, and one of");
}
