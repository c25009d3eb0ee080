//! Messages with random changes: each run ends with the right image or with named errors on all
//! ranks, never with a panic. The seeds are fixed and time is virtual: every run of this test is
//! the same, on a busy machine too.
mod meddling;
#[path = "meddling/mutation.rs"]
mod mutation;

use composite::comm::sim;
use composite::{Communicator, CompositeError, Frame, Options, Strategy, composite_serial};
use meddling::{Meddling, Outgoing};
use mutation::{Random, mutate};
use std::time::Duration;

const RANKS: usize = 4;
const WIDTH: u32 = 23;
const HEIGHT: u32 = 9;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;
const SEEDS: u64 = 6000;
const STRATEGIES: [Strategy; 4] =
    [Strategy::DirectSend, Strategy::Tree, Strategy::BinarySwap, Strategy::RadixK { k: 4 }];

fn drawn_by(rank: usize) -> (Vec<[u8; 4]>, Vec<f32>) {
    let color = |k: usize| [rank as u8 + 1, k as u8, (k * rank) as u8, 255];
    let depth = |k: usize| {
        if (k + rank).is_multiple_of(3) { 1.0 } else { (k * 7 + rank * 5) as f32 % 8.0 / 8.0 }
    };
    ((0..PIXELS).map(color).collect(), (0..PIXELS).map(depth).collect())
}

#[test]
fn messages_with_random_changes_end_in_the_right_image_or_in_named_errors() {
    let drawn: Vec<_> = (0..RANKS).map(drawn_by).collect();
    let frame = |rank: usize| {
        let (color, depth) = &drawn[rank];
        Frame::with_depth(WIDTH, HEIGHT, color, depth).expect("a frame")
    };
    let frames: Vec<_> = (0..RANKS).map(frame).collect();
    let expected = composite_serial(&frames).expect("an image").to_bytes();
    let (mut failed, mut unchanged) = (0, 0);
    for seed in 0..SEEDS {
        let mut random = Random(seed);
        let options = Options {
            strategy: STRATEGIES[random.below(4)],
            verify: true,
            timeout: Duration::from_secs(5),
            ..Options::default()
        };
        let culprit = random.below(RANKS);
        // The handshake, or one of the first messages with pixels.
        let what = match random.below(4) {
            0 => Outgoing::Gathered(0),
            number => Outgoing::Message(number - 1),
        };
        let case = format!("seed {seed}: {:?}, rank {culprit}, {what:?}", options.strategy);
        let ends = sim::run(RANKS, sim::Network::QDR, sim::Compute::Given, |inner| {
            let rank = inner.rank();
            let mut random = Random(!seed);
            let mut comm = Meddling::new(inner, |outgoing, message| {
                if rank == culprit && outgoing == what {
                    mutate(&mut random, message);
                }
                true
            });
            composite::composite(&mut comm, &frame(rank), &options)
        });
        let mut errors = 0;
        for end in ends {
            match end.unwrap_or_else(|panic| panic!("{case}: {panic}")) {
                Ok(output) => {
                    // Who says that it has drawn less is believed; pixels have checksums.
                    let same = output.image.is_none_or(|image| image.to_bytes() == expected);
                    assert!(same || what == Outgoing::Gathered(0), "{case}: another image");
                }
                Err(error) => {
                    errors += 1;
                    let named = error.to_string().contains("rank");
                    assert!(named, "{case}: {error}");
                    let timeout =
                        matches!(error, CompositeError::Comm(composite::CommError::Timeout { .. }));
                    assert!(!timeout, "{case}: {error}");
                }
            }
        }
        assert!(errors == 0 || errors == RANKS, "{case}: {errors} of {RANKS} ranks have an error");
        failed += usize::from(errors > 0);
        unchanged += usize::from(errors == 0);
    }
    // Both happen: some ranks send fewer messages than the number that was chosen.
    assert!(failed > 1600 && unchanged > 400, "{failed} failed, {unchanged} did not");
}
