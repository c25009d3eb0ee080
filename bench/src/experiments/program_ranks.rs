//! Ranks of `gluray run --ranks N`: processes that together render one image of an unmodified
//! OpenGL program.

use super::Context;
use crate::opengl::{Backend, Display, Drawing, Program, Session, Tools, write};
use crate::record::{Record, Row};
use crate::runner::order;
use crate::stats::Summary;
use datasets::catalogue::{self, Data};
use datasets::generate::nested_wavelet::Size;
use datasets::isosurface::Options;
use std::sync::Arc;

/// Width and height of the program's window.
const SIZE_PX: u32 = 1024;
/// A program, what it draws, and the value of its rows in the column `sharing`.
struct Case {
    program: Program,
    /// A data set and its size; `None` for the wavelet's surfaces of a million triangles.
    data: Option<(&'static str, &'static str)>,
    /// Numbers of ranks. Each is a program and its helpers, all of which have the data.
    ranks: &'static [u32],
    sharing: &'static str,
}

/// The programs: VTK in Python, and ParaView with the layer of the dissertation's figure.
const CASES: [Case; 2] = [
    Case { program: Program::Vtk, data: None, ranks: &[1, 2, 4, 8, 16], sharing: SHARING[0] },
    Case {
        program: Program::ParaView,
        data: Some(("mixing-layer", "medium")),
        ranks: &[1, 2, 4],
        sharing: SHARING[1],
    },
];
/// Values of the column `sharing`.
pub(super) const SHARING: [&str; 2] = ["gluray", "gluray, ParaView"];

pub(super) fn columns(record: &mut Record) {
    record.column("rays_mean", "Mray", "gluray: rays of a rank in a frame, mean over the ranks");
    record.column("rays_max", "Mray", "gluray: the same of the rank with the most");
    record.column(
        "builds",
        "",
        "gluray: acceleration structures that the helpers built in all frames",
    );
    record.column(
        "pixels_differ",
        "",
        "gluray: pixels of the window that are not those of one process",
    );
}

/// Adds the rows of the programs; what is missing for one is added to the missing parts.
pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.notes.push(format!(
        "`gluray`: a program in a window of {SIZE_PX} x {SIZE_PX} pixels, through `gluray run \
         --mode match --ranks N`: VTK in Python with the wavelet, and ParaView with the \
         Richtmyer-Meshkov-like layer from outside. Its ranks are real processes on the cores of \
         this machine, which they share: one rank has all cores, more have their part of them, so \
         wall time shows what sharing costs and not what more machines would gain. `render` is \
         wall time there, of a rank's share of a frame."
    ));
    for case in &CASES {
        // The quick form has one program.
        if case.data.is_none() || !context.quick {
            measure(context, record, case)?;
        }
    }
    Ok(())
}

fn measure(context: &mut Context<'_>, record: &mut Record, case: &Case) -> anyhow::Result<()> {
    let program = case.program;
    let tools = match (Tools::find(), program.find()) {
        (Ok(tools), Ok(_)) => tools,
        (tools, program) => {
            record.missing.extend(tools.err().into_iter().flatten().chain(program.err()));
            return Ok(());
        }
    };
    let display = Display::start(&tools.xvfb)?;
    let dir = tempfile::tempdir()?;
    let (counts, groups, frames): (&[u32], u32, u32) =
        if context.quick { (&[1, 2, 4], 2, 3) } else { (case.ranks, 5, 4) };
    let (mesh, view) = match case.data {
        _ if context.quick => (crate::meshes::coarse_wavelet(51)?, None),
        None => (context.wavelet(Size::M1)?, None),
        Some((name, size)) => {
            let entry = catalogue::find(name)?;
            context.report_step(format!("making {name}, {size}"))?;
            let options = Options { normals: true, scalars: false };
            match entry.generate(size, options, &mut |_, _| true)? {
                Data::Mesh(mesh) => (Arc::new(mesh), entry.views().into_iter().next()),
                Data::Lines(_) => anyhow::bail!("{name} has no triangles"),
            }
        }
    };
    let data = dir.path().join("data").with_extension(program.format().extension());
    write(&mesh, program.format(), &data)?;
    let drawing = Drawing { data: &data, size_px: SIZE_PX, view: view.as_ref() };

    // ---- All numbers of ranks run concurrently and alternate ----
    let mut sessions = Vec::new();
    for &ranks in counts {
        context.report_step(format!("{}, {ranks} ranks: starting", program.name()))?;
        let own = dir.path().join(format!("ranks{ranks}"));
        let backend = Backend::Ranks(ranks);
        let mut session =
            Session::start(program, backend, Some(&tools.gluray), &display, &own, drawing)?;
        session.frames(3)?;
        sessions.push(session);
    }
    let mut times = vec![Vec::new(); counts.len()];
    for round in 0..groups {
        context.report_step(format!("{}: group {} of {groups}", program.name(), round + 1))?;
        for i in order(counts.len(), round as usize) {
            times[i].push(sessions[i].frames(frames)?.wall_secs / f64::from(frames));
        }
    }
    let mut images = Vec::new();
    for (session, ranks) in sessions.iter_mut().zip(counts) {
        images.push(session.save(&dir.path().join(format!("ranks{ranks}.ppm")))?);
    }
    let mut reports = Vec::new();
    for session in sessions {
        reports.push(session.end()?.unwrap_or_default());
    }
    if reports.iter().any(|r| r["traced_draws"].as_u64().unwrap_or(0) == 0) {
        let why = &reports[0]["passed_reasons"];
        record.missing.push(format!(
            "{}: gluray traces nothing of this version of it ({why})",
            program.name()
        ));
        return Ok(());
    }
    for (i, (report, &ranks)) in reports.iter().zip(counts).enumerate() {
        let row = row(ranks, &times[i], report, differing(&images[0], &images[i]))?;
        record.rows.push(row.with("sharing", case.sharing));
    }
    Ok(())
}

