//! HDF5: the subset that scientific files use. VTKHDF, NetCDF-4, XDMF, Exodus II and CGNS build on
//! it.
//!
//! Superblocks 0 to 3; groups and object headers, old and new; compact, contiguous and chunked
//! datasets with every kind of chunk index; deflate, shuffle and fletcher32; integers, floats and
//! texts of both byte orders. Whatever else there is (szip, other files, virtual datasets, ...) is
//! refused by name. Only what is asked for is read.
//!
//! Source: "HDF5 File Format Specification Version 3.0" (The HDF Group).

mod btree_v1;
mod btree_v2;
mod chunk_index;
mod dataset;
mod datatype;
mod filters;
mod fractal_heap;
mod global_heap;
mod group;
mod header;
mod source;

pub(crate) use datatype::Data;
#[cfg(test)]
mod tests;

use crate::model::Values;
use crate::read::ReadError;
use crate::read::error::{At, BROKEN, Fault, io_error};
use dataset::Stored;
use datatype::{Dataspace, Datatype};
use fractal_heap::FractalHeap;
use group::Target;
use header::{Message, kind};
use source::{Source, unknown_version};
use std::path::Path;

pub(crate) const FORMAT: &str = "HDF5";
/// The first bytes of a file.
pub(crate) const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Most links that lead to links.
const MAX_SOFT_LINKS: usize = 16;

/// An open file.
#[derive(Debug)]
pub(crate) struct Hdf5File {
    source: Source,
    root: u64,
}

/// A group or dataset.
#[derive(Debug)]
pub(crate) struct Object<'f> {
    file: &'f Hdf5File,
    /// Its path, for messages.
    pub(crate) path: String,
    /// Where its header is, which references name.
    pub(crate) address: u64,
    messages: Vec<Message>,
}

/// A named value of an object.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Attribute {
    pub(crate) name: String,
    pub(crate) data: Data,
}

impl Hdf5File {
    pub(crate) fn open(path: &Path, format: &'static str) -> Result<Self, ReadError> {
        let file = std::fs::File::open(path).map_err(|e| io_error(path, e))?;
        let len = file.metadata().map_err(|e| io_error(path, e))?.len();
        Self::from_source(Source::new(file, len)).map_err(|f| f.in_file(path, format))
    }

    fn from_source(mut source: Source) -> Result<Self, Fault> {
        // A block of the user's may come first: 512, 1024, 2048 ... bytes.
        let mut at = 0;
        while source.at_most(at, 8, "the superblock")? != MAGIC {
            at = if at == 0 { 512 } else { at * 2 };
            if at + 8 > source.len() {
                let what = "no signature of an HDF5 file";
                return Err(Fault::new(At::Byte(0), what, BROKEN));
            }
        }
        let head = source.at_most(at, 128, "the superblock")?;
        let mut f = source.fields(&head, at);
        f.skip(8)?;
        let version_at = f.at();
        let version = f.u8()?;
        match version {
            0 | 1 => f.skip(4)?,
            2 | 3 => {}
            v => return Err(unknown_version(version_at, v, "the superblock")),
        }
        let sizes = [usize::from(f.u8()?), usize::from(f.u8()?)];
        if sizes.iter().any(|s| ![2, 4, 8].contains(s)) {
            return Err(Fault::new(f.at(), format!("addresses of {sizes:?} bytes"), BROKEN));
        }
        let skipped = f.pos;
        [source.offset_size, source.length_size] = sizes;
        let mut f = source.fields(&head, at);
        f.skip(skipped + 1)?;
        let root;
        let base;
        if version < 2 {
            f.skip(if version == 1 { 12 } else { 8 })?;
            base = f.defined("the file")?;
            f.skip(4 * source.offset_size)?;
            root = f.defined("the root group")?;
        } else {
            base = f.defined("the file")?;
            f.skip(2 * source.offset_size)?;
            root = f.defined("the root group")?;
            let end = f.pos + 4;
            let whole = head.get(..end).unwrap_or(&head);
            source::verify(whole, at)?;
        }
        // Some programs put a block before the file and leave the base address 0.
        source.base = if base == 0 { at } else { base };
        Ok(Hdf5File { source, root })
    }

    pub(crate) fn root(&self) -> Result<Object<'_>, Fault> {
        self.at(self.root, "/".into())
    }

    /// The object at an address.
    pub(crate) fn at(&self, address: u64, path: String) -> Result<Object<'_>, Fault> {
        let messages = header::messages(&self.source, address).map_err(|f| at_object(f, &path))?;
        Ok(Object { file: self, path, address, messages })
    }
}

/// Adds the object to the place of a fault.
fn at_object(fault: Fault, path: &str) -> Fault {
    let at = match fault.at {
        At::Field(field) if field.starts_with('`') => At::Field(field),
        other => At::Field(format!("`{path}` {other}")),
    };
    Fault { at, ..fault }
}

impl<'f> Object<'f> {
    fn fault(&self, f: Fault) -> Fault {
        at_object(f, &self.path)
    }

