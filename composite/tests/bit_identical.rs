//! Every strategy gives the bits of the serial reference: all rank counts up to 17, odd sizes,
//! depth and ordered blending.
use composite::{
    Communicator, Composite, CompositeError, CompositeOutput, Destination, Frame, Image, Options,
    PixelFormat, Strategy, composite_serial, threads,
};

const STRATEGIES: [Strategy; 7] = [
    Strategy::Automatic,
    Strategy::DirectSend,
    Strategy::Tree,
    Strategy::BinarySwap,
    Strategy::RadixK { k: 2 },
    Strategy::RadixK { k: 4 },
    Strategy::RadixK { k: 8 },
];
const SIZES: [(u32, u32); 7] = [(0, 3), (1, 1), (2, 1), (7, 3), (1, 13), (31, 5), (64, 33)];

/// xorshift64*; a seed gives the same frames everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 16
    }

    fn unit(&mut self) -> f32 {
        (self.next() % (1 << 24)) as f32 / (1 << 24) as f32
    }
}

/// The frame of one rank: about half of the image in runs, with few different depths so that ties
/// are common.
struct TestFrame {
    bytes: Vec<[u8; 4]>,
    floats: Vec<[f32; 4]>,
    depth: Vec<f32>,
}

fn draw(rank: usize, size_px: (u32, u32)) -> TestFrame {
    let mut random =
        Random(1 + rank as u64 * 7919 + u64::from(size_px.0) * 31 + u64::from(size_px.1));
    let mut drawn = TestFrame { bytes: Vec::new(), floats: Vec::new(), depth: Vec::new() };
    let mut active = random.next().is_multiple_of(2);
    let empty_rank = rank % 5 == 3;
    for _ in 0..size_px.0 * size_px.1 {
        if random.next().is_multiple_of(6) {
            active = !active;
        }
        let alpha = random.unit();
        let float = [random.unit() * alpha, random.unit() * alpha, random.unit() * alpha, alpha];
        let on = active && !empty_rank;
        drawn.floats.push(if on { float } else { [0.0; 4] });
        drawn.bytes.push(if on { float.map(|c| (c * 255.0) as u8) } else { [0; 4] });
        let odd =
            [f32::NAN, f32::INFINITY, 1.0, f32::NEG_INFINITY, -0.0, 0.0, f32::from_bits(1), -2.5];
        drawn.depth.push(match random.next() % 12 {
            _ if !on => 1.0,
            special @ 0..=7 => odd[special as usize],
            other => other as f32 / 16.0,
        });
    }
    drawn
}

