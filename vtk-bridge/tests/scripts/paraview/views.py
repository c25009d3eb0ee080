# Two views in one layout, and parallel projection.
from paraview.simple import *

from capture_view import save, view

ball, box = Sphere(ThetaResolution=24, PhiResolution=24), Box()
first, second = view([200, 160]), view([160, 200])
Show(ball, first).DiffuseColor = [0.9, 0.6, 0.2]
Show(box, second).DiffuseColor = [0.2, 0.6, 0.9]
Show(ball, second)
first.CameraPosition, first.CameraViewUp = [1, -3, 1], [0, 0, 1]
second.CameraPosition, second.CameraViewUp = [-2, -3, 2], [0, 0, 1]
second.CameraParallelProjection = 1
second.CameraParallelScale = 1
save(first, "first")
save(second, "second")
