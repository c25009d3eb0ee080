"""Like `capture.py`, for ParaView's views."""
from capture import save as save_window
from paraview.simple import CreateRenderView, Render


def view(size):
    """A view without antialiasing and without the axes in its corner."""
    made = CreateRenderView()
    made.ViewSize = size
    # Edges are compared pixel by pixel; `vtk/antialiased.py` compares images that are smoothed.
    made.UseFXAA = 0
    made.OrientationAxesVisibility = 0
    # Disable reduced images during interaction.
    made.StillRenderImageReductionFactor = 1
    return made


def save(shown, name, **facts):
    """Renders and saves."""
    Render(shown)
    save_window(shown.GetRenderWindow(), name, **facts)


def facts_of_selection(source):
    """The selection of a source: sorted ids, a list for each node."""
    selection = source.GetSelectionInput(source.Port)
    if selection is None:
        return None
    return [sorted(node.IDs[1::2]) for node in selection.GetProperty("Input")]
