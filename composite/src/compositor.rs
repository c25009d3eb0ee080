//! The entry point: one call on every rank composites one frame.
use crate::codec::{Codec, mix};
use crate::collect::Collector;
use crate::comm::{CommError, Communicator};
use crate::error::CompositeError;
use crate::frame::{Frame, Image, Piece};
use crate::frame_exchange::FrameExchange;
use crate::in_memory::{self, Merging};
use crate::machine_groups::{self, MachineGroup};
use crate::merge::Scratch;
use crate::network_costs::NetworkCosts;
use crate::pixel::{Composite, PixelFormat};
use crate::rect::Rect;
use crate::report::Report;
use crate::simd::{Kernels, SimdLevel};
use crate::strategies::Strategy;
use crate::tiles::SLICE_BYTES;
use std::time::Duration;

/// Where the finished image goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Destination {
    /// To one rank of the communicator, whole.
    Rank(usize),
    /// To no single rank: every rank keeps its piece, to save it or to show its part of a display
    /// wall.
    Distributed,
}

/// How to composite. Options must be the same on every rank (except `simd` and `timeout`);
/// otherwise ranks get [`MessageError::Fingerprint`](crate::MessageError::Fingerprint).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// How pixels are exchanged; changes the time, never the image.
    pub strategy: Strategy,
    /// Where the image goes.
    pub destination: Destination,
    /// Ranks from front to back, for premultiplied colours; each exactly once. `None` means rank 0
    /// is in front. For images with depth it only decides ties: the last rank in the order wins.
    pub order: Option<Vec<usize>>,
    /// Whether the collected image includes depths. They cost 4 bytes per drawn pixel in the
    /// messages to the rank that collects.
    pub depth: bool,
    /// Whether checksums cover the pixels of messages and not only their headers. For transports
    /// that may change bytes; it costs about a tenth of the time of a frame between threads.
    pub verify: bool,
    /// Most pixels of one message, about. Direct send cuts its tiles into slices of this size, so
    /// that one is encoded while another is in flight. `None` chooses.
    pub slice_px: Option<usize>,
    /// Whether ranks that are processes of one machine merge the image in shared memory, if the
    /// strategy is [`Strategy::DirectSend`] or [`Strategy::Automatic`] and the image goes to one
    /// rank. Where they are on several machines and [`Strategy::Automatic`] finds it faster, each
    /// machine merges what its ranks drew, and one rank of each sends that on; for this, ranks of a
    /// machine must be neighbours in the order, and for premultiplied colours all machines must
    /// have equally many ranks and both numbers be powers of two. Otherwise, and where there is no
    /// such memory, all ranks send messages.
    pub in_memory: bool,
    /// The instruction set; `None` is the best this machine has. Changes the time, never the image.
    pub simd: Option<SimdLevel>,
    /// Longest wait for one message without a sign of life from the ranks it depends on. A renderer
    /// that takes longer calls [`Communicator::alive`] regularly, for example for each tile.
    pub timeout: Duration,
    /// Whether all ranks wait for each other at the end, so that success on one rank means success
    /// on all. Without it a rank that has sent its part returns at once and learns of a fault of
    /// other ranks only with its next frame.
    pub final_barrier: bool,
}

impl Default for Options {
    /// Direct send to rank 0 with depths, ranks in order, 60 seconds, final barrier.
    fn default() -> Self {
        Self {
            strategy: Strategy::default(),
            destination: Destination::Rank(0),
            order: None,
            depth: true,
            verify: false,
            slice_px: None,
            in_memory: true,
            simd: None,
            timeout: Duration::from_secs(60),
            final_barrier: true,
        }
    }
}

/// What one rank gets.
#[derive(Clone, Debug, PartialEq)]
pub struct CompositeOutput<P: PixelFormat> {
    /// The whole image, on the destination rank.
    pub image: Option<Image<P>>,
    /// The piece this rank holds, with [`Destination::Distributed`].
    pub piece: Option<Piece<P>>,
    /// What it cost.
    pub report: Report,
}

