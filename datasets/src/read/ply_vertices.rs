//! The vertices of a binary PLY file, of which any can be read without the rest.

use super::ReadError;
use super::error::{Cursor, Fault, io_error};
use super::ply::{Element, Encoding, FORMAT, rows, vertices};
use crate::model::{Endian, Points, PolyData};
use glam::DVec3;
use std::fs::File;
use std::ops::Range;
use std::path::PathBuf;

/// Vertices that are read at once.
const AT_ONCE: u64 = 1 << 14;

/// The vertices of a file.
pub(super) struct PlyVertices {
    pub(super) file: File,
    pub(super) path: PathBuf,
    pub(super) element: Element,
    pub(super) endian: Endian,
    /// Byte of the first one.
    pub(super) start: u64,
    /// Bytes of each.
    pub(super) row: u64,
}

impl PlyVertices {
    pub(super) fn count(&self) -> u64 {
        self.element.count
    }

    /// Some vertices, which must exist, with all of their properties.
    pub(super) fn read(&self, range: Range<u64>) -> Result<PolyData, ReadError> {
        let count = range.end - range.start;
        let mut bytes = vec![0; (count * self.row) as usize];
        crate::paged_file::read_at(&self.file, &mut bytes, self.start + range.start * self.row)
            .map_err(|e| io_error(&self.path, e))?;
        let some = Element { count, ..self.element.clone() };
        let fault = |f: Fault| f.in_file(&self.path, FORMAT);
        let columns = rows(&mut Cursor::new(&bytes), &some, Encoding::Binary(self.endian));
        let mut part = PolyData::default();
        vertices(&some, columns.map_err(fault)?, &mut part).map_err(fault)?;
        Ok(part)
    }

    /// The vertices with the given numbers, which must exist and ascend.
    pub(super) fn gathered(&self, numbers: &[u64]) -> Result<PolyData, ReadError> {
        let mut all: Option<PolyData> = None;
        for near in numbers.chunk_by(|a, b| a / AT_ONCE == b / AT_ONCE) {
            let first = near[0];
            let read = self.read(first..near[near.len() - 1] + 1)?;
            let places: Vec<usize> = near.iter().map(|&n| (n - first) as usize).collect();
            let some = vertices_at(read, &places);
            match &mut all {
                None => all = Some(some),
                Some(all) => append(all, some),
            }
        }
        all.map_or_else(|| self.read(0..0), Ok)
    }

    /// The box around all that are finite.
    pub(super) fn bounds(&self) -> Result<[DVec3; 2], ReadError> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for start in (0..self.count()).step_by(AT_ONCE as usize) {
            let points = self.read(start..self.count().min(start + AT_ONCE))?.points;
            for p in (0..points.len()).map(|i| points.get(i)).filter(|p| p.is_finite()) {
                (low, high) = (low.min(p), high.max(p));
            }
        }
        Ok([low, high])
    }
}

/// Some of the vertices.
fn vertices_at(mut of: PolyData, places: &[usize]) -> PolyData {
    of.points = match &of.points {
        Points::F32(all) => Points::F32(places.iter().map(|&i| all[i]).collect()),
        Points::F64(all) => Points::F64(places.iter().map(|&i| all[i]).collect()),
    };
    for array in &mut of.attributes.point {
        let n = array.components;
        array.values = array.values.gathered(places.iter().flat_map(|&i| n * i..n * (i + 1)));
    }
    of
}

/// Appends vertices with the same properties.
fn append(all: &mut PolyData, part: PolyData) {
    match (&mut all.points, part.points) {
        (Points::F32(all), Points::F32(part)) => all.extend(part),
        (Points::F64(all), Points::F64(part)) => all.extend(part),
        (Points::F32(_), Points::F64(_)) | (Points::F64(_), Points::F32(_)) => {
            unreachable!("one header says what all vertices have")
        }
    }
    for (all, part) in all.attributes.point.iter_mut().zip(part.attributes.point) {
        all.values.append(&part.values);
    }
}
