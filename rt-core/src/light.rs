//! Light sources.
//!
//! **Unit.** As in OpenGL and VTK, a light of colour 1 at normal incidence on a matte white surface
//! gives it radiance 1: its irradiance is π times its colour. The path tracer uses the same unit,
//! so both integrators agree on direct light. An ambient light or an environment of radiance 1
//! gives an unoccluded white surface radiance 1.

use crate::camera::Camera;
use glam::{DMat3, DVec3, Vec3};

/// The space in which a light's position and direction are given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum LightFrame {
    /// World space.
    #[default]
    World,
    /// OpenGL's eye space (x right, y up, z towards the viewer; the eye at the origin): the light
    /// moves with the camera.
    Camera,
}

/// Shape of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LightKind {
    /// The same from all directions; attenuated by ambient occlusion.
    Ambient,
    /// Parallel light.
    Directional {
        /// Direction from the scene to the light, any length.
        to_light: DVec3,
        /// Half the angle that the light's disk subtends, radians; 0 for sharp shadows (the sun:
        /// 0.00465).
        angular_radius_rad: f64,
    },
    /// Light from a point or a sphere, in all directions.
    Point {
        /// Centre.
        position: DVec3,
        /// Radius of the sphere, world units; 0 for sharp shadows.
        radius: f64,
    },
    /// A cone of light.
    Spot {
        /// Tip of the cone.
        position: DVec3,
        /// Axis, away from the light.
        direction: DVec3,
        /// Half angle of the cone, radians; dark outside.
        cutoff_rad: f64,
        /// Inside the cone, light falls off as the cosine of the angle to the axis to this power
        /// (GL_SPOT_EXPONENT).
        exponent: f64,
        /// Radius of the emitting disk, world units; 0 for sharp shadows.
        radius: f64,
    },
    /// A cone of light with a soft edge: full inside the inner angle, none outside the outer angle,
    /// and linear in the cosine to the axis between them (OSPRay's and ANARI's spot light).
    Cone {
        /// Tip of the cone.
        position: DVec3,
        /// Axis, away from the light.
        direction: DVec3,
        /// Half angle of full light, radians.
        inner_rad: f64,
        /// Half angle of any light, radians; at least the inner one.
        outer_rad: f64,
    },
    /// A flat disk that emits on one side, with the cosine to its normal.
    Disk {
        /// Centre.
        position: DVec3,
        /// Normal of the emitting side.
        direction: DVec3,
        /// Radius, world units.
        radius: f64,
    },
    /// A flat ring or disk that emits on one side with the cosine to its normal, within a cone with
    /// a soft edge (ANARI's ring light).
    Ring {
        /// Centre.
        position: DVec3,
        /// Normal of the emitting side.
        direction: DVec3,
        /// Radius of the hole, world units; 0 for a disk.
        inner_radius: f64,
        /// Radius, world units.
        radius: f64,
        /// Half angle of full light, radians.
        inner_rad: f64,
        /// Half angle of any light, radians; at least the inner one, at most π/2.
        outer_rad: f64,
    },
    /// A flat parallelogram that emits with the cosine to its normal.
    Quad {
        /// A corner.
        corner: DVec3,
        /// From there to the neighbouring corners, world units. It emits to the side of edge 1 ×
        /// edge 2.
        edges: [DVec3; 2],
        /// Whether it emits to the other side as well.
        both_sides: bool,
    },
}

/// A light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Shape and position.
    pub kind: LightKind,
    /// Space of the position.
    pub frame: LightFrame,
    /// Linear RGB; the module documentation defines the unit.
    pub color: [f32; 3],
    /// Colour of Phong highlights where it differs from `color` (GL_SPECULAR, vtkLight's specular
    /// colour).
    pub highlight_color: Option<[f32; 3]>,
    /// Attenuation: divisor c + l·d + q·d² over distance d (as in GL). `[1, 0, 0]` for none; `[0,
    /// 0, 1]` for physical lights, whose colour then holds at distance 1. Ignored by directional
    /// and ambient light.
    pub attenuation: [f32; 3],
    /// Whether surfaces block it. For light that follows the camera rays (from a point at the eye
    /// of a perspective, or parallel to a parallel projection's rays), no shadow rays are sent from
    /// the first hits of those rays: the eye could not see the shadows.
    pub shadows: bool,
}

