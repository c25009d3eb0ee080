//! Photographs of a gas: densities are read where the simulation has them.

use super::{Group, PictureError, lattice};
use crate::blueprint::{Domain, Lattice};
use crate::node::Scalar;
use crate::settings::{Between, Photograph, Technique};
use composite::render::light::{
    Gas, GasBrick, GasValues, LightOptions, LightTechnique, Shot, Strided, photograph as exposed,
};
use rt_core::glam::{DVec3, UVec3};
use schlieren::interpolate::Interpolant;

/// Values of any type, with gaps, or the length of a vector.
struct Any<'l, 'a>(&'l Lattice<'a>);

impl GasValues for Any<'_, '_> {
    #[inline]
    fn density(&self, node: UVec3) -> f64 {
        self.0.value([node.x as usize, node.y as usize, node.z as usize])
    }
}

/// Densities in the unit of the simulation.
struct Densities<V> {
    values: V,
    /// kg/m³ of one unit.
    unit: f64,
}

impl<V: GasValues> GasValues for Densities<V> {
    #[inline]
    fn density(&self, node: UVec3) -> f64 {
        self.unit * self.values.density(node)
    }

    #[inline(always)]
    fn row<const N: usize>(&self, first: UVec3) -> [f64; N] {
        let mut row = self.values.row::<N>(first);
        for value in &mut row {
            *value *= self.unit;
        }
        row
    }
}

/// Values one behind the other.
fn strided<'a, T: Scalar>(lattice: &Lattice<'a>) -> Option<Strided<'a, T>> {
    let [i, j, _] = lattice.dims;
    let dims = UVec3::from(lattice.dims.map(|n| n as u32));
    Strided::new(lattice.as_slice()?, dims, [1, i, i * j])
}

/// The picture on rank 0, row by row from the top, and warnings.
pub(super) fn photograph(
    group: &mut Group<'_>,
    domains: Result<Vec<Domain<'_, '_>>, String>,
    wanted: &Photograph,
) -> Result<(Option<Vec<f32>>, Vec<String>), PictureError> {
    let whole = lattice::agreed(group, domains, wanted.topology.as_deref(), &wanted.array)?;
    let one = match &whole.bricks[..] {
        [] => Ok(None),
        [one] => Ok(Some(one)),
        more => Err(format!("it has {} domains; a photograph takes one of each rank", more.len())),
    };
    group.agree(&one.as_ref().map(|_| Vec::new()).map_err(String::clone))?;
    let one = one.ok().flatten();
    let gas = Gas {
        dims: whole.dims,
        origin_m: wanted.length_unit * whole.origin,
        spacing_m: wanted.length_unit * whole.spacing,
        gladstone_dale_m3_per_kg: wanted.gladstone_dale,
        reference_density: wanted.reference_density,
    };
    let shot = Shot {
        direction: DVec3::from(wanted.direction),
        up: DVec3::from(wanted.up),
        width: wanted.size[0],
        height: wanted.size[1],
        pixel_m: 0.0,
        technique: match wanted.technique {
            Technique::Schlieren => LightTechnique::Knife {
                angle_deg: wanted.knife_deg,
                slit_width_m: wanted.slit_width,
                focal_length_m: wanted.focal_length,
                open_fraction: wanted.open_fraction,
            },
            Technique::Shadowgraph => LightTechnique::Shadowgraph { focus_m: wanted.focus },
        },
        interpolant: match wanted.interpolant {
            Between::TrilinearGradient => Interpolant::TrilinearGradient,
            Between::Trilinear => Interpolant::Trilinear,
        },
        step_voxels: wanted.step_voxels,
    };
    let options = LightOptions { root: 0, timeout: group.timeout, parallel: group.threads };
    // Types that solvers have are read as such; a type that is found for each value costs a
    // multiple of the light's march.
    let made = match one {
        None => exposed::<Any<'_, '_>>(group.comm, &gas, None, &shot, &options)?,
        Some((first, lattice)) => {
            let dims = UVec3::from(lattice.dims.map(|n| n as u32));
            let unit = wanted.density_unit;
            let (first, comm) = (*first, &mut *group.comm);
            if let Some(values) = strided::<f64>(lattice) {
                let values = &Densities { values, unit };
                exposed(comm, &gas, Some(&GasBrick { first, dims, values }), &shot, &options)?
            } else if let Some(values) = strided::<f32>(lattice) {
                let values = &Densities { values, unit };
                exposed(comm, &gas, Some(&GasBrick { first, dims, values }), &shot, &options)?
            } else {
                let values = &Densities { values: Any(lattice), unit };
                exposed(comm, &gas, Some(&GasBrick { first, dims, values }), &shot, &options)?
            }
        }
    };
    let mut warnings = Vec::new();
    for (rays, what) in [
        (made.report.masked, "rays ended at a density that is no finite number"),
        (made.report.turned, "rays were turned back"),
    ] {
        if rays > 0 {
            warnings.push(format!("{rays} {what}"));
        }
    }
    Ok((made.picture, warnings))
}
