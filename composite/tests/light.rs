//! Photographs of a gas in bricks: the bits of one process, and faults that have a name.
#[path = "meddling/mod.rs"]
mod meddling;
#[path = "meddling/mutation.rs"]
mod mutation;
#[path = "meddling/words.rs"]
mod words;

use composite::CommError;
use composite::comm::sim;
use composite::render::FrameError;
use composite::render::light::{
    Gas, GasBrick, LightOptions, LightOutput, LightTechnique, Shot, Strided, photograph,
};
use composite::{Communicator, threads};
use meddling::{Meddling, Outgoing};
use mutation::{Random, mutate};
use rt_core::glam::{DVec3, UVec3};
use schlieren::cutoff::{Cutoff, Knife, KnifePosition};
use schlieren::field::Field;
use schlieren::film::beams::expose_beams;
use schlieren::film::photons::Exposure;
use schlieren::film::{Film, Framing};
use schlieren::interpolate::Interpolant;
use schlieren::march::{Deviational, Options};
use schlieren::optics::{Optics, SourceShape};
use schlieren::technique::Technique;
use schlieren::technique::schlieren::Schlieren;
use schlieren::view::View;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use words::change_words;

const DIMS: UVec3 = UVec3::new(25, 21, 17);
const K: f64 = 2.26e-4;

fn gas() -> Gas {
    Gas {
        dims: DIMS,
        origin_m: DVec3::new(0.01, -0.02, 0.0),
        spacing_m: DVec3::new(1e-3, 1.2e-3, 0.9e-3),
        gladstone_dale_m3_per_kg: K,
        reference_density: 1.2,
    }
}

/// A light bubble, and a dense sheet across the bricks.
fn density(node: UVec3) -> f64 {
    let p = node.as_dvec3() / DIMS.as_dvec3();
    let bubble = (-(p - DVec3::new(0.4, 0.55, 0.5)).length_squared() / 0.03).exp();
    1.2 - 0.9 * bubble + 0.3 * (6.0 * (p.x + 0.4 * p.y - 0.3 * p.z)).tanh()
}

fn shot(technique: LightTechnique, direction: DVec3) -> Shot {
    Shot {
        direction,
        up: DVec3::Y,
        width: 40,
        height: 31,
        pixel_m: 0.0,
        technique,
        interpolant: Interpolant::TrilinearGradient,
        step_voxels: 0.9,
    }
}

const KNIFE: LightTechnique = LightTechnique::Knife {
    angle_deg: 20.0,
    slit_width_m: 1e-3,
    focal_length_m: 1.5,
    open_fraction: 0.5,
};
const OBLIQUE: DVec3 = DVec3::new(0.5, -0.4, 0.8);

fn options() -> LightOptions {
    LightOptions { timeout: Duration::from_secs(20), ..LightOptions::default() }
}

/// The nodes of one of `parts` bricks, with `layers` more around its cells, x fastest.
fn nodes(parts: UVec3, rank: u32, layers: u32) -> (UVec3, UVec3, Vec<f64>) {
    let at = UVec3::new(rank % parts.x, rank / parts.x % parts.y, rank / (parts.x * parts.y));
    let cells = DIMS - 1;
    let first = (at * cells / parts).saturating_sub(UVec3::splat(layers));
    let end = ((at + 1) * cells / parts + layers).min(cells) + 1;
    let mut values = Vec::new();
    for z in first.z..end.z {
        for y in first.y..end.y {
            values.extend((first.x..end.x).map(|x| density(UVec3::new(x, y, z))));
        }
    }
    (first, end - first, values)
}

type Ended = Result<LightOutput, FrameError>;

fn by_ranks(parts: UVec3, layers: u32, shot: &Shot) -> Vec<Ended> {
    let ranks = parts.element_product();
    let results = threads::run(ranks as usize, |mut comm| {
        let (first, dims, values) = nodes(parts, comm.rank() as u32, layers);
        let strides = [1, dims.x as usize, (dims.x * dims.y) as usize];
        let values = Strided::new(&values, dims, strides).expect("all nodes");
        let brick = GasBrick { first, dims, values: &values };
        photograph(&mut comm, &gas(), Some(&brick), shot, &options())
    });
    results.into_iter().map(|result| result.expect("no rank panics")).collect()
}

fn picture(ends: Vec<Ended>) -> LightOutput {
    let mut outputs = ends.into_iter().map(|end| end.expect("a photograph"));
    let root = outputs.next().expect("a rank");
    assert!(outputs.all(|output| output.picture.is_none()), "the root alone has the picture");
    root
}

