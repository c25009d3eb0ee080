//! Derives findings from the inspected machine.

use super::{Finding, Grade, Machine};

fn finding(about: &'static str, grade: Grade, found: impl Into<String>) -> Finding {
    Finding { about, grade, found: found.into(), cure: None }
}

impl Finding {
    fn cure(mut self, text: impl Into<String>) -> Finding {
        self.cure = Some(text.into());
        self
    }
}

/// Everything worth saying about a machine, in the order in which things are needed.
pub fn findings(m: &Machine) -> Vec<Finding> {
    use Grade::{Bad, Good, Note};
    let mut out = Vec::new();
    let set = |name: &str| m.variables.iter().find(|(n, _)| n == name).map(|(_, v)| v.as_str());

    // Ours.
    out.push(match &m.library {
        Some(path) => finding("library", Good, path.display().to_string()),
        None => finding("library", Bad, "libgluray.so is not beside this program").cure(
            "build it with `cargo build --release -p gluray-interposer`, or name it in \
                   GLURAY_LIBRARY",
        ),
    });
    if !crate::interposer::HAS_ENTRY_POINTS {
        out.push(finding("processor", Bad, "gluray runs in programs for x86-64 Linux alone"));
    }

    // OpenGL, and how programs are reached.
    out.push(match &m.lib_gl {
        Some(path) => finding("OpenGL", Good, path.display().to_string()),
        None => finding("OpenGL", Bad, "there is no libGL.so.1")
            .cure("install it: on Debian `apt-get install libgl1`"),
    });
    let vendors = m.glx_vendors.join(", ");
    out.push(match (&m.glvnd, m.glx_vendors.is_empty()) {
        (Some(_), false) => finding("reach", Good, format!("GLVND with GLX vendors {vendors}: \
                                                            programs get the library as a vendor, \
                                                            however they load OpenGL")),
        (Some(_), true) => finding("reach", Bad, "GLVND without a GLX vendor").cure("install a \
                                                                                     driver: on \
                                                                                     Debian `apt-get install libglx-mesa0`"),
        (None, _) => finding("reach", Note, "no GLVND: LD_PRELOAD is used, which set-user-id and \
                                             statically linked programs ignore"),
    });
    if m.glvnd.is_some() && m.egl_vendors.is_empty() {
        out.push(
            finding("EGL", Note, "no EGL vendor: programs that use EGL find no driver")
                .cure("on Debian `apt-get install libegl-mesa0`"),
        );
    }
    if m.glvnd.is_some() && !m.glx_vendors.is_empty() {
        out.push(glx_vendor(m));
    }
    if m.glvnd.is_some() && !m.egl_vendors.is_empty() {
        out.extend(egl_vendor(m));
    }

    // The display and the driver behind it.
    out.extend(display(m));
    if let Some(Ok(gl)) = &m.opengl {
        out.push(finding(
            "driver",
            Good,
            format!(
                "{}, {}",
                gl.renderer,
                if gl.version.is_empty() { &gl.core_version } else { &gl.version }
            ),
        ));
        if !gl.direct {
            out.push(
                finding(
                    "driver",
                    Bad,
                    "indirect rendering: the X server draws, and the library is not asked",
                )
                .cure(
                    "run the program on the machine with the display, or with Xvfb or VirtualGL on \
                     this one",
                ),
            );
        }
        if gl.version.is_empty() {
            out.push(finding(
                "driver",
                Note,
                "no compatibility profile: programs with glBegin and \
                                              display lists will not start, with or without us",
            ));
        }
        let software = ["llvmpipe", "softpipe", "swrast"].iter().any(|s| gl.renderer.contains(s));
        if software {
            out.push(finding(
                "speed",
                Good,
                "a software driver: what is traced is not rasterized, so large scenes become \
                 faster",
            ));
        } else {
            out.push(finding(
                "speed",
                Note,
                "a hardware driver: pictures of rays travel to the \
                                             card each frame, and small scenes become slower",
            ));
        }
    }

    // What gets in the way.
    if set("LIBGL_ALWAYS_INDIRECT").is_some_and(|v| v != "0") {
        out.push(
            finding("environment", Bad, "LIBGL_ALWAYS_INDIRECT is set: the library is not asked")
                .cure("unset LIBGL_ALWAYS_INDIRECT"),
        );
    }
    if set("VGL_DISPLAY").is_some()
        || set("LD_PRELOAD").is_some_and(|v| v.contains("libvglfaker") || v.contains("dlfaker"))
    {
        out.push(
            finding("environment", Note, "VirtualGL takes the same calls by LD_PRELOAD")
                .cure("use `gluray run --via vendor`: as a vendor library we sit below VirtualGL"),
        );
    }
    if let Some(v) = set("LD_PRELOAD").filter(|v| v.contains("apitrace") || v.contains("glxtrace"))
    {
        out.push(
            finding(
                "environment",
                Note,
                format!("LD_PRELOAD={v}: two libraries take the same calls"),
            )
            .cure("trace with apitrace without us, or with --via vendor"),
        );
    }
    for (name, what) in [("SNAP", "a snap"), ("FLATPAK_ID", "a flatpak")] {
        if set(name).is_some() {
            out.push(finding(
                "environment",
                Note,
                format!(
                    "this is inside {what}: programs outside are not reached, and its OpenGL may \
                     be its own"
                ),
            ));
        }
    }
    if let [None, Some(_)] = m.display {
        out.push(
            finding(
                "environment",
                Note,
                "Wayland without X: programs that use EGL are reached, those that need GLX do not \
                 start",
            )
            .cure("install and start Xwayland"),
        );
    }

    // Threads, settings, panel.
    let grade = if m.threads > 1 { Good } else { Note };
    let threads =
        finding("threads", grade, format!("{} (`threads` says how many trace rays)", m.threads));
    out.push(if m.threads > 1 {
        threads
    } else {
        threads.cure("with one core the program waits for its own pictures")
    });
    match &m.settings {
        None => {
            out.push(finding("settings", Good, "no file; defaults, environment and command line"))
        }
        Some((path, problems)) if problems.is_empty() => {
            out.push(finding("settings", Good, path.display().to_string()))
        }
        Some((_, problems)) => out.extend(problems.iter().map(|p| {
            finding("settings", Bad, p.clone()).cure("the rest of the file is used as it is")
        })),
    }
    let (_, unknown) = crate::host::config::environment::assignments(&m.variables);
    out.extend(unknown.iter().map(|e| finding("settings", Note, e.to_string())));
    if let Some(address) = &m.panel {
        out.push(finding("panel", Good, format!("running, programs connect to {address}")));
    }
    out
}

