//! Compositing while the frame is still being rendered. Tiles are submitted, sent and merged as
//! they are finished, so a frame costs the longer of rendering and compositing and not their sum.
//!
//! The thesis names this as not done (sections 3.3.2 and 6.1); the Distributed FrameBuffer of
//! OSPRay (W. Usher, I. Wald, J. Amstutz, J. Günther, C. Brownlee, V. Pascucci, "Scalable Ray
//! Tracing Using the Distributed FrameBuffer", CGF 38(3), 2019) does it with tiles of fixed size.
//! Here the unit is a slice of a direct-send tile, derived from the rectangles in which ranks are
//! going to draw, and the image has the same bits as without streaming.
use crate::codec::Codec;
use crate::collect::Collector;
use crate::comm::Communicator;
use crate::compositor::{
    CompositeOutput, CompositingOrder, Compositor, abort_group, fingerprint, slice_px,
};
use crate::error::CompositeError;
use crate::frame::Frame;
use crate::frame_exchange::{FrameExchange, Tag};
use crate::layer::{Layer, View};
use crate::merge::{MergeInput, Scratch};
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::strategies::Strategy;
use crate::strategies::direct_send::{Plan, TileExchange};

/// A frame that is being composited while it is rendered; made by [`Compositor::stream`].
///
/// Dropping it before [`finish`](Self::finish) aborts the group, because other ranks wait for
/// messages that will not arrive.
pub struct Stream<'a, P: Composite> {
    state: Option<StreamState<'a, P>>,
}

struct StreamState<'a, P: Composite> {
    exchange: FrameExchange<'a>,
    scratch: &'a mut Scratch<P>,
    collector: Collector<P>,
    tile_exchange: TileExchange<'static, P>,
    size_px: (u32, u32),
    /// Parts of the own frame that have not been submitted.
    pending: Vec<Pending>,
    final_barrier: bool,
    begin_secs: f64,
}

/// What this rank draws in one slice of a tile.
struct Pending {
    owner: usize,
    index: usize,
    part: Rect,
    /// Pixels that are not finished.
    missing: usize,
}

impl<P: Composite> Compositor<P> {
    /// Begins a frame of `size_px` (width, height) in which this rank is going to draw within
    /// `bounds`. Call it before rendering: every rank of `comm` calls this, then
    /// [`Stream::tile_done`] any number of times, then [`Stream::finish`].
    ///
    /// # Errors
    /// As [`Compositor::composite`]; [`CompositeError::Options`] for strategies other than direct
    /// send, which work on whole images, and for bounds outside the image.
    pub fn stream<'a>(
        &'a mut self,
        comm: &'a mut dyn Communicator,
        size_px: (u32, u32),
        bounds: Rect,
    ) -> Result<Stream<'a, P>, CompositeError> {
        let begin_secs = comm.now();
        let begun = self.begin_stream(comm, size_px, bounds);
        // The stream borrows `comm` only if it has begun; otherwise `comm` aborts the group below.
        match begun {
            Ok((order, codec)) => {
                let options = self.options.clone();
                let spare = self.spare.take();
                let mut exchange =
                    FrameExchange::new(comm, order.ranks, order.own_index, codec, options.timeout);
                exchange.counts_nan = true;
                let drawn = if bounds.is_empty() { Rect::EMPTY } else { bounds };
                let begun = (|| {
                    exchange.handshake(size_px, drawn, [f32::NAN; 2])?;
                    let plan = Plan::new::<P>(
                        &exchange.drawn,
                        options.slice_px.unwrap_or_else(|| slice_px::<P>(exchange.comm)),
                        order.root_index,
                    );
                    let pieces = plan.pieces(&exchange.drawn);
                    let collector = Collector::new(
                        &mut exchange,
                        size_px,
                        order.root_index,
                        options.depth,
                        &pieces,
                        spare,
                    )?;
                    let tile_exchange = TileExchange::new(&plan, &mut exchange)?;
                    Ok((plan, collector, tile_exchange))
                })();
                let (plan, collector, tile_exchange) =
                    begun.inspect_err(|error| abort_group(exchange.comm, error))?;
                let mut pending = Vec::new();
                for (owner, slices) in plan.slices.iter().enumerate() {
                    for (index, slice) in slices.iter().enumerate() {
                        let part = drawn.intersection(slice);
                        if !part.is_empty() {
                            pending.push(Pending { owner, index, part, missing: part.pixels() });
                        }
                    }
                }
                let scratch = &mut self.scratch;
                let final_barrier = options.final_barrier;
                let state = StreamState {
                    exchange,
                    scratch,
                    collector,
                    tile_exchange,
                    size_px,
                    pending,
                    final_barrier,
                    begin_secs,
                };
                Ok(Stream { state: Some(state) })
            }
            Err(error) => {
                abort_group(comm, &error);
                Err(error)
            }
        }
    }

    /// Checks what can be refused before any message is sent.
    fn begin_stream(
        &self,
        comm: &dyn Communicator,
        size_px: (u32, u32),
        bounds: Rect,
    ) -> Result<(CompositingOrder, Codec), CompositeError> {
        let options = &self.options;
        let order = CompositingOrder::new(comm, options)?;
        if !matches!(options.strategy, Strategy::DirectSend | Strategy::Automatic) {
            return Err(CompositeError::Options(format!(
                "streaming with {:?}: that strategy works on whole images; use \
                 Strategy::DirectSend",
                options.strategy
            )));
        }
        Rect::of_size(size_px.0, size_px.1).must_contain(&bounds)?;
        // A fingerprint that differs from that without streaming: ranks that stream and ranks that
        // do not would wait for each other.
        let fingerprint =
            fingerprint::<P>(size_px, options, &order, None) ^ u64::from_le_bytes(*b"STREAM__");
        let codec = Codec { kernels: self.scratch.kernels, fingerprint, verify: options.verify };
        Ok((order, codec))
    }
}

