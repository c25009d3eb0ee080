//! Who owns which band of the image in direct send: contiguous bands of about equal work.
use crate::frame::Frame;
use crate::pixel::Composite;
use std::ops::Range;

/// Work is counted in chunks of consecutive pixels; a band begins and ends at a chunk.
const CHUNKS: usize = 1024;
/// An active pixel costs a transfer and a join, a pixel of the result only its place in the band: their ratio, about.
const ACTIVE_WEIGHT: u128 = 4;

/// Pixels per chunk: at least one, and about eight chunks for every rank where there are that many pixels.
pub(crate) fn chunk_px(image_pixels: usize, ranks: usize) -> usize {
    image_pixels.div_ceil(CHUNKS.max(ranks.saturating_mul(8))).max(1)
}

/// Active pixels of a frame in every chunk.
pub(crate) fn active_per_chunk<P: Composite>(frame: &Frame<'_, P>, chunk_px: usize) -> Vec<u64> {
    (0..frame.len())
        .step_by(chunk_px)
        .map(|start| {
            let end = (start + chunk_px).min(frame.len());
            (start..end).filter(|&index| frame.pixel(index).is_active()).count() as u64
        })
        .collect()
}

/// Cuts the image into one band a rank, so that each has about the same work. `active[rank][chunk]`.
pub(crate) fn balanced(active: &[Vec<u64>], image_pixels: usize, chunk_px: usize) -> Vec<Range<usize>> {
    let chunks = image_pixels.div_ceil(chunk_px);
    let work = |chunk: usize| {
        let drawn: u128 = active.iter().map(|of_rank| u128::from(of_rank[chunk])).sum();
        drawn * ACTIVE_WEIGHT + chunk_px.min(image_pixels - chunk * chunk_px) as u128
    };
    let total: u128 = (0..chunks).map(work).sum();
    let ranks = active.len() as u128;
    let mut bands = Vec::with_capacity(active.len());
    let (mut start, mut chunk, mut done) = (0, 0, 0_u128);
    for band in 1..=ranks {
        // Half of a chunk's work decides on which side of a cut it falls, so cuts are rounded and not always late.
        while chunk < chunks && (2 * done + work(chunk)) * ranks <= 2 * total * band {
            done += work(chunk);
            chunk += 1;
        }
        let end = if band == ranks { image_pixels } else { (chunk * chunk_px).min(image_pixels) };
        bands.push(start..end);
        start = end;
    }
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_the_image_once_whatever_was_drawn() {
        for (image, ranks) in [(0, 3), (1, 5), (21, 4), (2112, 17), (5000, 7)] {
            let chunk = chunk_px(image, ranks);
            let chunks = image.div_ceil(chunk);
            for salt in 0..3_u64 {
                let active: Vec<Vec<u64>> = (0..ranks)
                    .map(|r| (0..chunks).map(|c| (r as u64 * 7 + c as u64) * salt % 2).collect())
                    .collect();
                let bands = balanced(&active, image, chunk);
                assert_eq!(bands.len(), ranks);
                let mut next = 0;
                for band in &bands {
                    assert_eq!(band.start, next);
                    assert!(band.end >= band.start);
                    next = band.end;
                }
                assert_eq!(next, image);
            }
        }
    }

    #[test]
    fn a_picture_in_one_corner_is_shared_by_all_ranks() {
        // Everything is drawn in the last tenth of the image.
        let (image, ranks) = (100_000, 8);
        let chunk = chunk_px(image, ranks);
        let of_rank: Vec<u64> =
            (0..image.div_ceil(chunk)).map(|c| if c * chunk >= 90_000 { chunk as u64 } else { 0 }).collect();
        let bands = balanced(&vec![of_rank; ranks], image, chunk);
        let drawn: Vec<usize> = bands.iter().map(|b| b.end.saturating_sub(b.start.max(90_000))).collect();
        let most = drawn.iter().max().unwrap();
        assert!(*most < 10_000 / 5, "one rank has {most} of 10000 drawn pixels: {drawn:?}");
    }
}