#[test]
fn photographs_by_1_to_16_ranks_have_the_bits_of_one_process() {
    let shadow = LightTechnique::Shadowgraph { focus_m: 0.4 };
    for (technique, direction) in [(KNIFE, OBLIQUE), (shadow, DVec3::Z), (KNIFE, DVec3::NEG_X)] {
        for interpolant in [Interpolant::TrilinearGradient, Interpolant::Trilinear] {
            let shot = Shot { interpolant, ..shot(technique, direction) };
            let one = picture(by_ranks(UVec3::ONE, 0, &shot));
            assert_eq!((one.report.rounds, one.report.rays_sent), (0, 0));
            let grey = one.picture.as_ref().expect("the root's");
            let [low, high] = [f32::min, f32::max].map(|f| grey.iter().copied().fold(0.5, f));
            assert!(high - low > 0.1, "there is something to see: {low} to {high}");
            let layers = u32::from(interpolant == Interpolant::TrilinearGradient);
            for parts in [[2, 1, 1], [1, 3, 1], [2, 2, 2], [4, 2, 2], [1, 1, 5]] {
                let many = picture(by_ranks(parts.into(), layers, &shot));
                assert!(many.picture == one.picture, "{parts:?} {shot:?}");
                assert!(many.exits == one.exits, "{parts:?} {shot:?}");
                assert_eq!((many.report.masked, many.report.turned), (0, 0));
            }
        }
    }
}

#[test]
fn bricks_along_the_light_work_while_the_first_still_has_rays() {
    let shot = Shot { width: 120, height: 100, ..shot(KNIFE, DVec3::Z) };
    let corners = (shot.width + 1) * (shot.height + 1);
    let one = picture(by_ranks(UVec3::ONE, 0, &shot));
    let ends = by_ranks(UVec3::new(1, 1, 4), 1, &shot);
    let moved = ends.iter().map(|end| end.as_ref().expect("a photograph").report.rays_moved);
    assert!(moved.min() > Some(u64::from(corners) / 2), "nearly all rays cross all bricks");
    let many = picture(ends);
    // One round for all rays would be one for each brick, and one rank at work in each.
    let rounds = many.report.rounds;
    assert!(rounds > 15 && rounds < 15 + corners / 512, "{rounds} rounds for {corners} rays");
    assert!(many.picture == one.picture && many.exits == one.exits);
}

#[test]
fn rays_cross_borders_and_are_bent_on_both_sides() {
    let shot = shot(KNIFE, OBLIQUE);
    let ends = by_ranks(UVec3::new(2, 2, 2), 1, &shot);
    let sent: u64 = ends.iter().map(|e| e.as_ref().expect("it is made").report.rays_sent).sum();
    assert!(sent > 500, "{sent}");
    // Bricks whose gradients end at their borders give another picture.
    let one = picture(by_ranks(UVec3::ONE, 0, &shot));
    let half = threads::run(1, |mut comm| {
        let (_, dims, mut values) = nodes(UVec3::ONE, 0, 0);
        let slice = (dims.x * dims.y) as usize;
        values[slice * 8..].fill(1.2);
        let values = Strided::new(&values, dims, [1, dims.x as usize, slice]).expect("all nodes");
        let brick = GasBrick { first: UVec3::ZERO, dims, values: &values };
        photograph(&mut comm, &gas(), Some(&brick), &shot, &options())
    });
    let half = picture(half.into_iter().map(|r| r.expect("no panic")).collect());
    assert!(half.picture != one.picture);
}

#[test]
fn a_photograph_is_that_of_schlieren_itself() {
    let gas = gas();
    let shot = Shot { step_voxels: 1.0, ..shot(KNIFE, OBLIQUE) };
    let ours = picture(by_ranks(UVec3::new(2, 1, 2), 1, &shot)).picture.expect("the root's");
    let n0 = 1.0 + K * 1.2;
    let eps = |p: DVec3| {
        let node = ((p - gas.origin_m) / gas.spacing_m).round().as_uvec3();
        (density(node) - 1.2) * K / n0
    };
    let dims = DIMS.to_array().map(|n| n as usize);
    let spacing = gas.spacing_m.to_array();
    let field = Field::from_fn(dims, spacing, gas.origin_m, n0, eps).expect("a field");
    let view = View::new(OBLIQUE, DVec3::Y, field.centre_m()).expect("a view");
    let size = (DIMS - 1).as_dvec3() * gas.spacing_m;
    let sides = [view.right, view.up].map(|axis| axis.abs().dot(size));
    let framing = Framing::fitted(shot.width, shot.height, sides);
    let paths = Deviational::new(&field, view, Interpolant::TrilinearGradient, Options::default());
    let source = SourceShape::Slit { width_m: 1e-3, length_m: 5e-3, angle_deg: 20.0 };
    let position = KnifePosition::OpenFraction(0.5);
    let knife = Cutoff::Knife(Knife { angle_deg: 20.0, position });
    let optics = Optics { source, ..Optics::DEFAULT };
    let technique = Technique::Schlieren(Schlieren::new(optics, &knife, false));
    let exposure = Exposure {
        paths: &paths,
        technique: &technique,
        solids: None,
        sampling: Default::default(),
        seed: 0,
        margin_px: 0,
        tilted_beams: false,
    };
    let film = Film::<1>::new(framing, false);
    expose_beams(&exposure, &film, 1, &AtomicBool::new(false), &|_| ()).expect("a film");
    let theirs: Vec<f32> = film.to_pixels(1.0).into_iter().flatten().collect();
    let worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // Theirs sums in f32: 2e-6 of a brightness of 1, times the bench's 1500 per radian of 1e-3.
    assert!(worst < 2e-5, "{worst}");
    assert_eq!(ours.len(), theirs.len());
}

