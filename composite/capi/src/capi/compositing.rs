//! Compositing alone: images of all ranks in, one image out, or the tiles of a display wall.

use super::group::{Group, collective, free};
use super::handles::{self, Handled};
use super::memory::{check_pointer, check_size, flag, put, read, unused};
use super::planes::Planes;
use super::status::{Failure, c_text, guarded};
use super::types::*;
use composite::{
    Communicator, Composite, Compositor, DepthPixel, Destination, Image, Options, Piece,
    PremultipliedPixel, Rect, Strategy, WallTile, f16,
};
use std::ffi::{CString, c_char};
use std::time::Duration;

/// The object behind a [`RtsvCompositeCompositor`].
struct CompositorObject {
    /// The handle of its group.
    group: usize,
    typed: Box<dyn Typed>,
    /// What the last call copied, and why.
    copies: String,
    text: CString,
}

impl Handled for CompositorObject {
    const NAME: &'static str = "compositor";
}

/// A compositor of any pixel format.
trait Typed {
    /// # Safety
    /// As [`Planes::new`].
    unsafe fn composite(
        &mut self,
        comm: &mut dyn Communicator,
        frame: &RtsvCompositeFrame,
        copies: &mut String,
    ) -> Result<RtsvCompositeImage, Failure>;

    /// The images of tiles that this rank shows, with their numbers.
    ///
    /// # Safety
    /// As [`Planes::new`].
    unsafe fn wall(
        &mut self,
        comm: &mut dyn Communicator,
        frame: &RtsvCompositeFrame,
        tiles: &[WallTile],
        copies: &mut String,
    ) -> Result<Vec<(usize, RtsvCompositeImage)>, Failure>;

    fn set_order(&mut self, order: Option<Vec<usize>>);
}

struct OfFormat<P: Composite> {
    compositor: Compositor<P>,
    /// What the last call gave to the program.
    images: Vec<(usize, Image<P>)>,
    piece: Option<Piece<P>>,
}

const NOTHING: RtsvCompositeImage = RtsvCompositeImage {
    struct_bytes: size_of::<RtsvCompositeImage>() as u64,
    width: 0,
    height: 0,
    x: 0,
    y: 0,
    color: std::ptr::null(),
    depth: std::ptr::null(),
};

/// Pixels of the library, shown to the program.
fn shown<C>(rect: Rect, colors: &[C], depths: &[f32]) -> RtsvCompositeImage {
    if rect.is_empty() {
        return NOTHING;
    }
    RtsvCompositeImage {
        width: rect.width() as u32,
        height: rect.height() as u32,
        x: rect.x0,
        y: rect.y0,
        color: colors.as_ptr().cast(),
        depth: if depths.is_empty() { std::ptr::null() } else { depths.as_ptr() },
        ..NOTHING
    }
}

impl<P: Composite> OfFormat<P> {
    /// Takes back what the program has seen.
    fn recycle(&mut self) {
        self.piece = None;
        for (_, image) in self.images.drain(..) {
            self.compositor.recycle(image);
        }
    }
}

impl<P: Composite> Typed for OfFormat<P> {
    unsafe fn composite(
        &mut self,
        comm: &mut dyn Communicator,
        frame: &RtsvCompositeFrame,
        copies: &mut String,
    ) -> Result<RtsvCompositeImage, Failure> {
        self.recycle();
        // SAFETY: the caller's promise.
        let planes = unsafe { Planes::<P>::new(frame, copies) }?;
        let output = self.compositor.composite(comm, &planes.frame()?)?;
        self.images.extend(output.image.map(|image| (0, image)));
        self.piece = output.piece;
        Ok(match (&self.images[..], &self.piece) {
            ([(_, image)], _) => shown(
                Rect::of_size(image.width_px(), image.height_px()),
                image.colors(),
                image.depths(),
            ),
            (_, Some(piece)) => shown(piece.bounds, &piece.colors, &piece.depths),
            _ => NOTHING,
        })
    }

    unsafe fn wall(
        &mut self,
        comm: &mut dyn Communicator,
        frame: &RtsvCompositeFrame,
        tiles: &[WallTile],
        copies: &mut String,
    ) -> Result<Vec<(usize, RtsvCompositeImage)>, Failure> {
        self.recycle();
        // SAFETY: the caller's promise.
        let planes = unsafe { Planes::<P>::new(frame, copies) }?;
        self.images = self.compositor.composite_wall(comm, &planes.frame()?, tiles)?;
        let of = |(number, image): &(usize, Image<P>)| {
            (*number, shown(tiles[*number].pixels, image.colors(), image.depths()))
        };
        Ok(self.images.iter().map(of).collect())
    }

    fn set_order(&mut self, order: Option<Vec<usize>>) {
        self.compositor.set_order(order);
    }
}

