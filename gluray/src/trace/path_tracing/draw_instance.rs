//! Converts a draw into a scene instance: a mesh with attributes, a material and a transformation.

use super::clip;
use crate::capture::draw::{Shading, Values};
use crate::capture::geometry_cache::hash;
use crate::enums::*;
use crate::host::config::{Settings, Surface};
use crate::trace::Prepared;
use crate::trace::occlusion::eye_from_object;
use crate::trace::view::View;
use rt_core::glam::{DAffine3, DMat3, Vec2, Vec3};
use rt_core::material::{ColorSource, Material, PhongForm, Sides, SurfaceModel};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::texture::Texture;
use std::sync::Arc;

/// One instance of the scene.
pub(super) struct DrawInstance {
    pub(super) mesh: TriMesh,
    pub(super) material: Material,
    pub(super) world_from_object: DAffine3,
    /// The key of the mesh's content.
    pub(super) key: u128,
}

/// The appearance of a draw, as far as the path tracer models it.
struct SurfaceAppearance {
    color: [f32; 3],
    colors: Option<Attribute<[f32; 4]>>,
    texture: Option<(Arc<Texture>, Vec<Vec2>)>,
    normals: Option<Attribute<Vec3>>,
    emission: [f32; 3],
    opacity: f32,
    /// The highlight's colour, exponent and form. `None` for a surface that no light changes.
    lit: Option<([f32; 3], f32, PhongForm)>,
    sides: Sides,
}

fn rgb(c: [f32; 4]) -> [f32; 3] {
    [c[0], c[1], c[2]].map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })
}

fn warn(warnings: &mut Vec<String>, text: &str) {
    let text = format!("mode path: {text}");
    if !warnings.contains(&text) {
        warnings.push(text);
    }
}

/// Returns `None` for a draw that a scene cannot hold, with a message about it.
pub(super) fn part(
    p: &Prepared<'_>,
    view: &View,
    settings: &Settings,
    warnings: &mut Vec<String>,
) -> Option<DrawInstance> {
    let m = eye_from_object(p.draw);
    if m.row(3).truncate().length() > 1e-6 * m.row(3).w.abs() || m.row(3).w == 0.0 || !m.is_finite()
    {
        warn(warnings, "a draw whose model-view matrix is projective is left out");
        return None;
    }
    let m = m * m.row(3).w.recip();
    let linear = DMat3::from_mat4(m);
    if linear.determinant() == 0.0 {
        warn(warnings, "a draw that its model-view matrix flattens is left out");
        return None;
    }
    let s = &*p.draw.state;
    let appearance = match &p.draw.shading {
        Shading::Fixed => fixed(p, warnings),
        Shading::Program(known) => {
            known
                .unsupported_in_path_mode()
                .for_each(|what| warn(warnings, &format!("{what} are left out")));
            program(p)
        }
    };
    let mut mesh =
        TriMesh::new(p.draw.geometry.mesh.positions.clone(), p.draw.geometry.mesh.indices.clone());
    // The outside of a surface is the side that OpenGL calls front.
    if (linear.determinant() < 0.0) ^ view.mirrored ^ !s.front_is_ccw {
        mesh.indices.iter_mut().for_each(|t| t.swap(0, 1));
    }
    let mut material = material(p, &appearance, settings);
    mesh.normals = appearance.normals;
    mesh.colors = appearance.colors;
    if let Some((texture, coordinates)) = appearance.texture {
        mesh.texcoords = Some(coordinates);
        material = material.textured(texture);
    }
    for plane in p.clip_planes() {
        mesh = clip::above(&mesh, *plane);
    }
    let bytes =
        |v: &Option<Attribute<Vec3>>| v.as_ref().map_or(Vec::new(), |a| bytemuck_vec(&a.values));
    let key = hash(&[
        &p.draw.geometry.key.to_ne_bytes(),
        bytemuck::cast_slice(&mesh.indices),
        &bytes(&mesh.normals),
        mesh.colors.as_ref().map_or(&[], |c| bytemuck::cast_slice(&c.values)),
        &mesh
            .texcoords
            .iter()
            .flatten()
            .flat_map(|t| [t.x, t.y])
            .flat_map(f32::to_ne_bytes)
            .collect::<Vec<u8>>(),
        format!("{:?}", p.clip_planes()).as_bytes(),
    ]);
    Some(DrawInstance { mesh, material, world_from_object: DAffine3::from_mat4(m), key })
}

