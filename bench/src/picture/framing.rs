//! Where a picture is taken from: a camera file, a data set's own view, or one that fits the subject.

use anyhow::Context as _;
use datasets::cli::CureExt as _;
use datasets::view::View;
use glam::DVec3;
use rt_core::accel::World;
use rt_core::camera::Camera;
use serde::Deserialize;
use std::path::Path;

/// Where the camera stands.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Framing {
    /// So that the whole subject is in the picture, seen from the front, a little from the side and from above.
    #[default]
    Fitted,
    /// There.
    At(View),
    /// A parallel projection that shows so many world units from bottom to top.
    Parallel(View, f64),
}

/// A camera and the distance that is in focus.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    pub(super) camera: Camera,
    pub(super) focus_distance: f64,
}

/// Vertical angle of fitted cameras, degrees (VTK's default).
const FOV_DEGREES: f64 = 30.0;
/// Room around a fitted subject.
const MARGIN: f64 = 1.04;

/// World corners of everything that is drawn.
pub(super) fn bounds(world: &World) -> anyhow::Result<(DVec3, DVec3)> {
    let b = world.bounds();
    if b.is_empty() {
        return Err(anyhow::anyhow!("there is nothing to draw: no triangle, line or point that can be seen"))
            .cure(
                "look at the warnings above for what was left out; for image data, choose another --isovalue",
            );
    }
    Ok((world.origin() + b.min.as_dvec3(), world.origin() + b.max.as_dvec3()))
}

impl Framing {
    /// The camera for everything in a world, z up, in a picture of `size` pixels.
    pub fn of(&self, world: &World, size: [u32; 2]) -> anyhow::Result<Camera> {
        let (lo, hi) = bounds(world)?;
        Ok(self.camera(lo, hi, DVec3::Z, size)?.camera)
    }

    pub(super) fn camera(&self, lo: DVec3, hi: DVec3, up: DVec3, size: [u32; 2]) -> anyhow::Result<Placed> {
        let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
        let fitted;
        let (view, height) = match self {
            Framing::Fitted => {
                fitted = fit(lo, hi, up, aspect);
                (&fitted, None)
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
                let near = ((middle - eye).length() - 1.01 * radius).max(1e-3 * radius.min(focus_distance));
                let fov = view.vertical_fov_degrees.to_radians();
                Camera::perspective(eye, target, view.up, fov, aspect, [near, far.max(2.0 * near)])?
            }
        };
        Ok(Placed { camera, focus_distance })
    }
}

/// The nearest place from which all eight corners are in the picture. Flat subjects are seen face on.
fn fit(lo: DVec3, hi: DVec3, up: DVec3, aspect: f64) -> View {
    let (middle, extent) = ((lo + hi) * 0.5, hi - lo);
    let thin = extent.min_element() < 1e-4 * extent.max_element();
    let (backward, up) = if thin {
        let normal = match extent.to_array().iter().position(|&e| e == extent.min_element()) {
            Some(0) => DVec3::X,
            Some(1) => DVec3::NEG_Y,
            _ => DVec3::Z,
        };
        (normal, if normal.dot(up).abs() > 0.5 { other_up(normal) } else { up })
    } else {
        // A third of a turn off the front and 25 degrees up: three faces of a box show.
        let front = if up.dot(DVec3::Y).abs() > 0.5 { DVec3::Z } else { DVec3::NEG_Y };
        let right = up.cross(front).normalize_or(DVec3::X);
        ((front + 0.55 * right + 0.5 * up).normalize(), up)
    };
    let right = up.cross(backward).normalize_or(DVec3::X);
    let true_up = backward.cross(right);
    let tan = (0.5 * FOV_DEGREES).to_radians().tan();
    let distance = (0..8)
        .map(|corner| {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { lo[axis] } else { hi[axis] };
            let c = DVec3::new(pick(0), pick(1), pick(2)) - middle;
            let (x, y, z) = (c.dot(right).abs(), c.dot(true_up).abs(), c.dot(backward));
            z + MARGIN * (y / tan).max(x / (tan * aspect))
        })
        .fold(0.0, f64::max)
        .max(1e-12);
    View { up, ..View::new("fitted", middle + backward * distance, middle) }
}

/// An upward direction for a picture seen along `normal`, an axis.
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

/// Reads a camera: `eye` and `target` (world), and if wished `up`, `vertical_fov_degrees`, or `parallel_height` (world
/// units) for a parallel projection; as TOML, or as JSON when the name ends so.
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
        "write for example: eye = [0, -5, 2], target = [0, 0, 0], up = [0, 0, 1], vertical_fov_degrees = 30, one a line",
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
    fn every_corner_of_any_box_is_in_a_fitted_picture_and_one_nearly_at_its_edge() {
        for (lo, hi) in [
            (DVec3::splat(-1.0), DVec3::ONE),
            (DVec3::new(1e6, 0.0, 0.0), DVec3::new(1e6 + 9.0, 1.0, 2.0)),
            (DVec3::ZERO, DVec3::new(4.0, 2.0, 0.0)),
            (DVec3::ZERO, DVec3::new(0.0, 3.0, 1.0)),
            (DVec3::ZERO, DVec3::new(1.0, 0.0, 7.0)),
        ] {
            for (up, size) in [(DVec3::Z, [800, 200]), (DVec3::Y, [100, 400]), (DVec3::Z, [64, 64])] {
                let placed = Framing::Fitted.camera(lo, hi, up, size).unwrap();
                let corners = (0..8).map(|i| {
                    let pick = |a: usize| if i >> a & 1 == 0 { lo[a] } else { hi[a] };
                    ndc(&placed.camera, DVec3::new(pick(0), pick(1), pick(2)))
                });
                let most = corners.map(|c| c.x.abs().max(c.y.abs())).fold(0.0, f64::max);
                assert!((0.8..=1.0).contains(&most), "{lo} {hi} {up} {size:?}: {most}");
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
        assert!(matches!(toml, Framing::At(v) if v.up == DVec3::Z && v.vertical_fov_degrees == 30.0));
        let e = read_camera(&write("b.toml", "eye = [1, 2]\n")).unwrap_err();
        assert!(datasets::cli::report(&e).contains("b.toml"), "{e:?}");
        assert!(datasets::cli::report(&e).contains("cure"), "{e:?}");
    }
}
