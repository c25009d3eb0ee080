//! Centres and second moments of cells, which averages over cells depend on.

use super::Symmetry;
use crate::resample::mesh::{Corners, Mesh};
use glam::DVec3;
use rayon::prelude::*;

/// Moments of all cells.
pub(super) struct CellMoments {
    cells: Vec<Moments>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    /// Centre of volume; not finite for cells without volume and for hidden ones.
    pub(super) centre: DVec3,
    /// Mean of the squares and products of the distances from the centre: xx, xy, xz, yy, yz, zz.
    pub(super) second: [f64; 6],
}

const NO_VOLUME: Moments = Moments { centre: DVec3::NAN, second: [0.0; 6] };

impl CellMoments {
    pub(super) fn of(mesh: &Mesh, symmetry: Symmetry) -> CellMoments {
        let moments = |cell: usize| match (mesh.is_hidden(cell), symmetry) {
            (true, _) => NO_VOLUME,
            (false, Symmetry::None) => of_cell(mesh, &mesh.corners(cell)),
            (false, Symmetry::Rings | Symmetry::Axis) => {
                of_cell(mesh, &mesh.corners(cell)).of_ring()
            }
        };
        CellMoments { cells: (0..mesh.num_cells()).into_par_iter().map(moments).collect() }
    }

    pub(super) fn is_sound(&self, cell: usize) -> bool {
        self.cells[cell].centre.is_finite()
    }

    pub(super) fn get(&self, cell: usize) -> Moments {
        self.cells[cell]
    }
}

impl Moments {
    /// Those of the ring that the cell sweeps about the axis y = 0, with the radius as the weight
    /// of each place. Exact for cells with a centre of symmetry.
    fn of_ring(self) -> Moments {
        let Moments { centre, mut second } = self;
        let [_, xy, _, yy, yz, _] = second;
        let step = DVec3::new(xy, yy, yz) / centre.y;
        if centre.y <= 0.0 || !step.is_finite() {
            return self;
        }
        add_products(&mut second, step, -1.0);
        Moments { centre: centre + step, second }
    }
}

/// Sums over the tetrahedra between the middle of the cell, the middles of its faces and its edges.
fn of_cell(mesh: &Mesh, corners: &Corners) -> Moments {
    let place = |i: u32| mesh.point(corners.ids[i as usize] as usize);
    let middle = corners.ids.iter().map(|&id| mesh.point(id as usize)).sum::<DVec3>()
        / corners.ids.len() as f64;
    let (mut volume, mut first, mut second) = (0.0, DVec3::ZERO, [0.0; 6]);
    corners.shape.each_face(|face| {
        let on_face = face.iter().map(|&i| place(i)).sum::<DVec3>() / face.len() as f64;
        for (n, &i) in face.iter().enumerate() {
            // Relative to the middle, so that no digits are lost far from the origin.
            let at = [on_face, place(i), place(face[(n + 1) % face.len()])].map(|p| p - middle);
            let share = at[0].cross(at[1]).dot(at[2]).abs() / 6.0;
            let mean = (at[0] + at[1] + at[2]) / 4.0;
            volume += share;
            first += share * mean;
            // The covariance of a tetrahedron is a twentieth of the sum of its corners' products;
            // about the middle, the square of its own mean is added.
            let spread = [DVec3::ZERO, at[0], at[1], at[2]].map(|p| (p - mean, share / 20.0));
            for (d, weight) in spread.into_iter().chain([(mean, share)]) {
                add_products(&mut second, d, weight);
            }
        }
    });
    if !(volume > 0.0 && volume.is_finite()) {
        return NO_VOLUME;
    }
    let mean = first / volume;
    let mut second = second.map(|s| s / volume);
    add_products(&mut second, mean, -1.0);
    Moments { centre: middle + mean, second }
}

fn add_products(sum: &mut [f64; 6], d: DVec3, weight: f64) {
    let products = [d.x * d.x, d.x * d.y, d.x * d.z, d.y * d.y, d.y * d.z, d.z * d.z];
    for (s, p) in sum.iter_mut().zip(products) {
        *s += weight * p;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Dataset, ImageData};

    #[test]
    fn a_box_has_a_twelfth_of_its_sides_squares() {
        let far = DVec3::new(1e5, -2e5, 3e5);
        let image = ImageData::new([2, 2, 3], far, DVec3::new(1.0, 0.5, 2.0));
        let mesh = Mesh::new(&Dataset::ImageData(image)).unwrap();
        let moments = CellMoments::of(&mesh, Symmetry::None);
        let Moments { centre, second } = moments.get(1);
        assert!((centre - far - DVec3::new(0.5, 0.25, 3.0)).length() < 1e-9, "{centre}");
        let want = [1.0 / 12.0, 0.0, 0.0, 0.25 / 12.0, 0.0, 4.0 / 12.0];
        for (got, want) in second.iter().zip(want) {
            assert!((got - want).abs() < 1e-9, "{second:?}");
        }
    }
}
