//! Recognised programs as messages to other ranks. The colour map and the actor's texture are sent
//! by name.

use super::color::Surface;
use super::program::{CellEdges, PbrMaterial, PositionalLight, ProgramLight};
use super::signature::{ActorTexture, ColorSource, TranslucencyPass, VtkShaderSignature};
use super::{Image, VtkProgram};
use crate::cluster::codec::{MalformedMessage, Reader, Wire, put_pods, wire_enum, wire_struct};
use std::sync::Arc;

wire_enum!(ColorSource { Uniform, PerVertex, Map, PerCell });
wire_enum!(TranslucencyPass { No, Depths, Layers, Weighted });
wire_enum!(ActorTexture { No, Rgba, Rgb, Grey, GreyAlpha, Albedo, AlbedoAlone });
wire_struct!(VtkShaderSignature {
    colors,
    overrides,
    flat,
    headlight,
    lights,
    placed,
    lit,
    peel,
    back,
    clipped,
    edges,
    physical,
    linear,
    actor_texture,
    two_coordinates,
    has_texture_matrix,
    depth_offset,
    cosines_from_zero,
    lobes_have_an_end,
    glyphs,
});
wire_struct!(PositionalLight { position, attenuation, cone_deg, exponent });
wire_struct!(ProgramLight { direction, color, lamp });
wire_struct!(Surface { ambient, diffuse, specular, power, alpha });
wire_struct!(PbrMaterial { metallic, roughness, base, tint, least_divisor });

impl Wire for CellEdges {
    fn put(&self, out: &mut Vec<u8>) {
        put_pods(out, &self.sides);
        ([self.width, self.opacity], self.color).put(out);
        self.viewport.put(out);
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        let sides = Arc::new(from.pods()?);
        let ([width, opacity], color) = Wire::get(from)?;
        Ok(CellEdges { sides, width, color, opacity, viewport: Wire::get(from)? })
    }
}

impl VtkProgram {
    /// The colour map and the actor's texture.
    pub(crate) fn images(&self) -> [Option<&Arc<Image>>; 2] {
        [self.map.as_ref(), self.picture.as_ref()]
    }

    /// The same program with a colour map and an actor's texture.
    pub(crate) fn with_images(mut self, [map, picture]: [Option<Arc<Image>>; 2]) -> VtkProgram {
        (self.map, self.picture) = (map, picture);
        self
    }

    /// The number of lights that the program uses without having them, or beyond the limit.
    pub(crate) fn missing_lights(&self) -> usize {
        let most = crate::trace::occlusion::MOST_LIGHTS;
        usize::from(self.signature.headlight && self.lights.is_empty())
            + self.lights.len().saturating_sub(most)
    }
}

impl Wire for VtkProgram {
    fn put(&self, out: &mut Vec<u8>) {
        (self.clip_from_object, self.view_from_object).put(out);
        self.normal_matrix.put(out);
        self.signature.put(out);
        [self.ambient, self.diffuse, self.specular].put(out);
        [self.ambient_intensity, self.diffuse_intensity, self.specular_power, self.opacity]
            .put(out);
        [self.parallel, self.overrides].put(out);
        self.lights.put(out);
        (self.back, self.physical).put(out);
        self.clip_planes.put(out);
        self.edges.put(out);
        (self.picture_on_backs, self.turn).put(out);
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        let (clip_from_object, view_from_object) = Wire::get(from)?;
        let (normal_matrix, signature) = Wire::get(from)?;
        let [ambient, diffuse, specular] = Wire::get(from)?;
        let [ambient_intensity, diffuse_intensity, specular_power, opacity] = Wire::get(from)?;
        let [parallel, overrides] = Wire::get(from)?;
        let lights = Wire::get(from)?;
        let (back, physical) = Wire::get(from)?;
        let clip_planes = Wire::get(from)?;
        let edges = Wire::get(from)?;
        let (picture_on_backs, turn) = Wire::get(from)?;
        Ok(VtkProgram {
            clip_from_object,
            view_from_object,
            normal_matrix,
            signature,
            ambient,
            diffuse,
            specular,
            ambient_intensity,
            diffuse_intensity,
            specular_power,
            opacity,
            parallel,
            overrides,
            lights,
            back,
            physical,
            clip_planes,
            edges,
            map: None,
            picture: None,
            picture_on_backs,
            turn,
        })
    }
}
