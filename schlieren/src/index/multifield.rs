//! Combines several fields into one index through one-dimensional transfer functions (dissertation,
//! section 5.7).
//!
//! This visualizes fields that have no refractive index of their own (temperature, a mixture
//! fraction, vorticity) as if they had one. A user-defined curve maps each value to an n − 1, and
//! the results of the curves are combined. This is illustration, not physics. Images made with it
//! should say so.

use super::IndexError;

/// A piecewise linear curve from a field's value to a contribution to n − 1. It is constant beyond
/// its ends.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    /// Pairs (value, n − 1), with strictly increasing values.
    knots: Vec<(f64, f64)>,
}

impl TransferFunction {
    /// Creates a curve through these points (value, n − 1). All numbers must be finite, and values
    /// must strictly increase.
    pub fn new(knots: Vec<(f64, f64)>) -> Result<Self, IndexError> {
        let impossible = |value, reason| IndexError::Impossible {
            quantity: "transfer function knot",
            value,
            unit: "",
            reason,
            cure: "give pairs of finite numbers, values strictly increasing",
        };
        if knots.is_empty() {
            return Err(impossible(0.0, "is missing: a curve needs at least one"));
        }
        if let Some((v, n)) = knots.iter().find(|(v, n)| !(v.is_finite() && n.is_finite())) {
            return Err(impossible(if v.is_finite() { *n } else { *v }, "is not finite"));
        }
        if let Some(w) = knots.windows(2).find(|w| w[0].0 >= w[1].0) {
            return Err(impossible(w[1].0, "is not above the one before"));
        }
        Ok(TransferFunction { knots })
    }

    /// The straight line n − 1 = slope · value, over a range.
    pub fn linear(slope: f64, low: f64, high: f64) -> Result<Self, IndexError> {
        Self::new(vec![(low, slope * low), (high, slope * high)])
    }

    /// The curve at `value`; NaN for NaN.
    pub fn at(&self, value: f64) -> f64 {
        if value.is_nan() {
            return f64::NAN;
        }
        let after = self.knots.partition_point(|k| k.0 <= value);
        match (after.checked_sub(1).map(|i| self.knots[i]), self.knots.get(after)) {
            (Some((v0, n0)), Some(&(v1, n1))) => {
                let t = (value - v0) / (v1 - v0);
                n0 * (1.0 - t) + n1 * t
            }
            (Some((_, n)), None) => n,
            (None, Some(&(_, n))) => n,
            (None, None) => f64::NAN,
        }
    }

    /// The steepest slope, for bounds on gradients.
    pub fn max_slope(&self) -> f64 {
        self.knots
            .windows(2)
            .map(|w| ((w[1].1 - w[0].1) / (w[1].0 - w[0].0)).abs())
            .fold(0.0, f64::max)
    }
}

/// How the contributions of the fields are combined.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// The sum: refractivities add, as those of gases do.
    #[default]
    Sum,
    /// The largest in magnitude: each field is visible where it dominates.
    Largest,
}

/// Fields with their curves and weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Multifield {
    /// One curve per field, with its weight.
    pub parts: Vec<(TransferFunction, f64)>,
    /// How they combine.
    pub rule: Rule,
}

impl Multifield {
    /// n − 1 for these values of the fields, one per part. NaN if a field with nonzero weight is
    /// NaN.
    ///
    /// ```
    /// use schlieren::index::multifield::{Multifield, Rule, TransferFunction};
    /// let hot = TransferFunction::new(vec![(300.0, 0.0), (2000.0, -2e-4)])?;
    /// let fuel = TransferFunction::linear(1e-4, 0.0, 1.0)?;
    /// let both = Multifield { parts: vec![(hot, 1.0), (fuel, 2.0)], rule: Rule::Sum };
    /// assert!((both.n_minus_1(&[1150.0, 0.5]) - (-1e-4 + 1e-4)).abs() < 1e-18);
    /// # Ok::<(), schlieren::index::IndexError>(())
    /// ```
    pub fn n_minus_1(&self, values: &[f64]) -> f64 {
        debug_assert_eq!(values.len(), self.parts.len());
        let used = self.parts.iter().zip(values).filter(|((_, w), _)| *w != 0.0);
        let contributions = used.map(|((curve, weight), v)| weight * curve.at(*v));
        match self.rule {
            Rule::Sum => contributions.sum(),
            Rule::Largest => contributions
                .fold(0.0, |a: f64, b| if b.is_nan() || b.abs() > a.abs() { b } else { a }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_linear_between_knots_and_flat_beyond() {
        let t = TransferFunction::new(vec![(0.0, 1.0), (1.0, 3.0), (3.0, -1.0)]).unwrap();
        for (v, expected) in
            [(-5.0, 1.0), (0.0, 1.0), (0.5, 2.0), (1.0, 3.0), (2.0, 1.0), (3.0, -1.0), (9.0, -1.0)]
        {
            assert_eq!(t.at(v), expected, "at {v}");
        }
        assert!(t.at(f64::NAN).is_nan());
        assert_eq!(t.max_slope(), 2.0);
        assert_eq!(TransferFunction::new(vec![(2.0, 7.0)]).unwrap().at(-1.0), 7.0);
    }

    #[test]
    fn curves_that_are_none_are_refused() {
        for bad in [
            vec![],
            vec![(0.0, 0.0), (0.0, 1.0)],
            vec![(1.0, 0.0), (0.0, 1.0)],
            vec![(f64::NAN, 0.0)],
        ] {
            assert!(TransferFunction::new(bad).is_err());
        }
    }

    #[test]
    fn a_field_of_weight_zero_is_not_looked_at() {
        let t = TransferFunction::linear(1.0, -10.0, 10.0).unwrap();
        let both = |w, rule| Multifield { parts: vec![(t.clone(), 1.0), (t.clone(), w)], rule };
        assert_eq!(both(0.0, Rule::Sum).n_minus_1(&[2.0, f64::NAN]), 2.0);
        assert!(both(1.0, Rule::Sum).n_minus_1(&[2.0, f64::NAN]).is_nan());
        assert!(both(1.0, Rule::Largest).n_minus_1(&[f64::NAN, 2.0]).is_nan());
        assert_eq!(both(1.0, Rule::Largest).n_minus_1(&[2.0, -3.0]), -3.0);
        assert_eq!(both(-1.0, Rule::Sum).n_minus_1(&[2.0, 2.0]), 0.0);
    }
}
