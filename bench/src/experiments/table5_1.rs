//! Table 5.1: memory by data set: the dissertation's numbers, computed from its layout, and the
//! memory of this program.

use super::Context;
use super::test_section::check_cancelled;
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use datasets::catalogue::flows;
use glam::DVec3;
use schlieren::field::Field;
use schlieren::film::{Film, Framing};
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, Deviational, LineOfSight, Options};
use schlieren::path::PathQuantities;
use schlieren::view::{Axis as ViewAxis, View};

/// Data sets of the table, with its megabytes.
const TABLE: [(&str, f64); 5] = [
    ("combustion-jet", 589.62),
    ("heptane-fire", 429.71),
    ("helium-plume", 354.05),
    ("coal-fire", 181.45),
    ("blunt-body", 287.31),
];

/// Width and height of the table's image, in pixels.
const FILM: usize = 512;

/// Bytes of the layout that gives the table's numbers: a texture of gradient and index (16 B) and
/// an octree level (1 B) per voxel, and two numbers of 4 B per pixel. The text mentions random
/// numbers of three times the image's size, which the table does not include.
fn legacy_bytes(dims: [usize; 3]) -> usize {
    17 * dims.iter().product::<usize>() + 2 * 4 * FILM * FILM
}

const MEGA: f64 = 1e6;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("data", "", "data set of table 5.1");
    record.column("dims", "", "nodes");
    record.column("march", "", "what takes light through the field");
    record.column("thesis", "MB", "as printed in table 5.1");
    record.column("legacy", "MB", "by the layout 17 B/voxel + 2 * 4 B/pixel at 512²");
    record.column("legacy_off", "MB", "difference of the two");
    record.column("field", "MB", "eps at the nodes");
    record.column("interpolant", "MB", "coefficients, or the projection");
    record.column("bricks", "MB", "bounds that let even gas be skipped, where they are built");
    record.column("bricks_build", "ms", "time of building those");
    record.column("film", "MB", "energy and counts of 512² pixels");
    record.column("ours", "MB", "sum of the four");
    record.column(
        "resident",
        "MB",
        "growth of the process's resident memory by field and march, as the kernel counts it",
    );
    record.column("build", "s", "wall time of preparing the march, field in memory");
    record.column("per_voxel", "B", "our bytes without the film by voxels");
    record.notes.push(
        "By the `legacy` layout the dissertation's octree is the seventeenth byte of a voxel. Ours \
         keeps eps alone (4 B) and takes gradients from spline coefficients (4 B more); line of \
         sight keeps one projected plane. Fields here have the table's sizes and smooth contents: \
         memory does not \
         depend on what they hold. MB are 10^6 bytes."
            .into(),
    );
    let mut plot = Plot::bars(
        "Memory by data set",
        Axis::linear("memory", "MB"),
        TABLE.map(|t| t.0.to_string()).to_vec(),
    );
    plot.series.push(Series::new("dissertation, table 5.1", bars(&TABLE.map(|t| t.1))));
    let marches = [
        ("line of sight", None, 0.0),
        ("b-spline", Some(Interpolant::BSpline), 0.0),
        ("b-spline with skipping", Some(Interpolant::BSpline), 1e-7),
        ("trilinear", Some(Interpolant::Trilinear), 0.0),
        ("trilinear gradients", Some(Interpolant::TrilinearGradient), 0.0),
    ];
    let marches = if context.quick { &marches[..3] } else { &marches[..] };
    let mut series: Vec<Series> = marches.iter().map(|m| Series::new(m.0, vec![])).collect();
    for (n, (name, thesis_mb)) in TABLE.into_iter().enumerate() {
        let dims = flows::find(name)?.dims("thesis")?.to_array().map(|d| d as usize);
        let legacy_mb = legacy_bytes(dims) as f64 / MEGA;
        let longest = dims.into_iter().max().unwrap_or(2);
        let h = 1.0 / (longest - 1) as f64;
        for (march, &(label, interpolant, skip_rad)) in marches.iter().enumerate() {
            check_cancelled(context)?;
            context.report_share(
                format!("{name}, {label}"),
                (n as f64 + march as f64 / marches.len() as f64) / 5.0,
            )?;
            let before = resident_bytes();
            let field = Field::from_fn(dims, [h; 3], DVec3::ZERO, 1.000_27, |p| {
                1e-5 * p.x * (p.y + 0.5 * p.z)
            })?;
            let view = View::along(ViewAxis::Z, field.centre_m());
            let start = std::time::Instant::now();
            let row = Row::new().with("data", name).with("march", label);
            let dims_text = dims.map(|d| d.to_string()).join("x");
            let row =
                row.with("dims", dims_text).with("thesis", thesis_mb).with("legacy", legacy_mb);
            let row = row.with("legacy_off", (legacy_mb - thesis_mb).abs());
            let film = film_bytes();
            let (march_bytes, bricks, row, build_secs, after) = match interpolant {
                None => {
                    let quantities = PathQuantities::default();
                    let los = LineOfSight::new(
                        &field,
                        view,
                        Interpolant::BSpline,
                        quantities,
                        BlankCells::Opaque,
                    );
                    (los.memory_bytes(), 0, row, start.elapsed().as_secs_f64(), resident_bytes())
                }
                Some(interpolant) => {
                    let d = Deviational::new(
                        &field,
                        view,
                        interpolant,
                        Options { skip_rad, ..Options::default() },
                    );
                    let build = start.elapsed().as_secs_f64();
                    let bricks = d.bricks().map_or(0, schlieren::skip::Bricks::memory_bytes);
                    let row = row.with(
                        "bricks_build",
                        d.bricks().map(|b| b.build_time().as_secs_f64() * 1e3),
                    );
                    (d.memory_bytes() - bricks, bricks, row, build, resident_bytes())
                }
            };
            let ours = field.memory_bytes() + march_bytes + bricks;
            series[march].points.push(Point {
                x: n as f64,
                y: (ours + film) as f64 / MEGA,
                range: None,
            });
            let grown = before.zip(after).map(|(b, a)| (a as f64 - b as f64) / MEGA);
            record.rows.push(
                row.with("field", field.memory_bytes() as f64 / MEGA)
                    .with("interpolant", march_bytes as f64 / MEGA)
                    .with("bricks", bricks as f64 / MEGA)
                    .with("film", film as f64 / MEGA)
                    .with("ours", (ours + film) as f64 / MEGA)
                    .with("resident", grown)
                    .with("build", build_secs)
                    .with("per_voxel", ours as f64 / dims.iter().product::<usize>() as f64),
            );
        }
    }
    let off = record.rows.iter().filter_map(|r| r.number("legacy_off")).fold(0.0, f64::max);
    record.notes.push(format!(
        "17 bytes a voxel and 8 a pixel are at most {off:.4} MB off the dissertation's five \
         numbers, which are printed to 0.01 MB."
    ));
    if resident_bytes().is_none() {
        record.missing.push("resident memory: this system has no /proc/self/status".into());
    }
    plot.series.extend(series);
    record.plots.push(plot);
    Ok(())
}

fn bars(values: &[f64]) -> Vec<(f64, f64)> {
    values.iter().enumerate().map(|(i, v)| (i as f64, *v)).collect()
}

/// Memory of a film of one channel with counts.
fn film_bytes() -> usize {
    let framing = Framing::fitted(FILM as u32, FILM as u32, [1.0; 2]);
    let film = Film::<1>::new(framing, true);
    let counts = film.counts().map_or(0, |c| c.len() * size_of::<u32>());
    framing.pixels() * size_of::<u64>() + counts
}

/// Resident memory of this process, where Linux reports it.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().trim_end_matches(" kB").trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legacy_layout_gives_the_tables_five_numbers_to_the_last_digit() {
        for (name, thesis_mb) in TABLE {
            let dims =
                flows::find(name).unwrap().dims("thesis").unwrap().to_array().map(|d| d as usize);
            let mb = legacy_bytes(dims) as f64 / MEGA;
            // Half of the table's last digit.
            assert!((mb - thesis_mb).abs() <= 0.005 + 1e-9, "{name}: {mb}");
        }
    }
}
