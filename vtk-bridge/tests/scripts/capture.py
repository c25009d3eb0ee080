"""Saves what a user sees of a window: the image (PNG), the window's depth (npy), and facts such as picks (json).

Used by the scripts in the same folder, which are ordinary VTK and ParaView scripts. If CAPTURE_BESIDE names a file that another part
of the program writes after a frame, that file is moved next to the image.
"""
import json
import os
import shutil
import sys

import vtk


def write_npy(path, array, shape, kind):
    """Writes a VTK array as a .npy file (format version 1) without numpy."""
    head = "{'descr': '%s', 'fortran_order': False, 'shape': %s, }" % (kind, tuple(shape))
    head += " " * (-(len(head) + 11) % 64) + "\n"
    with open(path, "wb") as file:
        file.write(b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode() + bytes(memoryview(array)))


def save(window, name, **facts):
    """Writes NAME.png, NAME.npy and NAME.json into the folder that the first argument names. Does not render."""
    base = os.path.join(sys.argv[1], name)
    width, height = window.GetSize()
    pixels = vtk.vtkUnsignedCharArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
    image = vtk.vtkImageData()
    image.SetDimensions(width, height, 1)
    image.GetPointData().SetScalars(pixels)
    writer = vtk.vtkPNGWriter()
    writer.SetInputData(image)
    writer.SetCompressionLevel(1)
    writer.SetFileName(base + ".png")
    writer.Write()
    depth = vtk.vtkFloatArray()
    window.GetZbufferData(0, 0, width - 1, height - 1, depth)
    write_npy(base + ".npy", depth, (height, width), "<f4")
    with open(base + ".json", "w") as file:
        json.dump(facts, file, indent=1, sort_keys=True)
    beside = os.environ.get("CAPTURE_BESIDE")
    if beside and os.path.exists(beside):
        shutil.move(beside, base + ".report.json")


def window(width=300, height=300, *renderers):
    """An off-screen window without antialiasing, so that images can be compared pixel by pixel."""
    made = vtk.vtkRenderWindow()
    made.SetOffScreenRendering(1)
    made.SetMultiSamples(0)
    made.SetSize(width, height)
    for renderer in renderers:
        made.AddRenderer(renderer)
    return made


def actor(source, color=None, **mapper_settings):
    """An actor for the output of a filter, without scalars when a colour is given."""
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    if color is not None:
        mapper.ScalarVisibilityOff()
        made.GetProperty().SetColor(color)
    return made


def look(renderer, position, focal_point=(0, 0, 0), up=(0, 0, 1)):
    """Sets the camera's position and direction and fits all props into the view."""
    camera = renderer.GetActiveCamera()
    camera.SetPosition(position)
    camera.SetFocalPoint(focal_point)
    camera.SetViewUp(up)
    renderer.ResetCamera()
    return camera
