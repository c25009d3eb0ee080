# Three nested transparent spheres and an opaque one, with depth peeling so that OpenGL's order is right too.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersSources import vtkSphereSource

ren = vtkRenderer()
ren.SetBackground(0.3, 0.2, 0.1)
ren.UseDepthPeelingOn()
ren.SetMaximumNumberOfPeels(20)
ren.SetOcclusionRatio(0)
for radius, color, opacity in [(1.0, (1, 0, 0), 0.3), (0.7, (0, 1, 0), 0.4), (0.45, (0, 0, 1), 0.5), (0.3, (1, 1, 1), 1.0)]:
    sphere = vtkSphereSource()
    sphere.SetRadius(radius)
    sphere.SetThetaResolution(40)
    sphere.SetPhiResolution(30)
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*color)
    actor.GetProperty().SetOpacity(opacity)
    ren.AddActor(actor)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetAlphaBitPlanes(1)
win.SetMultiSamples(0)
win.SetSize(300, 300)
win.AddRenderer(ren)
ren.ResetCamera()
win.Render()
