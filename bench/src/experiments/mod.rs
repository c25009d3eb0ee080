//! The experiments, one file each, named after their table or figure.

mod accuracy_build;
mod accuracy_cells;
mod accuracy_composite;
mod accuracy_gpu;
mod accuracy_paths;
mod accuracy_resample;
mod accuracy_robust;
mod accuracy_sampling;
mod accuracy_schlieren;
mod accuracy_tolerance;
mod accuracy_volume;
mod baselines;
mod baselines_schlieren;
mod call_overhead;
mod closed_form_gases;
mod compare;
mod effects;
mod fig3_5;
mod fig3_6;
mod fig4_10;
mod fig4_7;
mod fig4_8;
mod fig4_9;
mod fig5_11;
mod fig5_12;
mod fig5_13;
mod fig5_14;
mod frames;
mod image_error;
mod in_situ;
mod installed_tracers;
mod many_meshes;
mod many_ranks;
mod memory_limit;
mod paraview;
mod partition_view;
mod pictures;
mod program_ranks;
mod python;
mod python_process;
mod python_schlieren;
mod rtvtk;
mod shock_angles;
mod smpi;
mod speed_gpu;
mod speed_schlieren;
mod stored_files;
mod strong_scaling;
mod table4_1;
mod table5_1;
mod test_section;
mod wavelet_series;

