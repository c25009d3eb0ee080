//! Merges the contributions of several ranks to one rectangle as they arrive, in the canonical
//! grouping.
//!
//! For formats with depth the grouping does not matter as long as ties go to the last rank in
//! order, so one layer takes everything: first the contribution that arrives first, then its
//! neighbours in either direction. A contribution that arrives before its neighbour waits. For
//! blended formats two groups are merged as soon as both are complete, and a layer is only made
//! where two messages are merged.
use crate::frame_exchange::Message;
use crate::layer::{Layer, View};
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;
use crate::simd::Kernels;
use crate::simd::expand::Side;

/// Pixels of one rank, or of several that are merged already.
pub(crate) enum MergeInput<'a, P: Composite> {
    View(View<'a, P>),
    Message(Message),
    Layer(Layer<P>),
}

impl<P: Composite> MergeInput<'_, P> {
    fn rect(&self) -> Rect {
        match self {
            Self::View(view) => view.bounds,
            Self::Message(message) => message.rect(),
            Self::Layer(layer) => layer.bounds,
        }
    }
}

/// Scratch buffers that are kept from frame to frame.
#[derive(Debug)]
pub(crate) struct Scratch<P: Composite> {
    pub(crate) kernels: Kernels,
    pub(crate) layers: Vec<Layer<P>>,
    /// Messages that have been read, to be recycled by the communicator.
    pub(crate) read: Vec<Vec<u8>>,
}

impl<P: Composite> Scratch<P> {
    pub(crate) fn new(kernels: Kernels) -> Self {
        Self { kernels, layers: Vec::new(), read: Vec::new() }
    }

    fn empty(&mut self, bounds: Rect) -> Layer<P> {
        let spare = self.layers.pop();
        Layer::empty(bounds, spare)
    }

    /// Converts `item` to a layer that covers at least `bounds`.
    fn layer(&mut self, item: MergeInput<'_, P>, bounds: Rect) -> Layer<P> {
        match item {
            MergeInput::Layer(layer) => {
                let spare = if layer.bounds.contains(&bounds) { None } else { self.layers.pop() };
                layer.grown(bounds, spare)
            }
            MergeInput::View(view) => {
                let spare = self.layers.pop();
                Layer::copied(bounds, &view, self.kernels, spare)
            }
            MergeInput::Message(message) => {
                let mut layer = self.empty(bounds);
                message.part::<P>().copy_to_layer(self.kernels, &mut layer);
                self.read.push(message.bytes);
                layer
            }
        }
    }

    fn merge(&mut self, layer: &mut Layer<P>, item: MergeInput<'_, P>, side: Side) {
        match item {
            MergeInput::View(view) => layer.merge_view(self.kernels, &view, side),
            MergeInput::Message(message) => {
                message.part::<P>().merge_into(self.kernels, layer, side);
                self.read.push(message.bytes);
            }
            MergeInput::Layer(other) => {
                layer.merge_view(self.kernels, &other.view(), side);
                self.layers.push(other);
            }
        }
    }
}

/// The contributions to one rectangle that have arrived, and how far they are merged.
pub(crate) struct Merge<'a, P: Composite> {
    bounds: Rect,
    missing: usize,
    order: MergeOrder<'a, P>,
}

enum MergeOrder<'a, P: Composite> {
    /// `waiting` holds the items that wait for their neighbours, by position among the expected
    /// ranks. The layer holds `first..end` of them.
    Nearest {
        waiting: Vec<Option<MergeInput<'a, P>>>,
        order_indices: Vec<usize>,
        layer: Option<Layer<P>>,
        first: usize,
        end: usize,
    },
    /// A heap: node 1 is the root, nodes 2i and 2i + 1 are the children of node i, and the last
    /// half of the nodes are the ranks.
    Tree { nodes: Vec<TreeNode<'a, P>>, folding: Folding },
}

enum TreeNode<'a, P: Composite> {
    Missing,
    /// Complete; `None` if no rank below this node drew anything.
    Done(Option<MergeInput<'a, P>>),
}

