//! The parts that face the user: settings, reports, timelines, the control panel and exported
//! scenes.

pub mod config;
pub mod export;
pub mod folders;
pub mod panel;
pub(crate) mod panel_client;
pub mod report;
pub mod timeline;
