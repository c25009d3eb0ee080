//! IceT (K. Moreland, W. Kendall, T. Peterka, J. Huang, "An Image Compositing Solution at Scale",
//! SC11) on the same ranks and the same frames. The thesis used this library, and our times are
//! compared with it.
//!
//! The stock build of a distribution is loaded at run time (Debian: package `paraview`); nothing of
//! it is linked or shipped. Under Open MPI it uses its own MPI layer. Otherwise its table of
//! functions sends its messages: by MPI directly (MPICH, SMPI), or over a [`Communicator`] between
//! threads. Then every rank has a copy of the library, because IceT keeps its state in globals.
#![allow(unsafe_code, reason = "calls into IceT, which is found at run time")]

mod library;
mod over_comm;
mod over_mpi;
mod table;

pub use library::{find, missing};

use crate::comm::Communicator;
use crate::comm::mpi::{Abi, MpiComm};
use crate::rect::Rect;
use library::Library;
use over_comm::OverComm;
use over_mpi::OverMpi;
use std::ffi::{c_int, c_void};
use std::path::{Path, PathBuf};
use table::Table;

/// Why IceT could not be used.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum IcetError {
    /// Not found on this machine.
    #[error(
        "IceT was not found (looked for {looked_for}): install the Debian package `paraview`, \
         or name the library libvtkIceTCore or libIceTCore in RTSV_ICET"
    )]
    Missing {
        /// Where it was searched.
        looked_for: String,
    },
    /// Found, but not usable.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A frame has the wrong size.
    #[error("a frame of {found} values where IceT was set up for {expected}")]
    FrameSize {
        /// Values needed.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// A frame of another kind than the mode composites.
    #[error("a frame of {found} where IceT was set up for {mode:?}")]
    FrameFormat {
        /// The mode.
        mode: IcetMode,
        /// What was given.
        found: &'static str,
    },
    /// IceT reported an error.
    #[error("IceT reports error {code:#010x} (see IceT.h)")]
    Reported {
        /// Its number.
        code: u32,
    },
}

/// IceT's single-image strategies; all are used within its strategy `reduce`, the default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IcetStrategy {
    /// Binary swap.
    BinarySwap,
    /// Radix-k, k about 8.
    RadixK,
    /// Radix-k with remainders: any number of ranks without folding.
    RadixKr,
    /// Binary tree.
    Tree,
}

impl IcetStrategy {
    /// The strategies of the comparison.
    pub const ALL: [Self; 4] = [Self::BinarySwap, Self::RadixK, Self::RadixKr, Self::Tree];

    /// Name as in IceT's own timing program.
    pub fn name(self) -> &'static str {
        match self {
            Self::BinarySwap => "bswap",
            Self::RadixK => "radix-k",
            Self::RadixKr => "radix-kr",
            Self::Tree => "tree",
        }
    }

    /// `ICET_SINGLE_IMAGE_STRATEGY_*` of IceT.h.
    fn code(self) -> u32 {
        match self {
            Self::BinarySwap => 0x7002,
            Self::Tree => 0x7003,
            Self::RadixK => 0x7004,
            Self::RadixKr => 0x7005,
        }
    }
}

/// What IceT composites. It has no mode with both depth and transparency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IcetMode {
    /// RGBA8 and depth, nearest wins.
    Depth,
    /// RGBA f32 and depth, nearest wins.
    DepthF32,
    /// Premultiplied RGBA8, in order.
    BlendU8,
    /// Premultiplied RGBA f32, in order.
    BlendF32,
}

/// A frame as IceT takes it.
#[derive(Clone, Copy, Debug)]
pub enum IcetFrame<'a> {
    /// For [`IcetMode::Depth`].
    Depth(&'a [[u8; 4]], &'a [f32]),
    /// For [`IcetMode::DepthF32`].
    DepthF32(&'a [[f32; 4]], &'a [f32]),
    /// For [`IcetMode::BlendU8`].
    BlendU8(&'a [[u8; 4]]),
    /// For [`IcetMode::BlendF32`].
    BlendF32(&'a [[f32; 4]]),
}

impl IcetFrame<'_> {
    fn name(&self) -> &'static str {
        match self {
            IcetFrame::Depth(..) => "RGBA8 and depth",
            IcetFrame::DepthF32(..) => "RGBA f32 and depth",
            IcetFrame::BlendU8(_) => "premultiplied RGBA8",
            IcetFrame::BlendF32(_) => "premultiplied RGBA f32",
        }
    }
}

