//! The surface shaders of VTK 9.1, 9.2 and the current version are recognised; shaders that scripts
//! have changed are not.

mod common;

use common::{Xvfb, folder, peer, skip};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;

/// A program of a scene: its name, and vertex, geometry and fragment shader.
struct Program {
    name: String,
    shaders: [String; 3],
}

/// All programs of one VTK.
struct Written {
    version: String,
    programs: Vec<Program>,
}

/// Surfaces of VTK 9.1 and 9.2 that are left to the driver: a geometry shader that enlarges
/// triangles, another formula for lamps.
const OLD_AND_PASSED: [&str; 2] = ["edges", "physical_lights"];

/// The programs of every installed VTK, generated once.
static WRITTEN: LazyLock<Vec<Written>> = LazyLock::new(|| {
    let Some(x) = Xvfb::start() else { return Vec::new() };
    let today = peer("RTSV_PYTHON").map(|python| (python, None));
    let system = peer("RTSV_SYSTEM_PYTHON");
    // ParaView's VTK is the one of the system's Python; 9.1 is in a folder of its own.
    let debian =
        system.clone().filter(|_| peer("RTSV_PVBATCH").is_some()).map(|python| (python, None));
    let before = system.and_then(|python| Some((python, Some(peer("RTSV_VTK91")?))));
    let all = [today, debian, before].into_iter().flatten();
    all.map(|(python, unpacked)| write(&x, &python, unpacked)).collect()
});

fn write(x: &Xvfb, python: &Path, unpacked: Option<PathBuf>) -> Written {
    let place = folder();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/shader_sources.py");
    let mut command = Command::new(python);
    command
        .arg(script)
        .arg(place.path())
        .env("DISPLAY", &x.display)
        .env("LIBGL_ALWAYS_SOFTWARE", "1");
    if let Some(at) = unpacked {
        let libraries = format!("usr/lib/{}-linux-gnu", std::env::consts::ARCH);
        command
            .env("LD_LIBRARY_PATH", at.join(libraries))
            .env("PYTHONPATH", at.join("usr/lib/python3/dist-packages"));
    }
    // VTK complains about shaders that scripts have broken.
    let output = command.stdin(Stdio::null()).output().expect("Python starts");
    let said = String::from_utf8_lossy(&output.stderr);
    let version = std::fs::read_to_string(place.path().join("version"))
        .unwrap_or_else(|e| panic!("{} did not end well ({e}): {said}", python.display()));
    let mut programs: Vec<Program> = std::fs::read_dir(place.path())
        .expect("a folder")
        .filter_map(|entry| {
            entry.ok()?.file_name().to_str()?.strip_suffix(".frag").map(str::to_owned)
        })
        .map(|name| {
            let text = |ending: &str| {
                std::fs::read_to_string(place.path().join(format!("{name}.{ending}")))
                    .expect("a shader")
            };
            let shaders = ["vert", "geom", "frag"].map(text);
            Program { name, shaders }
        })
        .collect();
    programs.sort_by(|a, b| a.name.cmp(&b.name));
    assert!(programs.len() > 90, "{} programs of VTK {version}: {said}", programs.len());
    Written { version, programs }
}

impl Program {
    fn recognised(&self) -> Result<(), &'static str> {
        let [vertex, geometry, fragment] = &self.shaders;
        gluray::recognise(vertex, geometry, fragment)
    }

    /// Name of the scene, without the number of the program.
    fn scene(&self) -> &str {
        self.name.rsplit_once('-').expect("a number").0
    }
}

fn written() -> &'static [Written] {
    if WRITTEN.is_empty() {
        skip("no Python with VTK, or no X server");
    }
    &WRITTEN
}

#[test]
fn sources_that_vtk_writes_for_surfaces_are_known_in_every_version() {
    for Written { version, programs } in written() {
        let old = version.starts_with("9.1.") || version.starts_with("9.2.");
        for p in programs.iter().filter(|p| !p.name.starts_with("replaced-")) {
            let passed = old && OLD_AND_PASSED.contains(&p.scene());
            assert_eq!(
                p.recognised().is_err(),
                passed,
                "{} of VTK {version}: {:?}",
                p.name,
                p.recognised()
            );
        }
    }
}

#[test]
fn sources_that_scripts_have_changed_are_the_drivers_by_name() {
    for Written { version, programs } in written() {
        let unchanged = programs.iter().find(|p| p.scene() == "unchanged").expect("drawn");
        assert_eq!(unchanged.recognised(), Ok(()), "VTK {version}");
        let mut seen = 0;
        for p in programs.iter().filter(|p| p.name.starts_with("replaced-")) {
            seen += 1;
            assert_ne!(p.shaders, unchanged.shaders, "{} of VTK {version} is not changed", p.name);
            assert!(p.recognised().is_err(), "{} of VTK {version}", p.name);
        }
        assert!(seen >= 16, "{seen} of VTK {version}");
    }
}

/// Indices of the lines of `main` that contain statements.
fn lines_of_main(lines: &[&str]) -> Vec<usize> {
    let main = lines.iter().position(|l| l.contains("void main")).expect("a main");
    // Empty statements do not count.
    let says = |l: &str| !["", ";"].contains(&l.split("//").next().unwrap_or("").trim());
    (main + 1..lines.len()).filter(|i| says(lines[*i])).collect()
}

#[test]
fn no_line_of_vtks_sources_may_move_come_twice_or_be_put_behind_a_condition() {
    for Written { version, programs } in written() {
        for p in programs.iter().filter(|p| p.recognised().is_ok()) {
            let [vertex, geometry, fragment] = &p.shaders;
            let lines: Vec<&str> = fragment.lines().collect();
            let known =
                |lines: &[&str]| gluray::recognise(vertex, geometry, &lines.join("\n")).is_ok();
            let of_main = lines_of_main(&lines);
            for pair in of_main.windows(2) {
                let (a, b) = (pair[0], pair[1]);
                let what = || format!("{} of VTK {version}: {} | {}", p.name, lines[a], lines[b]);
                let mut changed = lines.clone();
                changed.swap(a, b);
                assert!(
                    !known(&changed) || lines[a].trim() == lines[b].trim(),
                    "swapped: {}",
                    what()
                );
                let hidden = format!("#if 0\n{}\n#endif", lines[a]);
                let mut changed = lines.clone();
                changed[a] = &hidden;
                assert!(!known(&changed), "hidden: {}", what());
                let twice = format!("{}\n{}", lines[a], lines[a]);
                changed[a] = &twice;
                assert!(!known(&changed) || lines[a].trim() == ";", "twice: {}", what());
            }
        }
    }
}
