//! glTF 2.0 (`.gltf` with its buffers, `.glb`): triangles, transforms, vertex colours,
//! metallic-roughness materials with all their textures.
//!
//! The crate `gltf` checks the JSON. Accessors are decoded here, because every offset and count has
//! to be checked against the buffers. Morph targets have the weights of the file. Not read:
//! animation, skins, cameras, lights, compressed meshes; extensions of materials except the index
//! of refraction and the strength of emission.

mod accessors;
mod materials;

use super::base64::Decoder;
use super::error::{At, BROKEN, Fault, read_bytes, sibling_path};
use super::percent::decoded;
use super::scene::{SceneMesh, SceneModel};
use super::{Content, LoadedFile, ReadError};
use glam::{DMat3, DMat4, DVec3, Vec2, Vec3, Vec4};
use gltf::accessor::Dimensions;
use gltf::mesh::{Mode, Semantic};
use rt_core::mesh::{Attribute, TriMesh};
use std::path::Path;

pub(crate) const FORMAT: &str = "glTF";

/// Magic, version and length at the beginning of a `.glb` file.
const GLB_HEADER_BYTES: u32 = 12;

/// Supported extensions of glTF 2.0.
const EXTENSIONS: [&str; 3] = ["KHR_materials_ior", "KHR_materials_emissive_strength", QUANTIZED];
/// Integers for positions, normals and texture coordinates.
const QUANTIZED: &str = "KHR_mesh_quantization";

/// Maximum number of triangles in a scene. One mesh may appear many times, so larger scenes are
/// rejected.
const MAX_TRIANGLES: usize = 1 << 28;

/// Reads a `.gltf` or `.glb` file with the files it names.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_from_bytes(path, &read_bytes(path)?)
}

/// Reads the content of a file; other files are resolved relative to `path`.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let gltf = checked(bytes).map_err(fault)?;
    let buffers = buffers(path, &gltf)?;
    let mut reader = Reader {
        buffers,
        scene: SceneModel::default(),
        warnings: Vec::new(),
        triangles: 0,
        visited: Vec::new(),
    };
    reader.visited.resize(gltf.nodes().len(), false);
    reader.materials(path, &gltf);
    // Without a scene, all nodes without a parent are shown.
    let roots: Vec<gltf::Node<'_>> = match gltf.default_scene().or_else(|| gltf.scenes().next()) {
        Some(scene) => scene.nodes().collect(),
        None => {
            let mut is_child = vec![false; gltf.nodes().len()];
            gltf.nodes().flat_map(|n| n.children()).for_each(|c| is_child[c.index()] = true);
            gltf.nodes().filter(|n| !is_child[n.index()]).collect()
        }
    };
    let mut stack: Vec<(gltf::Node<'_>, DMat4)> =
        roots.into_iter().rev().map(|n| (n, DMat4::IDENTITY)).collect();
    while let Some((node, parent)) = stack.pop() {
        // glTF requires trees; a node visited twice would make a cycle.
        if std::mem::replace(&mut reader.visited[node.index()], true) {
            let what = format!("node {} has two parents", node.index());
            return Err(fault(Fault::field("nodes", what)));
        }
        let local = DMat4::from_cols_array(
            &node
                .transform()
                .matrix()
                .as_flattened()
                .iter()
                .map(|&x| f64::from(x))
                .collect::<Vec<_>>()
                .try_into()
                .unwrap_or([0.0; 16]),
        );
        let world_from_node = parent * local;
        if let Some(mesh) = node.mesh() {
            let weights = node.weights().or(mesh.weights()).unwrap_or(&[]);
            reader.mesh(&mesh, node.name(), weights, world_from_node).map_err(fault)?;
        }
        stack.extend(node.children().map(|c| (c, world_from_node)));
    }
    for (what, n) in [("animations", gltf.animations().len()), ("skins", gltf.skins().len())] {
        if n > 0 {
            reader.warnings.push(format!("{n} {what} left out: the rest pose is shown"));
        }
    }
    let not_read: Vec<&str> = gltf.extensions_used().filter(|e| !EXTENSIONS.contains(e)).collect();
    if !not_read.is_empty() {
        reader.warnings.push(format!("extensions that are not read: {}", not_read.join(", ")));
    }
    let Reader { scene, warnings, .. } = reader;
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Scene(scene),
        warnings,
        time_steps: Vec::new(),
    })
}

