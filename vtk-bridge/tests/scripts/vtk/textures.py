# A picture on a plane: repeated, nearest and linear.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersSources import vtkPlaneSource
from vtkmodules.vtkImagingSources import vtkImageCanvasSource2D
from vtkmodules.vtkCommonCore import vtkFloatArray

canvas = vtkImageCanvasSource2D()
canvas.SetScalarTypeToUnsignedChar()
canvas.SetNumberOfScalarComponents(3)
canvas.SetExtent(0, 15, 0, 15, 0, 0)
canvas.SetDrawColor(250, 240, 200)
canvas.FillBox(0, 15, 0, 15)
canvas.SetDrawColor(30, 60, 200)
canvas.FillBox(2, 7, 3, 12)
canvas.SetDrawColor(200, 40, 60)
canvas.FillBox(10, 13, 1, 5)
ren = vtkRenderer()
for i in range(2):
    plane = vtkPlaneSource()
    plane.SetOrigin(1.1 * i, 0, 0)
    plane.SetPoint1(1.1 * i + 1, 0, 0.3)
    plane.SetPoint2(1.1 * i, 1, 0)
    plane.SetResolution(3, 2)
    plane.Update()
    data = plane.GetOutput()
    coordinates = data.GetPointData().GetTCoords()
    for k in range(coordinates.GetNumberOfTuples()):
        u, v = coordinates.GetTuple2(k)
        coordinates.SetTuple2(k, 1.7 * u, 1.3 * v)
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    texture = vtkTexture()
    texture.SetInputConnection(canvas.GetOutputPort())
    texture.SetInterpolate(i)
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.SetTexture(texture)
    ren.AddActor(actor)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(400, 220)
win.AddRenderer(ren)
ren.ResetCamera()
win.Render()
