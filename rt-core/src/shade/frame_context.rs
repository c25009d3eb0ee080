//! A scene prepared for the tiles of one frame: instances resolved, lights in render space, ray
//! generation set up.

use super::camera_rays::CameraRays;
use super::light_sampling::LightSampling;
use crate::camera::Camera;
use crate::effects::Effects;
use crate::environment::{Background, IrradianceCoefficients};
use crate::light::{LightKind, ResolvedLight};
use crate::math::Aabb;
use crate::ray::{Hit, Ray};
use crate::render_options::RenderOptions;
use crate::sampler::Sampler;
use crate::scene::{Scene, transmits_light};
use crate::surface::{ResolvedInstance, SurfacePoint};
use crate::volume::Volume;
use fearless_simd::Level;
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

/// Everything that is the same for all rays of a frame.
pub(crate) struct FrameContext<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) camera: Camera,
    pub(crate) options: &'a RenderOptions,
    pub(crate) effects: Effects,
    pub(crate) instances: Vec<ResolvedInstance<'a>>,
    pub(crate) lights: Vec<ResolvedLight>,
    /// How points sample each of the lights.
    pub(crate) light_sampling: Vec<LightSampling>,
    /// Number of the first ambient occlusion ray among all light rays of a point.
    pub(crate) sky_number: u32,
    /// Ambient light and environment by normal.
    pub(crate) irradiance: Option<IrradianceCoefficients>,
    /// Radiance of the ambient lights alone.
    pub(crate) ambient: Vec3,
    pub(crate) camera_rays: CameraRays,
    /// Instruction set of ray generation and shading: the world's. Every one gives the same bits.
    pub(crate) level: Level,
    /// Whether a material has maps.
    pub(crate) has_maps: bool,
    /// For each instance, whether it may transmit light; empty when none does.
    pub(crate) transmissive: Vec<bool>,
    /// Volumes with the transform into their object space.
    pub(crate) volumes: Vec<(&'a Volume, DAffine3)>,
    /// [`Camera::viewer`] in render space.
    pub(crate) viewer: Option<Vec3>,
    /// World position of render space's origin.
    pub(crate) origin: DVec3,
    /// Render-space up of the image, for gradient backgrounds seen in mirrors.
    up: Vec3,
}

