//! Volumes that share space. Media mix: where several overlap, their extinctions add up and each contributes its colour in proportion to
//! its extinction. Compositing one whole volume over the other would be wrong there.

use super::layer::{Layer, March};
use super::{Marched, Volume, VolumeQuality, VolumeSample};
use crate::ray::Ray;

/// Halvings of the common stretch at most.
const MAX_HALVINGS: u32 = 14;

/// Colour and opacity of several volumes between `t0` and `t1`. Each comes with the ray in its own object space; the parameter must mean the same point for all
/// (it does when the ray is transformed without normalising). The common stretch is halved until mixing a slab's volumes as a whole agrees
/// with mixing them in its halves. For a single volume, the same as [`Volume::integrate`].
pub fn integrate_overlapping(
    volumes: &[(&Volume, Ray)],
    t0: f32,
    t1: f32,
    quality: &VolumeQuality,
) -> VolumeSample {
    if let [(volume, ray)] = volumes {
        return volume.integrate(ray, t0, t1, quality);
    }
    if volumes.iter().any(|(v, _)| !v.is_medium()) {
        return one_behind_the_other(volumes, t0, t1, quality);
    }
    // Begin with the stretches between the places where volumes begin and end.
    let mut stops = Vec::new();
    for (volume, ray) in volumes {
        if let Some((a, b)) = slab(volume, ray) {
            stops.extend([a, b].map(|t| t.clamp(f64::from(t0), f64::from(t1))));
        }
    }
    stops.sort_by(f64::total_cmp);
    stops.dedup();
    let (Some(&first), Some(&last)) = (stops.first(), stops.last()) else { return VolumeSample::CLEAR };
    if first >= last {
        return VolumeSample::CLEAR;
    }
    let mut m = March::new(*quality, last - first);
    let mixer = Mixer { volumes, quality, path: last - first };
    for w in stops.windows(2) {
        let one = mixer.mix(w[0], w[1], &mut m.samples);
        mixer.descend(w[0], w[1], one, 0, &mut m);
    }
    let [r, g, b] = m.color.map(|c| c as f32);
    VolumeSample {
        rgba: [r, g, b, (1.0 - m.transmittance) as f32],
        depth: m.depth as f32,
        samples: m.samples,
    }
}

/// Projections have no place along the ray: they are put in the order of the middles of their boxes, and the media, mixed, in that of the first of them.
fn one_behind_the_other(
    volumes: &[(&Volume, Ray)],
    t0: f32,
    t1: f32,
    quality: &VolumeQuality,
) -> VolumeSample {
    let middle = |(v, r): &(&Volume, Ray)| slab(v, r).map_or(f64::INFINITY, |(a, b)| 0.5 * (a + b));
    let (media, others): (Vec<_>, Vec<_>) = volumes.iter().partition(|(v, _)| v.is_medium());
    let first = media.iter().map(middle).fold(f64::INFINITY, f64::min);
    let mut layers: Vec<(f64, VolumeSample)> =
        others.iter().map(|v| (middle(v), v.0.integrate(&v.1, t0, t1, quality))).collect();
    if !media.is_empty() {
        layers.push((first, integrate_overlapping(&media, t0, t1, quality)));
    }
    layers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut all = VolumeSample::CLEAR;
    for (_, layer) in layers {
        let through = 1.0 - all.rgba[3];
        all.rgba = std::array::from_fn(|c| all.rgba[c] + through * layer.rgba[c]);
        all.depth = all.depth.min(layer.depth);
        all.samples += layer.samples;
    }
    all
}

struct Mixer<'a> {
    volumes: &'a [(&'a Volume, Ray)],
    quality: &'a VolumeQuality,
    /// Common stretch of all volumes, in ray parameter.
    path: f64,
}

impl Mixer<'_> {
    fn descend(&self, ta: f64, tb: f64, one: (Layer, usize), depth: u32, m: &mut March) {
        if m.is_opaque() {
            return;
        }
        let mid = 0.5 * (ta + tb);
        let near = self.mix(ta, mid, &mut m.samples);
        let far = self.mix(mid, tb, &mut m.samples);
        let difference = m.transmittance * one.0.difference(&near.0.then(&far.0));
        // Where only one volume has anything, its own integration is all there is to do; halving then serves the depth only.
        let alone = one.1 <= 1 && (one.0.tau < 0.05 || depth >= 4);
        // The first four halvings are taken in any case: a slab and its halves can agree by accident.
        let agrees = difference <= m.error_per_length * (tb - ta) && depth >= 4;
        if alone || agrees || depth >= MAX_HALVINGS {
            m.add(ta, mid, &near.0);
            m.add(mid, tb, &far.0);
        } else {
            self.descend(ta, mid, near, depth + 1, m);
            self.descend(mid, tb, far, depth + 1, m);
        }
    }

    /// The slab `ta..tb` as one layer of all volumes' media, and how many have any.
    fn mix(&self, ta: f64, tb: f64, samples: &mut u32) -> (Layer, usize) {
        // Each slab may use its share of the tolerance.
        let quality = match *self.quality {
            VolumeQuality::Tolerance { levels } => {
                VolumeQuality::Tolerance { levels: levels * ((tb - ta) / self.path) as f32 }
            }
            step => step,
        };
        let (mut layer, mut present) = (Layer::NOTHING, 0);
        for (volume, ray) in self.volumes {
            let (a, b) = (ta.max(f64::from(ray.t_min)), tb.min(f64::from(ray.t_max)));
            if a >= b || !ray.is_valid() {
                continue;
            }
            let m = volume.march(ray, a, b, &quality, &Marched::default());
            *samples += m.samples;
            let opacity = 1.0 - m.transmittance;
            if opacity > 0.0 {
                present += 1;
                // Not quite zero transmittance, to keep the thickness finite.
                let tau = -m.transmittance.max(1e-300).ln();
                layer.tau += tau;
                for c in 0..3 {
                    layer.color[c] += tau * m.color[c] / opacity;
                }
            }
        }
        if layer.tau > 0.0 {
            layer.color = layer.color.map(|c| c / layer.tau);
        }
        (layer, present)
    }
}

/// Where the ray is inside the volume's bounds.
fn slab(volume: &Volume, ray: &Ray) -> Option<(f64, f64)> {
    let b = volume.bounds();
    let (mut near, mut far) = (f64::from(ray.t_min), f64::from(ray.t_max));
    for a in 0..3 {
        let (o, d) = (f64::from(ray.origin[a]), f64::from(ray.dir[a]));
        let (lo, hi) = (f64::from(b.min[a]) - o, f64::from(b.max[a]) - o);
        if d == 0.0 {
            if lo > 0.0 || hi < 0.0 {
                return None;
            }
        } else {
            near = near.max((lo / d).min(hi / d));
            far = far.min((lo / d).max(hi / d));
        }
    }
    (near < far).then_some((near, far))
}
