//! Serves a scene as an interactive page in a browser (`schlieren serve`).
//!
//! ```text
//!   browser ── HTTP on loopback, token in every address ── [routes] ── [session] ── [worker]: the thread that renders
//! ```
//! One thread answers requests and never computes. Another renders with all cores, and stops when
//! the scene changes. All open pages show the same scene. The page cannot open or write files: it
//! changes how the flow is viewed, and downloads images.

mod deflection_map;
mod filter_plane;
mod flow;
mod frame;
mod legend;
mod merge_patch;
mod routes;
mod session;
mod srgb_byte;
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

/// Errors of starting the server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The flow or the bodies cannot be read, or do not form a valid test section.
    #[error(transparent)]
    Render(Box<RenderError>),
    /// The page does not accept the scene.
    #[error(transparent)]
    Refused(#[from] RefusedChange),
    /// The server cannot listen on the address.
    #[error(
        "cannot listen on {address}; give another address or port (port 0 selects a free \
             port)"
    )]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The cause.
        source: std::io::Error,
    },
    /// The system provides no random bits, thread or event loop.
    #[error("the server cannot start: {0}")]
    Start(String),
}

impl From<RenderError> for ServeError {
    fn from(e: RenderError) -> Self {
        ServeError::Render(Box::new(e))
    }
}

/// Interval at which `cancel` is polled.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Time that connections get to finish at shutdown.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(1);

/// Serves the scene until `cancel` is set. With several `steps` the page offers a choice of time
/// and shows the first step first; otherwise it shows the scene's own file. With `fit` the frame
/// takes the flow's shape, and the scene's size only gives its longer side. `ready` is called with
/// the address of the page once it can be opened.
///
/// # Errors
/// If the flow or bodies cannot be read, the page does not accept the scene, or the server cannot
/// listen on the address or start.
pub fn serve(
    mut scene: Scene,
    steps: Vec<Step>,
    fit: bool,
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
    // Binds before the flow is read, so that a port in use is reported at once.
    let listener = runtime.block_on(tokio::net::TcpListener::bind(address)).map_err(listen)?;
    let url = format!("http://{}/{token}/", listener.local_addr().map_err(listen)?);

    let steps = if steps.len() > 1 { steps } else { Vec::new() };
    if let Some(first) = steps.first() {
        scene.flow.file.clone_from(&first.path);
    }
    let flow = flow::Flow::open(&scene.flow.file, &scene.flow.open_options())
        .map_err(RenderError::from)?;
    let mut solids = None;
    if !scene.solids.files.is_empty() {
        solids = Some(Solids::open(&scene.solids.files).map_err(RenderError::from)?.0);
    }
    let session = Arc::new(Session::new(scene, flow.arrays(), steps)?.fitted(fit));
    let worker = worker::Worker::new(session.clone(), flow, solids);
    let thread = std::thread::Builder::new()
        .name("render".into())
        .spawn(move || worker.run())
        .map_err(|e| start(&e))?;

    ready(&url);
    let app = routes::router(session.clone(), &token);
    runtime.block_on(async {
        let ending = Arc::new(tokio::sync::Notify::new());
        let shutdown = ending.clone();
        let server = axum::serve(listener, app)
            .with_graceful_shutdown(async move { shutdown.notified().await });
        let server = tokio::spawn(async move { server.await });
        while !cancel.load(Ordering::Relaxed) && !server.is_finished() {
            tokio::time::sleep(POLL_INTERVAL).await;
        }
        session.stop();
        ending.notify_one();
        // Clients that still wait for a frame or read slowly are disconnected.
        let _ = tokio::time::timeout(SHUTDOWN_TIMEOUT, server).await;
    });
    drop(runtime);
    // A panic of the thread was already reported.
    let _ = thread.join();
    Ok(())
}

/// 128 random bits as hexadecimal text.
fn token() -> Result<String, getrandom::Error> {
    let mut bits = [0u8; 16];
    getrandom::fill(&mut bits)?;
    Ok(bits.iter().map(|b| format!("{b:02x}")).collect())
}
