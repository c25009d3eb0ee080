//! Messages of the renderer with random changes: each run ends with the right image or with named
//! errors on all ranks, never with a panic, and asks for no more memory than the honest run by a
//! small factor. Half of the changes have a right checksum, so that what reads the numbers behind
//! it is tried too. The seeds are fixed and time is virtual: every run of this test is the same, on
//! a busy machine too.
use crate::distributed::share;
use crate::meddling::{Meddling, Outgoing};
use crate::mutation::{Random, mutate};
use crate::scenes::{self, Case};
use crate::words::change_words;
use crate::{bits, frame_options};
use composite::comm::sim;
use composite::render::{DataParallel, FrameError, FrameOptions, FrameOutput, SecondaryRayPolicy};
use composite::{CommError, Communicator};
use rt_core::glam::DVec3;
use std::time::Duration;

const RANKS: usize = 3;
const SEEDS: u64 = 600;
/// All-gathers and messages of a rank that may be changed: those of a scene are about as many.
const FIRST: usize = 24;
/// An honest run asks for less; mutated numbers may ask for a multiple, but not for any amount.
const MOST_BYTES: usize = 64 << 20;

type Ended = (Result<FrameOutput, FrameError>, usize);

/// A frame of a scene whose parts the ranks have, with `meddle` on the messages of `culprit`.
fn frame(
    case: &Case,
    policy: SecondaryRayPolicy,
    culprit: usize,
    meddle: impl Fn(Outgoing, &mut Vec<u8>) + Sync,
) -> Vec<Result<Ended, String>> {
    let results = sim::run(RANKS, sim::Network::QDR, sim::Compute::Given, |inner| {
        let rank = inner.rank();
        let mut comm = Meddling::new(inner, |outgoing, message| {
            if rank == culprit {
                meddle(outgoing, message);
            }
            true
        });
        let options = FrameOptions { timeout: Duration::from_secs(2), ..frame_options(policy) };
        let scene = share(&case.scene, rank, RANKS, 0);
        let end = DataParallel::distributed(&mut comm, scene, options)
            .and_then(|mut r| r.frame(&mut comm, &case.camera, &case.options));
        (end, comm.requested_bytes)
    });
    results.into_iter().map(|end| end.map_err(|panic| panic.to_string())).collect()
}

fn cases() -> Vec<Case> {
    let mut cases = vec![scenes::shadows_and_occlusion(DVec3::ZERO), scenes::occlusion_alone()];
    cases.extend(scenes::volumes().into_iter().take(2));
    cases.extend(scenes::several_bounces().into_iter().take(1));
    for case in &mut cases {
        // As small as shows every kind of message.
        (case.options.width, case.options.height, case.options.samples) = (12, 9, 1);
    }
    cases
}

#[test]
fn messages_of_the_renderer_with_random_changes_end_in_the_image_or_in_named_errors() {
    let cases = cases();
    let policies = [SecondaryRayPolicy::Forward, SecondaryRayPolicy::GhostZones];
    let expected: Vec<_> = cases
        .iter()
        .map(|case| {
            let ends = frame(case, policies[0], RANKS, |_, _| ());
            let mut ends = ends.into_iter().map(|end| end.expect("no panic"));
            let (output, bytes) = ends.next().expect("a rank");
            assert!(bytes < MOST_BYTES / 8, "{bytes} bytes of an honest run");
            bits(&output.expect("an image").frame.expect("the root's"))
        })
        .collect();
    let (mut failed, mut unchanged, mut waited) = (0, 0, 0);
    for seed in 0..SEEDS {
        let mut random = Random(seed);
        let number = random.below(cases.len());
        let policy = policies[random.below(2)];
        let culprit = random.below(RANKS);
        let is_consistent = random.below(2) == 0;
        let what = match random.below(2) {
            0 => Outgoing::Gathered(random.below(FIRST)),
            _ => Outgoing::Message(random.below(FIRST)),
        };
        let case = format!("seed {seed}: {number}, {policy:?}, rank {culprit}, {what:?}");
        let ends = frame(&cases[number], policy, culprit, |outgoing, message| {
            let mut random = Random(!seed);
            if outgoing != what {
            } else if is_consistent {
                change_words(message, |words| {
                    let mut bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
                    mutate(&mut random, &mut bytes);
                    let whole = bytes.as_chunks::<4>().0;
                    *words = whole.iter().map(|c| u32::from_le_bytes(*c)).collect();
                });
            } else {
                mutate(&mut random, message);
            }
        });
        let mut errors = 0;
        for end in ends {
            let (end, bytes) = end.unwrap_or_else(|panic| panic!("{case}: {panic}"));
            assert!(bytes < MOST_BYTES, "{case}: {bytes} bytes were asked for");
            match end {
                // What has a right checksum is believed as far as it can be.
                Ok(output) => {
                    let same = output.frame.is_none_or(|frame| bits(&frame) == expected[number]);
                    assert!(same || is_consistent, "{case}: another image");
                }
                Err(error) => {
                    errors += 1;
                    let text = error.to_string();
                    assert!(text.contains("rank"), "{case}: {text}");
                    // Who announces, with a right checksum, what never comes is found by waiting.
                    let timeout = matches!(error, FrameError::Comm(CommError::Timeout { .. }));
                    assert!(!timeout || is_consistent, "{case}: {text}");
                    waited += usize::from(timeout);
                }
            }
        }
        assert!(errors == 0 || errors == RANKS, "{case}: {errors} of {RANKS} ranks have an error");
        failed += usize::from(errors > 0);
        unchanged += usize::from(errors == 0);
    }
    // Both happen: some ranks send fewer messages than the number that was chosen.
    assert!(waited < 20, "{waited} ranks waited in vain");
    let least = SEEDS / 8;
    assert!(failed as u64 > least && unchanged as u64 > least, "{failed} failed, {unchanged} not");
}
