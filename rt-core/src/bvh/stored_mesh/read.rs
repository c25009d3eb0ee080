//! Reads the pages of a stored mesh as rays need them.

use super::StoredMeshReport;
use super::bytes::PageSource;
use super::cache::{PageCache, PageUse};
use super::error::StoredMeshError;
use super::format::{
    ENTRY_BYTES, HEADER_BYTES, Header, MAGIC, NoHeader, PageEntry, UNIT_BYTES, VERSION, checksum,
};
use super::page::{Page, PageHit};
use crate::bvh::compact::new_key;
use crate::bvh::layout::wide::Unit;
use crate::math::Aabb;
use crate::ray::Ray;
use crate::shapes::{Shape, ShapeHit, ShapeSurface, rounded_point};
use fearless_simd::Level;
use glam::DVec3;
use std::sync::OnceLock;

/// A mesh in bytes elsewhere, as a shape: its primitives are pages. [`super::StoredMeshWriter`]
/// stores meshes, and has an example. The member `datasets` opens
/// files (`datasets::stored_mesh`).
pub struct StoredMesh {
    source: Box<dyn PageSource>,
    header: Header,
    table: Vec<PageEntry>,
    cache: PageCache,
    level: Level,
    /// The first page that could not be read, and why.
    failure: OnceLock<String>,
}

impl StoredMesh {
    /// Reads the table of pages. Pages in memory take at most `budget` bytes, and the page at hand
    /// and the last 16 of each thread besides.
    ///
    /// # Errors
    /// When the source cannot be read, is no stored mesh, has another version, was cut, or its
    /// header or table is damaged; and on big-endian machines.
    pub fn open(
        source: impl PageSource + 'static,
        budget: usize,
    ) -> Result<StoredMesh, StoredMeshError> {
        if cfg!(target_endian = "big") {
            return Err(StoredMeshError::BigEndian);
        }
        let io = |reason| StoredMeshError::Io { name: source.name(), reason };
        let found = source.length().map_err(io)?;
        let mut bytes = [0; HEADER_BYTES];
        if found < HEADER_BYTES as u64 {
            return Err(StoredMeshError::NotAStoredMesh { name: source.name() });
        }
        source.read(0, &mut bytes).map_err(io)?;
        let header = Header::read(&bytes).map_err(|e| match e {
            NoHeader::OtherFile => StoredMeshError::NotAStoredMesh { name: source.name() },
            NoHeader::OtherVersion(found) => {
                StoredMeshError::Version { name: source.name(), found, expected: VERSION }
            }
            NoHeader::Damaged => damaged(&source, "the header", 0, WRONG_CHECKSUM),
        })?;
        if header.length != found {
            let expected = header.length;
            return Err(StoredMeshError::Length { name: source.name(), found, expected });
        }
        let at = header.table;
        let bad_table = |reason: &str| damaged(&source, "the table of pages", at, reason);
        let bytes = header.pages.checked_mul(ENTRY_BYTES as u64);
        if header.pages >= u64::from(u32::MAX)
            || bytes.and_then(|bytes| at.checked_add(bytes)) != Some(found)
        {
            return Err(bad_table("it does not end where the file does"));
        }
        let mut bytes = vec![0; header.pages as usize * ENTRY_BYTES];
        source.read(at, &mut bytes).map_err(io)?;
        if checksum(&bytes) != header.table_checksum {
            return Err(bad_table(WRONG_CHECKSUM));
        }
        let table: Vec<PageEntry> = bytes.chunks_exact(ENTRY_BYTES).map(PageEntry::read).collect();
        for (number, page) in table.iter().enumerate() {
            let end = u64::from(page.units) * UNIT_BYTES;
            if page.offset.checked_add(end).is_none_or(|end| end > at) {
                return Err(bad_table(&format!("page {number} lies outside")));
            }
        }
        let cache = PageCache::new(new_key(), table.len(), budget);
        let (level, failure) = (Level::new(), OnceLock::new());
        let source = Box::new(source);
        Ok(StoredMesh { source, header, table, cache, level, failure })
    }

    /// Whether a file that starts with these bytes, 8 at least, is a stored mesh of any version.
    pub fn recognizes(start: &[u8]) -> bool {
        start.starts_with(MAGIC)
    }

    /// What the file has.
    pub fn report(&self) -> StoredMeshReport {
        StoredMeshReport {
            triangles: self.header.triangles,
            skipped: self.header.skipped,
            pages: self.header.pages,
            bytes: self.header.length,
        }
    }

