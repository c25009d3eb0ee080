//! Describes the machine on which a record was made.

use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// The machine, its state and the program's version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the processor.
    pub cpu: String,
    /// Cores this process may use.
    pub cores: usize,
    /// Widest vector instructions: `AVX-512`, `AVX2`, `SSE4.2`, `NEON` or `baseline`.
    pub simd: String,
    /// Memory in GiB; 0 if unknown.
    pub memory_gib: f64,
    /// Average number of running processes over the last minute, at the start; `null` if unknown.
    pub load_1_min: Option<f64>,
    /// Kernel and its version.
    pub os: String,
    /// Start, UTC, ISO 8601.
    pub date: String,
    /// Version of this program.
    pub version: String,
    /// Commit of the working tree; `null` outside a repository. Older records append a `+` for
    /// [`Machine::dirty`].
    pub commit: Option<String>,
    /// Whether versioned files other than records had uncommitted changes; `null` outside a
    /// repository.
    #[serde(default)]
    pub dirty: Option<bool>,
    /// Whether the build was optimised. Times of a debug build are meaningless.
    pub optimised: bool,
}

/// Average number of running processes over the last minute; `None` if unknown.
pub fn load() -> Option<f64> {
    leading_number(&std::fs::read_to_string("/proc/loadavg").unwrap_or_default())
}

impl Machine {
    /// Queries the system.
    pub fn describe() -> Machine {
        let read = |p: &str| std::fs::read_to_string(p).unwrap_or_default();
        let memory_kib = field(&read("/proc/meminfo"), "MemTotal")
            .and_then(|v| leading_number(&v))
            .unwrap_or(0.0);
        let secs = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
        let git = GitState::of(Path::new("."));
        let kernel = read("/proc/sys/kernel/osrelease");
        Machine {
            cpu: field(&read("/proc/cpuinfo"), "model name")
                .unwrap_or_else(|| std::env::consts::ARCH.into()),
            cores: std::thread::available_parallelism().map_or(1, |n| n.get()),
            simd: simd_level().into(),
            memory_gib: (memory_kib / 1024.0 / 1024.0 * 10.0).round() / 10.0,
            load_1_min: load(),
            os: format!("{} {}", std::env::consts::OS, kernel.trim()).trim().to_string(),
            date: iso_8601(secs),
            version: env!("CARGO_PKG_VERSION").into(),
            commit: git.as_ref().map(|g| g.commit.clone()),
            dirty: git.map(|g| g.dirty),
            optimised: !cfg!(debug_assertions),
        }
    }

    /// Day of the run, `2026-11-21`.
    pub fn day(&self) -> &str {
        self.date.get(..10).unwrap_or(&self.date)
    }

    /// A directory name for this machine: `2core-avx-512-amd-epyc`.
    pub fn slug(&self) -> String {
        slug(&format!("{}core {} {}", self.cores, self.simd, self.cpu))
    }
}

/// Keeps lower-case letters and digits; replaces everything else with single hyphens.
pub fn slug(text: &str) -> String {
    let mut s = String::new();
    for c in text.chars().flat_map(char::to_lowercase) {
        if c.is_ascii_alphanumeric() {
            s.push(c);
        } else if !s.ends_with('-') && !s.is_empty() {
            s.push('-');
        }
    }
    s.trim_end_matches('-').to_string()
}

fn field(text: &str, key: &str) -> Option<String> {
    let line = text.lines().find(|l| l.split(':').next().is_some_and(|k| k.trim() == key))?;
    Some(line.split_once(':')?.1.trim().to_string())
}

fn leading_number(text: &str) -> Option<f64> {
    text.split_whitespace().next()?.parse().ok()
}

/// The state of the working tree according to git.
#[derive(Debug, PartialEq, Eq)]
struct GitState {
    commit: String,
    dirty: bool,
}

