//! Encodes draws as messages. Large content (shapes, attributes, images) is sent once and then
//! referred to by its identifier.

use super::codec::{MalformedMessage, Reader, Wire, bytes_of, put_pods, wire_enum, wire_struct};
use crate::capture::draw::{Attributes, Draw, PackedArray, Shading, Values, component_bytes};
use crate::capture::geometry_cache::hash;
use crate::classify::vtk::VtkProgram;
use crate::host::config::Surface;
use crate::state::material::Material;
use crate::state::snapshot::{Fog, GlLight, Snapshot, TextureUnit};
use crate::trace::occlusion::MOST_LIGHTS;
use crate::trace::overrides::RayMaterial;
use crate::trace::texturing::Image;
use std::sync::Arc;

wire_struct!(Material { ambient, diffuse, specular, emission, shininess });
wire_struct!(GlLight {
    ambient,
    diffuse,
    specular,
    position,
    spot_direction,
    spot_exponent,
    spot_cutoff_deg,
    attenuation,
});
wire_struct!(Fog { mode, density, start, end, color });
wire_struct!(TextureUnit { target, name, env_mode, env_color, generate, matrix, version });
wire_enum!(Surface { Program, Matte, Metal, Glass });
wire_struct!(RayMaterial { surface, opacity, mirror, roughness, ior, tint });
wire_struct!(PackedArray { bytes, kind, size, normalized });
wire_struct!(Snapshot {
    model_view,
    projection,
    viewport,
    window_height,
    depth_range,
    cull,
    front_is_ccw,
    flat,
    lighting,
    lights,
    model_ambient,
    two_side,
    local_viewer,
    separate_specular,
    color_material,
    normalize,
    rescale_normal,
    fog,
    clip_planes,
    polygon_offset,
    offset_by_length,
    smooth_or_stippled,
    any_offset,
    depth_test,
    depth_func,
    depth_mask,
    depth_clamp,
    blend,
    blend_is_over,
    alpha_test,
    alpha_test_passes_one,
    alpha_test_of_equality,
    stencil_test,
    two_sided_stencil,
    clip_control,
    unclamped_colors,
    encoded_colors,
    logic_op,
    color_mask,
    polygon_mode,
    stipple,
    smooth_polygons,
    scissor,
    render_mode,
    program,
    arb_program,
    pipeline,
    framebuffer,
    draw_buffer,
    more_draw_buffers,
    samples,
    masked_samples,
    sample_place,
    discard,
    feedback_active,
    first_vertex_provokes,
    color_sum,
    list_base,
    texture,
    foreign_texturing,
});

/// Reasons of the first rank's: draws that have one are not traced, so none is ever sent.
impl Wire for &'static str {
    fn put(&self, _: &mut Vec<u8>) {}
    fn get(_: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        Ok("a reason that was not sent")
    }
}

impl<const N: usize> Wire for Values<N>
where
    [f32; N]: bytemuck::Pod,
{
    fn put(&self, out: &mut Vec<u8>) {
        match self {
            Values::Constant(v) => {
                out.push(0);
                v.put(out);
            }
            Values::PerVertex(v) => {
                out.push(1);
                put_pods(out, v);
            }
            Values::Packed(p) => {
                out.push(2);
                (p.kind, p.size).put(out);
                p.normalized.put(out);
                put_pods(out, &p.bytes);
            }
        }
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        Ok(match u8::get(from)? {
            0 => Values::Constant(Wire::get(from)?),
            1 => Values::PerVertex(from.pods()?),
            2 => {
                let (kind, size) = Wire::get(from)?;
                let normalized = bool::get(from)?;
                if component_bytes(kind) == 0 || !(1..=4).contains(&size) {
                    return Err(
                        from.fault(format!("attributes of {size} components of type {kind:#x}"))
                    );
                }
                Values::Packed(Arc::new(PackedArray {
                    bytes: from.pods()?,
                    kind,
                    size,
                    normalized,
                }))
            }
            n => return Err(from.fault(format!("{n} is no kind of attribute"))),
        })
    }
}

