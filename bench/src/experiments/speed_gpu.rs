//! Whole frames on a GPU: how many per second, what moves between host and device for each, and how
//! far the picture is from the CPU's.

use super::Context;
use super::test_section::{check_cancelled, flow, render_image, scene};
use crate::clock::Clock;
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use crate::stats::Summary;
use schlieren::gpu::{Gpu, GpuError};
use schlieren::render::{RenderOutput, TestSection};
use schlieren::scene::Scene;
use std::cell::RefCell;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A frame of the combustion jet.
struct Frame {
    name: &'static str,
    technique: &'static str,
    march: &'static str,
    /// The noise filter of photons; the scene's own if empty.
    filter: &'static str,
    interpolant: &'static str,
    /// Pixels along each side.
    size: u32,
    /// Photons per pixel; 0 for beams.
    photons: u32,
    /// What a GPU should reach, in frames per second.
    bar: Option<f64>,
}

const FRAMES: [Frame; 9] = [
    frame("knife", KNIFE, 512, 10, Some(200.0)),
    frame("knife", KNIFE, 1024, 10, Some(60.0)),
    // As the dissertation's: its GPU interpolated linearly.
    Frame { interpolant: "trilinear", ..frame("knife", KNIFE, 512, 10, Some(200.0)) },
    Frame { interpolant: "trilinear", ..frame("knife", KNIFE, 1024, 10, Some(60.0)) },
    frame("interferogram", "[technique]\nkind = \"interferogram\"\n", 512, 10, None),
    frame("dots", "[technique]\nkind = \"bos\"\n", 512, 10, None),
    frame("shadowgraph", "[technique]\nkind = \"shadowgraph\"\n", 512, 0, None),
    Frame { march: "line-of-sight", ..frame("knife, straight rays", KNIFE, 512, 10, None) },
    Frame { filter: CONE, ..frame("knife, cone filter", KNIFE, 512, 10, None) },
];

const CONE: &str = "[sampling.filter]\nkind = \"cone\"\nnearest = 12\n";

/// The ray-steps per second that a GPU should reach.
const RAY_STEPS_PER_SEC: f64 = 1e11;

const KNIFE: &str = "[technique]\nkind = \"schlieren\"\n[technique.cutoff]\nkind = \"knife\"\n";

const fn frame(
    name: &'static str,
    technique: &'static str,
    size: u32,
    photons: u32,
    bar: Option<f64>,
) -> Frame {
    let (march, filter, interpolant) = ("verlet", "", "b-spline");
    Frame { name, technique, march, filter, interpolant, size, photons, bar }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    measure(context, record, Gpu::shared())
}

fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    gpu: Result<Arc<Gpu>, GpuError>,
) -> anyhow::Result<()> {
    record.column("technique", "", "what the frame shows");
    record.column("interpolant", "", "between the nodes of the flow");
    record.column("size", "", "pixels along each side");
    record.column("photons", "", "photons of each pixel; 0 for beams, a ray for each corner");
    record.column("adapter", "", "the GPU and its driver");
    record.column(
        "time",
        "ms",
        "wall time of a frame on the GPU, of as many in a row as take half a second; median over \
         the rounds",
    );
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column(
        "from_idle",
        "ms",
        "wall time of the first of them, after the GPU had nothing to do during the CPU's frame; \
         median over the rounds",
    );
    record.column("rounds", "", "rounds; CPU and GPU took turns");
    record.column("frames", "1/s", "frames per second; left out for a driver on the CPU");
    record.column("bar", "1/s", "what a GPU should reach");
    record.column("ray_steps", "1/s", "steps of photons per second of a frame");
    record.column("cpu_time", "ms", "wall time of the same frame on the CPU, by the same march");
    record.column(
        "of_cpu",
        "",
        "CPU time of the process for a frame on the GPU, by that on the CPU",
    );
    record.column("submissions", "", "times that work was given to the device for a frame");
    record.column("to_device", "bytes", "written to the device for a frame; the flow is there");
    record.column("from_device", "bytes", "read back for a frame");
    record.column("largest", "", "largest difference of a pixel from the CPU's; white is 1");
    record.column("rms", "", "root mean square difference of the pixels");
    let gpu = match gpu {
        Ok(gpu) => gpu,
        Err(e) => {
            record.missing.push(format!("all rows: {e}"));
            return Ok(());
        }
    };
    let software = gpu.is_software();
    record.notes.push(format!("The GPU is {}.", gpu.name()));
    if software {
        record.missing.push(
            "frames per second and the larger frames and flow: the driver runs on the CPU, and \
             its times are those of no GPU"
                .into(),
        );
    }
    let small = context.quick || software;
    context.report_step("combustion jet")?;
    // A driver on the CPU would take hours for what a GPU does in minutes.
    let of_flow = match (context.quick, software) {
        (true, _) => "tiny",
        (false, true) => "small",
        (false, false) => "thesis",
    };
    let field = flow("combustion-jet", of_flow)?;
    record.notes.push(format!(
        "The combustion jet of {:?} nodes, by the march verlet in steps of one voxel (but for \
         straight rays), with the filter of the scene (0.8 pixels, but for the cone's). The flow \
         is on the device before the first frame. The CPU has the same march; the plan would \
         choose line of sight here.",
        field.dims()
    ));
    for f in FRAMES.iter().filter(|f| !small || f.size == 512) {
        check_cancelled(context)?;
        let size = match (context.quick, software) {
            (true, _) => 96,
            (false, true) => 256,
            (false, false) => f.size,
        };
        let sampling = match f.photons {
            0 => String::new(),
            n => format!("[sampling]\nmethod = \"photons\"\nsamples = {n}\n"),
        };
        let scenes = ["gpu", "cpu"].map(|device| {
            scene(&format!(
                "[film]\nsize = [{size}, {size}]\n[march]\ndevice = \"{device}\"\nmethod = \
                 \"{}\"\ninterpolant = \"{}\"\nstep_voxels = 1.0\n{}{sampling}{}",
                f.march, f.interpolant, f.technique, f.filter
            ))
        });
        let [on_gpu, on_cpu] = scenes;
        let scenes = [on_gpu?, on_cpu?];
        context.report_step(format!("{}, {}, {size}²", f.name, f.interpolant))?;
        let mut sections = vec![];
        for scene in &scenes {
            sections.push(TestSection::of_fields(scene, vec![field.clone()], None)?.with_caches());
        }
        // Also copies the flow to the device and compiles the kernels.
        let mut images = vec![];
        for (scene, section) in scenes.iter().zip(&sections) {
            render_image(context, scene, section)?;
            images.push(render_image(context, scene, section)?);
        }
        let [gpu_image, cpu_image] = &images[..] else { anyhow::bail!("two images") };
        let Some(work) = gpu_image.report.device.filter(|w| w.photons > 0) else {
            anyhow::bail!("{}: the GPU did not expose it: {:?}", f.name, gpu_image.report.warnings)
        };
        let in_a_row = frames_in_a_row(context, &scenes[0], &sections[0])?;
        let (errors, from_idle) = (RefCell::new(None), RefCell::new(vec![]));
        let mut variants: Vec<Variant<'_>> = ["GPU", "CPU"]
            .iter()
            .zip(scenes.iter().zip(&sections))
            .map(|(name, (scene, section))| {
                let (context, errors, from_idle) = (&*context, &errors, &from_idle);
                let frames = if *name == "GPU" { in_a_row } else { 1 };
                Variant::new(*name, move || {
                    let mut last = None;
                    for frame in 0..frames {
                        let begun = Instant::now();
                        match render_image(context, scene, section) {
                            Ok(image) => last = Some(image),
                            Err(e) => {
                                errors.borrow_mut().get_or_insert(e);
                                return 0;
                            }
                        }
                        if frame == 0 && frames > 1 {
                            from_idle.borrow_mut().push(begun.elapsed().as_secs_f64());
                        }
                    }
                    last.as_ref().map_or(0, light)
                })
            })
            .collect();
        let timings = interleave(&context.schedule(Schedule::all_threads(), 3.0), &mut variants);
        drop(variants);
        if let Some(e) = errors.into_inner() {
            return Err(e);
        }
        let timings = timings?;
        let [on_gpu, on_cpu] = &timings.variants[..] else { anyhow::bail!("two variants") };
        let [time, cpu_time] = [on_gpu, on_cpu].map(|v| v.summary(Clock::Wall));
        let [work_gpu, work_cpu] = [on_gpu, on_cpu].map(|v| v.summary(Clock::ProcessCpu).median);
        let per_frame = |t: f64| t / f64::from(in_a_row);
        let median = per_frame(time.median);
        let from_idle = Summary::of(&from_idle.into_inner()).map(|s| 1e3 * s.median);
        let (largest, rms) = difference(gpu_image, cpu_image);
        record.rows.push(
            Row::new()
                .with("technique", f.name)
                .with("interpolant", f.interpolant)
                .with("size", size)
                .with("photons", f.photons)
                .with("adapter", gpu.name())
                .with("time", 1e3 * median)
                .with("time_low", 1e3 * per_frame(time.low))
                .with("time_high", 1e3 * per_frame(time.high))
                .with("from_idle", from_idle)
                .with("rounds", on_gpu.samples.len())
                .with("frames", (!software).then_some(1.0 / median))
                .with("bar", f.bar.filter(|_| !small))
                .with("ray_steps", (work.ray_steps > 0).then(|| work.ray_steps as f64 / median))
                .with("cpu_time", 1e3 * cpu_time.median)
                .with("of_cpu", per_frame(work_gpu) / work_cpu)
                .with("submissions", work.submissions)
                .with("to_device", work.bytes_to_device)
                .with("from_device", work.bytes_from_device)
                .with("largest", largest)
                .with("rms", rms),
        );
    }
    let fastest = record.rows.iter().filter_map(|r| r.number("ray_steps")).fold(0.0, f64::max);
    record.notes.push(format!(
        "The fastest frame takes {fastest:.2e} ray-steps a second; a GPU should reach \
         {RAY_STEPS_PER_SEC:e}."
    ));
    Ok(())
}

