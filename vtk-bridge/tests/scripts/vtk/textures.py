# Textures: interpolated and nearest, repeated and clamped, with transparency, and multiplied with
# the surface's colour.
import vtk

from capture import actor, look, save, window


def checks(n, alpha=False):
    image = vtk.vtkImageData()
    image.SetDimensions(n, n, 1)
    pixels = vtk.vtkUnsignedCharArray()
    pixels.SetNumberOfComponents(4 if alpha else 3)
    for y in range(n):
        for x in range(n):
            on = (x // 2 + y // 2) % 2
            color = (250, 60 + 170 * x // n, 40) if on else (30, 60, 60 + 170 * y // n)
            pixels.InsertNextTuple(color + ((255 if on else 90),) if alpha else color)
    image.GetPointData().SetScalars(pixels)
    return image


def plane(x, y, texture, scale=1, color=(1, 1, 1)):
    source = vtk.vtkPlaneSource()
    source.SetOrigin(x, y, 0)
    source.SetPoint1(x + 1, y, 0)
    source.SetPoint2(x, y + 1, 0)
    source.SetXResolution(3)
    coordinates = vtk.vtkTransformTextureCoords()
    coordinates.SetInputConnection(source.GetOutputPort())
    coordinates.SetScale(scale, scale, 1)
    made = actor(coordinates, color)
    made.SetTexture(texture)
    return made


def texture(image, smooth=True, repeat=True):
    made = vtk.vtkTexture()
    made.SetInputData(image)
    made.SetInterpolate(smooth)
    made.SetRepeat(repeat)
    made.SetEdgeClamp(not repeat)
    return made


ren = vtk.vtkRenderer()
ren.SetBackground(0.3, 0.3, 0.4)
ren.AddActor(plane(0, 0, texture(checks(16))))
ren.AddActor(plane(1.1, 0, texture(checks(8), smooth=False)))
ren.AddActor(plane(2.2, 0, texture(checks(8)), scale=2.5))
ren.AddActor(plane(0, 1.1, texture(checks(8), repeat=False), scale=1.7))
ren.AddActor(plane(1.1, 1.1, texture(checks(16), smooth=False), color=(0.5, 1, 0.5)))
ball = vtk.vtkTexturedSphereSource()
ball.SetThetaResolution(30)
ball.SetPhiResolution(30)
globe = actor(ball, (1, 1, 1))
globe.SetTexture(texture(checks(16)))
globe.SetPosition(2.7, 1.6, 0)
ren.AddActor(globe)
win = window(420, 300, ren)
look(ren, (1.6, 1, 5), (1.6, 1, 0), (0, 1, 0)).Zoom(1.3)
ren.ResetCameraClippingRange()
win.Render()
save(win, "textures", props=ren.GetNumberOfPropsRendered())

# Part of this texture is translucent.
ren.RemoveAllViewProps()
ren.SetUseDepthPeeling(1)
ren.SetOcclusionRatio(0)
ren.SetMaximumNumberOfPeels(20)
ren.AddActor(plane(0, 0, texture(checks(16, alpha=True), smooth=False)))
behind = plane(0.5, 0.3, texture(checks(4), smooth=False))
behind.SetPosition(0, 0, -0.5)
ren.AddActor(behind)
win.SetAlphaBitPlanes(1)
look(ren, (0.7, 0.6, 5), (0.7, 0.6, 0), (0, 1, 0)).Zoom(1.2)
win.Render()
save(win, "transparent")
