//! A mesh built by Embree, and ray queries on it.

#![expect(unsafe_code, reason = "Embree is a C library")]

use super::abi::{self, Arguments4, Context3, Handle, HitN, Queries, RayHitN, RayN, Valid};
use super::library::Embree;
use crate::baselines::{BaselineError, BuildCost, Tracer, require_clean};
use crate::clock;
use crate::meshes::MeshScene;
use crate::rays::{HitBlock, LANES, NO_HIT, RayBlock};
use core::ffi::{c_int, c_void};
use rt_core::mesh::TriMesh;
use std::ffi::CString;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

/// `RTCBuildQuality`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// Morton order.
    Low,
    /// Binned surface-area heuristic.
    #[default]
    Medium,
    /// With spatial splits.
    High,
}

impl Quality {
    /// All qualities, from fastest to best.
    pub const ALL: [Quality; 3] = [Quality::Low, Quality::Medium, Quality::High];

    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Quality::Low => "low",
            Quality::Medium => "medium",
            Quality::High => "high",
        }
    }
}

/// One of Embree's two queries.
trait Query {
    /// The function of this query.
    fn select<F>(intersect: F, occluded: F) -> F;
}

/// `rtcIntersect`: the closest hit.
struct Intersect;

/// `rtcOccluded`: any hit.
struct Occluded;

impl Query for Intersect {
    #[inline(always)]
    fn select<F>(intersect: F, _: F) -> F {
        intersect
    }
}

impl Query for Occluded {
    #[inline(always)]
    fn select<F>(_: F, occluded: F) -> F {
        occluded
    }
}

/// How a scene is built.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Options {
    /// Quality of the builder.
    pub quality: Quality,
    /// `RTC_SCENE_FLAG_ROBUST`: Pluecker edge tests and conservative bounding boxes.
    pub robust: bool,
    /// `RTC_SCENE_FLAG_COMPACT`: less memory.
    pub compact: bool,
    /// Threads of the builder; 0 for all.
    pub threads: usize,
    /// The widest allowed instruction set: `sse4.2`, `avx2`, …; `None` for all.
    pub max_isa: Option<&'static str>,
}

impl Options {
    fn device_configuration(&self) -> String {
        let mut s = format!("threads={},set_affinity=0", self.threads);
        if let Some(isa) = self.max_isa {
            s += &format!(",max_isa={isa}");
        }
        s
    }
}

/// Current and peak number of bytes.
#[derive(Default)]
struct Memory {
    now: AtomicI64,
    peak: AtomicI64,
}

/// # Safety
/// `user` points to a [`Memory`] that outlives the device.
unsafe extern "C" fn monitor(user: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: the caller's promise; only shared access through atomics.
    let m = unsafe { &*user.cast::<Memory>() };
    let now = m.now.fetch_add(bytes as i64, Ordering::Relaxed) + bytes as i64;
    m.peak.fetch_max(now, Ordering::Relaxed);
    true
}

/// A built scene. It owns copies of the mesh's arrays, which Embree reads while tracing.
pub struct EmbreeScene {
    embree: Embree,
    device: Handle,
    scene: Handle,
    options: Options,
    instanced: bool,
    /// Cost of the build. Memory is counted by Embree's monitor and excludes the input arrays.
    pub cost: BuildCost,
    /// Shared with Embree until the scene is released. Padded, because Embree reads 16 bytes at the
    /// last vertex.
    _arrays: Vec<(Vec<f32>, Vec<u32>)>,
    _memory: Box<Memory>,
}

