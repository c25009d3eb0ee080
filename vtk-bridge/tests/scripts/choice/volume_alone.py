# A smooth volume of 257^3 points and nothing else, turned a few times, then shaded; then with an
# outline, which is inside it and drawn by OpenGL; then a small volume.
import vtk

from capture import actor, look, save, window


def smooth(n):
    made = vtk.vtkRTAnalyticSource()
    made.SetWholeExtent(-n, n, -n, n, -n, n)
    made.SetStandardDeviation(0.5)
    made.SetXFreq(5)
    made.SetYFreq(4)
    made.SetZFreq(3)
    made.Update()
    scaled = vtk.vtkImageData()
    scaled.ShallowCopy(made.GetOutput())
    scaled.SetSpacing(*([20 / n] * 3))
    return scaled


colors = vtk.vtkColorTransferFunction()
colors.AddRGBPoint(60, 0.1, 0.2, 0.9)
colors.AddRGBPoint(160, 0.9, 0.9, 0.7)
colors.AddRGBPoint(260, 0.9, 0.1, 0.1)
opacity = vtk.vtkPiecewiseFunction()
opacity.AddPoint(60, 0)
opacity.AddPoint(120, 0.01)
opacity.AddPoint(260, 0.06)
prop = vtk.vtkVolumeProperty()
prop.SetColor(colors)
prop.SetScalarOpacity(opacity)
prop.SetInterpolationTypeToLinear()
mapper = vtk.vtkGPUVolumeRayCastMapper()
mapper.UseJitteringOff()
mapper.SetAutoAdjustSampleDistances(0)
mapper.SetLockSampleDistanceToInputSpacing(0)
volume = vtk.vtkVolume()
volume.SetMapper(mapper)
volume.SetProperty(prop)
ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.2)
ren.AddVolume(volume)
win = window(200, 200, ren)


def pictures(*names, frames=5):
    """The first and the last of some frames."""
    for k in range(frames):
        ren.GetActiveCamera().Azimuth(3)
        ren.ResetCameraClippingRange()
        win.Render()
        if k in (0, frames - 1):
            save(win, names[min(k, len(names) - 1)], props=ren.GetNumberOfPropsRendered())


mapper.SetInputData(smooth(128))
mapper.SetSampleDistance(20 / 128)
look(ren, (30, -80, 40)).Zoom(1.4)
pictures("first", "large")
prop.ShadeOn()
prop.SetAmbient(0.2)
prop.SetDiffuse(0.7)
prop.SetSpecular(0.3)
prop.SetSpecularPower(12)
pictures("shaded_first", "shaded", frames=2)
line = vtk.vtkLineSource()
line.SetPoint1(-15, -15, -15)
line.SetPoint2(15, 15, 15)
inside = actor(line, (1, 1, 1))
ren.AddActor(inside)
pictures("line_first", "line", frames=2)
ren.RemoveActor(inside)
prop.ShadeOff()
mapper.SetInputData(smooth(4))
mapper.SetSampleDistance(20 / 4)
pictures("small_first", "small", frames=20)
