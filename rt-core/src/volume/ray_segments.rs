//! Volumes that share space. Media mix: where several overlap, their extinctions add up and each
//! contributes its colour in proportion to its extinction. Compositing one whole volume over the
//! other would be wrong there.
//!
//! Mixing is local: a ray is split where it enters another block of any of its volumes
//! ([`RaySegments`]), and the contribution of such a span depends only on the blocks around it and
//! on what was collected in front. (The first version halved the whole common interval until halves
//! agreed: it marched everything again on every level, and needed every value along a ray in one
//! process.)

use super::layer::{Layer, MarchState};
use super::linear_segment::RayInLanes;
use super::{MACROCELL, PartialIntegral, Volume, VolumeQuality, VolumeSample};
use crate::grid_walk::IndexRay;
use crate::ray::Ray;
use glam::UVec3;
use std::ops::Range;

/// Largest number of halvings of a span.
const MAX_HALVINGS: u32 = 14;
/// Halvings of a span before agreement between mixing its volumes as a whole and in its halves is
/// accepted: it can occur by accident.
const BLIND_HALVINGS: u32 = 2;

/// Colour and opacity of several volumes between `t0` and `t1`. Each comes with the ray in its own
/// object space; the parameter must mean the same point for all (it does when the ray is
/// transformed without normalising). Spans where blocks of several volumes have extinction are
/// halved until mixing a slab's volumes as a whole agrees with mixing them in its halves. For a
/// single volume, the same as [`Volume::integrate`].
pub fn integrate_overlapping(
    volumes: &[(&Volume, Ray)],
    t0: f32,
    t1: f32,
    quality: &VolumeQuality,
) -> VolumeSample {
    if let [(volume, ray)] = volumes {
        return volume.integrate(ray, t0, t1, quality);
    }
    if volumes.iter().all(|(v, _)| v.is_medium()) {
        let segments = RaySegments::new(volumes.to_vec(), t0, t1);
        return segments
            .integrate_spans(0..usize::MAX, quality, PartialIntegral::default())
            .sample();
    }
    let media: Vec<_> = volumes.iter().filter(|(v, _)| v.is_medium()).copied().collect();
    let mixed = integrate_overlapping(&media, t0, t1, quality);
    composite_projections(volumes, t0, t1, quality, mixed)
}

/// The result of several volumes whose media are `mixed` already. Projections have no position
/// along the ray: they are sorted by the centres of their boxes, and the media take the position of
/// the first of them.
pub fn composite_projections(
    volumes: &[(&Volume, Ray)],
    t0: f32,
    t1: f32,
    quality: &VolumeQuality,
    mixed: VolumeSample,
) -> VolumeSample {
    let middle = |(v, r): &(&Volume, Ray)| slab(v, r).map_or(f64::INFINITY, |(a, b)| 0.5 * (a + b));
    let (media, others): (Vec<_>, Vec<_>) = volumes.iter().partition(|(v, _)| v.is_medium());
    let first = media.iter().map(middle).fold(f64::INFINITY, f64::min);
    let mut layers: Vec<(f64, VolumeSample)> =
        others.iter().map(|v| (middle(v), v.0.integrate(&v.1, t0, t1, quality))).collect();
    if !media.is_empty() {
        layers.push((first, mixed));
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

/// An interval of a ray in one block of a volume.
#[derive(Debug, Clone, Copy)]
struct BlockSegment {
    block: UVec3,
    t0: f64,
    t1: f64,
}

/// One volume along a ray.
struct VolumeSegments<'a> {
    volume: &'a Volume,
    ray: IndexRay,
    /// World length of one unit of the parameter.
    per_t: f64,
    /// Parameter at which the ray enters the grid.
    anchor: f64,
    blocks: Vec<BlockSegment>,
}

/// The segments of a ray through several media, split into spans along which every medium stays
/// within one block. Spans depend on the ray and on the volumes' sizes and positions alone, not on
/// the values held here: the holders of parts ([`Volume::part`]) agree on them.
///
/// ```
/// use rt_core::glam::{DVec3, UVec3, Vec3};
/// use rt_core::{colormap::ColorMap, grid::Grid, ray::Ray, transfer_function::TransferFunction};
/// use rt_core::volume::{Brick, PartialIntegral, RaySegments};
/// use rt_core::volume::{Volume, VolumeOptions, VolumeQuality};
/// let values = (0..33 * 9 * 9).map(|k| (k % 7) as f32 / 7.0).collect();
/// let grid = Grid::new(UVec3::new(33, 9, 9), DVec3::ZERO, DVec3::ONE, values).unwrap();
/// let white = ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]);
/// let transfer = TransferFunction::from_opacity(white, &[[0.0, 0.0], [1.0, 0.3]], 1.0).unwrap();
/// let whole = Volume::new(grid.into(), transfer, VolumeOptions::default()).unwrap();
/// let brick = |x: u32| {
///     whole.part(Brick { first: UVec3::new(x, 0, 0), end: UVec3::new(x + 2, 1, 1) })
/// };
/// let (near, far) = (brick(0), brick(2));
///
/// let ray = Ray::new(Vec3::new(-1.0, 2.3, 4.1), Vec3::new(1.0, 0.1, 0.05));
/// let quality = VolumeQuality::default();
/// let through = |part| RaySegments::new(vec![(part, ray)], 0.0, f32::INFINITY);
/// let mut near_spans = 0;
/// through(&whole).spans(|_, here| near_spans += usize::from(here[0].1.x < 2));
/// let begun = PartialIntegral::default();
/// let collected = through(&near).integrate_spans(0..near_spans, &quality, begun);
/// let collected = through(&far).integrate_spans(near_spans..usize::MAX, &quality, collected);
/// assert_eq!(collected.sample(), whole.integrate(&ray, 0.0, f32::INFINITY, &quality));
/// assert!(near.grid().values().len() < whole.grid().values().len());
/// ```
pub struct RaySegments<'a> {
    per_volume: Vec<VolumeSegments<'a>>,
    /// From where the ray enters the first volume to where it leaves the last, in its parameter.
    path: f64,
}

