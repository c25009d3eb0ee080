//! Reads the program's own memory: vertex arrays, index arrays, parameters behind pointers.
//!
//! A program that calls OpenGL guarantees that the memory which the call names can be read, since
//! the driver would read it. A read needs two things, and safe code can make neither:
//!
//! - [`ActiveCall`] has the arguments of the draw call that the program is in. Hooks make it.
//!   [`Elements`] come from it alone, so they are the vertices that the call names, and what is
//!   read of them lives as long as the call.
//!
//! - [`ArraySource`] is an array as the driver describes it. It is queried here. No other module
//!   can make one of client memory, or change one.
//!
//! This module is a room for unsafe code.
#![allow(unsafe_code, reason = "a room: vertex arrays live in the program's memory")]

use crate::capture::draw::{PackedArray, component_bytes};
use crate::capture::vertex_selection::{VertexSelection, decode_indices};
use crate::driver::gl;
use crate::enums::*;
use core::marker::PhantomData;
use core::ops::Deref;
use std::borrow::Cow;

/// Bytes of the program's memory.
///
/// # Safety
/// The program is in a call that promises that `length` bytes from `address` on can be read (with
/// null: that nothing is), and nobody writes to them or frees them while `'a` lasts, which must end
/// with the call.
pub(crate) unsafe fn view<'a>(address: usize, length: usize) -> &'a [u8] {
    if address == 0 || length == 0 {
        return &[];
    }
    // SAFETY: as the caller promises.
    unsafe { core::slice::from_raw_parts(address as *const u8, length) }
}

/// `N` floats behind a parameter pointer; zeros behind null.
///
/// # Safety
/// As of [`view`], for `4 * N` bytes.
pub(crate) unsafe fn floats<const N: usize>(address: usize) -> [f32; N] {
    // SAFETY: as the caller promises; nothing is kept.
    let (four, _) = unsafe { view(address, 4 * N) }.as_chunks::<4>();
    std::array::from_fn(|i| four.get(i).map_or(0.0, |b| f32::from_ne_bytes(*b)))
}

/// `N` doubles behind a parameter pointer; zeros behind null.
///
/// # Safety
/// As of [`view`], for `8 * N` bytes.
pub(crate) unsafe fn doubles<const N: usize>(address: usize) -> [f64; N] {
    // SAFETY: as the caller promises; nothing is kept.
    let (eight, _) = unsafe { view(address, 8 * N) }.as_chunks::<8>();
    std::array::from_fn(|i| eight.get(i).map_or(0.0, |b| f64::from_ne_bytes(*b)))
}

/// `N` integers behind a parameter pointer; zeros behind null.
///
/// # Safety
/// As of [`view`], for `4 * N` bytes.
pub(crate) unsafe fn ints<const N: usize>(address: usize) -> [i32; N] {
    // SAFETY: as the caller promises.
    unsafe { floats::<N>(address) }.map(|f| f.to_bits().cast_signed())
}

// ---- The vertices that a call names -------------------------------------------------------------
/// The arguments of a draw call.
#[derive(Debug, Clone, Copy)]
pub(crate) enum DrawArguments {
    /// `glDrawArrays`.
    Arrays { first: i32, count: i32 },
    /// `glDrawElements` and its like.
    Elements { count: i32, kind: u32, at: usize, base: i32 },
    /// `glMultiDrawArrays`: so many draws, and the addresses of their arguments.
    SeveralArrays { firsts: usize, counts: usize, draws: i32 },
    /// `glMultiDrawElements` and, with an address of `bases`, `glMultiDrawElementsBaseVertex`.
    SeveralElements { counts: usize, kind: u32, at: usize, bases: usize, draws: i32 },
    /// `glArrayElement`.
    Element(i32),
}

/// One of several draws in a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct OneDraw {
    /// The first vertex, or the address of the indices.
    pub(crate) at: usize,
    pub(crate) count: usize,
    pub(crate) base: i32,
}

/// The most vertices of several draws in a call: 1 GB.
const MOST_LISTED: usize = 1 << 28;
const NEGATIVE: &str = "a negative count";
const FAR: &str = "arrays beyond the end of memory";

/// A draw call that the program is in.
pub(crate) struct ActiveCall<'c> {
    named: DrawArguments,
    call: PhantomData<&'c ()>,
}

