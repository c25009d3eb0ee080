//! Frames in one memory, merged without messages, and nodes of several ranks: the bits of the
//! serial reference.
use composite::{
    Color, Communicator, Composite, CompositeError, Compositor, DepthPixel, Destination, Frame,
    Image, Options, PremultipliedPixel, Rect, SimdLevel, composite_serial, composite_shared, f16,
    shared_memory_group, threads,
};
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex};

const SIZE: (u32, u32) = (70, 37);

/// One rank's planes, and a rectangle around what it drew (for odd ranks only; for others it must
/// be determined).
struct TestFrame {
    bytes: Vec<[u8; 4]>,
    floats: Vec<[f32; 4]>,
    depth: Vec<f32>,
    bounds: Option<Rect>,
}

fn draw(rank: usize) -> TestFrame {
    let mut seed = 1 + rank as u64 * 977;
    let mut random = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 40) as u32
    };
    let (x0, y0) = (random() % 40, random() % 20);
    let bounds = Rect { x0, y0, x1: x0 + random() % 31, y1: y0 + random() % 18 };
    let mut drawn = TestFrame {
        bytes: vec![],
        floats: vec![],
        depth: vec![],
        bounds: (rank % 2 == 1).then_some(bounds),
    };
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let inside = bounds.x0 <= x && x < bounds.x1 && bounds.y0 <= y && y < bounds.y1;
            let on = inside && random() % 4 > 0;
            let alpha = (random() % 256) as f32 / 255.0;
            drawn.floats.push(if on { [alpha * 0.3, alpha * 0.1, alpha, alpha] } else { [0.0; 4] });
            drawn.bytes.push(if on { [rank as u8 + 1, x as u8, y as u8, 255] } else { [0; 4] });
            drawn.depth.push(match random() % 8 {
                _ if !on => 1.0,
                0 => f32::NAN,
                1 => -0.0,
                2 => 0.0,
                other => other as f32 / 8.0,
            });
        }
    }
    drawn
}

fn z(drawn: &TestFrame) -> Frame<'_, DepthPixel<[u8; 4]>> {
    let frame = Frame::with_depth(SIZE.0, SIZE.1, &drawn.bytes, &drawn.depth).unwrap();
    drawn.bounds.map_or(frame, |bounds| frame.with_bounds(bounds).unwrap())
}

fn blended(drawn: &TestFrame) -> Frame<'_, PremultipliedPixel<[f32; 4]>> {
    let frame = Frame::premultiplied(SIZE.0, SIZE.1, &drawn.floats).unwrap();
    drawn.bounds.map_or(frame, |bounds| frame.with_bounds(bounds).unwrap())
}

