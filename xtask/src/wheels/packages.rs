//! The Python packages of the workspace.

use crate::main_job;

/// A Python package of the workspace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Package {
    /// What Python imports.
    pub(super) name: &'static str,
    pub(super) folder: &'static str,
    /// The member of the workspace that has its native code.
    pub(super) member: &'static str,
    pub(super) builder: Builder,
    /// What must be installed beside it, and nothing else; empty if that brings more itself.
    pub(super) alone_with: &'static [&'static str],
    /// What the first interpreter gets for the tests, such as the packages that parts of this one
    /// adapt. It is Debian's.
    pub(super) adapted: &'static [&'static str],
    /// The first interpreter's environment, in the build folder.
    pub(super) environment: &'static str,
    /// What one of the other interpreters gets, in turns. They test the package alone otherwise.
    pub(super) others: &'static [&'static [&'static str]],
    pub(super) reference: Option<Reference>,
}

/// Who makes the wheel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Builder {
    Maturin,
    /// `backend.py` of the package, with a library that cargo has built before.
    Own,
}

/// The program whose answers the tests compare bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reference {
    /// What cargo builds.
    pub(super) target: &'static [&'static str],
    /// Where it lies in the folder of the profile.
    pub(super) path: &'static str,
    /// The variable that tells the tests.
    pub(super) variable: &'static str,
}

impl Reference {
    /// Whether it is an example of a member, not one of its programs.
    pub(super) fn is_example(&self) -> bool {
        self.target.first() == Some(&"--example")
    }
}

pub(super) const PACKAGES: &[Package] = &[
    Package {
        name: "rt_core",
        folder: "rt-core/python",
        member: "rt-core-python",
        builder: Builder::Maturin,
        alone_with: &["numpy"],
        // Open3D is not here: its wheel has 400 MB.
        adapted: &["trimesh", "rtree", "scipy", "embreex", "pyvista", "matplotlib", "OpenEXR"],
        environment: main_job::RT_CORE_PYTHON,
        others: &[&[]],
        reference: Some(Reference {
            target: &["--example", "bits"],
            path: "examples/bits",
            variable: "RTSV_RT_CORE_BITS",
        }),
    },
    Package {
        name: "schlieren",
        folder: "schlieren/python",
        member: "schlieren-python",
        builder: Builder::Maturin,
        alone_with: &["numpy"],
        adapted: &["pyvista", "xarray", "matplotlib", "mpi4py"],
        environment: main_job::SCHLIEREN_PYTHON,
        others: &[&[]],
        reference: Some(Reference {
            target: &["--bin", "schlieren"],
            path: "schlieren",
            variable: "RTSV_SCHLIEREN_PROGRAM",
        }),
    },
    Package {
        name: "rtvtk",
        folder: "vtk-bridge/python",
        member: "vtk-bridge",
        builder: Builder::Own,
        // VTK's wheel brings matplotlib, and that more.
        alone_with: &[],
        adapted: &["vtk==9.7.2", "pyvista[jupyter]", "nbclient", "ipykernel"],
        environment: main_job::RTVTK_PYTHON,
        // Each with one of VTK's versions that the package is for.
        others: &[&["vtk==9.4.2"], &["vtk==9.5.2"], &["vtk==9.6.2"]],
        reference: None,
    },
];
