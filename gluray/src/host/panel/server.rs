//! Starts and stops both listeners.

use super::endpoint::{PanelEndpoint, PanelEndpointError, Secret};
use super::hub::Hub;
use super::{connections, routes};
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Why there is no panel.
#[derive(Debug, thiserror::Error)]
pub enum PanelError {
    /// Off loopback.
    #[error(
        "{0} can be reached from other machines; the panel listens on loopback only: give \
         127.0.0.1 or [::1]"
    )]
    NotLoopback(IpAddr),
    /// Nothing can listen there.
    #[error("cannot listen on {address}; give another port (0 takes a free one)")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// Programs cannot find us.
    #[error(transparent)]
    PanelEndpoint(#[from] PanelEndpointError),
    /// The system gives no randomness or event loop.
    #[error("the panel cannot start: {0}")]
    Start(String),
}

/// An open panel.
#[derive(Debug, Clone)]
pub struct PanelAddresses {
    /// Address of the page, with its token.
    pub url: String,
    /// Where programs find us.
    pub endpoint: PanelEndpoint,
}

/// How often the end of the program is looked for.
const TICK: Duration = Duration::from_millis(50);
/// How long connections may take to finish at the end.
const FAREWELL: Duration = Duration::from_secs(1);

/// Serves page and links until `cancel` is set. `folder` is where programs look for the panel.
/// `ready` gets the addresses once both are open.
pub fn serve(
    address: SocketAddr,
    folder: Option<PathBuf>,
    cancel: &AtomicBool,
    ready: impl FnOnce(&PanelAddresses),
) -> Result<(), PanelError> {
    if !address.ip().is_loopback() {
        return Err(PanelError::NotLoopback(address.ip()));
    }
    let start = |e: &dyn std::fmt::Display| PanelError::Start(e.to_string());
    let (mut secret, mut token) = ([0; 32], [0; 16]);
    getrandom::fill(&mut secret)
        .and_then(|()| getrandom::fill(&mut token))
        .map_err(|e| start(&e))?;
    let (secret, token) =
        (Secret::of(secret), token.iter().map(|b| format!("{b:02x}")).collect::<String>());
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| start(&e))?;
    let bind = |address: SocketAddr| {
        let listen = move |source| PanelError::Listen { address, source };
        let listener = runtime.block_on(tokio::net::TcpListener::bind(address)).map_err(listen)?;
        let at = listener.local_addr().map_err(listen)?;
        Ok::<_, PanelError>((listener, at))
    };
    let (page, page_address) = bind(address)?;
    let (link, link_address) = bind(SocketAddr::new(address.ip(), 0))?;
    let endpoint = PanelEndpoint { address: link_address, secret: secret.clone() };
    let folder = folder
        .or_else(|| crate::host::folders::runtime(crate::host::folders::variable))
        .ok_or(PanelEndpointError::NoFolder)?;
    let _published = endpoint.publish(&folder)?;
    ready(&PanelAddresses { url: format!("http://{page_address}/{token}/"), endpoint });

    let hub = Arc::new(Hub::default());
    let app = routes::router(hub.clone(), &token, page_address);
    runtime.block_on(async {
        let links = tokio::spawn(connections::accept(link, hub, secret));
        let ending = Arc::new(tokio::sync::Notify::new());
        let told = ending.clone();
        let server =
            axum::serve(page, app).with_graceful_shutdown(async move { told.notified().await });
        let server = tokio::spawn(async move { server.await });
        while !cancel.load(Ordering::Relaxed) && !server.is_finished() {
            tokio::time::sleep(TICK).await;
        }
        links.abort();
        ending.notify_one();
        // Pages that wait for news are left behind.
        let _ = tokio::time::timeout(FAREWELL, server).await;
    });
    Ok(())
}
