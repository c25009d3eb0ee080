//! Stores a mesh piece by piece.

use super::attributes::{self, MeshAttributes};
use super::error::StoredMeshError;
use super::format::{Attributes, ENTRY_BYTES, HEADER_BYTES, Header, PageEntry, UNIT_BYTES};
use crate::bvh::build::UNWATCHED;
use crate::bvh::compact::{BYTES_WHILE_DIVIDED, CompactBvh, Pieces, divide};
use crate::bvh::layout::local_frame::LocalFrame;
use crate::bvh::layout::triangles::TriWriter;
use crate::bvh::options::BuildQuality;
use crate::math::Aabb;
use crate::mesh::{Attribute, MeshSlices, PerElement, TriMesh};
use crate::paging::PageSink;
use crate::paging::fields::checksum;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Most triangles of a page: about 57 kB.
const PAGE_TRIANGLES: usize = 1 << 12;
/// Bytes of memory for each triangle that waits: its corners and their numbers, and what it takes
/// when all are divided among pages.
const WAITING_BYTES: usize = 48 + BYTES_WHILE_DIVIDED;
/// Bytes for triangles that wait, unless the caller chooses others.
const DEFAULT_MEMORY: usize = 1 << 30;
/// Pages that are built before they are written.
const PAGES_AT_ONCE: usize = 64;

/// Writes a mesh that need not fit into memory in the form that [`super::StoredMesh`] reads. The
/// piece at hand is in memory, and small pieces before it up to a limit
/// ([`StoredMeshWriter::set_memory`]).
///
/// What is written at once is divided among pages by place. So rays meet the fewest pages when
/// pieces that lie in the same place are written together: layers, for example, want memory for as
/// many of them as possible.
///
/// The same pieces make the same bytes for any number of threads. The first bytes are written last,
/// so what was not finished cannot be opened. The member `datasets` stores
/// meshes in files (`datasets::stored_mesh`).
///
/// ```
/// use rt_core::bvh::{StoredMesh, StoredMeshWriter};
/// use rt_core::mesh::MeshSlices;
/// use rt_core::prelude::*;
/// use std::sync::Arc;
///
/// let mut writer = StoredMeshWriter::new(Vec::new(), DVec3::ZERO)?;
/// for k in 0..3 {
///     let z = k as f32;
///     let corners = [0., 0., z, 4., 0., z, 0., 4., z];
///     writer.add(&MeshSlices::new(&corners, &[0, 1, 2]))?;
/// }
/// let (bytes, report) = writer.finish()?;
/// assert_eq!((report.triangles, report.skipped), (3, 0));
///
/// let mesh = Arc::new(StoredMesh::open(bytes, 64 << 20)?);
/// let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
/// let options = BuildOptions::default();
/// let world = World::build(vec![Geometry::Shape(mesh.clone())], vec![placed], &options)?;
/// let up = Ray::new(Vec3::new(1.0, 1.0, -1.0), Vec3::Z);
/// let hit = world.closest(&up).expect("a hit");
/// assert_eq!((hit.t, mesh.triangle(hit.prim, &up)), (1.0, Some(0)));
/// assert!(world.failure().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct StoredMeshWriter<S> {
    sink: S,
    origin: DVec3,
    quality: BuildQuality,
    /// Pieces given so far.
    pieces: u64,
    /// Triangles given so far.
    triangles: u64,
    skipped: u64,
    /// Bytes written so far.
    length: u64,
    table: Vec<PageEntry>,
    bounds: Aabb,
    waiting: Waiting,
    /// Bytes for triangles that wait.
    memory: usize,
    normal_tolerance: f64,
    /// Of the pages written so far.
    attributes: Attributes,
    attribute_bytes: u64,
}

/// What a file has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct StoredMeshReport {
    /// Triangles given, with those that were left out.
    pub triangles: u64,
    /// Triangles that cannot be hit: a vertex that does not exist or is not finite.
    pub skipped: u64,
    /// Parts of the file that are read as a whole.
    pub pages: u64,
    /// Bytes of the file.
    pub bytes: u64,
    /// Those of them that normals, colours and scalars take.
    pub attribute_bytes: u64,
}

