//! Computes n − 1 at every point, and warns about input values that are implausible.

use super::medium::Column;
use super::{InputError, Medium, Options, Report};
use crate::index::ciddor::{self, Ciddor, MoistAir, ZERO_CELSIUS_K};
use crate::index::conditions::Model;
use crate::index::{Gas, IndexError, Mixture, mixture, plasma};
use rayon::prelude::*;
use rt_core::math::median_high;

/// Plausible densities of gases, kg/m³: a generous range from rarefied wind tunnels to
/// supercritical injection.
const PLAUSIBLE_DENSITY: [f64; 2] = [1e-4, 100.0];
const PLAUSIBLE_PRESSURE: [f64; 2] = [10.0, 1e9];
const PLAUSIBLE_TEMPERATURE: [f64; 2] = [20.0, 20_000.0];
/// Temperatures in °C of ordinary experiments. In K, gases at these temperatures would be liquid or
/// solid.
const CELSIUS_SUSPECT: [f64; 2] = [-80.0, 75.0];
/// If the median density is within this of 1, the density is probably normalised by the free
/// stream.
const NORMALISED: f64 = 2e-3;

/// Smallest, median (of a sample) and largest finite value.
struct Spread {
    low: f64,
    median: f64,
    high: f64,
}

fn spread(len: usize, value: impl Fn(usize) -> f64 + Sync) -> Option<Spread> {
    let nothing = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = (0..len)
        .into_par_iter()
        .map(&value)
        .filter(|v| v.is_finite())
        .fold(|| nothing, |(l, h), v| (l.min(v), h.max(v)))
        .reduce(|| nothing, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    // The median is only a hint, so a sample of the values is enough.
    let step = (len / 10_001).max(1);
    let mut some: Vec<f64> = (0..len).step_by(step).map(&value).filter(|v| v.is_finite()).collect();
    (low <= high).then(|| Spread { low, high, median: median_high(&mut some).unwrap_or(low) })
}

/// n − 1 at every point; NaN where no gas has these values.
pub(super) fn evaluate(
    columns: &[Column],
    options: &Options,
    report: &mut Report,
) -> Result<Vec<f64>, InputError> {
    let len = columns
        .iter()
        .find_map(|c| match c {
            Column::Values(v) => Some(v.len()),
            Column::Constant(_) => None,
        })
        .unwrap_or(0);
    let wavelength_um = options.wavelength_nm * 1e-3;
    let out = match &options.medium {
        Medium::Density { .. } => by_density(columns, len, wavelength_um, options, report)?,
        Medium::TemperaturePressure { .. } => {
            by_state(columns, len, wavelength_um, options, report)?
        }
        Medium::NMinus1(_) => {
            report.formula = "given";
            (0..len).into_par_iter().map(|i| columns[0].at(i)).collect()
        }
        Medium::Electrons(_) => {
            report.formula = "plasma";
            Ciddor::new(wavelength_um)?; // the same range of wavelengths as for gases
            let of = |i| plasma::n_minus_1(columns[0].at(i), wavelength_um).unwrap_or(f64::NAN);
            (0..len).into_par_iter().map(of).collect()
        }
        Medium::Multifield { .. } => {
            report.formula = "multifield";
            let fields = options
                .medium
                .multifield()
                .unwrap_or_else(|| unreachable!("the medium is multifield"));
            let of = |i| fields.n_minus_1(&columns.iter().map(|c| c.at(i)).collect::<Vec<_>>());
            (0..len).into_par_iter().map(of).collect::<Vec<f64>>()
        }
    };
    let n = spread(len, |i| out[i]);
    if let Some(s) = &n {
        report.n_minus_1_range = [s.low, s.high];
    }
    warn_without_index(columns, &out, options, report);
    Ok(out)
}

/// Warns about points with finite values but no index.
fn warn_without_index(columns: &[Column], out: &[f64], options: &Options, report: &mut Report) {
    let without_index = (0..out.len())
        .into_par_iter()
        .filter(|&i| !out[i].is_finite() && columns.iter().all(|c| c.at(i).is_finite()))
        .count();
    if without_index > 0 {
        let why = match options.medium {
            Medium::Electrons(_) => "the electron density is negative or above the critical one",
            _ => {
                "no gas has these values (temperature not above 0 K, negative pressure or density, \
                 or humidity beyond boiling)"
            }
        };
        report.warnings.push(format!(
            "{without_index} of {} values of {} give no index: {why}; these points are blank",
            out.len(),
            options.medium.describe()
        ));
    }
}

fn by_density(
    columns: &[Column],
    len: usize,
    wavelength_um: f64,
    options: &Options,
    report: &mut Report,
) -> Result<Vec<f64>, InputError> {
    report.formula = "gladstone-dale";
    if options.model == Model::Ciddor {
        return Err(InputError::Option {
            what: "Ciddor's equation takes temperature and pressure, not a density".into(),
            cure: "name those arrays, or omit the model",
        });
    }
    let (mixture, blends) = mix(&columns[1..], wavelength_um, options, report)?;
    let density = &columns[0];
    if let Some(s) = spread(len, |i| density.at(i)) {
        report.density_range_kg_m3 = Some([s.low, s.high]);
        let [low, high] = PLAUSIBLE_DENSITY;
        if s.low < low || s.high > high {
            let value = if s.high > high { s.high } else { s.low };
            report.warnings.push(format!(
                "density {value} kg/m^3 is not one of a gas in a wind tunnel ({low}..{high}); give \
                 the unit of the file as flow.density_unit_kg_m3, such as 1000 for g/cm^3"
            ));
        } else if (s.median - 1.0).abs() < NORMALISED && s.low < s.high {
            report.warnings.push(
                "the density is 1 at most points, so it is probably normalised by the free stream; \
                 give the free stream's density in kg/m^3 as flow.density_unit_kg_m3, such as 1.2"
                    .into(),
            );
        }
    }
    let of = |i: usize| {
        let rho = density.at(i);
        if rho >= 0.0 { blends.at(&mixture, i).n_minus_1(rho) } else { f64::NAN }
    };
    Ok((0..len).into_par_iter().map(of).collect())
}

fn by_state(
    columns: &[Column],
    len: usize,
    wavelength_um: f64,
    options: &Options,
    report: &mut Report,
) -> Result<Vec<f64>, InputError> {
    let [temperature, pressure, humidity, co2, species @ ..] = columns else {
        unreachable!("Medium::quantities gives four columns and the species")
    };
    let ciddor = Ciddor::new(wavelength_um)?;
    let t = spread(len, |i| temperature.at(i));
    let p = spread(len, |i| pressure.at(i));
    let wet = spread(len, |i| humidity.at(i)).is_some_and(|s| s.high != 0.0);
    plausible(&t, &p, report);

    // One formula for all points, so that there is no seam.
    let [cold, hot] = ciddor::TEMPERATURE_RANGE_C.map(|c| c + ZERO_CELSIUS_K);
    let in_range = t.as_ref().is_some_and(|s| s.low >= cold && s.high <= hot);
    let use_ciddor = match options.model {
        Model::Ciddor if !species.is_empty() => {
            return Err(InputError::Option {
                what: "Ciddor's equation is for air, but species are given".into(),
                cure: "omit the model or the species",
            });
        }
        Model::Ciddor => true,
        Model::GladstoneDale => false,
        Model::Auto => species.is_empty() && in_range,
    };
    if use_ciddor {
        report.formula = "ciddor";
        if let (Some(t), Some(p)) = (&t, &p) {
            for (kelvin, pressure_pa) in [(t.low, p.low), (t.high, p.high)] {
                let air = MoistAir {
                    temperature_c: kelvin - ZERO_CELSIUS_K,
                    pressure_pa,
                    ..Default::default()
                };
                for text in ciddor.out_of_range(&air).iter().map(ToString::to_string) {
                    if !report.warnings.contains(&text) {
                        report.warnings.push(text);
                    }
                }
            }
        }
        let of = |i: usize| {
            let air = MoistAir {
                temperature_c: temperature.at(i) - ZERO_CELSIUS_K,
                pressure_pa: pressure.at(i),
                relative_humidity: humidity.at(i),
                co2_ppm: co2.at(i),
            };
            ciddor.n_minus_1(&air).unwrap_or(f64::NAN)
        };
        return Ok((0..len).into_par_iter().map(of).collect());
    }

    report.formula = "gladstone-dale";
    if options.model == Model::Auto
        && species.is_empty()
        && let Some(s) = &t
    {
        report.warnings.push(format!(
            "temperatures from {:.1} to {:.1} K are not all in -40..100 C, where Ciddor's equation \
             holds: Gladstone-Dale with the density of an ideal gas is used; for flames name the \
             species",
            s.low, s.high
        ));
    }
    if wet {
        report.warnings.push(
            "humidity is not used by Gladstone-Dale; give water vapour as a species, NAME=H2O with \
             its mass fraction".into(),
        );
    }
    let (mixture, blends) = mix(species, wavelength_um, options, report)?;
    mixture.check_molar_masses()?;
    let density = |i: usize| {
        let (t, p) = (temperature.at(i), pressure.at(i));
        if t > 0.0 && p >= 0.0 { blends.at(&mixture, i).density_kg_m3(t, p) } else { f64::NAN }
    };
    report.density_range_kg_m3 = spread(len, density).map(|s| [s.low, s.high]);
    Ok((0..len).into_par_iter().map(|i| blends.at(&mixture, i).n_minus_1(density(i))).collect())
}

/// Warns about temperatures and pressures that are probably in other units.
fn plausible(t: &Option<Spread>, p: &Option<Spread>, report: &mut Report) {
    if let Some(s) = t {
        let [low, high] = PLAUSIBLE_TEMPERATURE;
        if (CELSIUS_SUSPECT[0]..CELSIUS_SUSPECT[1]).contains(&s.median) {
            report.warnings.push(format!(
                "the temperature is {:.1} K at the median: if it is in degrees Celsius, set \
                 flow.temperature_zero_k to 273.15",
                s.median
            ));
        } else if s.low < low || s.high > high {
            let value = if s.high > high { s.high } else { s.low };
            report.warnings.push(format!(
                "temperature {value} K is not plausible ({low}..{high}); check the array, and \
                 flow.temperature_zero_k"
            ));
        }
    }
    if let Some(s) = p {
        let [low, high] = PLAUSIBLE_PRESSURE;
        if s.low < low || s.high > high {
            let value = if s.high > high { s.high } else { s.low };
            report.warnings.push(format!(
                "pressure {value} Pa is not plausible ({low}..{high}); give its unit as \
                 flow.pressure_unit_pa (100000 for bar), or set flow.pressure_zero_pa to 101325 if \
                 it is relative to the atmosphere"
            ));
        }
    }
}

/// Mixtures point by point, or one for all.
enum Blends<'a> {
    Same(mixture::Blend),
    Each(&'a [Column]),
}

impl Blends<'_> {
    fn at(&self, mixture: &Mixture, i: usize) -> mixture::Blend {
        match self {
            Blends::Same(b) => *b,
            Blends::Each(columns) => {
                // Mixtures in flames have about ten species; more are allocated on the heap.
                let mut stack = [0.0; 16];
                if let Some(fractions) = stack.get_mut(..columns.len()) {
                    fractions.iter_mut().zip(*columns).for_each(|(f, c)| *f = c.at(i));
                    mixture.blend(fractions)
                } else {
                    mixture.blend(&columns.iter().map(|c| c.at(i)).collect::<Vec<_>>())
                }
            }
        }
    }
}

