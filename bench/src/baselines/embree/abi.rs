//! The subset of Embree's C interface in use, from the headers of 3.13.5 and 4.4.0 (`rtcore_ray.h`,
//! `rtcore_common.h`, `rtcore_scene.h`, `rtcore_device.h`, `rtcore_geometry.h`).

use core::ffi::{c_char, c_int, c_uint, c_void};

pub(super) type Handle = *mut c_void;

pub(super) const INVALID_ID: u32 = u32::MAX;
pub(super) const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
pub(super) const GEOMETRY_TYPE_INSTANCE: c_int = 121;
pub(super) const BUFFER_TYPE_INDEX: c_int = 0;
pub(super) const BUFFER_TYPE_VERTEX: c_int = 1;
pub(super) const FORMAT_UINT3: c_int = 0x5003;
pub(super) const FORMAT_FLOAT3: c_int = 0x9003;
pub(super) const FORMAT_FLOAT3X4_COLUMN_MAJOR: c_int = 0x9234;
pub(super) const SCENE_FLAG_COMPACT: c_int = 1 << 1;
pub(super) const SCENE_FLAG_ROBUST: c_int = 1 << 2;
/// `RTC_INTERSECT_CONTEXT_FLAG_COHERENT` of Embree 3.
pub(super) const COHERENT_3: c_uint = 1;
/// `RTC_RAY_QUERY_FLAG_COHERENT` of Embree 4.
pub(super) const COHERENT_4: c_uint = 1 << 16;
pub(super) const PROPERTY_VERSION_MAJOR: c_int = 1;
pub(super) const PROPERTY_VERSION_MINOR: c_int = 2;
pub(super) const PROPERTY_VERSION_PATCH: c_int = 3;

/// Rows of instance ids in a hit. A default build writes one (Embree 3) or two (Embree 4: `instID`
/// and `instPrimID`); builds with more instance levels write more. There is space for eight levels
/// of both.
const INSTANCE_ROWS: usize = 16;

/// `RTCRay` (N = 1) or `RTCRay4`, `RTCRay8`, `RTCRay16`: twelve rows of N numbers without padding.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct RayN<const N: usize> {
    pub(super) org_x: [f32; N],
    pub(super) org_y: [f32; N],
    pub(super) org_z: [f32; N],
    pub(super) tnear: [f32; N],
    pub(super) dir_x: [f32; N],
    pub(super) dir_y: [f32; N],
    pub(super) dir_z: [f32; N],
    pub(super) time: [f32; N],
    pub(super) tfar: [f32; N],
    pub(super) mask: [u32; N],
    pub(super) id: [u32; N],
    pub(super) flags: [u32; N],
}

/// `RTCHit` and its packets, with space for any number of instance levels.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct HitN<const N: usize> {
    pub(super) normal: [[f32; N]; 3],
    pub(super) u: [f32; N],
    pub(super) v: [f32; N],
    pub(super) prim_id: [u32; N],
    pub(super) geom_id: [u32; N],
    pub(super) instance: [[u32; N]; INSTANCE_ROWS],
}

/// `RTCRayHit` and its packets. The C type is aligned to 16, 32 or 64 bytes by N; 64 satisfies all.
/// As in C, the hit follows the ray without padding, because a ray's size (48 N bytes) is a
/// multiple of each alignment.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct RayHitN<const N: usize> {
    pub(super) ray: RayN<N>,
    pub(super) hit: HitN<N>,
}

/// The `valid` argument of packet queries: -1 for lanes in use, 0 for others.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Valid<const N: usize>(pub(super) [c_int; N]);

/// `RTCIntersectContext` of Embree 3 with one instance level.
#[repr(C)]
pub(super) struct Context3 {
    pub(super) flags: c_uint,
    pub(super) filter: *mut c_void,
    pub(super) inst_id: c_uint,
    pub(super) min_width_distance_factor: f32,
}

/// `RTCIntersectArguments` and `RTCOccludedArguments` of Embree 4, which have the same layout.
#[repr(C)]
pub(super) struct Arguments4 {
    pub(super) flags: c_uint,
    pub(super) feature_mask: c_uint,
    pub(super) context: *mut c_void,
    pub(super) filter: *mut c_void,
    pub(super) callback: *mut c_void,
    pub(super) min_width_distance_factor: f32,
}

