//! A medium as samples at a fixed distance, as VTK's GPU mapper takes them.
//!
//! A ray that enters the grid at t₀ has samples at t₀ + k d, k = 1, 2, …: sample k stands for the
//! slab in front of it, from k − 1 to k, with the opacity of that thickness. A slab belongs to a
//! part of the ray if it begins in it, so the parts in front of a surface and behind it share no
//! slab and leave none out. A clip plane ends a ray as a surface does. The first slab counts also
//! where it ends outside.

use super::empty_space::distances;
use super::region::in_box;
use super::sample_light::{GradientFactors, PacketLights};
use super::sample_medium::{Gradients, Medium};
use super::sample_packet::{Packet, march};
use super::sample_table::SampleTable;
use super::{Blend, Volume, VolumeSample};
use crate::ray::{LANES, Ray};
use crate::simd::gather::GatherSlice;
use glam::DVec3;

/// What is known of a volume before any ray.
#[derive(Debug, Clone)]
pub(super) struct Samples {
    /// World distance.
    distance: f64,
    table: SampleTable,
    /// Distances of blocks to the nearest one that is not empty.
    empty: Option<Vec<f32>>,
    lights: Option<PacketLights>,
    /// What gradients are multiplied with before they are used: entries of the table per scalar
    /// and world unit. So neither the range of the scalars nor the spacing can lead out of f32.
    unit: f64,
    /// Factors of the gradient opacity, two or more.
    factors: Vec<f32>,
}

/// Runs of samples that cropping may leave of a ray.
const MOST_RUNS: usize = 4;

/// The samples of one ray.
#[derive(Clone, Copy)]
struct SampledRay {
    /// Parameter of the entry, and of one step.
    entry: f64,
    step: f64,
    /// Numbers of the first and the last sample of each run; those without samples come last.
    runs: [[f32; 2]; MOST_RUNS],
}

impl SampledRay {
    const NONE: SampledRay = SampledRay { entry: 0.0, step: 0.0, runs: [[1.0, 0.0]; MOST_RUNS] };
}

impl Samples {
    /// `None` where the volume is integrated.
    pub(super) fn new(volume: &Volume) -> Option<Samples> {
        let distance = volume.options.sample_distance?;
        GatherSlice::new(volume.grid.values())?;
        if volume.options.blend != Blend::Composite {
            return None;
        }
        let table = SampleTable::new(&volume.transfer, distance);
        let occupied: Vec<bool> = volume
            .ranges
            .iter()
            .map(|range| range[0] <= range[1] && !table.is_clear(*range))
            .collect();
        let mut factors =
            volume.options.gradient_opacity.as_ref().map_or(Vec::new(), |o| o.factors.to_vec());
        if let [one] = factors[..] {
            factors.push(one);
        }
        let unit = f64::from(table.entries_per_scalar) * volume.grid.spacing.min_element();
        Some(Samples {
            distance,
            empty: distances(volume.blocks, &occupied),
            lights: PacketLights::new(&volume.options, unit),
            table,
            unit,
            factors,
        })
    }
}

impl Volume {
    /// Whether rays take samples instead of being integrated.
    pub(crate) fn takes_samples(&self) -> bool {
        self.samples.is_some()
    }

    /// The results of up to sixteen rays, each between two parameters. Clear where the volume
    /// takes no samples.
    pub(crate) fn sample_rays(&self, rays: &[(Ray, [f32; 2])], out: &mut Vec<VolumeSample>) {
        for rays in rays.chunks(LANES) {
            self.sample_packet(rays, out);
        }
    }

    /// [`Volume::integrate`] with samples.
    pub(super) fn sample_ray(&self, ray: &Ray, t0: f32, t1: f32) -> VolumeSample {
        let mut out = Vec::with_capacity(1);
        self.sample_packet(&[(*ray, [t0, t1])], &mut out);
        out.pop().unwrap_or(VolumeSample::CLEAR)
    }

