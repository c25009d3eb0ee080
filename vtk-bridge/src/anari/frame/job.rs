//! Renders one frame on its own thread.

use super::channels::{albedo, blank, color, depth, normal, numbers, over};
use super::{Accumulated, FrameImage};
use crate::anari::data_type::DataType;
use crate::anari::scene::RendererSettings;
use crate::anari::scene::world::CompiledWorld;
use crate::anari::status::lock;
use rt_core::bvh::{BuildOptions, Geometry, World};
use rt_core::camera::{Camera, ThinLens};
use rt_core::environment::{Background, Environment};
use rt_core::frame::Layers;
use rt_core::light::Light;
use rt_core::material::SurfaceModel;
use rt_core::render::{RenderError, RenderOptions, render};
use rt_core::scene::{Scene, SceneError};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::ThreadId;
use std::time::Instant;

/// All input of a rendering. It refers to no object of the program.
pub(crate) struct Order {
    pub(crate) compiled: CompiledWorld,
    pub(crate) camera: Camera,
    pub(crate) view: RendererSettings,
    pub(crate) channels: BTreeMap<&'static str, DataType>,
    /// Key of the rendered contents, when frames are accumulated.
    pub(crate) accumulate: Option<Vec<u64>>,
    /// Sums of earlier frames.
    pub(crate) sums: Arc<Mutex<Accumulated>>,
    /// Receives the error, or the warnings.
    pub(crate) tell: Box<dyn FnOnce(Result<Vec<String>, String>) + Send>,
    /// Called at the end.
    pub(crate) completed: Box<dyn FnOnce() + Send>,
}

/// A rendering that is running or finished.
pub(crate) struct Job {
    picture: Mutex<Option<Arc<FrameImage>>>,
    done: Condvar,
    cancel: Arc<AtomicBool>,
    thread: Mutex<Option<ThreadId>>,
    /// Whether the completion callback has returned, too.
    over: Mutex<bool>,
    over_signal: Condvar,
}

impl Job {
    /// Waits until no more callbacks of the program will be called.
    pub(crate) fn wait_until_over(&self) {
        let mut over = lock(&self.over);
        while !*over && *lock(&self.thread) != Some(std::thread::current().id()) {
            over = self.over_signal.wait(over).unwrap_or_else(std::sync::PoisonError::into_inner);
        }
    }

    pub(crate) fn is_done(&self) -> bool {
        lock(&self.picture).is_some()
    }

    /// Requests a stop.
    pub(crate) fn cancel(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }

    /// Waits for the image. Returns without waiting when called from the rendering thread itself,
    /// as a completion callback may do.
    pub(crate) fn wait(&self) -> Arc<FrameImage> {
        let mut picture = lock(&self.picture);
        loop {
            if let Some(p) = &*picture {
                return p.clone();
            }
            if *lock(&self.thread) == Some(std::thread::current().id()) {
                return Arc::default();
            }
            picture = self.done.wait(picture).unwrap_or_else(std::sync::PoisonError::into_inner);
        }
    }
}

/// Starts rendering.
pub(crate) fn start(order: Order) -> Arc<Job> {
    let job = Arc::new(Job {
        picture: Mutex::default(),
        done: Condvar::new(),
        cancel: Arc::default(),
        thread: Mutex::default(),
        over: Mutex::default(),
        over_signal: Condvar::new(),
    });
    let order = Arc::new(Mutex::new(Some(order)));
    let work = {
        let (job, order) = (job.clone(), order.clone());
        move || {
            let taken = lock(&order).take();
            if let Some(order) = taken {
                run(order, &job);
            }
        }
    };
    // If no thread can be started, the frame is rendered on this one.
    if std::thread::Builder::new().name("anari frame".into()).spawn(work.clone()).is_err() {
        work();
    }
    job
}

