"""Converts props to surfaces. Which of them are traced decides the library from facts about them."""
import ctypes as C

import numpy as np
from vtkmodules.vtkCommonCore import vtkVersion
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPartitionedDataSet, vtkPartitionedDataSetCollection, vtkPolyData
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkVolume

from . import arrays
from . import library as rtv
from .eligibility import Untraceable, actor_facts, prop_facts, require
from .glyphs import GlyphInput, Glyphs
from .shape import Shapes
from .volumes import Volumes

FLAT, PBR = 0, 3
# Colours of points and cells replace those of blocks; before VTK 9.4 it was the reverse.
_SCALARS_OVER_BLOCKS = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) >= (9, 4)


def _property(p):
    out = rtv.Property()
    out.ambient_color[:], out.diffuse_color[:], out.specular_color[:] = p.GetAmbientColor(), p.GetDiffuseColor(), p.GetSpecularColor()
    out.ambient, out.diffuse, out.specular, out.specular_power = p.GetAmbient(), p.GetDiffuse(), p.GetSpecular(), p.GetSpecularPower()
    out.opacity, out.metallic, out.roughness, out.base_ior = p.GetOpacity(), p.GetMetallic(), p.GetRoughness(), p.GetBaseIOR()
    out.flat, out.pbr, out.lighting = p.GetInterpolation() == FLAT, p.GetInterpolation() == PBR, bool(p.GetLighting())
    out.cull_front, out.cull_back = bool(p.GetFrontfaceCulling()), bool(p.GetBackfaceCulling())
    if p.GetEdgeVisibility() and p.GetRepresentation() == rtv.SURFACE:
        by_line = not hasattr(p, "GetUseLineWidthForEdgeThickness") or p.GetUseLineWidthForEdgeThickness()
        out.edge_color[:] = p.GetEdgeColor()
        # OpenGL's lines are never thinner than this.
        out.edge_width = max(1.1, p.GetLineWidth() if by_line else p.GetEdgeWidth())
    return out


