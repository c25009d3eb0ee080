//! Collects finished tiles on one rank.
use super::rank_frame::{RankFrame, each};
use super::request_reply::{Inbox, RankChannel, Tag};
use super::tile_hits::TileHits;
use super::tile_owners::TileOwners;
use super::wire_format::{read_images, words_per_pixel, write_image};
use super::{Activity, FrameError};
use crate::comm::CommError;
use rt_core::deferred::{Pass, TileState};
use rt_core::frame::Frame;
use rt_core::render::Crop;
use std::ops::Range;

/// One rank's side of collecting the image at the root.
pub(super) struct TileCollector<'a> {
    side: &'a RankFrame<'a>,
    tiles: &'a mut [TileState],
    /// Number of the first of `tiles`.
    first: usize,
    root: Option<usize>,
    /// The image, on the root.
    picture: Option<Frame>,
    /// By rank, the next tile expected from it.
    next: Vec<usize>,
}

impl<'a> TileCollector<'a> {
    /// A collector that has received nothing. `tiles` are this rank's.
    pub(super) fn new(
        channel: &RankChannel<'_>,
        side: &'a RankFrame<'a>,
        owners: &TileOwners,
        tiles: &'a mut [TileState],
        root: Option<usize>,
    ) -> Result<TileCollector<'a>, FrameError> {
        let (rank, size) = (channel.rank(), channel.size());
        if let Some(peer) = root.filter(|&r| r >= size) {
            return Err(FrameError::Comm(CommError::NoSuchRank { peer, size }));
        }
        let (area, layers) = (side.options.area(), side.options.layers);
        let depth = side.camera.background_depth() as f32;
        let picture =
            (root == Some(rank)).then(|| Frame::blank(area.width, area.height, layers, depth));
        let next = owners.tiles.iter().map(|t| t.start).collect();
        Ok(TileCollector { side, tiles, first: owners.tiles[rank].start, root, picture, next })
    }

    /// Posts the receives of all tiles, which arrive in `chunks` from each rank.
    pub(super) fn post_receives(
        &self,
        channel: &mut RankChannel<'_>,
        inbox: &mut Inbox,
        owners: &TileOwners,
        chunks: usize,
    ) -> Result<(), FrameError> {
        let (rank, size) = (channel.rank(), channel.size());
        if self.root != Some(rank) {
            return Ok(());
        }
        for chunk in 0..chunks {
            for from in (0..size).filter(|&from| from != rank) {
                let tiles = owners.chunk(from, (chunk, chunks));
                if !tiles.is_empty() {
                    let words = tiles.map(|t| words_of(self.side, t)).sum();
                    channel.expect(inbox, from, Tag::Tiles, words)?;
                }
            }
        }
        Ok(())
    }

    /// Sets the tiles in `range` to the colours of their nearest hits, and sends them.
    pub(super) fn finish(
        &mut self,
        channel: &mut RankChannel<'_>,
        range: Range<usize>,
        pass: Pass,
        answers: &[TileHits],
    ) -> Result<(), FrameError> {
        let (rank, frame) = (channel.rank(), self.side.frame);
        let places = range.start - self.first..range.end - self.first;
        let mut failed = Vec::new();
        let mut work: Vec<_> = self.tiles[places.clone()]
            .iter_mut()
            .zip(&answers[places])
            .map(|w| (w, None))
            .collect();
        each(channel, self.side.parallel, &mut work, |_, ((tile, answer), error)| {
            tile.begin(frame, pass);
            *error = tile.select_colors(frame, &answer.colors()).err();
        });
        failed.extend(work.into_iter().filter_map(|(_, error)| error));
        if let Some(source) = failed.into_iter().next() {
            return Err(FrameError::Answer { rank, source });
        }
        channel.record_span(Activity::Shade);
        self.send(channel, range)
    }

    /// Sends finished tiles to the root; on the root, writes them into the image.
    fn send(
        &mut self,
        channel: &mut RankChannel<'_>,
        range: Range<usize>,
    ) -> Result<(), FrameError> {
        let (rank, frame) = (channel.rank(), self.side.frame);
        let Some(root) = self.root.filter(|_| !range.is_empty()) else { return Ok(()) };
        let tiles = &self.tiles[range.start - self.first..range.end - self.first];
        let mut words = Vec::new();
        for tile in tiles {
            write_image(&tile.image(frame), &mut words);
        }
        if rank == root {
            self.put(range, &words)
                .ok_or_else(|| channel.message_error(rank, "tiles", words.len()))?;
        } else {
            channel.send(root, Tag::Tiles, &words)?;
        }
        channel.record_span(Activity::Collect);
        Ok(())
    }

    fn put(&mut self, range: Range<usize>, words: &[u32]) -> Option<()> {
        let (frame, whole) = (self.side.frame, self.side.options.area());
        let areas = range.map(|tile| {
            let area = frame.tile_area(tile);
            Crop { x: area.x - whole.x, y: area.y - whole.y, ..area }
        });
        read_images(self.picture.as_mut()?, areas, words)
    }

    /// Writes the next chunk of tiles of rank `from` into the image.
    pub(super) fn put_chunk(
        &mut self,
        channel: &mut RankChannel<'_>,
        owners: &TileOwners,
        from: usize,
        chunks: usize,
        words: &[u32],
    ) -> Result<(), FrameError> {
        let next = self.next[from];
        let chunk = (0..chunks).map(|c| owners.chunk(from, (c, chunks)));
        let range = chunk.filter(|r| !r.is_empty()).find(|r| r.start >= next);
        let placed = range.and_then(|range| {
            self.next[from] = range.end;
            self.put(range, words)
        });
        channel.record_span(Activity::Collect);
        placed.ok_or_else(|| channel.message_error(from, "tiles", words.len()))
    }

    /// Collects all tiles at once, at the end of a frame.
    pub(super) fn all(
        mut self,
        channel: &mut RankChannel<'_>,
        owners: &TileOwners,
    ) -> Result<Option<Frame>, FrameError> {
        let mut inbox = Inbox::default();
        self.post_receives(channel, &mut inbox, owners, 1)?;
        self.send(channel, owners.tiles[channel.rank()].clone())?;
        while let Some(incoming) = channel.next(&mut inbox, true)? {
            self.put_chunk(channel, owners, incoming.from, 1, &incoming.words)?;
        }
        Ok(self.picture)
    }

    /// The image, after a pass in which tiles were sent as they were finished.
    pub(super) fn into_picture(self) -> Option<Frame> {
        self.picture
    }
}

/// Words of a tile.
fn words_of(side: &RankFrame<'_>, tile: usize) -> usize {
    let area = side.frame.tile_area(tile);
    (area.width * area.height) as usize * words_per_pixel(side.options.layers)
}
