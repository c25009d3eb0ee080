//! A rank of a distributed scene needs memory for what it has, and a little for each other rank.
//!
//! The allocator counts what the process holds. The ranks are threads that take turns: one works
//! until it waits for a message, so that what is allocated meanwhile is its own. A message belongs
//! to its sender until it is sent, and to its receiver from its arrival.
use composite::comm::{Arrival, Receive};
use composite::render::{DataParallel, FrameError, FrameOptions, RankScene};
use composite::{CommError, Communicator, threads};
use peak_alloc::PeakAlloc;
use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::Camera;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::TriMesh;
use rt_core::render::RenderOptions;
use rt_core::scene::AmbientOcclusion;
use std::sync::{Condvar, Mutex};
use std::time::Duration;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Cells along a side of each rank's square of the ground.
const CELLS: u32 = 40;
/// Bytes of the positions and indices of a rank.
const DATA_BYTES: usize = (((CELLS + 1) * (CELLS + 1) + 2 * CELLS * CELLS) * 12) as usize;

/// Who works.
#[derive(Default)]
struct Turn {
    taken: Mutex<bool>,
    free: Condvar,
}

/// A rank that works only in its turn, and counts what it holds.
struct Counted<'a> {
    inner: threads::ThreadComm,
    turn: &'a Turn,
    /// What the process held when the turn began.
    begin: usize,
    /// What this rank holds, but for what it has allocated in this turn.
    held: isize,
    peak: isize,
    working: bool,
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.end_turn();
    }
}

impl<'a> Counted<'a> {
    fn new(inner: threads::ThreadComm, turn: &'a Turn) -> Self {
        let mut counted = Self { inner, turn, begin: 0, held: 0, peak: 0, working: false };
        counted.take_turn();
        counted
    }

    fn take_turn(&mut self) {
        let mut taken = self.turn.taken.lock().unwrap();
        while *taken {
            taken = self.turn.free.wait(taken).unwrap();
        }
        (*taken, self.working) = (true, true);
        self.begin = ALLOCATED.current_usage();
        ALLOCATED.reset_peak_usage();
    }

    fn end_turn(&mut self) {
        if !std::mem::take(&mut self.working) {
            return;
        }
        let grown = |now: usize| now as isize - self.begin as isize;
        self.peak = self.peak.max(self.held + grown(ALLOCATED.peak_usage()));
        self.held += grown(ALLOCATED.current_usage());
        *self.turn.taken.lock().unwrap() = false;
        self.turn.free.notify_one();
    }
}

impl Communicator for Counted<'_> {
    fn rank(&self) -> usize {
        self.inner.rank()
    }

    fn size(&self) -> usize {
        self.inner.size()
    }

    fn now(&self) -> f64 {
        self.inner.now()
    }

    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError> {
        self.held -= message.capacity() as isize;
        self.inner.send(destination, tag, message)
    }

    fn post_recv(
        &mut self,
        source: usize,
        tag: u32,
        capacity: usize,
    ) -> Result<Receive, CommError> {
        self.inner.post_recv(source, tag, capacity)
    }

    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError> {
        self.end_turn();
        let arrival = self.inner.wait_any(posted, timeout);
        self.take_turn();
        if let Ok(arrival) = &arrival {
            self.held += arrival.message.capacity() as isize;
        }
        arrival
    }

    fn abort(&mut self, reason: &str) {
        self.inner.abort(reason);
    }
}

/// The square of one of many ranks, which lie in a row, with waves.
fn square(rank: usize) -> TriMesh {
    let n = CELLS + 1;
    let at = |k: u32| {
        let (x, y) = ((k % n) as f32 / CELLS as f32, (k / n) as f32 / CELLS as f32);
        Vec3::new(x + rank as f32, y, 0.2 * (9.0 * x).sin() * (7.0 * y).cos())
    };
    let mut mesh = TriMesh::new((0..n * n).map(at).collect(), Vec::new());
    mesh.indices.reserve_exact((2 * CELLS * CELLS) as usize);
    for j in 0..CELLS {
        for i in 0..CELLS {
            let k = j * n + i;
            mesh.indices.extend([[k, k + 1, k + n], [k + 1, k + n + 1, k + n]]);
        }
    }
    mesh
}

/// The most bytes that each of so many ranks held at once, from nothing to the end of a frame with
/// shadows and occlusion.
fn peaks(ranks: usize) -> Vec<usize> {
    let turn = Turn::default();
    let center = DVec3::new(0.5 * ranks as f64, 0.5, 0.0);
    let eye = center + DVec3::new(0.0, -3.0, 0.6 * ranks as f64);
    let camera = Camera::perspective(eye, center, DVec3::Z, 1.2, 1.0, [0.1, 1e4]).unwrap();
    let ends = threads::run(ranks, |inner| {
        let mut comm = Counted::new(inner, &turn);
        let mut scene = RankScene::new();
        let matte = scene.material(Material::matte([0.8; 3]));
        scene.mesh("ground", square(comm.rank()), matte);
        scene.light(Light::point(center + DVec3::new(0.0, 0.0, 4.0)));
        scene.light(Light::ambient([0.3; 3]));
        scene.ambient_occlusion = Some(AmbientOcclusion { distance: 0.5, rays: 2 });
        let options = FrameOptions { timeout: Duration::from_secs(120), ..FrameOptions::default() };
        let mut renderer = DataParallel::distributed(&mut comm, scene, options)?;
        let done = renderer.frame(&mut comm, &camera, &RenderOptions::new(64, 64))?;
        assert_eq!(done.frame.is_some(), comm.rank() == 0);
        comm.end_turn();
        Ok::<_, FrameError>(comm.peak as usize)
    });
    ends.into_iter().map(|end| end.expect("no rank panics").expect("a frame")).collect()
}

#[test]
fn a_rank_needs_memory_for_its_data_and_a_little_for_each_other_rank() {
    // What one process would need to build the sum for 64 ranks.
    let whole = {
        let mut all = TriMesh::default();
        for rank in 0..64 {
            let (first, piece) = (all.positions.len() as u32, square(rank));
            all.positions.extend(piece.positions);
            all.indices.extend(piece.indices.iter().map(|t| t.map(|k| k + first)));
        }
        ALLOCATED.reset_peak_usage();
        let before = ALLOCATED.current_usage();
        let world = World::from_mesh(all, &BuildOptions::default()).unwrap();
        assert!(world.report().primitives > 64 * 3000);
        ALLOCATED.peak_usage() - before
    };
    let (few, many) = (peaks(16), peaks(64));
    let most = |peaks: &[usize]| peaks.iter().copied().max().unwrap_or(0);
    let (few, many) = (most(&few), most(&many));
    eprintln!("data {DATA_BYTES}, 16 ranks {few}, 64 ranks {many}, whole {whole} bytes");
    // The limit is far below what the sum needs, ...
    let limit = 12 * DATA_BYTES + 64 * 8192;
    assert!(4 * limit < whole, "the sum would fit: {whole} of {limit}");
    assert!(many < limit, "a rank of 64 held {many} bytes, of data of {DATA_BYTES}");
    // ... and each further rank costs a few rows.
    assert!(many < few + 48 * 8192, "{few} bytes with 16 ranks, {many} with 64");
}
