//! Parses the options for absorption, emission and rotation of polarisation in the medium.

use super::units;
use crate::scene::MediaSpec;
use clap::Args;

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Light in the medium (a number can stand for an array)")]
pub(super) struct MediaArgs {
    /// Array with the absorption in 1/m
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    absorption: Option<String>,
    /// Array with the emission in 1/m: per metre of path, relative to undisturbed light without a
    /// cut-off
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    emission: Option<String>,
    /// Array with the rotation of the plane of polarisation in rad/m, counter-clockwise in the
    /// image
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    rotation: Option<String>,
    /// With --rotation: angle between an analyser behind the flow and the polariser before it
    /// [default:
    /// no analyser]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    analyser: Option<f64>,
    /// With --emission, schlieren: diameter of the stop in the cut-off plane that the medium's own
    /// light fills [default: 25mm]
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    stop: Option<f64>,
}

impl MediaArgs {
    pub(super) fn apply(&self, m: &mut MediaSpec) {
        let set = |to: &mut Option<String>, from: &Option<String>| {
            if from.is_some() {
                to.clone_from(from);
            }
        };
        set(&mut m.absorption, &self.absorption);
        set(&mut m.emission, &self.emission);
        set(&mut m.rotation, &self.rotation);
        m.analyser_deg = self.analyser.or(m.analyser_deg);
        m.stop_m = self.stop.or(m.stop_m);
    }
}