#[test]
fn values_are_read_where_they_are_with_any_strides_and_kind() {
    let shot = shot(KNIFE, OBLIQUE);
    let one = picture(by_ranks(UVec3::ONE, 0, &shot));
    // z fastest, every other number of an array of two fields.
    let dims = DIMS.to_array().map(|n| n as usize);
    let strides = [2 * dims[1] * dims[2], 2 * dims[2], 2];
    let mut fields = vec![f64::NAN; 2 * dims.iter().product::<usize>()];
    for x in 0..DIMS.x {
        for y in 0..DIMS.y {
            for z in 0..DIMS.z {
                let at = [x, y, z].map(|n| n as usize);
                let k: usize = at.iter().zip(strides).map(|(n, stride)| n * stride).sum();
                fields[k] = density(UVec3::new(x, y, z));
            }
        }
    }
    let ends = threads::run(1, |mut comm| {
        let values = Strided::new(&fields, DIMS, strides).expect("all nodes");
        let brick = GasBrick { first: UVec3::ZERO, dims: DIMS, values: &values };
        photograph(&mut comm, &gas(), Some(&brick), &shot, &options())
    });
    let strided = picture(ends.into_iter().map(|r| r.expect("no panic")).collect());
    assert!(strided.picture == one.picture);
    assert!(Strided::new(&fields[1..fields.len() - 2], DIMS, strides).is_none());
    assert!(Strided::new(&fields, DIMS, [usize::MAX; 3]).is_none());
}

#[test]
fn light_ends_where_there_is_no_number_and_is_counted() {
    let ends = threads::run(2, |mut comm| {
        let (first, dims, mut values) = nodes(UVec3::new(2, 1, 1), comm.rank() as u32, 1);
        let slice = (dims.x * dims.y) as usize;
        values[slice * 8 + (dims.x * 10 + 6) as usize] = f64::NAN;
        let values = Strided::new(&values, dims, [1, dims.x as usize, slice]).expect("all nodes");
        let brick = GasBrick { first, dims, values: &values };
        photograph(&mut comm, &gas(), Some(&brick), &shot(KNIFE, DVec3::Z), &options())
    });
    let output = picture(ends.into_iter().map(|r| r.expect("no panic")).collect());
    assert!(output.report.masked > 4 && output.report.masked < 100, "{:?}", output.report);
    let grey = output.picture.expect("the root's");
    assert!(grey.iter().all(|g| g.is_finite()) && grey.contains(&0.0));
}

/// The error of all ranks of two, which is one, and after which the group goes on.
fn agreed_error(
    change: impl Fn(usize, &mut Gas, &mut Shot, &mut GasBrick<'_, Strided<'_, f64>>) + Sync,
) -> String {
    let ends = threads::run(2, |mut comm| {
        let (first, dims, values) = nodes(UVec3::new(2, 1, 1), comm.rank() as u32, 1);
        let strides = [1, dims.x as usize, (dims.x * dims.y) as usize];
        let values = Strided::new(&values, dims, strides).expect("all nodes");
        let mut brick = GasBrick { first, dims, values: &values };
        let (mut gas, mut shot) = (gas(), shot(KNIFE, DVec3::Z));
        change(comm.rank(), &mut gas, &mut shot, &mut brick);
        let end = photograph(&mut comm, &gas, Some(&brick), &shot, &options());
        comm.barrier(Duration::from_secs(20)).expect("the group goes on");
        end.expect_err("refused").to_string()
    });
    let mut texts = ends.into_iter().map(|end| end.expect("no rank panics"));
    let text = texts.next().expect("a rank");
    assert!(texts.all(|other| other == text), "{text}");
    text
}

