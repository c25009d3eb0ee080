//! Units: what `DataClass_t`, `DimensionalUnits_t`, `DimensionalExponents_t` and
//! `DataConversion_t` say about the numbers of an array. Values with units become those of SI.
//!
//! Source: "CGNS Standard Interface Data Structures", chapters 4.3 to 4.5 and appendix A.

use super::tree::{Node, Tree};
use crate::model::Values;
use crate::read::error::Fault;

/// What the nodes above an array say about its units; the nearest counts.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Units {
    class: Option<String>,
    /// Names of the units of mass, length, time, temperature and angle.
    names: Option<Vec<String>>,
}

/// `value * scale + offset` is in the unit of SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Conversion {
    pub(super) scale: f64,
    pub(super) offset: f64,
}

impl Units {
    /// With what a node says itself.
    pub(super) fn at(&self, children: &[Node]) -> Result<Units, Fault> {
        let mut out = self.clone();
        for c in children {
            match c.label.as_str() {
                "DataClass_t" => out.class = Some(c.text()?),
                "DimensionalUnits_t" => out.names = Some(c.texts()?),
                _ => {}
            }
        }
        Ok(out)
    }

    /// Whether the values have no dimension that the file tells.
    fn is_nondimensional(&self) -> bool {
        let class = self.class.as_deref().unwrap_or("");
        matches!(class, "NormalizedByUnknownDimensional" | "NondimensionalParameter")
    }

    /// How the values of an array become those of SI, `None` if they are or nothing is known.
    /// `notes` names what was done, once for each kind.
    pub(super) fn conversion(
        &self,
        tree: &Tree,
        array: &Node,
        notes: &mut Vec<String>,
    ) -> Result<Option<Conversion>, Fault> {
        let children = tree.children(array)?;
        let own = self.at(&children)?;
        if own.is_nondimensional() {
            note(notes, "the values have no dimension (DataClass): they are taken as they are");
            return Ok(None);
        }
        let mut result = Conversion { scale: 1.0, offset: 0.0 };
        let class = own.class.as_deref().unwrap_or("");
        if class == "NormalizedByDimensional"
            && let Some(c) = children.iter().find(|c| c.label == "DataConversion_t")
        {
            let [scale, offset, ..] = c.numbers()?[..] else {
                return Err(c.fault("it needs a scale and an offset"));
            };
            result = Conversion { scale, offset };
            note(notes, "normalized values are multiplied by their DataConversion");
        }
        let given = children.iter().find(|c| c.label == "DimensionalExponents_t");
        let exponents = match given {
            Some(e) => {
                let mut all = e.numbers()?;
                all.resize(5, 0.0);
                Some([all[0], all[1], all[2], all[3], all[4]])
            }
            None => standard_exponents(&array.name),
        };
        let names = own.names.as_deref().unwrap_or(&[]);
        if let Some(exponents) = exponents
            && let Some((si, unit)) = to_si(names, exponents)
        {
            note(notes, &format!("`{}` in {unit} is converted to units of SI", array.name));
            result.scale *= si.scale;
            result.offset = result.offset * si.scale + si.offset;
        }
        Ok((result != Conversion { scale: 1.0, offset: 0.0 }).then_some(result))
    }
}

fn note(notes: &mut Vec<String>, text: &str) {
    if !notes.iter().any(|n| n == text) {
        notes.push(text.to_string());
    }
}

impl Conversion {
    /// The values in SI, in the precision of the file.
    pub(super) fn of(self, values: Values) -> Values {
        let convert = |x: f64| x * self.scale + self.offset;
        match values {
            Values::F32(v) => Values::F32(v.iter().map(|&x| convert(x.into()) as f32).collect()),
            other => Values::F64((0..other.len()).map(|i| convert(other.get_f64(i))).collect()),
        }
    }
}