class Extractor:
    """Passes props to the bridge and caches their converted data from frame to frame."""

    def __init__(self, bridge):
        self._bridge = bridge
        # Filters that convert grids to surfaces, by mapper; properties by their VTK object.
        self._filters, self._properties = {}, {}
        # Surfaces of plain actors with the modification times of their inputs, by actor.
        self._plain = {}
        self._shapes, self._textures, self._glyphs, self._volumes = Shapes(), arrays.Textures(), Glyphs(), Volumes()
        self._radii, self._image_lighting = (0.0, 0.0), False
        self._used = set()

    def begin_frame(self):
        self._radii = self._bridge.option("RTV_POINT_RADIUS"), self._bridge.option("RTV_LINE_RADIUS")
        self._used = set()

    def end_frame(self, rendered):
        """Drops cache entries that were not used. `rendered`: the bridge was asked for an image of these props."""
        for kept in (self._filters, self._properties, self._plain):
            for address in kept.keys() - self._used:
                del kept[address]
        for kept in (self._textures, self._glyphs, self._volumes):
            kept.end_frame()
        if rendered:
            self._shapes.frame_drawn()
        else:
            self._shapes.frame_not_drawn()

    def add(self, renderer, prop, name):
        """Passes a prop to the bridge, or raises `Untraceable`."""
        if isinstance(prop, vtkVolume):
            try:
                return self._volumes.add(self._bridge, prop, renderer, name)
            except Untraceable as reason:
                self._bridge.warn(f"{name}: {reason}; OpenGL draws it")
                raise
        mapper = prop.GetMapper() if isinstance(prop, vtkActor) else None
        self._image_lighting = renderer.GetUseImageBasedLighting()
        if mapper is not None and self._add_again(prop, mapper, name):
            return
        facts = prop_facts(prop) if mapper is None else actor_facts(renderer, prop, mapper)
        # Refuses everything without a mapper.
        require(self._bridge.check_actor, facts)
        connected = mapper.GetNumberOfInputConnections(0) > 0
        if connected and not mapper.GetStatic():
            mapper.Update()
        data = mapper.GetInputDataObject(0, 0) if connected else None
        if data is None:
            facts.no_data = 1
            require(self._bridge.check_actor, facts)
        if isinstance(mapper, vtkGlyph3DMapper):
            return self._add_glyphs(prop, mapper, data, name)
        if data.IsA("vtkDataSet") and not isinstance(data, vtkPolyData):
            data = self._surface_of(mapper, data)
        attributes = mapper.GetCompositeDataDisplayAttributes() if hasattr(mapper, "GetCompositeDataDisplayAttributes") else None
        start = dict(opacity=prop.GetProperty().GetOpacity(), color=None, visible=True)
        # All blocks are checked before any is passed on: if the library and OpenGL both drew a
        # translucent block, it would be blended twice.
        batch = []
        representation = prop.GetProperty().GetRepresentation()
        blocks = [(self._data_facts(leaf, representation), leaf, *rest) for leaf, *rest in _leaves(data, attributes, start, "")]
        for facts, block, state, block_name in blocks:
            alone = data is block and not attributes
            if block.GetNumberOfPoints() > 0 and (block.GetNumberOfCells() > 0 or representation == rtv.POINTS):
                shown_as = f"{name}, block {block_name}" if block_name else name
                batch.append(self._block(prop, mapper, block, facts, state, shown_as, alone))
        self._commit(batch)
        for s, keep, shown in batch:
            if shown is not None:
                self._used.add(prop.__this__)
                self._plain[prop.__this__] = self._times(prop, mapper, shown), s, keep

    def _data_facts(self, data, representation):
        """Facts about a block, so far as they do not refuse it."""
        facts = rtv.SurfaceFacts(representation=representation, not_polygons=not isinstance(data, vtkPolyData))
        if not facts.not_polygons:
            facts.num_verts, facts.num_lines = data.GetNumberOfVerts(), data.GetNumberOfLines()
        require(self._bridge.check_surface, facts)
        return facts

    def _commit(self, batch):
        """Passes all of a prop's surfaces (the first of each entry) to the library, or none."""
        if not batch:
            return
        surfaces = (rtv.Surface * len(batch))(*(entry[0] for entry in batch))
        if self._bridge.surfaces(surfaces, len(batch)) < 0:
            require(self._bridge.check_surface, rtv.SurfaceFacts(invalid_arrays=1))
        for s, *_ in batch:
            self._shapes.given(s.shape_key)

    def _add_again(self, actor, mapper, name):
        """Passes the surface of the previous frame again if at most the actor's transform changed. Returns False if more changed."""
        kept = self._plain.get(actor.__this__)
        if kept is None:
            return False
        if not mapper.GetStatic():
            mapper.Update()
        seen, s, _ = kept
        known = s.color_key == 0 or self._bridge.has_colors(s.shape_key, s.color_key)
        if seen != self._times(actor, mapper, mapper.GetInputDataObject(0, 0)) or not known or not self._shapes.again(s.shape_key):
            del self._plain[actor.__this__]
            return False
        self._used.update((actor.__this__, actor.GetProperty().__this__))
        s.name = name.encode()
        s.world_from_data[:] = actor.GetMatrix().GetData()
        self._commit([(s,)])
        return True

    def _times(self, actor, mapper, data):
        """A value that changes when any input of a surface changes; `None` for actors whose inputs are not tracked."""
        if data is None or actor.GetTexture() is not None or actor.GetBackfaceProperty() is not None:
            return None
        parts = mapper, data, actor.GetProperty(), actor.GetShaderProperty()
        return self._radii, self._image_lighting, *((part.__this__, part.GetMTime()) for part in parts)

    def _surface_of(self, mapper, data):
        """The surface of a data set that is not polygonal, made with the cached filter of its mapper."""
        self._used.add(mapper.__this__)
        kept = self._filters.setdefault(mapper.__this__, vtkDataSetSurfaceFilter())
        # A pipeline connection would update the input twice; the data object itself knows when it changed.
        kept.SetInputData(data)
        kept.Update()
        return kept.GetOutput()

    def _start(self, actor, name):
        """A surface with all properties of its actor, and the actor's matrix."""
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
        given = GlyphInput(self._bridge, mapper, data)
        sources = given.sources
        copies = [c for leaf in given.leaves for c in self._glyphs.of(mapper, leaf, given)]
        batch = []
        for which, matrices, rgba in copies:
            s, _ = self._start(actor, f"{name}, source {which}" if len(sources) > 1 else name)
            keep = []
            batch.append((s, keep))
            self._shapes.add(s, sources[which], False, None, keep)
            s.glyph_matrices = rtv.Array(matrices.ctypes.data, len(matrices), 16, rtv.F64)
            if rgba is not None:
                s.glyph_colors = rtv.Array.of(rgba)
        self._commit(batch)

    def _block(self, actor, mapper, data, facts, state, name, alone):
        """A block's surface, the arrays that it needs, and its data if the next frame may reuse
        the surface unchanged."""
        representation = actor.GetProperty().GetRepresentation()
        keep = []
        s, matrix = self._start(actor, name)
        s.property.opacity = state["opacity"]
        if state["color"]:
            s.property.ambient_color[:] = s.property.diffuse_color[:] = state["color"]
        back = actor.GetBackfaceProperty()
        if back is not None:
            _add_back(s, _property(back))
            if state["color"]:
                # A block's colour is that of both sides.
                for field in ("ambient_color", "diffuse_color"):
                    getattr(s.back, field)[:] = state["color"]
                s.back.ambient, s.back.diffuse = s.property.ambient, s.property.diffuse
        s.point_radius, s.line_radius = self._radii
        s.edges_only = representation == rtv.WIREFRAME
        planes = _planes(mapper, matrix)
        cell_map = self._shapes.add(s, data, representation == rtv.POINTS, planes, keep)
        if not state["color"] or _SCALARS_OVER_BLOCKS:
            arrays.add_colors(self._bridge, s, mapper, data, cell_map, keep)
        if s.color_source != rtv.COLOR_PROPERTY:
            # Colours of points and cells are visible on both sides.
            s.has_back = 0
        texture, texcoords = actor.GetTexture(), data.GetPointData().GetTCoords()
        if actor.GetProperty().GetTexture("albedoTex") is not None:
            texture = actor.GetProperty().GetTexture("albedoTex")
            # The texture's alpha replaces the opacity.
            s.property.opacity = 1.0
        maps = self._textures.maps_of(actor.GetProperty(), texcoords)
        facts.triangulated, facts.edges = cell_map is not None, s.property.edge_width > 0
        facts.texture, facts.maps = texture is not None, maps is not None
        facts.has_back, facts.color_source = s.has_back, s.color_source
        require(self._bridge.check_surface, facts)
        if texture is not None:
            self._textures.add(s, texture, texcoords)
        if maps is not None:
            s.maps = C.pointer(maps)
        cells_given = any(c.offsets.kind for c in (s.verts, s.lines, s.polys, s.strips))
        plain = all(part is None for part in (planes, texture, maps, back))
        again = alone and plain and not s.colors.kind and not cells_given
        again = again and mapper.GetInputDataObject(0, 0) is data
        return s, keep, data if again else None


