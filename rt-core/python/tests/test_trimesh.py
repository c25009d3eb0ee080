"""trimesh with rt_core's rays has the answers of its own slow ones, and more hits on edges."""

import copy
import pickle

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("rtree")

from rt_core.trimesh import RayMeshIntersector, install  # noqa: E402


def rays(count=400, seed=3):
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3)) * 3
    return origins, rng.uniform(-1, 1, size=(count, 3)) - origins


@pytest.mark.parametrize("shift", [0, 1e4])
@pytest.mark.parametrize("scale", [1e-3, 1, 1e4])
def test_answers_are_those_of_trimesh(scale, shift):
    mesh = trimesh.creation.torus(1.0, 0.4)
    mesh.apply_scale(scale)
    mesh.apply_translation([shift * scale] * 3)
    origins, directions = rays()
    origins = origins * scale + shift * scale
    ours, theirs = RayMeshIntersector(mesh), trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    any_hit = theirs.intersects_any(origins, directions)
    np.testing.assert_array_equal(ours.intersects_any(origins, directions), any_hit)
    first = ours.intersects_first(origins, directions)
    np.testing.assert_array_equal(first, theirs.intersects_first(origins, directions))
    for multiple in (True, False):
        places, ray, tri = ours.intersects_location(origins, directions, multiple_hits=multiple)
        expected = theirs.intersects_location(origins, directions, multiple_hits=multiple)
        order, other = np.lexsort((tri, ray)), np.lexsort((expected[2], expected[1]))
        np.testing.assert_array_equal(ray[order], expected[1][other])
        np.testing.assert_array_equal(tri[order], expected[2][other])
        error = np.abs(places[order] - expected[0][other]).max()
        assert error < 1e-9 * scale * max(shift, 1), error
    points = origins * 0.3 + 0.7 * shift * scale
    np.testing.assert_array_equal(ours.contains_points(points), theirs.contains_points(points))


def test_no_ray_is_lost_at_edges_and_vertices():
    """What trimesh 1180, 1496 and 1919 report of other engines."""
    mesh = trimesh.creation.icosphere(subdivisions=4)
    ours = RayMeshIntersector(mesh)
    middles = mesh.vertices[mesh.edges_unique].mean(axis=1)
    targets = np.concatenate([mesh.vertices, middles])
    origins = np.zeros_like(targets)
    assert ours.intersects_any(origins, targets).all()
    _, ray = ours.intersects_id(origins, targets)
    np.testing.assert_array_equal(np.bincount(ray, minlength=len(targets)), 1)


def test_rays_to_the_vertices_of_a_larger_box_meet_the_smaller_one():
    """trimesh 1496: any, first and all agree, along edges and through vertices of both boxes."""
    small = trimesh.creation.box(extents=[40, 40, 40]).subdivide_to_size(20)
    large = trimesh.creation.box(extents=[60, 60, 60]).subdivide_to_size(20)
    ours = RayMeshIntersector(small)
    origins = np.zeros_like(large.vertices)
    assert ours.intersects_any(origins, large.vertices).all()
    assert (ours.intersects_first(origins, large.vertices) >= 0).all()
    for multiple in (True, False):
        _, ray = ours.intersects_id(origins, large.vertices, multiple_hits=multiple)
        np.testing.assert_array_equal(np.sort(ray), np.arange(len(large.vertices)))


def test_the_edge_between_two_triangles_is_met():
    """trimesh 1766 and mitsuba3 1149: rays at points of the diagonal of a square."""
    mesh = trimesh.Trimesh([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0]], [[0, 1, 2], [2, 3, 0]])
    along = np.linspace(-1, 1, 2001)[1:-1, None]
    targets = along * [1, 1, 0]
    for origin in ([0, 0, 1], [0.3, -0.7, 1e-3], [-50, 20, 0.1]):
        origins = np.broadcast_to(np.array(origin, dtype=float), targets.shape)
        places, ray, _ = RayMeshIntersector(mesh).intersects_location(origins, targets - origins)
        # Where a target is rounded off the edge, it lies on one of the triangles.
        np.testing.assert_array_equal(ray, np.arange(len(targets)))
        np.testing.assert_allclose(places, targets, atol=1e-6 * (1 + np.abs(origin).max()))


def test_the_mesh_may_change_and_travel():
    mesh = trimesh.creation.box()
    mesh.ray = RayMeshIntersector(mesh)
    above = [[0, 0, 9]], [[0, 0, -1]]
    assert mesh.ray.intersects_location(*above)[0][0, 2] == 0.5
    mesh.apply_translation([0, 0, 1])
    assert mesh.ray.intersects_location(*above)[0][0, 2] == 1.5
    for again in (copy.deepcopy(mesh.ray), pickle.loads(pickle.dumps(mesh.ray))):
        assert again.intersects_any(*above)[0]


def test_input_is_read_as_trimesh_reads_it():
    mesh = trimesh.creation.box()
    ours = RayMeshIntersector(mesh)
    assert ours.intersects_first([[0, 0, 9], [0, 0, 9]], [[0, 0, 0], [0, 0, -2]])[0] == -1
    with pytest.raises(ValueError, match="ray_origins has 1"):
        ours.intersects_any([[0, 0, 0]], [[0, 0, 1]] * 2)
    tri, ray, places = ours.intersects_id([[9, 9, 9]], [[0, 0, 1]], return_locations=True)
    assert tri.shape == ray.shape == (0,) and places.shape == (0, 3)
    assert len(ours.intersects_id([[0.1, 0, 9]], [[0, 0, -1]], max_hits=1)[0]) == 1
    # A ray that starts on the surface meets it there, as trimesh's tests of Embree ask for.
    assert len(ours.intersects_id([[0.1, 0, 0.5]], [[0, 0, -1]])[0]) == 2


def test_installed_for_new_meshes(monkeypatch):
    import sys

    monkeypatch.setattr(trimesh.ray, "ray_pyembree", None)
    monkeypatch.setattr(trimesh.ray, "has_embree", False)
    monkeypatch.setitem(sys.modules, "trimesh.ray.ray_pyembree", None)
    install()
    assert isinstance(trimesh.creation.box().ray, RayMeshIntersector)
    slow = trimesh.Trimesh(*[[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]], use_embree=False)
    assert not isinstance(slow.ray, RayMeshIntersector)


def test_shapes_that_are_no_rows_are_named():
    ours = RayMeshIntersector(trimesh.creation.box())
    with pytest.raises(ValueError, match=r"ray_origins has shape \(1, 2\); give \(n, 3\)"):
        ours.intersects_any([[0, 0]], [[0, 1]])
    with pytest.raises(ValueError, match=r"points has shape \(3, 2\)"):
        ours.contains_points([[0, 0]] * 3)
