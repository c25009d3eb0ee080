use super::*;
use crate::host::config::Mode;
use crate::host::panel::endpoint::Secret;
use proptest::prelude::*;
use std::io::BufRead;
use std::net::TcpListener;

/// A panel made by hand, and a link to it that has said hello.
struct Pair {
    link: Link,
    panel: TcpStream,
    endpoint: PanelEndpoint,
}

fn hello() -> Hello {
    Hello { program: "test".into(), process: std::process::id(), ..Hello::default() }
}

fn pair() -> Pair {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = PanelEndpoint {
        address: listener.local_addr().unwrap(),
        secret: Secret::of(std::array::from_fn(|i| i as u8)),
    };
    let mut link = Link::connect(endpoint.clone(), hello());
    assert_eq!(link.poll(), None);
    let panel = listener.accept().unwrap().0;
    panel.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    Pair { link, panel, endpoint }
}

impl Pair {
    fn say(&mut self, message: &ToProgram) {
        self.panel.write_all(&line(message).unwrap()).unwrap();
    }
    fn welcome(&mut self) {
        let answer = self.endpoint.secret.answer().to_owned();
        self.say(&ToProgram::Welcome { version: VERSION, answer });
        self.until(|link, _| link.is_connected());
    }
    /// Polls until something holds; what the link wished meanwhile.
    fn until(&mut self, done: impl Fn(&Link, &[PanelCommand]) -> bool) -> Vec<PanelCommand> {
        let end = Instant::now() + Duration::from_secs(20);
        let mut wishes = Vec::new();
        while !done(&self.link, &wishes) {
            assert!(Instant::now() < end, "never happened; wishes {wishes:?}");
            wishes.extend(self.link.poll());
            std::thread::sleep(Duration::from_millis(1));
        }
        wishes
    }
    fn heard(&mut self) -> ToPanel {
        let mut reader = std::io::BufReader::with_capacity(1, &mut self.panel);
        let mut text = String::new();
        reader.read_line(&mut text).unwrap();
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"))
    }
}

fn change(list: &[(&str, serde_json::Value)]) -> ToProgram {
    ToProgram::Change {
        assignments: list.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect(),
    }
}

#[test]
fn settings_come_through_and_are_confirmed() {
    let mut p = pair();
    let ToPanel::Hello { version, token, hello } = p.heard() else { panic!() };
    assert_eq!(
        (version, token.as_str(), hello.program.as_str()),
        (VERSION, p.endpoint.secret.token(), "test")
    );
    p.welcome();
    p.say(&change(&[
        ("mode", "rich".into()),
        ("effects.ambient_occlusion_samples", 32.into()),
        ("samples", 0.into()),
    ]));
    let wishes = p.until(|_, w| !w.is_empty());
    let PanelCommand::Settings(s) = &wishes[0] else { panic!() };
    assert_eq!((s.mode, s.effects.ambient_occlusion_samples, s.samples), (Mode::Rich, 32, 1));
    let ToPanel::InForce { settings, refused } = p.heard() else { panic!() };
    assert_eq!(settings, *s);
    assert_eq!(refused, ["panel: `samples` is 0; give a whole number from 1 to 4096"]);

    // A change replaces the ones before; the same again is no wish; the end of the panel is the end
    // of its settings.
    p.say(&change(&[("mode", "rich".into())]));
    let wishes = p.until(|_, w| !w.is_empty());
    assert!(
        matches!(&wishes[0], PanelCommand::Settings(s) if s.effects.ambient_occlusion_samples == 8)
    );
    p.say(&change(&[("mode", "rich".into())]));
    p.say(&ToProgram::Export {});
    assert_eq!(p.until(|_, w| !w.is_empty()), [PanelCommand::Export]);
    p.panel.shutdown(std::net::Shutdown::Both).unwrap();
    assert_eq!(p.until(|_, w| !w.is_empty()), [PanelCommand::Settings(Box::default())]);
}

