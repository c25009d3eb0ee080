//! Meshes with materials and textures, as in OBJ and glTF files.

use rt_core::mesh::TriMesh;
use rt_core::texture::{Filter, Wrap};

/// A scene out of a file; positions are world positions, transforms are applied.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneModel {
    /// The meshes.
    pub meshes: Vec<SceneMesh>,
    /// The materials they refer to.
    pub materials: Vec<SurfaceMaterial>,
    /// The textures that materials refer to.
    pub textures: Vec<Texture>,
}

impl SceneModel {
    /// Triangles of all meshes.
    pub fn num_triangles(&self) -> usize {
        self.meshes.iter().map(|m| m.mesh.num_triangles()).sum()
    }
}

/// One mesh with one material.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneMesh {
    /// Its name in the file.
    pub name: String,
    /// The triangles.
    pub mesh: TriMesh,
    /// Index into [`SceneModel::materials`].
    pub material: Option<usize>,
}

/// What the opacity of a material means (glTF 2.0, section 3.9.4).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: all of it is seen.
    Opaque,
    /// Below this number nothing is seen, else all.
    Mask(f32),
    /// The share of light that is stopped.
    #[default]
    Blend,
}

/// How a surface looks, in the terms of glTF's metallic-roughness model. Colours are linear RGB(A).
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceMaterial {
    /// Its name in the file.
    pub name: String,
    /// Base colour and opacity.
    pub base_color: [f32; 4],
    /// Index into [`SceneModel::textures`], sRGB with alpha; multiplies `base_color`.
    pub base_color_texture: Option<usize>,
    /// What the opacity means.
    pub alpha: AlphaMode,
    /// 0 = dielectric, 1 = metal.
    pub metallic: f32,
    /// 0 = mirror, 1 = matt.
    pub roughness: f32,
    /// Index of a texture whose green multiplies `roughness` and whose blue multiplies `metallic`;
    /// linear.
    pub metallic_roughness_texture: Option<usize>,
    /// Index of a texture of normals: 2 rgb - 1 along tangent, its partner and normal; linear.
    pub normal_texture: Option<usize>,
    /// Factor on the first two components of those.
    pub normal_scale: f32,
    /// Index of a texture whose red is the share of ambient light that gets in; linear.
    pub occlusion_texture: Option<usize>,
    /// 0 for none of that, 1 for all.
    pub occlusion_strength: f32,
    /// Light given off.
    pub emissive: [f32; 3],
    /// Index of a texture that multiplies `emissive`, sRGB.
    pub emissive_texture: Option<usize>,
    /// Refractive index.
    pub ior: f32,
    /// Seen from both sides.
    pub double_sided: bool,
}

impl Default for SurfaceMaterial {
    fn default() -> Self {
        SurfaceMaterial {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            alpha: AlphaMode::Blend,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: [0.0; 3],
            emissive_texture: None,
            ior: 1.5,
            double_sided: true,
        }
    }
}

/// A texture and how it is sampled: 8 bits per channel, first row at the top. Colours are sRGB with
/// linear alpha; all other material inputs are linear.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// Its name or file.
    pub name: String,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels.
    pub rgba8: Vec<[u8; 4]>,
    /// True when texture coordinate v = 0 is the lower edge (OBJ), false when it is the upper edge
    /// (glTF).
    pub v_up: bool,
    /// Horizontal and vertical behaviour outside 0..=1.
    pub wrap: [Wrap; 2],
    /// How texels are combined.
    pub filter: Filter,
}

/// Pictures with more bytes than this when unpacked are refused: a few compressed bytes can declare
/// any size.
const MAX_TEXTURE_BYTES: u64 = 1 << 30;

/// Decodes PNG or JPEG bytes.
pub(crate) fn decode_texture(name: &str, bytes: &[u8], v_up: bool) -> Result<Texture, String> {
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    // An image of one colour compresses about 1:1000; the added megabyte leaves room for small
    // ones.
    limits.max_alloc =
        Some(MAX_TEXTURE_BYTES.min((bytes.len() as u64).saturating_mul(2048) + (1 << 20)));
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| e.to_string())?.to_rgba8();
    let (width, height) = picture.dimensions();
    let (pixels, _) = picture.as_raw().as_chunks::<4>();
    Ok(Texture {
        name: name.into(),
        width,
        height,
        rgba8: pixels.to_vec(),
        v_up,
        wrap: Default::default(),
        filter: Default::default(),
    })
}
