//! Writes meshes as GLB: glTF 2.0 (Khronos, 2021) in one binary file, which browsers, Blender,
//! PowerPoint and CAD viewers display.

use super::{WriteError, write_file};
use glam::{DVec3, Vec3};
use rt_core::mesh::{PerElement, TriMesh};
use serde_json::{Value, json};
use std::path::Path;

// Numbers of the specification: section 3.6 (component types, buffer targets) and 4.4 (the
// container).
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;
const MAGIC: u32 = 0x4654_6C67;
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// Normals whose squared length deviates by at most this are written unchanged; the Khronos
/// validator allows more.
const UNIT_LENGTH_SQUARED: f32 = 1e-5;

/// Writes positions, triangles, and per-vertex normals, colours (linear, unchanged) and texture
/// coordinates, with one matt two-sided material. The mesh's origin becomes the node's translation,
/// which glTF stores in 32 bits; the remainder is added to the positions.
///
/// In glTF, y points up: other programs show data with z up rotated by 90 degrees. Content that
/// glTF cannot represent is rejected: scalars (map them to colours first), values per triangle,
/// coordinates that are not finite, normals without a direction.
/// finite, normals without a direction.
///
/// ```
/// use datasets::{generate::shapes, read, write::write_glb};
/// let mesh = shapes::icosphere(1);
/// let file = std::env::temp_dir().join(format!("doc-{}.glb", std::process::id()));
/// write_glb(&file, &mesh)?;
/// let read::Content::Scene(scene) = read::open(&file)?.content else { unreachable!() };
/// assert_eq!(scene.meshes[0].mesh, mesh);
/// # std::fs::remove_file(file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_glb(path: impl AsRef<Path>, mesh: &TriMesh) -> Result<(), WriteError> {
    let path = path.as_ref();
    let refused = |what: String, cure: &str| Err(WriteError::refused(path, what, cure));
    if let Some((what, cure)) = unsupported_content(mesh) {
        return refused(what, cure);
    }

    // The translation rounded to 32 bits; the remainder, at most half an ulp, is added to the
    // positions.
    let translation = mesh.origin.as_vec3();
    let rest = mesh.origin - translation.as_dvec3();
    let place = |p: &Vec3| if rest == DVec3::ZERO { *p } else { (rest + p.as_dvec3()).as_vec3() };
    let far = Vec3::INFINITY;
    let (lo, hi) =
        mesh.positions.iter().map(place).fold((far, -far), |(lo, hi), p| (lo.min(p), hi.max(p)));

    // Layout of the binary chunk: views and accessors in sequence.
    let mut parts = Layout::default();
    let n = mesh.positions.len();
    let positions = parts.add(n, FLOAT, "VEC3", VERTICES);
    parts.accessors[positions]["min"] = json!(lo.to_array());
    parts.accessors[positions]["max"] = json!(hi.to_array());
    let mut attributes = json!({ "POSITION": positions });
    if mesh.normals.is_some() {
        attributes["NORMAL"] = parts.add(n, FLOAT, "VEC3", VERTICES).into();
    }
    if mesh.texcoords.is_some() {
        attributes["TEXCOORD_0"] = parts.add(n, FLOAT, "VEC2", VERTICES).into();
    }
    if mesh.colors.is_some() {
        attributes["COLOR_0"] = parts.add(n, FLOAT, "VEC4", VERTICES).into();
    }
    let indices = parts.add(3 * mesh.indices.len(), UNSIGNED_INT, "SCALAR", INDICES);
    let sees_through = mesh.colors.as_ref().is_some_and(|c| c.values.iter().any(|c| c[3] < 1.0));
    let bytes = parts.bytes;
    let mut text = json!({
        "asset": { "version": "2.0", "generator": concat!("datasets ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": translation.to_array() }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }],
        "materials": [{
            "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            "alphaMode": if sees_through { "BLEND" } else { "OPAQUE" },
            "doubleSided": true,
        }],
        "buffers": [{ "byteLength": bytes }],
        "bufferViews": parts.views,
        "accessors": parts.accessors,
    })
    .to_string();
    while !text.len().is_multiple_of(4) {
        text.push(' ');
    }

    // A file header of 12 bytes, and 8 bytes before each of the two chunks.
    let whole = 12 + 8 + text.len() as u64 + 8 + bytes;
    let Ok(length) = u32::try_from(whole) else {
        return refused(
            format!("GLB ends at 4 GiB, and this mesh takes {whole} bytes"),
            "split it, or write PLY",
        );
    };
    write_file(path, |f| {
        let words = [MAGIC, 2, length, text.len() as u32, CHUNK_JSON];
        f.write_all(bytemuck::bytes_of(&words.map(u32::to_le_bytes)))?;
        f.write_all(text.as_bytes())?;
        f.write_all(bytemuck::bytes_of(&[bytes as u32, CHUNK_BIN].map(u32::to_le_bytes)))?;
        let mut floats =
            |values: &[f32]| values.iter().try_for_each(|v| f.write_all(&v.to_le_bytes()));
        mesh.positions.iter().try_for_each(|p| floats(&place(p).to_array()))?;
        let normals = mesh.normals.iter().flat_map(|a| &a.values);
        normals.into_iter().try_for_each(|v| floats(&unit(*v).to_array()))?;
        mesh.texcoords.iter().flatten().try_for_each(|t| floats(&t.to_array()))?;
        mesh.colors.iter().flat_map(|a| &a.values).try_for_each(|c| floats(c))?;
        mesh.indices
            .iter()
            .try_for_each(|t| f.write_all(bytemuck::bytes_of(&t.map(u32::to_le_bytes))))
    })
}

