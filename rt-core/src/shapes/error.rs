//! Errors for shapes that cannot be made, and the report of primitives that were left out.

/// Invalid input for a shape.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// An array has the wrong number of values.
    #[error("{shape}: `{field}` has {found} values; give one per {per}, {expected} in all")]
    Length {
        /// Name of the shape.
        shape: &'static str,
        /// Name of the array.
        field: &'static str,
        /// The elements that the values belong to.
        per: &'static str,
        /// Number of values needed.
        expected: usize,
        /// Number of values found.
        found: usize,
    },
    /// There are more primitives than 32-bit ids can number.
    #[error("{shape}: {found} primitives; at most {limit} fit in one shape: split it into several")]
    TooLarge {
        /// Name of the shape.
        shape: &'static str,
        /// Number of primitives.
        found: usize,
        /// Largest number of primitives.
        limit: usize,
    },
    /// The offsets of the polylines do not describe consecutive runs of points.
    #[error(
        "tubes: offsets[{index}] is {value}; offsets start at 0, never decrease and end at the \
         number of points, {points}"
    )]
    Offsets {
        /// Index into the offsets.
        index: usize,
        /// The value there, or the last value when the end is missing.
        value: usize,
        /// Number of points.
        points: usize,
    },
    /// The grid has no cells.
    #[error(
        "{shape}: the grid has {dims} points; it needs at least 2 along each axis to have cells"
    )]
    NoCells {
        /// Name of the shape.
        shape: &'static str,
        /// Points per axis.
        dims: glam::UVec3,
    },
    /// A value is outside the range that the shape can use.
    #[error("{shape}: {field} is {value}; it must be {rule}")]
    Value {
        /// Name of the shape.
        shape: &'static str,
        /// Name of the parameter.
        field: &'static str,
        /// The value found.
        value: f32,
        /// What is allowed.
        rule: &'static str,
    },
}

/// Counts of primitives that were left out. They have empty bounds; the rest is rendered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ShapeReport {
    /// Primitives given.
    pub primitives: usize,
    /// Left out: a NaN or infinite position or radius, or coordinates whose bounds overflow f32.
    pub non_finite: usize,
    /// Left out: a negative radius, or nothing but radii of zero.
    pub no_radius: usize,
    /// Rendered, but degenerate: tube segments of zero length or with one end inside the other
    /// (drawn as one sphere), polylines of a single point (no segment at all), cylinders of zero
    /// length (left out).
    pub degenerate: usize,
}

impl ShapeReport {
    /// Primitives that cannot be hit.
    pub fn skipped(&self) -> usize {
        self.non_finite + self.no_radius
    }
}

pub(super) fn check_length(
    shape: &'static str,
    field: &'static str,
    per: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), ShapeError> {
    if found == expected {
        Ok(())
    } else {
        Err(ShapeError::Length { shape, field, per, expected, found })
    }
}

pub(super) fn check_count(shape: &'static str, found: usize) -> Result<(), ShapeError> {
    let limit = (u32::MAX - 1) as usize;
    if found <= limit { Ok(()) } else { Err(ShapeError::TooLarge { shape, found, limit }) }
}
