//! Hard cases by name: sizes, rank counts, formats, order. All strategies, over threads.
use composite::{
    Communicator, Composite, CompositeError, Compositor, DeepFrame, DepthPixel, Destination,
    Fragment, Frame, NetworkCosts, Options, PixelFormat, PremultipliedPixel, Rect, Strategy,
    composite_deep, composite_deep_serial, composite_serial, f16, threads,
};
use mix64::mix64;

#[path = "../src/mix64.rs"]
mod mix64;

const STRATEGIES: [Strategy; 4] =
    [Strategy::DirectSend, Strategy::Tree, Strategy::BinarySwap, Strategy::RadixK { k: 8 }];

/// A pseudorandom number below 2^16 from four numbers.
fn noise(a: usize, b: usize, c: usize, d: usize) -> u64 {
    mix64((a as u64) << 48 ^ (b as u64) << 32 ^ (c as u64) << 16 ^ d as u64) & 0xffff
}

/// One rank's planes, half empty, with ties.
fn planes<C: composite::Color>(rank: usize, w: usize, h: usize) -> (Vec<C>, Vec<f32>) {
    let pixel = |index: usize| {
        let v = noise(rank + 1, w, h, index);
        let on = rank % 4 != 2 && !v.is_multiple_of(3);
        let alpha = (v >> 4) as f32 / 4096.0;
        let channels = [alpha * 0.5, alpha * 0.25, alpha, alpha.max(0.01)];
        let color = if on { C::from_f32(channels) } else { C::TRANSPARENT };
        (color, if on { (v % 7) as f32 / 7.0 } else { 1.0 })
    };
    (0..w * h).map(pixel).unzip()
}

/// The same group and the same compositors for many frames: buffers of one frame must not affect
/// the next.
fn check_many<P: Composite + Send>(
    ranks: usize,
    sizes: &[(usize, usize)],
    frame: impl Fn(usize, usize, usize) -> (Vec<P::Color>, Vec<f32>) + Sync,
    make: impl for<'a> Fn(u32, u32, &'a [P::Color], &'a [f32]) -> Result<Frame<'a, P>, CompositeError>
    + Sync,
) {
    let results = threads::run(ranks, |mut comm| {
        let mut compositors: Vec<Compositor<P>> = STRATEGIES
            .iter()
            .map(|&strategy| {
                Compositor::new(Options { strategy, final_barrier: false, ..Options::default() })
            })
            .collect();
        for &(w, h) in sizes {
            let (colors, depths) = frame(comm.rank(), w, h);
            let own = make(w as u32, h as u32, &colors, &depths)?;
            let expected = (comm.rank() == 0).then(|| {
                let all: Vec<_> = (0..ranks).map(|rank| frame(rank, w, h)).collect();
                let frames: Vec<_> =
                    all.iter().map(|(c, d)| make(w as u32, h as u32, c, d).unwrap()).collect();
                composite_serial(&frames).unwrap()
            });
            for compositor in &mut compositors {
                let image = compositor.composite(&mut comm, &own)?.image;
                let strategy = compositor.options().strategy;
                assert!(
                    image.as_ref().map(|i| i.to_bytes()) == expected.as_ref().map(|i| i.to_bytes()),
                    "{} {strategy:?}, {ranks} ranks, {w}x{h}",
                    <P as PixelFormat>::NAME
                );
                if let Some(image) = image {
                    compositor.recycle(image);
                }
            }
        }
        Ok::<_, CompositeError>(())
    });
    results.into_iter().for_each(|result| result.unwrap().unwrap());
}

#[test]
fn every_size_from_1x1_to_67x5_on_one_to_nine_ranks() {
    let sizes: Vec<(usize, usize)> = (1..=67).flat_map(|w| (1..=5).map(move |h| (w, h))).collect();
    for ranks in 1..=9 {
        check_many::<DepthPixel<[u8; 4]>>(ranks, &sizes, planes, |w, h, c, d| {
            Frame::with_depth(w, h, c, d)
        });
        // A sixth of the sizes for blending.
        let some: Vec<_> = sizes.iter().copied().skip(ranks % 6).step_by(6).collect();
        check_many::<PremultipliedPixel<[f32; 4]>>(ranks, &some, planes, |w, h, c, _| {
            Frame::premultiplied(w, h, c)
        });
    }
}

