"""Pictures show what formulas say."""

import struct
import zlib

import numpy as np
import pytest
import rt_core
from shapes import sphere

CAMERA = rt_core.Camera((0, -5, 0), (0, 0, 0), height=4)
X, Z = np.meshgrid((np.arange(80) + 0.5) / 20 - 2, 2 - (np.arange(80) + 0.5) / 20)


def picture(*objects, **options):
    return rt_core.render(*objects, camera=CAMERA, size=(80, 80), **options)


def ball_grid(n=41):
    axis = np.linspace(-1.5, 1.5, n)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    return np.sqrt(x**2 + y**2 + z**2), {"spacing": axis[1] - axis[0], "origin": (-1.5,) * 3}


def balls():
    values, grid = ball_grid()
    return {
        "spheres": (rt_core.Spheres([[0, 0, 0]], 1.0), 1e-5),
        "mesh": (rt_core.Mesh(*sphere(96)), 2e-2),
        "isosurface": (rt_core.Isosurface(values, 1.0, **grid), 2e-2),
    }


@pytest.mark.parametrize("kind", ["spheres", "mesh", "isosurface"])
def test_balls_lie_where_they_are(kind):
    ball, tolerance = balls()[kind]
    shown = picture(ball)
    inside = X**2 + Z**2 < 0.95
    distance = 5 - np.sqrt(np.maximum(1 - X**2 - Z**2, 0))
    near = CAMERA._numbers()[1][2][0]
    np.testing.assert_allclose(shown.distance[inside] + near, distance[inside], atol=tolerance)
    assert (shown.object[inside] == 0).all()
    outside = X**2 + Z**2 > 1.05
    assert (shown.object[outside] == rt_core.NO_HIT).all()
    assert not shown.color[outside].any() and (shown.color[inside][:, 3] == 1).all()
    expected = np.stack([X, -np.sqrt(np.maximum(1 - X**2 - Z**2, 0)), Z], axis=-1)
    assert np.abs(shown.normal[inside] - expected[inside]).max() < 0.12
    # Light along the view: as bright as the surface faces the eye.
    facing = 0.8 * -shown.normal[inside][:, 1]
    np.testing.assert_allclose(shown.color[inside][:, 0], facing, atol=1e-3)


def test_objects_are_numbered_as_given_and_volumes_are_between_them():
    values, grid = ball_grid()
    fog = rt_core.Volume(values, [[0, 0.2], [1.4, 0.2]], **grid, color_map=[[1, 0, 0]])
    left = rt_core.Spheres([[-1, 3, 0]], 0.4)
    right = rt_core.Tubes([[1, 3, -2], [1, 3, 2]], 0.3)
    shown = picture(fog, left, right)
    assert shown.object[40, 20] == 1 and shown.object[40, 60] == 2
    alone = picture(left, right)
    assert alone.object[40, 20] == 0
    # Red light from the fog, less of the grey behind it.
    assert shown.color[40, 60, 1] < alone.color[40, 60, 1]
    assert shown.color[40, 40, 3] > 0.1 and shown.color[40, 40, 1] == 0


def test_colours_scalars_and_opacity():
    centers = [[-1, 0, 1], [1, 0, 1], [-1, 0, -1], [1, 0, -1]]
    greys = [[0, 0, 0], [1, 1, 1]]
    shown = picture(rt_core.Spheres(centers, 0.5, scalars=[0, 1, 2, 4], color_map=greys))
    middles = shown.color[[20, 20, 60, 60], [20, 60, 20, 60], 0]
    np.testing.assert_allclose(middles, [0, 0.25, 0.5, 1], atol=0.01)
    assert shown.primitive[60, 60] == 3
    colors = np.eye(4)[:, :3]
    shown = picture(rt_core.Spheres(centers, 0.5, colors=colors))
    np.testing.assert_allclose(shown.color[20, 60, :3], [0, 1, 0], atol=0.01)
    shown = picture(rt_core.Mesh(*sphere(), color=(1, 1, 1), opacity=0.5))
    np.testing.assert_allclose(shown.color[40, 40, 3], 0.75, atol=0.01)


def test_lights_shadows_and_occlusion():
    floor = rt_core.Mesh(
        [[-9, -9, -1], [9, -9, -1], [9, 9, -1], [-9, 9, -1]], [[0, 1, 2], [0, 2, 3]], color=(1,) * 3
    )
    ball = rt_core.Spheres([[0, 0, 0.5]], 1.0)
    above = rt_core.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), height=8)
    view = {"camera": above, "size": (80, 80)}
    lit = rt_core.render(floor, ball, lights=[(1, 0, 1)], **view)
    assert lit.color[40, 40 - 18, 0] == 0 and lit.color[40, 40 + 30, 0] > 0.6
    open_sky = rt_core.render(floor, ball, ambient=1.0, **view)
    dimmed = rt_core.render(
        floor, ball, ambient=1.0, ambient_occlusion=(np.inf, 16), samples=16, **view
    )
    assert open_sky.color[40, 52, 0] == 1 and dimmed.color[40, 52, 0] < 0.8
    assert dimmed.color[2, 2, 0] > 0.85
    for threads in (1, 3):
        again = rt_core.render(
            floor, ball, ambient=1.0, ambient_occlusion=(np.inf, 16), samples=16, threads=threads,
            **view,
        )  # fmt: skip
        np.testing.assert_array_equal(again.color, dimmed.color)


