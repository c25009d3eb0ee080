//! `gluray doctor`: what this machine has, and what is missing.

use super::library;
use crate::doctor::{Finding, Grade, findings, inspect};
use crate::host::config::FIELDS;
use crate::host::config::environment::{OBJECTS, OTHER_VARIABLES, variable_of};
use datasets::cli::{CommonArgs, Status};
use serde_json::json;

/// Options of `gluray doctor`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit code 1 when something will not work.

Examples:
  gluray doctor
  gluray doctor --variables
  gluray doctor --json")]
pub(super) struct DoctorArgs {
    /// List the environment variables that set something, and look at nothing
    #[arg(long)]
    variables: bool,
}

pub(super) fn doctor(args: &DoctorArgs, common: &CommonArgs) -> anyhow::Result<Status> {
    if args.variables {
        return variables(common);
    }
    let found = findings(&inspect(library()));
    common.result(&found, || found.iter().map(in_words).collect::<Vec<_>>().join("\n"))?;
    Ok(if found.iter().any(|f| f.grade == Grade::Bad) { Status::Failure } else { Status::Success })
}

fn in_words(f: &Finding) -> String {
    let grade = match f.grade {
        Grade::Good => "good",
        Grade::Note => "note",
        Grade::Bad => "BAD ",
    };
    let cure = f.cure.as_ref().map_or_else(String::new, |c| format!("\n                    → {c}"));
    format!("{grade}  {:<12}  {}{cure}", f.about, f.found)
}

fn variables(common: &CommonArgs) -> anyhow::Result<Status> {
    let settings = FIELDS.iter().map(|f| (variable_of(f.path), f.about));
    let objects =
        (OBJECTS.to_owned(), "materials of single objects: KEY.color=#ff0000 KEY.mirror=0.3");
    let others = OTHER_VARIABLES.iter().map(|(n, about)| ((*n).to_owned(), *about));
    let list: Vec<(String, &str)> = settings.chain([objects]).chain(others).collect();
    let value: Vec<_> =
        list.iter().map(|(name, about)| json!({ "name": name, "about": about })).collect();
    common.result(&value, || {
        list.iter()
            .map(|(name, about)| format!("{name:<42} {about}"))
            .collect::<Vec<_>>()
            .join("\n")
    })?;
    Ok(Status::Success)
}
