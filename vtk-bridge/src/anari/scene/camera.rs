//! Cameras.

use super::Diagnostics;
use crate::anari::object::Object;
use rt_core::camera::{Camera, CameraError, ThinLens};
use rt_core::glam::{DMat4, DVec3, DVec4};

/// Makes the camera for a frame of `size` pixels of a scene within `bounds`. An error says which of
/// its parameters is wrong.
pub(crate) fn camera_of(
    camera: &Object,
    size: [u32; 2],
    bounds: Option<[DVec3; 2]>,
    diagnostics: &mut Diagnostics,
) -> Result<Camera, CameraError> {
    let point = |name: &str, default: [f64; 3]| DVec3::from_array(camera.vector(name, default));
    let (eye, direction) = (point("position", [0.0; 3]), point("direction", [0.0, 0.0, -1.0]));
    let up = point("up", [0.0, 1.0, 0.0]);
    let number = |name: &str| camera.numbers(name).map(|v| v[0]);
    let frame_aspect = f64::from(size[0]) / f64::from(size[1]);
    let [x0, y0, x1, y1] = camera.vector("imageRegion", [0.0, 0.0, 1.0, 1.0]);
    // The target is as far ahead as the eye is from the origin, so that the direction survives the
    // addition.
    let target = eye + direction.normalize_or_zero() * eye.abs().max_element().max(1.0);
    if camera.subtype == "omnidirectional" {
        return Camera::omnidirectional(eye, target, up, [[x0, y0], [x1, y1]]);
    }
    let aspect = number("aspect").unwrap_or(frame_aspect);
    let (near, far) = (number("near"), number("far"));
    let orthographic = camera.subtype == "orthographic";
    // The farthest that the scene can reach; default clipping planes must not cut it.
    let reach = bounds.map_or(1.0, |[lo, hi]| (lo - eye).abs().max((hi - eye).abs()).length());
    let whole = if orthographic {
        let near = near.unwrap_or(0.0);
        let far = far.unwrap_or_else(|| (2.0 * reach).max(near.abs() * 2.0).max(1.0));
        Camera::orthographic(eye, target, up, number("height").unwrap_or(1.0), aspect, [near, far])?
    } else {
        let fovy = number("fovy").unwrap_or(std::f64::consts::FRAC_PI_3);
        let nearest = near.unwrap_or_else(|| 1e-9 * far.unwrap_or(reach.max(1e-20)));
        Camera::perspective(eye, target, up, fovy, aspect, [nearest, far.unwrap_or(f64::INFINITY)])?
    };
    // The part of the image plane between the region's corners is scaled to the whole image.
    let crop = if [x0, y0, x1, y1] == [0.0, 0.0, 1.0, 1.0] {
        whole
    } else {
        let (half, middle) =
            (DVec3::new(x1 - x0, y1 - y0, 1.0), DVec3::new(x0 + x1 - 1.0, y0 + y1 - 1.0, 0.0));
        let scale = DMat4::from_cols(DVec4::X / half.x, DVec4::Y / half.y, DVec4::Z, DVec4::W);
        Camera::from_matrix(scale * DMat4::from_translation(-middle) * whole.clip_from_world())?
    };
    let crop = crop.with_near_far_clipping(orthographic || near.is_some() || far.is_some());
    let (aperture_radius, focus_distance) =
        (number("apertureRadius").unwrap_or(0.0), number("focusDistance").unwrap_or(1.0));
    if aperture_radius == 0.0 {
        return Ok(crop);
    }
    if orthographic {
        diagnostics.warn(camera, "`apertureRadius` is left out: a parallel projection has no lens");
        return Ok(crop);
    }
    crop.with_lens(ThinLens { aperture_radius, focus_distance })
}
