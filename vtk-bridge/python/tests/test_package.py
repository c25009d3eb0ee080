"""The installed package beside the VTK that is installed with it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rtvtk
from vtkmodules.vtkCommonCore import vtkVersion

SCRIPTS = Path(__file__).parent.parent.parent / "tests" / "scripts"
#: Of a channel, in levels of 255, by which pixels may differ, and the share of those that differ
#: more: along silhouettes, where one renderer's pixel is the other's neighbour.
LEVELS, SHARE = 12, 0.015


def run(*arguments, **environment):
    """Python without a display and without options from outside."""
    plain = {n: v for n, v in os.environ.items() if not n.startswith("RTV") and n != "DISPLAY"}
    done = subprocess.run(
        [sys.executable, "-B", *map(str, arguments)],
        env=plain | environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    return done.returncode, done.stdout + done.stderr


def test_it_is_the_installed_package_with_a_library_of_its_own():
    folder = Path(rtvtk.__file__).parent
    assert "site-packages" in folder.parts
    assert (folder / "libvtk_bridge.so").is_file()


def test_the_doctor_finds_nothing_missing():
    code, said = run("-m", "rtvtk", "doctor")
    assert code == 0, said
    assert f"VTK: {vtkVersion.GetVTKVersion()}" in said and "frame: traced" in said, said


def test_options_are_keyword_arguments():
    code, said = run(SCRIPTS / "options.py")
    assert code == 0 and "pixels darker by occlusion" in said, said


def pictures(folder, script, *before):
    """The images of a script, by name."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOImage import vtkPNGReader

    folder.mkdir()
    code, said = run(
        *before, SCRIPTS / "run_all.py", folder, script, RTV_ALWAYS_TRACE="1",
        RTV_REPORT=str(folder / "report.json"), CAPTURE_BESIDE=str(folder / "report.json"),
    )  # fmt: skip
    assert code == 0, said
    found = {}
    for file in sorted(folder.rglob("*.png")):
        reader = vtkPNGReader()
        reader.SetFileName(str(file))
        reader.Update()
        scalars = reader.GetOutput().GetPointData().GetScalars()
        found[file.stem] = vtk_to_numpy(scalars).astype(int)
    reports = "".join(f.read_text() for f in folder.rglob("*.report.json"))
    return found, reports


@pytest.mark.parametrize(
    "name", ["clipping", "colors", "contours", "glyphs", "lights", "opacity", "textures", "volume"]
)
def test_scripts_look_the_same(name, tmp_path):
    script = SCRIPTS / "vtk" / f"{name}.py"
    stock, _ = pictures(tmp_path / "stock", script)
    ours, reports = pictures(tmp_path / "ours", script, "-m", "rtvtk")
    assert stock and stock.keys() == ours.keys()
    assert '"traced"' in reports, "nothing was traced"
    for image, pixels in stock.items():
        apart = np.abs(pixels - ours[image]).max(axis=1) > LEVELS
        assert apart.mean() <= SHARE, f"{image}: {apart.mean():.3%} of the pixels differ"


def test_a_vtk_that_is_too_old_is_refused_by_name():
    from rtvtk import library

    with pytest.raises(rtvtk.RtvError, match=r"VTK 9\.3\.1 is older than 9\.4.*--upgrade vtk"):
        library.check_vtk((9, 3, 1))
    library.check_vtk((9, 4, 0))
    library.check_vtk((10, 0, 0))
