//! Assembles the shaders of a frame: the march, and what the scene's light and technique need.

use super::media::FrameMedia;
use super::technique::TechniqueShader;
use crate::gpu::Method;
use crate::gpu::kernel::Kernel;
use crate::optics::SourceImage;
use rt_core::sampler::Sampling;

/// The features of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameShader<'a> {
    pub(super) march: Kernel,
    pub(super) technique: &'a TechniqueShader<'a>,
    /// What dims the light on its way.
    pub(super) media: Option<&'a FrameMedia<'a>>,
    /// Channels of the film: 1, or 3 for colours.
    pub(super) channels: usize,
    /// Whether each photon travels in the beam of its own source point.
    pub(super) tilted_beams: bool,
    /// Whether energy stays in the pixel of the ray.
    pub(super) from_film: bool,
    /// Whether photons are counted.
    pub(super) counts: bool,
    /// Whether photons are kept for the cone filter.
    pub(super) keeps: bool,
    /// Whether the CPU tells which rays bodies stop.
    pub(super) bodies: bool,
    pub(super) sampling: Sampling,
    /// The source, if each photon has its own point of it.
    pub(super) source: Option<SourceImage>,
}

impl FrameShader<'_> {
    fn film(&self) -> String {
        let mut text = format!("const CHANNELS = {}u;\n", self.channels);
        text += include_str!("frame.wgsl");
        text + include_str!("film.wgsl")
    }

    fn light(&self) -> String {
        let source = match self.source {
            None | Some(SourceImage::Point) => 0,
            Some(SourceImage::Rectangle { .. }) => 1,
            Some(SourceImage::Disc { .. }) => 2,
        };
        let mut text = format!(
            "const TILTED_BEAMS = {};\nconst FROM_FILM = {};\nconst RANDOM = {};\nconst SOURCE = \
             {source}u;\n",
            self.tilted_beams,
            self.from_film,
            self.sampling == Sampling::Random,
        );
        let crossing = match self.march.method {
            Method::LineOfSight => include_str!("crossing_straight.wgsl"),
            _ => include_str!("crossing_bent.wgsl"),
        };
        for part in [
            include_str!("double.wgsl"),
            include_str!("sampler.wgsl"),
            include_str!("start.wgsl"),
            include_str!("exit.wgsl"),
            crossing,
            &self.technique.text,
        ] {
            text += part;
        }
        text += if self.bodies {
            include_str!("bodies.wgsl")
        } else {
            "fn is_behind_body(ray: u32) -> bool {\n    return false;\n}\n"
        };
        text += &match self.media {
            Some(media) => media.wgsl(),
            None => "const MEDIA = false;\n\nfn passes_medium(image_point_m: vec2f, tilt: vec2f) \
                     -> f32 {\n    return 1.0;\n}\n"
                .to_string(),
        };
        self.march.march() + &text
    }

    /// Traces photons and deposits them. The entry point is `photons`.
    pub(super) fn photons(&self) -> String {
        let counts = format!("const COUNTS = {};\n", self.counts);
        let keep = if self.keeps {
            concat!(include_str!("squares.wgsl"), include_str!("keep.wgsl"))
        } else {
            "fn keep(slot: u32, at: vec2f, energy: vec3f) {\n}\n"
        };
        self.light() + &self.film() + &counts + keep + include_str!("photons.wgsl")
    }

    /// What kernels over kept photons share.
    fn squares(&self) -> String {
        let channels = format!("const CHANNELS = {}u;\n", self.channels);
        channels + include_str!("frame.wgsl") + include_str!("squares.wgsl")
    }

    /// Sorts photons that are kept. The entry points are `add_rows`, `begin_squares` and
    /// `order_photons`, in this order.
    pub(super) fn sort(&self) -> String {
        self.squares() + include_str!("sort.wgsl")
    }

    /// The cone filter of sorted photons. The entry point is `cone`.
    pub(super) fn cone(&self) -> String {
        self.squares() + include_str!("cone.wgsl")
    }

    /// Traces the corners of a beam's cells. The entry point is `trace_corners`.
    pub(super) fn corners(&self) -> String {
        let channels = format!("const CHANNELS = {}u;\n", self.channels);
        self.light() + &channels + include_str!("frame.wgsl") + include_str!("corners.wgsl")
    }

    /// Filters the film along rows, or what comes of it along columns: the picture, or with
    /// `noise` the difference of its two films. The entry point is `filter_noise`.
    pub(super) fn filter(&self, rows: bool, films: usize, noise: bool) -> String {
        let constants = format!(
            "const CHANNELS = {}u;\nconst ROWS = {rows};\nconst FILMS = {films}u;\nconst NOISE = \
             {noise};\n",
            self.channels
        );
        let of_pass = if rows {
            include_str!("filter_rows.wgsl")
        } else {
            include_str!("filter_columns.wgsl")
        };
        constants + include_str!("frame.wgsl") + of_pass + include_str!("filter.wgsl")
    }

    /// Distributes the energy of cells. The entry point is `distribute_cells`.
    pub(super) fn triangles(&self) -> String {
        self.film() + include_str!("triangles.wgsl")
    }
}

#[cfg(test)]
mod tests {
    use super::super::params::FrameParams;
    use super::*;
    use crate::cutoff::{Aperture, ColorWheel, Cutoff, FilterImage, Knife, KnifePosition, Passes};
    use crate::gpu::kernel::FieldLayout;
    use crate::gpu::projection::ProjectionParams;
    use crate::interpolate::Interpolant;
    use crate::media::Volume;
    use crate::optics::{Optics, SourceShape};
    use crate::technique::{Technique, bos, interferogram, schlieren::Schlieren};
    use glam::DVec3;
    use wgpu::naga;

