//! Gradients of a cell, and shading by lights.

use super::region::in_box;
use super::{GradientOpacity, Volume, VolumeHighlight, VolumeShading};
use crate::grid::Grid;
use crate::grid_walk::IndexRay;
use glam::{DVec3, UVec3, Vec3};

/// The effect of light on a colour, and the steepness of the scalar there.
#[derive(Debug, Clone, Copy)]
struct ShadingSample {
    factor: [f64; 3],
    highlight: f64,
    steepness: f64,
}

/// Light along a ray's segment in a cell: the parabola through its values at both ends and in the
/// middle. Gradients cost as much as the rest of a sample, and between grid points they vary no
/// more than that.
pub(super) struct ShadingCurve<'a> {
    t0: f64,
    per_t: f64,
    ends: [ShadingSample; 3],
    opacity: Option<&'a GradientOpacity>,
}

impl ShadingCurve<'_> {
    /// Extinction and colour at `t`, given those of the transfer function.
    #[inline]
    pub(super) fn on(&self, t: f64, sigma: f64, color: [f64; 3]) -> (f64, [f64; 3]) {
        let x = (t - self.t0) * self.per_t;
        let [a, b, c] = &self.ends;
        let w = [(1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)];
        let mix = |a: f64, b: f64, c: f64| (a * w[0] + b * w[1] + c * w[2]).max(0.0);
        let highlight = mix(a.highlight, b.highlight, c.highlight);
        let lit = std::array::from_fn(|k| {
            color[k] * mix(a.factor[k], b.factor[k], c.factor[k]) + highlight
        });
        let sigma = self
            .opacity
            .map_or(sigma, |o| sigma * o.at(mix(a.steepness, b.steepness, c.steepness)));
        (sigma, lit)
    }
}

impl Volume {
    /// The direction in which lights at the viewer shine through the volume along a ray, which
    /// starts at `o` in object space and goes along `d`. Not a unit vector.
    pub(super) fn view_along(&self, o: DVec3, d: DVec3) -> DVec3 {
        let Some(viewer) = self.options.viewer else { return d };
        let [near, far] = in_box(o, d, self.drawn_box(), 0.0, f64::INFINITY);
        let view = o + d * near - viewer;
        // A ray that misses the grid, or begins at the viewer.
        if near < far && view.length_squared() > 0.0 { view } else { d }
    }

    /// [`Volume::view_along`] for a ray in cells.
    pub(super) fn view_along_index(&self, ray: &IndexRay) -> DVec3 {
        let [o, d] = [ray.o, ray.d].map(|v| DVec3::from_array(v) * self.grid.spacing);
        // Boxes around points begin half a spacing before the grid.
        self.view_along(if self.is_nearest() { o - 0.5 * self.grid.spacing } else { o }, d)
    }

    /// Whether colours or extinctions depend on gradients.
    pub(super) fn has_light(&self) -> bool {
        self.options.shading.is_some() || self.options.gradient_opacity.is_some()
    }

