//! One frame on one rank: sends and receives in compositing order, counts costs and checks
//! messages.
use crate::codec::{self, Codec, DecodedMessage, MessageError};
use crate::comm::{Communicator, Receive};
use crate::error::CompositeError;
use crate::layer::View;
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::report::Report;
use std::time::Duration;

/// Which messages belong together; every communicator keeps the order within a tag.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Tag {
    Fold = 2,
    Exchange = 3,
    Collect = 4,
}

/// A message that has arrived and been checked.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) bytes: Vec<u8>,
    rect: Rect,
    depths: bool,
}

/// Longest contribution to [`FrameExchange::handshake`]: fingerprint, rectangle, depth range, and
/// KiB of the shared segment.
const HANDSHAKE_BYTES: usize = 8 + 16 + 8 + 4;

/// See [`FrameExchange::begin_span`].
pub(crate) struct Span {
    begin: f64,
    counted: f64,
}

/// One frame on one rank. Methods take order indices (positions in the order of compositing), not
/// ranks of the communicator.
pub(crate) struct FrameExchange<'a> {
    pub(crate) comm: &'a mut dyn Communicator,
    order: Vec<usize>,
    pub(crate) order_index: usize,
    pub(crate) codec: Codec,
    timeout: Duration,
    /// The rectangle that each rank drew in, by order index.
    pub(crate) drawn: Vec<Rect>,
    /// Bytes of memory that each rank shares with those of its machine, by order index; whole KiB.
    pub(crate) shared_bytes: Vec<usize>,
    pub(crate) report: Report,
    /// Whether NaN depths are counted while messages are encoded. Otherwise they were counted when
    /// the frame was scanned for its bounds.
    pub(crate) counts_nan: bool,
    /// Receives that have been posted and not completed.
    posted: Vec<Receive>,
}

impl<'a> FrameExchange<'a> {
    pub(crate) fn new(
        comm: &'a mut dyn Communicator,
        order: Vec<usize>,
        order_index: usize,
        codec: Codec,
        timeout: Duration,
    ) -> Self {
        Self {
            comm,
            order,
            order_index,
            codec,
            timeout,
            drawn: Vec::new(),
            shared_bytes: Vec::new(),
            report: Report::default(),
            counts_nan: false,
            posted: Vec::new(),
        }
    }

    /// Current time of the communicator, in seconds.
    pub(crate) fn now(&self) -> f64 {
        self.comm.now()
    }

    pub(crate) fn num_ranks(&self) -> usize {
        self.order.len()
    }

    pub(crate) fn rank_of(&self, order_index: usize) -> usize {
        self.order[order_index]
    }

    /// From now on the order has these of its ranks only, of which this rank is one, and they drew
    /// in these rectangles. All other ranks still take part in collective calls.
    pub(crate) fn restrict_to(&mut self, order_indices: &[usize], drawn: Vec<Rect>) {
        let own_rank = self.order[self.order_index];
        self.order = order_indices.iter().map(|&index| self.order[index]).collect();
        self.order_index = self.order_index_of(own_rank);
        self.drawn = drawn;
    }

    fn order_index_of(&self, rank: usize) -> usize {
        // The order is a permutation, so every rank is in it.
        self.order.iter().position(|&other| other == rank).unwrap_or(rank)
    }

