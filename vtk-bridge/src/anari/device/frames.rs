//! Drawing: from a frame's committed parameters to an order for the renderer, and its pixels to the program.

use super::Device;
use crate::anari::data_type::DataType;
use crate::anari::frame::{self, Order, start};
use crate::anari::object::{Handle, Object, Value};
use crate::anari::scene::world::{Compiled, fingerprint};
use crate::anari::scene::{Notes, camera_of, view_of};
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
        let mut notes = Notes::default();
        let compiled = Compiled::of(&world, &mut notes);
        let view = view_of(&renderer, size, &mut notes);
        let camera_made = camera_of(&camera, size, compiled.bounds, &mut notes);
        self.tell_notes(notes);
        let made = match camera_made {
            Ok(made) => made,
            Err(e) => return self.about(&camera, Severity::Error, format!("the frame is not drawn: {e}")),
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
            [&world, &camera, &renderer].into_iter().for_each(|o| fingerprint(o, &|_| true, &mut key));
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
                Message { source, source_type: DataType::FRAME, severity, code: Code::InvalidArgument, text }
            };
            match said {
                Ok(warnings) => {
                    warnings.into_iter().for_each(|w| status.tell_once(&about(Severity::Warning, w)))
                }
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

    /// Pixels of a channel, with their type and the size of the picture; valid until the channel is unmapped.
    pub fn map_frame(&self, handle: Handle, channel: &str) -> Option<(*const c_void, [u32; 2], DataType)> {
        let frame = self.frame(handle, "anariMapFrame")?;
        // Older programs leave out the prefix.
        let name =
            if channel.starts_with("channel.") { channel.to_owned() } else { format!("channel.{channel}") };
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
            self.about(&frame, Severity::Error, format!("`{channel}` cannot be mapped: the frame has {have:?}; set the parameter to a type and draw again"));
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
