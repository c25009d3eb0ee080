//! A gas in bricks: its lattice, and the densities that this rank has, read where they are.
use rt_core::glam::{DVec3, UVec3};
use schlieren::march::{Brick, InBricks, Lattice, Undisturbed};
use schlieren::view::View;

/// A gas on a lattice of nodes, without its values. The same on all ranks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gas {
    /// Nodes per axis of the whole.
    pub dims: UVec3,
    /// Position of the first node, metres.
    pub origin_m: DVec3,
    /// Distance of neighbouring nodes, metres.
    pub spacing_m: DVec3,
    /// K of the law of Gladstone and Dale, n = 1 + K rho: 2.26e-4 m³/kg for air.
    pub gladstone_dale_m3_per_kg: f64,
    /// Density of the gas outside, kg/m³, relative to which light is bent.
    pub reference_density: f64,
}

impl Gas {
    pub(super) fn n0(&self) -> f64 {
        1.0 + self.gladstone_dale_m3_per_kg * self.reference_density
    }

    /// # Errors
    /// In words, what is no number.
    pub(super) fn lattice(&self) -> Result<Lattice, String> {
        for (name, value) in [
            ("gladstone_dale_m3_per_kg", self.gladstone_dale_m3_per_kg),
            ("reference_density", self.reference_density),
        ] {
            if !value.is_finite() {
                return Err(format!("{name} of the gas is {value}: give a number"));
            }
        }
        Ok(Lattice {
            dims: self.dims.to_array().map(|n| n as usize),
            spacing_m: self.spacing_m.to_array(),
            origin_m: self.origin_m,
            n0: self.n0(),
        })
    }

    fn size_m(&self) -> DVec3 {
        self.dims.saturating_sub(UVec3::ONE).as_dvec3() * self.spacing_m
    }

    pub(super) fn centre_m(&self) -> DVec3 {
        self.origin_m + 0.5 * self.size_m()
    }

    /// Sides of the rectangle of a picture that shows all of the gas.
    pub(super) fn sides_m(&self, view: &View) -> [f64; 2] {
        [view.right, view.up].map(|axis| axis.abs().dot(self.size_m()))
    }
}

/// Densities at the nodes of a box.
pub trait GasValues: Sync {
    /// The density at a node, counted from the first of the box; not finite where there is no gas.
    fn density(&self, node: UVec3) -> f64;

    /// The densities at `N` nodes that follow each other along x.
    #[inline(always)]
    fn row<const N: usize>(&self, first: UVec3) -> [f64; N] {
        let mut row = [0.0; N];
        for (n, value) in row.iter_mut().enumerate() {
            *value = self.density(UVec3 { x: first.x + n as u32, ..first });
        }
        row
    }
}

/// The box of nodes that one rank has.
#[derive(Clone, Copy, Debug)]
pub struct GasBrick<'a, V> {
    /// The first node in the whole lattice.
    pub first: UVec3,
    /// Nodes per axis, layers for neighbours included.
    pub dims: UVec3,
    /// The densities.
    pub values: &'a V,
}

impl<V> GasBrick<'_, V> {
    /// # Errors
    /// In words, where it does not lie in the gas.
    pub(super) fn check(&self, gas: &Gas) -> Result<(), String> {
        let end = self.first.checked_add(self.dims);
        if end.is_some_and(|end| end.cmple(gas.dims).all()) {
            return Ok(());
        }
        Err(format!(
            "a brick of {} nodes from node {}, but the gas has {} nodes",
            self.dims, self.first, gas.dims
        ))
    }

    /// The cells in which it has all that samples need; none for a brick that is too thin.
    pub(super) fn cells(&self, march: &InBricks) -> [[usize; 3]; 2] {
        let nodes = |v: UVec3| v.to_array().map(|n| n as usize);
        let cells = march.cells_of_nodes(nodes(self.first), nodes(self.first + self.dims));
        let is_empty = (0..3).any(|c| cells[0][c] >= cells[1][c]);
        if is_empty { [[0; 3]; 2] } else { cells }
    }
}

