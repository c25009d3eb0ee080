//! Cameras: any OpenGL projection · view matrix in f64, with an optional thin lens.
//!
//! A pixel's ray needs only three rows of the matrix. With `clip = M (world, 1)`, a perspective ray
//! is `eye + t D(x, y)` where `D` solves *clip x, y, w of a direction = (x, y, 1)*. So `t` is clip
//! w (for the usual matrices: eye depth), and the near and far rows are not used: a far/near ratio
//! of 1e9 does not reduce the accuracy of rays. A parallel ray uses rows x, y, z in the same way,
//! with `t` in clip z. Pixel centres are OpenGL's; **row 0 is the top row**.

use glam::{DMat3, DMat4, DVec3, DVec4};

/// A thin lens: points at the focus distance are sharp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThinLens {
    /// Radius of the aperture, world units; 0 for a pinhole.
    pub aperture_radius: f64,
    /// Distance of the plane in focus from the eye along the viewing direction, world units.
    pub focus_distance: f64,
}

/// Why a camera cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// NaN or infinity in an argument.
    #[error("camera {field} is {value}; every component must be finite")]
    NotFinite {
        /// The argument.
        field: &'static str,
        /// The value, as text.
        value: String,
    },
    /// The matrix maps the image plane onto a line or a point.
    #[error(
        "camera matrix is singular (rows x, y and {third} have determinant {determinant}); check \
         that eye and target differ, that up is not along the view, and that the picture has an \
         extent"
    )]
    Singular {
        /// "w" for perspective, "z" for parallel projection.
        third: &'static str,
        /// The determinant.
        determinant: f64,
    },
    /// A number outside its range.
    #[error("camera {field} is {value}; it must be {rule}")]
    OutOfRange {
        /// The argument.
        field: &'static str,
        /// The value.
        value: f64,
        /// What is allowed.
        rule: &'static str,
    },
    /// A lens on a parallel projection or a panorama.
    #[error(
        "a thin lens needs a perspective camera; this one is a parallel projection or a panorama: \
         leave the lens out"
    )]
    LensOnParallel,
}

/// Where the rays of a camera come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Projection {
    /// All rays start at the eye.
    Perspective {
        /// World position.
        eye: DVec3,
    },
    /// All rays have this direction, scaled to one unit of clip z (before division by the constant
    /// w).
    Parallel {
        /// World direction.
        dir: DVec3,
    },
    /// All rays start at the eye and go all around: longitude over the width, latitude over the
    /// height.
    Omnidirectional {
        /// World position.
        eye: DVec3,
        /// Right, up and backward.
        axes: DMat3,
        /// NDC of the image's lower left and upper right corner in the whole panorama.
        region: [[f64; 2]; 2],
    },
}

/// A camera. The module documentation describes its conventions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    pub(crate) clip_from_world: DMat4,
    /// Inverse of rows (x, y, w) or (x, y, z), columns 0..3.
    pub(crate) inverse: DMat3,
    pub(crate) projection: Projection,
    depth_range: [f64; 2],
    lens: Option<ThinLens>,
    viewer: Option<DVec3>,
    pub(crate) near_far_clipping: bool,
}

impl Camera {
    /// A camera with OpenGL's `projection * view` (clip from world): any perspective or parallel
    /// projection, also off-axis or tiled.
    ///
    /// ```
    /// use rt_core::{camera::Camera, glam::{DMat4, DVec3, dmat4, dvec4}};
    /// let view = DMat4::from_translation(DVec3::new(0.0, 0.0, -5.0));
    /// // glFrustum(-1, 2, -1, 1, 1, 100): off-axis.
    /// let frustum = dmat4(dvec4(2.0 / 3.0, 0.0, 0.0, 0.0), dvec4(0.0, 1.0, 0.0, 0.0),
    ///                     dvec4(1.0 / 3.0, 0.0, -101.0 / 99.0, -1.0), dvec4(0.0, 0.0, -200.0 / 99.0, 0.0));
    /// let camera = Camera::from_matrix(frustum * view).unwrap();
    /// assert!((camera.eye().unwrap() - DVec3::new(0.0, 0.0, 5.0)).length() < 1e-14);
    /// ```
    pub fn from_matrix(clip_from_world: DMat4) -> Result<Camera, CameraError> {
        let m = clip_from_world;
        if !m.is_finite() {
            return Err(CameraError::NotFinite { field: "matrix", value: format!("{m:?}") });
        }
        let rows = [m.row(0), m.row(1), m.row(2), m.row(3)];
        let parallel = rows[3].truncate() == DVec3::ZERO;
        let (third, name) = if parallel { (rows[2], "z") } else { (rows[3], "w") };
        let a =
            DMat3::from_cols(rows[0].truncate(), rows[1].truncate(), third.truncate()).transpose();
        let determinant = a.determinant();
        // Relative to the rows' lengths (Hadamard's bound), so that the unit of length does not
        // matter.
        let bound =
            rows[0].truncate().length() * rows[1].truncate().length() * third.truncate().length();
        let usable = determinant.is_finite()
            && determinant.abs() > 1e-14 * bound
            && (!parallel || rows[3].w != 0.0);
        if !usable {
            return Err(CameraError::Singular { third: name, determinant });
        }
        let inverse = a.inverse();
        let offset = DVec3::new(rows[0].w, rows[1].w, third.w);
        let projection = if parallel {
            Projection::Parallel { dir: inverse * DVec3::new(0.0, 0.0, rows[3].w) }
        } else {
            Projection::Perspective { eye: refine(a, inverse, -offset) }
        };
        Ok(Camera {
            clip_from_world,
            inverse,
            projection,
            depth_range: [0.0, 1.0],
            lens: None,
            viewer: None,
            near_far_clipping: true,
        })
    }