impl<'a, P: Composite> Merge<'a, P> {
    /// Expects a contribution from each order index below `num_ranks` for which `contributes` is
    /// true.
    pub(crate) fn new(bounds: Rect, num_ranks: usize, contributes: impl Fn(usize) -> bool) -> Self {
        let expected: Vec<usize> =
            (0..num_ranks).filter(|&order_index| contributes(order_index)).collect();
        let missing = expected.len();
        if P::HAS_DEPTH {
            let waiting = (0..missing).map(|_| None).collect();
            return Self {
                bounds,
                missing,
                order: MergeOrder::Nearest {
                    waiting,
                    order_indices: expected,
                    layer: None,
                    first: 0,
                    end: 0,
                },
            };
        }
        let folding = Folding::new(num_ranks);
        let mut nodes: Vec<_> =
            (0..4 * folding.slots.max(1)).map(|_| TreeNode::Done(None)).collect();
        for order_index in expected {
            let mut node = leaf(&folding, order_index);
            while node > 0 {
                nodes[node] = TreeNode::Missing;
                node /= 2;
            }
        }
        Self { bounds, missing, order: MergeOrder::Tree { nodes, folding } }
    }

    /// Whether all contributions have arrived.
    pub(crate) fn is_complete(&self) -> bool {
        self.missing == 0
    }

    /// Adds the contribution of `order_index`.
    pub(crate) fn put(
        &mut self,
        order_index: usize,
        item: MergeInput<'a, P>,
        scratch: &mut Scratch<P>,
    ) {
        self.missing = self.missing.saturating_sub(1);
        match &mut self.order {
            MergeOrder::Nearest { waiting, order_indices, layer, first, end } => {
                let Ok(index) = order_indices.binary_search(&order_index) else { return };
                let held = match layer {
                    None => {
                        (*first, *end) = (index, index + 1);
                        layer.insert(scratch.layer(item, self.bounds))
                    }
                    Some(held) => {
                        waiting[index] = Some(item);
                        held
                    }
                };
                while let Some(item) = waiting.get_mut(*end).and_then(Option::take) {
                    scratch.merge(held, item, Side::Higher);
                    *end += 1;
                }
                while let Some(item) =
                    first.checked_sub(1).and_then(|before| waiting[before].take())
                {
                    scratch.merge(held, item, Side::Lower);
                    *first -= 1;
                }
            }
            MergeOrder::Tree { nodes, folding } => {
                let mut node = leaf(folding, order_index);
                let mut item = Some(item);
                while node > 1 {
                    let other = std::mem::replace(&mut nodes[node ^ 1], TreeNode::Missing);
                    let TreeNode::Done(other) = other else { break };
                    nodes[node ^ 1] = TreeNode::Done(None);
                    let (lower, higher) =
                        if node & 1 == 0 { (item.take(), other) } else { (other, item.take()) };
                    item = match (lower, higher) {
                        (Some(lower), Some(higher)) => Some(merge_pair(lower, higher, scratch)),
                        (one, None) | (None, one) => one,
                    };
                    node /= 2;
                }
                nodes[node] = TreeNode::Done(item);
            }
        }
    }

    /// The merged layer, `None` if no rank contributed. Call it when
    /// [`is_complete`](Self::is_complete).
    pub(crate) fn finish(self, scratch: &mut Scratch<P>) -> Option<Layer<P>> {
        match self.order {
            MergeOrder::Nearest { layer, .. } => layer,
            MergeOrder::Tree { mut nodes, .. } => {
                match std::mem::replace(&mut nodes[1], TreeNode::Missing) {
                    TreeNode::Done(Some(item)) => Some(scratch.layer(item, self.bounds)),
                    TreeNode::Done(None) | TreeNode::Missing => None,
                }
            }
        }
    }
}

/// The node of an order index. Every slot has two leaves; the second is for the partner that is
/// folded into it.
fn leaf(folding: &Folding, order_index: usize) -> usize {
    let slot = folding.slot(order_index);
    2 * folding.slots + 2 * slot + usize::from(folding.leader(slot) != order_index)
}

/// Merges two neighbours into one layer, and reuses the layer of either if there is one.
fn merge_pair<'a, P: Composite>(
    lower: MergeInput<'a, P>,
    higher: MergeInput<'a, P>,
    scratch: &mut Scratch<P>,
) -> MergeInput<'a, P> {
    match (lower, higher) {
        (lower @ (MergeInput::View(_) | MergeInput::Message(_)), MergeInput::Layer(layer)) => {
            let mut layer = scratch.layer(MergeInput::Layer(layer), lower.rect());
            scratch.merge(&mut layer, lower, Side::Lower);
            MergeInput::Layer(layer)
        }
        (lower, higher) => {
            let bounds = lower.rect().around(&higher.rect());
            let mut layer = scratch.layer(lower, bounds);
            scratch.merge(&mut layer, higher, Side::Higher);
            MergeInput::Layer(layer)
        }
    }
}
