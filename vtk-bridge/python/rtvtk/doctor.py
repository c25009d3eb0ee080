"""`python -m rtvtk doctor`: what is there, what is missing, and how to mend it."""
import importlib.metadata
import json
import os
import subprocess
import sys
import tempfile

#: A frame that has to be traced; the report says whether it was.
FRAME = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderWindow, vtkRenderer
import rtvtk
rtvtk.enable(report={report!r}, always_trace=True, quiet=True)
source, mapper, actor = vtkSphereSource(), vtkPolyDataMapper(), vtkActor()
mapper.SetInputConnection(source.GetOutputPort())
actor.SetMapper(mapper)
renderer, window = vtkRenderer(), vtkRenderWindow()
renderer.AddActor(actor)
window.SetOffScreenRendering(True)
window.SetSize(64, 64)
window.AddRenderer(renderer)
window.Render()
print(window.GetClassName())
"""


def _package(name, cure):
    try:
        return True, importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False, f"not installed; {cure}"


def _vtk():
    try:
        from vtkmodules.vtkCommonCore import vtkVersion
    except ImportError as error:
        return False, f"cannot be imported ({error}); pip install vtk"
    version = vtkVersion.GetVTKVersion()
    major, minor = (int(n) for n in version.split(".")[:2])
    if (major, minor) < (9, 4):
        return False, f"{version} is older than 9.4; pip install --upgrade vtk"
    return True, version


def _library():
    from . import library

    try:
        _, path = library._load()
        library.Bridge.calls()
    except library.RtvError as error:
        return False, str(error)
    return True, path


def _environment():
    """The variables that begin with RTV_, by the library's own rules."""
    from . import library
    from .options import RULES, variable

    known = {variable(name): name for name in RULES} | {"RTV_OFF": None, "RTV_HOME": None}
    known |= {"RTV_VTK_INCLUDE": None, "RTV_LIBRARY": None}
    set_here = {n: v for n, v in sorted(os.environ.items()) if n.startswith("RTV_")}
    bridge = library.Bridge()
    for name, value in set_here.items():
        if name not in known:
            return False, f"{name} is no option; unset it (python -m rtvtk --help lists them)"
        if known[name] is not None and not bridge.set_option(name, value):
            return False, f"{name}={value} is not understood; give {RULES[known[name]]}"
    if os.environ.get("RTV_OFF", "") in ("1", "on", "true", "yes"):
        return False, "RTV_OFF leaves everything to OpenGL; unset it"
    return True, ", ".join(f"{n}={v}" for n, v in set_here.items()) or "no option is set"


def traced(report):
    """Whether a report has an object that was traced."""
    if isinstance(report, dict):
        return bool(report.get("traced")) or any(traced(v) for v in report.values())
    return isinstance(report, list) and any(traced(v) for v in report)


def _frame():
    """Draws a frame in a process of its own, which a driver may end."""
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
        paths = [here, os.environ.get("PYTHONPATH", "")]
        environment = {n: v for n, v in os.environ.items() if not n.startswith("RTV_")}
        environment |= {"PYTHONPATH": os.pathsep.join(p for p in paths if p)}
        environment |= {n: v for n, v in os.environ.items() if n == "RTV_HOME"}
        program = [sys.executable, "-c", FRAME.format(report=report)]
        try:
            done = subprocess.run(
                program, env=environment, capture_output=True, text=True, timeout=120
            )
        except subprocess.TimeoutExpired:
            return False, "no frame in two minutes; give VTK a display or EGL (libegl1)"
        if done.returncode != 0:
            last = done.stderr.strip().splitlines()[-1:] or ["no message"]
            return False, (
                f"VTK draws no frame off screen (exit {done.returncode}: {last[0]}); install "
                "OpenGL for machines without a display (Debian: libegl1, libgl1-mesa-dri)"
            )
        try:
            with open(report) as file:
                found = json.load(file)
        except (OSError, ValueError) as error:
            return False, f"a frame was drawn and not traced ({error}); please report this"
        if not traced(found):
            return False, "a frame was drawn and not traced; please report this"
        return True, f"traced in a {done.stdout.strip()}"


def main():
    """Prints the findings; 0 if all is well, 1 otherwise."""
    checks = [
        ("Python", lambda: (True, sys.version.split()[0])),
        ("numpy", lambda: _package("numpy", "pip install numpy")),
        ("VTK", _vtk),
        ("library", _library),
    ]
    later = [("options", _environment), ("frame", _frame)]
    good = True
    for name, check in [*checks, *later]:
        if (name, check) in later and not good:
            print(f"-    {name}: not tried, see above")
            continue
        ok, text = check()
        good = good and ok
        print(f"{'ok  ' if ok else 'FAIL'} {name}: {text}")
    return 0 if good else 1