#[test]
fn what_does_not_fit_together_is_named_on_every_rank() {
    let text = agreed_error(|rank, gas, _, _| gas.reference_density += rank as f64);
    assert!(text.contains("gas: reference_density: 1.2 on rank 0"), "{text}");
    let text = agreed_error(|rank, _, shot, _| shot.width += rank as u32);
    assert!(text.contains("photograph: width"), "{text}");
    let text = agreed_error(|_, _, shot, _| shot.interpolant = Interpolant::BSpline);
    assert!(text.contains("spline cannot be cut into bricks"), "{text}");
    let text = agreed_error(|_, _, shot, _| shot.step_voxels = f64::NAN);
    assert!(text.contains("step_voxels is NaN"), "{text}");
    let text = agreed_error(|_, _, shot, _| shot.width = 1 << 20);
    assert!(text.contains("1048576x31"), "{text}");
    let text = agreed_error(|_, gas, _, _| gas.spacing_m.y = 0.0);
    assert!(text.contains("spacing_m along y is 0"), "{text}");
    let text = agreed_error(|rank, _, _, brick| brick.first.x += 10 * rank as u32);
    assert!(text.contains("rank 1") && text.contains("the gas has [25, 21, 17] nodes"), "{text}");
    // Without the layers that gradients need.
    let text = agreed_error(|rank, _, _, brick| {
        if rank == 0 {
            brick.dims.x -= 1;
        }
    });
    assert!(text.contains("one more layer of nodes"), "{text}");
}

#[test]
fn rays_with_random_changes_end_in_the_picture_or_in_named_errors() {
    const RANKS: usize = 4;
    let parts = UVec3::new(2, 2, 1);
    let shot = Shot { width: 9, height: 7, ..shot(KNIFE, OBLIQUE) };
    let expected = picture(by_ranks(UVec3::ONE, 0, &shot)).picture;
    let (mut failed, mut unchanged) = (0, 0);
    for seed in 0..600 {
        let mut random = Random(seed);
        let (culprit, is_consistent) = (random.below(RANKS), random.below(2) == 0);
        let what = match random.below(2) {
            0 => Outgoing::Gathered(random.below(8)),
            _ => Outgoing::Message(random.below(4)),
        };
        let case = format!("seed {seed}: rank {culprit}, {what:?}");
        let ends = sim::run(RANKS, sim::Network::QDR, sim::Compute::Given, |inner| {
            let rank = inner.rank();
            let mut comm = Meddling::new(inner, |outgoing, message| {
                let mut random = Random(!seed);
                if rank != culprit || outgoing != what {
                } else if is_consistent {
                    change_words(message, |words| {
                        let mut bytes: Vec<u8> =
                            words.iter().flat_map(|w| w.to_le_bytes()).collect();
                        mutate(&mut random, &mut bytes);
                        let whole = bytes.as_chunks::<4>().0;
                        *words = whole.iter().map(|c| u32::from_le_bytes(*c)).collect();
                    });
                } else {
                    mutate(&mut random, message);
                }
                true
            });
            let (first, dims, values) = nodes(parts, rank as u32, 1);
            let strides = [1, dims.x as usize, (dims.x * dims.y) as usize];
            let values = Strided::new(&values, dims, strides).expect("all nodes");
            let brick = GasBrick { first, dims, values: &values };
            let options = LightOptions { timeout: Duration::from_secs(5), ..options() };
            let end = photograph(&mut comm, &gas(), Some(&brick), &shot, &options);
            (end, comm.requested_bytes)
        });
        let mut errors = 0;
        for end in ends {
            let (end, bytes) = end.unwrap_or_else(|panic| panic!("{case}: {panic}"));
            assert!(bytes < 1 << 20, "{case}: {bytes} bytes were asked for");
            match end {
                Ok(output) => {
                    let same = output.picture.is_none() || output.picture == expected;
                    assert!(same || is_consistent, "{case}: another picture");
                }
                Err(error) => {
                    errors += 1;
                    assert!(error.to_string().contains("rank"), "{case}: {error}");
                    let timeout = matches!(error, FrameError::Comm(CommError::Timeout { .. }));
                    assert!(!timeout, "{case}: {error}");
                }
            }
        }
        assert!(errors == 0 || errors == RANKS, "{case}: {errors} of {RANKS} have an error");
        failed += usize::from(errors > 0);
        unchanged += usize::from(errors == 0);
    }
    assert!(failed > 100 && unchanged > 50, "{failed} failed, {unchanged} did not");
}
