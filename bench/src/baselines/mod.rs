//! Other ray tracers behind one interface, as baselines for rt-core.
//!
//! [`embree`] is loaded at run time if it is installed. [`obvhs`] is a crate and always available.
//! [`brute_force`] tests every triangle in f64 and is the reference for the others.
//! [`thesis_schlieren`] is the dissertation's ray marcher for gas flows.

pub mod brute_force;
pub mod embree;
pub mod obvhs;
pub mod thesis_schlieren;

use crate::rays::{HitBlock, LANES, NO_HIT, RayBlock, RaySet};
use rayon::prelude::*;
use rt_core::mesh::TriMesh;

/// A ray tracer. All coordinates are those of the mesh (relative to its origin).
pub trait Tracer: Sync {
    /// Name with version and mode, as in tables.
    fn name(&self) -> String;

    /// Finds the closest hits of `rays` and stores them in `hits`, which has the same length. Empty
    /// lanes may hold any value.
    fn closest(&self, rays: &[RayBlock], hits: &mut [HitBlock]);

    /// Tests whether each ray hits anything: bit i of a block's mask is lane i. Bits of empty lanes
    /// are 0.
    fn occluded(&self, rays: &[RayBlock], masks: &mut [u16]);
}

impl<T: Tracer + ?Sized> Tracer for &T {
    fn name(&self) -> String {
        (**self).name()
    }
    fn closest(&self, rays: &[RayBlock], hits: &mut [HitBlock]) {
        (**self).closest(rays, hits);
    }
    fn occluded(&self, rays: &[RayBlock], masks: &mut [u16]) {
        (**self).occluded(rays, masks);
    }
}

/// Cost of a build.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BuildCost {
    /// Wall-clock time, excluding copies of the input.
    pub wall_secs: f64,
    /// CPU time of all threads.
    pub cpu_secs: f64,
    /// Memory of the finished structure, without the input mesh.
    pub bytes: u64,
    /// Peak memory while building, if the baseline reports it.
    pub peak_bytes: Option<u64>,
}

/// Why a baseline cannot be measured.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BaselineError {
    /// The baseline is not installed.
    #[error("{name} is not installed (looked in {looked_in}); {cure}")]
    NotFound {
        /// Its name.
        name: String,
        /// The places searched.
        looked_in: String,
        /// How to install it.
        cure: String,
    },
    /// A library was found but cannot be used.
    #[error("{path} cannot be used: {reason}")]
    Unusable {
        /// The file.
        path: String,
        /// The reason.
        reason: String,
    },
    /// The mesh has triangles that some baselines cannot handle.
    #[error(
        "the mesh has {count} triangles with missing or non-finite vertices; peers need a clean \
         mesh: remove them"
    )]
    Mesh {
        /// Number of such triangles.
        count: usize,
    },
    /// The baseline reported an error.
    #[error("{name} reported {error} while {doing}")]
    Failed {
        /// Its name.
        name: String,
        /// The error.
        error: String,
        /// The operation that failed.
        doing: &'static str,
    },
}

impl BaselineError {
    /// The message for published records: file names without directories of this machine.
    pub fn for_a_record(&self) -> String {
        let BaselineError::Unusable { path, reason } = self else { return self.to_string() };
        let file = std::path::Path::new(path);
        let name = file.file_name().map_or(path.clone(), |n| n.to_string_lossy().into_owned());
        let folder = file.parent().map(|p| format!("{}/", p.display())).filter(|f| f.len() > 1);
        let reason = folder.map_or(reason.clone(), |f| reason.replace(&f, ""));
        BaselineError::Unusable { path: name, reason }.to_string()
    }
}

/// Rejects meshes that would make a baseline read outside its arrays.
pub(crate) fn require_clean(mesh: &TriMesh) -> Result<(), BaselineError> {
    match mesh.validate().skipped() {
        0 => Ok(()),
        count => Err(BaselineError::Mesh { count }),
    }
}

/// Blocks traced at once: 1024 rays.
const CHUNK: usize = 64;

/// Traces all rays on the calling thread (`threads == 1`) or on rayon's current pool.
pub fn closest_all(tracer: &dyn Tracer, rays: &RaySet, hits: &mut [HitBlock], threads: usize) {
    if threads == 1 {
        rays.blocks
            .chunks(CHUNK)
            .zip(hits.chunks_mut(CHUNK))
            .for_each(|(r, h)| tracer.closest(r, h));
    } else {
        rays.blocks
            .par_chunks(CHUNK)
            .zip(hits.par_chunks_mut(CHUNK))
            .for_each(|(r, h)| tracer.closest(r, h));
    }
}

/// As [`closest_all`], for occlusion.
pub fn occluded_all(tracer: &dyn Tracer, rays: &RaySet, masks: &mut [u16], threads: usize) {
    if threads == 1 {
        rays.blocks
            .chunks(CHUNK)
            .zip(masks.chunks_mut(CHUNK))
            .for_each(|(r, m)| tracer.occluded(r, m));
    } else {
        rays.blocks
            .par_chunks(CHUNK)
            .zip(masks.par_chunks_mut(CHUNK))
            .for_each(|(r, m)| tracer.occluded(r, m));
    }
}

/// Number of rays with a hit.
pub fn count_hits(rays: &RaySet, hits: &[HitBlock]) -> u64 {
    (0..rays.len).filter(|i| hits[i / LANES].prim[i % LANES] != NO_HIT).count() as u64
}

