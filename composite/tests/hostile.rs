//! Ranks that announce false numbers are rejected by name before memory is allocated for them.
mod meddling;

use composite::{
    Communicator, CompositeError, Compositor, DeepFrame, DepthPixel, Destination, Fragment, Frame,
    MessageError, Options, PremultipliedPixel, Rect, Strategy, composite_deep, threads,
};
use meddling::{Meddling, Outgoing};
use proptest::prelude::*;
use std::time::Duration;

const WIDTH: u32 = 20;
const HEIGHT: u32 = 10;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;
const LIAR: usize = 1;
const STRATEGIES: [Strategy; 4] =
    [Strategy::DirectSend, Strategy::Tree, Strategy::BinarySwap, Strategy::RadixK { k: 4 }];

/// A communicator whose rank [`LIAR`] falsifies its contributions to all-gathers by their number.
fn lying(
    inner: threads::ThreadComm,
    lie: impl Fn(usize, &mut Vec<u8>),
) -> Meddling<threads::ThreadComm, impl FnMut(Outgoing, &mut Vec<u8>) -> bool> {
    let is_liar = inner.rank() == LIAR;
    Meddling::new(inner, move |outgoing, message| {
        if let Outgoing::Gathered(number) = outgoing
            && is_liar
        {
            lie(number, message);
        }
        true
    })
}

type Ended = (Result<(), CompositeError>, usize);

/// The result of each of three ranks, and the memory it requested, when rank [`LIAR`] reports
/// `rect` instead of the rectangle where it drew.
fn with_rect(rect: [u32; 4], options: &Options) -> Vec<Ended> {
    let lie = move |number: usize, message: &mut Vec<u8>| {
        if number == 0 && message.len() == 36 {
            for (to, corner) in message[8..24].chunks_exact_mut(4).zip(rect) {
                to.copy_from_slice(&corner.to_le_bytes());
            }
        }
    };
    let results = threads::run(3, |comm| {
        let mut comm = lying(comm, lie);
        let (colors, depths) = ([[9_u8; 4]; PIXELS], [0.5; PIXELS]);
        let frame =
            Frame::<DepthPixel<[u8; 4]>>::with_depth(WIDTH, HEIGHT, &colors, &depths).unwrap();
        let result = Compositor::new(options.clone()).composite(&mut comm, &frame);
        (result.map(|_| ()), comm.requested_bytes)
    });
    results.into_iter().map(|result| result.expect("no rank panics")).collect()
}

fn reaches_beyond([x0, y0, x1, y1]: [u32; 4]) -> bool {
    let drawn = Rect { x0, y0, x1, y1 };
    !Rect::of_size(WIDTH, HEIGHT).contains(&drawn)
}

fn check_rect(rect: [u32; 4]) {
    for strategy in STRATEGIES {
        for destination in [Destination::Rank(0), Destination::Distributed] {
            let timeout = Duration::from_millis(300);
            let options = Options { strategy, destination, timeout, ..Options::default() };
            let ends = with_rect(rect, &options);
            // Three ranks' parts, merged and collected, doubled to cover all rounds.
            let most = 3 * 2 * (PIXELS * 8 + 4096);
            for (rank, (result, requested_bytes)) in ends.iter().enumerate() {
                assert!(
                    *requested_bytes <= most,
                    "{strategy:?}, {rect:?}: rank {rank} requested {requested_bytes} bytes"
                );
                if !reaches_beyond(rect) {
                    continue;
                }
                let text = result.as_ref().expect_err("it reaches beyond the image").to_string();
                let [x0, y0, x1, y1] = rect;
                let words = format!("columns {x0}..{x1} and rows {y0}..{y1} of an image of 20x10");
                assert!(text.contains("from rank 1") && text.contains(&words), "{text}");
            }
        }
    }
}

#[test]
fn a_rectangle_beyond_the_image_is_refused_by_the_name_of_its_sender() {
    for rect in [
        [0, 0, 21, 10],
        [0, 0, 20, 11],
        [0, 0, u32::MAX, u32::MAX],
        [u32::MAX - 1, 3, u32::MAX, 4],
        [30, 30, 40, 40],
        // Inverted corners: nothing was drawn.
        [9, 9, 3, 3],
        [u32::MAX, u32::MAX, 0, 0],
    ] {
        check_rect(rect);
    }
}

#[test]
fn fragment_counts_above_the_limit_are_rejected_without_allocation() {
    for announced in [u64::MAX, 1 << 62, PIXELS as u64 * (1 << 31)] {
        let lie = move |number: usize, message: &mut Vec<u8>| {
            if number == 1 {
                *message = announced.to_le_bytes().to_vec();
            }
        };
        let fragments = vec![Fragment { color: [0.1; 4], depth: 0.5 }; PIXELS];
        let ends: Vec<usize> = (1..=PIXELS).collect();
        let frame = DeepFrame::new(WIDTH, HEIGHT, &fragments, &ends).unwrap();
        let results = threads::run(3, |comm| {
            let mut comm = lying(comm, lie);
            let result = composite_deep(&mut comm, &frame, &Options::default());
            (result.map(|_| ()), comm.requested_bytes)
        });
        for result in results {
            let (result, requested_bytes) = result.expect("no rank panics");
            let text = result.unwrap_err().to_string();
            assert!(text.contains("from rank 1") && text.contains("fragments"), "{text}");
            assert!(requested_bytes < 1 << 16, "{requested_bytes} bytes");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn no_announced_rectangle_causes_a_panic_or_an_allocation(
        rect in prop::array::uniform4(prop_oneof![0_u32..24, any::<u32>()]),
    ) {
        check_rect(rect);
    }

    #[test]
    fn no_handshake_message_of_a_peer_causes_a_panic(
        received in prop::collection::vec(any::<u8>(), 0..40),
        keep in 0_usize..3,
    ) {
        let lie = move |number: usize, honest: &mut Vec<u8>| {
            if number == 0 {
                // With and without the correct fingerprint.
                let honest_part = [0, 8, 24][keep].min(honest.len());
                honest.truncate(honest_part);
                honest.extend_from_slice(&received);
                honest.truncate(36);
            }
        };
        let results = threads::run(3, |comm| {
            let mut comm = lying(comm, &lie);
            let colors = [[0.5_f32; 4]; PIXELS];
            let frame = Frame::<PremultipliedPixel<[f32; 4]>>::premultiplied(WIDTH, HEIGHT, &colors).unwrap();
            let options = Options { timeout: Duration::from_millis(300), ..Options::default() };
            composite::composite(&mut comm, &frame, &options).map(|_| ())
        });
        for result in results {
            result.expect("no rank panics").err();
        }
    }
}

#[test]
fn the_error_of_a_rectangle_beyond_the_image_is_a_named_one() {
    let ends = with_rect([0, 0, 21, 10], &Options::default());
    let named = |result: &Result<(), CompositeError>| {
        matches!(
            result,
            Err(CompositeError::Message {
                from: LIAR,
                reason: MessageError::OutsideImage { width_px: WIDTH, .. },
                ..
            })
        )
    };
    assert!(ends.iter().any(|(result, _)| named(result)), "{ends:?}");
}
