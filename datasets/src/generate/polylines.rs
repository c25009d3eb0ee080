//! Polylines with a radius and a scalar at every point, as streamline generators produce them, for
//! rendering as tubes.

use glam::Vec3;
use rt_core::shapes::{Radii, ShapeError, Tubes};

/// Many polylines in flat arrays.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Polylines {
    /// World positions of all lines' points, one line after the other.
    pub points: Vec<Vec3>,
    /// Line i has the points `offsets[i]..offsets[i + 1]`; the first offset is 0, the last
    /// `points.len()`.
    pub offsets: Vec<u32>,
    /// Tube radius at every point, in world units.
    pub radii: Vec<f32>,
    /// A value at every point, for colour.
    pub scalars: Vec<f32>,
}

impl Polylines {
    /// Joins lines, each with its points, radii and scalars.
    pub fn from_lines(lines: Vec<Line>) -> Self {
        let total = lines.iter().map(|l| l.points.len()).sum();
        let mut all = Polylines { offsets: vec![0], ..Default::default() };
        all.points.reserve_exact(total);
        all.radii.reserve_exact(total);
        all.scalars.reserve_exact(total);
        for line in lines {
            all.points.extend(line.points);
            all.radii.extend(line.radii);
            all.scalars.extend(line.scalars);
            all.offsets.push(all.points.len() as u32);
        }
        all
    }

    /// Number of lines.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// True when there are no lines.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of tube segments.
    pub fn num_segments(&self) -> usize {
        self.offsets.windows(2).map(|w| (w[1] - w[0]).saturating_sub(1) as usize).sum()
    }

    /// Converts the lines to rt-core tubes with their radii and scalars.
    pub fn into_tubes(self) -> Result<Tubes, ShapeError> {
        Tubes::new(self.points, &self.offsets, Radii::Each(self.radii))?.with_scalars(self.scalars)
    }
}

/// One polyline with its values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Line {
    /// World positions.
    pub points: Vec<Vec3>,
    /// Tube radii, one per point.
    pub radii: Vec<f32>,
    /// Scalars, one per point.
    pub scalars: Vec<f32>,
}
