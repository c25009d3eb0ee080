"""Frames of a VTK program in Python, one for each line that comes."""
import sys
import vtk

file, size = sys.argv[1], int(sys.argv[2])
reader = vtk.vtkXMLPolyDataReader()
reader.SetFileName(file)
mapper = vtk.vtkPolyDataMapper()
mapper.SetInputConnection(reader.GetOutputPort())
mapper.ScalarVisibilityOff()
actor = vtk.vtkActor()
actor.SetMapper(mapper)
actor.GetProperty().SetColor(0.9, 0.6, 0.2)
actor.GetProperty().SetSpecular(0.4)
actor.GetProperty().SetSpecularPower(30)
renderer = vtk.vtkRenderer()
renderer.AddActor(actor)
window = vtk.vtkRenderWindow()
window.SetSize(size, size)
window.SetMultiSamples(0)
window.AddRenderer(renderer)
window.Render()
camera = renderer.GetActiveCamera()
camera.Azimuth(30)
camera.Elevation(20)
renderer.ResetCamera()
window.Render()
print("ready", flush=True)
while line := sys.stdin.readline():
    if line.startswith("save "):
        # Write the contents of the window as raw RGB.
        picture = vtk.vtkWindowToImageFilter()
        picture.SetInput(window)
        picture.ReadFrontBufferOff()
        picture.ShouldRerenderOff()
        writer = vtk.vtkPNMWriter()
        writer.SetFileName(line[5:].rstrip("\n"))
        writer.SetInputConnection(picture.GetOutputPort())
        writer.Write()
        print("saved", flush=True)
        continue
    camera.Azimuth(5)
    window.Render()
    # Wait until the image is finished, as programs that save images do.
    window.WaitForCompletion()
    print("frame", flush=True)