    /// Bounds of all triangles relative to the origin, wider by a little; empty without any.
    pub fn bounds_of_all(&self) -> Aabb {
        self.header.bounds
    }

    /// What the pages in memory take.
    pub fn page_use(&self) -> PageUse {
        self.cache.page_use()
    }

    /// The number of the triangle, in the order in which the writer got them, that `ray` hits in
    /// page `page`; the ray is relative to the mesh's origin. `None` when it hits none, or the page
    /// cannot be read ([`StoredMesh::failure`]).
    pub fn triangle(&self, page: u32, ray: &Ray) -> Option<u64> {
        self.hit(page, ray).map(|hit| hit.triangle)
    }

    /// Why a page could not be read, the first time that this was so. Rays passed through it.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Calls `work` with a page. `None` when it cannot be read.
    fn with_page<R>(&self, number: u32, work: impl FnOnce(&Page) -> R) -> Option<R> {
        let read =
            || self.read_page(number).map_err(|e| self.failure.get_or_init(|| e.to_string())).ok();
        self.cache.with(number, read, work)
    }

    fn read_page(&self, number: u32) -> Result<Page, StoredMeshError> {
        let entry = &self.table[number as usize];
        let mut units = vec![Unit::ZERO; entry.units as usize];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut units);
        let io = |reason| StoredMeshError::Io { name: self.source.name(), reason };
        self.source.read(entry.offset, bytes).map_err(io)?;
        let part = format!("page {number}");
        let bad = |reason: &str| damaged(&*self.source, &part, entry.offset, reason);
        if checksum(bytes) != entry.checksum {
            return Err(bad(WRONG_CHECKSUM));
        }
        Page::of_units(units, entry).map_err(bad)
    }

    /// The triangle that the ray hits in a page.
    fn hit(&self, page: u32, ray: &Ray) -> Option<PageHit> {
        self.table.get(page as usize)?;
        self.with_page(page, |page| page.triangle(self.level, ray)).flatten()
    }
}

const WRONG_CHECKSUM: &str = "its checksum is wrong";

fn damaged(source: &dyn PageSource, part: &str, offset: u64, reason: &str) -> StoredMeshError {
    let (name, part, reason) = (source.name(), part.into(), reason.into());
    StoredMeshError::Damaged { name, part, offset, reason }
}

impl Shape for StoredMesh {
    fn num_primitives(&self) -> usize {
        self.table.len()
    }

    fn origin(&self) -> DVec3 {
        self.header.origin
    }

    fn bounds(&self, page: u32) -> Aabb {
        self.table[page as usize].bounds
    }

    fn closest(&self, page: u32, ray: &Ray) -> Option<ShapeHit> {
        let hit = self.with_page(page, |page| page.closest(self.level, ray)).flatten()?;
        Some(ShapeHit { t: hit.t, u: hit.u, v: hit.v })
    }

    fn occluded(&self, page: u32, ray: &Ray) -> bool {
        self.with_page(page, |page| page.occluded(self.level, ray)).unwrap_or(false)
    }

    fn surface(&self, page: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let flat = |point, point_error, normal| ShapeSurface {
            point,
            point_error,
            normal,
            scalar: None,
            color: None,
        };
        // The same hit by a ray that ends there: it meets few boxes.
        let to_hit = Ray { t_min: hit.t, t_max: hit.t.next_up(), ..*ray };
        let found = self.hit(page, &to_hit).or_else(|| self.hit(page, ray));
        let Some(PageHit { corners, .. }) = found else {
            // The page could be read for the hit and cannot be read now: the render fails.
            return flat(ray.at(hit.t), 0.0, -ray.dir.normalize_or_zero());
        };
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let p = a + e1 * f64::from(hit.u) + e2 * f64::from(hit.v);
        // The sum lies in the triangle's plane for any weights, but for the rounding of f64.
        let size = corners.iter().fold(0.0f32, |m, p| m.max(p.abs().max_element()));
        let (point, point_error) = rounded_point(p, 16.0 * f64::EPSILON * f64::from(size));
        flat(point, point_error, e1.cross(e2).normalize_or_zero().as_vec3())
    }

    fn is_costly(&self) -> bool {
        true
    }

    fn failure(&self) -> Option<String> {
        self.failure.get().cloned()
    }
}
