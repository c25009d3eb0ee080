//! Plans light paths on the GPU, or gives the reason why the CPU computes them.

#[cfg(feature = "gpu")]
use super::device_march::DeviceMarch;
use super::planned::PlannedPaths;
#[cfg(feature = "gpu")]
use super::planned::{described, skipping_has_no_effect};
use super::section::Caches;
use super::{RenderError, Report};
use crate::field::Field;
use crate::film::photons::Exposure;
use crate::film::{Film, Framing, Photograph, Tally};
use crate::filter::Filter;
use crate::plan::Request;
use crate::scene::{Device, MarchSpec};
use crate::view::View;
use std::sync::atomic::AtomicBool;

/// Opens this machine's GPU if the scene requests one.
///
/// # Errors
/// The reason why not, with the cure.
pub fn check_gpu(march: &MarchSpec) -> Result<(), RenderError> {
    if march.device != Device::Gpu {
        return Ok(());
    }
    #[cfg(feature = "gpu")]
    return crate::gpu::Gpu::shared().map(|_| ()).map_err(RenderError::Gpu);
    #[cfg(not(feature = "gpu"))]
    Err(RenderError::NoGpu)
}

/// The reason why the CPU computes in place of the GPU. When a GPU was requested, causes that are
/// known before rendering are errors. A device that is lost or out of memory is only a reason, so
/// that the image is still rendered.
#[cfg(feature = "gpu")]
fn fallback_reason(requested: Device, error: crate::gpu::GpuError) -> Result<String, RenderError> {
    match error {
        crate::gpu::GpuError::Failed { .. } | crate::gpu::GpuError::GivenUp { .. } => {
            Ok(crate::gpu::fallback_message(&error))
        }
        e if requested == Device::Gpu => Err(RenderError::Gpu(e)),
        e => Ok(crate::gpu::fallback_message(&e)),
    }
}

/// Paths on the GPU if the scene wants it and it is possible. Otherwise the inner `Err` has the
/// reason, or `None` when the CPU was requested.
#[cfg(feature = "gpu")]
pub(super) fn on_gpu<'a>(
    march: &MarchSpec,
    field: &'a Field,
    view: View,
    request: Request,
    measured_rays: Option<usize>,
    caches: &Caches,
) -> Result<Result<PlannedPaths<'a>, Option<String>>, RenderError> {
    use crate::gpu::{Gpu, GpuError, GpuOptions, GpuPaths, Method};
    use crate::plan::Plan;
    use std::sync::Arc;

    if march.device == Device::Cpu {
        return Ok(Err(None));
    }
    let cache = &caches.field;
    let plan = Plan::from_derivative_bounds(field, request, cache.derivative_bounds(field));
    let made = (|| {
        let mut gpu = Gpu::shared()?;
        if march.device == Device::Auto && gpu.is_software() {
            return Err(GpuError::NoAdapter(format!(
                "the only Vulkan device, {}, runs on the CPU",
                gpu.name()
            )));
        }
        let mut chosen = DeviceMarch::new(march, plan, field, view, measured_rays, cache);
        let options = GpuOptions {
            method: chosen.method,
            step_voxels: chosen.step_voxels,
            quantities: request.quantities,
            blank: request.blank,
            skip_rad: if chosen.method == Method::Verlet { request.skip_rad } else { 0.0 },
            skip_opd_m: request.skip_opd_m,
        };
        // A device that fails while the field is copied to it is reopened, up to a limited number
        // of times.
        let mut warning = None;
        let paths = loop {
            let on = Arc::clone(&gpu);
            let kept = (cache, &caches.device);
            match GpuPaths::with_caches(on, field, view, chosen.interpolant, options, kept) {
                Err(e @ GpuError::Failed { .. }) if gpu.failure().is_some() => {
                    warning.get_or_insert(format!(
                        "{}; it was reopened",
                        crate::gpu::failure_message(&e)
                    ));
                    gpu = Gpu::shared()?;
                }
                made => break made?,
            }
        };
        if let Some(rays) = measured_rays {
            chosen.measure(&paths, field, rays, cache);
        }
        Ok((paths, gpu, warning, chosen))
    })();
    match made {
        Ok((paths, gpu, warning, chosen)) => {
            let DeviceMarch { name, interpolant, step_voxels, bend, achieved, .. } = chosen;
            let mut description = described(name, interpolant, step_voxels);
            let mut skip_warning = None;
            if request.skip_rad > 0.0 {
                if name == "verlet" {
                    description += &format!(", skipping at most {:e} rad", request.skip_rad);
                } else {
                    skip_warning = Some(skipping_has_no_effect(name));
                }
            }
            let paths = Arc::new(paths);
            let mut planned = PlannedPaths::new(
                Box::new(Arc::clone(&paths)),
                format!("{description}, on {}", gpu.name()),
                achieved,
                &request,
                (bend, step_voxels),
            );
            planned.choice = chosen.choice();
            planned.on_device = Some(paths);
            if request.mode.is_none()
                && achieved.is_some_and(|a| {
                    a.max_rad > request.tolerance_rad && a.resolution_rad <= request.tolerance_rad
                })
            {
                planned.warnings.push(
                    "the GPU's march is in single precision; the CPU has a finer one (--device cpu)"
                        .into(),
                );
            }
            planned.warnings.extend(warning);
            planned.warnings.extend(skip_warning);
            Ok(Ok(planned))
        }
        Err(e) => fallback_reason(march.device, e).map(|why| Err(Some(why))),
    }
}

