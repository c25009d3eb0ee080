# A ray cast volume around and behind a contour.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
import vtkmodules.vtkRenderingVolumeOpenGL2
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkFiltersCore import vtkContourFilter
from vtkmodules.vtkImagingCore import vtkImageShiftScale, vtkRTAnalyticSource
from vtkmodules.vtkRenderingVolume import vtkGPUVolumeRayCastMapper

source = vtkRTAnalyticSource()
source.SetWholeExtent(-12, 12, -12, 12, -12, 12)
contour = vtkContourFilter()
contour.SetInputConnection(source.GetOutputPort())
contour.SetValue(0, 210)
mapper = vtkPolyDataMapper()
mapper.SetInputConnection(contour.GetOutputPort())
mapper.ScalarVisibilityOff()
actor = vtkActor()
actor.SetMapper(mapper)
actor.GetProperty().SetColor(0.9, 0.8, 0.3)
colors = vtkColorTransferFunction()
colors.AddRGBPoint(60, 0, 0, 1)
colors.AddRGBPoint(250, 1, 0, 0)
opacity = vtkPiecewiseFunction()
opacity.AddPoint(100, 0.0)
opacity.AddPoint(200, 0.08)
cast = vtkGPUVolumeRayCastMapper()
cast.SetInputConnection(source.GetOutputPort())
cast.SetAutoAdjustSampleDistances(0)
cast.SetSampleDistance(0.5)
volume = vtkVolume()
volume.SetMapper(cast)
volume.GetProperty().SetColor(colors)
volume.GetProperty().SetScalarOpacity(opacity)
volume.GetProperty().SetInterpolationTypeToLinear()
ren = vtkRenderer()
ren.AddActor(actor)
ren.AddVolume(volume)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(300, 260)
win.AddRenderer(ren)
ren.GetActiveCamera().SetPosition(20, -50, 30)
ren.GetActiveCamera().SetViewUp(0, 0, 1)
ren.ResetCamera()
win.Render()
