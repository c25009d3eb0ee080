//! B-trees of version 1: the index of old groups and of chunks.

use super::source::Source;
use crate::read::error::{At, BROKEN, Fault};

/// What is called with a key and its child.
pub(super) type Leaf<'a> = dyn FnMut(&[u8], u64) -> Result<(), Fault> + 'a;

/// Calls `leaf` with the key and the child of every entry of the leaves, in order. A key has
/// `key_size` bytes.
pub(super) fn visit(
    source: &Source,
    root: u64,
    kind: u8,
    key_size: usize,
    leaf: &mut Leaf<'_>,
) -> Result<(), Fault> {
    visit_level(source, root, kind, key_size, None, leaf)
}

fn visit_level(
    source: &Source,
    address: u64,
    kind: u8,
    key_size: usize,
    expected: Option<u8>,
    leaf: &mut Leaf<'_>,
) -> Result<(), Fault> {
    let head = source.bytes(address, 8 + 2 * source.offset_size as u64, "a B-tree node")?;
    let mut f = source.fields(&head, address);
    f.signature(b"TREE")?;
    let (found, level, entries) = (f.u8()?, f.u8()?, f.u16()?);
    // Levels fall to 0, so this ends, however the nodes name each other.
    if found != kind || expected.is_some_and(|e| e != level) || level > 64 {
        let what = format!("a B-tree node of type {found} and level {level}");
        return Err(Fault::new(At::Byte(address), what, BROKEN));
    }
    let start = address.saturating_add(head.len() as u64);
    let each = key_size + source.offset_size;
    let body = source.bytes(start, u64::from(entries) * each as u64, "a B-tree node")?;
    let mut f = source.fields(&body, start);
    for _ in 0..entries {
        let key = f.take(key_size)?;
        let child = f.defined("a child of a B-tree")?;
        match level.checked_sub(1) {
            None => leaf(key, child)?,
            below => visit_level(source, child, kind, key_size, below, leaf)?,
        }
    }
    Ok(())
}
