//! PLOT3D grids and solutions: binary of either byte order, with or without Fortran's record marks,
//! one or more blocks, two- or three-dimensional, with or without iblank; and plain text. The
//! layout is detected from the size of the file.

mod layout;

use super::error::{At, BROKEN, Cursor, Fault, TRUNCATED, fits, read_bytes};
use super::{Content, LoadedFile, ReadError};
use crate::model::array::fortran_number;
use crate::model::{
    Attributes, Block, DataArray, Dataset, Endian, Points, ScalarType, StructuredGrid, Values,
};
use layout::{Plan, Role, find};
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "PLOT3D";

/// What is known about the files in advance; everything left `None` is detected.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Plot3dOptions {
    /// The solution ("q") file. Without it, a file in the grid's directory with the usual name is
    /// used: `nameq.bin` for `namexyz.bin`, `name.q` for `name.xyz`, `.x`, `.g`, `.grid` or `.p3d`.
    pub solution: Option<PathBuf>,
    /// Byte order.
    pub endian: Option<Endian>,
    /// Fortran record marks.
    pub records: Option<bool>,
    /// Whether the file begins with a number of blocks.
    pub multi_block: Option<bool>,
    /// Whether the grid has iblank values.
    pub iblank: Option<bool>,
    /// Bytes per real number: 4 or 8.
    pub real_bytes: Option<usize>,
    /// Whether the grid is two-dimensional.
    pub two_dimensional: Option<bool>,
}

/// Reads a grid and the solution that belongs to it.
pub fn read(path: &Path, options: &Plot3dOptions) -> Result<LoadedFile, ReadError> {
    let mut warnings = Vec::new();
    let mut path = path.to_path_buf();
    let mut solution = options.solution.clone();
    if solution.is_none() {
        if let Some(grid) =
            companion_file(&path, &[("q", "xyz")], &["q", "sol"], &["xyz", "x", "g", "grid", "p3d"])
        {
            // The user named the solution; its grid is needed first.
            solution = Some(std::mem::replace(&mut path, grid));
        } else {
            solution = companion_file(
                &path,
                &[("xyz", "q"), ("grid", "q")],
                &["xyz", "x", "g", "grid", "p3d"],
                &["q", "sol"],
            );
        }
    }

    let bytes = read_bytes(&path)?;
    let mut blocks = grid_blocks(&bytes, options).map_err(|mut f| {
        if !is_text(&bytes) && find(Role::Solution, &bytes, options).is_ok() {
            f.what = "it is a solution, and there is no grid beside it".into();
            f.cure = "put the grid beside it (nameq.bin goes with namexyz.bin, name.q with \
                      name.xyz), or open the grid"
                .into();
        }
        f.in_file(&path, FORMAT)
    })?;
    match &solution {
        None => warnings.push("no solution file beside the grid: it has no flow variables".into()),
        Some(q) => {
            let bytes = read_bytes(q)?;
            add_solution(&mut blocks, &bytes, options).map_err(|f| f.in_file(q, FORMAT))?;
        }
    }
    Ok(opened(blocks, warnings))
}

/// Reads a grid from its bytes, and the solution if given; `path` is used in messages only.
pub fn read_from_bytes(
    path: &Path,
    grid: &[u8],
    solution: Option<&[u8]>,
    options: &Plot3dOptions,
) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let mut blocks = grid_blocks(grid, options).map_err(fault)?;
    if let Some(q) = solution {
        add_solution(&mut blocks, q, options).map_err(fault)?;
    }
    Ok(opened(blocks, Vec::new()))
}

fn opened(mut blocks: Vec<StructuredGrid>, warnings: Vec<String>) -> LoadedFile {
    let data = if blocks.len() == 1 {
        Dataset::StructuredGrid(blocks.remove(0))
    } else {
        let named = blocks.into_iter().enumerate();
        Dataset::MultiBlock(
            named
                .map(|(i, d)| Block { name: (i + 1).to_string(), data: Dataset::StructuredGrid(d) })
                .collect(),
        )
    };
    LoadedFile { format: FORMAT, content: Content::Data(data), warnings, time_steps: Vec::new() }
}

/// True if `bytes` have the size of a binary PLOT3D grid or solution.
pub(crate) fn looks_like_plot3d(bytes: &[u8]) -> bool {
    [Role::Grid, Role::Solution]
        .into_iter()
        .any(|r| find(r, bytes, &Plot3dOptions::default()).is_ok())
}

/// An existing file in the directory of `path` whose name is derived from it: by the end of the
/// stem, or by the extension.
pub(crate) fn companion_file(
    path: &Path,
    stems: &[(&str, &str)],
    from: &[&str],
    to: &[&str],
) -> Option<PathBuf> {
    let stem = path.file_stem()?.to_str()?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    for (old, new) in stems {
        if let Some(base) = stem.strip_suffix(old) {
            let other = path.with_file_name(format!("{base}{new}")).with_extension(extension);
            if other != path && other.is_file() {
                return Some(other);
            }
        }
    }
    if from.contains(&extension.to_ascii_lowercase().as_str()) {
        return to.iter().map(|e| path.with_extension(e)).find(|p| p.is_file());
    }
    None
}