    /// A symmetric perspective camera (gluPerspective · gluLookAt). `fov_y_rad` is the full
    /// vertical angle, `aspect` width / height.
    pub fn perspective(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        fov_y_rad: f64,
        aspect: f64,
        [near, far]: [f64; 2],
    ) -> Result<Camera, CameraError> {
        let pi = std::f64::consts::PI;
        in_range(
            "fov_y_rad",
            fov_y_rad,
            fov_y_rad > 0.0 && fov_y_rad < pi,
            "above 0 and below pi (radians)",
        )?;
        in_range(
            "aspect",
            aspect,
            aspect > 0.0 && aspect.is_finite(),
            "positive and finite (width / height)",
        )?;
        in_range("near", near, near > 0.0 && near.is_finite(), "positive and finite")?;
        in_range("far", far, far > near, "larger than near (infinity is allowed)")?;
        let f = 1.0 / (0.5 * fov_y_rad).tan();
        let (a, b) = if far.is_finite() {
            ((far + near) / (near - far), 2.0 * far * near / (near - far))
        } else {
            (-1.0, -2.0 * near)
        };
        let projection = DMat4::from_cols(
            DVec4::new(f / aspect, 0.0, 0.0, 0.0),
            DVec4::new(0.0, f, 0.0, 0.0),
            DVec4::new(0.0, 0.0, a, -1.0),
            DVec4::new(0.0, 0.0, b, 0.0),
        );
        Camera::from_matrix(projection * view(eye, target, up)?)
    }

    /// A parallel camera (glOrtho · gluLookAt); `height` is the world height of the image.
    pub fn orthographic(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        height: f64,
        aspect: f64,
        [near, far]: [f64; 2],
    ) -> Result<Camera, CameraError> {
        in_range("height", height, height > 0.0 && height.is_finite(), "positive and finite")?;
        in_range(
            "aspect",
            aspect,
            aspect > 0.0 && aspect.is_finite(),
            "positive and finite (width / height)",
        )?;
        in_range("near", near, near.is_finite(), "finite")?;
        in_range("far", far, far > near && far.is_finite(), "finite and larger than near")?;
        let projection = DMat4::from_cols(
            DVec4::new(2.0 / (height * aspect), 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 / height, 0.0, 0.0),
            DVec4::new(0.0, 0.0, -2.0 / (far - near), 0.0),
            DVec4::new(0.0, 0.0, -(far + near) / (far - near), 1.0),
        );
        Camera::from_matrix(projection * view(eye, target, up)?)
    }

    /// A camera that sees in all directions: an equirectangular panorama with `target` in its
    /// middle. `region` is the part of the panorama that fills the image, from the lower left
    /// (`[[0, 0], [1, 1]]` for all of it). Window depth is 1 - 1 / (1 + distance). Near and far
    /// planes clip nothing, and [`Camera::clip_from_world`] is that of a right angle ahead.
    pub fn omnidirectional(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        region: [[f64; 2]; 2],
    ) -> Result<Camera, CameraError> {
        let ahead = Camera::perspective(
            eye,
            target,
            up,
            std::f64::consts::FRAC_PI_2,
            1.0,
            [1.0, f64::INFINITY],
        )?;
        for (field, low, high) in
            [("region.x", region[0][0], region[1][0]), ("region.y", region[0][1], region[1][1])]
        {
            in_range(field, low, low.is_finite(), "finite")?;
            in_range(
                field,
                high,
                high.is_finite() && high != low,
                "finite, and the two ends must differ",
            )?;
        }
        let region = region.map(|corner| corner.map(|v| 2.0 * v - 1.0));
        let projection = Projection::Omnidirectional { eye, axes: ahead.world_from_view(), region };
        Ok(Camera { projection, near_far_clipping: false, ..ahead })
    }

