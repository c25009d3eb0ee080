//! Builds the trees of many geometries side by side.

use rayon::prelude::*;

/// Geometries with more primitives are built one after the other, each by all threads. Their cuts
/// give enough tasks, and the builder's boxes (64 bytes a primitive) are in memory for one geometry
/// at a time.
const LARGE_GEOMETRY: usize = 1 << 17;

/// `build(i)` for every geometry, in order; `sizes` are their numbers of primitives. The results do
/// not depend on the scheduling.
pub(crate) fn build_in_parallel<T: Send>(
    sizes: &[usize],
    build: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let (large, small): (Vec<usize>, Vec<usize>) =
        (0..sizes.len()).partition(|&i| sizes[i] > LARGE_GEOMETRY);
    // Small geometries fill the gaps that the first, serial cut of a large one leaves. Each is a
    // separate task, so that threads share them evenly.
    let (of_large, of_small): (Vec<T>, Vec<T>) = rayon::join(
        || large.iter().map(|&i| build(i)).collect(),
        || small.par_iter().with_max_len(1).map(|&i| build(i)).collect(),
    );
    let mut built: Vec<(usize, T)> = large.into_iter().zip(of_large).collect();
    built.extend(small.into_iter().zip(of_small));
    built.sort_unstable_by_key(|(i, _)| *i);
    built.into_iter().map(|(_, t)| t).collect()
}
