//! Writes a mesh to a file, piece by piece.

use super::error::StoredMeshError;
use super::format::{ENTRY_BYTES, HEADER_BYTES, Header, PageEntry, UNIT_BYTES, checksum};
use crate::bvh::build::UNWATCHED;
use crate::bvh::compact::{CompactBvh, divide};
use crate::bvh::layout::local_frame::LocalFrame;
use crate::bvh::layout::triangles::TriWriter;
use crate::bvh::options::BuildQuality;
use crate::math::Aabb;
use crate::mesh::MeshSlices;
use glam::DVec3;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Most triangles of a page: about 57 kB.
const PAGE_TRIANGLES: usize = 1 << 12;
/// Bytes of memory for each triangle that waits: its corners, their numbers and its own.
const WAITING_BYTES: usize = 52;
/// Bytes for triangles that wait, unless the caller chooses others.
const DEFAULT_MEMORY: usize = 1 << 30;
/// Pages that are built before they are written.
const PAGES_AT_ONCE: usize = 64;

/// Writes a mesh that need not fit into memory to a file that [`super::StoredMesh`] reads. The piece
/// at hand is in memory, and small pieces before it up to a limit
/// ([`StoredMeshWriter::set_memory`]).
///
/// What is written at once is divided among pages by place. So rays meet the fewest pages when
/// pieces that lie in the same place are written together: layers, for example, want memory for as
/// many of them as possible.
///
/// The file has another name, which ends in `.partial`, until [`StoredMeshWriter::finish`]. The
/// same pieces make the same bytes for any number of threads.
///
/// ```
/// use rt_core::bvh::{StoredMesh, StoredMeshWriter};
/// use rt_core::mesh::MeshSlices;
/// use rt_core::prelude::*;
/// use std::sync::Arc;
///
/// # let folder = std::env::temp_dir().join(format!("rt-core-stored-{}", std::process::id()));
/// # std::fs::create_dir_all(&folder)?;
/// let path = folder.join("plates.rtmesh");
/// let mut writer = StoredMeshWriter::create(&path, DVec3::ZERO)?;
/// for k in 0..3 {
///     let z = k as f32;
///     let corners = [0., 0., z, 4., 0., z, 0., 4., z];
///     writer.add(&MeshSlices::new(&corners, &[0, 1, 2]))?;
/// }
/// writer.finish()?;
///
/// let mesh = Arc::new(StoredMesh::open(&path, 64 << 20)?);
/// let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
/// let options = BuildOptions::default();
/// let world = World::build(vec![Geometry::Shape(mesh.clone())], vec![placed], &options)?;
/// let up = Ray::new(Vec3::new(1.0, 1.0, -1.0), Vec3::Z);
/// let hit = world.closest(&up).expect("a hit");
/// assert_eq!((hit.t, mesh.triangle(hit.prim, &up)), (1.0, Some(0)));
/// assert!(mesh.failure().is_none());
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct StoredMeshWriter {
    path: PathBuf,
    file: PartialFile,
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
    most_waiting: usize,
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
}

/// Triangles of small pieces, with their own vertices.
#[derive(Default)]
struct Waiting {
    positions: Vec<f32>,
    indices: Vec<u32>,
}

