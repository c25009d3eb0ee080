//! Adds ray-traced visibility to OpenGL's lighting: hidden lights and ambient occlusion.
//!
//! Only requested effects that can change a pixel are computed. No shadow rays go from points that
//! the eye sees to a point light at the eye, or where a surface faces away. No occlusion rays are
//! traced when none are set. Rays are generated in eye space, which all draws of a frame share. A
//! tree of boxes has the draws that a ray may hit, and these are traversed in their own spaces.

mod draw_tree;

use crate::capture::draw::{Draw, Shading};
use crate::host::config::{Mode, Settings};
use crate::trace::Prepared;
use draw_tree::DrawTree;
use rt_core::camera::Camera;
use rt_core::glam::{DMat4, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::ray::Ray;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The largest number of lights of one draw.
pub(crate) const MOST_LIGHTS: usize = 8;

/// The visibility of lights and surroundings from a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Visibility {
    /// The visible share of each light.
    pub(crate) lights: [f32; MOST_LIGHTS],
    /// The share of the surroundings that is not occluded.
    pub(crate) ambient: f32,
}

impl Visibility {
    /// Nothing is hidden.
    pub(crate) const FULL: Visibility = Visibility { lights: [1.0; MOST_LIGHTS], ambient: 1.0 };
}

/// The position of a draw's light in eye space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LightPosition {
    /// The direction to the light.
    Directional(DVec3),
    /// A point light.
    Positional(DVec3),
}

/// The viewpoint of a draw in eye space. It is not always the origin, because a program may put the
/// camera's position into the projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Eye {
    /// A point, and its distance from the draw.
    Point(DVec3, f64),
    /// The direction that parallel rays come from.
    Parallel(DVec3),
}

impl Eye {
    /// The eye of a camera that is given in the draw's own space. `middle` is the draw's centre.
    pub(crate) fn of(camera: &Camera, eye_from_object: &DMat4, middle: DVec3) -> Eye {
        match camera.eye() {
            Some(at) => {
                let at = eye_from_object.transform_point3(at);
                Eye::Point(at, (eye_from_object.transform_point3(middle) - at).length())
            }
            None => {
                let along = eye_from_object.transform_vector3(camera.world_ray([0.0; 2]).1);
                Eye::Parallel(-along.normalize_or_zero())
            }
        }
    }
}

impl LightPosition {
    /// True when the eye cannot see the shadows of this light, because its light travels along the
    /// rays of the eye. This holds for a point light at the eye of a perspective, and for parallel
    /// light along parallel rays. In perspective, parallel light along the view does not qualify:
    /// its shadows appear next to the objects that cast them.
    pub(crate) fn follows_rays_of(self, eye: Eye) -> bool {
        // The residue of f32 matrices moves a shadow by much less than a pixel.
        const SLACK: f64 = 1e-5;
        match (self, eye) {
            (LightPosition::Positional(p), Eye::Point(at, far)) => (p - at).length() <= SLACK * far,
            (LightPosition::Directional(d), Eye::Parallel(back)) => {
                let d = d.normalize_or_zero();
                d.dot(back) > 0.0 && d.cross(back).length() <= SLACK
            }
            _ => false,
        }
    }
}

/// All draws of a frame, for rays that start on one draw and may hit any.
pub(crate) struct RayScene<'a> {
    pub(crate) draws: &'a [Prepared<'a>],
    pub(crate) object_from_eye: Vec<Option<DMat4>>,
    /// The draws that let light through. They cast no shadow.
    pub(crate) clear: Vec<bool>,
    /// Boxes around the draws.
    tree: DrawTree,
    pub(crate) diagonal: f64,
    pub(crate) settings: &'a Settings,
    /// A different number for each sample of a pixel, so that each sample adds its own rays to the
    /// mean.
    sample: i32,
    pub(crate) shadow_rays: AtomicU64,
    pub(crate) occlusion_rays: AtomicU64,
}

/// The matrix of a draw's vertices from object space to eye space.
pub(crate) fn eye_from_object(draw: &Draw) -> DMat4 {
    let m = match &draw.shading {
        Shading::Fixed => &draw.state.model_view,
        Shading::Program(program) => &program.view_from_object,
    };
    DMat4::from_cols_array(&m.map(f64::from))
}

impl<'a> RayScene<'a> {
    /// Returns `None` when the mode asks only for OpenGL's lighting.
    pub(crate) fn new(draws: &'a [Prepared<'a>], settings: &'a Settings) -> Option<RayScene<'a>> {
        let wanted = settings.effects.shadows || settings.effects.ambient_occlusion_samples > 0;
        if !matches!(settings.mode, Mode::Rich | Mode::Enhance | Mode::Path) || !wanted {
            return None;
        }
        Some(RayScene::of(draws, settings))
    }

