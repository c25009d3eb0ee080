//! Named arrays of any of VTK's scalar types.

/// The type of the values of a [`DataArray`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the names are Rust's own type names")]
pub enum ScalarType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl ScalarType {
    /// All scalar types.
    pub const ALL: [ScalarType; 10] = {
        use ScalarType::*;
        [I8, U8, I16, U16, I32, U32, I64, U64, F32, F64]
    };

    /// Bytes per value.
    pub const fn size(self) -> usize {
        match self {
            ScalarType::I8 | ScalarType::U8 => 1,
            ScalarType::I16 | ScalarType::U16 => 2,
            ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
            ScalarType::I64 | ScalarType::U64 | ScalarType::F64 => 8,
        }
    }

    /// The type's name in Rust: `u8`, `f32`, …
    pub const fn name(self) -> &'static str {
        match self {
            ScalarType::I8 => "i8",
            ScalarType::U8 => "u8",
            ScalarType::I16 => "i16",
            ScalarType::U16 => "u16",
            ScalarType::I32 => "i32",
            ScalarType::U32 => "u32",
            ScalarType::I64 => "i64",
            ScalarType::U64 => "u64",
            ScalarType::F32 => "f32",
            ScalarType::F64 => "f64",
        }
    }

    /// The type's name in VTK's XML files: `UInt8`, `Float32`, …
    pub const fn vtk_name(self) -> &'static str {
        match self {
            ScalarType::I8 => "Int8",
            ScalarType::U8 => "UInt8",
            ScalarType::I16 => "Int16",
            ScalarType::U16 => "UInt16",
            ScalarType::I32 => "Int32",
            ScalarType::U32 => "UInt32",
            ScalarType::I64 => "Int64",
            ScalarType::U64 => "UInt64",
            ScalarType::F32 => "Float32",
            ScalarType::F64 => "Float64",
        }
    }
}

/// Order of the bytes of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Endian {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// Values of one of the scalar types.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "the names are Rust's own type names")]
pub enum Values {
    I8(Vec<i8>),
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Runs `$body` with `$v` bound to the inner vector, whatever its type.
macro_rules! with_values {
    ($values:expr, $v:ident => $body:expr) => {
        match $values {
            $crate::model::Values::I8($v) => $body,
            $crate::model::Values::U8($v) => $body,
            $crate::model::Values::I16($v) => $body,
            $crate::model::Values::U16($v) => $body,
            $crate::model::Values::I32($v) => $body,
            $crate::model::Values::U32($v) => $body,
            $crate::model::Values::I64($v) => $body,
            $crate::model::Values::U64($v) => $body,
            $crate::model::Values::F32($v) => $body,
            $crate::model::Values::F64($v) => $body,
        }
    };
}
/// Runs `$body` with `$t` as the Rust type and `$wrap` as the variant for a [`ScalarType`].
macro_rules! with_type {
    ($kind:expr, $t:ident, $wrap:ident => $body:expr) => {{
        use super::array::{ScalarType, Values};
        match $kind {
            ScalarType::I8 => {
                type $t = i8;
                let $wrap = Values::I8;
                $body
            }
            ScalarType::U8 => {
                type $t = u8;
                let $wrap = Values::U8;
                $body
            }
            ScalarType::I16 => {
                type $t = i16;
                let $wrap = Values::I16;
                $body
            }
            ScalarType::U16 => {
                type $t = u16;
                let $wrap = Values::U16;
                $body
            }
            ScalarType::I32 => {
                type $t = i32;
                let $wrap = Values::I32;
                $body
            }
            ScalarType::U32 => {
                type $t = u32;
                let $wrap = Values::U32;
                $body
            }
            ScalarType::I64 => {
                type $t = i64;
                let $wrap = Values::I64;
                $body
            }
            ScalarType::U64 => {
                type $t = u64;
                let $wrap = Values::U64;
                $body
            }
            ScalarType::F32 => {
                type $t = f32;
                let $wrap = Values::F32;
                $body
            }
            ScalarType::F64 => {
                type $t = f64;
                let $wrap = Values::F64;
                $body
            }
        }
    }};
}
pub(crate) use with_values;

/// Wraps a vector of one of the scalar types as [`Values`].
pub(crate) trait IntoValues {
    fn into_values(self) -> Values;
}
macro_rules! into_values {
    ($($t:ty => $v:ident),*) => { $(
        impl IntoValues for Vec<$t> {
            fn into_values(self) -> Values { Values::$v(self) }
        }
    )* };
}
into_values!(
    i8 => I8, u8 => U8, i16 => I16, u16 => U16, i32 => I32, u32 => U32, i64 => I64, u64 => U64,
    f32 => F32, f64 => F64
);

impl Values {
    /// No values of type `kind`.
    pub fn empty(kind: ScalarType) -> Self {
        with_type!(kind, T, wrap => wrap(Vec::<T>::new()))
    }

