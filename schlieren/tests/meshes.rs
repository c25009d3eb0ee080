//! Deflections through flows on meshes of several kinds, at default options, against closed forms.

mod bells;
mod common;

use bells::{BLOB, cell_averages, even_cell_averages, hexahedra, options, stretched, tetrahedra};
use common::grid;
use datasets::model::{DataArray, Dataset, ImageData, Values};
use datasets::resample::{Reconstruction, Resolution};
use glam::DVec3;
use schlieren::input::{Options, Reference, from_dataset};
use schlieren::path::{Exit, PathQuantities, Start};
use schlieren::plan::{Plan, Request};
use schlieren::view::View;

/// The largest and the root mean square error of deflections along z, by the largest deflection.
fn errors(data: &Dataset, options: &Options) -> (f64, f64) {
    let loaded = from_dataset(data, options).unwrap();
    let field = loaded.field;
    let view = View::new(DVec3::Z, DVec3::Y, DVec3::ZERO).unwrap();
    let request = Request { direction: Some(DVec3::Z), ..Request::default() };
    let starts = grid(160, 0.96);
    assert!((field.size_m() - 1.0).abs().max_element() < 1e-6, "{}", field.size_m());
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    Plan::new(&field, request).paths(&field, view).trace_parallel(&starts, &mut exits);
    let (mut worst, mut squares, mut largest) = (0.0f64, 0.0, 0.0f64);
    for (start, exit) in starts.iter().zip(&exits) {
        let [x, y] = start.position_m.map(f64::from);
        // The view's right is along -x or x; its own axes tell.
        let at = view.right * x + view.up * y;
        let truth = BLOB.deflection_rad(at.x, at.y, 0.5);
        let truth = DVec3::new(truth[0], truth[1], 0.0);
        let truth = [truth.dot(view.right), truth.dot(view.up)];
        let error: [f64; 2] = [0, 1].map(|c| f64::from(exit.deflection_rad[c]) - truth[c]);
        worst = worst.max(error[0].hypot(error[1]));
        squares += error[0] * error[0] + error[1] * error[1];
        largest = largest.max(truth[0].hypot(truth[1]));
    }
    (worst / largest, (squares / starts.len() as f64).sqrt() / largest)
}

#[test]
fn meshes_give_smooth_deflections_at_default_options() {
    for (name, data, bound) in [
        ("hexahedra, 65³ points", hexahedra(65), 2e-3),
        ("cells, 64³ averages", cell_averages(64), 2e-3),
        ("cells of equal size, 64³ averages", even_cell_averages(64), 2e-4),
        ("cells of equal size, 32³ averages", even_cell_averages(32), 2e-3),
        ("stretched structured grid, 40³ points", stretched(40), 2e-3),
        ("irregular tetrahedra, 31³ points", tetrahedra(31), 1e-3),
    ] {
        let (worst, rms) = errors(&data, &options());
        println!("{name}: worst {worst:.2e}, rms {rms:.2e}");
        assert!(worst <= bound && rms <= 5e-4, "{name}: worst {worst:.2e}, rms {rms:.2e}");
    }
}

/// A slab of 8 cells is 8 cells thick, and not 7.
#[test]
fn the_outer_halves_of_border_cells_are_part_of_the_flow() {
    let mut slab = ImageData::new([9, 7, 6], DVec3::new(1.0, 2.0, 3.0), DVec3::splat(0.25));
    let eps = Values::F64(vec![1e-5; 8 * 6 * 5]);
    slab.attributes.cell.push(DataArray::new("eps", 1, eps));
    let options = Options { reference: Reference::Given { n_minus_1: 0.0 }, ..options() };
    let field = from_dataset(&Dataset::ImageData(slab), &options).unwrap().field;
    assert_eq!(
        (field.size_m(), field.origin_m()),
        (DVec3::new(2.0, 1.5, 1.25), [1.0, 2.0, 3.0].into())
    );
    let view = View::new(DVec3::X, DVec3::Y, DVec3::new(2.0, 2.75, 3.6)).unwrap();
    let quantities = PathQuantities { opd: true };
    let request = Request { direction: Some(DVec3::X), quantities, ..Request::default() };
    let mut exit = [Exit::UNDISTURBED];
    let start = Start { position_m: [0.1, 0.2], tilt_rad: [0.0; 2] };
    Plan::new(&field, request).paths(&field, view).trace(&[start], &mut exit);
    assert!((exit[0].opd_m / 2e-5 - 1.0).abs() < 1e-5, "{:?}", exit[0]);
}

#[test]
fn a_finer_lattice_does_not_bring_back_the_cells() {
    let data = hexahedra(33);
    let of = |nodes: usize, reconstruction| {
        let resolution = Resolution::Longest(nodes);
        errors(&data, &Options { resolution, reconstruction, ..options() }).0
    };
    let cubic = [49, 65, 129, 193].map(|n| of(n, Reconstruction::Cubic));
    assert!(cubic.iter().all(|error| *error < 1.3e-3), "{cubic:?}");
    // Twice as fine as the mesh and more: nothing is left that a finer lattice could show.
    assert!(cubic[3] <= 1.25 * cubic[1], "{cubic:?}");
    // The lattice of the mesh's own points, where nothing is reconstructed.
    let own = of(33, Reconstruction::Cubic);
    assert!(own < 3e-4, "{own}");
    // The disease: linear elements, sampled finer than the mesh, show their faces.
    let linear = of(129, Reconstruction::Linear);
    assert!(linear > 10.0 * cubic[2], "{linear} {cubic:?}");
}

/// The largest error of deflections along z, and what the plan says of it: its march, the lattice
/// and the mesh.
fn error_and_estimates(data: &Dataset) -> (f64, [f64; 2], Option<f64>) {
    let field = from_dataset(data, &options()).unwrap().field;
    let view = View::new(DVec3::Z, DVec3::Y, DVec3::ZERO).unwrap();
    let request = Request { direction: Some(DVec3::Z), ..Request::default() };
    let measured = Plan::new(&field, request).measure(&field, view, 256);
    let largest = BLOB.amplitude * (std::f64::consts::TAU).sqrt() / 1f64.exp().sqrt();
    let error = errors(data, &options()).0 * largest;
    (error, [measured.max_rad, measured.resolution_rad], measured.mesh_rad)
}

#[test]
fn an_error_of_the_mesh_is_not_that_of_a_fine_lattice() {
    for (name, data) in [
        ("hexahedra, 17³ points", hexahedra(17)),
        ("stretched structured grid, 20³ points", stretched(20)),
    ] {
        let (error, others, mesh) = error_and_estimates(&data);
        let mesh = mesh.expect("a mesh has an error");
        println!("{name}: error {error:.2e}, estimated {mesh:.2e} of the mesh, {others:?}");
        // The disease: the march is fine, so that it says nothing.
        assert!(others[0] < 1e-3 * error, "{name}: {error:.2e} {others:?}");
        // Where cells are as wide as a third of the bell, the third degree adds much more than its
        // error: 60 times on the hexahedra.
        assert!(error <= mesh && mesh <= 100.0 * error, "{name}: {error:.2e} {mesh:.2e}");
    }
    // Uniform data has a lattice and no mesh.
    let lattice = error_and_estimates(&even_cell_averages(32)).2;
    assert_eq!(lattice, None);
}