/// Composites the frames of all ranks. Every rank of `comm` calls this once per frame with a frame
/// of the same size.
///
/// The result has the bits of [`composite_serial`](crate::composite_serial) over the frames in
/// `options.order`, whatever the strategy, the transport and the order in which messages arrive.
/// To composite many frames, use a [`Compositor`]: it keeps its buffers.
///
/// # Errors
/// [`CompositeError`]. A rank that fails aborts the communicator, so all other ranks get an error
/// too ([`CommError::Aborted`] with the reason) instead of waiting; the communicator cannot be used
/// afterwards.
pub fn composite<P: Composite>(
    comm: &mut dyn Communicator,
    frame: &Frame<'_, P>,
    options: &Options,
) -> Result<CompositeOutput<P>, CompositeError> {
    Compositor::new(options.clone()).composite(comm, frame)
}

/// [`composite`] for many frames; keeps its buffers.
#[derive(Debug)]
pub struct Compositor<P: Composite> {
    pub(crate) options: Options,
    pub(crate) scratch: Scratch<P>,
    pub(crate) spare: Option<Image<P>>,
    network: Option<NetworkCosts>,
    /// The buffer into which the frames of one node are merged.
    pub(crate) node_image: Option<Image<P>>,
}

impl<P: Composite> Compositor<P> {
    /// A compositor that has no buffers yet.
    pub fn new(options: Options) -> Self {
        let scratch = Scratch::new(Kernels::new(options.simd));
        Self { options, scratch, spare: None, network: None, node_image: None }
    }

    /// Sets known network costs, so that [`Strategy::Automatic`] need not measure them; pass the
    /// same on every rank.
    pub fn with_network(self, network: NetworkCosts) -> Self {
        Self { network: Some(network), ..self }
    }

    /// Its options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Sets another order from front to back ([`Options::order`]) for the next frames.
    pub fn set_order(&mut self, order: Option<Vec<usize>>) {
        self.options.order = order;
    }

    /// Takes back an image that is no longer needed, so that its memory is used for the next one.
    pub fn recycle(&mut self, image: Image<P>) {
        self.spare = Some(image);
    }

    /// As the function [`composite`].
    ///
    /// # Errors
    /// As [`composite`].
    pub fn composite(
        &mut self,
        comm: &mut dyn Communicator,
        frame: &Frame<'_, P>,
    ) -> Result<CompositeOutput<P>, CompositeError> {
        let result = self.composite_or_fail(comm, frame);
        if let Err(error) = &result {
            abort_group(comm, error);
        }
        result
    }

