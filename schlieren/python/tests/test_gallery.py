"""The scripts of the gallery run, and each writes its picture."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

GALLERY = Path(__file__).parent.parent / "gallery"
NEEDED = {
    "heated_rod_bos": ("matplotlib",),
    "mpi_views": ("mpi4py", "matplotlib"),
    "time_series": ("xarray", "matplotlib"),
}
#: Open MPI starts two ranks on one core, and as root in containers.
MPI = {
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}


@pytest.mark.parametrize("script", sorted(GALLERY.glob("*.py")), ids=lambda s: s.stem)
def test_scripts(script, tmp_path):
    for package in NEEDED.get(script.stem, ()):
        pytest.importorskip(package)
    picture = tmp_path / "picture.png"
    run = [sys.executable, "-B", str(script), str(picture)]
    if script.stem.startswith("mpi"):
        launcher = os.environ.get("RTSV_MPIRUN") or shutil.which("mpirun")
        if launcher is None:
            pytest.skip("there is no mpirun; install an MPI")
        run = [launcher, "-n", "2", *run]
    done = subprocess.run(
        run, capture_output=True, text=True, timeout=300, cwd=tmp_path, env=os.environ | MPI
    )
    assert done.returncode == 0, done.stderr
    assert picture.stat().st_size > 10_000
    assert done.stdout.strip(), "it says what it found"
    if script.stem.startswith("mpi"):
        assert done.stdout.startswith("2 ranks"), done.stdout
