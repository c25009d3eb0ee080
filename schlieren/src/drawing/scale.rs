//! Round numbers with units, for scales on pictures.

/// The largest of 1, 2 and 5 times a power of ten that is not above a positive value.
///
/// ```
/// use schlieren::drawing::round_below;
/// assert_eq!([7.3, 0.049, 1.0].map(round_below), [5.0, 0.02, 1.0]);
/// ```
pub fn round_below(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return value;
    }
    let exponent = value.log10().floor() as i32;
    let steps = [5.0, 2.0, 1.0, 0.5];
    // Dividing by a power of ten is exact where multiplying by its inverse is not.
    let scaled = |s: f64| {
        if exponent >= 0 { s * 10f64.powi(exponent) } else { s / 10f64.powi(-exponent) }
    };
    steps.map(scaled).into_iter().find(|s| *s <= value * (1.0 + 1e-12)).unwrap_or(value)
}

/// A value with up to three digits in the unit with the prefix that suits it.
///
/// ```
/// use schlieren::drawing::in_unit;
/// assert_eq!(in_unit(2e-5, "rad"), "20 µrad");
/// assert_eq!(in_unit(0.005, "m"), "5 mm");
/// assert_eq!(in_unit(0.0, "m"), "0 m");
/// ```
pub fn in_unit(value: f64, unit: &str) -> String {
    let prefixes = [(1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"), (1e-15, "f")];
    let size = value.abs();
    if !(1e-18..1e6).contains(&size) {
        return if size == 0.0 { format!("0 {unit}") } else { format!("{value:.2e} {unit}") };
    }
    // 0.9995 rounds to 1.00.
    let (factor, prefix) =
        prefixes.into_iter().find(|p| size >= 0.9995 * p.0).unwrap_or((1e-15, "f"));
    let scaled = value / factor;
    let decimals = match scaled.abs() {
        s if s >= 99.95 => 0,
        s if s >= 9.995 => 1,
        _ => 2,
    };
    let text = format!("{scaled:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} {prefix}{unit}")
}
