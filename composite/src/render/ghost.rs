//! Ghost zones: every rank also holds the geometry within the distance of ambient occlusion around
//! its part, and then computes the light of its own hits alone. This is exact, because no such ray
//! leaves the zone. Ghost zones cost memory and a build once, and nothing per frame. Sending
//! requests costs messages and repeated rays every frame. `choose` estimates both.
use super::options::{FrameOptions, SecondaryRayPolicy};
use super::rank_bounds::RankBounds;
use super::request_reply::{RankChannel, Tag};
use super::{FrameError, Part};
use rt_core::bvh::{Geometry, World};
use rt_core::glam::Vec3;
use rt_core::math::Aabb;
use rt_core::mesh::TriMesh;
use rt_core::render::{RenderError, RenderOptions};
use rt_core::scene::{Appearance, Scene, SceneError};
use std::sync::Arc;

/// The chosen policy.
#[derive(Debug, Clone)]
pub(super) struct Decision {
    pub(super) distance: f64,
    pub(super) policy: SecondaryRayPolicy,
    pub(super) reason: String,
}

/// Prices of the estimate, for one thread of a 2020s server core and a network of 3 GB/s. Only
/// their order of magnitude matters: near the point where both cost the same, either will do.
pub mod cost_model {
    /// Seconds for a secondary ray, including its generation.
    pub const RAY_SECS: f64 = 150e-9;
    /// Seconds for a byte on the network.
    pub const BYTE_SECS: f64 = 1.0 / 3e9;
    /// Seconds for a round of messages.
    pub const ROUND_SECS: f64 = 20e-6;
    /// Seconds to build the structure over a triangle.
    pub const BUILD_SECS: f64 = 400e-9;
    /// Bytes of a triangle in a message: half a vertex of 12 bytes, with neighbours in the ghost
    /// layer, and three indices.
    pub const TRIANGLE_BYTES: f64 = 24.0;
    /// Bytes of a point and its reply.
    pub const POINT_BYTES: f64 = 52.0;
    /// Share of an image that is covered, before any frame has been rendered.
    pub const COVERED: f64 = 0.5;
}

/// The boxes of each triangle in render space, one for each instance.
fn placed_boxes(scene: &Scene, geometry: usize, mesh: &TriMesh) -> Vec<Aabb> {
    let origin = scene.world.origin();
    let mut triangle_boxes = vec![Aabb::EMPTY; mesh.indices.len()];
    for instance in scene.world.instances().iter().filter(|i| i.geometry == geometry) {
        for (b, corners) in triangle_boxes.iter_mut().zip(&mesh.indices) {
            for &k in corners {
                let Some(p) = mesh.positions.get(k as usize) else { continue };
                let world = instance.world_from_object.transform_point3(mesh.origin + p.as_dvec3());
                *b = b.grown((world - origin).as_vec3());
            }
        }
    }
    triangle_boxes
}

fn are_disjoint(a: &Aabb, b: &Aabb) -> bool {
    (0..3).any(|axis| a.min[axis] > b.max[axis] || b.min[axis] > a.max[axis])
}

/// `bounds`, enlarged by everything that a ray of length `distance` from inside may hit.
fn zone(bounds: &Aabb, distance: f64, whole: Aabb) -> Aabb {
    let size = whole.min.abs().max(whole.max.abs()).max_element();
    let ghost_layer = Vec3::splat((distance * 1.0001) as f32 + 1e-4 * size);
    if bounds.is_empty() {
        Aabb::EMPTY
    } else {
        Aabb::new(bounds.min - ghost_layer, bounds.max + ghost_layer)
    }
}

