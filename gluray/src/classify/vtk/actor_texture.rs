//! Pictures on surfaces: a texture of VTK's actor that multiplies the lit colour, or that a
//! physically based material has its colour from.

use super::Image;
use super::program::VtkProgram;
use super::signature::{ActorTexture, ColorSource};
use crate::capture::draw::Attributes;
use crate::state::matrix::transform;
use crate::trace::mixed;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

impl VtkProgram {
    /// The picture.
    pub(crate) fn picture(&self) -> Option<&Arc<Image>> {
        self.picture.as_ref()
    }

    /// Texture coordinates of a vertex, of which those from number `first` on are meant, after the
    /// program's matrix for them.
    fn transformed_coordinates(&self, a: &Attributes, vertex: usize, first: usize) -> [f32; 2] {
        let c = a.tex.at(vertex);
        let (s, t) = (c[first], c[first + 1]);
        match &self.turn {
            None => [s, t],
            Some(m) => {
                // vec4(s, t, 0, 1), divided at the vertex.
                let v = transform(m, [s, t, 0.0]);
                [v[0] / v[3], v[1] / v[3]]
            }
        }
    }

    /// Where a vertex is on the colour map.
    pub(crate) fn map_coordinates(&self, a: &Attributes, vertex: usize) -> [f32; 2] {
        self.transformed_coordinates(a, vertex, 0)
    }

    /// Where a vertex is on the picture.
    pub(crate) fn picture_coordinates(&self, a: &Attributes, vertex: usize) -> [f32; 2] {
        self.transformed_coordinates(a, vertex, if self.signature.two_coordinates { 2 } else { 0 })
    }

    /// The picture at a fragment whose pixel covers so many of its texels, where that is known.
    pub(super) fn picture_at(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        prim: usize,
        w: [f32; 3],
        texels: Option<f32>,
    ) -> Option<[f32; 4]> {
        let image = self.picture.as_ref()?;
        let [s, t] = mixed(mesh.indices[prim].map(|i| self.picture_coordinates(a, i as usize)), w);
        let [r, g, b, alpha] = match texels {
            Some(rho) => image.sample_over(s, t, rho),
            None => image.sample(s, t),
        };
        Some(match self.signature.actor_texture {
            ActorTexture::No => return None,
            ActorTexture::Rgb => [r, g, b, 1.0],
            ActorTexture::Grey => [r, r, r, 1.0],
            ActorTexture::GreyAlpha => [r, r, r, g],
            ActorTexture::Rgba | ActorTexture::Albedo | ActorTexture::AlbedoAlone => {
                [r, g, b, alpha]
            }
        })
    }

    /// The colour and alpha of a lit fragment with the picture on it.
    pub(super) fn under_picture(
        &self,
        lit: [f32; 4],
        picture: Option<[f32; 4]>,
        front: bool,
    ) -> [f32; 4] {
        match picture {
            Some(p)
                if self.signature.actor_texture.is_over_all()
                    && (front || self.picture_on_backs) =>
            {
                std::array::from_fn(|k| lit[k] * p[k])
            }
            _ => lit,
        }
    }

    /// True when no texel of the picture that counts lets anything through.
    pub(super) fn picture_is_opaque(&self) -> bool {
        match self.signature.actor_texture {
            ActorTexture::No | ActorTexture::Rgb | ActorTexture::Grey => true,
            ActorTexture::GreyAlpha => false,
            ActorTexture::Rgba | ActorTexture::Albedo | ActorTexture::AlbedoAlone => {
                self.picture.as_ref().is_none_or(|image| image.is_opaque())
            }
        }
    }

    /// The picture, where it lies on a single colour.
    pub(super) fn picture_alone(&self) -> Option<&Arc<Image>> {
        self.picture
            .as_ref()
            .filter(|_| self.overrides || self.signature.colors == ColorSource::Uniform)
    }
}