/// Why a light cannot be given a size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LightSizeError {
    /// Ambient light comes from all directions.
    #[error("ambient light has no size: it comes from everywhere; leave the size out")]
    Ambient,
    /// The light comes from the tip.
    #[error(
        "a cone light has no size: its light comes from its tip; take LightKind::Ring for a disk \
         that shines within a cone, \
         or LightKind::Spot, which has a radius"
    )]
    Cone,
    /// The edges have zero length, so they cannot be scaled.
    #[error(
        "a quadrangle light whose edges are zero, NaN or infinite cannot be given a size; give it \
         edges"
    )]
    Quad,
}

impl Light {
    fn new(kind: LightKind) -> Light {
        Light {
            kind,
            frame: LightFrame::World,
            color: [1.0; 3],
            highlight_color: None,
            attenuation: [1.0, 0.0, 0.0],
            shadows: true,
        }
    }

    /// Isotropic ambient light of radiance `color`.
    pub fn ambient(color: [f32; 3]) -> Light {
        Light { color, shadows: false, ..Light::new(LightKind::Ambient) }
    }

    /// White light from direction `to_light`.
    pub fn directional(to_light: DVec3) -> Light {
        Light::new(LightKind::Directional { to_light, angular_radius_rad: 0.0 })
    }

    /// White light from a point, without attenuation.
    pub fn point(position: DVec3) -> Light {
        Light::new(LightKind::Point { position, radius: 0.0 })
    }

    /// A white cone of light along `direction`.
    pub fn spot(position: DVec3, direction: DVec3, cutoff_rad: f64) -> Light {
        Light::new(LightKind::Spot { position, direction, cutoff_rad, exponent: 0.0, radius: 0.0 })
    }

    /// A white one-sided disk.
    pub fn disk(position: DVec3, direction: DVec3, radius: f64) -> Light {
        Light::new(LightKind::Disk { position, direction, radius })
    }

    /// White light along the viewing direction (VTK's headlight, GL_LIGHT0's default). It moves
    /// with the camera and casts no shadows.
    pub fn headlight() -> Light {
        let kind = LightKind::Directional { to_light: DVec3::Z, angular_radius_rad: 0.0 };
        Light { frame: LightFrame::Camera, shadows: false, ..Light::new(kind) }
    }

    /// White light from the parallelogram at `corner` with these edges, to the side of edge 1 ×
    /// edge 2. The colour holds at distance 1 straight ahead.
    pub fn quad(corner: DVec3, edges: [DVec3; 2]) -> Light {
        let kind = LightKind::Quad { corner, edges, both_sides: false };
        Light { attenuation: [0.0, 0.0, 1.0], ..Light::new(kind) }
    }

    /// The same light in another colour.
    #[must_use]
    pub fn with_color(self, color: [f32; 3]) -> Light {
        Light { color, ..self }
    }

    /// The same light with a size as in [`Light::size`]: the radius in world units, for directional
    /// light the angular radius in radians, and for a quadrilateral half of its longer edge. The
    /// holes of rings and the shorter edges of quadrilaterals scale with it; a quadrilateral's
    /// centre stays.
    ///
    /// # Errors
    /// Ambient light and cones have no size, and a quadrilateral without edges cannot be scaled.
    pub fn with_size(mut self, size: f64) -> Result<Light, LightSizeError> {
        match &mut self.kind {
            LightKind::Directional { angular_radius_rad: r, .. }
            | LightKind::Point { radius: r, .. }
            | LightKind::Spot { radius: r, .. }
            | LightKind::Disk { radius: r, .. } => *r = size,
            LightKind::Ring { inner_radius, radius, .. } => {
                *inner_radius *= if *radius > 0.0 { size / *radius } else { 0.0 };
                *radius = size;
            }
            LightKind::Quad { corner, edges, .. } => {
                let longer = edges[0].length().max(edges[1].length());
                if !(longer > 0.0 && longer.is_finite()) {
                    return Err(LightSizeError::Quad);
                }
                let middle = *corner + 0.5 * (edges[0] + edges[1]);
                *edges = edges.map(|e| e * (2.0 * size / longer));
                *corner = middle - 0.5 * (edges[0] + edges[1]);
            }
            LightKind::Ambient => return Err(LightSizeError::Ambient),
            LightKind::Cone { .. } => return Err(LightSizeError::Cone),
        }
        Ok(self)
    }

