//! The cache's file format: a small header, plain arrays and a checksum. The cache is private to
//! one machine, so numbers are in native byte order; a marker detects files of the other order.
//!
//! | part | content |
//! |---|---|
//! | header | magic, version, byte-order marker, length of the key, key, origin (3 f64), number of sections |
//! | sections | tag, 0 per vertex or 1 per triangle, number of bytes; then the array |
//! | end | CRC-32 of all before |

use bytemuck::{Pod, bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};
use glam::{DVec3, Vec3};
use rt_core::mesh::{Attribute, PerElement, TriMesh};
use std::io::{self, Read, Write};

/// Format version, which is also part of the file name. Increase it when the format *or a
/// generator's output* changes.
pub(super) const VERSION: u32 = 1;

const MAGIC: [u8; 8] = *b"RTSVMESH";
const BYTE_ORDER: u32 = 0x0102_0304;
/// Number of bytes between two checksum updates.
const CHUNK_BYTES: usize = 1 << 20;

const POSITIONS: u32 = 1;
const INDICES: u32 = 2;
const NORMALS: u32 = 3;
const COLORS: u32 = 4;
const SCALARS: u32 = 5;
const TEXCOORDS: u32 = 6;

pub(super) fn write(out: &mut dyn Write, key: &str, mesh: &TriMesh) -> io::Result<()> {
    let mut w = ChecksumStream { inner: out, crc: flate2::Crc::new() };
    w.put(&MAGIC)?;
    w.put(bytes_of(&[VERSION, BYTE_ORDER, key.len() as u32]))?;
    w.put(key.as_bytes())?;
    w.put(bytes_of(&mesh.origin.to_array()))?;
    let optional = [
        mesh.normals.is_some(),
        mesh.colors.is_some(),
        mesh.scalars.is_some(),
        mesh.texcoords.is_some(),
    ];
    w.put(bytes_of(&(2 + optional.iter().filter(|&&p| p).count() as u32)))?;

    let per = |p: PerElement| p as u32;
    w.section(POSITIONS, 0, &mesh.positions)?;
    w.section(INDICES, 1, &mesh.indices)?;
    if let Some(a) = &mesh.normals {
        w.section(NORMALS, per(a.per), &a.values)?;
    }
    if let Some(a) = &mesh.colors {
        w.section(COLORS, per(a.per), &a.values)?;
    }
    if let Some(a) = &mesh.scalars {
        w.section(SCALARS, per(a.per), &a.values)?;
    }
    if let Some(t) = &mesh.texcoords {
        w.section(TEXCOORDS, 0, t)?;
    }
    let sum = w.crc.sum();
    w.inner.write_all(&sum.to_ne_bytes())
}

/// `length` is the length of the file. Arrays that exceed it are rejected before memory is
/// allocated.
pub(super) fn read(input: impl Read, length: u64, key: &str) -> Result<TriMesh, String> {
    let mut r = ChecksumStream { inner: input, crc: flate2::Crc::new() };
    let mut magic = [0u8; 8];
    r.get(&mut magic)?;
    if magic != MAGIC {
        return Err("not a mesh of this cache".into());
    }
    let [version, order, key_length]: [u32; 3] = r.value()?;
    if (version, order) != (VERSION, BYTE_ORDER) {
        return Err(format!(
            "version {version} and byte order {order:#x} instead of {VERSION} and {BYTE_ORDER:#x}"
        ));
    }
    let mut stored_key = vec![0; (key_length as usize).min(1 << 16)];
    r.get(&mut stored_key)?;
    if stored_key != key.as_bytes() {
        return Err(format!("holds `{}`, not `{key}`", String::from_utf8_lossy(&stored_key)));
    }
    let mut mesh = TriMesh { origin: DVec3::from_array(r.value()?), ..Default::default() };
    let sections: u32 = r.value()?;
    for _ in 0..sections {
        let [tag, per]: [u32; 2] = r.value()?;
        let bytes: u64 = r.value()?;
        if bytes > length {
            return Err(format!("an array of {bytes} bytes in a file of {length}"));
        }
        let per = if per == 0 { PerElement::Vertex } else { PerElement::Face };
        match tag {
            POSITIONS => mesh.positions = r.array(bytes)?,
            INDICES => mesh.indices = r.array(bytes)?,
            NORMALS => mesh.normals = Some(Attribute { per, values: r.array::<Vec3>(bytes)? }),
            COLORS => mesh.colors = Some(Attribute { per, values: r.array(bytes)? }),
            SCALARS => mesh.scalars = Some(Attribute { per, values: r.array(bytes)? }),
            TEXCOORDS => mesh.texcoords = Some(r.array(bytes)?),
            _ => return Err(format!("unknown array {tag}")),
        }
    }
    let expected = r.crc.sum();
    let mut found = [0u8; 4];
    r.get(&mut found)?;
    if u32::from_ne_bytes(found) != expected {
        return Err("wrong checksum".into());
    }
    if r.inner.read(&mut [0]).map_err(|e| e.to_string())? != 0 {
        return Err("bytes after the end".into());
    }
    Ok(mesh)
}

/// A reader or writer that computes the checksum of all bytes that pass through it.
struct ChecksumStream<T> {
    inner: T,
    crc: flate2::Crc,
}

impl ChecksumStream<&mut dyn Write> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        for chunk in bytes.chunks(CHUNK_BYTES) {
            self.crc.update(chunk);
            self.inner.write_all(chunk)?;
        }
        Ok(())
    }

    fn section<T: Pod>(&mut self, tag: u32, per: u32, values: &[T]) -> io::Result<()> {
        let bytes: &[u8] = cast_slice(values);
        self.put(bytes_of(&[tag, per]))?;
        self.put(bytes_of(&(bytes.len() as u64)))?;
        self.put(bytes)
    }
}

impl<R: Read> ChecksumStream<R> {
    fn get(&mut self, bytes: &mut [u8]) -> Result<(), String> {
        for chunk in bytes.chunks_mut(CHUNK_BYTES) {
            self.inner.read_exact(chunk).map_err(|e| match e.kind() {
                io::ErrorKind::UnexpectedEof => "the file ends too early".to_string(),
                _ => e.to_string(),
            })?;
            self.crc.update(chunk);
        }
        Ok(())
    }

    fn value<T: Pod>(&mut self) -> Result<T, String> {
        let mut v = T::zeroed();
        self.get(bytes_of_mut(&mut v))?;
        Ok(v)
    }

    fn array<T: Pod>(&mut self, bytes: u64) -> Result<Vec<T>, String> {
        let size = size_of::<T>() as u64;
        if !bytes.is_multiple_of(size) {
            return Err(format!("an array of {bytes} bytes with elements of {size}"));
        }
        let mut values: Vec<T> = bytemuck::allocation::zeroed_vec((bytes / size) as usize);
        self.get(cast_slice_mut(&mut values))?;
        Ok(values)
    }
}
