//! The warning that deflections are off by more than the tolerance: by how much, what makes the
//! error, and what helps.

use crate::plan::{MeasuredError, Request};

/// Parts of the error below this share of it are not named.
const NAMED: f64 = 0.1;

/// What makes an error, and what helps.
pub(super) struct ErrorPart {
    pub(super) what: &'static str,
    pub(super) rad: f64,
    pub(super) cure: String,
}

/// What keeps the deflections from the tolerance, with cures.
pub(super) fn accuracy_warning(achieved: &MeasuredError, request: &Request) -> Option<String> {
    let set = what_is_set(request).join(", ");
    let march = match set.is_empty() {
        true => "no finer one helps".to_owned(),
        false => format!("leave {set} to the plan"),
    };
    let lattice = "use a finer one, where it comes from a mesh by flow.resample_nodes, --resample, \
                   or smooth shocks by flow.smoothing_nodes, --smoothing";
    let parts = [
        ErrorPart { what: "the march", rad: achieved.max_rad, cure: march },
        ErrorPart {
            what: "the flow's lattice",
            rad: Some(achieved.resolution_rad).filter(|r| r.is_finite()).unwrap_or(0.0),
            cure: lattice.to_owned(),
        },
        of_mesh(achieved.mesh_rad),
    ];
    warning(parts, request.tolerance_rad)
}

/// The error of the flow's own mesh; zero when there is no estimate.
pub(super) fn of_mesh(mesh_rad: Option<f64>) -> ErrorPart {
    let cure = "only a finer mesh helps".to_owned();
    ErrorPart { what: "the flow's mesh", rad: mesh_rad.unwrap_or(0.0), cure }
}

/// The warning about errors whose sum is above the tolerance.
pub(super) fn warning<const N: usize>(
    mut parts: [ErrorPart; N],
    tolerance_rad: f64,
) -> Option<String> {
    let sum = parts.iter().map(|p| p.rad).sum::<f64>();
    if sum <= tolerance_rad {
        return None;
    }
    parts.sort_by(|a, b| b.rad.total_cmp(&a.rad));
    let [error, tolerance] = told_apart(sum, tolerance_rad);
    let named: Vec<String> = parts
        .iter()
        .filter(|p| p.rad >= NAMED * sum)
        .map(|p| format!("{} makes {:.1e} rad of it ({})", p.what, p.rad, p.cure))
        .collect();
    Some(format!(
        "deflections are off by up to {error} rad, above the tolerance of {tolerance} rad: {}; a \
         larger tolerance (march.tolerance_rad, --tolerance) accepts it",
        named.join(", ")
    ))
}

/// What the request sets, as keys of a scene and options of the program.
fn what_is_set(request: &Request) -> Vec<&'static str> {
    let set = [
        (request.mode.is_some(), "march.method (--march)"),
        (request.interpolant.is_some(), "march.interpolant (--interpolant)"),
        (request.step_voxels.is_some(), "march.step_voxels (--step)"),
        (request.skip_rad > 0.0, "march.skip_rad (--skip)"),
    ];
    set.into_iter().filter(|s| s.0).map(|s| s.1).collect()
}

/// Two different numbers with as many digits as tell them apart, two at least.
fn told_apart(a: f64, b: f64) -> [String; 2] {
    (1..16)
        .map(|digits| [a, b].map(|x| format!("{x:.digits$e}")))
        .find(|[a, b]| a != b)
        .unwrap_or_else(|| [a, b].map(|x| format!("{x:e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warned(
        max_rad: f64,
        resolution_rad: f64,
        mesh: Option<f64>,
        set: Request,
    ) -> Option<String> {
        let (rms_rad, rays) = (0.0, 400);
        let error = MeasuredError { max_rad, rms_rad, resolution_rad, mesh_rad: mesh, rays };
        accuracy_warning(&error, &Request { tolerance_rad: 1e-7, ..set })
    }

    fn warned_of(max_rad: f64, resolution_rad: f64, mesh_rad: Option<f64>) -> String {
        warned(max_rad, resolution_rad, mesh_rad, Request::default()).expect("a warning")
    }

    #[test]
    fn what_is_set_is_named_where_it_limits_the_march() {
        let set = Request { step_voxels: Some(8.0), skip_rad: 1e-9, ..Request::default() };
        let limited = warned(2e-7, 8e-9, None, set).expect("a warning");
        assert!(limited.contains("leave march.step_voxels (--step), march.skip_rad (--skip"));
        assert!(warned_of(2e-7, 8e-9, None).contains("no finer one helps"));
    }

    #[test]
    fn warnings_do_not_contradict_themselves() {
        // Errors add up, and a sum that differs in its last digits is told apart.
        let both = warned_of(6.004e-8, 4e-8, None);
        assert!(both.contains("1.0004e-7 rad, above the tolerance of 1.0000e-7 rad"), "{both}");
        // Where the lattice resolves the flow, smoothing it would not help.
        let march = warned_of(2e-7, 8e-9, None);
        assert!(!march.contains("smooth"), "{march}");
        let lattice = warned_of(2e-7, 3e-7, None);
        assert!(lattice.find("smooth shocks") < lattice.find("the march makes"), "{lattice}");
        let none = [(9e-8, 0.9e-8, None), (9e-8, f64::INFINITY, None), (3e-8, 3e-8, Some(3e-8))];
        assert!(none.iter().all(|n| warned(n.0, n.1, n.2, Request::default()).is_none()));
    }

    #[test]
    fn a_mesh_that_is_too_coarse_is_not_blamed_on_the_lattice() {
        let mesh = warned_of(1e-9, 2e-9, Some(4e-7));
        assert!(
            mesh.contains("the flow's mesh makes 4.0e-7 rad of it (only a finer mesh"),
            "{mesh}"
        );
        assert!(!mesh.contains("lattice") && !mesh.contains("the march makes"), "{mesh}");
    }
}
