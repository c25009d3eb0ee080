//! The settings of gluray: modes, effects, materials, lights, quality.
//!
//! ```text
//!   defaults < file (all programs) < file ([program.NAME]) < environment = command line < control panel
//! ```
//! Every layer is a list of assignments `path = value` (`effects.shadows = true`). [`fields`] lists
//! each path with its kind, its range and the modes in which it has an effect. All assignments pass
//! through [`assign()`]. A wrong name, type or number therefore gives the same message whatever its
//! source, and the panel builds its controls from the same table.
//!
//! This module does not depend on OpenGL. It is plain data, read by the library inside the program
//! and by the `gluray` command.

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