    /// Sends to all ranks the rectangle that this rank drew in and its depth range, and checks that
    /// all ranks composite the same thing. Afterwards [`drawn`](Self::drawn) holds everybody's
    /// rectangle, each within the image. Returns the depth ranges.
    pub(crate) fn handshake(
        &mut self,
        (width_px, height_px): (u32, u32),
        drawn: Rect,
        depths: [f32; 2],
    ) -> Result<Vec<[f32; 2]>, CompositeError> {
        let begin = self.now();
        let mut handshake = self.codec.fingerprint.to_le_bytes().to_vec();
        handshake
            .extend_from_slice(bytemuck::cast_slice(&[drawn.x0, drawn.y0, drawn.x1, drawn.y1]));
        handshake.extend_from_slice(bytemuck::cast_slice(&depths));
        let shared = self.comm.shared_segments().map_or(0, |memory| memory.reserved());
        handshake
            .extend_from_slice(&u32::try_from(shared / 1024).unwrap_or(u32::MAX).to_le_bytes());
        let answers = self.comm.all_gather(&handshake, HANDSHAKE_BYTES, self.timeout)?;
        let mut intervals = Vec::with_capacity(self.num_ranks());
        self.drawn.clear();
        self.shared_bytes.clear();
        for order_index in 0..self.num_ranks() {
            let answer = &answers[self.order[order_index]];
            let Ok(answer) = <&[u8; HANDSHAKE_BYTES]>::try_from(answer.as_slice()) else {
                let (expected, found) = (HANDSHAKE_BYTES as u64, answer.len() as u64);
                return Err(self.unusable(order_index, MessageError::Length { expected, found }));
            };
            if answer[..8] != self.codec.fingerprint.to_le_bytes() {
                return Err(self.unusable(order_index, MessageError::Fingerprint));
            }
            let corner =
                |i: usize| bytemuck::pod_read_unaligned::<u32>(&answer[8 + 4 * i..12 + 4 * i]);
            let found = Rect { x0: corner(0), y0: corner(1), x1: corner(2), y1: corner(3) };
            if !Rect::of_size(width_px, height_px).contains(&found) {
                return Err(self.unusable(
                    order_index,
                    MessageError::OutsideImage { found, width_px, height_px },
                ));
            }
            self.drawn.push(if found.is_empty() { Rect::EMPTY } else { found });
            intervals.push(bytemuck::pod_read_unaligned(&answer[24..32]));
            let kib = bytemuck::pod_read_unaligned::<u32>(&answer[32..36]);
            self.shared_bytes.push(kib as usize * 1024);
        }
        self.report.exchange_secs += self.now() - begin;
        Ok(intervals)
    }

    /// Sends the pixels of `view` in `rect`, which must be within its bounds.
    pub(crate) fn send<P: Composite>(
        &mut self,
        order_index: usize,
        tag: Tag,
        view: &View<'_, P>,
        rect: Rect,
        depths: bool,
    ) -> Result<(), CompositeError> {
        let begin = self.comm.working_secs();
        let mut message = self.comm.buffer(codec::longest::<P>(&rect));
        let counts = self.codec.encode(view, rect, depths, &mut message);
        if self.counts_nan {
            // Merged pixels hold no NaN, so only those of the frame are counted here.
            self.report.nan_depths += counts.nan;
        }
        let encoded = self.comm.working_secs();
        self.report.messages_sent += 1;
        self.report.bytes_sent += message.len() as u64;
        self.comm.send(self.order[order_index], tag as u32, message)?;
        let sent = self.comm.working_secs();
        if tag == Tag::Collect {
            self.report.collect_secs += sent - begin;
        } else {
            self.report.compress_secs += encoded - begin;
            self.report.exchange_secs += sent - encoded;
        }
        Ok(())
    }

    /// Waits until at most `most` messages of the exchange are in flight.
    pub(crate) fn throttle_sends(&mut self, most: usize) {
        self.comm.throttle_sends(Tag::Exchange as u32, most, self.timeout);
    }

    /// Counts the NaN depths of the frame in `part`. Those of parts that are sent are counted when
    /// they are encoded.
    pub(crate) fn count_nan<P: Composite>(&mut self, view: &View<'_, P>, part: Rect) {
        if P::HAS_DEPTH && self.counts_nan {
            for y in part.y0..part.y1 {
                let depths = view.row(y, part.x0, part.x1).1;
                self.report.nan_depths +=
                    depths.iter().filter(|depth| depth.is_nan()).count() as u64;
            }
        }
    }

    /// Waits for all ranks, for longer than for a message: the rank that misses a message should
    /// time out first, because it knows whose it is.
    pub(crate) fn barrier(&mut self) -> Result<(), CompositeError> {
        Ok(self.comm.barrier(self.timeout.saturating_mul(2))?)
    }

    /// Waits for the ranks of this machine.
    pub(crate) fn machine_barrier(&mut self) -> Result<(), CompositeError> {
        Ok(self.comm.machine_barrier(self.timeout.saturating_mul(2))?)
    }

    /// Gathers one number of every rank at every rank.
    pub(crate) fn all_gather_number(&mut self, number: u64) -> Result<Vec<u64>, CompositeError> {
        let answers = self.comm.all_gather(&number.to_le_bytes(), 8, self.timeout)?;
        let mut numbers = Vec::with_capacity(self.num_ranks());
        for order_index in 0..self.num_ranks() {
            let answer = &answers[self.order[order_index]];
            let found = answer.len() as u64;
            let bytes = answer.as_slice().try_into();
            numbers.push(u64::from_le_bytes(bytes.map_err(|_| {
                self.unusable(order_index, MessageError::Length { expected: 8, found })
            })?));
        }
        Ok(numbers)
    }

