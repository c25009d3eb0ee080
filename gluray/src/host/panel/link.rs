//! The library's end of the link. It runs inside another program, so it never waits, starts no
//! thread and prints nothing.
//!
//! Once per frame the library calls [`Link::poll`] and [`Link::frame`]. This takes some
//! microseconds when there is a panel, and one clock read when there is none. The kernel accepts or
//! refuses a loopback connection at once. When the panel's queue is full, `CONNECT_PATIENCE` is
//! lost, and further attempts become less and less frequent. Data that the panel does not read is
//! dropped, the newest first, so a slow panel costs no memory.
//!
//! A forked child leaves the link to its parent. All settings that arrive pass through
//! [`crate::host::config::assign()`]. Invalid settings are refused by name, and the rest are
//! applied.

use super::endpoint::{PanelEndpoint, same};
use super::protocol::{
    FRAMES_PER_SEC, FrameStats, Hello, Lines, MAX_CHANGE_BYTES, MAX_OBJECTS, ObjectInfo, ToPanel,
    ToProgram, VERSION, clipped, line,
};
use crate::host::config::{Assignment, Settings, assign};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

/// What a frame may lose by connecting, at the very most.
const CONNECT_PATIENCE: Duration = Duration::from_millis(2);
/// Time between attempts to find a panel, at first and at last.
const RETRY: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(4)];
/// Bytes that wait for the panel to read; more is dropped.
const MOST_WAITING: usize = 8 << 20;
/// Time between two `frame` messages.
const FRAME_INTERVAL: Duration = Duration::from_millis(1000 / FRAMES_PER_SEC as u64);

/// What the panel wants.
#[derive(Debug, Clone, PartialEq)]
pub enum PanelCommand {
    /// New settings, complete and checked.
    Settings(Box<Settings>),
    /// The scene as a file; answer with [`Link::exported`].
    Export,
}

struct Connection {
    stream: TcpStream,
    welcome: bool,
    incoming: Lines,
    outgoing: Vec<u8>,
    secret: super::endpoint::Secret,
}

/// The link. Without a panel it does nothing but look for one now and then.
///
/// ```
/// use gluray::panel::{Hello, Link, link::PanelCommand};
///
/// let mut link = Link::new(Hello { program: "mine".into(), process: std::process::id(), ..Hello::default() });
/// // Once a frame:
/// match link.poll() {
///     Some(PanelCommand::Settings(settings)) => assert!(settings.samples >= 1, "what arrives is checked"),
///     Some(PanelCommand::Export) => link.exported(Err("this program has no scene")),
///     None => {}
/// }
/// ```
pub struct Link {
    hello: Hello,
    find: Box<dyn Fn() -> Option<PanelEndpoint> + Send>,
    process: u32,
    connection: Option<Connection>,
    next_attempt: Instant,
    retry: Duration,
    next_frame: Instant,
    /// Frames since the last message, for their mean.
    pending: Option<(u32, FrameStats)>,
    objects: Option<Vec<u8>>,
    in_force: Settings,
}

impl std::fmt::Debug for Link {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Link")
            .field("program", &self.hello.program)
            .field("connected", &self.is_connected())
            .finish_non_exhaustive()
    }
}

impl Link {
    /// A link that finds its panel by the environment or the file, see [`PanelEndpoint::find`].
    /// Nothing is tried before the first [`Link::poll`].
    pub fn new(hello: Hello) -> Link {
        // Read once: the program may change its environment while we look.
        let names = ["GLURAY_PANEL", "GLURAY_PANEL_SECRET", "XDG_RUNTIME_DIR"];
        let set = names.map(|n| (n, crate::host::folders::variable(n)));
        Link::with(hello, move || {
            PanelEndpoint::find(|name| {
                set.iter().find(|(n, _)| *n == name).and_then(|(_, v)| v.clone())
            })
        })
    }

    /// A link to a known panel.
    pub fn connect(endpoint: PanelEndpoint, hello: Hello) -> Link {
        Link::with(hello, move || Some(endpoint.clone()))
    }

    fn with(mut hello: Hello, find: impl Fn() -> Option<PanelEndpoint> + Send + 'static) -> Link {
        let now = Instant::now();
        hello.program = clipped(&hello.program);
        let in_force = hello.settings.clone();
        Link {
            hello,
            find: Box::new(find),
            process: std::process::id(),
            connection: None,
            next_attempt: now,
            retry: RETRY[0],
            next_frame: now,
            pending: None,
            objects: None,
            in_force,
        }
    }