// SAFETY: a committed scene is only read by queries, which Embree allows from any thread at the
// same time, and it may be released from any thread. The pointers are not used for anything else,
// and the counters are atomic.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    /// Builds a mesh.
    pub fn build(
        embree: &Embree,
        mesh: &TriMesh,
        options: &Options,
    ) -> Result<EmbreeScene, BaselineError> {
        EmbreeScene::build_scene(embree, &MeshScene::one("", Arc::new(mesh.clone())), options)
    }

    /// Builds a scene in which each mesh is a geometry of its own; when some are transformed or
    /// used more than once, each is a scene of its own with Embree's instances. Hits tell the
    /// triangle's number in its mesh.
    pub fn build_scene(
        embree: &Embree,
        scene: &MeshScene,
        options: &Options,
    ) -> Result<EmbreeScene, BaselineError> {
        let meshes: Vec<&TriMesh> = scene.meshes.iter().map(|m| &**m).collect();
        let instanced = !scene.is_unmoved();
        let transforms: Vec<[f32; 12]> = scene
            .instances
            .iter()
            .map(|i| i.world_from_object.to_cols_array().map(|x| x as f32))
            .collect();
        let placed = &scene.instances;
        meshes.iter().try_for_each(|m| require_clean(m))?;
        let calls = embree.calls;
        let failed = |code: c_int, doing: &'static str| BaselineError::Failed {
            name: embree.name(),
            error: abi::error_name(code),
            doing,
        };
        let config =
            CString::new(options.device_configuration()).map_err(|_| failed(2, "configuring"))?;
        let of_mesh = |mesh: &&TriMesh| {
            let mut positions: Vec<f32> = Vec::with_capacity(mesh.positions.len() * 3 + 4);
            positions.extend(mesh.positions.iter().flat_map(|p| p.to_array()));
            positions.extend([0.0; 4]);
            (positions, mesh.indices.iter().flatten().copied().collect())
        };
        let arrays: Vec<(Vec<f32>, Vec<u32>)> = meshes.iter().map(of_mesh).collect();
        let memory = Box::<Memory>::default();

        // SAFETY: functions are called as the headers say. The configuration outlives the call; the
        // monitor's data is boxed, lives in `self` and is dropped after the device; the arrays have
        // the counts and strides given, all indices are below the vertex count (`require_clean`),
        // and they live in `self` until the scene is released. The geometry's reference is given to
        // the scene; scenes of single meshes are kept by their instances. Embree copies a
        // transform, which has the twelve floats of its format. Handles are released once, in
        // `Drop` or below on failure.
        let (device, scene, time) = unsafe {
            let device = (calls.new_device)(config.as_ptr());
            if device.is_null() {
                return Err(failed((calls.get_device_error)(device), "making a device"));
            }
            (calls.set_memory_monitor)(device, monitor, (&raw const *memory).cast_mut().cast());
            let quality = options.quality as c_int;
            let new_scene = || {
                let scene = (calls.new_scene)(device);
                let mut flags = 0;
                flags |= if options.robust { abi::SCENE_FLAG_ROBUST } else { 0 };
                flags |= if options.compact { abi::SCENE_FLAG_COMPACT } else { 0 };
                (calls.set_scene_flags)(scene, flags);
                (calls.set_scene_build_quality)(scene, quality);
                scene
            };
            let scene = new_scene();
            let mut of_meshes = vec![];
            let share = calls.set_shared_geometry_buffer;
            for (mesh, (positions, indices)) in meshes.iter().zip(&arrays) {
                let geometry = (calls.new_geometry)(device, abi::GEOMETRY_TYPE_TRIANGLE);
                (calls.set_geometry_build_quality)(geometry, quality);
                let (vertices, triangles) = (mesh.positions.len(), mesh.indices.len());
                let (v, i) = (positions.as_ptr().cast(), indices.as_ptr().cast());
                share(geometry, abi::BUFFER_TYPE_VERTEX, 0, abi::FORMAT_FLOAT3, v, 0, 12, vertices);
                share(geometry, abi::BUFFER_TYPE_INDEX, 0, abi::FORMAT_UINT3, i, 0, 12, triangles);
                (calls.commit_geometry)(geometry);
                let own = if instanced { new_scene() } else { scene };
                (calls.attach_geometry)(own, geometry);
                (calls.release_geometry)(geometry);
                of_meshes.extend(instanced.then_some(own));
            }
            let build = || {
                of_meshes.iter().for_each(|&own| (calls.commit_scene)(own));
                // None unless there are scenes to place.
                for (i, transform) in placed.iter().zip(&transforms).filter(|_| instanced) {
                    let geometry = (calls.new_geometry)(device, abi::GEOMETRY_TYPE_INSTANCE);
                    (calls.set_geometry_instanced_scene)(geometry, of_meshes[i.geometry]);
                    let (format, matrix) = (abi::FORMAT_FLOAT3X4_COLUMN_MAJOR, transform.as_ptr());
                    (calls.set_geometry_transform)(geometry, 0, format, matrix.cast());
                    (calls.commit_geometry)(geometry);
                    (calls.attach_geometry)(scene, geometry);
                    (calls.release_geometry)(geometry);
                }
                (calls.commit_scene)(scene);
            };
            let ((), time) = clock::measure(build);
            // The instances keep them.
            of_meshes.iter().for_each(|&own| (calls.release_scene)(own));
            let error = (calls.get_device_error)(device);
            if error != 0 {
                (calls.release_scene)(scene);
                (calls.release_device)(device);
                return Err(failed(error, "building a scene"));
            }
            (device, scene, time)
        };
        let bytes = |m: &AtomicI64| m.load(Ordering::Relaxed).max(0) as u64;
        let cost = BuildCost {
            wall_secs: time.wall_secs,
            cpu_secs: time.process_cpu_secs,
            bytes: bytes(&memory.now),
            peak_bytes: Some(bytes(&memory.peak)),
        };
        Ok(EmbreeScene {
            embree: embree.clone(),
            device,
            scene,
            options: options.clone(),
            instanced,
            cost,
            _arrays: arrays,
            _memory: memory,
        })
    }

    /// Why a view of this width cannot be asked for occlusion, or `None`.
    ///
    /// Embree 3.13's occlusion query in packets of sixteen now and then does not come back among
    /// instances, robust or not: it stays in its loop for good, with rays that it has answered
    /// before. Packets of eight have not been seen to, but share its code. Single rays and Embree 4
    /// come back.
    pub fn occlusion_fault(&self, width: usize) -> Option<String> {
        let v3 = matches!(self.embree.calls.queries, Queries::V3 { .. });
        let mode = if self.options.robust { "robust" } else { "fast" };
        (v3 && self.instanced && width > 1).then(|| {
            format!(
                "{} {mode}, occlusion in packets of {width}: the query does not always come back \
                 among instances; its single rays are measured, and Embree 4",
                self.embree.name()
            )
        })
    }

    /// A view that sends 1, 4, 8 or 16 rays at a time, marked as coherent or not. Panics for other
    /// widths.
    pub fn view(&self, width: usize, coherent: bool) -> View<'_> {
        assert!(
            [1, 4, 8, 16].contains(&width),
            "Embree has packets of 1, 4, 8 and 16 rays, not {width}"
        );
        View { scene: self, width, coherent }
    }

    /// # Safety
    /// `packet` holds N rays with `N` of 1, 4, 8, 16.
    #[inline(always)]
    unsafe fn query<const N: usize, Q: Query>(
        &self,
        valid: &Valid<N>,
        packet: &mut RayHitN<N>,
        flags: &mut Flags,
    ) {
        let rays: *mut c_void = (&raw mut *packet).cast();
        let (valid, scene) = (valid.0.as_ptr(), self.scene);
        // SAFETY: the scene is committed; the packet and the valid mask are aligned to 64 bytes and
        // have the layout of width N (tested in `abi`; occlusion queries take the ray part, which
        // comes first); the context or the arguments live through the call and have no callbacks.
        unsafe {
            match &self.embree.calls.queries {
                Queries::V3 { intersect, occluded } => {
                    let (f, context) = (Q::select(intersect, occluded), &raw mut flags.context3);
                    match N {
                        1 => (f.one)(scene, context, rays),
                        4 => (f.four)(valid, scene, context, rays),
                        8 => (f.eight)(valid, scene, context, rays),
                        _ => (f.sixteen)(valid, scene, context, rays),
                    }
                }
                Queries::V4 { intersect, occluded } => {
                    let (f, arguments) =
                        (Q::select(intersect, occluded), &raw mut flags.arguments4);
                    match N {
                        1 => (f.one)(scene, rays, arguments),
                        4 => (f.four)(valid, scene, rays, arguments),
                        8 => (f.eight)(valid, scene, rays, arguments),
                        _ => (f.sixteen)(valid, scene, rays, arguments),
                    }
                }
            }
        }
    }

    fn closest_n<const N: usize>(&self, rays: &[RayBlock], hits: &mut [HitBlock], coherent: bool) {
        let (mut q, mut flags) = (RayHitN::<N>::unused(), Flags::new(coherent));
        for (r, h) in rays.iter().zip(hits) {
            for from in (0..LANES).step_by(N) {
                let valid = q.load(r, from);
                if N == 1 && valid.0[0] == 0 {
                    h.prim[from] = NO_HIT;
                    continue;
                }
                // SAFETY: `closest` and `occluded` choose N from 1, 4, 8, 16, and `load` filled all
                // lanes.
                unsafe { self.query::<N, Intersect>(&valid, &mut q, &mut flags) };
                let to = from..from + N;
                h.t[to.clone()].copy_from_slice(&q.ray.tfar);
                h.u[to.clone()].copy_from_slice(&q.hit.u);
                h.v[to.clone()].copy_from_slice(&q.hit.v);
                for l in 0..N {
                    h.prim[from + l] =
                        if q.hit.geom_id[l] == abi::INVALID_ID { NO_HIT } else { q.hit.prim_id[l] };
                }
            }
        }
    }

    fn occluded_n<const N: usize>(&self, rays: &[RayBlock], masks: &mut [u16], coherent: bool) {
        let (mut q, mut flags) = (RayHitN::<N>::unused(), Flags::new(coherent));
        for (r, m) in rays.iter().zip(masks) {
            *m = 0;
            for from in (0..LANES).step_by(N) {
                let valid = q.load(r, from);
                if N == 1 && valid.0[0] == 0 {
                    continue;
                }
                // SAFETY: as in `closest_n`.
                unsafe { self.query::<N, Occluded>(&valid, &mut q, &mut flags) };
                // An occluded ray's end is set to -infinity; an empty lane's was negative before.
                for l in 0..N {
                    *m |= u16::from(q.ray.tfar[l] < 0.0 && valid.0[l] != 0) << (from + l);
                }
            }
        }
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: both handles are valid and released here only; the arrays and the monitor's data
        // are dropped after.
        unsafe {
            (self.embree.calls.release_scene)(self.scene);
            (self.embree.calls.release_device)(self.device);
        }
    }
}

