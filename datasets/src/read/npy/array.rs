//! One NumPy array: its numbers as stored, and in the order of a lattice.

use super::header::Header;
use crate::model::{DataArray, Values};
use crate::read::error::{At, Fault, TRUNCATED, fits};
use std::io::Read;

/// Numbers as the file holds them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StoredArray {
    pub(super) name: String,
    /// Values along each index.
    pub(super) shape: Vec<usize>,
    fortran_order: bool,
    pub(super) values: Values,
}

/// Bytes that are decoded at once; a multiple of every number's size.
const PIECE: usize = 1 << 20;

impl StoredArray {
    /// Reads an array of which `available` bytes exist at most, header included.
    pub(super) fn read(
        name: String,
        source: &mut impl Read,
        available: u64,
    ) -> Result<StoredArray, Fault> {
        let (header, start) = Header::read(source)?;
        let each = header.kind.size();
        let left = usize::try_from(available.saturating_sub(start)).unwrap_or(usize::MAX);
        let mut bytes = fits(header.count()?, each, left, At::Byte(start), "values")? * each;
        let mut values = Values::empty(header.kind);
        let mut piece = vec![0u8; PIECE.min(bytes)];
        while bytes > 0 {
            let n = bytes.min(PIECE);
            source.read_exact(&mut piece[..n]).map_err(|e| {
                let at = At::Field(format!("array `{name}`"));
                Fault::new(at, format!("{bytes} bytes are missing ({e})"), TRUNCATED)
            })?;
            values.append(&Values::from_bytes(header.kind, &piece[..n], header.endian));
            bytes -= n;
        }
        // An empty array may have an axis of any length.
        let shape = header.shape.iter().map(|&d| usize::try_from(d).unwrap_or(usize::MAX));
        Ok(StoredArray {
            name,
            shape: shape.collect(),
            fortran_order: header.fortran_order,
            values,
        })
    }

    /// The array over a lattice of `dims` points, the first index along x. Its shape is `dims`
    /// without axes of one point at its end, and the components as the last index if there are
    /// more than one.
    pub(super) fn over(self, dims: [usize; 3], components: usize) -> DataArray {
        let [nx, ny, nz] = dims;
        let one_axis = self.shape.iter().filter(|&&d| d > 1).count() < 2;
        let values = if one_axis || self.fortran_order && components == 1 {
            self.values
        } else {
            let tuples = nx * ny * nz;
            let indices = (0..tuples * components).map(|out| {
                let (tuple, c) = (out / components, out % components);
                if self.fortran_order {
                    return tuple + tuples * c;
                }
                let (i, j, k) = (tuple % nx, tuple / nx % ny, tuple / nx / ny);
                ((i * ny + j) * nz + k) * components + c
            });
            self.values.gathered(indices)
        };
        DataArray::new(self.name, components, values)
    }
}
