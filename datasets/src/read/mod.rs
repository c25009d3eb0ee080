//! Readers for the files that users have. [`open`] finds the format by the name and by the content.
//!
//! Rules all readers keep: input never makes them panic; memory is taken only for sizes that the
//! bytes of the file can justify; what is left out is named in [`LoadedFile::warnings`]; every
//! error names the file, the place and the cure.

pub(crate) mod base64;
pub mod csv;
pub mod csv_lattice;
pub mod error;
pub mod gltf;
pub mod mhd;
pub mod nrrd;
pub mod obj;
mod open;
pub(crate) mod percent;
pub mod plot3d;
pub mod ply;
pub mod raw;
pub mod scene;
pub mod stl;
pub(crate) mod volume;
pub mod vtk_legacy;
pub mod vtk_xml;

pub use error::{At, ReadError};
pub use open::{KNOWN, open};
pub use scene::{AlphaMode, SceneMesh, SceneModel, SurfaceMaterial, Texture};

use crate::model::{Dataset, ModelError, SurfaceReport};
use rt_core::mesh::TriMesh;
use std::path::PathBuf;

/// What a file held.
#[derive(Debug, Clone)]
pub struct LoadedFile {
    /// Name of the format, for messages.
    pub format: &'static str,
    /// The data.
    pub content: Content,
    /// What was left out or repaired, one sentence each; empty when all is well.
    pub warnings: Vec<String>,
    /// For a time series: every file with its time, in order. `content` is the first time; open the
    /// others by their path.
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
    /// Its time, in the unit of the program that wrote it.
    pub time: f64,
    /// Its part, when a time has several files.
    pub part: i64,
    /// The file.
    pub path: PathBuf,
}

impl LoadedFile {
    /// The data set; an error for a scene, which has meshes only.
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

    /// Everything that has a surface, as triangle meshes with materials. A data set gives one mesh
    /// with no material. `color_by` names an array of a data set; scenes carry their own colours
    /// and ignore it.
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