/// Text files contain only numbers and white space.
fn is_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(4096)];
    !head.is_empty()
        && head
            .iter()
            .all(|b| b.is_ascii_whitespace() || b"0123456789+-.eEdD,*nNaAiIfF".contains(b))
}

fn grid_blocks(bytes: &[u8], options: &Plot3dOptions) -> Result<Vec<StructuredGrid>, Fault> {
    let (dims, data) = if is_text(bytes) {
        text_blocks(Role::Grid, bytes, options)?
    } else {
        binary_blocks(Role::Grid, bytes, options)?
    };
    let mut out = Vec::new();
    for (d, b) in dims.into_iter().zip(data) {
        let n = d.iter().map(|&x| x as usize).product::<usize>();
        let extent = std::array::from_fn(|i| if i % 2 == 0 { 0 } else { d[i / 2] as i32 - 1 });
        let mut attributes = Attributes::default();
        if let Some(iblank) = b.iblank {
            // Points with iblank 0 are outside the flow: VTK's bit for hidden points.
            let hidden = iblank.iter().map(|&i| if i == 0 { 2 } else { 0 }).collect();
            attributes.point.push(DataArray::new("iblank", 1, Values::I32(iblank)));
            attributes.point.push(DataArray::new("vtkGhostType", 1, Values::U8(hidden)));
        }
        let axes = b.reals.len() / n.max(1);
        let points = match &b.reals {
            Values::F32(v) => Points::F32(
                (0..n)
                    .map(|i| std::array::from_fn(|c| if c < axes { v[c * n + i] } else { 0.0 }))
                    .collect(),
            ),
            v => Points::F64(
                (0..n)
                    .map(|i| {
                        std::array::from_fn(|c| if c < axes { v.get_f64(c * n + i) } else { 0.0 })
                    })
                    .collect(),
            ),
        };
        out.push(StructuredGrid { extent, points, attributes });
    }
    Ok(out)
}

/// Adds the arrays Density, Momentum and StagnationEnergy, named as VTK's reader names them, and
/// the reference numbers.
fn add_solution(
    grids: &mut [StructuredGrid],
    bytes: &[u8],
    options: &Plot3dOptions,
) -> Result<(), Fault> {
    let (dims, data) = if is_text(bytes) {
        text_blocks(Role::Solution, bytes, options)?
    } else {
        binary_blocks(Role::Solution, bytes, options)?
    };
    if dims.len() != grids.len() {
        return Err(Fault::field(
            "the number of blocks",
            format!("{}, but the grid has {}", dims.len(), grids.len()),
        ));
    }
    for (i, ((grid, d), b)) in grids.iter_mut().zip(dims).zip(data).enumerate() {
        let of_grid = crate::model::extent_dims(grid.extent);
        if of_grid != d.map(|x| x as usize) {
            let what = format!("{d:?} points, but the grid has {of_grid:?}");
            return Err(Fault::field(format!("block {}", i + 1), what));
        }
        let n = grid.points.len();
        let variables = b.reals.len() / n.max(1);
        let a = &mut grid.attributes;
        // Density, two or three momenta, energy. Plane flows get a third momentum of 0.
        let momenta = variables - 2;
        let vector: Vec<usize> = (0..n)
            .flat_map(|p| {
                (0..3).map(move |c| if c < momenta { (c + 1) * n + p } else { usize::MAX })
            })
            .collect();
        a.point.push(DataArray::new("Density", 1, b.reals.slice(0..n)));
        a.point.push(DataArray::new("Momentum", 3, picked(&b.reals, &vector)));
        a.point.push(DataArray::new(
            "StagnationEnergy",
            1,
            b.reals.slice((variables - 1) * n..variables * n),
        ));
        for (name, value) in ["Mach", "Alpha", "Re", "Time"].into_iter().zip(b.reference) {
            a.field.push(DataArray::new(name, 1, Values::F64(vec![value])));
        }
    }
    Ok(())
}

/// The values at `at`; 0 if out of range (the third component of two-dimensional flows).
fn picked(values: &Values, at: &[usize]) -> Values {
    match values {
        Values::F32(v) => {
            Values::F32(at.iter().map(|&i| v.get(i).copied().unwrap_or(0.0)).collect())
        }
        v => {
            Values::F64(at.iter().map(|&i| if i < v.len() { v.get_f64(i) } else { 0.0 }).collect())
        }
    }
}

/// The numbers of one block.
struct BlockData {
    /// All coordinates or flow variables, one variable after the other.
    reals: Values,
    iblank: Option<Vec<i32>>,
    /// Free-stream Mach number, angle of attack, Reynolds number, time.
    reference: Vec<f64>,
}

type Blocks = (Vec<[u32; 3]>, Vec<BlockData>);