    fn sample_packet(&self, rays: &[(Ray, [f32; 2])], out: &mut Vec<VolumeSample>) {
        let clear = out.len();
        out.resize(clear + rays.len(), VolumeSample::CLEAR);
        let out = &mut out[clear..];
        let Some(samples) = &self.samples else { return };
        let Some(medium) = self.medium(samples) else { return };
        let mut packet = Packet::EMPTY;
        let mut lanes = [SampledRay::NONE; LANES];
        for (lane, (ray, span)) in rays.iter().enumerate() {
            if let Some(found) = self.set_lane(samples, &mut packet, lane, ray, *span) {
                lanes[lane] = found;
            }
        }
        // One run of samples for each ray, but where cropping leaves several.
        for run in 0..MOST_RUNS {
            let mut any = false;
            for (lane, ray) in lanes.iter().enumerate() {
                let [first, last] = ray.runs[run];
                (packet.first[lane], packet.last[lane]) = (first, last);
                any |= first <= last;
            }
            if !any {
                return;
            }
            let found = march(self.level, &medium, &packet);
            for ((lane, out), ray) in out.iter_mut().enumerate().zip(&lanes) {
                for (sum, row) in out.rgba.iter_mut().zip(&found.color) {
                    *sum += row[lane];
                }
                out.rgba[3] = 1.0 - found.transmittance[lane];
                out.samples += found.samples[lane] as u32;
                let half = f64::from(found.half[lane]);
                if half > 0.0 {
                    out.depth = (ray.entry + half * ray.step) as f32;
                }
            }
            packet.through = found.transmittance;
        }
    }

    /// The volume as a packet sees it; `None` for more points than an index of 32 bits counts.
    fn medium<'a>(&'a self, samples: &'a Samples) -> Option<Medium<'a>> {
        let mut medium = Medium::new(&self.grid, &samples.table, self.is_nearest())?;
        if let Some(distances) = &samples.empty {
            // A single block cannot be gathered, and is not worth it.
            medium.empty = GatherSlice::new(distances).map(|d| (d, self.blocks));
        }
        let opacity = self.options.gradient_opacity.as_ref();
        if samples.lights.is_some() || opacity.is_some() {
            let scale = samples.unit * 0.5 / self.grid.spacing;
            medium.gradients = Some(Gradients {
                scale: scale.as_vec3(),
                clamped: self.options.clamped_gradients,
                lights: samples.lights.as_ref(),
                factors: opacity.and_then(|o| {
                    GradientFactors::new(&samples.factors, f64::from(o.steepest) * samples.unit)
                }),
            });
        }
        Some(medium)
    }

