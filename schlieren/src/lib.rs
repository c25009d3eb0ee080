//! Physically based schlieren, shadowgraph and interferometry from flow data.
//!
//! Lengths are metres, angles radians, all in `f64` where the user meets them. What is stored of the gas is not its index of refraction n but the
//! small number eps = n/n0 - 1 ([`field::Field`]), and what is computed of a ray is not where it goes but how far it strays from
//! the straight ray through the reference medium ([`path::Exit`]). Both keep their relative accuracy in `f32` however weak
//! the gas is.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | n0 | index of the reference medium, outside the field | - |
//! | eps | n/n0 - 1 | - |
//! | tau | path parameter: dx/dtau = w, dw/dtau = (1+eps) grad eps, so that the length of w is 1+eps | m |
//! | u | w minus the undisturbed ray's direction; behind the field its transverse part is the deflection | rad |
//! | xi | transverse displacement from the undisturbed ray | m |
//! | OPD | optical path minus that of the undisturbed ray, between the same planes | m |
#![forbid(unsafe_code)]

pub mod analytic;
pub mod cli;
pub mod cutoff;
pub mod field;
pub mod film;
pub mod filter;
pub mod index;
pub mod input;
pub mod interpolate;
mod level;
pub mod march;
pub mod optics;
pub mod output;
pub mod path;
pub mod plan;
pub mod render;
pub mod scene;
pub mod skip;
pub mod solids;
pub mod spectrum;
pub mod technique;
#[cfg(test)]
mod testing;
pub mod view;
