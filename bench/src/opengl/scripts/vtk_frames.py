"""Frames of a VTK program in Python, one for each line that comes. Arguments: the file, pixels a
side, and for a view of its own `camera=` with position, focal point, up and angle."""
import itertools, sys
import vtk

file, size = sys.argv[1], int(sys.argv[2])
words = [word.removeprefix("camera=").split(",") for word in sys.argv[3:]]
view = [float(number) for numbers in words for number in numbers]
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
if view:
    camera.SetPosition(view[0:3])
    camera.SetFocalPoint(view[3:6])
    camera.SetViewUp(view[6:9])
    camera.SetViewAngle(view[9])
    renderer.ResetCameraClippingRange()
else:
    camera.Azimuth(30)
    camera.Elevation(20)
    renderer.ResetCamera()
# A view of its own is kept, to and fro; without one, the camera goes around the data.
turns = itertools.cycle([1, -1]) if view else itertools.repeat(5)
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
    camera.Azimuth(next(turns))
    renderer.ResetCameraClippingRange()
    window.Render()
    # Wait until the image is finished, as programs that save images do.
    window.WaitForCompletion()
    print("frame", flush=True)
