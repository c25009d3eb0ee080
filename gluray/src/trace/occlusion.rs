//! What rays add to OpenGL's lighting: lights that are hidden, and corners that see little of the
//! surroundings.
//!
//! Only what is asked for and can change a pixel is computed: no shadow rays from what the eye sees
//! to a point light at the eye, none where a surface faces away, and no occlusion rays when none
//! are set. Rays are made in eye space, where all draws of a frame meet, and go through each draw's
//! own structure.

use crate::capture::draw::{Draw, Shading};
use crate::host::config::{Mode, Settings};
use crate::trace::Prepared;
use rt_core::camera::Camera;
use rt_core::glam::{DMat4, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::ray::Ray;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Most lights of one draw.
pub(crate) const MOST_LIGHTS: usize = 8;

/// What reaches a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Visibility {
    /// Share of each light that is not hidden.
    pub(crate) lights: [f32; MOST_LIGHTS],
    /// Share of the surroundings that is near nothing.
    pub(crate) ambient: f32,
}

impl Visibility {
    /// Nothing is hidden.
    pub(crate) const FULL: Visibility = Visibility { lights: [1.0; MOST_LIGHTS], ambient: 1.0 };
}

/// Where a light of a draw is, in eye space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LightPosition {
    /// Direction to it.
    Directional(DVec3),
    /// A point.
    Positional(DVec3),
}

/// From where a draw is seen, in eye space. The origin is not always it: a program may keep the
/// place of its camera in the projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Eye {
    /// A point, and how far from it the draw is.
    Point(DVec3, f64),
    /// The direction that parallel rays come from.
    Parallel(DVec3),
}

impl Eye {
    /// Of the camera that a draw is seen by, given in the draw's own space; `middle` is the draw's.
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
    /// Whether its light goes along the rays of this eye: what it misses the eye cannot see. That
    /// is so of a point at the eye of a perspective, and of parallel light along parallel rays.
    /// Parallel light along the view is no such light in perspective: its shadows show beside what
    /// casts them.
    pub(crate) fn follows_rays_of(self, eye: Eye) -> bool {
        // What is left of f32 matrices moves a shadow by much less than a pixel.
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

/// All draws of a frame, for rays that begin on one and end on any.
pub(crate) struct RayScene<'a> {
    pub(crate) draws: &'a [Prepared<'a>],
    pub(crate) object_from_eye: Vec<Option<DMat4>>,
    /// Which draws let light through: they cast no shadow.
    pub(crate) clear: Vec<bool>,
    pub(crate) diagonal: f64,
    pub(crate) settings: &'a Settings,
    /// Another number for each sample of a pixel: each adds rays of its own to the mean.
    sample: i32,
    pub(crate) shadow_rays: AtomicU64,
    pub(crate) occlusion_rays: AtomicU64,
}

/// Where a draw's vertices are in eye space.
pub(crate) fn eye_from_object(draw: &Draw) -> DMat4 {
    let m = match &draw.shading {
        Shading::Fixed => &draw.state.model_view,
        Shading::Program(program) => &program.view_from_object,
    };
    DMat4::from_cols_array(&m.map(f64::from))
}

impl<'a> RayScene<'a> {
    /// `None` when the mode asks for nothing beyond OpenGL's lighting.
    pub(crate) fn new(draws: &'a [Prepared<'a>], settings: &'a Settings) -> Option<RayScene<'a>> {
        let wanted = settings.effects.shadows || settings.effects.ambient_occlusion_samples > 0;
        if !matches!(settings.mode, Mode::Rich | Mode::Enhance | Mode::Path) || !wanted {
            return None;
        }
        Some(RayScene::of(draws, settings))
    }

    /// The draws, whatever is asked for.
    pub(crate) fn of(draws: &'a [Prepared<'a>], settings: &'a Settings) -> RayScene<'a> {
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in draws {
            let (m, b) = (eye_from_object(p.draw), p.draw.geometry.bounds());
            for corner in 0..8 {
                let pick = |bit: i32, k: usize| {
                    f64::from(if corner & bit == 0 { b.min[k] } else { b.max[k] })
                };
                let c = m.transform_point3(DVec3::new(pick(1, 0), pick(2, 1), pick(4, 2)));
                (lo, hi) = (lo.min(c), hi.max(c));
            }
        }
        let invert = |p: &Prepared<'_>| {
            let m = eye_from_object(p.draw);
            (m.determinant() != 0.0).then(|| m.inverse())
        };
        // Places are multiples of a sixteenth of a pixel in [-1/2, 1/2).
        let [x, y] = draws.first().map_or([0.0; 2], |p| p.draw.state.sample_place);
        let sample = ((x * 256.0) as i32) << 20 ^ ((y * 256.0) as i32) << 11;
        RayScene {
            sample,
            object_from_eye: draws.iter().map(invert).collect(),
            clear: vec![false; draws.len()],
            draws,
            diagonal: (hi - lo).length(),
            settings,
            shadow_rays: AtomicU64::new(0),
            occlusion_rays: AtomicU64::new(0),
        }
    }

    /// Whether anything is between `from` and `from + dir * most` (eye space).
    fn hidden(&self, from: DVec3, dir: DVec3, most: f64) -> bool {
        self.draws.iter().zip(&self.object_from_eye).zip(&self.clear).any(|((p, m), clear)| {
            let Some(m) = m.filter(|_| !clear) else { return false };
            let (origin, dir) = (m.transform_point3(from), m.transform_vector3(dir));
            let (ray, moved) = p.world.ray_from_world(origin, dir);
            let t_max = (most - moved) as f32;
            p.world.occluded(&Ray {
                t_max: if t_max.is_finite() { t_max } else { f32::INFINITY },
                ..ray
            })
        })
    }

    /// What reaches a point with the given normal (towards the viewer), both in eye space. `eye` is
    /// there for a point that is the first on a ray of its.
    pub(crate) fn visibility(
        &self,
        point: DVec3,
        normal: DVec3,
        lights: &[LightPosition],
        eye: Option<Eye>,
        pixel: (i32, i32),
    ) -> Visibility {
        let mut v = Visibility::FULL;
        // Off the surface by a share of the scene that f32 positions in any of its parts cannot
        // reach.
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
                // Cosine-weighted: a disk lifted onto the hemisphere (Malley's method).
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

/// Numbers that depend on the pixel alone, so that a still picture does not flicker.
pub(crate) struct PixelRng(SplitMix64);

impl PixelRng {
    pub(crate) fn new((x, y): (i32, i32)) -> PixelRng {
        PixelRng(SplitMix64::new((x as u64) << 32 ^ (y as u64) ^ 0x9e37_79b9_7f4a_7c15))
    }

    /// From 0 to below 1.
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
    fn pixels_keep_their_random_numbers() {
        // Also of a pixel left of or above the picture, whose number is negative.
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
