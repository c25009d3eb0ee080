//! Data sets by name, with their sizes, their views and the figure of the thesis that each
//! represents. This module has the meshes and lines, [`flows`] the flows.
//!
//! ```
//! use datasets::catalogue::{Data, find};
//! let entry = find("icosphere")?;
//! let made = entry.generate("small", Default::default(), &mut |_, _| true)?;
//! let Data::Mesh(ball) = made else { panic!("a mesh") };
//! assert_eq!(ball.num_triangles(), 1280);
//! # Ok::<(), datasets::catalogue::CatalogueError>(())
//! ```

pub mod flows;

use crate::cache::{CachedMesh, MeshCache};
use crate::generate::flow::FlowError;
use crate::generate::impact::Impact;
use crate::generate::mixing_layer::MixingLayer;
use crate::generate::nested_wavelet::{NestedWaveletError, Size};
use crate::generate::plasma::Plasma;
use crate::generate::polylines::Polylines;
use crate::generate::shapes;
use crate::generate::star_field_lines::{StarField, THESIS_LINES};
use crate::isosurface::{IsosurfaceError, Isosurfaces, Options, PlaneSource};
use crate::view::View;
use glam::DVec3;
use rt_core::mesh::TriMesh;
use std::cell::Cell;

/// Seed of all data sets of the catalogue; the generators accept any.
pub const SEED: u64 = 1;

/// A named data set.
#[derive(Debug)]
pub struct Entry {
    /// Name on the command line.
    pub name: &'static str,
    /// What it shows.
    pub description: &'static str,
    /// Where the data set appears in the thesis.
    pub thesis: &'static str,
    /// Sizes, ascending.
    pub sizes: &'static [EntrySize],
    source: Source,
}

/// A size of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EntrySize {
    /// Name on the command line.
    pub name: &'static str,
    /// The generator's parameter: points per axis, lines, subdivision level…
    pub parameter: u32,
    /// Number of triangles, or of tube segments for lines. Exact for the wavelet and the shapes;
    /// measured and rounded for the others; extrapolated for the `thesis` sizes of mixing-layer and
    /// plasma.
    pub elements: u64,
}

/// Output of a generator.
#[derive(Debug, Clone, PartialEq)]
pub enum Data {
    /// Triangles.
    Mesh(TriMesh),
    /// Lines with radii, to be drawn as tubes.
    Lines(Polylines),
}