impl GitState {
    /// The state of the repository that contains `dir`; `None` without a repository or without git.
    /// Records do not count as changes: the first record of a run would mark the tree as dirty for
    /// all others.
    fn of(dir: &Path) -> Option<GitState> {
        let git = |args: &[&str]| {
            let mut git = std::process::Command::new("git");
            let out = git
                .arg("-C")
                .arg(dir)
                .args(args)
                .stderr(std::process::Stdio::null())
                .output()
                .ok()?;
            out.status.success().then(|| String::from_utf8_lossy(&out.stdout).trim().to_string())
        };
        let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
        let records = ":(top,exclude)bench/runs";
        let changed =
            git(&["status", "--porcelain", "--untracked-files=no", "--", ":(top)", records]);
        // If git cannot tell, the tree is not considered clean.
        Some(GitState { commit, dirty: changed.is_none_or(|s| !s.is_empty()) })
    }
}

/// The widest vector instructions of this processor, among those that make a difference here.
pub fn simd_level() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        let has_512 = std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512dq")
            && std::arch::is_x86_feature_detected!("avx512vl")
            && std::arch::is_x86_feature_detected!("avx512bw");
        if has_512 {
            return "AVX-512";
        }
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
        {
            return "AVX2";
        }
        if std::arch::is_x86_feature_detected!("sse4.2") {
            return "SSE4.2";
        }
        "baseline"
    }
    #[cfg(target_arch = "aarch64")]
    {
        "NEON"
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    {
        "baseline"
    }
}

/// Seconds since 1970 as UTC date and time; the civil-from-days arithmetic counts in 400-year eras
/// from 1 March.
fn iso_8601(unix_secs: u64) -> String {
    let (days, secs) = ((unix_secs / 86_400) as i64, unix_secs % 86_400);
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let day_of_era = shifted.rem_euclid(146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!(
        "{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z",
        secs / 3600,
        secs / 60 % 60,
        secs % 60
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_around_leap_days_and_centuries() {
        assert_eq!(iso_8601(0), "1970-01-01T00:00:00Z");
        assert_eq!(iso_8601(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(iso_8601(951_868_800), "2000-03-01T00:00:00Z");
        assert_eq!(iso_8601(1_709_251_199), "2024-02-29T23:59:59Z");
        assert_eq!(iso_8601(4_107_542_400), "2100-03-01T00:00:00Z");
    }

    #[test]
    fn description_is_filled_in() {
        let m = Machine::describe();
        assert!(m.cores >= 1);
        assert!(!m.cpu.is_empty());
        assert_eq!(m.day().len(), 10);
        assert!(m.slug().chars().all(|c| c.is_ascii_alphanumeric() || c == '-'), "{}", m.slug());
    }

    #[test]
    fn a_tree_is_dirty_by_its_sources_and_not_by_records_or_new_files() {
        let dir = tempfile::tempdir().unwrap();
        let git = |args: &[&str]| {
            let identity = ["-c", "user.name=n", "-c", "user.email=e@example.org"];
            let mut git = std::process::Command::new("git");
            let done = git.arg("-C").arg(dir.path()).args(identity).args(args).output();
            assert!(done.is_ok_and(|d| d.status.success()), "git {args:?}");
        };
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        assert_eq!(GitState::of(dir.path()), None);
        git(&["init", "-q"]);
        std::fs::create_dir_all(dir.path().join("bench/runs")).unwrap();
        write("source.rs", "1");
        write("bench/runs/a.json", "1");
        git(&["add", "."]);
        git(&["commit", "-q", "-m", "first"]);
        let dirty = |dir: &Path| GitState::of(dir).unwrap().dirty;
        assert!(!dirty(dir.path()));
        write("bench/runs/a.json", "2");
        write("notes.txt", "new");
        assert!(!dirty(dir.path()) && !dirty(&dir.path().join("bench")));
        write("source.rs", "2");
        assert!(dirty(dir.path()) && dirty(&dir.path().join("bench")));
    }

    #[test]
    fn slugs_have_no_double_or_outer_hyphens() {
        assert_eq!(slug(" Intel(R) Xeon(R)  CPU @ 2.50GHz "), "intel-r-xeon-r-cpu-2-50ghz");
    }
}
