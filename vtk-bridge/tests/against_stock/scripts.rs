//! Compares all images of a script rendered with and without the bridge.

use crate::compare::{Limits, faults};
use crate::session::Run;

/// An image (script, name) with its own limits, or without limits, and the reason.
pub(crate) type Exception = (&'static str, &'static str, Option<Limits>, &'static str);

/// Differences in our images of `script`, one line each. The images in `untraced` contain nothing
/// to trace.
pub(crate) fn differences(
    stock: &Run,
    ours: &Run,
    script: &str,
    exceptions: &[&[Exception]],
    untraced: &[(&str, &str)],
) -> Vec<String> {
    let names = stock.images(script).unwrap_or_else(|e| panic!("stock: {e}"));
    let same = ours.images(script).unwrap_or_else(|e| panic!("with the bridge: {e}"));
    assert_eq!(names, same, "{script}: other images than stock's");
    let mut found = Vec::new();
    // ParaView's writer briefly creates a file with this in its name.
    for name in names.iter().filter(|n| !n.contains(".tmp")) {
        let place = (script, name.as_str());
        let path = ours.path(script, name);
        let [a, b] = [stock, ours].map(|r| r.capture(script, name).unwrap());
        if b.traced_elements() == 0 && !untraced.contains(&place) {
            found.push(format!("{}: nothing was ray traced: {:?}", path.display(), b.report));
        }
        let exception = exceptions.iter().copied().flatten().find(|(s, p, ..)| (*s, *p) == place);
        let Some(limits) = exception.map_or(Some(Limits::STRICT), |(_, _, limits, _)| *limits)
        else {
            continue;
        };
        found.extend(faults(&a, &b, &limits).iter().map(|f| format!("{}: {f}", path.display())));
    }
    found
}
