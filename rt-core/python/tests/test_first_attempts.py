"""What people try first who have not read the documentation: it works, or the message says how it
does."""

import numpy as np
import pytest
import rt_core

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
SCENE = rt_core.Scene(VERTICES, TRIANGLES)
RAY = [[0.1, 0.1, 5]], [[0, 0, -1]]
HIDDEN = np.ma.masked_equal(VERTICES, 1)
NOTHING = np.ma.masked_array(VERTICES)
GRID = np.random.default_rng(1).random((4, 5, 6))
FEW = {"size": (4, 4)}


def mesh(**look):
    return rt_core.Mesh(VERTICES, TRIANGLES, **look)


def from_eye(**options):
    camera = rt_core.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), **options)
    return rt_core.render(mesh(), camera=camera, **FEW)


@pytest.mark.parametrize(
    "call, error, parts",
    [
        (lambda: SCENE.cast([0, 0, 5], [0, 0, -1]), ValueError, ["origins", "(3,)", "[origins]"]),
        (lambda: SCENE.contains([0, 0, 5]), ValueError, ["points", "(3,)", "[points]"]),
        (lambda: rt_core.Scene(np.ones((3, 9)), TRIANGLES), ValueError, ["perhaps vertices.T"]),
        (lambda: rt_core.Scene([], TRIANGLES), IndexError, ["0 vertices; give vertices"]),
        (lambda: rt_core.Scene("a.obj", TRIANGLES), TypeError, ["vertices is 'a.obj'"]),
        (lambda: rt_core.Scene(HIDDEN, TRIANGLES), ValueError, ["vertices is masked, 3 of 12"]),
        (lambda: SCENE.cast(HIDDEN, HIDDEN), ValueError, ["origins is masked"]),
        (
            lambda: rt_core.Scene(VERTICES, np.ma.masked_equal(TRIANGLES, 0)),
            ValueError,
            ["triangles is masked", "triangles.filled"],
        ),
        (
            lambda: rt_core.Scene.from_meshes([VERTICES, TRIANGLES]),
            TypeError,
            ["mesh 0 is of type ndarray", "pair of vertices and triangles"],
        ),
        (lambda: rt_core.Scene.from_meshes(3), TypeError, ["meshes is 3", "list of pairs"]),
        (lambda: SCENE.split([4]), IndexError, ["primitive has 4", "4 triangles"]),
        (lambda: SCENE.split([-1]), IndexError, ["primitive has -1"]),
        (lambda: SCENE.split([0.5]), TypeError, ["primitive", "float64"]),
        (lambda: rt_core.render(mesh(), size=8), ValueError, ["size is 8", "width and height"]),
        (lambda: rt_core.render(mesh(), size=(8.0, 8)), TypeError, ["size[0] is 8.0", "whole"]),
        (lambda: rt_core.render(mesh(), size=(8, 0)), ValueError, ["size[1] is 0", "65536"]),
        (lambda: rt_core.render(mesh(), seed=1.5), TypeError, ["seed is 1.5", "whole"]),
        (lambda: rt_core.render(mesh(color="red"), **FEW), TypeError, ["color is 'red'"]),
        (
            lambda: rt_core.render(mesh(color=(255, 0, 0)), **FEW),
            ValueError,
            ["color is (255, 0, 0)", "0 to 1"],
        ),
        (
            lambda: rt_core.render(mesh(colors=np.full((4, 3), 128, np.uint8)), **FEW),
            ValueError,
            ["colors has the number 128", "0 to 1"],
        ),
        (
            lambda: rt_core.render(mesh(scalars=range(4), color_map="viridis"), **FEW),
            TypeError,
            ["color_map is 'viridis'"],
        ),
        (
            lambda: rt_core.render(mesh(scalars=[[1]] * 4), **FEW),
            ValueError,
            ["scalars has shape (4, 1); give (4,)"],
        ),
        (
            lambda: rt_core.render(rt_core.Volume(GRID, [[0, 1]], spacing=(1, 2)), **FEW),
            ValueError,
            ["spacing has shape (2,)", "one number, or three"],
        ),
        (
            lambda: rt_core.render(mesh(), ambient_occlusion=(1.0, 4.7), **FEW),
            TypeError,
            ["ambient_occlusion[1] is 4.7", "whole"],
        ),
        (
            lambda: rt_core.render(mesh(), camera=rt_core.Camera((1, 2, 3), (1, 2, 3)), **FEW),
            ValueError,
            ["eye and target are both [1.0, 2.0, 3.0]"],
        ),
        (lambda: from_eye(fov=200), ValueError, ["fov is 200.0", "0 and 180"]),
        (lambda: from_eye(fov="wide"), TypeError, ["fov is 'wide'"]),
        (lambda: from_eye(near="0"), TypeError, ["near is '0'"]),
        (lambda: from_eye(near=9, far=1), ValueError, ["far is 1.0", "more than near, 9.0"]),
    ],
)
def test_what_does_not_work_is_said(call, error, parts):
    with pytest.raises(error) as caught:
        call()
    assert type(caught.value) is error
    assert all(part in str(caught.value) for part in parts), caught.value


@pytest.mark.parametrize(
    "call",
    [
        lambda: rt_core.Scene(NOTHING, np.ma.masked_array(TRIANGLES)).num_triangles,
        lambda: rt_core.Scene(VERTICES.astype(">f4"), TRIANGLES.astype(">i4")).cast(*RAY).t,
        lambda: rt_core.Scene(np.asfortranarray(VERTICES), TRIANGLES.astype("u1")).cast(*RAY).t,
        lambda: SCENE.cast(*RAY, t_min=np.array(1.0), t_max=np.array([9])).t,
        lambda: rt_core.render(mesh(), size=np.array([8, 6])).depth,
        lambda: rt_core.render(mesh(scalars=np.arange(4, dtype="u1")), **FEW).depth,
        lambda: from_eye(near=2000).depth,
        lambda: SCENE.split(SCENE.cast(*RAY).primitive),
        lambda: rt_core.Scene([], []).split([rt_core.NO_HIT]),
    ],
)
def test_what_works(call):
    found = call()
    assert np.isfinite(found).all()
