# Blocks with colours, opacity and visibility of their own; one coloured by point data.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet
from vtkmodules.vtkFiltersCore import vtkElevationFilter
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingOpenGL2 import vtkCompositePolyDataMapper2

blocks = vtkMultiBlockDataSet()
inner = vtkMultiBlockDataSet()
for i in range(5):
    sphere = vtkSphereSource()
    sphere.SetCenter(1.1 * i, 0.2 * (i % 2), 0)
    sphere.SetThetaResolution(20)
    sphere.SetPhiResolution(14)
    elevation = vtkElevationFilter()
    elevation.SetInputConnection(sphere.GetOutputPort())
    elevation.SetLowPoint(0, -0.5, 0)
    elevation.SetHighPoint(0, 0.5, 0)
    elevation.Update()
    (blocks if i < 3 else inner).SetBlock(i if i < 3 else i - 3, elevation.GetPolyDataOutput())
blocks.SetBlock(3, inner)
mapper = vtkCompositePolyDataMapper2()
mapper.SetInputDataObject(blocks)
attributes = vtkCompositeDataDisplayAttributes()
attributes.SetBlockColor(blocks.GetBlock(1), (1.0, 0.2, 0.1))
attributes.SetBlockVisibility(blocks.GetBlock(2), False)
attributes.SetBlockColor(inner, (0.2, 0.9, 0.3))
mapper.SetCompositeDataDisplayAttributes(attributes)
actor = vtkActor()
actor.SetMapper(mapper)
ren = vtkRenderer()
ren.AddActor(actor)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(420, 200)
win.AddRenderer(ren)
ren.ResetCamera()
win.Render()
