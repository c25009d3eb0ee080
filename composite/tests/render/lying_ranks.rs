//! Ranks that announce other numbers than they send are rejected by name, early enough.
use crate::{frame_options, scenes};
use composite::comm::{Arrival, Receive};
use composite::render::{
    DataParallel, FrameError, FrameOptions, Partition, RankScene, SecondaryRayPolicy, Split,
};
use composite::{CommError, Communicator, threads};
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
struct Lying<F> {
    inner: threads::ThreadComm,
    lie: F,
}

impl<F: Fn(&mut [u32])> Communicator for Lying<F> {
    fn rank(&self) -> usize {
        self.inner.rank()
    }

    fn size(&self) -> usize {
        self.inner.size()
    }

    fn now(&self) -> f64 {
        self.inner.now()
    }

    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError> {
        self.inner.send(destination, tag, message)
    }

    fn post_recv(
        &mut self,
        source: usize,
        tag: u32,
        capacity: usize,
    ) -> Result<Receive, CommError> {
        self.inner.post_recv(source, tag, capacity)
    }

    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError> {
        self.inner.wait_any(posted, timeout)
    }

    fn test_any(&mut self, posted: &mut Vec<Receive>) -> Result<Option<Arrival>, CommError> {
        self.inner.test_any(posted)
    }

    fn barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        self.inner.barrier(timeout)
    }

    fn all_gather(
        &mut self,
        mine: &[u8],
        longest: usize,
        timeout: Duration,
    ) -> Result<Vec<Vec<u8>>, CommError> {
        if self.rank() != LIAR {
            return self.inner.all_gather(mine, longest, timeout);
        }
        let mut words: Vec<u32> =
            mine[8..].as_chunks::<4>().0.iter().map(|c| u32::from_le_bytes(*c)).collect();
        let truth = words.clone();
        (self.lie)(&mut words);
        if words == truth {
            return self.inner.all_gather(mine, longest, timeout);
        }
        let body: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        let said = [&checksum(&body).to_le_bytes()[..], &body].concat();
        self.inner.all_gather(&said, longest, timeout)
    }

    fn abort(&mut self, reason: &str) {
        self.inner.abort(reason);
    }
}

/// The checksum in front of a short message. Unchanged numbers must pass with it: see below.
fn checksum(body: &[u8]) -> u64 {
    let mix = |state: u64, value: u64| {
        (state ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
    };
    assert!(body.len() < 64, "longer messages have more chains");
    let state = (0..8).fold(body.len() as u64, mix);
    body.chunks(8).fold(state, |state, chunk| {
        let mut whole = [0; 8];
        whole[..chunk.len()].copy_from_slice(chunk);
        mix(state, u64::from_le_bytes(whole))
    })
}

/// The error of each rank when rank [`LIAR`] falsifies its numbers.
fn frame(policy: SecondaryRayPolicy, lie: impl Fn(&mut [u32]) + Sync) -> Vec<Option<FrameError>> {
    let case = scenes::occlusion_alone();
    let partition = Partition::new(&case.scene, RANKS, &Split::Triangles);
    let results = threads::run(RANKS, |inner| {
        let mut comm = Lying { inner, lie: &lie };
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
            let mut comm = Lying { inner, lie };
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