    fn composite_or_fail(
        &mut self,
        comm: &mut dyn Communicator,
        frame: &Frame<'_, P>,
    ) -> Result<CompositeOutput<P>, CompositeError> {
        let begin = comm.now();
        let options = &self.options;

        // Check options before any message is sent.
        let order = CompositingOrder::new(comm, options)?;
        options.strategy.check()?;
        let size_px = (frame.width_px(), frame.height_px());
        let may_share = options.in_memory
            && matches!(options.strategy, Strategy::DirectSend | Strategy::Automatic);
        let groups = match may_share {
            true => machine_groups::by_machine::<P>(comm, &order.ranks, order.root_index),
            false => None,
        };
        let is_one_group = groups.as_ref().is_some_and(|groups| groups.len() == 1);
        if options.strategy == Strategy::Automatic && self.network.is_none() && !is_one_group {
            self.network = Some(NetworkCosts::measure(comm, options.timeout)?);
        }

        // Find where this rank drew, unless the renderer has said so.
        let kernels = self.scratch.kernels;
        let fingerprint = fingerprint::<P>(size_px, options, &order, self.network.as_ref());
        let codec = Codec { kernels, fingerprint, verify: options.verify };
        let mut exchange =
            FrameExchange::new(comm, order.ranks.clone(), order.own_index, codec, options.timeout);
        exchange.counts_nan = frame.has_bounds();
        let drawn = if frame.has_bounds() {
            frame.bounds()
        } else {
            let (rect, counts) = frame.drawn(kernels);
            exchange.report.nan_depths = counts.nan;
            rect
        };
        exchange.report.compress_secs += exchange.now() - begin;
        let ranges =
            exchange.handshake(size_px, drawn, frame.depth_range().unwrap_or([f32::NAN; 2]))?;
        if !P::HAS_DEPTH {
            check_order(&exchange.drawn, &ranges, &order.ranks)?;
        }

        // Ranks of one machine merge in shared memory.
        let groups =
            groups.filter(|groups| in_memory::is_possible::<P>(&mut exchange, size_px, groups));
        let groups = groups.filter(|groups| match (options.strategy, &self.network) {
            _ if is_one_group => true,
            (Strategy::Automatic, Some(network)) => {
                machine_groups::pays::<P>(groups, network, &exchange.drawn, true)
            }
            _ => false,
        });
        let mut view = frame.view(drawn);
        let mut machine_image = None;
        if let Some(groups) = &groups {
            let among_others = groups.len() > 1;
            let of_rank = |group: &&MachineGroup| group.members.contains(&order.own_index);
            let group = groups.iter().find(of_rank).unwrap_or(&groups[0]);
            let own = match among_others {
                true => Merging::part(view, size_px, group, &exchange.drawn),
                false => Merging::whole(view, size_px, group, options.depth),
            };
            // A machine without memory would be known to its own ranks only. So those of several
            // merge only when all have it already; until then they send messages.
            let has_memory = |group: &MachineGroup| {
                let merging = Merging::part(view, size_px, group, &exchange.drawn);
                group.members.clone().all(|index| {
                    let bytes = merging.segment_bytes(index, &exchange.drawn[index]);
                    bytes <= exchange.shared_bytes[index]
                })
            };
            let has_memory = !among_others || groups.iter().all(has_memory);
            let merged = if has_memory {
                let spare = if among_others { &mut self.node_image } else { &mut self.spare };
                in_memory::run(&mut exchange, &own, spare.take(), kernels)?
            } else {
                let bytes = own.segment_bytes(order.own_index, &drawn);
                if let Some(memory) = exchange.comm.shared_segments() {
                    memory.reserve(bytes);
                }
                None
            };
            if let Some(image) = merged {
                exchange.report.in_memory = true;
                exchange.report.machines = groups.len();
                let leads = order.own_index == group.leader;
                if !among_others || !leads {
                    if among_others && options.final_barrier {
                        exchange.barrier()?;
                    }
                    let mut report = exchange.report;
                    report.total_secs = exchange.now() - begin;
                    return Ok(CompositeOutput { image, piece: None, report });
                }
                // The leaders composite what their machines have merged.
                let parts: Vec<Rect> =
                    groups.iter().map(|group| group.drawn(&exchange.drawn)).collect();
                let part = group.drawn(&exchange.drawn);
                let leaders: Vec<usize> = groups.iter().map(|group| group.leader).collect();
                exchange.restrict_to(&leaders, parts);
                exchange.counts_nan = false;
                machine_image = image;
                if let Some(image) = &machine_image {
                    view = Frame::of_image(image).view(part);
                }
            }
        }
        let root_index = match &groups {
            Some(groups) if machine_image.is_some() => groups.iter().position(leads_root(&order)),
            _ => order.root_index,
        };

        // Run the strategy and collect its pieces.
        let slice_px = options.slice_px.unwrap_or_else(|| slice_px::<P>(exchange.comm));
        let strategy = match (options.strategy, &self.network) {
            (Strategy::Automatic, Some(network)) => {
                network.choose::<P>(&exchange.drawn, root_index.is_some())
            }
            (strategy, _) => strategy,
        };
        let plan = strategy.plan::<P>(
            &exchange.drawn,
            slice_px,
            root_index.filter(|_| !exchange.comm.is_one_node()),
        );
        let pieces = plan.pieces(&exchange.drawn);
        let spare = self.spare.take();
        let mut collector =
            Collector::new(&mut exchange, size_px, root_index, options.depth, &pieces, spare)?;
        let span = exchange.begin_span();
        plan.run(&mut exchange, &view, &mut collector, &mut self.scratch)?;
        exchange.end_span(span, |report| &mut report.exchange_secs);
        let span = exchange.begin_span();
        let (image, piece) = collector.finish(&mut exchange)?;
        exchange.end_span(span, |report| &mut report.collect_secs);
        if options.final_barrier {
            exchange.barrier()?;
        }
        let mut report = exchange.report;
        report.strategy = strategy;
        report.total_secs = exchange.now() - begin;
        if machine_image.is_some() {
            self.node_image = machine_image;
        }
        Ok(CompositeOutput { image, piece, report })
    }
}

