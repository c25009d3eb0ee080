//! Why draws are left to the driver, in more words, and what can be done about it.

/// What a reason in a report means, and the cure, if there is one, without those that the run had
/// already: its mode, and `--trace all`. `None` for a reason that speaks for itself.
pub fn advice_for(reason: &str, mode: &str, traces_all: bool) -> Option<String> {
    let had = |part: &&str| {
        part.contains(&format!("--mode {mode}")) || traces_all && part.contains("--trace all")
    };
    let text = advice(reason)?;
    let parts: Vec<&str> = text.split("; ").filter(|part| !had(part)).collect();
    match parts.is_empty() {
        true => Some(format!("mode {mode} cannot trace it either")),
        false => Some(parts.join("; ")),
    }
}

/// What a reason in a report means, and the cure, if there is one. Cures stand behind semicolons.
/// `None` for a reason that speaks for itself.
pub fn advice(reason: &str) -> Option<&'static str> {
    TABLE.iter().find(|(start, _)| reason.starts_with(start)).map(|(_, text)| *text)
}

/// Mode `enhance` does not read shaders, but not every shader is one for it.
const NOT_RECOGNISED: &str = "not of a family that is recognised; --mode enhance needs no \
                              understanding, only OpenGL 3 and a vertex shader that multiplies \
                              positions by a matrix";

/// By the beginning of the reason.
const TABLE: &[(&str, &str)] = &[
    (
        "a surface of VTK's",
        "normal maps, environments, ambient occlusion and the like of VTK's own; --mode enhance \
         needs no understanding",
    ),
    (
        "a picture on",
        "textures of VTK's actors are not followed in its shaders; colours of points and cells are",
    ),
    (
        "surfaces that VTK draws again",
        "VTK draws them twice, the second time over themselves with shadow maps; --mode rich makes \
         shadows without these",
    ),
    (
        "a shadow map",
        "depths as a light sees them, for VTK's own shadows; --mode rich makes shadows without \
         these",
    ),
    (
        "translucent surfaces that VTK sums up",
        "traced in modes match, phong and rich, where VTK blends their sums as it does of itself",
    ),
    (
        "a buffer texture",
        "what VTK has for each cell comes in colours of bytes or floats; this one does not",
    ),
    (
        "a frame that costs the driver less",
        "in mode match both make the same picture, so each frame goes to whoever is cheaper; \
         --always-trace traces it all the same",
    ),
    ("lines", "lines and points are drawn by the driver and joined with the picture by depth"),
    ("points", "lines and points are drawn by the driver and joined with the picture by depth"),
    ("polygons drawn as lines", "a wireframe; show surfaces to have them traced"),
    (
        "selection or feedback",
        "the program finds out what is under the mouse; nothing is seen of that",
    ),
    ("tracing is off", "mode off, or `enabled = false`: switch it on with --mode or on the panel"),
    ("an assembly program", "ARB programs are not understood, and no mode traces them"),
    (
        "several colour buffers",
        "as in dual depth peeling or deferred shading; try the program's settings for translucency",
    ),
    (
        "a vertex shader that is no matrix",
        "positions are bent, displaced or projected by hand; only the driver knows where they end \
         up",
    ),
    ("positions that", "the vertex shader makes numbers that are no points"),
    ("a matrix that rays", "the matrix maps the scene onto a line or a point"),
    ("fewer vertices", "too few to tell a matrix from; --mode match does not need it"),
    (
        "a texture with anisotropic",
        "many samples along the longer side of a footprint, which is not followed",
    ),
    ("a texture with its components", "swizzled components are not followed"),
    (
        "masks or coverage of samples",
        "which samples of a pixel are written is the driver's to decide",
    ),
    ("a sampler object", "filters of sampler objects are not followed"),
    (
        "a texture with mipmaps or two filters",
        "in VTK's shaders, whose colour maps have one filter",
    ),
    ("a texture too large", "more than 67 million texels"),
    ("a texture of", "depths and integers are compared or cast, not sampled"),
    ("OpenGL ES", "programs for OpenGL ES are the driver's in every mode"),
    ("several texture units", "more than one texture at once is not traced"),
    ("a texture that is neither", "cube maps and volumes are not traced"),
    ("texture combiners", "GL_COMBINE is not traced"),
    (
        "texture without lighting",
        "labels and pictures on the screen mostly; --trace all traces them, too",
    ),
    (
        "stippled or smoothed",
        "a pattern of holes, or edges smoothed by blending, which the driver knows best",
    ),
    ("fog coordinates", "fog by coordinate or by distance in space is not traced; fog by depth is"),
    ("transform feedback", "the program reads vertices back; nothing is seen of that"),
    ("depth test", "such draws are mostly text, legends and menus; --trace all traces them, too"),
    (
        "no depth test",
        "such draws are mostly text, legends and menus; --trace all traces them, too",
    ),
    (
        "a test for equal depth",
        "depths of rays agree with the driver's to some steps only, so who drew first draws again",
    ),
    (
        "blending",
        "translucent in a way that is not followed; --trace all traces it in the order drawn",
    ),
    (
        "clip control",
        "another origin of the window or another range of depth than OpenGL had of old",
    ),
    (
        "a colour buffer of floats",
        "colours beyond black and white are kept there, and traced ones have eight bits",
    ),
    (
        "a framebuffer in sRGB",
        "colours are encoded after they were blended, and traced ones before",
    ),
    ("an alpha test for equality", "traced alphas have eight bits, which may miss the reference"),
    ("a program pipeline", "shaders of separate programs are the driver's"),
    (
        "a stencil of two sides",
        "front and back faces are masked differently, and fragments of ours have no sides",
    ),
    ("stencil", "drawn through a mask, as constructive solid geometry in image space is"),
    ("a shader", NOT_RECOGNISED),
    ("a program", NOT_RECOGNISED),
    ("a forked process", "a child made by fork has none of our threads"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_run_had_already_is_not_advised() {
        for (reason, mode) in [("a shader of its own", "enhance"), ("a shadow map", "rich")] {
            let other = advice_for(reason, "match", false).expect("known");
            assert!(other.contains(&format!("--mode {mode}")), "{other}");
            let same = advice_for(reason, mode, false).expect("known");
            assert!(!same.contains("--mode") && !same.is_empty(), "{same}");
        }
        let all = |on| advice_for("blending", "match", on).expect("known");
        assert!(all(false).contains("--trace all") && !all(true).contains("--trace all"));
        assert!(!advice("an assembly program").expect("known").contains("--mode"));
        assert_eq!(advice_for("an empty viewport", "match", true), None);
    }

    #[test]
    fn what_is_known_is_explained_and_what_is_not_is_left_alone() {
        assert!(advice("tracing is off").unwrap().contains("--mode"));
        assert!(advice("no depth test, or no depth mask").is_some());
        for known in ["a shadow map", "a buffer texture of a format that is not read"] {
            assert!(advice(known).is_some(), "{known}");
        }
        assert_eq!(advice("an empty viewport"), None);
        for (i, (a, _)) in TABLE.iter().enumerate() {
            let hidden = TABLE[..i].iter().any(|(b, _)| a.starts_with(b));
            assert!(!hidden, "`{a}` is never reached");
        }
    }
}