#[test]
fn who_does_not_know_the_answer_is_not_listened_to() {
    for first in [
        ToProgram::Welcome { version: VERSION, answer: "0".repeat(32) },
        ToProgram::Welcome { version: VERSION + 1, answer: String::new() },
        change(&[("mode", "rich".into())]),
        ToProgram::Export {},
    ] {
        let mut p = pair();
        p.say(&first);
        p.say(&change(&[("mode", "rich".into())]));
        let wishes = p.until(|link, _| link.connection.is_none());
        assert!(
            wishes.is_empty() && p.link.in_force == Settings::default(),
            "{first:?}: {wishes:?}"
        );
    }
}

#[test]
fn frames_are_thinned_to_means_and_a_panel_that_does_not_read_costs_nothing() {
    let mut p = pair();
    p.heard();
    p.welcome();
    let stats = |frame: u64, ms: f64| FrameStats {
        frame,
        frame_ms: ms,
        rays: [("primary".to_owned(), 100)].into(),
        ..FrameStats::default()
    };
    let begin = Instant::now();
    for i in 0..50_000 {
        p.link.frame(&stats(i, 2.0));
        p.link.poll();
    }
    let elapsed = begin.elapsed();
    // A fast machine is done before the second message is due.
    std::thread::sleep(2 * FRAME_INTERVAL);
    p.link.frame(&stats(50_000, 2.0));
    p.link.poll();
    let ToPanel::Frame { stats: first } = p.heard() else { panic!() };
    assert_eq!((first.frame, first.frame_ms), (0, 2.0));
    let ToPanel::Frame { stats: second } = p.heard() else { panic!() };
    assert!(
        second.frame > 1 && (second.frame_ms - 2.0).abs() < 1e-9 && second.rays["primary"] == 100,
        "{second:?}"
    );
    // Two system calls a poll on a loaded machine; the bound is for a wait that should not be
    // there.
    assert!(elapsed < Duration::from_secs(10), "{elapsed:?} for 50 000 frames");

    // Megabytes that nobody reads.
    let many: Vec<ObjectInfo> = (0..MAX_OBJECTS as u64)
        .map(|i| ObjectInfo {
            key: format!("k{i}"),
            name: "x".repeat(500),
            triangles: i,
            color: None,
        })
        .collect();
    let begin = Instant::now();
    for i in 0..100 {
        p.link.objects(&many[i..]);
        p.link.poll();
    }
    assert!(begin.elapsed() < Duration::from_secs(10));
    assert!(p.link.connection.as_ref().unwrap().outgoing.len() <= MOST_WAITING);
}

#[test]
fn without_a_panel_frames_cost_a_look_at_the_clock() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    drop(listener);
    let mut link = Link::connect(PanelEndpoint { address, secret: Secret::of([0; 32]) }, hello());
    let begin = Instant::now();
    for _ in 0..100_000 {
        assert_eq!(link.poll(), None);
        link.frame(&FrameStats::default());
    }
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    let mut abroad = Link::connect(
        PanelEndpoint { address: "192.0.2.1:80".parse().unwrap(), secret: Secret::of([0; 32]) },
        hello(),
    );
    abroad.poll();
    assert!(abroad.connection.is_none(), "no other host");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn whatever_comes_instead_of_messages_changes_nothing(
        known in any::<bool>(),
        bytes in prop_oneof![
            proptest::collection::vec(any::<u8>(), 1..300),
            "\\{\"type\":\"(change|welcome|export|hello)\"[ \
             -~]{0,80}\\}?".prop_map(String::into_bytes),
            "[\\[\\{\"]{1,2000}".prop_map(String::into_bytes),
        ],
    ) {
        let mut p = pair();
        if known {
            p.welcome();
        }
        p.panel.write_all(&bytes).unwrap();
        p.panel.write_all(b"\n").unwrap();
        p.panel.shutdown(std::net::Shutdown::Write).unwrap();
        let wishes = p.until(|link, _| link.connection.is_none());
        prop_assert!(wishes.is_empty() || wishes == [PanelCommand::Export], "{:?}", wishes);
        prop_assert_eq!(&p.link.in_force, &Settings::default());
    }
}
