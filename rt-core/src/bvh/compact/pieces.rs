//! Divides the triangles of a large mesh among pieces whose trees are built one after the other.
//!
//! A builder needs some 90 bytes per triangle, six times what the compact tree keeps. Piece by
//! piece, it needs them for one piece, and for the others the 4 bytes of their number.

use crate::bvh::build::{Progress, Stopped};
use crate::bvh::layout::triangles::TriWriter;
use crate::math::Aabb;
use glam::Vec3;
use rayon::prelude::*;

/// Most triangles of a piece of a mesh in memory.
pub(super) const PIECE: usize = 1 << 18;

/// Orders `ids` so that neighbours in space are in one of its pieces, of at most `most` triangles,
/// and returns their ends.
pub(crate) fn divide(
    ids: &mut [u32],
    triangles: &TriWriter<'_>,
    most: usize,
    progress: &Progress<'_>,
) -> Result<Vec<usize>, Stopped> {
    progress.check()?;
    if ids.len() <= most {
        return Ok(vec![ids.len()]);
    }
    let center = |id: u32| {
        let [a, b, c] = triangles.corners(id);
        // Twice the centre of the box may be infinite; half of each corner is not.
        0.5 * a.min(b).min(c) + 0.5 * a.max(b).max(c)
    };
    let of_piece = |ids: &[u32]| ids.iter().fold(Aabb::EMPTY, |b, &id| b.grown(center(id)));
    let bounds = ids.par_chunks(1 << 14).map(of_piece).reduce(|| Aabb::EMPTY, Aabb::union);
    let extent: Vec3 = bounds.extent();
    let axis = (0..3).fold(0, |best, a| if extent[a] > extent[best] { a } else { best });
    // The middle, to a whole number of pieces. Numbers decide between equal centres.
    let middle = (ids.len() / 2).next_multiple_of(most).min(ids.len() - 1);
    ids.select_nth_unstable_by(middle, |&a, &b| {
        center(a)[axis].total_cmp(&center(b)[axis]).then(a.cmp(&b))
    });
    let (left, right) = ids.split_at_mut(middle);
    let (mut ends, right) = match rayon::join(
        || divide(left, triangles, most, progress),
        || divide(right, triangles, most, progress),
    ) {
        (Ok(left), Ok(right)) => (left, right),
        _ => return Err(Stopped),
    };
    ends.extend(right.into_iter().map(|end| middle + end));
    Ok(ends)
}
