//! Counted exceptions: the number of faults that existed when a rule was introduced may fall but
//! not rise.

use std::collections::BTreeMap;

/// Compares faults, each with the place to which it is counted, with the number that `allowed` has
/// for that place. A number that is too high is also a fault; otherwise new faults could go
/// unnoticed.
pub(crate) fn exceptions(
    list: &str,
    allowed: &[(&str, usize)],
    found: &[(String, String)],
) -> Vec<String> {
    let mut places: BTreeMap<&str, Vec<&str>> =
        allowed.iter().map(|(place, _)| (*place, Vec::new())).collect();
    for (place, fault) in found {
        places.entry(place).or_default().push(fault);
    }
    let number = |place: &str| allowed.iter().find(|(p, _)| *p == place).map_or(0, |(_, n)| *n);
    let mut faults = Vec::new();
    for (place, here) in places {
        let (is, may) = (here.len(), number(place));
        if is > may {
            faults
                .push(format!("{place}: {is}, and {list} allows {may}:\n  {}", here.join("\n  ")));
        } else if is < may && is == 0 {
            faults.push(format!("{place}: none is left; take it out of {list}"));
        } else if is < may {
            faults.push(format!("{place}: fewer; write (\"{place}\", {is}) in {list}"));
        }
    }
    faults
}

#[test]
fn planted_counts_are_compared() {
    let found = |n: usize| vec![("a.rs".to_owned(), "a.rs:1".to_owned()); n];
    let faults = |allowed: &[(&str, usize)], n| exceptions("LIST", allowed, &found(n));
    assert_eq!(faults(&[("a.rs", 2)], 2), Vec::<String>::new());
    assert!(faults(&[], 1)[0].contains("a.rs:1"), "a new one is named");
    assert!(faults(&[("a.rs", 2)], 3)[0].contains("LIST allows 2"));
    assert!(faults(&[("a.rs", 2)], 1)[0].contains("(\"a.rs\", 1)"), "the list shrinks");
    assert!(faults(&[("a.rs", 2)], 0)[0].contains("take it out"));
}
