"""Frames of ParaView, and what they cost: pvbatch paraview_frames.py ORDER.json. Prints one line `RESULT {json}`.

The order names the data (isovalues of the Wavelet source, or a PLY file), the size in pixels, the views and the number of frames. What draws is the environment's business.
"""
import json
import os
import resource
import sys
import time

from paraview.simple import *

with open(sys.argv[1]) as file:
    order = json.load(file)


def cpu():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def peak_gb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


start = time.time()
if order["isovalues"]:
    half = order["points"] // 2
    source = Wavelet(WholeExtent=[-half, half] * 3)
    data = Contour(Input=source, ContourBy="RTData", Isosurfaces=order["isovalues"], ComputeNormals=1, ComputeScalars=0)
else:
    data = PLYReader(FileNames=[order["file"]])
data.UpdatePipeline()
result = {"data_secs": time.time() - start, "triangles": data.GetDataInformation().GetNumberOfCells(), "views": {}}
view = CreateRenderView()
view.ViewSize = [order["pixels"]] * 2
view.OrientationAxesVisibility = 0
shown = Show(data, view)
shown.ColorArrayName = ["POINTS", ""]
shown.DiffuseColor = [0.8, 0.6, 0.4]
shown.SetRepresentationType("Surface")
result["data_gb"] = peak_gb()
first = True
for camera in order["views"]:
    view.CameraPosition = camera["eye"]
    view.CameraFocalPoint = camera["target"]
    view.CameraViewUp = camera["up"]
    view.CameraViewAngle = camera["angle"]
    clock, used = time.time(), cpu()
    Render(view)
    if first:
        result["first_secs"], result["first_cpu_secs"] = time.time() - clock, cpu() - used
        first = False
    wall, seconds = [], []
    for i in range(order["frames"] + 1):
        # Orbit the focal point, or turn in place when the eye is inside the data.
        (GetActiveCamera().Yaw if camera["inside"] else GetActiveCamera().Azimuth)(5)
        clock, used = time.time(), cpu()
        Render(view)
        # The first frame after a camera jump is not representative.
        if i > 0:
            wall.append(time.time() - clock)
            seconds.append(cpu() - used)
    result["views"][camera["name"]] = {"wall": wall, "cpu": seconds}
result["peak_gb"] = peak_gb()
result["renderer"] = view.GetRenderer().GetClassName()
result["load"] = os.getloadavg()[0]
print("RESULT", json.dumps(result), flush=True)
