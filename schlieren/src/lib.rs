//! Renders physically based schlieren images, shadowgraphs and interferograms of flow data.
//!
//! ```
//! use glam::DVec3;
//! use schlieren::field::Field;
//! use schlieren::path::{Exit, LightPaths, Start};
//! use schlieren::plan::{Plan, Request};
//! use schlieren::view::{Axis, View};
//!
//! // A cube of air, 10 cm and 48 nodes a side. In its centre eps is -1e-5, as in a warm spot.
//! let (n, size_m) = (48, 0.1);
//! let h = size_m / (n - 1) as f64;
//! let warm = |p: DVec3| -1e-5 * (-p.length_squared() / (2.0 * 0.015f64.powi(2))).exp();
//! let field = Field::from_fn([n; 3], [h; 3], DVec3::splat(-0.05), 1.000_27, warm)?;
//!
//! // A plan whose deflections are accurate to 1e-7 rad, seen along z. It traces one ray, which
//! // enters 1.5 cm to the right of the centre.
//! let plan = Plan::new(&field, Request { tolerance_rad: 1e-7, ..Request::default() });
//! let paths = plan.paths(&field, View::along(Axis::Z, field.centre_m()));
//! let mut exit = [Exit::UNDISTURBED];
//! paths.trace(&[Start { position_m: [0.015, 0.0], tilt_rad: [0.0; 2] }], &mut exit);
//!
//! // Light bends towards the denser gas outside, by eps sqrt(2 pi) exp(-1/2).
//! let expected_rad = 1e-5 * 2.5066 * (-0.5f64).exp();
//! assert!((f64::from(exit[0].deflection_rad[0]) / expected_rad - 1.0).abs() < 5e-3);
//! # Ok::<(), schlieren::field::FieldError>(())
//! ```
//!
//! The public interface uses metres, radians and `f64`. A [`field::Field`] stores the gas as the
//! small number eps = n/n0 - 1 instead of its index of refraction n. A traced ray returns its
//! deviation from the straight ray through the reference medium instead of its position
//! ([`path::Exit`]). Both keep their relative accuracy in `f32` however weak the gas is.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | n0 | index of refraction of the reference medium outside the field | - |
//! | eps | n/n0 - 1 | - |
//! | tau | path parameter: dx/dtau = w, dw/dtau = (1+eps) grad eps, so that the length of w is 1+eps | m |
//! | u | w minus the direction of the undisturbed ray; behind the field, its transverse part is the deflection | rad |
//! | xi | transverse displacement from the undisturbed ray | m |
//! | OPD | optical path minus that of the undisturbed ray, between the same planes | m |
#![forbid(unsafe_code)]

pub mod analytic;
pub mod cli;
pub mod cutoff;
mod derivative_bounds;
pub mod drawing;
pub mod field;
pub mod film;
pub mod filter;
pub mod gas_on_cells;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod index;
pub mod input;
pub mod interpolate;
mod level;
pub mod march;
pub mod measure;
pub mod media;
pub mod optics;
pub mod output;
pub mod path;
pub mod plan;
pub mod probe;
pub mod render;
pub mod scene;
#[cfg(feature = "serve")]
pub mod serve;
pub mod sheet;
pub mod skip;
pub mod solids;
pub mod spectrum;
pub mod technique;
#[cfg(test)]
mod testing;
pub mod view;
