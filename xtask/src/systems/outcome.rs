//! What a test program printed.

/// Tests by how they ended.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Tested {
    passed: Vec<String>,
    failed: Vec<String>,
    /// Reasons of tests that skipped themselves, and the names of those that were ignored.
    pub(super) skipped: Vec<String>,
    /// The summary was printed.
    ended: bool,
}

impl Tested {
    /// Reads the output of libtest, stdout and stderr together.
    pub(super) fn read(text: &str) -> Tested {
        let mut tested = Tested::default();
        for line in text.lines() {
            if let Some((name, how)) =
                line.strip_prefix("test ").and_then(|rest| rest.split_once(" ... "))
            {
                let name = name.to_owned();
                match how.split(',').next().unwrap_or_default() {
                    "ok" => tested.passed.push(name),
                    "ignored" => tested.skipped.push(name),
                    _ => tested.failed.push(name),
                }
            } else if let Some((_, reason)) = line.split_once("skipped: ") {
                tested.skipped.push(reason.to_owned());
            }
            tested.ended |= line.starts_with("test result: ");
        }
        tested
    }

    /// `7 of 9`: passed, of those that ran.
    pub(super) fn share(&self) -> String {
        format!("{} of {}", self.passed.len(), self.passed.len() + self.failed.len())
    }

    /// What is wrong: tests that failed and are not `known`, known ones that pass, and no tests.
    pub(super) fn faults(&self, program: &str, known: &[(&str, &str)]) -> Vec<String> {
        let is_known = |name: &String| known.iter().any(|(k, _)| k == name);
        let mut faults: Vec<String> =
            self.failed.iter().filter(|t| !is_known(t)).map(|t| format!("{t} failed")).collect();
        let mended = self.passed.iter().filter(|t| is_known(t));
        faults.extend(mended.map(|t| format!("{t} passes now: take it off the list of suites.rs")));
        if !self.ended {
            faults.push(format!("{program} did not end"));
        } else if self.passed.is_empty() {
            faults.push(format!("no test of {program} passed"));
        }
        faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: &str = "running 4 tests\ntest vtk::a ... ok\ntest vtk::b ... FAILED\nskipped: no \
                           pvbatch\ntest vtk::c ... ok\ntest vtk::d ... ignored, slow\n\ntest \
                           result: FAILED. 2 passed; 1 failed\n";

    #[test]
    fn what_libtest_prints_is_read() {
        let tested = Tested::read(PRINTED);
        assert_eq!(tested.passed, ["vtk::a", "vtk::c"]);
        assert_eq!(tested.failed, ["vtk::b"]);
        assert_eq!(tested.share(), "2 of 3");
        assert_eq!(tested.skipped, ["no pvbatch", "vtk::d"]);
    }

    #[test]
    fn unknown_failures_mended_ones_and_nothing_at_all_are_faults() {
        let tested = Tested::read(PRINTED);
        assert_eq!(tested.faults("p", &[]), ["vtk::b failed"]);
        assert_eq!(tested.faults("p", &[("vtk::b", "known")]), Vec::<String>::new());
        let mended = tested.faults("p", &[("vtk::b", ""), ("vtk::a", "")]);
        assert!(mended.len() == 1 && mended[0].contains("vtk::a passes now"), "{mended:?}");
        let crashed = Tested::read("running 4 tests\n");
        assert_eq!(crashed.faults("p", &[]), ["p did not end"]);
        let nothing = Tested::read("running 0 tests\n\ntest result: ok. 0 passed; 0 failed\n");
        assert_eq!(nothing.faults("p", &[]), ["no test of p passed"]);
    }
}
