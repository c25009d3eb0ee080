use super::codec::{Reader, Wire};
use super::coordinator::{Coordinator, PartialImage};
use super::helper::{Helper, serve};
use super::mpi_group::{coordinate_group, serve_group};
use super::requests::{REPLY, REQUEST, ReplyHeader, Work};
use super::row_share::RowShare;
use super::socket_comm::SocketComm;
use crate::capture::draw::{Attributes, Draw, Shading, Values};
use crate::capture::geometry_cache::BuildCounts;
use crate::capture::geometry_cache::GeometryCache;
use crate::enums::*;
use crate::host::config::{Mode, Settings};
use crate::state::current_attributes::CurrentAttributes;
use crate::state::material::Material;
use crate::state::snapshot::{GlLight, Snapshot};
use crate::trace::overrides::RayMaterial;
use crate::trace::{self, Layer, Prepared};
use composite::comm::{CommError, Communicator, threads};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// Colours, and the bits of depths.
type TestPixels = (Vec<[u8; 4]>, Vec<u32>);

const IDENTITY: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

/// A bumpy sheet with a normal and a colour at each vertex, and a triangle that cuts through it.
fn draws(turn: f32) -> Vec<Draw> {
    let n = 60_u32;
    let at = |i: u32| i as f32 / (n - 1) as f32 * 1.8 - 0.9;
    let vertex = |k: u32| {
        let (x, y) = (at(k % n), at(k / n));
        [x, y, 0.4 * (7.0 * x).sin() * (5.0 * y).cos()]
    };
    let positions: Vec<[f32; 3]> = (0..n * n).map(vertex).collect();
    let cells = (0..(n - 1) * (n - 1)).map(|c| c / (n - 1) * n + c % (n - 1));
    let triangles: Vec<[u32; 3]> =
        cells.flat_map(|a| [[a, a + 1, a + n], [a + 1, a + n + 1, a + n]]).collect();
    let mut cache = GeometryCache::default();
    let current = CurrentAttributes {
        normal: [0.0, 0.0, 1.0],
        color: [0.3, 0.6, 0.9, 1.0],
        materials: [Material { diffuse: [0.8, 0.7, 0.2, 1.0], ..Material::default() }; 2],
        ..CurrentAttributes::default()
    };
    let mut attributes = Attributes::constant(&current);
    let bend = |p: &[f32; 3]| [p[0] + turn, p[1], 0.7];
    attributes.normals = Values::PerVertex(positions.iter().map(bend).collect());
    let light = GlLight {
        diffuse: [1.0; 4],
        position: [0.3, 0.4, 1.0, 0.0],
        spot_cutoff_deg: 180.0,
        attenuation: [1.0, 0.0, 0.0],
        ..GlLight::default()
    };
    let (c, s) = (turn.cos(), turn.sin());
    let mut model_view = IDENTITY;
    (model_view[0], model_view[2], model_view[8], model_view[10]) = (c, -s, s, c);
    let state = Arc::new(Snapshot {
        model_view,
        projection: IDENTITY,
        viewport: [3, 5, 333, 277],
        depth_range: [0.0, 1.0],
        front_is_ccw: true,
        lighting: true,
        lights: vec![light],
        normalize: true,
        depth_test: true,
        depth_mask: true,
        depth_func: LESS,
        color_mask: true,
        ..Snapshot::default()
    });
    let draw = |positions: &[[f32; 3]],
                triangles: &[[u32; 3]],
                cache: &mut GeometryCache,
                a: &Attributes| Draw {
        geometry: cache.of_indices(positions, triangles),
        attributes: Arc::new(a.clone()),
        state: state.clone(),
        shading: Shading::Fixed,
        clip_from_object: crate::state::matrix::product(&state.projection, &state.model_view),
        calls: 1,
        ray_material: RayMaterial::default(),
    };
    let cut = [[-0.7, -0.8, 0.3], [0.8, 0.1, -0.3], [-0.2, 0.9, 0.1]];
    let plain = Attributes::constant(&current);
    vec![
        draw(&positions, &triangles, &mut cache, &attributes),
        draw(&cut, &[[0, 1, 2]], &mut cache, &plain),
    ]
}

fn settings(mode: Mode) -> Settings {
    Settings { mode, ..Settings::default() }
}

