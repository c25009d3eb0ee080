# Translucent blocks of which a later one cannot be traced: because of lines, and because it has
# colours and the actor a texture. OpenGL then draws the whole actor, and no block may appear twice.
# The floor is traced.
import vtk

from capture import actor, look, save, window


def sphere(x, scalars):
    source = vtk.vtkSphereSource()
    source.SetCenter(x, 0, 0.5)
    source.SetThetaResolution(24)
    source.SetPhiResolution(24)
    texcoords = vtk.vtkTextureMapToSphere()
    texcoords.SetInputConnection(source.GetOutputPort())
    texcoords.PreventSeamOff()
    texcoords.Update()
    data = vtk.vtkPolyData()
    data.ShallowCopy(texcoords.GetOutput())
    data.GetPointData().SetNormals(source.GetOutput().GetPointData().GetNormals())
    if scalars:
        values = vtk.vtkFloatArray()
        values.SetName("values")
        for i in range(data.GetNumberOfPoints()):
            values.InsertNextValue(data.GetPoint(i)[2])
        data.GetPointData().SetScalars(values)
    return data


def line():
    source = vtk.vtkLineSource()
    source.SetPoint1(-1.8, -0.7, 0.4)
    source.SetPoint2(1.8, -0.7, 0.6)
    source.Update()
    return source.GetOutput()


def checks():
    image = vtk.vtkImageData()
    image.SetDimensions(4, 4, 1)
    image.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, 3)
    for i in range(16):
        bright = 255 if (i + i // 4) % 2 else 60
        for c in range(3):
            image.SetScalarComponentFromDouble(i % 4, i // 4, 0, c, bright)
    texture = vtk.vtkTexture()
    texture.SetInputData(image)
    texture.RepeatOn()
    return texture


def blocks(*data):
    made = vtk.vtkMultiBlockDataSet()
    for i, block in enumerate(data):
        made.SetBlock(i, block)
    # Since VTK 9.3, one class has the features of both names.
    mapper = getattr(vtk, "vtkCompositePolyDataMapper2", vtk.vtkCompositePolyDataMapper)()
    mapper.SetInputDataObject(made)
    mapper.SetScalarRange(0, 1)
    shown = vtk.vtkActor()
    shown.SetMapper(mapper)
    shown.GetProperty().SetColor(0.9, 0.3, 0.2)
    shown.GetProperty().SetOpacity(0.4)
    return shown


plane = vtk.vtkPlaneSource()
plane.SetOrigin(-2, -2, -0.2)
plane.SetPoint1(2, -2, -0.2)
plane.SetPoint2(-2, 2, -0.2)
for name, shown in (
    ("lines", blocks(sphere(-1, False), sphere(0, True), line())),
    ("textured", blocks(sphere(-1, False), sphere(0.2, True))),
):
    if name == "textured":
        shown.SetTexture(checks())
    ren = vtk.vtkRenderer()
    ren.SetBackground(0.1, 0.1, 0.2)
    ren.AddActor(actor(plane, (0.7, 0.7, 0.6)))
    ren.AddActor(shown)
    ren.SetUseDepthPeeling(1)
    ren.SetMaximumNumberOfPeels(20)
    ren.SetOcclusionRatio(0)
    win = window(300, 240, ren)
    win.SetAlphaBitPlanes(1)
    look(ren, (1, -5, 3), (0, 0, 0.2)).Zoom(1.3)
    win.Render()
    save(win, name, props=ren.GetNumberOfPropsRendered())
    # A second frame: rejected surfaces must not be treated as cached.
    ren.GetActiveCamera().Azimuth(20)
    ren.ResetCameraClippingRange()
    win.Render()
    save(win, name + "_turned")
