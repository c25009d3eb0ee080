//! `DataItem`: values in the XML, in HDF5 or in binary files, and boxes of them.

use super::{FORMAT, child, fault, is, place};
use crate::model::{Endian, ScalarType, Values};
use crate::read::error::{Fault, read_bytes, sibling_path};
use crate::read::hdf5::Hdf5File;
use roxmltree::Node;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Reads items of one XDMF file. HDF5 files stay open: many items are in one.
pub(super) struct Items<'p> {
    path: &'p Path,
    open: RefCell<Vec<(PathBuf, Rc<Hdf5File>)>>,
}

/// The numbers in a text.
pub(super) fn numbers(node: Node<'_, '_>, text: &str) -> Result<Vec<u64>, Fault> {
    let words = text.split_whitespace().map(str::parse);
    let all: Result<Vec<u64>, _> = words.collect();
    all.map_err(|_| fault(node, format!("`{text}` are not whole numbers")))
}

impl<'p> Items<'p> {
    pub(super) fn new(path: &'p Path) -> Self {
        Items { path, open: RefCell::default() }
    }

    /// The values of an item.
    pub(super) fn values(&self, item: Node<'_, '_>) -> Result<Values, Fault> {
        let kind = item.attribute("ItemType").unwrap_or("Uniform").to_ascii_lowercase();
        if item.has_attribute("Reference") {
            return Err(refused(
                item,
                "a reference to another item",
                "write the item in its place",
            ));
        }
        match kind.as_str() {
            "uniform" => {}
            "hyperslab" => return self.hyper_slab(item),
            other => {
                let cure = "write the values themselves (ItemType Uniform or HyperSlab)";
                return Err(refused(item, &format!("ItemType `{other}`"), cure));
            }
        }
        let dims = dims(item)?;
        let text: String = item.children().filter_map(|n| n.text()).collect();
        let text = text.trim();
        match item.attribute("Format").unwrap_or("XML").to_ascii_lowercase().as_str() {
            "xml" => {
                let kind = scalar(item)?;
                let values = Values::from_words(kind, text.split_whitespace())
                    .map_err(|w| fault(item, format!("`{w}` is not a {}", kind.name())))?;
                expect(item, values, count(item, &dims)?)
            }
            "hdf" => {
                let (file, path) = hdf_name(item, text)?;
                let object = self.file(item, file)?;
                let inner = |f: Fault| in_file(item, file, f);
                let found = object.root().and_then(|r| r.get(path)).map_err(inner)?;
                expect(item, found.values().map_err(inner)?, count(item, &dims)?)
            }
            "binary" => {
                let file = sibling_path(self.path, text);
                let kind = scalar(item)?;
                let big = item.attribute("Endian").is_some_and(|e| e.eq_ignore_ascii_case("big"));
                let packed = item.attribute("Compression").unwrap_or("Raw");
                if !packed.eq_ignore_ascii_case("raw") {
                    let cure = "write it without compression, or as HDF";
                    return Err(refused(item, &format!("Compression `{packed}`"), cure));
                }
                let bytes = read_bytes(&file).map_err(|e| fault(item, e.to_string()))?;
                let seek = item.attribute("Seek").unwrap_or("0").trim().parse::<usize>();
                let seek = seek.map_err(|_| fault(item, "`Seek` is not a whole number"))?;
                let size = count(item, &dims)?.saturating_mul(kind.size() as u64);
                let end = usize::try_from(size).ok().and_then(|s| seek.checked_add(s));
                let Some(found) = end.and_then(|end| bytes.get(seek..end)) else {
                    let have = bytes.len();
                    let what = format!("{size} bytes from {seek} of {}, of {have}", file.display());
                    return Err(fault(item, what));
                };
                let endian = if big { Endian::Big } else { Endian::Little };
                Ok(Values::from_bytes(kind, found, endian))
            }
            other => {
                let cure = "write it as XML, HDF or Binary";
                Err(refused(item, &format!("Format `{other}`"), cure))
            }
        }
    }

