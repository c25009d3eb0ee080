# Flat and smooth spheres with highlights and ambient colour, several lights.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from capture import save
from vtkmodules.vtkFiltersSources import vtkSphereSource

ren = vtkRenderer()
for i in range(6):
    sphere = vtkSphereSource()
    sphere.SetThetaResolution(24)
    sphere.SetPhiResolution(16)
    sphere.SetCenter(1.2 * (i % 3), 1.2 * (i // 3), 0)
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    p = actor.GetProperty()
    p.SetColor(0.9, 0.5 + 0.1 * i, 0.3)
    p.SetSpecular(0.4)
    p.SetSpecularPower(5 + 10 * i)
    p.SetSpecularColor(1.0, 0.8, 0.6)
    if i % 2:
        p.SetInterpolationToFlat()
    if i == 2:
        p.SetAmbient(0.3)
        p.SetAmbientColor(0.0, 0.2, 0.9)
    if i == 4:
        p.LightingOff()
    ren.AddActor(actor)
for position, color in [((3, 4, 6), (0.7, 0.6, 0.5)), ((-5, 1, 3), (0.2, 0.3, 0.4))]:
    light = vtkLight()
    light.SetPosition(*position)
    light.SetFocalPoint(1, 0.5, 0)
    light.SetColor(*color)
    ren.AddLight(light)
spot = vtkLight()
spot.PositionalOn()
spot.SetPosition(1.2, 0, 3)
spot.SetFocalPoint(1.2, 0.2, 0)
spot.SetConeAngle(12)
spot.SetExponent(2)
spot.SetAttenuationValues(0.5, 0.1, 0.05)
ren.AddLight(spot)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(400, 300)
win.AddRenderer(ren)
ren.ResetCamera()
win.Render()
save(win, "specular", props=ren.GetNumberOfPropsRendered())
