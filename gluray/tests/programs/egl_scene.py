"""Two spheres by VTK's window without a display, which uses EGL."""
import vtk


def actor(source, x):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    out = vtk.vtkActor()
    out.SetMapper(mapper)
    out.SetPosition(x, 0.2 * x, 0)
    return out


sphere = vtk.vtkSphereSource(theta_resolution=48, phi_resolution=48)
heights = vtk.vtkElevationFilter(low_point=(0, 0, -0.5), high_point=(0, 0, 0.5))
heights.SetInputConnection(sphere.GetOutputPort())
renderer = vtk.vtkRenderer()
plain = actor(sphere, 0)
plain.property.color = (0.9, 0.4, 0.2)
renderer.AddActor(plain)
renderer.AddActor(actor(heights, 0.8))
renderer.SetBackground(0.1, 0.1, 0.2)
window = vtk.vtkEGLRenderWindow()
window.SetOffScreenRendering(1)
window.SetMultiSamples(0)
window.SetSize(400, 400)
window.AddRenderer(renderer)
renderer.ResetCamera()
renderer.GetActiveCamera().Azimuth(30)
window.Render()
picture = vtk.vtkWindowToImageFilter()
picture.SetInput(window)
picture.ReadFrontBufferOff()
writer = vtk.vtkPNGWriter()
writer.SetInputConnection(picture.GetOutputPort())
writer.SetFileName("out.png")
writer.Write()
