//! Converts the surfaces of a frame to rt-core's lists of geometries, instances, appearances and
//! materials.

use crate::bridge::FrameSurface;
use crate::colors::MeshColors;
use crate::edges::Edges;
use crate::input::Property;
use crate::materials::{
    Encoding, MaterialContext, ambient_as_emission, glyph_factor, glyph_opacity, material,
    under_line, under_texture,
};
use crate::options::{MaterialChoice, Options};
use rt_core::bvh::{Geometry, Instance};
use rt_core::glam::DAffine3;
use rt_core::material::{ColorSource, Material, SurfaceModel};
use rt_core::scene::{Appearance, Scene};
use std::collections::HashMap;

/// The assembled lists. Appearances and encodings have one entry per instance.
#[derive(Default)]
pub(crate) struct Assembled {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) instances: Vec<Instance>,
    pub(crate) appearances: Vec<Appearance>,
    pub(crate) materials: Vec<Material>,
    pub(crate) encodings: Vec<Encoding>,
    /// One entry per instance; empty if no instance has edges.
    pub(crate) edges: Vec<Option<Edges>>,
}

/// Assembles the lists.
pub(crate) fn assemble(
    surfaces: &[FrameSurface],
    options: &Options,
    only_headlight: bool,
    dark: bool,
) -> Assembled {
    let context = MaterialContext { options, only_headlight, dark };
    let mut out = Assembled::default();
    let mut known: HashMap<usize, usize> = HashMap::new();
    for d in surfaces {
        let mut parts: Vec<(usize, Geometry, bool, &Property)> = Vec::new();
        if let Some(m) = &d.built.mesh {
            parts.push((std::sync::Arc::as_ptr(&m.mesh) as usize, m.geometry(), true, &d.property));
        }
        if let Some(s) = &d.built.spheres {
            parts.push((
                std::sync::Arc::as_ptr(s) as usize,
                Geometry::Shape(s.clone()),
                false,
                &d.property,
            ));
        }
        if let Some(s) = &d.built.tubes {
            parts.push((
                std::sync::Arc::as_ptr(s) as usize,
                Geometry::Shape(s.clone()),
                false,
                &d.property,
            ));
        }
        if let (Some(s), Some(back)) = (&d.built.back_faces, &d.back) {
            parts.push((
                std::sync::Arc::as_ptr(s).cast::<()>() as usize,
                Geometry::Shape(s.clone()),
                false,
                back,
            ));
        }
        for (address, geometry, is_mesh, property) in parts {
            let index = *known.entry(address).or_insert_with(|| {
                out.geometries.push(geometry);
                out.geometries.len() - 1
            });
            let first = out.instances.len();
            out.add(d, property, index, is_mesh, &context);
            out.add_edges(d, first, is_mesh, options.edge_reach);
        }
    }
    if !out.edges.is_empty() {
        out.edges.resize_with(out.instances.len(), || None);
    }
    if options.ao == 0 && !options.path_tracing {
        out.materials =
            std::mem::take(&mut out.materials).into_iter().map(ambient_as_emission).collect();
    }
    out
}

impl Assembled {
    /// Adds edges for the instances from index `first` on.
    fn add_edges(&mut self, d: &FrameSurface, first: usize, is_mesh: bool, reach: f64) {
        let Some(mesh) =
            d.built.mesh.as_ref().filter(|m| d.property.edge_width > 0.0 && m.clip_map.is_none())
        else {
            return;
        };
        self.edges.resize_with(first, || None);
        for k in (first..self.instances.len()).filter(|_| is_mesh || d.back.is_some()) {
            let place = self.instances[k].world_from_object;
            self.edges.push(Some(Edges::new(mesh, place, &d.property, self.encodings[k], reach)));
        }
    }

