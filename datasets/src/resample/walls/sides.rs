//! The sides of the box of a mesh, in which its border is open.

use crate::resample::mesh::Mesh;
use glam::DVec3;

/// Points nearer to a side of the box than this part of its size lie in it.
const ON_SIDE: f64 = 1e-6;

/// The sides of the mesh's box.
pub(super) struct Sides {
    low: DVec3,
    high: DVec3,
    near: DVec3,
    /// Whether a border that ends at the low or high side of an axis is open there.
    open: [[bool; 2]; 3],
    revolved: bool,
}

impl Sides {
    /// With `revolved`, a border that ends at the axis of x is closed by its revolution.
    pub(super) fn of(mesh: &Mesh, revolved: bool) -> Sides {
        let (low, high) = mesh.bounds();
        let near = ON_SIDE * (high - low);
        // Along the depth of a plane, and of cells over a plane, all points lie in a side. What
        // ends there is closed by the same flow beyond.
        let mut open = [0, 1, 2].map(|axis| {
            let between = |i: usize| {
                let x = mesh.point(i)[axis];
                x - low[axis] > near[axis] && high[axis] - x > near[axis]
            };
            [(0..mesh.num_points()).any(between); 2]
        });
        open[1][0] &= !revolved;
        Sides { low, high, near, open, revolved }
    }

    /// The low and high sides of each axis, of those at which a border is open, in which a point
    /// lies.
    pub(super) fn touched(&self, p: DVec3) -> [[bool; 2]; 3] {
        [0, 1, 2].map(|a| {
            let at = [p[a] - self.low[a], self.high[a] - p[a]];
            [0, 1].map(|side| self.open[a][side] && at[side] <= self.near[a])
        })
    }

    /// The place of a side along its axis.
    pub(super) fn place(&self, axis: usize, side: usize) -> f64 {
        [self.low, self.high][side][axis]
    }

    /// Where parts of the border are closed along an axis, although they do not touch themselves.
    pub(super) fn mirror(&self, axis: usize) -> Option<f64> {
        (self.revolved && axis == 1).then_some(self.low.y)
    }

    /// Whether all corners of a face lie in one side of the box.
    pub(super) fn hold(&self, mesh: &Mesh, ids: impl Iterator<Item = u32> + Clone) -> bool {
        (0..3).any(|a| {
            let x = || ids.clone().map(|i| mesh.point(i as usize)[a]);
            x().all(|x| x - self.low[a] <= self.near[a])
                || x().all(|x| self.high[a] - x <= self.near[a])
        })
    }

    /// Whether all corners of a face lie in the largest or in the least radius of a flow that will
    /// be revolved.
    pub(super) fn hold_around_axis(
        &self,
        mesh: &Mesh,
        ids: impl Iterator<Item = u32> + Clone,
    ) -> bool {
        let y = || ids.clone().map(|i| mesh.point(i as usize).y);
        self.revolved
            && (y().all(|y| self.high.y - y <= self.near.y)
                || self.low.y > self.near.y && y().all(|y| y - self.low.y <= self.near.y))
    }
}

/// Whether a face is the polygon itself of a plane that got depth.
pub(super) fn is_face_of_plane(mesh: &Mesh, mut ids: impl Iterator<Item = u32>) -> bool {
    let Some(first) = ids.next().and_then(|i| mesh.side_of_plane(i as usize)) else { return false };
    ids.all(|i| mesh.side_of_plane(i as usize) == Some(first))
}
