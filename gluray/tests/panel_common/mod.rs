//! A running `gluray panel`, HTTP over a plain socket, and a program that uses the library's end of
//! the link.
#![allow(dead_code, reason = "each test binary uses its part")]

use gluray::config::Settings;
use gluray::export::{Object, Scene, write_scene};
use gluray::panel::link::PanelCommand;
use gluray::panel::{FrameStats, Hello, Link, ObjectInfo, PanelEndpoint, endpoint};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_gluray");

/// The panel, ended when dropped.
pub(crate) struct Panel {
    pub(crate) child: Child,
    /// `127.0.0.1:PORT` of the page.
    pub(crate) address: String,
    /// `/TOKEN/`.
    pub(crate) base: String,
    pub(crate) runtime: tempfile::TempDir,
}

/// An HTTP response.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) head: String,
    pub(crate) body: String,
}

impl Answer {
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|e| panic!("{e}: {self:?}"))
    }
}

impl Panel {
    pub(crate) fn start() -> Panel {
        let runtime = tempfile::tempdir().unwrap();
        let mut child = Command::new(PROGRAM)
            .args(["panel", "--json"])
            .env("XDG_RUNTIME_DIR", runtime.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let answer: Value = serde_json::from_str(&line).expect("the address as JSON");
        let url = answer["url"].as_str().unwrap().strip_prefix("http://").unwrap().to_owned();
        let (address, token) = url.split_once('/').unwrap();
        Panel { child, address: address.into(), base: format!("/{token}"), runtime }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}{}", self.address, self.base)
    }

    pub(crate) fn meeting_file(&self) -> PathBuf {
        endpoint::file_in(&self.runtime.path().join("gluray"))
    }

    pub(crate) fn endpoint(&self) -> PanelEndpoint {
        PanelEndpoint::read(&self.meeting_file()).expect("the panel has published where it is")
    }

    /// Sends raw bytes to the page's port and reads the response, if any.
    pub(crate) fn raw(&self, bytes: &[u8]) -> Option<Answer> {
        let mut stream = TcpStream::connect(&self.address).expect("the panel listens");
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        // The server may reject the request and close before everything is sent.
        let _ = stream.write_all(bytes);
        let mut all = Vec::new();
        let _ = stream.read_to_end(&mut all);
        let text = String::from_utf8_lossy(&all).into_owned();
        let (head, body) = text.split_once("\r\n\r\n")?;
        let status = head.split(' ').nth(1)?.parse().ok()?;
        Some(Answer { status, head: head.into(), body: body.into() })
    }

    /// A request with additional header lines, below the token.
    pub(crate) fn ask_with(&self, method: &str, path: &str, head: &str, body: &str) -> Answer {
        let (base, length) = (&self.base, body.len());
        let request = format!(
            "{method} {base}{path} HTTP/1.1\r\n{head}Connection: close\r\nContent-Length: \
             {length}\r\n\r\n{body}"
        );
        self.raw(request.as_bytes()).unwrap_or_else(|| panic!("{method} {path}: no answer"))
    }

    pub(crate) fn ask(&self, method: &str, path: &str, body: &str) -> Answer {
        self.ask_with(method, path, &format!("Host: {}\r\n", self.address), body)
    }

    pub(crate) fn programs(&self) -> Vec<Value> {
        self.ask("GET", "state", "").json()["programs"].as_array().unwrap().clone()
    }

