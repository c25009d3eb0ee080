//! What one rank has of a scene: materials, lights, and its pieces of objects.

use super::group::free;
use super::handles::{self, Handled};
use super::memory::{Owners, check_size, flag, put, read, text, unused};
use super::scene_types::*;
use super::status::{Failure, c_text, guarded};
use super::tuples::{FLOATS, INDICES, Tuples};
use super::types::*;
use composite::render::RankScene;
use rt_core::environment::Background;
use rt_core::glam::{DAffine3, DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::{Attribute, PerElement, TriMesh};
use rt_core::scene::AmbientOcclusion;
use rt_core::shapes::{Radii, Spheres};
use std::ffi::{CString, c_char};
use std::sync::Arc;

/// The object behind a [`RtsvCompositeScene`].
#[derive(Default)]
pub(crate) struct SceneObject {
    pub(crate) scene: RankScene,
    /// Which arrays were copied, and why.
    pub(crate) copies: String,
    text: CString,
}

impl Handled for SceneObject {
    const NAME: &'static str = "scene";
}

/// Why no array of a mesh can be borrowed.
const MESHES_OWN: &str = "meshes own their arrays, as float and without gaps";
/// Why no array of spheres can be borrowed.
const SPHERES_OWN: &str = "spheres own their arrays, as float and without gaps";
/// Why places are not borrowed.
const PLACES_OWN: &str = "transforms are kept column by column";

/// A scene of nothing.
///
/// # Safety
/// `out` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_new(
    out: *mut *mut RtsvCompositeScene,
) -> RtsvCompositeStatus {
    guarded(|| {
        super::memory::check_pointer(out, "out")?;
        let handle = handles::add(SceneObject::default());
        // SAFETY: the caller's promise.
        unsafe { put(out, "out", std::ptr::without_provenance_mut(handle)) }
    })
}

/// Fills a material: matte, white, opaque. `struct_bytes` is sizeof of the structure.
///
/// # Safety
/// `material` is null or points to `struct_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_material_init(
    material: *mut RtsvCompositeMaterial,
    struct_bytes: u64,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_size::<RtsvCompositeMaterial>(struct_bytes)?;
        let value = RtsvCompositeMaterial {
            struct_bytes,
            model: RTSV_COMPOSITE_MATTE,
            color: [1.0; 3],
            emission: [0.0; 3],
            opacity: 1.0,
            specular: 0.0,
            shininess: 1.0,
            roughness: 0.0,
            metallic: 0.0,
            ior: 1.5,
            flat: 0,
        };
        // SAFETY: the caller's promise.
        unsafe { put(material, "material", value) }
    })
}

/// Adds a material; `number` gets its number, which counts from 0. All ranks add the same ones.
///
/// # Safety
/// `material` is null or valid; `number` is null (not asked for) or points to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_material(
    scene: *mut RtsvCompositeScene,
    material: *const RtsvCompositeMaterial,
    number: *mut u32,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(scene.addr(), |object: &mut SceneObject| {
            // SAFETY: the caller's promise, also below.
            let m = unsafe { read(material, "material") }?;
            let material = match m.model {
                RTSV_COMPOSITE_MATTE => Material::matte(m.color),
                RTSV_COMPOSITE_UNLIT => Material::unlit(m.color),
                RTSV_COMPOSITE_PHONG => Material::phong(m.color, m.specular, m.shininess),
                RTSV_COMPOSITE_METAL => Material::metal(m.color, m.roughness),
                RTSV_COMPOSITE_GLASS => Material::dielectric(m.ior),
                RTSV_COMPOSITE_PBR => Material::pbr(m.color, m.metallic, m.roughness),
                other => {
                    return Err(Failure::value(format!(
                        "model of RtsvCompositeMaterial is {other}: give RTSV_COMPOSITE_MATTE or \
                         one beside it"
                    )));
                }
            };
            let flat = flag(m.flat, "flat of RtsvCompositeMaterial")?;
            let material = material.with_opacity(m.opacity).with_emission(m.emission);
            let added = object.scene.material(Material { flat, ..material });
            if number.is_null() {
                return Ok(());
            }
            // SAFETY: as above.
            unsafe { put(number, "number", added as u32) }
        })
    })
}

/// Fills a light: ambient, white. `struct_bytes` is sizeof of the structure.
///
/// # Safety
/// `light` is null or points to `struct_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_light_init(
    light: *mut RtsvCompositeLight,
    struct_bytes: u64,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_size::<RtsvCompositeLight>(struct_bytes)?;
        let value = RtsvCompositeLight {
            struct_bytes,
            kind: RTSV_COMPOSITE_AMBIENT,
            shadows: 1,
            position: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
            size: 0.0,
            cutoff_rad: std::f64::consts::FRAC_PI_4,
            color: [1.0; 3],
            reserved: 0,
        };
        // SAFETY: the caller's promise.
        unsafe { put(light, "light", value) }
    })
}

