//! Converts lattices to [`rt_core::grid::Grid`], the scalar field of the renderer and of the
//! schlieren tracer.

use super::{ColorBy, DataArray, Dataset, ModelError, extent_dims};
use glam::{DMat3, DVec3, UVec3};
use rt_core::grid::Grid;

impl Dataset {
    /// The scalar field `array` (see [`ColorBy`] for components) of image data, or of a rectilinear
    /// grid whose steps are equal to single precision. Cell arrays become values at the cell
    /// centres. Axes with negative spacing are reversed.
    pub fn to_grid(&self, array: &str) -> Result<Grid, ModelError> {
        self.check()?;
        let cannot = |reason: String| ModelError::NotConvertible {
            kind: self.kind(),
            target: "a uniform grid",
            reason,
        };
        let (dims, first, mut spacing, attributes) = match self {
            Dataset::ImageData(d) => {
                let axes = DMat3::from_diagonal(DVec3::new(
                    d.direction.x_axis.x,
                    d.direction.y_axis.y,
                    d.direction.z_axis.z,
                ));
                if axes != d.direction {
                    let reason = "its axes are rotated (Direction); resample it along x, y, z, in \
                                  ParaView with Resample To Image";
                    return Err(cannot(reason.into()));
                }
                (d.dims(), d.point(0, 0, 0), axes * d.spacing, &d.attributes)
            }
            Dataset::RectilinearGrid(d) => {
                let mut spacing = DVec3::ONE;
                for (a, x) in d.coordinates.iter().enumerate() {
                    match uniform_step(x) {
                        Ok(Some(step)) => spacing[a] = step,
                        Ok(None) => {}
                        Err(i) => {
                            let axis = ["x", "y", "z"][a];
                            return Err(cannot(format!(
                                "its steps along {axis} are not equal (first at index {i}); \
                                 resample it to image data"
                            )));
                        }
                    }
                }
                let first = |a: usize| d.coordinates[a].first().copied().unwrap_or(0.0);
                (
                    extent_dims(d.extent),
                    DVec3::new(first(0), first(1), first(2)),
                    spacing,
                    &d.attributes,
                )
            }
            Dataset::MultiBlock(blocks) if blocks.len() == 1 => {
                return blocks[0].data.to_grid(array);
            }
            _ => {
                return Err(cannot(
                    "it has no uniform lattice; resample it to image data first".into(),
                ));
            }
        };
        let color = ColorBy::find(self, array)?;
        let Some(data) = color.array(attributes) else {
            unreachable!("ColorBy::find looked in these attributes")
        };
        let mut origin = first;
        let mut dims = dims;
        if !color.per_point {
            for a in 0..3 {
                if dims[a] > 1 {
                    origin[a] += 0.5 * spacing[a];
                    dims[a] -= 1;
                }
            }
        }
        let values = values_forward(data, &color, dims, &mut origin, &mut spacing);
        let points = |d: usize| {
            u32::try_from(d).map_err(|_| cannot(format!("{d} points along one axis are too many")))
        };
        let dims = UVec3::new(points(dims[0])?, points(dims[1])?, points(dims[2])?);
        Ok(Grid::new(dims, origin, spacing, values)?)
    }
}

/// The values, with axes of negative spacing reversed. Spacing 0 along an axis of one point becomes
/// 1.
fn values_forward(
    data: &DataArray,
    color: &ColorBy,
    dims: [usize; 3],
    origin: &mut DVec3,
    spacing: &mut DVec3,
) -> Vec<f32> {
    let mut flip = [false; 3];
    for a in 0..3 {
        if dims[a] == 1 && spacing[a] == 0.0 {
            spacing[a] = 1.0;
        }
        if spacing[a] < 0.0 {
            flip[a] = true;
            origin[a] += spacing[a] * (dims[a] as f64 - 1.0);
            spacing[a] = -spacing[a];
        }
    }
    if flip == [false; 3] && data.components == 1 {
        return data.values.to_f32();
    }
    let mut out = Vec::with_capacity(data.tuples());
    for k in 0..dims[2] {
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                let mut at = [i, j, k];
                for a in 0..3 {
                    if flip[a] {
                        at[a] = dims[a] - 1 - at[a];
                    }
                }
                out.push(color.value(data, at[0] + dims[0] * (at[1] + dims[1] * at[2])));
            }
        }
    }
    out
}

/// The common step of `x`, if every coordinate agrees with it to four f32 roundings of the largest
/// coordinate (most files store coordinates in this precision). Returns `None` for a single
/// coordinate, and the first deviating index as the error.
fn uniform_step(x: &[f64]) -> Result<Option<f64>, usize> {
    let (Some(first), Some(last)) = (x.first(), x.last()) else { return Ok(None) };
    if x.len() == 1 {
        return Ok(None);
    }
    let step = (last - first) / (x.len() - 1) as f64;
    let allowed = 4.0 * f64::from(f32::EPSILON) * first.abs().max(last.abs());
    let off = x.iter().enumerate().find(|(i, v)| {
        let error = (first + step * *i as f64 - **v).abs();
        !(error <= allowed && error < 0.5 * step.abs())
    });
    match off {
        Some((i, _)) => Err(i),
        None => Ok(Some(step)),
    }
}
