"""The scripts of the gallery run, and each writes its picture."""

import subprocess
import sys
from pathlib import Path

import pytest

GALLERY = Path(__file__).parent.parent / "gallery"
NEEDED = {
    "ambient_occlusion": ("pyvista",),
    "depth_maps": ("matplotlib",),
    "streamlines": ("matplotlib",),
    "sunlight": ("matplotlib",),
    "volume": ("matplotlib",),
    "wall_thickness": ("trimesh", "matplotlib"),
}


@pytest.mark.parametrize("script", sorted(GALLERY.glob("*.py")), ids=lambda s: s.stem)
def test_scripts(script, tmp_path):
    for package in NEEDED.get(script.stem, ()):
        pytest.importorskip(package)
    picture = tmp_path / "picture.png"
    run = [sys.executable, "-B", str(script), str(picture)]
    done = subprocess.run(run, capture_output=True, text=True, timeout=300, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert picture.stat().st_size > 10_000
    assert done.stdout.strip(), "it says what it found"
