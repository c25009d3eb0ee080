//! Chooses the camera of an image: a camera file, a data set's own view, or a view that fits the
//! subject.

use anyhow::Context as _;
use datasets::cli::CureExt as _;
use datasets::view::View;
use glam::DVec3;
use rt_core::bvh::World;
use rt_core::camera::Camera;
use rt_core::scene::Scene;
use serde::Deserialize;
use std::path::Path;

/// Position of the camera.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Framing {
    /// The whole subject just fits into the image, viewed from the front, slightly from the side
    /// and from above.
    #[default]
    Fitted,
    /// Like `Fitted`, but viewed from this direction (towards the eye, world space, any length).
    FittedFrom(DVec3),
    /// The given view.
    At(View),
    /// A parallel projection with this image height in world units.
    Parallel(View, f64),
}

/// A camera and the distance that is in focus.
#[derive(Debug, Clone, Copy)]
pub(super) struct FramedCamera {
    pub(super) camera: Camera,
    pub(super) focus_distance: f64,
}

/// Vertical angle of fitted cameras, degrees (VTK's default).
const FOV_DEGREES: f64 = 30.0;
/// Margin around a fitted subject.
const MARGIN: f64 = 1.04;

/// World corners of all geometry.
pub(super) fn bounds(scene: &Scene) -> anyhow::Result<(DVec3, DVec3)> {
    let extents = scene.volumes.iter().map(|v| v.volume.extent());
    let volumes = extents.map(|extent| (extent.origin, extent.max_corner()));
    let all = bounds_of_surfaces(&scene.world).into_iter().chain(volumes);
    corners(all.reduce(|(a, b), (c, d)| (a.min(c), b.max(d))))
}

fn bounds_of_surfaces(world: &World) -> Option<(DVec3, DVec3)> {
    let b = world.bounds();
    let world_from_box = |p: glam::Vec3| world.origin() + p.as_dvec3();
    (!b.is_empty()).then(|| (world_from_box(b.min), world_from_box(b.max)))
}

fn corners(found: Option<(DVec3, DVec3)>) -> anyhow::Result<(DVec3, DVec3)> {
    found.context("there is nothing to draw: no triangle, line or point that can be seen").cure(
        "look at the warnings above for what was left out; for image data, choose another \
               --isovalue",
    )
}

impl Framing {
    /// The camera for everything in a world, z up, for an image of `size` pixels.
    pub fn of(&self, world: &World, size: [u32; 2]) -> anyhow::Result<Camera> {
        let (lo, hi) = corners(bounds_of_surfaces(world))?;
        self.of_box(lo, hi, size)
    }

    /// The camera for all of a scene, its volumes too.
    ///
    /// # Errors
    /// As [`Framing::of`].
    pub fn of_scene(&self, scene: &Scene, size: [u32; 2]) -> anyhow::Result<Camera> {
        let (lo, hi) = bounds(scene)?;
        self.of_box(lo, hi, size)
    }

    fn of_box(&self, lo: DVec3, hi: DVec3, size: [u32; 2]) -> anyhow::Result<Camera> {
        let outline =
            |point: &mut dyn FnMut(DVec3)| corners_of_box(lo, hi).into_iter().for_each(point);
        let view = self.fitted(&outline, DVec3::Z, size);
        Ok(self.camera(view.as_ref(), lo, hi, size)?.camera)
    }

    /// The view of a fitted framing for the points of `outline`; `None` for the other framings.
    pub(super) fn fitted(&self, outline: &Outline<'_>, up: DVec3, size: [u32; 2]) -> Option<View> {
        let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
        match self {
            Framing::Fitted => Some(fit(outline, None, up, aspect)),
            Framing::FittedFrom(backward) => {
                Some(fit(outline, backward.try_normalize(), up, aspect))
            }
            Framing::At(_) | Framing::Parallel(..) => None,
        }
    }

    /// The camera for a subject between two corners. `fitted` is the result of [`Framing::fitted`].
    pub(super) fn camera(
        &self,
        fitted: Option<&View>,
        lo: DVec3,
        hi: DVec3,
        size: [u32; 2],
    ) -> anyhow::Result<FramedCamera> {
        let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
        let (view, height) = match self {
            Framing::Fitted | Framing::FittedFrom(_) => {
                (fitted.context("a fitted camera needs its subject's outline")?, None)
            }
            Framing::At(view) => (view, None),
            Framing::Parallel(view, height) => (view, Some(*height)),
        };
        let (eye, target) = (view.eye, view.target);
        let radius = ((hi - lo).length() * 0.5).max(1e-30);
        let middle = (lo + hi) * 0.5;
        let far = (middle - eye).length() + 1.01 * radius;
        let focus_distance = (target - eye).length();
        let camera = match height {
            Some(h) => Camera::orthographic(eye, target, view.up, h, aspect, [-far, far])?,
            None => {
                let near = ((middle - eye).length() - 1.01 * radius)
                    .max(1e-3 * radius.min(focus_distance));
                let fov = view.vertical_fov_degrees.to_radians();
                Camera::perspective(eye, target, view.up, fov, aspect, [near, far.max(2.0 * near)])?
            }
        };
        Ok(FramedCamera { camera, focus_distance })
    }
}