/// Why a data set cannot be generated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CatalogueError {
    /// No data set has this name.
    #[error("no data set is called `{name}`; there are: {known}")]
    UnknownName {
        /// The requested name.
        name: String,
        /// All names.
        known: String,
    },
    /// The data set does not have this size.
    #[error("{name} has no size `{size}`; it has: {known}")]
    UnknownSize {
        /// The data set.
        name: &'static str,
        /// The requested size.
        size: String,
        /// All its sizes.
        known: String,
    },
    /// The data set is not made of triangles.
    #[error("{name} consists of lines, not triangles; ask for its lines (Entry::generate)")]
    NotAMesh {
        /// The data set.
        name: &'static str,
    },
    /// The caller's progress function stopped the work.
    #[error("stopped while generating {name}")]
    Stopped {
        /// The data set.
        name: &'static str,
    },
    /// The surface cannot be extracted.
    #[error(transparent)]
    Isosurface(#[from] IsosurfaceError),
    /// The wavelet cannot be generated.
    #[error(transparent)]
    Wavelet(#[from] NestedWaveletError),
    /// The flow cannot be generated.
    #[error(transparent)]
    Flow(#[from] FlowError),
}

/// Called with the number of finished steps and the total; returning false stops the work.
pub type Progress<'a> = &'a mut dyn FnMut(usize, usize) -> bool;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    Wavelet,
    MixingLayer,
    Plasma,
    PlasmaTubes,
    Star,
    Impact,
    Icosphere,
    Torus,
    ClosedWavelet,
}

const fn size(name: &'static str, parameter: u32, elements: u64) -> EntrySize {
    EntrySize { name, parameter, elements }
}

static ENTRIES: [Entry; 9] = [
    Entry {
        name: "wavelet",
        description: "nested isosurfaces of VTK's wavelet (vtkRTAnalyticSource, 201³ points), \
                      counts as in VTK",
        thesis: "figures 3.5 and 3.6, chapter 3's scaling series; 16M in table 4.1",
        sizes: &[
            size("1M", 0, 1_002_484),
            size("2M", 1, 1_996_950),
            size("4M", 2, 4_003_478),
            size("8M", 3, 8_005_776),
            size("16M", 4, 16_022_136),
            size("32M", 5, 31_996_300),
            size("64M", 6, 64_135_816),
        ],
        source: Source::Wavelet,
    },
    Entry {
        name: "mixing-layer",
        description: "Richtmyer-Meshkov-like turbulent interface between two gases",
        thesis: "RMO (outside) and RMI (inside) of table 4.1, 316 million triangles",
        sizes: &[
            size("small", 128, 182_000),
            size("medium", 512, 6_800_000),
            size("large", 1024, 42_500_000),
            size("thesis", 2048, 268_000_000),
        ],
        source: Source::MixingLayer,
    },
    Entry {
        name: "plasma",
        description: "wrinkled flux ropes of a reconnecting current sheet",
        thesis: "VPIC of table 4.1, 102 million triangles",
        sizes: &[
            size("small", 128, 135_000),
            size("medium", 512, 3_283_000),
            size("large", 1024, 18_700_000),
            size("thesis", 2048, 113_000_000),
        ],
        source: Source::Plasma,
    },
    Entry {
        name: "plasma-tubes",
        description: "magnetic field lines of the current sheet",
        thesis: "the streamtubes of VPIC, table 4.1",
        sizes: &[
            size("small", 100, 30_000),
            size("medium", 1000, 300_000),
            size("large", 10_000, 3_000_000),
        ],
        source: Source::PlasmaTubes,
    },
    Entry {
        name: "star-field-lines",
        description: "magnetic field lines of a star",
        thesis: "the VAPOR star of table 4.1, 48 000 streamlines (86 million triangles there)",
        sizes: &[
            size("small", 480, 21_000),
            size("medium", 4800, 213_000),
            size("thesis", THESIS_LINES as u32, 2_130_000),
        ],
        source: Source::Star,
    },
    Entry {
        name: "impact",
        description: "a ball has hit a plate: crater, rim and some hundred separate ejecta",
        thesis: "the fracture data of chapter 4",
        sizes: &[
            size("small", 128, 86_000),
            size("medium", 512, 1_500_000),
            size("large", 1024, 6_070_000),
        ],
        source: Source::Impact,
    },
    Entry {
        name: "icosphere",
        description: "a unit ball of nearly equal triangles",
        thesis: "none (tests)",
        sizes: &[size("small", 3, 1280), size("medium", 6, 81_920), size("large", 9, 5_242_880)],
        source: Source::Icosphere,
    },
    Entry {
        name: "torus",
        description: "a ring with a hole",
        thesis: "none (tests)",
        sizes: &[
            size("small", 32, 1024),
            size("medium", 256, 65_536),
            size("large", 2048, 4_194_304),
        ],
        source: Source::Torus,
    },
    Entry {
        name: "closed-wavelet",
        description: "an isosurface of the wavelet closed at the border: a solid with handles and \
                      cavities",
        thesis: "none (tests of refraction and shadows)",
        sizes: &[
            size("small", 31, 15_000),
            size("medium", 101, 174_000),
            size("large", 201, 702_000),
        ],
        source: Source::ClosedWavelet,
    },
];

/// All data sets.
pub fn entries() -> &'static [Entry] {
    &ENTRIES
}

/// The data set of that name.
pub fn find(name: &str) -> Result<&'static Entry, CatalogueError> {
    ENTRIES.iter().find(|e| e.name == name).ok_or_else(|| CatalogueError::UnknownName {
        name: name.into(),
        known: ENTRIES.iter().map(|e| e.name).collect::<Vec<_>>().join(", "),
    })
}