/// Coherence flags in the form of either version.
struct Flags {
    context3: Context3,
    arguments4: Arguments4,
}

impl Flags {
    fn new(coherent: bool) -> Flags {
        let null = core::ptr::null_mut();
        Flags {
            context3: Context3 {
                flags: if coherent { abi::COHERENT_3 } else { 0 },
                filter: null,
                inst_id: abi::INVALID_ID,
                min_width_distance_factor: 0.0,
            },
            arguments4: Arguments4 {
                flags: if coherent { abi::COHERENT_4 } else { 0 },
                feature_mask: u32::MAX,
                context: null,
                filter: null,
                callback: null,
                min_width_distance_factor: 0.0,
            },
        }
    }
}

impl<const N: usize> RayHitN<N> {
    /// A packet whose constant fields are set; queries do not change these.
    fn unused() -> Self {
        let (f, zero, all) = ([0.0; N], [0; N], [u32::MAX; N]);
        let ray = RayN {
            org_x: f,
            org_y: f,
            org_z: f,
            tnear: f,
            dir_x: f,
            dir_y: f,
            dir_z: f,
            time: f,
            tfar: f,
            mask: all,
            id: zero,
            flags: zero,
        };
        let hit =
            HitN { normal: [f; 3], u: f, v: f, prim_id: all, geom_id: all, instance: [all; _] };
        RayHitN { ray, hit }
    }

