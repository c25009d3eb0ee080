# Translucent surfaces through an opaque one.
from paraview.simple import *

from capture_view import save, view

v = view([300, 260])
for i, color in enumerate(([0.9, 0.2, 0.2], [0.2, 0.8, 0.2], [0.2, 0.3, 0.9])):
    shown = Show(Sphere(Center=[0.3 * i, 0.2 * i, 0.1], ThetaResolution=32, PhiResolution=32), v)
    shown.DiffuseColor = color
    shown.Opacity = 0.3 + 0.2 * i
Show(Plane(Origin=[-1, -1, 0], Point1=[1.5, -1, 0], Point2=[-1, 1, 0]), v).DiffuseColor = [0.6, 0.6, 0.6]
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [1.5, -2.5, 2], [0.3, 0, 0], [0, 0, 1]
save(v, "opacity")
