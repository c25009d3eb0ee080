//! Options of a build, and the report on it.

use super::build::{BuilderConfig, LeafCapacity, Method, SahConfig};
use std::time::Duration;

/// Build effort, which trades build time for ray time (thesis section 4.1.2: approximate builds for
/// changing geometry, full builds for exploration). The experiment `accuracy-build` of bench
/// measures the trade-off.
///
/// As guidance, for nested isosurfaces of 1 M and 4 M triangles: CPU time of the build and time of
/// single primary rays, both relative to `Balanced`, and bytes per triangle. Coherent packets
/// differ by 0 to 8 %.
///
/// | | build | single rays | bytes |
/// |---|---|---|---|
/// | `Fast` | 0.82–0.86 | 1.02–1.05 | 59 |
/// | `Balanced` | 1 | 1 | 56 |
/// | `Best` | 1.9–2.2 | 0.96–1.00 | 56 |
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BuildQuality {
    /// SAH with 8 bins along the longest axis, for geometry that changes every frame.
    Fast,
    /// SAH with up to 16 bins along all three axes.
    #[default]
    Balanced,
    /// Balanced, then the reinsertion optimiser of obvhs, for long exploration of one geometry and
    /// for single rays.
    Best,
}

impl BuildQuality {
    /// All presets, from fast to best; tests and benchmarks iterate over them.
    pub const ALL: [BuildQuality; 3] =
        [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best];

    /// Builder settings of this preset.
    pub(crate) fn config(self) -> BuilderConfig {
        let leaves = LeafCapacity::Four;
        let quick = SahConfig { bins: 8, longest_axis_only: true, leaves };
        let thorough = SahConfig { bins: 16, longest_axis_only: false, leaves };
        match self {
            BuildQuality::Fast => BuilderConfig { method: Method::Sah, sah: quick },
            BuildQuality::Balanced => BuilderConfig { method: Method::Sah, sah: thorough },
            BuildQuality::Best => BuilderConfig { method: Method::Reinsertion, sah: thorough },
        }
    }

    /// The name used on command lines and in records.
    pub fn name(self) -> &'static str {
        match self {
            BuildQuality::Fast => "fast",
            BuildQuality::Balanced => "balanced",
            BuildQuality::Best => "best",
        }
    }
}

impl std::str::FromStr for BuildQuality {
    type Err = UnknownQuality;

    /// Parses [`BuildQuality::name`], ignoring case.
    fn from_str(text: &str) -> Result<BuildQuality, UnknownQuality> {
        let found = BuildQuality::ALL.into_iter().find(|q| q.name().eq_ignore_ascii_case(text));
        found.ok_or_else(|| UnknownQuality { found: text.into() })
    }
}

/// A name of no preset.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub struct UnknownQuality {
    /// The given name.
    pub found: String,
}

impl std::fmt::Display for UnknownQuality {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = BuildQuality::ALL.map(BuildQuality::name).join(", ");
        write!(f, "there is no build quality `{}`; there are: {names}", self.found)?;
        if self.found.eq_ignore_ascii_case("fastest") {
            f.write_str(" (`fastest` is gone: give `fast`, which builds and traces faster)")?;
        }
        Ok(())
    }
}

/// How rays through shared edges and vertices are treated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Robustness {
    /// Edge functions in f32 only; zeros count as inside. Of 2.5·10⁷ rays aimed at vertices and
    /// edges of closed meshes none leaked, but leaks are not excluded: a triangle whose edge
    /// functions all round to zero is missed. Conversely, a triangle 10⁷ times smaller than its
    /// distance from the ray may be hit falsely when a large one shares its leaf.
    Fast,
    /// No ray passes between two triangles that share an edge or a vertex (Woop, Benthin and Wald
    /// 2013, with conservative boxes after Ize 2013).
    #[default]
    Watertight,
}

impl Robustness {
    /// Both modes.
    pub const ALL: [Robustness; 2] = [Robustness::Fast, Robustness::Watertight];

    /// The name used on command lines and in records.
    pub fn name(self) -> &'static str {
        match self {
            Robustness::Fast => "fast",
            Robustness::Watertight => "watertight",
        }
    }
}

/// How trees hold the triangles of meshes.
///
/// A world that renders keeps its meshes beside the tree. One from slices
/// ([`crate::bvh::World::from_slices`]) keeps the tree alone, and that has all of the geometry.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Storage {
    /// Four triangles to a leaf, each with its corners: 56 bytes per triangle.
    #[default]
    Plain,
    /// Up to 64 triangles share their vertices, which are coded without loss: 12 to 16 bytes per
    /// triangle of a surface, more where triangles share no vertices. Hits have the bits of
    /// [`Storage::Plain`]; rays take longer. Meshes are built in pieces, so a build needs little
    /// more memory than what it keeps. Such meshes cannot be refitted.
    Compact,
}

impl Storage {
    /// Both ways.
    pub const ALL: [Storage; 2] = [Storage::Plain, Storage::Compact];

    /// The name used on command lines and in records.
    pub fn name(self) -> &'static str {
        match self {
            Storage::Plain => "plain",
            Storage::Compact => "compact",
        }
    }
}

/// Options of [`crate::bvh::World::build`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct BuildOptions {
    /// Trade-off between build time and ray time.
    pub quality: BuildQuality,
    /// Edge and vertex behaviour.
    pub robustness: Robustness,
    /// Instruction set of the traversal, and of the shading of frames of the world; `None` for the
    /// best that this machine has. Every one gives the same bits.
    pub simd: Option<crate::simd::SimdLevel>,
    /// Memory against time.
    pub storage: Storage,
}

/// Report on a build: phases, sizes, and primitives left out.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct BuildReport {
    /// Time from input to traversable structure.
    pub total: Duration,
    /// Named phases in order.
    pub phases: Vec<(&'static str, Duration)>,
    /// Primitives that can be hit.
    pub primitives: usize,
    /// Primitives left out because of NaN, infinite or out-of-range input.
    pub skipped: usize,
    /// Bytes of nodes and leaves.
    pub bytes: usize,
    /// Largest number of nodes on a path from a geometry's root to a leaf.
    pub depth: usize,
    /// Deviations from the request, with their reasons; usually empty.
    pub notes: Vec<String>,
}
