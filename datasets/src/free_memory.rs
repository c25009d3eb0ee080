//! How much memory programs can still take: of the machine, and of the control group that holds
//! them. Containers and batch systems limit memory by control groups (Linux: cgroups(7)); who takes
//! more is killed, however much the machine has.

use std::path::{Path, PathBuf};

/// Memory in bytes that this process can still take, where the system tells: the least of what the
/// machine has and what its control groups leave.
pub fn available_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let of_machine = available_in(&text)?;
    let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    Some(left_by_groups(&groups, Path::new("/sys/fs/cgroup")).unwrap_or(u64::MAX).min(of_machine))
}

/// `MemAvailable` in the text of `/proc/meminfo`.
fn available_in(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

/// Bytes that the control groups of the text of `/proc/self/cgroup` leave, each of them with all
/// groups around it; `None` without a limit. `root` is where they are mounted.
fn left_by_groups(groups: &str, root: &Path) -> Option<u64> {
    let lines = groups.lines().filter_map(|line| {
        // hierarchy:controllers:path, the controllers empty for version 2.
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?);
        let path = path.trim_start_matches('/');
        let is_memory = controllers.split(',').any(|c| c == "memory");
        let files = match controllers {
            "" => &VERSION_2,
            _ if is_memory => &VERSION_1,
            _ => return None,
        };
        Some((root.join(files.mount), path.to_owned(), files))
    });
    lines.filter_map(|(mount, path, files)| left_by_group(&mount, &path, files)).min()
}

/// Names of a version's files.
struct Files {
    mount: &'static str,
    limit: &'static str,
    used: &'static str,
    /// Entry of `memory.stat` with the bytes of files, which make room when memory is short.
    of_files: &'static str,
}

const VERSION_1: Files = Files {
    mount: "memory",
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    of_files: "total_cache",
};
const VERSION_2: Files =
    Files { mount: "", limit: "memory.max", used: "memory.current", of_files: "file" };

/// The least that the group at `path` below `mount` and those around it leave. In a container the
/// path is that of the host, and the container's own group is the mount itself.
fn left_by_group(mount: &Path, path: &str, files: &Files) -> Option<u64> {
    let below: Vec<PathBuf> = Path::new(path).ancestors().map(|p| mount.join(p)).collect();
    below.iter().filter_map(|folder| left_by_one(folder, files)).min()
}

fn left_by_one(folder: &Path, files: &Files) -> Option<u64> {
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).ok();
    let number = |name: &str| read(name)?.trim().parse::<u64>().ok();
    // "max", and a limit of 2^63 less a page, are none.
    let limit = number(files.limit).filter(|limit| *limit < 1 << 60)?;
    let used = number(files.used).unwrap_or(0);
    let of_files = read("memory.stat").and_then(|text| {
        let line = text.lines().find_map(|l| l.strip_prefix(files.of_files)?.strip_prefix(' '));
        line?.trim().parse::<u64>().ok()
    });
    Some(limit.saturating_sub(used.saturating_sub(of_files.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_in_the_form_that_linux_writes() {
        let text = "MemTotal:       24573284 kB\nMemAvailable:   22543420 kB\n";
        assert_eq!(available_in(text), Some(22_543_420 * 1024));
        assert_eq!(available_in("MemTotal: 1 kB\n"), None);
        assert_eq!(available_in("MemAvailable: much kB\n"), None);
    }

    /// Files below a folder, each with its text.
    fn files(all: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (name, text) in all {
            let path = root.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn a_control_group_leaves_its_limit_less_what_is_used_apart_from_files() {
        let root = files(&[
            ("job/memory.max", "1000000\n"),
            ("job/memory.current", "700000\n"),
            ("job/memory.stat", "anon 300000\nfile 400000\nfile_mapped 1000\n"),
        ]);
        assert_eq!(left_by_groups("0::/job\n", root.path()), Some(700_000));
        let root = files(&[
            ("memory/slurm/job/memory.limit_in_bytes", "1000000\n"),
            ("memory/slurm/job/memory.usage_in_bytes", "700000\n"),
            ("memory/slurm/job/memory.stat", "cache 1\ntotal_cache 100000\n"),
        ]);
        let groups = "9:cpu:/\n4:memory:/slurm/job\n0::/\n";
        assert_eq!(left_by_groups(groups, root.path()), Some(400_000));
    }

    #[test]
    fn the_tightest_group_around_a_process_counts() {
        let root = files(&[
            ("memory.max", "max\n"),
            ("slurm/memory.max", "600000\n"),
            ("slurm/memory.current", "100000\n"),
            ("slurm/job/memory.max", "800000\n"),
            ("slurm/job/step/memory.max", "max\n"),
        ]);
        assert_eq!(left_by_groups("0::/slurm/job/step\n", root.path()), Some(500_000));
        // In a container, the path is one of the host's.
        let root = files(&[("memory.max", "600000\n")]);
        assert_eq!(left_by_groups("0::/docker/1234\n", root.path()), Some(600_000));
    }

    #[test]
    fn without_a_limit_the_machine_counts() {
        let root = files(&[("memory.max", "max\n"), ("memory.current", "5\n")]);
        assert_eq!(left_by_groups("0::/\n", root.path()), None);
        let root = files(&[("memory/memory.limit_in_bytes", "9223372036854771712\n")]);
        assert_eq!(left_by_groups("4:memory:/\n", root.path()), None);
        assert_eq!(left_by_groups("", Path::new("/nowhere")), None);
        // What is used above the limit leaves nothing.
        let root = files(&[("memory.max", "100\n"), ("memory.current", "500\n")]);
        assert_eq!(left_by_groups("0::/\n", root.path()), Some(0));
    }
}
