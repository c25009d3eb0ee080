//! Medians and spreads of small samples.

use serde::{Deserialize, Serialize};

/// The median and the spread of a small sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The median.
    pub median: f64,
    /// Smallest sample.
    pub low: f64,
    /// Largest sample.
    pub high: f64,
    /// First quartile.
    pub quartile_1: f64,
    /// Third quartile.
    pub quartile_3: f64,
}

impl Summary {
    /// Summarises the finite samples; `None` if there are none.
    ///
    /// ```
    /// let s = bench::stats::Summary::of(&[3.0, 1.0, 2.0, 100.0]).unwrap();
    /// assert_eq!((s.median, s.low, s.high), (2.5, 1.0, 100.0));
    /// ```
    pub fn of(samples: &[f64]) -> Option<Summary> {
        let mut sorted: Vec<f64> = samples.iter().copied().filter(|x| x.is_finite()).collect();
        if sorted.is_empty() {
            return None;
        }
        sorted.sort_by(f64::total_cmp);
        Some(Summary {
            median: quantile(&sorted, 0.5),
            low: sorted[0],
            high: sorted[sorted.len() - 1],
            quartile_1: quantile(&sorted, 0.25),
            quartile_3: quantile(&sorted, 0.75),
        })
    }

    /// Third minus first quartile, in the samples' unit.
    pub fn interquartile_range(&self) -> f64 {
        self.quartile_3 - self.quartile_1
    }
}

/// Linear interpolation between order statistics (Hyndman and Fan 1996, definition 7). `sorted` is
/// not empty.
fn quantile(sorted: &[f64], q: f64) -> f64 {
    let x = q * (sorted.len() - 1) as f64;
    let (i, f) = (x.floor() as usize, x.fract());
    let next = sorted[(i + 1).min(sorted.len() - 1)];
    sorted[i] + (next - sorted[i]) * f
}

/// Geometric mean, the right mean for ratios; `None` if a value is not positive or there are no
/// values.
pub fn geometric_mean(values: &[f64]) -> Option<f64> {
    if values.is_empty() || values.iter().any(|v| !(v.is_finite() && *v > 0.0)) {
        return None;
    }
    Some((values.iter().map(|v| v.ln()).sum::<f64>() / values.len() as f64).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sample_has_no_spread() {
        let s = Summary::of(&[4.0]).unwrap();
        assert_eq!((s.median, s.low, s.high, s.interquartile_range()), (4.0, 4.0, 4.0, 0.0));
    }

    #[test]
    fn one_outlier_moves_neither_median_nor_quartiles_far() {
        let s = Summary::of(&[1.0, 1.01, 1.02, 1.03, 50.0]).unwrap();
        assert_eq!(s.median, 1.02);
        assert!((s.interquartile_range() - 0.02).abs() < 1e-12);
        assert_eq!(s.high, 50.0);
    }

    #[test]
    fn nan_and_empty_samples_are_not_averaged() {
        assert_eq!(Summary::of(&[]), None);
        assert_eq!(Summary::of(&[f64::NAN, f64::INFINITY]), None);
        assert_eq!(Summary::of(&[f64::NAN, 2.0]).unwrap().median, 2.0);
    }

    #[test]
    fn geometric_mean_of_a_ratio_and_its_inverse_is_one() {
        assert!((geometric_mean(&[4.0, 0.25]).unwrap() - 1.0).abs() < 1e-15);
        assert_eq!(geometric_mean(&[1.0, 0.0]), None);
        assert_eq!(geometric_mean(&[]), None);
    }
}