impl<'a> RaySegments<'a> {
    /// The segments between `t0` and `t1` through `volumes`, each with the ray in its object space,
    /// as for [`integrate_overlapping`]. Volumes that are not media are skipped.
    pub fn new(volumes: Vec<(&'a Volume, Ray)>, t0: f32, t1: f32) -> RaySegments<'a> {
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut per_volume = Vec::with_capacity(volumes.len());
        for (volume, ray) in volumes {
            let per_t = ray.dir.as_dvec3().length();
            let (t0, t1) = (f64::from(t0.max(ray.t_min)), f64::from(t1.min(ray.t_max)));
            let (index_ray, cells, t0, t1) = volume.index_ray(&ray, t0, t1);
            let mut blocks = Vec::new();
            if volume.is_medium() && ray.is_valid() && t0 < t1 {
                let cells = cells.to_array().map(i64::from);
                let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
                for [t0, t1] in volume.options.cropped(o, d, [t0, t1]).as_slice() {
                    index_ray.walk([0; 3], cells, cells, i64::from(MACROCELL), *t0, *t1, |c| {
                        let block = UVec3::from_array(c.cell.map(|c| c as u32 / MACROCELL));
                        blocks.push(BlockSegment { block, t0: c.t0, t1: c.t1 });
                        true
                    });
                }
            }
            let anchor = blocks.first().map_or(f64::INFINITY, |b| b.t0);
            first = first.min(anchor);
            last = last.max(blocks.last().map_or(f64::NEG_INFINITY, |b| b.t1));
            per_volume.push(VolumeSegments { volume, ray: index_ray, per_t, anchor, blocks });
        }
        RaySegments { per_volume, path: last - first }
    }

    /// Calls `visit` with the number of each span of positive length, its limits and the block of
    /// each volume in it, until `visit` returns false.
    fn walk(&self, mut visit: impl FnMut(usize, f64, f64, &[(usize, UVec3)]) -> bool) {
        let mut next = vec![0; self.per_volume.len()];
        let mut here = Vec::with_capacity(self.per_volume.len());
        let (mut at, mut number) = (f64::NEG_INFINITY, 0);
        loop {
            // ---- To the next point where a block begins or ends.
            let mut end = f64::INFINITY;
            here.clear();
            for (v, (segments, next)) in self.per_volume.iter().zip(&mut next).enumerate() {
                while segments.blocks.get(*next).is_some_and(|b| b.t1 <= at) {
                    *next += 1;
                }
                let Some(b) = segments.blocks.get(*next) else { continue };
                if b.t0 <= at {
                    here.push((v, b.block));
                    end = end.min(b.t1);
                } else {
                    end = end.min(b.t0);
                }
            }
            if end == f64::INFINITY {
                // Nothing follows, or an interval without an end, which no grid has.
                return;
            }
            if !here.is_empty() {
                if !visit(number, at, end, &here) {
                    return;
                }
                number += 1;
            }
            at = end;
        }
    }

    /// Calls `visit` with the number of each span, in order, and the volumes in it with their
    /// blocks, one or more.
    pub fn spans(&self, mut visit: impl FnMut(usize, &[(usize, UVec3)])) {
        self.walk(|number, _, _, here| {
            visit(number, here);
            true
        });
    }

    /// Whether `held` is true for every block of every volume in these spans.
    pub fn is_within(&self, spans: Range<usize>, held: impl Fn(usize, UVec3) -> bool) -> bool {
        let mut all = true;
        self.walk(|number, _, _, here| {
            if spans.contains(&number) {
                all = here.iter().all(|(v, block)| held(*v, *block));
            }
            all && number < spans.end
        });
        all
    }

    /// Continues from `collected` through the spans with the numbers `spans`. Spans must be
    /// integrated in order, by any process.
    pub fn integrate_spans(
        &self,
        spans: Range<usize>,
        quality: &VolumeQuality,
        collected: PartialIntegral,
    ) -> PartialIntegral {
        let mut m = collected.march(*quality, self.path);
        if collected.is_opaque(quality) || self.path.is_nan() || self.path <= 0.0 {
            return collected;
        }
        // The error budget of all volumes is distributed by length along the ray.
        let per_t = m.error_per_length;
        let rays: Vec<_> =
            self.per_volume.iter().map(|s| s.volume.ray_in_lanes(&s.ray, s.per_t)).collect();
        let mut there: Vec<(usize, UVec3)> = Vec::with_capacity(self.per_volume.len());
        self.walk(|number, ta, tb, here| {
            if number < spans.start || number >= spans.end {
                return number < spans.end;
            }
            there.clear();
            there.extend(
                here.iter().filter(|(v, block)| self.per_volume[*v].volume.is_occupied(*block)),
            );
            match there[..] {
                [] => {}
                [(v, block)] => {
                    let segments = &self.per_volume[v];
                    m.error_per_length =
                        MarchState::new(*quality, self.path * segments.per_t).error_per_length;
                    segments.volume.march_block(&rays[v], segments.anchor, block, [ta, tb], &mut m);
                }
                _ => {
                    m.error_per_length = per_t;
                    let media_mixer =
                        MediaMixer { segments: self, rays: &rays, there: &there, quality };
                    let one = media_mixer.mix(ta, tb, &mut m.samples);
                    media_mixer.descend(ta, tb, one, 0, &mut m);
                }
            }
            !m.is_opaque()
        });
        m.into()
    }
}

/// A span with several media.
struct MediaMixer<'a> {
    segments: &'a RaySegments<'a>,
    /// The ray through each volume.
    rays: &'a [RayInLanes<'a>],
    there: &'a [(usize, UVec3)],
    quality: &'a VolumeQuality,
}

