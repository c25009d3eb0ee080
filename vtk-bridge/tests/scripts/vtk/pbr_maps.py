# Textures of physically based properties: occlusion with roughness and metalness, normals (with tangents, without, scaled, on backs), emission.
import math

import vtk

from capture import actor, look, save, window


def texture(of, n=32, srgb=False, smooth=True):
    """An image from a function of the position (0 to 1 along each axis) to three numbers 0 to 1."""
    image = vtk.vtkImageData()
    image.SetDimensions(n, n, 1)
    pixels = vtk.vtkUnsignedCharArray()
    pixels.SetNumberOfComponents(3)
    for y in range(n):
        for x in range(n):
            pixels.InsertNextTuple([round(255 * v) for v in of((x + 0.5) / n, (y + 0.5) / n)])
    image.GetPointData().SetScalars(pixels)
    made = vtk.vtkTexture()
    made.SetInputData(image)
    made.SetUseSRGBColorSpace(srgb)
    made.SetInterpolate(smooth)
    return made


def bumps(u, v):
    a, b = 0.5 * math.cos(6 * math.pi * u), 0.4 * math.sin(4 * math.pi * v)
    length = math.sqrt(a * a + b * b + 1)
    return 0.5 + 0.5 * a / length, 0.5 + 0.5 * b / length, 0.5 + 0.5 / length


packed = texture(lambda u, v: (0.3 + 0.7 * u, 0.35 + 0.6 * v, 0.5 + 0.5 * math.sin(9 * u)))
normals = texture(bumps, 64)
glow = texture(lambda u, v: (u * v, 0.6 * (u > 0.5), 0.2), srgb=True, smooth=False)
base = texture(lambda u, v: (0.9, 0.5 + 0.4 * v, 0.2 + 0.6 * u), srgb=True)


def shape(kind, with_tangents=True):
    if kind == "ball":
        source = vtk.vtkTexturedSphereSource()
        source.SetThetaResolution(40)
        source.SetPhiResolution(30)
    else:
        source = vtk.vtkPlaneSource()
        source.SetOrigin(-0.5, -0.5, 0)
        source.SetPoint1(0.5, -0.5, 0)
        source.SetPoint2(-0.5, 0.5, 0)
        source.SetResolution(6, 6)
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputConnection(source.GetOutputPort())
    if not with_tangents:
        return triangles
    tangents = vtk.vtkPolyDataTangents()
    tangents.SetInputConnection(triangles.GetOutputPort())
    return tangents


def made(x, y, kind="ball", with_tangents=True, metallic=0.6, roughness=0.7):
    a = actor(shape(kind, with_tangents), (0.9, 0.8, 0.7))
    a.SetPosition(x, y, 0)
    p = a.GetProperty()
    p.SetInterpolationToPBR()
    p.SetMetallic(metallic)
    p.SetRoughness(roughness)
    ren.AddActor(a)
    return a


ren = vtk.vtkRenderer()
ren.SetBackground(0.15, 0.15, 0.2)
for position, color in (((3, 4, 8), (1, 1, 1)), ((-6, -2, 5), (0.4, 0.5, 0.9))):
    light = vtk.vtkLight()
    light.SetLightTypeToSceneLight()
    light.SetPosition(position)
    light.SetFocalPoint(1.1, 1.1, 0)
    light.SetColor(color)
    light.SetIntensity(2)
    ren.AddLight(light)

made(0, 0).GetProperty().SetORMTexture(packed)
half = made(1.1, 0).GetProperty()
half.SetORMTexture(packed)
half.SetOcclusionStrength(0.4)
half.SetBaseColorTexture(base)
made(2.2, 0).GetProperty().SetNormalTexture(normals)
scaled = made(3.3, 0).GetProperty()
scaled.SetNormalTexture(normals)
scaled.SetNormalScale(0.35)
made(0, 1.1).GetProperty().SetEmissiveTexture(glow)
dim = made(1.1, 1.1).GetProperty()
dim.SetEmissiveTexture(glow)
dim.SetEmissiveFactor(0.5, 0.25, 1.0)
dim.SetORMTexture(packed)
everything = made(2.2, 1.1, metallic=1.0, roughness=1.0).GetProperty()
for set_texture, t in ((everything.SetBaseColorTexture, base), (everything.SetORMTexture, packed), (everything.SetNormalTexture, normals), (everything.SetEmissiveTexture, glow)):
    set_texture(t)
without = made(3.3, 1.1, with_tangents=False).GetProperty()
without.SetNormalTexture(normals)
win = window(420, 240, ren)
look(ren, (1.65, 0.55, 8), (1.65, 0.55, 0), (0, 1, 0)).Zoom(1.6)
ren.ResetCameraClippingRange()
win.Render()
save(win, "maps", props=ren.GetNumberOfPropsRendered())

# Rotated planes, one of them seen from behind; and one that is clipped by a plane, rotated and
# stretched.
ren.RemoveAllViewProps()
for x, turn in ((0, 0), (1.1, 50), (2.2, 150)):
    plate = made(x, 0, "plate", metallic=0.2)
    plate.RotateY(turn)
    plate.GetProperty().SetNormalTexture(normals)
cut = made(3.3, 0, "plate", metallic=0.2)
cut.RotateZ(30)
cut.SetScale(0.8, 0.8, 0.8)
cut.GetProperty().SetNormalTexture(normals)
cut.GetProperty().SetORMTexture(packed)
plane = vtk.vtkPlane()
plane.SetOrigin(3.2, 0, 0)
plane.SetNormal(1, 0.3, 0)
cut.GetMapper().AddClippingPlane(plane)
look(ren, (1.65, 0, 8), (1.65, 0, 0), (0, 1, 0)).Zoom(1.6)
ren.ResetCameraClippingRange()
win.Render()
save(win, "plates", props=ren.GetNumberOfPropsRendered())
