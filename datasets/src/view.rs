//! Cameras as plain data, so that data sets can include their well-known views.

use glam::DVec3;

/// A pinhole camera.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Short name, unique within its data set.
    pub name: String,
    /// World position of the camera.
    pub eye: DVec3,
    /// World position at the centre of the image.
    pub target: DVec3,
    /// Upward direction in the image; not parallel to the viewing direction.
    pub up: DVec3,
    /// Angle between the image's lower and upper border, in degrees.
    pub vertical_fov_degrees: f64,
}

impl View {
    /// A view with z up and VTK's default angle of 30 degrees.
    pub fn new(name: &str, eye: DVec3, target: DVec3) -> Self {
        View { name: name.into(), eye, target, up: DVec3::Z, vertical_fov_degrees: 30.0 }
    }
}
