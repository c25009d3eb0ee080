//! Wavefront OBJ with its materials (MTL), read with the crate `tobj`.

use super::error::{At, BROKEN, Fault, read_bytes, sibling_path};
use super::obj_text::{self, Vertices};
use super::scene::{SceneMesh, SceneModel, SurfaceMaterial, decode_texture};
use super::{Content, LoadedFile, ReadError};
use crate::model::polygon::{Division, triangulate};
use glam::{DVec3, Vec2, Vec3};
use rt_core::mesh::{Attribute, TriMesh};
use std::cell::RefCell;
use std::path::Path;

pub(crate) const FORMAT: &str = "OBJ";

/// Reads a `.obj` file, the material files that it names and their image files.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_from_bytes(path, &read_bytes(path)?)
}

/// Reads the content of an `.obj` file; other files are resolved relative to `path`.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let warnings = RefCell::new(Vec::new());
    let options = tobj::LoadOptions {
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let load_material = |name: &Path| {
        let text = material_text(path, &name.to_string_lossy(), &mut warnings.borrow_mut());
        tobj::load_mtl_buf(&mut text.as_slice())
    };
    let (text, vertices) = obj_text::prepared(obj_text::decoded(bytes));
    if let Some((line, index)) = oversized_index(&text) {
        let what = format!("`{index}` cannot be the number of a vertex");
        return Err(Fault::new(At::Line(line), what, BROKEN).in_file(path, FORMAT));
    }
    let (models, materials) =
        tobj::load_obj_buf(&mut &*text, &options, load_material).map_err(|e| {
            let fault = match obj_text::first_fault(&text) {
                Some((line, what)) => Fault::new(At::Line(line), what, BROKEN),
                None => Fault::field("the OBJ text", e.to_string()),
            };
            fault.in_file(path, FORMAT)
        })?;
    if vertices.count == 0 && models.iter().all(|m| m.mesh.indices.is_empty()) {
        let what = "no vertices and no faces";
        let cure = "this is another kind of file, or its contents are missing";
        return Err(Fault::new(At::Byte(0), what, cure).in_file(path, FORMAT));
    }
    let mut warnings = warnings.into_inner();
    if (1..vertices.count).contains(&vertices.colored) {
        let Vertices { count, colored } = vertices;
        warnings.push(format!("colours left out: {colored} of {count} vertices have one"));
    }
    let mut scene = SceneModel::default();
    match materials {
        Ok(list) => list.iter().for_each(|m| add_material(m, path, &mut scene, &mut warnings)),
        Err(e) => warnings.push(format!("materials left out: {e}")),
    }
    // `tobj` skips points and lines, because they would corrupt the attributes of the surrounding
    // faces. They are counted here.
    let not_faces = text
        .split(|&b| b == b'\n')
        .filter(|l| l.starts_with(b"l ") || l.starts_with(b"p "))
        .count();
    let mut fanned = 0;
    for model in models {
        let material = model.mesh.material_id.filter(|&m| m < scene.materials.len());
        let mesh = triangles(&model, &mut fanned, &mut warnings);
        if let Err(e) = mesh.check() {
            let at = At::Field(format!("object `{}`", model.name));
            return Err(Fault::new(at, e.to_string(), BROKEN).in_file(path, FORMAT));
        }
        if mesh.num_triangles() > 0 {
            scene.meshes.push(SceneMesh { name: model.name, mesh, material });
        }
    }
    if not_faces > 0 {
        warnings.push(format!("{not_faces} points and lines left out: only faces are read"));
    } else if scene.meshes.is_empty() {
        warnings.push(format!("no faces: {} vertices left out", vertices.count));
    }
    if fanned > 0 {
        warnings.push(format!(
            "{fanned} faces cross themselves or are too large, and were divided as a fan"
        ));
    }
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Scene(scene),
        warnings,
        time_steps: Vec::new(),
    })
}

/// The text of the material files that a statement names: one, whose name may have blanks, or
/// several.
fn material_text(path: &Path, names: &str, warnings: &mut Vec<String>) -> Vec<u8> {
    let one = sibling_path(path, names);
    let files: Vec<_> = match one.is_file() {
        true => vec![one],
        false => names.split_whitespace().map(|name| sibling_path(path, name)).collect(),
    };
    let mut text = Vec::new();
    for file in files {
        match std::fs::read(&file) {
            Ok(bytes) => {
                let tell = |what| warnings.push(format!("{}: {what}", file.display()));
                text.extend(obj_text::prepared_materials(&bytes, tell));
                text.push(b'\n');
            }
            Err(e) => warnings.push(format!("materials of {} left out: {e}", file.display())),
        }
    }
    text
}