    fn add(
        &mut self,
        d: &FrameSurface,
        property: &Property,
        geometry: usize,
        is_mesh: bool,
        context: &MaterialContext<'_>,
    ) {
        let colors = d.color.as_ref().filter(|_| is_mesh);
        let (base, encoding) = material(property, colors.is_some(), context);
        let base = match &d.maps {
            Some(maps) if is_mesh && encoding == Encoding::Pbr => maps.apply_to(base),
            _ => base,
        };
        match &d.glyphs {
            None => {
                let m = self.dressed(base, colors, d);
                self.place(geometry, d.world_from_data, m, colors, encoding);
            }
            Some(copies) => {
                let factor = glyph_factor(property, context) / 255.0;
                let opacity = base.opacity * glyph_opacity(property, context.options);
                let base = Material { opacity, ..base };
                let mut by_color: HashMap<Option<[u8; 4]>, usize> = HashMap::new();
                for (place, rgba) in copies {
                    let m = *by_color.entry(*rgba).or_insert_with(|| match rgba {
                        None => self.dressed(base.clone(), colors, d),
                        Some([r, g, b, a]) => {
                            let color = [*r, *g, *b].map(|c| f32::from(c) * factor);
                            let opacity = base.opacity * f32::from(*a) / 255.0;
                            let source = ColorSource::Constant;
                            self.material(Material {
                                color,
                                opacity,
                                color_source: source,
                                ..base.clone()
                            })
                        }
                    });
                    self.place(geometry, *place, m, colors, encoding);
                }
            }
        }
    }

    fn dressed(&mut self, base: Material, colors: Option<&MeshColors>, d: &FrameSurface) -> usize {
        let base = match (colors, &d.texture) {
            (None, Some(_)) => under_texture(base),
            _ => base,
        };
        let color_source = match (colors, &d.texture) {
            (Some(MeshColors::Values(_)), _) => ColorSource::Attribute,
            (Some(MeshColors::Mapped(_, map)), _) => ColorSource::Scalars(map.clone()),
            (None, Some(texture)) => ColorSource::Texture(texture.clone()),
            (None, None) => ColorSource::Constant,
        };
        self.material(Material { color_source, ..base })
    }

    fn material(&mut self, m: Material) -> usize {
        self.materials.push(m);
        self.materials.len() - 1
    }

    fn place(
        &mut self,
        geometry: usize,
        world_from_object: DAffine3,
        material: usize,
        colors: Option<&MeshColors>,
        encoding: Encoding,
    ) {
        let appearance = Appearance::new(material);
        self.appearances.push(match colors {
            Some(MeshColors::Values(v)) => appearance.with_colors(v.clone()),
            Some(MeshColors::Mapped(v, _)) => appearance.with_scalars(v.clone()),
            None => appearance,
        });
        self.instances.push(Instance { geometry, world_from_object });
        self.encodings.push(encoding);
    }
}

/// The scene with each surface as the lines along its edges would cover it, where lines are lit;
/// `None` where none are.
pub(crate) fn lit_lines(
    scene: &Scene,
    edges: &mut [Option<Edges>],
    encodings: &[Encoding],
) -> Option<Scene> {
    let mut lines: Option<Scene> = None;
    for (i, e) in edges.iter_mut().enumerate() {
        let Some(e) = e else { continue };
        let surface = &scene.materials[scene.appearances[i].material];
        let Some(line) = under_line(surface, e.color(), encodings[i]) else { continue };
        let lines = lines.get_or_insert_with(|| scene.clone());
        e.lit = true;
        lines.appearances[i].material = lines.materials.len();
        lines.materials.push(line);
    }
    lines
}

/// Whether ambient light would be visible.
pub(crate) fn any_ambient(materials: &[Material]) -> bool {
    materials
        .iter()
        .any(|m| matches!(m.model, SurfaceModel::Phong { ambient, .. } if ambient > 0.0))
}

/// Whether to trace reflection rays. Surface properties alone do not request them, because every
/// physically based surface reflects a little.
pub(crate) fn wants_reflections(options: &Options) -> bool {
    options.reflections
        || options.mirror > 0.0
        || matches!(options.material, MaterialChoice::Metal | MaterialChoice::Glass)
}
