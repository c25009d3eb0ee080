//! Refuses what light through the cells of a mesh cannot have, by its key and its option.

use super::{Device, Scene, SceneError, TechniqueSpec};

impl Scene {
    /// Refuses keys that need a lattice where `flow.on_cells` is set.
    pub(super) fn check_on_cells(&self) -> Result<(), SceneError> {
        if !self.flow.on_cells {
            return Ok(());
        }
        let (flow, march) = (&self.flow, &self.march);
        let text = |o: &Option<String>| o.clone().unwrap_or_default();
        let method = march.method.as_deref().filter(|m| *m != "verlet");
        let reason_lattice = "needs a lattice";
        let reason_steps = "chooses a march on a lattice";
        let given = [
            ("flow.revolve", "--revolve", flow.revolve, "true".into(), reason_lattice),
            (
                "flow.resample_nodes",
                "--resample",
                flow.resample_nodes.is_some(),
                flow.resample_nodes.unwrap_or(0).to_string(),
                reason_lattice,
            ),
            (
                "flow.resample_samples",
                "--resample-samples",
                flow.resample_samples != 1,
                flow.resample_samples.to_string(),
                reason_lattice,
            ),
            (
                "flow.smoothing_nodes",
                "--smoothing",
                flow.smoothing_nodes != 0.0,
                flow.smoothing_nodes.to_string(),
                "counts in nodes of a lattice",
            ),
            (
                "flow.average_jumps",
                "--smoothing",
                flow.average_jumps,
                "true".into(),
                "looks for jumps from node to node of a lattice",
            ),
            (
                "technique.kind",
                "--technique",
                matches!(
                    self.technique,
                    TechniqueSpec::Volume { .. } | TechniqueSpec::Slice { .. }
                ),
                self.technique.name().into(),
                "reads a lattice",
            ),
            (
                "march.device",
                "--device",
                march.device == Device::Gpu,
                "gpu".into(),
                "computes on a lattice",
            ),
            ("march.method", "--march", method.is_some(), text(&march.method), reason_steps),
            (
                "march.interpolant",
                "--interpolant",
                march.interpolant.is_some(),
                text(&march.interpolant),
                "is of a lattice",
            ),
            (
                "march.step_voxels",
                "--step",
                march.step_voxels.is_some(),
                march.step_voxels.unwrap_or(0.0).to_string(),
                "counts in voxels of a lattice",
            ),
            (
                "march.skip_rad",
                "--skip",
                march.skip_rad > 0.0,
                march.skip_rad.to_string(),
                "skips bricks of a lattice",
            ),
            (
                "media",
                "--absorption, --emission or --rotation",
                !self.media.is_empty(),
                "given".into(),
                "is resampled to a lattice",
            ),
        ];
        match given.into_iter().find(|g| g.2) {
            None => Ok(()),
            Some((key, option, _, value, reason)) => Err(SceneError::Value {
                key,
                value,
                cure: format!(
                    "{option} {reason}, and flow.on_cells (--on-cells) traces light without one; \
                     omit one of the two"
                ),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_needs_a_lattice_is_refused_by_its_key_and_its_option() {
        let scene = |rest: &str| {
            let flow = "[flow]\nfile = \"a.vtu\"\ndensity = \"rho\"\non_cells = true\n";
            Scene::from_toml(&format!("{flow}{rest}")).map_err(|e| e.to_string())
        };
        for (text, key, option) in [
            ("revolve = true", "flow.revolve", "--revolve"),
            ("resample_nodes = 64", "flow.resample_nodes is 64", "--resample"),
            ("resample_samples = 2", "flow.resample_samples", "--resample-samples"),
            ("smoothing_nodes = 1.0", "flow.smoothing_nodes is 1", "--smoothing"),
            ("average_jumps = true", "flow.average_jumps is true", "--smoothing"),
            ("[technique]\nkind = \"volume\"", "technique.kind is volume", "--technique"),
            ("[technique]\nkind = \"slice\"", "technique.kind is slice", "--technique"),
            ("[march]\ndevice = \"gpu\"", "march.device is gpu", "--device"),
            ("[march]\nmethod = \"pefrl\"", "march.method is pefrl", "--march"),
            ("[march]\ninterpolant = \"trilinear\"", "march.interpolant", "--interpolant"),
            ("[march]\nstep_voxels = 0.5", "march.step_voxels is 0.5", "--step"),
            ("[march]\nskip_rad = 1e-9", "march.skip_rad", "--skip"),
            ("[media]\nabsorption = \"soot\"", "media", "--absorption"),
        ] {
            let message = scene(text).expect_err(text);
            for word in [key, option, "--on-cells", "omit"] {
                assert!(message.contains(word), "{text}: {message}");
            }
        }
        for text in [
            "",
            "span = 2.0",
            "outside = \"gas\"",
            "hidden = \"blank\"",
            "reconstruction = \"linear\"",
            "[march]\nmethod = \"verlet\"\ndevice = \"auto\"",
        ] {
            assert!(scene(text).is_ok(), "{text}");
        }
    }
}
