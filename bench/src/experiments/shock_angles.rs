//! Images shocks whose angle is known exactly (wedges and cones), measures the angle in the image,
//! and finds how fine a lattice this needs.

use super::Context;
use super::test_section::{check_cancelled, image, render_image_with, scene};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use datasets::generate::cone_shock::Cone;
use datasets::generate::flow::{Fields, Flow};
use datasets::generate::gas_dynamics::FreeStream;
use datasets::generate::oblique_shock::Wedge;
use glam::UVec3;
use schlieren::input::{Medium, Options, from_dataset};
use schlieren::measure::{Line, Mark, Photograph, SearchFrom, fitted_line};
use schlieren::render::{Layers, RenderOutput, TestSection};

/// Pressure and temperature of air drawn from the room into a vacuum vessel.
const RESERVOIR: (f64, f64) = (1e5, 300.0);

/// Body, Mach number, half angle in degrees.
const CASES: [(&str, f64, f64); 4] =
    [("wedge", 2.0, 10.0), ("wedge", 3.0, 20.0), ("cone", 2.0, 20.0), ("cone", 3.0, 20.0)];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("flow", "", "body, half angle, Mach number");
    record.column("nodes", "", "of the lattice along the stream");
    record.column("exact", "deg", "angle of the shock by theta-beta-M or Taylor and Maccoll");
    record.column("picture", "deg", "angle of the line fitted to the image");
    record.column("error", "deg", "absolute error of the image's angle");
    record.column("points", "", "columns of the image that the line was fitted to");
    record.column("outliers", "", "columns that were left out as outliers");
    record.column("scatter", "pixel", "root mean square distance of the points from the line");
    record.column("time", "s", "wall time of the image with the flow in memory");
    // The number of rays grows with the square. At 400 pixels, the cones alone take most of a
    // minute in a release build.
    let width = if context.quick { 200 } else { 400 };
    record.notes.push(format!(
        "Means over cells of the exact flows, air from a reservoir of 1 bar and 300 K, through the \
         customary bench at \
         the customary tolerance of 1e-7 rad; images {width} pixels wide, knife level. In each \
         column the place \
         where brightness changes most, from the stream inwards, is the shock's; the line is \
         fitted against outliers \
         (Theil and Sen, then least squares). Columns near the tip are left out, where shock and \
         body are a few \
         voxels apart."
    ));
    let mut plot = Plot::lines(
        "Error of the shock's angle",
        Axis::log("nodes of the lattice along the stream", ""),
        Axis::log("error", "deg"),
    );
    // The rays of the cones take longer on finer lattices: 91 nodes alone took more than half of
    // the quick form's time.
    let sizes: &[u32] = if context.quick { &[46, 61] } else { &[46, 61, 91, 121, 181] };
    let finest = sizes.last().copied().unwrap_or(0);
    if context.quick {
        record.notes.push(format!(
            "The quick form stops at lattices of {finest} nodes along the stream: it shows that \
             all bodies are photographed and measured, not how fine a lattice they take."
        ));
    }
    for (body, mach, half_deg) in CASES {
        let name = format!("{body} of {half_deg} degrees, M {mach}");
        let mut points = vec![];
        for &nodes in sizes {
            check_cancelled(context)?;
            context.report_step(format!("{name}, {nodes} nodes"))?;
            let (flow, exact_rad) = flow(body, mach, half_deg, nodes)?;
            let start = std::time::Instant::now();
            let rendered = photographed(context, flow, width)?;
            let secs = start.elapsed().as_secs_f64();
            let line =
                shock(&rendered).ok_or_else(|| anyhow::anyhow!("{name}: no line in the image"))?;
            let (got, exact) = (line.angle_rad.to_degrees(), exact_rad.to_degrees());
            let error = (got - exact).abs();
            points.push((f64::from(nodes), error));
            record.rows.push(
                Row::new()
                    .with("flow", name.as_str())
                    .with("nodes", nodes)
                    .with("exact", exact)
                    .with("picture", got)
                    .with("error", error)
                    .with("points", line.points as u64)
                    .with("outliers", line.outliers as u64)
                    .with("scatter", line.rms_m / rendered.framing.pixel_m)
                    .with("time", secs),
            );
            if nodes == finest {
                let caption =
                    format!("{name}: {got:.3} degrees in the image (red line), {exact:.3} exactly");
                record.images.push(image(&name, caption, &marked(rendered, &line))?);
            }
        }
        plot.series.push(Series::new(name, points));
    }
    let ends = |s: &Series| s.points.first().zip(s.points.last()).map(|(a, b)| (a.x, b.x));
    if let Some((a, b)) = plot.series.first().and_then(ends) {
        plot.series.push(Series::new("what is asked for", vec![(a, 0.3), (b, 0.3)]));
    }
    record.plots.push(plot);
    Ok(())
}

