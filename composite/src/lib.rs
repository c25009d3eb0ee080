//! Sort-last compositing: every rank has rendered its part of the data, and the ranks combine
//! their images into one.
//!
//! The input is borrowed slices: colour and depth, or premultiplied colour of ranks in a known
//! front-to-back order. The output is one image, or one piece of it on every rank. Ranks
//! communicate through any [`Communicator`]. All strategies give the same bits as
//! [`composite_serial`]. Sections 3.2.1 and 3.3 of the thesis describe this step; the thesis used
//! IceT (Moreland, Kendall, Peterka, Huang, SC11).
//!
//! ```
//! use composite::{Communicator, Frame, Options, threads};
//!
//! // Three ranks, an image of 2x1 pixels: rank r drew red r at depth 0.9 - 0.1 r, but only the
//! // last rank the second pixel.
//! let results = threads::run(3, |mut comm| {
//!     let r = comm.rank() as u8;
//!     let depth = [[0.9, 0.8, 0.7][usize::from(r)], if r == 2 { 0.5 } else { 1.0 }];
//!     let color = [[r, 0, 0, 255]; 2];
//!     let frame = Frame::with_depth(2, 1, &color, &depth)?;
//!     composite::composite(&mut comm, &frame, &Options::default())
//! });
//! let on_rank_0 = results[0].as_ref().unwrap().as_ref().unwrap();
//! let image = on_rank_0.image.as_ref().unwrap();
//! assert_eq!(image.colors(), [[2, 0, 0, 255]; 2]);
//! assert_eq!(image.depths(), [0.7, 0.5]);
//! ```
//!
//! # Features
//!
//! | feature | what it adds | what it brings along |
//! |---|---|---|
//! | none | strategies, streaming, merging in shared memory, deep frames; ranks as threads, over MPI, or simulated | five small crates; no MPI, no C |
//! | `render` | module `render`: frames of a scene that ranks hold parts of | rt-core, datasets |
//! | `light` | module `render::light`: photographs of a gas that ranks hold in bricks | `render`, schlieren |
//! | `icet` | module `icet`: IceT over the same ranks | nothing |
//! | `cli` (the default) | module `cli`, the program `composite` | `render`, `icet`, clap |
//!
//! To use the compositor as a library, write `composite = { version = "0.1", default-features =
//! false }`.
#![deny(unsafe_code)]

#[cfg(feature = "cli")]
pub mod cli;
pub mod comm;
#[cfg(feature = "icet")]
pub mod icet;
pub mod rank_order;
#[cfg(feature = "render")]
pub mod render;
pub mod workload;

mod codec;
mod collect;
mod color;
mod compositor;
mod deep;
mod display_wall;
mod error;
mod frame;
mod frame_exchange;
mod in_memory;
mod layer;
mod machine_groups;
mod merge;
mod mix64;
mod network_costs;
mod node;
mod pixel;
mod rect;
mod reference;
mod report;
mod shared;
mod shared_memory_group;
mod simd;
mod strategies;
mod stream;
mod tiles;

pub use codec::MessageError;
pub use color::Color;
pub use comm::{CommError, Communicator, threads};
pub use compositor::{CompositeOutput, Compositor, Destination, Options, composite};
pub use deep::{DeepFrame, Fragment, composite_deep, composite_deep_serial};
pub use display_wall::WallTile;
pub use error::CompositeError;
pub use frame::{Frame, Image, Piece};
pub use half::f16;
pub use network_costs::NetworkCosts;
pub use pixel::{Composite, DepthPixel, PixelFormat, PremultipliedPixel, combine};
pub use rect::Rect;
pub use reference::composite_serial;
pub use report::Report;
pub use shared::composite_shared;
pub use shared_memory_group::{SharedMemoryRank, shared_memory_group};
pub use simd::SimdLevel;
pub use strategies::Strategy;
pub use stream::Stream;
