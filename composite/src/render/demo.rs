//! A data set of the catalogue, partitioned and rendered by all ranks: what `composite demo` shows.
pub use super::demo_error::DemoError;
use super::demo_model::{DemoModel, DemoShape, middle_and_radius};
use super::{DataParallel, FrameError, FrameOptions, FrameOutput, Partition, Split};
use crate::comm::Communicator;
use datasets::catalogue;
use datasets::view::View;
use rt_core::bvh::BuildOptions;
use rt_core::camera::{Camera, CameraError};
use rt_core::environment::Background;
use rt_core::glam::DVec3;
use rt_core::light::Light as Lamp;
use rt_core::material::Material;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::RenderOptions;
use rt_core::scene::{AmbientOcclusion, Scene, SceneBuilder};

/// What to render.
#[derive(Debug, Clone, PartialEq)]
pub struct Demo {
    /// Name in [`datasets::catalogue`], or a file that [`datasets::read::open`] reads and that has
    /// surfaces. Lines are drawn as tubes.
    pub data: String,
    /// Size of the data set; `None` for its smallest.
    pub size: Option<String>,
    /// One of its views; `None` for the first.
    pub view: Option<String>,
    /// Width and height of the image, pixels.
    pub size_px: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// Shadows of a lamp and ambient occlusion. Without it there is a headlight and no secondary
    /// ray.
    pub global_light: bool,
    /// A colour for each rank's part; without it everything is grey.
    pub color_by_rank: bool,
    /// Partition for this view, instead of equal numbers of triangles.
    pub cut_by_view: bool,
}

impl Default for Demo {
    /// The wavelet of a million triangles, 1024 x 768, with shadows and ambient occlusion, coloured
    /// by rank.
    fn default() -> Self {
        Demo {
            data: "wavelet".into(),
            size: None,
            view: None,
            size_px: [1024, 768],
            samples: 1,
            global_light: true,
            color_by_rank: true,
            cut_by_view: false,
        }
    }
}

/// A demo without its ranks. Every rank of a group makes the same one.
pub struct PreparedDemo {
    /// The whole scene.
    pub scene: Scene,
    /// The view.
    pub camera: Camera,
    /// The frame.
    pub options: RenderOptions,
    /// Which rank holds which primitives.
    pub partition: Partition,
}

