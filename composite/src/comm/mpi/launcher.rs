//! Which MPI library a process uses: that of the launcher that started it.
use super::MpiError;
use std::ffi::OsString;

/// The variable that selects the library, by name or path.
pub const CHOICE_VARIABLE: &str = "COMPOSITE_MPI";

/// Libraries to try, in this order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// File names, as for `dlopen`.
    pub libraries: Vec<String>,
    /// Why these were chosen.
    pub reason: String,
}

/// File names of Open MPI's library.
pub const OPEN_MPI: &[&str] = &["libmpi.so.40", "libmpi.so"];
/// File names of MPICH's library; Intel MPI and MVAPICH use the second.
pub const MPICH: &[&str] = &["libmpich.so.12", "libmpi.so.12", "libmpich.so"];

/// An environment variable. If its value is not UTF-8, it is converted with replacement characters,
/// and the error for the missing library names it. If it were treated as unset, another library
/// would be loaded silently.
pub fn variable(name: &str) -> Option<String> {
    std::env::var_os(name).map(text)
}

fn text(value: OsString) -> String {
    value.into_string().unwrap_or_else(|value| value.to_string_lossy().into_owned())
}

/// Whether this process looks like a rank of an MPI job.
pub fn launched(variable: impl Fn(&str) -> Option<String>) -> bool {
    choose(variable).is_ok()
}

/// Chooses by the variables that launchers set for their ranks.
///
/// # Errors
/// [`MpiError::NotLaunched`] if there are none.
pub fn choose(variable: impl Fn(&str) -> Option<String>) -> Result<Choice, MpiError> {
    let choice = |names: &[&str], reason: String| {
        Ok(Choice { libraries: names.iter().map(ToString::to_string).collect(), reason })
    };
    if let Some(wish) = variable(CHOICE_VARIABLE).filter(|wish| !wish.is_empty()) {
        let reason = format!("{CHOICE_VARIABLE}={wish}");
        return match wish.as_str() {
            "openmpi" => choice(OPEN_MPI, reason),
            "mpich" => choice(MPICH, reason),
            path => choice(&[path], reason),
        };
    }
    if variable("OMPI_COMM_WORLD_RANK").is_some() {
        return choice(OPEN_MPI, "OMPI_COMM_WORLD_RANK is set".to_string());
    }
    // Hydra and its relatives (MPICH, Intel MPI, MVAPICH), and Slurm with PMI 1 or 2, which those
    // use.
    if variable("PMI_RANK").is_some() {
        return choice(MPICH, "PMI_RANK is set".to_string());
    }
    // PMIx alone: Slurm or PRRTE, which Open MPI 5 uses.
    if variable("PMIX_RANK").is_some() {
        return choice(OPEN_MPI, "PMIX_RANK is set".to_string());
    }
    Err(MpiError::NotLaunched)
}

/// Names under which a process may have loaded MPI.
pub(super) fn loaded_names() -> impl Iterator<Item = &'static str> {
    OPEN_MPI.iter().chain(MPICH).copied()
}

/// Number of processors of this machine. The standard library reports fewer where the launcher has
/// bound each rank to its own.
pub(super) fn processors_here() -> usize {
    let online = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
    count_ranges(online.trim())
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

/// How many numbers are in a list like `0-3,8`.
fn count_ranges(list: &str) -> Option<usize> {
    list.split(',').try_fold(0, |count, range| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
        Some(count + last.checked_sub(first)? + 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(set: &[(&str, &str)]) -> Result<Choice, MpiError> {
        choose(|name| set.iter().find(|(n, _)| *n == name).map(|(_, value)| value.to_string()))
    }

    #[test]
    fn a_library_name_that_is_not_utf_8_is_used() {
        use std::os::unix::ffi::OsStringExt as _;
        let library = text(OsString::from_vec(b"/opt/m\xffi.so".to_vec()));
        let choice = with(&[(CHOICE_VARIABLE, &library)]).unwrap();
        assert_eq!(choice.libraries, ["/opt/m\u{fffd}i.so"]);
    }

    #[test]
    fn each_launcher_gets_its_own_library_and_the_user_the_last_word() {
        assert_eq!(with(&[("OMPI_COMM_WORLD_RANK", "0")]).unwrap().libraries[0], "libmpi.so.40");
        assert_eq!(with(&[("PMI_RANK", "1")]).unwrap().libraries[0], "libmpich.so.12");
        let both =
            with(&[("OMPI_COMM_WORLD_RANK", "0"), ("COMPOSITE_MPI", "/opt/x/libmpi.so")]).unwrap();
        assert_eq!(both.libraries, ["/opt/x/libmpi.so"]);
        assert_eq!(with(&[("COMPOSITE_MPI", "mpich")]).unwrap().libraries[0], "libmpich.so.12");
    }

    #[test]
    fn processors_are_counted_from_ranges() {
        assert_eq!(["0", "0-1", "0-3,8", ""].map(count_ranges), [Some(1), Some(2), Some(5), None]);
        assert!(processors_here() >= 1);
    }

    #[test]
    fn without_a_launcher_the_error_says_how_to_start() {
        let text = with(&[]).unwrap_err().to_string();
        assert!(text.contains("mpirun") && text.contains(CHOICE_VARIABLE), "{text}");
    }
}
