"""Lights and camera."""
import ctypes as C

from . import library as rtv


def add_lights(bridge, renderer):
    lights = renderer.GetLights()
    if lights.GetNumberOfItems() == 0 and renderer.GetAutomaticLightCreation():
        # The renderer would do it a moment later.
        renderer.CreateLight()
    renderer.UpdateLightsGeometryToFollowCamera()
    for i in range(lights.GetNumberOfItems()):
        light = lights.GetItemAsObject(i)
        if not light.GetSwitch():
            continue
        out = rtv.Light()
        out.position[:], out.focal_point[:] = light.GetTransformedPosition(), light.GetTransformedFocalPoint()
        out.color[:] = [c * light.GetIntensity() for c in light.GetDiffuseColor()]
        out.attenuation[:] = light.GetAttenuationValues()
        out.cone_angle_deg, out.exponent = light.GetConeAngle(), light.GetExponent()
        positional = bool(light.GetPositional())
        spot = positional and light.GetConeAngle() < 90
        out.kind = rtv.LIGHT_SPOT if spot else rtv.LIGHT_POINT if positional else rtv.LIGHT_DIRECTIONAL
        out.headlight = bool(light.LightTypeIsHeadlight()) and not positional
        bridge.light(C.byref(out))


def view_of(renderer, width, height):
    out = rtv.View()
    camera = renderer.GetActiveCamera()
    # Everything is in it: window centre, explicit projections, tiles. Depth from -1 to 1, as OpenGL has it.
    m = camera.GetCompositeProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1.0, 1.0)
    out.clip_from_world[:] = [m.GetElement(i, j) for i in range(4) for j in range(4)]
    out.background_bottom[:] = renderer.GetBackground()
    out.background_top[:] = renderer.GetBackground2() if renderer.GetGradientBackground() else renderer.GetBackground()
    out.focus_distance = camera.GetDistance()
    out.width, out.height = width, height
    out.interactive = renderer.GetRenderWindow().GetDesiredUpdateRate() > 1.0
    out.shadows = bool(renderer.GetUseShadows())
    return out
