//! Assigns the rows of an image to ranks, and encodes rows as messages that leave out uncovered
//! pixels.

use super::codec::{MalformedMessage, Reader, put_pods};
use bytemuck::Pod;

/// The rows of a band: one row of ray packets. Every rank therefore traces the same packets that
/// one process would.
pub(crate) const BAND: usize = 16;

/// The part of an image that one rank renders: every `count`-th band starting at `index`, which
/// spreads the load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RowShare {
    pub(crate) index: u32,
    pub(crate) count: u32,
}

super::codec::wire_struct!(RowShare { index, count });

impl RowShare {
    /// The whole image.
    pub(crate) const WHOLE: RowShare = RowShare { index: 0, count: 1 };

    /// True when a band belongs to this share.
    pub(crate) fn has(self, band: usize) -> bool {
        band % self.count as usize == self.index as usize
    }

    /// The bands of this share in an image of `w` x `h` pixels, as ranges of pixels.
    pub(crate) fn pixels(self, w: usize, h: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        let bands = h.div_ceil(BAND);
        (0..bands)
            .filter(move |b| self.has(*b))
            .map(move |b| b * BAND * w..((b + 1) * BAND).min(h) * w)
    }
}

/// Encodes pixels: two layers, and which pixels are covered.
pub(crate) fn put_rows<A: Pod, B: Pod>(
    out: &mut Vec<u8>,
    share: RowShare,
    [w, h]: [usize; 2],
    (a, b): (&[A], &[B]),
    there: impl Fn(usize) -> bool,
) {
    // Lengths of uncovered and covered runs, alternating.
    let mut runs: Vec<u32> = Vec::new();
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for range in share.pixels(w, h) {
        let mut at = range.start;
        while at < range.end {
            let begin = (at..range.end).find(|i| there(*i)).unwrap_or(range.end);
            let end = (begin..range.end).find(|i| !there(*i)).unwrap_or(range.end);
            runs.extend([(begin - at) as u32, (end - begin) as u32]);
            first.extend_from_slice(a.get(begin..end).unwrap_or(&[]));
            second.extend_from_slice(b.get(begin..end).unwrap_or(&[]));
            at = end;
        }
    }
    put_pods(out, &runs);
    put_pods(out, &first);
    put_pods(out, &second);
}

/// Decodes such rows into an image and returns the number of received pixels. An empty layer
/// receives none.
pub(crate) fn get_rows<A: Pod, B: Pod>(
    from: &mut Reader<'_>,
    share: RowShare,
    [w, h]: [usize; 2],
    (a, b): (&mut [A], &mut [B]),
) -> Result<usize, MalformedMessage> {
    let runs: Vec<u32> = from.pods()?;
    let (first, second): (Vec<A>, Vec<B>) = (from.pods()?, from.pods()?);
    let (mut runs, mut done) = (runs.chunks_exact(2), 0);
    for range in share.pixels(w, h) {
        let mut at = range.start;
        while at < range.end {
            let run = runs.next().ok_or_else(|| from.fault("rows end too early"))?;
            let begin = at + run[0] as usize;
            let (end, n) = (begin + run[1] as usize, run[1] as usize);
            if end > range.end || (end == at) {
                return Err(from.fault(format!("pixels {begin} to {end} are not of this band")));
            }
            copy(a, begin, &first, done, n).ok_or_else(|| from.fault("pixels without a value"))?;
            copy(b, begin, &second, done, n).ok_or_else(|| from.fault("pixels without a value"))?;
            (at, done) = (end, done + n);
        }
    }
    let fits = |have: usize, want: bool| have == if want { done } else { 0 };
    if runs.next().is_some()
        || !fits(first.len(), !a.is_empty())
        || !fits(second.len(), !b.is_empty())
    {
        return Err(from.fault("more rows than were asked for"));
    }
    Ok(done)
}

fn copy<T: Pod>(to: &mut [T], begin: usize, from: &[T], done: usize, n: usize) -> Option<()> {
    if to.is_empty() {
        return Some(());
    }
    to.get_mut(begin..begin + n)?.copy_from_slice(from.get(done..done + n)?);
    Some(())
}

/// The largest size in bytes of the rows of a share, with `pixel` bytes per pixel.
pub(crate) fn most_bytes(share: RowShare, [w, h]: [usize; 2], pixel: usize) -> usize {
    // The worst case covers every second pixel: two run lengths for each of them.
    share.pixels(w, h).map(|r| r.len() * (pixel + 4) + 16).sum::<usize>() + 64
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [13, 70];

    fn picture() -> (Vec<[u8; 4]>, Vec<f32>) {
        let n = SIZE[0] * SIZE[1];
        let there = |i: usize| i % 7 < 3 || (200..260).contains(&i);
        let depth: Vec<f32> =
            (0..n).map(|i| if there(i) { i as f32 * 0.001 } else { 2.0 }).collect();
        let color = (0..n).map(|i| if there(i) { [i as u8, 1, 2, 3] } else { [0; 4] }).collect();
        (color, depth)
    }

    #[test]
    fn shares_cover_each_pixel_once_and_come_back_as_they_were() {
        let (color, depth) = picture();
        for count in [1, 2, 3, 7] {
            let (mut c, mut d) = (vec![[0_u8; 4]; color.len()], vec![2.0_f32; color.len()]);
            let mut pixels = 0;
            for index in 0..count {
                let share = RowShare { index, count };
                let mut bytes = Vec::new();
                put_rows(&mut bytes, share, SIZE, (&color, &depth), |i| depth[i] < 1.5);
                assert!(bytes.len() <= most_bytes(share, SIZE, 8));
                let mut from = Reader::new(&bytes);
                get_rows(&mut from, share, SIZE, (&mut c, &mut d)).expect("rows");
                from.end().expect("nothing more");
                pixels += share.pixels(SIZE[0], SIZE[1]).map(|r| r.len()).sum::<usize>();
            }
            assert_eq!(
                (c, d, pixels),
                (color.clone(), depth.clone(), color.len()),
                "{count} ranks"
            );
        }
    }

    #[test]
    fn rows_that_are_not_those_asked_for_are_refused() {
        let (color, depth) = picture();
        let share = RowShare { index: 0, count: 2 };
        let mut bytes = Vec::new();
        put_rows(&mut bytes, share, SIZE, (&color, &depth), |i| depth[i] < 1.5);
        let (mut c, mut d) = (color.clone(), depth.clone());
        let other = RowShare { index: 1, count: 2 };
        assert!(get_rows(&mut Reader::new(&bytes), other, SIZE, (&mut c, &mut d)).is_err());
        for n in 0..bytes.len() {
            assert!(
                get_rows(&mut Reader::new(&bytes[..n]), share, SIZE, (&mut c, &mut d)).is_err()
            );
        }
        let mut zeros = Vec::new();
        put_pods(&mut zeros, &[0_u32; 64]);
        put_pods::<[u8; 4]>(&mut zeros, &[]);
        put_pods::<f32>(&mut zeros, &[]);
        assert!(
            get_rows(&mut Reader::new(&zeros), share, SIZE, (&mut c, &mut d)).is_err(),
            "runs of nothing"
        );
    }
}