    /// Decodes the values in `bytes`; a remainder shorter than one value is ignored.
    pub fn from_bytes(kind: ScalarType, bytes: &[u8], endian: Endian) -> Self {
        with_type!(kind, T, wrap => {
            let (items, _) = bytes.as_chunks::<{ size_of::<T>() }>();
            wrap(match endian {
                Endian::Little => items.iter().map(|b| T::from_le_bytes(*b)).collect(),
                Endian::Big => items.iter().map(|b| T::from_be_bytes(*b)).collect(),
            })
        })
    }

    /// Encodes the values as bytes, least significant byte first.
    pub fn to_le_bytes(&self) -> Vec<u8> {
        with_values!(self, v => v.iter().flat_map(|x| x.to_le_bytes()).collect())
    }

    /// Parses the values in `words`, or returns the first word that is not a value. As some
    /// programs write them, integers may have a fraction or exponent (`3.0`) if the value is whole,
    /// and exponents may be those of Fortran (`1.0D-3`, `1.0-101`).
    #[allow(clippy::unnecessary_cast, reason = "the macro covers f64 too")]
    pub fn from_words<'a>(
        kind: ScalarType,
        words: impl Iterator<Item = &'a str>,
    ) -> Result<Self, &'a str> {
        let is_real = matches!(kind, ScalarType::F32 | ScalarType::F64);
        with_type!(kind, T, wrap => {
            let mut out = Vec::new();
            for w in words {
                let value = match w.parse::<T>() {
                    Ok(x) => x,
                    Err(_) => match fortran_number(w) {
                        Some(f) if is_real || (f as T) as f64 == f => f as T,
                        _ => return Err(w),
                    },
                };
                out.push(value);
            }
            Ok(wrap(out))
        })
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        with_values!(self, v => v.len())
    }
    /// True when there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The scalar type.
    pub fn kind(&self) -> ScalarType {
        match self {
            Values::I8(_) => ScalarType::I8,
            Values::U8(_) => ScalarType::U8,
            Values::I16(_) => ScalarType::I16,
            Values::U16(_) => ScalarType::U16,
            Values::I32(_) => ScalarType::I32,
            Values::U32(_) => ScalarType::U32,
            Values::I64(_) => ScalarType::I64,
            Values::U64(_) => ScalarType::U64,
            Values::F32(_) => ScalarType::F32,
            Values::F64(_) => ScalarType::F64,
        }
    }
    /// Value `i` as f64 (64-bit integers above 2^53 round); panics when out of range.
    #[inline]
    #[allow(clippy::unnecessary_cast, reason = "the macro covers f64 too")]
    pub fn get_f64(&self, i: usize) -> f64 {
        with_values!(self, v => v[i] as f64)
    }
    /// All values as f32.
    #[allow(clippy::unnecessary_cast, reason = "the macro covers f32 too")]
    pub fn to_f32(&self) -> Vec<f32> {
        with_values!(self, v => v.iter().map(|&x| x as f32).collect())
    }
    /// Copies the values in `range`; the type is kept.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Values {
        with_type!(self.kind(), T, wrap => wrap(
            with_values!(self, v => v[range].iter().map(|&x| x as T).collect())
        ))
    }
    /// The values at `indices`, in their order; the type is kept. Panics when one is out of range.
    pub(crate) fn gathered(&self, indices: impl Iterator<Item = usize>) -> Values {
        with_values!(self, v => indices.map(|i| v[i]).collect::<Vec<_>>().into_values())
    }
    /// Appends `other`, which must have the same type; otherwise both become f64.
    pub fn append(&mut self, other: &Values) {
        match (&mut *self, other) {
            (Values::I8(a), Values::I8(b)) => a.extend_from_slice(b),
            (Values::U8(a), Values::U8(b)) => a.extend_from_slice(b),
            (Values::I16(a), Values::I16(b)) => a.extend_from_slice(b),
            (Values::U16(a), Values::U16(b)) => a.extend_from_slice(b),
            (Values::I32(a), Values::I32(b)) => a.extend_from_slice(b),
            (Values::U32(a), Values::U32(b)) => a.extend_from_slice(b),
            (Values::I64(a), Values::I64(b)) => a.extend_from_slice(b),
            (Values::U64(a), Values::U64(b)) => a.extend_from_slice(b),
            (Values::F32(a), Values::F32(b)) => a.extend_from_slice(b),
            (Values::F64(a), Values::F64(b)) => a.extend_from_slice(b),
            (a, b) => {
                let all =
                    (0..a.len()).map(|i| a.get_f64(i)).chain((0..b.len()).map(|i| b.get_f64(i)));
                *self = Values::F64(all.collect());
            }
        }
    }
}

