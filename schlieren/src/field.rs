//! Describes the gas by eps = n/n0 - 1 at the nodes of a uniform lattice.

use glam::DVec3;

/// What a node of the lattice represents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum Node {
    /// Gas with a known index.
    #[default]
    Gas = 0,
    /// No data: blanked by the solver, outside the mesh that was resampled, or not a number.
    Blank = 1,
    /// Inside a solid body; blocks light.
    Solid = 2,
}

/// A uniform lattice of eps, x fastest. Values belong to points, so the field extends from the
/// first node to the last.
#[derive(Debug, Clone)]
pub struct Field {
    dims: [usize; 3],
    spacing_m: [f64; 3],
    origin_m: DVec3,
    eps: Vec<f32>,
    n0: f64,
    nodes: Option<Vec<Node>>,
    not_finite: usize,
    truncation: Vec<f32>,
}

/// Why a lattice cannot be a field.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// Fewer than two nodes along an axis: the field has no depth there.
    #[error(
        "the field has {nodes} node(s) along {axis}; it needs at least 2. Repeat a two-dimensional \
         flow over its span to give it depth"
    )]
    TooFew {
        /// x, y or z.
        axis: char,
        /// Number of nodes given.
        nodes: usize,
    },
    /// More nodes than can be addressed.
    #[error(
        "the field's {0}x{1}x{2} nodes are more than the 2^31 this program can address; resample \
         it coarser or cut it"
    )]
    TooMany(usize, usize, usize),
    /// An array has the wrong length.
    #[error("{what} has {got} values, and the lattice {0}x{1}x{2} has {wanted} \
             nodes", dims[0], dims[1], dims[2])]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The lattice.
        dims: [usize; 3],
        /// Its number of nodes.
        wanted: usize,
    },
    /// A spacing is not a length that light passes.
    #[error(
        "spacing along {axis} is {spacing_m} m; it must be from 1e-12 to 1e12 m. Check the unit of \
         length (length_unit_m in a scene, --length-unit)"
    )]
    Spacing {
        /// x, y or z.
        axis: char,
        /// Spacing given.
        spacing_m: f64,
    },
    /// The origin is not finite.
    #[error("origin ({0}, {1}, {2}) m is not finite")]
    Origin(f64, f64, f64),
    /// The reference index is not a positive number.
    #[error("reference index n0 is {0}; it must be a positive number, about 1 for gases")]
    Reference(f64),
    /// An eps of -1 or less, which means an index of refraction of zero or below.
    #[error("eps is {eps} at node ({0}, {1}, {2}); eps = n/n0 - 1 is above -1. Check the units of \
             the density", at[0], at[1], at[2])]
    Impossible {
        /// The value.
        eps: f32,
        /// Indices of the node.
        at: [usize; 3],
    },
    /// No node has data.
    #[error("all {0} nodes are blank or solid; there is no gas to look through")]
    NoGas(usize),
}

