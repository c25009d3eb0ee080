//! A mesh in a file that `bench store` is writing.

use super::StoreArgs;
use super::mesh_file::with_origin;
use crate::image::subject::{LoadOptions, PartColoring, Subject};
use anyhow::Context as _;
use datasets::cli::{Cancel, CommonArgs, ProgressBar, UsageError};
use datasets::read::LoadedFile;
use datasets::{PagedFile, stored_mesh};
use rt_core::bvh::{Geometry, StoredMeshReport, StoredMeshWriter};
use rt_core::glam::DVec3;
use rt_core::mesh::{MeshSlices, TriMesh};
use std::collections::HashSet;
use std::path::Path;

/// A file that is being written.
pub(super) struct StoreJob<'a> {
    common: CommonArgs,
    args: &'a StoreArgs,
    memory: usize,
    cancel: &'a Cancel,
    /// Started by the first mesh, whose origin all positions are relative to.
    writer: Option<(StoredMeshWriter<PagedFile>, DVec3)>,
    /// What the user was told: pieces of a file are wanting in the same ways.
    warned: HashSet<String>,
    has_normals: bool,
}

impl<'a> StoreJob<'a> {
    pub(super) fn new(
        common: CommonArgs,
        args: &'a StoreArgs,
        memory: usize,
        cancel: &'a Cancel,
    ) -> Self {
        let (writer, warned, has_normals) = (None, HashSet::new(), false);
        StoreJob { common, args, memory, cancel, writer, warned, has_normals }
    }

    /// A progress bar of so many steps.
    pub(super) fn progress(&self, steps: u64) -> ProgressBar {
        self.common.progress(steps, "storing")
    }

    pub(super) fn cancel(&self) -> Cancel {
        *self.cancel
    }

    /// Whether normals, colours and scalars are stored.
    pub(super) fn keeps_attributes(&self) -> bool {
        !self.args.no_attributes
    }

    pub(super) fn origin(&self) -> Option<DVec3> {
        self.writer.as_ref().map(|(_, origin)| *origin)
    }

    pub(super) fn warn_once(&mut self, text: String) {
        if !self.warned.contains(&text) {
            let file = self.args.file.as_ref().unwrap_or(&self.args.out);
            self.common.warn(format_args!("{}: {text}", file.display()));
            self.warned.insert(text);
        }
    }

    /// Adds the meshes of a file, relative to `origin` where one is given.
    pub(super) fn add_file(
        &mut self,
        file: &Path,
        opened: &LoadedFile,
        origin: Option<DVec3>,
    ) -> anyhow::Result<()> {
        let color_by = self.args.color_by.clone();
        self.add_loaded(file, opened, &LoadOptions { origin, color_by, ..LoadOptions::default() })
    }

    /// Adds the meshes of one of several files, which may have none. The options' origin is that of
    /// the first mesh, where none is given.
    pub(super) fn add_piece(
        &mut self,
        file: &Path,
        opened: &LoadedFile,
        options: &LoadOptions,
    ) -> anyhow::Result<()> {
        let origin = options.origin.or(self.origin());
        self.add_loaded(
            file,
            opened,
            &LoadOptions { origin, without_points: true, ..options.clone() },
        )
    }

    fn add_loaded(
        &mut self,
        file: &Path,
        opened: &LoadedFile,
        options: &LoadOptions,
    ) -> anyhow::Result<()> {
        let of_image_data =
            [("--array", self.args.array.is_some()), ("--isovalue", self.args.isovalue.is_some())];
        if let Some((option, _)) = of_image_data.iter().find(|(_, given)| *given) {
            let text = format!(
                "{option} belongs to isosurfaces of image data, and {} has none; leave it out",
                file.display()
            );
            return Err(UsageError(text).into());
        }
        let subject = Subject::from_file(opened, options)
            .with_context(|| format!("{}: no triangles to store", file.display()))?;
        for warning in subject.warnings {
            self.warn_once(warning);
        }
        let all = subject.parts.len();
        let with_materials = subject
            .parts
            .iter()
            .any(|p| matches!(p.coloring, PartColoring::FileMaterial(_) | PartColoring::Glass(_)));
        if with_materials && !self.args.no_attributes {
            self.warn_once("materials are not stored, but colours of vertices are".into());
        }
        let meshes: Vec<_> = subject
            .parts
            .into_iter()
            .filter_map(|part| match part.geometry {
                Geometry::Mesh(mesh) => Some(mesh),
                Geometry::Shape(_) | Geometry::Slices(_) => None,
            })
            .collect();
        if meshes.len() < all {
            let left_out = all - meshes.len();
            self.warn_once(format!("{left_out} parts that are not triangles are left out"));
        }
        if meshes.iter().any(|mesh| mesh.texcoords.is_some()) && !self.args.no_attributes {
            self.warn_once("texture coordinates are not stored".into());
        }
        let Some(first) = meshes.first() else { return Ok(()) };
        let origin = self.origin().unwrap_or(first.origin);
        let (meshes, moved) = with_origin(meshes, origin);
        if moved > 0 {
            self.common.note(0, format_args!("{moved} meshes moved to the origin of the first"));
        }
        meshes.iter().try_for_each(|mesh| self.add(mesh))
    }

    /// Adds a mesh, with its attributes unless the user wants none.
    pub(super) fn add(&mut self, mesh: &TriMesh) -> anyhow::Result<()> {
        self.cancel.check()?;
        let writer = match &mut self.writer {
            Some((writer, _)) => writer,
            None => {
                let mut writer = stored_mesh::create(&self.args.out, mesh.origin)?;
                writer.set_memory(self.memory);
                writer.set_normal_tolerance(self.args.normal_tolerance);
                &mut self.writer.insert((writer, mesh.origin)).0
            }
        };
        self.has_normals |= mesh.normals.is_some();
        if self.args.no_attributes {
            writer.add(&MeshSlices::of_mesh(mesh))?;
        } else {
            writer.add_mesh(mesh)?;
        }
        Ok(())
    }

    pub(super) fn finish(mut self, file: &Path) -> anyhow::Result<StoredMeshReport> {
        if self.args.normal_tolerance > 0.0 && !self.has_normals {
            self.warn_once("--normal-tolerance has no effect: there are no normals".into());
        }
        let Some((writer, _)) = self.writer else {
            let shown = file.display();
            let text =
                format!("{shown} has no triangles; `bench render {shown}` shows what it has");
            return Err(UsageError(text).into());
        };
        Ok(stored_mesh::finish(writer)?)
    }
}