impl StoredMeshWriter {
    /// Starts a file. All positions are relative to `origin`; choose it near the middle.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(
        path: impl AsRef<Path>,
        origin: DVec3,
    ) -> Result<StoredMeshWriter, StoredMeshError> {
        if cfg!(target_endian = "big") {
            return Err(StoredMeshError::BigEndian);
        }
        let path = path.as_ref().to_path_buf();
        let io = |action, source| StoredMeshError::Io { path: path.clone(), action, source };
        let mut file = PartialFile::create(&path).map_err(|e| io("create it", e))?;
        // The header is written last.
        file.writer.write_all(&[0; HEADER_BYTES]).map_err(|e| io("write", e))?;
        Ok(StoredMeshWriter {
            path,
            file,
            origin,
            quality: BuildQuality::Balanced,
            pieces: 0,
            triangles: 0,
            skipped: 0,
            length: HEADER_BYTES as u64,
            table: Vec::new(),
            bounds: Aabb::EMPTY,
            waiting: Waiting::default(),
            most_waiting: DEFAULT_MEMORY / WAITING_BYTES,
        })
    }

    /// The quality of the trees from here on; balanced without it.
    pub fn set_quality(&mut self, quality: BuildQuality) {
        self.quality = quality;
    }

    /// Bytes that small pieces may take while they wait for others; 1 GiB without it.
    pub fn set_memory(&mut self, bytes: usize) {
        self.most_waiting = bytes / WAITING_BYTES;
    }

    /// Adds a piece. Its triangles get the numbers after those of the pieces before it. Triangles
    /// that cannot be hit are counted, and keep their numbers.
    ///
    /// # Errors
    /// When the piece is invalid or has another origin, or the file cannot be written.
    pub fn add(&mut self, piece: &MeshSlices<'_>) -> Result<(), StoredMeshError> {
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
        let small = piece.num_triangles() <= self.most_waiting;
        if !small || self.waiting.indices.len() / 3 + piece.num_triangles() > self.most_waiting {
            self.write_waiting()?;
        }
        if small {
            self.waiting.push(piece);
            return Ok(());
        }
        self.write(piece)
    }

    /// Writes what waits, the table and the header, and gives the file its name.
    ///
    /// # Errors
    /// When the file cannot be written, or the coordinates are too large or too small.
    pub fn finish(mut self) -> Result<StoredMeshReport, StoredMeshError> {
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
        };
        let path = self.path.clone();
        self.file.finish(&table, &header.bytes(), &path).map_err(|source| StoredMeshError::Io {
            path,
            action: "write",
            source,
        })?;
        Ok(StoredMeshReport {
            triangles: header.triangles,
            skipped: header.skipped,
            pages: header.pages,
            bytes: header.length,
        })
    }

    fn write_waiting(&mut self) -> Result<(), StoredMeshError> {
        let waiting = std::mem::take(&mut self.waiting);
        let mesh = MeshSlices {
            origin: self.origin,
            ..MeshSlices::new(&waiting.positions, &waiting.indices)
        };
        self.write(&mesh)
    }

    /// Builds the pages of a mesh and writes them.
    fn write(&mut self, mesh: &MeshSlices<'_>) -> Result<(), StoredMeshError> {
        let (mesh, count) = (mesh.triangles(), mesh.num_triangles());
        if count == 0 {
            return Ok(());
        }
        let frame = LocalFrame { center: self.origin, scale: 1.0 };
        let triangles = TriWriter::new(mesh, &frame, 0);
        let mut ids: Vec<u32> =
            (0..count as u32).filter(|&i| mesh.is_renderable(i as usize)).collect();
        self.skipped += (count - ids.len()) as u64;
        let watched = "nobody watches, so nobody stops it";
        let ends = divide(&mut ids, &triangles, PAGE_TRIANGLES, &UNWATCHED).expect(watched);
        let mut start = 0;
        let ranges: Vec<_> =
            ends.into_iter().map(|end| std::mem::replace(&mut start, end)..end).collect();
        for ranges in ranges.chunks(PAGES_AT_ONCE) {
            let build = |range: &std::ops::Range<usize>| {
                let ids = ids[range.clone()].to_vec();
                CompactBvh::of_triangles(&triangles, ids, self.quality, &UNWATCHED).expect(watched)
            };
            let trees: Vec<CompactBvh> = ranges.par_iter().map(build).collect();
            for (tree, range) in trees.iter().zip(ranges).filter(|(_, range)| !range.is_empty()) {
                self.write_page(tree, range.len() as u32)?;
            }
        }
        self.triangles += count as u64;
        Ok(())
    }

    fn write_page(&mut self, tree: &CompactBvh, triangles: u32) -> Result<(), StoredMeshError> {
        let most = u64::from(u32::MAX) - 1;
        if self.table.len() as u64 >= most {
            return Err(StoredMeshError::TooManyPages { found: most + 1, most });
        }
        let bytes: &[u8] = bytemuck::cast_slice(&tree.bvh.units);
        self.file.writer.write_all(bytes).map_err(|source| StoredMeshError::Io {
            path: self.path.clone(),
            action: "write",
            source,
        })?;
        self.table.push(PageEntry {
            offset: self.length,
            first: self.triangles,
            units: (bytes.len() as u64 / UNIT_BYTES) as u32,
            triangles,
            depth: tree.bvh.depth as u32,
            checksum: checksum(bytes),
            bounds: tree.bvh.bounds,
        });
        self.length += bytes.len() as u64;
        self.bounds = self.bounds.union(tree.bvh.bounds);
        Ok(())
    }
}

impl Waiting {
    /// Adds the corners of a piece's triangles. Its vertices alone could be many more than the
    /// triangles need; pages store equal corners once.
    fn push(&mut self, piece: &MeshSlices<'_>) {
        let piece = piece.triangles();
        for i in 0..piece.indices.len() as u32 {
            let first = (self.positions.len() / 3) as u32;
            self.positions.extend(piece.corners(i).iter().flat_map(|p| p.to_array()));
            self.indices.extend([first, first + 1, first + 2]);
        }
    }
}

/// A file with a name of its own until it is complete; removed when it never is.
struct PartialFile {
    writer: BufWriter<File>,
    path: PathBuf,
    complete: bool,
}

impl PartialFile {
    fn create(path: &Path) -> io::Result<PartialFile> {
        let invalid = || io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file");
        let mut name = path.file_name().ok_or_else(invalid)?.to_os_string();
        // Two processes that write the same file do not share one.
        name.push(format!(".{}.partial", std::process::id()));
        let path = path.with_file_name(name);
        let writer = BufWriter::with_capacity(1 << 20, File::create(&path)?);
        Ok(PartialFile { writer, path, complete: false })
    }

    fn finish(&mut self, table: &[u8], header: &[u8], path: &Path) -> io::Result<()> {
        self.writer.write_all(table)?;
        self.writer.seek(SeekFrom::Start(0))?;
        self.writer.write_all(header)?;
        self.writer.flush()?;
        std::fs::rename(&self.path, path)?;
        self.complete = true;
        Ok(())
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        if !self.complete {
            // What failed before has been reported; that the rest stays does not change it.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
