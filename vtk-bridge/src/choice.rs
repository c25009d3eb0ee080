//! Whether rays or OpenGL draw a renderer, where its picture is the same either way.
//!
//! Without effects the picture is VTK's own, so the cheaper way is the better one. A model of both
//! costs decides, never a clock: the same sequence of frames is always drawn in the same way. Its
//! constants are CPU milliseconds measured with llvmpipe. A hardware driver is taken to be cheaper
//! than rays on the processor, whatever the scene; that was not measured.
//!
//! Rays first need an acceleration structure, which a script that draws one image never gets back.
//! So OpenGL draws until the model says that rays would have saved a part of its cost, and a
//! decision changes only for a difference of a `MARGIN`.

pub mod costs;
pub mod media;
pub mod volume_work;

use costs::{Costs, PartCosts};

/// What the costs depend on.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SceneFacts {
    /// Pixels of the viewport.
    pub pixels: u64,
    /// Visible props.
    pub props: u32,
    /// Triangles of all props that can be ray traced, in all copies.
    pub triangles: u64,
    /// Volumes.
    pub volumes: u32,
    /// Volumes that OpenGL draws anyway, or of which the model does not know what they cost.
    pub unknown_volumes: u32,
    /// What the other volumes cost.
    pub media: PartCosts,
    /// Props in space, other than volumes, that OpenGL draws anyway. Beside a traced volume they
    /// would be wholly before or behind it.
    pub others: u32,
    /// Props with translucent surfaces.
    pub translucent: u32,
    /// Props with visible edges.
    pub edges: u32,
    /// OpenGL's driver works on the processor.
    pub software: bool,
    /// The caller is the Python package, which needs more time for each prop than the shim.
    pub python: bool,
    /// The user turns the scene, and OpenGL may take fewer samples of volumes.
    pub interactive: bool,
}

/// Who draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Way {
    /// OpenGL.
    #[default]
    OpenGl,
    /// Rays draw surfaces, and OpenGL the volumes among them.
    Surfaces,
    /// Rays draw whatever they can.
    All,
}

/// A way is left only when the other one costs this much less.
const MARGIN: f64 = 1.15;
/// Rays begin when OpenGL has cost more by this part of what building costs.
const PAID: f64 = 0.25;
/// Frames after which the facts are collected again, if nothing else asks for it.
const KEEP: u32 = 16;

/// The decisions for one renderer.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    way: Way,
    facts: SceneFacts,
    /// Frames since the facts were collected.
    age: u32,
    /// Frames so far.
    frames: u64,
    /// Milliseconds that another way would have saved.
    saved: f64,
}

impl Choice {
    /// Whether the last decision cannot stand for a frame of this size with this many props:
    /// [`Choice::decide`] then needs the scene's facts. The first frame is OpenGL's whatever the
    /// facts, which need not be known before it is drawn.
    pub fn is_due(&self, pixels: u64, props: u32, interactive: bool) -> bool {
        let known = &self.facts;
        let turns = known.volumes > 0 && known.interactive != interactive;
        let same = known.pixels == pixels && known.props == props && !turns;
        self.frames > 0 && (self.age >= KEEP || !same)
    }

    /// Decides for the next frame, with new facts if there are any.
    pub fn decide(&mut self, facts: Option<SceneFacts>) -> Way {
        self.frames += 1;
        self.age += 1;
        if let Some(facts) = facts {
            (self.facts, self.age) = (facts, 0);
        } else if self.frames == 1 {
            return self.way;
        }
        let costs = Costs::of(&self.facts);
        let (now, best) = (costs.frame(self.way), costs.best());
        if costs.frame(best) * MARGIN < now {
            self.saved += now - costs.frame(best);
            if self.saved >= PAID * costs.build(best) {
                (self.way, self.saved) = (best, 0.0);
            }
        }
        self.way
    }

    /// Whether OpenGL draws the volumes also where rays draw the surfaces.
    pub fn leaves_volumes(&self) -> bool {
        self.way == Way::Surfaces
    }

    /// Why the last frame is drawn as it is, for the report, with the model's numbers.
    pub fn reason(&self) -> String {
        if self.facts.pixels == 0 {
            return "the first image is drawn as stock, without effects that need rays \
                    (RTV_ALWAYS_TRACE=1 traces it)"
                .to_owned();
        }
        if !self.facts.software {
            return "OpenGL's driver is hardware, which is taken to be faster, and no effect needs \
                    rays (RTV_ALWAYS_TRACE=1 traces)"
                .to_owned();
        }
        let costs = Costs::of(&self.facts);
        let (opengl, rays) = (costs.frame(Way::OpenGl), costs.frame(costs.best_of_rays()));
        match self.way {
            Way::OpenGl if rays.is_infinite() => self.why_volumes_are_not_compared().to_owned(),
            Way::OpenGl => in_opengl(opengl, rays),
            Way::Surfaces | Way::All => {
                let now = costs.frame(self.way);
                format!("rays: about {now:.0} ms of CPU a frame, OpenGL {opengl:.0} ms")
            }
        }
    }

