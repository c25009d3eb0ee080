//! Figure 5.12: the same flow by volume rendering, along straight lines of sight and with ray
//! tracing. Also the difference between the latter two as a function of n − 1.

use super::Context;
use super::test_section::{blob, check_cancelled, flow, image, render_image, scene};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, RecordImage, Row};
use schlieren::field::Field;
use schlieren::film::Framing;
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, Deviational, LineOfSight, Options};
use schlieren::path::{Exit, LightPaths, PathQuantities};
use schlieren::render::TestSection;
use schlieren::view::{Axis as ViewAxis, View};

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("flow", "", "what light goes through");
    record.column("amplitude", "", "largest |eps| = |n/n0 - 1|");
    record.column("deflection", "rad", "largest deflection, traced");
    record.column(
        "deflection_rms",
        "",
        "rms difference of deflections, line of sight against traced, as part of the largest",
    );
    record.column("deflection_max", "", "largest difference, the same way");
    record.column("path_rms", "", "rms difference of optical paths, as part of the largest");
    record.column("path_waves", "waves", "largest difference of optical paths, at 633 nm");
    record.column("stray", "voxel", "largest displacement of a ray inside the flow");
    record.column("picture", "", "which image");
    record.column("time", "s", "wall time of the image with the field in memory");
    record.notes.push(
        "Traced: Verlet, cubic b-spline, half a voxel a step. Line of sight leaves out that rays \
         bend. Flows are scaled to each amplitude. Volume rendering of |grad n| has no optics in \
         it and no unit: nothing can be compared but the look."
            .into(),
    );
    images(context, record)?;
    let size = if context.quick { "small" } else { "medium" };
    let jet = flow("combustion-jet", size)?;
    let body = flow("blunt-body", size)?;
    let (_, gaussian) = blob(1.0e-4, if context.quick { 64 } else { 128 })?;
    let mut plot = Plot::lines(
        "Line of sight against traced",
        Axis::log("largest |n/n0 - 1|", ""),
        Axis::log("rms difference / largest", ""),
    );
    for (name, field) in
        [("Gaussian blob", &gaussian), ("combustion jet", &jet), ("blunt body", &body)]
    {
        let own = field.eps().iter().fold(0.0f64, |m, e| m.max(f64::from(e.abs())));
        let (mut deflection, mut path) = (vec![], vec![]);
        for exponent in [-7, -6, -5, -4, -3, -2] {
            check_cancelled(context)?;
            context.report_step(format!("{name}: amplitude 1e{exponent}"))?;
            let amplitude = 10f64.powi(exponent);
            let d =
                difference(&scaled(field, amplitude / own)?, if context.quick { 96 } else { 256 });
            deflection.push((amplitude, d.deflection_rms));
            path.push((amplitude, d.path_rms));
            record.rows.push(
                Row::new()
                    .with("flow", name)
                    .with("amplitude", amplitude)
                    .with("deflection", d.deflection_rad)
                    .with("deflection_rms", d.deflection_rms)
                    .with("deflection_max", d.deflection_max)
                    .with("path_rms", d.path_rms)
                    .with("path_waves", d.path_waves)
                    .with("stray", d.stray_voxels),
            );
        }
        plot.series.push(Series::new(format!("{name}, deflection"), deflection));
        plot.series.push(Series::new(format!("{name}, optical path"), path));
    }
    record.notes.push(describe(&record.rows));
    record.plots.push(plot);
    Ok(())
}

/// Describes the difference for a laboratory gas, and its growth with n - 1.
fn describe(rows: &[Row]) -> String {
    let mut flows: Vec<&str> = rows.iter().filter_map(|r| r.text("flow")).collect();
    flows.dedup();
    let each = flows.iter().filter_map(|flow| {
        let at = |amplitude: f64| {
            let here = |r: &&Row| {
                let a = r.number("amplitude").unwrap_or(0.0);
                r.text("flow") == Some(*flow) && (a / amplitude - 1.0).abs() < 1e-6
            };
            rows.iter().find(here)?.number("deflection_rms")
        };
        let (weak, strong) = (at(1e-4)?, at(1e-3)?);
        Some(format!("{flow} {weak:.1e} at 1e-4, {:.1} times that at 1e-3", strong / weak))
    });
    format!(
        "Root mean square difference of deflections, as part of the largest: {}.",
        each.collect::<Vec<_>>().join("; ")
    )
}

fn scaled(field: &Field, factor: f64) -> anyhow::Result<Field> {
    let eps = field.eps().iter().map(|e| (f64::from(*e) * factor) as f32).collect();
    let nodes = field.nodes().map(<[_]>::to_vec);
    Ok(Field::new(field.dims(), field.spacing_m(), field.origin_m(), eps, field.n0(), nodes)?)
}

struct Difference {
    deflection_rad: f64,
    deflection_rms: f64,
    deflection_max: f64,
    path_rms: f64,
    path_waves: f64,
    stray_voxels: f64,
}