    /// Light along the segment of `ray` in a cell (of the grid that is stored here) from `t0` at
    /// position `p` in it to `t1` at `q`; `None` without shading and gradient opacity.
    pub(super) fn light_along(
        &self,
        ray: &IndexRay,
        stored: UVec3,
        [t0, t1]: [f64; 2],
        p: &[f64; 3],
        q: &[f64; 3],
    ) -> Option<ShadingCurve<'_>> {
        if !self.has_light() {
            return None;
        }
        let dir = self.view_along_index(ray);
        let ends = if self.is_nearest() {
            // The gradient at the point around which the box lies.
            [self.lit(
                corner_gradient(&self.grid, stored, self.options.clamped_gradients).as_dvec3(),
                dir,
            ); 3]
        } else {
            let corners = corner_gradients(&self.grid, stored, self.options.clamped_gradients);
            let (p, q) =
                (Vec3::from_array(p.map(|x| x as f32)), Vec3::from_array(q.map(|x| x as f32)));
            [p, 0.5 * (p + q), q].map(|at| self.lit(between(&corners, at).as_dvec3(), dir))
        };
        let opacity = self.options.gradient_opacity.as_ref();
        Some(ShadingCurve { t0, per_t: 1.0 / (t1 - t0), ends, opacity })
    }

    /// A colour under the lights at one position in a stored cell.
    pub(super) fn shaded_at(
        &self,
        ray: &IndexRay,
        stored: UVec3,
        at: [f64; 3],
        color: [f64; 3],
    ) -> [f64; 3] {
        match self.light_along(ray, stored, [0.0, 1.0], &at, &at) {
            Some(light) => light.on(0.5, 0.0, color).1,
            None => color,
        }
    }

    /// Shading by the gradient `g` for a ray along `dir`.
    fn lit(&self, g: DVec3, dir: DVec3) -> ShadingSample {
        let steepness = g.length();
        let flat = !(steepness > 0.0 && steepness.is_finite());
        let Some(s) = &self.options.shading else {
            return ShadingSample {
                factor: [1.0; 3],
                highlight: 0.0,
                steepness: if flat { 0.0 } else { steepness },
            };
        };
        if flat {
            let factor = if s.half_gradient > 0.0 { 1.0 } else { f64::from(s.ambient) };
            return ShadingSample { factor: [factor; 3], highlight: 0.0, steepness: 0.0 };
        }
        let normal = g / steepness;
        let cos = |l: DVec3| (normal.dot(l) / l.length()).abs();
        let weight = steepness / (steepness + f64::from(s.half_gradient));
        let (ambient, diffuse) = (f64::from(s.ambient), f64::from(s.diffuse));
        if self.options.lights.is_empty() {
            let light = s.light.map_or(dir, |l| l.as_dvec3());
            let factor = 1.0 + weight * (ambient + diffuse * cos(light) - 1.0);
            let highlight = weight * highlight(s, normal, light, dir);
            return ShadingSample { factor: [factor; 3], highlight, steepness };
        }
        let mut sum = [0.0; 3];
        for light in &self.options.lights {
            let cos = cos(light.direction.map_or(dir, |l| l.as_dvec3()));
            sum.iter_mut().zip(light.color).for_each(|(s, c)| *s += f64::from(c) * cos);
        }
        ShadingSample {
            factor: sum.map(|s| 1.0 + weight * (ambient + diffuse * s - 1.0)),
            highlight: 0.0,
            steepness,
        }
    }
}

fn highlight(s: &VolumeShading, normal: DVec3, light: DVec3, dir: DVec3) -> f64 {
    if s.specular <= 0.0 {
        return 0.0;
    }
    // A light at the viewer shines along the ray; both signs of the gradient are equivalent.
    let viewer = if s.light.is_some() { -dir } else { dir }.normalize_or_zero();
    let light = light.normalize_or_zero();
    let base = match s.highlight {
        VolumeHighlight::Halfway => (normal.dot(light + viewer) / (light + viewer).length()).abs(),
        VolumeHighlight::Mirrored => {
            (2.0 * normal.dot(light) * normal.dot(viewer) - light.dot(viewer)).max(0.0)
        }
    };
    // Two opposite directions have no half vector.
    if base.is_finite() { f64::from(s.specular) * base.powf(s.shininess.into()) } else { 0.0 }
}

/// Trilinear in the gradients at the corners of a cell.
#[inline]
fn between(g: &[Vec3; 8], f: Vec3) -> Vec3 {
    let x = |i: usize| g[i] + (g[i + 1] - g[i]) * f.x;
    let [a, b, c, d] = [x(0), x(2), x(4), x(6)];
    let (low, high) = (a + (b - a) * f.y, c + (d - c) * f.y);
    low + (high - low) * f.z
}

/// Central differences at a point, per world unit; at the bounds one-sided or `clamped`.
fn corner_gradient(grid: &Grid, c: UVec3, clamped: bool) -> Vec3 {
    let mut g = [0f32; 3];
    for a in 0..3 {
        let (mut lo, mut hi) = (c.to_array(), c.to_array());
        lo[a] = lo[a].saturating_sub(1);
        hi[a] = (hi[a] + 1).min(grid.dims[a] - 1);
        let steps = if clamped { 2 } else { hi[a] - lo[a] };
        let width = steps as f32 * grid.spacing[a] as f32;
        if width > 0.0 {
            g[a] = (grid.at(hi[0], hi[1], hi[2]) - grid.at(lo[0], lo[1], lo[2])) / width;
        }
    }
    Vec3::from_array(g)
}

