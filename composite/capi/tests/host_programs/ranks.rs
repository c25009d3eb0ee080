//! Ranks that work on display walls, give arrays in unusual forms, contradict each other and fail:
//! `tests/c/ranks.c`.

use crate::launch::{MPIS, text};

#[test]
fn walls_strides_contradictions_and_faults_are_the_same_over_both_mpis() {
    for mpi in &MPIS {
        let Some(program) = mpi.compile_c("tests/c/ranks.c") else { continue };
        for ranks in [2, 5] {
            let Some(output) = mpi.run(ranks, &[&program.display().to_string()]) else { return };
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(
                output.status.success() && said.matches("done").count() == ranks,
                "{} ranks of {}: {}",
                ranks,
                mpi.name,
                text(&output)
            );
        }
    }
}
