# What the scripts of volumes have in common: a volume, and data for it.
import vtk


def volume(source, distance=0.1, unit=1.0, kind=vtk.vtkGPUVolumeRayCastMapper):
    colors = vtk.vtkColorTransferFunction()
    colors.AddRGBPoint(60, 0.1, 0.2, 0.9)
    colors.AddRGBPoint(160, 0.9, 0.9, 0.7)
    colors.AddRGBPoint(260, 0.9, 0.1, 0.1)
    opacity = vtk.vtkPiecewiseFunction()
    opacity.AddPoint(120, 0)
    opacity.AddPoint(260, 0.25)
    prop = vtk.vtkVolumeProperty()
    prop.SetColor(colors)
    prop.SetScalarOpacity(opacity)
    prop.SetScalarOpacityUnitDistance(unit)
    prop.SetInterpolationTypeToLinear()
    mapper = kind()
    if isinstance(source, vtk.vtkImageData):
        mapper.SetInputData(source)
    else:
        mapper.SetInputConnection(source.GetOutputPort())
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(distance)
    if kind is vtk.vtkGPUVolumeRayCastMapper:
        mapper.UseJitteringOff()
    made = vtk.vtkVolume()
    made.SetMapper(mapper)
    made.SetProperty(prop)
    return made


def wavelet(n=10):
    made = vtk.vtkRTAnalyticSource()
    made.SetWholeExtent(-n, n, -n, n, -n, n)
    made.Update()
    return made


def image_of_cells(n):
    """The wavelet's values at the centres of cells, without values at points."""
    averages = vtk.vtkPointDataToCellData()
    averages.SetInputData(wavelet(n).GetOutput())
    averages.Update()
    made = vtk.vtkImageData()
    made.DeepCopy(averages.GetOutput())
    made.GetPointData().Initialize()
    made.GetCellData().SetActiveScalars("RTData")
    return made