/// A picture by photons, made where the paths are, if that is a GPU that can: `Ok(None)` where the
/// CPU must. A warning says why the GPU cannot.
pub(super) fn photograph_photons<const C: usize>(
    planned: &PlannedPaths<'_>,
    setup: &Exposure<'_>,
    framing: Framing,
    (samples, filter, noise): (u32, Filter, bool),
    control: &FilmControl<'_>,
    report: &mut Report,
) -> Result<Option<Photograph<C>>, RenderError> {
    #[cfg(feature = "gpu")]
    if let Some(device) = &planned.on_device {
        use crate::gpu::FrameFilter;
        let FilmControl { cancel, progress } = *control;
        let weights = filter.weights();
        let filter = match (filter, &weights) {
            (Filter::Cone { nearest }, _) => FrameFilter::Cone { nearest },
            (_, weights) => FrameFilter::Weights(weights.as_deref().unwrap_or(&[1.0])),
        };
        let (media, filter) = (planned.media_on_device.as_ref(), (filter, noise));
        let passes = 0..samples;
        let made =
            device.photograph_photons(setup, media, framing, passes, filter, cancel, progress);
        let made = exposed(made, report)?;
        count_media(planned, made.as_ref().map(|m| not_behind_bodies(&m.tally)));
        return Ok(made);
    }
    let _ = (planned, setup, framing, samples, filter, noise, control, report);
    Ok(None)
}

/// As [`photograph_photons`], by beams.
pub(super) fn photograph_beams<const C: usize>(
    planned: &PlannedPaths<'_>,
    setup: &Exposure<'_>,
    framing: Framing,
    per_side: u32,
    control: &FilmControl<'_>,
    report: &mut Report,
) -> Result<Option<Photograph<C>>, RenderError> {
    #[cfg(feature = "gpu")]
    if let Some(device) = &planned.on_device {
        let FilmControl { cancel, progress } = *control;
        let media = planned.media_on_device.as_ref();
        let made = device.photograph_beams(setup, media, framing, per_side, cancel, progress);
        let made = exposed(made, report)?;
        let corners =
            |n: u32| (u64::from(n) + 2 * u64::from(setup.margin_px)) * u64::from(per_side) + 1;
        let rays = corners(framing.width) * corners(framing.height);
        count_media(planned, made.as_ref().map(|_| rays));
        return Ok(made);
    }
    let _ = (planned, setup, framing, per_side, control, report);
    Ok(None)
}

