//! Chooses n0, the index of the reference medium around the field.

use super::lattice::LatticeValues;
use super::{InputError, Options, Report};
use crate::field::Node;
use datasets::resample::Mark;
use rt_core::math::median_high;

/// How n0 is chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Reference {
    /// Median over the gas on the six faces of the lattice. For most data this is the undisturbed
    /// flow.
    #[default]
    Border,
    /// Median over all gas.
    Median,
    /// A given n − 1, such as that of the free stream from [`crate::index::conditions`]. For the
    /// fields of a time series, pass [`super::Report::reference_n_minus_1`] of the first.
    Given {
        /// n0 − 1.
        n_minus_1: f64,
    },
}

/// Median of the finite values; NaN if there are none.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    median_high(&mut finite).unwrap_or(f64::NAN)
}

/// Subtracts the median from the values, and returns it.
pub(super) fn background(index: &mut [f64], options: &Options) -> Result<f64, InputError> {
    let background = median(index);
    if !background.is_finite() {
        return Err(InputError::Option {
            what: format!("no value of {} gives an index", options.medium.describe()),
            cure: "check that the arrays hold finite numbers in SI units",
        });
    }
    index.iter_mut().for_each(|n| *n -= background);
    Ok(background)
}

/// A given n0 − 1, if a medium can have it.
pub(super) fn given(n_minus_1: f64) -> Result<f64, InputError> {
    if n_minus_1.is_finite() && n_minus_1 > -1.0 {
        return Ok(n_minus_1);
    }
    Err(InputError::Option {
        what: format!("reference n - 1 is {n_minus_1}"),
        cure: "give n0 - 1, about 2.7e-4 for air",
    })
}

impl Reference {
    /// The reference, relative to the background that was subtracted from the values.
    pub(super) fn choose(
        &self,
        on: &LatticeValues,
        background: f64,
        report: &mut Report,
    ) -> Result<f64, InputError> {
        let gas = |keep: &dyn Fn(usize) -> bool| -> Vec<f64> {
            let inside = (0..on.values.len()).filter(|&i| on.marks[i] == Mark::Inside && keep(i));
            inside.map(|i| f64::from(on.values[i])).collect()
        };
        let all = |_: usize| true;
        match self {
            Reference::Given { n_minus_1 } => Ok(given(*n_minus_1)? - background),
            Reference::Median => Ok(or_zero(median(&gas(&all)))),
            Reference::Border => {
                let [nx, ny, nz] = on.lattice.dims;
                let at_border = |i: usize| {
                    let at = [i % nx, i / nx % ny, i / nx / ny];
                    at.iter().zip([nx, ny, nz]).any(|(&a, n)| a == 0 || a + 1 == n)
                };
                let border = gas(&at_border);
                if border.is_empty() {
                    report.warnings.push(
                        "no gas at the border of the lattice: the reference is the median of all \
                         gas"
                        .into(),
                    );
                    return Ok(or_zero(median(&gas(&all))));
                }
                Ok(median(&border))
            }
        }
    }
}

/// Replaces NaN by zero. A field without gas is refused later, with its own error.
fn or_zero(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

/// Continues values from the nearest gas, layer by layer, to nodes whose role is gas.
/// [`crate::field::Field::new`] fills the others.
pub(super) fn continued(
    mut eps: Vec<f32>,
    dims: [usize; 3],
    marks: &[Mark],
    nodes: Option<&[Node]>,
) -> Vec<f32> {
    let Some(nodes) = nodes else { return eps };
    let open: Vec<bool> =
        marks.iter().zip(nodes).map(|(m, n)| *m != Mark::Inside && *n == Node::Gas).collect();
    if !open.contains(&true) {
        return eps;
    }
    let stride = [1, dims[0], dims[0] * dims[1]];
    let neighbours = |i: usize| {
        let at = [i % dims[0], i / dims[0] % dims[1], i / stride[2]];
        (0..3).flat_map(move |c| {
            let lower = (at[c] > 0).then(|| i - stride[c]);
            let upper = (at[c] + 1 < dims[c]).then(|| i + stride[c]);
            [lower, upper].into_iter().flatten()
        })
    };
    let mut known: Vec<bool> = marks.iter().map(|&m| m == Mark::Inside).collect();
    let mut layer: Vec<usize> =
        (0..eps.len()).filter(|&i| open[i] && neighbours(i).any(|j| known[j])).collect();
    while !layer.is_empty() {
        let new: Vec<f32> = layer
            .iter()
            .map(|&i| {
                let from = neighbours(i).filter(|&j| known[j]);
                let (sum, n) = from.fold((0.0, 0.0), |(s, n), j| (s + f64::from(eps[j]), n + 1.0));
                (sum / n) as f32
            })
            .collect();
        for (&i, v) in layer.iter().zip(new) {
            (eps[i], known[i]) = (v, true);
        }
        let mut next: Vec<usize> =
            layer.iter().flat_map(|&i| neighbours(i)).filter(|&j| !known[j] && open[j]).collect();
        next.sort_unstable();
        next.dedup();
        layer = next;
    }
    // Pockets that the continuation does not reach get the reference index.
    for (i, e) in eps.iter_mut().enumerate() {
        if open[i] && !known[i] {
            *e = 0.0;
        }
    }
    eps
}
