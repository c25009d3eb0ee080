//! Which files a parallel or multi-block file names: for programs that read each piece where it is
//! needed.

use super::file::{XmlFile, attribute_numbers, parse_tree, split};
use super::{FORMAT, MAX_NESTING, pieces};
use crate::read::ReadError;
use crate::read::error::{Fault, read_bytes, sibling_path};
use glam::DVec3;
use roxmltree::Node;
use std::path::{Path, PathBuf};

/// The pieces that a file names.
#[derive(Debug, Clone, PartialEq)]
pub struct PieceFiles {
    /// The kind of the pieces ("UnstructuredGrid", "ImageData", ...), or `None` for blocks of any
    /// kind (`.vtm`).
    pub kind: Option<String>,
    /// The files in order. Lists among them are replaced by what they name.
    pub files: Vec<PathBuf>,
    /// The lattice of image data: first and last index per axis, and the position of index (0,0,0)
    /// and the distance between points.
    pub lattice: Option<([i32; 6], DVec3, DVec3)>,
}

/// The pieces that a VTK XML file names (`.pvti .pvtp .pvtu .pvtr .pvts .vtm .vtpd .vtpc`), without
/// reading them; `None` for a file of another kind.
///
/// ```
/// let dir = tempfile::tempdir()?;
/// let path = dir.path().join("parts.pvtp");
/// std::fs::write(&path, r#"<VTKFile type="PPolyData"><PPolyData>
///     <Piece Source="a.vtp"/><Piece Source="b.vtp"/></PPolyData></VTKFile>"#)?;
/// let pieces = datasets::read::vtk_xml::piece_files(&path)?.expect("a list");
/// assert_eq!(pieces.kind.as_deref(), Some("PolyData"));
/// assert_eq!(pieces.files, [dir.path().join("a.vtp"), dir.path().join("b.vtp")]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A file that cannot be read or is broken, and lists that name each other.
pub fn piece_files(path: &Path) -> Result<Option<PieceFiles>, ReadError> {
    listed(path, 0)
}

fn listed(path: &Path, depth: usize) -> Result<Option<PieceFiles>, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let bytes = read_bytes(path)?;
    let parts = split(&bytes).map_err(fault)?;
    let tree = parse_tree(&parts.head).map_err(fault)?;
    let file = XmlFile::new(&tree, parts.appended).map_err(fault)?;
    let kind = file.root.attribute("type").unwrap_or("");
    let Some(set) = file.root.children().find(|n| n.is_element() && n.tag_name().name() == kind)
    else {
        return Ok(None);
    };
    if let Some(serial) = kind.strip_prefix('P').filter(|k| pieces::KINDS.contains(k)) {
        let source = |n: Node<'_, '_>| n.attribute("Source").map(|s| sibling_path(path, s));
        let pieces = set.children().filter(|n| n.has_tag_name("Piece"));
        let files: Option<Vec<PathBuf>> = pieces.map(source).collect();
        let Some(files) = files else {
            return Err(fault(Fault::field("Piece", "it has no Source")));
        };
        let extent = attribute_numbers::<i32, 6>(set, "WholeExtent").map_err(fault)?;
        let vector = |name| {
            let numbers = attribute_numbers::<f64, 3>(set, name).map_err(fault)?;
            Ok::<_, ReadError>(numbers.map(DVec3::from_array))
        };
        let (origin, spacing) = (vector("Origin")?, vector("Spacing")?);
        let lattice = extent
            .filter(|_| serial == "ImageData")
            .map(|extent| (extent, origin.unwrap_or(DVec3::ZERO), spacing.unwrap_or(DVec3::ONE)));
        return Ok(Some(PieceFiles { kind: Some(serial.into()), files, lattice }));
    }
    if !matches!(
        kind,
        "vtkMultiBlockDataSet" | "vtkPartitionedDataSetCollection" | "vtkPartitionedDataSet"
    ) {
        return Ok(None);
    }
    if depth > MAX_NESTING {
        let what = format!("files name each other more than {MAX_NESTING} deep");
        return Err(fault(Fault::field("DataSet", what)));
    }
    let named = set.descendants().filter(|n| n.has_tag_name("DataSet") || n.has_tag_name("Piece"));
    let mut files = Vec::new();
    for source in named.filter_map(|n| n.attribute("file")) {
        let path = sibling_path(path, source);
        // Only small files with such names are lists.
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
        let is_list =
            extension.starts_with("pvt") || matches!(&*extension, "vtm" | "vtpd" | "vtpc");
        match if is_list { listed(&path, depth + 1)? } else { None } {
            Some(inner) => files.extend(inner.files),
            None => files.push(path),
        }
    }
    Ok(Some(PieceFiles { kind: None, files, lattice: None }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_that_nest_in_one_file_and_over_files_are_listed_in_order() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let outer = write(
            "outer.vtm",
            r#"<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet>
               <Block index="0"><DataSet index="0" file="a.vtu"/><DataSet index="1"/></Block>
               <DataSet index="1" file="inner.pvtu"/><DataSet index="2" file="c.vtp"/>
               </vtkMultiBlockDataSet></VTKFile>"#,
        );
        write(
            "inner.pvtu",
            r#"<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid>
               <Piece Source="b0.vtu"/><Piece Source="b1.vtu"/>
               </PUnstructuredGrid></VTKFile>"#,
        );
        let pieces = piece_files(&outer).unwrap().unwrap();
        let names: Vec<_> =
            pieces.files.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["a.vtu", "b0.vtu", "b1.vtu", "c.vtp"]);
    }

    #[test]
    fn image_data_has_its_lattice_and_lists_that_name_themselves_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rho.pvti");
        let text = r#"<VTKFile type="PImageData"><PImageData WholeExtent="0 8 0 4 0 2"
            Origin="1 2 3" Spacing="0.5 0.5 0.25"><Piece Source="a.vti"/></PImageData></VTKFile>"#;
        std::fs::write(&path, text).unwrap();
        let lattice = piece_files(&path).unwrap().unwrap().lattice;
        let (origin, spacing) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 0.5, 0.25));
        assert_eq!(lattice, Some(([0, 8, 0, 4, 0, 2], origin, spacing)));

        let path = dir.path().join("itself.vtm");
        let text = r#"<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet>
            <DataSet file="itself.vtm"/></vtkMultiBlockDataSet></VTKFile>"#;
        std::fs::write(&path, text).unwrap();
        let error = piece_files(&path).unwrap_err().to_string();
        assert!(error.contains("deep") && error.contains("itself.vtm"), "{error}");
    }
}