    /// The same light without shadows.
    #[must_use]
    pub fn without_shadows(self) -> Light {
        Light { shadows: false, ..self }
    }

    /// The same light given in eye space.
    #[must_use]
    pub fn in_camera_frame(self) -> Light {
        Light { frame: LightFrame::Camera, ..self }
    }

    /// Radius or angular radius, half the longer edge of a quadrilateral; 0 for a light without
    /// size.
    pub fn size(&self) -> f64 {
        match self.kind {
            LightKind::Ambient | LightKind::Cone { .. } => 0.0,
            LightKind::Quad { edges: [a, b], .. } => 0.5 * a.length().max(b.length()),
            LightKind::Ring { radius: r, .. } => r,
            LightKind::Directional { angular_radius_rad: r, .. }
            | LightKind::Point { radius: r, .. }
            | LightKind::Spot { radius: r, .. }
            | LightKind::Disk { radius: r, .. } => r,
        }
    }

    /// True for a point light at the eye: points that it does not reach are invisible to camera
    /// rays from the eye. Mirrors, lenses and surfaces behind translucent ones can show its
    /// shadows.
    pub fn is_at_eye(&self) -> bool {
        if self.frame == LightFrame::World || self.size() > 0.0 {
            return false;
        }
        match self.kind {
            LightKind::Point { position, .. }
            | LightKind::Spot { position, .. }
            | LightKind::Cone { position, .. } => position == DVec3::ZERO,
            // An area is not a point, and parallel light has no position.
            LightKind::Ambient
            | LightKind::Directional { .. }
            | LightKind::Ring { .. }
            | LightKind::Disk { .. }
            | LightKind::Quad { .. } => false,
        }
    }

    /// True when its light follows the camera rays of `camera` that leave a pinhole: from the eye
    /// of a perspective, or parallel to the rays of a parallel projection. The first hit of such a
    /// ray is lit. Parallel light along the view does not qualify in perspective, where its shadows
    /// are visible next to their casters.
    pub(crate) fn follows_rays_of(&self, camera: &Camera) -> bool {
        if camera.eye().is_some() {
            return self.is_at_eye();
        }
        let LightKind::Directional { to_light, angular_radius_rad } = self.kind else {
            return false;
        };
        if self.frame == LightFrame::World || angular_radius_rad > 0.0 {
            return false;
        }
        // The viewing axis of a parallel projection is the direction of its rays.
        to_light.x == 0.0 && to_light.y == 0.0 && to_light.z > 0.0
    }

    /// True when its shadow rays can change an image.
    pub fn casts_shadows(&self) -> bool {
        self.shadows
            && !matches!(self.kind, LightKind::Ambient)
            && (self.color != [0.0; 3] || self.highlight_color.is_some_and(|c| c != [0.0; 3]))
    }
}

/// Share of a [`LightKind::Cone`]'s light at an angle with cosine `cos` to its axis.
#[inline(always)]
pub(crate) fn cone_share(cos: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cos >= cos_inner {
        1.0
    } else if cos <= cos_outer {
        0.0
    } else {
        (cos - cos_outer) / (cos_inner - cos_outer)
    }
}