/// The first face index that does not fit in 32 bits, and its line. `tobj` 4.0.5 (`add_vertex`)
/// multiplies indices before it compares them with the number of vertices, so such indices overflow
/// and may become other ones.
fn oversized_index(bytes: &[u8]) -> Option<(u64, String)> {
    let digits_32_bits = 10;
    let lines = (1..).zip(bytes.split(|&b| b == b'\n'));
    let mut faces = lines.filter(|(_, l)| l.trim_ascii_start().starts_with(b"f"));
    faces.find_map(|(line, text)| {
        let mut numbers = text.split(|b| !b.is_ascii_digit());
        let long = numbers.find(|n| n.len() > digits_32_bits)?;
        Some((line, String::from_utf8_lossy(long).into_owned()))
    })
}

fn triangles(model: &tobj::Model, fanned: &mut usize, warnings: &mut Vec<String>) -> TriMesh {
    let m = &model.mesh;
    let positions: Vec<DVec3> =
        m.positions.as_chunks::<3>().0.iter().map(|&p| DVec3::from(p)).collect();
    let mut indices = Vec::new();
    let (mut at, mut corners) = (0, Vec::new());
    // Without arities all faces are triangles.
    let arities = m.face_arities.iter().map(|&n| n as usize);
    let all_triangles =
        std::iter::repeat_n(3, if m.face_arities.is_empty() { m.indices.len() / 3 } else { 0 });
    for n in arities.chain(all_triangles) {
        let Some(ids) = m.indices.get(at..at + n) else { break };
        at += n;

        corners.clear();
        corners
            .extend(ids.iter().map(|&k| positions.get(k as usize).copied().unwrap_or(DVec3::NAN)));
        let division = triangulate(&corners, |t| indices.push(t.map(|k| ids[k])));
        *fanned += usize::from(division == Division::Fanned);
    }
    let mut mesh = TriMesh::from_f64_positions(&positions, indices);
    let vertices = positions.len();
    let narrow = |c: &[f64; 3]| Vec3::new(c[0] as f32, c[1] as f32, c[2] as f32);
    if m.normals.len() == 3 * vertices && vertices > 0 {
        let normals = m.normals.as_chunks::<3>().0.iter().map(narrow);
        mesh.normals = Some(Attribute::per_vertex(normals.collect()));
    }
    if m.texcoords.len() == 2 * vertices && vertices > 0 {
        let pairs = m.texcoords.as_chunks::<2>().0.iter();
        mesh.texcoords = Some(pairs.map(|t| Vec2::new(t[0] as f32, t[1] as f32)).collect());
    }
    if m.vertex_color.len() == 3 * vertices && vertices > 0 {
        let colors =
            m.vertex_color.as_chunks::<3>().0.iter().map(|c| narrow(c).extend(1.0).to_array());
        mesh.colors = Some(Attribute::per_vertex(colors.collect()));
    }

    for (what, found, expected) in [
        ("normals", m.normals.len(), 3 * vertices),
        ("texture coordinates", m.texcoords.len(), 2 * vertices),
        ("colours", m.vertex_color.len(), 3 * vertices),
    ] {
        if found != 0 && found != expected {
            warnings.push(format!(
                "object `{}`: {what} left out: only some of its faces have them",
                model.name
            ));
        }
    }
    mesh
}

fn add_material(
    m: &tobj::Material,
    path: &Path,
    scene: &mut SceneModel,
    warnings: &mut Vec<String>,
) {
    let color = |c: Option<[f64; 3]>, default: f32| c.map_or([default; 3], |c| c.map(|x| x as f32));
    let extra = |name: &str| m.unknown_param.get(name).and_then(|v| v.trim().parse::<f32>().ok());
    let [r, g, b] = color(m.diffuse, 0.8);
    // Blinn-Phong exponent to GGX roughness: alpha² = 2/(n+2) (Walter et al. 2007, section 5.1) and
    // roughness² = alpha.
    let from_exponent = m.shininess.map(|n| (2.0 / (n.max(0.0) as f32 + 2.0)).powf(0.25));
    // `Tr` is the complement of `d`.
    let opacity = m.dissolve.map(|d| d as f32).or_else(|| extra("Tr").map(|t| 1.0 - t));
    let mut material = SurfaceMaterial {
        name: m.name.clone(),
        base_color: [r, g, b, opacity.unwrap_or(1.0)],
        metallic: extra("Pm").unwrap_or(0.0),
        roughness: extra("Pr").or(from_exponent).unwrap_or(1.0),
        emissive: color(m.emissive, 0.0),
        ior: m.optical_density.map_or(1.5, |n| n as f32),
        ..Default::default()
    };
    if let Some(name) = &m.diffuse_texture {
        // Options such as `-s 1 1 1` may come before the name.
        let file = sibling_path(path, name.split_whitespace().next_back().unwrap_or(name));
        let texture = std::fs::read(&file)
            .map_err(|e| e.to_string())
            .and_then(|b| decode_texture(name, &b, true));
        match texture {
            Ok(t) => {
                material.base_color_texture = Some(scene.textures.len());
                scene.textures.push(t);
            }
            Err(e) => warnings.push(format!("texture {} skipped: {e}", file.display())),
        }
    }
    scene.materials.push(material);
}
