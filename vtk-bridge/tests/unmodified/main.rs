//! Ordinary scripts in VTK 9.1 and ParaView 5.11, with and without the bridge. The scripts know nothing of it; `run.py` saves their windows.

mod effects;
mod peers;
mod pictures;
mod plugin;
mod ranks;
mod robustness;
mod shot;
