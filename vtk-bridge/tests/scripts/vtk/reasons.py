# Props that OpenGL draws, each for another reason, beside one that is traced. The reasons are the picture's facts.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.3)
# The culler would take away props without bounds before the shim sees them.
ren.GetCullers().RemoveAllItems()
reasons = []
places = iter([(x, 0, z) for z in range(6) for x in range(6)])


def ball():
    source = vtk.vtkSphereSource()
    source.SetRadius(0.4)
    source.SetThetaResolution(12)
    source.SetPhiResolution(12)
    return source


def place(prop, reason=None):
    prop.SetPosition(next(places))
    ren.AddViewProp(prop)
    if reason:
        reasons.append(reason)
    return prop


def shown(reason, source=None):
    """A new actor's property and the actor."""
    made = place(actor(source or ball(), (0.8, 0.5, 0.3)), reason)
    return made.GetProperty(), made


def half(mapper):
    plane = vtk.vtkPlane()
    plane.SetNormal(0, 0, 1)
    plane.SetOrigin(ren.GetViewProps().GetLastProp().GetPosition())
    mapper.AddClippingPlane(plane)


def picture():
    image = vtk.vtkImageData()
    image.SetDimensions(4, 4, 1)
    image.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, 3)
    for i in range(48):
        image.GetPointData().GetScalars().SetComponent(i // 3, i % 3, 255 if i // 3 % 2 else 90)
    texture = vtk.vtkTexture()
    texture.SetInputData(image)
    texture.UseSRGBColorSpaceOn()
    return texture


def mapped():
    source, texcoords = ball(), vtk.vtkTextureMapToSphere()
    texcoords.SetInputConnection(source.GetOutputPort())
    return texcoords


# ---- Properties.
place(actor(ball(), (0.3, 0.6, 0.9)))
shown("wireframe (set RTV_LINE_RADIUS to trace edges as tubes)")[0].SetRepresentationToWireframe()
shown("points (set RTV_POINT_RADIUS to trace them as spheres)")[0].SetRepresentationToPoints()
p, _ = shown("edges as shaded tubes on the surface")
p.EdgeVisibilityOn()
p.RenderLinesAsTubesOn()
p.SetLineWidth(2)
p, a = shown("edges on a clipped surface")
p.EdgeVisibilityOn()
half(a.GetMapper())
if hasattr(p, "SetEdgeOpacity"):
    p, _ = shown("translucent edges on the surface")
    p.EdgeVisibilityOn()
    p.SetEdgeOpacity(0.5)
shown("vertices on the surface")[0].VertexVisibilityOn()
back = vtk.vtkProperty()
back.SetOpacity(0.5)
shown("translucent backs with a property of their own")[1].SetBackfaceProperty(back)
p, _ = shown("a clear coat or anisotropy")
p.SetInterpolationToPBR()
p.SetCoatStrength(0.5)
p, _ = shown("a metal with an edge tint")
p.SetInterpolationToPBR()
p.SetMetallic(0.5)
p.SetEdgeTint(1, 0.5, 0.5)
p, _ = shown("textures of the property without physically based shading", mapped())
p.SetTexture("albedoTex", picture())
p, a = shown("a texture and a texture of the property", mapped())
p.SetInterpolationToPBR()
p.SetTexture("albedoTex", picture())
a.SetTexture(picture())
texture, turned = picture(), vtk.vtkTransform()
turned.Scale(2, 2, 1)
texture.SetTransform(turned)
shown("a texture with a transform", mapped())[1].SetTexture(texture)
_, a = shown("shader code of its own")
a.GetShaderProperty().AddFragmentShaderReplacement("//VTK::Light::Impl", True, "//VTK::Light::Impl\n  // nothing else\n", False)

# ---- Classes and data.
source, gaussian = ball(), vtk.vtkPointGaussianMapper()
gaussian.SetInputConnection(source.GetOutputPort())
gaussian.SetScaleFactor(0.05)
dots = vtk.vtkActor()
dots.SetMapper(gaussian)
place(dots, "OpenGL draws mappers of this class")
follower = vtk.vtkFollower()
follower.SetMapper(actor(ball(), (0.2, 0.7, 0.4)).GetMapper())
follower.SetCamera(ren.GetActiveCamera())
place(follower, "OpenGL draws props of this class")
place(vtk.vtkActor(), "OpenGL draws props of this class")
idle = vtk.vtkActor()
idle.SetMapper(vtk.vtkPolyDataMapper())
place(idle, "no data")
line, point = vtk.vtkLineSource(), vtk.vtkPointSource()
shown("it has lines (set RTV_LINE_RADIUS to trace them as tubes)", line)
point.SetNumberOfPoints(1)
shown("it has vertices (set RTV_POINT_RADIUS to trace them as spheres)", point)
source, colored = mapped(), vtk.vtkElevationFilter()
colored.SetInputConnection(source.GetOutputPort())
both = actor(colored)
both.SetTexture(picture())
place(both, "it has a texture and colours")
_, a = shown("a texture on a surface whose backs have a property of their own", mapped())
a.SetTexture(picture())
a.SetBackfaceProperty(vtk.vtkProperty())


# ---- Glyphs.
def glyphs(reason, source):
    small = vtk.vtkSphereSource()
    small.SetRadius(0.3)
    small.SetThetaResolution(4)
    small.SetPhiResolution(4)
    small.Update()
    mapper = vtk.vtkGlyph3DMapper()
    mapper.SetInputData(small.GetOutput())
    mapper.SetSourceConnection(source.GetOutputPort())
    mapper.SetScaleFactor(0.2)
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    place(made, reason)
    return mapper, made


glyphs("glyphs whose source is not polygons", vtk.vtkLineSource())
glyphs("glyphs whose backs have a property of their own", vtk.vtkCubeSource())[1].SetBackfaceProperty(vtk.vtkProperty())
half(glyphs("glyphs with clipping planes", vtk.vtkCubeSource())[0])
mapper, _ = glyphs("glyphs with colours that are not of points", vtk.vtkCubeSource())
data = mapper.GetInput()
values = vtk.vtkFloatArray()
for i in range(data.GetNumberOfCells()):
    values.InsertNextValue(i)
data.GetCellData().SetScalars(values)
mapper.SetScalarModeToUseCellData()
mapper.SetScalarRange(0, data.GetNumberOfCells())


# ---- Volumes.
def volume(reason):
    wavelet = vtk.vtkRTAnalyticSource()
    wavelet.SetWholeExtent(-3, 3, -3, 3, -3, 3)
    wavelet.Update()
    data = vtk.vtkImageData()
    data.DeepCopy(wavelet.GetOutput())
    mapper = vtk.vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(data)
    mapper.UseJitteringOff()
    colors, opacity = vtk.vtkColorTransferFunction(), vtk.vtkPiecewiseFunction()
    colors.AddRGBPoint(0, 0.9, 0.6, 0.3)
    opacity.AddPoint(0, 0.3)
    p = vtk.vtkVolumeProperty()
    p.SetColor(colors)
    p.SetScalarOpacity(opacity)
    made = vtk.vtkVolume()
    made.SetMapper(mapper)
    made.SetProperty(p)
    made.SetScale(0.1)
    place(made, reason)
    return mapper, p, data


mapper, _, _ = volume("a volume cropped to more than a box, with another blending than composite")
mapper.CroppingOn()
mapper.SetCroppingRegionPlanes(-2, 2, -2, 2, -2, 2)
mapper.SetCroppingRegionFlagsToFence()
mapper.SetBlendModeToAdditive()
mapper, _, data = volume("a cropped volume with turned axes")
mapper.CroppingOn()
data.SetDirectionMatrix(0, 1, 0, -1, 0, 0, 0, 0, 1)
mapper, p, _ = volume("a shaded volume with maximum or minimum intensity blending")
mapper.SetBlendModeToMaximumIntensity()
p.ShadeOn()
_, p, _ = volume("a shaded volume with a highlight under other lights than one white headlight")
p.ShadeOn()
p.SetSpecular(0.5)

light = vtk.vtkLight()
light.SetLightTypeToSceneLight()
light.SetPosition(2, -9, 6)
light.SetFocalPoint(2, 0, 2)
ren.AddLight(light)
win = window(400, 400, ren)
look(ren, (2.5, -20, 2.5), (2.5, 0, 2.5)).Zoom(1.3)
win.Render()
save(win, "reasons", reasons=reasons)