/// Triangles of small pieces, with their own vertices.
#[derive(Default)]
struct Waiting {
    positions: Vec<f32>,
    indices: Vec<u32>,
    /// All of them have the same.
    normals: Option<Attribute<Vec3>>,
    colors: Option<Attribute<[f32; 4]>>,
    scalars: Option<Attribute<f32>>,
}

impl<S: PageSink> StoredMeshWriter<S> {
    /// Starts at the start of `sink`, which is empty. All positions are relative to `origin`;
    /// choose it near the middle.
    ///
    /// # Errors
    /// When the sink takes no bytes, and on big-endian machines.
    pub fn new(sink: S, origin: DVec3) -> Result<StoredMeshWriter<S>, StoredMeshError> {
        if cfg!(target_endian = "big") {
            return Err(StoredMeshError::BigEndian);
        }
        let mut sink = sink;
        sink.append(&[0; HEADER_BYTES]).map_err(|reason| unwritable(&sink, reason))?;
        Ok(StoredMeshWriter {
            sink,
            origin,
            quality: BuildQuality::Balanced,
            pieces: 0,
            triangles: 0,
            skipped: 0,
            length: HEADER_BYTES as u64,
            table: Vec::new(),
            bounds: Aabb::EMPTY,
            waiting: Waiting::default(),
            memory: DEFAULT_MEMORY,
            normal_tolerance: 0.0,
            attributes: Attributes::default(),
            attribute_bytes: 0,
        })
    }

    /// The quality of the trees from here on; balanced without it.
    pub fn set_quality(&mut self, quality: BuildQuality) {
        self.quality = quality;
    }

    /// Bytes that small pieces may take while they wait for others, and while they are divided
    /// among pages; 1 GiB without it.
    pub fn set_memory(&mut self, bytes: usize) {
        self.memory = bytes;
    }

    /// The angle in degrees by which stored normals may be off, from here on: they are stored with
    /// unit length, in as few bits as it allows. As given, in 96 bits, without it and with 0 or
    /// less, and where 32 bits do not suffice or a normal of the page has no direction.
    pub fn set_normal_tolerance(&mut self, degrees: f64) {
        self.normal_tolerance = degrees;
    }

    /// Adds a piece without attributes: its surface is flat shaded. Its triangles get the numbers
    /// after those of the pieces before it. Triangles that cannot be hit are counted, and keep
    /// their numbers.
    ///
    /// # Errors
    /// When the piece is invalid or has another origin, or the sink takes no bytes.
    pub fn add(&mut self, piece: &MeshSlices<'_>) -> Result<(), StoredMeshError> {
        self.add_piece(piece, &MeshAttributes::default())
    }

    /// Adds a piece with its normals, colours and scalars. Texture coordinates and tangents are not
    /// stored. As [`StoredMeshWriter::add`] otherwise.
    ///
    /// # Errors
    /// As [`StoredMeshWriter::add`], and when an attribute has another number of values than the
    /// mesh has vertices or triangles.
    pub fn add_mesh(&mut self, piece: &TriMesh) -> Result<(), StoredMeshError> {
        let number = self.pieces;
        piece.check().map_err(|source| StoredMeshError::Mesh { piece: number, source })?;
        let attributes = MeshAttributes {
            normals: piece.normals.as_ref(),
            colors: piece.colors.as_ref(),
            scalars: piece.scalars.as_ref(),
        };
        self.add_piece(&MeshSlices::of_mesh(piece), &attributes)
    }

    fn add_piece(
        &mut self,
        piece: &MeshSlices<'_>,
        attributes: &MeshAttributes<'_>,
    ) -> Result<(), StoredMeshError> {
        let number = self.pieces;
        piece.check().map_err(|source| StoredMeshError::Mesh { piece: number, source })?;
        if piece.origin != self.origin {
            return Err(StoredMeshError::Origin {
                piece: number,
                found: piece.origin,
                expected: self.origin,
            });
        }
        self.pieces += 1;
        let most = self.memory / waiting_bytes(attributes);
        let small = piece.num_triangles() <= most;
        let full = self.waiting.indices.len() / 3 + piece.num_triangles() > most;
        if !small || full || !self.waiting.has_those_of(attributes) {
            self.write_waiting()?;
        }
        if small {
            self.waiting.push(piece, attributes);
            return Ok(());
        }
        self.write(piece, attributes)
    }

