//! Wire formats: how what ranks ask and answer is written as 32-bit words, and words as messages.
mod image;
mod integral;
mod message;
mod ray;
mod shading;

pub(super) use image::{read_images, words_per_pixel, write_image};
pub(super) use integral::{INTEGRAL_WORDS, decode_integral, encode_integral};
pub(super) use message::{decode_message, encode_message, message_bytes};
pub(super) use ray::{RAY_WORDS, read_ray, write_ray};
pub(super) use shading::{
    HIT_WORDS, LEAST_POINT_WORDS, decode_hit, decode_light_hit, encode_hit, encode_light_hit,
    read_point, write_point,
};
