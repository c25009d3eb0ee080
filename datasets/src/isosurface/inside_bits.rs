//! One bit per grid point of a plane: inside (value at or above the isovalue) or outside.
//!
//! A word holds 64 points. An exclusive-or finds crossed edges, a popcount counts them, and a few
//! and/or operations find the cells that the surface crosses. More than nine in ten cells are not
//! crossed, and they cost almost nothing.

/// The part of a field that is in memory: planes `first_plane..` of a grid of `dims` points.
#[derive(Clone, Copy)]
pub(crate) struct Block<'a> {
    pub(crate) dims: [usize; 3],
    pub(crate) first_plane: usize,
    pub(crate) values: &'a [f32],
    /// Whether any value is NaN or infinite; when not, the bookkeeping for them is skipped.
    pub(crate) has_missing: bool,
}

impl<'a> Block<'a> {
    pub(crate) fn plane(&self, k: usize) -> &'a [f32] {
        let n = self.dims[0] * self.dims[1];
        &self.values[(k - self.first_plane) * n..][..n]
    }
}

/// A plane's bits and the edges within it that the surface crosses. Rows have `words` words each.
#[derive(Default)]
pub(crate) struct PlaneBits {
    pub(crate) words: usize,
    pub(crate) inside: Vec<u64>,
    /// NaN or infinite; empty when the block has none.
    pub(crate) missing: Vec<u64>,
    /// Edge from point i to i + 1 of the row is crossed.
    pub(crate) x: Vec<u64>,
    /// Edge from point (i, j) to (i, j + 1) is crossed; the last row has none.
    pub(crate) y: Vec<u64>,
}

impl PlaneBits {
    /// Fills this plane with the bits of plane `k`; `threshold` is the smallest f32 that counts as
    /// inside.
    pub(crate) fn fill(&mut self, block: &Block<'_>, k: usize, threshold: f32) {
        let [nx, ny, _] = block.dims;
        let words = nx.div_ceil(64);
        self.words = words;
        self.inside.resize(words * ny, 0);
        self.x.resize(words * ny, 0);
        self.y.resize(words * ny, 0);
        let plane = block.plane(k);
        pack(plane, nx, &mut self.inside, |v| v >= threshold);
        if block.has_missing {
            self.missing.resize(words * ny, 0);
            pack(plane, nx, &mut self.missing, |v| !v.is_finite());
            // An infinite value is as unusable as NaN: no position can be interpolated towards it.
            for (inside, missing) in self.inside.iter_mut().zip(&self.missing) {
                *inside &= !missing;
            }
        } else {
            self.missing.clear();
        }

        let last_edge_mask = (1 << ((nx - 1) % 64)) - 1;
        for j in 0..ny {
            for w in 0..words {
                let at = j * words + w;
                let mut x = self.inside[at] ^ shifted(&self.inside, at, w + 1 < words);
                let mut y = if j + 1 < ny { self.inside[at] ^ self.inside[at + words] } else { 0 };
                if w + 1 == words {
                    x &= last_edge_mask;
                }
                if !self.missing.is_empty() {
                    x &= !(self.missing[at] | shifted(&self.missing, at, w + 1 < words));
                    y &=
                        !(self.missing[at] | if j + 1 < ny { self.missing[at + words] } else { 0 });
                }
                self.x[at] = x;
                self.y[at] = y;
            }
        }
    }

    /// Crossed edges within the plane.
    pub(crate) fn crossings(&self) -> u32 {
        self.x.iter().chain(&self.y).map(|w| w.count_ones()).sum()
    }

    /// Word `at` of the crossed edges from this plane to `above`.
    #[inline]
    pub(crate) fn z(&self, above: &PlaneBits, at: usize) -> u64 {
        let crossed = self.inside[at] ^ above.inside[at];
        if self.missing.is_empty() {
            crossed
        } else {
            crossed & !(self.missing[at] | above.missing[at])
        }
    }
}

/// Word `at` shifted by one point; the first bit of the next word (when the row has one) is shifted
/// in.
#[inline]
pub(crate) fn shifted(bits: &[u64], at: usize, has_next: bool) -> u64 {
    bits[at] >> 1 | if has_next { bits[at + 1] << 63 } else { 0 }
}

/// Packs a predicate of each row's values into words. Eight comparisons at a time first become
/// bytes, which the compiler vectorises; a multiplication then gathers their lowest bits into one
/// byte.
fn pack(plane: &[f32], nx: usize, bits: &mut [u64], predicate: impl Fn(f32) -> bool) {
    let words = nx.div_ceil(64);
    for (row, out) in plane.chunks_exact(nx).zip(bits.chunks_exact_mut(words)) {
        for (values, word) in row.chunks(64).zip(out) {
            let mut flags = [0u8; 64];
            for (f, &v) in flags.iter_mut().zip(values) {
                *f = predicate(v) as u8;
            }
            *word = 0;
            for (byte, eight) in flags.chunks_exact(8).enumerate() {
                let lanes = u64::from_le_bytes([
                    eight[0], eight[1], eight[2], eight[3], eight[4], eight[5], eight[6], eight[7],
                ]);
                *word |= (lanes.wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * byte);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_match_values_at_word_borders() {
        for nx in [2usize, 63, 64, 65, 127, 128, 129] {
            let values: Vec<f32> = (0..2 * nx).map(|i| ((i * 7919) % 13) as f32).collect();
            let block =
                Block { dims: [nx, 2, 1], first_plane: 0, values: &values, has_missing: false };
            let mut bits = PlaneBits::default();
            bits.fill(&block, 0, 6.0);
            let inside = |i: usize, j: usize| values[j * nx + i] >= 6.0;
            for j in 0..2 {
                for i in 0..bits.words * 64 {
                    let bit = |b: &[u64]| b[j * bits.words + i / 64] >> (i % 64) & 1 == 1;
                    assert_eq!(bit(&bits.inside), i < nx && inside(i, j), "inside {nx} {i} {j}");
                    assert_eq!(
                        bit(&bits.x),
                        i + 1 < nx && inside(i, j) != inside(i + 1, j),
                        "x {nx} {i} {j}"
                    );
                    assert_eq!(
                        bit(&bits.y),
                        j == 0 && i < nx && inside(i, 0) != inside(i, 1),
                        "y {nx} {i} {j}"
                    );
                }
            }
        }
    }
}