impl MediaMixer<'_> {
    fn descend(&self, ta: f64, tb: f64, one: Layer, depth: u32, m: &mut MarchState) {
        if m.is_opaque() {
            return;
        }
        let share = m.error_per_length * (tb - ta);
        // Colours that differ by at most 1 within a layer of opacity a, mixed instead of ordered,
        // have an error of at most a²/4.
        let opacity = one.opacity();
        if m.transmittance * 0.25 * opacity * opacity <= share {
            m.add(ta, tb, &one);
            return;
        }
        let mid = 0.5 * (ta + tb);
        let near = self.mix(ta, mid, &mut m.samples);
        let far = self.mix(mid, tb, &mut m.samples);
        let difference = m.transmittance * one.difference(&near.then(&far));
        if (difference <= share && depth >= BLIND_HALVINGS) || depth >= MAX_HALVINGS {
            m.add(ta, mid, &near);
            m.add(mid, tb, &far);
        } else {
            self.descend(ta, mid, near, depth + 1, m);
            self.descend(mid, tb, far, depth + 1, m);
        }
    }

    /// The slab `ta..tb` as one layer of all volumes' media.
    fn mix(&self, ta: f64, tb: f64, samples: &mut u32) -> Layer {
        // Each slab may use its share of the tolerance.
        let quality = match *self.quality {
            VolumeQuality::Tolerance { levels } => VolumeQuality::Tolerance {
                levels: levels * ((tb - ta) / self.segments.path) as f32,
            },
            step => step,
        };
        let mut layer = Layer::NOTHING;
        for &(v, block) in self.there {
            let segments = &self.segments.per_volume[v];
            let mut m = MarchState::new(quality, (tb - ta) * segments.per_t);
            segments.volume.march_block(&self.rays[v], segments.anchor, block, [ta, tb], &mut m);
            *samples += m.samples;
            let opacity = 1.0 - m.transmittance;
            if opacity > 0.0 {
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
        layer
    }
}

/// The interval in which the ray is inside the volume's bounds.
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