    /// Writes what waits, the table and the header. Returns the sink, and what it has.
    ///
    /// # Errors
    /// When the sink takes no bytes, or the coordinates are too large or too small.
    pub fn finish(mut self) -> Result<(S, StoredMeshReport), StoredMeshError> {
        self.write_waiting()?;
        let reach = self.bounds.min.abs().max(self.bounds.max.abs()).max_element();
        if !self.bounds.is_empty() && LocalFrame::around(self.origin, reach).scale != 1.0 {
            return Err(StoredMeshError::Reach { reach });
        }
        let mut table = Vec::with_capacity(self.table.len() * ENTRY_BYTES);
        self.table.iter().for_each(|page| table.extend(page.bytes()));
        let header = Header {
            length: self.length + table.len() as u64,
            table: self.length,
            pages: self.table.len() as u64,
            triangles: self.triangles,
            skipped: self.skipped,
            origin: self.origin,
            bounds: self.bounds,
            table_checksum: checksum(&table),
            attributes: self.attributes,
        };
        let written = self.sink.append(&table);
        let written = written.and_then(|()| self.sink.replace_start(&header.bytes()));
        written.map_err(|reason| unwritable(&self.sink, reason))?;
        let report = StoredMeshReport {
            triangles: header.triangles,
            skipped: header.skipped,
            pages: header.pages,
            bytes: header.length,
            attribute_bytes: self.attribute_bytes,
        };
        Ok((self.sink, report))
    }

    fn write_waiting(&mut self) -> Result<(), StoredMeshError> {
        let waiting = std::mem::take(&mut self.waiting);
        let mesh = MeshSlices {
            origin: self.origin,
            ..MeshSlices::new(&waiting.positions, &waiting.indices)
        };
        let Waiting { normals, colors, scalars, .. } = &waiting;
        let attributes = MeshAttributes {
            normals: normals.as_ref(),
            colors: colors.as_ref(),
            scalars: scalars.as_ref(),
        };
        self.write(&mesh, &attributes)
    }

    /// Builds the pages of a mesh and writes them.
    fn write(
        &mut self,
        mesh: &MeshSlices<'_>,
        attributes: &MeshAttributes<'_>,
    ) -> Result<(), StoredMeshError> {
        let (mesh, count) = (mesh.triangles(), mesh.num_triangles());
        if count == 0 {
            return Ok(());
        }
        let frame = LocalFrame { center: self.origin, scale: 1.0 };
        let triangles = TriWriter::new(mesh, &frame, 0);
        let usable = |i: u32| mesh.is_renderable(i as usize);
        let watched = "nobody watches, so nobody stops it";
        let divided = divide(&triangles, count, usable, PAGE_TRIANGLES, &UNWATCHED);
        let Pieces { ids, ends } = divided.expect(watched);
        self.skipped += (count - ids.len()) as u64;
        let mut start = 0;
        let ranges: Vec<_> =
            ends.into_iter().map(|end| std::mem::replace(&mut start, end)..end).collect();
        for ranges in ranges.chunks(PAGES_AT_ONCE) {
            let build = |range: &std::ops::Range<usize>| {
                let ids = ids[range.clone()].to_vec();
                let words = if attributes.any() {
                    let corners = |id: u32| mesh.indices[id as usize];
                    attributes::encode(ids.clone(), corners, attributes, self.normal_tolerance)
                } else {
                    Vec::new()
                };
                let page = Pieces { ends: vec![ids.len()], ids };
                let tree = CompactBvh::of_pieces(&triangles, page, self.quality, &UNWATCHED);
                (tree.expect(watched), words)
            };
            let pages: Vec<(CompactBvh, Vec<u32>)> = ranges.par_iter().map(build).collect();
            for ((tree, words), range) in pages.iter().zip(ranges) {
                if !range.is_empty() {
                    self.write_page(tree, range.len() as u32, words)?;
                }
            }
        }
        if !ids.is_empty() {
            self.attributes.include(attributes);
        }
        self.triangles += count as u64;
        Ok(())
    }

