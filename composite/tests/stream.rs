//! Tiles submitted during rendering: the same bits, overlap visible in the order of events, and
//! named errors.
use composite::{
    Communicator, CompositeError, Compositor, DepthPixel, Frame, Options, PremultipliedPixel, Rect,
    Strategy, composite_serial, threads,
};
use std::sync::mpsc;
use std::time::{Duration, Instant};

const W: u32 = 96;
const H: u32 = 64;

fn value(rank: usize, x: u32, y: u32) -> u32 {
    (rank as u32 + 1).wrapping_mul(2_654_435_761).wrapping_mul(x + 7).wrapping_mul(y + 3) >> 16
}

fn bounds_of(rank: usize) -> Rect {
    if rank == 3 {
        return Rect::EMPTY;
    }
    let shift = 9 * rank as u32 % 40;
    Rect { x0: shift, y0: shift / 2, x1: (shift + 50).min(W), y1: (shift / 2 + 40).min(H) }
}

/// Tiles of 16x16 of the whole image, in a different order on each rank.
fn tiles(rank: usize) -> Vec<Rect> {
    let mut tiles = Vec::new();
    for y0 in (0..H).step_by(16) {
        for x0 in (0..W).step_by(16) {
            tiles.push(Rect { x0, y0, x1: x0 + 16, y1: y0 + 16 });
        }
    }
    tiles.sort_by_key(|tile| value(rank, tile.x0, tile.y0));
    tiles
}

fn inside(bounds: &Rect, x: u32, y: u32) -> bool {
    bounds.x0 <= x && x < bounds.x1 && bounds.y0 <= y && y < bounds.y1
}

type Planes = (Vec<[u8; 4]>, Vec<f32>);

fn draw_tile(rank: usize, tile: Rect, (colors, depths): &mut Planes) {
    for y in tile.y0..tile.y1 {
        for x in tile.x0..tile.x1 {
            let v = value(rank, x, y);
            if inside(&bounds_of(rank), x, y) && !v.is_multiple_of(5) {
                let index = (y * W + x) as usize;
                colors[index] = [rank as u8 + 1, v as u8, 7, 255];
                depths[index] = (v % 16) as f32 / 16.0;
            }
        }
    }
}

fn blank() -> Planes {
    (vec![[0; 4]; (W * H) as usize], vec![1.0; (W * H) as usize])
}

#[test]
fn a_streamed_frame_has_the_bits_of_the_serial_reference_whatever_the_order_of_tiles() {
    for ranks in [1, 2, 3, 5, 8] {
        let drawn: Vec<Planes> = (0..ranks)
            .map(|rank| {
                let mut planes = blank();
                tiles(rank).into_iter().for_each(|tile| draw_tile(rank, tile, &mut planes));
                planes
            })
            .collect();
        let z: Vec<Frame<'_, DepthPixel<[u8; 4]>>> =
            drawn.iter().map(|(c, d)| Frame::with_depth(W, H, c, d).unwrap()).collect();
        let blended: Vec<Frame<'_, PremultipliedPixel<[u8; 4]>>> =
            drawn.iter().map(|(c, _)| Frame::premultiplied(W, H, c).unwrap()).collect();
        let expected = (
            composite_serial(&z).unwrap().to_bytes(),
            composite_serial(&blended).unwrap().to_bytes(),
        );
        let results = threads::run(ranks, |mut comm| {
            let rank = comm.rank();
            let options = Options { slice_px: Some(500), ..Options::default() };
            let mut compositor = Compositor::new(options.clone());
            let mut blender = Compositor::new(options);
            let mut images = Vec::new();
            for skipped in [0, 3] {
                let mut planes = blank();
                let mut stream = compositor.stream(&mut comm, (W, H), bounds_of(rank)).unwrap();
                for (index, tile) in tiles(rank).into_iter().enumerate() {
                    draw_tile(rank, tile, &mut planes);
                    // Some tiles are left for `finish`.
                    if index >= skipped {
                        stream
                            .tile_done(
                                &Frame::with_depth(W, H, &planes.0, &planes.1).unwrap(),
                                tile,
                            )
                            .unwrap();
                    }
                }
                let done =
                    stream.finish(&Frame::with_depth(W, H, &planes.0, &planes.1).unwrap()).unwrap();
                images.push(done.image.map(|image| image.to_bytes()));
                let mut stream = blender.stream(&mut comm, (W, H), bounds_of(rank)).unwrap();
                let frame = Frame::premultiplied(W, H, &planes.0).unwrap();
                for tile in tiles(rank) {
                    stream.tile_done(&frame, tile).unwrap();
                }
                images.push(stream.finish(&frame).unwrap().image.map(|image| image.to_bytes()));
            }
            images
        });
        let at_root = results[0].as_ref().unwrap();
        for (index, image) in at_root.iter().enumerate() {
            let expected = if index % 2 == 0 { &expected.0 } else { &expected.1 };
            assert!(image.as_ref() == Some(expected), "{ranks} ranks, image {index}");
        }
    }
}

