//! Assigns the tiles of direct send to ranks: rectangles of about equal work, close to what their
//! owners drew.
//!
//! The image is bisected recursively, and so are the ranks. Ranks that drew further left (or up)
//! get the left (or upper) part, and the cut divides the work in proportion to their shares.
//! Compared with bands of rows this needs fewer messages, because a small object overlaps a few
//! tiles but many bands: at 127 ranks in slabs, a few instead of all. A tile also overlaps what its
//! owner drew, so part of the pixels to merge need not be sent.
use crate::rect::Rect;

/// Cost of an active pixel (transfer and merge), relative to that of a pixel of the result, about.
const DRAWN_WEIGHT: u64 = 2;

/// Most cells of a region in which its work is summed; cuts are no finer than a cell.
const CELLS: usize = 128;

/// One tile per order index; `drawn[order_index]` is the rectangle that this rank drew in. Tiles
/// are disjoint and cover every `drawn`, and some may be empty.
pub(crate) fn balanced(drawn: &[Rect]) -> Vec<Rect> {
    let mut owners: Vec<Owner> =
        (0..drawn.len()).map(|order_index| Owner { order_index, share: 1 }).collect();
    balanced_among(drawn, &mut owners)
}

/// A rank that gets a tile in proportion to its share of all owners' shares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Owner {
    pub(crate) order_index: usize,
    pub(crate) share: u64,
}

/// As [`balanced`], but only `owners` get tiles; the other tiles are empty.
pub(crate) fn balanced_among(drawn: &[Rect], owners: &mut [Owner]) -> Vec<Rect> {
    let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
    let mut tiles = vec![Rect::EMPTY; drawn.len()];
    let present: Vec<Rect> = drawn.iter().copied().filter(|rect| !rect.is_empty()).collect();
    if !whole.is_empty() {
        divide(whole, owners, &present, drawn, &mut tiles);
    }
    tiles
}

/// Divides `region` among `owners`; `present` are the rectangles that overlap it.
fn divide(
    region: Rect,
    owners: &mut [Owner],
    present: &[Rect],
    drawn: &[Rect],
    tiles: &mut [Rect],
) {
    if let [owner] = *owners {
        tiles[owner.order_index] = region;
        return;
    }
    if region.is_empty() || owners.is_empty() {
        return;
    }
    let half = owners.len() / 2;

    // Sort ranks by the centre of what they drew. Ranks that drew nothing sort at the middle of the
    // region.
    let sort = |across_columns: bool, owners: &mut [Owner]| {
        owners.sort_unstable_by_key(|owner| {
            let rect =
                if drawn[owner.order_index].is_empty() { region } else { drawn[owner.order_index] };
            let (from, to) = if across_columns { (rect.x0, rect.x1) } else { (rect.y0, rect.y1) };
            (u64::from(from) + u64::from(to), owner.order_index)
        });
    };
    let split = |across_columns: bool, owners: &mut [Owner]| {
        sort(across_columns, owners);
        let of = |owners: &[Owner]| owners.iter().map(|owner| owner.share).sum::<u64>();
        cut(region, across_columns, present, of(&owners[..half]), of(owners))
    };

    // Each rectangle that a cut crosses costs one more message. Rows are contiguous in memory and
    // columns are not, so the region is cut across its columns only where that saves many messages:
    // between small objects, and across slabs.
    let row = split(false, owners);
    let crossed_by_row = present.iter().filter(|rect| rect.y0 < row && row < rect.y1).count();
    let is_flat = region.height() < 2;
    let mut at = (row, false);
    if region.width() > 1 && (is_flat || crossed_by_row > 1) {
        let column = split(true, owners);
        let crossed_by_column =
            present.iter().filter(|rect| rect.x0 < column && column < rect.x1).count();
        if is_flat || crossed_by_row > 2 * crossed_by_column + 1 {
            at = (column, true);
        } else {
            sort(false, owners);
        }
    }
    let (first, second) = owners.split_at_mut(half);
    let (mut before, mut behind) = (region, region);
    if at.1 {
        (before.x1, behind.x0) = (at.0, at.0);
    } else {
        (before.y1, behind.y0) = (at.0, at.0);
    }
    for (part, its_owners) in [(before, first), (behind, second)] {
        if let [owner] = *its_owners {
            tiles[owner.order_index] = part;
            continue;
        }
        let meeting: Vec<Rect> = present
            .iter()
            .map(|rect| rect.intersection(&part))
            .filter(|rect| !rect.is_empty())
            .collect();
        divide(part, its_owners, &meeting, drawn, tiles);
    }
}

/// Where to cut `region` so that the first part has `share` of `shares` of the work.
fn cut(region: Rect, across_columns: bool, present: &[Rect], share: u64, shares: u64) -> u32 {
    let (start, end) = if across_columns { (region.x0, region.x1) } else { (region.y0, region.y1) };
    let own = if across_columns { region.height() } else { region.width() } as u64;

    // The work of columns (or rows), in cells: a change inside a cell counts as if it were at the
    // nearer side of the cell.
    let length = (end - start) as usize;
    let cell = length.div_ceil(CELLS).max(1);
    let cells = length.div_ceil(cell);
    let mut changes = [0_i64; CELLS + 1];
    let nearest = |at: u32| ((at - start) as usize + cell / 2) / cell;
    for rect in present {
        let (from, to, across) = if across_columns {
            (rect.x0, rect.x1, rect.height())
        } else {
            (rect.y0, rect.y1, rect.width())
        };
        let work = (DRAWN_WEIGHT * across as u64) as i64;
        changes[nearest(from).min(CELLS)] += work;
        changes[nearest(to).min(CELLS)] -= work;
    }
    let width_of = |index: usize| cell.min(length - index * cell) as u64;
    let mut here = 0_i64;
    let mut work = [0_u64; CELLS];
    let mut total = 0;
    for (index, work) in work[..cells].iter_mut().enumerate() {
        here += changes[index];
        *work = own + here.max(0) as u64;
        total += *work * width_of(index);
    }
    let wanted = (u128::from(total) * u128::from(share) / u128::from(shares.max(1))) as u64;
    let mut done = 0;
    for (index, &work) in work[..cells].iter().enumerate() {
        let more = work * width_of(index);
        if done + more >= wanted {
            // Round to the nearer side, so that cuts are not biased towards the end.
            let along = (wanted - done + work / 2) / work.max(1);
            return (start + (index * cell) as u32 + along as u32).min(end);
        }
        done += more;
    }
    end
}

/// Bytes of a slice that is sent between nodes.
pub(crate) const SLICE_BYTES: usize = 1 << 18;

/// Cuts `tile` into slices of whole rows with about `pixels` pixels each.
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
    fn an_image_in_one_corner_is_shared_by_all_ranks() {
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
        let met =
            |tile: &Rect| drawn.iter().filter(|rect| !rect.intersection(tile).is_empty()).count();
        let messages: usize = tiles.iter().map(met).sum();
        assert!(messages < 127 * 24, "{messages} messages");
    }

    #[test]
    fn ranks_own_what_is_near_to_what_they_drew() {
        // Four quadrants, one a rank, in an order that is not that of the tiles.
        let quadrant =
            |x: u32, y: u32| Rect { x0: 50 * x, y0: 50 * y, x1: 50 * x + 50, y1: 50 * y + 50 };
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
