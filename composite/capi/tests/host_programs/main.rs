//! Programs in C, Fortran and Python under Open MPI and MPICH: the examples, and programs that use
//! and misuse every call.
//!
//! MPI, compilers and mpi4py are peers (CONTRIBUTING.md): a missing one skips its tests with a
//! note, or fails them if RTSV_REQUIRE_PEERS is set.

mod examples;
mod expected;
mod launch;
mod misuse;
mod ranks;
mod simulations;