    /// The scene of the draws, whatever the mode asks for.
    pub(crate) fn of(draws: &'a [Prepared<'a>], settings: &'a Settings) -> RayScene<'a> {
        let around = |p: &Prepared<'_>| {
            let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (m, b) = (eye_from_object(p.draw), p.draw.geometry.bounds());
            for corner in 0..8 {
                let pick = |bit: i32, k: usize| {
                    f64::from(if corner & bit == 0 { b.min[k] } else { b.max[k] })
                };
                let c = m.transform_point3(DVec3::new(pick(1, 0), pick(2, 1), pick(4, 2)));
                (lo, hi) = (lo.min(c), hi.max(c));
            }
            [lo, hi]
        };
        let boxes: Vec<[DVec3; 2]> = draws.iter().map(around).collect();
        let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [lo, hi] = boxes.iter().fold(nothing, |[a, b], [c, d]| [a.min(*c), b.max(*d)]);
        // A box is a little larger than its draw, by more than what a ray that is rounded in the
        // draw's own space can miss it by.
        let more = DVec3::splat(1e-5 * (hi - lo).length());
        let boxes: Vec<_> = boxes.into_iter().map(|[a, b]| [a - more, b + more]).collect();
        let invert = |p: &Prepared<'_>| {
            let m = eye_from_object(p.draw);
            (m.determinant() != 0.0).then(|| m.inverse())
        };
        // Sample positions are multiples of a sixteenth of a pixel in [-1/2, 1/2).
        let [x, y] = draws.first().map_or([0.0; 2], |p| p.draw.state.sample_place);
        let sample = ((x * 256.0) as i32) << 20 ^ ((y * 256.0) as i32) << 11;
        RayScene {
            sample,
            object_from_eye: draws.iter().map(invert).collect(),
            clear: vec![false; draws.len()],
            tree: DrawTree::new(&boxes),
            draws,
            diagonal: (hi - lo).length(),
            settings,
            shadow_rays: AtomicU64::new(0),
            occlusion_rays: AtomicU64::new(0),
        }
    }

    /// True when anything lies between `from` and `from + dir * most` (in eye space).
    fn hidden(&self, from: DVec3, dir: DVec3, most: f64) -> bool {
        self.tree.any(from, dir, most, |i| {
            let Some(m) = self.object_from_eye[i].filter(|_| !self.clear[i]) else { return false };
            let p = &self.draws[i];
            let (origin, dir) = (m.transform_point3(from), m.transform_vector3(dir));
            let Some([t0, t1]) = above(p.clip_planes(), origin, dir, most) else { return false };
            let (ray, moved) = p.world.ray_from_world(origin, dir);
            let [t0, t1] = [t0, t1].map(|t| (t - moved) as f32);
            p.world.occluded(&Ray {
                t_min: ray.t_min.max(t0),
                t_max: if t1.is_finite() { t1 } else { f32::INFINITY },
                ..ray
            })
        })
    }

    /// The visibility from a point with the given normal (towards the viewer), both in eye space.
    /// `eye` is set for a point that is the first hit of one of the eye's rays.
    pub(crate) fn visibility(
        &self,
        point: DVec3,
        normal: DVec3,
        lights: &[LightPosition],
        eye: Option<Eye>,
        pixel: (i32, i32),
    ) -> Visibility {
        let mut v = Visibility::FULL;
        // Starts off the surface, by a share of the scene's size that exceeds the error of f32
        // positions anywhere in the scene.
        let from = point + normal * (self.diagonal * 2e-5);
        let effects = &self.settings.effects;
        let mut random = PixelRng::new((pixel.0 ^ self.sample, pixel.1));
        if effects.shadows {
            for (light, share) in lights.iter().zip(&mut v.lights) {
                let follows = eye.is_some_and(|eye| light.follows_rays_of(eye));
                if follows && effects.light_radius_deg == 0.0 {
                    continue;
                }
                let (dir, most) = match *light {
                    LightPosition::Directional(d) => (d.normalize_or_zero(), f64::INFINITY),
                    LightPosition::Positional(p) => {
                        ((p - from).normalize_or_zero(), (p - from).length())
                    }
                };
                if dir.dot(normal) <= 0.0 {
                    continue;
                }
                let rays = if effects.light_radius_deg > 0.0 { 8 } else { 1 };
                let spread = effects.light_radius_deg.to_radians().tan();
                let seen = (0..rays).filter(|_| {
                    let (x, y) = random.on_disk();
                    let (u, w) = dir.any_orthonormal_pair();
                    let dir = if spread > 0.0 {
                        (dir + (u * x + w * y) * spread).normalize()
                    } else {
                        dir
                    };
                    !self.hidden(from, dir, most)
                });
                *share = seen.count() as f32 / rays as f32;
                self.shadow_rays.fetch_add(rays, Relaxed);
            }
        }
        let n = effects.ambient_occlusion_samples;
        if n > 0 {
            let most = effects.ambient_occlusion_radius * self.diagonal;
            let (u, w) = normal.any_orthonormal_pair();
            let open = (0..n).filter(|_| {
                // Cosine-weighted: a disk projected onto the hemisphere (Malley's method).
                let (x, y) = random.on_disk();
                let dir = u * x + w * y + normal * (1.0 - x * x - y * y).max(0.0).sqrt();
                !self.hidden(from, dir, most)
            });
            v.ambient = open.count() as f32 / n as f32;
            self.occlusion_rays.fetch_add(u64::from(n), Relaxed);
        }
        v
    }
}

