//! Hilbert's curve through space: points with near indices are near.
//!
//! J. Skilling, "Programming the Hilbert curve", AIP Conference Proceedings 707, 2004.

/// Bits of each coordinate; three of them make an index of 63.
pub(super) const BITS: u32 = 21;

/// The index along the curve of a cell of the lattice with 2^21 cells a side.
pub(super) fn index(mut x: [u32; 3]) -> u64 {
    let top = 1u32 << (BITS - 1);
    // Inverse undo.
    let mut q = top;
    while q > 1 {
        let p = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[i]) & p;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    // Gray encode.
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    let mut q = top;
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    let x = x.map(|v| v ^ t);
    // The bits of the three, interleaved.
    (0..BITS)
        .rev()
        .fold(0, |key, bit| x.iter().fold(key, |key, v| (key << 1) | u64::from((v >> bit) & 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_cell_and_steps_to_a_neighbour() {
        let n = 8u32;
        let mut cells: Vec<[u32; 3]> =
            (0..n * n * n).map(|i| [i % n, i / n % n, i / n / n]).collect();
        cells.sort_by_key(|c| index(*c));
        for pair in cells.windows(2) {
            let step: u32 = (0..3).map(|a| pair[0][a].abs_diff(pair[1][a])).sum();
            assert_eq!(step, 1, "{pair:?}");
        }
    }
}
