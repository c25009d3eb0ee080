//! Compositing while the frame is still being rendered: tiles are handed in as they are finished, travel and are joined, so that a
//! frame costs the longer of rendering and compositing and not their sum.
//!
//! The thesis names this as not done (sections 3.3.2 and 6.1); the Distributed FrameBuffer of OSPRay (W. Usher, I. Wald,
//! J. Amstutz, J. Günther, C. Brownlee, V. Pascucci, "Scalable Ray Tracing Using the Distributed FrameBuffer", CGF 38(3), 2019)
//! does it with tiles of fixed size. Here the slices of direct send's tiles are the unit, known from the rectangles in which ranks
//! are going to draw, and the image has the same bits as without streaming.
use crate::collect::Collector;
use crate::comm::Communicator;
use crate::compositor::{Composited, Compositor, Places, fingerprint, give_up, slice_px};
use crate::error::CompositeError;
use crate::frame::Frame;
use crate::join::{Item, Scratch};
use crate::layer::{Layer, View};
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::session::{Session, Tag};
use crate::strategies::Strategy;
use crate::strategies::direct_send::{Exchange, Plan};
use crate::wire::Codec;

/// A frame that is being composited while it is rendered; made by [`Compositor::stream`].
///
/// Dropping it before [`finish`](Self::finish) ends the group, because other ranks wait for what will not come.
pub struct Stream<'a, P: Composite> {
    running: Option<Running<'a, P>>,
}

struct Running<'a, P: Composite> {
    session: Session<'a>,
    scratch: &'a mut Scratch<P>,
    collector: Collector<P>,
    exchange: Exchange<'static, P>,
    size_px: (u32, u32),
    /// Parts of the own frame that have not been handed on.
    pending: Vec<Pending>,
    confirm: bool,
    begin_secs: f64,
}

/// What this rank draws in one slice of somebody's tile.
struct Pending {
    owner: usize,
    index: usize,
    part: Rect,
    /// Pixels that are not finished.
    missing: usize,
}

impl<P: Composite> Compositor<P> {
    /// Begins a frame of `size_px` (width, height) in which this rank is going to draw within `bounds`, before it is rendered.
    /// Every rank of `comm` calls this, then [`Stream::tile_done`] as often as it likes, then [`Stream::finish`].
    ///
    /// # Errors
    /// As [`Compositor::composite`]; [`CompositeError::Options`] for strategies other than direct send, which work on whole images,
    /// and for bounds beyond the image.
    pub fn stream<'a>(
        &'a mut self,
        comm: &'a mut dyn Communicator,
        size_px: (u32, u32),
        bounds: Rect,
    ) -> Result<Stream<'a, P>, CompositeError> {
        let begin_secs = comm.now();
        let begun = self.begin_stream(comm, size_px, bounds);
        // What the session borrows comes back if it could not begin.
        match begun {
            Ok((places, codec)) => {
                let options = self.options.clone();
                let spare = self.spare.take();
                let mut session = Session::new(comm, places.order, places.own, codec, options.timeout);
                session.counts_nan = true;
                let drawn = if bounds.is_empty() { Rect::EMPTY } else { bounds };
                let begun = (|| {
                    session.meet(size_px, drawn, [f32::NAN; 2])?;
                    let plan = Plan::new::<P>(
                        &session.drawn,
                        options.slice_px.unwrap_or_else(|| slice_px::<P>(session.comm)),
                        places.root,
                    );
                    let pieces = plan.pieces(&session.drawn);
                    let collector =
                        Collector::new(&mut session, size_px, places.root, options.depth, &pieces, spare)?;
                    let exchange = Exchange::new(&plan, &mut session)?;
                    Ok((plan, collector, exchange))
                })();
                let (plan, collector, exchange) = begun.inspect_err(|error| give_up(session.comm, error))?;
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
                let confirm = options.confirm;
                let running =
                    Running { session, scratch, collector, exchange, size_px, pending, confirm, begin_secs };
                Ok(Stream { running: Some(running) })
            }
            Err(error) => {
                give_up(comm, &error);
                Err(error)
            }
        }
    }

    /// What can be refused before any message.
    fn begin_stream(
        &self,
        comm: &dyn Communicator,
        size_px: (u32, u32),
        bounds: Rect,
    ) -> Result<(Places, Codec), CompositeError> {
        let options = &self.options;
        let places = Places::new(comm, options)?;
        if !matches!(options.strategy, Strategy::DirectSend | Strategy::Automatic) {
            return Err(CompositeError::Options(format!(
                "streaming with {:?}: that strategy works on whole images; use Strategy::DirectSend",
                options.strategy
            )));
        }
        Rect::of_size(size_px.0, size_px.1).must_contain(&bounds)?;
        // Another number than without streaming: ranks that stream and ranks that do not would wait for each other.
        let fingerprint =
            fingerprint::<P>(size_px, options, &places, None) ^ u64::from_le_bytes(*b"STREAM__");
        let codec = Codec { kernels: self.scratch.kernels, fingerprint, verify: options.verify };
        Ok((places, codec))
    }
}