impl Field {
    /// Creates a field from eps = n/n0 - 1 at the nodes, x fastest, and the kinds of the nodes (all
    /// gas when `None`).
    ///
    /// Values that are not finite become [`Node::Blank`] and are counted ([`Field::not_finite`]).
    /// The values of nodes that are not gas are replaced by smooth continuations of the gas around
    /// them, so that interpolants do not ring at their edge.
    ///
    /// # Errors
    /// If sizes do not match or a number is out of range.
    pub fn new(
        dims: [usize; 3],
        spacing_m: [f64; 3],
        origin_m: DVec3,
        mut eps: Vec<f32>,
        n0: f64,
        mut nodes: Option<Vec<Node>>,
    ) -> Result<Field, FieldError> {
        let wanted = check_lattice(dims, spacing_m, origin_m)?;
        if eps.len() != wanted {
            return Err(FieldError::Length { what: "eps", got: eps.len(), dims, wanted });
        }
        if let Some(n) = nodes.as_ref().filter(|n| n.len() != wanted) {
            return Err(FieldError::Length { what: "the mask", got: n.len(), dims, wanted });
        }
        if !(n0 > 0.0 && n0.is_finite()) {
            return Err(FieldError::Reference(n0));
        }

        // Nodes without a finite value have no data.
        let is_marked =
            |nodes: &Option<Vec<Node>>, i: usize| nodes.as_ref().is_some_and(|n| n[i] != Node::Gas);
        let mut not_finite = 0;
        for i in 0..wanted {
            if is_marked(&nodes, i) {
                continue;
            }
            if !eps[i].is_finite() {
                nodes.get_or_insert_with(|| vec![Node::Gas; wanted])[i] = Node::Blank;
                not_finite += 1;
            } else if eps[i] <= -1.0 {
                let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
                return Err(FieldError::Impossible { eps: eps[i], at });
            }
        }
        if nodes.as_ref().is_some_and(|n| n.iter().all(|k| *k == Node::Gas)) {
            nodes = None;
        }
        if let Some(n) = &nodes {
            if !n.contains(&Node::Gas) {
                return Err(FieldError::NoGas(wanted));
            }
            fill(dims, &mut eps, n);
        }
        let truncation = vec![];
        Ok(Field { dims, spacing_m, origin_m, eps, n0, nodes, not_finite, truncation })
    }

    /// Adds by how much eps would differ if the mesh that it comes from were read by a less
    /// accurate reconstruction ([`datasets::resample::ResampledField::truncation`]), x fastest,
    /// from which [`crate::plan::MeasuredError::mesh_rad`] follows. What is not finite is taken as
    /// zero.
    ///
    /// # Errors
    /// If there is not one value for each node.
    pub fn with_truncation(mut self, mut truncation: Vec<f32>) -> Result<Field, FieldError> {
        let (dims, got, wanted) = (self.dims, truncation.len(), self.eps.len());
        if got != wanted {
            return Err(FieldError::Length { what: "the truncation", got, dims, wanted });
        }
        truncation.iter_mut().filter(|t| !t.is_finite()).for_each(|t| *t = 0.0);
        self.truncation = truncation;
        Ok(self)
    }

    /// The truncation as a field of its own, at the same nodes; `None` for a field that comes from
    /// no mesh.
    pub fn truncation(&self) -> Option<Field> {
        if self.truncation.is_empty() {
            return None;
        }
        // Differences of eps are far above -1 wherever they say anything.
        let eps = self.truncation.iter().map(|t| t.max(-0.5)).collect();
        Some(Field {
            dims: self.dims,
            spacing_m: self.spacing_m,
            origin_m: self.origin_m,
            eps,
            n0: self.n0,
            nodes: self.nodes.clone(),
            not_finite: 0,
            truncation: vec![],
        })
    }

    /// Creates a field from a function of position in metres.
    ///
    /// # Errors
    /// As [`Field::new`].
    pub fn from_fn(
        dims: [usize; 3],
        spacing_m: [f64; 3],
        origin_m: DVec3,
        n0: f64,
        eps: impl Fn(DVec3) -> f64 + Sync,
    ) -> Result<Field, FieldError> {
        use rayon::prelude::*;
        let count = dims[0].saturating_mul(dims[1]).saturating_mul(dims[2]);
        if count >= 0x8000_0000 {
            return Err(FieldError::TooMany(dims[0], dims[1], dims[2]));
        }
        let mut values = vec![0.0f32; count];
        values.par_chunks_mut(dims[0].max(1)).enumerate().for_each(|(row, out)| {
            let (j, k) = (row % dims[1], row / dims[1]);
            for (i, v) in out.iter_mut().enumerate() {
                let at = DVec3::new(i as f64, j as f64, k as f64) * DVec3::from(spacing_m);
                *v = eps(origin_m + at) as f32;
            }
        });
        Field::new(dims, spacing_m, origin_m, values, n0, None)
    }

    /// Number of nodes along x, y and z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Distance between nodes along x, y and z.
    pub fn spacing_m(&self) -> [f64; 3] {
        self.spacing_m
    }

    /// Position of the first node.
    pub fn origin_m(&self) -> DVec3 {
        self.origin_m
    }

