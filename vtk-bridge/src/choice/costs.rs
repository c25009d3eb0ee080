//! The model: what a frame costs in OpenGL and with rays.
//!
//! All numbers are milliseconds of CPU, summed over the threads. Those of OpenGL are llvmpipe's.

use super::volume_work::VolumeWork;
use super::{SceneFacts, Way};
use rt_core::simd::SimdLevel;

/// What a part of a frame costs in both ways.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PartCosts {
    /// In a frame of OpenGL.
    pub opengl: f64,
    /// In a frame of rays.
    pub rays: f64,
    /// What its first frame of rays costs beyond that.
    pub build: f64,
}

impl std::ops::AddAssign for PartCosts {
    fn add_assign(&mut self, other: PartCosts) {
        self.opengl += other.opengl;
        self.rays += other.rays;
        self.build += other.build;
    }
}

/// Nanoseconds of CPU for a sample of a volume, each in a grid that lies in the caches and in one
/// that does not.
#[derive(Debug, Clone, Copy)]
struct SampleCosts {
    /// Of every sample.
    any: [f64; 2],
    /// What a sample with an opacity adds.
    seen: [f64; 2],
    /// What light adds to every sample, seen or not.
    light: [f64; 2],
    /// What light adds to a sample with an opacity.
    light_of_seen: [f64; 2],
}

// The constants of volumes come from `vtk-bridge/python/measure_volumes.py`, whole frames of the
// wheel's VTK 9.7 with EGL and llvmpipe, and of rtvtk with the library of the development profile,
// three rounds in turns on an EPYC with AVX-512 (load 0.8 to 1.7). A nearly empty frame (--zoom
// 0.05) gives what a pixel costs; then, at a distance of samples of one point:
//
//     points, pixels   what is seen      stock, ms   rtvtk, ms   samples, M   seen, M
//     65^3, 512^2      nearly nothing    0.8         25          0            0
//     65^3, 512^2      all               106         92          5.45         5.45
//     65^3, 512^2      all, shaded       331         255         5.45         5.45
//     65^3, 512^2      half              112         87          5.45         1.99
//     65^3, 512^2      half, shaded      324         149         5.45         1.99
//     65^3, 512^2      dense core        90          61          4.48         0.50
//     129^3, 512^2     all               227         172         10.85        10.85
//     129^3, 512^2     all, shaded       709         525         10.85        10.85
//     257^3, 256^2     all               186         161         5.40         5.40
//     257^3, 256^2     all, shaded       498         361         5.40         5.40
//     257^3, 256^2     half              180         101         5.40         1.98
//     257^3, 256^2     half, shaded      483         205         5.40         1.98

/// Points of the largest grid that lies in the caches, and of one that does not.
const POINTS: [f64; 2] = [129.0 * 129.0 * 129.0, 257.0 * 257.0 * 257.0];
const OPENGL_SAMPLE: SampleCosts =
    SampleCosts { any: [20.0, 34.0], seen: [0.0; 2], light: [40.0, 57.0], light_of_seen: [0.0; 2] };
/// With AVX-512.
const RAYS_SAMPLE: SampleCosts = SampleCosts {
    any: [9.1, 13.0],
    seen: [3.3, 13.0],
    light: [0.0; 2],
    light_of_seen: [30.0, 45.0],
};
/// How many times as long rays take with other instructions: for samples, and for their light.
#[derive(Debug, Clone, Copy)]
struct Slower {
    samples: f64,
    light: f64,
}

const AS_FAST: Slower = Slower { samples: 1.0, light: 1.0 };
/// Of rt-core's frames of 512 by 512 pixels with 65 points an axis, samples a spacing apart: 1.31
/// and 1.36, and 2.5 for what light adds
/// (bench/runs/2026-11-27-2core-avx-512-amd-epyc/instruction-sets-before-and-after.csv). Grids
/// beyond the caches were not measured. llvmpipe's vectors are no wider with AVX-512, so its time
/// is the same.
const AVX2: Slower = Slower { samples: 1.4, light: 2.5 };
/// Against OpenGL's, which is slower too: with SSE2 the loops alone were measured, at 0.85 to 1.2
/// times the speed of OpenGL's where AVX-512 has 1.2 to 2.5.
const SSE: Slower = Slower { samples: 2.0, light: 2.0 };
/// Milliseconds of a frame of rays with a volume for a million pixels, beside its samples.
const LAYER: f64 = 95.0;
/// Milliseconds of OpenGL's frame of volumes alone for a million pixels, beside their samples.
const EMPTY: f64 = 4.5;
/// Nanoseconds for a point of a volume, when rays first draw it.
const BUILD_POINT: f64 = 20.0;

