//! Computes the index of gases by the Gladstone-Dale law, n − 1 = K ρ, with K from published
//! dispersion formulas.
//!
//! K depends on the wavelength and hardly on the temperature. The dependence on temperature that
//! the dissertation describes (section 5.2) is that of the density. A formula gives n − 1 at a
//! reference state, and K is that value divided by the density there. The density is that of a gas
//! with second virial coefficient B: ρ = p M / (R T Z), Z = 1 + B p / (R T). Without B, K of SF6
//! would be 1.3 % too large.
//!
//! The coefficients are from the papers named for each gas, as collected in refractiveindex.info
//! (CC0). The virial coefficients are from J. H. Dymond and E. B. Smith, "The Virial Coefficients
//! of Pure Gases and Mixtures" (1980), with an accuracy of about 3 cm³/mol, which is 0.01 % of K.

use super::ciddor::Ciddor;
use super::{IndexError, OutOfRange};
use std::fmt;
use std::str::FromStr;

/// Molar gas constant (SI 2019), J/(mol K).
pub(crate) const R_CODATA_2018: f64 = 8.314_462_618;

/// A component of a mixture.
#[derive(Debug, Clone, PartialEq)]
pub enum Gas {
    /// One of [`KNOWN`], by its index.
    Known(usize),
    /// A gas given by numbers: its Gladstone-Dale constant at the wavelength in use, and its molar
    /// mass if density follows from temperature and pressure.
    Given {
        /// Gladstone-Dale constant, m³/kg.
        k_m3_per_kg: f64,
        /// Molar mass, kg/mol.
        molar_mass_kg: Option<f64>,
    },
}

/// A gas with its dispersion formula.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownGas {
    /// Formula or short name: `N2`, `air`.
    pub name: &'static str,
    /// Other names, in lower case.
    pub aliases: &'static [&'static str],
    /// Molar mass, g/mol.
    pub molar_mass_g: f64,
    /// Measured range of wavelengths, µm.
    pub range_um: [f64; 2],
    /// Source of the formula.
    pub source: &'static str,
    dispersion: Dispersion,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Dispersion {
    /// n − 1 = c + Σ b/(a − 1/λ²), with terms (b, a), at a reference state.
    Sellmeier {
        constant: f64,
        terms: &'static [(f64, f64)],
        state: State,
    },
    /// n − 1 = a + b/λ² at a reference state.
    Cauchy {
        a: f64,
        b: f64,
        state: State,
    },
    /// From the index of the liquid, n = a + b/λ + c/λ², and its density in kg/m³, by the
    /// Lorentz-Lorenz relation.
    Liquid {
        n: [f64; 3],
        density: f64,
    },
    /// Dry air and water vapour of Ciddor's equation.
    CiddorAir,
    CiddorVapour,
}

/// Reference state of a formula: temperature (K), pressure (Pa), second virial coefficient
/// (cm³/mol).
#[derive(Debug, Clone, Copy, PartialEq)]
struct State {
    kelvin: f64,
    pascal: f64,
    virial_cm3: f64,
}

/// The reference state of 0 °C and one atmosphere.
const fn normal(virial_cm3: f64) -> State {
    State { kelvin: 273.15, pascal: 101_325.0, virial_cm3 }
}