impl<P: Composite> Stream<'_, P> {
    /// Submits the pixels of `tile`, which are final in `frame`; the rest of the frame may still
    /// change. Submit every pixel once. Pixels outside the bounds given at the beginning are
    /// background and are ignored. Also merges messages that have arrived from other ranks.
    ///
    /// # Errors
    /// As [`Compositor::composite`], and [`CompositeError::Stream`] for pixels submitted twice or a
    /// frame of another size.
    pub fn tile_done(&mut self, frame: &Frame<'_, P>, tile: Rect) -> Result<(), CompositeError> {
        self.state(|state| state.tile_done(frame, tile))
    }

    /// Merges messages that have arrived from other ranks, without waiting. Returns how many slices
    /// of this rank's tile are complete.
    ///
    /// # Errors
    /// As [`Compositor::composite`].
    pub fn progress(&mut self) -> Result<usize, CompositeError> {
        self.state(|state| state.progress())
    }

    /// Submits all pixels that have not been submitted, and waits for the other ranks.
    ///
    /// # Errors
    /// As [`Compositor::composite`].
    pub fn finish(mut self, frame: &Frame<'_, P>) -> Result<CompositeOutput<P>, CompositeError> {
        self.state(|state| state.submit_rest(frame))?;
        let Some(state) = self.state.take() else { return Err(stream_ended()) };
        state.finish()
    }

    fn state<T>(
        &mut self,
        work: impl FnOnce(&mut StreamState<'_, P>) -> Result<T, CompositeError>,
    ) -> Result<T, CompositeError> {
        let Some(state) = &mut self.state else { return Err(stream_ended()) };
        let result = work(state);
        if let Err(error) = &result {
            abort_group(state.exchange.comm, error);
            self.state = None;
        }
        result
    }
}

fn stream_ended() -> CompositeError {
    CompositeError::Stream(
        "this stream has ended with an error before: begin another frame with another group".into(),
    )
}

impl<P: Composite> Drop for Stream<'_, P> {
    fn drop(&mut self) {
        if let Some(state) = &mut self.state {
            state.exchange.comm.abort("a stream was dropped before it was finished");
        }
    }
}

