# Properties that meet: highlights under textures, textures on one side, mipmaps, opacity of glyphs, colours of blocks over scalars and on
# both sides, physically based surfaces under the light at the eye.
import vtk

from capture import actor, look, save, window


def checks(n):
    image = vtk.vtkImageData()
    image.SetDimensions(n, n, 1)
    image.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, 3)
    for y in range(n):
        for x in range(n):
            for c, value in enumerate((250, 60 + 170 * x // n, 40) if (x // 2 + y // 2) % 2 else (0, 90, 60 + 170 * y // n)):
                image.SetScalarComponentFromDouble(x, y, 0, c, value)
    made = vtk.vtkTexture()
    made.SetInputData(image)
    made.InterpolateOn()
    return made


def ball(x, texture=None, end=180.0):
    source = vtk.vtkTexturedSphereSource() if texture else vtk.vtkSphereSource()
    if not texture:
        source.SetEndPhi(end)
    source.SetThetaResolution(40)
    source.SetPhiResolution(40)
    source.SetRadius(0.5)
    made = actor(source, (0.9, 0.7, 0.0))
    if texture:
        made.SetTexture(texture)
    made.SetPosition(x, 0, 0)
    made.GetProperty().SetSpecular(0.7)
    made.GetProperty().SetSpecularPower(12)
    return made


def clip(made, *normal):
    plane = vtk.vtkPlane()
    plane.SetOrigin(made.GetPosition())
    plane.SetNormal(normal)
    made.GetMapper().AddClippingPlane(plane)
    return made


ren = vtk.vtkRenderer()
ren.SetBackground(0.1, 0.1, 0.2)
win = window(420, 200, ren)
win.SetAlphaBitPlanes(1)


def show(name, *actors):
    ren.RemoveAllViewProps()
    for made in actors:
        ren.AddActor(made)
    look(ren, (1.1, -1.0, 5), (1.1, 0, 0), (0, 1, 0)).Zoom(1.5)
    ren.ResetCameraClippingRange()
    win.Render()
    save(win, name)


dull = ball(2.2, checks(8))
dull.GetProperty().SetDiffuseColor(1, 1, 1)
show("highlights", ball(0, checks(8)), ball(1.1), dull)

sided = clip(ball(0, checks(8)), 0.2, -0.3, -1)
sided.GetProperty().SetShowTexturesOnBackface(False)
small = checks(64)
small.MipmapOn()
show("one_side_and_mipmaps", sided, clip(ball(1.1, checks(8)), 0.2, -0.3, -1), ball(2.2, small))

for made in (first := [ball(0), ball(1.1), ball(2.2)]):
    made.GetProperty().SetInterpolationToPBR()
first[0].GetProperty().SetRoughness(0.3)
first[1].GetProperty().SetMetallic(0.8)
first[2].GetProperty().SetRoughness(0.15)
show("physical_headlight", *first)


def glyphs(x, scalars):
    points = vtk.vtkPoints()
    values = vtk.vtkFloatArray()
    for k in range(9):
        points.InsertNextPoint(0.35 * (k % 3) - 0.35, 0.35 * (k // 3) - 0.35, 0.1 * (k % 4))
        values.InsertNextValue(k)
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.GetPointData().SetScalars(values)
    source = vtk.vtkSphereSource()
    source.SetThetaResolution(24)
    source.SetPhiResolution(24)
    mapper = vtk.vtkGlyph3DMapper()
    mapper.SetInputData(data)
    mapper.SetSourceConnection(source.GetOutputPort())
    mapper.ScalingOff()
    mapper.SetScaleFactor(1)
    mapper.SetScalarVisibility(scalars)
    mapper.SetScalarRange(0, 8)
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.SetScale(0.45)
    made.SetPosition(x, 0, 0)
    made.GetProperty().SetColor(0.9, 0.5, 0.1)
    made.GetProperty().SetOpacity(0.6)
    return made


ren.SetUseDepthPeeling(1)
ren.SetMaximumNumberOfPeels(40)
ren.SetOcclusionRatio(0)
show("translucent_glyphs", glyphs(0.3, True), glyphs(1.7, False))
ren.SetUseDepthPeeling(0)


def blocks(x, scalars, back):
    data = vtk.vtkMultiBlockDataSet()
    for k in range(2):
        source = vtk.vtkSphereSource()
        source.SetThetaResolution(30)
        source.SetPhiResolution(30)
        source.SetRadius(0.5 - 0.25 * k)
        heights = vtk.vtkElevationFilter()
        heights.SetInputConnection(source.GetOutputPort())
        heights.SetLowPoint(0, -0.5, 0)
        heights.SetHighPoint(0, 0.5, 0)
        heights.Update()
        data.SetBlock(k, heights.GetOutput())
    mapper = getattr(vtk, "vtkCompositePolyDataMapper2", vtk.vtkCompositePolyDataMapper)()
    mapper.SetInputDataObject(data)
    mapper.SetScalarVisibility(scalars)
    mapper.SetCompositeDataDisplayAttributes(vtk.vtkCompositeDataDisplayAttributes())
    mapper.SetBlockColor(1, (0.2, 0.5, 0.9))
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.SetPosition(x, 0, 0)
    if back:
        inside = vtk.vtkProperty()
        inside.SetColor(0.9, 0.8, 0.1)
        inside.SetSpecular(0.5)
        made.SetBackfaceProperty(inside)
    return clip(made, 0.3, -0.3, -1)


show("blocks", blocks(0, True, False), blocks(1.1, False, True), blocks(2.2, False, False))

# An image lights physically based surfaces and no others.
image = vtk.vtkImageData()
image.SetDimensions(32, 16, 1)
image.AllocateScalars(vtk.VTK_FLOAT, 3)
for y in range(16):
    for x in range(32):
        for c, value in enumerate((x / 32, y / 16, 0.5)):
            image.SetScalarComponentFromDouble(x, y, 0, c, value)
sky = vtk.vtkTexture()
sky.SetInputData(image)
sky.SetColorModeToDirectScalars()
sky.InterpolateOn()
sky.MipmapOn()
ren.SetEnvironmentTexture(sky)
ren.UseImageBasedLightingOn()
show("image_lighting", first[0], ball(1.1), first[2])


# Polygons that are not convex: fans before VTK 9.7, cut into triangles since then.
def polygon(x, *corners):
    points = vtk.vtkPoints()
    cells = vtk.vtkCellArray()
    cells.InsertNextCell(len(corners))
    for corner in corners:
        cells.InsertCellPoint(points.InsertNextPoint(*corner))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.SetScale(0.45)
    made.SetPosition(x, -0.4, 0)
    return made


show(
    "concave_polygons",
    polygon(-0.4, (0, 0, 0), (2, 0, 0.2), (2, 2, 0), (1, 0.5, 0.2), (0, 2, 0)),
    polygon(0.7, (0, 0, 0), (2, 0, 0), (2, 2, 0), (1.2, 0.4, 0), (0.8, 0.4, 0), (0, 2, 0)),
    polygon(1.8, (0, 0, 0), (2, 0, 0.1), (2, 2, 0), (1.2, 0.4, 0.1), (1, 1, 0), (0.8, 0.4, 0), (0, 2, 0.2)),
)
