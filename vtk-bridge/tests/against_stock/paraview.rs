//! The same unmodified scripts in Debian's ParaView 5.11, without and with the bridge.

use crate::peers::skip;
use crate::scripts::differences;
use crate::session::{Program, Run, With, output, scripts_in};
use std::sync::OnceLock;

fn both() -> Option<&'static (Run, Run)> {
    static BOTH: OnceLock<Result<(Run, Run), String>> = OnceLock::new();
    let made = BOTH.get_or_init(|| {
        let scripts = scripts_in("paraview");
        let stock =
            Run::new(Program::ParaView, With::Stock, &scripts, output("paraview-stock"), &[])?;
        Ok((
            stock,
            Run::new(Program::ParaView, With::Bridge, &scripts, output("paraview-ours"), &[])?,
        ))
    });
    made.as_ref().map_err(|reason| skip(reason)).ok()
}

fn same_as_stock(script: &str) {
    let Some((stock, ours)) = both() else { return };
    let found = differences(stock, ours, script, &[], &[]);
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

macro_rules! scripts {
    ($($test:ident: $script:literal,)*) => {
        /// Every script has a test.
        const TESTED: &[&str] = &[$($script),*];
        $(#[test]
        fn $test() {
            same_as_stock($script);
        })*
    };
}

scripts! {
    paraview_annotations_stay_opengl: "annotations",
    paraview_blocks_have_their_colors: "blocks",
    paraview_contours_are_stock: "contours",
    paraview_glyphs_are_stock: "glyphs",
    paraview_light_kit_and_lights_are_stock: "lights",
    paraview_opacity_is_stock: "opacity",
    paraview_selections_are_stock: "selection",
    paraview_streamlines_are_stock: "streamlines",
    paraview_textures_are_stock: "textures",
    paraview_views_do_not_mix: "views",
    paraview_volumes_mix_with_surfaces: "volume",
}

#[test]
fn every_paraview_script_has_a_test() {
    let there = scripts_in("paraview");
    let names: Vec<&str> = there.iter().filter_map(|p| p.file_stem()?.to_str()).collect();
    assert_eq!(names, TESTED);
}

/// The VTK 9.2 inside ParaView, used by a script with VTK's own classes.
#[test]
fn paraview_blocks_beside_a_refused_one_are_not_drawn_twice() {
    let scripts = [crate::peers::scripts().join("vtk/refused_blocks.py")];
    let run = |with, name| Run::new(Program::ParaView, with, &scripts, output(name), &[]);
    let (stock, ours) = match (
        run(With::Stock, "paraview-refused-stock"),
        run(With::Bridge, "paraview-refused-ours"),
    ) {
        (Ok(stock), Ok(ours)) => (stock, ours),
        (Err(reason), _) | (_, Err(reason)) => return skip(&reason),
    };
    let found = differences(&stock, &ours, "refused_blocks", &[], &[]);
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}
