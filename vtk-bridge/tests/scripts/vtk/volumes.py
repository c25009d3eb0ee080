# Volumes: spacing, directions, a rotated prop, nearest-neighbour interpolation, shading, a
# logarithmic table, other scalar types, and two that overlap.
import vtk

from capture import actor, look, save, window
from volume_scenes import volume, wavelet

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.2)
win = window(200, 200, ren)
rough = wavelet()
shown = volume(rough)
ren.AddVolume(shown)


def picture(name):
    ren.ResetCameraClippingRange()
    win.Render()
    save(win, name, props=ren.GetNumberOfPropsRendered())


look(ren, (20, -60, 30)).Zoom(1.3)
picture("linear")
shown.GetProperty().SetInterpolationTypeToNearest()
picture("nearest")
shown.GetProperty().SetInterpolationTypeToLinear()
# Smooth data: VTK's gradient uses differences over a distance one twentieth larger than the point
# spacing.
smooth = vtk.vtkRTAnalyticSource()
smooth.SetWholeExtent(-10, 10, -10, 10, -10, 10)
smooth.SetXFreq(5)
smooth.SetYFreq(4)
smooth.SetZFreq(3)
shown.GetMapper().SetInputConnection(smooth.GetOutputPort())
shown.GetProperty().ShadeOn()
shown.GetProperty().SetAmbient(0.2)
shown.GetProperty().SetDiffuse(0.7)
shown.GetProperty().SetSpecular(0.3)
shown.GetProperty().SetSpecularPower(12)
picture("shaded")
shown.GetProperty().ShadeOff()
shown.GetMapper().SetInputConnection(rough.GetOutputPort())
shown.GetProperty().SetScalarOpacityUnitDistance(0.3)
shown.RotateX(30)
shown.SetScale(1, 1.5, 0.7)
picture("turned")

# An image with its own coordinate frame and integer scalars, whose extent does not begin at zero.
image = vtk.vtkImageData()
image.ShallowCopy(wavelet().GetOutput())
image.SetSpacing(0.5, 1.0, 2.0)
image.SetOrigin(3, -2, 1)
image.SetDirectionMatrix(0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1)
cast = vtk.vtkImageCast()
cast.SetInputData(image)
cast.SetOutputScalarTypeToShort()
cast.Update()
whole = vtk.vtkImageData()
whole.ShallowCopy(cast.GetOutput())
whole.SetDirectionMatrix(image.GetDirectionMatrix())
ren.RemoveVolume(shown)
shown = volume(whole)
ren.AddVolume(shown)
ren.ResetCamera()
picture("directions")

# A surface inside: the part in front of it dims it, the part behind is hidden. A line that OpenGL
# draws is in front of everything.
ren.RemoveVolume(shown)
shown = volume(rough, kind=vtk.vtkSmartVolumeMapper)
ren.AddVolume(shown)
ball = vtk.vtkSphereSource()
ball.SetRadius(5)
ball.SetThetaResolution(40)
ball.SetPhiResolution(40)
inside = actor(ball, (0.9, 0.9, 0.3))
ren.AddActor(inside)
box = vtk.vtkOutlineSource()
box.SetBounds(-14, 14, -14, 14, -14, 14)
ren.AddActor(actor(box, (1, 1, 1)))
ren.ResetCamera()
picture("surface_inside")
inside.GetProperty().SetOpacity(0.5)
picture("translucent_inside")
inside.GetProperty().SetOpacity(1.0)

# OpenGL draws what rt-core does not support.
shown.GetMapper().CroppingOn()
shown.GetMapper().SetCroppingRegionPlanes(-4, 4, -10, 10, -10, 10)
picture("cropped")
