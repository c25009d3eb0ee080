//! Some primitives of another shape.

use super::{Shape, ShapeHit, ShapeSurface};
use crate::math::Aabb;
use crate::ray::Ray;
use glam::DVec3;
use std::sync::Arc;

/// Some primitives of a shape, in ascending order. The data are shared with the shape.
#[derive(Clone)]
pub struct ShapePart {
    shape: Arc<dyn Shape>,
    primitives: Vec<u32>,
}

impl ShapePart {
    /// The primitives of `shape` whose numbers are in `primitives`; numbers out of range are
    /// ignored.
    pub fn new(shape: Arc<dyn Shape>, mut primitives: Vec<u32>) -> ShapePart {
        let count = shape.num_primitives();
        primitives.retain(|&p| (p as usize) < count);
        ShapePart { shape, primitives }
    }
}

impl Shape for ShapePart {
    fn num_primitives(&self) -> usize {
        self.primitives.len()
    }

    fn origin(&self) -> DVec3 {
        self.shape.origin()
    }

    fn bounds(&self, prim: u32) -> Aabb {
        self.shape.bounds(self.primitives[prim as usize])
    }

    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        self.shape.closest(self.primitives[prim as usize], ray)
    }

    fn occluded(&self, prim: u32, ray: &Ray) -> bool {
        self.shape.occluded(self.primitives[prim as usize], ray)
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        self.shape.surface(self.primitives[prim as usize], hit, ray)
    }

    fn has_transparency(&self) -> bool {
        self.shape.has_transparency()
    }

    fn is_costly(&self) -> bool {
        self.shape.is_costly()
    }

    fn failure(&self) -> Option<String> {
        self.shape.failure()
    }
}
