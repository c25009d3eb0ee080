# Two translucent surfaces that intersect, and an opaque one inside, with VTK's dual depth peeling.
import sys
import vtk

wavelet = vtk.vtkRTAnalyticSource()
wavelet.SetWholeExtent(-15, 15, -15, 15, -15, 15)
contour = vtk.vtkContourFilter()
contour.SetInputConnection(wavelet.GetOutputPort())
contour.SetValue(0, 150.0)
contour.ComputeScalarsOff()
renderer = vtk.vtkRenderer()


def show(source, color, opacity, edges=False):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    p = actor.GetProperty()
    p.SetColor(*color)
    p.SetSpecular(0.4)
    p.SetSpecularPower(30)
    p.SetOpacity(opacity)
    if edges:
        p.SetRepresentationToWireframe()
    renderer.AddActor(actor)


def sphere(radius, *center):
    s = vtk.vtkSphereSource()
    s.SetRadius(radius)
    s.SetCenter(*center)
    s.SetThetaResolution(40)
    s.SetPhiResolution(40)
    return s


show(contour, (0.9, 0.6, 0.2), 0.4)
show(sphere(8, 0, 0, 12), (0.2, 0.5, 0.9), 0.5)
show(sphere(6, 4, 2, 0), (0.3, 0.9, 0.3), 1.0)
if "lines" in sys.argv:
    show(sphere(12, -4, 2, 0), (0.9, 0.9, 0.9), 0.3, edges=True)
renderer.SetBackground(0.1, 0.1, 0.2)
renderer.SetUseDepthPeeling(1)
renderer.SetMaximumNumberOfPeels(100)
renderer.SetOcclusionRatio(0.0)
window = vtk.vtkRenderWindow()
window.SetAlphaBitPlanes(1)
window.SetSize(768, 768)
window.SetMultiSamples(0)
window.AddRenderer(renderer)
window.Render()
renderer.GetActiveCamera().Azimuth(30)
renderer.GetActiveCamera().Elevation(20)
renderer.ResetCamera()
window.Render()
grab = vtk.vtkWindowToImageFilter()
grab.SetInput(window)
grab.ReadFrontBufferOff()
writer = vtk.vtkPNGWriter()
writer.SetFileName("out.png")
writer.SetInputConnection(grab.GetOutputPort())
writer.Write()
