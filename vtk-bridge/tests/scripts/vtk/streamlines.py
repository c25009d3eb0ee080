# Streamlines as tubes, with a wireframe outline that stays OpenGL's.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonCore import vtkFloatArray
from vtkmodules.vtkFiltersCore import vtkTubeFilter
from vtkmodules.vtkFiltersFlowPaths import vtkStreamTracer
from vtkmodules.vtkFiltersModeling import vtkOutlineFilter
from vtkmodules.vtkFiltersSources import vtkPointSource
import math

image = vtkImageData()
image.SetDimensions(16, 16, 16)
image.SetSpacing(1 / 15.0, 1 / 15.0, 1 / 15.0)
vectors = vtkFloatArray()
vectors.SetName("v")
vectors.SetNumberOfComponents(3)
for i in range(image.GetNumberOfPoints()):
    x, y, z = image.GetPoint(i)
    vectors.InsertNextTuple3(-(y - 0.5), x - 0.5, 0.3 + 0.2 * math.sin(5 * x))
image.GetPointData().SetVectors(vectors)
seeds = vtkPointSource()
seeds.SetCenter(0.5, 0.5, 0.1)
seeds.SetRadius(0.3)
seeds.SetNumberOfPoints(25)
tracer = vtkStreamTracer()
tracer.SetInputData(image)
tracer.SetSourceConnection(seeds.GetOutputPort())
tracer.SetMaximumPropagation(3)
tracer.SetIntegrationDirectionToBoth()
tube = vtkTubeFilter()
tube.SetInputConnection(tracer.GetOutputPort())
tube.SetRadius(0.012)
tube.SetNumberOfSides(12)
outline = vtkOutlineFilter()
outline.SetInputData(image)
ren = vtkRenderer()
for f in (tube, outline):
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(f.GetOutputPort())
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("IntegrationTime")
    mapper.SetScalarRange(-2, 2)
    actor = vtkActor()
    actor.SetMapper(mapper)
    ren.AddActor(actor)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(400, 300)
win.AddRenderer(ren)
ren.ResetCamera()
ren.GetActiveCamera().Elevation(-60)
ren.ResetCameraClippingRange()
win.Render()
