//! Says which pieces of a line, outside the cells with values, lie in no hidden cell either.
//!
//! The border of the hidden cells divides the line. What lies between two passages is in a hidden
//! cell if the line went into one before and out of none since, or if it goes out of one next: then
//! it is in a second block of hidden cells, over the first. Where blocks touch whose faces do not
//! match, the line goes out and in at one place, which changes nothing.

use super::border::Border;
use crate::resample::mesh::Mesh;
use glam::DVec3;

/// The pieces, from and to, of the line from `at` in `direction`, of length one, up to `length`.
/// `ends_hidden`: whether it begins and ends at a hidden cell. Passages nearer to each other than
/// `slack` are at one place.
pub(super) fn pieces(
    hidden: &Border,
    mesh: &Mesh,
    at: DVec3,
    direction: DVec3,
    [length, slack]: [f64; 2],
    ends_hidden: [bool; 2],
) -> Vec<[f64; 2]> {
    let passages = hidden.passages(mesh, at, direction, [-slack, length]);
    let mut pieces: Vec<[f64; 2]> = Vec::new();
    let (mut within, mut since) = (ends_hidden[0], 0.0);
    let mut add = |from: f64, to: f64| match pieces.last_mut() {
        Some(last) if last[1] == from => last[1] = to,
        _ if to > from => pieces.push([from, to]),
        _ => {}
    };
    for group in passages.chunk_by(|a, b| b.distance - a.distance <= slack) {
        let at = group[0].distance.max(0.0);
        let inwards = group.iter().any(|p| p.inwards);
        let outwards = group.iter().any(|p| !p.inwards);
        if !within && (inwards || !outwards) {
            add(since, at);
        }
        if inwards != outwards {
            within = inwards;
        }
        since = at;
    }
    if !within && !ends_hidden[1] {
        add(since, length);
    }
    pieces
}
