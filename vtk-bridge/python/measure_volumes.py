"""CPU per frame of the stock wheel against rtvtk: a smooth field on N^3 points, the camera turns by 15 degrees each frame.

    python measure_volumes.py [--points 65|129|257] [--shade] [--step 1.0] [--seen half] [--size 512] [--choose] [--json FILE]

Stock and rtvtk take turns, each in a process of its own. CPU is user and system time of all threads of the process. The constants of the choice
between rays and OpenGL (src/choice) come from here. Needs vtk, numpy, and rtvtk beside this file or installed; RTVTK_LIBRARY names the library, as
for rtvtk. Without a display VTK draws with EGL or OSMesa.
"""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

# Opacities by the field's value, from 0 to 1: all of it thin, half of it clear, a dense core that ends rays.
OPACITIES = {
    "all": [(0, 0.004), (1, 0.01)],
    "half": [(0, 0), (0.5, 0), (1, 0.05)],
    "core": [(0, 0), (0.6, 0), (0.7, 0.5), (1, 0.9)],
}


def cpu_secs():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def image(points):
    import numpy as np
    import vtk
    from vtkmodules.util.numpy_support import numpy_to_vtk

    x = np.linspace(-1, 1, points, dtype=np.float32)
    wave = 0.08 * (np.sin(9 * x)[None, None, :] + np.sin(11 * x)[None, :, None] + np.cos(13 * x)[:, None, None])
    bell = np.exp(-x * x)
    values = 0.24 + wave + 0.52 * bell[None, None, :] * bell[None, :, None] * bell[:, None, None]
    made = vtk.vtkImageData()
    made.SetDimensions(points, points, points)
    made.SetSpacing(*([1 / (points - 1)] * 3))
    made.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values.ravel(), np.float32), deep=True))
    return made


def run(options):
    """The work of one process: draws, and prints the time it took."""
    import vtk

    colors = vtk.vtkColorTransferFunction()
    for value, *rgb in ((0, 0.1, 0.2, 0.9), (0.5, 0.9, 0.9, 0.7), (1, 0.9, 0.1, 0.1)):
        colors.AddRGBPoint(value, *rgb)
    opacity = vtk.vtkPiecewiseFunction()
    for point in OPACITIES[options.seen]:
        opacity.AddPoint(*point)
    prop = vtk.vtkVolumeProperty()
    prop.SetColor(colors)
    prop.SetScalarOpacity(opacity)
    prop.SetScalarOpacityUnitDistance(1 / 64)
    prop.SetInterpolationType(not options.nearest)
    prop.SetShade(options.shade)
    mapper = vtk.vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(image(options.points))
    mapper.UseJitteringOff()
    mapper.SetAutoAdjustSampleDistances(False)
    mapper.SetLockSampleDistanceToInputSpacing(False)
    mapper.SetSampleDistance(options.step / (options.points - 1))
    volume = vtk.vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(prop)
    renderer = vtk.vtkRenderer()
    renderer.AddVolume(volume)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(options.size, options.size)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(1, -1.1, 0.9)
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCamera()
    camera.Zoom(options.zoom)
    times, traced = [], []
    report = os.environ.get("RTV_REPORT")
    for _ in range(options.frames + options.skip):
        start, cpu = time.perf_counter(), cpu_secs()
        window.Render()
        window.WaitForCompletion()
        times.append((cpu_secs() - cpu, time.perf_counter() - start))
        if report and os.path.exists(report):
            with open(report) as file:
                traced.append(sum(bool(r["traced"]) for r in json.load(file)["renderers"]))
        camera.Azimuth(15)
    cpus, walls = zip(*times[options.skip:])
    print(json.dumps({
        "window": window.GetClassName(), "vtk": vtk.vtkVersion.GetVTKVersion(), "first_frames_cpu_secs": [t[0] for t in times[:options.skip]],
        "cpu_secs_per_frame": cpus, "wall_secs_per_frame": walls, "traced": traced,
        "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }))


def process(traces, environment):
    """What a process with these options found."""
    command = [sys.executable, *(["-m", "rtvtk"] if traces else []), __file__, "--run", *sys.argv[1:]]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True)
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=65)
    parser.add_argument("--shade", action="store_true")
    parser.add_argument("--nearest", action="store_true")
    parser.add_argument("--step", type=float, default=1.0, help="distance of the samples, in distances of points")
    parser.add_argument("--seen", choices=OPACITIES, default="half")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--zoom", type=float, default=1.0)
    parser.add_argument("--frames", type=int, default=6)
    parser.add_argument("--skip", type=int, default=2, help="first frames that do not count")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--choose", action="store_true", help="without effects and without RTV_ALWAYS_TRACE")
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--run", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        return run(options)
    here = os.path.dirname(os.path.abspath(__file__))
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")])))
    if not options.choose:
        environment["RTV_ALWAYS_TRACE"] = "1"
    rounds = {"stock": [], "rtvtk": []}
    for _ in range(options.rounds):
        for name, found in rounds.items():
            found.append(process(name == "rtvtk", environment))
    traced = []
    if options.choose:
        # A report costs time, so another process writes it.
        with tempfile.TemporaryDirectory() as folder:
            traced = process(True, dict(environment, RTV_REPORT=os.path.join(folder, "report.json")))["traced"]
    medians = {name: [statistics.median(r["cpu_secs_per_frame"]) for r in found] for name, found in rounds.items()}
    ratios = [stock / ours for stock, ours in zip(medians["stock"], medians["rtvtk"])]
    summary = {
        "points": options.points, "shade": options.shade, "step": options.step, "seen": options.seen, "size": options.size,
        "cpu_secs_per_frame": {name: statistics.median(m) for name, m in medians.items()},
        "cpu_ratio": {"median": statistics.median(ratios), "least": min(ratios), "most": max(ratios)},
        "first_frame_cpu_secs": {n: statistics.median(r["first_frames_cpu_secs"][0] for r in found) for n, found in rounds.items()},
        "traced_frames": traced, "peak_bytes": {n: max(r["peak_bytes"] for r in found) for n, found in rounds.items()},
        "load": os.getloadavg()[0], "cpus": os.cpu_count(),
    }
    print(json.dumps(summary))
    if options.json:
        with open(options.json, "w") as file:
            json.dump({"summary": summary, "rounds": rounds}, file, indent=1)
    return None


if __name__ == "__main__":
    main()
