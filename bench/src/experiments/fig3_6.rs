//! Figure 3.6: weak scaling of data-parallel rendering, with the same number of triangles on every
//! rank.

use super::Context;
use super::many_ranks::{Sharing, cost_columns, frames, powers, with_cost};
use crate::meshes;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use composite::render::demo::{Demo, PreparedDemo};
use composite::render::{FrameOptions, Partition, Split};
use datasets::generate::nested_wavelet::Size;
use rt_core::mesh::TriMesh;
use rt_core::render::RenderOptions;
use std::sync::Arc;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    cost_columns(record);
    record.column("triangles", "", "triangles of the whole scene");
    record.column("per_rank", "", "triangles per rank");
    let (largest, size, count) =
        if context.quick { (Size::M1, 384, 1) } else { (Size::M8, 1024, 3) };
    record.notes.push(format!(
        "Wavelet surfaces, {size} x {size} pixels, headlight, triangles per rank as constant as \
         the named sizes allow. Every rank traces camera rays \
         where its part is; that the image is that of one node is for composite's tests, and not \
         looked at here. The dissertation plots average and maximum render time: what \
         lies between them is waiting."
    ));
    for ranks in powers(1, 128) {
        context.report_step(format!("{ranks} ranks"))?;
        let mesh = mesh(context, largest, ranks)?;
        let demo = Demo { size_px: [size; 2], global_light: false, ..Demo::default() };
        let triangles = mesh.num_triangles();
        let (scene, camera) = demo.scene_of(mesh)?;
        let partition = Partition::new(&scene, ranks, &Split::Triangles);
        let prepared =
            PreparedDemo { scene, camera, options: RenderOptions::new(size, size), partition };
        let measured =
            frames(&prepared, ranks, count, Sharing::SortLast, &FrameOptions::default())?;
        record.rows.push(
            with_cost(Row::new(), ranks, &measured)
                .with("triangles", triangles)
                .with("per_rank", triangles / ranks),
        );
    }
    let mut plot = Plot::lines("Weak scaling", Axis::log("ranks", ""), Axis::log("time", "ms"));
    for (column, name) in
        [("render_mean", "render, average"), ("render_max", "render, maximum"), ("frame", "frame")]
    {
        let points = record.rows.iter().filter_map(|r| r.number("ranks").zip(r.number(column)));
        plot.series.push(Series::new(name, points.collect()));
    }
    record.plots.push(plot);
    Ok(())
}

/// Wavelet surfaces with about `largest` / 128 triangles for each of `ranks`.
fn mesh(context: &mut Context<'_>, largest: Size, ranks: usize) -> anyhow::Result<Arc<TriMesh>> {
    let wanted = largest.triangles() / 128 * ranks;
    let named = Size::ALL.into_iter().find(|s| {
        let ratio = s.triangles() as f64 / wanted as f64;
        (0.8..1.25).contains(&ratio)
    });
    match named {
        Some(size) => context.wavelet(size),
        // The triangles of a surface grow with the square of the points per axis.
        None => {
            let points = (201.0 * (wanted as f64 / Size::M1.triangles() as f64).sqrt()).round();
            meshes::coarse_wavelet(points.max(9.0) as u32)
        }
    }
}