    /// Copies lanes `from..from + N` of a block and resets the hits.
    #[inline(always)]
    fn load(&mut self, r: &RayBlock, from: usize) -> Valid<N> {
        let q = &mut self.ray;
        let part = |row: &[f32; LANES]| -> [f32; N] { core::array::from_fn(|l| row[from + l]) };
        (q.org_x, q.org_y, q.org_z) = (part(&r.ox), part(&r.oy), part(&r.oz));
        (q.dir_x, q.dir_y, q.dir_z) = (part(&r.dx), part(&r.dy), part(&r.dz));
        (q.tnear, q.tfar) = (part(&r.t_min), part(&r.t_max));
        self.hit.geom_id = [abi::INVALID_ID; N];
        Valid(core::array::from_fn(|l| if r.t_max[from + l] >= 0.0 { -1 } else { 0 }))
    }
}

/// A scene with a packet width and a coherence hint.
pub struct View<'a> {
    scene: &'a EmbreeScene,
    width: usize,
    coherent: bool,
}

impl Tracer for View<'_> {
    fn name(&self) -> String {
        let o = &self.scene.options;
        let mut s = format!("{}, {}", self.scene.embree.name(), o.quality.name());
        s += if o.robust { ", robust" } else { "" };
        s += if o.compact { ", compact" } else { "" };
        s += &o.max_isa.map_or(String::new(), |isa| format!(", {isa}"));
        s += &match (self.width, self.coherent) {
            (1, _) => ", single rays".to_string(),
            (n, true) => format!(", packets of {n}, coherent"),
            (n, false) => format!(", packets of {n}, incoherent"),
        };
        s
    }

    fn closest(&self, rays: &[RayBlock], hits: &mut [HitBlock]) {
        match self.width {
            1 => self.scene.closest_n::<1>(rays, hits, self.coherent),
            4 => self.scene.closest_n::<4>(rays, hits, self.coherent),
            8 => self.scene.closest_n::<8>(rays, hits, self.coherent),
            _ => self.scene.closest_n::<16>(rays, hits, self.coherent),
        }
    }

    fn occluded(&self, rays: &[RayBlock], masks: &mut [u16]) {
        match self.width {
            1 => self.scene.occluded_n::<1>(rays, masks, self.coherent),
            4 => self.scene.occluded_n::<4>(rays, masks, self.coherent),
            8 => self.scene.occluded_n::<8>(rays, masks, self.coherent),
            _ => self.scene.occluded_n::<16>(rays, masks, self.coherent),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::embree::Version;
    use crate::baselines::testing;
    use std::io::Write as _;

    /// Runs a check with each installed version. Reports the missing ones in a way that libtest
    /// does not capture in passing tests; with `RTSV_REQUIRE_PEERS=1`, a missing version is a
    /// failure.
    fn with_each(check: impl Fn(&Embree)) {
        for version in [Version::V3, Version::V4] {
            match Embree::load(version) {
                Ok(e) => check(&e),
                Err(e) => {
                    assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"), "{e}");
                    writeln!(std::io::stderr(), "skipped: {e}").unwrap();
                }
            }
        }
    }

    #[test]
    fn every_width_and_hint_agrees_with_brute_force() {
        let mesh = testing::mesh();
        with_each(|embree| {
            for robust in [false, true] {
                let options = Options { robust, threads: 1, ..Options::default() };
                let scene = EmbreeScene::build(embree, &mesh, &options).unwrap();
                for (width, coherent) in
                    [(1, false), (4, true), (8, true), (8, false), (16, true), (16, false)]
                {
                    testing::agrees_with_brute_force(&scene.view(width, coherent));
                }
            }
        });
    }

    #[test]
    fn every_quality_and_instruction_set_agrees_with_brute_force() {
        let mesh = testing::mesh();
        with_each(|embree| {
            for quality in Quality::ALL {
                for max_isa in [None, Some("avx2"), Some("sse4.2")] {
                    let options = Options {
                        quality,
                        max_isa,
                        compact: true,
                        threads: 2,
                        ..Options::default()
                    };
                    let scene = EmbreeScene::build(embree, &mesh, &options).unwrap();
                    testing::agrees_with_brute_force(&scene.view(16, true));
                }
            }
        });
    }

    #[test]
    fn instances_are_where_those_of_rt_core_are() {
        let scene = crate::meshes::forest(150);
        let ours = crate::rt_core_tracer::RtCoreTracer::build_scene(&scene, &Default::default());
        let ours = ours.unwrap();
        let rays = crate::rays::View::orbit(scene.bounds()).primary(128);
        let mut expected = vec![HitBlock::MISS; rays.blocks.len()];
        ours.view(crate::rt_core_tracer::Mode::Coherent).closest(&rays.blocks, &mut expected);
        with_each(|embree| {
            let options = Options { robust: true, threads: 1, ..Options::default() };
            let theirs = EmbreeScene::build_scene(embree, &scene, &options).unwrap();
            for (width, coherent) in [(1, false), (8, true), (16, true), (16, false)] {
                let mut hits = vec![HitBlock::MISS; rays.blocks.len()];
                theirs.view(width, coherent).closest(&rays.blocks, &mut hits);
                // Embree's matrices are f32, so rays at the edges of leaves may differ.
                let (mut same, mut found) = (0, 0);
                for i in 0..rays.len {
                    let [a, b] = [&expected, &hits].map(|h| {
                        let (block, lane) = (&h[i / LANES], i % LANES);
                        (block.prim[lane], block.t[lane])
                    });
                    found += usize::from(a.0 != NO_HIT);
                    let near = a.0 == NO_HIT || (a.1 - b.1).abs() < 1e-4 * a.1;
                    same += usize::from(a.0 == b.0 && near);
                }
                assert!(found > rays.len / 10, "{found} hits");
                assert!(same * 1000 >= rays.len * 997, "{same} of {} rays agree", rays.len);
            }
        });
    }

    #[test]
    fn memory_and_time_of_a_build_are_counted() {
        let mesh = testing::mesh();
        with_each(|embree| {
            let options = Options { threads: 1, ..Options::default() };
            let cost = EmbreeScene::build(embree, &mesh, &options).unwrap().cost;
            let per_triangle = cost.bytes as f64 / mesh.num_triangles() as f64;
            assert!((20.0..2000.0).contains(&per_triangle), "{cost:?}");
            assert!(cost.peak_bytes.unwrap() >= cost.bytes && cost.wall_secs > 0.0, "{cost:?}");
        });
    }

    #[test]
    fn an_index_past_the_end_never_reaches_embree() {
        let mut mesh = testing::mesh();
        mesh.indices[7][1] = 1_000_000;
        with_each(|embree| {
            let e = EmbreeScene::build(embree, &mesh, &Options::default()).err().unwrap();
            assert_eq!(e, BaselineError::Mesh { count: 1 });
        });
    }

    #[test]
    fn options_become_a_device_configuration() {
        let o = Options { threads: 3, max_isa: Some("avx2"), ..Options::default() };
        assert_eq!(o.device_configuration(), "threads=3,set_affinity=0,max_isa=avx2");
    }
}
