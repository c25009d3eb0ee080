//! The slow reference: many small steps in f64, with the transfer function evaluated from its
//! definition and no skipping. Tests and accuracy curves compare the integrator with it.

use super::Volume;
use crate::ray::Ray;
use glam::{DVec3, UVec3};

/// Premultiplied linear colour and opacity between `t0` and `t1`, by the midpoint rule with steps
/// of `step_voxels` of the smallest grid spacing. The error decreases with the square of the step.
/// Shading is not included. Of volumes in memory alone: a part or a stored volume has other points
/// than its extent.
pub fn integrate_reference(
    volume: &Volume,
    ray: &Ray,
    t0: f32,
    t1: f32,
    step_voxels: f64,
) -> [f64; 4] {
    let grid = volume.grid();
    let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let extent = grid.spacing * (grid.dims - UVec3::ONE).as_dvec3();
    let (mut near, mut far) = (f64::from(t0.max(ray.t_min)), f64::from(t1.min(ray.t_max)));
    for a in 0..3 {
        if d[a] == 0.0 {
            if !(0.0..=extent[a]).contains(&o[a]) {
                return [0.0; 4];
            }
        } else {
            let (x, y) = (-o[a] / d[a], (extent[a] - o[a]) / d[a]);
            near = near.max(x.min(y));
            far = far.min(x.max(y));
        }
    }
    if near >= far {
        return [0.0; 4];
    }
    let length = (far - near) * d.length();
    let steps = (length / (step_voxels * grid.spacing.min_element())).ceil().max(1.0) as u64;
    let (mut rgba, mut transmittance) = ([0.0; 4], 1.0);
    for k in 0..steps {
        let t = near + (far - near) * ((k as f64 + 0.5) / steps as f64);
        let s = value(volume, (o + d * t) / grid.spacing);
        if !s.is_finite() {
            continue;
        }
        let color = volume.transfer_function().colors().lookup(s as f32);
        let alpha = -(-volume.transfer_function().extinction(s) * length / steps as f64).exp_m1();
        for c in 0..3 {
            rgba[c] += transmittance * alpha * f64::from(color[c]);
        }
        transmittance *= 1.0 - alpha;
    }
    rgba[3] = 1.0 - transmittance;
    rgba
}

/// Trilinear value at a continuous index, as the weighted sum over the corners; NaN in cells with a
/// value that is not finite.
fn value(volume: &Volume, p: DVec3) -> f64 {
    let grid = volume.grid();
    let last = (grid.dims - UVec3::ONE).as_dvec3();
    let p = p.clamp(DVec3::ZERO, last);
    let cell = p.floor().min(last - 1.0);
    let f = p - cell;
    let v = grid.corners(cell.as_uvec3());
    if !v.iter().all(|x| x.is_finite()) {
        return f64::NAN;
    }
    (0..8)
        .map(|i| {
            let weight: f64 =
                (0..3).map(|a| if i >> a & 1 == 1 { f[a] } else { 1.0 - f[a] }).product();
            weight * f64::from(v[i])
        })
        .sum()
}

/// [`VolumeOptions::sample_distance`](super::VolumeOptions::sample_distance) in f64, sample by
/// sample, with the light of one position in a cell.
#[cfg(test)]
pub(super) fn samples_reference(volume: &Volume, ray: &Ray, t1: f64) -> [f64; 4] {
    let grid = volume.grid();
    let distance = volume.options().sample_distance.expect("a volume with samples");
    let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let last = (grid.dims - UVec3::ONE).as_dvec3();
    let grid_box = [DVec3::ZERO, grid.spacing * last];
    let [near, far] = super::in_box(o, d, grid_box, 0.0, f64::INFINITY);
    let step = distance / d.length();
    let (index_ray, ..) = volume.index_ray(ray, near, far);
    let transfer = volume.transfer_function();
    let [low, high] = transfer.range();
    let entries = 1024.0;
    let entry = |i: f64| {
        let (sigma, color) = transfer.sample(low + (high - low) * i / (entries - 1.0));
        (-(-sigma * distance).exp_m1(), color)
    };
    let (mut rgba, mut through) = ([0.0; 4], 1.0);
    for k in 1.. {
        let t = near + f64::from(k) * step;
        if near >= far || (t > far && k > 1) || t - step >= t1 || through < 1.0 / 255.0 {
            break;
        }
        let p = ((o + d * t) / grid.spacing).clamp(DVec3::ZERO, last);
        let (cell, s) = if volume.is_nearest() {
            let point = (p + 0.5).floor().min(last).as_uvec3();
            (point, grid.at(point.x, point.y, point.z).into())
        } else {
            (p.floor().min(last - 1.0).as_uvec3(), value(volume, p))
        };
        if !s.is_finite() {
            continue;
        }
        let place = ((s - low) / (high - low) * entries - 0.5).clamp(0.0, entries - 1.0);
        let (i, f) = (place.floor(), place.fract());
        let ((a0, c0), (a1, c1)) = (entry(i), entry((i + 1.0).min(entries - 1.0)));
        let mut alpha = a0 + (a1 - a0) * f;
        let mut color = std::array::from_fn(|c| c0[c] + (c1[c] - c0[c]) * f);
        let at = (p - cell.as_dvec3()).to_array();
        if let Some(light) = volume.light_along(&index_ray, cell, [0.0, 1.0], &at, &at) {
            (alpha, color) = light.on(0.5, alpha, color);
        }
        for c in 0..3 {
            rgba[c] += through * alpha * color[c].min(1.0);
        }
        through *= 1.0 - alpha;
    }
    rgba[3] = 1.0 - through;
    rgba
}