/// A named array: `tuples` x `components` values, components fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct DataArray {
    /// Its name in the file.
    pub name: String,
    /// Values per tuple, at least 1.
    pub components: usize,
    /// All values.
    pub values: Values,
}

impl DataArray {
    /// An array with `components` values per tuple.
    pub fn new(name: impl Into<String>, components: usize, values: Values) -> Self {
        DataArray { name: name.into(), components: components.max(1), values }
    }
    /// Number of whole tuples.
    pub fn tuples(&self) -> usize {
        self.values.len() / self.components.max(1)
    }
    /// Component `c` of tuple `i` as f64; panics when out of range.
    pub fn get(&self, i: usize, c: usize) -> f64 {
        self.values.get_f64(i * self.components + c)
    }
    /// Euclidean length of tuple `i`; a single component keeps its sign.
    pub fn magnitude(&self, i: usize) -> f64 {
        if self.components == 1 {
            return self.get(i, 0);
        }
        (0..self.components).map(|c| self.get(i, c).powi(2)).sum::<f64>().sqrt()
    }
    /// Smallest and largest finite value over all components.
    pub fn range(&self) -> Option<(f64, f64)> {
        let (lo, hi) = (0..self.values.len())
            .map(|i| self.values.get_f64(i))
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        (lo <= hi).then_some((lo, hi))
    }
}

/// The arrays of a data set. The names in the last fields say which array VTK regards as the
/// normals and so on.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attributes {
    /// One tuple per point.
    pub point: Vec<DataArray>,
    /// One tuple per cell.
    pub cell: Vec<DataArray>,
    /// Arrays of any length that belong to the data set as a whole.
    pub field: Vec<DataArray>,
    /// Names and texts that belong to the data set as a whole.
    pub text: Vec<(String, Vec<String>)>,
    /// Name of the point array with normals.
    pub point_normals: Option<String>,
    /// Name of the cell array with normals.
    pub cell_normals: Option<String>,
    /// Name of the point array with texture coordinates.
    pub point_texcoords: Option<String>,
    /// Name of the point array that the file marks as the scalars.
    pub point_scalars: Option<String>,
    /// Name of the cell array that the file marks as the scalars.
    pub cell_scalars: Option<String>,
}

impl Attributes {
    /// The point array of this name.
    pub fn point_array(&self, name: &str) -> Option<&DataArray> {
        self.point.iter().find(|a| a.name == name)
    }
    /// The cell array of this name.
    pub fn cell_array(&self, name: &str) -> Option<&DataArray> {
        self.cell.iter().find(|a| a.name == name)
    }
    /// The field array of this name.
    pub fn field_array(&self, name: &str) -> Option<&DataArray> {
        self.field.iter().find(|a| a.name == name)
    }
}

/// A number as Fortran writes it: the letter of the exponent may be D, or be missing (`1.0-101`).
pub(crate) fn fortran_number(word: &str) -> Option<f64> {
    if let Ok(x) = word.parse() {
        return Some(x);
    }
    if let Ok(x) = word.replace(['d', 'D'], "e").parse() {
        return Some(x);
    }
    let at = word.rfind(['+', '-']).filter(|&at| at > 0)?;
    format!("{}e{}", &word[..at], &word[at..]).parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_fortran_have_any_exponent() {
        let words = ["1.5D+02", "3.300003+000", "-2.5-101", "4d0"];
        let values = Values::from_words(ScalarType::F64, words.into_iter()).unwrap();
        assert!(matches!(&values, Values::F64(v) if *v == [150.0, 3.300003, -2.5e-101, 4.0]));
        let single = Values::from_words(ScalarType::F32, words[..2].iter().copied()).unwrap();
        assert!(matches!(&single, Values::F32(v) if *v == [150.0, 3.300003]));
        let whole = Values::from_words(ScalarType::I32, ["3.0D1"].into_iter()).unwrap();
        assert!(matches!(&whole, Values::I32(v) if *v == [30]));
        for wrong in ["1.5D", "+-3", "3+", "x-1", "1-2-3"] {
            assert!(Values::from_words(ScalarType::F64, [wrong].into_iter()).is_err(), "{wrong}");
        }
        assert!(Values::from_words(ScalarType::I32, ["1.5D0"].into_iter()).is_err());
    }
}
