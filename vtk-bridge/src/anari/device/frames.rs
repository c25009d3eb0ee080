//! Rendering: converts a frame's committed parameters to a render job, and returns its pixels to
//! the program.

use super::Device;
use crate::anari::data_type::DataType;
use crate::anari::frame::{self, Order, start};
use crate::anari::handle::Handle;
use crate::anari::object::{Object, Value};
use crate::anari::scene::world::{CompiledWorld, fingerprint};
use crate::anari::scene::{Diagnostics, camera_of, renderer_settings};
use crate::anari::schema;
use crate::anari::status::{Code, Message, Severity, lock};
use std::collections::BTreeMap;
use std::ffi::c_void;
use std::sync::Arc;

impl Device {
    fn frame(&self, handle: Handle, what: &str) -> Option<Arc<Object>> {
        let frame = self.find(handle, what)?;
        if frame.kind != DataType::FRAME {
            self.about(&frame, Severity::Error, format!("{what}: it is no frame"));
            return None;
        }
        Some(frame)
    }

    /// Starts drawing, after the frame's last drawing is done.
    pub fn render_frame(&self, handle: Handle) {
        let Some(frame) = self.frame(handle, "anariRenderFrame") else { return };
        frame::finish(&frame);
        let missing: Vec<_> = ["world", "camera", "renderer", "size"]
            .into_iter()
            .filter(|n| !frame.parameters().contains_key(*n))
            .collect();
        let (Some(world), Some(camera), Some(renderer)) =
            (frame.object("world"), frame.object("camera"), frame.object("renderer"))
        else {
            self.about(
                &frame,
                Severity::Error,
                format!("it is not drawn: {missing:?} not set or not committed"),
            );
            return;
        };
        let size = frame.vector("size", [0.0; 2]).map(|v| v as u32);
        if size.contains(&0) || size.iter().any(|s| *s > 1 << 16) {
            self.about(
                &frame,
                Severity::Error,
                format!("it is not drawn: `size` is {size:?}; it must be 1 to 65536 each way"),
            );
            return;
        }
        if !camera.known || !renderer.known {
            let which = if camera.known { &renderer } else { &camera };
            self.about(
                &frame,
                Severity::Error,
                format!("it is not drawn: this device has no {}", which.title()),
            );
            return;
        }
        let mut diagnostics = Diagnostics::default();
        let compiled = CompiledWorld::of(&world, &mut diagnostics);
        let view = renderer_settings(&renderer, size, &mut diagnostics);
        let camera_made = camera_of(&camera, size, compiled.bounds, &mut diagnostics);
        self.report_diagnostics(diagnostics);
        let made = match camera_made {
            Ok(made) => made,
            Err(e) => {
                return self.about(
                    &camera,
                    Severity::Error,
                    format!("the frame is not drawn: {e}"),
                );
            }
        };

        let channels: BTreeMap<&'static str, DataType> = schema::find(DataType::FRAME, "")
            .into_iter()
            .flat_map(|s| s.parameters())
            .filter(|p| p.name.starts_with("channel."))
            .filter_map(|p| Some((p.name, DataType(frame.numbers(p.name)?[0] as u32))))
            .filter(|(_, t)| *t != DataType::UNKNOWN)
            .collect();
        let accumulate = frame.bool("accumulation", false).then(|| {
            let mut key: Vec<u64> = size.iter().map(|s| u64::from(*s)).collect();
            [&world, &camera, &renderer]
                .into_iter()
                .for_each(|o| fingerprint(o, &|_| true, &mut key));
            key
        });
        let sums = lock(&self.sums).entry(handle).or_default().clone();
        let order = Order {
            compiled,
            camera: made,
            view,
            channels,
            accumulate,
            sums,
            tell: self.teller(&frame),
            completed: self.completion(&frame),
        };
        let job = start(order);
        let mut jobs = lock(&self.jobs);
        jobs.retain(|j| j.strong_count() > 0);
        jobs.push(Arc::downgrade(&job));
        drop(jobs);
        frame::set_job(&frame, job);
    }

