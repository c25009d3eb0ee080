//! The boundary of an irregular tetrahedral mesh: what a CFD person extracts from an unstructured
//! grid.

use glam::{DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use std::collections::HashMap;
use std::sync::Arc;

/// The six tetrahedra of a cube around its diagonal, by corner numbers (bit 0 is x, 1 is y, 2 is
/// z). Neighbouring cubes share their diagonals (Kuhn's subdivision).
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// Tetrahedra over `n`³ cubes with moved corners, of which half are there, at random: the triangles
/// between a tetrahedron that is there and one that is not. About 6 n³ triangles.
pub fn cells(n: u32) -> Arc<TriMesh> {
    let mut random = SplitMix64::new(5);
    let side = n + 1;
    let count = side * side * side;
    let mut corner = |i: u32| -> Vec3 {
        let at = [i % side, i / side % side, i / side / side].map(f64::from);
        let moved = DVec3::from_array(at) + 0.35 * random.unit() * random.direction();
        (moved * (2.0 / f64::from(n)) - 1.0).as_vec3()
    };
    let positions: Vec<Vec3> = (0..count).map(&mut corner).collect();
    // Faces by their sorted corners, with the number of tetrahedra that use them and are there.
    let mut faces: HashMap<[u32; 3], ([u32; 3], u8)> = HashMap::new();
    let mut order = Vec::new();
    for cube in 0..n * n * n {
        let [x, y, z] = [cube % n, cube / n % n, cube / n / n];
        for tetrahedron in TETRAHEDRA {
            if random.unit() < 0.5 {
                continue;
            }
            let v = tetrahedron.map(|c| {
                let c = c as u32;
                (x + (c & 1)) + side * ((y + (c >> 1 & 1)) + side * (z + (c >> 2)))
            });
            for face in
                [[v[0], v[1], v[2]], [v[0], v[1], v[3]], [v[0], v[2], v[3]], [v[1], v[2], v[3]]]
            {
                let mut key = face;
                key.sort_unstable();
                let entry = faces.entry(key).or_insert_with(|| {
                    order.push(key);
                    (face, 0)
                });
                entry.1 += 1;
            }
        }
    }
    let indices = order.iter().map(|key| faces[key]).filter(|(_, uses)| *uses == 1);
    Arc::new(TriMesh::new(positions, indices.map(|(face, _)| face).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_of_the_boundary_has_an_even_number_of_triangles() {
        let mesh = cells(7);
        assert_eq!(mesh.validate().skipped(), 0);
        let per_cube = mesh.num_triangles() as f64 / 343.0;
        assert!((5.0..9.0).contains(&per_cube), "{per_cube} triangles a cube");
        let mut edges: HashMap<[u32; 2], u32> = HashMap::new();
        for t in &mesh.indices {
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        assert!(edges.values().all(|n| n % 2 == 0));
    }
}
