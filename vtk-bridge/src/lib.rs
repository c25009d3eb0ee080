//! Ray tracing inside unmodified VTK and ParaView.
#![deny(unsafe_code)]

pub mod anari;
