//! A small system of another release in a folder, and commands in it.
//!
//! Mounts are made in a mount namespace of each command's own (`unshare --mount`), so they end with
//! it however it ends, and this machine never sees them.

use super::Place;
use super::suites::{Part, Suite, VARIABLES};
use crate::command::first_line_of;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Settings of dpkg in the system: nobody needs it after a crash, and nobody reads its manuals.
const DPKG: &str = "force-unsafe-io\npath-exclude=/usr/share/doc/*\npath-exclude=/usr/share/man/*\n\
                    path-exclude=/usr/share/info/*\npath-exclude=/usr/share/locale/*\n";

/// Where packages come from.
const MIRROR: &str = "http://deb.debian.org/debian";

/// Whether systems can be made here, or why not. Installs debootstrap if it may.
pub(super) fn allowed(may_install: bool) -> Result<(), String> {
    if first_line_of("id", &["-u"]).as_deref() != Some("0") {
        return Err("chroot needs root".to_owned());
    }
    let try_mount = "mount --make-rprivate / && mount --bind /usr /mnt && chroot / true";
    if first_line_of("unshare", &["--mount", "sh", "-c", try_mount]).is_none() {
        return Err("mounts and chroots are not allowed here".to_owned());
    }
    let there = || first_line_of("debootstrap", &["--version"]).is_some();
    if !there() && may_install {
        let mut install = Command::new("apt-get");
        install.args(["install", "-y", "-q", "--no-install-recommends", "debootstrap"]);
        install.env("DEBIAN_FRONTEND", "noninteractive");
        println!("{install:?}");
        let _ = install.status();
    }
    if there() { Ok(()) } else { Err("debootstrap is not installed".to_owned()) }
}

/// A system.
#[derive(Debug)]
pub(super) struct Chroot {
    /// Its root.
    folder: PathBuf,
    /// Folders of this machine that are seen there at their own paths.
    shared: Vec<PathBuf>,
    /// What is seen there as the folder for the tests' files, so that it is not this machine's.
    files: (PathBuf, PathBuf),
}

impl Chroot {
    /// Makes the system, or takes the one that an earlier run made.
    pub(super) fn make(place: &Place<'_>, suite: &Suite, paraview: bool) -> Result<Chroot, String> {
        let systems = place.build.join("systems");
        let folder = systems.join(suite.name);
        let files = systems.join(format!("{}-files", suite.name));
        let seen = place.build.join("tmp");
        for made in [&systems, &files, &seen] {
            fs::create_dir_all(made).map_err(|e| format!("{}: {e}", made.display()))?;
        }
        let mut shared = vec![place.root.to_owned()];
        if !place.build.starts_with(place.root) {
            shared.push(place.build.clone());
        }
        let chroot = Chroot { folder, shared, files: (files, seen) };
        chroot.install(suite, paraview)?;
        Ok(chroot)
    }

    fn install(&self, suite: &Suite, paraview: bool) -> Result<(), String> {
        let packages = if paraview {
            [suite.packages, suite.paraview].concat()
        } else {
            suite.packages.to_vec()
        };
        let recipe = [&packages[..], suite.unpacked].concat().join(" ");
        // Written last: a system without it is not whole.
        let done = self.folder.join("etc/rtsv-packages");
        if fs::read_to_string(&done).is_ok_and(|text| text == recipe) {
            return Ok(());
        }
        if !self.folder.join("etc/debian_version").is_file()
            || !self.folder.join("etc/apt").is_dir()
        {
            let _ = fs::remove_dir_all(&self.folder);
        }
        let settings = self.folder.join("etc/dpkg/dpkg.cfg.d");
        fs::create_dir_all(&settings).map_err(|e| format!("{}: {e}", settings.display()))?;
        let file = settings.join("rtsv");
        fs::write(&file, DPKG).map_err(|e| format!("{}: {e}", file.display()))?;
        if !self.folder.join("usr/bin/apt-get").is_file() {
            let mut make = Command::new("debootstrap");
            make.args(["--variant=minbase", suite.name]).arg(&self.folder).arg(MIRROR);
            // An older debootstrap does not know the name, but all releases since are made alike.
            let scripts = Path::new("/usr/share/debootstrap/scripts");
            if !scripts.join(suite.name).exists() {
                make.arg(scripts.join("sid"));
            }
            quietly(&mut make)?;
        }
        self.shell("apt-get -q update")?;
        let list = packages.join(" ");
        self.shell(&format!("apt-get install -y -q --no-install-recommends {list}"))?;
        let list = suite.unpacked.join(" ");
        self.shell(&format!(
            "mkdir -p /tmp/unpacked && cd /tmp/unpacked && apt-get -q download {list} && for p in \
             *.deb; do dpkg -x $p /; done && rm -rf /tmp/unpacked"
        ))?;
        // Kept packages are a third of its size.
        self.shell("apt-get clean")?;
        fs::write(&done, recipe).map_err(|e| format!("{}: {e}", done.display()))
    }

