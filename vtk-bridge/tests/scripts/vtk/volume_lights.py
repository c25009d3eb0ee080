# A shaded volume under lights other than VTK's default: coloured, several, a kit, none.
import vtk

from capture import look, save, window

wavelet = vtk.vtkRTAnalyticSource()
wavelet.SetWholeExtent(-10, 10, -10, 10, -10, 10)
wavelet.SetXFreq(5)
wavelet.SetYFreq(4)
wavelet.SetZFreq(3)
colors = vtk.vtkColorTransferFunction()
colors.AddRGBPoint(60, 0.3, 0.5, 0.9)
colors.AddRGBPoint(160, 0.9, 0.9, 0.7)
colors.AddRGBPoint(260, 0.9, 0.5, 0.4)
opacity = vtk.vtkPiecewiseFunction()
opacity.AddPoint(120, 0)
opacity.AddPoint(260, 0.4)
prop = vtk.vtkVolumeProperty()
prop.SetColor(colors)
prop.SetScalarOpacity(opacity)
prop.SetInterpolationTypeToLinear()
prop.ShadeOn()
prop.SetAmbient(0.3)
prop.SetDiffuse(0.7)
prop.SetSpecular(0)
volume = vtk.vtkVolume()


def new_mapper():
    # A mapper for each image: OpenGL keeps the shader that a mapper compiled for the lights of its
    # first image.
    mapper = vtk.vtkGPUVolumeRayCastMapper()
    mapper.SetInputConnection(wavelet.GetOutputPort())
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(0.1)
    mapper.UseJitteringOff()
    volume.SetMapper(mapper)


new_mapper()
volume.SetProperty(prop)
volume.SetScale(1.5)
ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.2)
ren.AddVolume(volume)
win = window(200, 200, ren)
look(ren, (20, -60, 30)).Zoom(1.3)


def light(color, position, kind="SetLightTypeToSceneLight"):
    made = vtk.vtkLight()
    made.SetColor(color)
    made.SetPosition(position)
    made.SetFocalPoint(0, 0, 0)
    getattr(made, kind)()
    ren.AddLight(made)
    return made


def picture(name):
    new_mapper()
    ren.ResetCameraClippingRange()
    win.Render()
    save(win, name, props=ren.GetNumberOfPropsRendered())


only = light((1, 0.8, 0.6), (0, 0, 1), "SetLightTypeToHeadlight")
picture("colored_headlight")
only.SetIntensity(0.8)
picture("weak_headlight")
light((0.2, 0.3, 0.9), (10, -5, 3))
light((0.1, 0.6, 0.1), (-3, -4, 9))
picture("three")
ren.RemoveAllLights()
light((1, 1, 1), (-4, -9, 5))
picture("one_beside")
ren.RemoveAllLights()
kit = vtk.vtkLightKit()
kit.AddLightsToRenderer(ren)
picture("kit")
# Rotating the volume rotates its gradients.
volume.RotateX(40)
picture("kit_turned")
# The same scene twice: with the volume rotated, or with the camera and the light rotated the other
# way.
ren.RemoveAllLights()
beside = light((1, 1, 1), (-4, -9, 5))
picture("turned")
volume.RotateX(-40)
back = vtk.vtkTransform()
back.RotateX(-40)
beside.SetPosition(back.TransformPoint(beside.GetPosition()))
camera = ren.GetActiveCamera()
camera.SetPosition(back.TransformPoint(camera.GetPosition()))
camera.SetFocalPoint(back.TransformPoint(camera.GetFocalPoint()))
camera.SetViewUp(back.TransformVector(camera.GetViewUp()))
picture("camera_turned")
# Parallel projections: OpenGL's light at the viewer shines from the camera's position then, too.
ren.RemoveAllLights()
camera.ParallelProjectionOn()
camera.SetParallelScale(18)
picture("parallel")
prop.SetSpecular(0.4)
prop.SetSpecularPower(12)
picture("parallel_highlight")
