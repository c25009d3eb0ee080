//! Reads the GLSL sources of programs: removes comments, evaluates conditions, checks declarations
//! and functions, and splits `main` into statements that keep their order and their braces.
//!
//! Anything that is not understood makes the whole source unknown: a condition or a macro, a
//! function, a global variable, an interpolation.

/// The shader stage of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShaderStage {
    Vertex,
    Geometry,
    Fragment,
}

/// The inputs and outputs of VTK's surfaces, with the suffix of vertex shaders if any.
const PASSED_ON: [&str; 16] = [
    "vertexMC",
    "normalMC",
    "scalarColor",
    "tcoord",
    "colorTCoord",
    "clipVertexMC",
    "edgeEqn",
    "vertexVCVSOutput",
    "normalVCVSOutput",
    "tcoordVCVSOutput",
    "colorTCoordVCVSOutput",
    "vertexColorVSOutput",
    "clipDistancesVSOutput",
    "glyphColor",
    "GCMCMatrix",
    "glyphNormalMatrix",
];

/// The macros of VTK's preambles, which rename what has other names in other dialects.
const MACROS: [&str; 10] = [
    "highp",
    "mediump",
    "lowp",
    "texelFetchBuffer texelFetch",
    "texture1D texture",
    "texture2D texture",
    "texture3D texture",
    "attribute in",
    "varying in",
    "varying out",
];

/// Digests of the functions that VTK puts before `main` for physically based materials without
/// anisotropy and coats: `D_GGX` (of 9.1 to 9.6, and of 9.7), `V_SmithCorrelated`, `F_Schlick`,
/// `DiffuseLambert`, `SpecularIsotropic`.
const FUNCTIONS: [u64; 6] = [
    0x63f1_1147_1b76_8cc1,
    0xfc52_4a4f_f71e_6bae,
    0x658a_8f06_7050_54c1,
    0xa625_93eb_f021_e3d1,
    0x5e7a_6cd8_d26b_7a8d,
    0xbb8a_0812_74c1_2afe,
];

/// The statements of a shader's `main`. `None` when the source has anything that VTK's surfaces do
/// not have.
pub(super) fn statements(source: &str, stage: ShaderStage) -> Option<Vec<String>> {
    let text = with_conditions_resolved(&without_comments(source))?;
    let (mut main, mut outputs) = (None, Vec::new());
    let (mut item, mut depth) = (String::new(), 0_usize);
    for c in text.chars() {
        depth += usize::from(c == '{');
        if c == '}' {
            depth = depth.checked_sub(1)?;
        }
        item.push(c);
        if depth > 0 || !matches!(c, ';' | '}') {
            continue;
        }
        match item.strip_suffix(';') {
            Some(declaration) => outputs.extend(output_declaration(declaration, stage)?),
            None => {
                let text = without_whitespace(&item);
                match text.strip_prefix("voidmain(){").and_then(|t| t.strip_suffix('}')) {
                    Some(body) if main.is_none() => main = Some(split(body)?),
                    _ if FUNCTIONS.contains(&digest(&text)) => {}
                    _ => return None,
                }
            }
        }
        item.clear();
    }
    let main = main.filter(|_| item.trim().is_empty() && depth == 0)?;
    // An output that is never written may have any value.
    let written = |name: &String| main.iter().any(|s| assigns(s, name));
    (stage == ShaderStage::Fragment || outputs.iter().all(written)).then_some(main)
}

/// Statements without blanks: those with a semicolon, heads of blocks without one, and braces.
///
/// Blanks are removed, also between a type and a name, so `vec4 x` and `vec4x` are equal here. The
/// second could only be a variable of that name, and a source may declare only inputs, outputs and
/// uniforms, by [`output_declaration`].
pub(super) fn split(body: &str) -> Option<Vec<String>> {
    let (mut out, mut statement) = (Vec::new(), String::new());
    let (mut parentheses, mut braces) = (0_usize, 0_usize);
    for c in body.chars().filter(|c| !c.is_whitespace()) {
        match c {
            '(' => parentheses += 1,
            ')' => parentheses = parentheses.checked_sub(1)?,
            '{' | '}' if parentheses > 0 => return None,
            '{' => {
                braces += 1;
                if !statement.is_empty() {
                    out.push(std::mem::take(&mut statement));
                }
                out.push("{".into());
                continue;
            }
            '}' => {
                braces = braces.checked_sub(1)?;
                if !statement.is_empty() {
                    return None;
                }
                out.push("}".into());
                continue;
            }
            // VTK leaves empty statements.
            ';' if parentheses == 0 && statement.is_empty() => continue,
            _ => {}
        }
        statement.push(c);
        if c == ';' && parentheses == 0 {
            out.push(std::mem::take(&mut statement));
        }
    }
    (statement.is_empty() && parentheses == 0 && braces == 0).then_some(out)
}