def test_png_files_have_the_picture(tmp_path):
    shown = picture(rt_core.Spheres([[0, 0, 0]], 1.0))
    shown.save(tmp_path / "ball.png")
    data = (tmp_path / "ball.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = {}, 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert zlib.crc32(kind + body) == struct.unpack(">I", data[at + 8 + length :][:4])[0]
        chunks[kind] = body
        at += 12 + length
    assert struct.unpack(">II", chunks[b"IHDR"][:8]) == (80, 80)
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), dtype=np.uint8).reshape(80, 321)
    np.testing.assert_array_equal(rows[:, 1:].reshape(80, 80, 4), shown.rgba8)
    with pytest.raises(ValueError, match="png"):
        shown.save(tmp_path / "ball.jpg")


def test_exr_files_have_every_layer_with_its_unit(tmp_path):
    """As the reader of the format's authors sees it."""
    openexr = pytest.importorskip("OpenEXR")
    near, far = rt_core.Spheres([[0, 0, 0]], 1.0), rt_core.Spheres([[1, 3, 0]], 1.0)
    shown = picture(near, far, samples=4)
    shown.save(tmp_path / "ball.EXR")
    with openexr.File(str(tmp_path / "ball.EXR"), separate_channels=True) as file:
        # The file clears its own when it is closed.
        header = dict(file.header())
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    layers = {"RGBA": shown.color, "depth.Z": shown.depth[..., None]}
    layers |= {"distance.Z": shown.distance[..., None], "id.instance": shown.object[..., None]}
    layers |= {"id.primitive": shown.primitive[..., None]}
    layers |= {f"normal.{axis}": shown.normal[..., i : i + 1] for i, axis in enumerate("XYZ")}
    found = 0
    for name, values in layers.items():
        for i, channel in enumerate(name if name == "RGBA" else [name]):
            pixels = channels[channel]
            assert pixels.dtype == values.dtype
            np.testing.assert_array_equal(pixels, values[..., i])
            assert header[f"unit.{channel}"]
            found += 1
    assert found == len(channels) and set(shown.object.flat) == {0, 1, rt_core.NO_HIT}
    assert header["unit.distance.Z"] == "world units from the eye"
    with pytest.raises(OSError):
        shown.save(tmp_path / "missing" / "ball.exr")


GRID = np.zeros((3, 3, 3))


@pytest.mark.parametrize(
    "thing, error, parts",
    [
        (rt_core.Spheres([[0, 0, 0]], -1), ValueError, ["radii[0]", "-1", "positive"]),
        (rt_core.Spheres([[0, 0, np.nan]], 1), ValueError, ["centers[0]", "nan"]),
        (rt_core.Spheres([[0, 0, 0]], [1, 2]), ValueError, ["radii", "(2,)"]),
        (rt_core.Tubes([[0, 0, 0]] * 3, 1, offsets=[0, 9]), IndexError, ["offsets", "9"]),
        (rt_core.Tubes([[0, 0, 0]] * 3, 1, offsets=[1, 3]), ValueError, ["object 0"]),
        (rt_core.Tubes([[0, 0, 0]] * 3, 1, offsets=[0.5]), TypeError, ["offsets", "float64"]),
        (rt_core.Isosurface(GRID, np.nan), ValueError, ["isovalues", "nan"]),
        (rt_core.Isosurface(GRID, 1, spacing=-1), ValueError, ["spacing", "-1", "positive"]),
        (rt_core.Isosurface(GRID[0], 1), ValueError, ["values", "(3, 3)"]),
        (rt_core.Volume(GRID, [[0, 2]]), ValueError, ["object 0", "opacity"]),
        (rt_core.Volume(GRID, [0, 1]), ValueError, ["opacity", "(2,)"]),
        (rt_core.Mesh(*sphere(4), scalars=[1, 2]), ValueError, ["scalars", "(2,)"]),
        (rt_core.Mesh(*sphere(4), color="red"), TypeError, ["color"]),
        (rt_core.Mesh(*sphere(4), opacity=2), ValueError, ["opacity", "2.0", "0 to 1"]),
        (rt_core.Mesh(*sphere(4), normals=[[0, 0, 1]]), ValueError, ["normals", "(1, 3)"]),
        (sphere(4), TypeError, ["object 0", "tuple"]),
    ],
)
def test_refusals(thing, error, parts):
    with pytest.raises(error) as caught:
        rt_core.render(thing, size=(4, 4))
    assert all(part in str(caught.value) for part in parts), caught.value


@pytest.mark.parametrize(
    "options, error, part",
    [
        ({"size": (0, 4)}, ValueError, "size"),
        ({"size": 4}, ValueError, "size"),
        ({"samples": 0}, ValueError, "samples"),
        ({"samples": 1.5}, TypeError, "samples"),
        ({"seed": -1}, ValueError, "seed"),
        ({"ambient": 2}, ValueError, "ambient"),
        ({"ambient_occlusion": 1}, TypeError, "ambient_occlusion"),
        ({"lights": [(0, 0)]}, ValueError, r"lights\[0\]"),
        ({"lights": [(0, 0, 0)]}, ValueError, "light"),
        ({"camera": (0, 0, 1)}, TypeError, "camera"),
        ({"camera": rt_core.Camera((0, 0, 1), (0, 0, 1))}, ValueError, "."),
        ({"camera": rt_core.Camera((0, 0, 1), (0, 1, 0), fov=200)}, ValueError, "fov"),
    ],
)
def test_options_that_are_refused(options, error, part):
    with pytest.raises(error, match=part):
        rt_core.render(rt_core.Spheres([[0, 0, 0]], 1.0), **{"size": (4, 4), **options})