/// A light in render space, prepared for shading.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ResolvedLight {
    pub(crate) kind: ResolvedLightKind,
    pub(crate) color: Vec3,
    pub(crate) highlight: Vec3,
    pub(crate) attenuation: Option<[f32; 3]>,
    pub(crate) size: f32,
    pub(crate) shadows: bool,
    /// Whether all first hits of camera rays are lit, see [`Light::follows_rays_of`].
    pub(crate) follows_camera_rays: bool,
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum ResolvedLightKind {
    Directional {
        to_light: Vec3,
    },
    Point {
        position: Vec3,
    },
    Spot {
        position: Vec3,
        direction: Vec3,
        cos_cutoff: f32,
        exponent: f32,
    },
    Cone {
        position: Vec3,
        direction: Vec3,
        cos_inner: f32,
        cos_outer: f32,
    },
    Disk {
        position: Vec3,
        direction: Vec3,
    },
    /// `hole`: inner radius over radius.
    Ring {
        position: Vec3,
        direction: Vec3,
        hole: f32,
        cos_inner: f32,
        cos_outer: f32,
    },
    /// The centre, half edges and the unit normal.
    Quad {
        position: Vec3,
        edges: [Vec3; 2],
        direction: Vec3,
        both_sides: bool,
    },
}

impl ResolvedLight {
    /// `light` for `camera`, whose rays go through a lens or a pinhole, in a render space with
    /// origin `origin`. `None` for ambient light, which has no position.
    pub(crate) fn new(
        light: &Light,
        camera: &Camera,
        lens: bool,
        origin: DVec3,
    ) -> Option<ResolvedLight> {
        let world_from_view: DMat3 = camera.world_from_view();
        let eye = camera.eye().unwrap_or_else(|| camera.world_ray([0.0, 0.0]).0);
        let vector = |v: DVec3| {
            let w = if light.frame == LightFrame::Camera { world_from_view * v } else { v };
            w.normalize_or_zero().as_vec3()
        };
        let point = |p: DVec3| {
            let w = if light.frame == LightFrame::Camera { eye + world_from_view * p } else { p };
            (w - origin).as_vec3()
        };
        let kind = match light.kind {
            LightKind::Ambient => return None,
            LightKind::Directional { to_light, .. } => {
                ResolvedLightKind::Directional { to_light: vector(to_light) }
            }
            LightKind::Point { position, .. } => {
                ResolvedLightKind::Point { position: point(position) }
            }
            LightKind::Spot { position, direction, cutoff_rad, exponent, .. } => {
                ResolvedLightKind::Spot {
                    position: point(position),
                    direction: vector(direction),
                    cos_cutoff: cutoff_rad.cos() as f32,
                    exponent: exponent as f32,
                }
            }
            LightKind::Cone { position, direction, inner_rad, outer_rad } => {
                ResolvedLightKind::Cone {
                    position: point(position),
                    direction: vector(direction),
                    cos_inner: inner_rad.cos() as f32,
                    cos_outer: outer_rad.cos() as f32,
                }
            }
            LightKind::Disk { position, direction, .. } => {
                ResolvedLightKind::Disk { position: point(position), direction: vector(direction) }
            }
            LightKind::Ring { position, direction, inner_radius, radius, inner_rad, outer_rad } => {
                ResolvedLightKind::Ring {
                    position: point(position),
                    direction: vector(direction),
                    hole: if radius > 0.0 { (inner_radius / radius) as f32 } else { 0.0 },
                    cos_inner: inner_rad.cos() as f32,
                    cos_outer: outer_rad.cos() as f32,
                }
            }
            LightKind::Quad { corner, edges: [a, b], both_sides } => {
                let turned = |v: DVec3| {
                    if light.frame == LightFrame::Camera { world_from_view * v } else { v }
                };
                ResolvedLightKind::Quad {
                    position: point(corner + 0.5 * (a + b)),
                    edges: [a, b].map(|e| (0.5 * turned(e)).as_vec3()),
                    // Scaled first: the product of two short edges may underflow.
                    direction: vector(a.normalize_or_zero().cross(b.normalize_or_zero())),
                    both_sides,
                }
            }
        };
        let directional = matches!(kind, ResolvedLightKind::Directional { .. });
        Some(ResolvedLight {
            kind,
            color: light.color.into(),
            highlight: light.highlight_color.unwrap_or(light.color).into(),
            attenuation: (!directional && light.attenuation != [1.0, 0.0, 0.0])
                .then_some(light.attenuation),
            size: light.size() as f32,
            shadows: light.casts_shadows(),
            follows_camera_rays: !lens && light.follows_rays_of(camera),
        })
    }
}