/// A flow with cubic cells, and the angle of its shock.
fn flow(body: &str, mach: f64, half_deg: f64, nodes: u32) -> anyhow::Result<(Flow, f64)> {
    let stream = FreeStream::from_reservoir(mach, RESERVOIR.0, RESERVOIR.1);
    let half_angle_rad = half_deg.to_radians();
    if body == "wedge" {
        let wedge = Wedge { stream, half_angle_rad, ..Wedge::default() };
        // The lattice is about as high as it is long; nothing varies along the span.
        return Ok((
            wedge.flow(UVec3::new(nodes, nodes, 17), Fields::Density)?,
            wedge.shock()?.shock_rad,
        ));
    }
    let cone = Cone { stream, half_angle_rad, ..Cone::default() };
    let exact_rad = cone.solution()?.shock_rad;
    // 1.2 lengths along, 2.2 tan(shock) lengths across.
    let across = (f64::from(nodes) * 2.2 * exact_rad.tan() / 1.2).round() as u32;
    Ok((cone.flow(UVec3::new(nodes, across, across), Fields::Density)?, exact_rad))
}

fn photographed(context: &Context<'_>, flow: Flow, width: u32) -> anyhow::Result<RenderOutput> {
    let sides = flow.high_m() - flow.origin_m;
    let rows = (f64::from(width) * sides.y / sides.x).round();
    let scene = scene(&format!(
        "[film]\nsize = [{width}, {rows}]\n[technique]\nkind = \"schlieren\"\ncutoff = {{ kind \
         = \"knife\", angle_deg = 90.0 }}"
    ))?;
    let options = Options { wavelength_nm: 633.0, ..Options::new(Medium::density("density")) };
    let field = from_dataset(&flow.into_dataset(), &options)?.field;
    let section = TestSection::of_fields(&scene, vec![field], None)?;
    render_image_with(context, &scene, &section, Layers { map: true, ..Layers::NONE })
}

/// The shock above the body, without the third of the image around the tip.
fn shock(rendered: &RenderOutput) -> Option<Line> {
    let photograph = Photograph::from_render(rendered)?;
    let width = f64::from(photograph.framing.width);
    let [left, right] =
        [0.35, 0.98].map(|p| photograph.framing.plane_from_pixel(p * width, 0.0)[0]);
    // On a coarse lattice, a shock is many pixels wide and the change between pixels is small.
    let points = photograph.fronts_m(SearchFrom::Top, Mark::Edge, 0.01, 4);
    fitted_line(&points.into_iter().filter(|p| (left..right).contains(&p[0])).collect::<Vec<_>>())
}

/// The image with the fitted line drawn into it.
fn marked(mut rendered: RenderOutput, line: &Line) -> RenderOutput {
    let framing = rendered.framing;
    let (width, height) = (framing.width as usize, framing.height as usize);
    for i in width / 4..width {
        let [x, _] = framing.plane_from_pixel(i as f64 + 0.5, 0.0);
        let y = line.through_m[1] + (x - line.through_m[0]) * line.angle_rad.tan();
        let row = 0.5 * height as f64 - (y - framing.center_m[1]) / framing.pixel_m;
        // Dashed, so that half of the image under the line stays visible.
        if (0.0..height as f64).contains(&row) && i / 6 % 2 == 0 {
            rendered.pixels[i + row as usize * width] = [0.9, 0.0, 0.0];
        }
    }
    rendered.colored = true;
    rendered
}
