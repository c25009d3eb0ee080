//! Generators: every data set of the thesis as a deterministic function of its size.
//!
//! The generators need no files. Random numbers come from [`rt_core::math::SplitMix64`], so equal
//! parameters give equal data on every machine and with any number of threads. (The module is
//! called `generate` because `gen` is a keyword.)

pub mod blunt_body;
mod cell_average;
pub mod coal_fire;
pub mod combustion_jet;
pub mod cone_shock;
mod fibonacci;
pub mod fire;
mod flame_sheet;
pub mod flow;
pub mod gas_dynamics;
pub mod helium_plume;
pub mod impact;
pub mod mixing_layer;
pub mod multifield_jet;
pub mod nested_wavelet;
mod noise;
pub mod oblique_shock;
pub mod plasma;
mod plume;
pub mod polylines;
mod revolve;
pub mod sample_fields;
pub mod shapes;
pub mod star_field_lines;
pub mod streamline;
pub mod swept_slice;
pub mod thermal_plume;
mod tube_mesh;
mod turbulence;
pub mod wavelet;
