//! Maps values to positions and places the ticks.

use super::Scale;

/// A mapping of a range of values to a range of positions.
pub(super) struct Mapping {
    scale: Scale,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Mapping {
    /// Covers all values that the scale can show, widened to whole ticks. `zero` makes a linear
    /// scale begin at 0.
    pub(super) fn covering(
        values: impl Iterator<Item = f64>,
        scale: Scale,
        zero: bool,
        from: f64,
        to: f64,
    ) -> Self {
        let shown = values.filter(|v| v.is_finite() && (scale == Scale::Linear || *v > 0.0));
        let (mut low, mut high) =
            shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            (low, high) = (1.0, 10.0);
        }
        match scale {
            Scale::Linear => {
                if zero {
                    (low, high) = (low.min(0.0), high.max(0.0));
                }
                if high - low <= high.abs().max(low.abs()) * 1e-12 {
                    (low, high) =
                        (low - 0.5 * low.abs().max(1.0), high + 0.5 * high.abs().max(1.0));
                }
                let step = nice_step(high - low);
                (low, high) = ((low / step).floor() * step, (high / step).ceil() * step);
            }
            Scale::Log => {
                // Add a margin, then extend to the ticks of the decades in range.
                let room = ((high / low).ln() * 0.04).max(0.05);
                (low, high) = ((low.ln() - room).exp(), (high.ln() + room).exp());
            }
        }
        Mapping { scale, low, high, from, to }
    }

    /// Position of a value; `None` when the scale cannot show it.
    pub(super) fn at(&self, v: f64) -> Option<f64> {
        let f = match self.scale {
            Scale::Linear => (v - self.low) / (self.high - self.low),
            Scale::Log if v > 0.0 => (v / self.low).ln() / (self.high / self.low).ln(),
            Scale::Log => return None,
        };
        f.is_finite().then_some(self.from + f * (self.to - self.from))
    }

    /// The value at which bars start: 0, or the lower end.
    pub(super) fn base(&self) -> f64 {
        self.at(0.0_f64.clamp(self.low, self.high)).unwrap_or(self.from)
    }

    /// Values with a label, in rising order.
    pub(super) fn ticks(&self) -> Vec<f64> {
        let slack = 1e-9;
        match self.scale {
            Scale::Linear => {
                let step = nice_step(self.high - self.low);
                let first = (self.low / step - slack).ceil() as i64;
                let last = (self.high / step + slack).floor() as i64;
                (first..=last).map(|i| i as f64 * step).collect()
            }
            Scale::Log => {
                let decades = (self.high / self.low).log10();
                let digits: &[f64] = if decades > 4.0 {
                    &[1.0]
                } else if decades > 1.7 {
                    &[1.0, 3.0]
                } else {
                    &[1.0, 2.0, 5.0]
                };
                let first = self.low.log10().floor() as i32;
                let last = self.high.log10().ceil() as i32;
                let mut t: Vec<f64> = (first..=last)
                    .flat_map(|e| digits.iter().map(move |d| d * 10f64.powi(e)))
                    .filter(|v| *v >= self.low * (1.0 - slack) && *v <= self.high * (1.0 + slack))
                    .collect();
                if t.len() < 2 {
                    t = vec![self.low, (self.low * self.high).sqrt(), self.high];
                }
                t
            }
        }
    }
}

/// 1, 2 or 5 times a power of ten, four to nine of them in `span`.
fn nice_step(span: f64) -> f64 {
    let raw = span / 5.0;
    let power = 10f64.powf(raw.log10().floor());
    let m = raw / power;
    power
        * if m < 1.5 {
            1.0
        } else if m < 3.5 {
            2.0
        } else if m < 7.5 {
            5.0
        } else {
            10.0
        }
}

/// A short label: `0.03`, `250`, `1.5 k`, `16 M`, `2e-7`.
pub(super) fn label(v: f64) -> String {
    let a = v.abs();
    let trim = |s: String| {
        if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_string() } else { s }
    };
    if a == 0.0 {
        "0".into()
    } else if (1e9..1e12).contains(&a) {
        trim(format!("{:.2}", v / 1e9)) + " G"
    } else if (1e6..1e9).contains(&a) {
        trim(format!("{:.2}", v / 1e6)) + " M"
    } else if (1e4..1e6).contains(&a) {
        trim(format!("{:.2}", v / 1e3)) + " k"
    } else if (1e-3..1e4).contains(&a) {
        let decimals = (2 - a.log10().floor() as i32).clamp(0, 6) as usize;
        trim(format!("{v:.decimals$}"))
    } else {
        let exponent = a.log10().floor() as i32;
        format!("{}e{exponent}", trim(format!("{:.1}", v / 10f64.powi(exponent))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_short_and_exact() {
        let got: Vec<String> =
            [0.0, 0.03, 2.5, 250.0, 1500.0, 16e6, 64_000.0, 2e-7, -0.2].map(label).to_vec();
        assert_eq!(got, ["0", "0.03", "2.5", "250", "1500", "16 M", "64 k", "2e-7", "-0.2"]);
    }

    #[test]
    fn ends_of_the_data_are_inside_and_order_is_kept() {
        for scale in [Scale::Linear, Scale::Log] {
            let m = Mapping::covering([3.0, 700.0].into_iter(), scale, false, 0.0, 100.0);
            let (a, b) = (m.at(3.0).unwrap(), m.at(700.0).unwrap());
            assert!((0.0..=100.0).contains(&a) && (0.0..=100.0).contains(&b) && a < b, "{a} {b}");
            let t = m.ticks();
            assert!(t.len() >= 3 && t.len() <= 12 && t.windows(2).all(|w| w[0] < w[1]), "{t:?}");
        }
    }

    #[test]
    fn constant_empty_and_nan_data_still_have_an_axis() {
        for values in [vec![], vec![5.0, 5.0], vec![f64::NAN], vec![0.0], vec![-1.0, -1.0]] {
            for scale in [Scale::Linear, Scale::Log] {
                let m = Mapping::covering(values.iter().copied(), scale, true, 0.0, 1.0);
                assert!(m.ticks().len() >= 2, "{values:?} {scale:?}");
                assert!(m.base().is_finite());
            }
        }
    }

    #[test]
    fn a_log_axis_has_no_place_for_zero() {
        let m = Mapping::covering([1.0, 10.0].into_iter(), Scale::Log, false, 0.0, 1.0);
        assert_eq!(m.at(0.0), None);
        assert_eq!(m.at(-3.0), None);
    }
}