    /// Size from the first to the last node.
    pub fn size_m(&self) -> DVec3 {
        let cells = DVec3::new(
            (self.dims[0] - 1) as f64,
            (self.dims[1] - 1) as f64,
            (self.dims[2] - 1) as f64,
        );
        cells * DVec3::from(self.spacing_m)
    }

    /// Centre of the field.
    pub fn centre_m(&self) -> DVec3 {
        self.origin_m + 0.5 * self.size_m()
    }

    /// eps = n/n0 - 1 at the nodes, x fastest. All values are finite: nodes that are not gas hold
    /// continued values.
    pub fn eps(&self) -> &[f32] {
        &self.eps
    }

    /// Index of refraction of the reference medium outside the field.
    pub fn n0(&self) -> f64 {
        self.n0
    }

    /// Kinds of the nodes; `None` when all are gas.
    pub fn nodes(&self) -> Option<&[Node]> {
        self.nodes.as_deref()
    }

    /// Number of nodes of a kind.
    pub fn count(&self, kind: Node) -> usize {
        match &self.nodes {
            Some(n) => n.iter().filter(|k| **k == kind).count(),
            None if kind == Node::Gas => self.eps.len(),
            None => 0,
        }
    }

    /// Number of values that were NaN or infinite and became [`Node::Blank`].
    pub fn not_finite(&self) -> usize {
        self.not_finite
    }

    /// Memory of the arrays in bytes.
    pub fn memory_bytes(&self) -> usize {
        (self.eps.len() + self.truncation.len()) * size_of::<f32>()
            + self.nodes.as_ref().map_or(0, Vec::len)
    }
}

/// Lengths of steps and cells: far below a wavelength of light and far beyond any test section.
/// With steps that are shorter by hundreds of digits, marches do not end.
pub(crate) const LENGTHS_M: std::ops::RangeInclusive<f64> = 1e-12..=1e12;

/// Checks a lattice and returns its number of nodes.
pub(crate) fn check_lattice(
    dims: [usize; 3],
    spacing_m: [f64; 3],
    origin_m: DVec3,
) -> Result<usize, FieldError> {
    for (axis, c) in ['x', 'y', 'z'].into_iter().zip(0..3) {
        if dims[c] < 2 {
            return Err(FieldError::TooFew { axis, nodes: dims[c] });
        }
        if !LENGTHS_M.contains(&spacing_m[c]) {
            return Err(FieldError::Spacing { axis, spacing_m: spacing_m[c] });
        }
    }
    if !origin_m.is_finite() {
        return Err(FieldError::Origin(origin_m.x, origin_m.y, origin_m.z));
    }
    // Interpolants add a border of up to three nodes and use i32 addresses.
    let nodes = dims.iter().try_fold(1usize, |n, d| n.checked_mul(*d));
    let padded = dims.iter().try_fold(1usize, |n, d| n.checked_mul(d.checked_add(4)?));
    match (nodes, padded) {
        (Some(nodes), Some(..0x8000_0000)) => Ok(nodes),
        _ => Err(FieldError::TooMany(dims[0], dims[1], dims[2])),
    }
}

