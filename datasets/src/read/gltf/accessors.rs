//! Decodes accessors: the elements of a view of a buffer, some of which sparse accessors replace.

use super::super::error::{At, BROKEN, Fault, TRUNCATED, fits};
use super::Reader;
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{DataType, Dimensions};

/// The bytes of the largest element: a matrix of 4 x 4 numbers.
const LARGEST: usize = 64;
/// The most elements of an accessor without data. They are zeros, which the file need not hold.
const MOST_ZEROS: usize = 1 << 24;

/// Where elements lie in a view.
struct Place {
    offset: usize,
    size: usize,
    stride: usize,
    count: usize,
}

impl Reader {
    /// The elements of a part of a view, all inside its buffer.
    fn view_elements(
        &self,
        view: &gltf::buffer::View<'_>,
        part: &Place,
        place: &str,
    ) -> Result<Vec<&[u8]>, Fault> {
        let at = || At::Field(place.to_string());
        let &Place { offset, size, stride, count } = part;
        let buffer = &self.buffers[view.buffer().index()];
        let end = view.offset().checked_add(view.length());
        let bytes =
            end.and_then(|end| buffer.get(view.offset()..end)).and_then(|b| b.get(offset..));
        let Some(bytes) = bytes else {
            let what = format!("it lies outside its buffer of {} bytes", buffer.len());
            return Err(Fault::new(at(), what, TRUNCATED));
        };
        // The last element does not need a whole stride after it.
        let needed = (count as u64)
            .saturating_sub(1)
            .checked_mul(stride as u64)
            .and_then(|n| n.checked_add(size as u64))
            .unwrap_or(u64::MAX);
        fits(if count == 0 { 0 } else { needed }, 1, bytes.len(), at(), "bytes of elements")?;
        Ok((0..count).map(|i| &bytes[i * stride..i * stride + size]).collect())
    }

    /// The elements of an accessor. Without a view they are zeros; sparse ones replace some.
    fn elements(&self, a: &gltf::Accessor<'_>, place: &str) -> Result<Vec<&[u8]>, Fault> {
        let at = || At::Field(place.to_string());
        let (size, count) = (a.size(), a.count());
        let mut elements = match (a.view(), a.sparse()) {
            (Some(view), _) => {
                let stride = view.stride().unwrap_or(size).max(1);
                self.view_elements(
                    &view,
                    &Place { offset: a.offset(), size, stride, count },
                    place,
                )?
            }
            (None, Some(_)) if count <= MOST_ZEROS => vec![&[0; LARGEST][..size]; count],
            (None, Some(_)) => {
                let what = format!("{count} elements without data; the most are {MOST_ZEROS}");
                return Err(Fault::new(at(), what, BROKEN));
            }
            (None, None) => {
                return Err(Fault::new(at(), "the accessor has no buffer view", BROKEN));
            }
        };
        let Some(sparse) = a.sparse() else { return Ok(elements) };
        let indices = sparse.indices();
        let width = match indices.index_type() {
            IndexType::U8 => 1,
            IndexType::U16 => 2,
            IndexType::U32 => 4,
        };
        let part = |offset, size| Place { offset, size, stride: size, count: sparse.count() };
        let numbers = self.view_elements(&indices.view(), &part(indices.offset(), width), place)?;
        let values = sparse.values();
        let values = self.view_elements(&values.view(), &part(values.offset(), size), place)?;
        for (number, value) in numbers.into_iter().map(little_endian).zip(values) {
            let Some(element) = elements.get_mut(number as usize) else {
                let what = format!("a sparse value for element {number} of {count}");
                return Err(Fault::new(at(), what, BROKEN));
            };
            *element = value;
        }
        Ok(elements)
    }

    /// The elements as `N` floats each; normalised integers become fractions of their largest
    /// value.
    pub(super) fn tuples<const N: usize>(
        &self,
        a: &gltf::Accessor<'_>,
        place: &str,
    ) -> Result<Vec<[f32; N]>, Fault> {
        if a.dimensions().multiplicity() != N {
            let what = format!("{:?} instead of {N} components", a.dimensions());
            return Err(Fault::field(place, what));
        }
        let kind = a.data_type();
        let scale = |max: f32| if a.normalized() { 1.0 / max } else { 1.0 };
        let value = |b: &[u8], c: usize| match kind {
            DataType::F32 => {
                f32::from_le_bytes([b[4 * c], b[4 * c + 1], b[4 * c + 2], b[4 * c + 3]])
            }
            DataType::U8 => f32::from(b[c]) * scale(255.0),
            DataType::I8 => f32::from(b[c] as i8) * scale(127.0),
            DataType::U16 => {
                f32::from(u16::from_le_bytes([b[2 * c], b[2 * c + 1]])) * scale(65535.0)
            }
            DataType::I16 => {
                f32::from(i16::from_le_bytes([b[2 * c], b[2 * c + 1]])) * scale(32767.0)
            }
            DataType::U32 => {
                u32::from_le_bytes([b[4 * c], b[4 * c + 1], b[4 * c + 2], b[4 * c + 3]]) as f32
            }
        };
        Ok(self
            .elements(a, place)?
            .into_iter()
            .map(|b| std::array::from_fn(|c| value(b, c)))
            .collect())
    }

    pub(super) fn indices(&self, a: &gltf::Accessor<'_>, name: &str) -> Result<Vec<u32>, Fault> {
        let place = format!("indices of `{name}`");
        let kind = a.data_type();
        if a.dimensions() != Dimensions::Scalar
            || !matches!(kind, DataType::U8 | DataType::U16 | DataType::U32)
        {
            return Err(Fault::field(
                place,
                format!("{kind:?} {:?} instead of unsigned numbers", a.dimensions()),
            ));
        }
        Ok(self.elements(a, &place)?.into_iter().map(little_endian).collect())
    }
}

/// A number of up to four bytes.
fn little_endian(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |n, &b| n << 8 | u32::from(b))
}