    /// True once the panel has proved that it is ours.
    pub fn is_connected(&self) -> bool {
        self.connection.as_ref().is_some_and(|c| c.welcome)
    }

    /// Reads what the panel sent and writes what waits. Call once a frame. When the panel goes away
    /// its settings go with it.
    pub fn poll(&mut self) -> Option<PanelCommand> {
        let now = Instant::now();
        if self.connection.is_none() {
            if now < self.next_attempt {
                return None;
            }
            self.try_connect(now);
        }
        if self.connection.is_some() && self.process != std::process::id() {
            // A fork's child: the socket is the parent's.
            self.connection = None;
            self.next_attempt = now + Duration::from_secs(1 << 30);
            return None;
        }
        match self.exchange_messages() {
            Ok(wish) => wish,
            Err(Disconnected) => {
                self.connection = None;
                self.next_attempt = now + self.retry;
                let before = std::mem::replace(&mut self.in_force, self.hello.settings.clone());
                (before != self.in_force)
                    .then(|| PanelCommand::Settings(Box::new(self.in_force.clone())))
            }
        }
    }

    /// Tells of a frame; of several within a tenth of a second the mean is sent.
    pub fn frame(&mut self, stats: &FrameStats) {
        if !self.is_connected() {
            return;
        }
        let (count, sum) = self.pending.take().unwrap_or_default();
        self.pending = Some((count + 1, added(sum, stats)));
        let now = Instant::now();
        if now < self.next_frame {
            return;
        }
        self.next_frame = now + FRAME_INTERVAL;
        if let Some((count, sum)) = self.pending.take() {
            self.send(&ToPanel::Frame { stats: Box::new(mean(sum, count)) });
        }
    }

    /// Tells which objects there are. Cheap when they are those of last time.
    pub fn objects(&mut self, objects: &[ObjectInfo]) {
        let mut kept: Vec<ObjectInfo> =
            objects.iter().map(|o| ObjectInfo { name: clipped(&o.name), ..o.clone() }).collect();
        kept.sort_by(|a, b| b.triangles.cmp(&a.triangles).then_with(|| a.key.cmp(&b.key)));
        kept.truncate(MAX_OBJECTS);
        let message = line(&ToPanel::Objects { objects: kept, total: objects.len() as u64 });
        if message != self.objects {
            self.objects = message;
            if let (Some(bytes), true) = (self.objects.clone(), self.is_connected()) {
                self.queue(&bytes);
            }
        }
    }

    /// Answers [`PanelCommand::Export`]: the file, or why there is none.
    pub fn exported(&mut self, outcome: Result<&std::path::Path, &str>) {
        self.send(&match outcome {
            Ok(file) => ToPanel::Exported { file: Some(file.display().to_string()), error: None },
            Err(why) => ToPanel::Exported { file: None, error: Some(clipped(why)) },
        });
    }

    fn send(&mut self, message: &ToPanel) {
        if let Some(bytes) = line(message) {
            self.queue(&bytes);
        }
    }

    fn queue(&mut self, bytes: &[u8]) {
        if let Some(c) = &mut self.connection
            && c.outgoing.len() + bytes.len() <= MOST_WAITING
        {
            c.outgoing.extend_from_slice(bytes);
        }
    }

    fn try_connect(&mut self, now: Instant) {
        self.next_attempt = now + self.retry;
        let Some(endpoint) = (self.find)().filter(|m| m.address.ip().is_loopback()) else { return };
        let Some(stream) = open(endpoint.address) else {
            // A file that a killed panel left: asked less and less often.
            self.retry = (2 * self.retry).min(RETRY[1]);
            return;
        };
        self.retry = RETRY[0];
        let secret = endpoint.secret;
        let token = secret.token().to_owned();
        self.connection = Some(Connection {
            stream,
            welcome: false,
            incoming: Lines::default(),
            outgoing: Vec::new(),
            secret,
        });
        self.send(&ToPanel::Hello { version: VERSION, token, hello: Box::new(self.hello.clone()) });
    }

