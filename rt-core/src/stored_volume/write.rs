//! Stores a volume plane by plane.

use super::brick::Values;
use super::error::StoredVolumeError;
use super::format::{BrickEntry, HEADER_BYTES, Header};
use super::layout::{BRICK_CELLS, BrickBox, VolumeLayout};
use crate::paging::PageSink;
use crate::paging::fields::checksum;
use glam::UVec3;
use rayon::prelude::*;

/// Writes a volume that need not fit into memory in the form that [`super::StoredVolume`] reads.
/// Of its planes, 33 are in memory at a time.
///
/// The same planes make the same bytes for any number of threads. The first bytes are written last,
/// so what was not finished cannot be opened. The member `datasets` stores volumes in files
/// (`datasets::stored_volume`).
///
/// ```
/// use rt_core::prelude::*;
/// use rt_core::glam::UVec3;
/// use rt_core::shapes::IsosurfaceNormals;
/// use rt_core::stored_volume::{
///     StoredIsosurface, StoredVolume, StoredVolumeWriter, ValueType, VolumeLayout,
/// };
/// use std::sync::Arc;
///
/// // The value is 2 x; 40 x 3 x 3 points.
/// let layout = VolumeLayout {
///     dims: UVec3::new(40, 3, 3),
///     origin: DVec3::ZERO,
///     spacing: DVec3::ONE,
///     values: ValueType::U8,
/// };
/// let mut writer = StoredVolumeWriter::new(Vec::new(), layout)?;
/// let plane: Vec<u8> = (0..40 * 3).map(|i| 2 * (i % 40)).collect();
/// for _z in 0..3 {
///     writer.add_plane(&plane)?;
/// }
/// let (bytes, report) = writer.finish()?;
/// assert_eq!((report.points, report.bricks), (360, 2));
///
/// let volume = Arc::new(StoredVolume::open(bytes, 64 << 20)?);
/// let surface = StoredIsosurface::new(volume, &[65.0], IsosurfaceNormals::Surface)?;
/// let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
/// let options = BuildOptions::default();
/// let world = World::build(vec![Geometry::Shape(Arc::new(surface))], vec![placed], &options)?;
/// let along_x = Ray::new(Vec3::new(-1.0, 1.2, 0.7), Vec3::X);
/// assert_eq!(world.closest(&along_x).map(|hit| hit.t), Some(33.5));
/// assert!(world.failure().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct StoredVolumeWriter<S> {
    sink: S,
    layout: VolumeLayout,
    /// Planes that bricks still need, the lowest first.
    planes: Vec<Vec<u8>>,
    /// Planes given so far.
    given: u32,
    /// Bytes written so far.
    length: u64,
    table: Vec<BrickEntry>,
    non_finite: u64,
}

/// What a file has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct StoredVolumeReport {
    /// Points of the lattice.
    pub points: u64,
    /// Points whose value is NaN or infinite: surfaces end at the cells around them.
    pub non_finite: u64,
    /// Parts of the file that are read as a whole: 32 x 32 x 32 cells.
    pub bricks: u64,
    /// Those with the same value at each point, which the file does not repeat.
    pub bricks_constant: u64,
    /// Bytes of the file.
    pub bytes: u64,
}

impl<S: PageSink> StoredVolumeWriter<S> {
    /// Starts at the start of `sink`, which is empty.
    ///
    /// # Errors
    /// When the sink takes no bytes, for a layout that cannot be, and on big-endian machines.
    pub fn new(sink: S, layout: VolumeLayout) -> Result<StoredVolumeWriter<S>, StoredVolumeError> {
        if cfg!(target_endian = "big") {
            return Err(StoredVolumeError::BigEndian);
        }
        layout.check()?;
        let mut writer = StoredVolumeWriter {
            sink,
            layout,
            planes: Vec::new(),
            given: 0,
            length: 0,
            table: Vec::new(),
            non_finite: 0,
        };
        writer.append(&[0; HEADER_BYTES])?;
        Ok(writer)
    }

