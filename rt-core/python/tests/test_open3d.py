"""The class `RaycastingScene` has Open3D's names, shapes, types and, where it is here, answers."""

import numpy as np
import pytest
from rt_core.open3d import RaycastingScene
from shapes import rays, sphere


def scene_of(cls, wrap=lambda a: a):
    scene = cls()
    vertices, triangles = sphere(24)
    assert scene.add_triangles(wrap(vertices), wrap(triangles)) == 0
    assert scene.add_triangles(wrap(vertices + np.float32([3, 0, 0])), wrap(triangles)) == 1
    return scene


def rows(count=4000):
    origins, directions = rays(count)
    return np.concatenate([origins, directions], axis=1)


POINTS = np.random.default_rng(4).uniform(-1.5, 4.5, size=(2000, 3)).astype(np.float32)


def test_shapes_and_types():
    scene = scene_of(RaycastingScene)
    image = scene.create_rays_pinhole(
        fov_deg=60, center=[0, 0, 0], eye=[0, -4, 0], up=[0, 0, 1], width_px=32, height_px=24
    )
    assert image.shape == (24, 32, 6) and image.dtype == np.float32
    hits = scene.cast_rays(image)
    assert hits["t_hit"].shape == (24, 32) and hits["primitive_uvs"].shape == (24, 32, 2)
    assert hits["geometry_ids"][12, 16] == 0
    assert abs(hits["t_hit"][12, 16] - 3) < 0.02
    assert hits["primitive_ids"][0, 0] == scene.INVALID_ID == hits["geometry_ids"][0, 0]
    assert scene.count_intersections(image).dtype == np.int32
    inside = scene.compute_occupancy([[[0, 0, 0], [3, 0, 0], [1.5, 0, 0]]])
    np.testing.assert_array_equal(inside, np.float32([[1, 1, 0]]))
    assert abs(scene.compute_signed_distance([[3, 0, 0]])[0] + 1) < 0.02


def test_lists_are_the_hits_of_count():
    scene = scene_of(RaycastingScene)
    found = scene.list_intersections(rows())
    np.testing.assert_array_equal(np.diff(found["ray_splits"]), scene.count_intersections(rows()))
    first = found["ray_splits"][:-1][scene.count_intersections(rows()) > 0]
    hits = scene.cast_rays(rows())
    met = np.isfinite(hits["t_hit"])
    np.testing.assert_array_equal(found["t_hit"][first], hits["t_hit"][met])
    np.testing.assert_array_equal(scene.test_occlusions(rows()), met)


def test_refusals():
    scene = RaycastingScene()
    with pytest.raises(ValueError, match=r"rays has shape \(5,\)"):
        scene.cast_rays(np.zeros(5))
    with pytest.raises(IndexError, match="triangles"):
        scene.add_triangles(np.zeros((3, 3)), [[0, 1, 3]])
    with pytest.raises(TypeError, match="complex"):
        scene.compute_distance(np.zeros((1, 3), dtype=complex))
    with pytest.raises(TypeError, match="fov_deg"):
        scene.create_rays_pinhole(width_px=4, height_px=4)


def test_answers_are_those_of_open3d():
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    ours = scene_of(RaycastingScene)
    theirs = scene_of(o3d.t.geometry.RaycastingScene, o3d.core.Tensor)
    own, other = ours.cast_rays(rows()), theirs.cast_rays(o3d.core.Tensor(rows()))
    for name in ("geometry_ids", "primitive_ids"):
        assert (own[name] == other[name].numpy()).mean() > 0.999, name
    same = own["primitive_ids"] == other["primitive_ids"].numpy()
    for name in ("t_hit", "primitive_uvs", "primitive_normals"):
        values = other[name].numpy()
        assert own[name].dtype == values.dtype and own[name].shape == values.shape
        np.testing.assert_allclose(own[name][same], values[same], atol=2e-4)
    lists, expected = ours.list_intersections(rows()), theirs.list_intersections(rows())
    assert set(lists) == set(expected.keys())
    for name, values in expected.items():
        assert lists[name].dtype == values.numpy().dtype, name
    for name in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
        values = getattr(theirs, name)(POINTS).numpy()
        np.testing.assert_allclose(getattr(ours, name)(POINTS), values, atol=1e-4)
    closest, expected = ours.compute_closest_points(POINTS), theirs.compute_closest_points(POINTS)
    assert set(closest) == set(expected.keys())
    # Where two triangles are as near, either may be named: the distance counts.
    both = closest["points"], expected["points"].numpy()
    ways = [np.linalg.norm(points - POINTS, axis=1) for points in both]
    np.testing.assert_allclose(*ways, atol=1e-6)
    view = {"fov_deg": 50, "center": [1, 2, 3], "eye": [5, 4, 3.5], "up": [0, 0, 1]}
    pixels = {"width_px": 30, "height_px": 20}
    np.testing.assert_allclose(
        ours.create_rays_pinhole(**view, **pixels),
        theirs.create_rays_pinhole(**view, **pixels).numpy(),
        atol=1e-5,
    )