/// [`corner_gradient`] at the corners of a cell, x fastest.
pub(super) fn corner_gradients(grid: &Grid, cell: UVec3, clamped: bool) -> [Vec3; 8] {
    let corner = |i: usize| cell + UVec3::new(i as u32 & 1, i as u32 >> 1 & 1, i as u32 >> 2 & 1);
    if cell.cmpeq(UVec3::ZERO).any() || (cell + 2).cmpge(grid.dims).any() {
        return std::array::from_fn(|i| corner_gradient(grid, corner(i), clamped));
    }
    // Inside the grid: the lines of four points along x around the cell.
    let (row, slab) = (grid.dims.x as usize, grid.dims.x as usize * grid.dims.y as usize);
    let first = grid.index(cell.x - 1, cell.y - 1, cell.z - 1);
    let mut lines = [[[0f32; 4]; 4]; 4];
    for (z, lines) in lines.iter_mut().enumerate() {
        for (y, line) in lines.iter_mut().enumerate() {
            // The four at the edges are not used.
            let is_used = (1..3).contains(&y) || (1..3).contains(&z);
            let from = first + z * slab + y * row;
            if is_used && let Some(four) = grid.values.get(from..).and_then(|v| v.first_chunk()) {
                *line = *four;
            }
        }
    }
    let width = 2.0 * grid.spacing.as_vec3();
    let mut gradients = [Vec3::ZERO; 8];
    for (i, g) in gradients.iter_mut().enumerate() {
        let (x, y, z) = (1 + (i & 1), 1 + (i >> 1 & 1), 1 + (i >> 2 & 1));
        *g = Vec3::new(
            lines[z][y][x + 1] - lines[z][y][x - 1],
            lines[z][y + 1][x] - lines[z][y - 1][x],
            lines[z + 1][y][x] - lines[z - 1][y][x],
        ) / width;
    }
    gradients
}

#[cfg(test)]
mod tests {
    use super::super::{Interpolation, VolumeOptions, VolumeQuality};
    use super::*;
    use crate::colormap::ColorMap;
    use crate::ray::Ray;
    use crate::transfer_function::TransferFunction;

    #[test]
    fn gradients_inside_and_at_the_bounds_are_one_function() {
        let dims = UVec3::new(6, 5, 4);
        let values = (0..120).map(|i| ((i * 7919) % 101) as f32).collect();
        let grid = Grid::new(dims, DVec3::ZERO, DVec3::new(0.5, 1.0, 3.0), values).unwrap();
        for cell in [UVec3::new(1, 1, 1), UVec3::new(2, 2, 1), UVec3::new(3, 1, 1), UVec3::ZERO] {
            let fast = corner_gradients(&grid, cell, false);
            for (i, g) in fast.iter().enumerate() {
                let at = cell + UVec3::new(i as u32 & 1, i as u32 >> 1 & 1, i as u32 >> 2 & 1);
                assert_eq!(*g, corner_gradient(&grid, at, false), "{cell} {i}");
            }
        }
        let [one_sided, clamped] =
            [false, true].map(|c| corner_gradient(&grid, UVec3::new(0, 2, 2), c));
        assert_eq!(
            (one_sided.x, one_sided.y),
            (2.0 * clamped.x, clamped.y),
            "half across the bounds"
        );
    }

    /// Waves with light at the viewer; `how` is applied to the options.
    fn lit_waves(how: impl Fn(VolumeOptions) -> VolumeOptions) -> Volume {
        let dims = UVec3::new(17, 13, 11);
        let values = (0..dims.element_product()).map(|i| {
            let p = UVec3::new(i % 17, i / 17 % 13, i / 221).as_vec3();
            (0.6 * p.x).sin() * (0.5 * p.y).cos() + 0.3 * (0.8 * p.z).sin()
        });
        let spacing = DVec3::new(0.5, 1.0, 1.5);
        let grid = Grid::new(dims, DVec3::new(3.0, -2.0, 1.0), spacing, values.collect());
        let colors = ColorMap::new(vec![[0.1, 0.2, 1.0, 1.0], [1.0, 0.4, 0.1, 1.0]], [-1.3, 1.3]);
        let opacity = [[-1.3, 0.0], [0.0, 0.1], [1.3, 0.3]];
        let transfer = TransferFunction::from_opacity(colors, &opacity, 1.0).unwrap();
        let shading = VolumeShading { ambient: 0.1, diffuse: 0.8, ..VolumeShading::default() };
        let options = VolumeOptions { shading: Some(shading), ..VolumeOptions::default() };
        Volume::new(grid.unwrap().into(), transfer, how(options)).unwrap()
    }

