//! Recognises VTK's shaders, from their first statement to their last.
//!
//! VTK assembles a shader from blocks in a fixed order. A source is VTK's when its `main` consists
//! of such blocks in that order and nothing else. The same statements in another order, within a
//! condition or twice were written by somebody else for a reason.

use super::blocks::*;
use super::glsl::{ShaderStage, split, statements, without_comments, without_whitespace};

/// The source of the surface's colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum ColorSource {
    #[default]
    Uniform,
    /// Attribute `scalarColor`.
    PerVertex,
    /// Texture `colortexture` at attribute `tcoord`.
    Map,
    /// Buffer texture `textureC` at the number of the triangle.
    PerCell,
}

/// The use of an actor's texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum ActorTexture {
    #[default]
    No,
    /// All of its components, or these, multiply the lit colour.
    Rgba,
    Rgb,
    Grey,
    GreyAlpha,
    /// It gives a physically based material its colour. Its alpha multiplies the opacity, or
    /// replaces it.
    Albedo,
    AlbedoAlone,
}

impl ActorTexture {
    /// True when it multiplies the result of lighting.
    pub(super) fn is_over_all(self) -> bool {
        matches!(
            self,
            ActorTexture::Rgba | ActorTexture::Rgb | ActorTexture::Grey | ActorTexture::GreyAlpha
        )
    }
}

/// The part of a program in translucency.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum TranslucencyPass {
    #[default]
    No,
    /// Finds the range of depths.
    Depths,
    /// Peels the nearest and the farthest layer.
    Layers,
    /// Sums layers in any order.
    Weighted,
}

/// The reason for leaving programs to the driver that draw depths for VTK's shadow maps.
pub(super) const SHADOW_MAP: &str = "a shadow map";

/// The properties of a program, read from its sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct VtkShaderSignature {
    pub(super) colors: ColorSource,
    pub(super) overrides: bool,
    /// Normals from the triangle instead of an attribute.
    pub(super) flat: bool,
    pub(super) headlight: bool,
    /// The number of lights other than a headlight, and whether they may have positions and cones.
    pub(super) lights: usize,
    pub(super) placed: bool,
    pub(super) lit: bool,
    pub(super) peel: TranslucencyPass,
    /// Back faces have a material of their own.
    pub(super) back: bool,
    pub(super) clipped: bool,
    /// Edges of cells are drawn.
    pub(super) edges: bool,
    /// The material is physically based, and its colours are made linear for it.
    pub(super) physical: bool,
    pub(super) linear: bool,
    pub(super) actor_texture: ActorTexture,
    /// The colour map and the actor's texture have separate coordinates, and whether a matrix
    /// multiplies those.
    pub(super) two_coordinates: bool,
    pub(super) has_texture_matrix: bool,
    /// Depths are offset by the slope of the surface and a constant, for lines on the surface.
    pub(super) depth_offset: bool,
    /// The cosines of highlights, and of a headlight, may be 0 (VTK 9.1). Later versions have a
    /// minimum.
    pub(super) cosines_from_zero: bool,
    /// The lobe of a physically based material has a maximum (VTK 9.7).
    pub(super) lobes_have_an_end: bool,
    /// Instances are copies of a source, each with a matrix and a colour.
    pub(super) glyphs: bool,
}

/// The statements that have not been read yet.
struct StatementReader<'a> {
    left: &'a [String],
}

impl StatementReader<'_> {
    /// Reads a block if it comes next.
    fn take(&mut self, piece: &str) -> bool {
        let piece = split(piece).unwrap_or_default();
        !piece.is_empty() && self.take_all(&piece)
    }

    fn take_all(&mut self, piece: &[impl AsRef<str>]) -> bool {
        let there = self.left.len() >= piece.len()
            && self.left.iter().zip(piece).all(|(s, p)| s == p.as_ref());
        if there {
            self.left = &self.left[piece.len()..];
        }
        there
    }

    /// Reads the first of several blocks that comes next. Returns which one it was.
    fn one_of<'p>(&mut self, pieces: impl IntoIterator<Item = &'p str>) -> Option<usize> {
        pieces.into_iter().position(|piece| self.take(piece))
    }

    /// Reads consecutive blocks that are numbered from 0 on.
    fn take_numbered(&mut self, piece: &str) -> usize {
        (0..=MOST_LIGHTS).take_while(|n| self.take(&piece.replace('#', &n.to_string()))).count()
    }

    fn is_done(&self) -> bool {
        self.left.is_empty()
    }
}

/// The lights of a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Lights {
    /// A headlight.
    head: bool,
    /// Directional lights or, with `placed`, positional ones, with their number.
    others: usize,
    placed: bool,
}

