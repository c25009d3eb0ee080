//! Helpers that run as an MPI job, under Open MPI and MPICH. The image stays the same, even when
//! the job is killed. The program itself is not a rank of the job.

mod common;

use common::{Picture, Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Far longer than any step needs, even on a slow and busy machine; a hang fails here.
const BOUND: Duration = Duration::from_secs(100);

/// The jobs take turns: ranks poll while they wait, and six of them leave two cores nothing.
static ONE_JOB: Mutex<()> = Mutex::new(());

/// `mpirun -n 3 gluray serve-rays --mpi`; dropping the value ends the job.
struct Job {
    launcher: Child,
    sockets: Vec<PathBuf>,
    /// What the launcher and its ranks print.
    log: PathBuf,
}

impl Job {
    fn start(mpirun: &Path, place: &Path) -> Job {
        let first = place.join("rays");
        let sockets = vec![first.clone(), place.join("rays.1"), place.join("rays.2")];
        let log = place.join("job.log");
        let output = std::fs::File::options().create(true).append(true).open(&log).expect("a log");
        let launcher = Command::new(mpirun)
            .args([
                "-n",
                "3",
                env!("CARGO_BIN_EXE_gluray"),
                "--quiet",
                "serve-rays",
                "--mpi",
                "--socket",
            ])
            .arg(&first)
            // Open MPI needs these in a container and with more ranks than cores; others ignore
            // them.
            .envs([("OMPI_ALLOW_RUN_AS_ROOT", "1"), ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")])
            .envs([
                ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
                ("OMPI_MCA_mpi_yield_when_idle", "1"),
            ])
            .envs([("OMPI_MCA_hwloc_base_binding_policy", "none"), ("OMPI_MCA_btl", "self,vader")])
            .stdin(Stdio::null())
            .stdout(output.try_clone().expect("a log"))
            .stderr(output)
            .spawn()
            .expect("mpirun starts");
        let mut job = Job { launcher, sockets, log };
        job.wait("the job is there", |job| {
            assert!(!job.has_ended(), "it ended at once: {}", job.state());
            job.sockets.iter().all(|s| UnixStream::connect(s).is_ok())
        });
        job
    }

    fn wait(&mut self, what: &str, done: impl Fn(&mut Job) -> bool) {
        let begin = Instant::now();
        while !done(self) {
            let late = begin.elapsed() >= BOUND;
            assert!(!late, "{what}: not after {} s: {}", BOUND.as_secs(), self.state());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn has_ended(&mut self) -> bool {
        self.launcher.try_wait().expect("a child").is_some()
    }

    /// What a reader of a failure needs: which ranks run, which sockets answer, what was printed.
    fn state(&self) -> String {
        let ranks: Vec<String> = self.ranks().iter().map(|pid| status(*pid)).collect();
        let answer = |s: &PathBuf| UnixStream::connect(s).map_err(|e| e.kind());
        let sockets: Vec<_> = self.sockets.iter().map(answer).collect();
        let printed = std::fs::read_to_string(&self.log).unwrap_or_default();
        format!("ranks {ranks:?}, sockets {sockets:?}, printed:\n{printed}")
    }

    fn places(&self) -> String {
        let names: Vec<&str> = self.sockets.iter().filter_map(|s| s.to_str()).collect();
        names.join(":")
    }

    /// Processes of the job's ranks, in any order.
    fn ranks(&self) -> Vec<i32> {
        let socket = self.sockets[0].as_os_str().as_encoded_bytes().to_vec();
        let mut pids = Vec::new();
        for entry in std::fs::read_dir("/proc").expect("Linux").flatten() {
            let Some(pid) = entry.file_name().to_str().and_then(|n| n.parse::<i32>().ok()) else {
                continue;
            };
            let line = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
            let arguments: Vec<&[u8]> = line.split(|b| *b == 0).collect();
            let is_gluray = arguments.first().is_some_and(|a| a.ends_with(b"gluray"));
            if is_gluray && arguments.contains(&socket.as_slice()) {
                pids.push(pid);
            }
        }
        pids
    }
}

/// Name, state and the kernel function that a process waits in.
fn status(pid: i32) -> String {
    let read = |what: &str| std::fs::read_to_string(format!("/proc/{pid}/{what}"));
    let lines = read("status").unwrap_or_default();
    let state = lines.lines().find(|l| l.starts_with("State:")).unwrap_or("gone");
    format!("{pid} {state} in {}", read("wchan").unwrap_or_default())
}

fn signal(pid: i32, name: &str) {
    let sent =
        Command::new("kill").args(["-s", name, &pid.to_string()]).status().expect("kill runs");
    assert!(sent.success());
}

impl Drop for Job {
    fn drop(&mut self) {
        // mpirun ends its ranks; it is killed if that takes too long.
        signal_if_there(&mut self.launcher);
    }
}

fn signal_if_there(child: &mut Child) {
    if matches!(child.try_wait(), Ok(None)) {
        signal(child.id() as i32, "TERM");
        let end = Instant::now() + Duration::from_secs(10);
        while matches!(child.try_wait(), Ok(None)) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(20));
        }
        child.kill().ok();
        child.wait().ok();
    }
}

fn picture(x: &Xvfb, python: &Path, sockets: Option<&str>) -> (Picture, Report) {
    let place = folder();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/vtk_scene.py");
    let home = [("HOME", place.path().to_str().expect("UTF-8"))];
    let environment: Vec<(&str, &str)> =
        home.into_iter().chain(sockets.map(|s| ("GLURAY_RANKS", s))).collect();
    let options: &[&str] = &["--mode", "rich"];
    let run = Run { x, folder: place.path(), through: Some(options), environment: &environment };
    let (output, report) = run.program(python, &[scene.to_str().expect("UTF-8")]);
    let file = place.path().join("out.png");
    assert!(file.is_file(), "{}", String::from_utf8_lossy(&output.stderr));
    (Picture::read(&file), report)
}

fn a_job_helps(mpirun: &Path) {
    let _turn = ONE_JOB.lock().unwrap_or_else(PoisonError::into_inner);
    let (Some(_), Some(x)) = (peer("RTSV_PVBATCH"), Xvfb::start()) else { return };
    let Some(python) = peer("RTSV_SYSTEM_PYTHON") else { return };
    let (one, _) = picture(&x, &python, None);
    let place = folder();
    let mut job = Job::start(mpirun, place.path());
    // Twice: programs come and go, and the job stays.
    for _ in 0..2 {
        let (many, report) = picture(&x, &python, Some(&job.places()));
        assert!(one.pixels == many.pixels, "{report:?}");
        assert_eq!((report.problems.clone(), report.ranks.len()), (Vec::new(), 4));
        for r in &report.ranks {
            assert!(r.pictures > 0 && r.rays > 1000 && r.lost.is_none(), "{r:?}");
            assert!(r.rank == 0 || (r.sent_bytes > 10_000 && r.received_bytes > 10_000), "{r:?}");
        }
    }
    // When a rank is killed, MPI ends the job: programs continue without it and report that.
    let ranks = job.ranks();
    assert_eq!(ranks.len(), 3);
    signal(ranks[1], "KILL");
    job.wait("the job ends", Job::has_ended);
    job.wait("its ranks end", |job| job.ranks().is_empty());
    let (alone, report) = picture(&x, &python, Some(&job.places()));
    assert!(one.pixels == alone.pixels, "{report:?}");
    assert_eq!(
        report.problems.iter().filter(|p| p.contains("no helper at")).count(),
        3,
        "{:?}",
        report.problems
    );
    // Another job takes over its sockets, and removes them at the end.
    let mut job = Job::start(mpirun, place.path());
    let (many, report) = picture(&x, &python, Some(&job.places()));
    assert!(one.pixels == many.pixels && report.problems.is_empty(), "{report:?}");
    signal(job.launcher.id() as i32, "INT");
    job.wait("Ctrl-C ends the job", Job::has_ended);
    job.wait("its ranks end", |job| job.ranks().is_empty());
}

#[test]
fn an_open_mpi_job_of_helpers_makes_the_bits_of_one_process_and_may_be_killed() {
    if let Some(mpirun) = peer("RTSV_MPIRUN") {
        a_job_helps(&mpirun);
    }
}

#[test]
fn an_mpich_job_of_helpers_makes_the_bits_of_one_process_and_may_be_killed() {
    if let Some(mpirun) = peer("RTSV_MPIRUN_MPICH") {
        a_job_helps(&mpirun);
    }
}

#[test]
fn without_a_launcher_the_words_say_how_to_start_a_job() {
    let place = folder();
    let mut command = Command::new(env!("CARGO_BIN_EXE_gluray"));
    command.args(["serve-rays", "--mpi", "--socket"]).arg(place.path().join("s"));
    for launcher in ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "COMPOSITE_MPI"] {
        command.env_remove(launcher);
    }
    let output = command.stdin(Stdio::null()).output().expect("it starts");
    let words = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(words.contains("mpirun -n"), "{words}");
}
