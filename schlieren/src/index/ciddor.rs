//! Computes the refractive index of moist air by Ciddor's equation, with all terms: P. E. Ciddor,
//! "Refractive index of air: new equations for the visible and near infrared", Applied Optics 35,
//! 1566 (1996). Numbers of equations and appendices are those of the paper.
//!
//! Outside −40…100 °C the compressibility is an extrapolation: at 2000 K the result is 1.4 % above
//! that of an ideal gas. Use [`super::mixture`] for flames.

use super::{IndexError, OutOfRange};

/// Molar gas constant of the paper, J/(mol K).
const R_CODATA_1986: f64 = 8.314510;
/// Molar mass of water, kg/mol.
const MOLAR_MASS_WATER: f64 = 0.018015;
/// Temperature (°C) and pressure (Pa) of standard air, which is dry.
const STANDARD_AIR: (f64, f64) = (15.0, 101_325.0);
/// Temperature (°C) and pressure (Pa) of standard water vapour, which is pure.
const STANDARD_VAPOUR: (f64, f64) = (20.0, 1333.0);
/// 0 °C in K.
pub const ZERO_CELSIUS_K: f64 = 273.15;

/// The range in which Ciddor compared his equation with measurements.
pub const TEMPERATURE_RANGE_C: [f64; 2] = [-40.0, 100.0];
/// See [`TEMPERATURE_RANGE_C`].
pub const WAVELENGTH_RANGE_UM: [f64; 2] = [0.3, 1.69];
/// See [`TEMPERATURE_RANGE_C`].
pub const PRESSURE_RANGE_PA: [f64; 2] = [10_000.0, 140_000.0];
/// See [`TEMPERATURE_RANGE_C`].
pub const CO2_RANGE_PPM: [f64; 2] = [0.0, 2000.0];
/// Shortest wavelength. Below it oxygen absorbs, and the dispersion formula has poles (132 and 65
/// nm).
const SHORTEST_UM: f64 = 0.185;

/// The state of moist air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoistAir {
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// Relative humidity, 0 to 1.
    pub relative_humidity: f64,
    /// CO2, µmol/mol. Ciddor's standard is 450.
    pub co2_ppm: f64,
}

impl Default for MoistAir {
    /// 20 °C, 101325 Pa, dry, 450 ppm.
    fn default() -> Self {
        MoistAir {
            temperature_c: 20.0,
            pressure_pa: 101_325.0,
            relative_humidity: 0.0,
            co2_ppm: 450.0,
        }
    }
}

/// Ciddor's equation at one wavelength. Terms that depend only on the wavelength are computed once.
///
/// ```
/// use schlieren::index::ciddor::{Ciddor, MoistAir};
/// let air = MoistAir { temperature_c: 20.0, pressure_pa: 120e3, ..Default::default() };
/// let n_minus_1 = Ciddor::new(0.633)?.n_minus_1(&air)?;
/// assert!((n_minus_1 - 32191.57e-8).abs() < 1e-10); // (n−1)·10⁸ = 32191.57
/// # Ok::<(), schlieren::index::IndexError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ciddor {
    wavelength_um: f64,
    /// n − 1 of standard air with 450 ppm CO2.
    n_as: f64,
    /// n − 1 of standard water vapour.
    n_ws: f64,
    /// Density of standard water vapour, kg/m³.
    rho_ws: f64,
}

impl Ciddor {
    /// Prepares the equation for a vacuum wavelength. Fails below 185 nm, where air absorbs and the
    /// formula has its poles.
    pub fn new(wavelength_um: f64) -> Result<Self, IndexError> {
        if !(wavelength_um >= SHORTEST_UM && wavelength_um.is_finite()) {
            return Err(IndexError::Impossible {
                quantity: "wavelength",
                value: wavelength_um * 1000.0,
                unit: "nm",
                reason: "is below the range that air transmits (from 185 nm)",
                cure: "give the vacuum wavelength in nm (columns: lambda_um in micrometres)",
            });
        }
        let s = wavelength_um.powi(-2);
        // Eq. 1: standard dry air. Eq. 3: water vapour, with the factor 1.022 that fits it to
        // infrared data.
        let n_as = 1e-8 * (5_792_105.0 / (238.0185 - s) + 167_917.0 / (57.362 - s));
        let n_ws = 1.022e-8 * (295.235 + 2.6422 * s - 0.032380 * s * s + 0.004028 * s * s * s);
        let (t, p) = STANDARD_VAPOUR;
        let rho_ws = p * MOLAR_MASS_WATER
            / (compressibility(t, p, 1.0) * R_CODATA_1986 * (t + ZERO_CELSIUS_K));
        Ok(Ciddor { wavelength_um, n_as, n_ws, rho_ws })
    }