use crate::checkpoint::{Checkpoint, Extent};
use crate::machine::Machine;
use crate::meshes::MeshScene;
use crate::record::Record;
use crate::{memory, meshes, runner};
use datasets::cli::Interrupted;
use datasets::generate::nested_wavelet::Size;
use rt_core::mesh::TriMesh;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// One experiment.
pub struct Experiment {
    /// Name on the command line: the dissertation's figure or table, or the research question.
    pub id: &'static str,
    /// Chapter of the dissertation to which it belongs.
    pub chapter: u8,
    /// What it shows.
    pub title: &'static str,
    run: fn(&mut Context<'_>, &mut Record) -> anyhow::Result<()>,
}

/// The experiments that have the dissertation's own sizes ([`Context::thesis`]).
pub const WITH_THESIS_SIZES: &[&str] =
    &["fig3.6", "table4.1", "fig4.7", "fig4.9", "stored-files", "memory-limit"];

/// All experiments, in the order of the report.
pub const ALL: &[Experiment] = &[
    Experiment {
        id: "fig3.5",
        chapter: 3,
        title: "Frames per second of compositing, 2 to 128 ranks: binary swap, direct send, IceT",
        run: fig3_5::run,
    },
    Experiment {
        id: "fig3.6",
        chapter: 3,
        title: "Weak scaling of data-parallel rendering, 1 to 128 ranks",
        run: fig3_6::run,
    },
    Experiment {
        id: "fig3.7",
        chapter: 3,
        title: "Strong scaling, mixing layer from outside (RMO)",
        run: strong_scaling::rmo,
    },
    Experiment {
        id: "fig3.8",
        chapter: 3,
        title: "Strong scaling, mixing layer from within (RMI)",
        run: strong_scaling::rmi,
    },
    Experiment {
        id: "fig3.9",
        chapter: 3,
        title: "Strong scaling, plasma (in place of VPIC)",
        run: strong_scaling::vpic,
    },
    Experiment {
        id: "fig3.10",
        chapter: 3,
        title: "Strong scaling, wavelet",
        run: strong_scaling::wavelet,
    },
    Experiment {
        id: "paraview",
        chapter: 3,
        title: "One node of figures 3.6 to 3.10: ParaView with llvmpipe against the same ParaView \
                with vtk-bridge",
        run: paraview::run,
    },
    Experiment {
        id: "partition-view",
        chapter: 3,
        title: "Parts of as many triangles against parts of as much work for the view",
        run: partition_view::run,
    },
    Experiment {
        id: "accuracy-composite",
        chapter: 3,
        title: "Error against bytes and time of blending 128 faint layers, by pixel format",
        run: accuracy_composite::run,
    },
    Experiment {
        id: "in-situ",
        chapter: 3,
        title: "What pictures cost a simulation that makes them while it runs",
        run: in_situ::run,
    },
    Experiment {
        id: "table4.1",
        chapter: 4,
        title: "Frames a second of unmodified OpenGL programs: llvmpipe against gluray",
        run: table4_1::run,
    },
    Experiment {
        id: "passing",
        chapter: 4,
        title: "Nanoseconds per OpenGL call that gluray passes to the driver",
        run: call_overhead::run,
    },
    Experiment {
        id: "fig4.7",
        chapter: 4,
        title: "Time to build the acceleration structure, by preset, against the number of \
                triangles",
        run: fig4_7::run,
    },
    Experiment {
        id: "fig4.8",
        chapter: 4,
        title: "Phases of ParaView’s frames when they are traced: Gantt chart and Chrome trace",
        run: fig4_8::run,
    },
    Experiment {
        id: "fig4.9",
        chapter: 4,
        title: "Time of a frame against the number of triangles",
        run: fig4_9::run,
    },
    Experiment {
        id: "fig4.10",
        chapter: 4,
        title: "Replicated data against data in parts, 1 to 128 ranks; and processes that make a \
                program’s image",
        run: fig4_10::run,
    },
    Experiment {
        id: "stored-files",
        chapter: 4,
        title: "Data in files that may be larger than memory: preparing, opening and drawing them",
        run: stored_files::run,
    },
    Experiment {
        id: "memory-limit",
        chapter: 4,
        title: "Frames of a stored mesh by a program that may hold a quarter of the file",
        run: memory_limit::run,
    },
    Experiment {
        id: "effects",
        chapter: 4,
        title: "What each effect costs, and that an unused one costs nothing",
        run: effects::run,
    },
    Experiment {
        id: "accuracy-sampling",
        chapter: 4,
        title: "Error against time of ambient occlusion, soft shadows and antialiasing, by \
                sampling",
        run: accuracy_sampling::run,
    },
    Experiment {
        id: "accuracy-paths",
        chapter: 4,
        title: "Error against time of path tracing and depth of field by samples, and of the \
                limits on bounces and on the share of a ray",
        run: accuracy_paths::run,
    },
    Experiment {
        id: "accuracy-volume",
        chapter: 4,
        title: "Error against time of volume rendering: tolerances and fixed steps",
        run: accuracy_volume::run,
    },
    Experiment {
        id: "accuracy-build",
        chapter: 4,
        title: "What a better build costs and what rays gain by it",
        run: accuracy_build::run,
    },
    Experiment {
        id: "accuracy-robust",
        chapter: 4,
        title: "Rays that slip through closed surfaces, and what preventing it costs",
        run: accuracy_robust::run,
    },
    Experiment {
        id: "peers",
        chapter: 4,
        title: "Rays per second, builds and memory against Embree 3, Embree 4 and obvhs",
        run: baselines::run,
    },
    Experiment {
        id: "many-meshes",
        chapter: 4,
        title: "Thousands of small meshes: rays and builds against one mesh and against Embree",
        run: many_meshes::run,
    },
    Experiment {
        id: "python",
        chapter: 4,
        title: "Rays from Python: rt_core against trimesh with Embree, Open3D and PyVista",
        run: python::run,
    },
    Experiment {
        id: "python-schlieren",
        chapter: 5,
        title: "The same photograph from Python and by the program",
        run: python_schlieren::run,
    },
    Experiment {
        id: "rtvtk",
        chapter: 3,
        title: "Frames of VTK’s wheel, alone and with rtvtk",
        run: rtvtk::run,
    },
    Experiment {
        id: "frames",
        chapter: 4,
        title: "What a whole frame costs beyond the rays it sends",
        run: frames::run,
    },
    Experiment {
        id: "pictures",
        chapter: 4,
        title: "The dissertation’s data sets as images, with the commands that draw them",
        run: pictures::run,
    },
    Experiment {
        id: "fig5.11",
        chapter: 5,
        title: "Photons per second by technique, on the combustion jet",
        run: fig5_11::run,
    },
    Experiment {
        id: "fig5.12",
        chapter: 5,
        title: "Volume rendering, line of sight and traced light, and how far the latter two are \
                apart",
        run: fig5_12::run,
    },
    Experiment {
        id: "fig5.13",
        chapter: 5,
        title: "What the techniques show of one flow, and what filters make of noise",
        run: fig5_13::run,
    },
    Experiment {
        id: "fig5.14",
        chapter: 5,
        title: "Noise against photons, independent or low-discrepancy, filtered or not",
        run: fig5_14::run,
    },
    Experiment {
        id: "table5.1",
        chapter: 5,
        title: "Memory by data set, by the dissertation’s layout and ours",
        run: table5_1::run,
    },
    Experiment {
        id: "accuracy-schlieren",
        chapter: 5,
        title: "Error against time of light’s way through a gas, and the tolerance asked against \
                the error got",
        run: accuracy_schlieren::run,
    },
    Experiment {
        id: "accuracy-tolerance",
        chapter: 5,
        title: "The tolerance asked for against the error got: thirty gases, lattices and meshes, \
                two views",
        run: accuracy_tolerance::run,
    },
    Experiment {
        id: "accuracy-gpu",
        chapter: 5,
        title: "Error against time of light's way through a gas: CPU in double and single \
                precision, and GPU",
        run: accuracy_gpu::run,
    },
    Experiment {
        id: "accuracy-resample",
        chapter: 5,
        title: "Error of deflections against the size of the lattice to which a mesh is resampled, \
                and its time",
        run: accuracy_resample::run,
    },
    Experiment {
        id: "accuracy-cells",
        chapter: 5,
        title: "Light through the cells of a mesh or through a lattice: error, and time of a ray",
        run: accuracy_cells::run,
    },
    Experiment {
        id: "shock-angles",
        chapter: 5,
        title: "Angles of wedge and cone shocks measured in images, against theta-beta-M and \
                Taylor and Maccoll",
        run: shock_angles::run,
    },
    Experiment {
        id: "peers-schlieren",
        chapter: 5,
        title: "Time at equal error against the dissertation’s method",
        run: baselines_schlieren::run,
    },
    Experiment {
        id: "speed-gpu",
        chapter: 5,
        title: "Whole frames on a GPU: frames per second, bytes moved, and how far the picture is \
                from the CPU's",
        run: speed_gpu::run,
    },
    Experiment {
        id: "speed-schlieren",
        chapter: 5,
        title: "Ray-steps and photons per second, and frames of the combustion jet",
        run: speed_schlieren::run,
    },
];

/// The experiment of that id.
pub fn find(id: &str) -> Option<&'static Experiment> {
    ALL.iter().find(|e| e.id.eq_ignore_ascii_case(id))
}