/// Number of frames in a row that take half a second: a GPU needs some frames until its clock is
/// that of work. One where frames are slow.
fn frames_in_a_row(
    context: &Context<'_>,
    scene: &Scene,
    section: &TestSection,
) -> anyhow::Result<u32> {
    const ROUND: Duration = Duration::from_millis(500);
    let (begun, mut frames) = (Instant::now(), 0);
    while begun.elapsed() < ROUND {
        render_image(context, scene, section)?;
        frames += 1;
    }
    Ok(frames)
}

/// A number that an image with other light does not have.
fn light(image: &RenderOutput) -> u64 {
    image.pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>().to_bits()
}

/// Largest and root mean square difference of the pixels.
fn difference(a: &RenderOutput, b: &RenderOutput) -> (f64, f64) {
    let (mut largest, mut squares, mut count) = (0.0f64, 0.0, 0.0);
    for (a, b) in a.pixels.iter().flatten().zip(b.pixels.iter().flatten()) {
        let d = (f64::from(*a) - f64::from(*b)).abs();
        // NaN is the largest difference.
        largest = if d > largest || d.is_nan() { d } else { largest };
        (squares, count) = (squares + d * d, count + 1.0);
    }
    (largest, (squares / f64::max(count, 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    fn measured(gpu: Result<Arc<Gpu>, GpuError>) -> Record {
        let mut record = Record::new("speed-gpu", "", 5, true, Machine::describe());
        let mut progress = |_: &str, _: Option<f64>| Ok(());
        let mut context = Context::new(true, None, &mut progress);
        measure(&mut context, &mut record, gpu).unwrap();
        record
    }

    #[test]
    fn without_a_gpu_the_record_says_what_is_missing() {
        let record = measured(Err(GpuError::NoAdapter("Vulkan finds no device".into())));
        assert!(record.rows.is_empty() && record.missing[0].contains("no GPU"));
    }

    /// Any Vulkan device will do. A driver on the CPU is compared, and no frames per second are
    /// claimed for it.
    #[test]
    fn frames_of_a_gpu_are_those_of_the_cpu_and_no_software_is_taken_for_one() {
        let gpu = match Gpu::shared() {
            Ok(gpu) => gpu,
            Err(e) => {
                let required = std::env::var_os("RTSV_REQUIRE_PEERS").is_some_and(|v| v == "1");
                assert!(!required, "{e}");
                return;
            }
        };
        let software = gpu.is_software();
        let record = measured(Ok(gpu));
        assert!(record.unexplained_columns().is_empty());
        assert_eq!(record.rows.len(), FRAMES.iter().filter(|f| f.size == 512).count());
        assert_eq!(record.missing.len(), usize::from(software));
        for row in &record.rows {
            assert_eq!(row.number("frames").is_none(), software);
            assert!(row.number("rms").is_some_and(|d| d < 2e-3), "{row:?}");
            assert!(row.number("from_device").is_some_and(|b| b < 4e5), "{row:?}");
        }
    }
}
