//! cargo's selection of packages, for all steps that use the same build. With other selections
//! packages have other features, and everything would be built again.

/// The member whose unit tests are a step of their own.
pub(crate) const WITHOUT_UNIT_TESTS: &str = "rt-core";
/// All other members.
pub(crate) const OTHERS: [&str; 3] = ["--workspace", "--exclude", WITHOUT_UNIT_TESTS];