impl ActiveCall<'_> {
    /// # Safety
    /// The program is in a call of OpenGL's with these arguments, which does not return before this
    /// goes.
    pub(crate) unsafe fn new(named: DrawArguments) -> Self {
        ActiveCall { named, call: PhantomData }
    }

    pub(crate) fn named(&self) -> DrawArguments {
        self.named
    }

    /// The draws of a call for several. Their vertices are listed one by one, so there is a limit.
    pub(crate) fn several(&self) -> Result<Vec<OneDraw>, &'static str> {
        let number = |n: i32| usize::try_from(n).map_err(|_| NEGATIVE);
        // SAFETY: the call names so many integers there, for each draw one.
        let ints = |at: usize, n: usize| unsafe { view(at, 4 * n) };
        let int = |bytes: &[u8], i: usize| match bytes.as_chunks::<4>().0.get(i) {
            Some(b) => i32::from_ne_bytes(*b),
            None => 0,
        };
        let draws: Result<Vec<OneDraw>, &'static str> = match self.named {
            DrawArguments::SeveralArrays { firsts, counts, draws } => {
                let n = number(draws)?;
                let (firsts, counts) = (ints(firsts, n), ints(counts, n));
                let one = |i| -> Result<OneDraw, &'static str> {
                    let (at, count) = (number(int(firsts, i))?, number(int(counts, i))?);
                    Ok(OneDraw { at, count, base: 0 })
                };
                (0..n).map(one).collect()
            }
            DrawArguments::SeveralElements { counts, at, bases, draws, .. } => {
                const WIDTH: usize = size_of::<usize>();
                let n = number(draws)?;
                let (counts, bases) = (ints(counts, n), ints(bases, n));
                // SAFETY: the call names an address or an offset there for each draw.
                let places = unsafe { view(at, WIDTH * n) }.as_chunks::<WIDTH>().0;
                let one = |i| -> Result<OneDraw, &'static str> {
                    let at = places.get(i).map_or(0, |b| usize::from_ne_bytes(*b));
                    Ok(OneDraw { at, count: number(int(counts, i))?, base: int(bases, i) })
                };
                (0..n).map(one).collect()
            }
            _ => Ok(Vec::new()),
        };
        let draws = draws?;
        match draws.iter().try_fold(0_usize, |n, d| n.checked_add(d.count)) {
            Some(..=MOST_LISTED) => Ok(draws),
            _ => Err("more than 268,435,456 vertices of several draws"),
        }
    }

    /// The indices of several draws, and where those of each end.
    fn indices_of_several(
        &self,
        kind: u32,
        restart: Option<u32>,
    ) -> Result<(Vec<u32>, Vec<usize>), &'static str> {
        let width = index_width(kind)?;
        let draws = self.several()?;
        let bytes_of = |d: &OneDraw| d.count.checked_mul(width).ok_or(FAR);
        let (mut indices, mut ends) = (Vec::new(), Vec::new());
        let buffer = gl::word(ELEMENT_ARRAY_BUFFER_BINDING);
        let real = || draws.iter().filter(|d| d.count > 0);
        let from = real().map(|d| d.at).min().unwrap_or(0);
        let mut kept = Vec::new();
        if buffer != 0 {
            let mut end = from;
            for d in real() {
                end = end.max(d.at.checked_add(bytes_of(d)?).ok_or(FAR)?);
            }
            kept = read_buffer(buffer, from, end - from)?;
        }
        for d in &draws {
            let length = bytes_of(d)?;
            let bytes = match buffer {
                _ if length == 0 => &[],
                0 if d.at == 0 => return Err("indices without an address"),
                // SAFETY: the call names so many indices there.
                0 => unsafe { view(d.at, length) },
                _ => &kept[d.at - from..][..length],
            };
            indices.extend(decode_indices(bytes, width, d.base, restart));
            ends.push(indices.len());
        }
        Ok((indices, ends))
    }
}

/// The bytes of an index.
fn index_width(kind: u32) -> Result<usize, &'static str> {
    match kind {
        UNSIGNED_BYTE | UNSIGNED_SHORT | UNSIGNED_INT => Ok(component_bytes(kind)),
        _ => Err("indices of a type that OpenGL refuses"),
    }
}

/// The vertices that a call names, as a [`VertexSelection`].
pub(crate) struct Elements<'c>(VertexSelection, PhantomData<&'c ()>);

impl Deref for Elements<'_> {
    type Target = VertexSelection;
    fn deref(&self) -> &VertexSelection {
        &self.0
    }
}

