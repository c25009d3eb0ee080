//! Volumes: their classes, mapper, property, lights and image.

use super::super::facts::RtvVolumeFacts;
use super::super::types::{
    RTV_BLEND_AVERAGE, RTV_BLEND_COMPOSITE, RTV_BLEND_ISOSURFACES, RTV_BLEND_MAXIMUM,
    RTV_BLEND_MINIMUM,
};
use super::first;
use rt_core::volume::Cropping;

const VOLUMES: [&str; 2] = ["vtkVolume", "vtkPVLODVolume"];

const FIXED_POINT: &str = "vtkFixedPointVolumeRayCastMapper";

const VOLUME_MAPPERS: [&str; 5] = [
    "vtkSmartVolumeMapper",
    "vtkGPUVolumeRayCastMapper",
    "vtkOpenGLGPUVolumeRayCastMapper",
    FIXED_POINT,
    "vtkMultiBlockVolumeMapper",
];

/// `vtkVolumeMapper::SLICE_BLEND`.
pub(super) const SLICE_BLEND: u32 = 6;

/// As many lights as OpenGL's shader for volumes has.
const MAX_VOLUME_LIGHTS: u32 = 6;

/// Why OpenGL draws a volume.
pub(in crate::capi) fn volume(
    f: &RtvVolumeFacts,
    volume_class: &str,
    mapper_class: &str,
) -> Option<&'static str> {
    let projection = matches!(f.blend_mode, RTV_BLEND_MAXIMUM | RTV_BLEND_MINIMUM);
    let shade = f.shade != 0;
    let fixed = mapper_class == FIXED_POINT;
    let (data, image) = (f.has_data != 0, f.has_data != 0 && f.image != 0);
    let [low, high] = f.range;
    let [from, to] = f.average_range;
    first(&[
        (!VOLUMES.contains(&volume_class), "OpenGL draws volumes of this class"),
        (!VOLUME_MAPPERS.contains(&mapper_class), "OpenGL draws volume mappers of this class"),
        // Nothing is drawn of it; no region in RtvVolume means all of them.
        (f.cropping != 0 && f.cropping_regions == 0, "a volume cropped to no region"),
        (
            f.cropping != 0
                && f.cropping_regions != Cropping::BOX
                && f.blend_mode != RTV_BLEND_COMPOSITE,
            "a volume cropped to more than a box, with another blending than composite",
        ),
        // It crops elsewhere where the extent of the image does not begin at zero.
        (f.cropping != 0 && fixed, "a volume that is cropped by vtkFixedPointVolumeRayCastMapper"),
        (f.mask != 0, "a volume with a mask"),
        (f.scattering != 0, "a volume with shadows or scattering of its own"),
        (f.vectors != 0, "a volume of vectors"),
        (f.transfer_function_2d != 0, "a volume with a two-dimensional transfer function"),
        (f.labels != 0, "a volume with labels"),
        (f.blend_mode == SLICE_BLEND, "a volume with slice blending"),
        (f.blend_mode > RTV_BLEND_ISOSURFACES, "a volume with a blend mode that is not known"),
        (
            f.blend_mode != RTV_BLEND_COMPOSITE && f.gradient_opacity != 0,
            "a volume with gradient opacity and another blending than composite",
        ),
        // OpenGL shades the largest scalar by the gradient where the ray ends.
        (projection && shade, "a shaded volume with maximum or minimum intensity blending"),
        (shade && f.num_lights == 0, "a shaded volume without a light"),
        (shade && f.num_positional_lights > 0, "a shaded volume under lights that have a place"),
        (shade && f.num_ambient_lights > 0, "a shaded volume under lights with an ambient colour"),
        (shade && f.num_lights > MAX_VOLUME_LIGHTS, "a shaded volume under more than six lights"),
        // OpenGL's highlight under several lights is that of the last one in 9.1, seen from a
        // mirrored place.
        (
            shade && f.num_listed_lights > 0 && f.specular > 0.0,
            "a shaded volume with a highlight under other lights than one white headlight",
        ),
        // Each block would need tables over the range of all.
        (data && !image && f.num_blocks > 1, "a volume of several blocks"),
        (data && !image, "a volume that is not image data"),
        (image && f.dims.iter().any(|n| *n <= 1), "a volume one point thick"),
        (image && f.blanked != 0, "a volume with blanked parts"),
        (image && f.scalars == 0, "a volume without scalars"),
        (image && f.cropping != 0 && f.turned != 0, "a cropped volume with turned axes"),
        (
            image && f.cell_scalars != 0 && fixed,
            "a volume of cells' values, which its mapper refuses",
        ),
        (image && f.num_components != 1, "a volume of several components"),
        (
            image && f.blend_mode == RTV_BLEND_AVERAGE && (from > low || to < high),
            "a volume with average intensity blending of a part of its scalars",
        ),
    ])
}