/// State shared by the experiments of one run of the program.
pub struct Context<'a> {
    /// Smaller data and fewer rounds: each experiment takes less than a minute on two cores.
    pub quick: bool,
    /// The dissertation's own sizes, where an experiment has them: hours, and files of gigabytes.
    pub thesis: bool,
    /// Called with the next step and, where known, the completed fraction of the experiment. An
    /// error stops the experiment.
    pub progress: &'a mut Progress<'a>,
    /// Set to true to stop long renderings between two tiles.
    pub cancel: Option<Arc<AtomicBool>>,
    /// The mesh to measure on instead of the built-in ones.
    pub mesh: Option<MeshScene>,
    /// Where parts of the experiment are kept as they are measured; none are without it.
    pub checkpoint: Option<Checkpoint>,
    wavelets: BTreeMap<Size, Arc<TriMesh>>,
}

/// Progress callback: the step, and the completed fraction of the experiment, 0..=1.
pub type Progress<'a> = dyn FnMut(&str, Option<f64>) -> anyhow::Result<()> + 'a;

impl<'a> Context<'a> {
    /// A context.
    pub fn new(
        quick: bool,
        cancel: Option<Arc<AtomicBool>>,
        progress: &'a mut Progress<'a>,
    ) -> Context<'a> {
        Context {
            quick,
            thesis: false,
            progress,
            cancel,
            mesh: None,
            checkpoint: None,
            wavelets: BTreeMap::new(),
        }
    }

    fn report_step(&mut self, what: impl AsRef<str>) -> anyhow::Result<()> {
        (self.progress)(what.as_ref(), None)
    }

    /// As [`Context::report_step`], with the completed fraction of the experiment.
    fn report_share(&mut self, what: impl AsRef<str>, done: f64) -> anyhow::Result<()> {
        (self.progress)(what.as_ref(), Some(done))
    }

    /// Measures a part of the experiment, and keeps what it adds to the record; or takes that from
    /// an earlier run, where the checkpoint has a part of that name.
    fn part(
        &mut self,
        record: &mut Record,
        name: &str,
        measure: impl FnOnce(&mut Self, &mut Record) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        if self.checkpoint.as_ref().is_some_and(|c| c.restore(name, record)) {
            return Ok(());
        }
        let (before, start) = (Extent::of(record), Instant::now());
        measure(self, record)?;
        let secs = start.elapsed().as_secs_f64();
        match &mut self.checkpoint {
            Some(c) => c.keep(name, record, before, secs, memory::since_start()),
            None => Ok(()),
        }
    }

    /// The wavelet surfaces of a size. Those of up to 4 million triangles are cached for the next
    /// experiment.
    fn wavelet(&mut self, size: Size) -> anyhow::Result<Arc<TriMesh>> {
        if let Some(m) = self.wavelets.get(&size) {
            return Ok(m.clone());
        }
        self.report_step(format!("making the wavelet surfaces of {} triangles", size.name()))?;
        let mesh = meshes::wavelet(size)?;
        if size <= Size::M4 {
            self.wavelets.insert(size, mesh.clone());
        }
        Ok(mesh)
    }

    /// Returns `full`, or its short form, which measures for about `quick_secs`.
    fn schedule(&self, full: runner::Schedule, quick_secs: f64) -> runner::Schedule {
        if self.quick { full.quick(quick_secs) } else { full }
    }
}