/// `rtcIntersect1` and `rtcOccluded1` of Embree 3: scene, context, ray.
pub(super) type One3 = unsafe extern "C" fn(Handle, *mut Context3, *mut c_void);
/// The packets of Embree 3: valid, scene, context, rays.
pub(super) type Many3 = unsafe extern "C" fn(*const c_int, Handle, *mut Context3, *mut c_void);
/// `rtcIntersect1` and `rtcOccluded1` of Embree 4: scene, ray, arguments.
pub(super) type One4 = unsafe extern "C" fn(Handle, *mut c_void, *mut Arguments4);
/// The packets of Embree 4: valid, scene, rays, arguments.
pub(super) type Many4 = unsafe extern "C" fn(*const c_int, Handle, *mut c_void, *mut Arguments4);

/// One query at all widths.
#[derive(Clone, Copy)]
pub(super) struct Widths<One, Many> {
    pub(super) one: One,
    pub(super) four: Many,
    pub(super) eight: Many,
    pub(super) sixteen: Many,
}

/// The query functions, by version.
#[derive(Clone, Copy)]
pub(super) enum Queries {
    V3 { intersect: Widths<One3, Many3>, occluded: Widths<One3, Many3> },
    V4 { intersect: Widths<One4, Many4>, occluded: Widths<One4, Many4> },
}

/// `RTCMemoryMonitorFunction`.
pub(super) type Monitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

/// The functions that both versions share.
#[derive(Clone, Copy)]
pub(super) struct Calls {
    pub(super) new_device: unsafe extern "C" fn(*const c_char) -> Handle,
    pub(super) release_device: unsafe extern "C" fn(Handle),
    pub(super) get_device_property: unsafe extern "C" fn(Handle, c_int) -> isize,
    pub(super) get_device_error: unsafe extern "C" fn(Handle) -> c_int,
    pub(super) set_memory_monitor: unsafe extern "C" fn(Handle, Monitor, *mut c_void),
    pub(super) new_scene: unsafe extern "C" fn(Handle) -> Handle,
    pub(super) release_scene: unsafe extern "C" fn(Handle),
    pub(super) set_scene_flags: unsafe extern "C" fn(Handle, c_int),
    pub(super) set_scene_build_quality: unsafe extern "C" fn(Handle, c_int),
    pub(super) commit_scene: unsafe extern "C" fn(Handle),
    pub(super) new_geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    pub(super) release_geometry: unsafe extern "C" fn(Handle),
    pub(super) set_geometry_build_quality: unsafe extern "C" fn(Handle, c_int),
    pub(super) commit_geometry: unsafe extern "C" fn(Handle),
    pub(super) attach_geometry: unsafe extern "C" fn(Handle, Handle) -> c_uint,
    pub(super) set_geometry_instanced_scene: unsafe extern "C" fn(Handle, Handle),
    /// Arguments: geometry, time step, format, matrix.
    pub(super) set_geometry_transform: unsafe extern "C" fn(Handle, c_uint, c_int, *const c_void),
    /// Arguments: geometry, type, slot, format, pointer, byte offset, byte stride, item count.
    pub(super) set_shared_geometry_buffer:
        unsafe extern "C" fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize),
    pub(super) queries: Queries,
}

/// The name of an `RTCError`.
pub(super) fn error_name(code: c_int) -> String {
    match code {
        1 => "an unknown error".into(),
        2 => "an invalid argument".into(),
        3 => "an invalid operation".into(),
        4 => "out of memory".into(),
        5 => "an unsupported processor".into(),
        6 => "a cancelled operation".into(),
        other => format!("error {other}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::{align_of, offset_of, size_of};

    /// Compares the offsets with those that a C compiler computes for the headers' structures.
    #[test]
    fn layouts_are_those_of_the_c_headers() {
        assert_eq!(
            (size_of::<RayN<1>>(), size_of::<RayN<4>>(), size_of::<RayN<16>>()),
            (48, 192, 768)
        );
        assert_eq!(offset_of!(RayN<1>, tfar), 32);
        assert_eq!((offset_of!(RayN<8>, dir_x), offset_of!(RayN<8>, tfar)), (128, 256));
        assert_eq!((offset_of!(RayHitN<1>, hit), offset_of!(RayHitN<8>, hit)), (48, 384));
        assert_eq!(
            (offset_of!(HitN<1>, u), offset_of!(HitN<1>, prim_id), offset_of!(HitN<1>, instance)),
            (12, 20, 28)
        );
        assert_eq!((offset_of!(HitN<16>, geom_id), offset_of!(HitN<16>, instance)), (384, 448));
        assert_eq!((align_of::<RayHitN<1>>(), align_of::<Valid<16>>()), (64, 64));
        assert_eq!((offset_of!(Context3, filter), offset_of!(Context3, inst_id)), (8, 16));
        assert_eq!((offset_of!(Arguments4, context), offset_of!(Arguments4, callback)), (8, 24));
        assert_eq!(size_of::<Arguments4>(), 40);
    }
}
