use super::*;
use crate::generate::wavelet::Wavelet;
use crate::testing::{open_or_flipped_edges, volume, with_threads};
use glam::UVec3;
use rt_core::volume::GridExtent;

/// A grid of `n`³ points around zero with spacing 1 whose values come from the position.
fn sampled(n: u32, mut f: impl FnMut(DVec3) -> f64) -> Grid {
    let half = (n - 1) as f64 / 2.0;
    let points = (0..n * n * n)
        .map(|i| DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) - half);
    let values = points.map(|p| f(p) as f32).collect();
    Grid::new(UVec3::splat(n), DVec3::splat(-half), DVec3::ONE, values).unwrap()
}

/// Random values, with a border of low ones so that the surface is closed.
fn noise(n: u32, seed: u32) -> Grid {
    let mut state = seed;
    let mut grid = sampled(n, |_| {
        state = state.wrapping_mul(1664525).wrapping_add(1013904223);
        (state >> 8) as f64 / (1 << 24) as f64
    });
    for i in 0..grid.values().len() as u32 {
        let p = UVec3::new(i % n, i / n % n, i / n / n);
        if p.min_element() == 0 || p.max_element() == n - 1 {
            grid.values_mut()[i as usize] = -1.0;
        }
    }
    grid
}

#[test]
fn sphere_is_closed_outward_and_has_the_right_volume() {
    let grid = sampled(41, |p| 15.0 - p.length());
    let mesh = extract(&grid, &[0.0], Options { normals: true, scalars: true }).unwrap().mesh;
    assert_eq!(open_or_flipped_edges(&mesh.indices), 0);
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 15f64.powi(3);
    // Inscribed triangles with circumradius c <= 1 fall short by at most r - sqrt(r² - c²), 0.22 %
    // of the radius.
    let ratio = volume(&mesh) / exact;
    assert!((1.0 - 3.0 * 0.0022..1.0).contains(&ratio), "volume is {ratio} of the sphere's");
    let normals = &mesh.normals.as_ref().unwrap().values;
    let worst =
        mesh.positions.iter().zip(normals).map(|(p, n)| p.normalize().dot(*n)).fold(1f32, f32::min);
    assert!(worst > 0.999, "normals point outward: {worst}");
    assert_eq!(mesh.scalars.as_ref().unwrap().values, vec![0.0; mesh.positions.len()]);
    mesh.check().unwrap();
}

#[test]
fn random_fields_are_watertight() {
    // Noise at 0.5 reaches all 256 cases, ambiguous faces on both sides of most cells.
    for seed in 0..20 {
        let mesh = extract(&noise(14, seed), &[0.5], Options::default()).unwrap().mesh;
        assert!(mesh.num_triangles() > 2000);
        assert_eq!(open_or_flipped_edges(&mesh.indices), 0, "seed {seed}");
        assert!(volume(&mesh) > 0.0);
        let mut used = vec![false; mesh.positions.len()];
        mesh.indices.iter().flatten().for_each(|&v| used[v as usize] = true);
        assert!(used.iter().all(|&u| u), "seed {seed}: vertex without triangle");
    }
}

