//! Caches generated meshes on disk, so that a benchmark generates its 300 million triangles only
//! once.
//!
//! The directory is `RTSV_CACHE`, else `rtsv` in the user's cache directory (`XDG_CACHE_HOME`, else
//! `~/.cache`). Files may be deleted at any time. A file that is damaged, or has another version or
//! byte order, is regenerated and reported to the caller. A full disk prevents caching but does not
//! lose the mesh.
//!
//! ```
//! use datasets::cache::{MeshCache, Origin};
//! use datasets::generate::shapes::cube;
//! let dir = std::env::temp_dir().join(format!("rtsv-doc-{}", std::process::id()));
//! let cache = MeshCache::at(&dir);
//! let first = cache.mesh("cube", || Ok::<_, std::io::Error>(cube()))?;
//! let second = cache.mesh("cube", || Ok::<_, std::io::Error>(cube()))?;
//! assert_eq!((first.origin, second.origin), (Origin::Generated, Origin::Read));
//! assert_eq!(first.mesh, second.mesh);
//! # std::fs::remove_dir_all(dir)?;
//! # Ok::<(), std::io::Error>(())
//! ```

mod format;

use crate::atomic_file::write_atomically;
use rt_core::mesh::TriMesh;
use std::fmt::{self, Display};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// A directory of meshes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeshCache {
    directory: PathBuf,
}

/// A mesh from [`MeshCache::mesh`].
#[derive(Debug, Clone, PartialEq)]
pub struct CachedMesh {
    /// The mesh.
    pub mesh: TriMesh,
    /// Source of the mesh.
    pub origin: Origin,
    /// Why the mesh could not be stored, if storing failed.
    pub not_stored: Option<String>,
}

/// Source of a mesh.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// Read from the file.
    Read,
    /// Generated because there was no file.
    Generated,
    /// Generated because the file could not be used, for the given reason. Callers should report
    /// it.
    Regenerated(String),
}

impl Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::Read => f.write_str("read from the cache"),
            Origin::Generated => f.write_str("generated"),
            Origin::Regenerated(reason) => write!(f, "generated again, because {reason}"),
        }
    }
}

impl MeshCache {
    /// The cache in `directory`, which is created on first use.
    pub fn at(directory: impl Into<PathBuf>) -> Self {
        MeshCache { directory: directory.into() }
    }

    /// The user's cache, as described in the module's documentation. `None` when the environment
    /// names no directory (neither `RTSV_CACHE` nor `XDG_CACHE_HOME` nor `HOME` is set).
    pub fn from_environment() -> Option<Self> {
        // Empty variables count as unset, as the XDG specification requires.
        let variable =
            |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        variable("RTSV_CACHE")
            .or_else(|| {
                variable("XDG_CACHE_HOME").filter(|p| p.is_absolute()).map(|p| p.join("rtsv"))
            })
            .or_else(|| variable("HOME").map(|p| p.join(".cache").join("rtsv")))
            .map(MeshCache::at)
    }

    /// Where the files are.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The file of a key.
    pub fn path(&self, key: &str) -> PathBuf {
        let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let readable: String = key.chars().take(80).map(safe).collect();
        // The checksum distinguishes keys that look the same after the replacement of characters.
        let mut crc = flate2::Crc::new();
        crc.update(key.as_bytes());
        self.directory.join(format!("{readable}-{:08x}-v{}.mesh", crc.sum(), format::VERSION))
    }

    /// Returns the mesh of `key`: read from the file if it exists and is intact, else generated and
    /// stored. `key` must name everything that determines the mesh (generator, parameters,
    /// attributes).
    pub fn mesh<E>(
        &self,
        key: &str,
        generate: impl FnOnce() -> Result<TriMesh, E>,
    ) -> Result<CachedMesh, E> {
        let path = self.path(key);
        let origin = match read(&path, key) {
            Ok(Some(mesh)) => {
                return Ok(CachedMesh { mesh, origin: Origin::Read, not_stored: None });
            }
            Ok(None) => Origin::Generated,
            Err(reason) => Origin::Regenerated(format!("{}: {reason}", path.display())),
        };
        let mesh = generate()?;
        let stored = std::fs::create_dir_all(&self.directory)
            .and_then(|()| write_atomically(&path, |w| format::write(w, key, &mesh)));
        let not_stored = stored.err().map(|e| format!("{}: {e}", path.display()));
        Ok(CachedMesh { mesh, origin, not_stored })
    }
}