    /// The same camera with a lens. Returns an error for parallel projections and for lenses
    /// without a positive focus distance.
    pub fn with_lens(self, lens: ThinLens) -> Result<Camera, CameraError> {
        if !matches!(self.projection, Projection::Perspective { .. }) {
            return Err(CameraError::LensOnParallel);
        }
        let (a, f) = (lens.aperture_radius, lens.focus_distance);
        in_range("lens.aperture_radius", a, a >= 0.0 && a.is_finite(), "0 or positive, finite")?;
        in_range("lens.focus_distance", f, f > 0.0 && f.is_finite(), "positive and finite")?;
        Ok(Camera { lens: Some(lens), ..self })
    }

    /// The same camera with OpenGL's glDepthRange (default 0 to 1): window depth of the near and
    /// the far plane.
    pub fn with_depth_range(self, depth_range: [f64; 2]) -> Camera {
        Camera { depth_range, ..self }
    }

    /// The same camera with the viewer at a world position, for the light that surfaces reflect
    /// towards it: highlights, and lights that the viewer carries. Without one, that is where each
    /// ray comes from. Rasterizers put a viewer into parallel projections too: OpenGL with
    /// `GL_LIGHT_MODEL_LOCAL_VIEWER` (OpenGL 2.1, section 2.14.1), VTK always. Mirrors and glass
    /// keep to the rays.
    pub fn with_viewer(self, viewer: Option<DVec3>) -> Camera {
        Camera { viewer, ..self }
    }

    /// The viewer's position, if the camera was [given one](Self::with_viewer).
    pub fn viewer(&self) -> Option<DVec3> {
        self.viewer
    }

    /// Checks the values whose setters do not check them.
    pub(crate) fn check(&self) -> Result<(), CameraError> {
        let ends = self.depth_range;
        for (field, end) in [("depth_range[0]", ends[0]), ("depth_range[1]", ends[1])] {
            in_range(field, end, end.is_finite(), "finite (OpenGL's are 0 to 1)")?;
        }
        for v in self.viewer.iter().flat_map(|v| v.to_array()) {
            in_range("viewer", v, v.is_finite(), "finite in every component")?;
        }
        Ok(())
    }

    /// Whether surfaces before the near plane and behind the far plane are clipped, as in OpenGL
    /// (default: yes).
    pub fn with_near_far_clipping(self, near_far_clipping: bool) -> Camera {
        Camera { near_far_clipping, ..self }
    }

    /// The lens, if any.
    pub fn lens(&self) -> Option<ThinLens> {
        self.lens
    }

    /// The matrix, clip from world.
    pub fn clip_from_world(&self) -> DMat4 {
        self.clip_from_world
    }

    /// World position of the eye; `None` for parallel projections.
    pub fn eye(&self) -> Option<DVec3> {
        match self.projection {
            Projection::Perspective { eye } | Projection::Omnidirectional { eye, .. } => Some(eye),
            Projection::Parallel { .. } => None,
        }
    }

    /// Unit viewing direction: normal of the image plane, away from the viewer.
    pub fn forward(&self) -> DVec3 {
        match self.projection {
            Projection::Perspective { .. } | Projection::Omnidirectional { .. } => {
                self.clip_from_world.row(3).truncate().normalize()
            }
            Projection::Parallel { dir } => dir.normalize(),
        }
    }

    /// Right, up and backward as unit columns: world from OpenGL's eye space, without the eye's
    /// position.
    pub fn world_from_view(&self) -> DMat3 {
        let back = -self.forward();
        let x = self.inverse.x_axis;
        let right = (x - back * back.dot(x)).normalize();
        DMat3::from_cols(right, back.cross(right), back)
    }

    /// OpenGL's window depth of a world point: 0 (near) to 1 (far) unless another depth range is
    /// set. One f64 evaluation of matrix rows z and w; round it to f32 for a depth buffer.
    #[inline(always)]
    pub fn window_depth(&self, world: DVec3) -> f64 {
        let (z, w) = (self.clip_from_world.row(2), self.clip_from_world.row(3));
        let ndc = (z.truncate().dot(world) + z.w) / (w.truncate().dot(world) + w.w);
        let [near, far] = self.depth_range;
        near + (far - near) * (0.5 * ndc + 0.5)
    }

    /// True for panoramas ([`Camera::omnidirectional`]).
    pub fn is_omnidirectional(&self) -> bool {
        matches!(self.projection, Projection::Omnidirectional { .. })
    }

