//! Loads properties of the medium (absorption, emission, rotation) from the arrays of a file.

use super::lattice::SamplePoints;
use super::medium::Column;
use super::{InputError, Medium, Options, Quantity, Source, with_data};
use crate::field::Field;
use crate::media::{Media, Property, Volume};
use datasets::model::Dataset;
use datasets::resample::Mark;
use std::path::Path;

/// Reads properties of the medium from a file. `options` are those of the field; formula, smoothing
/// and reference have no effect here. Each array has a lattice of its own, so none of them changes
/// the field. See [`media_from_dataset`].
pub fn load_media(
    path: &Path,
    options: &Options,
    quantities: &[(Property, Quantity)],
    field: &Field,
) -> Result<Media, InputError> {
    Ok(with_data(path, &options.file, |data| media_from_dataset(data, options, quantities, field))?
        .0)
}

/// Creates properties of the medium from the arrays of a data set. Constants apply to all of
/// `field`. Values outside the mesh, in hidden cells or not finite are continued from their
/// neighbours. Negative values of properties that cannot be negative become zero. Both repairs are
/// counted ([`Media::warnings`]).
pub fn media_from_dataset(
    data: &Dataset,
    options: &Options,
    quantities: &[(Property, Quantity)],
    field: &Field,
) -> Result<Media, InputError> {
    let mut media = Media::default();
    for (property, quantity) in quantities {
        let volume = match quantity.source {
            Source::Constant(value) => {
                Volume::uniform(value * quantity.scale + quantity.offset, field)?
            }
            Source::Array(_) => volume(data, options, *property, quantity)?,
        };
        media = media.with(*property, volume);
    }
    Ok(media)
}

fn volume(
    data: &Dataset,
    options: &Options,
    property: Property,
    quantity: &Quantity,
) -> Result<Volume, InputError> {
    // Treat the array as a given index: unchanged values, on the lattice that the array would get.
    let options = Options { medium: Medium::NMinus1(quantity.clone()), ..options.clone() };
    let points = SamplePoints::find(data, &options)?;
    let values = match options.medium.columns(data, &points)?.pop() {
        Some(Column::Values(values)) => values,
        _ => Vec::new(),
    };
    if !values.iter().any(|v| v.is_finite()) {
        return Err(InputError::Option {
            what: format!(
                "no value of {} is finite, so there is no {}",
                options.medium.describe(),
                property.name()
            ),
            cure: "check the array's name and its values",
        });
    }
    let on = points.to_lattice(values, &options)?;
    let unknown: Vec<bool> =
        on.marks.iter().map(|m| matches!(m, Mark::Outside | Mark::Hidden)).collect();
    let (unit, lattice) = (options.length_unit_m, on.lattice);
    let spacing_m = (lattice.spacing * unit).to_array();
    Ok(Volume::new(lattice.dims, spacing_m, lattice.origin * unit, on.values, Some(&unknown))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use datasets::model::{DataArray, ImageData, Values};
    use glam::DVec3;

    #[test]
    fn arrays_of_points_and_cells_get_lattices_of_their_own() {
        let mut image = ImageData::new([5, 5, 5], DVec3::ZERO, DVec3::splat(10.0));
        image.attributes.point.push(DataArray::new("rho", 1, Values::F64(vec![1.2; 125])));
        let mut soot: Vec<f64> = (0..64).map(|i| f64::from(i % 4)).collect();
        soot[5] = f64::NAN;
        soot[6] = -3.0;
        image.attributes.cell.push(DataArray::new("soot", 1, Values::F64(soot)));
        let data = Dataset::ImageData(image);
        let options = Options { length_unit_m: 1e-3, ..Options::new(Medium::density("rho")) };
        let field = super::super::from_dataset(&data, &options).unwrap().field;
        let media = media_from_dataset(
            &data,
            &options,
            &[
                (Property::Absorption, Quantity::array("soot")),
                (Property::Rotation, Quantity::constant(-2.0)),
            ],
            &field,
        )
        .unwrap();
        // Cell centres are at 5, 15, 25 and 35 mm.
        let soot = media.get(Property::Absorption).unwrap();
        assert_eq!(soot.dims(), [4; 3]);
        assert!((soot.sample(DVec3::new(0.025, 0.035, 0.035)) - 2.0).abs() < 1e-12);
        assert_eq!((soot.repairs().not_finite, soot.repairs().negative), (1, 1));
        assert_eq!(media.warnings().len(), 2);
        assert_eq!(media.get(Property::Rotation).unwrap().sample(DVec3::ZERO), -2.0);

        let missing = media_from_dataset(
            &data,
            &options,
            &[(Property::Emission, Quantity::array("glow"))],
            &field,
        );
        let message = missing.unwrap_err().to_string();
        assert!(message.contains("glow"), "{message}");
    }
}