/// Why a mesh cannot be written, and how to fix that.
fn unsupported_content(mesh: &TriMesh) -> Option<(String, &'static str)> {
    if let Err(e) = mesh.check() {
        return Some((e.to_string(), "make the attributes as long as the mesh"));
    }
    let n = mesh.positions.len();
    if mesh.indices.is_empty() {
        return Some((
            "glTF has no meshes without triangles".into(),
            "write VTP or PLY, or leave it out",
        ));
    }
    if let Some(k) = mesh.indices.iter().flatten().find(|&&k| k as usize >= n) {
        return Some((format!("a triangle names vertex {k} of {n}"), "leave that triangle out"));
    }
    if mesh.scalars.is_some() {
        return Some((
            "glTF cannot hold scalars".into(),
            "write PLY or VTP, or map them to colours first",
        ));
    }
    let per_face = |per: Option<PerElement>| per == Some(PerElement::Face);
    if per_face(mesh.normals.as_ref().map(|a| a.per))
        || per_face(mesh.colors.as_ref().map(|a| a.per))
    {
        let cure = "write PLY or VTP, or give each triangle vertices of its own";
        return Some(("glTF cannot hold normals or colours per triangle".into(), cure));
    }
    if !mesh.origin.is_finite() {
        return Some((format!("its origin is {}", mesh.origin), "give it a finite origin"));
    }
    if let Some(i) = mesh.positions.iter().position(|p| !p.is_finite()) {
        let what = format!("vertex {i} is at {}; glTF requires finite numbers", mesh.positions[i]);
        return Some((what, "leave out the vertex and its triangles"));
    }
    let normals = mesh.normals.as_ref().map_or(&[][..], |a| &a.values);
    if let Some(i) = normals.iter().position(|v| v.try_normalize().is_none()) {
        let what = format!("the normal of vertex {i} is {}, which has no direction", normals[i]);
        return Some((what, "compute it, or leave out all normals"));
    }
    let texcoords = mesh.texcoords.as_deref().unwrap_or(&[]);
    if let Some(i) = texcoords.iter().position(|t| !t.is_finite()) {
        let what = format!("the texture coordinate of vertex {i} is {}", texcoords[i]);
        return Some((what, "give it finite numbers"));
    }
    let colors = mesh.colors.as_ref().map_or(&[][..], |a| &a.values);
    if let Some(i) = colors.iter().position(|c| !c.iter().all(|v| (0.0..=1.0).contains(v))) {
        let what = format!("the colour of vertex {i} is {:?}; glTF requires 0 to 1", colors[i]);
        return Some((what, "clamp the colours"));
    }
    None
}

fn unit(v: Vec3) -> Vec3 {
    if (v.length_squared() - 1.0).abs() <= UNIT_LENGTH_SQUARED { v } else { v.normalize() }
}

/// Views and accessors of the binary chunk; the size of every element is a multiple of four bytes.
#[derive(Default)]
struct Layout {
    views: Vec<Value>,
    accessors: Vec<Value>,
    bytes: u64,
}

