"""Asks the library which props it can trace: facts about them, and its reason for OpenGL to draw one."""
import ctypes as C

from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkRenderingCore import vtkGlyph3DMapper

from . import library as rtv
from .arrays import MAPS

_PBR, _POLYGON_OFFSET = 3, 1


class Untraceable(Exception):
    """Raised for a prop that OpenGL has to draw; the text says why."""


def require(check, facts):
    """Raises `Untraceable` if a function of the library (`check`) finds a reason in `facts`."""
    reason = check(C.byref(facts))
    if reason:
        raise Untraceable(reason.decode())


def texture_bits(texture):
    if texture is None:
        return 0
    of = ((texture.GetTransform(), rtv.TEXTURE_TRANSFORM), (texture.GetCubeMap(), rtv.TEXTURE_CUBE_MAP), (texture.GetMipmap(), rtv.TEXTURE_MIPMAP))
    return rtv.TEXTURE | sum(bit for has, bit in of if has)


# What blocks may have of their own since VTK 9.3, which is not followed.
_OF_BLOCKS = (
    "ScalarVisibilities", "UseLookupTableScalarRanges", "InterpolateScalarsBeforeMappings", "ColorModes", "ScalarModes", "ArrayAccessModes",
    "ArrayComponents", "ArrayIds", "ArrayNames", "ScalarRanges", "LookupTables", "FieldDataTupleIds", "Textures")


def _has_scalars_of_blocks(mapper):
    attributes = mapper.GetCompositeDataDisplayAttributes() if hasattr(mapper, "GetCompositeDataDisplayAttributes") else None
    return attributes is not None and any(getattr(attributes, "HasBlock" + what, bool)() for what in _OF_BLOCKS)


def _has_polygon_offset(mapper):
    factor, units = reference(0.0), reference(0.0)
    if mapper.GetResolveCoincidentTopology() == _POLYGON_OFFSET:
        mapper.GetCoincidentTopologyPolygonOffsetParameters(factor, units)
    return bool(factor != 0 or units != 0)


def actor_facts(renderer, actor, mapper):
    f = rtv.ActorFacts()
    # Classes derived in Python (PyVista's) have the names of their VTK base classes.
    f.actor_class, f.mapper_class = actor.GetClassName().encode(), mapper.GetClassName().encode()
    p, back, shader, planes = actor.GetProperty(), actor.GetBackfaceProperty(), actor.GetShaderProperty(), mapper.GetClippingPlanes()
    f.representation, f.pbr = p.GetRepresentation(), p.GetInterpolation() == _PBR
    f.edge_visibility, f.lines_as_tubes = bool(p.GetEdgeVisibility()), bool(p.GetRenderLinesAsTubes())
    f.edge_opacity = p.GetEdgeOpacity() if hasattr(p, "GetEdgeOpacity") else 1.0
    f.vertex_visibility = bool(p.GetVertexVisibility())
    f.has_back, f.back_opacity = back is not None, back.GetOpacity() if back is not None else 1.0
    # It may look at all colours, so only where it matters.
    f.translucent = bool((f.edge_visibility or f.has_back) and actor.HasTranslucentPolygonalGeometry())
    f.num_clipping_planes = planes.GetNumberOfItems() if planes else 0
    f.coat_strength, f.anisotropy, f.metallic, f.edge_tint[:] = p.GetCoatStrength(), p.GetAnisotropy(), p.GetMetallic(), p.GetEdgeTint()
    f.shader_code = bool(shader.HasFragmentShaderCode() or shader.HasVertexShaderCode() or shader.GetNumberOfShaderReplacements() > 0)
    f.glyphs = isinstance(mapper, vtkGlyph3DMapper)
    f.texture, f.num_textures = texture_bits(actor.GetTexture()), p.GetNumberOfTextures()
    if f.texture and not p.GetShowTexturesOnBackface():
        f.texture |= rtv.TEXTURE_FRONT_ONLY
    f.block_scalars = _has_scalars_of_blocks(mapper)
    f.polygon_offset = _has_polygon_offset(mapper)
    f.image_lighting = bool(renderer.GetUseImageBasedLighting() and renderer.GetEnvironmentTexture())
    if f.num_textures:
        f.albedo = texture_bits(p.GetTexture("albedoTex"))
        for field, name in MAPS.items():
            setattr(f, field, texture_bits(p.GetTexture(name)))
    return f


def prop_facts(prop):
    """Facts about a prop that is neither an actor with a mapper nor a volume."""
    return rtv.ActorFacts(actor_class=prop.GetClassName().encode())
