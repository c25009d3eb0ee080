"""Frames of ParaView, one for each line that comes; for pvbatch. Arguments: the file, pixels a
side, and for a view of its own `camera=` with position, focal point, up and angle."""
import itertools, os, sys
from paraview.simple import *
from vtkmodules.vtkIOImage import vtkPNMWriter
from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

file, size = sys.argv[1], int(sys.argv[2])
words = [word.removeprefix("camera=").split(",") for word in sys.argv[3:]]
at = [float(number) for numbers in words for number in numbers]
reader = XMLPolyDataReader(FileName=[file])
view = CreateRenderView(ViewSize=[size, size])
shown = Show(reader, view)
# A single colour; `ColorBy(shown, None)` fails in ParaView 5.11 when nothing was coloured before.
shown.ColorArrayName = ["POINTS", ""]
view.ResetCamera()
camera = view.GetActiveCamera()
if at:
    # The first frame of a view sees all of the data, whatever its camera.
    Render(view)
    view.CameraPosition, view.CameraFocalPoint = at[0:3], at[3:6]
    view.CameraViewUp, view.CameraViewAngle = at[6:9], at[9]
else:
    camera.Azimuth(30)
    camera.Elevation(20)
# A view of its own is kept, to and fro; without one, the camera goes around the data.
turns = itertools.cycle([1, -1]) if at else itertools.repeat(5)
Render(view)
# ParaView's own `print` goes through a buffer that `flush` does not empty, unless PYTHONUNBUFFERED
# is set.
os.write(1, b"ready\n")
# ParaView's own `sys.stdin` strips line ends, so an empty line looks like the end of the input.
commands = os.fdopen(os.dup(0))
while command := commands.readline():
    if command.startswith("save "):
        # Write the contents of the window as raw RGB.
        picture = vtkWindowToImageFilter()
        picture.SetInput(view.GetRenderWindow())
        picture.ReadFrontBufferOff()
        picture.ShouldRerenderOff()
        writer = vtkPNMWriter()
        writer.SetFileName(command[5:].rstrip("\n"))
        writer.SetInputConnection(picture.GetOutputPort())
        writer.Write()
        os.write(1, b"saved\n")
        continue
    camera.Azimuth(next(turns))
    Render(view)
    os.write(1, b"frame\n")