impl Layout {
    /// Reserves space for `count` elements; returns the index of their accessor.
    fn add(&mut self, count: usize, component: u32, kind: &str, target: u32) -> usize {
        let components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let length = 4 * components * count as u64;
        self.views
            .push(json!({ "buffer": 0, "byteOffset": self.bytes, "byteLength": length, "target": target }));
        let view = self.views.len() - 1;
        self.accessors.push(
            json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }),
        );
        self.bytes += length;
        view
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::shapes::icosphere;
    use crate::read::{self, Content, SceneModel};
    use glam::Vec2;
    use rt_core::mesh::Attribute;

    /// A sphere with all attributes that glTF supports.
    fn full() -> TriMesh {
        let mut mesh = icosphere(2);
        let of =
            |f: &dyn Fn(Vec3) -> [f32; 4]| mesh.positions.iter().map(|&p| f(p)).collect::<Vec<_>>();
        let colors =
            of(&|p| [0.5 + 0.5 * p.x, 0.5 + 0.5 * p.y, 0.25, 1.0].map(|v: f32| v.clamp(0.0, 1.0)));
        let normals = mesh.positions.iter().map(|p| p.normalize()).collect();
        mesh.texcoords = Some(mesh.positions.iter().map(|p| Vec2::new(p.x, p.z)).collect());
        mesh.colors = Some(Attribute::per_vertex(colors));
        mesh.normals = Some(Attribute::per_vertex(normals));
        mesh.scalars = None;
        mesh
    }

    fn round_trip(mesh: &TriMesh) -> SceneModel {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.glb");
        write_glb(&path, mesh).unwrap();
        let opened = read::open(&path).unwrap();
        assert_eq!((opened.format, &opened.warnings), ("glTF", &vec![]));
        let Content::Scene(scene) = opened.content else { panic!("a mesh becomes a scene") };
        assert_eq!((scene.meshes.len(), scene.materials.len()), (1, 1));
        scene
    }

    #[test]
    fn a_mesh_read_back_is_the_same_bit_for_bit() {
        let bare = TriMesh { normals: None, colors: None, texcoords: None, ..full() };
        for mesh in [full(), bare] {
            assert_eq!(round_trip(&mesh).meshes[0].mesh, mesh);
        }
    }

    #[test]
    fn far_meshes_keep_their_shape() {
        let at = DVec3::new(4_500_000.3, -120_000.7, 12.0);
        let points: Vec<DVec3> = full().positions.iter().map(|p| at + p.as_dvec3()).collect();
        let mesh = TriMesh::from_f64_positions(&points, full().indices);
        for mesh in [mesh.clone(), TriMesh { origin: at, ..full() }] {
            let back = &round_trip(&mesh).meshes[0].mesh;
            for (a, b) in mesh.positions.iter().zip(&back.positions) {
                let (a, b) = (mesh.origin + a.as_dvec3(), back.origin + b.as_dvec3());
                assert!((a - b).length() < 1e-6, "{a} became {b}");
            }
        }
    }

    #[test]
    fn transparent_colours_and_long_normals_keep_their_meaning() {
        let mut mesh = full();
        let (normals, colors) = (mesh.normals.as_mut().unwrap(), mesh.colors.as_mut().unwrap());
        normals.values.iter_mut().for_each(|v| *v *= 40.0);
        colors.values[0][3] = 0.5;
        let back = round_trip(&mesh);
        assert_eq!(back.meshes[0].mesh.colors, mesh.colors);
        for (a, b) in full()
            .normals
            .unwrap()
            .values
            .iter()
            .zip(&back.meshes[0].mesh.normals.as_ref().unwrap().values)
        {
            assert!(a.distance(*b) < 1e-6, "{a} became {b}");
        }
    }

    #[test]
    fn what_gltf_cannot_hold_is_refused_with_a_cure_and_leaves_no_file() {
        let path = Path::new("never-written.glb");
        let nan = Vec3::new(0.0, f32::NAN, 0.0);
        let change = |f: &dyn Fn(&mut TriMesh)| {
            let mut m = full();
            f(&mut m);
            m
        };
        for (word, mesh) in [
            (
                "scalars",
                change(&|m| m.scalars = Some(Attribute::per_vertex(vec![0.0; m.positions.len()]))),
            ),
            ("vertex 99999", change(&|m| m.indices[3] = [0, 1, 99_999])),
            ("vertex 7 is at", change(&|m| m.positions[7] = nan)),
            ("normal of vertex 5", change(&|m| m.normals.as_mut().unwrap().values[5] = Vec3::ZERO)),
            ("colour of vertex 2", change(&|m| m.colors.as_mut().unwrap().values[2][1] = 1.5)),
            (
                "per triangle",
                change(&|m| m.colors = Some(Attribute::per_face(vec![[1.0; 4]; m.indices.len()]))),
            ),
            ("without triangles", change(&|m| m.indices.clear())),
        ] {
            let message = write_glb(path, &mesh).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("; "), "{word}: {message}");
        }
        assert!(!path.exists());
    }

    #[test]
    fn the_container_has_the_lengths_and_the_padding_of_the_specification() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.glb");
        write_glb(&path, &full()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!((&bytes[..4], word(4), word(8) as usize), (&b"glTF"[..], 2, bytes.len()));
        let json_length = word(12) as usize;
        assert_eq!((json_length % 4, &bytes[16..20]), (0, &b"JSON"[..]));
        let bin = 20 + json_length;
        assert_eq!(
            (word(bin) as usize, &bytes[bin + 4..bin + 8]),
            (bytes.len() - bin - 8, &b"BIN\0"[..])
        );
    }
}
