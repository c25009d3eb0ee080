//! The mixing layer's bytes, as an implicit isosurface and as a medium.

use super::frames::{Pictured, Timed, frames};
use super::{BUDGET, Context, Folder, Opened, Sizes, open_or_make};
use crate::record::{Record, Row};
use crate::stored_data::{mixing_layer_grid, store_mixing_layer};
use anyhow::Context as _;
use datasets::generate::mixing_layer::{self, MixingLayer};
use datasets::{colormaps, stored_volume};
use rt_core::shapes::IsosurfaceNormals;
use rt_core::stored_volume::StoredIsosurface;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions};
use std::sync::Arc;

/// Points along x of the largest layer that is drawn in memory too.
const LARGEST_IN_MEMORY: u32 = 512;

pub(super) fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    folder: &Folder,
    sizes: &Sizes,
) -> anyhow::Result<()> {
    let points = sizes.layer;
    let name = format!("mixing layer, {points} points along x, bytes");
    let Opened { data, prepare_secs, open_secs } = open_or_make(
        &folder.layer(sizes),
        folder.is_kept,
        |path| stored_volume::open(path, BUDGET),
        |path| {
            store_mixing_layer(path, points, &mut |done, all| {
                let share = 0.4 * f64::from(done) / f64::from(all);
                context.report_share(format!("storing plane {done} of {all}"), share)
            })?;
            Ok(())
        },
    )?;
    let file = Arc::new(data);
    let isovalue = (255.0 * mixing_layer::ISO) as f32;
    let normals = IsosurfaceNormals::Smooth;
    let surface = StoredIsosurface::new(file.clone(), &[isovalue], normals)?;
    let report = file.report();
    let row = Row::new()
        .with("elements", report.points)
        .with("file", report.bytes as f64 / 1e6)
        .with("bytes_per_element", report.bytes as f64 / report.points as f64)
        .with("open", open_secs * 1e3);
    let row = row.with("data", format!("{name}, isosurface of equal parts"));
    let prepared = prepare_secs.map_or(row.clone(), |secs| row.clone().with("prepare", secs));
    let views = MixingLayer::views();
    let surface = Pictured::shape(Arc::new(surface))?;
    let cameras = surface.cameras(&views, sizes)?;
    let used = || file.page_use();
    let timed = Timed { pictured: &surface, row: prepared, repeats: false, used: Some(&used) };
    frames(context, record, sizes, &[timed], &cameras)?;

    let row = row.with("data", format!("{name}, medium"));
    let medium = Arc::new(medium_of(|transfer, options| {
        Ok(Volume::stored(file.clone(), BUDGET, transfer, options)?)
    })?);
    let in_file = Pictured::medium(medium.clone())?;
    let cameras = in_file.cameras(&views, sizes)?;
    let used = || medium.page_use().unwrap_or_else(|| file.page_use());
    let mut timed = vec![Timed { pictured: &in_file, row, repeats: false, used: Some(&used) }];
    let in_memory = match sizes.layer <= LARGEST_IN_MEMORY {
        true => {
            context.report_step("the same in memory")?;
            let grid = Arc::new(mixing_layer_grid(points)?);
            let medium = medium_of(|transfer, options| Ok(Volume::new(grid, transfer, options)?))?;
            Some(Pictured::medium(Arc::new(medium))?)
        }
        false => None,
    };
    if let Some(pictured) = &in_memory {
        let row = Row::new()
            .with("data", format!("{name}, medium in memory in single precision"))
            .with("elements", report.points);
        timed.push(Timed { pictured, row, repeats: false, used: None });
    }
    frames(context, record, sizes, &timed, &cameras)
}

/// A veil around the interface between the halves of the layer.
fn medium_of(
    make: impl FnOnce(TransferFunction, VolumeOptions) -> anyhow::Result<Volume>,
) -> anyhow::Result<Volume> {
    let range = [0.0, 255.0];
    let colors = colormaps::by_name("viridis", range).context("a colour map that exists")?;
    let opacity = [[100.0, 0.0], [127.5, 0.9], [155.0, 0.0]];
    make(TransferFunction::from_opacity(colors, &opacity, 0.1)?, VolumeOptions::default())
}
