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
        r.take(VERTEX_COLOR);
        r.take(VERTEX_NORMAL);
        let [map, picture] = [0, 1].map(|i| r.one_of([COORDINATES[i], TURNED[i]]));
        self.two_coordinates = map.is_some() && picture.is_some();
        self.has_texture_matrix = map == Some(1) || picture == Some(1);
        // A matrix for only one kind of coordinates.
        if self.has_texture_matrix && (map == Some(0) || picture == Some(0)) {
            return None;
        }
        if self.clipped {
            r.take(CLIPPED_LATER).then_some(())?;
        } else {
            self.clipped = r.take(CLIPS);
        }
        r.take(VERTEX_VIEW);
        (r.take(VERTEX_PLACE) && r.is_done()).then_some(())
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
mod tests {
    use super::*;
    use proptest::prelude::*;

    const VERTEX: &str = "#version 150\nin vec4 vertexMC; // a comment\nvoid main()\n{\n  \
                          vertexVCVSOutput = MCVCMatrix * vertexMC;\n  gl_Position = MCDCMatrix * \
                          vertexMC;\n}\n";

    /// Pieces of a fragment shader, in VTK's order.
    #[derive(Clone)]
    struct Parts {
        depth: String,
        clip: String,
        color: String,
        edges: String,
        normal: String,
        light: String,
        picture: String,
        end: String,
    }

    impl Default for Parts {
        fn default() -> Parts {
            Parts {
                depth: String::new(),
                clip: String::new(),
                color: [SPECULAR, OF_UNIFORMS].concat(),
                edges: String::new(),
                normal: SMOOTH.into(),
                light: HEADLIGHT.into(),
                picture: String::new(),
                end: String::new(),
            }
        }
    }

    impl Parts {
        fn text(&self) -> String {
            let Parts { depth, clip, color, edges, normal, light, picture, end } = self;
            let pieces = [VIEW, depth, clip, color, edges, normal, light, picture, DISCARDS, end];
            format!("#version 150\n/* text */\nvoid main()\n{{\n {}\n}}\n", pieces.join("\n  "))
        }

