//! Rays among triangles with positions in f64: terrain in metres of a map projection, assemblies in
//! micrometres.
//!
//! A [`WorldF64`] answers as if it computed with real numbers: which triangle is nearest, whether a
//! ray passes an edge on one side or the other, and whether a hit lies in the ray's range are
//! decided exactly, and `t` is rounded at the end. So the answers are the same for every preset,
//! instruction set and way of tracing, and rays do not pass between triangles that share an edge.
//!
//! ```text
//! f64 ray ─ local_ray moves it to the world's box ─► f32 ray ─ tree of f32 boxes ─► leaves
//!    leaf: filter in f32, eight triangles at a time ─┬─ surely missed
//!                                                    ├─ surely hit, depth known within a bound
//!                                                    └─ undecided ─► crossing in f64 with a bound
//!                                                                         └─ undecided ─► exact
//!    nearest triangle ─► distance (residual in f64, checked bound; else exact) ─► t, u, v
//! ```
//!
//! Why a filter: in f64 alone, half as many triangles fit a vector, and boxes and triangles take
//! twice the memory. With the filter nearly all of the work is that of an f32 world, and the mesh
//! itself is read about once a ray.
//!
//! All bounds are those of standard floating-point analysis (Higham, "Accuracy and Stability of
//! Numerical Algorithms", 2002); the steps from a filter to exact arithmetic follow Shewchuk,
//! "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997.

mod build;
mod crossing;
mod distance;
mod error_free;
mod exact;
mod filter;
mod frame;
mod input;
mod leaf;
mod local_ray;
mod nearest;
mod shared_start;
mod streams;
mod world;

pub use input::{HitF64, MeshF64, RayF64};
pub use world::WorldF64;
