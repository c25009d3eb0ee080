//! The protocol between the library and the panel: one JSON object per line, over TCP on loopback.
//!
//! | from | message | |
//! |---|---|---|
//! | library | `hello` | version, secret's first half, program, process, settings without the panel's |
//! | panel | `welcome` | version, secret's second half: only then does the library listen |
//! | library | `frame` | [`FrameStats`], at most [`FRAMES_PER_SEC`] a second |
//! | library | `objects` | the objects of the scene, when they change |
//! | library | `inforce` | the settings it has now, and what it refused |
//! | library | `exported` | the file that a scene was written to |
//! | panel | `change` | all of the panel's assignments so far; they replace the ones before |
//! | panel | `export` | asks for the scene as a file |
//!
//! A line that is too long, is not such an object or arrives too early ends the connection and
//! changes nothing else.

use crate::host::config::Settings;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::collections::BTreeMap;

/// Changes when a message changes its meaning; ends with other versions do not talk.
pub const VERSION: u32 = 1;
/// Longest line to the library.
pub const MAX_CHANGE_BYTES: usize = 1 << 20;
/// Longest line to the panel.
pub const MAX_REPORT_BYTES: usize = 4 << 20;
/// Most `frame` messages in a second.
pub const FRAMES_PER_SEC: u32 = 10;
/// Most objects in a list; the largest by triangles are kept.
pub const MAX_OBJECTS: usize = 2000;
/// Longest name of an object or program in a message.
pub const MAX_NAME: usize = 200;

/// The library's first words.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// The program's name.
    pub program: String,
    /// Its process.
    pub process: u32,
    /// Settings from defaults, files and environment.
    pub settings: Settings,
    /// What was wrong with those.
    #[serde(default)]
    pub problems: Vec<String>,
    /// Paths of settings that this library obeys; empty for all. The page disables the others.
    #[serde(default)]
    pub obeys: Vec<String>,
}

/// One frame's work, or the mean of several since the last message.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameStats {
    /// Number of the frame, from 1.
    pub frame: u64,
    /// Milliseconds from the end of the frame before to the end of this one.
    pub frame_ms: f64,
    /// Milliseconds by phase: capture, build, trace, present, wait…
    #[serde(default)]
    pub phases_ms: BTreeMap<String, f64>,
    /// Rays by kind: primary, shadow, ambient occlusion, reflection…
    #[serde(default)]
    pub rays: BTreeMap<String, u64>,
    /// Draw calls traced.
    pub traced: u64,
    /// Draw calls left to the driver.
    pub passed: u64,
    /// Those by reason.
    #[serde(default)]
    pub reasons: BTreeMap<String, u64>,
    /// Triangles in the traced scene.
    #[serde(default)]
    pub triangles: u64,
    /// Width and height of the picture, pixels.
    #[serde(default)]
    pub size: [u32; 2],
}

/// An object of the scene: geometry that is recognised from frame to frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectInfo {
    /// What settings and reports call it.
    pub key: String,
    /// For people: how it is drawn, in a few words.
    #[serde(default)]
    pub name: String,
    /// Its triangles.
    pub triangles: u64,
    /// Its mean colour, as OpenGL has it.
    #[serde(default)]
    pub color: Option<[f32; 3]>,
}

/// A message of the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum ToPanel {
    /// First of all.
    Hello {
        /// [`VERSION`].
        version: u32,
        /// First half of the secret.
        token: String,
        /// Who speaks.
        hello: Box<Hello>,
    },
    /// A frame.
    Frame {
        /// Its numbers.
        stats: Box<FrameStats>,
    },
    /// The objects there are.
    Objects {
        /// Largest first.
        objects: Vec<ObjectInfo>,
        /// How many there are in all.
        total: u64,
    },
    /// Settings now.
    InForce {
        /// All of them.
        settings: Box<Settings>,
        /// What the library did not take.
        refused: Vec<String>,
    },
    /// A scene was written, or why not.
    Exported {
        /// The file.
        file: Option<String>,
        /// Why there is none.
        error: Option<String>,
    },
}

