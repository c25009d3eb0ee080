//! VTK's shaders, statement by statement: what each of them means, and whether there are others.

/// Where the surface's colour comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Colors {
    #[default]
    Uniform,
    /// Attribute `scalarColor`.
    PerVertex,
    /// Texture `colortexture` at attribute `tcoord`.
    Map,
}

/// What a program does for VTK's depth peeling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Peel {
    #[default]
    No,
    /// Finds how far surfaces reach.
    Depths,
    /// Takes off the nearest and the farthest layer.
    Layers,
}

/// The statements of a peeling pass, in their order; others may come between them.
const PASSES: [(Peel, &[&str]); 2] = [
    (
        Peel::Depths,
        &[
            "gl_FragDepth=gl_FragCoord.z",
            "ivec2pixel=ivec2(gl_FragCoord.xy)",
            "floatoDepth=texelFetch(opaqueDepth,pixel,0).y",
            "if(oDepth!=-1.&&gl_FragDepth>oDepth)",
            "fragOutput1.xy=vec2(-1.,oDepth)",
            "return",
            "else",
            "fragOutput1.xy=vec2(-gl_FragDepth,gl_FragDepth)",
            "return",
        ],
    ),
    (
        Peel::Layers,
        &[
            "gl_FragDepth=gl_FragCoord.z",
            "ivec2pixelCoord=ivec2(gl_FragCoord.xy)",
            "vec4front=texelFetch(lastFrontPeel,pixelCoord,0)",
            "vec2minMaxDepth=texelFetch(lastDepthPeel,pixelCoord,0).xy",
            "floatminDepth=-minMaxDepth.x",
            "floatmaxDepth=minMaxDepth.y",
            "floatepsilon=0.0000001",
            "fragOutput0=vec4(0.)",
            "fragOutput1=front",
            "fragOutput2.xy=vec2(-1.)",
            "if(gl_FragDepth<minDepth-epsilon||gl_FragDepth>maxDepth+epsilon)",
            "return",
            "if(gl_FragDepth>minDepth+epsilon&&gl_FragDepth<maxDepth-epsilon)",
            "fragOutput2.xy=vec2(-gl_FragDepth,gl_FragDepth)",
            "return",
            "vec4frag=fragOutput0",
            "if(gl_FragDepth>=minDepth-epsilon&&gl_FragDepth<=minDepth+epsilon)",
            "fragOutput0=vec4(0.)",
            "front.a=1.-front.a",
            "fragOutput1.rgb=front.a*frag.a*frag.rgb+front.rgb",
            "fragOutput1.a=1.-(front.a*(1.-frag.a))",
            "else",
            "frag.rgb*=frag.a",
            "fragOutput0=frag",
        ],
    ),
];

/// The pass that statements are of, without those of the pass.
fn without_peeling(statements: Vec<String>) -> (Peel, Vec<String>) {
    for (peel, pass) in PASSES {
        let mut left = pass.iter().peekable();
        let rest: Vec<String> = statements
            .iter()
            // The tolerance has another power of ten in other versions.
            .map(|s| if s == "floatepsilon=0.000001" { "floatepsilon=0.0000001" } else { s.as_str() })
            .filter(|s| left.next_if(|p| *p == s).is_none())
            .map(str::to_owned)
            .collect();
        if left.next().is_none() {
            return (peel, rest);
        }
    }
    (Peel::No, statements)
}

/// What a program's text says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Template {
    pub(super) colors: Colors,
    pub(super) overrides: bool,
    /// Normals from the triangle instead of an attribute.
    pub(super) flat: bool,
    pub(super) headlight: bool,
    /// Number of directional lights.
    pub(super) directional: usize,
    pub(super) lit: bool,
    pub(super) peel: Peel,
}

const MOST_LIGHTS: usize = 6;

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

/// Light numbers out of a statement.
fn without_light(s: &str) -> (String, Option<usize>) {
    for name in ["lightDirectionVC", "lightColor"] {
        if let Some(at) = s.find(name) {
            let digit = s[at + name.len()..].chars().next().and_then(|c| c.to_digit(10));
            if let Some(d) = digit {
                let mut out = s.to_owned();
                for n in ["lightDirectionVC", "lightColor"] {
                    out = out.replace(&format!("{n}{d}"), n);
                }
                return (out, Some(d as usize));
            }
        }
    }
    (s.to_owned(), None)
}