    /// Whether it has values.
    pub(crate) fn is_dataset(&self) -> bool {
        self.messages.iter().any(|m| m.kind == kind::LAYOUT)
    }

    /// Names of the links of a group.
    pub(crate) fn names(&self) -> Result<Vec<String>, Fault> {
        let links = group::links(&self.file.source, &self.messages).map_err(|f| self.fault(f))?;
        Ok(links.into_iter().map(|l| l.name).collect())
    }

    /// All objects of a group. Links that lead to nothing or elsewhere are named in `left_out`.
    pub(crate) fn children(
        &self,
        left_out: &mut Vec<String>,
    ) -> Result<Vec<(String, Object<'f>)>, Fault> {
        let mut out = Vec::new();
        for link in group::links(&self.file.source, &self.messages).map_err(|f| self.fault(f))? {
            match self.follow(&link, 0)? {
                Some(object) => out.push((link.name, object)),
                None => left_out.push(format!("{}/{}", self.path, link.name)),
            }
        }
        Ok(out)
    }

    /// The object that a path leads to, from here.
    pub(crate) fn find(&self, path: &str) -> Result<Option<Object<'f>>, Fault> {
        self.find_at(path, 0)
    }

    /// As [`Self::find`]; a fault with a cure if it does not exist.
    pub(crate) fn get(&self, path: &str) -> Result<Object<'f>, Fault> {
        self.find(path)?.ok_or_else(|| {
            let names = self.names().unwrap_or_default();
            let shown: Vec<String> = names.iter().take(12).map(|n| format!("`{n}`")).collect();
            let what = format!("it has no `{path}`, but {}", shown.join(", "));
            self.fault(Fault::new(At::Field("(its names)".into()), what, BROKEN))
        })
    }

    fn find_at(&self, path: &str, depth: usize) -> Result<Option<Object<'f>>, Fault> {
        let mut at = match path.strip_prefix('/') {
            Some(_) => self.file.root()?,
            None => self.file.at(self.address, self.path.clone())?,
        };
        for name in path.split('/').filter(|n| !n.is_empty() && *n != ".") {
            let links = group::links(&self.file.source, &at.messages).map_err(|f| at.fault(f))?;
            let Some(link) = links.into_iter().find(|l| l.name == name) else { return Ok(None) };
            if let Target::Elsewhere(what) = &link.target {
                let cure = "copy the object into the file (h5copy), or open the other file";
                let at = At::Field(format!("`{}/{name}`", at.path.trim_end_matches('/')));
                return Err(Fault::unsupported(at, format!("it leads to {what}"), cure));
            }
            let Some(next) = at.follow(&link, depth)? else { return Ok(None) };
            at = next;
        }
        Ok(Some(at))
    }

    fn follow(&self, link: &group::Link, depth: usize) -> Result<Option<Object<'f>>, Fault> {
        let path = format!("{}/{}", self.path.trim_end_matches('/'), link.name);
        match &link.target {
            Target::Hard(address) => self.file.at(*address, path).map(Some),
            Target::Soft(to) if depth < MAX_SOFT_LINKS => self.find_at(to, depth + 1),
            Target::Soft(_) => {
                let what = format!("more than {MAX_SOFT_LINKS} links that lead to each other");
                Err(Fault::field(format!("`{path}`"), what))
            }
            Target::Elsewhere(_) => Ok(None),
        }
    }

    /// All attributes.
    pub(crate) fn attributes(&self) -> Result<Vec<Attribute>, Fault> {
        let source = &self.file.source;
        let mut out = Vec::new();
        for m in &self.messages {
            if m.kind == kind::ATTRIBUTE {
                out.push(attribute(source, m).map_err(|f| self.fault(f))?);
            } else if m.kind == kind::ATTRIBUTE_INFO {
                let mut f = source.fields(&m.data, m.address);
                f.version(0, "attributes")?;
                let flags = f.u8()?;
                f.skip(if flags & 1 != 0 { 2 } else { 0 })?;
                let (heap, tree) = (f.address()?, f.address()?);
                let (Some(heap), Some(tree)) = (heap, tree) else { continue };
                let heap = FractalHeap::open(source, heap).map_err(|f| self.fault(f))?;
                let found = btree_v2::records(source, tree, &[8], &mut |record, _| {
                    let data = heap.object(record.get(..8).unwrap_or(record))?;
                    let m = Message { kind: kind::ATTRIBUTE, data, address: tree };
                    out.push(attribute(source, &m)?);
                    Ok(())
                });
                found.map_err(|f| self.fault(f))?;
            }
        }
        Ok(out)
    }

    /// The attribute with this name.
    pub(crate) fn attribute(&self, name: &str) -> Result<Option<Data>, Fault> {
        Ok(self.attributes()?.into_iter().find(|a| a.name == name).map(|a| a.data))
    }

    /// The numbers of an attribute.
    pub(crate) fn numbers(&self, name: &str) -> Result<Option<Vec<f64>>, Fault> {
        match self.attribute(name)? {
            None => Ok(None),
            Some(Data::Numbers(v)) => Ok(Some((0..v.len()).map(|i| v.get_f64(i)).collect())),
            Some(_) => {
                let at = At::Field(format!("`{}`, attribute `{name}`", self.path));
                Err(Fault::new(at, "it is no number", BROKEN))
            }
        }
    }

    /// The text of an attribute; several are joined by spaces.
    pub(crate) fn text(&self, name: &str) -> Result<Option<String>, Fault> {
        Ok(match self.attribute(name)? {
            Some(Data::Texts(t)) => Some(t.join(" ")),
            // CGNS and others write texts as characters.
            Some(Data::Numbers(Values::I8(v))) => Some(from_characters(v.iter().map(|&b| b as u8))),
            Some(Data::Numbers(Values::U8(v))) => Some(from_characters(v.iter().copied())),
            _ => None,
        })
    }

    fn stored(&self) -> Result<Stored<'f>, Fault> {
        let stored = Stored::new(&self.file.source, &self.messages).map_err(|f| self.fault(f))?;
        stored.ok_or_else(|| self.fault(Fault::field("its header", "it is not a dataset")))
    }

    /// Lengths of the axes of a dataset.
    pub(crate) fn shape(&self) -> Result<Vec<u64>, Fault> {
        Ok(self.stored()?.space.dims)
    }

    /// Whether the values of a dataset are numbers.
    pub(crate) fn is_number(&self) -> Result<bool, Fault> {
        Ok(matches!(self.stored()?.datatype.kind, datatype::Kind::Number(..)))
    }

    /// Whether the first axis of a dataset can grow.
    pub(crate) fn can_grow(&self) -> Result<bool, Fault> {
        Ok(self.stored()?.space.max.first().is_some_and(Option::is_none))
    }

    /// All values of a dataset.
    pub(crate) fn read(&self) -> Result<Data, Fault> {
        let dims = self.shape()?;
        self.read_box(&vec![0; dims.len()], &dims)
    }

    /// The values of a box of a dataset.
    pub(crate) fn read_box(&self, start: &[u64], count: &[u64]) -> Result<Data, Fault> {
        let stored = self.stored()?;
        let read = || {
            let bytes = stored.bytes(start, count)?;
            stored.datatype.decode(&self.file.source, &bytes)
        };
        read().map_err(|f| self.fault(f))
    }

    /// The numbers of a box of a dataset.
    pub(crate) fn values_in(&self, start: &[u64], count: &[u64]) -> Result<Values, Fault> {
        self.numbers_of(self.read_box(start, count)?)
    }

    /// All numbers of a dataset.
    pub(crate) fn values(&self) -> Result<Values, Fault> {
        self.numbers_of(self.read()?)
    }

    fn numbers_of(&self, data: Data) -> Result<Values, Fault> {
        let found = match data {
            Data::Numbers(v) => return Ok(v),
            Data::Texts(_) => "texts".into(),
            Data::References(_) => "references".into(),
            Data::Other(name) => name,
        };
        let cure = "write it as integers or floats of 8 to 64 bits";
        let at = At::Field(format!("`{}`", self.path));
        Err(Fault::unsupported(at, format!("it holds {found}, not numbers"), cure))
    }
}

