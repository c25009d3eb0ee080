"""Two spheres in VTK's window without a display, which uses EGL."""
import vtk
from egl_window import show


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
show(renderer)
