# Physically based spheres: metallic from left to right, roughness from top to bottom.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersSources import vtkSphereSource

ren = vtkRenderer()
ren.SetBackground(0.1, 0.1, 0.1)
for i in range(9):
    sphere = vtkSphereSource()
    sphere.SetThetaResolution(60)
    sphere.SetPhiResolution(40)
    sphere.SetCenter(1.1 * (i % 3), 1.1 * (i // 3), 0)
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    p = actor.GetProperty()
    p.SetInterpolationToPBR()
    p.SetColor(0.8, 0.6, 0.3)
    p.SetMetallic(0.5 * (i % 3))
    p.SetRoughness(0.2 + 0.35 * (i // 3))
    ren.AddActor(actor)
for position in [(5, 5, 8), (-6, 2, 5)]:
    light = vtkLight()
    light.SetPosition(*position)
    light.SetFocalPoint(1, 1, 0)
    light.SetIntensity(1.5)
    ren.AddLight(light)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(300, 300)
win.AddRenderer(ren)
ren.ResetCamera()
win.Render()
