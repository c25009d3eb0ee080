# Physically based surfaces from rough plastic to polished metal, under two lights.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.1, 0.1, 0.1)
for i in range(4):
    for j in range(2):
        ball = vtk.vtkSphereSource()
        ball.SetThetaResolution(48)
        ball.SetPhiResolution(48)
        made = actor(ball, (0.95, 0.7, 0.3))
        made.SetPosition(1.1 * i, 1.1 * j, 0)
        made.GetProperty().SetInterpolationToPBR()
        made.GetProperty().SetRoughness(0.15 + 0.25 * i)
        made.GetProperty().SetMetallic(j)
        ren.AddActor(made)
for position, color in (((3, 4, 8), (1, 1, 1)), ((-6, -2, 5), (0.3, 0.4, 0.8))):
    light = vtk.vtkLight()
    light.SetLightTypeToSceneLight()
    light.SetPosition(position)
    light.SetFocalPoint(1.6, 0.5, 0)
    light.SetColor(color)
    ren.AddLight(light)
win = window(420, 240, ren)
look(ren, (1.65, 0.55, 8), (1.65, 0.55, 0), (0, 1, 0)).Zoom(1.5)
ren.ResetCameraClippingRange()
win.Render()
save(win, "pbr", props=ren.GetNumberOfPropsRendered())
