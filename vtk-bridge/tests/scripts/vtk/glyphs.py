# Arrows on a plane, oriented and scaled by the normals and coloured by elevation: one mapper, many copies.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersCore import vtkElevationFilter
from vtkmodules.vtkFiltersSources import vtkArrowSource, vtkSphereSource

points = vtkSphereSource()
points.SetThetaResolution(12)
points.SetPhiResolution(9)
points.SetRadius(2)
elevation = vtkElevationFilter()
elevation.SetInputConnection(points.GetOutputPort())
elevation.SetLowPoint(0, 0, -2)
elevation.SetHighPoint(0, 0, 2)
arrow = vtkArrowSource()
arrow.SetTipResolution(12)
mapper = vtkGlyph3DMapper()
mapper.SetInputConnection(elevation.GetOutputPort())
mapper.SetSourceConnection(arrow.GetOutputPort())
mapper.SetOrientationArray("Normals")
mapper.SetScaleFactor(0.6)
mapper.SetScalarRange(0, 1)
actor = vtkActor()
actor.SetMapper(mapper)
ren = vtkRenderer()
ren.AddActor(actor)
ren.SetBackground(0.1, 0.1, 0.15)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(400, 300)
win.AddRenderer(ren)
ren.ResetCamera()
win.Render()
