//! Implements `schlieren sweep`: renders a time series, or one flow for several values of a key of
//! its scene.

use super::render::{Outputs, draw_and_write};
use super::scene_args::SceneArgs;
use crate::render::ReadAhead;
use crate::scene::Scene;
use clap::Args;
use datasets::cli::{Cancel, CommonArgs, UsageError};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Options of `schlieren sweep`.
#[derive(Debug, Args)]
pub(super) struct SweepArgs {
    /// Files of a time series, or one collection (.pvd), or one file with --set
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// A key of the scene with its values: technique.cutoff.angle_deg=0,45,90
    #[arg(long, value_name = "KEY=V1,V2,...", value_parser = setting)]
    set: Option<Setting>,
    /// Numbered images: out-0000.png for out.png
    #[arg(long, short, value_name = "PNG")]
    out: Option<PathBuf>,
    /// Numbered OpenEXR images
    #[arg(long, value_name = "EXR")]
    exr: Option<PathBuf>,
    /// Numbered deflection maps
    #[arg(long, value_name = "NPY")]
    npy: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
}

/// A key of the scene and its values.
#[derive(Debug, Clone)]
struct Setting {
    key: Vec<String>,
    values: Vec<toml::Value>,
}

/// Parses a setting such as `film.focus_m=0.1,0.2`. A value that is not TOML is text.
fn setting(text: &str) -> Result<Setting, String> {
    let wrong =
        || format!("`{text}` is not KEY=V1,V2,...; write for example film.focus_m=0.1,0.2,0.4");
    let (key, values) = text.split_once('=').ok_or_else(wrong)?;
    let value = |v: &str| {
        let parsed = format!("v = {v}").parse::<toml::Table>().ok().and_then(|mut t| t.remove("v"));
        parsed.unwrap_or_else(|| toml::Value::String(v.into()))
    };
    if key.is_empty() || values.is_empty() {
        return Err(wrong());
    }
    Ok(Setting {
        key: key.split('.').map(str::to_string).collect(),
        values: values.split(',').map(|v| value(v.trim())).collect(),
    })
}

/// Returns the scene with a key set to a value.
fn with(scene: &Scene, key: &[String], value: &toml::Value) -> anyhow::Result<Scene> {
    let mut tree = toml::Value::Table(scene.to_toml()?.parse()?);
    let mut at = &mut tree;
    for part in key {
        let table = at.as_table_mut().ok_or_else(|| {
            UsageError(format!("--set {}: `{part}` is inside a value", key.join(".")))
        })?;
        at = table.entry(part.clone()).or_insert_with(|| toml::Value::Table(toml::Table::new()));
    }
    *at = value.clone();
    let text = toml::to_string(&tree)?;
    Scene::from_toml(&text).map_err(|e| {
        let why = std::error::Error::source(&e).map_or(String::new(), |s| format!(": {s}"));
        UsageError(format!("--set {}={value}: {e}{why}", key.join("."))).into()
    })
}

pub(super) fn sweep(common: CommonArgs, args: &SweepArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    if Outputs::new(args.out.as_deref(), args.exr.as_deref(), args.npy.as_deref())?.is_empty() {
        return Err(UsageError("no output: give -o PNG, --exr EXR or --npy NPY".into()).into());
    }

    // The scenes to render, each with the value that distinguishes it.
    let mut runs: Vec<(serde_json::Value, Scene)> = Vec::new();
    match &args.set {
        Some(set) => {
            let [file] = &args.files[..] else {
                return Err(UsageError("--set varies one file; omit the others".into()).into());
            };
            let scene = args.scene.scene(Some(file))?;
            for value in &set.values {
                runs.push((json!({ set.key.join("."): value }), with(&scene, &set.key, value)?));
            }
        }
        None => {
            for step in crate::input::series(&args.files)? {
                runs.push((json!({ "time": step.time }), args.scene.scene(Some(&step.path))?));
            }
        }
    }

    let is_series = args.set.is_none();
    let mut reference: Option<f64> = None;
    // All times are relative to the surroundings of the first one, so that the images are
    // comparable.
    let relative = |scene: &Scene, reference: Option<f64>| {
        let mut scene = scene.clone();
        if is_series && scene.flow.reference_n_minus_1.is_none() {
            scene.flow.reference_n_minus_1 = reference;
        }
        scene
    };
    let mut sections = ReadAhead::default();
    for (i, (label, scene)) in runs.iter().enumerate() {
        cancel.check()?;
        let numbered = |p: &Option<PathBuf>| p.as_ref().map(|p| number(p, i));
        let (png, exr, npy) = (numbered(&args.out), numbered(&args.exr), numbered(&args.npy));
        let outputs = Outputs::new(png.as_deref(), exr.as_deref(), npy.as_deref())?;
        let scene = relative(scene, reference);
        let start = Instant::now();
        let mut section = sections.open(&scene, |what| common.note(0, what))?;
        let read_secs = start.elapsed().as_secs_f64();
        reference = reference.or(section.input.as_ref().map(|i| i.reference_n_minus_1));
        if let Some((_, next)) = runs.get(i + 1) {
            sections.begin(&relative(next, reference), &scene, &section);
        }
        let drawn = (&scene, &mut section, read_secs);
        let summary = draw_and_write(common, cancel, drawn, &outputs)?;
        sections.give_back(&scene, section);
        let mut object = summary.json;
        if let Some(map) = object.as_object_mut() {
            map.insert("index".into(), i.into());
            map.insert("swept".into(), label.clone());
        }
        common.result(&object, || format!("{label} {}", summary.text))?;
    }
    Ok(())
}

/// Numbers a file name: `out.png` becomes `out-0003.png`.
fn number(path: &std::path::Path, i: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    path.with_file_name(format!("{stem}-{i:04}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_set_with_the_type_they_have() {
        let scene = Scene::from_toml("[flow]\nfile = \"a.vti\"\ndensity = \"rho\"").unwrap();
        let s = setting("technique.cutoff.angle_deg=0.0,45.0").unwrap();
        assert_eq!(s.values.len(), 2);
        let turned = with(&scene, &s.key, &s.values[1]).unwrap();
        assert_eq!(
            turned.technique,
            crate::scene::TechniqueSpec::Schlieren {
                cutoff: crate::scene::CutoffSpec::Knife {
                    angle_deg: 45.0,
                    open: 0.5,
                    open_m: None
                }
            }
        );
        let s = setting("view.direction=x,y").unwrap();
        assert_eq!(with(&scene, &s.key, &s.values[0]).unwrap().view.direction.to_string(), "x");
        let s = setting("film.focsu_m=1.0").unwrap();
        assert!(with(&scene, &s.key, &s.values[0]).unwrap_err().to_string().contains("focsu_m"));
    }

    #[test]
    fn images_are_numbered() {
        assert_eq!(number("a/out.png".as_ref(), 12), PathBuf::from("a/out-0012.png"));
    }
}
