//! VTK's shaders, statement by statement: what each of them means, and whether there are others.

use super::blocks::{
    BACK, BACK_UNLIT, CLIPPED, CLIPS, CLIPS_LATER, EDGES, EMITS, MEASURES, MOST_LIGHTS, TURNED, WEIGHTED,
    take, take_albedo, take_lights, take_physical, take_picture, without_peeling,
};

/// Where the surface's colour comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Colors {
    #[default]
    Uniform,
    /// Attribute `scalarColor`.
    PerVertex,
    /// Texture `colortexture` at attribute `tcoord`.
    Map,
    /// Buffer texture `textureC` at the number of the triangle.
    PerCell,
}

/// What a texture of the actor's does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Pictured {
    #[default]
    No,
    /// It multiplies the lit colour, by all of its components or by these.
    Rgba,
    Rgb,
    Grey,
    GreyAlpha,
    /// It is the colour of a physically based material; its alpha multiplies the opacity, or is it alone.
    Albedo,
    AlbedoAlone,
}

impl Pictured {
    /// True when light and all is multiplied.
    pub(super) fn is_over_all(self) -> bool {
        matches!(self, Pictured::Rgba | Pictured::Rgb | Pictured::Grey | Pictured::GreyAlpha)
    }
}

/// What a program does for translucency.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Peel {
    #[default]
    No,
    /// Finds how far surfaces reach.
    Depths,
    /// Takes off the nearest and the farthest layer.
    Layers,
    /// Sums up layers in any order.
    Weighted,
}

/// Why a program that draws depths for VTK's shadow maps is not known.
pub(super) const SHADOW_MAP: &str = "a shadow map";

/// What a program's text says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Template {
    pub(super) colors: Colors,
    pub(super) overrides: bool,
    /// Normals from the triangle instead of an attribute.
    pub(super) flat: bool,
    pub(super) headlight: bool,
    /// Number of lights elsewhere, and whether these may have places and cones.
    pub(super) lights: usize,
    pub(super) placed: bool,
    pub(super) lit: bool,
    pub(super) peel: Peel,
    /// Back faces have a material of their own.
    pub(super) back: bool,
    pub(super) clipped: bool,
    /// Edges of cells are drawn.
    pub(super) edges: bool,
    /// The material is physically based, and its colours are made linear for it.
    pub(super) physical: bool,
    pub(super) linear: bool,
    pub(super) pictured: Pictured,
    /// Colour map and picture have coordinates of their own, and whether a matrix multiplies those.
    pub(super) two_coordinates: bool,
    pub(super) turned: bool,
    /// Depths are moved back by the slope of the surface and a constant, for lines that lie on it.
    pub(super) moved_back: bool,
}

/// Statements of `main`, without blanks and comments; light numbers become `#`.
fn statements(source: &str) -> Option<Vec<String>> {
    let mut text = String::new();
    for line in source.lines() {
        let line = line.split("//").next().unwrap_or("");
        if !line.trim_start().starts_with('#') {
            text += line;
            text.push('\n');
        }
    }
    while let Some(start) = text.find("/*") {
        let end = text[start..].find("*/").map_or(text.len(), |e| start + e + 2);
        text.replace_range(start..end, " ");
    }
    let body = &text[text.find("void main")?..];
    let body = &body[body.find('{')? + 1..body.rfind('}')?];
    let squeezed: String = body.chars().filter(|c| !c.is_whitespace()).collect();
    Some(squeezed.split([';', '{', '}']).filter(|s| !s.is_empty()).map(str::to_owned).collect())
}