    /// Takes what a drawing says, without holding on to the frame.
    fn teller(&self, frame: &Object) -> Box<dyn FnOnce(Result<Vec<String>, String>) + Send> {
        let (status, source, title) = (self.status.clone(), frame.handle, frame.title());
        Box::new(move |said| {
            let about = |severity, text: String| {
                let text = format!("{title}: {text}");
                Message {
                    source,
                    source_type: DataType::FRAME,
                    severity,
                    code: Code::InvalidArgument,
                    text,
                }
            };
            match said {
                Ok(warnings) => warnings
                    .into_iter()
                    .for_each(|w| status.tell_once(&about(Severity::Warning, w))),
                Err(why) => status.tell(&about(Severity::Error, format!("it is not drawn: {why}"))),
            }
        })
    }

    fn completion(&self, frame: &Object) -> Box<dyn FnOnce() + Send> {
        let pointer = |name: &str| match frame.parameters().get(name) {
            Some(Value::Pointer(_, p)) => *p,
            _ => 0,
        };
        let (function, user) =
            (pointer("frameCompletionCallback"), pointer("frameCompletionCallbackUserData"));
        let (hooks, handle) = (self.hooks.clone(), frame.handle);
        Box::new(move || {
            if function != 0 {
                hooks.frame_completed(function, user, handle);
            }
        })
    }

    /// Whether a frame is done; with `wait`, when it is.
    pub fn frame_ready(&self, handle: Handle, wait: bool) -> bool {
        let Some(frame) = self.frame(handle, "anariFrameReady") else { return true };
        match frame::current_job(&frame) {
            Some(job) if wait => {
                job.wait();
                true
            }
            Some(job) => job.is_done(),
            // Never drawn: there is nothing to wait for.
            None => true,
        }
    }

    /// Stops drawing as soon as possible.
    pub fn discard_frame(&self, handle: Handle) {
        if let Some(frame) = self.frame(handle, "anariDiscardFrame")
            && let Some(job) = frame::current_job(&frame)
        {
            job.cancel();
        }
    }

    /// Pixels of a channel, with their type and the size of the image. They are valid until the
    /// channel is unmapped.
    pub fn map_frame(
        &self,
        handle: Handle,
        channel: &str,
    ) -> Option<(*const c_void, [u32; 2], DataType)> {
        let frame = self.frame(handle, "anariMapFrame")?;
        // Older programs leave out the prefix.
        let name = if channel.starts_with("channel.") {
            channel.to_owned()
        } else {
            format!("channel.{channel}")
        };
        let Some(picture) = frame::finish(&frame) else {
            self.about(
                &frame,
                Severity::Error,
                format!("`{channel}` cannot be mapped: the frame has not been drawn"),
            );
            return None;
        };
        let Some(pixels) = picture.channels.get(name.as_str()) else {
            let have: Vec<_> = picture.channels.keys().collect();
            self.about(
                &frame,
                Severity::Error,
                format!(
                    "`{channel}` cannot be mapped: the frame \
                                                         has {have:?}; set the parameter to a type \
                                                         and draw again"
                ),
            );
            return None;
        };
        let mapped = (pixels.pixels.address(), picture.size, pixels.data_type);
        frame::hold(&frame, channel, picture.clone());
        Some(mapped)
    }

