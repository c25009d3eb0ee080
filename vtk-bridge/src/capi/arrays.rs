//! Converts foreign arrays to slices after checking their kinds and lengths.

use super::facts::{RtvSceneVolume, RtvVolumeFacts};
use super::types::*;
use crate::choice::volume_work::VolumeInView;
use crate::input::{
    Cells, Color, Cropping, Glyphs, Ids, Image, LightKind, Maps, PerItem, Points, Property,
    Scalars, SceneLight, Shading, Shape, Surface, Volume, VolumeBlend,
};
use rt_core::glam::{DMat4, DVec3};

/// Returns `array` as a slice of `N` numbers per element; empty when there is no array.
///
/// # Safety
/// The array has its stated length, and nobody writes to it while the result lives.
unsafe fn tuples<'a, T, const N: usize>(
    array: &RtvArray,
    what: &str,
    kind: u32,
) -> Result<&'a [[T; N]], String> {
    if array.kind == RTV_NONE || array.tuples == 0 {
        return Ok(&[]);
    }
    if array.kind != kind || array.components as usize != N {
        return Err(format!(
            "{what}: {} components of kind {}, expected {N} of kind {kind}",
            array.components, array.kind
        ));
    }
    let data = array.data.cast::<[T; N]>();
    let bytes = usize::try_from(array.tuples).ok().and_then(|n| n.checked_mul(size_of::<[T; N]>()));
    if data.is_null() || !data.is_aligned() || bytes.is_none_or(|b| b > isize::MAX as usize) {
        return Err(format!("{what}: {} tuples at {data:?} cannot be read", array.tuples));
    }
    // SAFETY: not null, aligned, of a size that fits; the rest is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(data, array.tuples as usize) })
}

/// Returns `count` structures at `first`; none if null, misaligned or impossibly many.
///
/// # Safety
/// They exist, and nobody writes to them while the result lives.
pub(super) unsafe fn slice<'a, T>(first: *const T, count: u64) -> Option<&'a [T]> {
    let bytes = usize::try_from(count).ok()?.checked_mul(size_of::<T>())?;
    if first.is_null() || !first.is_aligned() || bytes > isize::MAX as usize {
        return None;
    }
    // SAFETY: not null, aligned, of a size that fits; the rest is the caller's promise.
    Some(unsafe { std::slice::from_raw_parts(first, count as usize) })
}

/// # Safety
/// As [`tuples`].
unsafe fn ids<'a>(array: &RtvArray, what: &str) -> Result<Ids<'a>, String> {
    // SAFETY: the caller's promise.
    Ok(unsafe {
        match array.kind {
            RTV_I32 => Ids::I32(tuples::<i32, 1>(array, what, RTV_I32)?.as_flattened()),
            _ => Ids::I64(tuples::<i64, 1>(array, what, RTV_I64)?.as_flattened()),
        }
    })
}

/// # Safety
/// As [`tuples`].
unsafe fn cells<'a>(cells: &RtvCells, what: &str) -> Result<Cells<'a>, String> {
    // SAFETY: the caller's promise.
    Ok(unsafe {
        Cells { offsets: ids(&cells.offsets, what)?, connectivity: ids(&cells.connectivity, what)? }
    })
}

/// Converts the surface, with its arrays as slices.
///
/// # Safety
/// As [`surface`].
unsafe fn image<'a>(i: &RtvImage) -> Result<Option<Image<'a>>, String> {
    // SAFETY: the caller's promise.
    let texels: &[[u8; 4]] = unsafe { tuples(&i.texels, "texture", RTV_U8) }?;
    let width = i.width as usize;
    Ok((width > 0 && texels.len() >= width).then(|| Image {
        key: i.key,
        width,
        height: texels.len() / width,
        rgba: &texels[..texels.len() / width * width],
        interpolate: i.interpolate != 0,
        repeat: i.repeat != 0,
        srgb: i.srgb != 0,
    }))
}

/// # Safety
/// As [`surface`].
unsafe fn maps<'a>(m: &RtvMaps) -> Result<Maps<'a>, String> {
    // SAFETY: the caller's promise, for every image.
    let [material, normal, emissive] =
        unsafe { [image(&m.material)?, image(&m.normal)?, image(&m.emissive)?] };
    let (normal_scale, occlusion_strength) = (m.normal_scale, m.occlusion_strength);
    Ok(Maps {
        material,
        normal,
        emissive,
        normal_scale,
        occlusion_strength,
        emissive_factor: m.emissive_factor,
    })
}

