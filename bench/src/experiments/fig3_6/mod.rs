//! Figure 3.6: weak scaling of data-parallel rendering, with the same number of triangles on every
//! rank: of camera rays alone as in the dissertation, and with light from other ranks' parts.

mod stored_blocks;

use super::Context;
use super::many_ranks::{Sharing, cost_columns, frames, powers, with_cost};
use crate::meshes;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use composite::render::demo::{Demo, PreparedDemo};
use composite::render::{FrameOptions, Partition, SecondaryRayPolicy, Split};
use datasets::generate::nested_wavelet::Size;
use rt_core::mesh::TriMesh;
use rt_core::render::RenderOptions;
use std::sync::Arc;

/// What lights the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lighting {
    Headlight,
    /// A lamp with shadows, and ambient occlusion, with rays through all parts.
    Global,
    /// The same with rays through the own part alone.
    Local,
}

impl Lighting {
    const ALL: [Lighting; 3] = [Lighting::Headlight, Lighting::Global, Lighting::Local];

    /// In the column `light`.
    fn name(self) -> &'static str {
        match self {
            Lighting::Headlight => "headlight",
            Lighting::Global => "shadows and occlusion",
            Lighting::Local => "shadows of the own part alone",
        }
    }

    /// Where its rays go.
    fn secondary_rays(self) -> SecondaryRayPolicy {
        match self {
            Lighting::Headlight => SecondaryRayPolicy::default(),
            Lighting::Global => SecondaryRayPolicy::Forward,
            Lighting::Local => SecondaryRayPolicy::LocalOnly,
        }
    }
}

/// Rays of ambient occlusion for each hit.
const OCCLUSION_RAYS: u32 = 4;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    cost_columns(record);
    record.column("triangles", "", "triangles of the whole scene");
    record.column("per_rank", "", "triangles per rank");
    record.column("light", "", "what lights the surface");
    let (largest, size, count) =
        if context.quick { (Size::M1, 384, 1) } else { (Size::M8, 1024, 5) };
    let (global, local) = (Lighting::Global.name(), Lighting::Local.name());
    record.notes.push(format!(
        "{size} x {size} pixels. Every rank traces camera rays \
         where its part is; that the image is that of one node is for composite's tests, and not \
         looked at here. The dissertation plots average and maximum render time: what \
         lies between them is waiting. `{global}`: a lamp with shadows and {OCCLUSION_RAYS} rays \
         of ambient occlusion for each hit, whose rays go to the ranks whose parts they enter. \
         `{local}`: they end where the own part does, so that shadows of other parts are missing."
    ));
    if context.thesis {
        stored_blocks::run(context, record, powers(1, 128), size, 3)?;
    } else {
        parts_of_one_mesh(context, record, largest, size, count)?;
    }
    let of = |record: &Record, light: Lighting, column: &str| -> Vec<(f64, f64)> {
        let rows = record.rows.iter().filter(|r| r.text("light") == Some(light.name()));
        rows.filter_map(|r| r.number("ranks").zip(r.number(column))).collect()
    };
    let mut plot = Plot::lines("Weak scaling", Axis::log("ranks", ""), Axis::log("time", "ms"));
    for (light, column, name) in [
        (Lighting::Headlight, "render_mean", "headlight: render, average"),
        (Lighting::Headlight, "render_max", "headlight: render, maximum"),
        (Lighting::Headlight, "frame", "headlight: frame"),
        (Lighting::Global, "frame", "shadows and occlusion: frame"),
        (Lighting::Local, "frame", "shadows of the own part alone: frame"),
    ] {
        plot.series.push(Series::new(name, of(record, light, column)));
    }
    record.plots.push(plot);
    let with_all = of(record, Lighting::Global, "frame");
    if let [(_, one), .., (ranks, many)] = with_all[..] {
        record.notes.push(format!(
            "`{global}`: a frame of {ranks} ranks takes {:.2} times that of one rank.",
            many / one
        ));
    }
    let with_own = of(record, Lighting::Local, "frame");
    let ratio = with_all.iter().zip(&with_own).map(|((_, right), (_, local))| right / local);
    if let Some(worst) = ratio.max_by(f64::total_cmp) {
        record.notes.push(format!(
            "`{global}` takes at most {worst:.2} times as long as `{local}`, over all numbers of \
             ranks."
        ));
    }
    Ok(())
}

/// Parts of as many triangles of one mesh, about `largest` / 128 on each rank.
fn parts_of_one_mesh(
    context: &mut Context<'_>,
    record: &mut Record,
    largest: Size,
    size: u32,
    count: usize,
) -> anyhow::Result<()> {
    record
        .notes
        .push("Wavelet surfaces, triangles per rank as constant as the named sizes allow.".into());
    for ranks in powers(1, 128) {
        context.report_step(format!("{ranks} ranks"))?;
        let mesh = mesh(context, largest, ranks)?;
        let triangles = mesh.num_triangles();
        for light in Lighting::ALL {
            let global_light = light != Lighting::Headlight;
            let demo = Demo { size_px: [size; 2], global_light, ..Demo::default() };
            let (mut scene, camera) = demo.scene_of(mesh.clone())?;
            if let Some(occlusion) = &mut scene.ambient_occlusion {
                occlusion.rays = OCCLUSION_RAYS;
            }
            let partition = Partition::new(&scene, ranks, &Split::Triangles);
            let prepared =
                PreparedDemo { scene, camera, options: RenderOptions::new(size, size), partition };
            let options =
                FrameOptions { secondary_rays: light.secondary_rays(), ..FrameOptions::default() };
            let measured = frames(&prepared, ranks, count, Sharing::SortLast, &options)?;
            record.rows.push(
                with_cost(Row::new(), ranks, &measured)
                    .with("light", light.name())
                    .with("triangles", triangles)
                    .with("per_rank", triangles / ranks),
            );
        }
    }
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
