//! The program's own memory: vertex arrays, index arrays, parameters behind pointers.
//!
//! A program that calls OpenGL promises that what its pointers name can be read; the driver would read it just so. This is a room for
//! unsafe code.
#![allow(unsafe_code, reason = "a room: vertex arrays live in the program's memory")]

/// Bytes of the program's memory, for the time of one call: the program is waiting in it.
pub(crate) fn view<'a>(address: usize, length: usize) -> &'a [u8] {
    if address == 0 || length == 0 {
        return &[];
    }
    // SAFETY: the draw call names this range; the program owns it and waits for the call to return.
    unsafe { core::slice::from_raw_parts(address as *const u8, length) }
}

/// `N` floats behind a parameter pointer; zeros behind null.
pub(crate) fn floats<const N: usize>(address: usize) -> [f32; N] {
    let v = view(address, 4 * N);
    std::array::from_fn(|i| {
        v.get(4 * i..4 * i + 4).map_or(0.0, |b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]))
    })
}

/// `N` doubles behind a parameter pointer; zeros behind null.
pub(crate) fn doubles<const N: usize>(address: usize) -> [f64; N] {
    let v = view(address, 8 * N);
    let (eight, _) = v.as_chunks::<8>();
    std::array::from_fn(|i| eight.get(i).map_or(0.0, |b| f64::from_ne_bytes(*b)))
}

/// `N` integers behind a parameter pointer; zeros behind null.
pub(crate) fn ints<const N: usize>(address: usize) -> [i32; N] {
    floats::<N>(address).map(|f| f.to_bits().cast_signed())
}