/// Composites over threads; returns the whole image, assembled from parts if it was left
/// distributed.
fn over_threads<P: Composite>(frames: &[Frame<'_, P>], options: &Options) -> Image<P> {
    let results: Vec<CompositeOutput<P>> = threads::run(frames.len(), |mut comm| {
        let frame = &frames[comm.rank()];
        composite::composite(&mut comm, frame, options)
    })
    .into_iter()
    .map(|result| result.unwrap().unwrap())
    .collect();

    let sent: u64 = results.iter().map(|r| r.report.bytes_sent).sum();
    let received: u64 = results.iter().map(|r| r.report.bytes_received).sum();
    assert_eq!(sent, received, "a message was sent that nobody wanted");

    if let Destination::Rank(root) = options.destination {
        for (rank, result) in results.iter().enumerate() {
            assert_eq!(result.image.is_some(), rank == root);
        }
        return results[root].image.clone().unwrap();
    }
    let (width, height) = (frames[0].width_px(), frames[0].height_px());
    let mut covered = vec![false; frames[0].len()];
    let mut image = composite_serial(&frames[..1]).unwrap();
    let (mut colors, mut depths) = image.into_planes();
    colors.fill(P::EMPTY.color());
    depths.fill(1.0);
    for piece in results.into_iter().map(|r| r.piece.unwrap()) {
        let columns = piece.bounds.width();
        for (offset, color) in piece.colors.iter().enumerate() {
            let (x, y) = (
                offset % columns + piece.bounds.x0 as usize,
                offset / columns + piece.bounds.y0 as usize,
            );
            let index = y * width as usize + x;
            assert!(!covered[index], "pieces overlap at {x}, {y}");
            covered[index] = true;
            colors[index] = *color;
            if P::HAS_DEPTH {
                depths[index] = piece.depths[offset];
            }
        }
    }
    image = Image::from_planes(width, height, colors, depths).unwrap();
    image
}

fn check_all<P: Composite>(frames: &[Frame<'_, P>]) {
    let ranks = frames.len();
    let expected = composite_serial(frames).unwrap().to_bytes();
    for strategy in STRATEGIES {
        for destination in [Destination::Rank(ranks / 2), Destination::Distributed] {
            let options = Options { strategy, destination, ..Options::default() };
            let image = over_threads(frames, &options);
            assert!(
                image.to_bytes() == expected,
                "{} {strategy:?} {destination:?}: {ranks} ranks, {}x{} px",
                <P as PixelFormat>::NAME,
                image.width_px(),
                image.height_px()
            );
        }
    }
}

fn check_rank_counts(counts: std::ops::RangeInclusive<usize>) {
    for ranks in counts {
        for (w, h) in SIZES {
            let drawn: Vec<TestFrame> = (0..ranks).map(|rank| draw(rank, (w, h))).collect();
            let frames: Result<Vec<_>, CompositeError> =
                drawn.iter().map(|d| Frame::with_depth(w, h, &d.bytes, &d.depth)).collect();
            check_all(&frames.unwrap());
            let frames: Result<Vec<_>, CompositeError> =
                drawn.iter().map(|d| Frame::premultiplied(w, h, &d.floats)).collect();
            check_all(&frames.unwrap());
            if (w, h) != (64, 33) {
                let frames: Result<Vec<_>, CompositeError> =
                    drawn.iter().map(|d| Frame::with_depth(w, h, &d.floats, &d.depth)).collect();
                check_all(&frames.unwrap());
                let frames: Result<Vec<_>, CompositeError> =
                    drawn.iter().map(|d| Frame::premultiplied(w, h, &d.bytes)).collect();
                check_all(&frames.unwrap());
            }
        }
    }
}

#[test]
fn one_to_eight_ranks_give_the_bits_of_the_serial_reference() {
    check_rank_counts(1..=8);
}

#[test]
fn nine_to_thirteen_ranks_give_the_bits_of_the_serial_reference() {
    check_rank_counts(9..=13);
}

#[test]
fn fourteen_to_seventeen_ranks_give_the_bits_of_the_serial_reference() {
    check_rank_counts(14..=17);
}

/// Shows that the tests above can fail: another grouping gives other bits.
#[test]
fn a_chain_instead_of_the_canonical_grouping_would_be_noticed() {
    let drawn: Vec<TestFrame> = (0..9).map(|rank| draw(rank, (64, 33))).collect();
    let frames: Vec<_> =
        drawn.iter().map(|d| Frame::premultiplied(64, 33, &d.floats).unwrap()).collect();
    let expected = composite_serial(&frames).unwrap();
    let expected_pixels: Vec<_> =
        (0..expected.colors().len()).map(|index| expected.pixel(index)).collect();
    let chained: Vec<_> = (0..expected.colors().len())
        .map(|i| frames.iter().map(|frame| frame.pixel(i)).reduce(composite::combine).unwrap())
        .collect();
    let different = chained.iter().zip(&expected_pixels).filter(|(a, b)| a != b).count();
    assert!(different > 20, "only {different} pixels differ");
    for (a, b) in chained.iter().zip(&expected_pixels) {
        for channel in 0..4 {
            assert!((a.color[channel] - b.color[channel]).abs() < 1e-6);
        }
    }
}

#[test]
fn equal_depths_everywhere_give_the_highest_rank_a_thousand_times() {
    let ranks = 5;
    let colors: Vec<Vec<[u8; 4]>> = (0..ranks).map(|rank| vec![[rank as u8 + 1; 4]; 6]).collect();
    let depth = [0.5; 6];
    let frames: Vec<_> =
        colors.iter().map(|c| Frame::with_depth(3, 2, c, &depth).unwrap()).collect();
    // The group composites several frames: messages of one frame must not mix with those of the
    // next.
    for strategy in STRATEGIES {
        let results = threads::run(ranks, |mut comm| {
            let rank = comm.rank();
            let options = Options { strategy, final_barrier: false, ..Options::default() };
            (0..1000)
                .filter_map(|_| {
                    composite::composite(&mut comm, &frames[rank], &options).unwrap().image
                })
                .filter(|image| image.colors() == [[5; 4]; 6])
                .count()
        });
        assert_eq!(results[0], Ok(1000), "{strategy:?}");
    }
}

#[test]
fn the_order_of_ranks_is_the_order_of_layers() {
    let order = vec![3, 0, 4, 1, 2];
    let drawn: Vec<TestFrame> = (0..5).map(|rank| draw(rank + 20, (31, 5))).collect();
    let frames: Vec<_> =
        drawn.iter().map(|d| Frame::premultiplied(31, 5, &d.floats).unwrap()).collect();
    let sorted: Vec<_> = order.iter().map(|&rank| frames[rank]).collect();
    let expected = composite_serial(&sorted).unwrap().to_bytes();
    assert!(expected != composite_serial(&frames).unwrap().to_bytes());
    for strategy in STRATEGIES {
        let options = Options {
            strategy,
            order: Some(order.clone()),
            destination: Destination::Rank(1),
            ..Options::default()
        };
        assert!(over_threads(&frames, &options).to_bytes() == expected, "{strategy:?}");
    }
}

#[test]
fn ranks_that_drew_nothing_send_no_pixel_and_background_is_exact() {
    let ranks = 6;
    let color = vec![[9_u8; 4]; 64 * 33];
    let depth = vec![f32::NAN; 64 * 33];
    for strategy in STRATEGIES {
        let results = threads::run(ranks, |mut comm| {
            let frame = Frame::with_depth(64, 33, &color, &depth).unwrap();
            let options = Options { strategy, ..Options::default() };
            composite::composite(&mut comm, &frame, &options).unwrap()
        });
        for (rank, result) in results.into_iter().enumerate() {
            let result = result.unwrap();
            assert_eq!(result.report.nan_depths, 64 * 33);
            assert_eq!(result.report.messages_sent, 0, "{strategy:?}");
            if rank == 0 {
                let image = result.image.unwrap();
                assert!(image.colors().iter().all(|c| *c == [0; 4]));
                assert!(image.depths().iter().all(|d| *d == 1.0));
            }
        }
    }
}

/// The smallest non-empty rectangle, in the last corner of the image.
#[test]
fn a_single_pixel_in_the_last_corner_is_not_lost() {
    let (w, h) = (61, 35);
    let empty = vec![[0.0_f32; 4]; 61 * 35];
    let mut single = empty.clone();
    single[61 * 35 - 1] = [0.25, 0.0, 0.0, 0.5];
    for drawn_by in 0..3 {
        let frames: Vec<_> = (0..3)
            .map(|rank| {
                Frame::premultiplied(w, h, if rank == drawn_by { &single } else { &empty }).unwrap()
            })
            .collect();
        for strategy in STRATEGIES {
            let image = over_threads(&frames, &Options { strategy, ..Options::default() });
            assert_eq!(image.colors(), single, "{strategy:?}, drawn by rank {drawn_by}");
        }
    }
}