    /// The program no longer looks at the pixels.
    pub fn unmap_frame(&self, handle: Handle, channel: &str) {
        let Some(frame) = self.frame(handle, "anariUnmapFrame") else { return };
        if !frame::unhold(&frame, channel) {
            self.about(
                &frame,
                Severity::Warning,
                format!("`{channel}` is unmapped without having been mapped"),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anari::device::{Hooks, Raw};
    use crate::anari::scene::world::WorldCache;
    use crate::anari::status::Listener;
    use rt_core::bvh::World;

    struct Silent;

    impl Listener for Silent {
        fn message(&self, m: &Message) {
            assert!(m.severity > Severity::Warning, "{}", m.text);
        }
    }

    impl Hooks for Silent {
        fn frame_completed(&self, _function: usize, _user: usize, _frame: Handle) {}
    }

    fn floats(v: &[f32]) -> Raw {
        Raw::Bytes(v.iter().flat_map(|f| f.to_ne_bytes()).collect())
    }

    #[test]
    fn colours_and_matrices_build_no_geometry_anew() {
        let d = Device::new(Box::new(Silent), Arc::new(Silent));
        let put = |o: Handle, name: &str, t: DataType, v: Raw| {
            d.set_parameter(o, name, t, v);
            d.commit(o);
        };
        // A ball at the origin (arrays of the device's own memory are zeros), placed by an
        // instance.
        let array = |t| d.new_array(DataType::ARRAY1D, t, [1, 1, 1], None);
        let ball = d.new_object(DataType::GEOMETRY, "sphere");
        put(ball, "vertex.position", DataType::ARRAY1D, Raw::Handle(array(DataType::FLOAT32_VEC3)));
        let (material, surface) =
            (d.new_object(DataType::MATERIAL, "matte"), d.new_object(DataType::SURFACE, ""));
        d.set_parameter(surface, "geometry", DataType::GEOMETRY, Raw::Handle(ball));
        put(surface, "material", DataType::MATERIAL, Raw::Handle(material));
        let (group, instance) =
            (d.new_object(DataType::GROUP, ""), d.new_object(DataType::INSTANCE, "transform"));
        let (world, frame) = (d.new_object(DataType::WORLD, ""), d.new_object(DataType::FRAME, ""));
        let fill = |o: Handle, name: &str, t: DataType, content: Handle| {
            let a = array(t);
            let find = |h| lock(&d.objects).get(&h).map(|e| e.object.clone());
            let (array, content) = (find(a).expect("an array"), find(content));
            array.with_array(|a| a.set_objects(vec![content]));
            put(o, name, DataType::ARRAY1D, Raw::Handle(a));
        };
        fill(group, "surface", DataType::SURFACE, surface);
        put(instance, "group", DataType::GROUP, Raw::Handle(group));
        fill(world, "instance", DataType::INSTANCE, instance);
        let (camera, renderer) = (
            d.new_object(DataType::CAMERA, "perspective"),
            d.new_object(DataType::RENDERER, "default"),
        );
        for (name, t, o) in [
            ("camera", DataType::CAMERA, camera),
            ("renderer", DataType::RENDERER, renderer),
            ("world", DataType::WORLD, world),
        ] {
            put(frame, name, t, Raw::Handle(o));
        }
        put(
            frame,
            "size",
            DataType::UINT32_VEC2,
            Raw::Bytes([8u32.to_ne_bytes(), 8u32.to_ne_bytes()].concat()),
        );
        let color_type = DataType::FLOAT32_VEC4.0.to_ne_bytes().to_vec();
        put(frame, "channel.color", DataType::DATA_TYPE, Raw::Bytes(color_type));

        let draw = || -> Arc<World> {
            d.render_frame(frame);
            assert!(d.frame_ready(frame, true));
            let object = lock(&d.objects).get(&world).map(|e| e.object.clone()).expect("the world");
            let built = object.with_state(|c: &mut WorldCache| lock(&c.built).clone());
            built.expect("a world").expect("it was drawn")
        };
        let first = draw();
        assert_eq!(first.instances().len(), 1);
        put(material, "color", DataType::FLOAT32_VEC3, floats(&[1.0, 0.0, 0.0]));
        assert!(Arc::ptr_eq(&first, &draw()), "a colour builds nothing");
        let mut matrix = [0.0; 16];
        [0, 5, 10, 15].into_iter().for_each(|i| matrix[i] = 2.0);
        put(instance, "transform", DataType::FLOAT32_MAT4, floats(&matrix));
        let moved = draw();
        assert!(!Arc::ptr_eq(&first, &moved), "a matrix moves the instance");
        let shape = |w: &World| match &w.geometries()[0] {
            rt_core::bvh::Geometry::Shape(s) => Arc::as_ptr(s).cast::<()>(),
            rt_core::bvh::Geometry::Mesh(m) => Arc::as_ptr(m).cast::<()>(),
            rt_core::bvh::Geometry::Slices(s) => Arc::as_ptr(s).cast::<()>(),
        };
        assert_eq!(shape(&first), shape(&moved), "and keeps the geometry with its tree");
        put(ball, "radius", DataType::FLOAT32, floats(&[0.5]));
        assert_ne!(shape(&moved), shape(&draw()), "a radius makes another geometry");
    }
}
