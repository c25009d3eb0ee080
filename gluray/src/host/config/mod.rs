//! The settings of gluray: modes, effects, materials, lights, quality.
//!
//! ```text
//!   defaults < file (all programs) < file ([program.NAME]) < environment = command line < control panel
//! ```
//! Every layer is a list of assignments `path = value` (`effects.shadows = true`); [`fields`] knows
//! each path with its kind, its range and the modes in which it changes anything, and [`assign()`]
//! is the only way in. So a wrong name, type or number is told in the same words wherever it comes
//! from, and the panel draws its controls from the same table.
//!
//! Nothing here knows OpenGL: plain data, read by the library in the program and by our own
//! program.

pub mod assign;
mod current;
pub mod environment;
pub mod fields;
pub mod file;
pub mod load;
pub mod settings;

pub use assign::{Assignment, SettingError, assign};
pub(crate) use current::{Config, SUPPORTED_SETTINGS, current, program_name, replace};
pub use fields::{FIELDS, Field, Kind};
pub use file::ConfigFile;
pub use load::{Loaded, Sources};
pub use settings::{Effects, Lights, Material, Mode, Quality, Settings, Surface, Trace};
