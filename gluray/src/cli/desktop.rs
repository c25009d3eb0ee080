//! `gluray install-desktop`: an entry in the desktop's menu that starts a program ray traced.
//!
//! It is a copy of the program's own entry (freedesktop.org's Desktop Entry Specification 1.5) with
//! `gluray run` in its commands, in the user's folder. The program's own entry stays.

use anyhow::Context as _;
use datasets::cli::{CommonArgs, CureExt as _};
use std::fs;
use std::path::{Path, PathBuf};

/// Options of `gluray install-desktop`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gluray install-desktop gmsh
  gluray install-desktop --mode path /usr/share/applications/org.paraview.ParaView.desktop
  gluray install-desktop --remove gmsh")]
pub(super) struct DesktopArgs {
    /// Look of traced surfaces, as of `gluray run`.
    #[arg(long, default_value = "rich", value_parser = ["match", "phong", "rich", "enhance", "path"])]
    mode: String,
    /// Remove the entry that an earlier call made.
    #[arg(long)]
    remove: bool,
    /// Name of the program's entry, with or without `.desktop`, or its file.
    #[arg(value_name = "ENTRY")]
    entry: String,
}

/// Writes or removes the entry.
pub(super) fn install(args: &DesktopArgs, common: &CommonArgs) -> anyhow::Result<()> {
    let get = crate::host::folders::variable;
    let name = Path::new(&args.entry).file_name().unwrap_or_default().to_string_lossy();
    let name = name.trim_end_matches(".desktop").to_owned();
    let home = data_home(get)
        .context("there is no folder for menu entries")
        .cure("set XDG_DATA_HOME or HOME")?;
    let file = home.join("applications").join(format!("gluray-{name}.desktop"));
    if args.remove {
        fs::remove_file(&file)
            .with_context(|| format!("cannot remove {}", file.display()))
            .cure("name the entry as when it was made")?;
        return common.result(&file, || format!("removed {}", file.display()));
    }
    let original = find(&args.entry, &home, get)?;
    let text = fs::read_to_string(&original)
        .with_context(|| format!("cannot read {}", original.display()))?;
    let program = std::env::current_exe().context("cannot tell where this program is")?;
    let entry = traced(&text, &command(&program, &args.mode));
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    fs::write(&file, entry).with_context(|| format!("cannot write {}", file.display()))?;
    common.result(&file, || format!("{} (of {})", file.display(), original.display()))
}

fn data_home(get: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    let named = get("XDG_DATA_HOME").map(PathBuf::from).filter(|p| p.is_absolute());
    named.or_else(|| Some(PathBuf::from(get("HOME")?).join(".local/share")))
}

/// The file of a program's own entry.
fn find(entry: &str, home: &Path, get: impl Fn(&str) -> Option<String>) -> anyhow::Result<PathBuf> {
    if entry.contains('/') {
        return Ok(entry.into());
    }
    let file = format!("{}.desktop", entry.trim_end_matches(".desktop"));
    let others = get("XDG_DATA_DIRS").unwrap_or_else(|| "/usr/local/share:/usr/share".to_owned());
    let folders = std::iter::once(home.to_owned()).chain(others.split(':').map(PathBuf::from));
    let mut looked = Vec::new();
    for folder in folders {
        let path = folder.join("applications").join(&file);
        if path.is_file() {
            return Ok(path);
        }
        looked.push(folder.join("applications").display().to_string());
    }
    Err(anyhow::anyhow!("there is no {file} in {}", looked.join(", ")))
        .cure("name the entry's file; `ls /usr/share/applications` shows the names")
}

/// The beginning of a command line, quoted as entries want it.
fn command(program: &Path, mode: &str) -> String {
    let mut path = String::new();
    for c in program.display().to_string().chars() {
        // In quotes, these need a backslash, which the file's own escapes double.
        if matches!(c, '"' | '`' | '$' | '\\') {
            path.push_str("\\\\");
        }
        path.push(c);
        // `%` begins a field code, and each backslash is one of a pair in the file.
        if matches!(c, '%' | '\\') {
            path.push(c);
        }
    }
    format!("\"{path}\" run --mode {mode} -- ")
}

/// The entry `text` under another name and with `command` before its commands.
fn traced(text: &str, command: &str) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let (key, value) = line.split_once('=').unwrap_or((line, ""));
        let key = key.trim_end();
        match key.split('[').next().unwrap_or_default() {
            "Name" => out += &format!("{key}={} (ray traced)", value.trim_start()),
            "Exec" => out += &format!("{key}={command}{}", value.trim_start()),
            // Files keep opening with the program itself; and a program that is started by D-Bus
            // would be started without us.
            "MimeType" | "DBusActivatable" => continue,
            _ => out += line,
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_get_another_name_and_our_command_everywhere() {
        let text = "[Desktop Entry]\nName=Gmsh\nName[de]=Gmsh\nExec=gmsh %f\nMimeType=model/x;\n\
                    DBusActivatable=true\nIcon=gmsh\n[Desktop Action New]\nExec = gmsh --new\n";
        let expected = "[Desktop Entry]\nName=Gmsh (ray traced)\nName[de]=Gmsh (ray traced)\n\
                        Exec=G gmsh %f\nIcon=gmsh\n[Desktop Action New]\nExec=G gmsh --new\n";
        assert_eq!(traced(text, "G "), expected);
    }

    #[test]
    fn odd_paths_of_this_program_are_quoted() {
        let plain = command(Path::new("/usr/lib/rtsv/bin/gluray"), "rich");
        assert_eq!(plain, "\"/usr/lib/rtsv/bin/gluray\" run --mode rich -- ");
        let odd = command(Path::new(r"/a b/50%/$x\y"), "rich");
        assert!(odd.starts_with(r#""/a b/50%%/\\$x\\\\y" run"#), "{odd}");
    }

    #[test]
    fn a_missing_entry_is_an_error_that_names_the_folders() {
        let get = |name: &str| (name == "XDG_DATA_DIRS").then(|| "/nowhere".to_owned());
        let error = find("gmsh", Path::new("/home"), get).expect_err("there is none");
        let text = datasets::cli::report(&error);
        assert!(text.contains("gmsh.desktop") && text.contains("/nowhere/applications"), "{text}");
        assert!(text.contains("cure: "), "{text}");
    }
}
