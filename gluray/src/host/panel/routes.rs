//! The addresses of the panel's page. All of them lie below the token. A client without the token
//! learns nothing, not even which addresses exist.
//!
//! | address | |
//! |---|---|
//! | `GET /` and `GET /NAME` | the page and its parts |
//! | `GET /fields` | the table of settings |
//! | `GET /state?after=N` | the programs; waits while the number of the news is N |
//! | `GET /history?id=` | the frames remembered of a program |
//! | `GET /toml?id=` | what was changed, as a section of the settings' file |
//! | `POST /change` | `{"id":1,"set":{"mode":"rich"},"reset":["samples"]}` |
//! | `POST /export` | `{"id":1}` |
//!
//! The `Host` must be this server. A foreign host name that resolves to 127.0.0.1 is refused. If a
//! browser sends an `Origin`, it must be this server, too.

use super::endpoint::same;
use super::hub::{Hub, HubError};
use crate::host::config::FIELDS;
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

/// Largest body of a request.
const MAX_BODY_BYTES: usize = 1 << 20;
/// How long a request waits for news.
const PATIENCE: Duration = Duration::from_secs(15);
/// The page is told so often at most, however many programs there are.
const CALM: Duration = Duration::from_millis(80);

const JAVASCRIPT: &str = "text/javascript; charset=utf-8";
const INDEX: &str = include_str!("page/index.html");
/// The page's parts, embedded in the program.
const PARTS: [(&str, &str, &str); 6] = [
    ("page.css", "text/css; charset=utf-8", include_str!("page/page.css")),
    ("main.js", JAVASCRIPT, include_str!("page/main.js")),
    ("server.js", JAVASCRIPT, include_str!("page/server.js")),
    ("controls.js", JAVASCRIPT, include_str!("page/controls.js")),
    ("charts.js", JAVASCRIPT, include_str!("page/charts.js")),
    ("objects.js", JAVASCRIPT, include_str!("page/objects.js")),
];

#[derive(Clone)]
struct AppState {
    hub: Arc<Hub>,
    token: Arc<str>,
    hosts: Arc<[String]>,
}

/// Everything below `/{token}/`.
pub(super) fn router(hub: Arc<Hub>, token: &str, address: SocketAddr) -> Router {
    let hosts = [address.to_string(), format!("localhost:{}", address.port())];
    let app = AppState { hub, token: token.into(), hosts: hosts.into() };
    Router::new()
        .route("/{token}/", get(index))
        .route("/{token}/fields", get(fields))
        .route("/{token}/state", get(state))
        .route("/{token}/history", get(history))
        .route("/{token}/toml", get(settings_file))
        .route("/{token}/change", post(change))
        .route("/{token}/export", post(export))
        .route("/{token}/{part}", get(part))
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .fallback(|| async { StatusCode::NOT_FOUND })
        .layer(middleware::from_fn_with_state(app.clone(), guarded))
        .with_state(app)
}

/// What is wrong with a request before it is looked at.
fn reject_reason(app: &AppState, request: &Request) -> Option<&'static str> {
    let text = |name: header::HeaderName| request.headers().get(name).map(HeaderValue::to_str);
    let ours = |host: &str| app.hosts.iter().any(|h| h.eq_ignore_ascii_case(host));
    if !matches!(text(header::HOST), Some(Ok(host)) if ours(host)) {
        return Some("This server answers to its own address only.\n");
    }
    match text(header::ORIGIN) {
        None => {}
        Some(Ok(origin)) if origin.strip_prefix("http://").is_some_and(ours) => {}
        Some(_) => return Some("Other sites' pages may not talk to this server.\n"),
    }
    let given = request.uri().path().split('/').nth(1).unwrap_or_default();
    if !same(given, &app.token) {
        return Some("This address lacks the token: open the one that `gluray panel` printed.\n");
    }
    None
}