    /// n − 1 of air. Fails if no such air can exist. [`Self::out_of_range`] reports where the
    /// formula is not validated.
    pub fn n_minus_1(&self, air: &MoistAir) -> Result<f64, IndexError> {
        let vapour_fraction = vapour_mole_fraction(air)?;
        // Eq. 2, and the molar mass of dry air with this amount of CO2.
        let n_axs = self.n_as * (1.0 + 0.534e-6 * (air.co2_ppm - 450.0));
        let molar_mass_air = molar_mass_of_dry_air(air.co2_ppm);

        // Density of standard air.
        let (t_s, p_s) = STANDARD_AIR;
        let rho_axs = p_s * molar_mass_air
            / (compressibility(t_s, p_s, 0.0) * R_CODATA_1986 * (t_s + ZERO_CELSIUS_K));

        // Eq. 4: densities of the two components, with the compressibility of the mixture.
        let (t, p) = (air.temperature_c, air.pressure_pa);
        let mole_density =
            p / (compressibility(t, p, vapour_fraction) * R_CODATA_1986 * (t + ZERO_CELSIUS_K));
        let rho_a = mole_density * molar_mass_air * (1.0 - vapour_fraction);
        let rho_w = mole_density * MOLAR_MASS_WATER * vapour_fraction;

        // Eq. 5.
        Ok(rho_a / rho_axs * n_axs + rho_w / self.rho_ws * self.n_ws)
    }

    /// The conditions that lie outside the range in which the equation was compared with
    /// measurements.
    pub fn out_of_range(&self, air: &MoistAir) -> Vec<OutOfRange> {
        let checks = [
            (
                "wavelength",
                self.wavelength_um * 1000.0,
                WAVELENGTH_RANGE_UM.map(|x| x * 1000.0),
                "nm",
                "the dispersion there is an extrapolation",
            ),
            (
                "temperature",
                air.temperature_c,
                TEMPERATURE_RANGE_C,
                "C",
                "use Gladstone-Dale (`--model gladstone-dale`), with species for flames",
            ),
            (
                "pressure",
                air.pressure_pa,
                PRESSURE_RANGE_PA,
                "Pa",
                "the compressibility there is an extrapolation; check that it is in Pa, absolute",
            ),
            (
                "CO2",
                air.co2_ppm,
                CO2_RANGE_PPM,
                "ppm",
                "treat it as a mixture of species, or check that it is in ppm",
            ),
        ];
        checks
            .into_iter()
            .filter(|(_, value, [low, high], ..)| !(low..=high).contains(&value))
            .map(|(quantity, value, range, unit, cure)| OutOfRange {
                formula: "Ciddor 1996",
                quantity,
                value,
                range,
                unit,
                cure,
            })
            .collect()
    }

    /// Gladstone-Dale constants in m³/kg at this wavelength, of dry air with 450 ppm CO2 and of
    /// water vapour.
    pub fn gladstone_dale_m3_per_kg(&self) -> [f64; 2] {
        let (t, p) = STANDARD_AIR;
        let rho_as = p * molar_mass_of_dry_air(450.0)
            / (compressibility(t, p, 0.0) * R_CODATA_1986 * (t + ZERO_CELSIUS_K));
        [self.n_as / rho_as, self.n_ws / self.rho_ws]
    }
}

/// Molar mass of dry air in kg/mol, from CO2 in ppm (the paper, below eq. 4).
pub(crate) fn molar_mass_of_dry_air(co2_ppm: f64) -> f64 {
    1e-3 * (28.9635 + 12.011e-6 * (co2_ppm - 400.0))
}

/// Saturation pressure of water vapour in Pa: over water at 0 °C and above, over ice below
/// (appendix A).
pub fn saturation_pressure_pa(temperature_c: f64) -> f64 {
    let kelvin = temperature_c + ZERO_CELSIUS_K;
    if temperature_c >= 0.0 {
        let exponent = 1.237_884_7e-5 * kelvin * kelvin - 1.912_131_6e-2 * kelvin + 33.937_110_47
            - 6_343.164_5 / kelvin;
        exponent.exp()
    } else {
        10f64.powf(-2663.5 / kelvin + 12.537)
    }
}

/// Mole fraction of water vapour (appendix A). Fails if no such air can exist.
fn vapour_mole_fraction(air: &MoistAir) -> Result<f64, IndexError> {
    let MoistAir { temperature_c: t, pressure_pa: p, relative_humidity, co2_ppm } = *air;
    let impossible = |quantity, value, unit, reason, cure| {
        Err(IndexError::Impossible { quantity, value, unit, reason, cure })
    };
    if !(t > -ZERO_CELSIUS_K && t.is_finite()) {
        return impossible(
            "temperature",
            t,
            "C",
            "is not above absolute zero",
            "give it in degrees Celsius (K - 273.15)",
        );
    }
    if !(p >= 0.0 && p.is_finite()) {
        return impossible(
            "pressure",
            p,
            "Pa",
            "is not a pressure",
            "give the absolute pressure in Pa",
        );
    }
    if !(0.0..=1.0).contains(&relative_humidity) {
        return impossible(
            "relative humidity",
            relative_humidity,
            "",
            "is not between 0 and 1",
            "give it as a fraction (50 % is 0.5)",
        );
    }
    if !(0.0..=1e6).contains(&co2_ppm) {
        return impossible(
            "CO2",
            co2_ppm,
            "ppm",
            "is not between 0 and 1000000",
            "give it in ppm (umol/mol)",
        );
    }
    if relative_humidity == 0.0 || p == 0.0 {
        return Ok(0.0);
    }
    let enhancement = 1.00062 + 3.14e-8 * p + 5.6e-7 * t * t;
    let fraction = enhancement * relative_humidity * saturation_pressure_pa(t) / p;
    if !(0.0..=1.0).contains(&fraction) {
        return impossible(
            "relative humidity",
            relative_humidity,
            "",
            "would need a vapour pressure above the total pressure (the water boils)",
            "lower the humidity, or check temperature and pressure",
        );
    }
    Ok(fraction)
}

