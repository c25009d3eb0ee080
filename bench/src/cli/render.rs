//! `bench render` and `bench picture`.

use super::{ImageArgs, RenderArgs, stored_file};
use crate::image::framing::{Framing, read_camera};
use crate::image::style::{BACKGROUNDS, RenderStyle};
use crate::image::subject::{LoadOptions, Subject, VolumeChoice};
use crate::image::{RenderControl, RenderRequest, RenderedImage, draw, gallery, save};
use anyhow::Context as _;
use datasets::cli::{Cancel, CommonArgs, CureExt as _, Interrupted, UsageError};
use datasets::colormaps;
use rt_core::bvh::{BuildOptions, BuildQuality, Robustness, Storage, UnknownQuality};
use rt_core::effects::Effects;
use rt_core::environment::Background;
use rt_core::frame::Layers;
use rt_core::ray_stats::RayStats;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

pub(super) fn render(common: CommonArgs, args: &RenderArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let (png, exr) = outputs(args.out.as_deref(), args.exr.as_deref())?;
    let framing = args.camera.as_deref().map(read_camera).transpose()?.unwrap_or(Framing::Fitted);
    let file = args.file.display();

    let volume = match &args.volume {
        Some(name) => VolumeChoice::Named(name.clone()),
        None if args.effects.contains(Effects::VOLUMES) => VolumeChoice::Marked,
        None => VolumeChoice::No,
    };
    if args.opacity.is_some() && volume == VolumeChoice::No {
        let text = "--opacity belongs to a volume; add --effects volumes or --volume ARRAY";
        return Err(UsageError(text.into()).into());
    }
    let drawn_as_volume = volume != VolumeChoice::No;

    let start = Instant::now();
    common.note(1, format_args!("reading {file}"));
    let load_options = LoadOptions {
        color_by: args.color_by.clone(),
        isovalue: args.isovalue,
        volume,
        ..LoadOptions::default()
    };
    let stored = stored_file::open(args, &load_options)?;
    let cure = if load_options.volume == VolumeChoice::No {
        "look at the file with the options --color-by and --isovalue in mind, or convert it to \
         .vtp or .vti with ParaView"
    } else {
        "draw it without `volumes`, or make image data of it: in ParaView by Resample To Image, \
         saved as .vti; \
         --volume names one of its arrays"
    };
    let (subject, format) = match &stored {
        Some(stored) => (stored.subject(args, &load_options)?, stored.format()),
        None => {
            let opened = datasets::read::open(&args.file)?;
            let subject = Subject::from_file(&opened, &load_options)
                .with_context(|| format!("{file}: cannot be drawn so"))
                .cure(cure)?;
            (subject, opened.format)
        }
    };
    let read_secs = start.elapsed().as_secs_f64();
    cancel.check()?;
    let triangles = stored.as_ref().map_or(subject.triangles() as u64, |s| s.triangles());
    let contents = subject.contents.clone();
    let scalar_range = args.range.or(subject.scalar_range);
    let mut warnings = subject.warnings.clone();

    common.note(1, format_args!("drawing {}", contents.join(", ")));
    let style = RenderStyle {
        effects: args.effects.with_if(drawn_as_volume, Effects::VOLUMES),
        opacity: args.opacity.clone().map(|o| o.0),
        colors: args.colors.clone(),
        range: args.range,
        background: args.background,
        ..RenderStyle::default()
    };
    let request = RenderRequest {
        size: args.size,
        samples: args.samples,
        style,
        framing,
        build: BuildOptions {
            quality: args.quality,
            robustness: args.robustness,
            storage: args.storage,
            ..BuildOptions::default()
        },
        layers: if exr.is_some() { Layers::ALL } else { Layers::COLOR },
    };
    let bar = common.progress(u64::from(args.samples), "drawing");
    let mut on_samples = |samples: u32| bar.set_position(u64::from(samples));
    let mut control =
        RenderControl { cancel: Some(cancel.flag().clone()), samples_done: Some(&mut on_samples) };
    let rendered = draw(subject, &request, &mut control)?;
    drop(bar);
    warnings.extend(rendered.warnings.iter().cloned());
    write(png, exr, &rendered, &request, &mut warnings)?;
    for w in &warnings {
        common.warn(format_args!("{file}: {w}"));
    }

    let object = json!({
        "file": args.file,
        "format": format,
        "contents": contents,
        "triangles": triangles,
        "scalar_range": scalar_range,
        "size": args.size,
        "samples": rendered.report.samples,
        "effects": rendered.report.effects.names().collect::<Vec<_>>(),
        "robustness": args.robustness.name(),
        "quality": args.quality.name(),
        "storage": args.storage.name(),
        "rays": rays(&rendered.report.rays),
        "stored": stored.as_ref().map(|s| s.page_use()),
        "seconds": { "read": read_secs, "build": rendered.build_secs, "render": rendered.render_secs },
        "warnings": warnings,
        "output": png,
        "exr": exr,
    });
    common.result(&object, || {
        let written: Vec<String> =
            [png, exr].iter().flatten().map(|p| p.display().to_string()).collect();
        format!(
            "{}: {}; read {read_secs:.2} s, build {:.2} s, render {:.2} s, {} rays",
            written.join(", "),
            contents.join(", "),
            rendered.build_secs,
            rendered.render_secs,
            rendered.report.rays.total()
        )
    })?;
    ended(&rendered)
}

