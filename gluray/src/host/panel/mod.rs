//! The control panel of section 4.1.3, and the link between it and the programs.
//!
//! ```text
//!   program with the library                      `gluray panel`                        browser
//!   [link]: one poll per frame ── TCP, lines of JSON ── [hub] ── HTTP, token in every address ── page
//!           ^ never waits              [protocol]       [links], [routes]
//! ```
//! Both listeners are on loopback and refuse to be anywhere else. The library finds the panel by
//! `GLURAY_PANEL` or by the file that [`endpoint`] describes; the panel may start before or after
//! the program.

pub mod endpoint;
pub mod link;
pub mod protocol;

#[cfg(feature = "panel")]
mod connections;
#[cfg(feature = "panel")]
pub mod hub;
#[cfg(feature = "panel")]
mod routes;
#[cfg(feature = "panel")]
mod server;

#[cfg(feature = "panel")]
pub use server::{PanelAddresses, PanelError, serve};

pub use endpoint::{PanelEndpoint, Secret};
pub use link::Link;
pub use protocol::{FrameStats, Hello, ObjectInfo};
