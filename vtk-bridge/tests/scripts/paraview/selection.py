# Cells and points selected through a rectangle of the view, as with the mouse.
from paraview.selection import *
from paraview.simple import *

from capture_view import facts_of_selection, save, view

ball = Sphere(ThetaResolution=16, PhiResolution=16)
v = view([300, 240])
Show(ball, v)
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [0.3, -3, 1], [0, 0, 0], [0, 0, 1]
Render(v)
facts = {}
for name, select in (("cells", SelectSurfaceCells), ("points", SelectSurfacePoints)):
    select(Rectangle=[100, 80, 180, 150], View=v)
    facts[name] = facts_of_selection(ball)
    ClearSelection(ball)
save(v, "selection", **facts)