    /// Why OpenGL draws the volumes of a frame whose surfaces are traced.
    pub fn reason_of_volumes(&self) -> String {
        let costs = Costs::of(&self.facts);
        if costs.frame(Way::All).is_infinite() {
            return self.why_volumes_are_not_compared().to_owned();
        }
        in_opengl(self.facts.media.opengl, self.facts.media.rays)
    }

    fn why_volumes_are_not_compared(&self) -> &'static str {
        if self.facts.unknown_volumes > 0 {
            "OpenGL draws volumes of which it was not measured what they cost with rays, and no \
             effect needs rays (RTV_ALWAYS_TRACE=1 traces)"
        } else {
            "OpenGL draws volumes with lines, points or other props among them that are not \
             traced, and no effect needs rays (RTV_ALWAYS_TRACE=1 traces)"
        }
    }
}

/// The reason for OpenGL, with milliseconds of both ways.
fn in_opengl(opengl: f64, rays: f64) -> String {
    let why = if opengl <= rays {
        "cheaper in OpenGL"
    } else if opengl <= rays * MARGIN {
        "hardly dearer in OpenGL"
    } else {
        "in OpenGL until rays have paid for what they build"
    };
    format!(
        "{why}: about {opengl:.0} ms of CPU a frame, rays {rays:.0} ms, and no effect needs rays \
         (RTV_ALWAYS_TRACE=1 traces)"
    )
}

#[cfg(test)]
mod tests {
    use super::volume_work::VolumeWork;
    use super::*;
    use rt_core::simd::SimdLevel;

    const BEST: SimdLevel = SimdLevel::Avx512;

    fn scene(triangles: u64) -> SceneFacts {
        let pixels = 1 << 20;
        SceneFacts { pixels, props: 1, triangles, software: true, ..SceneFacts::default() }
    }

    /// A cube of so many points per axis, in half of a picture of 512 by 512 pixels.
    fn volume(points: u32, shaded: bool, level: SimdLevel) -> SceneFacts {
        let pixels = 1 << 18;
        let covered = 0.5 * pixels as f64;
        let samples = covered * 0.8 * f64::from(points);
        let points = u64::from(points).pow(3);
        let work = VolumeWork { pixels: covered, samples, seen: 0.5 * samples, points, shaded };
        let media = PartCosts::of_volume(&work, Some(level));
        SceneFacts { pixels, triangles: 0, volumes: 1, media, ..scene(0) }
    }

    fn last(facts: SceneFacts) -> Way {
        ways(facts, 40)[39]
    }

    fn ways(facts: SceneFacts, frames: usize) -> Vec<Way> {
        let mut choice = Choice::default();
        (0..frames)
            .map(|_| {
                let due = choice.is_due(facts.pixels, facts.props, facts.interactive);
                choice.decide(due.then_some(facts))
            })
            .collect()
    }

    #[test]
    fn the_first_image_is_opengls_and_large_meshes_are_traced_after_a_few() {
        for triangles in [1_000_000, 16_000_000] {
            let found = ways(scene(triangles), 6);
            assert_eq!((found[0], found[5]), (Way::OpenGl, Way::All), "{triangles}");
        }
        assert!(ways(scene(1_000), 40).iter().all(|w| *w == Way::OpenGl));
        let hardware = SceneFacts { software: false, ..scene(16_000_000) };
        assert!(ways(hardware, 40).iter().all(|w| *w == Way::OpenGl));
    }

    #[test]
    fn scenes_between_the_two_costs_keep_their_way() {
        let threshold = (1..2_000)
            .map(|k| 1_000 * k)
            .find(|t| ways(scene(*t), 99)[98] == Way::All)
            .expect("some mesh is large enough");
        let mut choice = Choice::default();
        for _ in 0..9 {
            choice.decide(Some(scene(2 * threshold)));
        }
        assert_eq!(choice.decide(Some(scene(threshold * 9 / 10))), Way::All);
        assert_eq!(choice.decide(Some(scene(threshold / 4))), Way::OpenGl);
        assert_eq!(choice.decide(Some(scene(threshold * 9 / 10))), Way::OpenGl);
    }

    #[test]
    fn facts_are_asked_for_when_the_scene_changes_and_now_and_then() {
        let mut choice = Choice::default();
        assert!(!choice.is_due(100, 1, false), "before the first frame");
        choice.decide(None);
        assert!(choice.is_due(1 << 20, 1, false));
        choice.decide(Some(scene(10)));
        assert!(!choice.is_due(1 << 20, 1, false) && !choice.is_due(1 << 20, 1, true));
        assert!(choice.is_due(1 << 19, 1, false) && choice.is_due(1 << 20, 2, false));
        for _ in 0..KEEP {
            choice.decide(None);
        }
        assert!(choice.is_due(1 << 20, 1, false));
        choice.decide(Some(volume(257, false, BEST)));
        assert!(choice.is_due(1 << 20, 1, true), "OpenGL may take fewer samples now");
    }