/// Compressibility of moist air (appendix A, eq. 12; the equation of the BIPM of 1981/91).
fn compressibility(t: f64, p: f64, x_w: f64) -> f64 {
    let kelvin = t + ZERO_CELSIUS_K;
    let p_over_t = p / kelvin;
    1.0 - p_over_t
        * (1.581_23e-6 - 2.9331e-8 * t
            + 1.1043e-10 * t * t
            + (5.707e-6 - 2.051e-8 * t) * x_w
            + (1.9898e-4 - 2.376e-6 * t) * x_w * x_w)
        + p_over_t * p_over_t * (1.83e-11 - 0.765e-8 * x_w * x_w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_the_paper_for_dry_air() {
        // Ciddor 1996, table 1: 633 nm, 450 ppm; (n−1)·10⁸ to 0.1.
        for (t, kpa, expected) in [
            (20.0, 80.0, 21458.0),
            (20.0, 100.0, 26824.4),
            (20.0, 120.0, 32191.6),
            (10.0, 100.0, 27774.7),
            (30.0, 100.0, 25937.2),
        ] {
            let air =
                MoistAir { temperature_c: t, pressure_pa: kpa * 1000.0, ..Default::default() };
            let got = Ciddor::new(0.633).unwrap().n_minus_1(&air).unwrap() * 1e8;
            assert!((got - expected).abs() <= 0.06, "{t} C, {kpa} kPa: {got}, expected {expected}");
        }
    }

    #[test]
    fn a_vacuum_has_index_one() {
        let air = MoistAir { pressure_pa: 0.0, relative_humidity: 0.7, ..Default::default() };
        assert_eq!(Ciddor::new(0.5).unwrap().n_minus_1(&air), Ok(0.0));
    }

    #[test]
    fn saturation_pressure_is_continuous_at_the_ice_point() {
        let (ice, water) = (saturation_pressure_pa(-1e-9), saturation_pressure_pa(0.0));
        assert!((water - 611.2).abs() < 0.3 && (ice / water - 1.0).abs() < 1e-3, "{ice} {water}");
    }

    #[test]
    fn flames_are_out_of_range_and_say_what_to_do() {
        let c = Ciddor::new(0.633).unwrap();
        let flame = MoistAir { temperature_c: 1726.85, ..Default::default() };
        let warnings = c.out_of_range(&flame);
        assert_eq!(warnings.len(), 1);
        let text = warnings[0].to_string();
        assert!(
            text.contains("temperature 1726.85 C") && text.contains("Gladstone-Dale"),
            "{text}"
        );
        // Reason: the extrapolated compressibility makes the result differ by more than 1 % from an
        // ideal gas with the same K.
        let k = c.gladstone_dale_m3_per_kg()[0];
        let ideal = k * 101_325.0 * molar_mass_of_dry_air(450.0) / (R_CODATA_1986 * 2000.0);
        let ratio = c.n_minus_1(&flame).unwrap() / ideal;
        assert!((1.01..1.02).contains(&ratio), "{ratio}");
        assert!(c.out_of_range(&MoistAir::default()).is_empty());
        assert_eq!(
            Ciddor::new(1.7).unwrap().out_of_range(&MoistAir::default())[0].quantity,
            "wavelength"
        );
    }

    #[test]
    fn impossible_air_is_refused_by_name() {
        let c = Ciddor::new(0.633).unwrap();
        let cases = [
            (MoistAir { temperature_c: -273.15, ..Default::default() }, "temperature"),
            (MoistAir { temperature_c: f64::NAN, ..Default::default() }, "temperature"),
            (MoistAir { pressure_pa: -1.0, ..Default::default() }, "pressure"),
            (MoistAir { relative_humidity: 50.0, ..Default::default() }, "50 % is 0.5"),
            (
                MoistAir {
                    relative_humidity: 1.0,
                    temperature_c: 95.0,
                    pressure_pa: 5e4,
                    co2_ppm: 450.0,
                },
                "boils",
            ),
            (MoistAir { co2_ppm: -3.0, ..Default::default() }, "CO2"),
        ];
        for (air, word) in cases {
            let text = c.n_minus_1(&air).unwrap_err().to_string();
            assert!(text.contains(word), "{text}");
        }
        for wavelength in [0.0, -1.0, 0.1, f64::NAN, f64::INFINITY] {
            assert!(Ciddor::new(wavelength).is_err());
        }
    }
}