#[test]
fn sixteen_bit_formats_give_the_bits_of_the_serial_reference() {
    let sizes = [(1, 1), (67, 3), (130, 9)];
    for ranks in [2, 3, 6, 8] {
        check_many::<PremultipliedPixel<[u16; 4]>>(ranks, &sizes, planes, |w, h, c, _| {
            Frame::premultiplied(w, h, c)
        });
        check_many::<PremultipliedPixel<[f16; 4]>>(ranks, &sizes, planes, |w, h, c, _| {
            Frame::premultiplied(w, h, c)
        });
        check_many::<PremultipliedPixel<[u8; 4]>>(ranks, &sizes, planes, |w, h, c, _| {
            Frame::premultiplied(w, h, c)
        });
        check_many::<DepthPixel<[u16; 4]>>(ranks, &sizes, planes, |w, h, c, d| {
            Frame::with_depth(w, h, c, d)
        });
        check_many::<DepthPixel<[f16; 4]>>(ranks, &sizes, planes, |w, h, c, d| {
            Frame::with_depth(w, h, c, d)
        });
    }
}

#[test]
fn odd_rank_counts_up_to_127_and_images_smaller_than_the_group() {
    for ranks in [33, 127] {
        let sizes = [(1, 1), (5, 3), (90, 40)];
        check_many::<DepthPixel<[u8; 4]>>(ranks, &sizes, planes, |w, h, c, d| {
            Frame::with_depth(w, h, c, d)
        });
        check_many::<PremultipliedPixel<[u8; 4]>>(ranks, &sizes, planes, |w, h, c, _| {
            Frame::premultiplied(w, h, c)
        });
    }
}

#[test]
fn nan_depths_are_counted_once_with_and_without_bounds_and_by_every_strategy() {
    let (w, h) = (40_u32, 30_u32);
    let colors = vec![[1_u8; 4]; 1200];
    let mut depths = vec![0.5_f32; 1200];
    for index in (0..1200).step_by(7) {
        depths[index] = if index % 2 == 0 { f32::NAN } else { -f32::NAN };
    }
    let inside = Rect { x0: 3, y0: 2, x1: 37, y1: 28 };
    let frame = Frame::with_depth(w, h, &colors, &depths).unwrap();
    for (frame, expected) in [
        (frame, 172),
        (frame.with_bounds(inside).unwrap(), frame.with_bounds(inside).unwrap().nan_depths()),
    ] {
        assert_eq!(frame.nan_depths(), expected);
        for strategy in STRATEGIES {
            let results = threads::run(5, |mut comm| {
                let options = Options { strategy, ..Options::default() };
                composite::composite(&mut comm, &frame, &options).unwrap().report.nan_depths
            });
            assert!(
                results.iter().all(|found| *found == Ok(expected)),
                "{strategy:?}: {results:?} for {expected}"
            );
        }
    }
}

#[test]
fn ranks_with_different_strategies_or_options_hear_of_it_at_once() {
    let colors = [[9_u8; 4]; 21];
    let options = [
        Options { strategy: Strategy::Tree, ..Options::default() },
        Options { strategy: Strategy::RadixK { k: 4 }, ..Options::default() },
        Options { destination: Destination::Distributed, ..Options::default() },
        Options { depth: false, ..Options::default() },
        Options { order: Some(vec![2, 1, 0]), ..Options::default() },
        // Ranks with a final barrier would wait for those without.
        Options { final_barrier: false, ..Options::default() },
        Options { verify: true, ..Options::default() },
    ];
    for other in options {
        let results = threads::run(3, |mut comm| {
            let frame = Frame::premultiplied(7, 3, &colors).unwrap();
            let options = if comm.rank() == 1 { other.clone() } else { Options::default() };
            composite::composite(&mut comm, &frame, &options).unwrap_err().to_string()
        });
        for text in results {
            let text = text.unwrap();
            assert!(text.contains("another size, pixel format, strategy"), "{other:?}: {text}");
        }
    }
}

