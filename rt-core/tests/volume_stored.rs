//! Volumes that stay in a file give the bits of the same volumes in memory, or an error by name.
#![cfg(feature = "render")]
use rt_core::colormap::ColorMap;
use rt_core::glam::{DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::paging::PageSource;
use rt_core::prelude::*;
use rt_core::ray::Ray;
use rt_core::render::{RenderError, render};
use rt_core::stored_volume::{StoredVolume, StoredVolumeWriter, ValueType, VolumeLayout};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{
    Blend, Brick, ClipPlane, Cropping, GradientOpacity, Interpolation, Volume, VolumeError,
    VolumeLight, VolumeOptions, VolumeQuality, VolumeSample, VolumeShading, integrate_overlapping,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// One point more than two bricks of cells, one cell more than one brick, and less than one.
const DIMS: UVec3 = UVec3::new(65, 34, 21);

fn layout() -> VolumeLayout {
    let (origin, spacing) = (DVec3::new(1e4, -1.8, -0.7), DVec3::new(0.1, 0.1, 0.06));
    VolumeLayout { dims: DIMS, origin, spacing, values: ValueType::F32 }
}

/// Waves, with one value missing; a brick of them is constant.
fn values() -> Vec<f32> {
    let value = |k: u32| {
        let p = UVec3::new(k % DIMS.x, k / DIMS.x % DIMS.y, k / DIMS.x / DIMS.y);
        let at = p.as_vec3() * 0.3;
        match k {
            20_000 => f32::NAN,
            _ if p.x >= 32 && p.y <= 32 => 0.45,
            _ => 0.5 + 0.5 * at.x.sin() * at.y.cos() * at.z.sin(),
        }
    };
    (0..DIMS.element_product()).map(value).collect()
}

fn file() -> Vec<u8> {
    let layout = layout();
    let mut writer = StoredVolumeWriter::new(Vec::new(), layout).expect("memory");
    for plane in values().chunks((DIMS.x * DIMS.y) as usize) {
        let bytes: Vec<u8> = plane.iter().flat_map(|v| v.to_le_bytes()).collect();
        writer.add_plane(&bytes).expect("a plane");
    }
    writer.finish().expect("all planes").0
}

fn transfer() -> TransferFunction {
    let colors = ColorMap::new(vec![[0.1, 0.2, 0.9, 1.0], [1.0, 0.8, 0.1, 1.0]], [0.0, 1.0]);
    let opacity = [[0.2, 0.0], [0.4, 0.0], [0.6, 0.3], [1.0, 0.9]];
    TransferFunction::from_opacity(colors, &opacity, 0.4).expect("a transfer function")
}

fn in_memory(options: &VolumeOptions) -> Volume {
    let VolumeLayout { origin, spacing, .. } = layout();
    let grid = Grid::new(DIMS, origin, spacing, values()).expect("a grid");
    Volume::new(grid.into(), transfer(), options.clone()).expect("a volume")
}

fn stored(budget: usize, options: &VolumeOptions) -> Volume {
    let source = StoredVolume::open(file(), budget).expect("a sound file");
    Volume::stored(Arc::new(source), budget, transfer(), options.clone()).expect("a volume")
}

/// Through it from outside, from within, along an axis, along planes between bricks, and past it.
fn rays() -> impl Iterator<Item = Ray> {
    let mut state = 7u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..240u32).map(move |n| {
        let mut inside = || Vec3::new(6.4 * random(), 3.3 * random(), 1.2 * random());
        let (from, to) = (inside(), inside());
        match n % 6 {
            0 => Ray::new(from, to - from),
            1 => Ray::new(Vec3::new(-1.0, from.y, from.z), Vec3::X * (0.1 + to.x)),
            2 => Ray::new(Vec3::new(3.2, -1.0, from.z), Vec3::Y),
            3 => Ray::new(Vec3::new(7.0, 3.2, to.z), Vec3::new(-1.0, 0.0, 0.0)),
            4 => Ray::new(from * 9.0, to),
            _ => Ray::new(to - 4.0 * (from - to), from - to),
        }
    })
}

fn bits(s: &VolumeSample) -> ([u32; 4], u32, u32) {
    (s.rgba.map(f32::to_bits), s.depth.to_bits(), s.samples)
}

fn looks() -> Vec<VolumeOptions> {
    let shading = VolumeShading {
        ambient: 0.2,
        diffuse: 0.7,
        specular: 0.3,
        shininess: 20.0,
        half_gradient: 0.1,
        ..VolumeShading::default()
    };
    let light = VolumeLight { direction: Some(Vec3::new(1.0, 2.0, 0.5)), color: [1.0, 0.5, 0.2] };
    let factors = vec![0.0, 0.5, 1.0].into();
    let surfaces = Blend::Isosurfaces(vec![0.3, 0.7].into());
    let size = layout().spacing * (DIMS - UVec3::ONE).as_dvec3();
    let cropping = |regions| Cropping { planes: [0.3 * size, 0.8 * size], regions };
    let clip_planes = vec![ClipPlane { point: 0.5 * size, normal: DVec3::new(1.0, 0.4, -0.3) }];
    let plain = VolumeOptions::default;
    let mut all = vec![
        plain(),
        VolumeOptions { interpolation: Interpolation::Nearest, ..plain() },
        VolumeOptions { shading: Some(shading), lights: vec![light], ..plain() },
        VolumeOptions {
            shading: Some(shading),
            gradient_opacity: Some(GradientOpacity { factors, steepest: 4.0 }),
            clamped_gradients: true,
            ..plain()
        },
        VolumeOptions { shading: Some(shading), blend: surfaces, ..plain() },
        VolumeOptions { cropping: Some(cropping(0x2eb_feba)), ..plain() },
        VolumeOptions { cropping: Some(cropping(Cropping::BOX)), clip_planes, ..plain() },
    ];
    let blends = [Blend::Maximum, Blend::Minimum, Blend::Average, Blend::Additive];
    for interpolation in [Interpolation::Linear, Interpolation::Nearest] {
        all.extend(blends.iter().map(|b| VolumeOptions {
            interpolation,
            blend: b.clone(),
            ..plain()
        }));
    }
    all
}

#[test]
fn rays_collect_the_bits_of_the_volume_in_memory_with_any_budget() {
    let qualities = [VolumeQuality::default(), VolumeQuality::Step { voxels: 0.5 }];
    for (n, options) in looks().iter().enumerate() {
        let whole = in_memory(options);
        let mut seen = 0;
        for budget in [0, 300_000, usize::MAX] {
            let file = stored(budget, options);
            assert_eq!((file.bounds(), file.blocks()), (whole.bounds(), whole.blocks()));
            for (k, ray) in rays().enumerate() {
                let quality = &qualities[k % 2];
                let expected = whole.integrate(&ray, 0.1, 40.0, quality);
                let found = file.integrate(&ray, 0.1, 40.0, quality);
                assert_eq!(bits(&found), bits(&expected), "look {n}, ray {k}, {budget} bytes");
                seen += usize::from(expected.rgba[3] > 0.0);
            }
            assert!(file.failure().is_none());
            assert!(file.page_use().expect("a stored volume").reads > 0);
        }
        assert!(seen > 200, "look {n}: {seen}");
    }
}

#[test]
fn what_a_transfer_function_hides_is_not_read() {
    let mut file = stored(usize::MAX, &VolumeOptions::default());
    let dark = ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]);
    let nowhere = TransferFunction::from_opacity(dark, &[[2.0, 0.0], [3.0, 1.0]], 0.4);
    file.set_transfer_function(nowhere.expect("a transfer function"));
    assert_eq!(file.report().macrocells, file.report().macrocells_clear);
    for ray in rays() {
        let sample = file.integrate(&ray, 0.0, 40.0, &VolumeQuality::default());
        assert_eq!(sample.rgba, [0.0; 4]);
    }
    assert_eq!(file.page_use().expect("a stored volume").reads, 0);
    // What was kept of the old function would be wrong.
    file.set_transfer_function(transfer());
    let whole = in_memory(&VolumeOptions::default());
    for ray in rays() {
        let of = |volume: &Volume| volume.integrate(&ray, 0.0, 40.0, &VolumeQuality::default());
        assert_eq!(bits(&of(&file)), bits(&of(&whole)));
    }
}

