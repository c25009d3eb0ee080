"""Props to surfaces: which are traced, and why OpenGL draws the others."""
import ctypes as C

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPartitionedDataSet, vtkPartitionedDataSetCollection, vtkPolyData
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper

from . import arrays
from . import library as rtv
from .glyphs import Glyphs, why_not_glyphs
from .shape import Shapes

ACTORS = {"vtkActor", "vtkOpenGLActor", "vtkLODActor", "vtkQuadricLODActor"}
MAPPERS = {"vtkPolyDataMapper", "vtkOpenGLPolyDataMapper", "vtkCompositePolyDataMapper", "vtkDataSetMapper", "vtkGlyph3DMapper",
           "vtkOpenGLGlyph3DMapper"}
POINTS, WIREFRAME, SURFACE = range(3)
FLAT, PBR = 0, 3


class Untraceable(Exception):
    """OpenGL has to draw a prop; the text says why."""


def _property(p):
    out = rtv.Property()
    out.ambient_color[:], out.diffuse_color[:], out.specular_color[:] = p.GetAmbientColor(), p.GetDiffuseColor(), p.GetSpecularColor()
    out.ambient, out.diffuse, out.specular, out.specular_power = p.GetAmbient(), p.GetDiffuse(), p.GetSpecular(), p.GetSpecularPower()
    out.opacity, out.metallic, out.roughness, out.base_ior = p.GetOpacity(), p.GetMetallic(), p.GetRoughness(), p.GetBaseIOR()
    out.flat, out.pbr, out.lighting = p.GetInterpolation() == FLAT, p.GetInterpolation() == PBR, bool(p.GetLighting())
    out.cull_front, out.cull_back = bool(p.GetFrontfaceCulling()), bool(p.GetBackfaceCulling())
    return out


class Extractor:
    """Gives props to the bridge, and keeps what was made for them from frame to frame."""

    def __init__(self, bridge):
        self._bridge = bridge
        # Filters that turn grids into surfaces, by mapper; properties by theirs.
        self._filters, self._properties = {}, {}
        self._shapes, self._textures, self._glyphs = Shapes(), arrays.Textures(), Glyphs()
        self._radii = 0.0, 0.0
        self._used = set()

    def begin_frame(self):
        self._radii = self._bridge.option("RTV_POINT_RADIUS"), self._bridge.option("RTV_LINE_RADIUS")
        self._used = set()

    def end_frame(self, rendered):
        """Forgets what was not used. `rendered`: the bridge was asked for a picture of these props."""
        for kept in (self._filters, self._properties):
            for address in kept.keys() - self._used:
                del kept[address]
        self._textures.end_frame()
        self._glyphs.end_frame()
        if rendered:
            self._shapes.frame_drawn()
        else:
            self._shapes.frame_not_drawn()

    def add(self, prop, name):
        """Gives a prop to the bridge, or raises `Untraceable`."""
        if not isinstance(prop, vtkActor) or prop.GetMapper() is None:
            raise Untraceable("a volume (OpenGL's ray caster sees the depth of what is traced)" if prop.IsA("vtkVolume")
                              else "OpenGL draws props of this class")
        mapper = prop.GetMapper()
        _check(prop, mapper, *self._radii)
        connected = mapper.GetNumberOfInputConnections(0) > 0
        if connected and not mapper.GetStatic():
            mapper.Update()
        data = mapper.GetInputDataObject(0, 0) if connected else None
        if data is None:
            raise Untraceable("no data")
        if isinstance(mapper, vtkGlyph3DMapper):
            return self._add_glyphs(prop, mapper, data, name)
        if data.IsA("vtkDataSet") and not isinstance(data, vtkPolyData):
            data = self._surface_of(mapper, data)
        attributes = mapper.GetCompositeDataDisplayAttributes() if hasattr(mapper, "GetCompositeDataDisplayAttributes") else None
        start = dict(opacity=prop.GetProperty().GetOpacity(), color=None, visible=True)
        representation = prop.GetProperty().GetRepresentation()
        blocks = list(_leaves(data, attributes, start, ""))
        for block, _, _ in blocks:
            _check_cells(block, representation, *self._radii)
        for block, state, block_name in blocks:
            if block.GetNumberOfPoints() > 0 and (block.GetNumberOfCells() > 0 or representation == POINTS):
                self._add_block(prop, mapper, block, state, f"{name}, block {block_name}" if block_name else name)

    def _surface_of(self, mapper, data):
        """The surface of a data set that is not polygons, made with the filter kept for its mapper."""
        self._used.add(mapper.__this__)
        kept = self._filters.setdefault(mapper.__this__, vtkDataSetSurfaceFilter())
        # The input of a pipeline would be updated twice; the data themselves know when they changed.
        kept.SetInputData(data)
        kept.Update()
        return kept.GetOutput()

    def _start(self, actor, name):
        """A surface with everything that its actor says, and its matrix."""
        s = rtv.Surface()
        s.name = name.encode()
        p = actor.GetProperty()
        self._used.add(p.__this__)
        time, found = self._properties.get(p.__this__, (None, None))
        if time != p.GetMTime():
            found = _property(p)
            self._properties[p.__this__] = p.GetMTime(), found
        s.property = found
        matrix = actor.GetMatrix().GetData()
        s.world_from_data[:] = matrix
        return s, matrix

    def _add_glyphs(self, actor, mapper, data, name):
        reason = why_not_glyphs(mapper, data)
        if reason:
            raise Untraceable(reason)
        source = mapper.GetInputDataObject(1, 0)
        s, _ = self._start(actor, name)
        reason = self._glyphs.add(s, mapper, data)
        if reason:
            raise Untraceable(reason)
        keep = []
        self._shapes.add(s, source, False, None, keep)
        self._bridge.surface(C.byref(s))

    def _add_block(self, actor, mapper, data, state, name):
        representation = actor.GetProperty().GetRepresentation()
        keep = []
        s, matrix = self._start(actor, name)
        s.property.opacity = state["opacity"]
        if state["color"]:
            s.property.ambient_color[:] = s.property.diffuse_color[:] = state["color"]
        s.point_radius, s.line_radius = self._radii
        s.edges_only = representation == WIREFRAME
        cell_map = self._shapes.add(s, data, representation == POINTS, _planes(mapper, matrix), keep)
        if not state["color"]:
            arrays.add_colors(self._bridge, s, mapper, data, cell_map, keep)
        if actor.GetTexture() is not None:
            if s.color_source != rtv.COLOR_PROPERTY:
                raise Untraceable("it has a texture and colours")
            self._textures.add(s, actor.GetTexture(), data.GetPointData().GetTCoords())
        self._bridge.surface(C.byref(s))