/// Values with any strides in a slice of the program's.
#[derive(Clone, Copy, Debug)]
pub struct Strided<'a, T> {
    values: &'a [T],
    strides: [usize; 3],
}

impl<'a, T: Copy> Strided<'a, T> {
    /// Node (x, y, z) of a box of `dims` nodes is number `x strides[0] + y strides[1] + z
    /// strides[2]` of `values`. `None` if a node lies beyond the end.
    pub fn new(values: &'a [T], dims: UVec3, strides: [usize; 3]) -> Option<Strided<'a, T>> {
        let last = dims.to_array().iter().zip(strides).try_fold(0_usize, |sum, (&n, stride)| {
            sum.checked_add((n.max(1) as usize - 1).checked_mul(stride)?)
        })?;
        (dims.min_element() == 0 || last < values.len()).then_some(Strided { values, strides })
    }
}

impl<T> Strided<'_, T> {
    #[inline(always)]
    fn place(&self, node: UVec3) -> usize {
        let [sx, sy, sz] = self.strides;
        node.x as usize * sx + node.y as usize * sy + node.z as usize * sz
    }
}

impl<T: Copy + Into<f64> + Sync> GasValues for Strided<'_, T> {
    #[inline(always)]
    fn density(&self, node: UVec3) -> f64 {
        self.values[self.place(node)].into()
    }

    #[inline(always)]
    fn row<const N: usize>(&self, first: UVec3) -> [f64; N] {
        let stride = self.strides[0];
        let values = &self.values[self.place(first)..];
        let mut row = [0.0; N];
        match (stride, values.first_chunk::<N>()) {
            (1, Some(values)) => {
                for (value, &number) in row.iter_mut().zip(values) {
                    *value = number.into();
                }
            }
            _ => {
                for (n, value) in row.iter_mut().enumerate() {
                    *value = values[n * stride].into();
                }
            }
        }
        row
    }
}

/// A brick as light sees it.
pub(super) struct Optical<'a, V> {
    brick: &'a GasBrick<'a, V>,
    cells: [[usize; 3]; 2],
    reference_density: f64,
    eps_per_density: f64,
    undisturbed: Option<Undisturbed>,
}

impl<'a, V: GasValues> Optical<'a, V> {
    /// Looks at all values once: on rayon's threads if `parallel`.
    pub(super) fn new(
        gas: &Gas,
        brick: &'a GasBrick<'a, V>,
        cells: [[usize; 3]; 2],
        march: &InBricks,
        parallel: bool,
    ) -> Self {
        let mut optical = Optical {
            brick,
            cells,
            reference_density: gas.reference_density,
            eps_per_density: gas.gladstone_dale_m3_per_kg / gas.n0(),
            undisturbed: None,
        };
        optical.undisturbed = Some(march.undisturbed(&optical, parallel));
        optical
    }
}

impl<V> Optical<'_, V> {
    /// A node of the whole lattice, counted from the first of the brick.
    #[inline(always)]
    fn node(&self, [x, y, z]: [usize; 3]) -> UVec3 {
        UVec3::new(x as u32, y as u32, z as u32) - self.brick.first
    }

    /// n/n0 - 1 = K (rho - rho0) / n0: no difference of two indices near 1.
    #[inline(always)]
    fn of_density(&self, density: f64) -> f64 {
        (density - self.reference_density) * self.eps_per_density
    }
}

impl<V: GasValues> Brick for Optical<'_, V> {
    fn cells(&self) -> [[usize; 3]; 2] {
        self.cells
    }

    #[inline(always)]
    fn is_undisturbed(&self, cell: [usize; 3]) -> bool {
        self.undisturbed.as_ref().is_some_and(|cells| cells.contains(cell))
    }

    #[inline(always)]
    fn eps(&self, node: [usize; 3]) -> f64 {
        self.of_density(self.brick.values.density(self.node(node)))
    }

    #[inline(always)]
    fn row<const N: usize>(&self, first: [usize; 3]) -> [f64; N] {
        let mut row = self.brick.values.row::<N>(self.node(first));
        for value in &mut row {
            *value = self.of_density(*value);
        }
        row
    }
}
