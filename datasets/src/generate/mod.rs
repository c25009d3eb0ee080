//! Generators: every data set of the thesis as a deterministic function of its size.

pub mod nested_wavelet;
pub mod wavelet;
