//! Display walls: one frame of all ranks, cut into tiles that different ranks show.
//!
//! Each tile is composited for itself, from windows of the frames that are not copied. Tiles may
//! overlap, as projectors do, and leave gaps, as bezels do; a rank may show several. (IceT calls
//! the same a multi-tile display: Moreland, Wylie and Pavlakos, "Sort-Last Parallel Rendering for
//! Viewing Extremely Large Data Sets on Tile Displays", PVG 2001.)
use crate::codec::mix;
use crate::comm::Communicator;
use crate::compositor::{Compositor, Destination, abort_group};
use crate::error::CompositeError;
use crate::frame::{Frame, Image};
use crate::pixel::Composite;
use crate::rect::Rect;
use std::time::Duration;

/// A tile of a display wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WallTile {
    /// Its pixels in the whole image.
    pub pixels: Rect,
    /// The rank that shows it.
    pub rank: usize,
}

impl<P: Composite> Compositor<P> {
    /// Composites the frames of all ranks into the tiles of a display wall. Every rank calls this
    /// with the same tiles. Returns the images of the tiles that this rank shows, each with its
    /// number in `tiles`. [`Options::destination`](crate::Options::destination) is not used.
    ///
    /// ```
    /// use composite::{Communicator, Compositor, Frame, Options, Rect, WallTile, threads};
    ///
    /// // Two ranks, an image of 4x1 pixels, of which each shows one half.
    /// let tiles = [0, 1].map(|k| WallTile {
    ///     pixels: Rect { x0: 2 * k, y0: 0, x1: 2 * k + 2, y1: 1 },
    ///     rank: k as usize,
    /// });
    /// let shown = threads::run(2, |mut comm| {
    ///     let color = [[10 * comm.rank() as u8 + 1, 0, 0, 255]; 4];
    ///     let frame = Frame::with_depth(4, 1, &color, &[0.25, 0.5, 0.75, 0.5])?;
    ///     Compositor::new(Options::default()).composite_wall(&mut comm, &frame, &tiles)
    /// });
    /// let (number, image) = &shown[1].as_ref().unwrap().as_ref().unwrap()[0];
    /// assert_eq!((*number, image.width_px()), (1, 2));
    /// assert_eq!(image.colors()[0], [11, 0, 0, 255], "equal depths go to the highest rank");
    /// ```
    ///
    /// # Errors
    /// [`CompositeError::Options`] if a tile reaches outside the image or belongs to no rank, or if
    /// ranks give different tiles; otherwise as [`Compositor::composite`]. Every rank gets an
    /// error, and the communicator cannot be used afterwards.
    pub fn composite_wall(
        &mut self,
        comm: &mut dyn Communicator,
        frame: &Frame<'_, P>,
        tiles: &[WallTile],
    ) -> Result<Vec<(usize, Image<P>)>, CompositeError> {
        let timeout = self.options.timeout;
        let agreed = check(comm.size(), frame, tiles).and_then(|()| agree(comm, tiles, timeout));
        if let Err(error) = agreed {
            abort_group(comm, &error);
            return Err(error);
        }
        let (destination, barrier) = (self.options.destination, self.options.final_barrier);
        let mut shown = Vec::new();
        let mut result = Ok(());
        for (number, tile) in tiles.iter().enumerate() {
            self.options.destination = Destination::Rank(tile.rank);
            self.options.final_barrier = barrier && number + 1 == tiles.len();
            let done = frame.window(tile.pixels).and_then(|window| self.composite(comm, &window));
            match done {
                Ok(output) => shown.extend(output.image.map(|image| (number, image))),
                Err(error) => {
                    result = Err(error);
                    break;
                }
            }
        }
        (self.options.destination, self.options.final_barrier) = (destination, barrier);
        result.map(|()| shown)
    }
}

fn check<P: Composite>(
    ranks: usize,
    frame: &Frame<'_, P>,
    tiles: &[WallTile],
) -> Result<(), CompositeError> {
    for (number, WallTile { pixels, rank }) in tiles.iter().enumerate() {
        let fault = |what: String| Err(CompositeError::Options(format!("tile {number}: {what}")));
        if *rank >= ranks {
            return fault(format!("rank {rank} of a group of {ranks} ranks is to show it"));
        }
        if let Err(error) = Rect::of_size(frame.width_px(), frame.height_px()).must_contain(pixels)
        {
            return fault(error.to_string());
        }
    }
    Ok(())
}

/// Compares the tiles of all ranks by a digest. Sizes alone would not do: tiles of one size at
/// other places would be joined to an image that nobody has seen.
fn agree(
    comm: &mut dyn Communicator,
    tiles: &[WallTile],
    timeout: Duration,
) -> Result<(), CompositeError> {
    let numbers = tiles.iter().flat_map(|WallTile { pixels: p, rank }| {
        [u64::from(p.x0), u64::from(p.y0), u64::from(p.x1), u64::from(p.y1), *rank as u64]
    });
    let digest = numbers.fold(tiles.len() as u64, mix).to_le_bytes();
    let all = comm.all_gather(&digest, digest.len(), timeout)?;
    let Some(odd) = all.iter().position(|of_rank| *of_rank != all[0]) else { return Ok(()) };
    Err(CompositeError::Options(format!(
        "rank {odd} gives other tiles of the display wall than rank 0: give the same on all ranks"
    )))
}