/// Text of single characters, until a zero.
pub(crate) fn from_characters(bytes: impl Iterator<Item = u8>) -> String {
    let bytes: Vec<u8> = bytes.take_while(|&b| b != 0).collect();
    String::from_utf8_lossy(&bytes).trim_end().to_string()
}

/// Decodes an attribute message.
fn attribute(source: &Source, message: &Message) -> Result<Attribute, Fault> {
    let mut f = source.fields(&message.data, message.address);
    let at = f.at();
    let version = f.u8()?;
    let flags = f.u8()?;
    if !(1..=3).contains(&version) {
        return Err(unknown_version(at, version, "an attribute"));
    }
    let sizes = [usize::from(f.u16()?), usize::from(f.u16()?), usize::from(f.u16()?)];
    f.skip(usize::from(version == 3))?;
    let padded = |n: usize| if version == 1 { n.next_multiple_of(8) } else { n };
    let name = f.take(padded(sizes[0]))?;
    let name: Vec<u8> = name.iter().copied().take_while(|&b| b != 0).collect();
    let name = String::from_utf8_lossy(&name).into_owned();
    let mut part = |size: usize, kind: u16, is_shared: bool| -> Result<Message, Fault> {
        let data = f.take(padded(size))?.to_vec();
        let m = Message { kind, data, address: message.address };
        if is_shared && version > 1 { header::shared(source, &m) } else { Ok(m) }
    };
    let datatype = part(sizes[1], kind::DATATYPE, flags & 1 != 0)?;
    let space = part(sizes[2], kind::DATASPACE, flags & 2 != 0)?;
    let datatype = Datatype::parse(source, &datatype.data, datatype.address)?;
    let space = Dataspace::parse(source, &space.data, space.address)?;
    let bytes = space.count().and_then(|n| n.checked_mul(datatype.size as u64));
    let bytes = f.take(bytes.and_then(|b| usize::try_from(b).ok()).unwrap_or(usize::MAX))?;
    Ok(Attribute { name, data: datatype.decode(source, bytes)? })
}
