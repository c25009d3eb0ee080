//! Exodus II (`.e`, `.exo`, `.g`): finite elements in blocks, in a NetCDF file.
//!
//! Source: "EXODUS: A Finite Element Data Model" (Sandia, 2022 edition), and what VTK's reader does
//! with it.

use super::{Container, Header, Variable};
use crate::model::{Attributes, Cells, DataArray, Dataset, Points, UnstructuredGrid, Values};
use crate::read::error::{At, Fault};
use crate::read::vtk_xml::pieces::integers;
use crate::read::wedge::{TURNED, is_turned};
use crate::read::{OpenOptions, TimeStep, time_axis};
use std::path::Path;

pub(crate) const FORMAT: &str = "Exodus II";

/// Whether the dimensions are those of Exodus II.
pub(super) fn is_exodus(header: &Header) -> bool {
    let has = |name: &str| header.dimensions.iter().any(|d| d.name == name);
    has("num_nodes") && has("num_dim") && (has("num_el_blk") || has("num_elem"))
}

/// Reads the mesh and the variables of one time.
pub(super) fn dataset(
    path: &Path,
    file: &dyn Container,
    options: &OpenOptions,
    warnings: &mut Vec<String>,
) -> Result<(Dataset, Vec<TimeStep>), Fault> {
    options.refuse_lattice()?;
    let model = Model { file };
    let times: Vec<f64> = match model.all("time_whole")? {
        Some(v) => (0..v.len()).map(|i| v.get_f64(i)).collect(),
        None => Vec::new(),
    };
    let (step, steps) = if times.is_empty() {
        OpenOptions { time: options.time, ..Default::default() }.refuse_time()?;
        (None, Vec::new())
    } else {
        let (step, steps) = time_axis::choose(path, &times, options.time, warnings)?;
        (Some(step as u64), steps)
    };
    let mut grid = UnstructuredGrid { points: model.points()?, ..Default::default() };
    let mut sizes = Vec::new();
    let mut ids = Vec::new();
    let numbers = model.all("eb_prop1")?.map(|v| integers(&v).collect::<Vec<_>>());
    for block in 1..=model.length("num_el_blk")?.unwrap_or(0) {
        let before = grid.cells.len();
        model.block(block, &mut grid, warnings)?;
        let size = grid.cells.len() - before;
        let id = numbers.as_ref().and_then(|n| n.get(block as usize - 1));
        let id = id.copied().unwrap_or(block as i64);
        ids.resize(ids.len() + size, i32::try_from(id).unwrap_or(i32::MAX));
        sizes.push(size);
    }
    let points = grid.points.len();
    let wrong = grid.cells.connectivity().iter().filter(|&&k| k as usize >= points).count();
    if wrong > 0 {
        warnings.push(format!("{wrong} point ids do not exist; their cells will be left out"));
    }
    let mut out = Attributes::default();
    out.cell.push(DataArray::new("ObjectId", 1, Values::I32(ids)));
    if let Some(step) = step {
        model.of_nodes(step, points, &mut out)?;
        model.of_elements(step, &sizes, &mut out, warnings)?;
    }
    if model.find("name_glo_var").is_some() {
        warnings.push("global variables (one number a time) left out".into());
    }
    for (dimension, what) in
        [("num_node_sets", "node sets"), ("num_side_sets", "side sets (boundaries)")]
    {
        let found = file.header().dimensions.iter().find(|d| d.name == dimension);
        if let Some(d) = found.filter(|d| d.length > 0) {
            warnings.push(format!("{} {what} left out", d.length));
        }
    }
    if model.names("eb_names")?.iter().any(|n| !n.is_empty()) {
        out.text.push(("element blocks".into(), model.names("eb_names")?));
    }
    grid.attributes = out;
    let data = Dataset::UnstructuredGrid(grid);
    data.check()?;
    Ok((data, steps))
}

/// VTK's types of wedges.
const WEDGE: u8 = 13;
const QUADRATIC_WEDGE: u8 = 26;

struct Model<'f> {
    file: &'f dyn Container,
}