fn binary_blocks(role: Role, bytes: &[u8], options: &Plot3dOptions) -> Result<Blocks, Fault> {
    let Plan { layout, dims, data_start, .. } = find(role, bytes, options)?;
    let kind = if layout.real == 4 { ScalarType::F32 } else { ScalarType::F64 };
    let mut cursor = Cursor { data: bytes, pos: data_start };
    let mark = if layout.records { 4 } else { 0 };
    let mut blocks = Vec::new();
    for d in &dims {
        let n: u64 = d.iter().map(|&x| u64::from(x)).product();
        let mut reference = Vec::new();
        if role == Role::Solution {
            cursor.take(mark, 1, "record marks")?;
            let v = Values::from_bytes(
                kind,
                cursor.take(4, layout.real, "reference numbers")?,
                layout.endian,
            );
            reference = (0..4).map(|i| v.get_f64(i)).collect();
            cursor.take(mark, 1, "record marks")?;
        }
        cursor.take(mark, 1, "record marks")?;
        let variables = if role == Role::Grid { layout.axes } else { layout.axes + 2 } as u64;
        let reals = Values::from_bytes(
            kind,
            cursor.take(n * variables, layout.real, "reals")?,
            layout.endian,
        );
        let mut iblank = None;
        if layout.iblank
            && let Values::I32(v) =
                Values::from_bytes(ScalarType::I32, cursor.take(n, 4, "iblank")?, layout.endian)
        {
            iblank = Some(v);
        }
        cursor.take(mark, 1, "record marks")?;
        blocks.push(BlockData { reals, iblank, reference });
    }
    Ok((dims, blocks))
}

/// Reads text: the same numbers in the same order. The count of the numbers tells whether the file
/// begins with a number of blocks.
fn text_blocks(role: Role, bytes: &[u8], options: &Plot3dOptions) -> Result<Blocks, Fault> {
    let text = String::from_utf8_lossy(bytes);
    let words: Vec<&str> =
        text.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty()).collect();
    if let Some(w) = words.iter().find(|w| w.contains('*')) {
        let cure = "write the file without repeat counts, or as binary";
        return Err(Fault::unsupported(
            At::Field("the numbers".into()),
            format!("Fortran repeat count `{w}`"),
            cure,
        ));
    }
    let int = |i: usize| words.get(i).and_then(|w| w.parse::<u32>().ok()).filter(|&d| d >= 1);
    for multi in [false, true] {
        for axes in [3usize, 2] {
            for iblank in [false, true] {
                if options.multi_block.is_some_and(|m| m != multi)
                    || options.two_dimensional.is_some_and(|t| t != (axes == 2))
                    || options.iblank.is_some_and(|b| b != iblank && role == Role::Grid)
                    || iblank && role == Role::Solution
                {
                    continue;
                }
                let Some(count) = (if multi { int(0) } else { Some(1) }) else { continue };
                let Ok(count) = fits(u64::from(count), 1, words.len(), At::Byte(0), "blocks")
                else {
                    continue;
                };
                let start = usize::from(multi);
                let dims: Option<Vec<[u32; 3]>> = (0..count)
                    .map(|b| {
                        let mut d = [1; 3];
                        for (a, x) in d.iter_mut().enumerate().take(axes) {
                            *x = int(start + b * axes + a)?;
                        }
                        Some(d)
                    })
                    .collect();
                let Some(dims) = dims else { continue };
                let sizes: Option<Vec<usize>> = dims
                    .iter()
                    .map(|d| {
                        d.iter()
                            .try_fold(1usize, |n, &x| n.checked_mul(x as usize))
                            .filter(|&n| n <= words.len())
                    })
                    .collect();
                let Some(sizes) = sizes else { continue };
                let (variables, reference) =
                    if role == Role::Grid { (axes, 0) } else { (axes + 2, 4) };
                let per_point = variables + usize::from(iblank);
                let total: usize = sizes.iter().map(|n| n * per_point + reference).sum();
                if start + count * axes + total != words.len() {
                    continue;
                }
                let mut at = start + count * axes;
                let mut blocks = Vec::new();
                for n in sizes {
                    let reference = reals(&words[at..at + reference])?;
                    at += reference.len();
                    let values = reals(&words[at..at + n * variables])?;
                    at += n * variables;
                    let blank = if iblank { &words[at..at + n] } else { &[] };
                    at += blank.len();
                    let blank: Vec<i32> = blank.iter().filter_map(|w| w.parse().ok()).collect();
                    if iblank && blank.len() != n {
                        return Err(Fault::new(
                            At::Field("iblank".into()),
                            "it holds something that is not a whole number",
                            BROKEN,
                        ));
                    }
                    blocks.push(BlockData {
                        reals: Values::F64(values),
                        iblank: iblank.then_some(blank),
                        reference,
                    });
                }
                return Ok((dims, blocks));
            }
        }
    }
    let what = format!(
        "{} numbers do not make a grid or solution of the size the first ones give",
        words.len()
    );
    Err(Fault::new(At::Byte(0), what, TRUNCATED))
}

/// Parses numbers as Fortran writes them.
fn reals(words: &[&str]) -> Result<Vec<f64>, Fault> {
    words
        .iter()
        .map(|w| {
            let wrong = || Fault::field("the numbers", format!("`{w}` is not a number"));
            fortran_number(w).ok_or_else(wrong)
        })
        .collect()
}
