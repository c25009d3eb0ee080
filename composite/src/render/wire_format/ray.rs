//! Encoding of rays in messages.
use rt_core::glam::Vec3;
use rt_core::ray::Ray;

pub(in crate::render) fn write_ray(ray: &Ray, pixel: Option<u32>, out: &mut Vec<u32>) {
    out.extend(ray.origin.to_array().map(f32::to_bits));
    out.extend(ray.dir.to_array().map(f32::to_bits));
    out.extend([ray.t_min.to_bits(), ray.t_max.to_bits()]);
    out.extend(pixel);
}

pub(in crate::render) fn read_ray(words: &[u32]) -> Ray {
    let f = |i: usize| f32::from_bits(words[i]);
    Ray {
        origin: Vec3::new(f(0), f(1), f(2)),
        dir: Vec3::new(f(3), f(4), f(5)),
        t_min: f(6),
        t_max: f(7),
    }
}

/// Words of a ray in a message.
pub(in crate::render) const RAY_WORDS: usize = 8;
