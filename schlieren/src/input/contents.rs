//! Describes what a flow's file holds, and guesses what it means: which arrays give the index, and
//! in which unit the coordinates are.

use super::plausible::SIDES_M;
use super::{InputError, with_data};
use datasets::model::{DataArray, Dataset};
use datasets::read::OpenOptions;
use datasets::resample::{Mesh, Plane};
use rt_core::math::median_high;
use serde::Serialize;
use std::path::Path;

/// What a flow's file holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Contents {
    /// Kind of data set, by VTK's name.
    pub kind: &'static str,
    /// Points, summed over blocks.
    pub points: u64,
    /// Cells, summed over blocks.
    pub cells: u64,
    /// Extent along the axes, in the unit of the file; of a plane that slants to them, as it is
    /// turned onto two of them. `None` when there are no cells to trace.
    pub size: Option<[f64; 3]>,
    /// Whether all cells lie in a plane.
    pub planar: bool,
    /// The arrays of points and cells.
    pub arrays: Vec<Array>,
    /// Arrays that give the index, and the unit of length.
    pub guess: Option<Guess>,
    /// What the guess is not sure of, and what keeps the file from being traced, one sentence each.
    pub notes: Vec<String>,
}

/// An array of points or cells.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Array {
    /// Its name, as options take it.
    pub name: String,
    /// Values of points, not of cells.
    pub per_point: bool,
    /// Numbers per point or cell.
    pub components: usize,
    /// Smallest, median and largest finite value; of a vector, of its length.
    pub values: Option<[f64; 3]>,
    /// What its name and its values say that it is.
    pub meaning: Option<Meaning>,
}

/// What an array can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Meaning {
    /// Density in kg/m³.
    Density,
    /// Density by that of the free stream.
    RelativeDensity,
    /// Temperature in K.
    Temperature,
    /// Temperature in °C, to which 273.15 has to be added.
    TemperatureCelsius,
    /// Pressure in Pa.
    Pressure,
    /// n − 1.
    NMinus1,
    /// Free electrons per m³.
    Electrons,
}

/// The options that make a field of the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Guess {
    /// Options of the program, each with its value; a switch has an empty one.
    pub options: Vec<(&'static str, String)>,
    /// Metres per unit of the file.
    pub length_unit_m: f64,
}

/// [Plain](plain_name) names, and what arrays of these names are.
const NAMES: &[(&[&str], Meaning)] = &[
    (&["rho", "density", "dens"], Meaning::Density),
    (&["n_1", "n_minus_1", "nminus1", "refractivity"], Meaning::NMinus1),
    (&["ne", "n_e", "electrons", "electron_density"], Meaning::Electrons),
    (&["t", "temp", "temperature"], Meaning::Temperature),
    (&["p", "pres", "press", "pressure", "ps"], Meaning::Pressure),
];

/// What solvers put before and after names: kinds of means, and units.
const BEFORE: &[&str] = &["static_", "mean_", "avg_", "average_"];
const AFTER: &[&str] =
    &["_mean", "mean", "_avg", "_average", "_pa", "_k", "_kg_m3", "_kgm3", "_si"];

/// A name in lower case, with underscores between its words, without units and kinds of means.
fn plain_name(name: &str) -> String {
    // Units in brackets, as Tecplot and Fluent write them.
    let end = name.find(['[', '(']).filter(|at| *at > 0).unwrap_or(name.len());
    let name = name[..end].trim().to_lowercase().replace(['-', ' '], "_");
    let mut plain = name.as_str();
    for before in BEFORE {
        plain = plain.strip_prefix(before).unwrap_or(plain);
    }
    for after in AFTER {
        plain = plain.strip_suffix(after).filter(|p| !p.is_empty()).unwrap_or(plain);
    }
    plain.to_owned()
}

/// Density of air at 15 °C and 1 atm, kg/m³, for densities relative to a free stream.
const AIR_KG_M3: f64 = 1.225;
/// Pressure of the standard atmosphere, where a file has none.
const ATMOSPHERE_PA: f64 = 101_325.0;

/// Describes a file. `file` has what the file does not say itself.
///
/// # Errors
/// If it cannot be read.
///
/// # Example
///
/// ```no_run
/// use schlieren::input::{Contents, Guess, contents};
///
/// let Contents { arrays, guess, .. } = contents("flow.vtu".as_ref(), &Default::default())?;
/// for array in &arrays {
///     println!("{}: {:?}, {:?}", array.name, array.values, array.meaning);
/// }
/// if let Some(Guess { options, .. }) = guess {
///     println!("schlieren render flow.vtu {options:?}");
/// }
/// # Ok::<(), schlieren::input::InputError>(())
/// ```
pub fn contents(path: &Path, file: &OpenOptions) -> Result<Contents, InputError> {
    let (mut contents, warnings) = with_data(path, file, |data| Ok(contents_of_dataset(data)))?;
    contents.notes.splice(0..0, warnings);
    Ok(contents)
}

