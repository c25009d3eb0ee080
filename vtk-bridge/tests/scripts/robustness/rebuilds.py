# What builds acceleration structures anew: changed points. Not: colours, properties, matrices, cameras, other actors.
import json
import os

from vtkmodules.vtkFiltersCore import vtkElevationFilter
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2

sources, filters, actors = [], [], []
ren = vtkRenderer()
for i in range(3):
    sphere = vtkSphereSource()
    sphere.SetCenter(1.2 * i, 0, 0)
    elevation = vtkElevationFilter()
    elevation.SetInputConnection(sphere.GetOutputPort())
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(elevation.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    ren.AddActor(actor)
    sources.append(sphere)
    filters.append(elevation)
    actors.append(actor)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetSize(80, 60)
win.AddRenderer(ren)
ren.ResetCamera()


def rebuilt():
    win.Render()
    with open(os.environ["RTV_REPORT"]) as f:
        report = json.load(f)["renderers"][0]
    return report["rebuilt"], report["reused"]


assert rebuilt() == (3, False)
assert rebuilt() == (0, True), "nothing changed"
ren.GetActiveCamera().Azimuth(10)
assert rebuilt() == (0, False)
actors[0].SetPosition(0, 1, 0)
actors[1].GetProperty().SetSpecular(0.5)
actors[2].GetMapper().SetScalarRange(0.2, 0.7)
assert rebuilt() == (0, False)
actors[2].GetMapper().GetLookupTable().SetHueRange(0.1, 0.5)
assert rebuilt() == (0, False)
sources[1].SetThetaResolution(20)
assert rebuilt() == (1, False), "one of three"
actors[0].SetVisibility(False)
assert rebuilt() == (0, False)
print("survived")