fn typed(format: u32, options: Options) -> Result<Box<dyn Typed>, Failure> {
    fn of<P: Composite>(options: Options) -> Box<dyn Typed> {
        let compositor = Compositor::<P>::new(options);
        Box::new(OfFormat { compositor, images: Vec::new(), piece: None })
    }
    Ok(match format {
        RTSV_COMPOSITE_DEPTH_U8 => of::<DepthPixel<[u8; 4]>>(options),
        RTSV_COMPOSITE_DEPTH_U16 => of::<DepthPixel<[u16; 4]>>(options),
        RTSV_COMPOSITE_DEPTH_F16 => of::<DepthPixel<[f16; 4]>>(options),
        RTSV_COMPOSITE_DEPTH_F32 => of::<DepthPixel<[f32; 4]>>(options),
        RTSV_COMPOSITE_ALPHA_U8 => of::<PremultipliedPixel<[u8; 4]>>(options),
        RTSV_COMPOSITE_ALPHA_U16 => of::<PremultipliedPixel<[u16; 4]>>(options),
        RTSV_COMPOSITE_ALPHA_F16 => of::<PremultipliedPixel<[f16; 4]>>(options),
        RTSV_COMPOSITE_ALPHA_F32 => of::<PremultipliedPixel<[f32; 4]>>(options),
        _ => {
            return Err(Failure::value(format!(
                "there is no pixel format {format}: give RTSV_COMPOSITE_DEPTH_U8 or one beside it"
            )));
        }
    })
}

/// The longest wait, seconds: longer ones cannot be added to a clock.
const LONGEST_WAIT: f64 = 1e9;

/// A wait in seconds.
pub(crate) fn timeout_of(secs: f64, structure: &str) -> Result<Duration, Failure> {
    let usable = secs > 0.0 && secs <= LONGEST_WAIT;
    let timeout = Duration::try_from_secs_f64(secs).ok().filter(|_| usable);
    timeout.ok_or_else(|| {
        Failure::value(format!(
            "timeout_secs of {structure} is {secs}: give seconds above 0, at most {LONGEST_WAIT}"
        ))
    })
}

fn options_of(given: &RtsvCompositeOptions) -> Result<Options, Failure> {
    const NAME: &str = "RtsvCompositeOptions";
    unused(given.reserved, NAME)?;
    let flag = |value, what: &str| flag(value, &format!("{what} of {NAME}"));
    Ok(Options {
        strategy: match given.strategy {
            RTSV_COMPOSITE_DIRECT_SEND => Strategy::DirectSend,
            RTSV_COMPOSITE_TREE => Strategy::Tree,
            RTSV_COMPOSITE_BINARY_SWAP => Strategy::BinarySwap,
            RTSV_COMPOSITE_RADIX_K => Strategy::RadixK { k: given.radix as usize },
            RTSV_COMPOSITE_AUTOMATIC => Strategy::Automatic,
            other => {
                return Err(Failure::value(format!(
                    "strategy of {NAME} is {other}: give RTSV_COMPOSITE_DIRECT_SEND or one beside \
                     it"
                )));
            }
        },
        destination: match given.destination {
            -1 => Destination::Distributed,
            rank => Destination::Rank(usize::try_from(rank).map_err(|_| {
                Failure::value(format!("destination of {NAME} is {rank}: give a rank, or -1"))
            })?),
        },
        order: None,
        depth: flag(given.depth, "depth")?,
        verify: flag(given.verify, "verify")?,
        slice_px: Some(given.slice_px as usize).filter(|&pixels| pixels > 0),
        in_memory: flag(given.in_memory, "in_memory")?,
        simd: None,
        timeout: timeout_of(given.timeout_secs, NAME)?,
        final_barrier: flag(given.final_barrier, "final_barrier")?,
    })
}

/// Fills options with their defaults; `struct_bytes` is sizeof of the structure.
///
/// # Safety
/// `options` is null or points to `struct_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_options_init(
    options: *mut RtsvCompositeOptions,
    struct_bytes: u64,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_size::<RtsvCompositeOptions>(struct_bytes)?;
        let value = RtsvCompositeOptions {
            struct_bytes,
            strategy: RTSV_COMPOSITE_DIRECT_SEND,
            radix: 8,
            destination: 0,
            depth: 1,
            verify: 0,
            in_memory: 1,
            final_barrier: 1,
            reserved: 0,
            slice_px: 0,
            timeout_secs: 60.0,
        };
        // SAFETY: the caller's promise.
        unsafe { put(options, "options", value) }
    })
}

/// A compositor for images of one pixel format (RTSV_COMPOSITE_DEPTH_U8, ...). It keeps its buffers
/// from one image to the next. Null options are the defaults.
///
/// # Safety
/// `options` is null or valid; `out` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_compositor_new(
    comm: *mut RtsvCompositeComm,
    format: u32,
    options: *const RtsvCompositeOptions,
    out: *mut *mut RtsvCompositeCompositor,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_pointer(out, "out")?;
        let options = if options.is_null() {
            Options::default()
        } else {
            // SAFETY: the caller's promise.
            options_of(&unsafe { read(options, "options") }?)?
        };
        let group = comm.addr();
        handles::with(group, |_: &mut Group| Ok(()))?;
        let typed = typed(format, options)?;
        let object =
            CompositorObject { group, typed, copies: String::new(), text: CString::default() };
        // SAFETY: the caller's promise.
        unsafe { put(out, "out", std::ptr::without_provenance_mut(handles::add(object))) }
    })
}

