//! `bench store` of image data as a volume.

use super::StoreArgs;
use crate::image::subject::marked_or_first_array;
use crate::stored_data::store_mixing_layer;
use anyhow::Context as _;
use datasets::cli::{Cancel, CommonArgs, CureExt as _, UsageError};
use datasets::read::volume_planes::VolumePlanes;
use datasets::stored_volume;
use rt_core::stored_volume::{StoredVolumeReport, ValueType, VolumeLayout};
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// Whether the file to write is a volume.
pub(super) fn is_meant(out: &Path) -> bool {
    out.extension().is_some_and(|e| e.eq_ignore_ascii_case("rtvolume"))
}

pub(super) fn store(common: CommonArgs, args: &StoreArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let start = Instant::now();
    let of_meshes = [
        ("--wavelet", args.wavelet.is_some()),
        ("--isovalue", args.isovalue.is_some()),
        ("--color-by", args.color_by.is_some()),
        ("--normal-tolerance", args.normal_tolerance > 0.0),
        ("--no-attributes", args.no_attributes),
        ("--memory", args.memory.is_some()),
    ];
    let shown = args.out.display();
    if let Some((option, _)) = of_meshes.iter().find(|(_, given)| *given) {
        return Err(UsageError(format!(
            "{option} belongs to meshes, and {shown} is a volume: leave it out, or write to \
             FILE.rtmesh"
        ))
        .into());
    }
    let (layout, report) = match (&args.file, args.mixing_layer) {
        (None, Some(points)) => mixing_layer(common, args, points, &cancel)?,
        (Some(file), _) => match VolumePlanes::open(file)? {
            Some(planes) => by_planes(common, args, file, planes, &cancel)?,
            None => as_a_whole(common, args, file, &cancel)?,
        },
        (None, None) => {
            return Err(UsageError("give a file, or --mixing-layer POINTS".into()).into());
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    if report.non_finite > 0 {
        common.warn(format_args!(
            "{shown}: {} of {} values are not finite: surfaces end at the cells around them",
            report.non_finite, report.points
        ));
    }
    let object = json!({
        "output": args.out,
        "dims": layout.dims.to_array(),
        "points": report.points,
        "non_finite": report.non_finite,
        "bricks": report.bricks,
        "bricks_constant": report.bricks_constant,
        "bytes": report.bytes,
        "seconds": seconds,
    });
    common.result(&object, || {
        let [x, y, z] = layout.dims.to_array();
        format!(
            "{shown}: {x} x {y} x {z} points in {} bricks, {:.2} bytes a point, {seconds:.1} s; \
             draw it with `bench render {shown} --isovalue VALUE -o IMAGE.png`",
            report.bricks,
            report.bytes as f64 / report.points as f64
        )
    })
}

/// A volume that is read plane by plane.
fn by_planes(
    common: CommonArgs,
    args: &StoreArgs,
    file: &Path,
    planes: VolumePlanes,
    cancel: &Cancel,
) -> anyhow::Result<(VolumeLayout, StoredVolumeReport)> {
    planes.must_be_named(args.array.as_deref())?;
    for warning in planes.warnings() {
        common.warn(format_args!("{}: {warning}", file.display()));
    }
    let layout = planes.layout();
    let mut writer = stored_volume::create(&args.out, layout)?;
    let bar = common.progress(u64::from(layout.dims.z), "storing");
    for plane in planes {
        cancel.check()?;
        writer.add_plane(&plane?)?;
        bar.inc(1);
    }
    Ok((layout, stored_volume::finish(writer)?))
}

/// Image data of any format, in memory.
fn as_a_whole(
    common: CommonArgs,
    args: &StoreArgs,
    file: &Path,
    cancel: &Cancel,
) -> anyhow::Result<(VolumeLayout, StoredVolumeReport)> {
    let opened = datasets::read::open(file)?;
    for warning in &opened.warnings {
        common.warn(format_args!("{}: {warning}", file.display()));
    }
    let cannot = || format!("{}: cannot be stored as a volume", file.display());
    let data = opened.dataset().with_context(cannot)?;
    let array = args.array.clone().or_else(|| marked_or_first_array(data));
    let array = array.with_context(|| format!("{}: it has no array", cannot()))?;
    let grid = data.to_grid(&array).with_context(cannot);
    let grid = grid.cure("store a mesh instead, in FILE.rtmesh, or resample it to image data")?;
    let (dims, origin, spacing) = (grid.dims(), grid.origin(), grid.spacing());
    let layout = VolumeLayout { dims, origin, spacing, values: ValueType::F32 };
    let mut writer = stored_volume::create(&args.out, layout)?;
    for plane in grid.values().chunks(dims.x as usize * dims.y as usize) {
        cancel.check()?;
        let bytes: Vec<u8> = plane.iter().flat_map(|v| v.to_le_bytes()).collect();
        writer.add_plane(&bytes)?;
    }
    Ok((layout, stored_volume::finish(writer)?))
}

/// See [`store_mixing_layer`].
fn mixing_layer(
    common: CommonArgs,
    args: &StoreArgs,
    points: u32,
    cancel: &Cancel,
) -> anyhow::Result<(VolumeLayout, StoredVolumeReport)> {
    if args.array.is_some() {
        return Err(UsageError("--array belongs to a file; leave it out".into()).into());
    }
    let bar = common.progress(u64::from(points), "storing");
    store_mixing_layer(&args.out, points, &mut |done, all| {
        bar.set_length(u64::from(all));
        bar.set_position(u64::from(done));
        Ok(cancel.check()?)
    })
}
