//! All available tracers, built for one scene.

use super::compare::{Contender, Kind};
use crate::baselines::BuildCost;
use crate::baselines::embree::{Embree, EmbreeScene, Options, Version};
use crate::baselines::obvhs::{Obvhs, Preset};
use crate::meshes::MeshScene;
use crate::rt_core_tracer::{Mode, RtCoreTracer};
use rt_core::bvh::{BuildOptions, Robustness};
use rt_core::simd::SimdLevel;

/// The widest instruction set that all tracers may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Isa {
    Best,
    Avx2,
    Sse42,
}

impl Isa {
    pub(super) fn name(self) -> &'static str {
        match self {
            Isa::Best => "best",
            Isa::Avx2 => "AVX2",
            Isa::Sse42 => "SSE4.2",
        }
    }

    fn ours(self) -> Option<SimdLevel> {
        match self {
            Isa::Best => None,
            Isa::Avx2 => Some(SimdLevel::Avx2),
            Isa::Sse42 => Some(SimdLevel::Sse42),
        }
    }

    fn embree(self) -> Option<&'static str> {
        match self {
            Isa::Best => None,
            Isa::Avx2 => Some("avx2"),
            Isa::Sse42 => Some("sse4.2"),
        }
    }

    /// Packet widths for which Embree has kernels at this level; it splits others.
    fn embree_widths(self) -> &'static [usize] {
        match self {
            Isa::Best => &[16, 8],
            Isa::Avx2 => &[8],
            Isa::Sse42 => &[4],
        }
    }
}

/// All tracers of one scene.
pub(super) struct TracerSet {
    isa: Isa,
    pub(super) ours: Vec<(String, RtCoreTracer)>,
    embree: Vec<(String, EmbreeScene)>,
    obvhs: Option<(String, Obvhs)>,
}

/// The installed baselines, and messages about the missing ones.
pub(super) struct InstalledBaselines {
    pub(super) embree: Vec<Embree>,
    pub(super) missing: Vec<String>,
}

impl InstalledBaselines {
    pub(super) fn find() -> InstalledBaselines {
        let mut found = InstalledBaselines { embree: vec![], missing: vec![] };
        for version in [Version::V3, Version::V4] {
            match Embree::load(version) {
                Ok(e) => found.embree.push(e),
                Err(e) => found.missing.push(e.for_a_record()),
            }
        }
        found
    }
}

impl TracerSet {
    /// Builds each tracer, fast and watertight or robust, from the same meshes. obvhs, whose
    /// instruction set is fixed at compile time, takes part at the best level only.
    pub(super) fn build(
        scene: &MeshScene,
        installed: &InstalledBaselines,
        isa: Isa,
        report_step: &mut dyn FnMut(&str) -> anyhow::Result<()>,
    ) -> anyhow::Result<TracerSet> {
        let mut tracers = TracerSet { isa, ours: vec![], embree: vec![], obvhs: None };
        for robustness in [Robustness::Watertight, Robustness::Fast] {
            report_step("building rt-core")?;
            let options = BuildOptions { robustness, simd: isa.ours(), ..Default::default() };
            tracers.ours.push((
                format!("rt-core {}", robustness.name()),
                RtCoreTracer::build_scene(scene, &options)?,
            ));
        }
        for e in &installed.embree {
            report_step(&format!("building {}", e.name()))?;
            for robust in [true, false] {
                let options = Options { robust, max_isa: isa.embree(), ..Options::default() };
                let kind = if robust { "robust" } else { "fast" };
                tracers.embree.push((
                    format!("{} {kind}", e.name()),
                    EmbreeScene::build_scene(e, scene, &options)?,
                ));
            }
        }
        // obvhs has no scenes of many meshes.
        if let Some(mesh) = scene.only_mesh().filter(|_| isa == Isa::Best) {
            report_step("building obvhs")?;
            tracers.obvhs = Some(("obvhs CWBVH".into(), Obvhs::build(mesh, Preset::Medium)?));
        }
        Ok(tracers)
    }

    /// All tracers in the modes that suit the rays. `all_modes` adds the modes that are usually
    /// slower.
    pub(super) fn contenders(&self, kind: Kind, all_modes: bool) -> Vec<Contender<'_>> {
        let mut list: Vec<Contender<'_>> = vec![];
        for (name, ours) in &self.ours {
            let suited = if kind.coherent() { Mode::Coherent } else { Mode::Incoherent };
            let modes = if all_modes { vec![suited, Mode::Single] } else { vec![suited] };
            list.extend(modes.into_iter().map(|mode| Contender {
                tracer_name: name.clone(),
                mode: mode.name().into(),
                tracer: Box::new(ours.view(mode)),
            }));
        }
        for (name, scene) in &self.embree {
            let hint = if kind.coherent() { "coherent" } else { "incoherent" };
            let widths = self.isa.embree_widths();
            let sound =
                |width: usize| !(kind.occlusion() && scene.occlusion_fault(width).is_some());
            let widths = widths.iter().copied().filter(|&width| sound(width));
            let widths = widths.take(if all_modes { usize::MAX } else { 1 });
            list.extend(widths.map(|width| Contender {
                tracer_name: name.clone(),
                mode: format!("packets of {width}, {hint}"),
                tracer: Box::new(scene.view(width, kind.coherent())),
            }));
            if all_modes || !kind.coherent() {
                list.push(Contender {
                    tracer_name: name.clone(),
                    mode: "single rays".into(),
                    tracer: Box::new(scene.view(1, kind.coherent())),
                });
            }
        }
        if let Some((name, obvhs)) = &self.obvhs {
            let (tracer_name, mode) = (name.clone(), "single rays".into());
            list.push(Contender { tracer_name, mode, tracer: Box::new(obvhs) });
        }
        list
    }

    /// What is left out because a baseline does not do it.
    pub(super) fn faults(&self) -> Vec<String> {
        let widths = self.isa.embree_widths();
        let of_scene = |scene: &EmbreeScene| {
            widths.iter().filter_map(|&width| scene.occlusion_fault(width)).collect::<Vec<_>>()
        };
        self.embree.iter().flat_map(|(_, scene)| of_scene(scene)).collect()
    }

    /// Cost of each build.
    pub(super) fn costs(&self) -> Vec<(&str, BuildCost)> {
        let ours = self.ours.iter().map(|(n, o)| (n.as_str(), o.cost));
        let embree = self.embree.iter().map(|(n, s)| (n.as_str(), s.cost));
        ours.chain(embree).chain(self.obvhs.iter().map(|(n, o)| (n.as_str(), o.cost))).collect()
    }

    /// The names of the baselines.
    pub(super) fn baseline_names(&self) -> Vec<&str> {
        self.costs().into_iter().map(|(n, _)| n).filter(|n| !n.starts_with("rt-core")).collect()
    }
}