impl Entry {
    /// The size of that name.
    pub fn size(&self, name: &str) -> Result<EntrySize, CatalogueError> {
        let found = self.sizes.iter().find(|s| s.name.eq_ignore_ascii_case(name));
        found.copied().ok_or_else(|| CatalogueError::UnknownSize {
            name: self.name,
            size: name.into(),
            known: self.sizes.iter().map(|s| s.name).collect::<Vec<_>>().join(", "),
        })
    }

    /// Whether the data set consists of lines rather than triangles.
    pub fn is_lines(&self) -> bool {
        matches!(self.source, Source::PlasmaTubes | Source::Star)
    }

    /// Generates the data set. `options` adds normals and scalars to isosurfaces and has no effect
    /// on other shapes.
    pub fn generate(
        &self,
        size: &str,
        options: Options,
        progress: Progress<'_>,
    ) -> Result<Data, CatalogueError> {
        let parameter = self.size(size)?.parameter;
        let surface = |s: Isosurfaces| Data::Mesh(s.mesh);
        let stopped = Cell::new(false);
        let watch = |total: u32| {
            let stopped = &stopped;
            move |done: usize| {
                stopped.set(!progress(done, total as usize));
                !stopped.get()
            }
        };
        let data = match self.source {
            Source::Wavelet => surface(Size::ALL[parameter as usize].generate(options)?),
            Source::MixingLayer => {
                let layer = MixingLayer::new(parameter, SEED);
                surface(layer.surface(options, watch(layer.dims().z))?)
            }
            Source::Plasma => {
                let plasma = Plasma::new(parameter, SEED);
                surface(plasma.surface(options, watch(plasma.dims().z))?)
            }
            Source::PlasmaTubes => {
                Data::Lines(Plasma::new(16, SEED).streamtubes(parameter as usize))
            }
            Source::Star => Data::Lines(StarField::new(SEED).lines(parameter as usize)),
            Source::Impact => {
                let impact = Impact::new(parameter, 400, SEED);
                surface(impact.surface(options, watch(impact.dims().z))?)
            }
            Source::Icosphere => Data::Mesh(shapes::icosphere(parameter)),
            Source::Torus => Data::Mesh(shapes::torus(0.35, parameter, parameter / 2)),
            Source::ClosedWavelet => {
                Data::Mesh(shapes::closed_wavelet(parameter, 157.0909652709961)?)
            }
        };
        // An incomplete data set must not be mistaken for a complete one.
        if stopped.get() { Err(CatalogueError::Stopped { name: self.name }) } else { Ok(data) }
    }

    /// The data set as a mesh, generated or read through the cache.
    pub fn mesh(
        &self,
        size: &str,
        options: Options,
        cache: &MeshCache,
        progress: Progress<'_>,
    ) -> Result<CachedMesh, CatalogueError> {
        let found = self.size(size)?;
        if self.is_lines() {
            return Err(CatalogueError::NotAMesh { name: self.name });
        }
        let with = |on: bool, what: &'static str| if on { what } else { "" };
        let attributes =
            [with(options.normals, "+normals"), with(options.scalars, "+scalars")].concat();
        let key = format!("{} {} {}{attributes}", self.name, found.name, found.parameter);
        cache.mesh(&key, || match self.generate(size, options, progress)? {
            Data::Mesh(mesh) => Ok(mesh),
            Data::Lines(_) => Err(CatalogueError::NotAMesh { name: self.name }),
        })
    }