/// Fills nodes that are not gas with the mean of their known neighbours, layer by layer from the
/// gas inwards.
pub(crate) fn fill(dims: [usize; 3], eps: &mut [f32], nodes: &[Node]) {
    let [nx, ny, nz] = dims;
    let stride = [1, nx, nx * ny];
    let mut known: Vec<bool> = nodes.iter().map(|k| *k == Node::Gas).collect();
    let neighbours = |i: usize| {
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        let size = [nx, ny, nz];
        (0..3).flat_map(move |c| {
            let lower = (at[c] > 0).then(|| i - stride[c]);
            let upper = (at[c] + 1 < size[c]).then(|| i + stride[c]);
            [lower, upper].into_iter().flatten()
        })
    };
    let mut layer: Vec<usize> =
        (0..eps.len()).filter(|&i| !known[i] && neighbours(i).any(|j| known[j])).collect();
    while !layer.is_empty() {
        // A layer depends only on earlier layers, so the order within it does not matter.
        let values: Vec<f32> = layer
            .iter()
            .map(|&i| {
                let (sum, n) = neighbours(i)
                    .filter(|&j| known[j])
                    .fold((0.0f64, 0.0), |(s, n), j| (s + f64::from(eps[j]), n + 1.0));
                (sum / n) as f32
            })
            .collect();
        for (&i, v) in layer.iter().zip(values) {
            eps[i] = v;
            known[i] = true;
        }
        let mut next: Vec<usize> =
            layer.iter().flat_map(|&i| neighbours(i)).filter(|&j| !known[j]).collect();
        next.sort_unstable();
        next.dedup();
        layer = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(dims: [usize; 3]) -> Vec<f32> {
        (0..dims[0] * dims[1] * dims[2]).map(|i| 1e-4 * i as f32).collect()
    }

    #[test]
    fn nan_and_infinite_nodes_become_blank_and_are_counted() {
        let dims = [5, 4, 3];
        let mut eps = ramp(dims);
        eps[7] = f32::NAN;
        eps[8] = f32::INFINITY;
        eps[9] = f32::NEG_INFINITY;
        let f = Field::new(dims, [1.0; 3], DVec3::ZERO, eps, 1.0, None).unwrap();
        assert_eq!((f.not_finite(), f.count(Node::Blank), f.count(Node::Gas)), (3, 3, 57));
        assert!(f.eps().iter().all(|e| e.is_finite()));
    }

    #[test]
    fn values_continue_into_solids_of_any_depth() {
        let dims = [9, 9, 9];
        let mut nodes = vec![Node::Gas; 729];
        for k in 1..8 {
            for j in 1..8 {
                for i in 1..8 {
                    nodes[(k * 9 + j) * 9 + i] = Node::Solid;
                }
            }
        }
        let mut eps = vec![2.5e-4; 729];
        for (e, n) in eps.iter_mut().zip(&nodes) {
            if *n == Node::Solid {
                *e = 1e30;
            }
        }
        let f = Field::new(dims, [1.0; 3], DVec3::ZERO, eps, 1.0, Some(nodes)).unwrap();
        assert_eq!(f.count(Node::Solid), 343);
        assert!(f.eps().iter().all(|e| *e == 2.5e-4));
    }

    #[test]
    fn impossible_fields_are_refused_with_a_cure() {
        let ok = |d: [usize; 3]| vec![0.0; d.iter().product()];
        let err = |d, h, e, n0| Field::new(d, h, DVec3::ZERO, e, n0, None).unwrap_err().to_string();
        assert!(err([4, 4, 1], [1.0; 3], ok([4, 4, 1]), 1.0).contains("1 node(s) along z"));
        assert!(err([4, 4, 4], [1.0; 3], ok([4, 4, 3]), 1.0).contains("48 values"));
        assert!(err([4, 4, 4], [1.0, -1.0, 1.0], ok([4, 4, 4]), 1.0).contains("along y"));
        assert!(err([4, 4, 4], [1.0, f64::NAN, 1.0], ok([4, 4, 4]), 1.0).contains("NaN"));
        for spacing_m in [1e-300, 1e300, f64::INFINITY, 0.0] {
            let message = err([4, 4, 4], [1.0, 1.0, spacing_m], ok([4, 4, 4]), 1.0);
            assert!(message.contains("along z") && message.contains("--length-unit"), "{message}");
        }
        assert!(err([4, 4, 4], [1.0; 3], ok([4, 4, 4]), 0.0).contains("n0 is 0"));
        assert!(err([4, 4, 4], [1.0; 3], vec![-1.0; 64], 1.0).contains("-1"));
        assert!(err([4, 4, 4], [1.0; 3], vec![f32::NAN; 64], 1.0).contains("no gas"));
        let huge = Field::new([usize::MAX / 2, 4, 4], [1.0; 3], DVec3::ZERO, vec![], 1.0, None)
            .unwrap_err();
        assert!(matches!(huge, FieldError::TooMany(..)));
    }
}