    /// Adds the values of the points of the next z, x fastest, little-endian.
    ///
    /// # Errors
    /// [`StoredVolumeError::Plane`] for another number of bytes, or more planes than there are;
    /// when the sink takes no bytes.
    pub fn add_plane(&mut self, values: &[u8]) -> Result<(), StoredVolumeError> {
        let is_past = self.given >= self.layout.dims.z;
        let expected = if is_past { 0 } else { self.layout.plane_bytes() };
        let found = values.len() as u64;
        if is_past || found != expected {
            return Err(StoredVolumeError::Plane { plane: self.given, found, expected });
        }
        if self.layout.values == super::ValueType::F32 {
            let is_finite = |x: &[u8; 4]| f32::from_le_bytes(*x).is_finite();
            let non_finite = values.as_chunks().0.iter().filter(|x| !is_finite(x)).count();
            self.non_finite += non_finite as u64;
        }
        self.planes.push(values.to_vec());
        self.given += 1;
        if self.planes.len() > BRICK_CELLS as usize
            || (self.given == self.layout.dims.z && self.planes.len() > 1)
        {
            self.write_bricks()?;
            // Bricks share a layer of points.
            self.planes.drain(..self.planes.len() - 1);
        }
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`StoredVolumeError::Plane`] where planes are missing; when the sink takes no bytes.
    pub fn finish(mut self) -> Result<(S, StoredVolumeReport), StoredVolumeError> {
        if self.given < self.layout.dims.z {
            let expected = self.layout.plane_bytes();
            return Err(StoredVolumeError::Plane { plane: self.given, found: 0, expected });
        }
        let table_bytes: Vec<u8> = self.table.iter().flat_map(BrickEntry::bytes).collect();
        let table = self.length;
        self.append(&table_bytes)?;
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        let range = self
            .table
            .iter()
            .fold(none, |all, brick| [all[0].min(brick.range[0]), all[1].max(brick.range[1])]);
        let header = Header {
            length: self.length,
            table,
            layout: self.layout,
            range,
            non_finite: self.non_finite,
            table_checksum: checksum(&table_bytes),
        };
        let name = self.sink.name();
        let replaced = self.sink.replace_start(&header.bytes());
        replaced.map_err(|reason| StoredVolumeError::Io { name, reason })?;
        let report = StoredVolumeReport {
            points: self.layout.dims.as_u64vec3().element_product(),
            non_finite: self.non_finite,
            bricks: self.table.len() as u64,
            bricks_constant: self.table.iter().filter(|b| b.offset == 0).count() as u64,
            bytes: self.length,
        };
        Ok((self.sink, report))
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), StoredVolumeError> {
        let appended = self.sink.append(bytes);
        appended.map_err(|reason| StoredVolumeError::Io { name: self.sink.name(), reason })?;
        self.length += bytes.len() as u64;
        Ok(())
    }

    /// Writes the bricks of the planes at hand.
    fn write_bricks(&mut self) -> Result<(), StoredVolumeError> {
        let (layout, bricks) = (self.layout, self.layout.bricks());
        let z = self.table.len() as u32 / (bricks.x * bricks.y);
        for y in 0..bricks.y {
            let planes = &self.planes;
            let row: Vec<(Values, BrickEntry)> = (0..bricks.x)
                .into_par_iter()
                .map(|x| {
                    let place = layout.brick(layout.number(UVec3::new(x, y, z)));
                    brick_of_planes(&layout, planes, place)
                })
                .collect();
            for (values, mut entry) in row {
                let [lo, hi] = entry.range;
                if lo != hi || entry.has_non_finite {
                    entry.offset = self.length;
                    self.append(values.bytes())?;
                }
                self.table.push(entry);
            }
        }
        Ok(())
    }
}

/// The values of a brick of the planes from its first z on, without its place in the file.
fn brick_of_planes(
    layout: &VolumeLayout,
    planes: &[Vec<u8>],
    place: BrickBox,
) -> (Values, BrickEntry) {
    let mut values = Values::zeros(layout.values, place.count());
    let size = layout.values.bytes();
    let points = place.points().to_array().map(|n| n as usize);
    let mut to = values.bytes_mut().chunks_exact_mut(points[0] * size);
    for plane in &planes[..points[2]] {
        for y in place.lo.y..=place.hi.y {
            let first = u64::from(y) * u64::from(layout.dims.x) + u64::from(place.lo.x);
            let from = first as usize * size;
            if let Some(row) = to.next() {
                row.copy_from_slice(&plane[from..from + points[0] * size]);
            }
        }
    }
    let (range, has_non_finite) = values.range();
    let checksum = checksum(values.bytes());
    (values, BrickEntry { offset: 0, range, checksum, has_non_finite })
}