/// The part of a ray, up to `most`, where a draw is that these planes clip: the points above all of
/// them. What is clipped away casts no shadow.
fn above(planes: &[[f64; 4]], origin: DVec3, dir: DVec3, most: f64) -> Option<[f64; 2]> {
    let (mut t0, mut t1) = (0.0_f64, most);
    for &[a, b, c, d] in planes {
        let normal = DVec3::new(a, b, c);
        let (height, climb) = (normal.dot(origin) + d, normal.dot(dir));
        let crossing = -height / climb;
        if climb > 0.0 {
            t0 = t0.max(crossing);
        } else if climb < 0.0 {
            t1 = t1.min(crossing);
        } else if height < 0.0 {
            return None;
        }
    }
    (t0 <= t1).then_some([t0, t1])
}

/// Random numbers that depend only on the pixel, so that a still image does not flicker.
pub(crate) struct PixelRng(SplitMix64);

impl PixelRng {
    pub(crate) fn new((x, y): (i32, i32)) -> PixelRng {
        PixelRng(SplitMix64::new((x as u64) << 32 ^ (y as u64) ^ 0x9e37_79b9_7f4a_7c15))
    }

    /// The next number in [0, 1).
    pub(crate) fn next(&mut self) -> f64 {
        self.0.unit()
    }

    pub(crate) fn on_disk(&mut self) -> (f64, f64) {
        let (r, a) = (self.next().sqrt(), std::f64::consts::TAU * self.next());
        (r * a.cos(), r * a.sin())
    }
}

/// A direction or normal as doubles.
pub(crate) fn vector(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}

#[cfg(test)]
mod eye_lights;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_that_go_along_the_rays_of_an_eye_are_known() {
        let point = |at| Eye::Point(at, 10.0);
        assert!(LightPosition::Positional(DVec3::ZERO).follows_rays_of(point(DVec3::ZERO)));
        assert!(
            LightPosition::Positional(DVec3::X).follows_rays_of(point(DVec3::new(1.0, 1e-6, 0.0)))
        );
        assert!(!LightPosition::Positional(DVec3::ZERO).follows_rays_of(point(DVec3::X)));
        assert!(!LightPosition::Directional(DVec3::Z).follows_rays_of(point(DVec3::ZERO)));
        let parallel = Eye::Parallel(DVec3::Z);
        assert!(LightPosition::Directional(DVec3::Z * 3.0).follows_rays_of(parallel));
        assert!(!LightPosition::Directional(DVec3::new(0.1, 0.0, 1.0)).follows_rays_of(parallel));
        assert!(!LightPosition::Directional(DVec3::NEG_Z).follows_rays_of(parallel));
        assert!(!LightPosition::Positional(DVec3::ZERO).follows_rays_of(parallel));
    }

    #[test]
    fn a_ray_meets_a_clipped_draw_only_above_its_planes() {
        let plane = |n: DVec3, d| [n.x, n.y, n.z, d];
        let (from, dir) = (DVec3::new(0.0, 0.0, -2.0), DVec3::Z * 0.5);
        let part = |planes: &[[f64; 4]]| above(planes, from, dir, 100.0);
        assert_eq!(part(&[]), Some([0.0, 100.0]));
        assert_eq!(part(&[plane(DVec3::Z, 0.0)]), Some([4.0, 100.0]), "above z = 0");
        assert_eq!(part(&[plane(-DVec3::Z, 1.0)]), Some([0.0, 6.0]), "below z = 1");
        assert_eq!(part(&[plane(DVec3::Z, 0.0), plane(-DVec3::Z, 1.0)]), Some([4.0, 6.0]));
        assert_eq!(part(&[plane(DVec3::Z, -3.0), plane(-DVec3::Z, 1.0)]), None);
        assert_eq!(part(&[plane(DVec3::X, -1.0)]), None, "along a plane, below it");
        assert_eq!(part(&[plane(DVec3::X, 1.0)]), Some([0.0, 100.0]), "along a plane, above it");
    }

    #[test]
    fn pixels_keep_their_random_numbers() {
        // Pixels left of the image or below it have negative coordinates. They work too.
        let mut random = PixelRng::new((3, -4));
        assert_eq!(
            [random.next(), random.next()].map(f64::to_bits),
            [0x3fd8_0ac0_36c8_7516, 0x3fe3_cffc_8179_b04a]
        );
    }

    #[test]
    fn numbers_of_a_pixel_are_the_same_in_every_frame_and_fill_the_disk() {
        let points: Vec<_> =
            (0..256).map(|_| 0).scan(PixelRng::new((3, 7)), |r, _| Some(r.on_disk())).collect();
        let again: Vec<_> =
            (0..256).map(|_| 0).scan(PixelRng::new((3, 7)), |r, _| Some(r.on_disk())).collect();
        assert_eq!(points, again);
        assert!(points.iter().all(|(x, y)| x * x + y * y <= 1.0));
        let mean = points.iter().map(|p| p.0).sum::<f64>() / 256.0;
        assert!(mean.abs() < 0.1, "{mean}");
    }
}
