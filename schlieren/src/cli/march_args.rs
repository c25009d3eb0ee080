//! Parses the options that all pictures have, whatever their technique: the view, the frame, and
//! how light is traced.

use super::units;
use crate::scene::{Device, Direction, Scene};
use clap::Args;
use datasets::cli::UsageError;

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "View")]
pub(super) struct ViewArgs {
    /// x, y, z, or azimuth and elevation of the light in degrees
    #[arg(long, value_name = "x|y|z|AZ,EL", allow_hyphen_values = true)]
    view: Option<Direction>,
    /// Vacuum wavelengths in nm, separated by commas; each is traced by itself
    #[arg(long, value_name = "NM", value_delimiter = ',')]
    wavelength: Vec<f64>,
}

impl ViewArgs {
    pub(super) fn apply(&self, s: &mut Scene) {
        s.view.direction = self.view.unwrap_or(s.view.direction);
        if !self.wavelength.is_empty() {
            s.light.wavelengths_nm.clone_from(&self.wavelength);
            s.light.weights.clear();
        }
    }
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Frame")]
pub(super) struct FrameArgs {
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", value_parser = units::size)]
    pub(super) size: Option<[u32; 2]>,
    /// Width of the field of view [default: the whole field]
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    field_of_view: Option<f64>,
}

impl FrameArgs {
    #[cfg(feature = "serve")]
    pub(super) fn is_given(&self) -> bool {
        self.size.is_some() || self.field_of_view.is_some()
    }

    pub(super) fn apply(&self, s: &mut Scene) {
        s.film.size = self.size.unwrap_or(s.film.size);
        s.film.field_of_view_m = self.field_of_view.or(s.film.field_of_view_m);
    }
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Accuracy")]
pub(super) struct MarchArgs {
    /// Largest error of a deflection: 1e-7rad, 0.1urad
    #[arg(long, value_name = "ANGLE", value_parser = units::angle_rad)]
    tolerance: Option<f64>,
    /// Force a march: line-of-sight, verlet, euler, pefrl, sharma, rk4
    #[arg(long, value_name = "NAME")]
    march: Option<String>,
    /// Force an interpolant: b-spline, trilinear, trilinear-gradient
    #[arg(long, value_name = "NAME")]
    interpolant: Option<String>,
    /// Force a step, in voxels
    #[arg(long, value_name = "VOXELS")]
    step: Option<f64>,
    /// Skip gas so uniform that no ray's deflection changes by more than this in total: 1e-9rad.
    /// For verlet
    #[arg(long, value_name = "ANGLE", value_parser = units::angle_rad)]
    skip: Option<f64>,
    /// Where to trace: gpu needs a Vulkan device; auto uses one if possible, else warns why
    #[arg(long, value_enum, value_name = "DEVICE")]
    device: Option<Device>,
}

impl MarchArgs {
    pub(super) fn apply(&self, s: &mut Scene) -> Result<(), UsageError> {
        let a = self;
        s.march.tolerance_rad = a.tolerance.unwrap_or(s.march.tolerance_rad);
        if a.march.is_some() {
            s.march.method.clone_from(&a.march);
        }
        if a.interpolant.is_some() {
            s.march.interpolant.clone_from(&a.interpolant);
        }
        s.march.step_voxels = a.step.or(s.march.step_voxels);
        s.march.skip_rad = a.skip.unwrap_or(s.march.skip_rad);
        s.march.device = a.device.unwrap_or(s.march.device);
        crate::render::check_gpu(&s.march).map_err(|e| UsageError(format!("--device gpu: {e}")))
    }
}