impl SampleCosts {
    /// Milliseconds of all samples.
    fn of(&self, work: &VolumeWork, slower: Slower) -> f64 {
        let [small, large] = POINTS.map(f64::ln);
        let part = (((work.points.max(1) as f64).ln() - small) / (large - small)).clamp(0.0, 1.0);
        let at = |[small, large]: [f64; 2]| small + (large - small) * part;
        let lit = |pair| if work.shaded { at(pair) } else { 0.0 };
        let any = slower.samples * at(self.any) + slower.light * lit(self.light);
        let seen = slower.samples * at(self.seen) + slower.light * lit(self.light_of_seen);
        1e-6 * (any * work.samples + seen * work.seen)
    }
}

impl PartCosts {
    /// A volume's part of a frame, with rays at this level.
    pub fn of_volume(work: &VolumeWork, level: Option<SimdLevel>) -> PartCosts {
        let slower = match level {
            Some(SimdLevel::Avx512) => AS_FAST,
            Some(SimdLevel::Avx2) => AVX2,
            _ => SSE,
        };
        PartCosts {
            opengl: OPENGL_SAMPLE.of(work, AS_FAST),
            rays: RAYS_SAMPLE.of(work, slower),
            build: 1e-6 * BUILD_POINT * work.points as f64,
        }
    }

    /// What a frame costs without its volumes.
    fn of_the_rest(f: &SceneFacts) -> PartCosts {
        let (megapixels, mega) = (f.pixels as f64 * 1e-6, f.triangles as f64 * 1e-6);
        let props = f64::from(f.props);
        let (veils, edges) = (f.translucent > 0, f.edges > 0);
        let alone = f.volumes > 0 && f.triangles == 0;
        let opengl = if alone { EMPTY } else { 38.0 } * megapixels
            + mega * if edges { 500.0 } else { 300.0 }
            + 0.04 * props
            + if veils { 20.0 * megapixels } else { 0.0 };
        // What OpenGL draws among translucent surfaces, and lines that they hide, need the depth of
        // the first of them, which is another ray, and two rectangles.
        let apart = f.others > 0 || f.unknown_volumes > 0;
        let pixel = match (veils, edges) {
            (true, _) if edges || apart => 240.0,
            (true, _) => 125.0,
            (_, true) => 150.0,
            _ if alone => 0.0,
            _ => 75.0,
        };
        let rays = pixel * megapixels + 6.0 * mega + props * if f.python { 0.12 } else { 0.03 };
        PartCosts { opengl, rays, build: 400.0 * mega + 2.0 }
    }

    /// What a layer that is blended adds to a frame of rays with volumes.
    fn of_layer(f: &SceneFacts) -> f64 {
        let blended = f.volumes > f.unknown_volumes && f.translucent == 0;
        if blended { LAYER * 1e-6 * f.pixels as f64 } else { 0.0 }
    }
}

/// What a frame costs each way, and what its first frame costs beyond that. Infinite where that way
/// would not give OpenGL's picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    opengl: f64,
    surfaces: [f64; 2],
    all: [f64; 2],
}

impl Costs {
    /// The model.
    pub fn of(f: &SceneFacts) -> Costs {
        const NEVER: [f64; 2] = [f64::INFINITY; 2];
        if !f.software {
            // That was not measured.
            return Costs { opengl: 0.0, surfaces: NEVER, all: NEVER };
        }
        let (rest, media) = (PartCosts::of_the_rest(f), f.media);
        let apart = f.volumes > 0 && f.triangles > 0 && f.translucent == 0;
        let together =
            f.volumes == 0 || f.translucent > 0 || f.unknown_volumes == 0 && f.others == 0;
        let surfaces = [rest.rays + media.opengl, rest.build];
        let all = [rest.rays + PartCosts::of_layer(f) + media.rays, rest.build + media.build];
        Costs {
            opengl: rest.opengl + media.opengl,
            surfaces: if apart { surfaces } else { NEVER },
            all: if together { all } else { NEVER },
        }
    }

    /// Milliseconds of a frame.
    pub fn frame(&self, way: Way) -> f64 {
        match way {
            Way::OpenGl => self.opengl,
            Way::Surfaces => self.surfaces[0],
            Way::All => self.all[0],
        }
    }

    /// What the first frame costs beyond that.
    pub fn build(&self, way: Way) -> f64 {
        match way {
            Way::OpenGl => 0.0,
            Way::Surfaces => self.surfaces[1],
            Way::All => self.all[1],
        }
    }

    /// The cheapest way; OpenGL where others are no cheaper.
    pub fn best(&self) -> Way {
        let rays = self.best_of_rays();
        if self.frame(rays) < self.frame(Way::OpenGl) { rays } else { Way::OpenGl }
    }

    /// The cheaper way with rays.
    pub fn best_of_rays(&self) -> Way {
        if self.surfaces[0] < self.all[0] { Way::Surfaces } else { Way::All }
    }
}
