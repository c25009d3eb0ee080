//! Stores a property of a medium at the nodes of a lattice of its own.

use crate::field::{Field, FieldError, Node, check_lattice, fill};
use crate::interpolate::{Interpolate, Trilinear};
use glam::DVec3;
use std::borrow::Cow;

/// A property on a uniform lattice, trilinear between the nodes and constant beyond the outermost.
/// The lattice may differ from that of the [`Field`].
#[derive(Debug)]
pub struct Volume {
    pub(super) values: Trilinear<'static>,
    dims: [usize; 3],
    pub(super) spacing_m: DVec3,
    pub(super) origin_m: DVec3,
    range: [f32; 2],
    repairs: Repairs,
}

/// Counts of invalid values that were replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Repairs {
    /// NaN or infinite values, which are continued from their neighbours.
    pub not_finite: usize,
    /// Invalid values below zero, which are set to zero.
    pub negative: usize,
}

impl Volume {
    /// Makes a property from its values at the nodes, x fastest. Nodes marked in `unknown` (outside
    /// the flow, inside a body) are continued from the nodes around them, so that the property does
    /// not fade towards a wall. Values that are not finite are treated in the same way and counted.
    ///
    /// # Errors
    /// If sizes do not match, if the lattice is invalid, or if no value is finite.
    pub fn new(
        dims: [usize; 3],
        spacing_m: [f64; 3],
        origin_m: DVec3,
        mut values: Vec<f32>,
        unknown: Option<&[bool]>,
    ) -> Result<Volume, FieldError> {
        let wanted = check_lattice(dims, spacing_m, origin_m)?;
        for (what, got) in
            [("the property", values.len()), ("the mask", unknown.map_or(wanted, <[bool]>::len))]
        {
            if got != wanted {
                return Err(FieldError::Length { what, got, dims, wanted });
            }
        }
        let masked = |i: usize| unknown.is_some_and(|u| u[i]);
        let not_finite = (0..wanted).filter(|&i| !masked(i) && !values[i].is_finite()).count();
        if not_finite > 0 || unknown.is_some_and(|u| u.contains(&true)) {
            let known = |i: usize| !masked(i) && values[i].is_finite();
            let nodes: Vec<Node> =
                (0..wanted).map(|i| if known(i) { Node::Gas } else { Node::Blank }).collect();
            if !nodes.contains(&Node::Gas) {
                return Err(FieldError::NoGas(wanted));
            }
            fill(dims, &mut values, &nodes);
        }
        Ok(Volume::of(
            dims,
            DVec3::from(spacing_m),
            origin_m,
            values,
            Repairs { not_finite, negative: 0 },
        ))
    }

    fn of(
        dims: [usize; 3],
        spacing_m: DVec3,
        origin_m: DVec3,
        values: Vec<f32>,
        repairs: Repairs,
    ) -> Volume {
        let range = values
            .iter()
            .fold([f32::INFINITY, f32::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
        Volume {
            values: Trilinear::of(Cow::Owned(values), dims),
            dims,
            spacing_m,
            origin_m,
            range,
            repairs,
        }
    }

    /// Makes a property with the same value everywhere in a field.
    ///
    /// # Errors
    /// If the value is not finite.
    pub fn uniform(value: f64, field: &Field) -> Result<Volume, FieldError> {
        Volume::new(
            [2; 3],
            field.size_m().to_array(),
            field.origin_m(),
            vec![value as f32; 8],
            None,
        )
    }

    /// Makes a property from a function of the position in metres.
    ///
    /// # Errors
    /// As [`Volume::new`].
    pub fn from_fn(
        dims: [usize; 3],
        spacing_m: [f64; 3],
        origin_m: DVec3,
        value: impl Fn(DVec3) -> f64,
    ) -> Result<Volume, FieldError> {
        let count = check_lattice(dims, spacing_m, origin_m)?;
        let at = |i: usize| {
            let [x, y, z] =
                [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]].map(|c| c as f64);
            origin_m + DVec3::new(x, y, z) * DVec3::from(spacing_m)
        };
        Volume::new(
            dims,
            spacing_m,
            origin_m,
            (0..count).map(|i| value(at(i)) as f32).collect(),
            None,
        )
    }

    /// Replaces values below zero by zero.
    pub(super) fn without_negatives(self) -> Volume {
        if self.range[0] >= 0.0 {
            return self;
        }
        let mut values = self.values.nodes();
        let negative = values.iter().filter(|v| **v < 0.0).count();
        values.iter_mut().for_each(|v| *v = v.max(0.0));
        let repairs = Repairs { negative, ..self.repairs };
        Volume::of(self.dims, self.spacing_m, self.origin_m, values, repairs)
    }

    /// Number of nodes along x, y and z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Distance of nodes along x, y and z in metres.
    pub fn spacing_m(&self) -> DVec3 {
        self.spacing_m
    }

    /// Place of the first node in metres.
    pub fn origin_m(&self) -> DVec3 {
        self.origin_m
    }

    /// The values at the nodes, x fastest.
    #[cfg(feature = "gpu")]
    pub(crate) fn nodes(&self) -> Vec<f32> {
        self.values.nodes()
    }

    /// Smallest and largest value.
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// Counts of the values that were replaced.
    pub fn repairs(&self) -> Repairs {
        self.repairs
    }

    /// The value at a point in metres.
    pub fn sample(&self, at_m: DVec3) -> f64 {
        self.values.sample(((at_m - self.origin_m) / self.spacing_m).to_array()).eps
    }

    /// Memory in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.values.memory_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::{Media, Property};

    fn volume(values: Vec<f32>, unknown: Option<&[bool]>) -> Result<Volume, FieldError> {
        Volume::new([3, 3, 3], [0.5; 3], DVec3::ONE, values, unknown)
    }

    #[test]
    fn nan_is_continued_and_negative_is_zero_and_both_are_counted() {
        let mut values = vec![2.0; 27];
        values[13] = f32::NAN;
        values[0] = f32::INFINITY;
        values[26] = -1.0;
        let media =
            Media::default().with(Property::Absorption, volume(values.clone(), None).unwrap());
        let v = media.get(Property::Absorption).unwrap();
        assert_eq!(v.repairs(), Repairs { not_finite: 2, negative: 1 });
        assert_eq!((v.range(), v.sample(DVec3::splat(1.5))), ([0.0, 2.0], 2.0));
        let warnings = media.warnings();
        assert!(warnings[0].contains("media.absorption: 2 of 27"), "{warnings:?}");
        assert!(warnings[1].contains("1 of 27 values are below 0"), "{warnings:?}");
        // A rotation may have either sign.
        let media = Media::default().with(Property::Rotation, volume(values, None).unwrap());
        assert_eq!(media.get(Property::Rotation).unwrap().range(), [-1.0, 2.0]);
    }

    #[test]
    fn bodies_do_not_dim_the_smoke_beside_them() {
        let mut inside = vec![false; 27];
        inside[13] = true;
        let mut values = vec![4.0; 27];
        values[13] = 0.0;
        let v = volume(values, Some(&inside)).unwrap();
        assert_eq!((v.sample(DVec3::splat(1.4)), v.repairs()), (4.0, Repairs::default()));
    }

    #[test]
    fn impossible_volumes_are_refused() {
        assert!(volume(vec![0.0; 26], None).unwrap_err().to_string().contains("26 values"));
        assert!(volume(vec![f32::NAN; 27], None).is_err());
        assert!(Volume::new([1, 3, 3], [1.0; 3], DVec3::ZERO, vec![0.0; 9], None).is_err());
    }
}