        fn read(&self) -> Result<VtkShaderSignature, &'static str> {
            VtkShaderSignature::read(VERTEX, "", &self.text())
        }
    }

    /// The default with something changed.
    fn with(change: impl FnOnce(&mut Parts)) -> Parts {
        let mut parts = Parts::default();
        change(&mut parts);
        parts
    }

    fn with_light(light: impl Into<String>) -> Result<VtkShaderSignature, &'static str> {
        with(|p| p.light = light.into()).read()
    }

    fn numbered(piece: &str, n: usize) -> String {
        (0..n).map(|i| piece.replace('#', &i.to_string())).collect()
    }

    #[test]
    fn headlights_and_light_kits_are_told_apart() {
        let head = with_light(HEADLIGHT).expect("known");
        assert!(head.headlight && head.lit && head.lights == 0 && !head.cosines_from_zero);
        let before =
            with_light(HEADLIGHT.replace(LEAST_AT_EYE[0], LEAST_AT_EYE[1])).expect("known");
        assert!(before.headlight && before.cosines_from_zero);
        let kit = |begin: &str, light: &str, n| [begin, &numbered(light, n), SUMMED].concat();
        let far = with_light(kit(SUNS, SUN, 5)).expect("known");
        assert!((far.headlight, far.lights, far.placed) == (false, 5, false));
        let near = with_light(kit(LAMPS, LAMP, 3)).expect("known");
        assert!((near.headlight, near.lights, near.placed) == (false, 3, true));
        let of_9_1 = SUN.replace(LEAST_ELSEWHERE[0], LEAST_ELSEWHERE[1]);
        let old = with_light(kit(SUNS, &of_9_1, 2)).expect("known");
        assert!(old.lights == 2 && old.cosines_from_zero);
        assert!(
            with_light(kit(LAMPS, LAMP.split_once(';').expect("two").1, 1)).is_err(),
            "not all of it"
        );
        assert!(with_light(kit(SUNS, SUN, MOST_LIGHTS + 1)).is_err(), "too many");
        assert!(with_light(kit(SUNS, SUN, 0)).is_err(), "lit by nothing");
        let twice = kit(SUNS, SUN, 1).replace("sign(df)", "sign(df)*2.0");
        assert!(with_light(twice).is_err(), "brighter than is known");
        let mixed = [SUNS, &numbered(SUN, 1), &of_9_1.replace('#', "1"), SUMMED].concat();
        assert!(with_light(mixed).is_err(), "two versions");
    }

    #[test]
    fn back_faces_clipping_planes_and_sums_are_known_as_a_whole() {
        let clips = VERTEX.replace("  vertexVC", &format!("{CLIPS} vertexVC"));
        let all = with(|p| {
            p.clip = CLIPPED.into();
            p.color += BACK[0];
            p.end = WEIGHTED.into();
        });
        let read = |parts: &Parts| VtkShaderSignature::read(&clips, "", &parts.text());
        let known = read(&all).expect("known");
        assert!(known.back && known.clipped && known.peel == TranslucencyPass::Weighted);
        assert!(read(&Parts::default()).is_err(), "planes that only the vertex shader knows");
        assert!(with(|p| p.clip = CLIPPED.into()).read().is_err(), "planes that nobody measures");
        for piece in [BACK[0], CLIPPED, WEIGHTED] {
            let pieces = split(piece).expect("balanced");
            for left_out in 0..pieces.len() {
                let mut less = pieces.clone();
                less.remove(left_out);
                let text = all.text().replace(piece, &less.concat());
                assert!(VtkShaderSignature::read(&clips, "", &text).is_err(), "{less:?}");
            }
        }
    }

    #[test]
    fn edges_are_known_where_the_geometry_shader_only_measures_them() {
        let geometry = |more: &str| {
            let (corners, emits) = (CORNERS.concat(), EMITS.concat());
            format!(
                "void main() {{ {MEASURES} {corners} vertexVCGSOutput = vertexVCVSOutput[i]; \
                 {more} {emits} }}"
            )
        };
        let edges = with(|p| p.edges = EDGES.into());
        let behind = edges.text().replace("VSOutput", "GSOutput");
        let known = VtkShaderSignature::read(VERTEX, &geometry(""), &behind).expect("known");
        assert!(known.edges && known.headlight);
        for more in ["gl_Position.xy += offsets[i];", "vertexVCGSOutput = vertexVCVSOutput[i];"] {
            assert!(VtkShaderSignature::read(VERTEX, &geometry(more), &behind).is_err(), "{more}");
        }
        assert!(edges.read().is_err(), "nobody measures");
        let plain = Parts::default().text();
        assert!(
            VtkShaderSignature::read(VERTEX, &geometry(""), &plain).is_err(),
            "nobody draws them"
        );
    }

    #[test]
    fn physically_based_materials_are_known_in_both_versions() {
        for end in PHYSICAL_ENDS {
            for (lights, n) in [(PHYSICAL_HEADLIGHT, 0), (PHYSICAL_SUN, 1), (PHYSICAL_LAMP, 1)] {
                let light = [ALBEDO, PHYSICAL, &numbered(lights, 1), end].concat();
                let whole = with(|p| p.light.clone_from(&light));
                let t = whole.read().expect("known");
                assert!(t.physical && t.lit && t.lights == n && t.headlight == (n == 0));
                assert!(with_light(light.clone() + SUMMED).is_err(), "two colours");
                assert!(
                    with_light(light.replace("float ao = 1.0", "float ao = texture(ao)")).is_err()
                );
                let colored = |light: &str| {
                    with(|p| {
                        p.light = light.into();
                        p.color = [SPECULAR, OF_VERTICES, LINEAR].concat();
                    })
                };
                assert!(colored(&light).read().expect("known").linear);
                assert!(colored(HEADLIGHT).read().is_err(), "not physically based");
            }
        }
    }

    #[test]
    fn pictures_are_known_where_they_are_the_last_that_happens_to_the_colour() {
        for (actor_texture, components) in COMPONENTS {
            let piece = |n: &str| [READS, components, MULTIPLIES].concat().replace('#', n);
            let on = |picture: String| with(|p| p.picture = picture).read();
            assert_eq!(on(piece("0")).map(|t| t.actor_texture), Ok(actor_texture));
            assert_eq!(on(piece("1")).map(|t| t.actor_texture), Ok(actor_texture));
            assert!(on(piece("0") + &piece("1")).is_err(), "two of them");
            assert!(with_light(piece("0") + HEADLIGHT).is_err(), "too early");
            let other = piece("0").replace("fragOutput0 * tcolor", "fragOutput0 + tcolor");
            assert_eq!(on(other), Err("a picture on a surface of VTK's"));
        }
    }

    #[test]
    fn depths_that_are_moved_back_are_known() {
        let moved = |how: &str| with(|p| p.depth = how.into()).read();
        for how in [MOVED[0].into(), MOVED[1].into(), [SLOPE, MOVED_BY_SLOPE[1]].concat()] {
            assert!(moved(&how).is_ok_and(|t| t.depth_offset), "{how}");
        }
        assert!(Parts::default().read().is_ok_and(|t| !t.depth_offset));
        let twice = MOVED_BY_SLOPE[1].replace("1.0*", "2.0*");
        assert!(moved(&[SLOPE, &twice].concat()).is_err());
        assert!(moved(&[MOVED[0], PEEL_DEPTHS].concat()).is_err(), "peeled as well");
    }

    #[test]
    fn coordinates_of_pictures_may_have_a_matrix_and_be_apart_from_those_of_colour_maps() {
        let vertex = |text: &str| {
            let vs = VERTEX.replace("  vertexVC", &format!("{text} vertexVC"));
            let t = VtkShaderSignature::read(&vs, "", &Parts::default().text());
            t.map(|t| (t.two_coordinates, t.has_texture_matrix))
        };
        assert_eq!(vertex(COORDINATES[1]), Ok((false, false)));
        assert_eq!(vertex(&COORDINATES.concat()), Ok((true, false)));
        assert_eq!(vertex(TURNED[1]), Ok((false, true)));
        assert_eq!(vertex(&TURNED.concat()), Ok((true, true)));
        assert!(vertex(&[COORDINATES[0], TURNED[1]].concat()).is_err(), "a matrix for one of them");
        assert!(vertex(&TURNED[1].replace(" / tcoordTmp.w", "")).is_err());
    }

    #[test]
    fn physically_based_materials_have_colours_from_pictures() {
        for (actor_texture, alpha) in ALBEDO_ALPHA {
            let light =
                [ALBEDO_OF_TEXTURE, alpha, PHYSICAL, PHYSICAL_HEADLIGHT, PHYSICAL_ENDS[0]].concat();
            let t = with_light(light.clone()).expect("known");
            assert!(t.physical && t.actor_texture == actor_texture);
            let other = light.replace("albedoSample.rgb *", "albedoSample.rgb +");
            assert_eq!(with_light(other), Err("a picture on a surface of VTK's"));
        }
    }

    #[test]
    fn normals_out_of_differences_are_known_with_and_without_a_scale() {
        let flat = |differences: &str| {
            with(|p| (p.depth, p.normal) = (differences.into(), FLAT.into())).read()
        };
        for differences in DIFFERENCES {
            assert!(flat(differences).expect("known").flat, "{differences}");
        }
        assert!(flat("").is_err(), "out of nothing");
    }

    #[test]
    fn passes_of_depth_peeling_are_known_only_with_all_of_their_statements() {
        let layers = PEEL_LAYERS.replace(OTHER_EPSILON[0], OTHER_EPSILON[1]);
        for (peel, begin, end) in [
            (TranslucencyPass::Depths, PEEL_DEPTHS, ""),
            (TranslucencyPass::Layers, PEEL_LAYERS, PEELED_LAYERS),
            (TranslucencyPass::Layers, &layers, PEELED_LAYERS),
        ] {
            let pass = |begin: &str, end: &str| {
                with(|p| (p.depth, p.end) = (begin.into(), end.into())).read()
            };
            let commented = end.replace("fragOutput0 = frag;", "fragOutput0 = frag; // the back\n");
            let known = pass(begin, &commented);
            assert_eq!(known.map(|t| (t.peel, t.headlight)), Ok((peel, true)));
            for (piece, is_begin) in [(begin, true), (end, false)] {
                let pieces = split(piece).expect("balanced");
                for left_out in 0..pieces.len() {
                    let mut less = pieces.clone();
                    less.remove(left_out);
                    let less = less.concat();
                    let known = if is_begin { pass(&less, end) } else { pass(begin, &less) };
                    assert!(known.is_err(), "{peel:?} with {less}");
                }
            }
            assert!(pass(&format!("{begin} gl_FragDepth = 0.5;"), end).is_err());
        }
        assert_eq!(Parts::default().read().map(|t| t.peel), Ok(TranslucencyPass::No));
    }

    #[test]
    fn a_statement_that_is_not_known_makes_the_program_the_drivers() {
        assert!(with_light("fragOutput0 = vec4(propID, 1.0);").is_err());
        let bent = "void main() { gl_Position = vec4(sin(t)); }";
        assert!(VtkShaderSignature::read(bent, "", &Parts::default().text()).is_err());
        let shadows = with(|p| p.picture = "fragOutput0.r = exp(depthC*ldepth);".into());
        assert_eq!(shadows.read(), Err(SHADOW_MAP));
        assert!(with_light("").is_err(), "lit, but by nothing that is known");
    }

    /// Surfaces of all kinds, as fragment shaders that are known.
    fn known_ones() -> Vec<String> {
        let kit = |begin: &str, light: &str| [begin, &numbered(light, 2), SUMMED].concat();
        let physical = [ALBEDO, PHYSICAL, &numbered(PHYSICAL_LAMP, 2), PHYSICAL_ENDS[0]].concat();
        let on_cells = [SPECULAR, CELLS, OF_TEXTURE, BACK[0], OVERRIDES].concat();
        let picture = [READS, COMPONENTS[0].1, MULTIPLIES].concat().replace('#', "0");
        let peeled = |p: &mut Parts| (p.depth, p.end) = (PEEL_LAYERS.into(), PEELED_LAYERS.into());
        let parts = [
            Parts::default(),
            with(|p| p.light = kit(SUNS, SUN)),
            with(|p| (p.light, p.color) = (kit(LAMPS, LAMP), on_cells)),
            with(|p| p.light = physical),
            with(|p| p.picture = picture),
            with(peeled),
            with(|p| (p.light, p.end) = (UNLIT.into(), WEIGHTED.into())),
            with(|p| (p.depth, p.normal) = (DIFFERENCES[1].into(), FLAT.into())),
        ];
        parts.iter().map(Parts::text).collect()
    }

    /// `main` of a source, statement by statement.
    fn body(text: &str) -> Vec<String> {
        statements(text, ShaderStage::Fragment).expect("known text")
    }

    fn source(body: &[String]) -> String {
        format!("#version 150\nvoid main()\n{{\n{}\n}}\n", body.join("\n"))
    }

    fn is_known(body: &[String]) -> bool {
        VtkShaderSignature::read(VERTEX, "", &source(body)).is_ok()
    }

    #[test]
    fn every_statement_is_needed_once_and_in_its_place() {
        for text in known_ones() {
            let whole = body(&text);
            assert!(is_known(&whole), "{text}");
            let read = |body: &[String]| VtkShaderSignature::read(VERTEX, "", &source(body));
            for at in 0..whole.len() {
                let mut less = whole.clone();
                let gone = less.remove(at);
                // Some pieces are there or not; what remains is then another surface.
                assert!(
                    read(&less) != read(&whole) || gone.starts_with("vec4vertexVC"),
                    "without {gone}"
                );
                let mut twice = whole.clone();
                twice.insert(at, gone.clone());
                assert!(!is_known(&twice), "twice {gone}");
                let mut commented = whole.clone();
                commented[at] = format!("// {gone}");
                assert_eq!(read(&commented), read(&less), "a comment is nothing: {gone}");
                let mut conditional = whole.clone();
                conditional[at] = format!("#if 0\n{gone}\n#endif");
                assert!(!is_known(&conditional), "in a condition: {gone}");
                if gone.ends_with(';') {
                    for head in
                        ["if (false)", "if (gl_FrontFacing)", "for (int k = 0; k < 2; k++)", ""]
                    {
                        let mut inside = whole.clone();
                        inside[at] = format!("{head} {{ {gone} }}");
                        assert!(!is_known(&inside), "{head} {{ {gone} }}");
                    }
                }
            }
        }
    }

    proptest! {
        #[test]
        fn statements_in_another_order_are_the_work_of_somebody_else(
            kind in 0_usize..8, a in any::<prop::sample::Index>(), b in any::<prop::sample::Index>()
        ) {
            let whole = body(&known_ones()[kind]);
            let (a, b) = (a.index(whole.len()), b.index(whole.len()));
            let mut swapped = whole.clone();
            swapped.swap(a, b);
            prop_assert_eq!(is_known(&swapped), whole[a] == whole[b]);
            let mut moved = whole.clone();
            let statement = moved.remove(a);
            moved.insert(b, statement);
            prop_assert_eq!(is_known(&moved), moved == whole);
        }

        #[test]
        fn anything_added_makes_a_program_the_drivers(
            kind in 0_usize..8,
            at in any::<prop::sample::Index>(),
            added in prop::sample::select(vec![
                "discard;", "return;", "diffuse *= 0.5;", "fragOutput0.r = \
                                                           1.0;", "{", "}", "{ }", "else",
                "#define pow(a, b) 1.0", "#line 3", "if (opacity > 2.0) discard;", "opacity = 0.5;",
                "float other;", "normalVCVSOutput = -normalVCVSOutput;", "gl_FragDepth = 0.5;",
            ])
        ) {
            let mut more = body(&known_ones()[kind]);
            more.insert(at.index(more.len() + 1), added.into());
            prop_assert!(!is_known(&more), "{}", more.join("\n"));
        }
    }
}
