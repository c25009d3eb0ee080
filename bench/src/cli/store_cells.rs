//! `bench store` of the cells of VTK's XML files, piece by piece: files of parts, and parts of
//! files.

use super::StoreArgs;
use super::store_job::StoreJob;
use crate::image::subject::{LoadOptions, marked_array};
use datasets::cli::CommonArgs;
use datasets::model::{ColorBy, DataArray, Dataset, PieceBoundaries, SharedFaces, Values};
use datasets::read::vtk_xml::CellPieces;
use datasets::read::{Content, LoadedFile};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Memory that a cell takes while its piece is read: its ids twice, the keys of its faces, and its
/// triangles with their values.
const BYTES_OF_CELL: usize = 1024;
/// Fewest cells of a piece. With fewer, most faces would lie between pieces.
const FEWEST_CELLS: usize = 1 << 10;

/// The array that meshes are coloured by.
struct ColorArray {
    name: Option<String>,
    /// Whether the first file has been asked which array it marks.
    is_known: bool,
}

/// Adds the cells of one file in pieces that fit into `memory`. Returns whether it could: what
/// [`CellPieces::open`] leaves to others, and files of one piece, are read as a whole.
pub(super) fn of_file(
    job: &mut StoreJob<'_>,
    common: CommonArgs,
    args: &StoreArgs,
    file: &Path,
    memory: usize,
) -> anyhow::Result<bool> {
    let mut color = ColorArray { name: args.color_by.clone(), is_known: true };
    in_pieces(job, common, file, &mut color, memory)
}

fn in_pieces(
    job: &mut StoreJob<'_>,
    common: CommonArgs,
    file: &Path,
    color: &mut ColorArray,
    memory: usize,
) -> anyhow::Result<bool> {
    let at_once = (memory / BYTES_OF_CELL).max(FEWEST_CELLS);
    let is_meant = file
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("vtu") || e.eq_ignore_ascii_case("vtp"));
    let Some(mut pieces) = (if is_meant { CellPieces::open(file, at_once)? } else { None }) else {
        return Ok(false);
    };
    let cells = pieces.cells();
    let marked = pieces.marked_array();
    let color_by = if color.is_known { &color.name } else { &marked }.clone();
    let is_wanted = |name: &str| color_by.as_ref().is_some_and(|asked| is_array_of(name, asked));
    // The reader of the whole says what there is instead.
    let is_missing = color_by.is_some() && !pieces.array_names().any(is_wanted);
    if cells <= at_once as u64 || is_missing {
        return Ok(false);
    }
    *color = ColorArray { name: color_by.clone(), is_known: true };
    pieces.keep_arrays(is_wanted);
    let cancel = job.cancel();
    if pieces.may_share_faces() {
        let bar = common.progress(cells, "faces between the pieces");
        pieces.find_shared_faces(|read| {
            bar.set_position(read);
            anyhow::Ok(cancel.check()?)
        })?;
    }
    let bar = job.progress(cells);
    let origin = match job.origin() {
        Some(origin) => origin,
        None => pieces.origin()?,
    };
    while let Some(piece) = pieces.next_piece() {
        let piece = piece?;
        let options = LoadOptions {
            color_by: color_by.clone(),
            origin: Some(origin),
            shared_faces: piece.shared_faces.map(Arc::new),
            ..LoadOptions::default()
        };
        job.add_piece(file, &piece.file, &options)?;
        bar.inc(piece.cells);
    }
    Ok(true)
}

/// Whether `asked`, which may end in the name of a component, names the array `name`.
fn is_array_of(name: &str, asked: &str) -> bool {
    asked == name || asked.rsplit_once(':').is_some_and(|(array, _)| array == name)
}

