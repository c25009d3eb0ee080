//! XDMF (`.xdmf`, `.xmf`): XML that describes grids whose values are in HDF5, in binary files or in
//! the XML itself.
//!
//! Uniform, rectilinear, curvilinear and unstructured grids; spatial collections as blocks,
//! temporal collections as times. Functions, subsets and references are refused by name.
//!
//! Source: "XDMF Model and Format" (xdmf.org), and what meshio 5.3 and VTK 9.7 write.

mod data_item;
mod geometry;
mod topology;

use super::error::{At, BROKEN, Fault, read_bytes};
use super::{Content, LoadedFile, OpenOptions, ReadError, TimeStep, time_axis};
use crate::model::{Attributes, Block, DataArray, Dataset};
use data_item::Items;
use roxmltree::Node;
use std::path::Path;

pub(crate) const FORMAT: &str = "XDMF";
/// Most collections in one another.
const MAX_NESTING: usize = 16;

/// Reads an XDMF file, or one of its times.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let bytes = read_bytes(path)?;
    let text = String::from_utf8_lossy(&bytes);
    from_text(path, &text, options.time).map_err(|f| f.in_file(path, FORMAT))
}

/// An element of this name, in any spelling.
pub(super) fn is(node: Node<'_, '_>, name: &str) -> bool {
    node.is_element() && node.tag_name().name().eq_ignore_ascii_case(name)
}

/// The first child of this name.
pub(super) fn child<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|n| is(*n, name))
}

/// A fault in an element.
pub(super) fn fault(node: Node<'_, '_>, what: impl Into<String>) -> Fault {
    Fault::new(place(node), what, BROKEN)
}

pub(super) fn place(node: Node<'_, '_>) -> At {
    At::Line(u64::from(node.document().text_pos_at(node.range().start).row))
}

fn from_text(path: &Path, text: &str, time: Option<f64>) -> Result<LoadedFile, Fault> {
    // VTK writes an empty document type.
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let tree = roxmltree::Document::parse_with_options(text, options).map_err(|e| {
        let what = format!("the XML cannot be parsed: {e}");
        Fault::new(At::Line(u64::from(e.pos().row)), what, BROKEN)
    })?;
    let root = tree.root_element();
    let Some(domain) = child(root, "Domain").filter(|_| is(root, "Xdmf")) else {
        return Err(fault(root, "no element `Xdmf` with a `Domain`"));
    };
    let mut file = File {
        path,
        items: Items::new(path),
        time,
        steps: Vec::new(),
        chosen: None,
        warnings: Vec::new(),
    };
    let mut grids: Vec<Node<'_, '_>> = domain.children().filter(|n| is(*n, "Grid")).collect();
    // Grids that others include are no data of their own.
    let included: Vec<&str> = tree
        .descendants()
        .filter(|n| is(*n, "include"))
        .filter_map(|n| n.attribute("xpointer"))
        .collect();
    let is_used = |n: &Node<'_, '_>| {
        n.attribute("Name").is_some_and(|name| {
            included.iter().any(|x| quoted(x) == Some(name)) && child(*n, "Attribute").is_none()
        })
    };
    if grids.len() > 1 && !grids.iter().all(is_used) {
        grids.retain(|g| !is_used(g) || is_collection(*g));
    }
    let mut blocks = Vec::new();
    for grid in grids {
        if let Some(data) = file.grid(grid, 0)? {
            let name = grid.attribute("Name").map_or_else(|| blocks.len().to_string(), Into::into);
            blocks.push(Block { name, data });
        }
    }
    if time.is_some() && file.steps.is_empty() {
        OpenOptions { time, ..Default::default() }.refuse_time()?;
    }
    let data = match blocks.len() {
        0 => return Err(fault(domain, "it has no grid")),
        1 => blocks.remove(0).data,
        _ => Dataset::MultiBlock(blocks),
    };
    data.check()?;
    let (content, warnings) = (Content::Data(data), file.warnings);
    Ok(LoadedFile { format: FORMAT, content, warnings, time_steps: file.steps })
}

/// The text between the quotes of an XPointer.
fn quoted(text: &str) -> Option<&str> {
    text.split(['"', '\'']).nth(1)
}

fn is_collection(grid: Node<'_, '_>) -> bool {
    let kind = grid.attribute("GridType").unwrap_or("Uniform");
    kind.eq_ignore_ascii_case("Collection") || kind.eq_ignore_ascii_case("Tree")
}

struct File<'p> {
    path: &'p Path,
    items: Items<'p>,
    time: Option<f64>,
    steps: Vec<TimeStep>,
    /// The number of the time, once a temporal collection gave the times.
    chosen: Option<usize>,
    warnings: Vec<String>,
}

