//! The field of a contour at the points of a data set.

use super::ContourReport;
use super::solids::{Copies, each_solid, number_of_points};
use crate::model::{ColorBy, Dataset};
use glam::DVec3;

/// Values at points.
pub(super) enum PointValues {
    Each(Vec<f64>),
    /// Signed distances from a plane.
    Distances {
        point: DVec3,
        normal: DVec3,
    },
}

impl PointValues {
    /// Those of an array; `None` for a data set without it.
    pub(super) fn of(leaf: &Dataset, by: &ColorBy) -> Option<PointValues> {
        let array = by.array(leaf.attributes()?)?;
        let value = |i: usize| match by.component {
            Some(c) => array.get(i, c),
            None => array.magnitude(i),
        };
        if by.per_point {
            return Some(PointValues::Each((0..array.tuples()).map(value).collect()));
        }
        // Copies of other processes' cells count too: with them, points between two processes have
        // the same mean on both.
        let mut sums = vec![(0.0, 0_u32); number_of_points(leaf)];
        each_solid(leaf, Copies::Visited, &mut ContourReport::default(), |number, cell| {
            for &id in cell.corners {
                let sum = &mut sums[id as usize];
                *sum = (sum.0 + value(number), sum.1 + 1);
            }
            true
        });
        let mean = |(sum, count): (f64, u32)| sum / f64::from(count);
        Some(PointValues::Each(sums.into_iter().map(mean).collect()))
    }

    /// The value at a point with this number and position.
    #[inline]
    pub(super) fn at(&self, id: usize, position: DVec3) -> f64 {
        match self {
            PointValues::Each(values) => values[id],
            PointValues::Distances { point, normal } => (position - *point).dot(*normal),
        }
    }
}