impl<'c> Elements<'c> {
    /// The elements of a call. `restart` is the index that restarts primitives.
    pub(crate) fn of(
        call: &'c ActiveCall<'_>,
        restart: Option<u32>,
    ) -> Result<Elements<'c>, &'static str> {
        let which = match call.named {
            DrawArguments::Arrays { first, count } => {
                match (usize::try_from(first), usize::try_from(count)) {
                    (Ok(first), Ok(count)) => VertexSelection::Range { first, count },
                    _ => return Err(NEGATIVE),
                }
            }
            DrawArguments::Element(i) => match usize::try_from(i) {
                Ok(first) => VertexSelection::Range { first, count: 1 },
                Err(_) => return Err("an element of a negative number"),
            },
            DrawArguments::Elements { count, kind, at, base } => {
                let n = usize::try_from(count).map_err(|_| NEGATIVE)?;
                let width = index_width(kind)?;
                let buffer = gl::word(ELEMENT_ARRAY_BUFFER_BINDING);
                let bytes: Cow<'_, [u8]> = match buffer {
                    0 if at == 0 => return Err("indices without an address"),
                    // SAFETY: the call names so many indices there, and it lasts longer than `call`
                    // is lent.
                    0 => Cow::Borrowed(unsafe { view(at, n * width) }),
                    buffer => Cow::Owned(read_buffer(buffer, at, n * width)?),
                };
                let indices = decode_indices(&bytes, width, base, restart).collect();
                VertexSelection::indexed(indices, restart.is_some())?
            }
            DrawArguments::SeveralArrays { .. } => {
                let (mut vertices, mut ends) = (Vec::new(), Vec::new());
                for d in call.several()? {
                    let end = d.at.checked_add(d.count).and_then(|end| u32::try_from(end).ok());
                    vertices.extend(d.at as u32..end.ok_or(FAR)?);
                    ends.push(vertices.len());
                }
                VertexSelection::several(vertices, ends, false, false)?
            }
            DrawArguments::SeveralElements { kind, .. } => {
                let (indices, ends) = call.indices_of_several(kind, restart)?;
                VertexSelection::several(indices, ends, true, restart.is_some())?
            }
        };
        Ok(Elements(which, PhantomData))
    }
}

// ---- Arrays -------------------------------------------------------------------------------------
/// The layout of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct ArrayLayout {
    pub(crate) size: usize,
    pub(crate) kind: u32,
    pub(crate) stride: usize,
    pub(crate) address: usize,
    /// 0 for client memory.
    pub(crate) buffer: u32,
    pub(crate) normalized: bool,
}

impl ArrayLayout {
    fn element(&self) -> usize {
        component_bytes(self.kind) * self.size
    }

    /// Bytes from one vertex to the next.
    pub(crate) fn step(&self) -> usize {
        if self.stride == 0 { self.element() } else { self.stride }
    }

    /// Everything that gives the same bytes another meaning.
    pub(crate) fn layout(&self) -> (usize, u32, usize, bool) {
        (self.step(), self.kind, self.size, self.normalized)
    }

    /// Packs the bytes of [`ArraySource::view`] tightly.
    pub(crate) fn pack(&self, bytes: Cow<'_, [u8]>) -> PackedArray {
        let (element, step) = (self.element(), self.step());
        let bytes = match step == element {
            true => bytes.into_owned(),
            false => {
                let mut out = Vec::with_capacity(bytes.len() / step * element + element);
                // A stride below the element's size makes vertices overlap.
                for at in (0..(bytes.len() + 1).saturating_sub(element)).step_by(step) {
                    out.extend_from_slice(&bytes[at..at + element]);
                }
                out
            }
        };
        PackedArray { bytes, kind: self.kind, size: self.size, normalized: self.normalized }
    }

    /// The offset and length of vertices `first..first + count`, or the reason why they cannot be
    /// read.
    fn range(&self, first: usize, count: usize) -> Result<(usize, usize), &'static str> {
        let element = self.element();
        if element == 0 || self.size > 4 {
            return Err("an array of a type that is not read");
        }
        let start =
            first.checked_mul(self.step()).and_then(|o| o.checked_add(self.address)).ok_or(FAR)?;
        let length = match count.checked_sub(1) {
            None => 0,
            Some(more) => {
                more.checked_mul(self.step()).and_then(|n| n.checked_add(element)).ok_or(FAR)?
            }
        };
        match start.checked_add(length).is_some_and(|end| isize::try_from(end).is_ok()) {
            true => Ok((start, length)),
            false => Err(FAR),
        }
    }
}

/// The number of components of a fixed-function array.
#[derive(Debug, Clone, Copy)]
pub(crate) enum ComponentCount {
    /// Always three, as for normals.
    Three,
    /// The driver's answer to this query.
    Asked(u32),
}

