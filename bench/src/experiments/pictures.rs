//! Images of the dissertation's data sets, each with its command and its cost.

use super::Context;
use crate::image::{RenderControl, gallery, save};
use crate::record::{Record, RecordImage, Row};
use datasets::cli::Interrupted;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("picture", "", "name for `bench picture`");
    record.column("contents", "", "what is drawn");
    record.column("data", "s", "wall time of generating the data");
    record.column("build", "s", "wall time of the acceleration structure");
    record.column("render", "s", "wall time of the image");
    record.column("rays", "Mray", "rays of all kinds");
    record.column("command", "", "draws it again");
    let (size, samples) = if context.quick { ([480, 270], 4) } else { ([1280, 720], 64) };
    let all = gallery::ALL.len() as f64;
    for (n, entry) in gallery::ALL.iter().enumerate() {
        let share =
            |samples_done: u32| (n as f64 + f64::from(samples_done) / f64::from(samples)) / all;
        context.report_share(format!("{}: data", entry.name), share(0))?;
        let cancel = context.cancel.clone();
        let mut on_samples = |done: u32| {
            // The flag stops the rendering; an error of the progress report is irrelevant here.
            let _ = context
                .report_share(format!("{}: sample {done} of {samples}", entry.name), share(done));
        };
        let mut control = RenderControl { cancel, samples_done: Some(&mut on_samples) };
        let p = entry.render(size, samples, &mut control)?;
        if p.rendered.is_interrupted() {
            return Err(Interrupted.into());
        }
        let command = entry.command(size, samples);
        let (build, render) = (p.rendered.build_secs, p.rendered.render_secs);
        let caption = format!(
            "{} {}. {command}: {:.1} s to generate, {build:.1} s to build, {render:.1} s to draw.",
            entry.caption, p.contents, p.data_secs
        );
        record.notes.extend(p.rendered.warnings.iter().map(|w| format!("{}: {w}", entry.name)));
        let png = save::png_bytes(&p.rendered.frame)?;
        record.images.push(RecordImage { name: entry.name.into(), caption, png });
        record.rows.push(
            Row::new()
                .with("picture", entry.name)
                .with("contents", p.contents)
                .with("data", p.data_secs)
                .with("build", build)
                .with("render", render)
                .with("rays", p.rendered.report.rays.total() as f64 / 1e6)
                .with("command", command),
        );
    }
    Ok(())
}