/// Number of rays that hit anything.
pub fn count_occluded(masks: &[u16]) -> u64 {
    masks.iter().map(|m| u64::from(m.count_ones())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_name_files_without_their_folders() {
        let path = "/opt/somebody/lib/libembree4.so".to_string();
        let reason = format!("{path}: invalid ELF header; see /opt/somebody/lib/readme");
        let e = BaselineError::Unusable { path, reason };
        assert!(e.to_string().contains("/opt/somebody"));
        assert_eq!(
            e.for_a_record(),
            "libembree4.so cannot be used: libembree4.so: invalid ELF header; see readme"
        );
        let e = BaselineError::Mesh { count: 3 };
        assert_eq!(e.for_a_record(), e.to_string());
    }
}

#[cfg(test)]
pub(crate) mod testing {
    //! One test for every baseline: agreement with brute force in f64.

    use super::*;
    use crate::rays::{self, View};
    use glam::Vec3;
    use std::sync::OnceLock;

    /// A bumpy closed surface of 2 x 48 x 24 triangles.
    pub(crate) fn mesh() -> TriMesh {
        let (n, m) = (48u32, 24u32);
        let point = |i: u32, j: u32| {
            let (a, b) = (
                i as f32 / n as f32 * std::f32::consts::TAU,
                j as f32 / m as f32 * std::f32::consts::TAU,
            );
            let r = 1.0 + 0.35 * (b + 0.3 * (5.0 * a).sin()).cos();
            Vec3::new(r * a.cos(), 0.35 * b.sin() + 0.1 * (3.0 * a).sin(), r * a.sin())
        };
        let positions = (0..n * m).map(|k| point(k % n, k / n)).collect();
        let at = |i: u32, j: u32| i % n + j % m * n;
        let quads = (0..n * m).map(|k| (k % n, k / n));
        let triangles = quads.flat_map(|(i, j)| {
            [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]]
        });
        TriMesh::new(positions, triangles.collect())
    }

    /// A kind of rays with the expected results.
    struct Case {
        kind: &'static str,
        rays: RaySet,
        hits: Vec<HitBlock>,
        masks: Vec<u16>,
    }

    /// Primary, shadow, ambient-occlusion and random rays through [`mesh`], traced once by brute
    /// force.
    fn cases() -> &'static [Case] {
        static CASES: OnceLock<Vec<Case>> = OnceLock::new();
        CASES.get_or_init(|| {
            let mesh = mesh();
            let exact = brute_force::BruteForce::new(&mesh);
            let case = |kind, rays: RaySet| {
                let mut hits = vec![HitBlock::MISS; rays.blocks.len()];
                closest_all(&exact, &rays, &mut hits, 2);
                // A ray is occluded exactly if it has a closest hit.
                let lane = |h: &HitBlock, l: usize| u16::from(h.prim[l] != NO_HIT) << l;
                let masks =
                    hits.iter().map(|h| (0..LANES).fold(0, |m, l| m | lane(h, l))).collect();
                Case { kind, rays, hits, masks }
            };
            let view = View::orbit(mesh.bounds());
            let primary = case("primary", view.primary(32));
            let points = rays::surface_points(
                |_, prim| mesh.triangle(prim as usize).map(|p| p.as_dvec3()),
                &primary.rays,
                &primary.hits,
                view.radius,
            );
            assert!(points.len() > 200, "the view shows the mesh");
            let light = view.light();
            vec![
                primary,
                case("shadow", rays::shadow(&points, light)),
                case("shadow from the light", rays::shadow_from_light(&points, light)),
                case("ambient occlusion", rays::ambient_occlusion(&points)),
                case("incoherent", rays::incoherent(mesh.bounds(), 2003)),
            ]
        })
    }

    /// Compares a tracer that was built from [`mesh`] with brute force. At edges and silhouettes,
    /// f32 results may differ: at most one ray in 2000 may. Distances agree to 1e-4 of the mesh's
    /// size.
    pub(crate) fn agrees_with_brute_force(tracer: &dyn Tracer) {
        for Case { kind, rays, hits, masks } in cases() {
            let what = format!("{}, {kind}", tracer.name());
            let mut got = vec![HitBlock::MISS; rays.blocks.len()];
            let mut got_masks = vec![0; rays.blocks.len()];
            closest_all(tracer, rays, &mut got, 2);
            occluded_all(tracer, rays, &mut got_masks, 2);
            let mut wrong = 0;
            for i in 0..rays.len {
                let (b, l) = (i / LANES, i % LANES);
                let (w, g) = (&hits[b], &got[b]);
                let same = match (w.prim[l] == NO_HIT, g.prim[l] == NO_HIT) {
                    (true, true) => true,
                    (false, false) => (w.t[l] - g.t[l]).abs() < 1e-4 * w.t[l].max(1.0),
                    _ => false,
                };
                wrong += usize::from(!same) + usize::from((masks[b] ^ got_masks[b]) >> l & 1 == 1);
            }
            assert!(wrong * 2000 <= rays.len.max(2000), "{what}: {wrong} of {} differ", rays.len);
            assert!(count_hits(rays, &got) > 0, "{what}: nothing was hit");
            // Bits of the last block's empty lanes.
            let used = rays.len - (rays.blocks.len() - 1) * LANES;
            let empty = (!0u32 << used) as u16;
            assert_eq!(
                got_masks[rays.blocks.len() - 1] & empty,
                0,
                "{what}: an empty lane is occluded"
            );
        }
    }
}
