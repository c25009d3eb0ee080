//! The folders of a case: where its mesh and its times are.

use super::collated::{BlockCache, Group};
use super::text::{FORMAT, FoamFile, exists};
use crate::read::error::{At, Fault, io_error};
use crate::read::{ReadError, TimeStep};
use std::path::{Path, PathBuf};

/// Where a part of a mesh is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    pub(super) folder: PathBuf,
    /// The number of its block, in files that hold those of several parts.
    block: Option<usize>,
}

/// A case on disk.
pub(super) struct CaseFolder {
    pub(super) root: PathBuf,
    /// The parts of the mesh: the root itself, or those of `processor0` and so on.
    pub(super) parts: Vec<Part>,
    /// Times in order, with the names of their folders.
    pub(super) times: Vec<(f64, String)>,
    /// What was chosen among several possibilities.
    pub(super) warnings: Vec<String>,
    blocks: BlockCache,
}

/// The case that a path means, and the name of the time if the path is that of one. `None` if it is
/// no path of a case.
pub(super) fn locate(path: &Path) -> Option<(PathBuf, Option<String>)> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    if path.is_file() {
        let marker = matches!(extension.as_deref(), Some("foam" | "openfoam"));
        return marker.then(|| (path.parent().unwrap_or(Path::new("")).to_path_buf(), None));
    }
    if is_case(path) {
        return Some((path.to_path_buf(), None));
    }
    let name = path.file_name()?.to_str()?;
    let parent = path.parent()?;
    (time_of(name).is_some() && is_case(parent))
        .then(|| (parent.to_path_buf(), Some(name.to_string())))
}

fn is_case(folder: &Path) -> bool {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let is_collated = || entries(folder).is_ok_and(|n| Group::all(folder, &n).is_some());
    has_mesh(folder)
        || has_mesh(&folder.join("processor0"))
        || folder.join("system/controlDict").is_file()
        || folder.is_dir() && is_collated()
}

fn has_mesh(folder: &Path) -> bool {
    exists(&folder.join("constant/polyMesh/owner"))
}

/// The time that the name of a folder tells.
fn time_of(name: &str) -> Option<f64> {
    let starts = name.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    name.parse::<f64>().ok().filter(|t| starts && t.is_finite())
}

impl CaseFolder {
    /// Lists the parts and times.
    pub(super) fn open(root: &Path) -> Result<CaseFolder, ReadError> {
        let mut warnings = Vec::new();
        let mut parts = Vec::new();
        while has_mesh(&root.join(format!("processor{}", parts.len()))) {
            let folder = root.join(format!("processor{}", parts.len()));
            parts.push(Part { folder, block: None });
        }
        let mut folders: Vec<PathBuf> =
            parts.first().map(|p| p.folder.clone()).into_iter().collect();
        let groups = Group::all(root, &entries(root)?).filter(|_| parts.is_empty());
        for group in groups.into_iter().flatten() {
            let folder = root.join(&group.name);
            let part = |block| Part { folder: folder.clone(), block: Some(block) };
            parts.extend((0..group.parts.len()).map(part));
            folders.push(folder);
        }
        let whole = has_mesh(root);
        let own_times = times_in(root)?;
        let mut times_of_parts = match folders.first() {
            Some(first) => times_in(first)?,
            None => Vec::new(),
        };
        for other in folders.iter().skip(1) {
            let times = times_in(other)?;
            times_of_parts.retain(|t| times.contains(t));
        }
        let last = |times: &[(f64, String)]| times.last().map_or(f64::NEG_INFINITY, |t| t.0);
        if !whole && parts.is_empty() {
            let what = "there is neither constant/polyMesh nor processor0/constant/polyMesh, and \
                        no folders processorsN that hold all parts";
            let cure = "run blockMesh or the mesher of the case; of a case with several regions, \
                        convert one with foamToVTK -region";
            let fault = Fault::unsupported(At::Field("the case".into()), what, cure);
            return Err(fault.in_file(root, FORMAT));
        }
        let decomposed = !whole || last(&times_of_parts) > last(&own_times);
        if decomposed && whole {
            warnings.push(format!(
                "the {} parts of the decomposed case are read: they have later times than the case \
                 itself",
                parts.len()
            ));
        }
        let times = if decomposed { times_of_parts } else { own_times };
        if !decomposed {
            parts = vec![Part { folder: root.to_path_buf(), block: None }];
        }
        let (root, blocks) = (root.to_path_buf(), BlockCache::default());
        Ok(CaseFolder { root, parts, times, warnings, blocks })
    }

    /// The times as steps of a series; each path opens the case at its time.
    pub(super) fn steps(&self) -> Vec<TimeStep> {
        let step = |(time, name): &(f64, String)| TimeStep {
            time: *time,
            part: 0,
            path: self.root.join(name),
        };
        self.times.iter().map(step).collect()
    }

    /// The file of the mesh of `part` that holds at the time of index `time`: meshes that move or
    /// change are written with the times.
    pub(super) fn mesh_file(
        &self,
        part: &Part,
        name: &str,
        time: Option<usize>,
    ) -> Result<FoamFile, ReadError> {
        let earlier = time.map_or(&[][..], |t| &self.times[..=t]);
        for (_, folder) in earlier.iter().rev() {
            let file = part.folder.join(folder).join("polyMesh").join(name);
            if exists(&file) {
                return self.open_file(part, &file);
            }
        }
        self.open_file(part, &part.folder.join("constant/polyMesh").join(name))
    }

    /// A file of a part, whole or the part's block of it.
    pub(super) fn open_file(&self, part: &Part, path: &Path) -> Result<FoamFile, ReadError> {
        match part.block {
            None => FoamFile::open(path, None),
            Some(block) => self.blocks.open(path)?.part(block),
        }
    }
}

fn entries(folder: &Path) -> Result<Vec<String>, ReadError> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| io_error(folder, e))? {
        names.push(
            entry.map_err(|e| io_error(folder, e))?.file_name().to_string_lossy().into_owned(),
        );
    }
    names.sort();
    Ok(names)
}

/// The files of a folder, in order of their names, without the ending `.gz`; and its folders.
pub(super) fn files_in(folder: &Path) -> Result<(Vec<String>, Vec<String>), ReadError> {
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for name in entries(folder)? {
        if folder.join(&name).is_dir() {
            folders.push(name);
        } else if !name.starts_with('.') && !name.ends_with('~') {
            files.push(name.strip_suffix(".gz").unwrap_or(&name).to_string());
        }
    }
    files.dedup();
    Ok((files, folders))
}

fn times_in(folder: &Path) -> Result<Vec<(f64, String)>, ReadError> {
    let mut times: Vec<(f64, String)> = entries(folder)?
        .into_iter()
        .filter(|name| folder.join(name).is_dir())
        .filter_map(|name| Some((time_of(&name)?, name)))
        .collect();
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(times)
}