#[test]
fn stored_volumes_mix_with_others_and_can_be_cut_into_parts() {
    let options = VolumeOptions::default();
    let (whole, file) = (in_memory(&options), stored(0, &options));
    let quality = VolumeQuality::default();
    for ray in rays().take(60) {
        let moved = Ray { origin: ray.origin + Vec3::new(0.3, 0.1, -0.2), ..ray };
        let mixed =
            |volume| integrate_overlapping(&[(volume, ray), (&whole, moved)], 0.0, 40.0, &quality);
        assert_eq!(bits(&mixed(&file)), bits(&mixed(&whole)));
    }
    let blocks = whole.blocks();
    for x in 0..blocks.x {
        for y in 0..blocks.y {
            let block = UVec3::new(x, y, 1);
            assert_eq!(file.is_occupied(block), whole.is_occupied(block), "{block}");
        }
    }
    let brick = Brick { first: UVec3::new(3, 0, 1), end: UVec3::new(6, 4, 9) };
    let values = |volume: &Volume| -> Vec<u32> {
        volume.part(brick).grid().values().iter().map(|v| v.to_bits()).collect()
    };
    assert_eq!(values(&file), values(&whole));
}

#[test]
fn samples_of_a_stored_volume_are_refused_by_name() {
    let options = VolumeOptions { sample_distance: Some(0.05), ..VolumeOptions::default() };
    let source = Arc::new(StoredVolume::open(file(), 0).expect("a sound file"));
    let error = Volume::stored(source, 0, transfer(), options).expect_err("refused");
    assert_eq!(error, VolumeError::StoredSamples);
}

