//! Groups: names and what they lead to, in all three forms.

use super::fractal_heap::FractalHeap;
use super::header::{Message, kind};
use super::source::{Source, unknown_version};
use super::{btree_v1, btree_v2};
use crate::read::error::{At, BROKEN, Fault};

/// A name in a group.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    pub(super) name: String,
    pub(super) target: Target,
    /// When it was made, if the file says so.
    order: Option<u64>,
}

/// Where a link leads.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Target {
    /// The address of an object.
    Hard(u64),
    /// A path in this file.
    Soft(String),
    /// An object of another file, or something else that is not read; in words.
    Elsewhere(String),
}

/// The links of a group, in the order in which they were made if the file says so, or else by name.
pub(super) fn links(source: &Source, messages: &[Message]) -> Result<Vec<Link>, Fault> {
    let mut out = Vec::new();
    for m in messages {
        let mut f = source.fields(&m.data, m.address);
        match m.kind {
            kind::SYMBOL_TABLE => {
                let (tree, heap) = (f.defined("a group")?, f.defined("a local heap")?);
                symbol_table(source, tree, heap, &mut out)?;
            }
            kind::LINK => out.push(link(source, &m.data, m.address)?),
            kind::LINK_INFO => {
                f.version(0, "a group")?;
                let flags = f.u8()?;
                f.skip(if flags & 1 != 0 { 8 } else { 0 })?;
                let (heap, tree) = (f.address()?, f.address()?);
                if let (Some(heap), Some(tree)) = (heap, tree) {
                    let heap = FractalHeap::open(source, heap)?;
                    btree_v2::records(source, tree, &[5], &mut |record, _| {
                        let id = record.get(4..).unwrap_or(&[]);
                        out.push(link(source, &heap.object(id)?, tree)?);
                        Ok(())
                    })?;
                }
            }
            _ => {}
        }
    }
    if out.iter().all(|l| l.order.is_some()) {
        out.sort_by_key(|l| l.order);
    } else {
        out.sort_by(|a, b| a.name.cmp(&b.name));
    }
    Ok(out)
}

/// Decodes a link message.
fn link(source: &Source, data: &[u8], address: u64) -> Result<Link, Fault> {
    let mut f = source.fields(data, address);
    f.version(1, "a link")?;
    let flags = f.u8()?;
    let kind = if flags & 8 != 0 { f.u8()? } else { 0 };
    let order = if flags & 4 != 0 { Some(f.uint(8)?) } else { None };
    f.skip(usize::from(flags & 16 != 0))?;
    let length = usize::try_from(f.uint(1 << (flags & 3))?).unwrap_or(usize::MAX);
    let name = String::from_utf8_lossy(f.take(length)?).into_owned();
    let target = match kind {
        0 => Target::Hard(f.defined("a link")?),
        1 => {
            let length = usize::from(f.u16()?);
            Target::Soft(String::from_utf8_lossy(f.take(length)?).into_owned())
        }
        64 => {
            let length = usize::from(f.u16()?);
            let words = f.take(length)?.get(1..).unwrap_or(&[]);
            let mut words = words.split(|&b| b == 0).map(String::from_utf8_lossy);
            let file = words.next().unwrap_or_default();
            let path = words.next().unwrap_or_default();
            Target::Elsewhere(format!("`{path}` of the file {file}"))
        }
        n => Target::Elsewhere(format!("a link of type {n}")),
    };
    Ok(Link { name, target, order })
}

/// The links of an old group.
fn symbol_table(source: &Source, tree: u64, heap: u64, out: &mut Vec<Link>) -> Result<(), Fault> {
    let size = 8 + 2 * source.length_size as u64 + source.offset_size as u64;
    let head = source.bytes(heap, size, "a local heap")?;
    let mut f = source.fields(&head, heap);
    f.signature(b"HEAP")?;
    f.version(0, "a local heap")?;
    f.skip(3)?;
    let length = f.length()?;
    f.skip(source.length_size)?;
    let names_at = f.defined("a local heap")?;
    let names = source.bytes(names_at, length, "a local heap")?;
    let text = |offset: u64| {
        let start = usize::try_from(offset).ok().filter(|s| *s < names.len());
        let Some(rest) = start.map(|s| &names[s..]) else {
            let what = format!("a name at {offset} of a heap of {length} bytes");
            return Err(Fault::new(At::Byte(names_at), what, BROKEN));
        };
        let end = rest.iter().position(|&b| b == 0).unwrap_or(rest.len());
        Ok(String::from_utf8_lossy(&rest[..end]).into_owned())
    };
    btree_v1::visit(source, tree, 0, source.length_size, &mut |_, node| {
        let head = source.bytes(node, 8, "a node of a group")?;
        let mut f = source.fields(&head, node);
        f.signature(b"SNOD")?;
        let at = f.at();
        match f.u8()? {
            1 => {}
            v => return Err(unknown_version(at, v, "a node of a group")),
        }
        f.skip(1)?;
        let count = u64::from(f.u16()?);
        let each = 24 + 2 * source.offset_size as u64;
        let start = node.saturating_add(8);
        let body = source.bytes(start, count * each, "a node of a group")?;
        let mut f = source.fields(&body, start);
        for _ in 0..count {
            let name = text(f.uint(source.offset_size)?)?;
            let address = f.address()?;
            let cached = f.u32()?;
            f.skip(4)?;
            let soft = u64::from(f.u32()?);
            f.skip(12)?;
            let target = match (cached, address) {
                (2, _) => Target::Soft(text(soft)?),
                (_, Some(address)) => Target::Hard(address),
                (_, None) => return Err(Fault::new(at.clone(), "a link without a target", BROKEN)),
            };
            out.push(Link { name, target, order: None });
        }
        Ok(())
    })
}
