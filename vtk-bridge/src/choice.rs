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
    /// Props with translucent surfaces.
    pub translucent: u32,
    /// Props with visible edges.
    pub edges: u32,
    /// OpenGL's driver works on the processor.
    pub software: bool,
    /// The caller is the Python package, which needs more time for each prop than the shim.
    pub python: bool,
}

/// Who draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Way {
    /// OpenGL.
    #[default]
    OpenGl,
    /// Rays; volumes among opaque surfaces stay with OpenGL.
    Rays,
}

/// A way is left only when the other one costs this much less.
const MARGIN: f64 = 1.15;
/// Rays begin when OpenGL has cost more by this part of what building costs.
const PAID: f64 = 0.25;
/// Frames after which the facts are collected again, if nothing else asks for it.
const KEEP: u32 = 16;

/// Milliseconds of both ways for a frame, and of building for rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    /// A frame of OpenGL.
    pub opengl: f64,
    /// A frame of rays.
    pub rays: f64,
    /// What the first frame of rays costs beyond that.
    pub build: f64,
}

impl Costs {
    /// The model.
    pub fn of(f: &SceneFacts) -> Costs {
        let (megapixels, mega) = (f.pixels as f64 * 1e-6, f.triangles as f64 * 1e-6);
        let props = f64::from(f.props);
        if !f.software {
            return Costs { opengl: 0.0, rays: f64::INFINITY, build: f64::INFINITY };
        }
        let (veils, edges) = (f.translucent > 0, f.edges > 0);
        let opengl = 38.0 * megapixels
            + mega * if edges { 500.0 } else { 300.0 }
            + 0.04 * props
            + if veils { 20.0 * megapixels } else { 0.0 };
        let pixel = match (veils, edges) {
            (true, _) => 240.0,
            (_, true) => 150.0,
            _ => 75.0,
        };
        let rays = pixel * megapixels + 6.0 * mega + props * if f.python { 0.12 } else { 0.03 };
        Costs { opengl, rays, build: 400.0 * mega + 2.0 }
    }
}

/// The decisions for one renderer.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    way: Way,
    facts: SceneFacts,
    /// Frames since the facts were collected.
    age: u32,
    /// Frames so far.
    frames: u64,
    /// Milliseconds that rays would have saved.
    saved: f64,
}

impl Choice {
    /// Whether the last decision cannot stand for a frame of this size with this many props:
    /// [`Choice::decide`] then needs the scene's facts. The first frame is OpenGL's whatever the
    /// facts, which need not be known before it is drawn.
    pub fn is_due(&self, pixels: u64, props: u32) -> bool {
        self.frames > 0
            && (self.age >= KEEP || self.facts.pixels != pixels || self.facts.props != props)
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
        let Costs { opengl, rays, build } = Costs::of(&self.facts);
        match self.way {
            Way::OpenGl if rays * MARGIN < opengl => {
                self.saved += opengl - rays;
                if self.saved >= PAID * build {
                    self.way = Way::Rays;
                }
            }
            Way::Rays if opengl * MARGIN < rays => (self.way, self.saved) = (Way::OpenGl, 0.0),
            _ => {}
        }
        self.way
    }

    /// Whether OpenGL draws the volumes also where rays draw the surfaces: not where their order
    /// with translucent surfaces counts.
    pub fn leaves_volumes(&self) -> bool {
        self.facts.volumes > 0 && self.facts.translucent == 0
    }

    /// The reason for the report, with the model's numbers.
    pub fn reason(&self) -> String {
        if self.facts.pixels == 0 {
            return "the first image is drawn as stock, without effects that need rays \
                    (RTV_ALWAYS_TRACE=1 traces it)"
                .to_owned();
        }
        let Costs { opengl, rays, .. } = Costs::of(&self.facts);
        if !self.facts.software {
            return "OpenGL's driver is hardware, which is taken to be faster, and no effect needs \
                    rays (RTV_ALWAYS_TRACE=1 traces)"
                .to_owned();
        }
        format!(
            "cheaper in OpenGL: about {opengl:.0} ms of CPU a frame, rays {rays:.0} ms, and no \
             effect needs rays (RTV_ALWAYS_TRACE=1 traces)"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(triangles: u64) -> SceneFacts {
        let pixels = 1 << 20;
        SceneFacts { pixels, props: 1, triangles, software: true, ..SceneFacts::default() }
    }

    fn ways(facts: SceneFacts, frames: usize) -> Vec<Way> {
        let mut choice = Choice::default();
        (0..frames)
            .map(|_| {
                let due = choice.is_due(facts.pixels, facts.props);
                choice.decide(due.then_some(facts))
            })
            .collect()
    }

    #[test]
    fn the_first_image_is_opengls_and_large_meshes_are_traced_after_a_few() {
        for triangles in [1_000_000, 16_000_000] {
            let found = ways(scene(triangles), 6);
            assert_eq!((found[0], found[5]), (Way::OpenGl, Way::Rays), "{triangles}");
        }
        assert!(ways(scene(1_000), 40).iter().all(|w| *w == Way::OpenGl));
        let hardware = SceneFacts { software: false, ..scene(16_000_000) };
        assert!(ways(hardware, 40).iter().all(|w| *w == Way::OpenGl));
    }

    #[test]
    fn scenes_between_the_two_costs_keep_their_way() {
        let threshold = (1..2_000)
            .map(|k| 1_000 * k)
            .find(|t| ways(scene(*t), 99)[98] == Way::Rays)
            .expect("some mesh is large enough");
        let mut choice = Choice::default();
        for _ in 0..9 {
            choice.decide(Some(scene(2 * threshold)));
        }
        assert_eq!(choice.decide(Some(scene(threshold * 9 / 10))), Way::Rays);
        assert_eq!(choice.decide(Some(scene(threshold / 4))), Way::OpenGl);
        assert_eq!(choice.decide(Some(scene(threshold * 9 / 10))), Way::OpenGl);
    }

    #[test]
    fn facts_are_asked_for_when_the_scene_changes_and_now_and_then() {
        let mut choice = Choice::default();
        assert!(!choice.is_due(100, 1), "before the first frame");
        choice.decide(None);
        assert!(choice.is_due(1 << 20, 1));
        choice.decide(Some(scene(10)));
        assert!(!choice.is_due(1 << 20, 1));
        assert!(choice.is_due(1 << 19, 1) && choice.is_due(1 << 20, 2));
        for _ in 0..KEEP {
            choice.decide(None);
        }
        assert!(choice.is_due(1 << 20, 1));
    }
}
