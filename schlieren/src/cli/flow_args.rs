//! Parses the options that give the flow's arrays their meaning, and applies them to the scene.

use super::units::{self, Smoothing};
use crate::index::conditions::Model;
use crate::index::multifield::Rule;
use crate::input::{Outside, Role};
use crate::scene::{CurveSpec, FlowSpec, Scene};
use clap::Args;
use datasets::cli::UsageError;
use datasets::resample::Reconstruction;
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Flow (a number can stand for an array)")]
pub(super) struct FlowArgs {
    /// Array with the density in kg/m³
    #[arg(long, value_name = "NAME")]
    density: Option<String>,
    /// kg/m³ per unit of the density array, for densities relative to a free stream
    #[arg(long, value_name = "NUMBER")]
    density_unit: Option<f64>,
    /// Array with the temperature in K
    #[arg(long, value_name = "NAME")]
    temperature: Option<String>,
    /// Added to the temperature: 273.15 when it is in C
    #[arg(long, value_name = "KELVIN", allow_hyphen_values = true)]
    temperature_zero: Option<f64>,
    /// Array with the pressure in Pa, or one value for the whole field
    #[arg(long, value_name = "NAME")]
    pressure: Option<String>,
    /// Pa per unit of the pressure array
    #[arg(long, value_name = "NUMBER")]
    pressure_unit: Option<f64>,
    /// Added to the pressure in Pa: 101325 when it is relative to the atmosphere
    #[arg(long, value_name = "PA", allow_hyphen_values = true)]
    pressure_zero: Option<f64>,
    /// Array with the relative humidity, 0 to 1
    #[arg(long, value_name = "NAME")]
    humidity: Option<String>,
    /// CO2 in ppm
    #[arg(long, value_name = "NUMBER")]
    co2_ppm: Option<String>,
    /// Array with n - 1
    #[arg(long, value_name = "NAME")]
    n_minus_1: Option<String>,
    /// Array with free electrons per m³
    #[arg(long, value_name = "NAME")]
    electrons: Option<String>,
    /// Array with the mass fraction of a gas; may be repeated
    #[arg(long, value_name = "NAME=GAS", value_parser = units::species)]
    species: Vec<(String, String)>,
    /// Transfer function from an array to n - 1, linear between its points; may be repeated, one
    /// per array. Illustration, not physics
    #[arg(long, value_name = "NAME=VALUE:N,...", value_parser = units::curve, allow_hyphen_values = true)]
    curve: Vec<(String, Vec<[f64; 2]>)>,
    /// Factor of an array's transfer function; 0 disables it
    #[arg(long, value_name = "NAME=NUMBER", value_parser = units::weight, allow_hyphen_values = true)]
    curve_weight: Vec<(String, f64)>,
    /// How transfer functions combine: sum, or largest
    #[arg(long, value_name = "RULE", value_parser = units::rule)]
    curve_rule: Option<Rule>,
    /// Metres per unit of the file's coordinates
    #[arg(long, value_name = "METRES", value_parser = units::length)]
    length_unit: Option<f64>,
    /// Distance between the points of a file that does not say it (NumPy, raw, NRRD, MetaImage,
    /// NetCDF without coordinates), in units of the file
    #[arg(long, value_name = "DX,DY,DZ", value_parser = units::three)]
    spacing: Option<[f64; 3]>,
    /// Position of the first point of such a file
    #[arg(long, value_name = "X,Y,Z", value_parser = units::three, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// For a table of points in no order (.csv .tsv .txt): how many times as wide as the cells
    /// around it a place without points is a hole; `inf` keeps the whole convex hull [default: 2.7]
    #[arg(long, value_name = "SPACINGS")]
    gap: Option<f64>,
    /// Depth of two-dimensional data, in units of the file
    #[arg(long, value_name = "NUMBER")]
    span: Option<f64>,
    /// Two-dimensional data are half of an axisymmetric flow
    #[arg(long, conflicts_with = "span")]
    revolve: bool,
    /// Trace light through the cells of the mesh themselves, without a lattice
    #[arg(long)]
    on_cells: bool,
    /// Nodes along the longest axis when data are resampled
    #[arg(long, value_name = "N")]
    resample: Option<usize>,
    /// Samples per axis of which each node is the mean when data are resampled, 1 to 8
    #[arg(long, value_name = "N", value_parser = units::resample_samples)]
    resample_samples: Option<usize>,
    /// Values between the points of a mesh: cubic (smooth, of fourth order) or linear (as VTK's)
    #[arg(long, value_name = "HOW", value_parser = units::reconstruction)]
    reconstruction: Option<Reconstruction>,
    /// Standard deviation of the smoothing of shocks, in nodes; or auto: jumps from one node to the
    /// next become averages over cells, which shocks sampled at points need
    #[arg(long, value_name = "NODES|auto", value_parser = units::smoothing)]
    smoothing: Option<Smoothing>,
    /// What is outside the mesh: auto (behind walls a body, behind an open border gas), or blank,
    /// solid (a body) or gas (as beside it) everywhere [default: auto]
    #[arg(long, value_name = "ROLE", value_parser = units::outside)]
    outside: Option<Outside>,
    /// Role of cells hidden by the solver: blank, solid or gas
    #[arg(long, value_name = "ROLE", value_parser = units::role)]
    hidden: Option<Role>,
    /// Body that blocks light (OBJ, STL, PLY, glTF, VTP); may be repeated
    #[arg(long, value_name = "FILE")]
    solid: Vec<PathBuf>,
}

