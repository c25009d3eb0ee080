//! The releases of Debian that are tried, what each installs, and what is run there.

use std::path::PathBuf;

/// Test programs, by path.
pub(super) type Programs = Vec<PathBuf>;

/// One release.
#[derive(Debug)]
pub(super) struct Suite {
    /// Debian's name, for debootstrap.
    pub(super) name: &'static str,
    /// Name for people.
    pub(super) title: &'static str,
    /// Packages to install, without what they recommend.
    pub(super) packages: &'static [&'static str],
    /// Packages to install in addition with ParaView.
    pub(super) paraview: &'static [&'static str],
    /// Packages to unpack without what they depend on. Headers of VTK depend on those of everything
    /// that VTK may be linked with, and Python's VTK conflicts with ParaView's.
    pub(super) unpacked: &'static [&'static str],
    /// What is run.
    pub(super) parts: &'static [Part],
    /// Tests that are known to fail there, and why. One that passes is a fault too.
    pub(super) known: &'static [(&'static str, &'static str)],
    /// What is not tried there, and why.
    pub(super) left_out: &'static [&'static str],
}

/// Tests of one test program.
#[derive(Debug)]
pub(super) struct Part {
    /// The test program, by the name of its file in `tests`.
    pub(super) test: &'static str,
    /// Parts of the tests' names.
    pub(super) filters: &'static [&'static str],
    /// What they are, for people.
    pub(super) tells: &'static str,
    /// Whether it needs ParaView.
    pub(super) paraview: bool,
}

/// The environment of all tests: where the peers are, and nothing of this machine's.
pub(super) const VARIABLES: &[(&str, &str)] = &[
    ("PATH", "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin"),
    ("HOME", "/root"),
    ("LC_ALL", "C.UTF-8"),
    ("RTSV_VTK91", "/"),
    ("RTSV_XVFB", "/usr/bin/Xvfb"),
    ("RTSV_SYSTEM_PYTHON", "/usr/bin/python3"),
    ("RTSV_GEOMVIEW", "/usr/bin/geomview"),
    ("RTSV_XSCREENSAVER", "/usr/libexec/xscreensaver/gears"),
    ("RTSV_XSCREENSAVER_EXTRA", "/usr/libexec/xscreensaver/sballs"),
];

/// The suites; the first is the one that CI runs.
pub(super) const SUITES: &[Suite] = &[
    Suite {
        name: "trixie",
        title: "Debian 13",
        packages: PACKAGES,
        paraview: PARAVIEW,
        unpacked: UNPACKED,
        parts: PARTS,
        known: &[(
            "vtk::projections_of_all_kinds_are_exact",
            "stock VTK 9.3.0 draws only the background in off_axis and stereo: no report of them",
        )],
        left_out: LEFT_OUT,
    },
    Suite {
        name: "forky",
        title: "Debian's next release",
        packages: PACKAGES,
        paraview: PARAVIEW,
        unpacked: UNPACKED,
        parts: PARTS,
        known: &[],
        left_out: LEFT_OUT,
    },
];

const PACKAGES: &[&str] = &[
    "python3-vtk9",
    "python3-numpy",
    "xvfb",
    "g++",
    "libglew-dev",
    "libgl1-mesa-dri",
    "libegl1",
    "geomview",
    "xscreensaver-gl",
    "xscreensaver-gl-extra",
];

const PARAVIEW: &[&str] = &["paraview", "python3-paraview"];

const UNPACKED: &[&str] = &["libvtk9-dev"];

const PARTS: &[Part] = &[
    Part { test: "against_stock", filters: &["vtk::"], tells: "VTK's pictures", paraview: false },
    Part {
        test: "against_stock",
        filters: &["paraview::"],
        tells: "ParaView's pictures",
        paraview: true,
    },
    Part { test: "programs", filters: &["geomview"], tells: "Geomview", paraview: false },
    Part {
        test: "screensavers",
        filters: &["screensavers"],
        tells: "eleven programs of xscreensaver-gl (one test)",
        paraview: false,
    },
];

const LEFT_OUT: &[&str] = &[
    "gmsh, Octave, OpenSCAD, PyMOL: left out to keep the step short",
    "piglit, the wheel of VTK and MPI: they do not depend on the release",
];