impl Demo {
    /// Generates the data, builds the scene and cuts it into `ranks` parts. `progress` is called
    /// with the steps done and their total, and may stop the preparation by returning false.
    ///
    /// # Errors
    /// Names that do not exist, with those that do.
    pub fn prepare(
        &self,
        ranks: usize,
        progress: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<PreparedDemo, DemoError> {
        let (scene, camera) =
            self.scene(DemoModel::load(&self.data, self.size.as_deref(), progress)?)?;
        let split = if self.cut_by_view {
            Split::View { camera: Box::new(camera), size_px: self.size_px }
        } else {
            Split::Triangles
        };
        let partition = Partition::new(&scene, ranks, &split);
        let scene = if self.color_by_rank { colored(&scene, &partition) } else { scene };
        let options = self.render_options();
        Ok(PreparedDemo { scene, camera, options, partition })
    }

    /// The scene and the view of a mesh of this data set.
    ///
    /// # Errors
    /// [`DemoError::View`] for a view that the data set does not have.
    pub fn scene_of(
        &self,
        mesh: impl Into<std::sync::Arc<TriMesh>>,
    ) -> Result<(Scene, Camera), DemoError> {
        let views = catalogue::find(&self.data)?.views();
        self.scene(DemoModel { bodies: vec![DemoShape::Mesh(mesh.into())], views })
    }

    fn scene(&self, model: DemoModel) -> Result<(Scene, Camera), DemoError> {
        let DemoModel { bodies, views } = model;
        let view = match &self.view {
            None => &views[0],
            Some(name) => {
                views.iter().find(|v| v.name.eq_ignore_ascii_case(name)).ok_or_else(|| {
                    DemoError::View {
                        data: self.data.clone(),
                        view: name.clone(),
                        known: views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>().join(", "),
                    }
                })?
            }
        };
        let (middle, radius) = middle_and_radius(&bodies);
        let mut builder = SceneBuilder::new();
        for body in bodies {
            body.add_to(&mut builder, Material::matte([0.8; 3]));
        }
        let (lights, ambient_occlusion) = self.light(view, middle, radius);
        lights.into_iter().for_each(|lamp| builder.light(lamp));
        let mut scene = builder.build()?;
        scene.background = Background::Constant([1.0; 4]);
        scene.ambient_occlusion = ambient_occlusion;
        Ok((scene, self.camera(view, middle, radius)?))
    }

    /// The lights of everything within `radius` of `middle`.
    pub(super) fn light(
        &self,
        view: &View,
        middle: DVec3,
        radius: f64,
    ) -> (Vec<Lamp>, Option<AmbientOcclusion>) {
        if !self.global_light {
            return (vec![Lamp::headlight()], None);
        }
        let forward = (view.target - view.eye).normalize_or_zero();
        let right = forward.cross(view.up).normalize_or_zero();
        let above: DVec3 = view.up.normalize_or_zero();
        let lamp = middle + (above * 1.5 - right * 0.8 - forward * 1.2) * 2.0 * radius;
        let lights = vec![Lamp::point(lamp).with_color([0.75; 3]), Lamp::ambient([0.35; 3])];
        (lights, Some(AmbientOcclusion { distance: 0.15 * radius, rays: 16 }))
    }

    /// The camera that sees everything within `radius` of `middle`.
    pub(super) fn camera(
        &self,
        view: &View,
        middle: DVec3,
        radius: f64,
    ) -> Result<Camera, CameraError> {
        let reach = (view.eye - middle).length() + 2.0 * radius;
        let aspect = f64::from(self.size_px[0]) / f64::from(self.size_px[1].max(1));
        let fov_rad = view.vertical_fov_degrees.to_radians();
        let limits = [1e-3 * reach, reach];
        Camera::perspective(view.eye, view.target, view.up, fov_rad, aspect, limits)
    }

    /// The frame.
    pub(super) fn render_options(&self) -> RenderOptions {
        RenderOptions {
            samples: self.samples,
            ..RenderOptions::new(self.size_px[0], self.size_px[1])
        }
    }
}

impl PreparedDemo {
    /// One rank's share of one frame: builds its part and renders it with the others.
    ///
    /// # Errors
    /// Any fault on any rank ends the frame for all.
    pub fn run(
        &self,
        comm: &mut dyn Communicator,
        options: &FrameOptions,
    ) -> Result<FrameOutput, FrameError> {
        let part = self.partition.part(&self.scene, comm.rank(), &BuildOptions::default())?;
        let mut renderer = DataParallel::new(comm, part, options.clone())?;
        renderer.frame(comm, &self.camera, &self.options)
    }
}

/// The same scene with a colour for each rank's triangles.
fn colored(scene: &Scene, partition: &Partition) -> Scene {
    let mut scene = scene.clone();
    for (geometry, appearance) in
        scene.world.instances().iter().map(|i| i.geometry).zip(&mut scene.appearances)
    {
        let count: usize =
            (0..partition.parts()).map(|r| partition.primitives(r)[geometry].len()).sum();
        let mut colors = vec![[0.0; 4]; count];
        for rank in 0..partition.parts() {
            for &triangle in &partition.primitives(rank)[geometry] {
                colors[triangle as usize] = rank_color(rank);
            }
        }
        *appearance = appearance.clone().with_colors(Attribute::per_face(colors));
    }
    scene
}

/// A colour that differs from those of neighbouring ranks: hues a golden angle apart, linear RGBA.
pub fn rank_color(rank: usize) -> [f32; 4] {
    let hue = (rank as f32 * 0.381_966).fract() * 6.0;
    let light = [0.85, 0.6, 0.4][rank / 5 % 3];
    let channel = |shift: f32| {
        let h = (hue + shift) % 6.0;
        light * (0.25 + 0.75 * (2.0 - (h - 3.0).abs()).clamp(0.0, 1.0))
    };
    [channel(3.0), channel(1.0), channel(5.0), 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::threads;
    use rt_core::render::render;

    fn small() -> Demo {
        Demo { data: "closed-wavelet".into(), size_px: [96, 64], ..Demo::default() }
    }

    #[test]
    fn the_demo_is_the_picture_of_one_node() {
        let tubes = Demo { data: "plasma-tubes".into(), ..small() };
        for demo in [small(), Demo { cut_by_view: true, global_light: false, ..small() }, tubes] {
            let prepared = demo.prepare(5, &mut |_, _| true).unwrap();
            let outputs = threads::run(5, |mut comm| {
                prepared.run(&mut comm, &FrameOptions::default()).unwrap()
            });
            let picture = outputs[0].as_ref().unwrap().frame.as_ref().unwrap();
            let expected =
                render(&prepared.scene, &prepared.camera, &prepared.options).unwrap().frame;
            assert!(picture.color == expected.color);
            let shown = |rank: usize| {
                let c = rank_color(rank);
                let same = |p: &[f32; 4]| (p[0] * c[1] - p[1] * c[0]).abs() < 1e-3 && p[2] < 0.99;
                picture.color.iter().filter(|p| same(p)).count()
            };
            assert!((0..5).filter(|&r| shown(r) > 10).count() >= 2);
        }
    }

    #[test]
    fn names_that_do_not_exist_are_told_with_those_that_do() {
        let error = |demo: Demo| demo.prepare(2, &mut |_, _| true).err().unwrap().to_string();
        assert!(error(Demo { data: "nothing".into(), ..small() }).contains("wavelet"));
        assert!(error(Demo { size: Some("huge".into()), ..small() }).contains("small"));
        assert_eq!(
            error(Demo { view: Some("inside".into()), ..small() }),
            "closed-wavelet has no view `inside`; it has: whole"
        );
    }
}