/// Parses the scene with the crate's own checks. They index the accessors of primitives before
/// those are checked (gltf-json 1.4.1, mesh.rs), and subtract the header from the length of a
/// `.glb` file before they examine it (gltf 1.4.1, binary.rs), so both are checked here first.
fn checked(bytes: &[u8]) -> Result<gltf::Gltf, Fault> {
    if let Some([magic, _, length]) = bytes.as_chunks::<4>().0.first_chunk::<3>()
        && magic == b"glTF"
        && u32::from_le_bytes(*length) < GLB_HEADER_BYTES
    {
        let what = format!("the file's length is given as {} bytes", u32::from_le_bytes(*length));
        return Err(Fault::new(At::Byte(8), what, BROKEN));
    }
    let fault = |e: gltf::Error| {
        not_read_here(bytes).unwrap_or_else(|| {
            let cure = "check it with the Khronos glTF validator";
            Fault::new(At::Field("the JSON part".into()), e.to_string(), cure)
        })
    };
    let gltf::Gltf { document, blob } =
        gltf::Gltf::from_slice_without_validation(bytes).map_err(fault)?;
    let json = document.into_json();
    let accessors = json.accessors.len();
    let attributes =
        json.meshes.iter().flat_map(|m| &m.primitives).flat_map(|p| p.attributes.values());
    if let Some(bad) = attributes.map(|a| a.value()).find(|&a| a >= accessors) {
        return Err(Fault::field("meshes", format!("accessor {bad} of {accessors}")));
    }
    let document = match gltf::Document::from_json(json.clone()) {
        // Many programs leave the bounds of positions out. They are not used here.
        Err(gltf::Error::Validation(faults))
            if faults.iter().all(|f| is_missing_bound(f) || is_of_appearance(f)) =>
        {
            gltf::Document::from_json_without_validation(json)
        }
        checked => checked.map_err(fault)?,
    };
    Ok(gltf::Gltf { document, blob })
}

/// True for bounds of positions that are not given.
fn is_missing_bound((path, fault): &(gltf::json::Path, gltf::json::validation::Error)) -> bool {
    use gltf::json::validation::Error;
    let path = path.to_string();
    matches!(fault, Error::Missing)
        && [".min", ".max"].iter().any(|end| path.ends_with(&format!("[\"POSITION\"]{end}")))
}

/// True for a required extension without which the shape is the same: quantised attributes are
/// read, and what materials and textures lose is told.
fn is_of_appearance((path, fault): &(gltf::json::Path, gltf::json::validation::Error)) -> bool {
    // `extensionsRequired[0] = "KHR_..."`
    let path = path.to_string();
    let name = path.split('"').nth(1).filter(|_| path.starts_with("extensionsRequired["));
    let same_shape = |name: &str| {
        name == QUANTIZED || name.starts_with("KHR_materials_") || name.starts_with("KHR_texture_")
    };
    matches!(fault, gltf::json::validation::Error::Unsupported) && name.is_some_and(same_shape)
}

/// What a file is that the crate does not take, if it is known.
fn not_read_here(bytes: &[u8]) -> Option<Fault> {
    const OLD: &str = "glTF 1.0";
    let convert = "convert it to glTF 2.0, for example with gltf-pipeline";
    let json = match bytes.strip_prefix(b"glTF") {
        Some([1, 0, 0, 0, ..]) => {
            return Some(Fault::unsupported(At::Byte(4), OLD, convert));
        }
        // The first chunk is the JSON part.
        Some(rest) => {
            let length = u32::from_le_bytes(*rest.get(8..)?.first_chunk()?) as usize;
            rest.get(16..)?.get(..length)?
        }
        None => bytes,
    };
    let json: serde_json::Value = serde_json::from_slice(json).ok()?;
    let version = json["asset"]["version"].as_str().unwrap_or("");
    if version.starts_with("1.") || json["meshes"].is_object() {
        return Some(Fault::unsupported(At::Field("asset".into()), OLD, convert));
    }
    let required = json["extensionsRequired"].as_array()?.iter().filter_map(|e| e.as_str());
    let packed = required.into_iter().find(|name| name.ends_with("_compression"))?;
    Some(Fault::unsupported(
        At::Field("extensionsRequired".into()),
        format!("meshes packed by {packed}"),
        "save it without compression, for example with Blender",
    ))
}

