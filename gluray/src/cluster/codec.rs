//! Encodes values as bytes and decodes them bit by bit. Colours and depths must not change in
//! transit, and a message is accepted only when it is complete.

use bytemuck::Pod;

/// A malformed message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("byte {at}: {what}")]
pub(crate) struct MalformedMessage {
    /// The offset at which reading stopped.
    pub(crate) at: usize,
    /// What was wrong.
    pub(crate) what: String,
}

/// A message that is being decoded.
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Reader<'a> {
        Reader { bytes, at: 0 }
    }

    pub(crate) fn fault(&self, what: impl Into<String>) -> MalformedMessage {
        MalformedMessage { at: self.at, what: what.into() }
    }

    pub(crate) fn take(&mut self, n: usize) -> Result<&'a [u8], MalformedMessage> {
        let part = self.bytes.get(self.at..).and_then(|rest| rest.get(..n));
        let part = part.ok_or_else(|| self.fault(format!("{n} bytes more were expected")))?;
        self.at += n;
        Ok(part)
    }

    /// A list of plain numbers.
    pub(crate) fn pods<T: Pod>(&mut self) -> Result<Vec<T>, MalformedMessage> {
        let n = usize::try_from(u64::get(self)?).unwrap_or(usize::MAX);
        let bytes =
            n.checked_mul(size_of::<T>()).ok_or_else(|| self.fault("a list without end"))?;
        let bytes = self.take(bytes)?;
        let mut out = vec![T::zeroed(); n];
        bytemuck::cast_slice_mut(&mut out).copy_from_slice(bytes);
        Ok(out)
    }

    /// Checks that nothing follows the last value.
    pub(crate) fn end(&self) -> Result<(), MalformedMessage> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            n => Err(self.fault(format!("{n} bytes too many"))),
        }
    }
}

/// A list of plain numbers, with its length.
pub(crate) fn put_pods<T: Pod>(out: &mut Vec<u8>, values: &[T]) {
    (values.len() as u64).put(out);
    out.extend_from_slice(bytemuck::cast_slice(values));
}

/// A type that can be sent.
pub(crate) trait Wire: Sized {
    /// Appends the bytes.
    fn put(&self, out: &mut Vec<u8>);
    /// Reads them.
    ///
    /// # Errors
    /// [`MalformedMessage`] when they are none.
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage>;
}

macro_rules! numbers {
    ($($t:ty),*) => { $(
        impl Wire for $t {
            fn put(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_ne_bytes());
            }
            fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
                let bytes = from.take(size_of::<$t>())?;
                Ok(<$t>::from_ne_bytes(bytes.try_into().expect("as many as were taken")))
            }
        }
    )* };
}
numbers!(u8, u32, u64, u128, i32, f32, f64);

impl Wire for bool {
    fn put(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        match u8::get(from)? {
            0 => Ok(false),
            1 => Ok(true),
            n => Err(from.fault(format!("{n} is neither true nor false"))),
        }
    }
}

impl Wire for usize {
    fn put(&self, out: &mut Vec<u8>) {
        (*self as u64).put(out);
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        usize::try_from(u64::get(from)?).map_err(|_| from.fault("a number too large"))
    }
}

impl<T: Wire + Copy, const N: usize> Wire for [T; N] {
    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|v| v.put(out));
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        let mut out = [None; N];
        for slot in &mut out {
            *slot = Some(T::get(from)?);
        }
        Ok(out.map(|v| v.expect("each was read")))
    }
}

impl<T: Wire> Wire for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|v| v.put(out));
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        let n = usize::get(from)?;
        // No memory is reserved when a message claims more values than it has bytes.
        if n > from.bytes.len() - from.at {
            return Err(
                from.fault(format!("a list of {n} values in {} bytes", from.bytes.len() - from.at))
            );
        }
        (0..n).map(|_| T::get(from)).collect()
    }
}

impl<T: Wire> Wire for Option<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        self.iter().for_each(|v| v.put(out));
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        Ok(if bool::get(from)? { Some(T::get(from)?) } else { None })
    }
}

impl<A: Wire, B: Wire> Wire for (A, B) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        Ok((A::get(from)?, B::get(from)?))
    }
}

impl Wire for String {
    fn put(&self, out: &mut Vec<u8>) {
        put_pods(out, self.as_bytes());
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        String::from_utf8(from.pods()?).map_err(|_| from.fault("text that is no UTF-8"))
    }
}

/// Encodes a struct field by field. All of its fields must be named.
macro_rules! wire_struct {
    ($t:ident { $($field:ident),* $(,)? }) => {
        impl $crate::cluster::codec::Wire for $t {
            fn put(&self, out: &mut Vec<u8>) {
                $( $crate::cluster::codec::Wire::put(&self.$field, out); )*
            }
            fn get(
                from: &mut $crate::cluster::codec::Reader<'_>,
            ) -> Result<Self, $crate::cluster::codec::MalformedMessage> {
                Ok($t { $( $field: $crate::cluster::codec::Wire::get(from)?, )* })
            }
        }
    };
}
pub(crate) use wire_struct;

/// Encodes a fieldless enum as its index in a list.
macro_rules! wire_enum {
    ($t:ident { $($variant:ident),* $(,)? }) => {
        impl $crate::cluster::codec::Wire for $t {
            fn put(&self, out: &mut Vec<u8>) {
                const ALL: &[$t] = &[$($t::$variant),*];
                let at = ALL.iter().position(|v| v == self).expect("all variants are listed");
                out.push(at as u8);
            }
            fn get(
                from: &mut $crate::cluster::codec::Reader<'_>,
            ) -> Result<Self, $crate::cluster::codec::MalformedMessage> {
                const ALL: &[$t] = &[$($t::$variant),*];
                let at = u8::get(from)?;
                let found = ALL.get(usize::from(at)).copied();
                found.ok_or_else(|| from.fault(format!("{at} is no {}", stringify!($t))))
            }
        }
    };
}
pub(crate) use wire_enum;

/// The bytes of a value.
pub(crate) fn bytes_of<T: Wire>(value: &T) -> Vec<u8> {
    let mut out = Vec::new();
    value.put(&mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_bits_and_what_is_not_whole_is_refused() {
        let value = (
            vec![f32::NAN, -0.0, f32::MIN_POSITIVE / 8.0],
            (Some([1_u32, 2]), ("text".to_owned(), vec![true, false])),
        );
        let bytes = bytes_of(&value);
        let mut from = Reader::new(&bytes);
        let back =
            <(Vec<f32>, (Option<[u32; 2]>, (String, Vec<bool>)))>::get(&mut from).expect("whole");
        from.end().expect("nothing more");
        assert_eq!(bytes_of(&back), bytes);
        for n in 0..bytes.len() {
            let mut from = Reader::new(&bytes[..n]);
            assert!(
                <(Vec<f32>, (Option<[u32; 2]>, (String, Vec<bool>)))>::get(&mut from).is_err(),
                "{n}"
            );
        }
        let lie = bytes_of(&u64::MAX);
        assert!(Vec::<u64>::get(&mut Reader::new(&lie)).is_err());
        assert!(Reader::new(&lie).pods::<f64>().is_err());
        assert!(bool::get(&mut Reader::new(&[2])).is_err());
    }
}