impl FlowArgs {
    /// Changes the scene's flow and bodies. The meaning of arrays is validated with the scene.
    pub(super) fn apply(&self, s: &mut Scene) -> Result<(), UsageError> {
        let a = self;
        s.solids.files.extend(a.solid.iter().cloned());
        let f = &mut s.flow;
        // A medium on the command line replaces that of the file. Transfer functions are added to
        // those of the file.
        let by_curves = !a.curve.is_empty() && f.multifield.is_none();
        let by_state = a.density.is_some() || a.temperature.is_some();
        if by_curves || by_state || a.n_minus_1.is_some() || a.electrons.is_some() {
            *f = FlowSpec {
                model: if by_state { f.model } else { Model::Auto },
                reference_n_minus_1: f.reference_n_minus_1,
                ..f.without_medium()
            };
        }
        let set = |to: &mut Option<String>, from: &Option<String>| {
            if from.is_some() {
                to.clone_from(from);
            }
        };
        set(&mut f.density, &a.density);
        set(&mut f.temperature, &a.temperature);
        set(&mut f.pressure, &a.pressure);
        set(&mut f.humidity, &a.humidity);
        set(&mut f.co2_ppm, &a.co2_ppm);
        set(&mut f.n_minus_1, &a.n_minus_1);
        set(&mut f.electrons, &a.electrons);
        f.species.extend(a.species.iter().cloned());
        f.density_unit_kg_m3 = a.density_unit.or(f.density_unit_kg_m3);
        f.temperature_zero_k = a.temperature_zero.or(f.temperature_zero_k);
        f.pressure_unit_pa = a.pressure_unit.or(f.pressure_unit_pa);
        f.pressure_zero_pa = a.pressure_zero.or(f.pressure_zero_pa);
        f.spacing = a.spacing.or(f.spacing);
        f.origin = a.origin.or(f.origin);
        f.gap = a.gap.or(f.gap);
        f.length_unit_m = a.length_unit.unwrap_or(f.length_unit_m);
        f.span = a.span.or(f.span.filter(|_| !a.revolve));
        f.revolve = a.revolve || (f.revolve && a.span.is_none());
        f.on_cells |= a.on_cells;
        f.resample_nodes = a.resample.or(f.resample_nodes);
        f.resample_samples = a.resample_samples.unwrap_or(f.resample_samples);
        f.reconstruction = a.reconstruction.unwrap_or(f.reconstruction);
        match a.smoothing {
            Some(Smoothing::Auto) => f.average_jumps = true,
            Some(Smoothing::Nodes(nodes)) => {
                (f.smoothing_nodes, f.average_jumps) = (nodes, false);
            }
            None => {}
        }
        f.outside = a.outside.unwrap_or(f.outside);
        f.hidden = a.hidden.unwrap_or(f.hidden);
        self.apply_curves(f)
    }

    fn apply_curves(&self, f: &mut FlowSpec) -> Result<(), UsageError> {
        if !self.curve.is_empty() {
            f.multifield.get_or_insert_default();
        }
        let Some(multifield) = &mut f.multifield else {
            let flag = if self.curve_rule.is_some() { "--curve-rule" } else { "--curve-weight" };
            return match self.curve_rule.is_some() || !self.curve_weight.is_empty() {
                true => Err(UsageError(format!(
                    "{flag} has no effect without transfer functions; give --curve"
                ))),
                false => Ok(()),
            };
        };
        for (i, (name, knots)) in self.curve.iter().enumerate() {
            if self.curve[..i].iter().any(|c| c.0 == *name) {
                return Err(UsageError(format!(
                    "--curve {name} is given twice; an array has one transfer function"
                )));
            }
            // A curve that replaces one of the scene file keeps its weight.
            let weight = multifield.fields.get(name).map_or(1.0, |c| c.weight);
            multifield.fields.insert(name.clone(), CurveSpec { knots: knots.clone(), weight });
        }
        for (name, weight) in &self.curve_weight {
            let Some(curve) = multifield.fields.get_mut(name) else {
                let names: Vec<&str> = multifield.fields.keys().map(String::as_str).collect();
                return Err(UsageError(format!(
                    "--curve-weight {name}: this array has no transfer function; known: {}",
                    names.join(", ")
                )));
            };
            curve.weight = *weight;
        }
        multifield.rule = self.curve_rule.unwrap_or(multifield.rule);
        Ok(())
    }
}
