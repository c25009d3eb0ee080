//! `bench peers`.

use crate::baselines::embree::{Embree, Version};
use datasets::cli::CommonArgs;
use serde::Serialize;

#[derive(Serialize)]
struct Peer {
    name: &'static str,
    found: bool,
    /// Version of the loaded library.
    version: Option<String>,
    path: Option<String>,
    /// Why the library was not found, and the cure.
    reason: Option<String>,
}

pub(super) fn peers(common: CommonArgs) -> anyhow::Result<()> {
    let mut peers: Vec<Peer> = [("Embree 3", Version::V3), ("Embree 4", Version::V4)]
        .into_iter()
        .map(|(name, version)| match Embree::load(version) {
            Ok(e) => {
                let (version, path) = (Some(e.version().into()), Some(e.path().into()));
                Peer { name, found: true, version, path, reason: None }
            }
            Err(e) => {
                Peer { name, found: false, version: None, path: None, reason: Some(e.to_string()) }
            }
        })
        .collect();
    let (version, path) = (Some("0.4".into()), Some("built in".into()));
    peers.push(Peer { name: "obvhs", found: true, version, path, reason: None });
    common.result(&peers, || {
        let mut text = String::new();
        for p in &peers {
            let part = |t: &Option<String>| t.clone().unwrap_or_default();
            text += &match &p.reason {
                None => format!("{:9} {}  {}\n", p.name, part(&p.version), part(&p.path)),
                Some(reason) => format!("{:9} missing: {reason}\n", p.name),
            };
        }
        text + "`bench run peers` measures against them."
    })
}
