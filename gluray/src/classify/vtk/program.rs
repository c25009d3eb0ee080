//! A recognised program, with its uniforms at one draw.

use super::color::Surface;
use super::signature::{ActorTexture, ColorSource, VtkShaderSignature};
use crate::capture::draw::Attributes;
use crate::driver::gl;
use crate::state::snapshot::GlLight;
use crate::trace::lighting::normalized;
use crate::trace::mixed;
use crate::trace::occlusion::{LightPosition, vector};
use crate::trace::texturing::Image;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// The source of a program's surface colours.
pub(crate) enum ProgramColorSource<'a> {
    /// Uniforms.
    Constant,
    /// The vertices' colours, times this factor.
    PerVertex(f32),
    /// A colour map, times this factor.
    Map(&'a Image, f32),
    /// An actor's texture over uniforms.
    Picture(&'a Image),
    /// A colour for each triangle, times this factor.
    PerCell(&'a Image, f32),
}

/// A light in eye space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ProgramLight {
    /// The direction of its light, or of the axis of its cone.
    pub(crate) direction: [f32; 3],
    pub(crate) color: [f32; 3],
    /// `None` for a directional light.
    pub(crate) lamp: Option<PositionalLight>,
}

/// A light with a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionalLight {
    pub(crate) position: [f32; 3],
    /// Constant, linear and quadratic attenuation.
    pub(crate) attenuation: [f32; 3],
    /// 90 or more means no cone.
    pub(crate) cone_deg: f32,
    pub(crate) exponent: f32,
}

impl ProgramLight {
    /// The same light of fixed function.
    pub(crate) fn as_opengl(&self) -> GlLight {
        let [r, g, b] = self.color;
        let light = GlLight {
            diffuse: [r, g, b, 1.0],
            specular: [r, g, b, 1.0],
            position: [-self.direction[0], -self.direction[1], -self.direction[2], 0.0],
            spot_cutoff_deg: 180.0,
            attenuation: [1.0, 0.0, 0.0],
            ..GlLight::default()
        };
        let Some(lamp) = self.lamp else { return light };
        let [x, y, z] = lamp.position;
        GlLight {
            position: [x, y, z, 1.0],
            spot_direction: self.direction,
            spot_exponent: lamp.exponent,
            spot_cutoff_deg: if lamp.cone_deg < 90.0 { lamp.cone_deg } else { 180.0 },
            attenuation: lamp.attenuation,
            ..light
        }
    }
}

/// The parameters of a physically based material.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PbrMaterial {
    pub(crate) metallic: f32,
    pub(crate) roughness: f32,
    /// Reflectance along the normal, and its tint at grazing angles.
    pub(crate) base: f32,
    pub(crate) tint: [f32; 3],
    /// The minimum of the lobe's denominator: 0 before VTK 9.7.
    pub(crate) least_divisor: f32,
}

/// Lines along the edges of cells.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CellEdges {
    /// For each triangle, the sides that are edges of its cell, as bits.
    pub(crate) sides: Arc<Vec<u8>>,
    /// The width in pixels.
    pub(crate) width: f32,
    pub(crate) color: [f32; 3],
    pub(crate) opacity: f32,
    /// The viewport as the program set it.
    pub(crate) viewport: [f32; 4],
}

/// The data of a draw's buffer textures for each triangle.
#[derive(Debug, Clone, Default)]
pub(crate) struct CellData {
    pub(crate) colors: Option<Arc<Image>>,
    pub(crate) sides: Option<Arc<Vec<u8>>>,
}

/// A program that can be reproduced, with its uniforms at one draw.
#[derive(Debug, Clone)]
pub(crate) struct VtkProgram {
    pub(crate) clip_from_object: [f32; 16],
    pub(crate) view_from_object: [f32; 16],
    pub(super) normal_matrix: [f32; 9],
    pub(super) signature: VtkShaderSignature,
    pub(crate) ambient: [f32; 3],
    pub(crate) diffuse: [f32; 3],
    pub(super) ambient_intensity: f32,
    pub(super) diffuse_intensity: f32,
    pub(crate) specular: [f32; 3],
    pub(crate) specular_power: f32,
    pub(crate) opacity: f32,
    pub(super) parallel: bool,
    pub(super) overrides: bool,
    pub(crate) lights: Vec<ProgramLight>,
    /// The material of back faces, if they have their own.
    pub(super) back: Option<Surface>,
    pub(super) physical: Option<PbrMaterial>,
    /// Planes in object space. Fragments must lie above them.
    pub(super) clip_planes: Vec<[f32; 4]>,
    pub(super) edges: Option<CellEdges>,
    /// The colour map, or a colour for each triangle.
    pub(super) map: Option<Arc<Image>>,
    /// The actor's texture, and whether back faces have it.
    pub(super) picture: Option<Arc<Image>>,
    pub(super) picture_on_backs: bool,
    /// The matrix for texture coordinates.
    pub(super) turn: Option<[f32; 16]>,
}

/// The most clipping planes of VTK's shaders.
const MOST_PLANES: i32 = 6;

