//! Determines which of PLOT3D's layouts a file has. Nothing in the file states it, but its size
//! does.
//!
//! Grid: [number of blocks], points per axis of each block, then per block all x, all y, all z and
//! perhaps all iblank. Solution: the same header, then per block four reference numbers and the
//! conserved variables. Fortran's unformatted files put each of these in a record between two
//! length marks. Source: PLOT3D User's Manual (Walatka, Buning, Pierce and Elson, NASA TM 101067,
//! 1990), chapter 8.

use super::Plot3dOptions;
use crate::model::Endian;
use crate::read::error::{At, Fault};

/// Grid coordinates or flow variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Grid,
    Solution,
}

/// One possible layout of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) endian: Endian,
    pub(super) records: bool,
    pub(super) multi_block: bool,
    pub(super) iblank: bool,
    /// Bytes of a real number.
    pub(super) real: usize,
    /// 3, or 2 for plane grids.
    pub(super) axes: usize,
}

/// A layout with the sizes that follow from it.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) layout: Layout,
    pub(super) dims: Vec<[u32; 3]>,
    /// Where the data of the first block starts (its record mark, if it has one).
    pub(super) data_start: usize,
    /// Bytes that follow the last block.
    trailing: usize,
}

/// Maximum number of trailing bytes; more are not padding but another layout.
const MAX_PADDING: usize = 4096;

impl Layout {
    /// All layouts that `options` allow, more likely ones first.
    fn candidates(role: Role, options: &Plot3dOptions) -> Vec<Layout> {
        let mut list = Vec::new();
        for axes in [3, 2] {
            for multi_block in [false, true] {
                for iblank in [false, true] {
                    for real in [4, 8] {
                        for records in [false, true] {
                            for endian in [Endian::Little, Endian::Big] {
                                list.push(Layout {
                                    endian,
                                    records,
                                    multi_block,
                                    iblank,
                                    real,
                                    axes,
                                });
                            }
                        }
                    }
                }
            }
        }
        list.retain(|l| {
            options.endian.is_none_or(|e| e == l.endian)
                && options.records.is_none_or(|r| r == l.records)
                && options.multi_block.is_none_or(|m| m == l.multi_block)
                && options.real_bytes.is_none_or(|b| b == l.real)
                && options.two_dimensional.is_none_or(|t| t == (l.axes == 2))
                && match role {
                    Role::Grid => options.iblank.is_none_or(|i| i == l.iblank),
                    Role::Solution => !l.iblank,
                }
        });
        list
    }

    pub(super) fn int(&self, bytes: &[u8], at: usize) -> Option<u32> {
        let b: [u8; 4] = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.endian == Endian::Little {
            u32::from_le_bytes(b)
        } else {
            u32::from_be_bytes(b)
        })
    }

    /// Bytes of the reals and iblanks of a block with `n` points.
    fn block_bytes(&self, role: Role, n: u64) -> Option<u64> {
        let (axes, real) = (self.axes as u64, self.real as u64);
        match role {
            Role::Grid => n.checked_mul(axes * real + if self.iblank { 4 } else { 0 }),
            Role::Solution => n.checked_mul((axes + 2) * real),
        }
    }

    /// The sizes, if the file has this layout: record marks agree, and the blocks fill the file
    /// except for zero padding.
    fn plan(self, role: Role, bytes: &[u8]) -> Option<Plan> {
        let mut at = 0usize;
        let mark = |at: &mut usize, len: u64| -> Option<()> {
            if self.records {
                (u64::from(self.int(bytes, *at)?) == len).then_some(())?;
                *at += 4;
            }
            Some(())
        };
        let mut blocks = 1usize;
        if self.multi_block {
            mark(&mut at, 4)?;
            blocks = self.int(bytes, at)? as usize;
            at += 4;
            mark(&mut at, 4)?;
        }
        if blocks == 0 || blocks > bytes.len() / (4 * self.axes) {
            return None;
        }
        let head = 4 * self.axes as u64 * blocks as u64;
        mark(&mut at, head)?;
        let mut dims = Vec::with_capacity(blocks);
        for _ in 0..blocks {
            let mut d = [1u32; 3];
            for x in d.iter_mut().take(self.axes) {
                *x = self.int(bytes, at)?;
                at += 4;
                (1..=i32::MAX as u32).contains(x).then_some(())?;
            }
            dims.push(d);
        }
        mark(&mut at, head)?;
        let data_start = at;
        for d in &dims {
            let n = d.iter().try_fold(1u64, |n, &x| n.checked_mul(u64::from(x)))?;
            let size = self.block_bytes(role, n).filter(|&s| s <= bytes.len() as u64)?;
            if role == Role::Solution {
                let reference = 4 * self.real;
                mark(&mut at, reference as u64)?;
                at += reference;
                mark(&mut at, reference as u64)?;
            }
            mark(&mut at, size)?;
            at = at.checked_add(size as usize).filter(|&a| a <= bytes.len())?;
            mark(&mut at, size)?;
        }
        let rest = bytes.get(at..)?;
        (rest.len() <= MAX_PADDING && rest.iter().all(|&b| b == 0)).then_some(Plan {
            layout: self,
            dims,
            data_start,
            trailing: rest.len(),
        })
    }
}

/// The layout of `bytes`: the first one that fills the file exactly, else the first one that fills
/// it except for zero padding.
pub(super) fn find(role: Role, bytes: &[u8], options: &Plot3dOptions) -> Result<Plan, Fault> {
    let mut plans: Vec<Plan> =
        Layout::candidates(role, options).into_iter().filter_map(|l| l.plan(role, bytes)).collect();
    plans.sort_by_key(|p| p.trailing);
    let found = plans.into_iter().next();
    found.ok_or_else(|| {
        let what = format!(
            "no PLOT3D layout gives a {} file of {} \
                            bytes",
            if role == Role::Grid { "grid" } else { "solution" },
            bytes.len()
        );
        let cure = "check that the file is complete, and that it is a binary or text PLOT3D file \
                    with reals of 4 or 8 bytes; \
                    restrictions in the options must be those of the file";
        Fault::new(At::Byte(0), what, cure)
    })
}
