# Volumes with other blend modes: the largest, smallest, mean and added scalar, and isosurfaces.
# Also opacity by gradient.
import vtk

from capture import actor, look, save, window

wavelet = vtk.vtkRTAnalyticSource()
wavelet.SetWholeExtent(-10, 10, -10, 10, -10, 10)
# Smooth data: VTK's gradient uses differences over a distance one twentieth larger than the point
# spacing.
wavelet.SetXFreq(5)
wavelet.SetYFreq(4)
wavelet.SetZFreq(3)
colors = vtk.vtkColorTransferFunction()
colors.AddRGBPoint(60, 0.1, 0.2, 0.9)
colors.AddRGBPoint(160, 0.9, 0.9, 0.7)
colors.AddRGBPoint(260, 0.9, 0.1, 0.1)
opacity = vtk.vtkPiecewiseFunction()
opacity.AddPoint(100, 0.1)
opacity.AddPoint(270, 0.8)
prop = vtk.vtkVolumeProperty()
prop.SetColor(colors)
prop.SetScalarOpacity(opacity)
prop.SetScalarOpacityUnitDistance(12)
prop.SetInterpolationTypeToLinear()
mapper = vtk.vtkGPUVolumeRayCastMapper()
mapper.SetInputConnection(wavelet.GetOutputPort())
mapper.SetAutoAdjustSampleDistances(0)
mapper.SetSampleDistance(0.05)
mapper.UseJitteringOff()
volume = vtk.vtkVolume()
volume.SetMapper(mapper)
volume.SetProperty(prop)
ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.2)
ren.AddVolume(volume)
win = window(200, 200, ren)
look(ren, (20, -60, 30)).Zoom(1.3)


def picture(name):
    ren.ResetCameraClippingRange()
    win.Render()
    save(win, name, props=ren.GetNumberOfPropsRendered())


mapper.SetBlendModeToMaximumIntensity()
picture("maximum")
mapper.SetBlendModeToMinimumIntensity()
picture("minimum")
mapper.SetBlendModeToAverageIntensity()
picture("average")
mapper.SetBlendModeToAdditive()
picture("additive")
mapper.SetBlendModeToIsoSurface()
for i, value in enumerate((120, 180, 240)):
    prop.GetIsoSurfaceValues().SetValue(i, value)
picture("isosurfaces")
prop.ShadeOn()
prop.SetAmbient(0.2)
prop.SetDiffuse(0.8)
picture("isosurfaces_shaded")
prop.ShadeOff()

# A surface inside ends the rays; one next to the volume shows that the image has the right depth.
ball = vtk.vtkSphereSource()
ball.SetRadius(5)
ball.SetCenter(6, -6, 2)
ball.SetThetaResolution(40)
ball.SetPhiResolution(40)
ren.AddActor(actor(ball, (0.9, 0.9, 0.3)))
mapper.SetBlendModeToMaximumIntensity()
picture("maximum_and_surface")
ren.RemoveActor(ren.GetActors().GetLastActor())

mapper.SetBlendModeToComposite()
prop.SetScalarOpacityUnitDistance(3)
gradient = vtk.vtkPiecewiseFunction()
gradient.AddPoint(0, 0)
gradient.AddPoint(25, 1)
prop.SetGradientOpacity(gradient)
picture("gradient_opacity")
prop.ShadeOn()
picture("gradient_opacity_shaded")