    fn exchange_messages(&mut self) -> Result<Option<PanelCommand>, Disconnected> {
        let Some(c) = &mut self.connection else { return Ok(None) };
        read(c)?;
        let mut wish = None;
        // One wish a frame; what else came waits in the buffer.
        while wish.is_none() {
            let Some(c) = &mut self.connection else { break };
            let Some(message) = c.incoming.next::<ToProgram>(MAX_CHANGE_BYTES) else { break };
            match message.map_err(|_| Disconnected)? {
                ToProgram::Welcome { version, answer } => {
                    if version != VERSION || !same(&answer, c.secret.answer()) {
                        return Err(Disconnected);
                    }
                    c.welcome = true;
                    if let Some(bytes) = self.objects.clone() {
                        self.queue(&bytes);
                    }
                }
                // Whoever has not proved to be the panel is not listened to.
                _ if !c.welcome => return Err(Disconnected),
                ToProgram::Change { assignments } => wish = self.change(assignments),
                ToProgram::Export {} => wish = Some(PanelCommand::Export),
            }
        }
        if let Some(c) = &mut self.connection {
            write(c)?;
        }
        Ok(wish)
    }

    fn change(&mut self, assignments: BTreeMap<String, serde_json::Value>) -> Option<PanelCommand> {
        let list: Vec<Assignment> = assignments
            .into_iter()
            .map(|(path, value)| Assignment::new("panel", path, value))
            .collect();
        let (settings, errors) = assign(&self.hello.settings, &list);
        let refused = errors.iter().take(20).map(ToString::to_string).collect();
        let changed = settings != self.in_force;
        self.in_force = settings.clone();
        self.send(&ToPanel::InForce { settings: Box::new(settings.clone()), refused });
        changed.then(|| PanelCommand::Settings(Box::new(settings)))
    }
}

/// The connection is over.
struct Disconnected;

fn open(address: SocketAddr) -> Option<TcpStream> {
    let stream = TcpStream::connect_timeout(&address, CONNECT_PATIENCE).ok()?;
    stream.set_nonblocking(true).ok()?;
    // Small messages that are to be seen at once.
    stream.set_nodelay(true).ok()?;
    Some(stream)
}

fn read(c: &mut Connection) -> Result<(), Disconnected> {
    let mut buffer = [0; 16 * 1024];
    // So much at once and no more: a panel gone wild must not hold up a frame.
    for _ in 0..8 {
        match c.stream.read(&mut buffer) {
            Ok(0) => return Err(Disconnected),
            Ok(n) => c.incoming.push(&buffer[..n]),
            Err(e) if e.kind() == ErrorKind::WouldBlock => break,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(_) => return Err(Disconnected),
        }
    }
    Ok(())
}

fn write(c: &mut Connection) -> Result<(), Disconnected> {
    while !c.outgoing.is_empty() {
        match c.stream.write(&c.outgoing) {
            Ok(0) => return Err(Disconnected),
            Ok(n) => drop(c.outgoing.drain(..n)),
            Err(e) if e.kind() == ErrorKind::WouldBlock => break,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(_) => return Err(Disconnected),
        }
    }
    Ok(())
}

/// Milliseconds and counts of several frames added up; what describes the newest is the newest's.
fn added(mut sum: FrameStats, stats: &FrameStats) -> FrameStats {
    for (k, v) in &stats.phases_ms {
        *sum.phases_ms.entry(k.clone()).or_default() += v;
    }
    for (from, into) in [(&stats.rays, &mut sum.rays), (&stats.reasons, &mut sum.reasons)] {
        for (k, v) in from {
            *into.entry(k.clone()).or_default() += v;
        }
    }
    FrameStats {
        frame: stats.frame,
        frame_ms: sum.frame_ms + stats.frame_ms,
        traced: sum.traced + stats.traced,
        passed: sum.passed + stats.passed,
        triangles: stats.triangles,
        size: stats.size,
        ..sum
    }
}

fn mean(mut sum: FrameStats, count: u32) -> FrameStats {
    let n = count.max(1);
    sum.frame_ms /= f64::from(n);
    sum.phases_ms.values_mut().for_each(|v| *v /= f64::from(n));
    let whole = |v: &mut u64| *v = (*v + u64::from(n) / 2) / u64::from(n);
    sum.rays
        .values_mut()
        .chain(sum.reasons.values_mut())
        .chain([&mut sum.traced, &mut sum.passed])
        .for_each(whole);
    sum
}

#[cfg(test)]
mod tests;
