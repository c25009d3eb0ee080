//! Distribution of data to ranks: bricks of space by k-d splits, with about the same number of
//! primitives, or with the same work for a view.
use super::FrameError;
use super::volume_bricks::{self, BrickData, VolumeBricks};
use rt_core::bvh::{BuildOptions, Geometry};
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::glam::swizzles::Vec4Swizzles;
use rt_core::glam::{DAffine3, DVec3, UVec3};
use rt_core::math::SplitMix64;
use rt_core::scene::Scene;
use rt_core::volume::Brick;
use std::sync::Arc;

/// How primitives are distributed to ranks.
#[derive(Debug, Clone)]
pub enum Split {
    /// Bricks with the same number of primitives: the data-parallel partition of section 3.2.1.
    /// Does not depend on the view.
    Triangles,
    /// Bricks with the same expected work for one view. A primitive has a small base cost, and
    /// costs more the larger it is in the image. This is the view-dependent partition of section
    /// 3.2.2; another view needs another partition.
    View {
        /// The view.
        camera: Box<Camera>,
        /// Width and height of the image, pixels.
        size_px: [u32; 2],
    },
    /// Every primitive to any rank: no locality is left. For tests.
    Random {
        /// Seed of the random numbers.
        seed: u64,
    },
}

/// Which primitives every rank holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Partition {
    /// By rank and geometry, in ascending order.
    primitive_ids: Vec<Vec<Vec<u32>>>,
    /// Bricks of volumes.
    volume_bricks: Arc<VolumeBricks>,
}

/// What one rank holds.
#[derive(Clone)]
pub struct Part {
    /// The scene with this rank's primitives.
    pub scene: Scene,
    /// Which part of how many.
    pub rank: usize,
    /// Number of parts.
    pub parts: usize,
    /// The numbers of this part's primitives in the whole scene.
    pub(super) primitive_ids: PrimitiveIds,
    /// The effects that the whole scene needs.
    pub(super) needed: Effects,
    /// Who holds which bricks of volumes.
    pub(super) volume_bricks: Arc<VolumeBricks>,
    /// The data of those bricks that this rank holds, by brick number.
    pub(super) brick_data: Vec<Option<BrickData>>,
    /// This part with a ghost layer, see [`super::ghost`].
    pub(super) ghost_layer: Option<(f64, Scene)>,
}

/// The numbers of a part's primitives in the whole scene, by geometry.
#[derive(Clone)]
pub(super) enum PrimitiveIds {
    /// Any numbers, ascending.
    Lists(Vec<Vec<u32>>),
    /// A first number, and how many follow each other from there.
    Ranges(Vec<(u32, u32)>),
}

impl PrimitiveIds {
    /// The number of the part's primitive `primitive` of geometry `geometry`.
    pub(super) fn of(&self, geometry: usize, primitive: u32) -> u32 {
        match self {
            PrimitiveIds::Lists(lists) => lists[geometry][primitive as usize],
            PrimitiveIds::Ranges(ranges) => ranges[geometry].0 + primitive,
        }
    }
}

impl Part {
    /// Number of primitives in this part.
    pub fn primitives(&self) -> usize {
        match &self.primitive_ids {
            PrimitiveIds::Lists(lists) => lists.iter().map(Vec::len).sum(),
            PrimitiveIds::Ranges(ranges) => ranges.iter().map(|r| r.1 as usize).sum(),
        }
    }

    /// Number of grid values of volumes in this part, including the layers around bricks.
    pub fn volume_values(&self) -> usize {
        let whole = self.scene.volumes.iter().filter(|v| !v.volume.is_medium());
        let whole: usize = whole.map(|v| v.volume.grid().values().len()).sum();
        whole + self.brick_data.iter().flatten().map(BrickData::num_values).sum::<usize>()
    }
}

/// A primitive to be assigned to a rank.
struct Item {
    geometry: u32,
    primitive: u32,
    center: DVec3,
    work: f64,
}

impl Partition {
    /// Cuts `scene` into `parts` parts. Geometries with several instances are cut where their first
    /// instance is.
    pub fn new(scene: &Scene, parts: usize, split: &Split) -> Partition {
        let parts = parts.max(1);
        let geometries = scene.world.geometries().len();
        let mut primitive_ids = vec![vec![Vec::new(); geometries]; parts];
        let volume_bricks = Arc::new(VolumeBricks::one_per_rank(scene, parts));
        if let Split::Random { seed } = split {
            for (g, geometry) in scene.world.geometries().iter().enumerate() {
                for p in 0..geometry.num_primitives() as u32 {
                    let mut random = SplitMix64::new(*seed ^ (g as u64) << 40 ^ u64::from(p));
                    let rank = random.bits() % parts as u64;
                    primitive_ids[rank as usize][g].push(p);
                }
            }
            return Partition { primitive_ids, volume_bricks };
        }
        let mut items = items(scene, split);
        let mut give = |rank: usize, items: &[Item]| {
            for i in items {
                primitive_ids[rank][i.geometry as usize].push(i.primitive);
            }
        };
        split_items(&mut items, 0, parts, &mut give);
        for list in primitive_ids.iter_mut().flatten() {
            list.sort_unstable();
        }
        Partition { primitive_ids, volume_bricks }
    }