impl<'a> FrameContext<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        camera: &Camera,
        options: &'a RenderOptions,
        effects: Effects,
    ) -> FrameContext<'a> {
        // Without surfaces, render space can be where the volumes are.
        let origin = match scene.volumes.first() {
            Some(v) if scene.world.bounds().is_empty() => {
                v.world_from_object.transform_point3(v.volume.origin())
            }
            _ => scene.world.origin(),
        };
        let mut bounds = scene.world.bounds();
        let mut volumes = Vec::new();
        if effects.contains(Effects::VOLUMES) {
            for v in &scene.volumes {
                let to_world = v.world_from_object * DAffine3::from_translation(v.volume.origin());
                let render_from_object = DAffine3::from_translation(-origin) * to_world;
                let corners = v
                    .volume
                    .bounds()
                    .corners()
                    .map(|c| render_from_object.transform_point3(c.as_dvec3()).as_vec3());
                bounds = bounds.union(Aabb::from_points(&corners));
                volumes.push((&*v.volume, render_from_object.inverse()));
            }
        }
        let world_from_view = camera.world_from_view();
        let lens = effects.contains(Effects::DEPTH_OF_FIELD);
        let lights: Vec<ResolvedLight> = scene
            .lights
            .iter()
            .filter(|l| l.color != [0.0; 3] || l.highlight_color.is_some())
            .filter_map(|l| ResolvedLight::new(l, camera, lens, origin))
            .collect();
        let ambient = scene
            .lights
            .iter()
            .filter(|l| l.kind == LightKind::Ambient)
            .map(|l| Vec3::from(l.color))
            .sum();
        let count = scene.world.instances().len();
        let (light_sampling, sky_number) = LightSampling::of(&lights, effects, options.light_rays);
        FrameContext {
            scene,
            camera: *camera,
            options,
            effects,
            instances: (0..count)
                .into_par_iter()
                .with_min_len(1024)
                .map(|i| ResolvedInstance::new(scene, i))
                .collect(),
            lights,
            light_sampling,
            sky_number,
            irradiance: IrradianceCoefficients::new(scene.environment.as_ref(), ambient),
            ambient,
            camera_rays: CameraRays::new(camera, origin, bounds, lens),
            level: scene.world.level,
            transmissive: if passes_surfaces(effects) {
                transmits_light(scene, effects)
            } else {
                Vec::new()
            },
            has_maps: scene.materials.iter().any(|m| m.maps.is_some()),
            volumes,
            viewer: camera.viewer().map(|v| (v - origin).as_vec3()),
            origin,
            up: world_from_view.y_axis.as_vec3(),
        }
    }

    /// True when shadow and ambient occlusion rays take opacity and dielectrics into account.
    pub(crate) fn light_passes_surfaces(&self) -> bool {
        passes_surfaces(self.effects)
    }

    #[inline]
    pub(crate) fn instance_at(&self, hit: &Hit) -> &ResolvedInstance<'a> {
        &self.instances[hit.instance as usize]
    }

    /// The surface at a hit, with the normal used for lighting.
    #[inline]
    pub(crate) fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let resolved = self.instance_at(hit);
        let mut surface = resolved.surface(ray, hit);
        resolved.parameters(ray, hit, &mut surface.normal);
        surface
    }

    /// Sample points of pixel (`x`, `y`) of the whole image.
    #[inline]
    pub(crate) fn sampler(&self, x: u32, y: u32, sample: u32) -> Sampler {
        Sampler::new(self.options.sampling, self.options.seed, x, y, sample)
    }

    /// NDC of the point (`dx`, `dy`) of pixel (`x`, `y`), or of the point given for it.
    #[inline]
    pub(crate) fn ndc(&self, x: u32, y: u32, [dx, dy]: [f32; 2]) -> [f64; 2] {
        if let Some(points) = &self.options.points {
            // Tiles may extend beyond the image's edge.
            let at = y as usize * self.options.width as usize + x as usize;
            return points.get(at).copied().unwrap_or_default();
        }
        let size = [self.options.width, self.options.height];
        Camera::ndc_of_pixel(x as f64 + dx as f64, y as f64 + dy as f64, size)
    }

    /// Background of pixel row `y`, not premultiplied; `dir` is the ray's.
    pub(crate) fn background(&self, y: u32, dir: Vec3) -> [f32; 4] {
        match self.scene.background {
            Background::Transparent => [0.0; 4],
            Background::Constant(c) => c,
            Background::Gradient { bottom, top } => {
                let h = 1.0 - (y as f32 + 0.5) / self.options.height as f32;
                Vec3::from(bottom).lerp(top.into(), h).extend(1.0).to_array()
            }
            Background::Environment => match &self.scene.environment {
                Some(e) => e.radiance(dir.normalize_or_zero()).extend(1.0).to_array(),
                None => [0.0; 4],
            },
        }
    }

    /// Radiance of a mirrored or refracted ray that leaves the scene: the environment, else the
    /// background.
    pub(crate) fn surroundings(&self, dir: Vec3) -> Vec3 {
        let dir = dir.normalize_or_zero();
        if let Some(e) = &self.scene.environment {
            return e.radiance(dir);
        }
        match self.scene.background {
            Background::Constant([r, g, b, a]) => Vec3::new(r, g, b) * a,
            Background::Gradient { bottom, top } => {
                Vec3::from(bottom).lerp(top.into(), 0.5 + 0.5 * dir.dot(self.up))
            }
            Background::Transparent | Background::Environment => Vec3::ZERO,
        }
    }

    /// Window depth of the surface hit by the ray through NDC `ndc`, and its distance from the
    /// ray's origin: see [`point_on_ray`].
    pub(crate) fn depth_and_distance(&self, ndc: [f64; 2], ray: &Ray, hit: &Hit) -> (f32, f32) {
        let (on_surface, n) = self.instance_at(hit).plane(ray, hit, self.origin);
        let ray = self.camera.world_ray(ndc);
        let point = point_on_ray(ray, on_surface, n);
        let distance = (point - ray.0).length();
        let depth = if self.camera.is_omnidirectional() {
            self.camera.panorama_depth(distance)
        } else {
            self.camera.window_depth(point)
        };
        (depth as f32, distance as f32)
    }
}

fn passes_surfaces(effects: Effects) -> bool {
    effects.intersects(Effects::TRANSPARENCY.union(Effects::REFRACTION))
}

/// World point where a pixel's f64 ray (origin, direction) intersects the plane through
/// `on_surface` with normal `n` (any length), so that neither the f32 ray nor its hit parameter
/// limits the accuracy.
#[inline(always)]
pub(crate) fn point_on_ray((origin, dir): (DVec3, DVec3), on_surface: DVec3, n: DVec3) -> DVec3 {
    let along = n.dot(dir);
    let t = n.dot(on_surface - origin) / along;
    let on_ray = origin + dir * t;
    // The exact ray's intersection with an edge-on plane is ill-conditioned, so the hit itself is
    // kept. A pixel's f32 ray and exact ray differ by some 1e-7 of the distance; a far larger step
    // along the plane is not an improvement but a division by almost 0.
    let step = (on_ray - on_surface).length_squared();
    let limit = 1e-8 * (on_surface - origin).length_squared();
    if step <= limit { on_ray } else { on_surface }
}