/// All gases with a formula.
pub const KNOWN: &[KnownGas] = &[
    KnownGas {
        name: "air",
        aliases: &["dry air", "dry-air"],
        molar_mass_g: 28.9641,
        range_um: [0.3, 1.69],
        source: "P. E. Ciddor, Appl. Opt. 35, 1566 (1996); dry, 450 ppm CO2",
        dispersion: Dispersion::CiddorAir,
    },
    KnownGas {
        name: "H2O",
        aliases: &["water", "water vapour", "water vapor", "steam"],
        molar_mass_g: 18.015,
        range_um: [0.3, 1.69],
        source: "P. E. Ciddor, Appl. Opt. 35, 1566 (1996); vapour",
        dispersion: Dispersion::CiddorVapour,
    },
    KnownGas {
        name: "N2",
        aliases: &["nitrogen"],
        molar_mass_g: 28.0134,
        range_um: [0.4679, 2.0587],
        source: "E. R. Peck and B. N. Khanna, J. Opt. Soc. Am. 56, 1059 (1966)",
        dispersion: Dispersion::Sellmeier {
            constant: 6.8552e-5,
            terms: &[(3.243157e-2, 144.0)],
            state: normal(-10.4),
        },
    },
    KnownGas {
        name: "O2",
        aliases: &["oxygen"],
        molar_mass_g: 31.9988,
        range_um: [0.4, 1.8],
        source: "J. Zhang, Z. H. Lu and L. J. Wang, Appl. Opt. 47, 3143 (2008)",
        dispersion: Dispersion::Sellmeier {
            constant: 1.181494e-4,
            terms: &[(9.708931e-3, 75.4)],
            state: State { kelvin: 293.15, pascal: 101_325.0, virial_cm3: -17.0 },
        },
    },
    KnownGas {
        name: "CO2",
        aliases: &["carbon dioxide"],
        molar_mass_g: 44.0095,
        range_um: [0.4801, 1.8172],
        source: "J. G. Old, K. L. Gentili and E. R. Peck, J. Opt. Soc. Am. 61, 89 (1971)",
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[(1.54489e-6, 0.0584738), (0.083091927, 210.9241), (0.0028764190, 60.122959)],
            state: normal(-151.0),
        },
    },
    KnownGas {
        name: "He",
        aliases: &["helium"],
        molar_mass_g: 4.002602,
        range_um: [0.4801, 2.0586],
        source: "C. R. Mansfield and E. R. Peck, J. Opt. Soc. Am. 59, 199 (1969)",
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[(0.01470091, 423.98)],
            state: normal(12.0),
        },
    },
    KnownGas {
        name: "H2",
        aliases: &["hydrogen"],
        molar_mass_g: 2.01588,
        range_um: [0.168, 1.6945],
        source: "E. R. Peck and S. Hung, J. Opt. Soc. Am. 67, 1550 (1977)",
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[(0.0148956, 180.7), (0.0049037, 92.0)],
            state: normal(13.6),
        },
    },
    KnownGas {
        name: "CH4",
        aliases: &["methane"],
        molar_mass_g: 16.0425,
        range_um: [0.529, 0.6585],
        source: "S. Loria, Ann. Phys. 334, 605 (1909)",
        dispersion: Dispersion::Cauchy { a: 4.2607e-4, b: 6.1396687e-6, state: normal(-53.6) },
    },
    KnownGas {
        name: "C2H4",
        aliases: &["ethylene", "ethene"],
        molar_mass_g: 28.0532,
        range_um: [0.523, 0.6677],
        source: "S. Loria, Ann. Phys. 334, 605 (1909)",
        dispersion: Dispersion::Cauchy { a: 6.303e-4, b: 9.309531e-6, state: normal(-168.0) },
    },
    KnownGas {
        name: "C7H16",
        aliases: &["heptane", "n-heptane"],
        molar_mass_g: 100.2019,
        range_um: [0.326, 0.644],
        source: "liquid at 20 C by K. Kerl and H. Varchmin, J. Mol. Struct. 349, 257 (1995), \
                 density 683.8 kg/m^3, by Lorentz-Lorenz",
        dispersion: Dispersion::Liquid { n: [1.38248838, -4.05375e-3, 4.58433e-3], density: 683.8 },
    },
    KnownGas {
        name: "Ar",
        aliases: &["argon"],
        molar_mass_g: 39.948,
        range_um: [0.4, 1.0],
        source: "A. Boerzsoenyi et al., Appl. Opt. 47, 4856 (2008)",
        // The formula of the paper is n² − 1 = Σ B λ²/(λ² − C) = Σ (B/C)/(1/C − 1/λ²). The
        // approximation n − 1 = (n² − 1)/2 has a relative error of 1e-4.
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[
                (0.5 * 20332.29e-8 / 206.12e-6, 1.0 / 206.12e-6),
                (0.5 * 34458.31e-8 / 8.066e-3, 1.0 / 8.066e-3),
            ],
            state: State { kelvin: 273.0, pascal: 100_000.0, virial_cm3: -21.5 },
        },
    },
    KnownGas {
        name: "Ne",
        aliases: &["neon"],
        molar_mass_g: 20.1797,
        range_um: [0.1404, 0.5462],
        source: "A. Bideau-Mehu et al., J. Quant. Spectrosc. Radiat. Transfer 25, 395 (1981)",
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[(0.00128145, 184.661), (0.0220486, 376.840)],
            state: normal(10.4),
        },
    },
    KnownGas {
        name: "Kr",
        aliases: &["krypton"],
        molar_mass_g: 83.798,
        range_um: [0.1404, 0.6234],
        source: "A. Bideau-Mehu et al., J. Quant. Spectrosc. Radiat. Transfer 25, 395 (1981)",
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[(0.00253637, 65.4742), (0.00273649, 73.698), (0.0620802, 181.08)],
            state: normal(-62.9),
        },
    },
    KnownGas {
        name: "Xe",
        aliases: &["xenon"],
        molar_mass_g: 131.293,
        range_um: [0.1404, 0.6234],
        source: "A. Bideau-Mehu et al., J. Quant. Spectrosc. Radiat. Transfer 25, 395 (1981)",
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[(0.00322869, 46.301), (0.00355393, 59.578), (0.0606764, 112.74)],
            state: normal(-154.0),
        },
    },
    KnownGas {
        name: "SF6",
        aliases: &["sulfur hexafluoride", "sulphur hexafluoride"],
        molar_mass_g: 146.0554,
        range_um: [0.6, 1.3],
        source: "M. Sneep and W. Ubachs, J. Quant. Spectrosc. Radiat. Transfer 92, 293 (2005), \
                 from D. Vukovic et al., J. Phys. D 29, 634 (1996)",
        dispersion: Dispersion::Cauchy {
            a: 7.1517e-4,
            b: 4.996e-6,
            state: State { kelvin: 288.15, pascal: 101_325.0, virial_cm3: -300.0 },
        },
    },
    KnownGas {
        name: "NH3",
        aliases: &["ammonia"],
        molar_mass_g: 17.03052,
        range_um: [0.48, 0.6708],
        source: "C. and M. Cuthbertson, Phil. Trans. R. Soc. A 213, 1 (1914)",
        dispersion: Dispersion::Sellmeier {
            constant: 0.0,
            terms: &[(0.032953, 90.392)],
            state: normal(-345.6),
        },
    },
];

