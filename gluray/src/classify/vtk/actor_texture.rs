//! Textures of VTK's actors: one that multiplies the lit colour, or gives a physically based
//! material its colour.

use super::Image;
use super::program::VtkProgram;
use super::signature::{ActorTexture, ColorSource};
use crate::capture::draw::Attributes;
use crate::state::matrix::transform;
use crate::trace::mixed;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

impl VtkProgram {
    /// The actor's texture.
    pub(crate) fn picture(&self) -> Option<&Arc<Image>> {
        self.picture.as_ref()
    }

    /// Texture coordinates of a vertex, from component `first` on, after the program's texture
    /// matrix.
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

    /// The coordinates of a vertex on the colour map.
    pub(crate) fn map_coordinates(&self, a: &Attributes, vertex: usize) -> [f32; 2] {
        self.transformed_coordinates(a, vertex, 0)
    }

    /// The coordinates of a vertex on the actor's texture.
    pub(crate) fn picture_coordinates(&self, a: &Attributes, vertex: usize) -> [f32; 2] {
        self.transformed_coordinates(a, vertex, if self.signature.two_coordinates { 2 } else { 0 })
    }

    /// The actor's texture at a fragment. `texels` is the number of texels that its pixel covers,
    /// where it is known.
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

    /// The colour and alpha of a lit fragment, multiplied by the actor's texture.
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

    /// True when all texels that count are opaque.
    pub(super) fn picture_is_opaque(&self) -> bool {
        match self.signature.actor_texture {
            ActorTexture::No | ActorTexture::Rgb | ActorTexture::Grey => true,
            ActorTexture::GreyAlpha => false,
            ActorTexture::Rgba | ActorTexture::Albedo | ActorTexture::AlbedoAlone => {
                self.picture.as_ref().is_none_or(|image| image.is_opaque())
            }
        }
    }

    /// The actor's texture, if the surface has no other colours.
    pub(super) fn picture_alone(&self) -> Option<&Arc<Image>> {
        self.picture
            .as_ref()
            .filter(|_| self.overrides || self.signature.colors == ColorSource::Uniform)
    }
}
