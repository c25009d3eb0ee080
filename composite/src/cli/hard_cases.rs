//! `composite check --hard`: cases that compositors are known to get wrong, by name, with every
//! strategy, over any transport.
use crate::comm::Communicator;
use crate::compositor::{Compositor, Options};
use crate::error::CompositeError;
use crate::frame::Frame;
use crate::mix64::mix64;
use crate::network_costs::NetworkCosts;
use crate::pixel::{Composite, DepthPixel, PremultipliedPixel};
use crate::reference::composite_serial;
use crate::strategies::Strategy;
use std::time::Duration;

/// A network on which it pays to send as little as possible: with the automatic strategy, machines
/// merge first where they can.
pub(super) const SLOW: NetworkCosts =
    NetworkCosts { latency_secs: 2e-3, overhead_secs: 1e-3, byte_secs: 1e-8 };

/// What each rank draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Case {
    /// The same depth on all ranks: the highest rank wins, always.
    EqualDepths,
    /// NaN, infinite, negative, denormal depths and both zeros, in all combinations of neighbours.
    StrangeDepths,
    /// Half empty, with ties.
    Sizes,
    /// Every third rank has drawn nothing.
    EmptyRanks,
    /// No rank has drawn anything.
    AllEmpty,
}

const STRANGE: [f32; 12] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    -1.0,
    -0.0,
    0.0,
    1e-45,
    -1e-45,
    f32::MIN_POSITIVE,
    1.0,
    0.999_999_94,
    0.5,
];

/// A pseudorandom number below 2^16 from three numbers.
fn noise(a: usize, b: usize, c: usize) -> u64 {
    mix64((a as u64) << 40 ^ (b as u64) << 20 ^ c as u64) & 0xffff
}

impl Case {
    /// Sizes in pixels that are checked on `ranks` ranks. The 335 sizes from 1x1 to 67x5 are
    /// divided among the rank counts of a group of `most`.
    fn sizes(self, ranks: usize, most: usize) -> Vec<(u32, u32)> {
        match self {
            Case::Sizes => {
                let all = (0..67 * 5).filter(|k| k % most == ranks % most);
                all.map(|k| (1 + k % 67, 1 + k / 67)).map(|(w, h)| (w as u32, h as u32)).collect()
            }
            // The first has fewer pixels than any group has ranks.
            _ => vec![(1, 1), (37, 5)],
        }
    }

    fn draw(self, rank: usize, pixels: usize) -> (Vec<[u8; 4]>, Vec<f32>) {
        let pixel = |k: usize| {
            let n = noise(rank, pixels, k);
            let color = [1 + (n & 0x7f) as u8, (n >> 7) as u8, rank as u8, 255];
            let nothing = ([0; 4], 1.0);
            match self {
                Case::EqualDepths => (color, 0.25),
                Case::StrangeDepths => (color, STRANGE[(n >> 3) as usize % STRANGE.len()]),
                Case::AllEmpty => nothing,
                Case::EmptyRanks if rank % 3 == 1 => nothing,
                Case::EmptyRanks | Case::Sizes if n.is_multiple_of(3) => nothing,
                Case::EmptyRanks | Case::Sizes => (color, (n % 7) as f32 / 7.0),
            }
        };
        (0..pixels).map(pixel).unzip()
    }
}

/// Number of images composited and of those with a wrong bit, on rank 0. The image of equal depths
/// is composited `repeats` times.
pub(super) fn run(
    comm: &mut dyn Communicator,
    strategies: &[Strategy],
    in_memory: bool,
    most: usize,
    repeats: u64,
    timeout: Duration,
) -> anyhow::Result<[u64; 2]> {
    let mut count = [0, 0];
    let cases =
        [Case::EqualDepths, Case::StrangeDepths, Case::Sizes, Case::EmptyRanks, Case::AllEmpty];
    let options = |strategy| Options {
        strategy,
        in_memory,
        timeout,
        final_barrier: false,
        ..Options::default()
    };
    for strategy in strategies {
        let mut depth =
            Compositor::<DepthPixel<[u8; 4]>>::new(options(*strategy)).with_network(SLOW);
        let mut blend =
            Compositor::<PremultipliedPixel<[f32; 4]>>::new(options(*strategy)).with_network(SLOW);
        for case in cases {
            for (w, h) in case.sizes(comm.size(), most) {
                let pixels = (w * h) as usize;
                let drawn = |rank| case.draw(rank, pixels);
                let times =
                    if case == Case::EqualDepths { repeats / strategies.len() as u64 } else { 1 };
                one(comm, &mut depth, times.max(1), &mut count, drawn, |(c, d)| {
                    Frame::with_depth(w, h, c, d)
                })?;
                let glass = |rank| {
                    let (colors, depths) = case.draw(rank, pixels);
                    let thin = |(c, d): (&[u8; 4], &f32)| {
                        let alpha = if *d < 1.0 { 0.4 } else { 0.0 };
                        [c[0], c[1], c[2], 255].map(|v| alpha * f32::from(v) / 255.0)
                    };
                    colors.iter().zip(&depths).map(thin).collect::<Vec<[f32; 4]>>()
                };
                one(comm, &mut blend, 1, &mut count, glass, |c| Frame::premultiplied(w, h, c))?;
            }
        }
    }
    Ok(count)
}

/// Composites the frames that `draw` returns for each rank `times` times and compares with the
/// serial reference.
fn one<P: Composite, D>(
    comm: &mut dyn Communicator,
    compositor: &mut Compositor<P>,
    times: u64,
    count: &mut [u64; 2],
    draw: impl Fn(usize) -> D,
    frame: impl for<'a> Fn(&'a D) -> Result<Frame<'a, P>, CompositeError>,
) -> anyhow::Result<()> {
    let own = draw(comm.rank());
    let mut expected = None;
    for _ in 0..times {
        let Some(image) = compositor.composite(comm, &frame(&own)?)?.image else { continue };
        if expected.is_none() {
            let all: Vec<D> = (0..comm.size()).map(&draw).collect();
            let frames: Result<Vec<_>, _> = all.iter().map(&frame).collect();
            expected = Some(composite_serial(&frames?)?.to_bytes());
        }
        let same = expected.as_ref() == Some(&image.to_bytes());
        *count = [count[0] + 1, count[1] + u64::from(!same)];
        compositor.recycle(image);
    }
    Ok(())
}