impl KnownGas {
    /// Gladstone-Dale constant in m³/kg (1000 times smaller than in cm³/g). NaN below 185 nm and at
    /// the poles of a formula.
    pub fn k_m3_per_kg(&self, wavelength_um: f64) -> f64 {
        if wavelength_um.is_nan() || wavelength_um < 0.185 {
            return f64::NAN;
        }
        let s = wavelength_um.powi(-2);
        let per_density = |n_minus_1: f64, state: State| {
            n_minus_1 / state.density_kg_m3(self.molar_mass_g * 1e-3)
        };
        match self.dispersion {
            Dispersion::Sellmeier { constant, terms, state } => {
                per_density(constant + terms.iter().map(|(b, a)| b / (a - s)).sum::<f64>(), state)
            }
            Dispersion::Cauchy { a, b, state } => per_density(a + b * s, state),
            Dispersion::Liquid { n: [a, b, c], density } => {
                // Lorentz-Lorenz: (n² − 1)/(n² + 2) = r ρ. For a thin gas, n − 1 = 3/2 r ρ.
                let n2 = (a + b / wavelength_um + c * s).powi(2);
                1.5 * (n2 - 1.0) / (n2 + 2.0) / density
            }
            Dispersion::CiddorAir | Dispersion::CiddorVapour => match Ciddor::new(wavelength_um) {
                Ok(ciddor) => {
                    let [air, vapour] = ciddor.gladstone_dale_m3_per_kg();
                    if self.dispersion == Dispersion::CiddorAir { air } else { vapour }
                }
                Err(_) => f64::NAN,
            },
        }
    }
}

impl State {
    fn density_kg_m3(&self, molar_mass_kg: f64) -> f64 {
        let rt = R_CODATA_2018 * self.kelvin;
        let z = 1.0 + self.virial_cm3 * 1e-6 * self.pascal / rt;
        self.pascal * molar_mass_kg / (rt * z)
    }
}

impl Gas {
    /// Dry air.
    pub const AIR: Gas = Gas::Known(0);
    /// Water vapour.
    pub const WATER: Gas = Gas::Known(1);

    /// Gladstone-Dale constant in m³/kg at a vacuum wavelength of at least 0.185 µm.
    pub fn k_m3_per_kg(&self, wavelength_um: f64) -> Result<f64, IndexError> {
        let k = match self {
            Gas::Known(i) => KNOWN[*i].k_m3_per_kg(wavelength_um),
            Gas::Given { k_m3_per_kg, .. } => *k_m3_per_kg,
        };
        if k.is_finite() {
            return Ok(k);
        }
        Err(IndexError::Impossible {
            quantity: "wavelength",
            value: wavelength_um * 1000.0,
            unit: "nm",
            reason: "is below the range that gases transmit (from 185 nm)",
            cure: "give the vacuum wavelength in nm",
        })
    }

    /// Molar mass in kg/mol, if known.
    pub fn molar_mass_kg(&self) -> Option<f64> {
        match self {
            Gas::Known(i) => Some(KNOWN[*i].molar_mass_g * 1e-3),
            Gas::Given { molar_mass_kg, .. } => *molar_mass_kg,
        }
    }