/// Rank 1 renders its last tile only after rank 0 has completed slices: without overlap both would
/// wait for each other.
#[test]
fn slices_are_complete_at_their_owner_before_the_sender_has_rendered_its_last_tile() {
    let (tell, told) = mpsc::channel::<()>();
    let (tell, told) = (std::sync::Mutex::new(Some(tell)), std::sync::Mutex::new(told));
    let colors = vec![[9_u8; 4]; (W * H) as usize];
    let whole = Rect::of_size(W, H);
    let rows = |y: u32| Rect { y0: y, y1: y + 8, ..whole };
    let results = threads::run(2, |mut comm| {
        let rank = comm.rank();
        let depths = vec![if rank == 0 { 0.75 } else { 0.25 }; (W * H) as usize];
        let frame = Frame::with_depth(W, H, &colors, &depths).unwrap();
        let options = Options { slice_px: Some(96 * 8), ..Options::default() };
        let mut compositor = Compositor::new(options);
        let mut stream = compositor.stream(&mut comm, (W, H), whole).unwrap();
        let mut complete_early = 0;
        for y in (0..H).step_by(8) {
            if rank == 1 && y + 8 == H {
                told.lock()
                    .unwrap()
                    .recv_timeout(Duration::from_secs(20))
                    .expect("rank 0 has completed a slice");
            }
            stream.tile_done(&frame, rows(y)).unwrap();
        }
        if rank == 0 {
            let begin = Instant::now();
            while complete_early == 0 && begin.elapsed() < Duration::from_secs(20) {
                complete_early = stream.progress().unwrap();
                std::thread::yield_now();
            }
            tell.lock().unwrap().take().unwrap().send(()).unwrap();
        }
        let done = stream.finish(&frame).unwrap();
        (complete_early, done.image)
    });
    let (complete_early, image) = results[0].as_ref().unwrap();
    assert!(*complete_early >= 1);
    assert!(image.as_ref().unwrap().depths().iter().all(|depth| *depth == 0.25));
}

#[test]
fn misuse_of_a_stream_is_named_on_every_rank() {
    let colors = vec![[9_u8; 4]; (W * H) as usize];
    let frame = Frame::premultiplied(W, H, &colors).unwrap();
    let whole = Rect::of_size(W, H);

    // A tile submitted twice.
    let results = threads::run(3, |mut comm| {
        let rank = comm.rank();
        let mut compositor = Compositor::new(Options::default());
        // The group may have ended before this rank begins.
        let mut stream = match compositor.stream(&mut comm, (W, H), whole) {
            Ok(stream) => stream,
            Err(error) => return error.to_string(),
        };
        if rank == 1 {
            stream.tile_done(&frame, Rect::of_size(8, 8)).unwrap();
            return stream.tile_done(&frame, whole).unwrap_err().to_string();
        }
        stream.finish(&frame).unwrap_err().to_string()
    });
    for text in results {
        assert!(text.unwrap().contains("were handed in twice"));
    }

    // A stream that is dropped before it is finished.
    let results = threads::run(2, |mut comm| {
        let rank = comm.rank();
        let mut compositor = Compositor::new(Options::default());
        match compositor.stream(&mut comm, (W, H), whole) {
            Ok(_) if rank == 1 => String::new(),
            Ok(stream) => stream.finish(&frame).unwrap_err().to_string(),
            Err(error) => error.to_string(),
        }
    });
    assert!(results[0].as_ref().unwrap().contains("dropped before it was finished"), "{results:?}");

    // Strategies that need the whole image, and ranks of which only one streams.
    let mut comm = threads::group(1).remove(0);
    let mut compositor: Compositor<PremultipliedPixel<[u8; 4]>> =
        Compositor::new(Options { strategy: Strategy::Tree, ..Options::default() });
    assert!(matches!(compositor.stream(&mut comm, (W, H), whole), Err(CompositeError::Options(_))));
    let results = threads::run(2, |mut comm| {
        let rank = comm.rank();
        let mut compositor = Compositor::new(Options::default());
        if rank == 0 {
            return compositor.stream(&mut comm, (W, H), whole).err().unwrap().to_string();
        }
        compositor.composite(&mut comm, &frame).unwrap_err().to_string()
    });
    for text in results {
        assert!(text.unwrap().contains("another size, pixel format"));
    }
}