pub(super) fn gallery_image(common: CommonArgs, args: &ImageArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let entry = gallery::find(&args.name).map_err(UsageError)?;
    let (png, exr) = outputs(args.out.as_deref(), args.exr.as_deref())?;
    let bar = common.progress(u64::from(args.samples), entry.name);
    let mut on_samples = |samples: u32| bar.set_position(u64::from(samples));
    let mut control =
        RenderControl { cancel: Some(cancel.flag().clone()), samples_done: Some(&mut on_samples) };
    let p = entry.render(args.size, args.samples, &mut control)?;
    drop(bar);
    let mut warnings = p.rendered.warnings.clone();
    write(png, exr, &p.rendered, &p.request, &mut warnings)?;
    for w in &warnings {
        common.warn(format_args!("{}: {w}", entry.name));
    }
    let object = json!({
        "picture": entry.name,
        "contents": p.contents,
        "size": args.size,
        "effects": p.rendered.report.effects.names().collect::<Vec<_>>(),
        "rays": rays(&p.rendered.report.rays),
        "seconds": { "data": p.data_secs, "build": p.rendered.build_secs, "render": p.rendered.render_secs },
        "warnings": warnings,
        "output": png,
        "exr": exr,
    });
    common.result(&object, || {
        format!(
            "{}; build {:.2} s, render {:.2} s",
            p.contents, p.rendered.build_secs, p.rendered.render_secs
        )
    })?;
    ended(&p.rendered)
}

/// After Ctrl-C, the image is saved with the samples so far, and the program says so.
fn ended(rendered: &RenderedImage) -> anyhow::Result<()> {
    if rendered.is_interrupted() { Err(Interrupted.into()) } else { Ok(()) }
}

/// Checks the file names before hours of work are spent on an image that cannot be written.
fn outputs<'a>(
    png: Option<&'a Path>,
    exr: Option<&'a Path>,
) -> Result<(Option<&'a Path>, Option<&'a Path>), UsageError> {
    for (path, ending) in [(png, "png"), (exr, "exr")] {
        let Some(path) = path else { continue };
        if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)) {
            return Err(UsageError(format!(
                "`{}` does not end in .{ending}; -o writes PNG, --exr OpenEXR",
                path.display()
            )));
        }
    }
    Ok((png, exr))
}

fn write(
    png: Option<&Path>,
    exr: Option<&Path>,
    rendered: &RenderedImage,
    request: &RenderRequest,
    warnings: &mut Vec<String>,
) -> anyhow::Result<()> {
    if rendered.is_interrupted() {
        let (done, all) = (rendered.report.samples, request.samples);
        warnings.push(format!("stopped after {done} of {all} samples per pixel"));
    }
    if let Some(path) = png {
        let report = save::write_png(path, &rendered.frame)?;
        if report.nan > 0 {
            warnings.push(format!("{} pixels are not a number and drawn magenta", report.nan));
        }
    }
    if let Some(path) = exr {
        save::write_exr(path, rendered, request)?;
        if save::rounds_ids(&rendered.frame) {
            warnings.push("primitive ids above 16777216 are rounded in the OpenEXR file".into());
        }
    }
    Ok(())
}

