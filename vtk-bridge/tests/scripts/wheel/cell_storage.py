# The same sphere with its cells in every storage of vtkCellArray since VTK 9.6.
import vtk

from capture import look, save, window

source = vtk.vtkSphereSource()
source.SetThetaResolution(20)
source.SetPhiResolution(20)
source.Update()
triangles = vtk.vtkTriangleFilter()
triangles.SetInputConnection(source.GetOutputPort())
triangles.Update()
sphere = triangles.GetOutput()
ids = [sphere.GetPolys().GetConnectivityArray().GetComponent(i, 0) for i in range(3 * sphere.GetNumberOfCells())]


def filled(kind, values):
    array = kind()
    array.SetNumberOfValues(len(values))
    for i, value in enumerate(values):
        array.SetComponent(i, 0, value)
    return array


def cells(kind, fixed):
    made = vtk.vtkCellArray()
    if fixed:
        made.SetData(3, filled(kind, ids))
    else:
        made.SetData(filled(kind, range(0, len(ids) + 1, 3)), filled(kind, ids))
    return made


kinds = (vtk.vtkTypeInt32Array, vtk.vtkTypeInt64Array, vtk.vtkUnsignedIntArray, vtk.vtkUnsignedShortArray, vtk.vtkFloatArray)
storages = set()
ren = vtk.vtkRenderer()
ren.SetBackground(0.1, 0.2, 0.2)
for row, fixed in enumerate((False, True)):
    for column, kind in enumerate(kinds):
        data = vtk.vtkPolyData()
        data.ShallowCopy(sphere)
        data.SetPolys(cells(kind, fixed))
        storages.add(data.GetPolys().GetStorageType())
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputData(data)
        actor = vtk.vtkActor()
        actor.SetMapper(mapper)
        actor.SetPosition(1.2 * column, 1.2 * row, 0)
        ren.AddActor(actor)
assert len(storages) == 5, storages
win = window(400, 200, ren)
look(ren, (2.4, 0.6, 8), (2.4, 0.6, 0), (0, 1, 0)).Zoom(1.8)
win.Render()
save(win, "storages", props=ren.GetNumberOfPropsRendered())