    /// Distributes a volume of `scene` differently: cuts it into as many bricks as `holders` has
    /// lists, and all ranks of a list hold its brick. With one list of all ranks, every rank holds
    /// the whole volume. Without this call every rank has one brick.
    ///
    /// # Errors
    /// [`FrameError::Holders`] for volumes and ranks that do not exist, bricks without a holder,
    /// and projections, which need whole volumes.
    pub fn distribute_volume(
        mut self,
        scene: &Scene,
        volume: usize,
        holders: &[Vec<usize>],
    ) -> Result<Partition, FrameError> {
        let holders = volume_bricks::checked(scene, volume, holders, self.parts())?;
        Arc::make_mut(&mut self.volume_bricks).cut(scene, volume, &holders);
        Ok(self)
    }

    /// Number of parts.
    pub fn parts(&self) -> usize {
        self.primitive_ids.len()
    }

    /// Primitives of each part.
    pub fn sizes(&self) -> Vec<usize> {
        self.primitive_ids.iter().map(|part| part.iter().map(Vec::len).sum()).collect()
    }

    /// Of each geometry, the primitives of part `rank`.
    pub fn primitives(&self, rank: usize) -> &[Vec<u32>] {
        &self.primitive_ids[rank]
    }

    /// Builds part `rank` of `scene`, the scene that was cut.
    ///
    /// # Errors
    /// [`FrameError::Ranks`] when there is no such part, [`FrameError::Scene`] when it cannot be
    /// built.
    pub fn part(
        &self,
        scene: &Scene,
        rank: usize,
        options: &BuildOptions,
    ) -> Result<Part, FrameError> {
        let parts = self.parts();
        let primitive_ids = self
            .primitive_ids
            .get(rank)
            .ok_or(FrameError::Ranks { parts, ranks: rank + 1 })?
            .clone();
        let mut part = scene.part(&primitive_ids, options)?;
        // Of media only sizes and positions remain here; bricks are stored separately.
        for placed in part.volumes.iter_mut().filter(|placed| placed.volume.is_medium()) {
            let nothing = Brick { first: UVec3::ZERO, end: UVec3::ZERO };
            placed.volume = Arc::new(placed.volume.part(nothing));
        }
        let (needed, volume_bricks) = (Effects::required_by(scene), self.volume_bricks.clone());
        let brick_data = volume_bricks.brick_data(scene, rank);
        Ok(Part {
            scene: part,
            rank,
            parts,
            primitive_ids: PrimitiveIds::Lists(primitive_ids),
            needed,
            volume_bricks,
            brick_data,
            ghost_layer: None,
        })
    }
}

fn items(scene: &Scene, split: &Split) -> Vec<Item> {
    let mut out = Vec::new();
    for (g, geometry) in scene.world.geometries().iter().enumerate() {
        let first = scene.world.instances().iter().find(|i| i.geometry == g);
        let place = first.map_or(DAffine3::IDENTITY, |i| i.world_from_object);
        for p in 0..geometry.num_primitives() {
            let [lo, hi] = box_of(geometry, p);
            // A primitive that cannot be hit may be anywhere.
            let (lo, hi) = if lo.is_finite() && hi.is_finite() {
                (lo, hi)
            } else {
                (DVec3::ZERO, DVec3::ZERO)
            };
            let center = place.transform_point3(0.5 * (lo + hi));
            let radius = place.transform_vector3(0.5 * (hi - lo)).length();
            let work = match split {
                Split::View { camera, size_px } => {
                    0.05 + pixels_of(camera, *size_px, center, radius)
                }
                _ => 1.0,
            };
            out.push(Item { geometry: g as u32, primitive: p as u32, center, work });
        }
    }
    out
}

/// Corners of a primitive's bounding box, object space in f64.
fn box_of(geometry: &Geometry, primitive: usize) -> [DVec3; 2] {
    match geometry {
        Geometry::Mesh(mesh) => {
            let corners = mesh.indices[primitive].map(|k| {
                mesh.positions.get(k as usize).map_or(DVec3::NAN, |p| mesh.origin + p.as_dvec3())
            });
            // The minimum of f64 would ignore NaN.
            if corners.iter().any(|c| !c.is_finite()) {
                return [DVec3::NAN; 2];
            }
            let [a, b, c] = corners;
            [a.min(b).min(c), a.max(b).max(c)]
        }
        Geometry::Shape(shape) => {
            let b = shape.bounds(primitive as u32);
            [shape.origin() + b.min.as_dvec3(), shape.origin() + b.max.as_dvec3()]
        }
        // Scene::part refuses them by name.
        Geometry::Slices(_) => [DVec3::NAN; 2],
    }
}