/// Mass, length, time, temperature, angle of the names that the SIDS defines and flows have.
fn standard_exponents(name: &str) -> Option<[f64; 5]> {
    Some(match name {
        "CoordinateX" | "CoordinateY" | "CoordinateZ" => [0.0, 1.0, 0.0, 0.0, 0.0],
        "Density" | "DensityStagnation" => [1.0, -3.0, 0.0, 0.0, 0.0],
        "Pressure" | "PressureStagnation" | "PressureDynamic" => [1.0, -1.0, -2.0, 0.0, 0.0],
        "Temperature" | "TemperatureStagnation" => [0.0, 0.0, 0.0, 1.0, 0.0],
        "VelocityX" | "VelocityY" | "VelocityZ" | "VelocityMagnitude" | "VelocitySound" => {
            [0.0, 1.0, -1.0, 0.0, 0.0]
        }
        "MomentumX" | "MomentumY" | "MomentumZ" => [1.0, -2.0, -1.0, 0.0, 0.0],
        "EnergyStagnationDensity" => [1.0, -1.0, -2.0, 0.0, 0.0],
        "Enthalpy" | "EnergyInternal" | "EnergyStagnation" => [0.0, 2.0, -2.0, 0.0, 0.0],
        _ => return None,
    })
}

/// The size of a unit in that of SI, and for temperatures the zero of its scale.
fn unit(name: &str) -> Option<(f64, f64)> {
    const POUND_KG: f64 = 0.453_592_37;
    const FOOT_M: f64 = 0.3048;
    Some(match name {
        "Gram" => (1e-3, 0.0),
        "Slug" => (POUND_KG * 9.806_65 / FOOT_M, 0.0),
        "PoundMass" => (POUND_KG, 0.0),
        "Centimeter" => (1e-2, 0.0),
        "Millimeter" => (1e-3, 0.0),
        "Foot" => (FOOT_M, 0.0),
        "Inch" => (0.0254, 0.0),
        "Celsius" => (1.0, 273.15),
        "Rankine" => (5.0 / 9.0, 0.0),
        "Fahrenheit" => (5.0 / 9.0, 459.67 * 5.0 / 9.0),
        _ => return None,
    })
}

/// How values of a dimension become those of SI, and their unit; `None` if they are already.
fn to_si(names: &[String], exponents: [f64; 5]) -> Option<(Conversion, String)> {
    let mut result = Conversion { scale: 1.0, offset: 0.0 };
    let mut words = Vec::new();
    let is_temperature = exponents == [0.0, 0.0, 0.0, 1.0, 0.0];
    // Angles keep their unit: no quantity that is read here as one of SI has one.
    for (name, exponent) in names.iter().zip(exponents).take(4) {
        if exponent == 0.0 {
            continue;
        }
        words.push(if exponent == 1.0 { name.clone() } else { format!("{name}^{exponent}") });
        if let Some((scale, zero)) = unit(name) {
            result.scale *= scale.powf(exponent);
            result.offset = if is_temperature { zero } else { 0.0 };
        }
    }
    (result != Conversion { scale: 1.0, offset: 0.0 }).then(|| (result, words.join(" ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_pressures_and_temperatures_become_those_of_si() {
        let convert = |units: [&str; 5], name: &str, value: f64| {
            let names = units.map(String::from);
            let si = to_si(&names, standard_exponents(name).unwrap());
            si.map_or(value, |(c, _)| value * c.scale + c.offset)
        };
        // The values of the standard atmosphere are given with five digits.
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
        let cgs = ["Gram", "Centimeter", "Second", "Celsius", "Degree"];
        near(convert(cgs, "Density", 1.2e-3), 1.2);
        near(convert(cgs, "Pressure", 1.01325e6), 101_325.0);
        near(convert(cgs, "Temperature", 20.0), 293.15);
        let us = ["Slug", "Foot", "Second", "Fahrenheit", "Degree"];
        near(convert(us, "Density", 0.002_376_9), 1.225_0);
        near(convert(us, "Pressure", 2116.22), 101_325.0);
        near(convert(us, "Temperature", 59.0), 288.15);
        near(convert(us, "CoordinateX", 1.0), 0.3048);
        let si = ["Kilogram", "Meter", "Second", "Kelvin", "Radian"].map(String::from);
        assert_eq!(to_si(&si, standard_exponents("Density").unwrap()), None);
    }
}