/// # Safety
/// Every array has its stated length, and nobody writes to it while the result lives.
pub(super) unsafe fn surface<'a>(s: &RtvSurface, name: &'a str) -> Result<Surface<'a>, String> {
    // SAFETY: the caller's promise, for every array.
    unsafe {
        let points = match s.points.kind {
            RTV_F64 => Points::F64(tuples(&s.points, "points", RTV_F64)?),
            _ => Points::F32(tuples(&s.points, "points", RTV_F32)?),
        };
        let of_points: &[[f32; 3]] = tuples(&s.point_normals, "point normals", RTV_F32)?;
        let of_cells: &[[f32; 3]] = tuples(&s.cell_normals, "cell normals", RTV_F32)?;
        let normals = if !of_points.is_empty() {
            Some(PerItem::Point(of_points))
        } else {
            (!of_cells.is_empty()).then_some(PerItem::Cell(of_cells))
        };
        let texcoords: &[[f32; 2]] = tuples(&s.texcoords, "texture coordinates", RTV_F32)?;
        let tangents: &[[f32; 3]] = tuples(&s.tangents, "tangents", RTV_F32)?;
        let shape = Shape {
            key: s.shape_key,
            points,
            verts: cells(&s.verts, "vertices")?,
            lines: cells(&s.lines, "lines")?,
            polys: cells(&s.polys, "polygons")?,
            strips: cells(&s.strips, "strips")?,
            normals,
            texcoords: (!texcoords.is_empty()).then_some(texcoords),
            tangents: (!tangents.is_empty()).then_some(tangents),
            clip_planes: tuples(&s.clip_planes, "clipping planes", RTV_F64)?,
            point_radius: s.point_radius,
            line_radius: s.line_radius,
            edges_only: s.edges_only != 0,
            has_back_faces: s.has_back != 0,
        };
        let key = s.color_key;
        let color = match s.color_source {
            RTV_COLOR_PROPERTY => Color::Material,
            RTV_COLOR_POINTS => {
                Color::Values { key, rgba: PerItem::Point(tuples(&s.colors, "colours", RTV_U8)?) }
            }
            RTV_COLOR_CELLS => {
                Color::Values { key, rgba: PerItem::Cell(tuples(&s.colors, "colours", RTV_U8)?) }
            }
            RTV_COLOR_MAPPED => Color::Mapped {
                key,
                coordinates: tuples(&s.colors, "colour coordinates", RTV_F32)?,
                row: tuples(&s.map, "colour map", RTV_U8)?,
                nan: s.nan_color,
            },
            other => return Err(format!("colour source {other} does not exist")),
        };
        let texture = image(&RtvImage {
            texels: s.texture,
            key: s.texture_key,
            width: s.texture_width,
            interpolate: s.texture_interpolate,
            repeat: s.texture_repeat,
            srgb: s.texture_srgb,
            reserved: 0,
        })?;
        let maps = s.maps.as_ref().map(|m| maps(m)).transpose()?;
        let matrices: &[[f64; 16]] = tuples(&s.glyph_matrices, "glyphs", RTV_F64)?;
        Ok(Surface {
            name,
            shape,
            world_from_data: DMat4::from_cols_array(&s.world_from_data).transpose(),
            color,
            texture,
            maps,
            property: property(&s.property),
            back: (s.has_back != 0).then(|| property(&s.back)),
            glyphs: (s.glyph_matrices.kind != RTV_NONE)
                .then(|| {
                    tuples(&s.glyph_colors, "glyph colours", RTV_U8)
                        .map(|rgba| Glyphs { matrices, rgba })
                })
                .transpose()?,
        })
    }
}