/// Result of an experiment.
pub struct Outcome {
    /// The measurements.
    pub record: Record,
    /// Whether Ctrl-C stopped it early: the record contains the finished part and says so.
    pub interrupted: bool,
}

/// Runs one experiment. If interrupted before its first row, returns [`Interrupted`].
pub fn run(experiment: &Experiment, context: &mut Context<'_>) -> anyhow::Result<Outcome> {
    let start = Instant::now();
    memory::start();
    let machine = Machine::describe();
    let Experiment { id, chapter, title, run } = *experiment;
    let mut record = Record::new(id, title, chapter, context.quick, machine);
    let earlier = context.checkpoint.as_ref();
    let (earlier_secs, earlier_memory) = earlier.map_or((0.0, None), Checkpoint::cost);
    record.notes.extend(earlier.and_then(Checkpoint::note));
    // Ctrl-C is not a failure of the experiment.
    let interrupted = match run(context, &mut record) {
        Ok(()) => false,
        Err(e) if e.is::<Interrupted>() && record.rows.is_empty() => return Err(e),
        Err(e) if e.is::<Interrupted>() => {
            record.missing.push(format!(
                "everything after the first {} rows: the run was interrupted; {}",
                record.rows.len(),
                continuation(context, id)
            ));
            true
        }
        Err(e) => return Err(e.context(format!("experiment `{id}` failed"))),
    };
    record.elapsed_secs = earlier_secs + start.elapsed().as_secs_f64();
    let memory = memory::since_start();
    record.peak_memory = Some(earlier_memory.map_or(memory, |m| m.max(memory)));
    let unexplained = record.unexplained_columns();
    anyhow::ensure!(
        unexplained.is_empty(),
        "experiment `{id}` does not explain its columns {unexplained:?}"
    );
    Ok(Outcome { record, interrupted })
}