impl Template {
    /// Reads the shaders; the error says why the program is not recognised.
    pub(crate) fn read(vertex: &str, fragment: &str) -> Result<Template, &'static str> {
        const NOT_VTK: &str = "a program that is not recognised";
        let (Some(vs), Some(fs)) = (statements(vertex), statements(fragment)) else { return Err(NOT_VTK) };
        let (peel, fs) = without_peeling(fs);
        let mut t = Template { peel, ..Template::default() };
        for s in &vs {
            match s.as_str() {
                "normalVCVSOutput=normalMatrix*normalMC"
                | "tcoordVCVSOutput=tcoord"
                | "colorTCoordVCVSOutput=colorTCoord"
                | "vertexColorVSOutput=scalarColor"
                | "vertexVCVSOutput=MCVCMatrix*vertexMC"
                | "gl_Position=MCDCMatrix*vertexMC" => {}
                _ => return Err(NOT_VTK),
            }
        }
        if !vs.iter().any(|s| s == "gl_Position=MCDCMatrix*vertexMC") {
            return Err(NOT_VTK);
        }
        for s in &fs {
            let (s, light) = without_light(s);
            match s.as_str() {
                "vec4vertexVC=vertexVCVSOutput"
                | "vec3fdx=dFdx(vertexVC.xyz)"
                | "vec3fdy=dFdy(vertexVC.xyz)"
                // VTK 9.7 keeps the differences away from underflow; the normal is the same.
                | "floatscale=1.0/length(fwidth(vertexVC.xyz))"
                | "vec3fdx=dFdx(vertexVC.xyz)*scale"
                | "vec3fdy=dFdy(vertexVC.xyz)*scale"
                | "vec3specularColor=specularIntensity*specularColorUniform"
                | "floatspecularPower=specularPowerUniform"
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
                | "if(fragOutput0.a<=0.0)"
                | "discard"
                | "diffuse=diffuse*diffuseColor"
                | "specular=specular*specularColor"
                | "diffuse+=(df*lightColor)"
                | "specular+=(sf*lightColor)"
                | "floatsf=pow(df,specularPower)"
                | "vec3diffuse=df*diffuseColor*lightColor"
                | "vec3specular=sf*specularColor*lightColor"
                | "sf=sign(df)*pow(max(1e-5,dot(reflect(lightDirectionVC,normalVCVSOutput),normalize(-vertexVC.xyz))),specularPower)" =>
                    {}
                "vec4texColor=texture(colortexture,tcoordVCVSOutput.st)"
                | "vec4texColor=texture(colortexture,colorTCoordVCVSOutput.st)" => t.colors = Colors::Map,
                "vec3ambientColor=ambientIntensity*texColor.rgb"
                | "vec3diffuseColor=diffuseIntensity*texColor.rgb"
                | "floatopacity=opacityUniform*texColor.a" => t.colors = Colors::Map,
                "vec3ambientColor=ambientIntensity*vertexColorVSOutput.rgb"
                | "vec3diffuseColor=diffuseIntensity*vertexColorVSOutput.rgb"
                | "floatopacity=opacityUniform*vertexColorVSOutput.a" => t.colors = Colors::PerVertex,
                "if(OverridesColor)" => t.overrides = true,
                "ambientColor=ambientColorUniform*ambientIntensity"
                | "diffuseColor=diffuseColorUniform*diffuseIntensity" => {}
                "vec3normalVCVSOutput=normalize(cross(fdx,fdy))" => t.flat = true,
                "floatdf=max(0.000001,normalVCVSOutput.z)" if light.is_none() => t.headlight = true,
                "df=max(0.0,dot(normalVCVSOutput,-lightDirectionVC))" => {
                    t.directional = t.directional.max(light.unwrap_or(0) + 1);
                }
                "fragOutput0=vec4(ambientColor+diffuse+specular,opacity)" => t.lit = true,
                "fragOutput0=vec4(ambientColor+diffuseColor,opacity)" => t.lit = false,
                _ => return Err(NOT_VTK),
            }
        }
        let one_kind = t.headlight != (t.directional > 0);
        if (t.lit && !one_kind) || t.directional > MOST_LIGHTS { Err(NOT_VTK) } else { Ok(t) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERTEX: &str = "#version 150\nin vec4 vertexMC; // a comment\nvoid main()\n{\n  vertexVCVSOutput = MCVCMatrix * vertexMC;\n  gl_Position = MCDCMatrix * vertexMC;\n}\n";
    fn fragment(extra: &str) -> String {
        format!(
            "#version 150\n/* text */\nvoid main()\n{{\n vec4 vertexVC = vertexVCVSOutput;\n float opacity = opacityUniform;\n\
             vec3 normalVCVSOutput = normalize(normalVCVSOutput);\n if (gl_FrontFacing == false) {{ normalVCVSOutput = -normalVCVSOutput; }}\n\
             {extra}\n fragOutput0 = vec4(ambientColor + diffuse + specular, opacity);\n if (fragOutput0.a <= 0.0)\n {{\n discard;\n }}\n}}\n"
        )
    }

    #[test]
    fn headlights_and_light_kits_are_told_apart() {
        let head = Template::read(VERTEX, &fragment("float df = max(0.000001, normalVCVSOutput.z);"))
            .expect("known");
        assert!(head.headlight && head.lit && head.directional == 0);
        let kit = "df = max(0.0, dot(normalVCVSOutput, -lightDirectionVC0)); df = max(0.0, dot(normalVCVSOutput, -lightDirectionVC4));";
        assert_eq!(Template::read(VERTEX, &fragment(kit)).expect("known").directional, 5);
    }

    #[test]
    fn normals_out_of_differences_are_known_with_and_without_a_scale() {
        let head = "float df = max(0.000001, normalVCVSOutput.z);";
        let normal = "vec3 normalVCVSOutput = normalize(cross(fdx,fdy));";
        for scale in ["", "*scale"] {
            let differences =
                format!("vec3 fdx = dFdx(vertexVC.xyz){scale}; vec3 fdy = dFdy(vertexVC.xyz){scale};");
            let first = if scale.is_empty() { "" } else { "float scale = 1.0/length(fwidth(vertexVC.xyz));" };
            let text = format!("{first}{differences}{normal}{head}");
            assert!(Template::read(VERTEX, &fragment(&text)).expect("known").flat, "{text}");
        }
    }

    #[test]
    fn passes_of_depth_peeling_are_known_only_with_all_of_their_statements() {
        let head = "float df = max(0.000001, normalVCVSOutput.z);";
        for (peel, pass) in PASSES {
            let whole = pass.join(";") + ";";
            let read = |text: &str| Template::read(VERTEX, &fragment(&format!("{text}{head}")));
            let known = read(&whole.replace("fragOutput0=frag;", "fragOutput0 = frag; // the back\n"));
            assert_eq!(known.map(|t| (t.peel, t.headlight)), Ok((peel, true)));
            for left_out in pass {
                let n = pass.iter().filter(|s| *s == left_out).count();
                assert!(n > 1 || read(&whole.replace(left_out, "")).is_err(), "{peel:?} without {left_out}");
            }
            assert!(read(&format!("{whole} gl_FragDepth = 0.5;")).is_err());
        }
        assert_eq!(Template::read(VERTEX, &fragment(head)).map(|t| t.peel), Ok(Peel::No));
    }

    #[test]
    fn a_statement_that_is_not_known_makes_the_program_the_drivers() {
        let selector = "float df = max(0.000001, normalVCVSOutput.z); fragOutput0 = vec4(propID, 1.0);";
        assert!(Template::read(VERTEX, &fragment(selector)).is_err());
        assert!(Template::read("void main() { gl_Position = vec4(sin(t)); }", &fragment("")).is_err());
        assert!(Template::read(VERTEX, &fragment("")).is_err(), "lit, but by nothing that is known");
    }
}