impl Wire for Attributes {
    fn put(&self, out: &mut Vec<u8>) {
        self.normals.put(out);
        self.colors.put(out);
        self.tex.put(out);
        self.materials.put(out);
        put_pods(out, &self.material_of);
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        let a = Attributes {
            normals: Wire::get(from)?,
            colors: Wire::get(from)?,
            tex: Wire::get(from)?,
            materials: Wire::get(from)?,
            material_of: from.pods()?,
            version: 0,
        };
        let most = a.materials.len();
        match a.material_of.iter().find(|m| **m as usize >= most) {
            Some(m) => Err(from.fault(format!("material {m} of {most}"))),
            None if most == 0 => Err(from.fault("attributes without a material")),
            None => Ok(a),
        }
    }
}

/// Identifies attributes by their content.
pub(super) fn name_of_attributes(a: &Attributes) -> u128 {
    fn part<const N: usize>(v: &Values<N>) -> (Vec<u8>, &[u8])
    where
        [f32; N]: bytemuck::Pod,
    {
        match v {
            Values::Constant(c) => (bytes_of(c), &[]),
            Values::PerVertex(all) => (vec![1], bytemuck::cast_slice(all)),
            Values::Packed(p) => (bytes_of(&(p.kind, (p.size, p.normalized))), &p.bytes),
        }
    }
    let (normals, colors, tex) = (part(&a.normals), part(&a.colors), part(&a.tex));
    let materials = bytes_of(&a.materials);
    let parts = [&normals, &colors, &tex];
    let mut all: Vec<&[u8]> = parts.iter().flat_map(|(small, large)| [&small[..], large]).collect();
    all.extend([&materials, bytemuck::cast_slice(&a.material_of)]);
    hash(&all)
}

/// Identifies an image by its content.
pub(super) fn name_of_image(image: &Image) -> u128 {
    hash(&[b"image", &bytes_of(image)])
}

/// The images of a draw's program: its colour map, and the texture on its surfaces.
pub(super) fn images_of(draw: &Draw) -> [Option<&Arc<Image>>; 2] {
    match &draw.shading {
        Shading::Fixed => [None; 2],
        Shading::Program(p) => p.images(),
    }
}

/// A draw, with the identifiers of its large content.
pub(super) struct DrawMessage {
    pub(super) geometry: u128,
    pub(super) attributes: u128,
    /// Of texture unit 0, of the program's colour map, and of its picture.
    pub(super) images: [Option<u128>; 3],
    pub(super) state: Snapshot,
    pub(super) program: Option<VtkProgram>,
    pub(super) clip_from_object: [f32; 16],
    pub(super) ray_material: RayMaterial,
}

wire_struct!(DrawMessage {
    geometry,
    attributes,
    images,
    state,
    program,
    clip_from_object,
    ray_material
});

impl DrawMessage {
    /// Rejects values that the tracer cannot handle.
    pub(super) fn check(&self, from: &Reader<'_>) -> Result<(), MalformedMessage> {
        const FAR: i32 = 1 << 24;
        let s = &self.state;
        let lights = self.program.as_ref().map_or(0, VtkProgram::missing_lights);
        if !super::requests::is_traced(&s.viewport) || s.viewport[2] <= 0 || s.viewport[3] <= 0 {
            Err(from.fault(format!("a viewport of {:?}", s.viewport)))
        } else if s.scissor.is_some_and(|r| r.iter().any(|v| !(-FAR..=FAR).contains(v))) {
            Err(from.fault(format!("scissors of {:?}", s.scissor)))
        } else if s.lights.len() > MOST_LIGHTS || lights > 0 {
            Err(from.fault(format!("{} lights, {lights} missing", s.lights.len())))
        } else {
            Ok(())
        }
    }
}
