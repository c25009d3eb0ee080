//! What a simulation gives: a tree with names, text and numbers. It has the shape of Conduit's
//! nodes; arrays stay where the simulation has them.

use bytemuck::Pod;
use datasets::model::{Endian, ScalarType, Values};

/// A node of the tree.
#[derive(Debug, Clone, Default)]
pub enum Node<'a> {
    /// Nothing was set.
    #[default]
    Empty,
    /// Nodes with names. Those of a list are named 0, 1, 2, ...
    Children(Vec<(String, Node<'a>)>),
    /// Text.
    Text(String),
    /// One number or an array.
    Numbers(Numbers<'a>),
}

/// Numbers in memory of the simulation.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<'a> {
    /// From the first byte of the first number to the last byte of the last.
    bytes: &'a [u8],
    kind: ScalarType,
    count: usize,
    /// Bytes from one number to the next.
    stride: usize,
}

/// A type of numbers.
pub trait Scalar: Pod {
    /// Its name.
    const KIND: ScalarType;
}

macro_rules! scalars {
    ($($t:ty => $kind:ident),*) => { $( impl Scalar for $t {
        const KIND: ScalarType = ScalarType::$kind;
    } )* };
}
scalars!(
    i8 => I8, u8 => U8, i16 => I16, u16 => U16, i32 => I32, u32 => U32, i64 => I64, u64 => U64,
    f32 => F32, f64 => F64
);

/// Runs `$body` with `$t` as the Rust type of a [`ScalarType`].
macro_rules! with_type {
    ($kind:expr, $t:ident => $body:expr) => {
        match $kind {
            ScalarType::I8 => with_type!(@ i8, $t, $body),
            ScalarType::U8 => with_type!(@ u8, $t, $body),
            ScalarType::I16 => with_type!(@ i16, $t, $body),
            ScalarType::U16 => with_type!(@ u16, $t, $body),
            ScalarType::I32 => with_type!(@ i32, $t, $body),
            ScalarType::U32 => with_type!(@ u32, $t, $body),
            ScalarType::I64 => with_type!(@ i64, $t, $body),
            ScalarType::U64 => with_type!(@ u64, $t, $body),
            ScalarType::F32 => with_type!(@ f32, $t, $body),
            ScalarType::F64 => with_type!(@ f64, $t, $body),
        }
    };
    (@ $type:ty, $t:ident, $body:expr) => {{
        type $t = $type;
        $body
    }};
}

impl<'a> Numbers<'a> {
    /// All numbers of a slice.
    pub fn of<T: Scalar>(values: &'a [T]) -> Numbers<'a> {
        let bytes = bytemuck::cast_slice(values);
        Numbers { bytes, kind: T::KIND, count: values.len(), stride: size_of::<T>() }
    }

    /// `count` numbers, each `stride` bytes behind the one before; `None` if the last one ends
    /// behind `bytes`.
    pub fn strided(
        bytes: &'a [u8],
        kind: ScalarType,
        count: usize,
        stride: usize,
    ) -> Option<Numbers<'a>> {
        let end = match count.checked_sub(1) {
            Some(steps) => steps.checked_mul(stride)?.checked_add(kind.size())?,
            None => 0,
        };
        Some(Numbers { bytes: bytes.get(..end)?, kind, count, stride })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Their type.
    pub fn kind(&self) -> ScalarType {
        self.kind
    }

    /// The numbers as a slice, if they are of this type, without gaps and aligned.
    pub fn as_slice<T: Scalar>(&self) -> Option<&'a [T]> {
        let matches = self.kind == T::KIND && self.stride == size_of::<T>();
        if matches { bytemuck::try_cast_slice(self.bytes).ok() } else { None }
    }

    /// Number `i` as `f64` (64-bit integers beyond 2^53 round). Panics when out of range.
    #[inline]
    #[allow(clippy::unnecessary_cast, reason = "the macro covers f64 too")]
    pub fn get_f64(&self, i: usize) -> f64 {
        with_type!(self.kind, T => self.get::<T>(i) as f64)
    }

    /// Number `i` as an integer; `None` for a fraction and for what has no place in `i64`. Panics
    /// when out of range.
    pub fn get_i64(&self, i: usize) -> Option<i64> {
        match self.kind {
            ScalarType::U64 => i64::try_from(self.get::<u64>(i)).ok(),
            ScalarType::I64 => Some(self.get::<i64>(i)),
            _ => {
                // Exact in f64, as all other types are.
                let value = self.get_f64(i);
                let whole = value as i64;
                (whole as f64 == value && whole != i64::MAX).then_some(whole)
            }
        }
    }

    /// A copy without gaps, of the same type.
    pub fn to_values(&self) -> Values {
        if self.stride == self.kind.size() {
            return Values::from_bytes(self.kind, self.bytes, Endian::Little);
        }
        let size = self.kind.size();
        let numbers = (0..self.count).flat_map(|i| &self.bytes[i * self.stride..][..size]);
        let bytes: Vec<u8> = numbers.copied().collect();
        Values::from_bytes(self.kind, &bytes, Endian::Little)
    }

    #[inline]
    fn get<T: Scalar>(&self, i: usize) -> T {
        bytemuck::pod_read_unaligned(&self.bytes[i * self.stride..][..size_of::<T>()])
    }
}

impl<'a> Node<'a> {
    /// The node at `path`, names with slashes between.
    pub fn get(&self, path: &str) -> Option<&Node<'a>> {
        path.split('/').try_fold(self, |node, name| {
            let mut children = node.children().iter();
            children.find(|(n, _)| n == name).map(|(_, child)| child)
        })
    }

    /// The children with their names; none for text and numbers.
    pub fn children(&self) -> &[(String, Node<'a>)] {
        match self {
            Node::Children(children) => children,
            _ => &[],
        }
    }

    /// Text.
    pub fn text(&self) -> Option<&str> {
        match self {
            Node::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Numbers.
    pub fn numbers(&self) -> Option<Numbers<'a>> {
        match self {
            Node::Numbers(numbers) => Some(*numbers),
            _ => None,
        }
    }

    /// The first number as `f64`.
    pub fn f64(&self) -> Option<f64> {
        self.numbers().filter(|n| !n.is_empty()).map(|n| n.get_f64(0))
    }

    /// The first number as an integer, if it is one.
    pub fn i64(&self) -> Option<i64> {
        self.numbers().filter(|n| !n.is_empty()).and_then(|n| n.get_i64(0))
    }

    /// Text at `path`.
    pub fn text_at(&self, path: &str) -> Option<&str> {
        self.get(path).and_then(Node::text)
    }

    /// Puts `node` at `path`; what is on the way and has no children is replaced.
    pub fn set(&mut self, path: &str, node: Node<'a>) {
        let (name, rest) = match path.split_once('/') {
            Some((name, rest)) => (name, Some(rest)),
            None => (path, None),
        };
        if !matches!(self, Node::Children(_)) {
            *self = Node::Children(Vec::new());
        }
        let Node::Children(children) = self else { return };
        let at = children.iter().position(|(n, _)| n == name).unwrap_or_else(|| {
            children.push((name.to_owned(), Node::Empty));
            children.len() - 1
        });
        match rest {
            Some(rest) => children[at].1.set(rest, node),
            None => children[at].1 = node,
        }
    }
}

impl<'a, T: Scalar> From<&'a [T]> for Node<'a> {
    fn from(values: &'a [T]) -> Node<'a> {
        Node::Numbers(Numbers::of(values))
    }
}

impl From<&str> for Node<'_> {
    fn from(text: &str) -> Self {
        Node::Text(text.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_with_gaps_are_read_where_they_are() {
        // x and y of three points, one behind the other.
        let pairs = [1.0_f64, 10.0, 2.0, 20.0, 3.0, 30.0];
        let bytes: &[u8] = bytemuck::cast_slice(&pairs);
        let y = Numbers::strided(&bytes[8..], ScalarType::F64, 3, 16).unwrap();
        assert_eq!([0, 1, 2].map(|i| y.get_f64(i)), [10.0, 20.0, 30.0]);
        assert_eq!(y.to_values(), Values::F64(vec![10.0, 20.0, 30.0]));
        assert!(y.as_slice::<f64>().is_none());
        let all = Numbers::of(&pairs[..]);
        assert_eq!(all.as_slice::<f64>(), Some(&pairs[..]));
        assert!(all.as_slice::<i64>().is_none());
        assert!(Numbers::strided(&bytes[8..], ScalarType::F64, 4, 16).is_none());
        assert!(Numbers::strided(bytes, ScalarType::F64, usize::MAX, 16).is_none());
    }

    #[test]
    fn numbers_at_odd_addresses_are_read() {
        let mut bytes = vec![0_u8];
        bytes.extend([7_i32, -7].iter().flat_map(|v| v.to_le_bytes()));
        let numbers = Numbers::strided(&bytes[1..], ScalarType::I32, 2, 4).unwrap();
        assert_eq!([numbers.get_i64(0), numbers.get_i64(1)], [Some(7), Some(-7)]);
    }

    #[test]
    fn integers_are_exact_or_none() {
        let first = |node: Node<'_>| node.i64();
        assert_eq!(first(Node::from(&[(1_i64 << 53) + 1][..])), Some((1 << 53) + 1));
        assert_eq!(first(Node::from(&[u64::MAX][..])), None);
        assert_eq!(first(Node::from(&[2.5_f64][..])), None);
        assert_eq!(first(Node::from(&[f32::NAN][..])), None);
        assert_eq!(first(Node::from(&[1e300_f64][..])), None);
        assert_eq!(first(Node::from(&[0_u8; 0][..])), None);
    }

    #[test]
    fn what_is_set_at_a_path_is_found_there() {
        let mut node = Node::default();
        node.set("state/cycle", Node::from(&[3_i32][..]));
        node.set("state/name", "a".into());
        assert_eq!(node.get("state/cycle").and_then(Node::i64), Some(3));
        assert_eq!(node.text_at("state/name"), Some("a"));
        assert!(node.get("state/cycle/more").is_none() && node.get("").is_none());
        assert_eq!(node.get("state").map(|n| n.children().len()), Some(2));
    }
}