/// Difference between line of sight and traced rays, over an image of the whole field along z. Rays
/// that a body stops are ignored.
fn difference(field: &Field, pixels: u32) -> Difference {
    let view = View::along(ViewAxis::Z, field.centre_m());
    let size = field.size_m();
    // Slightly inside, so that no ray runs along a face.
    let starts = Framing::fitted(pixels, pixels, [0.98 * size.x, 0.98 * size.y]).pixel_centers();
    let quantities = PathQuantities { opd: true };
    let mut straight = vec![Exit::UNDISTURBED; starts.len()];
    let mut traced = straight.clone();
    LineOfSight::new(field, view, Interpolant::BSpline, quantities, BlankCells::Opaque)
        .trace_parallel(&starts, &mut straight);
    Deviational::new(
        field,
        view,
        Interpolant::BSpline,
        Options { step_voxels: 0.5, quantities, ..Options::default() },
    )
    .trace_parallel(&starts, &mut traced);
    let both = || {
        straight.iter().zip(&traced).filter(|(a, b)| a.transmission > 0.0 && b.transmission > 0.0)
    };
    let size_of = |v: [f32; 2]| f64::from(v[0]).hypot(f64::from(v[1]));
    let largest = |f: &dyn Fn(&Exit) -> f64| both().map(|(_, b)| f(b)).fold(0.0, f64::max);
    let deflection_rad = largest(&|e| size_of(e.deflection_rad));
    let path_m = largest(&|e| f64::from(e.opd_m).abs());
    let stray_m = largest(&|e| size_of(e.displacement_m));
    let (mut n, mut squares, mut path_squares) = (0.0, 0.0, 0.0);
    let (mut furthest, mut furthest_path) = (0.0f64, 0.0f64);
    for (a, b) in both() {
        let off = [0, 1].map(|c| f64::from(a.deflection_rad[c]) - f64::from(b.deflection_rad[c]));
        let off = off[0].hypot(off[1]);
        let path = (f64::from(a.opd_m) - f64::from(b.opd_m)).abs();
        n += 1.0;
        squares += off * off;
        path_squares += path * path;
        furthest = furthest.max(off);
        furthest_path = furthest_path.max(path);
    }
    Difference {
        deflection_rad,
        deflection_rms: (squares / n).sqrt() / deflection_rad,
        deflection_max: furthest / deflection_rad,
        path_rms: (path_squares / n).sqrt() / path_m,
        path_waves: furthest_path / 633e-9,
        stray_voxels: stray_m / field.spacing_m()[0].min(field.spacing_m()[1]),
    }
}

/// The figure itself: the same jet in three renderings, and the amplified difference of the latter
/// two.
fn images(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    let (size, pixels) = if context.quick { ("medium", 384) } else { ("thesis", 768) };
    context.report_step("combustion jet")?;
    let field = flow("combustion-jet", size)?;
    // The jet's height is 1.5 times its width.
    let film = format!("[film]\nsize = [{}, {pixels}]\n", pixels * 2 / 3);
    let schlieren = format!("{film}[technique]\nkind = \"schlieren\"\n");
    let views = [
        ("volume rendering", format!("{film}[technique]\nkind = \"volume\"\nstrength = 40.0\n")),
        ("line of sight", format!("{schlieren}[march]\nmethod = \"line-of-sight\"\n")),
        (
            "traced",
            format!(
                "{schlieren}[march]\nmethod = \"verlet\"\ninterpolant = \"b-spline\"\nstep_voxels \
                 = 1.0\n"
            ),
        ),
    ];
    let section = TestSection::of_fields(&scene(&film)?, vec![field], None)?;
    let mut painted = vec![];
    for (name, toml) in views {
        context.report_step(format!("image: {name}"))?;
        let start = std::time::Instant::now();
        let rendered = render_image(context, &scene(&toml)?, &section)?;
        let secs = start.elapsed().as_secs_f64();
        record.rows.push(Row::new().with("picture", name).with("time", secs));
        record.images.push(image(
            name,
            format!("{name}: combustion jet, {pixels} pixels high, {secs:.1} s"),
            &rendered,
        )?);
        painted.push(rendered);
    }
    // Both use the same photons, so the difference is due to the bending.
    if let [_, straight, traced] = &mut painted[..] {
        let off: Vec<f32> =
            straight.pixels.iter().zip(&traced.pixels).map(|(a, b)| a[0] - b[0]).collect();
        let rms = (off.iter().map(|o| f64::from(o * o)).sum::<f64>() / off.len() as f64).sqrt();
        // A power of ten that makes the root mean square difference a visible grey.
        let gain = 10f64.powf((0.5 / rms.max(1e-12)).log10().floor());
        straight.pixels = off.iter().map(|o| [0.5 + (gain * f64::from(*o)) as f32; 3]).collect();
        let caption = format!(
            "line of sight minus traced, {gain} times, on mid-grey; root mean square {rms:.1e} of \
             white, from the \
             same photons"
        );
        let RecordImage { png, .. } = image("difference", String::new(), straight)?;
        record.images.push(RecordImage { name: "difference".into(), caption, png });
    }
    Ok(())
}
