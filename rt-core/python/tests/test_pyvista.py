"""PyVista's meshes with rt_core's rays have the answers of VTK, and no ray is lost."""

import numpy as np
import pytest

pyvista = pytest.importorskip("pyvista")

import rt_core.pyvista as adapter  # noqa: E402


def segments(count=300, seed=2):
    rng = np.random.default_rng(seed)
    starts = rng.normal(size=(count, 3))
    starts *= 2 / np.linalg.norm(starts, axis=1, keepdims=True)
    return starts, -starts + rng.normal(size=(count, 3)) * 0.4


def test_segments_meet_what_vtk_s_meet():
    mesh = pyvista.ParametricTorus(ringradius=0.5, crosssectionradius=0.2)
    met = 0
    for start, end in zip(*segments()):
        expected, expected_cells = mesh.ray_trace(start, end)
        points, cells = adapter.ray_trace(mesh, start, end)
        # PyVista orders them by their coordinates, rt_core along the segment.
        order = np.argsort(np.linalg.norm(expected - start, axis=1))
        np.testing.assert_allclose(points, expected[order], atol=1e-6)
        np.testing.assert_array_equal(cells, expected_cells[order])
        if len(cells):
            first, _ = adapter.ray_trace(mesh, start, end, first_point=True)
            np.testing.assert_array_equal(first, points[0])
            met += 1
    assert met > 100


def test_many_rays_are_those_of_single_segments():
    mesh = pyvista.Sphere()
    starts, ends = segments()
    points, rays, cells = adapter.multi_ray_trace(mesh, starts, 9 * (ends - starts))
    assert (np.diff(rays) >= 0).all()
    for i, (start, end) in enumerate(zip(starts, ends)):
        expected, own = adapter.ray_trace(mesh, start, start + 9 * (end - start))
        np.testing.assert_allclose(points[rays == i], expected, atol=1e-12)
        np.testing.assert_array_equal(cells[rays == i], own)


def test_no_ray_is_lost_at_edges_and_vertices():
    """Rays for which PyVista offers `retry`."""
    mesh = pyvista.Icosphere(nsub=4)
    targets = np.asarray(mesh.points, dtype=np.float64)
    corners = targets[mesh.regular_faces]
    targets = np.concatenate([targets, (corners[:, 0] + corners[:, 1]) / 2])
    _, rays, _ = adapter.multi_ray_trace(mesh, np.zeros_like(targets), targets)
    np.testing.assert_array_equal(rays, np.arange(len(targets)))


def test_cells_are_those_of_the_mesh():
    down = [[0.3, 0.1, 9]], [[0, 0, -1]]
    quads = pyvista.Box()
    _, _, cells = adapter.multi_ray_trace(quads, *down)
    normals = np.asarray(quads.cell_normals)[cells]
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, -1]], atol=1e-6)
    grid = pyvista.ImageData(dimensions=(4, 4, 4))
    points, _, cells = adapter.multi_ray_trace(grid, [[0.5, 0.5, 9]], [[0, 0, -1]])
    np.testing.assert_allclose(points[:, 2], [3, 0])
    np.testing.assert_array_equal(cells, [18, 0])


def test_a_mesh_that_moves_is_built_again():
    mesh = pyvista.Sphere()
    down = [[0.01, 0.02, 9]], [[0, 0, -1]]
    before = adapter.multi_ray_trace(mesh, *down, first_point=True)[0]
    assert adapter.surface_of(mesh) is adapter.surface_of(mesh)
    mesh.points += [0, 0, 1]
    after = adapter.multi_ray_trace(mesh, *down, first_point=True)[0]
    np.testing.assert_allclose(after - before, [[0, 0, 1]], atol=1e-6)
    adapter.forget()


def test_installed_methods(monkeypatch):
    monkeypatch.setattr(pyvista.PolyData, "ray_trace", pyvista.PolyData.ray_trace)
    monkeypatch.setattr(pyvista.PolyData, "multi_ray_trace", pyvista.PolyData.multi_ray_trace)
    adapter.install()
    adapter.install()
    mesh = pyvista.Sphere()
    assert len(mesh.ray_trace([0, 0, 9], [0.1, 0, -9])[1]) == 2
    assert len(mesh.multi_ray_trace([[0.1, 0, 9]], [[0, 0, -1]], retry=True)[1]) == 2


def test_refusals():
    with pytest.raises(ValueError, match="end_point"):
        adapter.ray_trace(pyvista.Sphere(), [0, 0, 0], [[0, 0, 1]])
    with pytest.raises(ValueError, match="origins has 1"):
        adapter.multi_ray_trace(pyvista.Sphere(), [[0, 0, 0]], [[0, 0, 1]] * 2)


def test_points_lie_on_the_triangles_and_not_where_rounded_distances_end():
    """Far away a distance in float32 is known to some micrometres only."""
    grid = pyvista.ImageData(dimensions=(4, 4, 4))
    for shift in (9.0, 1e3):
        points, _, _ = adapter.multi_ray_trace(
            grid, [[0.11, 0.23, shift]], [[0, 0, -1]]
        )
        np.testing.assert_array_equal(points[:, 2], [3, 0])
        points, _ = adapter.ray_trace(grid, [0.11, 0.23, shift], [0.11, 0.23, -shift])
        np.testing.assert_array_equal(points[:, 2], [3, 0])


def test_segments_without_length_and_meshes_without_faces_cross_nothing():
    ball = pyvista.Sphere()
    points, cells = adapter.ray_trace(ball, [0, 0, 1], [0, 0, 1])
    assert points.shape == (0, 3) and cells.shape == (0,)
    with pytest.raises(ValueError, match="origin is .*nan.*finite"):
        adapter.ray_trace(ball, [0, 0, np.nan], [0, 0, 1])
    for empty in (pyvista.PolyData(), pyvista.Line(), pyvista.PolyData([[0.0, 0, 0]])):
        for first in (True, False):
            found = adapter.multi_ray_trace(empty, [[0, 0, 1]], [[0, 0, -1]], first)
            assert found[0].shape == (0, 3) and len(found[1]) == len(found[2]) == 0
    assert adapter.multi_ray_trace(ball, [], [])[0].shape == (0, 3)
