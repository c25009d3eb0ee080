"""Props to surfaces: which are traced, and why OpenGL draws the others."""
import ctypes as C

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPartitionedDataSet, vtkPartitionedDataSetCollection, vtkPolyData
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
from vtkmodules.vtkRenderingCore import vtkActor, vtkVolume

from . import arrays, volumes
from . import library as rtv

ACTORS = {"vtkActor", "vtkOpenGLActor", "vtkLODActor", "vtkQuadricLODActor"}
MAPPERS = {"vtkPolyDataMapper", "vtkOpenGLPolyDataMapper", "vtkCompositePolyDataMapper", "vtkDataSetMapper"}
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
    out.edge_color[:] = p.GetEdgeColor()
    # OpenGL's are never thinner than this.
    out.edge_width = max(1.1, p.GetLineWidth()) if p.GetEdgeVisibility() and p.GetRepresentation() == SURFACE else 0.0
    out.cull_front, out.cull_back = bool(p.GetFrontfaceCulling()), bool(p.GetBackfaceCulling())
    return out


def matrix_of(prop):
    m = prop.GetMatrix()
    return np.array([[m.GetElement(i, j) for j in range(4)] for i in range(4)])


class Extractor:
    """Keeps the filters that turn grids into surfaces."""

    def __init__(self):
        self._filters = {}

    def add(self, bridge, prop, name, renderer):
        """Gives a prop to the bridge, or raises `Untraceable`. Returns whether anything of it is traced."""
        if isinstance(prop, vtkVolume):
            reason = volumes.add(bridge, prop, renderer, name)
            if reason:
                bridge.warn(f"{name}: {reason}; OpenGL draws it")
                raise Untraceable(reason)
            return True
        if not isinstance(prop, vtkActor) or prop.GetMapper() is None:
            raise Untraceable("OpenGL draws props of this class")
        radii = bridge.option("RTV_POINT_RADIUS"), bridge.option("RTV_LINE_RADIUS")
        mapper = prop.GetMapper()
        self._check(prop, mapper, *radii)
        if not mapper.GetStatic() and mapper.GetNumberOfInputConnections(0) > 0:
            mapper.Update()
        data = mapper.GetInputDataObject(0, 0) if mapper.GetNumberOfInputConnections(0) > 0 else None
        if data is None:
            raise Untraceable("no data")
        if data.IsA("vtkDataSet") and not isinstance(data, vtkPolyData):
            kept = self._filters.setdefault(mapper, vtkDataSetSurfaceFilter())
            kept.SetInputData(data)
            kept.Update()
            data = kept.GetOutput()
        attributes = mapper.GetCompositeDataDisplayAttributes() if hasattr(mapper, "GetCompositeDataDisplayAttributes") else None
        blocks = list(_leaves(data, attributes, dict(opacity=prop.GetProperty().GetOpacity(), color=None, visible=True), ""))
        for block, _, _ in blocks:
            _check_cells(block, prop.GetProperty().GetRepresentation(), *radii)
        return any([_surface(bridge, prop, mapper, *b, name, *radii) for b in blocks])

    @staticmethod
    def _check(actor, mapper, point_radius, line_radius):
        p = actor.GetProperty()
        # Subclasses in Python have their own names; what counts is VTK's class below them.
        if not ACTORS & {c.__name__ for c in type(actor).__mro__[:3]}:
            raise Untraceable("OpenGL draws props of this class")
        if p.GetRepresentation() == WIREFRAME and line_radius <= 0:
            raise Untraceable("wireframe (set RTV_LINE_RADIUS to trace edges as tubes)")
        if p.GetRepresentation() == POINTS and point_radius <= 0:
            raise Untraceable("points (set RTV_POINT_RADIUS to trace them as spheres)")
        if p.GetRepresentation() == SURFACE and p.GetEdgeVisibility():
            if p.GetRenderLinesAsTubes() or getattr(p, "GetEdgeOpacity", lambda: 1.0)() < 1.0 or getattr(p, "GetUseLineWidthForEdgeThickness", lambda: True)() is False:
                raise Untraceable("edges as tubes, translucent edges or edges of a width of their own")
            if actor.HasTranslucentPolygonalGeometry() or (mapper.GetClippingPlanes() and mapper.GetClippingPlanes().GetNumberOfItems()):
                raise Untraceable("edges on a translucent or clipped surface")
        if p.GetRepresentation() == SURFACE and p.GetVertexVisibility():
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
            if mapper.GetScalarVisibility() and mapper.GetInput() is not None and mapper.MapScalars(1.0) is not None:
                raise Untraceable("it has a texture and colours")
        if not MAPPERS & {c.__name__ for c in type(mapper).__mro__[:2]}:
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


def _surface(bridge, actor, mapper, data, state, block, name, point_radius, line_radius):
    representation = actor.GetProperty().GetRepresentation()
    cells = data.GetNumberOfCells()
    if data.GetNumberOfPoints() == 0 or (cells == 0 and representation != POINTS):
        return False
    keep = []
    s = rtv.Surface()
    s.name = (f"{name}, block {block}" if block else name).encode()
    s.property = _property(actor.GetProperty())
    s.property.opacity = state["opacity"]
    if state["color"]:
        s.property.ambient_color[:] = s.property.diffuse_color[:] = state["color"]
    matrix = matrix_of(actor)
    s.world_from_data[:] = matrix.ravel().tolist()
    s.point_radius, s.line_radius, s.edges_only = point_radius, line_radius, representation == WIREFRAME
    arrays.add_shape(s, data, representation == POINTS, keep)
    planes = mapper.GetClippingPlanes()
    if planes and planes.GetNumberOfItems():
        # A plane with normal n through o keeps n (M x - o) >= 0.
        world = [[*p.GetNormal(), -np.dot(p.GetNormal(), p.GetOrigin())] for p in (planes.GetItem(i) for i in range(planes.GetNumberOfItems()))]
        local = np.ascontiguousarray(np.array(world) @ matrix)
        keep.append(local)
        s.clip_planes = rtv.Array.of(local)
        s.shape_key = arrays.key_of(s.shape_key, *local.ravel().tolist())
    if not state["color"]:
        arrays.add_colors(bridge, s, mapper, data, keep)
    if actor.GetTexture() is not None:
        arrays.add_texture(s, actor.GetTexture(), keep)
    return bridge.surface(C.byref(s)) > 0
