//! An array on uniform points as a medium.

use super::surface::colors;
use super::{Group, PictureError, Totals, lattice};
use crate::blueprint::Domain;
use crate::settings::Picture;
use composite::render::{DistributedVolume, PointBrick, RankScene};
use rt_core::glam::{DAffine3, UVec3};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{GridExtent, Interpolation, VolumeOptions};

/// Opacity over a sixteenth of the radius at the highest value, for `opacity = 1`: a medium cannot
/// be opaque.
const DENSEST: f32 = 0.99;

pub(super) fn volume(
    group: &mut Group<'_>,
    domains: Result<Vec<Domain<'_, '_>>, String>,
    wanted: &Picture,
) -> Result<(RankScene, Totals), PictureError> {
    let name = wanted.array.clone().unwrap_or_default();
    let whole = lattice::agreed(group, domains, wanted.topology.as_deref(), &name)?;
    let bricks: Vec<PointBrick> = whole
        .bricks
        .iter()
        .map(|(first, lattice)| PointBrick {
            first: *first,
            dims: UVec3::from(lattice.dims.map(|n| n as u32)),
            values: lattice.values().map(|v| v as f32).collect(),
        })
        .collect();
    let values = bricks.iter().flat_map(|b| b.values.iter().map(|v| f64::from(*v)));
    let totals = group.totals(&Ok(Totals::NOTHING.with_values(values)))?;
    let mut high = whole.origin + whole.spacing * (whole.dims - UVec3::ONE).as_dvec3();
    let mut low = whole.origin;
    if whole.of_cells {
        (low, high) = (low - 0.5 * whole.spacing, high + 0.5 * whole.spacing);
    }
    let totals = totals.with_box([low, high]);
    let colors = colors(&totals, wanted);
    let [a, b] = totals.color_range(wanted.range);
    let thickness = super::camera::View::radius(&totals) / 16.0;
    let opacity = [[a, 0.0], [b, wanted.opacity.min(DENSEST)]];
    let transfer = TransferFunction::from_opacity(colors, &opacity, thickness as f32);
    let transfer = transfer.map_err(|e| PictureError::Contradiction {
        reason: format!("`{name}` has values from {a} to {b}: {e}"),
    })?;
    let nearest = VolumeOptions { interpolation: Interpolation::Nearest, ..Default::default() };
    let mut scene = RankScene::new();
    scene.volume(DistributedVolume {
        name,
        whole: GridExtent { dims: whole.dims, origin: whole.origin, spacing: whole.spacing },
        transfer,
        options: if whole.of_cells { nearest } else { VolumeOptions::default() },
        world_from_object: DAffine3::IDENTITY,
        bricks,
    });
    Ok((scene, totals))
}
