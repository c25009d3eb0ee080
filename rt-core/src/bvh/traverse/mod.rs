//! Traversal of the 8-wide hierarchy.

pub(crate) mod block_boxes;
pub(crate) mod block_entries;
pub(crate) mod block_hits;
mod child_order;
mod hybrid;
pub(crate) mod incoherent;
pub(crate) mod interleaved;
pub(crate) mod leaf_kind;
pub(crate) mod meshlets;
pub(crate) mod packet;
mod scattered;
pub(crate) mod single;
pub(crate) mod timed_choice;
pub(crate) mod tree_view;
pub(crate) mod triangle_leaf;

/// `[f(0), f(1), f(2)]` written out. Closures handed to library functions such as `array::from_fn`
/// are compiled without the instruction set of the function around them, and every vector operation
/// in them becomes a call (measured: half the speed).
macro_rules! three {
    (|$i:ident| $e:expr) => {{
        [
            {
                let $i = 0usize;
                $e
            },
            {
                let $i = 1usize;
                $e
            },
            {
                let $i = 2usize;
                $e
            },
        ]
    }};
}
pub(crate) use three;
