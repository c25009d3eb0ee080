//! HTTP routes of the page. All are below the token: `/TOKEN/`, `/TOKEN/frame`…. A client without
//! the token learns nothing, not even which routes exist.
//!
//! | route | |
//! |---|---|
//! | `GET /` and `GET /NAME` | the page and its files |
//! | `GET /state` | scene, arrays, limits (JSON) |
//! | `GET /frame?after=N` | the newest frame when its number is not N; waits, 204 on timeout |
//! | `POST /scene` | a change, as [`Session::edit`] takes it |
//! | `POST /back` | returns to the last scene that was shown |
//! | `POST /paint` | [`Paint`] |
//! | `POST /trace` | where the light of a point of the image crosses the filter |
//! | `POST /profile` | deflections along a line on the image; phases, or movements of dots |
//! | `GET /save/png`, `/save/exr`, `/save/toml`, `/save/sheet` | downloads |

use super::session::{Paint, RefusedChange, SaveKind, Session};
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Largest size of a request's body.
const MAX_BODY_BYTES: usize = 2 * 1024 * 1024;
/// How long a request waits for a frame.
const FRAME_TIMEOUT: Duration = Duration::from_secs(15);

/// The page's files, embedded in the program.
const ASSETS: [(&str, &str, &str); 15] = [
    ("page.css", "text/css; charset=utf-8", include_str!("page/page.css")),
    ("main.js", JAVASCRIPT, include_str!("page/main.js")),
    ("server.js", JAVASCRIPT, include_str!("page/server.js")),
    ("units.js", JAVASCRIPT, include_str!("page/units.js")),
    ("image.js", JAVASCRIPT, include_str!("page/image.js")),
    ("filter.js", JAVASCRIPT, include_str!("page/filter.js")),
    ("rows.js", JAVASCRIPT, include_str!("page/rows.js")),
    ("settings.js", JAVASCRIPT, include_str!("page/settings.js")),
    ("curves.js", JAVASCRIPT, include_str!("page/curves.js")),
    ("flow.js", JAVASCRIPT, include_str!("page/flow.js")),
    ("axes.js", JAVASCRIPT, include_str!("page/axes.js")),
    ("legend.js", JAVASCRIPT, include_str!("page/legend.js")),
    ("profile.js", JAVASCRIPT, include_str!("page/profile.js")),
    ("help.js", JAVASCRIPT, include_str!("page/help.js")),
    ("save.js", JAVASCRIPT, include_str!("page/save.js")),
];
const JAVASCRIPT: &str = "text/javascript; charset=utf-8";
const INDEX: &str = include_str!("page/index.html");

#[derive(Clone)]
struct App {
    session: Arc<Session>,
    token: Arc<str>,
}

/// The router of everything below `/{token}/`.
pub(super) fn router(session: Arc<Session>, token: &str) -> Router {
    let app = App { session, token: token.into() };
    Router::new()
        .route("/{token}/", get(index))
        .route("/{token}/state", get(state))
        .route("/{token}/frame", get(frame))
        .route("/{token}/scene", post(edit))
        .route("/{token}/paint", post(paint))
        .route("/{token}/trace", post(trace))
        .route("/{token}/profile", post(profile))
        .route("/{token}/back", post(back))
        .route("/{token}/save/{kind}", get(save))
        .route("/{token}/{part}", get(part))
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .fallback(|| async { StatusCode::NOT_FOUND })
        .layer(middleware::from_fn_with_state(app.clone(), guarded))
        .with_state(app)
}

/// Passes requests with the token, and sets headers that allow the page to contact only this
/// server.
async fn guarded(State(app): State<App>, request: Request, next: Next) -> Response {
    let given = request.uri().path().split('/').nth(1).unwrap_or_default();
    let mut response = if constant_time_eq(given, &app.token) {
        next.run(request).await
    } else {
        let text = "This address lacks the token: open the address that `schlieren serve` \
                    printed.\n";
        (StatusCode::FORBIDDEN, text).into_response()
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
        ("cache-control", "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Comparison in constant time, which does not reveal how many characters were right.
fn constant_time_eq(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |d, (x, y)| d | (x ^ y)) == 0
}

impl IntoResponse for RefusedChange {
    fn into_response(self) -> Response {
        error(StatusCode::UNPROCESSABLE_ENTITY, &self.0)
    }
}

fn error(status: StatusCode, text: &str) -> Response {
    (status, axum::Json(serde_json::json!({ "error": text }))).into_response()
}

/// Parses a body as JSON, whatever its content type.
fn json<T: DeserializeOwned>(body: &Bytes) -> Result<T, Box<Response>> {
    serde_json::from_slice(body)
        .map_err(|e| Box::new(error(StatusCode::BAD_REQUEST, &format!("invalid request: {e}"))))
}

async fn index() -> Response {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], INDEX).into_response()
}

