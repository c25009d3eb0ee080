//! Structures and arrays in memory of the program: read at the calls, never kept.

use super::light_types::*;
use super::scene_types::*;
use super::status::Failure;
use super::types::*;
use std::ffi::{CStr, c_char, c_void};

/// A structure that begins with its size.
pub(crate) trait Sized64: Copy {
    /// Its name in C.
    const NAME: &'static str;
}

macro_rules! sized {
    ($($structure:ident),*) => {$(
        impl Sized64 for $structure {
            const NAME: &'static str = stringify!($structure);
        }
    )*};
}

sized!(
    RtsvCompositeOptions,
    RtsvCompositeFrame,
    RtsvCompositeImage,
    RtsvCompositeMaterial,
    RtsvCompositeLight,
    RtsvCompositeSurroundings,
    RtsvCompositeMesh,
    RtsvCompositeSpheres,
    RtsvCompositeVolume,
    RtsvCompositeBrick,
    RtsvCompositeRenderOptions,
    RtsvCompositeView,
    RtsvCompositePicture,
    RtsvCompositeGas,
    RtsvCompositeShot,
    RtsvCompositePhotograph
);

/// An error if `pointer` is null or not aligned.
pub(crate) fn check_pointer<T>(pointer: *const T, what: &str) -> Result<(), Failure> {
    let fault = match (pointer.is_null(), pointer.is_aligned()) {
        (true, _) => "null",
        (_, false) => "not aligned",
        _ => return Ok(()),
    };
    Err(Failure::new(RTSV_COMPOSITE_POINTER, format!("the pointer `{what}` is {fault}")))
}

/// A copy of a structure of the program.
///
/// # Safety
/// `pointer` is null, or points to the size of a structure and as many bytes as that says.
pub(crate) unsafe fn read<T: Sized64>(pointer: *const T, what: &str) -> Result<T, Failure> {
    check_pointer(pointer, what)?;
    // SAFETY: a structure begins with its size.
    let bytes = unsafe { pointer.cast::<u64>().read() };
    check_size::<T>(bytes)?;
    // SAFETY: as many bytes as the size says, which is that of the structure.
    Ok(unsafe { pointer.read() })
}

pub(crate) fn check_size<T: Sized64>(bytes: u64) -> Result<(), Failure> {
    if bytes == size_of::<T>() as u64 {
        return Ok(());
    }
    Err(Failure::new(
        RTSV_COMPOSITE_STRUCT,
        format!(
            "struct_bytes of {} is {bytes}, but this library ({}) knows {} bytes: set it to sizeof \
             of the structure, and compile with the header of the library that runs",
            T::NAME,
            env!("CARGO_PKG_VERSION"),
            size_of::<T>()
        ),
    ))
}

/// Writes `value` for the program.
///
/// # Safety
/// `pointer` is null or points to memory for a `T`.
pub(crate) unsafe fn put<T>(pointer: *mut T, what: &str, value: T) -> Result<(), Failure> {
    check_pointer(pointer, what)?;
    // SAFETY: the caller's promise.
    unsafe { pointer.write(value) };
    Ok(())
}

/// A name or text of the program.
///
/// # Safety
/// `text` is null or ends with a zero byte.
pub(crate) unsafe fn text(text: *const c_char, what: &str) -> Result<String, Failure> {
    check_pointer(text, what)?;
    // SAFETY: the caller's promise.
    let bytes = unsafe { CStr::from_ptr(text) };
    let text = bytes.to_str().map_err(|error| {
        Failure::value(format!("`{what}` is not UTF-8 ({error}): `{}`", bytes.to_string_lossy()))
    })?;
    Ok(text.to_owned())
}

/// A member that is 0 or 1.
pub(crate) fn flag(value: u32, what: &str) -> Result<bool, Failure> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(Failure::value(format!("{what} is {value}: give 0 or 1"))),
    }
}

/// A member that is not used yet.
pub(crate) fn unused(value: u32, structure: &str) -> Result<(), Failure> {
    match value {
        0 => Ok(()),
        _ => Err(Failure::value(format!("reserved of {structure} is {value}: give 0"))),
    }
}

/// Calls the release functions of arrays when it is dropped: whatever becomes of the call, each is
/// called once.
pub(crate) struct Owners(Vec<RtsvCompositeArray>);

impl Owners {
    pub(crate) fn of(arrays: &[RtsvCompositeArray]) -> Owners {
        Owners(arrays.to_vec())
    }
}

impl Drop for Owners {
    fn drop(&mut self) {
        for array in &self.0 {
            if let Some(release) = array.release {
                // SAFETY: the program gave both for this call.
                unsafe { release(array.owner) };
            }
        }
    }
}

/// Bytes from `data` to the end of the farthest of `counts` elements, each `strides` apart; `None`
/// if an address cannot be.
pub(crate) fn is_addressable(counts: &[u64], strides: &[i64], bytes: u64) -> bool {
    let reach = counts.iter().zip(strides).try_fold(i128::from(bytes), |sum, (&n, &stride)| {
        let far = i128::from(n.saturating_sub(1)).checked_mul(i128::from(stride).abs())?;
        sum.checked_add(far)
    });
    reach.is_some_and(|reach| reach <= isize::MAX as i128)
}

/// The address of element `index` of an array whose elements are `stride` bytes apart.
pub(crate) fn at(data: *const c_void, index: u64, stride: i64) -> *const c_void {
    data.wrapping_byte_offset((index as i64).wrapping_mul(stride) as isize)
}
