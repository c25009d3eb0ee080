//! Reads the pages of a stored mesh as rays need them.

use super::StoredMeshReport;
use super::attributes::{HitAttributes, PageAttributes};
use super::error::StoredMeshError;
use super::format::{
    Attributes, ENTRY_BYTES, HEADER_BYTES, Header, MAGIC, NoHeader, PageEntry, VERSION,
};
use super::page::{Page, PageHit};
use super::surface::TriangleHit;
use crate::bvh::layout::wide::Unit;
use crate::math::Aabb;
use crate::paging::fields::checksum;
use crate::paging::{PageCache, PageSource, PageUse, Paged};
use crate::ray::Ray;
use crate::shapes::{Shape, ShapeHit, ShapeSurface, rounded_point};
use fearless_simd::Level;
use glam::DVec3;
use std::any::Any;
use std::sync::OnceLock;

/// What the cache holds. Attributes of pages come and go by themselves.
enum Part {
    Page(Page),
    Attributes(PageAttributes),
}

impl Paged for Part {
    fn bytes(&self) -> usize {
        match self {
            Part::Page(page) => page.bytes(),
            Part::Attributes(attributes) => attributes.bytes(),
        }
    }
}

/// A mesh in bytes elsewhere, as a shape: its primitives are pages. [`super::StoredMeshWriter`]
/// stores meshes, and has an example. The member `datasets` opens
/// files (`datasets::stored_mesh`).
pub struct StoredMesh {
    source: Box<dyn PageSource>,
    header: Header,
    table: Vec<PageEntry>,
    cache: PageCache<Part>,
    pub(super) level: Level,
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
            if page.end().is_none_or(|end| end > at) {
                return Err(bad_table(&format!("page {number} lies outside")));
            }
        }
        let places = if header.attributes.any() { 2 * table.len() } else { table.len() };
        let cache = PageCache::new(places, budget);
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
            attribute_bytes: self.table.iter().map(|p| 4 * u64::from(p.attribute_words)).sum(),
        }
    }

    /// What its triangles have beside their corners.
    pub fn attributes(&self) -> StoredAttributes {
        let Attributes { normals, colors, scalars, .. } = self.header.attributes;
        StoredAttributes { normals, colors, scalars }
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
        self.hit(page, ray).map(|hit| hit.triangle())
    }

    /// Why a page could not be read, the first time that this was so. Rays passed through it.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Different for any two meshes of a process.
    pub(super) fn key(&self) -> u64 {
        self.cache.key()
    }

    /// Calls `work` with a page. `None` when it cannot be read.
    pub(super) fn with_page<R>(&self, number: u32, work: impl FnOnce(&Page) -> R) -> Option<R> {
        let page = |part: &Part| match part {
            Part::Page(page) => Some(work(page)),
            Part::Attributes(_) => None,
        };
        self.cache.with(number, || self.keep_failure(self.read_page(number)), page).flatten()
    }

    /// Calls `work` with the attributes of a page, where there are any that can be read.
    pub(super) fn with_attributes(&self, page: u32, work: impl FnOnce(&PageAttributes)) {
        let entry = &self.table[page as usize];
        if entry.attribute_words == 0 || !self.header.attributes.any() {
            return;
        }
        let read = || self.keep_failure(self.read_attributes(page));
        let with = |part: &Part| match part {
            Part::Attributes(attributes) => work(attributes),
            Part::Page(_) => {}
        };
        // Behind the pages.
        let place = self.table.len() + page as usize;
        if let Ok(place) = u32::try_from(place) {
            self.cache.with(place, read, with);
        }
    }

    /// What was read; keeps the reason where it was not.
    fn keep_failure(&self, read: Result<Part, StoredMeshError>) -> Option<Part> {
        read.map_err(|e| self.failure.get_or_init(|| e.to_string())).ok()
    }

    fn read_page(&self, number: u32) -> Result<Part, StoredMeshError> {
        let entry = &self.table[number as usize];
        let mut units = vec![Unit::ZERO; entry.units as usize];
        let (part, expected) = (format!("page {number}"), entry.checksum);
        let bytes = bytemuck::cast_slice_mut(&mut units);
        let bad = self.read_part(&part, entry.offset, bytes, expected)?;
        Page::of_units(units, entry).map(Part::Page).map_err(bad)
    }

    fn read_attributes(&self, number: u32) -> Result<Part, StoredMeshError> {
        let entry = &self.table[number as usize];
        let mut words = vec![0u32; entry.attribute_words as usize];
        let (part, expected) =
            (format!("the attributes of page {number}"), entry.attribute_checksum);
        let bytes = bytemuck::cast_slice_mut(&mut words);
        let bad = self.read_part(&part, entry.attributes(), bytes, expected)?;
        PageAttributes::of_words(words).map(Part::Attributes).map_err(bad)
    }

    /// Reads a part of the file. Returns what makes an error of what is wrong with it.
    fn read_part<'a>(
        &'a self,
        part: &'a str,
        offset: u64,
        bytes: &mut [u8],
        expected: u32,
    ) -> Result<impl FnOnce(&str) -> StoredMeshError + 'a, StoredMeshError> {
        let io = |reason| StoredMeshError::Io { name: self.source.name(), reason };
        self.source.read(offset, bytes).map_err(io)?;
        let bad = move |reason: &str| damaged(&*self.source, part, offset, reason);
        if checksum(bytes) != expected { Err(bad(WRONG_CHECKSUM)) } else { Ok(bad) }
    }

    /// The triangle that the ray hits in a page.
    pub(super) fn hit(&self, page: u32, ray: &Ray) -> Option<PageHit> {
        self.table.get(page as usize)?;
        self.with_page(page, |page| page.triangle(self.level, ray)).flatten()
    }
}

/// What the triangles of a stored mesh have beside their corners; some of them at least.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StoredAttributes {
    /// Normals for shading.
    pub normals: bool,
    /// Colours.
    pub colors: bool,
    /// The smallest and the largest finite scalar, where there are scalars.
    pub scalars: Option<[f32; 2]>,
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
        let surface = |point, point_error, normal, found: HitAttributes| ShapeSurface {
            point,
            point_error,
            normal,
            shading_normal: found.normal,
            scalar: found.scalar,
            color: found.color,
        };
        let Some(TriangleHit { corners, attributes }) = self.triangle_hit(page, hit, ray) else {
            // The page could be read for the hit and cannot be read now: the render fails.
            let against = -ray.dir.normalize_or_zero();
            return surface(ray.at(hit.t), 0.0, against, HitAttributes::default());
        };
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let p = a + e1 * f64::from(hit.u) + e2 * f64::from(hit.v);
        // The sum lies in the triangle's plane for any weights, but for the rounding of f64.
        let size = corners.iter().fold(0.0f32, |m, p| m.max(p.abs().max_element()));
        let (point, point_error) = rounded_point(p, 16.0 * f64::EPSILON * f64::from(size));
        surface(point, point_error, e1.cross(e2).normalize_or_zero().as_vec3(), attributes)
    }

    fn has_transparency(&self) -> bool {
        self.header.attributes.transparent
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn is_costly(&self) -> bool {
        true
    }

    fn failure(&self) -> Option<String> {
        self.failure.get().cloned()
    }
}