#[test]
fn the_automatic_strategy_is_the_same_on_every_rank_and_follows_a_given_network() {
    let slow_messages = NetworkCosts { latency_secs: 2e-3, overhead_secs: 1e-3, byte_secs: 1e-12 };
    let colors = vec![[9_u8; 4]; 64 * 64];
    for network in [None, Some(NetworkCosts::QDR), Some(slow_messages)] {
        let chosen = threads::run(8, |mut comm| {
            let frame = Frame::premultiplied(64, 64, &colors).unwrap();
            let compositor =
                Compositor::new(Options { strategy: Strategy::Automatic, ..Options::default() });
            let mut compositor = match network {
                Some(network) => compositor.with_network(network),
                None => compositor,
            };
            compositor.composite(&mut comm, &frame).unwrap().report.strategy
        });
        assert!(
            chosen
                .iter()
                .all(|strategy| strategy == &chosen[0] && *strategy != Ok(Strategy::Automatic))
        );
        if network == Some(slow_messages) {
            assert_eq!(chosen[0], Ok(Strategy::Tree));
        }
    }
}

// ---- Accuracy of formats: 128 faint layers ------------------------------------------------------
const LAYERS: usize = 128;
/// Pixels of the experiment `accuracy-composite`, each with different layers.
const PIXELS: usize = 512 * 512;

/// Premultiplied colour of `layer` at pixel `k`, as in the experiment `accuracy-composite`: three
/// channels with different shares of the opacity, which vary by a tenth between pixels and layers,
/// in golden-ratio steps.
fn layer_color(alpha: f64, layer: usize, k: usize) -> [f64; 4] {
    let vary = |step: f64| 1.0 + 0.1 * ((layer as f64 * 0.618_034 + k as f64 * step).fract() - 0.5);
    let a = alpha * vary(0.754_878);
    [a * 0.9 * vary(0.569_840), a * 0.5, a * 0.2, a]
}

/// Largest error of these layers against `exact`, in units of 1/255. It includes the rounding of
/// the colours and opacities themselves to the format.
fn error_of_layers<C: composite::Color>(layers: &[Vec<[f64; 4]>], exact: &[[f64; 4]]) -> f64
where
    PremultipliedPixel<C>: Composite<Color = C>,
{
    let stored = |color: &[f64; 4]| C::from_f32(color.map(|channel| channel as f32));
    let layers: Vec<Vec<C>> =
        layers.iter().map(|layer| layer.iter().map(stored).collect()).collect();
    let width_px = exact.len() as u32;
    let frames: Vec<Frame<'_, PremultipliedPixel<C>>> =
        layers.iter().map(|colors| Frame::premultiplied(width_px, 1, colors).unwrap()).collect();
    let found = composite_serial(&frames).unwrap();
    let channels = found.colors().iter().map(|color| color.to_f32()).zip(exact);
    channels
        .flat_map(|(found, exact)| {
            (0..4).map(move |i| 255.0 * (f64::from(found[i]) - exact[i]).abs())
        })
        .fold(0.0, f64::max)
}

/// The layers composited front to back.
fn sum_of_layers(layers: &[Vec<[f64; 4]>]) -> Vec<[f64; 4]> {
    let mut sums = vec![[0.0_f64; 4]; layers[0].len()];
    for layer in layers {
        for (sum, color) in sums.iter_mut().zip(layer) {
            let left = 1.0 - sum[3];
            (0..4).for_each(|i| sum[i] += left * color[i]);
        }
    }
    sums
}

/// The largest error of each format in the newest record of `accuracy-composite`.
fn recorded() -> Vec<(String, f64)> {
    let runs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench/runs");
    let mut files: Vec<_> = std::fs::read_dir(&runs)
        .expect("records")
        .filter_map(|run| Some(run.ok()?.path().join("accuracy-composite.csv")))
        .filter(|file| file.is_file())
        .collect();
    files.sort();
    let text = std::fs::read_to_string(files.last().expect("a record")).expect("a record");
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let columns: Vec<&str> = rows.next().expect("a head").split(',').collect();
    let at = |name: &str| {
        columns.iter().position(|c| c.split(' ').next() == Some(name)).expect("a column")
    };
    let (format, error) = (at("format"), at("error"));
    let mut worst: Vec<(String, f64)> = Vec::new();
    for row in rows {
        let cells: Vec<&str> = row.split(',').collect();
        let (name, error) =
            (cells[format].to_string(), cells[error].parse::<f64>().expect("a number"));
        match worst.iter_mut().find(|(known, _)| *known == name) {
            Some((_, most)) => *most = error.max(*most),
            None => worst.push((name, error)),
        }
    }
    worst
}

