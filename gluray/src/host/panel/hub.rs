//! The panel's state: the programs with their settings, telemetry and objects.

use super::protocol::{FrameStats, Hello, ObjectInfo, ToPanel, ToProgram};
use crate::host::config::{Assignment, SettingError, Settings, assign};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::{mpsc, watch};

/// The number of frames kept per program: a minute at ten per second.
pub const HISTORY: usize = 600;
/// Frames in the state: what came while the page was drawing.
const RECENT: usize = 20;
/// The number of ended programs that stay on the list.
const ENDED: usize = 8;
/// The largest number of the panel's assignments for one program.
const MAX_ASSIGNMENTS: usize = 20_000;

/// A program, as the page sees it.
#[derive(Debug, Clone, Serialize)]
pub struct Program {
    /// Its number on this panel.
    pub id: u64,
    /// Its name.
    pub program: String,
    /// Its process id.
    pub process: u32,
    /// False once it is gone.
    pub running: bool,
    /// Its current settings.
    pub settings: Settings,
    /// Its settings before any change in the panel.
    pub base: Settings,
    /// The changes made in the panel.
    pub assignments: BTreeMap<String, Value>,
    /// Errors in its files and environment, and refused settings.
    pub problems: Vec<String>,
    /// Paths of settings it obeys; empty for all.
    pub obeys: Vec<String>,
    /// Its objects, largest first.
    pub objects: Vec<ObjectInfo>,
    /// The total number of its objects.
    pub objects_total: u64,
    /// The file that its scene was written to last, or why there is none.
    pub exported: Option<Result<String, String>>,
    /// The last few frames.
    pub recent: Vec<FrameStats>,
}

struct ProgramEntry {
    shown: Program,
    hello_problems: Vec<String>,
    history: VecDeque<FrameStats>,
    outgoing: mpsc::Sender<ToProgram>,
}

#[derive(Default)]
struct Inner {
    programs: BTreeMap<u64, ProgramEntry>,
    last_id: u64,
}

/// The reason why an operation is impossible.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HubError {
    /// No such program.
    #[error("program {0} is not running any more; choose another one")]
    Gone(u64),
    /// It does not read its messages.
    #[error("the program takes no messages; it may hang or compute, try again")]
    Busy,
    /// Too many changes.
    #[error("more than {MAX_ASSIGNMENTS} changes; save them in a file and start the program again")]
    TooMany,
    /// Invalid settings.
    #[error("{0}")]
    Setting(String),
}

/// All programs, shared between the link and the page.
pub struct Hub {
    inner: Mutex<Inner>,
    /// Counts changes. Clients that wait for an update wait on this channel.
    pub changes: watch::Sender<u64>,
}

impl Default for Hub {
    fn default() -> Self {
        Hub { inner: Mutex::default(), changes: watch::Sender::new(1) }
    }
}

