//! The panel's end of the links. It accepts programs, authenticates them and reads their messages.

use super::endpoint::{Secret, same};
use super::hub::Hub;
use super::protocol::{Hello, Lines, MAX_REPORT_BYTES, ToPanel, ToProgram, VERSION, line};
use std::io::ErrorKind;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;

/// Connections at once; more are closed as they come.
const MOST_CONNECTIONS: usize = 128;
/// How long a connection may take to say who it is.
const INTRODUCTION: Duration = Duration::from_secs(5);
/// Longest line of somebody who has not said the token yet.
const MAX_HELLO_BYTES: usize = 1 << 20;
/// How long a program may take to read what it is sent.
const PATIENCE: Duration = Duration::from_secs(30);

/// Takes connections until the runtime ends.
pub(super) async fn accept(listener: TcpListener, hub: Arc<Hub>, secret: Secret) {
    let open = Arc::new(AtomicUsize::new(0));
    loop {
        let Ok((stream, from)) = listener.accept().await else {
            // Out of file descriptors: some will be closed.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        if !from.ip().is_loopback() || open.load(Ordering::Relaxed) >= MOST_CONNECTIONS {
            continue;
        }
        let (hub, secret, open) = (hub.clone(), secret.clone(), open.clone());
        open.fetch_add(1, Ordering::Relaxed);
        tokio::spawn(async move {
            serve(stream, &hub, &secret).await;
            open.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

async fn serve(stream: TcpStream, hub: &Hub, secret: &Secret) {
    // Small messages that are to be seen at once; without it they come later, and that is all.
    let _ = stream.set_nodelay(true);
    let (from, into) = stream.into_split();
    let mut incoming = MessageReader { from, lines: Lines::default() };
    let introduction = tokio::time::timeout(INTRODUCTION, incoming.hello(secret)).await;
    let Ok(Some(hello)) = introduction else { return };
    let (id, messages) = hub.register(hello);
    let answer = ToProgram::Welcome { version: VERSION, answer: secret.answer().to_owned() };
    let writer = tokio::spawn(write(into, answer, messages));
    while let Some(message) = incoming.message(MAX_REPORT_BYTES).await {
        hub.handle_message(id, message);
    }
    writer.abort();
    hub.unregister(id);
}

struct MessageReader {
    from: OwnedReadHalf,
    lines: Lines,
}

impl MessageReader {
    /// Who it is, if it knows the token and speaks our version.
    async fn hello(&mut self, secret: &Secret) -> Option<Hello> {
        match self.message(MAX_HELLO_BYTES).await? {
            ToPanel::Hello { version: VERSION, token, hello } if same(&token, secret.token()) => {
                Some(*hello)
            }
            _ => None,
        }
    }

    /// The next message; `None` when the connection is over or should be.
    async fn message(&mut self, longest: usize) -> Option<ToPanel> {
        loop {
            if let Some(message) = self.lines.next(longest) {
                return message.ok();
            }
            self.from.readable().await.ok()?;
            let mut buffer = [0; 64 * 1024];
            match self.from.try_read(&mut buffer) {
                Ok(0) => return None,
                Ok(n) => self.lines.push(&buffer[..n]),
                Err(e) if e.kind() == ErrorKind::WouldBlock => {}
                Err(_) => return None,
            }
        }
    }
}

async fn write(into: OwnedWriteHalf, first: ToProgram, mut messages: mpsc::Receiver<ToProgram>) {
    let mut next = Some(first);
    while let Some(message) = next {
        let Some(bytes) = line(&message) else { return };
        let sent = tokio::time::timeout(PATIENCE, write_all(&into, &bytes)).await;
        if !matches!(sent, Ok(Some(()))) {
            return;
        }
        next = messages.recv().await;
    }
}

async fn write_all(into: &OwnedWriteHalf, mut bytes: &[u8]) -> Option<()> {
    while !bytes.is_empty() {
        into.writable().await.ok()?;
        match into.try_write(bytes) {
            Ok(n) => bytes = &bytes[n..],
            Err(e) if e.kind() == ErrorKind::WouldBlock => {}
            Err(_) => return None,
        }
    }
    Some(())
}