    /// Standard views of the data set; the first shows all of it.
    pub fn views(&self) -> Vec<View> {
        match self.source {
            // ParaView's initial camera for the wavelet, raised by 20 degrees as in the
            // measurements with VTK.
            Source::Wavelet => {
                let (s, c) = 20f64.to_radians().sin_cos();
                vec![
                    View::new("orbit", DVec3::new(0.0, -669.0 * c, 669.0 * s), DVec3::ZERO),
                    View::new("close", DVec3::new(0.0, -169.0 * c, 169.0 * s), DVec3::ZERO),
                ]
            }
            Source::MixingLayer => MixingLayer::views(),
            Source::Plasma | Source::PlasmaTubes => Plasma::views(),
            Source::Star => StarField::views(),
            Source::Impact => Impact::views(),
            Source::Icosphere | Source::Torus | Source::ClosedWavelet => {
                vec![View::new("whole", DVec3::new(2.5, -5.0, 2.5), DVec3::ZERO)]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_every_smallest_size_generates_about_what_it_says() {
        for (i, e) in entries().iter().enumerate() {
            assert!(entries()[..i].iter().all(|o| o.name != e.name), "{} twice", e.name);
            assert!(
                e.sizes.windows(2).all(|w| w[0].elements < w[1].elements),
                "{}: sizes ascend",
                e.name
            );
            let size = e.sizes[0];
            let made = match e.generate(size.name, Options::default(), &mut |_, _| true).unwrap() {
                Data::Mesh(m) => m.num_triangles(),
                Data::Lines(l) => l.num_segments(),
            };
            let ratio = made as f64 / size.elements as f64;
            assert!(
                (0.9..1.1).contains(&ratio),
                "{} {}: {made}, said {}",
                e.name,
                size.name,
                size.elements
            );
            assert_eq!(
                e.is_lines(),
                find(e.name).unwrap().name.contains("tubes") || e.name.contains("lines")
            );
        }
    }

    #[test]
    fn views_look_at_the_data() {
        for e in entries() {
            let bounds =
                match e.generate(e.sizes[0].name, Options::default(), &mut |_, _| true).unwrap() {
                    Data::Mesh(m) => m.bounds(),
                    Data::Lines(l) => rt_core::math::Aabb::from_points(&l.points),
                };
            let near = bounds.radius() as f64;
            let views = e.views();
            assert!(!views.is_empty(), "{}", e.name);
            for v in views {
                let to_center = bounds.center().as_dvec3() - v.target;
                assert!(
                    to_center.length() < 0.6 * near,
                    "{} {}: looks past the data",
                    e.name,
                    v.name
                );
                assert!(
                    (v.target - v.eye).cross(v.up).length() > 0.1,
                    "{} {}: up is along the view",
                    e.name,
                    v.name
                );
            }
        }
    }

    #[test]
    fn unknown_names_list_what_there_is() {
        assert!(find("bunny").unwrap_err().to_string().contains("mixing-layer"));
        let e = find("wavelet").unwrap();
        assert!(e.size("3M").unwrap_err().to_string().contains("16M"));
        assert_eq!(e.size("16m").unwrap().elements, 16_022_136);
    }

    #[test]
    fn wavelet_sizes_are_those_of_the_generator() {
        for (s, size) in find("wavelet").unwrap().sizes.iter().zip(Size::ALL) {
            assert_eq!((s.name, s.elements), (size.name(), size.triangles() as u64));
        }
    }

    #[test]
    fn stopping_is_an_error_and_caches_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let cache = MeshCache::at(dir.path());
        let e = find("mixing-layer").unwrap();
        let stopped = e.mesh("small", Options::default(), &cache, &mut |done, _| done < 40);
        assert!(matches!(stopped, Err(CatalogueError::Stopped { .. })));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        let lines = find("star-field-lines").unwrap();
        let refused = lines.mesh("small", Options::default(), &cache, &mut |_, _| true);
        assert!(matches!(refused, Err(CatalogueError::NotAMesh { .. })));
    }

    #[test]
    fn cache_keeps_meshes_with_and_without_normals_apart() {
        let dir = tempfile::tempdir().unwrap();
        let cache = MeshCache::at(dir.path());
        let e = find("impact").unwrap();
        for normals in [false, true, false, true] {
            let options = Options { normals, ..Default::default() };
            let found = e.mesh("small", options, &cache, &mut |_, _| true).unwrap();
            assert_eq!(found.mesh.normals.is_some(), normals);
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
    }
}