/// Exposes films by photons where the paths are, as [`photograph_photons`]. The CPU filters them,
/// but for the cone filter, whose picture comes with them.
pub(super) fn expose_photons<const C: usize>(
    planned: &PlannedPaths<'_>,
    setup: &Exposure<'_>,
    films: &[Film<C>],
    (samples, filter): (u32, Filter),
    control: &FilmControl<'_>,
    report: &mut Report,
) -> Result<Option<FilmOfDevice<C>>, RenderError> {
    #[cfg(feature = "gpu")]
    if let Some(device) = &planned.on_device {
        let FilmControl { cancel, progress } = *control;
        let media = planned.media_on_device.as_ref();
        let cone = match filter {
            Filter::Cone { nearest } => Some(nearest),
            _ => None,
        };
        let made = device.expose_photons(setup, media, films, 0..samples, cone, cancel, progress);
        let made = exposed(made, report)?;
        count_media(planned, made.as_ref().map(|(tally, _)| not_behind_bodies(tally)));
        return Ok(made);
    }
    let _ = (planned, setup, films, samples, filter, control, report);
    Ok(None)
}

/// Counts of photons, and the picture of a cone filter.
pub(super) type FilmOfDevice<const C: usize> = (Tally, Option<Vec<[f32; C]>>);

/// Cancels an exposure and reports its progress.
#[derive(Clone, Copy)]
#[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "nothing else exposes elsewhere"))]
pub(super) struct FilmControl<'a> {
    pub(super) cancel: &'a AtomicBool,
    /// Receives numbers of traced rays.
    pub(super) progress: &'a (dyn Fn(u64) + Sync),
}

/// Counts the rays along which the device has integrated media.
#[cfg(feature = "gpu")]
fn count_media(planned: &PlannedPaths<'_>, rays: Option<u64>) {
    if let (Some(_), Some(rays)) = (&planned.media_on_device, rays) {
        planned.media_rays.fetch_add(rays, std::sync::atomic::Ordering::Relaxed);
    }
}

/// Photons that were traced.
#[cfg(feature = "gpu")]
fn not_behind_bodies(tally: &Tally) -> u64 {
    tally.sent - tally.blocked_by_solids
}

#[cfg(feature = "gpu")]
fn exposed<T>(
    result: Result<T, crate::gpu::NotExposed>,
    report: &mut Report,
) -> Result<Option<T>, RenderError> {
    use crate::gpu::NotExposed;
    match result {
        Ok(made) => Ok(Some(made)),
        Err(NotExposed::Cancelled) => Err(RenderError::Cancelled),
        Err(NotExposed::Refused(why)) => {
            let warning = film_on_cpu(&why);
            if !report.warnings.contains(&warning) {
                report.warnings.push(warning);
            }
            Ok(None)
        }
    }
}

/// The warning that only the march is on the GPU.
#[cfg(feature = "gpu")]
fn film_on_cpu(why: &str) -> String {
    format!("the GPU bends the light, and the CPU sends it and exposes the film: {why}")
}

/// Without the feature `gpu` there is no march on the GPU.
#[cfg(not(feature = "gpu"))]
pub(super) fn on_gpu<'a>(
    march: &MarchSpec,
    _: &'a Field,
    _: View,
    _: Request,
    _: Option<usize>,
    _: &Caches,
) -> Result<Result<PlannedPaths<'a>, Option<String>>, RenderError> {
    match march.device {
        Device::Cpu => Ok(Err(None)),
        Device::Auto => Ok(Err(Some(
            "computed on the CPU: this program is built without the feature gpu".into(),
        ))),
        Device::Gpu => Err(RenderError::NoGpu),
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;
    use crate::gpu::GpuError;

    #[test]
    fn a_device_that_fails_spoils_no_image_and_one_that_cannot_is_refused() {
        let lost =
            GpuError::Failed { adapter: "Lamp 9".into(), reason: "the device is lost".into() };
        let give_up_error = GpuError::GivenUp {
            adapter: "Lamp 9".into(),
            times: 3,
            reason: "the device is lost".into(),
        };
        for requested in [Device::Gpu, Device::Auto] {
            for e in [&lost, &give_up_error] {
                let warning = fallback_reason(requested, e.clone()).unwrap();
                for word in ["Lamp 9", "the device is lost", "on the CPU"] {
                    assert!(warning.contains(word), "{word}: {warning}");
                }
            }
        }
        let none = GpuError::NoAdapter("Vulkan finds no device".into());
        assert!(matches!(fallback_reason(Device::Gpu, none.clone()), Err(RenderError::Gpu(_))));
        assert!(
            fallback_reason(Device::Auto, none).unwrap().contains("computed on the CPU: no GPU")
        );
    }
}
