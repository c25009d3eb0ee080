//! Every fault ends in a named error on every rank, with every strategy, and never in a hang.
mod meddling;

use composite::{
    CommError, Communicator, CompositeError, Destination, Frame, MessageError, Options, Strategy,
    threads,
};
use meddling::{Meddling, Outgoing};
use std::time::{Duration, Instant};

const STRATEGIES: [Strategy; 4] =
    [Strategy::DirectSend, Strategy::Tree, Strategy::BinarySwap, Strategy::RadixK { k: 4 }];
const RANKS: usize = 5;
/// This rank sends in every strategy: it is folded into rank 0.
const CULPRIT: usize = 1;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Truncated,
    Longer,
    Empty,
    FlippedBit,
    Swallowed,
    Panic,
}

impl Fault {
    /// What becomes of a message; false if it is not sent.
    fn damage(self, message: &mut Vec<u8>) -> bool {
        match self {
            Fault::Truncated => message.truncate(message.len() - 3),
            Fault::Longer => message.push(0),
            Fault::Empty => message.clear(),
            Fault::FlippedBit => {
                let last = message.len() - 1;
                message[last] ^= 16;
            }
            Fault::Swallowed => return false,
            Fault::Panic => panic!("the culprit dies"),
        }
        true
    }
}

/// The error of every rank; the test fails if a rank succeeds.
fn errors_of(fault: Fault, strategy: Strategy, timeout: Duration) -> Vec<CompositeError> {
    let color = [[200_u8, 100, 50, 255]; 21];
    let depth = [0.5; 21];
    let begin = Instant::now();
    let results = threads::run(RANKS, |comm| {
        // The first message with pixels.
        let is_culprit = comm.rank() == CULPRIT;
        let mut comm = Meddling::new(comm, |outgoing, message| {
            !is_culprit || outgoing != Outgoing::Message(0) || fault.damage(message)
        });
        let frame = Frame::with_depth(7, 3, &color, &depth).unwrap();
        let options = Options { strategy, timeout, verify: true, ..Options::default() };
        composite::composite(&mut comm, &frame, &options)
    });
    assert!(begin.elapsed() < Duration::from_secs(25), "{fault:?} {strategy:?} took too long");
    results
        .into_iter()
        .map(|result| match result {
            Ok(Ok(_)) => panic!("{fault:?} {strategy:?}: a rank did not notice"),
            Ok(Err(error)) => error,
            Err(panicked) => CompositeError::Comm(panicked),
        })
        .collect()
}

const LONG: Duration = Duration::from_secs(20);

#[test]
fn short_long_empty_and_corrupt_messages_are_named_by_the_receiver_and_end_the_frame_for_all() {
    for strategy in STRATEGIES {
        for fault in [Fault::Truncated, Fault::Longer, Fault::Empty, Fault::FlippedBit] {
            let errors = errors_of(fault, strategy, LONG);
            let mut receivers = 0;
            for (rank, error) in errors.iter().enumerate() {
                match error {
                    CompositeError::Message { rank: receiver, from, reason } => {
                        receivers += 1;
                        assert_eq!((*receiver, *from), (rank, CULPRIT));
                        let fits = match reason {
                            MessageError::Checksum { .. } => fault != Fault::Empty,
                            MessageError::Length { .. } => fault != Fault::FlippedBit,
                            _ => false,
                        };
                        assert!(fits, "{fault:?} gave {reason:?}");
                    }
                    CompositeError::Comm(CommError::Aborted { reason, .. }) => {
                        assert!(reason.contains("unusable message from rank 1"), "{reason}");
                    }
                    other => panic!("rank {rank}, {fault:?}, {strategy:?}: {other}"),
                }
            }
            assert_eq!(receivers, 1);
        }
    }
}

#[test]
fn a_message_that_never_comes_is_a_timeout_that_names_its_sender() {
    for strategy in STRATEGIES {
        let errors = errors_of(Fault::Swallowed, strategy, Duration::from_millis(150));
        let texts: Vec<String> = errors.iter().map(ToString::to_string).collect();
        for text in &texts {
            assert!(text.contains("in vain"), "{strategy:?}: {texts:?}");
        }
    }
}

#[test]
fn a_rank_that_dies_is_lost_to_all_others() {
    for strategy in STRATEGIES {
        let errors = errors_of(Fault::Panic, strategy, LONG);
        for (rank, error) in errors.iter().enumerate() {
            let text = error.to_string();
            if rank == CULPRIT {
                assert_eq!(text, "rank 1 panicked: the culprit dies");
            } else {
                assert!(text.contains("lost rank 1"), "{strategy:?}: {text}");
            }
        }
    }
}

#[test]
fn a_stalled_rank_hears_that_the_others_have_given_up() {
    let color = [[200_u8, 100, 50, 255]; 21];
    let results = threads::run(3, |mut comm| {
        let frame = Frame::premultiplied(7, 3, &color).unwrap();
        if comm.rank() == 2 {
            // Longer than the timeout and the longer final wait together.
            std::thread::sleep(Duration::from_millis(2500));
        }
        let options = Options { timeout: Duration::from_millis(500), ..Options::default() };
        composite::composite(&mut comm, &frame, &options).unwrap_err().to_string()
    });
    for text in results {
        let text = text.unwrap();
        assert!(text.contains("message from rank 2"), "{text}");
    }
}

#[test]
fn ranks_that_render_different_sizes_or_formats_find_out() {
    for strategy in STRATEGIES {
        let options = Options { strategy, timeout: LONG, ..Options::default() };
        let results = threads::run(RANKS, |mut comm| {
            // The same number of pixels, so that only the fingerprint differs.
            let (w, h) = if comm.rank() == CULPRIT { (3, 7) } else { (7, 3) };
            let color = [[200_u8, 100, 50, 255]; 21];
            let frame = Frame::premultiplied(w, h, &color).unwrap();
            composite::composite(&mut comm, &frame, &options).unwrap_err().to_string()
        });
        for text in results {
            let text = text.unwrap();
            assert!(text.contains("another size, pixel format"), "{strategy:?}: {text}");
        }
    }
}

#[test]
fn options_that_cannot_work_are_refused_with_their_cure() {
    let frame = Frame::premultiplied(1, 1, &[[1_u8; 4]]).unwrap();
    let refuse = |options: Options| {
        let mut comm = threads::group(1).remove(0);
        composite::composite(&mut comm, &frame, &options).unwrap_err().to_string()
    };
    let k = refuse(Options { strategy: Strategy::RadixK { k: 3 }, ..Options::default() });
    assert_eq!(
        k,
        "radix-k with k = 3: the fixed grouping of ranks needs a power of two, for example 8"
    );
    let root = refuse(Options { destination: Destination::Rank(1), ..Options::default() });
    assert_eq!(root, "the image is to go to rank 1 of a group of 1 ranks");
    let order = refuse(Options { order: Some(vec![1]), ..Options::default() });
    assert!(order.contains("each of the 1 ranks exactly once"), "{order}");
}
