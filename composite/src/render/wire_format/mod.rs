//! Wire formats: how rays and messages are written as 32-bit words.
mod message;
mod ray;

pub(super) use message::{decode_message, encode_message, message_bytes};
pub(super) use ray::{RAY_WORDS, read_ray, write_ray};
