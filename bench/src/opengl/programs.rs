//! The programs of table 4.1, and the scripts that make each draw one frame at a time. The
//! installed programs are used unchanged, through their own script languages.

use super::Format;
use datasets::view::View;
use std::path::{Path, PathBuf};

/// What a program draws.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// A file in the format of the program.
    pub data: &'a Path,
    /// Width and height of the window.
    pub size_px: u32,
    /// Where it looks from, frame after frame nearly the same; `None` for once around the data.
    /// Only ParaView and VTK take a view.
    pub view: Option<&'a View>,
}

/// An OpenGL program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// gmsh: vertex arrays, sent again each frame.
    Gmsh,
    /// geomview: immediate mode, eight calls per triangle.
    Geomview,
    /// ParaView's pvbatch: buffers and shaders.
    ParaView,
    /// VTK in Python: the same shaders, a headlight.
    Vtk,
}

impl Program {
    /// All programs.
    pub const ALL: [Program; 4] =
        [Program::Gmsh, Program::Geomview, Program::ParaView, Program::Vtk];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Program::Gmsh => "gmsh",
            Program::Geomview => "geomview",
            Program::ParaView => "ParaView",
            Program::Vtk => "python vtk",
        }
    }

    /// The file format that the program reads.
    pub fn format(self) -> Format {
        match self {
            Program::Gmsh => Format::Stl,
            Program::Geomview => Format::Off,
            Program::ParaView | Program::Vtk => Format::Vtp,
        }
    }

    /// Finds the executable, from the variable that `cargo xtask test` sets or in Debian's
    /// directory. The error says what is missing, with the cure.
    pub fn find(self) -> Result<PathBuf, String> {
        let (variable, place, package) = match self {
            Program::Gmsh => ("RTSV_GMSH", "/usr/bin/gmsh", "gmsh"),
            Program::Geomview => ("RTSV_GEOMVIEW", "/usr/bin/geomview", "geomview"),
            Program::ParaView => ("RTSV_PVBATCH", "/usr/bin/pvbatch", "paraview python3-paraview"),
            Program::Vtk => (
                "RTSV_PYTHON",
                "/usr/bin/python3",
                "python3-vtk9, or a Python with the package vtk",
            ),
        };
        let found = find(variable, place).ok_or_else(|| {
            format!("{}: install {package}, or name it in {variable}", self.name())
        })?;
        match self {
            // gmsh's library is driven from Python.
            Program::Gmsh => find("RTSV_PYTHON", "/usr/bin/python3")
                .ok_or_else(|| "gmsh: install python3, or name it in RTSV_PYTHON".to_string()),
            _ => Ok(found),
        }
    }

    /// Whether the program can be told where to look from.
    pub fn takes_a_view(self) -> bool {
        matches!(self, Program::ParaView | Program::Vtk)
    }

    /// The arguments of `executable` that draw it; scripts are written to `dir`.
    pub(super) fn arguments(
        self,
        dir: &Path,
        drawing: Drawing<'_>,
    ) -> std::io::Result<Vec<String>> {
        let data = drawing.data.to_string_lossy().into_owned();
        let script = |name: &str, text: &str| -> std::io::Result<String> {
            let file = dir.join(name);
            std::fs::write(&file, text)?;
            Ok(file.to_string_lossy().into_owned())
        };
        let size = drawing.size_px.to_string();
        let camera = drawing.view.map(camera_argument);
        let mut arguments = match self {
            Program::Gmsh => {
                vec![script("gmsh_frames.py", include_str!("scripts/gmsh_frames.py"))?, data, size]
            }
            Program::ParaView => {
                vec![
                    script("paraview_frames.py", include_str!("scripts/paraview_frames.py"))?,
                    data,
                    size,
                ]
            }
            Program::Vtk => {
                vec![script("vtk_frames.py", include_str!("scripts/vtk_frames.py"))?, data, size]
            }
            Program::Geomview => ["-nopanels", "-c", "-"].map(String::from).to_vec(),
        };
        if self.takes_a_view() {
            arguments.extend(camera);
        }
        Ok(arguments)
    }

    /// Commands that the program receives at the start.
    pub(super) fn startup_commands(self, drawing: Drawing<'_>) -> String {
        let Drawing { data, size_px, .. } = drawing;
        match self {
            Program::Geomview => format!(
                "(load {})\n(window c0 {{size {size_px} {size_px}}})\n(bbox-draw g1 \
                 no)\n(normalization g1 none)\n\
                 (merge-ap g1 {{ shading smooth -edge }})\n(look g1)\n(redraw \
                 c0)\n(echo \"ready\\n\")\n",
                data.display()
            ),
            _ => String::new(),
        }
    }

    /// Commands that make the program draw the next frame, from another side.
    pub(super) fn next_frame(self) -> &'static str {
        match self {
            Program::Geomview => {
                "(transform g1 g1 focus rotate 0 0.1 0)\n(redraw c0)\n(echo \"frame\\n\")\n"
            }
            _ => "\n",
        }
    }
}

/// The path from the environment variable, or a well-known path, if the file exists.
pub fn find(variable: &str, place: &str) -> Option<PathBuf> {
    let named = std::env::var_os(variable).map(PathBuf::from);
    named.or_else(|| Some(PathBuf::from(place))).filter(|p| p.is_file())
}

/// A view as one word: position, focal point, up and angle. pvbatch would take a word that begins
/// with a minus sign for an option of its own, and change it.
fn camera_argument(view: &View) -> String {
    let ends = [view.eye, view.target, view.up].map(|v| v.to_array());
    let numbers = ends.as_flattened().iter().copied().chain([view.vertical_fov_degrees]);
    let words: Vec<String> = numbers.map(|number| number.to_string()).collect();
    format!("camera={}", words.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::glam::DVec3;

    #[test]
    fn a_camera_behind_the_origin_is_no_option_of_the_program() {
        let view = View {
            name: "behind".into(),
            eye: DVec3::new(-18.5, 0.25, -3.0),
            target: DVec3::NEG_X,
            up: DVec3::Z,
            vertical_fov_degrees: 30.0,
        };
        assert_eq!(camera_argument(&view), "camera=-18.5,0.25,-3,-1,0,0,0,0,1,30");
    }
}