fn rays(r: &RayStats) -> Value {
    json!({
        "primary": r.primary,
        "shadow": r.shadow,
        "ambient_occlusion": r.ambient_occlusion,
        "reflection": r.reflection,
        "refraction": r.refraction,
        "transparency": r.transparency,
        "path": r.path,
        "volume": r.volume,
        "total": r.total(),
    })
}

// ---- values of options --------------------------------------------------------------------------
/// Parses an image size such as `960x540`.
pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    let wrong =
        || format!("`{text}` is not a size; write for example 960x540 (1 to 16384 pixels each)");
    let (w, h) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let pixels = |t: &str| t.parse().ok().filter(|n| (1..=16384).contains(n));
    Ok([pixels(w).ok_or_else(wrong)?, pixels(h).ok_or_else(wrong)?])
}

/// Parses a range such as `0.5,2`.
pub(super) fn range(text: &str) -> Result<[f32; 2], String> {
    let wrong =
        || format!("`{text}` is not a range; write for example 0.5,2 (the lower number first)");
    let (lo, hi) = text.split_once(',').ok_or_else(wrong)?;
    let number = |t: &str| t.trim().parse().ok().filter(|v: &f32| v.is_finite());
    let (lo, hi) = (number(lo).ok_or_else(wrong)?, number(hi).ok_or_else(wrong)?);
    if lo < hi { Ok([lo, hi]) } else { Err(wrong()) }
}

/// Finds a value by its name; the error lists the names.
fn by_name<T: Copy>(
    text: &str,
    what: &str,
    all: impl Iterator<Item = (&'static str, T)>,
) -> Result<T, String> {
    let all: Vec<(&str, T)> = all.collect();
    let found = all.iter().find(|(name, _)| name.eq_ignore_ascii_case(text));
    found.map(|f| f.1).ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|a| a.0).collect();
        format!("there is no {what} `{text}`; there are: {}", known.join(", "))
    })
}

pub(super) fn quality(text: &str) -> Result<BuildQuality, String> {
    text.parse().map_err(|e: UnknownQuality| e.to_string())
}
pub(super) fn robustness(text: &str) -> Result<Robustness, String> {
    by_name(text, "robustness", Robustness::ALL.into_iter().map(|r| (r.name(), r)))
}
pub(super) fn storage(text: &str) -> Result<Storage, String> {
    by_name(text, "storage", Storage::ALL.into_iter().map(|s| (s.name(), s)))
}
/// Scalars and opacities of a volume's transfer function.
#[derive(Debug, Clone)]
pub(super) struct Opacity(Vec<[f32; 2]>);

pub(super) fn opacity(text: &str) -> Result<Opacity, String> {
    let point = |p: &str| {
        let (scalar, opacity) = p.split_once(':')?;
        let numbers = [scalar.trim().parse::<f32>().ok()?, opacity.trim().parse::<f32>().ok()?];
        (numbers[0].is_finite() && (0.0..=1.0).contains(&numbers[1])).then_some(numbers)
    };
    let points: Option<Vec<[f32; 2]>> = text.split(',').map(point).collect();
    let points = points.filter(|p| p.is_sorted_by(|a, b| a[0] <= b[0])).ok_or(
        "give SCALAR:OPACITY in order of scalar, opacity 0 to 1, as in 40:0,150:0.1,270:0.9",
    )?;
    Ok(Opacity(points))
}
pub(super) fn background(text: &str) -> Result<Background, String> {
    by_name(text, "background", BACKGROUNDS.into_iter())
}
pub(super) fn colors(text: &str) -> Result<String, String> {
    by_name(text, "colour map", colormaps::NAMES.into_iter().map(|n| (n, n))).map(Into::into)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_that_is_gone_is_refused_with_the_one_to_take() {
        let words = quality("fastest").unwrap_err();
        assert!(words.contains("`fastest`") && words.contains("give `fast`"), "{words}");
        let words = quality("quick").unwrap_err();
        assert!(words.ends_with("there are: fast, balanced, best"), "{words}");
        assert_eq!(quality("Best"), Ok(BuildQuality::Best));
    }
}
