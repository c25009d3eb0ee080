//! Assembles the shader for a scene from the WGSL files in this folder. It contains only what the
//! scene needs.

use super::Method;
use crate::interpolate::Interpolant;

/// Binding of the numbers of a projection, which is sampled where no rays are bound.
pub(super) const PROJECTION: u32 = 1;
/// First binding of the field's slabs. The bindings before it are parameters, rays, kernel outputs
/// and kinds of nodes.
pub(super) const FIRST_SLAB: u32 = 4;
/// Largest number of slabs.
pub(super) const MOST_SLABS: u32 = 60;
/// Bindings of the bricks, and of the counts of skipped steps.
pub(super) const BRICKS: u32 = FIRST_SLAB + MOST_SLABS;
pub(super) const SKIPPING: u32 = BRICKS + 1;

/// How the field lies on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum FieldLayout {
    /// Numbers, divided over this many buffers.
    Slabs(u32),
    /// Rows of four coefficients in the texels of a texture.
    RowTexture,
    /// Rows of four coefficients in a buffer.
    RowBuffer,
    /// For [`Method::LineOfSight`]: a map of its projection along an axis.
    ProjectedAlongAxis,
    /// Likewise along any direction: that map, and two of slopes.
    ProjectedObliquely,
}

impl FieldLayout {
    /// Number of bindings.
    fn bindings(self) -> u32 {
        match self {
            FieldLayout::Slabs(count) => count,
            FieldLayout::ProjectedObliquely => 3,
            FieldLayout::RowTexture | FieldLayout::RowBuffer | FieldLayout::ProjectedAlongAxis => 1,
        }
    }

    /// Number of storage buffers.
    pub(super) fn buffers(self) -> u32 {
        if self == FieldLayout::RowTexture { 0 } else { self.bindings() }
    }
}

/// The features of a kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Kernel {
    pub(super) method: Method,
    pub(super) interpolant: Interpolant,
    /// Whether it computes the optical path difference.
    pub(super) opd: bool,
    /// Whether rays skip bricks. For [`Method::Verlet`].
    pub(super) skip: bool,
    /// Whether the field has blank or solid nodes.
    pub(super) nodes: bool,
    /// Rows are of [`Interpolant::BSpline`] only.
    pub(super) layout: FieldLayout,
}

impl Kernel {
    /// The source text of the shader that marches rays of the host.
    pub(super) fn of_rays(&self) -> String {
        self.march() + include_str!("rays.wgsl")
    }

    /// The source text of the march, without an entry point. Straight rays take no steps: it
    /// samples the projection.
    pub(super) fn march(&self) -> String {
        if self.method == Method::LineOfSight {
            return self.line_of_sight();
        }
        // Only the B-spline is accurate enough to need compensated sums, as on the CPU.
        let spline = self.interpolant == Interpolant::BSpline;
        let mut text = format!(
            "const OPD = {};\nconst COMPENSATED = {spline};\nconst EULER = {};\nconst SKIP = {};\n",
            self.opd,
            self.method == Method::Euler,
            self.skip,
        );
        text += include_str!("march.wgsl");
        text += match self.method {
            Method::Verlet | Method::Euler => include_str!("deviational.wgsl"),
            Method::Pefrl => concat!(include_str!("full.wgsl"), include_str!("pefrl.wgsl")),
            Method::Sharma => concat!(include_str!("full.wgsl"), include_str!("sharma.wgsl")),
            Method::RungeKutta4 => concat!(include_str!("full.wgsl"), include_str!("rk4.wgsl")),
            Method::LineOfSight => "",
        };
        text += &if self.skip {
            include_str!("bricks.wgsl")
                .replace("BRICKS_BINDING", &BRICKS.to_string())
                .replace("SKIPPING_BINDING", &SKIPPING.to_string())
        } else {
            "fn brick_around(at: vec3f) -> vec4f {\n    return vec4f(0.0);\n}\n\nfn \
             count_skipping(steps: u32, skipped: u32, bound_rad: f32) {\n}\n"
                .to_string()
        };
        text += if self.nodes {
            include_str!("nodes.wgsl")
        } else {
            "fn node_kind(at: vec3f) -> u32 {\n    return 0u;\n}\n"
        };
        if spline {
            text += "struct RowSums {\n    value: vec4f,\n    along_z: vec4f,\n}\n\n";
            text += "fn weighted(w: vec4f, v: vec4f) -> f32 {\n    return fma(w.w, v.w, fma(w.z, \
                     v.z, fma(w.y, v.y, w.x * v.x)));\n}\n";
        }
        let source = match self.interpolant {
            Interpolant::BSpline => include_str!("bspline.wgsl"),
            Interpolant::Trilinear => include_str!("trilinear.wgsl"),
            Interpolant::TrilinearGradient => include_str!("trilinear_gradient.wgsl"),
        };
        let (values, origin) = match (self.layout, spline) {
            (FieldLayout::RowTexture, _) => (include_str!("bspline_row_texture.wgsl"), "vec3u"),
            (FieldLayout::RowBuffer, _) => (include_str!("bspline_row_buffer.wgsl"), "u32"),
            (FieldLayout::Slabs(_), true) => (include_str!("bspline_slab.wgsl"), "u32"),
            (_, false) => ("", "u32"),
            (FieldLayout::ProjectedAlongAxis | FieldLayout::ProjectedObliquely, true) => {
                ("", "u32")
            }
        };
        for slab in 0..self.layout.bindings() {
            let binding = (FIRST_SLAB + slab).to_string();
            for part in [values, source] {
                text += &part
                    .replace("BINDING", &binding)
                    .replace("ORIGIN", origin)
                    .replace("SLAB", &slab.to_string());
            }
        }
        text += &self.sample();
        text
    }

