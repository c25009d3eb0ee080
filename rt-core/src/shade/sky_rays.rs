//! Ambient occlusion rays of many points, eight at a time: [`Hemisphere::ray`] with the same bits.

use super::hemisphere::{Hemisphere, HemisphereSamples, OcclusionPoint, WIDE};
use crate::ray::{LANES, RayBlock};
use crate::simd::vectors::Row;
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};

/// Rays in order of their points, each component in a list of its own.
#[derive(Default)]
pub(super) struct SkyRays {
    /// Origins and directions. The lists keep their length; only `len` rays count.
    rows: [Vec<f32>; 6],
    len: usize,
    /// Number of rays of each point.
    pub(super) sent: Vec<u32>,
    /// For each [`WIDE`] directions of a point, those that became rays.
    kept: Vec<u8>,
}

impl SkyRays {
    /// The rays of `points` in `count` directions each. `hemisphere` is that of a point.
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        points: &[OcclusionPoint],
        hemisphere: impl Fn(&OcclusionPoint) -> Hemisphere,
        samples: &HemisphereSamples,
        count: u32,
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.fill_body(simd, points, hemisphere, samples, count as usize),
        );
    }

    #[inline(always)]
    fn fill_body<S: Simd>(
        &mut self,
        simd: S,
        points: &[OcclusionPoint],
        hemisphere: impl Fn(&OcclusionPoint) -> Hemisphere,
        HemisphereSamples(samples): &HemisphereSamples,
        count: usize,
    ) {
        // Whole vectors are stored, the last one beyond the last ray.
        let room = points.len() * count + LANES;
        for row in &mut self.rows {
            if row.len() < room {
                row.resize(room, 0.0);
            }
        }
        self.sent.clear();
        self.kept.clear();
        let [ox, oy, oz, dx, dy, dz] = &mut self.rows;
        let v = |x: f32| f32x8::splat(simd, x);
        let mut len = 0;
        for (i, point) in points.iter().enumerate() {
            let Hemisphere { axes: [x, y, z], origin, face_normal } = hemisphere(point);
            let before = len;
            for k in (0..count).step_by(WIDE) {
                let at = i * count + k;
                let sample = |c: usize| f32x8::from_slice(simd, &samples[c][at..at + WIDE]);
                let [a, b, c] = [sample(0), sample(1), sample(2)];
                let along = |x: f32, y: f32, z: f32| v(x) * a + v(y) * b + v(z) * c;
                let dir = [along(x.x, y.x, z.x), along(x.y, y.y, z.y), along(x.z, y.z, z.z)];
                let height = dir[0] * v(face_normal.x)
                    + dir[1] * v(face_normal.y)
                    + dir[2] * v(face_normal.z);
                // The hemisphere of a smooth normal extends below the face, where no sky can be
                // occluded.
                let wanted = ((1u32 << (count - k).min(WIDE)) - 1) as u8;
                let kept = height.simd_gt(v(0.0)).to_bitmask() as u8 & wanted;
                self.kept.push(kept);
                if kept == wanted {
                    dir[0].store_slice(&mut dx[len..len + WIDE]);
                    dir[1].store_slice(&mut dy[len..len + WIDE]);
                    dir[2].store_slice(&mut dz[len..len + WIDE]);
                    len += kept.count_ones() as usize;
                } else {
                    let dir: [[f32; WIDE]; 3] = dir.map(|d| d.to_array());
                    for lane in 0..WIDE {
                        // Overwritten by the next one if the ray is not kept.
                        (dx[len], dy[len], dz[len]) = (dir[0][lane], dir[1][lane], dir[2][lane]);
                        len += (kept >> lane & 1) as usize;
                    }
                }
            }
            for at in (before..len).step_by(WIDE) {
                v(origin.x).store_slice(&mut ox[at..at + WIDE]);
                v(origin.y).store_slice(&mut oy[at..at + WIDE]);
                v(origin.z).store_slice(&mut oz[at..at + WIDE]);
            }
            self.sent.push((len - before) as u32);
        }
        self.len = len;
    }

    /// The rays, of length `distance`, in blocks.
    pub(super) fn store_blocks(&self, distance: f32, out: &mut Vec<RayBlock>) {
        out.clear();
        for first in (0..self.len).step_by(LANES) {
            let row = |c: usize| -> Row {
                self.rows[c][first..first + LANES].try_into().expect("a slice of that length")
            };
            let [t_min, t_max] = [[0.0; LANES], [distance; LANES]];
            let [ox, oy, oz, dx, dy, dz] = [row(0), row(1), row(2), row(3), row(4), row(5)];
            out.push(RayBlock { ox, oy, oz, dx, dy, dz, t_min, t_max });
        }
        let in_last = self.len % LANES;
        if let Some(last) = out.last_mut().filter(|_| in_last > 0) {
            for lane in in_last..LANES {
                last.set(lane, &RayBlock::INACTIVE.get(lane));
            }
        }
    }

    /// For each point the number of its rays and the numbers of their directions.
    pub(super) fn numbers(
        &self,
        count: u32,
    ) -> impl Iterator<Item = (u32, impl Iterator<Item = u32>)> {
        let masks = (count as usize).div_ceil(WIDE).max(1);
        self.sent.iter().zip(self.kept.chunks(masks)).map(|(sent, kept)| {
            let numbers = kept.iter().enumerate().flat_map(|(c, &mask)| {
                let in_mask = (0..WIDE).filter(move |lane| mask >> lane & 1 != 0);
                in_mask.map(move |lane| (c * WIDE + lane) as u32)
            });
            (*sent, numbers)
        })
    }
}
