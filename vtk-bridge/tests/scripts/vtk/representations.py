# Surfaces with edges and vertices shown, wireframe and points of the same data, mixed cells in one data set, line width.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.3, 0.3, 0.3)
ball = vtk.vtkSphereSource()
ball.SetThetaResolution(10)
ball.SetPhiResolution(10)


def place(x, y):
    made = actor(ball, (0.6, 0.8, 0.9))
    made.SetPosition(x, y, 0)
    ren.AddActor(made)
    return made.GetProperty()


edges = place(0, 0)
edges.EdgeVisibilityOn()
edges.SetEdgeColor(0.5, 0, 0)
vertices = place(1.1, 0)
vertices.VertexVisibilityOn()
vertices.SetVertexColor(1, 1, 0)
vertices.SetPointSize(5)
place(2.2, 0).SetRepresentationToWireframe()
points = place(0, 1.1)
points.SetRepresentationToPoints()
points.SetPointSize(3)
place(1.1, 1.1)
# Vertices, lines and a triangle in one data set.
mixed = vtk.vtkPolyData()
corners = vtk.vtkPoints()
for p in ((0, 0, 0), (0.8, 0, 0), (0.4, 0, 0.7), (0, 0, 0.8), (0.8, 0, 0.9)):
    corners.InsertNextPoint(p)
triangles, lines, dots = vtk.vtkCellArray(), vtk.vtkCellArray(), vtk.vtkCellArray()
for cell, ids in ((triangles, (0, 1, 2)), (lines, (0, 3, 4)), (dots, (3,)), (dots, (4,))):
    cell.InsertNextCell(len(ids))
    for i in ids:
        cell.InsertCellPoint(i)
mixed.SetPoints(corners)
mixed.SetPolys(triangles)
mixed.SetLines(lines)
mixed.SetVerts(dots)
mapper = vtk.vtkPolyDataMapper()
mapper.SetInputData(mixed)
mix = vtk.vtkActor()
mix.SetMapper(mapper)
mix.SetPosition(1.9, 1.1, 0)
mix.GetProperty().SetPointSize(6)
mix.GetProperty().SetColor(0.9, 0.8, 0.3)
ren.AddActor(mix)
win = window(400, 300, ren)
look(ren, (1.1, -3, 4), (1.1, 0.5, 0)).Zoom(1.4)
ren.ResetCameraClippingRange()
win.Render()
save(win, "representations", props=ren.GetNumberOfPropsRendered())