/// Pixels that a ball covers in the image, about; 0 if it is outside. Occlusion is not considered.
fn pixels_of(camera: &Camera, size_px: [u32; 2], center: DVec3, radius: f64) -> f64 {
    let matrix = camera.clip_from_world();
    let clip = matrix * center.extend(1.0);
    let size = size_px.map(f64::from);
    // Scale of the image at the ball's depth.
    let across = matrix.row(0).xyz().length() * 0.5 * size[0];
    let w = clip.w.abs().max(1e-9 * radius.max(f64::MIN_POSITIVE));
    let reach = radius * across / w;
    let x = (clip.x / w + 1.0) * 0.5 * size[0];
    let y = (1.0 - clip.y / w) * 0.5 * size[1];
    let inside =
        clip.w > 0.0 && x >= -reach && y >= -reach && x <= size[0] + reach && y <= size[1] + reach;
    if inside { (reach * reach).min(size[0] * size[1]) } else { 0.0 }
}

/// Assigns `items` to `ranks` ranks from `first_rank` on, by recursive bisection along the longest
/// axis of their centres.
fn split_items(
    items: &mut [Item],
    first_rank: usize,
    ranks: usize,
    give: &mut impl FnMut(usize, &[Item]),
) {
    if ranks == 1 {
        give(first_rank, items);
        return;
    }
    let lower = ranks / 2;
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for i in items.iter() {
        (lo, hi) = (lo.min(i.center), hi.max(i.center));
    }
    let axis = (0..3).max_by(|&a, &b| (hi[a] - lo[a]).total_cmp(&(hi[b] - lo[b]))).unwrap_or(0);
    // Ties are sorted by number: every rank must cut identically.
    items.sort_unstable_by(|a, b| {
        let key = |i: &Item| (i.geometry, i.primitive);
        a.center[axis].total_cmp(&b.center[axis]).then(key(a).cmp(&key(b)))
    });
    let total: f64 = items.iter().map(|i| i.work).sum();
    let share = total * lower as f64 / ranks as f64;
    let mut done = 0.0;
    let cut = items
        .iter()
        .position(|i| {
            done += i.work;
            done - 0.5 * i.work >= share
        })
        .unwrap_or(items.len());
    let (below, above) = items.split_at_mut(cut);
    split_items(below, first_rank, lower, give);
    split_items(above, first_rank + lower, ranks - lower, give);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::bvh::World;
    use rt_core::glam::Vec3;
    use rt_core::mesh::TriMesh;

    fn line(triangles: u32) -> Scene {
        let mut mesh = TriMesh::default();
        for k in 0..triangles {
            let x = k as f32;
            mesh.positions.extend([
                Vec3::new(x, 0.0, 0.0),
                Vec3::new(x + 0.5, 0.0, 0.0),
                Vec3::new(x, 1.0, 0.0),
            ]);
            mesh.indices.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        Scene::new(World::from_mesh(mesh, &BuildOptions::default()).unwrap())
    }

    #[test]
    fn every_primitive_is_dealt_once_and_bricks_are_balanced() {
        let scene = line(1000);
        for parts in [1, 2, 3, 5, 64, 127, 1000, 1200] {
            for split in [Split::Triangles, Split::Random { seed: 4 }] {
                let partition = Partition::new(&scene, parts, &split);
                let mut all: Vec<u32> =
                    (0..parts).flat_map(|r| partition.primitives(r)[0].clone()).collect();
                all.sort_unstable();
                assert!(all.iter().copied().eq(0..1000), "{parts} parts, {split:?}");
                if matches!(split, Split::Triangles) {
                    let sizes = partition.sizes();
                    let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                    assert!(most - least <= 1 + 1000 / parts / 4, "{parts} parts: {least}..{most}");
                }
            }
        }
    }

    #[test]
    fn the_same_cuts_on_every_rank_also_where_centres_agree() {
        let mut mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]; 64]);
        mesh.indices.push([0, 1, 99]);
        let scene = Scene::new(World::from_mesh(mesh, &BuildOptions::default()).unwrap());
        let cut = || Partition::new(&scene, 7, &Split::Triangles);
        assert_eq!(cut(), cut());
        assert_eq!(
            cut().sizes().iter().sum::<usize>(),
            65,
            "unusable triangles are somewhere, too"
        );
    }

    #[test]
    fn a_view_gives_more_ranks_to_what_is_large_in_it() {
        // The camera looks at the first hundred triangles only.
        let eye = DVec3::new(50.0, 0.5, 40.0);
        let at = DVec3::new(50.0, 0.5, 0.0);
        let camera = Camera::perspective(eye, at, DVec3::Y, 1.79, 1.0, [0.1, 1e4]).unwrap();
        let scene = line(1000);
        let split = Split::View { camera: Box::new(camera), size_px: [512, 512] };
        let partition = Partition::new(&scene, 8, &split);
        let in_view =
            (0..8).filter(|&r| partition.primitives(r)[0].iter().all(|&t| t < 120)).count();
        assert!(in_view >= 5, "{:?}", partition.sizes());
        let plain = Partition::new(&scene, 8, &Split::Triangles);
        assert_eq!((0..8).filter(|&r| plain.primitives(r)[0].iter().all(|&t| t < 120)).count(), 0);
    }
}
