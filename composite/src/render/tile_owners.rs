//! Which rank owns which tiles. All ranks know all bounds, so all compute the same owners without a
//! message.
use super::rank_frame::RankFrame;
use rt_core::effects::Effects;
use rt_core::math::Aabb;
use rt_core::render::Crop;
use std::ops::Range;

/// Tiles of each rank, and which ranks have hits to send for which tile.
pub(super) struct TileOwners {
    /// Consecutive tiles of each rank.
    pub(super) tiles: Vec<Range<usize>>,
    /// By rank, whether a camera ray of a tile can hit its part.
    touched: Vec<Vec<bool>>,
}

impl TileOwners {
    /// Divides tiles into `bounds.len()` runs of about the same work. The work of a tile is 1 if no
    /// part can be visible in it, otherwise 8 plus the number of such parts.
    pub(super) fn new(side: &RankFrame<'_>, bounds: &[Aabb]) -> TileOwners {
        let touched: Vec<Vec<bool>> = bounds.iter().map(|b| tiles_overlapping(side, *b)).collect();
        let work = |tile: usize| {
            let parts = touched.iter().filter(|t| t[tile]).count() as u64;
            // Uncovered tiles are only filled with background; covered ones are shaded too,
            // whatever their number of parts.
            if parts == 0 { 1 } else { 8 + parts }
        };
        let work: Vec<u64> = (0..side.frame.num_tiles()).map(work).collect();
        TileOwners { tiles: cut(&work, bounds.len()), touched }
    }

    /// The tiles of chunk `chunk` of `chunks` of `owner`, which are sent together.
    pub(super) fn chunk(&self, owner: usize, (chunk, chunks): (usize, usize)) -> Range<usize> {
        let Range { start, end } = self.tiles[owner];
        let at = |k: usize| start + (end - start) * k / chunks;
        at(chunk)..at(chunk + 1)
    }

    /// The tiles of a chunk of `owner` in which rank `from` may see something.
    pub(super) fn shared(
        &self,
        from: usize,
        owner: usize,
        chunk: (usize, usize),
    ) -> impl Iterator<Item = usize> + '_ {
        self.chunk(owner, chunk).filter(move |&tile| self.touched[from][tile])
    }

    /// Whether `from` has messages for `owner` about a chunk.
    pub(super) fn has_messages(&self, from: usize, owner: usize, chunk: (usize, usize)) -> bool {
        self.shared(from, owner, chunk).next().is_some()
    }
}

/// For each tile, whether one of its camera rays can hit `bounds` (render space).
fn tiles_overlapping(side: &RankFrame<'_>, bounds: Aabb) -> Vec<bool> {
    let tiles = side.frame.num_tiles();
    if bounds.is_empty() {
        return vec![false; tiles];
    }
    let everywhere = vec![true; tiles];
    if side.frame.effects().contains(Effects::DEPTH_OF_FIELD) {
        return everywhere;
    }
    let (camera, origin) = (side.camera, side.part.scene.world.origin());
    let size = [side.options.width, side.options.height];
    let matrix = camera.clip_from_world();
    let eye = camera.eye().unwrap_or(origin);
    let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in bounds.corners() {
        let world = origin + corner.as_dvec3();
        let row = |r: usize| matrix.row(r).truncate().dot(world) + matrix.row(r).w;
        let (x, y, w) = (row(0), row(1), row(3));
        // A corner to the side of or behind the eye has no position in the image.
        let reach = (world - eye).length();
        let in_front = w.is_finite() && (w > 1e-6 * reach || camera.eye().is_none());
        if !in_front {
            return everywhere;
        }
        let [width, height] = size.map(f64::from);
        let pixel = [(x / w + 1.0) * 0.5 * width, (1.0 - y / w) * 0.5 * height];
        for a in 0..2 {
            (lo[a], hi[a]) = (lo[a].min(pixel[a]), hi[a].max(pixel[a]));
        }
    }
    // Rays may pass anywhere through their pixels, and are rounded to f32.
    let margin = 1.0 + 1e-4 * f64::from(size[0].max(size[1]));
    let meets = |tile: usize| {
        let Crop { x, y, width, height } = side.frame.tile_area(tile);
        let (x, y) = (f64::from(x), f64::from(y));
        let right = x + f64::from(width) + margin;
        let below = y + f64::from(height) + margin;
        hi[0] >= x - margin && lo[0] <= right && hi[1] >= y - margin && lo[1] <= below
    };
    (0..tiles).map(meets).collect()
}

/// Cuts items of the given work into `ranks` runs.
pub(super) fn cut(work: &[u64], ranks: usize) -> Vec<Range<usize>> {
    let total: u64 = work.iter().sum();
    let (mut start, mut done) = (0, 0);
    (0..ranks)
        .map(|rank| {
            let share = total * (rank as u64 + 1) / ranks as u64;
            let mut end = start;
            while end < work.len() && done + work[end] / 2 < share {
                done += work[end];
                end += 1;
            }
            if rank + 1 == ranks {
                end = work.len();
            }
            let run = start..end;
            start = end;
            run
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cover_everything_once_and_are_balanced() {
        let work: Vec<u64> = (0..1000).map(|k| 1 + (k / 100) as u64).collect();
        for ranks in [1, 2, 3, 7, 64, 999, 1000, 1500] {
            let runs = cut(&work, ranks);
            assert_eq!(runs.len(), ranks);
            assert_eq!((runs[0].start, runs[ranks - 1].end), (0, 1000));
            assert!(runs.windows(2).all(|w| w[0].end == w[1].start));
            let most = runs.iter().map(|r| work[r.clone()].iter().sum::<u64>()).max().unwrap();
            assert!(most <= 5500 / ranks as u64 + 20, "{ranks} ranks: {most}");
        }
    }
}