fn mix<'a>(
    columns: &'a [Column],
    wavelength_um: f64,
    options: &Options,
    report: &mut Report,
) -> Result<(Mixture, Blends<'a>), IndexError> {
    let mixture = Mixture::new(&options.medium.species(), &Gas::AIR, wavelength_um)?;
    report.warnings.extend(mixture.warnings().iter().map(ToString::to_string));
    if columns.is_empty() {
        let blend = mixture.blend(&[]);
        return Ok((mixture, Blends::Same(blend)));
    }
    let len = columns.iter().find_map(|c| match c {
        Column::Values(v) => Some(v.len()),
        Column::Constant(_) => None,
    });
    let blends = Blends::Each(columns);
    if let Some(s) = spread(len.unwrap_or(1), |i| blends.at(&mixture, i).sum) {
        if s.high > 1.0 + 10.0 * mixture::SUM_TOLERANCE {
            report.warnings.push(format!(
                "mass fractions sum to up to {:.4} and are scaled down to 1; check that they are \
                 not mole fractions or per cent",
                s.high
            ));
        }
        if s.low < 1.0 - 10.0 * mixture::SUM_TOLERANCE {
            report.warnings.push(format!(
                "mass fractions sum to only {:.4} at some points; the rest is taken as air",
                s.low
            ));
        }
    }
    Ok((mixture, blends))
}
