//! Converts scenes to the data types that the writers of `datasets` take.

use super::format::{Object, Scene};
use datasets::model::{DataArray, PolyData, Values};
use rt_core::colormap::srgb_to_linear;
use rt_core::glam::{DMat3, DMat4, DVec3, Vec3};
use rt_core::mesh::{Attribute, TriMesh};

/// What could not be taken over.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ConvertReport {
    /// Triangles left out because a corner is nowhere (NaN or infinite).
    pub nowhere: usize,
    /// Normals without a direction, replaced by that of a triangle at the vertex.
    pub without_direction: usize,
}

impl ConvertReport {
    /// One line per thing worth telling.
    pub fn warnings(&self) -> Vec<String> {
        let items = [
            (self.nowhere, "triangles left out: a corner is NaN or infinite"),
            (self.without_direction, "normals had no direction and were computed"),
        ];
        items.iter().filter(|(n, _)| *n > 0).map(|(n, text)| format!("{n} {text}")).collect()
    }
}

/// One object in the world's axes.
struct WorldSpaceMesh {
    positions: Vec<DVec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    colors: Vec<[u8; 4]>,
}

fn to_world_space(o: &Object, with_normals: bool, report: &mut ConvertReport) -> WorldSpaceMesh {
    let world = DMat4::from_cols_array(&o.world_from_object);
    let positions: Vec<DVec3> =
        o.positions.iter().map(|p| world.project_point3(DVec3::from(p.map(f64::from)))).collect();
    let there = |t: &[u32; 3]| t.iter().all(|i| positions[*i as usize].is_finite());
    let mut triangles: Vec<[u32; 3]> = o.indices.iter().copied().filter(there).collect();
    report.nowhere += o.indices.len() - triangles.len();
    let turn = DMat3::from_mat4(world);
    if turn.determinant() < 0.0 {
        // A mirror turns triangles over; normals are those of the sides that the program meant.
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }

    let mut normals = Vec::new();
    if with_normals {
        let cofactor = DMat3::from_cols(
            turn.y_axis.cross(turn.z_axis),
            turn.z_axis.cross(turn.x_axis),
            turn.x_axis.cross(turn.y_axis),
        );
        let side = if turn.determinant() < 0.0 { -1.0 } else { 1.0 };
        let own = o.normals.iter().map(|n| {
            (side * (cofactor * DVec3::from(n.map(f64::from)))).normalize_or_zero().as_vec3()
        });
        normals = own.collect();
        let computed = normals.is_empty();
        normals.resize(positions.len(), Vec3::ZERO);
        let mut summed = vec![DVec3::ZERO; positions.len()];
        for t in &triangles {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            t.iter().for_each(|i| summed[*i as usize] += (b - a).cross(c - a));
        }
        for (n, sum) in normals.iter_mut().zip(summed) {
            if n.length_squared() < 0.5 {
                // glTF wants a direction also where all triangles are degenerate.
                *n = sum.try_normalize().map_or(Vec3::Z, |v| v.as_vec3());
                report.without_direction += usize::from(!computed);
            }
        }
    }
    let constant = o.color.map(|c| (255.0 * c.clamp(0.0, 1.0) + 0.5) as u8);
    let colors =
        if o.colors.is_empty() { vec![constant; positions.len()] } else { o.colors.clone() };
    WorldSpaceMesh { positions, normals, triangles, colors }
}

/// True when the object is one of those asked for; none asked for means all.
fn wanted(o: &Object, keys: &[String]) -> bool {
    keys.is_empty() || keys.contains(&o.key)
}

/// The objects with these keys (all, when there is none) as one mesh with colours, and with normals
/// when any has some. OpenGL's colours are what the screen gets, so they count as sRGB.
pub fn to_mesh(scene: &Scene, keys: &[String]) -> (TriMesh, ConvertReport) {
    let (mesh, _, report) = merge_objects(scene, keys);
    (mesh, report)
}

/// The same as polygons for VTK. The cell array `object` numbers the objects, whose keys stand in
/// the text `object keys` in that order.
pub fn to_poly_data(scene: &Scene, keys: &[String]) -> (PolyData, ConvertReport) {
    let (mesh, triangles, report) = merge_objects(scene, keys);
    let mut poly = PolyData::from_trimesh(&mesh);
    let numbers =
        triangles.iter().enumerate().flat_map(|(i, (_, n))| std::iter::repeat_n(i as i32, *n));
    poly.attributes.cell.push(DataArray::new("object", 1, Values::I32(numbers.collect())));
    let names = triangles.into_iter().map(|(key, _)| key).collect();
    poly.attributes.text.push(("object keys".into(), names));
    (poly, report)
}