impl File<'_> {
    /// The data of a grid; `None` for an empty collection.
    fn grid(&mut self, grid: Node<'_, '_>, depth: usize) -> Result<Option<Dataset>, Fault> {
        if depth > MAX_NESTING {
            return Err(fault(grid, format!("grids nest more than {MAX_NESTING} deep")));
        }
        let kind = grid.attribute("GridType").unwrap_or("Uniform");
        if kind.eq_ignore_ascii_case("Uniform") {
            return self.uniform(grid).map(Some);
        }
        if !is_collection(grid) {
            let cure = "write it as Uniform or Collection";
            return Err(Fault::unsupported(place(grid), format!("GridType `{kind}`"), cure));
        }
        let children: Vec<Node<'_, '_>> = grid.children().filter(|n| is(*n, "Grid")).collect();
        let is_temporal =
            grid.attribute("CollectionType").is_some_and(|t| t.eq_ignore_ascii_case("Temporal"));
        if is_temporal && !children.is_empty() {
            let times = self.times(grid, &children)?;
            let mut order: Vec<usize> = (0..times.len()).collect();
            order.sort_by(|a, b| times[*a].total_cmp(&times[*b]));
            let sorted: Vec<f64> = order.iter().map(|&i| times[i]).collect();
            let mut warnings = Vec::new();
            let (chosen, steps) = time_axis::choose(self.path, &sorted, self.time, &mut warnings)?;
            if self.chosen.is_none() {
                self.warnings.append(&mut warnings);
                self.steps = steps;
            }
            self.chosen = Some(chosen);
            return self.grid(children[order[chosen]], depth + 1);
        }
        let mut blocks = Vec::new();
        for c in children {
            if let Some(data) = self.grid(c, depth + 1)? {
                let name = c.attribute("Name").map_or_else(|| blocks.len().to_string(), Into::into);
                blocks.push(Block { name, data });
            }
        }
        Ok((!blocks.is_empty()).then_some(Dataset::MultiBlock(blocks)))
    }

    /// The times of the grids of a temporal collection.
    fn times(&self, grid: Node<'_, '_>, grids: &[Node<'_, '_>]) -> Result<Vec<f64>, Fault> {
        if let Some(time) = child(grid, "Time")
            && let Some(item) = child(time, "DataItem")
        {
            let values = self.items.values(item)?;
            let all: Vec<f64> = (0..values.len()).map(|i| values.get_f64(i)).collect();
            let kind = time.attribute("TimeType").or(time.attribute("Type")).unwrap_or("List");
            let times = match all[..] {
                [start, step, _] if kind.eq_ignore_ascii_case("HyperSlab") => {
                    (0..grids.len()).map(|i| start + step * i as f64).collect()
                }
                _ => all,
            };
            if times.len() != grids.len() {
                let what = format!("{} times of {} grids", times.len(), grids.len());
                return Err(fault(time, what));
            }
            return Ok(times);
        }
        let mut out = Vec::new();
        for (i, g) in grids.iter().enumerate() {
            let time = g.descendants().find(|n| is(*n, "Time"));
            out.push(match time.and_then(|t| t.attribute("Value")) {
                Some(text) => text
                    .trim()
                    .parse()
                    .map_err(|_| fault(*g, format!("the time `{text}` is not a number")))?,
                None => i as f64,
            });
        }
        Ok(out)
    }

    /// The child of a grid, its own or one that it includes.
    fn part<'a, 'b>(&self, grid: Node<'a, 'b>, name: &str) -> Result<Node<'a, 'b>, Fault> {
        if let Some(own) = child(grid, name) {
            return Ok(own);
        }
        for include in grid.children().filter(|n| is(*n, "include")) {
            let Some(pointer) = include.attribute("xpointer") else { continue };
            let mut all = grid.document().root_element().descendants();
            let named = all.find(|n| is(*n, "Grid") && n.attribute("Name") == quoted(pointer));
            // `/Grid[1]` is the first grid of a collection.
            let target = named.map(|n| match pointer.contains("/Grid[1]") {
                true => child(n, "Grid").unwrap_or(n),
                false => n,
            });
            let Some(target) = target else {
                let cure = "write the topology and geometry into each grid";
                return Err(Fault::unsupported(place(include), format!("`{pointer}`"), cure));
            };
            if pointer.contains(name)
                && let Some(found) = child(target, name)
            {
                return Ok(found);
            }
        }
        Err(fault(grid, format!("the grid has no `{name}`")))
    }

    fn uniform(&mut self, grid: Node<'_, '_>) -> Result<Dataset, Fault> {
        let topology = self.part(grid, "Topology")?;
        let geometry = self.part(grid, "Geometry")?;
        let mut data = match topology::lattice(topology)? {
            Some((dims, kind)) => geometry::lattice(&self.items, geometry, dims, kind)?,
            None => {
                let points = geometry::points(&self.items, geometry)?;
                topology::cells(&self.items, topology, points, &mut self.warnings)?
            }
        };
        let (points, cells) = data.counts();
        let mut out = Attributes::default();
        let own = grid.children().filter(|n| is(*n, "Attribute"));
        for (i, a) in own.enumerate() {
            let name = a.attribute("Name").map_or_else(|| format!("attribute {i}"), Into::into);
            let center = a.attribute("Center").unwrap_or("Node").to_ascii_lowercase();
            let (list, count) = match center.as_str() {
                "node" => (&mut out.point, points),
                "cell" => (&mut out.cell, cells),
                "grid" => (&mut out.field, 1),
                other => {
                    self.warnings
                        .push(format!("attribute `{name}` left out: its center is {other}"));
                    continue;
                }
            };
            let Some(item) = child(a, "DataItem") else {
                return Err(fault(a, format!("attribute `{name}` has no `DataItem`")));
            };
            let values = self.items.values(item)?;
            let components = (values.len() as u64).checked_div(count).unwrap_or(1).max(1);
            if components.checked_mul(count) != Some(values.len() as u64) {
                let what = format!("attribute `{name}` has {} values for {count}", values.len());
                return Err(fault(a, what));
            }
            list.push(DataArray::new(name, components as usize, values));
        }
        if let [only] = &out.point[..]
            && only.components == 1
        {
            out.point_scalars = Some(only.name.clone());
        }
        if let Some(attributes) = data.attributes_mut() {
            *attributes = out;
        }
        data.check()?;
        Ok(data)
    }
}