/// Bytes that cannot be read any more when `lost` is set.
struct Failing {
    bytes: Vec<u8>,
    lost: Arc<AtomicBool>,
}

impl PageSource for Failing {
    fn name(&self) -> String {
        "waves.rtvolume".into()
    }

    fn length(&self) -> Result<u64, String> {
        self.bytes.length()
    }

    fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), String> {
        if self.lost.load(Ordering::Relaxed) {
            return Err("the disk is gone".into());
        }
        self.bytes.read(offset, bytes)
    }
}

#[test]
fn a_frame_of_a_volume_that_cannot_be_read_is_an_error() {
    let lost = Arc::new(AtomicBool::new(false));
    let source = Failing { bytes: file(), lost: lost.clone() };
    let source = Arc::new(StoredVolume::open(source, 0).expect("a sound file"));
    let volume = Volume::stored(source, 0, transfer(), VolumeOptions::default());
    let volume = Arc::new(volume.expect("a volume"));
    let middle = layout().origin + DVec3::new(3.2, 1.6, 0.6);
    let eye = middle - DVec3::new(0.0, 9.0, 0.0);
    let camera = Camera::perspective(eye, middle, DVec3::Z, 0.7, 1.0, [0.1, 90.0]).expect("one");
    let image = |volume: Arc<Volume>| {
        let mut scene = SceneBuilder::new();
        scene.volume(volume);
        let options =
            RenderOptions { effects: Some(Effects::VOLUMES), ..RenderOptions::new(32, 32) };
        render(&scene.build().expect("a scene"), &camera, &options).map(|output| output.frame.color)
    };
    lost.store(true, Ordering::Relaxed);
    let error = image(volume).expect_err("no brick can be read");
    assert!(matches!(error, RenderError::UnreadableVolume { volume: 0, .. }), "{error}");
    let text = error.to_string();
    assert!(text.contains("waves.rtvolume") && text.contains("the disk is gone"), "{text}");

    lost.store(false, Ordering::Relaxed);
    let expected = image(Arc::new(in_memory(&VolumeOptions::default()))).expect("a picture");
    let found = image(Arc::new(stored(0, &VolumeOptions::default()))).expect("a picture");
    assert!(found == expected && expected.iter().any(|c| c[3] > 0.5));
}