/// A message of the panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub enum ToProgram {
    /// The answer to `hello`.
    Welcome {
        /// [`VERSION`].
        version: u32,
        /// Second half of the secret.
        answer: String,
    },
    /// Everything that was changed on the panel so far, by path.
    Change {
        /// `effects.shadows` and its value.
        assignments: BTreeMap<String, Value>,
    },
    /// Asks for the scene.
    Export {},
}

/// A message as a line.
pub fn line(message: &impl Serialize) -> Option<Vec<u8>> {
    // Messages hold numbers, text and lists: only a number that is not finite could fail, and
    // becomes `null`.
    let mut bytes = serde_json::to_vec(message).ok()?;
    bytes.push(b'\n');
    Some(bytes)
}

/// Why a connection ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ProtocolError {
    /// A line longer than allowed.
    #[error("a line is too long")]
    TooLong,
    /// A line that is no message.
    #[error("a line is no message")]
    Nonsense,
}

/// Lines out of bytes as they come.
#[derive(Debug, Default)]
pub struct Lines {
    bytes: Vec<u8>,
    /// Bytes that were looked at and hold no end of line.
    searched: usize,
}

impl Lines {
    /// Takes bytes in.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next message, if a whole line is there.
    pub fn next<T: DeserializeOwned>(
        &mut self,
        longest: usize,
    ) -> Option<Result<T, ProtocolError>> {
        let end = self.bytes[self.searched..]
            .iter()
            .position(|b| *b == b'\n')
            .map(|at| self.searched + at);
        let Some(end) = end else {
            self.searched = self.bytes.len();
            return (self.bytes.len() > longest).then_some(Err(ProtocolError::TooLong));
        };
        let line: Vec<u8> = self.bytes.drain(..=end).collect();
        self.searched = 0;
        if end > longest {
            return Some(Err(ProtocolError::TooLong));
        }
        Some(serde_json::from_slice(&line[..end]).map_err(|_| ProtocolError::Nonsense))
    }
}

/// The longest start of a text that has no more than [`MAX_NAME`] bytes.
pub fn clipped(text: &str) -> String {
    let mut end = text.len().min(MAX_NAME);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text[..end].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(lines: &mut Lines, longest: usize) -> Vec<Result<ToProgram, ProtocolError>> {
        let mut out = Vec::new();
        while let Some(m) = lines.next(longest) {
            let broken = m.is_err();
            out.push(m);
            if broken {
                break;
            }
        }
        out
    }

    #[test]
    fn messages_survive_any_cutting_of_the_stream() {
        let messages = [
            ToProgram::Welcome { version: VERSION, answer: "ab".into() },
            ToProgram::Change { assignments: [("mode".to_owned(), Value::from("rich"))].into() },
            ToProgram::Export {},
        ];
        let bytes: Vec<u8> = messages.iter().flat_map(|m| line(m).unwrap()).collect();
        for step in 1..bytes.len() {
            let mut lines = Lines::default();
            let mut found = Vec::new();
            for part in bytes.chunks(step) {
                lines.push(part);
                found.extend(all(&mut lines, 1000));
            }
            assert_eq!(
                found,
                messages.iter().cloned().map(Ok).collect::<Vec<_>>(),
                "in steps of {step}"
            );
        }
    }

    #[test]
    fn too_long_lines_are_noticed_before_their_end_comes() {
        let mut lines = Lines::default();
        lines.push(&[b' '; 101]);
        assert_eq!(all(&mut lines, 100), [Err(ProtocolError::TooLong)]);
        let mut lines = Lines::default();
        lines.push(&[b' '; 200]);
        lines.push(b"\n");
        assert_eq!(all(&mut lines, 100), [Err(ProtocolError::TooLong)]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_messages_or_nonsense_and_never_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let mut lines = Lines::default();
            lines.push(&bytes);
            all(&mut lines, 100);
            let mut lines = Lines::default();
            lines.push(&bytes);
            while let Some(Ok(_)) = lines.next::<ToPanel>(100) {}
        }

        #[test]
        fn clipping_keeps_text_text(text in "\\PC{0,300}") {
            let c = clipped(&text);
            prop_assert!(c.len() <= MAX_NAME && text.starts_with(&c));
        }
    }
}
