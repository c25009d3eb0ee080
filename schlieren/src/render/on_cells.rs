//! Plans light paths through the cells of a mesh: as few steps in each cell as the tolerance
//! allows.

use super::accuracy_warning::{ErrorPart, of_mesh, warning};
use super::planned::{Choice, PlannedPaths};
use crate::gas_on_cells::GasOnCells;
use crate::march::OnCells;
use crate::media::Bend;
use crate::path::{Exit, LightPaths, PathQuantities};
use crate::plan::{Request, compare, sample_starts};
use crate::view::View;
use std::collections::BTreeMap;

/// Numbers of steps in each cell that are tried.
const STEPS: [u32; 3] = [1, 2, 4];
/// Part of the mesh's own error below which an error of the march does not show.
const HIDDEN: f64 = 0.1;
/// Steps of the rays that measure the error, by those of the plan.
const FINER: u32 = 4;

/// How the steps in each cell are chosen.
#[derive(Debug, Clone, Copy)]
pub(super) enum Steps {
    /// One, without measuring.
    One,
    /// As few as keep the tolerance, by the error of so many rays against finer steps.
    Measured { rays: usize },
    /// What was chosen before.
    Known(u32),
}

/// Paths whose error is within the tolerance, if four steps in each cell reach it. More steps than
/// bring it to a tenth of the mesh's own error would not show.
pub(super) fn planned(
    gas: &GasOnCells,
    view: View,
    quantities: PathQuantities,
    tolerance_rad: f64,
    chosen: Steps,
) -> PlannedPaths<'_> {
    let (mut steps, mut error_rad, mut mesh_error_rad) = (STEPS[0], None, None);
    if let Steps::Known(known) = chosen {
        steps = known;
    }
    if let Steps::Measured { rays } = chosen {
        let starts = sample_starts(gas.size_m(), gas.centre_m(), &view, rays);
        let trace = |steps: u32| {
            let mut exits = vec![Exit::UNDISTURBED; starts.len()];
            OnCells::new(gas, view, quantities, steps).trace_parallel(&starts, &mut exits);
            exits
        };
        // Polynomials of another degree differ by the mesh's error; without polynomials, nothing
        // tells it.
        let of_mesh = |steps: u32, exits: &[Exit]| {
            let mut less = vec![Exit::UNDISTURBED; starts.len()];
            let paths = OnCells::new(gas, view, quantities, steps).with_second_degree();
            paths.trace_parallel(&starts, &mut less);
            compare(exits, &less).0
        };
        let has_polynomials = gas.cells().has_polynomials();
        let mut goal_rad = tolerance_rad;
        // Four steps measure one, and are measured themselves.
        let mut traced = BTreeMap::new();
        for tried in STEPS {
            for steps in [tried, FINER * tried] {
                traced.entry(steps).or_insert_with(|| trace(steps));
            }
            let (max_rad, _, _) = compare(&traced[&tried], &traced[&(FINER * tried)]);
            (steps, error_rad) = (tried, Some(max_rad));
            if has_polynomials && tolerance_rad > 0.0 {
                let mesh_rad = of_mesh(steps, &traced[&steps]);
                mesh_error_rad = Some(mesh_rad);
                goal_rad = (tolerance_rad - mesh_rad).max(HIDDEN * mesh_rad);
            }
            if max_rad <= goal_rad {
                break;
            }
        }
        if has_polynomials && mesh_error_rad.is_none() {
            mesh_error_rad = Some(of_mesh(steps, &traced[&steps]));
        }
    }
    let paths = OnCells::new(gas, view, quantities, steps);
    let per_cell = if steps == 1 { "one step".into() } else { format!("{steps} steps") };
    let (work, description) = (paths.work(), format!("verlet on cells, {per_cell} in each"));
    let request = Request { tolerance_rad, ..Request::default() };
    let mut planned =
        PlannedPaths::new(Box::new(paths), description, None, &request, (Bend::Full, 1.0));
    planned.choice = Some(Choice::Cells { steps });
    if let Some(rad) = error_rad {
        let cure = "values change within cells more than steps follow: use a finer mesh".to_owned();
        let steps = ErrorPart { what: "the march", rad, cure };
        planned.warnings.extend(warning([steps, of_mesh(mesh_error_rad)], tolerance_rad));
    }
    (planned.error_rad, planned.mesh_error_rad) = (error_rad, mesh_error_rad);
    planned.cell_work = Some(work);
    planned
}