#[test]
fn values_equal_to_the_isovalue_stay_watertight() {
    let mut grid = noise(14, 3);
    grid.values_mut().iter_mut().for_each(|v| *v = (*v * 4.0).round() / 4.0);
    let mesh =
        extract(&grid, &[0.5], Options { normals: true, ..Default::default() }).unwrap().mesh;
    assert_eq!(open_or_flipped_edges(&mesh.indices), 0);
    assert!(mesh.normals.unwrap().values.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
}

#[test]
fn counts_are_vtks_at_21_41_101() {
    for (points, iso, triangles) in
        [(21, 157.0909652709961, 5480), (41, 160.178, 25_644), (101, 159.958, 167_012)]
    {
        let grid = Wavelet::with_points(points).grid().unwrap();
        assert_eq!(count_triangles(&grid, &[iso]).unwrap(), [triangles], "{points}³");
    }
}

#[test]
fn counts_are_vtks_at_201() {
    let grid = Wavelet::with_points(201).grid().unwrap();
    let isos =
        [100.0, 115.0, 130.0, 150.0, 170.0, 190.0, 200.0, 157.0909652709961, 160.14612197875977];
    let expected =
        [283_696, 456_830, 592_216, 682_412, 630_156, 473_988, 412_780, 677_132, 672_748];
    assert_eq!(count_triangles(&grid, &isos).unwrap(), expected);
    let found = extract(&grid, &isos[8..], Options::default()).unwrap();
    assert_eq!((found.mesh.num_triangles(), found.mesh.positions.len()), (672_748, 337_792));
    // The dissertation's 1 M: two nested surfaces.
    let nested = extract(&grid, &[121.0, 189.0], Options::default()).unwrap();
    assert_eq!(nested.mesh.num_triangles(), 1_002_484);
    assert_eq!(nested.triangles_per_iso.iter().sum::<usize>(), 1_002_484);
}

#[test]
fn nested_surfaces_are_the_single_ones_in_order() {
    let grid = Wavelet::with_points(41).grid().unwrap();
    let isos = [100.0, 150.0, 200.0];
    let both = Options { normals: true, scalars: true };
    let all = extract(&grid, &isos, both).unwrap();
    let (mut v, mut t) = (0, 0);
    for (iso, n) in isos.into_iter().zip(all.triangles_per_iso) {
        let one = extract(&grid, &[iso], both).unwrap().mesh;
        assert_eq!(one.num_triangles(), n);
        assert_eq!(one.positions, all.mesh.positions[v..v + one.positions.len()]);
        let moved: Vec<_> = one.indices.iter().map(|t| t.map(|i| i + v as u32)).collect();
        assert_eq!(moved, all.mesh.indices[t..t + n]);
        assert_eq!(
            one.scalars.unwrap().values,
            all.mesh.scalars.as_ref().unwrap().values[v..v + one.positions.len()]
        );
        v += one.positions.len();
        t += n;
    }
    assert_eq!((v, t), (all.mesh.positions.len(), all.mesh.num_triangles()));
}

#[test]
fn same_mesh_on_1_2_7_threads() {
    let grid = Wavelet::with_points(67).grid().unwrap();
    let options = Options { normals: true, scalars: true };
    let mesh =
        |threads| with_threads(threads, || extract(&grid, &[120.0, 180.0], options).unwrap());
    let one = mesh(1);
    assert!(one == mesh(2) && one == mesh(7));
}

#[test]
fn streamed_equals_in_memory_for_any_batch() {
    let mut grid = Wavelet::with_points(40).grid().unwrap();
    for missing in [false, true] {
        if missing {
            grid.values_mut()[40 * 40 * 17 + 40 * 3 + 5] = f32::NAN;
            grid.values_mut()[40 * 40 * 4 + 40 * 20 + 20] = f32::INFINITY;
        }
        let options = Options { normals: true, scalars: true };
        let whole = extract(&grid, &[150.0], options).unwrap();
        for batch in [0, 4, 5, 11, 40, 1000] {
            let streamed = extract_streamed(&grid, 150.0, options, batch, |_| true).unwrap();
            assert!(streamed == whole, "batch of {batch}, missing {missing}");
        }
    }
}

#[test]
fn pieces_have_the_triangles_of_the_whole_for_any_batch() {
    // The corners of each triangle, with their normals.
    fn corners(mesh: &TriMesh) -> Vec<[[u32; 6]; 3]> {
        let normals = mesh.normals.as_ref().expect("asked for");
        let corner = |k: u32| {
            let (p, n) = (mesh.positions[k as usize], normals.values[k as usize]);
            [p.x, p.y, p.z, n.x, n.y, n.z].map(f32::to_bits)
        };
        mesh.indices.iter().map(|t| t.map(corner)).collect()
    }
    let mut grid = Wavelet::with_points(40).grid().unwrap();
    for missing in [false, true] {
        if missing {
            grid.values_mut()[40 * 40 * 17 + 40 * 3 + 5] = f32::NAN;
            grid.values_mut()[40 * 40 * 4 + 40 * 20 + 20] = f32::INFINITY;
        }
        let options = Options { normals: true, scalars: true };
        let whole = extract(&grid, &[150.0], options).unwrap();
        let (dims, origin, spacing) = (grid.dims(), grid.origin(), grid.spacing());
        let extent = GridExtent { dims, origin, spacing };
        for batch in [0, 5, 6, 11, 40, 1000] {
            let (mut next, mut all, mut pieces) = (0, Vec::new(), 0);
            let skipped = extract_pieces(
                &extent,
                150.0,
                options,
                batch,
                |range, values| {
                    assert_eq!(range.start, next, "each plane is asked for once, in order");
                    next = range.end;
                    let from = range.start as usize * 1600;
                    values.copy_from_slice(&grid.values()[from..][..values.len()]);
                    Ok::<_, IsosurfaceError>(())
                },
                |piece| {
                    assert_eq!(piece.origin, whole.mesh.origin);
                    assert_eq!(piece.validate().skipped(), 0);
                    let scalars = piece.scalars.as_ref().expect("asked for");
                    assert!(scalars.values.iter().all(|v| *v == 150.0));
                    assert_eq!(scalars.values.len(), piece.positions.len());
                    all.extend(corners(&piece));
                    pieces += 1;
                    Ok(())
                },
            );
            assert_eq!(skipped.unwrap(), whole.skipped_cells);
            assert_eq!(next, 40, "all planes are asked for");
            assert!(all == corners(&whole.mesh), "batch of {batch}, missing {missing}");
            assert!(batch > 11 || pieces > 4, "batch of {batch}: {pieces} pieces");
        }
    }
}

#[test]
fn stopped_stream_keeps_a_valid_surface() {
    let grid = Wavelet::with_points(40).grid().unwrap();
    let part =
        extract_streamed(&grid, 150.0, Options::default(), 10, |planes| planes < 20).unwrap();
    assert!(part.mesh.num_triangles() > 1000);
    assert_eq!(part.mesh.validate().skipped(), 0);
    let top = part.mesh.bounds().max.z;
    assert!((-1.0..=1.0).contains(&top), "planes 0..21 reach z = 0: {top}");
}

#[test]
fn nan_and_infinity_leave_holes_of_counted_cells() {
    let mut grid = sampled(20, |p| 7.0 - p.length());
    let whole = extract(&grid, &[0.0], Options::default()).unwrap();
    assert_eq!(whole.skipped_cells, 0);
    // One missing value on the surface, one at the corner of the grid, one far inside.
    let on_surface = grid.index(10, 10, 3);
    for (at, v) in
        [(on_surface, f32::NAN), (0, f32::INFINITY), (grid.index(10, 10, 10), f32::NEG_INFINITY)]
    {
        grid.values_mut()[at] = v;
    }
    let holed = extract(&grid, &[0.0], Options { normals: true, ..Default::default() }).unwrap();
    assert_eq!(holed.skipped_cells, 8 + 1 + 8);
    assert!(holed.mesh.num_triangles() < whole.mesh.num_triangles());
    assert_eq!(holed.mesh.validate().skipped(), 0, "positions are finite");
    assert!(holed.mesh.normals.unwrap().values.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
}

#[test]
fn all_nan_is_empty_and_counted() {
    let grid = sampled(5, |_| f64::NAN);
    let found = extract(&grid, &[0.0], Options { normals: true, scalars: true }).unwrap();
    assert_eq!(
        (found.mesh.num_triangles(), found.mesh.positions.len(), found.skipped_cells),
        (0, 0, 64)
    );
}

#[test]
fn empty_results_are_no_error() {
    let grid = sampled(5, |p| p.x);
    for isos in [&[][..], &[1e9], &[-1e9], &[1e300, -1e300]] {
        let found = extract(&grid, isos, Options { normals: true, scalars: true }).unwrap();
        assert_eq!((found.mesh.num_triangles(), found.triangles_per_iso), (0, vec![0; isos.len()]));
    }
}

#[test]
fn one_point_axes_have_no_cells() {
    for dims in [UVec3::new(1, 5, 5), UVec3::new(5, 1, 5), UVec3::new(5, 5, 1), UVec3::ONE] {
        let n = dims.element_product();
        let values = (0..n).map(|i| i as f32).collect();
        let grid = Grid::new(dims, DVec3::ZERO, DVec3::ONE, values).unwrap();
        let iso = n as f64 / 2.0 + 0.1;
        assert_eq!(
            extract(&grid, &[iso], Options::default()).unwrap().mesh.positions.len(),
            0,
            "{dims}"
        );
        assert_eq!(count_triangles(&grid, &[iso]).unwrap(), [0]);
        let streamed = extract_streamed(&grid, iso, Options::default(), 8, |_| true).unwrap();
        assert_eq!(streamed.mesh.num_triangles(), 0);
    }
}

/// A field whose grid is empty, which [`Grid`] cannot be.
struct NoPoints;

impl PlaneSource for NoPoints {
    fn dims(&self) -> UVec3 {
        UVec3::ZERO
    }
    fn origin(&self) -> DVec3 {
        DVec3::ZERO
    }
    fn spacing(&self) -> DVec3 {
        DVec3::ONE
    }
    fn fill_plane(&self, _: u32, _: &mut [f32]) {}
}

#[test]
fn bad_input_is_an_error() {
    let grid = sampled(5, |p| p.x);
    let e = extract(&grid, &[0.0, f64::NAN], Options::default()).unwrap_err();
    assert!(e.to_string().contains("number 1 is NaN"), "{e}");
    assert!(matches!(
        extract_streamed(&NoPoints, 0.0, Options::default(), 4, |_| true),
        Err(IsosurfaceError::Grid(GridError::Length { .. }))
    ));
}

#[test]
fn huge_offset_keeps_its_detail() {
    let grid = sampled(21, |p| 7.3 - p.length());
    let near = extract(&grid, &[0.0], Options::default()).unwrap().mesh;
    let origin = grid.origin() + DVec3::splat(6.4e6);
    let grid = Grid::new(grid.dims(), origin, grid.spacing(), grid.into_values()).unwrap();
    let far = extract(&grid, &[0.0], Options::default()).unwrap().mesh;
    assert_ne!(far.origin, DVec3::ZERO);
    for (a, b) in near.positions.iter().zip(&far.positions) {
        let b = far.origin + b.as_dvec3() - DVec3::splat(6.4e6);
        assert!((a.as_dvec3() - b).abs().max_element() < 2e-6, "{a} {b}");
    }
}
