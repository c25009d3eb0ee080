//! Bounds of all ranks' parts, and which of them a ray enters.
use rt_core::math::Aabb;
use rt_core::ray::Ray;

/// Number of boxes that are tested together.
const LANES: usize = 16;

/// Sixteen boxes as a structure of arrays.
#[derive(Clone, Copy)]
struct Block {
    low: [[f32; LANES]; 3],
    high: [[f32; LANES]; 3],
}

/// Boxes of all ranks, slightly enlarged: a ray that hits anything in a box is never reported to
/// miss the box.
pub(super) struct RankBounds {
    blocks: Vec<Block>,
    pub(super) bounds: Vec<Aabb>,
}

impl RankBounds {
    /// `whole` bounds everything in render space: the rounding of rays is a share of its size.
    pub(super) fn new(bounds: Vec<Aabb>, whole: Aabb) -> RankBounds {
        let size = whole.min.abs().max(whole.max.abs()).max_element();
        let margin = if size.is_finite() { size * 1e-4 } else { 0.0 };
        let mut blocks =
            vec![
                Block { low: [[f32::INFINITY; LANES]; 3], high: [[f32::NEG_INFINITY; LANES]; 3] };
                bounds.len().div_ceil(LANES)
            ];
        for (i, b) in bounds.iter().enumerate().filter(|(_, b)| !b.is_empty()) {
            let (block, lane) = (&mut blocks[i / LANES], i % LANES);
            for axis in 0..3 {
                block.low[axis][lane] = b.min[axis] - margin;
                block.high[axis][lane] = b.max[axis] + margin;
            }
        }
        RankBounds { blocks, bounds }
    }

    /// Sets the bits of the ranks whose boxes the ray enters between its limits.
    pub(super) fn add_hit_ranks(&self, ray: &Ray, bits: &mut [u16]) {
        // Zero directions become tiny: a distance is then huge, but never NaN.
        let inverse = ray.dir.to_array().map(|d| 1.0 / d.abs().max(1e-30).copysign(d));
        let origin = ray.origin.to_array();
        for (block, bits) in self.blocks.iter().zip(bits) {
            let (mut near, mut far) = ([ray.t_min; LANES], [ray.t_max; LANES]);
            for axis in 0..3 {
                let (o, inv) = (origin[axis], inverse[axis]);
                for lane in 0..LANES {
                    let a = (block.low[axis][lane] - o) * inv;
                    let b = (block.high[axis][lane] - o) * inv;
                    near[lane] = near[lane].max(a.min(b));
                    far[lane] = far[lane].min(a.max(b));
                }
            }
            for lane in 0..LANES {
                // Empty boxes have low above high: with swapped sides they would be infinite.
                let there = block.low[0][lane] <= block.high[0][lane];
                let meets = there & (near[lane] <= far[lane] * (1.0 + 1e-5));
                *bits |= (meets as u16) << lane;
            }
        }
    }

    /// Words of 16 bits that hold a bit for each rank.
    pub(super) fn bit_words(&self) -> usize {
        self.blocks.len()
    }
}

/// The ranks whose bits are set.
pub(super) fn ranks_in(bits: &[u16]) -> impl Iterator<Item = usize> + '_ {
    bits.iter().enumerate().flat_map(|(word, &b)| {
        (0..LANES).filter(move |lane| b >> lane & 1 != 0).map(move |lane| word * LANES + lane)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::glam::Vec3;

    #[test]
    fn rays_along_axes_and_on_faces_meet_their_boxes_and_empty_boxes_meet_nothing() {
        let cube = |x: f32| Aabb::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 1.0));
        let mut bounds: Vec<Aabb> = (0..20).map(|k| cube(2.0 * k as f32)).collect();
        bounds[3] = Aabb::EMPTY;
        let whole = Aabb::new(Vec3::ZERO, Vec3::new(39.0, 1.0, 1.0));
        let rank_bounds = RankBounds::new(bounds, whole);
        let met = |ray: Ray| {
            let mut bits = vec![0; rank_bounds.bit_words()];
            rank_bounds.add_hit_ranks(&ray, &mut bits);
            ranks_in(&bits).collect::<Vec<_>>()
        };
        let all: Vec<usize> = (0..20).filter(|k| *k != 3).collect();
        assert_eq!(met(Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X)), all);
        assert_eq!(met(Ray::new(Vec3::new(-1.0, 0.0, 1.0), Vec3::X)), all, "along an edge");
        assert_eq!(met(Ray::new(Vec3::new(4.5, 0.5, 5.0), -Vec3::Z)), [2]);
        assert_eq!(met(Ray::new(Vec3::new(4.5, 0.5, 5.0), -Vec3::Z).with_t_max(3.0)), [0; 0]);
        assert_eq!(met(Ray::new(Vec3::new(4.5, 0.5, 0.5), Vec3::Y)), [2], "from inside");
        assert_eq!(met(Ray::new(Vec3::new(6.5, 0.5, 5.0), -Vec3::Z)), [0; 0], "the empty one");
    }
}
