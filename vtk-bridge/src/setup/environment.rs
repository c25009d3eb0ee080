//! The environment variables that make any script render with ray tracing.

use super::layout::Layout;

/// The kind of program whose variables are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// Python scripts and programs with VTK itself.
    Vtk,
    /// ParaView, pvpython, pvbatch.
    ParaView,
}

impl Program {
    /// Whether it runs VTK `flavour`.
    pub fn runs(self, flavour: &str) -> bool {
        flavour.starts_with("pv") == (self == Program::ParaView)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        if self == Program::Vtk { "VTK" } else { "ParaView" }
    }

    /// How to install its headers.
    pub fn cure(self) -> &'static str {
        match self {
            Program::Vtk => {
                "install them (Debian: `apt-get install libvtk9-dev`) or name their folder in \
                 RTV_VTK_INCLUDE, then run `vtk-bridge install`; \
                 a VTK from pip has none: use `python -m rtvtk script.py`"
            }
            Program::ParaView => {
                "install them (Debian: `apt-get install paraview-dev libglew-dev`) or name their \
                 folder in RTV_VTK_INCLUDE, then run `vtk-bridge install`"
            }
        }
    }
}

/// Lines for `eval` in a POSIX shell.
pub fn exports(layout: &Layout, autoload_before: Option<&str>) -> String {
    let ours = layout.autoload().display().to_string();
    let others = autoload_before
        .into_iter()
        .flat_map(|v| v.split(':'))
        .filter(|p| !p.is_empty() && *p != ours);
    let path = std::iter::once(ours.as_str()).chain(others).collect::<Vec<_>>().join(":");
    format!(
        "export VTK_AUTOLOAD_PATH={}\nexport RTV_HOME={}\n",
        quoted(&path),
        quoted(&layout.prefix().display().to_string())
    )
}

/// Lines for `eval` that make ANARI programs load this device when they request the library named
/// by the environment.
pub fn anari_exports(layout: &Layout, libraries_before: Option<&str>) -> String {
    let ours = layout.anari().parent().unwrap_or(layout.prefix()).display().to_string();
    let others = libraries_before
        .into_iter()
        .flat_map(|v| v.split(':'))
        .filter(|p| !p.is_empty() && *p != ours);
    let path = std::iter::once(ours.as_str()).chain(others).collect::<Vec<_>>().join(":");
    format!("export LD_LIBRARY_PATH={}\nexport ANARI_LIBRARY=rtv\n", quoted(&path))
}

/// Quotes `text` as one word of a POSIX shell.
fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exports_survive_spaces_and_quotes_and_keep_other_folders() {
        let layout = Layout::at("/a b/it's".into());
        let text = exports(&layout, Some("/other:/a b/it's/autoload"));
        assert_eq!(
            text,
            "export VTK_AUTOLOAD_PATH='/a b/it'\\''s/autoload:/other'\nexport RTV_HOME='/a \
             b/it'\\''s'\n"
        );
        assert_eq!(
            anari_exports(&Layout::at("/a b".into()), Some("/lib:/a b/anari")),
            "export LD_LIBRARY_PATH='/a b/anari:/lib'\nexport ANARI_LIBRARY=rtv\n"
        );
    }
}
