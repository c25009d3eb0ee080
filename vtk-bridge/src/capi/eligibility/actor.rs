//! Actors: their classes, representation, property and textures.

use super::super::facts::{
    RTV_POINTS, RTV_SURFACE, RTV_TEXTURE, RTV_TEXTURE_CUBE_MAP, RTV_TEXTURE_FRONT_ONLY,
    RTV_TEXTURE_MIPMAP, RTV_TEXTURE_TRANSFORM, RTV_WIREFRAME, RtvActorFacts,
};
use super::{Radii, first};

/// Classes whose `Render` is `vtkActor`'s. Classes derived in Python have the names of their bases.
const ACTORS: [&str; 5] =
    ["vtkActor", "vtkOpenGLActor", "vtkPVLODActor", "vtkLODActor", "vtkQuadricLODActor"];

const MAPPERS: [&str; 7] = [
    "vtkPolyDataMapper",
    "vtkOpenGLPolyDataMapper",
    "vtkCompositePolyDataMapper",
    "vtkCompositePolyDataMapper2",
    "vtkDataSetMapper",
    "vtkGlyph3DMapper",
    "vtkOpenGLGlyph3DMapper",
];

/// Why OpenGL draws an actor; `None` if it can be ray traced as far as these facts say.
pub(in crate::capi) fn actor(
    f: &RtvActorFacts,
    actor_class: &str,
    mapper_class: &str,
    radii: Radii,
) -> Option<&'static str> {
    let surface = f.representation == RTV_SURFACE;
    let (edges, back, pbr) = (surface && f.edge_visibility != 0, f.has_back != 0, f.pbr != 0);
    let known = [f.albedo, f.material, f.normal, f.emissive];
    let num_known = known.iter().filter(|t| **t != 0).count();
    let maps = f.material != 0 || f.normal != 0 || f.emissive != 0;
    let textures = f.num_textures > 0;
    first(&[
        (
            !ACTORS.contains(&actor_class) || mapper_class.is_empty(),
            "OpenGL draws props of this class",
        ),
        (
            f.representation == RTV_WIREFRAME && radii.line <= 0.0,
            "wireframe (set RTV_LINE_RADIUS to trace edges as tubes)",
        ),
        (
            f.representation == RTV_POINTS && radii.point <= 0.0,
            "points (set RTV_POINT_RADIUS to trace them as spheres)",
        ),
        (edges && f.lines_as_tubes != 0, "edges as shaded tubes on the surface"),
        (edges && f.edge_opacity < 1.0, "translucent edges on the surface"),
        (edges && f.translucent != 0, "edges on a translucent surface"),
        (edges && f.num_clipping_planes > 0, "edges on a clipped surface"),
        (surface && f.vertex_visibility != 0, "vertices on the surface"),
        (
            back && (f.translucent != 0 || f.back_opacity < 1.0),
            "translucent backs with a property of their own",
        ),
        (back && f.glyphs != 0, "glyphs whose backs have a property of their own"),
        (pbr && f.image_lighting != 0, "a physically based surface that an image lights"),
        (pbr && (f.coat_strength > 0.0 || f.anisotropy != 0.0), "a clear coat or anisotropy"),
        (pbr && f.metallic > 0.0 && f.edge_tint != [1.0; 3], "a metal with an edge tint"),
        (
            f.num_textures as usize > num_known,
            "textures of the property for coats or anisotropy, or of a program's own shader",
        ),
        (f.glyphs != 0 && maps, "glyphs with textures of the property other than its base colour"),
        (textures && f.texture != 0, "a texture and a texture of the property"),
        (textures && !pbr, "textures of the property without physically based shading"),
    ])
    .or_else(|| known.into_iter().find_map(texture))
    .or_else(|| first(&[(f.shader_code != 0, "shader code of its own")]))
    .or_else(|| texture(f.texture))
    .or_else(|| {
        first(&[
            (!MAPPERS.contains(&mapper_class), "OpenGL draws mappers of this class"),
            (f.block_scalars != 0, "blocks with scalars, colour maps or textures of their own"),
            (f.no_data != 0, "no data"),
        ])
    })
}

/// Why a texture with these bits is left to OpenGL.
fn texture(bits: u32) -> Option<&'static str> {
    let has = |bit| bits & RTV_TEXTURE != 0 && bits & bit != 0;
    first(&[
        (has(RTV_TEXTURE_TRANSFORM), "a texture with a transform"),
        (has(RTV_TEXTURE_CUBE_MAP), "a cube map"),
        (has(RTV_TEXTURE_MIPMAP), "a texture with mipmaps"),
        (has(RTV_TEXTURE_FRONT_ONLY), "a texture that back faces do not show"),
    ])
}
