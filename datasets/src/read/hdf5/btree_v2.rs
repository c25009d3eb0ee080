//! B-trees of version 2: the index of new groups, of many attributes, and of chunks along several
//! axes without limits.

use super::source::{Source, bytes_for, verify};
use crate::read::error::{At, BROKEN, Fault};

/// Sizes of one level of the tree.
struct Level {
    /// Bytes of the sum of all records below a child.
    sum_size: usize,
    /// Most records of a node and all nodes below.
    sum: u64,
}

struct Tree<'s> {
    source: &'s Source,
    kind: u8,
    node_size: u64,
    record_size: usize,
    /// Bytes of the number of records of a child.
    count_size: usize,
    levels: Vec<Level>,
}

/// What is called with a record and its type.
pub(super) type Visit<'a> = dyn FnMut(&[u8], u8) -> Result<(), Fault> + 'a;

/// Calls `visit` with every record of the tree at `address`, in order. `kinds` are the types of
/// records that are expected. The second argument is the type.
pub(super) fn records(
    source: &Source,
    address: u64,
    kinds: &[u8],
    visit: &mut Visit<'_>,
) -> Result<(), Fault> {
    let size = 22 + source.offset_size as u64 + source.length_size as u64;
    let head = source.bytes(address, size, "a B-tree")?;
    verify(&head, address)?;
    let mut f = source.fields(&head, address);
    f.signature(b"BTHD")?;
    f.version(0, "a B-tree")?;
    let kind = f.u8()?;
    let node_size = u64::from(f.u32()?);
    let record_size = usize::from(f.u16()?);
    let depth = f.u16()?;
    f.skip(2)?;
    let root = f.address()?;
    let count = u64::from(f.u16()?);
    if !kinds.contains(&kind)
        || record_size == 0
        || node_size < 10 + record_size as u64
        || depth > 32
    {
        let what = format!("a B-tree of type {kind}, depth {depth} and {record_size}-byte records");
        return Err(Fault::new(At::Byte(address), what, BROKEN));
    }
    let Some(root) = root else { return Ok(()) };
    let leaf = (node_size - 10) / record_size as u64;
    let mut tree = Tree {
        source,
        kind,
        node_size,
        record_size,
        count_size: bytes_for(leaf),
        levels: vec![Level { sum_size: 0, sum: leaf }],
    };
    for _ in 0..depth {
        let below = &tree.levels[tree.levels.len() - 1];
        let pointer = (source.offset_size + tree.count_size + below.sum_size) as u64;
        let most = node_size.saturating_sub(10 + pointer) / (record_size as u64 + pointer);
        let sum = (most + 1).saturating_mul(below.sum).saturating_add(most);
        tree.levels.push(Level { sum_size: bytes_for(sum), sum });
    }
    tree.node(root, count, usize::from(depth), visit)
}

impl Tree<'_> {
    fn node(
        &self,
        address: u64,
        count: u64,
        depth: usize,
        visit: &mut Visit<'_>,
    ) -> Result<(), Fault> {
        let pointer = match depth.checked_sub(1) {
            None => 0,
            Some(below) => self.source.offset_size + self.count_size + self.levels[below].sum_size,
        };
        let body = count.saturating_mul(self.record_size as u64);
        let pointers =
            if depth > 0 { count.saturating_add(1).saturating_mul(pointer as u64) } else { 0 };
        let size = body.saturating_add(pointers).saturating_add(10);
        if size > self.node_size {
            let what = format!("{count} records in a B-tree node of {} bytes", self.node_size);
            return Err(Fault::new(At::Byte(address), what, BROKEN));
        }
        let block = self.source.bytes(address, size, "a B-tree node")?;
        verify(&block, address)?;
        let mut f = self.source.fields(&block, address);
        f.signature(if depth == 0 { b"BTLF" } else { b"BTIN" })?;
        f.version(0, "a B-tree node")?;
        if f.u8()? != self.kind {
            return Err(Fault::new(At::Byte(address), "a B-tree node of another type", BROKEN));
        }
        let records = f.take(body as usize)?;
        let mut records = records.chunks_exact(self.record_size);
        if depth > 0 {
            for i in 0..=count {
                let child = f.defined("a child of a B-tree")?;
                let in_child = f.uint(self.count_size)?;
                f.skip(self.levels[depth - 1].sum_size)?;
                self.node(child, in_child, depth - 1, visit)?;
                if i < count
                    && let Some(record) = records.next()
                {
                    visit(record, self.kind)?;
                }
            }
            return Ok(());
        }
        records.try_for_each(|record| visit(record, self.kind))
    }
}