/// The pictures of `frames` by a first rank and what its helpers are.
fn pictures(
    coordinator: &mut Coordinator,
    frames: &[f32],
    settings: &Settings,
    sent: &mut Vec<u64>,
) -> Vec<TestPixels> {
    let mut out = Vec::new();
    for turn in frames {
        let draws = draws(*turn);
        let ready: Vec<Prepared<'_>> = draws
            .iter()
            .map(|d| Prepared::new(d, None, &mut BuildCounts::default()).expect("seen"))
            .collect();
        let made = coordinator
            .make(&ready, settings, &Work::Nearest, |share| own(&ready, settings, share));
        sent.push(coordinator.rank_stats.all().iter().map(|a| a.sent_bytes).sum());
        out.push((made.first, made.second.iter().map(|d| d.to_bits()).collect()));
    }
    out
}

fn own(ready: &[Prepared<'_>], settings: &Settings, share: RowShare) -> PartialImage<[u8; 4], f32> {
    let (Layer { rect, color, depth, .. }, _) = trace::nearest(ready, settings, share);
    PartialImage { rect, first: color, second: depth, rays: Vec::new(), warnings: Vec::new() }
}

/// The pictures of a group whose helpers run `help`.
fn with_helpers(
    ranks: usize,
    frames: &[f32],
    mode: Mode,
    help: impl Fn(usize, &mut dyn Communicator) + Sync + Send,
) -> (Vec<TestPixels>, Vec<u64>, Vec<Option<String>>) {
    let mut group = threads::group(ranks);
    let helpers = group.split_off(1);
    let first = group.pop().expect("the first rank");
    std::thread::scope(|scope| {
        for mut comm in helpers {
            let help = &help;
            scope.spawn(move || help(comm.rank(), &mut comm));
        }
        let mut coordinator = Coordinator::new(Box::new(first));
        // However busy the machine is that tests it.
        coordinator.patience = Duration::from_secs(600);
        let mut sent = Vec::new();
        let out = pictures(&mut coordinator, frames, &settings(mode), &mut sent);
        let lost = coordinator.rank_stats.all().iter().map(|a| a.lost.clone()).collect();
        (out, sent, lost)
    })
}

fn honest(_: usize, comm: &mut dyn Communicator) {
    serve(comm, &AtomicBool::new(false)).expect("served");
}

#[test]
fn any_number_of_ranks_makes_the_bits_of_one() {
    for mode in [Mode::Match, Mode::Phong, Mode::Rich] {
        let (one, ..) = with_helpers(1, &[0.1, 0.4], mode, honest);
        assert!(
            one[0].1.iter().filter(|d| f32::from_bits(**d) < 1.5).count() > 20_000,
            "nothing is seen"
        );
        for ranks in [2, 3, 4, 7] {
            let (many, _, lost) = with_helpers(ranks, &[0.1, 0.4], mode, honest);
            assert!(lost.iter().all(Option::is_none), "{lost:?}");
            assert!(one == many, "{mode:?} on {ranks} ranks");
        }
    }
}

#[test]
fn helpers_are_told_of_what_is_new_and_of_nothing_else() {
    let frames = [0.1, 0.1, 0.1, 0.3];
    let (_, sent, _) = with_helpers(2, &frames, Mode::Match, honest);
    let each: Vec<u64> = (0..4).map(|i| sent[i] - if i == 0 { 0 } else { sent[i - 1] }).collect();
    // 3600 vertices and 6962 triangles; normals; then states alone; then other normals of the same
    // shape.
    assert!(each[0] > 160_000, "{each:?}");
    assert!(each[1] < 8_000 && each[2] < 8_000, "{each:?}");
    assert!((43_200..60_000).contains(&each[3]), "{each:?}");
}

#[test]
fn whoever_does_not_answer_or_answers_nonsense_is_replaced_and_named() {
    let frames = [0.1, 0.2, 0.3];
    let (one, ..) = with_helpers(1, &frames, Mode::Match, honest);
    let order =
        |comm: &mut dyn Communicator| comm.recv(0, REQUEST, 1 << 30, Duration::from_secs(20));
    type Fault = fn(&mut dyn Communicator) -> Result<(), CommError>;
    let nonsense: [(&str, Fault); 4] = [
        ("left the group", |_| Err(CommError::NothingPosted { rank: 0 })),
        ("answer", |c| c.send(0, REPLY, vec![3; 40])),
        ("longer than", |c| c.send(0, REPLY, vec![0; 1 << 26])),
        ("complains", |c| {
            let mut text = vec![0_u8; 8];
            text.push(1);
            text.extend(9_u64.to_ne_bytes());
            text.extend(b"complains");
            // Rectangle, cost and warnings.
            text.extend([0; 16 + 7 * 8 + 24 + 8]);
            c.send(0, REPLY, text)
        }),
    ];
    for (words, fault) in nonsense {
        let (many, _, lost) = with_helpers(3, &frames, Mode::Match, |rank, comm| {
            if rank == 1 {
                return honest(rank, comm);
            }
            order(comm).expect("an order");
            if fault(comm).is_ok() {
                // Not gone before its words have come.
                order(comm).expect_err("no second order for a liar");
            }
        });
        assert!(one == many, "{words}");
        assert_eq!(lost[1], None);
        assert!(lost[2].as_ref().is_some_and(|why| why.contains(words)), "{lost:?}");
    }
}

#[test]
fn orders_that_are_none_are_refused_and_the_next_is_obeyed() {
    let (_, _, lost) = with_helpers(2, &[0.1], Mode::Match, |_, comm| {
        let order = comm.recv(0, REQUEST, 1 << 30, Duration::from_secs(20)).expect("an order");
        let mut group = threads::group(2);
        let (mut helper, mut first) = (group.pop().expect("two"), group.pop().expect("two"));
        let answers = std::thread::scope(|scope| {
            scope.spawn(move || serve(&mut helper, &AtomicBool::new(false)).expect("served"));
            let mut ask = |bytes: Vec<u8>| {
                first.send(1, REQUEST, bytes).expect("sent");
                first.recv(1, REPLY, 1 << 30, Duration::from_secs(20)).expect("answered")
            };
            // Cut short anywhere, or with any byte of the scene's or the states' changed: never a
            // hang or a panic.
            for n in [0, 1, 8, 30, order.len() / 2, order.len() - 1] {
                assert_eq!(ask(order[..n].to_vec())[8], 1, "cut to {n} bytes");
            }
            let step = order.len() / 300;
            for i in (0..order.len()).step_by(step) {
                let mut changed = order.clone();
                changed[i] ^= 0xff;
                ask(changed);
            }
            first.send(1, REQUEST, order.clone()).expect("sent");
            let good = first.recv(1, REPLY, 1 << 30, Duration::from_secs(20)).expect("answered");
            drop(first);
            good
        });
        assert_eq!(answers[8], 0, "the last order was a good one");
        comm.send(0, REPLY, answers).expect("sent");
    });
    assert!(lost.iter().all(Option::is_none), "{lost:?}");
}

/// What a helper says of an order by a first rank that asks for `work` with these viewports.
fn said_of(work: Work, viewports: [[i32; 4]; 2]) -> Option<String> {
    let mut group = threads::group(2);
    let (mut helper, first) = (group.pop().expect("two"), group.pop().expect("two"));
    let mut draws = draws(0.1);
    for (draw, viewport) in draws.iter_mut().zip(viewports) {
        Arc::make_mut(&mut draw.state).viewport = viewport;
    }
    let mut coordinator = Coordinator::new(Box::new(first));
    coordinator.patience = Duration::ZERO;
    let ready: Vec<Prepared<'_>> = draws
        .iter()
        .map(|d| Prepared::new(d, None, &mut BuildCounts::default()).expect("seen"))
        .collect();
    coordinator.make(&ready, &settings(Mode::Match), &work, |_| PartialImage {
        rect: trace::Rect::default(),
        first: Vec::<[u8; 4]>::new(),
        second: Vec::<f32>::new(),
        rays: Vec::new(),
        warnings: Vec::new(),
    });
    let order = helper.recv(0, REQUEST, 1 << 30, Duration::from_secs(20)).expect("an order");
    let answer = Helper::default().answer(&order);
    ReplyHeader::get(&mut Reader::new(&answer)).expect("an answer").error_reply
}

#[test]
fn a_peer_cannot_make_a_helper_reserve_more_than_a_view_that_is_traced() {
    const SMALL: [i32; 4] = [3, 5, 333, 277];
    let far = (1 << 24) - 400;
    let whitted = |viewport, rect| {
        let projection = IDENTITY.map(f64::from);
        Work::Whitted(super::requests::ViewParameters { projection, viewport, rect }, [0.0; 3])
    };
    assert_eq!(said_of(Work::Nearest, [SMALL; 2]), None);
    assert_eq!(said_of(whitted(SMALL, SMALL), [SMALL; 2]), None);
    let large = [0, 0, 1 << 16, 1 << 16];
    let lies = [
        ("a view", whitted(large, large), [SMALL; 2]),
        ("a view", whitted(SMALL, large), [SMALL; 2]),
        ("a viewport", Work::Nearest, [SMALL, large]),
        ("a picture of", Work::Nearest, [[-far, -far, 333, 277], [far, far, 333, 277]]),
    ];
    for (words, work, viewports) in lies {
        let said = said_of(work, viewports);
        assert!(said.as_ref().is_some_and(|s| s.contains(words)), "{work:?}: {said:?}");
    }
}

#[test]
fn a_group_behind_one_head_makes_the_bits_of_one_and_ranks_that_leave_are_named() {
    let (one, ..) = with_helpers(1, &[0.1, 0.4, 0.2], Mode::Match, honest);
    let folder = tempfile::tempdir().expect("a folder");
    let places: Vec<_> = (1..4).map(|rank| folder.path().join(rank.to_string())).collect();
    let listeners: Vec<UnixListener> =
        places.iter().map(|p| UnixListener::bind(p).expect("bound")).collect();
    listeners.iter().for_each(|l| l.set_nonblocking(true).expect("a socket"));
    let over: Vec<AtomicBool> = (0..4).map(|_| AtomicBool::new(false)).collect();
    let group = threads::group(4);
    std::thread::scope(|scope| {
        let ranks: Vec<_> = group
            .into_iter()
            .map(|mut comm| {
                let (over, listeners) =
                    (&over[comm.rank()], listeners.iter().map(|l| l.try_clone()).collect());
                scope.spawn(move || match comm.rank() {
                    0 => coordinate_group(&mut comm, Result::expect(listeners, "sockets"), over),
                    _ => serve_group(&mut comm, over),
                })
            })
            .collect();
        let connect = || {
            let streams =
                places.iter().map(|p| UnixStream::connect(p).expect("a rank is there")).collect();
            let mut coordinator =
                Coordinator::new(Box::new(SocketComm::first(streams).expect("sockets")));
            coordinator.patience = Duration::from_secs(600);
            coordinator
        };
        // Two programs, one of which says nonsense and costs the other nothing.
        let (mut coordinator, mut other) =
            (connect(), UnixStream::connect(&places[0]).expect("a rank is there"));
        std::io::Write::write_all(&mut other, &[0xee; 4096]).expect("nonsense");
        let mut many = pictures(&mut coordinator, &[0.1], &settings(Mode::Match), &mut Vec::new());
        assert!(coordinator.rank_stats.all().iter().all(|a| a.lost.is_none() && a.pictures == 1));
        assert!(coordinator.rank_stats.all()[1..].iter().all(|a| a.builds == 2 && a.rays > 1000));
        // The second rank goes.
        over[2].store(true, Relaxed);
        while !ranks[2].is_finished() {
            std::thread::sleep(Duration::from_millis(2));
        }
        many.extend(pictures(
            &mut coordinator,
            &[0.4, 0.2],
            &settings(Mode::Match),
            &mut Vec::new(),
        ));
        let lost: Vec<bool> =
            coordinator.rank_stats.all().iter().map(|a| a.lost.is_some()).collect();
        assert_eq!(lost, [false, false, true, false]);
        assert!(one == many, "the pictures differ");
        // The head's end is everybody's.
        over[0].store(true, Relaxed);
        for rank in ranks {
            rank.join().expect("no panic").expect("no fault");
        }
        let again = pictures(&mut coordinator, &[0.2], &settings(Mode::Match), &mut Vec::new());
        assert!(
            again[0] == one[2]
                && coordinator.rank_stats.all()[1..].iter().all(|a| a.lost.is_some())
        );
    });
}