#[test]
fn errors_of_128_faint_layers_are_those_of_the_table() {
    /// Pixels per batch, so that the layers fit into the cache.
    const AT_ONCE: usize = 1 << 10;
    let mut worst = [("u8", 0.0_f64), ("u16", 0.0), ("f16", 0.0), ("f32", 0.0)];
    for alpha in [0.005, 0.02, 0.1] {
        for first in (0..PIXELS).step_by(AT_ONCE) {
            let of_layer =
                |layer| (first..first + AT_ONCE).map(|k| layer_color(alpha, layer, k)).collect();
            let layers: Vec<Vec<[f64; 4]>> = (0..LAYERS).map(of_layer).collect();
            let exact = sum_of_layers(&layers);
            let errors = [
                error_of_layers::<[u8; 4]>(&layers, &exact),
                error_of_layers::<[u16; 4]>(&layers, &exact),
                error_of_layers::<[f16; 4]>(&layers, &exact),
                error_of_layers::<[f32; 4]>(&layers, &exact),
            ];
            worst.iter_mut().zip(errors).for_each(|((_, worst), error)| *worst = worst.max(error));
        }
    }
    let recorded = recorded();
    for (format, error) in worst {
        let (_, most) =
            recorded.iter().find(|(name, _)| name == format).expect("a format of the record");
        // The same bits as in the experiment; only the arithmetic of the error itself may be
        // rounded differently.
        assert!((error - most).abs() <= 1e-9 * most, "{format}: {error}, and {most} in the record");
    }
}

#[test]
fn errors_of_128_equal_white_layers_are_those_of_the_book() {
    fn error_of_white_layers<C: composite::Color>(alpha: f64) -> f64
    where
        PremultipliedPixel<C>: Composite<Color = C>,
    {
        error_of_layers::<C>(&vec![vec![[alpha; 4]]; LAYERS], &[[1.0 - (1.0 - alpha).powi(128); 4]])
    }
    for alpha in [0.005, 0.02, 0.1] {
        let u16_error = error_of_white_layers::<[u16; 4]>(alpha);
        let f16_error = error_of_white_layers::<[f16; 4]>(alpha);
        let f32_error = error_of_white_layers::<[f32; 4]>(alpha);
        assert!(u16_error <= 0.07, "u16, alpha {alpha}: {u16_error}");
        assert!(f16_error <= 0.25, "f16, alpha {alpha}: {f16_error}");
        assert!(f32_error <= 1.3e-4, "f32, alpha {alpha}: {f32_error}");
    }
    // Makes sure that the limits can fail: eight bits exceed them.
    assert!(error_of_white_layers::<[u8; 4]>(0.005) > 10.0);
}

#[test]
fn the_book_quotes_the_record_of_128_faint_layers() {
    let book =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/composite/formats.md");
    let book = std::fs::read_to_string(book).expect("the book");
    let recorded = recorded();
    for (format, row) in [
        ("u8", "| premultiplied RGBA8 |"),
        ("u16", "| premultiplied RGBA16 |"),
        ("f16", "| premultiplied RGBA `f16` |"),
        ("f32", "| premultiplied RGBA `f32` |"),
    ] {
        let (_, most) =
            recorded.iter().find(|(name, _)| name == format).expect("a format of the record");
        let line = book.lines().find(|line| line.starts_with(row)).expect("its row");
        let cell = line.split('|').nth(3).expect("its error").trim();
        let quoted: f64 = cell.split(' ').next().and_then(|n| n.parse().ok()).expect("a number");
        // Two digits, rounded up.
        assert!(
            quoted >= *most && quoted <= 1.05 * most,
            "{format}: `{cell}`, and {most} in the record"
        );
    }
}

