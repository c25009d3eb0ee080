//! Delaunay triangulation of points in no order: triangles in a plane, tetrahedra in space.
//!
//! The steps, a file each:
//!
//! 1. [`snap`]: coordinates become integers of 40 bits, so that every sign is exact and cheap.
//! 2. [`hilbert`]: points that are near each other get numbers that are, whatever their order was.
//! 3. [`plane`] (the crate spade), or [`space`]: points enter one by one (Bowyer, Watson 1981).
//!    Cospherical points are decided by [`predicates`] as Devillers and Teillaud (2003) propose.
//! 4. [`gaps`]: cells that bridge a place without points are taken away.
//!
//! Both triangulations fill the convex hull. The result depends on the set of points only, and not
//! on their order.

pub(crate) mod gaps;
mod hilbert;
mod plane;
mod predicates;
pub(crate) mod snap;
mod space;
#[cfg(test)]
mod tests;
mod tetrahedra;

pub(crate) use plane::triangles;
pub(crate) use space::tetrahedra;

/// Why points have no triangulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Degenerate {
    /// All lie on one line, or are one.
    Line,
    /// All lie in one plane.
    Plane,
}