/// Converts the volume, with its arrays as slices.
///
/// # Safety
/// As [`surface`].
pub(super) unsafe fn volume<'a>(v: &RtvVolume, name: &'a str) -> Result<Volume<'a>, String> {
    // SAFETY: the caller's promise, for every array.
    unsafe {
        let (array, what) = (&v.scalars, "scalars");
        let scalars = match array.kind {
            RTV_U8 => Scalars::U8(tuples::<u8, 1>(array, what, RTV_U8)?.as_flattened()),
            RTV_I32 => Scalars::I32(tuples::<i32, 1>(array, what, RTV_I32)?.as_flattened()),
            RTV_I64 => Scalars::I64(tuples::<i64, 1>(array, what, RTV_I64)?.as_flattened()),
            RTV_F64 => Scalars::F64(tuples::<f64, 1>(array, what, RTV_F64)?.as_flattened()),
            _ => Scalars::F32(tuples::<f32, 1>(array, what, RTV_F32)?.as_flattened()),
        };
        let opacities: &[[f32; 1]] = tuples(&v.opacities, "opacities", RTV_F32)?;
        let gradient: &[[f32; 1]] = tuples(&v.gradient_opacities, "gradient opacities", RTV_F32)?;
        let isovalues: &[[f64; 1]] = tuples(&v.isovalues, "isovalues", RTV_F64)?;
        Ok(Volume {
            name,
            key: v.scalar_key,
            scalars,
            cells: v.cells != 0,
            dims: v.dims,
            spacing: v.spacing,
            world_from_data: DMat4::from_cols_array(&v.world_from_data).transpose(),
            nearest: v.nearest != 0,
            range: v.range,
            colors: tuples(&v.colors, "colours", RTV_F32)?,
            opacities: opacities.as_flattened(),
            unit_distance: v.unit_distance,
            sample_distance: v.sample_distance,
            viewer: (v.has_viewer != 0).then(|| DVec3::from_array(v.viewer)),
            shading: (v.shade != 0).then_some(Shading {
                ambient: v.ambient,
                diffuse: v.diffuse,
                specular: v.specular,
                specular_power: v.specular_power,
                mirrored: v.specular_mirrored != 0,
            }),
            lights: tuples(&v.lights, "lights", RTV_F32)?,
            gradient_opacities: gradient.as_flattened(),
            steepest: v.steepest,
            blend: match v.blend {
                RTV_BLEND_COMPOSITE => VolumeBlend::Composite,
                RTV_BLEND_MAXIMUM => VolumeBlend::Maximum,
                RTV_BLEND_MINIMUM => VolumeBlend::Minimum,
                RTV_BLEND_AVERAGE => VolumeBlend::Average,
                RTV_BLEND_ADDITIVE => VolumeBlend::Additive,
                RTV_BLEND_ISOSURFACES => VolumeBlend::Isosurfaces(isovalues.as_flattened()),
                other => {
                    return Err(format!("a volume with blending {other}, which does not exist"));
                }
            },
            cropping: (v.cropping_regions != 0).then(|| {
                let [x0, x1, y0, y1, z0, z1] = v.cropping_planes;
                Cropping {
                    planes: [DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1)],
                    regions: v.cropping_regions,
                }
            }),
            clip_planes: tuples(&v.clip_planes, "clipping planes", RTV_F64)?,
            cropping_in_texels: v.cropping_in_texels != 0,
            clipping_in_texels: v.clipping_in_texels != 0,
        })
    }
}

/// Converts the volume, with its arrays as slices.
///
/// # Safety
/// As [`surface`].
pub(super) unsafe fn volume_in_view<'a>(
    v: &RtvSceneVolume,
    facts: &RtvVolumeFacts,
    view: &RtvView,
) -> Result<VolumeInView<'a>, String> {
    // SAFETY: the caller's promise, for both arrays.
    let [values, opacities]: [&[[f32; 1]]; 2] = unsafe {
        [tuples(&v.scalars, "scalars", RTV_F32)?, tuples(&v.opacities, "opacities", RTV_F32)?]
    };
    Ok(VolumeInView {
        values: values.as_flattened(),
        dims: v.dims,
        range: facts.range,
        opacities: opacities.as_flattened(),
        unit_distance: v.unit_distance,
        sample_distance: v.sample_distance,
        world_from_unit: DMat4::from_cols_array(&v.world_from_unit).transpose(),
        clip_from_world: DMat4::from_cols_array(&view.clip_from_world).transpose(),
        size: [view.width, view.height],
        points: facts.dims.iter().map(|n| u64::from(*n)).product(),
        shaded: facts.shade != 0,
    })
}

fn property(p: &RtvProperty) -> Property {
    Property {
        ambient_color: p.ambient_color,
        diffuse_color: p.diffuse_color,
        specular_color: p.specular_color,
        ambient: p.ambient,
        diffuse: p.diffuse,
        specular: p.specular,
        specular_power: p.specular_power,
        opacity: p.opacity,
        flat: p.flat != 0,
        lighting: p.lighting != 0,
        pbr: p.pbr != 0,
        metallic: p.metallic,
        roughness: p.roughness,
        base_ior: p.base_ior,
        cull_front: p.cull_front != 0,
        cull_back: p.cull_back != 0,
        edge_color: p.edge_color,
        edge_width: p.edge_width,
    }
}

pub(super) fn light(l: &RtvLight) -> SceneLight {
    let kind = match l.kind {
        RTV_LIGHT_SPOT => {
            LightKind::Spot { cutoff_rad: l.cone_angle_deg.to_radians(), exponent: l.exponent }
        }
        RTV_LIGHT_POINT => LightKind::Point,
        _ => LightKind::Directional,
    };
    SceneLight {
        kind,
        position: l.position.into(),
        focal_point: l.focal_point.into(),
        color: l.color,
        attenuation: l.attenuation,
        headlight: l.headlight != 0,
    }
}