    /// Waits until the list of programs satisfies a condition.
    pub(crate) fn until(&self, what: &str, done: impl Fn(&[Value]) -> bool) -> Vec<Value> {
        let end = Instant::now() + Duration::from_secs(60);
        loop {
            let programs = self.programs();
            if done(&programs) {
                return programs;
            }
            assert!(Instant::now() < end, "{what}: never; {programs:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Panel {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A program that draws no image but does everything else: its costs follow its settings.
pub(crate) struct Fake {
    settings: Arc<Mutex<Settings>>,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Fake {
    pub(crate) fn start(name: &str, endpoint: PanelEndpoint, scenes: &Path) -> Fake {
        let settings = Arc::new(Mutex::new(Settings::default()));
        let stop = Arc::new(AtomicBool::new(false));
        let (mine, ends, name, scenes) =
            (settings.clone(), stop.clone(), name.to_owned(), scenes.to_path_buf());
        let thread = std::thread::spawn(move || run(&name, endpoint, &scenes, &mine, &ends));
        Fake { settings, stop, thread: Some(thread) }
    }

    pub(crate) fn settings(&self) -> Settings {
        self.settings.lock().unwrap().clone()
    }

    /// Waits until the settings have arrived.
    pub(crate) fn until(&self, done: impl Fn(&Settings) -> bool) {
        let end = Instant::now() + Duration::from_secs(60);
        while !done(&self.settings()) {
            assert!(Instant::now() < end, "never: {:?}", self.settings());
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(t) = self.thread.take() {
            t.join().expect("the program ends in order");
        }
    }
}

fn run(
    name: &str,
    endpoint: PanelEndpoint,
    scenes: &Path,
    settings: &Mutex<Settings>,
    stop: &AtomicBool,
) {
    let hello = Hello { program: name.into(), process: std::process::id(), ..Hello::default() };
    let mut link = Link::connect(endpoint, hello);
    let objects: Vec<ObjectInfo> = (0..30u64)
        .map(|i| ObjectInfo {
            key: format!("{:08x}", 0x3f2a_0000 + i),
            name: format!("glDrawElements, {} calls", i + 1),
            triangles: 1 << (20 - i % 18),
            color: Some([0.3 + 0.02 * i as f32, 0.5, 0.9 - 0.02 * i as f32]),
        })
        .collect();
    let mut frame = 0;
    while !stop.load(Ordering::Relaxed) {
        frame += 1;
        match link.poll() {
            Some(PanelCommand::Settings(s)) => *settings.lock().unwrap() = *s,
            Some(PanelCommand::Export) => {
                let file = scenes.join(format!("{name}-{frame}.gluray"));
                write_scene(&file, &triangle(name, frame)).unwrap();
                link.exported(Ok(&file));
            }
            None => {}
        }
        link.objects(&objects);
        link.frame(&stats(frame, &settings.lock().unwrap()));
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn stats(frame: u64, s: &Settings) -> FrameStats {
    let wave = 1.0 + 0.2 * (frame as f64 / 40.0).sin();
    let occlusion =
        if s.mode == gluray::config::Mode::Rich { s.effects.ambient_occlusion_samples } else { 0 };
    let (primary, occlusion) = (640_000 * u64::from(s.samples), 640_000 * u64::from(occlusion));
    let trace = wave * (6.0 + occlusion as f64 / 4e5);
    let mut rays = std::collections::BTreeMap::from([("primary".to_owned(), primary)]);
    if occlusion > 0 {
        rays.insert("ambient occlusion".into(), (occlusion as f64 * wave) as u64);
    }
    FrameStats {
        frame,
        frame_ms: trace + 9.0,
        phases_ms: [
            ("capture".to_owned(), 2.0 * wave),
            ("present".to_owned(), 4.0),
            ("trace".to_owned(), trace),
        ]
        .into(),
        rays,
        traced: 30,
        passed: 12,
        reasons: [("lines and points".to_owned(), 9), ("no depth test".to_owned(), 3)].into(),
        triangles: 1_398_101,
        size: [1024, 1024],
    }
}

fn triangle(program: &str, frame: u64) -> Scene {
    let object = Object {
        key: "3f2a0000".into(),
        name: "a triangle".into(),
        world_from_object: std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 }),
        color: [1.0, 0.5, 0.0, 1.0],
        positions: vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]],
        indices: vec![[0, 1, 2]],
        ..Object::default()
    };
    Scene {
        program: program.into(),
        frame,
        space: "the viewer's axes".into(),
        objects: vec![object],
    }
}