/// One mesh, and the objects in it with their triangles.
fn merge_objects(scene: &Scene, keys: &[String]) -> (TriMesh, Vec<(String, usize)>, ConvertReport) {
    let mut report = ConvertReport::default();
    let with_normals = scene.objects.iter().any(|o| wanted(o, keys) && !o.normals.is_empty());
    let (mut positions, mut indices, mut normals, mut colors) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut triangles = Vec::new();
    for o in scene.objects.iter().filter(|o| wanted(o, keys)) {
        let p = to_world_space(o, with_normals, &mut report);
        triangles.push((o.key.clone(), p.triangles.len()));
        let first = positions.len() as u32;
        indices.extend(p.triangles.iter().map(|t| t.map(|i| i + first)));
        // Vertices that only left-out triangles had must not make the file unreadable.
        positions.extend(p.positions.iter().map(|v| if v.is_finite() { *v } else { DVec3::ZERO }));
        normals.extend(p.normals);
        colors.extend(p.colors.iter().map(|c| {
            let [r, g, b, a] = c.map(|v| f32::from(v) / 255.0);
            [srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b), a]
        }));
    }
    let mut mesh = TriMesh::from_f64_positions(&positions, indices);
    mesh.normals = with_normals.then(|| Attribute::per_vertex(normals));
    mesh.colors = Some(Attribute::per_vertex(colors));
    (mesh, triangles, report)
}

#[cfg(test)]
mod tests {
    use super::super::format::tests::example;
    use super::*;

    #[test]
    fn objects_lie_where_their_matrices_put_them() {
        let (mesh, report) = to_mesh(&example(), &[]);
        assert_eq!(
            (mesh.positions.len(), mesh.indices.len(), report),
            (7, 3, ConvertReport::default())
        );
        let at = |i: usize| mesh.origin + mesh.positions[i].as_dvec3();
        assert_eq!((at(1), at(5)), (DVec3::new(1.0, 0.0, 0.0), DVec3::new(11.0, 1.0, 0.0)));
        assert_eq!(mesh.indices[2], [3, 5, 6]);
        let normals = &mesh.normals.as_ref().unwrap().values;
        assert!(
            normals.iter().all(|n| *n == Vec3::Z),
            "one object has normals, so all get some: {normals:?}"
        );
        let colors = &mesh.colors.as_ref().unwrap().values;
        assert!(
            (colors[0][1] - srgb_to_linear(128.0 / 255.0)).abs() < 1e-6
                && (colors[3][3] - 128.0 / 255.0).abs() < 1e-6
        );
        assert_eq!(to_mesh(&example(), &["b2".into()]).0.indices.len(), 2);
    }

    #[test]
    fn mirrors_keep_outsides_outside_and_stretched_normals_stay_normal() {
        let mut scene = example();
        scene.objects.truncate(1);
        // A slope, mirrored in x and stretched in y.
        let o = &mut scene.objects[0];
        o.positions = vec![[0., 0., 0.], [1., 0., 1.], [0., 1., 0.]];
        o.normals = vec![[-1., 0., 1.]; 3];
        (o.world_from_object[0], o.world_from_object[5]) = (-1.0, 3.0);
        let (mesh, _) = to_mesh(&scene, &[]);
        let [a, b, c] = mesh.indices[0].map(|i| mesh.positions[i as usize]);
        let geometric = (b - a).cross(c - a).normalize();
        for n in &mesh.normals.as_ref().unwrap().values {
            assert!(n.dot(geometric) > 0.9999, "{n} {geometric}");
            assert!(n.z > 0.0, "the side that was up stays up");
        }
    }

    #[test]
    fn what_is_nowhere_is_counted_and_left_out() {
        let mut scene = example();
        scene.objects[1].positions[1][0] = f32::NAN;
        scene.objects[0].normals[0] = [0.0; 3];
        let (mesh, report) = to_mesh(&scene, &[]);
        assert_eq!(
            (mesh.indices.len(), report),
            (2, ConvertReport { nowhere: 1, without_direction: 1 })
        );
        assert_eq!(report.warnings().len(), 2);
        let (poly, _) = to_poly_data(&scene, &[]);
        let object = poly.attributes.cell_array("object").unwrap();
        assert_eq!(object.values, Values::I32(vec![0, 1]));
        assert_eq!(poly.attributes.text[0].1, ["a1", "b2"]);
    }
}
