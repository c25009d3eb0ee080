//! Replicated data: every rank holds the whole scene and renders some pieces of the image (thesis
//! sections 3.2.2 and 4.2.3).
//!
//! Pieces are small and distributed along a lattice, because the costly pixels of an image are
//! close together and every rank should get some of them. Bands of whole rows, tried first, stop
//! scaling when there are as many ranks as bands (32 for 1024 rows).
use super::request_reply::{RankChannel, Tag};
use super::wire_format::{read_images, words_per_pixel, write_image};
use super::{Activity, FrameError, FrameOptions, FrameOutput};
use crate::comm::Communicator;
use rt_core::camera::Camera;
use rt_core::frame::Frame;
use rt_core::render::{Crop, RenderOptions, Renderer};
use rt_core::scene::Scene;

/// Side of a piece in pixels, and the least number of pieces per rank for which it is used. Small
/// pieces balance the load, but coherent rays are cheaper: on one thread the wavelet with shadows
/// and ambient occlusion takes 1.57 s in pieces of 64 pixels, 1.68 s in those of 32, 1.90 s in
/// those of 16, 2.3 s in those of 8 (1024 x 1024). The slowest rank's share of those costs, added
/// up over each rank's pieces, is least with these bounds for 1 to 128 ranks: pieces of 8 pixels
/// for 128 ranks have an imbalance of 4 % instead of 15 %, but cost 21 % more.
const PIECES: [(u32, usize); 3] = [(64, 32), (32, 11), (16, 6)];
/// Side if there are too few of all those.
const SMALLEST: u32 = 8;

/// Renders an image of a scene that every rank holds. Each rank renders some square pieces spread
/// over the image, with sides from 64 pixels for few ranks to 8 for many. Every rank must call it
/// with the same arguments. Time limits and error limits apply to each piece on its own.
///
/// # Errors
/// Any fault on any rank ends the frame for all.
pub fn ray_parallel(
    comm: &mut dyn Communicator,
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    frame_options: &FrameOptions,
) -> Result<FrameOutput, FrameError> {
    let mut channel = RankChannel::new(comm, frame_options.timeout);
    let result = render(&mut channel, scene, camera, options, frame_options);
    if let Err(error) = &result {
        channel.abort(&error.to_string());
    }
    let frame = result?;
    Ok(FrameOutput { frame, report: channel.report })
}

fn render(
    channel: &mut RankChannel<'_>,
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    frame_options: &FrameOptions,
) -> Result<Option<Frame>, FrameError> {
    let (rank, size) = (channel.rank(), channel.size());
    let area = options.area();
    let mut renderer = Renderer::new();
    let mut mine = Vec::new();
    for piece in pieces(area, rank, size) {
        let crop = Crop { x: area.x + piece.x, y: area.y + piece.y, ..piece };
        let cropped = RenderOptions { crop: Some(crop), ..options.clone() };
        let mut draw = || renderer.render(scene, camera, &cropped);
        // One thread per rank where ranks share a machine.
        let output = if frame_options.parallel { draw()? } else { alone(&mut draw)? };
        channel.report.rays += output.report.rays;
        channel.report.effects = output.report.effects;
        write_image(&output.frame, &mut mine);
        renderer.recycle(output.frame);
        channel.alive();
    }
    channel.report.camera_rays = channel.report.rays.primary;
    channel.report.secondary_rays = "every rank holds the whole scene".into();
    channel.record_span(Activity::Render);
    let Some(root) = frame_options.root else { return Ok(None) };
    if root >= size {
        return Err(FrameError::Comm(crate::comm::CommError::NoSuchRank { peer: root, size }));
    }
    if rank != root {
        if !mine.is_empty() {
            channel.send(root, Tag::Tiles, &mine)?;
        }
        channel.record_span(Activity::Collect);
        return Ok(None);
    }
    let depth = camera.background_depth() as f32;
    let mut picture = Frame::blank(area.width, area.height, options.layers, depth);
    let per_pixel = words_per_pixel(options.layers);
    read_images(&mut picture, pieces(area, rank, size), &mine)
        .ok_or_else(|| channel.message_error(rank, "pieces", mine.len()))?;
    let pixels = |from: usize| {
        pieces(area, from, size).map(|c| (c.width * c.height) as usize).sum::<usize>()
    };
    let sources =
        (0..size).filter(|&from| from != rank).map(|from| (from, pixels(from) * per_pixel));
    let sources: Vec<_> = sources.filter(|(_, words)| *words > 0).collect();
    channel.receive(Tag::Tiles, "pieces", sources, |channel, from, words| {
        let fits = read_images(&mut picture, pieces(area, from, size), &words);
        channel.record_span(Activity::Collect);
        fits.ok_or_else(|| channel.message_error(from, "pieces", words.len()))
    })?;
    channel.record_span(Activity::Collect);
    Ok(Some(picture))
}