impl Template {
    /// Reads the shaders; the error says why the program is not recognised.
    pub(crate) fn read(vertex: &str, geometry: &str, fragment: &str) -> Result<Template, &'static str> {
        const NOT_VTK: &str = "a program that is not recognised";
        const UNKNOWN: &str = "a surface of VTK's with a statement that is not known";
        const PICTURE: &str = "a picture on a surface of VTK's";
        let mut t = Template::default();
        let (Some(mut vs), Some(mut fs)) = (statements(vertex), statements(fragment)) else {
            return Err(NOT_VTK);
        };
        if !geometry.is_empty() {
            // What goes through has another name behind it.
            fs.iter_mut().for_each(|s| *s = s.replace("GSOutput", "VSOutput"));
            t.read_geometry(geometry, &mut vs).ok_or("a geometry or tessellation shader")?;
        }
        if fs.iter().any(|s| s == "fragOutput0.r=exp(depthC*ldepth)") {
            return Err(SHADOW_MAP);
        }
        t.read_vertex(vs).ok_or(NOT_VTK)?;
        let pictured = |s: &String| s.contains("texture(actortexture") || s.contains("texture(albedoTex");
        let why = if fs.iter().any(pictured) { PICTURE } else { UNKNOWN };
        t.read_fragment(fs).ok_or(why)?;
        Ok(t)
    }

    /// The shader that measures edges, which changes nothing else. What it needs of the vertex shader's is taken out of that.
    fn read_geometry(&mut self, text: &str, vs: &mut Vec<String>) -> Option<()> {
        let mut gs: Vec<String> =
            statements(text)?.into_iter().map(|s| s.replace("GSOutput", "VSOutput")).collect();
        self.edges = take(&mut gs, MEASURES) && take(&mut gs, EMITS);
        self.clipped = take(&mut gs, CLIPS_LATER) && take(vs, &["clipVertexMC=vertexMC"]);
        let goes_through = |s: &String| {
            ["normalVC", "tcoordVC", "colorTCoordVC", "vertexColor", "vertexVC"]
                .iter()
                .any(|name| *s == format!("{name}VSOutput={name}VSOutput[i]"))
        };
        (self.edges && gs.iter().all(goes_through)).then_some(())
    }

    fn read_vertex(&mut self, mut vs: Vec<String>) -> Option<()> {
        self.clipped |= take(&mut vs, CLIPS);
        let [map, picture] = TURNED.map(|block| take(&mut vs, block));
        let has = |name: &str| vs.iter().any(|s| s.starts_with(name));
        let plain = [has("colorTCoordVCVSOutput="), has("tcoordVCVSOutput=")];
        self.turned = map || picture;
        self.two_coordinates = (map || plain[0]) && (picture || plain[1]);
        // A matrix for one kind of coordinates alone.
        if self.turned && plain != [false; 2] {
            return None;
        }
        let known = |s: &String| {
            matches!(
                s.as_str(),
                "normalVCVSOutput=normalMatrix*normalMC"
                    | "tcoordVCVSOutput=tcoord"
                    | "colorTCoordVCVSOutput=colorTCoord"
                    | "vertexColorVSOutput=scalarColor"
                    | "vertexVCVSOutput=MCVCMatrix*vertexMC"
                    | "gl_Position=MCDCMatrix*vertexMC"
            )
        };
        let places = vs.iter().any(|s| s == "gl_Position=MCDCMatrix*vertexMC");
        (places && vs.iter().all(known)).then_some(())
    }

    fn read_fragment(&mut self, fs: Vec<String>) -> Option<()> {
        let (peel, mut fs) = without_peeling(fs);
        self.peel = if take(&mut fs, WEIGHTED) { Peel::Weighted } else { peel };
        if self.peel != peel && peel != Peel::No {
            return None;
        }
        self.back = take(&mut fs, BACK) || take(&mut fs, BACK_UNLIT);
        if take(&mut fs, CLIPPED) != self.clipped || take(&mut fs, EDGES) != self.edges {
            return None;
        }
        self.pictured = take_albedo(&mut fs).or_else(|| take_picture(&mut fs)).unwrap_or_default();
        let physical = take_physical(&mut fs);
        self.physical = physical.is_some();
        self.lit = self.physical;
        let lights = physical.unwrap_or_else(|| take_lights(&mut fs));
        (self.headlight, self.lights, self.placed) = (lights.head, lights.others, lights.placed);
        for s in &fs {
            self.read_statement(s)?;
        }
        if self.moved_back && matches!(self.peel, Peel::Depths | Peel::Layers) {
            return None;
        }
        let one_kind = self.headlight != (self.lights > 0);
        ((!self.lit || one_kind) && self.lights <= MOST_LIGHTS).then_some(())
    }

    /// A statement that means something by itself.
    fn read_statement(&mut self, s: &str) -> Option<()> {
        match s {
            "vec4vertexVC=vertexVCVSOutput"
            | "vec3fdx=dFdx(vertexVC.xyz)"
            | "vec3fdy=dFdy(vertexVC.xyz)"
            // VTK 9.7 keeps the differences away from underflow; the normal is the same.
            | "floatscale=1.0/length(fwidth(vertexVC.xyz))"
            | "vec3fdx=dFdx(vertexVC.xyz)*scale"
            | "vec3fdy=dFdy(vertexVC.xyz)*scale"
            | "vec3specularColor=specularIntensity*specularColorUniform"
            | "floatspecularPower=specularPowerUniform"
            | "floatcscale=length(vec2(dFdx(gl_FragCoord.z),dFdy(gl_FragCoord.z)))"
            | "vec3ambientColor=ambientIntensity*ambientColorUniform"
            | "vec3diffuseColor=diffuseIntensity*diffuseColorUniform"
            | "floatopacity=opacityUniform"
            | "vec3normalVCVSOutput=normalize(normalVCVSOutput)"
            | "if(gl_FrontFacing==false)"
            | "normalVCVSOutput=-normalVCVSOutput"
            | "if(cameraParallel==1&&normalVCVSOutput.z<0.0)"
            | "if(cameraParallel==0&&dot(normalVCVSOutput,vertexVC.xyz)>0.0)"
            | "normalVCVSOutput=-1.0*normalVCVSOutput"
            | "floatdf"
            | "floatsf"
            | "vec3diffuse=vec3(0,0,0)"
            | "vec3specular=vec3(0,0,0)"
            | "vec3vertLightDirectionVC"
            | "floatattenuation"
            | "if(fragOutput0.a<=0.0)"
            | "discard"
            | "diffuse=diffuse*diffuseColor"
            | "specular=specular*specularColor"
            | "floatsf=pow(df,specularPower)"
            | "vec3diffuse=df*diffuseColor*lightColor0"
            | "vec3specular=sf*specularColor*lightColor0" => {}
            "vec4texColor=texture(colortexture,tcoordVCVSOutput.st)"
            | "vec4texColor=texture(colortexture,colorTCoordVCVSOutput.st)" => self.colors = Colors::Map,
            "vec4texColor=texelFetchBuffer(textureC,gl_PrimitiveID+PrimitiveIDOffset)" => {
                self.colors = Colors::PerCell;
            }
            "ambientColor=pow(ambientColor,vec3(2.2))" | "diffuseColor=pow(diffuseColor,vec3(2.2))"
                if self.physical && self.colors != Colors::Uniform =>
            {
                self.linear = true;
            }
            // Where it comes from was said before.
            "vec3ambientColor=ambientIntensity*texColor.rgb"
            | "vec3diffuseColor=diffuseIntensity*texColor.rgb"
            | "floatopacity=opacityUniform*texColor.a"
                if matches!(self.colors, Colors::Map | Colors::PerCell) => {}
            "vec3ambientColor=ambientIntensity*vertexColorVSOutput.rgb"
            | "vec3diffuseColor=diffuseIntensity*vertexColorVSOutput.rgb"
            | "floatopacity=opacityUniform*vertexColorVSOutput.a" => self.colors = Colors::PerVertex,
            // VTK 9.1 to 9.2 and ParaView, and 9.7.
            "gl_FragDepth=gl_FragCoord.z+1.0*cOffset/65000"
            | "gl_FragDepth=gl_FragCoord.z+1.0*cOffset/65000.0"
            | "gl_FragDepth=gl_FragCoord.z+cFactor*cscale+1.0*cOffset/65000"
            | "gl_FragDepth=gl_FragCoord.z+cFactor*cscale+1.0*cOffset/65000.0" => self.moved_back = true,
            "if(OverridesColor)" => self.overrides = true,
            "ambientColor=ambientColorUniform*ambientIntensity"
            | "diffuseColor=diffuseColorUniform*diffuseIntensity" => {}
            "vec3normalVCVSOutput=normalize(cross(fdx,fdy))" => self.flat = true,
            "floatdf=max(0.000001,normalVCVSOutput.z)" if !self.physical => self.headlight = true,
            "fragOutput0=vec4(ambientColor+diffuse+specular,opacity)" if !self.physical => self.lit = true,
            "fragOutput0=vec4(ambientColor+diffuseColor,opacity)" if !self.physical => self.lit = false,
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::blocks::{
        ALBEDO, ALBEDO_ALPHA, COMPONENTS, LAMP, MULTIPLIES, PASSES, PHYSICAL, PHYSICAL_ENDS,
        PHYSICAL_HEADLIGHT, PHYSICAL_LAMP, PHYSICAL_SUN, READS, SUN,
    };
    use super::*;

    const VERTEX: &str = "#version 150\nin vec4 vertexMC; // a comment\nvoid main()\n{\n  vertexVCVSOutput = MCVCMatrix * vertexMC;\n  gl_Position = MCDCMatrix * vertexMC;\n}\n";
    fn fragment(extra: &str) -> String {
        format!(
            "#version 150\n/* text */\nvoid main()\n{{\n vec4 vertexVC = vertexVCVSOutput;\n float opacity = opacityUniform;\n\
             vec3 normalVCVSOutput = normalize(normalVCVSOutput);\n if (gl_FrontFacing == false) {{ normalVCVSOutput = -normalVCVSOutput; }}\n\
             {extra}\n fragOutput0 = vec4(ambientColor + diffuse + specular, opacity);\n if (fragOutput0.a <= 0.0)\n {{\n discard;\n }}\n}}\n"
        )
    }

    fn read(fragment: &str) -> Result<Template, &'static str> {
        Template::read(VERTEX, "", fragment)
    }

    const HEAD: &str = "float df = max(0.000001, normalVCVSOutput.z);";

    #[test]
    fn headlights_and_light_kits_are_told_apart() {
        let head = read(&fragment(HEAD)).expect("known");
        assert!(head.headlight && head.lit && head.lights == 0);
        let kit = |block: &[&str], n: usize| -> String {
            (0..n).map(|i| block.join(";").replace('#', &i.to_string()) + ";").collect()
        };
        let far = read(&fragment(&kit(SUN, 5))).expect("known");
        assert!((far.headlight, far.lights, far.placed) == (false, 5, false));
        let near = read(&fragment(&kit(LAMP, 3))).expect("known");
        assert!((near.headlight, near.lights, near.placed) == (false, 3, true));
        assert!(read(&fragment(&kit(&LAMP[1..], 1))).is_err(), "not all of it");
        assert!(read(&fragment(&kit(SUN, MOST_LIGHTS + 1))).is_err(), "too many");
        let twice = kit(SUN, 1).replace("sign(df)", "sign(df)*2.0");
        assert!(read(&fragment(&twice)).is_err(), "brighter than is known");
    }

    #[test]
    fn back_faces_clipping_planes_and_sums_are_known_as_a_whole() {
        let parts = [BACK, CLIPPED, WEIGHTED].map(|block| block.join(";") + ";");
        let clips = VERTEX.replace("  vertexVC", &format!("{};vertexVC", CLIPS.join(";")));
        let read = |text: &str| Template::read(&clips, "", &fragment(text));
        let all = read(&format!("{}{HEAD}{}{}", parts[1], parts[0], parts[2])).expect("known");
        assert!(all.back && all.clipped && all.peel == Peel::Weighted);
        assert!(read(HEAD).is_err(), "planes that only the vertex shader knows");
        assert!(Template::read(VERTEX, "", &fragment(&format!("{}{HEAD}", parts[1]))).is_err());
        for block in [BACK, CLIPPED, WEIGHTED] {
            let less = block[..block.len() - 1].join(";");
            assert!(read(&format!("{}{HEAD}{less};", parts[1])).is_err(), "{less}");
        }
    }

    #[test]
    fn edges_are_known_where_the_geometry_shader_only_measures_them() {
        let geometry = |more: &str| {
            format!(
                "void main() {{ {}; vertexVCGSOutput = vertexVCVSOutput[i]; {more} {}; }}",
                MEASURES.join(";"),
                EMITS.join(";")
            )
        };
        let edges = format!("{};{HEAD}", EDGES.join(";"));
        let behind = fragment(&edges).replace("VSOutput", "GSOutput");
        let known = Template::read(VERTEX, &geometry(""), &behind).expect("known");
        assert!(known.edges && known.headlight);
        assert!(Template::read(VERTEX, &geometry("gl_Position.xy += offsets[i];"), &behind).is_err());
        assert!(Template::read(VERTEX, "", &fragment(&edges)).is_err(), "nobody measures");
        assert!(Template::read(VERTEX, &geometry(""), &fragment(HEAD)).is_err(), "nobody draws them");
    }

    #[test]
    fn physically_based_materials_are_known_in_both_versions() {
        for end in PHYSICAL_ENDS {
            for (lights, n) in [(PHYSICAL_HEADLIGHT, 0), (PHYSICAL_SUN, 1), (PHYSICAL_LAMP, 1)] {
                let text = [PHYSICAL, lights, end].concat().join(";").replace('#', "0") + ";";
                let whole = fragment(&text)
                    .replace("fragOutput0 = vec4(ambientColor + diffuse + specular, opacity);", "");
                let t = read(&whole).expect("known");
                assert!(t.physical && t.lit && t.lights == n && t.headlight == (n == 0));
                assert!(read(&fragment(&text)).is_err(), "two colours");
                assert!(read(&whole.replace("floatao=1.0", "floatao=texture(ao)")).is_err());
                let linear = "diffuseColor=pow(diffuseColor,vec3(2.2));";
                let colored = "float opacity = opacityUniform * vertexColorVSOutput.a;".to_owned() + linear;
                assert!(
                    read(&whole.replace("float opacity = opacityUniform;", &colored)).expect("known").linear
                );
                assert!(read(&fragment(&format!("{HEAD}{linear}"))).is_err(), "not physically based");
            }
        }
    }

    #[test]
    fn pictures_are_known_where_they_are_the_last_that_happens_to_the_colour() {
        let on = |picture: &str| {
            let text = fragment(HEAD);
            text.replace(" if (fragOutput0.a <= 0.0)", &format!("{picture} if (fragOutput0.a <= 0.0)"))
        };
        for (pictured, components) in COMPONENTS {
            let numbered = |n: &str| {
                let all = [READS].into_iter().chain(components).chain(MULTIPLIES);
                all.map(|s| s.replace('#', n) + ";").collect::<String>()
            };
            assert_eq!(read(&on(&numbered("0"))).map(|t| t.pictured), Ok(pictured));
            assert_eq!(read(&on(&numbered("1"))).map(|t| t.pictured), Ok(pictured));
            assert!(read(&on(&(numbered("0") + &numbered("1")))).is_err(), "two of them");
            assert!(read(&fragment(&format!("{HEAD}{}", numbered("0")))).is_err(), "too early");
            let other = numbered("0").replace("fragOutput0*tcolor", "fragOutput0+tcolor");
            assert_eq!(read(&on(&other)), Err("a picture on a surface of VTK's"));
        }
    }

    #[test]
    fn depths_that_are_moved_back_are_known() {
        let moved = |how: &str| format!("{HEAD} gl_FragDepth = gl_FragCoord.z + {how};");
        for how in ["1.0*cOffset/65000", "cFactor*cscale + 1.0*cOffset/65000.0"] {
            assert!(read(&fragment(&moved(how))).is_ok_and(|t| t.moved_back), "{how}");
        }
        assert!(read(&fragment(HEAD)).is_ok_and(|t| !t.moved_back));
        assert!(read(&fragment(&moved("cFactor*cscale + 2.0*cOffset/65000"))).is_err());
    }

    #[test]
    fn coordinates_of_pictures_may_have_a_matrix_and_be_apart_from_those_of_colour_maps() {
        let vertex = |text: &str| {
            let vs = VERTEX.replace("  vertexVC", &format!("{text};vertexVC"));
            Template::read(&vs, "", &fragment(HEAD)).map(|t| (t.two_coordinates, t.turned))
        };
        let plain = ["colorTCoordVCVSOutput=colorTCoord", "tcoordVCVSOutput=tcoord"];
        let turned = TURNED.map(|block| block.join(";"));
        assert_eq!(vertex(plain[1]), Ok((false, false)));
        assert_eq!(vertex(&plain.join(";")), Ok((true, false)));
        assert_eq!(vertex(&turned[1]), Ok((false, true)));
        assert_eq!(vertex(&turned.join(";")), Ok((true, true)));
        assert!(vertex(&format!("{};{}", plain[0], turned[1])).is_err(), "a matrix for one of them");
        assert!(vertex(&turned[1].replace("/tcoordTmp.w", "")).is_err());
    }

    #[test]
    fn physically_based_materials_have_colours_from_pictures() {
        for (pictured, alpha) in ALBEDO_ALPHA {
            let albedo = [ALBEDO[0], ALBEDO[1], alpha].join(";");
            let text = [PHYSICAL, PHYSICAL_HEADLIGHT, PHYSICAL_ENDS[0]].concat().join(";") + ";";
            let text = text.replacen(PHYSICAL[0], &albedo, 1);
            let whole = fragment(&text)
                .replace("fragOutput0 = vec4(ambientColor + diffuse + specular, opacity);", "");
            let t = read(&whole).expect("known");
            assert!(t.physical && t.pictured == pictured);
            let other = whole.replace("albedoSample.rgb*", "albedoSample.rgb+");
            assert_eq!(read(&other), Err("a picture on a surface of VTK's"));
        }
    }

    #[test]
    fn normals_out_of_differences_are_known_with_and_without_a_scale() {
        let normal = "vec3 normalVCVSOutput = normalize(cross(fdx,fdy));";
        for scale in ["", "*scale"] {
            let differences =
                format!("vec3 fdx = dFdx(vertexVC.xyz){scale}; vec3 fdy = dFdy(vertexVC.xyz){scale};");
            let first = if scale.is_empty() { "" } else { "float scale = 1.0/length(fwidth(vertexVC.xyz));" };
            let text = format!("{first}{differences}{normal}{HEAD}");
            assert!(read(&fragment(&text)).expect("known").flat, "{text}");
        }
    }

    #[test]
    fn passes_of_depth_peeling_are_known_only_with_all_of_their_statements() {
        for (peel, pass) in PASSES {
            let whole = pass.join(";") + ";";
            let read = |text: &str| read(&fragment(&format!("{text}{HEAD}")));
            let known = read(&whole.replace("fragOutput0=frag;", "fragOutput0 = frag; // the back\n"));
            assert_eq!(known.map(|t| (t.peel, t.headlight)), Ok((peel, true)));
            for left_out in pass {
                let n = pass.iter().filter(|s| *s == left_out).count();
                assert!(n > 1 || read(&whole.replace(left_out, "")).is_err(), "{peel:?} without {left_out}");
            }
            assert!(read(&format!("{whole} gl_FragDepth = 0.5;")).is_err());
        }
        assert_eq!(read(&fragment(HEAD)).map(|t| t.peel), Ok(Peel::No));
    }

    #[test]
    fn a_statement_that_is_not_known_makes_the_program_the_drivers() {
        let selector = "float df = max(0.000001, normalVCVSOutput.z); fragOutput0 = vec4(propID, 1.0);";
        assert!(read(&fragment(selector)).is_err());
        assert!(Template::read("void main() { gl_Position = vec4(sin(t)); }", "", &fragment(HEAD)).is_err());
        let shadows = format!("{HEAD} fragOutput0.r = exp(depthC*ldepth);");
        assert_eq!(read(&fragment(&shadows)), Err(SHADOW_MAP));
        assert!(read(&fragment("")).is_err(), "lit, but by nothing that is known");
    }
}