/// An array as the driver describes it, or in a buffer. Its fields can be read but not changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct ArraySource(ArrayLayout);

impl Deref for ArraySource {
    type Target = ArrayLayout;
    fn deref(&self) -> &ArrayLayout {
        &self.0
    }
}

impl ArraySource {
    /// A fixed-function array, queried by these names. Without buffer objects, all arrays are in
    /// client memory.
    pub(crate) fn of_fixed(
        size: ComponentCount,
        [kind, stride, pointer, buffer]: [u32; 4],
        normalized: bool,
        buffers: bool,
    ) -> ArraySource {
        let size = match size {
            ComponentCount::Three => 3,
            ComponentCount::Asked(what) => gl::int(what).max(0) as usize,
        };
        ArraySource(ArrayLayout {
            size,
            kind: gl::word(kind),
            stride: gl::int(stride).max(0) as usize,
            address: gl::pointer(pointer),
            buffer: if buffers { gl::word(buffer) } else { 0 },
            normalized,
        })
    }

    /// The array of a generic attribute, if it is enabled.
    pub(crate) fn of_attribute(at: u32) -> Option<ArraySource> {
        let get = |what| gl::vertex_attrib_i::<1>(at, what)[0];
        (get(VERTEX_ATTRIB_ARRAY_ENABLED) != 0).then(|| {
            ArraySource(ArrayLayout {
                size: get(VERTEX_ATTRIB_ARRAY_SIZE).max(0) as usize,
                kind: get(VERTEX_ATTRIB_ARRAY_TYPE).cast_unsigned(),
                stride: get(VERTEX_ATTRIB_ARRAY_STRIDE).max(0) as usize,
                address: gl::vertex_attrib_address(at),
                buffer: get(VERTEX_ATTRIB_ARRAY_BUFFER_BINDING).cast_unsigned(),
                normalized: get(VERTEX_ATTRIB_ARRAY_NORMALIZED) != 0,
            })
        })
    }

    /// Any array in a buffer, within which the driver keeps reads. `None` without a buffer.
    pub(crate) fn in_buffer(layout: ArrayLayout) -> Option<ArraySource> {
        (layout.buffer != 0).then_some(ArraySource(layout))
    }

    /// The vertices that a call names, in place and with gaps, or the reason why they cannot be
    /// read.
    pub(crate) fn view<'c>(&self, elements: &Elements<'c>) -> Result<Cow<'c, [u8]>, &'static str> {
        let (first, count) = elements.span();
        let (start, length) = self.range(first, count)?;
        match self.buffer {
            0 if self.address == 0 => Err("an array without an address"),
            // SAFETY: the program has given this array to OpenGL (`of_fixed`, `of_attribute`), and
            // is in a call that names these of its elements (`Elements::of`), for the time of `'c`.
            0 => Ok(Cow::Borrowed(unsafe { view(start, length) })),
            buffer => read_buffer(buffer, start, length).map(Cow::Owned),
        }
    }

    /// The same tightly packed.
    pub(crate) fn read(&self, elements: &Elements<'_>) -> Result<PackedArray, &'static str> {
        Ok(self.pack(self.view(elements)?))
    }

    /// Elements `first..first + count` of an array in a buffer, tightly packed.
    pub(crate) fn read_range(
        &self,
        first: usize,
        count: usize,
    ) -> Result<PackedArray, &'static str> {
        let (start, length) = self.range(first, count)?;
        match self.buffer {
            0 => Err("an array in client memory"),
            buffer => Ok(self.pack(Cow::Owned(read_buffer(buffer, start, length)?))),
        }
    }
}

/// A part of a buffer object.
fn read_buffer(buffer: u32, start: usize, length: usize) -> Result<Vec<u8>, &'static str> {
    let bound = gl::word(ARRAY_BUFFER_BINDING);
    gl::bind_buffer(ARRAY_BUFFER, buffer);
    let size = gl::buffer_i::<1>(ARRAY_BUFFER, BUFFER_SIZE)[0].max(0) as usize;
    let mapped = gl::buffer_i::<1>(ARRAY_BUFFER, BUFFER_MAPPED)[0] != 0;
    let answer = if mapped {
        Err("a mapped buffer")
    } else if start.checked_add(length).is_none_or(|end| end > size) {
        Err("arrays beyond the end of their buffer")
    } else {
        Ok(gl::buffer_bytes(ARRAY_BUFFER, start, length))
    };
    gl::bind_buffer(ARRAY_BUFFER, bound);
    answer
}
