//! Photographs of a gas: densities are read where the simulation has them.

use super::{Group, PictureError, lattice};
use crate::blueprint::{Domain, Lattice};
use crate::settings::{Between, Photograph, Technique};
use composite::render::light::{
    Gas, GasBrick, GasValues, LightOptions, LightTechnique, Shot, photograph as exposed,
};
use rt_core::glam::{DVec3, UVec3};
use schlieren::interpolate::Interpolant;

/// Densities in the unit of the simulation.
struct Densities<'l, 'a> {
    lattice: &'l Lattice<'a>,
    /// kg/m³ of one unit.
    unit: f64,
}

impl GasValues for Densities<'_, '_> {
    #[inline]
    fn density(&self, node: UVec3) -> f64 {
        self.unit * self.lattice.value(node.to_array().map(|n| n as usize))
    }
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
    let densities = one
        .ok()
        .flatten()
        .map(|(first, lattice)| (*first, Densities { lattice, unit: wanted.density_unit }));
    let brick = densities.as_ref().map(|(first, values)| GasBrick {
        first: *first,
        dims: UVec3::from(values.lattice.dims.map(|n| n as u32)),
        values,
    });
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
    let made = exposed(group.comm, &gas, brick.as_ref(), &shot, &options)?;
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