impl Hub {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        // Nothing in here is half changed when a thread panics.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn notify(&self) {
        self.changes.send_modify(|n| *n += 1);
    }

    /// Adds a program. The receiver gets the messages to it.
    pub fn register(&self, hello: Hello) -> (u64, mpsc::Receiver<ToProgram>) {
        let (outgoing, receiver) = mpsc::channel(32);
        let mut inner = self.lock();
        inner.last_id += 1;
        let id = inner.last_id;
        let shown = Program {
            id,
            program: super::protocol::clipped(&hello.program),
            process: hello.process,
            running: true,
            settings: hello.settings.clone(),
            base: hello.settings,
            assignments: BTreeMap::new(),
            problems: hello.problems.clone(),
            obeys: hello.obeys,
            objects: Vec::new(),
            objects_total: 0,
            exported: None,
            recent: Vec::new(),
        };
        inner.programs.insert(
            id,
            ProgramEntry {
                shown,
                hello_problems: hello.problems,
                history: VecDeque::new(),
                outgoing,
            },
        );
        drop(inner);
        self.notify();
        (id, receiver)
    }

    /// Handles a message from a program.
    pub fn handle_message(&self, id: u64, message: ToPanel) {
        let mut inner = self.lock();
        let Some(e) = inner.programs.get_mut(&id) else { return };
        match message {
            ToPanel::Hello { .. } => return,
            ToPanel::Frame { stats } => {
                if e.history.len() == HISTORY {
                    e.history.pop_front();
                }
                e.history.push_back(*stats);
            }
            ToPanel::Objects { objects, total } => {
                (e.shown.objects, e.shown.objects_total) = (objects, total)
            }
            ToPanel::InForce { settings, refused } => {
                e.shown.settings = *settings;
                e.shown.problems = [e.hello_problems.clone(), refused].concat();
            }
            ToPanel::Exported { file, error } => {
                e.shown.exported =
                    Some(file.ok_or_else(|| error.unwrap_or_else(|| "no reason given".into())));
            }
        }
        drop(inner);
        self.notify();
    }

    /// Marks a program as ended. The last few ended programs stay on the list.
    pub fn unregister(&self, id: u64) {
        let mut inner = self.lock();
        if let Some(e) = inner.programs.get_mut(&id) {
            e.shown.running = false;
        }
        let mut ended: Vec<u64> =
            inner.programs.iter().filter(|(_, e)| !e.shown.running).map(|(id, _)| *id).collect();
        ended.truncate(ended.len().saturating_sub(ENDED));
        ended.iter().for_each(|id| drop(inner.programs.remove(id)));
        drop(inner);
        self.notify();
    }

    /// The number of running programs.
    pub fn running(&self) -> usize {
        self.lock().programs.values().filter(|e| e.shown.running).count()
    }

    /// Every program on the list.
    pub fn programs(&self) -> Vec<Program> {
        let inner = self.lock();
        let recent = |e: &ProgramEntry| {
            e.history.iter().skip(e.history.len().saturating_sub(RECENT)).cloned().collect()
        };
        inner.programs.values().map(|e| Program { recent: recent(e), ..e.shown.clone() }).collect()
    }

    /// The frames kept of a program.
    pub fn history(&self, id: u64) -> Option<Vec<FrameStats>> {
        self.lock().programs.get(&id).map(|e| e.history.iter().cloned().collect())
    }

    /// Sets some settings and reverts changes of others. Either all of it succeeds or nothing
    /// changes.
    pub fn change(
        &self,
        id: u64,
        set: BTreeMap<String, Value>,
        reset: &[String],
    ) -> Result<(), HubError> {
        let mut inner = self.lock();
        let e =
            inner.programs.get_mut(&id).filter(|e| e.shown.running).ok_or(HubError::Gone(id))?;
        let mut assignments = e.shown.assignments.clone();
        assignments.retain(|path, _| {
            !reset.iter().any(|r| {
                r == path || path.strip_prefix(r.as_str()).is_some_and(|rest| rest.starts_with('.'))
            })
        });
        assignments.extend(set);
        if assignments.len() > MAX_ASSIGNMENTS {
            return Err(HubError::TooMany);
        }
        let list: Vec<Assignment> =
            assignments.iter().map(|(p, v)| Assignment::new("panel", p, v.clone())).collect();
        let (_, errors) = assign(&e.shown.base, &list);
        if !errors.is_empty() {
            return Err(HubError::Setting(
                errors.iter().take(3).map(SettingError::to_string).collect::<Vec<_>>().join("; "),
            ));
        }
        let message = ToProgram::Change { assignments: assignments.clone() };
        e.outgoing.try_send(message).map_err(|_| HubError::Busy)?;
        e.shown.assignments = assignments;
        drop(inner);
        self.notify();
        Ok(())
    }

    /// Asks a program to export its scene.
    pub fn export(&self, id: u64) -> Result<(), HubError> {
        let mut inner = self.lock();
        let e =
            inner.programs.get_mut(&id).filter(|e| e.shown.running).ok_or(HubError::Gone(id))?;
        e.outgoing.try_send(ToProgram::Export {}).map_err(|_| HubError::Busy)?;
        e.shown.exported = None;
        Ok(())
    }

    /// The changes made in the panel, as a section of the settings file.
    pub fn toml(&self, id: u64) -> Result<String, HubError> {
        let inner = self.lock();
        let e = inner.programs.get(&id).ok_or(HubError::Gone(id))?;
        let mut section = toml::Table::new();
        for (path, value) in &e.shown.assignments {
            let mut at = &mut section;
            let (folders, name) = path.rsplit_once('.').unwrap_or(("", path));
            for folder in folders.split('.').filter(|f| !f.is_empty()) {
                let next =
                    at.entry(folder).or_insert_with(|| toml::Value::Table(toml::Table::new()));
                match next {
                    toml::Value::Table(next) => at = next,
                    _ => return Err(HubError::Setting(format!("`{path}` has no place in a file"))),
                }
            }
            // `null` stands for "as the program has it", which a file says by silence.
            if let Ok(value) = toml::Value::try_from(value) {
                at.insert(name.to_owned(), value);
            }
        }
        let program =
            toml::Table::from_iter([(e.shown.program.clone(), toml::Value::Table(section))]);
        let file = toml::Table::from_iter([("program".to_owned(), toml::Value::Table(program))]);
        toml::to_string(&file).map_err(|e| HubError::Setting(e.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn set(list: &[(&str, Value)]) -> BTreeMap<String, Value> {
        list.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect()
    }

    #[test]
    fn changes_add_up_are_taken_back_and_become_a_file_that_means_the_same() {
        let hub = Hub::default();
        let (id, mut messages) =
            hub.register(Hello { program: "my prog".into(), ..Hello::default() });
        hub.change(
            id,
            set(&[("mode", json!("rich")), ("objects.a1.color", json!([1, 0.5, 0]))]),
            &[],
        )
        .unwrap();
        hub.change(
            id,
            set(&[("samples", json!(4)), ("material.mirror", json!(0.5))]),
            &["mode".into()],
        )
        .unwrap();
        let mut last = None;
        while let Ok(m) = messages.try_recv() {
            last = Some(m);
        }
        let expected = set(&[
            ("objects.a1.color", json!([1, 0.5, 0])),
            ("samples", json!(4)),
            ("material.mirror", json!(0.5)),
        ]);
        assert_eq!(last, Some(ToProgram::Change { assignments: expected.clone() }));

        let text = hub.toml(id).unwrap();
        let file =
            crate::host::config::ConfigFile::parse(std::path::Path::new("x"), &text).unwrap();
        let from_file = assign(&Settings::default(), &file.assignments(&["my prog".into()]));
        let list: Vec<Assignment> =
            expected.iter().map(|(p, v)| Assignment::new("panel", p, v.clone())).collect();
        assert_eq!(from_file, assign(&Settings::default(), &list), "{text}");

        hub.change(id, BTreeMap::new(), &["objects.a1".into()]).unwrap();
        assert_eq!(hub.programs()[0].assignments.len(), 2);
    }

    #[test]
    fn nonsense_changes_nothing_and_who_is_gone_cannot_be_changed() {
        let hub = Hub::default();
        let (id, mut messages) = hub.register(Hello::default());
        let e =
            hub.change(id, set(&[("samples", json!(4)), ("mode", json!("x"))]), &[]).unwrap_err();
        assert!(e.to_string().contains("`mode` is \"x\""), "{e}");
        assert!(messages.try_recv().is_err() && hub.programs()[0].assignments.is_empty());
        assert_eq!(hub.change(99, BTreeMap::new(), &[]), Err(HubError::Gone(99)));
        hub.unregister(id);
        assert_eq!(hub.export(id), Err(HubError::Gone(id)));
        assert_eq!((hub.running(), hub.programs().len()), (0, 1));
        for _ in 0..2 * ENDED {
            let (id, _r) = hub.register(Hello::default());
            hub.unregister(id);
        }
        assert_eq!(hub.programs().len(), ENDED);
    }

    #[test]
    fn a_program_that_reads_nothing_and_one_that_says_much_cost_a_fixed_amount() {
        let hub = Hub::default();
        let (id, _messages) = hub.register(Hello::default());
        let results: Vec<_> =
            (1..100).map(|i| hub.change(id, set(&[("samples", json!(i))]), &[])).collect();
        assert!(results.contains(&Err(HubError::Busy)));
        for frame in 0..2000 {
            hub.handle_message(
                id,
                ToPanel::Frame { stats: Box::new(FrameStats { frame, ..FrameStats::default() }) },
            );
        }
        let history = hub.history(id).unwrap();
        assert_eq!((history.len(), history[HISTORY - 1].frame), (HISTORY, 1999));
    }
}