/// Adds several files, one after the other. Of unstructured pieces of one mesh (`is_divided`), the
/// faces that two of them have are left out. As in files that are read as a whole, the first names
/// the array that they are coloured by, and those without it have NaN.
pub(super) fn of_files(
    job: &mut StoreJob<'_>,
    common: CommonArgs,
    args: &StoreArgs,
    files: &[PathBuf],
    is_divided: bool,
    memory: usize,
) -> anyhow::Result<()> {
    let between = if is_divided { faces_between(common, job, files)? } else { None };
    let bar = common.progress(files.len() as u64, "storing");
    let mut color = ColorArray { name: args.color_by.clone(), is_known: args.color_by.is_some() };
    // The last file without the array, and how many have it.
    let (mut without, mut with) = (None, 0);
    for file in files {
        if between.is_none() && in_pieces(job, common, file, &mut color, memory)? {
            with += 1;
            bar.inc(1);
            continue;
        }
        let mut opened = datasets::read::open(file)?;
        // A process without a part of the data writes a piece without cells, and often without the
        // arrays of the others.
        if !is_empty(&opened) {
            if let Content::Data(data) = &mut opened.content {
                if !color.is_known {
                    color = ColorArray { name: marked_array(data), is_known: true };
                }
                match color.name.as_ref().map(|name| (name, ColorBy::find(data, name))) {
                    Some((name, Err(error))) => {
                        without = Some((file, error));
                        give_nothing(data, name);
                    }
                    Some((_, Ok(_))) | None => with += 1,
                }
            }
            let options = LoadOptions {
                color_by: color.name.clone(),
                shared_faces: between.clone(),
                ..LoadOptions::default()
            };
            job.add_piece(file, &opened, &options)?;
        }
        bar.inc(1);
    }
    if let Some((file, error)) = without {
        if with == 0 {
            return Err(anyhow::Error::new(error).context(file.display().to_string()));
        }
        job.warn_once("some blocks lack the array to colour by; they get NaN".into());
    }
    Ok(())
}

/// Gives data without an array one of NaN.
fn give_nothing(data: &mut Dataset, name: &str) {
    let (points, _) = data.counts();
    let nothing = Values::F32(vec![f32::NAN; points as usize]);
    if let Some(attributes) = data.attributes_mut() {
        attributes.point.push(DataArray::new(name, 1, nothing));
    }
}

/// The faces between pieces of solid cells that have no ghost cells: each piece is read once for
/// them. `None` where ghost cells tell.
fn faces_between(
    common: CommonArgs,
    job: &mut StoreJob<'_>,
    files: &[PathBuf],
) -> anyhow::Result<Option<Arc<SharedFaces>>> {
    let bar = common.progress(files.len() as u64, "faces between the pieces");
    let (mut boundaries, mut without_copies) = (PieceBoundaries::default(), 0);
    for file in files {
        let opened = datasets::read::open(file)?;
        if let Content::Data(data) = &opened.content
            && !is_empty(&opened)
            && !has_ghost_cells(&opened)
        {
            without_copies += 1;
            boundaries.add(data);
        }
        bar.inc(1);
    }
    if without_copies < 2 {
        return Ok(None);
    }
    let shared = boundaries.shared_faces();
    if shared.is_empty() {
        job.warn_once(format!(
            "{without_copies} pieces have no ghost cells and no face in common: should they touch \
             one another, the faces between them are stored too; ParaView's filter Ghost Cells \
             adds such cells"
        ));
    }
    common.note(1, format_args!("{} faces between pieces are left out", shared.len()));
    Ok(Some(Arc::new(shared)))
}

/// Whether a file has no cells.
fn is_empty(opened: &LoadedFile) -> bool {
    match &opened.content {
        Content::Data(data) => data.leaves().iter().all(|leaf| leaf.counts().1 == 0),
        Content::Scene(_) => false,
    }
}

/// Whether a piece says which of its cells are copies of another piece's.
fn has_ghost_cells(opened: &LoadedFile) -> bool {
    match &opened.content {
        Content::Data(data) => data
            .leaves()
            .iter()
            .filter_map(|leaf| leaf.attributes())
            .any(|attributes| attributes.cell_array("vtkGhostType").is_some()),
        Content::Scene(_) => false,
    }
}