    /// A warning if the formula was not measured at this wavelength.
    pub fn out_of_range(&self, wavelength_um: f64) -> Option<OutOfRange> {
        let Gas::Known(i) = self else { return None };
        let gas = &KNOWN[*i];
        let [low, high] = gas.range_um;
        (!(low..=high).contains(&wavelength_um)).then_some(OutOfRange {
            formula: gas.name,
            quantity: "wavelength",
            value: wavelength_um * 1000.0,
            range: [low * 1000.0, high * 1000.0],
            unit: "nm",
            cure: "the dispersion there is an extrapolation; a constant of your own can be given \
                   as NAME=K in cm^3/g",
        })
    }
}

impl fmt::Display for Gas {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Gas::Known(i) => f.write_str(KNOWN[*i].name),
            Gas::Given { k_m3_per_kg, molar_mass_kg: None } => {
                write!(f, "{}", k_m3_per_kg * 1000.0)
            }
            Gas::Given { k_m3_per_kg, molar_mass_kg: Some(m) } => {
                write!(f, "{}@{}", k_m3_per_kg * 1000.0, m * 1000.0)
            }
        }
    }
}

impl FromStr for Gas {
    type Err = IndexError;

    /// Parses a name (`N2`, `nitrogen`; case-insensitive), a Gladstone-Dale constant in cm³/g
    /// (`0.42`), or that constant with a molar mass in g/mol (`0.42@77.9`).
    fn from_str(text: &str) -> Result<Gas, IndexError> {
        let word = text.trim();
        let lower = word.to_ascii_lowercase();
        let named = KNOWN
            .iter()
            .position(|g| g.name.eq_ignore_ascii_case(word) || g.aliases.contains(&lower.as_str()));
        if let Some(i) = named {
            return Ok(Gas::Known(i));
        }
        let (k, mass) = match word.split_once('@') {
            Some((k, mass)) => (k, Some(mass)),
            None => (word, None),
        };
        let positive = |w: &str| w.trim().parse::<f64>().ok().filter(|x| *x > 0.0 && x.is_finite());
        match (positive(k), mass.map(positive)) {
            (Some(k), None) => Ok(Gas::Given { k_m3_per_kg: k * 1e-3, molar_mass_kg: None }),
            (Some(k), Some(Some(m))) => {
                Ok(Gas::Given { k_m3_per_kg: k * 1e-3, molar_mass_kg: Some(m * 1e-3) })
            }
            _ => Err(IndexError::UnknownGas {
                name: word.into(),
                known: KNOWN.iter().map(|g| g.name).collect::<Vec<_>>().join(", "),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gases_have_names_and_numbers() {
        assert_eq!("nitrogen".parse(), Ok(Gas::Known(2)));
        assert_eq!("ch4".parse::<Gas>().unwrap().to_string(), "CH4");
        assert_eq!(Gas::AIR.to_string(), "air");
        assert_eq!(Gas::WATER.to_string(), "H2O");
        let dense: Gas = "0.5@64".parse().unwrap();
        assert_eq!((dense.k_m3_per_kg(0.5).unwrap(), dense.molar_mass_kg()), (0.5e-3, Some(0.064)));
        assert_eq!("0.42".parse::<Gas>().unwrap().molar_mass_kg(), None);
        for bad in ["", "unobtainium", "-0.2", "0.2@", "0.2@-1", "nan"] {
            let text = bad.parse::<Gas>().unwrap_err().to_string();
            assert!(text.contains("known gases: air, H2O, N2"), "{text}");
        }
    }

    #[test]
    fn vapours_of_the_notes_without_golden_rows() {
        // K in cm³/g at 633 nm: water vapour by Ciddor's equation, heptane from the liquid by
        // Lorentz-Lorenz.
        for (name, expected, allowed) in [("H2O", 0.3127, 0.0001), ("heptane", 0.517, 0.001)] {
            let k = name.parse::<Gas>().unwrap().k_m3_per_kg(0.633).unwrap() * 1000.0;
            assert!((k - expected).abs() <= allowed, "{name}: {k}");
        }
    }

    #[test]
    fn wavelengths_outside_the_measurements_are_named() {
        let sf6: Gas = "SF6".parse().unwrap();
        let text = sf6.out_of_range(0.5).unwrap().to_string();
        assert!(text.contains("SF6: wavelength 500 nm is outside 600..1300 nm"), "{text}");
        assert_eq!(sf6.out_of_range(0.633), None);
        for gas in 0..KNOWN.len() {
            for bad in [0.0, 0.1, -0.5, f64::NAN] {
                assert!(Gas::Known(gas).k_m3_per_kg(bad).is_err());
            }
        }
    }
}