impl Model<'_> {
    fn find(&self, name: &str) -> Option<(usize, &Variable)> {
        self.file.header().variables.iter().enumerate().find(|(_, v)| v.name == name)
    }

    fn dims(&self, v: &Variable) -> Vec<u64> {
        v.axes.iter().map(|&a| self.file.header().dimensions[a].length).collect()
    }

    fn length(&self, name: &str) -> Result<Option<u64>, Fault> {
        let found = self.file.header().dimensions.iter().find(|d| d.name == name);
        match found.map(|d| d.length) {
            // Each has a variable of its own.
            Some(n) if n > self.file.header().variables.len() as u64 => {
                Err(Fault::field(format!("dimension `{name}`"), format!("{n} blocks or variables")))
            }
            n => Ok(n),
        }
    }

    /// All numbers of a variable.
    fn all(&self, name: &str) -> Result<Option<Values>, Fault> {
        let Some((i, v)) = self.find(name) else { return Ok(None) };
        let dims = self.dims(v);
        self.file.values(i, &vec![0; dims.len()], &dims).map(Some)
    }

    /// The numbers of a variable at a time.
    fn at(&self, name: &str, step: u64) -> Result<Option<Values>, Fault> {
        let Some((i, v)) = self.find(name) else { return Ok(None) };
        let mut count = self.dims(v);
        let mut start = vec![0; count.len()];
        if count.is_empty() {
            return Err(Fault::field(format!("variable `{name}`"), "it has no time"));
        }
        (start[0], count[0]) = (step, 1);
        self.file.values(i, &start, &count).map(Some)
    }

    /// The texts of a variable, one a row.
    fn names(&self, name: &str) -> Result<Vec<String>, Fault> {
        let Some((i, v)) = self.find(name) else { return Ok(Vec::new()) };
        let width = self.dims(v).last().copied().unwrap_or(0).max(1);
        let bytes = self.file.characters(i)?;
        let text = |row: &[u8]| crate::read::hdf5::from_characters(row.iter().copied());
        Ok(bytes.chunks(usize::try_from(width).unwrap_or(usize::MAX)).map(text).collect())
    }

    fn points(&self) -> Result<Points, Fault> {
        let mut axes = Vec::new();
        for name in ["coordx", "coordy", "coordz"] {
            axes.extend(self.all(name)?);
        }
        if axes.is_empty()
            && let Some(all) = self.all("coord")?
        {
            let (_, v) = self.find("coord").unwrap_or((0, &self.file.header().variables[0]));
            let points = self.dims(v).last().copied().unwrap_or(0) as usize;
            let rows = all.len().checked_div(points).unwrap_or(0);
            axes.extend((0..rows).map(|a| all.slice(a * points..(a + 1) * points)));
        }
        let count = axes.first().map_or(0, Values::len);
        if axes.is_empty() || axes.len() > 3 || axes.iter().any(|a| a.len() != count) {
            let lengths: Vec<usize> = axes.iter().map(Values::len).collect();
            return Err(Fault::field("the coordinates", format!("{lengths:?} numbers")));
        }
        let at = |i: usize, a: usize| axes.get(a).map_or(0.0, |v| v.get_f64(i));
        Ok(Points::F64((0..count).map(|i| [at(i, 0), at(i, 1), at(i, 2)]).collect()))
    }

    /// Appends the cells of a block.
    fn block(
        &self,
        block: u64,
        grid: &mut UnstructuredGrid,
        warnings: &mut Vec<String>,
    ) -> Result<(), Fault> {
        let name = format!("connect{block}");
        let Some((_, v)) = self.find(&name) else { return Ok(()) }; // an empty block
        let kind = v.text("elem_type").unwrap_or("").to_ascii_uppercase();
        let dims = self.dims(v);
        let refused = |what: String| {
            let at = At::Field(format!("variable `{name}`"));
            let cure = "read it in ParaView and save it as .vtu";
            Fault::unsupported(at, what, cure)
        };
        let [_, nodes] = dims[..] else {
            return Err(refused(format!("elements `{kind}` with {} axes", dims.len())));
        };
        let Some((vtk, kept)) = shape(&kind, nodes) else {
            return Err(refused(format!("elements `{kind}` of {nodes} nodes")));
        };
        let nodes = nodes as usize;
        if kept < nodes {
            warnings.push(format!("block {block}: the inner nodes of `{kind}` are left out"));
        }
        let list: Vec<i64> =
            self.all(&name)?.iter().flat_map(|v| integers(v).collect::<Vec<_>>()).collect();
        for cell in list.chunks_exact(nodes) {
            let id = |i: usize| Cells::id(cell[in_order(vtk, i)].saturating_sub(1));
            let ids: Vec<u32> = (0..kept).map(id).collect();
            // In the manual the first triangle of a wedge is seen from inside, and some programs
            // write it as VTK has it.
            match matches!(vtk, WEDGE | QUADRATIC_WEDGE) && is_turned(&ids, &grid.points) {
                true => grid.cells.push(TURNED[..kept].iter().map(|&k| ids[k])),
                false => grid.cells.push(ids),
            }
            grid.types.push(vtk);
        }
        Ok(())
    }

    fn of_nodes(&self, step: u64, points: usize, out: &mut Attributes) -> Result<(), Fault> {
        let names = self.names("name_nod_var")?;
        let together = self.at("vals_nod_var", step)?;
        for (i, name) in names.into_iter().enumerate() {
            let values = match &together {
                Some(all) if (i + 1) * points <= all.len() => {
                    Some(all.slice(i * points..(i + 1) * points))
                }
                _ => self.at(&format!("vals_nod_var{}", i + 1), step)?,
            };
            let Some(values) = values else {
                let what = format!("`{name}` has no values");
                return Err(Fault::field("the variables of nodes", what));
            };
            out.point.push(DataArray::new(name, 1, values));
        }
        Ok(())
    }

    fn of_elements(
        &self,
        step: u64,
        sizes: &[usize],
        out: &mut Attributes,
        warnings: &mut Vec<String>,
    ) -> Result<(), Fault> {
        for (i, name) in self.names("name_elem_var")?.into_iter().enumerate() {
            let mut all = Vec::new();
            let mut without = Vec::new();
            for (b, &size) in sizes.iter().enumerate() {
                let variable = format!("vals_elem_var{}eb{}", i + 1, b + 1);
                match self.at(&variable, step)? {
                    Some(v) if v.len() == size => all.extend((0..size).map(|k| v.get_f64(k))),
                    Some(v) => {
                        let what = format!("{} values for {size} elements", v.len());
                        return Err(Fault::field(format!("variable `{variable}`"), what));
                    }
                    None => {
                        without.push((b + 1).to_string());
                        all.resize(all.len() + size, f64::NAN);
                    }
                }
            }
            if !without.is_empty() {
                let list = without.join(", ");
                warnings.push(format!("`{name}` is NaN in blocks without it: {list}"));
            }
            out.cell.push(DataArray::new(name, 1, Values::F64(all)));
        }
        Ok(())
    }
}

