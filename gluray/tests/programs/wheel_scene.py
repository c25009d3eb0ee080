"""Surfaces as PyVista and today's VTK draw them: without normals, with colour maps that are applied after interpolation, under a headlight."""
import vtk

renderer = vtk.vtkRenderer()
for i in range(4):
    sphere = vtk.vtkSphereSource(theta_resolution=32, phi_resolution=32, center=(1.1 * (i % 2), 1.1 * (i // 2), 0))
    heights = vtk.vtkElevationFilter(low_point=(0, 0, -0.5), high_point=(0, 0, 0.5))
    heights.SetInputConnection(sphere.GetOutputPort())
    heights.Update()
    data = vtk.vtkPolyData()
    data.ShallowCopy(heights.GetOutput())
    if i % 2:
        data.GetPointData().SetNormals(None)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    if i < 2:
        mapper.ScalarVisibilityOff()
    else:
        mapper.InterpolateScalarsBeforeMappingOn()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.property.color = (0.9, 0.4, 0.2)
    actor.property.specular = 0.3
    renderer.AddActor(actor)
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
