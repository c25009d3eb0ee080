//! The bridge in real programs: comparison with stock images, picks, ranks, effects, the plugin,
//! memory.
//!
//! Needs Debian's VTK 9.1 and ParaView 5.11, the wheel `vtk`, Xvfb and a C++ compiler (`cargo xtask
//! test` installs them). Tests whose programs are missing print that and pass, unless
//! `RTSV_REQUIRE_PEERS` is set. The images stay in `target/tmp/pictures`.

mod capture;
mod cells;
mod choice;
mod compare;
mod effects;
mod gui;
mod memory;
mod paraview;
mod peers;
mod plugin;
mod ranks;
mod scripts;
mod session;
mod vtk;
mod wheel;
