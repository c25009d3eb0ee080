//! Parses the values of options, with their units.

use crate::index::multifield::Rule;
use crate::input::{Outside, Role};
use crate::scene::SourceSpec;
use datasets::resample::Reconstruction;

/// Units of lengths.
const LENGTHS: [(&str, f64); 6] =
    [("nm", 1e-9), ("um", 1e-6), ("µm", 1e-6), ("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)];
/// Units of angles.
const ANGLES: [(&str, f64); 6] = [
    ("urad", 1e-6),
    ("µrad", 1e-6),
    ("mrad", 1e-3),
    ("nrad", 1e-9),
    ("arcsec", std::f64::consts::PI / 648_000.0),
    ("rad", 1.0),
];

/// Parses a number with one of the units; without a unit, the last of `units` applies.
fn with_unit(text: &str, units: &[(&str, f64)], example: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is not a quantity with a unit; write for example {example}");
    let text_trimmed = text.trim();
    // Take the longest matching unit, because "mm" also ends with "m".
    let unit = units.iter().filter(|u| text_trimmed.ends_with(u.0)).max_by_key(|u| u.0.len());
    let (number, scale) = unit
        .map_or((text_trimmed, 1.0), |u| (&text_trimmed[..text_trimmed.len() - u.0.len()], u.1));
    let value: f64 = number.trim().parse().map_err(|_| wrong())?;
    if value.is_finite() { Ok(value * scale) } else { Err(wrong()) }
}

/// Parses a length such as `0.5`, `500mm` or `0.5m`; returns metres.
pub(super) fn length(text: &str) -> Result<f64, String> {
    with_unit(text, &LENGTHS, "0.5m, 20mm or 500um")
}

/// Parses an angle such as `1e-7rad`, `0.1urad` or `1e-7`; returns radians.
pub(super) fn angle_rad(text: &str) -> Result<f64, String> {
    with_unit(text, &ANGLES, "1e-7rad, 0.1urad or 0.02arcsec")
}

/// Parses a size in pixels such as `1024x768`.
pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    let wrong =
        || format!("`{text}` is not a size; write for example 960x540 (1 to 16384 pixels each)");
    let (w, h) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let pixels = |t: &str| t.parse().ok().filter(|n| (1..=16384).contains(n));
    Ok([pixels(w).ok_or_else(wrong)?, pixels(h).ok_or_else(wrong)?])
}

/// Parses a light source: `point`, `slit:1mm,5mm` or `circle:0.5mm`.
pub(super) fn source(text: &str) -> Result<SourceSpec, String> {
    let wrong = || {
        format!(
            "`{text}` is not a source; write point, slit:WIDTH,LENGTH (slit:1mm,5mm) or \
             circle:DIAMETER"
        )
    };
    if text == "point" {
        return Ok(SourceSpec::Point {});
    }
    let (kind, sizes) = text.split_once(':').ok_or_else(wrong)?;
    match kind {
        "slit" => {
            let (w, l) = sizes.split_once(',').ok_or_else(wrong)?;
            Ok(SourceSpec::Slit { width_m: length(w)?, length_m: length(l)?, angle_deg: None })
        }
        "circle" => Ok(SourceSpec::Circle { diameter_m: length(sizes)? }),
        _ => Err(wrong()),
    }
}

/// Parses a species, `NAME=GAS`.
pub(super) fn species(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=').filter(|(name, gas)| !name.is_empty() && !gas.is_empty());
    let (name, gas) = parts.ok_or_else(|| {
        format!("`{text}` is not NAME=GAS; write for example Y_CH4=CH4 or Y_fuel=0.42")
    })?;
    Ok((name.to_string(), gas.to_string()))
}

/// Parses the points of a transfer function, `NAME=VALUE:N,VALUE:N`.
pub(super) fn curve(text: &str) -> Result<(String, Vec<[f64; 2]>), String> {
    let wrong = || {
        format!(
            "`{text}` is not NAME=VALUE:N,VALUE:N,... with n - 1 at values of the array; write for \
             example T=300:0,2000:-2e-4"
        )
    };
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let knot = |t: &str| t.split_once(':').and_then(|(v, n)| Some([number(v)?, number(n)?]));
    let (name, knots) = text.rsplit_once('=').filter(|p| !p.0.is_empty()).ok_or_else(wrong)?;
    let knots = knots.split(',').map(knot).collect::<Option<Vec<_>>>().ok_or_else(wrong)?;
    Ok((name.to_string(), knots))
}

/// Parses a weight, `NAME=NUMBER`.
pub(super) fn weight(text: &str) -> Result<(String, f64), String> {
    let parts = text.rsplit_once('=').filter(|p| !p.0.is_empty());
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let parsed = parts.and_then(|(name, w)| Some((name.to_string(), number(w)?)));
    parsed.ok_or_else(|| format!("`{text}` is not NAME=NUMBER; write for example T=0.5"))
}

/// Parses how transfer functions combine.
pub(super) fn rule(text: &str) -> Result<Rule, String> {
    match text {
        "sum" => Ok(Rule::Sum),
        "largest" => Ok(Rule::Largest),
        _ => Err(format!("there is no rule `{text}`; there are: sum, largest")),
    }
}

/// Parses how a node without gas affects light.
pub(super) fn role(text: &str) -> Result<Role, String> {
    match text {
        "blank" => Ok(Role::Blank),
        "solid" => Ok(Role::Solid),
        "gas" => Ok(Role::Gas),
        _ => Err(format!("`{text}` is not a role; there are: blank, solid, gas")),
    }
}

/// Parses what is outside the mesh.
pub(super) fn outside(text: &str) -> Result<Outside, String> {
    if text == "auto" {
        return Ok(Outside::Auto);
    }
    role(text)
        .map(Outside::from)
        .map_err(|_| format!("`{text}` is not a role; there are: auto, blank, solid, gas"))
}

/// Parses a way to compute values between the points of a mesh.
pub(super) fn reconstruction(text: &str) -> Result<Reconstruction, String> {
    let found = Reconstruction::ALL.into_iter().find(|r| r.name() == text);
    found.ok_or_else(|| format!("`{text}` is not a reconstruction; there are: linear, cubic"))
}

/// Parses a number of samples per axis and node.
pub(super) fn resample_samples(text: &str) -> Result<usize, String> {
    let number = text.parse::<usize>().ok().filter(|n| (1..=8).contains(n));
    number.ok_or_else(|| format!("`{text}` is not a number of samples from 1 to 8"))
}

/// How shocks are smoothed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Smoothing {
    /// By this standard deviation in nodes.
    Nodes(f64),
    /// Jumps become averages over cells.
    Auto,
}

