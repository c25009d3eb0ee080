//! Makes scenes with some of the primitives of a larger one.

use super::{Appearance, Scene, SceneError};
use crate::bvh::{BuildOptions, Geometry, World};
use crate::mesh::{Attribute, PerElement};
use crate::shapes::ShapePart;
use std::sync::Arc;

impl Scene {
    /// This scene with only the primitives `kept[g]` of each geometry g. The numbers are sorted,
    /// and repeated ones are ignored. Everything else stays as it is: instances and materials keep
    /// their numbers, and rays hit the kept primitives with the same results as here (see
    /// [`World::build_part`]). Primitive k of geometry g of the part is primitive `kept[g][k]`
    /// here.
    ///
    /// # Errors
    /// [`SceneError::Build`] when a mesh is invalid or `kept` does not have one list per geometry.
    pub fn part(&self, kept: &[Vec<u32>], options: &BuildOptions) -> Result<Scene, SceneError> {
        let mut vertices_kept = Vec::with_capacity(kept.len());
        let mut triangles_kept = Vec::with_capacity(kept.len());
        let mut geometries = Vec::with_capacity(kept.len());
        for (geometry, kept) in self.world.geometries().iter().zip(kept) {
            let mut kept = kept.clone();
            kept.sort_unstable();
            kept.dedup();
            geometries.push(match geometry {
                Geometry::Mesh(mesh) => {
                    kept.retain(|&t| (t as usize) < mesh.indices.len());
                    let (part, vertices) = mesh.part(&kept);
                    vertices_kept.push(vertices);
                    Geometry::Mesh(Arc::new(part))
                }
                Geometry::Slices(_) => {
                    return Err(SceneError::WithoutArrays { geometry: geometries.len() });
                }
                Geometry::Shape(shape) => {
                    vertices_kept.push(Vec::new());
                    Geometry::Shape(
                        shape.part(&kept).unwrap_or_else(|| {
                            Arc::new(ShapePart::new(shape.clone(), kept.clone()))
                        }),
                    )
                }
            });
            triangles_kept.push(kept);
        }
        // The builder reports a missing list.
        let instances = self.world.instances().to_vec();
        let world = World::build_part(geometries, instances, &self.world.global_layout(), options)?;
        let appearances = self
            .appearances
            .iter()
            .zip(self.world.instances())
            .map(|(a, instance)| {
                let (vertices, triangles) =
                    (&vertices_kept[instance.geometry], &triangles_kept[instance.geometry]);
                Appearance {
                    colors: a
                        .colors
                        .as_ref()
                        .map(|c| Arc::new(attribute_part(c, vertices, triangles))),
                    scalars: a
                        .scalars
                        .as_ref()
                        .map(|s| Arc::new(attribute_part(s, vertices, triangles))),
                    ..a.clone()
                }
            })
            .collect();
        Ok(Scene { world: Arc::new(world), appearances, ..self.clone() })
    }
}

/// Selects the values of the kept vertices or triangles. Shapes have one value per primitive, given
/// either per vertex or per primitive.
pub(crate) fn attribute_part<T: Copy>(
    attribute: &Attribute<T>,
    vertices: &[u32],
    primitives: &[u32],
) -> Attribute<T> {
    let of_shape = vertices.is_empty();
    let kept = if attribute.per == PerElement::Vertex && !of_shape { vertices } else { primitives };
    let values = kept.iter().filter_map(|&i| attribute.values.get(i as usize).copied()).collect();
    Attribute { per: attribute.per, values }
}
