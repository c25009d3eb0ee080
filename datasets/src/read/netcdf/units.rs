//! Units that are converted to those of SI, so that lengths, pressures, temperatures and densities
//! are what the rest of the project takes them for.

/// `value * scale + offset` is in `unit`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ToSi {
    pub(super) unit: &'static str,
    pub(super) scale: f64,
    pub(super) offset: f64,
}

/// The spellings are those of UDUNITS that files have.
const TABLE: &[(&[&str], ToSi)] = &[
    (&["mm", "millimeter", "millimeters", "millimetre", "millimetres"], of("m", 1e-3, 0.0)),
    (&["cm", "centimeter", "centimeters", "centimetre", "centimetres"], of("m", 1e-2, 0.0)),
    (&["um", "µm", "micron", "microns", "micrometer", "micrometers"], of("m", 1e-6, 0.0)),
    (&["km", "kilometer", "kilometers", "kilometre", "kilometres"], of("m", 1e3, 0.0)),
    (&["in", "inch", "inches"], of("m", 0.0254, 0.0)),
    (&["ft", "foot", "feet"], of("m", 0.3048, 0.0)),
    (&["hPa", "hectopascal", "mbar", "mb", "millibar", "millibars"], of("Pa", 100.0, 0.0)),
    (&["kPa", "kilopascal"], of("Pa", 1e3, 0.0)),
    (&["MPa", "megapascal"], of("Pa", 1e6, 0.0)),
    (&["bar"], of("Pa", 1e5, 0.0)),
    (&["atm"], of("Pa", 101_325.0, 0.0)),
    (
        &["degC", "°C", "C", "celsius", "Celsius", "deg_C", "degree_Celsius", "degrees_Celsius"],
        of("K", 1.0, 273.15),
    ),
    (&["g/cm3", "g/cm^3", "g cm-3", "g cm^-3", "g/cc"], of("kg m-3", 1e3, 0.0)),
    (&["g/m3", "g m-3", "g/m^3"], of("kg m-3", 1e-3, 0.0)),
];

const fn of(unit: &'static str, scale: f64, offset: f64) -> ToSi {
    ToSi { unit, scale, offset }
}

/// How a unit becomes one of SI; `None` if it is one, or is not known.
pub(super) fn to_si(unit: &str) -> Option<ToSi> {
    let unit = unit.trim();
    TABLE.iter().find(|(names, _)| names.contains(&unit)).map(|(_, si)| *si)
}
