//! `bench store` of an isosurface of image data as a mesh, piece by piece.

use super::StoreArgs;
use super::store_job::StoreJob;
use crate::image::subject::{isovalue_in, marked_or_first_array};
use anyhow::Context as _;
use datasets::cli::UsageError;
use datasets::isosurface::{Options, extract_pieces};
use datasets::model::Dataset;
use datasets::read::volume_planes::VolumePlanes;
use datasets::read::{Content, LoadedFile};
use rt_core::grid::Grid;
use rt_core::volume::GridExtent;
use std::path::Path;

/// Planes of the field in memory.
const PLANES: usize = 36;

/// Refuses options that an isosurface has no use for.
fn check(args: &StoreArgs, file: &Path) -> Result<(), UsageError> {
    if args.color_by.is_some() {
        return Err(UsageError(format!(
            "--color-by has no effect on an isosurface of {}: it has one value; leave it out, and \
             choose the array of the surface by --array",
            file.display()
        )));
    }
    Ok(())
}

/// Adds the surface of a volume that is read plane by plane; twice where its range is needed for
/// the isovalue.
pub(super) fn of_planes(
    job: &mut StoreJob<'_>,
    args: &StoreArgs,
    file: &Path,
    mut planes: VolumePlanes,
) -> anyhow::Result<()> {
    check(args, file)?;
    planes.must_be_named(args.array.as_deref())?;
    for warning in planes.warnings() {
        job.warn_once(warning.clone());
    }
    let isovalue = match args.isovalue {
        Some(value) => value,
        None => {
            let mut range = None;
            while let Some(plane) = planes.next_numbers() {
                job.cancel().check()?;
                include(&mut range, &plane?);
            }
            let again = VolumePlanes::open(file)?;
            planes = again.with_context(|| format!("{}: it has changed", file.display()))?;
            isovalue_in(range, None).with_context(|| file.display().to_string())?
        }
    };
    let layout = planes.layout();
    let (dims, origin, spacing) = (layout.dims, layout.origin, layout.spacing);
    let plane = dims.x as usize * dims.y as usize;
    let bar = job.progress(u64::from(dims.z));
    let cancel = job.cancel();
    let mut range = None;
    let fill = |planes_read: std::ops::Range<u32>, values: &mut [f32]| {
        for to in values.chunks_mut(plane) {
            cancel.check()?;
            let next = planes.next_numbers().context("a plane is missing")??;
            include(&mut range, &next);
            to.copy_from_slice(&next);
        }
        bar.set_position(u64::from(planes_read.end));
        anyhow::Ok(())
    };
    surface(job, &GridExtent { dims, origin, spacing }, isovalue, fill)?;
    // Known only now; an isovalue outside of the range has no surface.
    isovalue_in(range, Some(isovalue)).with_context(|| file.display().to_string())?;
    Ok(())
}

/// Adds the finite values to a range.
fn include(range: &mut Option<(f32, f32)>, values: &[f32]) {
    for &v in values.iter().filter(|v| v.is_finite()) {
        let (lo, hi) = range.unwrap_or((v, v));
        *range = Some((lo.min(v), hi.max(v)));
    }
}

/// The field of image data in memory; `None` where there is none, or only its boundary can be
/// drawn.
pub(super) fn field_of(args: &StoreArgs, opened: &LoadedFile) -> anyhow::Result<Option<Grid>> {
    let Content::Data(data) = &opened.content else { return Ok(None) };
    let leaf = match data.leaves()[..] {
        [leaf @ (Dataset::ImageData(_) | Dataset::RectilinearGrid(_))] => leaf,
        _ => return Ok(None),
    };
    let array = args.array.clone().or_else(|| marked_or_first_array(leaf));
    let Some(array) = array else { return Ok(None) };
    match leaf.to_grid(&array) {
        Ok(grid) if grid.dims().min_element() >= 2 => Ok(Some(grid)),
        Err(e) if args.array.is_some() || args.isovalue.is_some() => Err(e.into()),
        _ => Ok(None),
    }
}

/// Adds the surface of a field in memory.
pub(super) fn of_field(
    job: &mut StoreJob<'_>,
    args: &StoreArgs,
    file: &Path,
    field: &Grid,
) -> anyhow::Result<()> {
    check(args, file)?;
    let isovalue = isovalue_in(field.range(), args.isovalue);
    let isovalue = isovalue.with_context(|| file.display().to_string())?;
    let (dims, origin, spacing) = (field.dims(), field.origin(), field.spacing());
    let plane = dims.x as usize * dims.y as usize;
    let fill = |range: std::ops::Range<u32>, values: &mut [f32]| {
        values.copy_from_slice(&field.values()[range.start as usize * plane..][..values.len()]);
        anyhow::Ok(())
    };
    surface(job, &GridExtent { dims, origin, spacing }, isovalue, fill)
}

fn surface(
    job: &mut StoreJob<'_>,
    extent: &GridExtent,
    isovalue: f32,
    fill: impl FnMut(std::ops::Range<u32>, &mut [f32]) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let options = Options { normals: job.keeps_attributes(), ..Options::default() };
    let skipped =
        extract_pieces(extent, f64::from(isovalue), options, PLANES, fill, |mesh| job.add(&mesh))?;
    if skipped > 0 {
        job.warn_once(format!(
            "{skipped} cells have a value that is not finite: the surface has holes there"
        ));
    }
    Ok(())
}
