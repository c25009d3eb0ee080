//! One frame on one rank: the communicator in rank order, with costs counted and messages checked.
use crate::comm::Communicator;
use crate::error::CompositeError;
use crate::pixel::{Composite, combine};
use crate::report::Report;
use crate::wire::{self, WireError};
use std::ops::Range;
use std::time::Duration;

/// Which messages belong together; the order within a tag is kept by every communicator.
#[derive(Clone, Copy)]
pub(crate) enum Tag {
    Load = 1,
    Fold = 2,
    Exchange = 3,
    Collect = 4,
}

/// On which side of what a rank holds the received pixels come.
#[derive(Clone, Copy)]
pub(crate) enum Side {
    Lower,
    Higher,
}

/// Ranks in here are *places* in the order of compositing, not ranks of the communicator.
pub(crate) struct Session<'a> {
    comm: &'a mut dyn Communicator,
    order: &'a [usize],
    pub(crate) place: usize,
    fingerprint: u64,
    image_pixels: usize,
    timeout: Duration,
    pub(crate) report: Report,
}

impl<'a> Session<'a> {
    pub(crate) fn new(
        comm: &'a mut dyn Communicator,
        order: &'a [usize],
        place: usize,
        fingerprint: u64,
        image_pixels: usize,
        timeout: Duration,
    ) -> Self {
        Self { comm, order, place, fingerprint, image_pixels, timeout, report: Report::default() }
    }

    /// The communicator's time, in seconds.
    pub(crate) fn now(&self) -> f64 {
        self.comm.now()
    }

    pub(crate) fn places(&self) -> usize {
        self.order.len()
    }

    pub(crate) fn image_pixels(&self) -> usize {
        self.image_pixels
    }

    /// The rank of the communicator at `place`.
    pub(crate) fn rank_at(&self, place: usize) -> usize {
        self.order[place]
    }

    fn send_bytes(&mut self, place: usize, tag: Tag, message: Vec<u8>) -> Result<(), CompositeError> {
        self.report.messages_sent += 1;
        self.report.bytes_sent += message.len() as u64;
        let begin = self.comm.now();
        self.comm.send(self.order[place], tag as u32, message)?;
        self.report.exchange_secs += self.comm.now() - begin;
        Ok(())
    }

    fn recv_bytes(&mut self, place: usize, tag: Tag, capacity: usize) -> Result<Vec<u8>, CompositeError> {
        let begin = self.comm.now();
        let message = self.comm.recv(self.order[place], tag as u32, capacity, self.timeout)?;
        self.report.exchange_secs += self.comm.now() - begin;
        self.report.bytes_received += message.len() as u64;
        Ok(message)
    }

    /// Sends the part `range`; `pixel` gives the pixel at an index of the whole image.
    pub(crate) fn send<P: Composite>(
        &mut self,
        place: usize,
        tag: Tag,
        range: Range<usize>,
        pixel: impl Fn(usize) -> P,
    ) -> Result<(), CompositeError> {
        let begin = self.comm.now();
        let message = wire::encode(self.fingerprint, range, pixel);
        self.report.compress_secs += self.comm.now() - begin;
        self.send_bytes(place, tag, message)
    }

    /// Receives a part and hands it to `use_part`; `expected` is `None` where only the sender knows which part it is.
    pub(crate) fn recv<P: Composite, T>(
        &mut self,
        place: usize,
        tag: Tag,
        expected: Option<Range<usize>>,
        use_part: impl FnOnce(&wire::Part<'_>) -> T,
    ) -> Result<T, CompositeError> {
        // A little more than the longest honest message: one that is too long shall reach the decoder, which says what is wrong.
        let pixels = expected.as_ref().map_or(self.image_pixels, ExactSizeIterator::len);
        let message = self.recv_bytes(place, tag, wire::longest::<P>(pixels) + 64)?;
        let begin = self.comm.now();
        let result = match wire::decode::<P>(&message, self.fingerprint, self.image_pixels, expected) {
            Ok(part) => Ok(use_part(&part)),
            Err(reason) => Err(self.unusable(place, reason)),
        };
        self.report.blend_secs += self.comm.now() - begin;
        result
    }

    /// Receives the part `range` and joins it to `held`, the same part of what this rank holds.
    pub(crate) fn recv_joined<P: Composite>(
        &mut self,
        place: usize,
        tag: Tag,
        range: Range<usize>,
        held: &mut [P],
        side: Side,
    ) -> Result<(), CompositeError> {
        self.recv::<P, _>(place, tag, Some(range), |part| {
            part.for_each_active(|index, pixel| {
                held[index] = match side {
                    Side::Lower => combine(pixel, held[index]),
                    Side::Higher => combine(held[index], pixel),
                };
            });
        })
    }

    /// Gives `numbers` of every place to every place; all must bring the same amount.
    pub(crate) fn all_gather(&mut self, numbers: &[u64]) -> Result<Vec<Vec<u64>>, CompositeError> {
        // Checksum, fingerprint, numbers.
        let mut message = vec![0; 8];
        message.extend_from_slice(&self.fingerprint.to_le_bytes());
        for number in numbers {
            message.extend_from_slice(&number.to_le_bytes());
        }
        let sum = wire::checksum(&message[8..]);
        message[..8].copy_from_slice(&sum.to_le_bytes());
        for step in 1..self.places() {
            // Every rank begins with its neighbour, so that no rank gets all first messages.
            self.send_bytes((self.place + step) % self.places(), Tag::Load, message.clone())?;
        }
        let mut all = Vec::with_capacity(self.places());
        for place in 0..self.places() {
            if place == self.place {
                all.push(numbers.to_vec());
                continue;
            }
            let bytes = self.recv_bytes(place, Tag::Load, message.len().max(64 * 1024))?;
            all.push(
                read_numbers(&bytes, message.len(), self.fingerprint).map_err(|r| self.unusable(place, r))?,
            );
        }
        Ok(all)
    }

    fn unusable(&self, place: usize, reason: WireError) -> CompositeError {
        CompositeError::Message { rank: self.order[self.place], from: self.order[place], reason }
    }
}

/// Reads what [`Session::all_gather`] sends; `length` is that of this rank's own message.
fn read_numbers(bytes: &[u8], length: usize, fingerprint: u64) -> Result<Vec<u64>, WireError> {
    // A sender with another image size has another length: its fingerprint is the better explanation.
    if bytes.len() < 16 {
        return Err(WireError::Length { expected: length as u64, found: bytes.len() as u64 });
    }
    let mut words =
        bytes.chunks_exact(8).map(|c| u64::from_le_bytes([c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]]));
    let (expected, found) = (words.next().unwrap_or(0), wire::checksum(&bytes[8..]));
    if expected != found {
        return Err(WireError::Checksum { expected, found });
    }
    if words.next() != Some(fingerprint) {
        return Err(WireError::Fingerprint);
    }
    if bytes.len() != length {
        return Err(WireError::Length { expected: length as u64, found: bytes.len() as u64 });
    }
    Ok(words.collect())
}
