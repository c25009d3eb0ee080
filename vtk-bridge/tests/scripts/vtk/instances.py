# Glyphs of one source through the mapper: each mode of orientation and scaling, colours from an
# array, a mask, clamping; placed by their actors.
import math

import vtk

from capture import look, save, window

points, vectors, quaternions, sizes, shown = (
    vtk.vtkPoints(), vtk.vtkDoubleArray(), vtk.vtkFloatArray(), vtk.vtkFloatArray(), vtk.vtkBitArray()
)  # fmt: skip
for array, name, components in ((vectors, "v", 3), (quaternions, "q", 4), (sizes, "s", 1), (shown, "m", 1)):
    array.SetName(name)
    array.SetNumberOfComponents(components)
for i in range(12):
    a = 2 * math.pi * i / 12
    points.InsertNextPoint(math.cos(a), math.sin(a), 0.1 * i)
    # The second one points along -x, the fourth has no length.
    v = {1: (-0.3, 0, 0), 3: (0, 0, 0)}.get(i, (math.cos(a), 0.5 * math.sin(2 * a), 0.4 * math.sin(a)))
    vectors.InsertNextTuple(v)
    quaternions.InsertNextTuple((math.cos(a / 2), 0.6 * math.sin(a / 2), 0, 0.8 * math.sin(a / 2)))
    sizes.InsertNextValue(0.2 + 0.05 * i)
    shown.InsertNextValue(i % 5 != 2)
data = vtk.vtkPolyData()
data.SetPoints(points)
for array in (vectors, quaternions, sizes, shown):
    data.GetPointData().AddArray(array)
cone = vtk.vtkConeSource()
cone.SetResolution(5)
ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.3)


def glyphs(x, y, factor=0.5, orient=None, scale=None, components=False, by=None):
    mapper = vtk.vtkGlyph3DMapper()
    mapper.SetInputData(data)
    mapper.SetSourceConnection(cone.GetOutputPort())
    mapper.SetScaleFactor(factor)
    if orient:
        mapper.SetOrientationArray(orient[0])
        mapper.SetOrientationMode(orient[1])
    else:
        mapper.OrientOff()
    if scale:
        mapper.SetScaleArray(scale)
        mapper.SetScaleMode(mapper.SCALE_BY_COMPONENTS if components else mapper.SCALE_BY_MAGNITUDE)
    if by:
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(by)
        mapper.SetScalarRange(0.2, 0.8)
    else:
        mapper.ScalarVisibilityOff()
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.SetPosition(x, y, 0)
    made.GetProperty().SetColor(0.9, 0.7, 0.3)
    ren.AddActor(made)
    return made


glyphs(0, 0)
glyphs(3, 0, orient=("v", vtk.vtkGlyph3DMapper.DIRECTION), by="s")
glyphs(6, 0, orient=("q", vtk.vtkGlyph3DMapper.QUATERNION), scale="s", factor=1)
glyphs(0, 3, orient=("v", vtk.vtkGlyph3DMapper.DIRECTION), scale="v")
glyphs(3, 3, scale="v", components=True).GetMapper().SetScaleFactor(1)
last = glyphs(6, 3, scale="s", by="s", factor=1.5)
mapper = last.GetMapper()
mapper.ClampingOn()
mapper.SetRange(0.3, 0.9)
mapper.MaskingOn()
mapper.SetMaskArray("m")
win = window(420, 300, ren)
look(ren, (3, 1.5, 12), (3, 1.5, 0), (0, 1, 0)).Zoom(1.3)
win.Render()
save(win, "instances", props=ren.GetNumberOfPropsRendered())
# Sizes and colours change; the shape stays the same.
for i in range(12):
    sizes.SetValue(i, 0.75 - 0.05 * i)
sizes.Modified()
data.Modified()
last.RotateX(30)
win.Render()
save(win, "changed")