/// Describes a data set.
///
/// # Example
///
/// ```
/// use datasets::model::{DataArray, Dataset, ImageData, Values};
/// use schlieren::input::{Array, Meaning, contents_of_dataset};
///
/// let mut gas = ImageData::new([2; 3], glam::DVec3::ZERO, glam::DVec3::splat(0.1));
/// gas.attributes.point.push(DataArray::new("Density", 1, Values::F64(vec![1.1; 8])));
/// let found: Array = contents_of_dataset(&Dataset::ImageData(gas)).arrays.remove(0);
/// assert_eq!(found.meaning, Some(Meaning::Density));
/// ```
pub fn contents_of_dataset(data: &Dataset) -> Contents {
    let (points, cells) = data.counts();
    let mut c = Contents {
        kind: data.kind(),
        points,
        cells,
        size: None,
        planar: false,
        arrays: arrays(data),
        guess: None,
        notes: Vec::new(),
    };
    let size_of = |mesh: Mesh| {
        let (low, high) = mesh.bounds();
        (high - low).to_array()
    };
    match Mesh::new(data) {
        Ok(mesh) if mesh.num_cells() > 0 => {
            if !matches!(data, Dataset::ImageData(_)) {
                c.notes.push(format!(
                    "light is traced through a lattice to which the mesh is resampled; --on-cells \
                     traces it through the {} cells themselves",
                    mesh.num_cells()
                ));
            }
            c.size = Some(size_of(mesh));
        }
        solid => match Mesh::with_plane(data, Plane::Extrude { span: 1.0 }) {
            Ok(plane) if plane.num_cells() > 0 => {
                let across = plane.axis_of_depth();
                let mut size = size_of(plane);
                across.into_iter().for_each(|axis| size[axis] = 0.0);
                (c.size, c.planar) = (Some(size), true);
            }
            _ => c.notes.push(match solid {
                Err(e) => e.to_string(),
                Ok(_) => "there are no cells that light passes".into(),
            }),
        },
    }
    c.guess = guess(&mut c, data.is_axisymmetric());
    c
}

fn arrays(data: &Dataset) -> Vec<Array> {
    let mut found: Vec<Array> = Vec::new();
    for leaf in data.leaves() {
        let Some(attributes) = leaf.attributes() else { continue };
        for (list, per_point) in [(&attributes.point, true), (&attributes.cell, false)] {
            for array in list {
                let known = |a: &&mut Array| a.name == array.name && a.per_point == per_point;
                match found.iter_mut().find(known) {
                    // Blocks have parts of one array.
                    Some(a) => {
                        if let (Some([l, _, h]), Some([low, _, high])) =
                            (&mut a.values, values(array))
                        {
                            (*l, *h) = (l.min(low), h.max(high));
                        }
                    }
                    None => found.push(Array {
                        name: array.name.clone(),
                        per_point,
                        components: array.components,
                        values: values(array),
                        meaning: None,
                    }),
                }
            }
        }
    }
    for array in &mut found {
        array.meaning = meaning(array);
    }
    found
}

/// Smallest, median (of a sample) and largest finite value.
fn values(array: &DataArray) -> Option<[f64; 3]> {
    let tuples = array.tuples();
    let value = |i: usize| {
        if array.components == 1 { array.get(i, 0) } else { array.magnitude(i) }
    };
    let finite = (0..tuples).map(value).filter(|v| v.is_finite());
    let (low, high) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let step = (tuples / 10_001).max(1);
    let mut some: Vec<f64> =
        (0..tuples).step_by(step).map(value).filter(|v| v.is_finite()).collect();
    (low <= high).then(|| [low, median_high(&mut some).unwrap_or(low), high])
}

fn meaning(array: &Array) -> Option<Meaning> {
    let [low, median, high] = array.values?;
    let name = plain_name(&array.name);
    // A vector is none of these.
    let by_name = (array.components == 1)
        .then(|| NAMES.iter().find(|(names, _)| names.contains(&name.as_str())))??
        .1;
    match by_name {
        Meaning::Density if (median - 1.0).abs() < 2e-3 => Some(Meaning::RelativeDensity),
        Meaning::Density => (low > 0.0 && high < 1e3).then_some(by_name),
        // By that of the free stream, or of the wall.
        Meaning::Temperature if low > 0.0 && high < WITHOUT_UNIT => None,
        Meaning::Temperature if median < 75.0 && low > -80.0 && high < 200.0 => {
            Some(Meaning::TemperatureCelsius)
        }
        Meaning::Temperature => (low > 0.0).then_some(by_name),
        // Gauge pressures are around zero.
        Meaning::Pressure => (low > 0.0 && median > 10.0).then_some(by_name),
        _ => Some(by_name),
    }
}

