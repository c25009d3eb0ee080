//! CGNS (`.cgns`): zones with lattices or elements, solutions at points and cells, and times.
//! Zones become blocks; of several bases, the blocks have the names of both.
//!
//! Files in HDF5 are read, those in the older ADF are recognized. Rind planes and elements of the
//! boundary are left out, polyhedra are built of their faces, and values with units become those
//! of SI. Boundary conditions tell which points are those of walls.
//!
//! Source: "CGNS Standard Interface Data Structures" (SIDS) 4.4.

mod boundary;
mod connectivity;
mod element;
mod polyhedra;
mod sections;
mod solution;
mod times;
mod tree;
mod units;
mod zone;

use super::error::{At, Fault};
use super::{Content, LoadedFile, OpenOptions, ReadError, TimeStep, time_axis};
use crate::model::{Attributes, Block, DataArray, Dataset, StructuredGrid, Values};
use std::path::Path;
use times::Step;
use tree::{Node, Tree};
use units::Units;
use zone::Zone;

pub(crate) const FORMAT: &str = "CGNS";
/// A node of every file, right below its root.
pub(crate) const VERSION_NODE: &str = "CGNSLibraryVersion";
/// The first bytes of a file in the format that came before HDF5.
const ADF: &[u8] = b"@(#)ADF Database Version";

/// Whether the first bytes are those of a CGNS file in ADF. Of version B, the first four letters
/// have the highest bit set.
pub(crate) fn begins_as_adf(head: &[u8]) -> bool {
    head.len() >= ADF.len() && head.iter().zip(ADF).all(|(a, b)| a & 0x7f == *b)
}

/// Reads a file, or one of its times.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let mut head = Vec::new();
    let file = std::fs::File::open(path).map_err(|e| super::error::io_error(path, e))?;
    std::io::Read::read_to_end(&mut std::io::Read::take(file, ADF.len() as u64), &mut head)
        .map_err(|e| super::error::io_error(path, e))?;
    if begins_as_adf(&head) {
        let cure = "convert it by `cgnsconvert -h OLD.cgns NEW.cgns`, a tool of the CGNS library \
                    (Debian: cgns-convert)";
        let fault = Fault::unsupported(At::Byte(0), "it is in ADF, not in HDF5", cure);
        return Err(fault.in_file(path, FORMAT));
    }
    let tree = Tree::open(path)?;
    from_tree(path, &tree, options.time).map_err(|f| f.in_file(path, FORMAT))
}

/// What reading found besides the data.
#[derive(Default)]
struct Notes {
    warnings: Vec<String>,
    /// What was done to units, each once.
    units: Vec<String>,
    /// Solutions with planes beyond their zone.
    rind: usize,
}

fn from_tree(path: &Path, tree: &Tree, time: Option<f64>) -> Result<LoadedFile, Fault> {
    let top = tree.children(&tree.root()?)?;
    let bases: Vec<&Node> = top.iter().filter(|n| n.label == "CGNSBase_t").collect();
    if bases.is_empty() {
        return Err(Fault::field("the file", "it has no CGNSBase_t"));
    }
    let mut notes = Notes::default();
    let mut steps: Vec<TimeStep> = Vec::new();
    let mut chosen: Option<f64> = None;
    let mut blocks = Vec::new();
    for base in &bases {
        let children = tree.children(base)?;
        let times = times::of_base(tree, &children)?;
        let mut step = None;
        if !times.is_empty() {
            let (index, found) = match chosen {
                // The bases of a file may have been written at different times.
                Some(t) => match times.iter().position(|x| *x == t) {
                    Some(i) => (i, Vec::new()),
                    None => {
                        let name = &base.name;
                        notes.warnings.push(format!("base `{name}` left out: it has no time {t}"));
                        continue;
                    }
                },
                None => time_axis::choose(path, &times, time, &mut notes.warnings)?,
            };
            chosen.get_or_insert(times[index]);
            // A single time is a note, not a series.
            if found.len() > 1 {
                steps = found;
            }
            step = Some(Step { index, count: times.len(), time: times[index] });
        }
        let zones = zones_of(tree, base, &children, step, &mut notes)?;
        for mut block in zones {
            if bases.len() > 1 {
                block.name = format!("{}/{}", base.name, block.name);
            }
            blocks.push(block);
        }
    }
    if time.is_some() && chosen.is_none() {
        OpenOptions { time, ..Default::default() }.refuse_time()?;
    }
    let mut warnings = notes.warnings;
    warnings.append(&mut notes.units);
    if notes.rind > 0 {
        warnings.push(format!("planes beyond the zones (Rind) left out, {} times", notes.rind));
    }
    let data = match blocks.len() {
        0 => return Err(Fault::field("the bases", "they have no zones")),
        1 => blocks.remove(0).data,
        _ => Dataset::MultiBlock(blocks),
    };
    let content = Content::Data(data);
    Ok(LoadedFile { format: FORMAT, content, warnings, time_steps: steps })
}

/// The zones of a base at a step, as blocks.
fn zones_of(
    tree: &Tree,
    base: &Node,
    children: &[Node],
    step: Option<Step>,
    notes: &mut Notes,
) -> Result<Vec<Block>, Fault> {
    let dims = base.integers()?;
    let [cell_axes, axes] = dims[..] else {
        return Err(base.fault(format!("{dims:?} instead of two numbers of axes")));
    };
    if !(1..=3).contains(&axes) || !(1..=axes).contains(&cell_axes) {
        return Err(base.fault(format!("cells of {cell_axes} axes in a space of {axes}")));
    }
    let units = Units::default().at(children)?;
    let shown = step.map(|s| s.zones(tree, children)).transpose()?.flatten();
    let mut blocks = Vec::new();
    for node in children.iter().filter(|n| n.label == "Zone_t") {
        if shown.as_ref().is_some_and(|s| !s.contains(&node.name)) {
            continue;
        }
        let zone = Zone::new(tree, node, cell_axes as usize, &units)?;
        let mut data = dataset(&zone, step, notes)?;
        let walls = boundary::wall_points(&zone, children, &mut notes.warnings)?;
        if let (Some(walls), Some(attributes)) = (walls, data.attributes_mut()) {
            attributes.field.push(walls);
        }
        if let (Some(step), Some(attributes)) = (step, data.attributes_mut()) {
            let time = Values::F64(vec![step.time]);
            attributes.field.push(DataArray::new("TimeValue", 1, time));
        }
        data.check()?;
        blocks.push(Block { name: node.name.clone(), data });
    }
    Ok(blocks)
}

/// A zone at a step.
fn dataset(zone: &Zone<'_>, step: Option<Step>, notes: &mut Notes) -> Result<Dataset, Fault> {
    let pointers = step.map(|s| s.pointers(zone.tree, &zone.children)).transpose()?;
    let pointers = pointers.unwrap_or_default();
    let points = zone.coordinates(&pointers, notes)?;
    let mut data = if zone.is_structured {
        let mut extent = [0; 6];
        for (axis, &n) in zone.points.iter().enumerate() {
            let many = |_| zone.node.fault(format!("{n} points along an axis are too many"));
            extent[2 * axis + 1] = i32::try_from(n - 1).map_err(many)?;
        }
        let attributes = Attributes::default();
        Dataset::StructuredGrid(StructuredGrid { extent, points, attributes })
    } else {
        Dataset::UnstructuredGrid(sections::grid(zone, points, &mut notes.warnings)?)
    };
    let arrays = solution::arrays(zone, &pointers, notes)?;
    if let Some(attributes) = data.attributes_mut() {
        *attributes = arrays;
    }
    Ok(data)
}