fn bytemuck_vec(v: &[Vec3]) -> Vec<u8> {
    v.iter().flat_map(|p| p.to_array()).flat_map(f32::to_ne_bytes).collect()
}

fn material(p: &Prepared<'_>, appearance: &SurfaceAppearance, settings: &Settings) -> Material {
    let (ray_material, e) = (&p.draw.ray_material, &settings.effects);
    let opacity = if e.transparency { appearance.opacity * ray_material.opacity } else { 1.0 };
    let base = Material {
        color: appearance.color,
        color_source: ColorSource::Attribute,
        opacity,
        emission: appearance.emission,
        sides: appearance.sides,
        flat: appearance.normals.is_none(),
        ..Material::matte(appearance.color)
    };
    let Some((specular, shininess, highlight)) = appearance.lit else {
        return Material { model: SurfaceModel::Unlit, ..base };
    };
    let model = match ray_material.surface {
        Surface::Metal if e.reflections => {
            SurfaceModel::Metal { roughness: ray_material.roughness }
        }
        Surface::Glass if e.refraction => {
            let model = SurfaceModel::Dielectric { ior: ray_material.ior, absorption: [0.0; 3] };
            return Material {
                model,
                color: ray_material.tint,
                color_source: ColorSource::Constant,
                opacity: 1.0,
                ..base
            };
        }
        _ => SurfaceModel::Phong {
            ambient: 1.0,
            diffuse: 1.0,
            specular,
            tinted: false,
            shininess: shininess.max(0.0),
            highlight,
            mirror: if e.reflections { ray_material.mirror } else { 0.0 },
        },
    };
    Material { model, ..base }
}

fn sides(p: &Prepared<'_>, both: Sides) -> Sides {
    match p.draw.state.cull {
        Some(BACK) => Sides::FrontOnly,
        Some(FRONT) => Sides::BackOnly,
        _ => both,
    }
}

fn fixed(p: &Prepared<'_>, warnings: &mut Vec<String>) -> SurfaceAppearance {
    let (s, a) = (&*p.draw.state, &*p.draw.attributes);
    let n = p.draw.geometry.mesh.positions.len();
    let indices = &p.draw.geometry.mesh.indices;
    let m = &a.materials_at(0)[0];
    let varies = match &a.colors {
        Values::Constant(_) => a.material_of.iter().any(|i| *i != a.material_of[0]),
        _ => true,
    };
    if a.material_of.iter().any(|i| {
        let o = &a.materials[*i as usize][0];
        (o.specular, o.emission, o.shininess) != (m.specular, m.emission, m.shininess)
    }) {
        warn(
            warnings,
            "highlight and emission that change within a draw are those of its first vertex",
        );
    }
    let alpha = |c: [f32; 4]| if s.blend { c } else { [c[0], c[1], c[2], 1.0] };
    let colors = varies.then(|| match s.flat {
        true => Attribute::per_face(
            indices.iter().map(|t| alpha(p.base_of_vertex(t[2] as usize))).collect(),
        ),
        false => Attribute::per_vertex((0..n).map(|i| alpha(p.base_of_vertex(i))).collect()),
    });
    let texture = match (&s.texture, &p.image) {
        (Some(unit), Some(image)) => {
            if !matches!(unit.env_mode, MODULATE | REPLACE) {
                warn(warnings, "a texture environment other than modulate is taken for that");
            }
            let coordinates = (0..n).map(|i| {
                let c = p.texture_coordinates(unit, i);
                let q = if c[3] == 0.0 { 1.0 } else { c[3] };
                Vec2::new(c[0] / q, c[1] / q)
            });
            image.as_texture().map(|t| (Arc::new(t), coordinates.collect()))
        }
        _ => None,
    };
    let first = p.base_of_vertex(indices.first().map_or(0, |t| t[2] as usize));
    SurfaceAppearance {
        color: rgb(first),
        colors,
        texture,
        normals: (s.lighting && !s.flat).then(|| {
            Attribute::per_vertex((0..n).map(|i| Vec3::from_array(a.normals.at(i))).collect())
        }),
        emission: if s.lighting { rgb(m.emission) } else { [0.0; 3] },
        opacity: if s.blend && !varies { first[3] } else { 1.0 },
        lit: s.lighting.then_some((rgb(m.specular), m.shininess, PhongForm::HalfVector)),
        sides: sides(p, if s.two_side { Sides::Both } else { Sides::LitOutside }),
    }
}