/// VTK's type of an element, and how many of its nodes that type has.
fn shape(kind: &str, nodes: u64) -> Option<(u8, usize)> {
    let is = |names: &[&str]| names.iter().any(|n| kind.starts_with(n));
    Some(match nodes {
        1 if is(&["SPH", "CIR"]) => (1, 1),
        2 if is(&["BAR", "TRU", "BEA", "EDG", "ROD"]) => (3, 2),
        3 if is(&["BAR", "TRU", "BEA", "EDG", "ROD"]) => (21, 3),
        3 if is(&["TRI", "SHE"]) => (5, 3),
        6 if is(&["TRI", "SHE"]) => (22, 6),
        4 if is(&["QUA", "SHE"]) => (9, 4),
        8 if is(&["QUA", "SHE"]) => (23, 8),
        9 if is(&["QUA", "SHE"]) => (28, 9),
        4 if is(&["TET"]) => (10, 4),
        10 if is(&["TET"]) => (24, 10),
        5 if is(&["PYR"]) => (14, 5),
        13 if is(&["PYR"]) => (27, 13),
        6 if is(&["WED"]) => (WEDGE, 6),
        15 if is(&["WED"]) => (QUADRATIC_WEDGE, 15),
        8 if is(&["HEX"]) => (12, 8),
        20 | 27 if is(&["HEX"]) => (25, 20),
        _ => return None,
    })
}

/// Which node of Exodus is node `i` of VTK: VTK has the middles of the upper edges before those of
/// the vertical ones.
fn in_order(vtk: u8, i: usize) -> usize {
    match (vtk, i) {
        (25, 12..=15) => i + 4,
        (25, 16..=19) => i - 4,
        (QUADRATIC_WEDGE, 9..=11) => i + 3,
        (QUADRATIC_WEDGE, 12..=14) => i - 3,
        _ => i,
    }
}