#[test]
fn an_integer_format_errs_by_two_steps_a_layer_at_most_whatever_the_colours() {
    // Half a step where a colour is stored, half where it is composited. The remaining light has an
    // error of a step per layer likewise, and a layer adds no more of these steps to a colour than
    // it removes by its opacity: all layers together add one per layer.
    const MOST: f64 = 2.0 * LAYERS as f64;
    fn steps_of_error<C: composite::Color>(steps: f64, layers: &[Vec<[f64; 4]>]) -> f64
    where
        PremultipliedPixel<C>: Composite<Color = C>,
    {
        steps / 255.0 * error_of_layers::<C>(layers, &sum_of_layers(layers))
    }
    fn check<C: composite::Color>(steps: f64)
    where
        PremultipliedPixel<C>: Composite<Color = C>,
    {
        // Too faint to be stored at all: everything is lost.
        let alpha = 0.499 / steps;
        let faint = steps_of_error::<C>(steps, &vec![vec![[alpha; 4]]; LAYERS]);
        let all = steps * (1.0 - (1.0 - alpha).powi(LAYERS as i32));
        assert!((faint - all).abs() < 1e-9 * all && faint <= MOST, "{faint} steps of {all}");
        // Colours and opacities of all sizes, and some that are lost by rounding in every layer.
        let unit = |c, layer, pixel| noise(c, 17, layer, pixel) as f64 / 65536.0;
        let color = |layer, pixel| {
            let most = unit(2, 0, pixel);
            let alpha = most.powi(3) * unit(4, layer, pixel);
            let lost = (0.499 / (steps * most.max(1e-3))).min(1.0);
            [unit(1, 0, pixel), lost, unit(3, 0, pixel), 1.0].map(|share| share * alpha)
        };
        let of_layer = |layer| (0..2000).map(|pixel| color(layer, pixel)).collect();
        let layers: Vec<Vec<[f64; 4]>> = (0..LAYERS).map(of_layer).collect();
        let worst = steps_of_error::<C>(steps, &layers);
        // These colours are always the same. Their measured error was 31.4 steps of 8 bits and 31.6
        // of 16.
        assert!((31.0..=32.0).contains(&worst), "{worst} steps");
    }
    check::<[u8; 4]>(255.0);
    check::<[u16; 4]>(65535.0);
}

// ---- Order and depth ----------------------------------------------------------------------------
#[test]
fn ranks_that_reach_behind_those_after_them_are_refused_where_they_meet() {
    let colors = [[0.1_f32; 4]; 100];
    let left = Rect { x0: 0, y0: 0, x1: 5, y1: 10 };
    let right = Rect { x0: 5, y0: 0, x1: 10, y1: 10 };
    let run = |bounds: [Rect; 2], ranges: [[f32; 2]; 2]| {
        threads::run(2, |mut comm| {
            let rank = comm.rank();
            let frame =
                Frame::premultiplied(10, 10, &colors).unwrap().with_bounds(bounds[rank]).unwrap();
            composite::composite(
                &mut comm,
                &frame.with_depth_range(ranges[rank]),
                &Options::default(),
            )
            .map(|_| ())
        })
    };
    let whole = Rect::of_size(10, 10);
    assert_eq!(run([whole; 2], [[0.0, 0.5], [0.5, 1.0]])[0], Ok(Ok(())));
    assert_eq!(run([left, right], [[0.5, 1.0], [0.0, 0.5]])[0], Ok(Ok(())));
    for result in run([whole, right], [[0.0, 0.75], [0.5, 1.0]]) {
        let text = result.unwrap().unwrap_err().to_string();
        assert!(
            text.contains(
                "rank 0 is to be in front of rank 1, but reaches to depth 0.75, behind its nearest \
                 0.5"
            ),
            "{text}"
        );
        assert!(text.contains("composite_deep"));
    }
}

/// One rank's fragments, the end indices of its pixels, and its surfaces.
type Dealt = (Vec<Fragment>, Vec<usize>, Vec<[f32; 4]>, Vec<f32>);