    /// Both ways through a volume, with cells between points and around them.
    fn ways() -> Vec<(Option<f64>, Interpolation)> {
        let kinds = [Interpolation::Linear, Interpolation::Nearest];
        kinds.into_iter().flat_map(|kind| [(None, kind), (Some(0.3), kind)]).collect()
    }

    fn largest_difference(a: &Volume, b: &Volume, ray: &Ray) -> f32 {
        let quality = VolumeQuality::Tolerance { levels: 0.05 };
        let [a, b] = [a, b].map(|v| v.integrate(ray, 0.0, f32::INFINITY, &quality).rgba);
        (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max)
    }

    /// In f32 a direction is known to 10⁻⁷, a highlight and the sum of samples to a hundred times
    /// that; halving goes another way for it, within its tolerance of 0.05 levels.
    const SAME: f32 = 0.1 / 255.0;

    #[test]
    fn a_viewer_at_the_origin_of_the_rays_changes_nothing() {
        let viewer = DVec3::new(-9.0, 14.0, 30.0);
        for (sample_distance, interpolation) in ways() {
            let with = |viewer| {
                lit_waves(|o| VolumeOptions {
                    shading: o.shading.map(|s| VolumeShading {
                        specular: 0.5,
                        shininess: 9.0,
                        highlight: VolumeHighlight::Mirrored,
                        ..s
                    }),
                    sample_distance,
                    interpolation,
                    viewer,
                    ..o
                })
            };
            let (by_ray, by_place) = (with(None), with(Some(viewer)));
            for k in 0..40u8 {
                let to = DVec3::new(0.2 * f64::from(k), 0.3 * f64::from(k), 14.0);
                let ray = Ray::new(viewer.as_vec3(), (to - viewer).as_vec3());
                let off = largest_difference(&by_ray, &by_place, &ray);
                assert!(off < SAME, "{k} {sample_distance:?} {interpolation:?}: {off}");
            }
        }
    }

    #[test]
    fn parallel_rays_are_lit_from_the_viewers_place() {
        let viewer = DVec3::new(4.0, 6.0, 40.0);
        let extent = DVec3::new(8.0, 12.0, 15.0);
        for (sample_distance, interpolation) in ways() {
            let options = |o| VolumeOptions { sample_distance, interpolation, ..o };
            let by_ray = lit_waves(options);
            let by_place = lit_waves(|o| VolumeOptions { viewer: Some(viewer), ..options(o) });
            let mut moved = by_ray.clone();
            moved.set_viewer(Some(viewer)).unwrap();
            let mut apart = 0.0f32;
            for k in 0..40u8 {
                let (x, y) = (0.1 + 0.19 * f64::from(k), 0.1 + 0.29 * f64::from(k));
                let ray = Ray::new(DVec3::new(x, y, 40.0).as_vec3(), -Vec3::Z);
                // The same light, with its direction given.
                let entry = DVec3::new(x, y, extent.z);
                let fixed = lit_waves(|o| VolumeOptions {
                    shading: o
                        .shading
                        .map(|s| VolumeShading { light: Some((viewer - entry).as_vec3()), ..s }),
                    ..options(o)
                });
                let off = largest_difference(&by_place, &fixed, &ray);
                assert!(off < SAME, "{k} {sample_distance:?} {interpolation:?}: {off}");
                assert_eq!(largest_difference(&by_place, &moved, &ray), 0.0);
                apart = apart.max(largest_difference(&by_place, &by_ray, &ray));
            }
            assert!(apart > 2.0 / 255.0, "the light depends on the place: {apart}");
        }
        let nowhere = Some(DVec3::new(f64::NAN, 0.0, 0.0));
        let fault = lit_waves(|o| o).set_viewer(nowhere).expect_err("not a place");
        assert!(fault.to_string().contains("viewer"), "{fault}");
    }
}
