//! Control groups of Linux (cgroups(7)) that limit the memory of programs, the pages of files that
//! the system keeps for them included: the only way to show what a program does where memory is
//! short, on a machine where it is not.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where control groups are mounted.
const ROOT: &str = "/sys/fs/cgroup";
/// Enters the group whose list of processes is `$0`, and becomes the program. The group has the
/// program from its first page on.
const ENTER: &str = "echo $$ > \"$0\" && exec \"$@\"";

/// A group that may hold so much memory. It is removed when dropped, after its processes have
/// ended.
#[derive(Debug)]
pub struct ControlGroup {
    folder: PathBuf,
    peak: &'static str,
}

impl ControlGroup {
    /// A new group of at most `bytes`, below that of this process.
    ///
    /// # Errors
    /// What the machine does not allow, and the cure.
    pub fn with_memory(bytes: u64) -> Result<ControlGroup, String> {
        let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
        let (parent, version) = memory_group(&groups, Path::new(ROOT)).ok_or(
            "this system has no control groups for memory: run it on Linux, with /sys/fs/cgroup \
             mounted",
        )?;
        let name = format!("rtsv-{}-{}", std::process::id(), bytes);
        let folder = parent.join(name);
        let refused = |what: &Path, e: std::io::Error| {
            format!(
                "{}: {e}; a control group needs root, or a group that was delegated: systemd-run \
                 --user --scope -p Delegate=yes",
                what.display()
            )
        };
        if version == Version::Two {
            // Where it is on already, or a group has processes of its own, this fails; whether
            // there is a limit then, the next step tells.
            let _ = fs::write(parent.join("cgroup.subtree_control"), "+memory");
        }
        fs::create_dir(&folder).map_err(|e| refused(&folder, e))?;
        let (limit, peak) = version.files();
        let group = ControlGroup { folder, peak };
        let limit = group.folder.join(limit);
        fs::write(&limit, bytes.to_string()).map_err(|e| refused(&limit, e))?;
        // Where there is swap, it would be more memory. Not all kernels count it.
        if version == Version::Two {
            let _ = fs::write(group.folder.join("memory.swap.max"), "0");
        } else {
            let _ = fs::write(group.folder.join("memory.swappiness"), "0");
        }
        Ok(group)
    }

    /// A command that runs `program` in the group; its arguments are to be added.
    #[must_use]
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new("/bin/sh");
        command.args(["-c", ENTER]).arg(self.folder.join("cgroup.procs")).arg(program);
        command
    }

    /// The most bytes that the group held, files' pages included; `None` where the kernel does not
    /// tell.
    #[must_use]
    pub fn peak_bytes(&self) -> Option<u64> {
        fs::read_to_string(self.folder.join(self.peak)).ok()?.trim().parse().ok()
    }
}

impl Drop for ControlGroup {
    fn drop(&mut self) {
        // A process that just ended may still count as its member.
        for _ in 0..50 {
            if fs::remove_dir(&self.folder).is_ok() {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Version {
    One,
    Two,
}

impl Version {
    /// Names of the limit and of the most that was used.
    fn files(self) -> (&'static str, &'static str) {
        match self {
            Version::One => ("memory.limit_in_bytes", "memory.max_usage_in_bytes"),
            Version::Two => ("memory.max", "memory.peak"),
        }
    }
}

/// Folder of the group in the text of `/proc/self/cgroup` that counts memory. In a container the
/// path is one of the host's, and the group is the mount itself.
fn memory_group(groups: &str, root: &Path) -> Option<(PathBuf, Version)> {
    let of = |mount: PathBuf, path: &str| {
        let folder = mount.join(path.trim_start_matches('/'));
        if folder.is_dir() { folder } else { mount }
    };
    let lines = || groups.lines().filter_map(|l| l.split_once(':')?.1.split_once(':'));
    let one = lines().find(|(controllers, _)| controllers.split(',').any(|c| c == "memory"));
    if let Some((_, path)) = one {
        return Some((of(root.join("memory"), path), Version::One));
    }
    let (_, path) = lines().find(|(controllers, _)| controllers.is_empty())?;
    root.join("cgroup.controllers").is_file().then(|| (of(root.to_path_buf(), path), Version::Two))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_group_that_counts_memory_is_found_in_both_versions() {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str| root.path().join(path);
        fs::create_dir_all(at("memory/job")).unwrap();
        let groups = "9:cpu:/\n4:hugetlb,memory:/job\n0::/\n";
        assert_eq!(memory_group(groups, root.path()), Some((at("memory/job"), Version::One)));
        let of_host = "4:memory:/docker/1\n";
        assert_eq!(memory_group(of_host, root.path()), Some((at("memory"), Version::One)));
        assert_eq!(memory_group("0::/job\n", root.path()), None);
        fs::write(at("cgroup.controllers"), "memory\n").unwrap();
        assert_eq!(memory_group("0::/none\n", root.path()), Some((at(""), Version::Two)));
        assert_eq!(memory_group("", root.path()), None);
    }

    #[test]
    fn a_program_in_a_group_may_hold_no_more_than_its_memory() {
        let group = match ControlGroup::with_memory(64 << 20) {
            Ok(group) => group,
            // Only root may make groups, and not in every container.
            Err(why) => {
                assert!(why.contains("control group"), "{why}");
                eprintln!("the limit is not tested here: {why}");
                return;
            }
        };
        let take = |bytes: &str| {
            let mut command = group.command(Path::new("/bin/sh"));
            command.args(["-c", "head -c \"$0\" /dev/zero | tail -c \"$0\" | wc -c", bytes]);
            let output = command.output().unwrap();
            String::from_utf8(output.stdout).unwrap().trim().to_owned()
        };
        assert_eq!(take("1000000"), "1000000");
        // `tail` holds what it may have to print, and is killed at the limit.
        assert_eq!(take("200000000"), "0");
        assert!(group.peak_bytes().is_none_or(|peak| peak <= 64 << 20));
        let folder = group.folder.clone();
        drop(group);
        assert!(!folder.exists());
    }
}