    fn write_page(
        &mut self,
        tree: &CompactBvh,
        triangles: u32,
        attributes: &[u32],
    ) -> Result<(), StoredMeshError> {
        let most = u64::from(u32::MAX) - 1;
        if self.table.len() as u64 >= most {
            return Err(StoredMeshError::TooManyPages { found: most + 1, most });
        }
        let bytes: &[u8] = bytemuck::cast_slice(&tree.bvh.units);
        self.sink.append(bytes).map_err(|reason| unwritable(&self.sink, reason))?;
        let words: &[u8] = bytemuck::cast_slice(attributes);
        self.sink.append(words).map_err(|reason| unwritable(&self.sink, reason))?;
        self.table.push(PageEntry {
            offset: self.length,
            first: self.triangles,
            units: (bytes.len() as u64 / UNIT_BYTES) as u32,
            triangles,
            depth: tree.bvh.depth as u32,
            checksum: checksum(bytes),
            bounds: tree.bvh.bounds,
            attribute_words: attributes.len() as u32,
            attribute_checksum: checksum(words),
        });
        self.length += (bytes.len() + words.len()) as u64;
        self.attribute_bytes += words.len() as u64;
        self.bounds = self.bounds.union(tree.bvh.bounds);
        Ok(())
    }
}

/// Bytes of memory for a triangle that waits.
fn waiting_bytes(attributes: &MeshAttributes<'_>) -> usize {
    fn of<T>(a: Option<&Attribute<T>>) -> usize {
        a.map_or(0, |a| if a.per == PerElement::Vertex { 3 } else { 1 } * size_of::<T>())
    }
    WAITING_BYTES + of(attributes.normals) + of(attributes.colors) + of(attributes.scalars)
}

impl Waiting {
    /// Whether a piece with these attributes can wait together with what is here.
    fn has_those_of(&self, attributes: &MeshAttributes<'_>) -> bool {
        fn per<T>(a: Option<&Attribute<T>>) -> Option<PerElement> {
            a.map(|a| a.per)
        }
        self.indices.is_empty()
            || per(self.normals.as_ref()) == per(attributes.normals)
                && per(self.colors.as_ref()) == per(attributes.colors)
                && per(self.scalars.as_ref()) == per(attributes.scalars)
    }

    /// Adds the corners of a piece's triangles, and what they have. Its vertices alone could be
    /// many more than the triangles need; pages store equal corners, and equal values, once.
    fn push(&mut self, piece: &MeshSlices<'_>, attributes: &MeshAttributes<'_>) {
        let triangles = piece.triangles();
        for i in 0..triangles.indices.len() as u32 {
            let first = (self.positions.len() / 3) as u32;
            self.positions.extend(triangles.corners(i).iter().flat_map(|p| p.to_array()));
            self.indices.extend([first, first + 1, first + 2]);
        }
        append(&mut self.normals, attributes.normals, piece.indices);
        append(&mut self.colors, attributes.colors, piece.indices);
        append(&mut self.scalars, attributes.scalars, piece.indices);
    }
}

/// Appends what the corners `indices`, three a triangle, or the triangles have.
fn append<T: Copy + Default>(
    all: &mut Option<Attribute<T>>,
    piece: Option<&Attribute<T>>,
    indices: &[u32],
) {
    let Some(piece) = piece else { return };
    let all = all.get_or_insert_with(|| Attribute { per: piece.per, values: Vec::new() });
    match piece.per {
        // Corners that do not exist are those of triangles that are left out.
        PerElement::Vertex => all.values.extend(
            indices.iter().map(|&i| piece.values.get(i as usize).copied().unwrap_or_default()),
        ),
        PerElement::Face => all.values.extend_from_slice(&piece.values),
    }
}

fn unwritable(sink: &impl PageSink, reason: String) -> StoredMeshError {
    StoredMeshError::Io { name: sink.name(), reason }
}