/// Fragments of a scene, distributed to ranks at random: layers of all ranks alternate in depth.
fn deal(ranks: usize, w: usize, h: usize) -> Vec<Dealt> {
    let mut dealt: Vec<_> = (0..ranks)
        .map(|_| (Vec::new(), Vec::new(), vec![[0.0; 4]; w * h], vec![f32::INFINITY; w * h]))
        .collect();
    for pixel in 0..w * h {
        for layer in 0..noise(1, 2, 3, pixel) as usize % 60 {
            let v = noise(4, 5, layer, pixel);
            let alpha = 0.02 + (v % 64) as f32 / 400.0;
            let depth = (noise(6, 7, layer, pixel) << 6 | layer as u64) as f32 / (1 << 22) as f32;
            let fragment = Fragment {
                color: [alpha * 0.9, alpha * 0.1, alpha * (layer % 2) as f32, alpha],
                depth,
            };
            dealt[(v >> 6) as usize % ranks].0.push(fragment);
        }
        for (rank, (fragments, ends, colors, depths)) in dealt.iter_mut().enumerate() {
            ends.push(fragments.len());
            // The same surface for every number of ranks, on one of them.
            if noise(8, 9, 1, pixel).is_multiple_of(3)
                && noise(8, 9, 2, pixel) as usize % ranks == rank
            {
                colors[pixel] = [0.2, 0.4, 0.6, 1.0];
                depths[pixel] = noise(8, 9, 3, pixel) as f32 / 65536.0;
            }
        }
    }
    dealt
}

#[test]
fn layers_of_ranks_that_reach_into_each_other_are_sorted_exactly_for_every_partition() {
    let (w, h) = (37_usize, 11_usize);
    let mut one_node = None;
    for ranks in [1, 2, 3, 7, 16] {
        let dealt = deal(ranks, w, h);
        let frames: Vec<DeepFrame<'_>> = dealt
            .iter()
            .map(|(f, ends, c, d)| {
                DeepFrame::new(w as u32, h as u32, f, ends).unwrap().with_opaque(c, d).unwrap()
            })
            .collect();
        let reference = composite_deep_serial(&frames).unwrap();
        let results = threads::run(ranks, |mut comm| {
            let rank = comm.rank();
            composite_deep(&mut comm, &frames[rank], &Options::default()).unwrap().image
        });
        let image = results[0].as_ref().unwrap().as_ref().unwrap();
        for (found, exact) in image.colors().iter().zip(&reference) {
            for channel in 0..4 {
                assert!((f64::from(found[channel]) - exact[channel]).abs() <= 1e-6);
            }
        }
        // The bits of one node that has all fragments.
        let bytes = image.to_bytes();
        assert!(*one_node.get_or_insert_with(|| bytes.clone()) == bytes, "{ranks} ranks");
    }
    // Makes sure that the test can fail: blending rank by rank is wrong here.
    let dealt = deal(3, w, h);
    let flattened: Vec<Vec<[f32; 4]>> = dealt
        .iter()
        .map(|(f, ends, c, d)| {
            let frame =
                DeepFrame::new(w as u32, h as u32, f, ends).unwrap().with_opaque(c, d).unwrap();
            composite_deep_serial(&[frame]).unwrap().iter().map(|p| p.map(|c| c as f32)).collect()
        })
        .collect();
    let frames: Vec<Frame<'_, PremultipliedPixel<[f32; 4]>>> =
        flattened.iter().map(|c| Frame::premultiplied(w as u32, h as u32, c).unwrap()).collect();
    assert!(composite_serial(&frames).unwrap().to_bytes() != one_node.unwrap());
}

#[test]
fn deep_frames_that_contradict_themselves_are_refused() {
    let fragment = [Fragment { color: [0.1; 4], depth: 0.5 }];
    assert!(matches!(DeepFrame::new(2, 1, &fragment, &[1]), Err(CompositeError::FrameSize { .. })));
    let error = DeepFrame::new(2, 1, &fragment, &[1, 0]).unwrap_err().to_string();
    assert!(error.contains("must not decrease"), "{error}");
    assert!(
        DeepFrame::new(2, 1, &fragment, &[0, 1])
            .unwrap()
            .with_opaque(&[[0.0; 4]; 2], &[1.0])
            .is_err()
    );
}