    /// The versions that matter: `VTK 9.3.0, Mesa 25.0.7, g++ 14.2.0`.
    pub(super) fn versions(&self) -> String {
        let query = "dpkg-query -W -f '${Version}\n' PACKAGE 2>/dev/null";
        let packages = [
            ("VTK", "'libvtk9.?'"),
            ("ParaView", "paraview"),
            ("Mesa", "libgl1-mesa-dri"),
            ("g++", "g++"),
        ];
        let of = |(name, package): (&str, &str)| {
            let query = query.replace("PACKAGE", package);
            let output = self.command(&["sh", "-c", &query]).output().ok()?;
            let version = String::from_utf8_lossy(&output.stdout).trim().to_owned();
            Some(format!("{name} {}", upstream(&version)?))
        };
        packages.into_iter().filter_map(of).collect::<Vec<_>>().join(", ")
    }

    /// Runs the tests of `part` in `program`, with their output on the terminal too.
    pub(super) fn run(&self, program: &Path, part: &Part) -> Result<String, String> {
        let path = program.display().to_string();
        let mut line = format!("'{path}' {} 2>&1", part.filters.join(" "));
        // libtest's status is in its output.
        line.push_str(" || true");
        println!("==> {line}");
        let output = self.command(&["sh", "-c", &line]).output();
        let output = output.map_err(|e| format!("unshare does not start: {e}"))?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        println!("{text}{}", String::from_utf8_lossy(&output.stderr));
        Ok(text)
    }

    fn shell(&self, line: &str) -> Result<(), String> {
        quietly(&mut self.command(&["sh", "-c", line]))
    }

    /// `words` as a command in the system.
    fn command(&self, words: &[&str]) -> Command {
        let root = self.folder.display();
        let mut script = "set -e; mount --make-rprivate /\n".to_owned();
        let mut mount = |options: &str, from: &Path, to: &Path| {
            let at = format!("{root}{}", to.display());
            script += &format!("mkdir -p '{at}'; mount {options} '{}' '{at}'\n", from.display());
        };
        mount("-t proc", Path::new("proc"), Path::new("/proc"));
        mount("--rbind", Path::new("/dev"), Path::new("/dev"));
        for folder in &self.shared {
            mount("--bind", folder, folder);
        }
        mount("--bind", &self.files.0, &self.files.1);
        script += &format!("exec chroot '{root}' \"$@\"");
        let mut command = Command::new("unshare");
        command.args(["--mount", "sh", "-c", &script, "sh"]).args(words).stdin(Stdio::null());
        command.env_clear().envs(VARIABLES.iter().copied());
        command.env("DEBIAN_FRONTEND", "noninteractive");
        command
    }
}

/// The upstream part of one of Debian's versions: `9.3.0` of `9.3.0+dfsg1-4+b1`.
fn upstream(version: &str) -> Option<&str> {
    let version = version.rsplit_once(':').map_or(version, |(_, v)| v);
    version.split(['+', '-', '~']).next().filter(|v| !v.is_empty())
}

/// Runs a command; its last lines are part of the error.
fn quietly(command: &mut Command) -> Result<(), String> {
    let shown = command.get_args().last().unwrap_or_default().to_string_lossy().into_owned();
    println!("==> {}: {shown}", command.get_program().to_string_lossy());
    let output = command.stdin(Stdio::null()).output();
    let output = output.map_err(|e| format!("`{shown}` does not start: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().rev().take(15).collect();
    let last = lines.into_iter().rev().collect::<Vec<_>>().join("\n");
    Err(format!("`{shown}`: {}\n{last}", output.status))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_of_debian_are_shown_without_its_own_parts() {
        for (whole, part) in
            [("9.3.0+dfsg1-4+b1", "9.3.0"), ("4:14.2.0-1", "14.2.0"), ("25.0.7-2", "25.0.7")]
        {
            assert_eq!(upstream(whole), Some(part));
        }
        assert_eq!(upstream(""), None);
    }
}