/// The bytes of every buffer.
fn buffers(path: &Path, gltf: &gltf::Gltf) -> Result<Vec<Vec<u8>>, ReadError> {
    gltf.buffers()
        .map(|b| match b.source() {
            gltf::buffer::Source::Bin => Ok(gltf.blob.clone().unwrap_or_default()),
            gltf::buffer::Source::Uri(uri) => resource(path, uri),
        })
        .collect()
}

/// Resolves a URI: embedded data, or a file relative to `path`.
fn resource(path: &Path, uri: &str) -> Result<Vec<u8>, ReadError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let fault = |what: &str| Fault::field("a data URI", what).in_file(path, FORMAT);
        let Some((_, text)) = data.split_once(";base64,") else {
            return Err(fault("it is not base64"));
        };
        let mut out = Vec::new();
        return match Decoder::new(text.as_bytes()).fill(&mut out, usize::MAX) {
            Ok(()) => Ok(out),
            Err(bad) => Err(fault(&format!("byte {:#04x} is not base64", bad.byte))),
        };
    }
    read_bytes(&sibling_path(path, &decoded(uri)))
}

struct Reader {
    buffers: Vec<Vec<u8>>,
    scene: SceneModel,
    warnings: Vec<String>,
    triangles: usize,
    visited: Vec<bool>,
}

