//! Applies changes that the page sends as JSON merge patches (RFC 7396).

use serde_json::Value;

/// Merges as in RFC 7396, but replaces objects that select one of several kinds, because keys of
/// the old kind would remain.
pub(super) fn merge(target: &mut Value, patch: Value) {
    let Value::Object(patch) = patch else {
        *target = patch;
        return;
    };
    let chooses = patch.contains_key("kind") || patch.contains_key("method");
    if chooses || !target.is_object() {
        *target = Value::Object(serde_json::Map::new());
    }
    let Value::Object(target) = target else { return };
    for (key, value) in patch {
        if value.is_null() {
            target.remove(&key);
        } else {
            merge(target.entry(key).or_insert(Value::Null), value);
        }
    }
}