    fn techniques() -> Vec<Technique> {
        let sources = [
            SourceShape::Point,
            SourceShape::Slit { width_m: 1e-3, length_m: 5e-3, angle_deg: 0.0 },
            SourceShape::Slit { width_m: 1e-3, length_m: 5e-3, angle_deg: 30.0 },
            SourceShape::Circle { diameter_m: 1e-3 },
        ];
        let cutoffs = [
            Cutoff::Open,
            Cutoff::Knife(Knife { angle_deg: 0.0, position: KnifePosition::OpenFraction(0.5) }),
            Cutoff::Aperture(Aperture {
                radius_m: 1e-3,
                center_m: [0.0; 2],
                passes: Passes::Outside,
            }),
            Cutoff::Color(ColorWheel { radius_m: 1e-3, red_deg: 0.0 }),
            Cutoff::Image(FilterImage::new(2, 1, [1e-2; 2], vec![[1.0; 3], [0.0; 3]]).unwrap()),
        ];
        let mut all = vec![Technique::Shadowgraph(Optics::DEFAULT)];
        for source in sources {
            let optics = Optics { source, ..Optics::DEFAULT };
            for cutoff in &cutoffs {
                let s = Schlieren::new(optics, cutoff, false);
                all.push(Technique::Schlieren(s.clone()));
                all.push(Technique::Schlieren(s.with_band([0.2, 0.3, 0.5])));
            }
        }
        all.push(Technique::Interferogram(interferogram::Interferogram::new(
            Optics::DEFAULT,
            633e-9,
            1.0,
            None,
            1.0,
        )));
        let dots = bos::Dots { diameter_m: 1e-3, spacing_m: 2e-3, seed: 1 };
        all.push(Technique::Bos(bos::Bos::new(Optics::DEFAULT, dots)));
        all
    }

    fn parsed(wgsl: &str) -> naga::Module {
        naga::front::wgsl::parse_str(wgsl).unwrap_or_else(|e| panic!("{}", e.emit_to_string(wgsl)))
    }

    /// As the test of the march's shader: valid without any capability that only some devices have.
    #[test]
    fn every_shader_of_a_frame_is_valid_wgsl_for_every_device() {
        use naga::valid::{Capabilities, ValidationFlags, Validator};
        let property = Volume::new([2; 3], [1.0; 3], DVec3::ZERO, vec![1.0; 8], None).unwrap();
        let mut checked = 0;
        for technique in &techniques() {
            let of_technique = TechniqueShader::new(technique, 1.0).unwrap();
            for k in 0..16u32 {
                let method = Method::ALL[k as usize % Method::ALL.len()];
                let is_straight = method == Method::LineOfSight;
                let source = technique.optics().source_image();
                let media = FrameMedia {
                    absorption: (k & 1 != 0).then_some(&property),
                    rotation: (k & 2 != 0).then_some(&property),
                    analyser_rad: (k & 2 != 0).then_some(0.5),
                    bent: k & 4 != 0,
                    step_voxels: 1.0,
                    origin_m: DVec3::ZERO,
                    cache: None,
                };
                let shader = FrameShader {
                    march: Kernel {
                        method,
                        interpolant: Interpolant::BSpline,
                        skip: k == 0,
                        opd: technique.needs_opd(),
                        nodes: k & 1 != 0,
                        layout: match (is_straight, k < 8) {
                            (false, _) => FieldLayout::Slabs(1),
                            (true, false) => FieldLayout::ProjectedAlongAxis,
                            (true, true) => FieldLayout::ProjectedObliquely,
                        },
                    },
                    technique: &of_technique,
                    media: (k & 3 != 0).then_some(&media),
                    channels: if k & 2 == 0 { 1 } else { 3 },
                    tilted_beams: k & 4 != 0,
                    from_film: technique.samples_from_film(),
                    counts: k & 1 != 0,
                    keeps: k & 4 != 0,
                    bodies: k & 2 != 0,
                    sampling: Sampling::ALL[(k & 1) as usize],
                    source: (k & 4 != 0 || technique.needs_source_points()).then_some(source),
                };
                for wgsl in [
                    shader.photons(),
                    shader.corners(),
                    shader.triangles(),
                    shader.sort(),
                    shader.cone(),
                    shader.filter(k & 1 == 0, 1 + (k as usize >> 1 & 1), k & 2 != 0),
                ] {
                    let module = parsed(&wgsl);
                    let mut v = Validator::new(ValidationFlags::all(), Capabilities::empty());
                    if let Err(e) = v.validate(&module) {
                        panic!("{shader:?}: {}", e.emit_to_string(&wgsl));
                    }
                    let named = |name| move |t: &naga::Type| t.name.as_deref() == Some(name);
                    for (name, bytes) in [
                        ("Frame", size_of::<FrameParams>()),
                        ("Projection", size_of::<ProjectionParams>()),
                    ] {
                        let found = module.types.iter().find(|(_, t)| named(name)(t));
                        let Some((_, found)) = found else {
                            assert!(name != "Frame", "no Frame");
                            continue;
                        };
                        let naga::TypeInner::Struct { span, .. } = found.inner else {
                            panic!("{name} is no structure")
                        };
                        assert_eq!(span as usize, bytes, "{name}");
                    }
                    checked += 1;
                }
            }
        }
        assert_eq!(checked, (1 + 4 * 10 + 2) * 16 * 6);
    }
}
