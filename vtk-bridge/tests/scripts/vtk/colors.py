# Colours from points, cells and fields; lookup tables plain, categorical, logarithmic and with NaN; colours given directly.
import math

import vtk

from capture import look, save, window


def patch(n=6):
    source = vtk.vtkPlaneSource()
    source.SetXResolution(n)
    source.SetYResolution(n)
    source.Update()
    return source.GetOutput()


def array(name, values, components=1, kind=vtk.vtkFloatArray):
    made = kind()
    made.SetName(name)
    made.SetNumberOfComponents(components)
    for value in values:
        made.InsertNextTuple(value if components > 1 else (value,))
    return made


def add(ren, place, data, setting=None):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetScalarRange(0, 1)
    if setting:
        setting(mapper)
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.SetPosition(1.1 * (place % 4), 1.1 * (place // 4), 0)
    made.GetProperty().SetColor(0.9, 0.9, 0.9)
    ren.AddActor(made)
    return made


ren = vtk.vtkRenderer()
points = [math.sin(3 * i) * 0.5 + 0.5 for i in range(49)]
cells = [(7 * i % 36) / 35 for i in range(36)]

data = patch()
data.GetPointData().SetScalars(array("p", points))
add(ren, 0, data)
add(ren, 1, data, lambda m: m.InterpolateScalarsBeforeMappingOn())

data = patch()
data.GetCellData().SetScalars(array("c", cells))
add(ren, 2, data)


def table_with_nan(mapper):
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(5)
    table.SetHueRange(0.1, 0.8)
    table.SetNanColor(0, 0, 0, 1)
    table.SetBelowRangeColor(1, 1, 1, 1)
    table.UseBelowRangeColorOn()
    table.Build()
    mapper.SetLookupTable(table)
    mapper.SetScalarRange(0.2, 1)


data = patch()
data.GetCellData().SetScalars(array("c", [math.nan if i % 5 == 0 else c for i, c in enumerate(cells)]))
add(ren, 3, data, table_with_nan)

data = patch()
data.GetCellData().SetScalars(
    array("rgb", [(i * 7 % 256, 255 - i * 5, 90) for i in range(36)], 3, vtk.vtkUnsignedCharArray)
)
add(ren, 4, data)

data = patch()
data.GetPointData().AddArray(array("v", [(p, 1 - p, 0.3) for p in points], 3))


def by_component(mapper):
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("v")
    table = mapper.GetLookupTable()
    table.SetVectorModeToComponent()
    table.SetVectorComponent(1)


add(ren, 5, data, by_component)


def logarithmic(mapper):
    table = vtk.vtkLookupTable()
    table.SetScaleToLog10()
    table.SetTableRange(0.01, 1)
    table.Build()
    mapper.SetLookupTable(table)
    mapper.UseLookupTableScalarRangeOn()


data = patch()
data.GetPointData().SetScalars(array("p", [max(p, 0.001) for p in points]))
add(ren, 6, data, logarithmic)


def categorical(mapper):
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(3)
    for i, color in enumerate(((1, 0, 0, 1), (0, 0.7, 0, 1), (0, 0, 1, 1))):
        table.SetTableValue(i, color)
        table.SetAnnotation(str(i), "kind %d" % i)
    table.IndexedLookupOn()
    mapper.SetLookupTable(table)


data = patch()
data.GetCellData().SetScalars(array("k", [i % 3 for i in range(36)], 1, vtk.vtkIntArray))
add(ren, 7, data, categorical)


def by_field(mapper):
    mapper.SetScalarModeToUseFieldData()
    mapper.SelectColorArray("f")
    mapper.SetColorModeToMapScalars()


data = patch()
data.GetFieldData().AddArray(array("f", cells))
add(ren, 8, data, by_field)

transfer = vtk.vtkColorTransferFunction()
transfer.AddRGBPoint(0, 0.1, 0.1, 0.6)
transfer.AddRGBPoint(0.4, 0.9, 0.9, 0.9)
transfer.AddRGBPoint(1, 0.7, 0.1, 0.1)
transfer.SetColorSpaceToLab()
data = patch()
data.GetPointData().SetScalars(array("p", points))
add(ren, 9, data, lambda m: m.SetLookupTable(transfer))


def smooth_transfer(mapper):
    mapper.SetLookupTable(transfer)
    mapper.InterpolateScalarsBeforeMappingOn()


add(ren, 10, data, smooth_transfer)
off = add(ren, 11, data, lambda m: m.ScalarVisibilityOff())
off.GetProperty().SetColor(0.2, 0.7, 0.6)

win = window(420, 320, ren)
look(ren, (1.65, 1.1, 6), (1.65, 1.1, 0), (0, 1, 0)).Zoom(1.35)
win.Render()
save(win, "colors", props=ren.GetNumberOfPropsRendered())
# Other colours on the same arrays: the surface must not keep the old ones.
scalars = data.GetPointData().GetScalars()
for i in range(scalars.GetNumberOfTuples()):
    scalars.SetTuple1(i, 1 - points[i])
scalars.Modified()
transfer.AddRGBPoint(0.7, 0.1, 0.9, 0.1)
off.GetProperty().SetColor(0.9, 0.2, 0.6)
win.Render()
save(win, "recolored")