thread_local! {
    /// A pool of this thread only: work in it uses no other thread and steals no other work
    /// meanwhile.
    static ALONE: Option<rayon::ThreadPool> =
        rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().ok();
}

/// Runs `work` on this thread alone.
fn alone<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    ALONE.with(|pool| match pool {
        Some(pool) => pool.install(work),
        // This thread belongs to a pool already.
        None => work(),
    })
}

/// The pieces of `rank`, relative to the area, row by row. Piece (i, j) goes to rank i + s j modulo
/// the number of ranks: a rank-1 lattice, with s near the golden section of the number of ranks, so
/// that a rank's pieces are about as far apart as possible.
fn pieces(area: Crop, rank: usize, size: usize) -> impl Iterator<Item = Crop> {
    let side = piece_side(area, size);
    let (columns, rows) = (area.width.div_ceil(side) as usize, area.height.div_ceil(side) as usize);
    let step = lattice_step(size);
    (0..rows).flat_map(move |j| {
        let first = (rank + size - j * step % size) % size;
        (first..columns).step_by(size).map(move |i| {
            let (x, y) = (i as u32 * side, j as u32 * side);
            Crop { x, y, width: side.min(area.width - x), height: side.min(area.height - y) }
        })
    })
}

/// Side of the pieces of an area for a number of ranks, in pixels.
fn piece_side(area: Crop, ranks: usize) -> u32 {
    let pieces =
        |side: u32| area.width.div_ceil(side) as usize * area.height.div_ceil(side) as usize;
    PIECES
        .iter()
        .find(|(side, least)| pieces(*side) >= least * ranks)
        .map_or(SMALLEST, |(side, _)| *side)
}

/// The number nearest to the golden section of `size` that is coprime to it.
fn lattice_step(size: usize) -> usize {
    let golden = (size as f64 * 0.618_034).round() as usize;
    let coprime = |n: &usize| (1..size).contains(n) && gcd(*n, size) == 1;
    (0..size).flat_map(|d| [golden + d, golden.saturating_sub(d)]).find(coprime).unwrap_or(0)
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_the_area_once_and_every_rank_has_as_many() {
        for (width, height) in [(1024, 1024), (100, 37), (16, 16), (1, 1)] {
            let area = Crop { x: 5, y: 9, width, height };
            for size in [1, 2, 3, 7, 16, 64, 127, 128] {
                let mut seen = vec![0; (width * height) as usize];
                let mut counts = Vec::new();
                for rank in 0..size {
                    let mine: Vec<Crop> = pieces(area, rank, size).collect();
                    counts.push(mine.len());
                    for c in mine {
                        for y in c.y..c.y + c.height {
                            for x in c.x..c.x + c.width {
                                seen[(y * width + x) as usize] += 1;
                            }
                        }
                    }
                }
                assert!(seen.iter().all(|n| *n == 1), "{width}x{height}, {size} ranks");
                if width == 1024 {
                    let (least, most) =
                        (counts.iter().min().unwrap(), counts.iter().max().unwrap());
                    // A row of 64 pieces is half a round of 128 ranks, so counts are not exact: 30
                    // to 34 there.
                    assert!(most - least <= 2 + most / 8, "{size} ranks: {least}..{most}");
                }
            }
        }
    }

    #[test]
    fn pieces_are_large_for_few_ranks_and_small_for_many_or_in_small_pictures() {
        let side = |pixels: u32, ranks| {
            piece_side(Crop { x: 0, y: 0, width: pixels, height: pixels }, ranks)
        };
        assert_eq!(
            [1, 8, 12, 93, 128, 1000].map(|ranks| side(1024, ranks)),
            [64, 64, 32, 32, 16, 8]
        );
        assert_eq!([1, 9, 16, 128].map(|ranks| side(320, ranks)), [32, 32, 16, 8]);
        assert_eq!(side(1, 1), 8);
    }
}