    /// A box of another item: start, stride and count along each axis, then the item.
    fn hyper_slab(&self, item: Node<'_, '_>) -> Result<Values, Fault> {
        let parts: Vec<Node<'_, '_>> = item.children().filter(|n| is(*n, "DataItem")).collect();
        let [slab, source] = parts[..] else {
            return Err(fault(item, "a HyperSlab needs two items: the box and the values"));
        };
        let slab = self.values(slab)?;
        let rank = slab.len() / 3;
        let row =
            |n: usize| (0..rank).map(|a| slab.get_f64(n * rank + a) as u64).collect::<Vec<_>>();
        let (start, stride, count) = (row(0), row(1), row(2));
        let is_hdf = source.attribute("Format").is_some_and(|f| f.eq_ignore_ascii_case("HDF"));
        if !is_hdf || stride.iter().any(|&s| s != 1) {
            let what =
                format!("a HyperSlab with strides {stride:?} of {:?}", source.attribute("Format"));
            return Err(refused(item, &what, "use strides of 1 of an HDF item"));
        }
        let text = source.text().unwrap_or("").trim();
        let (file, path) = hdf_name(source, text)?;
        let object = self.file(source, file)?;
        let inner = |f: Fault| in_file(item, file, f);
        let found = object.root().and_then(|r| r.get(path)).map_err(inner)?;
        found.values_in(&start, &count).map_err(inner)
    }

    fn file(&self, item: Node<'_, '_>, name: &str) -> Result<Rc<Hdf5File>, Fault> {
        let path = sibling_path(self.path, name);
        if let Some((_, file)) = self.open.borrow().iter().find(|o| o.0 == path) {
            return Ok(file.clone());
        }
        let file = Hdf5File::open(&path, FORMAT).map_err(|e| fault(item, e.to_string()))?;
        let file = Rc::new(file);
        self.open.borrow_mut().push((path, file.clone()));
        Ok(file)
    }
}

fn refused(item: Node<'_, '_>, what: &str, cure: &str) -> Fault {
    Fault::unsupported(place(item), what, cure)
}

/// Adds the line of the item to a fault in its file.
fn in_file(item: Node<'_, '_>, file: &str, f: Fault) -> Fault {
    Fault { at: place(item), what: format!("{file}, {}: {}", f.at, f.what), ..f }
}

/// File and path of `file.h5:/path`.
fn hdf_name<'t>(item: Node<'_, '_>, text: &'t str) -> Result<(&'t str, &'t str), Fault> {
    text.rsplit_once(':')
        .filter(|(file, path)| !file.is_empty() && !path.is_empty())
        .ok_or_else(|| fault(item, format!("`{text}` is not `file.h5:/path`")))
}

fn dims(item: Node<'_, '_>) -> Result<Vec<u64>, Fault> {
    match item.attribute("Dimensions") {
        Some(text) => numbers(item, text),
        None => Err(fault(item, "it has no `Dimensions`")),
    }
}

fn count(item: Node<'_, '_>, dims: &[u64]) -> Result<u64, Fault> {
    let n = dims.iter().try_fold(1u64, |n, &d| n.checked_mul(d));
    n.ok_or_else(|| fault(item, format!("{dims:?} values")))
}

fn expect(item: Node<'_, '_>, values: Values, count: u64) -> Result<Values, Fault> {
    if values.len() as u64 == count {
        return Ok(values);
    }
    Err(fault(item, format!("{} values instead of the {count} of `Dimensions`", values.len())))
}

fn scalar(item: Node<'_, '_>) -> Result<ScalarType, Fault> {
    use ScalarType::*;
    let name = item.attribute("NumberType").or(item.attribute("DataType")).unwrap_or("Float");
    let precision = item.attribute("Precision").unwrap_or("4").trim();
    Ok(match (name.to_ascii_lowercase().as_str(), precision) {
        ("float", "4") => F32,
        ("float", "8") => F64,
        ("int", "1") | ("char", _) => I8,
        ("int", "2") | ("short", _) => I16,
        ("int", "4") => I32,
        ("int", "8") => I64,
        ("uint", "1") | ("uchar", _) => U8,
        ("uint", "2") | ("ushort", _) => U16,
        ("uint", "4") => U32,
        ("uint", "8") => U64,
        _ => {
            let cure = "write Float of 4 or 8 bytes, or Int or UInt of 1 to 8";
            return Err(refused(item, &format!("`{name}` of precision {precision}"), cure));
        }
    })
}

/// The values of the items of an element, in order.
pub(super) fn all(items: &Items<'_>, node: Node<'_, '_>) -> Result<Vec<Values>, Fault> {
    if child(node, "DataItem").is_none() {
        return Err(fault(node, "it has no `DataItem`"));
    }
    node.children().filter(|n| is(*n, "DataItem")).map(|n| items.values(n)).collect()
}
