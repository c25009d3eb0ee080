//! Lists the times of a flow: of a collection, a file series, a file with several times, an
//! OpenFOAM case or a list of files.

use super::InputError;
use std::path::{Path, PathBuf};

/// One time of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Time in the unit of the file, or the number in the list if files have no time.
    pub time: f64,
    /// The file to give to [`super::load`].
    pub path: PathBuf,
}

/// Lists the times of a series: those of a single PVD file, file series (`.vtu.series`),
/// OpenFOAM or EnSight case, or VTKHDF, NetCDF, XDMF, Exodus, CGNS or Tecplot file, or one per
/// file in the given order.
///
/// Comparing them requires the same reference: load the first, then pass its
/// [`super::Report::reference_n_minus_1`] as [`super::Reference::Given`] to the others.
pub fn series(paths: &[PathBuf]) -> Result<Vec<Step>, InputError> {
    if let [only] = paths
        && has_times(only)
    {
        let opened = datasets::read::open(only)?;
        if let Some(twice) = opened.time_steps.windows(2).find(|w| w[0].time == w[1].time) {
            return Err(InputError::InFile {
                path: only.clone(),
                source: Box::new(InputError::Option {
                    what: format!(
                        "time {} has several files, the parts of one data set",
                        twice[0].time
                    ),
                    cure: "write each time as one file (.pvtu, .vtm), or open the parts one by one",
                }),
            });
        }
        if opened.time_steps.is_empty() {
            // A case with a mesh alone, or a file without times.
            return Ok(vec![Step { time: 0.0, path: only.clone() }]);
        }
        return Ok(opened
            .time_steps
            .into_iter()
            .map(|s| Step { time: s.time, path: s.path })
            .collect());
    }
    Ok(paths.iter().enumerate().map(|(i, p)| Step { time: i as f64, path: p.clone() }).collect())
}

/// Whether a path may be that of several times, by its name or as a case of OpenFOAM.
fn has_times(path: &Path) -> bool {
    let lists = [
        "pvd", "series", "vtkhdf", "hdf", "nc", "nc4", "cdf", "xdmf", "xmf", "e", "exo", "case",
        "tec", "plt", "cgns",
    ];
    path.extension().is_some_and(|e| lists.iter().any(|l| e.eq_ignore_ascii_case(l)))
        || datasets::read::openfoam::is_whole_case(path)
}
