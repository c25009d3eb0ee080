//! Divides the triangles of a large mesh among pieces whose trees are built one after the other.
//!
//! A builder needs some 90 bytes per triangle, six times what the compact tree keeps. Piece by
//! piece, it needs them for one piece, and for the others the 4 bytes of their number.
//!
//! Each division goes over all triangles. Their centres lie beside their numbers, 16 bytes a
//! triangle in the order of the division: looked up in the mesh, most corners would come from
//! memory, once more at each level.

use crate::bvh::build::{Progress, Stopped};
use crate::bvh::layout::triangles::TriWriter;
use crate::math::Aabb;
use glam::Vec3;
use rayon::prelude::*;

/// Most triangles of a piece of a mesh in memory.
pub(super) const PIECE: usize = 1 << 18;

/// Bytes that each triangle takes while a mesh is divided.
pub(crate) const BYTES_WHILE_DIVIDED: usize = size_of::<Centered>();

/// The bits of a triangle's centre, and its number.
type Centered = [u32; 4];

/// Triangles that one task looks at.
const TASK: usize = 1 << 14;

/// The triangles of a mesh by pieces.
pub(crate) struct Pieces {
    /// Numbers of the triangles, piece after piece.
    pub(crate) ids: Vec<u32>,
    /// Where the pieces end.
    pub(crate) ends: Vec<usize>,
}

/// Divides those of `count` triangles that are `usable`, which can all be built: neighbours in
/// space are in one piece, of at most `most` triangles.
pub(crate) fn divide(
    triangles: &TriWriter<'_>,
    count: usize,
    usable: impl Fn(u32) -> bool + Sync,
    most: usize,
    progress: &Progress<'_>,
) -> Result<Pieces, Stopped> {
    progress.check()?;
    let numbers = 0..count as u32;
    if count <= most {
        let mut ids = Vec::with_capacity(count);
        ids.extend(numbers.filter(|&i| usable(i)));
        progress.check()?;
        let ends = vec![ids.len()];
        return Ok(Pieces { ids, ends });
    }
    // One array from the first to the last step: it becomes that of the numbers.
    let mut words = vec![0u32; 4 * count];
    let records: &mut [Centered] = bytemuck::cast_slice_mut(&mut words);
    let used: usize = records
        .par_chunks_mut(TASK)
        .zip(numbers.into_par_iter().step_by(TASK))
        .map(|(records, first)| {
            let mut used = 0;
            for i in (first..first + records.len() as u32).filter(|&i| usable(i)) {
                let [x, y, z] = center(triangles, i).to_array().map(f32::to_bits);
                records[used] = [x, y, z, i];
                used += 1;
            }
            // What is left marks where the usable ones of the task end.
            records[used..].iter_mut().for_each(|record| record[3] = u32::MAX);
            used
        })
        .sum();
    progress.check()?;
    if used < count {
        let mut next = 0;
        for i in 0..count {
            if records[i][3] != u32::MAX {
                records[next] = records[i];
                next += 1;
            }
        }
    }
    let ends = split(&mut records[..used], most, progress)?;
    for i in 0..used {
        words[i] = words[4 * i + 3];
    }
    words.truncate(used);
    words.shrink_to_fit();
    Ok(Pieces { ids: words, ends })
}

fn center(triangles: &TriWriter<'_>, id: u32) -> Vec3 {
    let [a, b, c] = triangles.corners(id);
    // Twice the centre of the box may be infinite; half of each corner is not.
    0.5 * a.min(b).min(c) + 0.5 * a.max(b).max(c)
}

/// Orders records by pieces, and returns where these end.
fn split(
    records: &mut [Centered],
    most: usize,
    progress: &Progress<'_>,
) -> Result<Vec<usize>, Stopped> {
    progress.check()?;
    if records.len() <= most {
        return Ok(vec![records.len()]);
    }
    let at = |record: &Centered, axis: usize| f32::from_bits(record[axis]);
    let of_task = |records: &[Centered]| {
        let points = records.iter().map(|r| Vec3::new(at(r, 0), at(r, 1), at(r, 2)));
        points.fold(Aabb::EMPTY, Aabb::grown)
    };
    let bounds = records.par_chunks(TASK).map(of_task).reduce(|| Aabb::EMPTY, Aabb::union);
    let extent: Vec3 = bounds.extent();
    let axis = (0..3).fold(0, |best, a| if extent[a] > extent[best] { a } else { best });
    // The middle, to a whole number of pieces. Numbers decide between equal centres.
    let middle = (records.len() / 2).next_multiple_of(most).min(records.len() - 1);
    records.select_nth_unstable_by(middle, |a, b| {
        at(a, axis).total_cmp(&at(b, axis)).then(a[3].cmp(&b[3]))
    });
    let (left, right) = records.split_at_mut(middle);
    let (mut ends, right) =
        match rayon::join(|| split(left, most, progress), || split(right, most, progress)) {
            (Ok(left), Ok(right)) => (left, right),
            _ => return Err(Stopped),
        };
    ends.extend(right.into_iter().map(|end| middle + end));
    Ok(ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::build::UNWATCHED;
    use crate::bvh::layout::local_frame::LocalFrame;
    use crate::mesh::TriMesh;
    use crate::test_shapes::Random;

    /// Small triangles anywhere in a cube.
    fn cloud(count: usize) -> TriMesh {
        let mut r = Random::new(9);
        let mut mesh = TriMesh::default();
        for i in 0..count as u32 {
            let corner = r.direction() * r.unit();
            mesh.positions.extend([corner, corner + Vec3::X * 0.01, corner + Vec3::Y * 0.01]);
            mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        mesh
    }

    #[test]
    fn pieces_have_each_usable_triangle_once_and_lie_apart() {
        let mesh = cloud(40_000);
        let frame = LocalFrame::around(mesh.origin, 2.0);
        let slices = mesh.triangles();
        let triangles = TriWriter::new(slices, &frame, 0);
        let usable = |i: u32| i % 5 != 2;
        for most in [100, 9_000, 50_000] {
            let pieces = divide(&triangles, 40_000, usable, most, &UNWATCHED);
            let Ok(Pieces { ids, ends }) = pieces else { panic!("nobody stops it") };
            let mut sorted = ids.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq((0..40_000).filter(|&i| usable(i))), "{most}");
            assert_eq!(ends.last(), Some(&ids.len()));
            assert!(ends.is_sorted());
            let (mut start, mut area, number) = (0, 0.0, ends.len() as f32);
            for end in ends {
                assert!(end - start <= most, "{start} to {end}, {most}");
                let centers = ids[start..end].iter().map(|&id| center(&triangles, id));
                area += centers.fold(Aabb::EMPTY, Aabb::grown).half_area();
                start = end;
            }
            // Of random triangles, a small piece would have nearly the surface of the whole.
            assert!(most > 100 || area < 0.1 * 12.0 * number, "{area} of {number} pieces");
        }
    }
}