/// Returns `None` when the file does not exist.
fn read(path: &Path, key: &str) -> Result<Option<TriMesh>, String> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(e.to_string()),
    };
    let length = file.metadata().map_err(|e| e.to_string())?.len();
    let reader = io::BufReader::with_capacity(1 << 20, file);
    format::read(reader, length, key).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::shapes::{closed_wavelet, cube};
    use glam::{DVec3, Vec2};
    use rt_core::mesh::Attribute;

    fn full_mesh() -> TriMesh {
        let mut m = closed_wavelet(15, 150.0).unwrap();
        m.origin = DVec3::new(1e7, -2.5, 0.1);
        m.scalars =
            Some(Attribute::per_vertex((0..m.positions.len()).map(|i| i as f32 * 0.5).collect()));
        m.colors = Some(Attribute::per_face(vec![[0.1, 0.2, 0.3, 1.0]; m.num_triangles()]));
        m.texcoords = Some(vec![Vec2::new(0.25, 0.5); m.positions.len()]);
        m
    }

    fn generate(cache: &MeshCache, mesh: &TriMesh) -> CachedMesh {
        cache.mesh("key/with:odd characters", || Ok::<_, ()>(mesh.clone())).unwrap()
    }

    #[test]
    fn everything_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        let cache = MeshCache::at(dir.path().join("made/when/needed"));
        for mesh in [full_mesh(), cube(), TriMesh::default()] {
            let path = cache.path("key/with:odd characters");
            let _ = std::fs::remove_file(&path);
            assert_eq!(
                generate(&cache, &mesh),
                CachedMesh { mesh: mesh.clone(), origin: Origin::Generated, not_stored: None }
            );
            let again = cache.mesh("key/with:odd characters", || Err(())).unwrap();
            assert_eq!(again, CachedMesh { mesh, origin: Origin::Read, not_stored: None });
            assert_eq!(
                std::fs::read_dir(path.parent().unwrap()).unwrap().count(),
                1,
                "no temporary file is left"
            );
        }
    }

    #[test]
    fn any_damage_is_detected_reported_and_repaired() {
        let dir = tempfile::tempdir().unwrap();
        let cache = MeshCache::at(dir.path());
        let mesh = full_mesh();
        generate(&cache, &mesh);
        let path = cache.path("key/with:odd characters");
        let whole = std::fs::read(&path).unwrap();
        let flipped = |at: usize| {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            bytes
        };
        let mut damaged: Vec<Vec<u8>> =
            [0, 5, 60, whole.len() / 2, whole.len() - 1].map(|n| whole[..n].to_vec()).into();
        damaged.extend(
            (0..120).chain([whole.len() / 3, whole.len() / 2, whole.len() - 1]).map(flipped),
        );
        damaged.push([&whole[..], &[0]].concat());
        for (i, bytes) in damaged.iter().enumerate() {
            std::fs::write(&path, bytes).unwrap();
            let found = generate(&cache, &mesh);
            assert!(
                matches!(&found.origin, Origin::Regenerated(why) if why.contains(".mesh")),
                "damage {i}: {}",
                found.origin
            );
            assert_eq!(found.mesh, mesh);
            assert_eq!(generate(&cache, &mesh).origin, Origin::Read, "damage {i} was repaired");
        }
    }

    #[test]
    fn similar_keys_have_different_files() {
        let cache = MeshCache::at("x");
        assert_ne!(cache.path("a/b"), cache.path("a:b"));
        assert_eq!(cache.path("../../etc/passwd").parent(), Some(Path::new("x")));
    }

    #[test]
    fn unwritable_directory_costs_the_cache_only() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        std::fs::write(&file, "in the way").unwrap();
        let found = generate(&MeshCache::at(file.join("below")), &cube());
        assert_eq!(found.mesh, cube());
        assert!(found.not_stored.is_some());
    }

    #[test]
    fn failed_generation_stores_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let cache = MeshCache::at(dir.path());
        assert_eq!(cache.mesh("k", || Err("no")), Err("no"));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
