//! Tests of the recognition, with shaders put together from VTK's blocks.

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
    let before = with_light(HEADLIGHT.replace(LEAST_AT_EYE[0], LEAST_AT_EYE[1])).expect("known");
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
    assert!(VtkShaderSignature::read(VERTEX, &geometry(""), &plain).is_err(), "nobody draws them");
}

#[test]
fn glyphs_are_known_where_matrix_colour_and_place_are_all_the_copys_own() {
    let vertex = |pieces: &[&str]| {
        format!("in vec4 vertexMC; in mat4 GCMCMatrix; void main() {{ {} }}", pieces.join(" "))
    };
    let [view, place, clips] =
        [VERTEX_VIEW, VERTEX_PLACE, CLIPS].map(|piece| piece.replace("vertexMC", "vertex"));
    let colored = |own: &str| with(|p| p.color += own);
    let read = |vertex: &str, parts: &Parts| VtkShaderSignature::read(vertex, "", &parts.text());
    let all = [GLYPH, GLYPH_COLOR, GLYPH_NORMAL, &view, &place];
    let known = read(&vertex(&all), &colored(GLYPH_COLORS[0])).expect("known");
    assert!(known.glyphs && known.colors == ColorSource::PerVertex && !known.back);
    let back = with(|p| p.color += &[BACK[0], GLYPH_COLORS[1]].concat());
    assert!(read(&vertex(&all), &back).is_ok_and(|t| t.glyphs && t.back));
    let clipped = with(|p| {
        p.clip = CLIPPED.into();
        p.color += GLYPH_COLORS[0];
    });
    let cut = [GLYPH, &clips, GLYPH_COLOR, GLYPH_NORMAL, &view, &place];
    assert!(read(&vertex(&cut), &clipped).is_ok_and(|t| t.glyphs && t.clipped));
    assert!(read(&vertex(&all), &Parts::default()).is_err(), "not its own colour");
    assert!(read(VERTEX, &colored(GLYPH_COLORS[0])).is_err(), "a colour of no copy");
    assert!(read(&vertex(&all), &colored(GLYPH_COLORS[1])).is_err(), "back faces without material");
    for left_out in [0, 1, 4] {
        let mut less = all.to_vec();
        less.remove(left_out);
        let read = read(&vertex(&less), &colored(GLYPH_COLORS[0]));
        assert!(read.is_err(), "without {}", all[left_out]);
    }
    let of_source = [GLYPH, GLYPH_COLOR, GLYPH_NORMAL, VERTEX_VIEW, VERTEX_PLACE];
    assert!(read(&vertex(&of_source), &colored(GLYPH_COLORS[0])).is_err(), "placed by nobody");
    let uniform = vertex(&all).replace("in mat4", "uniform mat4");
    assert!(read(&uniform, &colored(GLYPH_COLORS[0])).is_err(), "one copy a call, as for picking");
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
            assert!(with_light(light.replace("float ao = 1.0", "float ao = texture(ao)")).is_err());
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
        let pass =
            |begin: &str, end: &str| with(|p| (p.depth, p.end) = (begin.into(), end.into())).read();
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
                for head in ["if (false)", "if (gl_FrontFacing)", "for (int k = 0; k < 2; k++)", ""]
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