/// Parses a smoothing.
pub(super) fn smoothing(text: &str) -> Result<Smoothing, String> {
    if text == "auto" {
        return Ok(Smoothing::Auto);
    }
    let nodes = text.parse().ok().filter(|n: &f64| n.is_finite() && *n >= 0.0);
    nodes
        .map(Smoothing::Nodes)
        .ok_or_else(|| format!("`{text}` is not a smoothing; write auto, or nodes such as 1.2"))
}

/// Parses three numbers, `0.1,0.1,0.2`, or one for all axes.
pub(super) fn three(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|t| t.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    match numbers.as_deref() {
        Some([x]) => Ok([*x; 3]),
        Some([x, y, z]) => Ok([*x, *y, *z]),
        _ => Err(format!("`{text}` is not three numbers; write for example 0.1,0.1,0.2")),
    }
}

/// Parses two numbers, `320,200`.
pub(super) fn pair(text: &str) -> Result<[f64; 2], String> {
    let wrong = || format!("`{text}` is not two numbers; write for example 320,200");
    let (a, b) = text.split_once(',').ok_or_else(wrong)?;
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
    Ok([number(a)?, number(b)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_and_bare_numbers_are_si() {
        for (text, value) in [
            ("500mm", 0.5),
            ("0.5", 0.5),
            ("0.5m", 0.5),
            ("633nm", 633e-9),
            ("2cm", 0.02),
            ("3µm", 3e-6),
        ] {
            assert!((length(text).unwrap() / value - 1.0).abs() < 1e-12, "{text}");
        }
        assert_eq!(angle_rad("1e-7rad"), Ok(1e-7));
        assert!((angle_rad("1mrad").unwrap() - 1e-3).abs() < 1e-18);
        assert!((angle_rad("1arcsec").unwrap() - 4.848e-6).abs() < 1e-9);
        for wrong in ["", "mm", "1 foot", "nan", "inf m"] {
            assert!(length(wrong).unwrap_err().contains("20mm"), "{wrong}");
        }
    }

    #[test]
    fn curves_are_read() {
        assert_eq!(
            curve("T=300:0, 2000:-2e-4"),
            Ok(("T".into(), vec![[300.0, 0.0], [2000.0, -2e-4]]))
        );
        for wrong in ["T", "=1:2", "T=1", "T=1:x", "T=1:2,"] {
            assert!(curve(wrong).unwrap_err().contains("T=300:0,2000:-2e-4"), "{wrong}");
        }
        assert_eq!(weight("T=-0.5"), Ok(("T".into(), -0.5)));
        assert!(weight("T").is_err() && rule("mean").unwrap_err().contains("largest"));
    }

    #[test]
    fn sources_are_read() {
        assert_eq!(source("circle:0.5mm"), Ok(SourceSpec::Circle { diameter_m: 0.5e-3 }));
        assert!(matches!(source("slit:1mm,5mm"), Ok(SourceSpec::Slit { angle_deg: None, .. })));
        assert!(source("lamp").unwrap_err().contains("slit:1mm,5mm"));
    }
}