/// Chooses between requests and ghost zones, identically on all ranks, and builds the zones if they
/// are cheaper.
pub(super) fn choose(
    channel: &mut RankChannel<'_>,
    part: &mut Part,
    rank_bounds: &RankBounds,
    options: &FrameOptions,
    render: &RenderOptions,
    distance: f64,
) -> Result<Decision, FrameError> {
    let forward =
        |reason: String| Decision { distance, policy: SecondaryRayPolicy::Forward, reason };
    if options.secondary_rays == SecondaryRayPolicy::Forward {
        return Ok(forward("asked of the ranks in whose bounds rays come".into()));
    }
    let mut meshes = Vec::new();
    for geometry in part.scene.world.geometries() {
        match geometry {
            Geometry::Mesh(mesh) => meshes.push(mesh.clone()),
            Geometry::Shape(_) | Geometry::Slices(_) => {
                return Ok(forward(
                    "asked of the ranks in whose bounds rays come: ghost zones are made of \
                     triangles only, and the scene has other shapes"
                        .into(),
                ));
            }
        }
    }
    let (rank, size) = (channel.rank(), channel.size());
    let whole = part.scene.world.bounds();
    let zones: Vec<Aabb> = rank_bounds.bounds.iter().map(|b| zone(b, distance, whole)).collect();
    let placed: Vec<Vec<Aabb>> =
        meshes.iter().enumerate().map(|(g, mesh)| placed_boxes(&part.scene, g, mesh)).collect();

    // ---- Triangles for each other rank's zone, and the number of other parts near each triangle
    // of this one.
    let others =
        || (0..size).filter(|&r| r != rank && !are_disjoint(&zones[r], &rank_bounds.bounds[rank]));
    let mut wanted: Vec<Vec<Vec<u32>>> = vec![vec![Vec::new(); meshes.len()]; size];
    let (mut near_parts, mut triangles) = (0u64, 0u64);
    for (g, placed) in placed.iter().enumerate() {
        triangles += placed.len() as u64;
        for (t, b) in placed.iter().enumerate() {
            for r in others() {
                if !are_disjoint(b, &zones[r]) {
                    wanted[r][g].push(t as u32);
                    near_parts += 1;
                }
            }
        }
    }
    let give: Vec<u32> =
        wanted.iter().map(|w| w.iter().map(Vec::len).sum::<usize>() as u32).collect();
    let mut numbers = give;
    numbers.extend([triangles as u32, near_parts.min(u64::from(u32::MAX)) as u32]);
    let all = channel.all_gather(&numbers)?;
    for (from, numbers) in all.iter().enumerate() {
        check_announced(from, numbers).map_err(|reason| channel.announced_error(from, reason))?;
    }

    // ---- Both costs, for the rank with the most work.
    let sum = |f: &dyn Fn(&[u32]) -> f64| all.iter().map(|n| f(n)).sum::<f64>();
    let total = sum(&|n| f64::from(n[size])).max(1.0);
    let near = sum(&|n| f64::from(n[size + 1])) / total;
    let area = render.area();
    let pixels = f64::from(area.width) * f64::from(area.height) * f64::from(render.samples);
    let points = cost_model::COVERED * pixels / size as f64;
    let rays = f64::from(part.scene.ambient_occlusion.map_or(0, |ao| ao.rays));
    let ask_secs = 2.0 * cost_model::ROUND_SECS
        + points
            * near
            * (rays * cost_model::RAY_SECS + cost_model::POINT_BYTES * cost_model::BYTE_SECS);
    let frames = if let SecondaryRayPolicy::Auto { frames } = options.secondary_rays {
        frames.max(1)
    } else {
        1
    };
    let zone_secs = (0..size)
        .map(|r| {
            let ghost_layer: f64 = all.iter().map(|n| f64::from(n[r])).sum();
            let own = f64::from(all[r][size]);
            ghost_layer * cost_model::TRIANGLE_BYTES * cost_model::BYTE_SECS
                + (own + ghost_layer) * cost_model::BUILD_SECS
        })
        .fold(0.0, f64::max)
        / f64::from(frames);
    let ghost_share = sum(&|n| n[..size].iter().map(|&v| f64::from(v)).sum()) / total;
    let estimate = format!(
        "estimated {:.2} ms a frame to ask ({near:.2} other parts near a triangle), {:.2} ms for \
         ghost zones ({:.2}x the geometry, {frames} frames)",
        ask_secs * 1e3,
        zone_secs * 1e3,
        1.0 + ghost_share
    );
    if options.secondary_rays != SecondaryRayPolicy::GhostZones && ask_secs <= zone_secs {
        return Ok(forward(format!("asked of the ranks in whose bounds rays come: {estimate}")));
    }
    part.ghost_layer = Some((distance, fetch(channel, part, &meshes, &wanted, &all, options)?));
    Ok(Decision {
        distance,
        policy: SecondaryRayPolicy::GhostZones,
        reason: format!("ghost zones: {estimate}"),
    })
}

