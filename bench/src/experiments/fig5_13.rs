//! Figure 5.13: images of one flow by all techniques, and the effect of the filters on noise.

use super::Context;
use super::fig5_14::{FILTERS, NoiseCase, rms_difference};
use super::test_section::{check_cancelled, flow, image, render_image, scene};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use schlieren::render::TestSection;
use schlieren::scene::Jitter;

/// Techniques on the combustion jet: name, TOML, meaning.
const GALLERY: [(&str, &str, &str); 12] = [
    (
        "shadowgraph",
        "kind = \"shadowgraph\"",
        "second derivatives of the path: bright where light converges, 5 cm behind the flow",
    ),
    ("knife, upright", "kind = \"schlieren\"", "deflection to the right is brighter"),
    (
        "knife, level",
        "kind = \"schlieren\"\ncutoff = { kind = \"knife\", angle_deg = 90.0 }",
        "deflection upwards is brighter",
    ),
    (
        "circular cut-off",
        "kind = \"schlieren\"\ncutoff = { kind = \"circle\", radius_m = 2e-4 }",
        "what is deflected, whichever way, is dark",
    ),
    (
        "complemented circle",
        "kind = \"schlieren\"\ncutoff = { kind = \"complemented-circle\", radius_m = 2.6e-4 }",
        "what is deflected is bright: dark field",
    ),
    (
        "colour filter",
        "kind = \"schlieren\"\ncutoff = { kind = \"color\", radius_m = 1e-3 }",
        "hue is the direction of deflection, saturation its size",
    ),
    (
        "interferogram, infinite fringe",
        "kind = \"interferogram\"",
        "brightness follows the optical path; from bright to bright is a wave",
    ),
    (
        "interferogram, finite fringe",
        "kind = \"interferogram\"\nfringe_spacing_m = FRINGE",
        "fringes shifted by the optical path",
    ),
    ("BOS", "kind = \"bos\"", "a background of dots, displaced"),
    (
        "volume rendering",
        "kind = \"volume\"\nstrength = 40.0",
        "for comparison: |grad n| as smoke, no optics",
    ),
    ("slice", "kind = \"slice\"", "for comparison: |grad n| in the middle plane"),
    (
        "colours of white light",
        "kind = \"interferogram\"\n[light]\nwavelengths_nm = [450.0, 540.0, 620.0]",
        "three wavelengths, each through its own index",
    ),
];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("picture", "", "technique, or filter and photons per pixel");
    record.column("time", "s", "wall time with the field in memory");
    record.column(
        "march",
        "",
        "how light is taken through the flow; empty for comparisons without light",
    );
    record.column("photons", "", "photons traced (rays, for beams)");
    record.column("filter", "", "against noise");
    record.column("samples", "", "photons per pixel");
    record.column("rms_error", "%", "root mean square against the reference, of white");
    gallery(context, record)?;
    filters(context, record)
}

fn gallery(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    let (size, pixels) = if context.quick { ("medium", 360) } else { ("thesis", 768) };
    context.report_step("combustion jet")?;
    let field = flow("combustion-jet", size)?;
    let width_m = field.size_m().x;
    let fringe = format!("{:.6}", width_m / 24.0);
    let mut section = TestSection::of_fields(&scene("")?, vec![field], None)?;
    record.notes.push(format!(
        "The combustion jet ({size} size, {:.3} m wide) in the customary bench: helium-neon light, \
         mirrors of 1.5 m, a slit of 1 mm by 5 mm for the knife and \
         a pinhole of 0.5 mm for the other cut-offs; the shadowgraph is focused 5 cm behind the \
         flow, BOS 0.5 m before it. Photons are traced (Verlet, b-spline, a step a voxel).",
        width_m
    ));
    for (name, toml, meaning) in GALLERY {
        check_cancelled(context)?;
        context.report_step(format!("image: {name}"))?;
        let toml = toml.replace("FRINGE", &fringe);
        // Comparisons trace no light and reject a march. A shadowgraph of such a small flow is all
        // caustics at the default 0.5 m.
        let lit = !meaning.starts_with("for comparison");
        let march = if lit {
            "[march]\nmethod = \"verlet\"\ninterpolant = \"b-spline\"\nstep_voxels = 1.0\n"
        } else {
            ""
        };
        let focus = if name == "shadowgraph" { "focus_m = 0.05\n" } else { "" };
        let film = format!("[film]\nsize = [{}, {pixels}]\n{focus}", pixels * 2 / 3);
        let scene = scene(&format!("{film}[technique]\n{toml}\n{march}"))?;
        // One field for each wavelength; the catalogue has one for a single wavelength.
        let lines = scene.lines();
        let single = (lines.len() > 1).then(|| section.fields[0].clone());
        if let Some(single) = &single {
            section.fields = dispersed(single, &lines)?;
        }
        let start = std::time::Instant::now();
        let rendered = render_image(context, &scene, &section)?;
        let secs = start.elapsed().as_secs_f64();
        if let Some(single) = single {
            section.fields = vec![single];
        }
        record.rows.push(
            Row::new()
                .with("picture", name)
                .with("time", secs)
                .with("march", rendered.report.march.as_str())
                .with("photons", rendered.report.counters.rays),
        );
        record.notes.extend(rendered.report.warnings.iter().map(|w| format!("{name}: {w}")));
        let settings = toml.replace('\n', "; ");
        record.images.push(image(
            name,
            format!("{name}: {meaning}. {secs:.2} s. [technique] {settings}"),
            &rendered,
        )?);
    }
    Ok(())
}

