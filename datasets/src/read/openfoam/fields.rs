//! The fields of a time: one file each, values of the cells.

use super::case_folder::{CaseFolder, Part, files_in};
use super::collated::open_first;
use super::text::{FORMAT, FoamFile};
use crate::model::{DataArray, ScalarType, Values};
use crate::read::ReadError;
use crate::read::error::{At, Fault};

/// Bytes of a file that hold its header: it begins with a banner of about 900.
const HEAD_BYTES: u64 = 8192;

/// Components of the fields on cells.
fn components(class: &str) -> Option<usize> {
    // `volScalarField::Internal` has no values at the boundary.
    let class = class.strip_suffix("::Internal").unwrap_or(class);
    Some(match class {
        "volScalarField" | "volSphericalTensorField" => 1,
        "volVectorField" => 3,
        "volSymmTensorField" => 6,
        "volTensorField" => 9,
        _ => return None,
    })
}

/// All fields on the cells at the time of index `time`, joined over the parts, which have
/// `cells_of_parts` cells.
pub(super) fn fields(
    case: &CaseFolder,
    time: usize,
    cells_of_parts: &[usize],
    warnings: &mut Vec<String>,
) -> Result<Vec<DataArray>, ReadError> {
    let folder = &case.times[time].1;
    let first = case.parts[0].folder.join(folder);
    let (files, folders) = files_in(&first)?;
    if folders.iter().any(|f| f == "lagrangian") {
        warnings.push("the particles in `lagrangian` are left out".into());
    }
    let mut others: Vec<String> = Vec::new();
    let mut arrays = Vec::new();
    for name in files {
        let Ok(head) = open_first(&first.join(&name), HEAD_BYTES) else {
            others.push(format!("{name} (no file of OpenFOAM)"));
            continue;
        };
        let Some(components) = components(&head.class) else {
            others.push(format!("{name} ({})", head.class));
            continue;
        };
        let mut joined: Option<Values> = None;
        for (part, &cells) in case.parts.iter().zip(cells_of_parts) {
            let values = match field(case, part, folder, &name, components, cells, warnings) {
                Ok(values) => values,
                Err(ReadError::Unsupported { what, at, .. }) => {
                    warnings.push(format!("field `{name}` left out: {what} ({at})"));
                    joined = None;
                    break;
                }
                Err(e) => return Err(e),
            };
            match &mut joined {
                Some(all) => all.append(&values),
                None => joined = Some(values),
            }
        }
        arrays.extend(joined.map(|values| DataArray::new(name, components, values)));
    }
    if !others.is_empty() {
        warnings.push(format!("left out, not fields on cells: {}", others.join(", ")));
    }
    Ok(arrays)
}

fn field(
    case: &CaseFolder,
    part: &Part,
    folder: &str,
    name: &str,
    components: usize,
    cells: usize,
    warnings: &mut Vec<String>,
) -> Result<Values, ReadError> {
    let path = part.folder.join(folder).join(name);
    if !super::text::exists(&path) {
        let cure = "the other parts have it: run reconstructPar, or decompose the case again";
        let fault = Fault::new(At::Field(format!("field `{name}`")), "the file is missing", cure);
        return Err(fault.in_file(&path, FORMAT));
    }
    let mut file = case.open_file(part, &path)?;
    values(&mut file, name, components, cells, warnings).map_err(|e| file.fault(e))
}

fn values(
    file: &mut FoamFile,
    name: &str,
    components: usize,
    cells: usize,
    warnings: &mut Vec<String>,
) -> Result<Values, Fault> {
    // `dimensions` comes first; a field without is unusual but complete.
    if !file.find_entry(&["dimensions", "internalField", "value"])? {
        return Err(Fault::field(format!("field `{name}`"), "there is no internalField"));
    }
    if file.peek() == Some(b'[') {
        kinematic(file, name, warnings);
        file.skip_value()?;
        if !file.find_entry(&["internalField", "value"])? {
            return Err(Fault::field(format!("field `{name}`"), "there is no internalField"));
        }
    }
    let how = file.word().unwrap_or_default();
    match how.as_str() {
        "uniform" => {
            if file.peek() == Some(b'$') || file.peek() == Some(b'#') {
                return Err(expression(file));
            }
            let value = file.tuple(components)?;
            let mut all = Vec::with_capacity(cells * components);
            (0..cells).for_each(|_| all.extend_from_slice(&value));
            Ok(Values::F64(all))
        }
        "nonuniform" => {
            // The type of the list, which the class of the field tells already.
            if file.peek().is_some_and(|b| b.is_ascii_alphabetic()) {
                file.word();
            }
            let values = file.tuples(components, Some(cells))?;
            // A part without cells has no values of either width.
            Ok(if cells == 0 { Values::empty(ScalarType::F64) } else { values })
        }
        _ if how.starts_with(['$', '#']) => Err(expression(file)),
        _ => Err(file.unexpected("`uniform` or `nonuniform`")),
    }
}

fn expression(file: &FoamFile) -> Fault {
    let cure = "run the solver, which writes numbers, and read a later time";
    Fault::unsupported(file.at(), "the value is a macro or an expression", cure)
}

/// Warns of pressures divided by density, which solvers of incompressible flows write.
fn kinematic(file: &mut FoamFile, name: &str, warnings: &mut Vec<String>) {
    let mut exponents = Vec::new();
    let _ = file.word();
    while let Some(word) = file.word().filter(|w| w != "]") {
        match word.parse::<f64>() {
            Ok(e) if exponents.len() < 7 => exponents.push(e),
            _ => return,
        }
    }
    let warning = format!(
        "`{name}` is a pressure divided by the density (m2/s2), as solvers of incompressible flows \
         write it: not in Pa"
    );
    if name.starts_with('p')
        && exponents.starts_with(&[0.0, 2.0, -2.0])
        && !warnings.contains(&warning)
    {
        warnings.push(warning);
    }
}
