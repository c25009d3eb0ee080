//! Who owns which part of the image in direct send: rectangles of about equal work, near to what their owners drew.
//!
//! The image is halved again and again, and so are the ranks: those that drew further left (or up) get
//! the left (or upper) part, which is as large as their share of the work. Compared with bands of rows this needs fewer messages
//! (a small object meets a few tiles and not many bands; at 127 ranks in slabs it is a few instead of all), and part of what is
//! to be joined is already where it must go.
use crate::rect::Rect;

/// An active pixel costs a transfer and a join, a pixel of the result only its place: their ratio, about.
const DRAWN_WEIGHT: u64 = 2;

/// One tile for every place; `drawn[place]` is the rectangle that it drew in. Tiles are disjoint and cover every `drawn`, and
/// some may be empty.
pub(crate) fn balanced(drawn: &[Rect]) -> Vec<Rect> {
    let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
    let mut tiles = vec![Rect::EMPTY; drawn.len()];
    let mut places: Vec<usize> = (0..drawn.len()).collect();
    let present: Vec<Rect> = drawn.iter().copied().filter(|rect| !rect.is_empty()).collect();
    if !whole.is_empty() {
        divide(whole, &mut places, &present, drawn, &mut tiles);
    }
    tiles
}

/// Divides `region` among `places`; `present` are the rectangles that meet it.
fn divide(region: Rect, places: &mut [usize], present: &[Rect], drawn: &[Rect], tiles: &mut [Rect]) {
    if let [place] = *places {
        tiles[place] = region;
        return;
    }
    if region.is_empty() || places.is_empty() {
        return;
    }
    let half = places.len() / 2;
    let share = |columns: bool| cut(region, columns, present, half, places.len());
    let (row, column) = (share(false), share(true));

    // A rectangle that a cut crosses is one message more. Rows lie in one piece in memory and columns do not, so the image is cut
    // across its columns only where that saves many messages: below, between or beside small objects, and across slabs.
    let crossed_by_row = present.iter().filter(|rect| rect.y0 < row && row < rect.y1).count();
    let crossed_by_column = present.iter().filter(|rect| rect.x0 < column && column < rect.x1).count();
    let is_flat = region.height() < 2;
    let across_columns = region.width() > 1 && (is_flat || crossed_by_row > 2 * crossed_by_column + 1);
    let at = if across_columns { column } else { row };

    // Ranks by the centre of what they drew; those that drew nothing work in the middle, where they fill up.
    places.sort_by_key(|&place| {
        let rect = if drawn[place].is_empty() { region } else { drawn[place] };
        let (from, to) = if across_columns { (rect.x0, rect.x1) } else { (rect.y0, rect.y1) };
        (u64::from(from) + u64::from(to), place)
    });
    let (first, second) = places.split_at_mut(half);
    let (mut before, mut behind) = (region, region);
    if across_columns {
        (before.x1, behind.x0) = (at, at);
    } else {
        (before.y1, behind.y0) = (at, at);
    }
    for (part, its_places) in [(before, first), (behind, second)] {
        let meeting: Vec<Rect> =
            present.iter().map(|rect| rect.intersection(&part)).filter(|rect| !rect.is_empty()).collect();
        divide(part, its_places, &meeting, drawn, tiles);
    }
}

/// Where to cut `region` so that the part before has `share` of `shares` of the work.
fn cut(region: Rect, across_columns: bool, present: &[Rect], share: usize, shares: usize) -> u32 {
    let (start, end) = if across_columns { (region.x0, region.x1) } else { (region.y0, region.y1) };
    let length = (end - start) as usize;

    // Work of every column (or row), from where rectangles begin and end.
    let mut change = vec![0_i64; length + 1];
    for rect in present {
        let (from, to, across) =
            if across_columns { (rect.x0, rect.x1, rect.height()) } else { (rect.y0, rect.y1, rect.width()) };
        change[(from - start) as usize] += across as i64;
        change[(to - start) as usize] -= across as i64;
    }
    let own = if across_columns { region.height() } else { region.width() } as u64;
    let mut work = Vec::with_capacity(length);
    let (mut here, mut total) = (0_i64, 0_u64);
    for step in &change[..length] {
        here += step;
        total += DRAWN_WEIGHT * here as u64 + own;
        work.push(total);
    }

    // Rounded to the nearer side, so that cuts are not always late.
    let wanted = (u128::from(total) * share as u128 / shares as u128) as u64;
    let before = work.partition_point(|&sum| sum < wanted);
    let (below, above) =
        (if before == 0 { 0 } else { work[before - 1] }, work.get(before).copied().unwrap_or(total));
    let nearer = if above.saturating_sub(wanted) < wanted - below { before + 1 } else { before };
    start + nearer.min(length) as u32
}