/// Temperatures in K of gases that light passes, for their median.
const GAS_K: [f64; 2] = [75.0, 20_000.0];
/// Temperatures between zero and this are those of no gas in K, and in °C of none that changes
/// much: they are parts of a temperature.
const WITHOUT_UNIT: f64 = 12.0;

/// Options for a temperature, and the pressure if there is one.
fn of_temperature(
    arrays: &[Array],
    options: &mut Vec<(&'static str, String)>,
    notes: &mut Vec<String>,
) {
    let find = |meaning| arrays.iter().find(|a| a.meaning == Some(meaning));
    if let Some(t) = find(Meaning::TemperatureCelsius) {
        options.push(("--temperature", t.name.clone()));
        options.push(("--temperature-zero", "273.15".into()));
        notes.push(format!(
            "`{}` looks like a temperature in C: the command adds 273.15 for K",
            t.name
        ));
    } else if let Some(t) = find(Meaning::Temperature)
        && t.values.is_some_and(|[_, median, _]| (GAS_K[0]..GAS_K[1]).contains(&median))
    {
        options.push(("--temperature", t.name.clone()));
    } else {
        return;
    }
    if let Some(p) = find(Meaning::Pressure) {
        options.push(("--pressure", p.name.clone()));
        return;
    }
    options.push(("--pressure", ATMOSPHERE_PA.to_string()));
    notes.push(format!(
        "no array is recognised as a pressure in Pa: the command takes {ATMOSPHERE_PA} everywhere; \
         --pressure NAME takes an array, with --pressure-unit and --pressure-zero where it is in \
         another unit or relative to the atmosphere"
    ));
}

/// Options for the arrays that were recognised.
fn guess(c: &mut Contents, axisymmetric: bool) -> Option<Guess> {
    let size = c.size?;
    let find = |meaning| c.arrays.iter().find(|a| a.meaning == Some(meaning));
    let name = |a: &Array| a.name.clone();
    let mut options = Vec::new();
    let mut notes = Vec::new();
    if let Some(a) = find(Meaning::NMinus1) {
        options.push(("--n-minus-1", name(a)));
    } else if let Some(a) = find(Meaning::Density) {
        options.push(("--density", name(a)));
    } else if let (Some(t), Some(p)) = (find(Meaning::Temperature), find(Meaning::Pressure)) {
        options.extend([("--temperature", name(t)), ("--pressure", name(p))]);
    } else if let Some(a) = find(Meaning::RelativeDensity) {
        options.extend([("--density", name(a)), ("--density-unit", AIR_KG_M3.to_string())]);
        notes.push(format!(
            "`{}` is 1 in the middle of its values, so it is probably relative to the free stream; \
             the command takes air at 15 C for that: give its density as --density-unit",
            a.name
        ));
    } else if let Some(a) = find(Meaning::Electrons) {
        options.push(("--electrons", name(a)));
    } else {
        of_temperature(&c.arrays, &mut options, &mut notes);
    }
    if options.is_empty() {
        notes.push(
            "no array is recognised as a density, a temperature with a pressure, n - 1 or \
             electrons: say which is, with --density NAME or as `schlieren render --help` lists"
                .into(),
        );
        c.notes.extend(notes);
        return None;
    }
    let longest = size.into_iter().fold(0.0, f64::max);
    let mut length_unit_m = 1.0;
    if longest > SIDES_M[1] {
        length_unit_m = 1e-3;
        options.push(("--length-unit", "0.001".into()));
        notes.push(format!(
            "the flow is {longest:.3} long; a test section in metres is not, so the command takes \
             millimetres: check --length-unit"
        ));
    }
    if c.planar && axisymmetric {
        options.push(("--revolve", String::new()));
    } else if c.planar {
        // A round number near half of the longer side.
        let half = 0.5 * longest;
        let unit = 10f64.powf(half.log10().floor());
        options.push(("--span", format!("{}", (half / unit).round() * unit)));
        notes.push(
            "the data are two-dimensional: the command extrudes them; give their depth as --span, \
             or --revolve when they are half of an axisymmetric flow"
                .into(),
        );
    }
    c.notes.extend(notes);
    Some(Guess { options, length_unit_m })
}

#[cfg(test)]
mod tests {
    use super::*;
    use datasets::model::{Attributes, ImageData, Points, StructuredGrid, Values};
    use glam::DVec3;

    fn image(dims: [u32; 3], spacing: f64, arrays: &[(&str, [f64; 3])]) -> Contents {
        let mut image = ImageData::new(dims, DVec3::ZERO, DVec3::splat(spacing));
        let count = dims.iter().product::<u32>() as usize;
        for (name, [low, middle, high]) in arrays {
            let mut values = vec![*middle; count];
            (values[0], values[count - 1]) = (*low, *high);
            image.attributes.point.push(DataArray::new(*name, 1, Values::F64(values)));
        }
        contents_of_dataset(&Dataset::ImageData(image))
    }

    fn options(c: &Contents) -> Vec<(&'static str, String)> {
        c.guess.as_ref().map(|g| g.options.clone()).unwrap_or_default()
    }

    #[test]
    fn arrays_are_recognised_by_name_and_values() {
        let c = image([5; 3], 0.01, &[("Rho", [0.3, 1.1, 2.0]), ("T", [200.0, 300.0, 900.0])]);
        assert_eq!(options(&c), [("--density", "Rho".into())]);
        assert!(c.notes.is_empty() && c.size == Some([0.04; 3]), "{c:?}");
        let state = [("T", [200.0, 300.0, 900.0]), ("p", [9e4, 1e5, 2e5])];
        let c = image([5; 3], 0.01, &state);
        assert_eq!(options(&c), [("--temperature", "T".into()), ("--pressure", "p".into())]);
    }

    #[test]
    fn a_plane_of_any_direction_has_two_sides() {
        // 0.4 wide and 0.2 high: upright, and turned by 30 degrees about the upright axis.
        for angle in [0.0, std::f64::consts::FRAC_PI_6] {
            let at = |i: usize| {
                let x = 0.1 * (i % 5) as f64;
                [x * angle.cos(), x * angle.sin(), 0.1 * (i / 5) as f64]
            };
            let points = Points::F64((0..15).map(at).collect());
            let attributes = Attributes::default();
            let slice = StructuredGrid { extent: [0, 4, 0, 2, 0, 0], points, attributes };
            let c = contents_of_dataset(&Dataset::StructuredGrid(slice));
            let size = c.size.unwrap();
            let expected = [0.4, 0.0, 0.2];
            assert!(c.planar && (0..3).all(|a| (size[a] - expected[a]).abs() < 1e-12), "{c:?}");
        }
    }

    #[test]
    fn names_of_solvers_are_plain_without_units_and_means() {
        for (name, plain) in [
            ("T_K", "t"),
            ("p_Pa", "p"),
            ("rhoMean", "rho"),
            ("Density [kg/m^3]", "density"),
            ("static-pressure", "pressure"),
            ("mean", "mean"),
            ("n-1", "n_1"),
            ("(a)", "(a)"),
        ] {
            assert_eq!(plain_name(name), plain, "{name}");
        }
    }

    #[test]
    fn celsius_gauge_pressure_and_relative_density_are_not_taken_as_they_are() {
        let c = image([5; 3], 0.01, &[("T", [-5.0, 20.0, 60.0]), ("p", [-3.0, 0.0, 5.0])]);
        let expected = [
            ("--temperature", "T".to_owned()),
            ("--temperature-zero", "273.15".into()),
            ("--pressure", "101325".into()),
        ];
        assert_eq!(options(&c), expected);
        assert!(c.notes[0].contains("`T` looks like a temperature in C"), "{:?}", c.notes);
        assert!(c.notes[1].contains("no array is recognised as a pressure"), "{:?}", c.notes);
        let c = image([5; 3], 0.01, &[("rho", [0.4, 1.0, 3.0])]);
        assert_eq!(options(&c)[1], ("--density-unit", "1.225".into()));
    }

    #[test]
    fn a_temperature_alone_is_at_one_atmosphere_and_one_without_a_unit_is_none() {
        let c =
            image([5; 3], 0.01, &[("Temp", [293.0, 400.0, 913.0]), ("Pres", [0.0, 0.02, 0.03])]);
        let expected = [("--temperature", "Temp".to_owned()), ("--pressure", "101325".into())];
        assert_eq!(options(&c), expected);
        let c = image([5; 3], 0.01, &[("T", [0.8, 1.0, 1.3])]);
        assert!(c.guess.is_none(), "{c:?}");
    }

    #[test]
    fn a_test_section_of_two_hundred_metres_is_in_millimetres_and_a_plane_needs_a_span() {
        let c = image([5, 5, 1], 50.0, &[("density", [0.4, 1.2, 3.0])]);
        assert!(c.planar);
        let expected = [
            ("--density", "density".to_owned()),
            ("--length-unit", "0.001".into()),
            ("--span", "100".into()),
        ];
        assert_eq!(options(&c), expected);
        assert_eq!(c.notes.len(), 2, "{:?}", c.notes);
    }
}