impl<P: Composite> Stream<'_, P> {
    /// Hands in the pixels of `tile`, which are final in `frame`; the rest of the frame may still change. Every pixel once; what is
    /// outside the bounds given at the beginning is background and is ignored. Also joins whatever has come from other ranks.
    ///
    /// # Errors
    /// As [`Compositor::composite`], and [`CompositeError::Stream`] for pixels handed in twice or a frame of another size.
    pub fn tile_done(&mut self, frame: &Frame<'_, P>, tile: Rect) -> Result<(), CompositeError> {
        self.running(|running| running.tile_done(frame, tile))
    }

    /// Joins whatever has come from other ranks, without waiting; returns how many slices of this rank's tile are complete.
    ///
    /// # Errors
    /// As [`Compositor::composite`].
    pub fn progress(&mut self) -> Result<usize, CompositeError> {
        self.running(|running| running.progress())
    }

    /// Hands in all that has not been, and waits for the other ranks.
    ///
    /// # Errors
    /// As [`Compositor::composite`].
    pub fn finish(mut self, frame: &Frame<'_, P>) -> Result<Composited<P>, CompositeError> {
        self.running(|running| running.hand_in_rest(frame))?;
        let Some(running) = self.running.take() else { return Err(ended()) };
        running.finish()
    }

    fn running<T>(
        &mut self,
        work: impl FnOnce(&mut Running<'_, P>) -> Result<T, CompositeError>,
    ) -> Result<T, CompositeError> {
        let Some(running) = &mut self.running else { return Err(ended()) };
        let result = work(running);
        if let Err(error) = &result {
            give_up(running.session.comm, error);
            self.running = None;
        }
        result
    }
}

fn ended() -> CompositeError {
    CompositeError::Stream(
        "this stream has ended with an error before: begin another frame with another group".into(),
    )
}

impl<P: Composite> Drop for Stream<'_, P> {
    fn drop(&mut self) {
        if let Some(running) = &mut self.running {
            running.session.comm.abort("a stream was dropped before it was finished");
        }
    }
}

impl<P: Composite> Running<'_, P> {
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
        self.session.comm.alive()?;
        let mut finished = Vec::new();
        let mut outside = tile.intersection(&self.session.drawn[self.session.place]).pixels();
        for (position, pending) in self.pending.iter_mut().enumerate() {
            let pixels = pending.part.intersection(&tile).pixels();
            outside -= pixels.min(outside);
            let Some(missing) = pending.missing.checked_sub(pixels) else {
                return Err(twice(&tile));
            };
            pending.missing = missing;
            if missing == 0 {
                finished.push(position);
            }
        }
        if outside > 0 {
            // Of a part that has been handed on already.
            return Err(twice(&tile));
        }
        for position in finished.into_iter().rev() {
            let pending = self.pending.swap_remove(position);
            self.hand_on(frame, &pending)?;
        }
        self.progress().map(|_| ())
    }

    fn progress(&mut self) -> Result<usize, CompositeError> {
        self.exchange.take_what_has_come(&mut self.session, &mut self.collector, self.scratch)?;
        Ok(self.exchange.complete())
    }

    fn hand_in_rest(&mut self, frame: &Frame<'_, P>) -> Result<(), CompositeError> {
        self.check_size(frame)?;
        // Others' parts first: they travel while the own ones are joined.
        let own = self.session.place;
        let mut rest = std::mem::take(&mut self.pending);
        rest.sort_by_key(|pending| pending.owner == own);
        rest.iter().try_for_each(|pending| self.hand_on(frame, pending))
    }

    /// Sends a finished part, or joins it if it is of the own tile: copied, because the renderer goes on drawing beside it.
    fn hand_on(&mut self, frame: &Frame<'_, P>, pending: &Pending) -> Result<(), CompositeError> {
        let view: View<'_, P> = frame.view(pending.part);
        if pending.owner != self.session.place {
            return self.session.send(pending.owner, Tag::Exchange, &view, pending.part, true);
        }
        let begin = self.session.now();
        self.session.count_nan(&view, pending.part);
        let spare = self.scratch.layers.pop();
        let copy = Layer::copied(pending.part, &view, self.scratch.kernels, spare);
        self.session.report.blend_secs += self.session.now() - begin;
        let place = self.session.place;
        self.exchange.put(
            pending.index,
            place,
            Item::Layer(copy),
            &mut self.session,
            &mut self.collector,
            self.scratch,
        )
    }

    fn finish(mut self) -> Result<Composited<P>, CompositeError> {
        let span = self.session.begin_span();
        let waited = self.exchange.finish(&mut self.session, &mut self.collector, self.scratch);
        let (mut session, collector) = (self.session, self.collector);
        session.end_span(span, |report| &mut report.exchange_secs);
        let span = session.begin_span();
        let finished = waited.and_then(|()| collector.finish(&mut session));
        session.end_span(span, |report| &mut report.collect_secs);
        let finished = finished.and_then(|images| {
            if self.confirm {
                session.barrier()?;
            }
            Ok(images)
        });
        let (image, piece) = finished.inspect_err(|error| give_up(session.comm, error))?;
        let mut report = session.report;
        report.total_secs = session.now() - self.begin_secs;
        Ok(Composited { image, piece, report })
    }
}

fn twice(tile: &Rect) -> CompositeError {
    CompositeError::Stream(format!(
        "pixels of the tile of columns {}..{} and rows {}..{} were handed in twice: a pixel is final only once",
        tile.x0, tile.x1, tile.y0, tile.y1
    ))
}
