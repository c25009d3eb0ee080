//! A tree of boxes around draws, for rays that may hit any of them.
//!
//! A frame of a molecule has thousands of draws, and a ray meets the boxes of few. The boxes are in
//! eye space, which all draws share, so a ray is moved into a draw's own space only where it may
//! hit something. Nodes stand in the order of a depth-first walk and know where their subtree ends,
//! so that a walk needs no stack.

use rt_core::glam::DVec3;

/// The most draws of a leaf.
const LEAF: usize = 2;

/// An axis-parallel box: its least and its greatest corner.
pub(super) type Corners = [DVec3; 2];

/// A node: a box, and the draws inside.
#[derive(Debug)]
struct Node {
    corners: Corners,
    /// The node after the subtree.
    end: usize,
    /// The draws of a leaf, as a range of [`DrawTree::order`]; empty for inner nodes.
    first: usize,
    count: usize,
}

/// The tree. Draws are numbered as their boxes were given.
#[derive(Debug, Default)]
pub(crate) struct DrawTree {
    nodes: Vec<Node>,
    order: Vec<usize>,
}

fn joined(a: Corners, b: Corners) -> Corners {
    [a[0].min(b[0]), a[1].max(b[1])]
}

impl DrawTree {
    /// The tree of these boxes. One that is not finite is met by every ray.
    pub(super) fn new(boxes: &[Corners]) -> DrawTree {
        let everywhere = [DVec3::NEG_INFINITY, DVec3::INFINITY];
        let is_known = |b: &Corners| b.iter().all(|v| v.is_finite());
        let boxes: Vec<Corners> =
            boxes.iter().map(|b| if is_known(b) { *b } else { everywhere }).collect();
        let mut tree = DrawTree { nodes: Vec::new(), order: (0..boxes.len()).collect() };
        if !boxes.is_empty() {
            tree.split(&boxes, 0, boxes.len());
        }
        tree
    }

    /// Adds the subtree of `order[first..end]`, which is not empty.
    fn split(&mut self, boxes: &[Corners], first: usize, end: usize) {
        let members = &mut self.order[first..end];
        let corners =
            members.iter().map(|i| boxes[*i]).reduce(joined).expect("a subtree has draws");
        let node = self.nodes.len();
        let count = if members.len() <= LEAF { members.len() } else { 0 };
        if count == 0 {
            let size = corners[1] - corners[0];
            let axis = (0..3).fold(0, |a, k| if size[k] > size[a] { k } else { a });
            let middle = |i: &usize| boxes[*i][0][axis] + boxes[*i][1][axis];
            // Ties by number, so that the tree is the same for the same draws.
            members.sort_by(|a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
        }
        self.nodes.push(Node { corners, end: 0, first, count });
        if count == 0 {
            let half = first + (end - first) / 2;
            self.split(boxes, first, half);
            self.split(boxes, half, end);
        }
        self.nodes[node].end = self.nodes.len();
    }

    /// True when `hits` is, for any draw whose box the ray meets from `from` on, up to `most` times
    /// `dir`.
    pub(super) fn any(
        &self,
        from: DVec3,
        dir: DVec3,
        most: f64,
        mut hits: impl FnMut(usize) -> bool,
    ) -> bool {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !meets(&node.corners, from, dir, most) {
                at = node.end;
                continue;
            }
            if self.order[node.first..node.first + node.count].iter().any(|i| hits(*i)) {
                return true;
            }
            at += 1;
        }
        false
    }
}

/// Slab test (Kay and Kajiya 1986). A ray within a face counts as inside.
fn meets([lo, hi]: &Corners, from: DVec3, dir: DVec3, most: f64) -> bool {
    let (mut t0, mut t1) = (0.0_f64, most);
    for k in 0..3 {
        if dir[k] == 0.0 {
            // The quotients could be 0 by 0.
            if !(lo[k]..=hi[k]).contains(&from[k]) {
                return false;
            }
            continue;
        }
        let (a, b) = ((lo[k] - from[k]) / dir[k], (hi[k] - from[k]) / dir[k]);
        t0 = t0.max(a.min(b));
        t1 = t1.min(a.max(b));
    }
    t0 <= t1
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::math::SplitMix64;

    /// A lattice of boxes of half the lattice's step.
    fn lattice(n: i32) -> Vec<Corners> {
        let axis = || 0..n;
        let at = |x, y, z| DVec3::new(f64::from(x), f64::from(y), f64::from(z));
        axis()
            .flat_map(|x| axis().flat_map(move |y| axis().map(move |z| (x, y, z))))
            .map(|(x, y, z)| [at(x, y, z), at(x, y, z) + DVec3::splat(0.5)])
            .collect()
    }

    #[test]
    fn a_ray_asks_the_draws_whose_boxes_it_meets_and_no_others() {
        let boxes = lattice(16);
        let tree = DrawTree::new(&boxes);
        let mut random = SplitMix64::new(7);
        let mut point = |size: f64| DVec3::from_array([0; 3].map(|_| size * random.unit()));
        let mut most_asked = 0;
        for _ in 0..200 {
            let (from, to) = (point(16.0), point(16.0));
            let mut asked = Vec::new();
            assert!(!tree.any(from, to - from, 1.0, |i| {
                asked.push(i);
                false
            }));
            let met = |b: &Corners| meets(b, from, to - from, 1.0);
            assert!(boxes.iter().enumerate().all(|(i, b)| !met(b) || asked.contains(&i)));
            most_asked = most_asked.max(asked.len());
        }
        assert!(most_asked < 100, "{most_asked} of {} draws", boxes.len());
    }

    #[test]
    fn rays_along_faces_and_boxes_without_bounds_are_met() {
        let mut boxes = lattice(2);
        boxes.push([DVec3::NAN, DVec3::ONE]);
        let tree = DrawTree::new(&boxes);
        let mut asked = Vec::new();
        tree.any(DVec3::new(-1.0, 0.0, 0.5), DVec3::X, f64::INFINITY, |i| {
            asked.push(i);
            false
        });
        for expected in [0, 4, 8] {
            assert!(asked.contains(&expected), "{asked:?}");
        }
        assert!(!DrawTree::new(&[]).any(DVec3::ZERO, DVec3::X, 1.0, |_| true));
    }
}