impl VtkShaderSignature {
    /// Reads the shaders. The error is the reason why the program is not recognised.
    pub(crate) fn read(
        vertex: &str,
        geometry: &str,
        fragment: &str,
    ) -> Result<VtkShaderSignature, &'static str> {
        const NOT_VTK: &str = "a program that is not recognised";
        const UNKNOWN: &str = "a surface of VTK's with a statement that is not known";
        const PICTURE: &str = "a picture on a surface of VTK's";
        let text = without_whitespace(&without_comments(fragment));
        if text.contains("fragOutput0.r=exp(depthC*ldepth);") {
            return Err(SHADOW_MAP);
        }
        let mut t = VtkShaderSignature::default();
        let vs = statements(vertex, ShaderStage::Vertex).ok_or(NOT_VTK)?;
        let mut fs = statements(fragment, ShaderStage::Fragment).ok_or(NOT_VTK)?;
        if !geometry.is_empty() {
            // Values that a geometry shader passes on have another name behind it.
            fs.iter_mut().for_each(|s| *s = s.replace("GSOutput", "VSOutput"));
            t.read_geometry(geometry).ok_or("a geometry or tessellation shader")?;
        }
        t.read_vertex(&vs).ok_or(NOT_VTK)?;
        let actor_texture =
            text.contains("texture(actortexture") || text.contains("texture(albedoTex");
        t.read_fragment(&fs).ok_or(if actor_texture { PICTURE } else { UNKNOWN })?;
        t.lobes_have_an_end = t.physical && text.contains(LOBES_HAVE_AN_END);
        Ok(t)
    }

    /// The geometry shader that measures edges and changes nothing else.
    fn read_geometry(&mut self, text: &str) -> Option<()> {
        let text: Vec<String> = statements(text, ShaderStage::Geometry)?
            .iter()
            .map(|s| s.replace("GSOutput", "VSOutput"))
            .collect();
        let mut r = StatementReader { left: &text };
        self.edges = r.take(MEASURES) && r.take_all(&CORNERS);
        let mut through = GOES_THROUGH.map(Some);
        // These are independent of each other, so their order does not matter.
        loop {
            if !self.clipped && r.take(CLIPS_LATER) {
                self.clipped = true;
                continue;
            }
            let next = through.iter_mut().find(|name| {
                name.is_some_and(|name| r.take(&format!("{name}VSOutput = {name}VSOutput[i];")))
            });
            match next {
                Some(name) => *name = None,
                None => break,
            }
        }
        (self.edges && r.take_all(&EMITS) && r.is_done()).then_some(())
    }

    fn read_vertex(&mut self, text: &[String]) -> Option<()> {
        let mut r = StatementReader { left: text };
        self.glyphs = r.take(GLYPH);
        if self.glyphs {
            self.clipped = r.take(&CLIPS.replace("vertexMC", "vertex"));
            (r.take(GLYPH_COLOR) && !self.edges).then_some(())?;
            r.take(GLYPH_NORMAL);
        } else {
            r.take(VERTEX_COLOR);
            r.take(VERTEX_NORMAL);
        }
        let [map, picture] = [0, 1].map(|i| r.one_of([COORDINATES[i], TURNED[i]]));
        self.two_coordinates = map.is_some() && picture.is_some();
        self.has_texture_matrix = map == Some(1) || picture == Some(1);
        // A matrix for only one kind of coordinates.
        if self.has_texture_matrix && (map == Some(0) || picture == Some(0)) {
            return None;
        }
        let vertex = if self.glyphs { "vertex" } else { "vertexMC" };
        let of_vertex = |piece: &str| piece.replace("vertexMC", vertex);
        if self.glyphs {
            // The copies' planes came first.
        } else if self.clipped {
            r.take(CLIPPED_LATER).then_some(())?;
        } else {
            self.clipped = r.take(CLIPS);
        }
        r.take(&of_vertex(VERTEX_VIEW));
        (r.take(&of_vertex(VERTEX_PLACE)) && r.is_done()).then_some(())
    }

    fn read_fragment(&mut self, text: &[String]) -> Option<()> {
        let mut r = StatementReader { left: text };
        r.take(VIEW);
        let mut slope = r.take(SLOPE);
        let differences = r.one_of(DIFFERENCES).is_some();
        slope = slope || r.take(SLOPE);
        self.depth_offset = r.one_of(if slope { MOVED_BY_SLOPE } else { MOVED }).is_some();
        if slope && !self.depth_offset {
            return None;
        }
        let layers = OTHER_EPSILON.map(|e| PEEL_LAYERS.replace(OTHER_EPSILON[0], e));
        if r.take(PEEL_DEPTHS) {
            self.peel = TranslucencyPass::Depths;
        } else if r.one_of(layers.iter().map(String::as_str)).is_some() {
            self.peel = TranslucencyPass::Layers;
        }
        if self.depth_offset && self.peel != TranslucencyPass::No {
            return None;
        }
        if r.take(CLIPPED) != self.clipped {
            return None;
        }
        self.read_colors(&mut r)?;
        if r.take(EDGES) != self.edges {
            return None;
        }
        match r.one_of([SMOOTH, FLAT]) {
            Some(1) if differences => self.flat = true,
            Some(1) => return None,
            _ => {}
        }
        self.read_light(&mut r)?;
        if self.actor_texture == ActorTexture::No {
            self.actor_texture = read_picture(&mut r);
        }
        if !r.take(DISCARDS) {
            return None;
        }
        match self.peel {
            TranslucencyPass::Layers if !r.take(PEELED_LAYERS) => return None,
            TranslucencyPass::No if r.take(WEIGHTED) => self.peel = TranslucencyPass::Weighted,
            _ => {}
        }
        r.is_done().then_some(())
    }

    /// The source of the surface's colour, and the changes to it before lighting.
    fn read_colors(&mut self, r: &mut StatementReader<'_>) -> Option<()> {
        r.take(SPECULAR);
        if r.one_of(MAPS).is_some() {
            self.colors = ColorSource::Map;
        } else if r.take(CELLS) {
            self.colors = ColorSource::PerCell;
        }
        if self.colors != ColorSource::Uniform {
            r.take(OF_TEXTURE).then_some(())?;
        } else if r.take(OF_VERTICES) {
            self.colors = ColorSource::PerVertex;
        } else {
            r.take(OF_UNIFORMS).then_some(())?;
        }
        self.linear = self.colors != ColorSource::Uniform && r.take(LINEAR);
        self.back = r.one_of(BACK).is_some();
        self.overrides = r.take(OVERRIDES);
        if self.glyphs {
            let own = GLYPH_COLORS[usize::from(self.back)];
            let plain = self.colors == ColorSource::Uniform && !self.overrides;
            (plain && r.take(own)).then_some(())?;
            self.colors = ColorSource::PerVertex;
        }
        Some(())
    }

    fn read_light(&mut self, r: &mut StatementReader<'_>) -> Option<()> {
        let physical = if r.take(ALBEDO) {
            true
        } else if r.take(ALBEDO_OF_TEXTURE) {
            self.actor_texture = ALBEDO_ALPHA[r.one_of(ALBEDO_ALPHA.map(|(_, piece)| piece))?].0;
            true
        } else {
            false
        };
        self.physical = physical;
        if physical {
            let lights = read_physical(r)?;
            self.lit = true;
            (self.headlight, self.lights, self.placed) =
                (lights.head, lights.others, lights.placed);
        } else if !r.take(UNLIT) {
            let lights = self.read_lights(r)?;
            self.lit = true;
            (self.headlight, self.lights, self.placed) =
                (lights.head, lights.others, lights.placed);
        }
        let one_kind = self.headlight != (self.lights > 0);
        let known =
            (!self.lit || one_kind) && self.lights <= MOST_LIGHTS && (physical || !self.linear);
        known.then_some(())
    }

    /// The lights of a shader with Phong's lighting.
    fn read_lights(&mut self, r: &mut StatementReader<'_>) -> Option<Lights> {
        let at_eye = LEAST_AT_EYE.map(|least| HEADLIGHT.replace(LEAST_AT_EYE[0], least));
        if let Some(version) = r.one_of(at_eye.iter().map(String::as_str)) {
            self.cosines_from_zero = version == 1;
            return Some(Lights { head: true, ..Lights::default() });
        }
        let (light, placed) = match r.one_of([LAMPS, SUNS])? {
            0 => (LAMP, true),
            _ => (SUN, false),
        };
        let of_version = |v: usize| light.replace(LEAST_ELSEWHERE[0], LEAST_ELSEWHERE[v]);
        let mut others = r.take_numbered(&of_version(0));
        if others == 0 {
            self.cosines_from_zero = true;
            others = r.take_numbered(&of_version(1));
        }
        r.take(SUMMED).then_some(Lights { head: false, others, placed })
    }
}

/// The rest of a physically based material. Returns its lights.
fn read_physical(r: &mut StatementReader<'_>) -> Option<Lights> {
    r.take(PHYSICAL).then_some(())?;
    let lights = if r.take(PHYSICAL_HEADLIGHT) {
        Lights { head: true, ..Lights::default() }
    } else {
        match r.take_numbered(PHYSICAL_LAMP) {
            0 => Lights { others: r.take_numbered(PHYSICAL_SUN), ..Lights::default() },
            n => Lights { others: n, placed: true, ..Lights::default() },
        }
    };
    r.one_of(PHYSICAL_ENDS).map(|_| lights)
}

/// An actor's texture that multiplies the lit colour.
fn read_picture(r: &mut StatementReader<'_>) -> ActorTexture {
    for (actor_texture, components) in COMPONENTS {
        for n in 0..MOST_BEFORE {
            let piece = [READS, components, MULTIPLIES].join(" ").replace('#', &n.to_string());
            if r.take(&piece) {
                return actor_texture;
            }
        }
    }
    ActorTexture::No
}

#[cfg(test)]
mod tests;
