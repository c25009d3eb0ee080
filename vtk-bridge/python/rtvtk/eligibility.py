"""Reasons in an actor itself and in its cells for which OpenGL has to draw it."""
from vtkmodules.vtkRenderingCore import vtkGlyph3DMapper

from . import arrays

ACTORS = {"vtkActor", "vtkOpenGLActor", "vtkLODActor", "vtkQuadricLODActor"}
MAPPERS = {"vtkPolyDataMapper", "vtkOpenGLPolyDataMapper", "vtkCompositePolyDataMapper", "vtkDataSetMapper", "vtkGlyph3DMapper",
           "vtkOpenGLGlyph3DMapper"}
POINTS, WIREFRAME, SURFACE = range(3)
_PBR = 3


class Untraceable(Exception):
    """Raised for a prop that OpenGL has to draw; the text says why."""


def check_actor(actor, mapper, point_radius, line_radius):
    p = actor.GetProperty()
    # Classes derived in Python (PyVista's) are recognised by the names of their VTK base classes.
    if actor.GetClassName() not in ACTORS:
        raise Untraceable("OpenGL draws props of this class")
    if p.GetRepresentation() == WIREFRAME and line_radius <= 0:
        raise Untraceable("wireframe (set RTV_LINE_RADIUS to trace edges as tubes)")
    if p.GetRepresentation() == POINTS and point_radius <= 0:
        raise Untraceable("points (set RTV_POINT_RADIUS to trace them as spheres)")
    if p.GetRepresentation() == SURFACE and p.GetEdgeVisibility():
        _check_edges(actor, mapper, p)
    if p.GetRepresentation() == SURFACE and p.GetVertexVisibility():
        raise Untraceable("vertices on the surface")
    back = actor.GetBackfaceProperty()
    if back is not None:
        if actor.HasTranslucentPolygonalGeometry() or back.GetOpacity() < 1:
            raise Untraceable("translucent backs with a property of their own")
        if isinstance(mapper, vtkGlyph3DMapper):
            raise Untraceable("glyphs whose backs have a property of their own")
    if p.GetInterpolation() == _PBR:
        if p.GetCoatStrength() > 0 or p.GetAnisotropy() != 0:
            raise Untraceable("a clear coat or anisotropy")
        if p.GetMetallic() > 0 and p.GetEdgeTint() != (1, 1, 1):
            raise Untraceable("a metal with an edge tint")
    if p.GetNumberOfTextures() > 0:
        _check_textures(actor, mapper, p)
    shader = actor.GetShaderProperty()
    if shader.HasFragmentShaderCode() or shader.HasVertexShaderCode() or shader.GetNumberOfShaderReplacements() > 0:
        raise Untraceable("shader code of its own")
    if actor.GetTexture() is not None:
        reason = arrays.why_not_texture(actor.GetTexture())
        if reason:
            raise Untraceable(reason)
    if mapper.GetClassName() not in MAPPERS:
        raise Untraceable("OpenGL draws mappers of this class")


def _check_edges(actor, mapper, p):
    if p.GetRenderLinesAsTubes():
        raise Untraceable("edges as shaded tubes on the surface")
    if hasattr(p, "GetEdgeOpacity") and p.GetEdgeOpacity() < 1:
        raise Untraceable("translucent edges on the surface")
    if actor.HasTranslucentPolygonalGeometry():
        raise Untraceable("edges on a translucent surface")
    if mapper.GetClippingPlanes() and mapper.GetClippingPlanes().GetNumberOfItems() > 0:
        raise Untraceable("edges on a clipped surface")


def _check_textures(actor, mapper, p):
    known = [t for t in (p.GetTexture(name) for name in ("albedoTex", *arrays.MAPS.values())) if t is not None]
    if p.GetNumberOfTextures() > len(known):
        raise Untraceable("textures of the property for coats or anisotropy, or of a program's own shader")
    if isinstance(mapper, vtkGlyph3DMapper) and any(p.GetTexture(name) is not None for name in arrays.MAPS.values()):
        raise Untraceable("glyphs with textures of the property other than its base colour")
    if actor.GetTexture() is not None:
        raise Untraceable("a texture and a texture of the property")
    if p.GetInterpolation() != _PBR:
        raise Untraceable("textures of the property without physically based shading")
    for texture in known:
        reason = arrays.why_not_texture(texture)
        if reason:
            raise Untraceable(reason)


def check_cells(data, representation, point_radius, line_radius):
    if representation != SURFACE:
        return
    if data.GetNumberOfVerts() > 0 and point_radius <= 0:
        raise Untraceable("it has vertices (set RTV_POINT_RADIUS to trace them as spheres)")
    if data.GetNumberOfLines() > 0 and line_radius <= 0:
        raise Untraceable("it has lines (set RTV_LINE_RADIUS to trace them as tubes)")
