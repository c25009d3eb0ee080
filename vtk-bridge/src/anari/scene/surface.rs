//! Combines a geometry with its appearance. It chooses the cheapest representation in the renderer
//! that shows the material's colour exactly.
//!
//! Constant colours go into the material. Values per face and per vertex go into the appearance.
//! Images become textures. On meshes none of the three needs a new acceleration structure, except
//! that images need one when they are added or removed. Everything else is computed at the hits:
//! see [`super::surface_color`].

use super::attribute::{Domain, HitPoint, Topology};
use super::geometry::{Body, Part};
use super::material_inputs::{BoundMaterialInputs, MaterialInputs};
use super::surface_color::{AlphaMode, ColoredShape, Input, SurfaceColor, Weights};
use rt_core::bvh::Geometry;
use rt_core::glam::{DAffine3, DVec3};
use rt_core::material::{ColorSource, Material};
use rt_core::material_maps::MaterialMaps;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::scene::Appearance;
use std::sync::Arc;

/// A surface, ready to be instanced.
#[derive(Clone)]
pub(crate) struct CompiledSurface {
    pub(crate) geometry: Geometry,
    pub(crate) material: Material,
    /// Its material index is not set yet.
    pub(crate) appearance: Appearance,
    pub(crate) topology: Arc<Topology>,
}

/// Applies the surface colour to one part.
pub(crate) fn compile_surface(
    part: &Part,
    model: &Material,
    surface_color: &SurfaceColor,
    material_inputs: Option<&MaterialInputs>,
    world_from_object: &DAffine3,
) -> CompiledSurface {
    let topology = part.topology.clone();
    let model = &match material_inputs {
        None => model.clone(),
        Some(material_inputs) => {
            let (mesh, weights) = match &part.body {
                Body::Mesh(mesh) => (Some(mesh.clone()), Weights::Corners),
                Body::Shape(_, weights) => (None, *weights),
            };
            let world_from_object = *world_from_object;
            let topology = topology.clone();
            let bound_inputs = BoundMaterialInputs {
                material_inputs: material_inputs.clone(),
                topology,
                weights,
                mesh,
                world_from_object,
            };
            model.clone().with_maps(Arc::new(bound_inputs) as Arc<dyn MaterialMaps>)
        }
    };
    let bare = |material, appearance| CompiledSurface {
        geometry: part.geometry(),
        material,
        appearance,
        topology: topology.clone(),
    };
    let no_hit = HitPoint {
        topology: &topology,
        primitive: 0,
        weights: [1.0, 0.0, 0.0],
        point: DVec3::ZERO,
        normal: DVec3::Z,
        world_from_object,
    };
    let domain = domain_of(surface_color);
    if domain == Domain::Constant {
        let [r, g, b, a] = surface_color.at(&no_hit);
        let material = Material { color: [r, g, b], opacity: a, ..model.clone() };
        return bare(material, Appearance::default());
    }
    let Body::Mesh(mesh) = &part.body else {
        return colored_shape(part, model, surface_color, world_from_object);
    };
    match domain {
        Domain::Face => {
            let of = |t: usize| surface_color.at(&HitPoint { primitive: t as u32, ..no_hit });
            let colors = Attribute::per_face((0..mesh.indices.len()).map(of).collect());
            bare(model.clone(), Appearance::new(0).with_colors(colors))
        }
        Domain::Linear => {
            let mut colors = vec![[0.0, 0.0, 0.0, 1.0]; mesh.positions.len()];
            at_vertices(mesh, &no_hit, |v, place| colors[v] = surface_color.at(place));
            bare(model.clone(), Appearance::new(0).with_colors(Attribute::per_vertex(colors)))
        }
        Domain::Texture => {
            let Input::Sampler(sampler) = &surface_color.color else {
                return colored_shape(part, model, surface_color, world_from_object);
            };
            let opacity = surface_color.opacity.at(&no_hit)[0];
            let Some(texture) = sampler.texture(|texel| surface_color.finish(texel, || opacity))
            else {
                return colored_shape(part, model, surface_color, world_from_object);
            };
            let mut coordinates = vec![Default::default(); mesh.positions.len()];
            at_vertices(mesh, &no_hit, |v, place| coordinates[v] = sampler.coordinate(place));
            let mesh = TriMesh { texcoords: Some(coordinates), ..TriMesh::clone(mesh) };
            let material = Material {
                color_source: ColorSource::Texture(texture.into()),
                color: [1.0; 3],
                ..model.clone()
            };
            CompiledSurface {
                geometry: Geometry::Mesh(mesh.into()),
                material,
                appearance: Appearance::default(),
                topology: topology.clone(),
            }
        }
        _ => colored_shape(part, model, surface_color, world_from_object),
    }
}

fn colored_shape(
    part: &Part,
    model: &Material,
    surface_color: &SurfaceColor,
    world_from_object: &DAffine3,
) -> CompiledSurface {
    let (shape, weights) = part.as_shape();
    let shape = ColoredShape {
        shape,
        weights,
        topology: part.topology.clone(),
        surface_color: surface_color.clone(),
        world_from_object: *world_from_object,
    };
    CompiledSurface {
        geometry: Geometry::Shape(Arc::new(shape)),
        material: model.clone(),
        appearance: Appearance::default(),
        topology: part.topology.clone(),
    }
}

fn domain_of(surface_color: &SurfaceColor) -> Domain {
    let of = |input: &Input| match input {
        Input::Constant(_) => Domain::Constant,
        Input::Attribute(source) => source.domain(),
        Input::Sampler(sampler) => sampler.domain(),
    };
    let (color, opacity) = (
        of(&surface_color.color),
        if surface_color.mode == AlphaMode::Opaque {
            Domain::Constant
        } else {
            of(&surface_color.opacity)
        },
    );
    let steps = matches!(surface_color.mode, AlphaMode::Mask { .. });
    match color.max(opacity) {
        // A threshold between vertices, or a product of two varying values, is not linear.
        Domain::Linear | Domain::Texture if steps || color.min(opacity) > Domain::Constant => {
            Domain::Hit
        }
        // Textures hold colours, not opacities.
        Domain::Texture if color != Domain::Texture => Domain::Hit,
        domain => domain,
    }
}

/// Calls `f` for every vertex of the mesh that a triangle uses, with the hit point there.
fn at_vertices(mesh: &TriMesh, base: &HitPoint<'_>, mut f: impl FnMut(usize, &HitPoint<'_>)) {
    let mut seen = vec![false; mesh.positions.len()];
    for (t, triangle) in mesh.indices.iter().enumerate() {
        for k in 0..3 {
            let v = triangle[k] as usize;
            if std::mem::replace(&mut seen[v], true) {
                continue;
            }
            let mut weights = [0.0; 3];
            weights[k] = 1.0;
            let point = mesh.origin + mesh.positions[v].as_dvec3();
            f(v, &HitPoint { primitive: t as u32, weights, point, ..*base });
        }
    }
}