impl Reader {
    fn mesh(
        &mut self,
        mesh: &gltf::Mesh<'_>,
        node_name: Option<&str>,
        weights: &[f32],
        world_from_node: DMat4,
    ) -> Result<(), Fault> {
        for primitive in mesh.primitives() {
            let name = node_name.or(mesh.name()).unwrap_or("").to_string();
            if let Some(built) = self.primitive(&primitive, &name, weights, world_from_node)? {
                self.triangles = self.triangles.saturating_add(built.num_triangles());
                if self.triangles > MAX_TRIANGLES {
                    let what = format!("more than {MAX_TRIANGLES} triangles in all instances");
                    return Err(Fault::new(
                        At::Field("the scene".into()),
                        what,
                        "split the scene into several files",
                    ));
                }
                let material = primitive.material().index();
                self.scene.meshes.push(SceneMesh { name, mesh: built, material });
            }
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        p: &gltf::Primitive<'_>,
        name: &str,
        weights: &[f32],
        world_from_node: DMat4,
    ) -> Result<Option<TriMesh>, Fault> {
        let mode = p.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.warnings.push(format!("`{name}`: {mode:?} left out: only triangles are read"));
            return Ok(None);
        }
        let Some(accessor) = p.get(&Semantic::Positions) else { return Ok(None) };
        let place = format!("positions of `{name}`");
        let targets = p.morph_targets().map(|t| t.positions()).zip(weights.iter().copied());
        let positions: Vec<DVec3> = self
            .morphed(&accessor, targets, &place)?
            .iter()
            .map(|p| world_from_node.transform_point3(DVec3::from(p.map(f64::from))))
            .collect();
        let n = positions.len();

        let ids: Vec<u32> = match p.indices() {
            Some(a) => self.indices(&a, name)?,
            None => (0..n as u32).collect(),
        };
        let mut triangles: Vec<[u32; 3]> = match mode {
            Mode::Triangles => ids.as_chunks::<3>().0.to_vec(),
            Mode::TriangleStrip => {
                let turned = |(i, w): (usize, &[u32])| {
                    if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }
                };
                ids.windows(3).enumerate().map(turned).collect()
            }
            _ => ids.windows(2).skip(1).map(|w| [ids[0], w[0], w[1]]).collect(),
        };
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(|&k| (k as usize) < n));
        if triangles.len() < before {
            let dropped = before - triangles.len();
            self.warnings.push(format!(
                "`{name}`: {dropped} triangles left out: they name vertices that do not exist"
            ));
        }
        // A reflection reverses the orientation of triangles (glTF 2.0, section 3.7.4).
        if world_from_node.determinant() < 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let mut mesh = TriMesh::from_f64_positions(&positions, triangles);

        let one_per_vertex = |found: usize, what: &str| {
            if found == n {
                Ok(())
            } else {
                Err(Fault::field(
                    format!("{what} of `{name}`"),
                    format!("{found} values for {n} vertices"),
                ))
            }
        };
        if let Some(a) = p.get(&Semantic::Normals) {
            let targets = p.morph_targets().map(|t| t.normals()).zip(weights.iter().copied());
            let normals = self.morphed(&a, targets, &format!("normals of `{name}`"))?;
            one_per_vertex(normals.len(), "normals")?;
            // Normals transform by the inverse transpose; the matrix of cofactors is proportional
            // to it and needs no division that may fail.
            let m = DMat3::from_mat4(world_from_node);
            let cofactors = DMat3::from_cols(
                m.y_axis.cross(m.z_axis),
                m.z_axis.cross(m.x_axis),
                m.x_axis.cross(m.y_axis),
            );
            let sign = if world_from_node.determinant() < 0.0 { -1.0 } else { 1.0 };
            // Normals that are not rotated keep every bit.
            let turned = |v: &[f32; 3]| {
                let v = Vec3::from(*v);
                if m == DMat3::IDENTITY && v.is_finite() {
                    return v;
                }
                (sign * (cofactors * v.as_dvec3())).normalize_or_zero().as_vec3()
            };
            mesh.normals = Some(Attribute::per_vertex(normals.iter().map(turned).collect()));
        }
        if let Some(a) = p.get(&Semantic::TexCoords(0)) {
            let t = self.tuples::<2>(&a, &format!("texture coordinates of `{name}`"))?;
            one_per_vertex(t.len(), "texture coordinates")?;
            mesh.texcoords = Some(t.into_iter().map(Vec2::from).collect());
        }
        if let Some(a) = p.get(&Semantic::Tangents) {
            let tangents = self.tuples::<4>(&a, &format!("tangents of `{name}`"))?;
            one_per_vertex(tangents.len(), "tangents")?;
            let m = DMat3::from_mat4(world_from_node);
            // Tangents lie in the surface and transform with it; a reflection reverses the frame's
            // handedness.
            let sense = if world_from_node.determinant() < 0.0 { -1.0 } else { 1.0 };
            let turned = |&[x, y, z, w]: &[f32; 4]| {
                let t = (m * Vec3::new(x, y, z).as_dvec3()).normalize_or_zero().as_vec3();
                Vec4::from((t, if w < 0.0 { -sense } else { sense }))
            };
            mesh.tangents = Some(tangents.iter().map(turned).collect());
        }
        if let Some(a) = p.get(&Semantic::Colors(0)) {
            let place = format!("colours of `{name}`");
            let colors: Vec<[f32; 4]> = if a.dimensions() == Dimensions::Vec4 {
                self.tuples::<4>(&a, &place)?
            } else {
                self.tuples::<3>(&a, &place)?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
            };
            one_per_vertex(colors.len(), "colours")?;
            mesh.colors = Some(Attribute::per_vertex(colors));
        }
        mesh.check().map_err(|e| Fault::field(format!("mesh `{name}`"), e.to_string()))?;
        Ok(Some(mesh))
    }

    /// An attribute with the displacements of morph targets, each times its weight (glTF 2.0,
    /// section 3.7.2.2).
    fn morphed<'a>(
        &self,
        base: &gltf::Accessor<'_>,
        targets: impl Iterator<Item = (Option<gltf::Accessor<'a>>, f32)>,
        place: &str,
    ) -> Result<Vec<[f32; 3]>, Fault> {
        let mut values = self.tuples::<3>(base, place)?;
        for (target, weight) in targets {
            let Some(target) = target.filter(|_| weight != 0.0) else { continue };
            let moves = self.tuples::<3>(&target, &format!("morph target of {place}"))?;
            if moves.len() != values.len() {
                let what = format!("{} values for {} vertices", moves.len(), values.len());
                return Err(Fault::field(format!("morph target of {place}"), what));
            }
            for (value, by) in values.iter_mut().zip(moves) {
                (0..3).for_each(|k| value[k] += weight * by[k]);
            }
        }
        Ok(values)
    }
}