/// Sets the order of the ranks for the next images: `count` ranks, each once, the one in front
/// first; null for rank 0 in front. The same on all ranks.
///
/// # Safety
/// `order` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_compositor_order(
    compositor: *mut RtsvCompositeCompositor,
    order: *const u32,
    count: u32,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(compositor.addr(), |object: &mut CompositorObject| {
            let order = if order.is_null() {
                None
            } else {
                check_pointer(order, "order")?;
                // SAFETY: the caller's promise.
                let order = unsafe { std::slice::from_raw_parts(order, count as usize) };
                Some(order.iter().map(|&rank| rank as usize).collect())
            };
            object.typed.set_order(order);
            Ok(())
        })
    })
}

/// Collective: composites the frames of all ranks into `image`.
///
/// # Safety
/// `frame` is null or valid, with planes as it describes that nothing writes to during the call;
/// `image` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_composite(
    compositor: *mut RtsvCompositeCompositor,
    frame: *const RtsvCompositeFrame,
    image: *mut RtsvCompositeImage,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(compositor.addr(), |object: &mut CompositorObject| {
            let CompositorObject { group, typed, copies, .. } = object;
            collective(*group, |comm| {
                copies.clear();
                // SAFETY: the caller's promise, also below.
                let frame = unsafe { read(frame, "frame") }?;
                // SAFETY: as above.
                unsafe { read(image.cast_const(), "image") }?;
                // SAFETY: as above.
                let done = unsafe { typed.composite(comm, &frame, copies) }?;
                // SAFETY: as above.
                unsafe { put(image, "image", done) }
            })
        })
    })
}

/// Collective: composites the frames of all ranks into the tiles of a display wall, which may
/// overlap. All ranks give the same `count` tiles. `images[k]` is tile k on the rank that shows it,
/// and without pixels on the others. The destination of the options is not used.
///
/// # Safety
/// As rtsv_composite_composite; `tiles` and `images` are null or point to `count` structures.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_composite_wall(
    compositor: *mut RtsvCompositeCompositor,
    frame: *const RtsvCompositeFrame,
    tiles: *const RtsvCompositeTile,
    count: u32,
    images: *mut RtsvCompositeImage,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(compositor.addr(), |object: &mut CompositorObject| {
            let CompositorObject { group, typed, copies, .. } = object;
            collective(*group, |comm| {
                copies.clear();
                // SAFETY: the caller's promise, also below.
                let frame = unsafe { read(frame, "frame") }?;
                check_pointer(tiles, "tiles")?;
                check_pointer(images, "images")?;
                for k in 0..count as usize {
                    // SAFETY: as above.
                    unsafe { read(images.wrapping_add(k).cast_const(), "images") }?;
                }
                // SAFETY: as above.
                let given = unsafe { std::slice::from_raw_parts(tiles, count as usize) };
                let tiles: Vec<WallTile> =
                    given.iter().enumerate().map(tile_of).collect::<Result<_, _>>()?;
                // SAFETY: as above.
                let done = unsafe { typed.wall(comm, &frame, &tiles, copies) }?;
                for k in 0..count as usize {
                    let of_tile = done.iter().find(|(number, _)| *number == k);
                    let image = of_tile.map_or(NOTHING, |(_, image)| *image);
                    // SAFETY: as above.
                    unsafe { put(images.wrapping_add(k), "images", image) }?;
                }
                Ok(())
            })
        })
    })
}

fn tile_of((number, tile): (usize, &RtsvCompositeTile)) -> Result<WallTile, Failure> {
    let RtsvCompositeTile { x, y, width, height, rank, reserved } = *tile;
    unused(reserved, "RtsvCompositeTile")?;
    let (Some(x1), Some(y1)) = (x.checked_add(width), y.checked_add(height)) else {
        return Err(Failure::value(format!("tile {number} reaches beyond any image")));
    };
    Ok(WallTile { pixels: Rect { x0: x, y0: y, x1, y1 }, rank: rank as usize })
}

/// Which planes the last call had to copy, and why: a line for each, empty for none. The text
/// belongs to the compositor until its next call.
///
/// # Safety
/// `text` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_compositor_copies(
    compositor: *mut RtsvCompositeCompositor,
    text: *mut *const c_char,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(compositor.addr(), |object: &mut CompositorObject| {
            object.text = c_text(&object.copies);
            // SAFETY: the caller's promise.
            unsafe { put(text, "text", object.text.as_ptr()) }
        })
    })
}

/// Frees a compositor and its images; null is allowed.
#[unsafe(no_mangle)]
pub extern "C" fn rtsv_composite_compositor_free(
    compositor: *mut RtsvCompositeCompositor,
) -> RtsvCompositeStatus {
    free::<CompositorObject, _>(compositor)
}