fn row(ranks: u32, secs: &[f64], report: &serde_json::Value, differ: usize) -> anyhow::Result<Row> {
    let accounts = report["ranks"].as_array().map_or(&[][..], Vec::as_slice);
    let problems = report["problems"].as_array().map_or(0, Vec::len);
    anyhow::ensure!(
        problems == 0 && (ranks == 1 || accounts.len() == ranks as usize),
        "{ranks} ranks: {} accounts, problems {}",
        accounts.len(),
        report["problems"]
    );
    let number = |account: &serde_json::Value, key: &str| account[key].as_f64().unwrap_or(0.0);
    let per_picture = |key: &str| -> Vec<f64> {
        accounts.iter().map(|a| number(a, key) / number(a, "pictures").max(1.0)).collect()
    };
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let time = Summary::of(secs).ok_or_else(|| anyhow::anyhow!("no frames"))?;
    let mut row = Row::new()
        .with("ranks", ranks)
        .with("frame", time.median * 1e3)
        .with("frame_low", time.low * 1e3)
        .with("frame_high", time.high * 1e3)
        .with("pixels_differ", differ);
    if !accounts.is_empty() {
        let (render, rays) = (per_picture("trace_ms"), per_picture("rays"));
        let helpers = &accounts[1..];
        row = row
            .with("render_mean", mean(&render))
            .with("render_max", most(&render))
            .with("imbalance", most(&render) / mean(&render))
            .with("rays_mean", mean(&rays) * 1e-6)
            .with("rays_max", most(&rays) * 1e-6)
            .with("builds", helpers.iter().map(|a| number(a, "builds")).sum::<f64>())
            .with("sent", accounts.iter().map(|a| number(a, "sent_bytes")).sum::<f64>() * 1e-6);
    }
    Ok(row)
}

/// Number of pixels that differ at the ends of two files of raw RGB.
fn differing(a: &[u8], b: &[u8]) -> usize {
    let pixels = |f: &[u8]| f[f.len().saturating_sub(3 * (SIZE_PX * SIZE_PX) as usize)..].to_vec();
    let (a, b) = (pixels(a), pixels(b));
    if a.len() != b.len() {
        return a.len().max(b.len()) / 3;
    }
    a.chunks_exact(3).zip(b.chunks_exact(3)).filter(|(a, b)| a != b).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_what_each_rank_did_and_pixels_are_counted_behind_the_head() {
        let account = |rank: u32, rays: u64| {
            serde_json::json!({ "rank": rank, "pictures": 4, "trace_ms": 40.0 * f64::from(rank + 1), "rays": rays, "builds": 1,
                                "sent_bytes": 1000 })
        };
        let report = serde_json::json!({ "ranks": [account(0, 4_000_000), account(1, 8_000_000)], "problems": [] });
        let r = row(2, &[0.02, 0.01, 0.03], &report, 0).unwrap();
        assert_eq!(
            [r.number("frame"), r.number("rays_mean"), r.number("rays_max")],
            [Some(20.0), Some(1.5), Some(2.0)]
        );
        assert_eq!(
            [r.number("render_mean"), r.number("render_max"), r.number("builds")],
            [Some(15.0), Some(20.0), Some(1.0)]
        );
        assert!(row(3, &[0.02], &report, 0).is_err(), "a rank without an account");
        let image =
            |head: &str| [head.as_bytes(), &vec![7; 3 * (SIZE_PX * SIZE_PX) as usize]].concat();
        let (a, mut b) = (image("P6 1"), image("P6 with another head"));
        assert_eq!(differing(&a, &b), 0);
        let last = b.len() - 1;
        b[last] = 8;
        assert_eq!(differing(&a, &b), 1);
        assert!(differing(&a, &[]) > 0);
    }
}