impl<P: Composite> StreamState<'_, P> {
    fn check_size(&self, frame: &Frame<'_, P>) -> Result<(), CompositeError> {
        if (frame.width_px(), frame.height_px()) == self.size_px {
            return Ok(());
        }
        Err(CompositeError::Stream(format!(
            "a frame of {}x{} was handed to a stream of {}x{}: one stream is one frame",
            frame.width_px(),
            frame.height_px(),
            self.size_px.0,
            self.size_px.1
        )))
    }

    fn tile_done(&mut self, frame: &Frame<'_, P>, tile: Rect) -> Result<(), CompositeError> {
        self.check_size(frame)?;
        self.exchange.comm.alive()?;
        let mut finished = Vec::new();
        let mut outside =
            tile.intersection(&self.exchange.drawn[self.exchange.order_index]).pixels();
        for (position, pending) in self.pending.iter_mut().enumerate() {
            let pixels = pending.part.intersection(&tile).pixels();
            outside -= pixels.min(outside);
            let Some(missing) = pending.missing.checked_sub(pixels) else {
                return Err(submitted_twice(&tile));
            };
            pending.missing = missing;
            if missing == 0 {
                finished.push(position);
            }
        }
        if outside > 0 {
            // A part that has been submitted already.
            return Err(submitted_twice(&tile));
        }
        for position in finished.into_iter().rev() {
            let pending = self.pending.swap_remove(position);
            self.submit_part(frame, &pending)?;
        }
        self.progress().map(|_| ())
    }

    fn progress(&mut self) -> Result<usize, CompositeError> {
        self.tile_exchange.take_arrived(&mut self.exchange, &mut self.collector, self.scratch)?;
        Ok(self.tile_exchange.complete())
    }

    fn submit_rest(&mut self, frame: &Frame<'_, P>) -> Result<(), CompositeError> {
        self.check_size(frame)?;
        // Other ranks' parts first: they are in flight while the own ones are merged.
        let own = self.exchange.order_index;
        let mut rest = std::mem::take(&mut self.pending);
        rest.sort_by_key(|pending| pending.owner == own);
        rest.iter().try_for_each(|pending| self.submit_part(frame, pending))
    }

    /// Sends a finished part, or merges it if it is of the own tile. It is copied, because the
    /// renderer continues to draw into the frame.
    fn submit_part(
        &mut self,
        frame: &Frame<'_, P>,
        pending: &Pending,
    ) -> Result<(), CompositeError> {
        let view: View<'_, P> = frame.view(pending.part);
        if pending.owner != self.exchange.order_index {
            return self.exchange.send(pending.owner, Tag::Exchange, &view, pending.part, true);
        }
        let begin = self.exchange.now();
        self.exchange.count_nan(&view, pending.part);
        let spare = self.scratch.layers.pop();
        let copy = Layer::copied(pending.part, &view, self.scratch.kernels, spare);
        self.exchange.report.blend_secs += self.exchange.now() - begin;
        let order_index = self.exchange.order_index;
        self.tile_exchange.put(
            pending.index,
            order_index,
            MergeInput::Layer(copy),
            &mut self.exchange,
            &mut self.collector,
            self.scratch,
        )
    }

    fn finish(mut self) -> Result<CompositeOutput<P>, CompositeError> {
        let span = self.exchange.begin_span();
        let waited =
            self.tile_exchange.finish(&mut self.exchange, &mut self.collector, self.scratch);
        let (mut exchange, collector) = (self.exchange, self.collector);
        exchange.end_span(span, |report| &mut report.exchange_secs);
        let span = exchange.begin_span();
        let finished = waited.and_then(|()| collector.finish(&mut exchange));
        exchange.end_span(span, |report| &mut report.collect_secs);
        let finished = finished.and_then(|images| {
            if self.final_barrier {
                exchange.barrier()?;
            }
            Ok(images)
        });
        let (image, piece) = finished.inspect_err(|error| abort_group(exchange.comm, error))?;
        let mut report = exchange.report;
        report.total_secs = exchange.now() - self.begin_secs;
        Ok(CompositeOutput { image, piece, report })
    }
}

fn submitted_twice(tile: &Rect) -> CompositeError {
    CompositeError::Stream(format!(
        "pixels of the tile of columns {}..{} and rows {}..{} were handed in twice: a pixel is \
         final only once",
        tile.x0, tile.x1, tile.y0, tile.y1
    ))
}