def _add_back(surface, own):
    """Adds a back-face property; the back uses the shading model of the front."""
    surface.has_back, surface.back = 1, surface.property
    for name in ("ambient_color", "diffuse_color", "specular_color"):
        getattr(surface.back, name)[:] = getattr(own, name)[:]
    for name in ("ambient", "diffuse", "specular", "specular_power"):
        setattr(surface.back, name, getattr(own, name))
    surface.back.opacity = 1.0


def _planes(mapper, matrix):
    """Clipping planes in the coordinates of the data, or `None`."""
    planes = mapper.GetClippingPlanes()
    if not planes or not planes.GetNumberOfItems():
        return None
    # A plane with normal n through o keeps n (M x - o) >= 0.
    world = [[*p.GetNormal(), -np.dot(p.GetNormal(), p.GetOrigin())] for p in (planes.GetItem(i) for i in range(planes.GetNumberOfItems()))]
    return np.ascontiguousarray(np.array(world) @ np.array(matrix).reshape(4, 4))


def _leaves(data, attributes, state, name):
    """The visible polygon data below `data` with the attributes of their blocks, and all that is neither polygons nor blocks."""
    if data is None:
        return
    if attributes is not None:
        # A block's attributes apply to all blocks below it unless one overrides them.
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
    children = []
    if isinstance(data, vtkMultiBlockDataSet):
        children = [data.GetBlock(i) for i in range(data.GetNumberOfBlocks())]
    elif isinstance(data, vtkPartitionedDataSet):
        children = [data.GetPartitionAsDataObject(i) for i in range(data.GetNumberOfPartitions())]
    elif isinstance(data, vtkPartitionedDataSetCollection):
        children = [data.GetPartitionedDataSet(i) for i in range(data.GetNumberOfPartitionedDataSets())]
    else:
        yield data, state, name
    for i, child in enumerate(children):
        yield from _leaves(child, attributes, state, f"{name}/{i}" if name else str(i))
