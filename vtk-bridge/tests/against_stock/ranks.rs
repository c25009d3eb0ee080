//! `mpiexec -n N pvbatch`, composited by ParaView's IceT: the image must not depend on N.

use crate::capture::Capture;
use crate::peers::{mpirun, scripts, skip};
use crate::session::{Launch, Outcome, Program, With, interpreter, output};
use std::path::PathBuf;

/// Runs the script on `ranks` ranks. Images and reports are written to the returned folder.
fn run(
    ranks: usize,
    with: With,
    name: &str,
    settings: &[(&str, &str)],
) -> Result<(PathBuf, Outcome), String> {
    let mpirun = mpirun().ok_or("mpirun.openmpi was not found (set RTSV_MPIRUN)")?;
    let folder = output(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let line = format!(
        "exec '{}' --allow-run-as-root --oversubscribe -n {ranks} {} \"$@\"",
        mpirun.display(),
        interpreter(Program::ParaView, With::Stock)?
    );
    let mut launch = Launch::new(Program::ParaView, with, &line)?
        .args([scripts().join("ranks/surfaces.py"), folder.clone()])
        // Otherwise waiting ranks would spin on cores that others need.
        .env("OMPI_MCA_mpi_yield_when_idle", "1");
    if with == With::Bridge {
        launch = launch.env("RTV_REPORT", folder.join("report.json"));
    }
    for (name, value) in settings {
        launch = launch.env(name, value);
    }
    Ok((folder, launch.output()))
}

/// Number of pixels that differ by more than `levels` of 255 from the pixel at the same position in
/// the other image and from all its neighbours. Edges may therefore be one pixel off; all other
/// differences count.
fn unmatched_pixels(a: &Capture, b: &Capture, levels: u8) -> usize {
    let (w, h) = (a.width, a.height);
    assert_eq!((w, h), (b.width, b.height));
    let near = |p: [u8; 3], q: [u8; 3]| (0..3).all(|c| p[c].abs_diff(q[c]) <= levels);
    let unmatched = |a: &Capture, b: &Capture, x: usize, y: usize| {
        let around = (y.saturating_sub(1)..(y + 2).min(h))
            .flat_map(|v| (x.saturating_sub(1)..(x + 2).min(w)).map(move |u| v * w + u));
        !around.into_iter().any(|i| near(a.rgb[y * w + x], b.rgb[i]))
    };
    (0..w * h).filter(|i| unmatched(a, b, i % w, i / w) || unmatched(b, a, i % w, i / w)).count()
}

/// Number of pixels that differ by more than 1 of 255 at the same position.
fn different(a: &Capture, b: &Capture) -> usize {
    a.rgb.iter().zip(&b.rgb).filter(|(p, q)| (0..3).any(|c| p[c].abs_diff(q[c]) > 1)).count()
}

/// Mean difference of the channels.
fn difference(a: &Capture, b: &Capture) -> f64 {
    let pairs = a.rgb.as_flattened().iter().zip(b.rgb.as_flattened());
    pairs.map(|(p, q)| f64::from(p.abs_diff(*q))).sum::<f64>() / a.rgb.as_flattened().len() as f64
}

#[test]
fn images_do_not_depend_on_the_number_of_ranks() {
    let start = |n: usize| run(n, With::Bridge, &format!("ranks-{n}"), &[]);
    let (one, outcome) = match start(1) {
        Ok(run) => run,
        Err(reason) => return skip(&reason),
    };
    outcome.expect_success("one rank");
    let mut found = Vec::new();
    for ranks in 2..=4 {
        let (folder, outcome) = start(ranks).unwrap();
        let outcome = outcome.expect_success(&format!("{ranks} ranks"));
        for name in ["opaque", "translucent", "mixed", "annotated"] {
            let [a, b] = [&one, &folder].map(|f| Capture::read(f, name).unwrap());
            let (unmatched, different) = (unmatched_pixels(&a, &b, 1), different(&a, &b));
            let pixels = a.width * a.height;
            // OpenGL draws lines and text of the axes, which also move by a pixel in stock
            // ParaView.
            let allowed = if name == "annotated" { pixels / 2000 } else { pixels / 5000 };
            if unmatched > allowed || different * 200 > pixels {
                found.push(format!(
                    "{ranks} ranks, {name}: {unmatched} of {pixels} pixels are not within 1/255 \
                     edges aside, {different} are not within 1 at their place"
                ));
            }
        }
        for rank in 0..ranks {
            let path = folder.join(format!("report.rank{rank}.json"));
            let text = std::fs::read_to_string(&path)
                .unwrap_or_else(|e| panic!("{}: {e}\n{}", path.display(), outcome.stderr));
            assert!(
                text.contains("\"triangles\""),
                "rank {rank} of {ranks} traced nothing:\n{text}"
            );
        }
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

#[test]
fn one_rank_with_the_bridge_is_as_stock() {
    let [stock, ours] = [(With::Stock, "ranks-stock"), (With::Bridge, "ranks-ours")]
        .map(|(w, n)| run(1, w, n, &[]));
    let (stock, ours) = match (stock, ours) {
        (Ok(stock), Ok(ours)) => (stock.0, ours.0),
        (Err(reason), _) | (_, Err(reason)) => return skip(&reason),
    };
    for name in ["opaque", "translucent", "mixed", "annotated"] {
        let [a, b] = [&stock, &ours].map(|f| Capture::read(f, name).unwrap());
        // OpenGL stores peeled layers of translucent surfaces as bytes.
        let unmatched = unmatched_pixels(&a, &b, if name == "opaque" { 1 } else { 3 });
        let (mean, pixels) = (difference(&a, &b), a.width * a.height);
        assert!(
            unmatched * 5000 <= pixels && mean <= 0.5,
            "{name}: {unmatched} of {pixels} pixels are not as in stock ParaView, mean difference \
             {mean}"
        );
    }
}

#[test]
fn effects_across_ranks_are_warned_about() {
    let run = run(2, With::Bridge, "ranks-warned", &[("RTV_AO", "2")]);
    let (_, outcome) = match run {
        Ok(run) => run,
        Err(reason) => return skip(&reason),
    };
    let outcome = outcome.expect_success("two ranks with ambient occlusion");
    let warned = outcome.stderr.lines().any(|l| l.contains("vtk-bridge") && l.contains("rank"));
    assert!(warned, "no warning that secondary rays see only one rank's data:\n{}", outcome.stderr);
}

#[test]
fn planted_differences_between_ranks_are_noticed() {
    let image = |edit: &dyn Fn(usize, usize) -> [u8; 3]| Capture {
        width: 60,
        height: 40,
        rgb: (0..2400).map(|i| edit(i % 60, i / 60)).collect(),
        depth: vec![],
        facts: serde_json::Value::Null,
        report: None,
    };
    let plain = |x: usize, _: usize| if x < 30 { [200, 40, 40] } else { [40, 40, (60 + x) as u8] };
    let (a, moved) = (image(&plain), image(&|x, y| plain(x + 1, y)));
    assert_eq!(unmatched_pixels(&a, &a, 1), 0);
    assert_eq!(unmatched_pixels(&a, &moved, 1), 0, "an edge may lie one pixel beside");
    let seam = image(&|x, y| if x == 12 { [190, 40, 40] } else { plain(x, y) });
    assert_eq!(unmatched_pixels(&a, &seam, 1), 40, "a seam of one pixel is a fault");
    assert!(different(&a, &moved) > 0);
}
