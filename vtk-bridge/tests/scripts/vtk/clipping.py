# Clipping planes of the mapper through a coloured sphere and, moved by the actor's matrix, through a cylinder.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkFiltersCore import vtkElevationFilter
from vtkmodules.vtkFiltersSources import vtkCylinderSource, vtkSphereSource

ren = vtkRenderer()
sphere = vtkSphereSource()
sphere.SetThetaResolution(40)
sphere.SetPhiResolution(30)
elevation = vtkElevationFilter()
elevation.SetInputConnection(sphere.GetOutputPort())
elevation.SetLowPoint(0, -0.5, 0)
elevation.SetHighPoint(0, 0.5, 0)
cylinder = vtkCylinderSource()
cylinder.SetResolution(30)
for source, place in [(elevation, (0, 0, 0)), (cylinder, (1.3, 0.1, 0))]:
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    for normal, origin in [((-1, 0.3, 0.2), (0.15, 0, 0)), ((0, -1, -0.5), (0, 0.2, 0))]:
        plane = vtkPlane()
        plane.SetNormal(*normal)
        plane.SetOrigin(origin[0] + place[0], origin[1] + place[1], origin[2])
        mapper.AddClippingPlane(plane)
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.SetPosition(*place)
    actor.RotateZ(20 * place[0])
    actor.SetScale(1, 1 + 0.2 * place[0], 1)
    ren.AddActor(actor)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(400, 260)
win.AddRenderer(ren)
ren.ResetCamera()
ren.GetActiveCamera().Azimuth(20)
win.Render()
