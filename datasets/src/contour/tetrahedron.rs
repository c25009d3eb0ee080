//! The surface of a linear field in a tetrahedron.

use glam::DVec3;

/// A corner: its place, the field, and what colours it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Node {
    pub(super) position: DVec3,
    pub(super) value: f64,
    pub(super) color: f32,
}

impl Node {
    /// The mean of some nodes.
    pub(super) fn mean(nodes: impl ExactSizeIterator<Item = Node>) -> Node {
        let weight = 1.0 / nodes.len() as f64;
        let none = Node { position: DVec3::ZERO, value: 0.0, color: 0.0 };
        nodes.fold(none, |sum, n| Node {
            position: sum.position + n.position * weight,
            value: sum.value + n.value * weight,
            color: sum.color + n.color * weight as f32,
        })
    }

    /// The mean of the corners of a face, with the same bits for both cells that have it: they list
    /// its corners from another one, in another direction.
    pub(super) fn mean_of_face(corners: &[Node]) -> Node {
        let mut sorted = corners.to_vec();
        sorted.sort_by(|a, b| {
            let ends = a.position.to_array().into_iter().zip(b.position.to_array());
            ends.map(|(a, b)| a.total_cmp(&b)).fold(std::cmp::Ordering::Equal, |all, o| all.then(o))
        });
        Node::mean(sorted.into_iter())
    }

    /// The place on the edge to a node of a higher value where the field is `iso`.
    fn towards(self, high: Node, iso: f64) -> Node {
        // Both ends are known by their values, so all cells around the edge find the same place.
        let t = (iso - self.value) / (high.value - self.value);
        Node {
            position: self.position + (high.position - self.position) * t,
            value: iso,
            color: self.color + (high.color - self.color) * t as f32,
        }
    }
}

/// Calls `emit` with the triangles of the surface. A node is inside when its value is at or above
/// `iso`. Triangles without two different corners are left out.
pub(super) fn surface_in(nodes: &[Node; 4], iso: f64, emit: &mut impl FnMut([Node; 3])) {
    let (mut low, mut high) = ([nodes[0]; 4], [nodes[0]; 4]);
    let (mut lows, mut highs) = (0, 0);
    for &node in nodes {
        if node.value >= iso {
            high[highs] = node;
            highs += 1;
        } else {
            low[lows] = node;
            lows += 1;
        }
    }
    let (low, high) = (&low[..lows], &high[..highs]);
    let on = |l: usize, h: usize| low[l].towards(high[h], iso);
    let mut triangle = |corners: [Node; 3]| {
        let [a, b, c] = corners.map(|node| node.position);
        if a == b || b == c || c == a {
            return;
        }
        // Counter-clockwise seen from the lower values.
        let up = high[0].position - low[0].position;
        let faces_up = (b - a).cross(c - a).dot(up) > 0.0;
        emit(if faces_up { [corners[0], corners[2], corners[1]] } else { corners });
    };
    match (low.len(), high.len()) {
        (1, 3) => triangle([on(0, 0), on(0, 1), on(0, 2)]),
        (3, 1) => triangle([on(0, 0), on(1, 0), on(2, 0)]),
        (2, 2) => {
            let [a, b, c, d] = [on(0, 0), on(0, 1), on(1, 1), on(1, 0)];
            triangle([a, b, c]);
            triangle([a, c, d]);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(position: DVec3, value: f64) -> Node {
        Node { position, value, color: 2.0 * value as f32 }
    }

    fn unit(values: [f64; 4]) -> Vec<[Node; 3]> {
        let at = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let nodes = std::array::from_fn(|k| corner(at[k], values[k]));
        let mut all = Vec::new();
        surface_in(&nodes, 0.5, &mut |t| all.push(t));
        all
    }

    #[test]
    fn each_case_has_its_triangles_which_face_the_lower_values() {
        for bits in 0..16_u32 {
            let values = [0, 1, 2, 3].map(|k| f64::from(bits >> k & 1));
            let count = [0, 1, 2, 1, 0][bits.count_ones() as usize];
            let found = unit(values);
            assert_eq!(found.len(), count, "{values:?}");
            let at = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
            for [a, b, c] in found {
                let normal = (b.position - a.position).cross(c.position - a.position);
                for (k, place) in at.iter().enumerate() {
                    let side = (*place - a.position).dot(normal);
                    assert!(if values[k] > 0.5 { side < 0.0 } else { side > 0.0 }, "{values:?}");
                }
                assert!([a, b, c].iter().all(|n| n.color == 1.0 && n.value == 0.5));
            }
        }
    }

    #[test]
    fn a_surface_through_a_corner_has_no_triangle_of_one_point() {
        assert!(unit([0.5, 0.0, 0.0, 0.0]).is_empty());
        assert_eq!(unit([0.0, 0.5, 0.5, 0.5]).len(), 1);
    }

    #[test]
    fn the_middle_of_a_face_is_the_same_from_both_sides() {
        let corners: Vec<Node> = (0..5)
            .map(|k| {
                let a = f64::from(k) * 1.3;
                corner(DVec3::new(a.cos(), a.sin(), 0.1 * a), 0.7 * a)
            })
            .collect();
        let middle = Node::mean_of_face(&corners);
        for first in 0..5 {
            let turned: Vec<Node> = (0..5).map(|k| corners[(first + k) % 5]).collect();
            let back: Vec<Node> = turned.iter().rev().copied().collect();
            assert!(Node::mean_of_face(&turned) == middle && Node::mean_of_face(&back) == middle);
        }
    }
}
