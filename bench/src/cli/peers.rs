//! `bench peers`.

use super::{Common, print};
use crate::peers::embree::{Embree, Version};
use serde_json::json;

pub(super) fn peers(common: Common) -> anyhow::Result<()> {
    let mut rows = vec![];
    for (name, version) in [("Embree 3", Version::V3), ("Embree 4", Version::V4)] {
        rows.push(match Embree::load(version) {
            Ok(e) => json!({ "name": name, "found": true, "version": e.version(), "path": e.path() }),
            Err(e) => json!({ "name": name, "found": false, "reason": e.to_string() }),
        });
    }
    rows.push(json!({ "name": "obvhs", "found": true, "version": "0.4", "path": "built in" }));
    if common.json {
        return print(&serde_json::to_string_pretty(&rows)?);
    }
    for r in &rows {
        let text = |k: &str| r[k].as_str().unwrap_or_default();
        if r["found"] == true {
            print(&format!("{:9} {}  {}", text("name"), text("version"), text("path")))?;
        } else {
            print(&format!("{:9} missing: {}", text("name"), text("reason")))?;
        }
    }
    if !common.json {
        print("`bench run peers` measures against them.")?;
    }
    Ok(())
}