    /// Sends a message that does not consist of rows of pixels.
    pub(crate) fn send_bytes(
        &mut self,
        order_index: usize,
        tag: Tag,
        message: Vec<u8>,
    ) -> Result<(), CompositeError> {
        let begin = self.comm.working_secs();
        self.report.messages_sent += 1;
        self.report.bytes_sent += message.len() as u64;
        self.comm.send(self.order[order_index], tag as u32, message)?;
        self.report.exchange_secs += self.comm.working_secs() - begin;
        Ok(())
    }

    /// Posts a receive for a message of at most `capacity` bytes.
    pub(crate) fn post_bytes(
        &mut self,
        order_index: usize,
        tag: Tag,
        capacity: usize,
    ) -> Result<(), CompositeError> {
        let receive = self.comm.post_recv(self.order[order_index], tag as u32, capacity)?;
        self.posted.push(receive);
        Ok(())
    }

    /// Posts a receive for a message with the pixels of `rect`.
    pub(crate) fn post<P: Composite>(
        &mut self,
        order_index: usize,
        tag: Tag,
        rect: &Rect,
    ) -> Result<(), CompositeError> {
        // A little more than the longest valid message: one that is too long should reach the
        // decoder, which reports what is wrong.
        self.post_bytes(order_index, tag, codec::longest::<P>(rect) + 64)
    }

    /// Whether any posted receive is incomplete.
    pub(crate) fn is_receiving(&self) -> bool {
        !self.posted.is_empty()
    }

    /// Whether any receive posted with `tag` is incomplete.
    pub(crate) fn is_receiving_for(&self, tag: Tag) -> bool {
        self.posted.iter().any(|receive| receive.tag == tag as u32)
    }

    /// The next message for a posted receive: the order index of its sender, whether its tag is
    /// [`Tag::Collect`], and its bytes. Without `patience`, returns only a message that has already
    /// arrived. The waiting time counts for the enclosing [span](Self::begin_span).
    pub(crate) fn next(
        &mut self,
        patience: bool,
    ) -> Result<Option<(usize, bool, Vec<u8>)>, CompositeError> {
        let arrival = if patience {
            Some(self.comm.wait_any(&mut self.posted, self.timeout)?)
        } else if self.posted.is_empty() {
            None
        } else {
            self.comm.test_any(&mut self.posted)?
        };
        let Some(arrival) = arrival else { return Ok(None) };
        let is_collect = arrival.tag == Tag::Collect as u32;
        self.report.bytes_received += arrival.message.len() as u64;
        Ok(Some((self.order_index_of(arrival.source), is_collect, arrival.message)))
    }

    /// Begins a span. [`end_span`](Self::end_span) adds to `column` the time that no other column
    /// has counted. Waits are measured together, because each reading of a simulated clock costs
    /// time.
    pub(crate) fn begin_span(&self) -> Span {
        Span { begin: self.now(), counted: self.report.counted_secs() }
    }

    pub(crate) fn end_span(&mut self, span: Span, column: fn(&mut Report) -> &mut f64) {
        let elsewhere = self.report.counted_secs() - span.counted;
        *column(&mut self.report) += (self.now() - span.begin - elsewhere).max(0.0);
    }

    /// Checks a message of the strategy.
    pub(crate) fn check<P: Composite>(
        &self,
        order_index: usize,
        bytes: Vec<u8>,
        expected: Rect,
        depths: bool,
    ) -> Result<Message, CompositeError> {
        match self.codec.decode::<P>(&bytes, expected, depths) {
            Ok(_) => Ok(Message { bytes, rect: expected, depths }),
            Err(reason) => Err(self.unusable(order_index, reason)),
        }
    }

    pub(crate) fn unusable(&self, order_index: usize, reason: MessageError) -> CompositeError {
        CompositeError::Message {
            rank: self.order[self.order_index],
            from: self.order[order_index],
            reason,
        }
    }
}

impl Message {
    pub(crate) fn rect(&self) -> Rect {
        self.rect
    }

    /// The pixels of the message, which was checked on arrival.
    pub(crate) fn part<P: Composite>(&self) -> DecodedMessage<'_> {
        DecodedMessage::reopen::<P>(&self.bytes, self.rect, self.depths)
    }
}
