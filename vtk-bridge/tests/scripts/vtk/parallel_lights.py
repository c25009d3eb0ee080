# Highlights in parallel projection: the light kit, a bulb, translucent and physically based surfaces, which VTK's shaders see from the
# camera's position, and the light at the camera.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.05, 0.05, 0.1)
ball = vtk.vtkSphereSource()
ball.SetThetaResolution(60)
ball.SetPhiResolution(60)
plane = vtk.vtkPlaneSource()
plane.SetOrigin(-1.2, -1.2, -0.5)
plane.SetPoint1(2.4, -1.2, -0.5)
plane.SetPoint2(-1.2, 1.2, -0.5)
shiny, dull, floor = actor(ball, (0.7, 0.7, 0.8)), actor(ball, (0.8, 0.4, 0.3)), actor(plane, (0.9, 0.9, 0.9))
dull.SetPosition(1.1, 0, 0)
for prop, power in ((shiny, 30), (dull, 6), (floor, 12)):
    prop.GetProperty().SetSpecular(0.6)
    prop.GetProperty().SetSpecularPower(power)
    ren.AddActor(prop)
win = window(360, 260, ren)
win.SetAlphaBitPlanes(1)
ren.UseDepthPeelingOn()
ren.SetOcclusionRatio(0.0)
ren.SetMaximumNumberOfPeels(20)
camera = look(ren, (0.9, -1.6, 1.4), (0.6, 0, 0))
camera.ParallelProjectionOn()
camera.SetParallelScale(1.1)
ren.ResetCameraClippingRange()


def show(name):
    win.Render()
    save(win, name, lights=ren.GetLights().GetNumberOfItems())


def light_by(made, name):
    ren.RemoveAllLights()
    ren.AutomaticLightCreationOff()
    made.AddLightsToRenderer(ren) if isinstance(made, vtk.vtkLightKit) else ren.AddLight(made)
    show(name)


bulb = vtk.vtkLight()
bulb.SetLightTypeToSceneLight()
bulb.PositionalOn()
bulb.SetConeAngle(180)
bulb.SetPosition(1.6, -1, 1.2)
kit = vtk.vtkLightKit()
show("headlight")
light_by(bulb, "bulb")
light_by(kit, "light_kit")
dull.GetProperty().SetOpacity(0.5)
show("translucent")
dull.GetProperty().SetOpacity(1)
for prop, roughness in ((shiny, 0.2), (dull, 0.4), (floor, 0.35)):
    prop.GetProperty().SetInterpolationToPBR()
    prop.GetProperty().SetRoughness(roughness)
    prop.GetProperty().SetMetallic(0.4)
show("physical_light_kit")
headlight = vtk.vtkLight()
headlight.SetLightTypeToHeadlight()
light_by(headlight, "physical_headlight")
