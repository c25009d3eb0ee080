"""VTK's window without a display, if available, and its contents as out.png."""
import vtk


def window(renderer):
    """An off-screen window of 400 x 400 pixels."""
    # Debian's VTK has none and uses the display.
    out = getattr(vtk, "vtkEGLRenderWindow", vtk.vtkRenderWindow)()
    out.SetOffScreenRendering(1)
    out.SetSize(400, 400)
    out.AddRenderer(renderer)
    return out


def show(renderer, samples=0, frames=1):
    """Draws the contents of `renderer`, seen from the side."""
    renderer.SetBackground(0.1, 0.1, 0.2)
    out = window(renderer)
    out.SetMultiSamples(samples)
    renderer.ResetCamera()
    renderer.GetActiveCamera().Azimuth(30)
    for _ in range(frames):
        out.Render()
    picture = vtk.vtkWindowToImageFilter()
    picture.SetInput(out)
    picture.ReadFrontBufferOff()
    picture.ShouldRerenderOff()
    writer = vtk.vtkPNGWriter()
    writer.SetInputConnection(picture.GetOutputPort())
    writer.SetFileName("out.png")
    writer.Write()