impl CellData {
    /// The same for copies of the draw, one after the other.
    pub(super) fn repeated(self, times: usize) -> CellData {
        match self.sides {
            Some(sides) if times != 1 => {
                CellData { sides: Some(Arc::new(sides.repeat(times))), ..self }
            }
            sides => CellData { sides, ..self },
        }
    }
}

impl VtkProgram {
    /// Reads the present uniforms.
    pub(super) fn from_uniforms(
        program: u32,
        signature: VtkShaderSignature,
        images: [Option<Arc<Image>>; 2],
    ) -> VtkProgram {
        let [map, picture] = images;
        fn value<const N: usize>(program: u32, name: &str) -> [f32; N] {
            match gl::uniform_location(program, name) {
                -1 => [0.0; N],
                at => gl::uniform_f(program, at),
            }
        }
        let one = |name: &str| value::<1>(program, name)[0];
        let number = |name: &str| match gl::uniform_location(program, name) {
            -1 => 0,
            at => gl::uniform_i::<1>(program, at)[0],
        };
        let intensity = one("specularIntensity");
        let light = |i: usize| ProgramLight {
            direction: value(program, &format!("lightDirectionVC{i}")),
            color: value(program, &format!("lightColor{i}")),
            lamp: (signature.placed && number(&format!("lightPositional{i}")) != 0).then(|| {
                PositionalLight {
                    position: value(program, &format!("lightPositionVC{i}")),
                    attenuation: value(program, &format!("lightAttenuation{i}")),
                    cone_deg: one(&format!("lightConeAngle{i}")),
                    exponent: one(&format!("lightExponent{i}")),
                }
            }),
        };
        let lights = match signature.headlight {
            true => vec![ProgramLight {
                direction: [0.0, 0.0, -1.0],
                color: value(program, "lightColor0"),
                lamp: None,
            }],
            false => (0..signature.lights).map(light).collect(),
        };
        let times = |name: &str, factor: &str| value::<3>(program, name).map(|v| v * one(factor));
        let planes =
            if signature.clipped { number("numClipPlanes").clamp(0, MOST_PLANES) } else { 0 };
        VtkProgram {
            clip_from_object: value(program, "MCDCMatrix"),
            view_from_object: value(program, "MCVCMatrix"),
            normal_matrix: value(program, "normalMatrix"),
            signature,
            ambient: value(program, "ambientColorUniform"),
            diffuse: value(program, "diffuseColorUniform"),
            ambient_intensity: one("ambientIntensity"),
            diffuse_intensity: one("diffuseIntensity"),
            specular: value::<3>(program, "specularColorUniform").map(|v| v * intensity),
            specular_power: one("specularPowerUniform"),
            opacity: one("opacityUniform"),
            parallel: number("cameraParallel") != 0,
            overrides: signature.overrides && number("OverridesColor") != 0,
            lights,
            back: signature.back.then(|| Surface {
                ambient: times("ambientColorUniformBF", "ambientIntensityBF"),
                diffuse: times("diffuseColorUniformBF", "diffuseIntensityBF"),
                specular: times("specularColorUniformBF", "specularIntensityBF"),
                power: one("specularPowerUniformBF"),
                alpha: one("opacityUniformBF"),
            }),
            physical: signature.physical.then(|| PbrMaterial {
                metallic: one("metallicUniform"),
                roughness: one("roughnessUniform"),
                base: one("baseF0Uniform"),
                tint: value(program, "edgeTintUniform"),
                least_divisor: if signature.lobes_have_an_end { 1e-8 } else { 0.0 },
            }),
            clip_planes: (0..planes).map(|i| value(program, &format!("clipPlanes[{i}]"))).collect(),
            edges: signature.edges.then(|| CellEdges {
                sides: Arc::default(),
                width: one("lineWidth"),
                color: value(program, "edgeColor"),
                // VTK sets it only where lines are translucent.
                opacity: match gl::uniform_location(program, "edgeOpacity") {
                    -1 => 1.0,
                    at => gl::uniform_f::<1>(program, at)[0],
                },
                viewport: value(program, "vpDims"),
            }),
            map,
            picture,
            picture_on_backs: number("showTexturesOnBackface") != 0,
            turn: signature.has_texture_matrix.then(|| value(program, "tcMatrix")),
        }
    }

    /// The same program with the data of buffer textures for the triangles of the draw.
    pub(super) fn with_cells(mut self, cells: &CellData) -> VtkProgram {
        if self.signature.colors == ColorSource::PerCell {
            self.map = cells.colors.clone();
        }
        if let (Some(edges), Some(sides)) = (&mut self.edges, &cells.sides) {
            edges.sides = sides.clone();
        }
        self
    }

    /// Replaces colour maps and the colours of vertices and cells by one colour.
    pub(crate) fn paint(&mut self, color: [f32; 3]) {
        (self.ambient, self.diffuse) = (color, color);
        self.signature.colors = ColorSource::Uniform;
        self.signature.actor_texture = ActorTexture::No;
        self.picture = None;
        self.back = None;
    }

