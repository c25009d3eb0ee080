//! Meshes with materials and textures, as in OBJ and glTF files.

use rt_core::mesh::TriMesh;
use rt_core::texture::{Filter, Wrap};

/// A scene from a file. Transforms are applied, so positions are world positions.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneModel {
    /// The meshes.
    pub meshes: Vec<SceneMesh>,
    /// The materials that the meshes refer to.
    pub materials: Vec<SurfaceMaterial>,
    /// The images that the materials refer to.
    pub textures: Vec<Texture>,
}

impl SceneModel {
    /// Number of triangles in all meshes.
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

/// How the opacity of a material is interpreted (glTF 2.0, section 3.9.4).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum AlphaMode {
    /// Ignored: the surface is opaque.
    Opaque,
    /// Transparent below this number, opaque otherwise.
    Mask(f32),
    /// The fraction of light that is blocked.
    #[default]
    Blend,
}

/// The appearance of a surface, in glTF's metallic-roughness model. Colours are linear RGB(A).
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceMaterial {
    /// Its name in the file.
    pub name: String,
    /// Base colour and opacity.
    pub base_color: [f32; 4],
    /// Index into [`SceneModel::textures`], sRGB with alpha; multiplies `base_color`.
    pub base_color_texture: Option<usize>,
    /// How the opacity is interpreted.
    pub alpha: AlphaMode,
    /// 0 = dielectric, 1 = metal.
    pub metallic: f32,
    /// 0 = mirror, 1 = fully rough.
    pub roughness: f32,
    /// Index of a linear texture whose green channel multiplies `roughness` and whose blue channel
    /// multiplies `metallic`.
    pub metallic_roughness_texture: Option<usize>,
    /// Index of a linear normal map: 2 rgb - 1 along tangent, bitangent and normal.
    pub normal_texture: Option<usize>,
    /// Factor on the first two components of the normal map.
    pub normal_scale: f32,
    /// Index of a linear texture whose red channel is the fraction of ambient light that arrives.
    pub occlusion_texture: Option<usize>,
    /// Strength of the occlusion texture: 0 for no effect, 1 for the full effect.
    pub occlusion_strength: f32,
    /// Emitted light.
    pub emissive: [f32; 3],
    /// Index of an sRGB texture that multiplies `emissive`.
    pub emissive_texture: Option<usize>,
    /// Refractive index.
    pub ior: f32,
    /// Whether the surface is visible from both sides.
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

/// An image and its sampling: 8 bits per channel, first row at the top. Colours are sRGB with
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
    /// Horizontal and vertical wrap mode outside 0..=1.
    pub wrap: [Wrap; 2],
    /// How texels are filtered.
    pub filter: Filter,
}

/// Maximum size in bytes of a decoded image; larger ones are rejected, because a few compressed
/// bytes can declare any size.
const MAX_TEXTURE_BYTES: u64 = 1 << 30;

/// Decodes PNG or JPEG bytes.
pub(crate) fn decode_texture(name: &str, bytes: &[u8], v_up: bool) -> Result<Texture, String> {
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    // An image of one colour compresses about 1:1000; leave room for small ones.
    limits.max_alloc =
        Some(MAX_TEXTURE_BYTES.min((bytes.len() as u64).saturating_mul(2048) + (1 << 20)));
    reader.limits(limits);
    let image = reader.decode().map_err(|e| e.to_string())?.to_rgba8();
    let (width, height) = image.dimensions();
    let (pixels, _) = image.as_raw().as_chunks::<4>();
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