pub(super) fn without_whitespace(text: &str) -> String {
    text.chars().filter(|c| !c.is_whitespace()).collect()
}

fn assigns(statement: &str, name: &str) -> bool {
    statement.strip_prefix(name).is_some_and(|rest| rest.starts_with(['=', '[']))
}

/// FNV-1a, which is the same on all machines.
fn digest(text: &str) -> u64 {
    text.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

/// The source with continued lines joined, and a blank for each comment.
pub(super) fn without_comments(source: &str) -> String {
    let text = source.replace("\r\n", "\n").replace("\\\n", "");
    let (mut out, mut rest) = (String::with_capacity(text.len()), text.as_str());
    while let Some(at) = rest.find('/') {
        let (before, comment) = rest.split_at(at);
        out.push_str(before);
        rest = if comment.starts_with("//") {
            comment.find('\n').map_or("", |end| &comment[end..])
        } else if let Some(inside) = comment.strip_prefix("/*") {
            out.push(' ');
            inside.find("*/").map_or("", |end| &inside[end + 2..])
        } else {
            out.push('/');
            &comment[1..]
        };
    }
    out + rest
}

/// The lines that remain when conditions are evaluated as by desktop OpenGL. `None` when a
/// condition is unknown.
fn with_conditions_resolved(text: &str) -> Option<String> {
    let mut out = String::new();
    let mut version = 110;
    // For each open condition: whether its lines count, and whether `else` came.
    let mut open: Vec<(bool, bool)> = Vec::new();
    for line in text.lines() {
        let counts = open.iter().all(|(counts, _)| *counts);
        let Some(directive) = line.trim_start().strip_prefix('#') else {
            if counts {
                out.push_str(line);
                out.push('\n');
            }
            continue;
        };
        let words: Vec<&str> = directive.split_whitespace().collect();
        match words.as_slice() {
            // A line that is left out needs no decision.
            ["if" | "ifdef" | "ifndef", ..] if !counts => open.push((false, false)),
            ["ifdef", name] => open.push((is_defined(name)?, false)),
            ["ifndef", name] => open.push((!is_defined(name)?, false)),
            ["if", "__VERSION__", ">=", "150"] => open.push((version >= 150, false)),
            ["if", "__VERSION__", "==", "150"] => open.push((version == 150, false)),
            ["else"] => {
                let (counts, is_second) = open.last_mut()?;
                if std::mem::replace(is_second, true) {
                    return None;
                }
                *counts = !*counts;
            }
            ["endif"] => {
                open.pop()?;
            }
            _ if !counts => {}
            ["version", number] => version = number.parse().ok()?,
            ["define", what @ ..] if MACROS.contains(&what.join(" ").as_str()) => {}
            _ => return None,
        }
    }
    open.is_empty().then_some(out)
}

fn is_defined(name: &str) -> Option<bool> {
    // Other macros are refused where they are defined.
    ["GL_ES", "ANISOTROPY", "CLEAR_COAT"].contains(&name).then_some(false)
}

/// Checks a global declaration. Returns the name of an output, or `None` when VTK's surfaces have
/// no such declaration.
fn output_declaration(text: &str, stage: ShaderStage) -> Option<Option<String>> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let plain = |name: &str| {
        let name = name.split('[').next().unwrap_or("");
        let is_name =
            !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
        is_name.then(|| name.to_owned())
    };
    let of_edges = words.first() == Some(&"noperspective");
    match &words[usize::from(of_edges)..] {
        [] => Some(None),
        [storage @ ("in" | "out"), _, name] => {
            let name = plain(name)?;
            let known = PASSED_ON.contains(&name.replace("GSOutput", "VSOutput").as_str())
                || (stage == ShaderStage::Fragment
                    && *storage == "out"
                    && ["fragOutput0", "fragOutput1", "fragOutput2"].contains(&name.as_str()));
            let is_out = *storage == "out";
            (known && (!of_edges || name == "edgeEqn")).then_some(Some(name).filter(|_| is_out))
        }
        // Uniforms that no statement uses have no effect. The others are queried by name.
        ["uniform", _, name] if !of_edges => {
            plain(name).filter(|name| !PASSED_ON.contains(&name.as_str())).map(|_| None)
        }
        ["precision", ..] if !of_edges => Some(None),
        _ => {
            let text = without_whitespace(text);
            let exact = match stage {
                ShaderStage::Geometry => {
                    ["layout(triangles)in", "layout(triangle_strip,max_vertices=3)out"].as_slice()
                }
                _ => &["constfloatPI=3.14159265359", "constfloatrecPI=0.31830988618"],
            };
            exact.contains(&text.as_str()).then_some(None)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(source: &str) -> Option<Vec<String>> {
        statements(source, ShaderStage::Fragment)
    }

    #[test]
    fn statements_keep_their_order_and_their_braces() {
        let text = "#version 150\n/* a */ void main()\n{ for (int i = 0; i < 3; i++) { a\\\n = b; \
                    ; } // c\n if (d) e = 1; else { f; } }";
        let expected =
            ["for(inti=0;i<3;i++)", "{", "a=b;", "}", "if(d)e=1;", "else", "{", "f;", "}"];
        assert_eq!(read(text).expect("known"), expected);
        assert_eq!(
            read("void main() { if (a); { b; } }").expect("known"),
            ["if(a);", "{", "b;", "}"]
        );
        assert_eq!(read("void main() { a = b; // c = d;\n/* e; */ }").expect("known"), ["a=b;"]);
    }

    #[test]
    fn conditions_are_decided_or_make_the_source_unknown() {
        let with = |lines: &str| read(&format!("#version 150\nvoid main() {{\n{lines}\n}}"));
        assert_eq!(with("#ifdef GL_ES\na;\n#else\nb;\n#endif").expect("known"), ["b;"]);
        assert_eq!(
            with("#ifndef GL_ES\na;\n#ifdef CLEAR_COAT\nb;\n#endif\n#endif").expect("known"),
            ["a;"]
        );
        assert_eq!(with("#ifdef GL_ES\n#if 1\na;\n#endif\n#endif").expect("known"), [""; 0]);
        for unknown in [
            "#if 0\na;\n#endif",
            "#ifdef OTHER\na;\n#endif",
            "#define a b",
            "#define highp 2.0*",
            "#undef highp",
            "#ifdef GL_ES\na;",
            "#else\n#endif",
            "#ifdef GL_ES\n#else\n#else\n#endif",
            "#extension X : enable",
        ] {
            assert_eq!(with(unknown), None, "{unknown}");
        }
    }

    #[test]
    fn declarations_and_functions_beside_main_are_known_ones() {
        let with = |text: &str, stage| {
            statements(&format!("{text} void main() {{ a; }}"), stage).is_some()
        };
        let known = [
            "in vec4 vertexVCVSOutput;",
            "uniform float x; uniform vec4 clipPlanes[6];",
            "noperspective in vec4 edgeEqn[3];",
            "out vec4 fragOutput0;",
            "const float PI = 3.14159265359;",
        ];
        assert!(known.iter().all(|text| with(text, ShaderStage::Fragment)));
        let unknown = [
            "flat in vec3 normalVCVSOutput;",
            "noperspective in vec3 normalVCVSOutput;",
            "centroid in vec3 normalVCVSOutput;",
            "in vec3 lightColor0;",
            "uniform vec3 normalVCVSOutput;",
            "const vec3 lightColor0 = vec3(1);",
            "vec3 lightColor0 = vec3(1);",
            "const float PI = 3.0;",
            "float pow(float a, float b) { return a; }",
            "uniform Block { vec3 lightColor0; };",
            "layout(early_fragment_tests) in;",
        ];
        for text in unknown {
            assert!(!with(text, ShaderStage::Fragment), "{text}");
        }
        assert!(!with("out vec3 normalVCVSOutput;", ShaderStage::Vertex), "nobody writes it");
        assert!(!with("void main() {}", ShaderStage::Fragment), "two of them");
    }

    #[test]
    fn what_is_not_balanced_is_unknown() {
        for text in [
            "void main() { a; ",
            "void main() { a; } }",
            "void main() { a }",
            "void main() { (a; }",
            "",
        ] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