/// Calls its argument with every world point that must be visible in the image.
pub(super) type Outline<'a> = dyn Fn(&mut dyn FnMut(DVec3)) + 'a;

/// The corners of a box.
pub(super) fn corners_of_box(lo: DVec3, hi: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { lo[axis] } else { hi[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

/// The nearest view in which all points are visible, from `backward` or from the front. Flat
/// subjects are viewed face on.
fn fit(outline: &Outline<'_>, backward: Option<DVec3>, up: DVec3, aspect: f64) -> View {
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    outline(&mut |p| (lo, hi) = (lo.min(p), hi.max(p)));
    if !(lo.is_finite() && hi.is_finite()) {
        (lo, hi) = (DVec3::ZERO, DVec3::ZERO);
    }
    let (middle, extent) = ((lo + hi) * 0.5, hi - lo);
    let thin = extent.min_element() < 1e-4 * extent.max_element();
    let (backward, up) = if let Some(backward) = backward {
        (backward, up)
    } else if thin {
        let normal = match extent.to_array().iter().position(|&e| e == extent.min_element()) {
            Some(0) => DVec3::X,
            Some(1) => DVec3::NEG_Y,
            _ => DVec3::Z,
        };
        (normal, if normal.dot(up).abs() > 0.5 { other_up(normal) } else { up })
    } else {
        // Turned from the front and 25 degrees up, so that three faces of a box are visible.
        let front = if up.dot(DVec3::Y).abs() > 0.5 { DVec3::Z } else { DVec3::NEG_Y };
        let right = up.cross(front).normalize_or(DVec3::X);
        ((front + 0.55 * right + 0.5 * up).normalize(), up)
    };
    let right = up.cross(backward).normalize_or(DVec3::X);
    let true_up = backward.cross(right);

    // A point at (x, y, z), z towards the eye, is inside the image's right border when x - eye.x <=
    // tan (eye.z - z), and similarly for the other three borders. Each pair of borders requires a
    // smallest eye.z, and their middle is eye.x or eye.y.
    let tan = (0.5 * FOV_DEGREES).to_radians().tan() / MARGIN;
    let (tan_x, tan_y) = (tan * aspect, tan);
    let mut most = [f64::NEG_INFINITY; 4];
    let mut nearest = f64::NEG_INFINITY;
    outline(&mut |p| {
        let c = p - middle;
        let (x, y, z) = (c.dot(right), c.dot(true_up), c.dot(backward));
        let reach = [x + tan_x * z, tan_x * z - x, y + tan_y * z, tan_y * z - y];
        most = std::array::from_fn(|i| most[i].max(reach[i]));
        nearest = nearest.max(z);
    });
    if !nearest.is_finite() {
        (most, nearest) = ([0.0; 4], 0.0);
    }
    let [right_most, left_most, upper_most, lower_most] = most;
    let distance =
        (0.5 * (right_most + left_most) / tan_x).max(0.5 * (upper_most + lower_most) / tan_y);
    // Points, and lines viewed end on, have no extent to fit.
    let distance = distance.max(nearest + 1e-3 * extent.length()).max(1e-12);
    let mut shift = [0.5 * (right_most - left_most), 0.5 * (upper_most - lower_most)];

    // Along the axis with a margin to spare, centre the subject: find the outermost points as
    // slopes from the eye, each with its reciprocal distance, which is the change of the slope when
    // the eye moves.
    let mut ends = [[(f64::INFINITY, 0.0), (f64::NEG_INFINITY, 0.0)]; 2];
    outline(&mut |p| {
        let c = p - middle;
        let per_distance = 1.0 / (distance - c.dot(backward));
        for (axis, direction) in [right, true_up].into_iter().enumerate() {
            let slope = (c.dot(direction) - shift[axis]) * per_distance;
            let [low, high] = &mut ends[axis];
            if slope < low.0 {
                *low = (slope, per_distance);
            }
            if slope > high.0 {
                *high = (slope, per_distance);
            }
        }
    });
    for (axis, [low, high]) in ends.into_iter().enumerate() {
        let change = (low.0 + high.0) / (low.1 + high.1);
        shift[axis] += if change.is_finite() { change } else { 0.0 };
    }
    let target = middle + right * shift[0] + true_up * shift[1];
    View { up, ..View::new("fitted", target + backward * distance, target) }
}

/// An upward direction for an image viewed along the axis `normal`.
fn other_up(normal: DVec3) -> DVec3 {
    if normal.y.abs() > 0.5 { DVec3::Z } else { DVec3::Y }
}

/// A camera file, TOML or JSON.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    eye: [f64; 3],
    target: [f64; 3],
    #[serde(default = "z_up")]
    up: [f64; 3],
    #[serde(default = "default_fov")]
    vertical_fov_degrees: f64,
    parallel_height: Option<f64>,
}

fn z_up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
fn default_fov() -> f64 {
    FOV_DEGREES
}

/// Reads a camera: `eye` and `target` (world), optionally `up`, `vertical_fov_degrees`, or
/// `parallel_height` (world units) for a parallel projection. The format is TOML, or JSON for files
/// with that extension.
pub fn read_camera(path: &Path) -> anyhow::Result<Framing> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the camera file `{}`", path.display()))?;
    let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let parsed: anyhow::Result<CameraFile> = if is_json {
        serde_json::from_str(&text).map_err(Into::into)
    } else {
        toml::from_str(&text).map_err(Into::into)
    };
    let file = parsed.with_context(|| format!("`{}` is not a camera", path.display())).cure(
        "write for example: eye = [0, -5, 2], target = [0, 0, 0], up = [0, 0, 1], \
         vertical_fov_degrees = 30, one a line",
    )?;
    let view = View {
        up: file.up.into(),
        vertical_fov_degrees: file.vertical_fov_degrees,
        ..View::new("file", file.eye.into(), file.target.into())
    };
    Ok(match file.parallel_height {
        Some(h) => Framing::Parallel(view, h),
        None => Framing::At(view),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// NDC of a world point.
    fn ndc(camera: &Camera, p: DVec3) -> DVec3 {
        camera.clip_from_world().project_point3(p)
    }

    #[test]
    fn every_corner_of_any_box_is_in_a_fitted_image_and_one_nearly_at_its_edge() {
        for (lo, hi) in [
            (DVec3::splat(-1.0), DVec3::ONE),
            (DVec3::new(1e6, 0.0, 0.0), DVec3::new(1e6 + 9.0, 1.0, 2.0)),
            (DVec3::ZERO, DVec3::new(4.0, 2.0, 0.0)),
            (DVec3::ZERO, DVec3::new(0.0, 3.0, 1.0)),
            (DVec3::ZERO, DVec3::new(1.0, 0.0, 7.0)),
        ] {
            for (up, size) in [(DVec3::Z, [800, 200]), (DVec3::Y, [100, 400]), (DVec3::Z, [64, 64])]
            {
                for framing in [Framing::Fitted, Framing::FittedFrom(DVec3::new(3.0, -4.0, 2.0))] {
                    let corners = corners_of_box(lo, hi);
                    let outline =
                        |point: &mut dyn FnMut(DVec3)| corners.into_iter().for_each(point);
                    let view = framing.fitted(&outline, up, size);
                    let framed = framing.camera(view.as_ref(), lo, hi, size).unwrap();
                    let seen = corners.map(|p| ndc(&framed.camera, p));
                    let [most_x, most_y] =
                        [0, 1].map(|a| seen.iter().map(|c| c[a].abs()).fold(0.0, f64::max));
                    let most = most_x.max(most_y);
                    assert!((0.95..=1.0).contains(&most), "{lo} {hi} {up} {size:?}: {most}");
                    // Also centred along the other axis.
                    for a in [0, 1] {
                        let ends = seen
                            .iter()
                            .fold([f64::MAX, f64::MIN], |e, c| [e[0].min(c[a]), e[1].max(c[a])]);
                        assert!(
                            (ends[0] + ends[1]).abs() < 0.05,
                            "{lo} {hi} {up} {size:?}: axis {a} {ends:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn camera_files_are_toml_or_json_and_faults_name_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let toml = read_camera(&write("a.toml", "eye = [1, 2, 3]\ntarget = [0, 0, 0]\n")).unwrap();
        let json = read_camera(&write("a.json", r#"{"eye":[1,2,3],"target":[0,0,0]}"#)).unwrap();
        assert_eq!(toml, json);
        assert!(
            matches!(toml, Framing::At(v) if v.up == DVec3::Z && v.vertical_fov_degrees == 30.0)
        );
        let e = read_camera(&write("b.toml", "eye = [1, 2]\n")).unwrap_err();
        assert!(datasets::cli::report(&e).contains("b.toml"), "{e:?}");
        assert!(datasets::cli::report(&e).contains("cure"), "{e:?}");
    }
}
