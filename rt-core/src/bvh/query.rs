//! Kinds of ray queries, as types: the compiler makes code of its own for each combination, without
//! branches on the kind.

/// The triangle test of a [`Robustness`](super::Robustness).
pub(crate) trait TriangleTest: Copy {
    /// Whether edge functions that are zero in f32 are computed again in f64.
    const WATERTIGHT: bool;
}

/// The test of [`Robustness::Fast`](super::Robustness::Fast).
#[derive(Debug, Clone, Copy)]
pub(crate) struct FastTest;

/// The test of [`Robustness::Watertight`](super::Robustness::Watertight).
#[derive(Debug, Clone, Copy)]
pub(crate) struct WatertightTest;

impl TriangleTest for FastTest {
    const WATERTIGHT: bool = false;
}

impl TriangleTest for WatertightTest {
    const WATERTIGHT: bool = true;
}

/// What is asked about a ray.
pub(crate) trait HitQuery: Copy {
    /// Whether any hit answers the query, so that the order of visits does not matter.
    const ANY: bool;
}

/// Asks for the closest hit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClosestHit;

/// Asks whether there is a hit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AnyHit;

impl HitQuery for ClosestHit {
    const ANY: bool = false;
}

impl HitQuery for AnyHit {
    const ANY: bool = true;
}