/// How to measure the rest of an experiment that was interrupted.
fn continuation(context: &Context<'_>, id: &str) -> String {
    let size = match (context.quick, context.thesis) {
        (true, _) => " --quick",
        (_, true) => " --thesis",
        _ => "",
    };
    match &context.checkpoint {
        Some(c) if !c.names().is_empty() => {
            let names = c.names().join(", ");
            format!(
                "`bench run {id}{size} --resume`, with --out and --record as before, measures the \
                 rest (kept: {names})"
            )
        }
        _ => format!("`bench run {id}{size}` measures it all"),
    }
}

/// The record of an experiment that could not run because another program is missing: without rows,
/// with the reason.
pub fn left_out(experiment: &Experiment, why: &str) -> Record {
    let Experiment { id, chapter, title, .. } = *experiment;
    let mut record = Record::new(id, title, chapter, true, Machine::describe());
    record.missing.push(why.into());
    record
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Row;

    fn two_parts(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
        record.column("part", "", "its number");
        for n in 1..=2 {
            context.part(record, &format!("part {n}"), |context, record| {
                context.report_step(n.to_string())?;
                record.rows.push(Row::new().with("part", n));
                Ok(())
            })?;
        }
        Ok(())
    }

    #[test]
    fn a_run_that_was_interrupted_is_continued_where_it_ended() {
        let dir = tempfile::tempdir().unwrap();
        let experiment = Experiment { id: "two", chapter: 4, title: "Two parts", run: two_parts };
        let checkpoint = || Checkpoint::new(dir.path(), "two", false, true, Machine::describe());

        let mut interrupt_second = |step: &str, _: Option<f64>| match step {
            "2" => Err(Interrupted.into()),
            _ => Ok(()),
        };
        let mut context = Context::new(false, None, &mut interrupt_second);
        (context.thesis, context.checkpoint) = (true, Some(checkpoint()));
        let Outcome { record, interrupted } = run(&experiment, &mut context).unwrap();
        assert!(interrupted && record.rows.len() == 1);
        let why = &record.missing[0];
        assert!(why.contains("`bench run two --thesis --resume`"), "{why}");
        assert!(why.ends_with("(kept: part 1)"), "{why}");

        let mut steps = vec![];
        let mut note_steps = |step: &str, _: Option<f64>| {
            steps.push(step.to_owned());
            Ok(())
        };
        let mut context = Context::new(false, None, &mut note_steps);
        context.checkpoint = Some(checkpoint().with_earlier_parts().unwrap());
        let outcome = run(&experiment, &mut context).unwrap();
        drop(context);
        let record = outcome.record;
        let parts: Vec<_> = record.rows.iter().map(|row| row.number("part")).collect();
        assert_eq!((parts, steps), (vec![Some(1.0), Some(2.0)], vec!["2".to_owned()]));
        assert!(!outcome.interrupted && record.missing.is_empty());
        assert!(record.notes[0].contains("ended early measured part 1."), "{:?}", record.notes);
    }

    #[test]
    fn ids_are_unique_and_found_in_any_case() {
        for (i, e) in ALL.iter().enumerate() {
            assert!(ALL[..i].iter().all(|o| o.id != e.id), "{} twice", e.id);
            assert_eq!(find(&e.id.to_uppercase()).map(|f| f.id), Some(e.id));
            assert!((3..=5).contains(&e.chapter) && !e.title.is_empty());
        }
        assert!(WITH_THESIS_SIZES.iter().all(|id| find(id).is_some()));
        assert!(find("fig9.9").is_none());
    }
}
