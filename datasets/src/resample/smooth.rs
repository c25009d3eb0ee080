//! Binomial smoothing of a lattice, for shocks that its spacing cannot resolve.
//!
//! To an oblique ray, a shock one cell wide is a staircase, and the errors of deflections are as
//! large as the deflections. Smoothing over about one node reduces the errors to a few per cent,
//! because the deflection by a plane step does not depend on its thickness.

use super::ResampleError;
use rayon::prelude::*;

/// Smooths the finite values by a binomial kernel with standard deviation `sigma_nodes` along each
/// axis. Values that are not finite are unchanged and ignored: the weights of the others are
/// rescaled.
///
/// A pass applies the kernel (a, 1 − 2a, a), whose variance is 2a. Passes are repeated with a ≤ 1/4
/// until the variance is reached, so every σ is exact. Border nodes are repeated outwards.
pub fn smooth(values: &mut [f32], dims: [usize; 3], sigma_nodes: f64) -> Result<(), ResampleError> {
    if !(0.0..=16.0).contains(&sigma_nodes) {
        let cure = "give a standard deviation from 0 to 16 nodes (1 to 1.4 is right for shocks)";
        return Err(ResampleError::Option { option: "smoothing", value: sigma_nodes, cure });
    }
    let nodes: usize = dims.iter().product();
    if nodes != values.len() {
        return Err(ResampleError::Count { found: values.len(), points: nodes, cells: 0 });
    }
    let passes = (2.0 * sigma_nodes * sigma_nodes - 1e-9).ceil().max(0.0);
    if passes == 0.0 {
        return Ok(());
    }
    let a = (sigma_nodes * sigma_nodes / (2.0 * passes)) as f32;
    let stride = [1, dims[0], dims[0] * dims[1]];
    let mut before = vec![0.0f32; values.len()];
    for axis in 0..3 {
        if dims[axis] < 2 {
            continue;
        }
        for _ in 0..passes as usize {
            before.copy_from_slice(values);
            let row = dims[0];
            values.par_chunks_mut(row).enumerate().for_each(|(r, out)| {
                let (j, k) = (r % dims[1], r / dims[1]);
                for (i, v) in out.iter_mut().enumerate() {
                    let here = r * row + i;
                    let at = [i, j, k][axis];
                    let own = before[here];
                    if !own.is_finite() {
                        continue;
                    }
                    let neighbour = |exists: bool, index: usize| {
                        if exists { before[index] } else { own }
                    };
                    let lower = neighbour(at > 0, here.wrapping_sub(stride[axis]));
                    let upper = neighbour(at + 1 < dims[axis], here + stride[axis]);
                    // Sum differences, so that a constant field is unchanged bit for bit.
                    let mut change = 0.0;
                    let mut weight = 1.0;
                    for n in [lower, upper] {
                        if n.is_finite() {
                            change += a * (n - own);
                        } else {
                            weight -= a;
                        }
                    }
                    *v = own + change / weight;
                }
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impulse_becomes_a_bell_of_the_variance_asked_for() {
        for sigma in [0.4, 1.0, 1.4, 2.3] {
            let n = 41;
            let mut v = vec![0.0f32; n * n * n];
            let middle = n / 2;
            v[middle + n * (middle + n * middle)] = 1.0;
            smooth(&mut v, [n, n, n], sigma).unwrap();
            for axis in 0..3 {
                let (mut sum, mut square) = (0.0, 0.0);
                for (i, &x) in v.iter().enumerate() {
                    let at = [i % n, i / n % n, i / n / n][axis] as f64 - middle as f64;
                    sum += f64::from(x);
                    square += f64::from(x) * at * at;
                }
                assert!((sum - 1.0).abs() < 1e-5, "sum {sum}");
                assert!(
                    (square / sum - sigma * sigma).abs() < 1e-4,
                    "sigma {sigma}: variance {}",
                    square / sum
                );
            }
        }
    }

    #[test]
    fn constants_and_holes_stay_and_holes_do_not_spread() {
        let dims = [7, 5, 4];
        let mut v = vec![0.3f32; 140];
        v[60] = f32::NAN;
        let before = v.clone();
        smooth(&mut v, dims, 1.4).unwrap();
        let same = v.iter().zip(&before).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
        assert!(same);
        let mut untouched: Vec<f32> = (0..140).map(|i| (i * i % 17) as f32).collect();
        let copy = untouched.clone();
        smooth(&mut untouched, dims, 0.0).unwrap();
        assert_eq!(untouched, copy);
        assert!(smooth(&mut v, dims, -1.0).is_err() && smooth(&mut v, dims, f64::NAN).is_err());
        assert!(smooth(&mut v, [7, 5, 5], 1.0).is_err());
    }
}
