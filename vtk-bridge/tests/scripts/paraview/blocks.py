# A group of data sets with colours and opacities of their own.
from paraview.simple import *

from capture_view import save, view

group = GroupDatasets(Input=[Sphere(Center=[1.1 * i, 0, 0], ThetaResolution=24, PhiResolution=24) for i in range(3)])
v = view([360, 200])
shown = Show(group, v)
shown.DiffuseColor = [0.8, 0.8, 0.8]
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [1.1, -5, 1], [1.1, 0, 0], [0, 0, 1]
save(v, "plain")
ColorBy(shown, ("FIELD", "vtkBlockColors"))
save(v, "by_block")
