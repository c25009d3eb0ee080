# Physically based surfaces from rough plastic to polished metal, under two lights.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.1, 0.1, 0.1)
for i in range(4):
    for j in range(3):
        ball = vtk.vtkSphereSource()
        ball.SetThetaResolution(48)
        ball.SetPhiResolution(48)
        made = actor(ball, (0.95, 0.7, 0.3))
        made.SetPosition(1.1 * i, 1.1 * j, 0)
        made.GetProperty().SetInterpolationToPBR()
        made.GetProperty().SetRoughness(0.15 + 0.25 * i)
        made.GetProperty().SetMetallic(0.5 * j)
        ren.AddActor(made)
for position, color in (((3, 4, 8), (1, 1, 1)), ((-6, -2, 5), (0.3, 0.4, 0.8))):
    light = vtk.vtkLight()
    light.SetLightTypeToSceneLight()
    light.SetPosition(position)
    light.SetFocalPoint(1.6, 0.5, 0)
    light.SetColor(color)
    ren.AddLight(light)
win = window(420, 330, ren)
look(ren, (1.65, 1.1, 8), (1.65, 1.1, 0), (0, 1, 0)).Zoom(1.4)
ren.ResetCameraClippingRange()
win.Render()
save(win, "pbr", props=ren.GetNumberOfPropsRendered())

# The base colour from a texture, which is always sRGB; its alpha is the opacity. And a neighbour with ambient light.
image = vtk.vtkImageData()
image.SetDimensions(8, 8, 1)
image.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, 3)
for y in range(8):
    for x in range(8):
        for c, value in enumerate((255 if (x + y) % 2 else 60, 30 * x, 30 * y)):
            image.SetScalarComponentFromDouble(x, y, 0, c, value)
texture = vtk.vtkTexture()
texture.SetInputData(image)
texture.UseSRGBColorSpaceOn()
texture.InterpolateOn()
ren.RemoveAllViewProps()
plane = vtk.vtkPlaneSource()
plane.SetOrigin(0, 0, 0)
plane.SetPoint1(2, 0, 0)
plane.SetPoint2(0, 2, 0)
tiles = actor(plane, (1, 1, 1))
tiles.GetProperty().SetInterpolationToPBR()
tiles.GetProperty().SetRoughness(0.5)
tiles.GetProperty().SetMetallic(0.3)
tiles.GetProperty().SetBaseColorTexture(texture)
ren.AddActor(tiles)
elevation = vtk.vtkElevationFilter()
elevation.SetInputConnection(ball.GetOutputPort())
ambient = actor(elevation)
ambient.SetPosition(2.7, 1, 0)
ambient.GetProperty().SetAmbient(0.4)
ren.AddActor(ambient)
win.Render()
save(win, "base_color", props=ren.GetNumberOfPropsRendered())
