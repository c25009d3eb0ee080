"""Bad input gets an exception of the right class that names field, value and cure."""

import numpy as np
import pytest
import rt_core
from shapes import sphere

VERTICES, TRIANGLES = sphere(8)
SCENE = rt_core.Scene(VERTICES, TRIANGLES)
ROW, NAN = [[0.0, 0.0, 1.0]], [[0.0, float("nan"), 1.0]]


def changed(array, row, value):
    array = array.copy()
    array[row, 0] = value
    return array


@pytest.mark.parametrize(
    "vertices, triangles, error, parts",
    [
        (VERTICES[:, :2], TRIANGLES, ValueError, ["vertices", "(114, 2)", "(N, 3)"]),
        (VERTICES.ravel(), TRIANGLES, ValueError, ["vertices", "(342,)", "(N, 3)"]),
        (VERTICES > 0, TRIANGLES, TypeError, ["vertices", "bool", "float32"]),
        (VERTICES.astype(complex), TRIANGLES, TypeError, ["vertices", "complex128"]),
        (VERTICES.astype(str), TRIANGLES, TypeError, ["vertices", "<U"]),
        ([[0, 0, 0], [1, 0]], TRIANGLES, ValueError, ["vertices", "rows"]),
        (changed(VERTICES, 7, np.nan), TRIANGLES, ValueError, ["vertices[7]", "nan", "finite"]),
        (changed(VERTICES, 3, np.inf), TRIANGLES, ValueError, ["vertices[3]", "inf"]),
        (VERTICES * 1e38 * np.float64(1), TRIANGLES, ValueError, ["vertices", "1e37"]),
        (VERTICES, TRIANGLES.astype(float), TypeError, ["triangles", "float64", "integer"]),
        (VERTICES, TRIANGLES[:, :2], ValueError, ["triangles", "(M, 3)"]),
        (VERTICES, changed(TRIANGLES, 5, 2**32 - 1), IndexError, ["triangles[5]", "4294967295"]),
        (VERTICES, changed(TRIANGLES.astype(int), 5, -1), IndexError, ["triangles[5]", "-1"]),
        (VERTICES, changed(TRIANGLES.astype(int), 2, 2**40), IndexError, [str(2**40), "0 to 113"]),
    ],
)
def test_arrays_of_meshes(vertices, triangles, error, parts):
    with pytest.raises(error) as caught:
        rt_core.Scene(vertices, triangles)
    assert type(caught.value) is error
    assert all(part in str(caught.value) for part in parts), caught.value
    with pytest.raises(error, match="mesh 1: "):
        rt_core.Scene.from_meshes([(VERTICES, TRIANGLES), (vertices, triangles)])


@pytest.mark.parametrize("call", ["cast", "occluded", "count", "all_hits"])
@pytest.mark.parametrize(
    "origins, directions, options, error, parts",
    [
        (ROW, ROW * 2, {}, ValueError, ["origins has 1", "directions has 2"]),
        ([0, 0, 1], ROW, {}, ValueError, ["origins", "(3,)", "(N, 3)"]),
        (NAN, ROW, {}, ValueError, ["origins[0]", "NaN", "finite"]),
        (ROW * 3, ROW + NAN + ROW, {}, ValueError, ["directions[1]", "NaN"]),
        (ROW, [[0, 0, 0]], {}, ValueError, ["directions[0]", "zero"]),
        (ROW, [[0, 0, 1e300]], {}, ValueError, ["directions[0]", "1e300", "3e38"]),
        (ROW, [["a", "b", "c"]], {}, TypeError, ["directions", "<U1"]),
        (ROW, ROW, {"t_max": [1, 2]}, ValueError, ["t_max", "(2,)"]),
        (ROW, ROW, {"t_max": np.nan}, ValueError, ["t_max[0]", "NaN"]),
        (ROW, ROW, {"t_min": -1}, ValueError, ["t_min", "-1.0", "0 or more"]),
        (ROW, ROW, {"t_min": np.nan}, ValueError, ["t_min", "nan"]),
        (ROW, ROW, {"t_min": "0"}, TypeError, ["t_min", "'0'"]),
        (ROW, ROW, {"threads": 0}, ValueError, ["threads", "0", "1 or more"]),
        (ROW, ROW, {"threads": 1.5}, TypeError, ["threads", "1.5"]),
        (ROW, ROW, {"threads": 10**6}, ValueError, ["threads", "1000000", "1024"]),
    ],
)
def test_arrays_of_rays(call, origins, directions, options, error, parts):
    with pytest.raises(error) as caught:
        getattr(SCENE, call)(origins, directions, **options)
    assert type(caught.value) is error
    assert all(part in str(caught.value) for part in parts), caught.value


def test_outputs():
    read_only = np.empty(1, dtype=bool)
    read_only.flags.writeable = False
    for out, error, part in [
        (np.empty(1), TypeError, "float64"),
        (np.empty(2, dtype=bool), ValueError, "(2,)"),
        (read_only, ValueError, "read-only"),
        ([True], TypeError, "list"),
    ]:
        with pytest.raises(error, match="out") as caught:
            SCENE.occluded(ROW, ROW, out=out)
        assert part in str(caught.value)
    with pytest.raises(ValueError, match="not contiguous"):
        SCENE.occluded(ROW * 2, ROW * 2, out=np.empty(4, dtype=bool)[::2])
    with pytest.raises(TypeError, match="four arrays"):
        SCENE.cast(ROW, ROW, out=np.empty(1))


def test_other_arguments():
    with pytest.raises(ValueError, match="quality"):
        rt_core.Scene(VERTICES, TRIANGLES, quality="good")
    with pytest.raises(ValueError, match="watertight"):
        rt_core.Scene(VERTICES, TRIANGLES, robustness="none")
    with pytest.raises(ValueError, match="storage; give plain or compact"):
        rt_core.Scene(VERTICES, TRIANGLES, storage="none")
    with pytest.raises(TypeError, match="storage is 3"):
        rt_core.Scene(VERTICES, TRIANGLES, storage=3)
    with pytest.raises(TypeError, match="quality"):
        rt_core.Scene(VERTICES, TRIANGLES, quality=3)
    with pytest.raises(ValueError, match="max_hits = 1"):
        SCENE.all_hits([[0.1, 0.1, 5]], [[0, 0, -1]], max_hits=1)
    with pytest.raises(ValueError, match=r"points\[1\].*finite"):
        SCENE.contains([[0, 0, 0], [0, float("inf"), 0]])
    for call in (SCENE.signed_distance, SCENE.closest_point):
        with pytest.raises(ValueError, match=r"points\[0\]"):
            call(NAN)
    with pytest.raises(ValueError, match="max_distance"):
        SCENE.closest_point(ROW, max_distance=-1)


def test_arrays_that_change_after_the_build_do_no_harm():
    vertices, triangles = VERTICES.copy(), TRIANGLES.copy()
    scene = rt_core.Scene(vertices, triangles)
    triangles[:] = 2**32 - 1
    hits = scene.cast([[0.1, 0.1, 5]], [[0, 0, -1]])
    assert hits.hit[0] and not hits.normal.any()