/// The field for each line: eps in proportion to n - 1 of air.
fn dispersed(
    field: &schlieren::field::Field,
    lines: &[schlieren::spectrum::Line],
) -> anyhow::Result<Vec<schlieren::field::Field>> {
    use schlieren::field::Field;
    use schlieren::index::Gas;
    let air: Gas = "air".parse()?;
    let at_633 = air.k_m3_per_kg(0.633)?;
    let one = |line: &schlieren::spectrum::Line| {
        let ratio = air.k_m3_per_kg(line.wavelength_nm * 1e-3)? / at_633;
        let eps = field.eps().iter().map(|e| (f64::from(*e) * ratio) as f32).collect();
        let n0 = 1.0 + (field.n0() - 1.0) * ratio;
        Ok(Field::new(
            field.dims(),
            field.spacing_m(),
            field.origin_m(),
            eps,
            n0,
            field.nodes().map(<[_]>::to_vec),
        )?)
    };
    lines.iter().map(one).collect()
}

fn filters(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    let noisy = NoiseCase::knife(context)?;
    context.report_step("reference without noise")?;
    let (reference, _) = noisy.reference(context)?;
    let mut plot = Plot::lines(
        "Error against photons by filter (knife, independent photons)",
        Axis::log("photons per pixel", ""),
        Axis::log("rms error, of white", "%"),
    );
    let counts: &[u32] = if context.quick { &[1, 4, 16, 64] } else { &[1, 4, 16, 64, 256] };
    for (name, filter) in FILTERS {
        let mut points = vec![];
        for &samples in counts {
            check_cancelled(context)?;
            context.report_step(format!("{name}, {samples} photons"))?;
            let (rendered, secs) = noisy.image(context, Jitter::Random, samples, 0, filter)?;
            let rms = rms_difference(&rendered, &reference);
            points.push((f64::from(samples), rms));
            record.rows.push(
                Row::new()
                    .with("picture", format!("filter {name}, {samples} photons"))
                    .with("time", secs)
                    .with("filter", name)
                    .with("samples", samples)
                    .with("rms_error", rms),
            );
            if samples == 4 {
                let caption =
                    format!("filter {name}, 4 photons a pixel: rms error {rms:.2} % of white");
                record.images.push(image(&format!("filter {name}"), caption, &rendered)?);
            }
        }
        plot.series.push(Series::new(name, points));
    }
    record.plots.push(plot);
    let error = |filter: &str, samples: u32| {
        let here = |r: &&Row| {
            r.text("filter") == Some(filter) && r.number("samples") == Some(f64::from(samples))
        };
        record.rows.iter().find(here).and_then(|r| r.number("rms_error")).unwrap_or(f64::NAN)
    };
    let least = |samples: u32| {
        let names = FILTERS.map(|f| f.0);
        let best = names.into_iter().min_by(|a, b| error(a, samples).total_cmp(&error(b, samples)));
        format!("{samples} photons: {}", best.unwrap_or_default())
    };
    let least: Vec<String> = counts.iter().map(|n| least(*n)).collect();
    record.notes.push(format!(
        "Filters shrink as photons are added (radius as N^(-1/6)). The least error had, with {}. \
         Times are those of a whole image with the field in memory, \
         from one run.",
        least.join("; ")
    ));
    Ok(())
}
