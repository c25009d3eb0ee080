//! Scenes of which every rank gives what it has: the image of one node that holds the sum.
use crate::scenes::{self, AMBIENT, Case, camera, matte, options};
use crate::volumes::three;
use crate::{assert_same, frame_options, one_node};
use composite::render::{
    DataParallel, DistributedVolume, FrameError, FrameOptions, FrameOutput, PointBrick, RankScene,
    SecondaryRayPolicy,
};
use composite::{Communicator, threads};
use rt_core::bvh::Geometry;
use rt_core::frame::Layers;
use rt_core::glam::{DAffine3, DVec3, UVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::math::SplitMix64;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::RenderOptions;
use rt_core::scene::{Scene, SceneBuilder};
use rt_core::volume::{GridExtent, Interpolation};
use std::sync::Arc;
use std::time::Duration;

/// What one of many ranks has of a scene: the `rank`th run of primitives of each geometry, and a
/// brick of each volume with `ghosts` layers of points around it.
pub(crate) fn share(scene: &Scene, rank: usize, ranks: usize, ghosts: u32) -> RankScene {
    let mut out = settings_of(scene);
    for (g, geometry) in scene.world.geometries().iter().enumerate() {
        let n = geometry.num_primitives();
        let at = |r: usize| (n * r / ranks) as u32;
        let kept: Vec<u32> = (at(rank)..at(rank + 1)).collect();
        let name = format!("object {g:02}");
        let placed = || {
            scene.world.instances().iter().zip(&scene.appearances).filter(|(i, _)| i.geometry == g)
        };
        let material = placed().next().map_or(0, |(_, look)| look.material);
        match geometry {
            Geometry::Mesh(mesh) => out.mesh(name, mesh.part(&kept).0, material),
            Geometry::Shape(shape) => {
                out.shape(name, shape.part(&kept).expect("it can be cut"), material);
            }
            Geometry::Slices(_) => unreachable!("no scene has them"),
        }
        out.place(placed().map(|(i, _)| i.world_from_object).collect());
    }
    for (v, placed) in scene.volumes.iter().enumerate() {
        let grid = placed.volume.grid();
        out.volume(DistributedVolume {
            name: format!("volume {v}"),
            whole: GridExtent { dims: grid.dims(), origin: grid.origin(), spacing: grid.spacing() },
            transfer: placed.volume.transfer_function().clone(),
            options: placed.volume.options().clone(),
            world_from_object: placed.world_from_object,
            bricks: bricks_of(placed, rank, ranks, ghosts),
        });
    }
    out
}

/// The settings of a scene, which every rank gives.
fn settings_of(scene: &Scene) -> RankScene {
    let mut out = RankScene::new();
    out.materials = scene.materials.clone();
    out.lights = scene.lights.clone();
    out.environment = scene.environment.clone();
    out.background = scene.background;
    out.ambient_occlusion = scene.ambient_occlusion;
    out
}

/// The bricks of one of many ranks: two where there are few ranks, so that some lie apart.
fn bricks_of(
    placed: &rt_core::scene::VolumeInstance,
    rank: usize,
    ranks: usize,
    ghosts: u32,
) -> Vec<PointBrick> {
    if ranks > 4 {
        return brick(placed, rank, ranks, ghosts).into_iter().collect();
    }
    [rank, ranks + rank].iter().filter_map(|k| brick(placed, *k, 2 * ranks, ghosts)).collect()
}

/// The brick of one of many ranks: a slab of a slab, so that bricks meet at edges. Some ranks have
/// none where there are too few points.
fn brick(
    placed: &rt_core::scene::VolumeInstance,
    rank: usize,
    ranks: usize,
    ghosts: u32,
) -> Option<PointBrick> {
    let grid = placed.volume.grid();
    let dims = grid.dims();
    let across = if ranks.is_multiple_of(2) { 2 } else { 1 };
    let along = ranks / across;
    let shared = u32::from(placed.volume.options().interpolation != Interpolation::Nearest);
    let cut = |points: u32, k: usize, n: usize| {
        let cells = (points - shared) as usize;
        let (low, high) = ((cells * k / n) as u32, (cells * (k + 1) / n) as u32 + shared);
        // An empty slab has no cell.
        (high - low > shared).then(|| (low.saturating_sub(ghosts), (high + ghosts).min(points)))
    };
    let (x0, x1) = cut(dims.x, rank % along, along)?;
    let (z0, z1) = cut(dims.z, rank / along, across)?;
    let (first, end) = (UVec3::new(x0, 0, z0), UVec3::new(x1, dims.y, z1));
    let mut values = Vec::new();
    for k in first.z..end.z {
        for j in first.y..end.y {
            values.extend((first.x..end.x).map(|i| grid.at(i, j, k)));
        }
    }
    Some(PointBrick { first, dims: end - first, values: values.into() })
}

/// One frame of many ranks, of which each makes its own scene. The last one has the image.
fn frame_of(
    case: &Case,
    ranks: usize,
    policy: SecondaryRayPolicy,
    scene: impl Fn(usize) -> RankScene + Sync,
) -> Vec<FrameOutput> {
    let outputs = threads::run(ranks, |mut comm| {
        let scene = scene(comm.rank());
        let options = FrameOptions { root: Some(ranks - 1), ..frame_options(policy) };
        let mut renderer = DataParallel::distributed(&mut comm, scene, options)?;
        renderer.frame(&mut comm, &case.camera, &case.options)
    });
    outputs.into_iter().map(|o: Result<Result<_, FrameError>, _>| o.unwrap().unwrap()).collect()
}

fn assert_shares_make(case: &Case, ranks: usize, policy: SecondaryRayPolicy, ghosts: u32) {
    let expected = one_node(case);
    let outputs = frame_of(case, ranks, policy, |rank| share(&case.scene, rank, ranks, ghosts));
    assert_same(&expected, &outputs, &format!("{}, {ranks} ranks", case.name));
}

#[test]
fn scenes_made_where_their_parts_are_by_1_to_16_ranks_have_the_bits_of_one_node() {
    for shift in [DVec3::ZERO, DVec3::new(4e6, -3e6, 1e6)] {
        let mut case = scenes::shadows_and_occlusion(shift);
        (case.options.width, case.options.height) = (75, 61);
        for ranks in 1..=16 {
            assert_shares_make(&case, ranks, SecondaryRayPolicy::Forward, 0);
        }
    }
}

#[test]
fn mirrors_glass_layers_and_paths_of_distributed_scenes_have_the_bits_of_one_node() {
    for case in scenes::several_bounces() {
        for ranks in [3, 16] {
            assert_shares_make(&case, ranks, SecondaryRayPolicy::Forward, 0);
        }
    }
}

#[test]
fn tubes_cylinders_and_spheres_of_distributed_scenes_have_the_bits_of_one_node() {
    let case = scenes::arrays_of_shapes();
    for ranks in [2, 7] {
        assert_shares_make(&case, ranks, SecondaryRayPolicy::Forward, 0);
    }
}

#[test]
fn streamed_tiles_and_ghost_zones_of_distributed_scenes_have_the_bits_of_one_node() {
    let mut streamed = scenes::headlight(1);
    streamed.options.layers = Layers::COLOR;
    for ranks in [2, 9] {
        assert_shares_make(&streamed, ranks, SecondaryRayPolicy::Forward, 0);
        assert_shares_make(&scenes::occlusion_alone(), ranks, SecondaryRayPolicy::GhostZones, 0);
    }
}

#[test]
fn bricks_of_volumes_that_no_rank_has_whole_have_the_bits_of_one_node() {
    for case in scenes::volumes() {
        // The smallest case also with more ranks than blocks along an axis.
        let most =
            if case.name == "volume alone" { &[(16, 0), (2, 0), (6, 2)][..] } else { &[(3, 1)] };
        for &(ranks, ghosts) in most {
            assert_shares_make(&case, ranks, SecondaryRayPolicy::Forward, ghosts);
        }
    }
}

#[test]
fn volumes_that_overlap_in_distributed_scenes_have_the_bits_of_one_node() {
    let mut scene = SceneBuilder::new().build().unwrap();
    scene.volumes = three();
    let options = RenderOptions { width: 100, height: 81, layers: Layers::COLOR, ..options() };
    let case = Case { name: "volumes that overlap", scene, camera: camera(DVec3::ZERO), options };
    for (ranks, ghosts) in [(2, 0), (5, 1), (12, 3)] {
        assert_shares_make(&case, ranks, SecondaryRayPolicy::Forward, ghosts);
    }
}

/// Triangles of `mesh` in another order, with the attributes that belong to them.
fn in_order(mesh: &TriMesh, order: &[u32]) -> TriMesh {
    let mut out = mesh.clone();
    out.indices = order.iter().map(|&t| mesh.indices[t as usize]).collect();
    if let Some(colors) = &mesh.colors {
        let values = order.iter().map(|&t| colors.values[t as usize]).collect();
        out.colors = Some(Attribute { per: colors.per, values });
    }
    out
}

#[test]
fn parts_that_overlap_in_space_have_the_bits_of_their_sum() {
    const RANKS: usize = 5;
    let mut random = SplitMix64::new(7);
    let whole = scenes::bumps(DVec3::ZERO, 48);
    // Every triangle on any rank, so that all parts lie over each other; rank 2 has none.
    let owner: Vec<usize> =
        whole.indices.iter().map(|_| [0, 1, 3, 4][(random.bits() % 4) as usize]).collect();
    let owner = &owner;
    let of = |rank: usize| (0..owner.len() as u32).filter(move |&t| owner[t as usize] == rank);
    let pieces: Vec<TriMesh> =
        (0..RANKS).map(|rank| in_order(&whole, &of(rank).collect::<Vec<_>>())).collect();
    let order: Vec<u32> = (0..RANKS).flat_map(of).collect();
    // Objects that one rank has alone come before and behind it in the list.
    let box_at = |x: f64| {
        let mut mesh = scenes::bumps(DVec3::ZERO, 4);
        let move_by = |p: Vec3| 0.2 * p + Vec3::new(x as f32, 0.4, 0.9);
        mesh.positions.iter_mut().for_each(|p| *p = move_by(*p));
        (mesh.colors, mesh.normals) = (None, None);
        mesh
    };
    let sun = Light::directional(DVec3::new(0.6, -0.3, 0.7));
    let mut b = SceneBuilder::new();
    b.mesh(box_at(-1.0), Material::metal([0.9; 3], 0.0));
    b.mesh(in_order(&whole, &order), matte());
    b.mesh(box_at(1.0), matte().with_opacity(0.5));
    b.light(sun);
    b.light(Light::ambient(AMBIENT));
    let (scene, camera) = (b.build().unwrap(), camera(DVec3::ZERO));
    let case = Case { name: "parts that overlap", scene, camera, options: options() };
    let outputs = frame_of(&case, RANKS, SecondaryRayPolicy::Forward, |rank| {
        let mut mine = settings_of(&case.scene);
        mine.mesh("ground", pieces[rank].clone(), 1);
        match rank {
            2 => mine.mesh("zeppelin", box_at(1.0), 2),
            3 => mine.mesh("balloon", box_at(-1.0), 0),
            _ => {}
        }
        mine
    });
    assert_same(&one_node(&case), &outputs, case.name);
}

#[test]
fn a_part_that_moves_between_frames_has_the_bits_of_one_node_again() {
    const RANKS: usize = 4;
    let ground = Arc::new(scenes::bumps(DVec3::ZERO, 48));
    let ball = |step: usize| {
        let mut mesh = scenes::bumps(DVec3::ZERO, 8);
        // In the second step it leaves the bounds of all others, in the third it is gone.
        let at = [Vec3::new(0.3, 0.2, 1.0), Vec3::new(1.9, 1.6, 2.2)];
        mesh.positions.iter_mut().for_each(|p| *p = 0.25 * *p + at[step.min(1)]);
        Arc::new(mesh)
    };
    let steps: Vec<Arc<TriMesh>> = (0..2).map(ball).collect();
    let case_of = |step: usize| {
        let mut b = SceneBuilder::new();
        let m = [b.material(matte()), b.material(Material::metal([0.8; 3], 0.1))];
        for (k, material) in m.into_iter().enumerate() {
            let mesh = match (k, steps.get(step)) {
                (0, _) => ground.clone(),
                (_, Some(ball)) => ball.clone(),
                (_, None) => continue,
            };
            let g = b.geometry(Geometry::Mesh(mesh));
            b.instance(g, DAffine3::IDENTITY, rt_core::scene::Appearance::new(material));
        }
        b.light(Light::point(DVec3::new(1.0, 1.0, 4.0)));
        b.light(Light::ambient(AMBIENT));
        let (scene, camera) = (b.build().unwrap(), camera(DVec3::ZERO));
        Case { name: "a part that moves", scene, camera, options: options() }
    };
    let cases: Vec<Case> = (0..3).map(case_of).collect();
    let pieces: Vec<Arc<TriMesh>> = (0..RANKS)
        .map(|rank| {
            let n = ground.indices.len();
            let kept: Vec<u32> =
                (n * rank / RANKS..n * (rank + 1) / RANKS).map(|t| t as u32).collect();
            Arc::new(ground.part(&kept).0)
        })
        .collect();
    let outputs = threads::run(RANKS, |mut comm| {
        let rank = comm.rank();
        let scene_of = |step: usize| {
            let mut mine = settings_of(&cases[step].scene);
            mine.mesh("a ground", pieces[rank].clone(), 0);
            if let Some(ball) = steps.get(step).filter(|_| rank == 1) {
                mine.mesh("ball", ball.clone(), 1);
            }
            mine
        };
        let options =
            FrameOptions { root: Some(RANKS - 1), ..frame_options(SecondaryRayPolicy::Forward) };
        let mut renderer = DataParallel::distributed(&mut comm, scene_of(0), options)?;
        let mut frames = Vec::new();
        for (step, case) in cases.iter().enumerate() {
            if step > 0 {
                renderer.replace(&mut comm, scene_of(step))?;
            }
            frames.push(renderer.frame(&mut comm, &case.camera, &case.options)?);
        }
        Ok::<_, FrameError>(frames)
    });
    let outputs: Vec<Vec<FrameOutput>> =
        outputs.into_iter().map(|frames| frames.unwrap().unwrap()).collect();
    for (step, case) in cases.iter().enumerate() {
        let of_step: Vec<FrameOutput> = outputs.iter().map(|o| o[step].clone()).collect();
        assert_same(&one_node(case), &of_step, &format!("step {step}"));
    }
}

/// The errors of all ranks when rank 2 of 4 changes its scene; then the group renders without the
/// change.
fn errors_of(change: impl Fn(&mut RankScene) + Sync) -> Vec<String> {
    let case = scenes::shadows_and_occlusion(DVec3::ZERO);
    let ends = threads::run(4, |mut comm| {
        let mut scene = share(&case.scene, comm.rank(), 4, 0);
        if comm.rank() == 2 {
            change(&mut scene);
        }
        let options = FrameOptions { timeout: Duration::from_secs(20), ..FrameOptions::default() };
        let error = DataParallel::distributed(&mut comm, scene, options.clone())
            .err()
            .expect("a rank is at fault");
        let scene = share(&case.scene, comm.rank(), 4, 0);
        assert!(DataParallel::distributed(&mut comm, scene, options).is_ok(), "still usable");
        error.to_string()
    });
    ends.into_iter().map(|end| end.expect("no rank panics")).collect()
}

#[test]
fn ranks_that_contradict_each_other_are_named_with_the_field_on_every_rank() {
    type Change = fn(&mut RankScene);
    let cases: [(&str, &str, Change); 10] = [
        ("lights", "0.color", |s| s.lights[0].color = [0.5; 3]),
        ("lights", "2", |s| s.lights.truncate(2)),
        ("materials", "1.opacity", |s| s.materials[1].opacity = 0.5),
        ("background", "bottom", |s| {
            s.background = rt_core::environment::Background::Gradient {
                bottom: [0.5; 3],
                top: [0.6, 0.7, 0.9],
            };
        }),
        ("ambient occlusion", "distance", |s| {
            if let Some(ao) = &mut s.ambient_occlusion {
                ao.distance = 7.0;
            }
        }),
        ("build options", "quality", |s| {
            s.build_options.quality = rt_core::bvh::BuildQuality::Fast
        }),
        ("object `wall`", "material", |s| s.mesh("wall", scenes::bumps(DVec3::ZERO, 2), 1)),
        ("object `wall`", "origin.y", |s| s.mesh("wall", scenes::bumps(DVec3::Y, 2), 0)),
        ("object `wall`", "normals", |s| {
            let mesh = TriMesh { normals: None, ..scenes::bumps(DVec3::ZERO, 2) };
            s.mesh("wall", mesh, 0);
        }),
        ("object `wall`", "places", |s| {
            s.mesh("wall", scenes::bumps(DVec3::ZERO, 2), 0);
            s.place(vec![DAffine3::from_translation(DVec3::X)]);
        }),
    ];
    let case = scenes::shadows_and_occlusion(DVec3::ZERO);
    for (what, field, change) in cases {
        let ends = threads::run(4, |mut comm| {
            let scene = |changed: bool| {
                let mut scene = share(&case.scene, comm.rank(), 4, 0);
                if changed && comm.rank() == 2 {
                    change(&mut scene);
                } else if what == "object `wall`" {
                    scene.mesh("wall", scenes::bumps(DVec3::ZERO, 2), 0);
                }
                scene
            };
            let (wrong, right) = (scene(true), scene(false));
            let options =
                FrameOptions { timeout: Duration::from_secs(20), ..FrameOptions::default() };
            let error = DataParallel::distributed(&mut comm, wrong, options.clone()).err();
            let usable = DataParallel::distributed(&mut comm, right, options).is_ok();
            (error, usable)
        });
        for end in ends {
            let (error, usable) = end.expect("no rank panics");
            let Some(FrameError::Contradiction { what: w, field: f, values }) = &error else {
                panic!("{what}, {field}: {error:?}")
            };
            assert_eq!((w.as_str(), f.as_str()), (what, field), "{values}");
            assert!(
                values.contains("on rank 2") && values.contains("on ranks 0, 1, 3"),
                "{values}"
            );
            assert!(usable, "the communicator is still usable");
        }
    }
}

#[test]
fn a_camera_and_options_that_differ_end_the_frame_alone_and_name_the_ranks() {
    let case = scenes::headlight(1);
    let ends = threads::run(3, |mut comm| {
        let scene = share(&case.scene, comm.rank(), 3, 0);
        let options = frame_options(SecondaryRayPolicy::Forward);
        let mut renderer = DataParallel::distributed(&mut comm, scene, options)?;
        let odd = comm.rank() == 1;
        let moved = if odd { camera(DVec3::X) } else { case.camera };
        let first = renderer.frame(&mut comm, &moved, &case.options).map(|_| ());
        let samples = if odd { 2 } else { 1 };
        let other = RenderOptions { samples, ..case.options.clone() };
        let second = renderer.frame(&mut comm, &case.camera, &other).map(|_| ());
        let third = renderer.frame(&mut comm, &case.camera, &case.options).map(|_| ());
        Ok::<_, FrameError>([first, second, third])
    });
    for end in ends {
        let [first, second, third] = end.expect("no rank panics").expect("the scene is right");
        let (first, second) = (first.unwrap_err().to_string(), second.unwrap_err().to_string());
        assert!(first.contains("camera") && first.contains("on ranks 0, 2"), "{first}");
        assert!(second.contains("samples: 1 on ranks 0, 2; 2 on rank 1"), "{second}");
        assert_eq!(third, Ok(()));
    }
}

#[test]
fn what_one_rank_gives_and_cannot_be_rendered_is_an_error_with_its_name_on_all() {
    type Change = fn(&mut RankScene);
    let cases: [(&str, Change); 5] = [
        ("object `twin`: it is there twice", |s| {
            s.mesh("twin", scenes::bumps(DVec3::ZERO, 2), 0);
            s.mesh("twin", scenes::bumps(DVec3::ZERO, 2), 0);
        }),
        ("object `wall`: mesh attribute `normals` has 1 values", |s| {
            let normals = Some(Attribute::per_vertex(vec![Vec3::Z]));
            s.mesh("wall", TriMesh { normals, ..scenes::bumps(DVec3::ZERO, 2) }, 0);
        }),
        ("object `wall`: it has material 9", |s| {
            s.mesh("wall", scenes::bumps(DVec3::ZERO, 2), 9);
        }),
        ("object `wall`: its origin is", |s| {
            s.mesh("wall", scenes::bumps(DVec3::new(0.0, f64::NAN, 0.0), 2), 0);
        }),
        ("object `wall`: its place 0 cannot be inverted", |s| {
            s.mesh("wall", scenes::bumps(DVec3::ZERO, 2), 0);
            s.place(vec![DAffine3::ZERO]);
        }),
    ];
    for (words, change) in cases {
        for error in errors_of(change) {
            assert!(error.contains("rank 2 gives") && error.contains(words), "{words}: {error}");
        }
    }
}

#[test]
fn a_hole_between_bricks_is_an_error_on_every_rank() {
    let case = scenes::volumes().pop().expect("there are some");
    let ends = threads::run(4, |mut comm| {
        let mut scene = share(&case.scene, comm.rank(), 4, 0);
        if comm.rank() == 3 {
            scene.volumes_mut()[0].bricks.clear();
        }
        DataParallel::distributed(&mut comm, scene, FrameOptions::default()).err()
    });
    for end in ends {
        let error = end.expect("no rank panics").expect("a brick is missing").to_string();
        assert!(error.contains("volume `volume 0`: bricks: no rank has the cell"), "{error}");
    }
}