    /// The positions of the lights in eye space.
    pub(crate) fn light_positions(&self) -> Vec<LightPosition> {
        let place = |l: &ProgramLight| match l.lamp {
            None => LightPosition::Directional(vector(l.direction.map(|v| -v))),
            Some(lamp) => LightPosition::Positional(vector(lamp.position)),
        };
        self.lights.iter().map(place).collect()
    }

    /// Planes in object space. Fragments must lie above them.
    pub(crate) fn clip_planes(&self) -> &[[f32; 4]] {
        &self.clip_planes
    }

    /// True when every fragment has alpha 1.
    pub(crate) fn is_opaque(&self, attributes: &Attributes, vertices: usize) -> bool {
        self.opacity == 1.0
            && self.back.is_none_or(|b| b.alpha == 1.0)
            && self.picture_is_opaque()
            && match self.signature.colors {
                ColorSource::Uniform => true,
                ColorSource::Map | ColorSource::PerCell => {
                    self.map.as_ref().is_some_and(|m| m.is_opaque())
                }
                ColorSource::PerVertex => (0..vertices).all(|i| attributes.colors.at(i)[3] == 1.0),
            }
    }

    /// The diffuse colour with its coefficient, and the opacity, including the actor's texture.
    pub(crate) fn base(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        prim: usize,
        w: [f32; 3],
    ) -> ([f32; 3], f32) {
        let (color, alpha) = self.ground(a, mesh, prim, w);
        match self.picture_at(a, mesh, prim, w, None) {
            Some([r, g, b, share]) => ([color[0] * r, color[1] * g, color[2] * b], alpha * share),
            None => (color, alpha),
        }
    }

    /// The same without the actor's texture.
    pub(crate) fn ground(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        prim: usize,
        w: [f32; 3],
    ) -> ([f32; 3], f32) {
        let (own, alpha) = self.own_color(a, mesh, prim, w);
        let unlit = if self.signature.lit { 0.0 } else { self.ambient_intensity };
        let color: [f32; 3] = match own {
            Some(c) => c.map(|v| v * (self.diffuse_intensity + unlit)),
            None => std::array::from_fn(|k| {
                self.diffuse[k] * self.diffuse_intensity + self.ambient[k] * unlit
            }),
        };
        (color, alpha * self.opacity)
    }

    /// The source of the colours, with their factor.
    pub(crate) fn color_source(&self) -> ProgramColorSource<'_> {
        let unlit = if self.signature.lit { 0.0 } else { self.ambient_intensity };
        let factor = self.diffuse_intensity + unlit;
        match (self.signature.colors, &self.map) {
            (ColorSource::PerVertex, _) if !self.overrides => ProgramColorSource::PerVertex(factor),
            (ColorSource::Map, Some(map)) if !self.overrides => {
                ProgramColorSource::Map(map, factor)
            }
            (ColorSource::PerCell, Some(map)) if !self.overrides => {
                ProgramColorSource::PerCell(map, factor)
            }
            _ => self
                .picture_alone()
                .map_or(ProgramColorSource::Constant, |image| ProgramColorSource::Picture(image)),
        }
    }

    /// What a path-traced scene cannot represent, as a reason for the report.
    pub(crate) fn unsupported_in_path_mode(&self) -> impl Iterator<Item = &'static str> {
        let left_out = [
            (self.edges.is_some(), "edges of cells"),
            (self.back.is_some(), "materials of back faces"),
            (self.physical.is_some(), "VTK's rules for physically based materials"),
            (
                self.picture.is_some() && self.picture_alone().is_none(),
                "pictures over other colours",
            ),
        ];
        left_out.into_iter().filter_map(|(there, what)| there.then_some(what))
    }

    /// True when the surface is lit.
    pub(crate) fn is_lit(&self) -> bool {
        self.signature.lit
    }

    /// True when the only light is a headlight. VTK then computes highlights from N·L.
    pub(crate) fn has_headlight(&self) -> bool {
        self.signature.headlight
    }

    /// The part of the light that is independent of lights.
    pub(crate) fn ambient_light(&self) -> [f32; 3] {
        match self.physical {
            Some(_) => [0.0; 3],
            None => self.ambient.map(|v| v * self.ambient_intensity),
        }
    }

    /// The matrix from vertex normals to eye space. `None` when triangles have only their own
    /// normals.
    pub(crate) fn eye_from_normal(&self) -> Option<&[f32; 9]> {
        (!self.signature.flat).then_some(&self.normal_matrix)
    }

    /// The shading normal in eye space.
    pub(crate) fn smooth_normal(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        prim: usize,
        w: [f32; 3],
    ) -> [f32; 3] {
        let corners = mesh.indices[prim].map(|i| i as usize);
        match self.eye_from_normal() {
            Some(m) => {
                let each = corners.map(|i| {
                    let n = a.normals.at(i);
                    std::array::from_fn(|r| m[r] * n[0] + m[3 + r] * n[1] + m[6 + r] * n[2])
                });
                normalized(mixed(each, w))
            }
            // The triangle's own normal decides.
            None => [0.0; 3],
        }
    }
}
