//! The collated format of decomposed cases: `processorsN` or `processorsN_a-b` holds one file for
//! all of its parts, a list of blocks of bytes. The first block begins with the header of an
//! ordinary file, which holds for the others too.
//!
//! Source: OpenFOAM v1712 release notes, "Parallel I/O: collated", and what OpenFOAM 1912 writes.

use super::text::{FoamFile, exists};
use crate::read::ReadError;
use crate::read::error::{At, Fault};
use std::cell::RefCell;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// The class of such a file.
const CLASS: &str = "decomposedBlockData";
/// More than the header of a file takes with its banner.
const HEADER_BYTES: usize = 8192;

/// A file with the places of its blocks.
pub(super) struct Blocks {
    file: FoamFile,
    ranges: Vec<Range<usize>>,
}

/// Opens a file, up to `limit` bytes, at its first block if it is collated: the header there says
/// what the file holds.
pub(super) fn open_first(path: &Path, limit: u64) -> Result<FoamFile, ReadError> {
    let mut file = FoamFile::open(path, Some(limit))?;
    if file.class == CLASS {
        file.enter_bytes().and_then(|_| file.header()).map_err(|f| file.fault(f))?;
    }
    Ok(file)
}

impl Blocks {
    /// Reads a file and finds its blocks.
    fn open(path: &Path) -> Result<Blocks, ReadError> {
        let mut file = FoamFile::open(path, None)?;
        if file.class != CLASS {
            let what = format!("it is a {}, in a folder of the collated format", file.class);
            let cure = "decompose the case again, with `-fileHandler collated`";
            return Err(file.fault(Fault::new(file.at(), what, cure)));
        }
        let mut ranges = Vec::new();
        while file.peek().is_some() {
            ranges.push(file.skip_bytes().map_err(|f| file.fault(f))?);
        }
        Ok(Blocks { file, ranges })
    }

    /// A block as a file of its own, with the header of the first block.
    pub(super) fn part(&self, block: usize) -> Result<FoamFile, ReadError> {
        let Some(range) = self.ranges.get(block) else {
            let what = format!("block {block} of {}", self.ranges.len());
            let cure = "the file has fewer parts than its folder says: copy or write it again";
            return Err(self.file.fault(Fault::new(At::Field("the blocks".into()), what, cure)));
        };
        let mut out = self.bytes_of(block, range.clone());
        if block == 0 || out.begins_with_header() {
            out.header().map_err(|f| out.fault(f))?;
            return Ok(out);
        }
        let Range { start, end } = self.ranges[0];
        let mut first = self.bytes_of(0, start..end.min(start + HEADER_BYTES));
        first.header().map_err(|f| first.fault(f))?;
        Ok(out.with_header_of(&first))
    }

    fn bytes_of(&self, block: usize, range: Range<usize>) -> FoamFile {
        let bytes = self.file.bytes_at(range).to_vec();
        FoamFile::of_bytes(&self.file.path, Some(block), bytes)
    }
}

/// Files that are kept until others are read: a mesh has five, and each part needs all of them.
const MOST_KEPT: usize = 5;

/// Files by their paths, the last used at the end.
#[derive(Default)]
pub(super) struct BlockCache {
    files: RefCell<Vec<(PathBuf, Rc<Blocks>)>>,
}

impl BlockCache {
    /// The file of a path with its blocks.
    pub(super) fn open(&self, path: &Path) -> Result<Rc<Blocks>, ReadError> {
        let mut files = self.files.borrow_mut();
        let found = match files.iter().position(|f| f.0 == path) {
            Some(i) => files.remove(i).1,
            None => Rc::new(Blocks::open(path)?),
        };
        files.push((path.to_path_buf(), found.clone()));
        if files.len() > MOST_KEPT {
            files.remove(0);
        }
        Ok(found)
    }
}

/// A folder of parts: how many it holds of how many, and the number of the first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Group {
    pub(super) name: String,
    of: usize,
    pub(super) parts: Range<usize>,
}

impl Group {
    /// What the name of a folder says: `processors4`, or `processors4_0-1`.
    fn named(name: &str) -> Option<Group> {
        let rest = name.strip_prefix("processors")?;
        let (of, parts) = match rest.split_once('_') {
            None => (rest.parse().ok()?, None),
            Some((of, range)) => (of.parse().ok()?, Some(range.split_once('-')?)),
        };
        let parts = match parts {
            None => 0..of,
            Some((first, last)) => {
                first.parse().ok()?..last.parse::<usize>().ok()?.checked_add(1)?
            }
        };
        (!parts.is_empty() && parts.end <= of).then(|| Group { name: name.to_string(), of, parts })
    }

    /// The folders among these names that together hold all parts, in their order. Of several
    /// decompositions, the one whose mesh is there; `None` without one.
    pub(super) fn all(root: &Path, names: &[String]) -> Option<Vec<Group>> {
        let mut groups: Vec<Group> = names.iter().filter_map(|n| Group::named(n)).collect();
        groups.retain(|g| exists(&root.join(&g.name).join("constant/polyMesh/owner")));
        groups.sort_by_key(|g| (g.of, g.parts.start, g.parts.end));
        for of in groups.iter().map(|g| g.of).collect::<Vec<_>>() {
            let mut chain: Vec<Group> = Vec::new();
            for g in groups.iter().filter(|g| g.of == of) {
                if g.parts.start == chain.last().map_or(0, |c| c.parts.end) {
                    chain.push(g.clone());
                }
            }
            if chain.last().is_some_and(|c| c.parts.end == of) {
                return Some(chain);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_folders_say_which_parts_they_hold() {
        let parts = |name: &str| Group::named(name).map(|g| (g.of, g.parts));
        assert_eq!(parts("processors4"), Some((4, 0..4)));
        assert_eq!(parts("processors12_4-7"), Some((12, 4..8)));
        for wrong in [
            "processors",
            "processor4",
            "processors4_2",
            "processors4_3-2",
            "processors4_2-4",
            "processors0",
            "processors4_a-b",
        ] {
            assert_eq!(parts(wrong), None, "{wrong}");
        }
    }
}
