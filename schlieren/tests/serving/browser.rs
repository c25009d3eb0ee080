//! Drives a headless Chromium by its DevTools protocol: JSON over a WebSocket, with only the parts
//! that the tests need.
#![allow(dead_code, reason = "each test binary uses its part")]

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The Chromium to test with: the one in RTSV_CHROMIUM, or one of the usual names in PATH. `Err`
/// has the reason why there is none.
pub(crate) fn chromium() -> Result<PathBuf, String> {
    if let Some(path) = std::env::var_os("RTSV_CHROMIUM") {
        return Ok(path.into());
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = std::env::split_paths(&folders)
        .flat_map(|f| names.map(|n| f.join(n)))
        .find(|p| p.is_file());
    found.ok_or_else(|| {
        format!(
            "none of {} is in PATH and RTSV_CHROMIUM is not set; on Debian: apt-get install \
             chromium",
            names.join(", ")
        )
    })
}

pub(crate) struct Browser {
    child: Child,
    socket: TcpStream,
    last_id: u64,
    /// Errors and exceptions of the page.
    pub(crate) page_errors: Vec<String>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Opens a page in a new Chromium.
    pub(crate) fn open(program: &PathBuf, url: &str) -> Browser {
        let profile = tempfile::tempdir().unwrap();
        let mut child = Command::new(program)
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--no-first-run",
            ])
            .args([
                "--remote-debugging-port=0",
                "--window-size=1280,1100",
                "--force-device-scale-factor=1",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("chromium starts");

        // Chromium prints the address that it listens on.
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let host = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|l| Some(l.split_once("ws://")?.1.split_once('/')?.0.to_string()))
            .expect("chromium says where it listens");
        // Drains the pipe, so that Chromium does not block on it.
        std::thread::spawn(move || lines.for_each(drop));
        let page = page_of(&host);
        let mut browser = Browser {
            child,
            socket: upgrade(&host, &page),
            last_id: 0,
            page_errors: Vec::new(),
            _profile: profile,
        };
        for domain in ["Page", "Runtime", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser.call("Page.navigate", json!({ "url": url }));
        browser
    }

    /// Calls a method of the protocol and waits for its result.
    pub(crate) fn call(&mut self, method: &str, params: Value) -> Value {
        self.last_id += 1;
        let id = self.last_id;
        self.send(&json!({"id": id, "method": method, "params": params}).to_string());
        loop {
            let message: Value = serde_json::from_str(&self.receive()).expect("JSON");
            match message["method"].as_str() {
                Some("Runtime.exceptionThrown") => {
                    self.page_errors.push(message["params"].to_string())
                }
                Some("Log.entryAdded") if message["params"]["entry"]["level"] == "error" => {
                    self.page_errors.push(message["params"]["entry"].to_string());
                }
                _ => {}
            }
            if message["id"] == id {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].clone();
            }
        }
    }

    /// Evaluates JavaScript and awaits promises.
    pub(crate) fn evaluate(&mut self, expression: &str) -> Value {
        let params = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let result = self.call("Runtime.evaluate", params);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub(crate) fn wait_for(&mut self, expression: &str) {
        let end = Instant::now() + Duration::from_secs(120);
        while self.evaluate(expression) != true {
            let state = "document.body?.innerText.slice(0, 600)";
            assert!(
                Instant::now() < end,
                "never true: {expression}\n{}\n{:?}",
                self.evaluate(state),
                self.page_errors
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Presses the mouse button at the first point, moves through the others, and releases it.
    pub(crate) fn drag(&mut self, points: &[[f64; 2]]) {
        let mut event = |kind: &str, at: [f64; 2], buttons: u32| {
            let params = json!({"type": kind, "x": at[0], "y": at[1], "button": "left", "buttons": buttons, "clickCount": 1});
            self.call("Input.dispatchMouseEvent", params);
        };
        event("mousePressed", points[0], 1);
        points[1..].iter().for_each(|p| event("mouseMoved", *p, 1));
        event("mouseReleased", points[points.len() - 1], 0);
    }

    /// Moves the mouse without a button.
    pub(crate) fn hover(&mut self, at: [f64; 2]) {
        let params = json!({"type": "mouseMoved", "x": at[0], "y": at[1]});
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Turns the mouse's wheel; upwards is negative.
    pub(crate) fn wheel(&mut self, at: [f64; 2], down_px: f64) {
        let params =
            json!({"type": "mouseWheel", "x": at[0], "y": at[1], "deltaX": 0, "deltaY": down_px});
        self.call("Input.dispatchMouseEvent", params);
    }

    /// A screenshot of the window as PNG.
    pub(crate) fn screenshot(&mut self) -> Vec<u8> {
        let result = self.call("Page.captureScreenshot", json!({"format": "png"}));
        base64::decode(result["data"].as_str().expect("an image")).expect("base64")
    }

    // ---- WebSocket (RFC 6455) -------------------------------------------------------------------
    fn send(&mut self, text: &str) {
        let mut frame = vec![0x81];
        match text.len() {
            n @ 0..126 => frame.push(0x80 | n as u8),
            n @ 126..65536 => {
                frame.push(0x80 | 126);
                frame.extend((n as u16).to_be_bytes());
            }
            n => {
                frame.push(0x80 | 127);
                frame.extend((n as u64).to_be_bytes());
            }
        }
        // Clients must mask their frames; a mask of zeros leaves the text unchanged.
        frame.extend([0; 4]);
        frame.extend(text.as_bytes());
        self.socket.write_all(&frame).expect("chromium listens");
    }

    /// Receives a whole message, without control frames such as pings.
    fn receive(&mut self) -> String {
        let mut message = Vec::new();
        loop {
            let mut head = [0; 2];
            self.socket.read_exact(&mut head).expect("chromium answers");
            let mut length = u64::from(head[1] & 0x7f);
            if length >= 126 {
                let mut more = [0; 8];
                let bytes = if length == 126 { 2 } else { 8 };
                self.socket.read_exact(&mut more[8 - bytes..]).unwrap();
                length = u64::from_be_bytes(more);
            }
            let mut part = vec![0; length as usize];
            self.socket.read_exact(&mut part).unwrap();
            if head[0] & 0x0f <= 2 {
                message.extend(part);
                if head[0] & 0x80 != 0 {
                    return String::from_utf8(message).expect("UTF-8");
                }
            }
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn http(host: &str, request: &str) -> TcpStream {
    let mut stream = TcpStream::connect(host).expect("chromium listens");
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    stream
}

/// Path of the first page's WebSocket.
fn page_of(host: &str) -> String {
    for _ in 0..100 {
        let stream = http(
            host,
            &format!("GET /json/list HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"),
        );
        let mut reader = BufReader::new(stream);
        let mut length = 0;
        for line in reader.by_ref().lines().map_while(Result::ok).take_while(|l| !l.is_empty()) {
            if let Some(n) = line.to_ascii_lowercase().strip_prefix("content-length:") {
                length = n.trim().parse().unwrap();
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body).unwrap();
        let targets: Value = serde_json::from_slice(&body).unwrap();
        let page = targets.as_array().unwrap().iter().find(|t| t["type"] == "page");
        if let Some(url) = page.and_then(|p| p["webSocketDebuggerUrl"].as_str()) {
            return format!("/{}", url.splitn(4, '/').nth(3).unwrap());
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("chromium has no page");
}

fn upgrade(host: &str, path: &str) -> TcpStream {
    let mut stream = http(
        host,
        &format!(
            "GET {path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: \
             Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: \
             AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
        ),
    );
    // Reads byte by byte, because frames follow the head.
    let (mut head, mut byte) = (Vec::new(), [0]);
    while !head.ends_with(b"\r\n\r\n") {
        stream.read_exact(&mut byte).unwrap();
        head.push(byte[0]);
    }
    assert!(head.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&head));
    stream
}