/// `tile` in slices of rows, of about `pixels` each.
pub(crate) fn slices(tile: Rect, pixels: usize) -> Vec<Rect> {
    let count = tile.pixels().div_ceil(pixels.max(1)).clamp(1, tile.height().max(1));
    let row = |i: usize| tile.y0 + (tile.height() * i / count) as u32;
    (0..count).map(|i| Rect { y0: row(i), y1: row(i + 1), ..tile }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_partition(tiles: &[Rect], whole: Rect) {
        assert_eq!(tiles.iter().map(Rect::pixels).sum::<usize>(), whole.pixels());
        for (i, a) in tiles.iter().enumerate() {
            assert!(whole.contains(a));
            for b in &tiles[..i] {
                assert!(a.intersection(b).is_empty(), "{a:?} meets {b:?}");
            }
        }
    }

    #[test]
    fn tiles_cover_what_was_drawn_once_whatever_it_was() {
        let mut seed = 5_u32;
        let mut random = |below: u32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) % below
        };
        for ranks in [1, 2, 3, 5, 7, 16, 17, 127] {
            for _ in 0..20 {
                let drawn: Vec<Rect> = (0..ranks)
                    .map(|_| {
                        let (x0, y0) = (random(60), random(40));
                        Rect { x0, y0, x1: x0 + random(20), y1: y0 + random(15) }
                    })
                    .collect();
                let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
                check_partition(&balanced(&drawn), whole);
            }
            assert!(balanced(&vec![Rect::EMPTY; ranks]).iter().all(Rect::is_empty));
        }
    }

    #[test]
    fn a_picture_in_one_corner_is_shared_by_all_ranks() {
        // One rank draws everything and the others in a corner of a tenth of it.
        let all = Rect::of_size(1000, 1000);
        let corner = Rect { x0: 900, y0: 900, x1: 1000, y1: 1000 };
        let mut drawn = vec![corner; 64];
        drawn[3] = all;
        let tiles = balanced(&drawn);
        check_partition(&tiles, all);
        let most = tiles.iter().map(|tile| tile.intersection(&corner).pixels()).max().unwrap();
        assert!(most < 10_000 / 10, "one rank has {most} of the corner's 10000 pixels");
    }

    #[test]
    fn slabs_meet_few_tiles_at_127_ranks() {
        // The case in which bands of rows need a message from every rank to every rank.
        let drawn: Vec<Rect> =
            (0..127).map(|i| Rect { x0: 8 * i, y0: 100, x1: 8 * i + 12, y1: 900 }).collect();
        let tiles = balanced(&drawn);
        let met = |tile: &Rect| drawn.iter().filter(|rect| !rect.intersection(tile).is_empty()).count();
        let messages: usize = tiles.iter().map(met).sum();
        assert!(messages < 127 * 24, "{messages} messages");
    }

    #[test]
    fn ranks_own_what_is_near_to_what_they_drew() {
        // Four quadrants, one a rank, in an order that is not that of the tiles.
        let quadrant = |x: u32, y: u32| Rect { x0: 50 * x, y0: 50 * y, x1: 50 * x + 50, y1: 50 * y + 50 };
        let drawn = [quadrant(1, 1), quadrant(0, 0), quadrant(0, 1), quadrant(1, 0)];
        assert_eq!(balanced(&drawn), drawn);
    }

    #[test]
    fn slices_of_a_tile_cover_it() {
        let tile = Rect { x0: 3, y0: 10, x1: 103, y1: 61 };
        for pixels in [1, 99, 100, 1000, 100_000] {
            let slices = slices(tile, pixels);
            assert_eq!(slices.iter().map(Rect::pixels).sum::<usize>(), tile.pixels());
            assert!(slices.windows(2).all(|pair| pair[0].y1 == pair[1].y0));
        }
        assert_eq!(slices(Rect::EMPTY, 10).len(), 1);
    }
}
