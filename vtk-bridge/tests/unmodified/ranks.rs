//! ParaView on several ranks, composited by IceT, against one rank.

use crate::peers::{Program, Run, peers};
use std::path::Path;

/// Share of pixels that may differ by more than a level: the cuts between the ranks' pieces, where the contour was made with other neighbours.
const EDGES: f64 = 0.01;

fn picture(path: &Path) -> Vec<u8> {
    let mut image = image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_rgb8();
    std::mem::take(&mut *image)
}

fn compare(opacity: &str) {
    let Some(peers) = peers() else { return };
    if !peers.has_mpi() {
        return;
    }
    let script = crate::peers::scripts().join("paraview/ranks.py");
    let script = script.to_str().expect("UTF-8");
    let mut one: Option<Vec<u8>> = None;
    for ranks in 1..=4 {
        let out = peers.out.join(format!("ranks-{opacity}-{ranks}.png"));
        let _ = std::fs::remove_file(&out);
        let run = Run::traced().with("RTV_THREADS", 1);
        let output =
            peers.python(Program::Ranks(ranks), &run, &["--sym", script, out.to_str().expect("UTF-8"), opacity]);
        let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{ranks} ranks: {said}");
        assert!(said.contains("vtkRtvRenderer"), "{said}");
        let pixels = picture(&out);
        let Some(first) = &one else {
            one = Some(pixels);
            continue;
        };
        let apart = first.chunks_exact(3).zip(pixels.chunks_exact(3)).filter(|(a, b)| (0..3).any(|c| a[c].abs_diff(b[c]) > 1));
        let share = apart.count() as f64 / (first.len() / 3) as f64;
        assert!(share <= EDGES, "{ranks} ranks, opacity {opacity}: {share} of the pixels differ");
    }
}

#[test]
fn one_to_four_ranks_show_the_same_opaque_picture() {
    compare("1.0");
}

#[test]
fn one_to_four_ranks_show_the_same_translucent_picture() {
    compare("0.5");
}

