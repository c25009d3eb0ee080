"""Answers of scenes, against formulas and slow references."""

import pickle

import numpy as np
import pytest
import rt_core
from shapes import rays, sphere


@pytest.fixture(scope="module")
def ball():
    return rt_core.Scene(*sphere())


def brute_force(vertices, triangles, origin, direction):
    a, b, c = (vertices[triangles[:, k]].astype(np.float64) for k in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    det = np.einsum("ij,ij->i", e1, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origin - a
        u = np.einsum("ij,ij->i", s, p) / det
        q = np.cross(s, e1)
        v = q @ direction / det
        t = np.einsum("ij,ij->i", e2, q) / det
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
    return np.sort(t[inside])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_hits_are_those_of_brute_force(ball, dtype):
    vertices, triangles = sphere()
    origins, directions = rays(300, dtype=dtype)
    hits = ball.cast(origins, directions)
    assert hits.t.dtype == dtype and hits.primitive.dtype == np.uint32
    lists = ball.all_hits(origins, directions)
    for i, (o, d) in enumerate(zip(origins.astype(float), directions.astype(float))):
        expected = brute_force(vertices, triangles, o, d)
        assert hits.hit[i] == (len(expected) > 0)
        found = lists.t[lists.starts[i] : lists.starts[i + 1]]
        np.testing.assert_allclose(found, expected, rtol=2e-6)
        if len(expected):
            np.testing.assert_allclose(hits.t[i], expected[0], rtol=2e-6)
    np.testing.assert_array_equal(ball.occluded(origins, directions), hits.hit)
    np.testing.assert_array_equal(ball.count(origins, directions), np.diff(lists.starts))
    np.testing.assert_array_equal(np.unique(lists.ray), np.flatnonzero(hits.hit))


def test_uv_and_normal_belong_to_the_triangle(ball):
    vertices, triangles = sphere()
    origins, directions = rays(2000)
    t, primitive, uv, normal = ball.cast(origins, directions)
    hit = primitive != rt_core.NO_HIT
    assert hit.any() and not hit.all()
    corners = vertices[triangles[primitive[hit]]]
    weights = np.column_stack([1 - uv[hit].sum(axis=1), uv[hit]])
    points = np.einsum("ij,ijk->ik", weights, corners)
    np.testing.assert_allclose(points, (origins + t[:, None] * directions)[hit], atol=1e-5)
    # The sphere's normals point away from its centre.
    assert (np.einsum("ij,ij->i", normal[hit], points) > 0.9).all()
    np.testing.assert_allclose(np.linalg.norm(normal[hit], axis=1), 1, rtol=1e-6)
    assert np.isinf(t[~hit]).all() and not normal[~hit].any() and not uv[~hit].any()


def test_answers_do_not_depend_on_threads_nor_on_neighbours(ball):
    origins, directions = rays(40_000)
    all_at_once = ball.cast(origins, directions)
    for threads in (1, 2, 5):
        for a, b in zip(all_at_once, ball.cast(origins, directions, threads=threads)):
            np.testing.assert_array_equal(a, b)
    for i in range(0, 40_000, 997):
        alone = ball.cast(origins[i : i + 1], directions[i : i + 1])
        for a, b in zip(all_at_once, alone):
            np.testing.assert_array_equal(a[i : i + 1], b)


def test_out_is_written_and_returned(ball):
    origins, directions = rays(100)
    first = ball.cast(origins, directions)
    again = ball.cast(origins[::-1], directions[::-1], out=first)
    assert all(a is b for a, b in zip(first, again))
    np.testing.assert_array_equal(again.t, ball.cast(origins[::-1], directions[::-1]).t)
    blocked = np.empty(100, dtype=bool)
    assert ball.occluded(origins, directions, out=blocked) is blocked
    counts = np.empty(100, dtype=np.uint32)
    assert ball.count(origins, directions, out=counts) is counts


def test_ranges_are_kept(ball):
    origin, direction = [[0, 0.01, 5]], [[0, 0, -1]]
    first, second = ball.all_hits(origin, direction).t
    assert ball.cast(origin, direction, t_min=(first + second) / 2).t == second
    assert not ball.occluded(origin, direction, t_max=first * 0.99)[0]
    assert ball.occluded(origin, direction, t_max=[first * 1.01])[0]
    assert ball.count(origin, direction, t_max=(first + second) / 2)[0] == 1


def test_points_inside_and_distances(ball):
    points = np.array([[0, 0, 0], [0, 0, 0.9], [0, 0, 1.5], [3, 0, 0]], dtype=np.float32)
    assert ball.contains(points).tolist() == [True, True, False, False]
    signed = ball.signed_distance(points)
    np.testing.assert_allclose(signed, [-1, -0.1, 0.5, 2], atol=0.006)
    closest = ball.closest_point(points.astype(np.float64), max_distance=1.2)
    np.testing.assert_allclose(closest.distance[:3], np.abs(signed[:3]), atol=1e-6)
    assert np.isinf(closest.distance[3]) and closest.primitive[3] == rt_core.NO_HIT
    assert np.isnan(closest.point[3]).all()
    np.testing.assert_allclose(closest.point[2], [0, 0, 1], atol=1e-6)


def test_far_coordinates_keep_their_detail():
    corner = np.array([500_000.25, 5_400_000.5, 312.75])
    vertices = corner + np.array([[0, 0, 0], [0.001, 0, 0], [0, 0.001, 0]])
    scene = rt_core.Scene(vertices, [[0, 1, 2]])
    origin = corner + [0.00025, 0.00025, 1000]
    assert scene.cast([origin], [[0, 0, -1]]).hit[0]
    assert not scene.occluded([origin + [0.001, 0, 0]], [[0, 0, -1]])[0]
    np.testing.assert_allclose(scene.bounds, [vertices.min(axis=0), vertices.max(axis=0)])
    assert "relative to" in scene.copied[0]


def test_nothing_is_copied_that_can_be_used_as_it_is():
    vertices, triangles = sphere()
    for kind in (np.uint32, np.int32):
        scene = rt_core.Scene(vertices, triangles.astype(kind, copy=False))
        assert scene.copied == ()
        assert np.shares_memory(scene._meshes[0][0], vertices)
    for kind in (np.int64, np.uint64, np.int16, np.uint16):
        scene = rt_core.Scene(vertices, triangles.astype(kind))
        assert scene.copied == (f"triangles: {np.dtype(kind)} to uint32",)
    assert rt_core.Scene(vertices[:, ::-1], triangles).copied == ("vertices: to C order",)
    read_only = vertices.copy()
    read_only.flags.writeable = False
    assert rt_core.Scene(read_only, triangles).copied == ()


def test_scenes_pickle(ball):
    again = pickle.loads(pickle.dumps(ball))
    origins, directions = rays(1000)
    for a, b in zip(ball.cast(origins, directions), again.cast(origins, directions)):
        np.testing.assert_array_equal(a, b)
    assert again.copied == ball.copied
    far = rt_core.Scene(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) + 1e6, [[0, 1, 2]])
    again = pickle.loads(pickle.dumps(far))
    np.testing.assert_array_equal(again.bounds, far.bounds)


def test_several_meshes_are_numbered_through():
    vertices, triangles = sphere(8)
    moved = vertices + np.float32([5, 0, 0])
    scene = rt_core.Scene.from_meshes([(vertices, triangles), (moved, triangles)])
    hits = scene.cast([[5.1, 0.1, 5], [0.1, 0.1, 5], [99, 0, 0]], [[0, 0, -1]] * 3)
    mesh, triangle = scene.split(hits.primitive)
    assert mesh.tolist() == [1, 0, -1] and triangle[2] == -1
    assert hits.primitive[0] == len(triangles) + triangle[0]
    np.testing.assert_array_equal(
        scene.split([0, len(triangles) - 1, len(triangles)])[0], [0, 0, 1]
    )


def test_an_empty_scene_has_no_hits():
    scene = rt_core.Scene(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    assert not scene.cast([[0, 0, 0]], [[0, 0, 1]]).hit[0]
    assert np.isnan(scene.signed_distance([[0, 0, 0]])[0]) and scene.bounds is None
    assert len(scene.cast(np.zeros((0, 3)), np.zeros((0, 3))).t) == 0


def test_compact_scenes_have_the_bits_of_plain_ones_in_less_memory():
    vertices, triangles = sphere(128)
    plain, compact = (
        rt_core.Scene(vertices, triangles, storage=storage) for storage in ("plain", "compact")
    )
    assert compact.nbytes < plain.nbytes / 3
    origins, directions = rays(3000)
    again = pickle.loads(pickle.dumps(compact))
    assert again.nbytes == compact.nbytes
    for scene in (compact, again):
        for query in ("cast", "occluded", "count", "all_hits"):
            found = getattr(scene, query)(origins, directions)
            expected = getattr(plain, query)(origins, directions)
            pairs = zip(found, expected) if isinstance(found, tuple) else [(found, expected)]
            for one, other in pairs:
                np.testing.assert_array_equal(one, other)
        points = 0.7 * origins
        np.testing.assert_array_equal(scene.contains(points), plain.contains(points))
        np.testing.assert_array_equal(scene.signed_distance(points), plain.signed_distance(points))


def test_normals_of_very_many_meshes_are_those_of_one_mesh():
    vertices, triangles = sphere(6)
    rng = np.random.default_rng(4)
    places = rng.uniform(-1, 1, (300, 1, 3)).astype(np.float32)
    parts = list(np.float32(0.1) * vertices + places)
    offsets = (np.arange(len(parts)) * len(vertices))[:, None, None]
    merged = rt_core.Scene(np.concatenate(parts), (triangles + offsets).reshape(-1, 3))
    apart = rt_core.Scene.from_meshes([(part, triangles) for part in parts])
    for count in (1, 500, 5000):
        origins, directions = rays(count)
        hits, expected = (scene.cast(origins, directions) for scene in (apart, merged))
        for name in ("primitive", "t", "normal"):
            np.testing.assert_array_equal(getattr(hits, name), getattr(expected, name))
    assert hits.hit.sum() > 1000 and (np.abs(hits.normal).sum(axis=1) > 0).sum() == hits.hit.sum()


def test_normals_are_optional():
    vertices, triangles = sphere(16)
    scene = rt_core.Scene(vertices, triangles)
    origins, directions = rays(3000)
    hits = scene.cast(origins, directions)
    bare = scene.cast(origins, directions, normals=False)
    assert bare.normal.shape == (0, 3) and hits.hit.any()
    for name in ("t", "primitive", "uv", "hit"):
        np.testing.assert_array_equal(getattr(bare, name), getattr(hits, name))
    again = scene.cast(origins, directions, normals=False, out=bare)
    assert again.t is bare.t and again.normal is bare.normal
    with pytest.raises(ValueError, match="normal"):
        scene.cast(origins, directions, out=bare)


def test_hits_of_glancing_rays_lie_on_their_triangles():
    """embree 387: a hit far behind a skinny triangle that the ray passes at half a degree."""
    rng = np.random.default_rng(7)
    count = 20_000
    first = rng.uniform(-300, 300, (count, 3))
    long_side = rng.normal(size=(count, 3))
    long_side *= 11 / np.linalg.norm(long_side, axis=1, keepdims=True)
    short_side = 0.12 * rng.normal(size=(count, 3))
    corners = np.stack([first, first + long_side, first + 0.9 * long_side + short_side], axis=1)
    corners = corners.astype(np.float32).astype(np.float64)
    scene = rt_core.Scene(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    # Nearly in the plane of one of the triangles, through a point near it.
    normal = np.cross(long_side, short_side)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    aim = corners.mean(axis=1) + 0.02 * rng.normal(size=(count, 3))
    way = long_side / 11 + 0.01 * normal + 0.3 * rng.normal(size=(count, 1)) * short_side
    origins = aim - 400 * way
    hits = scene.all_hits(origins, way)
    assert len(hits.t) > 0.3 * count
    places = origins[hits.ray] + hits.t[:, None] * way[hits.ray]
    of = corners[hits.primitive]
    outside = np.maximum(of.min(axis=1) - places, places - of.max(axis=1)).max(axis=1)
    # Half a degree turns a rounding of the heights, 2e-5, into 100 times as much along the ray.
    assert outside.max() < 0.02, outside.max()


def test_no_ray_passes_between_triangles():
    """Rays at the middles of edges and at vertices of a closed mesh (trimesh 1180, embree 387)."""
    vertices, triangles = sphere(64)
    ends = vertices[triangles].astype(np.float64)
    targets = np.concatenate([(ends[:, 0] + ends[:, 1]) / 2, vertices[1:-1]])
    scene = rt_core.Scene(vertices, triangles)
    rng = np.random.default_rng(5)
    for _ in range(20):
        origins = rng.uniform(-0.5, 0.5, size=targets.shape)
        assert scene.occluded(origins, targets - origins).all()
        assert (scene.count(origins, targets - origins) % 2 == 1).all()
