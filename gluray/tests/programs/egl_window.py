"""VTK's window without a display, and what it shows as out.png."""
import vtk


def window(renderer):
    """A window of 400 x 400 pixels, one sample each."""
    out = vtk.vtkEGLRenderWindow()
    out.SetOffScreenRendering(1)
    out.SetMultiSamples(0)
    out.SetSize(400, 400)
    out.AddRenderer(renderer)
    return out


def show(renderer, samples=0):
    """Draws what `renderer` has, seen from the side."""
    renderer.SetBackground(0.1, 0.1, 0.2)
    out = window(renderer)
    out.SetMultiSamples(samples)
    renderer.ResetCamera()
    renderer.GetActiveCamera().Azimuth(30)
    out.Render()
    picture = vtk.vtkWindowToImageFilter()
    picture.SetInput(out)
    picture.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetInputConnection(picture.GetOutputPort())
    writer.SetFileName("out.png")
    writer.Write()
