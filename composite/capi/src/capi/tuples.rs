//! Arrays of tuples: numbers of any kind and stride, converted to what the renderer keeps.

use super::memory::{at, is_addressable};
use super::scene_types::*;
use super::status::Failure;

/// An array whose description is sound.
#[derive(Clone, Copy)]
pub(crate) struct Tuples<'a> {
    array: &'a RtsvCompositeArray,
    stride: i64,
    what: &'a str,
}

/// Kinds of floating-point numbers.
pub(crate) const FLOATS: &[u32] = &[RTSV_COMPOSITE_F32, RTSV_COMPOSITE_F64];
/// Kinds of indices.
pub(crate) const INDICES: &[u32] =
    &[RTSV_COMPOSITE_U32, RTSV_COMPOSITE_I32, RTSV_COMPOSITE_U64, RTSV_COMPOSITE_I64];
/// All kinds.
pub(crate) const NUMBERS: &[u32] = &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10];

/// Names of the kinds in C, and their bytes.
const KINDS: [(&str, u64); 10] = [
    ("uint8_t", 1),
    ("int8_t", 1),
    ("uint16_t", 2),
    ("int16_t", 2),
    ("uint32_t", 4),
    ("int32_t", 4),
    ("uint64_t", 8),
    ("int64_t", 8),
    ("float", 4),
    ("double", 8),
];

fn kind_of(kind: u32) -> Option<(&'static str, u64)> {
    KINDS.get((kind as usize).checked_sub(1)?).copied()
}

impl<'a> Tuples<'a> {
    /// `None` for an array without tuples.
    pub(crate) fn new(
        array: &'a RtsvCompositeArray,
        what: &'a str,
        components: u32,
        kinds: &[u32],
    ) -> Result<Option<Tuples<'a>>, Failure> {
        let fault = |text: String| Err(Failure::value(format!("{what}: {text}")));
        if array.count == 0 {
            return Ok(None);
        }
        if array.data.is_null() {
            return fault(format!("{} tuples at a null pointer", array.count));
        }
        let Some((_, bytes)) = kind_of(array.kind).filter(|_| kinds.contains(&array.kind)) else {
            let names: Vec<_> = kinds.iter().filter_map(|&k| kind_of(k)).map(|k| k.0).collect();
            return fault(format!("its kind is {}: give {}", array.kind, names.join(", ")));
        };
        if array.components != components {
            return fault(format!("{} components: give {components}", array.components));
        }
        let tuple = u64::from(components) * bytes;
        let stride = if array.stride_bytes == 0 { tuple as i64 } else { array.stride_bytes };
        if !is_addressable(&[array.count], &[stride], tuple) {
            let count = array.count;
            return fault(format!(
                "{count} tuples that are {stride} bytes apart: no memory is so \
                                  large"
            ));
        }
        Ok(Some(Tuples { array, stride, what }))
    }

    /// From one tuple to the next, bytes.
    pub(crate) fn stride(&self) -> i64 {
        self.stride
    }

    /// What it is and why its values are copied, for the user.
    pub(crate) fn copied(&self, object: &str, why: &str) -> String {
        let kind = kind_of(self.array.kind).map_or("", |k| k.0);
        let (count, components) = (self.array.count, self.array.components);
        format!("{object}: {}: {count} x {components} {kind}: copied: {why}\n", self.what)
    }

    /// Its tuples, converted.
    ///
    /// # Safety
    /// Each tuple is readable memory.
    pub(crate) unsafe fn values<T: Number, const N: usize>(&self) -> Vec<[T; N]> {
        let tuple = |index| {
            let mut values = [T::default(); N];
            for (k, value) in values.iter_mut().enumerate() {
                // SAFETY: the caller's promise; `new` has checked the components.
                *value = unsafe { self.value(index, k) };
            }
            values
        };
        (0..self.array.count).map(tuple).collect()
    }

    /// Number `component` of tuple `index`.
    ///
    /// # Safety
    /// As [`Tuples::values`]; there is such a number.
    pub(crate) unsafe fn value<T: Number>(&self, index: u64, component: usize) -> T {
        let tuple = at(self.array.data, index, self.stride);
        macro_rules! number {
            ($kind:ty, $from:ident) => {{
                let number = tuple.cast::<$kind>().wrapping_add(component);
                // SAFETY: a number of the program's, at any alignment.
                T::$from(unsafe { number.read_unaligned() }.into())
            }};
        }
        match self.array.kind {
            RTSV_COMPOSITE_U8 => number!(u8, from_integer),
            RTSV_COMPOSITE_I8 => number!(i8, from_integer),
            RTSV_COMPOSITE_U16 => number!(u16, from_integer),
            RTSV_COMPOSITE_I16 => number!(i16, from_integer),
            RTSV_COMPOSITE_U32 => number!(u32, from_integer),
            RTSV_COMPOSITE_I32 => number!(i32, from_integer),
            RTSV_COMPOSITE_U64 => number!(u64, from_integer),
            RTSV_COMPOSITE_I64 => number!(i64, from_integer),
            RTSV_COMPOSITE_F32 => number!(f32, from_float),
            _ => number!(f64, from_float),
        }
    }
}

/// What numbers of the program become.
pub(crate) trait Number: Copy + Default {
    fn from_integer(value: i128) -> Self;
    fn from_float(value: f64) -> Self;
}

impl Number for f32 {
    fn from_integer(value: i128) -> f32 {
        value as f32
    }

    fn from_float(value: f64) -> f32 {
        value as f32
    }
}

impl Number for f64 {
    fn from_integer(value: i128) -> f64 {
        value as f64
    }

    fn from_float(value: f64) -> f64 {
        value
    }
}

/// Indices: what is beyond them becomes the largest, which no array has.
impl Number for u32 {
    fn from_integer(value: i128) -> u32 {
        u32::try_from(value).unwrap_or(u32::MAX)
    }

    fn from_float(_: f64) -> u32 {
        u32::MAX
    }
}
