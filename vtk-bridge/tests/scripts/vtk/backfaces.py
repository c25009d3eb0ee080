# Inside and outside of open surfaces: a back-face property, culling of either side, reversed
# normals.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.2)


def bowl(x, y):
    source = vtk.vtkSphereSource()
    source.SetEndPhi(100)
    source.SetThetaResolution(30)
    source.SetPhiResolution(20)
    made = actor(source, (0.3, 0.6, 0.9))
    made.SetPosition(x, y, 0)
    made.RotateX(130)
    ren.AddActor(made)
    return made


bowl(0, 0)
inside = vtk.vtkProperty()
inside.SetColor(0.9, 0.5, 0.1)
inside.SetSpecular(0.5)
inside.SetSpecularPower(20)
bowl(1.1, 0).SetBackfaceProperty(inside)
bowl(2.2, 0).GetProperty().BackfaceCullingOn()
bowl(0, 1.1).GetProperty().FrontfaceCullingOn()
# Reversed normals, but the same order of the points.
source = vtk.vtkSphereSource()
source.SetEndPhi(100)
source.SetThetaResolution(30)
source.SetPhiResolution(20)
source.Update()
turned = vtk.vtkPolyData()
turned.DeepCopy(source.GetOutput())
normals = turned.GetPointData().GetNormals()
for i in range(normals.GetNumberOfTuples()):
    normals.SetTuple3(i, *(-v for v in normals.GetTuple3(i)))
mapper = vtk.vtkPolyDataMapper()
mapper.SetInputData(turned)
wrong = vtk.vtkActor()
wrong.SetMapper(mapper)
wrong.SetPosition(2.2, 1.1, 0)
wrong.RotateX(130)
wrong.GetProperty().SetColor(0.3, 0.6, 0.9)
ren.AddActor(wrong)
win = window(380, 280, ren)
look(ren, (1.1, -1.5, 5), (1.1, 0.5, 0)).Zoom(1.4)
ren.ResetCameraClippingRange()
win.Render()
save(win, "backfaces", props=ren.GetNumberOfPropsRendered())