/// The collected image, in IceT's memory until its next frame.
#[derive(Clone, Copy, Debug)]
pub enum IcetImage<'a> {
    /// RGBA8.
    Rgba8(&'a [[u8; 4]]),
    /// RGBA f32.
    RgbaF32(&'a [[f32; 4]]),
}

/// How IceT's messages are sent. The boxes have a fixed address, which IceT stores.
enum MessageLayer {
    /// Its own layer for Open MPI.
    Own,
    /// MPI functions, called directly.
    Mpi { _over: Box<OverMpi>, _table: Box<Table> },
    /// A communicator that is lent for each call.
    Comm { over: Box<OverComm>, _table: Box<Table> },
}

/// One rank's IceT.
pub struct Icet {
    library: Library,
    message_layer: MessageLayer,
    mode: IcetMode,
    pixels: usize,
    rank: usize,
}

impl Icet {
    /// IceT over MPI, set up for images of this size that go to rank 0.
    ///
    /// # Errors
    /// [`IcetError`].
    pub fn over_mpi(
        path: &Path,
        comm: &MpiComm,
        mode: IcetMode,
        width_px: u32,
        height_px: u32,
    ) -> Result<Self, IcetError> {
        // SMPI runs all ranks in one process, so each needs its own globals.
        let library = Library::open(path, comm.abi() == Abi::Smpi)?;
        if comm.abi() == Abi::OpenMpi {
            let own = library.own_mpi_layer(path, comm.library().world)?;
            // SAFETY: a communicator that IceT's MPI layer has just made.
            unsafe { (library.functions.create_context)(own) };
            return Self::set_up(
                library,
                MessageLayer::Own,
                mode,
                width_px,
                height_px,
                comm.rank(),
            );
        }
        let mut over = Box::new(OverMpi::new(comm.library(), comm.rank(), comm.size()));
        let mut table = Box::new(table::of::<OverMpi>((&raw mut *over).cast()));
        // SAFETY: the table and what it points to live as long as this object, and IceT is not
        // called after that.
        unsafe { (library.functions.create_context)((&raw mut *table).cast()) };
        Self::set_up(
            library,
            MessageLayer::Mpi { _over: over, _table: table },
            mode,
            width_px,
            height_px,
            comm.rank(),
        )
    }

    /// IceT over any communicator between threads, set up for images of this size that go to rank
    /// 0. Every frame needs the same communicator.
    ///
    /// # Errors
    /// [`IcetError`].
    pub fn over_comm(
        path: &Path,
        comm: &mut dyn Communicator,
        mode: IcetMode,
        width_px: u32,
        height_px: u32,
    ) -> Result<Self, IcetError> {
        let library = Library::open(path, true)?;
        let rank = comm.rank();
        let mut over = Box::new(OverComm::new(rank, comm.size()));
        let mut table = Box::new(table::of::<OverComm>((&raw mut *over).cast()));
        let lent = over.with_comm(comm);
        // SAFETY: as in `over_mpi`; the communicator is lent for this call.
        unsafe { (library.functions.create_context)((&raw mut *table).cast()) };
        drop(lent);
        Self::set_up(
            library,
            MessageLayer::Comm { over, _table: table },
            mode,
            width_px,
            height_px,
            rank,
        )
    }

    fn set_up(
        library: Library,
        message_layer: MessageLayer,
        mode: IcetMode,
        width_px: u32,
        height_px: u32,
        rank: usize,
    ) -> Result<Self, IcetError> {
        // Constants of IceT.h.
        let (composite_mode, color, depth) = match mode {
            IcetMode::Depth => (0x0301, 0xC001, 0xD001),
            IcetMode::DepthF32 => (0x0301, 0xC002, 0xD001),
            IcetMode::BlendU8 => (0x0302, 0xC001, 0xD000),
            IcetMode::BlendF32 => (0x0302, 0xC002, 0xD000),
        };
        let f = &library.functions;
        // SAFETY: a context is current (one per process or per copy of the library); all arguments
        // are numbers.
        unsafe {
            (f.diagnostics)(0);
            (f.composite_mode)(composite_mode);
            (f.set_color_format)(color);
            (f.set_depth_format)(depth);
            (f.reset_tiles)();
            (f.add_tile)(0, 0, width_px as c_int, height_px as c_int, 0);
            (f.strategy)(0x6004);
            // No bounding box: the viewport of each frame says more.
            (f.bounding_vertices)(0, 0x800F, 0, 0, std::ptr::null());
            if matches!(mode, IcetMode::BlendU8 | IcetMode::BlendF32) {
                (f.enable)(0x0142);
            }
        }
        let pixels = width_px as usize * height_px as usize;
        let this = Self { library, message_layer, mode, pixels, rank };
        this.check().map(|()| this)
    }

    fn check(&self) -> Result<(), IcetError> {
        // SAFETY: a query.
        match unsafe { (self.library.functions.get_error)() } {
            0 => Ok(()),
            code => Err(IcetError::Reported { code }),
        }
    }

    /// Sets the strategy of the next frames.
    pub fn set_strategy(&mut self, strategy: IcetStrategy) {
        // SAFETY: a context is current.
        unsafe { (self.library.functions.single_image_strategy)(strategy.code()) };
    }

    /// Sets the front-to-back order of the ranks, for blending.
    pub fn set_order(&mut self, front_to_back: &[usize]) {
        let order: Vec<c_int> = front_to_back.iter().map(|&rank| rank as c_int).collect();
        // SAFETY: IceT copies one number for each rank.
        unsafe { (self.library.functions.composite_order)(order.as_ptr()) };
    }

    /// Composites a frame; all ranks call this. `bounds` contains everything that was drawn. `comm`
    /// is the communicator of [`over_comm`](Self::over_comm); it is not used over MPI. Rank 0 gets
    /// the image.
    ///
    /// # Errors
    /// [`IcetError::FrameSize`], [`IcetError::FrameFormat`], [`IcetError::Reported`].
    pub fn composite(
        &mut self,
        comm: &mut dyn Communicator,
        frame: IcetFrame<'_>,
        bounds: Rect,
    ) -> Result<Option<IcetImage<'_>>, IcetError> {
        // IceT reads as many bytes as its mode has.
        let mode = match frame {
            IcetFrame::Depth(..) => IcetMode::Depth,
            IcetFrame::DepthF32(..) => IcetMode::DepthF32,
            IcetFrame::BlendU8(_) => IcetMode::BlendU8,
            IcetFrame::BlendF32(_) => IcetMode::BlendF32,
        };
        if mode != self.mode {
            return Err(IcetError::FrameFormat { mode: self.mode, found: frame.name() });
        }
        let (colors, depths): (*const c_void, *const c_void) = match frame {
            IcetFrame::Depth(colors, depths) => {
                self.fits(colors.len())?;
                self.fits(depths.len())?;
                (colors.as_ptr().cast(), depths.as_ptr().cast())
            }
            IcetFrame::DepthF32(colors, depths) => {
                self.fits(colors.len())?;
                self.fits(depths.len())?;
                (colors.as_ptr().cast(), depths.as_ptr().cast())
            }
            IcetFrame::BlendU8(colors) => {
                self.fits(colors.len())?;
                (colors.as_ptr().cast(), std::ptr::null())
            }
            IcetFrame::BlendF32(colors) => {
                self.fits(colors.len())?;
                (colors.as_ptr().cast(), std::ptr::null())
            }
        };
        let viewport = [bounds.x0, bounds.y0, bounds.width() as u32, bounds.height() as u32]
            .map(|n| n as c_int);
        let background = [0.0_f32; 4];
        let lent = match &mut self.message_layer {
            MessageLayer::Comm { over, .. } => Some(over.with_comm(comm)),
            MessageLayer::Own | MessageLayer::Mpi { .. } => None,
        };
        // SAFETY: buffers of the size of the tile in the formats of `set_up`, four numbers, no
        // matrices (allowed: there is no bounding box to project), four channels.
        let image = unsafe {
            (self.library.functions.composite_image)(
                colors,
                depths,
                viewport.as_ptr(),
                std::ptr::null(),
                std::ptr::null(),
                background.as_ptr(),
            )
        };
        drop(lent);
        self.check()?;
        if self.rank != 0 {
            return Ok(None);
        }
        // SAFETY: rank 0 displays the tile, so the image is whole and in the format of `set_up`;
        // IceT keeps it until its next frame, which needs `&mut self`.
        Ok(Some(unsafe {
            match self.mode {
                IcetMode::BlendF32 | IcetMode::DepthF32 => {
                    let first = (self.library.functions.image_colors_f32)(image);
                    IcetImage::RgbaF32(std::slice::from_raw_parts(first, self.pixels))
                }
                IcetMode::Depth | IcetMode::BlendU8 => {
                    let first = (self.library.functions.image_colors_u8)(image);
                    IcetImage::Rgba8(std::slice::from_raw_parts(first, self.pixels))
                }
            }
        }))
    }

    fn fits(&self, found: usize) -> Result<(), IcetError> {
        if found == self.pixels {
            Ok(())
        } else {
            Err(IcetError::FrameSize { expected: self.pixels, found })
        }
    }

    /// Whether its messages use its own MPI layer.
    pub fn uses_own_layer(&self) -> bool {
        matches!(self.message_layer, MessageLayer::Own)
    }
}
