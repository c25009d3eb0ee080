//! The scaling series of the dissertation (section 4.3): nested surfaces of the wavelet, twice as
//! many triangles at each step, and which of its meshes a machine has room for.

use super::Context;
use crate::stored_data::wavelet_surfaces;
use datasets::free_memory::available_bytes;
use datasets::generate::nested_wavelet::Size;
use rt_core::mesh::{Attribute, PerElement, TriMesh};
use std::sync::Arc;

/// Sizes beyond those that have names, in million triangles.
const BEYOND: [u32; 2] = [128, 256];
/// Share of the memory that is free which a measurement may plan to take.
const PLANNED: f64 = 0.85;

/// Bytes a triangle that a program takes which draws the mesh by llvmpipe, its driver included: VTK
/// takes 200 at 16 million (table 4.1).
pub(super) const PROGRAM: f64 = 220.0;

/// A mesh of the series.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
pub(super) enum Step {
    Named(Size),
    /// So many million triangles.
    Beyond(u32),
}

/// The whole series: to 64 million triangles, and with `--thesis` to the dissertation's 256.
pub(super) fn steps(thesis: bool) -> Vec<Step> {
    let beyond = BEYOND.into_iter().filter(|_| thesis).map(Step::Beyond);
    Size::ALL.into_iter().map(Step::Named).chain(beyond).collect()
}

impl Step {
    /// The size in words.
    pub(super) fn name(self) -> String {
        match self {
            Step::Named(size) => format!("{} triangles", size.name()),
            Step::Beyond(millions) => format!("{millions}M triangles"),
        }
    }

    /// About how many triangles it has.
    pub(super) fn triangles(self) -> usize {
        match self {
            Step::Named(size) => size.triangles(),
            // A surface more or less makes 0.4 % of the smaller one.
            Step::Beyond(millions) => millions as usize * 1_013_000,
        }
    }

    /// Bytes of the mesh: three indices a triangle, and for each of half as many vertices a
    /// position and a normal.
    fn mesh_bytes(self) -> f64 {
        self.triangles() as f64 * 24.0
    }

    /// Makes the mesh, if there is room for it; why not otherwise.
    pub(super) fn mesh(
        self,
        context: &mut Context<'_>,
    ) -> anyhow::Result<Result<Arc<TriMesh>, String>> {
        // The last surface is in memory twice.
        if let Err(why) = has_room(1.1 * self.mesh_bytes()) {
            return Ok(Err(format!("{} triangles: the mesh {why}", self.triangles())));
        }
        Ok(Ok(match self {
            Step::Named(size) => context.wavelet(size)?,
            Step::Beyond(millions) => Arc::new(joined(context, millions, self.triangles())?),
        }))
    }
}

/// All surfaces as one mesh.
fn joined(context: &mut Context<'_>, millions: u32, triangles: usize) -> anyhow::Result<TriMesh> {
    let mut all = TriMesh::default();
    let mut normals: Vec<rt_core::glam::Vec3> = vec![];
    // Without room from the start, growing would hold the mesh twice.
    all.indices.reserve_exact(triangles);
    all.positions.reserve_exact(triangles / 2 + triangles / 50);
    normals.reserve_exact(triangles / 2 + triangles / 50);
    for surface in wavelet_surfaces(millions, true)? {
        let surface = surface?;
        context.report_step(format!("{millions} million triangles: {}", surface.label))?;
        let first = all.positions.len() as u32;
        all.positions.extend_from_slice(&surface.mesh.positions);
        let shifted = surface.mesh.indices.iter().map(|t| t.map(|k| k + first));
        all.indices.extend(shifted);
        if let Some(n) = &surface.mesh.normals {
            normals.extend_from_slice(&n.values);
        }
        all.origin = surface.mesh.origin;
    }
    all.normals = Some(Attribute { per: PerElement::Vertex, values: normals });
    Ok(all)
}

/// Whether `bytes` more are free; what it needs otherwise, to follow a name.
pub(super) fn has_room(bytes: f64) -> Result<(), String> {
    let Some(free) = available_bytes() else { return Ok(()) };
    let gib = |bytes: f64| bytes / f64::from(1 << 30);
    if bytes < PLANNED * free as f64 {
        return Ok(());
    }
    Err(format!("needs about {:.0} GiB, and {:.0} GiB are free", gib(bytes), gib(free as f64)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_doubles_from_one_to_256_million_triangles() {
        let all = steps(true);
        assert_eq!(all.len(), 9);
        for pair in all.windows(2) {
            let ratio = pair[1].triangles() as f64 / pair[0].triangles() as f64;
            assert!((1.98..2.03).contains(&ratio), "{pair:?}: {ratio}");
        }
        assert_eq!(steps(false), all[..7]);
    }

    #[test]
    fn surfaces_joined_are_those_of_the_generator() {
        let mut progress = |_: &str, _: Option<f64>| Ok(());
        let mut context = Context::new(true, None, &mut progress);
        let all = joined(&mut context, 2, 2_000_000).unwrap();
        let apart: Vec<_> = wavelet_surfaces(2, true).unwrap().map(|s| s.unwrap().mesh).collect();
        assert!(apart.len() > 1);
        assert_eq!(all.num_triangles(), apart.iter().map(TriMesh::num_triangles).sum::<usize>());
        let last = apart.last().unwrap();
        let (n, of_last) = (all.num_triangles(), last.num_triangles());
        for k in [0, of_last / 2, of_last - 1] {
            assert_eq!(all.triangle(n - of_last + k), last.triangle(k));
        }
        let normals = all.normals.expect("normals").values;
        assert_eq!(normals.len(), all.positions.len());
        assert_eq!(normals.last(), last.normals.as_ref().unwrap().values.last());
    }

    #[test]
    fn what_no_machine_has_is_refused_with_both_numbers() {
        let why = has_room(1e18).unwrap_err();
        assert!(why.contains("GiB are free"), "{why}");
        assert_eq!(has_room(1e6), Ok(()));
    }
}