async fn guarded(State(app): State<AppState>, request: Request, next: Next) -> Response {
    let mut response = match reject_reason(&app, &request) {
        Some(why) => (StatusCode::FORBIDDEN, why).into_response(),
        None => next.run(request).await,
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (
            "content-security-policy",
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
             connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        ),
        ("referrer-policy", "no-referrer"),
        ("x-content-type-options", "nosniff"),
        ("cross-origin-resource-policy", "same-origin"),
        ("cache-control", "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn error(status: StatusCode, text: &str) -> Response {
    (status, axum::Json(json!({ "error": text }))).into_response()
}

impl IntoResponse for HubError {
    fn into_response(self) -> Response {
        let status = match self {
            HubError::Gone(_) => StatusCode::NOT_FOUND,
            HubError::Busy => StatusCode::SERVICE_UNAVAILABLE,
            HubError::TooMany | HubError::Setting(_) => StatusCode::UNPROCESSABLE_ENTITY,
        };
        error(status, &self.to_string())
    }
}

/// JSON of a body, whatever content type it claims.
fn parsed<T: DeserializeOwned>(body: &Bytes) -> Result<T, Box<Response>> {
    serde_json::from_slice(body).map_err(|e| {
        Box::new(error(StatusCode::BAD_REQUEST, &format!("the request makes no sense: {e}")))
    })
}

async fn index() -> Response {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], INDEX).into_response()
}

async fn part(Path((_, name)): Path<(String, String)>) -> Response {
    match PARTS.iter().find(|p| p.0 == name) {
        Some((_, kind, text)) => ([(header::CONTENT_TYPE, *kind)], *text).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn fields() -> Response {
    axum::Json(FIELDS).into_response()
}

#[derive(Deserialize)]
struct AfterQuery {
    #[serde(default)]
    after: u64,
}

async fn state(
    State(app): State<AppState>,
    Query(AfterQuery { after }): Query<AfterQuery>,
) -> Response {
    let mut changes = app.hub.changes.subscribe();
    if after > 0 {
        tokio::time::sleep(CALM).await;
        let other = tokio::time::timeout(PATIENCE, changes.wait_for(|n| *n != after)).await;
        if !matches!(other, Ok(Ok(_))) {
            return StatusCode::NO_CONTENT.into_response();
        }
    }
    // The number first: what changes meanwhile is news.
    let number = *app.hub.changes.borrow();
    axum::Json(json!({ "news": number, "programs": app.hub.programs() })).into_response()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProgramQuery {
    id: u64,
}

async fn history(
    State(app): State<AppState>,
    Query(ProgramQuery { id }): Query<ProgramQuery>,
) -> Response {
    match app.hub.history(id) {
        Some(frames) => axum::Json(frames).into_response(),
        None => HubError::Gone(id).into_response(),
    }
}

async fn settings_file(
    State(app): State<AppState>,
    Query(ProgramQuery { id }): Query<ProgramQuery>,
) -> Response {
    match app.hub.toml(id) {
        Ok(text) => {
            let mut headers = HeaderMap::new();
            headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/toml"));
            headers.insert(
                header::CONTENT_DISPOSITION,
                HeaderValue::from_static("attachment; filename=\"gluray.toml\""),
            );
            (headers, text).into_response()
        }
        Err(refused) => refused.into_response(),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChangeRequest {
    id: u64,
    #[serde(default)]
    set: BTreeMap<String, Value>,
    #[serde(default)]
    reset: Vec<String>,
}

async fn change(State(app): State<AppState>, body: Bytes) -> Response {
    let change: ChangeRequest = match parsed(&body) {
        Ok(change) => change,
        Err(response) => return *response,
    };
    match app.hub.change(change.id, change.set, &change.reset) {
        Ok(()) => axum::Json(json!({})).into_response(),
        Err(refused) => refused.into_response(),
    }
}

async fn export(State(app): State<AppState>, body: Bytes) -> Response {
    let ProgramQuery { id } = match parsed(&body) {
        Ok(which) => which,
        Err(response) => return *response,
    };
    match app.hub.export(id) {
        Ok(()) => axum::Json(json!({})).into_response(),
        Err(refused) => refused.into_response(),
    }
}
