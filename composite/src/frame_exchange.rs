//! One frame on one rank: the communicator in rank order, with costs counted and messages checked.
use crate::codec::{self, Codec, DecodedMessage, MessageError};
use crate::comm::{Communicator, Receive};
use crate::error::CompositeError;
use crate::layer::View;
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::report::Report;
use std::time::Duration;

/// Which messages belong together; the order within a tag is kept by every communicator.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Tag {
    Fold = 2,
    Exchange = 3,
    Collect = 4,
}

/// A message that has come and been checked.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) bytes: Vec<u8>,
    rect: Rect,
    depths: bool,
}

/// Longest string of [`FrameExchange::handshake`]: fingerprint, rectangle, interval of depths.
const HANDSHAKE_BYTES: usize = 8 + 16 + 8;

/// See [`FrameExchange::begin_span`].
pub(crate) struct Span {
    begin: f64,
    counted: f64,
}

/// Ranks in here are *places* in the order of compositing, not ranks of the communicator.
pub(crate) struct FrameExchange<'a> {
    pub(crate) comm: &'a mut dyn Communicator,
    order: Vec<usize>,
    pub(crate) order_index: usize,
    pub(crate) codec: Codec,
    timeout: Duration,
    /// What every place drew.
    pub(crate) drawn: Vec<Rect>,
    pub(crate) report: Report,
    /// Whether depths that are not numbers are counted on the way; else they have been when the
    /// frame was looked over.
    pub(crate) counts_nan: bool,
    /// Receives that have been posted, with what they are for.
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
            report: Report::default(),
            counts_nan: false,
            posted: Vec::new(),
        }
    }

    /// The communicator's time, in seconds.
    pub(crate) fn now(&self) -> f64 {
        self.comm.now()
    }

    pub(crate) fn num_ranks(&self) -> usize {
        self.order.len()
    }

    pub(crate) fn rank_of(&self, order_index: usize) -> usize {
        self.order[order_index]
    }

    fn order_index_of(&self, rank: usize) -> usize {
        // The order is a permutation, so every rank is in it.
        self.order.iter().position(|&other| other == rank).unwrap_or(rank)
    }

    /// Tells all places what each drew of an image of this size, and how near and far, and finds
    /// out whether all are doing the same thing. What is [`drawn`](Self::drawn) behind it lies
    /// within the image.
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
        let answers = self.comm.all_gather(&handshake, HANDSHAKE_BYTES, self.timeout)?;
        let mut intervals = Vec::with_capacity(self.num_ranks());
        self.drawn.clear();
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
        }
        self.report.exchange_secs += self.now() - begin;
        Ok(intervals)
    }

    /// Sends what `view` has in `rect`, which must be within its bounds.
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
            // Joined pixels hold no NaN, so only those of the frame are counted here.
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

    /// Lets messages of the exchange leave until at most `most` of them are on their way.
    pub(crate) fn throttle_sends(&mut self, most: usize) {
        self.comm.throttle_sends(Tag::Exchange as u32, most, self.timeout);
    }

    /// Counts depths of the frame in `part` that are not numbers; those of parts sent to others are
    /// counted when they are compressed.
    pub(crate) fn count_nan<P: Composite>(&mut self, view: &View<'_, P>, part: Rect) {
        if P::HAS_DEPTH && self.counts_nan {
            for y in part.y0..part.y1 {
                let depths = view.row(y, part.x0, part.x1).1;
                self.report.nan_depths +=
                    depths.iter().filter(|depth| depth.is_nan()).count() as u64;
            }
        }
    }

    /// Waits until all have come here; longer than for a message: the rank that misses one shall be
    /// the first to say so, because it knows which.
    pub(crate) fn barrier(&mut self) -> Result<(), CompositeError> {
        Ok(self.comm.barrier(self.timeout.saturating_mul(2))?)
    }

    /// One number of every place, at every place.
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

    /// Sends a message that is not made of rows of pixels.
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

    /// Announces a message of at most `capacity` bytes.
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

    /// Announces a message with the pixels of `rect`.
    pub(crate) fn post<P: Composite>(
        &mut self,
        order_index: usize,
        tag: Tag,
        rect: &Rect,
    ) -> Result<(), CompositeError> {
        // A little more than the longest honest message: one that is too long shall reach the
        // decoder, which says what is wrong.
        self.post_bytes(order_index, tag, codec::longest::<P>(rect) + 64)
    }

    /// Whether messages that were announced have not yet come.
    pub(crate) fn is_receiving(&self) -> bool {
        !self.posted.is_empty()
    }

    /// Whether a message announced with `tag` has not yet come.
    pub(crate) fn is_receiving_for(&self, tag: Tag) -> bool {
        self.posted.iter().any(|receive| receive.tag == tag as u32)
    }

    /// The next message that comes, of those announced: its place, whether it is one of
    /// [`Tag::Collect`], its bytes. Without `patience`, only one that has already come. The time
    /// goes to whoever measures the [span](Self::begin_span) around it.
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

    /// Begins a span of which [`end_span`](Self::end_span) gives what is in no other column to
    /// `column`: waits are measured together, because where time is simulated every look at the
    /// clock costs some.
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

    /// The message as its pixels; it has been checked when it came.
    pub(crate) fn part<P: Composite>(&self) -> DecodedMessage<'_> {
        DecodedMessage::reopen::<P>(&self.bytes, self.rect, self.depths)
    }
}
