//! Joins what several places have in one rectangle, as it arrives, into the canonical grouping.
//!
//! For formats with depth the grouping does not matter as long as ties go to the last place, so one layer takes everything: first
//! the place that comes first in time, then its neighbours in either direction; what comes before its neighbour has waits. For
//! blended formats two groups are joined as soon as both are there, and layers are only made where two messages meet.
use crate::layer::{Layer, View};
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;
use crate::session::Message;
use crate::simd::Kernels;
use crate::simd::expand::Side;

/// Pixels of one place, or of several already joined.
pub(crate) enum Item<'a, P: Composite> {
    View(View<'a, P>),
    Message(Message),
    Layer(Layer<P>),
}

impl<P: Composite> Item<'_, P> {
    fn rect(&self) -> Rect {
        match self {
            Self::View(view) => view.bounds,
            Self::Message(message) => message.rect(),
            Self::Layer(layer) => layer.bounds,
        }
    }
}

/// Buffers to work in, kept from frame to frame.
#[derive(Debug)]
pub(crate) struct Scratch<P: Composite> {
    pub(crate) kernels: Kernels,
    pub(crate) layers: Vec<Layer<P>>,
    /// Messages that have been read, for the communicator.
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

    /// `item` as a layer of at least `bounds`.
    fn layer(&mut self, item: Item<'_, P>, bounds: Rect) -> Layer<P> {
        match item {
            Item::Layer(layer) => {
                let spare = if layer.bounds.contains(&bounds) { None } else { self.layers.pop() };
                layer.grown(bounds, spare)
            }
            Item::View(view) => {
                let spare = self.layers.pop();
                Layer::copied(bounds, &view, self.kernels, spare)
            }
            Item::Message(message) => {
                let mut layer = self.empty(bounds);
                message.part::<P>().place_in(self.kernels, &mut layer);
                self.read.push(message.bytes);
                layer
            }
        }
    }

    fn join(&mut self, layer: &mut Layer<P>, item: Item<'_, P>, side: Side) {
        match item {
            Item::View(view) => layer.join_view(self.kernels, &view, side),
            Item::Message(message) => {
                message.part::<P>().join_to(self.kernels, layer, side);
                self.read.push(message.bytes);
            }
            Item::Layer(other) => {
                layer.join_view(self.kernels, &other.view(), side);
                self.layers.push(other);
            }
        }
    }
}

/// What has come for one rectangle and how far it is joined.
pub(crate) struct Join<'a, P: Composite> {
    bounds: Rect,
    missing: usize,
    order: Order<'a, P>,
}

enum Order<'a, P: Composite> {
    /// Items that wait for their neighbours, by place among those expected; the layer has `first..end` of them.
    Nearest {
        waiting: Vec<Option<Item<'a, P>>>,
        places: Vec<usize>,
        layer: Option<Layer<P>>,
        first: usize,
        end: usize,
    },
    /// A heap: node 1 is the whole, nodes 2i and 2i + 1 are the halves of i, the last half of all nodes are the places.
    Tree { nodes: Vec<Node<'a, P>>, folding: Folding },
}

enum Node<'a, P: Composite> {
    Missing,
    /// Complete; `None` if nobody below drew anything.
    Done(Option<Item<'a, P>>),
}

impl<'a, P: Composite> Join<'a, P> {
    /// Of `places` places those for which `contributes` says so will come.
    pub(crate) fn new(bounds: Rect, places: usize, contributes: impl Fn(usize) -> bool) -> Self {
        let expected: Vec<usize> = (0..places).filter(|&place| contributes(place)).collect();
        let missing = expected.len();
        if P::HAS_DEPTH {
            let waiting = (0..missing).map(|_| None).collect();
            return Self {
                bounds,
                missing,
                order: Order::Nearest { waiting, places: expected, layer: None, first: 0, end: 0 },
            };
        }
        let folding = Folding::new(places);
        let mut nodes: Vec<_> = (0..4 * folding.slots.max(1)).map(|_| Node::Done(None)).collect();
        for place in expected {
            let mut node = leaf(&folding, place);
            while node > 0 {
                nodes[node] = Node::Missing;
                node /= 2;
            }
        }
        Self { bounds, missing, order: Order::Tree { nodes, folding } }
    }

    /// Whether all have come.
    pub(crate) fn is_complete(&self) -> bool {
        self.missing == 0
    }

    /// Takes what `place` has.
    pub(crate) fn put(&mut self, place: usize, item: Item<'a, P>, scratch: &mut Scratch<P>) {
        self.missing = self.missing.saturating_sub(1);
        match &mut self.order {
            Order::Nearest { waiting, places, layer, first, end } => {
                let Ok(index) = places.binary_search(&place) else { return };
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
                    scratch.join(held, item, Side::Higher);
                    *end += 1;
                }
                while let Some(item) = first.checked_sub(1).and_then(|before| waiting[before].take()) {
                    scratch.join(held, item, Side::Lower);
                    *first -= 1;
                }
            }
            Order::Tree { nodes, folding } => {
                let mut node = leaf(folding, place);
                let mut item = Some(item);
                while node > 1 {
                    let other = std::mem::replace(&mut nodes[node ^ 1], Node::Missing);
                    let Node::Done(other) = other else { break };
                    nodes[node ^ 1] = Node::Done(None);
                    let (lower, higher) =
                        if node & 1 == 0 { (item.take(), other) } else { (other, item.take()) };
                    item = match (lower, higher) {
                        (Some(lower), Some(higher)) => Some(joined(lower, higher, scratch)),
                        (one, None) | (None, one) => one,
                    };
                    node /= 2;
                }
                nodes[node] = Node::Done(item);
            }
        }
    }

    /// The layer of all, `None` if nobody contributed. To be called when [`is_complete`](Self::is_complete).
    pub(crate) fn finish(self, scratch: &mut Scratch<P>) -> Option<Layer<P>> {
        match self.order {
            Order::Nearest { layer, .. } => layer,
            Order::Tree { mut nodes, .. } => match std::mem::replace(&mut nodes[1], Node::Missing) {
                Node::Done(Some(item)) => Some(scratch.layer(item, self.bounds)),
                Node::Done(None) | Node::Missing => None,
            },
        }
    }
}

/// The node of a place: two leaves for every slot, the second for the partner that is folded into it.
fn leaf(folding: &Folding, place: usize) -> usize {
    let slot = folding.slot(place);
    2 * folding.slots + 2 * slot + usize::from(folding.leader(slot) != place)
}

/// Two neighbours as one, in whichever of the two is a layer already.
fn joined<'a, P: Composite>(
    lower: Item<'a, P>,
    higher: Item<'a, P>,
    scratch: &mut Scratch<P>,
) -> Item<'a, P> {
    match (lower, higher) {
        (lower @ (Item::View(_) | Item::Message(_)), Item::Layer(layer)) => {
            let mut layer = scratch.layer(Item::Layer(layer), lower.rect());
            scratch.join(&mut layer, lower, Side::Lower);
            Item::Layer(layer)
        }
        (lower, higher) => {
            let bounds = lower.rect().around(&higher.rect());
            let mut layer = scratch.layer(lower, bounds);
            scratch.join(&mut layer, higher, Side::Higher);
            Item::Layer(layer)
        }
    }
}