fn program(p: &Prepared<'_>) -> SurfaceAppearance {
    let Shading::Program(program) = &p.draw.shading else { unreachable!("the caller has looked") };
    let (a, mesh) = (&*p.draw.attributes, &*p.draw.geometry.mesh);
    let n = mesh.positions.len();
    let (constant, opacity) = if mesh.indices.is_empty() {
        ([1.0; 3], 1.0)
    } else {
        program.ground(a, mesh, 0, [1.0, 0.0, 0.0])
    };
    // VTK has a separate matrix for normals. The scene has one for positions and normals.
    let to_object = p.normal_from_eye();
    let normals = program.eye_from_normal().map(|m| {
        let each = |i: usize| {
            let v = a.normals.at(i);
            let eye: [f32; 3] =
                std::array::from_fn(|r| m[r] * v[0] + m[3 + r] * v[1] + m[6 + r] * v[2]);
            to_object * Vec3::from_array(eye)
        };
        Attribute::per_vertex((0..n).map(each).collect())
    });
    let (colors, texture, color) = match program.color_source() {
        crate::classify::vtk::ProgramColorSource::Constant => (None, None, constant),
        crate::classify::vtk::ProgramColorSource::PerVertex(scale) => {
            let each = |i: usize| {
                let [r, g, b, alpha] = a.colors.at(i);
                [r * scale, g * scale, b * scale, if p.draw.state.blend { alpha } else { 1.0 }]
            };
            (Some(Attribute::per_vertex((0..n).map(each).collect())), None, [1.0; 3])
        }
        crate::classify::vtk::ProgramColorSource::PerCell(image, scale) => {
            let each = |i: usize| {
                let [r, g, b, alpha] = image.numbered(i);
                [r * scale, g * scale, b * scale, if p.draw.state.blend { alpha } else { 1.0 }]
            };
            (Some(Attribute::per_face((0..mesh.indices.len()).map(each).collect())), None, [1.0; 3])
        }
        crate::classify::vtk::ProgramColorSource::Map(image, scale) => {
            let each = |i: usize| Vec2::from_array(program.map_coordinates(a, i));
            let texture = image.as_texture().map(|t| (Arc::new(t), (0..n).map(each).collect()));
            (None, texture, [scale; 3])
        }
        crate::classify::vtk::ProgramColorSource::Picture(image) => {
            let each = |i: usize| Vec2::from_array(program.picture_coordinates(a, i));
            let texture = image.as_texture().map(|t| (Arc::new(t), (0..n).map(each).collect()));
            (None, texture, constant)
        }
    };
    let smooth = normals.is_some();
    let highlight =
        if program.has_headlight() { PhongForm::TowardsLight } else { PhongForm::Mirrored };
    let constant_ambient = program.ambient_light();
    SurfaceAppearance {
        color: color.map(|v| v.max(0.0)),
        emission: if colors.is_none() && texture.is_none() && program.is_lit() {
            constant_ambient.map(|v| v.max(0.0))
        } else {
            [0.0; 3]
        },
        colors,
        texture,
        normals,
        opacity: if p.draw.state.blend { opacity.clamp(0.0, 1.0) } else { 1.0 },
        lit: program.is_lit().then_some((
            program.specular.map(|v| v.max(0.0)),
            program.specular_power,
            highlight,
        )),
        sides: sides(p, if smooth { Sides::Both } else { Sides::BothByNormal }),
    }
}
