//! Readers for common file formats. [`open`] detects the format by the content and the name.
//!
//! Rules that all readers follow: input never makes them panic; memory is allocated only for sizes
//! that the bytes of the file can justify; everything left out is named in
//! [`LoadedFile::warnings`]; every error names the file, the position and the cure.

mod amrex;
pub(crate) mod base64;
pub(crate) mod cgns;
pub mod csv;
mod csv_columns;
mod csv_file;
pub mod csv_lattice;
pub mod csv_points;
mod ensight;
pub mod error;
pub mod gltf;
pub(crate) mod hdf5;
pub mod mhd;
pub(crate) mod netcdf;
pub mod npy;
pub mod nrrd;
pub mod obj;
pub mod obj_pieces;
mod obj_text;
mod open;
pub mod openfoam;
mod options;
pub(crate) mod percent;
pub mod plot3d;
pub mod ply;
pub mod ply_pieces;
mod ply_vertices;
pub mod raw;
mod refinement;
pub mod scene;
pub mod stl;
pub mod stl_pieces;
mod tecplot;
pub(crate) mod time_axis;
mod used_points;
mod value_files;
pub(crate) mod volume;
pub mod volume_planes;
pub mod vtk_legacy;
pub mod vtk_xml;
pub(crate) mod vtkhdf;
pub(crate) mod wedge;
pub(crate) mod xdmf;

pub use error::{At, ReadError};
pub use open::{KNOWN, open, open_with};
pub use options::OpenOptions;
pub use scene::{AlphaMode, SceneMesh, SceneModel, SurfaceMaterial, Texture};

use crate::model::{Dataset, ModelError, SurfaceReport};
use rt_core::mesh::TriMesh;
use std::path::PathBuf;

/// The content of a loaded file.
#[derive(Debug, Clone)]
pub struct LoadedFile {
    /// Name of the format, for messages.
    pub format: &'static str,
    /// The data.
    pub content: Content,
    /// What was left out or repaired, one sentence each; empty if nothing was.
    pub warnings: Vec<String>,
    /// For a time series or a case: every time with its path, in order. `content` holds one of them
    /// ([`OpenOptions::time`]); open the others by their path.
    pub time_steps: Vec<TimeStep>,
}

/// Data with arrays, or meshes with materials.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "there is one of it per file")]
pub enum Content {
    /// From scientific formats.
    Data(Dataset),
    /// From OBJ and glTF.
    Scene(SceneModel),
}

/// One file of a time series.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeStep {
    /// Its time, in the unit of the program that wrote the file.
    pub time: f64,
    /// Its part number, if a time has several files.
    pub part: i64,
    /// The file.
    pub path: PathBuf,
}

impl LoadedFile {
    /// The data set; an error for a scene, which contains meshes only.
    pub fn dataset(&self) -> Result<&Dataset, ModelError> {
        match &self.content {
            Content::Data(d) => Ok(d),
            Content::Scene(_) => Err(ModelError::NotConvertible {
                kind: self.format,
                target: "a data set with arrays",
                reason: "the file holds meshes with materials; use `to_meshes`".into(),
            }),
        }
    }

    /// Converts everything with a surface to triangle meshes with materials. A data set gives one
    /// mesh without a material. `color_by` names an array of a data set; scenes have their own
    /// colours and ignore it.
    pub fn to_meshes(
        &self,
        color_by: Option<&str>,
    ) -> Result<(SceneModel, SurfaceReport), ModelError> {
        match &self.content {
            Content::Scene(scene) => Ok((
                scene.clone(),
                SurfaceReport { triangles: scene.num_triangles(), ..Default::default() },
            )),
            Content::Data(data) => {
                let (mesh, report): (TriMesh, _) = data.to_trimesh(color_by)?;
                let meshes = vec![SceneMesh { name: data.kind().into(), mesh, material: None }];
                Ok((SceneModel { meshes, ..Default::default() }, report))
            }
        }
    }
}
