//! Replicated data: every rank holds the whole scene and renders some bands of the picture (thesis sections 3.2.2 and 4.2.3).
use super::ask::{Tag, Talk};
use super::{Activity, FrameError, FrameOptions, FrameOutput};
use crate::comm::Communicator;
use rt_core::camera::Camera;
use rt_core::frame::{Frame, Layers};
use rt_core::render::{Crop, RenderOptions, Renderer};
use rt_core::scene::Scene;
use std::ops::Range;

/// Rows of a band: those of rt-core's tiles.
const BAND: u32 = rt_core::waves::TILE_SIDE;

/// Renders a picture of a scene that every rank has: rank r draws bands r, r + p, r + 2p, ... of 32 rows, so that a costly part of the picture
/// is spread. Every rank must call it with the same arguments. Time limits and error limits end a frame in each band on its own.
///
/// # Errors
/// Any fault on any rank ends the frame for all.
pub fn ray_parallel(
    comm: &mut dyn Communicator,
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    frame_options: &FrameOptions,
) -> Result<FrameOutput, FrameError> {
    let mut talk = Talk::new(comm, frame_options.timeout);
    let result = render(&mut talk, scene, camera, options, frame_options);
    if let Err(error) = &result {
        talk.abort(&error.to_string());
    }
    let frame = result?;
    Ok(FrameOutput { frame, report: talk.report })
}

fn render(
    talk: &mut Talk<'_>,
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    frame_options: &FrameOptions,
) -> Result<Option<Frame>, FrameError> {
    let (rank, size) = (talk.rank(), talk.size());
    let area = options.area();
    let mut renderer = Renderer::new();
    let mut mine = Vec::new();
    for band in bands(area, rank, size) {
        let crop =
            Crop { x: area.x, y: area.y + band.start, width: area.width, height: band.end - band.start };
        let cropped = RenderOptions { crop: Some(crop), ..options.clone() };
        let mut draw = || renderer.render(scene, camera, &cropped);
        // One thread a rank where ranks share a machine.
        let output = if frame_options.parallel { draw()? } else { alone(&mut draw)? };
        talk.report.rays += output.report.rays;
        talk.report.effects = output.report.effects;
        mine.extend(to_words(&output.frame));
    }
    talk.report.camera_rays = talk.report.rays.primary;
    talk.report.light = "every rank holds the whole scene".into();
    talk.spent(Activity::Render);
    let Some(root) = frame_options.root else { return Ok(None) };
    if root >= size {
        return Err(FrameError::Comm(crate::comm::CommError::NoSuchRank { peer: root, size }));
    }
    if rank != root {
        if !mine.is_empty() {
            talk.send(root, Tag::Tiles, &mine)?;
        }
        talk.spent(Activity::Collect);
        return Ok(None);
    }
    let mut picture = blank(area, options.layers, camera);
    let per_pixel = words_per_pixel(options.layers);
    put(&mut picture, bands(area, rank, size), &mine).ok_or_else(|| talk.wrong(rank, "bands", mine.len()))?;
    let rows = |from: usize| bands(area, from, size).map(|b| b.len()).sum::<usize>();
    let words = |from: usize| rows(from) * area.width as usize * per_pixel;
    let sources = (0..size).filter(|&from| from != rank && rows(from) > 0).map(|from| (from, words(from)));
    talk.receive(Tag::Tiles, "bands", sources.collect::<Vec<_>>(), |talk, from, words| {
        let fits = put(&mut picture, bands(area, from, size), &words);
        talk.spent(Activity::Collect);
        fits.ok_or_else(|| talk.wrong(from, "bands", words.len()))
    })?;
    talk.spent(Activity::Collect);
    Ok(Some(picture))
}

thread_local! {
    /// This thread as a pool of its own: what runs in it uses no other thread, and nobody else's work is stolen meanwhile.
    static ALONE: Option<rayon::ThreadPool> =
        rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().ok();
}

/// Runs `work` on this thread alone.
fn alone<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    ALONE.with(|pool| match pool {
        Some(pool) => pool.install(work),
        // This thread belongs to a pool already.
        None => work(),
    })
}

fn bands(area: Crop, rank: usize, size: usize) -> impl Iterator<Item = Range<u32>> {
    let rows = (rank as u64 * u64::from(BAND)..u64::from(area.height)).step_by(size * BAND as usize);
    rows.map(move |first| first as u32..(first as u32 + BAND).min(area.height))
}

fn words_per_pixel(layers: Layers) -> usize {
    let sizes = [
        (Layers::COLOR, 4),
        (Layers::DEPTH, 1),
        (Layers::DISTANCE, 1),
        (Layers::NORMAL, 3),
        (Layers::IDS, 2),
        (Layers::COST, 1),
    ];
    sizes.iter().filter(|(layer, _)| layers.contains(*layer)).map(|(_, words)| words).sum()
}

fn blank(area: Crop, layers: Layers, camera: &Camera) -> Frame {
    let n = area.width as usize * area.height as usize;
    let has = |l| if layers.contains(l) { n } else { 0 };
    Frame {
        width: area.width,
        height: area.height,
        color: vec![[0.0; 4]; has(Layers::COLOR)],
        depth: vec![camera.background_depth() as f32; has(Layers::DEPTH)],
        distance: vec![f32::INFINITY; has(Layers::DISTANCE)],
        normal: vec![[0.0; 3]; has(Layers::NORMAL)],
        instance: vec![u32::MAX; has(Layers::IDS)],
        primitive: vec![u32::MAX; has(Layers::IDS)],
        cost: vec![0.0; has(Layers::COST)],
    }
}

/// All layers of a band, one after the other.
fn to_words(frame: &Frame) -> Vec<u32> {
    let float = |v: &f32| v.to_bits();
    let mut out: Vec<u32> = frame.color.as_flattened().iter().map(float).collect();
    out.extend(frame.depth.iter().map(float));
    out.extend(frame.distance.iter().map(float));
    out.extend(frame.normal.as_flattened().iter().map(float));
    out.extend(&frame.instance);
    out.extend(&frame.primitive);
    out.extend(frame.cost.iter().map(float));
    out
}

/// Puts what [`to_words`] made of each of `bands` into the picture.
fn put(picture: &mut Frame, bands: impl Iterator<Item = Range<u32>>, mut words: &[u32]) -> Option<()> {
    let width = picture.width as usize;
    for band in bands {
        let pixels = band.start as usize * width..band.end as usize * width;
        let mut take = |n: usize| {
            let (some, rest) = words.split_at_checked(n)?;
            words = rest;
            Some(some)
        };
        let n = pixels.len();
        fn floats(out: &mut [f32], words: &[u32]) {
            out.iter_mut().zip(words).for_each(|(o, w)| *o = f32::from_bits(*w));
        }
        if let Some(out) = picture.color.get_mut(pixels.clone()) {
            floats(out.as_flattened_mut(), take(4 * n)?);
        }
        for layer in [&mut picture.depth, &mut picture.distance] {
            if let Some(out) = layer.get_mut(pixels.clone()) {
                floats(out, take(n)?);
            }
        }
        if let Some(out) = picture.normal.get_mut(pixels.clone()) {
            floats(out.as_flattened_mut(), take(3 * n)?);
        }
        for layer in [&mut picture.instance, &mut picture.primitive] {
            if let Some(out) = layer.get_mut(pixels.clone()) {
                out.copy_from_slice(take(n)?);
            }
        }
        if let Some(out) = picture.cost.get_mut(pixels) {
            floats(out, take(n)?);
        }
    }
    words.is_empty().then_some(())
}