/// Adds a light. All ranks add the same ones.
///
/// # Safety
/// `light` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_light(
    scene: *mut RtsvCompositeScene,
    light: *const RtsvCompositeLight,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(scene.addr(), |object: &mut SceneObject| {
            // SAFETY: the caller's promise.
            let l = unsafe { read(light, "light") }?;
            unused(l.reserved, "RtsvCompositeLight")?;
            let (position, direction) = (DVec3::from(l.position), DVec3::from(l.direction));
            let light = match l.kind {
                RTSV_COMPOSITE_AMBIENT => Light::ambient(l.color),
                RTSV_COMPOSITE_DIRECTIONAL => Light::directional(direction),
                RTSV_COMPOSITE_POINT => Light::point(position),
                RTSV_COMPOSITE_SPOT => Light::spot(position, direction, l.cutoff_rad),
                RTSV_COMPOSITE_HEADLIGHT => Light::headlight(),
                other => {
                    return Err(Failure::value(format!(
                        "kind of RtsvCompositeLight is {other}: give RTSV_COMPOSITE_AMBIENT or one \
                         beside it"
                    )));
                }
            };
            let mut light = light.with_color(l.color);
            if l.size != 0.0 {
                light = light.with_size(l.size).map_err(|e| Failure::value(e.to_string()))?;
            }
            if !flag(l.shadows, "shadows of RtsvCompositeLight")? {
                light = light.without_shadows();
            }
            object.scene.light(light);
            Ok(())
        })
    })
}

/// Fills surroundings: transparent, no ambient occlusion. `struct_bytes` is sizeof of the
/// structure.
///
/// # Safety
/// `surroundings` is null or points to `struct_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_surroundings_init(
    surroundings: *mut RtsvCompositeSurroundings,
    struct_bytes: u64,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_size::<RtsvCompositeSurroundings>(struct_bytes)?;
        let value = RtsvCompositeSurroundings {
            struct_bytes,
            occlusion_distance: f64::INFINITY,
            occlusion_rays: 0,
            has_background: 0,
            bottom: [0.0; 3],
            top: [0.0; 3],
        };
        // SAFETY: the caller's promise.
        unsafe { put(surroundings, "surroundings", value) }
    })
}

/// Sets what surrounds the objects. All ranks give the same.
///
/// # Safety
/// `surroundings` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_surroundings(
    scene: *mut RtsvCompositeScene,
    surroundings: *const RtsvCompositeSurroundings,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(scene.addr(), |object: &mut SceneObject| {
            // SAFETY: the caller's promise.
            let s = unsafe { read(surroundings, "surroundings") }?;
            let has = flag(s.has_background, "has_background of RtsvCompositeSurroundings")?;
            object.scene.background = match has {
                true => Background::Gradient { bottom: s.bottom, top: s.top },
                false => Background::Transparent,
            };
            let occlusion =
                AmbientOcclusion { distance: s.occlusion_distance, rays: s.occlusion_rays };
            object.scene.ambient_occlusion = Some(occlusion).filter(|ao| ao.rays > 0);
            Ok(())
        })
    })
}

/// Adds this rank's triangles of an object. A rank leaves out the objects of which it has nothing.
///
/// # Safety
/// `mesh` is null or valid, with arrays as it describes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_mesh(
    scene: *mut RtsvCompositeScene,
    mesh: *const RtsvCompositeMesh,
) -> RtsvCompositeStatus {
    guarded(|| {
        // SAFETY: the caller's promise, also below.
        let m = unsafe { read(mesh, "mesh") }?;
        let _owners = Owners::of(&[m.positions, m.triangles, m.normals, m.colors, m.places]);
        handles::with(scene.addr(), |object: &mut SceneObject| {
            // SAFETY: as above.
            let name = unsafe { text(m.name, "name") }?;
            let shown = format!("object `{name}`");
            let mut copies = String::new();
            let mut tuples = |array, what, components, kinds, why: &str| {
                let found = Tuples::new(array, what, components, kinds);
                let found = found.map_err(|f| Failure::value(format!("{shown}: {}", f.text)))?;
                copies += &found.map_or(String::new(), |tuples| tuples.copied(&shown, why));
                Ok::<_, Failure>(found)
            };
            let positions = tuples(&m.positions, "positions", 3, FLOATS, MESHES_OWN)?;
            let triangles = tuples(&m.triangles, "triangles", 3, INDICES, MESHES_OWN)?;
            let normals = tuples(&m.normals, "normals", 3, FLOATS, MESHES_OWN)?;
            let colors = tuples(&m.colors, "colors", 4, FLOATS, MESHES_OWN)?;
            let places = tuples(&m.places, "places", 12, &[RTSV_COMPOSITE_F64], PLACES_OWN)?;
            let per = match flag(m.colors_per_face, "colors_per_face of RtsvCompositeMesh")? {
                true => PerElement::Face,
                false => PerElement::Vertex,
            };
            let origin = DVec3::from(m.origin);
            // SAFETY: as above.
            let mesh = unsafe {
                TriMesh {
                    origin,
                    positions: relative(positions, origin),
                    indices: triangles.map_or(Vec::new(), |t| t.values()),
                    normals: normals.map(|n| {
                        Attribute::per_vertex(
                            n.values().into_iter().map(Vec3::from_array).collect(),
                        )
                    }),
                    colors: colors.map(|c| Attribute { per, values: c.values() }),
                    ..TriMesh::default()
                }
            };
            object.scene.mesh(name, mesh, m.material as usize);
            // SAFETY: as above.
            unsafe { place(&mut object.scene, places) };
            object.copies += &copies;
            Ok(())
        })
    })
}

