//! Ray tracing inside unmodified VTK and ParaView (thesis chapter 3), and for any program that has
//! VTK-like arrays.
//!
//! Programs in Rust use [`bridge::Bridge`] with the types of [`input`]:
//!
//! ```
//! use vtk_bridge::bridge::Bridge;
//! use vtk_bridge::input::*;
//! use vtk_bridge::options::Options;
//! use rt_core::glam::DMat4;
//!
//! let points = [[-1.0f32, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
//! let polys = Cells { offsets: Ids::I64(&[0, 3]), connectivity: Ids::I64(&[0, 1, 2]) };
//! let mut bridge = Bridge::new();
//! bridge.begin(&Options::default());
//! bridge.add_surface(&Surface {
//!     name: "a triangle",
//!     shape: Shape::polygons(1, Points::F32(&points), polys),
//!     world_from_data: DMat4::IDENTITY,
//!     color: Color::Material,
//!     texture: None,
//!     maps: None,
//!     property: Property { lighting: false, ..Property::default() },
//!     back: None,
//!     glyphs: None,
//! });
//! let view = View {
//!     clip_from_world: DMat4::IDENTITY,
//!     viewer: None,
//!     width: 8,
//!     height: 8,
//!     background: [[0.0; 3]; 2],
//!     interactive: false,
//!     shadows: false,
//!     samples: 0,
//!     window_samples: 0,
//!     one_layer: false,
//!     lens: None,
//! };
//! let image = bridge.render(&view)?;
//! assert_eq!(image.opaque[5 * 8 + 4], [255; 4]);
//! assert_eq!(image.depth[5 * 8 + 4], 0.5);
//! # Ok::<(), vtk_bridge::bridge::BridgeError>(())
//! ```
//!
//! VTK and ParaView use the bridge through [`loader`] (found by `VTK_AUTOLOAD_PATH`), which loads
//! the C++ shim built for the VTK in the process. The shim calls [`capi`]. [`setup`] builds and
//! installs these parts; the program `vtk-bridge` is its command line.
#![deny(unsafe_code)]

pub mod anari;
mod assemble;
pub mod bridge;
pub mod capi;
pub mod choice;
pub mod colors;
mod edges;
pub mod geometry;
pub mod input;
pub mod lights;
pub mod loader;
pub mod materials;
pub mod options;
pub mod report;
pub mod setup;
mod volumes;
pub mod window_image;
mod window_samples;
