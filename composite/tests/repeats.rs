//! The same frame a thousand times, on more ranks than processors: one image.
use composite::{
    Communicator, Compositor, DepthPixel, Frame, Options, PremultipliedPixel, Strategy, threads,
};

const RANKS: usize = 17;
const REPEATS: usize = 1000;
const WIDTH: u32 = 31;
const HEIGHT: u32 = 17;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// Equal depths of several ranks in every pixel, and colours whose sums depend on their order.
fn drawn_by(rank: usize) -> (Vec<[f32; 4]>, Vec<f32>) {
    let channel = |k: usize, c: usize| ((k * 31 + rank * 17 + c * 7) % 101) as f32 / 303.0;
    let color = |k: usize| [0, 1, 2, 3].map(|c| channel(k, c));
    let depth = |k: usize| ((k + rank) % 4) as f32 / 4.0;
    ((0..PIXELS).map(color).collect(), (0..PIXELS).map(depth).collect())
}

#[test]
fn a_thousand_repeats_on_seventeen_ranks_give_one_image() {
    for strategy in [Strategy::DirectSend, Strategy::RadixK { k: 4 }] {
        let options = Options { strategy, ..Options::default() };
        let different = threads::run(RANKS, |mut comm| {
            let (color, depth) = drawn_by(comm.rank());
            let with_depth =
                Frame::<DepthPixel<[f32; 4]>>::with_depth(WIDTH, HEIGHT, &color, &depth);
            let with_depth = with_depth.expect("a frame");
            let blended = Frame::premultiplied(WIDTH, HEIGHT, &color).expect("a frame");
            let mut nearest = Compositor::new(options.clone());
            let mut over = Compositor::<PremultipliedPixel<[f32; 4]>>::new(options.clone());
            let (mut first, mut different) = (None, 0);
            for _ in 0..REPEATS {
                let near = nearest.composite(&mut comm, &with_depth).expect("an image").image;
                let all = over.composite(&mut comm, &blended).expect("an image").image;
                let (Some(near), Some(all)) = (near, all) else { continue };
                let bytes = [near.to_bytes(), all.to_bytes()];
                different += usize::from(*first.get_or_insert_with(|| bytes.clone()) != bytes);
                nearest.recycle(near);
                over.recycle(all);
            }
            (different, first.is_some())
        });
        let on_rank_0 = different[0].as_ref().expect("no rank panics");
        assert_eq!(*on_rank_0, (0, true), "{strategy:?}");
    }
}