    /// Writes a ray into a lane of the packet, without its samples; `None` for a ray that has none.
    fn set_lane(
        &self,
        samples: &Samples,
        packet: &mut Packet,
        lane: usize,
        ray: &Ray,
        span: [f32; 2],
    ) -> Option<SampledRay> {
        let (t0, t1) = (f64::from(span[0].max(ray.t_min)), f64::from(span[1].min(ray.t_max)));
        if !(ray.is_valid() && t0 < t1) {
            return None;
        }
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let spacing = self.grid.spacing;
        let [near, far] = in_box(o, d, [DVec3::ZERO, self.size()], 0.0, f64::INFINITY);
        let [near, far] = self.options.in_bounds(o, d, near, far);
        let [near, behind] = self.options.in_front(o, d, near, far);
        let per_t = d.length();
        let step = samples.distance / per_t;
        if !(near < behind && step > 0.0) {
            return None;
        }
        // Slabs that begin before a parameter.
        let before = |t: f64| ((t - near) / step).ceil();
        let first = before(t0).max(0.0) + 1.0;
        let last = ((far - near) / step).floor().max(1.0).min(before(t1)).min(before(behind));
        if !(first <= last && near < t1) {
            return None;
        }
        let at = |v: DVec3| (v / spacing).as_vec3();
        packet.origin.set(lane, at(o + d * near));
        packet.step.set(lane, at(d * step));
        packet.view.set(lane, self.view_along(o, d).normalize_or_zero().as_vec3());
        let mut found = SampledRay { entry: near, step, ..SampledRay::NONE };
        if self.options.cropping.is_none() {
            found.runs[0] = [first as f32, last as f32];
            return Some(found);
        }
        let cropped = self.options.cropped(o, d, [near, far.min(behind + step)]);
        for (run, [from, to]) in found.runs.iter_mut().zip(cropped.as_slice()) {
            let last = if *to < far { ((to - near) / step).floor().min(last) } else { last };
            *run = [before(*from).max(first) as f32, last as f32];
        }
        // A packet ends with the first run that no ray has.
        found.runs.sort_by_key(|[first, last]| first > last);
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::reference::samples_reference;
    use super::super::{
        ClipPlane, Cropping, GradientOpacity, Interpolation, Volume, VolumeHighlight, VolumeLight,
        VolumeOptions, VolumeQuality, VolumeShading, integrate_reference,
    };
    use super::*;
    use crate::colormap::ColorMap;
    use crate::grid::Grid;
    use crate::simd::SimdLevel;
    use crate::test_shapes::Random;
    use crate::transfer_function::TransferFunction;
    use glam::{UVec3, Vec3};
    use std::sync::Arc;

    /// A level of 255, of which a tenth is what f32 and rounding may cost.
    const LEVEL: f64 = 1.0 / 255.0;

    /// Waves between -1.3 and 1.3, times `scale`, where something is, and nothing elsewhere. Small
    /// grids are not empty.
    fn grid(dims: UVec3, spacing: DVec3, scale: f32) -> Grid {
        let count = dims.as_usizevec3().element_product();
        let values = (0..count as u32).map(|i| {
            let p = UVec3::new(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y).as_vec3();
            let wave = (0.6 * p.x).sin() * (0.5 * p.y).cos() + 0.3 * (0.8 * p.z).sin();
            scale * if dims.x < 11 || (p.x - 20.0).abs() < 9.0 { wave } else { -1.3 }
        });
        Grid::new(dims, DVec3::new(5.0, -3.0, 2.0), spacing, values.collect()).expect("a grid")
    }

    fn transfer(scale: f32, unit: f32) -> TransferFunction {
        let colors = ColorMap::new(
            vec![[0.1, 0.2, 1.0, 1.0], [0.9, 1.0, 0.1, 1.0], [1.0, 0.1, 0.1, 1.0]],
            [-1.3 * scale, 1.3 * scale],
        );
        let opacity =
            [[-1.3, 0.0], [-0.1, 0.0], [0.3, 0.3], [1.3, 0.6]].map(|[s, a]| [s * scale, a]);
        TransferFunction::from_opacity(colors, &opacity, unit).expect("sound")
    }

    fn rays(count: usize, size: Vec3, seed: u64) -> Vec<(Ray, [f32; 2])> {
        let mut rng = Random::new(seed);
        let mut all: Vec<_> = (0..count)
            .map(|_| {
                let target = size * Vec3::new(rng.unit(), rng.unit(), rng.unit());
                let from = target + 3.0 * size.length() * rng.direction();
                (Ray::new(from, 0.3 * (target - from)), [0.0, f32::INFINITY])
            })
            .collect();
        // From inside, along an axis in a face, past the grid, of no length.
        all.push((Ray::new(0.4 * size, Vec3::new(0.3, 0.1, -0.2)), [0.0, f32::INFINITY]));
        all.push((Ray::new(Vec3::new(-1.0, 0.0, 0.0), Vec3::X), [0.0, f32::INFINITY]));
        all.push((Ray::new(Vec3::new(-1.0, -0.1, 0.0), Vec3::X), [0.0, f32::INFINITY]));
        all.push((Ray::new(Vec3::ZERO, Vec3::ZERO), [0.0, f32::INFINITY]));
        all
    }

    fn options() -> Vec<VolumeOptions> {
        let lit = VolumeShading { ambient: 0.2, diffuse: 0.7, ..VolumeShading::default() };
        let glossy = VolumeShading { specular: 0.5, shininess: 12.0, ..lit };
        let fixed = VolumeShading {
            light: Some(Vec3::new(1.0, 2.0, -0.5)),
            shininess: 7.5,
            half_gradient: 0.3,
            highlight: VolumeHighlight::Mirrored,
            ..glossy
        };
        let light = |d: Vec3, color| VolumeLight { direction: Some(d), color };
        let lights = vec![light(Vec3::X, [0.9, 0.1, 0.2]), light(Vec3::Z, [0.1, 0.4, 0.9])];
        let gradient_opacity =
            Some(GradientOpacity { factors: vec![0.0, 0.5, 1.0].into(), steepest: 0.8 });
        let plain = VolumeOptions { sample_distance: Some(0.4), ..VolumeOptions::default() };
        let of = |shading| VolumeOptions { shading: Some(shading), ..plain.clone() };
        vec![
            plain.clone(),
            of(lit),
            of(glossy),
            VolumeOptions { clamped_gradients: true, ..of(fixed) },
            VolumeOptions { lights, ..of(lit) },
            VolumeOptions { interpolation: Interpolation::Nearest, ..of(glossy) },
            VolumeOptions { gradient_opacity, ..plain.clone() },
        ]
    }

    fn volume(dims: UVec3, spacing: DVec3, scale: f32, options: VolumeOptions) -> Volume {
        let unit = spacing.min_element() as f32;
        Volume::new(grid(dims, spacing, scale).into(), transfer(scale, unit), options)
            .expect("sound")
    }

    fn cases() -> Vec<(UVec3, DVec3, f32, f64)> {
        vec![
            (UVec3::new(41, 23, 18), DVec3::ONE, 1.0, 1.0),
            (UVec3::new(33, 2, 9), DVec3::new(0.5, 1.0, 3.0), 1e-12, 0.3),
            (UVec3::new(30, 40, 3), DVec3::new(2e6, 1e6, 3e6), 1e9, 7e5),
            (UVec3::new(2, 2, 2), DVec3::splat(1e-3), 1.0, 5e-3),
        ]
    }

    #[test]
    fn samples_agree_with_the_reference_at_every_size_spacing_and_range() {
        for (dims, spacing, scale, distance) in cases() {
            for options in options() {
                let options = VolumeOptions { sample_distance: Some(distance), ..options };
                let v = volume(dims, spacing, scale, options.clone());
                let size = (spacing * (dims - 1).as_dvec3()).as_vec3();
                let rays = rays(300, size, 7).into_iter().filter(|(ray, _)| ray.is_valid());
                for (ray, end) in rays.flat_map(|(r, _)| [(r, f32::INFINITY), (r, 9.9)]) {
                    let got = v.integrate(&ray, 0.0, end, &VolumeQuality::default());
                    let wanted = samples_reference(&v, &ray, end.into());
                    for c in 0..4 {
                        let off = (f64::from(got.rgba[c]) - wanted[c]).abs();
                        assert!(off < 0.1 * LEVEL, "{dims} {got:?} {wanted:?} {ray:?} {options:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn many_samples_converge_to_the_integral() {
        let dims = UVec3::new(41, 23, 18);
        let plain = VolumeOptions { sample_distance: Some(0.01), ..Default::default() };
        let v = volume(dims, DVec3::ONE, 1.0, plain);
        for (ray, _) in rays(60, (dims - 1).as_vec3(), 3) {
            if !ray.is_valid() {
                continue;
            }
            let got = v.integrate(&ray, 0.0, f32::INFINITY, &VolumeQuality::default());
            let wanted = integrate_reference(&v, &ray, 0.0, f32::INFINITY, 0.01);
            for c in 0..4 {
                // The rays that end early leave out one level.
                assert!(
                    (f64::from(got.rgba[c]) - wanted[c]).abs() < 1.7 * LEVEL,
                    "{got:?} {wanted:?}"
                );
            }
        }
    }

    #[test]
    fn rays_have_the_same_bits_alone_in_packets_and_with_every_instruction_set() {
        for (dims, spacing, scale, distance) in cases() {
            let size = spacing * (dims - 1).as_dvec3();
            let plane = ClipPlane { point: 0.4 * size, normal: DVec3::new(1.0, 0.5, -0.2) };
            let fence = Cropping { planes: [0.3 * size, 0.6 * size], regions: 0x2eb_feba };
            let cut = |o: VolumeOptions| {
                [o.clone(), VolumeOptions { clip_planes: vec![plane], cropping: Some(fence), ..o }]
            };
            for options in options().into_iter().flat_map(cut) {
                let options = VolumeOptions { sample_distance: Some(distance), ..options };
                let v = volume(dims, spacing, scale, options);
                let rays = rays(70, (spacing * (dims - 1).as_dvec3()).as_vec3(), 11);
                let alone: Vec<_> = rays.iter().map(|(r, s)| v.sample_ray(r, s[0], s[1])).collect();
                assert!(alone.iter().any(|s| s.samples > 0), "{dims}");
                for level in SimdLevel::available() {
                    let v = v.clone().with_simd_level(Some(level)).expect("available");
                    let mut packets = Vec::new();
                    v.sample_rays(&rays, &mut packets);
                    assert_eq!(packets, alone, "{level:?} {dims}");
                }
            }
        }
    }

    #[test]
    fn empty_space_that_is_skipped_changes_no_bit() {
        for options in options() {
            let v = volume(UVec3::new(61, 43, 38), DVec3::ONE, 1.0, options);
            let mut slow = v.clone();
            let samples = slow.samples.as_mut().expect("takes samples");
            assert!(samples.empty.take().is_some(), "there is empty space");
            let (mut fast_found, mut slow_found) = (Vec::new(), Vec::new());
            let rays = rays(300, Vec3::new(60.0, 42.0, 37.0), 5);
            v.sample_rays(&rays, &mut fast_found);
            slow.sample_rays(&rays, &mut slow_found);
            assert_eq!(fast_found, slow_found);
        }
    }

    #[test]
    fn parts_of_a_ray_share_no_slab_and_leave_none_out() {
        let plain = VolumeOptions { sample_distance: Some(0.7), ..Default::default() };
        let v = volume(UVec3::new(41, 23, 18), DVec3::ONE, 1.0, plain);
        for (n, (ray, _)) in rays(200, Vec3::new(40.0, 22.0, 17.0), 9).into_iter().enumerate() {
            let whole = v.sample_ray(&ray, 0.0, f32::INFINITY);
            if whole.rgba[3] > 0.99 {
                continue;
            }
            let cut = 9.0 + 0.01 * n as f32;
            let (near, far) =
                (v.sample_ray(&ray, 0.0, cut), v.sample_ray(&ray, cut, f32::INFINITY));
            assert_eq!(near.samples + far.samples, whole.samples);
            for c in 0..4 {
                let both = near.rgba[c] + (1.0 - near.rgba[3]) * far.rgba[c];
                assert!((both - whole.rgba[c]).abs() < 1e-5, "{near:?} {far:?} {whole:?}");
            }
        }
    }

    #[test]
    fn points_that_are_not_numbers_are_transparent() {
        let mut values = vec![1.0; 5 * 4 * 3];
        values[23] = f32::NAN;
        values[40] = f32::INFINITY;
        let grid = Grid::new(UVec3::new(5, 4, 3), DVec3::ZERO, DVec3::ONE, values).expect("a grid");
        for options in options() {
            let v =
                Volume::new(Arc::new(grid.clone()), transfer(1.0, 1.0), options).expect("sound");
            for (ray, _) in rays(200, Vec3::new(4.0, 3.0, 2.0), 23) {
                let got = v.integrate(&ray, 0.0, f32::INFINITY, &VolumeQuality::default());
                assert!(got.rgba.iter().all(|c| (0.0..=1.0).contains(c)), "{got:?}");
            }
        }
    }

    #[test]
    fn distances_that_are_none_are_refused_by_name() {
        for distance in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9] {
            let options = VolumeOptions { sample_distance: Some(distance), ..Default::default() };
            let grid = grid(UVec3::splat(5), DVec3::ONE, 1.0);
            let fault = Volume::new(grid.into(), transfer(1.0, 1.0), options).expect_err("refused");
            assert!(fault.to_string().contains("distance of samples"), "{fault}");
        }
    }
}
