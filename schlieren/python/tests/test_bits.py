"""The same numbers from Python as from the program."""

import os
import subprocess

import numpy as np
import pytest
import schlieren
from flows import TOLERANCE_RAD, field, render, same, warm

PROGRAM = os.environ.get("RTSV_SCHLIEREN_PROGRAM")


def by_program(folder, of, options, arguments):
    """The deflection and the picture that the program makes of the field's file."""
    path, npy, png = folder / "flow.vti", folder / "map.npy", folder / "image.png"
    of.write(path)
    command = [PROGRAM, "render", path, *options, "--npy", npy, "-o", png, "--quiet"]
    subprocess.run([*map(str, command), *arguments], check=True, stdin=subprocess.DEVNULL)
    return np.load(npy), png.read_bytes()


@pytest.mark.skipif(PROGRAM is None, reason="RTSV_SCHLIEREN_PROGRAM names no program")
@pytest.mark.parametrize(
    "technique, arguments, options",
    [
        ("schlieren", [], {}),
        ("schlieren", ["--cutoff", "color", "--view", "x"], {"cutoff": "color", "view": "x"}),
        (
            "schlieren",
            ["--cutoff", "circle", "--view", "30,10"],
            {"cutoff": "circle", "view": (30, 10)},
        ),
        ("shadowgraph", ["--film-distance", "0.4"], {"focus_m": 0.4}),
        ("interferogram", ["--wavelength", "500,600"], {"wavelength_nm": [500, 600]}),
        ("bos", ["--film-distance", "1", "--seed", "3"], {"focus_m": 1, "seed": 3}),
        ("volume", [], {}),
        ("slice", [], {}),
    ],
)
@pytest.mark.filterwarnings("ignore::schlieren.SchlierenWarning")
def test_python_has_the_bits_of_the_program(tmp_path, technique, arguments, options):
    of = field(24)
    tolerance = ["--technique", technique, "--size", "48x40", "--tolerance", str(TOLERANCE_RAD)]
    deflection, png = by_program(tmp_path, of, ["--density", "density", *tolerance], arguments)
    image = render(of, technique, layers="deflection", **options)
    np.testing.assert_array_equal(image.deflection_rad, deflection)
    assert image._repr_png_() == png
    # From the file, and a second time, when spline and projection are kept.
    opened = schlieren.Field.open(tmp_path / "flow.vti", density="density")
    assert same(render(opened, technique, layers="deflection", **options), image)
    assert same(render(of, technique, layers="deflection", **options), image)


@pytest.mark.skipif(PROGRAM is None, reason="RTSV_SCHLIEREN_PROGRAM names no program")
def test_units_are_those_of_the_program(tmp_path):
    x = warm(24)
    celsius, bar = 20 + 200 * (1.2 - x), 1.01325 + 0 * x
    of = schlieren.Field(
        temperature=celsius, pressure=bar, humidity=0.4, temperature_unit="degC",
        pressure_unit="bar", spacing=4, length_unit="mm",
    )  # fmt: skip
    scene = tmp_path / "scene.toml"
    image = render(of, layers="deflection")
    scene.write_text(image.scene.replace('file = ""', 'file = "flow.vti"'))
    of.write(tmp_path / "flow.vti")
    npy = tmp_path / "map.npy"
    command = [PROGRAM, "render", "--scene", scene, "--npy", npy, "--quiet"]
    subprocess.run([str(c) for c in command], check=True, stdin=subprocess.DEVNULL)
    np.testing.assert_array_equal(image.deflection_rad, np.load(npy))
    assert image.report.index_formula == "ciddor"


def test_threads_change_no_bit():
    one, three = (render(field(), threads=n) for n in (1, 3))
    assert same(one, three)
