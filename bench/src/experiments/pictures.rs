//! Pictures of the dissertation's data sets, each with its command and what it took.

use super::Context;
use crate::picture::{gallery, save};
use crate::record::{Picture, Record, Row};

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("picture", "", "name for `bench picture`");
    record.column("contents", "", "what is drawn");
    record.column("data", "s", "wall time of generating the data");
    record.column("build", "s", "wall time of the acceleration structure");
    record.column("render", "s", "wall time of the picture");
    record.column("rays", "Mray", "rays of all kinds");
    record.column("command", "", "draws it again");
    let (size, samples) = if context.quick { ([480, 270], 4) } else { ([1280, 720], 64) };
    for entry in gallery::ALL {
        context.say(entry.name)?;
        let p = entry.paint(size, samples, &mut || Ok(()))?;
        let command = entry.command(size, samples);
        let (build, render) = (p.drawn.build_secs, p.drawn.render_secs);
        let caption = format!(
            "{} {}. {command}: {:.1} s to generate, {build:.1} s to build, {render:.1} s to draw.",
            entry.caption, p.contents, p.data_secs
        );
        record.notes.extend(p.drawn.warnings.iter().map(|w| format!("{}: {w}", entry.name)));
        let png = save::png_bytes(&p.drawn.frame)?;
        record.pictures.push(Picture { name: entry.name.into(), caption, png });
        record.rows.push(
            Row::new()
                .with("picture", entry.name)
                .with("contents", p.contents)
                .with("data", p.data_secs)
                .with("build", build)
                .with("render", render)
                .with("rays", p.drawn.report.rays.total() as f64 / 1e6)
                .with("command", command),
        );
    }
    Ok(())
}