/// The GLX driver that the library stands in front of: the first of those tried that is here.
fn glx_vendor(m: &Machine) -> Finding {
    // Debian's `indirect` is Mesa's by another name.
    let is_here = |name: &str| name == "indirect" || m.glx_vendors.iter().any(|v| v == name);
    let tried = &m.in_front_of[0];
    match tried.iter().find(|v| is_here(&v.name) && (v.name != "indirect" || is_here("mesa"))) {
        Some(v) => finding("vendor", Grade::Good, format!("GLX: {}, because {}", v.name, v.why)),
        None => {
            let names: Vec<&str> = tried.iter().map(|v| v.name.as_str()).collect();
            let (wanted, here) = (names.join(", "), m.glx_vendors.join(", "));
            finding(
                "vendor",
                Grade::Bad,
                format!("GLX: {wanted} would be taken, and there is {here}"),
            )
            .cure(format!("set GLURAY_GLX_VENDOR={}", m.glx_vendors[0]))
        }
    }
}

/// The EGL drivers that are asked for displays.
fn egl_vendor(m: &Machine) -> Option<Finding> {
    let because = |v: &crate::interpose::glvnd::Vendor| format!("{}, because {}", v.name, v.why);
    let (first, others) = m.in_front_of[1].split_first()?;
    let mut text = format!("EGL: {}", because(first));
    if !others.is_empty() {
        let others: Vec<String> = others.iter().map(because).collect();
        text += &format!("; where that has no such display: {}", others.join("; "));
    }
    Some(finding("vendor", Grade::Good, text))
}

fn display(m: &Machine) -> Option<Finding> {
    const START: &str = "start one, for example `Xvfb :77 -screen 0 1280x1024x24 +extension GLX \
                         -noreset &`, and set DISPLAY=:77";
    let Some(display) = &m.display[0] else {
        let wayland = m.display[1].is_some();
        return (!wayland)
            .then(|| finding("display", Grade::Bad, "DISPLAY is not set").cure(START));
    };
    Some(match (&m.opengl, m.display_answers) {
        (Some(Err(why)), answers) if answers == Some(false) || !why.contains("not installed") => {
            finding("display", Grade::Bad, format!("{display} does not give OpenGL: {why}"))
                .cure(START)
        }
        (_, Some(false)) => {
            finding("display", Grade::Bad, format!("there is no X server at {display}")).cure(START)
        }
        (Some(Err(why)), _) => finding(
            "display",
            Grade::Note,
            format!("{display}; {why}, so the driver was not asked"),
        )
        .cure("on Debian `apt-get install mesa-utils`"),
        _ => finding("display", Grade::Good, display.clone()),
    })
}

#[cfg(test)]
mod tests {
    use super::super::machine::OpenGl;
    use super::*;
    use crate::interpose::glvnd::Vendor;