/// Checks the numbers of one rank: triangles that it gives to each rank, those it has, and other
/// parts near them. Buffers are sized by these numbers: a rank cannot give more triangles than it
/// has, and none to itself.
fn check_announced(from: usize, numbers: &[u32]) -> Result<(), String> {
    let [give @ .., triangles, _near] = numbers else {
        return Err(format!("{} numbers about ghost triangles", numbers.len()));
    };
    for (to, &given) in give.iter().enumerate() {
        if to == from && given > 0 {
            return Err(format!("{given} ghost triangles to itself"));
        }
        if given > *triangles {
            return Err(format!(
                "{given} ghost triangles to rank {to}, of {triangles} that it has"
            ));
        }
    }
    Ok(())
}

/// Exchanges the triangles and builds this rank's part with its ghost layer.
fn fetch(
    channel: &mut RankChannel<'_>,
    part: &Part,
    meshes: &[Arc<TriMesh>],
    wanted: &[Vec<Vec<u32>>],
    all: &[Vec<u32>],
    options: &FrameOptions,
) -> Result<Scene, FrameError> {
    let (rank, size) = (channel.rank(), channel.size());
    for step in 1..size {
        let to = (rank + step) % size;
        if all[rank][to] == 0 {
            continue;
        }
        let mut words = Vec::new();
        for (mesh, kept) in meshes.iter().zip(&wanted[to]) {
            let (some, _) = mesh.part(kept);
            words.extend([some.positions.len() as u32, some.indices.len() as u32]);
            words.extend(some.positions.iter().flat_map(|p| p.to_array().map(f32::to_bits)));
            words.extend(some.indices.as_flattened());
        }
        channel.send(to, Tag::Hits, &words)?;
    }
    // Light rays need no attributes.
    let mut merged: Vec<TriMesh> = meshes
        .iter()
        .map(|m| TriMesh {
            origin: m.origin,
            ..TriMesh::new(m.positions.clone(), m.indices.clone())
        })
        .collect();
    let most = |from: usize| 2 * merged.len() + 12 * all[from][rank] as usize;
    let sources: Vec<_> = (0..size)
        .filter(|&r| r != rank && all[r][rank] > 0)
        .map(|from| (from, most(from)))
        .collect();
    let mut came: Vec<(usize, Vec<u32>)> = Vec::new();
    channel.receive(Tag::Hits, "ghost triangles", sources, |_, from, words| {
        came.push((from, words));
        Ok(())
    })?;
    for (from, words) in came {
        let came = add_triangles(&mut merged, &words)
            .ok_or_else(|| channel.message_error(from, "ghost triangles", words.len()))?;
        let announced = all[from][rank];
        if came != announced as usize {
            let reason = format!("{announced} ghost triangles were announced, and {came} came");
            return Err(channel.announced_error(from, reason));
        }
    }
    let geometries = merged.into_iter().map(|m| Geometry::Mesh(Arc::new(m))).collect();
    let instances = part.scene.world.instances().to_vec();
    let whole = part.scene.world.global_layout();
    let build = |e| FrameError::Render(RenderError::Scene(SceneError::Build(e)));
    let world = World::build_part(geometries, instances, &whole, &options.build).map_err(build)?;
    let appearances = part.scene.appearances.iter().map(|a| Appearance::new(a.material)).collect();
    let mut scene = part.scene.clone();
    (scene.world, scene.appearances) = (Arc::new(world), appearances);
    Ok(scene)
}

/// Adds received triangles and returns their number. `None` when the words are invalid, or a mesh
/// would have more vertices than can be numbered.
fn add_triangles(meshes: &mut [TriMesh], mut words: &[u32]) -> Option<usize> {
    let mut came = 0;
    for mesh in meshes {
        let (&[vertices, triangles], rest) = words.split_first_chunk::<2>()?;
        let (positions, rest) = rest.split_at_checked((vertices as usize).checked_mul(3)?)?;
        let (indices, rest) = rest.split_at_checked((triangles as usize).checked_mul(3)?)?;
        words = rest;
        came += triangles as usize;
        // Below `u32::MAX`, which stands for an invalid vertex.
        let first = u32::try_from(mesh.positions.len()).ok()?;
        first.checked_add(vertices).filter(|&end| end < u32::MAX)?;
        let corner = |p: &[u32; 3]| Vec3::from_array(p.map(f32::from_bits));
        mesh.positions.extend(positions.as_chunks::<3>().0.iter().map(corner));
        // Indices past the end stay invalid: such triangles are left out of the structure.
        let moved = |t: &[u32; 3]| t.map(|k| if k < vertices { k + first } else { u32::MAX });
        mesh.indices.extend(indices.as_chunks::<3>().0.iter().map(moved));
    }
    words.is_empty().then_some(came)
}
