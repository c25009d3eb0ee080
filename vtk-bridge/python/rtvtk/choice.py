"""What the choice between rays and OpenGL is made from."""
import ctypes as C

from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkActor2D, vtkGlyph3DMapper

from . import library as rtv
from . import volumes
from .view import view_of

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "SWR")


class Choice:
    """Asks the library who draws a frame. The scene is looked at only when the library asks for it."""

    def __init__(self, bridge):
        self._bridge = bridge
        self._software = None

    def opengl_draws(self, renderer, size):
        facts = rtv.SceneFacts(pixels=size[0] * size[1], props=renderer.GetViewProps().GetNumberOfItems(), shadows=bool(renderer.GetUseShadows()))
        facts.interactive = renderer.GetRenderWindow().GetDesiredUpdateRate() > 1.0
        answer = self._bridge.choose(C.byref(facts))
        if answer == rtv.CHOICE_ASK_AGAIN:
            self._look(renderer, size, facts)
            answer = self._bridge.choose(C.byref(facts))
        return answer == rtv.CHOICE_OPENGL

    def _look(self, renderer, size, facts):
        if self._software is None:
            capabilities = renderer.GetRenderWindow().ReportCapabilities()
            self._software = any(name in capabilities for name in _SOFTWARE)
        facts.known, facts.software, facts.python = 1, self._software, 1
        props = renderer.GetViewProps()
        for i in range(props.GetNumberOfItems()):
            prop = props.GetItemAsObject(i)
            if not prop.GetVisibility():
                continue
            if isinstance(prop, vtkActor):
                facts.triangles += _triangles(prop.GetMapper())
                facts.translucent += bool(prop.HasTranslucentPolygonalGeometry())
                facts.edges += bool(prop.GetProperty().GetEdgeVisibility())
                facts.others += not _is_surface(prop)
            elif prop.IsA("vtkVolume"):
                facts.volumes += 1
                volumes.choose(self._bridge, prop, renderer, view_of(renderer, *size))
            elif not isinstance(prop, vtkActor2D):
                facts.others += 1


def _triangles(mapper):
    """Triangles that a mapper draws, as of its last update; an estimate for data other than polygons."""
    connected = mapper is not None and mapper.GetNumberOfInputConnections(0) > 0
    data = mapper.GetInputDataObject(0, 0) if connected else None
    if data is None:
        return 0
    if isinstance(mapper, vtkGlyph3DMapper):
        source = mapper.GetSource(0)
        return data.GetNumberOfElements(0) * (_of_polygons(source) if source is not None else 0)
    if isinstance(data, vtkPolyData):
        return _of_polygons(data)
    cells = data.GetNumberOfElements(1)
    # Of a block of n cells, about 6 n^(2/3) faces are outside.
    return int(12 * cells ** (2 / 3)) if data.IsA("vtkDataSet") else cells


def _of_polygons(data):
    return sum(max(0, cells.GetNumberOfConnectivityIds() - 2 * cells.GetNumberOfCells()) for cells in (data.GetPolys(), data.GetStrips()))


def _is_surface(actor):
    """Whether an actor shows polygons and nothing else."""
    mapper = actor.GetMapper()
    if _triangles(mapper) == 0 or actor.GetProperty().GetRepresentation() != rtv.SURFACE:
        return False
    data = mapper.GetInputDataObject(0, 0)
    return not isinstance(data, vtkPolyData) or data.GetNumberOfVerts() == data.GetNumberOfLines() == 0