    /// A Debian 12 with Mesa, and Xvfb.
    fn healthy() -> Machine {
        let gl = OpenGl {
            vendor: "Mesa".into(),
            renderer: "llvmpipe (LLVM 15.0.6, 256 bits)".into(),
            version: "4.5 (Compatibility Profile) Mesa 22.3.6".into(),
            core_version: "4.5 (Core Profile) Mesa 22.3.6".into(),
            direct: true,
        };
        Machine {
            library: Some("/opt/gluray/libgluray.so".into()),
            lib_gl: Some("/usr/lib/x86_64-linux-gnu/libGL.so.1".into()),
            glvnd: Some("/usr/lib/x86_64-linux-gnu/libGLdispatch.so.0".into()),
            glx_vendors: vec!["mesa".into()],
            egl_vendors: vec!["50_mesa.json".into()],
            display: [Some(":77".into()), None],
            in_front_of: [
                vec![Vendor { name: "mesa".into(), why: "the X server at :77 names it".into() }],
                vec![Vendor {
                    name: "libEGL_mesa.so.0".into(),
                    why: "50_mesa.json names it".into(),
                }],
            ],
            display_answers: Some(true),
            opengl: Some(Ok(gl)),
            threads: 8,
            ..Machine::default()
        }
    }

    fn worst(m: &Machine) -> Vec<String> {
        let of = findings(m);
        let bad = of.iter().filter(|f| f.grade != Grade::Good);
        bad.map(|f| {
            format!(
                "{} {:?}: {} [{}]",
                f.about,
                f.grade,
                f.found,
                f.cure.clone().unwrap_or_default()
            )
        })
        .collect()
    }

    #[test]
    fn a_healthy_machine_has_nothing_but_good_findings() {
        assert_eq!(worst(&healthy()), Vec::<String>::new());
        assert!(findings(&healthy()).iter().any(|f| f.found.contains("llvmpipe")));
    }

    #[test]
    fn the_vendors_that_are_taken_are_named_with_the_reason() {
        let mut m = healthy();
        m.glx_vendors = vec!["mesa".into(), "nvidia".into()];
        let vendor = |name: &str, why: &str| Vendor { name: name.into(), why: why.into() };
        m.in_front_of[0].insert(0, vendor("nvidia", "the X server at :0 names it for the screen"));
        m.in_front_of[0].insert(0, vendor("gone", "the variable X names it"));
        m.in_front_of[1].insert(0, vendor("libEGL_nvidia.so.0", "10_nvidia.json names it"));
        let of = findings(&m);
        let said: Vec<&str> =
            of.iter().filter(|f| f.about == "vendor").map(|f| f.found.as_str()).collect();
        assert_eq!(said.len(), 2, "{said:?}");
        assert_eq!(said[0], "GLX: nvidia, because the X server at :0 names it for the screen");
        assert!(said[1].starts_with("EGL: libEGL_nvidia.so.0, because 10_nvidia.json"), "{said:?}");
        assert!(
            said[1].ends_with("no such display: libEGL_mesa.so.0, because 50_mesa.json names it")
        );
    }

    #[test]
    fn every_fault_is_named_with_its_cure() {
        let with = |change: &dyn Fn(&mut Machine)| {
            let mut m = healthy();
            change(&mut m);
            worst(&m).join("\n")
        };
        let variable = |name: &'static str, value: &'static str| {
            move |m: &mut Machine| m.variables.push((name.into(), value.into()))
        };
        for (text, expected) in [
            (
                with(&|m| m.library = None),
                "library Bad: libgluray.so is not beside this program [build it",
            ),
            (with(&|m| m.lib_gl = None), "OpenGL Bad"),
            (with(&|m| m.glvnd = None), "reach Note: no GLVND: LD_PRELOAD"),
            (with(&|m| m.glx_vendors = vec!["nvidia".into()]), "set GLURAY_GLX_VENDOR=nvidia"),
            (
                with(&|m| m.display[0] = None),
                "display Bad: DISPLAY is not set [start one, for example `Xvfb",
            ),
            (
                with(&|m| m.opengl = Some(Err("Error: unable to open display :77".into()))),
                "unable to open display :77 [start one",
            ),
            (
                with(&|m| m.opengl = Some(Err("glxinfo is not installed".into()))),
                "display Note: :77; glxinfo is not installed",
            ),
            (with(&|m| m.display_answers = Some(false)), "there is no X server at :77"),
            (with(&|m| m.threads = 1), "threads Note"),
            (
                with(&|m| m.settings = Some(("a".into(), vec!["a: `x` is no setting".into()]))),
                "settings Bad: a: `x` is no setting",
            ),
            (with(&variable("LIBGL_ALWAYS_INDIRECT", "1")), "unset LIBGL_ALWAYS_INDIRECT"),
            (with(&variable("LD_PRELOAD", "libvglfaker.so")), "--via vendor"),
            (with(&variable("GLURAY_MODUS", "rich")), "GLURAY_MODUS"),
        ] {
            assert!(text.contains(expected), "{expected}:\n{text}");
        }
        let indirect = with(&|m| {
            if let Some(Ok(gl)) = &mut m.opengl {
                gl.direct = false;
                gl.version.clear();
            }
        });
        assert!(
            indirect.contains("indirect rendering")
                && indirect.contains("no compatibility profile"),
            "{indirect}"
        );
    }
}
