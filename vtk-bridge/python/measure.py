"""CPU per frame of the stock wheel against rtvtk: nested isosurfaces of the wavelet, the camera turns by 15 degrees each frame.

    python measure.py [--millions 1|2|4|8] [--frames 6] [--rounds 3] [--size 1024] [--json FILE]

Stock and rtvtk take turns, each in a process of its own. CPU is user and system time of all threads of the process. Needs vtk, numpy, and rtvtk
beside this file or installed; RTVTK_LIBRARY names the library, as for rtvtk. Without a display VTK draws with EGL or OSMesa.
"""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time

# Isovalues for the given number of million triangles on 201^3 points.
ISOS = {
    1: [121, 189],
    2: [105.5, 138.5, 171.5, 204.5],
    4: [115, 128.33, 141.67, 155, 168.33, 181.67, 195],
    8: [112, 118.62, 125.23, 131.85, 138.46, 145.08, 151.69, 158.31, 164.92, 171.54, 178.15, 184.77, 191.38, 198],
}


def cpu_secs():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def run(millions, frames, size):
    """The work of one process: draws, and prints the time it took."""
    import vtk

    source = vtk.vtkRTAnalyticSource()
    source.SetWholeExtent(*([-100, 100] * 3))
    contour = vtk.vtkFlyingEdges3D()
    contour.SetInputConnection(source.GetOutputPort())
    for i, value in enumerate(ISOS[millions]):
        contour.SetValue(i, value)
    contour.Update()
    surface = contour.GetOutput()
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(surface)
    mapper.SetScalarRange(100, 200)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    renderer = vtk.vtkRenderer()
    renderer.AddActor(actor)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(size, size)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(0, -669, 0)
    camera.SetViewUp(0, 0, 1)
    camera.Elevation(20)
    renderer.ResetCameraClippingRange()
    times = []
    for _ in range(frames + 2):
        start, cpu = time.perf_counter(), cpu_secs()
        window.Render()
        window.WaitForCompletion()
        times.append((cpu_secs() - cpu, time.perf_counter() - start))
        camera.Azimuth(15)
    # The second frame still fills caches.
    cpus, walls = zip(*times[2:])
    print(json.dumps({
        "triangles": surface.GetNumberOfPolys(), "window": window.GetClassName(), "vtk": vtk.vtkVersion.GetVTKVersion(),
        "first_frame_cpu_secs": times[0][0], "first_frame_wall_secs": times[0][1], "cpu_secs_per_frame": cpus, "wall_secs_per_frame": walls,
        "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--millions", type=int, choices=ISOS, default=1)
    parser.add_argument("--frames", type=int, default=6)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--run", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        return run(options.millions, options.frames, options.size)
    # Both ways are measured, also where rtvtk would leave the frame to OpenGL.
    environment = dict(os.environ, RTV_ALWAYS_TRACE="1")
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [os.path.dirname(os.path.abspath(__file__)), os.environ.get("PYTHONPATH")]))
    rounds = {"stock": [], "rtvtk": []}
    for _ in range(options.rounds):
        for name, found in rounds.items():
            command = [sys.executable, *(["-m", "rtvtk"] if name == "rtvtk" else []), __file__, "--run", f"--millions={options.millions}",
                       f"--frames={options.frames}", f"--size={options.size}"]
            done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True)
            found.append(json.loads(done.stdout))
    medians = {name: [statistics.median(r["cpu_secs_per_frame"]) for r in found] for name, found in rounds.items()}
    ratios = [stock / ours for stock, ours in zip(medians["stock"], medians["rtvtk"])]
    summary = {
        "triangles": rounds["stock"][0]["triangles"], "size": options.size, "frames": options.frames,
        "cpu_secs_per_frame": {name: statistics.median(m) for name, m in medians.items()},
        "cpu_ratio": {"median": statistics.median(ratios), "least": min(ratios), "most": max(ratios)},
        "wall_secs_per_frame": {n: statistics.median(w for r in found for w in r["wall_secs_per_frame"]) for n, found in rounds.items()},
        "first_frame_cpu_secs": {n: statistics.median(r["first_frame_cpu_secs"] for r in found) for n, found in rounds.items()},
        "peak_bytes": {n: max(r["peak_bytes"] for r in found) for n, found in rounds.items()},
        "load": os.getloadavg()[0], "cpus": os.cpu_count(),
    }
    print(json.dumps(summary, indent=1))
    if options.json:
        with open(options.json, "w") as file:
            json.dump({"summary": summary, "rounds": rounds}, file, indent=1)
    return None


if __name__ == "__main__":
    main()