/// Whether a group's leader is the rank that gets the image.
fn leads_root(order: &CompositingOrder) -> impl Fn(&MachineGroup) -> bool + use<> {
    let root = order.root_index;
    move |group| root == Some(group.leader)
}

/// Aborts the group, unless another rank has.
pub(crate) fn abort_group(comm: &mut dyn Communicator, error: &CompositeError) {
    if !matches!(error, CompositeError::Comm(CommError::Aborted { .. })) {
        comm.abort(&error.to_string());
    }
}

/// Pixels of a slice: a quarter of a megabyte, merged and sent to the collecting rank while the
/// next one arrives. Where messages do not travel in the background, slices are fewer and larger:
/// half a megabyte costs a tenth more processor time at eight ranks than one.
pub(crate) fn slice_px<P: PixelFormat>(comm: &dyn Communicator) -> usize {
    (if comm.is_one_node() { 4 * SLICE_BYTES } else { SLICE_BYTES }) / P::BYTES
}

/// Ranks in the order of compositing.
pub(crate) struct CompositingOrder {
    pub(crate) ranks: Vec<usize>,
    pub(crate) own_index: usize,
    pub(crate) root_index: Option<usize>,
}

impl CompositingOrder {
    pub(crate) fn new(comm: &dyn Communicator, options: &Options) -> Result<Self, CompositeError> {
        let size = comm.size();
        let order = front_to_back(options.order.as_deref(), size)?;
        let order_index_of = |rank: usize| order.iter().position(|&other| other == rank);
        let own =
            order_index_of(comm.rank()).ok_or(CommError::NoSuchRank { peer: comm.rank(), size })?;
        let root = match options.destination {
            Destination::Distributed => None,
            Destination::Rank(rank) => Some(order_index_of(rank).ok_or_else(|| {
                CompositeError::Options(format!(
                    "the image is to go to rank {rank} of a group of {size} ranks"
                ))
            })?),
        };
        Ok(Self { ranks: order, own_index: own, root_index: root })
    }
}

pub(crate) fn front_to_back(
    order: Option<&[usize]>,
    size: usize,
) -> Result<Vec<usize>, CompositeError> {
    let Some(order) = order else {
        return Ok((0..size).collect());
    };
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    if sorted.iter().copied().eq(0..size) {
        return Ok(order.to_vec());
    }
    Err(CompositeError::Options(format!(
        "the order of compositing must name each of the {size} ranks exactly once, but is {order:?}"
    )))
}

/// Checks that ranks with overlapping rectangles are one behind the other in the order of
/// compositing, as far as they give a depth range.
fn check_order(drawn: &[Rect], ranges: &[[f32; 2]], order: &[usize]) -> Result<(), CompositeError> {
    for behind in 0..drawn.len() {
        for front in 0..behind {
            // NaN, the range of ranks that give none, never conflicts.
            if ranges[front][1] > ranges[behind][0]
                && !drawn[front].intersection(&drawn[behind]).is_empty()
            {
                return Err(CompositeError::Order {
                    front: order[front],
                    behind: order[behind],
                    far_of_front: ranges[front][1].to_string(),
                    near_of_behind: ranges[behind][0].to_string(),
                });
            }
        }
    }
    Ok(())
}

/// A number that differs (except with probability 2^-64) between ranks that do not composite the
/// same thing with the same options.
pub(crate) fn fingerprint<P: PixelFormat>(
    size_px: (u32, u32),
    options: &Options,
    order: &CompositingOrder,
    network: Option<&NetworkCosts>,
) -> u64 {
    let fixed = [
        u64::from(P::CODE),
        u64::from(size_px.0),
        u64::from(size_px.1),
        options.strategy.code(),
        order.root_index.map_or(u64::MAX, |root| root as u64),
        u64::from(options.depth),
        u64::from(options.in_memory),
        u64::from(options.verify),
        u64::from(options.final_barrier),
        options.slice_px.map_or(u64::MAX, |pixels| pixels as u64),
        network.map_or(0, NetworkCosts::code),
    ];
    let all = fixed.into_iter().chain(order.ranks.iter().map(|&rank| rank as u64));
    all.fold(order.ranks.len() as u64, mix)
}
