//! What a frame costs the driver, and what it would cost rays, in nanoseconds of processor time,
//! summed over threads. Both follow from counts alone, so equal calls have equal costs on every
//! run.
//!
//! The numbers are those of Mesa's llvmpipe 22.3 and of this crate on an AMD EPYC with AVX-512 (see
//! `docs/src/gluray/speed.md`). Only their ratio matters. Other processors are taken to have the
//! same, because both sides are vector code on the same cores; that was not measured.

/// What the driver draws in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct DriverWork {
    /// Draw calls; a pair of Begin and End is one.
    pub(crate) draws: f64,
    pub(crate) triangles: f64,
    /// Pixels that they cover in the end.
    pub(crate) pixels: f64,
}

/// What rays do for the same frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct RayWork {
    /// How often traced draws are brought into the framebuffer.
    pub(crate) sets: f64,
    /// The draws in them, after those of one state were joined.
    pub(crate) draws: f64,
    /// The triangles that are captured, or found unchanged.
    pub(crate) triangles: f64,
    /// The triangles of acceleration structures that are built for the frame.
    pub(crate) built: f64,
    /// Pixels of the rectangles that are searched for surfaces, once for each draw.
    pub(crate) searched: f64,
    /// Pixels at which rays find a surface.
    pub(crate) covered: f64,
    /// Pixels of the rectangles that are brought into the framebuffer.
    pub(crate) presented: f64,
}

/// A driver's costs, in nanoseconds each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DriverSpeed {
    draw_ns: f64,
    triangle_ns: f64,
    pixel_ns: f64,
}

/// llvmpipe, measured in 1024 x 1024 pixels: lit triangles of vertex arrays, from a thousand to 16
/// million; for draws, geomview, which has a Begin and End for each triangle.
const SOFTWARE: DriverSpeed = DriverSpeed { draw_ns: 400.0, triangle_ns: 200.0, pixel_ns: 10.0 };

/// A processor of graphics. Not measured: a billion triangles and ten billion pixels a second are
/// less than small ones have had for ten years, and their work costs the program no processor time.
const HARDWARE: DriverSpeed = DriverSpeed { draw_ns: 400.0, triangle_ns: 1.0, pixel_ns: 0.1 };

impl DriverSpeed {
    /// The costs of the driver with this name (`GL_RENDERER`).
    pub(crate) fn of(renderer: &str) -> DriverSpeed {
        let software = ["llvmpipe", "softpipe", "swrast", "Software", "SWR"];
        match software.iter().any(|name| renderer.contains(name)) {
            true => SOFTWARE,
            false => HARDWARE,
        }
    }

    /// What the driver takes for a frame, in nanoseconds.
    pub(crate) fn ns(&self, w: &DriverWork) -> f64 {
        self.draw_ns * w.draws + self.triangle_ns * w.triangles + self.pixel_ns * w.pixels
    }
}

impl Default for DriverSpeed {
    fn default() -> DriverSpeed {
        SOFTWARE
    }
}

const SET_NS: f64 = 150_000.0;
const DRAW_NS: f64 = 5_000.0;
const TRIANGLE_NS: f64 = 6.0;
/// Fast builds; a refit takes a sixth, which is counted as so many fewer triangles.
const BUILT_NS: f64 = 200.0;
const SEARCHED_NS: f64 = 20.0;
const COVERED_NS: f64 = 80.0;
/// What a hit costs more with each doubling of the triangles beyond a thousand.
const DOUBLING_NS: f64 = 3.0;
const PRESENTED_NS: f64 = 12.0;

/// What rays take for a frame, in nanoseconds.
pub(crate) fn rays_ns(w: &RayWork) -> f64 {
    let doublings = (w.triangles / 1000.0).max(1.0).log2();
    SET_NS * w.sets
        + DRAW_NS * w.draws
        + TRIANGLE_NS * w.triangles
        + BUILT_NS * w.built
        + SEARCHED_NS * w.searched
        + (COVERED_NS + DOUBLING_NS * doublings) * w.covered
        + PRESENTED_NS * w.presented
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(triangles: f64, pixels: f64) -> [f64; 2] {
        let driver = DriverWork { draws: 1.0, triangles, pixels };
        let rays = RayWork {
            sets: 1.0,
            draws: 1.0,
            triangles,
            searched: 2.0 * pixels,
            covered: pixels,
            presented: 2.0 * pixels,
            ..RayWork::default()
        };
        [SOFTWARE.ns(&driver), rays_ns(&rays)]
    }

    #[test]
    fn a_rasterizer_is_cheaper_with_few_triangles_and_rays_with_many() {
        let half = 512.0 * 1024.0;
        for (triangles, rays_win) in [(1e3, false), (6e4, false), (1e6, true), (1.6e7, true)] {
            let [driver, rays] = of(triangles, half);
            assert_eq!(rays < driver, rays_win, "{triangles}: {driver} and {rays}");
        }
        let [driver, rays] = of(1.6e7, half);
        assert!(driver > 10.0 * rays, "{driver} and {rays}");
    }

    #[test]
    fn processors_of_graphics_are_told_from_software() {
        let name = "llvmpipe (LLVM 15.0.6, 256 bits)";
        assert_eq!(DriverSpeed::of(name), SOFTWARE);
        assert_eq!(DriverSpeed::of("Mesa Intel(R) Xe Graphics (TGL GT2)"), HARDWARE);
    }
}
