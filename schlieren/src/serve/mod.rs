//! `schlieren serve`: the laboratory as a page in a browser.
//!
//! ```text
//!   browser ── HTTP on loopback, token in every address ── [routes] ── [session] ── [worker]: one thread that draws
//! ```
//! One thread answers requests and never computes; another draws with all cores, and stops when the
//! scene changes. All pages that are open show the same scene. Files cannot be opened or written
//! from the page: it changes how the flow is looked at, and downloads what it sees.

mod filter_plane;
mod flow;
mod frame;
mod merge_patch;
mod routes;
mod session;
mod worker;

pub use flow::ArrayInfo;
pub use frame::{Frame, FrameInfo};
pub use session::{
    Canvas, MAX_POINTS, MAX_SAMPLES, MAX_SIDE, MAX_STROKES, Paint, PaintOutcome, RefusedChange,
    Session,
};

use crate::input::Step;
use crate::render::RenderError;
use crate::scene::Scene;
use crate::solids::Solids;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The flow or the bodies cannot be read, or make no test section.
    #[error(transparent)]
    Render(Box<RenderError>),
    /// The page does not draw such scenes.
    #[error(transparent)]
    Refused(#[from] RefusedChange),
    /// Nothing can listen there.
    #[error("cannot listen on {address}; give another address or port (port 0 takes a free one)")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// The system gives no randomness, thread or event loop.
    #[error("the server cannot start: {0}")]
    Start(String),
}

impl From<RenderError> for ServeError {
    fn from(e: RenderError) -> Self {
        ServeError::Render(Box::new(e))
    }
}

/// How often the end of the program is looked for.
const TICK: Duration = Duration::from_millis(50);
/// How long connections may take to finish at the end.
const FAREWELL: Duration = Duration::from_secs(1);

/// Serves the scene until `cancel` is set. With several `steps` the page has a choice of time, and
/// the first is shown first; with fewer the scene's own file is. `ready` gets the address of the
/// page once it can be opened, and notes on the way.
pub fn serve(
    mut scene: Scene,
    steps: Vec<Step>,
    address: SocketAddr,
    cancel: &AtomicBool,
    ready: impl FnOnce(&str),
) -> Result<(), ServeError> {
    let start = |e: &dyn std::fmt::Display| ServeError::Start(e.to_string());
    let token = token().map_err(|e| start(&e))?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| start(&e))?;
    let listen = |source| ServeError::Listen { address, source };
    // Before the flow is read: a port that is taken should be known at once.
    let listener = runtime.block_on(tokio::net::TcpListener::bind(address)).map_err(listen)?;
    let url = format!("http://{}/{token}/", listener.local_addr().map_err(listen)?);

    let steps = if steps.len() > 1 { steps } else { Vec::new() };
    if let Some(first) = steps.first() {
        scene.flow.file.clone_from(&first.path);
    }
    let flow = flow::Flow::open(&scene.flow.file).map_err(RenderError::from)?;
    let mut solids = None;
    if !scene.solids.files.is_empty() {
        solids = Some(Solids::open(&scene.solids.files).map_err(RenderError::from)?.0);
    }
    let session = Arc::new(Session::new(scene, flow.arrays(), steps)?);
    let worker = worker::Worker::new(session.clone(), flow, solids);
    let thread = std::thread::Builder::new()
        .name("draws".into())
        .spawn(move || worker.run())
        .map_err(|e| start(&e))?;

    ready(&url);
    let app = routes::router(session.clone(), &token);
    runtime.block_on(async {
        let ending = Arc::new(tokio::sync::Notify::new());
        let told = ending.clone();
        let server =
            axum::serve(listener, app).with_graceful_shutdown(async move { told.notified().await });
        let server = tokio::spawn(async move { server.await });
        while !cancel.load(Ordering::Relaxed) && !server.is_finished() {
            tokio::time::sleep(TICK).await;
        }
        session.stop();
        ending.notify_one();
        // Who is still waiting for a frame or reads slowly is left behind.
        let _ = tokio::time::timeout(FAREWELL, server).await;
    });
    drop(runtime);
    // A panic there was reported where it happened.
    let _ = thread.join();
    Ok(())
}

/// 128 random bits as text.
fn token() -> Result<String, getrandom::Error> {
    let mut bits = [0u8; 16];
    getrandom::fill(&mut bits)?;
    Ok(bits.iter().map(|b| format!("{b:02x}")).collect())
}
