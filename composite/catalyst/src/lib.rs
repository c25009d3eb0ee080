//! An implementation of [Catalyst 2][catalyst]: simulations that already call Catalyst make ray
//! traced pictures and schlieren photographs, without a change and without being compiled again.
//!
//! A simulation calls four functions of `libcatalyst`, which loads the library that
//! `CATALYST_IMPLEMENTATION_NAME` names. This crate is the library `libcatalyst-rtsv.so`. What it
//! makes of each time step is said by a file of [`settings`]. Ranks make pictures together, over
//! the communicator of the simulation; the bits are those of one process.
//!
//! | module | what |
//! |---|---|
//! | [`api`] | Catalyst's functions, and those of Conduit with which its nodes are read |
//! | [`node`] | what the simulation gives, as a tree; arrays stay where they are |
//! | [`blueprint`] | meshes in such trees |
//! | [`settings`] | what to make, and when |
//! | [`pictures`] | pictures of a time step, made by all ranks together |
//! | [`session`] | from `catalyst_initialize` to `catalyst_finalize` |
//!
//! [catalyst]: https://catalyst-in-situ.readthedocs.io
#![deny(unsafe_code)]
// MPI's binary interface is known there.
#![cfg(all(unix, target_pointer_width = "64", target_endian = "little"))]

pub mod api;
pub mod blueprint;
pub mod node;
pub mod pictures;
pub mod session;
pub mod settings;