fn run(order: Order, job: &Job) {
    *lock(&job.thread) = Some(std::thread::current().id());
    let started = Instant::now();
    let size = [order.view.options.width, order.view.options.height];
    // rt-core reports a panic in a tile as an error. This guard is for all other panics, so that no
    // caller waits forever.
    let drawn = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| draw(&order, job)));
    let drawn = drawn.unwrap_or_else(|_| {
        Err("internal error: the drawing panicked; please report it".to_owned())
    });
    let (mut picture, told) = match drawn {
        Ok((picture, warnings)) => (picture, Ok(warnings)),
        Err(why) => {
            let pixels = size[0] as usize * size[1] as usize;
            let channels =
                order.channels.iter().map(|(name, t)| (*name, blank(*t, pixels))).collect();
            (FrameImage { channels, ..FrameImage::default() }, Err(why))
        }
    };
    picture.size = size;
    picture.duration_secs = started.elapsed().as_secs_f32();
    let (tell, completed) = (order.tell, order.completed);
    tell(told);
    *lock(&job.picture) = Some(Arc::new(picture));
    job.done.notify_all();
    completed();
    *lock(&job.thread) = None;
    *lock(&job.over) = true;
    job.over_signal.notify_all();
}

/// The world with its acceleration structures. If nothing in it has changed, this is the world of
/// the last frame.
fn build(compiled: &CompiledWorld) -> Result<Arc<World>, String> {
    let mut built = lock(&compiled.built);
    if let Some(old) = &*built {
        let same = |(a, b): (&Geometry, &Geometry)| match (a, b) {
            (Geometry::Mesh(a), Geometry::Mesh(b)) => Arc::ptr_eq(a, b),
            (Geometry::Shape(a), Geometry::Shape(b)) => {
                std::ptr::addr_eq(Arc::as_ptr(a), Arc::as_ptr(b))
            }
            _ => false,
        };
        let all = old.geometries().len() == compiled.geometries.len()
            && old.geometries().iter().zip(&compiled.geometries).all(same);
        if all && old.instances() == compiled.instances {
            return Ok(old.clone());
        }
    }
    let (geometries, instances) = (compiled.geometries.clone(), compiled.instances.clone());
    let world =
        World::build_sharing(geometries, instances, &BuildOptions::default(), built.as_deref());
    let world = Arc::new(world.map_err(|e| e.to_string())?);
    *built = Some(world.clone());
    Ok(world)
}