/// Adds this rank's spheres of an object.
///
/// # Safety
/// `spheres` is null or valid, with arrays as it describes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_spheres(
    scene: *mut RtsvCompositeScene,
    spheres: *const RtsvCompositeSpheres,
) -> RtsvCompositeStatus {
    guarded(|| {
        // SAFETY: the caller's promise, also below.
        let s = unsafe { read(spheres, "spheres") }?;
        let _owners = Owners::of(&[s.centers, s.radii, s.colors, s.places]);
        handles::with(scene.addr(), |object: &mut SceneObject| {
            // SAFETY: as above.
            let name = unsafe { text(s.name, "name") }?;
            let shown = format!("object `{name}`");
            let fault = |text: String| Failure::value(format!("{shown}: {text}"));
            let mut copies = String::new();
            let mut tuples = |array, what, components, kinds, why: &str| {
                let found = Tuples::new(array, what, components, kinds);
                let found = found.map_err(|f| fault(f.text))?;
                copies += &found.map_or(String::new(), |tuples| tuples.copied(&shown, why));
                Ok::<_, Failure>(found)
            };
            let centers = tuples(&s.centers, "centers", 3, FLOATS, SPHERES_OWN)?;
            let radii = tuples(&s.radii, "radii", 1, FLOATS, SPHERES_OWN)?;
            let colors = tuples(&s.colors, "colors", 4, FLOATS, SPHERES_OWN)?;
            let places = tuples(&s.places, "places", 12, &[RTSV_COMPOSITE_F64], PLACES_OWN)?;
            // SAFETY: as above.
            let radii = radii.map(|radii| unsafe { radii.values() });
            let radii = match radii {
                Some(radii) => Radii::Each(radii.into_iter().map(|[radius]| radius).collect()),
                None => Radii::Common(s.radius),
            };
            let origin = DVec3::from(s.origin);
            // SAFETY: as above.
            let centers = unsafe { relative(centers, origin) };
            let shape = Spheres::new(centers, radii).map_err(|e| fault(e.to_string()))?;
            let mut shape = shape.with_origin(origin);
            if let Some(colors) = colors {
                // SAFETY: as above.
                let colors = unsafe { colors.values() };
                shape = shape.with_colors(colors).map_err(|e| fault(e.to_string()))?;
            }
            object.scene.shape(name, Arc::new(shape), s.material as usize);
            // SAFETY: as above.
            unsafe { place(&mut object.scene, places) };
            object.copies += &copies;
            Ok(())
        })
    })
}

/// Positions relative to `origin`, rounded once.
///
/// # Safety
/// As [`Tuples::values`].
unsafe fn relative(positions: Option<Tuples<'_>>, origin: DVec3) -> Vec<Vec3> {
    // SAFETY: the caller's promise.
    let positions = positions.map_or(Vec::new(), |p| unsafe { p.values::<f64, 3>() });
    positions.into_iter().map(|p| (DVec3::from_array(p) - origin).as_vec3()).collect()
}

/// Gives the object that was added last its transforms.
///
/// # Safety
/// As [`Tuples::values`].
unsafe fn place(scene: &mut RankScene, places: Option<Tuples<'_>>) {
    let Some(places) = places else { return };
    // SAFETY: the caller's promise.
    let rows = unsafe { places.values::<f64, 12>() };
    let place = |r: [f64; 12]| {
        let column = |k: usize| DVec3::new(r[k], r[4 + k], r[8 + k]);
        DAffine3::from_cols(column(0), column(1), column(2), column(3))
    };
    scene.place(rows.into_iter().map(place).collect());
}

/// Which arrays were copied, and why: a line for each. The text belongs to the scene until its next
/// call.
///
/// # Safety
/// `text` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_copies(
    scene: *mut RtsvCompositeScene,
    text: *mut *const c_char,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(scene.addr(), |object: &mut SceneObject| {
            object.text = c_text(&object.copies);
            // SAFETY: the caller's promise.
            unsafe { put(text, "text", object.text.as_ptr()) }
        })
    })
}

/// Frees a scene; renderers that were made of it go on. Null is allowed.
#[unsafe(no_mangle)]
pub extern "C" fn rtsv_composite_scene_free(scene: *mut RtsvCompositeScene) -> RtsvCompositeStatus {
    free::<SceneObject, _>(scene)
}