async fn part(Path((_, name)): Path<(String, String)>) -> Response {
    match ASSETS.iter().find(|p| p.0 == name) {
        Some((_, kind, text)) => ([(header::CONTENT_TYPE, *kind)], *text).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn state(State(app): State<App>) -> Response {
    axum::Json(app.session.state()).into_response()
}

#[derive(Deserialize)]
struct FrameQuery {
    #[serde(default)]
    after: u64,
}

async fn frame(State(app): State<App>, Query(FrameQuery { after }): Query<FrameQuery>) -> Response {
    let mut frames = app.session.frames.subscribe();
    let other = frames.wait_for(|serial| *serial != after && *serial > 0);
    match tokio::time::timeout(FRAME_TIMEOUT, other).await {
        Ok(Ok(_)) => {}
        // There is no new frame, or the program ends.
        _ => return StatusCode::NO_CONTENT.into_response(),
    }
    match app.session.frame() {
        // Clones some 100 kB to megabytes; sharing the bytes would need another body type.
        Some(frame) => ([(header::CONTENT_TYPE, "application/octet-stream")], frame.bytes.clone())
            .into_response(),
        None => StatusCode::NO_CONTENT.into_response(),
    }
}

async fn edit(State(app): State<App>, body: Bytes) -> Response {
    let patch: serde_json::Value = match json(&body) {
        Ok(patch) => patch,
        Err(response) => return *response,
    };
    match app.session.edit(&patch) {
        Ok(_) => axum::Json(app.session.state()).into_response(),
        Err(refused) => refused.into_response(),
    }
}

async fn paint(State(app): State<App>, body: Bytes) -> Response {
    let paint: Paint = match json(&body) {
        Ok(paint) => paint,
        Err(response) => return *response,
    };
    match app.session.paint(&paint) {
        Ok(painted) => axum::Json(painted).into_response(),
        Err(refused) => refused.into_response(),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TraceQuery {
    at: [f64; 2],
}

async fn trace(State(app): State<App>, body: Bytes) -> Response {
    let query: TraceQuery = match json(&body) {
        Ok(query) => query,
        Err(response) => return *response,
    };
    match app.session.trace(query.at) {
        Ok(Some((deflection, point))) => {
            axum::Json(serde_json::json!({ "deflection_rad": deflection, "filter_m": point }))
                .into_response()
        }
        Ok(None) => axum::Json(serde_json::json!({ "dark": true })).into_response(),
        Err(refused) => refused.into_response(),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProfileQuery {
    from: [f64; 2],
    to: [f64; 2],
}

async fn profile(State(app): State<App>, body: Bytes) -> Response {
    let query: ProfileQuery = match json(&body) {
        Ok(query) => query,
        Err(response) => return *response,
    };
    match app.session.profile(query.from, query.to) {
        Ok(profile) => axum::Json(profile).into_response(),
        Err(refused) => refused.into_response(),
    }
}

async fn back(State(app): State<App>) -> Response {
    match app.session.back() {
        Ok(_) => axum::Json(app.session.state()).into_response(),
        Err(refused) => refused.into_response(),
    }
}

/// Stops the rendering of a file when the request for it has ended.
struct StopsWhenDropped(Arc<AtomicBool>);

impl Drop for StopsWhenDropped {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

async fn save(State(app): State<App>, Path((_, kind)): Path<(String, String)>) -> Response {
    let (bytes, content, name) = match kind.as_str() {
        "toml" => match app.session.toml() {
            Ok(text) => (text.into_bytes(), "application/toml", "schlieren.toml"),
            Err(refused) => return refused.into_response(),
        },
        "png" | "exr" | "sheet" => {
            let (kind, content, name) = match kind.as_str() {
                "png" => (SaveKind::Png, "image/png", "schlieren.png"),
                "exr" => (SaveKind::Exr, "image/x-exr", "schlieren.exr"),
                _ => (SaveKind::Sheet, "image/png", "schlieren-sheet.png"),
            };
            if kind == SaveKind::Sheet
                && let Some(refused) = app.session.sheet_refusal()
            {
                return refused.into_response();
            }
            let cancel = Arc::new(AtomicBool::new(false));
            let _guard = StopsWhenDropped(cancel.clone());
            let receiver = match app.session.save(kind, cancel) {
                Ok(receiver) => receiver,
                Err(RefusedChange(text)) => return error(StatusCode::SERVICE_UNAVAILABLE, &text),
            };
            match receiver.await {
                Ok(Ok(bytes)) => (bytes, content, name),
                Ok(Err(text)) => return error(StatusCode::INTERNAL_SERVER_ERROR, &text),
                Err(_) => return error(StatusCode::SERVICE_UNAVAILABLE, "the program is ending"),
            }
        }
        _ => return StatusCode::NOT_FOUND.into_response(),
    };
    let mut headers = HeaderMap::new();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(content));
    if let Ok(value) = HeaderValue::from_str(&format!("attachment; filename=\"{name}\"")) {
        headers.insert(header::CONTENT_DISPOSITION, value);
    }
    (headers, bytes).into_response()
}