fn draw(order: &Order, job: &Job) -> Result<(FrameImage, Vec<String>), String> {
    let Order { compiled, camera, view, channels, .. } = order;
    let world = build(compiled)?;

    // ---- Scene ----
    let mut scene = Scene::new(world);
    scene.appearances.clone_from(&compiled.appearances);
    scene.materials.clone_from(&compiled.materials);
    scene.lights = compiled
        .lights
        .iter()
        .copied()
        .map(|l| if view.shadows { l } else { l.without_shadows() })
        .collect();
    scene.environment.clone_from(&compiled.environment);
    scene.background = if compiled.environment.is_some() {
        Background::Environment
    } else {
        Background::Transparent
    };
    // Ambient light comes from everywhere, so mirrors reflect it. Together with an image of the sky
    // it only adds to diffuse reflection.
    match view.ambient {
        Some(color) if compiled.environment.is_none() => {
            scene.environment = Some(Environment::Constant(color))
        }
        Some(color) => scene.lights.push(Light::ambient(color)),
        None => {}
    }
    scene.ambient_occlusion = view.occlusion.filter(|_| scene.environment.is_some());
    scene.volumes.clone_from(&compiled.volumes);
    scene.check().map_err(|e: SceneError| e.to_string())?;

    // ---- Layers ----
    let has = |name| channels.contains_key(name);
    let any_id = has("channel.primitiveId") || has("channel.objectId") || has("channel.instanceId");
    let wanted = [
        (has("channel.color"), Layers::COLOR),
        (has("channel.depth"), Layers::DISTANCE),
        (has("channel.normal"), Layers::NORMAL),
        (any_id, Layers::IDS),
    ];
    let layers = wanted.into_iter().filter(|(on, _)| *on).map(|(_, l)| l).reduce(|a, b| a | b);
    let mut sums = lock(&order.sums);
    let mut options = RenderOptions { cancel: Some(job.cancel.clone()), ..view.options.clone() };
    let mut warnings = Vec::new();
    if options.path_tracing && !scene.volumes.is_empty() {
        options.path_tracing = false;
        warnings.push(
            "the path tracer has no volumes: the renderer `default` draws this world".to_owned(),
        );
    }
    if let Some(key) = &order.accumulate {
        if sums.key != *key {
            *sums = Accumulated { key: key.clone(), ..Accumulated::default() };
        }
        // A single sample would always be at the pixel's centre, so accumulation would add nothing.
        options.samples = options.samples.max(2);
        options.seed = u64::from(sums.passes);
    }
    let fail = |e: RenderError| e.to_string();
    let size = [options.width, options.height];
    let mut picture = FrameImage { samples: options.samples, ..FrameImage::default() };
    let Some(layers) = layers.or(has("channel.albedo").then_some(Layers::DISTANCE)) else {
        return Ok((picture, warnings));
    };
    options.layers = layers;
    let output = render(&scene, camera, &options).map_err(fail)?;
    warnings.extend(output.report.warnings);
    let frame = output.frame;

    // ---- Channels ----
    for (&name, &data_type) in channels {
        let channel = match name {
            "channel.color" => {
                let mut pixels = over(&frame.color, size, &view.backdrop);
                if order.accumulate.is_some() && !job.cancel.load(Ordering::Relaxed) {
                    sums.passes += 1;
                    if sums.sum.len() != pixels.len() {
                        sums.sum = vec![[0.0; 4]; pixels.len()];
                    }
                    let scale = 1.0 / sums.passes as f32;
                    for (sum, p) in sums.sum.iter_mut().zip(&mut pixels) {
                        for c in 0..4 {
                            sum[c] += p[c];
                            p[c] = sum[c] * scale;
                        }
                    }
                    picture.samples = options.samples * sums.passes;
                }
                color::<4>(pixels.into_iter(), data_type)
            }
            "channel.depth" => depth(&frame),
            "channel.normal" => normal(&frame, data_type),
            "channel.primitiveId" => numbers(&frame, &compiled.ids, |id, p| id.topology.number(p)),
            "channel.objectId" => numbers(&frame, &compiled.ids, |id, _| id.object),
            "channel.instanceId" => numbers(&frame, &compiled.ids, |id, _| id.instance),
            "channel.albedo" => {
                // The colour without light: the same scene, rendered unlit.
                let mut flat = scene.clone();
                flat.materials.iter_mut().for_each(|m| {
                    m.model = SurfaceModel::Unlit;
                    m.emission = [0.0; 3];
                    m.maps = None;
                });
                flat.lights.clear();
                flat.volumes.clear();
                flat.ambient_occlusion = None;
                flat.environment = None;
                flat.background = Background::Transparent;
                let (layers, path_tracing) = (Layers::COLOR, false);
                let once = RenderOptions { layers, path_tracing, samples: 1, ..options.clone() };
                let pinhole = ThinLens { aperture_radius: 0.0, focus_distance: 1.0 };
                // A camera without a lens stays unchanged, so nothing can be refused.
                let sharp = if camera.lens().is_some() {
                    camera.with_lens(pinhole).unwrap_or(*camera)
                } else {
                    *camera
                };
                let pass = render(&flat, &sharp, &once).map_err(fail)?;
                albedo(&pass.frame.color, size[0], data_type)
            }
            _ => continue,
        };
        picture.channels.insert(name, channel);
    }
    Ok((picture, warnings))
}