    /// Window depth of a point at `distance` from the eye of a panorama.
    pub(crate) fn panorama_depth(&self, distance: f64) -> f64 {
        let [near, far] = self.depth_range;
        near + (far - near) * (1.0 - 1.0 / (1.0 + distance))
    }

    /// Window depth of the background: that of the far plane.
    pub fn background_depth(&self) -> f64 {
        self.depth_range[1]
    }

    /// NDC of the point (`x`, `y`) of an image of `size` pixels; pixel centres are at +0.5, y grows
    /// downwards.
    #[inline]
    pub fn ndc_of_pixel(x: f64, y: f64, size: [u32; 2]) -> [f64; 2] {
        [2.0 * x / size[0] as f64 - 1.0, 1.0 - 2.0 * y / size[1] as f64]
    }

    /// The world ray through NDC (`x`, `y`) as origin and direction, parametrized as in the module
    /// documentation: clip w for perspective, clip z + w over w (0 at the near plane, 2 at the far
    /// plane) for parallel projections.
    #[inline]
    pub fn world_ray(&self, [x, y]: [f64; 2]) -> (DVec3, DVec3) {
        match self.projection {
            Projection::Perspective { eye } => (eye, self.inverse * DVec3::new(x, y, 1.0)),
            Projection::Omnidirectional { eye, axes, region: [low, high] } => {
                let at = |v: f64, i: usize| low[i] + (high[i] - low[i]) * (0.5 * v + 0.5);
                let (longitude, latitude) =
                    (at(x, 0) * std::f64::consts::PI, at(y, 1) * std::f64::consts::FRAC_PI_2);
                let level = latitude.cos();
                (
                    eye,
                    axes * DVec3::new(
                        level * longitude.sin(),
                        latitude.sin(),
                        -level * longitude.cos(),
                    ),
                )
            }
            Projection::Parallel { dir } => {
                let m = &self.clip_from_world;
                let w = m.row(3).w;
                let clip = DVec3::new(x * w - m.row(0).w, y * w - m.row(1).w, -w - m.row(2).w);
                (self.inverse * clip, dir)
            }
        }
    }

    /// Ray parameters of the near and far planes along [`Camera::world_ray`]; without clipping,
    /// everything in front of the eye.
    pub(crate) fn near_far(&self, origin: DVec3, dir: DVec3) -> [f64; 2] {
        let parallel = matches!(self.projection, Projection::Parallel { .. });
        if !self.near_far_clipping {
            return if parallel {
                [f64::NEG_INFINITY, f64::INFINITY]
            } else {
                [0.0, f64::INFINITY]
            };
        }
        if parallel {
            return [0.0, 2.0];
        }
        // clip z(t) = z0 + t z1 and w(t) = t: the near plane is z = -w, the far plane z = w.
        let z = self.clip_from_world.row(2);
        let z0 = z.truncate().dot(origin) + z.w;
        let z1 = z.truncate().dot(dir);
        let near = -z0 / (1.0 + z1);
        let far = z0 / (1.0 - z1);
        // No positive crossing: the plane is at infinity (or the matrix has none).
        [if near > 0.0 { near } else { 0.0 }, if far > 0.0 { far } else { f64::INFINITY }]
    }
}

/// `inverse * rhs` with one step of iterative refinement, for eyes far from the origin.
fn refine(a: DMat3, inverse: DMat3, rhs: DVec3) -> DVec3 {
    let x = inverse * rhs;
    x + inverse * (rhs - a * x)
}

fn in_range(
    field: &'static str,
    value: f64,
    ok: bool,
    rule: &'static str,
) -> Result<(), CameraError> {
    if ok { Ok(()) } else { Err(CameraError::OutOfRange { field, value, rule }) }
}

/// View matrix from world, right-handed, with the arguments checked.
fn view(eye: DVec3, target: DVec3, up: DVec3) -> Result<DMat4, CameraError> {
    for (field, v) in [("eye", eye), ("target", target), ("up", up)] {
        if !v.is_finite() {
            return Err(CameraError::NotFinite { field, value: v.to_string() });
        }
    }
    let forward = (target - eye).normalize_or_zero();
    let side = forward.cross(up.normalize_or_zero());
    let length = side.length();
    let rule = "not 0: eye and target must differ, and up must not lie along the view";
    in_range("sine between view and up", length, length > 1e-12, rule)?;
    let right = side / length;
    let up = right.cross(forward);
    Ok(DMat4::from_cols(
        DVec4::new(right.x, up.x, -forward.x, 0.0),
        DVec4::new(right.y, up.y, -forward.y, 0.0),
        DVec4::new(right.z, up.z, -forward.z, 0.0),
        DVec4::new(-right.dot(eye), -up.dot(eye), forward.dot(eye), 1.0),
    ))
}
