//! Turns the library's sentences, which name keys of scene files, into ones that name options.

use datasets::cli::{Interrupted, UsageError};

/// Keys of a scene with the options of the same meaning. Longer keys come before their beginnings.
const OPTIONS: [(&str, &str); 47] = [
    ("flow.density_unit_kg_m3", "--density-unit"),
    ("flow.temperature_zero_k", "--temperature-zero"),
    ("flow.pressure_unit_pa", "--pressure-unit"),
    ("flow.pressure_zero_pa", "--pressure-zero"),
    ("flow.temperature", "--temperature"),
    ("flow.pressure", "--pressure"),
    ("flow.density", "--density"),
    ("flow.n_minus_1", "--n-minus-1"),
    ("flow.electrons", "--electrons"),
    ("flow.humidity", "--humidity"),
    ("flow.co2_ppm", "--co2-ppm"),
    ("flow.species", "--species"),
    ("flow.length_unit_m", "--length-unit"),
    ("flow.resample_nodes", "--resample"),
    ("flow.resample_samples", "--resample-samples"),
    ("flow.reconstruction", "--reconstruction"),
    ("flow.smoothing_nodes", "--smoothing"),
    ("flow.average_jumps", "--smoothing"),
    ("flow.on_cells", "--on-cells"),
    ("flow.spacing", "--spacing"),
    ("flow.origin", "--origin"),
    ("flow.outside", "--outside"),
    ("flow.hidden", "--hidden"),
    ("flow.revolve", "--revolve"),
    ("flow.span", "--span"),
    ("light.wavelengths_nm", "--wavelength"),
    ("light.source", "--source"),
    ("lenses.collimator_m", "--collimator"),
    ("lenses.schlieren_m", "--focal-length"),
    ("film.field_of_view_m", "--field-of-view"),
    ("film.focus_m", "--film-distance"),
    ("film.exposure", "--exposure"),
    ("film.size", "--size"),
    ("technique.fringe_spacing_m", "--fringe-spacing"),
    ("technique.fringe_angle_deg", "--fringe-angle"),
    ("technique.visibility", "--visibility"),
    ("technique.dot_diameter_m", "--dot-diameter"),
    ("technique.dot_spacing_m", "--dot-spacing"),
    ("technique.strength", "--strength"),
    ("technique.kind", "--technique"),
    ("solids.files", "--solid"),
    ("march.tolerance_rad", "--tolerance"),
    ("march.step_voxels", "--step"),
    ("march.interpolant", "--interpolant"),
    ("march.skip_rad", "--skip"),
    ("march.method", "--march"),
    ("march.device", "--device"),
];

/// A sentence of the library in the words of the command line.
pub(super) fn in_options(text: &str) -> String {
    // A section of a scene file.
    let mut text = text.strip_prefix("[flow]: ").unwrap_or(text).to_owned();
    for (key, option) in OPTIONS {
        // Sentences that name both keep the option.
        for both in [
            format!("{key} ({option})"),
            format!("{key}, {option}"),
            format!("{option} ({key} in a scene)"),
        ] {
            text = text.replace(&both, option);
        }
        text = replaced(&text, key, option);
    }
    text
}

/// Replaces whole words only: `film.size` is not the beginning of `film.sizes`.
fn replaced(text: &str, key: &str, option: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(key) {
        let (before, from) = rest.split_at(at);
        let after = &from[key.len()..];
        let part_of_word = |c: char| c.is_alphanumeric() || c == '_';
        let whole = !before.ends_with(|c: char| part_of_word(c) || c == '.')
            && !after.starts_with(part_of_word);
        out.push_str(before);
        out.push_str(if whole { option } else { key });
        rest = after;
    }
    out + rest
}

/// An error in the words of the command line. Errors that decide the exit code stay what they are.
pub(super) fn error_in_options(error: anyhow::Error) -> anyhow::Error {
    if let Some(UsageError(text)) = error.downcast_ref::<UsageError>() {
        return UsageError(in_options(text)).into();
    }
    if error.downcast_ref::<Interrupted>().is_some()
        || error.downcast_ref::<clap::Error>().is_some()
    {
        return error;
    }
    let sentences: Vec<String> = error.chain().map(ToString::to_string).collect();
    let in_words: Vec<String> = sentences.iter().map(|s| in_options(s)).collect();
    // The type of an error may mean something to who prints it.
    if in_words == sentences {
        return error;
    }
    let mut chained: Option<anyhow::Error> = None;
    for sentence in in_words.into_iter().rev() {
        chained = Some(match chained {
            None => anyhow::Error::msg(sentence),
            Some(cause) => cause.context(sentence),
        });
    }
    chained.unwrap_or(error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_become_options_and_other_words_stay() {
        assert_eq!(
            in_options("march.skip_rad has no effect; set flow.on_cells (--on-cells)"),
            "--skip has no effect; set --on-cells"
        );
        assert_eq!(
            in_options("[flow]: flow.temperature needs flow.pressure: name its array"),
            "--temperature needs --pressure: name its array"
        );
        assert_eq!(in_options("film.sizes and my_film.size"), "film.sizes and my_film.size");
        assert_eq!(in_options("give technique.cutoff.open_m"), "give technique.cutoff.open_m");
        let error = anyhow::Error::msg("flow.span is 0").context("flow.vti: no field");
        assert_eq!(format!("{:#}", error_in_options(error)), "flow.vti: no field: --span is 0");
    }

    #[test]
    fn every_option_exists() {
        use clap::CommandFactory;
        let command = super::super::Cli::command();
        let render = command.find_subcommand("render").expect("render");
        for (_, option) in OPTIONS {
            let found = render.get_arguments().any(|a| a.get_long() == option.strip_prefix("--"));
            assert!(found, "{option}");
        }
    }
}