    fn line_of_sight(&self) -> String {
        let oblique = self.layout == FieldLayout::ProjectedObliquely;
        let mut text = format!("const OPD = {};\nconst OBLIQUE = {oblique};\n", self.opd);
        text += include_str!("march.wgsl");
        text += &include_str!("line_of_sight.wgsl")
            .replace("PROJECTION_BINDING", &PROJECTION.to_string());
        for (map, binding) in ["path", "right", "up"].iter().zip(FIRST_SLAB..) {
            text += &if oblique || binding == FIRST_SLAB {
                include_str!("map.wgsl")
                    .replace("MAP", map)
                    .replace("BINDING", &binding.to_string())
            } else {
                format!("fn sample_{map}(c: MapCell) -> vec3f {{\n    return vec3f(0.0);\n}}\n")
            };
        }
        text + if self.nodes {
            include_str!("map_nodes.wgsl")
        } else {
            "fn map_node_kind(at: vec2f) -> u32 {\n    return 0u;\n}\n"
        }
    }

    /// The function that samples eps (w) and its gradient per lattice step (xyz) in the slab that
    /// holds the point.
    fn sample(&self) -> String {
        let mut text = "fn sample(at: vec3f) -> vec4f {\n    let p = locate(at);\n".to_string();
        if self.layout == FieldLayout::RowTexture {
            return text + "    return sample_0(p.cell, p.fraction);\n}\n";
        }
        let offset = |z: &str| format!("p.cell.x + p.cell.y * params.row + ({z}) * params.layer");
        let slabs = self.layout.bindings();
        if slabs == 1 {
            text += &format!("    return sample_0({}, p.fraction);\n}}\n", offset("p.cell.z"));
            return text;
        }
        text += "    let slab = p.cell.z / params.slab;\n";
        text += &format!(
            "    let o = {};\n    switch slab {{\n",
            offset("p.cell.z - slab * params.slab")
        );
        for slab in 0..slabs - 1 {
            text += &format!("        case {slab}u: {{ return sample_{slab}(o, p.fraction); }}\n");
        }
        text += &format!(
            "        default: {{ return sample_{}(o, p.fraction); }}\n    }}\n}}\n",
            slabs - 1
        );
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::naga;

    const LAYOUTS: [FieldLayout; 5] = [
        FieldLayout::Slabs(1),
        FieldLayout::Slabs(2),
        FieldLayout::Slabs(7),
        FieldLayout::RowTexture,
        FieldLayout::RowBuffer,
    ];

    const INTERPOLANTS: [Interpolant; 3] =
        [Interpolant::BSpline, Interpolant::Trilinear, Interpolant::TrilinearGradient];

    fn all() -> impl Iterator<Item = Kernel> {
        let of = |method, interpolant, layout, k: u32| Kernel {
            method,
            interpolant,
            opd: k & 1 != 0,
            nodes: k & 2 != 0,
            skip: k & 4 != 0,
            layout,
        };
        let mut kernels = Vec::new();
        for method in Method::ALL.into_iter().filter(|m| *m != Method::LineOfSight) {
            for interpolant in INTERPOLANTS {
                for layout in LAYOUTS {
                    // Rows are coefficients, and one march skips.
                    let is_slabs = matches!(layout, FieldLayout::Slabs(_));
                    if is_slabs || interpolant == Interpolant::BSpline {
                        let features = if method == Method::Verlet { 8 } else { 4 };
                        kernels.extend((0..features).map(|k| of(method, interpolant, layout, k)));
                    }
                }
            }
        }
        kernels.into_iter()
    }

    fn parsed(wgsl: &str) -> naga::Module {
        naga::front::wgsl::parse_str(wgsl).unwrap_or_else(|e| panic!("{}", e.emit_to_string(wgsl)))
    }

    /// Needs no device. The validator has no capabilities, so the shader uses nothing that only
    /// some devices have. This excludes f64 in particular: naga accepts its exp(), but drivers
    /// return wrong values.
    #[test]
    fn every_shader_is_valid_wgsl_for_every_device() {
        use naga::valid::{Capabilities, ValidationFlags, Validator};
        for kernel in all() {
            let wgsl = kernel.of_rays();
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            if let Err(e) = validator.validate(&parsed(&wgsl)) {
                panic!("{kernel:?}: {}", e.emit_to_string(&wgsl));
            }
        }
    }

    /// The structures that Rust writes have the layout that the shader reads.
    #[test]
    fn structures_have_the_sizes_that_are_written() {
        for kernel in all() {
            let module = parsed(&kernel.of_rays());
            for (name, bytes) in [("Params", 96), ("Ray", 64), ("KernelOutput", 32)] {
                let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
                let naga::TypeInner::Struct { span, .. } = found.expect(name).1.inner else {
                    panic!("{name} is no structure")
                };
                assert_eq!(span, bytes, "{name}");
            }
        }
    }

    #[test]
    fn what_is_not_wanted_is_not_bound() {
        for kernel in all() {
            let module = parsed(&kernel.of_rays());
            let bound =
                module.global_variables.iter().filter(|(_, v)| v.binding.is_some()).count() as u32;
            assert_eq!(
                bound,
                3 + u32::from(kernel.nodes) + 2 * u32::from(kernel.skip) + kernel.layout.bindings(),
                "{kernel:?}"
            );
        }
    }
}
