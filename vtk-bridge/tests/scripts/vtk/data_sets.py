# An unstructured grid through vtkDataSetMapper, culled backs, a scaled actor.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from capture import save
from vtkmodules.vtkFiltersCore import vtkElevationFilter
from vtkmodules.vtkFiltersSources import vtkCellTypeSource, vtkSphereSource

grid = vtkCellTypeSource()
grid.SetCellType(12)
grid.SetBlocksDimensions(3, 3, 3)
scalars = vtkElevationFilter()
scalars.SetInputConnection(grid.GetOutputPort())
scalars.SetLowPoint(0, 0, 0)
scalars.SetHighPoint(3, 2, 1)
mapper = vtkDataSetMapper()
mapper.SetInputConnection(scalars.GetOutputPort())
mapper.SetScalarRange(0, 1)
actor = vtkActor()
actor.SetMapper(mapper)
ren = vtkRenderer()
ren.AddActor(actor)
sphere = vtkSphereSource()
sphere.SetEndTheta(200)
for i in range(3):
    m = vtkPolyDataMapper()
    m.SetInputConnection(sphere.GetOutputPort())
    a = vtkActor()
    a.SetMapper(m)
    a.SetPosition(4.5, 1.2 * i, 1)
    a.SetScale(1.5 if i == 2 else 1.0, 1, 1)
    a.GetProperty().SetBackfaceCulling(i == 1)
    ren.AddActor(a)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(400, 260)
win.AddRenderer(ren)
ren.GetActiveCamera().SetPosition(6, 5, 8)
ren.ResetCamera()
win.Render()
save(win, "data_sets", props=ren.GetNumberOfPropsRendered())