    #[test]
    fn small_volumes_stay_and_large_ones_are_traced() {
        assert_eq!(last(volume(9, false, BEST)), Way::OpenGl);
        assert_eq!(last(volume(5, true, BEST)), Way::OpenGl);
        let found = ways(volume(257, false, BEST), 40);
        assert_eq!((found[0], found[39]), (Way::OpenGl, Way::All));
        let hardware = SceneFacts { software: false, ..volume(513, true, BEST) };
        assert_eq!(last(hardware), Way::OpenGl);
    }

    /// Points per axis from which on volumes are traced; `None` if it is never worth it.
    fn least(shaded: bool, level: SimdLevel) -> Option<u32> {
        (2..600).find(|n| last(volume(*n, shaded, level)) == Way::All)
    }

    #[test]
    fn volumes_are_traced_earlier_shaded_and_later_with_older_instructions() {
        let [shaded, plain] = [true, false].map(|shaded| least(shaded, BEST).unwrap());
        assert!(shaded < plain, "{shaded} {plain}");
        for older in [SimdLevel::Avx2, SimdLevel::Sse2] {
            assert!(least(true, older).is_none_or(|points| points > shaded), "{older:?}");
        }
    }

    #[test]
    fn volumes_between_the_two_costs_keep_their_way() {
        let enough = least(true, BEST).unwrap();
        let mut choice = Choice::default();
        let mut decide = |points| choice.decide(Some(volume(points, true, BEST)));
        for _ in 0..40 {
            decide(2 * enough);
        }
        assert_eq!(decide(enough - 1), Way::All, "not worth 15 %");
        assert_eq!(decide(2), Way::OpenGl);
        assert_eq!(decide(enough - 1), Way::OpenGl);
    }

    #[test]
    fn the_same_sequence_of_volumes_is_drawn_in_the_same_way() {
        let sequence = || {
            let mut choice = Choice::default();
            let next =
                |k: u32| choice.decide(Some(volume(40 * k % 301 + 2, k.is_multiple_of(3), BEST)));
            (0..200).map(next).collect::<Vec<Way>>()
        };
        let first = sequence();
        assert_eq!(first, sequence());
        assert!(first.contains(&Way::All) && first.contains(&Way::OpenGl));
    }

    #[test]
    fn volumes_stay_where_the_picture_would_not_be_opengls() {
        let large = volume(513, true, BEST);
        assert_eq!(last(SceneFacts { others: 1, ..large }), Way::OpenGl);
        assert_eq!(last(SceneFacts { unknown_volumes: 1, ..large }), Way::OpenGl);
        let mut choice = Choice::default();
        for _ in 0..9 {
            choice.decide(Some(large));
        }
        let turning = SceneFacts { unknown_volumes: 1, interactive: true, ..large };
        assert_eq!(choice.decide(Some(turning)), Way::OpenGl);
        assert!(choice.reason().contains("not measured"), "{}", choice.reason());
    }

    #[test]
    fn surfaces_and_the_volumes_among_them_go_to_whoever_is_cheaper() {
        let among = |points| SceneFacts { triangles: 4_000_000, ..volume(points, true, BEST) };
        assert_eq!(last(among(3)), Way::Surfaces);
        assert_eq!(last(among(257)), Way::All);
        assert_eq!(last(SceneFacts { others: 1, ..among(257) }), Way::Surfaces);
        assert_eq!(last(SceneFacts { unknown_volumes: 1, ..among(257) }), Way::Surfaces);
    }

    #[test]
    fn reasons_name_both_costs() {
        let reason = |facts: SceneFacts, frames: usize| {
            let mut choice = Choice::default();
            for _ in 0..frames {
                choice.decide(Some(facts));
            }
            choice.reason()
        };
        let of_volume = volume(257, true, BEST);
        let dear = PartCosts { build: 1e6, ..of_volume.media };
        let starts = [
            (reason(scene(1_000), 9), "cheaper in OpenGL: about "),
            (reason(scene(1_000_000), 9), "rays: about "),
            (reason(SceneFacts { media: dear, ..of_volume }, 1), "in OpenGL until rays have paid"),
            (reason(volume(257, true, BEST), 40), "rays: about "),
            (
                reason(SceneFacts { others: 1, ..volume(257, true, BEST) }, 9),
                "OpenGL draws volumes",
            ),
        ];
        for (found, start) in starts {
            assert!(found.starts_with(start), "{found}");
        }
    }
}
