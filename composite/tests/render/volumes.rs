//! Several volumes that overlap each other and surfaces, in bricks or whole on some ranks.
use super::scenes::{self, AMBIENT, Case, camera, matte, options};
use super::{assert_same, dealt, differing_pixels, many, one_node, values_held};
use composite::render::{FrameError, Partition, SecondaryRayPolicy, Split};
use rt_core::colormap::ColorMap;
use rt_core::frame::Layers;
use rt_core::glam::{DAffine3, DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::render::{RenderOptions, render};
use rt_core::scene::{SceneBuilder, VolumeInstance};
use rt_core::stored_volume::{StoredVolume, StoredVolumeWriter, ValueType, VolumeLayout};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{
    Blend, GradientOpacity, Interpolation, Volume, VolumeOptions, VolumeQuality, VolumeShading,
};

/// A box from `origin` with `size`, filled with a wave pattern on `dims` points, in the colours
/// from `low` to `high`.
fn wave_volume(
    dims: [u32; 3],
    origin: DVec3,
    size: DVec3,
    [low, high]: [[f32; 3]; 2],
    opacity: f32,
    volume: VolumeOptions,
) -> Volume {
    let dims = UVec3::from_array(dims);
    let spacing = size / (dims - 1).as_dvec3();
    let value = |k: u32| {
        let p =
            UVec3::new(k % dims.x, k / dims.x % dims.y, k / dims.x / dims.y).as_dvec3() * spacing;
        let at = p.as_vec3() * 4.0 + Vec3::splat(opacity);
        // Transparent at one side, and one point is missing.
        if k == 777 { f32::NAN } else { 0.5 + 0.5 * at.x.sin() * at.y.cos() * (at.z + 0.7).sin() }
    };
    let grid =
        Grid::new(dims, origin, spacing, (0..dims.element_product()).map(value).collect()).unwrap();
    let rgba = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
    let colors = ColorMap::new(vec![rgba(low), rgba(high)], [0.0, 1.0]);
    let points = [[0.35, 0.0], [0.6, 0.4 * opacity], [1.0, opacity]];
    let transfer = TransferFunction::from_opacity(colors, &points, 0.4).unwrap();
    Volume::new(grid.into(), transfer, volume).unwrap()
}

const BLUE: [[f32; 3]; 2] = [[0.0, 0.1, 0.6], [0.3, 0.8, 1.0]];
const RED: [[f32; 3]; 2] = [[0.5, 0.0, 0.0], [1.0, 0.9, 0.2]];
const GREEN: [[f32; 3]; 2] = [[0.0, 0.3, 0.0], [0.6, 1.0, 0.4]];

fn shaded() -> VolumeOptions {
    let shading = VolumeShading {
        ambient: 0.3,
        diffuse: 0.7,
        specular: 0.4,
        shininess: 9.0,
        half_gradient: 1.0,
        ..VolumeShading::default()
    };
    VolumeOptions { shading: Some(shading), ..VolumeOptions::default() }
}

/// Three media: a coarse one, a fine one rotated and stretched across it, and one completely inside
/// the first.
pub(crate) fn three() -> Vec<VolumeInstance> {
    let coarse = wave_volume(
        [21, 26, 19],
        DVec3::new(-1.9, -1.7, -0.6),
        DVec3::new(3.4, 3.2, 2.2),
        BLUE,
        0.5,
        shaded(),
    );
    let nearest =
        VolumeOptions { interpolation: Interpolation::Nearest, ..VolumeOptions::default() };
    let fine = wave_volume(
        [67, 40, 51],
        DVec3::new(-1.0, -0.8, -0.4),
        DVec3::new(2.6, 1.6, 1.5),
        RED,
        0.7,
        nearest,
    );
    let steep = GradientOpacity { factors: vec![0.2, 1.0].into(), steepest: 3.0 };
    let inside = VolumeOptions { gradient_opacity: Some(steep), ..VolumeOptions::default() };
    let inside = wave_volume(
        [33, 33, 33],
        DVec3::new(-0.7, -0.9, 0.2),
        DVec3::splat(0.8),
        GREEN,
        0.9,
        inside,
    );
    let turned = DAffine3::from_translation(DVec3::new(0.4, 0.3, 0.2))
        * DAffine3::from_rotation_z(0.6)
        * DAffine3::from_rotation_x(0.3)
        * DAffine3::from_scale(DVec3::new(1.2, 0.9, 1.1));
    vec![
        VolumeInstance { volume: coarse.into(), world_from_object: DAffine3::IDENTITY },
        VolumeInstance { volume: fine.into(), world_from_object: turned },
        VolumeInstance { volume: inside.into(), world_from_object: DAffine3::IDENTITY },
    ]
}

fn case(name: &'static str, balls: Option<Material>, volumes: Vec<VolumeInstance>) -> Case {
    let sun = Light::directional(DVec3::new(0.4, -0.3, 1.0));
    let lights = [sun, Light::ambient(AMBIENT)];
    let mut scene = scenes::scene(DVec3::ZERO, matte(), balls, &lights, Some(0.5));
    scene.volumes = volumes;
    let options = RenderOptions { width: 100, height: 81, ..options() };
    Case { name, scene, camera: camera(DVec3::ZERO), options }
}

/// Volumes alone, with nothing behind them.
fn alone(volumes: Vec<VolumeInstance>) -> Case {
    let mut scene = SceneBuilder::new().build().unwrap();
    scene.volumes = volumes;
    let options = RenderOptions { width: 100, height: 81, layers: Layers::COLOR, ..options() };
    Case { name: "volumes alone", scene, camera: camera(DVec3::ZERO), options }
}

/// The volume with its values in a file.
fn stored(volume: &Volume) -> Volume {
    let grid = volume.grid();
    let (dims, origin, spacing) = (grid.dims(), grid.origin(), grid.spacing());
    let layout = VolumeLayout { dims, origin, spacing, values: ValueType::F32 };
    let mut writer = StoredVolumeWriter::new(Vec::new(), layout).unwrap();
    for plane in grid.values().chunks((dims.x * dims.y) as usize) {
        let bytes: Vec<u8> = plane.iter().flat_map(|v| v.to_le_bytes()).collect();
        writer.add_plane(&bytes).unwrap();
    }
    let source = StoredVolume::open(writer.finish().unwrap().0, 1 << 20).unwrap();
    let (transfer, options) = (volume.transfer_function().clone(), volume.options().clone());
    Volume::stored(source.into(), 1 << 20, transfer, options).unwrap()
}

#[test]
fn volumes_in_files_are_cut_over_the_ranks_and_have_the_bits_of_one_node() {
    let of = |name| case(name, Some(Material::dielectric(1.5)), three());
    let (in_memory, mut in_files) = (of("volumes in memory"), of("volumes in files"));
    for placed in &mut in_files.scene.volumes {
        placed.volume = stored(&placed.volume).into();
    }
    let expected = one_node(&in_memory);
    assert_eq!(differing_pixels(&expected, &one_node(&in_files)), 0);
    for ranks in [2, 7] {
        let outputs = many(&in_files, ranks, &Split::Triangles, SecondaryRayPolicy::Forward);
        assert_same(&expected, &outputs, &format!("{ranks} ranks"));
    }
}

#[test]
fn several_volumes_that_overlap_have_the_bits_of_one_node() {
    let glass = case(
        "volumes behind and around glass and mirrors",
        Some(Material::dielectric(1.5)),
        three(),
    );
    let layers = case("volumes between layers", Some(matte().with_opacity(0.4)), three());
    let mut stepped = alone(three());
    (stepped.name, stepped.options.volume_quality) = ("steps", VolumeQuality::Step { voxels: 0.7 });
    for case in [glass, layers, alone(three()), stepped] {
        let expected = one_node(&case);
        // Otherwise the test would not cover mixing.
        for out in 0..3 {
            let mut without = case.scene.clone();
            without.volumes.remove(out);
            let without = render(&without, &case.camera, &case.options).unwrap().frame;
            assert!(
                differing_pixels(&expected, &without) > 300,
                "volume {out} is not seen: {}",
                case.name
            );
        }
        for (ranks, split) in [
            (1, Split::Triangles),
            (2, Split::Triangles),
            (7, Split::Random { seed: 5 }),
            // More than the blocks of the coarse volume.
            (64, Split::Triangles),
        ] {
            let outputs = many(&case, ranks, &split, SecondaryRayPolicy::Forward);
            assert_same(&expected, &outputs, &format!("{}, {ranks} ranks", case.name));
            assert!(outputs[0].report.warnings.iter().all(|w| !w.contains("whole")));
        }
    }
}

#[test]
fn volumes_whole_on_some_ranks_and_cut_over_others_have_the_bits_of_one_node() {
    let case = case("mixed holdings", None, three());
    let expected = one_node(&case);
    let cut = |ranks: &[usize]| ranks.iter().map(|r| vec![*r]).collect::<Vec<_>>();
    let everybody: Vec<usize> = (0..5).collect();
    let deals: [(&str, [Vec<Vec<usize>>; 3]); 4] = [
        (
            "all whole everywhere",
            [vec![everybody.clone()], vec![everybody.clone()], vec![everybody.clone()]],
        ),
        (
            "one whole on each rank",
            [vec![everybody.clone()], cut(&[0, 1, 2, 3, 4]), cut(&[4, 3, 2, 1, 0])],
        ),
        // Rank 3 has no part of any volume.
        ("each whole on another", [cut(&[4]), cut(&[1]), vec![vec![2, 0]]]),
        (
            "bricks twice",
            [vec![vec![0, 3], vec![4, 1]], cut(&[2, 2, 0, 2, 1, 3, 4, 0, 3]), cut(&[1, 4])],
        ),
    ];
    let whole: usize = case.scene.volumes.iter().map(|v| v.volume.grid().values().len()).sum();
    for (name, deal) in deals {
        let mut partition = Partition::new(&case.scene, 5, &Split::Triangles);
        for (volume, holders) in deal.iter().enumerate() {
            partition = partition.distribute_volume(&case.scene, volume, holders).unwrap();
        }
        let outputs = dealt(&case, &partition, SecondaryRayPolicy::Forward);
        assert_same(&expected, &outputs, name);
        let held = values_held(&case, &partition);
        match name {
            "all whole everywhere" => {
                assert!(held.iter().all(|h| *h >= whole / 2), "{held:?} of {whole}");
                // Every rank answers its own requests: no other rank is asked about volumes.
                let rays = outputs.iter().map(|o| o.report.rays_sent).sum::<u64>();
                assert_eq!(rays, 0, "{name}");
            }
            "each whole on another" => assert_eq!(held[3], 0, "{held:?}"),
            _ => {}
        }
    }
}

#[test]
fn bricks_of_several_volumes_are_small_and_little_is_held_twice() {
    // Larger ones, whose bricks have more inside than at their sides.
    let [low, size] = [DVec3::splat(-1.0), DVec3::splat(2.0)];
    let coarse = wave_volume([65; 3], low, size, BLUE, 0.5, VolumeOptions::default());
    let fine = wave_volume([129; 3], 0.4 * low, 0.4 * size, RED, 0.5, VolumeOptions::default());
    let place = |volume: Volume, turn: f64| VolumeInstance {
        volume: volume.into(),
        world_from_object: DAffine3::from_rotation_z(turn),
    };
    for turn in [0.0, 0.5] {
        let case = alone(vec![place(coarse.clone(), 0.0), place(fine.clone(), turn)]);
        let whole: usize = case.scene.volumes.iter().map(|v| v.volume.grid().values().len()).sum();
        let held = values_held(&case, &Partition::new(&case.scene, 8, &Split::Triangles));
        assert!(held.iter().all(|h| *h < whole * 3 / 10), "{held:?} of {whole}, turned by {turn}");
        assert!(
            held.iter().sum::<usize>() < whole * 3 / 2,
            "{held:?} of {whole}, turned by {turn}"
        );
    }
}

#[test]
fn projections_are_seen_whole_and_have_the_bits_of_one_node() {
    for blend in [Blend::Maximum, Blend::Average, Blend::Isosurfaces(vec![0.4, 0.8].into())] {
        let projection = VolumeOptions { blend: blend.clone(), ..VolumeOptions::default() };
        let projection = wave_volume(
            [31, 29, 27],
            DVec3::new(-1.2, -1.4, 0.0),
            DVec3::new(2.0, 2.4, 1.2),
            GREEN,
            0.6,
            projection,
        );
        let projection =
            VolumeInstance { volume: projection.into(), world_from_object: DAffine3::IDENTITY };
        let one = case("a projection", None, vec![projection.clone()]);
        let among = case("a projection among media", None, {
            let mut volumes = three();
            volumes.insert(1, projection);
            volumes
        });
        for case in [one, among] {
            let expected = one_node(&case);
            for ranks in [2, 6] {
                let outputs = many(&case, ranks, &Split::Triangles, SecondaryRayPolicy::Forward);
                assert_same(
                    &expected,
                    &outputs,
                    &format!("{} {blend:?}, {ranks} ranks", case.name),
                );
                assert!(
                    outputs[0]
                        .report
                        .warnings
                        .iter()
                        .any(|w| w.contains("every rank holds them whole"))
                );
            }
        }
    }
}

#[test]
fn deals_that_cannot_be_are_refused_by_name() {
    let mut volumes = three();
    let maximum = VolumeOptions { blend: Blend::Maximum, ..VolumeOptions::default() };
    let projection = wave_volume([9, 9, 9], DVec3::ZERO, DVec3::ONE, GREEN, 0.6, maximum);
    volumes
        .push(VolumeInstance { volume: projection.into(), world_from_object: DAffine3::IDENTITY });
    let case = alone(volumes);
    let refused = |volume: usize, holders: &[Vec<usize>]| {
        let partition = Partition::new(&case.scene, 4, &Split::Triangles);
        match partition.distribute_volume(&case.scene, volume, holders) {
            Err(FrameError::Holders { volume: v, reason }) if v == volume => reason,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(4, &[vec![0]]), "the scene has 4 volumes");
    assert_eq!(
        refused(3, &[vec![0]]),
        "it is a projection, which sees the whole volume: every rank holds it"
    );
    assert_eq!(refused(0, &[]), "no brick has a holder");
    assert_eq!(refused(0, &[vec![0], vec![]]), "brick 1 has no holder");
    assert_eq!(refused(1, &[vec![4]]), "rank 4 is to hold brick 0, but there are 4 ranks");
    assert_eq!(refused(2, &[vec![1, 2, 1]]), "rank 1 is to hold brick 0 twice");
}