def _planes(mapper, matrix):
    """Clipping planes in the coordinates of the data, or `None`."""
    planes = mapper.GetClippingPlanes()
    if not planes or not planes.GetNumberOfItems():
        return None
    # A plane with normal n through o keeps n (M x - o) >= 0.
    world = [[*p.GetNormal(), -np.dot(p.GetNormal(), p.GetOrigin())] for p in (planes.GetItem(i) for i in range(planes.GetNumberOfItems()))]
    return np.ascontiguousarray(np.array(world) @ np.array(matrix).reshape(4, 4))


def _check(actor, mapper, point_radius, line_radius):
    p = actor.GetProperty()
    # Classes that Python derives (PyVista's) have the names of VTK's classes below them.
    if actor.GetClassName() not in ACTORS:
        raise Untraceable("OpenGL draws props of this class")
    if p.GetRepresentation() == WIREFRAME and line_radius <= 0:
        raise Untraceable("wireframe (set RTV_LINE_RADIUS to trace edges as tubes)")
    if p.GetRepresentation() == POINTS and point_radius <= 0:
        raise Untraceable("points (set RTV_POINT_RADIUS to trace them as spheres)")
    if p.GetRepresentation() == SURFACE and p.GetEdgeVisibility():
        raise Untraceable("edges on the surface")
    if p.GetVertexVisibility():
        raise Untraceable("vertices on the surface")
    if actor.GetBackfaceProperty() is not None:
        raise Untraceable("backs with a property of their own")
    if p.GetNumberOfTextures() > 0:
        raise Untraceable("textures of the property (albedo, material, normal)")
    shader = actor.GetShaderProperty()
    if shader.HasFragmentShaderCode() or shader.HasVertexShaderCode() or shader.GetNumberOfShaderReplacements() > 0:
        raise Untraceable("shader code of its own")
    if actor.GetTexture() is not None:
        reason = arrays.why_not_texture(actor.GetTexture())
        if reason:
            raise Untraceable(reason)
    if mapper.GetClassName() not in MAPPERS:
        raise Untraceable("OpenGL draws mappers of this class")


def _leaves(data, attributes, state, name):
    """The visible polygon data below `data`, with what their blocks say."""
    if data is None:
        return
    if attributes is not None:
        # What a block says holds for all below it until one says otherwise.
        state = dict(state)
        if attributes.HasBlockVisibility(data):
            state["visible"] = attributes.GetBlockVisibility(data)
        if attributes.HasBlockOpacity(data):
            state["opacity"] = attributes.GetBlockOpacity(data)
        if attributes.HasBlockColor(data):
            color = [0.0, 0.0, 0.0]
            attributes.GetBlockColor(data, color)
            state["color"] = color
    if isinstance(data, vtkPolyData):
        if state["visible"]:
            yield data, state, name
        return
    if isinstance(data, vtkMultiBlockDataSet):
        children = [data.GetBlock(i) for i in range(data.GetNumberOfBlocks())]
    elif isinstance(data, vtkPartitionedDataSet):
        children = [data.GetPartitionAsDataObject(i) for i in range(data.GetNumberOfPartitions())]
    elif isinstance(data, vtkPartitionedDataSetCollection):
        children = [data.GetPartitionedDataSet(i) for i in range(data.GetNumberOfPartitionedDataSets())]
    else:
        raise Untraceable("its data are not polygons")
    for i, child in enumerate(children):
        yield from _leaves(child, attributes, state, f"{name}/{i}" if name else str(i))


def _check_cells(data, representation, point_radius, line_radius):
    if representation != SURFACE:
        return
    if data.GetNumberOfVerts() > 0 and point_radius <= 0:
        raise Untraceable("it has vertices (set RTV_POINT_RADIUS to trace them as spheres)")
    if data.GetNumberOfLines() > 0 and line_radius <= 0:
        raise Untraceable("it has lines (set RTV_LINE_RADIUS to trace them as tubes)")