fn check_shared<P: Composite>(frames: &[Frame<'_, P>]) {
    let expected = composite_serial(frames).unwrap();
    let mut spare = None;
    for threads in [1, 3, 100] {
        let threads = NonZeroUsize::new(threads).unwrap();
        let image = composite_shared(frames, threads, true, spare.take()).unwrap();
        assert!(image.to_bytes() == expected.to_bytes(), "{} ranks", frames.len());
        let colors = composite_shared(frames, threads, false, None).unwrap();
        assert!(colors.colors() == expected.colors() && colors.depths().is_empty());
        spare = Some(image);
    }
}

#[test]
fn merging_in_one_memory_gives_the_bits_of_the_serial_reference() {
    for ranks in (1..=17).chain([64]) {
        let drawn: Vec<TestFrame> = (0..ranks).map(draw).collect();
        check_shared(&drawn.iter().map(z).collect::<Vec<_>>());
        check_shared(&drawn.iter().map(blended).collect::<Vec<_>>());
    }
}

/// Threads as nodes, each with its own ranks; returns the image of the first node.
fn over_nodes<P: Composite>(nodes: &[&[Frame<'_, P>]]) -> Vec<u8> {
    let results = threads::run(nodes.len(), |mut comm| {
        let mut compositor = Compositor::new(Options::default());
        let frames = nodes[comm.rank()];
        // Twice, so that buffers of the first frame are overwritten.
        let threads = NonZeroUsize::new(2).unwrap();
        compositor.composite_node(&mut comm, frames, threads).unwrap();
        compositor.composite_node(&mut comm, frames, threads).unwrap()
    });
    let results: Vec<_> = results.into_iter().map(|result| result.unwrap()).collect();
    results[0].image.as_ref().unwrap().to_bytes()
}

#[test]
fn nodes_of_several_ranks_give_the_bits_of_all_ranks() {
    for sizes in
        [vec![4], vec![2, 2], vec![1, 3, 2], vec![5, 1], vec![2; 4], vec![1; 5], vec![3, 3, 3]]
    {
        let drawn: Vec<TestFrame> = (0..sizes.iter().sum()).map(draw).collect();
        let (z, blended): (Vec<_>, Vec<_>) = drawn.iter().map(|d| (z(d), blended(d))).unzip();
        let (mut z_nodes, mut blended_nodes, mut first) = (Vec::new(), Vec::new(), 0);
        for size in &sizes {
            z_nodes.push(&z[first..first + size]);
            blended_nodes.push(&blended[first..first + size]);
            first += size;
        }
        let flat = composite_serial(&z).unwrap().to_bytes();
        assert!(over_nodes(&z_nodes) == flat, "depth, nodes of {sizes:?}");

        // Blending: the reference over the nodes' references, which equals that over all ranks if
        // all counts are powers of two.
        let found = over_nodes(&blended_nodes);
        let of_nodes: Vec<_> =
            blended_nodes.iter().map(|node| composite_serial(node).unwrap()).collect();
        let as_frames: Vec<_> = of_nodes
            .iter()
            .map(|image| {
                Frame::<PremultipliedPixel<[f32; 4]>>::premultiplied(SIZE.0, SIZE.1, image.colors())
                    .unwrap()
            })
            .collect();
        assert!(
            found == composite_serial(&as_frames).unwrap().to_bytes(),
            "blended, nodes of {sizes:?}"
        );
        let equal = sizes.iter().all(|size| *size == sizes[0]);
        if equal && sizes[0].is_power_of_two() && sizes.len().is_power_of_two() {
            assert!(
                found == composite_serial(&blended).unwrap().to_bytes(),
                "blended, nodes of {sizes:?}"
            );
        }
    }
}

#[test]
fn nan_depths_of_all_ranks_of_a_node_are_counted() {
    let drawn: Vec<TestFrame> = (0..4).map(draw).collect();
    let frames: Vec<_> = drawn.iter().map(z).collect();
    let nan: u64 = frames.iter().map(Frame::nan_depths).sum();
    assert!(nan > 0);
    let mut comm = threads::group(1).remove(0);
    let mut compositor = Compositor::new(Options::default());
    let done = compositor.composite_node(&mut comm, &frames, NonZeroUsize::MIN).unwrap();
    assert_eq!(done.report.nan_depths, nan);
}

#[test]
fn ranks_at_a_table_give_the_bits_of_the_serial_reference_frame_after_frame() {
    for ranks in [1, 2, 5, 8] {
        let drawn: Vec<TestFrame> = (0..ranks).map(draw).collect();
        let frames: Vec<_> = drawn.iter().map(z).collect();
        let images: Vec<Arc<Image<DepthPixel<[u8; 4]>>>> = drawn
            .iter()
            .map(|d| {
                Arc::new(
                    Image::from_planes(SIZE.0, SIZE.1, d.bytes.clone(), d.depth.clone()).unwrap(),
                )
            })
            .collect();
        let expected = composite_serial(&frames).unwrap();
        let members: Vec<_> = shared_memory_group(ranks)
            .into_iter()
            .map(|shared_rank| Mutex::new(Some(shared_rank)))
            .collect();
        let results = threads::run(ranks, |mut comm| {
            let rank = comm.rank();
            let mut shared_rank = members[rank].lock().unwrap().take().unwrap();
            for repeat in 0..4 {
                // With and without depths, to the first rank and to the last.
                let root = if repeat < 2 { 0 } else { ranks - 1 };
                let options = Options {
                    depth: repeat % 2 == 0,
                    destination: Destination::Rank(root),
                    ..Options::default()
                };
                let bounds = frames[rank].bounds();
                let done =
                    shared_rank.composite(&mut comm, &images[rank], bounds, &options).unwrap();
                assert_eq!(done.report.nan_depths, frames[rank].nan_depths());
                assert_eq!(done.image.is_some(), rank == root);
                if let Some(image) = done.image {
                    assert!(image.colors() == expected.colors());
                    assert!(image.depths() == if options.depth { expected.depths() } else { &[] });
                    shared_rank.recycle(image);
                }
            }
        });
        assert!(results.iter().all(Result::is_ok));
    }
}

#[test]
fn a_table_names_what_it_cannot_do_and_who_did_not_come() {
    let image = Arc::new(
        Image::<PremultipliedPixel<[u8; 4]>>::from_planes(1, 1, vec![[1; 4]], vec![]).unwrap(),
    );
    let members: Vec<_> = shared_memory_group(2)
        .into_iter()
        .map(|shared_rank| Mutex::new(Some(shared_rank)))
        .collect();
    let results = threads::run(2, |mut comm| {
        let mut shared_rank = members[comm.rank()].lock().unwrap().take().unwrap();
        if comm.rank() == 1 {
            return Ok(());
        }
        let options = Options { timeout: std::time::Duration::from_secs(20), ..Options::default() };
        shared_rank.composite(&mut comm, &image, Rect::of_size(1, 1), &options).map(|_| ())
    });
    assert!(results[0].as_ref().unwrap().as_ref().unwrap_err().to_string().contains("rank 1"));
    let mut comm = threads::group(1).remove(0);
    let mut shared_rank = shared_memory_group(1).remove(0);
    let options = Options { destination: Destination::Distributed, ..Options::default() };
    let error =
        shared_rank.composite(&mut comm, &image, Rect::of_size(1, 1), &options).unwrap_err();
    assert!(matches!(error, CompositeError::Options(_)));
}

/// Frames of any format: planes of random values everywhere, of which only rectangles count.
fn random_images<P: Composite>(
    ranks: usize,
    (width, height): (u32, u32),
) -> Vec<(Arc<Image<P>>, Rect)> {
    let mut seed = 977_u64;
    let mut random = move |below: u32| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as u32 % below
    };
    let pixels = (width * height) as usize;
    (0..ranks)
        .map(|rank| {
            // Runs of active and inactive pixels, so that whole blocks are also active or inactive.
            let mut run = (0, false);
            let mut colors = Vec::with_capacity(pixels);
            let mut depths = Vec::with_capacity(pixels);
            for _ in 0..pixels {
                if run.0 == 0 {
                    run = (1 + random(90), random(2) == 0);
                }
                run.0 -= 1;
                let alpha = random(256) as f32 / 255.0;
                let color = if run.1 {
                    [0.5 * alpha, 0.25 * alpha, alpha * rank as f32 / 64.0, alpha]
                } else {
                    [0.0; 4]
                };
                colors.push(P::Color::from_f32(color));
                depths.push(match random(12) {
                    _ if !run.1 => 1.0,
                    0 => f32::NAN,
                    1 => f32::NEG_INFINITY,
                    2 => f32::INFINITY,
                    3 => -0.0,
                    4 => 0.0,
                    5 => f32::from_bits(1.0_f32.to_bits() - 1),
                    other => other as f32 / 16.0,
                });
            }
            let (x0, y0) = (random(width), random(height));
            let bounds = match rank % 4 {
                0 => Rect::of_size(width, height),
                3 if rank % 8 == 3 => Rect::EMPTY,
                _ => Rect {
                    x0,
                    y0,
                    x1: x0 + 1 + random(width - x0),
                    y1: y0 + 1 + random(height - y0),
                },
            };
            let depths = if P::HAS_DEPTH { depths } else { Vec::new() };
            (Arc::new(Image::from_planes(width, height, colors, depths).unwrap()), bounds)
        })
        .collect()
}

fn check_levels<P: Composite>(frame: impl for<'a> Fn(&'a Image<P>) -> Frame<'a, P> + Sync) {
    for (ranks, size) in [(3, (64, 5)), (9, (200, 19)), (70, (331, 7)), (5, (63, 3)), (6, (1, 40))]
    {
        let images = random_images::<P>(ranks, size);
        let order: Vec<usize> = (0..ranks).map(|place| (place * 2 + 1) % ranks).collect();
        let order = if ranks % 2 == 1 { order } else { (0..ranks).rev().collect() };
        let in_order: Vec<Frame<'_, P>> = order
            .iter()
            .map(|&rank| frame(&images[rank].0).with_bounds(images[rank].1).unwrap())
            .collect();
        let expected = composite_serial(&in_order).unwrap();
        let members: Vec<_> = shared_memory_group(ranks)
            .into_iter()
            .map(|shared_rank| Mutex::new(Some(shared_rank)))
            .collect();
        let results = threads::run(ranks, |mut comm| {
            let rank = comm.rank();
            let mut shared_rank = members[rank].lock().unwrap().take().unwrap();
            for level in SimdLevel::available() {
                let options =
                    Options { order: Some(order.clone()), simd: Some(level), ..Options::default() };
                let done = shared_rank
                    .composite(&mut comm, &images[rank].0, images[rank].1, &options)
                    .unwrap();
                let nan = frame(&images[rank].0).with_bounds(images[rank].1).unwrap().nan_depths();
                assert_eq!(done.report.nan_depths, nan, "{level:?}, rank {rank} of {ranks}");
                if let Some(image) = done.image {
                    assert!(
                        image.to_bytes() == expected.to_bytes(),
                        "{}, {level:?}, {ranks} ranks",
                        P::NAME
                    );
                    shared_rank.recycle(image);
                }
            }
        });
        assert!(results.iter().all(Result::is_ok));
    }
}

#[test]
fn all_levels_merge_all_formats_in_one_memory_to_the_same_bits() {
    macro_rules! depth_formats {
        ($($color:ty),*) => {$(check_levels::<DepthPixel<$color>>(|image| {
            Frame::with_depth(image.width_px(), image.height_px(), image.colors(), image.depths()).unwrap()
        });)*};
    }
    macro_rules! blended_formats {
        ($($color:ty),*) => {$(check_levels::<PremultipliedPixel<$color>>(|image| {
            Frame::premultiplied(image.width_px(), image.height_px(), image.colors()).unwrap()
        });)*};
    }
    depth_formats!([u8; 4], [u16; 4], [f16; 4], [f32; 4]);
    blended_formats!([u8; 4], [u16; 4], [f16; 4], [f32; 4]);
}
